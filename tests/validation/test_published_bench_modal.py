"""The two-beam bench of Meziane, Baillet and Laulagnet (2006), table II and section 2.2: the modal side."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as sl

from benches import paper_case
from stridor.modal.complex_modes import complex_modes
from stridor.modal.onsets import onsets
from stridor.system import build_system

pytestmark = pytest.mark.validation

MISPRINTS = {8840.0: 8440.0, 25533.0: 25318.0}  # c/4L and 3c/4L of beam 2


@pytest.fixture(scope="module")
def system():
    return build_system(paper_case())


def alone(system, body: str) -> np.ndarray:
    freedoms = next(line.freedoms for line in system.lines if line.name == body)
    pick = np.ix_(freedoms, freedoms)
    squares = sl.eigvalsh(system.stiffness.toarray()[pick], system.mass.toarray()[pick])
    return np.sqrt(np.maximum(squares, 0.0)) / (2 * np.pi)


@pytest.mark.parametrize("body", ["beam1", "beam2"])
def test_beams_alone(system, body):
    got = alone(system, body)
    printed = [r.frequency_hz for r in paper_case().reference.bodies[body]]
    assert len(printed) == {"beam1": 6, "beam2": 12}[body]
    got = got[got < 28.5e3]
    # One to one: nothing printed is skipped, nothing computed either.
    got = np.where(got < 1.0, 0.0, got)[: len(printed)]
    for value, frequency in zip(got, printed, strict=True):
        if frequency in MISPRINTS:
            assert value == pytest.approx(MISPRINTS[frequency], rel=1e-3)
            assert abs(value / frequency - 1) > 5e-3
        else:
            assert value == pytest.approx(frequency, rel=1e-3, abs=0.55)


def test_coupled_without_friction(system):
    modes = complex_modes(system, 0.0, count=19, damped=False)
    got = modes.frequency_hz[0]
    assert got[15] == pytest.approx(27205, abs=5)  # the one that table II lacks
    printed = [r.frequency_hz for r in paper_case().reference.coupled]
    np.testing.assert_allclose(np.delete(got, 15), printed, rtol=3e-3, atol=0.55)
    recovered = [102, 489, 661, 1780, 3030, 3734, 5935, 8426, 8440, 8809, 12870, 16158, 16987, 20691, 25321,
                 27205, 27761, 30572, 35367]  # fmt: skip
    np.testing.assert_allclose(got, recovered, atol=0.75)


@pytest.mark.parametrize("damped", [False, True])
def test_the_four_onsets(system, damped):
    found = onsets(system, (0.0, 1.0), max_frequency_hz=40e3, damped=damped).onsets
    expected = [(0.0766, 8635), (0.1376, 16684), (0.1670, 28819), (0.8079, 3620)]
    assert [(o.kind, o.stabilising, o.damped) for o in found] == [("flutter", False, damped)] * 4
    for o, (mu, frequency) in zip(found, expected, strict=True):
        assert o.mu == pytest.approx(mu, rel=5e-3)
        assert o.frequency_hz == pytest.approx(frequency, rel=5e-4)
        assert o.residual < 1e-12
    # Branches as numbered in figure 5, with the mode that table II lacks and the traction mode counted.
    assert [o.branches for o in found] == [(8, 10), (12, 13), (17, 18), (5, 6)]


def test_one_unstable_mode_at_a_tenth(system):
    modes = complex_modes(system, 0.1, max_frequency_hz=45e3)
    below = modes.unstable[0] & (modes.frequency_hz[0] < 40e3)
    assert below.sum() == 1
    k = int(np.flatnonzero(below)[0])
    assert modes.frequency_hz[0, k] == pytest.approx(8641.0, rel=1e-3)
    assert modes.growth_rate[0, k] == pytest.approx(637, rel=1e-2)
    twin = np.argmin(
        np.abs(modes.frequency_hz[0] - 8641.0) + 1e9 * (np.arange(modes.frequency_hz.shape[1]) == k)
    )
    assert modes.growth_rate[0, twin] == pytest.approx(-717, rel=1e-2)
    at = complex_modes(system, 0.12, max_frequency_hz=50e3)
    assert np.any(np.abs(at.frequency_hz[0, at.unstable[0]] - 41.7e3) < 100)


@pytest.mark.parametrize("change", ["velocity", "lean"])
def test_the_reversed_bench_is_silent(change):
    case = paper_case()
    if change == "velocity":
        case = case.with_({"supports.clamp.velocity": {"x": -0.02}})
    else:
        case = case.with_({"bodies.beam1.angle_deg": 95.0})
    answer = onsets(build_system(case), (0.0, 0.5), max_frequency_hz=40e3)
    assert answer.onsets == ()
    both = case.with_({"supports.clamp.velocity": {"x": -0.02}, "bodies.beam1.angle_deg": 95.0})
    assert onsets(build_system(both), (0.0, 0.1), max_frequency_hz=20e3).onsets[0].mu == pytest.approx(
        0.0767, rel=5e-3
    )


def highest(system) -> float:
    """Highest ω [rad/s] of the structure without contacts."""
    squares = []
    for part in system.components:
        pick = np.ix_(part, part)
        squares.append(sl.eigvalsh(system.stiffness.toarray()[pick], system.mass.toarray()[pick])[-1])
    return float(np.sqrt(max(squares)))


def test_explicit_limit_of_the_mass_matrices(system):
    assert 2 / highest(system) == pytest.approx(2.116e-8, rel=1e-3)
    assert system.size == 361  # 31 and 91 nodes of 3, less 2 held on beam 1 and 3 on beam 2
    lumped = build_system(paper_case().with_({"bodies.beam1.mass": "lumped", "bodies.beam2.mass": "lumped"}))
    assert lumped.size == 361
    # Nodes of beam 2 turning all alike: ω² = (12 EI/h) / (ρA h³/39), to the little that deflection adds.
    h, thickness, speed = 0.15 / 90, 3e-3, np.sqrt(200e9 / 7800)
    assert highest(lumped) == pytest.approx(np.sqrt(468 / 12) * speed * thickness / h**2, rel=1e-2)


def test_damping_ratios_of_equation_13():
    body = paper_case().bodies["beam1"].damping.law_object()
    assert 100 * body.damping_ratio(2 * np.pi * 8.7e3) == pytest.approx(0.073, abs=5e-4)
    assert 100 * body.damping_ratio(2 * np.pi * 28.8e3) == pytest.approx(0.104, abs=5e-4)

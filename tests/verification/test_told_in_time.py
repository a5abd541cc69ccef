"""What a small perturbation tells in time: fastest growth of random systems against dense truth, whichever contact moves
in it, or that the motion is too short to tell."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import scipy.sparse as sp

import stridor as st
from random_rubbing import random_rubbing
from stridor.agreement import Perturbation, critical, perturbation
from stridor.agreement.critical import critical_friction
from stridor.agreement.kept import perturbation_data, perturbation_of
from stridor.agreement.result import judge
from stridor.agreement.shapes import component_shape
from stridor.agreement.small_motion import linear_parts
from stridor.agreement.told import band_of, certain, told
from stridor.temporal.signals import Components, components

pytestmark = pytest.mark.verification

FEW = (0, 4, 15, 19, 41, 50, 59)


@pytest.mark.parametrize("seed", [*FEW[:3], *(pytest.param(s, marks=pytest.mark.slow) for s in (*FEW[3:], *range(60, 200)))])
def test_the_fastest_of_random_systems_is_seen_in_time(seed: int) -> None:
    """A band of 50 Hz for modes below 1 Hz, and contacts that do not all move in the fastest mode."""
    made = random_rubbing(seed)
    if not made.pressed:
        pytest.skip("a contact is open")
    lam = made.modes()[0]
    (one,) = st.compare(made.case, [made.mu], critical=False, only=["growth"]).comparisons
    assert one.agrees is True, one.verdict
    assert one.growth_mac is None or one.growth_mac > 0.99
    # Of the scheme: (ωΔt)²/24 in frequency.
    near = lam[np.argmin(np.abs(lam - one.perturbation.eigenvalue))]
    assert one.perturbation.growth_rate == pytest.approx(near.real, rel=0.02, abs=2e-6)
    if lam[0].real > 1e-6:
        assert near == lam[0]
    else:
        assert not one.perturbation.grows


def two_contacts(length: float, lam: list[complex], shares: list[list[float]]) -> tuple[np.ndarray, float]:
    time = np.arange(0.0, length, 0.05)
    return np.real(np.exp(np.outer(time, lam) + 1j) @ np.array(shares)), 0.05


def test_components_of_several_signals_are_those_of_each() -> None:
    lam = [0.01 + 2.0j, -0.02 + 2.3j, -0.001 + 1.1j]
    signals, sampling = two_contacts(120.0, lam, [[1.0, 0.0], [0.0, 1.0], [0.5, 0.2]])
    found = components(signals, sampling, max_frequency_hz=1.0)
    assert sorted(found.eigenvalues, key=lambda x: x.real) == pytest.approx(sorted(lam, key=lambda x: x.real), abs=1e-6)
    alone = components(signals[:, 1], sampling, max_frequency_hz=1.0)
    assert alone.fastest == pytest.approx(lam[2], abs=1e-6)


def test_what_dies_early_or_hardly_moves_is_not_split_with_what_lasts() -> None:
    time = np.arange(4000) * 0.05
    lasting, short = np.exp(-0.01 * time) * np.cos(time), 3.0 * np.exp(-0.2 * time) * np.cos(2.0 * time)
    signals = np.stack([short + 1e-7, lasting, 1e-4 * lasting], axis=1)
    left = linear_parts(signals, np.full(3, 1e4))
    assert left.shape == (4000, 1)
    assert np.array_equal(left[:, 0], lasting)
    # Where nothing dies both are kept, the larger first, as long as all are small.
    grown = linear_parts(np.stack([lasting, 2.0 * lasting * np.exp(0.03 * time)], axis=1), np.full(2, 1e3))
    assert grown.shape[1] == 2
    assert 0 < len(grown) < 4000
    assert np.abs(grown).max() <= 20.0
    assert np.abs(grown[:, 0]).max() > np.abs(grown[:, 1]).max()


def test_parts_of_a_signal_that_is_too_short_tell_other_modes() -> None:
    lam = [-2e-4 + 0.67j, -4e-3 + 0.85j, -4e-3 + 1.28j, -0.011 + 1.36j, -1e-3 + 1.78j, 5e-5 + 1.95j, -2e-3 + 2.03j]
    shares = [[1.0], [0.9], [1.0], [0.8], [1.0], [0.9], [1.0]]
    rng = np.random.default_rng(1)

    def sure(length: float, *, sign: bool = False) -> tuple[bool, complex]:
        signals, sampling = two_contacts(length, lam, shares)
        signals += 1e-9 * rng.standard_normal(signals.shape)
        found, band = told(signals, sampling, 5.0, 0.33)
        return certain(signals, sampling, band, found, sign=sign), found.fastest

    assert not sure(24.0)[0]
    assert not sure(24.0, sign=True)[0]
    good, fastest = sure(600.0)
    assert good
    assert fastest == pytest.approx(lam[5], abs=1e-6)
    assert sure(600.0, sign=True)[0]


def test_what_moves_beyond_the_modes_is_seen_as_well() -> None:
    lam = [-1e-3 + 2.0j, 2e-3 + 40.0j]
    signals, sampling = two_contacts(400.0, lam, [[1.0], [0.1]])
    found, band = told(signals, sampling, 8.0, 2.0 / (2 * np.pi))
    assert band == band_of(400.0, 8.0, 2.0 / (2 * np.pi)) < 40.0 / (2 * np.pi)
    assert found.fastest == pytest.approx(lam[1], rel=1e-5)
    assert found.eigenvalues[0] == pytest.approx(lam[0], rel=1e-5)


def test_what_is_too_short_to_be_told_is_not_decided(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a march that may not become longer nothing false is said."""
    made = random_rubbing(15, step=0.05)
    monkeypatch.setattr(perturbation, "MOST_WORK", 0.0)
    monkeypatch.setattr(perturbation, "PERIODS_OF_BAND", 400)
    (one,) = st.compare(made.case, [made.mu], critical=False, only=["growth"]).comparisons
    assert one.agrees is None
    assert "modal says unstable, but the motion in time lasts 8 s" in one.verdict
    assert "too short to tell" in one.verdict
    again = perturbation_of(made.mu, perturbation_data(one.perturbation))
    assert (again.untold, again.left) == (one.perturbation.untold, False)


def test_a_match_needs_no_parts_and_growth_out_of_the_range_is_no_decay() -> None:
    nothing = Components(np.zeros(0, dtype=complex), np.zeros(0))

    def said(seen: complex, mode: complex) -> bool | None:
        found = Perturbation(0.6, seen, np.zeros(0), 1.0, nothing, untold="too short", left=True)
        rate = abs(seen.real - mode.real) / abs(mode.real)
        return judge(0.6, mode.real > 0, mode, found, abs(seen.imag / mode.imag - 1.0), rate)[0]

    assert said(0.05 + 1.1j, 0.05 + 1.1j) is True
    assert said(-0.05 + 1.1j, 0.05 + 1.1j) is None
    assert said(0.05 + 1.1j, -0.05 + 1.1j) is None


@pytest.mark.parametrize("silent", [0.0, 0.02, 0.3])
def test_bisection_in_time_passes_by_what_is_not_told(monkeypatch: pytest.MonkeyPatch, silent: float) -> None:
    """Growth begins at 0.5 and is not told within ``silent`` of it: the bracket ends there."""

    def marched(system: object, mu: float, **_: object) -> SimpleNamespace:
        untold = "" if abs(mu - 0.5) > silent else "too short"
        return SimpleNamespace(grows=mu > 0.5 and not untold, untold=untold, grown=mu > 0.7)

    monkeypatch.setattr(critical, "perturb", marched)
    if silent > 0.2:
        with pytest.raises(st.AnalysisError, match=r"no growth is told at μ = 0\.35: too short"):
            critical_friction(None, (0.35, 0.75), settings=None)
        return
    middle, (low, high) = critical_friction(None, (0.35, 0.75), settings=None, tolerance=1e-3)
    assert low < 0.5 < high
    assert (high - low <= 1e-3) == (silent == 0.0)
    assert low == pytest.approx(0.5 - silent, abs=max(silent, 1e-3))
    held = critical._held(0.5, middle, (low, high), 1e-3)
    assert held.agrees is (True if silent == 0.0 else None)
    assert critical._held(0.6, middle, (low, high), 1e-3).agrees is False


def test_slow_flutter_is_an_onset_in_time() -> None:
    """A mode of 0.1 Hz in a band of 50 Hz: what turned less than twice was taken for none."""
    made = random_rubbing(15)
    found = st.compare(made.case, only=["critical"])
    dense = [random_rubbing(15, mu=float(mu)).modes()[0][0].real > 0.0 for mu in np.linspace(0.01, 0.7, 70)]
    first = np.linspace(0.01, 0.7, 70)[int(np.argmax(dense))]
    assert found.agree, found.verdict
    assert found.critical_mu_temporal == pytest.approx(first, abs=0.015)


def test_a_shape_is_told_only_where_the_fit_leaves_little() -> None:
    """A body that moves in what no contact shows: its motion is fitted with what was started, or nothing is told."""
    time = np.arange(0.0, 100.0, 0.05)
    seen, hidden = 0.03 + 1.9j, -0.002 + 1.3j
    shape = np.array([1.0, 0.5j, 0.2, -0.3])
    motion = np.real(np.outer(np.exp(seen * time), shape) + 40.0 * np.outer(np.exp(hidden * time), [0.0, 0.0, 1.0, 1j]))
    given = sp.eye_array(4, format="csr"), time, motion, np.array([seen]), seen, 50.0
    assert component_shape(*given) is None
    told_by = component_shape(*given, np.array([seen * (1 + 1e-4), hidden]))
    assert told_by is not None
    assert told_by.likeness(shape) > 0.999


def test_a_shape_that_is_not_told_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(perturbation, "component_shape", lambda *_: None)
    made = random_rubbing(15)
    (one,) = st.compare(made.case, [made.mu], critical=False, only=["growth"]).comparisons
    assert one.growth_mac is None
    assert "in which shape is not told" in one.verdict


def test_decay_that_the_contacts_do_not_show_is_said() -> None:
    """A mass that rubs on nothing and dies out last."""
    made = next(made for made in map(random_rubbing, range(60, 120)) if made.pressed and made.modes()[0][0].real < -1e-3)
    data = made.case.model_dump(mode="json", exclude_none=True)
    data["bodies"]["alone"] = {"type": "mass", "mass": 1.0, "position": [20.0, 0.0]}
    for name, direction, damping in (("x", [1.0, 0.0], 2e-4), ("y", [0.0, 1.0], 0.1)):
        data["springs"][f"alone-{name}"] = {
            "between": ["alone", "ground"], "direction": direction, "stiffness": 2.0, "damping": damping
        }  # fmt: skip
    (one,) = st.compare(st.Case.model_validate(data), [made.mu], critical=False, only=["growth"]).comparisons
    assert one.agrees is True
    assert one.perturbation.growth_rate == pytest.approx(made.modes()[0][0].real, rel=0.02)
    rate, _, rest = one.verdict.rpartition("Hz with ")[2].partition(" ")
    assert rest.startswith("1/s dies out last, which the motion in time does not show: contacts may not, or its step")
    assert float(rate) == pytest.approx(-1e-4, rel=1e-3)  # written -1.000e-04 or -0.0001000, by its last bit
    (whole,) = st.compare(made.case, [made.mu], critical=False, only=["growth"]).comparisons
    assert "dies out last" not in whole.verdict

"""Numbers of falling friction laws and speeds: derivatives, counter-measures and what is said of fast divergence."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from test_sensitivities import MINIMAL

import stridor as st
from benches import paper_case
from matrix_cases import matrix_case
from stridor.case import Case, loads
from stridor.errors import AnalysisError, CaseError
from stridor.modal.full import full_onsets
from stridor.study.analyses import modes, onsets
from stridor.study.countermeasures import rank_countermeasures
from stridor.study.measures import Verified
from stridor.study.sensitivities import sensitivities

pytestmark = pytest.mark.verification

LAW = {"law": "weakening", "coefficient": 0.1, "static_coefficient": 0.3, "decay_speed": 0.02}
SMALL = {"bodies.beam1.elements": 6, "bodies.beam2.elements": 18, "contacts.A.friction": LAW}


@pytest.fixture(scope="module")
def falling():
    return paper_case().with_(SMALL)


@pytest.mark.parametrize(
    "path",
    [
        "contacts.A.friction.decay_speed",
        *(pytest.param(f"contacts.A.friction.{name}", marks=pytest.mark.slow) for name in ("static_coefficient", "coefficient")),
        *(pytest.param(path, marks=pytest.mark.slow) for path in ("supports.clamp.velocity.x", "materials.steel.density")),
    ],
)
def test_what_changes_the_coefficient_of_a_law_does_so_in_the_derivative(falling, path: str):
    found = sensitivities(falling, path)
    assert len(found.branch) > 3
    value, step = float(found.values[0]), 1e-4
    above, below = (modes(falling.with_({path: value * (1 + sign * step)})) for sign in (1, -1))
    for lam, derivative in zip(found.eigenvalues, found.derivative[0], strict=True):
        high, low = (e[np.nanargmin(np.abs(e - lam))] for e in (above.eigenvalues[0], below.eigenvalues[0]))
        assert derivative * value == pytest.approx((high - low) / (2 * step), rel=2e-4, abs=1e-5 * abs(lam))
    assert not any("held" in line for line in found.warnings)


def beside_itself(one: Case) -> dict[str, Any]:
    """MINIMAL twice, the second far from the first."""
    twin = one.model_dump(mode="json", exclude_none=True)
    for table, name in (("bodies", "m"), ("loads", "weight"), ("contacts", "rub")):
        twin[table] |= {f"{name}2": dict(twin[table][name])}
    for table in ("springs", "dashpots"):
        twin[table] |= {
            f"{name}2": spring | {"between": ["m2", "ground"]} for name, spring in list(twin[table].items())
        }
    twin["bodies"]["m2"]["position"] = [5.0, 0.0]
    twin["loads"]["weight2"]["at"] = twin["contacts"]["rub2"]["slave"] = "m2"
    return twin


def test_a_number_of_one_law_of_two_is_not_held_in_silence():
    """Two contacts of one law; another number in one of them gives them two coefficients, which no μ of modes has."""
    data = beside_itself(loads(MINIMAL))
    for contact in data["contacts"].values():
        contact["friction"] = LAW | {"decay_speed": 5.0}
    both = Case.model_validate(data)
    path = "contacts.rub2.friction.decay_speed"
    with pytest.raises(CaseError, match="mu, or a number that all contacts take their friction from"):
        sensitivities(both, path, modes="all")
    # At a μ that was asked for it is held, and told; what all contacts share moves them alike.
    mu = modes(both).mu[0]
    asked = sensitivities(both, path, mu=1.01 * mu, modes="all")
    assert any("friction is held" in line for line in asked.warnings)
    sensitivities(both, ["mu", "springs.x.stiffness"], modes="all")


def test_a_friction_that_was_asked_for_is_held_and_told(falling):
    found = sensitivities(falling, ["contacts.A.friction.decay_speed", "materials.steel.density"], mu=0.12)
    held = [line for line in found.warnings if "friction is held at μ = 0.12" in line]
    assert len(held) == 1
    assert held[0].startswith("contacts.A.friction.decay_speed")


@pytest.fixture(scope="module")
def few():
    """Of fewer modes."""
    return paper_case().with_(SMALL | {"bodies.beam1.elements": 4, "bodies.beam2.elements": 6, "modal.max_frequency_hz": 10e3})


def test_a_changed_law_is_solved_again_with_its_own_friction(few):
    path = "contacts.A.friction.decay_speed"
    found = rank_countermeasures(few, numbers=[path], added_mass=False, chamfers=0, verify=1)
    (measure,) = found.measures
    changed = few.with_({path: 0.02 * (1 + 0.01 * measure.direction * measure.percent)})
    again = modes(changed)
    growing = again.eigenvalues[0][again.unstable[0] & again.in_band[0]].real.sum()
    before = modes(few)
    had = before.eigenvalues[0][before.unstable[0] & before.in_band[0]].real.sum()
    assert measure.verified.removed == pytest.approx(had - growing, rel=1e-6, abs=1e-6 * had)


def test_modes_that_diverge_faster_than_the_band_are_sought_there_too(falling):
    """Falling friction of a light node drives a motion faster than anything oscillates in the band."""
    found = modes(falling)
    fastest = found.growth_rate[0].max()
    assert fastest > 2 * np.pi * falling.modal.max_frequency_hz
    (said,) = found.completeness
    assert said.startswith("Checked: 6 modes grow, 2 of them without oscillating")


def test_unstable_modes_that_are_all_repeated_rank_nothing_and_say_so():
    """Two equal sliders beside each other: every mode is double, and derivatives belong to neither of two."""
    one = loads(MINIMAL)
    case = Case.model_validate(beside_itself(one))
    found = rank_countermeasures(case, mu=0.9)
    assert not found.measures
    assert found.warnings[-1].startswith("the unstable modes have no derivatives")
    alone = rank_countermeasures(one, mu=0.9)
    assert alone.measures


def test_a_growing_pair_that_parts_on_the_real_axis_did_not_begin_above_the_band(tmp_path):
    """λ² + (0.05 − 3μ)λ + 1: unstable from μ = 1/60 on, and two real roots from μ = 2.05/3 on."""
    damping = 0.05 * np.eye(4)
    falling, turning = np.diag([-3.0, 0.0, 0.0, 0.0]), np.zeros((4, 4))
    turning[1, 2], turning[2, 1] = 3.0, -3.0
    terms = [
        (np.eye(4), "mass", ""),
        (np.diag([1.0, 4.0, 9.0, 16.0]), "stiffness", ""),
        (damping, "damping", ""),
        (falling, "damping", "mu"),
        (turning, "stiffness", "mu"),
    ]
    found = onsets(matrix_case(tmp_path, terms, 2.0))
    assert found.complete
    assert "above 2 Hz" not in found.completeness
    assert "as the onsets say (a growing pair parted into two growing motions without oscillation)" in found.completeness
    # Where branches are not followed it is said with the count.
    work = st.Workspace(matrix_case(tmp_path, terms, 2.0))
    counted = full_onsets(
        work.system, work.modal.friction_range, max_frequency_hz=2.0, damped=True, options=work.options, unfollowed=""
    )
    assert counted.complete
    assert " (a growing pair parted into two growing motions without oscillation). " in counted.completeness
    assert "Onsets were enclosed by that count" in counted.completeness or "along the imaginary axis" in counted.completeness


def test_modes_without_friction_of_a_law_of_speed_are_those_of_constant_friction(falling):
    """At μ = 0 nothing of the law is left; traction modes then stand on poles of the receptance that speeds see."""
    plain = falling.with_({"contacts.A.friction": {"law": "coulomb", "coefficient": 0.1}})
    found, expected = (modes(case, 0.0, damped=False) for case in (falling, plain))
    np.testing.assert_allclose(found.frequency_hz[0], expected.frequency_hz[0], rtol=1e-9)
    swept = modes(falling, [0.0, 0.1], damped=False)
    np.testing.assert_allclose(swept.frequency_hz[0, :19], expected.frequency_hz[0], rtol=1e-9)


def test_onsets_without_damping_of_the_structure_keep_the_slope_of_friction():
    """A slider on falling friction, without a dashpot: it grows from no friction on."""
    slider = loads(MINIMAL).model_dump(mode="json", exclude_none=True)
    slider["contacts"]["rub"]["friction"] = LAW | {"static_coefficient": 0.15, "decay_speed": 1.0}
    case = Case.model_validate(slider)
    found, whole = (
        onsets(case.with_({"modal.source": source}), damped=False, friction_range=(0.0, 0.3)) for source in ("auto", "full")
    )
    assert found.complete
    assert whole.complete
    for mu in (0.05, 0.29):
        grown = [modes(case.with_({"modal.source": s}), mu, damped=False) for s in ("auto", "krylov", "full")]
        assert grown[0].growth_rate[0].max() > 1e-3
        for other in grown[1:]:
            assert other.growth_rate[0].max() == pytest.approx(grown[0].growth_rate[0].max(), rel=1e-8)
        grows = int(np.count_nonzero(grown[0].unstable[0]))
        for said in (found, whole):
            assert grows == sum(-1 if o.stabilising else 1 for o in said if o.mu < mu)


# A mass on a belt, whose dashpot a support draws upwards at speed v: N = 1 − 0.8 v.
DRAWN = """
units = "nondimensional"
bodies.m = {{ type = "mass", mass = 1.0, position = [0.0, 0.0] }}
bodies.top = {{ type = "mass", mass = 1.0, position = [0.0, 1.0] }}
bodies.belt = {{ type = "obstacle", shape = "flat", point = [0.0, 0.0], normal = [0.0, 1.0], sliding = {{ velocity = [1.0, 0.0] }} }}
supports.top = {{ at = "top", fixed = ["x", "y"], velocity = {{ y = {speed} }} }}
springs.k = {{ between = ["m", "ground"], stiffness = 1.0, damping = {along}, direction = [1.0, 0.0] }}
dashpots.d = {{ between = ["m", "top"], damping = 0.8, direction = [0.0, 1.0] }}
loads.press = {{ at = "m", force = [0.0, -1.0] }}
[contacts.rub]
slave = "m"
master = "belt"
stiffness = "rigid"
friction = {{ law = "hyperbolic", coefficient = 0.0, static_coefficient = 1.0, delta = 1.0 }}
[modal]
max_frequency_hz = 1.0
source = "{source}"
"""


@pytest.mark.parametrize("source", ["krylov", "full", pytest.param("reduced", marks=pytest.mark.slow)])
def test_without_damping_steady_sliding_keeps_the_drag_of_what_moves(source: str):
    """Only small motions lose their damping: the slope −μ/2 feeds N μ/4 = 0.075 into them at N = 0.6 and μ = 0.5."""
    case = loads(DRAWN.format(speed=0.5, along=0.0, source=source))
    bare = modes(case, 0.5, damped=False)
    assert bare.eigenvalues[0] == pytest.approx([0.075 + 1j * np.sqrt(1 - 0.075**2)], rel=1e-9)
    assert modes(case, 0.5).eigenvalues[0] == pytest.approx(bare.eigenvalues[0], rel=1e-9)  # nothing damps it along
    with pytest.raises(AnalysisError, match="no equilibrium"):  # 1 − 0.8 · 1.5 < 0: it lifts off
        modes(loads(DRAWN.format(speed=1.5, along=0.0, source=source)), 0.5, damped=False)


def test_what_has_no_damping_has_the_equilibrium_of_what_has():
    case = loads(DRAWN.format(speed=0.5, along=0.4, source="krylov"))
    assert modes(case, 0.5).growth_rate[0] == pytest.approx([0.075 - 0.2], rel=1e-9)
    lam = np.linalg.eigvals(-st.pencil(case, 0.5, damped=False).matrices()[1].toarray()[:1, :1])
    assert lam == pytest.approx([0.15], rel=1e-12)
    found = onsets(case, damped=False, friction_range=(0.2, 0.6))
    assert found.complete
    assert [lam.real for lam in found.at_start] == pytest.approx([0.25 * 0.6 * 0.2], rel=1e-9)
    assert sensitivities(case, "mu", mu=0.5, damped=False).derivative[0, 0].real == pytest.approx(0.25 * 0.6, rel=1e-6)


def test_receptances_without_damping_are_about_the_same_steady_sliding(falling: Case):
    """Two beams of few elements: a dashpot that moves draws the upper one up with 5 N of the 20 N that press it."""
    case = falling.with_({
        "bodies.beam1.elements": 2, "bodies.beam2.elements": 3, "modal.max_frequency_hz": 3e3,
        "bodies.hand": {"type": "mass", "mass": 1.0, "position": [0.1, 0.1]},
        "supports.hand": {"at": "hand", "fixed": ["x", "y"], "velocity": {"y": 0.5}},
        "dashpots.d": {"between": ["beam1.top", "hand"], "damping": 10.0, "direction": [0.0, 1.0]},
    })  # fmt: skip
    assert st.steady_sliding(case, mu=0.2).normal_force == pytest.approx([15.0], rel=1e-6)
    found, expected = (
        np.sort_complex([1j * lam.conj() for lam in one.eigenvalues[0] if lam.imag])
        for one in (modes(case.with_({"modal.source": s}), 0.2, damped=False, check=False) for s in ("receptance", "full"))
    )
    assert len(found) == 4
    assert found.imag.max() > 1.0  # what grows
    np.testing.assert_allclose(found, expected, rtol=1e-7)


def test_a_change_that_leaves_no_equilibrium_leaves_the_ranking_and_is_told(few, monkeypatch):
    from stridor.study import countermeasures as module

    refused = []
    solved = Verified(1.0, 1e3, 2.0, 2.0, (1e3,), "")

    def loose(_, measure, *rest):
        if not refused:
            refused.append(measure.words)
            raise AnalysisError("steady sliding has no equilibrium")
        return replace(measure, verified=solved)  # the test above solves one

    monkeypatch.setattr(module, "verified", loose)
    paths = ["materials.steel.density", "contacts.A.friction.decay_speed", "supports.clamp.velocity.x"]
    found = rank_countermeasures(few, numbers=paths, added_mass=False, chamfers=0, verify=1)
    assert refused[0] not in [m.words for m in found.measures]
    assert any(line.startswith(f"{refused[0]}: left out") for line in found.warnings)
    assert found.measures[0].verified is solved

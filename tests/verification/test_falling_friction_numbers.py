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

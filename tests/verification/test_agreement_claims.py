"""'agree' is said where frequency, growth and shape in time are the mode's, with a step that resolves them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import stridor as st
from mode_coupling import mode_coupling
from stridor.agreement import Perturbation
from stridor.agreement.partner import Partner, partner_of
from stridor.agreement.result import judge
from stridor.agreement.shapes import TimeShape, span_assurance
from stridor.case import Case
from stridor.temporal.signals import Components
from stridor.view.temporal_tables import agreement_table

pytestmark = pytest.mark.verification

@pytest.fixture(scope="module")
def coupled() -> Case:
    """Flutter from μ = 0.7506 on, marched explicitly with the default step."""
    explicit = {"temporal.stepper": "explicit", "temporal.step": None}
    return mode_coupling(0.02).with_(explicit | {"contacts.rub.friction.coefficient": 0.8, "comparison.critical": False})


def test_the_default_step_resolves_growth_of_masses(coupled: Case):
    found = st.compare(coupled, [0.8])
    assert found.agree
    assert found.comparisons[0].growth_rate_error < 0.03


def test_a_step_that_parts_both_approaches_is_named_and_nothing_is_decided(coupled: Case):
    found = st.compare(coupled.with_({"temporal.step": 0.1972}), [0.8])
    (one,) = found.comparisons
    assert one.growth_rate_error > 0.3
    assert one.agrees is None
    assert found.agree is None
    assert "the step parts them, take temporal.step = 0.025 or less" in one.verdict


def test_models_that_differ_disagree_whatever_the_step(coupled: Case, monkeypatch):
    """Modes of more damping than is marched: half the step changes nothing of that."""
    from stridor.agreement import comparison

    solve = comparison.modes_as_in_time
    other = coupled.with_({"dashpots.a.damping": 0.1})

    def wrong(system, mu, limit, options=None):
        return solve(st.build_system(other), mu, limit, options)

    monkeypatch.setattr(comparison, "modes_as_in_time", wrong)
    found = st.compare(coupled, [0.9])
    assert found.agree is False
    assert "the step" not in found.verdict


def test_a_vibration_that_grows_faster_than_a_divergence_is_told_beside_it():
    """Nothing is marched about what diverges; that there is no vibration is said where there is none."""
    nothing = Perturbation(0.9, 0j, np.zeros(0), 1.0, Components(np.zeros(0, dtype=complex), np.zeros(0)))
    alone = judge(0.9, True, 0.01 + 0j, nothing, 0.0, 0.0)
    assert alone[0] is None
    assert alone[1].endswith(" 1/s, so that there is no small vibration to compare")
    beside = judge(0.9, True, 0.01 + 0j, nothing, 0.0, 0.0, faster=0.1 + 2j)
    assert beside[0] is None
    assert "beside the fastest mode, 0.31831 Hz with 0.1000 1/s, which is not held against" in beside[1]
    assert "no small vibration" not in beside[1]


OTHER = {
    "changes with every step": lambda k: 1.5 + 0.5 * (-1) ** k,
    "comes right at a quarter": lambda k: (1.4, 1.2, 1.0)[min(k, 2)],
    "is not told with half": lambda k: None if k == 1 else 1.4,
}


@pytest.mark.parametrize("how", OTHER)
def test_a_motion_that_changes_with_its_step_decides_nothing(coupled: Case, monkeypatch, how: str):
    """Another frequency in time than the mode's; ``k`` halvings of the step."""
    from stridor.agreement import comparison

    march, coarse = comparison.perturb, list[float]()

    def wrong(system, mu, *, settings, **rest):
        found = march(system, mu, settings=settings, **rest)
        coarse[:] = coarse or [settings.step or comparison.perturbation_step(system, settings)]
        halvings = round(math.log2(coarse[0] / settings.step)) if settings.step else 0
        factor = OTHER[how](halvings)
        told = {"untold": "it is too short"} if factor is None else {"eigenvalue": found.eigenvalue * factor}
        return replace(found, **told)

    monkeypatch.setattr(comparison, "perturb", wrong)
    found = st.compare(coupled, [0.8], only=["growth"])
    (one,) = found.comparisons
    assert one.agrees is None
    assert "the step parts them, take temporal.step = " in one.verdict


def test_growth_in_another_shape_is_not_agreement(coupled: Case, monkeypatch):
    monkeypatch.setattr(TimeShape, "likeness", lambda _, vectors: 0.4)
    found = st.compare(coupled, [0.8])
    assert found.agree is None
    assert "grows in another shape than the mode, MAC 0.40" in found.verdict


def test_of_repeated_modes_any_combination_has_the_shape(coupled: Case):
    twin = coupled.model_dump(mode="json", exclude_none=True)
    for table, name in (("bodies", "m"), ("loads", "press"), ("contacts", "rub")):
        twin[table] |= {f"{name}2": dict(twin[table][name])}
    for table in ("springs", "dashpots"):
        twin[table] |= {f"{n}2": part | {"between": ["m2", "ground"]} for n, part in list(twin[table].items())}
    twin["bodies"]["m2"]["position"] = [5.0, 0.0]
    twin["loads"]["press2"]["at"] = twin["contacts"]["rub2"]["slave"] = "m2"
    (one,) = st.compare(Case.model_validate(twin), [0.8]).comparisons
    assert one.agrees
    assert one.growth_mac > 0.99


def test_what_grows_within_few_periods_is_not_decided(coupled: Case):
    """What is seen of it in time is twice its λ: the harmonic that falling friction makes of it."""
    law = {"law": "weakening", "coefficient": 0.2, "static_coefficient": 8.0, "decay_speed": 1.0}
    found = st.compare(coupled.with_({"contacts.rub.friction": law}))
    assert found.agree is None
    assert "periods only, too few to take a rate from" in found.verdict


def test_of_what_diverges_no_number_in_time_is_told(coupled: Case):
    """Falling friction beyond the critical damping of the mass: two real roots, and nothing was marched."""
    law = {"law": "weakening", "coefficient": 0.2, "static_coefficient": 2.2, "decay_speed": 0.1}
    found = st.compare(coupled.with_({"contacts.rub.friction": law, "bodies.belt.sliding.velocity": [-0.1, 0.0]}))
    (one,) = found.comparisons
    assert one.modal_eigenvalue.imag == 0.0
    assert not one.marched
    document = one.to_json()
    assert (document["temporal"]["growth_rate"], document["growth_rate_error"], document["agrees"]) == (None, None, None)
    heads, rows = found.table()
    row = dict(zip(heads, rows[0], strict=True))
    assert math.isnan(row["growth_in_time_1_s"])
    assert row["growth_error"] is None


def test_of_what_does_not_grow_no_error_of_growth_is_told():
    """Without damping, below its onset: the mode's growth is none but for rounding, and nothing is told over it."""
    found = st.compare(mode_coupling(0.0).with_({"contacts.rub.friction.coefficient": 0.3, "comparison.critical": False}))
    (one,) = found.comparisons
    assert one.agrees
    assert abs(one.modal_eigenvalue.real) < 1e-12
    assert one.to_json()["growth_rate_error"] is None
    heads, rows = found.table()
    assert dict(zip(heads, rows[0], strict=True))["growth_error"] is None
    assert np.isnan(found.to_xarray()["growth_rate_error"].values[0])


def test_a_shape_in_the_span_of_two_is_all_theirs():
    rng = np.random.default_rng(3)
    pair = rng.standard_normal((9, 2)) + 1j * rng.standard_normal((9, 2))
    assert span_assurance(pair @ np.array([1.0, 2j]), pair) == pytest.approx(1.0, abs=1e-12)
    rest = rng.standard_normal(9) + 0j
    rest -= np.linalg.qr(pair)[0] @ (np.linalg.qr(pair)[0].conj().T @ rest)
    assert span_assurance(rest, pair) == pytest.approx(0.0, abs=1e-12)


def test_a_system_of_matrices_is_compared_by_growth() -> None:
    # It has no bodies whose shapes could be told: what is compared is the growth and the frequency.
    contact = {
        "normal": [0.0, 1.0], "tangent": [1.0, 0.0], "stiffness": 10.0, "friction": {"law": "coulomb", "coefficient": 0.7}
    }  # fmt: skip
    stiffness = np.array([[20.0, 4.0], [4.0, 15.0]])
    system = st.System.from_matrices(
        np.eye(2), 0.02 * np.eye(2), stiffness, contacts={"rub": contact}, loads={"press": [0.0, -1.0]}
    )
    work = st.Workspace(system, modal={"max_frequency_hz": 2.0}, temporal={"step": 1e-3})
    assert [one.agrees for one in st.compare(work, [0.7], only=["growth"]).comparisons] == [True]


def without_bodies() -> st.Workspace:
    """Two freedoms that flutter, with a full run."""
    contact = {
        "normal": [0, 1], "tangent": [1, 0], "stiffness": 0.4, "slip": 1.0, "friction": {"law": "coulomb", "coefficient": 1.9}
    }  # fmt: skip
    system = st.System.from_matrices(
        np.eye(2), 0.01 * np.eye(2), [[2.0, 0.3], [0.3, 2.2]], contacts={"a": contact}, loads={"F": [0, -1]},
        points={"p": np.eye(2)},
    )  # fmt: skip
    return st.Workspace(
        system, modal={"max_frequency_hz": 2.0}, phases=[{"name": "a", "duration": 100.0}],
        temporal={"watch": ["p"], "step": 0.02},
    )  # fmt: skip


def test_a_run_without_bodies_is_told_by_frequency_alone() -> None:
    """No shape that could be compared is not a frequency that no mode has."""
    (one,) = st.compare(without_bodies(), 1.9, critical=False).comparisons
    assert (one.mac, one.responding) == (None, 0)
    assert "none of the unstable modes" not in one.verdict
    assert one.verdict.endswith(
        "answers at 0.2441 Hz, within 5 % of the unstable mode at 0.2416 Hz, with whose shape it is not compared"
    )


def test_a_run_in_which_something_slower_is_stronger_answers_with_no_mode(monkeypatch) -> None:
    """It is too short to tell with what, and what is kept of it for the next call knows so."""
    from stridor.agreement import comparison

    monkeypatch.setattr(comparison, "stronger_below", lambda run, limit: 0.1)
    (one,) = st.compare(without_bodies(), 1.9, critical=False).comparisons
    assert (one.mac, one.responding, one.stronger_below_hz) == (None, None, 0.1)
    assert one.verdict.endswith(
        "; the full run is too short to say what it answers with: what swings or drifts below 0.1000 Hz is stronger "
        "than its line at 0.2441 Hz"
    )
    temporal = one.to_json()["temporal"]
    assert (temporal["stronger_below_hz"], temporal["responding_mode_hz"]) == (0.1, None)
    answer = comparison._Answer(0.2441, None, None, None, None, "why", 0.1)
    assert comparison._run_of(1.9, comparison._run_data(answer)) == answer


def three(damping: list[float], coupling: tuple[float, float] = (0.1, 0.2), mu: float = 0.2) -> st.Agreement:
    """Three freedoms, of which a contact slips along the first and presses on the second: growth alone."""
    contact = {
        "normal": [0, 1, 0], "tangent": [1, 0, 0], "stiffness": 5.0, "slip": 1.0,
        "friction": {"law": "coulomb", "coefficient": mu},
    }  # fmt: skip
    one, two = coupling
    system = st.System.from_matrices(
        np.eye(3), np.diag(damping), [[2.0, 0.3, one], [0.3, 3.0, two], [one, two, 4.5]], contacts={"c": contact},
        loads={"F": [0, -1, 0]},
    )  # fmt: skip
    work = st.Workspace(system, modal={"max_frequency_hz": 2.0}, temporal={"stepper": "exact", "step": 0.05})
    return st.compare(work, mu, only=["growth"])


@pytest.mark.parametrize("damping", [-2e-6, pytest.param(-2e-3, marks=pytest.mark.slow)])
def test_of_modes_that_grow_alike_time_may_show_any_first(damping: float) -> None:
    """C = c M moves every root alike: all grow at −c/2, at three frequencies."""
    (one,) = three([damping] * 3).comparisons
    assert one.agrees is True, one.verdict
    assert one.frequency_error < 1e-6
    assert one.modal_eigenvalue.imag == pytest.approx(one.perturbation.eigenvalue.imag, rel=1e-6)
    assert one.perturbation.growth_rate == pytest.approx(-damping / 2, rel=1e-6)
    assert f"both unstable at {one.modal_eigenvalue.imag / (2 * np.pi):.5f} Hz" in one.verdict
    assert agreement_table(one).rows[0].cells[1:3] == ("unstable", "unstable")


def in_time(*components: complex, unshown: tuple[complex, ...] = ()) -> Perturbation:
    lam = np.array(components)
    fastest = complex(lam[np.argmax(lam.real)])
    return Perturbation(
        0.1, fastest, np.zeros(0), 1.0, Components(lam, np.ones(len(lam))), unshown=np.array(unshown, dtype=complex)
    )  # fmt: skip


def test_what_grows_as_fast_stands_for_the_fastest_where_that_is_in_the_motion_too() -> None:
    modes, both = np.array([1e-2 + 2j, 0.98e-2 + 3j, -1e-3 + 1j]), np.array([0, 1])
    assert partner_of(modes, both, in_time(0.999e-2 + 2j, 1e-2 + 3j)) == Partner(1, unstable=True, rival=1e-2 + 2j)
    assert partner_of(modes, both, in_time(1.01e-2 + 2j, 1e-2 + 3j)) == Partner(0, unstable=True)
    # A mode that is not in the motion is not borne out, and one that is no mode's is none of them.
    assert partner_of(modes, both, in_time(1e-2 + 3j, -1e-3 + 1j)) == Partner(0, unstable=True)
    assert partner_of(modes, both, in_time(1e-2 + 2j, 1.02e-2 + 2.5j)) == Partner(0, unstable=True)
    # Nor does one that grows more slowly stand for it, or both together: 10 % in all.
    slower = np.array([1e-2 + 2j, 0.94e-2 + 3j])
    assert partner_of(slower, both, in_time(0.93e-2 + 2j, 0.94e-2 + 3j)) == Partner(0, unstable=True)
    apart = np.array([1e-2 + 2j, 0.96e-2 + 3j])
    assert partner_of(apart, both, in_time(0.9e-2 + 2j, 0.93e-2 + 3j)) == Partner(0, unstable=True)


def test_growth_in_which_no_contact_slips_is_not_decided() -> None:
    """An oscillator beside the contact, damped by −0.03: λ = 0.015 ± 2.1213j."""
    (one,) = three([0.02, 0.02, -0.03], coupling=(0.0, 0.0)).comparisons
    assert one.agrees is None
    assert one.unstable_growth == pytest.approx((0.015,))
    assert one.perturbation.unshown == pytest.approx([0.015 + 1j * np.sqrt(4.5 - 0.015**2)])
    assert "Hz with 0.01500 1/s grows, in which contacts slip by less than 1e-06 of what moves" in one.verdict
    assert "of what it shows: both stable (slowest decay" in one.verdict
    # With a spring to it the contact slips, and time shows it.
    (shown,) = three([0.02, 0.02, -0.03], coupling=(1e-3, 0.0)).comparisons
    assert shown.agrees is True, shown.verdict
    assert not len(shown.perturbation.unshown)


def test_what_contacts_show_still_disagrees_where_they_do_not_show_all() -> None:
    hidden, seen, stable = 2e-2 + 4j, 1e-2 + 2j, -1e-2 + 3j

    def said(modes: list[complex], found: Perturbation) -> bool | None:
        lam = np.array(modes)
        grow = np.flatnonzero(lam.real > 0)
        partner = partner_of(lam, grow, found)
        here, at = lam[partner.column], found.eigenvalue
        errors = abs(at.imag / here.imag - 1.0), abs(at.real / here.real - 1.0)
        return judge(0.1, partner.unstable, here, found, *errors, hidden=partner.hidden)[0]

    assert said([hidden, stable], in_time(stable, unshown=(hidden,))) is None
    assert said([hidden, seen, stable], in_time(seen, stable, unshown=(hidden,))) is None
    # Another motion grows, or decays, than the mode that slips; and one that slips must be there.
    assert said([hidden, stable], in_time(1e-2 + 3j, unshown=(hidden,))) is False
    assert said([hidden, seen, stable], in_time(stable, unshown=(hidden,))) is False
    assert said([hidden, stable], in_time(stable)) is False
    # What has grown out of rounding is seen.
    assert said([hidden, stable], in_time(hidden, stable, unshown=(hidden,))) is True
    assert said([seen, 0.5e-2 + 4j, stable], in_time(seen, stable, unshown=(0.5e-2 + 4j,))) is True


def test_growth_that_is_less_than_what_time_tells_is_not_decided() -> None:
    """Of |λ| modes tell 1e-9, a signal 1e-6."""
    agrees, sentence = judge(0.1, True, 3e-9 + 1j, in_time(-2e-8 + 1j), 0.0, 7.0)
    assert agrees is None
    assert "more slowly than a motion in time tells" in sentence
    assert judge(0.1, True, 3e-9 + 1j, in_time(-1e-3 + 1j), 0.0, 1e5)[0] is False
    assert judge(0.1, True, 1e-6 + 1j, in_time(1.0001e-6 + 1j), 0.0, 1e-4)[0] is True

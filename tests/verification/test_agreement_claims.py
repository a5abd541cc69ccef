"""'agree' is said where frequency, growth and shape in time are the mode's, with a step that resolves them."""

from __future__ import annotations

import math

import numpy as np
import pytest

import stridor as st
from mode_coupling import mode_coupling
from stridor.agreement.shapes import TimeShape, span_assurance
from stridor.case import Case

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

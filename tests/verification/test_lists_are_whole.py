"""Whatever says which modes grow takes the list in which none is missing, or says that it may not hold all."""

from __future__ import annotations

import numpy as np
import pytest

import stridor as st
from hidden_modes import MU_OF_BLOCK, entering_block, hidden_block
from stridor.agreement import Perturbation
from stridor.agreement import critical as bisecting
from stridor.agreement.result import judge, likeness
from stridor.errors import AnalysisError
from stridor.modal import growing
from stridor.study.countermeasures import rank_countermeasures
from stridor.temporal.signals import Components
from stridor.view.sensitivity_tables import countermeasure_table

pytestmark = pytest.mark.verification

HZ = 3199.75


@pytest.fixture(scope="module")
def case() -> st.Case:
    return hidden_block()


def failing(*args: object, **kwargs: object) -> None:
    raise AnalysisError("the search does not settle")


def test_a_comparison_holds_the_mode_that_entered_the_band_against_the_motion(case: st.Case):
    result = st.compare(case, only=["growth"])
    found = result.comparisons[0]
    assert found.unstable_hz == pytest.approx((HZ,), abs=0.1)
    assert result.agree is True, result.verdict
    assert found.to_json()["modal"]["completeness"].startswith("Checked: 1 mode grows")
    assert not result.notes


def test_a_comparison_says_that_modes_were_not_checked(case: st.Case, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(growing, "AFFORDABLE", 1)
    result = st.compare(case, only=["growth"])
    assert any("modes at μ = 1.1: Not checked: with" in note for note in result.notes)


def perturbation(value: complex) -> Perturbation:
    return Perturbation(0.1, value, np.zeros(0), 1.0, Components(np.array([value]), np.ones(1)))


@pytest.mark.parametrize("said", ["NOT COMPLETE: …", "NOT CONFIRMED: …", "Modes up to 9 Hz. INCOMPLETE: …"])
def test_modes_that_are_not_borne_out_agree_with_nothing(said: str):
    here = 2.0 + 30.0j
    assert judge(0.1, True, here, perturbation(here), 0.0, 0.0)[0] is True
    agrees, sentence = judge(0.1, True, here, perturbation(here), 0.0, 0.0, said)
    assert agrees is None
    assert "which modes there are is not certain" in sentence
    assert judge(0.1, False, here, perturbation(here), 0.0, 0.0, said)[0] is False


def test_the_modal_critical_friction_of_a_comparison_is_checked(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("stridor.modal.checked_onsets.growing_modes", failing)
    monkeypatch.setattr(bisecting, "perturb", lambda system, mu, **_: perturbation(complex(mu - 0.859, 1.0)))
    result = st.compare(entering_block(), only=["critical"])
    # With all four nodes, which touch up to μ = 1; with the two that are left at 1.1 it would be 0.4901.
    assert result.critical_mu_modal == pytest.approx(0.8592, abs=1e-3)
    assert any("Not checked: the search does not settle" in note for note in result.notes)


def test_sensitivities_are_those_of_the_mode_that_entered_the_band(case: st.Case):
    found = st.sensitivities(case, ["mu"])
    assert found.frequency_hz == pytest.approx([HZ], abs=0.1)
    step = 1e-4
    near = [st.modes(case, MU_OF_BLOCK + d, check=False, max_frequency_hz=9e3) for d in (-step, step)]
    grown = [m.eigenvalues[m.unstable][0] for m in near]
    assert found.of("mu")[0] == pytest.approx((grown[1] - grown[0]) / (2 * step), rel=1e-3)
    assert not found.warnings


def test_sensitivities_say_that_modes_were_not_checked(case: st.Case, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("stridor.modal.checked_modes.growing_modes", failing)
    found = st.sensitivities(case, ["mu"])
    assert not len(found.branch)
    assert found.warnings[0] == "modes at μ = 1.1: Not checked: the search does not settle."
    assert found.warnings[1].startswith("no mode is unstable")


def test_measures_solved_again_count_what_entered_the_band(case: st.Case, monkeypatch: pytest.MonkeyPatch):
    """A change of 2 % leaves the mode growing, which no branch from below the band leads to."""
    settings = {"numbers": ["materials.pad.density"], "added_mass": False, "chamfers": 0, "percent": 2.0, "verify": 1}
    found = rank_countermeasures(case, **settings)
    again = found.measures[0].verified
    assert again is not None
    assert again.unstable_hz == pytest.approx((HZ,), rel=0.05)
    assert not again.doubt
    chosen = rank_countermeasures(case, max_frequency_hz=3300.0, **settings).measures[0].verified
    assert chosen is not None
    assert chosen.unstable_hz == again.unstable_hz
    monkeypatch.setattr(growing, "AFFORDABLE", 1)
    unsure = rank_countermeasures(case.with_({"modal.max_frequency_hz": 5000.0}), **settings)
    assert "Not checked" in unsure.warnings[0]
    assert any("Not checked" in cell for row in countermeasure_table(unsure).rows for cell in row.cells)


def test_verdicts_on_nondimensional_models_can_be_read():
    here = 1e-3 + 1.0j
    sentence = judge(0.1, True, here, perturbation(1.01e-3 + 1.0j), 0.0, 0.01)[1]
    assert sentence == "μ = 0.1: both unstable at 0.15915 Hz, growth 0.001000 against 0.001010 1/s (1 %)"
    assert likeness("a", 0.159155, 0.9, unstable=True) == "a; the full run answers at 0.1592 Hz in its shape"
    bench = judge(0.1, True, 637.84 + 54324.6j, perturbation(637.1 + 54324.6j), 0.0, 0.0012)[1]
    assert bench == "μ = 0.1: both unstable at 8646.0 Hz, growth 637.8 against 637.1 1/s (0.12 %)"

"""A source of eigenpairs that there is none of, or that does not take the model, says so in a line with the way out."""

from __future__ import annotations

import re

import numpy as np
import pytest

import stridor as st
from benches import by_hand, paper_case
from rubbing_block import rubbing_block
from stridor.modal.complex_modes import complex_modes
from stridor.modal.onsets import onsets
from stridor.study.without_effect import without_effect

pytestmark = pytest.mark.bad_input

BLOCK = "max_frequency_hz = 10e3\nfriction_range = [0.0, 0.5]"


def test_a_name_that_none_has():
    told = 'modal.source: \'arnoldi\' – must be "auto", "receptance", "krylov", "reduced" or "full", where eigenpairs come from'
    with pytest.raises(st.CaseError, match=re.escape(told)):
        paper_case(modal__source="arnoldi")
    told = "source: 'arnoldi' – one of receptance, krylov, reduced, full, or none for what suits"
    with pytest.raises(st.CaseError, match=re.escape(told)):
        complex_modes(st.build_system(paper_case()), 0.1, source="arnoldi")


def test_one_that_does_not_take_the_model():
    case = st.loads(rubbing_block(BLOCK)).with_({"modal.source": "receptance"})
    told = "source receptance: there is contact over surfaces; leave it out for what suits, or take krylov or reduced or full"
    with pytest.raises(st.AnalysisError, match=re.escape(told)):
        st.modes(case, 0.1)
    with pytest.raises(st.AnalysisError, match=re.escape(told)):
        st.onsets(case)


def test_one_that_turns_out_not_to():
    """A spring of negative stiffness: without a source the full search answers, a source by name says why not."""
    system = by_hand(np.eye(2), np.zeros((2, 2)), np.diag([-1.0, 4.0]), [[1.0, 1.0]], [[1.0, -1.0]], 0.5)
    assert onsets(system, (0.0, 0.5), max_frequency_hz=1.0).source == "full"
    for source in ("receptance", "krylov"):
        with pytest.raises(st.AnalysisError, match=f"^source {source}: .*stiffness.*; leave it out for what suits, or take"):
            onsets(system, (0.0, 0.5), max_frequency_hz=1.0, source=source)


def test_a_reduced_model_of_what_moves_as_a_whole():
    system = by_hand(np.eye(2), np.zeros((2, 2)), [[1.0, -1.0], [-1.0, 1.0]], [[1.0, -1.0]], [[1.0, -1.0]], 0.5)
    for analysis in (lambda: onsets(system, (0.0, 0.5), max_frequency_hz=1.0, source="reduced"),
                     lambda: complex_modes(system, [0.1, 0.3], max_frequency_hz=1.0, source="reduced")):  # fmt: skip
        with pytest.raises(st.AnalysisError, match=r"^source reduced: the structure moves as a whole"):
            analysis()


def test_where_it_has_no_effect():
    case = paper_case(modal__source="krylov")
    assert "modal.source has no effect on simulate: it acts on modes and onsets" in without_effect(case, "simulate")
    assert not [line for verb in ("compare", "run") for line in without_effect(case, verb) if "modal.source" in line]
    assert not [line for line in without_effect(case, "modes") if "modal.source" in line]
    assert not [line for line in without_effect(case, "modes", solver="superlu") if "--solver" in line]


def test_results_say_which_it_was(tmp_path):
    case = paper_case()
    for name in ("receptance", "krylov", "reduced", "full"):
        found = st.modes(case.with_({"modal.source": name}), 0.1, max_frequency_hz=5e3)
        assert found.source == found.to_json()["source"] == name
    assert st.modes(case, 0.1, max_frequency_hz=5e3).source == "receptance"

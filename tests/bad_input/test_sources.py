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
        with pytest.raises(st.AnalysisError, match=f"^source {source}: .*stiffness.*; leave it out for what suits, or take") as error:
            onsets(system, (0.0, 0.5), max_frequency_hz=1.0, source=source)
        assert source not in str(error.value).rpartition(" take ")[2].split(" or ")  # which has just failed


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


ON_FLOOR = {
    "bodies.m": {"type": "mass", "mass": 0.05, "position": [0.0, 0.0]},
    "bodies.floor": {
        "type": "obstacle", "shape": "flat", "point": [0.0, 0.0], "normal": [0.0, 1.0],
        "sliding": {"velocity": [1.0, 0.0]},
    },
    "springs.k1": {"between": ["m", "ground"], "stiffness": 1e5, "direction": [0.8, 0.6]},
    "springs.k2": {"between": ["m", "ground"], "stiffness": 2e5, "direction": [-0.6, 0.8]},
    "loads.p": {"at": "m", "force": [0.0, -50.0]},
    "contacts.c": {
        "slave": "m", "master": "floor", "stiffness": 2e5, "friction": {"law": "coulomb", "coefficient": 0.3},
    },
}  # fmt: skip


def on_floor(**changes: object) -> st.Case:
    tables: dict[str, dict[str, dict[str, object]]] = {}
    for path, table in ON_FLOOR.items():
        kind, name = path.split(".")
        tables.setdefault(kind, {})[name] = dict(table)
    return st.Case(**tables).with_(changes)


def test_a_node_on_an_obstacle_is_not_called_contact_over_surfaces():
    case = on_floor(**{"modal.source": "receptance"})
    with pytest.raises(st.AnalysisError, match="source receptance: contact c is that of a node on a surface, not of a point"):
        st.modes(case, 0.1)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"contacts.c.cubic": 1e12}, r"contact stiffness that depends on the force \(contacts\.NAME\.cubic\)"),
        ({"contacts.c.closed": True}, r"contacts that are kept closed \(contacts\.NAME\.closed\)"),
        ({"springs.k1.cubic": 1e12}, r"springs whose stiffness depends on .* \(springs\.NAME\.cubic\)"),
    ],
)
def test_onsets_along_a_number_say_themselves_what_they_do_not_take(change, told):
    case = on_floor(**change)
    said = f"^onsets along springs.k2.stiffness: onsets along a number do not take {told}; at one value at a time `stridor modes`"
    with pytest.raises(st.AnalysisError, match=said):
        st.onsets(case, along="springs.k2.stiffness", friction_range=(1e5, 2e5))

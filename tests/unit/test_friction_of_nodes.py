"""Laws of speed on faces whose nodes slide at several speeds: one coefficient, or said which ones."""

from __future__ import annotations

import pytest

import stridor as st
from solid_cases import case, ring
from stridor.case import Case
from stridor.study.workspace import Workspace


def weakening(spin: str) -> Case:
    law = '{ law = "weakening", coefficient = 0.2, static_coefficient = 0.4, decay_speed = 0.5 }'
    text = ring((3, 24)).replace("spin = 10.0, centre = [0.0, 0.0]", spin)
    before, after = text.split("friction = {")
    return case(before + f"friction = {law}" + after[after.index("}") + 1 :])


def test_facets_of_a_curved_face_give_it_one_coefficient() -> None:
    """They turn what slides a little, each by another angle."""
    found = Workspace.of(weakening("spin = 10.0, centre = [1e-8, 0.0]")).one_friction()
    assert 0.2 < found < 0.4
    assert found == pytest.approx(Workspace.of(weakening("spin = 10.0, centre = [0.0, 0.0]")).one_friction(), rel=1e-3)


def test_a_law_that_gives_nodes_several_says_so() -> None:
    told = (
        r"^mu: one friction coefficient for all contacts, since the law of a contact gives its nodes several, by their "
        r"slip speeds \(bore 0\.2\d* to 0\.\d+\): name it \(--mu 0\.3\), every contact with friction then has it; "
        r"`steady` and `simulate` without μ answer with those of the law$"
    )
    several = weakening("spin = 10.0, centre = [0.01, 0.0]")
    with pytest.raises(st.CaseError, match=told):
        Workspace.of(several).one_friction()
    with pytest.raises(st.CaseError, match="the law of a contact gives its nodes several"):
        st.sensitivities(several)

"""Laws of speed on faces whose nodes slide at several speeds: one coefficient, that at their mean speed."""

from __future__ import annotations

import numpy as np
import pytest

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


def test_a_law_that_gives_nodes_several_has_one_at_their_mean_speed() -> None:
    several = weakening("spin = 10.0, centre = [0.01, 0.0]")
    work = Workspace.of(several)
    nodes, own = work.system().contact_nodes(), work.one_friction()
    assert own == pytest.approx(nodes.laws[0].sliding(float(nodes.speed.mean())), rel=1e-12)
    by_law = np.array([nodes.laws[0].sliding(float(v)) for v in nodes.speed])
    assert np.ptp(by_law) > 1e-3
    assert own * nodes.share == pytest.approx(by_law, rel=1e-12)
    for mu in (None, own):
        assert work.steady(mu).friction_coefficient == pytest.approx(by_law, rel=1e-12)

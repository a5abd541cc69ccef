"""Supports that hold slave nodes of ties: the bond stays, and holds the master by what the support prescribes."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as sl
import scipy.sparse as sp

import stridor as st
from stridor.case import loads
from stridor.contact.held_ties import led_by_supports
from stridor.errors import CaseError

BLOCKS = """
[materials.steel]
young_modulus = 200e9
density = 8000.0
poisson_ratio = 0.3
[bodies.low]
type = "solid"
material = "steel"
model = "plane stress"
thickness = 0.01
mass = "MASS"
mesh = { shape = "rectangle", corner = [0.0, 0.0], size = [0.1, 0.05], divisions = [LOW, 2] }
[bodies.high]
type = "solid"
material = "steel"
model = "plane stress"
thickness = 0.01
mass = "MASS"
mesh = { shape = "rectangle", corner = [0.0, 0.05], size = [0.1, 0.02], divisions = [HIGH, 1] }
[bodies.high.points]
middle = [0.05, 0.05]
[ties.glue]
slave = "SLAVE"
master = "MASTER"
"""


def blocks(slave: str, low: int = 3, high: int = 3, mass: str = "consistent", more: str = "") -> st.Case:
    ends = ("high.bottom", "low.top") if slave == "high" else ("low.top", "high.bottom")
    text = BLOCKS.replace("LOW", str(low)).replace("HIGH", str(high)).replace("MASS", mass)
    return loads(text.replace("SLAVE", ends[0]).replace("MASTER", ends[1]) + more)


def support(at: str, fixed: str = '["x", "y"]', more: str = "") -> str:
    return f'[supports.s{at.replace(".", "-")}]\nat = "{at}"\nfixed = {fixed}\n{more}\n'


def omegas(case: st.Case) -> np.ndarray:
    system = st.build_system(case)
    return np.sqrt(np.abs(sl.eigh(system.stiffness.toarray(), system.mass.toarray(), eigvals_only=True)))


@pytest.mark.parametrize("mass", ["consistent", "lumped"])
@pytest.mark.parametrize(
    "held",
    [
        support("high.left"),
        support("high.left", '["x"]') + support("low.right", '["y"]'),
        support("high.bottom"),
        support("high.bottom", '["y"]'),
        support("low.left") + support("high.left", '["x"]'),
    ],
)
def test_to_exchange_slave_and_master_of_matching_meshes_changes_nothing(held: str, mass: str) -> None:
    found = [omegas(blocks(slave, mass=mass, more=held)) for slave in ("low", "high")]
    assert len(found[0]) == len(found[1])
    assert found[0] == pytest.approx(found[1], rel=1e-9, abs=1e-6 * found[0][-1])


def test_a_held_face_holds_the_master_as_if_it_were_supported_itself() -> None:
    """All of the slave's nodes are held: nothing of the other body moves on the interface."""
    held = blocks("high", more=support("high.bottom"))
    other = blocks("low", more=support("low.top"))
    alone = st.build_system(held)
    assert alone.size == st.build_system(other).size
    low = alone.solids[0]
    interface = np.isclose(low.points[:, 1], 0.05)
    moved = abs(low.rows.free).sum(axis=1).reshape(low.points.shape)
    assert not moved[interface].any()
    assert moved[~interface].all()


@pytest.mark.parametrize("counts", [(3, 3), (2, 5), (5, 2), (4, 3)])
def test_a_moving_support_on_slave_nodes_carries_the_master(counts: tuple[int, int]) -> None:
    """Held at one side and moved as a whole, both bodies move as one, whichever of them follows."""
    moving = support("high.left", '["x", "y"]', "velocity = { x = 0.7, y = -0.2 }")
    for slave in ("low", "high"):
        system = st.build_system(blocks(slave, *counts, more=moving))
        for solid in system.solids:
            lift = (solid.rows.lift + 0 * (solid.rows.free @ system.motion.lift)).reshape(-1, 2)
            assert lift == pytest.approx(np.tile([0.7, -0.2], (len(lift), 1)), abs=1e-9)


def test_rigid_motion_is_not_free_any_more() -> None:
    """A block whose only tie has one slave node that is free: before, it swung about that one."""
    for slave in ("low", "high"):
        found = omegas(blocks(slave, 1, 1, more=support("high.left")))
        assert found[0] > 0.1 * found[1]


def test_motions_that_leaders_cannot_follow_are_refused() -> None:
    apart = support("high.left", '["x"]', "velocity = { x = 1.0 }") + support("low.left", '["x"]')
    with pytest.raises(CaseError, match=r"^supports\.shigh-left: prescribes motions of slave nodes of a tie"):
        st.build_system(blocks("high", more=apart))
    # Three values of a slave on two nodes of its leader.
    two = support("high.left", '["x"]', "velocity = { x = 1.0 }") + support("high.right", '["x"]')
    two += '[supports.middle]\nat = "high.middle"\nfixed = ["x"]\n'
    linear = {f"bodies.{name}.mesh.cells": "quad" for name in ("low", "high")}
    with pytest.raises(CaseError, match=r"exchange slave and master"):
        st.build_system(blocks("high", 1, 2, more=two).with_(linear))
    st.build_system(blocks("low", 1, 2, more=two).with_(linear))


@pytest.mark.parametrize("seed", range(12))
def test_what_is_left_is_the_null_space_of_all_equations(seed: int) -> None:
    """Of random ties and supports: T spans, with nothing lost and nothing twice, what the equations leave free."""
    rng = np.random.default_rng(seed)
    count, slaves = 14, 6
    tied = np.sort(rng.choice(count, slaves, replace=False))
    leaders = np.setdiff1d(np.arange(count), tied)[: int(rng.integers(2, 8))]
    weights = rng.standard_normal((slaves, len(leaders))) * (rng.random((slaves, len(leaders))) < 0.6)
    weights[np.abs(weights) < 0.05] = 0.0
    weights[rng.random(slaves) < 0.3] = np.eye(len(leaders))[0]
    transformation = np.eye(count)
    transformation[tied] = 0.0
    transformation[np.ix_(tied, leaders)] = weights
    held = rng.random(count) < 0.35
    values = np.zeros((count, 1))
    equations = np.vstack([np.eye(count)[tied] - transformation[tied], np.eye(count)[held]])
    names = {int(f): "supports.s" for f in np.flatnonzero(held)}
    found, followers = led_by_supports(sp.csr_array(transformation), tied, held, values, names)
    found = found.toarray()
    free = np.setdiff1d(np.flatnonzero(~held), followers)
    assert not found[:, followers].any()
    assert np.abs(equations @ found[:, free]).max(initial=0.0) < 1e-9 * max(1.0, np.abs(found).max())
    assert len(free) == count - np.linalg.matrix_rank(equations, tol=1e-9)
    assert np.linalg.matrix_rank(found[:, free]) == len(free)
    # A motion that the equations allow comes out of what supports and free freedoms do of it.
    motion = sl.null_space(equations[: len(tied)]) @ rng.standard_normal(count - np.linalg.matrix_rank(equations[: len(tied)]))
    mine = led_by_supports(sp.csr_array(transformation), tied, held, np.where(held, motion, 0.0)[:, None], names)[0]
    independent = np.setdiff1d(np.arange(count), followers)
    assert mine[:, independent] @ motion[independent] == pytest.approx(motion, abs=1e-9 * max(1.0, np.abs(found).max()))


REPEATING = """
[materials.steel]
young_modulus = 200e9
density = 7800.0
poisson_ratio = 0.3
[bodies.inner]
type = "solid"
material = "steel"
model = "plane stress"
thickness = 0.01
mass = "consistent"
mesh = { shape = "annulus", inner_radius = 0.05, outer_radius = 0.07, divisions = [2, 3], start_deg = 0.0, sweep_deg = SWEEP }
[bodies.outer]
type = "solid"
material = "steel"
model = "plane stress"
thickness = 0.01
mass = "consistent"
mesh = { shape = "annulus", inner_radius = 0.07, outer_radius = 0.1, divisions = [2, 3], start_deg = 0.0, sweep_deg = SWEEP }
[supports.hub]
at = "inner.inner"
fixed = ["x", "y"]
[ties.glue]
slave = "SLAVE"
master = "MASTER"
"""
TURN = '[ties.turn-{0}]\nslave = "{0}.end"\nmaster = "{0}.start"\nrotation = {{ angle_deg = 30.0 }}\n'


def test_bodies_that_both_repeat_can_be_glued() -> None:
    """Corners are slaves of both ties, which say the same: the modes are those of the whole ring that repeat."""
    ends = ("inner.outer", "outer.inner")
    found = []
    for slave, master in (ends, ends[::-1]):
        text = REPEATING.replace("SLAVE", slave).replace("MASTER", master).replace("SWEEP", "30.0")
        found.append(omegas(loads(text + TURN.format("inner") + TURN.format("outer"))))
    assert found[0] == pytest.approx(found[1], rel=1e-9)
    whole = REPEATING.replace("SLAVE", ends[0]).replace("MASTER", ends[1]).replace("start_deg = 0.0, sweep_deg = SWEEP", "")
    ring = omegas(loads(whole.replace(",  }", " }").replace("divisions = [2, 3]", "divisions = [2, 36]")))
    assert len(ring) > 10 * len(found[0])
    for omega in found[0][:6]:
        assert np.abs(ring / omega - 1.0).min() < 1e-6


@pytest.mark.parametrize("counts", [(3, 5), (6, 4)])
def test_bodies_that_both_repeat_can_be_glued_though_their_meshes_do_not_match(counts: tuple[int, int]) -> None:
    """Torsion and breathing, within the mesh's error of those of matching meshes."""

    def found(slave: str, master: str, low: int, high: int) -> np.ndarray:
        text = REPEATING.replace("SLAVE", slave).replace("MASTER", master).replace("SWEEP", "30.0")
        for count in (low, high):
            text = text.replace("divisions = [2, 3]", f"divisions = [2,  {count}]", 1)
        return omegas(loads(text + TURN.format("inner") + TURN.format("outer")))[:3]

    exact = found("inner.outer", "outer.inner", 12, 12)
    for ends in (("inner.outer", "outer.inner"), ("outer.inner", "inner.outer")):
        assert found(*ends, *counts) == pytest.approx(exact, rel=2e-3)

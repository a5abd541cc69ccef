"""Which contact nodes change between two tries, by hand: what of a state contradicts its assumptions, how badly, and how
many of those are let change."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

import stridor as st
from stridor.app.pictures import steady_document
from stridor.contact.multipliers import OPEN, SLIP, STICK
from stridor.direct import SingularMatrix
from stridor.errors import AnalysisError
from stridor.sliding import equilibrium, history, solution
from stridor.sliding.equilibrium import NEWTON_STEPS, ContactRows, Equilibrium, NodeEquilibrium, changed, find_touching
from stridor.sliding.redundant import closed, redundant
from stridor.sliding.stick_slip import Frictional, Loading, StickSlip, _Change, increments_of
from stridor.system.load_steps import LoadStep
from stridor.system.model import AnswerCache


def nodes_like(count: int, directions: int) -> StickSlip:
    """A search whose nodes have nothing but their number: enough for what looks at states only."""
    search = object.__new__(StickSlip)
    search.nodes = SimpleNamespace(count=count, directions=directions)
    search.movable = np.ones(count, dtype=bool)
    return search


def loading(m: int, t: int, *, force=(10.0,), mu=0.5, sticking=0.6) -> Loading:
    return Loading(np.array(force), np.zeros(0), np.zeros((m, t)), np.full(m, mu), np.full(m, sticking))


def frictional(status, *, normal=None, friction=None, direction=None, position=None, gap=None, t=1) -> Frictional:
    m = len(status)
    vectors = [np.zeros((m, t)) if v is None else np.array(v, dtype=float).reshape(m, t)
               for v in (friction, direction, position)]  # fmt: skip
    return Frictional(
        displacement=np.zeros(0), normal_force=np.zeros(m) if normal is None else np.array(normal, dtype=float),
        friction=vectors[0], status=np.array(status), direction=vectors[1], position=vectors[2],
        gap=np.zeros(m) if gap is None else np.array(gap, dtype=float), travel=np.zeros(0),
    )  # fmt: skip


# -- normal contact alone ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("care", "active", "pulled", "closing", "left"),
    [
        (0, [0, 1, 2, 3, 4], [3, 1, 4, 2], [6, 5, 7], [0, 5, 6, 7]),  # all at once
        (1, [0, 1, 2, 3, 4], [3, 1, 4, 2], [6, 5, 7], [0]),  # letting go alone
        (2, [0, 1, 2, 3, 4], [3, 1, 4, 2], [6, 5, 7], [0, 2, 4]),  # and half of the worst
        (3, [0, 2, 3, 4, 5], [3, 4], [6, 1, 7], [0, 1, 2, 3, 4, 5]),  # the first in the list, whichever its kind
        (3, [0, 2, 3, 4, 5], [4, 2], [6, 7], [0, 3, 4, 5]),
    ],
)
def test_fewer_nodes_change_the_more_care_is_taken(care, active, pulled, closing, left) -> None:
    touching = np.isin(np.arange(8), active)
    following = changed(touching, np.array(pulled), np.array(closing), care)
    assert list(np.flatnonzero(following)) == left
    assert list(np.flatnonzero(touching)) == active


def test_without_any_that_pull_the_careful_take_in() -> None:
    active, none = np.zeros(4, dtype=bool), np.zeros(0, dtype=np.int64)
    assert list(np.flatnonzero(changed(active, none, np.array([2, 0, 3]), 1))) == [0, 2, 3]
    assert list(np.flatnonzero(changed(active, none, np.array([2, 0, 3]), 2))) == [0, 2]
    assert list(np.flatnonzero(changed(active, none, np.array([2, 1, 3]), 3))) == [1]


# -- friction: what contradicts a state --------------------------------------------------------------------------------


def test_each_contradiction_is_found_and_weighed() -> None:
    # pulls, would close, is beyond its limit, slips the way friction pushes; and two that are as they should be.
    before = frictional([STICK] * 6, position=[0, 0, 0, 1e-6, 0, 0])
    state = frictional(
        [STICK, OPEN, STICK, SLIP, STICK, SLIP], normal=[-2, 0, 5, 4, 5, 4], friction=[0, 0, -4, 2, 3, 2],
        direction=[0, 0, 0, 1, 0, 1], position=[0, 2e-6, 0, 3e-6, 0, -4e-6], gap=[0, -5e-7, 0, 0, 2e-6, 0],
    )  # fmt: skip
    change = nodes_like(6, 1)._violations(before, loading(6, 1), state)
    way = 4e-6 + 1e-6
    assert change.severity == pytest.approx([2 / 10, 5e-7 / 2e-6, (4 - 0.6 * 5) / 10, 2e-6 / way, 0, 0])
    assert list(change.target) == [OPEN, SLIP, SLIP, STICK, STICK, SLIP]
    assert list(change.by_normal) == [True, True, False, False, False, False]
    # Friction opposes what the closing node has slipped and goes on as it was where a node lets go.
    assert list(change.direction[:, 0]) == [0, -1, -1, 1, 0, 1]
    assert change.any


def test_a_node_that_would_close_sticks_where_it_sank_in_further_than_it_slid() -> None:
    before = frictional([OPEN] * 3)
    state = frictional([OPEN] * 3, position=[5e-7, 7e-7, 0], gap=[-1e-6, -1e-6, -1e-6])
    search = nodes_like(3, 1)
    search.movable[2] = False
    change = search._violations(before, loading(3, 1), state)
    assert list(change.target) == [STICK, SLIP, OPEN]
    assert list(change.severity) == [1, 1, 0]


def test_nothing_contradicts_a_state_that_is_right_but_for_rounding() -> None:
    before = frictional([STICK] * 3)
    state = frictional(
        [STICK, SLIP, OPEN], normal=[-1e-12, 4, 0], friction=[0, 2, 0], direction=[0, 1, 0],
        position=[0, 1e-18, 1e-6], gap=[0, 0, 1e-6],
    )  # fmt: skip
    assert not nodes_like(3, 1)._violations(before, loading(3, 1), state).any
    none = frictional([])
    assert not nodes_like(0, 1)._violations(none, loading(0, 1), none).any


def test_what_a_motion_drives_is_not_turned_round() -> None:
    before = frictional([SLIP] * 2)
    state = frictional([SLIP] * 2, normal=[4, 4], direction=[1, 1], friction=[2, 2], position=[1e-6, 1e-6])
    load = replace(loading(2, 1), driven=np.array([[1.0], [0.0]]))
    change = nodes_like(2, 1)._violations(before, load, state)
    assert change.severity == pytest.approx([0, 1])
    assert list(change.target) == [SLIP, STICK]


@pytest.mark.parametrize(
    ("care", "chosen"),
    [(0, [0, 1, 2, 3, 5]), (1, [0, 2, 3]), (2, [2, 3]), (3, [0])],
)
def test_the_changes_of_stick_and_slip_are_the_fewer_the_more_care(care: int, chosen: list[int]) -> None:
    severity = np.array([0.1, 0.9, 0.5, 0.3, 0.0, 0.2])
    change = _Change(
        np.array([OPEN, SLIP, STICK, OPEN, SLIP, STICK]), np.arange(10.0, 16.0)[:, None], severity,
        np.array([True, False, True, True, True, False]),
    )  # fmt: skip
    state = frictional([7] * 6, direction=np.arange(6.0))
    status, direction = change.applied(state, care)
    assert list(np.flatnonzero(status != 7)) == chosen
    assert list(np.flatnonzero(direction[:, 0] >= 10)) == chosen
    assert list(status[chosen]) == list(change.target[chosen])
    assert list(state.status) == [7] * 6


def test_friction_in_space_turns_against_the_slip() -> None:
    # Slipped by (3, 4) µm; held across and not moved; sticks; driven.
    before = frictional([SLIP] * 4, t=2)
    status = [SLIP, SLIP, STICK, SLIP]
    state = frictional(
        status, normal=[8, 4, 4, 4], friction=[[-4, 0], [0, -1.6], [1, 0], [0, 2]],
        direction=[[-1, 0], [1, 0], [1, 0], [0, 1]], position=[[3e-6, 4e-6], [0, 0], [1e-6, 0], [0, 1e-6]], t=2,
    )  # fmt: skip
    load = replace(loading(4, 2), driven=np.array([[0, 0], [0, 0], [0, 0], [0, 1.0]]))
    missed, direction, across = nodes_like(4, 2)._turn(before, load, state)
    assert direction == pytest.approx(np.array([[-0.6, -0.8], [0, -1], [1, 0], [0, 1]]))
    assert across == pytest.approx([5e-6 / 4, 0, 0, 0])
    # Of node 0 friction misses 4 N along (−0.6, −0.8) by (−1.6, 3.2); of node 1 its limit of 2 N by 0.4.
    assert missed == pytest.approx(np.hypot(1.6, 3.2) / 4)


def test_increments_share_the_way_from_step_to_step() -> None:
    steps = (
        LoadStep(loads={"a": 2.0, "b": 1.0}, velocities=np.zeros(0), increments=2, duration=None),
        LoadStep(loads={"a": 3.0}, velocities=np.zeros(0), increments=1, duration=0.5),
    )
    assert increments_of(steps, ("a", "b")) == [
        (0, {"a": 1.0, "b": 0.5}, 0.0),
        (0, {"a": 2.0, "b": 1.0}, 0.0),
        (1, {"a": 3.0, "b": 1.0}, 0.5),
    ]


# -- bounds ------------------------------------------------------------------------------------------------------------


def rigid(stiffness, force, normal, push, gap) -> Equilibrium:
    """The equations of a small structure on rigid contacts."""
    n, m = len(force), len(gap)
    system: Any = SimpleNamespace(
        of_matrices=AnswerCache(), stiffness=sp.csr_array(stiffness), cubic=None, size=n, symmetric_definite=True
    )
    rows = ContactRows(sp.csr_array(normal), gap, np.zeros(m), np.zeros(m), np.zeros(m, dtype=bool))
    return Equilibrium(system, rows, sp.csr_array(push), force, symmetric=False, solver=None)


def by_all_sets(stiffness, force, normal, push, gap) -> list[tuple[np.ndarray, np.ndarray]]:
    """Every set of touching nodes that is in equilibrium, and its forces."""
    right, n, m = [], len(force), len(gap)
    for bits in range(2**m):
        on = np.array([bool(bits >> k & 1) for k in range(m)])
        count = int(on.sum())
        whole = np.block([[stiffness, -push[on].T], [normal[on], np.zeros((count, count))]])
        if np.linalg.cond(whole) > 1e12:
            continue
        answer = np.linalg.solve(whole, np.concatenate([force, -gap[on]]))
        if (answer[n:] >= 0).all() and (gap + normal @ answer[:n])[~on].min(initial=0.0) >= 0:
            right.append((on, answer[n:]))
    return right


def settled(equations: Equilibrium) -> tuple[Equilibrium, NodeEquilibrium, int]:
    nodes: Any = SimpleNamespace(count=equations.nodes.count, kept=equations.nodes.kept, compliance=equations.nodes.compliance)
    return solution._with_friction(lambda sign: equations, nodes, np.ones(nodes.count), None, None)


@pytest.mark.parametrize("singular", [False, True])
def test_with_much_friction_the_equilibrium_is_that_of_some_set(monkeypatch, singular: bool) -> None:
    # Three rigid contacts on six freedoms: all eight sets by NumPy tell whether there is one. singular: friction is such
    # that all three together have no equilibrium.
    rng, gone_round, found_none = np.random.default_rng(7), 0, 0
    tried = equilibrium.sets_near

    def counted(*given):
        nonlocal gone_round
        gone_round += 1
        return tried(*given)

    monkeypatch.setattr(equilibrium, "sets_near", counted)
    for _ in range(40 if singular else 150):
        half = rng.normal(size=(6, 6))
        stiffness, force, mu = half @ half.T + 0.1 * np.eye(6), 3 * rng.normal(size=6), np.full(3, rng.uniform(0.5, 3.0))
        normal, tangent, gap = rng.normal(size=(3, 6)), rng.normal(size=(3, 6)), rng.uniform(0, 0.2, 3)
        push = normal + mu[:, None] * tangent
        if singular:  # the force of the third opens none of the contacts by itself
            within = np.linalg.solve(stiffness, normal.T)
            push[2] -= normal.T @ np.linalg.solve(normal @ within, within.T @ push[2])
        given = stiffness, force, normal, push, gap
        if right := by_all_sets(*given):
            _, found, _ = settled(rigid(*given))
            same = [on for on, _ in right if np.array_equal(on, found.active)]
            assert len(same) == 1
            force_of = next(n for on, n in right if on is same[0])
            assert found.normal_force[found.active] == pytest.approx(force_of, rel=1e-6)
        else:
            found_none += 1
            said = None if singular else "^steady sliding at μ = 1: none of the 8 sets of touching nodes is in equilibrium"
            with pytest.raises(SingularMatrix if singular else AnalysisError, match=said):
                settled(rigid(*given))
    assert gone_round > 8
    assert found_none < 75


def test_a_large_structure_that_nothing_holds_is_not_asked_for_every_set(monkeypatch) -> None:
    asked = 0

    def solve(active, start=None):
        nonlocal asked
        asked += 1
        raise SingularMatrix("no pivot")

    given = rigid(np.eye(3), np.zeros(3), np.eye(3)[:2], np.eye(3)[:2], np.zeros(2))
    monkeypatch.setattr(given, "solve", solve)
    for size, tries in ((solution.MOST // 4, 5), (solution.MOST // 4 + 1, 1)):
        given.force, asked = np.zeros(size), 0
        with pytest.raises(SingularMatrix, match="no pivot"):
            settled(given)
        assert asked == tries


@pytest.mark.parametrize(("size", "held"), [(2.9e6, True), (3.1e6, False)])
def test_a_body_that_moves_a_million_times_its_size_is_loose(monkeypatch, size: float, held: bool) -> None:
    # A bar of 3 m far from the origin: its extent counts, not where it is.
    bar = SimpleNamespace(points=np.array([[50.0, 10.0], [53.0, 10.5]]))
    system, force = SimpleNamespace(lines=(), solids=(bar,), stiffness=sp.eye_array(2, format="csr")), np.zeros(2)
    monkeypatch.setattr(solution, "_loose", lambda *given, far: "it is loose")
    state = NodeEquilibrium(np.zeros(0, dtype=bool), np.array([0.0, -size]), np.zeros(0), np.zeros(0))
    if held:
        solution._require_held(system, None, state, 1e-9, force)
        with pytest.raises(AnalysisError, match="it is loose"):
            solution._require_held(system, None, state, 2e-8, force)
    else:
        with pytest.raises(AnalysisError, match="it is loose"):
            solution._require_held(system, None, state, 1e-9, force)


def hardening(cubic: tuple[float, ...], *, gap=(0.0, 0.0), load: float = 1.0) -> Equilibrium:
    """Two masses on springs of 100 N/m, each pressed with 1 N, or another load, on a contact of 1 mm/N."""
    system = SimpleNamespace(
        of_matrices=AnswerCache(), size=2, stiffness=sp.csr_array(np.diag([100.0, 100.0])), cubic=None, symmetric_definite=True,
    )  # fmt: skip
    rows = ContactRows(
        sp.csr_array(np.eye(2)), np.array(gap), np.full(2, 1e-3), np.array(cubic), np.zeros(2, dtype=bool)
    )
    return Equilibrium(system, rows, rows.normal, np.full(2, -load), symmetric=True, solver=None)


def test_what_hardens_but_does_not_touch_needs_no_second_step() -> None:
    away = hardening((1e9, 0.0), gap=(0.1, 0.0))
    state, _ = find_touching(away, np.array([False, True]))
    assert state.displacement == pytest.approx([-1 / 100, -1 / 1100])
    assert away.solved == 1


@pytest.mark.parametrize("load", [1.0, 1e-12, 1e6])
def test_contact_that_hardens_balances_its_load(load: float) -> None:
    cubic = 1e9 / load**2  # the same in other units
    state, _ = find_touching(hardening((cubic, 0.0), load=load))
    u = state.displacement[0]
    assert 100 * u - 1e3 * -u - cubic * (-u) ** 3 == pytest.approx(-load, rel=1e-9, abs=0.0)
    assert state.normal_force[0] == pytest.approx(1e3 * -u + cubic * (-u) ** 3, rel=1e-9, abs=0.0)
    assert state.displacement[1] == pytest.approx(-load / 1100, rel=1e-9, abs=0.0)


def test_springs_that_find_no_equilibrium_are_given_sixty_steps(monkeypatch) -> None:
    stuck = hardening((1e9, 0.0))
    monkeypatch.setattr(Equilibrium, "_converged", lambda *given: False)
    with pytest.raises(AnalysisError, match="find no equilibrium in 60 steps"):
        stuck.solve(np.ones(2, dtype=bool))
    assert stuck.solved == NEWTON_STEPS == 60


# -- forces that cannot be told apart ----------------------------------------------------------------------------------


def rigid_rows(rows: list[list[float]]) -> SimpleNamespace:
    return SimpleNamespace(
        normal=sp.csr_array(np.array(rows)), owner=np.arange(len(rows)), names=[f"c{k}" for k in range(len(rows))]
    )


def test_the_contacts_in_a_dependence_are_named_and_the_others_not(monkeypatch) -> None:
    # Rows 0, 1 and 3 in two freedoms: one follows from the others. Row 2 shares a freedom with row 4 and is free of it.
    nodes = rigid_rows([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [1, 1, 0, 0], [0, 0, 1, 1]])
    said = redundant(SimpleNamespace(holders={}), nodes, np.ones(5, dtype=bool))
    assert "1 of the 5 conditions of rigid contact follows from the others" in said
    assert [name in said for name in nodes.names] == [True, True, False, True, False]
    assert redundant(SimpleNamespace(holders={}), nodes, np.array([True, True, True, False, True])) == ""


def test_rows_that_share_freedoms_without_following_from_one_another_are_let_through() -> None:
    # Every freedom is met twice, so that none is a row's own, but three rows in three freedoms are independent.
    nodes = rigid_rows([[1, 1, 0], [0, 1, 1], [1, 0, 1]])
    assert redundant(SimpleNamespace(holders={}), nodes, np.ones(3, dtype=bool)) == ""
    twice = rigid_rows([[1, 1, 0], [0, 1, 1], [1, 0, 1], [1, 2, 1]])
    assert "1 of the 4 conditions" in redundant(SimpleNamespace(holders={}), twice, np.ones(4, dtype=bool))


@pytest.mark.parametrize("size", [1.0, 1e-9, 1e9])
def test_a_node_within_rounding_of_the_surface_touches(size: float) -> None:
    active = np.array([False, False, True])
    for largest in ({"gap": 1e-3, "way": 1e-5}, {"gap": 1e-5, "way": -1e-3}):  # whichever is larger
        gap = np.array([0.9e-12, -1.1e-12, largest["gap"]]) * size
        assert list(closed(active, gap, np.array([largest["way"], 0.0]) * size)) == [True, False, True]
    assert list(closed(active[:1], np.zeros(1), np.zeros(0))) == [True]
    assert list(closed(active[:1], np.array([size]), np.zeros(0))) == [False]


# -- what moves --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("named", [history._moved, lambda system, motion: solution._moved_most(system, np.abs(motion[:4]))])
def test_what_moves_most_is_named(named) -> None:
    system = SimpleNamespace(
        size=4, lines=(SimpleNamespace(name="beam", freedoms=np.array([0])),),
        solids=(SimpleNamespace(name="block", freedoms=np.array([[1, 2]])),), dof_names=("beam.x", "", "", "mass.x"),
    )  # fmt: skip
    assert named(system, np.array([-3.0, 1, 2, 0, 99])) == "body beam"
    assert named(system, np.array([1.0, 1, -2, 0, 99])) == "body block"
    assert named(system, np.array([1.0, 1, -2, -3, 99])) == "mass.x"
    system.dof_names = ()
    assert named(system, np.array([1.0, 1, -2, -3, 99])) == "freedom 3"


def test_where_what_moves_is_not_known_the_structure_is_named() -> None:
    assert history._moved(SimpleNamespace(), None) == "the structure"


def test_forces_alone_that_move_are_contact_that_holds_twice() -> None:
    system = SimpleNamespace(size=2, lines=(), solids=(), dof_names=("a", "b"), stiffness=sp.csr_array((2, 2)))
    nodes = SimpleNamespace(names=("A", "B"))
    said = history._unheld(system, nodes, "steady.steps.1", np.array([1e-7, 0, 0.5, -0.5]))
    assert said.startswith("static equilibrium, steady.steps.1: contact holds the same freedoms twice (contacts: A, B)")
    assert "a slides or moves freely" in history._unheld(system, nodes, "here", np.array([1e-6, 0, 0.5, -0.5]))
    assert "b slides or moves freely" in history._unheld(system, nodes, "here", np.array([0, 1.0]))
    assert "the structure slides or moves freely" in history._unheld(system, nodes, "here", None)


def test_other_sets_in_equilibrium_are_named() -> None:
    # Two elastic contacts on two masses; all four sets by NumPy.
    rng, several = np.random.default_rng(11), 0
    for _ in range(60):
        half = rng.normal(size=(4, 4))
        stiffness, force, mu = half @ half.T + 0.1 * np.eye(4), 3 * rng.normal(size=4), float(rng.uniform(0.5, 3.0))
        rows, tangents, gaps = rng.normal(size=(2, 4)), rng.normal(size=(2, 4)), rng.uniform(0, 0.2, 2)
        right, pressed = set[str](), dict[str, tuple[float, list[str]]]()
        for on in ([], [0], [1], [0, 1]):
            off = [k for k in (0, 1) if k not in on]
            whole = stiffness + 5.0 * (rows[on] - mu * tangents[on]).T @ rows[on]
            u = np.linalg.solve(whole, force - 5.0 * (rows[on] - mu * tangents[on]).T @ gaps[on])
            gap = gaps + rows @ u
            if (gap[on] <= 0).all() and (gap[off] >= 0).all():
                right.add(name := ", ".join("AB"[k] for k in on) or "none")
                pressed[name] = float(-5.0 * gap[on].sum()), ["AB"[k] for k in on]
        contacts = {
            "AB"[k]: {"normal": rows[k], "tangent": tangents[k], "gap": gaps[k], "stiffness": 5.0,
                      "friction": {"law": "coulomb", "coefficient": 0.3}}
            for k in (0, 1)
        }  # fmt: skip
        system = st.System.from_matrices(np.eye(4), None, stiffness, contacts=contacts, loads={"f": force})
        if not right - {"none"}:
            continue
        found = st.steady_sliding(system, mu)
        own = ", ".join("AB"[k] for k in np.flatnonzero(found.active)) or "none"
        assert own in right
        told = [w for w in found.warnings if w.startswith("there is more than one equilibrium at this friction: as well ")]
        assert len(told) == (len(right) > 1)
        for other in right - {own}:
            force, who = pressed[other]
            assert f"with {other} touching ({len(who)} of 2 nodes, N = " in told[0]
            (named,) = [o for o in steady_document(found)["others"] if o["contacts"] == who]
            assert named["touching_nodes"] == len(who)
            assert named["normal_force"] == pytest.approx(force, rel=1e-9)
        several += len(told)
    assert several > 3


# -- contacts that harden, with much friction: no equilibrium of one set of nodes says nothing of the others ------------
def test_a_set_that_newton_does_not_settle_on_is_not_the_last_word() -> None:
    """With both contacts closed friction pulls them ever harder together; with one of them open there is an
    equilibrium."""
    normal = np.array([[-0.877, 0.714], [-1.697, 0.908]])
    tangent, slip, mu = np.array([[-0.112, 1.857], [0.279, -0.143]]), (0.5363, -0.4174), 0.9036
    stiffness, contact, cubic = np.array([[3.507, 0.035], [0.035, 3.531]]), (13.051, 10.315), (12.098, 3.195)
    load = np.array([1.848, -1.257])
    system = st.System.from_matrices(
        np.eye(2), 0.1 * np.eye(2), stiffness, loads={"f": load},
        contacts={
            f"c{k}": {
                "normal": normal[k], "tangent": tangent[k], "stiffness": contact[k], "slip": slip[k], "cubic": cubic[k],
                "friction": {"law": "coulomb", "coefficient": mu},
            }
            for k in range(2)
        },
    )  # fmt: skip
    found = st.steady_sliding(system, mu)
    force, u = found.normal_force, found.displacement
    approach = np.maximum(-normal @ u, 0.0)
    assert force == pytest.approx(contact * approach + cubic * approach**3, rel=1e-9)
    assert list(force > 0.0) == [True, False]
    push = normal - mu * np.sign(slip)[:, None] * tangent
    assert stiffness @ u == pytest.approx(load + push.T @ force, rel=1e-9)

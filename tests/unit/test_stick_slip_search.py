"""The search for what sticks and what slips, step by step: which rows hold a node, what is tried after what, and what a
motion and a friction law bring to an increment."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

from stridor.contact.multipliers import OPEN, SLIP, STICK
from stridor.contact.nodes import ContactNodes
from stridor.direct import SingularMatrix
from stridor.errors import AnalysisError
from stridor.laws import Coulomb, StaticKinetic, Weakening
from stridor.sliding import history, motions, solution, stick_slip
from stridor.sliding.stick_slip import LIMIT, Frictional, Loading, StickRows, StickSlip, _Change
from stridor.system.load_steps import LoadStep

# What NumPy warns of is a fault here, whatever comes of it.
pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning")

# -- rows that hold ----------------------------------------------------------------------------------------------------


def contact_rows(normal, tangent, compliance, dimension: int) -> Any:
    normal, tangent = np.asarray(normal, dtype=float), np.asarray(tangent, dtype=float)
    return SimpleNamespace(
        normal=sp.csr_array(normal), tangent=sp.csr_array(tangent), compliance=np.asarray(compliance, dtype=float),
        count=len(normal), directions=dimension - 1, normals=np.zeros((len(normal), dimension)),
    )  # fmt: skip


def rank(*rows) -> int:
    rows = [np.atleast_2d(r) for r in rows if np.size(r)]
    return int(np.linalg.matrix_rank(np.concatenate(rows), tol=1e-9)) if rows else 0


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_node_is_held_in_every_direction_in_which_nothing_else_holds_it(dimension: int) -> None:
    """Nodes on three freedoms or two, some of them held by a support, on surfaces turned at random, rigid or not, by
    themselves or against a master: as many rows as the tangents add to a rigid normal."""
    rng = np.random.default_rng(5)
    m, t = 60, dimension - 1
    normal, tangent = np.zeros((m, dimension * m + 3)), np.zeros((t * m, dimension * m + 3))
    for i in range(m):
        frame = np.linalg.qr(rng.normal(size=(dimension, dimension)))[0]
        if i % 3 == 0:
            frame = np.roll(np.eye(dimension), i, axis=0)
        free = rng.random(dimension) < 0.6
        own = slice(dimension * i, dimension * (i + 1))
        normal[i, own] = frame[0] * free
        tangent[t * i : t * (i + 1), own] = frame[1:] * free
        if i % 4 == 1:  # the master gives way as well
            own = slice(dimension * m, dimension * (m + 1))
            normal[i, own], tangent[t * i : t * (i + 1), own] = -frame[0], -frame[1:]
    compliance = np.where(rng.random(m) < 0.5, 0.0, 1e-9)
    found = StickRows(contact_rows(normal, tangent, compliance, dimension))
    rows = found.rows.toarray()
    assert len(found.node) == len(rows) == len(found.direction)
    for i in range(m):
        mine, own = rows[found.node == i], tangent[t * i : t * (i + 1)]
        held = [normal[i]] if compliance[i] == 0.0 else []
        assert len(mine) == rank(own, *held) - rank(*held), i
        assert rank(mine, *held) == rank(own, *held), i
        assert mine == pytest.approx(found.direction[found.node == i] @ own)
        assert found.direction[found.node == i] @ found.direction[found.node == i].T == pytest.approx(np.eye(len(mine)))


@pytest.mark.parametrize("dimension", [2, 3])
def test_nodes_in_one_place_are_held_as_often_as_they_can_move(dimension: int) -> None:
    """Two or three contacts at the same node of a body, against rigid masters, of which any press or stick: rows that
    hold and rigid normals are independent, and nothing that sticks is free."""
    rng = np.random.default_rng(6)
    t, places, each = dimension - 1, 30, 3
    m = places * each
    normal, tangent = np.zeros((m, dimension * places)), np.zeros((t * m, dimension * places))
    for i in range(m):
        frame = np.linalg.qr(rng.normal(size=(dimension, dimension)))[0]
        if i % 5 == 0:
            frame = np.eye(dimension)
        own = slice(dimension * (i // each), dimension * (i // each + 1))
        normal[i, own], tangent[t * i : t * (i + 1), own] = frame[0], frame[1:]
    compliance = np.where(rng.random(m) < 0.3, 1e-9, 0.0)
    found = StickRows(contact_rows(normal, tangent, compliance, dimension))
    rows = found.rows.toarray()
    for _ in range(3):
        touching = rng.random(m) < 0.7
        stuck = touching & (rng.random(m) < 0.7)
        kept = found.held(touching, stuck)
        assert not kept[~stuck[found.node]].any()
        for place in range(places):
            mine = np.arange(each * place, each * (place + 1))
            pressing = normal[mine[touching[mine] & (compliance[mine] == 0.0)]]
            sticking = rows[np.isin(found.node, mine[stuck[mine]])]
            holding = rows[kept & np.isin(found.node, mine)]
            assert rank(holding, pressing) == len(holding) + rank(pressing), place
            assert rank(holding, pressing) == rank(sticking, pressing), place


def test_a_node_that_shares_a_place_with_none_is_held_whatever_lies_next_to_it() -> None:
    # Freedoms 0 and 1 belong to nodes 0 and 1 alike; node 2 hangs on freedom 2 and on 3, and 4, of its master.
    normal = [[0, 1, 0, 0, 0], [1, 0, 0, 0, 0], [0, 0, 0, 1, -1]]
    tangent = [[1, 0, 0, 0, 0], [0, 1, 0, 0, 0], [0, 0, 1, 0, -1]]
    found = StickRows(contact_rows(normal, tangent, np.zeros(3), 2))
    all_of_them = np.ones(3, dtype=bool)
    assert found.held(all_of_them, all_of_them).tolist() == [False, False, True]
    assert found.held(np.array([True, False, True]), np.array([True, False, True])).tolist() == [True, False, True]
    assert found.held(np.zeros(3, dtype=bool), all_of_them).tolist() == [True, True, True]


# -- the search --------------------------------------------------------------------------------------------------------


class Scripted(StickSlip):
    """A search over m nodes whose equilibria, contradictions and turns are given: None for a matrix that is singular,
    else (changes, turned)."""

    def __init__(self, script, m: int = 6) -> None:
        self.nodes: Any = SimpleNamespace(count=m, directions=1)
        self.script = list(script)
        self.asked: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
        self.now: Any = None

    def _solve(self, before, load, status, direction, across):
        self.asked.append((status.copy(), direction.copy(), across.copy()))
        self.now = self.script.pop(0) if len(self.script) > 1 else self.script[0]
        if self.now is None:
            raise SingularMatrix("", None)
        return replace(before, status=status, direction=direction), 0.25

    def _violations(self, before, load, state):
        return self.now[0]

    def _turn(self, before, load, state):
        return self.now[1], state.direction + 1.0, np.full(self.nodes.count, 1e-3 * len(self.asked))


def start(status) -> Frictional:
    m = len(status)
    flat, none = np.zeros((m, 1)), np.zeros(m)
    return Frictional(none, none, flat, np.array(status), flat, flat, none, np.zeros(0))


def increment_of(m: int, driven=()) -> Loading:
    along = np.zeros((m, 1))
    along[list(driven)] = -1.0
    return Loading(np.zeros(0), np.zeros(0), along, np.full(m, 0.3), np.full(m, 0.3))


def nothing(m: int) -> _Change:
    return _Change(np.zeros(m, dtype=int), np.zeros((m, 1)), np.zeros(m), np.zeros(m, dtype=bool))


def change(target, severity, by_normal=None) -> _Change:
    m = len(target)
    by_normal = np.zeros(m, dtype=bool) if by_normal is None else np.array(by_normal, dtype=bool)
    return _Change(np.array(target), np.full((m, 1), 9.0), np.array(severity, dtype=float), by_normal)


def test_driven_nodes_slip_from_the_beginning_unless_they_are_open() -> None:
    search = Scripted([(nothing(4), 0.0)], 4)
    state, residual = search.increment(start([OPEN, STICK, SLIP, STICK]), increment_of(4, driven=(0, 1)))
    assert list(state.status) == [OPEN, SLIP, SLIP, STICK]
    assert list(state.direction[:, 0]) == [-1, -1, 0, 0]
    assert residual == 0.25
    assert len(search.asked) == 1


def test_directions_that_still_turn_are_followed() -> None:
    search = Scripted([(nothing(2), 2e-9), (nothing(2), 1.1e-9), (nothing(2), 0.9e-9)], 2)
    search.increment(start([SLIP, SLIP]), increment_of(2))
    assert [asked[1][0, 0] for asked in search.asked] == [0, 1, 2]
    assert [asked[2][0] for asked in search.asked] == [0, 1e-3, 2e-3]


def test_changes_are_made_with_directions_and_turns_of_what_was_found() -> None:
    search = Scripted([(change([SLIP, OPEN, STICK], [0.5, 0, 0]), 0.0), (nothing(3), 0.0)], 3)
    search.increment(start([STICK, SLIP, STICK]), increment_of(3))
    status, direction, across = search.asked[1]
    assert list(status) == [SLIP, SLIP, STICK]
    assert list(direction[:, 0]) == [9, 1, 1]
    assert across[0] == 1e-3


def test_where_friction_at_its_limit_holds_nothing_it_is_tried_with_less() -> None:
    search = Scripted([None, (nothing(4), 0.0)], 4)
    state, _ = search.increment(start([SLIP, STICK, OPEN, SLIP]), increment_of(4, driven=(3,)))
    assert list(state.status) == [STICK, STICK, OPEN, SLIP]
    search = Scripted([None, None], 4)
    with pytest.raises(SingularMatrix):
        search.increment(start([SLIP, STICK, OPEN, SLIP]), increment_of(4))
    assert len(search.asked) == 2


def test_where_a_change_frees_the_structure_fewer_are_made_until_there_is_but_one() -> None:
    # Of five that change all; then those by normal contact; the worst half of these; the first.
    asks = change([OPEN] * 5 + [STICK], [0.1, 0.9, 0.2, 0.5, 0.6, 0], [True, False, True, True, False, False])
    search = Scripted([(asks, 0.0), None, None, None, (nothing(6), 0.0)])
    search.increment(start([STICK] * 6), increment_of(6))
    opened = [list(np.flatnonzero(asked[0] == OPEN)) for asked in search.asked]
    assert opened == [[], [0, 1, 2, 3, 4], [0, 2, 3], [2, 3], [0]]
    search = Scripted([(asks, 0.0), None, None, None, None])
    with pytest.raises(SingularMatrix):
        search.increment(start([STICK] * 6), increment_of(6))
    assert len(search.asked) == 5


def test_where_a_set_comes_back_fewer_change() -> None:
    # Nodes 0 and 1 are to slip and to stick by turns; when the first set comes back, what normal contact asks for alone.
    there, back = change([SLIP, SLIP], [0.4, 0.8], [True, False]), change([STICK, STICK], [0.4, 0.8], [True, False])
    search = Scripted([(there, 0.0), (back, 0.0), (nothing(2), 0.0)], 2)
    search.increment(start([STICK, STICK]), increment_of(2))
    assert [asked[0].tolist() for asked in search.asked] == [[STICK, STICK], [SLIP, SLIP], [STICK, SLIP]]


def test_what_never_settles_is_told_after_its_tries() -> None:
    there, back = change([SLIP] * 2, [1, 1]), change([STICK] * 2, [1, 1])
    search = Scripted([x for _ in range(LIMIT) for x in ((there, 0.0), (back, 0.0))], 2)
    with pytest.raises(AnalysisError, match="stick and slip do not settle in 120 steps; take more increments"):
        search.increment(start([STICK] * 2), increment_of(2))
    assert len(search.asked) == LIMIT == 120


def test_sets_differ_by_status_and_on_a_line_by_the_sense_of_slip() -> None:
    status = np.array([SLIP, STICK])
    key = stick_slip._key
    assert key(status, np.array([[1.0], [1.0]])) == key(status, np.array([[0.2], [-1.0]]))
    assert key(status, np.array([[1.0], [1.0]])) != key(status, np.array([[-1.0], [1.0]]))
    assert key(status, np.array([[1.0], [1.0]])) != key(status[::-1].copy(), np.array([[1.0], [1.0]]))
    assert key(status, np.array([[1.0, 0.0]] * 2)) == key(status, np.array([[-1.0, 0.5]] * 2))


def test_before_the_first_increment_all_that_can_touch_sticks_without_force() -> None:
    nodes: Any = contact_rows([[1, 0, 0], [0, 0, 0]], [[0, 1, 0], [0, 0, 1]], [0, 0], 2)
    nodes.gap = np.array([1e-6, 2e-6])
    system: Any = SimpleNamespace(size=3, contact_nodes=lambda: nodes, motion=SimpleNamespace(names=("a", "b")))
    search = StickSlip(system, solver=None)
    state = search.start()
    assert list(state.status) == [STICK, OPEN]
    assert list(state.gap) == [1e-6, 2e-6]
    assert state.gap is not nodes.gap
    assert (state.displacement.shape, state.friction.shape, state.travel.shape) == ((3,), (2, 1), (2,))
    for part in (state.displacement, state.normal_force, state.friction, state.direction, state.position, state.travel):
        assert not part.any()
    assert search.solved == 0


def test_an_open_node_that_stays_open_is_no_change() -> None:
    search = Scripted([], 3)
    search.movable = np.ones(3, dtype=bool)
    state = replace(start([OPEN, OPEN, STICK]), gap=np.array([1e-6, 0, 0]), position=np.array([[1e-6], [2e-6], [0]]))
    found = StickSlip._violations(search, start([OPEN] * 3), increment_of(3), state)
    assert list(found.target) == [OPEN, OPEN, STICK]
    assert not found.severity.any()
    assert not found.by_normal.any()


# -- what an increment brings ------------------------------------------------------------------------------------------


def plate(m: int = 4) -> ContactNodes:
    """Nodes of two contacts; two motions, of which the second turns about node 0, at 2 rad/s in steady sliding."""
    owner = np.arange(m) // 2
    lift = np.zeros((2 * m, 2))
    lift[0::2, 0] = 1.0
    lift[1::2, 1] = np.arange(m)
    return ContactNodes(
        ("weak", "plain"), owner, (Weakening(0.2, 0.6, 0.5), StaticKinetic(0.3, 0.45)), sp.csr_array((m, 0)),
        sp.csr_array((2 * m, 0)), np.zeros((m, 2)), lift, np.zeros(m), np.ones(m), np.zeros(m), np.zeros((m, 3)),
        np.zeros((m, 3)), np.zeros((m, 2, 3)), speed=2.0 * np.arange(m), mean_speed=(1.0, 5.0),
    )  # fmt: skip


def system_of(m: int = 3) -> Any:
    return SimpleNamespace(
        size=m, loads={"press": np.array([1.0, 2.0, 0.0]), "pull": np.array([0.0, 1.0, 1.0])},
        motion=SimpleNamespace(damping=np.array([[0.5, 0.0], [0.0, 0.25], [0.0, 0.0]])),
    )  # fmt: skip


def step(duration, velocities=(3.0, 4.0), increments: int = 2) -> LoadStep:
    return LoadStep(loads={}, velocities=np.array(velocities), duration=duration, increments=increments)


def test_motions_that_run_on_drive_the_nodes_that_they_slide() -> None:
    load, slip = history._loading(
        system_of(), plate(), step(None), {"press": 2.0, "pull": -1.0}, np.array([0.1, 0.2]), 0.5, None
    )
    # Damping of what moves takes its part of the loads.
    assert load.force == pytest.approx([2 - 1.5, 3 - 1, -1])
    assert load.travel == pytest.approx([0.1 + 1.5, 0.2 + 2.0])
    assert slip == pytest.approx(np.array([[3, 0], [3, 4], [3, 8], [3, 12]]))
    speed = np.hypot(3, 4 * np.arange(4))
    assert load.driven == pytest.approx(-slip / speed[:, None])
    weak = Weakening(0.2, 0.6, 0.5)
    assert load.mu == pytest.approx([weak.sliding(3.0), weak.sliding(5.0), 0.3, 0.3])
    assert load.sticking == pytest.approx([0.6, 0.6, 0.45, 0.45])


def test_the_centre_of_a_spin_is_not_driven() -> None:
    for speed, slides in ((3.1e-9, True), (2.9e-9, False)):  # of the fastest node's 3 rad/s · 1
        load, slip = history._loading(
            system_of(), plate(2), step(None, (speed, 3.0)), {"press": 1.0, "pull": 0.0}, np.zeros(2), 0.0, None
        )
        assert load.driven[0] == pytest.approx([-1.0 * slides, 0])
        assert slip[0] == pytest.approx([speed * slides, 0], abs=0)
        assert load.mu[0] == pytest.approx(Weakening(0.2, 0.6, 0.5).sliding(speed * slides), rel=1e-15)
        assert load.driven[1] == pytest.approx([0, -1], abs=1e-8)


def test_motions_that_end_drive_nothing_and_have_no_damping() -> None:
    load, slip = history._loading(
        system_of(), plate(), step(2.0), {"press": 1.0, "pull": 1.0}, np.array([1.0, 0.0]), 0.25, None
    )
    assert load.force == pytest.approx([1, 3, 1])
    assert not slip.any()
    assert not load.driven.any()
    assert load.travel == pytest.approx([1.75, 1.0])
    assert load.mu == pytest.approx([0.6, 0.6, 0.3, 0.3])


def test_friction_asked_for_scales_the_limit_of_sticking_with_it() -> None:
    """Each law once, at its contact's mean speed in steady sliding, whatever the speeds of a step are."""
    laws = (Weakening(0.2, 0.6, 0.5), Weakening(0.6, 0.2, 0.5))  # the second rises with speed
    nodes = replace(plate(), laws=laws)
    speed = np.array([0.0, 0.5, 0.0, 0.5])
    mu, sticking = history._coefficients(nodes, speed, 0.4)
    first, second = 0.4 / (0.2 + 0.4 * np.exp(-2.0)), 0.4 / (0.6 - 0.4 * np.exp(-10.0))
    fallen, risen = 0.2 + 0.4 / np.e, 0.6 - 0.4 / np.e
    assert mu == pytest.approx([first * 0.6, first * fallen, second * 0.2, second * risen])
    assert sticking == pytest.approx([first * 0.6, first * 0.6, second * 0.2, second * risen])
    plain = replace(nodes, laws=(Coulomb(0.1), Coulomb(0.2)))
    assert history._coefficients(plain, speed, 0.7)[1] == pytest.approx([0.7] * 4)


def test_the_way_through_the_steps_is_told_where_it_ends(monkeypatch) -> None:
    asked: list[tuple[np.ndarray, np.ndarray]] = []
    fails: dict[int, Exception] = {}

    class Search:
        def __init__(self, system, *, solver) -> None:
            assert solver == "some"
            self.nodes, self.solved = plate(), 17

        def start(self):
            return replace(start([STICK] * 4), travel=np.array([5.0, 6.0]))

        def increment(self, before, load):
            asked.append((load.force, load.travel))
            if len(asked) in fails:
                raise fails[len(asked)]
            return replace(before, travel=load.travel), [0.1, 0.4, 0.2, 0.0, 0.0][len(asked) - 1]

    monkeypatch.setattr(history, "StickSlip", Search)
    monkeypatch.setattr(history, "_unheld", lambda system, nodes, where, motion: f"unheld in {where} {motion}")
    system = system_of()
    first = replace(step(1.0, (1.0, 0.0), 3), loads={"press": 3.0})
    system.load_steps = (first, replace(step(0.0, (0.0, 2.0), 2), duration=None, loads={"pull": 1.0}))
    found = history.follow(system, mu=0.2, solver="some")
    # A third of the press at a time; then all of it, and half of the pull at a time, less what damping takes.
    assert [force[0] for force, _ in asked] == pytest.approx([1, 2, 3, 3, 3])
    assert [force[2] for force, _ in asked] == pytest.approx([0, 0, 0, 0.5, 1])
    assert [force[1] for force, _ in asked] == pytest.approx([2, 4, 6, 6, 6.5])
    assert found.state.travel == pytest.approx([6.0, 6.0])
    assert (found.residual, found.solved) == (0.4, 17)
    assert found.slip == pytest.approx(np.array([[0, 0], [0, 2], [0, 4], [0, 6]]))
    weak = Weakening(0.2, 0.6, 0.5)
    assert found.load.mu == pytest.approx(0.2 * np.array([0.6 / weak.sliding(1.0), weak.sliding(2.0) / weak.sliding(1.0), 1, 1]))
    for at, words in ((2, "step 1, increment 2 of 3"), (5, "step 2, increment 2 of 2")):
        asked.clear()
        fails = {at: AnalysisError("what")}
        with pytest.raises(AnalysisError, match=f"^static equilibrium, {words}: what$"):
            history.follow(system, mu=None, solver="some")
        asked.clear()
        fails = {at: SingularMatrix("", np.array([7.0]))}
        with pytest.raises(AnalysisError, match=rf"^unheld in {words} \[7\.\]$"):
            history.follow(system, mu=None, solver="some")


# -- motions and words -------------------------------------------------------------------------------------------------


def test_motions_are_those_that_run_on_after_the_last_step() -> None:
    moving: Any = SimpleNamespace(load_steps=(step(1.0, (7.0, 7.0)), step(None)), motion=None)
    assert list(motions.full_motion(moving)) == [3, 4]
    moving.load_steps = moving.load_steps[::-1]
    assert list(motions.full_motion(moving)) == [0, 0]
    moving.load_steps, moving.motion = (), SimpleNamespace(full=np.array([1.0, 0.0]))
    assert list(motions.full_motion(moving)) == [1, 0]


def test_other_loads_and_motions_than_the_last_are_refused() -> None:
    steps = (replace(step(1.0), loads={"press": 2.0}), replace(step(None, (1.0, 0.5)), loads={"pull": 0.5}))
    system: Any = SimpleNamespace(
        loads={"press": 0, "pull": 0, "other": 0}, load_steps=steps, motion=SimpleNamespace(names=("disc", "pad"))
    )
    require = solution._require_last
    right = {"press": 2.0, "pull": 0.5, "other": 0.0}
    require(system, None, None)
    require(system, right, np.array([1.0, 0.5]))
    for name, asked in (("press", 1.0), ("pull", 0.25), ("other", 1.0)):
        words = f"ends with {right[name]:g} times load {name}, and {asked:g} times is asked for; give the last of"
        with pytest.raises(AnalysisError, match=words):
            require(system, {**right, name: asked}, None)
    with pytest.raises(AnalysisError, match="ends with 0 times load other, and 1 times is asked for"):
        require(system, {"press": 2.0, "pull": 0.5}, None)
    with pytest.raises(AnalysisError, match=r"ends with 1, 0\.5 times the velocities of disc, pad, and 1, 0 times is asked"):
        require(system, None, np.array([1.0, 0.0]))

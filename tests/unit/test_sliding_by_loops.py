"""What looks at states of contact in steady sliding, on random ones, against the same said node by node in plain Python;
and the words of what it says."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

from benches import by_hand
from stridor.contact.multipliers import OPEN, SLIP, STICK
from stridor.contact.nodes import ContactNodes
from stridor.direct import SingularMatrix
from stridor.errors import AnalysisError, NotSlidingError
from stridor.laws import Coulomb, Weakening
from stridor.sliding import equilibrium, motions, pressing, solution, stretches
from stridor.sliding.equilibrium import NodeEquilibrium, find_touching, offenders
from stridor.sliding.motions import placed
from stridor.sliding.redundant import redundant
from stridor.sliding.result import SteadySliding
from stridor.sliding.resultants import balance, resultants
from stridor.sliding.stick_slip import Frictional, Loading, StickSlip
from stridor.sliding.stretches import Stretch, _different, _Equilibria, _Look, _probes
from stridor.system.model import AnswerCache
from stridor.system.motion import PrescribedMotion

STILL = PrescribedMotion.none(2)
AWAY = replace(PrescribedMotion.none(2), names=("jaw.y",), distances=(1.0,))  # a support pressed away

# What NumPy warns of is a fault here, whatever comes of it.
pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning")

# -- stick and slip ----------------------------------------------------------------------------------------------------


def random_state(rng, m: int, t: int, *, size: float) -> tuple[Any, Frictional, Frictional, Loading]:
    """A search, the state before, one found and the increment; forces and ways of a given size."""
    pick = rng.integers(0, 4, size=(8, m))
    status = rng.integers(0, 3, size=m)
    unit = rng.normal(size=(m, t))
    unit /= np.linalg.norm(unit, axis=1, keepdims=True)
    driven = np.where((pick[0] == 0)[:, None], unit, 0.0)
    direction = np.roll(unit, 1, axis=0)
    normal = size * np.where(pick[1] == 0, -1.0, 1.0) * rng.random(m) * (pick[2] > 0) * (status != OPEN)
    gap = 1e-3 * size * np.where(pick[3] < 2, -1.0, 1.0) * rng.random(m) * (status == OPEN)
    before = 1e-3 * size * rng.normal(size=(m, t))
    moved = np.where((pick[4] == 0)[:, None], 0.0, 1e-3 * size * rng.normal(size=(m, t)))
    friction = size * rng.normal(size=(m, t)) * (status != OPEN)[:, None] * (pick[5] > 0)[:, None]
    search: Any = object.__new__(StickSlip)
    search.nodes = SimpleNamespace(count=m, directions=t)
    search.movable = pick[6] > 0
    none = np.zeros(0)
    old = Frictional(none, np.zeros(m), np.zeros((m, t)), status, direction, before, np.zeros(m), none)
    new = Frictional(none, normal, friction, status, direction, before + moved, gap, none)
    mu = 0.2 + 0.5 * rng.random(m)
    return search, old, new, Loading(size * rng.normal(size=3), none, driven, mu, 1.2 * mu)


def contradictions(search, old, new, load):
    """Target, direction and severity of every node, by what `stick_slip` promises of each."""
    m = len(new.status)
    force = max(abs(f) for f in (*load.force, *new.normal_force))
    way = max(abs(x) for x in new.position.ravel()) + max(abs(x) for x in old.position.ravel())
    widest = max(abs(g) for g in new.gap)
    for i in range(m):
        is_driven = any(load.driven[i])
        slip, normal, gap = new.position[i] - old.position[i], new.normal_force[i], new.gap[i]
        target, severity, direction, by_normal = new.status[i], 0.0, new.direction[i], False
        if is_driven:
            direction = load.driven[i]
        if new.status[i] == OPEN:
            if search.movable[i] and gap < 0:
                skids = is_driven or math.hypot(*slip) > load.sticking[i] * -gap
                target, severity, by_normal = (SLIP if skids else STICK), -gap / widest, True
                if skids and not is_driven:
                    direction = -slip / max(math.hypot(*slip), 1e-300)
        elif normal < 0:
            target, severity, by_normal = OPEN, -normal / force, True
        elif new.status[i] == STICK:
            beyond = math.hypot(*new.friction[i]) - load.sticking[i] * normal
            if beyond > 0:
                target, severity = SLIP, beyond / force
                if not is_driven:
                    direction = new.friction[i] / math.hypot(*new.friction[i])
        elif not is_driven and slip @ new.direction[i] > 0:
            target, severity = STICK, slip @ new.direction[i] / way
        yield target, direction, severity, by_normal


@pytest.mark.parametrize("t", [1, 2])
@pytest.mark.parametrize("size", [1.0, 1e-10, 1e5])
def test_contradictions_are_those_of_each_node_by_itself(t: int, size: float) -> None:
    rng = np.random.default_rng(8)
    for _ in range(4):
        given = random_state(rng, 60, t, size=size)
        found = given[0]._violations(*given[1:2], given[3], given[2])
        target, direction, severity, by_normal = zip(*contradictions(given[0], given[1], given[2], given[3]), strict=True)
        assert list(found.target) == list(target)
        assert found.severity == pytest.approx(np.array(severity), rel=1e-12)
        assert found.direction == pytest.approx(np.array(direction), rel=1e-12)
        assert list(found.by_normal) == list(by_normal)


@pytest.mark.parametrize("size", [1.0, 1e-10, 1e5])
def test_directions_turn_towards_the_slip_of_each_node_by_itself(size: float) -> None:
    rng = np.random.default_rng(9)
    for _ in range(4):
        search, old, new, load = random_state(rng, 60, 2, size=size)
        missed, direction, across = search._turn(old, load, new)
        worst, largest = 0.0, max(mu * max(p, 0.0) for mu, p in zip(load.mu, new.normal_force, strict=True))
        for i in range(60):
            limit = load.mu[i] * new.normal_force[i]
            if new.status[i] != SLIP or any(load.driven[i]) or limit <= 0:
                assert list(direction[i]) == list(new.direction[i])
                assert across[i] == 0
                continue
            slip = new.position[i] - old.position[i]
            if any(slip):
                expected = -slip / math.hypot(*slip)
                assert across[i] == pytest.approx(math.hypot(*slip) / limit, rel=1e-12)
            else:
                expected = new.friction[i] / max(math.hypot(*new.friction[i]), 1e-300)
                assert across[i] == 0
            assert direction[i] == pytest.approx(expected, rel=1e-12)
            worst = max(worst, math.hypot(*(new.friction[i] - limit * expected)))
        assert missed == pytest.approx(worst / largest, rel=1e-12)


@pytest.mark.parametrize("t", [1, 2])
def test_where_no_force_acts_nothing_contradicts_and_nothing_turns(t: int) -> None:
    search, old, new, load = random_state(np.random.default_rng(10), 30, t, size=0.0)
    assert not search._violations(old, load, new).any
    missed, direction, across = search._turn(old, load, new)
    assert missed == 0.0
    assert not across.any()
    assert direction.shape == new.direction.shape


def test_what_rounding_moves_has_not_slipped() -> None:
    # Of the way that nodes have gone altogether, before as well, 1e-11 is rounding.
    none = np.zeros(0)
    search: Any = object.__new__(StickSlip)
    search.nodes, search.movable = SimpleNamespace(count=2, directions=2), np.ones(2, dtype=bool)
    old = Frictional(none, none, none, none, none, np.array([[0.0, 0], [3.0, 0]]), none, none)
    for slip, slipped in ((0.9e-10, False), (1.1e-10, True)):
        new = Frictional(
            none, np.full(2, 10.0), np.array([[0.0, 3.0], [0, 3]]), np.full(2, SLIP), np.array([[1.0, 0], [1, 0]]),
            np.array([[slip, 0], [7.0, 0]]), np.zeros(2), none,
        )  # fmt: skip
        load = Loading(np.zeros(1), none, np.zeros((2, 2)), np.full(2, 0.3), np.full(2, 0.3))
        _, direction, across = search._turn(old, load, new)
        assert direction[0] == pytest.approx([-1, 0] if slipped else [0, 1])
        assert bool(across[0] > 0) is slipped
        # Friction along (1, 0) with a slip along it: it has turned round.
        assert bool(search._violations(old, load, new).severity[0] > 0) is slipped


# -- normal contact ----------------------------------------------------------------------------------------------------


def test_offenders_are_those_beyond_rounding_and_the_worst_come_first() -> None:
    rng = np.random.default_rng(3)
    for size in (1.0, 1e-7, 1e6):
        for _ in range(20):
            m = 30
            active, movable = rng.random(m) < 0.5, rng.random(m) < 0.8
            force = size * rng.normal(size=m) * 10.0 ** rng.integers(-14, 1, size=m)
            gap = size * rng.normal(size=m) * 10.0 ** rng.integers(-14, 1, size=m)
            load = size * rng.choice([0.1, 10.0])
            pulled, closing = offenders(NodeEquilibrium(active, np.zeros(0), force, gap), movable, load)
            rounding, width = 1e-12 * max(*np.abs(force), load), 1e-12 * max(np.abs(gap))
            assert list(pulled) == sorted((i for i in range(m) if active[i] and force[i] < -rounding), key=lambda i: force[i])
            assert list(closing) == sorted(
                (i for i in range(m) if not active[i] and movable[i] and gap[i] < -width), key=lambda i: gap[i]
            )
    empty = NodeEquilibrium(np.zeros(0, dtype=bool), np.zeros(0), np.zeros(0), np.zeros(0))
    assert [len(x) for x in offenders(empty, np.zeros(0, dtype=bool), 0.0)] == [0, 0]


class Tried:
    """An equilibrium of m nodes whose answers come from a table: set of touching nodes → forces, None where singular."""

    def __init__(self, m: int, answer, *, kept=(), movable=None) -> None:
        normal = np.eye(m) if movable is None else np.diag(np.asarray(movable, dtype=float))
        held = np.isin(np.arange(m), kept)
        self.nodes: Any = SimpleNamespace(normal=sp.csr_array(normal), kept=held)
        self.force = np.full(1, 2.0)
        self.answer, self.asked, self.starts = answer, [], []

    def solve(self, active, start=None):
        self.asked.append(set(np.flatnonzero(active).tolist()))
        self.starts.append(start)
        forces = self.answer(self.asked[-1], len(self.asked))
        if forces is None:
            raise SingularMatrix("", None)
        forces = np.asarray(forces, dtype=float)
        return NodeEquilibrium(active.copy(), np.array([float(len(self.asked))]), np.where(active, forces, 0.0), np.where(active, 0.0, forces))  # fmt: skip


def test_settling_begins_with_the_guess_and_what_is_kept() -> None:
    table = Tried(4, lambda active, k: [1, 1, 1, 1], kept=(3,), movable=[1, 1, 0, 1])
    state, steps = find_touching(table, np.array([True, False, True, False]))
    assert table.asked == [{0, 3}]
    assert steps == 1
    assert list(state.active) == [True, False, False, True]
    table = Tried(4, lambda active, k: [1, 1, -1, 1], movable=[1, 1, 0, 1])
    find_touching(table)
    assert table.asked == [{0, 1, 3}]
    # A kept one may pull.
    find_touching(Tried(2, lambda active, k: [-1, 1], kept=(0,)))


def test_a_guess_that_does_not_hold_the_structure_is_left_for_all_nodes() -> None:
    table = Tried(3, lambda active, k: [1, 1, 1] if len(active) == 3 else None)
    assert find_touching(table, np.array([True, False, False]))[1] == 2
    assert table.asked == [{0}, {0, 1, 2}]
    assert table.starts == [None, None]
    table = Tried(3, lambda active, k: None)
    with pytest.raises(SingularMatrix):
        find_touching(table, np.array([True, False, False]))
    assert table.asked == [{0}, {0, 1, 2}]


def test_where_letting_go_frees_the_structure_the_half_that_pulls_less_is_taken_back() -> None:
    pulls = [1.0, -4, -1, -3, -2, 1]
    answers = {1: pulls, 2: None, 3: [1, 0, 1, 0, 1, 1]}
    table = Tried(6, lambda active, k: answers[k])
    find_touching(table)
    assert table.asked == [{0, 1, 2, 3, 4, 5}, {0, 5}, {0, 2, 4, 5}]
    assert table.starts[0] is None
    assert [s[0] for s in table.starts[1:]] == [1.0, 1.0]  # Newton's method begins where the last answer was
    # From then on half of the worst alone changes: of two that pull the worse.
    answers = {1: pulls, 2: None, 3: [1, 0, -1, 0, -2, 1], 4: [1, 0, 1, 0, 0, 1]}
    table = Tried(6, lambda active, k: answers[k])
    find_touching(table)
    assert table.asked[3] == {0, 2, 5}
    # One that was let go cannot be fewer.
    answers = {1: [1, -1, 1], 2: None}
    table = Tried(3, lambda active, k: answers[k])
    with pytest.raises(SingularMatrix):
        find_touching(table)
    assert len(table.asked) == 2
    # Of three one is taken back for good, two stay let go... and a smaller part the next time.
    answers = {1: [1, -1, -2, -3], 2: None, 3: None}
    table = Tried(4, lambda active, k: answers[k])
    with pytest.raises(SingularMatrix):
        find_touching(table)
    assert table.asked[:3] == [{0, 1, 2, 3}, {0}, {0, 1, 2}]


def test_sets_that_come_back_are_left_more_carefully_each_time() -> None:
    # All pull while all touch, all penetrate while none do: then only letting go, then half of the worst, then one.
    def answer(active, k):
        return [-4, -3, -2, -1] if len(active) == 4 else [-1, -2, -3, -4] if not active else [1, 1, 1, 1]

    table = Tried(4, answer)
    assert find_touching(table)[1] == len(table.asked)
    assert table.asked[:2] == [{0, 1, 2, 3}, set()]
    assert 0 < len(table.asked[-1]) < 4


def test_what_does_not_settle_is_told_after_its_steps() -> None:
    table = Tried(9, lambda active, k: [-1] * 9)
    with pytest.raises(AnalysisError, match="the set of touching nodes does not settle in 60 steps; turn loads that pull"):
        find_touching(table)
    assert len(table.asked) == 60
    with pytest.raises(AnalysisError, match="in 7 steps"):
        find_touching(Tried(9, lambda active, k: [-1] * 9), limit=7)
    # The seventh try may still be the one.
    assert find_touching(Tried(1, lambda active, k: [-1] if k < 7 else [1]), limit=7)[1] == 7


def test_residual_is_the_largest_imbalance_over_the_largest_force() -> None:
    rng = np.random.default_rng(4)
    n, m = 5, 3
    stiffness, push, force = rng.normal(size=(n, n)), rng.normal(size=(m, n)), rng.normal(size=n)
    rows, lift, coefficient = rng.normal(size=(2, n)), rng.normal(size=(2, 1)), np.array([3.0, 0.5])
    u, normal = rng.normal(size=n), -rng.random(m)
    for cubic in (False, True):
        springs = SimpleNamespace(
            coefficient=coefficient, stretch=np.array([0.3, -0.2]),
            rows=SimpleNamespace(free=sp.csr_array(rows), lift=lift),
        )  # fmt: skip
        system = SimpleNamespace(of_matrices=AnswerCache(), stiffness=sp.csr_array(stiffness), cubic=springs if cubic else None, size=n)
        nodes = SimpleNamespace(compliance=np.zeros(m), gap=np.zeros(m))
        found = equilibrium.Equilibrium(
            system, nodes, sp.csr_array(push), force, symmetric=False, solver=None, travel=np.array([0.4])
        )
        given = NodeEquilibrium(np.ones(m, dtype=bool), u, normal, np.zeros(m))
        imbalance, terms = [], []
        for i in range(n):
            left = sum(stiffness[i, j] * u[j] for j in range(n))
            for k in range(2 if cubic else 0):
                stretch = sum(rows[k, j] * u[j] for j in range(n)) + springs.stretch[k] + 0.4 * lift[k, 0]
                left += rows[k, i] * coefficient[k] * stretch**3
            imbalance.append(left - force[i] - sum(push[k, i] * normal[k] for k in range(m)))
            terms.append(
                sum(abs(stiffness[i, j] * u[j]) for j in range(n)) + abs(force[i])
                + sum(abs(push[k, i] * normal[k]) for k in range(m))
            )  # fmt: skip
        assert found.residual(given) == pytest.approx(max(map(abs, imbalance)) / max(terms), rel=1e-12)
    still = equilibrium.Equilibrium(
        SimpleNamespace(of_matrices=AnswerCache(), stiffness=sp.csr_array(stiffness), cubic=None, size=n), nodes, sp.csr_array(push), np.zeros(n),
        symmetric=False, solver=None,
    )  # fmt: skip
    assert still.residual(NodeEquilibrium(np.ones(m, dtype=bool), np.zeros(n), np.zeros(m), np.zeros(m))) == 0.0


def pressed(rng, *, stiff: float, size: float, mu: float = 0.2) -> Any:
    """Six freedoms, four nodes of which two are rigid, one is soft and one nearly rigid, and a load, in given units."""
    n, m = 6, 4
    root = rng.normal(size=(n, n))
    stiffness = stiff * (root @ root.T + np.eye(n))
    normal, tangent = rng.normal(size=(m, n)), mu * rng.normal(size=(m, n))
    compliance = np.array([0.0, 0.3, 1e-13, 0.0]) / stiff
    gap = size / stiff * rng.normal(size=m)
    return stiffness, normal, normal + tangent, compliance, gap, size * rng.normal(size=n)


def by_all_sets(stiffness, normal, push, compliance, gap, force) -> list[tuple[Any, Any, Any]]:
    """Displacement, forces and gaps of every set of touching nodes that is right: N ≥ 0 on it, g ≥ 0 elsewhere."""
    right = []
    n, m = len(force), len(gap)
    for number in range(2**m):
        on = [k for k in range(m) if number >> k & 1]
        matrix, side = np.zeros((n + len(on), n + len(on))), np.zeros(n + len(on))
        scale = np.abs(stiffness).max()
        matrix[:n, :n], side[:n] = stiffness / scale, force / scale
        for j, k in enumerate(on):
            matrix[:n, n + j], matrix[n + j, :n] = -push[k], normal[k]
            matrix[n + j, n + j], side[n + j] = compliance[k] * scale, -gap[k]
        answer = np.linalg.solve(matrix, side)
        forces = np.zeros(m)
        forces[on] = answer[n:] * scale
        open_by = gap + normal @ answer[:n]
        if (forces >= 0).all() and all(open_by[k] >= 0 for k in range(m) if k not in on):
            right.append((answer[:n], forces, open_by))
    return right


@pytest.mark.parametrize(("stiff", "size"), [(1.0, 1.0), (1e11, 1e-3), (1e-9, 1e-8), (1e7, 1e6)])
def test_equilibria_are_those_that_trying_all_sets_finds(stiff: float, size: float) -> None:
    rng = np.random.default_rng(15)
    tried = 0
    for _ in range(12):
        stiffness, normal, push, compliance, gap, force = given = pressed(rng, stiff=stiff, size=size)
        right = by_all_sets(*given)
        if len(right) != 1:
            continue
        tried += 1
        u, forces, open_by = right[0]
        system: Any = SimpleNamespace(of_matrices=AnswerCache(), stiffness=sp.csr_array(stiffness), cubic=None, size=6, symmetric_definite=True)
        rows = equilibrium.ContactRows(sp.csr_array(normal), gap, compliance, np.zeros(4), np.zeros(4, dtype=bool))
        solver = equilibrium.Equilibrium(system, rows, sp.csr_array(push), force, symmetric=False, solver=None)
        for guess in (None, rng.random(4) < 0.5):
            state, steps = find_touching(solver, guess)
            assert state.displacement == pytest.approx(u, rel=1e-7, abs=1e-9 * np.abs(u).max())
            assert state.normal_force == pytest.approx(forces, rel=1e-6, abs=1e-9 * size)
            assert state.gap == pytest.approx(open_by, abs=1e-9 * np.abs(u).max())
            assert solver.residual(state) < 1e-12
            assert steps < 12
    assert tried > 6


# -- resultants and balance --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("d", [2, 3])
def test_resultants_are_sums_over_the_nodes_of_each_contact(d: int) -> None:
    rng = np.random.default_rng(11)
    m = 12
    frames = np.array([np.linalg.qr(rng.normal(size=(d, d)))[0] for _ in range(m)])
    owner, active = np.arange(m) % 3, rng.random(m) < 0.7
    area = np.where(owner == 2, np.nan, 0.1 + rng.random(m))
    nodes: Any = SimpleNamespace(
        names=("a", "b", "points"), owner=owner, normals=frames[:, 0], tangents=frames[:, 1:], area=area,
        position=rng.normal(size=(m, d)),
    )  # fmt: skip
    normal, friction = rng.random(m) * active, rng.normal(size=(m, d - 1)) * active[:, None]
    found = resultants(nodes, normal, friction, active)
    for k, name in enumerate(nodes.names):
        force, moment = np.zeros(d), np.zeros(3)
        for i in np.flatnonzero(owner == k):
            own = normal[i] * frames[i, 0] + sum(friction[i, q] * frames[i, 1 + q] for q in range(d - 1))
            force = force + own
            moment += np.cross(np.append(nodes.position[i], np.zeros(3 - d)), np.append(own, np.zeros(3 - d)))
        assert found[name].force == pytest.approx(force)
        assert found[name].moment == pytest.approx(moment if d == 3 else moment[2])
        mine = [i for i in range(m) if owner[i] == k and active[i]]
        assert found[name].area == pytest.approx(sum(area[i] for i in mine), nan_ok=True)
        assert found[name].largest_pressure == pytest.approx(max(normal[i] / area[i] for i in mine), nan_ok=True)
    nothing = resultants(nodes, 0 * normal, 0 * friction, np.zeros(m, dtype=bool))["a"]
    assert (nothing.area, nothing.largest_pressure) == (0.0, 0.0)


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize(("size", "large"), [(1.0, 1.0), (1e-9, 1e-6), (1e7, 1e3)])
def test_balance_is_the_work_left_in_rigid_motions(d: int, size: float, large: float) -> None:
    """A free body of three points: what is left of forces over their sum along each axis, and of moments about its
    middle, over the sum of their sizes."""
    rng = np.random.default_rng(12)
    at = large * rng.normal(size=(4, d))
    solid = SimpleNamespace(points=at, rows=SimpleNamespace(free=sp.csr_array(np.eye(4 * d))))
    free: Any = SimpleNamespace(lines=(), solids=(solid,), stiffness=sp.csr_array((4 * d, 4 * d)))
    load, contact = size * rng.normal(size=(2, 4 * d))
    found = balance(free, load, contact)
    both, sizes = (load + contact).reshape(4, d), (np.abs(load) + np.abs(contact)).reshape(4, d)
    assert found.force_error == pytest.approx(max(np.abs(both.sum(axis=0)) / sizes.sum(axis=0)))
    about = at - at.mean(axis=0)
    turns = []
    for a, b in [(0, 1), (1, 2), (2, 0)][: 1 if d == 2 else 3]:
        work = sum(about[i, a] * both[i, b] - about[i, b] * both[i, a] for i in range(4))
        turns.append(abs(work) / sum(abs(about[i, a]) * sizes[i, b] + abs(about[i, b]) * sizes[i, a] for i in range(4)))
    assert found.moment_error == pytest.approx(max(turns))
    # A motion that strains the structure is held by it; so is one in which nothing moves.
    for strain, held in ((0.9e-9, False), (1.1e-9, True)):  # of the stiffest, between two points along the second axis
        springs = np.zeros((4 * d, 4 * d))
        springs[1, 1], springs[1, 1 + d], springs[0, 0] = size, -size, strain * size
        free.stiffness = sp.csr_array(springs)
        errors = np.abs(both.sum(axis=0)) / sizes.sum(axis=0)
        assert balance(free, load, contact).force_error == pytest.approx(max(errors[1:] if held else errors))
    springs = np.diag([size] + [0.0] * (4 * d - 1))
    free.stiffness = sp.csr_array(springs)
    assert balance(free, load, contact).force_error == pytest.approx(max(np.abs(both.sum(axis=0)[1:]) / sizes.sum(axis=0)[1:]))
    solid.rows.free = sp.csr_array((4 * d, 4 * d))
    held = balance(free, load, contact)
    assert math.isnan(held.force_error)
    assert math.isnan(held.moment_error)


# -- friction as damping -----------------------------------------------------------------------------------------------


def rubbing(d: int, speeds, *, mu=None, kept: bool = False) -> tuple[Any, ContactNodes, SteadySliding]:
    """Five nodes with freedoms of their own under laws that weaken, and that do not, sliding at given speeds."""
    rng = np.random.default_rng(14)
    m, t = len(speeds), d - 1
    frames = np.array([np.linalg.qr(rng.normal(size=(d, d)))[0] for _ in range(m)])
    normal, tangent = np.zeros((m, d * m)), np.zeros((t * m, d * m))
    for i in range(m):
        normal[i, d * i : d * (i + 1)], tangent[t * i : t * (i + 1), d * i : d * (i + 1)] = frames[i, 0], frames[i, 1:]
    laws = (Weakening(0.2, 0.6, 0.5), Coulomb(0.3))
    nodes = ContactNodes(
        ("weak", "plain"), np.arange(m) % 2, laws, sp.csr_array(normal), sp.csr_array(tangent), np.zeros((m, 1)),
        np.zeros((t * m, 1)), np.zeros(m), np.ones(m), np.zeros(m), np.zeros((m, d)), frames[:, 0], frames[:, 1:],
    )  # fmt: skip
    sense = rng.normal(size=(m, t))
    sense /= np.linalg.norm(sense, axis=1, keepdims=True)
    force = rng.random(m) * (-1.0 if kept else 1.0)
    own = nodes.friction_coefficients(np.asarray(speeds))
    steady = SteadySliding(
        displacement=np.zeros(d * m), normal_force=force, friction_force=np.zeros((m, t)),
        slip_velocity=-sense * np.asarray(speeds)[:, None], sense=sense, active=np.ones(m, dtype=bool),
        friction_coefficient=own if mu is None else np.full(m, mu), gap=np.zeros(m), residual=0.0, iterations=1,
        status=np.full(m, SLIP), travel=np.zeros(1),
    )  # fmt: skip
    return SimpleNamespace(contact_nodes=lambda: nodes, size=d * m), nodes, steady


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("mu", [None, 0.5])
@pytest.mark.parametrize("kept", [False, True])
def test_friction_damps_along_the_slip_by_its_slope_and_across_it_by_its_turn(d: int, mu, kept: bool) -> None:
    """−∂/∂w of −μ(|w|) |N| w/|w|, node by node, by differences; one that does not touch and one without slip add
    nothing."""
    speeds = np.array([0.3, 0.7, 0.2, 0.4, 0.9, 0.8])
    system, nodes, steady = rubbing(d, speeds, mu=mu, kept=kept)
    sense, active = steady.sense.copy(), steady.active.copy()
    sense[4], active[5] = 0.0, False
    steady = replace(steady, sense=sense, active=active)
    found = solution.friction_damping_matrix(system, steady).toarray()
    wanted = np.zeros_like(found)
    for i in range(4):
        law = nodes.laws[nodes.owner[i]]
        law = law if mu is None else law.scaled(mu, speeds[i])
        tangents = nodes.tangent.toarray()[(d - 1) * i : (d - 1) * (i + 1)]

        def friction(w, law=law, i=i):
            return -law.sliding(float(np.linalg.norm(w))) * abs(steady.normal_force[i]) * w / np.linalg.norm(w)

        step, w = 1e-6, steady.slip_velocity[i]
        slope = np.array([(friction(w + step * e) - friction(w - step * e)) / (2 * step) for e in np.eye(d - 1)]).T
        wanted -= tangents.T @ slope @ tangents
    assert found == pytest.approx(wanted, abs=1e-8)


def test_a_node_at_its_limit_that_no_motion_slides_does_not_damp() -> None:
    system, _, steady = rubbing(3, np.array([0.3, 0.7]))
    whole = solution.friction_damping_matrix(system, steady).toarray()
    slip = steady.slip_velocity.copy()
    slip[1] = 0.0
    still = replace(steady, slip_velocity=slip)
    assert list(still.slips_still) == [False, True]
    part = solution.friction_damping_matrix(system, still).toarray()
    assert part[:3, :3] == pytest.approx(whole[:3, :3])
    assert not part[3:].any()
    assert list(replace(still, status=np.array([SLIP, STICK])).slips_still) == [False, False]
    assert list(replace(still, sense=np.zeros((2, 2))).slips_still) == [False, False]


# -- words and limits --------------------------------------------------------------------------------------------------


def gap_changes(opening, slip) -> None:
    nodes: Any = SimpleNamespace(
        names=("first", "second"), owner=np.array([0, 1, 1]), normal_lift=np.array([[0.0], [opening], [opening / 2]])
    )
    solution._require_constant_gap(nodes, np.array([-2.0]), np.array([5.0, slip, slip / 2]))


def test_motions_that_change_a_gap_are_told_with_their_speed() -> None:
    gap_changes(0.49e-9 * 0.3, 0.3)
    with pytest.raises(AnalysisError, match=r"^contact second: the prescribed velocities change its gap at 3\.06e-10 m/s, so"):
        gap_changes(0.51e-9 * 0.3, 0.3)
    gap_changes(0.49e-15, 0.0)
    with pytest.raises(AnalysisError, match=r"at 1\.02e-15 m/s"):
        gap_changes(0.51e-15, 0.0)


def test_a_contact_none_of_whose_nodes_slides_is_told_where_it_has_friction() -> None:
    nodes: Any = SimpleNamespace(names=("first", "second", "none"), owner=np.array([0, 0, 1, 1]))
    mu = np.array([0.0, 0.0, 0.1, 0.0])
    slides = np.array([False, False, True, False])
    touching = np.ones(4, dtype=bool)
    solution._require_slip(nodes, slides, mu, touching)
    solution._require_slip(nodes, slides & False, mu, ~touching)
    for stands, friction, name in ((~slides, mu, "second"), (~slides & False, mu + 0.1, "first")):
        still = stands & np.array([True, True, False, False])
        with pytest.raises(AnalysisError, match=f"^contact {name} does not slide: no support moves one of its bodies along"):
            solution._require_slip(nodes, still if name == "second" else still & False, friction, touching)


def test_friction_coefficients_in_words() -> None:
    assert motions.words_of_friction(np.array([0.3, 0.3 + 1e-9])) == "μ = 0.3"
    assert motions.words_of_friction(np.array([0.3, 0.1, 0.2])) == "μ = 0.1 … 0.3"


def points_on(speed: float, opening: float, *, mu: float = 0.2) -> Any:
    """Two bodies, each held by a spring of 2 N/m along x and pressed along y by 1 N and 4 N on a support that runs: the
    first slides on it at 3 m/s, the second slides and opens at these speeds at full motion."""
    normal, tangent = np.eye(4)[[1, 3]], np.eye(4)[[0, 2]]
    loads = {"P": np.array([0.0, -1.0, 0.0, 0.0]), "Q": np.array([0.0, 0.0, 0.0, -4.0])}
    laws = [Weakening(mu, 2 * mu, 1.0), Weakening(mu, 2 * mu, 1.0)]
    system = by_hand(np.eye(4), np.zeros((4, 4)), 2.0 * np.eye(4), normal, tangent, math.inf, loads=loads, law=laws[0])
    lifts = [(np.array([3.0]), np.zeros(1)), (np.array([speed]), np.array([opening]))]
    contacts = [replace(c, tangent_lift=t, normal_lift=o) for c, (t, o) in zip(system.contacts, lifts, strict=True)]
    motion = replace(system.motion, damping=np.array([[0.0], [0.5], [0.0], [0.0]]))
    return replace(system, contacts=tuple(contacts), motion=motion)


def test_points_slide_against_their_motion_under_their_loads() -> None:
    system, weakens = points_on(-0.5, 0.0), lambda speed: 0.2 * (1 + math.exp(-speed))
    found = solution.steady_sliding(system)
    assert found.slip_velocity[:, 0].tolist() == [3.0, -0.5]
    assert found.sense[:, 0].tolist() == [-1.0, 1.0]
    assert found.normal_force == pytest.approx([1.5, 4.0])  # the damper pushes the first by 0.5 N
    assert found.friction_coefficient == pytest.approx([weakens(3.0), weakens(0.5)])
    assert found.displacement == pytest.approx([-1.5 * weakens(3.0) / 2, 0.0, 4.0 * weakens(0.5) / 2, 0.0], abs=1e-15)
    found = solution.steady_sliding(
        system, mu=0.7, load_factors={"Q": 2.0, "P": 0.5}, motion_factors=np.array([2.0])
    )
    assert found.slip_velocity[:, 0].tolist() == [6.0, -1.0]
    assert found.normal_force == pytest.approx([1.5, 8.0])
    # μ is told at full velocity, and a law gives at another what it has there.
    first, second = (0.7 * weakens(2 * v) / weakens(v) for v in (3.0, 0.5))
    assert found.displacement == pytest.approx([-first * 1.5 / 2, 0.0, second * 8.0 / 2, 0.0], abs=1e-15)
    assert solution.steady_sliding(system, load_factors={}).normal_force == pytest.approx([1.5, 4.0])
    back = solution.steady_sliding(system, mu=0.7, motion_factors=np.array([-1.0]))
    assert back.sense[:, 0].tolist() == [1.0, -1.0]
    assert back.displacement == pytest.approx([0.7 * 0.5 / 2, 0.0, -0.7 * 4.0 / 2, 0.0], abs=1e-15)


def test_points_that_do_not_slide_or_whose_gap_changes_are_told() -> None:
    for speed, opening in ((0.5, 0.49e-9), (0.0, 0.9e-15), (1e-3, 0.9e-12)):
        solution.steady_sliding(points_on(speed, opening), mu=0.0)
    for speed, opening, told in ((0.5, -0.51e-9, "5.1e-10"), (0.0, 1.1e-15, "1.1e-15"), (1e-3, 1.1e-12, "1.1e-12")):
        with pytest.raises(AnalysisError, match=f"^contact C1: the prescribed velocities change its gap at {told} m/s, so"):
            solution.steady_sliding(points_on(speed, opening))
    system = points_on(0.0, 0.0)
    with pytest.raises(AnalysisError, match=r"^contact C1 does not slide: no support moves one of its bodies along"):
        solution.steady_sliding(system)
    solution.steady_sliding(system, mu=0.0)
    solution.steady_sliding(system, load_factors={"P": 1.0, "Q": 0.0})  # nothing presses there
    # Nothing slides: said before anything is solved.
    with pytest.raises(NotSlidingError, match=r"^contact C0 does not slide: no support moves one of its bodies along"):
        solution.steady_sliding(system, motion_factors=np.zeros(1))


@pytest.mark.parametrize("stiffness", [1e-13, 0.0])
def test_a_structure_that_nothing_holds_is_told(stiffness: float) -> None:
    """Three masses, of which only the first two may press on something; a force on the third."""
    rows = np.eye(3)
    loads = {"press": np.array([-1.0, -1.0, 0.5])}

    def masses(*springs: float) -> Any:
        return by_hand(rows, 0 * rows, np.diag(springs), rows[:2], rows[1::-1], math.inf, loads=loads, slip=-1.0)

    with pytest.raises(AnalysisError, match="can move freely under the loads; fix a freedom"):
        solution.steady_sliding(masses(1.0, 1.0, stiffness), mu=0.1)
    found = solution.steady_sliding(masses(2.0, 4.0, 1.0), mu=0.1)
    # A contact that presses rubs the mass of the other.
    assert found.normal_force == pytest.approx([1 / 1.1, 1 / 1.1])
    assert found.displacement == pytest.approx([0.0, 0.0, 0.5], abs=1e-15)
    assert found.residual < 1e-15


@pytest.mark.parametrize(("part", "twice"), [(0.95, True), (1.05, False)])
def test_rows_that_lean_by_rounding_are_the_same(part: float, twice: bool) -> None:
    # Two unit rows at an angle e have eigenvalues e²/2 and 2: the same below 1e-10 of the larger.
    lean = math.sqrt(2 * part * 2e-10)
    nodes = SimpleNamespace(
        normal=sp.csr_array(np.array([[5.0, 2.5 * lean], [3.0, -1.5 * lean], [0, 2.0]])),
        owner=np.arange(3), names=("a", "b", "c"),
    )  # fmt: skip
    said = redundant(SimpleNamespace(holders={}), nodes, np.array([True, True, False]))
    assert bool(said) is twice
    assert ("1 of the 2 conditions of rigid contact follows from the others (" in said) is twice
    assert "1 of the 3 conditions" in redundant(SimpleNamespace(holders={}), nodes, np.ones(3, dtype=bool))
    nodes = SimpleNamespace(normal=sp.csr_array(np.array([[1.0, 0], [1, 0], [0, 1], [0, 1]])), owner=np.array([0, 1, 0, 1]), names=("a", "b"))
    said = redundant(SimpleNamespace(holders={}), nodes, np.ones(4, dtype=bool))
    assert "2 of the 4 conditions of rigid contact follow from the others (" in said


def test_what_presses_is_told_from_rounding_of_all_loads() -> None:
    system: Any = SimpleNamespace(loads={"a": np.array([3.0, -4.0]), "b": np.array([0.0, 5.0])}, load_steps=(), motion=STILL, contact_nodes=None)
    assert pressing.least_force(system) == pytest.approx(12e-9)
    assert pressing.nothing_presses(system, np.array([0.0, -11.9e-9]))
    assert not pressing.nothing_presses(system, np.array([0.0, -12.1e-9]))
    assert pressing.nothing_presses(system, np.zeros(0))
    pressing.require_pressed(system, np.zeros(0))
    pressing.require_pressed(system, np.array([1.0]))
    with pytest.raises(AnalysisError, match=r"^no normal force: the loads a \(5 N\), b \(5 N\) leave every contact at 0 N"):
        pressing.require_pressed(system, np.zeros(1))
    assert pressing.taken_as_closed(system) == ()
    system.loads, system.contact_nodes = {}, lambda: SimpleNamespace(count=1)
    pressing.require_pressed(system, np.zeros(1))
    assert len(pressing.taken_as_closed(system)) == 1
    system.motion = AWAY  # its force is known, as that of a load is
    assert pressing.taken_as_closed(system) == ()
    system.motion, system.contact_nodes = STILL, lambda: SimpleNamespace(count=0)
    assert pressing.taken_as_closed(system) == ()


def test_loads_load_steps_and_distances_act() -> None:
    for changes, acts in (({}, False), ({"loads": {"P": 1}}, True), ({"load_steps": (1,)}, True), ({"motion": AWAY}, True)):
        system: Any = SimpleNamespace(**{"loads": {}, "load_steps": (), "motion": STILL, **changes})
        assert pressing.anything_acts(system) is acts


# -- stretches of friction ---------------------------------------------------------------------------------------------


def line_of(forces, mu: float, *, kept=()) -> SteadySliding:
    """Steady sliding of nodes whose "force minus gap" is a straight line over μ: each touches where it is positive."""
    value = np.array([a + b * mu for a, b in forces])
    touches = (value > 0) | np.isin(np.arange(len(value)), kept)
    none = np.zeros((len(value), 1))
    return SteadySliding(
        np.zeros(0), np.where(touches, value, 0.0), none, none, none, touches, np.full(len(value), mu),
        np.where(touches, 0.0, -1e-6 * value), 0.0, 1, np.where(touches, SLIP, OPEN), np.zeros(0),
    )  # fmt: skip


def model(monkeypatch, forces, *, own: float = 0.1, size: int = 10, none_beyond: float = np.inf, kept=()) -> tuple[Any, list]:
    asked: list[tuple[float | None, Any]] = []

    def steady(system, *, mu=None, guess=None, solver=None):
        asked.append((mu, guess))
        at = own if mu is None else mu
        if at > none_beyond:
            raise AnalysisError("it tips over")
        return line_of(forces, at, kept=kept)

    monkeypatch.setattr(stretches, "steady_sliding", steady)
    monkeypatch.setattr(stretches, "other_equilibria", lambda *_: [])
    monkeypatch.setattr(stretches, "FEW", 3)  # as of many nodes
    held = np.isin(np.arange(len(forces)), kept)
    nodes = SimpleNamespace(count=len(forces), kept=held)
    once = AnswerCache().once
    system = SimpleNamespace(
        contact_nodes=lambda: nodes, loads={"P": 1}, load_steps=(), motion=STILL, size=size, once=once
    )
    system.in_place = lambda: system
    return system, asked


LINES = [(1.0, 1.0), (1.0, -1 / 0.31), (-0.1, 1 / 3.3), (1.0, -1 / 0.7001)]  # change at 0.31, 0.33 and 0.7001


def test_stretches_end_where_forces_and_gaps_run_out(monkeypatch) -> None:
    system, asked = model(monkeypatch, LINES)
    found = stretches.stretches(system, 0.0, 0.9)
    assert [s.low for s in found] == pytest.approx([0.0, 0.31, 0.33, 0.7001], abs=1e-9)
    assert [s.high for s in found] == [*[s.low for s in found[1:]], 0.9]
    assert [s.touching for s in found] == [3, 2, 3, 2]
    assert [s.nodes for s in found] == [4] * 4
    assert found[0].at is None
    for s in found[1:]:
        assert s.at is not None
        assert min(s.at - s.low, s.high - s.at) > 1e-3 * (s.high - s.low)  # not where a force is zero but for rounding
    assert not any(s.reason or s.others for s in found)
    # Nine looks, and few more for each change, as all is straight; no μ twice.
    values = [mu for mu, _ in asked if mu is not None]
    assert len(set(values)) == len(values) < 9 + 3 * 8
    assert {round(0.9 * k / 8, 12) for k in range(9)} <= {round(mu, 12) for mu in values}
    # The first look takes the nodes at the case's own friction for its guess, later ones those of the nearest look.
    assert list(asked[1][1]) == [True, True, False, True]


def test_of_few_nodes_each_equilibrium_is_found_as_if_no_other_were_known(monkeypatch) -> None:
    system, asked = model(monkeypatch, LINES)
    monkeypatch.setattr(stretches, "FEW", 4)
    looked: list[float] = []

    def others(_: object, __: object, mu: float) -> list[str]:
        looked.append(mu)
        return ["another"] if mu > 0.8 else []

    monkeypatch.setattr(stretches, "other_equilibria", others)
    found = stretches.stretches(system, 0.0, 0.9)
    assert all(guess is None for _, guess in asked)
    assert looked == pytest.approx([0.0, 0.45, 0.9])
    assert [s.several for s in found] == [(), (), (), (0.9,)]
    assert [w for w in stretches.stretch_words(found) if "more than one" in w] == [
        "At μ = 0.9 there is more than one equilibrium of steady sliding, each with other nodes that touch: modes and onsets "
        "are those of one of them (`stridor steady --mu` names the others)."
    ]


def test_larger_models_and_single_values_are_looked_at_less_and_more(monkeypatch) -> None:
    plain = [(1.0, 0.0)]
    for size, looks in ((8000, 9), (8001, 3)):
        system, asked = model(monkeypatch, plain, size=size)
        assert stretches.stretches(system, 0.0, 0.8) == (Stretch(0.0, 0.8, None, 1, 1),)
        assert [mu for mu, _ in asked] == [None, *np.linspace(0, 0.8, looks)]
    system, asked = model(monkeypatch, plain, size=8001)
    stretches.stretches(system, 0.0, 0.8, at=[0.35, 0.3, 0.4])
    assert sorted(mu for mu, _ in asked[1:]) == [0.0, 0.3, 0.35, 0.4, 0.8]
    for count, looks in ((9, 3 + 9), (10, 3)):
        system, asked = model(monkeypatch, plain, size=8001)
        stretches.stretches(system, 0.0, 0.8, at=0.01 + 0.05 * np.arange(count))
        assert len(asked) - 1 == looks


def test_where_there_is_no_steady_sliding_it_is_said_from_where_on(monkeypatch) -> None:
    system, _ = model(monkeypatch, [(1.0, 0.0)], none_beyond=0.5)
    found = stretches.stretches(system, 0.0, 0.9)
    assert [s.reason.partition(";")[0] for s in found] == ["", "it tips over"]
    assert float(found[1].reason.rpartition(" = ")[2]) == pytest.approx(found[1].at, rel=1e-5)
    # The last μ looked at that has an equilibrium ends what can be solved.
    assert found[0].high == found[1].low == pytest.approx(0.5, abs=1e-3)
    assert found[0].high <= 0.5 < found[1].at
    assert (found[1].touching, found[1].at) == (0, found[1].at)
    assert found[1].at is not None


def test_nothing_is_looked_at_where_nothing_can_change(monkeypatch) -> None:
    whole = (Stretch(0.1, 0.5, None),)
    for changes in ({"loads": {}}, {"load_steps": (1,)}, {"contact_nodes": lambda: SimpleNamespace(count=0)}):
        system, asked = model(monkeypatch, LINES)
        vars(system).update(changes)
        assert stretches.stretches(system, 0.1, 0.5) == whole
        assert asked == []


def test_contacts_kept_closed_are_looked_at_as_they_may_turn_from_pushing_to_pulling(monkeypatch) -> None:
    system, asked = model(monkeypatch, LINES)
    vars(system).update(contact_nodes=lambda: SimpleNamespace(count=4, kept=np.ones(4, dtype=bool)))
    assert len(stretches.stretches(system, 0.1, 0.5)) > 1
    assert asked


def test_a_distance_alone_presses_as_a_load_does(monkeypatch) -> None:
    system, _ = model(monkeypatch, LINES)
    by_load = stretches.stretches(system, 0.0, 0.9)
    system, _ = model(monkeypatch, LINES)
    vars(system).update(loads={}, motion=AWAY)
    assert stretches.stretches(system, 0.0, 0.9) == by_load
    assert len(by_load) == 4
    system, _ = model(monkeypatch, LINES, own=0.9, none_beyond=0.5)
    vars(system).update(loads={}, motion=AWAY)
    assert stretches.instead_of_own(system, 0.0, 0.4) == pytest.approx(0.2)


def test_own_friction_without_steady_sliding_says_nothing_of_others(monkeypatch) -> None:
    system, _ = model(monkeypatch, LINES, own=0.9, none_beyond=0.5)
    found = stretches.stretches(system, 0.0, 0.4)
    assert [(s.high, s.touching, s.reason) for s in found] == [
        (pytest.approx(0.31, abs=1e-9), 3, ""), (pytest.approx(0.33, abs=1e-9), 2, ""), (0.4, 3, ""),
    ]  # fmt: skip
    assert all(s.at is not None and s.low <= s.at <= s.high for s in found)
    assert stretches.instead_of_own(system, 0.0, 0.4) == pytest.approx(0.2)
    assert stretches.instead_of_own(system, 0.3, 0.8) == 0.3
    assert stretches.instead_of_own(system, 0.6, 0.8) is None
    # Where there is none at the low end either, no more is looked at.
    system, asked = model(monkeypatch, LINES, none_beyond=-1.0)
    assert stretches.stretches(system, 0.1, 0.5) == (Stretch(0.1, 0.5, None, 0, 4, "it tips over; that is at μ = 0.1"),)
    assert len(asked) == 2
    assert stretches.instead_of_own(model(monkeypatch, LINES)[0], 0.0, 0.4) is None


def test_many_changes_are_taken_in_equal_parts(monkeypatch) -> None:
    for count, equal in ((40, False), (41, True)):
        ends = np.linspace(0.021, 0.879, count)
        system, _ = model(monkeypatch, [(1.0, 0.0), *[(1.0, -1 / end) for end in ends]], own=-1.0)
        found = stretches.stretches(system, 0.0, 0.9)
        if not equal:
            continue
        assert len(found) == 12
        assert [s.low for s in found] == pytest.approx(0.075 * np.arange(12))
        for s in found:
            assert s.at == pytest.approx(0.5 * (s.low + s.high))
            counts = [1 + int(np.sum(ends > mu)) for mu in (s.low, s.at, s.high)]
            assert s.touching == counts[1]
            assert s.others == max(counts[0] - counts[1], counts[1] - counts[2])
            assert s.nodes == 42


def test_a_contact_kept_closed_that_pulls_is_another_stretch(monkeypatch) -> None:
    system, _ = model(monkeypatch, [(1.0, 0.0), (1.0, -2.5)], kept=(1,))
    found = stretches.stretches(system, 0.0, 0.9)
    assert [s.low for s in found] == pytest.approx([0.0, 0.4], abs=1e-9)
    assert [s.touching for s in found] == [2, 2]


def test_looks_differ_by_the_nodes_of_one_alone() -> None:
    one, two = (_Look(mu, b"", line_of(LINES, mu)) for mu in (0.1, 0.9))
    assert _different(one, two) == 3
    assert _different(one, one) == _different(one, _Look(1.0, None, None)) == _different(_Look(1.0, None, None), one) == 0


def test_probes_lie_within_on_both_sides_of_what_is_foreseen() -> None:
    assert list(_probes(0.2, 0.6, None, None)) == pytest.approx([0.4])
    assert list(_probes(0.2, 0.6, 0.5, None)) == pytest.approx([0.48, 0.52])
    assert list(_probes(0.2, 0.6, 0.5, 0.501)) == pytest.approx([0.496, 0.504])
    assert list(_probes(0.2, 0.6, 0.5, 0.3)) == pytest.approx([0.42, 0.58])  # at most a fifth of the way
    assert list(_probes(0.2, 0.6, 0.5, 0.5)) == pytest.approx([0.5 - 1.5e-10, 0.5 + 1.5e-10], abs=1e-13)
    assert list(_probes(0.2, 0.6, 0.205, None)) == pytest.approx([0.22, 0.225])
    assert list(_probes(0.2, 0.6, 0.595, None)) == pytest.approx([0.575, 0.58])
    assert list(_probes(0.2, 0.6, 0.598, 0.597)) == pytest.approx([0.592, 0.596])
    rng = np.random.default_rng(2)
    for _ in range(200):
        low, span = rng.random(), 10.0 ** rng.uniform(-8, 0)
        foreseen = low + span * rng.random()
        for mu in _probes(low, low + span, foreseen, rng.choice([None, foreseen + span * rng.normal()])):
            assert low < mu < low + span


def test_what_runs_out_is_foreseen_from_the_side_that_knows(monkeypatch) -> None:
    system, _ = model(monkeypatch, LINES)
    search = _Equilibria(system, None)
    looks = [search.at(mu) for mu in (0.0, 0.1, 0.5, 0.6)]
    assert search._foreseen(looks[1], looks[2]) == pytest.approx(0.31)  # the first of three lines from below
    alone = _Equilibria(system, None)
    assert alone._foreseen(alone.at(0.1), alone.at(0.5)) is None
    above = _Equilibria(system, None)
    looks = [above.at(mu) for mu in (0.1, 0.5, 0.6)]
    assert above._foreseen(looks[0], looks[1]) == pytest.approx(0.33)  # and the last from above


def test_stretches_in_words() -> None:
    words, elsewhere = stretches.stretch_words, stretches.elsewhere_words
    one, two = Stretch(0.0, 0.31, None, 6, 8), Stretch(0.31, 0.5, 0.4, 5, 8)
    none = Stretch(0.5, 0.9, 0.7, 0, 8, "it tips over")
    assert words((one,)) == words((Stretch(0.0, 0.9, None),)) == elsewhere((one,)) == ()
    assert words((one, two)) == (
        "Of the 8 contact nodes other ones touch in steady sliding as friction grows: 6 between μ = 0 and 0.31, 5 between "
        "μ = 0.31 and 0.5. Each μ is solved with those of its stretch; modes keep their numbers from one to the next, "
        "where a single μ numbers its own.",
    )
    assert words((one, none)) == ("Between μ = 0.5 and 0.9 nothing was solved: it tips over.",)
    assert words((none,)) == ("Between μ = 0.5 and 0.9 nothing was solved: it tips over.",)
    assert len(words((one, two, none))) == 2
    parts = (replace(one, others=3), replace(two, others=4))
    assert words(parts) == (
        "More than 40 of the 8 contact nodes open or close between μ = 0 and 0.5: in each of 2 equal stretches of μ those "
        "touch that do so in its middle, and up to 4 are others at its ends. Modes there are other ones: ask for one μ, or "
        "a smaller range.",
    )
    assert elsewhere((one, two, none)) == (
        "The 6 of 8 contact nodes that touch at the case's own friction are held at every μ of the model; steady sliding "
        "has others at μ = 0.31 to 0.5 (5 touch), 0.5 to 0.9 (no steady sliding). Modes there are other ones: `stridor "
        "modes` and `stridor onsets` have them.",
    )
    assert "others at μ = 0.5 to 0.9 (no steady sliding). Modes" in elsewhere((none,))[0]
    assert elsewhere((two,))[0].startswith("The nodes that touch at the case's own friction are held")


@pytest.mark.parametrize(("said", "wanted"), [
    ("no contact carries load at μ = 0 (contacts: A)", "no contact carries load at μ = 0 (contacts: A)"),
    ("it tips over at μ = 0.1; hold it", "it tips over at μ = 0.1; hold it; that is at μ = 0"),
    ("it tips over", "it tips over; that is at μ = 0"),
])  # fmt: skip
def test_the_friction_of_a_message_is_told_once(said: str, wanted: str) -> None:
    assert placed(AnalysisError(said), 0.0) == wanted

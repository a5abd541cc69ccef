"""Static equilibrium with stick and partial slip: load steps in increments, with Coulomb's law in each.

With s_i = T_i u the tangential position of a contact node and Δs_i what it has moved within the increment,

    K u − Σ (Nᵀ p + Tᵀ r) = f,    g₀ + N u + c p = 0, p ≥ 0,
    stick: Δs = 0, |r| ≤ μ_s p,    slip: r = −μ p Δs/|Δs| .

Nothing is regularised: a node that sticks is a constraint whose force is an unknown, and where it stands is carried
over the increments. In both states what a node adds are rows like those of normal contact, so that `Equilibrium` solves
for them all. A node that slips in space along e has, beside friction μ p e, Newton's term of the turn of its direction,
r⊥ = −(μ p/|Δs|) Δs⊥, which is a row across e with the compliance |Δs|/μp.

Motions that run until everything slides give their nodes the direction of friction; such nodes slip whatever happens.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from ..contact.multipliers import OPEN, SLIP, STICK
from ..contact.nodes import ContactNodes
from ..direct import SingularMatrix
from ..errors import AnalysisError
from ..system import System
from ..system.load_steps import LoadStep
from ..typing import Array, BoolArray, IntArray, Sparse
from .equilibrium import ContactRows, Equilibrium, NodeEquilibrium

LIMIT = 120  # sets of nodes tried in one increment
ROUNDING = 1e-11  # of the largest force or way: what does not count as a violation
ROTATION = 1e-9  # of the largest force: by how much directions of slip may still change it


@dataclass(frozen=True)
class Frictional:
    """Contact at the end of an increment, m nodes with t tangential directions.

    displacement (n,) [m], normal_force (m,) [N], friction (m, t) [N] on the slave, status (m,) OPEN, STICK or SLIP,
    direction (m, t): of the friction on nodes that slip. position (m, t) [m]: where nodes stand along their tangents;
    gap (m,) [m]; travel (p,) [s]: how far the prescribed motions have run, in units of their velocities.
    """

    displacement: Array
    normal_force: Array
    friction: Array
    status: IntArray
    direction: Array
    position: Array
    gap: Array
    travel: Array


@dataclass(frozen=True)
class Loading:
    """One increment: force (n,) [N], travel (p,) [s] of the motions at its end; driven (m, t): the direction against
    the slip of nodes that a motion keeps sliding, zero for all others; mu and sticking (m,), the friction coefficients
    of slip and at which sticking ends."""

    force: Array
    travel: Array
    driven: Array
    mu: Array
    sticking: Array


class StickRows:
    """Rows (q, n) csr that hold contact nodes where they are along their tangents, node (q,) of each, direction (q, t).

    Directions in which supports hold a node already, or its own rigid normal contact does, have no row: nothing would
    tell its force.
    """

    def __init__(self, nodes: ContactNodes) -> None:
        m, t = nodes.count, nodes.directions
        tangent, normal = sp.csr_array(nodes.tangent), sp.csr_array(nodes.normal)
        parts = [sp.csr_array(tangent[k::t]) for k in range(t)]
        gram = np.array([[_products(a, b) for b in parts] for a in parts]).reshape(t, t, m).transpose(2, 0, 1)
        length = _products(normal, normal)
        size = np.maximum(np.trace(gram, axis1=1, axis2=2) / t, length)
        across = np.array([_products(a, normal) for a in parts]).reshape(t, m).T
        rigid = (nodes.compliance == 0.0) & (length > 0)
        shared = np.where(rigid[:, None, None], across[:, :, None] * across[:, None, :], 0.0)
        values, vectors = np.linalg.eigh(gram - shared / np.where(length > 0, length, 1.0)[:, None, None])
        self.node, which = np.nonzero(values > 1e-12 * size[:, None])
        self.direction: Array = vectors[self.node, :, which]
        self.rows = _combined(tangent, self.node, self.direction)
        self._normal, self._rigid = normal, rigid
        self._groups = self._shared(nodes.normals.shape[1])

    def held(self, touching: BoolArray, stuck: BoolArray) -> BoolArray:
        """Which rows (q,) hold the nodes stuck (m,), where touching (m,) press: those that nothing else does.

        A node on two surfaces may stick to one in a direction in which it presses rigidly on the other.
        """
        kept = stuck[self.node]
        for normals, rows in self._groups:
            basis: list[Array] = []
            for row in self._normal[normals[touching[normals] & self._rigid[normals]]].toarray():
                _independent(basis, row)
            for r in rows[kept[rows]]:
                kept[r] = _independent(basis, self.rows[[r]].toarray()[0])
        return kept

    def _shared(self, dimension: int) -> list[tuple[IntArray, IntArray]]:
        """Nodes and rows on freedoms of one place alone (the other side is rigid) that more than one node is at."""
        whole = sp.csr_array(sp.vstack([self._normal, self.rows]))
        count = np.diff(whole.indptr)
        small = np.flatnonzero((count > 0) & (count <= dimension))
        incidence = sp.csr_array(abs(whole[small]))
        _, label = sp.csgraph.connected_components(incidence @ incidence.T, directed=False)
        m = self._normal.shape[0]
        owner = np.where(small < m, small, self.node[np.maximum(small - m, 0)] if len(self.node) else 0)
        found: list[tuple[IntArray, IntArray]] = []
        order = np.argsort(label, kind="stable")
        for part in np.split(order, np.flatnonzero(np.diff(label[order])) + 1):
            if len(part) and len(np.unique(owner[part])) > 1:
                chosen = small[part]
                found.append((chosen[chosen < m], chosen[chosen >= m] - m))
        return found


def _products(a: Sparse, b: Sparse) -> Array:
    return np.asarray(a.multiply(b).sum(axis=1)).ravel()


def _independent(basis: list[Array], row: Array) -> bool:
    """Take a row into an orthonormal basis; whether it added anything."""
    rest = row.copy()
    for known in basis:
        rest -= (known @ rest) * known
    size = float(np.linalg.norm(rest))
    if size <= 1e-8 * float(np.linalg.norm(row)):
        return False
    basis.append(rest / size)
    return True


def _combined(tangent: Sparse, node: IntArray, direction: Array) -> Sparse:
    """Rows (q, n) of the tangents of node (q,) along direction (q, t)."""
    q, t = direction.shape
    row = np.repeat(np.arange(q), t)
    column = (node[:, None] * t + np.arange(t)).ravel()
    pick = sp.csr_array((direction.ravel(), (row, column)), shape=(q, tangent.shape[0]))
    return sp.csr_array(pick @ tangent)


def increments_of(steps: tuple[LoadStep, ...], names: tuple[str, ...]) -> list[tuple[int, dict[str, float], float]]:
    """For every increment the step's number, factors of the loads, and seconds that the motions run in it."""
    before = dict.fromkeys(names, 0.0)
    found: list[tuple[int, dict[str, float], float]] = []
    for number, step in enumerate(steps):
        after = {name: step.loads.get(name, before[name]) for name in names}
        for k in range(1, step.increments + 1):
            part = k / step.increments
            factors = {name: before[name] + part * (after[name] - before[name]) for name in names}
            found.append((number, factors, (step.duration or 0.0) / step.increments))
        before = after
    return found


class StickSlip:
    """Increments of a system's contact with friction, one after the other. solved counts equilibria."""

    def __init__(self, system: System, *, solver: str | None) -> None:
        self.system, self.solver = system, solver
        self.nodes = nodes = system.contact_nodes()
        self.sticks = StickRows(nodes)
        self.movable: BoolArray = np.diff(nodes.normal.indptr) > 0
        self.solved = 0

    def start(self) -> Frictional:
        """Before the first increment: no force anywhere; what can touch does."""
        nodes, n = self.nodes, self.system.size
        m, t = nodes.count, nodes.directions
        return Frictional(
            displacement=np.zeros(n),
            normal_force=np.zeros(m),
            friction=np.zeros((m, t)),
            status=np.where(self.movable, STICK, OPEN),
            direction=np.zeros((m, t)),
            position=np.zeros((m, t)),
            gap=nodes.gap.copy(),
            travel=np.zeros(len(self.system.motion.names)),
        )

    def increment(self, before: Frictional, load: Loading) -> tuple[Frictional, float]:
        """The state at the end of an increment, and its residual over the largest force.

        Raises SingularMatrix where nothing holds the structure, AnalysisError where the set of nodes does not settle.
        """
        status, direction = self._first_guess(before, load)
        across = np.zeros(self.nodes.count)
        seen: set[bytes] = set()
        care, stuck_again = 0, False
        last: tuple[Frictional, _Change] | None = None
        for _ in range(LIMIT):
            try:
                state, residual = self._solve(before, load, status, direction, across)
            except SingularMatrix:
                if last is None and not stuck_again:
                    # Friction at its limit everywhere holds nothing; less of it may.
                    stuck_again = True
                    status = np.where((status == SLIP) & ~_driven(load), STICK, status)
                    continue
                if last is None or care >= 3:
                    raise
                care += 1
                status, direction = last[1].applied(last[0], care)
                continue
            change = self._violations(before, load, state)
            if not change.any:
                rotation, direction, across = self._turn(before, load, state)
                if rotation <= ROTATION:
                    return state, residual
                continue
            last = (state, change)
            seen.add(_key(status, direction))
            _, turning, across = self._turn(before, load, state)
            state = replace(state, direction=turning)
            status, direction = change.applied(state, care)
            if _key(status, direction) in seen:
                care, seen = min(care + 1, 3), set()
                status, direction = change.applied(state, care)
        raise AnalysisError(
            f"stick and slip do not settle in {LIMIT} steps; take more increments, lower the friction coefficient, or "
            "give the contact a finite stiffness"
        )

    def _first_guess(self, before: Frictional, load: Loading) -> tuple[IntArray, Array]:
        """Every node as it was; those that a motion keeps sliding slip, those that it has let go of stick first."""
        driven = _driven(load)
        status = np.where(driven & (before.status != OPEN), SLIP, before.status)
        direction = np.where(driven[:, None], load.driven, before.direction)
        return status, direction

    def _solve(
        self, before: Frictional, load: Loading, status: IntArray, direction: Array, across: Array
    ) -> tuple[Frictional, float]:
        """The equilibrium with exactly these states, whichever the violations. across (m,) [m/N]: compliance of the
        turn of slip in space."""
        nodes, (m, t) = self.nodes, direction.shape
        slips = status == SLIP
        rubbing = np.where(slips[:, None], load.mu[:, None] * direction, 0.0)
        moved = (nodes.tangent_lift @ load.travel).reshape(m, t) - before.position
        sticks = self.sticks
        held = sticks.held(status != OPEN, status == STICK)
        turning = np.flatnonzero(slips & ~_driven(load)) if t == 2 else np.zeros(0, dtype=np.int64)
        sideways = np.stack([-direction[turning, 1], direction[turning, 0]], axis=1) if t == 2 else direction[:0]
        node = np.concatenate([sticks.node[held], turning])
        along = np.concatenate([sticks.direction[held], sideways])
        extra = sp.vstack([sticks.rows[held], _combined(nodes.tangent, turning, sideways)], format="csr")
        push = sp.csr_array(nodes.normal + nodes.along(rubbing))
        q = len(node)
        rows = ContactRows(
            normal=sp.csr_array(sp.vstack([nodes.normal, extra])),
            gap=np.concatenate([nodes.gap + nodes.normal_lift @ load.travel, np.sum(along * moved[node], axis=1)]),
            compliance=np.concatenate([nodes.compliance, np.zeros(int(held.sum())), across[turning]]),
            cubic=np.concatenate([nodes.cubic, np.zeros(q)]),
            kept=np.zeros(nodes.count + q, dtype=bool),
        )
        whole = sp.csr_array(sp.vstack([push, extra]))
        equilibrium = Equilibrium(
            self.system,
            rows,
            whole,
            load.force,
            symmetric=not np.any(rubbing) and self.system.symmetric_definite,
            solver=self.solver,
            travel=load.travel,
        )
        state = equilibrium.solve(np.concatenate([status != OPEN, np.ones(q, dtype=bool)]), before.displacement)
        self.solved += equilibrium.solved
        return self._found(load, status, direction, state, node, along), equilibrium.residual(state)

    def _found(
        self, load: Loading, status: IntArray, direction: Array, state: NodeEquilibrium, node: IntArray, along: Array
    ) -> Frictional:
        nodes, (m, t) = self.nodes, direction.shape
        normal = np.where(status != OPEN, state.normal_force[:m], 0.0)
        friction = np.where((status == SLIP)[:, None], (load.mu * normal)[:, None] * direction, 0.0)
        np.add.at(friction, node, state.normal_force[m:, None] * along)
        return Frictional(
            displacement=state.displacement,
            normal_force=normal,
            friction=friction,
            status=status,
            direction=direction,
            position=(nodes.tangent @ state.displacement + nodes.tangent_lift @ load.travel).reshape(m, t),
            gap=state.gap[:m],
            travel=load.travel,
        )

    def _violations(self, before: Frictional, load: Loading, state: Frictional) -> _Change:
        """What of the state contradicts its assumptions beyond rounding."""
        normal, size = state.normal_force, np.linalg.norm(state.friction, axis=1)
        force = max(float(np.abs(load.force).max(initial=0.0)), float(np.abs(normal).max(initial=0.0)))
        way = float(np.abs(state.position).max(initial=0.0) + np.abs(before.position).max(initial=0.0))
        gap = float(np.abs(state.gap).max(initial=0.0))
        status, driven = state.status, _driven(load)
        pulled = (status != OPEN) & (normal < -ROUNDING * force)
        closing = (status == OPEN) & self.movable & (state.gap < -ROUNDING * gap)
        beyond = size - load.sticking * np.maximum(normal, 0.0)
        loose = (status == STICK) & ~pulled & (beyond > ROUNDING * force)
        slip = state.position - before.position
        back = np.sum(slip * state.direction, axis=1)
        backward = (status == SLIP) & ~driven & ~pulled & (back > ROUNDING * way)
        target = status.copy()
        target[pulled] = OPEN
        # A node that would close sticks or slips as equal springs along normal and tangents would have it.
        length = np.linalg.norm(slip, axis=1)
        skids = driven | (length > load.sticking * np.abs(state.gap))
        target[closing] = np.where(skids[closing], SLIP, STICK)
        target[loose] = SLIP
        target[backward] = STICK
        severity = np.zeros(len(status))
        severity[pulled] = -normal[pulled] / max(force, 1e-300)
        severity[closing] = -state.gap[closing] / max(gap, 1e-300)
        severity[loose] = beyond[loose] / max(force, 1e-300)
        severity[backward] = back[backward] / max(way, 1e-300)
        direction = state.direction.copy()
        direction[loose] = state.friction[loose] / np.maximum(size[loose], 1e-300)[:, None]
        skids &= closing
        direction[skids] = -slip[skids] / np.maximum(length[skids], 1e-300)[:, None]
        direction[driven] = load.driven[driven]
        return _Change(target, direction, severity, pulled | closing)

    def _turn(self, before: Frictional, load: Loading, state: Frictional) -> tuple[float, Array, Array]:
        """By how much the directions of slip in space miss those of friction, over the largest force; better ones, and
        the compliance (m,) of their turn."""
        across = np.zeros(self.nodes.count)
        if self.nodes.directions == 1:
            return 0.0, state.direction, across
        slip = state.position - before.position
        length = np.linalg.norm(slip, axis=1)
        limit = load.mu * np.maximum(state.normal_force, 0.0)
        way = float(np.abs(state.position).max(initial=0.0) + np.abs(before.position).max(initial=0.0))
        slips = (state.status == SLIP) & ~_driven(load) & (limit > 0)
        mine = slips & (length > ROUNDING * way)
        direction = state.direction.copy()
        direction[mine] = -slip[mine] / length[mine][:, None]
        across[mine] = length[mine] / limit[mine]
        # Held across the old direction a node does not move, and the force that holds it says where it would go.
        still = slips & ~mine
        size = np.linalg.norm(state.friction[still], axis=1)
        direction[still] = state.friction[still] / np.maximum(size, 1e-300)[:, None]
        missed = np.linalg.norm(state.friction[slips] - limit[slips][:, None] * direction[slips], axis=1)
        return float(missed.max(initial=0.0)) / max(float(limit.max(initial=0.0)), 1e-300), direction, across


@dataclass(frozen=True)
class _Change:
    """Where nodes (m,) should go: target status and direction of friction, how badly, and whether by normal contact."""

    target: IntArray
    direction: Array
    severity: Array
    by_normal: BoolArray

    @property
    def any(self) -> bool:
        return bool(np.any(self.severity > 0.0))

    def applied(self, state: Frictional, care: int) -> tuple[IntArray, Array]:
        """Status and directions with the changes, the fewer the more care is taken."""
        chosen = np.flatnonzero(self.severity > 0.0)
        if care >= 1 and np.any(self.by_normal[chosen]):
            chosen = chosen[self.by_normal[chosen]]
        if care == 2:
            chosen = chosen[np.argsort(-self.severity[chosen], kind="stable")][: (len(chosen) + 1) // 2]
        if care >= 3:
            chosen = chosen[:1]
        status, direction = state.status.copy(), state.direction.copy()
        status[chosen], direction[chosen] = self.target[chosen], self.direction[chosen]
        return status, direction


def _driven(load: Loading) -> BoolArray:
    return np.any(load.driven != 0.0, axis=1)


def _key(status: IntArray, direction: Array) -> bytes:
    """What tells two sets of nodes apart: status, and on a line the sense of slip."""
    sense = np.sign(direction[:, 0]) * (status == SLIP) if direction.shape[1] == 1 else np.zeros(len(status))
    return status.tobytes() + sense.astype(np.int8).tobytes()

"""The equations of steady sliding for a given set of touching nodes, and their solution."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
from typing import Any

import numpy as np
import scipy.sparse as sp

from .. import direct
from ..contact.nodes import ContactNodes
from ..direct.backends import choose
from ..errors import AnalysisError
from ..system import System
from ..typing import Array, BoolArray, IntArray, Sparse
from .prepared import Preparing
from .small import Small

# Contact springs stiffer than this, relative to the structure, would drown it in rounding if added to its matrix.
CONDENSED = 1e3
NEWTON_STEPS = 60
FEW = 8  # nodes of which all sets are tried, where the search among them does not settle
NEARBY = "factors nearby"  # the question of `System.of_matrices` whose answer is a `direct.Nearby`
BALANCED = 1e-14  # of the largest force: what an equilibrium by prepared factors may leave
# What was asked, and the answer.
_Open = tuple[tuple[bytes, int, str | None], tuple[Array, Array] | direct.SingularMatrix]


@dataclass(frozen=True)
class ContactRows:
    """What contact holds: rows normal (m, n) csr, gap (m,) [m], compliance (m,) [m/N], cubic (m,) [N/m³] and kept (m,)
    as `ContactNodes` has them."""

    normal: Sparse
    gap: Array
    compliance: Array
    cubic: Array
    kept: BoolArray

    @property
    def count(self) -> int:
        """Number of rows m."""
        return len(self.gap)


@dataclass(frozen=True)
class NodeEquilibrium:
    """Displacement (n,) [m], normal force (m,) [N] and gap (m,) [m] for one set of touching nodes; residual: that of
    `Equilibrium.residual` where it is known."""

    active: BoolArray
    displacement: Array
    normal_force: Array
    gap: Array
    residual: float | None = None


class NoConvergence(AnalysisError):
    """Newton's method on springs beyond the linear does not settle for a set of touching nodes."""


class Equilibrium:
    """K u + cubic(u) − Pᵀ N = f,  g₀ + n u + c N = 0 on the touching nodes, with P = n + μ s·t.

    Touching nodes of finite stiffness go into K; rigid and nearly rigid ones become unknown multipliers. travel (p,)
    [s]: how far the prescribed motions have run, which springs beyond the linear feel. rubbing (m, d−1): μ s, where P
    has nothing else beside n; many equilibria that differ in it and in who touches then share one factorisation.
    """

    def __init__(
        self,
        system: System,
        nodes: ContactNodes | ContactRows,
        push: Sparse,
        force: Array,
        *,
        symmetric: bool,
        solver: str | None,
        travel: Array | None = None,
        rubbing: Array | None = None,
    ) -> None:
        self.system, self.nodes, self.push, self.force = system, nodes, push, force
        self.rubbing = rubbing
        self.symmetric, self.solver = symmetric, solver
        self.scale = float(np.abs(system.stiffness.data).max(initial=0.0)) or 1.0
        # Of Newton's step: contact with a cubic term has another compliance, and meets its force from another gap.
        self.compliance, self.gap = nodes.compliance, nodes.gap
        with np.errstate(over="ignore"):  # a contact as good as without stiffness: infinite is more than one
            self.condensed: BoolArray = nodes.compliance * self.scale * CONDENSED > 1.0
        self.solved = 0
        cubic = system.cubic
        self.stretched: Array | float = 0.0 if cubic is None else cubic.stretch
        if cubic is not None and travel is not None:
            self.stretched = self.stretched + cubic.rows.lift @ travel

    @cached_property
    def _small(self) -> Small | None:
        # The solver asked for must be one where it is not needed, too; SLEPc's processes take part in all that it does.
        if choose(self.solver) == "slepc":
            return None
        return Small.of(self.system, self.nodes.normal, self.push)

    @property
    def _rows(self) -> Any:
        return self.nodes.normal if self._small is None else self._small.normal

    def solve(self, active: BoolArray, start: Array | None = None) -> NodeEquilibrium:
        """The equilibrium with exactly these nodes touching, whichever the signs of gap and force.

        start (n,): where Newton's method begins for springs beyond the linear. Raises direct.SingularMatrix where the
        structure can move, NoConvergence where Newton's method does not converge.
        """
        u = np.zeros(self.system.size) if start is None else start
        nodes, cubic = self.nodes, self.system.cubic
        springs = cubic is not None and bool(cubic.coefficient.size)
        if not springs and not np.any(nodes.cubic):
            if (found := self._by_prepared(active)) is not None:
                return found
            u, normal = self._linear(active, None, None) if np.any(active) else self._open()
            return NodeEquilibrium(active, u, normal, nodes.gap + self._rows @ u)
        for _ in range(NEWTON_STEPS):
            before = u
            tangent, extra = self._springs(before)
            self._contacts(before)
            u, normal = self._linear(active, tangent, extra)
            if self._converged(before, u, active):
                return NodeEquilibrium(active, u, normal, nodes.gap + self._rows @ u)
        if start is not None:
            return self.solve(active)  # from where nothing is strained
        softens = springs and cubic is not None and bool(np.any(cubic.coefficient < 0.0))
        hint = "check their coefficients (softening springs may have none)" if softens else (
            "take smaller loads or a lower friction coefficient"
        )
        raise NoConvergence(
            f"steady sliding: the springs beyond the linear find no equilibrium in {NEWTON_STEPS} steps; {hint}"
        )

    def _open(self) -> tuple[Array, Array]:
        """Displacement and forces where no node touches, which are the same at every friction: the last is kept, also
        that nothing holds the structure then."""
        last = self.system.of_matrices.once("where none touches", dict[str, _Open])
        asked, known = (self.force.tobytes(), self.nodes.count, self.solver), last.get("")
        if known is None or known[0] != asked:
            try:
                known = asked, self._linear(np.zeros(self.nodes.count, dtype=bool), None, None)
            except direct.SingularMatrix as error:
                known = asked, error.with_traceback(None)
            last[""] = known  # in one step, as several threads may ask
        if isinstance(known[1], direct.SingularMatrix):
            raise direct.SingularMatrix(str(known[1]), known[1].motion)
        return known[1]

    def _by_prepared(self, active: BoolArray) -> NodeEquilibrium | None:
        """The equilibrium by the factors that many share; None where there are none, or not as good as its own."""
        nodes, shared = self.nodes, self.system.of_matrices
        if self.rubbing is None or not isinstance(nodes, ContactNodes):
            return None
        preparing = shared.once("equilibria prepared", Preparing)
        try:
            found = preparing.at(self.system, nodes, self.force, active, self.rubbing, self.solver)
        except direct.SingularMatrix:
            return None
        if found is None:
            return None
        u, normal = found
        state = NodeEquilibrium(active, u, normal, nodes.gap + nodes.normal @ u)
        residual = self.residual(state)
        if not residual <= BALANCED:
            return None
        shared.once(NEARBY, direct.Nearby).free()
        self.solved += 1
        return replace(state, residual=residual)

    def _springs(self, u: Array) -> tuple[Sparse | Array | None, Array | None]:
        """Tangent (n, n) of the cubic springs at u, dense where unknowns are few, and the force (n,) that it misses;
        None where there are none."""
        cubic = self.system.cubic
        if cubic is None or not cubic.coefficient.size:
            return None, None
        rows: Any = cubic.rows.free if self._small is None else self._small.springs
        own = rows @ u
        stretch = own + self.stretched
        weight = 3 * cubic.coefficient * stretch**2
        missed = rows.T @ (cubic.coefficient * stretch**2 * (3 * own - stretch))
        if self._small is not None:
            return rows.T @ (weight[:, None] * rows), missed
        return sp.csr_array(rows.T @ sp.diags_array(weight) @ rows), missed

    def _contacts(self, u: Array) -> None:
        """Compliance and gap of the tangent to p = kδ + k₃δ³ at the approach δ that u has."""
        nodes = self.nodes
        hardens = np.flatnonzero(nodes.cubic > 0)
        if not len(hardens):
            return
        stiffness, factor = 1.0 / nodes.compliance[hardens], nodes.cubic[hardens]
        approach = -(nodes.gap[hardens] + self._rows[hardens] @ u)
        approach = np.where(nodes.kept[hardens], approach, np.maximum(approach, 0.0))
        tangent = stiffness + 3 * factor * approach**2
        self.compliance, self.gap = nodes.compliance.copy(), nodes.gap.copy()
        self.compliance[hardens] = 1.0 / tangent
        self.gap[hardens] += approach - (stiffness * approach + factor * approach**3) / tangent
        self.condensed = self.compliance * self.scale * CONDENSED > 1.0

    def _converged(self, before: Array, u: Array, active: BoolArray) -> bool:
        """Whether the ways of everything beyond the linear have stopped changing."""
        cubic, nodes, small = self.system.cubic, self.nodes, self._small
        hardens = active & (nodes.cubic > 0)
        springs: Any = None if cubic is None else cubic.rows.free if small is None else small.springs
        parts = [] if springs is None else [springs]
        if hardens.any():
            parts.append(self._rows[np.flatnonzero(hardens)])
        if not parts:
            return True
        rows: Any = sp.csr_array(sp.vstack(parts)) if small is None else np.vstack(parts)
        moved, size = float(np.abs(rows @ (u - before)).max(initial=0.0)), float(np.abs(rows @ u).max(initial=0.0))
        return moved <= 1e-12 * size

    def residual(self, state: NodeEquilibrium) -> float:
        """Largest imbalance of a freedom over the largest force that takes part."""
        if state.residual is not None:
            return state.residual
        u, normal = state.displacement, state.normal_force
        internal = self.system.stiffness @ u
        terms = abs(self.system.stiffness) @ np.abs(u) + np.abs(self.force) + abs(self.push).T @ np.abs(normal)
        if self.system.cubic is not None:
            cubic = self.system.cubic
            internal = internal + cubic.rows.free.T @ (cubic.coefficient * (cubic.rows.free @ u + self.stretched) ** 3)
        imbalance = internal - self.force - self.push.T @ normal
        return float(np.abs(imbalance).max(initial=0.0) / max(float(terms.max(initial=0.0)), 1e-300))

    def _linear(
        self, active: BoolArray, tangent: Sparse | Array | None, extra: Array | None
    ) -> tuple[Array, Array]:
        nodes, n = self.nodes, self.system.size
        springs, rigid = np.flatnonzero(active & self.condensed), np.flatnonzero(~self.condensed)
        right = self.force if extra is None else self.force + extra
        spring = 1.0 / self.compliance[springs]
        # Multipliers are scaled to the stiffness so that the bordered matrix is well balanced. Those of open nodes are
        # kept at zero, so that matrices of other touching nodes have the same unknowns.
        s, held = self.scale, active[rigid].astype(float)
        softness = np.where(active[rigid], -self.compliance[rigid] * s * s, -s)
        self.solved += 1
        answer = None
        if self._small is not None:
            answer = self._small.answer(tangent, right, (springs, spring), (rigid, held, softness), s, self.gap)
        if answer is None:
            answer = self._by_sparse(active, tangent, right, (springs, spring), (rigid, held, softness))
        normal = np.zeros(nodes.count)
        normal[rigid] = answer[n:] * s
        if len(springs):
            normal[springs] = -(self.gap[springs] + self._rows[springs] @ answer[:n]) * spring
        return answer[:n], normal

    def _by_sparse(
        self, active: BoolArray, tangent: Sparse | Array | None, right: Array, springs: tuple[IntArray, Array],
        rigid: tuple[IntArray, Array, Array],
    ) -> Array:  # fmt: skip
        """What `Small.answer` gives, by a sparse solver. Raises direct.SingularMatrix."""
        nodes, s, (at, spring), (bordering, held, softness) = self.nodes, self.scale, springs, rigid
        stiffness = self.system.stiffness if tangent is None else self.system.stiffness + sp.csr_array(tangent)
        if len(at):
            pushing = sp.csr_array(self.push[at].T @ sp.diags_array(spring))
            stiffness = stiffness + pushing @ nodes.normal[at]
            right = right - pushing @ self.gap[at]
        matrix: Any = stiffness
        if len(bordering):
            scaled = sp.diags_array(held * s)
            matrix = sp.block_array(
                [
                    [stiffness, -(scaled @ self.push[bordering]).T],
                    [-scaled @ nodes.normal[bordering], sp.diags_array(softness)],
                ],
                format="csr",
            )
            right = np.concatenate([right, held * s * self.gap[bordering]])
        # Other matrices, with which factors may be shared, are regular or singular by themselves.
        kind = active.tobytes(), self.system.of_matrices.once("matrices", object)
        return self.system.of_matrices.once(NEARBY, direct.Nearby).solve(
            sp.csr_array(matrix), right, kind=kind, symmetric=self.symmetric, saddle=len(bordering) > 0,
            solver=self.solver,
        )  # fmt: skip


def share_factors(system: System, factors: direct.Nearby) -> None:
    """Let equilibria of a system take and leave ``factors``, which serve systems of almost the same matrices."""
    system.in_place().of_matrices.keep(NEARBY, factors)


def find_touching(
    equilibrium: Equilibrium, guess: BoolArray | None = None, *, limit: int = 60, at: str = ""
) -> tuple[NodeEquilibrium, int]:
    """Find the touching nodes: N ≥ 0 where they touch, gap ≥ 0 where they do not. Also returns the steps taken. Nodes
    of contacts kept closed touch, whichever the sign of N.

    At first the nodes of guess (m,) touch, without one, or where these do not hold the structure, all. Each step lets
    go of those that pull and takes in those that penetrate, which is Newton's method on the complementarity and
    settles in a few steps. Where it returns to a set it has seen, it goes on more carefully: first letting go only,
    then half of the worst offenders, then the first in the list alone, which is certain to end where the contact
    problem has one solution (Murty 1974). Where letting go frees the structure, fewer are let go. With much
    friction that may go round in circles though there is an equilibrium: of few nodes all sets are then tried. at:
    where, as in " at μ = 0.3". Raises direct.SingularMatrix, or AnalysisError where nothing settles.
    """
    nodes = equilibrium.nodes
    # A node that no freedom moves along its normal (held, over an obstacle) can neither press nor give way.
    movable = np.diff(nodes.normal.indptr) > 0
    load = float(np.abs(equilibrium.force).max(initial=0.0))
    kept: BoolArray = movable & nodes.kept
    active: BoolArray = movable if guess is None else movable & (guess | kept)
    last: NodeEquilibrium | None = None
    unsolved: NoConvergence | None = None
    seen: set[bytes] = set()
    care = 0
    for step in range(1, limit + 1):
        try:
            state = equilibrium.solve(active, None if last is None else last.displacement)
        except direct.SingularMatrix:
            freed = np.flatnonzero(last.active & ~active) if last is not None else np.zeros(0, dtype=np.int64)
            if last is None and not np.array_equal(active, movable):
                active = movable
                continue
            if last is None or len(freed) < 2:
                raise
            back = freed[np.argsort(last.normal_force[freed])][len(freed) // 2 :]
            active = active.copy()
            active[back] = True
            care = max(care, 2)
            continue
        except NoConvergence as error:  # other sets may have an equilibrium
            unsolved = error
            break
        pulled, closing = offenders(state, movable, load)
        pulled = pulled[~kept[pulled]]
        if not len(pulled) and not len(closing):
            return state, step
        last = state
        seen.add(active.tobytes())
        active = changed(active, pulled, closing, care)
        if active.tobytes() in seen:
            care += 1
            seen.clear()
            active = changed(state.active, pulled, closing, care)
    if (found := next(of_every_set(equilibrium), None)) is not None:
        return found, limit
    if unsolved is not None:
        raise unsolved
    raise AnalysisError(f"steady sliding{at}: {unsettled(int(np.count_nonzero(movable & ~kept)), limit)}")


def of_every_set(equilibrium: Equilibrium) -> Iterator[NodeEquilibrium]:
    """What `find_touching` looks for, among all sets of touching nodes, those of which most touch first; of more than a
    few nodes nothing."""
    nodes = equilibrium.nodes
    movable = np.diff(nodes.normal.indptr) > 0
    free = np.flatnonzero(movable & ~nodes.kept)
    if len(free) > FEW:
        return
    load = float(np.abs(equilibrium.force).max(initial=0.0))
    for active in sets_near(movable, free):
        try:
            state = equilibrium.solve(active)
        except (direct.SingularMatrix, NoConvergence):
            continue
        pulled, closing = offenders(state, movable, load)
        if nodes.kept[pulled].all() and not len(closing):
            yield state


def sets_near(active: BoolArray, free: IntArray) -> Iterator[BoolArray]:
    """All sets that differ from ``active`` in some of the nodes ``free``, those that differ in few first."""
    for count in range(len(free) + 1):
        for flipped in combinations(free.tolist(), count):
            following = active.copy()
            following[list(flipped)] ^= True
            yield following


def unsettled(free: int, limit: int) -> str:
    """What is said where no set of touching nodes was found, of so many that need not touch."""
    if free <= FEW:
        return (
            f"none of the {2**free} sets of touching nodes is in equilibrium and holds the structure; turn loads that "
            "pull, or lower the friction coefficient"
        )
    return (
        f"the set of touching nodes does not settle in {limit} steps; turn loads that pull, lower the friction "
        "coefficient, or give the contact a finite stiffness"
    )


def offenders(state: NodeEquilibrium, movable: BoolArray, load: float) -> tuple[IntArray, IntArray]:
    """Touching nodes that pull and open nodes that penetrate, beyond rounding of forces as large as load [N]; the
    worst come first."""
    force, gap = state.normal_force, state.gap
    least_force = 1e-12 * max(float(np.abs(force).max(initial=0.0)), load)
    least_gap = 1e-12 * float(np.abs(gap).max(initial=0.0))
    pulled = np.flatnonzero(state.active & (force < -least_force))
    closing = np.flatnonzero(~state.active & movable & (gap < -least_gap))
    return pulled[np.argsort(force[pulled])], closing[np.argsort(gap[closing])]


def changed(active: BoolArray, pulled: IntArray, closing: IntArray, care: int) -> BoolArray:
    """The next set of touching nodes, the more careful the fewer change."""
    if care >= 3:
        first = min(*pulled, *closing, len(active))
        pulled, closing = pulled[pulled == first], closing[closing == first]
    elif care >= 1 and len(pulled):
        closing = closing[:0]
    if care == 2:
        few = (max(len(pulled), len(closing)) + 1) // 2
        pulled, closing = pulled[:few], closing[:few]
    following = active.copy()
    following[pulled] = False
    following[closing] = True
    return following

"""The projected problem: small dense matrices that stand for the sparse ones, and their eigenpairs at any μ.

Trial vectors are pairs (u, p) that respect the contacts, N u + c p = 0. Where contact is rigid, u says nothing about
p, and forces p̂ of their own are added (u = 0), each with a test vector ℓ that lifts it, N ℓ = p̂. Tested with [U, ℓ],

    Wᵀ(λ²M + λC + K) U z − (N W)ᵀ p − μ (S W)ᵀ p = 0,    p = P z + P̂ a .

The rows of ℓ determine a from z, with λ² and λ: that is how inertia and damping get into the contact force. At μ = 0
the rows of U hold a symmetric problem alone, (λ²UᵀMU + λUᵀCU + UᵀKU + PᵀcP) z = 0, with frequencies from above as in
any conforming method: no spurious modes.
"""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.linalg as sl
import scipy.sparse as sp

from ...errors import FollowingError
from ...typing import Array, ComplexArray, Sparse
from ..at_rest import double_zeros, more_slow, moving, rest_limit, slow_words
from ..dense_problem import DenseProblem, Eigenpairs, combined
from .problem import ContactProblem, Extras, Varying
from .shifted import ForcedShapes, Shifted, orthonormal, real_columns

FEW = 3  # friction coefficients asked of a basis one by one before all of the grid's terms are projected
REMEMBERED = 300  # vectors before they are condensed
KEPT = 1e-10  # of the strongest direction of the vectors kept


class Reduced(DenseProblem):
    """A basis and the problem projected on it, both of which grow.

    pairs: trial vectors with contact forces; forces P̂ (m, f): forces of rigid contacts of their own; lifts (n, f) their
    test vectors; highest: the largest μ that will be asked for. solves counts right sides solved for; compressed is the
    number of unknowns after the last `compress`.
    """

    compressed: int

    def __init__(
        self, problem: ContactProblem, shifted: Shifted, modes: ForcedShapes, frequency: float, highest: float
    ) -> None:
        super().__init__(frequency, (0.0, highest), damped=problem.damped)
        self.problem = problem
        self.shifted = shifted
        self.pairs = ForcedShapes(np.zeros((problem.size, 0)), np.zeros((problem.nodes, 0)))
        self.forces = np.zeros((problem.nodes, 0))
        self.lifts = np.zeros((problem.size, 0))
        self.solves = 0
        self._rigid = np.flatnonzero(problem.compliance == 0.0)
        self._force_scale = float(np.linalg.norm(modes.p, axis=0).max(initial=0.0)) or 1.0
        empty: Array = np.zeros((0, 0))
        self._matrices = (empty, empty, empty, empty)
        self._products: list[tuple[Array, Array]] = [(empty, empty)] * 3
        self._slip = np.zeros((problem.nodes, 0))
        self._extra: dict[float, tuple[Array, Array]] = {}
        self._grid: list[tuple[Array, Array]] | None = None
        self._lift_scale = 1.0
        self._told: dict[int, bool] = {}  # by how many zeros: whether there are slow modes among them
        self._kept: list[tuple[Array, Array, float]] = []  # parts on pairs and on forces, and how well they are known
        self.add(modes)
        self._modes = self.compressed = self.pairs.count

    @property
    def count(self) -> int:
        """Number of unknowns r."""
        return self.pairs.count + self.forces.shape[1]

    def add(self, candidates: ForcedShapes) -> int:
        """Take pairs in as far as they are new; returns how many unknowns that made."""
        before = self.count
        new, _ = orthonormal(self.problem, self.pairs, candidates)
        if len(self._rigid):
            self._add_forces(candidates.p)
            free = new.p.copy()
            free[self._rigid] = 0.0
            new = ForcedShapes(new.u, free)
        self.pairs = self.pairs.with_(new)
        if self.count > before:
            self._project()
        return self.count - before

    def enrich(self, force: Array) -> int:
        """Take in what forces (n, k) do to the frictionless problem; returns how many unknowns that made."""
        self.solves += force.shape[1]
        return self.add(ForcedShapes(*self.shifted.solve(force)))

    def enrich_left(self, force: Array, opening: Array) -> int:
        """Take in what left vectors need: answers to forces (n, k), and lifts of gap openings (m, l)."""
        grown = self.enrich(force)
        before = self.count
        if len(self._rigid):
            self._add_forces(opening)
        soft = opening.copy()
        soft[self._rigid] = 0.0
        soft = soft[:, np.abs(soft).max(axis=0, initial=0.0) > 0]
        if soft.shape[1]:
            self.solves += soft.shape[1]
            u, _ = self.shifted.solve(np.zeros((self.problem.size, soft.shape[1])), soft)
            compliance = self.problem.compliance
            p = np.zeros_like(soft)
            given = compliance > 0
            p[given] = -(self.problem.normal @ u)[given] / compliance[given, None]
            new, _ = orthonormal(self.problem, self.pairs, ForcedShapes(u, p))
            self.pairs = self.pairs.with_(new)
        if self.count > before:
            self._project()
        return grown + self.count - before

    def keep(self, right: ComplexArray, weight: float = 1.0) -> None:
        """Remember right vectors (r, k) for `compress`: exact ones, or with less weight what is known less well."""
        own = self.pairs.count
        columns = real_columns(right / np.linalg.norm(right[:own], axis=0))
        self._kept.append((columns[:own], columns[own:], weight))
        if len(self._kept) > REMEMBERED:
            shapes, forces = self._all_kept()
            self._kept = [(_condensed(shapes), _condensed(forces), 1.0)]

    def _all_kept(self, *, weighted: bool = False) -> tuple[Array, Array]:
        """Vectors kept so far, on the basis as it is now: their parts on pairs and on forces."""
        own, acting = self.pairs.count, self.forces.shape[1]
        weights = [weight if weighted else 1.0 for *_, weight in self._kept]
        shapes = np.hstack([w * _padded(u, own) for w, (u, *_) in zip(weights, self._kept, strict=True)])
        return shapes, np.hstack([w * _padded(p, acting) for w, (_, p, _) in zip(weights, self._kept, strict=True)])

    @property
    def exact(self) -> Array:
        """Orthonormal columns (k, l) on the pairs that span the shapes of all vectors kept."""
        return _span(self._all_kept()[0])

    @property
    def exact_last(self) -> Array:
        """The same of the vectors kept last."""
        return _span(_padded(self._kept[-1][0], self.pairs.count))

    @property
    def stiffness(self) -> Array:
        """UᵀKU + PᵀcP (k, k) of the pairs, whose mass is one: what they are without friction."""
        own = self.pairs.count
        return self._matrices[2][:own, :own]

    def compress(self, kept: float = KEPT, *, weighted: bool = False) -> None:
        """Reduce the basis to the frictionless modes and the span of the vectors kept, but for ``kept`` of it; with
        ``weighted`` but for more of what is known less well."""
        own, first = self.pairs.count, self._modes
        shapes, forces = self._all_kept(weighted=weighted)
        turn = np.zeros((own, own))
        turn[:first, :first] = np.eye(first)
        beyond = _span(shapes[first:], kept)
        turn[first:, first : first + beyond.shape[1]] = beyond
        turn = turn[:, : first + beyond.shape[1]]
        force_turn = _span(forces, kept)
        self.pairs = self.pairs.combined(turn)
        self.forces, self.lifts = self.forces @ force_turn, self.lifts @ force_turn
        self._products = [
            (turn.T @ square @ turn, force_turn.T @ across @ turn) if len(square) else (square, across)
            for square, across in self._products
        ]
        self._kept = [
            (turn.T @ _padded(u, own), force_turn.T @ _padded(p, len(force_turn)), w) for u, p, w in self._kept
        ]
        self.compressed = self.count
        self._project()

    def narrowed(self, kept: float) -> Reduced:
        """The same on a basis of its own that leaves out ``kept`` of what is known best, more of the rest."""
        other = copy(self)
        other._known, other._extra = {}, dict[float, tuple[Array, Array]]()
        other.compress(kept, weighted=True)
        return other

    def _add_forces(self, candidates: Array) -> None:
        """Take forces (m, k) on rigid contacts in as far as they are new, each with its lift."""
        block = np.zeros_like(candidates)
        block[self._rigid] = candidates[self._rigid]
        length = np.linalg.norm(block, axis=0)
        block = block[:, length > 0] / length[length > 0]
        known = self.forces / self._force_scale
        for _ in range(2):
            block = block - known @ (known.T @ block)
        if not block.shape[1]:
            return
        q, r, _ = sl.qr(block, mode="economic", pivoting=True)
        new = q[:, np.abs(np.diag(r)) > 1e-9]
        new = new - known @ (known.T @ new)
        if not new.shape[1]:
            return
        new = sl.qr(new, mode="economic")[0]
        self.solves += new.shape[1]
        lift, _ = self.shifted.solve(np.zeros((self.problem.size, new.shape[1])), new)
        if not self.forces.shape[1]:
            # One factor for all of them, so that combinations of forces have the same combinations as lifts.
            self._lift_scale = 1.0 / (float(np.sqrt(np.sum(lift * (self.problem.mass @ lift)))) or 1.0)
        lift *= self._lift_scale
        self.forces = np.hstack([self.forces, new * self._force_scale])
        self.lifts = np.hstack([self.lifts, lift])

    # -- the projected matrices ---------------------------------------------------------------------------------------
    def _project(self) -> None:
        """The matrices M, C, K and friction F (r, r): unknowns [z, a], equations tested with [U, ℓ]."""
        problem, own = self.problem, self.pairs.count
        force = np.hstack([self.pairs.p, self.forces])
        tests = [self.pairs.u, self.lifts]
        r = self.count
        mass, damping, stiffness = np.zeros((3, r, r))
        for index, (matrix, target) in enumerate(
            ((problem.mass, mass), (problem.stiffness, stiffness), (problem.damping, damping))
        ):
            if matrix.nnz:
                self._products[index] = _grown(self._products[index], matrix, *tests)
                target[:own, :own], target[own:, :own] = self._products[index]
        normal = np.hstack([_few(problem.normal, t) for t in tests])
        self._slip = np.hstack([_few(problem.slip, t) for t in tests])
        friction = -self._slip.T @ (problem.share[:, None] * force)
        self._matrices = (mass, damping, stiffness - normal.T @ force, friction)
        self._known.clear()
        self._extra.clear()
        self._grid = None

    def matrices(self, mu: complex) -> tuple[Array, Any, Any]:
        """M, C and K (r, r) at μ, friction and what steady sliding adds included; complex where μ is."""
        mass, damping, stiffness, friction = self._matrices
        extras = self.problem.extras
        if extras is None:
            return mass, damping, stiffness + mu * friction
        more_damping, more_stiffness = self._steady(extras, mu)
        return mass, damping + more_damping, stiffness + mu * friction + more_stiffness

    def changes(self, mu: complex) -> tuple[Array, Array, Array]:
        """dM, dC and dK (r, r) over μ, the first zero."""
        mass, _, _, friction = self._matrices
        nothing, extras = np.zeros_like(mass), self.problem.extras
        if extras is None:
            return nothing, nothing, friction
        if extras.within(mu):
            damping, stiffness = _weighed(self._on_grid(extras), extras.slopes(mu))
        else:
            step = 1e-5 * max(mu.real, 1e-3)
            # Beyond the highest that is asked for there need be no steady sliding.
            high = max(min(mu.real + step, self.high), mu.real)
            low = max(high - 2 * step, 0.0)
            if high <= low:  # no more than no friction is asked for, and nothing is followed from there
                return nothing, nothing, friction
            before, after = self._steady(extras, low), self._steady(extras, high)
            damping, stiffness = ((b - a) / (high - low) for a, b in zip(before, after, strict=True))
        return nothing, damping, friction + stiffness

    def _steady(self, extras: Varying, mu: complex) -> tuple[Array, Array]:
        """Damping and stiffness (r, r) that steady sliding adds; outside its grid those of the real part of μ."""
        real = float(mu.real)
        if extras.within(mu):
            if isinstance(mu, complex):
                return _weighed(self._on_grid(extras), extras.weights(mu))
            if self._grid is not None or len(self._extra) >= FEW:
                return _weighed(self._on_grid(extras), extras.weights(real))
        if real not in self._extra:
            self._extra[real] = self._projected(extras(real))
        return self._extra[real]

    def _on_grid(self, extras: Varying) -> list[tuple[Array, Array]]:
        """The terms at the grid's μ, projected once for each basis."""
        if self._grid is None:
            assert extras.grid is not None, "asked for within the grid only"
            self._grid = [self._projected(extras(float(g))) for g in extras.grid]
        return self._grid

    def _projected(self, extras: Extras) -> tuple[Array, Array]:
        own = self.pairs.count
        damping, stiffness = np.zeros((2, self.count, self.count))
        # Most have no rigid contact, and the vectors of a large problem are not copied for nothing.
        tests = np.hstack([self.pairs.u, self.lifts]) if self.lifts.shape[1] else self.pairs.u
        if extras.weakening is not None:
            damping[:, :own] += self._slip.T @ (extras.weakening[:, None] * self._slip[:, :own])
        if extras.damping is not None:
            damping[:, :own] += _sandwiched(tests, extras.damping, self.pairs.u)
        if extras.stiffness is not None:
            stiffness[:, :own] += _sandwiched(tests, extras.stiffness, self.pairs.u)
        return damping, stiffness

    # -- eigenpairs ---------------------------------------------------------------------------------------------------
    def untracked(self, mu: float) -> Eigenpairs:
        """See `DenseProblem`; own says how many of the unknowns belong to pairs."""
        if mu in self._known:
            return self._known[mu]
        return self.remembered(replace(self._resting(super().untracked(mu)), own=self.pairs.count))

    def _resting(self, found: Eigenpairs) -> Eigenpairs:
        """With zeros for what is zero but for rounding, where some motion has no stiffness: whether rounding makes it
        grow says nothing. Raises FollowingError where there is more of it than such motions: slow modes, among them."""
        if not self.damped:
            return found
        moves = moving(found.values, self.frequency, lambda: self.rest_limit)
        if np.all(moves):
            return found
        slow = found.values[~moves]
        if (zeros := double_zeros(slow)) not in self._told:
            problem = self.problem.pencil(self.high).condensed()
            self._told[zeros] = more_slow(problem, slow, self.frequency, self.problem.solver)
        if self._told[zeros]:
            raise FollowingError(f"there are {slow_words(self.rest_limit)}")
        values = np.where(moves, found.values, 0.0)
        return replace(found, values=values, coordinate=values)

    @cached_property
    def rest_limit(self) -> float:
        """Up to which |λ| [1/s] eigenvalues may be zero but for rounding: see `at_rest.rest_limit`."""
        ends = [self.problem.pencil(mu).condensed() for mu in dict.fromkeys((0.0, self.high))]
        return rest_limit(ends, self.frequency, self.problem.solver)

    def padded(self, found: Eigenpairs, vectors: ComplexArray) -> ComplexArray:
        """Vectors (r, k) of pairs found before the basis grew, on the basis as it is now."""
        own = found.own
        return np.vstack(
            [_padded(vectors[:own], self.pairs.count), _padded(vectors[own:], self.forces.shape[1])], dtype=complex
        )

    def _entries(self, lam: complex, mu: complex) -> Array:
        mass, _, stiffness, friction = self._matrices
        size: Array = np.abs(stiffness) + abs(mu) * np.abs(friction) + self.frequency**2 * np.abs(mass)
        return size

    def expand(self, z: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        """u (n, k) of unit norm and p (m, k) of right vectors z (r, k)."""
        own = self.pairs.count
        u = combined(self.pairs.u, z[:own])
        p = combined(self.pairs.p, z[:own]) + combined(self.forces, z[own:])
        norm = np.linalg.norm(u, axis=0)
        return u / norm, p / norm

    def expand_left(self, w: ComplexArray) -> ComplexArray:
        """y (n, k) of unit norm of left vectors w (r, k)."""
        own = self.pairs.count
        y = combined(self.pairs.u, w[:own]) + combined(self.lifts, w[own:])
        return y / np.linalg.norm(y, axis=0)


def _grown(known: tuple[Array, Array], matrix: Sparse, u: Array, lifts: Array) -> tuple[Array, Array]:
    """Uᵀ A U (r, r) and ℓᵀ A U (f, r) of a symmetric matrix, of which the leading parts are known."""
    (f0, r0), r, f = known[1].shape, u.shape[1], lifts.shape[1]
    new = matrix @ u[:, r0:]
    square, across = np.zeros((r, r)), np.zeros((f, r))
    square[:r0, :r0], across[:f0, :r0] = known
    square[:, r0:] = u.T @ new
    square[r0:, :r0] = square[:r0, r0:].T
    across[:, r0:] = lifts.T @ new
    across[f0:, :r0] = (matrix @ lifts[:, f0:]).T @ u[:, :r0]
    return square, across


def _sandwiched(tests: Array, matrix: Sparse, u: Array) -> Array:
    """tests^T A u of a matrix that is zero but for a few rows."""
    csr = sp.csr_array(matrix)
    rows = np.flatnonzero(np.diff(csr.indptr))
    return tests[rows].T @ _few(csr[rows], u)


def _few(matrix: Sparse, u: Array) -> Array:
    """A u of a matrix with entries in a few columns alone: SciPy copies all of u, unless its rows lie in memory one
    after the other."""
    columns, place = np.unique(matrix.indices, return_inverse=True)
    narrow = sp.csr_array((matrix.data, place, matrix.indptr), shape=(matrix.shape[0], len(columns)))
    return narrow @ np.ascontiguousarray(u[columns])


def _weighed(terms: list[tuple[Array, Array]], weights: Any) -> tuple[Any, Any]:
    """Sums over the grid with weights (k,)."""
    damping = sum((w * d for w, (d, _) in zip(weights, terms, strict=True)), start=0.0)
    return damping, sum((w * k for w, (_, k) in zip(weights, terms, strict=True)), start=0.0)


def _padded(block: Any, rows: int) -> Any:
    """The block with rows of zeros added below."""
    return np.vstack([block, np.zeros((rows - len(block), block.shape[1]))])


def _condensed(block: Array) -> Array:
    """As few columns as have the products of those of ``block`` with their transpose, weak directions left out."""
    if not block.size:
        return np.zeros((len(block), 0))
    left, size, _ = sl.svd(block, full_matrices=False)
    strong = size > KEPT * max(float(size[0]), 1e-300)
    return left[:, strong] * size[strong]


def _span(block: Array, kept: float = KEPT) -> Array:
    """Orthonormal columns that span those of ``block`` but for ``kept`` of its largest."""
    if not block.size:
        return np.zeros((len(block), 0))
    left, size, _ = sl.svd(block, full_matrices=False)
    return left[:, size > kept * max(float(size[0]), 1e-300)]

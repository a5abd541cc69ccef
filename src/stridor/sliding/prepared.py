"""Equilibria of one structure for many sets of touching nodes and friction coefficients, with one factorisation.

With springs k at the nodes that touched first, A = K + NᵀkN, equilibrium

    K u − (N + R)ᵀ p = f,    g + N u + c p = 0 where nodes touch, p = 0 elsewhere,

with R what friction makes of the tangents T, is

    A u = f + Nᵀ(p + k y) + Rᵀ p,    y = N u,

so that N A⁻¹Nᵀ and N A⁻¹Tᵀ, made once by a solution for each node, leave one equation for each of them, rigid contact
(c = 0) included, and one solution for the displacements.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import numpy as np
import scipy.linalg as sl
import scipy.sparse as sp

from ..contact.nodes import ContactNodes
from ..direct import Factor, SingularMatrix, factorise
from ..direct.dense import lu_factors
from ..direct.nearby import LEAST
from ..system import System
from ..typing import Array, BoolArray, Sparse

MOST_NODES = 2000
LARGEST = 1.5e9  # bytes of factors that are kept; the complex ones that modes are sought with take four times as much
FEWEST = 2  # sets of touching nodes solved for one by one before anything is prepared for more,
NODES_EACH = 150  # and one more for so many nodes: together they cost what that does
BLOCK = 64  # nodes whose answers are held at once
CLOSED = 1e-13, 1e-12  # of the largest gap or opening: what the contacts' equations may leave; where no more is won
CORRECTIONS = 4
REGULAR = 1e-11  # reciprocal condition of the contacts' equations from which on they are believed


@dataclass(frozen=True)
class Prepared:
    """A structure K on springs k (m,) at its contact nodes, factorised, and what unit forces at each of these open at
    all of them: by_normal N A⁻¹Nᵀ (m, m), by_tangent N A⁻¹T_dᵀ (d−1, m, m) [m/N]."""

    nodes: ContactNodes
    springs: Array
    factor: Factor
    by_normal: Array
    by_tangent: Array
    solver: str | None
    _still: dict[bytes, Array] = field(default_factory=dict[bytes, Array])

    @classmethod
    def of(
        cls, stiffness: Sparse, nodes: ContactNodes, sprung: BoolArray, *, symmetric: bool, solver: str | None,
        largest: float = np.inf,
    ) -> Prepared | None:  # fmt: skip
        """With springs at the nodes ``sprung`` (m,); None where these do not hold the structure, or where the factors
        take more than ``largest`` bytes."""
        # Springs that are no stiffer than the structure do not drown it in rounding.
        scale = float(np.abs(stiffness.data).max(initial=0.0)) or 1.0
        springs = np.where(sprung, 1.0 / np.maximum(nodes.compliance, 1.0 / scale), 0.0)
        matrix = sp.csr_array(stiffness + nodes.normal.T @ sp.diags_array(springs) @ nodes.normal)
        m, d = nodes.count, nodes.directions
        by_normal, by_tangent = np.zeros((m, m)), np.zeros((d, m, m))
        try:
            factor = factorise(matrix, symmetric=symmetric, solver=solver)
            if factor.memory_bytes > largest:
                factor.free()
                return None
            for first in range(0, m, BLOCK):
                rows = slice(first, first + BLOCK)
                answer = factor.solve(nodes.normal[rows].T.toarray(), transpose=True, refine=False)
                by_normal[rows] = (nodes.normal @ answer).T
                for k in range(d):
                    by_tangent[k, rows] = (nodes.tangent[k::d] @ answer).T
        except SingularMatrix:
            return None
        return cls(nodes, springs, factor, by_normal, by_tangent, solver)

    def serves(self, nodes: ContactNodes, solver: str | None) -> bool:
        """Whether these are the nodes it was prepared for, but for gaps and compliances, and the solver."""
        known = self.nodes
        return solver == self.solver and _same(known.normal, nodes.normal) and _same(known.tangent, nodes.tangent)

    def at(
        self, force: Array, active: BoolArray, rubbing: Array, compliance: Array, gap: Array
    ) -> tuple[Array, Array] | None:
        """Displacement (n,) and normal forces (m,) under ``force`` (n,), the nodes ``active`` (m,) touching; rubbing
        (m, d−1) is the friction along the tangents of a unit normal force. None where they cannot be believed."""
        nodes, k = self.nodes, self.springs
        among = np.flatnonzero(active | (k > 0))
        # Unknown is the normal force of a node that touches, and of one that does not what its spring would bear.
        share = np.where(active, 1.0 - k * compliance, 1.0)
        rubs = np.where(active[:, None], rubbing, 0.0)
        own = np.where(active, compliance, -1.0 / np.where(k > 0, k, np.inf))
        start, closing = np.where(active, gap, 0.0), -k * np.where(active, gap, 0.0)
        matrix = self.by_normal * share
        for direction, part in enumerate(self.by_tangent):
            matrix += part * rubs[:, direction]
        solve = _solver(matrix[np.ix_(among, among)] + np.diag(own[among]))
        if solve is None:
            return None
        unknown = np.zeros(nodes.count)
        left = self._unloaded(force) + self.by_normal @ closing + start
        error, u = np.inf, force
        for _ in range(CORRECTIONS):
            before = error
            unknown[among] -= solve(left[among])
            right = force + nodes.normal.T @ (share * unknown + closing)
            u = self.factor.solve(right + nodes.tangent.T @ (rubs * unknown[:, None]).ravel())
            opening = nodes.normal @ u
            left = opening + start + own * unknown
            size = np.abs(start) + abs(nodes.normal) @ np.abs(u) + np.abs(own * unknown)
            error = float(np.abs(left[among]).max(initial=0.0) / max(float(size.max(initial=0.0)), 1e-300))
            if error <= CLOSED[0] or not error < 0.5 * before:
                break
        return (u, np.where(active, unknown, 0.0)) if error <= CLOSED[1] else None

    def _unloaded(self, force: Array) -> Array:
        """N A⁻¹f (m,), kept for the force asked for last."""
        key = force.tobytes()
        if key not in self._still:
            self._still.clear()
            self._still[key] = self.nodes.normal @ self.factor.solve(force, refine=False)
        return self._still[key]


class Preparing:
    """Equilibria of a structure, prepared for as soon as so many have been asked for that it pays."""

    def __init__(self) -> None:
        self.prepared: Prepared | None = None
        self._asked = 0
        self._refused = False

    def at(
        self, system: System, nodes: ContactNodes, force: Array, active: BoolArray, rubbing: Array, solver: str | None
    ) -> tuple[Array, Array] | None:
        """As `Prepared.at`; None also as long as nothing is prepared."""
        if self._refused or nodes.count > MOST_NODES or system.size < LEAST or not np.any(active):
            return None  # nobody touches: there is nothing to share
        if self.prepared is not None and not self.prepared.serves(nodes, solver):
            self.free()
        self._asked += 1
        if self._asked <= FEWEST + nodes.count // NODES_EACH:
            return None
        if self.prepared is None:
            self.prepared = Prepared.of(
                system.stiffness, nodes, active,
                symmetric=system.symmetric_definite, solver=solver, largest=LARGEST,
            )  # fmt: skip
            self._refused = self.prepared is None
        return None if self.prepared is None else self.prepared.at(force, active, rubbing, nodes.compliance, nodes.gap)

    def free(self) -> None:
        """Give the memory of the factorisation back; what is asked for is counted anew."""
        self._asked = 0
        prepared, self.prepared = self.prepared, None  # first, as an interrupt may come between
        if prepared is not None:
            prepared.factor.free()


def _same(one: Sparse, other: Sparse) -> bool:
    return one is other or (
        one.shape == other.shape
        and all(np.array_equal(getattr(one, part), getattr(other, part)) for part in ("indptr", "indices", "data"))
    )


def _solver(matrix: Array) -> Callable[[Array], Array] | None:
    """What solves with a dense matrix, None where that is as good as singular."""
    if not np.all(np.isfinite(matrix)):
        return None
    factors = lu_factors(matrix, check_finite=False)
    regularity, _ = sl.lapack.dgecon(factors[0], np.linalg.norm(matrix, 1))
    return partial(sl.lu_solve, factors, check_finite=False) if regularity > REGULAR else None

"""Factors of the frictionless problem, kept from one stretch of μ to the next, in which a few nodes fewer touch."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp

from ...direct import Factor, counting_factor, factorise
from ...direct.bordered import WithoutRows
from ...typing import Array, Sparse
from .problem import ContactProblem

LARGEST = 1.5e9  # bytes of factors that are kept
APART = 0.25  # of the widest gap between squares: how far from each of them one is that divides them


@dataclass(frozen=True)
class _Kept:
    """Factors of A₀ of a problem at ω² = ``square``, multipliers scaled by ``scale``."""

    problem: ContactProblem
    square: float
    factor: Factor
    scale: float


@dataclass
class KeptFactors:
    """A₀⁻¹, A₀ = [[K − ω²M, −sNᵀ], [−sN, −s²c]], of one structure for one set of touching nodes after the other."""

    _kept: dict[str, _Kept] = field(default_factory=dict[str, _Kept])

    def solving(self, problem: ContactProblem, square: float) -> tuple[Factor | WithoutRows, float]:
        """What solves with A₀ at ω² = ``square`` [1/s²], and its scale s; by factors kept where nodes have opened
        since, else by its own, which are kept then. Raises as `factorise`."""
        known = self._by_kept("solving", problem, square)
        if known is not None:
            return known
        matrix, scale = matrix_at(problem, square)
        factor = factorise(matrix, symmetric=True, saddle=problem.nodes > 0, solver=problem.solver)
        self._keep("solving", _Kept(problem, square, factor, scale))
        return factor, scale

    def negative(self, problem: ContactProblem, square: float) -> int | None:
        """How many negative eigenvalues A₀ has at ω² = ``square`` [1/s²]; None where it is not told. Raises as
        `factorise`."""
        known = self._by_kept("counting", problem, square)
        if known is not None and known[0].inertia is not None:
            return known[0].inertia
        matrix, scale = matrix_at(problem, square)
        factor = counting_factor(matrix, saddle=problem.nodes > 0, solver=problem.solver)
        if factor is None:
            return None
        told = factor.inertia
        self._keep("counting", _Kept(problem, square, factor, scale))
        return told

    def _by_kept(
        self, use: str, problem: ContactProblem, square: float
    ) -> tuple[Factor | WithoutRows, float] | None:
        """The factors kept for a ``use`` without the nodes that do not touch any more; None where they do not serve,
        and then they are let go."""
        known = self._kept.pop(use, None)
        if known is None or known.square != square or known.problem.solver != problem.solver:
            return None
        fewer = _fewer(known, problem)
        if fewer is None:
            return None
        self._kept[use] = known
        return fewer, known.scale

    def _keep(self, use: str, made: _Kept) -> None:
        if made.factor.memory_bytes <= LARGEST:
            self._kept[use] = made

    def dividing(self, gaps: Array) -> float | None:
        """The ω² at which eigenvalues were counted before, where it is well within one of the ``gaps`` (g, 2) between
        them, the widest first."""
        known = self._kept.get("counting")
        if known is None or not len(gaps):
            return None
        clear = np.minimum(known.square - gaps[:, 0], gaps[:, 1] - known.square)
        return known.square if clear.max() >= APART * float(gaps[0, 1] - gaps[0, 0]) else None


def matrix_at(problem: ContactProblem, square: float) -> tuple[Sparse, float]:
    """A₀ at ω² = ``square`` [1/s²], and the scale of its multipliers, so that it is well balanced."""
    matrix = sp.csr_array(problem.stiffness - square * problem.mass)
    scale = float(np.abs(matrix.diagonal()).mean()) or 1.0
    if problem.nodes:
        normal = sp.csr_array(-scale * problem.normal)
        corner = sp.diags_array(-(scale**2) * problem.compliance, format="csr")
        matrix = sp.block_array([[matrix, normal.T], [normal, corner]], format="csr")
    return matrix, scale


def _fewer(known: _Kept, problem: ContactProblem) -> Factor | WithoutRows | None:
    """The factors without the nodes that do not touch any more; None where anything else differs."""
    before = known.problem
    # Nodes that stick have rows of their own.
    plain = all(p.nodes == len(p.touching) for p in (before, problem))
    if not plain or problem.size != before.size or not np.isin(problem.touching, before.touching).all():
        return None
    stay = np.isin(before.touching, problem.touching)
    if not (
        np.array_equal(before.touching[stay], problem.touching)
        and np.array_equal(before.compliance[stay], problem.compliance)
        and _same(before.normal[np.flatnonzero(stay)], problem.normal)
        and _same(before.stiffness, problem.stiffness)
        and _same(before.mass, problem.mass)
    ):
        return None
    if stay.all():
        return known.factor
    left_out = problem.size + np.flatnonzero(~stay)
    return WithoutRows.of(known.factor, problem.size + before.nodes, left_out)


def _same(one: Sparse, other: Sparse) -> bool:
    return one is other or (one.shape == other.shape and not (one != other).nnz)

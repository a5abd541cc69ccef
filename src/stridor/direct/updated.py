"""The inverse of a matrix that differs in few rows or columns from one whose factors are at hand.

With A = A₀ + U Vᵀ, U and V of r columns,

    A⁻¹ b = y − Z (1 + VᵀZ)⁻¹ Vᵀ y,      y = A₀⁻¹ b,   Z = A₀⁻¹ U

(Sherman, Morrison and Woodbury): r solutions in one block, and one for each right side.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from ..typing import Array, IntArray, Sparse
from .factor import Factor

MOST = 24  # r; by then some steps of GMRES cost as much
SPREAD = 400  # rows and columns that differ: what is looked at as a dense matrix
ROUNDING = 1e-14  # of the largest singular value of what differs


@dataclass(frozen=True)
class Updated:
    """A⁻¹ by factors of A₀. solved: Z (n, r); columns (q,) of A that differ, and V of them (q, r)."""

    factor: Factor
    solved: Array
    columns: IntArray
    right: Array

    @staticmethod
    def of(factor: Factor, before: Sparse, matrix: Sparse) -> Updated | None:
        """Of ``matrix`` (n, n) by the factors of ``before``; None where more than a little differs.

        Raises SingularMatrix where solving overflows.
        """
        change = sp.coo_array(matrix - before)
        there = change.data != 0.0
        row, column, value = change.coords[0][there], change.coords[1][there], change.data[there]
        rows, i = np.unique(row, return_inverse=True)
        columns, j = np.unique(column, return_inverse=True)
        if max(len(rows), len(columns)) > SPREAD:
            return None
        block = np.zeros((len(rows), len(columns)))
        block[i, j] = value
        left, size, right = np.linalg.svd(block, full_matrices=False)
        rank = int(np.count_nonzero(size > ROUNDING * size.max(initial=0.0)))
        if rank > MOST:
            return None
        spread = np.zeros((matrix.shape[0], rank))
        spread[rows] = left[:, :rank] * size[:rank]
        return Updated(factor, np.asarray(factor.solve(spread, refine=False)), columns, right[:rank].T)

    def solve(self, right: Array) -> tuple[Array, Array]:
        """A⁻¹ b and A₀⁻¹ b (n, k), to what elimination gives. Raises numpy.linalg.LinAlgError where A has no inverse,
        SingularMatrix where solving overflows."""
        first = np.asarray(self.factor.solve(right, refine=False))
        weights = np.linalg.solve(
            np.eye(self.right.shape[1]) + self.right.T @ self.solved[self.columns], self.right.T @ first[self.columns]
        )
        return first - self.solved @ weights, first

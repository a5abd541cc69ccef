"""SuperLU as SciPy brings it: always there, an order of magnitude slower in space."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spl

from ..typing import Array, Sparse
from .interface import Breakdown
from .ordering import nested_dissection


class SuperluFactor:
    """LU factors of the equilibrated matrix. inertia is the count of negative pivots where the matrix is real and
    symmetric and all of them were taken from the diagonal; to look costs a copy of the factors. pivots: how small one
    may be beside its column before another is taken."""

    def __init__(self, matrix: Sparse, symmetric: bool, saddle: bool, *, pivots: float | None = None) -> None:
        self._symmetric = symmetric and matrix.dtype.kind == "f"
        csr = sp.csr_array(matrix)
        self._row, self._column = equilibrate(csr)
        # Entry by entry: products with diagonal matrices take five times as long.
        entries = csr.data * np.repeat(self._row, np.diff(csr.indptr)) * self._column[csr.indices]
        scaled = sp.csc_array(sp.csr_array((entries, csr.indices, csr.indptr), shape=csr.shape))
        # An order for A + Aᵀ with pivots kept to the diagonal fills in far less than SciPy's default, and nested
        # dissection less than minimum degree. Where a multiplier's diagonal is zero SuperLU takes another pivot of its
        # column: 20 % more fill than with a diagonal made up for it, but exact, so that no solve needs a second one to
        # refine it.
        pivots = (0.01 if saddle else 1e-3) if pivots is None else pivots
        options = {"SymmetricMode": True, "PrintStat": False, "Equil": False}
        self._order = nested_dissection(scaled)
        spec = "MMD_AT_PLUS_A" if self._order is None else "NATURAL"
        if self._order is not None:
            scaled = sp.csc_array(scaled[self._order][:, self._order])
        try:
            self._factor: Any = spl.splu(scaled, permc_spec=spec, diag_pivot_thresh=pivots, options=options)
        except RuntimeError as error:
            raise Breakdown(str(error)) from error
        width = scaled.dtype.itemsize + 4
        self.memory_bytes = int(self._factor.nnz) * width

    def solve(self, right: Any, transpose: bool) -> Any:
        """One unrefined solve."""
        before, after = (self._column, self._row) if transpose else (self._row, self._column)
        scaled, trans = right * before[:, None], "T" if transpose else "N"
        if self._order is None:
            return self._factor.solve(np.ascontiguousarray(scaled), trans=trans) * after[:, None]
        answer = np.empty_like(scaled)
        answer[self._order] = self._factor.solve(np.ascontiguousarray(scaled[self._order]), trans=trans)
        return answer * after[:, None]

    @property
    def inertia(self) -> int | None:
        """Number of negative eigenvalues, where it is told."""
        return self._negative

    @cached_property
    def _negative(self) -> int | None:
        """A = L U with rows and columns in one order is L D Lᵀ, and D has the signs of the eigenvalues (Sylvester)."""
        straight = self._symmetric and np.array_equal(self._factor.perm_r, self._factor.perm_c)
        # Rows and columns are scaled alike where the matrix is symmetric, by positive numbers.
        return int(np.count_nonzero(self._factor.U.diagonal() < 0.0)) if straight else None

    def free(self) -> None:
        """SuperLU frees its memory with the object."""
        self._factor = None


def equilibrate(matrix: Sparse, passes: int = 3) -> tuple[Array, Array]:
    """Powers of two (n,), (n,) for rows and columns that bring every largest entry near one (Ruiz)."""
    csr = sp.csr_array(matrix)
    size, counts = np.abs(csr.data), np.diff(csr.indptr)
    row, column = np.ones(csr.shape[0]), np.ones(csr.shape[1])
    filled = np.flatnonzero(counts)
    for _ in range(passes if len(filled) else 0):
        scaled = size * np.repeat(row, counts) * column[csr.indices]
        largest, across = np.zeros(len(row)), np.zeros(len(column))
        largest[filled] = np.maximum.reduceat(scaled, csr.indptr[filled])
        np.maximum.at(across, csr.indices, scaled)
        row, column = row * _root(largest), column * _root(across)
    return row, column


def _root(largest: Array) -> Array:
    # Powers of two scale without rounding.
    return np.exp2(-np.round(0.5 * np.log2(np.where(largest > 0, largest, 1.0))))

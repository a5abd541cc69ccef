"""Factors of small sparse matrices that are needed once, many of them: SciPy's SuperLU with nothing around it."""

from __future__ import annotations

import scipy.sparse as sp
import scipy.sparse.linalg as spl

from ..typing import ComplexArray, Sparse
from .factor import SingularMatrix


class LightFactor:
    """LU factors of a complex matrix (n, n), not scaled and not tried. Raises SingularMatrix for a pivot of zero."""

    def __init__(self, matrix: Sparse) -> None:
        self._matrix = sp.csc_array(matrix)
        try:
            self._lu = spl.splu(self._matrix)
        except RuntimeError as error:
            raise SingularMatrix("the matrix is singular: elimination meets a pivot of zero") from error

    def solve(self, right: ComplexArray, *, transpose: bool = False) -> ComplexArray:
        """A⁻¹ right, or A⁻ᵀ right (never conjugated), refined once; right (n,) or (n, k)."""
        trans, matrix = ("T", self._matrix.T) if transpose else ("N", self._matrix)
        answer: ComplexArray = self._lu.solve(right, trans)
        return answer + self._lu.solve(right - matrix @ answer, trans)

    def free(self) -> None:
        """Nothing that is not given back by itself."""

"""LU factors of dense matrices."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg as sl

from ..typing import Array, ComplexArray, IntArray


def lu_factors(matrix: Any, *, check_finite: bool = True) -> tuple[Any, Any]:
    """What `scipy.linalg.lu_factor` gives, without a warning.

    A matrix that is exactly singular, as any is at an eigenvalue, shows as a zero pivot and in infinite or NaN answers,
    which callers look for; newer versions of SciPy warn of it, too.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sl.LinAlgWarning)
        return sl.lu_factor(matrix, check_finite=check_finite)


@dataclass(frozen=True)
class DenseFactor:
    """LU factors of a complex matrix whose rows were divided by ``rows`` (n,), by LAPACK itself: SciPy's checks take
    longer than solving does where matrices are small. What an exactly singular one answers is not finite."""

    factors: ComplexArray
    pivots: IntArray
    rows: Array

    @staticmethod
    def of(matrix: ComplexArray) -> DenseFactor:
        """Of a matrix (n, n), as it is."""
        rows = np.maximum(np.abs(matrix).max(axis=1), 1e-300)
        factors, pivots, _ = sl.lapack.zgetrf(matrix / rows[:, None])
        return DenseFactor(factors, pivots, rows)

    def solve(self, right: ComplexArray, *, transpose: bool = False) -> ComplexArray:
        """A⁻¹ right, or A⁻ᵀ right (never conjugated), of right (n,) or (n, k)."""
        scale = self.rows if right.ndim == 1 else self.rows[:, None]
        found: ComplexArray = sl.lapack.zgetrs(
            self.factors, self.pivots, right if transpose else right / scale, trans=int(transpose)
        )[0]
        return found / scale if transpose else found

    def free(self) -> None:
        """Nothing to give back."""

"""LU factors of dense matrices."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg as sl

from ..typing import Array, ComplexArray, IntArray
from .factor import BACKWARD_ERROR

REGULAR = 1e-11  # reciprocal condition, after equilibration, from which on a matrix is clearly regular


def lu_factors(matrix: Any, *, check_finite: bool = True) -> tuple[Any, Any]:
    """What `scipy.linalg.lu_factor` gives, without a warning.

    A matrix that is exactly singular, as any is at an eigenvalue, shows as a zero pivot and in infinite or NaN answers,
    which callers look for; newer versions of SciPy warn of it, too.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sl.LinAlgWarning)
        return sl.lu_factor(matrix, check_finite=check_finite)


def solved(matrix: Array, right: Array) -> Array | None:
    """A⁻¹ b (n,) of a small real matrix, equilibrated and refined (LAPACK's gesvx). None where that is not an answer to
    full precision of a matrix that is clearly regular: another way has to tell why."""
    if not len(right):
        return right
    if not (np.isfinite(matrix).all() and np.isfinite(right).all()):
        return None
    with np.errstate(all="ignore"):
        *_, solution, regularity, _, _, info = sl.lapack.dgesvx(matrix, right[:, None])
        if info != 0 or not regularity > REGULAR:
            return None
        answer: Array = solution[:, 0]
        # LAPACK's own bound is one where an unknown that nothing asks for is zero.
        terms = np.abs(matrix) @ np.abs(answer) + np.abs(right)
        return answer if np.all(np.abs(right - matrix @ answer) <= BACKWARD_ERROR * terms) else None


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

"""The inverse of a symmetric matrix less some of its rows and columns, by the factors of all of it.

With E the unit vectors of the rows J left out, answers x of A' y = b are those of

    A x + E a = b,    Eᵀx = 0,        x = A⁻¹b − Z S⁻¹ Eᵀ A⁻¹b,    Z = A⁻¹E,   S = EᵀZ,

whatever b is in J. By Sylvester's law of inertia, and as each row left out with its a has one eigenvalue of either
sign, A' has as many negative eigenvalues as A and −S have together, less one for each of them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as sl

from ..typing import Array, IntArray
from .factor import Factor

MOST = 24  # rows left out; by then factors of what is left are soon cheaper
REGULAR = 1e-8  # of the largest eigenvalue of S: what the smallest must be


@dataclass(frozen=True)
class WithoutRows:
    """A'⁻¹ of a real symmetric matrix (n, n) less the rows and columns ``left_out`` (r,), by the factors of A.

    solved: Z (n, r). inertia: number of negative eigenvalues of A', None where the factors do not tell.
    """

    factor: Factor
    left_out: IntArray
    kept: IntArray
    solved: Array
    inertia: int | None

    @classmethod
    def of(cls, factor: Factor, size: int, left_out: IntArray) -> WithoutRows | None:
        """Of the factors of a matrix of ``size`` rows; None where too much is left out, or too little is left."""
        count = len(left_out)
        if count > MOST:
            return None
        solved = np.zeros((size, count))
        solved[left_out, np.arange(count)] = 1.0
        solved = np.asarray(factor.solve(solved))
        values = sl.eigvalsh(_symmetric(solved[left_out]))
        if not np.abs(values).min(initial=np.inf) > REGULAR * np.abs(values).max(initial=0.0):
            return None
        told = factor.inertia
        inertia = None if told is None else told + int(np.count_nonzero(values > 0)) - count
        kept = np.setdiff1d(np.arange(size), left_out)
        return cls(factor, left_out, kept, solved, inertia)

    def solve(self, right: Array, *, refine: bool = True) -> Array:
        """A'⁻¹ b (n − r, k) of right (n − r, k), as `Factor.solve` gives it."""
        whole = np.zeros((len(self.solved), right.shape[1]), dtype=right.dtype)
        whole[self.kept] = right
        answer = self.factor.solve(whole, refine=refine)
        held = np.linalg.solve(self.solved[self.left_out], answer[self.left_out])
        return answer[self.kept] - self.solved[self.kept] @ held


def _symmetric(matrix: Array) -> Array:
    return (matrix + matrix.T) / 2

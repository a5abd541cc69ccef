"""All eigenpairs of small dense problems, shifted to a frequency and inverted there: those of about its size are as
good as can be, and the mass need not be regular."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import scipy.linalg as sl

from ..direct.dense import lu_factors
from ..typing import Array, ComplexArray

Lu = tuple[Any, Any]
Matrix = Any  # dense (r, r), real or complex
Factorise = Callable[[Any], Lu]
Pairs = tuple[ComplexArray, ComplexArray, ComplexArray]


def undamped_pairs(
    mass: Array, stiffness: Array, frequency: float, reach: float, *, factorise: Factorise = lu_factors
) -> Pairs:
    """x = λ² (k,) and right and left vectors (r, k) of (xM + K) z = 0 with |λ| ≤ reach · frequency."""
    shift = frequency**2
    factor = factorise(stiffness + shift * mass)
    theta, left, right = sl.eig(sl.lu_solve(factor, shift * mass), left=True, right=True)
    with np.errstate(all="ignore"):
        x = shift - shift / theta
        chosen = np.flatnonzero(np.isfinite(x) & (np.abs(x) <= (reach * frequency) ** 2))
    return x[chosen], right[:, chosen], transposed_solve(factor, left[:, chosen].conj())


def damped_pairs(
    mass: Matrix, damping: Matrix, stiffness: Matrix, frequency: float, reach: float, *, upper: bool = True,
    factorise: Factorise = lu_factors,
) -> Pairs:  # fmt: skip
    """λ (k,) and right and left vectors (r, k) of (λ²M + λD + K) z = 0 with |λ| ≤ reach · frequency, with ``upper``
    those with Im λ ≥ 0 alone."""
    matrix, factor = companion(mass, damping, stiffness, frequency, factorise=factorise)
    r = len(mass)
    theta, left, right = sl.eig(matrix, left=True, right=True)
    with np.errstate(all="ignore"):
        lam = frequency * (1 + 1 / theta)
        chosen = np.isfinite(lam) & (np.abs(lam) <= reach * frequency)
    chosen = np.flatnonzero(chosen & (lam.imag >= 0) if upper else chosen)
    z = np.where(np.abs(theta[chosen]) > 1, right[:r, chosen], right[r:, chosen])
    return lam[chosen], z, transposed_solve(factor, left[:r, chosen].conj())


def companion(
    mass: Matrix, damping: Matrix, stiffness: Matrix, frequency: float, *, factorise: Factorise = lu_factors
) -> tuple[Matrix, Lu]:
    """The matrix (2r, 2r) whose eigenvalues are θ = 1/(λ/frequency − 1), and the factors of P(frequency)."""
    mass, damping = frequency**2 * mass, frequency * damping
    r = len(mass)
    factor = factorise(mass + damping + stiffness)
    matrix = np.zeros((2 * r, 2 * r), dtype=stiffness.dtype)
    matrix[:r, :r] = -sl.lu_solve(factor, damping + 2 * mass)
    matrix[:r, r:] = -sl.lu_solve(factor, mass)
    matrix[r:, :r] = np.eye(r)
    return matrix, factor


def transposed_solve(factor: Lu, right: Any) -> Any:
    """A⁻ᵀ right; for a real matrix and complex right sides in real arithmetic."""
    if factor[0].dtype.kind == "c" or right.dtype.kind != "c":
        return sl.lu_solve(factor, right, trans=1)
    solved = sl.lu_solve(factor, right.real, trans=1).astype(complex)
    few = np.flatnonzero(np.any(right.imag, axis=0)) if right.ndim > 1 else slice(None)  # of real problems
    solved.imag[..., few] = sl.lu_solve(factor, right.imag[..., few], trans=1)
    return solved

"""All eigenpairs of small problems, by QZ on the scaled companion form."""

from __future__ import annotations

import numpy as np
import scipy.linalg as sl

from ...errors import AnalysisError
from ...stages import passing, stage
from ...typing import ComplexArray
from .problem import Quadratic, times

ALONE = 1e-4  # of the way to the next eigenvalue: by how much one is corrected at most
LONG = 300  # unknowns from which it takes seconds
SMALL = 1e-13  # of the matrices: α and β below it at once are those of a pencil that is singular for every λ


@passing()
def all_modes(problem: Quadratic) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Finite λ (k,) [1/s], right and left vectors (n, k) of unit norm.

    Scaled as Fan, Lin and Van Dooren (2004) do: λ = γμ with γ² = ‖K‖/‖M‖, and all by 2/(‖K‖ + γ‖D‖). Raises
    AnalysisError where det P(λ) is zero for every λ.
    """
    if problem.size >= LONG:
        stage(f"all modes of {problem.size} unknowns, dense", logged=False)
    m, d, k = (np.asarray(a.toarray(), dtype=float) for a in (problem.mass, problem.damping, problem.stiffness))
    sizes = [float(np.linalg.norm(a, 2)) for a in (m, d, k)]
    gamma = float(np.sqrt(sizes[2] / sizes[0])) if sizes[0] > 0 and sizes[2] > 0 else 1.0
    delta = 2 / max(sizes[2] + gamma * sizes[1], gamma**2 * sizes[0], 1e-300)
    m, d, k = gamma**2 * delta * m, gamma * delta * d, delta * k
    n = problem.size
    one, none = np.eye(n), np.zeros((n, n))
    left_side, right_side = np.block([[-d, -k], [one, none]]), np.block([[m, none], [none, one]])
    (alpha, beta), left, right = sl.eig(left_side, right_side, left=True, homogeneous_eigvals=True)
    if (np.hypot(np.abs(alpha), np.abs(beta)) < SMALL).any():
        raise AnalysisError("the quadratic problem is singular for every λ: some motion has no mass, damping or spring")
    finite = np.abs(beta) > SMALL * np.abs(alpha)
    mu = alpha[finite] / beta[finite]
    upper = np.abs(mu) >= 1
    x = np.where(upper, right[:n, finite], right[n:, finite])
    x, y = unit(x), unit(left[:n, finite].conj())
    return _tuned(problem, gamma * mu, x, y), x, y


def _tuned(problem: Quadratic, lam: ComplexArray, x: ComplexArray, y: ComplexArray) -> ComplexArray:
    """Eigenvalues with the rest that QZ leaves taken off, yᵀP(λ)x / yᵀP'(λ)x: of slow modes of stiff matrices QZ knows
    some eight digits, its vectors give all. Not where another is so near that the vectors are not its own."""
    rest = np.einsum("ij,ij->j", y, problem.residual(lam, x))
    slope = np.einsum("ij,ij->j", y, 2 * lam * times(problem.mass, x) + times(problem.damping, x))
    with np.errstate(divide="ignore", invalid="ignore"):
        change = rest / slope
    gaps = np.abs(lam[:, None] - lam)
    np.fill_diagonal(gaps, np.inf)
    sure = np.isfinite(change) & (np.abs(change) <= ALONE * gaps.min(axis=1, initial=np.inf))
    return np.where(sure, lam - np.where(sure, change, 0.0), lam)


def unit(x: ComplexArray) -> ComplexArray:
    """Columns of unit norm."""
    return x / np.maximum(np.linalg.norm(x, axis=0), 1e-300)

"""Single eigenpairs with both vectors by two-sided inverse iteration: one factorisation beside the eigenvalue.

Residual inverse iteration (Neumaier, SIAM J. Numer. Anal. 22 (1985) 914–923) for the right vector, with the same
factors transposed for the left one, and the two-sided Rayleigh functional for λ: yᵀP(λ)x = 0, whose error is the
product of the vectors' errors.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..direct import SingularMatrix, factorise
from ..typing import ComplexArray
from .quadratic.problem import Quadratic

STEPS = 20
CONVERGED = 1e-14  # change of λ, relative, at which the iteration ends
BESIDE = (1e-8, 1e-7, 1e-6, 1e-5)  # of λ: how far beside it P is factorised where one singular there does not serve
NULL_STEPS = 3
HAIRS = (1e-8, 1e-6, 1e-4)  # of λ: how far beside it P is factorised
STALLED = 1e-11  # and below which it ends as soon as changes do not become smaller


@dataclass(frozen=True)
class Iterated:
    """λ [1/s] with right and left vectors (n,) of unit length, slope yᵀP'(λ)x, and the last change of λ."""

    lam: complex
    right: ComplexArray
    left: ComplexArray
    slope: complex
    change: float


def two_sided(
    problem: Quadratic, lam: complex, right: ComplexArray | None, left: ComplexArray | None, *, beside: complex,
    solver: str | None = None,
) -> Iterated | None:  # fmt: skip
    """The eigenpair near λ, from vectors near its own or from arbitrary ones (None), P factorised at λ + ``beside``.

    None where it does not settle. Raises SingularMatrix where P is singular there too.
    """
    random = np.random.default_rng(0)
    x, y = (random.standard_normal(problem.size) + 0j if v is None else v for v in (right, left))
    last, size, slope = np.inf, np.inf, 0j
    with factorise(problem.at(lam + beside), saddle=True, solver=solver) as factor, np.errstate(all="ignore"):
        x = factor.solve(problem.slope(lam, x))
        y = factor.solve(problem.transposed.slope(lam, y), transpose=True)
        for step in range(STEPS):
            x, y = x / np.linalg.norm(x), y / np.linalg.norm(y)
            slope = complex(y @ problem.slope(lam, x))
            if slope == 0 or not np.isfinite(slope):
                return None
            change = -complex(y @ problem.applied(lam, x)) / slope
            lam = lam + change
            if not np.isfinite(lam):
                return None
            size = abs(change)
            if step > 2 and (size <= CONVERGED * abs(lam) or (size < STALLED * abs(lam) and size >= last)):
                break
            last = min(last, size)
            x = x - factor.solve(problem.applied(lam, x))
            y = y - factor.solve(problem.transposed.applied(lam, y), transpose=True)
    return Iterated(lam, x / np.linalg.norm(x), y / np.linalg.norm(y), complex(slope), size)


def solved_beside(
    problem: Quadratic, lam: complex, right: ComplexArray | None, left: ComplexArray | None, *,
    solver: str | None = None,
) -> Iterated | None:  # fmt: skip
    """The same, P factorised ever further beside λ where it is singular nearer to it; None where it is at all of them,
    too."""
    for part in BESIDE:
        try:
            return two_sided(problem, lam, right, left, beside=part * lam, solver=solver)
        except SingularMatrix:
            continue
    return None


def null_vectors(problem: Quadratic, lam: complex) -> tuple[ComplexArray, ComplexArray] | None:
    """Right and left vectors (n,) of unit length that P(λ) takes nearest to zero, λ simple or double; None where P is
    singular beside λ, too."""
    random = np.random.default_rng(0)
    x, y = random.standard_normal((2, problem.size)) + 0j
    for hair in HAIRS:
        beside = lam * (1 + hair) if lam else hair * _rate(problem)
        try:
            with factorise(problem.at(beside), saddle=True) as factor:
                for _ in range(NULL_STEPS):
                    # The smallest singular values, which eigenvalues that meet have as well.
                    x = factor.solve(factor.solve(x.conj(), transpose=True, refine=False).conj(), refine=False)
                    y = factor.solve(factor.solve(y.conj(), refine=False).conj(), transpose=True, refine=False)
                    x, y = x / np.linalg.norm(x), y / np.linalg.norm(y)
        except SingularMatrix:
            continue
        return x, y
    return None


def _rate(problem: Quadratic) -> float:
    """A typical |λ| [1/s] of the stiffest parts."""
    size = float(np.abs(problem.mass.data).max(initial=0.0))
    return float(np.sqrt(np.abs(problem.stiffness.data).max(initial=0.0) / size)) if size else 1.0

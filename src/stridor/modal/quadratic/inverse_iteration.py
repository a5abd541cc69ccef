"""Single eigenpairs with both vectors by two-sided inverse iteration: one factorisation beside the eigenvalue.

Residual inverse iteration (Neumaier, SIAM J. Numer. Anal. 22 (1985) 914–923) for the right vector, with the same
factors transposed for the left one, and the two-sided Rayleigh functional for λ: yᵀP(λ)x = 0, whose error is the
product of the vectors' errors.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Protocol

import numpy as np

from ...direct import SingularMatrix, factorise
from ...typing import Array, ComplexArray
from .problem import Quadratic, times

STEPS = 20
FEWEST = 4  # values of λ before it ends: from arbitrary vectors the first ones may be alike by chance
CONVERGED = 1e-14  # change of λ, relative, at which the iteration ends
STALLED = 1e-11  # and below which it ends as soon as changes do not become smaller
# Of λ: how far beside it P is factorised, where one singular nearer to it does not do.
BESIDE = (1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3)
NULL_STEPS = 3


class Factors(Protocol):
    """A factorised matrix."""

    def solve(self, right: ComplexArray, *, transpose: bool = False) -> ComplexArray:
        """A⁻¹ right, or A⁻ᵀ right (never conjugated)."""
        ...


@dataclass(frozen=True)
class Iterated:
    """λ [1/s] with right and left vectors (n,) of unit length, slope yᵀP'(λ)x, and the last change of λ."""

    lam: complex
    right: ComplexArray
    left: ComplexArray
    slope: complex
    change: float

    def residual(self, problem: Quadratic) -> Array:
        """Backward errors (2,) of the right and of the left vector."""
        lam, sides = np.array([self.lam]), ((problem, self.right), (problem.transposed, self.left))
        return np.array([float(side.backward_error(lam, v[:, None])[0]) for side, v in sides])


def two_sided(
    problem: Quadratic, lam: complex, right: ComplexArray | None, left: ComplexArray | None, *, beside: complex,
    solver: str | None = None,
) -> Iterated | None:  # fmt: skip
    """The eigenpair near λ, from vectors near its own or from arbitrary ones (None), P factorised at λ + ``beside``.

    None where it does not settle. Raises SingularMatrix where P is singular there too.
    """
    random = np.random.default_rng(0)
    x, y = (random.standard_normal(problem.size) + 0j if v is None else v for v in (right, left))
    with factorise(problem.at(lam + beside), saddle=True, solver=solver) as factor:
        return iterated(problem, factor, lam, x, y)


def iterated(
    problem: Quadratic, factor: Factors, lam: complex, x: ComplexArray, y: ComplexArray, *, fewest: int = FEWEST
) -> Iterated | None:
    """The eigenpair near λ with the factors of P beside it. Ends where λ changes no more, by CONVERGED of it, once it
    has been computed ``fewest`` times: 2 do from vectors near its own. None where it does not settle."""
    last, size, slope = np.inf, np.inf, 0j
    with np.errstate(all="ignore"):
        x = factor.solve(problem.slope(lam, x))
        y = factor.solve(problem.transposed.slope(lam, y), transpose=True)
        for step in range(1, STEPS + 1):
            x, y = x / np.linalg.norm(x), y / np.linalg.norm(y)
            of_mass, of_damping, of_stiffness = _images(problem, x)
            slope = complex(y @ (2 * lam * of_mass + of_damping))
            if slope == 0 or not np.isfinite(slope):
                return None
            change = -complex(y @ (lam * (lam * of_mass + of_damping) + of_stiffness)) / slope
            lam = lam + change
            if not np.isfinite(lam):
                return None
            size = abs(change)
            if step >= fewest and (size <= CONVERGED * abs(lam) or (size < STALLED * abs(lam) and size >= last)):
                break
            last = min(last, size)
            x = x - factor.solve(lam * (lam * of_mass + of_damping) + of_stiffness)
            of_mass, of_damping, of_stiffness = _images(problem.transposed, y)
            y = y - factor.solve(lam * (lam * of_mass + of_damping) + of_stiffness, transpose=True)
    return Iterated(lam, x / np.linalg.norm(x), y / np.linalg.norm(y), slope, size)


def _images(problem: Quadratic, x: ComplexArray) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Mx, Dx and Kx (n,)."""
    return times(problem.mass, x), times(problem.damping, x), times(problem.stiffness, x)


def solved_beside(
    problem: Quadratic, lam: complex, right: ComplexArray | None, left: ComplexArray | None, *,
    parts: Sequence[float] = BESIDE, solver: str | None = None,
) -> Iterated | None:  # fmt: skip
    """The same, P factorised ever further beside λ where it is singular nearer to it; None where it is at all of them,
    too."""
    for beside in _beside(problem, lam, parts):
        try:
            return two_sided(problem, lam, right, left, beside=beside, solver=solver)
        except SingularMatrix:
            continue
    return None


def null_vectors(problem: Quadratic, lam: complex) -> tuple[ComplexArray, ComplexArray] | None:
    """Right and left vectors (n,) of unit length that P(λ) takes nearest to zero, λ simple or double; None where P has
    no factors beside λ, either."""
    random = np.random.default_rng(0)
    x, y = random.standard_normal((2, problem.size)) + 0j
    # Beside a slow double root of a stiff structure P is singular to working precision farther out than it is known by
    # its vectors. They are the ones asked for, so that such factors serve where there are no others.
    for tried, beside in product((True, False), list(_beside(problem, lam, BESIDE[::2]))):
        try:
            with factorise(problem.at(lam + beside), saddle=True, tried=tried) as factor:
                for _ in range(NULL_STEPS):
                    # The smallest singular values, which eigenvalues that meet have as well.
                    x = factor.solve(factor.solve(x.conj(), transpose=True, refine=False).conj(), refine=False)
                    y = factor.solve(factor.solve(y.conj(), refine=False).conj(), transpose=True, refine=False)
                    x, y = x / np.linalg.norm(x), y / np.linalg.norm(y)
        except SingularMatrix:
            continue
        return x, y
    return None


def _beside(problem: Quadratic, lam: complex, parts: Sequence[float]) -> Iterator[complex]:
    """Distances from λ, ``parts`` of it, or where it is zero of a typical |λ| [1/s] of the stiffest parts."""
    rate = lam
    if not lam:
        size = float(np.abs(problem.mass.data).max(initial=0.0))
        rate = float(np.sqrt(np.abs(problem.stiffness.data).max(initial=0.0) / size)) if size else 1.0
    return (part * rate for part in parts)

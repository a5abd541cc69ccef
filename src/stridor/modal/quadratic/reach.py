"""How fast anything in a problem can move, and with it how much of a band there is to be searched.

Squares of eigenvalues are found with a shift of the size of the band, and to about 1e-16 of it. Where a band reaches
far beyond everything that a model has (masses and springs of order one under the default of 40 kHz) nothing would be
left of their digits. Such a band is searched as far as there can be eigenvalues, which loses none.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.linalg as sl
import scipy.sparse as sp

from ...typing import Sparse
from .problem import Quadratic

BETWEEN = 2.0  # times the bounds at points of a family
BEYOND = 4.0  # times the bound: half of it, where searches end for modes that decay, is beyond it still
UNSURE = 100.0  # the same where freedoms without mass carry forces: rigid contacts with friction make others faster
CLEAR = 0.05  # share of the mass's diagonal that its other entries must leave to tell its smallest eigenvalue
LEAST = 1e-3  # share below which nothing is concluded
SMALL = 600  # freedoms up to which that eigenvalue is computed


def searched(problem: Quadratic, top: float) -> float:
    """Angular frequency [1/s] up to which a band that ends at ``top`` is to be searched: top where nothing is known."""
    bound = fastest(problem)
    margin = BEYOND if np.all(problem.mass.diagonal() > 0.0) else UNSURE
    return min(top, margin * bound) if bound > 0.0 else top


def searched_in(problems: Sequence[Quadratic], top: float) -> float:
    """The same of all of a family that some of its problems stand for."""
    if not problems or reaches(problems[0], top):
        return top
    return min(top, BETWEEN * max(searched(problem, np.inf) for problem in problems))


def reaches(problem: Quadratic, top: float) -> bool:
    """Whether something moves about as fast as ``top`` [1/s] or faster, as far as single freedoms show."""
    mass, stiffness = problem.mass.diagonal(), problem.stiffness.diagonal()
    return bool(np.any(np.abs(stiffness) >= (top / BEYOND) ** 2 * mass))


def fastest(problem: Quadratic) -> float:
    """Upper bound [1/s] of |λ|, of the freedoms that have mass; inf where none is known.

    With x of unit norm and everything scaled to a mass of unit diagonal whose smallest eigenvalue is θ,
    0 = x*(λ²M + λD + K)x gives θ|λ|² ≤ ‖D‖|λ| + ‖K‖.
    """
    diagonal = problem.mass.diagonal()
    moving = np.flatnonzero(diagonal > 0.0)
    if not len(moving) or np.any(diagonal < 0.0):
        return np.inf
    unit = sp.diags_array(1.0 / np.sqrt(diagonal[moving]))
    with np.errstate(over="ignore", invalid="ignore"):  # next to no mass: what it carries is as fast as anything
        mass, damping, stiffness = (
            sp.csr_array(unit @ sp.csr_array(matrix)[moving][:, moving] @ unit)
            for matrix in (problem.mass, problem.damping, problem.stiffness)
        )
        least = _least(mass)
        if not least >= LEAST:
            return np.inf
        rate, square = _norm(damping) / least, _norm(stiffness) / least
        bound = float(rate + np.sqrt(rate**2 + 4 * square)) / 2
    return bound if np.isfinite(bound) else np.inf


def _least(mass: Sparse) -> float:
    """A lower bound of the smallest eigenvalue of a mass with unit diagonal, NaN where it is not symmetric."""
    beside = float((abs(mass).sum(axis=1) - 1.0).max())
    if 1.0 - beside >= CLEAR:
        return 1.0 - beside
    if mass.shape[0] > SMALL:
        return 0.0
    dense = mass.toarray()
    return float(sl.eigvalsh(dense)[0]) if np.allclose(dense, dense.T, rtol=0.0, atol=1e-9) else np.nan


def _norm(matrix: Sparse) -> float:
    """A bound of the spectral norm."""
    size = abs(matrix)
    return float(np.sqrt(size.sum(axis=0).max(initial=0.0) * size.sum(axis=1).max(initial=0.0)))

"""How many eigenvalues of a symmetric matrix are negative, by the signs of its pivots (Sylvester's law of inertia)."""

from __future__ import annotations

import time

import numpy as np
import scipy.sparse as sp

from ..typing import Sparse
from .backends import choose
from .factor import Factor, Sizes, factorise, largest_entries, require_regular
from .interface import Breakdown
from .superlu_backend import SuperluFactor

TRUSTED = 1e-9  # backward error up to which pivots from the diagonal alone, however small, are those of the matrix


def negative_eigenvalues(matrix: Sparse, *, saddle: bool = False, solver: str | None = None) -> int | None:
    """The number of negative eigenvalues of a real symmetric matrix (n, n); None where no solver at hand tells.

    saddle and solver are those of `factorise`. Raises SingularMatrix where one of them is zero.
    """
    factor = counting_factor(matrix, saddle=saddle, solver=solver)
    if factor is None:
        return None
    with factor:
        return factor.inertia


def counting_factor(matrix: Sparse, *, saddle: bool = False, solver: str | None = None) -> Factor | None:
    """Factors of a real symmetric matrix (n, n) that tell its inertia; None where no solver at hand makes them.

    saddle and solver are those of `factorise`, and what is raised.
    """
    pivoting = choose(solver) != "superlu"
    if not pivoting:  # which takes pivots off the diagonal where contacts are, and says nothing then
        straight = _straight(matrix, saddle)
        if straight is not None:
            return straight
    factor = factorise(matrix, symmetric=True, saddle=saddle, solver=solver)
    if factor.inertia is not None:
        return factor
    factor.free()
    return _straight(matrix, saddle) if pivoting else None


def _straight(matrix: Sparse, saddle: bool) -> Factor | None:
    """Factors with pivots of the diagonal, however small; None where they lose the digits. Raises SingularMatrix."""
    held = sp.csr_array(matrix, dtype=float)
    started = time.perf_counter()
    try:
        backend = SuperluFactor(held, symmetric=True, saddle=saddle, pivots=0.0)
    except Breakdown:
        return None
    # Without exchanges elimination may lose all digits; then what it answers shows it.
    right = np.random.default_rng(4).standard_normal((held.shape[0], 1))
    with np.errstate(all="ignore"):
        error = Sizes.of(held).residual(held, right, backend.solve(right, False))[1]
    if not error <= TRUSTED or backend.inertia is None:
        backend.free()
        return None
    factor = Factor(held, backend, "superlu", started, largest_entries(held), symmetric=True)
    try:
        told = factor.unresisted()
    except Breakdown:
        return None
    require_regular(factor, *told)
    return factor

"""How many eigenvalues of a symmetric matrix are negative, by the signs of its pivots (Sylvester's law of inertia)."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from ..typing import Sparse
from .factor import Sizes, factorise
from .interface import Breakdown
from .superlu_backend import SuperluFactor

TRUSTED = 1e-9  # backward error up to which pivots from the diagonal alone, however small, are those of the matrix


def negative_eigenvalues(matrix: Sparse, *, saddle: bool = False, solver: str | None = None) -> int | None:
    """The number of negative eigenvalues of a real symmetric matrix (n, n); None where no solver at hand tells.

    saddle and solver are those of `factorise`. Raises SingularMatrix where one of them is zero.
    """
    with factorise(matrix, symmetric=True, saddle=saddle, solver=solver) as factor:
        if factor.inertia is not None:
            return factor.inertia
    held = sp.csr_array(matrix, dtype=float)
    try:
        straight = SuperluFactor(held, symmetric=True, saddle=saddle, pivots=0.0)
    except Breakdown:
        return None
    told = straight.inertia
    right = np.random.default_rng(4).standard_normal((held.shape[0], 1))
    # Without exchanges elimination may lose all digits; then what it answers shows it.
    error = Sizes.of(held).residual(held, right, straight.solve(right, False))[1]
    straight.free()
    return told if error <= TRUSTED else None

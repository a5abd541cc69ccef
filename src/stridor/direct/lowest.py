"""Modes of a symmetric pencil up to a frequency, by inverse iteration in a Krylov space."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import scipy.linalg as sl
import scipy.sparse.linalg as ssl

from ..errors import AnalysisError
from ..typing import Array, Sparse

DENSE = 400


def modes_below(
    stiffness: Sparse, mass: Sparse, solve: Callable[[Any], Any], shift: float, frequency: float, most: int,
    *, expected: int = 40, tolerance: float = 0.0,
) -> Array:  # fmt: skip
    """Modes (n, k) of (K, M) up to a frequency [1/s]; solve: by K + shift M, shift [1/s²] ≥ 0; expected: how many they
    may be, tolerance: of their squares, relative, 0 for rounding. Raises AnalysisError for more than ``most``."""
    n = stiffness.shape[0]
    if n <= DENSE:
        squares, shapes = sl.eigh(stiffness.toarray(), mass.toarray())
        return shapes[:, squares <= frequency**2]
    inverse = ssl.LinearOperator((n, n), matvec=solve, dtype=float)  # type: ignore[arg-type]
    begin = np.random.default_rng(3).standard_normal(n)  # the same digits each time
    count = expected
    while True:
        squares, shapes = ssl.eigsh(
            stiffness, k=min(count, n - 2), M=mass, sigma=-shift, OPinv=inverse, tol=tolerance, v0=begin
        )
        if squares.max() > frequency**2 or count >= n - 2:
            return shapes[:, squares <= frequency**2]
        if count >= most:
            raise AnalysisError(f"more than {most} modes up to the frequency; take a lower one")
        count *= 2

"""Eigenpairs of small dense quadratic problems."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np
import scipy.linalg as sl

from ...errors import AnalysisError
from ...typing import Array, ComplexArray
from ..shift_inverted import damped_pairs
from .from_undamped import Matrices, modes_by_undamped, unit


@dataclass(frozen=True)
class DenseModes:
    """λ (k,) with Im λ ≥ 0 ascending, right and left vectors (r, k) of unit length, yᵀP(λ) = 0. whole: whether it took
    the whole companion matrix, or would have without `states`."""

    values: ComplexArray
    right: ComplexArray
    left: ComplexArray
    whole: bool = True


def dense_modes(
    mass: Array, damping: Array, stiffness: Array, frequency: float, reach: float, *, whole: bool = False
) -> DenseModes:
    """Eigenpairs of (λ²M + λD + K) z = 0 with |λ| ≤ reach · frequency [1/s]; real λ of either sign are among them.

    whole: take the whole companion matrix at once, where damping is known to be too strong for anything cheaper. Raises
    AnalysisError where the matrices are singular or not finite.
    """
    with np.errstate(all="ignore"):
        try:
            pairs = None if whole else modes_by_undamped(mass, damping, stiffness, frequency, reach)
            whole = pairs is None
            lam, right, left = damped_pairs(mass, damping, stiffness, frequency, reach) if pairs is None else pairs
        except (ValueError, sl.LinAlgError) as error:
            raise AnalysisError("the reduced problem is singular or not finite; check the parameters") from error
    order = np.lexsort((lam.real, lam.imag))
    return DenseModes(lam[order], unit(right[:, order]), unit(left[:, order]), whole)


@lru_cache(64)
def _alike(powers: bytes, kind: str) -> list[tuple[int, int]]:
    """From where to where neighbouring terms are on the same power of λ."""
    starts = np.flatnonzero(np.diff(np.frombuffer(powers, dtype=kind), prepend=-1)).tolist()
    return list(pairwise([*starts, len(powers) // np.dtype(kind).itemsize]))


def made_of(projected: Array, factors: Array, powers: Array, lam: complex) -> Array:
    """What the entries (r, r) of P(λ) are made of: sizes of the terms, not of a sum in which they may cancel."""
    mass, damping, stiffness = assembled(np.abs(projected), np.abs(factors), powers)
    return np.asarray(abs(lam) ** 2 * mass + abs(lam) * damping + stiffness)


def assembled(projected: Array, factors: Array, powers: Array) -> Matrices:
    """M, D and K (r, s), or what else goes with each power of λ, from projected terms (t, r, s)."""
    mass, damping, stiffness = assembled_each(projected, (factors,), powers)[0]
    return mass, damping, stiffness


def assembled_each(projected: Array, chosen: Sequence[Array], powers: Array) -> Array:
    """`assembled` (c, 3, r, s) with each of several factors (t,), in one pass through the terms, which are more than
    the cache holds: those on one power of λ that follow one another together."""
    flat = projected.reshape(len(projected), -1)
    several = np.stack(chosen)
    total = np.zeros((len(several), 3, flat.shape[1]))
    for start, end in _alike(powers.tobytes(), powers.dtype.str):
        # A product of one row goes by BLAS's routine for vectors, which copies nothing.
        part = several[0, start:end] @ flat[start:end] if len(several) == 1 else several[:, start:end] @ flat[start:end]
        total[:, 2 - powers[start]] += part
    return total.reshape(-1, 3, *projected.shape[1:])

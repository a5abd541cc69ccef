"""Which mode is which from one μ to the next: numbers of branches for eigenvalues found at each μ alone.

Branches are followed from μ = 0 on a basis (`basis`), and eigenvalues found in full take the number of the
branch that they lie on. Where branches cannot be told apart nothing is guessed: numbers count by frequency then.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...errors import AnalysisError
from ...threads import one_thread
from ...typing import Array, ComplexArray, IntArray
from ..at_rest import double_zeros, moving
from ..krylov.follow import BranchState
from ..quadratic.polish import pairs
from .basis import DECAY, Along, along
from .family import Family, SystemFamily
from .follow import BEYOND, surely

NEAR = 1e-4  # of the band: how far from its branch an eigenvalue may lie


@dataclass(frozen=True)
class BranchNumbers:
    """Numbers from 1 (k,) of the eigenvalues at each μ, and what is to be said about them."""

    of: list[IntArray]
    sentence: str


def numbered(
    family: SystemFamily, mu: Array, values: list[ComplexArray], top: float, unfollowed: str = "",
    source: Along | None = None,
) -> BranchNumbers:  # fmt: skip
    """Numbers of eigenvalues (k,) sorted by frequency at each of the friction coefficients ``mu``; 0 for those that say
    nothing new, of ±ε that rounding makes of a motion as a whole. unfollowed: why nothing is to be followed. source: of
    the eigenpairs that are followed, where there is one."""
    plain = [_by_frequency(family, v, top) for v in values]
    if not float(mu.max()) > 0:
        return BranchNumbers(plain, "")
    if family.low >= family.high:
        return BranchNumbers(plain, " Numbers count by frequency: factors have no value at μ = 0.")
    if not family.depends:
        return BranchNumbers(plain, "")
    try:
        if not unfollowed:
            return _followed(family, mu, values, top, source)
    except AnalysisError as error:
        unfollowed = str(error)
    said = f" Numbers count by frequency at each μ, since branches were not followed: {unfollowed}."
    return BranchNumbers(plain, said)


def _by_frequency(family: SystemFamily, values: ComplexArray, top: float) -> IntArray:
    rest = at_rest(family, values, top)
    of: IntArray = np.zeros(len(values), dtype=np.int64)
    of[rest[: double_zeros(values[rest])]] = 1
    of[np.setdiff1d(np.arange(len(values)), rest)] = 1
    return np.cumsum(of) * of


def at_rest(family: Family, values: ComplexArray, top: float) -> IntArray:
    """Places of eigenvalues that are motions as a whole."""
    return np.flatnonzero(~moving(values, top, lambda: family.rest_limit(top)))


@one_thread
def _followed(
    family: SystemFamily, mu: Array, values: list[ComplexArray], top: float, source: Along | None
) -> BranchNumbers:
    source = source or along(family, BEYOND * top)
    if source.whole and len(mu) == 1:
        raise AnalysisError("that takes full solves on the way from μ = 0, worth while for several μ only")
    way = surely(source)
    start = way.state
    rest = source.at_rest
    own = _ranks(start, top) + rest
    of: list[IntArray] = [np.zeros(len(v), dtype=np.int64) for v in values]
    most = int(own.max(initial=rest))
    for k in np.argsort(mu, kind="stable"):
        state = way.advance(float(mu[k]) - family.low)
        most = max(most, _assign(source, state, own, values[k], of[k], top, most))
    low = f"μ = {family.low:g}"
    return BranchNumbers(of, f" Numbers are those by frequency at {low}, from where branches were followed.")


def _ranks(start: BranchState, top: float) -> IntArray:
    """Numbers from 1 (b,) of the branches where they begin: those of the band by frequency, then the others."""
    values = start.values
    inside = (values.imag <= top * (1 + 1e-12)) & (values.real >= -DECAY * top)
    order = np.lexsort((values.real, np.round(values.imag / top, 12), ~inside))
    rank = np.empty(len(order), dtype=np.int64)
    rank[order] = np.arange(1, len(order) + 1)
    return rank


def _assign(
    source: Along, state: BranchState, own: IntArray, values: ComplexArray, of: IntArray, top: float, most: int
) -> int:
    """Number the eigenvalues at one μ in place; returns the largest number used so far."""
    still = at_rest(source.family, values, top) if source.at_rest else np.zeros(0, dtype=np.int64)
    of[still[: source.at_rest]] = np.arange(1, len(still[: source.at_rest]) + 1)
    rest = np.setdiff1d(np.arange(len(values)), still)
    ours, theirs = pairs(values[rest], state.values, NEAR * top)
    of[rest[ours]] = own[theirs]
    for index in rest[of[rest] == 0]:
        # Born where a pair fell apart on the real axis, or come from far above.
        most += 1
        of[index] = most
    return most

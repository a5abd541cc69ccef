"""Passages into and out of growth, solved in the full problem from better and better guesses."""

from __future__ import annotations

import warnings
from collections.abc import Generator, Iterator
from contextlib import contextmanager

import numpy as np
import scipy.linalg as sl

from ...typing import ComplexArray
from ..krylov.crossing import crossing as reduced_crossing
from ..krylov.double import pair_near
from ..krylov.follow import BranchState, Follower
from ..krylov.passages import Passage
from ..krylov.undamped import COMPLEX
from ..newton import Root, crossing, meeting, standstill
from ..tolerances import AT_REST, UNSTABLE_RELATIVE
from .basis import Along, OnBasis

TRIES = 12
Guess = tuple[float, complex, ComplexArray, ComplexArray]


def located(source: Along, passage: Passage) -> tuple[Root, float] | None:
    """The onset of a passage in the full problem, and t = μ − low of the guess that led to it; None where none is."""
    family = source.family
    between = family.low + passage.low, family.low + passage.high
    slack = 0.05 * (passage.high - passage.low)
    for t, lam, x, y in _guesses(source, passage):
        mu = family.low + t
        still, slow = passage.kind == "divergence", abs(lam) <= AT_REST * source.frequency
        if still or (slow and abs(lam) <= family.rest_limit(source.frequency)):
            root = standstill(family, mu, x, y, between)
        elif passage.kind == "meeting":
            root = meeting(family, mu, lam, x, y, between)
        else:
            # Modes that nothing damps may meet on the axis beside others that are damped.
            root = crossing(family, mu, lam, x, y, between) or meeting(family, mu, lam, x, y, between)
            if root is None and slow:
                root = standstill(family, mu, x, y, between)
        if root is None or not between[0] - slack <= root.mu <= between[1] + slack:
            continue
        ends = root.slope < 0 if root.slope is not None else (root.square or 0.0) < 0
        near = max(0.05 * abs(lam), AT_REST * source.frequency if still or root.lam == 0 else 0.0)
        if ends == passage.stabilising and abs(root.lam.imag - lam.imag) <= near:
            return root, t
    return None


@contextmanager
def quiet() -> Generator[None]:
    """Matrices that are exactly singular at an eigenvalue are none of the user's concern."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sl.LinAlgWarning)
        yield


def _guesses(source: Along, passage: Passage) -> Iterator[Guess]:
    """t, λ and vectors of the full problem, better and better."""
    if passage.kind == "crossing":
        if isinstance(source, OnBasis):
            with quiet():
                found = reduced_crossing(source, passage)
            if found is not None:
                right, left = source.null_vectors(found.lam, found.mu)
                x, y = (v[:, None] for v in (right, left))
                yield _expanded(source, found.mu, found.lam, x, y)
        yield from _by_rate(source, passage)
    else:
        yield from _by_square(source, passage)


def _by_rate(source: Along, passage: Passage) -> Iterator[Guess]:
    """Where the growth rate of the branch would vanish if it were straight, again and again."""
    state = Follower.resumed(source, passage.old).advance(passage.low)
    low, high = passage.low, passage.high
    end = Follower.resumed(source, state).advance(high)
    first, last = (float(s.values[passage.branch].real) for s in (state, end))
    rounding = UNSTABLE_RELATIVE * abs(end.values[passage.branch])
    if min(abs(first), abs(last)) <= rounding:
        # On the axis up to rounding, whichever sign that has given it.
        first, last = (-last, last) if abs(first) < abs(last) else (first, -first)
    for _ in range(TRIES):
        if first * last > 0 or high <= low:
            return
        part = first / (first - last) if first != last else 0.5
        t = low + float(np.clip(part, 0.05, 0.95)) * (high - low)
        new = Follower.resumed(source, state).advance(t)
        index, rate = int(new.index[passage.branch]), float(new.values[passage.branch].real)
        yield _guess(source, new, index, t)
        if abs(rate) <= rounding:
            rate = first
        if rate * first > 0:
            low, first, state = t, rate, new
        else:
            high, last = t, rate


def _by_square(source: Along, passage: Passage) -> Iterator[Guess]:
    """Where the squared half difference of two eigenvalues, or an eigenvalue λ² itself, would pass zero."""
    low, high = passage.low, passage.high
    width = high - low

    def sampled(t: float) -> tuple[float, int]:
        found = source.eigenpairs(t)
        if not len(found.coordinate):
            return float("nan"), 0
        if passage.kind == "divergence":
            index = int(np.argmin(np.abs(found.coordinate)))
            return float(found.coordinate[index].real), index
        part = (t - passage.low) / width
        guess = (1 - part) * passage.means[0] + part * passage.means[1]
        return float(pair_near(found.coordinate, guess)[1].real), int(np.argmin(np.abs(found.coordinate - guess)))

    first, last = sampled(low)[0], sampled(high)[0]
    if np.isnan(first) or np.isnan(last):
        return  # nothing is left in the band there: an eigenvalue that passes through infinity
    rounding = (COMPLEX * source.frequency**2) ** (2 if passage.kind == "meeting" else 1)
    if first * last > 0 and min(abs(first), abs(last)) <= rounding:
        # It passes zero at the very end, whichever sign rounding has given it there.
        first, last = (-last, last) if abs(first) < abs(last) else (first, -first)
    for k in range(TRIES):
        if first * last > 0 or high <= low:
            return
        part = first / (first - last) if first != last else 0.5
        t = low + float(np.clip(part, 0.02, 0.98)) * (high - low)
        value, index = sampled(t)
        if np.isnan(value):
            return
        # On a basis another look costs nothing beside a step in the full problem.
        if source.whole or k >= 3 or abs(value) <= 1e-6 * max(abs(first), abs(last)):
            found = source.eigenpairs(t)
            lam = complex(found.values[index])
            if passage.kind == "meeting":
                part = (t - passage.low) / width
                guess = (1 - part) * passage.means[0] + part * passage.means[1]
                lam = 1j * float(np.sqrt(max(-pair_near(found.coordinate, guess)[0].real, 0.0)))
            x, y = found.right[:, [index]], found.left[:, [index]]
            yield _expanded(source, t, lam, x, y)
        if value * first > 0:
            low, first = t, value
        else:
            high, last = t, value


def _guess(source: Along, state: BranchState, index: int, t: float) -> Guess:
    found = state.found
    return _expanded(source, t, complex(found.values[index]), found.right[:, [index]], found.left[:, [index]])


def _expanded(source: Along, t: float, lam: complex, x: ComplexArray, y: ComplexArray) -> Guess:
    return t, lam, source.vectors(x, t)[:, 0], source.vectors(y, t, left=True)[:, 0]

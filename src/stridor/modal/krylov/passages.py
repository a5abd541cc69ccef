"""Changes of stability between two neighbouring states of followed branches."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np

from ...typing import Array, BoolArray, ComplexArray
from ..dense_problem import OverNumber
from ..meeting import partner_of
from ..tolerances import SPLIT_RELATIVE
from .follow import COINCIDENT, BranchState, halves
from .undamped import COMPLEX, Squares, mirrored, on_axis, rounding, squared, squares_of, undamped

TOUCHING = 0.05  # squared half differences that come down to this part of their ends are looked at closely
PROBES = 4
STILL = 1e-12  # growth rate over |λ| that is rounding


@dataclass(frozen=True)
class Passage:
    """A change of stability between two μ, low < high: of a branch and its partner, counted from 0.

    kind: "meeting" of two undamped modes, of which the branch grows, undamped "divergence", or "crossing" of the axis
    with damping. means: the mean of the two meeting λ² at both ends. old: the state at or before ``low``.
    """

    kind: Literal["meeting", "divergence", "crossing"]
    low: float
    high: float
    branch: int
    partner: int
    stabilising: bool
    means: tuple[complex, complex]
    old: BranchState


def passages(source: OverNumber, old: BranchState, new: BranchState) -> list[Passage]:
    """Changes of stability between two states: of modes that nothing damps where they meet or come to rest, whatever
    damps others, of these where they cross the axis."""
    if not source.damped:
        return meetings(source, old, new)
    alone = undamped(source, old, new)
    met = meetings(source, old, new, among=alone) if alone.any() else []
    return met + [p for p in crossings(old, new) if not alone[p.branch]]


def crossings(old: BranchState, new: BranchState) -> list[Passage]:
    """Zeros of the growth rates between two states, by the cubic through rates and slopes at both ends: it sees a mode
    that grows and decays again in between."""
    step = new.mu - old.mu
    found: list[Passage] = []
    limits = rounding(old.values), rounding(new.values)
    for i in range(len(old.index)):
        start, end = float(old.values[i].real), float(new.values[i].real)
        slopes = step * float(old.tangents[i].real), step * float(new.tangents[i].real)
        scale = max(abs(old.values[i]), 1e-300)
        least = float(limits[0][i]), float(limits[1][i])
        if abs(start) <= least[0] and abs(end) <= least[1]:
            continue
        # On the axis, as where an undamped branch begins, is stable, whichever sign rounding has given it: growth that
        # ends on the very value that is looked at ends in the step up to there.
        start, end = (
            -STILL * scale if abs(rate) <= limit else rate for rate, limit in zip((start, end), least, strict=True)
        )
        marks = [0.0, *_turns(start, end, *slopes), 1.0]
        rates = [_cubic(start, end, *slopes, mark) for mark in marks]
        passed = [k for k in range(len(marks) - 1) if rates[k] * rates[k + 1] < 0]
        partner = partner_of(new.values, new.tangents, i, new.mu) if passed else i
        for k in passed:
            # One that is alone lies somewhere in the step: where the cubic turns is not known to the last.
            a, b = (0.0, 1.0) if len(passed) == 1 else (marks[k], marks[k + 1])
            low, high = old.mu + a * step, old.mu + b * step
            found.append(Passage("crossing", low, high, i, partner, bool(rates[k] > 0), (0j, 0j), old))
    return found


def _turns(start: float, end: float, first: float, second: float) -> list[float]:
    """Where in (0, 1) the cubic through values and slopes turns; nowhere beside a meeting, where slopes explode."""
    if max(abs(first), abs(second)) > 20 * abs(end - start) and start * end < 0:
        return []
    c3 = 2 * start - 2 * end + first + second
    c2 = -3 * start + 3 * end - 2 * first - second
    return sorted(r for r in _roots(3 * float(c3), float(c2), float(first)) if 0 < r < 1)


def _roots(a: float, b: float, c: float) -> tuple[float, ...]:
    """The real roots of a x² + 2b x + c, an all but double one counted twice."""
    square = b * b - a * c
    if not math.isfinite(square) or (a == 0.0 and b == 0.0):
        return ()
    if a == 0.0:
        return (-c / (2 * b),)
    if square < 0.0:
        return (-b / a, -b / a) if square > -((1e-12 * a) ** 2) else ()
    # Of the two that which loses no digits; the other by the product of both.
    larger = -(b + math.copysign(math.sqrt(square), b))
    return (larger / a, c / larger) if larger != 0.0 else (0.0, 0.0)


def _cubic(start: float, end: float, first: float, second: float, at: float) -> float:
    c3 = 2 * start - 2 * end + first + second
    c2 = -3 * start + 3 * end - 2 * first - second
    return start + at * (first + at * (c2 + at * c3)) if 0 < at < 1 else (end if at else start)


def meetings(source: OverNumber, old: BranchState, new: BranchState, among: BoolArray | None = None) -> list[Passage]:
    """Undamped modes that meet or part, or diverge, between two states; of the branches (b,) ``among`` alone where
    that is given, others being damped."""
    floor = COMPLEX * source.frequency**2
    found: list[Passage] = []
    first, last = squared(source, old), squared(source, new)
    if among is None:
        own = np.ones(len(old.index), dtype=bool)
        was, now = (np.abs(x.coordinate.imag) > _rounding(source, x.coordinate) for x in (first, last))
    else:
        own = among
        was, now = (own & ~on_axis(source, state) & (state.values.imag > 0) for state in (old, new))
    for i in np.flatnonzero(was != now):
        split = last if now[i] else first
        distance = np.where(own, np.abs(split.coordinate - split.coordinate[i].conj()), np.inf)
        distance[i] = np.inf
        j = int(np.argmin(distance))
        if (i < j or was[j] == now[j]) and not _one(first, last, int(i), j):
            means = _means(first, last, int(i), j)
            grows, other = (i, j) if split.state.values[i].real > 0 else (j, i)
            found.append(Passage("meeting", old.mu, new.mu, int(grows), int(other), bool(was[i]), means, old))
    real = own & ~was & ~now
    beyond_old, beyond_new = first.coordinate.real > floor, last.coordinate.real > floor
    for i in np.flatnonzero(real & (beyond_old != beyond_new)):
        found.append(Passage("divergence", old.mu, new.mu, int(i), int(i), bool(beyond_old[i]), (0j, 0j), old))
    return found + _bubbles(source, first, last, np.flatnonzero(real).tolist())


def _means(old: Squares, new: Squares, i: int, j: int) -> tuple[complex, complex]:
    """The mean λ² of two branches at both ends of a step."""
    return halves(old.coordinate[i], old.coordinate[j])[0], halves(new.coordinate[i], new.coordinate[j])[0]


def _rounding(source: OverNumber, coordinate: ComplexArray) -> Array:
    """Im λ² (k,) that may be rounding: of modes that are one at every μ it is the root of it (`SPLIT_RELATIVE`)."""
    return np.maximum(COMPLEX * source.frequency**2, 2 * SPLIT_RELATIVE * np.abs(coordinate))


def _one(old: Squares, new: Squares, i: int, j: int) -> bool:
    """Whether two modes are one at both ends of a step: rounding alone parts them, now real, now complex."""
    pairs = [state.coordinate[[i, j]] for state in (old, new)]
    return all(bool(abs(x[0] - x[1]) <= COINCIDENT * abs(x[0])) for x in pairs)


def _bubbles(source: OverNumber, old: Squares, new: Squares, real: list[int]) -> list[Passage]:
    """Pairs that meet and part again between two states: where the cubic of their squared half difference comes near
    zero, it is looked at again there."""
    found: list[Passage] = []
    ordered = sorted(real, key=lambda i: float(old.coordinate[i].real))
    neighbours = list(pairwise(ordered))
    later = sorted(real, key=lambda i: float(new.coordinate[i].real))
    known = {frozenset(pair) for pair in neighbours}
    neighbours += [pair for pair in pairwise(later) if frozenset(pair) not in known]
    for i, j in neighbours:
        if _one(old, new, i, j):
            continue
        lowest = _lowest(source, old, new, i, j)
        if lowest is not None:
            mu, mean = lowest
            means = _means(old, new, i, j)
            pair = min(i, j), max(i, j)
            found.append(Passage("meeting", old.mu, mu, *pair, False, (means[0], mean), old.state))
            found.append(Passage("meeting", mu, new.mu, *pair, True, (mean, means[1]), old.state))
    return found


def _lowest(source: OverNumber, old: Squares, new: Squares, i: int, j: int) -> tuple[float, complex] | None:
    """μ and mean at which the real modes i and j are a complex pair; None where none is found."""
    low, high = _ends(old, i, j), _ends(new, i, j)
    mu_low, mu_high = old.mu, new.mu
    for _ in range(PROBES):
        step = mu_high - mu_low
        turns = _turns(low[1], high[1], step * low[2], step * high[2])
        at = min(turns, key=lambda t: _cubic(low[1], high[1], step * low[2], step * high[2], t), default=None)
        if at is None:
            return None
        if _cubic(low[1], high[1], step * low[2], step * high[2], at) > TOUCHING * min(low[1], high[1]):
            return None
        mu = mu_low + at * step
        found = source.eigenpairs(mu)
        guess = (1 - at) * low[0] + at * high[0]
        x, tangents = squares_of(source, found)
        near = np.argsort(np.abs(x - guess))[:2]
        mean, square = halves(*x[near])
        if square.real < -(float(_rounding(source, np.array([mean]))[0]) ** 2):
            # Beside one that is damped a mode is no pair.
            return (mu, mean) if mirrored(*found.values[near].tolist()) else None
        slopes = tangents[near]
        change = float(((x[near[0]] - x[near[1]]) * (slopes[0] - slopes[1]) / 2).real)
        middle = float(mean.real), float(square.real), change
        if not np.isfinite(change) or square.real <= 1e-14 * abs(mean) ** 2:
            return None
        if change > 0:
            mu_high, high = mu, middle
        else:
            mu_low, low = mu, middle
    return None


def _ends(state: Squares, i: int, j: int) -> tuple[float, float, float]:
    """Mean, squared half difference and its slope over μ of two real branches."""
    mean, square = halves(state.coordinate[i], state.coordinate[j])
    slopes = state.tangents[[i, j]]
    change = (state.coordinate[i] - state.coordinate[j]) * (slopes[0] - slopes[1]) / 2
    return float(mean.real), float(square.real), float(change.real)

"""Onsets without following branches: where the number of growing modes changes, enclosed by halving.

Branches that damping beyond critical tangles on the real axis cannot always be told apart; what grows at a value can.
Between neighbours on a grid the growing modes are counted; where the numbers differ, or where slopes say that a mode
crosses the axis between them, the interval is halved until one mode changes in it, and Newton solves for it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ...typing import BoolArray, ComplexArray
from ..assembled.reduced import Eigenpairs
from ..quadratic.polish import pairs
from .basis import AT_REST, GROWS, NOTHING, OnBasis
from .newton import Root, crossing, meeting, standstill
from .onsets import growing_roots

GRID = 96
ON_IT = 1e-6  # of the range: so near an onset growth may be rounding
SMALLEST = 1e-9  # of the range: no interval is halved further
ALONE = 1e-4  # of the range: an interval in which one mode changes is short enough for Newton from here on
STILL = 1e-3  # of the highest frequency: slower than that may be divergence
EDGE = 1e-3  # of the highest frequency: modes that come in or leave there are no onsets


@dataclass(frozen=True)
class Counted:
    """Onsets; how many growing modes pass the highest frequency; agree: whether the growing roots at every value of the
    grid are those that both say."""

    roots: list[Root]
    passed: int
    agree: bool


@dataclass(frozen=True)
class _Count:
    """Eigenpairs at t and which of them grow."""

    t: float
    found: Eigenpairs
    growing: BoolArray

    @property
    def number(self) -> int:
        """How many roots grow, of which a flutter pair is two."""
        return growing_roots(self.found.values[self.growing])


def counted(source: OnBasis, top: float) -> Counted:
    """Onsets up to |λ| = top between t = 0 and 1, and whether what grows at each value of the grid is what they say."""
    roots = list[Root]()
    passed = list[tuple[float, int]]()
    grid = [_at(source, top, float(t)) for t in np.linspace(0.0, 1.0, GRID + 1)]
    for before, after in pairwise(grid):
        for low, high in _changes(source, top, before, after):
            root = _solved(source, top, low, high)
            if root is not None:
                if not any(_same(root, other, top) for other in roots):
                    roots.append(root)
            elif _at_edge(low, high, top):
                passed.append((high.t, high.number - low.number))
    return Counted(roots, len(passed), _agree(grid, roots, passed))


def _same(one: Root, other: Root, top: float) -> bool:
    near = abs(one.mu - other.mu) <= 1e-8 and abs(one.lam - other.lam) <= 1e-7 * top
    return near and ends(one) == ends(other)


def _agree(grid: list[_Count], roots: list[Root], passed: list[tuple[float, int]]) -> bool:
    """Whether as many roots grow at each value as at the first, with those that onsets and the highest frequency let in
    and out in between; values that lie on an onset are not judged."""
    changes = [(r.mu, (-1 if ends(r) else 1) * (2 if r.lam else 1)) for r in roots]
    for at in grid:
        if any(abs(at.t - mu) <= ON_IT for mu, _ in changes):
            continue
        said = grid[0].number + sum(change for t, change in changes if 0 < t < at.t)
        said += sum(change for t, change in passed if t <= at.t)
        if at.number != said:
            return False
    return True


def ends(root: Root) -> bool:
    """Whether growth ends there."""
    return root.slope < 0 if root.slope is not None else (root.square or 0.0) < 0


def _at(source: OnBasis, top: float, t: float) -> _Count:
    found = source.eigenpairs(t)
    values = found.values
    least = NOTHING if source.family.reversible else GROWS
    grows = (values.real > least * np.abs(values)) & (np.abs(values) > AT_REST * top) & (np.abs(values) <= top)
    return _Count(t, found, grows)


def _changes(source: OnBasis, top: float, low: _Count, high: _Count) -> Iterator[tuple[_Count, _Count]]:
    """Intervals in which the growing modes change by one, those that slopes foretell included."""
    differs = low.number != high.number
    width = high.t - low.t
    if not differs and not _foretold(low, width, top) and not _foretold(high, -width, top):
        return
    if width <= SMALLEST or (width <= ALONE and _one(low, high)):
        if differs:
            yield low, high
        return
    if width <= ALONE and not differs:
        return
    middle = _at(source, top, 0.5 * (low.t + high.t))
    yield from _changes(source, top, low, middle)
    yield from _changes(source, top, middle, high)


def _one(low: _Count, high: _Count) -> bool:
    """Whether it is one flutter pair or one divergence that makes the difference."""
    more, fewer = (high, low) if high.number > low.number else (low, high)
    change = more.number - fewer.number
    return change == 1 or (change == 2 and int(more.growing.sum()) == int(fewer.growing.sum()) + 1)


def _foretold(at: _Count, step: float, top: float) -> bool:
    """Whether a mode would cross the axis within a step if it were straight."""
    lam, ahead = at.found.values, at.found.values + step * _rates(at.found)
    inside = (np.abs(lam) <= top) & (np.abs(lam) > AT_REST * top) & np.isfinite(ahead)
    return bool(np.any(inside & (np.abs(lam.real) > GROWS * np.abs(lam)) & ((lam.real > 0) != (ahead.real > 0))))


def _rates(found: Eigenpairs) -> ComplexArray:
    """dλ/dt (k,), where the coordinate may be λ²."""
    with np.errstate(all="ignore"):
        squared = ~np.isclose(found.coordinate, found.values, rtol=1e-9, atol=0.0)
        rates: ComplexArray = np.where(squared, found.tangents / (2 * found.values), found.tangents)
    return rates


def _at_edge(low: _Count, high: _Count, top: float) -> bool:
    """Whether what changes is a mode that passes the highest frequency while it grows."""
    return any(
        bool(np.any((np.abs(np.abs(one.found.values) / top - 1.0) <= EDGE) & (one.found.values.real > 0)))
        for one in (low, high)
    )


def _solved(source: OnBasis, top: float, low: _Count, high: _Count) -> Root | None:
    """The onset in an interval in which one mode begins or ceases to grow; None where none is found."""
    family = source.family
    more, fewer = (high, low) if high.number > low.number else (low, high)
    mine, others = np.flatnonzero(more.growing), np.flatnonzero(fewer.growing)
    known, _ = pairs(more.found.values[mine], fewer.found.values[others], 1e-2 * top)
    fresh = np.setdiff1d(np.arange(len(mine)), known)
    if not len(fresh):
        fresh = np.arange(len(mine))
    place = int(mine[fresh[np.argmin(more.found.values[mine[fresh]].real)]])
    lam = complex(more.found.values[place])
    x, y = more.found.right[:, place], more.found.left[:, place]
    between = (low.t, high.t)
    slack = 1e-6 + 2 * (high.t - low.t)
    stabilising = more is low
    def candidates() -> Iterator[Root | None]:
        if abs(lam.imag) <= STILL * top:
            yield standstill(family, more.t, x, y, between)
        if not family.reversible:
            yield crossing(family, more.t, lam, x, y, between)
        yield meeting(family, more.t, lam, x, y, between)

    for root in candidates():
        if root is None or not low.t - slack <= root.mu <= high.t + slack:
            continue
        if ends(root) == stabilising:
            return root
    return None

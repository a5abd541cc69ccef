"""Onsets without following branches: where the number of growing roots changes, enclosed by halving.

Branches that damping beyond critical tangles on the real axis cannot always be told apart; what grows at a value can.
Between neighbours on a grid the growing roots up to |λ| = ω_max are counted; where the numbers differ, or where slopes
say that a mode crosses the axis between them or that two meet, the interval is halved until one mode changes in it, and
Newton solves for it in the full problem. A mode that passes |λ| = ω_max while it grows is no onset, and is told.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.optimize import linear_sum_assignment

from ...typing import BoolArray, ComplexArray
from ..dense_problem import Eigenpairs
from ..histories import within_rounding
from ..newton import CONVERGED, Root, crossing, meeting, standstill
from ..onset import Onset
from ..quadratic.polish import pairs
from ..tolerances import SPLIT_RELATIVE, UNSTABLE_RELATIVE
from .basis import Along
from .family import Family
from .foretold import SLOWEST, changes_within
from .growth import growing_roots, unstable
from .opening import Opening

GRID = {False: 96, True: 24}  # intervals to begin with, on a basis and by full solves
ON_IT = 1e-6  # of the range: so near an onset growth may be rounding
SMALLEST = 1e-9  # of the range: no interval is halved further
UNSURE = 2.0  # times where growth reaches what counts, by the slope of an onset
CLOSEST = 0.05  # of the range: farther from an onset every value is judged
ALONE = 1e-4  # of the range: an interval in which one mode changes is short enough for Newton from here on
STILL = 1e-3  # of the highest frequency: slower than that may be divergence
NEARBY = 0.05  # of |λ|: how far from where slopes lead it to a growing mode may be in the next interval's end
CLOSELY = 1.5  # from one value to the next behind what opens at the low end
AWAY = 0.1  # of |λ|, or of the highest frequency: how far a root in the smallest intervals may be from its mode
EDGE = 1e-3  # of the highest frequency: modes that come in or leave there are no onsets
ALIKE = 1e-7  # of the highest frequency: onsets at one value whose frequencies are no further apart are one


@dataclass(frozen=True)
class Passing:
    """A growing mode λ [1/s] that passes the highest frequency at ``mu``; roots: by how many more grow below it."""

    mu: float
    lam: complex
    roots: int


@dataclass(frozen=True)
class Lack:
    """Growing roots that change by ``seen`` between two values while onsets say ``said``."""

    low: float
    high: float
    seen: int
    said: int


@dataclass(frozen=True)
class Counted:
    """Growing roots at each value (μ, number) of a grid, onsets solved between them, and what passes the highest
    frequency; rest [1/s]: up to which |λ| nothing was counted, as it may be a motion as a whole."""

    grid: tuple[tuple[float, int], ...]
    onsets: tuple[Onset, ...]
    passing: tuple[Passing, ...]
    rest: float = 0.0

    def lacking(self, onsets: Sequence[Onset]) -> list[Lack]:
        """Between which values these onsets do not say what is counted; values that lie on an onset are not judged, but
        for both ends: what is counted there may hold what changes on them, or not."""
        low, high = self.grid[0][0], self.grid[-1][0]
        near = ON_IT * (high - low)
        judged = [
            (mu, n) for mu, n in self.grid
            if mu in (low, high) or all(abs(o.mu - mu) > max(near, self._unseen(o)) for o in onsets)
        ]  # fmt: skip
        lacks: list[Lack] = []
        for (before, number), (after, later) in pairwise(judged):
            start, stop = before - near * (before == low), after + near * (after == high)
            inside = [o for o in onsets if start <= o.mu <= stop]
            said = sum(o.roots for o in inside) + sum(p.roots for p in self.passing if before < p.mu <= after)
            # Nothing grows yet where growth begins at the low end, nor any more where it ends at the high one.
            open_ = [
                o.roots for o in inside
                if (o.mu <= low + near and (o.stabilising or o.mu < low))
                or (o.mu >= high - near and (o.mu > high or not o.stabilising))
            ]  # fmt: skip
            least, most = (sum(side(roots, 0) for roots in open_) for side in (min, max))
            if not said - most <= later - number <= said - least:
                lacks.append(Lack(before, after, later - number, said))
        return lacks

    def _unseen(self, onset: Onset) -> float:
        """How far from an onset growth with its slope, or as its square root, may still be too slow to count as growth:
        of two modes that are one at the low end and part as a higher power, far further than others."""
        width = self.grid[-1][0] - self.grid[0][0]
        if not onset.growth_slope and onset.square_root_coefficient:
            split = UNSURE * SPLIT_RELATIVE * 2 * np.pi * onset.frequency_hz / onset.square_root_coefficient
            return float(min(split**2, CLOSEST * width))
        if not onset.growth_slope:
            return 0.0
        slowest = UNSTABLE_RELATIVE * 2 * np.pi * onset.frequency_hz or self.rest
        return float(min(UNSURE * slowest / abs(onset.growth_slope), CLOSEST * width))


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


def ends(root: Root) -> bool:
    """Whether growth ends there."""
    return bool(root.slope < 0) if root.slope is not None else bool((root.square or 0.0) < 0)


def counted(source: Along, between: tuple[float, float], top: float, more: Sequence[float] = ()) -> Counted:
    """Onsets up to |λ| = top [1/s] in a range of the family, and what was counted on the way; more: values of μ
    that the grid has too."""
    return _Search(source, between, top).all(more)


def opened_in(source: Along, low: float, top: float) -> tuple[Opening, ...]:
    """Modes up to |λ| = top [1/s] that begin to grow at the low end of a range, or so near it that it is not seen
    there."""
    if low != source.family.low:
        return ()
    return tuple(o for o in source.opened if o.root is not None and abs(o.root.lam) <= top)


def beyond(opened: Sequence[Opening], low: float, first: float) -> list[float]:
    """Values from where modes that open at the low end are seen to grow up to the first one that is looked at anyway:
    what opens may end and begin again before that."""
    found: list[float] = []
    for one in opened:
        t = one.until * CLOSELY
        while low + t < first:
            found.append(low + t)
            t *= CLOSELY
    return found


def number_at(source: Along, mu: float, top: float, opened: Sequence[Opening] = ()) -> int:
    """How many roots grow at one value with |λ| up to top, those included that have opened and are not yet seen to."""
    t = mu - source.family.low
    found = source.eigenpairs(t)
    begun = [o for o in opened if o.root is not None and o.root.mu < mu]
    return growing_roots(found.values[_growing(source, found, top) | _hidden(found, t, begun, top)])


def _hidden(found: Eigenpairs, t: float, opened: Sequence[Opening], top: float) -> BoolArray:
    """Which of the eigenpairs (k,) at t are modes that open, each found where its series leads to, as long as that may
    not be seen."""
    places = [o.among(found.values, t) for o in opened if t <= o.until]
    hidden = np.zeros(len(found.values), dtype=bool)
    hidden[[place for place in places if place is not None]] = True
    return hidden & (np.abs(found.values) <= top)


def _growing(source: Along, found: Eigenpairs, top: float) -> BoolArray:
    # What is slow and no motion as a whole is a divergence that has just begun, or slow flutter.
    return unstable(source.family, found.values, top, SLOWEST) & (np.abs(found.values) <= top)


class _Search:
    """A search between two values, t = μ − the family's low end."""

    def __init__(self, source: Along, between: tuple[float, float], top: float) -> None:
        self.source, self.top = source, top
        self.start = source.family.low
        self.low, self.high = between[0] - self.start, between[1] - self.start
        self.width = self.high - self.low
        self.opened = opened_in(source, between[0], top)

    def all(self, more: Sequence[float]) -> Counted:
        """The grid from end to end, and what changes in it."""
        even = np.linspace(self.low, self.high, GRID[self.source.whole] + 1)
        early = beyond(self.opened, self.start, self.start + float(even[1]))
        grid = [self._at(t) for t in sorted({*even.tolist(), *(mu - self.start for mu in (*early, *more))})]
        onsets, passing = [as_onset(self.source.family, o.root) for o in self.opened if o.root], list[Passing]()
        for before, after in pairwise(grid):
            for low, high in self._changes(before, after):
                for found in self._explained(low, high):
                    if isinstance(found, Passing):
                        passing.append(found)
                    elif not any(self._same(found, other) for other in onsets):
                        onsets.append(found)
        rounding = within_rounding(onsets, lambda mu: self.source.eigenpairs(mu - self.start).values)
        told = tuple(o for k, o in enumerate(onsets) if k not in rounding)
        numbers = tuple((self.start + c.t, self._number(c)) for c in grid)
        return Counted(numbers, told, tuple(passing), self.source.family.rest_limit(self.top))

    def _number(self, count: _Count) -> int:
        """How many roots grow, without those that open further on."""
        return number_at(self.source, self.start + count.t, self.top, self.opened)

    def _explained(self, low: _Count, high: _Count) -> Iterator[Onset | Passing]:
        """What changes in an interval; where neither is found in it, in its halves: half of a pair that falls apart
        above the band comes into it faster than any mode."""
        roots = self._solved(low, high)
        if roots:
            yield from (as_onset(self.source.family, root) for root in roots)
        elif (lam := self._at_edge(low, high)) is not None:
            yield Passing(self.start + high.t, lam, high.number - low.number)
        elif high.t - low.t > SMALLEST * self.width:
            middle = self._at(0.5 * (low.t + high.t))
            for half in ((low, middle), (middle, high)):
                for part in self._changes(*half):
                    yield from self._explained(*part)

    def _same(self, one: Onset, other: Onset) -> bool:
        near = abs(one.mu - other.mu) <= 1e-8 * self.width and one.stabilising == other.stabilising
        return near and 2 * np.pi * abs(one.frequency_hz - other.frequency_hz) <= ALIKE * self.top

    def _at(self, t: float) -> _Count:
        found = self.source.eigenpairs(t)
        # What opens at the low end grows from there on: nothing that is to be found anywhere changes where it is seen.
        hidden = _hidden(found, t, self.opened, self.top)
        return _Count(t, found, _growing(self.source, found, self.top) | hidden)

    def _changes(self, low: _Count, high: _Count) -> Iterator[tuple[_Count, _Count]]:
        """Intervals in which the growing modes change by one, those that slopes foretell included."""
        differs, width = low.number != high.number, high.t - low.t
        family, top = self.source.family, self.top
        foretold = any(changes_within(family, c.found, step, top) for c, step in ((low, width), (high, -width)))
        if not differs and not foretold and self._are_those(low, high):
            return
        if width <= SMALLEST * self.width or (width <= ALONE * self.width and _one(low, high)):
            if differs:
                yield low, high
            return
        if width <= ALONE * self.width and not differs:
            return
        middle = self._at(0.5 * (low.t + high.t))
        yield from self._changes(low, middle)
        yield from self._changes(middle, high)

    def _are_those(self, low: _Count, high: _Count) -> bool:
        """Whether as many growing modes are the same ones: where one begins and another ends their number says nothing.
        Each is where the slopes at both ends lead to."""
        ends = [(count.found.values[count.growing], _rates(count.found)[count.growing]) for count in (low, high)]
        half = 0.5 * (high.t - low.t)
        (first, rates), (last, rates_to) = ends
        if len(first) != len(last):
            return False
        ahead, back = (
            np.where(np.isfinite(slope), values + way * slope, values)
            for values, slope, way in ((first, rates, half), (last, rates_to, -half))
        )
        distance = np.abs(ahead[:, None] - back)
        rows, columns = linear_sum_assignment(distance)
        near = NEARBY * np.maximum(np.abs(first[rows]), np.abs(last[columns])) + 0.1 * NEARBY * self.top
        return bool(np.all(distance[rows, columns] <= near))

    def _at_edge(self, low: _Count, high: _Count) -> complex | None:
        """The growing mode that passes the highest frequency between two values, if that is what changes."""
        for one in (low, high):
            values = one.found.values
            near = (np.abs(np.abs(values) / self.top - 1.0) <= EDGE) & (values.real > 0)
            if near.any():
                return complex(values[np.flatnonzero(near)[0]])
        return None

    def _solved(self, low: _Count, high: _Count) -> list[Root]:
        """The onset in an interval in which one mode begins or ceases to grow, or those in one that is not halved any
        more, in which several may; none where none is found."""
        more, fewer = (high, low) if high.number > low.number else (low, high)
        mine, others = np.flatnonzero(more.growing), np.flatnonzero(fewer.growing)
        known, _ = pairs(more.found.values[mine], fewer.found.values[others], 1e-2 * self.top)
        fresh = np.setdiff1d(np.arange(len(mine)), known)
        if not len(fresh):
            fresh = np.arange(len(mine))
        slowest = mine[fresh[np.argsort(more.found.values[mine[fresh]].real, kind="stable")]].tolist()
        several = high.t - low.t <= SMALLEST * self.width
        lacking, roots = more.number - fewer.number, list[Root]()
        for index in slowest if several else slowest[:1]:
            root = self._root(low, high, more, index)
            if root is None or any(self._same(*(as_onset(self.source.family, r) for r in (root, o))) for o in roots):
                continue
            roots.append(root)
            lacking -= 2 if root.lam else 1
            if lacking <= 0:
                break
        return roots

    def _root(self, low: _Count, high: _Count, more: _Count, index: int) -> Root | None:
        """The onset in an interval of one mode that grows at the end of it at which more do."""
        family, top = self.source.family, self.top
        lam, mu = complex(more.found.values[index]), self.start + more.t
        x, y = (
            self.source.vectors(v[:, [index]], more.t, left=left)[:, 0]
            for v, left in ((more.found.right, False), (more.found.left, True))
        )
        # Growth is seen where it is more than rounding, and Newton's method ends where it begins, some way before that.
        slack, edge = 1e-6 * self.width + 2 * (high.t - low.t), 1e-9 * self.width
        rate = abs(float(_rates(more.found)[index].real))
        if abs(lam.imag) <= STILL * top and rate > 0.0:
            # Below what may be a motion as a whole it is not seen at all.
            slack += UNSURE * family.rest_limit(top) / rate
        first = max(self.start + low.t - slack, self.start + self.low - edge)
        last = min(self.start + high.t + slack, self.start + self.high + edge)

        def candidates() -> Iterator[Root | None]:
            between = (first, last)
            if abs(lam.imag) <= STILL * top:
                yield standstill(family, mu, x, y, between)
            if not family.reversible:
                yield crossing(family, mu, lam, x, y, between)
            yield meeting(family, mu, lam, x, y, between)

        for root in candidates():
            # The root of another mode, or one that lies outside of what is searched, is none.
            if root is None or not first <= root.mu <= last:
                continue
            if abs(root.lam.imag - lam.imag) <= AWAY * max(abs(lam), top) and ends(root) == (more.t == low.t):
                at_low = abs(root.mu - self.start - self.low) <= CONVERGED * self.width
                return replace(root, mu=self.start + self.low) if at_low else root
        return None


def _one(low: _Count, high: _Count) -> bool:
    """Whether it is one flutter pair or one divergence that makes the difference: a divergence that ends beside a pair
    that begins leaves one root more as well, of as many modes."""
    more, fewer = (high, low) if high.number > low.number else (low, high)
    return more.number - fewer.number <= 2 and int(more.growing.sum()) == int(fewer.growing.sum()) + 1


def _rates(found: Eigenpairs) -> ComplexArray:
    """dλ/dt (k,), where the coordinate may be λ²."""
    with np.errstate(all="ignore"):
        squared = ~np.isclose(found.coordinate, found.values, rtol=1e-9, atol=0.0)
        rates: ComplexArray = np.where(squared, found.tangents / (2 * found.values), found.tangents)
    return rates


def as_onset(family: Family, root: Root) -> Onset:
    """Of branches that were not followed: they have no numbers."""
    return Onset(
        mu=float(root.mu), frequency_hz=abs(root.lam.imag) / (2 * np.pi), kind="flutter" if root.lam else "divergence",
        damped=family.dissipates, stabilising=ends(root), branches=(0, 0), residual=root.residual,
        square_root_coefficient=None if root.square is None else float(np.sqrt(abs(root.square))),
        growth_slope=root.slope,
    )  # fmt: skip

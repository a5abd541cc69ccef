"""How many modes grow anywhere between the curves of a boundary, from the points at which they were counted.

Growing roots are conserved but for those that cross a curve, and the curves say how many that are. Modes are not: a
pair is one mode and two roots, and where it parts on the real axis into two modes that grow without oscillating no
curve tells. Of n roots there are n/2 to n modes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np
from scipy.spatial import Delaunay, QhullError, cKDTree

from ..modal.boundary import Drawn, carried, crossings
from ..typing import Array, BoolArray, IntArray

BESIDE = 1e-9  # of the ranges: how far inside the rectangle a point on its edge counts as
NEAREST = 24  # counted points among which one is looked for from which nothing has to part


@dataclass(frozen=True)
class CountedAt:
    """A point between the lines at which all modes were solved for, how many of them grow, and how many roots these
    are: two of a flutter pair, one of a mode that grows without oscillating; None in results that do not say so."""

    x: float
    y: float
    unstable_modes: int
    roots: int | None = None


def roots_fit(modes: int, roots: int | None) -> bool:
    """Whether so many growing modes can be so many roots."""
    return roots is None or (type(roots) is int and modes <= roots <= 2 * modes)


def numbers_of(counted: Sequence[CountedAt], curves: Sequence[Drawn], low: Array, width: Array) -> Numbers:
    """Numbers between curves in shares of ranges that begin at low (2,) and are width (2,) wide. Where a point does not
    say how many roots its modes are, every mode counts as a pair, and every curve as one of flutter."""
    whole = all(c.roots is not None for c in counted)
    modes = np.array([c.unstable_modes for c in counted], dtype=np.int64)
    roots = np.array([c.roots for c in counted], dtype=np.int64) if whole else 2 * modes
    return Numbers((np.array([[c.x, c.y] for c in counted]) - low) / width, modes, roots, tuple(curves), whole)


@dataclass(frozen=True)
class Numbers:
    """Growing modes and roots (k,) at places (k, 2), in shares of the ranges, and the curves between these. whole:
    whether roots are known."""

    places: Array
    modes: IntArray
    roots: IntArray
    curves: tuple[Drawn, ...]
    whole: bool

    def at(self, p: Array) -> int:
        """How many modes grow at a point (2,): as the nearest place says, or the nearest one that knows of as many
        roots there and from which none had to part or meet on the way, where that leaves the number open."""
        order = np.argsort(np.hypot(*(self.places - p).T), kind="stable")
        modes, roots, parted = self._from(int(order[0]), p)
        if parted and roots > 1:
            for k in order[1:NEAREST].tolist():
                other, as_many, parted = self._from(k, p)
                if as_many == roots and not parted:
                    return other
        return max(modes, 0)

    def over(self, grid: Array) -> tuple[IntArray, BoolArray]:
        """How many modes grow on a grid (nx, ny, 2), rising, and where that is known."""
        # Modes are first carried as if none parted or met: then what the curves say does not depend on the way, unless
        # some end within the rectangle, and what is counted differs from it by one number in every region.
        table, known = self._by_curves(grid), np.ones(grid.shape[:2], dtype=bool)
        more = self._counts - [self._up_to(p) for p in self.places]
        if not np.any(more) and np.all(possible(table)):
            return table[..., 0], known
        table += more[cKDTree(self.places).query(grid)[1]]
        around = corners_of(self.places, grid)
        triples, number = np.unique(np.sort(around.reshape(-1, around.shape[-1])), axis=0, return_inverse=True)
        number = number.reshape(known.shape)
        even = np.all(np.ptp(more[triples], axis=1) == 0, axis=1) & self._fit(triples)
        # Where fewer modes than the roots can be would grow a pair has parted, within that triangle.
        parting = np.bincount(number.ravel(), ~possible(table).ravel(), len(triples)) > 0
        for i, j in np.argwhere(~(even & ~parting)[number]).tolist():
            said = [self._from(k, grid[i, j]) for k in around[i, j].tolist()]
            roots = {r for _, r, _ in said}
            open_ = max(roots) > 1 and (parting[number[i, j]] or any(parted for *_, parted in said))
            modes = {m for m, *_ in said}
            known[i, j] = len(modes) == len(roots) == 1 and not open_
            table[i, j, 0] = max(min(modes), 0)
        return table[..., 0], known

    def _from(self, k: int, p: Array) -> tuple[int, int, bool]:
        """How many modes and roots grow at a point (2,) as the curves say straight from a place, and whether modes had
        to part or meet on the way."""
        passed = crossings(self.curves, self.places[k], p)
        if self.whole:
            return carried(int(self.modes[k]), int(self.roots[k]), passed)
        modes = int(self.modes[k]) + sum(int(np.sign(c.roots)) for c in passed)
        return modes, 2 * modes, False

    def _fit(self, triples: IntArray) -> BoolArray:
        """Whether (n,) places of triples (n, 3) differ by what the curves between them say, with no mode that parts."""
        pairs = {(i, j) for triple in triples.tolist() for i, j in combinations(triple, 2)}
        fit = {(i, j): self._from(i, self.places[j]) == (*self._counts[j].tolist(), False) for i, j in pairs}
        return np.array([all(fit[pair] for pair in combinations(triple, 2)) for triple in triples.tolist()])

    @cached_property
    def _counts(self) -> IntArray:
        """Modes and roots (k, 2)."""
        return np.stack([self.modes, self.roots], axis=1)

    def _by_curves(self, grid: Array) -> IntArray:
        """How many modes and roots (nx, ny, 2) grow on a grid as the curves say from the first place."""
        table = np.zeros(grid.shape, dtype=np.int64)
        for column, numbers in zip(grid, table, strict=True):
            foot, top = column[0] * (1, 0) + (0, BESIDE), column[-1]
            numbers[:] = self._up_to(foot)
            for passed in crossings(self.curves, foot, top):
                numbers[column[:, 1] > foot[1] + passed.at * (top[1] - foot[1])] += self._step(passed.roots)
        return table

    def _up_to(self, p: Array) -> IntArray:
        """The same (2,) at one point (2,), by way of the lower edge."""
        foot = np.array([p[0], BESIDE])
        return self._counts[0] + self._changes(self.places[0], foot) + self._changes(foot, p)

    def _changes(self, start: Array, end: Array) -> IntArray:
        """By how many more modes and roots (2,) grow at the end of a line."""
        change = np.zeros(2, dtype=np.int64)
        for passed in crossings(self.curves, start, end):
            change += self._step(passed.roots)
        return change

    def _step(self, roots: int) -> IntArray:
        modes = int(np.sign(roots))
        return np.array([modes, roots if self.whole else 2 * modes])


def possible(numbers: IntArray) -> BoolArray:
    """Where so many modes and roots (…, 2) may grow; nothing is said where roots are fewer than none, which have left
    the band."""
    modes, roots = numbers[..., 0], numbers[..., 1]
    return (roots < 0) | ((2 * modes >= roots) & (modes <= roots))


def corners_of(places: Array, grid: Array) -> IntArray:
    """Numbers (nx, ny, 3) of the places (k, 2) between which the points of a grid (nx, ny, 2) lie, the nearest three
    where they lie between none."""
    nearest = cKDTree(places).query(grid, k=min(3, len(places)))[1].reshape(*grid.shape[:2], -1)
    try:
        mesh = Delaunay(places)
    except (QhullError, ValueError):  # fewer than three, or all on one line
        return nearest
    name = mesh.find_simplex(grid)
    return np.where((name >= 0)[..., None], mesh.simplices[name], nearest)

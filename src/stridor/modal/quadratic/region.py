"""The part of the complex plane whose eigenvalues are wanted, and discs that cover it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...typing import BoolArray

BORDER = 1e-9  # of the region's size: what rounding may put an eigenvalue outside by
PAD = 0.02  # of the region's size: searched beyond its border, so that no contour need touch an eigenvalue
STRIP = 0.25  # half width, over its height, of the part beside the imaginary axis that gets shifts of its own
WORTH = 1.5  # width over height of a region from which on that strip and what lies beyond it get discs of their own
SQUARE = 0.8  # width over height of a region on the real axis from which on it gets a real shift
DEPTH = 8  # bisections at most in telling what discs leave uncovered, along each side
MARGIN = 1.01  # a disc meant to cover a rectangle is this much larger than it has to be


@dataclass(frozen=True)
class Region:
    """re_min ≤ Re λ ≤ re_max and im_min ≤ Im λ ≤ im_max [1/s]; re_max may be infinite.

    Matrices are real: of a conjugate pair the member with Im λ ≥ 0 counts, and im_min below zero means zero.
    """

    re_min: float
    re_max: float
    im_min: float
    im_max: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.re_min) and math.isfinite(self.im_min) and math.isfinite(self.im_max)):
            raise ValueError("a region needs finite re_min, im_min and im_max; re_max alone may be infinite")
        if not (self.re_min <= self.re_max and self.im_min <= self.im_max):
            raise ValueError(f"a region's minima must not exceed its maxima: {self}")
        if self.re_min == self.re_max and self.im_min == self.im_max:
            raise ValueError("a region that is a point holds nothing")

    @classmethod
    def band(cls, min_hz: float, max_hz: float, *, above: float, below: float = math.inf) -> Region:
        """All with a frequency Im λ/2π between min_hz and max_hz [Hz] whose growth rate [1/s] is over ``above``."""
        if not 0 <= min_hz < max_hz:
            raise ValueError(f"a band needs 0 <= min_hz < max_hz; got {min_hz} and {max_hz}")
        return cls(above, below, 2 * math.pi * min_hz, 2 * math.pi * max_hz)

    @classmethod
    def box(cls, re_min: float, re_max: float, im_min: float, im_max: float) -> Region:
        """A rectangle [1/s]."""
        return cls(re_min, re_max, im_min, im_max)

    def bounded(self) -> Region:
        """What is searched: without lower half plane, and an infinite re_max cut off at the largest |λ| of the rest.

        An undamped system loaded by friction grows no faster than it oscillates unless its stiffness is indefinite.
        """
        top = self.re_max if math.isfinite(self.re_max) else max(self.im_max, abs(self.re_min))
        return replace(self, re_max=top, im_min=min(max(self.im_min, 0.0), self.im_max))

    @property
    def width(self) -> float:
        """re_max − re_min [1/s]."""
        return self.re_max - self.re_min

    @property
    def height(self) -> float:
        """im_max − im_min [1/s]."""
        return self.im_max - self.im_min

    @property
    def scale(self) -> float:
        """The largest |λ| in it [1/s]."""
        return max(abs(self.re_min), abs(self.re_max), abs(self.im_min), abs(self.im_max))

    def grown(self, by: float) -> Region:
        """With every border moved outwards [1/s]."""
        return Region(self.re_min - by, self.re_max + by, self.im_min - by, self.im_max + by)

    def contains(self, values: Any, slack: float = BORDER) -> BoolArray:
        """Whether eigenvalues (k,) are inside, those on the border included: slack is relative to the scale."""
        by = slack * self.scale
        lam: Any = np.asarray(values)
        real = (lam.real >= self.re_min - by) & (lam.real <= self.re_max + by)
        return real & (lam.imag >= self.im_min - by) & (lam.imag <= self.im_max + by)

    def farthest(self, centre: complex) -> float:
        """Distance from ``centre`` to the corner farthest from it."""
        across = max(abs(self.re_min - centre.real), abs(self.re_max - centre.real))
        return math.hypot(across, max(abs(self.im_min - centre.imag), abs(self.im_max - centre.imag)))

    def halves(self) -> tuple[Region, Region]:
        """Cut across the longer side."""
        if self.width > self.height:
            at = (self.re_min + self.re_max) / 2
            return replace(self, re_max=at), replace(self, re_min=at)
        at = (self.im_min + self.im_max) / 2
        return replace(self, im_max=at), replace(self, im_min=at)

    def shift(self) -> complex:
        """Where to factorise for it: its middle. Beside the imaginary axis a disc holds fewer of the modes that crowd
        there than one about a point on it that reaches as far."""
        return complex((self.re_min + self.re_max) / 2, (self.im_min + self.im_max) / 2)

    def real_shift(self) -> float | None:
        """Where on the real axis: a disc about it holds each mode with its conjugate, found in real arithmetic at half
        of what a disc about the middle costs. None where that would reach over much that is not asked for."""
        wide = self.im_min <= 0.0 < self.im_max and self.width >= SQUARE * self.height
        return (self.re_min + self.re_max) / 2 if wide else None


@dataclass(frozen=True)
class Disc:
    """|λ − centre| ≤ radius [1/s], in which `count` eigenvalues have converged, of both half planes.

    guard: distance of the nearest Ritz value outside, inf where there is none.
    """

    centre: complex
    radius: float
    count: int
    guard: float

    def covers(self, cell: Region) -> bool:
        """Whether all of ``cell`` is inside."""
        return cell.farthest(self.centre) <= self.radius


def cells(region: Region) -> list[Region]:
    """The rectangles that get a shift each: one for a region that is not much wider than high, else the strip beside
    the imaginary axis, where lightly damped modes crowd, and what lies beyond it on either side, where few are.
    """
    half = STRIP * region.height
    if region.width <= WORTH * region.height or not region.re_min < 0 < region.re_max:
        return [region]
    strip = replace(region, re_min=max(region.re_min, -half), re_max=min(region.re_max, half))
    result = [strip]
    if region.re_max > half:
        result.append(replace(region, re_min=half))
    if region.re_min < -half:
        result.append(replace(region, re_max=-half))
    return result


def uncovered(cell: Region, discs: list[Disc], depth: int = 2 * DEPTH) -> list[Region]:
    """Rectangles that contain all of ``cell`` that no disc does; a piece counts as covered by a single disc only."""
    if any(disc.covers(cell) for disc in discs):
        return []
    if depth == 0 or not any(_touches(disc, cell) for disc in discs):
        return [cell]
    return [piece for half in cell.halves() for piece in uncovered(half, discs, depth - 1)]


def remaining(cell: Region, discs: list[Disc]) -> list[Region]:
    """At most two rectangles around what the discs leave of each half of ``cell``."""
    result: list[Region] = []
    for half in cell.halves():
        pieces = uncovered(half, discs)
        if pieces:
            result.append(
                Region(
                    min(p.re_min for p in pieces), max(p.re_max for p in pieces),
                    min(p.im_min for p in pieces), max(p.im_max for p in pieces),
                )
            )  # fmt: skip
    return result


def _touches(disc: Disc, cell: Region) -> bool:
    nearest = complex(
        min(max(disc.centre.real, cell.re_min), cell.re_max), min(max(disc.centre.imag, cell.im_min), cell.im_max)
    )
    return abs(nearest - disc.centre) < disc.radius

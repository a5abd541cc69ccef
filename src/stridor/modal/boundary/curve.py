"""A traced curve: its points, exact tangents, and the cubic pieces between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...typing import Array, IntArray
from .spot import CurvePoint, Kind

PIECES = 16  # straight pieces that a cubic one is drawn in: off it by some 1e-5 of its length


@dataclass(frozen=True)
class StabilityCurve:
    """Points in order, closed where the last meets the first again (which is then its last point, too).

    ends: what the first and the last point are, "edge" of the rectangle, "band" (the highest frequency), "zero
    frequency", a "cusp" in which it meets another one, or "lost" where it could not be followed further. deviation: how
    far at most a solved point in the middle of two others was off the cubic between these, in shares of the ranges;
    unchecked: of how many pieces longer than the tolerance there is none.
    """

    spots: tuple[CurvePoint, ...]
    closed: bool
    ends: tuple[str, str]
    deviation: float = float("nan")
    unchecked: int = 0

    @property
    def kind(self) -> Kind:
        """What happens on it."""
        return self.spots[0].kind

    @property
    def roots(self) -> int:
        """By how many more roots grow on one side of it."""
        return 1 if self.kind == "standstill" else 2

    @cached_property
    def points(self) -> Array:
        """Points (k, 2)."""
        return np.array([s.p for s in self.spots])

    @cached_property
    def headings(self) -> Array:
        """Unit tangents (k, 2) in the direction in which the points follow one another."""
        tangents = np.array([s.tangent for s in self.spots])
        return tangents * self.sides[:, None]

    @cached_property
    def sides(self) -> IntArray:
        """On which side of the way growth lies at each point (k,): 1 on the left, −1 on the right."""
        tangents = np.array([s.tangent for s in self.spots])
        if len(tangents) < 2:
            return np.ones(len(tangents), dtype=np.int64)
        ways = np.diff(self.points, axis=0)
        along = np.vstack([ways[:1], ways]) + np.vstack([ways, ways[-1:]])
        return np.where(np.sum(tangents * along, axis=1) >= 0, 1, -1)

    @cached_property
    def omega(self) -> Array:
        """ω (k,) [1/s]."""
        return np.array([s.omega for s in self.spots])

    @cached_property
    def drawn(self) -> Drawn:
        """The curve in straight pieces."""
        return drawn(self.points, self.headings, self.sides, self.omega, self.roots)


@dataclass(frozen=True)
class Drawn:
    """A curve in straight pieces between points (m, 2), ω (m,) there, for each piece (m − 1,) on which side growth lies
    (1: left), and by how many more roots grow there."""

    points: Array
    omega: Array
    sides: IntArray
    roots: int


def drawn(points: Array, headings: Array, sides: IntArray, omega: Array, roots: int) -> Drawn:
    """Straight pieces of the cubics between points (k, 2) with unit tangents (k, 2), sides (k,) and ω (k,)."""
    if len(points) < 2:
        return Drawn(points, omega, np.zeros(0, dtype=np.int64), roots)
    u = np.linspace(0.0, 1.0, PIECES + 1)[:-1]
    pieces = [hermite(points[k], headings[k], points[k + 1], headings[k + 1], u) for k in range(len(points) - 1)]
    whole = np.arange(len(points), dtype=float)
    fine = np.append((whole[:-1, None] + u).ravel(), whole[-1])
    return Drawn(np.vstack([*pieces, points[-1:]]), np.interp(fine, whole, omega), np.repeat(sides[:-1], PIECES), roots)


def hermite(p: Array, heading: Array, q: Array, heading_to: Array, u: Array) -> Array:
    """The cubic (k, 2) at u (k,) in [0, 1] through two points with unit tangents there."""
    length = float(np.hypot(*(q - p)))
    u = np.asarray(u, dtype=float)[:, None]
    first, second = length * heading, length * heading_to
    return np.asarray(
        (1 + 2 * u) * (1 - u) ** 2 * p + u * (1 - u) ** 2 * first + u**2 * (3 - 2 * u) * q - u**2 * (1 - u) * second
    )


@dataclass(frozen=True)
class Crossing:
    """Where a straight line crosses a curve: at which share of the line, at which ω [1/s], number of the curve, sine
    of the angle between both, and by how many the growing roots change along the line."""

    at: float
    omega: float
    curve: int
    sine: float
    roots: int


def crossings(curves: Sequence[Drawn], start: Array, end: Array) -> list[Crossing]:
    """All of them along a line from start to end (2,), in order."""
    way = np.asarray(end, dtype=float) - start
    length = float(np.hypot(*way))
    found: list[Crossing] = []
    if not length:
        return found
    for number, curve in enumerate(curves):
        points, omega, sides = curve.points, curve.omega, curve.sides
        across = (way[0] * (points[:, 1] - start[1]) - way[1] * (points[:, 0] - start[0])) / length
        across = np.where(np.abs(across) <= 1e-12, 1e-12, across)
        for k in np.flatnonzero(np.sign(across[:-1]) != np.sign(across[1:])).tolist():
            part = across[k] / (across[k] - across[k + 1])
            here = points[k] + part * (points[k + 1] - points[k])
            at = float((here - start) @ way) / length**2
            if not -1e-12 <= at <= 1 + 1e-12:
                continue
            piece = points[k + 1] - points[k]
            sine = (piece[0] * way[1] - piece[1] * way[0]) / (length * max(float(np.hypot(*piece)), 1e-300))
            roots = int(np.sign(sine)) * int(sides[k]) * curve.roots
            found.append(Crossing(at, float(omega[k] + part * (omega[k + 1] - omega[k])), number, abs(sine), roots))
    return sorted(found, key=lambda c: c.at)


def carried(modes: int, roots: int, passed: Sequence[Crossing]) -> tuple[int, int, bool]:
    """How many modes and roots grow beyond crossings, from how many before them; and whether a pair that grows had to
    part on the real axis on the way, or two roots there to meet, which is on no curve.

    Roots are conserved but for what crosses; modes are not: what crosses at a divergence is one root, and the one that
    it left behind grows on. What crosses has to be there, so that of n roots there are n/2 modes at least and n at
    most.
    """
    parted = False
    for crossing in passed:
        modes, roots = modes + int(np.sign(crossing.roots)), roots + crossing.roots
        if roots >= 0:  # else more decay than grow: growth left the band on the way
            within = min(max(modes, (roots + 1) // 2), roots)
            parted |= within != modes
            modes = within
    return modes, roots, parted

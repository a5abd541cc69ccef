"""The way along a curve of critical values: predict along tangent and bend, correct at a right angle to that.

Steps are halved until Newton's method settles close to where it was predicted, tangents turn little, and the eigenpair
is the one of the step before, by its vector and by ω. Then points in the middle of every two are solved as well: where
one is off the cubic between its neighbours by more than the tolerance, both halves are looked at again.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from ...typing import Array
from .curve import StabilityCurve, hermite
from .plane import Plane
from .spot import CurvePoint, point_on

LONGEST, SHORTEST = 0.15, 1e-6  # steps, in shares of the ranges
CLOSELY = 0.01  # the longest where curves all but cross by less than the tolerance
FIRST = 0.02
TURN = 0.45  # [rad] a step may turn the tangent by
AIMED = 0.3  # and is meant to
HIT = 0.2  # of a step: how far from the prediction the point may lie
ALIKE = 0.6  # |xᴴx'| of vectors of unit length from one point to the next
OMEGA = 0.05  # of ω: how far from its prediction
STILL = 1e-3  # of the ranges: flutter that comes to rest nearer than that, and is followed no further, ends there
MOST = 3000  # points
LONG = 0.05  # pieces longer than that are halved in any case
EVENLY = 0.02  # of its change: how far off ω may be in the middle of two points
CLOSER = (1.0, 0.1, 0.01)  # of the tolerance: how far off the middle of a step may be, where one of a curve was
ROW, ROW_OMEGA = 5, 1e-3  # points in a row, and of ω there: curves that run along one another
LEVELS = 6  # halvings in the middle of two points
BESIDE = 0.5  # of a step: how far a point is looked for
INSIDE = 1e-12
CUSP = 1e-4  # how far from one another curves may end that end in one cusp


def traced(plane: Plane, seed: CurvePoint, tolerance: float, closely: bool = False) -> StabilityCurve:
    """The curve through a point, both ways until it leaves the rectangle or the band, or comes back.

    Where two curves of one frequency all but cross, a long step may end on the other one. Then there is no point in the
    middle of it, or one that is off; the curve is followed once more, by steps that have one each, and by finer ones
    where that does not do. closely: by the finest ones, where a jump within the tolerance matters.
    """
    if closely:
        return _both_ways(plane, seed, tolerance, CLOSER[-1] * tolerance, CLOSELY)
    curve = _both_ways(plane, seed, tolerance, None)
    for share in CLOSER:
        if not curve.unchecked:
            break
        again = _both_ways(plane, seed, tolerance, share * tolerance)
        curve = again if again.unchecked < curve.unchecked else curve
    return curve


def _both_ways(
    plane: Plane, seed: CurvePoint, tolerance: float, halfway: float | None, longest: float = LONGEST
) -> StabilityCurve:
    forward, end, closed = _march(plane, seed, 1, halfway, longest)
    backward: list[CurvePoint] = []
    start = end
    if not closed:
        backward, start, _ = _march(plane, seed, -1, halfway, longest)
    spots = [*reversed(backward), seed, *forward]
    return refined(plane, StabilityCurve(tuple(spots), closed, (start, end)), tolerance)


def apart(plane: Plane, one: StabilityCurve, other: StabilityCurve, tolerance: float) -> tuple[StabilityCurve, ...]:
    """Two curves followed once more where they run along one another: at a place where both all but cross one of them
    has jumped, by less than the tolerance perhaps, and the other one has not. As they are where they still do, as
    those of modes that a system has twice."""
    if not _along(one, other, tolerance):
        return one, other
    first = traced(plane, one.spots[len(one.spots) // 2], tolerance, closely=True)
    rest = max((*one.spots, *other.spots), key=lambda spot: _off(spot, first))
    second = traced(plane, rest, tolerance, closely=True)
    return (one, other) if _along(first, second, tolerance) else (first, second)


def _along(one: StabilityCurve, other: StabilityCurve, tolerance: float) -> bool:
    """Whether several points of one in a row lie on the other, with its frequency; both cross in one or two."""
    if one.kind != other.kind:
        return False
    row = 0
    for spot in one.spots:
        row = row + 1 if _off(spot, other) <= tolerance else 0
        if row == ROW:
            return True
    return False


def _off(spot: CurvePoint, curve: StabilityCurve) -> float:
    """How far a point is off a curve; infinite where the curve has another frequency there."""
    ways = curve.drawn.points - spot.p
    ends, pieces = ways[:-1], np.diff(curve.drawn.points, axis=0)
    if not len(pieces):
        return math.inf
    shares = np.clip(-np.sum(ends * pieces, axis=1) / np.maximum(np.sum(pieces**2, axis=1), 1e-300), 0.0, 1.0)
    off = np.hypot(*(ends + shares[:, None] * pieces).T)
    k = int(np.argmin(off))
    omega = curve.drawn.omega[k] + shares[k] * (curve.drawn.omega[k + 1] - curve.drawn.omega[k])
    return float(off[k]) if abs(omega - spot.omega) <= ROW_OMEGA * max(omega, spot.omega) else math.inf


def joined(curves: Sequence[StabilityCurve]) -> list[StabilityCurve]:
    """The same curves; where two of one kind were lost at one place and frequency they end in a cusp there: three
    undamped modes meet, or little damping has rounded that off by less than the shortest step."""
    lost = [(k, e) for k, c in enumerate(curves) for e in (0, 1) if c.ends[e] == "lost"]
    ends = [list(c.ends) for c in curves]
    for (k, e), (j, f) in combinations(lost, 2):
        if _same(curves[k].spots[-e], curves[j].spots[-f]):
            ends[k][e] = ends[j][f] = "cusp"
    return [replace(c, ends=(e[0], e[1])) for c, e in zip(curves, ends, strict=True)]


def without_points(curves: Sequence[StabilityCurve]) -> list[StabilityCurve]:
    """The curves without those of one point that is the end of another: the corner of a rectangle's edge in which two
    end is an onset of its line."""
    ends = [spot for c in curves if len(c.spots) > 1 for spot in (c.spots[0], c.spots[-1])]

    def corner(curve: StabilityCurve) -> bool:
        first, *others = curve.spots
        return not others and any(_same(first, end) for end in ends)

    return [c for c in curves if not corner(c)]


def _same(one: CurvePoint, other: CurvePoint) -> bool:
    """Whether two points of curves are one, of one kind and frequency."""
    near = one.kind == other.kind and float(np.hypot(*(one.p - other.p))) <= CUSP
    return near and abs(one.omega - other.omega) <= OMEGA * one.omega


@dataclass
class _MarchState:
    """Where a march is: the last point, the direction (2,) in which it goes on, its bend [rad per length], the step."""

    spot: CurvePoint
    heading: Array
    bend: float
    step: float


def _march(
    plane: Plane, seed: CurvePoint, sense: int, halfway: float | None, longest: float
) -> tuple[list[CurvePoint], str, bool]:
    """Points after the first one, how it ends, and whether it came back. halfway: how far off the point in the middle
    of every step may be, in shares of the ranges; None where none is looked for. longest: step."""
    way = _MarchState(seed, sense * seed.tangent, 0.0, FIRST)
    start, gone, found = way.heading, 0.0, list[CurvePoint]()
    while len(found) < MOST:
        if _leaving(way):
            return found, "edge", False
        way.step = min(way.step, longest)
        new = _next(plane, way, halfway)
        if new is None:
            return found, "zero frequency" if _stops(plane, way) else "lost", False
        if gone and _back(way, new, seed, start):
            return [*found, seed], "closed", True
        if new.omega > plane.top:
            return [*found, _at_top(plane, way, new)], "band", False
        gone += float(np.hypot(*(new.p - way.spot.p)))
        found.append(new)
        way = _on(way, new)
    return found, "lost", False


def _stops(plane: Plane, way: _MarchState) -> bool:
    """Whether flutter comes to rest a little further on: ω² falls to zero there as a straight line, or is already no
    more than that of a motion as a whole may be."""
    spot = way.spot
    if spot.kind == "standstill":
        return False
    falls = -float(spot.turn @ way.heading)
    return spot.omega <= max(2 * STILL * falls, 10 * plane.rest_limit)


def _at_top(plane: Plane, way: _MarchState, beyond: CurvePoint) -> CurvePoint:
    """The point between the last one and one beyond the band at which ω is the highest frequency."""
    old, top = way.spot, plane.top
    best, first, last = beyond, (0.0, old.omega), (float(np.hypot(*(beyond.p - old.p))), beyond.omega)
    for _ in range(8):
        step = first[0] + (top - first[1]) / (last[1] - first[1]) * (last[0] - first[0])
        new = _tried(plane, _MarchState(old, way.heading, way.bend, step))
        if new is None or abs(new.omega - top) >= abs(best.omega - top):
            break
        best = new
        if abs(new.omega - top) <= 1e-9 * top:
            break
        first, last = (first, (step, new.omega)) if new.omega > top else ((step, new.omega), last)
    return best


def _on(way: _MarchState, new: CurvePoint) -> _MarchState:
    """The way from the new point on, its next step as long as the bend allows."""
    heading = new.tangent if new.tangent @ way.heading >= 0 else -new.tangent
    length = float(np.hypot(*(new.p - way.spot.p)))
    turn = _angle(way.heading, heading)
    factor = AIMED / max(abs(turn), AIMED / 2)
    step = float(np.clip(length * factor, SHORTEST, LONGEST))
    return _MarchState(new, heading, turn / length if length else 0.0, step)


def _next(plane: Plane, way: _MarchState, halfway: float | None) -> CurvePoint | None:
    """The next point; None where no step, however short, leads to one."""
    while way.step >= SHORTEST:
        new = _tried(plane, way)
        if new is not None and _follows(plane, way, new) and (halfway is None or _passes(plane, way, new, halfway)):
            return new
        way.step *= 0.5
    return None


def _tried(plane: Plane, way: _MarchState) -> CurvePoint | None:
    """A step's point, on the edge of the rectangle where the step leads across that; None where there is none."""
    ahead = _rotated(way.heading, 0.5 * way.bend * way.step)
    target = way.spot.p + way.step * ahead
    if not inside(target):
        return _at_edge(plane, way, target)
    normal = _rotated(way.heading, way.bend * way.step + 0.5 * np.pi)
    new = _corrected(plane, way, target, normal, BESIDE * way.step)
    return _at_edge(plane, way, new.p) if new is not None and not inside(new.p) else new


def _at_edge(plane: Plane, way: _MarchState, target: Array) -> CurvePoint | None:
    """The point on the edge that the straight line from the last one to a target crosses, solved along the edge; None
    where it crosses none, or no point is found there."""
    last, step = way.spot.p, target - way.spot.p
    shares = [
        (float((edge - last[axis]) / step[axis]), axis, edge)
        for axis in (0, 1) for edge in (0.0, 1.0)
        if step[axis] and (target[axis] - edge) * (edge - 0.5) > 0
    ]  # fmt: skip
    if not shares:
        return None
    share, axis, edge = min(shares)
    guess = last + share * step
    guess[axis] = edge
    along = np.eye(2)[1 - axis]
    new = _corrected(plane, way, guess, along, max(BESIDE * share * way.step, 10 * SHORTEST))
    if new is None or not -INSIDE <= new.p[1 - axis] <= 1 + INSIDE:
        return None
    return new


def _corrected(plane: Plane, way: _MarchState, target: Array, direction: Array, reach: float) -> CurvePoint | None:
    chord = plane.chord(target, direction, (-reach, reach))
    spot = way.spot
    omega = spot.omega + float(spot.turn @ (target - spot.p))
    if spot.kind != "standstill" and omega <= plane.rest_limit:
        return None
    return point_on(plane, spot.kind, chord, omega, spot.right, spot.left)


def _follows(plane: Plane, way: _MarchState, new: CurvePoint) -> bool:
    """Whether a point is the next one of the same eigenpair's curve."""
    old, step = way.spot, new.p - way.spot.p
    length = float(np.hypot(*step))
    if length < 0.1 * SHORTEST:
        return False
    ahead = way.heading
    if old.kind == "crossing" and (new.tangent @ ahead) * (old.tangent @ ahead) < 0:
        return False  # growth would be on the other side: another branch, beyond a saddle
    heading = new.tangent if new.tangent @ ahead >= 0 else -new.tangent
    turn = _angle(ahead, heading)
    chord = _angle(ahead, step)
    if abs(turn) > TURN or abs(chord) > TURN or abs(chord - 0.5 * turn) > HIT:
        return False
    if old.kind == "standstill":
        return _like(plane, old, new)
    if new.omega <= plane.rest_limit:
        return False
    omega = old.omega + float(old.turn @ step)
    return abs(new.omega - omega) <= OMEGA * max(old.omega, new.omega) and _like(plane, old, new)


def _like(plane: Plane, one: CurvePoint, other: CurvePoint) -> bool:
    """Whether both have the same vectors, every unknown weighed by what its stiffness makes of it."""
    for a, b in ((one.right, other.right), (one.left, other.left)):
        a, b = plane.sizes * a, plane.sizes * b
        if abs(np.vdot(a, b)) < ALIKE * np.linalg.norm(a) * np.linalg.norm(b):
            return False
    return True


def _back(way: _MarchState, new: CurvePoint, seed: CurvePoint, start: Array) -> bool:
    """Whether the step from the last point to the new one passes the first again, in its direction and as its mode."""
    old, step = way.spot, new.p - way.spot.p
    length = float(np.hypot(*step))
    ahead = new.tangent if new.tangent @ way.heading >= 0 else -new.tangent
    if (seed.p - old.p) @ step <= 0 or (seed.p - new.p) @ step > 0 or ahead @ start < np.cos(TURN):
        return False
    share = float((seed.p - old.p) @ step) / length**2
    (near,) = hermite(old.p, way.heading, new.p, ahead, np.array([share]))
    omega = (1 - share) * old.omega + share * new.omega
    same = abs(omega - seed.omega) <= 0.5 * OMEGA * max(abs(seed.omega), 1e-300) or seed.kind == "standstill"
    return same and float(np.hypot(*(seed.p - near))) <= 0.02 * length


def refined(plane: Plane, curve: StabilityCurve, tolerance: float) -> StabilityCurve:
    """The curve with points in the middle of every two, and more where a middle was not where it was expected."""
    spots, headings = curve.spots, curve.headings
    result, worst, unchecked = [spots[0]], 0.0, 0
    for k in range(len(spots) - 1):
        ends = [(spots[j], headings[j]) for j in (k, k + 1)]
        more, off, missing = _between(plane, ends[0], ends[1], tolerance, LEVELS)
        result += [*more, spots[k + 1]]
        worst, unchecked = max(worst, off), unchecked + missing
    return StabilityCurve(tuple(result), curve.closed, curve.ends, worst, unchecked)


def _between(
    plane: Plane, one: tuple[CurvePoint, Array], other: tuple[CurvePoint, Array], tolerance: float, levels: int
) -> tuple[list[CurvePoint], float, int]:
    """Points between two, how far at most the last middle was off, and in how many pieces none was found."""
    (old, heading), (new, heading_to) = one, other
    length = float(np.hypot(*(new.p - old.p)))
    if length <= 0.1 * tolerance:
        return [], 0.0, 0
    # At a standstill growth changes sides where flutter ends on it, which is to be known as well as the curve.
    flips = (old.tangent @ heading) * (new.tangent @ heading_to) < 0
    spot, off = _halfway(plane, one, other)
    if spot is None:
        return [], 0.0, int(length > tolerance)
    smooth = off <= tolerance and length <= LONG and _even(old, spot, new, heading, heading_to)
    if (smooth and not flips) or levels <= (-LEVELS if flips else 0):
        return [spot], off, int(off > tolerance)
    ahead = spot.tangent if spot.tangent @ (new.p - old.p) >= 0 else -spot.tangent
    first, one_off, lost = _between(plane, one, (spot, ahead), tolerance, levels - 1)
    last, other_off, lost_too = _between(plane, (spot, ahead), other, tolerance, levels - 1)
    return [*first, spot, *last], max(one_off, other_off), lost + lost_too


def _halfway(
    plane: Plane, one: tuple[CurvePoint, Array], other: tuple[CurvePoint, Array]
) -> tuple[CurvePoint | None, float]:
    """The point in the middle of two points with their headings, and how far it is off the cubic between them; None
    where there is none of the first one's eigenpair."""
    (old, heading), (new, heading_to) = one, other
    length = float(np.hypot(*(new.p - old.p)))
    (middle,) = hermite(old.p, heading, new.p, heading_to, np.array([0.5]))
    across = _rotated(new.p - old.p, 0.5 * np.pi) / length
    chord = plane.chord(middle, across, (-0.3 * length, 0.3 * length))
    spot = point_on(plane, old.kind, chord, 0.5 * (old.omega + new.omega), old.right, old.left)
    if spot is None or not _like(plane, old, spot):
        return None, 0.0
    return spot, float(np.hypot(*(spot.p - middle)))


def _passes(plane: Plane, way: _MarchState, new: CurvePoint, halfway: float) -> bool:
    """Whether the curve has a point in the middle of a step, near the cubic between its ends, ω included."""
    ahead = new.tangent if new.tangent @ way.heading >= 0 else -new.tangent
    if float(np.hypot(*(new.p - way.spot.p))) <= halfway:
        return True  # no longer than what a piece may be off
    spot, off = _halfway(plane, (way.spot, way.heading), (new, ahead))
    return spot is not None and off <= halfway and _even(way.spot, spot, new, way.heading, ahead)


def _even(old: CurvePoint, middle: CurvePoint, new: CurvePoint, heading: Array, heading_to: Array) -> bool:
    """Whether ω, too, is in the middle where the cubic through both ends has it: near places where two modes all but
    meet it changes within less than a step, and the curve turns there and back."""
    if old.kind != "crossing":
        return True
    length = float(np.hypot(*(new.p - old.p)))
    first, last = (float(spot.turn @ way) for spot, way in ((old, heading), (new, heading_to)))
    expected = 0.5 * (old.omega + new.omega) + length / 8 * (first - last)
    size = length * max(abs(first), abs(last)) + abs(new.omega - old.omega)
    return abs(middle.omega - expected) <= EVENLY * size + 1e-6 * middle.omega


def _leaving(way: _MarchState) -> bool:
    """Whether the last point is on the edge and the way leads out."""
    p, ahead = way.spot.p, way.heading
    return any(
        (p[axis] <= INSIDE and ahead[axis] < 0) or (p[axis] >= 1 - INSIDE and ahead[axis] > 0) for axis in (0, 1)
    )


def inside(p: Array) -> bool:
    """Whether a point (2,) is in the rectangle, its edges included."""
    return bool(np.all(p >= -INSIDE) and np.all(p <= 1 + INSIDE))


def _rotated(vector: Array, angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([c * vector[0] - s * vector[1], s * vector[0] + c * vector[1]])


def _angle(one: Array, other: Array) -> float:
    """From one direction to the other [rad]."""
    return float(np.arctan2(one[0] * other[1] - one[1] * other[0], one @ other))

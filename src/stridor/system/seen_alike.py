"""Whether what does not feel how many press on it, or has no images, is the same to every sector of a slave.

A held master and an obstacle take no part in what repeats: one sector of the slave stands for all of them only where
each of them finds below it what the first one does. The others' places are those of the first, moved: what is there
must be what is here. A wall round all of them is, and one longer than the slave; pads by another angle are not, nor
is one that reaches over the slave's cut and into its own images.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from ..case import Case
from ..case.schema import Contact as ContactCase
from ..contact.master import MasterSurface
from ..errors import CaseError
from ..mesh.facets import facet_normals, nodal_normals
from ..typing import Array, BoolArray, IntArray
from .bodies import BuiltBody
from .repeats import SAME, TOUCHING, Repeat, slave_positions
from .sectors import (
    INWARDS,
    NEAR,
    Side,
    clash,
    meets_itself,
    motion_words,
    near_of,
    repeats_by,
    samples_of,
    side_of,
    surface_of,
)

# Of the way from the middle of a slave's facet to its nodes: what is narrower than between two of them is seen at the
# ends of the master alone.
FRACTIONS = (0.3, 0.6, 1.0 - 2.0 * INWARDS)
# Other steps than the first that are looked at where no number of them leads back to the beginning.
MOST = 32
# Of the size of what repeats: axes, ways and normals of a case file are given to as many digits.
DIGITS = 1e-5
# Between the normals of a facet and of its nodes, which are half way to the next facet: where facets turn by more than
# 40° there is a corner, and no curve.
NOTHING_HERE = "nothing is below it, and something below another sector"
NOTHING_THERE = "something is below it, and nothing below another sector"
SHARP = 2.0 * math.sin(math.radians(10.0)) * (1.0 + TOUCHING)


@dataclass(frozen=True)
class Seen:
    """A master as it lies below some places: its surface, the displacements (k, d, p) [m] of its nodes by prescribed
    motions, and the velocity (q, d) [m/s] of its material at places (q, d) [m]."""

    surface: MasterSurface
    lift: Array
    velocity: Callable[[Array], Array]


def require_seen_alike(
    case: Case,
    bodies: dict[str, BuiltBody],
    name: str,
    contact: ContactCase,
    seen: Callable[[Array], Seen],
) -> None:
    """Raises CaseError where sectors of a slave that repeats do not all find the same of a master. seen: the master
    below places (q, d) [m]."""
    slave = side_of(case, bodies, f"contacts.{name}.slave", contact.slave)
    if slave is None or not slave.repeats:
        return
    master = side_of(case, bodies, f"contacts.{name}.master", contact.master)
    points, size = _places(slave, master, slave_positions(case, bodies, contact.slave, f"contacts.{name}.slave"))
    extent = float(np.abs(points - points.mean(axis=0)).max(initial=0.0))
    for repeat in slave.repeats:
        both = False
        if master is not None:
            if repeats_by(repeat, master, slave, master):
                continue
            both = any(clash(repeat, each, master.ways) for each in master.repeats)
            line = "." not in contact.master  # of a beam, which has no images
            if not both and not line and not meets_itself(repeat, slave.ways, master, near_of(slave, master)):
                continue  # it has images by this motion
        moved = list(_moved(repeat, points, master, both=both))
        if not moved:
            continue
        whole = np.concatenate([points, *(at for at, _ in moved)])
        extent = max(extent, float(np.abs(whole - whole.mean(axis=0)).max()))
        # An obstacle is known to the digits of its numbers, facets of a curve to what is between it and its chords.
        apart = np.full(len(points), DIGITS * extent) if master is None else SAME * size + _bulge(master)
        at, otherwise = _differs(seen(whole), whole, [turn for _, turn in moved], size, apart, master, both=both)
        if at is None and master is not None and slave.facets:
            at, otherwise = _ends_differ(seen, slave, master, repeat, both=both)
        if at is not None:
            _refuse(name, contact, repeat, at, otherwise)


def _places(slave: Side, master: Side | None, nodes: Array) -> tuple[Array, Array]:
    """Points (q, d) [m] of a slave, within its facets, and the size (q,) [m] of these; of a point its place alone, the
    only one of nodes (1, d) [m]."""
    if slave.facets:
        parts = [samples_of(slave.points, slave.facets, fraction) for fraction in FRACTIONS]
        return np.concatenate([part[0] for part in parts]), np.concatenate([part[2] for part in parts])
    size = math.inf if master is None else near_of(slave, master) / SAME
    return nodes, np.full(len(nodes), size)


def _moved(repeat: Repeat, points: Array, master: Side | None, *, both: bool) -> Iterator[tuple[Array, Array]]:
    """Points (q, d) [m] at the places of other sectors, and the turns (d, d) to there."""
    if repeat.rotation is None:
        most = 1  # an obstacle goes on for ever
        if both:
            most = MOST
        elif master is not None:
            length = float(np.linalg.norm(np.ptp(np.concatenate([points, master.points]), axis=0)))
            most = min(MOST, math.ceil(length / float(np.linalg.norm(repeat.way))))
        for times in (t for k in range(1, most + 1) for t in (k, -k)):
            yield repeat.moved(points, times)
        return
    # One angle in other digits leads back to nearly the beginning: 360 of 7 are seven times 51.4286.
    step = abs(repeat.step_deg)
    back = next((t for t in range(1, 721) if abs(math.remainder(t * step, 360.0)) <= SAME * step), None)
    for times in (1, -1) if back is None else range(1, back):
        yield repeat.moved(points, times)


def _bulge(side: Side) -> float:
    """How far [m] a curve may lie from the chords of it that facets are, by the angles between those."""
    normals = nodal_normals(side.points, side.facets)
    found = 0.0
    for kind, block in side.facets.items():
        own = facet_normals(side.points, block, kind)
        away = np.linalg.norm(normals[block] - own[:, None], axis=2).max(axis=1)
        size = np.linalg.norm(np.ptp(side.points[block], axis=1), axis=1)
        found = max(found, float((size * away)[away <= SHARP].max(initial=0.0)))
    return 0.5 * found


def _differs(
    seen: Seen, places: Array, turns: list[Array], size: Array, apart: Array, master: Side | None, *, both: bool
) -> tuple[Array | None, str]:
    """A place (d,) [m] of the slave below which another sector of it finds something else, and what; None where none
    does. places: the points (q, d) [m] of the slave, then those of the others; apart (q,) [m]: gaps that are one;
    both: whether the others must find all that is there."""
    found = seen.surface.locate(places)
    count = len(size)
    along = np.linalg.norm(places - found.point, axis=1) ** 2 - found.gap**2
    beyond = ~found.inside & (np.sqrt(np.maximum(along, 0.0)) > INWARDS * np.resize(size, len(places)))
    near = np.abs(found.gap) <= NEAR * np.resize(size, len(places))
    here = slice(0, count)
    speed = [seen.velocity(places)]
    if len(seen.lift):
        lifted = np.einsum("qr,qrdp->pqd", found.weights, seen.lift[found.nodes])
        speed += list(lifted)
    scale = [float(np.linalg.norm(each, axis=1).max(initial=0.0)) for each in speed]
    for number, turn in enumerate(turns, start=1):
        there = slice(number * count, (number + 1) * count)
        gap, other = found.gap[here], found.gap[there]
        lone: BoolArray = found.inside[there] & near[there] & beyond[here]
        empty: BoolArray = found.inside[here] & near[here] & beyond[there] & both
        meet: BoolArray = found.inside[here] & found.inside[there]
        if master is None:
            # Obstacles may stand one to each sector, and go on beyond it: the nearer one counts.
            uneven = meet & (other < gap - apart) & (other <= NEAR * size)
        else:
            uneven = meet & (near[here] | near[there]) & (np.abs(other - gap) > apart)
        same = meet & (near[here] | near[there]) & (np.abs(other - gap) <= apart)
        away = np.zeros(count, dtype=bool)
        for each, largest in zip(speed, scale, strict=True):
            away |= np.linalg.norm(each[there] - each[here] @ turn.T, axis=1) > SAME * largest
        for where, words in (
            (lone, NOTHING_HERE),
            (empty, NOTHING_THERE),
            (uneven, "it is at another distance below another sector"),
            (same & away, "it moves in another direction below another sector"),
        ):
            if where.any():
                return places[int(np.argmax(where))], words
    return None, ""


def _ends_differ(
    seen: Callable[[Array], Seen], slave: Side, master: Side, repeat: Repeat, *, both: bool
) -> tuple[Array | None, str]:
    """As `_differs` right beyond the ends of a master: gaps there may be too narrow for points within the slave's
    facets."""
    at, _, sizes = samples_of(slave.points, slave.facets)
    ends, outward, bend = _ends(master)
    if not len(ends):
        return None, ""
    size = sizes[np.asarray(cKDTree(at).query(ends)[1], dtype=np.int64)]
    # Edges of curves are as uncertain as their chords are off these.
    off = SAME * size + bend
    over = surface_of(slave).locate(ends + (off + SAME * size)[:, None] * outward)
    held = np.flatnonzero(over.inside & (np.abs(over.gap) <= NEAR * size))
    points, size, off = over.point[held], size[held], off[held]
    count, moved = len(held), list(_moved(repeat, points, master, both=both)) if len(held) else []
    if not moved:
        return None, ""
    places = np.concatenate([points, *(there for there, _ in moved)])
    found = seen(places).surface.locate(places)
    along = np.linalg.norm(places - found.point, axis=1) ** 2 - found.gap**2
    empty = ~found.inside & (np.sqrt(np.maximum(along, 0.0)) > 0.5 * np.resize(off, len(places)))
    full = found.inside & (np.abs(found.gap) <= NEAR * np.resize(size, len(places)))
    for number in range(1, len(moved) + 1):
        there = slice(number * count, (number + 1) * count)
        lone = full[there] & empty[:count]
        if lone.any():
            return points[int(np.argmax(lone))], NOTHING_HERE
        lone = full[:count] & empty[there] & both
        if lone.any():
            return points[int(np.argmax(lone))], NOTHING_THERE
    return None, ""


def _ends(side: Side) -> tuple[Array, Array, Array]:
    """Middles (q, d) [m] of the edges of a surface, in the plane its ends, unit directions (q, d) out of it there, and
    how far (q,) [m] these edges are off the curves that they may be chords of."""
    d = side.points.shape[1]
    edges: list[IntArray] = []
    middles: list[Array] = []
    for kind, block in side.facets.items():
        corners = block[:, :2] if d == 2 else block[:, : 3 if kind.startswith("triangle") else 4]
        centre = side.points[corners].mean(axis=1)
        for corner in range(corners.shape[1]):
            pair = corners[:, [corner, corner]] if d == 2 else corners[:, [corner, (corner + 1) % corners.shape[1]]]
            edges.append(np.sort(pair, axis=1))
            middles.append(centre)
    both, centre = np.concatenate(edges), np.concatenate(middles)
    _, first, times = np.unique(both, axis=0, return_index=True, return_counts=True)
    alone = first[times == 1]
    pair, centre = both[alone], centre[alone]
    begin, end = side.points[pair[:, 0]], side.points[pair[:, 1]]
    along = end - begin
    length = np.linalg.norm(along, axis=1, keepdims=True)
    along = np.divide(along, length, out=np.zeros_like(along), where=length > 0)
    outward = 0.5 * (begin + end) - centre
    outward -= np.sum(outward * along, axis=1, keepdims=True) * along
    outward /= np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), 1e-300)
    bend = np.zeros(len(pair))
    if d == 3:
        # Half of the angle to the next edge at each end, which on a circle is that between chord and tangent.
        order = np.argsort(pair.ravel(), kind="stable")
        node = pair.ravel()[order]
        twice = np.flatnonzero(node[1:] == node[:-1])
        one, other = order[twice] // 2, order[twice + 1] // 2
        cosine = np.abs(np.sum(along[one] * along[other], axis=1))
        sine = np.sqrt(np.maximum(1.0 - cosine**2, 0.0))
        slight = cosine > np.cos(np.radians(40.0))
        longer = np.maximum(length[one, 0], length[other, 0])
        off = np.where(slight, longer * sine / 4.0, 0.0)
        np.maximum.at(bend, one, off)
        np.maximum.at(bend, other, off)
    return 0.5 * (begin + end), outward, bend


def _refuse(name: str, contact: ContactCase, repeat: Repeat, at: Array, otherwise: str) -> None:
    accepted = (
        f"is not the same below all sectors of the slave {contact.slave}, which repeats by {motion_words(repeat)}: at "
        f"({', '.join(f'{x:.6g}' for x in at)}) m {otherwise}. Take a master that is alike below all of them (round "
        "about the axis of the turn, or straight along the step), that repeats by the same motion, or one to a sector "
        "that does not reach over the slave's cut; or the slave whole, without its tie"
    )
    raise CaseError(f"contacts.{name}.master", contact.master, accepted)

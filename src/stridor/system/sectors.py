"""Whether both sides of a contact are the same part of a whole.

Of a body that repeats one sector stands for all, which do what it does: what touches it touches each of them. So the
other side repeats alike or is one of as many, and must not reach into its own images by the motion of the first: the
forces of a whole ring on one sector of a wheel are those of all sectors on one.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ..case import Case
from ..case.points import BoundaryRef
from ..case.schema import Contact as ContactCase
from ..contact.curve import Curve
from ..contact.facets import FacetSurface
from ..errors import CaseError
from ..mesh.boundary import require_boundary
from ..mesh.facets import facet_normals, reference_nodes, shape_functions
from ..mesh.model import Blocks
from ..typing import Array, BoolArray
from .bodies import BuiltBody
from .repeats import SAME, TOUCHING, Repeat, between, pieces_of, repeats_of, widest

# Of a facet, from its edges inwards: what reaches into another one by less touches it.
INWARDS = 0.05
# Of the size of a facet, and the cosine between normals: what is that near, and turned alike, is in one place.
NEAR, ALONG = 0.5, 0.5
PARALLEL = 1e-6  # sine between an axis and a way


@dataclass(frozen=True)
class Side:
    """A side of a contact: how its body repeats, points (k, d) [m] and facets between them, none of a point."""

    name: str
    reference: str
    repeats: list[Repeat]
    points: Array
    facets: Blocks

    @property
    def ways(self) -> Array:
        """All translations (t, d) [m]."""
        return np.array([r.way for r in self.repeats if r.rotation is None]).reshape(-1, self.points.shape[1])


def require_same_sectors(case: Case, bodies: dict[str, BuiltBody], name: str, contact: ContactCase) -> None:
    """Raises CaseError where one side of a contact repeats and the other one does so otherwise, or is longer than one
    sector of the first."""
    sides = [side_of(case, bodies, f"contacts.{name}.{key}", getattr(contact, key)) for key in ("slave", "master")]
    if any(side is None for side in sides):
        return
    slave, master = (side for side in sides if side is not None)
    for moving, other in ((master, slave), (slave, master)):
        lattice, near = other.ways, near_of(slave, master)
        for repeat in moving.repeats:
            if repeats_by(repeat, other, slave, master):
                continue
            where = f"contacts.{name}.{other.name}"
            clashing = next((each for each in other.repeats if clash(repeat, each, lattice)), None)
            if clashing is not None:
                accepted = (
                    f"repeats by {motion_words(clashing)}, the {moving.name} {moving.reference} by "
                    f"{motion_words(repeat)}: what touches one sector of the one is no sector of the other. Let both "
                    "repeat alike, or take both whole"
                )
                raise CaseError(where, other.reference, accepted)
            if other.facets and meets_itself(repeat, moving.ways, other, near):
                raise CaseError(where, other.reference, _too_long(repeat, moving, other))


def require_apart_from_images(case: Case, bodies: dict[str, BuiltBody], name: str, contact: ContactCase) -> None:
    """Raises CaseError where a side of a contact lies in the place of its own images by what its body repeats by."""
    for key in ("slave", "master"):
        side = side_of(case, bodies, f"contacts.{name}.{key}", getattr(contact, key))
        if side is None or not side.facets:
            continue
        near = SAME * _smallest(side.points, side.facets)[1]
        for repeat in side.repeats:
            if meets_itself(repeat, side.ways, side, near, own=True):
                spans, sector = _lengths(repeat, side.ways, side)
                accepted = (
                    f"spans {spans} and its body repeats by {sector} (ties.{repeat.name}): its images lie one in the "
                    f"other, and places of the {key} would count more than once. Take a {key} no longer than a sector"
                )
                raise CaseError(f"contacts.{name}.{key}", side.reference, accepted)


def lent_repeats(case: Case, bodies: dict[str, BuiltBody], contact: ContactCase) -> list[Repeat]:
    """Motions by which the slave of a contact repeats and its master does not, which is one of as many then: the slave
    meets the others of them beyond its own cut. None by which the master reaches into itself, as a whole ring does."""
    slave = side_of(case, bodies, "contacts.slave", contact.slave)
    if slave is None or not slave.repeats:
        return []
    master = side_of(case, bodies, "contacts.master", contact.master)
    if master is None:
        return []
    near, nowhere = near_of(slave, master), np.zeros(0, dtype=np.int64)
    return [
        replace(repeat, end=nowhere, start=nowhere)
        for repeat in slave.repeats
        if not repeats_by(repeat, master, slave, master)
        and not any(clash(repeat, each, master.ways) for each in master.repeats)
        and not meets_itself(repeat, slave.ways, master, near)
    ]


def side_of(case: Case, bodies: dict[str, BuiltBody], where: str, reference: str) -> Side | None:
    """A side of a contact, whose key ``where`` ends in, the line of a beam among them; None for an obstacle and for
    points of what has no mesh. A point has the points of its body."""
    key = where.rpartition(".")[2]
    body = bodies.get(reference.partition(".")[0])
    if body is not None and body.beam is not None and reference == body.name:
        first = np.arange(len(body.points) - 1)
        return Side(key, reference, [], body.points, {"line": np.stack([first, first + 1], axis=1)})
    if body is None or body.mesh is None:
        return None
    repeats = repeats_of(case, bodies, body.name)
    at = case.location(reference) if "." in reference else None
    if not isinstance(at, BoundaryRef):
        return Side(key, reference, repeats, body.points, {})
    given = require_boundary(body.mesh, at.boundary, where)
    nodes = np.unique(np.concatenate([block.ravel() for block in given.values()]))
    facets = {kind: np.searchsorted(nodes, block) for kind, block in given.items() if len(block)}
    return Side(key, reference, repeats, body.points[nodes], facets)


def near_of(slave: Side, master: Side) -> float:
    """Distance [m] within which places are one. Of facets, not of distances between nodes: where meshes match these
    lie on each other."""
    return SAME * min(_smallest(side.points, side.facets)[1] for side in (slave, master) if side.facets)


def _smallest(points: Array, facets: Blocks) -> tuple[Array, float]:
    """Size (k,) [m] of the smallest facet at each point, NaN where there is none, and of the smallest one of all."""
    found = np.full(len(points), np.inf)
    for block in facets.values():
        size = np.linalg.norm(np.ptp(points[block], axis=1), axis=1)
        np.minimum.at(found, block, size[:, None])
    return np.where(np.isfinite(found), found, np.nan), float(found.min())


def repeats_by(repeat: Repeat, other: Side, slave: Side, master: Side) -> bool:
    """Whether a side repeats by a motion of the other one too, as far as facets of either can tell."""
    near = near_of(slave, master)
    points = np.concatenate([slave.points, master.points])
    size = np.concatenate([_smallest(side.points, side.facets)[0] for side in (slave, master)])
    alike = np.where(np.isnan(size), near, SAME * size)
    return any(repeat.same_as(each, points, alike) for each in other.repeats) or _within(repeat, other.ways, near)


def _within(repeat: Repeat, lattice: Array, near: float) -> bool:
    """Whether a translation is a sum of whole ones of a lattice (t, d) [m]."""
    if repeat.rotation is not None or not len(lattice):
        return False
    return _is_sum(repeat.way, lattice, near)


def _is_sum(way: Array, lattice: Array, near: float) -> bool:
    whole = np.round(way @ np.linalg.pinv(lattice))
    return bool(np.linalg.norm(whole @ lattice - way) <= near)


def clash(one: Repeat, other: Repeat, lattice: Array) -> bool:
    """Whether two motions that are not the same cannot both leave one whole as it is. lattice (t, d) [m]: all
    translations of the other one's body."""
    if one.rotation is None and other.rotation is None:
        # Along the same line, or within the same plane: steps that differ.
        off = one.way - one.way @ np.linalg.pinv(lattice) @ lattice
        return float(np.linalg.norm(off)) <= PARALLEL * float(np.linalg.norm(one.way))
    if one.rotation is not None and other.rotation is not None:
        return True  # other axes, or other sectors about one
    turning, sliding = (one, other) if one.rotation is not None else (other, one)
    assert turning.rotation is not None
    axis = np.array(turning.rotation.axis) / np.linalg.norm(turning.rotation.axis)
    way = np.zeros(3)
    way[: len(sliding.way)] = sliding.way
    return float(np.linalg.norm(np.cross(axis, way))) > PARALLEL * float(np.linalg.norm(way))


def meets_itself(repeat: Repeat, ways: Array, side: Side, near: float, *, own: bool = False) -> bool:
    """Whether the facets of a side, moved by what another body repeats by, or its ``own``, lie in the place of others
    of it. ways (t, d) [m]: all translations of that body."""
    at = repeat.places(side.points, ways)
    around = round(repeat.around) if math.isfinite(repeat.around) else math.inf
    reach = between(at, around)
    if reach is None or ((own or repeat.rotation is not None) and reach[1] - reach[0] <= 1.0 + TOUCHING):
        return False
    samples, normals, size = samples_of(side.points, side.facets)
    surface = surface_of(side)
    lattice = np.zeros((0, side.points.shape[1])) if own else side.ways  # moves that are the side's own do not count
    for moved, turned in _moved(repeat, ways, side, lattice, reach, samples, normals, near):
        found = surface.locate(moved)
        hit: BoolArray = found.inside & (np.abs(found.gap) <= NEAR * size)
        if bool(np.any(hit & (np.sum(turned * found.normal, axis=1) > ALONG))):
            return True
    return False


def surface_of(side: Side) -> Curve | FacetSurface:
    """The facets of a side as a surface, each by itself in space: no matter how those of a slave meet."""
    where = ""
    if side.points.shape[1] == 2:
        pieces = pieces_of(side.facets)
        return Curve.side_by_side([Curve.from_facets(side.points, piece, where=where) for piece in pieces])
    alone = {kind: np.zeros_like(block) for kind, block in side.facets.items()}
    order = np.concatenate([block.ravel() for block in side.facets.values()])
    begin = 0
    for kind, block in side.facets.items():
        alone[kind] = begin + np.arange(block.size).reshape(block.shape)
        begin += block.size
    return FacetSurface.from_facets(side.points[order], alone, where=where)


def _moved(
    repeat: Repeat,
    ways: Array,
    side: Side,
    lattice: Array,
    reach: tuple[float, float],
    samples: Array,
    normals: Array,
    near: float,
) -> Iterator[tuple[Array, Array]]:
    """Samples (q, d) [m] and normals (q, d) moved by every multiple of a turn, or every sum of translations with some
    of this one, that can bring a side that reaches so far to its own place."""
    if repeat.rotation is not None:
        for times in range(1, math.floor(reach[1] - reach[0] + TOUCHING) + 1):
            moved, turn = repeat.moved(samples, times)
            yield moved, normals @ turn.T
        return
    along = np.ptp(side.points @ np.linalg.pinv(ways), axis=0)
    most = [range(-math.floor(length + TOUCHING), math.floor(length + TOUCHING) + 1) for length in along.tolist()]
    this = int(np.argmin(np.abs(ways - repeat.way).max(axis=1)))
    for steps in itertools.product(*most):
        way = np.array(steps) @ ways
        known = float(np.linalg.norm(way)) <= near or (len(lattice) > 0 and _is_sum(way, lattice, near))
        if steps[this] > 0 and not known:
            yield samples + way, normals


def samples_of(points: Array, facets: Blocks, fraction: float = 1.0 - 2.0 * INWARDS) -> tuple[Array, Array, Array]:
    """Points (q, d) [m] within facets, as near to all of their nodes as they are not to touch what is beside them, or a
    fraction of the way to there from the middle, with the normal (q, d) and the size (q,) [m] of the facet."""
    found: list[tuple[Array, Array, Array]] = []
    for kind, block in facets.items():
        nodes = reference_nodes(kind)
        centre = nodes.mean(axis=0)
        local = np.concatenate([centre + fraction * (nodes - centre), centre[None]])
        values = shape_functions(kind, local)[0]
        at = np.einsum("qr,frd->fqd", values, points[block]).reshape(-1, points.shape[1])
        size = np.linalg.norm(np.ptp(points[block], axis=1), axis=1)
        normal = facet_normals(points, block, kind)
        found.append((at, np.repeat(normal, len(local), axis=0), np.repeat(size, len(local))))
    at, normals, sizes = (np.concatenate(part) for part in zip(*found, strict=True))
    return at, normals, sizes


def _lengths(repeat: Repeat, ways: Array, side: Side) -> tuple[str, str]:
    """How far a side reaches along a repetition, and its step, in words. ways (t, d) [m]: of the body that repeats."""
    at = repeat.places(side.points, ways)
    around = round(repeat.around) if math.isfinite(repeat.around) else math.inf
    reach = between(at, around)
    assert reach is not None, "it meets itself"
    length = reach[1] - reach[0]
    if around - length <= widest(at, side.facets, around) + TOUCHING:
        length = around
    step, unit = (float(np.linalg.norm(repeat.way)), " m") if repeat.rotation is None else (abs(repeat.step_deg), "°")
    return f"{length * step:.6g}{unit}", f"{step:.6g}{unit}"


def _too_long(repeat: Repeat, moving: Side, other: Side) -> str:
    spans, sector = _lengths(repeat, moving.ways, other)
    return (
        f"spans {spans}, a sector of the {moving.name} {moving.reference} {sector} (ties.{repeat.name}): its images "
        "lie one in the other, and one sector would take the forces of several. Take a "
        f"{other.name} no longer than a sector, or the same part of both: the {moving.name} whole, without its tie"
        + (f", or the {other.name} as a sector with one" if "." in other.reference else "")  # no tie bonds a line
    )


def motion_words(repeat: Repeat) -> str:
    """A motion and its tie, as messages name it."""
    if repeat.rotation is None:
        return f"({', '.join(f'{x:.10g}' for x in repeat.way)}) m (ties.{repeat.name})"
    return f"{repeat.rotation.angle_deg:.10g}° (ties.{repeat.name})"

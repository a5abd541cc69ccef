"""Masters of bodies that repeat: they go on beyond the cut, by what the tie says lies there.

A boundary ends where the mesh of its sector does, the surface does not. Its images give a master the normals of the
whole surface up to the cut, and a slave what it lies on, wherever its own sector begins: of a ring those that the slave
can meet, all of them where these go round. Their nodes move as those that they are images of, turned. Images of a
boundary that does not reach both sides of the cut, is on one of several bodies of a sector, or whose meshes do not
match there are pieces by themselves. So are those of a master that does not repeat under a slave that does: one pad to
each sector reaches over the slave's cut.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from ..case import Case
from ..case.points import BoundaryRef, PointRef
from ..case.schema import Rotation
from ..contact.curve import Curve
from ..contact.facets import FacetSurface
from ..contact.interface import Rows
from ..mesh.boundary import require_boundary
from ..mesh.facets import chain_of
from ..mesh.model import Blocks
from ..typing import Array, IntArray, Sparse
from .bodies import BuiltBody
from .supports import boundary_nodes, master_surface, turn_of
from .view import View, point_position

SAME = 1e-3  # of the distance between neighbouring nodes: one place
ALIKE = 1e-9  # of their lengths: two ties that say the same, or the opposite
# Of a sector, and of a number of sectors: an image that reaches the slave's margin by less does not.
TOUCHING = 1e-6
# Splines and smoothed normals know of two facets beyond the one that a slave is on.
AROUND = 2.0


@dataclass(frozen=True)
class _Sheet:
    """Points (k, d) [m] and facets between them, each the image of a node of the mesh, ``origin`` (k,), by a turn
    (k, d, d)."""

    points: Array
    blocks: Blocks
    origin: IntArray
    turns: Array

    @property
    def used(self) -> _Sheet:
        """The sheet without points that belong to no facet."""
        kept = np.unique(np.concatenate([block.ravel() for block in self.blocks.values()]))
        blocks = {kind: np.searchsorted(kept, block) for kind, block in self.blocks.items()}
        return _Sheet(self.points[kept], blocks, self.origin[kept], self.turns[kept])


@dataclass(frozen=True)
class Repeat:
    """How a body repeats by a tie of a name: what lies on its nodes ``start`` lies moved on its nodes ``end``, by a way
    (d,) [m] or by a rotation. None of them is on this body where others of the sector reach the cut."""

    name: str
    end: IntArray
    start: IntArray
    way: Array
    rotation: Rotation | None

    def moved(self, points: Array, times: int) -> tuple[Array, Array]:
        """Points (k, d) [m] moved so many times, and the turn (d, d) of that."""
        d = points.shape[1]
        if self.rotation is None:
            return points + times * self.way, np.eye(d)
        turn, centre = turn_of(self.rotation.model_copy(update={"angle_deg": times * self.rotation.angle_deg}), d)
        return (points - centre) @ turn.T + centre, turn

    def together(self, other: Repeat) -> Repeat | None:
        """Both as one where they say the same or the opposite of two parts of a side, else None."""
        centre = None if self.rotation is None else self.rotation.centre
        scale = float(np.abs(self.way if centre is None else np.array(centre)).max()) or 1.0
        probe = scale * np.eye(len(self.way) + 1, len(self.way))
        for times, (end, start) in ((1, (other.end, other.start)), (-1, (other.start, other.end))):
            apart = self.moved(probe, 1)[0] - other.moved(probe, times)[0]
            if np.abs(apart).max() <= ALIKE * scale:
                return replace(self, end=np.union1d(self.end, end), start=np.union1d(self.start, start))
        return None

    def same_as(self, other: Repeat, points: Array, near: Array) -> bool:
        """Whether another motion, or its inverse, brings points (k, d) [m] to the same places, within ``near`` (k,)
        [m]."""
        here = self.moved(points, 1)[0]
        apart = [np.abs(here - other.moved(points, times)[0]).max(axis=1) for times in (1, -1)]
        return any(bool(np.all(each <= near)) for each in apart)

    def places(self, points: Array, ways: Array) -> Array:
        """Where (k,) points (k, d) are along the repetition, in sectors; NaN on the axis of a turn. ways (t, d): of all
        translations of the body."""
        if self.rotation is None:
            along = np.linalg.pinv(ways)[:, int(np.argmin(np.abs(ways - self.way).max(axis=1)))]
            return points @ along
        d = points.shape[1]
        arm = np.zeros((len(points), 3))
        arm[:, :d] = points - (0.0 if self.rotation.centre is None else np.array(self.rotation.centre))
        axis = np.array(self.rotation.axis) / np.linalg.norm(self.rotation.axis)
        first = np.eye(3)[int(np.argmin(np.abs(axis)))]
        first = first - (first @ axis) * axis
        first /= np.linalg.norm(first)
        x, y = arm @ first, arm @ np.cross(axis, first)
        angle = np.arctan2(y, x) / math.radians(self.step_deg)
        size = np.hypot(x, y)
        return np.where(size > ALIKE * np.abs(arm).max(initial=0.0), angle, np.nan)

    @property
    def around(self) -> float:
        """Sectors of a whole turn, infinite of a translation."""
        return math.inf if self.rotation is None else 360.0 / abs(self.step_deg)

    @property
    def step_deg(self) -> float:
        """The turn by the shorter way, as 60 of 420 or of −300 degrees; 0 of a translation."""
        return 0.0 if self.rotation is None else math.remainder(self.rotation.angle_deg, 360.0)


def slave_positions(case: Case, bodies: dict[str, BuiltBody], reference: str, where: str) -> Array:
    """Positions (m, d) [m] of all nodes of a contact's slave, or of its point."""
    at = case.location(reference, where=where)
    if isinstance(at, PointRef):
        return point_position(case, bodies, at)[None, :]
    mesh = bodies[at.body].mesh
    assert mesh is not None, "checked: boundaries belong to meshes"
    facets = require_boundary(mesh, at.boundary, where)
    return mesh.points[np.unique(np.concatenate([block.ravel() for block in facets.values()]))]


def master_nodes(
    case: Case, bodies: dict[str, BuiltBody], reference: str, where: str, slave: Array, lent: Sequence[Repeat] = ()
) -> tuple[Curve | FacetSurface, IntArray, Array | None]:
    """A boundary as a master that goes on where its body repeats, the mesh nodes (k,) that its nodes are or are images
    of, and by which turns (k, d, d), None without images. slave (m, d) [m]: what is to lie on it; lent: motions of
    its body that the master's does not repeat by, whose images are pieces."""
    owner, _, boundary = reference.partition(".")
    body = bodies[owner]
    mesh = body.mesh
    assert mesh is not None, "checked: boundaries belong to meshes"
    facets = require_boundary(mesh, boundary, where)
    nodes = np.unique(np.concatenate([block.ravel() for block in facets.values()]))
    blocks = {kind: np.searchsorted(nodes, block) for kind, block in facets.items() if len(block)}
    single = _Sheet(mesh.points[nodes], blocks, nodes, np.repeat(np.eye(body.dimension)[None], len(nodes), axis=0))
    sheet = single
    repeats = [*repeats_of(case, bodies, body.name), *lent]
    ways = np.array([repeat.way for repeat in repeats if repeat.rotation is None])
    for repeat in repeats:
        sheet = _gone_on(sheet, repeat, ways, slave, _same(single, repeat))
    if sheet is single:
        return *master_surface(mesh, boundary, where), None
    surface: Curve | FacetSurface
    if body.dimension == 2:
        chain_of(single.points, single.blocks, where=where)  # what is in pieces without images is refused
        pieces = pieces_of(sheet.blocks)
        surface = Curve.side_by_side([Curve.from_facets(sheet.points, piece, where=where) for piece in pieces])
    else:
        surface = FacetSurface.from_facets(sheet.points, sheet.blocks, where=where)
    return surface, sheet.origin[surface.nodes], sheet.turns[surface.nodes]


def master_rows(view: View, body: BuiltBody, nodes: IntArray, turns: Array | None) -> Rows:
    """Displacements (k d, n) of nodes, turned."""
    rows = view.node_rows(body, nodes)
    if turns is None:
        return rows
    turned = sp.csr_array(sp.block_diag(list(turns), format="csr"))
    free: Sparse = sp.csr_array(turned @ rows.free)
    free.eliminate_zeros()
    return Rows(free, np.asarray(turned @ rows.lift))


def repeats_of(case: Case, bodies: dict[str, BuiltBody], name: str) -> list[Repeat]:
    """How a body repeats: by ties with itself, or between those of the bodies that it is tied to as they lie, which
    make up its sector together. Several ties may stand for the parts of one cut."""
    sector = tied_as_they_lie(case, name)
    found: list[Repeat] = []
    for name_of_tie, tie in case.ties.items():
        slave, master = case.location(tie.slave), case.location(tie.master)
        if (tie.translation is None and tie.rotation is None) or not {slave.body, master.body} <= sector:
            continue
        assert isinstance(slave, BoundaryRef), "checked"
        assert isinstance(master, BoundaryRef), "checked"
        end, start = (
            boundary_nodes(bodies[name], at, f"ties.{name_of_tie}") if at.body == name else np.zeros(0, dtype=np.int64)
            for at in (slave, master)
        )
        way = np.zeros(bodies[name].dimension) if tie.translation is None else np.array(tie.translation)
        repeat = Repeat(name_of_tie, end, start, way, tie.rotation)
        for number, other in enumerate(found):
            both = other.together(repeat)
            if both is not None:
                found[number] = both
                break
        else:
            found.append(repeat)
    return found


def tied_as_they_lie(case: Case, name: str) -> set[str]:
    """A body and those that ties without a motion bond to it, or to those."""
    pairs = [
        (case.location(tie.slave).body, case.location(tie.master).body)
        for tie in case.ties.values()
        if tie.translation is None and tie.rotation is None
    ]
    found, before = {name}, 0
    while len(found) > before:
        before = len(found)
        for pair in pairs:
            if found.intersection(pair):
                found.update(pair)
    return found


def pieces_of(blocks: Blocks) -> list[Blocks]:
    """Facets by kind as those of each connected piece."""
    edges = np.concatenate([np.stack([block[:, 0], other], axis=1) for block in blocks.values() for other in block.T])
    size = int(edges.max()) + 1
    graph = sp.coo_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(size, size))
    label = connected_components(graph, directed=False)[1]
    found: list[Blocks] = []
    for piece in np.unique(label[edges[:, 0]]):
        own = {kind: block[label[block[:, 0]] == piece] for kind, block in blocks.items()}
        found.append({kind: block for kind, block in own.items() if len(block)})
    return found


def _same(sheet: _Sheet, repeat: Repeat) -> float:
    """Distance [m] within which nodes of both sides of the cut are one."""
    end = np.isin(sheet.origin, repeat.end)
    return SAME * float(cKDTree(sheet.points).query(sheet.points[end if end.any() else ...], k=2)[0][:, 1].min())


def _gone_on(sheet: _Sheet, repeat: Repeat, ways: Array, slave: Array, same: float) -> _Sheet:
    """The sheet with those of its images that a slave (m, d) [m] can meet, each a piece by itself where the meshes of
    both sides of the cut do not match, within ``same`` [m], or do not reach it."""
    points = sheet.points
    end, start, matches = _cut(sheet, repeat, same)
    images, closed = _images(sheet, repeat, ways, slave, same, around_it=matches)
    if not len(images) or list(images) == [0]:
        return sheet
    k = len(points)
    number = np.arange(len(images) * k).reshape(-1, k)
    # What two images share is a node of the one that is nearer to the body itself.
    itself = images.index(0) if 0 in images else 0
    if matches:
        for j in range(itself + 1, len(images)):
            number[j, start] = number[j - 1, end]
        for j in range(itself - 1, -1, -1):
            number[j, end] = number[j + 1, start]
        if closed:
            number[-1, end] = number[0, start]
    moved = [repeat.moved(points, times) for times in images]
    return _Sheet(
        np.concatenate([at for at, _ in moved]),
        {kind: np.concatenate([row[block] for row in number]) for kind, block in sheet.blocks.items()},
        np.tile(sheet.origin, len(images)),
        np.concatenate([turn @ sheet.turns for _, turn in moved]),
    ).used


def _cut(sheet: _Sheet, repeat: Repeat, same: float) -> tuple[IntArray, IntArray, bool]:
    """Points (q,) of a sheet at the end and those at the start that lie there once moved; whether all of both do."""
    d = sheet.points.shape[1]
    end, start = (np.flatnonzero(np.isin(sheet.origin, side)) for side in (repeat.end, repeat.start))
    if len(end) != len(start) or len(end) < d - 1:
        return end, start, False
    distance, which = cKDTree(sheet.points[end]).query(repeat.moved(sheet.points[start], 1)[0])
    return end[which], start, bool(distance.max() <= same and len(np.unique(which)) == len(end))


def _images(
    sheet: _Sheet, repeat: Repeat, ways: Array, slave: Array, same: float, *, around_it: bool
) -> tuple[Sequence[int], bool]:
    """Which images of a sheet, 0 itself, a slave (m, d) [m] can meet, and whether they close to a ring.

    They cover the slave and, ``around_it``, a sector on both sides of it, two facets at the least: beyond that,
    nothing of where a surface ends is felt. Those of a turn that is no part of a whole one are never more than one on
    each side.
    """
    around = math.inf
    if repeat.rotation is not None:
        around = round(repeat.around)
        back = repeat.moved(sheet.points, around)[0] - sheet.points
        if around < 1 or float(np.linalg.norm(back, axis=1).max()) > around * same:
            return range(-1, 2), False
    at = repeat.places(sheet.points, ways)
    own, other = between(at, around), between(repeat.places(slave, ways), around)
    if own is None or other is None:
        return range(-1, 2), False
    margin = max(1.0, AROUND * widest(at, sheet.blocks, around)) if around_it else 0.0
    first = math.ceil(other[0] - margin - own[1] + TOUCHING)
    last = math.floor(other[1] + margin - own[0] - TOUCHING)
    if last - first + 1 >= around:
        return range(int(around)), True
    return range(first, last + 1), False


def widest(at: Array, blocks: Blocks, around: float) -> float:
    """How far the widest facet between nodes at places (k,) reaches, in sectors, of which ``around`` make a turn."""
    wide = 0.0
    for block in blocks.values():
        apart = at[block] - at[block][:, :1]
        if math.isfinite(around):
            apart -= around * np.round(apart / around)
        wide = max(wide, float(np.ptp(np.nan_to_num(apart), axis=1).max(initial=0.0)))
    return wide


def between(at: Array, around: float) -> tuple[float, float] | None:
    """Where places, NaN left out, begin and end; those that come back after ``around`` after their widest gap."""
    known = at[np.isfinite(at)]
    if not len(known):
        return None
    if math.isinf(around):
        return float(known.min()), float(known.max())
    known = np.sort(np.mod(known, around))
    gaps = np.diff(known, append=known[0] + around)
    begin = (int(np.argmax(gaps)) + 1) % len(known)
    return float(known[begin]), float(known[begin] + around - gaps.max())

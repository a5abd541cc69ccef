"""Masters of bodies that repeat: they go on beyond the cut, by what the tie says lies there.

A boundary ends where the mesh of its sector does, the surface does not. Its images give a master the normals of the
whole surface up to the cut, and a slave what it lies on, wherever its own sector begins: of a ring those that the slave
can meet, all of them where these go round. Their nodes move as those that they are images of, turned.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from ..case import Case
from ..case.points import BoundaryRef, PointRef
from ..case.schema import Rotation
from ..contact.curve import Curve
from ..contact.facets import FacetSurface
from ..contact.interface import Rows
from ..mesh.boundary import require_boundary
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
class _Repeat:
    """How a body repeats: what lies on its nodes ``start`` lies moved on its nodes ``end``, by a way (d,) [m] or by a
    rotation."""

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

    def together(self, other: _Repeat) -> _Repeat | None:
        """Both as one where they say the same or the opposite of two parts of a side, else None."""
        centre = None if self.rotation is None else self.rotation.centre
        scale = float(np.abs(self.way if centre is None else np.array(centre)).max()) or 1.0
        probe = scale * np.eye(len(self.way) + 1, len(self.way))
        for times, (end, start) in ((1, (other.end, other.start)), (-1, (other.start, other.end))):
            apart = self.moved(probe, 1)[0] - other.moved(probe, times)[0]
            if np.abs(apart).max() <= ALIKE * scale:
                return replace(self, end=np.union1d(self.end, end), start=np.union1d(self.start, start))
        return None

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
        angle = np.arctan2(y, x) / math.radians(self.rotation.angle_deg)
        size = np.hypot(x, y)
        return np.where(size > ALIKE * np.abs(arm).max(initial=0.0), angle, np.nan)

    @property
    def around(self) -> float:
        """Sectors of a whole turn, infinite of a translation."""
        return math.inf if self.rotation is None else 360.0 / abs(self.rotation.angle_deg)


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
    case: Case, body: BuiltBody, boundary: str, where: str, slave: Array
) -> tuple[Curve | FacetSurface, IntArray, Array | None]:
    """A boundary as a master that goes on where its body repeats, the mesh nodes (k,) that its nodes are or are images
    of, and by which turns (k, d, d), None without images. slave (m, d) [m]: what is to lie on it."""
    mesh = body.mesh
    assert mesh is not None, "checked: boundaries belong to meshes"
    facets = require_boundary(mesh, boundary, where)
    nodes = np.unique(np.concatenate([block.ravel() for block in facets.values()]))
    blocks = {kind: np.searchsorted(nodes, block) for kind, block in facets.items() if len(block)}
    single = _Sheet(mesh.points[nodes], blocks, nodes, np.repeat(np.eye(body.dimension)[None], len(nodes), axis=0))
    sheet = single
    repeats = _repeats(case, body)
    ways = np.array([repeat.way for repeat in repeats if repeat.rotation is None])
    for repeat in repeats:
        sheet = _gone_on(sheet, repeat, ways, slave)
    if sheet is single:
        return *master_surface(mesh, boundary, where), None
    kind = Curve if body.dimension == 2 else FacetSurface
    surface = kind.from_facets(sheet.points, sheet.blocks, where=where)
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


def _repeats(case: Case, body: BuiltBody) -> list[_Repeat]:
    """How a body repeats by ties with itself; several may stand for the parts of one cut."""
    found: list[_Repeat] = []
    for name, tie in case.ties.items():
        slave, master = case.location(tie.slave), case.location(tie.master)
        if (tie.translation is None and tie.rotation is None) or {slave.body, master.body} != {body.name}:
            continue
        assert isinstance(slave, BoundaryRef), "checked"
        assert isinstance(master, BoundaryRef), "checked"
        end, start = (boundary_nodes(body, at, f"ties.{name}") for at in (slave, master))
        way = np.zeros(body.dimension) if tie.translation is None else np.array(tie.translation)
        repeat = _Repeat(end, start, way, tie.rotation)
        for number, other in enumerate(found):
            both = other.together(repeat)
            if both is not None:
                found[number] = both
                break
        else:
            found.append(repeat)
    return found


def _gone_on(sheet: _Sheet, repeat: _Repeat, ways: Array, slave: Array) -> _Sheet:
    """The sheet with those of its images that a slave (m, d) [m] can meet; as it is where the meshes of both sides of
    the cut do not match there."""
    points, d = sheet.points, sheet.points.shape[1]
    end, start = (np.flatnonzero(np.isin(sheet.origin, side)) for side in (repeat.end, repeat.start))
    if len(end) != len(start) or len(end) < d - 1:
        return sheet
    distance, which = cKDTree(points[end]).query(repeat.moved(points[start], 1)[0])
    same = SAME * cKDTree(points).query(points[end], k=2)[0][:, 1].min()
    if distance.max() > same or len(np.unique(which)) < len(end):
        return sheet
    images, closed = _images(sheet, repeat, ways, slave, same)
    k = len(points)
    number = np.arange(len(images) * k).reshape(-1, k)
    # What two images share is a node of the one that is nearer to the body itself.
    itself = images.index(0) if 0 in images else 0
    for j in range(itself + 1, len(images)):
        number[j, start] = number[j - 1, end[which]]
    for j in range(itself - 1, -1, -1):
        number[j, end[which]] = number[j + 1, start]
    if closed:
        number[-1, end[which]] = number[0, start]
    moved = [repeat.moved(points, times) for times in images]
    return _Sheet(
        np.concatenate([at for at, _ in moved]),
        {kind: np.concatenate([row[block] for row in number]) for kind, block in sheet.blocks.items()},
        np.tile(sheet.origin, len(images)),
        np.concatenate([turn @ sheet.turns for _, turn in moved]),
    ).used


def _images(sheet: _Sheet, repeat: _Repeat, ways: Array, slave: Array, same: float) -> tuple[Sequence[int], bool]:
    """Which images of a sheet, 0 itself, a slave (m, d) [m] can meet, and whether they close to a ring.

    They cover the slave and a sector on both sides of it, two facets at the least: beyond that, nothing of where a
    surface ends is felt. Those of a turn that is no part of a whole one are never more than one on each side.
    """
    around = math.inf
    if repeat.rotation is not None:
        around = round(repeat.around)
        back = repeat.moved(sheet.points, around)[0] - sheet.points
        if around < 1 or float(np.linalg.norm(back, axis=1).max()) > around * same:
            return range(-1, 2), False
    at = repeat.places(sheet.points, ways)
    own, other = _between(at, around), _between(repeat.places(slave, ways), around)
    if own is None or other is None:
        return range(-1, 2), False
    wide = 0.0
    for block in sheet.blocks.values():
        apart = at[block] - at[block][:, :1]
        if math.isfinite(around):
            apart -= around * np.round(apart / around)
        apart = np.nan_to_num(apart)
        wide = max(wide, float(np.ptp(apart, axis=1).max(initial=0.0)))
    margin = max(1.0, AROUND * wide)
    first = math.ceil(other[0] - margin - own[1] + TOUCHING)
    last = math.floor(other[1] + margin - own[0] - TOUCHING)
    if last - first + 1 >= around:
        return range(int(around)), True
    return range(first, last + 1), False


def _between(at: Array, around: float) -> tuple[float, float] | None:
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

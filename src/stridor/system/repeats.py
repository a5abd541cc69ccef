"""Masters of bodies that repeat: they go on beyond the cut, by what the tie says lies there.

A boundary ends where the mesh of its sector does, the surface does not. Its images on both sides give a master the
normals of the whole surface up to the cut, and a slave that reaches over it what it lies on. Their nodes move as those
that they are images of, turned.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from ..case import Case
from ..case.points import BoundaryRef
from ..case.schema import Tie
from ..contact.curve import Curve
from ..contact.facets import FacetSurface
from ..contact.interface import Rows
from ..mesh.boundary import require_boundary
from ..mesh.model import Blocks
from ..typing import Array, BoolArray, IntArray, Sparse
from .bodies import BuiltBody
from .supports import boundary_nodes, master_surface, turn_of
from .view import View

SAME = 1e-3  # of the distance between neighbouring nodes: one place
HALF = 1e-9  # a turn that undoes itself


@dataclass(frozen=True)
class _Sheet:
    """Points (k, d) [m] and facets between them, each the image of a node of the mesh, ``origin`` (k,), by a turn
    (k, d, d)."""

    points: Array
    blocks: Blocks
    origin: IntArray
    turns: Array


def master_nodes(
    case: Case, body: BuiltBody, boundary: str, where: str
) -> tuple[Curve | FacetSurface, IntArray, Array | None]:
    """A boundary as a master that goes on where its body repeats, the mesh nodes (k,) that its nodes are or are images
    of, and by which turns (k, d, d), None without images."""
    mesh = body.mesh
    assert mesh is not None, "checked: boundaries belong to meshes"
    facets = require_boundary(mesh, boundary, where)
    nodes = np.unique(np.concatenate([block.ravel() for block in facets.values()]))
    blocks = {kind: np.searchsorted(nodes, block) for kind, block in facets.items() if len(block)}
    single = _Sheet(mesh.points[nodes], blocks, nodes, np.repeat(np.eye(body.dimension)[None], len(nodes), axis=0))
    sheet = single
    for name, tie in case.ties.items():
        slave, master = case.location(tie.slave), case.location(tie.master)
        if (tie.translation is None and tie.rotation is None) or {slave.body, master.body} != {body.name}:
            continue
        assert isinstance(slave, BoundaryRef), "checked"
        assert isinstance(master, BoundaryRef), "checked"
        sides = (boundary_nodes(body, at, f"ties.{name}") for at in (slave, master))
        sheet = _gone_on(sheet, tie, *(np.isin(sheet.origin, side) for side in sides))
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


def _gone_on(sheet: _Sheet, tie: Tie, slave: BoolArray, master: BoolArray) -> _Sheet:
    """The sheet with its images beyond the cut of a tie, on whose sides points (k,) lie; as it is where the meshes of
    both sides do not match there."""
    points, d = sheet.points, sheet.points.shape[1]
    if tie.rotation is not None:
        turn, centre = turn_of(tie.rotation, d)
        on, back = (points - centre) @ turn.T + centre, (points - centre) @ turn + centre
    else:
        turn, way = np.eye(d), np.array(tie.translation)
        on, back = points + way, points - way
    end, start = np.flatnonzero(slave), np.flatnonzero(master)
    if len(end) != len(start) or len(end) < d - 1:
        return sheet
    distance, which = cKDTree(points[end]).query(on[start])
    near = cKDTree(points).query(points[end], k=2)[0][:, 1].min()
    if distance.max() > SAME * near or len(np.unique(which)) < len(end):
        return sheet
    k = len(points)
    itself = np.abs(turn @ turn - np.eye(d)).max() < HALF and tie.rotation is not None
    beyond, before = np.arange(k, 2 * k), np.arange(2 * k, 3 * k)
    beyond[start] = end[which]
    before[end[which]] = start
    if itself:  # half a turn: one image lies on both sides
        beyond[end[which]] = start
    numbers = [beyond] if itself else [beyond, before]
    blocks = {
        kind: np.concatenate([block, *(number[block] for number in numbers)]) for kind, block in sheet.blocks.items()
    }
    images = [points, on] if itself else [points, on, back]
    turned = [sheet.turns, turn @ sheet.turns] if itself else [sheet.turns, turn @ sheet.turns, turn.T @ sheet.turns]
    origin = np.tile(sheet.origin, len(images))
    return _Sheet(np.concatenate(images), blocks, origin, np.concatenate(turned))

"""Where cells of two kinds share nodes and yet do not fit: there a mesh is open, though it looks whole.

Nodes between corners belong to the cells on one side only where a quadratic cell has a linear neighbour, its midside
node lies on the diagonal of a neighbour's face, or a face with a node in its middle has one without as its other side.
Of a hexahedron beside two tetrahedra all nodes may be shared: its face is bilinear, or biquadratic, where theirs are
two triangles.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..typing import Array, BoolArray, IntArray
from .boundary import CellFacets, cell_facets, facets_of_one_cell, quadrilaterals_on_triangles
from .kinds import FACET_CORNERS, KINDS
from .model import Mesh

# Kinds that may share all nodes of a face and two triangles.
ALIKE = (("hexahedron", "tetra"), ("hexahedron27", "tetra10"))


def hanging(mesh: Mesh) -> IntArray:
    """Nodes (h,) in the middle of edges and faces that another cell has without one, or, of edges, across its face."""
    if len({kind for kind, block in mesh.cells.items() if len(block)}) < 2:
        return np.zeros(0, dtype=np.int64)
    pairs, middles, straight = _none(2), _none(1)[:, 0], _none(2)
    for kind, block in mesh.cells.items():
        for i, j, middle in _edges(kind):
            pair = np.sort(block[:, [i, j]], axis=1)
            if middle < 0:
                straight = np.concatenate([straight, pair])
            else:
                pairs, middles = np.concatenate([pairs, pair]), np.concatenate([middles, block[:, middle]])
    every = cell_facets(mesh.cells, mesh.points)
    if len(middles) and mesh.dimension == 3:
        for kind, block in facets_of_one_cell(every).items():
            if FACET_CORNERS[kind] == 4 and kind != "quad9":  # this has a node where two triangles have one
                across = [np.sort(block[:, pair], axis=1) for pair in ([0, 2], [1, 3])]
                straight = np.concatenate([straight, *across])
    return np.unique(np.concatenate([middles[_among(pairs, straight)], _of_faces(every)]))


def on_two_triangles(mesh: Mesh) -> Array:
    """Middles (q, 3) [m] of faces whose nodes are those of two triangles on their other side, between which both move
    apart. Faces with a node too few or too many for that are told by `hanging`."""
    found = [_none(4)]
    for pair in ALIKE:
        cells = {kind: mesh.cells[kind] for kind in pair if len(mesh.cells.get(kind, ()))}
        if len(cells) == len(pair):
            faces = quadrilaterals_on_triangles(cell_facets(cells, mesh.points))
            found += [block[:, :4] for block in faces.values()]
    return mesh.points[np.concatenate(found)].mean(axis=1)


def _of_faces(every: CellFacets) -> IntArray:
    """Nodes in the middle of faces whose other side has none."""
    start, whole, plain, keys = 0, _none(1)[:, 0], _none(4), _none(4)
    for kind, facets in every.nodes.items():
        key = every.corners[start : start + len(facets)]
        start += len(facets)
        if kind == "quad9":
            whole, keys = facets[:, 8], key
        else:
            plain = np.concatenate([plain, key])
    return whole[_among(keys, plain)]


def _among(rows: IntArray, others: IntArray) -> BoolArray:
    """Which rows (r, c) are among others (o, c)."""
    _, number = np.unique(np.concatenate([rows, others]), axis=0, return_inverse=True)
    return np.isin(number[: len(rows)], number[len(rows) :])


def _none(columns: int) -> IntArray:
    return np.zeros((0, columns), dtype=np.int64)


def _edges(kind: str) -> Sequence[tuple[int, int, int]]:
    """Corners of each edge and its midside node, −1 without one."""
    found = {(min(i, j), max(i, j)): middle for i, ends in enumerate(KINDS[kind].tangents) for j, middle in ends}
    return [(i, j, middle) for (i, j), middle in found.items()]

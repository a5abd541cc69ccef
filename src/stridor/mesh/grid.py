"""Grids of cells: from numbered places on a lattice to a Mesh. The built-in shapes are made of these."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import CaseError
from ..typing import Array, IntArray
from .kinds import KINDS
from .model import PLANE_KINDS, SOLID_KINDS, Mesh

_QUADRATIC = {"quad": "quad8", "triangle": "triangle6", "hexahedron": "hexahedron20", "tetra": "tetra10"}


@dataclass(frozen=True)
class Side:
    """A side of one of the grids: along an axis, at its end or its beginning."""

    grid: int
    axis: int
    at_end: bool


@dataclass(frozen=True)
class Grid:
    """ids: number of the point at each place of the lattice (m1, m2[, m3]); step: places from cell to cell, 2 for
    quadratic cells, which have places between. A closed direction ends with its first places again."""

    ids: IntArray
    step: int

    @staticmethod
    def of_counts(counts: Sequence[int], step: int, *, closed: int | None = None) -> tuple[Grid, IntArray]:
        """A grid of so many cells along each direction, one of which may be closed, and for each point its place in
        the lattice (without the repeated places), as a flat index.

        Points are numbered along the shortest direction first, a closed one from both sides at once: neighbours then
        have numbers near each other, and matrices a small bandwidth.
        """
        shape = [step * n + (0 if axis == closed else 1) for axis, n in enumerate(counts)]
        ranks = [folded(m) if axis == closed else np.arange(m) for axis, m in enumerate(shape)]
        # Folded, two places next to each other are up to two apart: as wide as two of them.
        width = [m // 2 if axis == closed else m for axis, m in enumerate(shape)]
        stride = np.ones(len(shape), dtype=np.int64)
        done = 1
        for axis in sorted(range(len(shape)), key=lambda a: width[a]):
            stride[axis] = done
            done *= shape[axis]
        ids = sum(
            (stride[axis] * rank.reshape([-1 if a == axis else 1 for a in range(len(shape))]))
            for axis, rank in enumerate(ranks)
        )
        ids = np.asarray(ids, dtype=np.int64)
        rank = np.empty(ids.size, dtype=np.int64)
        rank[ids.ravel()] = np.arange(ids.size)
        if closed is not None:
            ids = np.concatenate([ids, np.take(ids, [0], axis=closed)], axis=closed)
        return Grid(ids, step), rank


def folded(count: int) -> IntArray:
    """Ranks (count,) of points round a circle counted from both sides at once: 0, 1, 3, 5, …, 4, 2."""
    index = np.arange(count)
    return np.where(index <= count // 2, np.maximum(2 * index - 1, 0), 2 * (count - index))


def cell_kind(kind: str, order: int, dimension: int, where: str) -> str:
    """The kind of cell meant by a family and an order, or written out. Raises CaseError with those accepted."""
    kinds = PLANE_KINDS if dimension == 2 else SOLID_KINDS
    families = [k for k in kinds if k in _QUADRATIC]
    if kind not in kinds:
        raise CaseError(f"{where}.kind", kind, f"must be one of: {', '.join(kinds)}")
    if order not in (1, 2):
        raise CaseError(f"{where}.order", order, "must be 1 (linear) or 2 (quadratic)")
    return _QUADRATIC[kind] if order == 2 and kind in families else kind


def mesh_of_grids(
    grids: Sequence[Grid], points: Array, kind: str, sides: Mapping[str, Side], source: str
) -> Mesh:
    """Mesh of one kind of cell on grids that share the points (k, d) [m]; points that the kind does not use are left
    out. sides: boundaries by name."""
    templates = _templates(kind)
    cells = np.concatenate([_cells(grid, templates) for grid in grids])
    used = np.zeros(len(points), dtype=bool)
    used[cells] = True
    new = np.cumsum(used) - 1
    boundaries = {
        name: {KINDS[kind].facet_kind: new[_facets(grids[side.grid], templates, kind, side)]}
        for name, side in sides.items()
    }
    return Mesh(points=points[used], cells={kind: new[cells]}, boundaries=boundaries, source=source)


def _templates(kind: str) -> list[IntArray]:
    """How cells of a kind fill one cell of a grid: places (n, d) of their nodes, counted from its first place."""
    if kind.startswith("quad"):
        corners = [[(0, 0), (1, 0), (1, 1), (0, 1)]]
    elif kind.startswith("triangle"):
        corners = [[(0, 0), (1, 0), (1, 1)], [(0, 0), (1, 1), (0, 1)]]
    elif kind.startswith("hexahedron"):
        square = [(0, 0), (1, 0), (1, 1), (0, 1)]
        corners = [[(*p, z) for z in (0, 1) for p in square]]
    else:
        corners = _six_tetrahedra()
    table = KINDS[kind]
    found: list[IntArray] = []
    for cell in corners:
        at = np.array(cell, dtype=np.int64)
        if table.nodes == table.corners:
            found.append(at)
            continue
        nodes = np.ones((table.nodes, at.shape[1]), dtype=np.int64)  # the centre of the cell is at (1, 1[, 1])
        nodes[: len(at)] = 2 * at
        for corner, ends in enumerate(table.tangents):
            for end, middle in ends:
                nodes[middle] = at[corner] + at[end]
        if kind == "hexahedron27":
            for facet in table.facets:
                nodes[facet[8]] = at[list(facet[:4])].sum(axis=0) // 2
        found.append(nodes)
    return found


def _six_tetrahedra() -> list[list[tuple[int, ...]]]:
    """A cube as six tetrahedra along its diagonal, one for each order of the axes: cubes side by side match."""
    found: list[list[tuple[int, ...]]] = []
    for axes in itertools.permutations(range(3)):
        path = np.zeros((4, 3), dtype=np.int64)
        for k, axis in enumerate(axes):
            path[k + 1 :, axis] = 1
        if np.linalg.det(path[1:] - path[0]) < 0:
            path = path[[0, 2, 1, 3]]
        found.append([tuple(int(v) for v in p) for p in path])
    return found


def _cells(grid: Grid, templates: Sequence[IntArray], side: Side | None = None) -> IntArray:
    """Cells (c, n) of a grid, those that fill one of its cells together; on one side of it only, if one is given."""
    starts: list[IntArray] = []
    for axis, count in enumerate(grid.ids.shape):
        start = np.arange(0, count - 1, grid.step)
        if side is not None and axis == side.axis:
            start = start[-1:] if side.at_end else start[:1]
        starts.append(start)

    def at(offset: IntArray) -> IntArray:
        return grid.ids[np.ix_(*(s + o for s, o in zip(starts, offset, strict=True)))].ravel()

    found = [np.stack([at(offset) for offset in template], axis=1) for template in templates]
    return np.stack(found, axis=1).reshape(-1, len(templates[0]))


def _facets(grid: Grid, templates: Sequence[IntArray], kind: str, side: Side) -> IntArray:
    """Facets (f, n) of a side of a grid."""
    limit = grid.step if side.at_end else 0
    cells = _cells(grid, templates, side).reshape(-1, len(templates), KINDS[kind].nodes)
    found = [
        cells[:, k][:, facet]
        for k, template in enumerate(templates)
        for facet in KINDS[kind].facets
        if np.all(template[list(facet), side.axis] == limit)
    ]
    return np.concatenate(found)

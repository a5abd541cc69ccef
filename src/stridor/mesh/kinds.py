"""What each kind of cell is made of: corners, facets, edges, and the Jacobian at its corners.

Node order is meshio's (VTK's). Facets are listed in the order in which Abaqus numbers the faces S1, S2, … and turn so
that their normal leaves a cell that is not inverted.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..typing import Array, IntArray

Nodes = tuple[int, ...]


@dataclass(frozen=True)
class Kind:
    """One kind of cell: dimension; corners come first among its nodes; facets as (kind, nodes of the cell).

    tangents: for each corner the d pairs (corner, midside node or −1) its edges lead to, right-handed.
    mirrored: the order of nodes that turns an inverted cell over.
    """

    dimension: int
    corners: int
    nodes: int
    facet_kind: str
    facets: tuple[Nodes, ...]
    tangents: tuple[tuple[tuple[int, int], ...], ...]
    mirrored: Nodes

    @property
    def edges(self) -> tuple[tuple[int, int], ...]:
        """Pairs of corners, each edge once."""
        pairs = {(min(i, j), max(i, j)) for i, ends in enumerate(self.tangents) for j, _ in ends}
        return tuple(sorted(pairs))


_TRIANGLE_FACETS = ((0, 1, 3), (1, 2, 4), (2, 0, 5))
_QUAD_FACETS = ((0, 1, 4), (1, 2, 5), (2, 3, 6), (3, 0, 7))
_TETRA_FACETS = ((0, 2, 1, 6, 5, 4), (0, 1, 3, 4, 8, 7), (1, 2, 3, 5, 9, 8), (2, 0, 3, 6, 7, 9))
_HEXAHEDRON_FACETS = (
    (0, 3, 2, 1, 11, 10, 9, 8, 24),
    (4, 5, 6, 7, 12, 13, 14, 15, 25),
    (0, 1, 5, 4, 8, 17, 12, 16, 22),
    (1, 2, 6, 5, 9, 18, 13, 17, 21),
    (2, 3, 7, 6, 10, 19, 14, 18, 23),
    (3, 0, 4, 7, 11, 16, 15, 19, 20),
)
_NEIGHBOURS = {
    "triangle": ((1, 2), (2, 0), (0, 1)),
    "quad": ((1, 3), (2, 0), (3, 1), (0, 2)),
    "tetra": ((1, 2, 3), (2, 0, 3), (0, 1, 3), (0, 2, 1)),
    "hexahedron": ((1, 3, 4), (2, 0, 5), (3, 1, 6), (0, 2, 7), (7, 5, 0), (4, 6, 1), (5, 7, 2), (6, 4, 3)),
}
_MIDSIDES = {
    "triangle": {(0, 1): 3, (1, 2): 4, (0, 2): 5},
    "quad": {(0, 1): 4, (1, 2): 5, (2, 3): 6, (0, 3): 7},
    "tetra": {(0, 1): 4, (1, 2): 5, (0, 2): 6, (0, 3): 7, (1, 3): 8, (2, 3): 9},
    "hexahedron": {
        **{(0, 1): 8, (1, 2): 9, (2, 3): 10, (0, 3): 11, (4, 5): 12, (5, 6): 13, (6, 7): 14, (4, 7): 15},
        **{(0, 4): 16, (1, 5): 17, (2, 6): 18, (3, 7): 19},
    },
}
_MIRRORED = {
    "triangle": (0, 2, 1, 5, 4, 3),
    "quad": (0, 3, 2, 1, 7, 6, 5, 4, 8),
    "tetra": (0, 2, 1, 3, 6, 5, 4, 7, 9, 8),
    "hexahedron": (*(4, 5, 6, 7, 0, 1, 2, 3), *(12, 13, 14, 15, 8, 9, 10, 11), *range(16, 24), 25, 24, 26),
}


def _kind(base: str, nodes: int, facet_kind: str, facet_nodes: int) -> Kind:
    """The kind of a family with so many nodes; the tables above are those of its largest member."""
    facets = {
        "triangle": _TRIANGLE_FACETS,
        "quad": _QUAD_FACETS,
        "tetra": _TETRA_FACETS,
        "hexahedron": _HEXAHEDRON_FACETS,
    }[base]
    corners = len(_NEIGHBOURS[base])
    quadratic = nodes > corners
    middle = _MIDSIDES[base]
    tangents = tuple(
        tuple((j, middle[min(i, j), max(i, j)] if quadratic else -1) for j in ends)
        for i, ends in enumerate(_NEIGHBOURS[base])
    )
    return Kind(
        dimension=2 if base in ("triangle", "quad") else 3,
        corners=corners,
        nodes=nodes,
        facet_kind=facet_kind,
        facets=tuple(f[:facet_nodes] for f in facets),
        tangents=tangents,
        mirrored=tuple(n for n in _MIRRORED[base] if n < nodes),
    )


KINDS: Mapping[str, Kind] = {
    "triangle": _kind("triangle", 3, "line", 2),
    "triangle6": _kind("triangle", 6, "line3", 3),
    "quad": _kind("quad", 4, "line", 2),
    "quad8": _kind("quad", 8, "line3", 3),
    "quad9": _kind("quad", 9, "line3", 3),
    "tetra": _kind("tetra", 4, "triangle", 3),
    "tetra10": _kind("tetra", 10, "triangle6", 6),
    "hexahedron": _kind("hexahedron", 8, "quad", 4),
    "hexahedron20": _kind("hexahedron", 20, "quad8", 8),
    "hexahedron27": _kind("hexahedron", 27, "quad9", 9),
}

# Corners of a facet: they come first, and they alone say which side of a cell it is.
FACET_CORNERS: Mapping[str, int] = {
    "line": 2,
    "line3": 2,
    "triangle": 3,
    "triangle6": 3,
    "quad": 4,
    "quad8": 4,
    "quad9": 4,
}

# The same facet seen from the other side.
FACET_REVERSED: Mapping[str, Nodes] = {
    "line": (1, 0),
    "line3": (1, 0, 2),
    **{name: KINDS[name].mirrored for name in ("triangle", "triangle6", "quad", "quad8", "quad9")},
}


def corner_jacobians(kind: str, nodes: IntArray, points: Array) -> tuple[Array, Array]:
    """Jacobian determinants (c, corners) [m^d] of cells (c, nodes) at their corners, and the same over the product
    of the lengths of the edges' tangents there [-]: the sine of a corner in the plane, 0 where an edge has no length.

    The tangent of an edge at its end depends on the nodes of that edge alone, so this is exact for every kind.
    """
    table = KINDS[kind]
    coordinates = points[nodes]
    determinants = np.empty((len(nodes), table.corners))
    sizes = np.ones((len(nodes), table.corners))
    for corner, ends in enumerate(table.tangents):
        here = coordinates[:, corner]
        tangents: list[Array] = []
        for end, middle in ends:
            along = coordinates[:, end] - here
            tangents.append(along if middle < 0 else 4.0 * (coordinates[:, middle] - here) - along)
        if table.dimension == 2:
            a, b = tangents
            determinants[:, corner] = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
        else:
            a, b, c = tangents
            determinants[:, corner] = np.sum(a * np.cross(b, c), axis=1)
        for tangent in tangents:
            sizes[:, corner] *= np.linalg.norm(tangent, axis=1)
    relative = np.divide(determinants, sizes, out=np.zeros_like(determinants), where=sizes > 0)
    return determinants, relative

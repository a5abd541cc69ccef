"""A mesh as data: points, cells by kind, and named boundaries and sets.

Kinds and the order of the nodes in a cell are meshio's (VTK's): "triangle", "triangle6", "quad", "quad8", "quad9",
"tetra", "tetra10", "hexahedron", "hexahedron20", "hexahedron27"; facets are "line", "line3" in the plane and the
triangles and quadrilaterals in space.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ..typing import Array, IntArray

Blocks = Mapping[str, IntArray]  # kind → node indices (c, nodes of the kind)

PLANE_KINDS = ("triangle", "triangle6", "quad", "quad8", "quad9")
SOLID_KINDS = ("tetra", "tetra10", "hexahedron", "hexahedron20", "hexahedron27")
FACET_KINDS = ("line", "line3", "triangle", "triangle6", "quad", "quad8", "quad9")


@dataclass(frozen=True)
class Mesh:
    """points (k, d) [m] with d = 2 or 3; cells by kind, at least one; every point belongs to a cell.

    boundaries: name → facets by kind (f, nodes), ordered so that their normal points out of the body: in the plane
    the body lies on the left of a line from its first to its second node (outward is right), in space the corners
    turn counter-clockwise seen from outside. node_sets: name → nodes (s,), sorted. regions: name → cells by kind as
    indices into `cells[kind]`. source says where the mesh came from, for messages. numbers (k,): what the file calls
    the points, None where it numbers none. turned (s,): points at which the file has axes other than x, y, z for the
    freedoms, which says nothing of the mesh, but of matrices and conditions written along them; None: no such axes.
    """

    points: Array
    cells: Blocks
    boundaries: Mapping[str, Blocks] = field(default_factory=dict)
    node_sets: Mapping[str, IntArray] = field(default_factory=dict)
    regions: Mapping[str, Mapping[str, IntArray]] = field(default_factory=dict)
    source: str = ""
    numbers: IntArray | None = None
    turned: IntArray | None = None

    @property
    def dimension(self) -> int:
        """2 or 3."""
        return int(self.points.shape[1])

    @property
    def cell_count(self) -> int:
        """Number of cells of all kinds."""
        return sum(len(c) for c in self.cells.values())

    def boundary_nodes(self, name: str) -> IntArray:
        """Nodes (b,) of a boundary or, if there is none of that name, of a node set, sorted. Raises KeyError."""
        if name in self.boundaries:
            return np.unique(np.concatenate([f.ravel() for f in self.boundaries[name].values()]))
        return self.node_sets[name]

"""Shape functions and quadrature of the solid elements, taken from scikit-fem once per kind.

Reference coordinates run from 0 to 1. Nodes are in the order of meshio (VTK); scikit-fem has orders of its own, and the
two are matched here by the places of the nodes in the reference cell. So a body's numbering never matters, nor do nodes
that coincide in space (cracks, the two sides of a contact).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from ..typing import Array, IntArray

_TRIANGLE = ((0, 0), (1, 0), (0, 1))
_QUAD = ((0, 0), (1, 0), (1, 1), (0, 1))
_TETRA = ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1))
_HEXAHEDRON = (*((x, y, 0) for x, y in _QUAD), *((x, y, 1) for x, y in _QUAD))

# Nodes between corners, each the mean of the corners listed.
_TRIANGLE_EDGES = ((0, 1), (1, 2), (2, 0))
_QUAD_EDGES = ((0, 1), (1, 2), (2, 3), (3, 0))
_TETRA_EDGES = ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3))
_HEXAHEDRON_EDGES = (
    *((0, 1), (1, 2), (2, 3), (3, 0)),
    *((4, 5), (5, 6), (6, 7), (7, 4)),
    *((0, 4), (1, 5), (2, 6), (3, 7)),
)
_HEXAHEDRON_FACES = ((0, 3, 4, 7), (1, 2, 5, 6), (0, 1, 4, 5), (2, 3, 6, 7), (0, 1, 2, 3), (4, 5, 6, 7))


@dataclass(frozen=True)
class _Description:
    """What scikit-fem calls the element, its corners, its other nodes as means of corners, and the polynomial degrees
    that its rules integrate exactly."""

    library_name: str
    corners: Sequence[tuple[int, ...]]
    between: Sequence[tuple[int, ...]]
    stiffness_degree: int
    mass_degree: int


# Stiffness is integrated in full: exactly on parallelograms and straight simplices, and with quadratic shapes to degree
# ≥ 3 always, which keeps the fourth order of the eigenvalues on curved cells (degree 2p - 1: Banerjee and Osborn 1990,
# Numer. Math. 56:735). So no element deforms without energy. Mass is exact on every cell with straight edges, and with
# it the mass and inertia of such bodies; in a hexahedron the Jacobian alone is of degree 2 in each coordinate. Rules
# with negative weights (triangle 3, tetrahedron 3 and 4) are avoided: on a strongly curved cell they could make a
# matrix indefinite.
_KINDS = {
    "triangle": _Description("ElementTriP1", _TRIANGLE, (), 2, 2),
    "triangle6": _Description("ElementTriP2", _TRIANGLE, _TRIANGLE_EDGES, 4, 4),
    "quad": _Description("ElementQuad1", _QUAD, (), 3, 3),
    "quad8": _Description("ElementQuadS2", _QUAD, _QUAD_EDGES, 5, 5),
    "quad9": _Description("ElementQuad2", _QUAD, (*_QUAD_EDGES, (0, 1, 2, 3)), 5, 5),
    "tetra": _Description("ElementTetP1", _TETRA, (), 1, 2),
    "tetra10": _Description("ElementTetP2", _TETRA, _TETRA_EDGES, 5, 5),
    "hexahedron": _Description("ElementHex1", _HEXAHEDRON, (), 3, 5),
    "hexahedron20": _Description("ElementHexS2", _HEXAHEDRON, _HEXAHEDRON_EDGES, 5, 7),
    "hexahedron27": _Description(
        "ElementHex2", _HEXAHEDRON, (*_HEXAHEDRON_EDGES, *_HEXAHEDRON_FACES, tuple(range(8))), 5, 7
    ),
}


@dataclass(frozen=True)
class Rule:
    """A quadrature rule of q points with the n shape functions at them.

    degree: polynomials integrated exactly; weights (q,) > 0, their sum the volume of the reference cell; values (q, n);
    gradients (q, n, d) with respect to the reference coordinates.
    """

    degree: int
    weights: Array
    values: Array
    gradients: Array


@dataclass(frozen=True)
class Element:
    """A kind of cell: reference places of its nodes (n, d), and how its stiffness and its mass are integrated."""

    kind: str
    nodes: Array
    stiffness: Rule
    mass: Rule


@cache
def element(kind: str) -> Element:
    """The element of a kind of cell named as in `mesh.model` (not facets). Raises KeyError for any other."""
    import skfem  # 0.2 s, needed by bodies of solids only
    from skfem.quadrature import get_quadrature

    description = _KINDS[kind]
    library = getattr(skfem, description.library_name)()
    nodes = _node_points(description)
    order = _order(nodes, np.asarray(library.doflocs, dtype=float))

    def rule(degree: int) -> Rule:
        points, weights = get_quadrature(library.refdom, degree)
        shapes = [library.lbasis(points, int(i)) for i in order]
        values = np.array([np.broadcast_to(value, weights.shape) for value, _ in shapes])
        gradients = np.array([np.broadcast_to(gradient, points.shape) for _, gradient in shapes])
        return Rule(
            degree,
            np.ascontiguousarray(weights, dtype=float),
            np.ascontiguousarray(values.T, dtype=float),
            np.ascontiguousarray(gradients.transpose(2, 0, 1), dtype=float),
        )

    return Element(kind, nodes, rule(description.stiffness_degree), rule(description.mass_degree))


def _node_points(description: _Description) -> Array:
    """Reference places (n, d) of the nodes, in the order of VTK."""
    corners = np.array(description.corners, dtype=float)
    return np.array([*corners, *(corners[list(group)].mean(axis=0) for group in description.between)])


def _order(nodes: Array, library_nodes: Array) -> IntArray:
    """Index (n,) of the library's shape function of each node."""
    distance = np.abs(nodes[:, None, :] - library_nodes[None, :, :]).max(axis=2)
    order = distance.argmin(axis=1)
    if len(nodes) != len(library_nodes) or distance.min(axis=1).max() > 1e-9 or len(set(order)) != len(nodes):
        raise RuntimeError("the finite element library has moved the nodes of its reference element")
    return order

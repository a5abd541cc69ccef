"""Where a point of a master surface lies in the finite element below it, and with which weights its nodes follow.

In the plane the search of a location works on splines; forces and displacements are those of the mesh's own, maybe
quadratic, facets, on which the search in space works itself. The weights are exact for what the element interpolates,
positions among them.
"""

from __future__ import annotations

import numpy as np

from ..mesh.facets import shape_functions
from ..typing import Array, IntArray
from .curve import Curve
from .facets import FacetSurface
from .master import Location

STEPS = 6
LINEAR = ("triangle", "quad", "line")


def element_weights(
    master: Curve | FacetSurface, location: Location, points: Array, current: Array
) -> tuple[IntArray, Array]:
    """Nodes (q, r) of the master's numbering and weights (q, r) of the elements at a location of points (q, d) [m].

    current (k, d) [m]: where the master's nodes are now. Unused places hold node 0 with weight 0.
    """
    if isinstance(master, FacetSurface):
        return location.nodes, location.weights
    return _on_line(master, location, points, current)


def _on_line(curve: Curve, location: Location, points: Array, current: Array) -> tuple[IntArray, Array]:
    """On a curve of which some facets are quadratic: two segments of the spline to each of those."""
    assert location.local is not None, "a curve tells the coordinate on its segments"
    owner, half = _segments(curve)
    facet, part = owner[location.facet], half[location.facet]
    quadratic = curve.facets[facet, 2] >= 0
    local = np.where(part < 0, location.local[:, 0], 0.5 * (np.maximum(part, 0) + location.local[:, 0]))
    nodes = np.maximum(curve.facets[facet], 0)
    weights = np.zeros(nodes.shape)
    straight = ~quadratic
    weights[straight, 0], weights[straight, 1] = 1.0 - local[straight], local[straight]
    mine = np.flatnonzero(quadratic)
    refined = _refined("line3", local[mine, None], current[nodes[mine]], points[mine], location.normal[mine])
    weights[mine] = shape_functions("line3", refined)[0]
    weights[np.abs(weights) < 1e-12] = 0.0
    return np.where(weights == 0.0, 0, nodes), weights


def _segments(curve: Curve) -> tuple[IntArray, IntArray]:
    """The facet of each segment (c,) and which half of it that is, −1 for the whole of a linear one."""
    count = len(curve.stencils)
    owner, half = np.zeros(count, dtype=np.int64), np.full(count, -1)
    begins = {int(node): k for k, node in enumerate(curve.stencils[:, 1])}
    for number, (first, _, middle) in enumerate(curve.facets):
        segment = begins[int(first)]
        owner[segment] = number
        if middle >= 0:
            following = begins[int(middle)]
            owner[following] = number
            half[segment], half[following] = 0, 1
    return owner, half


def _refined(kind: str, local: Array, element: Array, points: Array, normal: Array) -> Array:
    """Reference coordinates (q, e) where points (q, d) stand along normals (q, d) on elements (q, r, d), by Newton's
    method.

    What does not converge near its start stays there: beyond the edge of a surface the start is the answer.
    """
    current = local.copy()
    for _ in range(STEPS):
        values, slopes = shape_functions(kind, current)
        offset = np.einsum("qr,qrd->qd", values, element) - points
        tangents = np.einsum("eqr,qrd->qde", slopes, element)
        system = np.concatenate([tangents, normal[:, :, None]], axis=2)
        regular = np.abs(np.linalg.det(system)) > 1e-12 * np.prod(np.linalg.norm(tangents, axis=1), axis=1)
        step = np.zeros((len(local), system.shape[2]))
        step[regular] = np.linalg.solve(system[regular], offset[regular][:, :, None])[:, :, 0]
        current = current - step[:, :-1]
    near = np.all(np.isfinite(current), axis=1) & (np.abs(current - local).max(axis=1, initial=0.0) < 0.2)
    return np.where(near[:, None], current, local)

"""Nearest places on the mesh's own, maybe quadratic, faces: lines in the plane and in space, facets in space.

Ties ask for the nearest place on the faces themselves, not for that along the smoothed normals of the search for
contacts, which says where to begin.
"""

from __future__ import annotations

import numpy as np

from ..mesh.facets import reference_nodes, shape_functions
from ..typing import Array, IntArray
from .facets import FacetSurface
from .interpolation import LINEAR

STEPS = 30
CONVERGED = 1e-14  # step of a reference coordinate
ON_IT = 1e-12  # of a face's size: distance of a point that no other face is asked for
AT_A_NODE = 1e-9  # weights below are none: a point within rounding of a node is that node, as in `facet_search`


def project_on_lines(points: Array, facets: Array) -> Array:
    """ξ (…) in [0, 1] of the nearest points on quadratic lines (…, 3, d) to points (…, d), by Newton's method.

    The lines' nodes: first, last, middle.
    """
    start, end, middle = facets[..., 0, :], facets[..., 1, :], facets[..., 2, :]
    along, bend = end - start, 2.0 * (start + end) - 4.0 * middle
    xi = np.clip(np.sum((points - start) * along, axis=-1) / np.sum(along**2, axis=-1), 0.0, 1.0)
    for _ in range(STEPS):
        offset = points - np.einsum("...r,...rd->...d", line3(xi), facets)
        slope = along + (2.0 * xi[..., None] - 1.0) * bend
        square = np.sum(slope**2, axis=-1)
        bent = np.maximum(square - 2.0 * np.sum(offset * bend, axis=-1), 0.1 * square)
        new = np.clip(xi + np.sum(offset * slope, axis=-1) / bent, 0.0, 1.0)
        moved = float(np.abs(new - xi).max(initial=0.0))
        xi = new
        if moved < CONVERGED:
            break
    return xi


def line3(xi: Array) -> Array:
    """Shape functions (…, 3) of first, last and middle node of a quadratic line on [0, 1]."""
    return np.stack([(1.0 - xi) * (1.0 - 2.0 * xi), xi * (2.0 * xi - 1.0), 4.0 * xi * (1.0 - xi)], axis=-1)


def nearest_on_faces(points: Array, surface: FacetSurface, facet: IntArray) -> tuple[IntArray, Array]:
    """Nodes (s, 9) and weights (s, 9) of the nearest places on the faces of a mesh to points (s, 3) [m].

    surface undisplaced; facet (s,): linear facets near which they are. Unused places hold node 0 with weight 0.
    """
    nodes, weights, square, size = _on_faces(points, surface, facet)
    off = np.flatnonzero(square > (ON_IT * size) ** 2)
    if len(off):
        # Which face is nearest, linear facets need not know: those around are asked as well.
        around = surface.neighbours[facet[off]]
        others = np.column_stack([surface.nearest_facets(points[off]), np.where(around < 0, facet[off, None], around)])
        for other in others.T:
            found = _on_faces(points[off], surface, other)
            better = found[2] < square[off] * (1.0 - 1e-12)
            mine = off[better]
            nodes[mine], weights[mine], square[mine] = found[0][better], found[1][better], found[2][better]
    weights[np.abs(weights) < AT_A_NODE] = 0.0
    weights /= weights.sum(axis=1, keepdims=True)
    return np.where(weights == 0.0, 0, nodes), weights


def _on_faces(points: Array, surface: FacetSurface, facet: IntArray) -> tuple[IntArray, Array, Array, Array]:
    """Nodes and weights (s, 9), squared distances (s,) [m²] and sizes (s,) [m] of the faces that facets (s,) are of."""
    nodes = surface.elements[facet]
    weights = np.zeros(nodes.shape)
    square, size = np.zeros(len(points)), np.ones(len(points))
    pattern = surface.pattern[facet]
    for number, (kind, split) in enumerate(zip(surface.kinds, surface.splits, strict=True)):
        mine = np.flatnonzero(pattern == number)
        if not len(mine):
            continue
        at = reference_nodes(kind)
        faces = surface.positions[nodes[mine, : len(at)]]
        start = at[[c for c in split if c >= 0]].mean(axis=0)
        weights[mine, : len(at)], square[mine] = _on_kind(kind, points[mine], faces, start)
        size[mine] = np.linalg.norm(np.ptp(faces, axis=1), axis=1)
    return nodes, weights, square, size


def _on_kind(kind: str, points: Array, faces: Array, start: Array) -> tuple[Array, Array]:
    """Weights (s, r) and squared distances (s,) of the nearest places on faces (s, r, 3) of a kind: within them or on
    their edges."""
    values = shape_functions(kind, _within(kind, points, faces, start))[0]
    square = _squares(points, faces, values)
    corners = 3 if kind.startswith("triangle") else 4
    for edge in range(corners):
        ends = [edge, (edge + 1) % corners]
        middle = faces[:, corners + edge] if kind not in LINEAR else faces[:, ends].mean(axis=1)
        xi = project_on_lines(points, np.concatenate([faces[:, ends], middle[:, None]], axis=1))
        at = reference_nodes(kind)
        other = shape_functions(kind, at[ends[0]] + xi[:, None] * (at[ends[1]] - at[ends[0]]))[0]
        distance = _squares(points, faces, other)
        better = distance < square
        values[better], square[better] = other[better], distance[better]
    return values, square


def _squares(points: Array, faces: Array, values: Array) -> Array:
    return np.sum((np.einsum("sr,srd->sd", values, faces) - points) ** 2, axis=1)


def _within(kind: str, points: Array, faces: Array, start: Array) -> Array:
    """Reference coordinates (s, 2) of stationary points of the distance by Gauss and Newton's method, led back into the
    face where they are beyond it."""
    local = np.tile(start, (len(points), 1))
    for _ in range(STEPS):
        values, slopes = shape_functions(kind, local)
        offset = np.einsum("sr,srd->sd", values, faces) - points
        a, b = np.einsum("esr,srd->esd", slopes, faces)
        aa, ab, bb = (np.sum(u * v, axis=1) for u, v in ((a, a), (a, b), (b, b)))
        ra, rb = np.sum(a * offset, axis=1), np.sum(b * offset, axis=1)
        # Where the face folds onto a line there is no such point: its edges are asked.
        det = np.maximum(aa * bb - ab * ab, 1e-12 * aa * bb + 1e-300)
        step = np.stack([bb * ra - ab * rb, aa * rb - ab * ra], axis=1) / det[:, None]
        new = np.clip(local - step, -0.5, 1.5)
        moved = float(np.abs(new - local).max(initial=0.0))
        local = new
        if moved < CONVERGED:
            break
    local = np.clip(local, 0.0, 1.0)
    if kind.startswith("triangle"):
        local = local / np.maximum(local.sum(axis=1, keepdims=True), 1.0)
    return local

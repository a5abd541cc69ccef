"""The edges between the facets of a surface in space, and what the surface turns by over them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..mesh.facets import reference_nodes, shape_functions
from ..mesh.model import Blocks
from ..typing import Array, IntArray


@dataclass(frozen=True)
class Edges:
    """e edges between two of the facets of a surface, and what they turn by.

    facets (e, 2), and which of their edges (e, 2) it is; nodes (e, 2) at its ends; along (e, 3) unit and inward
    (e, 2, 3) across it into both facets, unit; middle (e, 3) [m]; turn (e,) [rad] between the normals on both sides,
    positive where the body is convex; own (e, 2) [rad]: what each facet turns by from there to its other side.
    """

    facets: IntArray
    places: IntArray
    nodes: IntArray
    along: Array
    inward: Array
    middle: Array
    turn: Array
    own: Array


def edges_of(positions: Array, blocks: Blocks) -> Edges:
    """The edges between facets by kind of a surface with nodes at positions (k, 3) [m], numbered block by block."""
    inner, own = [], []
    for kind, block in blocks.items():
        count = 3 if kind.startswith("triangle") else 4
        at, c = reference_nodes(kind), np.arange(count)
        middles = 0.5 * (at[c] + at[(c + 1) % count])
        # Opposite to an edge: a triangle's third corner, the middle of the other side of a quadrilateral.
        opposite = at[(c + 2) % count] if count == 3 else middles[(c + 2) % 4]
        near, far = (_normals(kind, positions[block], local) for local in (middles, opposite))
        if count == 4 and len(at) == 4:
            # A warped quadrilateral has the normal of its diagonals, as one that does not turn itself.
            one, other = (positions[block[:, i + 2]] - positions[block[:, i]] for i in (0, 1))
            across = np.cross(one, other)
            near = far = np.repeat((across / np.linalg.norm(across, axis=1, keepdims=True))[:, None], 4, axis=1)
        pad = ((0, 0), (0, 4 - count))
        inner.append(np.pad(near, (*pad, (0, 0))))
        own.append(np.pad(near - far, (*pad, (0, 0))))
    facets, normals, change = corners_of(blocks), np.concatenate(inner), np.concatenate(own)
    valid = facets >= 0
    following = np.where(facets[:, 3:] < 0, [[1, 2, 0, 0]], [[1, 2, 3, 0]])
    begin, end = facets[valid], np.take_along_axis(facets, following, axis=1)[valid]
    owner, place = np.nonzero(valid)
    order = np.lexsort((begin > end, np.maximum(begin, end), np.minimum(begin, end)))
    low, high = np.minimum(begin, end)[order], np.maximum(begin, end)[order]
    first = np.flatnonzero((low[1:] == low[:-1]) & (high[1:] == high[:-1]))
    pair = np.stack([order[first], order[first + 1]], axis=1)
    sides, places = owner[pair], place[pair]
    nodes = np.stack([begin[pair[:, 0]], end[pair[:, 0]]], axis=1)
    along = positions[nodes[:, 1]] - positions[nodes[:, 0]]
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-300)
    n = normals[sides, places]
    inward = np.stack([np.cross(n[:, 0], along), np.cross(along, n[:, 1])], axis=1)
    length = np.linalg.norm(inward, axis=2, keepdims=True)
    inward = np.divide(inward, length, out=np.zeros_like(inward), where=length > 0)
    sine = np.sum(np.cross(n[:, 0], n[:, 1]) * along, axis=1)
    turn = np.arctan2(sine, np.sum(n[:, 0] * n[:, 1], axis=1))
    turned = np.abs(np.sum(change[sides, places] * inward, axis=2))
    return Edges(
        sides, places, nodes, along, inward, positions[nodes].mean(axis=1), turn,
        2.0 * np.arcsin(np.minimum(0.5 * turned, 1.0)),
    )  # fmt: skip


def corners_of(blocks: Blocks) -> IntArray:
    """Corners (f, 4) of facets by kind, block by block, −1 in the last place of a triangle."""
    sides = [(3 if kind.startswith("triangle") else 4, block) for kind, block in blocks.items()]
    return np.concatenate([np.pad(b[:, :n], ((0, 0), (0, 4 - n)), constant_values=-1) for n, b in sides])


def _normals(kind: str, facets: Array, local: Array) -> Array:
    """Unit normals (f, q, 3) of facets (f, r, 3) of a kind at reference coordinates (q, 2), zero where none is."""
    a, b = np.einsum("eqr,frd->efqd", shape_functions(kind, local)[1], facets)
    normal = np.cross(a, b)
    length = np.linalg.norm(normal, axis=2, keepdims=True)
    return np.divide(normal, length, out=np.zeros_like(normal), where=length > 0)

"""Normals where a curved surface of linear facets ends: continued from how they turn inside.

A node at an end has facets on one side only. The average of their normals is that of a place half a facet inside, an
offset d away across the edge; with the turn B of the normals of facets around it, n' = B d, the normal at the node is
the average and B d. B is the least-squares fit to the normals of the facets at the node and of all that share a node
with these, from their places in the tangent plane: Bd = Σ gᶠ nᶠ with Σ gᶠ = 0, so that on flat surfaces nothing
changes.
"""

from __future__ import annotations

from collections import defaultdict

import numpy as np
import scipy.sparse as sp

from ..typing import Array, BoolArray, IntArray, Sparse

STRIP = 0.2  # of the longest: a spread of centres below it tells no turn that way
REACH = 1.0  # of the way between the outermost centres: how far beyond them normals are continued
FAINT = 0.05  # of the largest turn around it: what is added to a normal and is left out
STRAIGHT = 0.7  # cosine: edges of the end that go on in one direction


def rim_normals(
    positions: Array, facets: IntArray, neighbours: IntArray, sharp: BoolArray, groups: IntArray, linear: BoolArray,
    normals: Array, smoothed: Array,
) -> Sparse:  # fmt: skip
    """What unit normals of facets (f,) add to the averaged unit normals of groups: a sparse (groups, f).

    positions (k, 3), facets (f, 4) with −1 in the last place of triangles, neighbours and sharp (f, 4) of the edge that
    begins at each corner, groups (f, 4), linear (f,): facets that are as flat as their corners; normals (f, 3) and
    averaged ones ``smoothed`` (groups, 3).
    """
    valid = facets >= 0
    blocked = valid & ((neighbours < 0) | sharp)
    corners = valid.sum(axis=1)
    centres = _places(positions, facets)
    members, edges = defaultdict[int, set[int]](set), defaultdict[int, list[Array]](list)
    at = dict[int, int]()
    for f, edge in zip(*np.nonzero(blocked), strict=True):
        following = (int(edge) + 1) % int(corners[f])
        along = positions[facets[f, following]] - positions[facets[f, edge]]
        for corner in (int(edge), following):
            group = int(groups[f, corner])
            edges[group].append(along / np.linalg.norm(along))
            at[group] = int(facets[f, corner])
    for f, corner in zip(*np.nonzero(valid), strict=True):
        members[int(groups[f, corner])].add(int(f))
    rows, columns, values = list[int](), list[int](), list[float]()
    for group in edges:
        own = sorted(members[group])
        patch = sorted(set().union(*(members[int(g)] for g in groups[own][valid[own]])))
        if not linear[patch].all():
            continue
        share = _continued(positions[at[group]], own, patch, edges[group], centres, normals, smoothed[group])
        rows += [group] * len(patch)
        columns += patch
        values += share.tolist()
    shape = int(groups.max()) + 1, len(facets)
    return sp.csr_array((values, (rows, columns)), shape=shape)


def _places(positions: Array, facets: IntArray) -> Array:
    """Where a curved surface through the corners of facets (f,) has about their normals (f, 3): the centre of a
    quadrilateral, of a triangle that of the circle through its corners (which is exact on spheres, and where it is half
    of a rectangle on cylinders as well), or the middle of its longest edge where an angle is obtuse."""
    a, b, c = (positions[facets[:, k]] for k in range(3))
    last = positions[np.where(facets[:, 3] < 0, facets[:, 0], facets[:, 3])]
    sides = [np.sum((p - q) ** 2, axis=1) for p, q in ((b, c), (c, a), (a, b))]
    others = zip(sides, sides[1:] + sides[:1], sides[2:] + sides[:2], strict=True)
    shares = [s * np.maximum(t + u - s, 0.0) for s, t, u in others]
    total = np.maximum(np.sum(shares, axis=0), 1e-300)
    circle = sum((share / total)[:, None] * corner for share, corner in zip(shares, (a, b, c), strict=True))
    places: Array = np.where(facets[:, 3:] < 0, circle, (a + b + c + last) / 4)
    return places


def _continued(
    node: Array, own: list[int], patch: list[int], edges: list[Array], centres: Array, normals: Array, average: Array
) -> Array:
    """gᶠ (f,) of the facets of a patch."""
    flat = np.eye(3) - np.outer(average, average)
    offset = flat @ (node - centres[own].mean(axis=0))
    first = edges[0]
    if all(abs(float(first @ edge)) >= STRAIGHT for edge in edges):
        # Along an end that goes on both sides are there.
        along = flat @ np.sum([edge * np.sign(first @ edge) for edge in edges], axis=0)
        along /= max(float(np.linalg.norm(along)), 1e-300)
        offset = offset - along * (along @ offset)
    places = (centres[patch] - centres[patch].mean(axis=0)) @ flat
    _, spread, ways = np.linalg.svd(places, full_matrices=False)
    known = (spread > STRIP * spread[0]) & (np.abs(ways @ offset) <= REACH * np.ptp(places @ ways.T, axis=0))
    if not known.any():
        return np.zeros(len(patch))
    inverse = (ways[known].T / spread[known] ** 2) @ ways[known] @ places.T
    return offset @ inverse

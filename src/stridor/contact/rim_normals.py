"""Normals where a curved surface of linear facets ends: continued from how they turn inside.

A node at an end has facets on one side only. The average of their normals is that of a place half a facet inside, an
offset d away across the edge; with the turn B of the normals of facets around it, n' = B d, the normal at the node is
the average and B d. B is the least-squares fit to the normals of the facets at the node and of two rings about them,
from their places in the tangent plane: Bd = Σ gᶠ nᶠ with Σ gᶠ = 0, so that on flat surfaces nothing changes. On
spheres and cylinders normals are linear in these places. Where they are not, as where a flat ends beside a fillet, or
facets are too uneven to tell, the fit leaves more than a share of what it would add, and nothing is added.
"""

from __future__ import annotations

from collections import defaultdict

import numpy as np
import scipy.sparse as sp

from ..typing import Array, BoolArray, IntArray, Sparse

STRIP = 0.2  # of the longest: a spread of places below it tells no turn that way
REACH = 1.0  # of the way between the outermost places: how far beyond them normals are continued
LEFT = 0.3  # of what is added to a normal: what the fit may leave of the normals it is made of
HALF = 0.6  # of the largest turn about a node: what is added at most, half of it on even facets
FLAT = 1e-9  # turn of normals about a facet that is none


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
    turn = np.where(valid, np.linalg.norm(smoothed[groups] - normals[:, None], axis=2), 0.0).max(axis=1)
    places = _places(positions, facets)
    # By group: from facets' places straight to their edges there that end the surface.
    across = defaultdict[int, list[Array]](list)
    corners = valid.sum(axis=1)
    for f, edge in zip(*np.nonzero(blocked & (turn > FLAT)[:, None] & linear[:, None]), strict=True):
        following = (int(edge) + 1) % int(corners[f])
        begin, end = positions[facets[f, edge]], positions[facets[f, following]]
        along = (end - begin) / np.linalg.norm(end - begin)
        way = begin - places[f] - along * (along @ (begin - places[f]))
        for corner in (int(edge), following):
            across[int(groups[f, corner])].append(way)
    if not across:
        return sp.csr_array((int(groups.max()) + 1, len(facets)))
    sheet = sp.csr_array(
        (np.ones(int(valid.sum())), (np.nonzero(valid)[0], groups[valid])), shape=(len(facets), int(groups.max()) + 1)
    )
    at = sp.csr_array(sheet.T)
    near = sp.csr_array(sheet @ at)  # facets that share a node
    rows, columns, values = list[int](), list[int](), list[float]()
    for group, ways in across.items():
        own = at.indices[at.indptr[group] : at.indptr[group + 1]]
        ring = _about(near, own)
        patch = _about(near, ring)
        if not linear[patch].all():
            continue
        most = HALF * np.linalg.norm(normals[ring] - smoothed[group], axis=1).max()
        share = _continued(_beyond(np.array(ways)), places[patch], normals[patch], smoothed[group], most)
        rows += [group] * len(patch)
        columns += patch.tolist()
        values += share.tolist()
    return sp.csr_array((values, (rows, columns)), shape=(int(groups.max()) + 1, len(facets)))


def _beyond(ways: Array) -> Array:
    """The offset (3,) that goes as far beyond each edge as its way (e, 3): of a straight end their mean, at a corner
    their sum."""
    far = np.linalg.norm(ways, axis=1)
    far = np.maximum(far, 1e-300)
    offset: Array = np.linalg.lstsq(ways / far[:, None], far, rcond=STRIP)[0]
    return offset


def _about(near: Sparse, own: IntArray) -> IntArray:
    """Facets that share a node with some."""
    found: IntArray = np.unique(np.concatenate([near.indices[near.indptr[f] : near.indptr[f + 1]] for f in own]))
    return found


def _continued(offset: Array, places: Array, normals: Array, average: Array, most: float) -> Array:
    """gᶠ (f,) of the facets of a patch, for a node that is ``offset`` beyond where the average is; none where more than
    ``most`` would be added."""
    nothing = np.zeros(len(places))
    flat = np.eye(3) - np.outer(average, average)
    offset = flat @ offset
    centred = (places - places.mean(axis=0)) @ flat
    _, spread, ways = np.linalg.svd(centred, full_matrices=False)
    known = (spread > STRIP * spread[0]) & (np.abs(ways @ offset) <= REACH * np.ptp(centred @ ways.T, axis=0))
    if not known.any():
        return nothing
    inverse = (ways[known].T / spread[known] ** 2) @ ways[known] @ centred.T
    share: Array = offset @ inverse
    turned = normals @ flat
    left = turned - turned.mean(axis=0) - centred @ (inverse @ turned)
    added = float(np.linalg.norm(share @ turned))
    return share if np.sqrt(np.mean(np.sum(left**2, axis=1))) <= LEFT * added <= LEFT * most else nothing


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

"""Common pieces of two meshes of a plane: convex polygons cut by convex polygons, into triangles."""

from __future__ import annotations

import numpy as np

from ..kernels import njit, put
from ..typing import Array, IntArray

MOST_CORNERS = 10
# Pieces below this part of the polygon's area are rounding.
SLIVER = 1e-13
# A corner by which less than this part of that area would be lost is none: edges that coincide but for rounding cross
# anywhere, and the triangles must not depend on where.
STRAIGHT = 1e-11
# The corner farthest along this way, along which no two of a mesh are level, begins the triangles: any would do.
FIRST_X, FIRST_Y = 0.8346, 0.5509


@njit(cache=True)
def common_triangles(
    polygons: Array, corners: IntArray, owner: IntArray, others: Array, other_corners: IntArray
) -> tuple[IntArray, Array]:  # pragma: no cover - compiled
    """Triangles (t, 3, 2) that polygons and others have in common, and the pair (t,) that each comes from.

    polygons (e, 4, 2) with corners (e,) of them, counter-clockwise; others (p, 4, 2) with other_corners (p,), in any
    sense of turning, to be cut by polygon owner (p,). By Sutherland and Hodgman (1974).
    """
    pairs = owner.shape[0]
    found = np.empty((pairs * (MOST_CORNERS - 2), 3, 2))
    which = np.empty(pairs * (MOST_CORNERS - 2), dtype=np.int64)
    count = 0
    inside, cut = np.zeros((MOST_CORNERS + 2, 2)), np.zeros((MOST_CORNERS + 2, 2))
    for p in range(pairs):
        e = owner[p]
        n = other_corners[p]
        for k in range(n):
            put(inside[k], others[p, k])
        area = 0.0
        for i in range(corners[e]):
            j = (i + 1) % corners[e]
            area += polygons[e, i, 0] * polygons[e, j, 1] - polygons[e, j, 0] * polygons[e, i, 1]
        for i in range(corners[e]):
            j = (i + 1) % corners[e]
            ax, ay = polygons[e, i, 0], polygons[e, i, 1]
            dx, dy = polygons[e, j, 0] - ax, polygons[e, j, 1] - ay
            kept = 0
            for k in range(n):
                following = (k + 1) % n
                side = dx * (inside[k, 1] - ay) - dy * (inside[k, 0] - ax)
                next_side = dx * (inside[following, 1] - ay) - dy * (inside[following, 0] - ax)
                if side >= 0.0:
                    put(cut[kept], inside[k])
                    kept += 1
                if (side > 0.0 and next_side < 0.0) or (side < 0.0 and next_side > 0.0):
                    t = side / (side - next_side)
                    for d in range(2):
                        cut[kept, d] = inside[k, d] + t * (inside[following, d] - inside[k, d])
                    kept += 1
                if kept >= MOST_CORNERS:
                    break
            n = kept
            for k in range(n):
                put(inside[k], cut[k])
            if n < 3:
                break
        n = _kept_corners(inside, n, STRAIGHT * area)
        for k in range(1, n - 1):
            size = (inside[k, 0] - inside[0, 0]) * (inside[k + 1, 1] - inside[0, 1])
            size -= (inside[k, 1] - inside[0, 1]) * (inside[k + 1, 0] - inside[0, 0])
            if abs(size) > SLIVER * area:
                put(found[count, 0], inside[0])
                put(found[count, 1], inside[k])
                put(found[count, 2], inside[k + 1])
                which[count] = p
                count += 1
    return which[:count], found[:count]


@njit(cache=True)
def _kept_corners(inside: Array, n: int, least: float) -> int:  # pragma: no cover - compiled
    """Leave out corners of a polygon, the first n of inside (·, 2), that lie on a straight line between their
    neighbours, twice the area between them at most least, and put a corner first that rounding does not choose."""
    k = 0
    passed = 0  # corners since one was left out
    while n >= 3 and passed < n:
        k = k % n
        before, after = (k - 1) % n, (k + 1) % n
        x, y = inside[after, 0] - inside[before, 0], inside[after, 1] - inside[before, 1]
        size = x * (inside[k, 1] - inside[before, 1]) - y * (inside[k, 0] - inside[before, 0])
        if abs(size) <= least:
            for j in range(k, n - 1):
                put(inside[j], inside[j + 1])
            n -= 1
            passed = 0
        else:
            k += 1
            passed += 1
    first = 0
    for k in range(1, n):
        x, y = inside[k, 0] - inside[first, 0], inside[k, 1] - inside[first, 1]
        if FIRST_X * x + FIRST_Y * y > 0.0:
            first = k
    for _ in range(first):
        x, y = inside[0, 0], inside[0, 1]
        for j in range(n - 1):
            put(inside[j], inside[j + 1])
        inside[n - 1, 0], inside[n - 1, 1] = x, y
    return n

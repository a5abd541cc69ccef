"""Common pieces of two meshes of a plane: convex polygons cut by convex polygons, into triangles."""

from __future__ import annotations

import numpy as np

from ..kernels import njit, put
from ..typing import Array, IntArray

MOST_CORNERS = 10
# Pieces below this part of the polygon's area are rounding.
SLIVER = 1e-13


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

"""The compiled search of `facets`: from slave points to places on facets, facet by facet over their edges.

Reference coordinates are (ξ, η) of the triangle (0, 0), (1, 0), (0, 1) and the square [0, 1]². Edge e begins
at corner e.
"""

from __future__ import annotations

import numpy as np

from ..kernels import njit
from ..typing import Array, BoolArray, IntArray

NEWTON_STEPS = 25
# A guess is a few facets away, a start by nearness hardly any.
WALK_STEPS = 200
# Beyond an edge of the surface by less than this part of a facet is still on it (in reference coordinates).
EDGE_TOLERANCE = 1e-6
# An edge is seen from both its facets; beyond it by rounding is no reason to walk to and fro.
ROUNDING = 1e-10
Sheet = tuple[Array, IntArray, Array, IntArray, IntArray, BoolArray]
Parts = tuple[BoolArray, IntArray, Array, IntArray, IntArray]
# Powers of ξ and η: what quadratic facets are made of, on parts that are turned against them as well.
MONOMIALS = np.array(
    [[0, 0], [1, 0], [0, 1], [2, 0], [1, 1], [0, 2], [2, 1], [1, 2], [2, 2], [3, 0], [0, 3]], dtype=np.int64
)


def shape_of(triangle: BoolArray, local: Array) -> Array:
    """Weights (m, 4) of the corners at local coordinates (m, 2); a triangle's fourth is 0.

    Weights within 1e-9 of nothing are set to it: a point within rounding of a node is that node.
    """
    x, y = np.asarray(local, dtype=float).T
    linear = np.stack([1 - x - y, x, y, np.zeros_like(x)], axis=1)
    bilinear = np.stack([(1 - x) * (1 - y), x * (1 - y), x * y, (1 - x) * y], axis=1)
    weights = np.where(triangle[:, None], linear, bilinear)
    weights[np.abs(weights) < 1e-9] = 0.0
    return weights / weights.sum(axis=1, keepdims=True)


def edge_coordinates(triangle: BoolArray, edge: IntArray, along: Array) -> Array:
    """Reference coordinates (m, 2) at parts ``along`` (m,) in [0, 1] of the edges (m,)."""
    t, one, zero = along, np.ones_like(along), np.zeros_like(along)
    on_triangle = np.stack([np.stack([t, zero], 1), np.stack([1 - t, t], 1), np.stack([zero, 1 - t], 1)])
    on_square = np.stack(
        [np.stack([t, zero], 1), np.stack([one, t], 1), np.stack([1 - t, one], 1), np.stack([zero, 1 - t], 1)]
    )
    each = np.arange(len(along))
    return np.where(triangle[:, None], on_triangle[np.minimum(edge, 2), each], on_square[edge, each])


@njit(cache=True)
def nearest_edges(
    slaves: Array, begin: Array, end: Array, bend: Array
) -> tuple[IntArray, Array, Array]:  # pragma: no cover - compiled
    """Which of the edges from begin (b, 3) to end (b, 3) is nearest to each slave (m, 3), where on it, how far [m].

    bend (b, 3) [m]: edges are parabolas begin + t (end − begin) + t (1 − t) bend, straight where it is zero.
    """
    count = slaves.shape[0]
    which = np.zeros(count, dtype=np.int64)
    along = np.zeros(count)
    distance = np.empty(count)
    height = np.zeros(len(begin))
    for b in range(begin.shape[0]):
        height[b] = 0.25 * np.sqrt(bend[b, 0] ** 2 + bend[b, 1] ** 2 + bend[b, 2] ** 2)
    for i in range(count):
        best = np.inf
        for b in range(begin.shape[0]):
            square = 0.0
            product = 0.0
            for d in range(3):
                side = end[b, d] - begin[b, d]
                square += side * side
                product += side * (slaves[i, d] - begin[b, d])
            t = min(max(product / square, 0.0), 1.0)
            distance_squared = 0.0
            for d in range(3):
                off = slaves[i, d] - begin[b, d] - t * (end[b, d] - begin[b, d])
                distance_squared += off * off
            if height[b] > 0.0:
                # No point of the parabola is farther from its chord than its height.
                if np.sqrt(distance_squared) - height[b] >= np.sqrt(best):
                    continue
                t, distance_squared = _on_parabola(slaves[i], begin[b], end[b], bend[b], t)
            if distance_squared < best:
                best = distance_squared
                which[i] = b
                along[i] = t
        distance[i] = np.sqrt(best)
    return which, along, distance


@njit(cache=True)
def _on_parabola(
    slave: Array, begin: Array, end: Array, bend: Array, t: float
) -> tuple[float, float]:  # pragma: no cover - compiled
    """Where in [0, 1] a parabola is nearest to a slave, from t on, and the square of the distance [m²]."""
    square = 0.0
    for _ in range(NEWTON_STEPS):
        first = second = square = length = 0.0
        for d in range(3):
            off = slave[d] - begin[d] - t * (end[d] - begin[d]) - t * (1.0 - t) * bend[d]
            slope = end[d] - begin[d] + (1.0 - 2.0 * t) * bend[d]
            square += off * off
            first += off * slope
            length += slope * slope
            second += 2.0 * off * bend[d]
        new = min(max(t + first / max(length + second, 0.1 * length), 0.0), 1.0)
        moved = abs(new - t)
        t = new
        if moved < 1e-14:
            break
    square = 0.0
    for d in range(3):
        off = slave[d] - begin[d] - t * (end[d] - begin[d]) - t * (1.0 - t) * bend[d]
        square += off * off
    return t, square


@njit(cache=True)
def _fill_shape(triangle: bool, x: float, y: float, shape: Array) -> None:  # pragma: no cover - compiled
    """Values (row 0) and derivatives (rows 1, 2) of the corner functions, three of a triangle, else four."""
    if triangle:
        shape[0, 0], shape[0, 1], shape[0, 2] = 1.0 - x - y, x, y
        shape[1, 0], shape[1, 1], shape[1, 2] = -1.0, 1.0, 0.0
        shape[2, 0], shape[2, 1], shape[2, 2] = -1.0, 0.0, 1.0
    else:
        shape[0, 0], shape[0, 1], shape[0, 2], shape[0, 3] = (1.0 - x) * (1.0 - y), x * (1.0 - y), x * y, (1.0 - x) * y
        shape[1, 0], shape[1, 1], shape[1, 2], shape[1, 3] = y - 1.0, 1.0 - y, y, -y
        shape[2, 0], shape[2, 1], shape[2, 2], shape[2, 3] = x - 1.0, -x, x, 1.0 - x


@njit(cache=True)
def _fill_curved(polynomial: Array, x: float, y: float, work: Array) -> None:  # pragma: no cover - compiled
    """X, N and their derivatives in rows of work (6, 3) from polynomials (11, 6) in `MONOMIALS`."""
    powers_x = (1.0, x, x * x, x * x * x)
    powers_y = (1.0, y, y * y, y * y * y)
    work[:] = 0.0
    for k in range(MONOMIALS.shape[0]):
        i, j = MONOMIALS[k, 0], MONOMIALS[k, 1]
        value = powers_x[i] * powers_y[j]
        by_x = i * powers_x[i - 1] * powers_y[j] if i > 0 else 0.0
        by_y = j * powers_x[i] * powers_y[j - 1] if j > 0 else 0.0
        for d in range(3):
            point, out = polynomial[k, d], polynomial[k, d + 3]
            work[0, d] += value * point
            work[1, d] += by_x * point
            work[2, d] += by_y * point
            work[3, d] += value * out
            work[4, d] += by_x * out
            work[5, d] += by_y * out


@njit(cache=True)
def _solve(
    slave: Array,
    current: Array,
    facet: IntArray,
    normals: Array,
    curved: bool,
    polynomial: Array,
    local: Array,
    shape: Array,
    work: Array,
) -> bool:  # pragma: no cover - compiled
    """x = X(ξ, η) + g N(ξ, η) on one facet by Newton's method; local (3,) takes ξ, η and g |N|.

    N is the interpolated normal, not of unit length: its direction alone counts. work (6, 3) is space for the offset
    X + gN − x, the two tangents of that, N and its derivatives. curved: X and N are a polynomial (11, 6)
    on a part of a quadratic facet. False where the equations are singular or the steps do not converge.
    """
    triangle = facet[3] < 0
    corners = 3 if triangle else 4
    x = y = 1.0 / 3.0 if triangle else 0.5
    g = 0.0
    converged = False
    r, a, b, n = work[0], work[1], work[2], work[3]
    for iteration in range(NEWTON_STEPS):
        if curved:
            _fill_curved(polynomial, x, y, work)
            for d in range(3):
                work[0, d] -= slave[d]
        else:
            _fill_shape(triangle, x, y, shape)
            for d in range(3):
                point = along_x = along_y = normal = 0.0
                bend_x = bend_y = 0.0
                for c in range(corners):
                    node, out = current[facet[c], d], normals[c, d]
                    point += shape[0, c] * node
                    along_x += shape[1, c] * node
                    along_y += shape[2, c] * node
                    normal += shape[0, c] * out
                    bend_x += shape[1, c] * out
                    bend_y += shape[2, c] * out
                work[0, d] = point - slave[d]
                work[1, d], work[2, d], work[3, d] = along_x, along_y, normal
                work[4, d], work[5, d] = bend_x, bend_y
        if iteration == 0:
            square = product = 0.0
            for d in range(3):
                square += work[3, d] * work[3, d]
                product -= work[3, d] * work[0, d]
            g = product / square
        for d in range(3):
            work[0, d] += g * work[3, d]
            work[1, d] += g * work[4, d]
            work[2, d] += g * work[5, d]
        det = _triple(a, b, n)
        size = np.sqrt((a[0] ** 2 + a[1] ** 2 + a[2] ** 2) * (b[0] ** 2 + b[1] ** 2 + b[2] ** 2))
        if abs(det) <= 1e-10 * size:
            return False
        step_x, step_y = -_triple(r, b, n) / det, -_triple(a, r, n) / det
        g -= _triple(a, b, r) / det
        # Far outside, the facet says little about where the slave is: a limited step, then on to the neighbour.
        new_x = min(max(x + step_x, -1.0), 2.0)
        new_y = min(max(y + step_y, -1.0), 2.0)
        moved = abs(new_x - x) + abs(new_y - y)
        x, y = new_x, new_y
        converged = moved < 1e-6
        if moved < 1e-12 and iteration > 0:
            break
    local[0], local[1], local[2] = x, y, g * np.sqrt(n[0] ** 2 + n[1] ** 2 + n[2] ** 2)
    return converged


@njit(cache=True)
def _triple(a: Array, b: Array, c: Array) -> float:  # pragma: no cover - compiled
    return a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0])


@njit(cache=True)
def _beyond(triangle: bool, edge: int, x: float, y: float) -> float:  # pragma: no cover - compiled
    """How far (x, y) lies beyond an edge, in reference coordinates; negative on the facet's side."""
    if edge == 0:
        return -y
    if triangle:
        return x + y - 1.0 if edge == 1 else -x
    if edge == 1:
        return x - 1.0
    return y - 1.0 if edge == 2 else -x


@njit(cache=True)
def _fill_polynomial(
    table: Array, current: Array, nodes: IntArray, normals: Array, groups: IntArray, polynomial: Array
) -> None:  # pragma: no cover - compiled
    """Coefficients (11, 6) of X and N from those (11, 9) of the nodes (9,) of a quadratic facet."""
    polynomial[:] = 0.0
    for k in range(table.shape[0]):
        for r in range(table.shape[1]):
            weight = table[k, r]
            if weight != 0.0:
                for d in range(3):
                    polynomial[k, d] += weight * current[nodes[r], d]
                    polynomial[k, d + 3] += weight * normals[groups[r], d]


@njit(cache=True)
def _walk(
    slave: Array, sheet: Sheet, parts: Parts, facet: int, local: Array, work: tuple[Array, Array, Array, Array]
) -> tuple[int, bool]:  # pragma: no cover - compiled
    """The facet where the slave is, at the coordinates local (3,), from ``facet`` on, and whether there is one."""
    current, facets, normals, groups, neighbours, blocked = sheet
    curved, pattern, tables, elements, element_groups = parts
    shape, space, corners, polynomial = work
    came_from = -1
    for _ in range(WALK_STEPS):
        quadratic = curved[pattern[facet]]
        if quadratic:
            table = tables[pattern[facet]]
            _fill_polynomial(table, current, elements[facet], normals, element_groups[facet], polynomial)
        else:
            for c in range(4):
                corners[c] = normals[groups[facet, c]]
        if not _solve(slave, current, facets[facet], corners, quadratic, polynomial, local, shape, space):
            return facet, False
        triangle = facets[facet, 3] < 0
        leave, worst, out = -1, ROUNDING, 0.0
        for edge in range(3 if triangle else 4):
            over = _beyond(triangle, edge, local[0], local[1])
            if blocked[facet, edge]:
                out = max(out, over)
            elif over > worst:
                leave, worst = edge, over
        if leave < 0:
            return facet, out <= EDGE_TOLERANCE
        following = neighbours[facet, leave]
        if following == came_from and worst < 1e-7:
            return facet, out <= EDGE_TOLERANCE
        came_from = facet
        facet = following
    return facet, False


@njit(cache=True)
def locate_all(
    slaves: Array, sheet: Sheet, parts: Parts, starts: IntArray
) -> tuple[IntArray, Array, BoolArray]:  # pragma: no cover - compiled
    """Facet (m,), reference coordinates (m, 2) and whether it is on the surface (m,), the least gap of those found.

    sheet: positions (k, 3), facets (f, 4), smoothed normals (·, 3) and which of them (f, 4) the corners have,
    neighbours (f, 4), edges (f, 4) not walked over. parts: which patterns are of quadratic facets, the pattern (f,) of
    each, coefficients (·, 11, 9) of the patterns in `MONOMIALS`, nodes (f, 9) of the mesh's own facets and which of the
    normals (f, 9) these have. starts (m, q): facets to begin with.
    """
    count = slaves.shape[0]
    found = np.zeros(count, dtype=np.int64)
    coordinates = np.zeros((count, 2))
    inside = np.zeros(count, dtype=np.bool_)
    local, work = np.zeros(3), (np.zeros((3, 4)), np.zeros((6, 3)), np.zeros((4, 3)), np.zeros((len(MONOMIALS), 6)))
    for i in range(count):
        best = np.inf
        for j in range(starts.shape[1]):
            repeated = inside[i] and starts[i, j] == found[i]
            for earlier in range(j):
                repeated = repeated or starts[i, earlier] == starts[i, j]
            if repeated:
                continue
            facet, ended = _walk(slaves[i], sheet, parts, starts[i, j], local, work)
            if ended and abs(local[2]) < best:
                best = abs(local[2])
                inside[i] = True
                found[i] = facet
                coordinates[i, 0], coordinates[i, 1] = local[0], local[1]
    return found, coordinates, inside

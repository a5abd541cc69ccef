"""The compiled loop over cells: element matrices from shape functions and quadrature, straight into sparse storage.

Freedoms of a node stay together: a matrix is a graph of nodes with a number or a d × d block for each pair. Shape
functions and rules come from `elements`; this module knows no kinds. `first_folded` looks at the cells once; the others
trust them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..kernels import njit
from ..typing import Array, IntArray

# Volume of a cell's reference directions as mapped over that of a box with the same edges, below which it is flat.
_FLAT = 1e-10


class Cells(NamedTuple):
    """points (k, d) [m], nodes (c, n) of the cells, and a rule: weights (q,), values (q, n), gradients (q, n, d)."""

    points: Array
    nodes: IntArray
    weights: Array
    values: Array
    gradients: Array


class Graph(NamedTuple):
    """Pairs of nodes that share a cell: indptr (k + 1,), indices (pairs,), sorted within each node."""

    indptr: IntArray
    indices: IntArray


@njit(cache=True)
def node_graph(cells: IntArray, nodes: int) -> Graph:
    """The graph of `nodes` nodes by the cells (c, n)."""
    count, corners = cells.shape
    first = np.zeros(nodes + 1, dtype=np.int64)
    for e in range(count):
        for a in range(corners):
            first[cells[e, a] + 1] += 1
    first = np.cumsum(first)
    around = np.empty(count * corners, dtype=np.int32)  # the cells around each node
    filled = first[:-1].copy()
    for e in range(count):
        for a in range(corners):
            node = cells[e, a]
            around[filled[node]] = e
            filled[node] += 1
    seen = np.full(nodes, -1, dtype=np.int64)
    indptr = np.zeros(nodes + 1, dtype=np.int64)
    for node in range(nodes):
        met = 0
        for entry in range(first[node], first[node + 1]):
            for other in cells[around[entry]]:
                if seen[other] != node:
                    seen[other] = node
                    met += 1
        indptr[node + 1] = indptr[node] + met
    indices = np.empty(indptr[nodes], dtype=np.int32)
    seen[:] = -1
    for node in range(nodes):
        at = indptr[node]
        for entry in range(first[node], first[node + 1]):
            for other in cells[around[entry]]:
                if seen[other] != node:
                    seen[other] = node
                    indices[at] = other
                    at += 1
        indices[indptr[node] : at].sort()
    return Graph(indptr, indices)


@njit(cache=True)
def spread(graph: Graph, values: Array, d: int) -> tuple[IntArray, IntArray, Array]:
    """csr arrays (indptr, indices, data) with each number (pairs,) times the identity of d directions."""
    indptr, indices = graph
    nodes = len(indptr) - 1
    wide = np.zeros(d * nodes + 1, dtype=np.int64)
    columns = np.empty(d * len(indices), dtype=np.int32)
    data = np.empty(d * len(indices))
    at = 0
    for node in range(nodes):
        for i in range(d):
            for entry in range(indptr[node], indptr[node + 1]):
                columns[at] = d * indices[entry] + i
                data[at] = values[entry]
                at += 1
            wide[d * node + i + 1] = at
    return wide, columns, data


@njit(cache=True)
def _entry(graph: Graph, row: int, column: int) -> int:
    """Where the pair (row, column) is, by bisection."""
    indptr, indices = graph
    low, high = indptr[row], indptr[row + 1] - 1
    while low < high:
        middle = (low + high) // 2
        if indices[middle] < column:
            low = middle + 1
        else:
            high = middle
    return low


@njit(cache=True)
def _gather(table: Array, cell: IntArray, out: Array) -> None:
    """Rows of `table` (k, d) of the nodes of a cell, into `out` (n, d)."""
    for a in range(len(cell)):
        for i in range(table.shape[1]):
            out[a, i] = table[cell[a], i]


@njit(cache=True)
def _jacobian(corners: Array, reference: Array, jacobian: Array) -> float:
    """∂x_i/∂ξ_m into `jacobian` (d, d) from node places and reference gradients (n, d); returns its determinant, 0
    where the cell is flat."""
    n, d = corners.shape
    jacobian[:] = 0.0
    for a in range(n):
        for i in range(d):
            for m in range(d):
                jacobian[i, m] += corners[a, i] * reference[a, m]
    box = 1.0
    for m in range(d):
        length = 0.0
        for i in range(d):
            length += jacobian[i, m] ** 2
        box *= np.sqrt(length)
    j = jacobian
    if d == 2:
        determinant = j[0, 0] * j[1, 1] - j[0, 1] * j[1, 0]
    else:
        determinant = (
            j[0, 0] * (j[1, 1] * j[2, 2] - j[1, 2] * j[2, 1])
            - j[0, 1] * (j[1, 0] * j[2, 2] - j[1, 2] * j[2, 0])
            + j[0, 2] * (j[1, 0] * j[2, 1] - j[1, 1] * j[2, 0])
        )
    return determinant if abs(determinant) > _FLAT * box else 0.0


@njit(cache=True)
def _gradients(corners: Array, reference: Array, jacobian: Array, inverse: Array, out: Array) -> float:
    """∂N_a/∂x_i into `out` (n, d); returns the size of the Jacobian's determinant, which is not 0."""
    n, d = corners.shape
    determinant = _jacobian(corners, reference, jacobian)
    j = jacobian
    if d == 2:
        inverse[0, 0], inverse[0, 1] = j[1, 1] / determinant, -j[0, 1] / determinant
        inverse[1, 0], inverse[1, 1] = -j[1, 0] / determinant, j[0, 0] / determinant
    else:
        for m in range(3):
            p, q = (m + 1) % 3, (m + 2) % 3
            for i in range(3):
                r, s = (i + 1) % 3, (i + 2) % 3
                inverse[m, i] = (j[r, p] * j[s, q] - j[r, q] * j[s, p]) / determinant
    for a in range(n):
        for i in range(d):
            total = 0.0
            for m in range(d):
                total += reference[a, m] * inverse[m, i]
            out[a, i] = total
    return abs(determinant)


@njit(cache=True)
def first_folded(cells: Cells) -> int:
    """The first cell whose mapping is flat or turns over between two points of the rule, or -1.

    A cell whose nodes turn the other way round altogether is as good as any: matrices take the size of the determinant.
    """
    n, d = cells.nodes.shape[1], cells.points.shape[1]
    corners, jacobian = np.empty((n, d)), np.empty((d, d))
    for e in range(len(cells.nodes)):
        _gather(cells.points, cells.nodes[e], corners)
        first = _jacobian(corners, cells.gradients[0], jacobian)
        for q in range(len(cells.weights)):
            if not _jacobian(corners, cells.gradients[q], jacobian) * np.sign(first) > 0.0:
                return e
    return -1


@njit(cache=True)
def add_stiffness(cells: Cells, lame: float, shear: float, graph: Graph, blocks: Array) -> None:
    """Add ∫ (λ div δu div u + 2 μ δε : ε) to blocks (pairs, d, d); λ and μ [Pa] times the thickness of a plane body.

    Isotropy reduces the loop over points to the products G of all gradients: the block of nodes a and b is
    λ G[ai, bj] + μ G[aj, bi] + μ δ_ij tr G[a, b], which is ∫ BᵀDB.
    """
    n, d = cells.nodes.shape[1], cells.points.shape[1]
    corners, gradient = np.empty((n, d)), np.empty((n, d))
    flat = gradient.reshape(n * d)
    jacobian, inverse = np.empty((d, d)), np.empty((d, d))
    products = np.empty((n * d, n * d))
    for e in range(len(cells.nodes)):
        nodes = cells.nodes[e]
        _gather(cells.points, nodes, corners)
        products[:] = 0.0
        for q in range(len(cells.weights)):
            factor = cells.weights[q] * _gradients(corners, cells.gradients[q], jacobian, inverse, gradient)
            for p in range(n * d):
                scaled = factor * flat[p]
                for r in range(p, n * d):
                    products[p, r] += scaled * flat[r]
        for p in range(n * d):
            for r in range(p):
                products[p, r] = products[r, p]
        for a in range(n):
            for b in range(n):
                block = blocks[_entry(graph, nodes[a], nodes[b])]
                trace = 0.0
                for i in range(d):
                    trace += products[a * d + i, b * d + i]
                for i in range(d):
                    for j in range(d):
                        block[i, j] += lame * products[a * d + i, b * d + j] + shear * products[a * d + j, b * d + i]
                    block[i, i] += shear * trace


@njit(cache=True)
def add_mass(cells: Cells, density: float, graph: Graph, numbers: Array) -> None:
    """Add the consistent mass ρ ∫ N_a N_b, the same in each direction, to numbers (pairs,)."""
    n, d = cells.nodes.shape[1], cells.points.shape[1]
    corners, jacobian, local = np.empty((n, d)), np.empty((d, d)), np.empty((n, n))
    for e in range(len(cells.nodes)):
        _gather(cells.points, cells.nodes[e], corners)
        local[:] = 0.0
        for q in range(len(cells.weights)):
            factor = density * cells.weights[q] * abs(_jacobian(corners, cells.gradients[q], jacobian))
            for a in range(n):
                scaled = factor * cells.values[q, a]
                for b in range(a, n):
                    local[a, b] += scaled * cells.values[q, b]
        _add_numbers(local, cells.nodes[e], graph, numbers)


@njit(cache=True)
def add_lumped_mass(cells: Cells, density: float, diagonal: Array) -> None:
    """Add to diagonal (k,) the mass of each cell, divided among its nodes as the diagonal of its consistent mass
    (Hinton, Rock and Zienkiewicz 1976): positive for every kind, where row sums are not."""
    n, d = cells.nodes.shape[1], cells.points.shape[1]
    corners, jacobian, share = np.empty((n, d)), np.empty((d, d)), np.empty(n)
    for e in range(len(cells.nodes)):
        _gather(cells.points, cells.nodes[e], corners)
        share[:] = 0.0
        volume = 0.0
        for q in range(len(cells.weights)):
            factor = cells.weights[q] * abs(_jacobian(corners, cells.gradients[q], jacobian))
            volume += factor
            for a in range(n):
                share[a] += factor * cells.values[q, a] ** 2
        scale = density * volume / share.sum()
        for a in range(n):
            diagonal[cells.nodes[e, a]] += scale * share[a]


@njit(cache=True)
def add_stress_stiffness(
    cells: Cells, lame: float, shear: float, displacement: Array, graph: Graph, numbers: Array
) -> None:
    """Add ∫ ∇N_a · σ · ∇N_b, the same in each direction, to numbers (pairs,), with σ = λ tr ε + 2 μ ε of the
    displacement (k, d) [m]; λ and μ as in `add_stiffness`."""
    n, d = cells.nodes.shape[1], cells.points.shape[1]
    corners, moved, gradient, pulled = np.empty((n, d)), np.empty((n, d)), np.empty((n, d)), np.empty((n, d))
    jacobian, inverse, stress = np.empty((d, d)), np.empty((d, d)), np.empty((d, d))
    local = np.empty((n, n))
    for e in range(len(cells.nodes)):
        _gather(cells.points, cells.nodes[e], corners)
        _gather(displacement, cells.nodes[e], moved)
        local[:] = 0.0
        for q in range(len(cells.weights)):
            factor = cells.weights[q] * _gradients(corners, cells.gradients[q], jacobian, inverse, gradient)
            _stress(moved, gradient, factor * lame, factor * shear, stress)
            for a in range(n):
                for i in range(d):
                    pulled[a, i] = 0.0
                    for j in range(d):
                        pulled[a, i] += stress[i, j] * gradient[a, j]
            for a in range(n):
                for b in range(a, n):
                    for i in range(d):
                        local[a, b] += pulled[a, i] * gradient[b, i]
        _add_numbers(local, cells.nodes[e], graph, numbers)


@njit(cache=True)
def _stress(displacement: Array, gradient: Array, lame: float, shear: float, out: Array) -> None:
    """σ = λ tr ε + 2 μ ε into `out` (d, d) from displacements and gradients (n, d) of the nodes of a cell."""
    n, d = gradient.shape
    trace = 0.0
    for i in range(d):
        for j in range(d):
            doubled_strain = 0.0
            for a in range(n):
                doubled_strain += displacement[a, i] * gradient[a, j] + displacement[a, j] * gradient[a, i]
            out[i, j] = shear * doubled_strain
            if i == j:
                trace += 0.5 * doubled_strain
    for i in range(d):
        out[i, i] += lame * trace


@njit(cache=True)
def _add_numbers(local: Array, nodes: IntArray, graph: Graph, numbers: Array) -> None:
    """Add a cell's matrix (n, n), of which the upper triangle is given, to numbers (pairs,)."""
    for a in range(len(nodes)):
        for b in range(len(nodes)):
            numbers[_entry(graph, nodes[a], nodes[b])] += local[min(a, b), max(a, b)]

"""Symmetric matrices of many freedoms in the form that the time loop streams.

The step is bound by memory: what counts is bytes per freedom. Only the upper triangle is kept, in square blocks of one,
two or three freedoms, so that one index serves up to nine numbers. On a hex8 mesh of 107 811 freedoms (2 cores) a
step took 0.9 to 1.1 ms in 3×3 upper blocks on two threads (`lanes`), a product 4.7 ms as full scalar CSR of SciPy and
4.5 ms as upper scalar CSR: scalar rows read more indices and gather number by number.

Freedoms are grouped into blocks node by node as far as the bodies tell their nodes, the rest in order of their
numbers. A node that a support holds in part fills its block with entries that have no stiffness: they stay at zero.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from ....system import System
from ....typing import Array, IntArray, Sparse
from ...aligned import aligned_zeros
from .lanes import LANES

THREADED_FREEDOMS = 20_000
LARGEST_BLOCK = 3


class Blocks(NamedTuple):
    """Upper triangle in blocks: row pointers (b + 1,), block columns (z,) ascending, the diagonal first and always
    there, values (z + 1, w²) row by row, the last row zero: whole registers are read (`lanes`)."""

    ptr: IntArray
    col: IntArray
    val: Array


@dataclass(frozen=True)
class Layout:
    """Where the freedoms lie: block width w, number of blocks b, index (n,) of each freedom; from one block to the next
    there are LANES[w] entries."""

    width: int
    blocks: int
    index: IntArray

    @property
    def stride(self) -> int:
        """Entries from one block to the next, w or what fills a vector register."""
        return LANES[self.width]

    @property
    def size(self) -> int:
        """Number of entries, those without a freedom included."""
        return self.stride * self.blocks

    def spread(self, values: Array) -> Array:
        """Values (…, n) of freedoms on all entries (…, size), zero where there is none."""
        out = aligned_zeros((*values.shape[:-1], self.size))
        out[..., self.index] = values
        return out

    def rows(self, matrix: Sparse) -> Sparse:
        """Rows (r, n) on freedoms as rows (r, size) csr on entries."""
        coo = sp.coo_array(matrix)
        return sp.csr_array((coo.data, (coo.row, self.index[coo.col])), shape=(matrix.shape[0], self.size))


def lay_out_freedoms(system: System, *, width: int = 0) -> Layout:
    """Group the freedoms into blocks, the blocks in an order that keeps coupled ones close (reverse Cuthill–McKee).
    width: that of blocks where no nodes are told, 0 for that which streams the fewest bytes."""
    pattern = sp.csr_array(abs(system.stiffness) + abs(system.damping) + abs(system.mass))
    if not system.symmetric_definite:
        pattern = sp.csr_array(pattern + pattern.T)
    group, inside, width = _groups(system, pattern, width)
    count = int(group.max()) + 1
    coo = sp.coo_array(pattern)
    graph = sp.csr_matrix((np.ones(coo.nnz), (group[coo.row], group[coo.col])), shape=(count, count))
    order = sp.csgraph.reverse_cuthill_mckee(graph, symmetric_mode=True)
    rank = np.empty(count, dtype=np.int64)
    rank[order] = np.arange(count)
    return Layout(width, count, rank[group] * LANES[width] + inside)


def _groups(system: System, pattern: Sparse, wanted: int = 0) -> tuple[IntArray, IntArray, int]:
    """Block (n,) of each freedom, place within it (n,), and the width: nodes of the bodies, else consecutive ones."""
    group, inside = np.full(system.size, -1), np.zeros(system.size, dtype=np.int64)
    count = 0
    width = 0
    for solid in system.solids:
        d = solid.points.shape[1]
        coo = sp.coo_array(solid.rows.free)
        lone = (np.bincount(coo.row, minlength=solid.rows.free.shape[0])[coo.row] == 1) & (coo.data == 1.0)
        row, column = coo.row[lone], coo.col[lone]
        new = group[column] < 0
        row, column = row[new], column[new]
        nodes, index = np.unique(row // d, return_inverse=True)
        group[column], inside[column] = count + index, row % d
        count += len(nodes)
        width = max(width, d)
    rest = np.flatnonzero(group < 0)
    if not width:
        width = wanted or _cheapest_width(pattern)
    group[rest] = count + np.arange(len(rest)) // width
    inside[rest] = np.arange(len(rest)) % width
    return group.astype(np.int64), inside, width


def _cheapest_width(pattern: Sparse) -> int:
    """Width of blocks of consecutive freedoms that streams the fewest bytes."""
    coo = sp.coo_array(pattern)
    upper = coo.row <= coo.col
    cost: list[float] = []
    for width in range(1, LARGEST_BLOCK + 1):
        size = -(-pattern.shape[0] // width)
        met = np.unique(coo.row[upper].astype(np.int64) // width * size + coo.col[upper] // width)
        cost.append(len(met) * (8.0 * width**2 + 4.0))
    return int(np.argmin(cost)) + 1


def upper_blocks(matrix: Sparse, layout: Layout) -> Blocks:
    """A symmetric matrix (n, n) on the entries of a layout."""
    coo = sp.coo_array(matrix)
    w, b = layout.width, layout.blocks
    step = layout.stride
    row, column = layout.index[coo.row], layout.index[coo.col]
    keep = row // step <= column // step
    row, column, value = row[keep], column[keep], coo.data[keep]
    # The diagonal blocks always: their place is known without looking.
    every = np.arange(b) * (b + 1)
    key, index = np.unique(np.concatenate([every, row // step * b + column // step]), return_inverse=True)
    val = aligned_zeros((len(key) + 1, w * w))
    np.add.at(val, (index[b:], row % step * w + column % step), value)
    ptr = np.concatenate([[0], np.cumsum(np.bincount(key // b, minlength=b))])
    return Blocks(ptr.astype(np.int64), (key % b).astype(np.int32), val)


def parts(matrices: list[Blocks], size: int) -> IntArray:
    """(first row of the second part, first row that no row of the first part reaches), in blocks, for two threads; the
    number of blocks twice for one. Fixed by the model alone, so that results do not depend on the machine."""
    ptr, blocks = matrices[0].ptr, len(matrices[0].ptr) - 1
    if size < THREADED_FREEDOMS:
        return np.array([blocks, blocks], dtype=np.int64)
    cut = int(np.searchsorted(ptr, ptr[-1] / 2))
    reach = max(int(m.col[: m.ptr[cut]].max(initial=-1)) + 1 for m in matrices)
    return np.array([cut, min(max(reach, cut), blocks)], dtype=np.int64)

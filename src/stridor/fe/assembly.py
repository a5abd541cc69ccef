"""Element matrices to sparse body matrices, and bodies to one structure."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp

from ..typing import Array, IntArray, Sparse
from .beam import DOF_PER_NODE, BeamMesh


def assemble_beam(mesh: BeamMesh, *, lumped: bool = False) -> tuple[Sparse, Sparse]:
    """Mass and stiffness (csr, 3 freedoms per node) of a free beam.

    Exact zeros are dropped, so that a beam along an axis keeps traction and bending apart.
    """
    size = DOF_PER_NODE * (mesh.elements + 1)
    dof = DOF_PER_NODE * np.arange(mesh.elements)[:, None] + np.arange(6)
    rows = np.repeat(dof, 6, axis=1).ravel()
    columns = np.tile(dof, (1, 6)).ravel()
    return (
        _scatter(mesh.element.mass(lumped=lumped), rows, columns, mesh.elements, size),
        _scatter(mesh.element.stiffness(), rows, columns, mesh.elements, size),
    )


def _scatter(element: Array, rows: IntArray, columns: IntArray, elements: int, size: int) -> Sparse:
    values = np.tile(element.ravel(), elements)
    matrix = sp.coo_array((values, (rows, columns)), shape=(size, size)).tocsr()
    matrix.eliminate_zeros()
    return matrix


def beside(matrices: Sequence[Sparse]) -> Sparse:
    """One matrix (N, N) csr with square ones on its diagonal, entries of each row in order."""
    parts = [sp.csr_array(m) for m in matrices]
    sizes, counts = (np.cumsum([0, *of]) for of in ([m.shape[0] for m in parts], [m.nnz for m in parts]))
    short = np.int32 if max(sizes[-1], counts[-1]) <= np.iinfo(np.int32).max else np.int64
    columns = [m.indices.astype(short) + short(n) for m, n in zip(parts, sizes[:-1], strict=True)]
    ends = [m.indptr[1:] + count for m, count in zip(parts, counts[:-1], strict=True)]
    joined = sp.csr_array(
        (np.concatenate([m.data for m in parts]), np.concatenate(columns), np.concatenate([[0], *ends]).astype(short)),
        shape=(int(sizes[-1]), int(sizes[-1])),
    )
    joined.sum_duplicates()
    return joined


def plus(first: Sparse, second: Sparse) -> Sparse:
    """A + B (n, n) csr; where both have entries at the same places, which damping shares with stiffness, at the cost of
    adding these."""
    if not shaped_alike(first, second):
        return sp.csr_array(first + second)
    return sp.csr_array((first.data + second.data, first.indices.copy(), first.indptr.copy()), shape=first.shape)


def shaped_alike(first: Sparse, second: Sparse) -> bool:
    """Whether two csr matrices have entries at the same places, in the same order."""
    return np.array_equal(first.indptr, second.indptr) and np.array_equal(first.indices, second.indices)


def connected_components(*matrices: Sparse) -> list[IntArray]:
    """Index sets of freedoms that the matrices together leave uncoupled, each sorted."""
    # Neither signs nor values matter, so no sum is needed where one pattern, without stored zeros, is that of all.
    first, *others = matrices
    alike = bool(np.all(first.data)) and all(shaped_alike(first, m) for m in others)
    pattern = first if alike else sum(abs(m) for m in matrices)
    count, label = sp.csgraph.connected_components(pattern, directed=False)
    order = np.argsort(label, kind="stable")
    edges = np.searchsorted(label[order], np.arange(count + 1))
    return [order[edges[i] : edges[i + 1]] for i in range(count)]

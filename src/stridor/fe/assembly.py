"""Element matrices to sparse body matrices, and bodies to one structure."""

from __future__ import annotations

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


def connected_components(*matrices: Sparse) -> list[IntArray]:
    """Index sets of freedoms that the matrices together leave uncoupled, each sorted."""
    pattern = sum(abs(m) for m in matrices)
    count, label = sp.csgraph.connected_components(pattern, directed=False)
    order = np.argsort(label, kind="stable")
    edges = np.searchsorted(label[order], np.arange(count + 1))
    return [order[edges[i] : edges[i + 1]] for i in range(count)]

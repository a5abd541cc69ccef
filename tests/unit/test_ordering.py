"""Nested dissection: an order of all unknowns that fills factors less, and nothing that depends on its being there."""

from __future__ import annotations

import importlib

import numpy as np
import pytest
import scipy.sparse as sp
import scipy.sparse.linalg as spl

from stridor.direct import factorise, ordering
from stridor.direct.ordering import WORTHWHILE, nested_dissection

metis = pytest.mark.skipif(
    nested_dissection(sp.eye_array(WORTHWHILE)) is None, reason="METIS has no wheel for this system"
)


def block(n: int, freedoms: int = 3) -> sp.csr_array:
    """n³ nodes coupled to all 26 around them, as hexahedra do, some freedoms each."""
    line = sp.diags_array([np.full(n - 1, 1.0), np.full(n, 4.0), np.full(n - 1, 1.0)], offsets=[-1, 0, 1])
    return sp.csr_array(sp.kron(sp.kron(line, line), sp.kron(line, np.eye(freedoms) + 0.1)))


@metis
def test_factors_fill_less_than_by_minimum_degree():
    matrix = block(16)
    order = nested_dissection(matrix)
    assert order is not None
    assert np.array_equal(np.sort(order), np.arange(matrix.shape[0]))
    assert order.reshape(-1, 3).max(axis=1).tolist() == (order.reshape(-1, 3).min(axis=1) + 2).tolist()  # of one node
    options = {"SymmetricMode": True}
    theirs = spl.splu(sp.csc_matrix(matrix), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
    permuted = sp.csc_matrix(matrix[order][:, order])
    ours = spl.splu(permuted, permc_spec="NATURAL", diag_pivot_thresh=0.0, options=options)
    assert ours.nnz < 0.9 * theirs.nnz, (ours.nnz, theirs.nnz)


@metis
@pytest.mark.parametrize("kind", ["diagonal", "two parts", "one row full", "not symmetric"])
def test_any_pattern_is_solved(kind: str):
    n, random = WORTHWHILE + 7, np.random.default_rng(1)
    sparse = sp.random_array((n, n), density=2 / n, rng=random) + sp.diags_array(np.full(n, 4.0))
    matrix = {
        "diagonal": lambda: sp.diags_array(random.uniform(1, 2, n)),
        "two parts": lambda: sp.block_diag([block(10), block(11)]),
        "one row full": lambda: sparse + sp.csr_array((np.ones(n), (np.zeros(n, int), np.arange(n))), shape=(n, n)),
        "not symmetric": lambda: sparse,
    }[kind]()
    matrix = sp.csr_array(matrix)
    right = random.standard_normal(matrix.shape[0])
    for transpose in (False, True):
        found = factorise(matrix, solver="superlu").solve(right, transpose=transpose)
        assert np.abs((matrix.T if transpose else matrix) @ found - right).max() < 1e-9


@metis
def test_a_pattern_is_ordered_once(monkeypatch: pytest.MonkeyPatch):
    matrix = block(13)
    first = nested_dissection(matrix)
    monkeypatch.setattr(ordering, "_ordered", lambda *_: pytest.fail("ordered again"))
    assert nested_dissection(sp.csr_array(2 * matrix)) is first
    with pytest.raises(pytest.fail.Exception):
        nested_dissection(block(14))


def test_without_metis_superlu_orders_itself(monkeypatch: pytest.MonkeyPatch):
    def missing(name: str) -> object:
        raise ImportError(name)

    monkeypatch.setattr(ordering, "import_module", missing)
    assert importlib.import_module is not ordering.import_module
    matrix = block(13)
    assert nested_dissection(matrix) is None
    right = np.ones(matrix.shape[0])
    assert matrix @ factorise(matrix, solver="superlu").solve(right) == pytest.approx(right, rel=1e-12)


def test_small_matrices_are_left_to_superlu():
    assert nested_dissection(sp.eye_array(WORTHWHILE - 1)) is None

"""The order of elimination that fills factors least: nested dissection by METIS, where it is installed.

Beside minimum degree, which SciPy brings, factors of thick meshes are smaller: 0.78 of the entries for a block of
24 000 freedoms, 0.59 and less than a third of the time for a brake disc with its pad, 52 000 freedoms; of thin regular
plates they are about the same.
"""

from __future__ import annotations

import hashlib
from collections import OrderedDict
from importlib import import_module
from typing import Any

import numpy as np
import scipy.sparse as sp

from ..typing import IntArray, Sparse

WORTHWHILE = 5000  # unknowns below which dissecting takes longer than it saves
REMEMBERED = 6  # patterns: of one analysis, which factorises each many times

_known: OrderedDict[bytes, IntArray] = OrderedDict()


def nested_dissection(matrix: Sparse) -> IntArray | None:
    """Unknowns (n,) of A, in the order of elimination for the pattern of A + Aᵀ; None for small ones and without METIS.

    Unknowns with the same neighbours, as those of a node are, stay together.
    """
    n = matrix.shape[0]
    if n < WORTHWHILE:
        return None
    try:
        metis: Any = import_module("pymetis")
    except ImportError:
        return None
    csc = sp.csc_array(matrix)
    mark = hashlib.blake2b(csc.indptr.tobytes(), digest_size=16)
    mark.update(csc.indices.tobytes())
    key = mark.digest()
    if key in _known:
        _known.move_to_end(key)
        return _known[key]
    order = _ordered(csc, metis)
    _known[key] = order
    if len(_known) > REMEMBERED:
        _known.popitem(last=False)
    return order


def _ordered(matrix: Sparse, metis: Any) -> IntArray:
    n = matrix.shape[0]
    pattern = sp.csr_array((np.ones(matrix.nnz), matrix.indices, matrix.indptr), shape=matrix.shape)
    pattern = sp.csr_array(pattern + pattern.T + sp.eye_array(n))
    pattern.data[:] = 1.0
    group = _alike(pattern)
    count = int(group.max()) + 1
    gather = sp.csr_array((np.ones(n), (group, np.arange(n))), shape=(count, n))
    graph = sp.csr_array(gather @ pattern @ gather.T)
    graph.setdiag(0)
    graph.eliminate_zeros()
    if not graph.nnz:  # nothing is coupled, or all with all: any order will do
        return np.argsort(group, kind="stable")
    adjacency = metis.CSRAdjacency(adj_starts=graph.indptr.astype(np.int32), adjacent=graph.indices.astype(np.int32))
    new_to_old, _ = metis.nested_dissection(adjacency)
    rank = np.empty(count, dtype=np.int64)
    rank[np.asarray(new_to_old)] = np.arange(count)
    return np.argsort(rank[group], kind="stable")


def _alike(pattern: Sparse) -> IntArray:
    """Numbers (n,) of groups of unknowns with the same neighbours, themselves among them: told by random sums."""
    weight = np.random.default_rng(5).integers(1, 2**52, pattern.shape[0]).astype(float)
    sums = pattern @ (weight / 2**52)
    # The same neighbours are summed in the same order, so that equal sets have equal sums to the last bit.
    return np.unique(sums, return_inverse=True)[1].ravel()

"""Slave nodes of ties that a support holds: their leaders are held by that, as if slave and master were exchanged.

What a support prescribes for a slave, u_f, is an equation for its leaders, u_f = Σ c u. As many of these as the
equations can tell are eliminated, u_l = (u_f − Σ c u) / c_l in the simplest case, and the slave becomes a freedom of
its support again. The equations are told apart by a QR decomposition with pivoting for all that share leaders.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import scipy.linalg as sl
import scipy.sparse as sp

from ..errors import CaseError
from ..typing import Array, BoolArray, IntArray, Sparse

# What of an equation is not yet told by the others, of weights that add up to one: less is rounding of mesh files.
TELLING = 1e-3
# Difference of prescribed motions, of the largest: more is a contradiction.
AGREE = 1e-6
LARGEST = 50_000_000


def led_by_supports(
    transformation: Sparse, tied: IntArray, held: BoolArray, prescribed: Array, names: Mapping[int, str]
) -> tuple[Sparse, IntArray]:
    """T (N, N) csr and the freedoms (f,) that follow, of ties that are T with tied (t,), where supports hold (N,).

    prescribed (N, p): the motions of held freedoms; names: the paths of their supports. Raises CaseError where supports
    prescribe what the leaders of a slave cannot follow.
    """
    slaves = np.asarray(tied)[held[tied]]
    if not len(slaves):
        return transformation, tied
    rows = sp.csr_array(transformation[slaves])
    by_held = sp.csr_array(rows @ sp.diags_array(held.astype(float)))
    by_free = sp.csr_array(rows - by_held)
    by_free.eliminate_zeros()
    missing = prescribed[slaves] - by_held @ prescribed
    size = np.abs(prescribed).max(initial=0.0, axis=0)
    telling = np.diff(by_free.indptr) > 0
    _check_agree(slaves[~telling], missing[~telling], size, names)
    if not telling.any():
        return transformation, tied
    led, entries = [], []
    for lines, leaders in _components(by_free, np.flatnonzero(telling)):
        if len(lines) * len(leaders) > LARGEST:
            accepted = (
                f"holds {len(lines)} slave freedoms of a tie whose {len(leaders)} leaders are too many to be held by "
                "them; exchange slave and master of the tie, or support the master's body instead"
            )
            raise CaseError(names[int(slaves[lines[0]])], None, accepted)
        block = sp.csr_array(by_free[lines][:, leaders]).toarray()
        q, r, order = sl.qr(block, pivoting=True)
        rank = int(np.sum(np.abs(np.diag(r)) > TELLING))
        left = q[:, rank:].T @ missing[lines]
        if np.any(np.abs(left) > AGREE * size * np.sqrt(len(lines))):
            worst = int(np.argmax(np.abs(q[:, rank:] @ left).max(axis=1)))
            _check_agree(slaves[lines[[worst]]], np.full((1, len(size)), np.inf), size, names)
        if not rank:
            continue
        pivots, rest = leaders[order[:rank]], leaders[order[rank:]]
        inverse = sl.solve_triangular(r[:rank, :rank], q[:, :rank].T)
        others = -sl.solve_triangular(r[:rank, :rank], r[:rank, rank:])
        through = sp.coo_array(-(inverse @ by_held[lines]))
        led.append(pivots)
        entries.append(_dense_entries(inverse, pivots, slaves[lines]))
        entries.append(_dense_entries(others, pivots, rest))
        entries.append((pivots[through.row], through.col, through.data))
    eliminated = np.concatenate([np.zeros(0, dtype=np.int64), *led])
    total = transformation.shape[0]
    # Slaves in the equations are freedoms of their supports again; those that leaders lead to follow on.
    own = np.ones(total)
    own[eliminated] = 0.0
    free_slaves = slaves[telling]
    keep = np.ones(total)
    keep[free_slaves] = 0.0
    unit = sp.csr_array((np.ones(len(free_slaves)), (free_slaves, free_slaves)), shape=(total, total))
    row, column, value = (np.concatenate(part) for part in zip(*entries, strict=True)) if entries else ([], [], [])
    step = sp.csr_array(sp.diags_array(own) + sp.csr_array((value, (row, column)), shape=(total, total)))
    found = sp.csr_array((sp.diags_array(keep) @ transformation + unit) @ step)
    found.data[np.abs(found.data) < 1e-12] = 0.0
    found.eliminate_zeros()
    if total <= np.iinfo(np.int32).max:
        found.indices, found.indptr = found.indices.astype(np.int32), found.indptr.astype(np.int32)
    return found, np.union1d(np.setdiff1d(tied, free_slaves), eliminated)


def _dense_entries(block: Array, rows: IntArray, columns: IntArray) -> tuple[IntArray, IntArray, Array]:
    row, column = np.nonzero(np.abs(block) > 1e-13)
    return rows[row], columns[column], block[row, column]


def _components(matrix: Sparse, lines: IntArray) -> list[tuple[IntArray, IntArray]]:
    """Rows and columns of blocks of the given rows that share no columns."""
    part = sp.csr_array(matrix[lines])
    columns = np.unique(part.indices)
    coo = sp.coo_array(part)
    place = np.searchsorted(columns, coo.col)
    count = len(lines) + len(columns)
    graph = sp.csr_array((np.ones(len(place)), (coo.row, len(lines) + place)), shape=(count, count))
    number, label = sp.csgraph.connected_components(graph, directed=False)
    order = np.argsort(label, kind="stable")
    edges = np.searchsorted(label[order], np.arange(number + 1))
    found: list[tuple[IntArray, IntArray]] = []
    for i in range(number):
        member = order[edges[i] : edges[i + 1]]
        found.append((lines[member[member < len(lines)]], columns[member[member >= len(lines)] - len(lines)]))
    return found


def _check_agree(slaves: IntArray, missing: Array, size: Array, names: Mapping[int, str]) -> None:
    off = np.any(np.abs(missing) > AGREE * size, axis=1)
    if off.any():
        name = names[int(slaves[int(np.argmax(off))])]
        accepted = (
            "prescribes motions of slave nodes of a tie that their leaders cannot follow, held otherwise or fewer than "
            "those; exchange slave and master of the tie, or support the master's body instead"
        )
        raise CaseError(name, None, accepted)

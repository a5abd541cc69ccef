"""Contact nodes packed for the compiled loop: rows on the few freedoms that contacts touch, and their compliances."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from ....contact.interface import Contact
from ....contact.nodes import ContactNodes
from ....laws.friction import friction_rows
from ....typing import Array, BoolArray, IntArray, Sparse
from ..curve import ROWS, nodes_of
from .bends import Bends, Turning, bends_of
from .storage import Layout

# What unit forces along rows (r, size) csr on entries move over one step: rows (r, size) [m/N], csr.
Answers = Callable[[Sparse], Sparse]


class Curves(NamedTuple):
    """k nodes that slide finitely on the curve of their master: node (k,) their places in the table, and of each the
    ten rows of `curve` about its segment: base (k, l, 10) on the entries that contacts touch, and base_push (k, l, 10)
    what unit forces along them move there; block (k, 10, 10) [m/N] of the rows among themselves, lift (k, 10, p),
    reference (k, 10) positions [m]; chords of all, those of curve k from chords_at[k] on; side (k,)."""

    node: IntArray
    base: Array
    base_push: Array
    block: Array
    lift: Array
    reference: Array
    chords_at: IntArray
    chords: Array
    side: Array


class NodeTable(NamedTuple):
    """m nodes, d directions (normal, then tangents), l entries that any of them touches, c contacts, p motions.

    indices (l,) among all entries. Node i has entries ptr[i] … ptr[i+1]: col into indices and row (entries, d); and
    push_ptr, push_col, push (entries, d) [m/N]: how its forces move entries over one step. lift (m, d, p), gap (m,)
    [m], compliance (m,) [m/N], cubic (m,) [N/m³], block (m, d, d) [m/N] of its rows and pushes. Where forces move more
    than what contacts touch (`step_matrix`): answers (r, size) [m/N] of all entries to unit forces along r rows, of
    node i those from act_at[i] on, which it pushes with the weights act (r, d). owner (m,), friction (c, k) numbers of
    the laws, along (m, d−1) the direction in which a contact's tangential motion is told, weight (m,) for means without
    force; kept (m,) 1 where a node is kept closed.
    """

    indices: IntArray
    ptr: IntArray
    col: IntArray
    row: Array
    push_ptr: IntArray
    push_col: IntArray
    push: Array
    lift: Array
    gap: Array
    compliance: Array
    cubic: Array
    block: Array
    act_at: IntArray
    act: Array
    answers: Array
    owner: IntArray
    friction: Array
    along: Array
    weight: Array
    kept: IntArray
    curves: Curves
    bends: Bends


class _Rows(NamedTuple):
    """Rows on entries in some order, and of each its node and its place among those of the node."""

    matrix: Sparse
    node: IntArray
    place: IntArray


def node_table(
    nodes: ContactNodes, layout: Layout, answers: Answers, factors: Array, *,
    whole: bool = False, contacts: Sequence[Contact] = (), segments: IntArray | None = None,
    turning: Turning | None = None,
) -> NodeTable:  # fmt: skip
    """Pack nodes. factors (p,) are those of the motions at full velocity; whole: forces move more than contacts touch;
    contacts: the point contacts, the first of the nodes, and segments (c,) that those which slide finitely are in;
    turning: how the normals of the others turn as they slide."""
    turning = Turning.none(nodes) if turning is None else turning
    m, t = nodes.count, nodes.directions
    d, tilting = t + 1, turning.tilting
    w = d + t if tilting.any() else d
    finite = [k for k, contact in enumerate(contacts) if contact.sliding == "finite"]
    on_curves: BoolArray = np.isin(np.arange(m), finite)
    fixed = _fixed_rows(nodes, layout, on_curves, turning)
    base = _base_rows(contacts, layout, finite, segments)
    fixed_answers, base_answers = (_without_zeros(answers(each.matrix)) for each in (fixed, base))
    touched = [sp.coo_array(each).col for each in (fixed.matrix, base.matrix)]
    index = np.unique(np.concatenate(touched)).astype(np.int64)
    ptr, col, row = _by_node(m, w, index, (fixed.matrix, base.matrix), fixed, base)
    push_ptr, push_col, push = _by_node(m, w, index, (fixed_answers, base_answers), fixed, base)
    block, row_of = np.zeros((m, w, w)), np.full((m, w), -1)
    row_of[fixed.node, fixed.place] = np.arange(len(fixed.node))
    rows, moved = (sp.csr_array(each)[:, index] for each in (fixed.matrix, fixed_answers))
    for j in range(w):
        both = (row_of[:, [j]] >= 0) & (row_of >= 0)  # rows of a tilt belong to some nodes only
        one, other = np.broadcast_to(row_of[:, [j]], row_of.shape)[both], row_of[both]
        block[:, j][both] = np.asarray(rows[one].multiply(moved[other]).sum(axis=1)).ravel()
    p = nodes.normal_lift.shape[1]
    lift = np.zeros((m, w, p))
    lift[:, 0] = nodes.normal_lift
    lift[:, 1:d] = nodes.tangent_lift.reshape(m, t, p)
    lift[:, d:] = turning.tilt_lift.reshape(m, t, p)[:, : w - d]
    act, dense, acting = np.zeros((0, d)), np.zeros((0, layout.size)), np.zeros(m)
    if whole:
        order = np.argsort(np.concatenate([fixed.node, base.node]), kind="stable")
        act = np.concatenate([np.eye(w, d)[fixed.place], np.zeros((len(base.node), d))])[order]
        dense = sp.csr_array(sp.vstack([fixed_answers, base_answers])).toarray()[order]
        acting = np.where(on_curves, ROWS, np.where(tilting, w, d))
    gap = np.array(nodes.gap, dtype=float)
    return NodeTable(
        indices=index,
        ptr=ptr,
        col=col,
        row=row[:, :d].copy(),
        push_ptr=push_ptr,
        push_col=push_col,
        push=push[:, :d].copy(),
        lift=lift[:, :d].copy(),
        gap=gap,
        compliance=np.array(nodes.compliance, dtype=float),
        cubic=np.array(nodes.cubic, dtype=float),
        block=block[:, :d, :d].copy(),
        act_at=np.concatenate([[0], np.cumsum(acting)]).astype(np.int64),
        act=act,
        answers=dense,
        owner=np.array(nodes.owner, dtype=np.int64),
        friction=friction_rows(nodes.laws),
        along=sliding_directions(nodes, factors),
        weight=np.where(np.isnan(nodes.area), 1.0, nodes.area),
        kept=nodes.kept.astype(np.int64),
        curves=_curves(
            contacts, finite, segments, base.matrix[:, index].toarray(), base_answers[:, index].toarray(), p
        ),
        bends=bends_of(turning, row, push, lift, gap, block),
    )


def _fixed_rows(nodes: ContactNodes, layout: Layout, on_curves: BoolArray, turning: Turning) -> _Rows:
    """Normal and tangents of the nodes that are on no curve, and of those whose master can tilt the rows of its tilt,
    direction by direction."""
    still, t = np.flatnonzero(~on_curves), nodes.directions
    tilting = np.flatnonzero(turning.tilting)
    normal, tangent, tilt = (layout.rows(each) for each in (nodes.normal, nodes.tangent, turning.tilt))
    parts = [normal[still], *(tangent[still * t + k] for k in range(t)), *(tilt[tilting * t + k] for k in range(t))]
    return _Rows(
        _without_zeros(sp.vstack(parts)),
        np.concatenate([np.tile(still, t + 1), np.tile(tilting, t)]),
        np.concatenate([np.repeat(np.arange(t + 1), len(still)), np.repeat(np.arange(t + 1, 2 * t + 1), len(tilting))]),
    )


def _base_rows(contacts: Sequence[Contact], layout: Layout, finite: Sequence[int], segments: IntArray | None) -> _Rows:
    """Ten rows of each point that slides finitely; those of nodes beyond the ends of its master are zero."""
    empty = sp.csr_array((0, layout.size))
    parts = [empty, *(layout.rows(_ten_rows(contacts[c], int(segments[c]))) for c in finite if segments is not None)]
    return _Rows(
        _without_zeros(sp.vstack(parts)), np.repeat(np.array(finite, dtype=np.int64), ROWS),
        np.tile(np.arange(ROWS), len(finite)),
    )  # fmt: skip


def _without_zeros(matrix: Sparse) -> Sparse:
    rows = sp.csr_array(matrix)
    rows.eliminate_zeros()
    return rows


def _ten_rows(contact: Contact, segment: int) -> Sparse:
    slave, master = sp.csr_array(contact.slave.free), sp.csr_array(contact.master.free)
    nothing = sp.csr_array((2, slave.shape[1]))
    nodes = nodes_of(segment, len(contact.master_positions))
    return sp.csr_array(sp.vstack([slave, *(master[2 * n : 2 * n + 2] if n >= 0 else nothing for n in nodes)]))


def _by_node(
    m: int, d: int, index: IntArray, matrices: tuple[Sparse, Sparse], fixed: _Rows, base: _Rows
) -> tuple[IntArray, IntArray, Array]:
    """Entries of the nodes among ``index``, where each begins, and the values (entries, d) of rows that stay."""
    node, place, col, value = ([] for _ in range(4))
    for matrix, rows in zip(matrices, (fixed, base), strict=True):
        coo = sp.coo_array(sp.csr_array(matrix)[:, index])
        node.append(rows.node[coo.row])
        place.append(rows.place[coo.row] if rows is fixed else np.zeros(coo.nnz, dtype=np.int64))
        col.append(coo.col)
        value.append(coo.data if rows is fixed else np.zeros(coo.nnz))
    own = np.concatenate(node) * max(len(index), 1) + np.concatenate(col)
    key, entry = np.unique(own, return_inverse=True)
    out = np.zeros((len(key), d))
    np.add.at(out, (entry, np.concatenate(place)), np.concatenate(value))
    owner = key // max(len(index), 1)
    return np.searchsorted(owner, np.arange(m + 1)).astype(np.int64), (key % max(len(index), 1)).astype(np.int64), out


def _curves(
    contacts: Sequence[Contact], finite: Sequence[int], segments: IntArray | None, base: Array, base_push: Array, p: int
) -> Curves:
    """What the rows of points that slide finitely are made of in each step; base, base_push (10k, l)."""
    count = len(finite)
    lift, reference = np.zeros((count, ROWS, p)), np.zeros((count, ROWS))
    for k, c in enumerate(finite):
        assert segments is not None
        contact = contacts[c]
        lift[k, :2], reference[k, :2] = contact.slave.lift, contact.slave_position
        for place, node in enumerate(nodes_of(int(segments[c]), len(contact.master_positions))):
            if node >= 0:
                at = slice(2 + 2 * place, 4 + 2 * place)
                lift[k, at] = contact.master.lift[2 * node : 2 * node + 2]
                reference[k, at] = contact.master_positions[node]
    chords = [contacts[c].chords for c in finite]
    base, base_push = (each.reshape(count, ROWS, base.shape[1]) for each in (base, base_push))
    return Curves(
        node=np.array(finite, dtype=np.int64),
        base=np.ascontiguousarray(base.transpose(0, 2, 1)),
        base_push=np.ascontiguousarray(base_push.transpose(0, 2, 1)),
        block=base @ base_push.transpose(0, 2, 1),
        lift=lift,
        reference=reference,
        chords_at=np.concatenate([[0], np.cumsum([len(x) for x in chords])]).astype(np.int64),
        chords=np.concatenate([np.zeros(0), *chords]),
        side=np.array([float(contacts[c].side) for c in finite]),
    )


def sliding_directions(nodes: ContactNodes, factors: Array) -> Array:
    """Unit directions (m, d−1) along the tangents in which a contact's slip is told: that in which the supports slide
    it, the first tangent where they do not and for point contacts."""
    along = np.zeros((nodes.count, nodes.directions))
    along[:, 0] = 1.0
    slip = nodes.slip_velocity(factors)
    speed = np.linalg.norm(slip, axis=1)
    slides: BoolArray = (speed > 1e-12 * speed.max(initial=1e-300)) & ~np.isnan(nodes.area)
    along[slides] = slip[slides] / speed[slides][:, None]
    return along

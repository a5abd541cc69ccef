"""Ties between meshes that do not match, weighted over the slave's facets with the dual functions of `coupling`.

A slave node that follows the point of the master below it passes no constant stress where the meshes differ. With
multipliers ψ_i biorthogonal to the slave's functions of positive integrals, ∫ ψ_i φ̃_k = δ_ik ∫ φ̃_i, the bond
∫ ψ_i (u_s − u_m) = 0 gives ũ_i = Σ_l (∫ ψ_i φ_l dA / A_i) u_l, node by node, and both bodies the consistent forces of
a uniform traction. Nodes that a support holds or that are slaves of another tie, too, have no multiplier: they follow
the point below them, and their function goes to the others of each facet, so that Σ ψ_i = 1 still (the corners of
Wohlmuth, SIAM J. Numer. Anal. 38, 2000, 989). So do nodes of facets that the master does not cover.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from ..mesh.facets import facet_integrals, shape_functions
from ..mesh.model import Blocks
from ..mesh.positive_basis import MIDDLES, changed_basis
from ..typing import Array, BoolArray, IntArray, Sparse
from .coupling import TOGETHER, stretch, total_of
from .curve import Curve
from .facets import FacetSurface
from .interpolation import element_weights
from .pieces import outlines, pieces
from .ties import NodeTies

ONE = 1e-6  # of a weight of one: the slave node is a node of the master
COVERED = 0.99
NOTHING = 1e-11


@dataclass(frozen=True)
class Bonded:
    """Ties of s slave nodes, and how many follow the point below them only because their facets are not covered."""

    tie: NodeTies
    uncovered: int = 0


def weighted(
    tie: NodeTies, points: Array, facets: Blocks, master: Curve | FacetSurface, alone: BoolArray, tolerance: float
) -> Bonded:
    """The tie of s slave nodes at points (s, d) [m], found node by node, weighted over facets between them.

    facets: blocks (f, r) by kind in the numbering of the s nodes, outward. alone (s,): nodes without a multiplier.
    As it was where meshes match and where no facet has a multiplier.
    """
    blocks = {kind: np.asarray(block) for kind, block in facets.items() if len(block)}
    if not blocks or matching(tie, blocks, master):
        return Bonded(tie)
    count = len(points)
    lots = {kind: _points(kind, block, points, master, tolerance) for kind, block in blocks.items()}
    met = np.zeros(count, dtype=bool)
    off = np.zeros(count, dtype=bool)
    for kind, block in blocks.items():
        met[block] = True
        off[block[~lots[kind].covered]] = True
    single = alone | ~met | off
    for kind, block in blocks.items():
        for middle, corners in MIDDLES.get(kind, {}).items():
            single[block[single[block[:, middle]]][:, list(corners)]] = True
    taking = ~single
    if not taking.any():
        return Bonded(tie, int(np.sum(off & ~alone)))
    area, own, below = _integrals(blocks, lots, points, master, taking)
    # ũ = W u on nodes; the rows of those with a multiplier: A ũ_T + D_X u_X = M u_m.
    collocated = _rows(tie, master.node_count)
    values = _changed_values(blocks, count)
    inverse = _nodal(blocks, count)
    single_values = sp.csr_array(values @ sp.diags_array(single.astype(float)) @ collocated)
    unchanged = sp.diags_array(single.astype(float))
    right = below - own @ unchanged @ single_values
    found = sp.diags_array(np.where(taking, 1.0 / np.where(taking, area, 1.0), 0.0)) @ right + unchanged @ single_values
    # Middles of edges between corners with a multiplier: u = Sᵀ ũ. Nodes without one keep what was found for them.
    result = sp.csr_array(sp.diags_array(taking.astype(float)) @ (inverse @ found) + unchanged @ collocated)
    result.data[np.abs(result.data) < NOTHING] = 0.0
    result.eliminate_zeros()
    nodes, weights = _padded(result)
    point = np.einsum("sr,srd->sd", weights, master.positions[nodes])
    made = NodeTies(nodes, weights, point, np.linalg.norm(points - point, axis=1))
    return Bonded(made, int(np.sum(off & ~alone)))


def matching(tie: NodeTies, blocks: Blocks, master: Curve | FacetSurface) -> bool:
    """Whether each slave facet has a facet of the master with the same nodes below it."""
    at = np.argmax(tie.weights, axis=1)
    each = np.arange(len(at))
    if np.any(tie.weights[each, at] < 1.0 - ONE) or np.any(np.abs(tie.weights).sum(axis=1) > 1.0 + 4.0 * ONE):
        return False
    image = tie.nodes[each, at]
    if isinstance(master, Curve):
        theirs = {tuple(sorted(n for n in row if n >= 0)) for row in master.facets.tolist()}
    else:
        theirs = {tuple(sorted(row)) for block in master.blocks.values() for row in np.asarray(block).tolist()}
    return all(tuple(sorted(row)) in theirs for block in blocks.values() for row in image[block].tolist())


@dataclass(frozen=True)
class _Lot:
    """Points of facets of a kind: facet (q,), φ (q, r), dA (q,), nodes (q, m) and weights (q, m) of the master."""

    owner: IntArray
    values: Array
    weight: Array
    nodes: IntArray
    weights: Array
    covered: BoolArray


def _points(kind: str, block: IntArray, points: Array, master: Curve | FacetSurface, tolerance: float) -> _Lot:
    current = master.positions
    cut_by = outlines(master, current)
    parts: list[_Lot] = []
    for part in np.array_split(np.arange(len(block)), max(1, -(-len(block) // TOGETHER))):
        corners = points[block[part]]
        under = master.locate(corners.mean(axis=1)).point
        cut = pieces(kind, corners, under, cut_by)
        values, slopes = shape_functions(kind, cut.local)
        at = np.einsum("qr,qrd->qd", values, corners[cut.owner])
        weight = cut.weight * stretch(slopes, corners[cut.owner])
        found = master.locate(at)
        nodes, weights = element_weights(master, found, at, current)
        apart = np.linalg.norm(at - np.einsum("qr,qrd->qd", weights, current[nodes]), axis=1)
        # Between nodes a curved slave is off the master by the heights of both chords.
        radius = np.linalg.norm(corners - corners.mean(axis=1, keepdims=True), axis=2).max(axis=1)
        over = apart <= tolerance + 0.2 * radius[cut.owner]
        whole = facet_integrals(points, block[part], kind).sum(axis=1)
        over &= found.inside
        share = np.bincount(cut.owner, weight * over, len(part)) / whole
        parts.append(_Lot(part[cut.owner], values, weight, nodes, weights, share >= COVERED))
    return _Lot(*(np.concatenate([getattr(p, name) for p in parts]) for name in _Lot.__dataclass_fields__))


def _integrals(
    blocks: Blocks, lots: dict[str, _Lot], points: Array, master: Curve | FacetSurface, taking: BoolArray
) -> tuple[Array, Sparse, Sparse]:
    """A_i (s,), ∫ ψ_i φ̃_k (s, s) and ∫ ψ_i φ_l (s, k) of the nodes with a multiplier, zero for the others."""
    count = len(points)
    area = np.zeros(count)
    own: list[Sparse] = []
    below: list[Sparse] = []
    for kind, block in blocks.items():
        lot, has = lots[kind], taking[block]
        change = changed_basis(kind, np.ones(block.shape, dtype=bool))
        share = np.einsum("fij,fj->fi", change, facet_integrals(points, block, kind))
        use = np.flatnonzero(has.any(axis=1) & lot.covered)
        if not len(use):
            continue
        np.add.at(area, block[use], np.where(has[use], share[use], 0.0))
        mine = np.isin(lot.owner, use)
        owner = np.searchsorted(use, lot.owner[mine])
        changed = np.einsum("qij,qj->qi", change[use][owner], lot.values[mine])
        # The functions of nodes without a multiplier, in equal parts to those with one.
        taken = has[use].astype(float)
        spread = np.where(taken > 0.0, 1.0, 0.0)[:, :, None] * (1.0 - taken)[:, None, :]
        spread = spread / taken.sum(axis=1)[:, None, None] + taken[:, :, None] * np.eye(block.shape[1])
        tested = np.einsum("qij,qj->qi", spread[owner], changed)
        weight = lot.weight[mine]
        gram = np.zeros(change[use].shape)
        np.add.at(gram, owner, weight[:, None, None] * tested[:, :, None] * changed[:, None, :])
        gram = gram * taken[:, :, None] * taken[:, None, :] + (1.0 - taken)[:, :, None] * np.eye(block.shape[1])
        coefficients = (share[use] * taken)[:, :, None] * np.linalg.inv(gram)
        dual = weight[:, None] * np.einsum("qij,qj->qi", coefficients[owner], tested)
        # Scaled to the integrals over the whole facet: Σ ψ_i dA is that of the points.
        row = block[use][owner]
        own.append(_coo(row, row, dual, changed, (count, count)))
        below.append(_coo(row, lot.nodes[mine], dual, lot.weights[mine], (count, master.node_count)))
    return area, total_of(own, (count, count)), total_of(below, (count, master.node_count))


def _coo(rows: IntArray, columns: IntArray, left: Array, right: Array, shape: tuple[int, int]) -> Sparse:
    entries = (left[:, :, None] * right[:, None, :]).ravel()
    row = np.repeat(rows, columns.shape[1], axis=1).ravel()
    column = np.repeat(columns[:, None, :], rows.shape[1], axis=1).ravel()
    return sp.csr_array((entries, (row, column)), shape=shape).tocoo()


def _rows(tie: NodeTies, nodes: int) -> Sparse:
    s, r = tie.weights.shape
    return sp.csr_array((tie.weights.ravel(), (np.repeat(np.arange(s), r), tie.nodes.ravel())), shape=(s, nodes))


def _nodal(blocks: Blocks, count: int) -> Sparse:
    """Sᵀ (s, s) of u = Sᵀ ũ."""
    return _by_edges(blocks, count, lambda left, share: (left, share))


def _changed_values(blocks: Blocks, count: int) -> Sparse:
    """Its inverse: ũ = W u."""
    return _by_edges(blocks, count, lambda left, share: (1.0 / left, -share / left))


def _by_edges(blocks: Blocks, count: int, of: Callable[[float, float], tuple[float, float]]) -> Sparse:
    own = np.ones(count)
    rows: list[IntArray] = []
    columns: list[IntArray] = []
    values: list[Array] = []
    for kind, block in blocks.items():
        change = changed_basis(kind, np.ones((1, block.shape[1]), dtype=bool))[0]
        for middle, corners in MIDDLES.get(kind, {}).items():
            diagonal, share = of(change[middle, middle], change[corners[0], middle])
            own[block[:, middle]] = diagonal
            for corner in corners:
                rows.append(block[:, middle])
                columns.append(block[:, corner])
                values.append(np.full(len(block), share))
    result = sp.csr_array(sp.diags_array(own))
    if not rows:
        return result
    row, column, value = (np.concatenate(part) for part in (rows, columns, values))
    # An edge is met in both its facets.
    _, once = np.unique(row * count + column, return_index=True)
    return sp.csr_array(result + sp.csr_array((value[once], (row[once], column[once])), shape=(count, count)))


def _padded(rows: Sparse) -> tuple[IntArray, Array]:
    """Nodes and weights (s, r) of rows, unused places holding node 0 with weight 0."""
    rows = sp.csr_array(rows)
    filled = np.diff(rows.indptr)
    width = int(filled.max(initial=1))
    place = np.arange(rows.nnz) - np.repeat(rows.indptr[:-1], filled)
    owner = np.repeat(np.arange(rows.shape[0]), filled)
    nodes = np.zeros((rows.shape[0], width), dtype=np.int64)
    weights = np.zeros((rows.shape[0], width))
    nodes[owner, place], weights[owner, place] = rows.indices, rows.data
    return nodes, weights

"""Contact nodes packed for the compiled loop: rows on the few freedoms that contacts touch, and their compliances."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from ....contact.nodes import ContactNodes
from ....laws.friction import friction_rows
from ....typing import Array, BoolArray, IntArray
from .storage import Layout


class NodeTable(NamedTuple):
    """m nodes, d directions (normal, then tangents), l entries that any of them touches, c contacts, p motions.

    indices (l,) among all entries, gain (l,) [m/N] = displacement over the step by a unit force. Node i has entries
    ptr[i] … ptr[i+1]: col into indices and row (entries, d). lift (m, d, p), gap (m,) [m], compliance (m,) [m/N], cubic
    (m,) [N/m³], block (m, d, d) [m/N] its own part of G A Gᵀ. owner (m,), friction (c, k) numbers of the laws, along
    (m, d−1) the direction in which a contact's tangential motion is told, weight (m,) for means without force; kept
    (m,) 1 where a node is kept closed.
    """

    indices: IntArray
    gain: Array
    ptr: IntArray
    col: IntArray
    row: Array
    lift: Array
    gap: Array
    compliance: Array
    cubic: Array
    block: Array
    owner: IntArray
    friction: Array
    along: Array
    weight: Array
    kept: IntArray


def node_table(nodes: ContactNodes, layout: Layout, gain: Array, factors: Array) -> NodeTable:
    """Pack nodes; gain (b·w,) [m/N] is the displacement of an entry over one step by a unit force on it, factors (p,)
    are those of the motions at full velocity."""
    m, t = nodes.count, nodes.directions
    d = t + 1
    normal, tangent = sp.coo_array(layout.rows(nodes.normal)), sp.coo_array(layout.rows(nodes.tangent))
    node = np.concatenate([normal.row, tangent.row // t]).astype(np.int64)
    direction = np.concatenate([np.zeros(normal.nnz, dtype=np.int64), 1 + tangent.row % t])
    value = np.concatenate([normal.data, tangent.data])
    index, local = np.unique(np.concatenate([normal.col, tangent.col]), return_inverse=True)
    key, entry = np.unique(node * max(len(index), 1) + local, return_inverse=True)
    row = np.zeros((len(key), d))
    np.add.at(row, (entry, direction), value)
    owner, col = key // max(len(index), 1), key % max(len(index), 1)
    block = np.zeros((m, d, d))
    own_gain = gain[index]
    np.add.at(block, owner, own_gain[col][:, None, None] * row[:, :, None] * row[:, None, :])
    p = nodes.normal_lift.shape[1]
    lift = np.zeros((m, d, p))
    lift[:, 0] = nodes.normal_lift
    lift[:, 1:] = nodes.tangent_lift.reshape(m, t, p)
    return NodeTable(
        indices=index.astype(np.int64),
        gain=own_gain,
        ptr=np.searchsorted(owner, np.arange(m + 1)).astype(np.int64),
        col=col.astype(np.int64),
        row=row,
        lift=lift,
        gap=np.array(nodes.gap, dtype=float),
        compliance=np.array(nodes.compliance, dtype=float),
        cubic=np.array(nodes.cubic, dtype=float),
        block=block,
        owner=np.array(nodes.owner, dtype=np.int64),
        friction=friction_rows(nodes.laws),
        along=sliding_directions(nodes, factors),
        weight=np.where(np.isnan(nodes.area), 1.0, nodes.area),
        kept=nodes.kept.astype(np.int64),
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

"""Rows of contact nodes at the edges of a contact over a surface, as a chamfer takes them away."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..contact.nodes import ContactNodes
from ..typing import Array, IntArray

STRIPS = 20  # into which the contact of an irregular mesh is cut
SAME_ROW = 1e-3  # of the length of a contact: nodes nearer to each other along the slip are one row


@dataclass(frozen=True)
class Cut:
    """Rows of contact nodes at an edge: how many, their places among the touching nodes, their share of the touching
    area, and the places among all contact nodes of everything out to the edge, open nodes too."""

    rows: int
    released: IntArray
    share: float
    gone: IntArray


def edge_rows(
    nodes: ContactNodes, touching: IntArray, sense: Array, contact: int, edge: str, most: int
) -> list[Cut]:
    """1, 2, … rows of touching nodes at an edge of a contact, none where fewer than three nodes touch.

    The leading edge of the slave is where it meets material of the master first, the one ahead in the direction of its
    slip. Rows lie across the slip, on a turning disc along radii; an irregular mesh is cut into strips.
    """
    mine = np.flatnonzero(nodes.owner[touching] == contact)
    if len(mine) < 3:
        return []
    every = np.flatnonzero(nodes.owner == contact)
    whole = _along_slip(nodes, every, sense[every]) * (1 if edge == "trailing" else -1)
    at = touching[mine]
    along = whole[np.searchsorted(every, at)]
    order = np.argsort(along, kind="stable")
    length = float(np.ptp(along)) or 1.0
    row = np.zeros(len(along), dtype=np.int64)
    row[order] = np.concatenate([[0], np.cumsum(np.diff(along[order]) > SAME_ROW * length)])
    if nodes.position.shape[1] == 3 and row.max() + 1 > len(along) / 2:
        row = np.minimum((STRIPS * (along - along.min()) / length).astype(np.int64), STRIPS - 1)
    levels = np.unique(row)
    area = np.where(np.isnan(nodes.area[at]), 1.0, nodes.area[at])
    found: list[Cut] = []
    for taken in range(1, min(most, len(levels) - 1) + 1):
        chosen = np.isin(row, levels[:taken])
        edge_at = float(along[chosen].max()) + 0.5 * SAME_ROW * length
        share = float(area[chosen].sum() / area.sum())
        found.append(Cut(taken, mine[chosen], share, every[whole <= edge_at]))
    return found


def _along_slip(nodes: ContactNodes, at: IntArray, sense: Array) -> Array:
    """A coordinate (k,) that grows in the direction of each node's slip: a length, on a turning surface an angle."""
    slip = -np.einsum("kq,kqd->kd", sense, nodes.tangents[at])
    position = nodes.position[at]
    position = position - position.mean(axis=0)
    mean = slip.mean(axis=0)
    mean = mean / (np.linalg.norm(mean) or 1.0)
    straight = position @ mean
    across = slip - np.outer(slip @ mean, mean)
    # Slip that turns from node to node is that of a spin: its direction is the angle about the axis.
    if np.abs(across).max() < 1e-3:
        return straight
    other = across[int(np.argmax(np.linalg.norm(across, axis=1)))]
    other = other / np.linalg.norm(other)
    angle = np.unwrap(np.arctan2(slip @ other, slip @ mean))
    return angle if float(angle @ straight) >= 0 else -angle

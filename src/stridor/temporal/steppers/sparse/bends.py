"""Nodes that slide along a curved master between two renewals of their rows: how the normal turns on the way.

Rows that stayed as they were found would lead a node along the tangent plane there. It would leave a master that bends
away, run into one that bends towards it, and at the next renewal, where the normal has turned by Δθ, a rigid contact
would stop the velocity v Δθ within one step: forces v Δθ/Δt, which grow as the step shrinks. With s the way along
the tangents since the rows were found, and K = dn/ds along them there, the normal is turned until its part of these
tangents is θ = K s, c = √(1 − θ²) of the one found; the master is taken to lie −s·Ks/(1 + c) over the tangent plane,
as a circle does, and the gap is c times what the node is above that. Gaps and slips are those at the end of a step,
along the normal there; forces act along the normal at its beginning, so that what is held moves on without gain or loss
(as in Shake: Ryckaert, Ciccotti and Berendsen, J. Comput. Phys. 23, 1977).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ....contact.nodes import ContactNodes
from ....kernels import njit
from ....typing import Array, IntArray

TURN = 0.02  # rad between two renewals
FARTHEST = 0.5  # rad: further on the curve is not what was looked at


@njit(cache=True, allocates=False)
def bent_gap(cosine: float, bend: float, height: float) -> float:  # pragma: no cover - compiled
    """Gap [m] of a node that is a ``height`` [m] above the tangent plane it slid along, where the normal has turned by
    an angle of that cosine; bend [m]: s·Ks, negative where the master closes in."""
    return cosine * (height + bend / (1.0 + cosine))


@dataclass(frozen=True)
class Turning:
    """Of m nodes: how their normals turn along the tangents as they slide along these, rate K (m, d−1, d−1) [rad/m],
    and how far along them (m, d−1) [m] they were."""

    rate: Array
    place: Array

    @staticmethod
    def none(nodes: ContactNodes) -> Turning:
        """Of nodes whose normals stay."""
        m, t = nodes.count, nodes.directions
        return Turning(np.zeros((m, t, t)), np.zeros((m, t)))

    def gap(self, nodes: ContactNodes, u: Array, x: Array) -> Array:
        """Gaps (m,) [m] of these nodes where the structure is at u (n,) and the supports at x (p,)."""
        height = nodes.gap + nodes.normal @ u + nodes.normal_lift @ x
        way = (nodes.tangent @ u + nodes.tangent_lift @ x).reshape(self.place.shape) - self.place
        angle = np.einsum("mjk,mk->mj", self.rate, way)
        cosine = np.sqrt(np.maximum(1.0 - np.sum(angle**2, axis=1), 1.0 - FARTHEST**2))
        return np.asarray(cosine * (height + np.sum(way * angle, axis=1) / (1.0 + cosine)))


class Bends(NamedTuple):
    """The k nodes whose normals turn, node (k,) their places in the table, with rate (k, d−1, d−1) and place (k, d−1);
    turn (k, d, d): the rotation of normal and tangents at the beginning of a step; and the table's numbers as they were
    found: row and push (entries, d), lift (m, d, p), gap (m,), block (m, d, d)."""

    node: IntArray
    turn: Array
    rate: Array
    place: Array
    row: Array
    push: Array
    lift: Array
    gap: Array
    block: Array


def bends_of(
    turning: Turning, row: Array, push: Array, lift: Array, gap: Array, block: Array
) -> Bends:
    """Those of a table; without copies where no node turns."""
    turns = np.flatnonzero(np.any(turning.rate, axis=(1, 2)))
    kept = [part.copy() if len(turns) else part[:0].copy() for part in (row, push, lift, gap, block)]
    rate, place = (np.ascontiguousarray(part[turns]) for part in (turning.rate, turning.place))
    d = row.shape[1]
    return Bends(turns.astype(np.int64), np.zeros((len(turns), d, d)), rate, place, *kept)

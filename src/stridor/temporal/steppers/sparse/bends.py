"""Nodes that slide along a master which is curved or turns: how the normal turns between two renewals of their rows.

Rows that stayed as they were found would lead a node along the tangent plane there. It would leave a master that bends
away, run into one that bends towards it, and at the next renewal, where the normal has turned by Δθ, a rigid contact
would stop the velocity v Δθ within one step: forces v Δθ/Δt, which grow as the step shrinks. With s the way along
the tangents since the rows were found, and K = dn/ds along them there, and α the part of them that the normal has at
the place of the master where the node was found, whose surface has tilted since, the normal is turned until that part
is θ = α + K s, c = √(1 − θ²) of the one found; the master is taken to lie −s·(α + θ)/(c + √(1 − α²)) over the tangent
plane, as a circle does, and the gap is c times what the node is above that.

The tilt is that of the master's displacement u, α_j = −n·∂u/∂s_j: rows A_j of the structure, which also tell how the
normal's row changes as its place on the master moves on, N + s·A. Forces follow both, so that their lever on a master
that turns is that of the node, and what the gap's velocity has of the turning is no blow at the next renewal either.
Gaps and slips are those at the end of a step, along the normal there; forces act along the normal at its beginning, so
that what is held moves on without gain or loss (as in Shake: Ryckaert, Ciccotti and Berendsen, J. Comput. Phys. 23,
1977).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from ....contact.nodes import ContactNodes
from ....kernels import njit
from ....typing import Array, BoolArray, IntArray, Sparse

TURN = 0.02  # rad between two renewals
FARTHEST = 0.5  # rad: further on the curve is not what was looked at


@njit(cache=True, allocates=False)
def bent_gap(cosine: float, tilted: float, bend: float, height: float) -> float:  # pragma: no cover - compiled
    """Gap [m] of a node that is a ``height`` [m] above the tangent plane it slid along, where the normal has turned by
    an angle of that cosine, and of the cosine ``tilted`` where it was found; bend [m]: s·(α + θ), negative where the
    master closes in."""
    return cosine * (height + bend / (tilted + cosine))


@dataclass(frozen=True)
class Turning:
    """Of m nodes: how their normals turn along the tangents as they slide along these, rate K (m, d−1, d−1) [rad/m],
    and how far along them (m, d−1) [m] they were; tilt (m (d−1), n) csr and tilt_lift (m (d−1), p): rows A of the
    master's tilt under the nodes along the tangents, and tilted (m, d−1) [rad] what they were. drift (m (d−1), p): what
    the nodes' tangent_lift has of material that slides through its mesh, which takes none of them anywhere; None for
    none."""

    rate: Array
    place: Array
    tilt: Sparse
    tilt_lift: Array
    tilted: Array
    drift: Array | None = None

    @staticmethod
    def none(nodes: ContactNodes) -> Turning:
        """Of nodes whose normals stay."""
        m, t = nodes.count, nodes.directions
        tilt, lift = sp.csr_array(nodes.tangent.shape), np.zeros(nodes.tangent_lift.shape)
        return Turning(np.zeros((m, t, t)), np.zeros((m, t)), tilt, lift, np.zeros((m, t)))

    @property
    def tilting(self) -> BoolArray:
        """Nodes (m,) whose master can tilt."""
        entries = np.diff(self.tilt.indptr) + np.count_nonzero(self.tilt_lift, axis=1)
        return np.asarray(entries.reshape(self.place.shape).any(axis=1))

    def tilts(self, u: Array, x: Array) -> Array:
        """Tilt (m, d−1) of a structure at u (n,) and supports at x (p,), or its rate at their velocities."""
        return np.asarray(self.tilt @ u + self.tilt_lift @ x).reshape(self.place.shape)

    def way_lift(self, nodes: ContactNodes) -> Array:
        """What supports take the nodes along their tangents (m (d−1), p)."""
        return nodes.tangent_lift if self.drift is None else nodes.tangent_lift - self.drift

    def gap(self, nodes: ContactNodes, u: Array, x: Array) -> Array:
        """Gaps (m,) [m] of these nodes where the structure is at u (n,) and the supports at x (p,)."""
        height = nodes.gap + nodes.normal @ u + nodes.normal_lift @ x
        way = (nodes.tangent @ u + self.way_lift(nodes) @ x).reshape(self.place.shape) - self.place
        tilt = self.tilts(u, x) - self.tilted
        angle = tilt + np.einsum("mjk,mk->mj", self.rate, way)
        cosine, tilted = (
            np.sqrt(np.maximum(1.0 - np.sum(each**2, axis=1), 1.0 - FARTHEST**2)) for each in (angle, tilt)
        )
        return np.asarray(cosine * (height + np.sum(way * (tilt + angle), axis=1) / (tilted + cosine)))


class Bends(NamedTuple):
    """The k nodes whose normals turn, node (k,) their places in the table, with rate (k, d−1, d−1), place and tilted
    (k, d−1); and the table's numbers as they were found, in w rows: normal and tangents, and where a master can tilt
    the d − 1 rows A of its tilt, w = d or 2d − 1: row and push (entries, w), lift (m, w, p), gap (m,), block (m, w, w).
    drift (m, d−1, p): what slips along the tangents have beside, wherever these turn to.

    turn (k, d, w): what normal and tangents at the beginning of a step have of these rows."""

    node: IntArray
    turn: Array
    rate: Array
    place: Array
    tilted: Array
    row: Array
    push: Array
    lift: Array
    gap: Array
    block: Array
    drift: Array


def bends_of(
    turning: Turning, row: Array, push: Array, lift: Array, gap: Array, block: Array
) -> Bends:
    """Those of a table, from its numbers in w rows; without copies where no node turns."""
    turns = np.flatnonzero(np.any(turning.rate, axis=(1, 2)) | turning.tilting)
    row, push, lift, gap, block = (
        part.copy() if len(turns) else part[:0].copy() for part in (row, push, lift, gap, block)
    )
    rate, place, tilted = (
        np.ascontiguousarray(part[turns]) for part in (turning.rate, turning.place, turning.tilted)
    )
    d, w = turning.rate.shape[1] + 1, row.shape[1]
    drift = np.zeros((len(lift), d - 1, lift.shape[2]))
    if turning.drift is not None and len(turns):
        drift[:] = turning.drift.reshape(drift.shape)
        lift[:, 1:d] -= drift
    turn = np.zeros((len(turns), d, w))
    return Bends(turns.astype(np.int64), turn, rate, place, tilted, row, push, lift, gap, block, drift)

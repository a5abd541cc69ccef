"""A contact pair as operators on the freedoms: what modal and temporal approach share.

Signs: the normal points from the master to the slave, the gap is positive when open, the normal
force is positive in compression. The tangent is the normal turned by −90°; slip is the motion of
the slave relative to the master along it (docs/conventions.md).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..laws.friction import FrictionLaw
from ..typing import Array, Sparse
from .surface import project, spline_weights, unit_tangent

ROUNDING = 1e-12  # of the coordinates that a gap is the difference of


@dataclass(frozen=True)
class Rows:
    """Rows that turn freedoms and prescribed motions into displacements.

    free: (r, n) csr on the free freedoms; lift: (r, p) on the prescribed motions (one column each,
    displacement per unit motion of the structure at rest).
    """

    free: Sparse
    lift: Array


@dataclass(frozen=True)
class Contact:
    """One slave point against one master line.

    slave: rows (2, n) of the slave's displacement; slave_position (2,) [m]. master: rows (2k, n) of
    the displacements of the k nodes (x and y in turn); master_positions (k, 2) [m].
    normal, tangent (2,) unit vectors and gap [m] in the reference configuration; segment and xi
    locate the master point there. normal_row, tangent_row (n,) and their lifts (p,) give the
    relative displacement slave − master of the pair: K_c (n + μ s t) nᵀ of the modal approach is
    written with them. stiffness [N/m] is K_c, infinite for rigid contact. law is the friction law.
    sliding "small" keeps pair and normal of the reference; "finite" finds both again in each step.
    closed: kept so, pulling where it would open. side is +1 where the normal is the master's direction turned by
    +90°, else −1.
    """

    name: str
    slave: Rows
    slave_position: Array
    master: Rows
    master_positions: Array
    chords: Array
    segment: int
    xi: float
    side: int
    gap: float
    normal: Array
    tangent: Array
    normal_row: Array
    tangent_row: Array
    normal_lift: Array
    tangent_lift: Array
    stiffness: float
    law: FrictionLaw
    sliding: Literal["small", "finite"] = "small"
    closed: bool = False

    @property
    def compliance(self) -> float:
        """1/K_c [m/N], 0 for rigid contact."""
        return 1.0 / self.stiffness


def rounding_of(*coordinates: Array) -> float:
    """How far [m] differences of coordinates [m] are uncertain."""
    return ROUNDING * max(float(np.max(np.abs(numbers), initial=0.0)) for numbers in coordinates)


def without_rounding(gap: Array, *coordinates: Array) -> Array:
    """Gaps (m,) [m], zero where no more than the rounding of the coordinates [m] that they are made of: bodies that
    were placed to touch do so, neither open nor closed too far by the last bit."""
    return np.where(np.abs(gap) <= rounding_of(*coordinates), 0.0, gap)


def pair(
    name: str,
    *,
    slave: Rows,
    slave_position: Array,
    master: Rows,
    master_positions: Array,
    side: int,
    stiffness: float,
    law: FrictionLaw,
    sliding: Literal["small", "finite"] = "small",
    closed: bool = False,
) -> Contact | None:
    """Project the slave on the master line and build the operators; None where it is beyond an end."""
    chords = np.linalg.norm(np.diff(master_positions, axis=0), axis=1)
    weights, slopes = np.zeros(4), np.zeros(4)
    nearest = int(np.argmin(np.linalg.norm(master_positions - slave_position, axis=1)))
    segment, xi, on_line = project(
        float(slave_position[0]),
        float(slave_position[1]),
        master_positions,
        chords,
        min(nearest, len(chords) - 1),
        0.0,
        weights,
        slopes,
    )
    if not on_line:
        return None
    # A point within rounding of a node is that node: four weights there would only blur the rows.
    if xi > 1 - 1e-9:
        xi = 1.0
    elif xi < 1e-9:
        xi = 0.0
    spline_weights(segment, xi, chords, weights, slopes)
    tangent = np.array(unit_tangent(segment, master_positions, slopes)) * side
    normal = np.array([-tangent[1], tangent[0]])
    nodes = [segment - 1 + k for k in range(4) if weights[k] != 0.0]
    active = [weights[node - segment + 1] for node in nodes]
    point = sum(w * master_positions[node] for w, node in zip(active, nodes, strict=True))

    def relative(direction: Array) -> tuple[Array, Array]:
        free = slave.free.T @ direction
        lift = slave.lift.T @ direction
        for w, node in zip(active, nodes, strict=True):
            rows = slice(2 * node, 2 * node + 2)
            free = free - w * (master.free[rows].T @ direction)
            lift = lift - w * (master.lift[rows].T @ direction)
        return free, lift

    normal_row, normal_lift = relative(normal)
    tangent_row, tangent_lift = relative(tangent)
    return Contact(
        name=name,
        slave=slave,
        slave_position=slave_position,
        master=master,
        master_positions=master_positions,
        chords=chords,
        segment=segment,
        xi=xi,
        side=side,
        gap=float(without_rounding(normal @ (slave_position - point), slave_position, master_positions)),
        normal=normal,
        tangent=tangent,
        normal_row=normal_row,
        tangent_row=tangent_row,
        normal_lift=normal_lift,
        tangent_lift=tangent_lift,
        stiffness=stiffness,
        law=law,
        sliding=sliding,
        closed=closed,
    )

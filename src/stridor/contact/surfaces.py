"""A surface contact: slave nodes of one boundary paired with a master surface."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import scipy.sparse as sp

from ..laws.friction import FrictionLaw
from ..typing import Array, IntArray, Sparse
from .coupling import Coupling, SlaveFacets, collocated
from .interface import Rows
from .joined import Joined
from .master import Location, MasterSurface
from .nodes import ContactNodes


@dataclass(frozen=True)
class SurfaceContact:
    """What a contact was paired from, so that it can be paired again as it slides, and its operators.

    slave: rows (m d, n) of the displacements of the slave nodes; slave_position (m, d) [m], area (m,) [m²].
    master_rows (k d, n) belong to the k nodes of master. drift (m, d, p) [m/s]: velocity of the slave's material
    against the master's at each slave node for a body that slides through its mesh (a turning disc), for each
    prescribed motion at factor one. stiffness_per_area [N/m³], infinite for rigid. facets: those between the slave
    nodes where they are known. Slave nodes that the master does not face at the start take no part. joined: which of
    the m are one node of the contact, as the body repeats; None where none are. turn (d, d, p) [1/s]: by how much the
    master's material moves faster from place to place as it turns, for each motion, None where it does not; shift
    (m, d) [m]: how far the nodes have come over the master since the start, whose places ``drift`` is of.
    """

    name: str
    slave: Rows
    slave_position: Array
    area: Array
    master: MasterSurface
    master_rows: Rows
    drift: Array
    stiffness_per_area: float
    law: FrictionLaw
    sliding: Literal["small", "finite"]
    location: Location
    nodes: ContactNodes
    facets: SlaveFacets | None = None
    joined: Joined | None = None
    turn: Array | None = None
    shift: Array | None = None

    @property
    def present_drift(self) -> Array:
        """The drift (m, d, p) [m/s] where the nodes are now: of a disc that turns another place goes another way."""
        if self.turn is None or self.shift is None:
            return self.drift
        return self.drift - np.einsum("dep,me->mdp", self.turn, self.shift)

    @property
    def own(self) -> IntArray:
        """Which of ``nodes`` each slave node (m,) is."""
        return np.arange(len(self.slave_position)) if self.joined is None else self.joined.into

    @property
    def first(self) -> IntArray:
        """The first slave node of each of ``nodes``."""
        return np.arange(len(self.slave_position)) if self.joined is None else self.joined.first

    def rigid(self) -> SurfaceContact:
        """The same contact without compliance."""
        nodes = replace(self.nodes, compliance=np.zeros(self.nodes.count))
        return replace(self, stiffness_per_area=np.inf, nodes=nodes)


def frames(normal: Array, preferred: Array | None = None) -> Array:
    """Tangents (m, d−1, d) to unit normals (m, d); in the plane the normal turned by −90°.

    In space the first tangent follows ``preferred`` (m, d), the direction of sliding, as far as it is tangential,
    else the axis most perpendicular to the normal; the second completes a right-handed frame t1 × t2 = n.
    """
    if normal.shape[1] == 2:
        return np.stack([normal[:, 1], -normal[:, 0]], axis=1)[:, None, :]
    axis = np.eye(3)[np.argmin(np.abs(normal), axis=1)]
    if preferred is not None:
        flat = preferred - np.sum(preferred * normal, axis=1, keepdims=True) * normal
        size = np.linalg.norm(flat, axis=1)
        largest = float(size.max(initial=0.0))
        good = size > 1e-9 * largest if largest > 0 else np.zeros(len(size), dtype=bool)
        axis = np.where(good[:, None], flat, axis)
    first = axis - np.sum(axis * normal, axis=1, keepdims=True) * normal
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(normal, first)
    return np.stack([first, second], axis=1)


def operators(
    name: str,
    *,
    slave: Rows,
    slave_position: Array,
    area: Array,
    master_rows: Rows,
    drift: Array,
    stiffness_per_area: float,
    law: FrictionLaw,
    location: Location,
    coupling: Coupling | None = None,
    joined: Joined | None = None,
) -> ContactNodes:
    """Normal and tangential rows of slave nodes at a location on their master.

    coupling: how they hang on slave and master nodes, each by itself where it is None. joined: which are one node, at
    a location that is `Joined.even`.
    """
    count, d = slave_position.shape
    slip = drift.sum(axis=2) if drift.shape[2] else None
    tangents = frames(location.normal, slip)
    if joined is not None:
        tangents = joined.tangents(tangents)
    if coupling is None:
        coupling = collocated(location, area, master_rows.free.shape[0] // d)

    def rows(directions: Array) -> tuple[Sparse, Array]:
        """Rows along directions (m, q, d), in order node by node."""
        own, other = _along(coupling.slave, directions), _along(coupling.master, directions)
        free = sp.csr_array(own @ slave.free - other @ master_rows.free)
        free.eliminate_zeros()
        return free, np.asarray(own @ slave.lift - other @ master_rows.lift)

    normal, normal_lift = rows(location.normal[:, None, :])
    tangent, tangent_lift = rows(tangents)
    # Material that slides through its mesh moves the surface's points along it, never the surface.
    tangent_lift = tangent_lift + np.einsum("mqd,mdp->mqp", tangents, drift).reshape(tangent_lift.shape)
    stiffness = stiffness_per_area * coupling.area
    apart = ContactNodes(
        names=(name,),
        owner=np.zeros(count, dtype=np.int64),
        laws=(law,),
        normal=normal,
        tangent=tangent,
        normal_lift=normal_lift,
        tangent_lift=tangent_lift,
        gap=coupling.gap,
        area=coupling.area,
        compliance=np.where(np.isinf(stiffness), 0.0, 1.0 / np.maximum(stiffness, 1e-300)),
        position=slave_position,
        normals=location.normal,
        tangents=tangents,
    )
    return apart if joined is None else joined.nodes(apart)


def rows_along(weights: Sparse, normals: Array) -> Sparse:
    """Rows (m, n d) csr that take Σ_j weights (m, n) u_j of node i along its normal (m, d)."""
    return _along(weights, normals[:, None, :])


def _along(weights: Sparse, directions: Array) -> Sparse:
    """Rows (m q, n d) csr that take Σ_j weights (m, n) u_j of node i along its directions (m, q, d)."""
    entries = sp.coo_array(weights)
    _, q, d = directions.shape
    rows = (entries.row[:, None, None] * q + np.arange(q)[:, None]).repeat(d, axis=2)
    columns = (entries.col[:, None, None] * d + np.arange(d)).repeat(q, axis=1)
    values = entries.data[:, None, None] * directions[entries.row]
    shape = (weights.shape[0] * q, weights.shape[1] * d)
    return sp.csr_array((values.ravel(), (rows.ravel(), columns.ravel())), shape=shape)

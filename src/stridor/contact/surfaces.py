"""A surface contact: slave nodes of one boundary paired with a master surface."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import scipy.sparse as sp

from ..laws.friction import FrictionLaw
from ..typing import Array, Sparse
from .interface import Rows
from .master import Location, MasterSurface
from .nodes import ContactNodes


@dataclass(frozen=True)
class SurfaceContact:
    """What a contact was paired from, so that it can be paired again as it slides, and its operators.

    slave: rows (m d, n) of the displacements of the slave nodes; slave_position (m, d) [m], area (m,) [m²].
    master_rows (k d, n) belong to the k nodes of master. drift (m, d, p) [m/s]: velocity of the slave's material
    against the master's at each slave node for a body that slides through its mesh (a turning disc), for each
    prescribed motion at factor one. stiffness_per_area [N/m³], infinite for rigid. out_of_reach: slave nodes that
    the master does not face at the start take no part.
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
) -> ContactNodes:
    """Normal and tangential rows of slave nodes at a location on their master."""
    count, d = slave_position.shape
    slip = drift.sum(axis=2) if drift.shape[2] else None
    tangents = frames(location.normal, slip)

    def rows(directions: Array) -> tuple[Sparse, Array]:
        """Rows along directions (m, q, d), in order node by node."""
        q = directions.shape[1]
        place = np.repeat(np.arange(count * q), d)
        own = (np.arange(count)[:, None, None] * d + np.arange(d)).repeat(q, axis=1).ravel()
        pick = sp.csr_array((directions.ravel(), (place, own)), shape=(count * q, count * d))
        free, lift = pick @ slave.free, pick @ slave.lift
        r = location.nodes.shape[1]
        if r:
            place = np.repeat(np.arange(count * q), r * d)
            at = (location.nodes[:, :, None] * d + np.arange(d))[:, None].repeat(q, axis=1).ravel()
            value = (location.weights[:, None, :, None] * directions[:, :, None, :]).ravel()
            pick = sp.csr_array((value, (place, at)), shape=(count * q, master_rows.free.shape[0]))
            free, lift = free - pick @ master_rows.free, lift - pick @ master_rows.lift
        free = sp.csr_array(free)
        free.eliminate_zeros()
        return free, np.asarray(lift)

    normal, normal_lift = rows(location.normal[:, None, :])
    tangent, tangent_lift = rows(tangents)
    # Material that slides through its mesh moves the surface's points along it, never the surface.
    tangent_lift = tangent_lift + np.einsum("mqd,mdp->mqp", tangents, drift).reshape(tangent_lift.shape)
    stiffness = stiffness_per_area * area
    return ContactNodes(
        names=(name,),
        owner=np.zeros(count, dtype=np.int64),
        laws=(law,),
        normal=normal,
        tangent=tangent,
        normal_lift=normal_lift,
        tangent_lift=tangent_lift,
        gap=location.gap,
        area=area,
        compliance=np.where(np.isinf(stiffness), 0.0, 1.0 / np.maximum(stiffness, 1e-300)),
        position=slave_position,
        normals=location.normal,
        tangents=tangents,
    )

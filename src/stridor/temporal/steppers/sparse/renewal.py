"""Finite sliding of surfaces: rows and gaps found again as the bodies move over each other.

Between renewals the rows stay; they are renewed before any node has slid a thousandth of the distance between nodes.
Where a node in contact is found at another gap than the loop left it at (it was zero along the old rows), the
difference becomes an offset that fades over a hundred steps: no kick enters the motion.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from ....contact.nodes import ContactNodes, stack
from ....contact.pairing import repair
from ....contact.surfaces import SurfaceContact
from ....system import System
from ....typing import Array, IntArray
from .machine import Machine

SLIDE = 1e-3  # of the distance between nodes
MOST_STEPS = 200


# Under a name of its own: the one thing here that knows geometry.
found_again = repair


def renew(
    machine: Machine, surfaces: tuple[SurfaceContact, ...]
) -> tuple[tuple[SurfaceContact, ...], ContactNodes, IntArray]:
    """Surfaces and nodes paired at the present displacement, and the nodes (l,) that have left their master."""
    u, x = machine.displacement, machine.state.motion[0]
    found: list[SurfaceContact] = []
    lost: list[IntArray] = []
    first = len(machine.system.contacts)
    for surface in surfaces:
        if surface.sliding == "small":
            found.append(surface)
        else:
            d = machine.system.dimension
            slave = (surface.slave.free @ u + surface.slave.lift @ x).reshape(-1, d)
            master = (surface.master_rows.free @ u + surface.master_rows.lift @ x).reshape(-1, d)
            new, gone = found_again(surface, slave, master)
            lost.append(first + gone)
            found.append(new)
        first += surface.nodes.count
    points = machine.nodes.select(np.arange(len(machine.system.contacts)))
    nodes = _joined(machine, points, found)
    return tuple(found), nodes, np.concatenate([np.zeros(0, dtype=np.int64), *lost])


def _joined(machine: Machine, points: ContactNodes, surfaces: list[SurfaceContact]) -> ContactNodes:
    """Points and surfaces as one list; the laws stay those of the run (they may have been scaled)."""
    old = machine.nodes
    system = machine.system
    parts = [points] if points.count else []
    together = stack(
        [*parts, *(s.nodes for s in surfaces)], system.size, len(system.motion.names), system.dimension
    )  # fmt: skip
    return replace(together, names=old.names, owner=old.owner, laws=old.laws, cubic=old.cubic, closed=old.closed)


def take_over(machine: Machine, surfaces: tuple[SurfaceContact, ...], nodes: ContactNodes) -> None:
    """Go on with renewed rows: gaps of closed nodes continue, tangential forces turn with their frames."""
    old, contacts = machine.nodes, machine.contacts
    u, x = machine.displacement, machine.state.motion[0]
    closed = contacts.force[:, 0] != 0.0
    before = old.gap + old.normal @ u + old.normal_lift @ x + contacts.offset
    after = nodes.gap + nodes.normal @ u + nodes.normal_lift @ x
    contacts.offset[closed] = (before - after)[closed]
    pulls = np.einsum("mk,mkd->md", contacts.force[:, 1:], old.tangents)
    contacts.force[:, 1:] = np.einsum("md,mkd->mk", pulls, nodes.tangents)
    machine.surfaces = surfaces
    machine.set_nodes(nodes)


def node_distances(system: System) -> Array:
    """Typical distance [m] between the slave nodes of each surface, or the size of what a single node stands for."""
    found: list[float] = []
    for surface in system.surfaces:
        position = surface.slave_position
        if len(position) > 1:
            found.append(float(np.median(cKDTree(position).query(position, k=2)[0][:, 1])))
        else:
            found.append(float(surface.area[0]) ** (1.0 / (position.shape[1] - 1)))
    return np.array(found)


def steps_to_renewal(machine: Machine, distances: Array, last: int) -> int:
    """Steps until a node of a finitely sliding surface has slid far enough at its present speed; at most twice as many
    as the ``last`` time, for what starts from rest does not stay at its speed."""
    nodes = machine.nodes
    q = machine.fields.q[machine.layout.index]
    slip = (nodes.tangent @ q + nodes.tangent_lift @ machine.state.motion[1]).reshape(nodes.count, -1)
    speed = np.linalg.norm(slip, axis=1)
    points = len(machine.system.contacts)
    steps = min(2 * last, MOST_STEPS)
    for k, surface in enumerate(machine.system.surfaces):
        if surface.sliding == "finite":
            fastest = float(speed[nodes.owner == points + k].max(initial=0.0))
            if fastest > 0.0:
                steps = min(steps, int(SLIDE * distances[k] / (fastest * machine.scheme.step)))
    return max(steps, 1)

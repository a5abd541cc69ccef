"""Finite sliding of surfaces: rows and gaps found again as the bodies move over each other.

They are renewed before any node has slid a thousandth of the distance between nodes, and between renewals follow the
master's curvature and its own turning (`bends`). Where a node in contact is found at another gap than the loop left it
at, the difference becomes an offset that fades as it slides on: no kick enters the motion.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from ....contact.coupling import point_weights
from ....contact.curve import Curve
from ....contact.facets import FacetSurface
from ....contact.nodes import ContactNodes, stack
from ....contact.obstacles import Cylinder
from ....contact.pairing import repair
from ....contact.surfaces import SurfaceContact, rows_along
from ....system import System
from ....typing import Array, IntArray, Sparse
from .bends import TURN, Turning
from .machine import OFFSET_STEPS, Machine

SLIDE = 1e-3  # of the distance between nodes
MOST_STEPS = 200
PROBE = 1e-4  # of that distance: behind which the master's normal is looked at again
KINK = 1e-2  # rad over it: an edge, not a curve
NO_TILT = 1e-9  # of the sum of magnitudes: what rounding leaves of the tilt of a master that moves as a whole
FADES_OVER = 2.0  # distances between nodes of the master


# Under a name of its own: the one thing here that knows geometry.
found_again = repair


def renew(
    machine: Machine, surfaces: tuple[SurfaceContact, ...]
) -> tuple[tuple[SurfaceContact, ...], ContactNodes, IntArray]:
    """Surfaces and nodes paired at the present displacement, and the nodes (l,) that have left their master."""
    found: list[SurfaceContact] = []
    lost: list[IntArray] = []
    first = len(machine.system.contacts)
    for surface in surfaces:
        if surface.sliding == "small":
            found.append(surface)
        else:
            new, gone = found_again(surface, *_displaced(machine, surface))
            lost.append(first + gone)
            found.append(new)
        first += surface.nodes.count
    points = machine.nodes.select(np.arange(len(machine.system.contacts)))
    nodes = _joined(machine, points, found)
    return tuple(found), nodes, np.concatenate([np.zeros(0, dtype=np.int64), *lost])


def _displaced(machine: Machine, surface: SurfaceContact) -> tuple[Array, Array]:
    """Displacements (m, d) and (k, d) [m] of slave and master nodes, with those of the supports."""
    u, x, d = machine.displacement, machine.state.motion[0], machine.system.dimension
    slave, master = surface.slave, surface.master_rows
    return (slave.free @ u + slave.lift @ x).reshape(-1, d), (master.free @ u + master.lift @ x).reshape(-1, d)


def turning(machine: Machine, surfaces: tuple[SurfaceContact, ...], nodes: ContactNodes, distances: Array) -> Turning:
    """How the normals of nodes just found turn as these slide on, and as the master turns: by its normals, and by its
    displacements, a little further on along each tangent. Material that slides through its mesh takes no node along."""
    drift = _drift(machine, surfaces, nodes)
    found = replace(Turning.none(nodes), drift=drift if np.any(drift) else None)
    u, x = machine.displacement, machine.state.motion[0]
    found.place[:] = (nodes.tangent @ u + found.way_lift(nodes) @ x).reshape(found.place.shape)
    first = len(machine.system.contacts)
    free = [sp.csr_array((nodes.directions * first, found.tilt.shape[1]))]
    for k, surface in enumerate(surfaces):
        own = slice(first, first + surface.nodes.count)
        first = own.stop
        tilt = sp.csr_array((nodes.directions * surface.nodes.count, found.tilt.shape[1]))
        if surface.sliding == "finite":
            found.rate[own], tilt, found.tilt_lift.reshape(*found.place.shape, -1)[own] = _turning_of(
                surface, *_displaced(machine, surface), nodes.tangents[own], PROBE * distances[k]
            )
        free.append(tilt)
    found = replace(found, tilt=sp.csr_array(sp.vstack(free)))
    found.tilted[:] = found.tilts(u, x)
    return found


def _drift(machine: Machine, surfaces: tuple[SurfaceContact, ...], nodes: ContactNodes) -> Array:
    """What tangent_lift (m (d−1), p) has of material that slides through its mesh."""
    t = nodes.directions
    found = np.zeros((nodes.count, t, nodes.tangent_lift.shape[1]))
    first = len(machine.system.contacts)
    for surface in surfaces:
        own = slice(first, first + surface.nodes.count)
        first = own.stop
        if np.any(surface.drift):
            # Of nodes that are one, images slide as each other (`pairs`).
            tangents = nodes.tangents[own]
            apart = tangents if surface.joined is None else surface.joined.tangents(tangents[surface.joined.into])
            found[own] = np.einsum("mqd,mdp->mqp", apart, surface.present_drift)[surface.first]
    return found.reshape(nodes.tangent_lift.shape)


def _turning_of(
    surface: SurfaceContact, slave: Array, master: Array, tangents: Array, probe: float
) -> tuple[Array, Sparse, Array]:
    """Of the m nodes of a surface just found with tangents (m, d−1, d): rate (m, d−1, d−1), tilt (m (d−1), n) and its
    lift (m, d−1, p) of `Turning`, by its master a ``probe`` [m] further on along each tangent."""
    joined, here = surface.joined, surface.location
    apart = tangents if joined is None else joined.tangents(tangents[joined.into])
    m, t = tangents.shape[:2]
    rate, lift = np.zeros((m, t, t)), np.zeros((m, t, surface.slave.lift.shape[1]))
    rows: list[Sparse] = []
    weights = point_weights(here, surface.master.node_count)
    for j in range(t):
        place = surface.slave_position + slave + probe * apart[:, j]
        there = surface.master.locate(place, master, guess=here.facet)
        tilt = rows_along(sp.csr_array(weights - point_weights(there, surface.master.node_count)) / probe, here.normal)
        if joined is not None:
            there, tilt = joined.even(there, surface.area), joined.mean(surface.area) @ tilt
        along = np.einsum("mkd,md->mk", apart, there.normal - here.normal)[surface.first]
        curved = np.linalg.norm(along, axis=1, keepdims=True) <= KINK
        rate[:, :, j] = np.where(curved, along / probe, 0.0)
        moved, sizes = surface.master_rows, abs(tilt)
        free, most = sp.csr_array(tilt @ moved.free), sizes @ abs(moved.free)
        rows.append(sp.csr_array(free.multiply(abs(free) > NO_TILT * most)))
        carried = tilt @ moved.lift
        lift[:, j] = np.where(np.abs(carried) > NO_TILT * (sizes @ np.abs(moved.lift)), carried, 0.0)
    # Node by node, as tangents are.
    order = np.arange(t * m).reshape(t, m).T.ravel()
    free = sp.csr_array(sp.vstack(rows))[order]
    free.eliminate_zeros()
    return rate, free, lift


def _joined(machine: Machine, points: ContactNodes, surfaces: list[SurfaceContact]) -> ContactNodes:
    """Points and surfaces as one list; the laws stay those of the run (they may have been scaled)."""
    old = machine.nodes
    system = machine.system
    parts = [points] if points.count else []
    together = stack(
        [*parts, *(s.nodes for s in surfaces)], system.size, len(system.motion.names), system.dimension
    )  # fmt: skip
    return replace(together, names=old.names, owner=old.owner, laws=old.laws, cubic=old.cubic, closed=old.closed)


def take_over(
    machine: Machine, surfaces: tuple[SurfaceContact, ...], nodes: ContactNodes, turns: Turning
) -> None:
    """Go on with renewed rows: gaps of closed nodes continue, tangential forces turn with their frames."""
    old, contacts = machine.nodes, machine.contacts
    u, x = machine.displacement, machine.state.motion[0]
    closed = contacts.force[:, 0] != 0.0
    before = machine.turning.gap(old, u, x) + contacts.offset
    after = nodes.gap + nodes.normal @ u + nodes.normal_lift @ x
    contacts.offset[closed] = (before - after)[closed]
    pulls = np.einsum("mk,mkd->md", contacts.force[:, 1:], old.tangents)
    contacts.force[:, 1:] = np.einsum("md,mkd->mk", pulls, nodes.tangents)
    machine.surfaces = surfaces
    machine.set_nodes(nodes, turns)


def node_distances(system: System) -> Array:
    """Typical distance [m] between the slave nodes of each surface; of a single node that between the master's nodes,
    or the size of what it stands for where that is less. A point mass has none: any number of metres would make the
    answer depend on how large the model is."""
    found: list[float] = []
    for surface in system.surfaces:
        position = surface.slave_position
        if len(position) > 1:
            found.append(_apart(position))
        else:
            found.append(float(surface.area[0]) ** (1.0 / (position.shape[1] - 1)))
            if isinstance(surface.master, Curve | FacetSurface):
                found[-1] = min(found[-1], _apart(surface.master.positions))
        if isinstance(surface.master, Cylinder):
            found[-1] = min(found[-1], surface.master.radius)
    return np.array(found)


def _apart(positions: Array) -> float:
    """Typical distance [m] between neighbours of points (m, d)."""
    return float(np.median(cKDTree(positions).query(positions, k=2)[0][:, 1]))


def found_on(surfaces: tuple[SurfaceContact, ...]) -> IntArray:
    """Facets (m,) that the slave nodes of all surfaces were found on, where the next search begins."""
    return np.concatenate([np.zeros(0, dtype=np.int64), *(surface.location.facet for surface in surfaces)])


def put_on(surfaces: tuple[SurfaceContact, ...], facets: IntArray) -> tuple[SurfaceContact, ...]:
    """The same surfaces, their next search to begin at facets (m,) from `found_on`."""
    ends = np.cumsum([len(surface.location.facet) for surface in surfaces])[:-1]
    each = zip(surfaces, np.split(facets, ends), strict=True)
    return tuple(replace(s, location=replace(s.location, facet=facet.copy())) for s, facet in each)


def last_facets(surfaces: tuple[SurfaceContact, ...]) -> IntArray:
    """The highest number (m,) that each of `found_on` can have."""
    each = [np.zeros(0, dtype=np.int64)]
    for surface in surfaces:
        master = surface.master
        pieces = master.stencils if isinstance(master, Curve) else getattr(master, "facets", (0,))
        each.append(np.full(len(surface.location.facet), len(pieces) - 1))
    return np.concatenate(each)


def facet_distances(system: System) -> Array:
    """Typical distance [m] between the nodes of each surface's master, NaN where that is no mesh."""
    meshed = [s.master if isinstance(s.master, Curve | FacetSurface) else None for s in system.surfaces]
    return np.array([np.nan if master is None else _apart(master.positions) for master in meshed])


def fading(machine: Machine, facets: Array) -> float:
    """What is left of gap offsets after a step at the present speeds: they fade over a way of `FADES_OVER` facets (of
    facets (k,) [m]), and over no fewer than a hundred steps. Over steps alone they would follow the polygon of linear
    facets ever more closely the shorter the step, each of whose edges is a blow; where no master is meshed there is
    none, and a hundred steps serve."""
    speed, points = np.linalg.norm(_way_rate(machine), axis=1), len(machine.system.contacts)
    ways: list[float] = []
    for k, surface in enumerate(machine.system.surfaces):
        if surface.sliding == "finite" and np.isfinite(facets[k]):
            fastest = float(speed[machine.nodes.owner == points + k].max(initial=0.0))
            ways.append(fastest * machine.scheme.step / (FADES_OVER * facets[k]))
    return 1.0 - min(1.0 / OFFSET_STEPS, max(ways, default=1.0))


def _way_rate(machine: Machine) -> Array:
    """How fast (m, d−1) [m/s] all nodes move over their masters: slip velocities but for material that slides through
    its mesh, which takes them nowhere."""
    nodes, q = machine.nodes, machine.fields.q[machine.layout.index]
    along = nodes.tangent @ q + machine.turning.way_lift(nodes) @ machine.state.motion[1]
    return np.asarray(along).reshape(nodes.count, -1)


def steps_to_renewal(machine: Machine, distances: Array, last: int) -> int:
    """Steps until a node of a finitely sliding surface has slid far enough at its present speed, or its normal turned;
    at most twice as many as the ``last`` time, for what starts from rest does not stay at its speed."""
    nodes, slip = machine.nodes, _way_rate(machine)
    speed = np.linalg.norm(slip, axis=1)
    tilts = machine.turning.tilts(machine.fields.q[machine.layout.index], machine.state.motion[1])
    turned = np.linalg.norm(np.einsum("mjk,mk->mj", machine.turning.rate, slip) + tilts, axis=1)
    points = len(machine.system.contacts)
    steps = min(2 * last, MOST_STEPS)
    for k, surface in enumerate(machine.system.surfaces):
        if surface.sliding == "finite":
            mine = nodes.owner == points + k
            most_way = np.inf if isinstance(surface.master, Cylinder) else SLIDE * distances[k]
            for fastest, most in ((speed[mine], most_way), (turned[mine], TURN)):
                rate = float(fastest.max(initial=0.0)) * machine.scheme.step
                if rate > 0.0 and np.isfinite(most):
                    steps = min(steps, int(most / rate))
    return max(steps, 1)

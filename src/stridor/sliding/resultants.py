"""What contact forces add up to, and whether they balance the loads."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from ..contact.nodes import ContactNodes
from ..system import Line, System
from ..typing import Array, BoolArray


@dataclass(frozen=True)
class Resultant:
    """Of one contact: force (d,) [N] on the slave body (in the plane [N] of the whole width), moment about the origin
    [N m] (one number in the plane, (3,) in space), pressed area [m²] and largest pressure [Pa]; NaN where nodes have
    no area (point contacts)."""

    force: Array
    moment: Array
    area: float
    largest_pressure: float


@dataclass(frozen=True)
class Balance:
    """Loads and contact forces against each other in every motion that nothing but contact holds.

    force_error and moment_error [-] are the largest work of all forces in a rigid translation or rotation of a body
    that leaves the structure unstrained, over the sum of the works' sizes; NaN where every motion is held. Small only
    if contact forces carry the loads, whichever way they were solved for.
    """

    force_error: float
    moment_error: float


def resultants(
    nodes: ContactNodes, normal_force: Array, friction_force: Array, active: BoolArray
) -> Mapping[str, Resultant]:
    """Contact name → resultant of normal force (m,) and friction (m, d−1) on the slave [N]."""
    forces = nodal_forces(nodes, normal_force, friction_force)
    found: dict[str, Resultant] = {}
    for k, name in enumerate(nodes.names):
        mine = nodes.owner == k
        pressing = mine & active
        area = nodes.area[pressing]
        with np.errstate(all="ignore"):
            pressure = normal_force[pressing] / area
        found[name] = Resultant(
            force=forces[mine].sum(axis=0),
            moment=moments(nodes.position[mine], forces[mine]).sum(axis=0),
            area=float(area.sum()),
            largest_pressure=float(pressure.max(initial=0.0)),
        )
    return found


def nodal_forces(nodes: ContactNodes, normal_force: Array, friction_force: Array) -> Array:
    """Forces (m, d) [N] on the slave nodes."""
    return normal_force[:, None] * nodes.normals + np.einsum("mq,mqd->md", friction_force, nodes.tangents)


def moments(position: Array, forces: Array) -> Array:
    """Moments about the origin [N m] of forces (m, d) [N] at positions (m, d) [m]: (m,) in the plane, else (m, 3)."""
    if position.shape[1] == 2:
        return position[:, 0] * forces[:, 1] - position[:, 1] * forces[:, 0]
    return np.cross(position, forces)


def balance(system: System, force: Array, contact_force: Array) -> Balance:
    """Whether generalised loads and contact forces (n,), (n,) [N] cancel in the motions that contact alone holds."""
    errors: dict[bool, list[float]] = {True: [], False: []}
    size = float(np.abs(system.stiffness.data).max(initial=0.0))
    whole = float(np.abs(force).max(initial=0.0) + np.abs(contact_force).max(initial=0.0))
    for rotates, motion in _rigid_motions(system):
        largest = float(np.abs(motion).max(initial=0.0))
        strained = np.abs(system.stiffness @ motion).max(initial=0.0)
        if largest == 0.0 or strained > 1e-9 * size * largest:
            continue
        terms = float(np.abs(motion) @ (np.abs(force) + np.abs(contact_force)))
        if terms > 1e-9 * whole * largest:
            errors[rotates].append(abs(float(motion @ (force + contact_force))) / terms)
    return Balance(max(errors[False], default=np.nan), max(errors[True], default=np.nan))


def _rigid_motions(system: System) -> Iterator[tuple[bool, Array]]:
    """Rigid motions (n,) of each drawn body's free freedoms, and whether they rotate."""
    for body in (*system.lines, *system.solids):
        points = body.coordinates if isinstance(body, Line) else body.points
        d = points.shape[1]
        for k in range(d):
            shift = np.zeros_like(points)
            shift[:, k] = 1.0
            yield False, body.rows.free.T @ shift.ravel()
    for solid in system.solids:
        about = solid.points - solid.points.mean(axis=0)
        planes = [(0, 1)] if about.shape[1] == 2 else [(0, 1), (1, 2), (2, 0)]
        for a, b in planes:
            turn = np.zeros_like(about)
            turn[:, a], turn[:, b] = -about[:, b], about[:, a]
            yield True, solid.rows.free.T @ turn.ravel()

"""Where a run on assembled matrices starts: at rest, in motion, or in steady sliding."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ....contact.nodes import ContactNodes
from ....errors import CaseError
from ....system import System
from ....typing import Array
from ...schedule import Schedule
from ...settings import Settings
from ...stepper import Disturbance
from ..starting import along_the_line, impulse, motion_of_bodies, steady_start
from .machine import Machine
from .node_table import sliding_directions


def begin(
    machine: Machine,
    schedule: Schedule,
    settings: Settings,
    disturbance: Disturbance | None,
) -> None:
    """Put a machine into its initial state.

    At rest: the bodies where and as fast as the system has them. Raises CaseError for a ramp out of steady sliding
    and what `steady_sliding` raises.
    """
    system = machine.system
    u, v, a = np.zeros(system.size), np.zeros(system.size), np.zeros(system.size)
    if settings.initial == "steady-sliding":
        u, v = _steady(machine, schedule, settings)
    elif own := motion_of_bodies(system, schedule):
        u, v, a = own
    if disturbance is not None:
        u, v, a = u + disturbance[0], v + disturbance[1], a + disturbance[2]
    # q_0 = v_0 − β2 Δt a_0 starts the scheme without a jump (docs/theory-temporal.md).
    index = machine.layout.index
    machine.fields.u[index] = u
    machine.fields.q[index] = v - machine.scheme.beta2 * machine.scheme.step * a
    machine.show()
    machine.mark_start()


def _steady(machine: Machine, schedule: Schedule, settings: Settings) -> tuple[Array, Array]:
    """Displacement and velocity (n,) of steady sliding, with the perturbation of the slip speed."""
    system, stretch = machine.system, schedule.stretches[0]
    if stretch.ramp_steps:
        ramp = stretch.ramp_steps * schedule.step
        raise CaseError("phases.0.ramp", ramp, "must be 0 when starting from steady sliding")
    steady, contacts = steady_start(system, stretch)
    nodes = machine.nodes
    if any(contact.sliding == "finite" for contact in contacts):
        machine.contacts.segment[: len(contacts)] = [c.segment for c in contacts]
        machine.contacts.xi[: len(contacts)] = [c.xi for c in contacts]
        machine.set_nodes(machine.nodes, machine.turning)
        nodes = replace(system, contacts=contacts).contact_nodes()
    # The loop counts from the structure that the distances carry along.
    machine.state.motion[0] = steady.travel + stretch.distances_after
    machine.state.motion[1] = stretch.velocities_after
    machine.contacts.force[:, 0] = np.where(steady.active, steady.normal_force, 0.0)
    machine.contacts.force[:, 1:] = steady.friction_force
    machine.contacts.status[:] = steady.status
    velocity = np.zeros(system.size)
    if settings.perturbation:
        for contact in range(len(nodes.names)):
            velocity += settings.perturbation * _slip_impulse(system, nodes, contact)
    velocity = along_the_line(system, steady, contacts, stretch.velocities_after, velocity)
    return np.asarray(steady.displacement) - system.motion.lift @ stretch.distances_after, velocity


def _slip_impulse(system: System, nodes: ContactNodes, contact: int) -> Array:
    """Velocity (n,) that equal impulses on the nodes of a contact along its sliding give, mean slip speed one."""
    mine = nodes.select(nodes.owner == contact)
    along = mine.along(sliding_directions(mine, system.motion.full))
    answer = impulse(system, along.T @ np.ones(mine.count))
    mean = float(np.mean(along @ answer))
    return answer / mean if mean > 0.0 else answer

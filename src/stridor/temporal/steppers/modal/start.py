"""Where a run begins: at rest, or in steady sliding."""

from __future__ import annotations

import numpy as np

from ....errors import CaseError
from ....system import System
from ....system.uncoupled import UncoupledModes
from ....typing import Array
from ...schedule import Schedule
from ...settings import Settings
from ...stepper import Disturbance
from ..starting import along_the_line, impulse, motion_of_bodies, steady_start
from .machine import Machine


def initial_state(
    machine: Machine,
    modes: UncoupledModes,
    schedule: Schedule,
    settings: Settings,
    disturbance: Disturbance | None = None,
) -> None:
    """Put a machine at rest, in motion or into steady sliding, disturbed if so asked, and predict its first step."""
    system, fields, state = machine.system, machine.fields, machine.state
    if settings.initial == "steady-sliding":
        stretch = schedule.stretches[0]
        steady, contacts = steady_start(system, stretch)
        state.segment[:], state.xi[:] = [c.segment for c in contacts], [c.xi for c in contacts]
        velocity = np.zeros(system.size)
        for contact in contacts:
            velocity += settings.perturbation * _slip_impulse(system, contact.tangent_row)
        velocity = along_the_line(system, steady, contacts, stretch.velocities_after, velocity)
        fields.u[:] = machine.coordinates(steady.displacement - system.motion.lift @ stretch.distances_after, modes)
        state.motion[0] = stretch.distances_after
        fields.q[:] = machine.coordinates(velocity, modes)
        state.motion[1] = stretch.velocities_after
        state.status[:] = np.where(steady.active, 2, 0)
        if stretch.ramp_steps:
            ramp = stretch.ramp_steps * schedule.step
            raise CaseError("phases.0.ramp", ramp, "must be 0 when starting from steady sliding")
    own = motion_of_bodies(system, schedule) if settings.initial == "rest" else None
    for added in (own, disturbance):
        if added is None:
            continue
        displacement, velocity, acceleration = added
        # q_0 = v_0 − β2 Δt a_0 starts the scheme without a jump (docs/theory-temporal.md).
        rate = velocity - machine.scheme.beta2 * machine.scheme.step * acceleration
        fields.u[:] += machine.coordinates(displacement, modes)
        fields.q[:] += machine.coordinates(rate, modes)
    machine.repack()
    machine.free_increment(coefficients(machine, schedule))
    machine.predict()


def _slip_impulse(system: System, tangent_row: Array) -> Array:
    """Velocity (n,) that an impulse along a contact's tangent gives, one unit of slip speed."""
    answer = impulse(system, tangent_row)
    return answer / float(tangent_row @ answer)


def coefficients(machine: Machine, schedule: Schedule) -> Array:
    """Forcing coefficients of the next step: loads, −a and −v of the supports."""
    scheme = machine.scheme
    done = int(machine.state.counters[0])
    rate = schedule.motion_increments(done, 1)[0] / scheme.step
    before = machine.state.motion[1]
    rate = np.where(np.abs(rate - before) <= 1e-13 * np.abs(before), before, rate)
    acceleration = -2.0 * (rate - before) / (scheme.step * scheme.s)
    velocity = -(before + 2.0 * scheme.beta2 * rate) / scheme.s
    return np.concatenate([schedule.load_factors(done, 1)[0], acceleration, velocity])

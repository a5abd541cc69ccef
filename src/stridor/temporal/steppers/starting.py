"""Where bodies start, alike for every loop of the explicit scheme; what other steppers do not start from."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spl

from ...system import System
from ...typing import Array
from ..schedule import PhaseSpec, Schedule, lay_out
from ..settings import Settings
from ..stepper import Disturbance

OVERLAP = 1e-6  # of its terms: what of a closed gap is rounding


def motion_of_bodies(system: System, schedule: Schedule) -> Disturbance | None:
    """Displacement, velocity and acceleration (n,) that bodies start with, None where all are at rest."""
    if system.initial_displacement is None and system.initial_velocity is None:
        return None
    zero, stretch = np.zeros(system.size), schedule.stretches[0]
    displacement = zero if system.initial_displacement is None else system.initial_displacement
    velocity = zero if system.initial_velocity is None else system.initial_velocity
    force = -(system.stiffness @ displacement) - system.damping @ velocity
    if stretch.ramp_steps == 0:
        for factor, vector in zip(stretch.loads_after, system.loads.values(), strict=True):
            force = force + factor * vector
    mass, diagonal = system.mass, system.mass.diagonal()
    # The scheme starts from the acceleration that the forces give; a consistent mass only delays it by half a step.
    return displacement, velocity, force / diagonal if mass.nnz == np.count_nonzero(diagonal) else zero


def impulse(system: System, row: Array) -> Array:
    """Velocity (n,) that a unit impulse along a row (n,) gives."""
    mass, diagonal = system.mass, system.mass.diagonal()
    if mass.nnz == np.count_nonzero(diagonal):
        return row / diagonal
    return spl.splu(sp.csc_array(mass)).solve(row)


def not_begun(system: System, settings: Settings, phases: Sequence[PhaseSpec]) -> str:
    """Why exact and implicit steps do not take phases from their start on; "" where they do. settings: with a step."""
    assert settings.step is not None, "the step was found before"
    motion, nodes = system.motion, system.contact_nodes()
    schedule = lay_out(phases, settings.step, list(system.loads), list(motion.names), motion.full_distance)
    if found := schedule.uneven(phases):
        return f"phases are no multiples of the step {settings.step:g} s: {found}"
    if settings.initial == "steady-sliding":
        return schedule.from_steady().jump
    if schedule.jump or not nodes.count:
        return schedule.jump
    u = np.zeros(system.size) if system.initial_displacement is None else system.initial_displacement
    gap, size = nodes.gap + nodes.normal @ u, np.abs(nodes.gap) + np.abs(nodes.normal) @ np.abs(u)
    overlaps = (nodes.compliance == 0.0) & ~nodes.kept & (gap < -OVERLAP * size)
    return "a rigid contact starts with overlap" if overlaps.any() else ""

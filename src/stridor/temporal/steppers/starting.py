"""Where bodies start, alike for every loop of the explicit scheme."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spl

from ...system import System
from ...typing import Array
from ..schedule import Schedule
from ..stepper import Disturbance


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

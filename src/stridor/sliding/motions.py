"""What drives steady sliding: how fast supports run, where contacts slip with them, and which loads act."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..system import System
from ..system.load_steps import running_on
from ..typing import Array

LEAST = 0.2  # of the speeds: a mean velocity below that is no direction (a whole turning ring)


def slip_speeds(system: System, motion_factors: Array) -> Array:
    """Slip (m,) [m/s] of slave relative to master at rest in the moving frame, of contacts over points."""
    return np.array([float(c.tangent_lift @ motion_factors) for c in system.contacts])


def mean_direction(slip: Array) -> Array | None:
    """Unit vector (q,) of slip velocities (m, q), None where they have no direction in common."""
    speeds = np.linalg.norm(slip, axis=1)
    mean = slip.mean(axis=0) if len(slip) else np.zeros(1)
    size = float(np.linalg.norm(mean))
    return mean / size if size > LEAST * float(speeds.max(initial=0.0)) > 0.0 else None


def full_motion(system: System) -> Array:
    """Factors (p,) of the moving supports in steady sliding: one, or those that run on after the last load step; zero
    for those that are pressed away by a distance."""
    return running_on(system.load_steps, system.motion)


def external_force(system: System, load_factors: Mapping[str, float] | None) -> Array:
    """The sum (n,) of all loads, each by its factor, by name (None: 1 for all)."""
    force = np.zeros(system.size)
    for name, vector in system.loads.items():
        force += vector * (1.0 if load_factors is None else load_factors.get(name, 1.0))
    return force


def words_of_friction(mu: Array) -> str:
    """Friction coefficients (m,) of contacts, as in "μ = 0.3" or "μ = 0.1 … 0.3"."""
    low, high = float(np.min(mu)), float(np.max(mu))
    return f"μ = {low:g}" if f"{low:g}" == f"{high:g}" else f"μ = {low:g} … {high:g}"


def placed(error: Exception, mu: float, of: str = "") -> str:
    """An error with the friction coefficient that it is about, which some name themselves; of: what that is of."""
    told = str(error)
    return told if f"at μ = {mu:g} (" in told else f"{told}; that is at μ = {mu:.6g}{of}"

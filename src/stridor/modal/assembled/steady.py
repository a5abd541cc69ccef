"""What the modal approach needs of steady sliding: who touches, which way it slips, what the pressure adds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...contact.nodes import ContactNodes
from ...errors import AnalysisError
from ...sliding import full_motion
from ...system import System
from ...typing import Array, BoolArray, IntArray, Sparse


@dataclass(frozen=True)
class Options:
    """Which effects of the steady state count beside the friction law's slope, which always does.

    friction_damping: vibration across the slip turns the friction force by δẇ/|v|, which damps (space only).
    prestress: the geometric stiffness that the steady stresses make.
    """

    friction_damping: bool = False
    prestress: bool = False


@dataclass(frozen=True)
class Touching:
    """Nodes in contact: active (m,), and the velocity (m, d−1) [m/s] at which each slips along its tangents."""

    active: BoolArray
    slip_velocity: Array


def touching_nodes(system: System, nodes: ContactNodes, mu: float | None) -> Touching:
    """The nodes that carry load in steady sliding at ``mu``; all of them where the system has no loads."""
    if not system.loads or not nodes.count:
        return Touching(np.ones(nodes.count, dtype=bool), nodes.slip_velocity(full_motion(system)))
    from ...sliding.surfaces import steady_sliding_nodes

    steady = steady_sliding_nodes(system, mu=mu)
    return Touching(np.asarray(steady.active), np.asarray(steady.slip_velocity))


@dataclass(frozen=True)
class Steadiness:
    """The touching nodes' steady state as a function of μ, for the terms that depend on it."""

    system: System
    nodes: ContactNodes
    touching: IntArray
    sloped: bool
    friction_damping: bool
    prestress: bool

    @property
    def neutral(self) -> bool:
        """Whether the steady state adds nothing at any μ."""
        return not (self.sloped or self.friction_damping or self.prestress)

    @property
    def damps(self) -> bool:
        """Whether something of it works on velocities."""
        return self.sloped or self.friction_damping

    def terms(self, mu: float) -> tuple[Array | None, Sparse | None, Sparse | None]:
        """Weakening d (m,) [N s/m], damping (n, n) and stiffness (n, n) at ``mu``, None where there is none."""
        from ...sliding.surfaces import friction_damping_matrix, steady_sliding_nodes

        steady = steady_sliding_nodes(self.system, mu=mu)
        weakening = None
        if self.sloped and mu:
            speeds = np.linalg.norm(steady.slip_velocity, axis=1)[self.touching]
            laws = [self.nodes.laws[k] for k in self.nodes.owner[self.touching]]
            slopes = [law.scaled(mu, float(v)).slope(float(v)) for law, v in zip(laws, speeds, strict=True)]
            weakening = np.asarray(steady.normal_force)[self.touching] * np.array(slopes)
        damping = friction_damping_matrix(self.system, steady) if self.friction_damping and mu else None
        stiffness = None
        if self.prestress and self.system.stress_stiffness is not None:
            stiffness = self.system.stress_stiffness(steady.displacement)
        return weakening, damping, stiffness


def steadiness(system: System, nodes: ContactNodes, touching: IntArray, options: Options) -> Steadiness:
    """What of the steady state matters here. Raises AnalysisError where it does but no load presses the bodies."""
    speeds = np.linalg.norm(nodes.slip_velocity(full_motion(system)), axis=1)
    pairs = {(int(nodes.owner[k]), float(speeds[k])) for k in touching}
    sloped = any(nodes.laws[owner].slope(speed) != 0.0 for owner, speed in pairs)
    across = options.friction_damping and nodes.directions == 2
    prestress = options.prestress and system.stress_stiffness is not None
    if (sloped or across or prestress) and not system.loads:
        what = "a friction law with a slope" if sloped else "friction damping" if across else "prestress"
        raise AnalysisError(f"{what} needs the normal force: give the case a load that presses the bodies")
    return Steadiness(system, nodes, touching, sloped, across, prestress)

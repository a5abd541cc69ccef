"""The steady sliding that a run in time ends with: its loads, velocities and distances in the last of its phases.

It is the state whose modes a run is to be held against. Everything that compares runs with modes asks here which it is.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..errors import AnalysisError
from ..sliding import full_motion
from ..system import System
from ..system.factors import under_factors
from ..typing import Array
from .schedule import PhaseSpec, lay_out

LATER = 0.5  # of the last phase: the spectrum of a run is that of what follows


@dataclass(frozen=True)
class EndState:
    """Factors at the end of a run: loads by name, motions (p,), as `System.motion` has them. phase: the last one;
    moving: the share of it in which factors still change by a ramp, 0 where none does. own: whether the steady sliding
    of the system itself is that, as where all of them are one."""

    phase: str
    loads: Mapping[str, float]
    motions: Array
    names: tuple[str, ...]
    moving: float
    own: bool

    @property
    def words(self) -> str:
        """Which factors are not one, "" where the steady sliding of the system is that of the run."""
        if self.own:
            return ""
        return ", ".join(f"{factor:g} times {name}" for name, factor in self.off.items()) or "full loads and speeds"

    @property
    def off(self) -> dict[str, float]:
        """The factors that are not one, by name."""
        factors = {**self.loads, **dict(zip(self.names, self.motions.tolist(), strict=True))}
        return {name: factor for name, factor in factors.items() if factor != 1.0}

    @property
    def note(self) -> str:
        """A sentence on whose modes the run is held against, "" where these are at full loads and speeds."""
        if not self.words:
            return ""
        return f"modes are those of steady sliding in phase {self.phase}, with which the run ends: {self.words}"

    def still_moving(self, share: float = LATER) -> str:
        """Why the end of the run, the last ``share`` of its last phase, is in no steady state; "" where it may be."""
        if self.moving <= 1.0 - share + 1e-9:
            return ""
        return f"loads or speeds still change in the part of phase {self.phase} that is looked at"

    def of(self, system: System, load: float = 1.0, speed: float = 1.0) -> System:
        """The system whose full loads, velocities and distances are those, with ``load`` times all loads and ``speed``
        times all velocities. Raises AnalysisError where it has none, as behind load steps that end with others."""
        if system.load_steps and not self.own:
            raise AnalysisError(
                f"what sticks and slips is that of the load steps, and the run ends with other loads or speeds than "
                f"they do ({self.words}); let its last phase have those of the last step"
            )
        # Load steps have their own factors, of what is full.
        own = {name: 1.0 for name in self.loads} if system.load_steps else self.loads
        motions = np.ones(len(self.motions)) if system.load_steps else self.motions
        scale = np.where(system.motion.full_distance > 0.0, 1.0, speed)
        return under_factors(system, {name: load * factor for name, factor in own.items()}, motions * scale)


def ended(system: System, phases: Sequence[PhaseSpec], number: int = -1) -> EndState:
    """The state that a run through phases ends with, or that behind the ramp of phase ``number``."""
    motion = system.motion
    names, distance = list(motion.names), motion.full_distance
    if not phases:
        return EndState("", dict.fromkeys(system.loads, 1.0), np.ones(len(names)), motion.names, 0.0, True)
    step = min(p.duration for p in phases)
    last = lay_out([replace(p, ramp=0.0) for p in phases], step, list(system.loads), names, distance).stretches[number]
    loads = dict(zip(system.loads, last.loads_after.tolist(), strict=True))
    motions = last.velocities_after + last.distances_after
    changes = bool(
        np.any(last.loads_before != last.loads_after) or np.any(last.velocities_before != last.velocities_after)
        or np.any(last.distances_before != last.distances_after)
    )  # fmt: skip
    phase = phases[number]
    own_loads = system.load_steps[-1].loads if system.load_steps else {}
    own_motions = np.where(distance > 0.0, 1.0, full_motion(system)) if system.load_steps else np.ones(len(names))
    own = all(own_loads.get(name, 1.0) == factor for name, factor in loads.items())
    own = own and bool(np.all(motions == own_motions))
    moving = phase.ramp / phase.duration if changes else 0.0
    return EndState(phase.name, loads, motions, motion.names, moving, own)

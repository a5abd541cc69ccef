"""Load phases in time: factors of loads and of prescribed velocities, sudden or by a smooth ramp."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..typing import Array


@dataclass(frozen=True)
class PhaseSpec:
    """One phase: duration [s], the factors that change in it, and the ramp [s] (0: sudden)."""

    name: str
    duration: float
    loads: Mapping[str, float]
    velocities: Mapping[str, float]
    ramp: float = 0.0


@dataclass(frozen=True)
class Stretch:
    """A phase laid out in steps: first and last step (exclusive), factors before and after its ramp."""

    name: str
    first: int
    last: int
    ramp_steps: float
    loads_before: Array
    loads_after: Array
    velocities_before: Array
    velocities_after: Array


@dataclass(frozen=True)
class Schedule:
    """All phases in steps of Δt for given load names (l,) and moving supports (p,)."""

    step: float
    stretches: tuple[Stretch, ...]

    @property
    def steps(self) -> int:
        """Number of steps of the whole run."""
        return self.stretches[-1].last

    def stretch_at(self, step: int) -> Stretch:
        """The phase that step number ``step`` belongs to."""
        for stretch in self.stretches:
            if step < stretch.last:
                return stretch
        return self.stretches[-1]

    def load_factors(self, steps: Array) -> Array:
        """Factors (k, l) at t = steps·Δt; steps (k,) within one phase."""
        stretch = self.stretch_at(int(steps[0]))
        blend = self._blend(stretch, steps)[:, None]
        return stretch.loads_before * (1 - blend) + stretch.loads_after * blend

    def motion_increments(self, steps: Array) -> Array:
        """Displacements (k, p) of the moving supports from t to t + Δt, t = steps·Δt, in units of their
        velocity at factor one; exact integrals of the velocity factor."""
        out = np.empty((len(steps), len(self.stretches[0].velocities_after)))
        for k, number in enumerate(steps):
            stretch = self.stretch_at(int(number))
            if number - stretch.first >= stretch.ramp_steps:
                # A constant factor gives the same increment to the last digit in every step, so that
                # no acceleration is made from rounding.
                out[k] = stretch.velocities_after * self.step
            else:
                start, end = (self._integral(stretch, number + e) for e in (0.0, 1.0))
                change = stretch.velocities_after - stretch.velocities_before
                out[k] = stretch.velocities_before * self.step + change * (end - start) * self.step
        return out

    def constant_motion(self, first: int, last: int) -> bool:
        """Whether no ramp is under way in steps first … last − 1 of one phase."""
        stretch = self.stretch_at(first)
        return first - stretch.first >= stretch.ramp_steps and last <= stretch.last

    def _blend(self, stretch: Stretch, steps: Array) -> Array:
        if stretch.ramp_steps <= 0:
            return np.ones(len(steps))
        x = np.clip((np.asarray(steps, dtype=float) - stretch.first) / stretch.ramp_steps, 0.0, 1.0)
        return x**3 * (10 - 15 * x + 6 * x**2)

    @staticmethod
    def _integral(stretch: Stretch, number: float) -> float:
        """∫ blend from the start of the phase [steps]; the blend is the C2 quintic 10x³ − 15x⁴ + 6x⁵."""
        r = stretch.ramp_steps
        x = min((number - stretch.first) / r, 1.0)
        return r * (2.5 * x**4 - 3 * x**5 + x**6) + max(number - stretch.first - r, 0.0)


def lay_out(
    phases: Sequence[PhaseSpec], step: float, loads: Sequence[str], supports: Sequence[str]
) -> Schedule:
    """Phases in steps. A factor not named stays as in the phase before; before the first phase loads and
    velocities are zero, and what the first phase does not name is one."""
    stretches: list[Stretch] = []
    load, velocity = np.zeros(len(loads)), np.zeros(len(supports))
    time, first = 0.0, 0
    for number, phase in enumerate(phases):
        default_load = np.ones(len(loads)) if number == 0 else load
        default_velocity = np.ones(len(supports)) if number == 0 else velocity
        next_load = np.array(
            [phase.loads.get(name, d) for name, d in zip(loads, default_load, strict=True)], dtype=float
        )
        next_velocity = np.array(
            [phase.velocities.get(name, d) for name, d in zip(supports, default_velocity, strict=True)],
            dtype=float,
        )
        time += phase.duration
        last = max(round(time / step), first + 1)
        stretches.append(
            Stretch(phase.name, first, last, phase.ramp / step, load, next_load, velocity, next_velocity)
        )
        load, velocity, first = next_load, next_velocity, last
    return Schedule(step, tuple(stretches))

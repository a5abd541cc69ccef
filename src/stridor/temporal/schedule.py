"""Load phases in time: factors of loads and of prescribed velocities, sudden or by a smooth ramp."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..errors import CaseError
from ..typing import Array

ROUNDED = 1e-3  # of a phase: as far as whole steps may end beside it
_REMEDY = "give another temporal.step, or other durations of phases"


@dataclass(frozen=True)
class PhaseSpec:
    """One phase: duration [s], the factors that change in it, and the ramp [s] (0: sudden)."""

    name: str
    duration: float
    loads: Mapping[str, float]
    velocities: Mapping[str, float]
    ramp: float = 0.0
    displacements: Mapping[str, float] = field(default_factory=dict[str, float])


@dataclass(frozen=True)
class Stretch:
    """A phase laid out in steps: first and last step (exclusive), factors before and after its ramp; distances (p,) are
    those prescribed, zero for motions with a velocity, as velocities are for distances."""

    name: str
    first: int
    last: int
    ramp_steps: float
    loads_before: Array
    loads_after: Array
    velocities_before: Array
    velocities_after: Array
    distances_before: Array
    distances_after: Array


@dataclass(frozen=True)
class Schedule:
    """All phases in steps of Δt for given load names (l,) and moving supports (p,)."""

    step: float
    stretches: tuple[Stretch, ...]

    @property
    def steps(self) -> int:
        """Number of steps of the whole run."""
        return self.stretches[-1].last

    def from_steady(self) -> Schedule:
        """The same where prescribed distances are in their place at the start, as in steady sliding."""
        first = self.stretches[0]
        return Schedule(self.step, (replace(first, distances_before=first.distances_after), *self.stretches[1:]))

    def uneven(self, phases: Sequence[PhaseSpec]) -> str:
        """Which of its phases steps round to another length, in words; "" for none."""
        for phase, stretch in zip(phases, self.stretches, strict=True):
            taken = (stretch.last - stretch.first) * self.step
            if abs(taken - phase.duration) > ROUNDED * phase.duration:
                return f"{phase.name} of {phase.duration:g} s would take {taken:g} s"
        return ""

    def stretched(self, phases: Sequence[PhaseSpec]) -> str:
        """Which of its phases is shorter than one step, in words; "" for none."""
        for phase in phases:
            if phase.duration < (1.0 - ROUNDED) * self.step:
                return f"{phase.name} of {phase.duration:g} s would take {self.step:g} s"
        return ""

    def require_whole(self, phases: Sequence[PhaseSpec], *, even: bool) -> None:
        """Refuse steps that make phases longer, as one step has to of a shorter one; ``even``: or round them to other
        lengths, which the stability limit keeps explicit ones from. Raises CaseError."""
        if even and (found := self.uneven(phases)):
            raise CaseError("temporal.step", self.step, f"a step that phases are multiples of: {found}; {_REMEDY}")
        if found := self.stretched(phases):
            raise CaseError("temporal.step", self.step, f"a step no longer than any phase: {found}; {_REMEDY}")

    @property
    def jump(self) -> str:
        """In which phase a prescribed distance changes at once, in words; "" for none."""
        for s in self.stretches:
            if s.ramp_steps == 0 and np.any(s.distances_after != s.distances_before):
                return f"a distance that changes at once in phase {s.name}"
        return ""

    def stretch_at(self, step: int) -> Stretch:
        """The phase that step number ``step`` belongs to."""
        for stretch in self.stretches:
            if step < stretch.last:
                return stretch
        return self.stretches[-1]

    def load_factors(self, first: int, count: int, within: float = 0.0) -> Array:
        """Factors (count, l) at t = (first + within)·Δt, …, with ``within`` < 1 of a step."""
        out = np.empty((count, len(self.stretches[0].loads_after)))
        for rows, stretch, steps in self._pieces(first, count):
            if stretch.ramp_steps > 0:
                x = np.clip((steps + within - stretch.first) / stretch.ramp_steps, 0.0, 1.0)
                blend = (x**3 * (10 - 15 * x + 6 * x**2))[:, None]
                out[rows] = stretch.loads_before * (1 - blend) + stretch.loads_after * blend
            else:
                out[rows] = stretch.loads_after
        return out

    def motion_increments(self, first: int, count: int) -> Array:
        """Displacements (count, p) of the moving supports from t to t + Δt, t = first·Δt, …, in units of
        their velocity at factor one, exact integrals of the velocity factor; of prescribed distances what their factor
        changes by, all of it in the first step of a phase without a ramp."""
        out = np.empty((count, len(self.stretches[0].velocities_after)))
        for rows, stretch, steps in self._pieces(first, count):
            # A constant factor gives the same increment to the last digit in every step, so that no
            # acceleration is made from rounding.
            out[rows] = stretch.velocities_after * self.step
            ramping = steps - stretch.first < stretch.ramp_steps
            if ramping.any():
                number = steps[ramping] - stretch.first
                blend = self._integral(stretch, number + 1.0) - self._integral(stretch, number)
                change = stretch.velocities_after - stretch.velocities_before
                values = (stretch.velocities_before + change * blend[:, None]) * self.step
                out[np.arange(rows.start, rows.stop)[ramping]] = values
            travel = stretch.distances_after - stretch.distances_before
            if np.any(travel):
                x = np.array([steps, steps + 1.0]) - stretch.first
                x = np.clip(x / stretch.ramp_steps, 0.0, 1.0) if stretch.ramp_steps > 0 else np.minimum(x, 1.0)
                done = x**3 * (10 - 15 * x + 6 * x**2)
                out[rows] += travel * (done[1] - done[0])[:, None]
        return out

    def motion_rates(self, first: int, count: int) -> Array:
        """Rates (count, p) [1/s of a distance, 1 of a velocity] of the moving supports at the ends of the steps first,
        …, before what changes there at once."""
        out = np.empty((count, len(self.stretches[0].velocities_after)))
        for rows, stretch, steps in self._pieces(first, count):
            out[rows] = stretch.velocities_after
            if stretch.ramp_steps > 0:
                x = np.clip((steps + 1.0 - stretch.first) / stretch.ramp_steps, 0.0, 1.0)[:, None]
                blend = x**3 * (10 - 15 * x + 6 * x**2)
                ramping = stretch.velocities_before * (1 - blend) + stretch.velocities_after * blend
                out[rows] = np.where(x < 1.0, ramping, out[rows])
                travel = stretch.distances_after - stretch.distances_before
                out[rows] += travel * 30 * (x * (1 - x)) ** 2 / (stretch.ramp_steps * self.step)
        return out

    def _pieces(self, first: int, count: int) -> Iterator[tuple[slice, Stretch, Array]]:
        """Rows, phase and step numbers of each phase met in steps first … first + count − 1."""
        done = 0
        while done < count:
            stretch = self.stretch_at(first + done)
            last = stretch is self.stretches[-1]
            size = count - done if last else min(count - done, stretch.last - first - done)
            steps = np.arange(first + done, first + done + size, dtype=float)
            yield slice(done, done + size), stretch, steps
            done += size

    @staticmethod
    def _integral(stretch: Stretch, number: Array) -> Array:
        """∫ blend from the start of the phase [steps]; the blend is the C2 quintic 10x³ − 15x⁴ + 6x⁵."""
        r = stretch.ramp_steps
        x = np.minimum(number / r, 1.0)
        return r * (2.5 * x**4 - 3 * x**5 + x**6) + np.maximum(number - r, 0.0)


def lay_out(
    phases: Sequence[PhaseSpec], step: float, loads: Sequence[str], supports: Sequence[str],
    distances: Array | None = None,
) -> Schedule:  # fmt: skip
    """Phases in steps. A factor not named stays as in the phase before; before the first phase loads, velocities and
    distances are zero, and what the first phase does not name is one. distances (p,): 1 where a motion is
    one."""
    stretches: list[Stretch] = []
    # Each is the next phase's default: without their types the checker takes half a minute to infer them in circles.
    load: Array = np.zeros(len(loads))
    velocity: Array = np.zeros(len(supports))
    distance: Array = np.zeros(len(supports))
    is_distance: Array = np.zeros(len(supports)) if distances is None else distances
    time, first = 0.0, 0
    for number, phase in enumerate(phases):
        default_load: Array = np.ones(len(loads)) if number == 0 else load
        default_velocity: Array = np.ones(len(supports)) if number == 0 else velocity
        next_load: Array = np.array(
            [phase.loads.get(name, d) for name, d in zip(loads, default_load, strict=True)], dtype=float
        )
        next_velocity: Array = np.array(
            [phase.velocities.get(name, d) for name, d in zip(supports, default_velocity, strict=True)],
            dtype=float,
        )
        default_distance: Array = np.ones(len(supports)) if number == 0 else distance
        next_distance: Array = is_distance * np.array(
            [phase.displacements.get(_owner(name), d) for name, d in zip(supports, default_distance, strict=True)],
            dtype=float,
        )
        next_velocity = next_velocity * (1.0 - is_distance)
        time += phase.duration
        last = max(round(time / step), first + 1)
        ramp = phase.ramp / step
        stretches.append(
            Stretch(phase.name, first, last, ramp, load, next_load, velocity, next_velocity, distance, next_distance)
        )
        load, velocity, distance, first = next_load, next_velocity, next_distance, last
    return Schedule(step, tuple(stretches))


def _owner(motion: str) -> str:
    """The support or contact that a distance belongs to, by the name of its motion."""
    return motion.split(".")[1] if motion.count(".") == 2 else motion

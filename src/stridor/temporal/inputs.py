"""What a run is given, checked before it starts: every problem at once, each with what is accepted."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from ..errors import CaseError, Problem
from ..system import System
from .schedule import PhaseSpec


def check_inputs(
    system: System,
    phases: Sequence[PhaseSpec],
    *,
    step: float | None,
    beta2: float,
    record_every: int,
    watch: Sequence[str],
) -> None:
    """Raise CaseError with every problem found."""
    problems = [
        *_settings(step, beta2, record_every),
        *_watch(system, watch),
        *_phases(system, phases),
    ]
    if problems:
        raise CaseError.many(problems)


def _settings(step: float | None, beta2: float, record_every: int) -> Iterator[Problem]:
    if step is not None and not (math.isfinite(step) and step > 0):
        yield Problem("temporal.step", step, "a time step is a number > 0 [s]")
    if not 0.5 <= beta2 <= 1.0:
        yield Problem("temporal.beta2", beta2, "beta2 lies in [0.5, 1]")
    if record_every < 1:
        yield Problem("temporal.record_every", record_every, "the steps between records are an integer ≥ 1")


def _watch(system: System, watch: Sequence[str]) -> Iterator[Problem]:
    for number, name in enumerate(watch):
        if name not in system.points:
            known = ", ".join(system.points) or "none"
            yield Problem(f"temporal.watch.{number}", name, f"no such point; the system has: {known}")


def _phases(system: System, phases: Sequence[PhaseSpec]) -> Iterator[Problem]:
    if not phases:
        yield Problem("phases", None, "at least one phase is needed")
    for number, phase in enumerate(phases):
        where = f"phases.{number}"
        if not (math.isfinite(phase.duration) and phase.duration > 0):
            yield Problem(f"{where}.duration", phase.duration, "a duration is a number > 0 [s]")
        if not (math.isfinite(phase.ramp) and phase.ramp >= 0):
            yield Problem(f"{where}.ramp", phase.ramp, "a ramp is a number ≥ 0 [s]; 0 is sudden")
        yield from _factors(f"{where}.loads", phase.loads, list(system.loads), "load")
        motion = system.motion
        away = [n.split(".")[1] for n, p in zip(motion.names, motion.places, strict=True) if p]
        moving = [n for n, p in zip(motion.names, motion.places, strict=True) if not p]
        yield from _factors(f"{where}.velocities", phase.velocities, moving, "moving support")
        yield from _factors(f"{where}.displacements", phase.displacements, away, "support or contact with a distance")


def _factors(where: str, factors: Mapping[str, float], names: Sequence[str], what: str) -> Iterator[Problem]:
    for name, factor in factors.items():
        if name not in names:
            yield Problem(f"{where}.{name}", factor, f"no such {what}; there are: {', '.join(names) or 'none'}")
        elif not math.isfinite(factor):
            yield Problem(f"{where}.{name}", factor, "a factor is a finite number")

"""What a case says about phases and the time loop, as the temporal approach takes it."""

from __future__ import annotations

from ..case import Case
from ..temporal.schedule import PhaseSpec
from ..temporal.settings import Settings


def phases_of(case: Case) -> list[PhaseSpec]:
    """The load phases of a case as the temporal approach takes them."""
    return [PhaseSpec(p.name, p.duration, p.loads, p.velocities, p.ramp, p.displacements) for p in case.phases]


def settings_of(case: Case) -> Settings:
    """The temporal settings of a case."""
    t = case.temporal
    return Settings(t.step, t.beta2, t.record_every, t.path, t.initial, t.perturbation, tuple(t.watch), t.contact)

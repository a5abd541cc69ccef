"""What a case says about phases and the time loop, as the temporal approach takes it."""

from __future__ import annotations

from typing import Protocol

from ..case.schema import Modal, Phase, Temporal
from ..temporal.schedule import PhaseSpec
from ..temporal.settings import Settings


class Marches(Protocol):
    """A case, or whatever else has load phases and a table [temporal]."""

    @property
    def phases(self) -> tuple[Phase, ...]:
        """The load phases."""
        ...

    @property
    def temporal(self) -> Temporal:
        """The table."""
        ...

    @property
    def modal(self) -> Modal:
        """The table [modal], whose highest frequency is what implicit steps resolve."""
        ...


def phases_of(case: Marches) -> list[PhaseSpec]:
    """The load phases as the temporal approach takes them."""
    return [PhaseSpec(p.name, p.duration, p.loads, p.velocities, p.ramp, p.displacements) for p in case.phases]


def settings_of(case: Marches) -> Settings:
    """The settings of [temporal]."""
    t = case.temporal
    watch = tuple(t.watch)
    return Settings(
        t.step, t.beta2, t.record_every, t.path, t.initial, t.perturbation, watch, t.contact, t.stepper,
        case.modal.max_frequency_hz, t.cutoff_hz,
    )  # fmt: skip

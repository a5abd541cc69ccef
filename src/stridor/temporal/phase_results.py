"""Phases as they were run: what the statistics of every step say of each, for both marches.

Nothing here depends on when a march is stopped. The statistics always belong to one phase: the one that the last step
was in. They are read off when that is asked for, and cleared only right before the first step of the next phase.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..errors import CaseError
from ..typing import Array
from .columns import (
    FIRST_OPEN,
    FIRST_STICK,
    MAX_NORMAL,
    MAX_SPEED,
    MAX_TANGENTIAL,
    OPEN_STEPS,
    SLIP_STEPS,
    STICK_STEPS,
)
from .schedule import Schedule
from .trajectory import ContactStatistics, PhaseResult, Trajectory


def fresh_statistics(count: int, columns: int) -> Array:
    """Statistics (count, columns) of contacts before the first step of a phase."""
    statistics = np.zeros((count, columns))
    statistics[:, [FIRST_STICK, FIRST_OPEN]] = -1.0
    return statistics


@dataclass
class PhaseResults:
    """Results by phase: of those gone by, kept; of the one that runs, from the statistics (m, …) as they are.

    kept: for each contact whether it is kept closed; () where none is.
    """

    schedule: Schedule
    contacts: Sequence[str]
    statistics: Array
    kept: Sequence[bool] = ()
    gone: dict[int, PhaseResult] = field(default_factory=dict[int, PhaseResult])

    def begin(self, done: int) -> None:
        """Before the step after ``done`` steps: put the phase that ends here away, once, and begin another."""
        number = self._running(done)
        if done == 0 or done < self.schedule.stretches[number].last:
            return
        if number not in self.gone:
            self.gone[number] = self._result(number, done)
        # In one piece: whatever comes between finds the old ones or the new ones.
        self.statistics[:] = fresh_statistics(*self.statistics.shape)

    def all(self, done: int) -> tuple[PhaseResult, ...]:
        """Results of all phases begun within ``done`` steps."""
        running = self._running(done)
        return tuple(self.gone[k] if k in self.gone else self._result(k, done) for k in range(running + 1))

    def resume(self, before: Trajectory) -> None:
        """Go on behind a run; its state is in the statistics. Raises CaseError where that has other phases gone by."""
        running = self._running(before.steps)
        gone = before.phases[: running + 1]
        dt = self.schedule.step
        here = [(s.name, min(s.last, before.steps)) for s in self.schedule.stretches[: running + 1]]
        if [(p.name, round(p.end / dt)) for p in before.phases] != here:
            raise CaseError(
                "restart",
                ", ".join(f"{p.name} to {p.end:.6g} s" for p in before.phases) or "no phases",
                f"the phases up to there: {', '.join(f'{name} to {last * dt:.6g} s' for name, last in here)}",
            )
        self.gone = dict(enumerate(gone[:running]))
        last = self.schedule.stretches[running]
        if before.steps == last.last and running + 1 < len(self.schedule.stretches):
            self.gone[running] = gone[running]

    def new_part(self, before: Trajectory, after: Trajectory) -> Trajectory:
        """What was computed behind a run, with the phases that it has records of."""
        kept = [p for k, p in enumerate(after.phases) if self.schedule.stretches[k].last > before.steps]
        return replace(after, phases=tuple(kept))

    def _running(self, done: int) -> int:
        """Number of the phase that the last of ``done`` steps was in."""
        stretches = self.schedule.stretches
        return next((k for k, s in enumerate(stretches) if done <= s.last), len(stretches) - 1)

    def _result(self, number: int, done: int) -> PhaseResult:
        stretch, dt = self.schedule.stretches[number], self.schedule.step
        contacts: dict[str, ContactStatistics] = {}
        kept = self.kept or (False,) * len(self.contacts)
        for contact, row, closed in zip(self.contacts, self.statistics, kept, strict=True):
            total = max(row[STICK_STEPS] + row[SLIP_STEPS] + row[OPEN_STEPS], 1.0)
            contacts[contact] = ContactStatistics(
                stick_fraction=float(row[STICK_STEPS] / total),
                slip_fraction=float(row[SLIP_STEPS] / total),
                separation_fraction=float(row[OPEN_STEPS] / total),
                max_normal_force=float(row[MAX_NORMAL]),
                max_tangential_force=float(row[MAX_TANGENTIAL]),
                max_slip_speed=float(row[MAX_SPEED]),
                first_stick=float(row[FIRST_STICK] * dt) if row[FIRST_STICK] >= 0 else None,
                first_separation=float(row[FIRST_OPEN] * dt) if row[FIRST_OPEN] >= 0 else None,
                kept_closed=closed,
            )
        return PhaseResult(stretch.name, stretch.first * dt, done * dt, contacts)

"""The one march around all steppers: phases, records, statistics, restart, progress and interruption."""

from __future__ import annotations

import time as clock
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..errors import AnalysisError
from ..interrupts import HeldSignals, at_once, held
from ..stages import going_on
from .observe import Observer
from .pace import Pace
from .phase_results import PhaseResults
from .restart import check_restart, joined, settings_row
from .schedule import Schedule
from .settings import Settings, coarse, unresolved
from .sketch import packed
from .stepper import Stepper
from .trajectory import Trajectory

TOLD_SECONDS = 0.1
Progress = Callable[[int, int], None]
Checkpoint = Callable[[Trajectory], None]


class March:
    """One run of a stepper through its phases, chunk by chunk.

    The stepper is where the run begins, or `resume` takes up another's state. join: the trajectory holds the run gone
    on from as well.
    """

    def __init__(
        self, stepper: Stepper, schedule: Schedule, settings: Settings, *, join: bool, observe: Observer | None
    ) -> None:
        self.stepper, self.schedule, self.settings = stepper, schedule, settings
        self.join, self.observe = join, observe
        self.restart: Trajectory | None = None
        self.phases = PhaseResults(schedule, stepper.contact_names, stepper.statistics, stepper.closed)
        self.wall = 0.0
        self.within = False
        self.first_step = 0

    def resume(self, restart: Trajectory, *, changed: bool) -> None:
        """Take up the state of another run. Raises CaseError where it does not fit."""
        check_restart(self.stepper, restart, self.settings, join=self.join, changed=changed)
        self.stepper.resume(restart, self.schedule, changed=changed)
        self.phases.resume(restart)
        self.restart, self.first_step = restart, restart.steps

    def _told(self) -> tuple[str, ...]:
        """What to say of the step and of the records."""
        step = self.stepper.scheme.step
        said = coarse(step, self.settings, self.stepper.path, self.stepper.system), unresolved(step, self.settings)
        return tuple(filter(None, said))

    def run(self, progress: Progress | None, checkpoint: Checkpoint | None, every_seconds: float) -> Trajectory:
        """To the end, or to where it is stopped. Raises AnalysisError, with what was computed in its ``trajectory``."""
        with at_once():  # compiles the loop or loads it, before the clock starts
            self.stepper.make_room(self.schedule, self.settings)
        with held() as block:
            interrupted = self._loop(block, progress, checkpoint, every_seconds)
            result = self._trajectory(interrupted=interrupted)
            stopped = replace(result, interrupted=True)
            block.met = block.ending = True
            return stopped if block.asked else result

    def _loop(
        self, block: HeldSignals, progress: Progress | None, checkpoint: Checkpoint | None, every_seconds: float
    ) -> bool:
        """The chunks; whether they were interrupted."""
        stepper, steps = self.stepper, self.schedule.steps
        started = last_saved = last_told = clock.perf_counter()
        pace = Pace(stepper.threaded)
        try:
            started = last_saved = last_told = clock.perf_counter()
            while stepper.done < steps and not block.asked:
                self.phases.begin(stepper.done)
                before = clock.perf_counter()
                taken = self._advance(pace)
                now = clock.perf_counter()
                self.wall = now - started
                pace.end(taken, now - before)
                if now - last_told > TOLD_SECONDS or stepper.done == steps:
                    going_on(f"time loop, {stepper.done} of {steps} steps")
                    if progress is not None:
                        progress(stepper.done, steps)
                    last_told = now
                if checkpoint is not None and now - last_saved > every_seconds:
                    checkpoint(self._trajectory(interrupted=True))
                    last_saved = now
        except KeyboardInterrupt:
            if self.within:
                raise
            return True
        finally:
            self.wall = clock.perf_counter() - started
        return block.asked

    def _advance(self, pace: Pace) -> int:
        """One chunk; how many steps it had."""
        stepper, done = self.stepper, self.stepper.done
        stretch = self.schedule.stretch_at(done)
        size = self._look(min(pace.begin(), stretch.last - done))
        stepper.use_threads(two=pace.two)
        # Rows half renewed are no state to go on from.
        self.within = True
        try:
            stepper.advance(size, self.schedule, stretch.name)
        except AnalysisError as error:
            error.trajectory = self._trajectory(interrupted=True)
            raise
        self.within = False
        return stepper.done - done

    def _look(self, size: int) -> int:
        """Show the state to who looks on where it is time to; the steps from here to the next look, at most size."""
        if self.observe is None:
            return size
        done, every = self.stepper.done, self.observe.every
        past = (done - self.first_step) % every
        if past == 0:
            self.observe.see(done * self.stepper.scheme.step, self.stepper.velocity())
        return min(size, every - past)

    def _trajectory(self, *, interrupted: bool) -> Trajectory:
        """What has been computed so far, with the run it went on from."""
        stepper, settings, scheme = self.stepper, self.settings, self.stepper.scheme
        kept, every = stepper.recorded, settings.record_every
        start = -(-self.first_step // every)
        contacts, energies = stepper.record.contacts[:kept], stepper.record.energies[:kept]
        watched = stepper.record.watch[:kept].reshape(kept, len(settings.watch), stepper.system.dimension, 3)
        most_sweeps, unconverged = stepper.sweeps
        state = {name: np.array(values) for name, values in stepper.state().items()}
        new = Trajectory(
            time=(start + np.arange(kept)) * every * scheme.step,
            contact_names=tuple(stepper.contact_names),
            normal_force=contacts[:, :, 0],
            tangential_force=contacts[:, :, 1],
            slip_speed=contacts[:, :, 2],
            gap=contacts[:, :, 3],
            status=contacts[:, :, 4].astype(np.int8),  # as files have it
            watch_names=settings.watch,
            displacement=watched[..., 0],
            velocity=watched[..., 1],
            acceleration=watched[..., 2],
            kinetic=energies[:, 0],
            elastic=energies[:, 1],
            works={name: energies[:, 2 + column] for name, column in stepper.works.items()},
            phases=self.phases.all(stepper.done),
            step=scheme.step,
            beta2=scheme.beta2,
            record_every=every,
            steps=stepper.done,
            planned_steps=self.schedule.steps,
            path=stepper.path,
            path_reason="; ".join(filter(None, (stepper.reason, *self._told()))),
            remarks=self._told(),
            step_limit=stepper.limit.step,
            limiting_body=stepper.limit.body,
            most_sweeps=most_sweeps,
            unconverged_steps=unconverged,
            interrupted=interrupted,
            wall_seconds=self.wall,
            nodes=stepper.node_history(start),
            state=state | {"settings": settings_row(stepper, settings), "model": packed(stepper.parts)},
        )
        if self.restart is None:
            return new
        return joined(self.restart, new) if self.join else self.phases.new_part(self.restart, new)

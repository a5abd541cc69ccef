"""The temporal approach from a system and its phases to a trajectory."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ..errors import AnalysisError
from ..interrupts import Held, at_once, held
from ..sliding import slip_speeds
from ..system import System
from ..system.uncoupled import UncoupledModes
from ..threads import one_thread_if_small
from .beta2 import StepLimit, scheme, step_limit
from .inputs import check_inputs
from .kernel import NEW_ROWS, NOT_FINITE, OFF_LINE
from .layout import ENERGY_RECORD, Record
from .machine import Machine, modal_machine, nodal_machine
from .observe import Observer
from .phase_results import PhaseResults
from .schedule import PhaseSpec, Schedule, lay_out
from .settings import Settings, choose_path, choose_step, not_finite
from .stage import CONTACT_RECORD, DAMPING, EXTERNAL, FRICTION, NORMAL, SUPPORT
from .start import Disturbance, initial_state, joined, restore, saved_state, settings_of_restart, watch_rows
from .trajectory import Trajectory

CHUNK = 20_000
FIRST_CHUNK = 2_000
CHUNK_SECONDS = 0.5
Progress = Callable[[int, int], None]
Checkpoint = Callable[[Trajectory], None]
WORK_COLUMNS = {
    "damping": DAMPING,
    "friction": FRICTION,
    "contact": NORMAL,
    "external": EXTERNAL,
    "support": SUPPORT,
}


@one_thread_if_small
def simulate(
    system: System,
    phases: Sequence[PhaseSpec],
    settings: Settings | None = None,
    *,
    mu: float | None = None,
    progress: Progress | None = None,
    checkpoint: Checkpoint | None = None,
    checkpoint_seconds: float = 20.0,
    restart: Trajectory | None = None,
    join: bool = True,
    changed: bool = False,
    disturbance: Disturbance | None = None,
    observe: Observer | None = None,
) -> Trajectory:
    """March through the phases.

    mu scales every contact's friction law. progress(done, planned) is called between chunks, checkpoint
    with the trajectory so far at most every checkpoint_seconds. restart goes on from a trajectory of the
    same system and settings, with its step where the settings give none (``join`` False returns the new part
    alone; ``changed`` takes another system of the same freedoms and contacts as well). disturbance is added to the
    initial state, observe looks on between steps (assembled matrices only). Ctrl-C ends the run after the chunk of
    steps that is under way and keeps what was computed (``interrupted``); so does KeyboardInterrupt from progress
    or checkpoint. Raises CaseError for a step beyond the limit and for a restart that does not fit, AnalysisError where
    motion blows up or a slave leaves its master line; what was computed is then in the error's ``trajectory``.
    """
    settings = settings_of_restart(settings or Settings(), restart)
    system = settings.system(system)
    check_inputs(
        system,
        phases,
        step=settings.step,
        beta2=settings.beta2,
        record_every=settings.record_every,
        watch=settings.watch,
    )
    if system.assembled:
        from .assembled import simulate_assembled

        return simulate_assembled(
            system,
            phases,
            settings,
            mu=mu,
            progress=progress,
            checkpoint=checkpoint,
            checkpoint_seconds=checkpoint_seconds,
            restart=restart,
            join=join,
            changed=changed,
            disturbance=disturbance,
            observe=observe,
        )
    if observe is not None:
        raise ValueError("only runs on assembled matrices can be looked on at; watch points instead")
    if mu is not None:
        system = system.with_friction(mu, np.abs(slip_speeds(system, system.motion.full)))
    limit = step_limit(system, settings.beta2)
    coefficients = scheme(choose_step(limit, settings), settings.beta2)
    schedule = lay_out(phases, coefficients.step, list(system.loads), list(system.motion.names), system.motion.places)
    if settings.initial == "steady-sliding":
        schedule = schedule.settled()
    modes, reason = choose_path(system, settings)
    machine = modal_machine(system, coefficients, modes) if modes else nodal_machine(system, coefficients)
    run = _Run(machine, modes, schedule, settings, limit, reason, restart, join)
    if restart is None:
        initial_state(machine, modes, schedule, settings, disturbance)
    else:
        restore(machine, restart, settings, schedule, join=join, changed=changed)
        run.phases.resume(restart)
    return run.march(progress, checkpoint, checkpoint_seconds)


class _Run:
    """One march: buffers of records, statistics by phase, and the loop over chunks."""

    def __init__(
        self,
        machine: Machine,
        modes: UncoupledModes | None,
        schedule: Schedule,
        settings: Settings,
        limit: StepLimit,
        reason: str,
        restart: Trajectory | None,
        join: bool,
    ) -> None:
        self.machine, self.modes, self.schedule, self.settings = machine, modes, schedule, settings
        self.limit, self.reason, self.restart, self.join = limit, reason, restart, join
        contacts = machine.system.contacts
        names, kept = [c.name for c in contacts], [c.closed for c in contacts]
        self.phases = PhaseResults(schedule, names, machine.state.statistics, kept)
        self.wall = 0.0
        self.within = False

    def _buffers(self) -> Record:
        machine, settings = self.machine, self.settings
        first = int(machine.state.counters[0])
        every = settings.record_every
        count = (self.schedule.steps - 1) // every - (first - 1) // every
        rows, lift = watch_rows(machine, self.modes, settings.watch)
        count = max(count, 0)
        return Record(
            every=every,
            contacts=np.zeros((count, machine.contacts, CONTACT_RECORD)),
            watch=np.zeros((count, len(rows), 3)),
            energies=np.zeros((count, ENERGY_RECORD)),
            kept=np.zeros(1, dtype=np.int64),
            watch_rows=rows,
            watch_lift=lift,
        )

    def march(self, progress: Progress | None, checkpoint: Checkpoint | None, every_seconds: float) -> Trajectory:
        """Chunk by chunk to the end, or to where it is stopped."""
        self.record = self._buffers()
        with at_once():  # compiles the loop or loads it, before the clock starts
            self.machine.run(0, self.schedule, self.record)
        with held() as block:
            interrupted = self._loop(block, progress, checkpoint, every_seconds)
            result = self._trajectory(interrupted=interrupted)
            stopped = replace(result, interrupted=True)
            block.met = True; return stopped if block.asked else result  # noqa: E702 - nothing comes in between

    def _loop(
        self, block: Held, progress: Progress | None, checkpoint: Checkpoint | None, every_seconds: float
    ) -> bool:
        """The chunks; whether they were interrupted."""
        machine, schedule = self.machine, self.schedule
        started = last_saved = clock.perf_counter()
        size = FIRST_CHUNK
        try:
            started = last_saved = clock.perf_counter()
            while (done := int(machine.state.counters[0])) < schedule.steps and not block.asked:
                self.phases.begin(done)
                before = clock.perf_counter()
                taken = self._advance(min(size, CHUNK, schedule.stretch_at(done).last - done))
                now = clock.perf_counter()
                self.wall = now - started
                size = max(1, min(4 * size, int(taken * CHUNK_SECONDS / max(now - before, 1e-9))))
                if progress is not None:
                    progress(done + taken, schedule.steps)
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

    def _advance(self, size: int) -> int:
        """Up to ``size`` steps; how many were made."""
        machine = self.machine
        done = int(machine.state.counters[0])
        stretch = self.schedule.stretch_at(done)
        # Rows half renewed are no state to go on from.
        self.within = True
        _, code = machine.run(size, self.schedule, self.record)
        if code == NEW_ROWS:
            _follow_segments(machine)
        self.within = False
        if code in (NOT_FINITE, OFF_LINE):
            self._stop(code, stretch.name)
        if not (np.isfinite(machine.fields.u).all() and np.isfinite(machine.fields.q).all()):
            # Between records, or where no row sees it.
            self._stop(NOT_FINITE, stretch.name)
        return int(machine.state.counters[0]) - done

    def _stop(self, code: int, phase: str) -> None:
        at = int(self.machine.state.counters[0]) * self.machine.scheme.step
        if code == OFF_LINE:
            contact = self.machine.system.contacts[int(self.machine.state.counters[3])]
            message = (
                f"contact {contact.name}: the slave point left the master line over an end at t = {at:.6g} s "
                f"(phase {phase}); shorten the phase, slow the support down or lengthen the master"
            )
        else:
            message = not_finite(at, phase, self.machine.scheme.step)
        error = AnalysisError(message)
        error.trajectory = self._trajectory(interrupted=True)  # type: ignore[attr-defined]
        raise error

    def _trajectory(self, *, interrupted: bool) -> Trajectory:
        machine, settings = self.machine, self.settings
        done = int(machine.state.counters[0])
        kept = int(self.record.kept[0])
        every = settings.record_every
        start = -(-_first_step(self.restart) // every)
        contacts, watch = self.record.contacts[:kept], self.record.watch[:kept]
        energies = self.record.energies[:kept]
        size = len(settings.watch)
        shaped = watch.reshape(kept, size, 2, 3)
        new = Trajectory(
            time=(start + np.arange(kept)) * every * machine.scheme.step,
            contact_names=tuple(c.name for c in machine.system.contacts),
            normal_force=contacts[:, :, 0],
            tangential_force=contacts[:, :, 1],
            slip_speed=contacts[:, :, 2],
            gap=contacts[:, :, 3],
            status=contacts[:, :, 4].astype(np.int64),
            watch_names=settings.watch,
            displacement=shaped[..., 0],
            velocity=shaped[..., 1],
            acceleration=shaped[..., 2],
            kinetic=energies[:, 0],
            elastic=energies[:, 1],
            works={name: energies[:, 2 + column] for name, column in WORK_COLUMNS.items()},
            phases=self.phases.all(done),
            step=machine.scheme.step,
            beta2=machine.scheme.beta2,
            record_every=every,
            steps=done,
            planned_steps=self.schedule.steps,
            path=machine.path,
            path_reason=self.reason,
            step_limit=self.limit.step,
            limiting_body=self.limit.body,
            most_sweeps=int(machine.state.counters[1]),
            unconverged_steps=int(machine.state.counters[2]),
            interrupted=interrupted,
            wall_seconds=self.wall,
            state=saved_state(machine, settings),
        )
        if self.restart is None:
            return new
        return joined(self.restart, new) if self.join else self.phases.new_part(self.restart, new)


def _first_step(restart: Trajectory | None) -> int:
    return 0 if restart is None else restart.steps


def _follow_segments(machine: Machine) -> None:
    """Move finite-sliding contacts to the segment their slave has entered, and take its rows."""
    contacts, state = machine.table.contacts, machine.state
    for c in range(machine.contacts):
        if contacts.kind[c] == 0:
            continue
        start = int(contacts.nodes_at[c])
        count = int(contacts.nodes_at[c + 1]) - start
        segment, xi = int(state.segment[c]), float(state.xi[c])
        if xi < 0.0 and segment > 0:
            state.segment[c] = segment - 1
            state.xi[c] = 1.0 + xi * contacts.chords[start + segment] / contacts.chords[start + segment - 1]
        elif xi > 1.0 and segment < count - 2:
            state.segment[c] = segment + 1
            state.xi[c] = (xi - 1.0) * contacts.chords[start + segment] / contacts.chords[start + segment + 1]
    machine.repack()
    machine.predict()

"""The temporal approach on assembled matrices, from a system and its phases to a trajectory."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NoReturn

import numpy as np

from ...contact.nodes import ContactNodes
from ...errors import AnalysisError
from ...interrupts import Held, at_once, held
from ...system import System
from ...typing import Array
from ..beta2 import StepLimit, scheme
from ..inputs import check_inputs, unfit_in_time
from ..observe import Observer
from ..phase_results import PhaseResults
from ..schedule import PhaseSpec, Schedule, lay_out
from ..settings import Settings, choose_step, not_finite
from ..sketch import Part, packed, sketch
from ..start import Disturbance, settings_of_restart
from ..trajectory import Trajectory
from .limit import step_limit_assembled
from .loop import NOT_FINITE
from .machine import Machine, assembled_machine, diagonal_mass
from .pace import Pace
from .renewal import node_distances, renew, slides_finitely, steps_to_renewal, take_over
from .results import buffers, trajectory
from .start import begin, check_restart, joined_runs, restore, saved_state, take_changes

TOLD_SECONDS = 0.5
Progress = Callable[[int, int], None]
Checkpoint = Callable[[Trajectory], None]


def simulate_assembled(
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
    """March a system of assembled matrices through its phases.

    mu scales every contact's friction law at its slip speed. progress(done, planned) is called about every second,
    checkpoint with the trajectory so far at most every checkpoint_seconds. restart goes on from a trajectory of the
    same system and settings, to the last digit as if it had not been cut (``join`` False returns the new part alone;
    ``changed`` takes another system of the same freedoms and contacts as well). disturbance (u, v, a) is added to the
    initial state, observe looks on between steps. Ctrl-C ends the run after the chunk of steps that is under way and
    keeps what was computed (``interrupted``); so does KeyboardInterrupt from progress or checkpoint. Raises CaseError
    for a mass that is not lumped, a step beyond the limit or a restart that does not fit, AnalysisError where motion
    blows up or a slave node leaves its master; what was computed is then in the error's ``trajectory``.
    """
    settings = settings_of_restart(settings or Settings(), restart)
    check_inputs(
        system,
        phases,
        step=settings.step,
        beta2=settings.beta2,
        record_every=settings.record_every,
        watch=settings.watch,
    )
    if system.general and (why := unfit_in_time(system)):
        raise AnalysisError(why)
    diagonal_mass(system)
    nodes = system.contact_nodes()
    if mu is not None:
        nodes = with_friction(nodes, mu, system.motion.full)
    limit = step_limit_assembled(system, settings.beta2)
    coefficients = scheme(choose_step(limit, settings), settings.beta2)
    schedule = lay_out(phases, coefficients.step, list(system.loads), list(system.motion.names), system.motion.places)
    if settings.initial == "steady-sliding":
        schedule = schedule.settled()
    machine = assembled_machine(system, coefficients, nodes)
    run = _Run(machine, schedule, settings, limit, restart, join, sketch(system, nodes), observe)
    if restart is None:
        begin(machine, schedule, settings, mu, disturbance)
    else:
        run.resume(restart, changed=changed)
    return run.march(progress, checkpoint, checkpoint_seconds)


def with_friction(nodes: ContactNodes, mu: float, factors: Array) -> ContactNodes:
    """The same nodes with every contact's law scaled so that it gives ``mu`` at its mean slip speed, with the
    motions at these factors (p,)."""
    speed = np.linalg.norm(nodes.slip_velocity(factors), axis=1)
    laws = tuple(
        law.scaled(mu, float(speed[nodes.owner == k].mean() if np.any(nodes.owner == k) else 0.0))
        for k, law in enumerate(nodes.laws)
    )
    return replace(nodes, laws=laws)


class _Run:
    """One march: buffers of records, statistics by phase, renewals of the rows, and the loop over chunks."""

    def __init__(
        self,
        machine: Machine,
        schedule: Schedule,
        settings: Settings,
        limit: StepLimit,
        restart: Trajectory | None,
        join: bool,
        parts: tuple[Part, ...],
        observe: Observer | None = None,
    ) -> None:
        self.machine, self.schedule, self.settings, self.limit = machine, schedule, settings, limit
        self.restart, self.join, self.parts, self.observe = restart, join, parts, observe
        self.phases = PhaseResults(schedule, machine.nodes.names, machine.state.statistics, machine.nodes.closed)
        self.wall = 0.0
        self.within = False
        self.finite = slides_finitely(machine.system)
        self.distances = node_distances(machine.system) if self.finite else np.zeros(0)
        # Finite sliding finds its rows at the first step.
        self.renewal = 0 if self.finite else schedule.steps
        self.interval = 1
        self.renewed_at = np.zeros(machine.system.size + len(machine.system.motion.names))

    def resume(self, restart: Trajectory, *, changed: bool) -> None:
        """Take up the state of another run. Raises CaseError where it does not fit."""
        check_restart(self.machine, restart, self.settings, self.parts, join=self.join, changed=changed)
        if self.finite:
            # Rows as they were last found: first at that displacement, then the state itself.
            self.renewed_at[:] = restart.state["renewed_at"]
            n = self.machine.system.size
            self.machine.fields.u[self.machine.layout.place] = self.renewed_at[:n]
            self.machine.state.motion[0] = self.renewed_at[n:]
            surfaces, nodes, _ = renew(self.machine, self.machine.surfaces)
            take_over(self.machine, surfaces, nodes)
            self.renewal, self.interval = (int(v) for v in restart.state["renewal"])
        restore(self.machine, restart)
        if changed:
            self.renewed_at[self.machine.system.size :] /= take_changes(self.machine, restart, self.parts)
        self.phases.resume(restart)

    def march(self, progress: Progress | None, checkpoint: Checkpoint | None, every_seconds: float) -> Trajectory:
        """Chunk by chunk to the end, or to where it is stopped."""
        self.first_step = self.machine.done
        self.record = buffers(self.machine, self.schedule, self.settings)
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
        started = last_saved = last_told = clock.perf_counter()
        pace = Pace(machine.threaded)
        try:
            started = last_saved = last_told = clock.perf_counter()
            while machine.done < schedule.steps and not block.asked:
                self.phases.begin(machine.done)
                before = clock.perf_counter()
                size = self._advance(pace)
                now = clock.perf_counter()
                self.wall = now - started
                pace.end(size, now - before)
                if progress is not None and (now - last_told > TOLD_SECONDS or machine.done == schedule.steps):
                    progress(machine.done, schedule.steps)
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

    def _look(self, size: int) -> int:
        """Show the state to who looks on where it is time to; the steps from here to the next look, at most size."""
        if self.observe is None:
            return size
        machine, every = self.machine, self.observe.every
        past = (machine.done - self.first_step) % every
        if past == 0:
            self.observe.see(machine.done * machine.scheme.step, machine.fields.q[machine.layout.place])
        return min(size, every - past)

    def _advance(self, pace: Pace) -> int:
        """One chunk, on rows renewed where that is due; how many steps it had."""
        machine = self.machine
        stretch = self.schedule.stretch_at(machine.done)
        # Rows half renewed are no state to go on from.
        self.within = True
        if self.finite and machine.done >= self.renewal:
            self._renew()
        size = min(pace.begin(), stretch.last - machine.done)
        if self.finite:
            size = min(size, self.renewal - machine.done)
        size = self._look(size)
        machine.use_threads(two=pace.two)
        _, code = machine.run(size, self.schedule, self.record)
        self.within = False
        fields = machine.fields
        if code == NOT_FINITE or not np.isfinite(fields.u.sum() + fields.q.sum()):
            at = machine.done * machine.scheme.step
            self._stop(not_finite(at, stretch.name, machine.scheme.step))
        return size

    def _renew(self) -> None:
        machine = self.machine
        surfaces, nodes, lost = renew(machine, machine.surfaces)
        if len(lost):
            at = machine.done * machine.scheme.step
            contact = machine.nodes.names[int(machine.nodes.owner[lost[0]])]
            place = ", ".join(f"{v:.6g}" for v in machine.nodes.position[lost[0]])
            self._stop(
                f"contact {contact}: the slave node at ({place}) left the master surface over an edge at t = {at:.6g} "
                f"s (phase {self.schedule.stretch_at(machine.done).name}); shorten the phase, slow the support down "
                "or make the master larger"
            )
        take_over(machine, surfaces, nodes)
        self.interval = steps_to_renewal(machine, self.distances, self.interval)
        self.renewal = machine.done + self.interval
        self.renewed_at[:] = np.concatenate([machine.displacement, machine.state.motion[0]])

    def _stop(self, message: str) -> NoReturn:
        error = AnalysisError(message)
        error.trajectory = self._trajectory(interrupted=True)  # type: ignore[attr-defined]
        raise error

    def _state(self) -> dict[str, Array]:
        renewal = (self.renewal, self.interval, self.renewed_at)
        return saved_state(self.machine, self.settings, renewal, packed(self.parts))

    def _trajectory(self, *, interrupted: bool) -> Trajectory:
        machine = self.machine
        new = trajectory(
            machine,
            self.schedule,
            self.settings,
            self.limit,
            self.record,
            first_step=self.first_step,
            phases=self.phases.all(machine.done),
            interrupted=interrupted,
            wall_seconds=self.wall,
            reason=self._reason(),
            state=self._state(),
        )
        if self.restart is None:
            return new
        return joined_runs(self.restart, new) if self.join else self.phases.new_part(self.restart, new)

    def _reason(self) -> str:
        system = self.machine.system
        if system.general:
            return "matrices that are not symmetric: assembled matrices with lumped mass"
        if system.surfaces:
            return "contact over surfaces: assembled matrices with lumped mass"
        if system.cubic is not None:
            return "cubic springs: assembled matrices with lumped mass"
        return f"{system.size} freedoms are too many for a complete modal basis: assembled matrices with lumped mass"

"""The temporal approach on assembled matrices, from a system and its phases to a trajectory."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NoReturn

import numpy as np

from ...contact.nodes import ContactNodes
from ...errors import AnalysisError
from ...system import System
from ...typing import Array
from ..beta2 import StepLimit, scheme
from ..inputs import check_inputs
from ..observe import Observer
from ..schedule import PhaseSpec, Schedule, lay_out
from ..settings import Settings, choose_step
from ..start import Disturbance
from ..trajectory import PhaseResult, Trajectory
from .limit import step_limit_assembled
from .loop import NOT_FINITE
from .machine import Machine, assembled_machine, diagonal_mass
from .pace import Pace
from .renewal import node_distances, renew, slides_finitely, steps_to_renewal, take_over
from .results import buffers, clear_statistics, phase_result, trajectory
from .start import begin, check_restart, joined_runs, restore, saved_state

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
    disturbance: Disturbance | None = None,
    observe: Observer | None = None,
) -> Trajectory:
    """March a system of assembled matrices through its phases.

    mu scales every contact's friction law at its slip speed. progress(done, planned) is called about every second,
    checkpoint with the trajectory so far at most every checkpoint_seconds. restart goes on from a trajectory of the
    same system and settings, to the last digit as if it had not been cut (``join`` False returns the new part alone).
    disturbance (u, v, a) is added to the initial state. observe looks on between steps. KeyboardInterrupt ends the run
    and keeps what was computed (``interrupted``). Raises CaseError for a mass that is not lumped or a step beyond the
    limit, AnalysisError where motion blows up or a slave node leaves its master; what was computed is then in the
    error's ``trajectory``.
    """
    settings = settings or Settings()
    check_inputs(
        system,
        phases,
        step=settings.step,
        beta2=settings.beta2,
        record_every=settings.record_every,
        watch=settings.watch,
    )
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
    run = _Run(machine, schedule, settings, limit, restart, join, observe)
    if restart is None:
        begin(machine, schedule, settings, mu, disturbance)
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
        observe: Observer | None = None,
    ) -> None:
        self.machine, self.schedule, self.settings, self.limit = machine, schedule, settings, limit
        self.restart, self.join, self.observe = restart, join, observe
        self.phases: list[PhaseResult] = []
        self.wall = 0.0
        self.finite = slides_finitely(machine.system)
        self.distances = node_distances(machine.system) if self.finite else np.zeros(0)
        # Finite sliding finds its rows at the first step.
        self.renewal = 0 if self.finite else schedule.steps
        self.interval = 1
        self.renewed_at = np.zeros(machine.system.size + len(machine.system.motion.names))
        if restart is not None:
            self._resume(restart)
        self.first_step = machine.done
        self.record = buffers(machine, schedule, settings)

    def _resume(self, restart: Trajectory) -> None:
        check_restart(self.machine, restart, self.settings, join=self.join)
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

    def march(self, progress: Progress | None, checkpoint: Checkpoint | None, every_seconds: float) -> Trajectory:
        """Chunk by chunk to the end, or to where it is stopped."""
        started = last_saved = last_told = clock.perf_counter()
        machine, schedule = self.machine, self.schedule
        interrupted = False
        pace = Pace(machine.threaded)
        try:
            machine.run(0, schedule, self.record)  # compiles the loop or loads it, before the clock starts
            started = last_saved = last_told = clock.perf_counter()
            while machine.done < schedule.steps:
                if self.finite and machine.done >= self.renewal:
                    self._renew()
                size = min(pace.begin(), schedule.stretch_at(machine.done).last - machine.done)
                if self.finite:
                    size = min(size, self.renewal - machine.done)
                size = self._look(size)
                machine.use_threads(two=pace.two)
                before = clock.perf_counter()
                self._advance(size)
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
            interrupted = True
        self.wall = clock.perf_counter() - started
        return self._trajectory(interrupted=interrupted)

    def _look(self, size: int) -> int:
        """Show the state to who looks on where it is time to; the steps from here to the next look, at most size."""
        if self.observe is None:
            return size
        machine, every = self.machine, self.observe.every
        past = (machine.done - self.first_step) % every
        if past == 0:
            self.observe.see(machine.done * machine.scheme.step, machine.fields.q[machine.layout.place])
        return min(size, every - past)

    def _advance(self, size: int) -> None:
        machine = self.machine
        stretch = self.schedule.stretch_at(machine.done)
        _, code = machine.run(size, self.schedule, self.record)
        fields = machine.fields
        if code == NOT_FINITE or not np.isfinite(fields.u.sum() + fields.q.sum()):
            at = machine.done * machine.scheme.step
            self._stop(
                f"the motion is no longer finite at t = {at:.6g} s (phase {stretch.name}): the step "
                f"{machine.scheme.step:g} s is too large for this model or a load is absurd"
            )
        if machine.done >= stretch.last:
            self.phases.append(phase_result(machine, stretch.name, stretch.first, machine.done))
            clear_statistics(machine)

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
        return saved_state(self.machine, self.settings, (self.renewal, self.interval, self.renewed_at))

    def _trajectory(self, *, interrupted: bool) -> Trajectory:
        machine = self.machine
        phases = list(self.phases)
        if interrupted and machine.done < self.schedule.steps:
            stretch = self.schedule.stretch_at(machine.done)
            phases.append(phase_result(machine, stretch.name, stretch.first, machine.done))
        new = trajectory(
            machine,
            self.schedule,
            self.settings,
            self.limit,
            self.record,
            first_step=self.first_step,
            phases=tuple(phases),
            interrupted=interrupted,
            wall_seconds=self.wall,
            reason=self._reason(),
            state=self._state(),
        )
        return new if self.restart is None or not self.join else joined_runs(self.restart, new)

    def _reason(self) -> str:
        system = self.machine.system
        if system.surfaces:
            return "contact over surfaces: assembled matrices with lumped mass"
        if system.cubic is not None:
            return "cubic springs: assembled matrices with lumped mass"
        return f"{system.size} freedoms are too many for a complete modal basis: assembled matrices with lumped mass"

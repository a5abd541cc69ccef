"""The temporal approach from a system and its phases to a trajectory."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from ..errors import AnalysisError, CaseError
from ..sliding import slip_speeds, steady_sliding
from ..system import System
from ..system.uncoupled import UncoupledModes, uncoupled_modes
from ..threads import one_thread_if_small
from ..typing import Array
from .beta2 import Scheme, StepLimit, scheme, step_limit
from .inputs import check_inputs
from .kernel import ENERGY_RECORD, NEW_ROWS, NOT_FINITE, OFF_LINE, Record
from .machine import MODAL_LIMIT, Machine, modal_machine, nodal_machine
from .schedule import PhaseSpec, Schedule, lay_out
from .stage import (
    CONTACT_RECORD,
    DAMPING,
    EXTERNAL,
    FIRST_OPEN,
    FIRST_STICK,
    FRICTION,
    MAX_NORMAL,
    MAX_SPEED,
    MAX_TANGENTIAL,
    NORMAL,
    OPEN_STEPS,
    SLIP_STEPS,
    STICK_STEPS,
    SUPPORT,
)
from .trajectory import ContactStatistics, PhaseResult, Trajectory

CHUNK = 20_000
WORK_COLUMNS = {
    "damping": DAMPING,
    "friction": FRICTION,
    "contact": NORMAL,
    "external": EXTERNAL,
    "support": SUPPORT,
}
SAFE_FRACTION = 0.9
STATE_FIELDS = ("u", "q", "d", "constant", "coefficients")


@dataclass(frozen=True)
class Settings:
    """How to march: step Δt [s] (None: 0.9 of the limit), β2 in [0.5, 1], steps between records, path,
    initial state, perturbation [m/s] of the slip speed (steady sliding only), watched points."""

    step: float | None = None
    beta2: float = 0.5
    record_every: int = 50
    path: Literal["auto", "modal", "nodal"] = "auto"
    initial: Literal["rest", "steady-sliding"] = "rest"
    perturbation: float = 0.0
    watch: tuple[str, ...] = ()


Progress = Callable[[int, int], None]
# Displacement, velocity and acceleration (n,) added to the initial state.
Disturbance = tuple[Array, Array, Array]
Checkpoint = Callable[[Trajectory], None]


def choose_step(limit: StepLimit, settings: Settings) -> float:
    """Δt [s] within the limit; raises CaseError for a step beyond it."""
    if settings.step is None:
        if not np.isfinite(limit.step):
            raise CaseError("temporal.step", None, "nothing in the system oscillates, so no step follows; give one")
        return SAFE_FRACTION * limit.step
    if settings.step > limit.step:
        raise CaseError(
            "temporal.step",
            settings.step,
            f"the explicit scheme is unstable beyond {limit.step:.4g} s, set by {limit.body}; take a smaller "
            'step, coarser elements or mass = "lumped"',
        )
    return settings.step


def choose_path(system: System, settings: Settings) -> tuple[UncoupledModes | None, str]:
    """Complete modal basis where it is exact and affordable, else None; and the reason in words."""
    if settings.path == "nodal":
        return None, "asked for"
    largest = max(len(part) for part in system.components)
    if settings.path == "auto" and system.size > MODAL_LIMIT:
        return None, f"{system.size} freedoms are too many for a complete modal basis"
    if largest > MODAL_LIMIT:
        raise CaseError("temporal.path", "modal", f"a body of {largest} freedoms is too large; take nodal")
    modes = uncoupled_modes(system)
    if modes.proportional:
        return modes, "complete modal basis: damping is proportional in every component, the scheme is the same"
    if settings.path == "modal":
        raise CaseError(
            "temporal.path", "modal", "damping is not proportional, so modes stay coupled; take nodal or auto"
        )
    return None, "damping is not proportional in every component"


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
    disturbance: Disturbance | None = None,
) -> Trajectory:
    """March through the phases.

    mu scales every contact's friction law. progress(done, planned) is called between chunks, checkpoint
    with the trajectory so far at most every checkpoint_seconds. restart goes on from a trajectory of the
    same system and settings (``join`` False returns the new part alone). disturbance is added to the initial
    state. KeyboardInterrupt ends the run early and keeps what was computed
    (``interrupted``). Raises CaseError for a step beyond the limit, AnalysisError where motion blows up
    or a slave leaves its master line; what was computed is then in the error's ``trajectory``.
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
    if mu is not None:
        system = system.with_friction(mu, np.abs(slip_speeds(system, np.ones(len(system.motion.names)))))
    limit = step_limit(system, settings.beta2)
    coefficients = scheme(choose_step(limit, settings), settings.beta2)
    schedule = lay_out(phases, coefficients.step, list(system.loads), list(system.motion.names))
    modes, reason = choose_path(system, settings)
    machine = modal_machine(system, coefficients, modes) if modes else nodal_machine(system, coefficients)
    run = _Run(machine, modes, schedule, settings, limit, reason, restart, join, disturbance)
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
        disturbance: Disturbance | None = None,
    ) -> None:
        self.machine, self.modes, self.schedule, self.settings = machine, modes, schedule, settings
        self.limit, self.reason, self.restart, self.join = limit, reason, restart, join
        self.phases: list[PhaseResult] = []
        if restart is None:
            _initial_state(machine, modes, schedule, settings, disturbance)
        else:
            _restore(machine, restart, settings, join=join)
        self.record = self._buffers()
        self.wall = 0.0

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
        started = last_saved = clock.perf_counter()
        machine, schedule = self.machine, self.schedule
        interrupted = False
        try:
            while (done := int(machine.state.counters[0])) < schedule.steps:
                stretch = schedule.stretch_at(done)
                size = min(CHUNK, stretch.last - done)
                _, code = machine.run(size, schedule, self.record)
                done = int(machine.state.counters[0])
                self.wall = clock.perf_counter() - started
                if code == NEW_ROWS:
                    _follow_segments(machine)
                elif code in (NOT_FINITE, OFF_LINE):
                    self._stop(code, stretch.name)
                if not (np.isfinite(machine.fields.u).all() and np.isfinite(machine.fields.q).all()):
                    # Between records, or where no row sees it.
                    self._stop(NOT_FINITE, stretch.name)
                if done >= stretch.last:
                    self._close_phase(stretch.name, stretch.first, done)
                if progress is not None:
                    progress(done, schedule.steps)
                if checkpoint is not None and clock.perf_counter() - last_saved > every_seconds:
                    checkpoint(self._trajectory(interrupted=True))
                    last_saved = clock.perf_counter()
        except KeyboardInterrupt:
            interrupted = True
        self.wall = clock.perf_counter() - started
        return self._trajectory(interrupted=interrupted)

    def _stop(self, code: int, phase: str) -> None:
        at = int(self.machine.state.counters[0]) * self.machine.scheme.step
        if code == OFF_LINE:
            contact = self.machine.system.contacts[int(self.machine.state.counters[3])]
            message = (
                f"contact {contact.name}: the slave point left the master line over an end at t = {at:.6g} s "
                f"(phase {phase}); shorten the phase, slow the support down or lengthen the master"
            )
        else:
            message = (
                f"the motion is no longer finite at t = {at:.6g} s (phase {phase}): the step "
                f"{self.machine.scheme.step:g} s is too large for this model or a load is absurd"
            )
        error = AnalysisError(message)
        error.trajectory = self._trajectory(interrupted=True)  # type: ignore[attr-defined]
        raise error

    def _close_phase(self, name: str, first: int, last: int) -> None:
        self.phases.append(self._phase(name, first, last))
        statistics = self.machine.state.statistics
        statistics[:] = 0.0
        statistics[:, [FIRST_STICK, FIRST_OPEN]] = -1.0

    def _phase(self, name: str, first: int, last: int) -> PhaseResult:
        dt = self.machine.scheme.step
        contacts: dict[str, ContactStatistics] = {}
        for contact, row in zip(self.machine.system.contacts, self.machine.state.statistics, strict=True):
            total = max(row[STICK_STEPS] + row[SLIP_STEPS] + row[OPEN_STEPS], 1.0)
            contacts[contact.name] = ContactStatistics(
                stick_fraction=float(row[STICK_STEPS] / total),
                slip_fraction=float(row[SLIP_STEPS] / total),
                separation_fraction=float(row[OPEN_STEPS] / total),
                max_normal_force=float(row[MAX_NORMAL]),
                max_tangential_force=float(row[MAX_TANGENTIAL]),
                max_slip_speed=float(row[MAX_SPEED]),
                first_stick=float(row[FIRST_STICK] * dt) if row[FIRST_STICK] >= 0 else None,
                first_separation=float(row[FIRST_OPEN] * dt) if row[FIRST_OPEN] >= 0 else None,
            )
        return PhaseResult(name, first * dt, last * dt, contacts)

    def _trajectory(self, *, interrupted: bool) -> Trajectory:
        machine, settings = self.machine, self.settings
        done = int(machine.state.counters[0])
        phases = list(self.phases)
        if interrupted and done < self.schedule.steps:
            stretch = self.schedule.stretch_at(done)
            phases.append(self._phase(stretch.name, stretch.first, done))
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
            phases=tuple(phases),
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
            state=_saved(machine, settings),
        )
        return new if self.restart is None or not self.join else _joined(self.restart, new)


def _first_step(restart: Trajectory | None) -> int:
    return 0 if restart is None else restart.steps


def watch_rows(machine: Machine, modes: UncoupledModes | None, names: Sequence[str]) -> tuple[Array, Array]:
    """Rows (2w, n) in the path's coordinates and lift (2w, p) of watched points' x and y."""
    system = machine.system
    rows = [system.points[name].free[:2].toarray() for name in names]
    lift = [system.points[name].lift[:2] for name in names]
    free = np.vstack([np.zeros((0, system.size)), *rows])
    inner = free if modes is None else modes.project(free)[0]
    return np.ascontiguousarray(machine.laid_out(inner)), np.vstack([np.zeros((0, machine.table.motions)), *lift])


def _initial_state(
    machine: Machine,
    modes: UncoupledModes | None,
    schedule: Schedule,
    settings: Settings,
    disturbance: Disturbance | None = None,
) -> None:
    system, fields, state = machine.system, machine.fields, machine.state
    if settings.initial == "steady-sliding":
        stretch = schedule.stretches[0]
        # The loop's contacts are rigid whatever K_c the modal approach uses: an equilibrium that rests on
        # the spring would start with a penetration, and undoing it in one step is a blow.
        rigid = replace(system, contacts=tuple(replace(c, stiffness=np.inf) for c in system.contacts))
        steady = steady_sliding(
            rigid,
            load_factors=dict(zip(system.loads, stretch.loads_after, strict=True)),
            motion_factors=stretch.velocities_after,
        )
        velocity = np.zeros(system.size)
        for contact in system.contacts:
            velocity += settings.perturbation * _slip_impulse(system, contact.tangent_row)
        fields.u[:] = machine.coordinates(steady.displacement, modes)
        fields.q[:] = machine.coordinates(velocity, modes)
        state.motion[1] = stretch.velocities_after
        state.status[:] = np.where(steady.active, 2, 0)
        if stretch.ramp_steps:
            raise CaseError("phases.0.ramp", stretch.ramp_steps * schedule.step, "0 when starting from steady sliding")
    if disturbance is not None:
        displacement, velocity, acceleration = disturbance
        # q_0 = v_0 − β2 Δt a_0 starts the scheme without a jump (docs/theory-temporal.md).
        rate = velocity - machine.scheme.beta2 * machine.scheme.step * acceleration
        fields.u[:] += machine.coordinates(displacement, modes)
        fields.q[:] += machine.coordinates(rate, modes)
    machine.repack()
    coefficients = _start_coefficients(machine, schedule)
    machine.free_increment(coefficients)
    machine.predict()


def _slip_impulse(system: System, tangent_row: Array) -> Array:
    """Velocity (n,) that an impulse along a contact's tangent gives, one unit of slip speed."""
    import scipy.sparse as sp
    import scipy.sparse.linalg as spl

    answer = spl.splu(sp.csc_array(system.mass)).solve(tangent_row)
    return answer / float(tangent_row @ answer)


def _start_coefficients(machine: Machine, schedule: Schedule) -> Array:
    """Forcing coefficients of step 0: loads, −a and −v of the supports."""
    scheme: Scheme = machine.scheme
    rate = schedule.motion_increments(0, 1)[0] / scheme.step
    before = machine.state.motion[1]
    rate = np.where(np.abs(rate - before) <= 1e-13 * np.abs(before), before, rate)
    acceleration = -2.0 * (rate - before) / (scheme.step * scheme.s)
    velocity = -(before + 2.0 * scheme.beta2 * rate) / scheme.s
    return np.concatenate([schedule.load_factors(0, 1)[0], acceleration, velocity])


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


def _saved(machine: Machine, settings: Settings) -> dict[str, Array]:
    """Everything a restart needs, as arrays."""
    saved = {f"field_{name}": getattr(machine.fields, name).copy() for name in STATE_FIELDS}
    for name in machine.state._fields:
        saved[f"state_{name}"] = np.array(getattr(machine.state, name))
    saved["settings"] = np.array([machine.scheme.step, machine.scheme.beta2, float(settings.record_every)])
    saved["model"] = _model_numbers(machine.system)
    return saved


def _model_numbers(system: System) -> Array:
    """A few numbers by which two models differ: freedoms, contacts, traces of M, C and K."""
    traces = [float(matrix.trace()) for matrix in (system.mass, system.damping, system.stiffness)]
    return np.array([float(system.size), float(len(system.contacts)), *traces])


def _restore(machine: Machine, restart: Trajectory, settings: Settings, *, join: bool) -> None:
    given, own = restart.state.get("settings"), np.array([machine.scheme.step, machine.scheme.beta2])
    if given is None or restart.path != machine.path or not np.array_equal(given[:2], own):
        raise CaseError(
            "restart",
            f"step {restart.step:g} s, beta2 {restart.beta2:g}, path {restart.path}",
            f"a state of the same scheme: step {own[0]:g} s, beta2 {own[1]:g}, path {machine.path}",
        )
    # Padded modes can have the same shape in different models.
    if not np.allclose(restart.state.get("model", np.zeros(5)), _model_numbers(machine.system), rtol=1e-9, atol=0):
        raise CaseError("restart", "model", "a state of the same model: this one has other freedoms or contacts")
    if join and (restart.record_every != settings.record_every or restart.watch_names != settings.watch):
        raise CaseError(
            "restart",
            f"a record every {restart.record_every} steps of {', '.join(restart.watch_names) or 'no points'}",
            f"the same records as before (here every {settings.record_every} steps of "
            f"{', '.join(settings.watch) or 'no points'}), or join=False",
        )
    pairs: list[tuple[Any, str, str]] = [(machine.fields, name, f"field_{name}") for name in STATE_FIELDS]
    pairs += [(machine.state, name, f"state_{name}") for name in machine.state._fields]
    for target, name, key in pairs:
        array = getattr(target, name)
        if key not in restart.state or restart.state[key].shape != array.shape:
            raise CaseError("restart", key, "a state of the same model: this one has other freedoms or contacts")
        array[:] = restart.state[key]
    kept = {name: getattr(machine.state, name).copy() for name in ("predicted", "value", "rate")}
    machine.repack()
    for name, values in kept.items():
        getattr(machine.state, name)[:] = values


def _joined(before: Trajectory, after: Trajectory) -> Trajectory:
    """Records of a restarted run behind those of the run it went on from."""
    together = {
        name: np.concatenate([getattr(before, name), getattr(after, name)])
        for name in (
            "time",
            "normal_force",
            "tangential_force",
            "slip_speed",
            "gap",
            "status",
            "displacement",
            "velocity",
            "acceleration",
            "kinetic",
            "elastic",
        )
    }
    works = {name: np.concatenate([before.works[name], after.works[name]]) for name in after.works}
    # A phase that the interruption cut is counted on: the saved statistics went on in the second run.
    finished = [p for p in before.phases if not any(q.name == p.name for q in after.phases)]
    return replace(
        after,
        **together,
        works=works,
        phases=(*finished, *after.phases),
        wall_seconds=before.wall_seconds + after.wall_seconds,
    )

"""The implicit stepper: see `temporal.stepper.Stepper`."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp

from ....contact.multipliers import OPEN
from ....contact.nodes import ContactNodes
from ....errors import AnalysisError, CaseError
from ....sliding.solution import steady_sliding
from ....system import System
from ....typing import Array
from ...beta2 import StepLimit, scheme
from ...columns import ENERGY_RECORD, WORK_COLUMNS
from ...node_history import NodeHistory
from ...restart import motion_ratio
from ...saved import INFINITY, STATUS_RANGE, Bounds
from ...schedule import PhaseSpec, Schedule
from ...settings import Settings, not_finite
from ...sketch import sketch
from ...stepper import Disturbance
from ...trajectory import Trajectory
from ..coordinates import COMPLETE, Coordinates, coordinates, pushed_at, rows_of
from ..starting import OVERLAP
from .arrays import BY_NEWTON, DONE, KEPT, MOST_SWEEPS, NODES_KEPT, UNCONVERGED, Nodes, Record, StepState, Structure
from .build import fresh_state, nodes_of, structure_of, work_space
from .loop import HARD, NOT_FINITE, run_steps
from .newton import newton
from .node_law import SWEEP_LIMIT, solve_nodes

COARSEST = 1 / np.pi  # of a period: up to there the warp holds its frequency
ROUGH = 1 / 15  # of a period: above it that is said, as events are located to a step
FITS = 1e-6  # of a phase: what a step that is chosen may leave of it
STEPS_PER_PERIOD = 30  # of the highest frequency asked for, where no step is given
BEYOND = 2.0  # times that frequency: the modes of the structure that a large model is reduced to
MOST_ROWS = 4000  # of contact: normal and tangents of each node
NODE_HISTORY_BYTES = 500e6
CONTACT_COLUMNS = 5
TOLD_FROM = 1e-3  # of the initial state: what is left out of it is said from there on


def why_not_implicit(system: System, settings: Settings) -> str:
    """Why it does not take a system; "" where it does."""
    if system.not_symmetric_definite:
        return system.not_symmetric_definite
    if system.contact_cubic:
        return f"contact {next(iter(system.contact_cubic))} has a cubic part of its stiffness"
    if system.cubic is not None:
        return "there are cubic springs"
    if system.finitely_sliding:
        return f"contact {system.finitely_sliding[0]} slides finitely, so that its rows move"
    nodes = system.contact_nodes()
    count = nodes.count * (nodes.directions + 1)
    if count > MOST_ROWS:
        return f"{nodes.count} contact nodes are too many: {count} rows, up to {MOST_ROWS}"
    if system.size > COMPLETE and settings.max_frequency_hz is None:
        return f"{system.size} freedoms are to be reduced, and modal.max_frequency_hz does not say up to where"
    return ""


def refuse(system: System, settings: Settings) -> None:
    """Raise CaseError for a system that it does not take."""
    if why := why_not_implicit(system, settings):
        raise CaseError("temporal.stepper", "implicit", f'no such system: {why}; take "explicit"')


def whole_steps(settings: Settings, phases: Sequence[PhaseSpec]) -> float:
    """The step [s]: the one that is given, else a part of the shortest period asked for of which the shortest phase is
    a multiple. Raises CaseError where neither a step nor a frequency is given."""
    highest = settings.max_frequency_hz
    if settings.step is not None:
        if highest is not None and settings.step * highest > COARSEST:
            raise CaseError(
                "temporal.step", settings.step,
                f"at most {COARSEST / highest:.4g} s, a third of the shortest period of interest, which a coarser one "
                f"shows at another frequency (modal.max_frequency_hz = {highest:g})",
            )  # fmt: skip
        return settings.step
    if highest is None:
        raise CaseError("temporal.step", None, "missing – a step [s], or modal.max_frequency_hz, from which it follows")
    wanted = 1.0 / (STEPS_PER_PERIOD * highest)
    shortest = min((phase.duration for phase in phases), default=wanted)
    least = max(round(shortest / wanted), 1)
    for count in range(least, 4 * least + 1):
        steps = [phase.duration * count / shortest for phase in phases]
        if all(abs(n - round(n)) <= FITS * n for n in steps):
            return shortest / count
    return shortest / least  # of which some phase is no multiple: refused with its name


def implicit_stepper(system: System, settings: Settings, mu: float | None, why: str) -> ImplicitStepper:
    """A system made ready, and why this way; mu scales every contact's friction law at its slip speed. Raises CaseError
    for a system that it does not take."""
    refuse(system, settings)
    system = system.at_friction(mu)
    return ImplicitStepper(system, system.contact_nodes(), settings, why)


class ImplicitStepper:
    """See `temporal.stepper.Stepper`."""

    threaded = False
    path = "implicit"
    works = WORK_COLUMNS

    def __init__(self, system: System, nodes: ContactNodes, settings: Settings, why: str) -> None:
        assert settings.step is not None, "the step was found before (`whole_steps`)"
        self._system, self._why, self.contact_nodes = system, why, nodes
        self._highest_hz = settings.max_frequency_hz
        self.limit = StepLimit(np.inf, 0.0, "nothing", 1.0)
        self.scheme = scheme(settings.step, 0.5)
        rows, lift = rows_of(nodes)
        highest = None if settings.max_frequency_hz is None else BEYOND * settings.max_frequency_hz
        self.coordinates: Coordinates = coordinates(system, pushed_at(system, rows), highest)
        basis = self.coordinates.basis
        self.structure: Structure = structure_of(system, basis, settings.step)
        self.nodes: Nodes = nodes_of(system, nodes, rows, lift, basis, self.structure)
        self.left_out = 0.0  # of the initial displacement or velocity, by mass
        self._parted = False  # whether a node that touched was seen open later
        self.contact_names, self.closed = nodes.names, nodes.closed
        self.parts = sketch(system, nodes)
        self.moving: StepState = fresh_state(self.nodes, self.structure, len(nodes.names))
        self.work = work_space(self.nodes, self.structure, len(nodes.names), nodes.directions)

    @property
    def system(self) -> System:
        """What is marched."""
        return self._system

    @property
    def statistics(self) -> Array:
        """Of every step since the phase began (m, 8)."""
        return self.moving.statistics

    @property
    def reason(self) -> str:
        """Why this method, and how it went."""
        said = f"{self._why}: implicit steps in {self.coordinates.words}"
        if solved := int(self.moving.counters[BY_NEWTON]):
            said += f"; contacts of {solved} steps were solved by Newton's method"
        if self.left_out > TOLD_FROM:
            said += f"; {100 * self.left_out:.2g} % of the initial state, by its mass, has no place in them"
        angle = self.scheme.step * (self._highest_hz or 0.0)
        if angle > ROUGH:
            said += f"; {1 / angle:.3g} steps to the period of {self._highest_hz:g} Hz are few"
        if self._parted:
            kept = "" if self.coordinates.complete else " and on the modes kept"
            again = f"--set temporal.step={self.scheme.step / 4:.4g}"
            if kept and self._highest_hz is not None:
                again += f" --set modal.max_frequency_hz={4 * self._highest_hz:g}"
            said += (
                f"; nodes part and strike: how many are open or stick, and mean friction, hang on the step{kept} "
                f"(docs/theory-implicit.md); see by how much with {again}"
            )
        return said

    @property
    def done(self) -> int:
        """Steps done."""
        return int(self.moving.counters[DONE])

    @property
    def recorded(self) -> int:
        """How many records are filled."""
        return int(self.moving.counters[KEPT])

    @property
    def sweeps(self) -> tuple[int, int]:
        """Most in a step, and steps that did not settle."""
        return int(self.moving.counters[MOST_SWEEPS]), int(self.moving.counters[UNCONVERGED])

    @property
    def counted(self) -> tuple[str, int]:
        """Where the state has the steps done."""
        return "implicit_counters", DONE

    def use_threads(self, *, two: bool) -> None:
        """One thread is what it takes."""

    def begin(self, schedule: Schedule, settings: Settings, disturbance: Disturbance | None) -> None:
        """At rest, in motion or in steady sliding, disturbed if so asked."""
        _refuse_jumps(schedule)
        system, state = self._system, self.moving
        u, v = np.zeros(system.size), np.zeros(system.size)
        extra = np.zeros(len(state.v))
        if settings.initial == "steady-sliding":
            u = self._steady(schedule)
            for contact in range(len(self.contact_names)):
                extra += settings.perturbation * self._slip_impulse(contact)
        else:
            u = u if system.initial_displacement is None else u + system.initial_displacement
            v = v if system.initial_velocity is None else v + system.initial_velocity
        if disturbance is not None:
            u, v = u + disturbance[0], v + disturbance[1]
        state.q[:], state.v[:] = self._in_coordinates(u), self._in_coordinates(v) + extra
        self.left_out = max(self._share_left_out(u, state.q), self._share_left_out(v, state.v - extra))
        self._place_nodes()
        self._refuse_overlap()

    def _steady(self, schedule: Schedule) -> Array:
        """Displacement (n,) of steady sliding; forces, status and motion of the supports into the state."""
        system, state, stretch = self._system, self.moving, schedule.stretches[0]
        if stretch.ramp_steps:
            ramp = stretch.ramp_steps * schedule.step
            raise CaseError("phases.0.ramp", ramp, "must be 0 when starting from steady sliding")
        steady = steady_sliding(
            system.in_place(stretch.distances_after),
            load_factors=dict(zip(system.loads, stretch.loads_after, strict=True)),
            motion_factors=stretch.velocities_after,
        )
        state.motion[0] = steady.travel + stretch.distances_after
        state.motion[1] = stretch.velocities_after
        d = self.contact_nodes.directions + 1
        state.impulse[::d] = np.where(steady.active, steady.normal_force, 0.0) * schedule.step
        for j in range(1, d):
            state.impulse[j::d] = steady.friction_force[:, j - 1] * schedule.step
        state.status[:] = steady.status
        return np.asarray(steady.displacement) - system.motion.lift @ stretch.distances_after

    def _slip_impulse(self, contact: int) -> Array:
        """Velocity (r,) that equal impulses on the nodes of a contact along its sliding give, mean slip speed one."""
        d, mine = self.contact_nodes.directions + 1, self.nodes.owner == contact
        rows = self.nodes.row.reshape(-1, d, self.nodes.row.shape[1])[mine, 1:]
        along = np.einsum("mt,mtr->mr", self.nodes.along[mine], rows)
        answer = along.sum(axis=0)
        mean = float(np.mean(along @ answer)) if len(along) else 0.0
        return answer / mean if mean > 0.0 else answer

    def _share_left_out(self, u: Array, q: Array) -> float:
        """The part of a start (n,), by its mass, that its coordinates (r,) do not have."""
        whole = float(u @ (self._system.mass @ u))
        return math.sqrt(max(1.0 - float(q @ q) / whole, 0.0)) if whole > 0.0 else 0.0

    def _in_coordinates(self, u: Array) -> Array:
        return self.coordinates.basis.vectors.T @ (self._system.mass @ np.asarray(u, dtype=float))

    def _place_nodes(self) -> None:
        """Gaps and velocities of the nodes, of the structure alone."""
        state, d = self.moving, self.contact_nodes.directions + 1
        state.place[:] = self.nodes.row[::d] @ state.q
        state.speed[:] = self.nodes.row @ state.v

    def _refuse_overlap(self) -> None:
        """Raise CaseError for a rigid contact that starts closed by more than rounding: steps would throw it apart."""
        nodes, state, d = self.nodes, self.moving, self.contact_nodes.directions + 1
        ways = nodes.lift[::d] @ state.motion[0]
        gap = nodes.gap + state.place + ways
        size = np.abs(nodes.gap) + np.abs(nodes.row[::d]) @ np.abs(state.q) + np.abs(ways)
        for i in np.flatnonzero((nodes.stiffness == 0.0) & (nodes.kept == 0) & (gap < -OVERLAP * size))[:1]:
            raise CaseError(
                f"contacts.{self.contact_names[nodes.owner[i]]}",
                f"a gap of {gap[i]:.4g} m at t = 0 s",
                "a gap >= 0 where contact is rigid; start from steady sliding, press with a ramp, or take "
                'stepper = "explicit"',
            )

    def state(self) -> dict[str, Array]:
        """What moves on from step to step, and displacement and velocity of the freedoms."""
        vectors, state = self.coordinates.basis.vectors, self.moving
        counters = state.counters.copy()
        counters[[KEPT, NODES_KEPT]] = 0  # rows of the records of this part alone
        own = state._replace(counters=counters)
        held: dict[str, Array] = {f"implicit_{name}": values for name, values in own._asdict().items()}
        return held | {"implicit_displacement": vectors @ state.q, "implicit_velocity": vectors @ state.v}

    def bounds(self) -> Bounds:
        """What is counted."""
        return {
            "implicit_status": STATUS_RANGE,
            "implicit_counters": (0, INFINITY),
            "implicit_statistics": (-1.0, INFINITY),
        }

    def check(self, restart: Trajectory) -> None:
        """Nothing but the arrays themselves."""

    def resume(self, restart: Trajectory, schedule: Schedule, *, changed: bool) -> None:
        """Take up a state that was checked."""
        _refuse_jumps(schedule)
        state, saved = self.moving, restart.state
        for name, held in state._asdict().items():
            held[:] = saved[f"implicit_{name}"]
        state.counters[[KEPT, NODES_KEPT]] = 0
        vectors, u = self.coordinates.basis.vectors, np.asarray(saved["implicit_displacement"])
        # Modes may have another sign or order elsewhere: then what freedoms do counts.
        if changed or np.abs(vectors @ state.q - u).max(initial=0.0) > 1e-12 * np.abs(u).max(initial=0.0):
            before = state.v.copy()
            state.q[:] = self._in_coordinates(u)
            state.v[:] = self._in_coordinates(np.asarray(saved["implicit_velocity"]))
            state.before[:] += state.v - before
            self._place_nodes()
        if changed:
            ratio = motion_ratio(self.parts, restart, self._system.motion.names)
            state.motion[:] /= ratio
            state.rate_before[:] /= ratio

    def make_room(self, schedule: Schedule, settings: Settings) -> None:
        """Room for all records from the present step on; loads the compiled loop."""
        every, system, nodes = settings.record_every, self._system, self.contact_nodes
        count = max((schedule.steps - 1) // every - (self.done - 1) // every, 0)
        d, p = system.dimension, len(system.motion.names)
        per_record = nodes.count * (16 * (nodes.directions + 1) + 1)
        nodes_every = max(1, int(np.ceil(count * per_record / NODE_HISTORY_BYTES))) if nodes.count else 0
        kept = count // nodes_every + 1 if nodes_every else 0
        rows = [sp.csr_array(system.points[name].free[:d]) for name in settings.watch]
        lift = [np.asarray(system.points[name].lift)[:d].reshape(d, p) for name in settings.watch]
        watch = sp.vstack([sp.csr_array((0, system.size)), *rows])
        self.record = Record(
            every=every,
            nodes_every=nodes_every,
            contacts=np.zeros((count, len(nodes.names), CONTACT_COLUMNS)),
            watch=np.zeros((count, watch.shape[0], 3)),
            energies=np.zeros((count, ENERGY_RECORD)),
            nodes=np.zeros((kept, nodes.count, 2 * (nodes.directions + 1))),
            node_status=np.zeros((kept, nodes.count), dtype=np.int8),
            watch_row=np.ascontiguousarray(watch @ self.coordinates.basis.vectors),
            watch_lift=np.vstack([np.zeros((0, p)), *lift]),
        )
        self._march(0, schedule, given=False)

    def _march(self, steps: int, schedule: Schedule, *, given: bool) -> int:
        """Up to so many steps; why it ended."""
        first = self.done
        _, code = run_steps(
            steps, given, schedule.load_factors(first, steps, within=0.5), schedule.motion_increments(first, steps),
            schedule.motion_rates(first, steps), self.structure, self.nodes, self.moving, self.work, self.record,
        )  # fmt: skip
        return int(code)

    def advance(self, steps: int, schedule: Schedule, phase: str) -> None:
        """Up to so many steps."""
        last, given = self.done + steps, False
        touched = self.moving.status != OPEN
        while self.done < last:
            code = self._march(last - self.done, schedule, given=given)
            self._parted |= bool(np.any(touched & (self.moving.status == OPEN)))
            given = code == HARD
            if given:
                newton(self.scheme.step, self.nodes, self.moving, self.work)
                sweeps = solve_nodes(SWEEP_LIMIT, self.scheme.step, self.nodes, self.moving, self.work)
                self.moving.counters[UNCONVERGED] += sweeps > SWEEP_LIMIT
            if code == NOT_FINITE:
                raise AnalysisError(not_finite(self.done * self.scheme.step, phase, self.scheme.step))

    def velocity(self) -> Array:
        """Velocity (n,) of the freedoms now."""
        return self.coordinates.basis.vectors @ self.moving.v

    def node_history(self, start: int) -> NodeHistory | None:
        """Histories of the nodes, where there are any."""
        nodes, record = self.contact_nodes, self.record
        if not nodes.count:
            return None
        number = np.arange(start, start + self.recorded)
        number = number[number % record.nodes_every == 0]
        values, t = record.nodes[: len(number)], nodes.directions
        return NodeHistory(
            names=nodes.names, owner=nodes.owner, position=nodes.position, area=nodes.area, tangents=nodes.tangents,
            time=number * record.every * self.scheme.step,
            normal_force=values[:, :, 0], tangential_force=values[:, :, 1 : 1 + t],
            slip_velocity=values[:, :, 1 + t : 1 + 2 * t], gap=values[:, :, 1 + 2 * t],
            status=record.node_status[: len(number)],
        )  # fmt: skip


def _refuse_jumps(schedule: Schedule) -> None:
    if found := schedule.jump:
        accepted = 'a ramp [s] > 0 where supports are pressed away, or stepper = "explicit"'
        raise CaseError("phases", found, accepted)

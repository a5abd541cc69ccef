"""The exact stepper: see `temporal.stepper.Stepper`; its step is only that of the records."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ....errors import AnalysisError, CaseError
from ....sliding import steady_sliding
from ....system import System
from ....system.uncoupled import no_complete_basis
from ....typing import Array
from ...beta2 import scheme, step_limit
from ...columns import (
    CONTACT_RECORD,
    ENERGY_RECORD,
    REC_GAP,
    REC_NORMAL,
    REC_POSITION,
    REC_SLIP,
    REC_STATUS,
    REC_TANGENTIAL,
    STATISTICS,
    WORK_COLUMNS,
)
from ...node_history import NodeHistory
from ...phase_results import fresh_statistics
from ...restart import motion_ratio
from ...saved import INFINITY, Bounds
from ...schedule import PhaseSpec, Schedule
from ...settings import ASKED, Settings, choose_step, not_finite
from ...sketch import sketch
from ...stepper import Disturbance
from ...trajectory import Trajectory
from ..basis import Basis
from ..coordinates import Coordinates, all_modes, left_out, truncated
from ..starting import not_begun
from .drive import pieces
from .leaps import Leaps
from .motion import Motion
from .observed import Records
from .outputs import Outputs
from .statuses import BACKWARD, GAP, Pairs

MOST_CONTACTS = 4
MOST_FREEDOMS = 1500
DONE = 0  # where the counters have the steps done
TOLD_FROM = 1e-3  # of the initial state: what is left out of it is said from there on


def why_not_exact(system: System, cutoff_hz: float | None = None) -> str:
    """Why it does not take a system, on all its modes or those up to ``cutoff_hz``; "" where it does."""
    if system.size > MOST_FREEDOMS and cutoff_hz is None:
        return (
            f"{system.size} freedoms are too many: each status of the contacts has its own modes, of all of them; "
            "temporal.cutoff_hz takes those up to a frequency"
        )
    if why := no_complete_basis(system, nodes=True):
        return why
    if system.surfaces and system.dimension == 3:
        return "friction turns with the slip in space"
    nodes = system.contact_nodes()
    if len(nodes.names) > MOST_CONTACTS:
        return f"{len(nodes.names)} contacts are too many: up to {MOST_CONTACTS}"
    for contact in (*system.contacts, *system.surfaces):
        if contact.sliding == "finite":
            return f"contact {contact.name} slides finitely, so that its rows move"
    kept = dict(zip(nodes.names, nodes.closed or (False,) * len(nodes.names), strict=True))
    for number, (name, law) in enumerate(zip(nodes.names, nodes.laws, strict=True)):
        if np.count_nonzero(nodes.owner == number) != 1:
            return f"contact {name} has {np.count_nonzero(nodes.owner == number)} nodes, not one"
        if kept[name]:
            return f"contact {name} is kept closed"
        if not law.constant:
            return f"the friction of contact {name} varies with the slip speed"
    return ""


def refuse(system: System, cutoff_hz: float | None = None) -> None:
    """Raise CaseError for a system that it does not take."""
    if why := why_not_exact(system, cutoff_hz):
        raise CaseError("temporal.stepper", "exact", f'no such system: {why}; take "explicit"')


def exact_not_begun(system: System, settings: Settings, phases: Sequence[PhaseSpec]) -> str:
    """Why it does not take phases from their start on; "" where it does."""
    step = choose_step(step_limit(system, 0.5), settings) if settings.step is None else settings.step
    return not_begun(system, replace(settings, step=step), phases)


def exact_stepper(system: System, settings: Settings, mu: float | None, why: str = ASKED) -> ExactStepper:
    """A system made ready, and why this way; mu scales every contact's friction law at its slip speed. Raises CaseError
    for a system that it does not take."""
    refuse(system, settings.cutoff_hz)
    return ExactStepper(system.at_friction(mu), settings, why)


def coordinates_of(system: System, cutoff_hz: float | None) -> Coordinates:
    """All modes of a system, or those up to ``cutoff_hz`` and static answers; CaseError where they are too many."""
    if cutoff_hz is None:
        return all_modes(system)
    found = truncated(system, cutoff_hz)
    if not found.modes:
        raise CaseError("temporal.cutoff_hz", cutoff_hz, "a frequency with modes of the structure below it")
    if found.basis.size > MOST_FREEDOMS:
        raise CaseError("temporal.cutoff_hz", cutoff_hz, f"a frequency with up to {MOST_FREEDOMS} modes below it")
    return found


def pairs_of(system: System, basis: Basis) -> Pairs:
    """The contacts, loads and moving supports of a system in coordinates."""
    nodes, motion = system.contact_nodes(), system.motion
    laws = [nodes.laws[owner] for owner in nodes.owner]
    loads = np.array(list(system.loads.values()), dtype=float).reshape(len(system.loads), system.size)
    return Pairs(
        normal=nodes.normal @ basis.vectors,
        tangent=nodes.tangent @ basis.vectors,
        normal_lift=nodes.normal_lift,
        tangent_lift=nodes.tangent_lift,
        gap=nodes.gap,
        compliance=nodes.compliance,
        sliding=np.array([law.sliding(0.0) for law in laws]),
        sticking=np.array([law.sticking for law in laws]),
        loads=loads @ basis.vectors,
        loads_lift=loads @ motion.lift,
        inertia=motion.mass.T @ basis.vectors,
        drag=motion.damping.T @ basis.vectors,
        mass_own=motion.mass_own,
        damping_own=motion.damping_own,
        stiffness_own=motion.stiffness_own,
    )


class ExactStepper:
    """See `temporal.stepper.Stepper`."""

    threaded = False
    path = "exact"
    works = WORK_COLUMNS

    def __init__(self, system: System, settings: Settings, why: str) -> None:
        self._system, self._why = system, why
        self.limit = step_limit(system, 0.5)  # of explicit steps
        self.scheme = scheme(choose_step(self.limit, settings), 0.5)
        self.coordinates = coordinates_of(system, settings.cutoff_hz)
        self.basis = self.coordinates.basis
        highest = settings.max_frequency_hz
        self.lacking = None if self.coordinates.complete else left_out(system, self.coordinates, highest)
        self.start_lacking = 0.0  # of the initial displacement or velocity, by mass
        self.pairs = pairs_of(system, self.basis)
        nodes = system.contact_nodes()
        self.contact_names = nodes.names
        self.closed = ()
        # Slip and friction of surfaces are told along their sliding, those of points along the tangent.
        backwards = nodes.slip_velocity(system.motion.full)[:, 0] < 0.0
        self._ways = np.where(backwards & ~np.isnan(nodes.area), -1.0, 1.0)
        self.parts = sketch(system, nodes)
        self.statistics = fresh_statistics(self.pairs.count, STATISTICS)
        self.motion = Motion(self.basis, self.pairs, [])
        self.leaps: Leaps | None = None
        self._done = 0
        self._counted = 0.0  # [s], up to where times of statuses were counted before

    @property
    def system(self) -> System:
        """What is marched."""
        return self._system

    @property
    def reason(self) -> str:
        """Why this method, and what it did that is not exact."""
        said = f"{self._why}: from one change of contact to the next, in the "
        if self.lacking is None:
            said += "complete modes of each status"
        else:
            said += f"modes of each status, on {self.coordinates.words}; {self.lacking.words}"
        if self.start_lacking > TOLD_FROM:
            said += f"; {100 * self.start_lacking:.2g} % of the initial state, by its mass, has no place in them"
        if landed := self.motion.landed:
            said += f"; contacts that threw one another off ever faster were brought to rest {landed} times"
        return said

    @property
    def done(self) -> int:
        """Steps done."""
        return self._done

    @property
    def recorded(self) -> int:
        """How many records are filled."""
        return 0 if self.leaps is None else self.leaps.recorded

    @property
    def sweeps(self) -> tuple[int, int]:
        """None are needed; parts of the time in which a number was too close to zero to be decided."""
        return 0, self.motion.unsure

    @property
    def counted(self) -> tuple[str, int]:
        """Where the state has the steps done."""
        return "exact_counters", DONE

    def use_threads(self, *, two: bool) -> None:
        """One thread is what it takes."""

    def node_history(self, start: int) -> NodeHistory | None:
        """Histories of the nodes where contacts are of surfaces: each has one."""
        if not self._system.surfaces:
            return None
        nodes, values = self._system.contact_nodes(), self.record.contacts[: self.recorded]
        along = self._ways[None, :, None]
        return NodeHistory(
            names=nodes.names, owner=nodes.owner, position=nodes.position, area=nodes.area, tangents=nodes.tangents,
            time=(start + np.arange(self.recorded)) * self.every * self.scheme.step,
            normal_force=values[:, :, REC_NORMAL], tangential_force=along * values[:, :, REC_TANGENTIAL, None],
            slip_velocity=along * values[:, :, REC_SLIP, None], gap=values[:, :, REC_GAP],
            status=values[:, :, REC_STATUS].astype(np.int64),
        )  # fmt: skip

    def begin(self, schedule: Schedule, settings: Settings, disturbance: Disturbance | None) -> None:
        """At rest or in steady sliding, disturbed if so asked."""
        self._lay_out(schedule)
        system, motion = self._system, self.motion
        stretch = schedule.stretches[0]
        u, v = np.zeros(system.size), np.zeros(system.size)
        steady = settings.initial == "steady-sliding"
        active = np.zeros(self.pairs.count, dtype=bool)
        if steady:
            if stretch.ramp_steps:
                ramp = stretch.ramp_steps * schedule.step
                raise CaseError("phases.0.ramp", ramp, "must be 0 when starting from steady sliding")
            found = steady_sliding(
                system.in_place(stretch.distances_after),
                load_factors=dict(zip(system.loads, stretch.loads_after, strict=True)),
                motion_factors=stretch.velocities_after,
            )
            active = np.asarray(found.active, dtype=bool)
            u = u + found.displacement - system.motion.lift @ stretch.distances_after
        else:
            u = u if system.initial_displacement is None else u + system.initial_displacement
            v = v if system.initial_velocity is None else v + system.initial_velocity
        if disturbance is not None:
            u, v = u + disturbance[0], v + disturbance[1]
        motion.q, motion.v = self._coordinates(u, v)
        self.start_lacking = max(self._share_left_out(u, motion.q), self._share_left_out(v, motion.v))
        if steady:
            for way, row in zip(self._ways, self.pairs.tangent, strict=True):
                motion.v = motion.v + settings.perturbation * way * row / float(row @ row)
        piece = motion.pieces[0]
        speed = piece.displacements @ piece.derivative @ piece.powers(0.0)
        if not steady:
            push = self.pairs.inertia.T @ speed
            motion.v = motion.v - push
        motion.start(self._touching(active if steady else None))

    def _share_left_out(self, u: Array, q: Array) -> float:
        """The part of a start (n,), by its mass, that its coordinates (k,) do not have."""
        whole = 0.0 if self.coordinates.complete else float(u @ (self._system.mass @ u))
        return math.sqrt(max(1.0 - float(q @ q) / whole, 0.0)) if whole > 0.0 else 0.0

    def _touching(self, active: Array | None, rounding: float = 1e-12) -> dict[int, float]:
        """Contacts that are closed now, and their slip [m/s]; active (m,): which those are, where that is known."""
        motion, pairs = self.motion, self.pairs
        piece = motion.pieces[motion.piece]
        moved = piece.displacements @ piece.powers(motion.time)
        speed = piece.displacements @ piece.derivative @ piece.powers(motion.time)
        found: dict[int, float] = {}
        for c, name in enumerate(self.contact_names):
            parts = np.concatenate([pairs.normal[c] * motion.q, pairs.normal_lift[c] * moved, pairs.gap[c : c + 1]])
            gap, size = float(parts.sum()), float(np.abs(parts).sum())
            closed = gap <= rounding * size if active is None else bool(active[c])
            if closed and pairs.compliance[c] == 0.0 and gap < -1e-6 * size:
                raise CaseError(
                    f"contacts.{name}",
                    f"a gap of {gap:.4g} m at t = {motion.time:g} s",
                    "a gap >= 0 where contact is rigid; start from steady sliding, press with a ramp, or take "
                    'stepper = "explicit"',
                )
            if closed:
                found[c] = float(pairs.tangent[c] @ motion.v + pairs.tangent_lift[c] @ speed)
        return found

    def _lay_out(self, schedule: Schedule) -> None:
        if schedule.jump:
            raise CaseError(
                "phases", schedule.jump, 'a ramp [s] > 0 where supports are pressed away, or stepper = "explicit"'
            )
        self.motion = Motion(self.basis, self.pairs, pieces(schedule))

    def state(self) -> dict[str, Array]:
        """What moves on from step to step: where the present modes began, and the state now."""
        motion, now = self.motion, self._done * self.scheme.step
        q, v, holds, works = motion.q, motion.v, motion.holds, motion.works
        if motion.anchor is not None:
            q, v = motion.anchor.state(now)
        if self.leaps is not None and self.leaps.works is not None:
            works = self.leaps.works
        counted = self._counted if self.leaps is None else self.leaps.counted
        counters = [self._done, motion.piece, motion.level, motion.events, motion.unsure, motion.crowded, motion.landed]
        vectors = self.basis.vectors
        found: dict[str, Any] = {
            "exact_u": vectors @ motion.q, "exact_w": vectors @ motion.v, "exact_q": motion.q, "exact_v": motion.v,
            "exact_now_u": vectors @ q, "exact_now_w": vectors @ v, "exact_now_works": works,
            "exact_holds": holds, "exact_works": motion.works,
            "exact_times": np.array([motion.time, counted, motion.crowd_since, motion.latest]),
            "exact_parted": motion.parted, "exact_parted_from": motion.parted_from,
            "exact_status": np.array(motion.status, dtype=np.int64), "exact_counters": np.array(counters),
            "exact_statistics": self.statistics,
        }  # fmt: skip
        return found

    def bounds(self) -> Bounds:
        """What is counted, and what points into arrays."""
        levels = 60
        return {
            "exact_status": (GAP, BACKWARD),
            "exact_counters": (0, np.array([INFINITY, INFINITY, levels, INFINITY, INFINITY, INFINITY, INFINITY])),
            "exact_times": (0.0, INFINITY),
            "exact_parted": (-1.0, INFINITY),
            "exact_parted_from": (GAP, BACKWARD),
            "exact_statistics": (-1.0, INFINITY),
        }

    def check(self, restart: Trajectory) -> None:
        """Nothing but the arrays themselves."""

    def resume(self, restart: Trajectory, schedule: Schedule, *, changed: bool) -> None:
        """Take up a state that was checked."""
        self._lay_out(schedule)
        motion, saved = self.motion, restart.state
        counters = [int(n) for n in saved["exact_counters"]]
        self._done, motion.piece, motion.level, motion.events, motion.unsure, motion.crowded, motion.landed = counters
        if motion.piece >= len(motion.pieces):
            raise CaseError("restart", f"a state in piece {motion.piece} of the phases", "a run with these phases")
        self.statistics[:] = saved["exact_statistics"]
        motion.holds = np.array(saved["exact_holds"], dtype=float)
        motion.works = np.array(saved["exact_works"], dtype=float)
        motion.status = tuple(int(n) for n in saved["exact_status"])
        motion.time, self._counted, motion.crowd_since, motion.latest = (float(t) for t in saved["exact_times"])
        motion.parted = np.array(saved["exact_parted"], dtype=float)
        motion.parted_from = np.array(saved["exact_parted_from"], dtype=np.int64)
        if not changed:
            motion.q, motion.v = (np.array(saved[f"exact_{name}"], dtype=float) for name in ("q", "v"))
            # Modes may have another sign or order elsewhere: then what freedoms do counts.
            u = saved["exact_u"]
            if np.abs(self.basis.vectors @ motion.q - u).max(initial=0.0) > 1e-12 * np.abs(u).max(initial=0.0):
                motion.q, motion.v = self._coordinates(saved["exact_u"], saved["exact_w"])
            return
        motion.q, motion.v = self._coordinates(saved["exact_now_u"], saved["exact_now_w"])
        motion.works = np.array(saved["exact_now_works"], dtype=float)
        motion.time = self._done * self.scheme.step
        ratio = motion_ratio(self.parts, restart, self._system.motion.names)
        motion.take_up(ratio, self._touching(None, 1e-9))

    def _coordinates(self, u: Array, w: Array) -> tuple[Array, Array]:
        """Displacement and velocity (n,) of the freedoms in coordinates (k,)."""
        weight = self._system.mass @ self.basis.vectors
        return weight.T @ np.asarray(u, dtype=float), weight.T @ np.asarray(w, dtype=float)

    def make_room(self, schedule: Schedule, settings: Settings) -> None:
        """Room for all records from the present step on."""
        every = settings.record_every
        count = max((schedule.steps - 1) // every - (self._done - 1) // every, 0)
        rows: list[Array] = [np.zeros((0, self._system.size))]
        lifts: list[Array] = [np.zeros((0, len(self._system.motion.names)))]
        for name in settings.watch:
            rows.append(self._system.points[name].free[:2].toarray())
            lifts.append(self._system.points[name].lift[:2])
        watch = np.vstack(rows) @ self.basis.vectors
        self.every = every
        self.record = Records(
            np.zeros((count, len(self.contact_names), CONTACT_RECORD)),
            np.zeros((count, len(watch), 3)),
            np.zeros((count, ENERGY_RECORD)),
            self._ways,
        )
        self.leaps = Leaps(
            Outputs(watch, np.vstack(lifts)), self.record, self.statistics, schedule.step, every, self._done,
            self._counted,
        )  # fmt: skip
        for c, contact in enumerate(self._system.contacts):
            self.record.contacts[:, c, REC_POSITION] = contact.segment + contact.xi

    def advance(self, steps: int, schedule: Schedule, phase: str) -> None:
        """Up to so many steps, and through all events on the way."""
        assert self.leaps is not None
        motion, step = self.motion, self.scheme.step
        last = self._done + steps
        end = last * step
        try:
            while not self.leaps.go(motion, end, last):
                motion.passed()
        except AnalysisError as error:
            self._done = min(max(self._done, int(motion.time / step)), last)
            raise AnalysisError(f"{error} (t = {motion.time:.9g} s, phase {phase})") from error
        self._done = last
        if motion.anchor is not None and not np.all(np.isfinite(motion.anchor.state(end)[0])):
            raise AnalysisError(not_finite(end, phase, step))

    def velocity(self) -> Array:
        """Velocity (n,) of the freedoms now."""
        motion = self.motion
        v = motion.v if motion.anchor is None else motion.anchor.state(self._done * self.scheme.step)[1]
        return self.basis.vectors @ v

"""What cycles are sought of: a system under constant loads, slid steadily, whose statuses are linear."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..errors import AnalysisError, CaseError
from ..modal.options import Options
from ..modal.painleve import refuse_undetermined
from ..sliding import full_motion, steady_nodes
from ..system import System
from ..temporal.steppers.basis import Basis
from ..temporal.steppers.coordinates import left_out
from ..temporal.steppers.exact.drive import Piece
from ..temporal.steppers.exact.statuses import BACKWARD, FORWARD, GAP, Pairs, Status
from ..temporal.steppers.exact.stepper import coordinates_of, pairs_of, why_not_exact
from ..temporal.steppers.exact.varied import VariedMotion
from ..typing import Array

HORIZON = 1e9  # rad of the slowest mode: longer than a motion is ever followed


@dataclass(frozen=True)
class SlidingProblem:
    """One value μ of the friction coefficient: basis (of k modes of unit mass), contacts and what drives them in it.

    q (k,): steady sliding, with its status; speeds (m,) [m/s]: slip there. names (m,): contacts, ways (m,): the sense
    in which their slip and friction are told; watch (w, k) with lift (w, p): watched rows, x and y of each of
    ``watch_names`` in turn.
    """

    value: float
    basis: Basis
    pairs: Pairs
    piece: Piece
    q: Array
    status: Status
    speeds: Array
    names: tuple[str, ...]
    ways: Array
    watch: Array
    lift: Array
    watch_names: tuple[str, ...]
    _kept: list[VariedMotion] = field(default_factory=list[VariedMotion])

    def motion(self) -> VariedMotion:
        """A motion at the time zero, without a state; all keep the modes of their statuses together."""
        made = VariedMotion(self.basis, self.pairs, [self.piece])
        if self._kept:
            made.share(self._kept[0])
        else:
            self._kept.append(made)
        return made

    @property
    def sliding_speed(self) -> float:
        """The largest slip speed of steady sliding [m/s]."""
        return float(np.abs(self.speeds).max())


class Family:
    """The problems of one system over μ, in all its modes or those up to ``cutoff_hz`` and static answers."""

    def __init__(self, system: System, cutoff_hz: float | None = None) -> None:
        refuse_cycles(system, cutoff_hz)
        self.system = system
        self.coordinates = coordinates_of(system, cutoff_hz)
        self.basis = self.coordinates.basis
        self.speeds = slip_of(system)
        self._made: dict[float, SlidingProblem] = {}

    def lacking(self, asked_hz: float) -> str:
        """What a truncated basis is made of and lacks where frequencies up to one are asked for, "" of all modes."""
        if self.coordinates.complete:
            return ""
        return f"cycles of {self.coordinates.words}: {left_out(self.system, self.coordinates, asked_hz).words}"

    def at(self, mu: float) -> SlidingProblem:
        """The problem at a friction coefficient; the last few are kept. Raises AnalysisError where nothing slides
        steadily there, and where rigid contact does not determine how."""
        if mu not in self._made:
            while len(self._made) > 3:
                self._made.pop(next(iter(self._made)))
            self._made[mu] = self._problem(mu)
        return self._made[mu]

    def _problem(self, mu: float) -> SlidingProblem:
        system, basis = self.system, self.basis
        if not mu >= 0.0:
            raise AnalysisError(f"μ = {mu:g} is no friction coefficient")
        refuse_undetermined(system, mu, Options(), touching_at=mu)
        scaled = system.at_friction(mu)
        pairs = pairs_of(scaled, basis)
        motion = system.motion
        squares = np.abs(basis.stiffness)
        moving = np.sqrt(squares[squares > 1e-12 * squares.max(initial=0.0)])
        horizon = HORIZON / float(moving.min(initial=1.0) if len(moving) else 1.0)
        velocities = full_motion(system)
        displacements = np.stack([motion.full_distance, velocities * horizon], axis=1)
        loads = np.stack([np.ones(len(system.loads)), np.zeros(len(system.loads))], axis=1)
        steady = steady_nodes(system, mu)
        weight = system.mass @ basis.vectors
        u = steady.displacement - motion.lift @ motion.full_distance
        status = tuple(
            (FORWARD if speed > 0.0 else BACKWARD) if closed else GAP
            for speed, closed in zip(self.speeds, steady.active, strict=True)
        )
        names = tuple(system.points)
        free = [system.points[n].free[:2].toarray() for n in names]
        lift = [system.points[n].lift[:2] for n in names]
        nodes = system.contact_nodes()
        backwards = nodes.slip_velocity(motion.full)[:, 0] < 0.0
        ways = np.where(backwards & ~np.isnan(nodes.area), -1.0, 1.0)  # those of points are their tangents
        return SlidingProblem(
            float(mu), basis, pairs, Piece(0.0, horizon, loads, displacements, horizon), weight.T @ u, status,
            self.speeds, nodes.names, ways,
            np.vstack([np.zeros((0, system.size)), *free]) @ basis.vectors,
            np.vstack([np.zeros((0, len(motion.names))), *lift]), names,
        )  # fmt: skip


def slip_of(system: System) -> Array:
    """Slip (m,) [m/s] of every contact along its tangent in steady sliding."""
    return np.asarray(system.contact_nodes().tangent_lift @ full_motion(system), dtype=float).ravel()


def why_not_shooting(system: System, cutoff_hz: float | None = None) -> str:
    """Why cycles of a system cannot be shot at, on all its modes or those up to ``cutoff_hz``; "" where they can."""
    why = why_not_exact(system, cutoff_hz)
    if not why and system.load_steps:
        why = "it has load steps, so that what drives it does not stay the same"
    if not why and not np.any(full_motion(system)):
        why = "nothing slides: no support has a velocity"
    if not why:
        nodes = system.contact_nodes()
        still = ~nodes.rubs & (slip_of(system) == 0.0)
        if still.any():
            name = nodes.names[nodes.owner[int(np.argmax(still))]]
            why = f"contact {name} has no friction and nothing slides it, so that each of its swings is a reversal"
    return why


def refuse_cycles(system: System, cutoff_hz: float | None = None) -> None:
    """Raise CaseError for a system whose cycles cannot be sought."""
    if why := why_not_shooting(system, cutoff_hz):
        raise CaseError("case", "no cycles can be sought of it", f"what the exact stepper takes; {why}")

"""The stepper on assembled sparse matrices, whose contacts are lists of nodes."""

from __future__ import annotations

from typing import Any

import numpy as np

from ....errors import AnalysisError, CaseError
from ....system import System
from ....typing import Array
from ...beta2 import StepLimit, scheme, step_limit
from ...columns import WORK_COLUMNS
from ...inputs import unfit_in_time
from ...node_history import NodeHistory
from ...restart import motion_ratio
from ...saved import INFINITY, STATUS_RANGE, Bounds
from ...schedule import Schedule
from ...settings import Settings, choose_step, not_finite
from ...sketch import sketch
from ...stepper import Disturbance
from ...trajectory import Trajectory
from ..curve import check_stiffness, left_the_line
from .bends import Turning
from .feet import NEW_ROWS, OFF_LINE
from .forcing import KEPT, MOST_SWEEPS, NODES_KEPT, STEPS_DONE, UNCONVERGED
from .limit import step_limit_assembled
from .loop import NOT_FINITE
from .machine import Machine, assembled_machine, diagonal_mass
from .records import SKEW_COLUMNS, buffers, node_history
from .renewal import (
    facet_distances,
    fading,
    found_on,
    last_facets,
    node_distances,
    put_on,
    renew,
    steps_to_renewal,
    take_over,
    turning,
)
from .start import begin

# What moves on from step to step, by the part of the machine that holds it.
SAVED = {
    "fields": ("u", "q", "shown", "push"),
    "state": ("works", "statistics", "counters", "motion", "coefficients", "base", "reference"),
    "contacts": ("force", "status", "offset", "segment", "xi"),
    "whole": ("drag",),
}


def sparse_stepper(
    system: System, settings: Settings, mu: float | None, reason: str, *, path: str = "assembled"
) -> SparseStepper:
    """A system of assembled matrices made ready; mu scales every contact's friction law at its slip speed. path:
    "nodal" takes any mass and damping without lag, "assembled" steps that solve nothing; reason: why it is that.

    Raises CaseError on the path "assembled" for a mass that is not lumped, for contact springs that the step cannot
    follow and a step beyond the limit, AnalysisError for matrices that time does not take.
    """
    if why := unfit_in_time(system):
        raise AnalysisError(why)
    lagged = path == "assembled"
    if lagged:
        diagonal_mass(system)
    limit = (step_limit_assembled if lagged else step_limit)(system, settings.beta2)  # known from other coefficients
    system = system.at_friction(mu)
    numbers = scheme(choose_step(limit, settings), settings.beta2)
    check_stiffness(system, numbers.step)
    return SparseStepper(assembled_machine(system, numbers, system.contact_nodes(), lagged=lagged), limit, path, reason)


class SparseStepper:
    """See `temporal.stepper.Stepper`. Surfaces that slide finitely have their rows found again as they go."""

    def __init__(self, machine: Machine, limit: StepLimit, path: str, reason: str) -> None:
        self.machine, self.limit, self.scheme = machine, limit, machine.scheme
        self.path, self.reason = path, reason
        self.contact_names, self.closed = machine.nodes.names, machine.nodes.closed
        self.works = WORK_COLUMNS | (SKEW_COLUMNS if len(machine.unsymmetric.force) else {})
        self.parts = sketch(machine.system, machine.nodes)
        self.finite = any(surface.sliding == "finite" for surface in machine.system.surfaces)
        self.distances = node_distances(machine.system) if self.finite else np.zeros(0)
        self.facets = facet_distances(machine.system) if self.finite else np.zeros(0)
        # Of the rows: the step of their next renewal, the first for finite sliding, and the steps since the last.
        self.renewal = np.array([0, 1])
        self.renewed_at = np.zeros(machine.system.size + len(machine.system.motion.names))
        # Where that search began: from elsewhere it may end on the far wall of a bore.
        self.renewed_from: Any = found_on(machine.surfaces)

    @property
    def system(self) -> System:
        """What is marched."""
        return self.machine.system

    @property
    def done(self) -> int:
        """Steps done."""
        return self.machine.done

    @property
    def statistics(self) -> Array:
        """Of every step since the phase began (m, 8)."""
        return self.machine.state.statistics

    @property
    def recorded(self) -> int:
        """How many records are filled."""
        return int(self.machine.state.counters[KEPT])

    @property
    def sweeps(self) -> tuple[int, int]:
        """Most in a step, and steps that did not settle."""
        counters = self.machine.state.counters
        return int(counters[MOST_SWEEPS]), int(counters[UNCONVERGED])

    @property
    def counted(self) -> tuple[str, int]:
        """Where the state has the steps done."""
        return "state_counters", STEPS_DONE

    @property
    def threaded(self) -> bool:
        """Whether the structure is large enough for two threads."""
        return self.machine.threaded

    def use_threads(self, *, two: bool) -> None:
        """Take one thread or two."""
        self.machine.use_threads(two=two)

    def begin(self, schedule: Schedule, settings: Settings, disturbance: Disturbance | None) -> None:
        """At rest, in motion or in steady sliding, disturbed if so asked."""
        begin(self.machine, schedule, settings, disturbance)

    def state(self) -> dict[str, Array]:
        """What moves on from step to step."""
        held = self._moving()
        counters = held["state_counters"].copy()
        counters[[KEPT, NODES_KEPT]] = 0  # rows of the records of this part alone
        return held | {"state_counters": counters}

    def _moving(self) -> dict[str, Array]:
        """The same, the arrays themselves."""
        machine = self.machine
        held: dict[str, Array] = {"renewal": self.renewal, "renewed_at": self.renewed_at}
        if self.finite:
            held |= {"turning_rate": machine.turning.rate, "turning_place": machine.turning.place}
            held["renewed_from"] = self.renewed_from
        for part, names in SAVED.items():
            held |= {f"{part}_{name}": getattr(getattr(machine, part), name) for name in names}
        return held

    def bounds(self) -> Bounds:
        """What is counted."""
        lines = [len(c.chords) - 1 if c.sliding == "finite" else c.segment for c in self.system.contacts]
        last = np.array(lines + [0] * (self.machine.nodes.count - len(lines)))
        first = np.array([0 if c.sliding == "finite" else c.segment for c in self.system.contacts])
        return {
            "contacts_status": STATUS_RANGE,
            "contacts_segment": (np.append(first, np.zeros(len(last) - len(first))), last),
            "state_counters": (0, INFINITY),
            "state_statistics": (-1.0, INFINITY),
            "renewal": (np.array([0, 1]), INFINITY),
            **({"renewed_from": (0, last_facets(self.machine.surfaces))} if self.finite else {}),
        }

    def check(self, restart: Trajectory) -> None:
        """Freedoms are freedoms, whatever the bodies. Raises CaseError for finite sliding as older versions had it."""
        if self.finite and "renewed_from" not in restart.state:
            accepted = "start it anew: of contacts that slide finitely it does not say on which facets its nodes were"
            raise CaseError("restart", "a run of an older version of stridor", accepted)

    def resume(self, restart: Trajectory, schedule: Schedule, *, changed: bool) -> None:
        """Take up a state that was checked."""
        machine, size = self.machine, self.system.size
        # The places that the supports have reached stay, whatever a unit of their motion is now.
        ratio = motion_ratio(self.parts, restart, self.system.motion.names) if changed else 1.0
        machine.contacts.segment[:] = restart.state["contacts_segment"]
        machine.set_nodes(machine.nodes, machine.turning)
        if self.finite:
            # Rows as they were last found: first at that displacement, then the state itself.
            machine.fields.u[machine.layout.index] = restart.state["renewed_at"][:size]
            machine.state.motion[0] = restart.state["renewed_at"][size:] / ratio
            start = np.asarray(restart.state["renewed_from"], dtype=np.int64)
            surfaces, nodes, _ = renew(machine, put_on(machine.surfaces, start))
            # Before the first renewal none turns.
            found = int(restart.state["renewal"][0]) > 0
            turns = turning(machine, surfaces, nodes, self.distances) if found else Turning.none(nodes)
            take_over(machine, surfaces, nodes, turns)
        for name, held in self._moving().items():
            held[:] = restart.state[name]
        if self.finite:
            machine.set_nodes(machine.nodes, machine.turning)
        machine.contacts.q[:] = machine.fields.q[machine.table.indices]
        machine.state.counters[[KEPT, NODES_KEPT]] = 0  # files of older versions have them
        if changed:
            machine.state.motion[:] /= ratio
            self.renewed_at[size:] /= ratio
            # No number: the next step finds its forces anew.
            machine.state.coefficients[:] = np.nan
            machine.show()

    def make_room(self, schedule: Schedule, settings: Settings) -> None:
        """Room for all records from the present step on."""
        # Where every contact is a point, it is its own node.
        self.record = buffers(self.machine, schedule, settings, each_node=self.path == "assembled")
        self.machine.run(0, schedule, self.record)

    def advance(self, steps: int, schedule: Schedule, phase: str) -> None:
        """Up to so many steps, on rows renewed where that is due."""
        machine = self.machine
        if self.finite:
            if self.done >= self.renewal[0]:
                self._renew(phase)
            steps = min(steps, int(self.renewal[0]) - self.done)
        _, code = machine.run(steps, schedule, self.record)
        if code == NEW_ROWS:
            machine.follow_curves()
        if code == OFF_LINE:
            beyond = (k for k, c in enumerate(self.system.contacts) if self._off(k, len(c.chords)))
            name = self.system.contacts[next(beyond)].name
            raise AnalysisError(left_the_line(name, self.done * self.scheme.step, phase))
        if code == NOT_FINITE or not np.isfinite(machine.fields.u.sum() + machine.fields.q.sum()):
            raise AnalysisError(not_finite(self.done * self.scheme.step, phase, self.scheme.step))

    def _off(self, k: int, chords: int) -> bool:
        """Whether the foot of a point is beyond an end of a line of so many chords."""
        segment, xi = int(self.machine.contacts.segment[k]), float(self.machine.contacts.xi[k])
        return (segment == 0 and xi < -1e-9) or (segment == chords - 1 and xi > 1.0 + 1e-9)

    def _renew(self, phase: str) -> None:
        machine = self.machine
        self.renewed_from[:] = found_on(machine.surfaces)
        surfaces, nodes, lost = renew(machine, machine.surfaces)
        if len(lost):
            at = self.done * self.scheme.step
            contact = machine.nodes.names[int(machine.nodes.owner[lost[0]])]
            coordinates = ", ".join(f"{v:.6g}" for v in machine.nodes.position[lost[0]])
            raise AnalysisError(
                f"contact {contact}: the slave node at ({coordinates}) left the master surface over an edge at "
                f"t = {at:.6g} s (phase {phase}); shorten the phase, slow the support down or make the master larger"
            )
        take_over(machine, surfaces, nodes, turning(machine, surfaces, nodes, self.distances))
        machine.state.reference[1] = fading(machine, self.facets)
        interval = steps_to_renewal(machine, self.distances, int(self.renewal[1]))
        self.renewal[:] = self.done + interval, interval
        self.renewed_at[:] = np.concatenate([machine.displacement, machine.state.motion[0]])

    def velocity(self) -> Array:
        """Velocity (n,) of the freedoms, β2 of a step before the present."""
        return self.machine.fields.q[self.machine.layout.index]

    def node_history(self, start: int) -> NodeHistory | None:
        """Histories of the nodes, where there are any."""
        return node_history(self.machine, self.record, start, self.recorded)

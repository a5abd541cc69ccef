"""The stepper of point contacts on structures in their complete basis of modes."""

from __future__ import annotations

import numpy as np

from ....errors import AnalysisError, CaseError
from ....system import System
from ....system.uncoupled import UncoupledModes, no_complete_basis, uncoupled_modes
from ....typing import Array
from ...beta2 import StepLimit, scheme, step_limit
from ...columns import CONTACT_RECORD, ENERGY_RECORD, WORK_COLUMNS
from ...node_history import NodeHistory
from ...restart import motion_ratio
from ...saved import INFINITY, STATUS_RANGE, Bounds
from ...schedule import Schedule
from ...settings import ASKED, Settings, choose_step, not_finite
from ...sketch import BODIES, differing, sketch
from ...stepper import Disturbance
from ...trajectory import Trajectory
from ..curve import check_stiffness, follow, left_the_line
from .kernel import NEW_ROWS, NOT_FINITE, OFF_LINE
from .layout import Record
from .machine import Machine, modal_machine
from .operators import FINITE
from .start import coefficients, initial_state

STATE_FIELDS = ("u", "q", "d", "constant", "coefficients")
PREDICTED = ("predicted", "value", "rate")


def modal_stepper(
    system: System, settings: Settings, mu: float | None, modes: UncoupledModes, reason: str
) -> ModalStepper:
    """A system of point contacts made ready; mu scales every contact's friction law at its slip speed. modes are those
    of `choose_path`, reason is why.

    Raises CaseError for a step beyond the limit and contact springs that the step cannot follow.
    """
    system = system.at_friction(mu)
    limit = step_limit(system, settings.beta2)
    numbers = scheme(choose_step(limit, settings), settings.beta2)
    check_stiffness(system, numbers.step)
    return ModalStepper(modal_machine(system, numbers, modes), modes, limit, reason)


def refuses(system: System) -> str:
    """Why it does not take a system; "" if it does."""
    return no_complete_basis(system)


def choose_path(system: System, settings: Settings) -> tuple[UncoupledModes | None, str]:
    """Complete modal basis where it is exact, else None; and the reason in words."""
    if settings.path == "nodal":
        return None, ASKED
    modes = uncoupled_modes(system)
    if modes.proportional:
        return modes, "complete modal basis: damping is proportional in every component, the scheme is the same"
    if settings.path == "modal":
        raise CaseError(
            "temporal.path", "modal", "damping is not proportional, so modes stay coupled; take nodal or auto"
        )
    return None, "damping is not proportional in every component"


class ModalStepper:
    """See `temporal.stepper.Stepper`."""

    path = "modal"
    threaded = False
    works = WORK_COLUMNS

    def __init__(self, machine: Machine, modes: UncoupledModes, limit: StepLimit, reason: str) -> None:
        self.machine, self.modes, self.limit, self.reason = machine, modes, limit, reason
        self.scheme = machine.scheme
        contacts = machine.system.contacts
        self.contact_names, self.closed = tuple(c.name for c in contacts), tuple(c.closed for c in contacts)
        self.parts = sketch(machine.system, machine.system.contact_nodes())

    @property
    def system(self) -> System:
        """What is marched."""
        return self.machine.system

    @property
    def done(self) -> int:
        """Steps done."""
        return int(self.machine.state.counters[0])

    @property
    def statistics(self) -> Array:
        """Of every step since the phase began (m, 8)."""
        return self.machine.state.statistics

    @property
    def recorded(self) -> int:
        """How many records are filled."""
        return int(self.record.kept[0])

    @property
    def sweeps(self) -> tuple[int, int]:
        """Most in a step, and steps that did not settle."""
        return int(self.machine.state.counters[1]), int(self.machine.state.counters[2])

    @property
    def counted(self) -> tuple[str, int]:
        """Where the state has the steps done."""
        return "state_counters", 0

    def use_threads(self, *, two: bool) -> None:
        """One thread is what it takes."""

    def node_history(self, start: int) -> NodeHistory | None:
        """A contact is one node."""
        return None

    def begin(self, schedule: Schedule, settings: Settings, disturbance: Disturbance | None) -> None:
        """At rest or in steady sliding, disturbed if so asked."""
        initial_state(self.machine, self.modes, schedule, settings, disturbance)

    def state(self) -> dict[str, Array]:
        """What moves on from step to step."""
        machine = self.machine
        fields = {f"field_{name}": getattr(machine.fields, name) for name in STATE_FIELDS}
        return fields | {f"state_{name}": np.asarray(getattr(machine.state, name)) for name in machine.state._fields}

    def bounds(self) -> Bounds:
        """What is counted, and what points into arrays."""
        machine, contacts = self.machine, self.machine.table.contacts
        segments = np.where(contacts.kind == FINITE, np.diff(contacts.nodes_at) - 2, machine.state.segment)
        return {
            "state_status": STATUS_RANGE,
            "state_segment": (np.minimum(segments, 0), segments),
            "state_counters": (0, np.array([INFINITY, INFINITY, INFINITY, max(machine.contacts - 1, 0)])),
            "state_active": (0, machine.table_values.shape[0] - 1),
            "state_statistics": (-1.0, INFINITY),
        }

    def check(self, restart: Trajectory) -> None:
        """Raise CaseError for a state in the modes of other bodies: padded, they can have the same shape."""
        others = [part for part in differing(self.parts, restart.state["model"]) or () if part.name in BODIES]
        if others:
            raise CaseError(
                "restart",
                " and ".join(part.name for part in others),
                "the same bodies: a run on the modal path is saved in the modes of its bodies; runs with "
                'temporal.path = "nodal" can go on with others',
            )

    def resume(self, restart: Trajectory, schedule: Schedule, *, changed: bool) -> None:
        """Take up a state that was checked."""
        machine = self.machine
        for name, held in self.state().items():
            held[:] = restart.state[name]
        kept = {name: getattr(machine.state, name).copy() for name in PREDICTED}
        machine.repack()
        for name, values in kept.items():
            getattr(machine.state, name)[:] = values
        if changed:
            # The places that the supports have reached stay, whatever a unit of their motion is now.
            machine.state.motion[:] /= motion_ratio(self.parts, restart, machine.system.motion.names)
            machine.free_increment(coefficients(machine, schedule))
            machine.predict()

    def make_room(self, schedule: Schedule, settings: Settings) -> None:
        """Room for all records from the present step on."""
        machine, every = self.machine, settings.record_every
        count = max((schedule.steps - 1) // every - (self.done - 1) // every, 0)
        rows = [machine.system.points[name].free[:2].toarray() for name in settings.watch]
        lift = [machine.system.points[name].lift[:2] for name in settings.watch]
        free = np.vstack([np.zeros((0, machine.system.size)), *rows])
        self.record = Record(
            every=every,
            contacts=np.zeros((count, machine.contacts, CONTACT_RECORD)),
            watch=np.zeros((count, len(free), 3)),
            energies=np.zeros((count, ENERGY_RECORD)),
            kept=np.zeros(1, dtype=np.int64),
            watch_rows=np.ascontiguousarray(machine.laid_out(self.modes.project(free)[0])),
            watch_lift=np.vstack([np.zeros((0, machine.table.motions)), *lift]),
        )
        machine.run(0, schedule, self.record)

    def advance(self, steps: int, schedule: Schedule, phase: str) -> None:
        """Up to so many steps; fewer where a contact comes to other rows."""
        machine = self.machine
        _, code = machine.run(steps, schedule, self.record)
        if code == NEW_ROWS:
            _follow_segments(machine)
        at = self.done * self.scheme.step
        if code == OFF_LINE:
            contact = machine.system.contacts[int(machine.state.counters[3])]
            raise AnalysisError(left_the_line(contact.name, at, phase))
        # Between records, or where no row sees it.
        finite = np.isfinite(machine.fields.u).all() and np.isfinite(machine.fields.q).all()
        if code == NOT_FINITE or not finite:
            raise AnalysisError(not_finite(at, phase, self.scheme.step))

    def velocity(self) -> Array:
        """Velocity (n,) of the freedoms, β2 of a step before the present."""
        machine, out = self.machine, np.zeros(self.system.size)
        q, first = machine.fields.q[machine.order], 0
        for block in self.modes.real:
            count = block.vectors.shape[1]
            out[block.freedoms] = block.vectors @ q[first : first + count]
            first += count
        return out


def _follow_segments(machine: Machine) -> None:
    """Move finite-sliding contacts to the segment their slave has entered, and take its rows."""
    contacts, state = machine.table.contacts, machine.state
    for c in range(machine.contacts):
        if contacts.kind[c] == 0:
            continue
        start = int(contacts.nodes_at[c])
        chords = contacts.chords[start : int(contacts.nodes_at[c + 1]) - 1]
        state.segment[c], state.xi[c] = follow(int(state.segment[c]), float(state.xi[c]), chords)
    machine.repack()
    machine.predict()

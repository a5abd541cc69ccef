"""Members of an ensemble made ready to march side by side: operators that they share, states of each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ....kernels import denormals_flushed
from ....laws.friction import friction_rows
from ....system import System
from ....system.uncoupled import UncoupledModes
from ....typing import Array, IntArray
from ...beta2 import Scheme
from ...columns import CONTACT_RECORD
from ...legs import Acting
from ...schedule import Schedule
from ...settings import Settings
from .batch_kernel import BatchForcing, BatchRecord, run_batch
from .batch_pass import ROWS, BatchFields, BatchModal
from .machine import Machine, modal_machine
from .stage import LoopState
from .start import initial_state
from .vectors import LANES

CHUNK = 10_000  # steps between looks at whether to go on


def member_machine(
    system: System, scheme: Scheme, modes: UncoupledModes, schedule: Schedule, settings: Settings
) -> Machine:
    """A member before its first step. Raises what a run that begins so raises."""
    machine = modal_machine(system, scheme, modes)
    initial_state(machine, modes, schedule, settings)
    return machine


def friction_of(systems: Sequence[System]) -> Array:
    """Friction (k, m, …) of the contacts of k members, rows of `laws.packed` of one width."""
    rows = [friction_rows([c.law for c in system.contacts]) for system in systems]
    widest = max(row.shape[1] for row in rows)
    return np.array([np.pad(row, ((0, 0), (0, widest - row.shape[1]))) for row in rows])


class MemberBatch:
    """Members that are stepped together: up to ``LANES`` of them, any number on a device (`device`).

    states: of `LoopState`, with the members (k, …) in front. lost (k,): the step at which a member was no longer
    finite, −1 while it is. friction (k, m, …) may be replaced between steps.
    """

    def __init__(self, machines: Sequence[Machine], modes: UncoupledModes, watch: Sequence[str]) -> None:
        first = machines[0]
        self.scheme, self.table, self.scratch = first.scheme, first.table, first.scratch
        self.system, self.members = first.system, len(machines)
        self.compliance = _compliance(first)
        self.modal = _modal(first, modes, watch)
        self.friction = friction_of([m.system for m in machines])
        rows = first.table.force_rows
        self.states = LoopState(
            **{name: np.ascontiguousarray([_rows(name, m, rows) for m in machines]) for name in LoopState._fields}
        )
        self.fields = _fields(machines, rows)
        self.lost: IntArray = np.full(self.members, -1, dtype=np.int64)
        self.done = 0
        points = [self.system.points[name].lift[:2] for name in watch]
        self._watch_lift = np.vstack([np.zeros((0, first.table.motions)), *points])
        self._own = np.zeros((0, 0))
        self._lift = np.ascontiguousarray(np.vstack([first.table.lift[:rows], np.zeros((1, first.table.motions))]))

    def longest(self, every: int) -> int:
        """How many steps one call of `advance` may take with a record each ``every`` steps."""
        return CHUNK

    def room(self, records: int, every: int) -> BatchRecord:
        """Room for so many records."""
        watched = self.modal.watch.shape[0]
        return BatchRecord(
            every=every,
            contacts=np.zeros((records, self.members, len(self.system.contacts), CONTACT_RECORD)),
            watch=np.zeros((records, self.members, watched, 3)),
            kept=np.zeros(1, dtype=np.int64),
            sums=np.zeros((3 * watched, self.fields.ud.shape[1])),
            before=np.zeros((self.members, 2, self.table.motions)),
            watch_lift=self._watch_lift,
        )

    def advance(self, steps: int, acting: Acting, record: BatchRecord) -> None:
        """So many steps under what acts over steps + 1."""
        forcing = self._forcing(*acting.spread())
        with denormals_flushed():
            run_batch(
                steps, self.done, self.modal, self.table.contacts, self.friction, self.scheme, forcing,
                self.compliance, self.fields, self.states, self.scratch, record, self.lost,
            )  # fmt: skip
        self.done += steps
        for lane in range(self.members):
            if self.lost[lane] < 0 and not np.isfinite(self.fields.ud[:, lane]).all():
                self.lost[lane] = self.done  # between records, or where no row sees it

    def _forcing(self, loads: Array, increments: Array) -> BatchForcing:
        """What acts, and in which steps it does not stay as it was."""
        # With β2 = 1/2 the supports' velocity is the increment of the step before; else it remembers more.
        changes = np.ones(len(loads), dtype=np.int64)
        if self.scheme.memory == 0.0 and len(loads) > 2:
            both = np.concatenate([loads, increments], axis=2)
            differs = np.abs(np.diff(both, axis=0)).max(axis=(1, 2))
            changes[1:-1] = np.maximum(differs[1:], differs[:-1]) > 0.0
        return BatchForcing(
            np.ascontiguousarray(loads), np.ascontiguousarray(increments), changes, self._own, self._lift
        )


def _compliance(machine: Machine) -> Array:
    rows = machine.table.force_rows
    assert machine.compliance is not None
    return np.ascontiguousarray(machine.compliance[:rows])


def _rows(name: str, machine: Machine, rows: int) -> Any:
    """A part of a machine's state; of rows those of the contacts alone, and one that is zero."""
    values = np.asarray(getattr(machine.state, name))
    if name in ("predicted", "value", "rate", "force"):
        return np.concatenate([values[:rows], np.zeros(1)])
    return values


def _fields(machines: Sequence[Machine], rows: int) -> BatchFields:
    """The modes of all members in their lanes; lanes without a member stay at zero."""
    size, auxiliary = len(machines[0].fields.u), len(machines[0].fields.coefficients)
    lanes = -(-len(machines) // LANES) * LANES
    fields = BatchFields(
        ud=np.zeros((2 * size, lanes)),
        q=np.zeros((size, lanes)),
        constant=np.zeros((size, lanes)),
        push=np.zeros((rows + 1, lanes)),
        pull=np.zeros((rows + 1, lanes)),
        coefficients=np.zeros((auxiliary, lanes)),
    )
    for lane, machine in enumerate(machines):
        fields.ud[0::2, lane], fields.ud[1::2, lane] = machine.fields.u, machine.fields.d
        fields.q[:, lane] = machine.fields.q
        fields.pull[:rows, lane] = machine.state.predicted[:rows]
        fields.coefficients[:, lane] = machine.fields.coefficients
    return fields


def _modal(machine: Machine, modes: UncoupledModes, watch: Sequence[str]) -> BatchModal:
    """Operators of all members, in the order in which the loop reads them."""
    modal, rows, scheme = machine.modal, machine.table.force_rows, machine.scheme
    assert modal is not None
    plain = np.vstack([machine.table_values[:rows], machine.table_values[-1:]])
    auxiliary = machine.table_values[rows:-1]
    driven = plain * modal.drive
    chosen: list[int] = []
    chosen_at, stream_at = [0], [0]
    stream: list[Array] = []
    head = np.array([modal.forward * scheme.gain, -modal.restore, modal.forward * scheme.memory])
    for lo, hi in zip(modal.blocks[:-1], modal.blocks[1:], strict=True):
        met = [r for r in range(rows) if np.any(plain[r, lo:hi])] or [rows]
        met += [rows] * (-len(met) % ROWS if len(met) > 1 else 0)
        chosen += met
        chosen_at.append(len(chosen))
        pairs = [part[r, lo:hi] for r in met[-ROWS:] for part in (driven, plain)]
        stream.append(np.ravel(np.array([*head[:, lo:hi], *pairs]).T))
        stream_at.append(stream_at[-1] + len(stream[-1]))
    acts = [int(np.any(auxiliary[:, lo:hi])) for lo, hi in zip(modal.blocks[:-1], modal.blocks[1:], strict=True)]
    points = [machine.system.points[name].free[:2].toarray() for name in watch]
    watched = modes.project(np.vstack([np.zeros((0, machine.system.size)), *points]))[0]
    return BatchModal(
        blocks=modal.blocks,
        rows=np.array(chosen, dtype=np.int64),
        rows_at=np.array(chosen_at, dtype=np.int64),
        stream=np.concatenate(stream),
        stream_at=np.array(stream_at, dtype=np.int64),
        driven=np.ascontiguousarray(driven),
        plain=np.ascontiguousarray(plain),
        acts=np.array(acts, dtype=np.int64),
        auxiliary=np.ascontiguousarray(auxiliary * modal.drive),
        watch=np.ascontiguousarray(machine.laid_out(watched)),
        gain=scheme.gain,
        memory=scheme.memory,
    )

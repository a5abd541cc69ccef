"""Assembled operators, packed for the compiled loop, and the state that it moves on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ....kernels import denormals_flushed
from ....system import System
from ....system.uncoupled import UncoupledModes
from ....typing import Array, IntArray
from ...aligned import aligned, aligned_zeros
from ...beta2 import Scheme
from ...columns import FIRST_OPEN, FIRST_STICK, STATISTICS, WORKS
from ...schedule import Schedule
from ..curve import ROWS, foot, nodes_of
from .kernel import run_modal
from .layout import Fields, ModalRows, Record
from .operators import FINITE, ModalArrays, RowTable, row_table
from .stage import Forcing, LoopState, Scratch
from .vectors import LANES


@dataclass
class Machine:
    """A system made ready to march: rows, modes, state. Built by ``modal_machine``; ``repack`` is called when a
    finite-sliding contact enters another segment."""

    system: System
    scheme: Scheme
    table: RowTable
    modal: ModalArrays
    order: IntArray  # where in the loop's arrays each mode lies
    table_values: Array  # rows of the table in the path's coordinates, a zero row at the end
    state: LoopState
    fields: Fields
    scratch: Scratch
    rows: ModalRows | None = None
    compliance: Array | None = None
    lift: Array | None = None

    @property
    def contacts(self) -> int:
        """Number of contacts."""
        return len(self.system.contacts)

    def coordinates(self, vector: Array, modes: UncoupledModes) -> Array:
        """A vector of freedoms (n,) in modes."""
        weighted = self.system.mass @ vector
        return self.laid_out(np.concatenate([b.vectors.T @ weighted[b.freedoms] for b in modes.real]))

    def laid_out(self, values: Array) -> Array:
        """Rows or vectors (…, n) on modes, in the order and padding of the loop."""
        out = np.zeros((*values.shape[:-1], self.table_values.shape[1]))
        out[..., self.order] = values
        return out

    def repack(self) -> None:
        """Choose the active rows from the contacts' segments and pack them for the loop."""
        contacts, table = self.table.contacts, self.table
        active: list[int] = []
        zero = self.table_values.shape[0] - 1
        for c in range(self.contacts):
            first = int(contacts.table[c])
            active += [first, first + 1]
            if contacts.kind[c] == FINITE:
                count = int(contacts.nodes_at[c + 1] - contacts.nodes_at[c])
                for node in nodes_of(int(self.state.segment[c]), count):
                    active += [first + 2 + 2 * int(node) + d if node >= 0 else zero for d in range(2)]
        auxiliary = zero - table.auxiliary
        active += list(range(auxiliary, zero))
        chosen = np.array(active, dtype=np.int64)
        self.state.active[:] = chosen
        self.lift = np.vstack([self.table.lift, np.zeros((1, table.motions))])[np.append(chosen, zero)]
        values = np.ascontiguousarray(self.table_values[np.append(chosen, zero)])
        force_rows = values[: table.force_rows]
        self.rows = _modal_rows(values, self.modal)
        self.compliance = np.ascontiguousarray(values[:-1] @ (self.modal.drive[:, None] * force_rows.T))

    def predict(self) -> None:
        """Rows, their rates and their prediction from u, q and d as they are (start, or new rows)."""
        values = self.table_values[np.append(self.state.active, self.table_values.shape[0] - 1)]
        fields, state = self.fields, self.state
        assert self.lift is not None
        state.predicted[:] = values @ (fields.u + fields.d)
        state.value[:] = values @ fields.u + self.lift @ state.motion[0]
        state.rate[:] = values @ fields.q + self.lift @ state.motion[1]

    def free_increment(self, coefficients: Array) -> None:
        """d and its constant part at the start of a run, for forcing coefficients (aux,)."""
        fields = self.fields
        fields.coefficients[:] = coefficients
        auxiliary = self.table_values[-1 - self.table.auxiliary : -1]
        push = auxiliary.T @ coefficients
        fields.constant[:] = self.modal.drive * push
        fields.d[:] = self.modal.forward * fields.q - self.modal.restore * fields.u + fields.constant

    def run(self, steps: int, schedule: Schedule, record: Record) -> tuple[int, int]:
        """March up to ``steps`` steps; what was done and why it ended (kernel codes)."""
        first = int(self.state.counters[0])
        motion = self.system.motion
        assert self.lift is not None
        assert self.compliance is not None
        assert self.rows is not None
        forcing = Forcing(
            schedule.load_factors(first, steps + 1),
            schedule.motion_increments(first, steps + 1),
            motion.mass_own,
            motion.damping_own,
            motion.stiffness_own,
            self.lift,
        )
        with denormals_flushed():
            return run_modal(
                steps, self.modal, self.rows, self.table.contacts, self.scheme, forcing, self.compliance, self.fields,
                self.state, self.scratch, record, self.table.force_rows,
            )  # fmt: skip


def _modal_rows(values: Array, modal: ModalArrays) -> ModalRows:
    """For each block of modes the rows that are not zero on it."""
    met: list[int] = []
    at = [0]
    for lo, hi in zip(modal.blocks[:-1], modal.blocks[1:], strict=True):
        met += [r for r in range(values.shape[0] - 1) if np.any(values[r, lo:hi])]
        at.append(len(met))
    return ModalRows(aligned(values), np.array(met, dtype=np.int64), np.array(at, dtype=np.int64))


def _padded(sizes: list[int]) -> tuple[IntArray, IntArray]:
    """Place of each mode and ranges of blocks, every block filled up to whole vector registers.

    The modes filled in have no stiffness, no drive and no rows: they stay at zero.
    """
    index: list[int] = []
    blocks = [0]
    for size in sizes:
        index += range(blocks[-1], blocks[-1] + size)
        blocks.append(blocks[-1] + -(-size // LANES) * LANES)
    return np.array(index, dtype=np.int64), np.array(blocks, dtype=np.int64)


def modal_machine(system: System, scheme: Scheme, modes: UncoupledModes) -> Machine:
    """The scheme in the complete basis of real modes; exact for proportional damping of each component."""
    table = row_table(system)
    real, _ = modes.project(table.free.toarray())
    c, w2 = modes.damping, modes.stiffness
    dt, s = scheme.step, scheme.s
    effective = 1.0 + scheme.beta2 * dt * c
    index, blocks = _padded([len(b.freedoms) for b in modes.real])

    def padded(values: Array) -> Array:
        out = np.zeros((*values.shape[:-1], int(blocks[-1])))
        out[..., index] = values
        return aligned(out)

    arrays = ModalArrays(
        forward=padded((dt - dt**2 / 2 * c) / effective),
        restore=padded(dt**2 * s / 2 * w2 / effective),
        drive=padded(dt**2 * s / 2 / effective),
        damping=padded(c),
        stiffness=padded(w2),
        blocks=blocks,
    )
    return _machine(system, scheme, table, padded(real), arrays, index)


def _machine(
    system: System, scheme: Scheme, table: RowTable, values: Array, arrays: ModalArrays, index: IntArray
) -> Machine:
    m, size = len(system.contacts), values.shape[1]
    active = table.force_rows + table.auxiliary
    statistics = np.zeros((m, STATISTICS))
    statistics[:, [FIRST_STICK, FIRST_OPEN]] = -1.0
    state = LoopState(
        predicted=np.zeros(active + 1),
        value=np.zeros(active + 1),
        rate=np.zeros(active + 1),
        force=np.zeros(active + 1),
        normal=np.zeros(m),
        tangential=np.zeros(m),
        status=np.zeros(m, dtype=np.int64),
        segment=np.array([c.segment for c in system.contacts], dtype=np.int64),
        xi=np.array([c.xi for c in system.contacts], dtype=float),
        works=np.zeros(WORKS),
        statistics=statistics,
        counters=np.zeros(4, dtype=np.int64),
        active=np.zeros(active, dtype=np.int64),
        motion=np.zeros((2, table.motions)),
    )
    fields = Fields(
        u=aligned_zeros((size,)),
        q=aligned_zeros((size,)),
        d=aligned_zeros((size,)),
        constant=aligned_zeros((size,)),
        coefficients=np.zeros(table.auxiliary),
        buffer=np.zeros(size),
    )
    scratch = Scratch(
        displacement=np.zeros(active + 1),
        moved=np.zeros(active + 1),
        shape=np.zeros((m, ROWS)),
        slide=np.zeros((m, ROWS)),
        foot=foot(),
        delta=np.zeros(m),
        earlier=np.zeros(m),
        buffer=np.zeros(1),
    )
    padded = np.ascontiguousarray(np.vstack([values, np.zeros((1, size))]))
    return Machine(system, scheme, table, arrays, index, padded, state, fields, scratch)

"""What the time loop works on: assembled operators as plain arrays, in a complete modal basis.

Rows are scalar observations r·u of the structure: relative motions of small-sliding contacts,
positions of finite-sliding ones, load directions, couplings of moving supports. Contact forces act
along rows (Rᵀp), so the loop needs rows and nothing about elements.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from ....contact.interface import Contact
from ....laws.friction import friction_rows
from ....system import System
from ....typing import Array, IntArray, Sparse
from ..curve import ROWS

SMALL, FINITE = 0, 1


class ContactArrays(NamedTuple):
    """Per contact: kind, first active row, friction numbers, reference gap, and for finite sliding where
    its rows start in the table, its nodes and chords (flat, with offsets), side."""

    kind: IntArray
    base: IntArray
    friction: Array  # (m, k): the laws' numbers, see laws.packed
    gap: Array
    table: IntArray  # first row in the table of all rows
    nodes_at: IntArray  # (m + 1,) offsets into nodes
    nodes: Array  # (Σk, 2) reference positions of master nodes
    chords: Array  # (Σk,) chord after each node, 0 after the last
    slave: Array  # (m, 2) reference position
    side: Array
    kept: IntArray  # (m,) 1 where the contact is kept closed
    compliance: Array  # (m,) [m/N], 1/K_c, zero of rigid contact


class ModalArrays(NamedTuple):
    """The scheme per mode: d = forward·q − restore·u + drive·force, modal damping c, ω², and blocks."""

    forward: Array
    restore: Array
    drive: Array
    damping: Array
    stiffness: Array
    blocks: IntArray  # (b + 1,) mode ranges of uncoupled components


@dataclass(frozen=True)
class RowTable:
    """All rows (r, n): contact rows first, then loads, then couplings M_L, then C_L. lift (r, p)."""

    free: Sparse
    lift: Array
    contacts: ContactArrays
    loads: int
    motions: int
    force_rows: int

    @property
    def auxiliary(self) -> int:
        """Number of rows that carry loads and support couplings."""
        return self.loads + 2 * self.motions


def row_table(system: System) -> RowTable:
    """Collect every row of a system."""
    free: list[Sparse] = []
    lift: list[Array] = []
    kind, base, table, offsets = [], [], [], [0]
    nodes: list[Array] = []
    chords: list[Array] = []
    active = rows = 0
    for contact in system.contacts:
        kind.append(SMALL if contact.sliding == "small" else FINITE)
        base.append(active)
        table.append(rows)
        blocks, lifts = _contact_rows(contact)
        free += blocks
        lift += lifts
        rows += sum(block.shape[0] for block in blocks)
        active += 2 if contact.sliding == "small" else ROWS
        nodes.append(contact.master_positions)
        chords.append(np.append(contact.chords, 0.0))
        offsets.append(offsets[-1] + len(contact.master_positions))
    motion = system.motion
    p = len(motion.names)
    for vector in system.loads.values():
        free.append(sp.csr_array(vector[None]))
        lift.append((vector @ motion.lift)[None])
    for coupling in (motion.mass, motion.damping):
        if p:
            free.append(sp.csr_array(coupling.T))
            lift.append(np.zeros((p, p)))
    empty = sp.csr_array((0, system.size))
    contacts = ContactArrays(
        kind=np.array(kind, dtype=np.int64),
        base=np.array(base, dtype=np.int64),
        friction=friction_rows([c.law for c in system.contacts]),
        gap=np.array([c.gap for c in system.contacts], dtype=float),
        table=np.array(table, dtype=np.int64),
        nodes_at=np.array(offsets, dtype=np.int64),
        nodes=np.concatenate(nodes) if nodes else np.zeros((0, 2)),
        chords=np.concatenate(chords) if chords else np.zeros(0),
        slave=np.array([c.slave_position for c in system.contacts]).reshape(-1, 2),
        side=np.array([float(c.side) for c in system.contacts]),
        kept=np.array([int(c.closed) for c in system.contacts], dtype=np.int64),
        compliance=np.array([c.compliance for c in system.contacts], dtype=float),
    )
    return RowTable(
        free=sp.csr_array(sp.vstack([empty, *free])),
        lift=np.vstack([np.zeros((0, p)), *lift]),
        contacts=contacts,
        loads=len(system.loads),
        motions=p,
        force_rows=active,
    )


def _contact_rows(contact: Contact) -> tuple[list[Sparse], list[Array]]:
    if contact.sliding == "small":
        rows = sp.csr_array(np.array([contact.normal_row, contact.tangent_row]))
        return [rows], [np.array([contact.normal_lift, contact.tangent_lift])]
    return [contact.slave.free, contact.master.free], [contact.slave.lift, contact.master.lift]

"""What the time loop works on: assembled operators as plain arrays, nodal or in a complete modal basis.

Rows are scalar observations r·u of the structure: relative motions of small-sliding contacts,
positions of finite-sliding ones, load directions, couplings of moving supports. Contact forces act
along rows (Rᵀp), so the loop needs rows and nothing about elements.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy.linalg as sl
import scipy.sparse as sp

from ....contact.interface import Contact
from ....errors import AnalysisError
from ....laws.friction import friction_rows
from ....system import System
from ....typing import Array, IntArray, Sparse
from ...beta2 import Scheme

SMALL, FINITE = 0, 1
POINTS_PER_FINITE_CONTACT = 5  # the slave and four master nodes


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


class NodalArrays(NamedTuple):
    """The scheme on freedoms: CSR of Δt²s/2 K, of Δt M − Δt²/2 C and of C; factor of M + β2ΔtC."""

    k_ptr: IntArray
    k_col: IntArray
    k_val: Array
    m_ptr: IntArray
    m_col: IntArray
    m_val: Array
    c_ptr: IntArray
    c_col: IntArray
    c_val: Array
    factor: Array  # (bandwidth + 1, n) lower LDLᵀ band: diagonal D, unit lower columns below it
    load_gain: float  # Δt² s/2


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
        active += 2 if contact.sliding == "small" else 2 * POINTS_PER_FINITE_CONTACT
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


def nodal_arrays(system: System, scheme: Scheme) -> tuple[NodalArrays, IntArray]:
    """Arrays of the nodal path and the order (n,) of freedoms that keeps its band narrow."""
    effective = sp.csr_array(system.mass + scheme.beta2 * scheme.step * system.damping)
    effective.eliminate_zeros()
    order = np.asarray(sp.csgraph.reverse_cuthill_mckee(sp.csr_matrix(effective), symmetric_mode=True), dtype=np.int64)
    gain = scheme.step**2 * scheme.s / 2

    def permuted(matrix: Sparse) -> Sparse:
        out = sp.csr_array(sp.csr_array(matrix)[order][:, order])
        out.sort_indices()
        return out

    stiffness = permuted(gain * system.stiffness)
    inertia = permuted(scheme.step * system.mass - scheme.step**2 / 2 * system.damping)
    damping = permuted(system.damping)
    k, m, c = (
        (a.indptr.astype(np.int64), a.indices.astype(np.int64), a.data.astype(float))
        for a in (stiffness, inertia, damping)
    )
    return NodalArrays(*k, *m, *c, factor=_band_factor(permuted(effective)), load_gain=gain), order


def _band_factor(matrix: Sparse) -> Array:
    """LDLᵀ of a symmetric positive definite band: row 0 is 1/D, row k the k-th subdiagonal of L."""
    coo = sp.coo_array(matrix)
    width = int(np.max(np.abs(coo.row - coo.col), initial=0))
    n = matrix.shape[0]
    band = np.zeros((width + 1, n))
    lower = coo.row >= coo.col
    band[(coo.row - coo.col)[lower], coo.col[lower]] = coo.data[lower]
    try:
        factor = sl.cholesky_banded(band, lower=True)
    except sl.LinAlgError as error:
        raise AnalysisError("the mass matrix is not positive definite: a freedom has stiffness but no mass") from error
    diagonal = factor[0].copy()
    factor = factor / diagonal
    factor[0] = 1.0 / diagonal**2
    return np.ascontiguousarray(factor)

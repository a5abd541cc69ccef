"""The compiled time loop: one pass per step, no allocation, no knowledge of elements.

Order within step n: the free prediction of every row at t_{n+1} is at hand; the contacts are solved
for the forces at t_n; works and extrema are accumulated with velocities at t_n; a record is kept
when due; then one pass adds the forces, completes u_{n+1} and predicts t_{n+2}.
"""

from __future__ import annotations

import numpy as np

from ....kernels import njit
from ....typing import Array
from ...arithmetic import CAREFUL, FAST
from ...beta2 import Scheme
from ...columns import DAMPING, REC_GAP, REC_NORMAL, REC_POSITION, REC_SLIP, REC_STATUS, REC_TANGENTIAL
from ..borrow import borrow
from ..curve import ROWS, leaves
from .layout import Fields, ModalRows, Record
from .modal_path import complete_modal, modal_constant, modal_energies, modal_pass
from .operators import ContactArrays, ModalArrays
from .stage import Forcing, LoopState, Scratch, accumulate, advance_rows, contact_stage, forces_of, reference

DONE, NEW_ROWS, OFF_LINE, NOT_FINITE = range(4)


@njit(cache=True, allocates=False, fastmath=FAST)
def _record(
    kinetic: float,
    elastic: float,
    k: int,
    contacts: ContactArrays,
    scheme: Scheme,
    forcing: Forcing,
    fields: Fields,
    increment: Array,
    state: LoopState,
    scratch: Scratch,
    record: Record,
    loads_at: int,
) -> None:  # pragma: no cover - compiled
    """Keep one record at t_n; increment (n,) is the completed d."""
    at = record.kept[0]
    record.kept[0] += 1
    dt, s, two_b = scheme.step, scheme.s, 2.0 * scheme.beta2
    for c in range(contacts.kind.shape[0]):
        base = contacts.base[c]
        width = 2 if contacts.kind[c] == 0 else ROWS
        slip, gap = 0.0, contacts.gap[c] if contacts.kind[c] == 0 else 0.0
        for a in range(width):
            slip += scratch.slide[c, a] * (state.rate[base + a] + two_b * scratch.moved[base + a]) / s
            gap += scratch.shape[c, a] * scratch.displacement[base + a]
            if contacts.kind[c] != 0:
                gap += scratch.shape[c, a] * reference(c, a, contacts, state)
        row = record.contacts[at, c]
        row[REC_NORMAL], row[REC_TANGENTIAL], row[REC_SLIP] = state.normal[c], state.tangential[c], slip
        row[REC_GAP] = gap
        row[REC_STATUS] = state.status[c]
        row[REC_POSITION] = state.segment[c] + state.xi[c]
    motions = forcing.increments.shape[1]
    # Arrays out of their tuples before the inner loop: inside it each access would count as a new owner.
    u, q, rows = fields.u, fields.q, record.watch_rows
    for w in range(rows.shape[0]):
        su = sq = sd = 0.0
        for i in range(increment.shape[0]):
            r = rows[w, i]
            su += r * u[i]
            sq += r * q[i]
            sd += r * increment[i]
        for p in range(motions):
            lift = record.watch_lift[w, p]
            su += lift * state.motion[0, p]
            sq += lift * state.motion[1, p]
            sd += lift * forcing.increments[k, p]
        record.watch[at, w, 0] = su
        record.watch[at, w, 1] = (sq + two_b * sd / dt) / s
        record.watch[at, w, 2] = 2.0 * (sd / dt - sq) / (dt * s)
    loads = forcing.loads.shape[1]
    for p in range(motions):
        kinetic += state.motion[1, p] * state.rate[loads_at + loads + p]
        for o in range(motions):
            kinetic += 0.5 * state.motion[1, p] * forcing.mass_own[p, o] * state.motion[1, o]
            before = state.motion[0, o] - dt * state.motion[1, o]
            elastic += 0.5 * state.motion[0, p] * forcing.stiffness_own[p, o] * before
    record.energies[at, 0] = kinetic
    record.energies[at, 1] = elastic
    for j in range(5):
        record.energies[at, 2 + j] = state.works[j]


@njit(cache=True, allocates=False)
def _leaves_segment(contacts: ContactArrays, state: LoopState) -> bool:  # pragma: no cover - compiled
    for c in range(contacts.kind.shape[0]):
        if contacts.kind[c] != 0:
            count = contacts.nodes_at[c + 1] - contacts.nodes_at[c]
            if leaves(state.segment[c], state.xi[c], count - 1):
                return True
    return False


@njit(cache=True, allocates=False)
def _all_finite(state: LoopState) -> bool:  # pragma: no cover - compiled
    total = 0.0
    for r in range(state.value.shape[0] - 1):
        total += state.value[r]
    return bool(np.isfinite(total))


@njit(cache=True, allocates=False, fastmath=CAREFUL)
def run_modal(
    steps: int,
    modal: ModalArrays,
    rows: ModalRows,
    contacts: ContactArrays,
    scheme: Scheme,
    forcing: Forcing,
    compliance: Array,
    fields: Fields,
    state: LoopState,
    scratch: Scratch,
    record: Record,
    loads_at: int,
) -> tuple[int, int]:  # pragma: no cover - compiled
    """Up to ``steps`` steps in the modal basis; forcing holds one step more. Steps done and why it ended.

    loads_at: first row that carries no contact force.
    """
    # The caller keeps every array alive; borrowed ones cost no counting in the functions below.
    modal, rows, contacts, forcing = borrow(modal), borrow(rows), borrow(contacts), borrow(forcing)
    fields, state, scratch, record = borrow(fields), borrow(state), borrow(scratch), borrow(record)
    compliance = borrow(compliance)
    for k in range(steps):
        off = contact_stage(k, contacts, scheme, forcing, compliance, state, scratch)
        if off >= 0:
            state.counters[3] = off
            return k, OFF_LINE
        if state.counters[0] % record.every == 0:
            if not _all_finite(state):
                return k, NOT_FINITE
            complete_modal(modal, rows, state.force, fields, loads_at)
            kinetic, elastic = modal_energies(modal, scheme, fields.u, fields.q)
            _record(
                kinetic,
                elastic,
                k,
                contacts,
                scheme,
                forcing,
                fields,
                fields.buffer,
                state,
                scratch,
                record,
                loads_at,
            )
        accumulate(k, contacts, scheme, forcing, state, scratch, loads_at)
        advance_rows(k, scheme, forcing, state, scratch)
        if forces_of(k + 1, scheme, forcing, state, fields.coefficients):
            modal_constant(modal, rows, fields, loads_at)
        lost = modal_pass(modal, scheme, rows, state.force, fields, state.predicted)
        state.works[DAMPING] += lost * scheme.step
        state.counters[0] += 1
        if _leaves_segment(contacts, state):
            return k + 1, NEW_ROWS
    return steps, DONE

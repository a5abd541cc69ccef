"""The compiled time loop: one pass per step, no allocation, no knowledge of elements.

Order within step n: the free prediction of every row at t_{n+1} is at hand; the contacts are solved
for the forces at t_n; works and extrema are accumulated with velocities at t_n; a record is kept
when due; then one pass adds the forces, completes u_{n+1} and predicts t_{n+2}.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit

from ..typing import Array, IntArray
from .beta2 import Scheme
from .borrow import borrow
from .operators import ContactArrays, ModalArrays, NodalArrays
from .stage import (
    CONTACT_RECORD,
    DAMPING,
    REC_GAP,
    REC_NORMAL,
    REC_PLACE,
    REC_SLIP,
    REC_STATUS,
    REC_TANGENTIAL,
    Forcing,
    LoopState,
    Scratch,
    accumulate,
    advance_rows,
    contact_stage,
    forces_of,
)

# Reassociation lets dot products run in vector registers; NaN and infinity stay honoured, because a
# run that blows up must be seen.
_unsigned: Any = np.uint64
_FAST = {"reassoc", "contract", "nsz", "arcp"}
# At the contacts the order of additions stays as written; divisions by constants may become products.
_CAREFUL = {"contract", "nsz", "arcp"}

DONE, NEW_ROWS, OFF_LINE, NOT_FINITE = range(4)
# Energies of a record [J]: kinetic and elastic at t_{n−1/2}, then the works up to there.
ENERGY_RECORD = 7


class Fields(NamedTuple):
    """State of the path: u, q and the free increment d (n,) each, in modal coordinates or freedoms;
    constant (n,): its part from loads and supports, coefficients (aux,) that made it, buffer (n,)."""

    u: Array
    q: Array
    d: Array
    constant: Array
    coefficients: Array
    buffer: Array


class ModalRows(NamedTuple):
    """Active rows on modes: values (a + 1, n), a zero row at the end. For each block of modes the rows that
    push on it (contact forces) and those that read it, with offsets (b + 1,) into both lists."""

    values: Array
    pushing: IntArray
    push_at: IntArray
    pulling: IntArray
    pull_at: IntArray


class NodalRows(NamedTuple):
    """Active rows on freedoms as CSR (a rows), and the answers (n, f) of the structure to force rows."""

    ptr: IntArray
    col: IntArray
    val: Array
    answers: Array
    auxiliary: Array  # (aux, n) dense rows that carry loads and supports


class Record(NamedTuple):
    """Decimated output: contacts (r, m, 6), watch (r, w, 3) of u, v, a, energies (r, 7), kept (1,) how many."""

    every: int
    contacts: Array
    watch: Array
    energies: Array
    kept: IntArray
    watch_rows: Array  # (w, n) in the path's coordinates
    watch_lift: Array  # (w, p)


@njit(cache=True, fastmath=_FAST)
def _modal_energies(modal: ModalArrays, scheme: Scheme, u: Array, q: Array) -> tuple[float, float]:
    # pragma: no cover - compiled
    """Kinetic and elastic energy at t_{n−1/2}: ½ q·q and ½ u_n·ω²·u_{n−1}."""
    kinetic = elastic = 0.0
    stiffness, step = modal.stiffness, scheme.step
    for i in range(u.shape[0]):
        kinetic += q[i] * q[i]
        elastic += stiffness[i] * u[i] * (u[i] - step * q[i])
    return 0.5 * kinetic, 0.5 * elastic


@njit(cache=True)
def _csr_form(ptr: IntArray, col: IntArray, val: Array, x: Array, y: Array) -> float:  # pragma: no cover
    total = 0.0
    for i in range(x.shape[0]):
        row = 0.0
        for p in range(ptr[i], ptr[i + 1]):
            row += val[p] * y[col[p]]
        total += x[i] * row
    return total


@njit(cache=True)
def _nodal_energies(nodal: NodalArrays, scheme: Scheme, u: Array, q: Array, buffer: Array) -> tuple[float, float]:
    # pragma: no cover - compiled
    dt = scheme.step
    damped = _csr_form(nodal.c_ptr, nodal.c_col, nodal.c_val, q, q)
    kinetic = (_csr_form(nodal.m_ptr, nodal.m_col, nodal.m_val, q, q) + 0.5 * dt * dt * damped) / dt
    for i in range(u.shape[0]):
        buffer[i] = u[i] - dt * q[i]
    elastic = _csr_form(nodal.k_ptr, nodal.k_col, nodal.k_val, u, buffer) / nodal.load_gain
    return 0.5 * kinetic, 0.5 * elastic


@njit(cache=True, fastmath=_FAST)
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
        width = 2 if contacts.kind[c] == 0 else 10
        slip = gap = 0.0
        for a in range(width):
            slip += scratch.slide[c, a] * (state.rate[base + a] + two_b * scratch.moved[base + a]) / s
            gap += scratch.shape[c, a] * scratch.place[base + a]
        row = record.contacts[at, c]
        row[REC_NORMAL], row[REC_TANGENTIAL], row[REC_SLIP] = state.normal[c], state.tangential[c], slip
        row[REC_GAP] = contacts.gap[c] + gap
        row[REC_STATUS] = state.status[c]
        row[REC_PLACE] = state.segment[c] + state.xi[c]
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


@njit(cache=True, fastmath=_FAST, inline="always")
def _push(
    d: Array, drive: Array, rows: Array, chosen: IntArray, at: int, end: int, force: Array, lo: int, hi: int
) -> None:  # pragma: no cover - compiled
    """d += drive Σ p·row over rows chosen[at:end] and modes lo … hi − 1, up to three rows at a time."""
    while at < end:
        left = end - at
        r0 = chosen[at]
        p0 = force[r0]
        if left >= 3:
            r1, r2 = chosen[at + 1], chosen[at + 2]
            p1, p2 = force[r1], force[r2]
            for i in range(lo, hi):
                d[i] += drive[i] * (p0 * rows[r0, i] + p1 * rows[r1, i] + p2 * rows[r2, i])
            at += 3
        elif left == 2:
            r1 = chosen[at + 1]
            p1 = force[r1]
            for i in range(lo, hi):
                d[i] += drive[i] * (p0 * rows[r0, i] + p1 * rows[r1, i])
            at += 2
        else:
            for i in range(lo, hi):
                d[i] += drive[i] * (p0 * rows[r0, i])
            at += 1


@njit(cache=True, fastmath=_FAST, inline="always")
def _pull(
    u: Array, d: Array, rows: Array, chosen: IntArray, at: int, end: int, lo: int, hi: int, predicted: Array
) -> None:  # pragma: no cover - compiled
    """predicted[r] += row·(u + d) over rows chosen[at:end] and modes lo … hi − 1."""
    while at < end:
        left = end - at
        r0 = chosen[at]
        y0 = y1 = y2 = 0.0
        if left >= 3:
            r1, r2 = chosen[at + 1], chosen[at + 2]
            for i in range(lo, hi):
                place = u[i] + d[i]
                y0 += rows[r0, i] * place
                y1 += rows[r1, i] * place
                y2 += rows[r2, i] * place
            predicted[r1] += y1
            predicted[r2] += y2
            at += 3
        elif left == 2:
            r1 = chosen[at + 1]
            for i in range(lo, hi):
                place = u[i] + d[i]
                y0 += rows[r0, i] * place
                y1 += rows[r1, i] * place
            predicted[r1] += y1
            at += 2
        else:
            for i in range(lo, hi):
                y0 += rows[r0, i] * (u[i] + d[i])
            at += 1
        predicted[r0] += y0


@njit(cache=True, fastmath=_FAST)
def _modal_pass(
    modal: ModalArrays, scheme: Scheme, rows: ModalRows, force: Array, fields: Fields, predicted: Array
) -> float:  # pragma: no cover - compiled
    """Add contact forces, complete t_{n+1}, predict t_{n+2}; returns Σ c v² at t_n.

    Short loops over few arrays each: one loop over all of them is not turned into vector instructions,
    because the compiler would have to prove too many pairs of arrays distinct. Unsigned bounds spare it
    the test for negative indices.
    """
    u, q, d, constant = fields.u, fields.q, fields.d, fields.constant
    forward, restore, drive, damping = modal.forward, modal.restore, modal.drive, modal.damping
    gain, two_b, memory = scheme.gain, 2.0 * scheme.beta2 / scheme.step, scheme.memory
    dissipated = 0.0
    predicted[:] = 0.0
    for b in range(modal.blocks.shape[0] - 1):
        lo, hi = _unsigned(modal.blocks[b]), _unsigned(modal.blocks[b + 1])
        _push(d, drive, rows.values, rows.pushing, rows.push_at[b], rows.push_at[b + 1], force, lo, hi)
        for i in range(lo, hi):
            velocity = q[i] + two_b * d[i]
            dissipated += damping[i] * velocity * velocity
        for i in range(lo, hi):
            u[i] += d[i]
        for i in range(lo, hi):
            q[i] = memory * q[i] + gain * d[i]
        for i in range(lo, hi):
            d[i] = forward[i] * q[i] - restore[i] * u[i] + constant[i]
        _pull(u, d, rows.values, rows.pulling, rows.pull_at[b], rows.pull_at[b + 1], lo, hi, predicted)
    return dissipated / (scheme.s * scheme.s)


@njit(cache=True, fastmath=_FAST)
def _nodal_pass(
    nodal: NodalArrays, scheme: Scheme, rows: NodalRows, force: Array, fields: Fields, predicted: Array
) -> float:  # pragma: no cover - compiled
    """The same step on freedoms: banded solve with M + β2ΔtC; returns vᵀCv at t_n."""
    u, q, d, velocity = fields.u, fields.q, fields.d, fields.buffer
    size = u.shape[0]
    two_b = 2.0 * scheme.beta2 / scheme.step
    for f in range(rows.answers.shape[1]):
        if force[f] != 0.0:
            for i in range(size):
                d[i] += force[f] * rows.answers[i, f]
    for i in range(size):
        velocity[i] = (q[i] + two_b * d[i]) / scheme.s
        q[i] = scheme.memory * q[i] + scheme.gain * d[i]
        u[i] += d[i]
    dissipated = 0.0
    if nodal.c_val.shape[0] > 0:
        dissipated = _csr_form(nodal.c_ptr, nodal.c_col, nodal.c_val, velocity, velocity)
    for i in range(size):
        total = fields.constant[i]
        for p in range(nodal.m_ptr[i], nodal.m_ptr[i + 1]):
            total += nodal.m_val[p] * q[nodal.m_col[p]]
        for p in range(nodal.k_ptr[i], nodal.k_ptr[i + 1]):
            total -= nodal.k_val[p] * u[nodal.k_col[p]]
        d[i] = total
    _band_solve(nodal.factor, d)
    for r in range(rows.ptr.shape[0] - 1):
        place = 0.0
        for p in range(rows.ptr[r], rows.ptr[r + 1]):
            i = rows.col[p]
            place += rows.val[p] * (u[i] + d[i])
        predicted[r] = place
    return dissipated


@njit(cache=True)
def _band_solve(factor: Array, x: Array) -> None:  # pragma: no cover - compiled
    """Solve LDLᵀ x = x in place."""
    width = factor.shape[0] - 1
    size = x.shape[0]
    if width:
        for i in range(size):
            value = x[i]
            for k in range(1, min(width, size - 1 - i) + 1):
                x[i + k] -= factor[k, i] * value
    for i in range(size):
        x[i] *= factor[0, i]
    if width:
        for i in range(size - 1, -1, -1):
            value = x[i]
            for k in range(1, min(width, size - 1 - i) + 1):
                value -= factor[k, i] * x[i + k]
            x[i] = value


@njit(cache=True)
def _leaves_segment(contacts: ContactArrays, state: LoopState) -> bool:  # pragma: no cover - compiled
    for c in range(contacts.kind.shape[0]):
        if contacts.kind[c] != 0:
            count = contacts.nodes_at[c + 1] - contacts.nodes_at[c]
            if state.xi[c] < -1e-12 and state.segment[c] > 0:
                return True
            if state.xi[c] > 1.0 + 1e-12 and state.segment[c] < count - 2:
                return True
    return False


@njit(cache=True)
def _all_finite(state: LoopState) -> bool:  # pragma: no cover - compiled
    total = 0.0
    for r in range(state.value.shape[0] - 1):
        total += state.value[r]
    return bool(np.isfinite(total))


@njit(cache=True, inline="always")
def _lent_modal(x: ModalArrays) -> ModalArrays:  # pragma: no cover - compiled
    return ModalArrays(
        borrow(x.forward), borrow(x.restore), borrow(x.drive), borrow(x.damping), borrow(x.stiffness), borrow(x.blocks)
    )


@njit(cache=True, inline="always")
def _lent_nodal(x: NodalArrays) -> NodalArrays:  # pragma: no cover - compiled
    return NodalArrays(
        borrow(x.k_ptr),
        borrow(x.k_col),
        borrow(x.k_val),
        borrow(x.m_ptr),
        borrow(x.m_col),
        borrow(x.m_val),
        borrow(x.c_ptr),
        borrow(x.c_col),
        borrow(x.c_val),
        borrow(x.factor),
        x.load_gain,
    )


@njit(cache=True, inline="always")
def _lent_modal_rows(x: ModalRows) -> ModalRows:  # pragma: no cover - compiled
    return ModalRows(borrow(x.values), borrow(x.pushing), borrow(x.push_at), borrow(x.pulling), borrow(x.pull_at))


@njit(cache=True, inline="always")
def _lent_nodal_rows(x: NodalRows) -> NodalRows:  # pragma: no cover - compiled
    return NodalRows(borrow(x.ptr), borrow(x.col), borrow(x.val), borrow(x.answers), borrow(x.auxiliary))


@njit(cache=True, inline="always")
def _lent_contacts(x: ContactArrays) -> ContactArrays:  # pragma: no cover - compiled
    return ContactArrays(
        borrow(x.kind),
        borrow(x.base),
        borrow(x.friction),
        borrow(x.gap),
        borrow(x.table),
        borrow(x.nodes_at),
        borrow(x.nodes),
        borrow(x.chords),
        borrow(x.slave),
        borrow(x.side),
    )


@njit(cache=True, inline="always")
def _lent_forcing(x: Forcing) -> Forcing:  # pragma: no cover - compiled
    return Forcing(
        borrow(x.loads),
        borrow(x.increments),
        borrow(x.mass_own),
        borrow(x.damping_own),
        borrow(x.stiffness_own),
        borrow(x.lift),
    )


@njit(cache=True, inline="always")
def _lent_fields(x: Fields) -> Fields:  # pragma: no cover - compiled
    return Fields(borrow(x.u), borrow(x.q), borrow(x.d), borrow(x.constant), borrow(x.coefficients), borrow(x.buffer))


@njit(cache=True, inline="always")
def _lent_state(x: LoopState) -> LoopState:  # pragma: no cover - compiled
    return LoopState(
        borrow(x.predicted),
        borrow(x.value),
        borrow(x.rate),
        borrow(x.force),
        borrow(x.normal),
        borrow(x.tangential),
        borrow(x.status),
        borrow(x.segment),
        borrow(x.xi),
        borrow(x.works),
        borrow(x.statistics),
        borrow(x.counters),
        borrow(x.active),
        borrow(x.motion),
    )


@njit(cache=True, inline="always")
def _lent_scratch(x: Scratch) -> Scratch:  # pragma: no cover - compiled
    return Scratch(
        borrow(x.place),
        borrow(x.moved),
        borrow(x.shape),
        borrow(x.slide),
        borrow(x.weights),
        borrow(x.slopes),
        borrow(x.nodes),
        borrow(x.delta),
        borrow(x.buffer),
    )


@njit(cache=True, inline="always")
def _lent_record(x: Record) -> Record:  # pragma: no cover - compiled
    return Record(
        x.every,
        borrow(x.contacts),
        borrow(x.watch),
        borrow(x.energies),
        borrow(x.kept),
        borrow(x.watch_rows),
        borrow(x.watch_lift),
    )


@njit(cache=True, fastmath=_CAREFUL)
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
    modal, rows, contacts = _lent_modal(modal), _lent_modal_rows(rows), _lent_contacts(contacts)
    forcing, fields, state = _lent_forcing(forcing), _lent_fields(fields), _lent_state(state)
    scratch, record, compliance = _lent_scratch(scratch), _lent_record(record), borrow(compliance)
    for k in range(steps):
        off = contact_stage(k, contacts, scheme, forcing, compliance, state, scratch)
        if off >= 0:
            state.counters[3] = off
            return k, OFF_LINE
        if state.counters[0] % record.every == 0:
            if not _all_finite(state):
                return k, NOT_FINITE
            _complete_modal(modal, rows, state.force, fields, loads_at)
            kinetic, elastic = _modal_energies(modal, scheme, fields.u, fields.q)
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
            _modal_constant(modal, rows, fields, loads_at)
        lost = _modal_pass(modal, scheme, rows, state.force, fields, state.predicted)
        state.works[DAMPING] += lost * scheme.step
        state.counters[0] += 1
        if _leaves_segment(contacts, state):
            return k + 1, NEW_ROWS
    return steps, DONE


@njit(cache=True, fastmath=_CAREFUL)
def run_nodal(
    steps: int,
    nodal: NodalArrays,
    rows: NodalRows,
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
    """The same on freedoms, for any damping and any mass."""
    # The caller keeps every array alive; borrowed ones cost no counting in the functions below.
    nodal, rows, contacts = _lent_nodal(nodal), _lent_nodal_rows(rows), _lent_contacts(contacts)
    forcing, fields, state = _lent_forcing(forcing), _lent_fields(fields), _lent_state(state)
    scratch, record, compliance = _lent_scratch(scratch), _lent_record(record), borrow(compliance)
    for k in range(steps):
        off = contact_stage(k, contacts, scheme, forcing, compliance, state, scratch)
        if off >= 0:
            state.counters[3] = off
            return k, OFF_LINE
        if state.counters[0] % record.every == 0:
            if not _all_finite(state):
                return k, NOT_FINITE
            kinetic, elastic = _nodal_energies(nodal, scheme, fields.u, fields.q, fields.buffer)
            _complete_nodal(rows, state.force, fields)
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
            _nodal_constant(nodal, rows, fields)
        lost = _nodal_pass(nodal, scheme, rows, state.force, fields, state.predicted)
        state.works[DAMPING] += lost * scheme.step
        state.counters[0] += 1
        if _leaves_segment(contacts, state):
            return k + 1, NEW_ROWS
    return steps, DONE


@njit(cache=True)
def _complete_modal(
    modal: ModalArrays, rows: ModalRows, force: Array, fields: Fields, loads_at: int
) -> None:  # pragma: no cover - compiled
    """fields.buffer = d with the contact forces in it."""
    d, out, drive, values = fields.d, fields.buffer, modal.drive, rows.values
    for i in range(d.shape[0]):
        push = 0.0
        for r in range(loads_at):
            push += force[r] * values[r, i]
        out[i] = d[i] + drive[i] * push


@njit(cache=True)
def _complete_nodal(rows: NodalRows, force: Array, fields: Fields) -> None:  # pragma: no cover - compiled
    d, out, answers = fields.d, fields.buffer, rows.answers
    for i in range(d.shape[0]):
        total = d[i]
        for f in range(answers.shape[1]):
            total += answers[i, f] * force[f]
        out[i] = total


@njit(cache=True)
def _modal_constant(modal: ModalArrays, rows: ModalRows, fields: Fields, loads_at: int) -> None:
    # pragma: no cover - compiled
    """Part of d that loads and supports make."""
    constant, coefficients, drive, values = fields.constant, fields.coefficients, modal.drive, rows.values
    for i in range(constant.shape[0]):
        total = 0.0
        for j in range(coefficients.shape[0]):
            total += coefficients[j] * values[loads_at + j, i]
        constant[i] = drive[i] * total


@njit(cache=True)
def _nodal_constant(nodal: NodalArrays, rows: NodalRows, fields: Fields) -> None:  # pragma: no cover
    constant, coefficients, auxiliary = fields.constant, fields.coefficients, rows.auxiliary
    for i in range(constant.shape[0]):
        total = 0.0
        for j in range(coefficients.shape[0]):
            total += coefficients[j] * auxiliary[j, i]
        constant[i] = nodal.load_gain * total


__all__ = ["CONTACT_RECORD", "run_modal", "run_nodal"]

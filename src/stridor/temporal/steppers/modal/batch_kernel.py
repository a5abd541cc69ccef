"""The compiled time loop of a block of members: contacts one member after the other, modes all members at once.

The contacts are those of the single run, the same compiled lines on one member's rows; of the modes `batch_pass` says
how. Works and energies are not accumulated.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from ....kernels import njit
from ....typing import Array, IntArray
from ...beta2 import Scheme
from ...columns import REC_GAP, REC_NORMAL, REC_SLIP, REC_STATUS, REC_TANGENTIAL
from ..borrow import borrow
from .batch_pass import BatchFields, BatchModal, batch_constant, batch_pass, batch_watch
from .operators import ContactArrays
from .stage import Forcing, LoopState, Scratch, advance_rows, contact_stage, count_contacts, forces_of


class BatchForcing(NamedTuple):
    """Loads (k, L, l) and increments of the supports (k, L, p) of every member; changes (k,): 0 where the step after k
    has what the one before had; lift (f + 1, p) of the contact rows."""

    loads: Array
    increments: Array
    changes: IntArray
    own: Array
    lift: Array


class BatchRecord(NamedTuple):
    """Decimated output: contacts (r, L, m, 5), watch (r, L, w, 3) of u, v, a; kept (1,) how many; sums (3w, L) and
    before (L, 2, p) for the loop; watch_lift (w, p)."""

    every: int
    contacts: Array
    watch: Array
    kept: IntArray
    sums: Array
    before: Array
    watch_lift: Array


@njit(cache=True, allocates=False, inline="always")
def _member_state(s: LoopState, lane: int) -> LoopState:  # pragma: no cover - compiled
    """The rows of one member."""
    return LoopState(
        s.predicted[lane],
        s.value[lane],
        s.rate[lane],
        s.force[lane],
        s.normal[lane],
        s.tangential[lane],
        s.status[lane],
        s.segment[lane],
        s.xi[lane],
        s.works[lane],
        s.statistics[lane],
        s.counters[lane],
        s.active[lane],
        s.motion[lane],
    )


@njit(cache=True, allocates=False, inline="always")
def _member_contacts(x: ContactArrays, friction: Array) -> ContactArrays:  # pragma: no cover - compiled
    """The contacts with one member's friction."""
    return ContactArrays(
        x.kind, x.base, friction, x.gap, x.table, x.nodes_at, x.nodes, x.chords, x.slave, x.side, x.kept, x.compliance
    )


@njit(cache=True, allocates=False, inline="always")
def _member_forcing(x: BatchForcing, lane: int) -> Forcing:  # pragma: no cover - compiled
    """What acts on one member."""
    return Forcing(x.loads[:, lane], x.increments[:, lane], x.own, x.own, x.own, x.lift)


@njit(cache=True, allocates=False, inline="always")
def keep_contacts(
    at: int, lane: int, contacts: ContactArrays, scheme: Scheme, state: LoopState, scratch: Scratch, record: BatchRecord
) -> None:  # pragma: no cover - compiled
    """A member's contacts at t_n."""
    two_b = 2.0 * scheme.beta2
    for c in range(contacts.kind.shape[0]):
        base = contacts.base[c]
        row = record.contacts[at, lane, c]
        row[REC_NORMAL], row[REC_TANGENTIAL] = state.normal[c], state.tangential[c]
        row[REC_SLIP] = (state.rate[base + 1] + two_b * scratch.moved[base + 1]) / scheme.s
        row[REC_GAP] = contacts.gap[c] + scratch.displacement[base]
        row[REC_STATUS] = state.status[c]
    for p in range(state.motion.shape[1]):
        record.before[lane, 0, p], record.before[lane, 1, p] = state.motion[0, p], state.motion[1, p]


@njit(cache=True, allocates=False, inline="always")
def keep_point(
    at: int, lane: int, w: int, su: float, sq: float, sd: float, increments: Array, scheme: Scheme, record: BatchRecord
) -> None:  # pragma: no cover - compiled
    """A watched row of a member at t_n, from its sums over modes of u, q and d and the increments (p,) of supports."""
    dt, s = scheme.step, scheme.s
    for p in range(increments.shape[0]):
        lift = record.watch_lift[w, p]
        su += lift * record.before[lane, 0, p]
        sq += lift * record.before[lane, 1, p]
        sd += lift * increments[p]
    record.watch[at, lane, w, 0] = su
    record.watch[at, lane, w, 1] = (sq + 2.0 * scheme.beta2 * sd / dt) / s
    record.watch[at, lane, w, 2] = 2.0 * (sd / dt - sq) / (dt * s)


@njit(cache=True, allocates=False)
def _keep_watched(
    k: int, at: int, modal: BatchModal, fields: BatchFields, scheme: Scheme, forcing: BatchForcing, record: BatchRecord
) -> None:  # pragma: no cover - compiled
    """The watched points of all members at t_n."""
    batch_watch(modal, fields, record.sums)
    for lane in range(record.contacts.shape[1]):
        for w in range(modal.watch.shape[0]):
            su, sq, sd = record.sums[3 * w, lane], record.sums[3 * w + 1, lane], record.sums[3 * w + 2, lane]
            keep_point(at, lane, w, su, sq, sd, forcing.increments[k, lane], scheme, record)


@njit(cache=True, allocates=False)
def _give_up(lane: int, fields: BatchFields, state: LoopState) -> None:  # pragma: no cover - compiled
    """Let a member rest whose motion is no longer finite: nothing in its lane moves any more."""
    fields.ud[:, lane] = 0.0
    fields.q[:, lane] = 0.0
    fields.push[:, lane] = 0.0
    fields.coefficients[:, lane] = 0.0
    state.predicted[:] = 0.0
    state.value[:] = 0.0
    state.rate[:] = 0.0


@njit(cache=True, allocates=False, inline="always")
def finite_rows(state: LoopState) -> bool:  # pragma: no cover - compiled
    """Whether the rows of a member are."""
    total = 0.0
    for r in range(state.value.shape[0] - 1):
        total += state.value[r]
    return math.isfinite(total)


@njit(cache=True, allocates=False, nogil=True)
def run_batch(
    steps: int,
    done: int,
    modal: BatchModal,
    contacts: ContactArrays,
    friction: Array,
    scheme: Scheme,
    forcing: BatchForcing,
    compliance: Array,
    fields: BatchFields,
    states: LoopState,
    scratch: Scratch,
    record: BatchRecord,
    lost: IntArray,
) -> None:  # pragma: no cover - compiled
    """``steps`` steps of all members from step ``done`` on; forcing holds one step more.

    friction (L, m, k). lost (L,): the step at which a member was no longer finite, −1 while it is; such a member rests
    from there on.
    """
    modal, contacts, fields, states = borrow(modal), borrow(contacts), borrow(fields), borrow(states)
    scratch, compliance, friction, forcing = borrow(scratch), borrow(compliance), borrow(friction), borrow(forcing)
    lost, record = borrow(lost), borrow(record)
    rows, members = compliance.shape[0], friction.shape[0]
    batch_constant(modal, fields)
    for k in range(steps):
        recorded = (done + k) % record.every == 0
        at = record.kept[0]
        changed = False
        for lane in range(members):
            if lost[lane] >= 0:
                continue
            state = _member_state(states, lane)
            own = _member_contacts(contacts, friction[lane])
            acting = _member_forcing(forcing, lane)
            for r in range(rows):
                state.predicted[r] = fields.pull[r, lane]
            contact_stage(k, own, scheme, acting, compliance, state, scratch)
            if recorded:
                if not finite_rows(state):
                    lost[lane] = done + k
                    _give_up(lane, fields, state)
                    changed = True
                    continue
                keep_contacts(at, lane, own, scheme, state, scratch, record)
            count_contacts(own, state, scratch)
            advance_rows(k, scheme, acting, state, scratch)
            state.counters[0] += 1
            if forcing.changes[k] and forces_of(k + 1, scheme, acting, state, fields.coefficients[:, lane]):
                changed = True
            for r in range(rows):
                fields.push[r, lane] = state.force[r]
        if recorded:
            _keep_watched(k, at, modal, fields, scheme, forcing, record)
            record.kept[0] += 1
        if changed:
            batch_constant(modal, fields)
        batch_pass(modal, fields, modal.memory != 0.0 or (done + k + 1) % record.every == 0)

"""The time loop of an ensemble on a GPU: one thread block for each member, one launch for many steps.

The contacts are solved by the first thread of a block with the same lines as in the loops of the CPU (`stage`), which
numba compiles for the device as well. Modes are shared out among the threads; what contact rows and watched points sum
over modes is added up in a tree of fixed order, so that a member does not depend on what runs beside it. All float64.

Imported only by who has a device: it imports numba's CUDA target.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from numba import cuda as _untyped
from numba import float64

from ....typing import Array, IntArray
from ...beta2 import Scheme
from ...legs import Acting
from ..curve import Foot
from .batch_kernel import BatchRecord, finite_rows, keep_contacts, keep_point
from .operators import ContactArrays
from .stage import Forcing, LoopState, Scratch, advance_rows, contact_stage, count_contacts, forces_of

GROUP = 4  # sums that go through the tree together
cuda: Any = _untyped  # numba comes without types
device: Any = cuda.jit(device=True)


class DeviceModel(NamedTuple):
    """What all members share: n modes, m contacts, f contact rows, a rows of loads and supports, w watched rows.

    Packed, as a launch takes few arrays. contacts (3, m): kind, first row, kept; numbers (2, m): reference gap,
    compliance; compliance (f, f); lift (f + 1, p); heads (3, n): forward·gain, −restore, forward·memory; driven, plain
    (g, n): drive·row and row of the contact rows, filled up with zero to whole groups; auxiliary (a, n), watch (w, n);
    whole, flat, table: empty, in place of what only finite sliding has.
    """

    contacts: IntArray
    numbers: Array
    compliance: Array
    lift: Array
    heads: Array
    driven: Array
    plain: Array
    auxiliary: Array
    watch: Array
    whole: IntArray
    flat: Array
    table: Array


class DeviceMembers(NamedTuple):
    """What each of L members has, the rest as in `LoopState`.

    friction (L, m, …); fields (L, 4, n): u, d, q and the part of d that loads and supports make; rows (L, 6, f + 1):
    predicted, value, rate, force, displacement, moved; contacts (L, 4, m): normal and tangential force, two of work
    space; weights (L, 2, m, 10); acting_loads (L, 2, l), acting_motion (L, 2, p): of a step and of the next.
    """

    friction: Array
    fields: Array
    rows: Array
    contacts: Array
    weights: Array
    status: IntArray
    statistics: Array
    counters: IntArray
    motion: Array
    coefficients: Array
    acting_loads: Array
    acting_motion: Array
    lost: IntArray


@device
def _contacts_of(lane: int, model: DeviceModel, members: DeviceMembers) -> ContactArrays:
    """The contacts with one member's friction."""
    whole, flat, table = model.whole, model.flat, model.table
    return ContactArrays(
        model.contacts[0], model.contacts[1], members.friction[lane], model.numbers[0], whole, whole, table, flat,
        table, flat, model.contacts[2], model.numbers[1],
    )  # fmt: skip


@device
def _state_of(lane: int, model: DeviceModel, members: DeviceMembers) -> LoopState:
    """The rows of one member."""
    rows, contacts = members.rows[lane], members.contacts[lane]
    return LoopState(
        rows[0], rows[1], rows[2], rows[3], contacts[0], contacts[1], members.status[lane], model.whole, model.flat,
        model.flat, members.statistics[lane], members.counters[lane], model.whole, members.motion[lane],
    )  # fmt: skip


@device
def _scratch_of(lane: int, model: DeviceModel, members: DeviceMembers) -> Scratch:
    """The work space of one member."""
    rows, contacts, flat = members.rows[lane], members.contacts[lane], model.flat
    return Scratch(
        rows[4], rows[5], members.weights[lane, 0], members.weights[lane, 1], Foot(flat, flat, model.table),
        contacts[2], contacts[3], flat,
    )  # fmt: skip


@device
def _forcing_of(lane: int, model: DeviceModel, members: DeviceMembers) -> Forcing:
    """What acts on one member in a step (0) and in the next (1)."""
    own = model.table
    return Forcing(members.acting_loads[lane], members.acting_motion[lane], own, own, own, model.lift)


@device
def _next_of(k: int, lane: int, acting: Acting, members: DeviceMembers) -> None:
    """What was next acts now; next is what acts in step k."""
    loads, motion = members.acting_loads[lane], members.acting_motion[lane]
    for j in range(loads.shape[1]):
        total = 0.0
        for t in range(acting.loads.shape[1]):
            total += acting.loads[k, t, j] * acting.load_factors[lane, t, j]
        loads[0, j], loads[1, j] = loads[1, j], total
    for p in range(motion.shape[1]):
        total = 0.0
        for t in range(acting.increments.shape[1]):
            total += acting.increments[k, t, p] * acting.increment_factors[lane, t, p]
        motion[0, p], motion[1, p] = motion[1, p], total


@device
def _constant(thread: int, threads: int, model: DeviceModel, fields: Array, coefficients: Array) -> None:
    """The part of d that loads and supports make, of the modes of one thread."""
    for i in range(thread, fields.shape[1], threads):
        total = 0.0
        for j in range(coefficients.shape[0]):
            total += model.auxiliary[j, i] * coefficients[j]
        fields[3, i] = total


@device
def _modes(
    thread: int, threads: int, model: DeviceModel, scheme: Scheme, fields: Array, force: Array, keep: bool
) -> None:
    """Add the contact forces, complete t_{n+1} and predict t_{n+2}: `batch_pass` for the modes of one thread."""
    rows = force.shape[0] - 1
    for i in range(thread, fields.shape[1], threads):
        d = fields[1, i]
        for r in range(rows):
            d += model.driven[r, i] * force[r]
        u = fields[0, i] + d
        new = model.heads[0, i] * d + model.heads[1, i] * u + fields[3, i]
        if keep:
            before = fields[2, i]
            new += model.heads[2, i] * before
            fields[2, i] = scheme.memory * before + scheme.gain * d
        fields[0, i], fields[1, i] = u, new


@device
def _pulled(thread: int, threads: int, first: int, model: DeviceModel, fields: Array, sums: Array) -> None:
    """What the modes of one thread give to a group of contact rows of the prediction."""
    y0 = y1 = y2 = y3 = 0.0
    for i in range(thread, fields.shape[1], threads):
        new = fields[0, i] + fields[1, i]
        y0 += model.plain[first, i] * new
        y1 += model.plain[first + 1, i] * new
        y2 += model.plain[first + 2, i] * new
        y3 += model.plain[first + 3, i] * new
    sums[thread], sums[threads + thread] = y0, y1
    sums[2 * threads + thread], sums[3 * threads + thread] = y2, y3


@device
def _watched(thread: int, threads: int, w: int, model: DeviceModel, fields: Array, force: Array, sums: Array) -> None:
    """What they give to a watched row of u, of q and of d with the contact forces in it."""
    rows = force.shape[0] - 1
    su = sq = sd = 0.0
    for i in range(thread, fields.shape[1], threads):
        weight = model.watch[w, i]
        d = fields[1, i]
        for r in range(rows):
            d += model.driven[r, i] * force[r]
        su += weight * fields[0, i]
        sq += weight * fields[2, i]
        sd += weight * d
    sums[thread], sums[threads + thread] = su, sq
    sums[2 * threads + thread], sums[3 * threads + thread] = sd, 0.0


@device
def _add_up(thread: int, threads: int, sums: Array) -> None:
    """A group of sums, those of all threads after one another, each into its first, in pairs."""
    cuda.syncthreads()
    half = threads // 2
    while half > 0:
        if thread < half:
            for j in range(GROUP):
                sums[j * threads + thread] += sums[j * threads + thread + half]
        cuda.syncthreads()
        half //= 2


def shared_bytes(threads: int) -> int:
    """Shared memory of a block."""
    return 8 * (GROUP * threads + 2)


@cuda.jit
def run_members(
    steps: int, done: int, at: int, scheme: Scheme, model: DeviceModel, members: DeviceMembers, acting: Acting,
    record: BatchRecord,
) -> None:  # fmt: skip # pragma: no cover - compiled
    """The kernel: as many blocks as members, ``shared_bytes`` of shared memory; threads of a block a power of two.

    at: the first record of this launch. What it leaves is what `run_batch` leaves, but that members which are lost are
    let alone.
    """
    lane, thread, threads = cuda.blockIdx.x, cuda.threadIdx.x, cuda.blockDim.x
    if members.lost[lane] >= 0:
        return
    sums = cuda.shared.array(0, float64)  # and behind them whether the member is lost, and what acts changes
    gone, changed = GROUP * threads, GROUP * threads + 1
    fields, force = members.fields[lane], members.rows[lane, 3]
    contacts, state = _contacts_of(lane, model, members), _state_of(lane, model, members)
    scratch, forcing = _scratch_of(lane, model, members), _forcing_of(lane, model, members)
    coefficients, rows = members.coefficients[lane], force.shape[0] - 1
    if thread == 0:
        sums[gone] = 0.0
        _next_of(0, lane, acting, members)
    cuda.syncthreads()
    _constant(thread, threads, model, fields, coefficients)
    for k in range(steps):
        recorded = (done + k) % record.every == 0
        if thread == 0:
            _next_of(k + 1, lane, acting, members)
            contact_stage(0, contacts, scheme, forcing, model.compliance, state, scratch)
            if recorded and not finite_rows(state):
                sums[gone] = 1.0
                members.lost[lane] = done + k
            else:
                if recorded:
                    keep_contacts(at, lane, contacts, scheme, state, scratch, record)
                count_contacts(contacts, state, scratch)
                advance_rows(0, scheme, forcing, state, scratch)
                state.counters[0] += 1
                sums[changed] = 1.0 if forces_of(1, scheme, forcing, state, coefficients) else 0.0
        cuda.syncthreads()
        if sums[gone] == 1.0:
            return
        if recorded:
            for w in range(model.watch.shape[0]):
                _watched(thread, threads, w, model, fields, force, sums)
                _add_up(thread, threads, sums)
                if thread == 0:
                    su, sq, sd = sums[0], sums[threads], sums[2 * threads]
                    keep_point(at, lane, w, su, sq, sd, forcing.increments[0], scheme, record)
                cuda.syncthreads()
            at += 1
        if sums[changed] == 1.0:
            _constant(thread, threads, model, fields, coefficients)
        keep = scheme.memory != 0.0 or (done + k + 1) % record.every == 0
        _modes(thread, threads, model, scheme, fields, force, keep)
        for first in range(0, model.plain.shape[0], GROUP):
            _pulled(thread, threads, first, model, fields, sums)
            _add_up(thread, threads, sums)
            if thread == 0:
                for j in range(min(GROUP, rows - first)):
                    state.predicted[first + j] = sums[j * threads]
            cuda.syncthreads()
    whole = 1
    for i in range(thread, fields.shape[1], threads):
        if not (math.isfinite(fields[0, i]) and math.isfinite(fields[1, i])):
            whole = 0
    if cuda.syncthreads_and(whole) == 0 and thread == 0:
        members.lost[lane] = done + steps  # between records, or where no row sees it

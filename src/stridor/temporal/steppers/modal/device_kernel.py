"""The time loop of an ensemble on a GPU: one thread block for each member, one launch for many steps.

The contacts are solved by the first thread of a block with the same lines as in the loops of the CPU (`stage`), which
numba compiles for the device as well. Modes are shared out among the threads; what contact rows and watched points sum
over modes is added up in a tree of fixed order, so that a member does not depend on what runs beside it. All float64.
Modes are counted by unsigned numbers: a signed index may count from the end, and to look whether it does takes longer
than the arithmetic of a mode.

Imported only by who has a device: it imports numba's CUDA target.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from numba import cuda as _untyped
from numba import float64, int64, uint64

from ....kernels import njit
from ....typing import Array, IntArray
from ...beta2 import Scheme
from ...columns import STATISTICS
from ...legs import Acting
from ..curve import Foot
from .batch_kernel import BatchRecord, finite_rows, keep_contacts, keep_point
from .operators import ContactArrays
from .stage import Forcing, LoopState, Scratch, advance_rows, contact_stage, count_contacts, forces_of

SUMS = 3  # that go through the tree together, at most
SHARED = 48 * 1024  # bytes of shared memory that every GPU gives to a block
cuda: Any = _untyped  # numba comes without types
device: Any = cuda.jit(device=True)


class DeviceModel(NamedTuple):
    """What all members share: n modes, m contacts, f contact rows, a rows of loads and supports, w watched rows.

    Packed, as a launch takes few arrays. contacts (3, m): kind, first row, kept; numbers (2, m): reference gap,
    compliance; compliance (f, f); lift (f + 1, p); heads (3, n): forward·gain, −restore, forward·memory; driven, plain
    (g, n): drive·row and row of the contact rows, filled up with zero to pairs of rows, at least one;
    auxiliary (a, n), watch (w, n); whole, flat, table: empty, in place of what only finite sliding has.
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
    """What each of L members has.

    friction (L, m, …); fields (L, 4, n): u, d, q and the part of d that loads and supports make; numbers (L, N), as
    `places_of` shares them out; whole (L, m + 3): status, counters; lost (L,) as in `MemberBatch`.
    """

    friction: Array
    fields: Array
    numbers: Array
    whole: IntArray
    lost: IntArray


class Places(NamedTuple):
    """Where in a member's row of numbers is what of `LoopState`, `Scratch` and `Forcing`: rows 6·(f + 1) of predicted,
    value, rate, force, displacement, moved; contacts 4·m of normal and tangential force and two of work space;
    statistics m·8; motion 2·p; coefficients; loads 2·l and increments 2·p of a step and of the next; weights 2·m·10."""

    contacts: int
    statistics: int
    motion: int
    coefficients: int
    loads: int
    increments: int
    weights: int
    end: int


@njit
def places_of(rows: int, contacts: int, motions: int, auxiliary: int, loads: int) -> Places:
    """The places for so many contact rows (one more than of forces), contacts, supports, coefficients and loads."""
    statistics = 6 * rows + 4 * contacts
    motion = statistics + STATISTICS * contacts
    coefficients = motion + 2 * motions
    at = coefficients + auxiliary
    increments = at + 2 * loads
    weights = increments + 2 * motions
    return Places(6 * rows, statistics, motion, coefficients, at, increments, weights, weights + 20 * contacts)


@device
def _contacts_of(lane: int, model: DeviceModel, members: DeviceMembers) -> ContactArrays:
    """The contacts with one member's friction."""
    whole, flat, table = model.whole, model.flat, model.table
    return ContactArrays(
        model.contacts[0], model.contacts[1], members.friction[lane], model.numbers[0], whole, whole, table, flat,
        table, flat, model.contacts[2], model.numbers[1],
    )  # fmt: skip


@device
def _state_of(numbers: Array, whole: IntArray, places: Places, model: DeviceModel) -> LoopState:
    """The rows of one member."""
    f, m, p = model.lift.shape[0], model.contacts.shape[1], model.lift.shape[1]
    return LoopState(
        numbers[:f], numbers[f : 2 * f], numbers[2 * f : 3 * f], numbers[3 * f : 4 * f],
        numbers[places.contacts : places.contacts + m], numbers[places.contacts + m : places.contacts + 2 * m],
        whole[:m], model.whole, model.flat, model.flat,
        numbers[places.statistics : places.motion].reshape(m, STATISTICS),
        whole[m : m + 3], model.whole, numbers[places.motion : places.coefficients].reshape(2, p),
    )  # fmt: skip


@device
def _scratch_of(numbers: Array, places: Places, model: DeviceModel) -> Scratch:
    """The work space of one member."""
    f, m, flat = model.lift.shape[0], model.contacts.shape[1], model.flat
    return Scratch(
        numbers[4 * f : 5 * f], numbers[5 * f : 6 * f],
        numbers[places.weights : places.weights + 10 * m].reshape(m, 10),
        numbers[places.weights + 10 * m : places.end].reshape(m, 10), Foot(flat, flat, model.table),
        numbers[places.contacts + 2 * m : places.contacts + 3 * m],
        numbers[places.contacts + 3 * m : places.statistics], flat,
    )  # fmt: skip


@device
def _forcing_of(numbers: Array, places: Places, model: DeviceModel, loads: int) -> Forcing:
    """What acts on one member in a step (0) and in the next (1)."""
    own, p = model.table, model.lift.shape[1]
    return Forcing(
        numbers[places.loads : places.increments].reshape(2, loads),
        numbers[places.increments : places.weights].reshape(2, p), own, own, own, model.lift,
    )  # fmt: skip


@device
def _following(k: int, lane: int, terms: Array, factors: Array, acts: Array) -> None:
    """What was next (row 1) acts now (row 0); next is what acts in step k."""
    at, member, j, one = uint64(k), uint64(lane), uint64(0), uint64(1)
    while j < uint64(acts.shape[1]):
        total, t = 0.0, uint64(0)
        while t < uint64(terms.shape[1]):
            total += terms[at, t, j] * factors[member, t, j]
            t += one
        acts[0, j], acts[1, j] = acts[1, j], total
        j += one


@device
def _next_of(k: int, lane: int, acting: Acting, forcing: Forcing) -> None:
    """`_following` of loads and of increments of supports."""
    _following(k, lane, acting.loads, acting.load_factors, forcing.loads)
    _following(k, lane, acting.increments, acting.increment_factors, forcing.increments)


@device
def _constant(thread: int, threads: int, model: DeviceModel, fields: Array, coefficients: Array) -> None:
    """The part of d that loads and supports make, of the modes of one thread."""
    constant = fields[3]
    for j in range(coefficients.shape[0]):
        row, factor = model.auxiliary[j], coefficients[j]
        i, many, n = uint64(thread), uint64(threads), uint64(constant.shape[0])
        while i < n:
            constant[i] = factor * row[i] if j == 0 else constant[i] + factor * row[i]
            i += many


@device
def _modes(
    thread: int, threads: int, model: DeviceModel, scheme: Scheme, fields: Array, force: Array, keep: bool, sums: Array
) -> None:
    """Add the contact forces, complete t_{n+1} and predict t_{n+2}: `batch_pass` for the modes of one thread; what they
    give to the first two contact rows of the prediction."""
    u, d, q, constant = fields[0], fields[1], fields[2], fields[3]
    a, b, c = model.heads[0], model.heads[1], model.heads[2]
    drive0, drive1, plain0, plain1 = model.driven[0], model.driven[1], model.plain[0], model.plain[1]
    rows, y0, y1, f0, f1 = force.shape[0] - 1, 0.0, 0.0, 0.0, 0.0
    if rows > 0:  # pairs
        f0, f1 = force[0], force[1]
    i, many, n = uint64(thread), uint64(threads), uint64(u.shape[0])
    while i < n:
        moved = d[i] + drive0[i] * f0 + drive1[i] * f1
        for r in range(2, rows):
            moved += model.driven[r][i] * force[r]
        at = u[i] + moved
        new = a[i] * moved + b[i] * at + constant[i]
        if keep:
            before = q[i]
            new += c[i] * before
            q[i] = scheme.memory * before + scheme.gain * moved
        u[i], d[i] = at, new
        y0 += plain0[i] * (at + new)
        y1 += plain1[i] * (at + new)
        i += many
    sums[thread], sums[threads + thread] = y0, y1


@device
def _pulled(thread: int, threads: int, first: int, model: DeviceModel, fields: Array, sums: Array) -> None:
    """What the modes of one thread give to two contact rows of the prediction."""
    u, d, plain0, plain1 = fields[0], fields[1], model.plain[first], model.plain[first + 1]
    y0 = y1 = 0.0
    i, many, n = uint64(thread), uint64(threads), uint64(u.shape[0])
    while i < n:
        new = u[i] + d[i]
        y0 += plain0[i] * new
        y1 += plain1[i] * new
        i += many
    sums[thread], sums[threads + thread] = y0, y1


@device
def _watched(thread: int, threads: int, w: int, model: DeviceModel, fields: Array, force: Array, sums: Array) -> None:
    """What they give to a watched row of u, of q and of d with the contact forces in it."""
    u, d, q, weights = fields[0], fields[1], fields[2], model.watch[w]
    su = sq = sd = 0.0
    i, many, n = uint64(thread), uint64(threads), uint64(u.shape[0])
    while i < n:
        moved = d[i]
        for r in range(force.shape[0] - 1):
            moved += model.driven[r][i] * force[r]
        su += weights[i] * u[i]
        sq += weights[i] * q[i]
        sd += weights[i] * moved
        i += many
    sums[thread], sums[threads + thread], sums[2 * threads + thread] = su, sq, sd


@device
def _add_up(thread: int, threads: int, count: int, sums: Array) -> None:
    """So many sums, those of all threads after one another, each into its first, in pairs."""
    cuda.syncthreads()
    half = threads // 2
    while half > 0:
        if thread < half:
            for j in range(count):
                part, at = sums[j * threads : (j + 1) * threads], uint64(thread)
                part[at] += part[at + uint64(half)]
        cuda.syncthreads()
        half //= 2


def shared_numbers(threads: int, numbers: int, whole: int, modes: int) -> tuple[int, int]:
    """How many numbers of a block are in shared memory, and what is there beside the sums: nothing (0), the rows of the
    member (1), its modes as well (2)."""
    least = SUMS * threads + 2
    rows, all_ = least + numbers + whole, least + numbers + whole + 4 * modes
    most = SHARED // 8
    return (all_, 2) if all_ <= most else (rows, 1) if rows <= most else (least, 0)


@device
def _copied(thread: int, threads: int, source: Array, target: Array) -> None:
    """All of a row."""
    i, many, n = uint64(thread), uint64(threads), uint64(source.shape[0])
    while i < n:
        target[i] = source[i]
        i += many


@cuda.jit
def run_members(
    steps: int, done: int, at: int, inside: int, scheme: Scheme, model: DeviceModel, members: DeviceMembers,
    acting: Acting, record: BatchRecord,
) -> None:  # fmt: skip # pragma: no cover - compiled
    """The kernel: as many blocks as members, as much shared memory as `shared_numbers` says, whose second answer is
    ``inside``; threads of a block a power of two.

    at: the first record of this launch. What it leaves is what `run_batch` leaves, but that members which are lost are
    let alone.
    """
    lane, thread, threads = cuda.blockIdx.x, cuda.threadIdx.x, cuda.blockDim.x
    if members.lost[lane] >= 0:
        return
    # Sums of all threads first, whether the member is lost, whether what acts changes; then the member.
    shared, shared_whole = cuda.shared.array(0, float64), cuda.shared.array(0, int64)
    gone, changed = SUMS * threads, SUMS * threads + 1
    sums = shared[: changed + 1]
    modes, count = members.fields.shape[2], members.numbers.shape[1]
    numbers, whole, fields = members.numbers[lane], members.whole[lane], members.fields[lane]
    if inside > 0:
        begin = changed + 1
        numbers = shared[begin : begin + count]
        whole = shared_whole[begin + count : begin + count + whole.shape[0]]
        _copied(thread, threads, members.numbers[lane], numbers)
        _copied(thread, threads, members.whole[lane], whole)
        if inside > 1:
            begin += count + whole.shape[0]
            fields = shared[begin : begin + 4 * modes].reshape(4, modes)
            for j in range(4):
                _copied(thread, threads, members.fields[lane, j], fields[j])
        cuda.syncthreads()
    loads, aux = acting.loads.shape[2], model.auxiliary.shape[0]
    places = places_of(model.lift.shape[0], model.contacts.shape[1], model.lift.shape[1], aux, loads)
    contacts, state = _contacts_of(lane, model, members), _state_of(numbers, whole, places, model)
    scratch, forcing = _scratch_of(numbers, places, model), _forcing_of(numbers, places, model, loads)
    coefficients, force = numbers[places.coefficients : places.loads], state.force
    rows = force.shape[0] - 1
    if thread == 0:
        sums[gone] = 0.0
        _next_of(0, lane, acting, forcing)
    cuda.syncthreads()
    _constant(thread, threads, model, fields, coefficients)
    until = (record.every - done % record.every) % record.every  # steps until the next record
    for k in range(steps):
        recorded = until == 0
        until = record.every - 1 if recorded else until - 1
        if thread == 0:
            _next_of(k + 1, lane, acting, forcing)
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
            break
        if recorded:
            for w in range(model.watch.shape[0]):
                _watched(thread, threads, w, model, fields, force, sums)
                _add_up(thread, threads, 3, sums)
                if thread == 0:
                    su, sq, sd = sums[0], sums[threads], sums[2 * threads]
                    keep_point(at, lane, w, su, sq, sd, forcing.increments[0], scheme, record)
                cuda.syncthreads()
            at += 1
        if sums[changed] == 1.0:
            _constant(thread, threads, model, fields, coefficients)
        _modes(thread, threads, model, scheme, fields, force, scheme.memory != 0.0 or until == 0, sums)
        for first in range(0, model.plain.shape[0], 2):
            if first > 0:
                _pulled(thread, threads, first, model, fields, sums)
            _add_up(thread, threads, 2, sums)
            if thread == 0:
                for j in range(min(2, rows - first)):
                    state.predicted[first + j] = sums[j * threads]
            cuda.syncthreads()
    if inside > 0:
        _copied(thread, threads, numbers, members.numbers[lane])
        _copied(thread, threads, whole, members.whole[lane])
        if inside > 1:
            for j in range(4):
                _copied(thread, threads, fields[j], members.fields[lane, j])
    if sums[gone] == 1.0:
        return
    finite = 1
    for i in range(thread, modes, threads):
        if not (math.isfinite(fields[0, i]) and math.isfinite(fields[1, i])):
            finite = 0
    if cuda.syncthreads_and(finite) == 0 and thread == 0:
        members.lost[lane] = done + steps  # between records, or where no row sees it

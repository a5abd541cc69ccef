"""What happens at the contacts in one step of the time loop, compiled.

Order within step n: the free prediction of every row at t_{n+1} is at hand; the contacts are solved
for the forces at t_n; works and extrema are accumulated with velocities at t_n; a record is kept
when due; then one pass adds the forces, completes u_{n+1} and predicts t_{n+2}.

A contact spring K_c stretches the gap equation: (g_{n+1} + g_{n−1})/2 + N/K_c is what is zero where N is not, centred,
so that it neither damps nor limits the step (docs/theory-temporal.md).
"""

from __future__ import annotations

from typing import NamedTuple

from ....contact import multipliers
from ....kernels import njit
from ....typing import Array, IntArray
from ...beta2 import Scheme
from ...columns import (
    DAMPING,
    EXTERNAL,
    FIRST_OPEN,
    FIRST_STICK,
    FRICTION,
    MAX_NORMAL,
    MAX_SPEED,
    MAX_TANGENTIAL,
    NORMAL,
    OPEN_STEPS,
    SLIP_STEPS,
    STICK_STEPS,
    SUPPORT,
)
from ..curve import Foot, project_in, turn
from .operators import FINITE, ContactArrays

_STICK, _SLIP = multipliers.STICK, multipliers.SLIP
_FINITE = FINITE

_solve_contact = njit(cache=True, allocates=False)(multipliers.solve_contact)
_solve_kept = njit(cache=True, allocates=False)(multipliers.solve_kept)

SWEEP_LIMIT = 500
SWEEP_TOLERANCE = 1e-12
ROUNDING = 4.0 * 2.0**-52


class LoopState(NamedTuple):
    """Everything that moves on from step to step, besides u, q and the prediction of the path.

    predicted, value, rate (a + 1,): rows at t_{n+1} without contact, rows at t_n, their q; force (a + 1,)
    at t_n; normal, tangential, status, segment, xi per contact; works (5,), statistics (m, 8).
    counters: step number, most sweeps, steps whose sweeps did not converge. active (a,) rows in use.
    """

    predicted: Array
    value: Array
    rate: Array
    force: Array
    normal: Array
    tangential: Array
    status: IntArray
    segment: IntArray
    xi: Array
    works: Array
    statistics: Array
    counters: IntArray
    active: IntArray
    motion: Array  # (2, p): displacement and q of the moving supports


class Scratch(NamedTuple):
    """Work space of the loop."""

    displacement: Array  # rows with the supports' motion added
    moved: Array  # d/Δt of rows
    shape: Array  # (m, 10) row weights of the normal
    slide: Array  # (m, 10) row weights of the tangent
    foot: Foot
    delta: Array
    earlier: Array  # (m,) gap at t_{n−1} of compliant contacts
    buffer: Array


class Forcing(NamedTuple):
    """Coefficients per step: loads (k, l), acceleration and velocity of supports come from increments
    (k, p); own matrices of the supports (p, p); lift (a + 1, p) of active rows."""

    loads: Array
    increments: Array
    mass_own: Array
    damping_own: Array
    stiffness_own: Array
    lift: Array


@njit(cache=True, allocates=False, inline="always")
def _local_weights(
    c: int, contacts: ContactArrays, state: LoopState, scratch: Scratch
) -> tuple[int, bool]:  # pragma: no cover - compiled
    """Fill the weights of normal and tangent over the contact's active rows; number of rows, on line."""
    base = contacts.base[c]
    if contacts.kind[c] != _FINITE:
        scratch.shape[c, 0], scratch.shape[c, 1] = 1.0, 0.0
        scratch.slide[c, 0], scratch.slide[c, 1] = 0.0, 1.0
        return 2, True
    start, stop = contacts.nodes_at[c], contacts.nodes_at[c + 1]
    count = stop - start
    segment = state.segment[c]
    # Current positions of the four nodes that the loop carries, around the last segment; the others
    # stay at their reference and are not reached before the active rows follow.
    for k in range(4):
        node = segment - 1 + k
        if 0 <= node < count:
            for d in range(2):
                scratch.foot.nodes[k, d] = contacts.nodes[start + node, d] + scratch.displacement[base + 2 + 2 * k + d]
    x = contacts.slave[c, 0] + scratch.displacement[base]
    y = contacts.slave[c, 1] + scratch.displacement[base + 1]
    state.xi[c], on_line = project_in(segment, x, y, state.xi[c], contacts.chords[start : stop - 1], scratch.foot)
    turn(contacts.side[c], scratch.foot, scratch.shape[c], scratch.slide[c])
    return 10, on_line


@njit(cache=True, allocates=False, inline="always")
def _solve_all(
    contacts: ContactArrays, scheme: Scheme, compliance: Array, state: LoopState, scratch: Scratch
) -> int:  # pragma: no cover - compiled
    """Gauss–Seidel over the contacts: forces at t_n into state. Returns −1, or a contact off its line."""
    count = contacts.kind.shape[0]
    rows = state.force.shape[0] - 1
    state.force[:] = 0.0
    for c in range(count):
        _, on_line = _local_weights(c, contacts, state, scratch)
        if not on_line:
            return c
        if contacts.compliance[c] > 0.0:
            scratch.earlier[c] = _gap_before(c, contacts, scheme, state, scratch)
    largest = noise = 0.0
    sweeps = 0
    for c in range(count):
        state.normal[c] = 0.0
        state.tangential[c] = 0.0
    while sweeps < SWEEP_LIMIT:
        sweeps += 1
        change = 0.0
        for c in range(count):
            base = contacts.base[c]
            width = 10 if contacts.kind[c] == _FINITE else 2
            gap, slip, w_nn, w_nt, w_tt = _local_problem(c, base, width, contacts, compliance, state, scratch)
            if sweeps == 1 and width == 10 and count > 1:
                # Gaps out of coordinates are known to the rounding of these, and forces to that.
                size = 0.0
                for a in range(width):
                    size += abs(scratch.shape[c, a]) * (
                        abs(reference(c, a, contacts, state)) + abs(scratch.displacement[base + a])
                    )
                noise = max(noise, ROUNDING * size / max(w_nn, 1e-300))
            # Free of this contact's own present forces.
            old_n, old_t = state.normal[c], state.tangential[c]
            if contacts.compliance[c] > 0.0:
                gap += scratch.earlier[c] + 2.0 * contacts.compliance[c] * old_n
                w_nn += 2.0 * contacts.compliance[c]
            gap -= w_nn * old_n + w_nt * old_t
            slip -= w_nt * old_n + w_tt * old_t
            law, stuck = contacts.friction[c], state.status[c] == _STICK
            if contacts.kept[c]:
                normal, tangential, status = _solve_kept(gap, slip, w_nn, w_nt, w_tt, law, stuck, scheme.step)
            else:
                normal, tangential, status = _solve_contact(gap, slip, w_nn, w_nt, w_tt, law, stuck, scheme.step)
            scratch.delta[c] = status
            dn, dt = normal - old_n, tangential - old_t
            state.normal[c], state.tangential[c] = normal, tangential
            change = max(change, abs(dn) + abs(dt))
            largest = max(largest, abs(normal))
            if dn != 0.0 or dt != 0.0:
                for a in range(width):
                    p = scratch.shape[c, a] * dn + scratch.slide[c, a] * dt
                    if p != 0.0:
                        state.force[base + a] += p
                        for r in range(rows):
                            scratch.displacement[r] += compliance[r, base + a] * p
        if count == 1 or change <= max(SWEEP_TOLERANCE * max(largest, 1e-300), noise):
            break
    for c in range(count):
        state.status[c] = int(scratch.delta[c])
    state.counters[1] = max(state.counters[1], sweeps)
    if sweeps >= SWEEP_LIMIT:
        state.counters[2] += 1
    return -1


@njit(cache=True, allocates=False, inline="always")
def reference(c: int, a: int, contacts: ContactArrays, state: LoopState) -> float:  # pragma: no cover - compiled
    """Coordinate [m] of row a of a finite-sliding contact in the reference configuration."""
    if a < 2:
        return contacts.slave[c, a]
    node = state.segment[c] - 1 + (a - 2) // 2
    start = contacts.nodes_at[c]
    if 0 <= node < contacts.nodes_at[c + 1] - start:
        return contacts.nodes[start + node, a % 2]
    return 0.0


@njit(cache=True, allocates=False, inline="always")
def _gap_before(
    c: int, contacts: ContactArrays, scheme: Scheme, state: LoopState, scratch: Scratch
) -> float:  # pragma: no cover - compiled
    """Gap [m] at t_{n−1} of a compliant contact, along the normal of now: rows less Δt q."""
    base = contacts.base[c]
    if contacts.kind[c] != _FINITE:
        return contacts.gap[c] + state.value[base] - scheme.step * state.rate[base]
    gap = 0.0
    for a in range(10):
        before = state.value[base + a] - scheme.step * state.rate[base + a]
        gap += scratch.shape[c, a] * (reference(c, a, contacts, state) + before)
    return gap


@njit(cache=True, allocates=False, inline="always")
def _local_problem(
    c: int,
    base: int,
    width: int,
    contacts: ContactArrays,
    compliance: Array,
    state: LoopState,
    scratch: Scratch,
) -> tuple[float, float, float, float, float]:  # pragma: no cover - compiled
    """Gap and slip at t_{n+1} with all present forces, and the local compliances."""
    if width == 2:
        gap = contacts.gap[c] + scratch.displacement[base]
        slip = scratch.displacement[base + 1] - state.value[base + 1]
        return gap, slip, compliance[base, base], compliance[base, base + 1], compliance[base + 1, base + 1]
    gap = slip = 0.0
    for a in range(width):
        gap += scratch.shape[c, a] * (reference(c, a, contacts, state) + scratch.displacement[base + a])
        slip += scratch.slide[c, a] * (scratch.displacement[base + a] - state.value[base + a])
    w_nn = w_nt = w_tt = 0.0
    for a in range(width):
        for b in range(width):
            w = compliance[base + a, base + b]
            w_nn += scratch.shape[c, a] * w * scratch.shape[c, b]
            w_nt += scratch.shape[c, a] * w * scratch.slide[c, b]
            w_tt += scratch.slide[c, a] * w * scratch.slide[c, b]
    return gap, slip, w_nn, w_nt, w_tt


@njit(cache=True, allocates=False, inline="always")
def contact_stage(
    k: int,
    contacts: ContactArrays,
    scheme: Scheme,
    forcing: Forcing,
    compliance: Array,
    state: LoopState,
    scratch: Scratch,
) -> int:  # pragma: no cover - compiled
    """Solve the contacts of step n and bring every row to t_{n+1}; scratch.moved holds d/Δt."""
    rows = state.force.shape[0] - 1
    motions = forcing.increments.shape[1]
    for r in range(rows):
        total = state.predicted[r]
        for p in range(motions):
            total += forcing.lift[r, p] * (state.motion[0, p] + forcing.increments[k, p])
        scratch.displacement[r] = total
    off = _solve_all(contacts, scheme, compliance, state, scratch)
    for r in range(rows):
        scratch.moved[r] = (scratch.displacement[r] - state.value[r]) / scheme.step
    return off


@njit(cache=True, allocates=False, inline="always")
def _count(c: int, later: float, state: LoopState) -> None:  # pragma: no cover - compiled
    """Statistics of one contact; later: its slip speed [m/s] over the step."""
    row = state.statistics[c]
    status = state.status[c]
    if status == _STICK:
        row[STICK_STEPS] += 1.0
        if row[FIRST_STICK] < 0.0:
            row[FIRST_STICK] = state.counters[0]
    elif status == _SLIP:
        row[SLIP_STEPS] += 1.0
        row[MAX_SPEED] = max(row[MAX_SPEED], abs(later))
    else:
        row[OPEN_STEPS] += 1.0
        if row[FIRST_OPEN] < 0.0:
            row[FIRST_OPEN] = state.counters[0]
    row[MAX_NORMAL] = max(row[MAX_NORMAL], abs(state.normal[c]))
    row[MAX_TANGENTIAL] = max(row[MAX_TANGENTIAL], abs(state.tangential[c]))


@njit(cache=True, allocates=False, inline="always")
def count_contacts(contacts: ContactArrays, state: LoopState, scratch: Scratch) -> None:
    # pragma: no cover - compiled
    """The statistics of `accumulate` alone, of contacts that slide little."""
    for c in range(contacts.kind.shape[0]):
        _count(c, scratch.moved[contacts.base[c] + 1], state)


@njit(cache=True, allocates=False, inline="always")
def accumulate(
    k: int,
    contacts: ContactArrays,
    scheme: Scheme,
    forcing: Forcing,
    state: LoopState,
    scratch: Scratch,
    loads_at: int,
) -> None:  # pragma: no cover - compiled
    """Works [J] over the step with velocities at t_n, and the statistics of the contacts."""
    dt, s, two_b = scheme.step, scheme.s, 2.0 * scheme.beta2
    works = state.works
    motions = forcing.increments.shape[1]
    loads = forcing.loads.shape[1]
    count = contacts.kind.shape[0]
    total = 0.0
    for r in range(loads_at):
        if state.force[r] != 0.0:
            total += state.force[r] * (state.rate[r] + two_b * scratch.moved[r]) / s
    friction = 0.0
    for c in range(count):
        base = contacts.base[c]
        width = 10 if contacts.kind[c] == _FINITE else 2
        now = later = 0.0
        for a in range(width):
            w = scratch.slide[c, a]
            now += w * (state.rate[base + a] + two_b * scratch.moved[base + a]) / s
            later += w * scratch.moved[base + a]
        friction += state.tangential[c] * now
        _count(c, later, state)
    works[FRICTION] -= friction * dt
    works[NORMAL] -= (total - friction) * dt
    for j in range(loads):
        r = loads_at + j
        works[EXTERNAL] += forcing.loads[k, j] * (state.rate[r] + two_b * scratch.moved[r]) / s * dt
    for p in range(motions):
        step_rate = forcing.increments[k, p] / dt
        velocity = (state.motion[1, p] + two_b * step_rate) / s
        if velocity == 0.0 and step_rate == 0.0:
            continue
        m_row, c_row = loads_at + loads + p, loads_at + loads + motions + p
        reaction = 2.0 * (scratch.moved[m_row] - state.rate[m_row]) / (dt * s)
        drag = (state.rate[c_row] + two_b * scratch.moved[c_row]) / s
        reaction += drag
        damped = 2.0 * drag
        for other in range(motions):
            other_rate = forcing.increments[k, other] / dt
            other_velocity = (state.motion[1, other] + two_b * other_rate) / s
            other_acceleration = 2.0 * (other_rate - state.motion[1, other]) / (dt * s)
            reaction += forcing.mass_own[p, other] * other_acceleration
            reaction += forcing.damping_own[p, other] * other_velocity
            reaction += forcing.stiffness_own[p, other] * state.motion[0, other]
            damped += forcing.damping_own[p, other] * other_velocity
        for r in range(loads_at):
            reaction -= forcing.lift[r, p] * state.force[r]
        for j in range(loads):
            reaction -= forcing.lift[loads_at + j, p] * forcing.loads[k, j]
        works[SUPPORT] += reaction * velocity * dt
        works[DAMPING] += damped * velocity * dt


@njit(cache=True, allocates=False, inline="always")
def forces_of(
    k: int, scheme: Scheme, forcing: Forcing, state: LoopState, out: Array
) -> bool:  # pragma: no cover - compiled
    """Coefficients (aux,) of loads, −a of supports, −v of supports at step k; whether they changed."""
    loads, motions = forcing.loads.shape[1], forcing.increments.shape[1]
    changed = False
    for j in range(loads):
        if out[j] != forcing.loads[k, j]:
            out[j] = forcing.loads[k, j]
            changed = True
    for p in range(motions):
        rate = forcing.increments[k, p] / scheme.step
        before = state.motion[1, p]
        if abs(rate - before) <= 1e-13 * abs(before):
            rate = before
        acceleration = -2.0 * (rate - before) / (scheme.step * scheme.s)
        velocity = -(before + 2.0 * scheme.beta2 * rate) / scheme.s
        if out[loads + p] != acceleration or out[loads + motions + p] != velocity:
            out[loads + p] = acceleration
            out[loads + motions + p] = velocity
            changed = True
    return changed


@njit(cache=True, allocates=False, inline="always")
def advance_rows(
    k: int, scheme: Scheme, forcing: Forcing, state: LoopState, scratch: Scratch
) -> None:  # pragma: no cover - compiled
    """Rows and supports become those of t_{n+1}."""
    rows = state.force.shape[0] - 1
    for r in range(rows):
        state.value[r] = scratch.displacement[r]
        state.rate[r] = scheme.memory * state.rate[r] + scheme.gain * scheme.step * scratch.moved[r]
    for p in range(forcing.increments.shape[1]):
        increment = forcing.increments[k, p]
        before = state.motion[1, p]
        after = scheme.memory * before + scheme.gain * increment
        if abs(after - before) <= 1e-13 * abs(before):
            after = before
        state.motion[1, p] = after
        state.motion[0, p] += increment

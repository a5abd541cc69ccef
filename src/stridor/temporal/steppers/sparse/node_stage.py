"""Contact forces of one step over many nodes, compiled: Gauss–Seidel on forward-increment multipliers.

With the free motion at hand, only nodes that would close, or that carried force in the step before, take part. Each
is solved exactly with the latest forces of the others; what forces change is kept as a correction of the entries that
contacts touch, so that G A Gᵀ is never formed. When the sweeps have settled, the nodes left out are looked at again,
and those that the forces have closed join in.

A compliant layer stretches the gap equation. Its force at t_n belongs to the gap at t_n; with g_{n+1} instead it would
lag by a step and damp like a dashpot of Δt/compliance. The mean of g_{n+1} and g_{n−1} is centred, so that (g_{n+1} +
g_{n−1})/2 + compliance·N is what is zero where N is not: second order, stable for any stiffness, and no damping. A
layer that hardens, N = δ/compliance + cubic δ³, has δ(N) in the place of compliance·N. A node kept closed always takes
part, and its N may be negative.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from ....contact import multipliers
from ....kernels import njit
from ....typing import Array, IntArray
from ..curve import Foot
from .disc import solve_disc
from .node_table import NodeTable

_OPEN, _STICK, _SLIP = multipliers.OPEN, multipliers.STICK, multipliers.SLIP
_solve_contact = njit(cache=True, allocates=False)(multipliers.solve_contact)

SWEEP_LIMIT = 1000
SWEEP_TOLERANCE = 1e-11
NEWTON_STEPS = 60  # on the force of a layer that hardens


class NodeState(NamedTuple):
    """What contacts carry from step to step: force (m, d) at the step before [N], status (m,), offset (m,) [m] of the
    gap after a renewal of the rows, and q (l,) [m/s] of the entries they touch, at t_n; segment and xi (m,) of the feet
    of points that slide finitely."""

    force: Array
    status: IntArray
    offset: Array
    q: Array
    segment: IntArray
    xi: Array


class NodeScratch(NamedTuple):
    """Work space: u, q (l,) at t_{n+1}, correction (l,) of u by forces; gap (m,), slip (m, d−1) [m] free of forces;
    earlier (m,) [m]: gap at t_{n−1} of compliant nodes, zero of rigid ones;
    chosen (m,): nodes that take part, marked (m,); speed (m, d−1) [m/s] of slip at t_n; force (2, d) of one node;
    foot, normal and tangent (10,) weights of the rows of one point that slides finitely; angle, way (d−1,), turn (d, w)
    and away (w,) [m] of one node whose normal turns (`bends`)."""

    u: Array
    q: Array
    correction: Array
    gap: Array
    earlier: Array
    slip: Array
    chosen: IntArray
    marked: IntArray
    speed: Array
    force: Array
    foot: Foot
    normal: Array
    tangent: Array
    angle: Array
    way: Array
    turn: Array
    away: Array


@njit(cache=True, allocates=False, forceinline=True)
def _push(i: int, change: Array, table: NodeTable, correction: Array) -> None:  # pragma: no cover - compiled
    """Forces (d,) on node i into the correction."""
    for p in range(table.push_ptr[i], table.push_ptr[i + 1]):
        total = 0.0
        for j in range(change.shape[0]):
            total += table.push[p, j] * change[j]
        correction[table.push_col[p]] += total


@njit(cache=True, allocates=False, forceinline=True)
def _take_in(
    i: int, count: int, increments: Array, ratio: Array, table: NodeTable, state: NodeState, work: NodeScratch
) -> int:  # pragma: no cover - compiled
    """Node i takes part: its free slip; the number of nodes that do. ratio: d = ratio[0] q_{n+1} − ratio[1] q_n."""
    for j in range(1, table.row.shape[1]):
        slip = 0.0
        for p in range(table.ptr[i], table.ptr[i + 1]):
            c = table.col[p]
            slip += table.row[p, j] * (ratio[0] * work.q[c] - ratio[1] * state.q[c])
        for m in range(increments.shape[0]):
            slip += table.lift[i, j, m] * increments[m]
        work.slip[i, j - 1] = slip
    work.chosen[count] = i
    work.marked[i] = 1
    return count + 1


@njit(cache=True, allocates=False, forceinline=True)
def _solve_node(
    i: int,
    sign: float,
    gap: float,
    s1: float,
    s2: float,
    layer: float,
    step: float,
    new: Array,
    table: NodeTable,
    state: NodeState,
) -> int:  # pragma: no cover - compiled
    """Forces (d,) of node i into new from its gap and slip free of them; layer: compliance [m/N] beside its own part of
    G A Gᵀ. sign: −1 where gap and normal force are those of the mirror image, else 1. Its status."""
    block, law, stuck = table.block[i], table.friction[table.owner[i]], state.status[i] == _STICK
    w_nn = block[0, 0] + layer
    if table.row.shape[1] == 2:
        new[0], new[1], status = _solve_contact(gap, s1, w_nn, sign * block[0, 1], block[1, 1], law, stuck, step)
    else:
        w = (w_nn, sign * block[0, 1], sign * block[0, 2], block[1, 1], block[1, 2], block[2, 2])
        new[0], new[1], new[2], status = solve_disc(gap, s1, s2, w, law, stuck, step)
    if table.kept[i] and status == _OPEN:
        # Where friction would jam it, it closes without.
        new[0], status = (-gap / w_nn if w_nn > 0.0 else 0.0), _SLIP
    return status


@njit(cache=True, allocates=False, forceinline=True)
def _relax(
    i: int, step: float, new: Array, table: NodeTable, state: NodeState, work: NodeScratch
) -> int:  # pragma: no cover - compiled
    """Forces (d,) of node i with those of all others as they are into new; its status."""
    d = table.row.shape[1]
    block, force = table.block[i], state.force[i]
    gap = work.gap[i] + work.earlier[i] - block[0, 0] * force[0]
    s1 = work.slip[i, 0] - block[1, 0] * force[0]
    s2 = 0.0
    for j in range(1, d):
        gap -= block[0, j] * force[j]
        s1 -= block[1, j] * force[j]
    if d == 3:
        s2 = work.slip[i, 1] - block[2, 0] * force[0] - block[2, 1] * force[1] - block[2, 2] * force[2]
    for p in range(table.ptr[i], table.ptr[i + 1]):
        moved = work.correction[table.col[p]]
        gap += table.row[p, 0] * moved
        s1 += table.row[p, 1] * moved
        if d == 3:
            s2 += table.row[p, 2] * moved
    # A gap kept closed that would open is the mirror image of one that would close, with the normal turned round.
    sign = -1.0 if table.kept[i] and gap > 0.0 else 1.0
    gap *= sign
    compliance, hardening = table.compliance[i], table.cubic[i]
    if hardening == 0.0:
        status = _solve_node(i, sign, gap, s1, s2, 2.0 * compliance, step, new, table, state)
        new[0] *= sign
        return status
    # Newton's method on the approach δ(p), which is concave: from no force on, tangents close in from below.
    scale = math.sqrt(1.0 / (3.0 * compliance * hardening))
    before, status = 0.0, _OPEN
    for _ in range(NEWTON_STEPS):
        approach = 2.0 * scale * math.sinh(math.asinh(1.5 * before * compliance / scale) / 3.0)
        tangent = 1.0 / (1.0 / compliance + 3.0 * hardening * approach * approach)
        met = gap + 2.0 * (approach - tangent * before)
        status = _solve_node(i, sign, met, s1, s2, 2.0 * tangent, step, new, table, state)
        if abs(new[0] - before) <= 1e-14 * new[0]:
            break
        before = new[0]
    new[0] *= sign
    return status


@njit(cache=True, allocates=False, forceinline=True)
def _sweeps(
    count: int, limit: int, step: float, status: IntArray, table: NodeTable, state: NodeState, work: NodeScratch
) -> int:  # pragma: no cover - compiled
    """Sweep over the nodes that take part until forces settle; sweeps done, limit + 1 where they did not."""
    d = table.row.shape[1]
    new, change = work.force[0], work.force[1]
    for sweep in range(1, limit + 1):
        largest = worst = 0.0
        for n in range(count):
            i = work.chosen[n]
            status[i] = _relax(i, step, new, table, state, work)
            size = 0.0
            for j in range(d):
                change[j] = new[j] - state.force[i, j]
                size += abs(change[j])
                state.force[i, j] = new[j]
            worst = max(worst, size)
            largest = max(largest, abs(new[0]))
            if size != 0.0:
                _push(i, change, table, work.correction)
        if count == 1 or worst <= SWEEP_TOLERANCE * largest:
            return sweep
    return limit + 1


@njit(cache=True, allocates=False, forceinline=True)
def _gap_before(
    i: int,
    gap: float,
    step: float,
    ratio: Array,
    increments: Array,
    rate: Array,
    table: NodeTable,
    state: NodeState,
    work: NodeScratch,
) -> float:  # pragma: no cover - compiled
    """Gap [m] of node i at t_{n−1}, from its free one at t_{n+1}, the increments, those of supports too, and q_n."""
    for p in range(table.ptr[i], table.ptr[i + 1]):
        c = table.col[p]
        gap -= table.row[p, 0] * (ratio[0] * work.q[c] - ratio[1] * state.q[c] + step * state.q[c])
    for m in range(increments.shape[0]):
        gap -= table.lift[i, 0, m] * (increments[m] + step * rate[m])
    return gap


@njit(cache=True, allocates=False, forceinline=True)
def solve_nodes(
    step: float, ratio: Array, x: Array, increments: Array, rate: Array, table: NodeTable, state: NodeState,
    work: NodeScratch, status: IntArray,
) -> tuple[int, int]:  # pragma: no cover - compiled
    """Forces at t_n into state.force from work.u and work.q, the free motion, which then follow them.

    x (p,) supports at t_{n+1}, increments (p,) over the step, rate (p,) their q_n. Returns how many nodes took part
    (work.chosen) and the sweeps done, more than SWEEP_LIMIT where they did not settle. status (m,) is that of the
    step; state.status stays that of the step before.
    """
    m = table.gap.shape[0]
    count = 0
    for i in range(m):
        gap = table.gap[i] + state.offset[i]
        for p in range(table.ptr[i], table.ptr[i + 1]):
            gap += table.row[p, 0] * work.u[table.col[p]]
        for j in range(x.shape[0]):
            gap += table.lift[i, 0, j] * x[j]
        work.gap[i] = gap
        work.earlier[i] = 0.0
        if table.compliance[i] > 0.0:
            work.earlier[i] = _gap_before(i, gap, step, ratio, increments, rate, table, state, work)
        work.marked[i] = 0
        status[i] = _OPEN
        if gap + work.earlier[i] < 0.0 or state.force[i, 0] > 0.0 or table.kept[i]:
            count = _take_in(i, count, increments, ratio, table, state, work)
    if count == 0:
        return 0, 0
    for c in range(work.correction.shape[0]):
        work.correction[c] = 0.0
    if count == 1:
        for j in range(table.row.shape[1]):
            state.force[work.chosen[0], j] = 0.0
    for n in range(count):
        i = work.chosen[n]
        if state.force[i, 0] != 0.0:
            _push(i, state.force[i], table, work.correction)
    done = 0
    while True:
        done += _sweeps(count, SWEEP_LIMIT, step, status, table, state, work)
        before = count
        for i in range(m):
            if work.marked[i] == 0:
                gap = work.gap[i] + work.earlier[i]
                for p in range(table.ptr[i], table.ptr[i + 1]):
                    gap += table.row[p, 0] * work.correction[table.col[p]]
                if gap < 0.0:
                    count = _take_in(i, count, increments, ratio, table, state, work)
        if count == before or done > SWEEP_LIMIT:
            break
    for c in range(work.u.shape[0]):
        work.u[c] += work.correction[c]
        work.q[c] += work.correction[c] / ratio[0]
    return count, done


@njit(cache=True, allocates=False, forceinline=True)
def contact_power(
    count: int, beta2: float, velocity: Array, table: NodeTable, state: NodeState, work: NodeScratch
) -> tuple[float, float]:  # pragma: no cover - compiled
    """Powers N·(gap velocity) and T·(slip velocity) [W] at t_n; velocity (p,) of the supports. Fills work.speed."""
    normal = friction = 0.0
    for n in range(count):
        i = work.chosen[n]
        for j in range(table.row.shape[1]):
            v = 0.0
            for p in range(table.ptr[i], table.ptr[i + 1]):
                c = table.col[p]
                v += table.row[p, j] * ((1.0 - beta2) * state.q[c] + beta2 * work.q[c])
            for m in range(velocity.shape[0]):
                v += table.lift[i, j, m] * velocity[m]
            if j == 0:
                normal += state.force[i, 0] * v
            else:
                friction += state.force[i, j] * v
                work.speed[i, j - 1] = v
    return normal, friction


@njit(cache=True, allocates=False, forceinline=True)
def slip_over_step(i: int, ratio: Array, increments: Array, table: NodeTable, state: NodeState, work: NodeScratch) -> (
    float
):  # pragma: no cover - compiled
    """Magnitude [m] of the slip of node i over the step."""
    total = 0.0
    for j in range(1, table.row.shape[1]):
        slip = 0.0
        for p in range(table.ptr[i], table.ptr[i + 1]):
            c = table.col[p]
            slip += table.row[p, j] * (ratio[0] * work.q[c] - ratio[1] * state.q[c])
        for m in range(increments.shape[0]):
            slip += table.lift[i, j, m] * increments[m]
        total += slip * slip
    return math.sqrt(total)

"""The compiled time loop on assembled matrices.

Order within step n: forces of loads and supports at t_n; what a record needs of t_n; the structure to t_{n+1} without
contact; contact forces at t_n, which correct the few entries they act on; works with velocities at t_n.

In terms of q alone (docs/theory-temporal.md, a and b) the scheme reads

    (M + β2 Δt C_d) a_n = f_n − K u_n − C_r q_n + Gᵀp_n − C_d q_n,       q_{n+1} = q_n + Δt a_n,
    v_n = (1 − β2) q_n + β2 q_{n+1},       u_{n+1} = u_n + Δt [(1/2 + β2) q_{n+1} − (β2 − 1/2) q_n],

where C_d is the diagonal part of the damping and C_r the rest, which acts on q_n, the velocity β2 Δt before t_n. Where
M + β2 Δt C is solved with as it is, C_d is all of C (`step_matrix`). Skew
parts of imported matrices act beside them (`unsymmetric`).

Works of the structure: with y_n = K u_n + C_r q_n the power v·y holds the change of the elastic energy and what C_r
takes. For β2 = 1/2 the former is the difference of ½ u_nᵀK u_{n−1}, so damping is what was accumulated less what is
stored: exact to rounding, whatever acts. Cubic springs count as stored what was done on them.
"""

from __future__ import annotations

from ....kernels import njit
from ....typing import Array
from ...columns import DAMPING, FRICTION, NORMAL
from ..borrow import borrow
from .feet import follow_bends, follow_feet, mark_bends, rows_of_forces
from .forcing import (
    CIRCULATORY,
    GYROSCOPIC,
    MOST_SWEEPS,
    STEPS_DONE,
    UNCONVERGED,
    Forcing,
    LoopState,
    StepWork,
    begin_step,
    works_of_step,
)
from .node_stage import SWEEP_LIMIT, NodeScratch, NodeState, contact_power, solve_nodes
from .node_table import NodeTable
from .products import WITH_STIFFNESS, Fields, Structure, advance
from .recording import Record, begin_record, end_record, statistics
from .step_matrix import StepMatrix, advance_whole, correct_whole, take_drag
from .unsymmetric import MOST_PASSES, Unsymmetric, apply_force, converged, keep_before, keep_free, powers

DONE, NOT_FINITE = 0, 1


# The functions of the contacts are called in one place and become part of it: handing a hundred arrays on costs more
# than a few contacts do.
@njit(cache=True, allocates=False, forceinline=True)
def _correct(
    a: Structure, f: Fields, table: NodeTable, nodes: NodeState, work: NodeScratch
) -> float:  # pragma: no cover - compiled
    """Bring what the contact forces changed into the fields; what that adds to the power wanted of the structure."""
    beta2, forth = a.numbers[1], a.numbers[2]
    inner = 1.0 if a.flags[2] == WITH_STIFFNESS else 0.0
    extra = 0.0
    for c in range(table.indices.shape[0]):
        if work.correction[c] == 0.0:
            continue
        i = table.indices[c]
        if a.flags[2]:
            moved = beta2 * work.correction[c] / forth
            v = (1.0 - beta2) * nodes.q[c] + beta2 * f.q[i]
            # The force of the structure back from the free step that it made.
            y = f.push[i] - (f.q[i] - a.keep[i] * nodes.q[c]) / a.kick[i]
            extra += inner * moved * y + a.damping[i] * (2.0 * v * moved + moved * moved)
        f.u[i], f.q[i] = work.u[c], work.q[c]
        if a.flags[0]:
            f.shown[i] = f.u[i] + a.factor[i] * f.q[i]
    return extra


@njit(cache=True, allocates=False, forceinline=True)
def _solve_contacts(
    increments: Array, a: Structure, f: Fields, table: NodeTable, nodes: NodeState, work: NodeScratch, state: LoopState,
    w: StepWork,
) -> int:  # pragma: no cover - compiled
    """Forces at t_n from the motion to t_{n+1} without them; how many nodes took part."""
    for c in range(table.indices.shape[0]):
        work.u[c], work.q[c] = f.u[table.indices[c]], f.q[table.indices[c]]
    count, sweeps = solve_nodes(
        a.numbers[0], a.numbers[2:4], w.displacement, increments, state.motion[1], table, nodes, work, w.status
    )
    state.counters[MOST_SWEEPS] = max(state.counters[MOST_SWEEPS], min(sweeps, SWEEP_LIMIT))
    state.counters[UNCONVERGED] += sweeps > SWEEP_LIMIT
    return count


@njit(cache=True, allocates=False, forceinline=True)
def _after_contacts(
    count: int, increments: Array, a: Structure, table: NodeTable, nodes: NodeState, work: NodeScratch,
    state: LoopState, w: StepWork,
) -> tuple[float, float]:  # pragma: no cover - compiled
    """Powers of normal and tangential forces; what they send to supports, and statistics."""
    step, beta2, ratio = a.numbers[0], a.numbers[1], a.numbers[2:4]
    if table.bends.node.shape[0]:
        rows_of_forces(table)
    normal = friction = 0.0
    if count:
        normal, friction = contact_power(count, beta2, w.velocity, table, nodes, work)
        for n in range(count):
            i = work.chosen[n]
            for p in range(w.sent.shape[0]):
                for j in range(table.row.shape[1]):
                    w.sent[p] += table.lift[i, j, p] * nodes.force[i, j]
    else:
        for c in range(work.correction.shape[0]):
            work.correction[c] = 0.0
    statistics(count, ratio, step, increments, table, nodes, work, w.status, state, w.sums)
    return normal, friction


@njit(cache=True, allocates=False, forceinline=True)
def _forces_of_step(
    increments: Array, a: Structure, f: Fields, x: Unsymmetric, b: StepMatrix, table: NodeTable, nodes: NodeState,
    work: NodeScratch, state: LoopState, w: StepWork,
) -> tuple[float, float, float]:  # pragma: no cover - compiled
    """Forces of contacts at t_n into the motion to t_{n+1}, with skew forces in turn until both agree with it: powers
    of normal and tangential forces, and what they add to that of the structure."""
    skew, touched = x.force.shape[0] > 0, table.gap.shape[0] > 0
    if skew:
        keep_free(f, x)
    count, passes = 0, 0
    while True:
        if skew:
            apply_force(a, f, x)
        if touched:
            count = _solve_contacts(increments, a, f, table, nodes, work, state, w)
        if not skew:
            break
        if count:
            for c in range(table.indices.shape[0]):
                f.u[table.indices[c]], f.q[table.indices[c]] = work.u[c], work.q[c]
        passes += 1
        if passes == MOST_PASSES:
            state.counters[UNCONVERGED] += 1
            break
        if converged(a, f, x, f.y):
            break
    extra = 0.0
    if skew:
        circulatory, gyroscopic, extra = powers(a, f, x)
        state.works[CIRCULATORY] += circulatory * a.numbers[0]
        state.works[GYROSCOPIC] += gyroscopic * a.numbers[0]
    elif count and b.before.shape[0]:
        correct_whole(count, a, f, table, nodes, work)
    elif count:
        extra = _correct(a, f, table, nodes, work)
    normal = friction = 0.0
    if touched:
        normal, friction = _after_contacts(count, increments, a, table, nodes, work, state, w)
    return normal, friction, extra


@njit(cache=True, allocates=False)
def run_steps(
    steps: int, a: Structure, f: Fields, x: Unsymmetric, b: StepMatrix, g: Forcing, table: NodeTable, nodes: NodeState,
    work: NodeScratch, state: LoopState, w: StepWork, record: Record,
) -> tuple[int, int]:  # pragma: no cover - compiled
    """Up to ``steps`` steps; how many were done and why it ended (DONE, NOT_FINITE, NEW_ROWS, OFF_LINE)."""
    # The caller keeps every array alive; borrowed ones cost no counting in the functions below.
    a, f, x, b, g = borrow(a), borrow(f), borrow(x), borrow(b), borrow(g)
    table, nodes = borrow(table), borrow(nodes)
    work, state, w, record = borrow(work), borrow(state), borrow(w), borrow(record)
    step, skew, whole = a.numbers[0], x.force.shape[0] > 0, b.before.shape[0] > 0
    turning = table.bends.node.shape[0] > 0
    for k in range(steps):
        begin_step(k, a, f, g, state, w)
        recording = state.counters[STEPS_DONE] % record.every == 0
        if recording and not begin_record(a, f, b, g, state, w, record):
            return k, NOT_FINITE
        if skew:
            keep_before(f, x)
        if turning:
            mark_bends(state.motion[0], f.u, table, work)
        taken = 0.0
        if whole:
            advance_whole(a, f, b)
        else:
            taken = advance(a, f, w.power)
        code = follow_feet(w.displacement, f.u, table, nodes, work)
        if turning:
            follow_bends(w.displacement, f.u, table, work)
        normal, friction, extra = _forces_of_step(g.increments[k], a, f, x, b, table, nodes, work, state, w)
        taken += extra
        if whole:
            taken = take_drag(a, f, b)
        if recording:
            end_record(a, f, table, nodes, work, state, w, record)
        state.works[DAMPING] += taken * step
        state.works[FRICTION] -= friction * step
        state.works[NORMAL] -= normal * step
        works_of_step(k, a, f, g, state, w)
        for c in range(table.indices.shape[0]):
            nodes.q[c] = work.q[c]
        for i in range(table.gap.shape[0]):
            nodes.status[i] = w.status[i]
            nodes.offset[i] *= state.reference[1]
        for p in range(w.after.shape[0]):
            state.motion[0, p], state.motion[1, p] = w.displacement[p], w.after[p]
        state.counters[STEPS_DONE] += 1
        if code:
            return k + 1, code
    return steps, DONE

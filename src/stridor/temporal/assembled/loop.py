"""The compiled time loop on assembled matrices.

Order within step n: forces of loads and supports at t_n; what a record needs of t_n; the structure to t_{n+1} without
contact; contact forces at t_n, which correct the few places they act on; works with velocities at t_n.

In terms of q alone (docs/theory-temporal.md, a and b) the scheme reads

    (M + β2 Δt C_d) a_n = f_n − K u_n − C_r q_n + Gᵀp_n − C_d q_n,       q_{n+1} = q_n + Δt a_n,
    v_n = (1 − β2) q_n + β2 q_{n+1},       u_{n+1} = u_n + Δt [(1/2 + β2) q_{n+1} − (β2 − 1/2) q_n],

where C_d is the diagonal part of the damping and C_r the rest, which acts on q_n, the velocity β2 Δt before t_n.

Works of the structure: with y_n = K u_n + C_r q_n the power v·y holds the change of the elastic energy and what C_r
takes. For β2 = 1/2 the former is the difference of ½ u_nᵀK u_{n−1}, so damping is what was accumulated less what is
stored: exact to rounding, whatever acts. Cubic springs count as stored what was done on them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from ...typing import Array, IntArray
from ..stage import (
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
    REC_GAP,
    REC_NORMAL,
    REC_SLIP,
    REC_STATUS,
    REC_TANGENTIAL,
    SLIP_STEPS,
    STICK_STEPS,
    SUPPORT,
)
from .node_stage import (
    SWEEP_LIMIT,
    NodeScratch,
    NodeState,
    contact_power,
    slip_over_step,
    solve_nodes,
)
from .node_table import NodeTable
from .products import WITH_STIFFNESS, Fields, Structure, advance, stored_energies

DONE, NOT_FINITE = 0, 1
CUBIC = 5  # works[CUBIC]: done on cubic springs
LOOP_WORKS = 6
STEPS_DONE, MOST_SWEEPS, UNCONVERGED, KEPT, NODES_KEPT = range(5)
COUNTERS = 5


class Forcing(NamedTuple):
    """Factors of loads (k, l) and increments of supports (k, p) by step; loads as csr rows on places with their lift
    (l, p); mass and damping couplings (p, size) and own matrices (p, p) of the supports; cubic springs as csr rows
    with lift (s, p) and coefficient (s,)."""

    loads: Array
    increments: Array
    load_ptr: IntArray
    load_col: IntArray
    load_val: Array
    load_lift: Array
    mass: Array
    damping: Array
    mass_own: Array
    damping_own: Array
    stiffness_own: Array
    cubic_ptr: IntArray
    cubic_col: IntArray
    cubic_val: Array
    cubic_lift: Array
    cubic: Array


class LoopState(NamedTuple):
    """What moves on beside the fields: works (6,) [J], statistics (c, 8), counters (5,), motion (2, p) displacement
    and q of the supports, coefficients (l + 2p,) that made push, base (size,) push without cubic springs, reference
    (2,): elastic energy at the start, decay of gap offsets per step."""

    works: Array
    statistics: Array
    counters: IntArray
    motion: Array
    coefficients: Array
    base: Array
    reference: Array


class Record(NamedTuple):
    """Decimated output: contacts (r, c, 5), watched rows (r, w, 3) of u, v, a, energies (r, 7); nodes (s, m, 2d) normal
    force, tangential forces, slip velocities, gap, with status (s, m), every nodes_every-th record (0: never)."""

    every: int
    nodes_every: int
    contacts: Array
    watch: Array
    energies: Array
    nodes: Array
    node_status: IntArray
    watch_ptr: IntArray
    watch_col: IntArray
    watch_val: Array
    watch_lift: Array


@njit(cache=True)
def _dot(ptr: IntArray, col: IntArray, val: Array, r: int, x: Array) -> float:  # pragma: no cover - compiled
    total = 0.0
    for p in range(ptr[r], ptr[r + 1]):
        total += val[p] * x[col[p]]
    return total


@njit(cache=True)
def _set_push(k: int, step: float, beta2: float, g: Forcing, state: LoopState, after: Array, push: Array) -> None:
    # pragma: no cover - compiled
    """Loads and supports of step k into push, if they changed; after (p,) takes q of the supports at t_{n+1}."""
    loads, motions = g.loads.shape[1], g.increments.shape[1]
    s = 1.0 + 2.0 * beta2
    changed = False
    kept = state.coefficients
    for j in range(loads):
        changed |= kept[j] != g.loads[k, j]
        kept[j] = g.loads[k, j]
    for p in range(motions):
        before, rate = state.motion[1, p], g.increments[k, p] / step
        # A constant velocity makes no acceleration out of rounding.
        if abs(rate - before) <= 1e-13 * abs(before):
            rate = before
        after[p] = ((2.0 * beta2 - 1.0) * before + 2.0 * rate) / s
        if rate == before:
            after[p] = before
        pull = -(after[p] - before) / step
        drag = -((1.0 - beta2) * before + beta2 * after[p])
        changed |= kept[loads + p] != pull or kept[loads + motions + p] != drag
        kept[loads + p], kept[loads + motions + p] = pull, drag
    if not changed:
        return
    base = state.base
    base[:] = 0.0
    for p in range(motions):
        pull, drag = kept[loads + p], kept[loads + motions + p]
        if pull != 0.0 or drag != 0.0:
            base += pull * g.mass[p] + drag * g.damping[p]
    for j in range(loads):
        if kept[j] != 0.0:
            for e in range(g.load_ptr[j], g.load_ptr[j + 1]):
                base[g.load_col[e]] += kept[j] * g.load_val[e]
    push[:] = base


@njit(cache=True)
def _cubic_forces(g: Forcing, f: Fields, state: LoopState, force: Array) -> None:  # pragma: no cover - compiled
    """Forces of the cubic springs at t_n, against push; force (s,) keeps them for their work."""
    for e in range(g.cubic_col.shape[0]):
        f.push[g.cubic_col[e]] = state.base[g.cubic_col[e]]
    for s in range(g.cubic.shape[0]):
        length = _dot(g.cubic_ptr, g.cubic_col, g.cubic_val, s, f.u)
        for p in range(state.motion.shape[1]):
            length += g.cubic_lift[s, p] * state.motion[0, p]
        force[s] = g.cubic[s] * length**3
        for e in range(g.cubic_ptr[s], g.cubic_ptr[s + 1]):
            f.push[g.cubic_col[e]] -= g.cubic_val[e] * force[s]


@njit(cache=True)
def _energies(a: Structure, f: Fields, g: Forcing, state: LoopState, row: Array) -> None:
    # pragma: no cover - compiled
    """Kinetic and elastic energy half a step before t_n and the works up to there into row (7,)."""
    kinetic, elastic = stored_energies(a, f)
    for j in range(5):
        row[2 + j] = state.works[j]
    if a.flags[2] == WITH_STIFFNESS:
        row[2 + DAMPING] -= elastic - state.reference[0]
    x, rate = state.motion[0], state.motion[1]
    for p in range(x.shape[0]):
        if rate[p] != 0.0:
            total = 0.0
            for i in range(f.q.shape[0]):
                total += g.mass[p, i] * f.q[i]
            kinetic += rate[p] * total
        for o in range(x.shape[0]):
            kinetic += 0.5 * rate[p] * g.mass_own[p, o] * rate[o]
            elastic += 0.5 * x[p] * g.stiffness_own[p, o] * (x[o] - a.numbers[0] * rate[o])
    row[0], row[1] = kinetic, elastic + state.works[CUBIC]


@njit(cache=True)
def _correct(
    a: Structure, f: Fields, table: NodeTable, nodes: NodeState, work: NodeScratch
) -> float:  # pragma: no cover - compiled
    """Bring what the contact forces changed into the fields; what that adds to the power wanted of the structure."""
    beta2, forth = a.numbers[1], a.numbers[2]
    inner = 1.0 if a.flags[2] == WITH_STIFFNESS else 0.0
    extra = 0.0
    for c in range(table.place.shape[0]):
        if work.correction[c] == 0.0:
            continue
        i = table.place[c]
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


@njit(cache=True)
def _support_works(
    a: Structure, g: Forcing, state: LoopState, after: Array, before: Array, f: Fields, contact: Array
) -> None:  # pragma: no cover - compiled
    """Works of supports that move: reaction times velocity, and their part in damping. before (2, p): couplings on q
    at t_n; contact (p,): what contact forces and loads send to the support."""
    step, beta2 = a.numbers[0], a.numbers[1]
    rate = state.motion[1]
    for p in range(after.shape[0]):
        velocity = (1.0 - beta2) * rate[p] + beta2 * after[p]
        if velocity == 0.0 and after[p] == 0.0:
            continue
        inertia = drag = 0.0
        for i in range(f.q.shape[0]):
            inertia += g.mass[p, i] * f.q[i]
            drag += g.damping[p, i] * f.q[i]
        drag = (1.0 - beta2) * before[1, p] + beta2 * drag
        reaction = (inertia - before[0, p]) / step + drag - contact[p]
        damped = 2.0 * drag
        for o in range(after.shape[0]):
            other = (1.0 - beta2) * rate[o] + beta2 * after[o]
            reaction += g.mass_own[p, o] * (after[o] - rate[o]) / step + g.damping_own[p, o] * other
            reaction += g.stiffness_own[p, o] * state.motion[0, o]
            damped += g.damping_own[p, o] * other
        state.works[SUPPORT] += reaction * velocity * step
        state.works[DAMPING] += damped * velocity * step


@njit(cache=True)
def _statistics(
    count: int, ratio: Array, step: float, increments: Array, table: NodeTable, nodes: NodeState, work: NodeScratch,
    status: IntArray, state: LoopState, sums: Array,
) -> None:  # pragma: no cover - compiled
    """Status and forces of the contacts in this step into their statistics; sums (c, 5) is work space and afterwards
    holds normal and tangential force and status in its first three columns."""
    sums[:] = 0.0
    for n in range(count):
        i = work.chosen[n]
        row = sums[table.owner[i]]
        row[0] += nodes.force[i, 0]
        for j in range(table.along.shape[1]):
            row[1] += nodes.force[i, 1 + j] * table.along[i, j]
        row[2] = max(row[2], float(status[i]))
        if status[i] == 2:
            row[3] = max(row[3], slip_over_step(i, ratio, increments, table, nodes, work) / step)
    number = float(state.counters[STEPS_DONE])
    for c in range(sums.shape[0]):
        row, kept = sums[c], state.statistics[c]
        if row[2] == 1.0:
            kept[STICK_STEPS] += 1.0
            if kept[FIRST_STICK] < 0.0:
                kept[FIRST_STICK] = number
        elif row[2] == 2.0:
            kept[SLIP_STEPS] += 1.0
            kept[MAX_SPEED] = max(kept[MAX_SPEED], row[3])
        else:
            kept[OPEN_STEPS] += 1.0
            if kept[FIRST_OPEN] < 0.0:
                kept[FIRST_OPEN] = number
        kept[MAX_NORMAL] = max(kept[MAX_NORMAL], row[0])
        kept[MAX_TANGENTIAL] = max(kept[MAX_TANGENTIAL], abs(row[1]))


@njit(cache=True)
def _record_contacts(
    beta2: float, velocity: Array, table: NodeTable, nodes: NodeState, work: NodeScratch, status: IntArray, sums: Array,
    place: int, record: Record, node_place: int,
) -> None:  # pragma: no cover - compiled
    """Contacts of one record: sums, slip speeds weighted by force, least gaps; all nodes where node_place ≥ 0."""
    out = record.contacts[place]
    t = table.along.shape[1]
    area = np.zeros(sums.shape[0])
    plain = np.zeros(sums.shape[0])
    for c in range(sums.shape[0]):
        out[c, REC_NORMAL], out[c, REC_TANGENTIAL], out[c, REC_STATUS] = sums[c, 0], sums[c, 1], sums[c, 2]
        out[c, REC_SLIP] = 0.0
        out[c, REC_GAP] = np.inf
    for i in range(table.gap.shape[0]):
        c = table.owner[i]
        gap = work.gap[i]
        slip = 0.0
        if node_place >= 0:
            record.nodes[node_place, i, 0] = nodes.force[i, 0]
            record.node_status[node_place, i] = status[i]
        for p in range(table.ptr[i], table.ptr[i + 1]):
            gap += table.row[p, 0] * work.correction[table.col[p]]
        for j in range(t):
            v = 0.0
            for p in range(table.ptr[i], table.ptr[i + 1]):
                e = table.col[p]
                v += table.row[p, 1 + j] * ((1.0 - beta2) * nodes.q[e] + beta2 * work.q[e])
            for m in range(velocity.shape[0]):
                v += table.lift[i, 1 + j, m] * velocity[m]
            slip += v * table.along[i, j]
            if node_place >= 0:
                record.nodes[node_place, i, 1 + j] = nodes.force[i, 1 + j]
                record.nodes[node_place, i, 1 + t + j] = v
        if node_place >= 0:
            record.nodes[node_place, i, 1 + 2 * t] = gap
        out[c, REC_GAP] = min(out[c, REC_GAP], gap)
        out[c, REC_SLIP] += nodes.force[i, 0] * slip
        area[c] += table.weight[i]
        plain[c] += table.weight[i] * slip
    for c in range(sums.shape[0]):
        if sums[c, 0] > 0.0:
            out[c, REC_SLIP] /= sums[c, 0]
        else:
            out[c, REC_SLIP] = plain[c] / area[c]


@njit(cache=True)
def run_steps(
    steps: int, a: Structure, f: Fields, g: Forcing, table: NodeTable, nodes: NodeState, work: NodeScratch,
    state: LoopState, record: Record,
) -> tuple[int, int]:  # pragma: no cover - compiled
    """Up to ``steps`` steps; how many were done and why it ended (DONE, NOT_FINITE)."""
    step, beta2 = a.numbers[0], a.numbers[1]
    ratio = a.numbers[2:4]
    loads, motions = g.loads.shape[1], g.increments.shape[1]
    power = np.zeros(16)
    after, before = np.zeros(motions), np.zeros((2, motions))
    sent, x, velocity = np.zeros(motions), np.zeros(motions), np.zeros(motions)
    spring, load_rate = np.zeros(g.cubic.shape[0]), np.zeros(loads)
    spring_rate = np.zeros(g.cubic.shape[0])
    sums = np.zeros((state.statistics.shape[0], 5))
    status = np.zeros(table.gap.shape[0], dtype=np.int64)
    watched = np.zeros((record.watch_lift.shape[0], 2))
    contacts = table.gap.shape[0] > 0
    for k in range(steps):
        number = state.counters[STEPS_DONE]
        _set_push(k, step, beta2, g, state, after, f.push)
        if g.cubic.shape[0]:
            _cubic_forces(g, f, state, spring)
            for s in range(spring.shape[0]):
                spring_rate[s] = _dot(g.cubic_ptr, g.cubic_col, g.cubic_val, s, f.q)
        recording = number % record.every == 0
        at = state.counters[KEPT]
        if recording:
            _energies(a, f, g, state, record.energies[at])
            if not np.isfinite(record.energies[at, 0] + record.energies[at, 1]):
                return k, NOT_FINITE
            for r in range(watched.shape[0]):
                watched[r, 0] = _dot(record.watch_ptr, record.watch_col, record.watch_val, r, f.u)
                watched[r, 1] = _dot(record.watch_ptr, record.watch_col, record.watch_val, r, f.q)
        for j in range(loads):
            load_rate[j] = 0.0
            if g.loads[k, j] != 0.0:
                load_rate[j] = _dot(g.load_ptr, g.load_col, g.load_val, j, f.q)
        for p in range(motions):
            velocity[p] = (1.0 - beta2) * state.motion[1, p] + beta2 * after[p]
            x[p] = state.motion[0, p] + g.increments[k, p]
            sent[p] = before[0, p] = before[1, p] = 0.0
            if velocity[p] != 0.0 or after[p] != 0.0:
                for i in range(f.q.shape[0]):
                    before[0, p] += g.mass[p, i] * f.q[i]
                    before[1, p] += g.damping[p, i] * f.q[i]
        taken = advance(a, f, power)
        count = 0
        if contacts:
            for c in range(table.place.shape[0]):
                work.u[c], work.q[c] = f.u[table.place[c]], f.q[table.place[c]]
            count, sweeps = solve_nodes(step, ratio, x, g.increments[k], table, nodes, work, status)
            state.counters[MOST_SWEEPS] = max(state.counters[MOST_SWEEPS], min(sweeps, SWEEP_LIMIT))
            state.counters[UNCONVERGED] += sweeps > SWEEP_LIMIT
            if count:
                taken += _correct(a, f, table, nodes, work)
                normal, friction = contact_power(count, beta2, velocity, table, nodes, work)
                for n in range(count):
                    i = work.chosen[n]
                    for p in range(motions):
                        for j in range(table.row.shape[1]):
                            sent[p] += table.lift[i, j, p] * nodes.force[i, j]
            else:
                work.correction[:] = 0.0
                normal = friction = 0.0
            _statistics(count, ratio, step, g.increments[k], table, nodes, work, status, state, sums)
        if recording:
            for r in range(watched.shape[0]):
                out = record.watch[at, r]
                rate = _dot(record.watch_ptr, record.watch_col, record.watch_val, r, f.q)
                out[0] = watched[r, 0]
                out[1] = (1.0 - beta2) * watched[r, 1] + beta2 * rate
                out[2] = (rate - watched[r, 1]) / step
                for p in range(motions):
                    lift = record.watch_lift[r, p]
                    out[0] += lift * state.motion[0, p]
                    out[1] += lift * velocity[p]
                    out[2] += lift * (after[p] - state.motion[1, p]) / step
            if contacts:
                node_place = -1
                if record.nodes_every and number // record.every % record.nodes_every == 0:
                    node_place = state.counters[NODES_KEPT]
                    state.counters[NODES_KEPT] += 1
                _record_contacts(beta2, velocity, table, nodes, work, status, sums, at, record, node_place)
            state.counters[KEPT] += 1
        state.works[DAMPING] += taken * step
        if count:
            state.works[FRICTION] -= friction * step
            state.works[NORMAL] -= normal * step
        for j in range(loads):
            if g.loads[k, j] != 0.0:
                rate = _dot(g.load_ptr, g.load_col, g.load_val, j, f.q)
                rate = (1.0 - beta2) * load_rate[j] + beta2 * rate
                for p in range(motions):
                    rate += g.load_lift[j, p] * velocity[p]
                    sent[p] += g.load_lift[j, p] * g.loads[k, j]
                state.works[EXTERNAL] += g.loads[k, j] * rate * step
        for s in range(spring.shape[0]):
            rate = _dot(g.cubic_ptr, g.cubic_col, g.cubic_val, s, f.q)
            rate = (1.0 - beta2) * spring_rate[s] + beta2 * rate
            for p in range(motions):
                rate += g.cubic_lift[s, p] * velocity[p]
                sent[p] -= g.cubic_lift[s, p] * spring[s]
            state.works[CUBIC] += spring[s] * rate * step
        _support_works(a, g, state, after, before, f, sent)
        for c in range(table.place.shape[0]):
            nodes.q[c] = work.q[c]
        for i in range(table.gap.shape[0]):
            nodes.status[i] = status[i]
            nodes.offset[i] *= state.reference[1]
        for p in range(motions):
            state.motion[1, p] = after[p]
            state.motion[0, p] = x[p]
        state.counters[STEPS_DONE] += 1
    return steps, DONE

"""The compiled loop of the implicit stepper.

    M̃ (v⁺ − v) + h C̃ (v + v⁺)/2 + h K (q + q⁺)/2 = h f + HᵀP,      q⁺ = q + h (v + v⁺)/2

in modes (`warp`), with impulses P from `node_law`. The works are those of mean velocities over the step, with which the
energy of the scheme, ½ vᵀM̃v + ½ qᵀKq, changes by exactly what they say.
"""

from __future__ import annotations

import math

import numpy as np

from ....contact import multipliers
from ....kernels import njit, put
from ....typing import Array
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
    REC_GAP,
    REC_NORMAL,
    REC_SLIP,
    REC_STATUS,
    REC_TANGENTIAL,
    SLIP_STEPS,
    STICK_STEPS,
    SUPPORT,
)
from .arrays import BY_NEWTON, DONE, KEPT, MOST_SWEEPS, NODES_KEPT, Nodes, Record, StepState, Structure, Work
from .node_law import SWEEP_LIMIT, solve_nodes, total_of

# Steps after which gaps and velocities of the nodes are read off the structure again. From step to step they are
# added up, with the gap over the step taken in and out: the digits that this loses drift one way, as a slip would.
RENEWED = 32
FINISHED, NOT_FINITE, HARD = 0, 1, 2
_SLIP, _STICK = multipliers.SLIP, multipliers.STICK


@njit(cache=True, fastmath={"reassoc", "contract", "nsz", "arcp"})
def _dot(a: Array, b: Array) -> float:  # pragma: no cover - compiled
    total = 0.0
    for k in range(len(a)):
        total += a[k] * b[k]
    return total


@njit(cache=True, fastmath={"reassoc", "contract", "nsz", "arcp"})
def _add(total: Array, row: Array, factor: float) -> None:  # pragma: no cover - compiled
    for k in range(len(total)):
        total[k] += factor * row[k]


@njit(cache=True)
def _drag(a: Structure, v: Array, i: int) -> float:  # pragma: no cover - compiled
    return _dot(a.coupled[i], v) if a.coupled.shape[0] else a.damping[i] * v[i]


@njit(cache=True)
def _free(loads: Array, rate: Array, a: Structure, state: StepState, work: Work) -> None:  # pragma: no cover - compiled
    """What v changes by over the step without contact, into work.change; forces of loads and supports into force."""
    h, r = a.step, len(state.q)
    for i in range(r):
        work.force[i] = 0.0
    for j in range(len(loads)):
        if loads[j] != 0.0:
            _add(work.force, a.loads[j], loads[j])
    for p in range(len(rate)):
        pull, mean = (rate[p] - state.motion[1, p]) / h, 0.5 * (rate[p] + state.motion[1, p])
        if pull != 0.0:
            _add(work.force, a.inertia[p], -pull)
        if mean != 0.0:
            _add(work.force, a.drag[p], -mean)
    for i in range(r):
        work.change[i] = h * (work.force[i] - a.stiffness[i] * (state.q[i] + 0.5 * h * state.v[i]))
    if a.solved.shape[0]:
        # hC̃v = 2 (M̂ − E) v with E = M̃ + h²K/4: one product with a full matrix, not two.
        right = work.change.copy()
        for i in range(r):
            right[i] += 2.0 * (a.mass[i] + 0.25 * h * h * a.stiffness[i]) * state.v[i]
        for i in range(r):
            work.change[i] = _dot(a.solved[i], right) - 2.0 * state.v[i]
    else:
        for i in range(r):
            work.change[i] = a.inverse[i] * (work.change[i] - h * a.damping[i] * state.v[i])


@njit(cache=True)
def _seen(increment: Array, rate: Array, a: Structure, nodes: Nodes, state: StepState, work: Work) -> None:
    # pragma: no cover - compiled
    """What the laws of the nodes see without impulses, into work.free; velocities at the start into work.slip."""
    h, d = a.step, work.local.shape[1]
    for i in range(len(nodes.gap)):
        at = i * d
        for j in range(d):
            work.free[at + j] = state.speed[at + j] + _dot(nodes.row[at + j], work.change)
            work.slip[at + j], work.apart[at + j] = state.speed[at + j], 0.0
            for p in range(len(rate)):
                if j:
                    work.apart[at + j] += nodes.lift[at + j, p] * rate[p]
                work.slip[at + j] += nodes.lift[at + j, p] * state.motion[1, p]
        gap = nodes.gap[i] + state.place[i]
        work.start[i] = gap
        gap += 0.5 * h * state.speed[at]
        share = 2.0 if nodes.stiffness[i] > 0.0 else 1.0
        for p in range(len(rate)):
            way, lift = state.motion[0, p], nodes.lift[at, p]
            work.start[i] += lift * way
            gap += lift * (way + increment[p])
            if nodes.stiffness[i] == 0.0:
                gap += 0.5 * h * lift * rate[p]
        work.apart[at] = share * gap / h
        for j in range(d):
            work.free[at + j] += work.apart[at + j]


@njit(cache=True)
def free_of_contact(
    loads: Array, increment: Array, rate: Array, a: Structure, nodes: Nodes, state: StepState, work: Work
) -> None:  # pragma: no cover - compiled
    """The step from here without contact: work.change of v, and what the nodes see of it."""
    _free(loads, rate, a, state, work)
    if len(nodes.gap):
        _seen(increment, rate, a, nodes, state, work)


@njit(cache=True)
def _statistics(a: Structure, nodes: Nodes, state: StepState, work: Work) -> None:  # pragma: no cover - compiled
    """Status and forces of the step into the statistics; sums (c, 6): N, T, status, slip speed at most, Σ|N|."""
    d, sums = work.local.shape[1], work.sums
    sums[:] = 0.0
    for i in range(len(nodes.gap)):
        row, at = sums[nodes.owner[i]], i * d
        row[2] = max(row[2], float(work.status[i]))
        if work.status[i] == 0:
            continue
        row[0] += work.impulse[at] / a.step
        row[4] += abs(work.impulse[at]) / a.step
        slip = 0.0
        for j in range(1, d):
            row[1] += work.impulse[at + j] * nodes.along[i, j - 1] / a.step
            slip += (0.5 * (work.slip[at + j] + work.total[at + j])) ** 2
        if work.status[i] == _SLIP:
            row[3] = max(row[3], math.sqrt(slip))
    number = float(state.counters[DONE])
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
        kept[MAX_NORMAL] = max(kept[MAX_NORMAL], abs(row[0]))
        kept[MAX_TANGENTIAL] = max(kept[MAX_TANGENTIAL], abs(row[1]))


@njit(cache=True)
def _energies(a: Structure, state: StepState, row: Array) -> None:  # pragma: no cover - compiled
    """Kinetic and elastic energy of the scheme at t_n, and the works up to there."""
    kinetic = elastic = 0.0
    for i in range(len(state.q)):
        kinetic += 0.5 * a.mass[i] * state.v[i] ** 2
        elastic += 0.5 * a.stiffness[i] * state.q[i] ** 2
    way, rate = state.motion[0], state.motion[1]
    for p in range(len(way)):
        if rate[p] != 0.0:
            kinetic += rate[p] * _dot(a.inertia[p], state.v)
        for o in range(len(way)):
            kinetic += 0.5 * rate[p] * a.mass_own[p, o] * rate[o]
            elastic += 0.5 * way[p] * a.stiffness_own[p, o] * way[o]
    row[0], row[1] = kinetic, elastic
    for j in range(5):
        row[2 + j] = state.works[j]


@njit(cache=True)
def _record_nodes(a: Structure, nodes: Nodes, state: StepState, work: Work, record: Record) -> None:
    # pragma: no cover - compiled
    """Contacts at t_n: forces are means over the steps before and after, status that of the step after."""
    d, at_record = work.local.shape[1], state.counters[KEPT]
    out, sums = record.contacts[at_record], work.sums
    node_row = -1
    if record.nodes_every and state.counters[DONE] // record.every % record.nodes_every == 0:
        node_row = state.counters[NODES_KEPT]
        state.counters[NODES_KEPT] += 1
    share = 1.0 if state.counters[DONE] == 0 else 0.5
    sums[:] = 0.0
    for c in range(out.shape[0]):
        out[c, REC_NORMAL] = out[c, REC_TANGENTIAL] = out[c, REC_SLIP] = out[c, REC_STATUS] = 0.0
        out[c, REC_GAP] = np.inf
    for i in range(len(nodes.gap)):
        c, at = nodes.owner[i], i * d
        gap = nodes.gap[i] + state.place[i]
        for p in range(state.motion.shape[1]):
            gap += nodes.lift[at, p] * state.motion[0, p]
        normal = share * (work.impulse[at] + (state.impulse[at] if share < 1.0 else 0.0)) / a.step
        tangential = slip = 0.0
        for j in range(1, d):
            force = share * (work.impulse[at + j] + (state.impulse[at + j] if share < 1.0 else 0.0)) / a.step
            tangential += force * nodes.along[i, j - 1]
            slip += work.slip[at + j] * nodes.along[i, j - 1]
            if node_row >= 0:
                record.nodes[node_row, i, j] = force
                record.nodes[node_row, i, d - 1 + j] = work.slip[at + j]
        if node_row >= 0:
            record.nodes[node_row, i, 0] = normal
            record.nodes[node_row, i, 2 * d - 1] = gap
            record.node_status[node_row, i] = work.status[i]
        out[c, REC_NORMAL] += normal
        out[c, REC_TANGENTIAL] += tangential
        out[c, REC_STATUS] = max(out[c, REC_STATUS], float(work.status[i]))
        out[c, REC_GAP] = min(out[c, REC_GAP], gap)
        sums[c, 0] += abs(normal)
        sums[c, 1] += abs(normal) * slip
        sums[c, 2] += nodes.weight[i]
        sums[c, 3] += nodes.weight[i] * slip
    for c in range(out.shape[0]):
        out[c, REC_SLIP] = sums[c, 1] / sums[c, 0] if sums[c, 0] > 0.0 else sums[c, 3] / sums[c, 2]


@njit(cache=True)
def _record(rate: Array, a: Structure, nodes: Nodes, state: StepState, work: Work, record: Record) -> None:
    # pragma: no cover - compiled
    """t_n with what the step from there has shown; work.change is then what v changes by over it."""
    at, first = state.counters[KEPT], state.counters[DONE] == 0
    h = a.step
    for r in range(record.watch_row.shape[0]):
        row, out = record.watch_row[r], record.watch[at, r]
        out[0], out[1] = _dot(row, state.q), _dot(row, state.v)
        after = _dot(row, work.change)
        out[2] = after / h if first else 0.5 * (after + out[1] - _dot(row, state.before)) / h
        for p in range(len(rate)):
            lift = record.watch_lift[r, p]
            out[0] += lift * state.motion[0, p]
            out[1] += lift * state.motion[1, p]
            # Over the same steps as the part of the structure: the two nearly cancel where a support takes it along.
            begun = state.motion[1, p] if first else state.rate_before[p]
            out[2] += lift * (rate[p] - begun) / h * (1.0 if first else 0.5)
    if len(nodes.gap):
        _record_nodes(a, nodes, state, work, record)
    state.counters[KEPT] += 1


@njit(cache=True)
def _finish(
    loads: Array, increment: Array, rate: Array, a: Structure, nodes: Nodes, state: StepState, work: Work
) -> None:  # pragma: no cover - compiled
    """The step itself, and its works; work.change is what v changes by."""
    h, r, d, motions = a.step, len(state.q), work.local.shape[1], len(rate)
    works = state.works
    damped = 0.0
    mean = work.rate
    for p in range(motions):
        mean[p] = 0.5 * (rate[p] + state.motion[1, p])
    for i in range(len(nodes.gap)):
        at = i * d
        for j in range(d):
            if work.impulse[at + j] != 0.0:
                speed = 0.5 * (work.slip[at + j] + work.total[at + j])
                works[NORMAL if j == 0 else FRICTION] -= work.impulse[at + j] * speed
    for i in range(r):
        state.before[i] = state.v[i]
        state.v[i] += work.change[i]
        work.force[i] = 0.5 * (state.before[i] + state.v[i])
        state.q[i] += h * work.force[i]
    for i in range(r):
        damped += work.force[i] * _drag(a, work.force, i)
    for j in range(len(loads)):
        if loads[j] != 0.0:
            power = _dot(a.loads[j], work.force)
            for p in range(motions):
                power += a.load_lift[j, p] * mean[p]
            works[EXTERNAL] += h * loads[j] * power
    for p in range(motions):
        if mean[p] == 0.0 and increment[p] == 0.0:
            continue
        drag = _dot(a.drag[p], work.force)
        damped += 2.0 * mean[p] * drag
        push = _dot(a.inertia[p], work.change) + h * drag
        for j in range(len(loads)):
            push -= h * a.load_lift[j, p] * loads[j]
        for k in range(len(work.impulse)):
            if work.impulse[k] != 0.0:
                push -= nodes.lift[k, p] * work.impulse[k]
        for o in range(motions):
            push += a.mass_own[p, o] * (rate[o] - state.motion[1, o]) + h * a.damping_own[p, o] * mean[o]
            damped += mean[p] * a.damping_own[p, o] * mean[o]
            way = state.motion[0, o] + 0.5 * increment[o]
            works[SUPPORT] += increment[p] * a.stiffness_own[p, o] * way
        works[SUPPORT] += mean[p] * push
    works[DAMPING] += h * damped
    for p in range(motions):
        state.motion[0, p] += increment[p]
        state.rate_before[p] = state.motion[1, p]
        state.motion[1, p] = rate[p]


@njit(cache=True)
def _move_nodes(rate: Array, a: Structure, nodes: Nodes, state: StepState, work: Work) -> None:
    # pragma: no cover - compiled
    """Velocities behind the step into work.total, of structure and supports; the nodes' own state follows."""
    d = work.local.shape[1]
    for i in range(len(nodes.gap)):
        at = i * d
        for j in range(d):
            speed = work.total[at + j] - work.apart[at + j]
            if j == 0:
                state.place[i] += 0.5 * a.step * (state.speed[at] + speed)
            state.speed[at + j] = speed
            work.total[at + j] = speed
            for p in range(len(rate)):
                work.total[at + j] += nodes.lift[at + j, p] * rate[p]


@njit(cache=True)
def _renew(nodes: Nodes, state: StepState, d: int) -> None:  # pragma: no cover - compiled
    """Gaps and velocities of the nodes as the structure has them."""
    for i in range(len(nodes.gap)):
        state.place[i] = _dot(nodes.row[i * d], state.q)
        for j in range(d):
            state.speed[i * d + j] = _dot(nodes.row[i * d + j], state.v)


@njit(cache=True)
def run_steps(
    steps: int, given: bool, loads: Array, increments: Array, rates: Array, a: Structure, nodes: Nodes,
    state: StepState, work: Work, record: Record,
) -> tuple[int, int]:  # pragma: no cover - compiled
    """Up to ``steps`` steps; how many were done and why it ended: FINISHED, NOT_FINITE, or HARD where Gauss–Seidel does
    not settle. given: whether work.impulse has the impulses of the first step, with work.status."""
    m = len(nodes.gap)
    for k in range(steps):
        rate = rates[k]
        if not math.isfinite(_dot(state.v, state.v) + _dot(state.q, state.q)):
            return k, NOT_FINITE
        free_of_contact(loads[k], increments[k], rate, a, nodes, state, work)
        if m:
            if given:
                given = False
                total_of(nodes, work)
                state.counters[BY_NEWTON] += 1
            else:
                put(work.impulse, state.impulse)
                sweeps = solve_nodes(SWEEP_LIMIT, a.step, nodes, state, work)
                if sweeps > SWEEP_LIMIT:
                    return k, HARD
                state.counters[MOST_SWEEPS] = max(state.counters[MOST_SWEEPS], sweeps)
            for c in range(len(work.impulse)):
                if work.impulse[c] != 0.0:
                    _add(work.change, nodes.answer[c], work.impulse[c])
        if state.counters[DONE] % record.every == 0:
            _energies(a, state, record.energies[state.counters[KEPT]])
            _record(rate, a, nodes, state, work, record)
        if m:
            _move_nodes(rate, a, nodes, state, work)
            _statistics(a, nodes, state, work)
        _finish(loads[k], increments[k], rate, a, nodes, state, work)
        if m:
            put(state.earlier, state.impulse)
            put(state.impulse, work.impulse)
            put(state.status, work.status)
        state.counters[DONE] += 1
        if m and state.counters[DONE] % RENEWED == 0:
            _renew(nodes, state, work.local.shape[1])
    return steps, FINISHED

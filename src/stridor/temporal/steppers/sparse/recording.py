"""What the compiled loop keeps: records of contacts, watched points and energies, and statistics of every step."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ....kernels import njit
from ....typing import Array, IntArray
from ...columns import (
    DAMPING,
    ENERGY_RECORD,
    FIRST_OPEN,
    FIRST_STICK,
    MAX_NORMAL,
    MAX_SPEED,
    MAX_TANGENTIAL,
    OPEN_STEPS,
    REC_GAP,
    REC_NORMAL,
    REC_SLIP,
    REC_STATUS,
    REC_TANGENTIAL,
    SLIP_STEPS,
    STICK_STEPS,
)
from .forcing import CIRCULATORY, CUBIC, GYROSCOPIC, KEPT, NODES_KEPT, STEPS_DONE, Forcing, LoopState, StepWork, dot
from .node_stage import NodeScratch, NodeState, slip_over_step
from .node_table import NodeTable
from .products import WITH_STIFFNESS, Fields, Structure, stored_energies
from .step_matrix import StepMatrix, kinetic_energy


class Record(NamedTuple):
    """Decimated output: contacts (r, c, 5), watched rows (r, w, 3) of u, v, a, energies (r, 7 or 9); nodes (s, m, 2d)
    normal force, tangential forces, slip velocities, gap, with status (s, m), every nodes_every-th record
    (0: never)."""

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


@njit(cache=True, allocates=False)
def energies(a: Structure, f: Fields, b: StepMatrix, g: Forcing, state: LoopState, row: Array) -> None:
    # pragma: no cover - compiled
    """Kinetic and elastic energy half a step before t_n and the works up to there into row (7,) or (9,)."""
    kinetic, elastic = stored_energies(a, f)
    if b.before.shape[0]:
        kinetic = kinetic_energy(f, b)
    for j in range(5):
        row[2 + j] = state.works[j]
    if a.flags[2] == WITH_STIFFNESS:
        row[2 + DAMPING] -= elastic - state.reference[0]
    x, rate = state.motion[0], state.motion[1]
    for p in range(x.shape[0]):
        if rate[p] != 0.0:
            total = 0.0
            for e in range(g.near.shape[0]):
                total += g.mass[p, e] * f.q[g.near[e]]
            kinetic += rate[p] * total
        for o in range(x.shape[0]):
            kinetic += 0.5 * rate[p] * g.mass_own[p, o] * rate[o]
            elastic += 0.5 * x[p] * g.stiffness_own[p, o] * (x[o] - a.numbers[0] * rate[o])
    if row.shape[0] > ENERGY_RECORD:
        row[ENERGY_RECORD], row[ENERGY_RECORD + 1] = state.works[CIRCULATORY], state.works[GYROSCOPIC]
    row[0], row[1] = kinetic, elastic + state.works[CUBIC]


@njit(cache=True, allocates=False, forceinline=True)
def statistics(
    count: int, ratio: Array, step: float, increments: Array, table: NodeTable, nodes: NodeState, work: NodeScratch,
    status: IntArray, state: LoopState, sums: Array,
) -> None:  # pragma: no cover - compiled
    """Status and forces of the contacts in this step into their statistics; sums (c, 6) is work space and afterwards
    holds normal and tangential force and status in its first three columns, the sum of |N| in the last."""
    for c in range(sums.shape[0]):
        for j in range(sums.shape[1]):
            sums[c, j] = 0.0
    for n in range(count):
        i = work.chosen[n]
        row = sums[table.owner[i]]
        row[0] += nodes.force[i, 0]
        row[5] += abs(nodes.force[i, 0])
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
        kept[MAX_NORMAL] = max(kept[MAX_NORMAL], abs(row[0]))
        kept[MAX_TANGENTIAL] = max(kept[MAX_TANGENTIAL], abs(row[1]))


@njit(cache=True, allocates=False)
def _record_contacts(
    beta2: float, velocity: Array, table: NodeTable, nodes: NodeState, work: NodeScratch, status: IntArray, sums: Array,
    row: int, record: Record, node_row: int,
) -> None:  # pragma: no cover - compiled
    """Contacts of one record: sums, slip speeds weighted by force, least gaps; all nodes where node_row ≥ 0."""
    out = record.contacts[row]
    t = table.along.shape[1]
    for c in range(sums.shape[0]):
        sums[c, 3] = sums[c, 4] = 0.0
        out[c, REC_NORMAL], out[c, REC_TANGENTIAL], out[c, REC_STATUS] = sums[c, 0], sums[c, 1], sums[c, 2]
        out[c, REC_SLIP] = 0.0
        out[c, REC_GAP] = np.inf
    for i in range(table.gap.shape[0]):
        c = table.owner[i]
        gap = work.gap[i]
        slip = 0.0
        if node_row >= 0:
            record.nodes[node_row, i, 0] = nodes.force[i, 0]
            record.node_status[node_row, i] = status[i]
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
            if node_row >= 0:
                record.nodes[node_row, i, 1 + j] = nodes.force[i, 1 + j]
                record.nodes[node_row, i, 1 + t + j] = v
        if node_row >= 0:
            record.nodes[node_row, i, 1 + 2 * t] = gap
        out[c, REC_GAP] = min(out[c, REC_GAP], gap)
        out[c, REC_SLIP] += abs(nodes.force[i, 0]) * slip
        sums[c, 3] += table.weight[i]
        sums[c, 4] += table.weight[i] * slip
    for c in range(sums.shape[0]):
        if sums[c, 5] > 0.0:
            out[c, REC_SLIP] /= sums[c, 5]
        else:
            out[c, REC_SLIP] = sums[c, 4] / sums[c, 3]


@njit(cache=True, allocates=False)
def begin_record(
    a: Structure, f: Fields, b: StepMatrix, g: Forcing, state: LoopState, w: StepWork, record: Record
) -> bool:  # pragma: no cover - compiled
    """What a record needs of t_n before the step; whether the energies are finite."""
    at = state.counters[KEPT]
    energies(a, f, b, g, state, record.energies[at])
    for r in range(w.watched.shape[0]):
        w.watched[r, 0] = dot(record.watch_ptr, record.watch_col, record.watch_val, r, f.u)
        w.watched[r, 1] = dot(record.watch_ptr, record.watch_col, record.watch_val, r, f.q)
    return bool(np.isfinite(record.energies[at, 0] + record.energies[at, 1]))


@njit(cache=True, allocates=False)
def end_record(
    a: Structure, f: Fields, table: NodeTable, nodes: NodeState, work: NodeScratch, state: LoopState, w: StepWork,
    record: Record,
) -> None:  # pragma: no cover - compiled
    """Complete the record of t_n with what the step has shown."""
    step, beta2 = a.numbers[0], a.numbers[1]
    at = state.counters[KEPT]
    for r in range(w.watched.shape[0]):
        out = record.watch[at, r]
        rate = dot(record.watch_ptr, record.watch_col, record.watch_val, r, f.q)
        out[0] = w.watched[r, 0]
        out[1] = (1.0 - beta2) * w.watched[r, 1] + beta2 * rate
        out[2] = (rate - w.watched[r, 1]) / step
        for p in range(w.after.shape[0]):
            lift = record.watch_lift[r, p]
            out[0] += lift * state.motion[0, p]
            out[1] += lift * w.velocity[p]
            out[2] += lift * (w.after[p] - state.motion[1, p]) / step
    if table.gap.shape[0]:
        node_row = -1
        if record.nodes_every and state.counters[STEPS_DONE] // record.every % record.nodes_every == 0:
            node_row = state.counters[NODES_KEPT]
            state.counters[NODES_KEPT] += 1
        _record_contacts(beta2, w.velocity, table, nodes, work, w.status, w.sums, at, record, node_row)
    state.counters[KEPT] += 1

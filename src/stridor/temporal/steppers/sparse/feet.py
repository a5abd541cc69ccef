"""What slides finitely in the compiled loop: rows, gaps and compliances of points as their curves are in each step, and
of nodes of surfaces as their normals turn between two renewals."""

from __future__ import annotations

import math

from ....kernels import njit
from ....typing import Array, IntArray
from ..curve import ROWS, leaves, project_in, turn
from .bends import FARTHEST, bent_gap
from .node_stage import NodeScratch, NodeState
from .node_table import NodeTable

NEW_ROWS, OFF_LINE = 2, 3


@njit(cache=True, allocates=False)
def _mix(lo: int, hi: int, col: IntArray, base: Array, work: NodeScratch, out: Array) -> None:
    # pragma: no cover - compiled
    """Entries lo … hi − 1 of out: those of base (l, 10) times the weights of normal and tangent."""
    for e in range(lo, hi):
        n = t = 0.0
        for r in range(ROWS):
            n += base[col[e], r] * work.normal[r]
            t += base[col[e], r] * work.tangent[r]
        out[e, 0], out[e, 1] = n, t


@njit(cache=True, allocates=False)
def _find_foot(k: int, x: Array, u: Array, table: NodeTable, nodes: NodeState, work: NodeScratch) -> bool:
    # pragma: no cover - compiled
    """Foot of curve k where the supports are at x and the structure at u; whether it is on the line."""
    curves, at = table.curves, work.foot
    i = curves.node[k]
    sx = sy = 0.0
    for r in range(ROWS):
        place = curves.reference[k, r]
        for p in range(x.shape[0]):
            place += curves.lift[k, r, p] * x[p]
        for e in range(table.ptr[i], table.ptr[i + 1]):
            place += curves.base[k, table.col[e], r] * u[table.indices[table.col[e]]]
        if r == 0:
            sx = place
        elif r == 1:
            sy = place
        else:
            at.nodes[r // 2 - 1, r % 2] = place
    chords = curves.chords[curves.chords_at[k] : curves.chords_at[k + 1]]
    nodes.xi[i], on_line = project_in(nodes.segment[i], sx, sy, nodes.xi[i], chords, at)
    turn(curves.side[k], at, work.normal, work.tangent)
    return on_line


@njit(cache=True, allocates=False)
def follow_feet(x: Array, u: Array, table: NodeTable, nodes: NodeState, work: NodeScratch) -> int:
    # pragma: no cover - compiled
    """Rows of the points that slide finitely, of supports at x (p,) and a structure at u (size,), into the table. After
    the step NEW_ROWS if a foot has come to another segment, OFF_LINE if one is beyond an end, else 0."""
    curves, code = table.curves, 0
    for k in range(curves.node.shape[0]):
        i = curves.node[k]
        on_line = _find_foot(k, x, u, table, nodes, work)
        if not on_line:
            code = OFF_LINE
        elif code == 0 and leaves(nodes.segment[i], nodes.xi[i], curves.chords_at[k + 1] - curves.chords_at[k]):
            code = NEW_ROWS
        _mix(table.ptr[i], table.ptr[i + 1], table.col, curves.base[k], work, table.row)
        _mix(table.push_ptr[i], table.push_ptr[i + 1], table.push_col, curves.base_push[k], work, table.push)
        table.gap[i] = 0.0
        for p in range(x.shape[0]):
            table.lift[i, 0, p] = table.lift[i, 1, p] = 0.0
        block = table.block[i]
        block[0, 0] = block[0, 1] = block[1, 1] = 0.0
        for r in range(ROWS):
            n, t = work.normal[r], work.tangent[r]
            table.gap[i] += n * curves.reference[k, r]
            for p in range(x.shape[0]):
                table.lift[i, 0, p] += n * curves.lift[k, r, p]
                table.lift[i, 1, p] += t * curves.lift[k, r, p]
            for o in range(ROWS):
                w = curves.block[k, r, o]
                block[0, 0] += n * w * work.normal[o]
                block[0, 1] += n * w * work.tangent[o]
                block[1, 1] += t * w * work.tangent[o]
            if table.act.shape[0]:
                table.act[table.act_at[i] + r, 0], table.act[table.act_at[i] + r, 1] = n, t
        block[1, 0] = block[0, 1]
    return code


@njit(cache=True, allocates=False)
def _turned(base: Array, turn: Array, out: Array) -> None:  # pragma: no cover - compiled
    """P base (d,): normal and tangents of one entry out of its rows as they were found, base (w,), by P (d, w)."""
    for j in range(turn.shape[0]):
        total = 0.0
        for o in range(base.shape[0]):
            total += turn[j, o] * base[o]
        out[j] = total


@njit(cache=True, allocates=False)
def _turn(angle: Array, way: Array, turn: Array) -> None:  # pragma: no cover - compiled
    """P (d, w) = R, and where w > d beside it that of the normal's row along the way (d − 1,) on the master, R e₁ sᵀ.
    R = [c, θᵀ; −θ, 1 − θθᵀ/(1 + c)] (d, d), c² = 1 − θ²: the rotation of normal and tangents after which the normal
    has the part θ (d − 1,) of the tangents."""
    t, square = angle.shape[0], 0.0
    for j in range(t):
        square += angle[j] * angle[j]
    turn[0, 0] = math.sqrt(max(1.0 - square, 0.0))
    for j in range(t):
        turn[0, j + 1], turn[j + 1, 0] = angle[j], -angle[j]
        for o in range(t):
            turn[j + 1, o + 1] = (1.0 if j == o else 0.0) - angle[j] * angle[o] / (1.0 + turn[0, 0])
    for j in range(t + 1):
        for o in range(t + 1, turn.shape[1]):
            turn[j, o] = turn[j, 0] * way[o - t - 1]


@njit(cache=True, allocates=False)
def _away(k: int, x: Array, u: Array, table: NodeTable, work: NodeScratch) -> tuple[float, float]:
    # pragma: no cover - compiled
    """What the rows that were found see of supports at x (p,) and a structure at u (size,) into work.away, what normal
    and tangents there have of them into work.turn; s·(α + θ) [m], and √(1 − α²)."""
    bends, angle, away, way = table.bends, work.angle, work.away, work.way
    i, t = bends.node[k], angle.shape[0]
    for j in range(away.shape[0]):
        away[j] = 0.0
        for e in range(table.ptr[i], table.ptr[i + 1]):
            away[j] += bends.row[e, j] * u[table.indices[table.col[e]]]
        for p in range(x.shape[0]):
            away[j] += bends.lift[i, j, p] * x[p]
    for j in range(t):
        way[j] = away[j + 1] - bends.place[k, j]
    bend = size = square = 0.0
    for j in range(t):
        tilt = away[t + 1 + j] - bends.tilted[k, j] if away.shape[0] > t + 1 else 0.0
        angle[j] = tilt
        for o in range(t):
            angle[j] += bends.rate[k, j, o] * way[o]
        bend += (tilt + angle[j]) * way[j]
        size += angle[j] * angle[j]
        square += tilt * tilt
    if size > FARTHEST * FARTHEST:
        for j in range(t):
            angle[j] *= FARTHEST / math.sqrt(size)
    _turn(angle, way, work.turn)
    return bend, math.sqrt(max(1.0 - square, 1.0 - FARTHEST * FARTHEST))


@njit(cache=True, allocates=False)
def mark_bends(x: Array, u: Array, table: NodeTable, work: NodeScratch) -> None:  # pragma: no cover - compiled
    """Keep the rotations of the nodes whose normals turn at the beginning of a step."""
    bends = table.bends
    for k in range(bends.node.shape[0]):
        _away(k, x, u, table, work)
        for j in range(work.turn.shape[0]):
            for o in range(work.turn.shape[1]):
                bends.turn[k, j, o] = work.turn[j, o]


@njit(cache=True, allocates=False)
def follow_bends(x: Array, u: Array, table: NodeTable, work: NodeScratch) -> None:  # pragma: no cover - compiled
    """Rows and gaps of the nodes whose normals turn at the end of a step, of supports at x (p,) and a structure at u
    (size,), into the table, and what forces along the normals at its beginning push."""
    bends, turn, away = table.bends, work.turn, work.away
    d, w = turn.shape
    for k in range(bends.node.shape[0]):
        i, before = bends.node[k], bends.turn[k]
        bend, tilted = _away(k, x, u, table, work)
        # The turned row sees the whole displacement: what it had before the rows were found is taken out again.
        table.gap[i] = bent_gap(turn[0, 0], tilted, bend, bends.gap[i] + away[0])
        for j in range(w):
            table.gap[i] -= turn[0, j] * away[j]
        _turn_rows(i, turn, table)
        for e in range(table.push_ptr[i], table.push_ptr[i + 1]):
            _turned(bends.push[e], before, table.push[e])
        _turn_block(bends.block[i], turn, before, table.block[i])
        if table.act.shape[0]:
            for j in range(d):
                for o in range(table.act_at[i + 1] - table.act_at[i]):
                    table.act[table.act_at[i] + o, j] = before[j, o]


@njit(cache=True, allocates=False)
def rows_of_forces(table: NodeTable) -> None:  # pragma: no cover - compiled
    """Rows of the nodes whose normals turn as they were at the beginning of the step: those that the forces act along,
    by which powers are told."""
    for k in range(table.bends.node.shape[0]):
        _turn_rows(table.bends.node[k], table.bends.turn[k], table)


@njit(cache=True, allocates=False)
def _turn_rows(i: int, turn: Array, table: NodeTable) -> None:  # pragma: no cover - compiled
    """Rows and lifts of node i, turned, into the table."""
    bends = table.bends
    for e in range(table.ptr[i], table.ptr[i + 1]):
        _turned(bends.row[e], turn, table.row[e])
    for p in range(table.lift.shape[2]):
        for j in range(turn.shape[0]):
            table.lift[i, j, p] = 0.0
            for o in range(turn.shape[1]):
                table.lift[i, j, p] += turn[j, o] * bends.lift[i, o, p]
            if j > 0:  # material slides along the surface as that lies now
                table.lift[i, j, p] += bends.drift[i, j - 1, p]


@njit(cache=True, allocates=False)
def _turn_block(base: Array, turn: Array, before: Array, out: Array) -> None:  # pragma: no cover - compiled
    """P B Qᵀ (d, d): what forces along normal and tangents turned by Q (d, w) bring about along those turned by P."""
    d, w = turn.shape
    for j in range(d):
        for o in range(d):
            total = 0.0
            for a in range(w):
                for b in range(w):
                    total += turn[j, a] * base[a, b] * before[o, b]
            out[j, o] = total

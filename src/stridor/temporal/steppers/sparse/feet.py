"""Points that slide finitely in the compiled loop: their rows, gaps and compliances as the curves are in each step."""

from __future__ import annotations

from ....kernels import njit
from ....typing import Array, IntArray
from ..curve import ROWS, leaves, project_in, turn
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

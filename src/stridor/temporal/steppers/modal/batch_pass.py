"""One step of all modes of a block of members, compiled: what ``modal_path`` does, with members in the lanes.

A mode has two rows, u and the free increment d. With β2 = 1/2 no more is needed, as q = d/Δt of the step before; q is
kept for larger β2, and in the step before a record. The coefficients lie in one stream in the order in which they are
read, mode after mode: forward·gain, −restore, forward·memory, then drive·row and row of the contact rows of the block.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from ....kernels import njit
from ....typing import Array, IntArray
from .vectors import address, load, number, plus, plus_times, store, times, zero

HEAD = 3  # numbers of a mode before those of its contact rows
ROWS = 3  # contact rows that one pass takes


class BatchModal(NamedTuple):
    """What all members share: n modes in b blocks, f contact rows, a rows of loads and supports, w watched rows.

    blocks (b + 1,) ranges of modes, an even number each. rows: for each block the contact rows that it has, with
    offsets rows_at (b + 1,); one row, or a multiple of ``ROWS`` filled up with row f, which is zero. stream (k,): see
    above, of the last rows of each block; stream_at (b,). driven, plain (f + 1, n): drive·row and row of contact rows;
    acts (b,): whether loads or supports act on a block, auxiliary (a, n) drive·row of theirs; watch (w, n).
    """

    blocks: IntArray
    rows: IntArray
    rows_at: IntArray
    stream: Array
    stream_at: IntArray
    driven: Array
    plain: Array
    acts: IntArray
    auxiliary: Array
    watch: Array
    gain: float
    memory: float


class BatchFields(NamedTuple):
    """ud (2n, L); q (n, L), kept where it is needed; constant (n, L): the part of d that loads and supports make;
    push, pull (f + 1, L): contact forces, and rows of the prediction; coefficients (a, L) of loads and supports."""

    ud: Array
    q: Array
    constant: Array
    push: Array
    pull: Array
    coefficients: Array


@njit(cache=True, allocates=False, inline="always")
def _mode(
    ud: int, q: int, constant: int, stream: int, i: int, at: int, d: Any, keep: bool, acts: bool,
    memory: float, gain: float,
) -> Any:  # fmt: skip # pragma: no cover - compiled
    """Complete mode i to t_{n+1} with the increment d and predict it: u + d of the next step."""
    u = plus(load(ud, 2 * i), d)
    new = plus_times(times(number(stream, at + 1), u), number(stream, at), d)
    if keep:
        before = load(q, i)
        new = plus_times(new, number(stream, at + 2), before)
        store(q, i, plus_times(times(memory, before), gain, d))
    if acts:
        new = plus(new, load(constant, i))
    store(ud, 2 * i, u)
    store(ud, 2 * i + 1, new)
    return plus(u, new)


@njit(cache=True, allocates=False, inline="always")
def _one_row(m: BatchModal, f: BatchFields, b: int, keep: bool, acts: bool) -> None:  # pragma: no cover - compiled
    """A block with one contact row; two sums, so that neither waits for the other."""
    ud, q, constant, stream = address(f.ud), address(f.q), address(f.constant), address(m.stream)
    push, pull, memory, gain = address(f.push), address(f.pull), m.memory, m.gain
    row, at = m.rows[m.rows_at[b]], m.stream_at[b]
    p0 = load(push, row)
    y0, y1 = zero(), zero()
    for i in range(m.blocks[b], m.blocks[b + 1], 2):
        d = plus_times(load(ud, 2 * i + 1), number(stream, at + 3), p0)
        new = _mode(ud, q, constant, stream, i, at, d, keep, acts, memory, gain)
        y0 = plus_times(y0, number(stream, at + 4), new)
        at += HEAD + 2
        d = plus_times(load(ud, 2 * i + 3), number(stream, at + 3), p0)
        new = _mode(ud, q, constant, stream, i + 1, at, d, keep, acts, memory, gain)
        y1 = plus_times(y1, number(stream, at + 4), new)
        at += HEAD + 2
    store(pull, row, plus(load(pull, row), plus(y0, y1)))


@njit(cache=True, allocates=False, inline="always")
def _three_rows(m: BatchModal, f: BatchFields, b: int, keep: bool, acts: bool) -> None:  # pragma: no cover - compiled
    """A block with more, by the last three of them."""
    ud, q, constant, stream = address(f.ud), address(f.q), address(f.constant), address(m.stream)
    push, pull, memory, gain = address(f.push), address(f.pull), m.memory, m.gain
    last, at = m.rows_at[b + 1], m.stream_at[b]
    r0, r1, r2 = m.rows[last - 3], m.rows[last - 2], m.rows[last - 1]
    p0, p1, p2 = load(push, r0), load(push, r1), load(push, r2)
    y0, y1, y2 = zero(), zero(), zero()
    for i in range(m.blocks[b], m.blocks[b + 1]):
        d = plus_times(load(ud, 2 * i + 1), number(stream, at + 3), p0)
        d = plus_times(d, number(stream, at + 5), p1)
        d = plus_times(d, number(stream, at + 7), p2)
        new = _mode(ud, q, constant, stream, i, at, d, keep, acts, memory, gain)
        y0 = plus_times(y0, number(stream, at + 4), new)
        y1 = plus_times(y1, number(stream, at + 6), new)
        y2 = plus_times(y2, number(stream, at + 8), new)
        at += HEAD + 2 * ROWS
    store(pull, r0, plus(load(pull, r0), y0))
    store(pull, r1, plus(load(pull, r1), y1))
    store(pull, r2, plus(load(pull, r2), y2))


@njit(cache=True, allocates=False)
def _push_others(m: BatchModal, f: BatchFields, b: int) -> None:  # pragma: no cover - compiled
    """d += drive Σ p·row over the contact rows of a block before its last three."""
    ud, push, driven, count = address(f.ud), address(f.push), address(m.driven), m.driven.shape[1]
    for k in range(m.rows_at[b], m.rows_at[b + 1] - ROWS):
        row = m.rows[k]
        p = load(push, row)
        for i in range(m.blocks[b], m.blocks[b + 1]):
            store(ud, 2 * i + 1, plus_times(load(ud, 2 * i + 1), number(driven, row * count + i), p))


@njit(cache=True, allocates=False)
def _pull_others(m: BatchModal, f: BatchFields, b: int) -> None:  # pragma: no cover - compiled
    """Σ row·(u + d) over the same rows."""
    ud, pull, plain, count = address(f.ud), address(f.pull), address(m.plain), m.plain.shape[1]
    for k in range(m.rows_at[b], m.rows_at[b + 1] - ROWS):
        row = m.rows[k]
        y = load(pull, row)
        for i in range(m.blocks[b], m.blocks[b + 1]):
            y = plus_times(y, number(plain, row * count + i), plus(load(ud, 2 * i), load(ud, 2 * i + 1)))
        store(pull, row, y)


@njit(cache=True, allocates=False, inline="always")
def _block(m: BatchModal, f: BatchFields, b: int, keep: bool, acts: bool) -> None:  # pragma: no cover - compiled
    if m.rows_at[b + 1] - m.rows_at[b] == 1:
        _one_row(m, f, b, keep, acts)
    else:
        _push_others(m, f, b)
        _three_rows(m, f, b, keep, acts)
        _pull_others(m, f, b)


@njit(cache=True, allocates=False)
def batch_pass(m: BatchModal, f: BatchFields, keep: bool) -> None:  # pragma: no cover - compiled
    """Add contact forces (push), complete t_{n+1}, predict t_{n+2} and its contact rows (pull)."""
    f.pull[:] = 0.0
    for b in range(m.blocks.shape[0] - 1):
        acts = m.acts[b] > 0
        # Each case with loops of its own, in which nothing is asked.
        if keep and acts:
            _block(m, f, b, True, True)
        elif keep:
            _block(m, f, b, True, False)
        elif acts:
            _block(m, f, b, False, True)
        else:
            _block(m, f, b, False, False)


@njit(cache=True, allocates=False)
def batch_constant(m: BatchModal, f: BatchFields) -> None:  # pragma: no cover - compiled
    """The part of d that loads and supports make."""
    constant, coefficients, auxiliary = address(f.constant), address(f.coefficients), address(m.auxiliary)
    count, rows = m.driven.shape[1], m.auxiliary.shape[0]
    for i in range(count):
        total = zero()
        for j in range(rows):
            total = plus_times(total, number(auxiliary, j * count + i), load(coefficients, j))
        store(constant, i, total)


@njit(cache=True, allocates=False)
def batch_watch(m: BatchModal, f: BatchFields, out: Array) -> None:  # pragma: no cover - compiled
    """Watched rows of u, of q and of d with the contact forces in it: out (3w, L)."""
    ud, q, push, sums = address(f.ud), address(f.q), address(f.push), address(out)
    watch, driven = address(m.watch), address(m.driven)
    count, rows = m.driven.shape[1], m.driven.shape[0] - 1
    for w in range(m.watch.shape[0]):
        su, sq, sd = zero(), zero(), zero()
        for i in range(count):
            r = number(watch, w * count + i)
            d = load(ud, 2 * i + 1)
            for k in range(rows):
                d = plus_times(d, number(driven, k * count + i), load(push, k))
            su = plus_times(su, r, load(ud, 2 * i))
            sq = plus_times(sq, r, load(q, i))
            sd = plus_times(sd, r, d)
        store(sums, 3 * w, su)
        store(sums, 3 * w + 1, sq)
        store(sums, 3 * w + 2, sd)

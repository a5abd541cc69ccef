"""What compiled code goes by: matrices of each status in one array of numbers, each found by where it begins.

A status is a leg with its modes once it has been entered, and an option with the forces that it would have, without
modes, once it has been thought of.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ....kernels import njit
from ....typing import Array, ComplexArray, IntArray
from .forms import Forms, planes_of
from .search import Numbers, Parts, planes
from .statuses import Driven, Flow, Row

# Of a leg: rows are on [q; v; p], [Re ζ; Im ζ] (2f,) or on what is slow (S,).
(
    ENTER, REST, SLOW, POLES, REAL, IMAG, RATE_REAL, RATE_IMAG, SIZES, NUMBER_SLOW, MEANINGS, TURN_REAL, TURN_IMAG,
    BENT, TURNED, STATE, STATE_SLOW, AMOUNTS, AMOUNTS_SLOW, OBSERVED, OBSERVED_SLOW, OBSERVED_SIZES, OBSERVED_RATE,
    WHICH, QUADRATIC, CROSS_REAL, CROSS_IMAG, FORM_SLOW, STILL, RECORD_TURN, LONGEST, NUMBER_AMOUNTS,
    TURNS, TOLD,
) = range(34)  # fmt: skip
LEG = 34
# Of an option, rows on [q; v; p]: forces (2m, ·) normal and tangential by turns, the rates of slips and of openings,
# gaps and openings (m, ·); and the ways of slip that is held (m, ·).
FORCES, SLIP_RATE, OPENING_RATE, GAPS, OPENINGS, WAYS = range(6)
OPTION = 6
UNKNOWN, JAMMED = -1, -2  # of an option or a leg


@njit(cache=True)
def matrix(store: Array, where: IntArray, item: int) -> Array:  # pragma: no cover - compiled
    """One matrix (r, c), where (items, 3): its beginning, rows and columns."""
    begin, rows, columns = where[item, 0], where[item, 1], where[item, 2]
    return store[begin : begin + rows * columns].reshape(rows, columns)


class Store:
    """Matrices of statuses in one array that grows."""

    def __init__(self) -> None:
        self.numbers = np.zeros(1024)
        self.used = 0

    def add(self, parts: Sequence[Array]) -> IntArray:
        """Keep matrices; where they are (items, 3)."""
        where = np.zeros((len(parts), 3), dtype=np.int64)
        needed = self.used + sum(part.size for part in parts)
        if needed > len(self.numbers):
            grown = np.zeros(max(needed, 2 * len(self.numbers)))
            grown[: self.used] = self.numbers[: self.used]
            self.numbers = grown
        for item, part in enumerate(parts):
            table = np.atleast_2d(part)
            where[item] = self.used, *table.shape
            self.numbers[self.used : self.used + table.size] = table.ravel()
            self.used += table.size
        return where


def leg_parts(
    flow: Flow, numbers: Numbers, number_slow: Array, number_amounts: Array, meanings: Array, table: Parts,
    forms: Forms, observed: ComplexArray, slow: Array, between: float, turns: Array,
) -> list[Array]:  # fmt: skip
    """The matrices of a leg in order; observed (o, f), slow (o, S): what is recorded; between [s]: two records;
    turns (·, 2): when slip that is held comes to its end, and the number of its meaning."""
    split, z = flow.split, flow.z
    y = z.shape[1]
    left_q = split.left[:, :y] @ (flow.scale[:, None] * z.T)
    left_v = split.left[:, y:] @ z.T
    enter: ComplexArray = np.hstack([left_q, left_v, -(left_q @ flow.lifted) - left_v @ flow.lifted_rate - flow.follow])
    rest_q = split.rest[:, :y] @ (flow.scale[:, None] * z.T)
    rest_v = split.rest[:, y:] @ z.T
    rest = np.hstack([rest_q, rest_v, -(rest_q @ flow.lifted) - rest_v @ flow.lifted_rate])
    state = np.vstack([flow.modes_q, flow.modes_v])
    with np.errstate(over="ignore", invalid="ignore"):  # of records so far apart that a leg has none
        turn: ComplexArray = np.exp(split.poles * between)
    found = {
        ENTER: np.vstack([enter.real, enter.imag]), REST: rest, SLOW: flow.slow,
        POLES: np.vstack([planes(split.poles), planes(1.0 / split.poles)]),
        REAL: numbers.real, IMAG: numbers.imag, RATE_REAL: numbers.rate_real, RATE_IMAG: numbers.rate_imag,
        SIZES: numbers.sizes, NUMBER_SLOW: number_slow, MEANINGS: meanings,
        TURN_REAL: table.real, TURN_IMAG: table.imag, BENT: table.bent, TURNED: table.turned,
        STATE: planes_of(state), STATE_SLOW: np.vstack([flow.rest_q, flow.rest_v]),
        AMOUNTS: np.abs(state), AMOUNTS_SLOW: np.abs(np.vstack([flow.rest_q, flow.rest_v])),
        OBSERVED: planes_of(observed), OBSERVED_SLOW: slow, OBSERVED_SIZES: np.abs(observed),
        OBSERVED_RATE: planes_of(observed * split.poles),
        WHICH: forms.which[None], QUADRATIC: forms.quadratic,
        CROSS_REAL: forms.cross_real, CROSS_IMAG: forms.cross_imag, FORM_SLOW: forms.slow, STILL: forms.still,
        RECORD_TURN: np.stack([turn.real, turn.imag]),
        LONGEST: np.array([[table.longest]]), NUMBER_AMOUNTS: number_amounts,
        TURNS: turns, TOLD: np.array(flow.told, dtype=float),
    }  # fmt: skip
    return [found[item] for item in range(LEG)]


def option_parts(driven: Driven) -> list[Array]:
    """The matrices of an option in order."""
    k, total = driven.regime.basis.size, len(driven.rate)
    contacts = range(driven.regime.pairs.count)

    def stacked(rows: Sequence[Row]) -> Array:
        lines = [np.concatenate([row.q, row.v, row.p]) for row in rows]
        return np.array(lines).reshape(len(rows), 2 * k + total)

    return [
        stacked([row for both in driven.forces for row in both]),
        stacked([driven.rate_of(driven.slip(c)) for c in contacts]),
        stacked([driven.rate_of(driven.opening(c)) for c in contacts]),
        stacked([driven.gap(c) for c in contacts]),
        stacked([driven.opening(c) for c in contacts]),
        driven.ways,
    ]

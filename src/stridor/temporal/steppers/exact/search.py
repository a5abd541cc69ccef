"""The first time at which a sum of exponentials and a polynomial ceases to be positive, compiled.

y(t) = Re Σ a_k ζ_k exp(λ_k t) + Σ c_j tʲ. On a part of length h it is above the cubic through its values and slopes at
both ends less h⁴/384 max |y⁗|, added up over its terms; the cubic is above the least of its four Bernstein numbers.
Parts are halved until that bound is positive, or until one number falls all the way through zero; so no zero is skipped
among the terms that are kept. A number that begins at zero, as the gap of a contact that has just opened, is let go as
far as `LET_GO` below it until it has risen as far above.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ....kernels import njit
from ....typing import Array, ComplexArray
from ...arithmetic import CAREFUL

NONE, CROSSED, UNDECIDED = range(3)
MOST_UNSURE = 200  # parts of the finest in one search
LET_GO = 1e-12  # of the size of its terms
SHORTEST = 1e-7  # rad of the fastest mode on the finest parts: on finer ones rounding holds the modes still


class Parts(NamedTuple):
    """Of parts h = longest/2ʲ, j = 0 … L − 1: factors exp(λ h) (L, f), how far off its cubic a mode of size one can be
    (bent), and off the line between its ends its rate (turned)."""

    longest: float
    factors: ComplexArray
    bent: Array
    turned: Array


class Numbers(NamedTuple):
    """Terms of several numbers: weights (m, f) of the modes, their sizes, polynomials (m, J)."""

    weights: ComplexArray
    sizes: Array
    rows: Array


def parts_of(poles: ComplexArray, longest: float) -> Parts:
    """Tables of parts for modes λ (f,)."""
    fastest = float(np.abs(poles).max(initial=0.0))
    levels = 1 + max(math.ceil(math.log2(longest * fastest / SHORTEST)), 0) if fastest else 24
    lengths = longest * 0.5 ** np.arange(levels)
    moved = poles[None] * lengths[:, None]
    size, grown = np.abs(moved), np.exp(np.maximum(moved.real, 0.0))
    # A mode that turns many times on a part is bounded by itself and by its cubic.
    bent = np.minimum(size**4 / 384, 2.0 + 8.0 / 27.0 * size) * grown
    turned = np.minimum(size**2 / 8, 2.0) * grown * np.abs(poles)
    return Parts(longest, np.exp(moved), bent, turned)


@njit(cache=True)
def polynomial(row: Array, t: float) -> tuple[float, float]:  # pragma: no cover - compiled
    """Value and slope."""
    total = slope = 0.0
    for j in range(row.shape[0] - 1, -1, -1):
        slope = slope * t + total
        total = total * t + row[j]
    return total, slope


@njit(cache=True)
def _derivative(row: Array, end: float, order: int) -> float:  # pragma: no cover - compiled
    """Most that a derivative of a polynomial can be up to ``end``."""
    total = 0.0
    for j in range(row.shape[0] - 1, order - 1, -1):
        factor = 1.0
        for i in range(order):
            factor *= j - i
        total = total * end + factor * abs(row[j])
    return total


@njit(cache=True, fastmath=CAREFUL)
def _sums(weights: ComplexArray, zeta: ComplexArray, poles: ComplexArray) -> tuple[float, float]:
    # pragma: no cover - compiled
    """Value and rate of the modes."""
    total = rate = 0.0
    for k in range(zeta.shape[0]):
        real = weights[k].real * zeta[k].real - weights[k].imag * zeta[k].imag
        imag = weights[k].real * zeta[k].imag + weights[k].imag * zeta[k].real
        total += real
        rate += real * poles[k].real - imag * poles[k].imag
    return total, rate


@njit(cache=True, fastmath=CAREFUL)
def _most(sizes: Array, zeta: ComplexArray, bounds: Array) -> float:  # pragma: no cover - compiled
    total = 0.0
    for k in range(zeta.shape[0]):
        total += sizes[k] * bounds[k] * (abs(zeta[k].real) + abs(zeta[k].imag))
    return total


@njit(cache=True)
def _root(
    weights: ComplexArray, row: Array, poles: ComplexArray, zeta: ComplexArray, time: float, length: float, let: float
) -> float:  # pragma: no cover - compiled
    """Where a number falls through −let behind ``time``, at which the modes are ζ: Newton's method, kept between."""
    low, high = 0.0, length
    t = 0.5 * length
    for _ in range(200):
        y, rate = polynomial(row, time + t)
        y += let
        for k in range(zeta.shape[0]):
            term = weights[k] * zeta[k] * np.exp(poles[k] * t)
            y += term.real
            rate += (term * poles[k]).real
        if y > 0.0:
            low = t
        else:
            high = t
        following = t - y / rate if rate != 0.0 else low
        if abs(following - t) <= 4e-16 * abs(following):
            break
        if not low < following < high:
            following = 0.5 * (low + high)
        t = following
    return min(max(t, low), high)


@njit(cache=True)
def first_root(
    numbers: Numbers, poles: ComplexArray, start: ComplexArray, table: Parts, limit: float, level: int
) -> tuple[int, int, float, int, int, int]:  # pragma: no cover - compiled
    """The first of several numbers y_i (m,) to reach zero before ``limit`` [s]; the last part may end behind it.

    start ζ (f,): the modes at t = 0; level: that of the first part. Returns what ended it, which number, when, the
    level of the last part, how many parts there were, and how many of the finest could not be decided.
    """
    m, f = numbers.weights.shape
    zeta, following = start.copy(), np.empty(f, dtype=np.complex128)
    now, rate, then, later = np.empty(m), np.empty(m), np.empty(m), np.empty(m)
    let = np.zeros(m)
    for i in range(m):
        y, slope = polynomial(numbers.rows[i], 0.0)
        total, turning = _sums(numbers.weights[i], zeta, poles)
        now[i], rate[i] = y + total, slope + turning
        size = LET_GO * abs(numbers.rows[i, 0])
        for k in range(f):
            size += LET_GO * numbers.sizes[i, k] * abs(zeta[k])
        if now[i] < size:
            let[i] = size - min(now[i], 0.0)
    time, parts, unsure = 0.0, 0, 0
    lowest = table.factors.shape[0] - 1
    level = min(level, lowest)  # that of another status, whose table may be longer
    while time < limit:
        length = table.longest * 0.5**level
        parts += 1
        for k in range(f):
            following[k] = zeta[k] * table.factors[level, k]
        doubtful, below, which = 0, 0, -1
        for i in range(m):
            y, slope = polynomial(numbers.rows[i], time + length)
            total, turning = _sums(numbers.weights[i], following, poles)
            y, slope = y + total, slope + turning
            then[i], later[i] = y, slope
            if y + let[i] <= 0.0:
                below += 1
                if which < 0 or y < then[which]:
                    which = i
                continue
            third = length / 3.0
            least = min(min(now[i], now[i] + third * rate[i]), min(y, y - third * slope)) + let[i]
            if least > 0.0:
                least -= _derivative(numbers.rows[i], time + length, 4) * length**4 / 384
                least -= _most(numbers.sizes[i], zeta, table.bent[level])
            if least <= 0.0:
                doubtful += 1
        if below == 1 and doubtful == 0 and now[which] + let[which] > 0.0:
            bend = _derivative(numbers.rows[which], time + length, 3) * length * length / 8
            bend += _most(numbers.sizes[which], zeta, table.turned[level])
            if max(rate[which], later[which]) + bend < 0.0:
                t = _root(numbers.weights[which], numbers.rows[which], poles, zeta, time, length, let[which])
                if time + t > limit:
                    break
                return CROSSED, which, time + t, level, parts, unsure
        if below + doubtful and level < lowest:
            level += 1
            continue
        if below:
            first = length
            for i in range(m):
                if then[i] + let[i] <= 0.0 < now[i] + let[i]:
                    t = _root(numbers.weights[i], numbers.rows[i], poles, zeta, time, length, let[i])
                    if t < first:
                        which, first = i, t
            if time + first > limit:
                break
            return CROSSED, which, time + first, level, parts, unsure
        unsure += doubtful
        if unsure > MOST_UNSURE:
            return UNDECIDED, -1, time, level, parts, unsure
        time += length
        for k in range(f):
            zeta[k] = following[k]
        for i in range(m):
            now[i], rate[i] = then[i], later[i]
            if now[i] > let[i]:
                let[i] = 0.0
        if doubtful == 0 and level > 0:
            level -= 1
    return NONE, -1, limit, level, parts, unsure

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

from ....kernels import njit, put
from ....typing import Array, ComplexArray
from ...arithmetic import FAST

NONE, CROSSED, UNDECIDED = range(3)
MOST_UNSURE = 200  # parts of the finest in one search
GROWTH = 16.0  # of the bound, where a part is twice as long
LET_GO = 2.0**-46  # of the size of its terms, by which rounding is judged
EPS = 2.0**-52
SHARES = tuple(1.0 / n for n in range(9, 0, -1))  # of a power series from term to term
MOST_GROWN = 0.5 * math.log(np.finfo(float).max)  # on a part: what has grown so far can be multiplied with another
SHORTEST = 1e-7  # rad of the fastest mode on the finest parts: on finer ones rounding holds the modes still


class Parts(NamedTuple):
    """Of parts h = longest/2ʲ, j = 0 … L − 1: factors exp(λ h) (L, f), real and imaginary, how far off its cubic a mode
    of size one can be (bent), and off the line between its ends its rate (turned)."""

    longest: float
    real: Array
    imag: Array
    bent: Array
    turned: Array


class Numbers(NamedTuple):
    """Terms of several numbers: real and imaginary weights (m, f) of the modes, those of their rates, their sizes,
    polynomials (m, J), and what the terms of their first coefficients amount to (m,), by which rounding is judged:
    these may be differences of much larger ones."""

    real: Array
    imag: Array
    rate_real: Array
    rate_imag: Array
    sizes: Array
    rows: Array
    amounts: Array


def planes(values: ComplexArray) -> Array:
    """Real and imaginary parts (2, f)."""
    return np.stack([values.real, values.imag])


def numbers_of(weights: ComplexArray, poles: ComplexArray, rows: Array) -> Numbers:
    """Numbers with weights (m, f) of modes λ (f,) and polynomials (m, J)."""
    turning = weights * poles
    return Numbers(
        weights.real.copy(), weights.imag.copy(), turning.real.copy(), turning.imag.copy(), np.abs(weights), rows,
        np.abs(rows[:, :1]).sum(axis=1),
    )  # fmt: skip


def parts_of(poles: ComplexArray, longest: float) -> Parts:
    """Tables of parts for modes λ (f,), the longest halved until no mode leaves all numbers on it."""
    fastest = float(np.abs(poles).max(initial=0.0))
    growth = float(poles.real.max(initial=0.0))
    while longest * growth > MOST_GROWN:
        longest *= 0.5
    levels = 1 + max(math.ceil(math.log2(longest * fastest / SHORTEST)), 0) if fastest else 24
    lengths = longest * 0.5 ** np.arange(levels)
    moved = poles[None] * lengths[:, None]
    size, grown = np.abs(moved), np.exp(np.maximum(moved.real, 0.0))
    # A mode that turns many times on a part is bounded by itself and by its cubic.
    bent = np.minimum(size**4 / 384, 2.0 + 8.0 / 27.0 * size) * grown
    turned = np.minimum(size**2 / 8, 2.0) * grown * np.abs(poles)
    grown, angle = np.exp(moved.real), moved.imag
    return Parts(longest, grown * np.cos(angle), grown * np.sin(angle), bent, turned)


# Rows are told by their numbers, and tuples are taken apart first: arrays that are made or taken from one are counted,
# which takes longer than short sums.


@njit(cache=True)
def polynomial(rows: Array, i: int, t: float) -> tuple[float, float]:  # pragma: no cover - compiled
    """Value and slope."""
    total = slope = 0.0
    for j in range(rows.shape[1] - 1, -1, -1):
        slope = slope * t + total
        total = total * t + rows[i, j]
    return total, slope


@njit(cache=True)
def derivative_bound(rows: Array, i: int, end: float, order: int) -> float:  # pragma: no cover - compiled
    """Most that a derivative of a polynomial can be up to ``end``."""
    total = 0.0
    for j in range(rows.shape[1] - 1, order - 1, -1):
        factor = 1.0
        for n in range(order):
            factor *= j - n
        total = total * end + factor * abs(rows[i, j])
    return total


@njit(cache=True, fastmath=FAST)
def number_at(
    real: Array, imag: Array, rate_real: Array, rate_imag: Array, i: int, modes: Array
) -> tuple[float, float]:  # pragma: no cover - compiled
    """What modes [Re; Im] (2f,) have of a number and of its rate."""
    f, total, rate = real.shape[1], 0.0, 0.0
    for k in range(f):
        total += real[i, k] * modes[k] - imag[i, k] * modes[f + k]
        rate += rate_real[i, k] * modes[k] - rate_imag[i, k] * modes[f + k]
    return total, rate


@njit(cache=True, fastmath=FAST)
def most(sizes: Array, i: int, bounds: Array, level: int, amounts: Array) -> float:  # pragma: no cover - compiled
    """Most that modes of some amounts (f,) can be off on a part."""
    total = 0.0
    for k in range(amounts.shape[0]):
        total += sizes[i, k] * bounds[level, k] * amounts[k]
    return total


@njit(cache=True)
def turn(modes: Array, real: Array, imag: Array, row: int, found: Array) -> None:  # pragma: no cover - compiled
    """Modes [Re; Im] (2f,) times a row of factors (·, f)."""
    f = real.shape[1]
    for k in range(f):
        one, two = modes[k], modes[f + k]
        found[k] = one * real[row, k] - two * imag[row, k]
        found[f + k] = one * imag[row, k] + two * real[row, k]


@njit(cache=True)
def _guess(length: float, ends: tuple[float, float, float, float]) -> float:  # pragma: no cover - compiled
    """Where the cubic through values and rates at both ends falls through zero."""
    y, rate, then, later = ends
    two = (3.0 * (then - y) / length - 2.0 * rate - later) / length
    three = (rate + later - 2.0 * (then - y) / length) / (length * length)
    low, high = 0.0, length
    t = length * y / (y - then)
    for _ in range(20):
        value = ((three * t + two) * t + rate) * t + y
        if value > 0.0:
            low = t
        else:
            high = t
        slope = (3.0 * three * t + 2.0 * two) * t + rate
        following = t - value / slope if slope != 0.0 else low
        if not low < following < high:
            following = 0.5 * (low + high)
        if abs(following - t) <= 1e-9 * length:
            break
        t = following
    return t


@njit(cache=True, fastmath={"contract"})
def _move(modes: Array, poles: Array, step: float, fastest: float) -> None:  # pragma: no cover - compiled
    """Modes [Re; Im] (2f,) moved on by a time, by nine terms of the exponential where these tell all digits."""
    f = poles.shape[1]
    if abs(step) * fastest > 0.05:
        for k in range(f):
            grown = math.exp(poles[0, k] * step)
            cosine, sine = grown * math.cos(poles[1, k] * step), grown * math.sin(poles[1, k] * step)
            real, imag = modes[k], modes[f + k]
            modes[k], modes[f + k] = real * cosine - imag * sine, real * sine + imag * cosine
        return
    for k in range(f):
        a, b = poles[0, k] * step, poles[1, k] * step
        real, imag = 1.0, 0.0
        for n in range(9):
            share = SHARES[n]
            real, imag = 1.0 + share * (real * a - imag * b), share * (real * b + imag * a)
        one, two = modes[k], modes[f + k]
        modes[k], modes[f + k] = one * real - two * imag, one * imag + two * real


@njit(cache=True)
def _root(
    numbers: Numbers,
    i: int,
    poles: Array,
    start: Array,
    span: tuple[float, float],
    let: float,
    ends: tuple[float, float, float, float],
    modes: Array,
) -> float:  # pragma: no cover - compiled
    """Where a number falls through −let behind the first time of ``span``, at which modes are ``start`` (2f,), before
    its second number [s]: Newton's method, kept between; ends: values and rates there; modes (2f,): those at the
    root."""
    time, length = span
    real, imag, rate_real, rate_imag, sizes, rows, _ = numbers
    low, high = 0.0, length
    t = _guess(length, (ends[0] + let, ends[1], ends[2] + let, ends[3]))
    noise = abs(rows[i, 0])
    f, fastest = poles.shape[1], 0.0
    for k in range(f):
        noise += sizes[i, k] * (abs(start[k]) + abs(start[f + k]))
        fastest = max(fastest, abs(poles[0, k]) + abs(poles[1, k]))
    noise *= EPS
    put(modes, start)
    _move(modes, poles, t, fastest)
    for _ in range(200):
        y, rate = polynomial(rows, i, time + t)
        of_modes, turning = number_at(real, imag, rate_real, rate_imag, i, modes)
        y += let + of_modes
        rate += turning
        if y > 0.0:
            low = t
        else:
            high = t
        following = t - y / rate if rate != 0.0 else low
        # A step that rounding makes leads no further.
        if abs(following - t) <= 4e-16 * abs(following) or abs(y) <= noise:
            break
        if not low < following < high:
            following = 0.5 * (low + high)
        _move(modes, poles, following - t, fastest)
        t = following
    return t


@njit(cache=True)
def first_root(
    numbers: Numbers, poles: Array, start: Array, table: Parts, limit: float, level: int, modes: Array
) -> tuple[int, int, float, int, int, int]:  # pragma: no cover - compiled
    """The first of several numbers y_i (m,) to reach zero before ``limit`` [s]; the last part may end behind it.

    poles λ and start ζ (2, f), real and imaginary parts: the modes at t = 0; level: that of the first part. Returns
    what ended it, which number, when, the level of the last part, how many parts there were, and how many of the finest
    could not be decided; ``modes`` (2f,) are [Re; Im] of those at the root.
    """
    real, imag, rate_real, rate_imag, sizes, rows, summed = numbers
    longest, turn_real, turn_imag, bent, turned = table
    m, f = real.shape
    here, following, amounts = np.empty(2 * f), np.empty(2 * f), np.empty(f)
    now, rate, then, later = np.empty(m), np.empty(m), np.empty(m), np.empty(m)
    let, trial = np.zeros(m), np.empty(2 * f)
    for k in range(f):
        here[k], here[f + k] = start[0, k], start[1, k]
        amounts[k] = abs(here[k]) + abs(here[f + k])
    for i in range(m):
        y, slope = polynomial(rows, i, 0.0)
        of_modes, turning = number_at(real, imag, rate_real, rate_imag, i, here)
        now[i], rate[i] = y + of_modes, slope + turning
        size = LET_GO * summed[i]
        for k in range(f):
            size += LET_GO * sizes[i, k] * math.hypot(here[k], here[f + k])
        if now[i] < size:
            let[i] = size - min(now[i], 0.0)
    time, parts, unsure = 0.0, 0, 0
    lowest = turn_real.shape[0] - 1
    level = min(level, lowest)  # that of another status, whose table may be longer
    while time < limit:
        length = longest * 0.5**level
        parts += 1
        turn(here, turn_real, turn_imag, level, following)
        doubtful, below, which, grows = 0, 0, -1, True
        for i in range(m):
            y, slope = polynomial(rows, i, time + length)
            of_modes, turning = number_at(real, imag, rate_real, rate_imag, i, following)
            y, slope = y + of_modes, slope + turning
            then[i], later[i] = y, slope
            if y + let[i] <= 0.0:
                below += 1
                if which < 0 or y < then[which]:
                    which = i
                continue
            third = length / 3.0
            least = min(min(now[i], now[i] + third * rate[i]), min(y, y - third * slope)) + let[i]
            if least > 0.0:
                off = derivative_bound(rows, i, time + length, 4) * length**4 / 384
                off += most(sizes, i, bent, level, amounts)
                grows = grows and off * GROWTH < least
                least -= off
            if not least > 0.0:  # also where it is no number, of which nothing can be told
                doubtful += 1
        if below == 1 and doubtful == 0 and now[which] + let[which] > 0.0:
            bend = derivative_bound(rows, which, time + length, 3) * length * length / 8
            bend += most(sizes, which, turned, level, amounts)
            if max(rate[which], later[which]) + bend < 0.0:
                ends = (now[which], rate[which], then[which], later[which])
                t = _root(numbers, which, poles, here, (time, length), let[which], ends, modes)
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
                    ends = (now[i], rate[i], then[i], later[i])
                    t = _root(numbers, i, poles, here, (time, length), let[i], ends, trial)
                    if t < first:
                        which, first = i, t
                        put(modes, trial)
            if first == length:  # a number that is zero from the beginning on
                put(modes, following)
            if time + first > limit:
                break
            return CROSSED, which, time + first, level, parts, unsure
        unsure += doubtful
        if unsure > MOST_UNSURE:
            return UNDECIDED, -1, time, level, parts, unsure
        time += length
        for k in range(f):
            here[k], here[f + k] = following[k], following[f + k]
            amounts[k] = abs(here[k]) + abs(here[f + k])
        for i in range(m):
            now[i], rate[i] = then[i], later[i]
            if now[i] > let[i]:
                let[i] = 0.0
        if doubtful == 0 and grows and level > 0:
            level -= 1
    return NONE, -1, limit, level, parts, unsure

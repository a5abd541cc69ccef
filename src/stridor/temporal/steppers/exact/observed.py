"""What is seen of a motion in modes on its way, compiled: records, and the largest forces and slips."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ....kernels import njit, put
from ....typing import Array, IntArray
from ...columns import (
    MAX_NORMAL,
    MAX_SPEED,
    MAX_TANGENTIAL,
    REC_GAP,
    REC_NORMAL,
    REC_SLIP,
    REC_STATUS,
    REC_TANGENTIAL,
    WORKS,
)
from .forms import ELASTIC, FORMS, KINETIC
from .search import GROWTH, derivative_bound, most, polynomial, turn
from .statuses import GAP, STICK
from .sums import forms_at, modes_at, product, row_on, slow_at
from .tables import (
    BENT,
    LONGEST,
    OBSERVED,
    OBSERVED_RATE,
    OBSERVED_SIZES,
    OBSERVED_SLOW,
    POLES,
    RECORD_TURN,
    TURN_IMAG,
    TURN_REAL,
    matrix,
)

CONTACT_ROWS = 4  # normal and tangential force, slip speed, gap
TURNS = 64  # records from one exponential to the next; between them modes are turned on
SURE = 1e-6  # of the largest force or slip: between two times no larger one can be


class Course(NamedTuple):
    """A motion in the modes of one status: ζ (2, f), terms (J, S) of what is slow, polynomials of its forms
    (`followed`), primitives (7,) at its beginning, and when [s] it began."""

    zeta: Array
    terms: Array
    along_real: Array
    along_imag: Array
    alone: Array
    first: Array
    began: float


class Records(NamedTuple):
    """Contacts (r, m, 6), watch (r, w, 3) of u, v, a, energies (r, 7); ways (m,): signs of tangents."""

    contacts: Array
    watch: Array
    energies: Array
    ways: Array


@njit(cache=True)
def record(
    store: Array, where: IntArray, course: Course, status: IntArray, works: Array, between: float,
    span: tuple[int, int], at: int, records: Records, statistics: Array,
) -> None:  # fmt: skip # pragma: no cover - compiled
    """Records of the numbers in ``span``, ``between`` [s] from one to the next, from row ``at`` on; works (5,) [J] at
    the beginning of the course."""
    poles, rows, slow_rows = (
        matrix(store, where, POLES), matrix(store, where, OBSERVED), matrix(store, where, OBSERVED_SLOW)
    )  # fmt: skip
    turning = matrix(store, where, RECORD_TURN)
    zeta, terms, along_real, along_imag, alone, first_forms, began = course
    contacts, watch, energies, ways = records
    f, m = poles.shape[1], status.shape[0]
    modes, following, slow = np.empty(2 * f), np.empty(2 * f), np.empty(terms.shape[1])
    values, own, forms = np.empty(rows.shape[0]), np.empty(rows.shape[0]), np.empty(FORMS)
    watched = watch.shape[1]
    first = max(math.ceil(began / between - 1e-9), span[0] // TURNS * TURNS)
    for number in range(first, span[1]):
        after = max(number * between - began, 0.0)
        if number == first or number % TURNS == 0:
            modes_at(zeta, poles, after, modes)
        else:
            turn(modes, turning[:1], turning[1:], 0, following)
            put(modes, following)
        if number < span[0]:
            continue
        slow_at(terms, after, slow)
        product(rows, modes, values)
        product(slow_rows, slow, own)
        for i in range(values.shape[0]):
            values[i] += own[i]
        row = at + number - span[0]
        for c in range(m):
            force, friction, slip = values[CONTACT_ROWS * c], values[CONTACT_ROWS * c + 1], values[CONTACT_ROWS * c + 2]
            contacts[row, c, REC_NORMAL] = force
            contacts[row, c, REC_TANGENTIAL] = ways[c] * friction
            contacts[row, c, REC_SLIP] = ways[c] * slip
            contacts[row, c, REC_GAP] = values[CONTACT_ROWS * c + 3]
            now = status[c]
            contacts[row, c, REC_STATUS] = 0 if now == GAP else 1 if now == STICK else 2
            seen(statistics[c], now, force, friction, slip)
        for w in range(watched):
            for kind in range(3):
                watch[row, w, kind] = values[CONTACT_ROWS * m + kind * watched + w]
        forms_at(
            store, where, zeta, modes, after, along_real, along_imag, alone, FORMS, forms
        )
        energies[row, 0], energies[row, 1] = forms[KINETIC], forms[ELASTIC]
        for w in range(WORKS):
            energies[row, 2 + w] = works[w] + forms[w] - first_forms[w]


@njit(cache=True)
def seen(statistics: Array, now: int, force: float, friction: float, slip: float) -> None:
    # pragma: no cover - compiled
    """Take a contact's forces and slip into its largest ones."""
    statistics[MAX_NORMAL] = max(statistics[MAX_NORMAL], abs(force))
    statistics[MAX_TANGENTIAL] = max(statistics[MAX_TANGENTIAL], abs(friction))
    if now not in (GAP, STICK):
        statistics[MAX_SPEED] = max(statistics[MAX_SPEED], abs(slip))


@njit(cache=True)
def _raise(statistics: Array, column: int, slips: float, size: float) -> None:  # pragma: no cover - compiled
    statistics[column] = max(statistics[column], size)
    if slips > 0.0:
        statistics[MAX_TANGENTIAL] = max(statistics[MAX_TANGENTIAL], slips * size)


@njit(cache=True)
def extremes(
    store: Array, where: IntArray, course: Course, status: IntArray, span: tuple[float, float], last: Array, level: int,
    sliding: Array, statistics: Array,
) -> int:  # fmt: skip # pragma: no cover - compiled
    """The largest forces and slips in a ``span`` of time, at whose end modes are ``last`` (2f,), to `SURE`: a part is
    halved until none larger can be on it, by the bound of `search`; sliding (m,): friction coefficients. Returns the
    level of the last part."""
    m = status.shape[0]
    rows = np.empty((2 * m, 2), dtype=np.int64)  # observed row, and the statistic that it belongs to
    slips = np.zeros(2 * m)  # friction over the normal force, where it slips
    count = 0
    for c in range(m):
        if status[c] == GAP:
            continue
        rows[count, 0], rows[count, 1] = CONTACT_ROWS * c, MAX_NORMAL
        rows[count + 1, 0], rows[count + 1, 1] = CONTACT_ROWS * c + 1, MAX_TANGENTIAL
        if status[c] != STICK:  # friction is a multiple of the normal force
            rows[count + 1, 0], rows[count + 1, 1] = CONTACT_ROWS * c + 2, MAX_SPEED
            slips[count] = sliding[c]
        count += 2
    time, stop = span[0] - course.began, span[1] - course.began
    if count == 0 or stop <= time:
        return level
    poles, sizes, slow_rows = (
        matrix(store, where, POLES), matrix(store, where, OBSERVED_SIZES), matrix(store, where, OBSERVED_SLOW)
    )  # fmt: skip
    weights, rates, bent = (
        matrix(store, where, OBSERVED), matrix(store, where, OBSERVED_RATE), matrix(store, where, BENT)
    )  # fmt: skip
    real, imag = matrix(store, where, TURN_REAL), matrix(store, where, TURN_IMAG)
    longest = matrix(store, where, LONGEST)[0, 0]
    f, lowest, terms = poles.shape[1], bent.shape[0] - 1, course.terms
    level = min(level, lowest)
    modes, following, amounts = np.empty(2 * f), np.empty(2 * f), np.empty(f)
    polynomials, ends = np.zeros((count, terms.shape[0])), np.empty((count, 4))
    if time > 0.0:
        modes_at(course.zeta, poles, time, modes)
    else:
        put(modes[:f], course.zeta[0])
        put(modes[f:], course.zeta[1])
    for i in range(count):
        r = rows[i, 0]
        for j in range(terms.shape[0]):
            for s in range(terms.shape[1]):
                polynomials[i, j] += slow_rows[r, s] * terms[j, s]
        y, slope = polynomial(polynomials, i, time)
        ends[i, 0] = y + row_on(weights, r, modes)
        ends[i, 1] = slope + row_on(rates, r, modes)
        then = polynomial(polynomials, i, stop)[0] + row_on(weights, r, last)
        _raise(statistics[r // CONTACT_ROWS], rows[i, 1], slips[i], max(abs(ends[i, 0]), abs(then)))
    for k in range(f):
        amounts[k] = abs(modes[k]) + abs(modes[f + k])
    while time < stop:
        length = longest * 0.5**level
        within = time + length <= stop  # else what is behind the end only bounds what is before it
        turn(modes, real, imag, level, following)
        doubtful, grows = False, True
        for i in range(count):
            r = rows[i, 0]
            y, slope = polynomial(polynomials, i, time + length)
            y += row_on(weights, r, following)
            slope += row_on(rates, r, following)
            ends[i, 2], ends[i, 3] = y, slope
            known = statistics[r // CONTACT_ROWS, rows[i, 1]]
            if slips[i] > 0.0:
                known = min(known, statistics[r // CONTACT_ROWS, MAX_TANGENTIAL] / slips[i])
            if within:
                known = max(known, abs(y))
            third = length / 3.0
            top = max(abs(ends[i, 0] + third * ends[i, 1]), abs(y - third * slope), abs(ends[i, 0]), abs(y))
            top -= (1.0 + SURE) * known
            if top <= 0.0:
                off = derivative_bound(polynomials, i, time + length, 4) * length**4 / 384
                off += most(sizes, r, bent, level, amounts)
                grows = grows and top + GROWTH * off <= 0.0
                top += off
            doubtful = doubtful or top > 0.0
        if doubtful and level < lowest:
            level += 1
            continue
        for i in range(count):
            if within:
                _raise(statistics[rows[i, 0] // CONTACT_ROWS], rows[i, 1], slips[i], abs(ends[i, 2]))
            ends[i, 0], ends[i, 1] = ends[i, 2], ends[i, 3]
        time += length
        for k in range(f):
            modes[k], modes[f + k] = following[k], following[f + k]
            amounts[k] = abs(modes[k]) + abs(modes[f + k])
        if grows and level > 0:
            level -= 1
    return level

"""From event to event, compiled: as long as changes of contact are plain ones, of statuses that are known.

What it does at a change is what `Motion.passed` does; what is not plain it leaves to that: impacts of several contacts
at once, changes that crowd, changes of what drives the system.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ....kernels import njit, put
from ....typing import Array, IntArray
from ...columns import FIRST_OPEN, FIRST_STICK, OPEN_STEPS, SLIP_STEPS, STICK_STEPS, WORKS
from .events import DONE, LEFT, Bench, go_through, powers
from .forms import FORMS
from .held import NEAR
from .observed import Course, Records, extremes, record
from .search import CROSSED, UNDECIDED, Numbers, Parts, first_root
from .statuses import GAP, STICK, TAYLOR
from .sums import followed, forms_at, modes_at, product, slow_at
from .tables import (
    AMOUNTS,
    AMOUNTS_SLOW,
    BENT,
    ENTER,
    IMAG,
    LONGEST,
    MEANINGS,
    NUMBER_AMOUNTS,
    NUMBER_SLOW,
    POLES,
    RATE_IMAG,
    RATE_REAL,
    REAL,
    REST,
    SIZES,
    SLOW,
    STATE,
    STATE_SLOW,
    TOLD,
    TURN_IMAG,
    TURN_REAL,
    TURNED,
    TURNS,
    matrix,
)

STRETCH = 256  # longest parts that are looked through from one beginning of the modes
MOMENT = 0.3  # rad of the fastest mode: changes within it crowd
PLAIN = 8  # so many changes of a moment are plain; behind them contacts may throw one another off without end
# What ended a leap: the time, a change that is not plain, a status without its modes or forces, no telling.
REACHED, CHANGE, NEEDS, NO_TELLING = range(4)
# What comes next: nothing known, a change of contact, another piece of the schedule, the modes begun anew.
LATER, CONTACT, PIECE, ANEW = range(4)
# Times [s]: now, of the beginning of the modes, of what comes next, up to which statuses were counted, of the first and
# of the last change of a moment, the end of the piece, how long the modes may be used.
NOW, NEXT, COUNTED, CROWD_SINCE, LATEST, PIECE_END, SPAN = range(7)
TIMES = 7
LEVEL, EVENTS, UNSURE, CROWDED, PEAK_LEVEL, NEXT_KIND, NEXT_NUMBER, NEEDED, NEXT_RECORD, RECORDED, SEARCHED = range(11)
COUNTS = 11


class LeapState(NamedTuple):
    """What moves on: q and v (2k,), where contacts began to stick (m,), works (5,) up to the beginning
    of the modes and up to now, statuses (m,), when each contact opened and from which status (m,)."""

    moving: Array
    holds: Array
    works: Array
    works_now: Array
    status: IntArray
    parted: Array
    parted_from: IntArray
    times: Array
    counts: IntArray
    statistics: Array


@njit(cache=True)
def _begin(
    store: Array, where: IntArray, state: LeapState, bench: Bench
) -> tuple[Array, Array, float]:  # pragma: no cover - compiled
    """Modes ζ (2, f) of a state, terms (J, S) of what is slow, and how long these may be used."""
    size, m = state.moving.shape[0], state.holds.shape[0]
    enter, rest, slow = matrix(store, where, ENTER), matrix(store, where, REST), matrix(store, where, SLOW)
    whole = np.empty(enter.shape[1])
    put(whole[:size], state.moving)
    powers(bench, state.times[NOW], whole[size:])
    put(whole[whole.shape[0] - m :], state.holds)
    f, few = enter.shape[0] // 2, rest.shape[0]
    zeta = np.empty(2 * f)
    product(enter, whole, zeta)
    terms = np.zeros((TAYLOR, slow.shape[0]))
    product(rest, whole, terms[0, :few])
    put(terms[0, few:], whole[size:])
    used, first, last = 1, 0.0, 0.0
    for s in range(slow.shape[0]):
        first = max(first, abs(terms[0, s]))
    for n in range(1, TAYLOR):
        product(slow, terms[n - 1], terms[n])
        last = 0.0
        for s in range(slow.shape[0]):
            terms[n, s] /= n
            last = max(last, abs(terms[n, s]))
        if last == 0.0:
            break
        used = n + 1
    span = STRETCH * matrix(store, where, LONGEST)[0, 0]
    # The last term must be nothing beside the first ones.
    while last > 0.0 and last * span ** (TAYLOR - 1) > 1e-17 * max(first, 1e-300):
        span *= 0.5
    return zeta.reshape(2, f), terms[:used].copy(), span


@njit(cache=True)
def _look(
    store: Array, where: IntArray, state: LeapState, unit: float, zeta: Array, terms: Array, ahead: Array
) -> bool:  # pragma: no cover - compiled
    """Find what comes next; whether that can be told. Where it is a change of contact, modes there are ``ahead``; unit
    [s]: that of the piece."""
    times, counts = state.times, state.counts
    rows, parts = matrix(store, where, NUMBER_SLOW), matrix(store, where, NUMBER_AMOUNTS)
    slow, amounts = np.zeros((rows.shape[0], terms.shape[0])), np.zeros(rows.shape[0])
    for i in range(rows.shape[0]):
        product(terms, rows[i], slow[i])
        for s in range(terms.shape[1]):
            amounts[i] += parts[i, s] * abs(terms[0, s])
    numbers = Numbers(
        matrix(store, where, REAL), matrix(store, where, IMAG), matrix(store, where, RATE_REAL),
        matrix(store, where, RATE_IMAG), matrix(store, where, SIZES), slow, amounts,
    )  # fmt: skip
    table = Parts(
        matrix(store, where, LONGEST)[0, 0], matrix(store, where, TURN_REAL), matrix(store, where, TURN_IMAG),
        matrix(store, where, BENT), matrix(store, where, TURNED),
    )  # fmt: skip
    turns, turn, turning = matrix(store, where, TURNS), np.inf, -1
    for i in range(turns.shape[0]):
        if times[NOW] + NEAR * unit < turns[i, 0] < turn:
            turn, turning = turns[i, 0], int(turns[i, 1])
    limit = min(min(times[SPAN], times[PIECE_END] - times[NOW]), turn - times[NOW])
    code, which, after, level, _, unsure = first_root(
        numbers, matrix(store, where, POLES), zeta, table, limit, counts[LEVEL], ahead
    )
    counts[SEARCHED], counts[LEVEL] = counts[LEVEL], level
    counts[UNSURE] += unsure
    if code == UNDECIDED:
        return False
    if code == CROSSED:
        counts[NEXT_KIND], counts[NEXT_NUMBER] = CONTACT, which
        times[NEXT] = min(times[NOW] + after, times[PIECE_END])
    elif limit == turn - times[NOW]:
        counts[NEXT_KIND], counts[NEXT_NUMBER], times[NEXT] = CONTACT, turning, turn
        modes_at(zeta, matrix(store, where, POLES), limit, ahead)
    elif times[NOW] + limit >= times[PIECE_END] * (1 - 1e-15):
        counts[NEXT_KIND], times[NEXT] = PIECE, times[PIECE_END]
    else:
        counts[NEXT_KIND], times[NEXT] = ANEW, times[NOW] + limit
    return True


@njit(cache=True)
def _count(state: LeapState, told: IntArray, time: float, step: float) -> None:  # pragma: no cover - compiled
    """Time spent in the present statuses, as they are told (m,), in steps."""
    share = max(time - state.times[COUNTED], 0.0) / step
    for c in range(state.status.shape[0]):
        now, kept = told[c], state.statistics[c]
        kept[OPEN_STEPS if now == GAP else STICK_STEPS if now == STICK else SLIP_STEPS] += share
        if now in (GAP, STICK) and share > 0.0:
            first = FIRST_OPEN if now == GAP else FIRST_STICK
            if kept[first] < 0.0:
                kept[first] = state.times[COUNTED] / step
    state.times[COUNTED] = max(time, state.times[COUNTED])


@njit(cache=True)
def leap(
    store: Array, legs_at: IntArray, legs: IntArray, options_at: IntArray, options: IntArray, bench: Bench,
    state: LeapState, zeta: Array, terms: Array, ahead: Array, records: Records, end: float, step: float, every: int,
    last: int, fastest: float, plain: int,
) -> tuple[int, Array, Array, Array]:  # fmt: skip # pragma: no cover - compiled
    """Up to ``end`` [s], with records before step ``last``; what ended it, ζ (2, f) and terms (J, S) of the modes, and
    modes ahead (2f,), at the next change.

    legs and options: by the number of a status, where in legs_at (·, LEG, 3) and options_at (·, OPTION, 3) it is. zeta,
    terms and ahead are those of modes that were begun, where what comes next is known; fastest [1/s], by which a
    moment is measured, and plain: how many changes of one are."""
    moving, kept_holds, works, works_now, status_now, parted, parted_from, times, counts, statistics = state
    size, m = moving.shape[0], status_now.shape[0]
    between = every * step
    while True:
        code = 0
        for c in range(m):
            code = 4 * code + status_now[c]
        place = legs[code]
        if place < 0:
            counts[NEEDED] = code
            return NEEDS, zeta, terms, ahead
        where = legs_at[place]
        if counts[NEXT_KIND] == LATER:
            zeta, terms, span = _begin(store, where, state, bench)
            times[SPAN] = span
            ahead = np.empty(2 * zeta.shape[1])
            if not _look(store, where, state, bench.length, zeta, terms, ahead):
                return NO_TELLING, zeta, terms, ahead
        f, (j, s) = zeta.shape[1], terms.shape
        stop = min(times[NEXT], end)
        along_real, along_imag, alone = np.zeros((FORMS, j, f)), np.zeros((FORMS, j, f)), np.zeros((FORMS, 2 * j))
        followed(store, where, terms, along_real, along_imag, alone)
        modes, first, forms = np.empty(2 * f), np.zeros(FORMS), np.zeros(FORMS)
        put(modes[:f], zeta[0])
        put(modes[f:], zeta[1])
        forms_at(store, where, zeta, modes, 0.0, along_real, along_imag, alone, WORKS, first)
        told = np.empty(m, dtype=np.int64)
        for c in range(m):
            told[c] = int(matrix(store, where, TOLD)[0, c])
        course = Course(zeta, terms, along_real, along_imag, alone, first, times[NOW])
        # Records on the way, those that fall on a change with the status before it only where rounding has them so.
        begins = counts[NEXT_RECORD]
        ends = min(int(np.ceil(stop / between - 1e-9)), -(-last // every))
        ends = max(min(ends, begins + records.contacts.shape[0] - counts[RECORDED]), begins)
        if ends > begins:
            record(
                store, where, course, told, works, between, (begins, ends), counts[RECORDED], records,
                statistics,
            )  # fmt: skip
            counts[NEXT_RECORD] = ends
            counts[RECORDED] += ends - begins
        if times[NEXT] < end and counts[NEXT_KIND] == CONTACT:
            put(modes, ahead)
        else:
            modes_at(zeta, matrix(store, where, POLES), stop - times[NOW], modes)
        counts[PEAK_LEVEL] = extremes(
            store, where, course, status_now, (max(times[COUNTED], times[NOW]), stop), modes, counts[PEAK_LEVEL],
            bench.sliding, statistics,
        )  # fmt: skip
        _count(state, told, stop, step)
        forms_at(store, where, zeta, modes, stop - times[NOW], along_real, along_imag, alone, WORKS, forms)
        for w in range(WORKS):
            works_now[w] = works[w] + forms[w] - first[w]
        if times[NEXT] >= end:
            return REACHED, zeta, terms, ahead
        # Through it.
        kind = counts[NEXT_KIND]
        if kind == PIECE:
            put(works, works_now)
            return CHANGE, zeta, terms, ahead
        slow, own = np.empty(s), np.empty(size)
        behind, amounts = np.empty(size), np.empty(size)
        slow_at(terms, stop - times[NOW], slow)
        product(matrix(store, where, STATE), modes, behind)
        product(matrix(store, where, STATE_SLOW), slow, own)
        for i in range(size):
            behind[i] += own[i]
        if kind == CONTACT:
            crowd = counts[CROWDED] if stop - times[CROWD_SINCE] <= MOMENT / fastest else 0
            if crowd + 1 > plain:
                put(works, works_now)
                return CHANGE, zeta, terms, ahead
            sizes = np.empty(f)
            for k in range(f):
                sizes[k] = np.hypot(modes[k], modes[f + k])
            product(matrix(store, where, AMOUNTS), sizes, amounts)
            for i in range(s):
                slow[i] = abs(slow[i])
            product(matrix(store, where, AMOUNTS_SLOW), slow, own)
            for i in range(size):
                amounts[i] += own[i]
            meaning = matrix(store, where, MEANINGS)[counts[NEXT_NUMBER]]
            status, holds, struck = status_now.copy(), kept_holds.copy(), works_now.copy()
            went, missing = go_through(
                store, options_at, options, bench, int(meaning[0]), int(meaning[1]), stop, status, behind, amounts,
                holds, struck,
            )  # fmt: skip
            if went == LEFT:
                put(works, works_now)
                return CHANGE, zeta, terms, ahead
            if went != DONE:
                counts[NEEDED] = missing
                return NEEDS, zeta, terms, ahead
            if crowd == 0:
                times[CROWD_SINCE] = stop
            counts[CROWDED] = crowd + 1
            counts[EVENTS] += 1
            times[LATEST] = stop
            for c in range(m):
                if status[c] == GAP and status_now[c] != GAP:
                    parted[c], parted_from[c] = stop, status_now[c]
            put(status_now, status)
            put(kept_holds, holds)
            put(works, struck)
            put(works_now, struck)
        else:
            put(works, works_now)
        put(moving, behind)
        times[NOW] = stop
        counts[NEXT_KIND] = LATER

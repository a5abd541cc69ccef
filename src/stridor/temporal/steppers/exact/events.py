"""What a contact does where a number that held its status reaches zero: `decisions` for plain changes, compiled.

A change is plain where at most one rigid contact strikes and where the options of all that touch are known. The same
options are tried in the same order by the same conditions as there.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ....kernels import njit, put
from ....typing import Array, IntArray
from ...arithmetic import FAST
from ...columns import FRICTION, NORMAL, SUPPORT
from .decisions import CLOSE, MOST
from .held import NEAR, ROUNDING
from .statuses import BACKWARD, FORWARD, GAP, STICK
from .sums import dot
from .tables import FORCES, GAPS, JAMMED, OPENING_RATE, OPENINGS, SLIP_RATE, WAYS, matrix

CLOSES, OPENS, SLIPS_FORWARD, SLIPS_BACKWARD, STOPS = range(5)
MEANING = {
    "closes": CLOSES, "opens": OPENS, "slips forward": SLIPS_FORWARD, "slips backward": SLIPS_BACKWARD, "stops": STOPS,
}  # fmt: skip
DONE, LEFT, NO_OPTION = range(3)  # gone through; left to `Motion.passed`; an option that is not known yet


class Bench(NamedTuple):
    """What does not change with the status: rows (m, k) of normals and tangents with their lifts (m, p), products of
    them (m, 3) nn, tt, nt, compliance, friction coefficients (m,), whether a contact stops along its tangent by a force
    of its own, beside that along its normal, and whether others could hold its slip, inertia (p, k) of supports;
    polynomials of σ (p, T) of their displacements and (p, T) speeds [m/s], when the piece of the schedule begins and
    what σ counts in [s]."""

    normal: Array
    tangent: Array
    normal_lift: Array
    tangent_lift: Array
    products: Array
    compliance: Array
    sliding: Array
    sticking: Array
    stops: Array
    holdable: Array
    inertia: Array
    places: Array
    speeds: Array
    begin: float
    length: float


@njit(cache=True)
def powers(bench: Bench, time: float, found: Array) -> None:  # pragma: no cover - compiled
    """1, σ, σ², … (T,) at a time."""
    share, power = (time - bench.begin) / bench.length, 1.0
    for j in range(bench.places.shape[1]):
        found[j] = power
        power *= share


@njit(cache=True)
def _sense(now: int) -> float:  # pragma: no cover - compiled
    return 1.0 if now == FORWARD else -1.0 if now == BACKWARD else 0.0


@njit(cache=True)
def _way(ways: Array, c: int, time: float) -> float:  # pragma: no cover - compiled
    """The sign of a slip that is held, from a time [s] on."""
    way = ways[c, 1]
    for i in range(2, ways.shape[1]):
        if ways[c, i] <= time:
            way = -way
    return way


@njit(cache=True)
def _choices(bench: Bench, c: int, slip: float, now: int, options: Array) -> int:  # pragma: no cover - compiled
    """What a touching contact may do, what it does now first; how many."""
    count = 0
    if slip != 0.0:
        options[0], options[1] = FORWARD if slip > 0.0 else BACKWARD, GAP
        count = 2
    else:
        if bench.sticking[c] > 0.0:
            options[0] = STICK
            count = 1
        options[count], options[count + 1], options[count + 2] = FORWARD, BACKWARD, GAP
        count += 3
    for i in range(count):
        if options[i] == now:
            for j in range(i, 0, -1):
                options[j] = options[j - 1]
            options[0] = now
            break
    return count


@njit(cache=True, fastmath=FAST)
def _size_on(row: Array, sizes: Array) -> float:  # pragma: no cover - compiled
    total = 0.0
    for i in range(row.shape[0]):
        total += abs(row[i]) * sizes[i]
    return total


@njit(cache=True)
def _consistent(
    store: Array, where: IntArray, bench: Bench, time: float, status: IntArray, touching: IntArray, slips: Array,
    whole: Array, sizes: Array,
) -> bool:  # fmt: skip # pragma: no cover - compiled
    """Whether forces and accelerations of a status go with it, of contacts ``touching`` with their slips."""
    m = status.shape[0]
    ways = matrix(store, where, WAYS)
    forces = matrix(store, where, FORCES)
    values = np.empty(2 * m)
    rounding, size = 0.0, 1e-300
    for i in range(2 * m):
        values[i] = dot(forces[i], whole)
        size = max(size, abs(values[i]))
        rounding = max(rounding, _size_on(forces[i], sizes))
    size = max(size, ROUNDING * rounding / CLOSE)
    for i in range(touching.shape[0]):
        c = touching[i]
        now, normal, tangential = status[c], values[2 * c], values[2 * c + 1]
        weight = max(bench.products[c, 0], bench.products[c, 1])
        if now == GAP and bench.compliance[c] > 0.0:
            # Only a spring that is not pressed lets go.
            gap = matrix(store, where, GAPS)[c]
            pressed = -dot(gap, whole) / bench.compliance[c]
            noise = ROUNDING * _size_on(gap, sizes) / bench.compliance[c]
            if pressed > CLOSE * size + noise or dot(matrix(store, where, OPENINGS)[c], whole) < 0.0:
                return False
        elif now == GAP:
            if dot(matrix(store, where, OPENING_RATE)[c], whole) < -CLOSE * size * weight:
                return False
        elif normal < -CLOSE * size:
            return False
        elif ways[c, 0] != 0.0:
            # Slip that is held goes as what holds it: at rest friction is what it was.
            way = _way(ways, c, time + NEAR * bench.length)
            if now == STICK:
                if way != 0.0:
                    return False
            elif _sense(now) * way < 0.0:
                return False
        elif now == STICK:
            # A slip that comes to its end stays there up to the stick limit, as the law has it.
            if abs(tangential) > bench.sticking[c] * normal + CLOSE * size:
                return False
        elif slips[c] == 0.0:
            away = _sense(now) * dot(matrix(store, where, SLIP_RATE)[c], whole)
            if away < -CLOSE * size * weight:
                return False
    return True


@njit(cache=True)
def _decide(
    store: Array, options_at: IntArray, known: IntArray, bench: Bench, time: float, touching: IntArray,
    counts: IntArray, options: IntArray, slips: Array, whole: Array, sizes: Array, status: IntArray,
) -> tuple[int, int]:  # fmt: skip # pragma: no cover - compiled
    """The first status that goes with its forces, written to ``status`` (m,); whether there is one, and the number of
    one that would have to be known."""
    m, n = status.shape[0], touching.shape[0]
    at = np.zeros(n, dtype=np.int64)
    for _ in range(MOST):
        status[:] = GAP
        for i in range(n):
            status[touching[i]] = options[touching[i], at[i]]
        code = 0
        for c in range(m):
            code = 4 * code + status[c]
        place = known[code]
        if place != JAMMED:
            if place < 0:
                return NO_OPTION, code
            if _consistent(store, options_at[place], bench, time, status, touching, slips, whole, sizes):
                return DONE, code
        i = n - 1
        while i >= 0:
            at[i] += 1
            if at[i] < counts[touching[i]]:
                break
            at[i] = 0
            i -= 1
        if i < 0:
            break
    return LEFT, 0


@njit(cache=True)
def _impact(
    bench: Bench, c: int, sticks: float, normal: float, slip: float
) -> tuple[bool, float, float, float]:  # pragma: no cover - compiled
    """Impulses along normal and tangent of one contact that strikes with these velocities, and the sign of the slip
    behind; sticks: the friction coefficient up to which it does. False where friction jams it."""
    nn, tt, nt = bench.products[c, 0], bench.products[c, 1], bench.products[c, 2]
    size = max(abs(normal), abs(slip), 1e-300)
    if bench.sticking[c] > 0.0 and bench.stops[c] == 0.0:
        pushed = -normal / nn
        if pushed * nn >= -CLOSE * size and abs(slip + nt * pushed) <= CLOSE * size:
            return True, pushed, 0.0, 0.0
    elif bench.sticking[c] > 0.0:
        whole = nn * tt - nt * nt
        pushed, along = (-normal * tt + slip * nt) / whole, (-slip * nn + normal * nt) / whole
        if pushed * nn >= -CLOSE * size and abs(along) <= sticks * pushed + CLOSE * size / nn:
            return True, pushed, along, 0.0
    for turn in range(2):
        s = 1.0 if (slip > 0.0) == (turn == 0) else -1.0
        own = nn - s * bench.sliding[c] * nt
        if own == 0.0:
            continue
        pushed = -normal / own
        along = -s * bench.sliding[c] * pushed
        if pushed * nn >= -CLOSE * size and s * (slip + nt * pushed + tt * along) >= -CLOSE * size:
            return True, pushed, along, s
    return False, 0.0, 0.0, 0.0


@njit(cache=True)
def go_through(
    store: Array, options_at: IntArray, known: IntArray, bench: Bench, meaning: int, c: int, time: float,
    status: IntArray, moving: Array, sizes: Array, holds: Array, works: Array,
) -> tuple[int, int]:  # fmt: skip # pragma: no cover - compiled
    """What a number that reached zero brings about: q and v (2k,) in ``moving``, works (5,), where contacts began to
    stick (m,) and statuses (m,) behind it. What ended it, and the number of an option that is missing."""
    m, k = status.shape[0], bench.normal.shape[1]
    terms, supports = bench.places.shape[1], bench.speeds.shape[0]
    sigma = np.empty(terms)
    powers(bench, time, sigma)
    along_supports = np.empty(supports)
    for p in range(supports):
        along_supports[p] = dot(bench.speeds[p], sigma)
    v = moving[k:]
    slips, touching = np.zeros(m), np.empty(m, dtype=np.int64)
    options, counts = np.zeros((m, 4), dtype=np.int64), np.zeros(m, dtype=np.int64)
    count, code = 0, 0
    for other in range(m):
        code = 4 * code + status[other]
    if known[code] < 0:
        return NO_OPTION, code
    ways = matrix(store, options_at[known[code]], WAYS)
    strikes = meaning == CLOSES and bench.compliance[c] == 0.0
    pushed = along = normal = slip = sense = 0.0
    if meaning == CLOSES:
        normal = dot(bench.normal[c], v) + dot(bench.normal_lift[c], along_supports)
        slip = dot(bench.tangent[c], v) + dot(bench.tangent_lift[c], along_supports)
    if strikes:
        for other in range(m):
            if status[other] != GAP and bench.compliance[other] == 0.0:
                return LEFT, 0
        struck, pushed, along, sense = _impact(bench, c, bench.sliding[c], normal, slip)
        if not struck:
            return LEFT, 0
        for i in range(k):
            v[i] += pushed * bench.normal[c, i] + along * bench.tangent[c, i]
    for other in range(m):
        if other == c or status[other] == GAP:
            if other == c and meaning not in (CLOSES, OPENS):
                touching[count] = c
                count += 1
            continue
        held = ways[other, 0] != 0.0
        slips[other] = _way(ways, other, time + NEAR * bench.length) if held else _sense(status[other])
        if strikes:
            # A spring takes no impulse, so what slides or sticks on one is carried along by what strikes elsewhere.
            own = dot(bench.tangent_lift[other], along_supports)
            there = own + dot(bench.tangent[other], v)
            amount = abs(own)
            for i in range(k):
                amount += abs(bench.tangent[other, i] * v[i])
            still = abs(there) <= CLOSE * amount and (status[other] == STICK or bench.holdable[other] > 0.0)
            slips[other] = 0.0 if still else there
        counts[other] = _choices(bench, other, slips[other], status[other], options[other])
        touching[count] = other
        count += 1
    if strikes:
        slips[c] = sense
        counts[c] = _choices(bench, c, sense, GAP, options[c])
    elif meaning == CLOSES:
        amount = abs(dot(bench.tangent_lift[c], along_supports))
        for i in range(k):
            amount += abs(bench.tangent[c, i] * v[i])
        if bench.holdable[c] > 0.0 and abs(slip) <= CLOSE * amount:
            counts[c] = _choices(bench, c, 0.0, STICK, options[c]) - 1  # all but the last, that it stays open
        else:
            slips[c] = slip
            options[c, 0], counts[c] = FORWARD if slip >= 0.0 else BACKWARD, 1
    elif meaning in (SLIPS_FORWARD, SLIPS_BACKWARD):
        ahead = meaning == SLIPS_FORWARD
        options[c, 0], options[c, 1], options[c, 2] = (
            FORWARD if ahead else BACKWARD, GAP, BACKWARD if ahead else FORWARD
        )  # fmt: skip
        counts[c] = 3
    elif meaning == STOPS:
        if bench.sticking[c] > 0.0:
            options[c, 0] = STICK
            counts[c] = 1
        back = BACKWARD if status[c] == FORWARD else FORWARD
        options[c, counts[c]], options[c, counts[c] + 1] = back, status[c]
        counts[c] += 2
    if meaning == CLOSES:
        touching[count] = c
        count += 1
    whole, amounts = np.empty(2 * k + terms + m), np.empty(2 * k + terms + m)
    put(whole[: 2 * k], moving)
    put(amounts[: 2 * k], sizes)
    put(whole[2 * k : 2 * k + terms], sigma)
    put(whole[2 * k + terms :], holds)
    for i in range(terms + m):
        amounts[2 * k + i] = abs(whole[2 * k + i])
    after = np.empty(m, dtype=np.int64)
    found, code = _decide(
        store, options_at, known, bench, time, touching[:count], counts, options, slips, whole, amounts, after
    )
    if found != DONE:
        if strikes:
            for i in range(k):
                v[i] -= pushed * bench.normal[c, i] + along * bench.tangent[c, i]
        return found, code
    if strikes:
        behind = normal + pushed * bench.products[c, 0] + along * bench.products[c, 2]
        slides = slip + pushed * bench.products[c, 2] + along * bench.products[c, 1]
        works[NORMAL] -= 0.5 * pushed * (normal + behind)
        works[FRICTION] -= 0.5 * along * (slip + slides)
        for p in range(supports):
            carried = pushed * bench.normal_lift[c, p] + along * bench.tangent_lift[c, p]
            for i in range(k):
                carried -= bench.inertia[p, i] * (pushed * bench.normal[c, i] + along * bench.tangent[c, i])
            works[SUPPORT] -= along_supports[p] * carried
    for other in range(m):
        if after[other] == STICK and status[other] != STICK:
            place = dot(bench.tangent[other], moving[:k])
            for p in range(supports):
                place += bench.tangent_lift[other, p] * dot(bench.places[p], sigma)
            holds[other] = place
    put(status, after)
    return DONE, code

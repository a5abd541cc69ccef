"""Multipliers that pass the unit circle along a branch of cycles."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Literal

import numpy as np
from scipy.optimize import linear_sum_assignment

from ..typing import ComplexArray
from .cycle import Cycle, same_word

Crossed = Literal[
    "period doubling", "torus", "branching", "stability changes with the contacts",
    "more of it grows with the contacts", "less of it grows with the contacts", "multipliers pass or jump, undecided",
]  # fmt: skip
Halfway = Callable[[Cycle, Cycle], Cycle | None]  # the cycle of a branch in the middle of the μ of two others
UNDECIDED: Crossed = "multipliers pass or jump, undecided"
HALVINGS, PARTS = 10, 6  # where contacts change in another way, and where one of a pair passes alone
NEARER, STAYS = 0.2, 0.5  # of how far multipliers are apart, when the ends come nearer by 1/32: continuous, a jump
REAL = 1e-6  # of a multiplier: its imaginary part where it is real


def crossings(
    cycles: Sequence[Cycle], folds: Sequence[int], halfway: Halfway | None = None
) -> list[tuple[Crossed, int, int]]:
    """What passes, behind which cycle and up to which, in the order of the branch; folds: numbers of the cycles where μ
    turns back, at each of which one multiplier passes 1 and is not told again; halfway: closes cycles between two
    others where something passes and contacts change in another way, as these two do not tell whether multipliers jump.

    Cycles whose multipliers are too near to the circle, or are not known, decide nothing: what passes there is told
    between the cycles on either side of them."""
    found: list[tuple[Crossed, int, int]] = []
    spent: set[int] = set()
    number: int | None = None
    least = most = 0  # the last cycle with no more, and the last with no fewer than `number` beyond the circle
    for k, cycle in enumerate(cycles):
        if cycle.outside is None:
            continue
        low, high = cycle.outside
        if number is None and low == high:
            number, least, most = low, k, k
        if number is None:
            continue
        passed = max(low - number, 0) - max(number - high, 0)
        if passed:
            first = least if passed > 0 else most
            kinds = _passed(cycles[first : k + 1], passed, halfway)
            turns = [f for f in folds if first <= f <= k and f not in spent]
            if turns and ("branching" in kinds or (abs(passed) == 1 and kinds[0].endswith(("contacts", "undecided")))):
                kinds.remove("branching" if "branching" in kinds else kinds[0])
                spent.add(turns[0])
            for kind in kinds:
                found.append((kind, first, k))
            number += passed
        least, most = (k if high <= number else least), (k if low >= number else most)
    return found


def _passed(cycles: Sequence[Cycle], number: int, halfway: Halfway | None) -> list[Crossed]:
    """What ``number`` more multipliers beyond the circle (less where negative) of the last cycle are than of the first:
    each real one, each pair; where contacts change in another way on the way, from cycles closed between the two."""
    last = cycles[-1]
    # Step by step multipliers go least far, so that each is found again.
    before = next(c for c in cycles[-2::-1] if c.outside is not None)
    if "harmonic" in (before.method, last.method):
        return _smooth(before, last, number, None)
    if same_word(before, last):
        return _smooth(before, last, number, halfway)
    assert last.outside is not None
    there = last.outside[0] if number > 0 else last.outside[1]
    left = number
    found: list[Crossed] = []
    while left:
        ends = _narrowed(before, last, there - left, left > 0, halfway)
        step = left if ends is None else _more(ends[-1][1], there - left, left > 0)
        step = min(step, left) if left > 0 else max(step, left)
        found.extend([UNDECIDED] if ends is None else _judged(ends, step, halfway, stable=there in (left, left - step)))
        before, left = last if ends is None else ends[-1][1], left - step
    return found


def _narrowed(
    one: Cycle, other: Cycle, number: int, growing: bool, halfway: Halfway | None
) -> list[tuple[Cycle, Cycle]] | None:
    """Two cycles between which the number beyond the circle is no longer ``number``, and halves of that, until contacts
    change alike in both, or HALVINGS times; None where a cycle between them is not closed or decides nothing."""
    ends = [(one, other)]
    while len(ends) <= HALVINGS and not same_word(one, other):
        middle = None if halfway is None else halfway(one, other)
        if middle is None or middle.outside is None:
            return None
        one, other = (one, middle) if _more(middle, number, growing) else (middle, other)
        ends.append((one, other))
    return ends


def _more(cycle: Cycle, number: int, growing: bool) -> int:
    """How many more than a number are surely beyond the circle, or (not growing) how many fewer, negative."""
    assert cycle.outside is not None
    low, high = cycle.outside
    return max(low - number, 0) if growing else min(high - number, 0)


def _judged(
    ends: Sequence[tuple[Cycle, Cycle]], number: int, halfway: Halfway | None, *, stable: bool
) -> list[Crossed]:
    """What passes between the last two of narrowing ends: by kind where contacts change alike in both, or multipliers
    get nearer as the ends do; with the contacts where they stay as far apart. stable: before or behind."""
    one, other = ends[-1]
    if same_word(one, other):
        return _smooth(one, other, number, halfway)
    last, before = (_moved(*pair, number) for pair in (ends[-1], ends[-1 - HALVINGS // 2]))
    if last <= NEARER * before:
        return _smooth(one, other, number, halfway)
    if last < STAYS * before:
        return [UNDECIDED]
    if stable:
        return ["stability changes with the contacts"]
    return ["more of it grows with the contacts" if number > 0 else "less of it grows with the contacts"]


def _moved(one: Cycle, other: Cycle, number: int) -> float:
    """How far apart the multipliers that pass between two cycles are in these."""
    inner, outer = (one, other) if number > 0 else (other, one)
    came, went = _crossing(inner.multipliers, outer.multipliers, abs(number))
    return float(np.abs(went - came).max(initial=0.0))


def _smooth(one: Cycle, other: Cycle, number: int, halfway: Halfway | None, halvings: int = PARTS) -> list[Crossed]:
    """What passes between two cycles whose multipliers are continuous from one to the other; where one of a pair passes
    alone, from cycles closed in between, as the pair may have passed and a real one the other way."""
    inner, outer = (one, other) if number > 0 else (other, one)
    values = _crossing(inner.multipliers, outer.multipliers, abs(number))[1]
    # A pair passes with both. One alone passed as a real one, at 1 or -1, before it met another beyond the circle, or,
    # beside a fold, the motion's own, which was taken away.
    mates = np.abs(values.conj()[:, None] - values[None, :]).min(axis=1)
    own = np.abs(values.imag) > REAL * np.abs(values)
    paired = own & (mates < np.abs(values.imag))
    middle = halfway(one, other) if halfway is not None and halvings and np.any(own & ~paired) else None
    counts = [c.outside for c in (one, middle, other) if c is not None]
    sure = [count[0] for count in counts if count is not None and count[0] == count[1]]
    if middle is not None and len(sure) == 3:
        parts = ((one, middle, sure[1] - sure[0]), (middle, other, sure[2] - sure[1]))
        return [k for a, b, more in parts if more for k in _smooth(a, b, more, halfway, halvings - 1)]
    alone: list[Crossed] = ["period doubling" if value.real < 0.0 else "branching" for value in values[~paired]]
    pairs: list[Crossed] = ["torus"] * (int(paired.sum()) // 2)
    return alone + pairs


def _crossing(inner: ComplexArray, outer: ComplexArray, number: int) -> tuple[ComplexArray, ComplexArray]:
    """The multipliers of ``outer`` beyond the circle that come from inside, behind those that they come from: those
    whose nearest counterparts, each of one, are furthest inside."""
    size = max(len(inner), len(outer))  # what one has fewer are zeros: contacts stick where it begins
    one, other = (np.pad(values, (0, size - len(values))) for values in (inner, outer))
    rows, columns = linear_sum_assignment(np.abs(one[:, None] - other[None, :]))
    came, went = one[rows], other[columns]
    order = np.argsort(np.where(np.abs(went) > 1.0, np.abs(came), np.inf), kind="stable")[:number]
    return np.asarray(came[order]), np.asarray(went[order])

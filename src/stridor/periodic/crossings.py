"""Multipliers that pass the unit circle along a branch of cycles."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Literal

import numpy as np
from scipy.optimize import linear_sum_assignment

from ..typing import ComplexArray
from .cycle import Cycle, same_word

Crossed = Literal[
    "period doubling", "torus", "branching", "stability changes with the contacts",
    "more of it grows with the contacts", "less of it grows with the contacts",
]  # fmt: skip
REAL = 1e-6  # of a multiplier: its imaginary part where it is real


def crossings(cycles: Sequence[Cycle], folds: Sequence[int]) -> list[tuple[Crossed, int, int]]:
    """What passes, behind which cycle and up to which, in the order of the branch; folds: numbers of the cycles where μ
    turns back, at each of which one multiplier passes 1 and is not told again.

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
            kinds: list[Crossed] = _passed(cycles[first : k + 1], passed)
            turns = [f for f in folds if first <= f <= k and f not in spent]
            if turns and ("branching" in kinds or (abs(passed) == 1 and kinds[0].endswith("contacts"))):
                kinds.remove("branching" if "branching" in kinds else kinds[0])
                spent.add(turns[0])
            for kind in kinds:
                found.append((kind, first, k))
            number += passed
        least, most = (k if high <= number else least), (k if low >= number else most)
    return found


def _passed(cycles: Sequence[Cycle], number: int) -> list[Crossed]:
    """What ``number`` more multipliers beyond the circle (less where negative) of the last cycle are than of the first:
    each real one, each pair."""
    first, last = cycles[0], cycles[-1]
    harmonic = any(c.method == "harmonic" for c in cycles)
    if not harmonic and not all(same_word(one, other) for one, other in pairwise(cycles)):
        if first.stable is not last.stable and None not in (first.stable, last.stable):
            return ["stability changes with the contacts"]
        return ["more of it grows with the contacts" if number > 0 else "less of it grows with the contacts"]
    # Step by step multipliers go least far, so that each is found again.
    before = next(c for c in cycles[-2::-1] if c.outside is not None)
    inner, outer = (before, last) if number > 0 else (last, before)
    values = _crossing(inner.multipliers, outer.multipliers, abs(number))
    # A pair passes with both. One alone passed as a real one, at 1 or -1, before it met another beyond the circle, or,
    # beside a fold, the motion's own, which was taken away.
    mates = np.abs(values.conj()[:, None] - values[None, :]).min(axis=1)
    paired = (np.abs(values.imag) > REAL * np.abs(values)) & (mates < np.abs(values.imag))
    alone: list[Crossed] = ["period doubling" if value.real < 0.0 else "branching" for value in values[~paired]]
    pairs: list[Crossed] = ["torus"] * (int(paired.sum()) // 2)
    return alone + pairs


def _crossing(inner: ComplexArray, outer: ComplexArray, number: int) -> ComplexArray:
    """The multipliers of ``outer`` beyond the circle that come from inside: those whose nearest counterparts, each of
    one, are furthest inside."""
    size = min(len(inner), len(outer))
    one, other = inner[:size], outer[:size]
    rows, columns = linear_sum_assignment(np.abs(one[:, None] - other[None, :]))
    came, went = np.abs(one[rows]), other[columns]
    order = np.argsort(np.where(np.abs(went) > 1.0, came, np.inf), kind="stable")
    return np.asarray(went[order[:number]])

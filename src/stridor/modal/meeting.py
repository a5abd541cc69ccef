"""Which branch is which beyond a place where two modes meet, for whoever follows branches.

The mean a and the squared half difference b of two eigenvalues are smooth in μ where the two are not. Between two μ the
cubic through b and its slopes at both ends says where b is zero: at a complex μ as a rule. Then √b goes on along one
side of that zero and the names with it. Where the zero lies on the real axis, or nearer to it than ``MET``, the two
meet, and what is which beyond is a matter of taste: the first grows, and where they part it has the higher frequency.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..typing import ComplexArray

MET = 1e-6  # of μ: how far off the real axis modes may meet that count as meeting on it
AT_IT = 1e-5  # of μ: how near a step may end to a meeting and be said to end there
OPPOSITE = 0.5  # of their difference: the sum of the slopes of two modes beside the place where they meet, at most
BESIDE = 0.05  # of μ: how far off two modes meet of which the one is told as the other's partner
FAINT = 1e-12  # of the largest coefficient: one that says nothing
KNOWN = 1e-3  # of a step: how well the cubic knows how far off the axis its zero is
SHORT = 1e-4  # of μ: steps in which it is known to better than MET
ROUNDING = 1e-9  # of b: how far beside zero a straight way passes that runs through it


@dataclass(frozen=True)
class Beyond:
    """What becomes of two branches over a step: exchanged, whether the two are to be exchanged; sure: whether the step
    is short enough to say so."""

    exchanged: bool
    sure: bool


def beyond(
    old: tuple[complex, complex], old_slopes: tuple[complex, complex], new: tuple[complex, complex],
    new_slopes: tuple[complex, complex], step: float,
) -> Beyond | None:  # fmt: skip
    """Whether two eigenvalues that a step of μ takes from ``old`` to ``new`` bear their names rightly; None where they
    neither meet nor pass one another.

    The slopes are those over μ of each at both ends; another parameter goes from 0 to 1.
    """
    before, after = ((pair[0] - pair[1]) / 2 for pair in (old, new))
    square, square_to = before**2, after**2
    slope, slope_to = before * (old_slopes[0] - old_slopes[1]), after * (new_slopes[0] - new_slopes[1])
    if not (np.isfinite(slope) and np.isfinite(slope_to)):
        return None
    # A step that ended where they meet has left the names to the next. Both slopes are beyond all bounds there, and
    # their sum is not; one alone is where that mode meets its own conjugate.
    each_other = abs(old_slopes[0] + old_slopes[1]) <= OPPOSITE * abs(old_slopes[0] - old_slopes[1])
    from_there = each_other and abs(square) <= AT_IT * abs(slope) and abs(square) < abs(square_to)
    if not ((square_to * square.conjugate()).real < 0 or from_there):
        return None
    zeros = _zeros(square, square_to, step * slope, step * slope_to)
    between = zeros[(zeros.real > -0.5) & (zeros.real < 1.5)]
    aside = float(np.abs(between.imag).min(initial=np.inf)) * step
    sure = step <= SHORT or aside > max(MET, KNOWN * step)
    if aside <= max(MET, 0.0 if sure else KNOWN * step):
        # √b is the growth of one and the decay of the other where it is more real than not.
        opening = square_to.real > 0
        return Beyond(bool(after.real < 0 if opening else after.imag < 0), sure)
    angle = float(np.sum(np.angle((1 - zeros) / (0 - zeros))))
    going_on = before / max(abs(before), 1e-300) * np.exp(0.5j * angle)
    return Beyond(bool((after * np.conj(going_on)).real < 0), sure)


def partner_of(values: ComplexArray, slopes: ComplexArray, i: int, mu: float) -> int:
    """The mode, of λ (k,) and their slopes (k,) over μ, that one which begins to grow has met or passed by; itself
    where its own conjugate is nearer than any other.

    It is the one that it met near here: two such move apart with opposite slopes, as their difference squared is linear
    in μ, and a third one that happens to lie between them does not. Where there is none, the nearest.
    """
    apart = values - values[i]
    distance = np.abs(apart)
    distance[i] = 2 * abs(values[i].imag)
    nearest = int(np.argmin(distance))
    if nearest == i or not np.isfinite(slopes[i]):
        return nearest
    with np.errstate(all="ignore"):
        parting = slopes - slopes[i]
        off = np.abs(apart / (2 * parting))
        met = (np.abs(slopes + slopes[i]) <= OPPOSITE * np.abs(parting)) & (off <= BESIDE * mu)
    met[i] = False
    return int(np.argmin(np.where(met, distance, np.inf))) if met.any() else nearest


def halves(first: complex, second: complex) -> tuple[complex, complex]:
    """Mean and squared half difference of two values."""
    return (first + second) / 2, ((first - second) / 2) ** 2


def through_zero(square: complex, before: complex) -> bool:
    """Whether the squared half difference has passed through zero on a straight line."""
    ratio = square / before if before else -1.0 + 0j
    return bool(ratio.real < 0 and abs(ratio.imag) < ROUNDING * abs(ratio))


def continued(square: complex, before: complex, half: complex, grows: Callable[[complex], bool]) -> complex:
    """√square continuous with ``half`` = √before along the straight way; where that runs through zero, the root by
    which the first of the two ``grows``."""
    if not through_zero(square, before):
        return half * np.sqrt(complex(square / before))
    root = complex(np.sqrt(complex(square)))
    return root if grows(root) else -root


def _zeros(start: complex, end: complex, first: complex, second: complex) -> ComplexArray:
    """Zeros over the step, from 0 to 1, of the cubic through two values and slopes."""
    cubic = 2 * start - 2 * end + first + second
    square = -3 * start + 3 * end - 2 * first - second
    coefficients = np.array([cubic, square, first, start])
    faint = np.abs(coefficients) <= FAINT * np.abs(coefficients).max()
    leading = int(np.argmin(faint))
    return np.asarray(np.roots(coefficients[leading:]), dtype=complex)

"""Friction laws as rows of numbers, and the one place where the μ(v) of a law is worked out.

The laws themselves evaluate their row here, and the time loops compile the same function, so that modes and marches
cannot have different ideas of a law. Plain arithmetic: no NumPy, no objects.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..typing import Array

CONSTANT, EXPONENTIAL, HYPERBOLIC, LINEAR, CUBIC = 0.0, 1.0, 2.0, 3.0, 4.0
# Columns of a row: kind, coefficient at which sticking ends, at high speed, the law's own parameter (decay speed [m/s]
# or delta [s/m]), points of a table; then a table's speeds [m/s], coefficients and slopes [s/m].
KIND, STICKING, KINETIC, PARAMETER, POINTS, HEAD = range(6)


def coefficient_at(law: Sequence[float] | Array, speed: float) -> tuple[float, float]:
    """μ [-] and dμ/d|v| [s/m] at a slip speed |v| ≥ 0 [m/s].

    A table is constant beyond its ends, with slope zero there. At a point where pieces of different slope meet, and at
    such an end, the slope is the mean of both sides; at rest it is that towards higher speeds.
    """
    kind = law[KIND]
    if kind == CONSTANT:
        return law[KINETIC], 0.0
    if kind == EXPONENTIAL:
        drop = (law[STICKING] - law[KINETIC]) * math.exp(-speed / law[PARAMETER])
        return law[KINETIC] + drop, -drop / law[PARAMETER]
    if kind == HYPERBOLIC:
        stretch = 1.0 + law[PARAMETER] * speed
        drop = (law[STICKING] - law[KINETIC]) / stretch
        return law[KINETIC] + drop, -drop * law[PARAMETER] / stretch
    n = int(law[POINTS])
    # The last piece that begins at or below the speed.
    low, high = -1, n
    while high - low > 1:
        middle = (low + high) // 2
        if law[HEAD + middle] <= speed:
            low = middle
        else:
            high = middle
    if low < 0:
        return law[HEAD + n], 0.0
    if kind == LINEAR:
        slope = _straight(law, n, low)
        mu = law[HEAD + n + low] + slope * (speed - law[HEAD + low])
        if law[HEAD + low] == speed and speed > 0.0:
            slope = 0.5 * (slope + _straight(law, n, low - 1))
        return mu, slope
    if low == n - 1:
        last = law[HEAD + 3 * n - 1] if law[HEAD + low] == speed else 0.0
        return law[HEAD + 2 * n - 1], 0.5 * last
    return _hermite(law, n, low, speed)


def _straight(law: Sequence[float] | Array, n: int, piece: int) -> float:
    """Slope [s/m] of a piece of a table of straight lines, zero beyond its ends."""
    if piece < 0 or piece >= n - 1:
        return 0.0
    rise = law[HEAD + n + piece + 1] - law[HEAD + n + piece]
    return rise / (law[HEAD + piece + 1] - law[HEAD + piece])


def _hermite(law: Sequence[float] | Array, n: int, piece: int, speed: float) -> tuple[float, float]:
    """Value and slope on one cubic piece of a table."""
    width = law[HEAD + piece + 1] - law[HEAD + piece]
    x = (speed - law[HEAD + piece]) / width
    a, b = law[HEAD + n + piece], law[HEAD + n + piece + 1]
    p, q = width * law[HEAD + 2 * n + piece], width * law[HEAD + 2 * n + piece + 1]
    # a + p x + c x² + d x³ with the value b and the slope q at x = 1.
    c, d = 3.0 * (b - a) - 2.0 * p - q, 2.0 * (a - b) + p + q
    mu = a + x * (p + x * (c + x * d))
    slope = (p + x * (2.0 * c + 3.0 * x * d)) / width
    if x == 0.0 and piece == 0 and speed > 0.0:
        slope *= 0.5
    return mu, slope


def monotone_slopes(speeds: Sequence[float], coefficients: Sequence[float]) -> tuple[float, ...]:
    """Slopes [s/m] at the points of a table with which cubic pieces neither overshoot nor wiggle.

    Inside, the weighted harmonic mean of the neighbouring secants, zero where these differ in sign; at the ends the
    three-point formula, limited (Fritsch and Butland 1984, as in MATLAB's and SciPy's pchip).
    """
    n = len(speeds)
    width = [speeds[k + 1] - speeds[k] for k in range(n - 1)]
    secant = [(coefficients[k + 1] - coefficients[k]) / width[k] for k in range(n - 1)]
    if n == 2:
        return secant[0], secant[0]
    inner = [0.0] * n
    for k in range(1, n - 1):
        before, after = secant[k - 1], secant[k]
        if before * after > 0.0:
            first, second = 2.0 * width[k] + width[k - 1], width[k] + 2.0 * width[k - 1]
            inner[k] = (first + second) / (first / before + second / after)
    inner[0] = _end_slope(width[0], width[1], secant[0], secant[1])
    inner[-1] = _end_slope(width[-1], width[-2], secant[-1], secant[-2])
    return tuple(inner)


def _end_slope(width: float, other: float, secant: float, beyond: float) -> float:
    slope = ((2.0 * width + other) * secant - width * beyond) / (width + other)
    if slope * secant <= 0.0:
        return 0.0
    if secant * beyond <= 0.0 and abs(slope) > 3.0 * abs(secant):
        return 3.0 * secant
    return slope

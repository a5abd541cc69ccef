"""Slip speeds that go with a force beyond the limit of friction, compiled."""

from __future__ import annotations

import math

from ...contact.multipliers import coefficient_at
from ...kernels import njit
from ...typing import Array, IntArray

STEPS = 80


@njit(cache=True, error_model="numpy")
def slips_at(
    beyond: Array, normal: Array, mu: float, table: Array, owner: IntArray, rate: Array, out: Array
) -> None:  # pragma: no cover - compiled
    """out (m, n, 3): |v| ≥ 0 with beyond = μ s(|v|) N + rate |v|, and s and ds/d|v| there; s the laws (c, w) of unit
    friction, rows of ``table``. beyond, normal (m, n) ≥ 0, rate (m,)."""
    for i in range(beyond.shape[0]):
        law = table[owner[i]]
        for t in range(beyond.shape[1]):
            a, force = beyond[i, t], mu * normal[i, t]
            s, slope = coefficient_at(law, 0.0)
            speed = 0.0
            if a > s * force:
                low, high = 0.0, a / rate[i]
                speed = (a - s * force) / rate[i]
                for _ in range(STEPS):
                    s, slope = coefficient_at(law, speed)
                    excess = s * force + rate[i] * speed - a
                    if abs(excess) <= 1e-15 * a:
                        break
                    if excess > 0.0:
                        high = speed
                    else:
                        low = speed
                    steep = slope * force + rate[i]
                    following = speed - excess / steep if steep > 0.0 else math.inf
                    if not low < following < high:
                        following = 0.5 * (low + high)
                    if abs(following - speed) <= 1e-16 * speed:
                        break
                    speed = following
                s, slope = coefficient_at(law, speed)
            out[i, t, 0] = speed
            out[i, t, 1] = s
            out[i, t, 2] = slope

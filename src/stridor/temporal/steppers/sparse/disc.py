"""Contact of one node in space, solved exactly: Signorini's law and Coulomb's disc, compiled.

The gap g and the slip s (2,) over the step follow without this node's forces; with them

    gap = g + w_nn N + w·T,      slip δ = s + w N + W T,      W symmetric, (2, 2), any ellipse.

Sticking: both vanish. Slipping: T = −μN δ/|δ|. With κ = μN/|δ|, the drag that a viscous layer would need, T = −κ δ and

    (I + κ W) δ = s + w N,       N(κ) = (−g + κ wᵀB s)/(w_nn − κ wᵀB w),    B = (I + κ W)⁻¹.

In the axes of W these are scalars, and one equation F(κ) = |T| − μN = 0 is left. κ = 0 is frictionless and F < 0, as
g < 0; κ → ∞ is sticking, where F > 0 if it has been refused: a root always lies between, whatever μ and the speed law.
With κ = κ0 t/(1 − t), κ0 = 2/tr W, F is linear in t for a round W and no coupling, so Newton's method in t ∈ (0, 1),
kept in its bracket, needs few steps.
"""

from __future__ import annotations

import math

from ....contact.multipliers import OPEN, SINGULAR, SLIP, STICK, coefficient_at
from ....kernels import njit
from ....laws import packed
from ....typing import Array

_OPEN, _STICK, _SLIP = OPEN, STICK, SLIP
_CONSTANT, _STICKING, _KIND, _KINETIC = packed.CONSTANT, packed.STICKING, packed.KIND, packed.KINETIC
NEWTON_STEPS = 60


@njit(cache=True, allocates=False)
def _axes(a: float, b: float, c: float) -> tuple[float, float, float, float]:  # pragma: no cover - compiled
    """Eigenvalues of [[a, b], [b, c]], larger first, and cosine and sine of the first axis."""
    if b == 0.0:
        return (a, c, 1.0, 0.0) if a >= c else (c, a, 0.0, 1.0)
    mean, half = 0.5 * (a + c), 0.5 * (a - c)
    radius = math.sqrt(half * half + b * b)
    angle = 0.5 * math.atan2(b, half)
    # The smaller as product over larger: a difference would cancel.
    large = mean + radius
    return large, max((a * c - b * b) / large, 0.0), math.cos(angle), math.sin(angle)


@njit(cache=True, allocates=False)
def solve_disc(
    g: float,
    s1: float,
    s2: float,
    w: tuple[float, float, float, float, float, float],
    law: Array,
    was_sticking: bool,
    step: float,
) -> tuple[float, float, float, int]:  # pragma: no cover - compiled
    """N ≥ 0, T1, T2 [N] and status from gap g and slip (s1, s2) [m] without this node's forces.

    w: w_nn, w_n1, w_n2, w_11, w_12, w_22 [m/N]; law: the friction law as a row of numbers (`laws.packed`); step Δt [s]
    turns slip into speed. A node that W lets move along one line only closes its
    gap without friction.
    """
    if g >= 0.0 or w[0] <= 0.0:
        return 0.0, 0.0, 0.0, _OPEN
    l1, l2, cosine, sine = _axes(w[3], w[4], w[5])
    a1, a2 = cosine * s1 + sine * s2, cosine * s2 - sine * s1
    b1, b2 = cosine * w[1] + sine * w[2], cosine * w[2] - sine * w[1]
    # Sticking, with the immobile directions at rest or not at all.
    small = SINGULAR * max(l1, w[0])
    c1 = 1.0 / l1 if l1 > small else 0.0
    c2 = 1.0 / l2 if l2 > small else 0.0
    schur = w[0] - c1 * b1 * b1 - c2 * b2 * b2
    if schur <= SINGULAR * w[0]:
        return -g / w[0], 0.0, 0.0, _STICK
    if not ((c1 == 0.0 and a1 != 0.0) or (c2 == 0.0 and a2 != 0.0)):
        normal = (-g + c1 * b1 * a1 + c2 * b2 * a2) / schur
        t1, t2 = -c1 * (a1 + b1 * normal), -c2 * (a2 + b2 * normal)
        limit = law[_STICKING] if was_sticking else coefficient_at(law, 0.0)[0]
        if normal >= 0.0 and t1 * t1 + t2 * t2 <= (limit * normal) ** 2:
            return normal, cosine * t1 - sine * t2, sine * t1 + cosine * t2, _STICK
    if law[_KINETIC] == 0.0 and (law[_KIND] == _CONSTANT or law[_STICKING] == 0.0):
        return -g / w[0], 0.0, 0.0, _SLIP
    normal, t1, t2 = _slide(g, a1, a2, w[0], b1, b2, l1, l2, law, step)
    return normal, cosine * t1 - sine * t2, sine * t1 + cosine * t2, _SLIP


@njit(cache=True, allocates=False)
def _slide(
    g: float,
    s1: float,
    s2: float,
    w_nn: float,
    w1: float,
    w2: float,
    l1: float,
    l2: float,
    law: Array,
    step: float,
) -> tuple[float, float, float]:  # pragma: no cover - compiled
    """N and T in the axes of W where the node slips: the root of F(t)."""
    scale = 2.0 / (l1 + l2) if l1 + l2 > 0.0 else 1.0 / w_nn
    l1, l2 = scale * l1, scale * l2
    low, high = 0.0, 1.0
    size = math.sqrt(s1 * s1 + s2 * s2)
    t = coefficient_at(law, size / step)[0] * (-g / w_nn) / (scale * size) if size > 0.0 else 0.5
    t = min(max(t, 1e-12), 0.999)
    normal = t1 = t2 = 0.0
    for _ in range(NEWTON_STEPS):
        d1, d2 = 1.0 - t + l1 * t, 1.0 - t + l2 * t
        c1, c2 = scale * t / d1, scale * t / d2
        r1, r2 = scale / (d1 * d1), scale / (d2 * d2)
        denominator = w_nn - c1 * w1 * w1 - c2 * w2 * w2
        normal = (-g + c1 * w1 * s1 + c2 * w2 * s2) / denominator
        slope = (r1 * w1 * (s1 + w1 * normal) + r2 * w2 * (s2 + w2 * normal)) / denominator
        f1, f2 = s1 + w1 * normal, s2 + w2 * normal
        t1, t2 = -c1 * f1, -c2 * f2
        tangential = math.sqrt(t1 * t1 + t2 * t2)
        t1_slope, t2_slope = -r1 * f1 - c1 * w1 * slope, -r2 * f2 - c2 * w2 * slope
        rise = (t1 * t1_slope + t2 * t2_slope) / tangential if tangential > 0.0 else 0.0
        mu, mu_slope = law[_KINETIC], 0.0
        if law[_KIND] != _CONSTANT:
            e1, e2 = (1.0 - t) / d1, (1.0 - t) / d2
            speed = math.sqrt((e1 * f1) ** 2 + (e2 * f2) ** 2) / step
            mu, falls = coefficient_at(law, speed)
            if speed > 0.0:
                v1 = -l1 / (d1 * d1) * f1 + e1 * w1 * slope
                v2 = -l2 / (d2 * d2) * f2 + e2 * w2 * slope
                mu_slope = falls * (e1 * f1 * v1 + e2 * f2 * v2) / (speed * step * step)
        excess = tangential - mu * normal
        if excess < 0.0:
            low = t
        else:
            high = t
        rise -= mu * slope + mu_slope * normal
        following = t - excess / rise if rise > 0.0 else -1.0
        if not low < following < high:
            following = 0.5 * (low + high)
        if abs(excess) <= 1e-15 * tangential or abs(following - t) <= 1e-16 * t:
            break
        t = following
    # On the disc to the last digit: N and the direction are kept.
    return normal, t1, t2

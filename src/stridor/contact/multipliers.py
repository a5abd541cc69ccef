"""Forward-increment Lagrange multipliers of one contact: unregularised Coulomb, solved exactly.

Plain arithmetic that the time loop compiles. The multipliers at t_n are those that make the
configuration at t_{n+1} admissible (paper eqs 9 and 12 and the conditions below them); several
contacts are iterated by Gauss–Seidel around this local solution.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from numba.extending import register_jitable

from ..laws import packed
from ..typing import Array

OPEN, STICK, SLIP = 0, 1, 2
SINGULAR = 1e-13
SPEED_STEPS = 60
_CONSTANT, _STICKING, _KIND = packed.CONSTANT, packed.STICKING, packed.KIND

for _plain in (packed._straight, packed._hermite):  # pyright: ignore[reportPrivateUsage]
    register_jitable(_plain)
coefficient_at = register_jitable(packed.coefficient_at)


@register_jitable
def solve_contact(
    gap: float,
    slip: float,
    w_nn: float,
    w_nt: float,
    w_tt: float,
    law: Sequence[float] | Array,
    was_sticking: bool,
    step: float,
) -> tuple[float, float, int]:
    """Normal force N ≥ 0, tangential force T and status from the free motion of one contact.

    gap [m] and slip [m] are the gap at t_{n+1} and the slip over the step that would follow without
    this contact's forces; w_** [m/N] the compliances over one step, so that gap + w_nn N + w_nt T and
    slip + w_nt N + w_tt T follow with them. step Δt [s] turns slip into speed. law is the friction law
    as a row of numbers (`laws.packed`): a contact that stuck before lets go at its stick limit, one that
    slid is caught at its coefficient at rest.
    Signorini: gap ≥ 0, N ≥ 0, N·gap = 0. Coulomb: |T| ≤ μN, and T = −μN sign(slip) where it slips.
    A pair that can only move along one line (a held slave on a held master, a point on an oblique guide)
    has a singular W: closing the gap then fixes the slip as well, and friction only follows it.
    """
    if gap >= 0.0:
        return 0.0, 0.0, OPEN
    determinant = w_nn * w_tt - w_nt * w_nt
    if determinant <= SINGULAR * w_nn * w_tt:
        if w_nn <= 0.0:
            return 0.0, 0.0, OPEN
        moved = slip - gap * w_nt / w_nn
        sense = -1.0 if moved > 0.0 else 1.0
        mu, _ = coefficient_at(law, abs(moved) / step)
        stiff = w_nn + sense * mu * w_nt
        if stiff <= 0.0 or abs(moved) <= 1e-12 * (abs(slip) + abs(gap * w_nt / w_nn)):
            return -gap / w_nn, 0.0, STICK
        return -gap / stiff, -sense * mu * gap / stiff, SLIP
    normal = (slip * w_nt - gap * w_tt) / determinant
    tangential = (gap * w_nt - slip * w_nn) / determinant
    limit = law[_STICKING] if was_sticking else coefficient_at(law, 0.0)[0]
    if normal >= 0.0 and abs(tangential) <= limit * normal:
        return normal, tangential, STICK
    stiff = moved = 0.0
    # Sliding: friction acts as sticking would have to, only not enough.
    sense = 1.0 if tangential > 0.0 else -1.0
    for attempt in range(2):
        # The speed belongs to the friction that it makes: Newton's method from the speed without friction, kept
        # between a speed that is too low and one that is too high.
        speed, low, high = abs(slip) / step, 0.0, math.inf
        for _ in range(1 if law[_KIND] == _CONSTANT else SPEED_STEPS):
            mu, slope = coefficient_at(law, speed)
            stiff = w_nn + sense * mu * w_nt
            normal = -gap / stiff
            tangential = sense * mu * normal
            moved = slip + w_nt * normal + w_tt * tangential
            excess = -sense * moved / step - speed
            if abs(excess) <= 1e-14 * speed:
                break
            if excess > 0.0:
                low = speed
            else:
                high = speed
            # The speed is −sense·moved/Δt, and its change with μ −N (w_tt − w_nt (w_nt + sense μ w_tt)/stiff)/Δt.
            gain = -normal * (w_tt - w_nt * (w_nt + sense * mu * w_tt) / stiff) / step
            rate = gain * slope - 1.0
            following = speed - excess / rate if rate < 0.0 else speed + excess
            if abs(following - speed) <= 1e-15 * speed:
                break
            if not low < following < high:
                following = 0.5 * (low + high) if high < math.inf else speed + excess
            speed = following
        if (stiff > 0.0 and moved * sense <= 0.0) or attempt == 1:
            break
        sense = -sense
    if normal < 0.0:
        # No sliding solution pushes (μ beyond the jamming limit of the pair): nothing to transmit.
        return 0.0, 0.0, OPEN
    return normal, tangential, SLIP


@register_jitable
def solve_kept(
    gap: float,
    slip: float,
    w_nn: float,
    w_nt: float,
    w_tt: float,
    law: Sequence[float] | Array,
    was_sticking: bool,
    step: float,
) -> tuple[float, float, int]:
    """Forces and status of a contact that is kept closed: N of either sign closes the gap, |T| ≤ μ|N|.

    A gap that would open is the mirror image of one that would close, with the normal turned round. Where friction
    would jam the pair it closes without.
    """
    sign = -1.0 if gap > 0.0 else 1.0
    normal, tangential, status = solve_contact(
        sign * gap, slip, w_nn, sign * w_nt, w_tt, law, was_sticking, step
    )
    if status == OPEN:
        return (-gap / w_nn if w_nn > 0.0 else 0.0), 0.0, SLIP
    return sign * normal, tangential, status

"""Where the growth rate of a damped mode of the projected problem passes through zero."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy

from ..dense_problem import DenseProblem, Eigenpairs
from ..newton import crossing as on_axis
from ..tolerances import AT_REST
from .follow import BranchState, Follower
from .passages import Passage

NEAR_AXIS = 1e-6  # of the band: below it a frequency is zero
ROUNDING = 1e-9  # of |λ|: growth at what is told as its zero
ABOUT = 4.0  # times the way of a mode over a passage: where others count with it


@dataclass(frozen=True)
class Solved:
    """An onset of the projected problem: μ, λ on the axis, and how the instability opens."""

    mu: float
    lam: complex
    square_root: float | None
    slope: float | None = None
    exceptional: complex | None = None


def root_between(call: Callable[[float], float], low: float, high: float) -> float | None:
    """A zero of ``call`` between two μ; None where its sign does not change (any more)."""
    at_low, at_high = call(low), call(high)
    if at_low == 0.0 or at_high == 0.0:
        return low if at_low == 0.0 else high
    if at_low * at_high > 0 or not np.isfinite(at_low * at_high):
        return None
    try:
        return float(scipy.optimize.brentq(call, low, high, xtol=1e-14 * max(high, 1e-3), rtol=1e-14, maxiter=200))
    except RuntimeError:  # a jump, not a zero: two modes have changed places
        return None


def crossing(reduced: DenseProblem, passage: Passage) -> Solved | None:
    """Where the growth rate of a damped mode passes through zero."""
    found = _quick_crossing(reduced, passage)
    if found is None:
        start = _again(reduced, passage)
        found, sure = (None, False) if start is None else _slow_crossing(reduced, passage, start)
        # Where two modes exchange their names the growth of either jumps over zero: that of both together tells more.
        found = found if sure else _by_growth(reduced, passage) or found
    if found is None:
        return None
    mu, lam, slope = found
    still = abs(lam) <= NEAR_AXIS * reduced.frequency
    return Solved(mu, 0j if still else lam, None, slope)


def crossing_again(reduced: DenseProblem, passage: Passage, solved: Solved) -> Solved | None:
    """The same crossing with the basis as it is now, from where it was; None where it has gone."""
    right, left = reduced.null_vectors(solved.lam, solved.mu)
    root = on_axis(reduced, solved.mu, solved.lam, right, left, (passage.low, passage.high))
    if root is None or root.slope is None or (root.slope < 0) != passage.stabilising:
        return None
    return Solved(root.mu, 0j if abs(root.lam) <= NEAR_AXIS * reduced.frequency else root.lam, None, root.slope)


def _quick_crossing(reduced: DenseProblem, passage: Passage) -> tuple[float, complex, float] | None:
    """μ, λ on the axis and the growth's slope, following this one mode only; None where that does not settle inside."""
    start = passage.old
    index = int(start.index[passage.branch])
    right, left = (reduced.padded(start.found, v[:, [index]])[:, 0] for v in (start.found.right, start.found.left))
    lam, tangent = complex(start.found.values[index]), complex(start.found.tangents[index])
    width = passage.high - passage.low
    # Of a mode that nothing damps yet the growth rate may have no slope at all.
    ahead = -lam.real / tangent.real if tangent.real else np.inf
    ahead = float(np.clip(ahead, 0.0, width)) if np.isfinite(ahead) else 0.5 * width
    root = on_axis(
        reduced, start.mu + ahead, lam + tangent * ahead, right, left, (passage.low, passage.high)
    )
    if root is None or root.slope is None:
        return None
    slack = 0.05 * width
    if not passage.low - slack <= root.mu <= passage.high + slack or (root.slope < 0) != passage.stabilising:
        return None
    return root.mu, root.lam, root.slope


def _slow_crossing(
    reduced: DenseProblem, passage: Passage, start: BranchState
) -> tuple[tuple[float, complex, float] | None, bool]:
    """The same by bisection on all branches, and whether the growth of the one is zero there."""

    def at(mu: float) -> BranchState:
        return Follower.resumed(reduced, start).advance(mu)

    def rate(mu: float) -> float:
        return float(at(mu).values[passage.branch].real)

    mu = root_between(rate, passage.low, passage.high)
    if mu is None:
        return None, False
    state = at(mu)
    lam = complex(state.values[passage.branch])
    # Beside a motion as a whole what passes zero is known to the root of rounding alone.
    sure = abs(lam) <= AT_REST * reduced.frequency or abs(lam.real) <= ROUNDING * abs(lam)
    if not sure and not _begins_among((at(passage.low), at(passage.high)), passage, lam):
        return None, False
    return (mu, 1j * lam.imag, float(state.tangents[passage.branch].real)), sure


def _begins_among(ends: tuple[BranchState, BranchState], passage: Passage, lam: complex) -> bool:
    """Whether of the modes about λ the fastest grows at one end of a passage alone. Where two exchange their names the
    growth of either jumps over zero, and nothing begins or ends."""
    reach = ABOUT * max(abs(complex(end.values[passage.branch]) - lam) for end in ends)
    fastest = [float(end.found.values.real[np.abs(end.found.values - lam) <= reach].max()) for end in ends]
    return (fastest[0] > ROUNDING * abs(lam)) != (fastest[1] > ROUNDING * abs(lam))


def _by_growth(reduced: DenseProblem, passage: Passage) -> tuple[float, complex, float] | None:
    """The same where two modes all but meet and which is which cannot be told: where the fastest of those about them
    begins, or ceases, to grow."""
    begin = complex(passage.old.values[passage.branch])
    ahead = reduced.eigenpairs(passage.high).values
    ahead = ahead[(ahead.real > 0) != passage.stabilising]
    if not len(ahead):
        return None
    end = complex(ahead[np.argmin(np.abs(ahead - begin))])

    def fastest(mu: float) -> tuple[Eigenpairs, int]:
        found = reduced.eigenpairs(mu)
        part = (mu - passage.low) / (passage.high - passage.low)
        near = np.abs(found.values - begin - part * (end - begin)) <= 2 * abs(end - begin)
        return found, int(np.argmax(np.where(near, found.values.real, -np.inf)))

    def growth(mu: float) -> float:
        found, index = fastest(mu)
        return float(found.values[index].real)

    mu = root_between(growth, passage.low, passage.high)
    if mu is None:
        return None
    found, index = fastest(mu)
    lam, slope = complex(found.values[index]), float(found.tangents[index].real)
    if abs(lam.real) > ROUNDING * abs(lam) or (slope < 0) != passage.stabilising:
        return None
    return mu, 1j * lam.imag, slope


def _again(reduced: DenseProblem, passage: Passage) -> BranchState | None:
    """The state before a passage with the basis as it is now."""
    found = reduced.eigenpairs(passage.low)
    if passage.old.found is found:
        return passage.old
    distance = np.abs(passage.old.coordinate[:, None] - found.coordinate)
    index = np.argmin(distance, axis=1)
    near = distance[passage.branch, index[passage.branch]] <= 1e-3 * np.abs(passage.old.coordinate[passage.branch])
    return BranchState(found, index) if near else None

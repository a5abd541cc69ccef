"""To which onset a mode that grows at one friction coefficient goes back.

Modes at a single μ are numbered by themselves: where other nodes touch as friction grows, onsets and sweeps carry their
numbers from one set of nodes to the next, and the two need not agree. So a mode is found again in the sweep by its λ
and followed down from there as far as it grows: its onset lies between the lowest μ of these and the next below.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..modal.complex_modes import ComplexModes
from ..modal.joined import matched
from ..modal.onsets import Onset, Onsets

NEAR = 0.05  # of the frequency: an onset belongs to a mode within it, whatever their numbers


@dataclass(frozen=True)
class Origin:
    """Where a mode begins to grow: at an onset, or (from_start) it does so at the low end of the range already; with
    neither it is not known. number: that of the mode over the range of friction, None where it was not found there."""

    onset: Onset | None
    from_start: bool
    number: int | None


@dataclass(frozen=True)
class _Growth:
    """A mode grows from μ = ``lowest`` on, at ``frequency_hz`` there, and not at ``below`` (None: no lower μ is known).
    number: its own in the sweep, None where it is not in it."""

    lowest: float
    below: float | None
    frequency_hz: float
    number: int | None


def origin(onsets: Onsets, modes: ComplexModes, column: int, sweep: ComplexModes | None) -> Origin:
    """Where the mode of a column begins to grow, which does so at the first μ of ``modes``; sweep: modes over the range
    of friction, of the same damping."""
    begun = [o for o in onsets.onsets if o.mu <= float(modes.mu[0]) and not o.stabilising]
    renumbered = any(o.kind == "contact" for o in onsets.onsets)  # other nodes touch at other μ
    growth = _growth(modes, column, sweep)
    if growth is None:
        own, frequency = int(modes.branch[column]), float(modes.frequency_hz[0, column])
        found = [
            o
            for o in begun
            if (own in o.branches if any(o.branches) and not renumbered else _near(o.frequency_hz, frequency))
        ]
        return _told(found[-1] if found else None, onsets, frequency, None)
    known = None if renumbered else growth.number
    found = _between(begun, growth, known) or _earlier(onsets, growth)
    if growth.below is not None:
        return Origin(found, from_start=False, number=growth.number)
    return _told(found, onsets, growth.frequency_hz, growth.number)


def _told(onset: Onset | None, onsets: Onsets, frequency_hz: float, number: int | None) -> Origin:
    """With what grows at the low end of the range asked where there is no onset."""
    first = [*onsets.at_start, *(lam for lam, _ in onsets.entering)]
    grows = onset is None and any(_near(lam.imag / (2 * np.pi), frequency_hz) for lam in first)
    return Origin(onset, grows, number)


def _growth(modes: ComplexModes, column: int, sweep: ComplexModes | None) -> _Growth | None:
    """How far down in μ a mode grows; None where the sweep does not reach over its μ, or is of other damping."""
    mu, frequency = float(modes.mu[0]), float(modes.frequency_hz[0, column])
    if sweep is None or sweep.damped != modes.damped or float(sweep.mu.max()) < mu:
        return None
    rows = [int(k) for k in np.argsort(sweep.mu, kind="stable") if sweep.mu[k] <= mu and sweep.solved[k]]
    if not rows:
        return None
    last = rows[-1]
    own = [b for i, b in matched(modes.eigenvalues[0], sweep.eigenvalues[last]) if i == column]
    if not own:
        return _Growth(mu, float(sweep.mu[last]), frequency, None)
    b, number, lowest = own[0], int(sweep.branch[own[0]]), mu
    for k in reversed(rows):
        if not sweep.unstable[k, b]:
            return _Growth(lowest, float(sweep.mu[k]), frequency, number)
        lowest, frequency = float(sweep.mu[k]), float(sweep.frequency_hz[k, b])
    return _Growth(lowest, None, frequency, number)


def _between(begun: Sequence[Onset], growth: _Growth, number: int | None) -> Onset | None:
    """The onset that lies where the mode begins to grow: of several the nearest in frequency. number: that of the mode
    among those of the onsets, None where it does not tell."""
    low = -np.inf if growth.below is None else growth.below
    inside = [o for o in begun if low <= o.mu <= growth.lowest]
    own = [o for o in inside if number in o.branches or _near(o.frequency_hz, growth.frequency_hz)]
    return min(own, key=lambda o: abs(o.frequency_hz - growth.frequency_hz), default=None)


def _earlier(onsets: Onsets, growth: _Growth) -> Onset | None:
    """The onset of a mode whose growth opens so slowly that it is rounding at the next μ of the sweep: the last change
    of the mode up to where it grows, unless growth ends there."""
    own = [
        o
        for o in onsets.onsets
        if o.mu <= growth.lowest and growth.number in o.branches and _near(o.frequency_hz, growth.frequency_hz)
    ]
    return own[-1] if own and not own[-1].stabilising else None


def _near(frequency_hz: float, other_hz: float) -> bool:
    return abs(frequency_hz - other_hz) <= NEAR * max(other_hz, 1e-300)

"""The mode that is held against what a small motion shows in time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..typing import ComplexArray, IntArray
from .pairs import TOGETHER
from .result import GOOD_FREQUENCY, GOOD_GROWTH, quiet
from .small_motion import Perturbation


@dataclass(frozen=True)
class Partner:
    """column: of the mode among λ (k,); unstable: whether it is one that grows, of those that a motion in time shows.

    rival: λ of the mode that grows fastest where that is another one, which grows as fast to the digits that are held
    against time and is in the motion as well; hidden: λ of the mode that grows fastest where no contact slips in it, so
    that a motion in time does not show it. None else.
    """

    column: int
    unstable: bool
    rival: complex | None = None
    hidden: complex | None = None


def partner_of(lam: ComplexArray, unstable: IntArray, seen: Perturbation) -> Partner:
    """The partner of what grows fastest, or dies out last, in time, of modes λ (k,) of which ``unstable`` grow, the
    fastest first: the fastest that contacts show, or one that grows as fast if that is what time shows."""
    if not len(unstable):
        return Partner(int(np.argmin(np.abs(lam - seen.eigenvalue))), unstable=False)
    shown = [int(k) for k in unstable if not _hidden(complex(lam[k]), seen)]
    top = complex(lam[unstable[0]])
    if not shown:
        others = np.setdiff1d(np.flatnonzero(lam.imag > 0.0), unstable)
        if not len(others):
            return Partner(int(unstable[0]), unstable=True)
        nearest = others[np.argmin(np.abs(lam[others] - seen.eigenvalue))]
        return Partner(int(nearest), unstable=False, hidden=top)
    first = complex(lam[shown[0]])
    hidden = None if _as_fast(first, top) else top
    for k in shown:
        here = complex(lam[k])
        if not _as_fast(here, first):
            break
        if same_mode(seen.eigenvalue, here):
            return Partner(k, unstable=True, rival=None if k == shown[0] else first, hidden=hidden)
        # What grows as fast, or faster, must be in the motion: what is not was not borne out.
        if not _in_motion(here, seen):
            break
    return Partner(shown[0], unstable=True, hidden=hidden)


def same_mode(seen: complex, mode: complex) -> bool:
    """Whether λ as seen in time has frequency and growth of a mode, as far as either is told in time."""
    near = abs(seen.imag - mode.imag) <= GOOD_FREQUENCY * abs(mode.imag)
    return near and (_as_fast(seen, mode) or quiet(seen, mode))


def _as_fast(one: complex, other: complex) -> bool:
    """Whether one grows as fast as another."""
    return abs(one.real - other.real) <= GOOD_GROWTH * abs(other.real)


def _in_motion(mode: complex, seen: Perturbation) -> bool:
    return any(same_mode(complex(part), mode) for part in seen.components.eigenvalues)


def _hidden(mode: complex, seen: Perturbation) -> bool:
    """Whether a mode was left out of the motion since no contact slips in it, and has not grown there out of rounding
    either."""
    left_out = bool(np.any(np.abs(seen.unshown - mode) <= TOGETHER * abs(mode)))
    return left_out and not _in_motion(mode, seen)

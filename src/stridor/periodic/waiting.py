"""Motions whose contacts have not changed for long: what they head for, and whether they can change at all.

Between changes the numbers that a status lives on (gaps, normal forces, margins to slip, slip speeds) are a polynomial
of what is slow and a sum of modes (:mod:`stridor.temporal.steppers.exact.motion`). Where the polynomial is constant, no
mode grows and what the modes amount to is smaller than every number, nothing changes any more.
"""

from __future__ import annotations

import time as clock

import numpy as np

from ..temporal.steppers.exact.motion import Anchor
from ..temporal.steppers.exact.statuses import STICK
from ..temporal.steppers.exact.varied import VariedMotion
from ..typing import Array, BoolArray
from .parting import next_change
from .problem import SlidingProblem

STILL = 1e-9  # of a pole: growth that is none, of a number: a part of it that is none
ROUNDS = 20  # of waiting, where it cannot be told that nothing changes
LATER = 1.1  # of the time at which a change is expected
STEADY = 1e-6  # of the beginning: what is left of a motion that has come to rest


def later_change(problem: SlidingProblem, motion: VariedMotion, quiet: float, until: float) -> tuple[str, int] | None:
    """The next change of a motion that had none for ``quiet`` [s]; None where there is none for ever, or none within
    what was waited for and ``until`` [s of processor time]."""
    reached = motion.time
    for _ in range(ROUNDS):
        anchor = _anchor(motion)
        if anchor is None or _kept(anchor, problem.piece.end) or clock.process_time() > until:
            return None
        ahead = _expected(anchor)
        reached = max(reached, anchor.time) + (LATER * ahead if np.isfinite(ahead) else quiet)
        change = next_change(motion, reached, until)
        if change is not None:
            return change
    return None


def outcome(problem: SlidingProblem, motion: VariedMotion, begun: float, since: float) -> tuple[str, bool]:
    """What a motion without further changes since a time [s] ends in, and whether that is steady sliding; begun: how
    far it was from that then."""
    anchor = _anchor(motion)
    kept = anchor is not None and _kept(anchor, problem.piece.end)
    lasting = f"no contact changes within {motion.time - since:.3g} s"
    more = "" if kept else f" as far as it was followed: {lasting}"
    if STICK in motion.status:
        return f"contacts come to stick and stay so{more}", False
    if motion.status != problem.status:
        return f"contacts come to open or to turn, and stay so{more}", False
    if anchor is not None and np.any(_growing(anchor)):
        return f"steady sliding is unstable, but {lasting}: growth takes longer than it was followed", False
    if anchor is None or not kept:
        return f"{lasting}, and whether any does later was not followed", False
    if np.any(~_decaying(anchor) & (np.abs(anchor.zeta) > STEADY * max(begun, 1e-300))):
        return f"the motion swings on without any change of contact, neither growing nor dying out ({lasting})", False
    return "the motion dies out: it comes to steady sliding", True


def _anchor(motion: VariedMotion) -> Anchor | None:
    """The modes that a motion is in; None at the end of all times."""
    motion.reach(motion.time)
    return motion.anchor


def _growing(anchor: Anchor) -> BoolArray:
    poles = anchor.watched.flow.split.poles
    return poles.real > STILL * np.abs(poles)


def _decaying(anchor: Anchor) -> BoolArray:
    poles = anchor.watched.flow.split.poles
    return poles.real < -STILL * np.abs(poles)


def _numbers(anchor: Anchor) -> Array:
    """What is slow in each number, in powers of the time from the anchor on (numbers, terms)."""
    return anchor.watched.slow @ anchor.terms.T


def _kept(anchor: Anchor, end: float) -> bool:
    """Whether no number of the status can come to zero any more, up to a time [s]."""
    slow = _numbers(anchor)
    powers = (end - anchor.time) ** np.arange(slow.shape[1])
    swing = np.abs(anchor.watched.weights) @ np.abs(anchor.zeta)
    size = np.abs(slow).max(axis=1, initial=0.0)
    changed = np.abs(slow * powers)[:, 1:].max(axis=1, initial=0.0)
    drifts = bool(np.any(changed > STILL * np.maximum(size, 1e-300)))
    return not drifts and not np.any(_growing(anchor)) and bool(np.all(slow[:, 0] > swing))


def _expected(anchor: Anchor) -> float:
    """After which time [s] from the anchor on what is slow, or a mode that grows, would take a number to zero."""
    slow, weights = _numbers(anchor), anchor.watched.weights
    times = [np.inf]
    for terms in slow:
        roots = np.roots(np.trim_zeros(terms[::-1], "f")) if np.any(terms[1:]) else np.zeros(0)
        times += [float(r.real) for r in roots if abs(r.imag) < 1e-9 * abs(r) and r.real > 0.0]
    for j in np.flatnonzero(_growing(anchor)):
        own = np.abs(weights[:, j] * anchor.zeta[j])
        acting = own > 0.0
        share = np.maximum(np.abs(slow[acting, 0]) / own[acting], 1.0)
        rate = float(anchor.watched.flow.split.poles[j].real)
        times += [float(t) for t in np.log(share) / rate]
    return min(times)

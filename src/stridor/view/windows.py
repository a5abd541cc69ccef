"""Which part of a long run to show: a few periods of the first regime of stick and slip."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..digits import measured
from ..temporal.trajectory import STATUS, Trajectory
from ..typing import IntArray
from .units import later_words

SEPARATION, STICK, SLIP = (STATUS.index(name) for name in ("separation", "stick", "slip"))
SETTLED = 0.6  # of a regime has passed before it is shown
ENOUGH = 10  # records of a period draw it; how many there are is said of fewer


@dataclass(frozen=True)
class Window:
    """From start to end [s] of a run, why just there, and what contact did in it: largest normal force [N],
    largest slip speed [m/s], fractions of the time. length: how much that is, in words ("three periods of 1000 Hz")."""

    start: float
    end: float
    reason: str
    max_normal_force: float
    max_slip_speed: float
    stick_fraction: float
    separation_fraction: float
    length: str = "the window"


def regime_window(
    trajectory: Trajectory, frequency_hz: float | None, *, contact: int = 0, periods: float = 3.0
) -> Window | None:
    """``periods`` at ``frequency_hz`` of the last phase, late in the regime before the first separation.

    Among the windows there the one whose status changes come nearest to two in a period, once to stick and
    once to slip. Without separation it is the end of the run; None for a run that is shorter than the window. Without a
    frequency the window is a fiftieth of the phase, however many periods of whatever that is.
    """
    part = trajectory.phase_slice()
    status = trajectory.status[part, contact]
    size = round(periods / (frequency_hz * trajectory.sampling)) if frequency_hz else max(2, len(status) // 50)
    if not 2 <= size <= len(status):
        return None
    opened = np.flatnonzero(status == SEPARATION)
    until = int(opened[0]) if len(opened) and opened[0] >= 4 * size else len(status)
    sticks = bool(np.any(status[:until] == STICK)) and bool(np.any(status[:until] == SLIP))
    if until < len(status):
        reason = "stick and slip, shortly before the first separation"
    else:
        reason = "stick and slip" if sticks else "the end of the run"
    first = _chosen(status[:until], size, periods) if sticks else until - size
    chosen = slice(part.start + first, part.start + first + size)
    inside = trajectory.status[chosen, contact]
    return Window(
        start=float(trajectory.time[chosen][0]),
        end=float(trajectory.time[chosen][-1]),
        reason=reason,
        max_normal_force=float(np.abs(trajectory.normal_force[chosen, contact]).max()),
        max_slip_speed=float(np.abs(trajectory.slip_speed[chosen, contact]).max()),
        stick_fraction=float(np.mean(inside == STICK)),
        separation_fraction=float(np.mean(inside == SEPARATION)),
        length=_length(size, size * trajectory.sampling, frequency_hz, periods),
    )


def _length(records: int, seconds: float, frequency_hz: float | None, periods: float) -> str:
    """How much is shown: periods of what, or where no frequency is known, for how long."""
    if not frequency_hz:
        return f"{later_words(seconds, 3)} ({records} records)"
    count = {3.0: "three"}.get(periods, f"{periods:g}")
    text = f"{count} periods of {measured(frequency_hz, 0)} Hz"
    return text if records >= ENOUGH * periods else f"{text} ({records} records)"


def _chosen(status: IntArray, size: int, periods: float) -> int:
    """First record of the clearest window in the last part of a regime."""
    changes = np.concatenate([[0], np.cumsum(np.diff(status) != 0)])
    starts = np.arange(int(SETTLED * (len(status) - size)), len(status) - size, max(1, size // 12))
    if not len(starts):
        return len(status) - size
    excess = np.abs(changes[starts + size - 1] - changes[starts] - round(2 * periods))
    best = np.flatnonzero(excess == excess.min())
    return int(starts[best[-1]])


def status_spans(trajectory: Trajectory, part: slice, contact: int = 0) -> list[tuple[str, float, float]]:
    """Stretches of equal status inside a part of a run: name, start and end [s]."""
    status, time = trajectory.status[part, contact], trajectory.time[part]
    if not len(status):
        return []
    edges = np.concatenate([[0], np.flatnonzero(np.diff(status)) + 1, [len(status)]])
    ends = np.append(time, time[-1] + trajectory.sampling)
    return [(STATUS[int(status[a])], float(ends[a]), float(ends[b])) for a, b in pairwise(edges)]


def shown_motion(trajectory: Trajectory) -> tuple[int, str] | None:
    """Number of the watched point whose motion is shown, and along which axis: the first that moves at all, along the
    first axis along which it does. None where all are held: a freedom that a support takes is exactly zero."""
    moving = (trajectory.acceleration != 0).any(axis=0)
    for number, along in np.argwhere(moving):
        return int(number), "xyz"[int(along)]
    return None

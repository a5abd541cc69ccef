"""What a run has settled to: frequency and amplitude of its strongest line, where it has stopped growing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..modal.results import ComplexModes
from ..temporal.growth import Growth
from ..temporal.signals import line_frequency
from ..temporal.trajectory import Trajectory
from .kept import Plain

TAIL = 0.25  # of the last phase: what is looked at
PARTS = 4  # of the tail, whose amplitudes are held against one another
LEAST_PERIODS = 5.0  # of the line, in each of them
STEADY = 0.01  # of the amplitude: by how much it may differ between them where its growth was over before it was seen
SHOWN = 0.1  # growth rate times the tail: what would show there
AT_REST = 1e-9  # of the largest velocity in the phase: what no longer swings


@dataclass(frozen=True)
class SettledVelocity:
    """The velocity of a watched point, in the direction in which it is largest, over the last quarter of a run that has
    saturated: ``point`` and ``direction`` ("x", "y", "z"), frequency_hz of its strongest line, amplitude [m/s] half its
    range, and spread, by how much that differs between four parts of the quarter, relative."""

    point: str
    direction: str
    frequency_hz: float
    amplitude: float
    spread: float

    @property
    def data(self) -> Plain:
        """Plain values, as they are kept."""
        return dict(vars(self))


def last_rate(modes: ComplexModes) -> float:
    """The growth rate [1/s] at the first μ of the mode that grows fastest, or dies out last; 0 where there is none."""
    rates = modes.growth_rate[0]
    return float(rates.max()) if rates.size else 0.0


def settled_velocity(
    run: Trajectory, dominant_hz: float | None, fitted: Growth | None, rate: float
) -> tuple[SettledVelocity | None, str]:
    """What a run has settled to, by its dominant line and the growth of that (`dominant_response`); else why nothing
    can be said.

    It has saturated where the line has grown and stopped, or does not change although it would at the rate [1/s] of the
    mode that grows fastest (or dies out last).
    """
    if dominant_hz is None or fitted is None:
        return None, "the run is too short to tell whether it has saturated"
    if not run.watch_names:
        return None, "no point is watched in the run"
    part = run.phase_slice()
    tail = slice(part.stop - int(TAIL * (part.stop - part.start)), part.stop)
    direction = int(np.argmax(np.ptp(run.velocity[part, 0], axis=0)))
    signal = run.velocity[tail, 0, direction]
    if len(signal) * run.sampling * dominant_hz < PARTS * LEAST_PERIODS:
        return None, "the run is too short behind its growth to tell what it has settled to"
    halves = np.array([0.5 * float(np.ptp(piece)) for piece in np.array_split(signal, PARTS)])
    amplitude = 0.5 * float(np.ptp(signal))
    if amplitude <= AT_REST * float(np.abs(run.velocity[part, 0, direction]).max(initial=0.0)):
        return None, "the run has come to rest"
    steady = np.ptp(halves) <= STEADY * amplitude and abs(rate) * len(signal) * run.sampling >= SHOWN
    if not (fitted.saturated or steady):
        return None, "the run has not saturated"
    return SettledVelocity(
        run.watch_names[0], "xyz"[direction], line_frequency(signal, run.sampling, dominant_hz), amplitude,
        float(np.ptp(halves)) / amplitude,
    ), ""  # fmt: skip


def settled_of(data: Plain | None) -> SettledVelocity | None:
    """What was kept. Raises KeyError, TypeError or ValueError for what is damaged."""
    if data is None:
        return None
    numbers = (float(data[name]) for name in ("frequency_hz", "amplitude", "spread"))
    return SettledVelocity(str(data["point"]), str(data["direction"]), *numbers)

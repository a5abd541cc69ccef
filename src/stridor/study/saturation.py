"""Whether a run has come to what it settles to, or still grows as the modes say, its spectrum being that of a start."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from ..modal.complex_modes import ComplexModes
from ..temporal.trajectory import Trajectory
from ..typing import IntArray
from .workspace import Workspace

LEAST_RECORDS = 32  # of the last phase
TAIL = 0.25  # of the last phase: what is looked at
SLIP = 2
ROOM = 1.5  # times what is left: how much longer a run is proposed to be


@dataclass(frozen=True)
class Unsaturated:
    """A run in whose last quarter no contact node changed between stick, slip and separation while modes grow.

    growth_rate [1/s] and frequency_hz of the mode that grows fastest; seconds_left: how long it takes at least until
    the vibration of the slip speed is as large as the slip itself, where nodes begin to stick or open: ln(slip speed /
    amplitude)/growth rate, with the amplitude of all that vibrates at the end; None where that cannot be said. phase:
    the last one, and duration [s], what it would have to last about.
    """

    growth_rate: float
    frequency_hz: float
    seconds_left: float | None
    phase: str
    duration: float | None

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return asdict(self)


def unsaturated(work: Workspace, run: Trajectory, modes: ComplexModes | None) -> Unsaturated | None:
    """What is to be said of a run that has not left the linear range, None of one that has, or where nothing grows.

    modes: those at the friction of the run. Contacts with cubic terms may saturate without any change of their nodes:
    nothing is said of those.
    """
    case = work.given
    if modes is None or not run.phases or (case is not None and any(c.cubic for c in case.contacts.values())):
        return None
    growing = np.flatnonzero(modes.unstable[0] & (modes.frequency_hz[0] > 0))
    part = run.phase_slice()
    count = part.stop - part.start
    if not len(growing) or count < LEAST_RECORDS or run.interrupted:
        return None
    tail = slice(part.stop - max(LEAST_RECORDS // 2, int(TAIL * count)), part.stop)
    if not _unchanged(run, float(run.time[tail][0])):
        return None
    fastest = int(growing[np.argmax(modes.growth_rate[0][growing])])
    rate = float(modes.growth_rate[0, fastest])
    left = _seconds_left(run, tail, rate)
    phase = run.phases[-1]
    length = None if left is None else _rounded(phase.end - phase.start + ROOM * left)
    return Unsaturated(rate, float(modes.frequency_hz[0, fastest]), left, phase.name, length)


def _unchanged(run: Trajectory, since: float) -> bool:
    """Whether every contact node, some of which slip, stays as it is from a time [s] on."""
    if run.nodes is not None:
        status: IntArray = run.nodes.status[run.nodes.time >= since]
    else:
        status = run.status[run.time >= since]
    return bool(len(status)) and bool(np.all(status == status[0])) and bool(np.any(status == SLIP))


def _seconds_left(run: Trajectory, tail: slice, rate: float) -> float | None:
    slip = run.slip_speed[tail]
    mean = np.abs(slip.mean(axis=0))
    swing = np.abs(slip - slip.mean(axis=0)).max(axis=0)
    known = (swing > 0) & (mean > swing)
    return float(np.min(np.log(mean[known] / swing[known]))) / rate if known.any() else None


def _rounded(value: float) -> float:
    """Up to two significant digits."""
    power = 10.0 ** (math.floor(math.log10(value)) - 1)
    return float(f"{math.ceil(value / power * (1 - 1e-9)) * power:.6g}")

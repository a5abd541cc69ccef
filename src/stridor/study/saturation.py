"""Whether a run has come to what it settles to, or still grows as the modes say, its spectrum being that of a start."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from ..modal.complex_modes import ComplexModes
from ..temporal.trajectory import Trajectory
from ..typing import Array, IntArray
from .workspace import Workspace

LEAST_RECORDS = 32  # of the last phase
TAIL = 0.25  # of the last phase: what is looked at
SLIP = 2
FEW = 0.1  # of the normal force: what nodes that change may carry, as those do at an edge that hardly presses
ROOM = 1.5  # times what is left: how much longer a run is proposed to be


@dataclass(frozen=True)
class Unsaturated:
    """A run in whose last quarter next to no contact node (by a tenth of the normal force) changed between stick, slip
    and separation while modes grow.

    growth_rate [1/s] and frequency_hz of the mode that grows fastest; seconds_left: about how long it takes until the
    vibration of the contact forces, or of the slip, is as large as these are, where nodes open or stick: ln(1/share of
    the vibration at the end)/growth rate, rests of other modes counted in; None where that cannot be said. phase: the
    last one, and duration [s], what it would have to last about.
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
    """Whether the contact nodes, some of which slip, stay as they are from a time [s] on, but for few."""
    of = run if run.nodes is None else run.nodes
    late = of.time >= since
    status: IntArray = of.status[late]
    if not len(status) or not np.any(status == SLIP):
        return False
    force = np.abs(of.normal_force[late]).mean(axis=0)
    changed = np.any(status != status[0], axis=0)
    return float(force[changed].sum()) <= FEW * float(force.sum())


def _seconds_left(run: Trajectory, tail: slice, rate: float) -> float | None:
    of = run if run.nodes is None else run.nodes
    force = np.abs(of.normal_force[of.time >= run.time[tail][0]])
    share = _share(force, 0.0)
    for slip in run.slip_speed[tail].T:
        share = _share(slip[:, None], share)
    return float(np.log(1.0 / share)) / rate if 0.0 < share < 1.0 else None


def _share(values: Array, least: float) -> float:
    """How far values (s, m) swing about their means, over the means, all together; at least so much."""
    mean = values.mean(axis=0)
    whole = float(np.abs(mean).sum())
    return max(least, float(np.abs(values - mean).max(axis=0).sum()) / whole) if whole > 0.0 else least


def _rounded(value: float) -> float:
    """Up to two significant digits."""
    power = 10.0 ** (math.floor(math.log10(value)) - 1)
    return float(f"{math.ceil(value / power * (1 - 1e-9)) * power:.6g}")

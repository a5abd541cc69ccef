"""What a closed cycle looks like over one period."""

from __future__ import annotations

import numpy as np

from ..temporal.steppers.exact.motion import Anchor
from ..temporal.steppers.exact.outputs import Outputs
from ..temporal.steppers.exact.statuses import GAP
from ..temporal.steppers.exact.statuses import STICK as STUCK
from ..typing import Array
from .cycle import OPEN, SLIP, STICK, Change, Cycle, extremes
from .shooting import ClosedShot, multipliers, started

SAMPLES = 512
KEPT = 16  # of the multipliers
OFTEN = 24  # times of a period of the fastest mode, for ranges
LEAST, MOST = 32, 8192  # of them between two changes


def sampled(closed: ClosedShot, reached_from: str) -> Cycle:
    """The cycle as data."""
    problem = closed.problem
    motion = started(problem, closed.chart, closed.xi, varied=False)
    outputs = Outputs(problem.watch, problem.lift)
    m, w = problem.pairs.count, len(problem.watch)
    times = np.linspace(0.0, closed.period, SAMPLES)
    contacts, watch = np.zeros((SAMPLES, m, 4)), np.zeros((SAMPLES, w, 3))
    status = np.zeros((SAMPLES, m), dtype=np.int64)
    lasting = np.zeros((m, 3))
    least, most = np.full((m, 4), np.inf), np.full((m, 4), -np.inf)
    begun = 0.0
    while True:
        end = motion.reach(closed.period)
        assert motion.anchor is not None
        here = (times >= begun) & (times < end) if end < closed.period else times >= begun
        if here.any():
            contacts[here], watch[here] = _at(outputs, motion.anchor, times[here])
        now = np.array([{GAP: OPEN, STUCK: STICK}.get(s, SLIP) for s in motion.status])
        status[here] = now
        low, high = extremes(_at(outputs, motion.anchor, _often(motion.anchor, begun, end, closed.period))[0])
        least, most = np.minimum(least, low), np.maximum(most, high)
        lasting[np.arange(m), now] += end - begun
        if end >= closed.period:
            break
        begun = end
        motion.passed()
    ways = problem.ways
    rubbed = np.where(lasting[:, OPEN] < closed.period, [least[:, 2], most[:, 2]], 0.0)
    slip = np.sort((rubbed * ways).T, axis=1)
    names = problem.names
    found = multipliers(closed)
    points = [watch[:, :, k].reshape(SAMPLES, w // 2, 2) for k in range(3)]
    return Cycle(
        problem.value, closed.period, closed.residual, found[:KEPT],
        tuple(Change(time, names[c], what, behind) for time, what, c, behind in closed.shot.words),
        names, problem.watch_names, times, contacts[:, :, 0], contacts[:, :, 1] * ways, contacts[:, :, 2] * ways,
        contacts[:, :, 3], status, points[0], points[1], points[2], lasting / closed.period, slip,
        np.stack([least[:, 0], most[:, 0]], axis=1), closed.shot.grazed, closed.shot.landed, reached_from,
    )  # fmt: skip


def _often(anchor: Anchor, begun: float, end: float, period: float) -> Array:
    """Even times between two changes, both included: as often as the period is sampled, and for the fastest mode."""
    fastest = float(np.abs(anchor.watched.flow.split.poles.imag).max(initial=0.0))
    wanted = (end - begun) * max(SAMPLES / period, OFTEN * fastest / (2 * np.pi))
    return np.linspace(begun, end, int(np.clip(wanted, LEAST, MOST)) + 1)


def _at(outputs: Outputs, anchor: Anchor, times: Array) -> tuple[Array, Array]:
    return outputs.values(anchor, np.maximum(times - anchor.time, 0.0))

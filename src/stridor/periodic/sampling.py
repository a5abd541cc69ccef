"""What a closed cycle looks like over one period."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..temporal.steppers.exact.motion import Anchor
from ..temporal.steppers.exact.outputs import Outputs
from ..temporal.steppers.exact.statuses import GAP
from ..temporal.steppers.exact.statuses import STICK as STUCK
from ..typing import Array, IntArray
from .cycle import OPEN, SLIP, STICK, Change, Cycle, extremes, sample_count
from .shooting import ClosedShot, multipliers, started

SAMPLES = 512  # of a period, or more: `sample_count`
ROUNDING = 1e-12  # of the largest normal force: what is as far below zero is zero
KEPT = 16  # of the multipliers
OFTEN = 24  # times of a period of the fastest mode, for ranges
LEAST, MOST = 32, 8192  # of them between two changes


@dataclass(frozen=True)
class _Part:
    """From one change to the next: the motion, from when to when [s], and how each contact (m,) is."""

    anchor: Anchor
    begun: float
    end: float
    status: IntArray


def sampled(closed: ClosedShot, reached_from: str) -> Cycle:
    """The cycle as data."""
    problem = closed.problem
    motion = started(problem, closed.chart, closed.xi, varied=False)
    outputs = Outputs(problem.watch, problem.lift)
    m, w = problem.pairs.count, len(problem.watch)
    parts: list[_Part] = []
    lasting = np.zeros((m, 3))
    least, most = np.full((m, 4), np.inf), np.full((m, 4), -np.inf)
    begun, turning = 0.0, list[Array]()
    while True:
        end = motion.reach(closed.period)
        assert motion.anchor is not None
        told = motion.anchor.watched.flow.told
        now = np.array([{GAP: OPEN, STUCK: STICK}.get(s, SLIP) for s in told], dtype=np.int64)
        parts.append(_Part(motion.anchor, begun, end, now))
        contacts, watch = _at(outputs, motion.anchor, _often(motion.anchor, begun, end, closed.period))
        low, high = extremes(contacts)
        least, most = np.minimum(least, low), np.maximum(most, high)
        turning.append(np.hstack([contacts[:, :, 0], contacts[:, :, 3], watch[:, :, 0]]))
        lasting[np.arange(m), now] += end - begun
        if end >= closed.period:
            break
        begun = end
        motion.passed()
    count = sample_count(np.concatenate(turning), SAMPLES)
    times = np.linspace(0.0, closed.period, count)
    contacts, watch = np.zeros((count, m, 4)), np.zeros((count, w, 3))
    status = np.zeros((count, m), dtype=np.int64)
    for part in parts:
        here = (times >= part.begun) & ((times < part.end) if part.end < closed.period else True)
        if here.any():
            contacts[here], watch[here] = _at(outputs, part.anchor, times[here])
        status[here] = part.status
    # Forces of contacts that open are at rounding where these are open, on either side of zero.
    tiny = ROUNDING * np.maximum(most[:, 0], 0.0)
    for force in (least[:, 0], contacts[:, :, 0]):
        force[(force < 0.0) & (force >= -tiny)] = 0.0
    ways = problem.ways
    rubbed = np.where(lasting[:, OPEN] < closed.period, [least[:, 2], most[:, 2]], 0.0)
    slip = np.sort((rubbed * ways).T, axis=1)
    names = problem.names
    found = multipliers(closed)
    points = [watch[:, :, k].reshape(count, w // 2, 2) for k in range(3)]
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

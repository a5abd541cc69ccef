"""What a closed cycle looks like over one period."""

from __future__ import annotations

import numpy as np

from ..temporal.steppers.exact.motion import Anchor
from ..temporal.steppers.exact.outputs import Outputs
from ..temporal.steppers.exact.statuses import GAP
from ..temporal.steppers.exact.statuses import STICK as STUCK
from ..typing import Array
from .cycle import OPEN, SLIP, STICK, Change, Cycle
from .shooting import ClosedShot, multipliers, started

SAMPLES = 512
KEPT = 16  # of the multipliers


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
        edges = np.array([begun, end])
        found = _at(outputs, motion.anchor, np.concatenate([times[here], edges]))
        contacts[here], watch[here] = found[0][:-2], found[1][:-2]
        now = np.array([{GAP: OPEN, STUCK: STICK}.get(s, SLIP) for s in motion.status])
        status[here] = now
        least, most = np.minimum(least, found[0].min(axis=0)), np.maximum(most, found[0].max(axis=0))
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


def _at(outputs: Outputs, anchor: Anchor, times: Array) -> tuple[Array, Array]:
    return outputs.values(anchor, np.maximum(times - anchor.time, 0.0))

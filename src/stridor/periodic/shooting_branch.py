"""Branches of cycles by shooting, as they are followed over μ.

Unknown are X = (ξ/A, T/T₀, μ/W), with A the amplitude and T₀ the period where a step begins, W the width of the range:

    φ(ξ, T; μ) − ξ = 0,      ẋ₀ᵀ(ξ − ξ₀) = 0,      tᵀ(X − X₀) = 0,

t being the direction of the branch. The derivative by μ is a difference of two motions, kept as long as Newton's method
does well with it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..errors import AnalysisError
from ..temporal.steppers.exact.statuses import STICK
from ..typing import Array
from .chart import Chart
from .continuation import BranchPoint
from .problem import Family
from .returns import same
from .shooting import ENOUGH, ClosedShot, Shot, close, left, shoot, started

BESIDE = 1e-6  # of the range: for differences by μ
GOOD = 1e-9  # of the extent: a corrected point
SLOW = 0.2  # what a step of Newton's method leaves, above which the derivative by μ is found anew
EDGE = 0.2  # of the time between two changes: a cycle that begins nearer to one is begun elsewhere
CORRECTIONS = 9


class ShootingBranch:
    """A branch that is followed within a range (low, high) of μ."""

    def __init__(self, family: Family, between: tuple[float, float]) -> None:
        self.family, self.between = family, between
        self.width = between[1] - between[0]
        self._slope: tuple[Chart, Array] | None = None

    def corrected(self, guess: ClosedShot, heading: Array) -> ClosedShot:
        """The cycle of the branch in the plane through a guess across a heading (s + 2,). Raises AnalysisError where
        Newton's method finds none."""
        chart, xi, period, mu = guess.chart, guess.xi, guess.period, guess.problem.value
        scale = self._scale(guess)
        s, fresh = chart.size, False
        shot = shoot(guess.problem, chart, xi, period)
        normal = shot.start_rate / max(float(np.linalg.norm(shot.start_rate)), 1e-300)
        origin, start = np.concatenate([xi, [period, mu]]) / scale, xi
        off = before = np.inf
        for _ in range(CORRECTIONS):
            problem = self.family.at(mu)
            miss = np.concatenate([shot.end - xi, [normal @ (xi - start)]])
            before, off = off, left(shot, miss)
            if off <= GOOD or (off < ENOUGH and off > 0.5 * before):
                break
            if off > SLOW * before and not fresh:
                self._slope, fresh = None, True
            matrix = np.zeros((s + 2, s + 2))
            matrix[:s, :s] = (shot.matrix - np.eye(s)) * scale[:s]
            matrix[:s, s] = shot.end_rate * scale[s]
            matrix[:s, s + 1] = self._by_mu(chart, xi, period, mu, shot) * scale[s + 1]
            matrix[s, :s] = normal * scale[:s]
            matrix[s + 1] = heading
            here = np.concatenate([xi, [period, mu]]) / scale
            rest = np.append(miss, heading @ (here - origin))
            step = np.linalg.solve(matrix, -rest)
            size = float(np.linalg.norm(step))
            if not np.isfinite(size):
                raise AnalysisError("Newton's method has no direction")
            step = step * min(1.0, 0.3 / max(size, 1e-300))
            unknowns = (here + step) * scale
            xi, period, mu = unknowns[:s], float(unknowns[s]), float(unknowns[s + 1])
            if period <= 0.2 * guess.period or not self.between[0] - self.width <= mu <= self.between[1] + self.width:
                raise AnalysisError("Newton's method leaves the range")
            shot = shoot(self.family.at(mu), chart, xi, period)
        problem = self.family.at(mu)
        residual = left(shot, shot.end - xi)
        if residual > ENOUGH or shot.status != chart.status:
            raise AnalysisError(f"Newton's method ends {residual:.2g} of the extent off a cycle")
        return ClosedShot(problem, chart, xi, period, shot, residual)

    def heading(self, closed: ClosedShot, along: Array) -> Array:
        """The direction of the branch at a cycle, forwards as ``along`` (s + 2,) says."""
        chart, s, scale = closed.chart, closed.chart.size, self._scale(closed)
        shot = closed.shot
        matrix = np.zeros((s + 2, s + 2))
        matrix[:s, :s] = (shot.matrix - np.eye(s)) * scale[:s]
        matrix[:s, s] = shot.end_rate * scale[s]
        slope = self._by_mu(chart, closed.xi, closed.period, closed.problem.value, shot)
        matrix[:s, s + 1] = slope * scale[s + 1]
        matrix[s, :s] = shot.start_rate / max(float(np.linalg.norm(shot.start_rate)), 1e-300) * scale[:s]
        matrix[s + 1] = along
        found = np.linalg.solve(matrix, np.append(np.zeros(s + 1), 1.0))
        return found / np.linalg.norm(found)

    def towards(self, closed: ClosedShot, sense: float) -> Array:
        """A heading to larger (1) or smaller μ (−1)."""
        along = np.zeros(closed.chart.size + 2)
        along[-1] = sense
        self._slope = None
        return self.heading(closed, along)

    def ahead(self, spot: BranchPoint[ClosedShot], length: float) -> ClosedShot:
        """A guess, a length along the branch."""
        closed, s = spot.point, spot.point.chart.size
        scale = self._scale(closed)
        unknowns = np.concatenate([closed.xi, [closed.period, spot.mu]]) + length * spot.heading * scale
        return replace(closed, problem=self.family.at(float(unknowns[-1])), xi=unknowns[:s], period=float(unknowns[s]))

    def forget(self) -> None:
        """The derivative by μ, which is found anew then."""
        self._slope = None

    def _scale(self, closed: ClosedShot) -> Array:
        s = closed.chart.size
        scale = np.full(s + 2, closed.shot.amplitude)
        scale[s], scale[s + 1] = closed.period, self.width
        return scale

    def _by_mu(self, chart: Chart, xi: Array, period: float, mu: float, shot: Shot) -> Array:
        """How the end of the motion (s,) changes with μ."""
        if self._slope is None or self._slope[0] is not chart:
            step = BESIDE * self.width
            beside = shoot(self.family.at(mu + step), chart, xi, period, varied=False)
            self._slope = chart, (beside.end - shot.end) / step
        return self._slope[1]

    def at(self, mu: float, one: ClosedShot, other: ClosedShot) -> ClosedShot:
        """The cycle at a μ between two neighbours. Raises AnalysisError where none is near."""
        share = (mu - one.mu) / (other.mu - one.mu)
        xi = one.xi + share * (other.xi - one.xi)
        return close(self.family.at(mu), one.chart, xi, one.period + share * (other.period - one.period))

    def same(self, one: ClosedShot, other: ClosedShot) -> bool:
        """Whether two cycles at one μ are the same."""
        return same(one, other)

    def vanished(self, closed: ClosedShot) -> bool:
        """Whether no contact changes any more."""
        return not closed.shot.words

    def next_start(self, closed: ClosedShot, heading: Array) -> tuple[ClosedShot, Array]:
        """The cycle and its heading as the next step begins with them."""
        begun = self.begun_elsewhere(closed)
        return (closed, heading) if begun is closed else (begun, self.carried_over(begun, heading))

    def carried_over(self, begun: ClosedShot, heading: Array) -> Array:
        """The heading at a cycle that was begun elsewhere: period and μ change as they did."""
        along = np.zeros(begun.chart.size + 2)
        along[-2:] = heading[-2:] / max(float(np.linalg.norm(heading[-2:])), 1e-300)
        self._slope = None
        return self.heading(begun, along)

    def begun_elsewhere(self, closed: ClosedShot) -> ClosedShot:
        """The cycle, begun amid the longest time without stick if it begins too near to a change."""
        times = [w[0] for w in closed.shot.words]
        if not times:
            return closed
        statuses = [w[3] for w in closed.shot.words]
        parts = [(times[k], times[k + 1] - times[k], statuses[k]) for k in range(len(times) - 1)]
        around = times[0] + closed.period - times[-1]
        parts.append((times[-1], around, statuses[-1]))
        begun, lasting, status = max(parts, key=lambda part: part[1] * (1e-3 if STICK in part[2] else 1.0))
        share = (closed.period - times[-1]) / around
        own = around * (1e-3 if STICK in closed.chart.status else 1.0)
        if EDGE < share < 1 - EDGE and own > 0.4 * lasting * (1e-3 if STICK in status else 1.0):
            return closed
        problem = closed.problem
        motion = started(problem, closed.chart, closed.xi, varied=False)
        end = (begun + 0.5 * lasting) % closed.period
        while motion.reach(end) < end:
            motion.passed()
        assert motion.anchor is not None
        chart = Chart.of(problem, motion.status)
        xi = chart.numbers(*motion.anchor.state(end))
        shot = shoot(problem, chart, xi, closed.period)
        return ClosedShot(problem, chart, xi, closed.period, shot, left(shot, shot.end - xi))

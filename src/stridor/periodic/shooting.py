"""Cycles by shooting: states that a motion comes back to, and how it comes back from beside them.

φ(ξ, T) − ξ = 0 with ẋ₀ᵀ(ξ − ξ₀) = 0 (R. Seydel, Practical Bifurcation and Stability Analysis, Springer 2010, ch. 7), by
Newton's method with the derivative of the exact motion; its eigenvalues are Floquet's multipliers. T = 0 solves that
wherever a motion begins, so what is left is held against how far the motion goes within T, which vanishes with it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import AnalysisError
from ..temporal.steppers.exact.statuses import Status
from ..temporal.steppers.exact.varied import VariedMotion
from ..typing import Array, ComplexArray
from .chart import Chart
from .problem import SlidingProblem

CLOSED = 1e-11  # of the extent: a return that close has come back
ENOUGH = 1e-7  # where rounding lets no step come closer
STEPS = 14
MOST_CHANGES = 4000  # of contact within a period
MOVING = 1e-8  # of the state: a motion that goes no further cannot be told from rounding to ENOUGH
BETWEEN = (0.25, 0.5, 0.75, 1.0)  # of a stretch between two changes: where it is looked how far the motion goes


@dataclass(frozen=True)
class Shot:
    """Where a start of a cycle is after a period: end (s,) and its rate, rate of the start (s,), matrix (s, s) of the
    derivative (empty where not asked for), changes of contact on the way: time, meaning, contact, status behind.

    amplitude: the largest distance from steady sliding at these changes, in the root of energy; extent: the largest
    distance from the start, at the changes and between them, and how large the state itself is (size), in the same;
    both zero where no derivative is asked for. grazed: see `VariedMotion`; landed: how often contacts were brought to
    rest.
    """

    end: Array
    end_rate: Array
    start_rate: Array
    matrix: Array
    words: tuple[tuple[float, str, int, Status], ...]
    status: Status
    amplitude: float
    extent: float
    size: float
    grazed: float
    landed: int


@dataclass(frozen=True)
class ClosedShot:
    """A cycle in its chart: start ξ (s,), period [s], the shot that shows it, and how far from closing it is, in shares
    of its extent."""

    problem: SlidingProblem
    chart: Chart
    xi: Array
    period: float
    shot: Shot
    residual: float

    @property
    def mu(self) -> float:
        """The friction coefficient."""
        return self.problem.value

    @property
    def word(self) -> tuple[tuple[str, int, Status], ...]:
        """The changes of contact of a period, without their times."""
        return tuple((meaning, c, status) for _, meaning, c, status in self.shot.words)


def distance(problem: SlidingProblem, q: Array, v: Array) -> float:
    """How far a state is from steady sliding, in the root of energy."""
    return apart(problem, (q, v), (problem.q, np.zeros_like(v)))


def apart(problem: SlidingProblem, one: tuple[Array, Array], other: tuple[Array, Array]) -> float:
    """How far two states (displacement, velocity) are from one another, in the root of energy."""
    stretched = np.sqrt(np.abs(problem.basis.stiffness)) * (one[0] - other[0])
    return float(np.hypot(np.linalg.norm(stretched), np.linalg.norm(one[1] - other[1])))


def ahead_of(problem: SlidingProblem, motion: VariedMotion, end: float, state: tuple[Array, Array]) -> float:
    """The largest distance from a state within what is known of a motion up to ``end`` [s]."""
    known = motion.reach(end)
    anchor = motion.anchor
    assert anchor is not None
    times = (motion.time + share * (known - motion.time) for share in BETWEEN)
    return max(apart(problem, anchor.state(time), state) for time in times)


def started(problem: SlidingProblem, chart: Chart, xi: Array, *, varied: bool) -> VariedMotion:
    """A motion from a start of a chart."""
    motion = problem.motion()
    q, v = chart.state(xi)
    dq, dv, places = chart.directions
    none = np.zeros((0, 0))
    if varied:
        motion.place(q, v, chart.status, dq, dv, places)
    else:
        motion.place(q, v, chart.status, np.zeros((len(q), 0)), np.zeros((len(q), 0)), none.reshape(0, 0))
        motion.dholds = np.zeros((problem.pairs.count, 0))
    return motion


def shoot(problem: SlidingProblem, chart: Chart, xi: Array, period: float, *, varied: bool = True) -> Shot:
    """A period of motion. Raises AnalysisError where the exact stepper does not pass, where a change only just
    happens, and for more than MOST_CHANGES of them."""
    motion = started(problem, chart, xi, varied=varied)
    if not motion.belongs():
        raise AnalysisError("a force, gap or slip of the start has another sign than its status says")
    motion.reach(0.0)
    v, a, _, _ = motion.at(0.0)
    start_rate = chart.differences(v, a)
    first = chart.state(xi)
    amplitude, extent = distance(problem, *first), 0.0
    while motion.reach(period) < period:
        if varied:
            extent = max(extent, ahead_of(problem, motion, period, first))
        motion.passed()
        amplitude = max(amplitude, distance(problem, motion.q, motion.v))
        if varied:
            extent = max(extent, apart(problem, (motion.q, motion.v), first))
        if len(motion.words) > MOST_CHANGES:
            raise AnalysisError(f"more than {MOST_CHANGES} changes of contact within a period of {period:.6g} s")
    if varied:
        extent = max(extent, ahead_of(problem, motion, period, first))
    v, a, dq, dv = motion.at(period)
    assert motion.anchor is not None
    q, _ = motion.anchor.state(period)
    return Shot(
        chart.numbers(q, v), chart.differences(v, a), start_rate,
        chart.differences(dq, dv) if varied else np.zeros((0, 0)),
        tuple(motion.words), motion.status, amplitude, extent,
        apart(problem, first, (np.zeros_like(first[0]), np.zeros_like(first[1]))), motion.grazed, motion.landed,
    )  # fmt: skip


def close(problem: SlidingProblem, chart: Chart, xi: Array, period: float) -> ClosedShot:
    """The cycle near a start and a period. Raises AnalysisError where Newton's method does not come to one, or to what
    is no limit cycle: rest, or a swing without any change of contact, beside which others swing just so."""
    shot = shoot(problem, chart, xi, period)
    before = residual = left(shot, shot.end - xi)
    for _ in range(STEPS):
        if residual <= CLOSED:
            break
        s = chart.size
        matrix = np.zeros((s + 1, s + 1))
        matrix[:s, :s] = shot.matrix - np.eye(s)
        matrix[:s, s], matrix[s, :s] = shot.end_rate, shot.start_rate / max(np.linalg.norm(shot.start_rate), 1e-300)
        try:
            step = np.linalg.solve(matrix, np.append(xi - shot.end, 0.0))
        except np.linalg.LinAlgError as error:
            raise AnalysisError("the cycle is not isolated: another lies beside it") from error
        share = min(1.0, 0.5 * shot.extent / max(float(np.linalg.norm(step[:s])), 1e-300))
        share = min(share, 0.2 * period / max(abs(float(step[s])), 1e-300))
        found = _shortened(problem, chart, xi, period, step, share, residual)
        if found is None:
            break
        xi, period, shot = found
        before, residual = residual, left(shot, shot.end - xi)
        if residual > 0.5 * before and residual < ENOUGH:
            break
    if residual > ENOUGH or shot.status != chart.status:
        raise AnalysisError(
            f"no cycle closes near a return within {before:.2g} of the extent: Newton's method ends {residual:.2g} off"
        )
    if not shot.words:
        raise AnalysisError("no contact changes in what closes near a return, which is no limit cycle")
    return ClosedShot(problem, chart, xi, period, shot, residual)


def _shortened(
    problem: SlidingProblem, chart: Chart, xi: Array, period: float, step: Array, share: float, residual: float
) -> tuple[Array, float, Shot] | None:
    """A step so short that it comes closer, None where none does."""
    for _ in range(5):
        moved, longer = xi + share * step[:-1], period + share * float(step[-1])
        try:
            shot = shoot(problem, chart, moved, longer)
        except AnalysisError:
            share *= 0.4
            continue
        if left(shot, shot.end - moved) < residual or residual < 1e-9:
            return moved, longer, shot
        share *= 0.4
    return None


def left(shot: Shot, miss: Array) -> float:
    """How much a miss is in shares of the extent; infinite of a motion whose extent is rounding's."""
    if shot.extent <= MOVING * shot.size:
        return float("inf")
    return float(np.linalg.norm(miss)) / shot.extent


def multipliers(closed: ClosedShot) -> ComplexArray:
    """Floquet's multipliers without the one of the motion itself, largest first; complex (s − 1,)."""
    found: ComplexArray = np.linalg.eigvals(closed.shot.matrix).astype(complex)
    # The motion's own is one, but for rounding.
    own = int(np.argmin(np.abs(found - _along(closed))))
    rest = np.delete(found, own)
    return rest[np.argsort(-np.abs(rest), kind="stable")]


def _along(closed: ClosedShot) -> complex:
    """What the matrix multiplies the motion's own direction by: one, but for rounding."""
    rate = closed.shot.start_rate
    return complex(rate @ (closed.shot.matrix @ rate) / max(float(rate @ rate), 1e-300))

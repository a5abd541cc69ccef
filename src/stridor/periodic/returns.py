"""Cycles that a motion runs into: it is followed until it comes back to where it was."""

from __future__ import annotations

import time as clock
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..errors import AnalysisError
from ..temporal.steppers.exact.statuses import GAP, STICK, Status
from ..temporal.steppers.exact.varied import VariedMotion
from ..typing import Array
from .chart import Chart
from .parting import Unclosed, next_change, parting
from .problem import SlidingProblem
from .shooting import ClosedShot, ahead_of, close, distance, multipliers
from .waiting import later_change, outcome

NEAR = 0.01  # of the extent, twice the amplitude of a swing: returns so close are tried
CLOSER = 0.3  # of the last one tried: what is tried next
SURE = 5e-6  # of the extent: a motion that comes back so close is on its cycle
ROUND = 5e-6  # of the extent: a cycle that goes round several times, and once
CHANGES = 4000
LONGEST = 200  # changes in a period that returns are looked for over
SECONDS = 120.0
QUIET = 2000.0  # rad of the slowest mode without any change, before it is asked what the motion heads for
GROWN = 1.2  # of the amplitude at which a mode would first change a contact


class NoReturn(AnalysisError):
    """A motion that was followed to no cycle; steady: it came to steady sliding; unclosed: whether motions beside it
    part from it, where that was followed."""

    def __init__(self, message: str, *, steady: bool = False, unclosed: Unclosed | None = None) -> None:
        super().__init__(message)
        self.steady, self.unclosed = steady, unclosed


@dataclass(frozen=True)
class _Met:
    """A change that was passed: what, when, and the state (2k,) behind it in the root of energy."""

    key: tuple[str, int, Status]
    time: float
    state: Array


def pushed(problem: SlidingProblem, push: float) -> VariedMotion:
    """Steady sliding with every closed contact pushed along its tangent by ``push`` [m/s], along its slip where > 0."""
    motion = problem.motion()
    v = np.zeros_like(problem.q)
    for c, now in enumerate(problem.status):
        if now != GAP:
            t = problem.pairs.tangent[c]
            v = v + push * np.sign(problem.speeds[c]) * t / float(t @ t)
    return _begun(problem, motion, problem.q, v)


def growing(problem: SlidingProblem) -> list[tuple[float, VariedMotion]]:
    """A motion for each growing mode of steady sliding, so large that contacts change: frequency [Hz], the motion."""
    found: list[tuple[float, VariedMotion]] = []
    motion = problem.motion()
    motion.status = problem.status
    watched = motion.watched()
    poles = watched.flow.split.poles
    for j in np.flatnonzero((poles.real > 1e-9 * np.abs(poles)) & (poles.imag > 0.0)):
        begun = problem.motion()
        q, v = excited(problem, int(j), GROWN)
        found.append((float(poles[j].imag) / (2 * np.pi), _begun(problem, begun, q, v)))
    return found


def excited(problem: SlidingProblem, mode: int, size: float) -> tuple[Array, Array]:
    """Steady sliding and a mode of it, ``size`` times as large as what first changes a contact, at the phase at which
    all contacts are furthest from that: displacement and velocity (k,)."""
    motion = problem.motion()
    motion.q, motion.v, motion.status = problem.q.copy(), np.zeros_like(problem.q), problem.status
    watched = motion.watched()
    zeta, slow = watched.flow.enter(motion.q, motion.v, motion.drive(0.0))
    margins = (watched.weights @ zeta).real + watched.slow @ slow
    weights = watched.weights[:, mode]
    acting = np.abs(weights) > 1e-12 * np.abs(watched.weights).max(axis=1, initial=0.0)
    if not np.any(acting):
        raise AnalysisError("the mode changes no contact, however large it grows")
    amount = size * float(np.min(margins[acting] / np.abs(weights[acting])))
    phases = np.exp(1j * np.linspace(0.0, 2 * np.pi, 97)[:-1])
    levels = 1.0 + amount * (weights[acting, None] * phases).real / margins[acting, None]
    zeta = zeta.copy()
    zeta[mode] += amount * phases[int(np.argmax(levels.min(axis=0)))]
    q, v = watched.flow.state(zeta, slow)
    return q, v


def _begun(problem: SlidingProblem, motion: VariedMotion, q: Array, v: Array) -> VariedMotion:
    motion.q, motion.v = q.copy(), v.copy()
    along = problem.pairs.tangent_lift @ problem.piece.displacements @ problem.piece.derivative[:, 0]
    closed = [c for c, now in enumerate(problem.status) if now != GAP]
    motion.start({c: float(problem.pairs.tangent[c] @ v + along[c]) for c in closed})
    return motion


def cycles_reached(
    problem: SlidingProblem, motion: VariedMotion, seconds: float = SECONDS,
    met: Callable[[ClosedShot], None] | None = None,
) -> list[ClosedShot]:
    """The cycle that a motion runs into, behind the unstable ones that it passed near to; ``met`` is given each when it
    is found.

    Raises NoReturn where it comes to rest, or within CHANGES changes of contact or ``seconds`` of processor time near
    to no cycle at all; what ``met`` takes does not count.
    """
    passed: list[_Met] = []
    went: list[float] = []  # how far the motion goes behind each change, up to the next
    found: list[ClosedShot] = []
    tried, nearest = NEAR / CLOSER, np.inf
    scale = np.sqrt(np.abs(problem.basis.stiffness))
    moving = scale[scale > 1e-6 * scale.max(initial=0.0)]
    quiet = QUIET / float(moving.min(initial=1.0) if len(moving) else 1.0)  # [s]
    until = clock.process_time() + seconds  # so that what is found does not hang on what runs beside
    last = ""
    away = distance(problem, motion.q, motion.v)  # from steady sliding, at the last change
    while len(passed) < CHANGES and clock.process_time() < until:
        since = passed[-1].time if passed else 0.0
        if passed:
            went.append(ahead_of(problem, motion, since + quiet, (motion.q, motion.v)))
        change = next_change(motion, since + quiet) or later_change(problem, motion, quiet, until)
        if change is None:
            if found:
                return found
            words, steady = outcome(problem, motion, away, since)
            raise NoReturn(words, steady=steady)
        passed.append(_Met((*change, motion.status), motion.time, np.concatenate([scale * motion.q, motion.v])))
        if not np.isfinite(passed[-1].state @ passed[-1].state):
            raise NoReturn("the motion leaves the range of numbers")
        away = distance(problem, motion.q, motion.v)
        lag, off = _return(passed, went)
        nearest = min(nearest, off)
        if not lag or off >= CLOSER * tried:
            continue
        tried = off
        try:
            closed = _closed(problem, motion, passed, lag)
        except AnalysisError as error:
            last = f"; {error}"
            continue
        if not any(same(closed, other) for other in found):
            found.append(closed)
            if met is not None:
                handed = clock.process_time()
                met(closed)
                until += clock.process_time() - handed
        if off < SURE or np.abs(multipliers(closed)).max(initial=0.0) < 1.0:
            return found
    if found:
        return found
    unclosed = None
    why = f"its {seconds:g} s of computing were over, which says nothing of whether there is a cycle"
    if len(passed) == CHANGES:
        unclosed = parting(problem, motion, CHANGES, quiet, until - clock.process_time())
        why = "the motion is quasi-periodic or chaotic, or takes longer to come to its cycle"
        why = why if unclosed is None else unclosed.words
    raise NoReturn(
        f"no return within {len(passed)} changes of contact, the nearest {nearest:.2g} of its extent off{last}: {why}",
        unclosed=unclosed,
    )  # fmt: skip


def same(one: ClosedShot, other: ClosedShot) -> bool:
    """Whether two cycles of one problem are the same, by period and changes wherever they begin."""
    if abs(one.period - other.period) > 1e-7 * one.period or len(one.word) != len(other.word):
        return False
    twice = other.word * 2
    return not one.word or any(twice[k : k + len(one.word)] == one.word for k in range(len(other.word)))


def _return(met: list[_Met], went: list[float]) -> tuple[int, float]:
    """After how many changes the last state came back, with the same changes twice, and how far off, in shares of how
    far the motion went meanwhile: the least number of those nearly as close as the closest. Changes that accumulate
    come closer and closer, and are no return, as the motion goes less and less far."""
    here = met[-1]
    lags = [
        lag for lag in range(1, min(LONGEST, len(met) // 2) + 1)
        if met[-1 - lag].key == here.key and all(met[-1 - i].key == met[-1 - i - lag].key for i in range(1, lag))
    ]  # fmt: skip
    if not lags:
        return 0, np.inf
    before = np.array([met[-1 - i].state for i in range(1, lags[-1] + 1)])
    away = np.linalg.norm(before - here.state, axis=1)
    extents = np.maximum.accumulate(np.maximum(away, went[: -lags[-1] - 1 : -1]))
    shares = [(lag, float(away[lag - 1]) / max(float(extents[lag - 1]), 1e-300)) for lag in lags]
    found = [(lag, off) for lag, off in shares if np.isfinite(off)]
    if not found:
        return 0, np.inf
    least = min(off for _, off in found)
    return next((lag, off) for lag, off in found if off <= max(3.0 * least, 1e-9))


def _closed(problem: SlidingProblem, motion: VariedMotion, met: list[_Met], lag: int) -> ClosedShot:
    """The cycle of a return of so many changes, begun amid the longest time without stick."""
    period = met[-1].time - met[-1 - lag].time
    parts = [(met[-1 - lag + i], met[-lag + i].time - met[-1 - lag + i].time) for i in range(lag)]
    longest = max(parts, key=lambda part: _worth(part[0].key[2], part[1]))
    ahead = problem.motion()
    _copied(motion, ahead)
    wait = longest[0].time - met[-1 - lag].time + 0.5 * longest[1]
    end = ahead.time + wait
    while ahead.reach(end) < end:
        ahead.passed()
    assert ahead.anchor is not None
    chart = Chart.of(problem, ahead.status)
    return _primitive(close(problem, chart, chart.numbers(*ahead.anchor.state(end)), period))


def _primitive(closed: ClosedShot) -> ClosedShot:
    """The cycle once, where it was found several times round: a motion that comes to it slowly is as near to where it
    was behind several periods as behind one."""
    word = closed.word
    for times in range(len(word), 1, -1):
        part = len(word) // times
        if len(word) % times or word != word[:part] * times:
            continue
        try:
            once = close(closed.problem, closed.chart, closed.xi, closed.period / times)
        except AnalysisError:
            continue
        if np.linalg.norm(once.xi - closed.xi) <= ROUND * once.shot.extent and len(once.word) == part:
            return once
    return closed


def _worth(status: Status, lasting: float) -> float:
    return lasting * (1e-3 if STICK in status else 1.0)


def _copied(one: VariedMotion, other: VariedMotion) -> None:
    """Another motion from the same state, at the time zero."""
    none = np.zeros((len(one.q), 0))
    other.place(one.q, one.v, one.status, none, none, np.zeros((len(one.status), 0)))

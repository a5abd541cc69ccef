"""Cycles that a run in time settles in: from steady sliding where that is unstable, closed by harmonic balance."""

from __future__ import annotations

import math
import time as clock
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from ..errors import AnalysisError
from ..periodic import harmonic as series
from ..periodic.recurrence import ContactPart, Recurrence, recurrences
from ..system import System
from ..temporal.schedule import PhaseSpec
from ..temporal.settings import Settings
from ..temporal.simulate import comes_to, simulate, step_of
from ..temporal.trajectory import Trajectory
from .analyses import modes
from .settings import settings_of
from .workspace import Workspace

PUSHES = (0.05, 3.0)  # of the slip speed: how far steady sliding is pushed off, one after another until one settles
EFOLDS = 5.0  # of growth, to come from there to where contacts change
AGAIN = 2.0  # times as long as it takes to grow by e: what a part of a run lasts
PERIODS = (60.0, 200.0)  # of the mode that grows fastest, at least and at most in a part
PARTS = 8  # of a run, at most
MOST_STEPS = 4_000_000
SAMPLES = 400  # records in a period of that mode
STEPS = 3  # explicit ones between records, at least
MOST_TURNS = 20  # of that mode in a period
NEAR = 0.02  # of its mean swing: a motion that comes back so close is tried
CLOSER = 0.3  # of what was tried last: what is tried next
SURE = 5e-3  # a motion that comes back so close repeats itself
PERIOD, AMPLITUDE = 3e-3, 0.03  # further from the run than this it is another motion
ALIKE = 2e-3, 0.01  # of period and amplitude: as near to one another two are the same, and with few harmonics
BY_HARMONICS = 0.03, 0.3  # over their number, as series follow a friction that jumps no better


class Unsettled(AnalysisError):
    """A run that led to no cycle of its own."""


@dataclass(frozen=True)
class Fastest:
    """The mode that grows fastest: growth rate [1/s] and period [s]."""

    rate: float
    period: float


def fastest(work: Workspace, mu: float) -> Fastest | None:
    """That of steady sliding; None where none that swings grows."""
    found = modes(work, mu)
    growing = np.flatnonzero(found.unstable[0] & (found.frequency_hz[0] > 0.0))
    if not len(growing):
        return None
    k = int(growing[np.argmax(found.growth_rate[0][growing])])
    return Fastest(float(found.growth_rate[0, k]), 1.0 / float(found.frequency_hz[0, k]))


@dataclass(frozen=True)
class Asked:
    """Of the cycles that a run is closed by: harmonics to begin with and at most, the defect beyond which there are
    more."""

    first: int
    most: int
    tolerance: float


class SettledRun:
    """A run at a friction coefficient from steady sliding pushed by ``push`` [m/s], part by part, and cycles that it
    comes near to. seconds: of processor time, for its steps; ``say`` is told what is done."""

    def __init__(
        self, work: Workspace, family: series.HarmonicFamily, mu: float, push: float, seconds: float,
        say: Callable[[str], None],
    ) -> None:  # fmt: skip
        self.work, self.family, self.mu, self.push, self.say = work, family, mu, push, say
        self.seconds, self.spent, self.since = seconds, 0.0, math.inf
        self.late, self.lasted = False, 0.0

    def cycles(
        self, mode: Fastest, asked: Asked, stable: Callable[[series.Balanced], bool | None]
    ) -> Iterator[tuple[series.Balanced, bool]]:
        """Cycles that the run comes so near to that they cannot be told apart, and whether the run stays there.
        Raises Unsettled where it is in none at its end."""
        tried, why = NEAR / CLOSER, ""
        nearest = Recurrence(math.nan, math.inf)
        held: list[series.Balanced] = []  # of which it is not known whether they are stable
        found: list[Recurrence] = []
        for part in self._parts(mode):
            found = recurrences(part, NEAR)
            if not found:
                continue
            least = min(found, key=lambda one: one.off)
            nearest = min(nearest, least, key=lambda one: one.off)
            if least.off >= max(CLOSER * tried, SURE):
                continue
            tried = min(tried, least.off)
            for one in found:
                closed = self._closed(part, one, mode, asked)
                if isinstance(closed, str):
                    why = f"; it was taken for a cycle of {one.period:.6g} s, but {closed}"
                    continue
                closed = next((other for other in held if alike(other, closed)), closed)
                kept = stable(closed)
                if kept or (kept is None and one.off < SURE):
                    yield closed, True
                    return
                if kept is None:
                    held += [] if any(closed is other for other in held) else [closed]
                else:
                    yield closed, False
                    why = "; it passed near to a cycle that is unstable"
            if least.off < SURE:
                break
        for closed in held:
            # Where several rounds come back much nearer than one, the run is not in the cycle of one round.
            stays = not self.late and any(one.off < NEAR and _rounds(one.period, closed) == 1 for one in found[-1:])
            yield closed, stays
            if stays:
                return
            why = "; it passed near to a cycle, but did not stay there"
        raise Unsettled(self._ended(mode, nearest) + why)

    def _closed(self, part: ContactPart, met: Recurrence, mode: Fastest, asked: Asked) -> series.Balanced | str:
        """The cycle of a return; why there is none."""
        turns = max(1, round(met.period / mode.period))
        if turns > MOST_TURNS:
            return f"that holds {turns} periods of the mode, and {MOST_TURNS} at most are closed"
        first, most = asked.first * turns, asked.most * turns
        try:
            closed = series.from_run(self.family, self.mu, part, met.period, first, most, asked.tolerance)
        except AnalysisError as error:
            return str(error)
        return _apart(closed, part, met.period) or closed

    def _ended(self, mode: Fastest, nearest: Recurrence) -> str:
        if self.late:
            return f"its {self.seconds:g} s of computing were over, which says nothing of whether there is a cycle"
        within = f"within {self.lasted / mode.period:.3g} periods of the mode"
        if not math.isfinite(nearest.off):
            return f"it came back to nowhere {within}"
        return (
            f"{within} it came back to within {nearest.off:.2g} of its mean swing at best, after {nearest.period:.6g} s"
        )

    def _parts(self, mode: Fastest) -> Iterator[ContactPart]:
        """What contacts do in one part after another."""
        system = self.work.structured("cycles", self.mu)
        lengths = [EFOLDS / mode.rate + PERIODS[0] * mode.period]
        lengths += [min(max(AGAIN / mode.rate, PERIODS[0] * mode.period), PERIODS[1] * mode.period)] * (PARTS - 1)
        whole = dict.fromkeys(system.loads, 1.0), dict.fromkeys(system.motion.names, 1.0)
        still = {name for name, far in zip(system.motion.names, system.motion.full_distance, strict=True) if far}
        speeds = {name: 1.0 for name in whole[1] if name not in still}
        # Distances, of which nothing is said, are gone from the first part on.
        phases = [PhaseSpec(f"part {k}", length, whole[0], speeds) for k, length in enumerate(lengths, start=1)]
        settings, phases = self._settings(system, mode, phases)
        run: Trajectory | None = None
        for k in range(len(phases)):
            steps = 0 if run is None else run.steps
            planned = steps + round(phases[k].duration / float(settings.step or math.inf))
            if planned > MOST_STEPS:
                raise Unsettled(f"it takes more than {MOST_STEPS} steps of {settings.step:.3g} s to settle")
            self.say(f"run in time at μ = {self.mu:.6g}, part {k + 1} of at most {len(phases)}")
            self.since, begun = math.inf, clock.process_time()
            before = () if run is None else run.phases
            run = simulate(
                system, phases[: k + 1], settings, mu=self.mu, progress=self._progress, restart=run, join=False
            )
            run = replace(run, phases=(*before, *run.phases))  # what the next part goes on from
            if run.interrupted and not self.late:
                raise KeyboardInterrupt
            self.spent += min(clock.process_time() - begun, run.wall_seconds)  # without what was compiled
            if self.late or self.spent > self.seconds:
                self.late = True
                return
            self.lasted += phases[k].duration
            yield self._part(run)

    def _settings(
        self, system: System, mode: Fastest, phases: list[PhaseSpec]
    ) -> tuple[Settings, list[PhaseSpec]]:
        """How it is marched, and the phases in whole steps."""
        settings = replace(
            settings_of(self.work), step=None, beta2=0.5, path="auto", initial="steady-sliding", stepper="auto",
            perturbation=self.push, watch=(), contact="as given",
        )  # fmt: skip
        stepper, _ = comes_to(system, settings, phases)
        settings = replace(settings, stepper=stepper)
        step = step_of(system, settings, phases)
        if stepper == "explicit":  # force and slip jump: between two steps, as far as these tell
            step = min(step, mode.period / (STEPS * SAMPLES))
        every = max(1, round(mode.period / (SAMPLES * step)))
        whole = [replace(p, duration=math.ceil(p.duration / (every * step)) * every * step) for p in phases]
        return replace(settings, step=step, record_every=every), whole

    def _progress(self, done: int, planned: int) -> None:
        del done, planned
        # Before the first call the loop may have been compiled, which takes longer than a run.
        self.since = min(self.since, clock.process_time())
        if self.spent + clock.process_time() - self.since > self.seconds:
            self.late = True
            raise KeyboardInterrupt

    def _part(self, run: Trajectory) -> ContactPart:
        of = run.nodes
        if of is not None and len(of.owner) == self.family.count:
            return ContactPart(of.time, of.normal_force, of.tangential_force, of.gap, of.slip_velocity)
        if run.normal_force.shape[1] != self.family.count:
            raise Unsettled("its records hold the sums of contacts, not their nodes")
        return ContactPart(
            run.time, run.normal_force, run.tangential_force[..., None], run.gap, run.slip_speed[..., None]
        )


def _apart(closed: series.Balanced, part: ContactPart, period: float) -> str:
    """In what a cycle is another motion than the run, "" where in nothing."""
    mine, own = part.amplitudes, series.slip_amplitudes(closed)
    k = int(np.argmax(mine))
    if not _rounds(period, closed):
        return f"the cycle near has a period of {closed.period:.6g} s"
    if abs(own[k] - mine[k]) > AMPLITUDE * mine[k]:
        return f"the cycle near slips by {own[k]:.4g} m/s and the run by {mine[k]:.4g} m/s"
    return ""


def _rounds(period: float, closed: series.Balanced) -> int:
    """How often a time goes round a cycle; 0 where it does not so."""
    rounds = max(1, round(period / closed.period))
    return rounds if abs(rounds * closed.period / period - 1.0) <= PERIOD else 0


def alike(one: series.Balanced, other: series.Balanced) -> bool:
    """Whether two cycles are the same as far as the harmonics of both tell, the other once or several times round."""
    first, second = series.slip_amplitudes(one), series.slip_amplitudes(other)
    rounds = max(1, round(other.period / one.period))
    finer = min(one.harmonics, other.harmonics / rounds)
    near, large = (max(least, share / finer) for least, share in zip(ALIKE, BY_HARMONICS, strict=True))
    return (
        abs(rounds * one.period / other.period - 1.0) <= near
        and float(np.abs(first - second).max()) <= large * float(first.max())
    )

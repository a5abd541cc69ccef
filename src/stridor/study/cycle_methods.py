"""The two ways to limit cycles, as a search takes them: shooting on the exact motion, and harmonic balance."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Literal, Protocol, TypeVar

import numpy as np

from ..errors import AnalysisError, CaseError
from ..periodic import (
    ClosedShot,
    Cycle,
    CycleOnset,
    Family,
    NoReturn,
    ShootingBranch,
    Unclosed,
    born,
    close,
    cycles_reached,
    follow,
    growing,
    pushed,
    same,
    sampled,
    unfinished,
)
from ..periodic import harmonic as series
from ..temporal.steppers.exact.varied import VariedMotion
from ..typing import Array
from .cycle_runs import PUSHES as RUN_PUSHES
from .cycle_runs import Asked, SettledRun, alike, fastest
from .workspace import Workspace

PUSHES = (1.0, 3.0, -1.0)  # of the slip speed: along the slip, and against it, to where it rests
HARMONICS = 7  # to begin with, where the defect is to decide
MOST_HARMONICS = 48
DEFECT = 1e-3  # beyond which there are more
BEYOND = 1.3  # times the onset or the μ: how far a branch is followed for cycles at a μ
SECONDS = 60.0  # for a motion

MethodName = Literal["auto", "shooting", "harmonic"]


@dataclass(frozen=True)
class Unreached:
    """What was tried and led to no cycle, or not to all, in words; expected: as it should, to steady sliding or to the
    end of the range; unclosed: what is known of the motion that closed after no period."""

    words: str
    expected: bool = False
    unclosed: Unclosed | None = None


@dataclass(frozen=True)
class Settled:
    """Where a run in time stays: in the known cycle of that number, or (new) in the last one that it told of; late: its
    time was over."""

    known: int | None = None
    new: bool = False
    late: bool = False


P = TypeVar("P")
L = TypeVar("L")
Say = Callable[[str], None]


class Method(Protocol[P, L]):
    """A way to cycles: what a cycle is while it is sought, P, and what is kept of it, L."""

    name: str
    branch_seconds: float  # of processor time, for following a branch

    def branch(self, between: tuple[float, float]) -> Any:
        """A branch that can be followed within a range of μ (`periodic.continuation.Followed`), and begun both ways."""
        ...

    def born(self, branch: Any, onset: CycleOnset) -> tuple[P, Array]:
        """The first cycle behind an onset, and the heading away from it. Raises AnalysisError where there is none."""
        ...

    def reached(
        self, mu: float, push: Sequence[float] | None, say: Say, told: Callable[[str, P | Unreached], None]
    ) -> None:
        """Tell the cycles at a μ, each when it is found, with what it was reached from, and what led to none."""
        ...

    def sampled(self, cycle: P, said: str) -> Cycle:
        """As data."""
        ...

    def lighter(self, cycle: P) -> L:
        """What is kept of a cycle."""
        ...

    def again(self, kept: L, mu: float) -> P:
        """The cycle near a kept one, at another μ. Raises AnalysisError where there is none."""
        ...

    def same(self, one: P, other: P) -> bool:
        """Whether two cycles at one μ are the same."""
        ...


class Shooting:
    """On the exact motion, from one change of contact to the next. seconds: of processor time for a motion that comes
    back to nowhere."""

    name = "shooting"
    branch_seconds = math.inf

    def __init__(self, family: Family, seconds: float = SECONDS) -> None:
        self.family, self.seconds = family, seconds

    def branch(self, between: tuple[float, float]) -> ShootingBranch:
        """See `Method`."""
        return ShootingBranch(self.family, between)

    def born(self, branch: ShootingBranch, onset: CycleOnset) -> tuple[ClosedShot, Array]:
        """See `Method`."""
        return born(branch, onset.mu, onset.frequency_hz)

    def reached(
        self, mu: float, push: Sequence[float] | None, say: Say, told: Callable[[str, ClosedShot | Unreached], None]
    ) -> None:
        """Where motions come to that begin in each growing mode, and in steady sliding that is pushed."""
        problem = self.family.at(mu)
        begun: list[tuple[str, VariedMotion]] = []
        try:
            begun += [(f"the mode at {frequency:.6g} Hz", motion) for frequency, motion in growing(problem)]
        except AnalysisError as error:
            told("", Unreached(f"μ = {mu:.6g}, from the growing modes: {error}"))
        for speed in [share * problem.sliding_speed for share in PUSHES] if push is None else push:
            try:
                begun.append((f"a push of {speed:.4g} m/s", pushed(problem, speed)))
            except AnalysisError as error:
                told("", Unreached(f"μ = {mu:.6g}, from a push of {speed:.4g} m/s: {error}"))
        for number, (said, motion) in enumerate(begun, start=1):
            say(f"motion {number} of {len(begun)} at μ = {mu:.6g}, from {said}")
            try:
                cycles_reached(problem, motion, self.seconds, partial(told, said))
            except NoReturn as none:
                unclosed = none.unclosed and replace(none.unclosed, reached_from=said)
                told(said, Unreached(f"μ = {mu:.6g}, from {said}: {none}", none.steady, unclosed))
            except AnalysisError as error:
                told(said, Unreached(f"μ = {mu:.6g}, from {said}: {error}"))

    def sampled(self, cycle: ClosedShot, said: str) -> Cycle:
        """See `Method`."""
        return sampled(cycle, said)

    def lighter(self, cycle: ClosedShot) -> ClosedShot:
        """Without its matrix, which is large, and what is asked of it is known by then."""
        return replace(cycle, shot=replace(cycle.shot, matrix=np.zeros((0, 0))))

    def again(self, kept: ClosedShot, mu: float) -> ClosedShot:
        """See `Method`."""
        return close(self.family.at(mu), kept.chart, kept.xi, kept.period)

    def same(self, one: ClosedShot, other: ClosedShot) -> bool:
        """See `Method`."""
        return same(one, other)


class Harmonic:
    """By harmonic balance at the contact nodes. harmonics: None for as many as the defect asks for. onsets: those that
    cycles are looked for from. seconds: of processor time for following a branch."""

    name = "harmonic"

    def __init__(
        self, family: series.HarmonicFamily, onsets: Sequence[CycleOnset], harmonics: int | None,
        seconds: float = math.inf,
    ) -> None:  # fmt: skip
        self.family, self.onsets, self.harmonics, self.branch_seconds = family, onsets, harmonics, seconds

    def branch(self, between: tuple[float, float]) -> series.HarmonicBranch:
        """See `Method`."""
        if self.harmonics is not None:
            return series.HarmonicBranch(between)
        return series.HarmonicBranch(between, tolerance=DEFECT, most=MOST_HARMONICS)

    def born(self, branch: series.HarmonicBranch, onset: CycleOnset) -> tuple[series.Balanced, Array]:
        """See `Method`."""
        return series.born(self.family, branch, onset.mu, onset.frequency_hz, self.harmonics or HARMONICS)

    def reached(
        self, mu: float, push: Sequence[float] | None, say: Say,
        told: Callable[[str, series.Balanced | Unreached], None],
    ) -> None:  # fmt: skip
        """Cycles at a μ on the branches that begin at the onsets."""
        if not self.onsets:
            told("", Unreached(f"μ = {mu:.6g}: no onset of steady sliding from which a branch could lead there"))
        for onset in self.onsets:
            say(f"branch from the onset at μ = {onset.mu:.6g} to μ = {mu:.6g}")
            said = f"along the branch of the onset at μ = {onset.mu:.6g}"
            try:
                met, end = self._through(onset, mu, partial(told, said))
            except (AnalysisError, np.linalg.LinAlgError) as error:
                told(said, Unreached(f"μ = {mu:.6g}, {said}: {error}"))
                continue
            if not met:
                told(said, Unreached(f"μ = {mu:.6g}, {said}: it does not pass there; {end}"))
            elif not end.startswith("it comes to steady sliding"):
                told(said, Unreached(f"μ = {mu:.6g}, {said}: {end}", expected=not unfinished(end)))

    def settled_in_time(
        self, work: Workspace, mu: float, known: Sequence[series.Balanced], say: Say,
        told: Callable[[str, series.Balanced | Unreached], None],
    ) -> Settled:  # fmt: skip
        """What a run in time settles in, where steady sliding is unstable and none of the cycles known is stable."""
        for number, one in enumerate(known):
            if self._stable(one):
                return Settled(number)
        try:
            mode = fastest(work, mu)
        except AnalysisError as error:
            told("", Unreached(f"μ = {mu:.6g}, from a run in time: {error}"))
            return Settled()
        if mode is None:
            return Settled()
        asked = Asked(HARMONICS, MOST_HARMONICS, DEFECT)
        if self.harmonics is not None:
            asked = Asked(self.harmonics, self.harmonics, math.inf)
        for share in RUN_PUSHES:
            push = share * float(self.family.speed.max(initial=0.0))
            run = SettledRun(work, self.family, mu, push, min(self.branch_seconds, SECONDS), say)
            pushed_by = f"from a push of {push:.4g} m/s"
            said, where = f"a run in time at μ = {mu:.6g} {pushed_by}", Settled()
            try:
                for closed, stays in run.cycles(mode, asked, self._stable):
                    had = next((k for k, other in enumerate(known) if alike(other, closed)), None)
                    where = Settled(had, had is None) if stays else where
                    if had is None:  # no branch has it
                        told(said if stays else f"{said}, which passes near to it", closed)
                return where
            except (AnalysisError, CaseError, np.linalg.LinAlgError) as error:
                told(said, Unreached(f"μ = {mu:.6g}, from a run in time {pushed_by}: {error}"))
            if run.late:
                return Settled(late=True)
        return Settled()

    def _stable(self, cycle: series.Balanced) -> bool | None:
        return series.sampled_series(cycle, "").stable

    def _through(self, onset: CycleOnset, mu: float, met: Callable[[series.Balanced], None]) -> tuple[int, str]:
        """Hand on the cycles at a μ of the branch of an onset: how many there are, and how the branch ends."""
        branch = self.branch((0.0, BEYOND * max(mu, onset.mu)))
        first, heading = self.born(branch, onset)
        last, count = [first], [0]

        def seen(closed: series.Balanced, /, *, fold: bool) -> bool:
            before, after = last[0].mu, closed.mu
            if closed.mu == mu or (before - mu) * (after - mu) < 0.0:
                met(closed if closed.mu == mu else branch.at(mu, last[0], closed))
                count[0] += 1
            last[0] = closed
            return True

        end = follow(branch, first, heading, seen, seconds=self.branch_seconds)
        return count[0], end

    def sampled(self, cycle: series.Balanced, said: str) -> Cycle:
        """See `Method`."""
        return series.sampled_series(cycle, said)

    def lighter(self, cycle: series.Balanced) -> series.Kept:
        """See `Method`."""
        return series.kept(cycle)

    def again(self, kept: series.Kept, mu: float) -> series.Balanced:
        """See `Method`."""
        return kept.at(mu)

    def same(self, one: series.Balanced, other: series.Balanced) -> bool:
        """By their orbits, wherever the period begins."""
        return series.same_cycle(one, other)

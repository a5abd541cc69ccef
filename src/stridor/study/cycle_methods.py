"""The two ways to limit cycles, as a search takes them: shooting on the exact motion, and harmonic balance."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, Protocol, TypeVar

import numpy as np

from ..errors import AnalysisError
from ..periodic import (
    Branch,
    Closed,
    Cycle,
    CycleOnset,
    Family,
    NoReturn,
    born,
    close,
    cycles_reached,
    follow,
    growing,
    pushed,
    same,
    sampled,
)
from ..periodic import harmonic as series
from ..temporal.steppers.exact.varied import VariedMotion
from ..typing import Array

PUSHES = (1.0, 3.0)  # of the slip speed
HARMONICS = 7  # to begin with, where the defect is to decide
MOST_HARMONICS = 48
DEFECT = 1e-3  # beyond which there are more
ALIKE = 1e-5  # of period and amplitude
BEYOND = 1.3  # times the onset: how far a branch is followed for cycles at a μ

MethodName = Literal["auto", "shooting", "harmonic"]


@dataclass(frozen=True)
class Unreached:
    """What was tried and led to no cycle, in words; steady: it came to steady sliding, as it should."""

    words: str
    steady: bool = False


P = TypeVar("P")
L = TypeVar("L")
Say = Callable[[str], None]


class Method(Protocol[P, L]):
    """A way to cycles: what a cycle is while it is sought, P, and what is kept of it, L."""

    name: str

    def branch(self, between: tuple[float, float]) -> Any:
        """A branch that can be followed within a range of μ (`periodic.continuation.Followed`), and begun both ways."""
        ...

    def born(self, branch: Any, onset: CycleOnset) -> tuple[P, Array]:
        """The first cycle behind an onset, and the heading away from it. Raises AnalysisError where there is none."""
        ...

    def reached(
        self, mu: float, push: Sequence[float] | None, seconds: float, say: Say
    ) -> Iterator[tuple[str, P | Unreached]]:
        """Cycles at a μ, with what they were reached from, and what led to none."""
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
    """On the exact motion, from one change of contact to the next."""

    name = "shooting"

    def __init__(self, family: Family) -> None:
        self.family = family

    def branch(self, between: tuple[float, float]) -> Branch:
        """See `Method`."""
        return Branch(self.family, between)

    def born(self, branch: Branch, onset: CycleOnset) -> tuple[Closed, Array]:
        """See `Method`."""
        return born(branch, onset.mu, onset.frequency_hz)

    def reached(
        self, mu: float, push: Sequence[float] | None, seconds: float, say: Say
    ) -> Iterator[tuple[str, Closed | Unreached]]:
        """Where motions come to that begin in each growing mode, and in steady sliding that is pushed."""
        problem = self.family.at(mu)
        begun: list[tuple[str, VariedMotion]] = []
        try:
            begun += [(f"the mode at {frequency:.6g} Hz", motion) for frequency, motion in growing(problem)]
        except AnalysisError as error:
            yield "", Unreached(f"μ = {mu:.6g}, from the growing modes: {error}")
        for speed in [share * problem.sliding_speed for share in PUSHES] if push is None else push:
            try:
                begun.append((f"a push of {speed:.4g} m/s", pushed(problem, speed)))
            except AnalysisError as error:
                yield "", Unreached(f"μ = {mu:.6g}, from a push of {speed:.4g} m/s: {error}")
        for number, (said, motion) in enumerate(begun, start=1):
            say(f"motion {number} of {len(begun)} at μ = {mu:.6g}, from {said}")
            try:
                for closed in cycles_reached(problem, motion, seconds):
                    yield said, closed
            except NoReturn as none:
                yield said, Unreached(f"μ = {mu:.6g}, from {said}: {none}", none.steady)
            except AnalysisError as error:
                yield said, Unreached(f"μ = {mu:.6g}, from {said}: {error}")

    def sampled(self, cycle: Closed, said: str) -> Cycle:
        """See `Method`."""
        return sampled(cycle, said)

    def lighter(self, cycle: Closed) -> Closed:
        """Without its matrix, which is large, and what is asked of it is known by then."""
        return replace(cycle, shot=replace(cycle.shot, matrix=np.zeros((0, 0))))

    def again(self, kept: Closed, mu: float) -> Closed:
        """See `Method`."""
        return close(self.family.at(mu), kept.chart, kept.xi, kept.period)

    def same(self, one: Closed, other: Closed) -> bool:
        """See `Method`."""
        return same(one, other)


class Harmonic:
    """By harmonic balance at the contact nodes. harmonics: None for as many as the defect asks for. onsets: those that
    cycles are looked for from."""

    name = "harmonic"

    def __init__(self, family: series.HarmonicFamily, onsets: Sequence[CycleOnset], harmonics: int | None) -> None:
        self.family, self.onsets, self.harmonics = family, onsets, harmonics

    def branch(self, between: tuple[float, float]) -> series.HarmonicBranch:
        """See `Method`."""
        if self.harmonics is not None:
            return series.HarmonicBranch(between)
        return series.HarmonicBranch(between, tolerance=DEFECT, most=MOST_HARMONICS)

    def born(self, branch: series.HarmonicBranch, onset: CycleOnset) -> tuple[series.Balanced, Array]:
        """See `Method`."""
        return series.born(self.family, branch, onset.mu, onset.frequency_hz, self.harmonics or HARMONICS)

    def reached(
        self, mu: float, push: Sequence[float] | None, seconds: float, say: Say
    ) -> Iterator[tuple[str, series.Balanced | Unreached]]:
        """Cycles at a μ on the branches that begin at the onsets: no motions are followed."""
        if not self.onsets:
            yield "", Unreached(f"μ = {mu:.6g}: no onset of steady sliding from which a branch could lead there")
        for onset in self.onsets:
            say(f"branch from the onset at μ = {onset.mu:.6g} to μ = {mu:.6g}")
            said = f"along the branch of the onset at μ = {onset.mu:.6g}"
            met: list[series.Balanced] = []
            try:
                end = self._through(onset, mu, met)
            except AnalysisError as error:
                yield from ((said, found) for found in met)
                yield said, Unreached(f"μ = {mu:.6g}, {said}: {error}")
                continue
            except KeyboardInterrupt:
                yield from ((said, found) for found in met)
                raise
            yield from ((said, found) for found in met)
            if not met:
                yield said, Unreached(f"μ = {mu:.6g}, {said}: it does not pass there; {end}")

    def _through(self, onset: CycleOnset, mu: float, met: list[series.Balanced]) -> str:
        """Put the cycles at a μ of the branch of an onset into a list; how the branch ends."""
        branch = self.branch((0.0, max(mu, BEYOND * onset.mu) if mu <= onset.mu else mu))
        first, heading = self.born(branch, onset)
        last = [first]

        def seen(closed: series.Balanced, /, *, fold: bool) -> bool:
            before, after = last[0].mu, closed.mu
            if closed.mu == mu:
                met.append(closed)
            elif (before - mu) * (after - mu) < 0.0:
                met.append(branch.at(mu, last[0], closed))
            last[0] = closed
            return True

        return follow(branch, first, heading, seen)

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
        """By period and amplitude: series of different harmonics are the same as far as these go."""
        finer = min(one.harmonics, other.harmonics)
        near = ALIKE if one.harmonics == other.harmonics else 1.0 / finer**2
        return abs(one.period - other.period) <= near * one.period and (
            abs(one.amplitude - other.amplitude) <= near * one.amplitude
        )

"""Limit cycles of a problem: those that motions run into at some μ, and the branches over a range of it."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import numpy as np

from .. import interrupts
from ..errors import AnalysisError, CaseError
from ..periodic import (
    Closed,
    Cycle,
    CycleOnset,
    Cycles,
    Family,
    NoReturn,
    cycles_reached,
    growing,
    pushed,
    refuse_cycles,
    same,
    sampled,
)
from ..temporal.steppers.exact.varied import VariedMotion
from ..typing import Array
from .analyses import onsets
from .asked import require_friction
from .cycle_branches import Tracer
from .provenance import provenance
from .workspace import Problem, Workspace

PUSHES = (1.0, 3.0)  # of the slip speed
BELOW = 0.05  # of the range: how far below its lowest onset cycles are looked for as well


def cycles(
    problem: Problem,
    mu: float | Sequence[float] | Array | None = None,
    *,
    between: tuple[float, float] | None = None,
    push: float | Sequence[float] | None = None,
    points: int = 120,
    seconds: float = 60.0,
    progress: Callable[[int, str], None] | None = None,
    keep: Callable[[Cycles], None] | None = None,
) -> Cycles:
    """Limit cycles by shooting on the exact motion: at single friction coefficients, or followed over a range of them.

    mu: at each of these, the cycles that motions run into which begin in every growing mode and in steady sliding that
    is pushed. between (low, high) (default, without mu: modal.friction_range): the branches that begin at the onsets of
    steady sliding, through folds, and those of cycles that motions run into just below the lowest onset, at the upper
    end, and at ``mu``. push [m/s]: by how much the slip velocities are pushed off steady sliding (default: one and
    three times the slip speed). points: most cycles of a branch, each way; seconds: of computing, for a motion that
    comes back to nowhere. progress: called with the number of cycles so far and what is done; keep: with what was
    found so far, behind each cycle. Ctrl-C ends the search and gives what was found.

    Cycles to which no motion and no branch leads are not found. Raises CaseError for what the exact stepper does not
    take (up to 4 contacts of one node in the plane, friction that knows no speed) and where nothing slides,
    AnalysisError where steady sliding does not exist.
    """
    started = time.perf_counter()
    work = Workspace.of(problem)
    values = [] if mu is None else [float(value) for value in np.ravel(np.asarray(mu, dtype=float))]
    for value in values:
        require_friction(value)
    pushes = None if push is None else [float(p) for p in np.ravel(np.asarray(push, dtype=float))]
    if pushes is not None and not (pushes and np.all(np.isfinite(pushes)) and np.all(pushes)):
        raise CaseError("push", push, "finite speeds above or below 0 [m/s]")
    if points < 2:
        raise CaseError("points", points, "at least 2 cycles of a branch")
    if not seconds > 0.0:
        raise CaseError("seconds", seconds, "a time > 0 [s]")
    if work.varies:
        raise CaseError("case", "matrices that depend on mu", "cycles of a system whose matrices do not")
    system = work.system()
    refuse_cycles(system)
    if between is None and not values:
        between = work.modal.friction_range
    if between is not None:
        low, high = (float(v) for v in between)
        if not (np.isfinite(low) and np.isfinite(high) and 0.0 <= low < high):
            raise CaseError("between", between, "two finite friction coefficients 0 ≤ low < high")
        between = low, high
    search = _Search(work, between, pushes, points, seconds, progress, keep, started)
    try:
        search.run(values)
    except KeyboardInterrupt:
        interrupts.heard()
        search.interrupted = True
    return search.result()


class _Search:
    """What was found so far."""

    def __init__(
        self, work: Workspace, between: tuple[float, float] | None, pushes: list[float] | None, points: int,
        seconds: float, progress: Callable[[int, str], None] | None, keep: Callable[[Cycles], None] | None,
        started: float,
    ) -> None:  # fmt: skip
        self.work, self.between, self.pushes, self.seconds = work, between, pushes, seconds
        self.progress, self.keep, self.started, self.points = progress, keep, started, points
        self.family = Family(work.system())
        self.tracer = Tracer(self.family, between or (0.0, 1.0), points, self._kept)
        self.onsets: tuple[CycleOnset, ...] = ()
        self.single: list[tuple[Closed, Cycle]] = []
        self.missing: list[str] = []
        self.notes: list[str] = []
        self.interrupted = False
        self.doing = ""

    def run(self, values: list[float]) -> None:
        """Everything that was asked for."""
        looked = list(values)
        if self.between is not None:
            found = onsets(self.work, self.between)
            self.onsets = tuple(CycleOnset(o.mu, o.frequency_hz, o.stabilising) for o in found.onsets)
            self.notes += [] if self.onsets else [f"no onset for μ from {self.between[0]:g} to {self.between[1]:g}"]
            for number, onset in enumerate(self.onsets):
                self._say(f"branch from the onset at μ = {onset.mu:.6g}")
                if missing := self.tracer.from_onset(number, onset, self.onsets):
                    self.missing.append(missing)
            looked += self._more(values)
        for mu in looked:
            self._at(mu)

    def _more(self, values: list[float]) -> list[float]:
        """Where else in the range cycles are looked for."""
        assert self.between is not None
        low, high = self.between
        lowest = min((o.mu for o in self.onsets), default=high)
        below = max(low, lowest - BELOW * (high - low))
        return [mu for mu in dict.fromkeys((below, high)) if mu not in values]

    def _at(self, mu: float) -> None:
        """The cycles that motions run into at a friction coefficient."""
        self._say(f"motions at μ = {mu:.6g}")
        problem = self.family.at(mu)
        begun: list[tuple[str, VariedMotion]] = []
        try:
            begun += [(f"the mode at {frequency:.6g} Hz", motion) for frequency, motion in growing(problem)]
        except AnalysisError as error:
            self.missing.append(f"μ = {mu:.6g}, from the growing modes: {error}")
        speeds = [share * problem.sliding_speed for share in PUSHES] if self.pushes is None else self.pushes
        for speed in speeds:
            try:
                begun.append((f"a push of {speed:.4g} m/s", pushed(problem, speed)))
            except AnalysisError as error:
                self.missing.append(f"μ = {mu:.6g}, from a push of {speed:.4g} m/s: {error}")
        here: list[Closed] = []
        for number, (said, motion) in enumerate(begun, start=1):
            self._say(f"motion {number} of {len(begun)} at μ = {mu:.6g}, from {said}")
            try:
                reached = cycles_reached(problem, motion, self.seconds)
            except NoReturn as none:
                (self.notes if none.steady else self.missing).append(f"μ = {mu:.6g}, from {said}: {none}")
                continue
            except AnalysisError as error:
                self.missing.append(f"μ = {mu:.6g}, from {said}: {error}")
                continue
            for closed in reached:
                if not any(same(closed, other) for other in here):
                    here.append(closed)
                    self._add(closed, said)

    def _add(self, closed: Closed, said: str) -> None:
        """A cycle, with its branch where a range is asked for that holds it."""
        within = self.between is not None and self.between[0] <= closed.problem.value <= self.between[1]
        if within and any(traced.has(closed) for traced in self.tracer.traced):
            return
        if within:
            self._say(f"branch of the cycle at μ = {closed.problem.value:.6g}")
            self.tracer.from_cycle(closed, said, self.onsets)
        else:
            self.single.append((closed, sampled(closed, said)))
            self._kept()

    def _say(self, doing: str) -> None:
        self.doing = doing
        if self.progress is not None:
            self.progress(self._count(), doing)

    def _count(self) -> int:
        return len(self.single) + sum(len(t.cycles) for t in self.tracer.traced)

    def _kept(self) -> bool:
        self._say(self.doing)
        if self.keep is not None:
            self.keep(self.result())
        return True

    def result(self) -> Cycles:
        """All of it: single cycles by μ, then branch after branch."""
        found = [cycle for _, cycle in sorted(self.single, key=lambda one: one[1].mu)]
        branches = []
        for traced in self.tracer.traced:
            if traced.cycles:
                branches.append(traced.result(len(found)))
                found += traced.cycles
        lost = [
            f"branch {k}: {end}" for k, branch in enumerate(branches, start=1) for end in (branch.begins, branch.ends)
            if "could not" in end or "points were made" in end
        ]  # fmt: skip
        made = provenance(
            self.work, "cycles", time.perf_counter() - self.started,
            between=None if self.between is None else list(self.between), push=self.pushes,
            points=self.points,
        )  # fmt: skip
        return Cycles(
            tuple(found), tuple(branches), self.onsets, self.between, (*self.missing, *lost), tuple(self.notes),
            self.interrupted, made,
        )  # fmt: skip

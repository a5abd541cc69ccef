"""Limit cycles of a problem: those that motions run into at some μ, and the branches over a range of it."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from .. import interrupts
from ..asking import FUNCTION, NUMBER, NUMBERS, PAIR, takes
from ..case.fields import MOST
from ..errors import AnalysisError, CaseError
from ..periodic import Cycle, CycleBranch, CycleOnset, Cycles, Family, Unclosed, unfinished, why_not_shooting
from ..periodic.harmonic import HarmonicFamily, why_not_harmonic
from ..system import System
from ..typing import Array
from .analyses import onsets
from .asked import require_friction
from .cycle_branches import Tracer
from .cycle_gaps import MOST_RUNS, NARROW, Ended, Gaps, covered, growing
from .cycle_methods import SECONDS, Harmonic, Method, MethodName, Shooting, Unreached
from .fingerprint import fingerprint
from .provenance import provenance
from .workspace import Problem, Workspace

MOST_ASKED = 1000  # harmonics
METHODS = ("auto", "shooting", "harmonic")
SHORT = 1e-3  # of the steady sliding of the range, where that ends within it
BELOW = 0.05  # of the range: how far below its lowest onset cycles are looked for as well


@takes(
    between=PAIR.or_none(), harmonics=NUMBER.or_none(), push=NUMBERS.or_none(), points=NUMBER,
    seconds=NUMBER.or_none(), runs=NUMBER, progress=FUNCTION, keep=FUNCTION,
)  # fmt: skip
def cycles(
    problem: Problem,
    mu: float | Sequence[float] | Array | None = None,
    *,
    between: tuple[float, float] | None = None,
    method: MethodName = "auto",
    harmonics: int | None = None,
    push: float | Sequence[float] | None = None,
    points: int = 120,
    seconds: float | None = None,
    runs: int = MOST_RUNS,
    progress: Callable[[int, str], None] | None = None,
    keep: Callable[[Cycles], None] | None = None,
) -> Cycles:
    """Limit cycles: at single friction coefficients, or followed over a range of them.

    method: "shooting" on the exact motion, for up to 4 contacts of one node in the plane; "harmonic" for harmonic
    balance at the contact nodes, up to hundreds of them, in the plane and in space, with friction that varies with the
    slip speed and cubic springs; "auto": shooting where it takes the system. harmonics: of harmonic balance (default:
    as many as its defect asks for).

    mu: at each of these, by shooting the cycles that motions run into which begin in every growing mode and in steady
    sliding that is pushed; by harmonic balance those of the branches that begin at the onsets in modal.friction_range,
    and where none of these is stable and steady sliding is unstable, that in which a run in time settles.
    between (low, high) (default, without mu: modal.friction_range): the branches that begin at the onsets of steady
    sliding, through folds, and by shooting those of cycles that motions run into just below the lowest onset, at the
    upper end, and at ``mu``; then, where steady sliding is unstable and none of these has a stable cycle, those that
    runs in time lead to, at ``runs`` μ at most. push [m/s]: by how much the slip velocities are pushed off steady
    sliding, along the slip where above 0 (default: one and three times the slip speed, and once against it, to where it
    rests). points: most cycles of a branch, each way; seconds: of processor time, by shooting for a motion that comes
    back to nowhere (default: 60), by harmonic balance for following a branch (default: no limit) and a run (60).
    progress: called with the number of cycles so far and what is done; keep: with what was found so far, behind each
    cycle. Ctrl-C ends the search and gives what was found.

    Cycles to which no motion and no branch leads are not found. Raises CaseError for what the method does not take and
    where nothing slides, AnalysisError where steady sliding does not exist.
    """
    started = time.perf_counter()
    mu = require_friction(mu)
    work = Workspace.of(problem)
    values = [] if mu is None else [float(value) for value in np.ravel(np.asarray(mu, dtype=float))]
    pushes = None if push is None else [float(p) for p in np.ravel(np.asarray(push, dtype=float))]
    if pushes is not None and not (pushes and np.all(np.abs(pushes) <= MOST) and np.all(pushes)):
        raise CaseError("push", push, f"finite speeds above or below 0 [m/s], up to {MOST:g}")
    if not (float(points).is_integer() and points >= 2):
        raise CaseError("points", points, "a whole number, at least 2 cycles of a branch")
    if seconds is not None and not seconds > 0.0:
        raise CaseError("seconds", seconds, "a time > 0 [s]")
    if not (float(runs).is_integer() and runs >= 0):
        raise CaseError("runs", runs, "a whole number of runs in time, 0 for none")
    if work.varies:
        raise AnalysisError(
            "cycles: factors of imported matrices depend on mu, and friction in matrices neither sticks nor parts; "
            "give it in [contacts], or take `stridor modes` and `stridor onsets`, which take such factors"
        )
    if harmonics is not None and not (float(harmonics).is_integer() and 1 <= harmonics <= MOST_ASKED):
        raise CaseError("harmonics", harmonics, f"1 to {MOST_ASKED} harmonics")
    chosen = _chosen(work.system(), method, work.temporal.cutoff_hz)
    if harmonics is not None and chosen != "harmonic":
        raise CaseError("harmonics", harmonics, 'harmonics of method "harmonic"; shooting has none')
    if pushes is not None and chosen == "harmonic":
        raise CaseError("push", push, 'pushes of method "shooting"; harmonic balance follows no motions from them')
    if between is None and not values:
        between = work.modal.friction_range
    if between is not None:
        low, high = (float(v) for v in between)
        if not (np.isfinite(low) and np.isfinite(high) and 0.0 <= low < high):
            raise CaseError("between", between, "two finite friction coefficients 0 ≤ low < high")
        require_friction(high, "between")
        between = low, high
    search = _CycleSearch(work, between, chosen, harmonics, pushes, points, seconds, runs, progress, keep, started)
    try:
        search.run(values)
    except KeyboardInterrupt:
        interrupts.heard()
        search.interrupted = True
    return search.result()


def _chosen(system: System, method: str, cutoff_hz: float | None) -> str:
    """The method by which cycles are sought. Raises CaseError where it does not take the system."""
    if method not in METHODS:
        raise CaseError("method", method, ", ".join(METHODS))
    shooting, harmonic = why_not_shooting(system, cutoff_hz), why_not_harmonic(system)
    if method == "auto":
        method = "harmonic" if shooting and not harmonic else "shooting"
    why, other, instead = (
        (shooting, "harmonic", not harmonic) if method == "shooting" else (harmonic, "shooting", not shooting)
    )
    if why:
        takes = "the exact stepper" if method == "shooting" else "harmonic balance"
        remedy = f'; method = "{other}" takes it' if instead else ""
        raise CaseError("case", "no cycles can be sought of it", f"what {takes} takes; {why}{remedy}")
    return method


class _CycleSearch:
    """What was found so far."""

    def __init__(
        self, work: Workspace, between: tuple[float, float] | None, chosen: str, harmonics: int | None,
        pushes: list[float] | None, points: int, seconds: float | None, runs: int,
        progress: Callable[[int, str], None] | None, keep: Callable[[Cycles], None] | None, started: float,
    ) -> None:  # fmt: skip
        self.work, self.between, self.pushes, self.seconds = work, between, pushes, seconds
        self.progress, self.keep, self.started, self.points = progress, keep, started, points
        self.harmonics, self.runs = harmonics, runs
        self.notes: list[str] = list(work.one_for_all)
        self.slides = between or (0.0, math.inf)  # what of the range has steady sliding
        self.method: Method[Any, Any] = self._method(chosen)
        self.tracer = Tracer(self.method, between or (0.0, 1.0), points, self._kept)
        self.onsets: tuple[CycleOnset, ...] = ()
        self.single: list[Cycle] = []
        self.missing: list[str] = []
        self.unclosed: list[Unclosed] = []
        self.interrupted = False
        self.doing, self.filling = "", False

    def _method(self, chosen: str) -> Method[Any, Any]:
        system = self.work.system()
        if chosen == "shooting":
            family = Family(system, self.work.temporal.cutoff_hz)
            if lacking := family.lacking(self.work.modal.max_frequency_hz):
                self.notes.append(lacking)
            return Shooting(family, SECONDS if self.seconds is None else self.seconds)
        known = self._onsets(self.between or self.work.modal.friction_range)
        highest = max((o.frequency_hz for o in known), default=0.0) or self.work.modal.max_frequency_hz
        limit = math.inf if self.seconds is None else self.seconds
        return Harmonic(HarmonicFamily(system, highest), known, self.harmonics, limit)

    def _onsets(self, between: tuple[float, float]) -> tuple[CycleOnset, ...]:
        found = onsets(self.work, between)
        self.slides = found.friction_range
        return tuple(CycleOnset(o.mu, o.frequency_hz, o.stabilising) for o in found.onsets)

    def run(self, values: list[float]) -> None:
        """Everything that was asked for."""
        looked = list(values)
        if self.method.name == "harmonic":
            self.notes.append(
                "harmonic balance follows branches from the onsets, and where none of them has a stable cycle and "
                f"steady sliding is unstable runs in time, over a range at {self.runs} μ at most: cycles that neither "
                "leads to are not looked for"
            )
        if self.between is not None:
            self.onsets = self._onsets(self.between)
            low, high = self.slides
            if (low, high) != self.between:
                self.missing.append(
                    f"there is steady sliding for μ = {low:.6g} to {high:.6g} only: cycles are sought from it"
                )
            self.notes += [] if self.onsets else [f"no onset for μ from {low:g} to {high:g}"]
            for number, onset in enumerate(self.onsets):
                self._say(f"branch from the onset at μ = {onset.mu:.6g}")
                if missing := self.tracer.from_onset(number, onset, self.onsets):
                    self.missing.append(missing)
            looked += self._more(values) if self.method.name == "shooting" else []
        unanswered: list[AnalysisError] = []
        for mu in looked:
            try:
                self._at(mu)
            except AnalysisError as error:  # of this μ: the others have their answers all the same
                unanswered.append(error)
                self.missing.append(f"μ = {mu:.6g}: {error}")
        if self.between is None and unanswered and len(unanswered) == len(looked):
            raise unanswered[0]
        if self.between is not None:
            self._fill()

    def _fill(self) -> None:
        """Runs, or motions of shooting, where over the range steady sliding is unstable and no branch has a stable
        cycle, and the branches of what they come to."""
        low, high = self.slides
        try:
            where = growing(self.work, self._sliding(), self.onsets)
        except AnalysisError as error:
            self.missing.append(f"where steady sliding is unstable is not known: {error}")
            return
        gaps, traced = Gaps(where, NARROW * (high - low)), self.tracer.traced
        self.filling = True
        for number in range(1, self.runs + 1):
            if (chosen := gaps.next(traced)) is None:
                break
            mu, (low, high) = chosen
            self._say(
                f"run {number} of at most {self.runs} in time, at μ = {mu:.6g}: no stable cycle is known between "
                f"μ = {low:.6g} and {high:.6g}"
            )
            try:
                ended = self._run(mu)
            except AnalysisError as error:
                self.missing.append(f"μ = {mu:.6g}: {error}")
                ended = "lost"
            gaps.runs.append((mu, ended))
        self.notes += gaps.trusted(traced)
        (self.missing if self.runs else self.notes).extend(gaps.words(traced))

    def _run(self, mu: float) -> Ended:
        """What a run at a μ comes to, with its branch; how it ended."""
        if not isinstance(self.method, Harmonic):
            self._at(mu)
            met = [part for traced in self.tracer.traced for part in covered(traced)]
            return "stays" if any(low <= mu <= high for low, high in met) else "lost"
        known = [(traced, k, one) for traced in self.tracer.traced for k, one in traced.through(mu)]
        last: list[Any] = []

        def told(said: str, found: Any) -> None:
            if isinstance(found, Unreached):
                self._missed(found)
            else:
                last[:] = [found]
                self._add(found, said)

        settled = self.method.settled_in_time(self.work, mu, [one for _, _, one in known], self._say, told)
        if settled.known is not None:
            traced, k, _ = known[settled.known]
            traced.stays.append((mu, k, k + 1))
            return "stays"
        if settled.new and any(traced.kept_by(last[0]) for traced in self.tracer.traced):
            return "stays"
        return "late" if settled.late else "lost"

    def _missed(self, found: Unreached) -> None:
        (self.notes if found.expected else self.missing).append(found.words)
        self.unclosed += [found.unclosed] if found.unclosed is not None else []

    def _sliding(self) -> tuple[float, float]:
        """The range, as far as it has steady sliding."""
        assert self.between is not None
        low, high = self.slides
        if high < self.between[1]:  # at its very end contacts part at once
            high -= SHORT * (high - low)
        return low, high

    def _more(self, values: list[float]) -> list[float]:
        """Where else in the range cycles are looked for."""
        low, high = self._sliding()
        lowest = min((o.mu for o in self.onsets), default=high)
        below = max(low, lowest - BELOW * (high - low))
        return [mu for mu in dict.fromkeys((below, high)) if mu not in values]

    def _at(self, mu: float) -> None:
        """The cycles at a friction coefficient that the method leads to."""
        self._say(f"motions at μ = {mu:.6g}")
        here: list[Any] = []

        def told(said: str, found: Any) -> None:
            if isinstance(found, Unreached):
                self._missed(found)
            elif not any(self.method.same(found, other) for other in here):
                here.append(found)
                self._add(found, said)

        self.method.reached(mu, self.pushes, self._say, told)
        if isinstance(self.method, Harmonic):
            self.method.settled_in_time(self.work, mu, here, self._say, told)

    def _add(self, closed: Any, said: str) -> None:
        """A cycle, with its branch where a range is asked for that holds it."""
        if self.between is None or not self.between[0] <= closed.mu <= self.between[1]:
            self.single.append(self.method.sampled(closed, said))
            self._kept()
        elif not any(traced.has(closed) for traced in self.tracer.traced):
            self._say(f"branch of the cycle at μ = {closed.mu:.6g}")
            said = said if f"at μ = {closed.mu:.6g}" in said else f"{said} at μ = {closed.mu:.6g}"
            self.tracer.from_cycle(closed, said, self.onsets, joins=self.filling)

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
        found = sorted(self.single, key=lambda one: one.mu)
        branches: list[CycleBranch] = []
        lost: list[str] = []
        for traced in self.tracer.traced:
            if traced.cycles:
                branches.append(traced.result(len(found)))
                found += traced.cycles
                said = [end for end in (traced.begins, traced.ends) if unfinished(end)]
                lost += [f"branch {len(branches)}: {words}" for words in (*said, *traced.unsolved)]
        made = provenance(
            self.work, "cycles", time.perf_counter() - self.started,
            between=None if self.between is None else list(self.between), push=self.pushes,
            points=self.points, method=self.method.name, harmonics=self.harmonics, runs=self.runs,
        )  # fmt: skip
        if self.work.given is not None:
            made["fingerprint"] = fingerprint(self.work.given, None)
        return Cycles(
            tuple(found), tuple(branches), self.onsets, self.between, (*self.missing, *lost), tuple(self.notes),
            self.interrupted, made, tuple(self.unclosed),
        )  # fmt: skip

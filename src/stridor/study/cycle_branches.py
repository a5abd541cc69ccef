"""Branches of cycles of a search: from where they begin, both ways, each once."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from ..errors import AnalysisError
from ..periodic import ROUND, Cycle, CycleBranch, CycleOnset, bifurcations, follow, turning
from .cycle_methods import Method

Kept = Callable[[], bool]
Place = tuple[float, float]  # of a cycle on its branch: μ, period [s]


@dataclass
class Traced:
    """A branch while it is followed: its cycles, closed and as data, which of them are folds, how it ends, folds of it
    that were passed and could not be closed, and where runs in time stay: μ, and the numbers of the cycles before and
    behind (of that cycle twice)."""

    method: Method[Any, Any]
    closed: list[Any] = field(default_factory=list[Any])
    cycles: list[Cycle] = field(default_factory=list[Cycle])
    folds: list[bool] = field(default_factory=list[bool])
    begins: str = ""
    ends: str = "it was stopped"
    onset: int | None = None
    unsolved: list[str] = field(default_factory=list[str])
    reached_from: str = ""
    stays: list[tuple[float, int, int]] = field(default_factory=list[tuple[float, int, int]])
    halves: dict[tuple[Place, Place], tuple[Any, Cycle] | None] = field(
        default_factory=dict[tuple[Place, Place], "tuple[Any, Cycle] | None"]
    )

    def add(self, closed: Any, said: str, *, fold: bool) -> None:
        """Another cycle behind the last."""
        self.cycles.append(self.method.sampled(closed, said))
        self.closed.append(self.method.lighter(closed))
        self.folds.append(fold)

    def reverse(self) -> None:
        """The other way round."""
        for row in (self.closed, self.cycles, self.folds):
            row.reverse()
        self.begins, self.ends = self.ends, self.begins

    def has(self, closed: Any) -> bool:
        """Whether a cycle lies on it: one of the branch, closed at its μ, is the same."""
        near = partial(self._near, closed.period)
        return any(self.method.same(one, closed) for _, one in self.through(closed.mu, near))

    def _near(self, period: float, k: int) -> bool:
        shortest, longest = sorted((self.closed[k].period, self.closed[k + 1].period))
        return shortest * (1 - APART) < period < longest * (1 + APART)

    def through(self, mu: float, near: Callable[[int], bool] = lambda _: True) -> Iterator[tuple[int, Any]]:
        """Its cycles at a μ, closed, from either of the two on both sides, with the number of the first of these."""
        for k in range(len(self.closed) - 1):
            one, other = self.closed[k], self.closed[k + 1]
            if not min(one.mu, other.mu) <= mu <= max(one.mu, other.mu) or not near(k):
                continue
            for start in (one, other):
                try:
                    again = self.method.again(start, mu)
                except (AnalysisError, np.linalg.LinAlgError):
                    continue
                yield k, again

    def halfway(self, one: Cycle, other: Cycle) -> Cycle | None:
        """Its cycle in the middle of the μ of two others, of itself or from here; None where none is closed that lies
        between them. Each is closed once, as what was found is told again and again while a search goes on."""
        low, high = sorted(((one.mu, one.period), (other.mu, other.period)))
        if (low, high) not in self.halves:
            self.halves[low, high] = self._closed_between(low, high)
        found = self.halves[low, high]
        return None if found is None else found[1]

    def _closed_between(self, low: Place, high: Place) -> tuple[Any, Cycle] | None:
        known = {(c.mu, c.period): closed for c, closed in zip(self.cycles, self.closed, strict=True)}
        known |= {(kept[1].mu, kept[1].period): kept[0] for kept in self.halves.values() if kept is not None}
        mu, period = 0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1])
        near = BESIDE * abs(high[1] - low[1]) + SAME * period
        for start in (known[low], known[high]):
            try:
                again = self.method.again(start, mu)
            except (AnalysisError, np.linalg.LinAlgError):
                continue
            if abs(again.period - period) <= near:
                return self.method.lighter(again), self.method.sampled(again, "along its branch")
        return None

    def kept_by(self, closed: Any) -> bool:
        """Note that a run stays in a cycle; False where the branch does not have it."""
        own = [(k, k) for k, one in enumerate(self.closed) if (one.mu, one.period) == (closed.mu, closed.period)]
        own = own or [(k, k + 1) for k, one in self.through(closed.mu) if self.method.same(one, closed)]
        self.stays += [(closed.mu, *own[0])] if own else []
        return bool(own)

    def result(self, first: int) -> CycleBranch:
        """As data; first: the number of its first cycle."""
        folds = turning([c.mu for c in self.cycles], [k for k, fold in enumerate(self.folds) if fold])
        return CycleBranch(
            tuple(range(first, first + len(self.cycles))), self.begins, self.ends, self.onset,
            tuple(first + k for k in folds), bifurcations(self.cycles, folds, self.halfway), self.reached_from,
        )  # fmt: skip


APART = 0.02  # of a period, between two neighbours of a branch
BESIDE, SAME = 0.75, 1e-6  # of the difference of two periods, and of a period: how far from their middle one lies


class Tracer:
    """Follows branches within a range (low, high) of μ, of up to ``points`` cycles each; ``kept`` is called behind each
    cycle, and says whether to go on."""

    def __init__(self, method: Method[Any, Any], between: tuple[float, float], points: int, kept: Kept) -> None:
        self.method, self.between, self.points, self.kept = method, between, points, kept
        self.traced: list[Traced] = []

    def from_onset(self, number: int, onset: CycleOnset, others: tuple[CycleOnset, ...]) -> str:
        """The branch that begins at an onset; why there is none, "" where there is one."""
        branch = self.method.branch(self.between)
        try:
            first, heading = self.method.born(branch, onset)
        except AnalysisError as error:
            return f"no branch was found from the onset at μ = {onset.mu:.6g} ({onset.frequency_hz:.6g} Hz): {error}"
        low, high = self.between
        if not low <= first.mu <= high:
            return f"the branch from the onset at μ = {onset.mu:.6g} leaves the range at once"
        if any(t.has(first) for t in self.traced):
            return ""
        traced = Traced(
            self.method, begins=f"it begins at the onset at μ = {onset.mu:.6g}", onset=number,
            reached_from=f"the onset at μ = {onset.mu:.6g}",
        )  # fmt: skip
        self.traced.append(traced)
        self._follow(branch, traced, first, heading, traced.begins.removeprefix("it "), include=True, others=others)
        return ""

    def from_cycle(self, closed: Any, said: str, others: tuple[CycleOnset, ...], *, joins: bool = False) -> Traced:
        """The branch that a cycle lies on, both ways; ``said``: what the cycle was reached from; joins: up to where it
        comes to another."""
        traced = Traced(self.method, reached_from=said)
        self.traced.append(traced)
        for sense in (-1.0, 1.0):
            branch = self.method.branch(self.between)
            try:
                heading = branch.towards(closed, sense)
            except (AnalysisError, np.linalg.LinAlgError) as error:
                traced.ends = f"it could not be followed beyond μ = {closed.mu:.6g}: {error}"
                heading = None
            if sense < 0.0:
                traced.add(closed, said, fold=False)
                self.kept()
            if heading is not None:
                self._follow(
                    branch, traced, closed, heading, "along its branch", include=False, others=others, joins=joins
                )
            if traced.ends.startswith(ROUND):  # all of it is there: the other way leads over the same cycles
                traced.begins = traced.ends
                break
            if sense < 0.0:
                traced.reverse()
        if traced.onset is None:
            for end in (traced.begins, traced.ends):
                for number, onset in enumerate(others):
                    if end.startswith("it begins at the onset") and f"{onset.mu:.6g}" in end:
                        traced.onset = number
        return traced

    def _follow(
        self, branch: Any, traced: Traced, first: Any, heading: np.ndarray, said: str, *, include: bool,
        others: tuple[CycleOnset, ...], joins: bool = False,
    ) -> None:  # fmt: skip
        joined = ""

        def seen(closed: Any, /, *, fold: bool) -> bool:
            nonlocal joined
            traced.add(closed, said, fold=fold)
            if joins and (number := self._number(closed, traced)):
                joined = f"it comes to branch {number} at μ = {closed.mu:.6g}"
            return self.kept() and not joined

        if include and not seen(first, fold=False):
            return
        limit = self.method.branch_seconds
        traced.ends = follow(branch, first, heading, seen, self.points, limit, traced.unsolved.append)
        traced.ends = joined or traced.ends
        if traced.ends.startswith("it comes to steady sliding"):
            last = traced.cycles[-1]
            for onset in others:
                if abs(onset.frequency_hz - last.frequency_hz) < 0.02 * last.frequency_hz and (
                    abs(onset.mu - last.mu) < 0.1 * branch.width
                ):
                    traced.ends = f"it begins at the onset at μ = {onset.mu:.6g}"

    def _number(self, closed: Any, own: Traced) -> int:
        """That of another branch that has a cycle, counted from 1; 0 where none has."""
        shown = [t for t in self.traced if t.cycles]
        return next((k for k, t in enumerate(shown, start=1) if t is not own and t.has(closed)), 0)

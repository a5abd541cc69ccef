"""Branches of cycles of a search: from where they begin, both ways, each once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..errors import AnalysisError
from ..periodic import Cycle, CycleBranch, CycleOnset, bifurcations, follow, turning
from .cycle_methods import Method

Kept = Callable[[], bool]


@dataclass
class Traced:
    """A branch while it is followed: its cycles, closed and as data, which of them are folds, how it ends, and folds
    of it that were passed and could not be closed."""

    method: Method[Any, Any]
    closed: list[Any] = field(default_factory=list[Any])
    cycles: list[Cycle] = field(default_factory=list[Cycle])
    folds: list[bool] = field(default_factory=list[bool])
    begins: str = ""
    ends: str = "it was stopped"
    onset: int | None = None
    unsolved: list[str] = field(default_factory=list[str])

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
        mu = closed.mu
        for k in range(len(self.closed) - 1):
            one, other = self.closed[k], self.closed[k + 1]
            if not min(one.mu, other.mu) <= mu <= max(one.mu, other.mu):
                continue
            shortest, longest = sorted((one.period, other.period))
            if not shortest * (1 - APART) < closed.period < longest * (1 + APART):
                continue
            for start in (one, other):
                try:
                    if self.method.same(self.method.again(start, mu), closed):
                        return True
                except (AnalysisError, np.linalg.LinAlgError):
                    continue
        return False

    def result(self, first: int) -> CycleBranch:
        """As data; first: the number of its first cycle."""
        folds = turning([c.mu for c in self.cycles], [k for k, fold in enumerate(self.folds) if fold])
        return CycleBranch(
            tuple(range(first, first + len(self.cycles))), self.begins, self.ends, self.onset,
            tuple(first + k for k in folds), bifurcations(self.cycles, folds),
        )  # fmt: skip


APART = 0.02  # of a period, between two neighbours of a branch


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
        traced = Traced(self.method, begins=f"it begins at the onset at μ = {onset.mu:.6g}", onset=number)
        self.traced.append(traced)
        self._follow(branch, traced, first, heading, traced.begins.removeprefix("it "), include=True, others=others)
        return ""

    def from_cycle(self, closed: Any, said: str, others: tuple[CycleOnset, ...]) -> None:
        """The branch that a cycle lies on, both ways."""
        traced = Traced(self.method)
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
            if heading is not None:
                self._follow(branch, traced, closed, heading, "along its branch", include=False, others=others)
            if sense < 0.0:
                traced.reverse()
        if traced.onset is None:
            for end in (traced.begins, traced.ends):
                for number, onset in enumerate(others):
                    if end.startswith("it begins at the onset") and f"{onset.mu:.6g}" in end:
                        traced.onset = number

    def _follow(
        self, branch: Any, traced: Traced, first: Any, heading: np.ndarray, said: str, *, include: bool,
        others: tuple[CycleOnset, ...],
    ) -> None:  # fmt: skip
        def seen(closed: Any, /, *, fold: bool) -> bool:
            traced.add(closed, said, fold=fold)
            return self.kept()

        if include and not seen(first, fold=False):
            return
        limit = self.method.branch_seconds
        traced.ends = follow(branch, first, heading, seen, self.points, limit, traced.unsolved.append)
        if traced.ends.startswith("it comes to steady sliding"):
            last = traced.cycles[-1]
            for onset in others:
                if abs(onset.frequency_hz - last.frequency_hz) < 0.02 * last.frequency_hz and (
                    abs(onset.mu - last.mu) < 0.1 * branch.width
                ):
                    traced.ends = f"it begins at the onset at μ = {onset.mu:.6g}"

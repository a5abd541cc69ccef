"""Where over a range of μ steady sliding is unstable and no branch has a stable cycle, and where runs are begun
there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Literal

from ..periodic import CycleOnset, turning
from .cycle_branches import Traced
from .cycle_runs import fastest
from .workspace import Workspace

MOST_RUNS = 5  # over a range
NARROW = 0.02  # of the range: intervals that are not looked at

Interval = tuple[float, float]
Ended = Literal["stays", "lost", "late"]  # in a cycle, in none, its time was over


def growing(work: Workspace, between: Interval, onsets: Sequence[CycleOnset]) -> list[Interval]:
    """Where within a range of μ a mode of steady sliding that swings grows, as the onsets divide it."""
    low, high = between
    edges = [low, *sorted(o.mu for o in onsets if low < o.mu < high), high]
    return _joined([(a, b) for a, b in pairwise(edges) if fastest(work, 0.5 * (a + b)) is not None])


def covered(traced: Traced, lost: Sequence[float] = ()) -> list[Interval]:
    """Where a branch has stable cycles: at one, between two neighbours that are both stable, and between those of
    undecided stability about one in which a run stays, up to the next fold, cycle that is unstable, or μ of a run that
    was lost: that led to no cycle."""
    mus, stable = [c.mu for c in traced.cycles], [c.stable for c in traced.cycles]
    folds = set(turning(mus, [k for k, fold in enumerate(traced.folds) if fold]))
    pairs = {k for k in range(len(mus) - 1) if stable[k] and stable[k + 1]}

    def stretches(k: int) -> bool:
        """Whether what stays at one end of a pair stays at the other."""
        passed = any(min(mus[k], mus[k + 1]) <= mu <= max(mus[k], mus[k + 1]) for mu in lost)
        return not passed and stable[k] is not False and stable[k + 1] is not False

    for _, first, last in traced.stays:
        if not all(stretches(k) for k in range(first, last)):
            continue
        while first > 0 and first not in folds and stretches(first - 1):
            first -= 1
        while last + 1 < len(mus) and last not in folds and stretches(last):
            last += 1
        pairs |= set(range(first, last))
    single = [(mu, mu) for mu in (*(mu for mu, _, _ in traced.stays), *(c.mu for c in traced.cycles if c.stable))]
    return _joined([*single, *((min(mus[k : k + 2]), max(mus[k : k + 2])) for k in pairs)])


def _joined(intervals: Sequence[Interval]) -> list[Interval]:
    """Those that overlap or touch as one."""
    found: list[Interval] = []
    for low, high in sorted(intervals):
        if found and low <= found[-1][1]:
            found[-1] = found[-1][0], max(high, found[-1][1])
        else:
            found.append((low, high))
    return found


@dataclass
class Gaps:
    """Intervals without a stable cycle. where: steady sliding is unstable; least: narrower ones are left out; runs:
    μ of those that were made, and how each ended."""

    where: list[Interval]
    least: float
    runs: list[tuple[float, Ended]] = field(default_factory=list[tuple[float, Ended]])

    def left(self, branches: Sequence[Traced]) -> list[Interval]:
        """Without what branches cover."""
        found, lost = self.where, [mu for mu, ended in self.runs if ended == "lost"]
        for low, high in (part for branch in branches for part in covered(branch, lost)):
            found = [rest for a, b in found for rest in ((a, min(b, low)), (max(a, high), b)) if rest[1] > rest[0]]
        return [(a, b) for a, b in found if b - a >= self.least]

    def next(self, branches: Sequence[Traced]) -> tuple[float, Interval] | None:
        """The μ of the next run, and the interval that it is to fill: the middle of the widest, cut in two by runs that
        were made. None where there is none: a run for which there was no time says that others there take as long."""
        tried: list[tuple[float, float, Interval]] = []
        for low, high in self.left(branches):
            if any(low <= mu <= high for mu, ended in self.runs if ended == "late"):
                continue
            edges = [low, *sorted(mu for mu, _ in self.runs if low < mu < high), high]
            tried += [(b - a, 0.5 * (a + b), (low, high)) for a, b in pairwise(edges)]
        wide = [one for one in tried if one[0] >= self.least]
        return max(wide)[1:] if wide else None

    def words(self, branches: Sequence[Traced]) -> list[str]:
        """Of the intervals that are left; of those without a run in one sentence."""
        said: dict[str, list[str]] = {}
        for low, high in self.left(branches):
            said.setdefault(self._told(low, high, branches), []).append(f"{low:.6g} and {high:.6g}")
        return [
            f"no stable cycle was found between μ = {', '.join(where)}, where steady sliding is unstable: {told}"
            for told, where in said.items()
        ]

    def trusted(self, branches: Sequence[Traced]) -> list[str]:
        """Of each branch that counts as stable only as a run stays in it: where that is."""
        lost, said = [mu for mu, ended in self.runs if ended == "lost"], list[str]()
        for number, branch in enumerate((b for b in branches if b.cycles), start=1):
            for low, high in covered(branch, lost):
                stays = [f"{mu:.6g}" for mu, _, _ in branch.stays if low <= mu <= high]
                if stays and any(c.stable is None and low <= c.mu <= high for c in branch.cycles):
                    said.append(
                        f"branch {number}: between μ = {low:.6g} and {high:.6g} it is not known of all its cycles "
                        f"whether they are stable; a run in time settles in it at μ = {', '.join(stays)}"
                    )
        return said

    def _told(self, low: float, high: float, branches: Sequence[Traced]) -> str:
        met = sorted((mu, ended) for mu, ended in self.runs if low < mu < high)
        lost, late = (", ".join(f"{mu:.6g}" for mu, ended in met if ended == how) for how in ("lost", "late"))
        told = [f"runs in time at μ = {lost} led to none"] if lost else []
        told += [f"the time of the run at μ = {late} was over"] if late else []
        between = [c for b in branches for c in b.cycles if c.stable is None and low < c.mu < high]
        rest = "; there are cycles of which it is not known whether they are stable" if between else ""
        return f"{'; '.join(told) or 'no run in time was made there'}{rest}"

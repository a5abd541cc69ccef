"""What becomes of followed branches: when they come into the band, and which onset their growth goes back to."""

from __future__ import annotations

from collections.abc import Container, Iterable, Sequence
from dataclasses import dataclass, replace
from math import pi

import numpy as np

from ..typing import ComplexArray, IntArray
from .onset import AT_ONSET, AtTop, Onset
from .tolerances import SPLIT_RELATIVE, UNSTABLE_RELATIVE


@dataclass(frozen=True)
class StabilityChange:
    """A passage into or out of growth, the branches that it concerns, and the onset it was solved to be, if any.

    lost: where none was solved and none had to be, as above the band: by how many eigenvalues more may grow beyond it,
    at least and at most."""

    mu: float
    branches: tuple[int, ...]
    onset: Onset | None
    lost: tuple[int, int] = (0, 0)


class Entries:
    """Where branches come into the band from above its end at the angular frequency top [1/s], and ``passed``: all that
    pass it either way and may grow there."""

    def __init__(self, top: float) -> None:
        self.top = top
        self.found: dict[int, list[tuple[float, float]]] = {}
        self.passed: list[AtTop] = []

    def watch(
        self, between: tuple[float, float], old: ComplexArray, new: ComplexArray, branch: Sequence[int] | IntArray
    ) -> None:
        """Take note of the eigenvalues old (k,) and new (k,) of branches (k,) at two neighbouring μ."""
        came = np.flatnonzero((old.imag > self.top) & (new.imag <= self.top))
        step = between[1] - between[0]
        for i in came.tolist():
            part = float((old.imag[i] - self.top) / (old.imag[i] - new.imag[i]))
            self.found.setdefault(int(branch[i]), []).append((between[0] + part * step, step))
        for i in np.flatnonzero((old.imag > self.top) != (new.imag > self.top)).tolist():
            growth = [float(v.real) / max(abs(v), 1e-300) for v in (old[i], new[i])]
            if max(growth) <= UNSTABLE_RELATIVE:
                continue
            least = 2 if min(growth) > SPLIT_RELATIVE else 0
            up = new[i].imag > self.top
            self.passed.append(AtTop(*between, *((least, 2) if up else (-2, -least))))

    def after(self, branches: tuple[int, ...], mu: float, before: float) -> float | None:
        """The first μ in [mu, before] at which one of these branches comes into the band, to about a step."""
        entering = [
            max(at, mu) for b in branches for at, step in self.found.get(b, []) if at >= mu - step and at <= before
        ]
        return min(entering, default=None)


def reported(
    changes: Iterable[StabilityChange], entries: Entries, between: tuple[float, float], max_frequency_hz: float,
    growing: Container[int] = (),
) -> list[Onset]:  # fmt: skip
    """Onsets of the range in the band, and those above it that begin growth which comes into it; each once.

    An onset that rounding puts just below the low end is at it where growth begins there: where none of its branches is
    among the ``growing`` ones of the low end."""
    low, high = between
    every = list(changes)
    kept: list[Onset] = []
    for change in every:
        onset = change.onset
        if onset is None:
            continue
        begins = not onset.stabilising and not any(b in growing for b in change.branches)
        if begins and low - AT_ONSET * high <= onset.mu < low:
            onset = replace(onset, mu=low)
        if not low <= onset.mu <= high:
            continue
        if onset.frequency_hz > max_frequency_hz:
            if onset.stabilising:
                continue
            ends = _next_end(every, change, onset.mu)
            enters = entries.after(change.branches, onset.mu, min(ends, high))
            if enters is None:
                continue
            onset = replace(onset, enters_at=enters)
        if not any(_same(onset, other) for other in kept):
            kept.append(onset)
    return sorted(kept, key=_order)


def _order(onset: Onset) -> tuple[float, float]:
    return onset.mu, onset.frequency_hz


def _next_end(every: list[StabilityChange], change: StabilityChange, mu: float) -> float:
    """The next μ at which growth of all of these branches ends."""
    ends = [
        other.onset.mu
        for other in every
        if other.onset is not None
        and other.onset.stabilising
        and other.onset.mu > mu
        and set(other.branches) & set(change.branches)
    ]
    return min(ends, default=np.inf)


def _same(one: Onset, other: Onset) -> bool:
    return (
        abs(one.mu - other.mu) <= 1e-7 * max(other.mu, 1e-9)
        and abs(one.frequency_hz - other.frequency_hz) <= 1e-7 * max(other.frequency_hz, 1e-300)
        and one.stabilising == other.stabilising
    )


def unexplained(growing: Iterable[int], from_start: Iterable[int], changes: Iterable[StabilityChange]) -> int:
    """How many of the branches that grow at the end neither grew from the start nor have begun at a solved onset."""
    began = set(from_start)
    last: dict[int, tuple[float, bool]] = {}
    for change in changes:
        if change.onset is None:
            continue
        for b in change.branches:
            if b not in last or last[b][0] <= change.onset.mu:
                last[b] = change.onset.mu, change.onset.stabilising
    return sum(1 for b in growing if (last[b][1] if b in last else b not in began))


def unbalanced(changes: Iterable[StabilityChange], start: ComplexArray, end: ComplexArray) -> int:
    """`imbalance` from growing eigenvalues start (a,) to end (b,) of all branches; 0 where that is not known: halves of
    a pair that has fallen apart on the real axis are not all followed."""
    if not (np.all(start.imag) and np.all(end.imag)):
        return 0
    return imbalance(changes, 2 * (len(end) - len(start)))


def imbalance(changes: Iterable[StabilityChange], grown: int) -> int:
    """By how many more eigenvalues begin than cease to grow at these changes, than the ``grown`` that do of all that
    are followed; 0 where that is not known: modes that are one have onsets that are."""
    every = list(changes)
    solved = [c.onset for c in every if c.onset is not None]
    distinct: list[Onset] = []
    for onset in solved:
        if not any(_same(onset, other) for other in distinct):
            distinct.append(onset)
    began, ended = (
        [sum(o.roots for o in some if o.stabilising is ends) for some in (solved, distinct)] for ends in (False, True)
    )
    least = began[1] + ended[0] + sum(c.lost[0] for c in every)
    most = began[0] + ended[1] + sum(c.lost[1] for c in every)
    return least - grown if grown < least else most - grown if grown > most else 0


def once_each(changes: Iterable[StabilityChange]) -> list[StabilityChange]:
    """The changes without those that are the same onset of the same branches once more."""
    kept: list[StabilityChange] = []
    for change in changes:
        if not _is_one_of(change, kept):
            kept.append(change)
    return kept


def _is_one_of(change: StabilityChange, others: Iterable[StabilityChange]) -> bool:
    """Whether another change is the same onset of the same branches."""
    onset, branches = change.onset, set(change.branches)
    return onset is not None and any(
        other.onset is not None and set(other.branches) == branches and _same(onset, other.onset) for other in others
    )


def crossings(onsets: Sequence[Onset]) -> set[int]:
    """Places in ``onsets`` of those that are no more than undamped modes that cross: rounding makes them meet and part
    again at one place, in either order, and what they do in between is rounding as well, growth of κ√Δμ at most."""
    found: set[int] = set()
    for k, begins in enumerate(onsets):
        for m, ends in enumerate(onsets):
            if begins.stabilising or not ends.stabilising or begins.branches != ends.branches:
                continue
            opens, closes = begins.square_root_coefficient, ends.square_root_coefficient
            if m in found or opens is None or closes is None:
                continue
            grows = max(opens, closes) * np.sqrt(abs(ends.mu - begins.mu))
            if grows <= SPLIT_RELATIVE * 2 * pi * begins.frequency_hz:
                found |= {k, m}
                break
    return found


def without_crossings(changes: Sequence[StabilityChange]) -> list[int]:
    """Places of the changes that are left without modes that cross (`crossings`), found at both branches or at one."""
    solved = [c for c in once_each(changes) if c.onset is not None]
    onsets = [c.onset for c in solved if c.onset is not None]
    gone = [solved[k] for k in crossings(onsets)]
    return [k for k, change in enumerate(changes) if not _is_one_of(change, gone)]

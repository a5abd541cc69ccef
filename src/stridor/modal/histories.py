"""What becomes of followed branches: when they come into the band, and which onset their growth goes back to."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import pi

import numpy as np

from ..typing import ComplexArray, IntArray
from .onset import AT_ONSET, AtTop, Onset
from .tolerances import SPLIT_RELATIVE, UNSTABLE_RELATIVE

ALIKE = 0.05  # of a frequency: how far apart the beginning and the end of a mode's growth within rounding may be
BETWEEN = 7  # values between them at which nothing may grow

Values = Callable[[float], ComplexArray]  # λ (k,) of all that is followed, at μ


@dataclass(frozen=True)
class StabilityChange:
    """A passage into or out of growth, the branches that it concerns, and the onset it was solved to be, if any.

    lost: where none was solved and none had to be, as above the band: by how many eigenvalues more may grow beyond it,
    at least and at most."""

    mu: float
    branches: tuple[int, ...]
    onset: Onset | None
    lost: tuple[int, int] = (0, 0)


@dataclass(frozen=True)
class _Entry:
    """A branch that comes into the band between two neighbouring μ, about at ``at``, and whether it may grow there."""

    low: float
    high: float
    at: float
    grows: bool


@dataclass(frozen=True)
class _HandOver:
    """Between two neighbouring μ one branch ceases to grow and another like it begins to: beside an exceptional point
    it is one growth, and which of the branches has it is a matter of numbering."""

    low: float
    high: float
    to: int


class Entries:
    """Where branches come into the band from above its end at the angular frequency top [1/s], and ``passed``: all that
    pass it either way and may grow there."""

    def __init__(self, top: float) -> None:
        self.top = top
        self.found: dict[int, list[_Entry]] = {}
        self.handed: dict[int, list[_HandOver]] = {}
        self.passed: list[AtTop] = []

    def watch(
        self, between: tuple[float, float], old: ComplexArray, new: ComplexArray, branch: Sequence[int] | IntArray
    ) -> None:
        """Take note of the eigenvalues old (k,) and new (k,) of branches (k,) at two neighbouring μ."""
        step = between[1] - between[0]
        rates = np.array([v.real / np.maximum(np.abs(v), 1e-300) for v in (old, new)])
        grew, growing = rates > UNSTABLE_RELATIVE
        began = np.flatnonzero(~grew & growing)
        for i in np.flatnonzero(grew & ~growing).tolist() if len(began) else ():
            k = int(began[np.argmin(np.abs(new[began] - old[i]))])
            if abs(new[k].imag - old[i].imag) <= ALIKE * abs(old[i]):
                self.handed.setdefault(int(branch[i]), []).append(_HandOver(*between, int(branch[k])))
        for i in np.flatnonzero((old.imag > self.top) != (new.imag > self.top)).tolist():
            grows, up = bool(grew[i] or growing[i]), new[i].imag > self.top
            if not up:
                part = float((old.imag[i] - self.top) / (old.imag[i] - new.imag[i]))
                entry = _Entry(*between, between[0] + part * step, grows)
                self.found.setdefault(int(branch[i]), []).append(entry)
            if not grows:
                continue
            least = 2 if rates[:, i].min() > SPLIT_RELATIVE else 0
            self.passed.append(AtTop(*between, *((least, 2) if up else (-2, -least))))

    def after(self, branches: Iterable[int], mu: float, changes: Sequence[StabilityChange] = ()) -> float | None:
        """The first μ from ``mu`` on, where one of these branches grows, at which it comes into the band with that
        growth, to about a step; changes: among which the onset is where the growth ends, if one was seen.

        It does not where both sides of the step decay, nor behind the end. Of one step with the end that end's
        frequency says which of them is the first. Growth that is handed over to another branch goes on there.
        """
        own, done = set(branches), set[_HandOver]()
        while True:
            end = next_end(changes, own, mu)
            came = self._entry(own, mu, end)
            over = [h for b in own for h in self.handed.get(b, []) if h.high > mu and h not in done]
            over = [h for h in over if end is None or h.high < end.mu]
            first = min(over, key=lambda h: h.low, default=None)
            if first is None or (came is not None and came <= first.low):
                return came
            own, mu = {first.to}, max(mu, first.low)
            done.add(first)

    def _entry(self, branches: set[int], mu: float, end: Onset | None) -> float | None:
        entering: list[float] = []
        for entry in (entry for b in branches for entry in self.found.get(b, [])):
            if entry.high < mu or not (entry.grows or entry.low <= mu):
                continue
            if end is None or entry.high <= end.mu:
                entering.append(max(entry.at, mu))
            elif entry.low <= end.mu and 2 * pi * end.frequency_hz <= self.top:
                entering.append(min(max(entry.at, mu), end.mu))
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
            enters = entries.after(change.branches, onset.mu, every)
            if enters is None or enters > high:
                continue
            onset = replace(onset, enters_at=enters)
        if not any(_same(onset, other) for other in kept):
            kept.append(onset)
    return sorted(kept, key=_order)


def entering(
    growing: Mapping[int, complex], changes: Sequence[StabilityChange], entries: Entries, low: float
) -> tuple[tuple[complex, float], ...]:
    """λ of branches that are ``growing`` above the band where the range begins, by number, and the μ at which they come
    into it with that growth."""
    above = {b: lam for b, lam in growing.items() if lam.imag > entries.top}
    came = {b: entries.after((b,), low, changes) for b in above}
    return tuple((lam, mu) for b, lam in above.items() if (mu := came[b]) is not None)


def _order(onset: Onset) -> tuple[float, float]:
    return onset.mu, onset.frequency_hz


def next_end(every: Iterable[StabilityChange], branches: Iterable[int], mu: float) -> Onset | None:
    """The next onset beyond ``mu`` at which growth of these branches ends."""
    own = set(branches)
    ends = [
        other.onset
        for other in every
        if other.onset is not None and other.onset.stabilising and other.onset.mu > mu and set(other.branches) & own
    ]
    return min(ends, key=_order, default=None)


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


def within_rounding(onsets: Sequence[Onset], values: Values) -> set[int]:
    """Places in ``onsets`` of beginnings and ends between which a mode grows by rounding alone:
    a damping ratio that only touches zero, which Newton's method finds twice beside it, and undamped modes that cross,
    which rounding makes meet and part again at one place, in either order. values: λ at a μ between them.

    With zeros a and b, b − a = w, and slopes s and −s' there the growth between them is that of the cubic, at most
    4/27 (s + s') w; where undamped modes meet it is κ √w at most. Up to a share of |λ| it counts nowhere as growth.
    Beside an exceptional point growth is no cubic, and may be far more than the slopes at its feet tell: therefore it
    is looked at in between.
    """
    found: set[int] = set()
    for k, begins in enumerate(onsets):
        if begins.stabilising:
            continue
        ends = (m for m, o in enumerate(onsets) if o.stabilising and m not in found and _of_one_mode(begins, o))
        for m in sorted(ends, key=lambda m: abs(onsets[m].mu - begins.mu)):
            if _stays_within(begins, onsets[m]) and not _grows_between(begins, onsets[m], values):
                found |= {k, m}
                break
    return found


def _grows_between(begins: Onset, ends: Onset, values: Values) -> bool:
    """Whether a damped mode like theirs is seen to grow beyond rounding between them."""
    if begins.growth_slope is None and ends.growth_slope is None:
        return False  # undamped modes that cross, in either order
    for mu in np.linspace(begins.mu, ends.mu, BETWEEN + 2)[1:-1].tolist():
        lam = values(mu)
        like = np.abs(np.abs(lam.imag) - 2 * pi * begins.frequency_hz) <= ALIKE * 2 * pi * begins.frequency_hz
        if np.any(like & (lam.real > UNSTABLE_RELATIVE * np.abs(lam))):
            return True
    return False


def _of_one_mode(one: Onset, other: Onset) -> bool:
    """Whether two onsets may be of the same mode: by their branches, where numbered, and their frequencies."""
    numbered = any(one.branches) and any(other.branches)
    if numbered and not set(one.branches) & set(other.branches):
        return False
    return abs(one.frequency_hz - other.frequency_hz) <= ALIKE * max(one.frequency_hz, other.frequency_hz)


def _stays_within(begins: Onset, ends: Onset) -> bool:
    """Whether growth between its beginning and its end is rounding (`within_rounding`)."""
    size, width = 2 * pi * begins.frequency_hz, ends.mu - begins.mu
    slopes = [abs(o.growth_slope) for o in (begins, ends) if o.growth_slope is not None]
    opens = [o.square_root_coefficient for o in (begins, ends) if o.growth_slope is None]
    roots = [kappa for kappa in opens if kappa is not None]
    if len(slopes) + len(roots) < 2:
        return False
    grows = max(4 / 27 * sum(slopes) * abs(width), *(kappa * np.sqrt(abs(width)) for kappa in roots), 0.0)
    if not slopes:
        return bool(grows <= SPLIT_RELATIVE * size)
    return bool(width >= 0.0 and grows <= UNSTABLE_RELATIVE * size)


def beyond_rounding(changes: Sequence[StabilityChange], values: Values) -> list[int]:
    """Places of the changes that are left without those of growth within rounding (`within_rounding`), found at both
    branches or at one."""
    solved = [c for c in once_each(changes) if c.onset is not None]
    onsets = [c.onset for c in solved if c.onset is not None]
    gone = [solved[k] for k in within_rounding(onsets, values)]
    return [k for k, change in enumerate(changes) if not _is_one_of(change, gone)]

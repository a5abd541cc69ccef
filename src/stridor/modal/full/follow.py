"""Branches of a family followed over μ on whatever gives its eigenpairs, and what changes on the way."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...errors import AnalysisError
from ..histories import Entries
from ..krylov.follow import BranchState, Follower
from ..krylov.islands import islands
from ..krylov.passages import Passage, crossings, meetings
from .basis import DENSE as SMALL
from .basis import Along
from .foretold import changes_within

BEYOND = 1.1  # modes above the band may meet inside it
STEPS = {False: 30, True: 12}  # over the range at least, on a basis and by full solves
MOST_STEPS = {False: 1500, True: 200}
ENOUGH = {False: 240, True: 60}  # where what grows can be counted instead; twice as many where steps are finer
SMALLEST = 1.01e-9  # step at which the follower goes on whatever it sees


@dataclass(frozen=True)
class Followed:
    """Branches over the range: states at both ends of what was asked for, passages (over t = μ − low), entries into the
    band, and λ and μ of branches that grow above it at the low end and come in; μ where they were unsure, and steps
    (μ, μ) within which slopes foretell that growth begins or ends: what does both in one leaves nothing at its ends."""

    source: Along
    low: BranchState
    high: BranchState
    passages: tuple[Passage, ...]
    entries: Entries
    unsure: tuple[float, ...]
    foretold: tuple[tuple[float, float], ...]
    entering: tuple[tuple[complex, float], ...] = ()


def follower(
    source: Along,
    *,
    finer: int = 1,
    most: int | None = None,
    watch: Callable[[BranchState, BranchState], None] | None = None,
    unsure: Callable[[float], None],
) -> Follower:
    """Follows all branches of a source from where they get their numbers.

    finer: by how much its longest steps are shorter; most: how many steps it may take. unsure is
    called with μ where branches cannot be told apart, equal ones aside. Raises AnalysisError where that takes
    too many steps.
    """
    family, steps = source.family, 0
    most = finer * MOST_STEPS[source.whole] if most is None else most

    def seen(old: BranchState, new: BranchState) -> None:
        nonlocal steps
        steps += 1
        if steps > most:
            raise AnalysisError(f"{steps} steps lead no further than to {_untold(family.low + new.mu)}")
        if new.mu - old.mu <= SMALLEST and not _surely(source, old, new):
            unsure(family.low + new.mu)
        if watch is not None:
            watch(old, new)

    longest = (family.high - family.low) / (finer * STEPS[source.whole])
    return Follower(source, longest=longest, watch=seen)


def surely(source: Along) -> Follower:
    """The same; raises AnalysisError wherever branches cannot be told apart."""

    def refuse(mu: float) -> None:
        raise AnalysisError(_untold(mu))

    return follower(source, unsure=refuse)


def _untold(mu: float) -> str:
    return f"mu = {mu:.6g}, where branches cannot be told apart"


def followed(source: Along, low: float, high: float, top: float, finer: int = 1) -> Followed:
    """Branches from where they get their numbers to the high end of a range of μ, and what changes on the way; top
    [1/s]: the end of the band."""
    family, entries = source.family, Entries(top)
    passages: list[Passage] = []
    unsure: list[float] = []
    foretold: list[tuple[float, float]] = []

    def watch(old: BranchState, new: BranchState) -> None:
        passages.extend(meetings(source, old, new) if family.reversible else crossings(old, new))
        if not source.whole or family.size <= SMALL:  # each look is a full solve where there is no basis
            passages.extend(islands(source, old, new))
        entries.watch((family.low + old.mu, family.low + new.mu), old.values, new.values, range(len(old.index)))
        sides = ((old.found, new.mu - old.mu), (new.found, old.mu - new.mu))
        if any(changes_within(family, found, step, top) for found, step in sides):
            foretold.append((family.low + old.mu, family.low + new.mu))

    most = ENOUGH[source.whole] * min(finer, 2)
    way = follower(source, finer=finer, most=most, watch=watch, unsure=unsure.append)
    first = way.advance(low - family.low)
    last = way.advance(high - family.low)
    return Followed(source, first, last, tuple(passages), entries, tuple(unsure), tuple(foretold))


def _surely(source: Along, old: BranchState, new: BranchState) -> bool:
    """Whether the branches of two states belong together beyond doubt, or are one eigenvalue twice."""
    distance = np.abs(old.coordinate[:, None] - new.coordinate)
    own = distance[np.arange(len(distance)), np.arange(len(distance))]
    np.fill_diagonal(distance, np.inf)
    rounding = 1e-7 * np.abs(new.coordinate) + 1e-12 * source.frequency
    return bool(np.all((own <= 0.3 * distance.min(axis=1, initial=np.inf)) | (own <= rounding)))

"""Branches of cycles over μ by pseudo-arclength, through folds (H. B. Keller 1977; R. Seydel 2010, ch. 4 and 7).

What a cycle is made of (a start and a period, or harmonics and a frequency) its branch knows; here it is a point with
a μ, and the direction in which the branch goes on there, whose last number is that of μ.
"""

from __future__ import annotations

import math
import time as clock
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

import numpy as np

from ..errors import AnalysisError
from ..typing import Array

LARGEST, SMALLEST = 0.05, 1e-5  # steps along the branch, in shares of amplitude, period and range
FIRST = 0.02
MOST = 400  # points
TURN = 0.6  # cosine between two headings
FLAT = 1e-4  # of a heading: a fold
SAME = 1e-9  # of μ or the range: rounding
HALVINGS = 14  # cycles between two others that are closed for one
STOPPED = "it was stopped"
ROUND = "it closes on itself"
UNFINISHED = ("could not be followed", "could not be closed", "points were made", "of computing were over")


class Point(Protocol):
    """A cycle of a branch."""

    @property
    def mu(self) -> float:
        """Its friction coefficient."""
        ...


P = TypeVar("P", bound=Point)
Told = TypeVar("Told", contravariant=True)


@dataclass(frozen=True)
class BranchPoint(Generic[P]):
    """A point of a branch, and the direction in which the branch goes on there."""

    point: P
    heading: Array

    @property
    def mu(self) -> float:
        """The friction coefficient."""
        return self.point.mu


class Followed(Protocol[P]):
    """A branch that can be followed within a range (low, high) of μ."""

    between: tuple[float, float]

    def ahead(self, spot: BranchPoint[P], length: float) -> P:
        """A guess, a length along the branch."""
        ...

    def corrected(self, guess: P, heading: Array) -> P:
        """The cycle in the plane through a guess across a heading. Raises AnalysisError where there is none near."""
        ...

    def heading(self, point: P, along: Array, /) -> Array:
        """The direction of the branch at a cycle, forwards as ``along`` says."""
        ...

    def next_start(self, point: P, heading: Array, /) -> tuple[P, Array]:
        """The cycle and its heading as the next step begins with them."""
        ...

    def at(self, mu: float, one: P, other: P) -> P:
        """The cycle at a μ between two neighbours. Raises AnalysisError where none is near."""
        ...

    def same(self, one: P, other: P, /) -> bool:
        """Whether two cycles at one μ are the same, wherever their periods begin."""
        ...

    def vanished(self, point: P, /) -> bool:
        """Whether the branch has come to steady sliding."""
        ...

    def forget(self) -> None:
        """What is kept from one cycle to the next."""
        ...


class Seen(Protocol[Told]):
    """Is told every cycle of a branch, and whether it is a fold; says whether to go on."""

    def __call__(self, closed: Told, /, *, fold: bool) -> bool: ...


def unfinished(end: str) -> bool:
    """Whether a branch that ended for this reason (`follow`) goes on where it was to be followed."""
    return any(said in end for said in UNFINISHED)


def follow(
    branch: Followed[P],
    first: P,
    heading: Array,
    seen: Seen[P],
    most: int = MOST,
    seconds: float = math.inf,
    unsolved: Callable[[str], None] | None = None,
) -> str:
    """Follow a branch from a cycle until it leaves the range or comes back to that cycle in the same direction, which
    is told again as the last one; why it ended, STOPPED where ``seen`` said so. seconds: of processor time, what
    ``seen`` takes included. unsolved: is told each fold that was passed and not closed."""
    low, high = branch.between
    begun = spot = BranchPoint(first, heading)
    length, away = FIRST, False
    until = clock.process_time() + seconds
    for _ in range(most):
        if clock.process_time() >= until:
            return f"its {seconds:g} s of computing were over at μ = {spot.mu:.6g}"
        try:
            closed = branch.corrected(branch.ahead(spot, length), spot.heading)
            tangent = _tangent(branch, spot, closed)
        except (AnalysisError, np.linalg.LinAlgError) as error:
            length *= 0.4
            if length < SMALLEST:
                return f"it could not be followed beyond μ = {spot.mu:.6g}: {error}"
            continue
        if not low <= closed.mu <= high:
            return _to_the_edge(branch, spot, closed, seen)
        if branch.vanished(closed):
            return f"it comes to steady sliding at μ = {closed.mu:.6g}"
        turns = spot.heading[-1] * tangent[-1] < 0.0
        fold = _fold(branch, spot, length, tangent) if turns else None
        before = closed if fold is None else fold  # up to there μ goes on as it did
        if away and (again := _again(branch, begun, spot.point, before, spot.heading)) is not None:
            seen(again, fold=False)
            return f"{ROUND} at μ = {first.mu:.6g}"
        if turns:
            if fold is None and unsolved is not None:
                unsolved(f"its fold near μ = {spot.mu:.6g} to {closed.mu:.6g} could not be closed, and is not marked")
            if fold is not None and not seen(fold, fold=True):
                return STOPPED
        if fold is not None and away and (again := _again(branch, begun, fold, closed, tangent)) is not None:
            seen(again, fold=False)
            return f"{ROUND} at μ = {first.mu:.6g}"
        if not seen(closed, fold=False):
            return STOPPED
        away = True
        spot = BranchPoint(*branch.next_start(closed, tangent))
        length = min(length * 1.5, LARGEST)
    return f"{most} points were made"


def _again(branch: Followed[P], begun: BranchPoint[P], one: P, other: P, heading: Array) -> P | None:
    """The cycle that a branch began with, closed between two neighbours that μ passes it between as it did then; None
    where it is another."""
    if heading[-1] * begun.heading[-1] <= 0.0 or not min(one.mu, other.mu) <= begun.mu <= max(one.mu, other.mu):
        return None
    if one.mu == other.mu:
        return None
    try:
        found = branch.at(begun.mu, one, other)
    except (AnalysisError, np.linalg.LinAlgError):
        return None
    return found if branch.same(begun.point, found) else None


def _tangent(branch: Followed[P], spot: BranchPoint[P], closed: P) -> Array:
    """The heading at the next cycle. Raises AnalysisError where the branch turned so much that another may be meant."""
    found = branch.heading(closed, spot.heading)
    if float(found @ spot.heading) < TURN:
        raise AnalysisError("the branch turns sharply")
    return found


def _fold(branch: Followed[P], spot: BranchPoint[P], length: float, tangent: Array) -> P | None:
    """The cycle between two at which μ turns back, by regula falsi on the heading, and by halves where no cycle is
    found there or little is gained; None where that fails. At a corner of the branch the heading jumps: then the cycle
    is as near to it as a branch is followed by."""
    low, high = (0.0, float(spot.heading[-1])), (length, float(tangent[-1]))
    halve = False
    for _ in range(HALVINGS):
        middle = 0.5 * (low[0] + high[0]) if halve else low[0] - low[1] * (high[0] - low[0]) / (high[1] - low[1])
        try:
            found = branch.corrected(branch.ahead(spot, middle), spot.heading)
            branch.forget()
            here = float(branch.heading(found, spot.heading)[-1])
        except (AnalysisError, np.linalg.LinAlgError):
            if halve:
                return None
            halve = True
            continue
        before = high[0] - low[0]
        low, high = ((middle, here), high) if here * low[1] > 0.0 else (low, (middle, here))
        if abs(here) < FLAT or high[0] - low[0] < SMALLEST:
            return found
        halve = not halve and high[0] - low[0] > 0.5 * before
    return None


def turning(mus: Sequence[float], folds: Sequence[int]) -> list[int]:
    """Those of the folds (numbers of points of a branch with these μ) that are shown: μ is larger there, or smaller,
    than at the nearest points before and behind that have another. A heading that jumps, as its derivative by μ may, is
    no fold."""
    found: list[int] = []
    for k in folds:
        near = SAME * max(abs(mus[k]), 1e-300)
        before = next((mus[k] - mus[j] for j in range(k - 1, -1, -1) if abs(mus[k] - mus[j]) > near), 0.0)
        behind = next((mus[k] - mus[j] for j in range(k + 1, len(mus)) if abs(mus[k] - mus[j]) > near), 0.0)
        found += [k] if before * behind > 0.0 else []
    return found


def _to_the_edge(branch: Followed[P], spot: BranchPoint[P], beyond: P, seen: Seen[P]) -> str:
    """The cycle at the edge of the range, between the last one and one beyond."""
    edge = branch.between[0] if beyond.mu < branch.between[0] else branch.between[1]
    left = f"it leaves the range at μ = {edge:.6g}; a fold beyond it is not looked for"
    if abs(spot.mu - edge) <= SAME * (branch.between[1] - branch.between[0]):
        return left  # the last one is that cycle
    try:
        closed = branch.at(edge, spot.point, beyond)
    except (AnalysisError, np.linalg.LinAlgError) as error:
        return (
            f"it leaves the range behind μ = {spot.mu:.6g}; its cycle at the edge, μ = {edge:.6g}, could not be "
            f"closed: {error}"
        )
    seen(closed, fold=False)
    return left

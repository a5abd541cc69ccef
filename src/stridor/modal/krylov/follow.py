"""Branches of the projected problem followed over μ.

All eigenpairs are known at every μ, so following is matching: each branch to the eigenvalue its tangent predicts, the
shapes agreeing. Where two meet, their tangents say nothing; they are matched as a pair by their mean a and the square
b of half their difference, which are smooth in μ where the two are not.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy

from ...errors import FollowingError
from ...stages import passing, stage
from ...typing import Array, BoolArray, ComplexArray, IntArray
from ..dense_problem import Eigenpairs, OverNumber
from ..meeting import ROUNDING, beyond, continued, halves, through_zero

CLEAR = 0.3  # an eigenvalue is the predicted one if it is this much nearer than any other
ALIKE = 0.5  # and its shape has at least this much in common
STRAIGHT = 0.1  # of the difference of two values: how far off a straight line they may be and count as crossing
COINCIDENT = 1e-6  # of an eigenvalue: as near as modes are when rounding may exchange them
ASIDE = 0.83  # of a step that ends where modes coincide
SMALLEST_STEP = 1e-9
MOST_TRIED = 600  # steps tried within one of the longest: ten places where modes meet take some 400
NARROW = 1e-5  # step over μ below which two values that pass each other beside zero count as having met
FOLLOWED = 1.25  # branches are followed up to this much above the band


@dataclass(frozen=True)
class BranchState:
    """Branches (b,) at one μ: their indices among the eigenpairs found there."""

    found: Eigenpairs
    index: IntArray

    @property
    def mu(self) -> float:
        """The friction coefficient."""
        return self.found.mu

    @property
    def coordinate(self) -> ComplexArray:
        """x (b,): λ² without damping, else λ."""
        return self.found.coordinate[self.index]

    @property
    def values(self) -> ComplexArray:
        """λ (b,)."""
        return self.found.values[self.index]

    @property
    def tangents(self) -> ComplexArray:
        """dx/dμ (b,)."""
        return self.found.tangents[self.index]


class Follower:
    """Follows branches, numbered by frequency at μ = ``start``, towards larger μ in steps up to ``longest``.

    watch, where given, is called with each accepted pair of neighbouring states. Only the first ``named`` branches (all
    by default) must be beyond doubt at every step.
    """

    def __init__(
        self,
        source: OverNumber,
        *,
        start: float = 0.0,
        longest: float = 0.05,
        named: int | None = None,
        watch: Callable[[BranchState, BranchState], None] | None = None,
    ) -> None:
        self.source = source
        self.longest, self.watch = longest, watch
        found = source.eigenpairs(start)
        followed = np.flatnonzero(np.abs(found.values) <= FOLLOWED * source.frequency)
        order = np.lexsort((np.abs(found.values[followed]), np.abs(found.values[followed].imag)))
        self.state = BranchState(found, followed[order])
        self.named = len(order) if named is None else named
        self._step = longest

    @classmethod
    def resumed(cls, source: OverNumber, state: BranchState) -> Follower:
        """A follower that goes on from a state followed before, and watches nothing."""
        follower = cls.__new__(cls)
        follower.source, follower.state = source, state
        follower.named = len(state.index)
        follower.longest, follower.watch, follower._step = np.inf, None, np.inf
        return follower

    @passing()
    def advance(self, mu: float) -> BranchState:
        """Follow to ``mu``, not below the present one. Raises FollowingError where it gets nowhere."""
        tried, since = 0, self.state.mu
        while self.state.mu < mu:
            left = mu - self.state.mu
            if self.state.mu - since >= self.longest:
                tried, since = 0, self.state.mu
            tried += 1
            if tried > MOST_TRIED:
                at = f"{self.state.mu:.6g}"
                raise FollowingError(f"branches cannot be told apart near μ = {at}: {MOST_TRIED} steps led no further")
            step = min(self._step, self.longest)
            # No sliver is left over for rounding to make.
            step = left if left <= 1.01 * step else step
            stage(f"branches followed from μ = {self.state.mu:.6g}, to {mu:.6g}")
            found = self.source.eigenpairs(mu if step == left else self.state.mu + step)
            if step < left and _coincide(self.state, found):
                # Where modes cross or meet they are known least: a little before it they tell which is which.
                step *= ASIDE
                found = self.source.eigenpairs(self.state.mu + step)
            index = matched(self.state, found, self.named, surely=step > SMALLEST_STEP)
            if index is None:
                self._step = step / 4
                continue
            new = _named(self.state, BranchState(found, index))
            if new is None:
                self._step = step / 4
                continue
            if self.watch is not None:
                self.watch(self.state, new)
            self.state = new
            self._step = max(self._step, 2 * step)
        return self.state


def _coincide(old: BranchState, found: Eigenpairs) -> bool:
    """Whether modes that were apart all but coincide in the next state."""
    mine, theirs = (np.sort_complex(x) for x in (old.coordinate, found.coordinate))
    near = [int(np.count_nonzero(np.abs(np.diff(x)) <= COINCIDENT * np.abs(x[1:]))) for x in (mine, theirs)]
    return near[1] > near[0]


def matched(old: BranchState, found: Eigenpairs, named: int, *, surely: bool = True) -> IntArray | None:
    """Places (b,) among ``found`` of the branches of ``old``; None where that is not clear for the first ``named`` of
    them and ``surely`` is asked. Raises FollowingError where there is nothing left to be among."""
    half = 0.5 * (found.mu - old.mu)
    ahead = _moved(old.coordinate, half * old.tangents)
    behind = _moved(found.coordinate, -half * found.tangents)
    distance = np.abs(ahead[:, None] - behind)
    if distance.shape[1] < distance.shape[0]:
        if not (surely or len(found.values)):
            raise FollowingError("all modes that are followed leave the band, and what is looked at beyond it")
        return None if surely else np.argmin(distance, axis=1)
    # Of two real values at the same distance the one that grows.
    scale = float(np.abs(found.coordinate).max(initial=1.0))
    rows, columns = scipy.optimize.linear_sum_assignment(distance / scale - 1e-9 * found.coordinate.real / scale)
    index = np.zeros(len(distance), dtype=np.int64)
    index[rows] = columns
    if not surely:
        return index
    clear = _clear(old, found, index, distance)
    for i in np.flatnonzero(~clear[:named]):
        if clear[i]:
            continue
        pair = _as_pair(old, found, int(i), index, clear)
        if pair is None:
            return None
        j, index[i], index[j] = pair
        clear[i] = clear[j] = True
    return index if len(np.unique(index)) == len(index) else None


def _moved(coordinate: ComplexArray, by: ComplexArray) -> ComplexArray:
    """Where eigenvalues (k,) are half a step on, as far as their tangents say anything of it. What half a step from
    either end leaves is of third order, a whole one from one end of second."""
    reach = 0.25 * np.maximum(np.abs(coordinate), 1e-3 * np.abs(coordinate).max(initial=0.0))
    return np.where(np.isfinite(by) & (np.abs(by) < reach), coordinate + by, coordinate)


def _named(old: BranchState, new: BranchState) -> BranchState | None:
    """The new state with the names that are a matter of taste given by rule, so that rounding has no say; None where
    the step is too long to tell.

    Of two modes that meet the first grows beyond (`meeting`). A mode that falls apart on the real axis is the one of
    its halves that grows faster.
    """
    index = new.index.copy()
    was, now = old.coordinate, new.coordinate
    alone = (was.imag != 0) & (now.imag == 0)
    if np.any(alone) and len(new.found.coordinate) > len(index):
        free = np.setdiff1d(np.flatnonzero(new.found.coordinate.imag == 0), index)
        for i in np.flatnonzero(alone):
            if not len(free):
                break
            middle = (was[i] + (new.mu - old.mu) * old.tangents[i]).real
            halves_to = 0.5 * (now[i] + new.found.coordinate[free]).real
            k = int(np.argmin(np.abs(halves_to - middle)))
            if new.found.coordinate[free[k]].real > now[i].real:
                index[i], free[k] = free[k], index[i]
    # Without damping pairs are matched by rule already.
    if np.all(was == old.values) and not _agreed(old, new, index):
        return None
    return BranchState(new.found, index)


def _agreed(old: BranchState, new: BranchState, index: IntArray) -> bool:
    """Exchange, in ``index``, damped modes that have met or passed one another where they bear each other's names;
    False where a shorter step must tell."""
    x, slopes, x_to, slopes_to = old.coordinate, old.tangents, new.coordinate, new.tangents
    sure = True
    for i in range(len(x_to) - 1):
        distance = np.abs(x_to - x_to[i])
        distance[i] = np.inf
        j = int(np.argmin(distance))
        if j <= i:
            continue
        told = beyond(
            (x[i], x[j]), (slopes[i], slopes[j]), (x_to[i], x_to[j]), (slopes_to[i], slopes_to[j]),
            new.mu - old.mu,
        )  # fmt: skip
        if told is None:
            continue
        sure &= told.sure
        if told.exchanged:
            index[[i, j]] = index[[j, i]]
    return sure


def _clear(old: BranchState, found: Eigenpairs, index: IntArray, distance: Array) -> BoolArray:
    """Whether each branch's match (b,) is beyond doubt."""
    mine = distance[np.arange(len(index)), index]
    others = distance.copy()
    others[np.arange(len(index)), index] = np.inf
    own = min(old.found.own, found.own)
    before, after = old.found.right[:own, old.index], found.right[:own, index]
    common = np.abs(np.einsum("ij,ij->j", before.conj(), after)) ** 2
    alike = common / np.maximum(np.sum(np.abs(before) ** 2, axis=0) * np.sum(np.abs(after) ** 2, axis=0), 1e-300)
    rounding = 1e-9 * np.abs(found.coordinate[index])
    same = others.min(axis=1, initial=np.inf) <= rounding  # identical eigenvalues: either will do
    clear = (mine <= CLEAR * others.min(axis=1, initial=np.inf)) & (alike >= ALIKE)
    return clear | (same & (mine <= rounding)) | _double(old.coordinate, found.coordinate[index])


def _double(before: ComplexArray, after: ComplexArray) -> BoolArray:
    """Which branches (b,) are one of two that are a double eigenvalue at both ends of a step, as those of a mass on a
    belt whose spring is as stiff as its contact: rounding alone tells the two apart, so either will do."""
    one = np.eye(len(before), dtype=bool)
    near = [np.abs(x[:, None] - x) <= COINCIDENT * np.abs(x)[:, None] for x in (before, after)]
    moved: Array = np.abs(after - before)
    return np.any(near[0] & near[1] & ~one, axis=1) & (moved <= STRAIGHT * np.abs(before))


def _as_pair(
    old: BranchState, found: Eigenpairs, i: int, index: IntArray, clear: BoolArray
) -> tuple[int, int, int] | None:
    """Branch i matched together with its nearest: (j, place of i, place of j), None where they are no pair."""
    gap = np.abs(old.coordinate - old.coordinate[i])
    gap[i] = np.inf
    j = int(np.argmin(gap))
    if len(gap) < 2 or clear[j]:
        return None
    step = found.mu - old.mu
    mean, square = halves(old.coordinate[i], old.coordinate[j])
    slopes = old.tangents[[i, j]]
    if not np.all(np.isfinite(slopes)):
        return None
    mean_to = mean + step * slopes.mean()
    square_to = square + step * (old.coordinate[i] - old.coordinate[j]) * (slopes[0] - slopes[1]) / 2
    near = np.argsort(np.abs(found.coordinate - mean_to))
    both = near[:2]
    new_mean, new_square = halves(*found.coordinate[both])
    third = float(np.abs(found.coordinate[near[2]] - mean_to)) if len(near) > 2 else np.inf
    change = abs(square_to - square)
    doubtful = abs(new_mean - mean_to) > 0.25 * third or abs(new_square - square_to) > 0.5 * change
    taken = set(index[clear].tolist())
    if doubtful or abs(np.sqrt(new_square)) > 0.5 * third or taken & set(both.tolist()):
        return None
    aside, strayed = _past_zero(new_square, square), abs(new_square - square_to)
    if ROUNDING * abs(new_square - square) < aside < 2 * strayed:
        # The way is not known well enough to say on which side of zero it passes.
        if step > NARROW * max(found.mu, 1e-2):
            return None
        new_square = -abs(new_square / square) * square
    half = continued(new_square, square, (old.coordinate[i] - old.coordinate[j]) / 2, _grows)
    if i > j and through_zero(new_square, square):
        half = -half
    first = int(np.argmin(np.abs(found.coordinate[both] - new_mean - half)))
    if (new_square * square.conjugate()).real > 0 and _crossed(old, found, (i, j), both[[first, 1 - first]]):
        first = 1 - first
    return j, int(both[first]), int(both[1 - first])


def _crossed(old: BranchState, found: Eigenpairs, branches: tuple[int, int], both: IntArray) -> bool:
    """Whether two branches, of which the first would go to both[0], have exchanged their order instead: their
    difference then runs straight through zero, which its slopes at both ends say. Shapes do not: where friction couples
    two modes one way only, they are one shape there."""
    i, j = branches
    before = complex(old.coordinate[i] - old.coordinate[j])
    after = complex(found.coordinate[both[0]] - found.coordinate[both[1]])
    slopes = complex(old.tangents[i] - old.tangents[j]), complex(found.tangents[both[0]] - found.tangents[both[1]])
    if not np.all(np.isfinite(slopes)):
        return False
    step = found.mu - old.mu
    kept = abs(before + step * (slopes[0] + slopes[1]) / 2 - after)
    exchanged = abs(before + step * (slopes[0] - slopes[1]) / 2 + after)
    return exchanged <= STRAIGHT * abs(before) and kept > 4 * exchanged


def _past_zero(square: complex, before: complex) -> float:
    """How far the straight line between two complex numbers passes from zero; infinite where it leads away from it."""
    if (square * before.conjugate()).real >= 0:
        return np.inf
    return abs((square * before.conjugate()).imag) / abs(square - before)


def _grows(half: complex) -> bool:
    """Whether the one of two λ² that lies ``half`` beyond their mean grows or, where both are real, has the higher
    frequency."""
    return half.imag > 0 if abs(half.imag) > 1e-9 * abs(half) else half.real <= 0

"""Branches λ(μ) followed from the frictionless system, through crossings and coalescences.

A branch is never a position in a sorted list. Each step predicts every root by its tangent and
corrects all of them together; a step is taken only where each root stayed far closer to its own
prediction than to its neighbours. Two roots that coalesce are followed as a pair through their mean
a and squared half difference b, which stay analytic in μ where the roots themselves do not: there
λ = a ± √b, and the continuous square root says which is which.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import scipy

from ..errors import AnalysisError, FollowingError
from ..typing import BoolArray, ComplexArray, IntArray
from .meeting import beyond, continued, halves
from .painleve import undetermined
from .roots import ReceptanceProblem, dense_roots, frictionless_roots, polish

CLOSE = 0.25  # a correction may be this fraction of the distance to the next root
CONTINUATION_STEPS = 12
MOST_LEAPS = 40
LEAST_REACH = 0.1  # of the fastest root of the start: those up to there are found anew at least
START_OF_SLOPES = 1e-6  # μ at which tracking starts where friction has a slope


@dataclass
class RootState:
    """Roots at one μ: roots (k,) of the branches, tangents dλ/dμ (k,), and implied (k,): whether the
    conjugate root is left unsaid. Real roots stand for themselves, and so does each of a pair that was
    on the real axis once; a root that reaches the axis gets its twin appended. branch (k,): the
    followed root each came from, itself but for twins."""

    mu: float
    roots: ComplexArray
    implied: BoolArray
    tangents: ComplexArray
    branch: IntArray


@dataclass
class Tracker:
    """Follows all branches with |λ| ≤ limit [1/s] at μ = 0 towards larger μ.

    watch, where given, is called with each accepted pair of states (onset detection).
    """

    spectrum: ReceptanceProblem
    limit: float
    watch: Callable[[RootState, RootState], None] | None = None
    state: RootState = field(init=False)
    origin: ComplexArray = field(init=False)
    smallest_step: float = 1e-9

    def __post_init__(self) -> None:
        roots = frictionless_roots(self.spectrum, self.limit)
        mu = START_OF_SLOPES if self.spectrum.coupling.sloped else 0.0
        implied = roots.imag != 0.0
        self.origin = roots
        if mu:
            # Modes with tangential motion alone sit on poles at μ = 0: a hair of friction takes them off.
            roots, converged = polish(self.spectrum, roots * (1 + mu * 1e-3), implied, mu)
            if not converged:
                raise AnalysisError("the eigenvalues at vanishing friction do not settle")
        self.state = RootState(mu, roots, implied, self._tangents(roots, mu), np.arange(len(roots)))
        self._step, self._leaps = 0.01, 0
        self._before: RootState | None = None

    @classmethod
    def resumed(cls, spectrum: ReceptanceProblem, state: RootState) -> Tracker:
        """A tracker that goes on from a state followed before."""
        tracker = cls.__new__(cls)
        tracker.spectrum, tracker.limit, tracker.watch = spectrum, float(np.abs(state.roots).max()), None
        tracker.state, tracker.origin, tracker.smallest_step = state, state.roots, 1e-9
        tracker._step, tracker._leaps, tracker._before = 0.01, 0, None
        return tracker

    def _tangents(self, roots: ComplexArray, mu: float) -> ComplexArray:
        if not len(roots):
            return roots.copy()
        return self.spectrum.tangents(roots, mu)

    def advance(self, mu: float) -> RootState:
        """Follow the branches to ``mu`` ≥ the present one; raises AnalysisError where they are lost."""
        if mu == 0.0:
            return replace(self.state, mu=0.0, roots=self.origin)
        if mu < self.state.mu <= START_OF_SLOPES:
            nearby = self.origin + mu / self.state.mu * (self.state.roots - self.origin)
            return replace(self.state, mu=mu, roots=polish(self.spectrum, nearby, self.state.implied, mu)[0])
        if not len(self.state.roots):
            self.state = replace(self.state, mu=mu)
            return self.state
        while self.state.mu < mu:
            step = min(self._step, mu - self.state.mu)
            taken = self._try(self.state.mu + step if step < mu - self.state.mu else mu)
            # From a double root no tangent leads on: what is asked for there is given, and others are stepped over.
            if taken is None or (taken.mu < mu and not np.all(np.isfinite(taken.tangents))):
                self._step = step / 4
                if self._step >= self.smallest_step:
                    continue
                self._leaps += 1
                taken, self._step = self._leap(mu), 1e-4
            if self.watch is not None:
                self.watch(self.state, taken)
            self._before, self.state = self.state, taken
            if step >= 0.999 * self._step:
                self._step = min(self._step * 2, 0.02)
        return self.state

    def _leap(self, end: float) -> RootState:
        """Over a place where three or more roots merge: every root anew, each branch to the nearest.

        Which of the merging branches is which beyond that place is a convention; that none is lost is not.
        """
        old = self.state
        # All may stand at zero, where nothing says what to invert about.
        reach = max(1.5 * float(np.abs(old.roots).max()), LEAST_REACH * float(np.abs(self.origin).max()))
        upper, lower = np.flatnonzero(old.roots.imag >= 0), np.flatnonzero(old.roots.imag < 0)
        # Roots of the lower half plane are explicit twins of upper ones.
        twin_of = np.array(
            [upper[np.argmin(np.abs(old.roots[upper] - np.conj(old.roots[j])))] for j in lower],
            dtype=np.int64,
        )
        for leap in (1e-8, 1e-7, 1e-6, 1e-5, 1e-4) if self._leaps <= MOST_LEAPS and reach > 0.0 else ():
            mu = min(old.mu + leap, end)
            found = dense_roots(self.spectrum, mu, reach)
            found = found[found.imag >= 0]
            if len(found) < len(upper):
                continue
            moved = (mu - old.mu) * np.where(np.isfinite(old.tangents), old.tangents, 0.0)
            predicted = old.roots + np.where(np.abs(moved) < 1e-3 * np.abs(old.roots), moved, 0.0)
            rows, columns = scipy.optimize.linear_sum_assignment(np.abs(predicted[upper, None] - found))
            roots = np.array(old.roots)
            roots[upper[rows]] = found[columns]
            roots[lower] = np.conj(roots[twin_of])
            # A real root may have met one that was not followed: its new conjugate is implied then.
            implied = roots.imag > 0
            implied[twin_of] = False
            if np.any(roots[twin_of].imag == 0) or np.any(old.implied & ~implied):
                continue
            if np.any(np.abs(roots - old.roots) > 0.02 * np.abs(roots)):
                continue
            roots, converged = polish(self.spectrum, roots, implied, mu)
            if converged:
                return RootState(mu, roots, implied, self._tangents(roots, mu), old.branch)
        if reach > 1e3 * self.limit and np.any(self.spectrum.coupling.compliance == 0.0):
            # Where the masses could not tell (`painleve`).
            raise AnalysisError(undetermined(old.mu))
        raise FollowingError(
            f"branches cannot be told apart near μ = {old.mu:.9g}: three or more modes "
            "merge there; split the range or change a parameter slightly; `stridor modes --mu` solves each "
            "friction coefficient on its own"
        )

    def _try(self, mu: float) -> RootState | None:
        old = self.state
        step = mu - old.mu
        if not np.all(np.isfinite(old.tangents)):
            return None
        predicted = old.roots + step * old.tangents
        implied = old.implied.copy()
        twins: list[complex] = []
        origins: list[int] = []
        pairs = self._pairs(old, predicted)
        splits: dict[int, tuple[complex, complex, complex]] = {}
        for i, j in pairs:
            a, b = halves(old.roots[i], old.roots[j] if j >= 0 else np.conj(old.roots[i]))
            da, db = _pair_slope(old, i, j)
            splits[i] = (a + step * da, b + step * db, b)
            half = continued(splits[i][1], b, _half(old, i, j), _grows)
            predicted[i] = splits[i][0] + half
            if j >= 0:
                predicted[j] = splits[i][0] - half
            elif half.imag == 0.0:
                implied[i] = False
                twins.append(splits[i][0] - half)
                origins.append(int(old.branch[i]))
        alone = np.ones(len(predicted), dtype=bool)
        alone[[k for pair in pairs for k in pair if k >= 0]] = False
        predicted[alone] = self._extrapolated(old, step, predicted)[alone]
        both = np.concatenate([predicted, twins])
        implied = np.concatenate([implied, np.zeros(len(twins), dtype=bool)])
        roots, converged = polish(self.spectrum, both, implied, mu, steps=CONTINUATION_STEPS)
        if not converged:
            return None
        axis = ~implied & (np.abs(roots.imag) < 1e-9 * np.abs(roots))
        roots = np.where(axis, roots.real + 0j, roots)
        if not self._accept(roots, implied, predicted, pairs, splits):
            return None
        branch = np.concatenate([old.branch, np.array(origins, dtype=np.int64)])
        tangents = self._tangents(roots, mu)
        for i, j in pairs:
            if j < 0:
                continue
            told = beyond(
                (old.roots[i], old.roots[j]), (old.tangents[i], old.tangents[j]), (roots[i], roots[j]),
                (tangents[i], tangents[j]), step,
            )  # fmt: skip
            if told is not None and not told.sure:
                return None
            if told is not None and told.exchanged:
                roots[[i, j]], tangents[[i, j]] = roots[[j, i]], tangents[[j, i]]
        return RootState(mu, roots, implied, tangents, branch)

    def _extrapolated(self, old: RootState, step: float, predicted: ComplexArray) -> ComplexArray:
        """The cubic through the last two states and their tangents, where it does not reach too far."""
        before = self._before
        if before is None or len(before.roots) != len(old.roots):
            return predicted
        length = old.mu - before.mu
        if not 0.0 < step <= 2.0 * length:
            return predicted
        start, end = length * before.tangents, length * old.tangents
        cubic = start + end + 2.0 * (before.roots - old.roots)
        square = before.roots - old.roots + end + cubic
        t = step / length
        further = old.roots + t * (end + t * (square + t * cubic))
        # Beside a coalescence that just passed, the cubic knows less than the tangent.
        near = np.abs(further - predicted) <= np.abs(step * old.tangents)
        return np.where(near & np.isfinite(further), further, predicted)

    def _pairs(self, old: RootState, predicted: ComplexArray) -> list[tuple[int, int]]:
        """Pairs (i, j) whose distance is not large against the step; j = −1 is i's own conjugate."""
        moved = np.abs(predicted - old.roots)
        found: list[tuple[int, int]] = []
        used: set[int] = set()
        distance = np.abs(old.roots[:, None] - old.roots)
        np.fill_diagonal(distance, np.inf)
        own = np.where(old.implied, 2 * np.abs(old.roots.imag), np.inf)
        nearest = np.argmin(distance, axis=1)
        closest = distance[np.arange(len(nearest)), nearest]
        # Most roots are far from all others: which are not is told of all at once.
        alike = nearest[nearest] == np.arange(len(nearest))
        near = alike & (closest < np.maximum(moved, moved[nearest]) / CLOSE)
        near |= (own < closest) & (own < moved / CLOSE)
        if not near.any():
            return found
        order = np.argsort(closest if len(old.roots) > 1 else own)
        for i in order[near[order]]:
            i = int(i)
            j = int(nearest[i])
            if i in used:
                continue
            if own[i] < distance[i, j] and own[i] < moved[i] / CLOSE:
                found.append((i, -1))
                used.add(i)
            elif (
                len(old.roots) > 1
                and j not in used
                and nearest[j] == i
                and distance[i, j] < max(moved[i], moved[j]) / CLOSE
            ):
                found.append((min(i, j), max(i, j)))
                used.update((i, j))
        return found

    def _accept(
        self,
        roots: ComplexArray,
        implied: BoolArray,
        predicted: ComplexArray,
        pairs: list[tuple[int, int]],
        splits: dict[int, tuple[complex, complex, complex]],
    ) -> bool:
        if np.any(roots.imag[implied] <= 0):
            return False
        count = len(predicted)
        everything = np.concatenate([roots, np.conj(roots[implied])])
        own = np.full(len(roots), -1)
        own[implied] = len(roots) + np.arange(int(implied.sum()))
        gap = np.abs(roots[:count, None] - everything)
        gap[np.arange(count), np.arange(count)] = np.inf
        paired = np.zeros(count, dtype=bool)
        twin = count
        for i, j in pairs:
            paired[i] = True
            if j >= 0:
                paired[j] = True
                gap[i, j] = gap[j, i] = np.inf
                partner = roots[j]
            elif implied[i]:
                gap[i, own[i]] = np.inf
                partner = np.conj(roots[i])
            else:
                gap[i, twin] = np.inf
                partner = roots[twin]
                twin += 1
            a_guess, b_guess, b_old = splits[i]
            a, b = halves(roots[i], partner)
            # The pair's own quantities must follow their prediction; a sign of √b that flips against
            # the continuous one would show here as a wrong b or be caught by the next check.
            if abs(b - b_guess) > 0.3 * max(abs(b_guess - b_old), 1e-3 * abs(b_old)):
                return False
            third = min(float(gap[i].min()), float(gap[j].min()) if j >= 0 else np.inf)
            if abs(a - a_guess) > CLOSE * third:
                return False
        alone = ~paired
        return bool(np.all(np.abs(roots[:count] - predicted)[alone] <= CLOSE * gap.min(axis=1)[alone]))


def _half(old: RootState, i: int, j: int) -> complex:
    return complex(old.roots[i] - (old.roots[j] if j >= 0 else np.conj(old.roots[i]))) / 2


def _pair_slope(old: RootState, i: int, j: int) -> tuple[complex, complex]:
    first, second = old.roots[i], old.roots[j] if j >= 0 else np.conj(old.roots[i])
    slope = old.tangents[i]
    other = old.tangents[j] if j >= 0 else np.conj(slope)
    return (slope + other) / 2, (first - second) * (slope - other) / 2


def _grows(half: complex) -> bool:
    """Whether the one of two λ that lies ``half`` beyond their mean grows or, where they only oscillate, has the higher
    frequency."""
    return half.real > 0 or (half.real == 0 and half.imag > 0)

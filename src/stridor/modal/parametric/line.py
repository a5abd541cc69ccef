"""Branches of a reduced model followed along a straight line in its box, from a point where their numbers are known."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping

import numpy as np

from ...errors import AnalysisError
from ...typing import ComplexArray, IntArray
from ..dense_problem import Eigenpairs, OverNumber, combined
from ..krylov.follow import Follower, State
from .dense import assembled
from .model import ReducedModel, ReducedModes

TRIES = 16  # points of a line at most; what needs more is not told
DIFFERENCE = 1e-5  # of the line: for slopes of its matrices
NEAR_TOP = 1e-3  # of the band: modes this close to its end at the end of the line may be outside of it


class Line(OverNumber):
    """Modes of a model from ``start`` (t = 0) to ``end`` (t = 1). known: modes at some t."""

    def __init__(
        self, model: ReducedModel, start: Mapping[str, float], end: Mapping[str, float],
        known: Mapping[float, ReducedModes],
    ) -> None:  # fmt: skip
        super().__init__(model.frequency, (0.0, 1.0), damped=bool(np.any(model.problem.powers == 1)))
        self.model, self.start, self.end = model, start, end
        self._modes = dict(known)

    def point(self, t: float) -> dict[str, float]:
        """The parameters at t."""
        return {name: (1 - t) * value + t * self.end[name] for name, value in self.start.items()}

    def eigenpairs(self, mu: float) -> Eigenpairs:
        """The model's modes at t = ``mu``. Raises AnalysisError where that has been asked too often."""
        if mu not in self._known:
            if mu not in self._modes:
                if len(self._known) >= TRIES:
                    raise AnalysisError("branches change too often along the line")
                self._modes[mu] = self.model.modes(self.point(mu))
            self.remembered(self._pairs(mu, self._modes[mu]))
        return self._known[mu]

    def _pairs(self, t: float, modes: ReducedModes) -> Eigenpairs:
        lam = modes.values
        coordinate = lam if self.damped else lam**2
        slopes = self._slopes(t, modes)
        return Eigenpairs(t, coordinate, lam, modes.right, modes.left, slopes, len(modes.right))

    def _slopes(self, t: float, modes: ReducedModes) -> ComplexArray:
        """dx/dt (k,) of the coordinates."""
        problem, projected = self.model.problem, self.model.projected
        low, high = max(t - DIFFERENCE, 0.0), min(t + DIFFERENCE, 1.0)
        change = (problem.factors(self.point(high)) - problem.factors(self.point(low))) / (high - low)
        lam, right = modes.values, modes.right
        moved = [combined(part, right) for part in assembled(projected, change, problem.powers)]
        mass, damping, _ = assembled(projected, problem.factors(self.point(t)), problem.powers)
        by_x = combined(mass, right)
        if self.damped:
            by_x = 2 * lam * by_x + combined(damping, right)
        with np.errstate(all="ignore"):
            over = np.einsum("ij,ij->j", modes.left, lam**2 * moved[0] + lam * moved[1] + moved[2])
            slopes: ComplexArray = -over / np.einsum("ij,ij->j", modes.left, by_x)
        return slopes


def numbers_at(model: ReducedModel, start: ReducedModes, numbers: IntArray, end: ReducedModes) -> IntArray:
    """Numbers (k,) of the modes ``end``, followed straight from those of ``start``, (j,) with 0 for unknown ones; 0
    where a mode is none of theirs, comes in from above the band, or the way is too long to tell."""
    found = np.zeros(len(end.values), dtype=np.int64)
    # What leaves the band on the way cannot be followed: modes are, as far as all of them move, the lowest ones.
    mine, theirs = np.sort(np.abs(start.values)), np.sort(np.abs(end.values))
    both = min(len(mine), len(theirs))
    rise = float(np.max(theirs[:both] / np.maximum(mine[:both], 1e-300), initial=1.0))
    stays = np.abs(start.values) * rise <= (1 - NEAR_TOP) * model.frequency
    known = np.flatnonzero(stays & (numbers > 0))
    if not len(known):
        return found
    line = Line(model, start.point, end.point, {0.0: start, 1.0: end})
    follower = Follower.resumed(line, State(line.eigenpairs(0.0), known))
    with contextlib.suppress(AnalysisError):
        found[follower.advance(1.0).index] = numbers[known]
    return found


def matched_numbers(values: ComplexArray, numbers: IntArray, modes: ComplexArray, near: float) -> IntArray:
    """Numbers (k,) of modes λ (k,) from the same modes λ (j,) numbered elsewhere; 0 where none is that near, relative,
    or two are."""
    found = np.zeros(len(modes), dtype=np.int64)
    distance = np.abs(modes[:, None] - values) <= near * np.abs(modes)[:, None]
    alone = (distance.sum(axis=1) == 1) & (distance @ (distance.sum(axis=0) == 1) == 1)
    found[alone] = numbers[np.argmax(distance[alone], axis=1)] if alone.any() else 0
    return found

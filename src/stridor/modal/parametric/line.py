"""Branches of a reduced model followed along a straight line in its box, from a point where their numbers are known."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...errors import AnalysisError
from ...typing import Array, ComplexArray, IntArray
from ..dense_problem import Eigenpairs, OverNumber, combined, images
from ..krylov.follow import BranchState, Follower
from .dense import assembled_each
from .model import ReducedModel, ReducedModes

TRIES = 16  # points of a line at most; what needs more is not told
DIFFERENCE = 1e-5  # of the line: for slopes of its matrices
NEAR_TOP = 1e-3  # of the band: modes this close to its end at the end of the line may be outside of it


@dataclass(frozen=True)
class Numbered:
    """Modes of a model whose numbers (k,) are known; 0 where they are not."""

    model: ReducedModel
    modes: ReducedModes
    numbers: IntArray

    @cached_property
    def shares(self) -> ComplexArray:
        """wᵀA_jz (t, k) of the terms: slopes in any direction follow from them."""
        left, right = self.modes.left, self.modes.right
        return np.array([np.einsum("ij,ij->j", left, combined(part, right)) for part in self.model.projected])


class ModelAlongLine(OverNumber):
    """Modes of a model from ``start`` (t = 0) to ``end`` (t = 1)."""

    def __init__(self, start: Numbered, end: ReducedModes) -> None:
        model = start.model
        super().__init__(model.searched, (0.0, 1.0), damped=bool(np.any(model.problem.powers == 1)))
        self.model, self._begin = model, start
        self.start, self.end = start.modes.point, end.point
        self._modes = {0.0: start.modes, 1.0: end}

    def point(self, t: float) -> dict[str, float]:
        """The parameters at t."""
        return {name: (1 - t) * value + t * self.end[name] for name, value in self.start.items()}

    def eigenpairs(self, mu: float) -> Eigenpairs:
        """The model's modes at t = ``mu``. Raises AnalysisError where that has been asked too often."""
        if mu not in self._known:
            if mu not in self._modes:
                if len(self._known) >= TRIES:
                    raise AnalysisError("branches change too often along the line")
                self._modes[mu] = self.model.modes(self.point(mu), judged=False)
            self.remembered(self._pairs(mu, self._modes[mu]))
        return self._known[mu]

    def _pairs(self, t: float, modes: ReducedModes) -> Eigenpairs:
        lam = modes.values
        coordinate = lam if self.damped else lam**2
        slopes = self._slopes(t, modes)
        return Eigenpairs(t, coordinate, lam, modes.right, modes.left, slopes, len(modes.right))

    def _slopes(self, t: float, modes: ReducedModes) -> ComplexArray:
        """dx/dt (k,) of the coordinates."""
        problem, lam = self.model.problem, modes.values
        low, high = max(t - DIFFERENCE, 0.0), min(t + DIFFERENCE, 1.0)
        here = problem.factors(self.point(t))
        above, below = (here if at == t else problem.factors(self.point(at)) for at in (high, low))
        change = (above - below) / (high - low)
        moved, (by_mass, by_damping) = self._moved(t, modes, change), self._inert(t, modes, here)
        by_x = 2 * lam * by_mass + by_damping if self.damped else by_mass
        with np.errstate(all="ignore"):
            slopes: ComplexArray = -(lam**2 * moved[0] + lam * moved[1] + moved[2]) / by_x
        return slopes

    def _moved(self, t: float, modes: ReducedModes, change: Array) -> ComplexArray:
        """wᵀAz (3, k) of what the terms on each power of λ change by, M first."""
        if t == 0.0:
            return np.array([self._share(change, power) for power in (2, 1, 0)])
        parts = images(assembled_each(self.model.projected, (change,), self.model.problem.powers)[0], modes.right)
        return np.array([np.einsum("ij,ij->j", modes.left, part) for part in parts])

    def _inert(self, t: float, modes: ReducedModes, here: Array) -> tuple[ComplexArray, ComplexArray]:
        """wᵀMz and wᵀDz (k,)."""
        if t == 0.0:
            return self._share(here, 2), self._share(here, 1)
        mass, damping, _ = self.model.matrices(here)
        left, right = modes.left, modes.right
        return np.einsum("ij,ij->j", left, combined(mass, right)), np.einsum("ij,ij->j", left, combined(damping, right))

    def _share(self, factors: Array, power: int) -> ComplexArray:
        """wᵀAz (k,) at the start, of what the terms on a power of λ add up to."""
        chosen = self.model.problem.powers == power
        made: ComplexArray = factors[chosen] @ self._begin.shares[chosen]
        return made


def numbers_at(start: Numbered, end: ReducedModes) -> IntArray:
    """Numbers (k,) of the modes ``end``, followed straight from those of ``start``; 0 where a mode is none of theirs,
    comes in from above the band, or the way is too long to tell."""
    found = np.zeros(len(end.values), dtype=np.int64)
    # What leaves the band on the way cannot be followed: modes are, as far as all of them move, the lowest ones.
    mine, theirs = np.sort(np.abs(start.modes.values)), np.sort(np.abs(end.values))
    both = min(len(mine), len(theirs))
    rise = float(np.max(theirs[:both] / np.maximum(mine[:both], 1e-300), initial=1.0))
    stays = np.abs(start.modes.values) * rise <= (1 - NEAR_TOP) * start.model.searched
    known = np.flatnonzero(stays & (start.numbers > 0))
    if not len(known):
        return found
    line = ModelAlongLine(start, end)
    follower = Follower.resumed(line, BranchState(line.eigenpairs(0.0), known))
    with contextlib.suppress(AnalysisError):
        found[follower.advance(1.0).index] = start.numbers[known]
    return found


def matched_numbers(values: ComplexArray, numbers: IntArray, modes: ComplexArray, near: float) -> IntArray:
    """Numbers (k,) of modes λ (k,) from the same modes λ (j,) numbered elsewhere; 0 where none is that near, relative,
    or two are."""
    found = np.zeros(len(modes), dtype=np.int64)
    distance = np.abs(modes[:, None] - values) <= near * np.abs(modes)[:, None]
    alone = (distance.sum(axis=1) == 1) & (distance @ (distance.sum(axis=0) == 1) == 1)
    found[alone] = numbers[np.argmax(distance[alone], axis=1)] if alone.any() else 0
    return found

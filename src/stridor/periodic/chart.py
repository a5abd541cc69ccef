"""Coordinates of the states of one status: free displacements and velocities, scaled to the root of their energy."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..temporal.steppers.exact.statuses import Driven, Status
from ..typing import Array
from .problem import SlidingProblem


@dataclass(frozen=True)
class Chart:
    """ξ = (scaled displacements, velocities (y,) each, places of contacts ``stuck`` by a force) of a status: s numbers.

    The same for every friction coefficient, as what a status holds does not depend on it.
    """

    status: Status
    stuck: tuple[int, ...]
    z: Array
    scale: Array
    lifted: Array
    lifted_rate: Array
    places: Array
    began: Array
    weights: Array

    @staticmethod
    def of(problem: SlidingProblem, status: Status) -> Chart:
        """That of a status."""
        motion = problem.motion()
        regime = motion.regime(status)
        driven = Driven(regime, problem.piece)
        z, _, scale = regime.free
        terms = problem.piece.terms
        lifted = regime.back @ driven.holds
        stuck = [c for c, what in regime.held if what == "tangent"]
        along = np.concatenate([np.arange(1), terms + np.array(stuck, dtype=int)])
        rows = problem.pairs.tangent[stuck]
        squares = np.abs(problem.basis.stiffness)
        soft = np.maximum(squares, 1e-6 * squares.max(initial=0.0) or 1.0)
        weights = 1.0 / np.sqrt(np.maximum((rows * rows / soft).sum(axis=1), 1e-300))
        return Chart(
            status, tuple(stuck), z, scale, lifted[:, along], (lifted @ driven.rate)[:, along], rows,
            problem.pairs.tangent_lift[stuck] @ problem.piece.displacements[:, 0], weights,
        )  # fmt: skip

    @property
    def size(self) -> int:
        """How many numbers."""
        return 2 * len(self.scale) + len(self.places)

    def numbers(self, q: Array, v: Array) -> Array:
        """ξ (s,) of displacement and velocity (k,) in this status."""
        return self._of(q, v, np.concatenate([[1.0], self.places @ q + self.began]))

    def differences(self, dq: Array, dv: Array) -> Array:
        """The same of differences of two states, (k,) or (k, m)."""
        stuck = self.places @ dq
        return self._of(dq, dv, np.concatenate([np.zeros((1, *np.shape(dq)[1:])), stuck]))

    def _of(self, q: Array, v: Array, p: Array) -> Array:
        turn = self.scale if q.ndim == 1 else self.scale[:, None]
        heavy = self.weights if q.ndim == 1 else self.weights[:, None]
        y = turn * (self.z.T @ (q - self.lifted @ p))
        w = self.z.T @ (v - self.lifted_rate @ p)
        return np.concatenate([y, w, heavy * p[1:]])

    def state(self, xi: Array) -> tuple[Array, Array]:
        """Displacement and velocity (k,) of ξ (s,)."""
        size = len(self.scale)
        p = np.concatenate([[1.0], xi[2 * size :] / self.weights])
        q = self.z @ (xi[:size] / self.scale) + self.lifted @ p
        return q, self.z @ xi[size : 2 * size] + self.lifted_rate @ p

    @cached_property
    def directions(self) -> tuple[Array, Array, Array]:
        """What one of each number adds: displacement, velocity (k, s), places of all contacts (m, s)."""
        size, stuck = len(self.scale), len(self.places)
        places = np.zeros((len(self.status), self.size))
        dq, dv = np.zeros((len(self.z), self.size)), np.zeros((len(self.z), self.size))
        dq[:, :size] = self.z / self.scale
        dv[:, size : 2 * size] = self.z
        for j in range(stuck):
            dq[:, 2 * size + j] = self.lifted[:, 1 + j] / self.weights[j]
            dv[:, 2 * size + j] = self.lifted_rate[:, 1 + j] / self.weights[j]
            places[self.stuck[j], 2 * size + j] = 1.0 / self.weights[j]
        return dq, dv, places

"""Folds of a branch that is known: closed where it is smooth and at a corner, and told where they cannot be."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from stridor.errors import AnalysisError
from stridor.periodic.continuation import BranchPoint, follow

TOP = 0.3


@dataclass(frozen=True)
class Place:
    """A point of the curve μ = TOP − |x|ᵖ, with p = 2 (smooth) or 1 (a corner)."""

    x: float
    mu: float


class Curve:
    """See `periodic.continuation.Followed`; between ``hole`` (x) no point of it is found."""

    between = (0.0, 1.0)

    def __init__(self, power: int, hole: tuple[float, float] = (1.0, -1.0)) -> None:
        self.power, self.hole = power, hole

    def _mu(self, x: float) -> float:
        return TOP - abs(x) ** self.power

    def ahead(self, spot: BranchPoint[Place], length: float) -> Place:
        return Place(spot.point.x + length * spot.heading[0], spot.mu + length * spot.heading[1])

    def corrected(self, guess: Place, heading: np.ndarray) -> Place:
        if self.hole[0] < guess.x < self.hole[1]:
            raise AnalysisError("a hole")
        across, here = np.array([-heading[1], heading[0]]), np.array([guess.x, guess.mu])

        def off(s: float) -> float:
            x, mu = here + s * across
            return mu - self._mu(float(x))

        low, high = -0.2, 0.2
        if off(low) * off(high) > 0.0:
            raise AnalysisError("none near")
        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if off(middle) * off(low) > 0.0 else (low, middle)
        return Place(*(here + low * across))

    def heading(self, point: Place, along: np.ndarray, /) -> np.ndarray:
        slope = -2.0 * point.x if self.power == 2 else -0.3 * float(np.sign(point.x))
        found = np.array([1.0, slope]) / np.hypot(1.0, slope)
        return found * np.sign(found @ along)

    def next_start(self, point: Place, heading: np.ndarray, /) -> tuple[Place, np.ndarray]:
        return point, heading

    def at(self, mu: float, one: Place, other: Place) -> Place:
        return Place(one.x + (mu - one.mu) / (other.mu - one.mu) * (other.x - one.x), mu)

    def same(self, one: Place, other: Place, /) -> bool:
        return abs(one.x - other.x) < 1e-6

    def vanished(self, point: Place, /) -> bool:
        return False

    def forget(self) -> None:
        pass


class Corner(Curve):
    """μ = TOP − 0.3 |x|."""

    def _mu(self, x: float) -> float:
        return TOP - 0.3 * abs(x)


def followed(curve: Curve) -> tuple[list[Place], list[str], str]:
    first = Place(-0.3, curve._mu(-0.3))
    folds: list[Place] = []
    unsolved: list[str] = []

    def seen(closed: Any, /, *, fold: bool) -> bool:
        folds.extend([closed] * fold)
        return True

    end = follow(curve, first, curve.heading(first, np.array([1.0, 0.1])), seen, unsolved=unsolved.append)
    return folds, unsolved, end


@pytest.mark.parametrize(("curve", "near"), [(Curve(2), 1e-8), (Corner(1), 1e-5)])
def test_a_fold_is_closed_where_the_branch_is_smooth_and_at_a_corner(curve: Curve, near: float):
    folds, unsolved, end = followed(curve)
    assert end.startswith("it leaves the range")
    assert len(folds) == 1
    assert folds[0].mu == pytest.approx(TOP, abs=near)
    assert unsolved == []


def test_a_fold_that_cannot_be_closed_is_told():
    folds, unsolved, end = followed(Curve(2, hole=(-0.004, 0.004)))
    assert end.startswith("it leaves the range")
    assert folds == []
    assert len(unsolved) == 1
    assert "could not be closed, and is not marked" in unsolved[0]

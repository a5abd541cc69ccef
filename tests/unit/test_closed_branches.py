"""Branches that are closed curves: followed once round, with each fold once."""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, cos, hypot, pi, sin
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from stridor.periodic.continuation import BranchPoint, follow, unfinished
from stridor.study.cycle_branches import Tracer

MIDDLE, RADIUS = 0.5, 0.2


@dataclass(frozen=True)
class Place:
    """A point of the circle (x, μ − MIDDLE) of RADIUS."""

    angle: float
    radius: float = RADIUS
    mu: float = float("nan")

    @staticmethod
    def on(angle: float, radius: float = RADIUS) -> Place:
        return Place(angle, radius, MIDDLE + radius * sin(angle))

    @property
    def x(self) -> float:
        return self.radius * cos(self.angle)


class Circle:
    """See `periodic.continuation.Followed`: of all circles about one middle that of RADIUS, or (inwards) a spiral,
    which passes the μ that it begins at again and again and closes nowhere."""

    between = (0.0, 1.0)

    def __init__(self, inwards: float = 0.0) -> None:
        self.inwards, self.made = inwards, 0

    def ahead(self, spot: BranchPoint[Place], length: float) -> Place:
        x, mu = spot.point.x + length * spot.heading[0], spot.mu + length * spot.heading[1]
        turned = (atan2(mu - MIDDLE, x) - spot.point.angle + pi) % (2 * pi) - pi
        return Place(spot.point.angle + turned, hypot(x, mu - MIDDLE))

    def corrected(self, guess: Place, heading: np.ndarray) -> Place:
        self.made += 1
        return Place.on(guess.angle, RADIUS - self.inwards * abs(guess.angle))

    def heading(self, point: Place, along: np.ndarray, /) -> np.ndarray:
        found = np.array([-sin(point.angle), cos(point.angle)])
        return found * np.sign(found @ along)

    def towards(self, point: Place, sense: float) -> np.ndarray:
        return self.heading(point, np.array([0.0, sense]))

    def next_start(self, point: Place, heading: np.ndarray, /) -> tuple[Place, np.ndarray]:
        return point, heading

    def at(self, mu: float, one: Place, other: Place) -> Place:
        share = (mu - one.mu) / (other.mu - one.mu)
        near = one.angle + share * (other.angle - one.angle)
        radius = RADIUS - self.inwards * abs(near)
        inner = np.arcsin((mu - MIDDLE) / radius)
        return min(
            (Place(turned + k * 2 * pi, radius, mu) for turned in (inner, pi - inner) for k in range(-20, 20)),
            key=lambda place: abs(place.angle - near),
        )

    def same(self, one: Place, other: Place, /) -> bool:
        return hypot(one.x - other.x, one.mu - other.mu) < 1e-6

    def vanished(self, point: Place, /) -> bool:
        return False

    def forget(self) -> None:
        pass


@pytest.mark.parametrize("start", [0.3, -1.0, 2.8, pi / 2 - 0.01, -pi / 2 + 0.02, pi / 2 + 0.01])
@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_a_closed_branch_is_followed_once_round(start: float, sense: float):
    circle, first = Circle(), Place.on(start)
    met: list[tuple[Place, bool]] = []

    def seen(closed: Place, /, *, fold: bool) -> bool:
        met.append((closed, fold))
        return True

    end = follow(circle, first, circle.towards(first, sense), seen)
    assert end == f"it closes on itself at μ = {first.mu:.6g}"
    assert not unfinished(end)
    assert sorted(place.mu for place, fold in met if fold) == pytest.approx([0.3, 0.7], abs=1e-6)
    assert circle.same(met[-1][0], first)
    assert abs(met[-1][0].angle - start) == pytest.approx(2 * pi, abs=1e-9)


def test_a_branch_that_passes_its_first_mu_in_another_cycle_is_not_closed():
    circle, first = Circle(inwards=1e-3), Place.on(0.3)

    def seen(closed: Place, /, *, fold: bool) -> bool:
        return True

    end = follow(circle, first, circle.towards(first, 1.0), seen, most=60)
    assert end == "60 points were made"


def test_of_a_closed_branch_the_other_way_is_not_followed():
    circle = Circle()

    def sampled(place: Any, said: str) -> Any:
        return SimpleNamespace(mu=place.mu, said=said)

    def branch(between: Any) -> Circle:
        return circle

    def lighter(place: Any) -> Any:
        return place

    method: Any = SimpleNamespace(branch=branch, sampled=sampled, lighter=lighter, branch_seconds=float("inf"))
    tracer = Tracer(method, (0.0, 1.0), 200, lambda: True)
    traced = tracer.from_cycle(Place.on(0.3), "a push", ())
    assert traced.begins == traced.ends == f"it closes on itself at μ = {Place.on(0.3).mu:.6g}"
    assert sum(traced.folds) == 2
    assert traced.cycles[0].mu == traced.cycles[-1].mu
    turned = np.diff([place.angle for place in traced.closed])
    assert abs(turned.sum()) == pytest.approx(2 * pi, abs=1e-9)
    assert np.all(turned * np.sign(turned.sum()) > 0.0)

"""Climbs up the rate of a mode: where it is rounding, level at its start, or leads nowhere."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, cast

import numpy as np
import pytest

from stridor.modal.boundary.climb import ModesAtPoint, climb, tops
from stridor.modal.boundary.plane import Plane
from stridor.typing import Array

MESH = 0.25


class Hill:
    """A plane of one mode at 1 1/s, whose rate and gradient are given."""

    top = 2.0

    def __init__(self, rate: Callable[[Array], float], slope: Callable[[Array], Array]) -> None:
        self.rate, self.slope, self.seen = rate, slope, list[Array]()

    def modes(self, p: Array) -> Any:
        self.seen.append(p)
        assert np.all((p > 0.0) & (p < 1.0))
        return type("Found", (), {"values": np.array([self.rate(p) + 1j])})

    def moving(self, values: Array) -> Array:
        return np.ones(len(values), dtype=bool)

    def slopes(self, p: Array, found: Any) -> Array:
        return self.slope(p).reshape(2, 1).astype(complex)


def at(hill: Hill, x: float, y: float) -> ModesAtPoint:
    return ModesAtPoint.at(cast(Plane, hill), np.array([x, y]))


def mound(height: float, rounding: float = 1.0) -> Hill:
    middle = np.array([0.5, 0.5])
    return Hill(
        lambda p: rounding * (height - float(np.sum((p - middle) ** 2))), lambda p: rounding * -2.0 * (p - middle)
    )


def test_a_rate_of_rounding_is_no_decay_whose_top_is_sought():
    for size, count in ((1.0, 1), (1e-15, 0)):
        hill = mound(-1e-3, size)
        assert len(list(tops(cast(Plane, hill), [at(hill, 0.45, 0.5)], MESH))) == count


@pytest.mark.parametrize("rate", [0.0, -1e-300])
def test_a_start_on_the_axis_goes_on_uphill(rate: float):
    """Rate zero where the slope is not: on a step of no length nothing was found, or it was divided by."""
    hill = Hill(lambda p: max(float(p[0]) - 0.5, rate), lambda p: np.array([1.0, 0.0]))
    found = climb(cast(Plane, hill), at(hill, 0.5, 0.5), 0, MESH)
    assert found is not None
    assert 0.5 < found[0] < 0.5 + MESH


def test_a_slope_so_small_that_its_square_is_nothing():
    hill = Hill(lambda p: -1e-200, lambda p: np.array([1e-199, 0.0]))
    assert climb(cast(Plane, hill), at(hill, 0.5, 0.5), 0, MESH) is None


def test_a_bend_that_is_no_number_ends_the_climb(monkeypatch: pytest.MonkeyPatch):
    hill = mound(-1e-3)

    def unknown(inverse: Array | None, step: Array, change: Array) -> tuple[Array, bool]:
        return np.full((2, 2), np.nan), True

    monkeypatch.setattr("stridor.modal.boundary.climb._updated", unknown)
    assert climb(cast(Plane, hill), at(hill, 0.2, 0.5), 0, MESH) is None
    assert len(hill.seen) == 2


def test_a_mode_without_slope_is_followed_nowhere():
    hill = mound(-1e-3)
    double = ModesAtPoint(np.array([0.4, 0.5]), np.array([1j]), np.full((2, 1), np.nan + 0j))
    assert double.follow(0, at(hill, 0.45, 0.5)) is None
    assert at(hill, 0.45, 0.5).follow(0, double) is None

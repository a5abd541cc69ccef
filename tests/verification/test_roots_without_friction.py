"""Roots of one contact without friction: one between each two poles, by the sign of the sum in exact arithmetic."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from stridor.modal.roots import NEAR_ROOT, _between_poles, _densely
from stridor.typing import Array

pytestmark = pytest.mark.verification


def random_poles(rng: np.random.Generator) -> tuple[Array, float, Array, float]:
    """Motions at the contact, compliance, squares of the poles over eight decades, and how far to look."""
    count = int(rng.integers(2, 30))
    poles = 10 ** rng.uniform(2, 10, count)
    poles[0] *= rng.random() > 0.3  # a body that nothing holds
    normal = rng.standard_normal(count) * 10 ** rng.uniform(-4, 1, count)
    return normal, float(10 ** rng.uniform(-14, -2) * (rng.random() > 0.4)), poles, float(10 ** rng.uniform(3, 10.5))


@pytest.mark.parametrize("seed", range(20))
def test_the_sum_changes_its_sign_at_each(seed: int) -> None:
    normal, compliance, poles, top = random_poles(np.random.default_rng(seed))
    found = _between_poles(normal, compliance, poles, top)
    assert found is not None
    exact = [(Fraction(w), Fraction(p) ** 2) for w, p in zip(poles.tolist(), normal.tolist(), strict=True)]

    def positive(x: Fraction) -> bool:
        return Fraction(compliance) + sum(p / (w - x) for w, p in exact) > 0

    for square in found[0].tolist():
        x, near = Fraction(square), 2 * Fraction(NEAR_ROOT) * Fraction(square)
        below = max((w for w, _ in exact if w < x), default=x)
        above = min((w for w, _ in exact if w > x), default=2 * x)
        assert x - near <= below or not positive(x - near)
        assert x + near >= above or positive(x + near)
    # One in each interval that ends below, and in the one that the limit lies in where the sum is positive there.
    ordered = np.sort(poles)
    whole = int(np.sum(ordered[1:] <= top))
    beyond = top > ordered[0] and (top < ordered[-1] or compliance > 0) and positive(Fraction(top))
    assert len(found[0]) == whole + beyond


@pytest.mark.parametrize("compliance", [0.0, 1e-6])
def test_they_are_those_of_the_dense_problem(compliance: float) -> None:
    rng = np.random.default_rng(5)
    normal, poles = rng.standard_normal(40), rng.permutation(np.linspace(1.0, 40.0, 40)) ** 2 * 1e6
    found = _between_poles(normal, compliance, poles, 5e8)
    assert found is not None
    squares, shapes = _densely(normal[None], np.array([compliance]), poles, np.sqrt(5e8) / 1.3)
    order = np.argsort(squares)
    assert found[0] == pytest.approx(squares[order], rel=1e-7)
    unit, wanted = (s / np.linalg.norm(s, axis=0) for s in (found[1], shapes[:, order]))
    assert np.abs(np.einsum("ij,ij->j", unit, wanted)) == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize("poles", [[1e4, 1e4, 1e6], [-1e4, 1e4, 1e6]])
def test_where_poles_coincide_or_are_negative_it_is_left_to_the_dense_problem(poles: list[float]) -> None:
    assert _between_poles(np.ones(3), 1e-6, np.array(poles), 1e7) is None

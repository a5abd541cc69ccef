"""Factors of terms: values, exact derivatives, and the way through JSON."""

import json

import numpy as np
import pytest

from stridor.modal.parametric.factors import (
    CONSTANT,
    Axis,
    Formula,
    Lagrange,
    ParameterFactor,
    Product,
    TabulatedFactor,
    Together,
    factor_from_json,
)  # fmt: skip

POINT = {"mu": 0.4, "k": 1.7, "Omega": 12.0}
GRID = (0.0, 0.3, 0.8)
CASES: list[tuple[ParameterFactor, float]] = [
    (CONSTANT, 1.0),
    (Product((("mu", 0.9), ("k", 1.0))), 0.4 * 1.7),
    (Product((("mu", 0.9), ("mu", 0.9))), 0.16),
    (Product((("absent", 3.0), ("mu", 0.9))), 1.2),
    (Lagrange((("mu", GRID, 1),)), 0.4 * (0.4 - 0.8) / (0.3 * (0.3 - 0.8))),
    (Lagrange((("mu", GRID, 2), ("k", (1.0, 2.0), 0))), 0.4 * 0.1 / (0.8 * 0.5) * 0.3),
    (Formula("mu*rate/Omega**2", ("mu", "Omega"), (("rate", 3.0),)), 0.4 * 3 / 144),
]


@pytest.mark.parametrize(("factor", "value"), CASES)
def test_value_slope_and_the_way_through_json(factor: ParameterFactor, value: float) -> None:
    assert factor(POINT) == pytest.approx(value, rel=1e-14)
    again = factor_from_json(json.loads(json.dumps(factor.to_json())))
    assert again == factor
    for name, at in POINT.items():
        step = 1e-5 * at
        by_differences = (factor({**POINT, name: at + step}) - factor({**POINT, name: at - step})) / (2 * step)
        assert factor.slope(POINT, name) == pytest.approx(by_differences, rel=1e-7, abs=1e-9)
    assert factor.slope(POINT, "absent") == 0.0


def test_points_of_a_polynomial_are_its_values() -> None:
    weights = [Lagrange((("mu", GRID, k),)) for k in range(3)]
    np.testing.assert_allclose([[w({"mu": g}) for g in GRID] for w in weights], np.eye(3), atol=1e-15)


@pytest.mark.parametrize("document", [{}, {"kind": "code"}, {"kind": "product", "names": 3}, {"kind": "formula"}])
def test_what_is_no_factor_is_refused(document: dict[str, object]) -> None:
    with pytest.raises(ValueError, match="factor"):
        factor_from_json(document)


def test_factors_asked_together_are_those_asked_one_by_one() -> None:
    rng = np.random.default_rng(4)
    mu, modulus = Axis("mu", (0.0, 0.1, 0.4)), Axis("modulus", (1e8, 1e9, 2e9, 1e10), logarithmic=True)
    tables = [TabulatedFactor(axes, tuple(rng.standard_normal(np.prod([len(a.points) for a in axes])).tolist()))
              for axes in [(mu,), (modulus, mu), (mu,), (modulus, mu), (mu, modulus)]]  # fmt: skip
    factors = [Product((("mu", 1.0),)), *tables[:3], Lagrange((("mu", (0.0, 0.2), 1),)), *tables[3:]]
    for point in ({"mu": 0.4, "modulus": 1e9}, {"mu": 0.123, "modulus": 3e8}):
        np.testing.assert_allclose(Together(factors)(point), [f(point) for f in factors], rtol=1e-14)

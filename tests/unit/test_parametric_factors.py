"""Factors of terms: values, exact derivatives, and the way through JSON."""

import json

import numpy as np
import pytest

from stridor.modal.parametric.factors import CONSTANT, Formula, Lagrange, ParameterFactor, Product, factor_from_json

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

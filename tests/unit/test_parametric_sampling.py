"""Tabulated factors, and vectors sampled over a box of parameters until polynomials through them are exact."""

from __future__ import annotations

import json
from collections.abc import Mapping

import numpy as np
import pytest
import scipy.sparse as sp

from stridor.errors import AnalysisError
from stridor.modal.parametric import Parameter
from stridor.modal.parametric.contacts_sampling import combined_matrices, sampled
from stridor.modal.parametric.factors import (
    CONSTANT,
    Axis,
    Formula,
    ParameterFactor,
    Product,
    TabulatedFactor,
    Times,
    factor_from_json,
    product_of,
)
from stridor.modal.parametric.family import merged, term_of

POINT = {"mu": 0.4, "k": 1.7, "Omega": 12.0}
MU, K = Axis("mu", (0.0, 0.2, 0.7, 0.9)), Axis("k", (0.5, 1.0, 3.0), logarithmic=True)
TABLE = TabulatedFactor((MU, K), tuple((m**3 - 2 * m) * (1 + np.log(k) ** 2) for m in MU.points for k in K.points))
CASES: list[tuple[ParameterFactor, float]] = [
    (TabulatedFactor((MU,), tuple(m**3 for m in MU.points)), 0.064),
    (TABLE, (0.064 - 0.8) * (1 + np.log(1.7) ** 2)),
    (Times((Product((("mu", 1.0),)), TABLE)), 0.4 * (0.064 - 0.8) * (1 + np.log(1.7) ** 2)),
    (Times((Formula("1/Omega", ("Omega",)), TABLE, Product((("k", 1.0),)))), 1.7 / 12 * TABLE(POINT)),
]


@pytest.mark.parametrize(("factor", "value"), CASES)
def test_value_slope_and_the_way_through_json_of_tables(factor: ParameterFactor, value: float) -> None:
    assert factor(POINT) == pytest.approx(value, rel=1e-13)
    again = factor_from_json(json.loads(json.dumps(factor.to_json())))
    assert again == factor
    assert hash(again) == hash(factor)
    for name, at in POINT.items():
        step = 1e-5 * at
        by_differences = (factor({**POINT, name: at + step}) - factor({**POINT, name: at - step})) / (2 * step)
        assert factor.slope(POINT, name) == pytest.approx(by_differences, rel=1e-7, abs=1e-9)
    assert factor.slope(POINT, "absent") == 0.0


def test_slopes_at_the_points_of_a_table() -> None:
    cube = TabulatedFactor((MU,), tuple(m**3 for m in MU.points))
    assert [cube({"mu": m}) for m in MU.points] == [m**3 for m in MU.points]
    assert [cube.slope({"mu": m}, "mu") for m in MU.points] == pytest.approx([3 * m**2 for m in MU.points], abs=1e-14)
    squares = TabulatedFactor((K,), tuple(np.log(k) ** 2 for k in K.points))
    assert squares.slope({"k": 3.0}, "k") == pytest.approx(2 * np.log(3) / 3, rel=1e-14)
    assert np.isnan(squares({"k": -1.0}))


def test_products_are_as_simple_as_they_can_be() -> None:
    mu, k = Product((("mu", 1.0),)), Product((("k", 1.0),))
    assert product_of(mu, k) == product_of(k, mu) == Product((("k", 1.0), ("mu", 1.0)))
    assert product_of(CONSTANT, TABLE) is TABLE
    assert product_of(TABLE, CONSTANT) is TABLE
    assert product_of(Times((mu, TABLE)), TABLE) == Times((mu, TABLE, TABLE))
    one = sp.csr_array(np.array([[1.0, 2.0], [0.0, 1.0]]))
    found = merged([*term_of(one, "mass", mu), *term_of(one.T, "mass", mu), *term_of(one, "stiffness", mu)])
    assert [(t.role, t.symmetric) for t in found] == [("mass", True), ("stiffness", False)]
    assert term_of(0 * one, "mass", mu) == []


FRICTION, STIFFNESS, SPEED = Parameter("mu", 0.0, 0.6, 0.3), Parameter("k", 0.1, 10.0, 1.0), Parameter("v", 1.0, 2.0, 1.5)


def pressures(values: Mapping[str, float]) -> np.ndarray:
    """Normal forces as those of two springs, with a pole beyond each end: of friction that jams, of stiffness below 0."""
    mu, k = values["mu"], values["k"]
    return np.array([1 / (1.5 - mu), 3.0, mu / (2.0 + k), k / (0.3 + k) / (1.5 - mu)])


def test_samples_are_exact_between_their_points_and_few_vectors_span_them() -> None:
    found = sampled((FRICTION, STIFFNESS, SPEED), pressures, "pressure")
    assert [axis.name for axis in found.axes] == ["mu", "k"]
    assert found.axes[1].logarithmic
    assert len(found.vectors) < 300
    parts = found.compressed()
    assert len(parts) == 4
    rng = np.random.default_rng(2)
    for _ in range(5):
        point = {p.name: rng.uniform(p.low, p.high) for p in (FRICTION, STIFFNESS, SPEED)}
        truth = pressures(point)
        assert np.abs(found.at(point) - truth).max() < 1e-10 * 3
        assert np.abs(sum(factor(point) * vector for factor, vector in parts) - truth).max() < 1e-10 * 3


def test_what_nothing_changes_is_one_vector() -> None:
    found = sampled((SPEED,), lambda _: np.array([1.0, 2.0]), "pressure")
    assert found.axes == ()
    ((factor, vector),) = found.compressed()
    assert factor == CONSTANT
    assert vector.tolist() == [1.0, 2.0]
    assert sampled((SPEED,), lambda _: np.zeros(2), "pressure").compressed() == []


def test_what_changes_too_sharply_is_refused() -> None:
    with pytest.raises(AnalysisError, match=r"pressure changes too sharply with mu between 0 and 0\.6 .* smaller range"):
        sampled((FRICTION,), lambda v: np.array([abs(v["mu"] - 0.21)]), "pressure")
    # Smooth along each axis through the middle, but not beside it.
    with pytest.raises(AnalysisError, match="pressure changes too sharply with mu and v together"):
        sampled((FRICTION, SPEED), lambda v: np.array([v["mu"] + v["v"] + abs(v["mu"] - 0.3) * (v["v"] - 1.5)]), "pressure")


def test_matrices_over_a_grid_become_few() -> None:
    """f₁(μ) A + f₂(μ) B, given as one matrix at each of four points."""
    rng = np.random.default_rng(1)
    a, b = (m + m.T for m in (rng.standard_normal((2, 5, 5)) * (rng.random((2, 5, 5)) < 0.4)))
    given = [sp.csr_array((1 + m) * a + m**2 * b) for m in MU.points]
    found = combined_matrices((MU,), given, list(np.eye(4)))
    assert len(found) == 2
    for mu in (0.0, 0.33, 0.9):
        total = sum(factor({"mu": mu}) * matrix.toarray() for factor, matrix in found)
        np.testing.assert_allclose(total, (1 + mu) * a + mu**2 * b, atol=1e-13)

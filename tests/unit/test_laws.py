"""Laws of friction: what only some users of them ask for, by values written out."""

from __future__ import annotations

import pytest

from stridor.laws import Coulomb, FrictionLaw, Hyperbolic, StaticKinetic, Tabulated, Weakening
from stridor.laws.damping import Rayleigh
from stridor.laws.elasticity import Material, RectangularSection
from stridor.laws.packed import HEAD, KIND, KINETIC, LINEAR, POINTS, STICKING, coefficient_at


@pytest.mark.parametrize(
    ("law", "constant"),
    [
        (Coulomb(0.3), True),
        (StaticKinetic(0.3, 0.4), True),  # the same at every slip speed; rest is no speed
        (Weakening(0.2, 0.5, 0.05), False),
        (Weakening(0.5, 0.5, 0.05), True),
        (Weakening(0.5, 0.2, 0.05), False),  # friction that rises with speed
        (Hyperbolic(0.2, 0.5, 30.0), False),
        (Hyperbolic(0.5, 0.5, 30.0), True),
        (Hyperbolic(0.5, 0.2, 30.0), False),
        (Tabulated((0.0, 1.0), (0.3, 0.3), static_coefficient=0.4), True),
        (Tabulated((0.0, 1.0, 2.0), (0.3, 0.2, 0.3)), False),
    ],
)
def test_constant_tells_whether_friction_changes_with_speed(law: FrictionLaw, constant: bool):
    assert law.constant is constant
    assert (len({law.sliding(v) for v in (0.0, 0.3, 1.0, 1.7)}) == 1) is constant


def test_hyperbolic_friction_halves_its_drop_where_delta_times_speed_is_one():
    """μ(v) = μ_k + (μ_s − μ_k)/(1 + δv): 0.2 + 0.3/2 at v = 1/30, falling there at 0.3 · 30/4."""
    law = Hyperbolic(0.2, 0.5, 30.0)
    assert law.sticking == law.sliding(0.0) == 0.5
    assert law.sliding(1.0 / 30.0) == pytest.approx(0.35, rel=1e-15)
    assert law.slope(-1.0 / 30.0) == pytest.approx(-2.25, rel=1e-15)


def test_scaling_what_is_zero_at_the_speed_keeps_the_stick_limit():
    assert Hyperbolic(0.0, 0.0, 30.0).scaled(0.2, 0.02) == Coulomb(0.2)
    # 1/(1 + δv) underflows to nothing here: no factor reaches μ.
    assert Hyperbolic(0.0, 0.5, 1e200).scaled(0.2, 1e200) == Hyperbolic(0.2, 0.5, 1e200)
    assert Hyperbolic(0.0, 0.1, 1e200).scaled(0.2, 1e200) == Hyperbolic(0.2, 0.2, 1e200)
    assert Tabulated((0.0, 1.0), (0.0, 0.0), static_coefficient=0.1).scaled(0.2, 0.02) == StaticKinetic(0.2, 0.2)


@pytest.mark.parametrize("law", [Coulomb(0.3), StaticKinetic(0.3, 0.4), Tabulated((0.0, 1.0), (0.3, 0.3))])
@pytest.mark.parametrize("speed", [0.0, 0.5, 2.0])
def test_the_packed_form_of_constant_friction_is_flat(law: FrictionLaw, speed: float):
    assert coefficient_at(law.numbers, speed) == (0.3, 0.0)
    assert law.slope(speed) == 0.0


def test_a_table_of_one_coefficient_is_static_and_kinetic_friction_to_the_time_loop():
    table = Tabulated((0.0, 1.0), (0.3, 0.3), static_coefficient=0.4)
    assert table.numbers == StaticKinetic(0.3, 0.4).numbers
    assert Tabulated((0.0, 1.0), (0.3, 0.3)).numbers == Coulomb(0.3).numbers


def test_columns_of_a_packed_table_are_as_described():
    row = Tabulated((0.0, 1.0, 3.0), (0.5, 0.3, 0.4), static_coefficient=0.6).numbers
    assert (row[KIND], row[STICKING], row[KINETIC], row[POINTS]) == (LINEAR, 0.6, 0.4, 3.0)
    assert row[HEAD:] == (0.0, 1.0, 3.0, 0.5, 0.3, 0.4, 0.0, 0.0, 0.0)


def test_a_body_without_damping_has_none_at_any_frequency():
    for omega in (1e-3, 1.0, 1e6):
        assert Rayleigh().damping_ratio(omega) == 0.0
        # ζ = (α/ω + βω)/2
        assert Rayleigh(mass=3.0).damping_ratio(omega) == pytest.approx(1.5 / omega)
        assert Rayleigh(stiffness=4e-6).damping_ratio(omega) == pytest.approx(2e-6 * omega)
        assert Rayleigh(3.0, 4e-6).damping_ratio(omega) == pytest.approx(1.5 / omega + 2e-6 * omega)


def test_sections_and_materials_as_written():
    section = RectangularSection(width=0.2, thickness=0.03)
    assert section.area == pytest.approx(6e-3)
    assert section.second_moment == pytest.approx(0.2 * 2.7e-5 / 12)
    assert Material(2e11, 7800.0).poisson_ratio == 0.3


@pytest.mark.parametrize(
    ("law", "zero"),
    [
        (StaticKinetic(0.3, 0.4), StaticKinetic(0.0, 0.1)),
        (Weakening(0.2, 0.5, 0.05), Weakening(0.0, 0.1, 1e-300)),
        (Hyperbolic(0.2, 0.5, 30.0), Hyperbolic(0.0, 0.1, 1e308)),
        (Tabulated((0.0, 1.0), (0.4, 0.2), static_coefficient=0.6), Tabulated((0.0, 1.0), (0.1, 0.0), static_coefficient=0.1)),
    ],
)
def test_a_law_is_scaled_as_a_whole_to_its_coefficient_at_a_speed(law: FrictionLaw, zero: FrictionLaw):
    for speed in (0.0, 0.02, 0.5, -0.5):
        scaled = law.scaled(0.7, speed)
        assert scaled.sliding(speed) == pytest.approx(0.7)
        factor = 0.7 / law.sliding(speed)
        assert scaled.sticking == pytest.approx(factor * law.sticking)
        for other in (0.0, 0.1, 0.9):
            assert scaled.sliding(other) == pytest.approx(factor * law.sliding(other))
            assert scaled.slope(other) == pytest.approx(factor * law.slope(other))
    # Where it is zero at the speed no factor will do: μ is its coefficient, and the stick limit stays unless lower.
    for mu, sticking in ((0.05, 0.1), (0.3, 0.3)):
        at = zero.scaled(mu, 1e10)
        assert (at.sliding(1e10), at.sticking) == (pytest.approx(mu), sticking)


@pytest.mark.parametrize(
    "law",
    [StaticKinetic(0.0, 0.0), Weakening(0.0, 0.0, 0.1), Hyperbolic(0.0, 0.0, 3.0), Tabulated((0.0, 1.0), (0.0, 0.0))],
)
def test_a_law_that_is_zero_everywhere_becomes_coulombs(law: FrictionLaw):
    assert law.scaled(0.2, 0.5) == Coulomb(0.2)


@pytest.mark.parametrize("interpolation", ["linear", "monotone-cubic"])
def test_at_the_ends_of_a_table_the_slope_is_the_mean_of_both_sides(interpolation):
    """Beyond its ends a table is constant: half the slope of its first or last piece there, all of it at rest."""
    table = Tabulated((0.5, 1.0), (0.4, 0.2), interpolation)
    for speed, mu, slope in ((0.1, 0.4, 0.0), (0.5, 0.4, -0.2), (0.75, 0.3, -0.4), (1.0, 0.2, -0.2), (1.1, 0.2, 0.0)):
        assert table.sliding(speed) == pytest.approx(mu)
        assert table.slope(speed) == pytest.approx(slope)
    at_rest = Tabulated((0.0, 1.0, 3.0), (0.4, 0.2, 0.1), interpolation)
    assert at_rest.slope(0.0) == pytest.approx(at_rest.slope(1e-9), abs=1e-8)
    assert at_rest.slope(0.0) < -0.15
    if interpolation == "linear":
        assert at_rest.slope(1.0) == pytest.approx(0.5 * (-0.2 - 0.05))

"""The local contact problem, for any compliances, free motion and friction: Signorini and Coulomb hold,
always."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from stridor.contact.multipliers import OPEN, SLIP, STICK, solve_contact
from stridor.laws import Coulomb, StaticKinetic, Tabulated, Weakening

pytestmark = pytest.mark.property

size = st.floats(-3, 3).map(lambda e: 10.0**e)
sense = st.sampled_from([-1.0, 1.0])
compliance = st.tuples(size, size, st.floats(-0.999, 0.999)).map(
    lambda c: (c[0], c[2] * math.sqrt(c[0] * c[1]), c[1])
)
coefficient = st.floats(-3, 3).map(lambda e: 10.0**e)


@given(
    gap=size,
    slip=st.tuples(size, sense),
    w=compliance,
    mu=coefficient,
    raised=st.floats(1, 2),
    stuck=st.booleans(),
)
def test_any_closing_contact_has_an_admissible_answer(gap, slip, w, mu, raised, stuck):
    """Also where μ is so large that the pair jams."""
    w_nn, w_nt, w_tt = w
    free_gap, free_slip = -gap, slip[0] * slip[1]
    normal, tangential, status = solve_contact(
        free_gap, free_slip, w_nn, w_nt, w_tt, StaticKinetic(mu, raised * mu).numbers, stuck, 1.0
    )
    assert status in (STICK, SLIP)
    assert normal >= 0.0
    size_n = gap + w_nn * normal + abs(w_nt * tangential)
    size_t = abs(free_slip) + abs(w_nt * normal) + w_tt * abs(tangential)
    assert abs(free_gap + w_nn * normal + w_nt * tangential) < 1e-9 * size_n
    moved = free_slip + w_nt * normal + w_tt * tangential
    if status == STICK:
        assert abs(moved) < 1e-9 * size_t
        assert abs(tangential) <= (raised if stuck else 1.0) * mu * normal * (1 + 1e-9)
    else:
        assert abs(tangential) == pytest.approx(mu * normal, rel=1e-12)
        assert tangential * moved <= 1e-9 * size_t * abs(tangential)


@given(gap=st.floats(0, 1), slip=st.floats(-1, 1), w=compliance)
def test_an_open_gap_transmits_nothing(gap, slip, w):
    assert solve_contact(gap, slip, *w, StaticKinetic(0.3, 0.4).numbers, True, 1.0) == (0.0, 0.0, OPEN)


@given(gap=size, slip=st.tuples(size, sense), w=compliance, mu=coefficient)
def test_mirrored_slip_mirrors_friction(gap, slip, w, mu):
    w_nn, w_nt, w_tt = w
    a = solve_contact(-gap, slip[0] * slip[1], w_nn, w_nt, w_tt, Coulomb(mu).numbers, False, 1.0)
    b = solve_contact(-gap, -slip[0] * slip[1], w_nn, -w_nt, w_tt, Coulomb(mu).numbers, False, 1.0)
    assert (a[0], a[1], a[2]) == (b[0], -b[1], b[2])


@given(gap=size, slip=st.tuples(size, sense), w=compliance, decay=size)
def test_weakening_friction_is_that_of_the_speed_found(gap, slip, w, decay):
    """μ(v) and v belong together where friction hardly feeds back on the speed."""
    w_nn, _, w_tt = w
    # A heavy slider: friction moves it little over a step.
    w_tt = min(w_tt, 0.05 * slip[0] * w_nn / gap, 0.05 * decay * w_nn / gap)
    normal, tangential, status = solve_contact(
        -gap, slip[0] * slip[1], w_nn, 0.0, w_tt, Weakening(0.2, 0.5, decay).numbers, False, 1.0
    )
    assert status == SLIP
    moved = slip[0] * slip[1] + w_tt * tangential
    mu = 0.2 + 0.3 * math.exp(-abs(moved) / decay)
    assert abs(tangential) == pytest.approx(mu * normal, rel=1e-9)
    assert tangential * moved < 0


@given(
    gap=size,
    slip=st.tuples(size, sense),
    w=compliance,
    coefficients=st.lists(st.floats(0, 1), min_size=2, max_size=5),
    cubic=st.booleans(),
    stretch=size,
    stuck=st.booleans(),
)
def test_friction_by_table_is_that_of_the_speed_found(gap, slip, w, coefficients, cubic, stretch, stuck):
    """Whatever the table and the coupling, also where friction changes much with the speed that it makes."""
    w_nn, w_nt, w_tt = w
    speeds = tuple(stretch * k for k in range(len(coefficients)))
    law = Tabulated(speeds, tuple(coefficients), "monotone-cubic" if cubic else "linear")
    free_gap, free_slip = -gap, slip[0] * slip[1]
    normal, tangential, status = solve_contact(free_gap, free_slip, w_nn, w_nt, w_tt, law.numbers, stuck, 1.0)
    if status == OPEN:  # beyond the jamming limit of the pair
        assert max(coefficients) * abs(w_nt) >= 0.9 * w_nn
        return
    moved = free_slip + w_nt * normal + w_tt * tangential
    size_t = abs(free_slip) + abs(w_nt * normal) + w_tt * abs(tangential)
    assert abs(free_gap + w_nn * normal + w_nt * tangential) < 1e-9 * (gap + w_nn * normal + abs(w_nt * tangential))
    if status == STICK:
        assert abs(moved) < 1e-9 * size_t
        assert abs(tangential) <= law.sticking * normal * (1 + 1e-9)
    elif max(coefficients) * abs(w_nt) < 0.5 * min(w_nn, w_tt):
        assert tangential * moved <= 1e-9 * size_t * abs(tangential)
        tolerance = 1e-9 + 1e-9 * size_t * abs(law.slope(abs(moved)))
        assert abs(tangential) == pytest.approx(law.sliding(abs(moved)) * normal, rel=1e-6, abs=tolerance * normal)


@pytest.mark.parametrize("slip", [0.3, -0.3])
def test_a_pair_without_tangential_freedom(slip):
    """W = [[w, 0], [0, 0]]: the normal force alone closes the gap, friction follows the prescribed slip."""
    assert solve_contact(-2.0, slip, 4.0, 0.0, 0.0, StaticKinetic(0.5, 0.6).numbers, False, 1.0) == (
        0.5, pytest.approx(-0.25 * math.copysign(1, slip)), SLIP,
    )  # fmt: skip
    assert solve_contact(-2.0, 0.0, 4.0, 0.0, 0.0, StaticKinetic(0.5, 0.6).numbers, False, 1.0) == (0.5, 0.0, STICK)
    # Nothing can move at all: nothing a force could do.
    assert solve_contact(-2.0, 0.0, 0.0, 0.0, 0.0, StaticKinetic(0.5, 0.6).numbers, False, 1.0) == (0.0, 0.0, OPEN)


@given(gap=size, belt=st.floats(-3, 3), angle=st.floats(-1.5, 1.5), mu=st.floats(0, 3))
def test_a_point_on_an_oblique_guide(gap, belt, angle, mu):
    """One freedom for gap and slip (W singular): the gap closes, friction opposes what slip there is."""
    n, t = math.cos(angle), math.sin(angle)
    normal, tangential, status = solve_contact(-gap, belt, n * n, n * t, t * t, Coulomb(mu).numbers, False, 1.0)
    assert status in (STICK, SLIP)
    assert normal > 0.0
    assert abs(-gap + n * n * normal + n * t * tangential) < 1e-6 * (
        gap + n * n * normal + abs(n * t * tangential)
    )
    assert abs(tangential) <= mu * normal * (1 + 1e-9)

"""The C1 master line: what it must reproduce, its derivatives, and the projection on it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stridor.contact.interface import Rows, pair
from stridor.contact.surface import project, spline_point, spline_weights, unit_tangent
from stridor.laws import Coulomb

pytestmark = pytest.mark.verification

RNG = np.random.default_rng(3)


def nodes_of(kind: str) -> np.ndarray:
    if kind == "straight, uneven":
        s = np.cumsum([0, 0.1, 0.25, 0.05, 0.2, 0.13])
        return np.array([1.0, 2.0]) + np.outer(s, [0.6, -0.8])
    x = np.linspace(0, 1, 9)
    return np.column_stack([x, 0.08 * np.sin(5 * x)])


def chords_of(nodes):
    return np.linalg.norm(np.diff(nodes, axis=0), axis=1)


def at(nodes, segment, xi):
    weights, slopes = np.zeros(4), np.zeros(4)
    spline_weights(segment, xi, chords_of(nodes), weights, slopes)
    return np.array(spline_point(segment, nodes, weights)), np.array(spline_point(segment, nodes, slopes))


def test_straight_lines_are_reproduced_exactly():
    nodes = nodes_of("straight, uneven")
    for segment in range(len(nodes) - 1):
        for xi in np.linspace(0, 1, 7):
            point, slope = at(nodes, segment, xi)
            chord = nodes[segment + 1] - nodes[segment]
            np.testing.assert_allclose(point, nodes[segment] + xi * chord, atol=1e-15)
            np.testing.assert_allclose(slope, chord, atol=1e-14)


@pytest.mark.parametrize("kind", ["straight, uneven", "curved"])
def test_the_weights_sum_to_one_and_their_slopes_to_zero(kind):
    chords = chords_of(nodes_of(kind))
    weights, slopes = np.zeros(4), np.zeros(4)
    for segment in range(len(chords)):
        for xi in (0.0, 0.2, 0.7, 1.0):
            spline_weights(segment, xi, chords, weights, slopes)
            assert weights.sum() == pytest.approx(1, abs=1e-14)
            assert slopes.sum() == pytest.approx(0, abs=1e-14)


def test_the_line_passes_its_nodes_with_one_tangent():
    nodes = RNG.standard_normal((7, 2)).cumsum(axis=0)
    chords = chords_of(nodes)
    for segment in range(5):
        left, left_slope = at(nodes, segment, 1.0)
        right, right_slope = at(nodes, segment + 1, 0.0)
        np.testing.assert_allclose(left, nodes[segment + 1], atol=1e-14)
        np.testing.assert_allclose(right, left, atol=1e-14)
        # One derivative per metre of chord on both sides.
        np.testing.assert_allclose(
            left_slope / chords[segment], right_slope / chords[segment + 1], atol=1e-12
        )


@pytest.mark.parametrize("segment", [0, 3, 7])
def test_slopes_are_the_derivative_of_the_point(segment):
    nodes = nodes_of("curved")
    h = 1e-6
    for xi in (0.1, 0.5, 0.9):
        difference = (at(nodes, segment, xi + h)[0] - at(nodes, segment, xi - h)[0]) / (2 * h)
        np.testing.assert_allclose(at(nodes, segment, xi)[1], difference, atol=1e-9)


@given(st.floats(-0.05, 1.05), st.floats(-0.06, 0.12), st.integers(0, 7))
def test_the_projection_is_the_nearest_point(x, y, start):
    nodes = nodes_of("curved")
    chords = chords_of(nodes)
    weights, slopes = np.zeros(4), np.zeros(4)
    segment, xi, on_line = project(x, y, nodes, chords, start, 0.5, weights, slopes)
    found = np.hypot(*(np.array(spline_point(segment, nodes, weights)) - [x, y]))
    everywhere = [at(nodes, k, t)[0] for k in range(8) for t in np.linspace(0, 1, 60)]
    best = np.hypot(*(np.array(everywhere) - [x, y]).T).min()
    assert found <= best + 1e-12
    if on_line:
        tangent = np.array(unit_tangent(segment, nodes, slopes))
        offset = np.array([x, y]) - spline_point(segment, nodes, weights)
        assert abs(offset @ tangent) <= 1e-9
    else:
        assert (segment, xi) in ((0, 0.0), (7, 1.0))


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("place", [0.3, 0.37])
def test_a_pair_measures_relative_motion(side, place):
    """A slave above a straight master: gap, normal and the rows on rigid motions of either body."""
    master = np.column_stack([np.linspace(0, 1, 11), np.zeros(11)])
    size = 2 + 22
    identity = np.eye(size)
    contact = pair(
        "A",
        slave=Rows(identity[:2], np.zeros((2, 0))), slave_position=np.array([place, side * 0.02]),
        master=Rows(identity[2:], np.zeros((22, 0))), master_positions=master,
        side=side, stiffness=1.0, law=Coulomb(0.1),
    )  # fmt: skip
    assert contact is not None
    assert contact.gap == pytest.approx(0.02, abs=1e-12)
    np.testing.assert_allclose(contact.normal, [0, side], atol=1e-14)
    np.testing.assert_allclose(contact.tangent, [side, 0], atol=1e-14)
    slave_up, master_up, master_along = np.zeros(size), np.zeros(size), np.zeros(size)
    slave_up[1] = side
    master_up[3::2] = side
    master_along[2::2] = 1.0
    assert contact.normal_row @ slave_up == pytest.approx(1.0)
    assert contact.normal_row @ master_up == pytest.approx(-1.0)
    assert contact.tangent_row @ master_along == pytest.approx(-side)


def test_a_slave_beyond_the_ends_has_no_pair():
    master = np.column_stack([np.linspace(0, 1, 5), np.zeros(5)])
    nothing = Rows(np.zeros((2, 1)), np.zeros((2, 0)))
    long = Rows(np.zeros((10, 1)), np.zeros((10, 0)))
    for x in (-0.01, 1.01):
        position = np.array([x, 0.1])
        assert pair("A", slave=nothing, slave_position=position, master=long, master_positions=master, side=1,
                    stiffness=1.0, law=Coulomb(0.1)) is None  # fmt: skip

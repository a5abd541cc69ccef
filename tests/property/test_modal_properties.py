"""What must hold for every bench."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment

from benches import Slave, bench, distance_to, full_eigenvalues
from stridor.modal.complex_modes import complex_modes

pytestmark = pytest.mark.property

DAMPINGS = st.tuples(st.sampled_from([0.0, 50.0, 900.0]), st.sampled_from([0.0, 1e-8, 4e-7]))
STIFFNESSES = st.one_of(st.just("rigid"), st.floats(3, 11).map(lambda e: float(10**e)))
SLAVES = st.builds(
    Slave,
    place=st.floats(0.2, 1.0),
    lean_deg=st.floats(-40, 40),
    length=st.floats(0.03, 0.09),
    elements=st.integers(2, 4),
    damping=DAMPINGS,
    stiffness=STIFFNESSES,
    side=st.sampled_from([1, -1]),
    end=st.just("clamped"),
)


def assert_same_set(one, other):
    """Equal up to order: rounding of real parts near zero must not decide how they are paired."""
    assert len(one) == len(other)
    distance = np.abs(one[:, None] - other)
    rows, columns = linear_sum_assignment(distance)
    assert np.all(distance[rows, columns] <= 1.0 + 1e-5 * np.abs(other[columns]))


@st.composite
def benches(draw, most=2):
    slaves = draw(st.lists(SLAVES, min_size=1, max_size=most))
    rest = {
        "angle_deg": draw(st.floats(-180, 180)),
        "elements": draw(st.integers(3, 6)),
        "damping": draw(DAMPINGS),
    }
    return slaves, rest


def free(slaves, **rest):
    """Without loads: every contact touches."""
    return replace(bench(*slaves, **rest), loads={})


@settings(max_examples=30)
@given(benches())
def test_nothing_grows_without_friction(drawn):
    slaves, rest = drawn
    modes = complex_modes(free(slaves, **rest), 0.0, max_frequency_hz=60e3)
    assert not modes.unstable.any()
    assert modes.growth_rate.max(initial=0.0) <= 1e-9 * np.abs(modes.eigenvalues).max(initial=1.0)
    assert modes.residual.max(initial=0.0) < 1e-8


@settings(max_examples=20)
@given(benches(), st.floats(0.05, 0.6))
def test_the_mirrored_bench_has_the_same_spectrum(drawn, mu):
    slaves, rest = drawn
    if any(s.stiffness == "rigid" for s in slaves):
        mu = min(mu, 0.2)
    one = free(slaves, **rest, velocity=0.02)
    # Mirrored in the y axis the master points the other way and the slaves change sides; the velocity,
    # given along the master, is mirrored with it.
    other = [replace(s, side=-s.side) for s in slaves]
    two = free(other, **(rest | {"angle_deg": 180.0 - rest["angle_deg"]}), velocity=0.02)
    first, second = (complex_modes(s, mu, max_frequency_hz=20e3).eigenvalues[0] for s in (one, two))
    assert first.shape == second.shape
    assert_same_set(second, first)
    reversed_ = full_eigenvalues(free(slaves, **rest, velocity=-0.02), mu)
    assert full_eigenvalues(one, mu).shape == reversed_.shape


@settings(max_examples=15)
@given(benches(most=1), st.floats(0.3, 3.0))
def test_frequencies_scale_with_the_root_of_stiffness(drawn, factor):
    slaves, rest = drawn
    rest["damping"] = (0.0, 0.0)
    soft = [replace(s, damping=(0.0, 0.0)) for s in slaves]
    hard = [s if s.stiffness == "rigid" else replace(s, stiffness=s.stiffness * factor) for s in soft]
    first = complex_modes(free(soft, **rest), 0.1, count=8).eigenvalues[0]
    second = complex_modes(free(hard, **rest, modulus_factor=factor), 0.1, count=8).eigenvalues[0]
    assert_same_set(second, first * np.sqrt(factor))


@settings(max_examples=25)
@given(benches(), st.floats(0.0, 0.5))
def test_every_eigenvalue_is_one_of_the_full_pencil(drawn, mu):
    slaves, rest = drawn
    if any(s.stiffness == "rigid" for s in slaves):
        mu = min(mu, 0.2)
    system = free(slaves, **rest)
    modes = complex_modes(system, mu, max_frequency_hz=40e3)
    dense = full_eigenvalues(system, mu)
    loss = 1e-13 * (np.abs(dense).max() / np.maximum(np.abs(modes.eigenvalues[0]), 1.0)) ** 2
    assert np.all(distance_to(modes.eigenvalues[0], dense) < 1e-6 + loss)
    assert modes.residual.max(initial=0.0) < 1e-6

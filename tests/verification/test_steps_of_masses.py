"""The time step of models of masses and springs, all of whose modes are meant."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as sl

import stridor as st
from stridor.temporal.beta2 import RESOLVED, SAFE_FRACTION, step_limit

pytestmark = pytest.mark.verification

CASE = """
[bodies.m]
type = "mass"
mass = 1.0
position = [0.0, 0.0]
[bodies.floor]
type = "obstacle"
shape = "flat"
point = [0.0, 0.0]
normal = [0.0, 1.0]
sliding = { velocity = [1.0, 0.0] }
[springs.a]
between = ["m", "ground"]
stiffness = 2e4
direction = [1.0, 1.0]
[springs.b]
between = ["m", "ground"]
stiffness = 3e4
direction = [1.0, -0.6]
[loads.press]
at = "m"
force = [0.0, -10.0]
[contacts.A]
slave = "m"
master = "floor"
stiffness = 1.5e4
friction = { law = "coulomb", coefficient = 0.9 }
[modal]
max_frequency_hz = 1000.0
[comparison]
critical = false
"""


def test_flutter_of_a_mass_grows_in_time_as_its_mode_does() -> None:
    """At 0.9 of the limit both modes have other frequencies in time, 27 % too high, that do not meet."""
    case = st.loads(CASE)
    unit = np.array([[1.0, 1.0], [1.0, -0.6]]) / np.array([[np.sqrt(2.0)], [np.hypot(1.0, 0.6)]])
    matrix = 2e4 * np.outer(unit[0], unit[0]) + 3e4 * np.outer(unit[1], unit[1])
    matrix += 1.5e4 * np.array([[0.0, 0.9], [0.0, 1.0]])
    exact = np.emath.sqrt(-sl.eigvals(matrix))
    exact = exact[exact.real > 1.0][0]
    found = st.compare(case)
    assert found.verdict.startswith("agree: ")
    small = found.comparisons[0].perturbation
    assert small is not None
    assert abs(small.eigenvalue.imag) == pytest.approx(abs(exact.imag), rel=5e-3)
    assert small.eigenvalue.real == pytest.approx(exact.real, rel=0.003)


def test_the_step_is_a_share_of_the_limit() -> None:
    masses = st.build_system(st.loads(CASE))
    limit = step_limit(masses, 0.5)
    assert limit.share == RESOLVED
    assert 2 * np.pi / limit.omega_max / (limit.share * limit.step) == pytest.approx(80.0, rel=1e-3)
    assert st.simulate(st.loads(CASE)).step == pytest.approx(RESOLVED * limit.step)
    meshed = st.loads(CASE.replace("[springs.a]", BEAM + "[springs.a]", 1))
    assert step_limit(st.build_system(meshed), 0.5).share == SAFE_FRACTION


BEAM = """
[materials.steel]
young_modulus = 2e11
density = 7800.0
[bodies.beam]
type = "beam"
material = "steel"
start = [0.0, 1.0]
end = [1.0, 1.0]
width = 0.01
thickness = 0.01
elements = 2
mass = "lumped"
[supports.clamp]
at = "beam.start"
fixed = ["x", "y", "rotation"]
"""

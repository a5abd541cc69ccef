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
    assert limit.usual(None) == limit.usual(1000.0) == RESOLVED * limit.step
    assert 2 * np.pi / limit.omega_max / limit.usual(None) == pytest.approx(80.0, rel=1e-3)
    assert st.simulate(st.loads(CASE)).step == pytest.approx(RESOLVED * limit.step)
    meshed = st.loads(CASE.replace("[springs.a]", BEAM + "[springs.a]", 1))
    limit = step_limit(st.build_system(meshed), 0.5)
    assert limit.usual(None) == limit.usual(1e-3) == SAFE_FRACTION * limit.step


def test_matrices_alone_are_resolved_up_to_what_is_looked_at() -> None:
    """At 0.9 of the limit their flutter would be missed just as that of masses: "they disagree"."""
    unit = np.array([[1.0, 1.0], [1.0, -0.6]]) / np.array([[np.sqrt(2.0)], [np.hypot(1.0, 0.6)]])
    structure = 2e4 * np.outer(unit[0], unit[0]) + 3e4 * np.outer(unit[1], unit[1])
    contact = {"normal": [0.0, 1.0], "tangent": [1.0, 0.0], "slip": -1.0, "stiffness": 1.5e4}
    friction = {"law": "coulomb", "coefficient": 0.9}
    system = st.System.from_matrices(
        np.eye(2), None, structure, contacts={"A": contact | {"friction": friction}}, loads={"press": [0.0, -10.0]}
    )
    asked = {"modal": {"max_frequency_hz": 1000.0}, "phases": [{"name": "run", "duration": 1.0}]}
    growing = sl.eigvals(structure + 1.5e4 * np.array([[0.0, 0.9], [0.0, 1.0]]))
    exact = np.emath.sqrt(-growing).real.max()
    found = st.compare(st.Workspace(system, **asked), 0.9, critical=False).comparisons[0]
    assert found.verdict.startswith("μ = 0.9: both unstable at ")
    assert found.perturbation.eigenvalue.real == pytest.approx(exact, rel=0.003)
    limit = step_limit(system, 0.5)
    top = limit.omega_max / (2 * np.pi)
    assert 80 * top * limit.usual(None) == pytest.approx(1.0, rel=1e-3)
    assert 80 * top / 3 * limit.usual(top / 3) == pytest.approx(1.0, rel=1e-3)
    assert limit.usual(top / 1000) == SAFE_FRACTION * limit.step
    chain = st.System.from_matrices(np.eye(61), None, 2e4 * (2 * np.eye(61) - np.eye(61, k=1) - np.eye(61, k=-1)))
    limit = step_limit(chain, 0.5)  # of many freedoms only what is looked at is known to be meant
    assert limit.usual(None) == SAFE_FRACTION * limit.step
    assert limit.usual(1e4) == RESOLVED * limit.step


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

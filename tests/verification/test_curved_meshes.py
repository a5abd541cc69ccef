"""A ring on a shaft whose meshes do not match: facets decide what touches, and the user is told what helps."""

from __future__ import annotations

import numpy as np
import pytest

import stridor as st
from stridor.system import build_system

pytestmark = pytest.mark.verification


def ring(inner: str, around: int, shaft: int, adjust: float = 0.0) -> st.Case:
    """A ring of 30 and 50 mm, pressed on a shaft of its own radius by 1 MPa from outside."""

    def annulus(name: str, radii: tuple[float, float], cells: str, count: int) -> str:
        return f"""
[bodies.{name}]
type = "solid"
model = "plane stress"
thickness = 0.01
material = "steel"
mesh = {{ shape = "annulus", inner_radius = {radii[0]}, outer_radius = {radii[1]}, divisions = [1, {count}], cells = "{cells}" }}
"""

    springs = "".join(
        f"""
[springs.{name}]
between = ["ring.{name}", "ground"]
direction = {direction}
stiffness = 1e7
"""
        for name, direction in (("right", [0, 1]), ("left", [0, 1]), ("top", [1, 0]))
    )
    return st.loads(f"""
materials.steel = {{ young_modulus = 2e11, density = 7800.0, poisson_ratio = 0.3 }}
{annulus("ring", (0.03, 0.05), inner, around)}
points = {{ right = [0.05, 0.0], left = [-0.05, 0.0], top = [0.0, 0.05] }}
{annulus("shaft", (0.01, 0.03), "quad8", shaft)}
sliding = {{ spin = 10.0 }}
[supports.hub]
at = "shaft.inner"
fixed = ["x", "y"]
{springs}
[loads.press]
at = "ring.outer"
pressure = 1e6
[contacts.bore]
slave = "ring.inner"
master = "shaft.outer"
stiffness = 1e13
adjust = {adjust}
friction = {{ law = "coulomb", coefficient = 0.0 }}
""")


def evenness(case: st.Case) -> tuple[float, tuple[str, ...]]:
    """Largest pressure over the mean, and what is warned of."""
    found = st.steady_sliding(case)
    pressure = found.normal_force / build_system(case).contact_nodes().area
    return float(pressure.max() / np.mean(pressure)), found.warnings


@pytest.mark.parametrize(("cells", "around", "shaft"), [("triangle6", 12, 16), ("quad8", 13, 10)])
def test_meshes_that_decide_what_touches_are_told(cells: str, around: int, shaft: int) -> None:
    uneven, warnings = evenness(ring(cells, around, shaft))
    assert uneven > 2.0
    (said,) = warnings
    assert "by no more than facets leave of curved surfaces" in said
    adjust = float(said.rsplit("= ", 1)[1])
    mended, warnings = evenness(ring(cells, around, shaft, adjust))
    assert mended < 1.2
    assert warnings == ()


def test_matching_meshes_are_not() -> None:
    even, warnings = evenness(ring("quad8", 12, 12))
    assert even < 1.2
    assert warnings == ()

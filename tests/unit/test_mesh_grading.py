"""Uneven elements in built-in meshes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import stridor as st
from stridor.case import loads
from stridor.errors import CaseError
from stridor.mesh import shapes
from stridor.mesh.quality import check_mesh

PLANE, SPACE = ("triangle", "triangle6", "quad", "quad8", "quad9"), ("tetra", "tetra10", "hexahedron", "hexahedron27")


def ends(points: np.ndarray, step: int) -> np.ndarray:
    return np.unique(points.round(12))[::step]


@pytest.mark.parametrize("kind", PLANE)
def test_ratios_and_places(kind: str) -> None:
    """Sizes 1 : 2 : 4 : 8 of four cells, and places as given; midside nodes half way between."""
    mesh = shapes.rectangle([0.0, 0.0], [3.0, 2.0], [4, 3], grading=[8.0, [0.0, 0.1, 0.5, 1.0]], kind=kind)
    step = 1 if kind in ("triangle", "quad") else 2
    assert ends(mesh.points[:, 0], step) == pytest.approx(3.0 * np.array([0, 1, 3, 7, 15]) / 15, abs=1e-12)
    assert ends(mesh.points[:, 1], step) == pytest.approx([0.0, 0.2, 1.0, 2.0], abs=1e-12)
    if step == 2:
        middles = np.unique(mesh.points[:, 1].round(12))[1::2]
        assert middles == pytest.approx([0.1, 0.6, 1.5], abs=1e-12)
    check_mesh(mesh, "here")


@pytest.mark.parametrize("kind", SPACE)
def test_in_space_and_round_a_circle(kind: str) -> None:
    grading = [0.25, [0.0, 0.2, 0.5, 1.0], 4.0]
    mesh = shapes.pad([0.0, 0.0, 0.0], 0.1, 0.2, 0.0, 60.0, 0.03, [3, 3, 2], grading=grading, kind=kind)
    step = 1 if kind in ("tetra", "hexahedron") else 2
    radius = np.hypot(mesh.points[:, 0], mesh.points[:, 1])
    angle = np.degrees(np.arctan2(mesh.points[:, 1], mesh.points[:, 0]))
    assert ends(radius, step) == pytest.approx(0.1 + 0.1 * np.array([0.0, 4.0, 6.0, 7.0]) / 7.0, abs=1e-9)
    assert ends(angle.round(6), step) == pytest.approx([0.0, 12.0, 30.0, 60.0], abs=1e-5)
    assert ends(mesh.points[:, 2], step) == pytest.approx([0.0, 0.006, 0.03], abs=1e-12)
    check_mesh(mesh, "here")


@pytest.mark.parametrize(
    "made",
    [
        lambda g: shapes.rectangle([0, 0], [1, 1], [3, 2], grading=g),
        lambda g: shapes.annulus([0, 0], 0.5, 1.0, [3, 12], grading=g),
        lambda g: shapes.annulus([0, 0], 0.0, 1.0, [3, 12], grading=g),
        lambda g: shapes.block([0, 0, 0], [1, 1, 1], [2, 2, 2], grading=None if g is None else [*g, 1.0]),
        lambda g: shapes.disc([0, 0, 0], 0.5, 1.0, 0.1, [2, 9, 1], grading=None if g is None else [*g, 1.0]),
    ],
)
def test_ratios_of_one_change_no_digit(made: Any) -> None:
    assert np.array_equal(made(None).points, made([1.0, 1.0]).points)


def test_a_solid_disc_and_a_ring_round() -> None:
    solid = shapes.annulus([0.0, 0.0], 0.0, 1.0, [4, 8], grading=[0.125, 1.0])
    # Along the rays where the square's corners are: from 0.4 √2 to the circle in 8 : 4 : 2 : 1.
    diagonal = solid.points[np.isclose(*np.abs(solid.points).T) & (solid.points > 0.39).all(axis=1)]
    start = 0.4 * np.sqrt(2.0)
    expected = start + (1.0 - start) * np.array([0, 8, 12, 14, 15]) / 15
    assert np.sort(np.hypot(*diagonal.T)) == pytest.approx(expected, abs=1e-12)
    ring = shapes.annulus([0.0, 0.0], 0.5, 1.0, [1, 4], grading=[1.0, [0.0, 0.1, 0.4, 0.6, 1.0]])
    angles = np.unique(np.degrees(np.arctan2(ring.points[:, 1], ring.points[:, 0])).round(6) % 360)
    assert angles == pytest.approx([0.0, 36.0, 144.0, 216.0], abs=1e-5)


CASE = """
materials.steel = { young_modulus = 200e9, density = 7800.0, poisson_ratio = 0.0 }
[bodies.bar]
type = "solid"
material = "steel"
model = "plane stress"
thickness = 0.01
mass = "consistent"
mesh = { shape = "rectangle", corner = [0.0, 0.0], size = [0.2, 0.01], divisions = [12, 1], MORE }
[supports.root]
at = "bar.left"
fixed = ["x", "y"]
[supports.guide]
at = "bar.bottom"
fixed = ["y"]
[supports.rail]
at = "bar.top"
fixed = ["y"]
"""


@pytest.mark.parametrize("grading", ["[20, 1]", "[0.05, 1]", "[[0, 0.3, 0.4, 0.5, 0.55, 0.6, 0.65, 0.7, 0.75, 0.8, 0.85, 0.9, 1], 1]"])
def test_a_graded_bar_has_the_frequency_of_a_bar(grading: str) -> None:
    """c/4L with c = √(E/ρ); longest element 0.06 m, quadratic."""
    case = loads(CASE.replace("MORE", f"grading = {grading}"))
    found = st.modes(case, 0.0, count=1).frequency_hz[0, 0]
    assert found == pytest.approx(np.sqrt(200e9 / 7800.0) / 0.8, rel=2e-5)


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ("grading = [2.0]", "bodies.bar.mesh.grading: [2.0] – must have 2 entries: along x, along y"),
        ("grading = [2.0, 1e9]", "bodies.bar.mesh.grading.1: 1000000000.0 – must be between 0.0001 and 10000: the last cell's size over the first's"),
        ("grading = [2.0, [0, 0.5, 1]]", "bodies.bar.mesh.grading.1: [0.0, 0.5, 1.0] – must be 2 numbers that rise from 0 to 1, the ends of 1 elements"),
        ("grading = [2.0, [0.1, 1]]", "bodies.bar.mesh.grading.1: [0.1, 1.0] – must be 2 numbers that rise from 0 to 1, the ends of 1 elements"),
        ("grading = 2.0", "bodies.bar.mesh.grading: 2.0 – must be a list with an entry for each of the divisions: a number > 0, the last element's size over the first's, or a list of the places of the elements' ends, from 0 to 1"),
        ("grading = [-2.0, 1]", "bodies.bar.mesh.grading: [-2.0, 1] – must be a list with an entry for each of the divisions: a number > 0, the last element's size over the first's, or a list of the places of the elements' ends, from 0 to 1"),
    ],
)  # fmt: skip
def test_gradings_that_will_not_do(more: str, message: str) -> None:
    with pytest.raises(CaseError) as caught:
        st.build_system(loads(CASE.replace("MORE", more)))
    assert str(caught.value) == message


def test_gradings_need_divisions() -> None:
    with pytest.raises(CaseError, match=r"grading: \[2\.0, 1\.0\] – goes with divisions, not with element_size"):
        loads(CASE.replace("divisions = [12, 1]", "element_size = 0.01").replace("MORE", "grading = [2.0, 1.0]"))
    with pytest.raises(CaseError, match=r"a solid disc is even round its circumference"):
        shapes.annulus([0.0, 0.0], 0.0, 1.0, [4, 8], grading=[1.0, 2.0])

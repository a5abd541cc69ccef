"""Beam elements and their assembly against closed forms.

Blevins, Formulas for Natural Frequency and Mode Shape, 1979, tables 8-1 and 8-16.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
import scipy.linalg as sl
from scipy.optimize import brentq

from stridor.fe.assembly import assemble_beam
from stridor.fe.beam import BeamElement, BeamMesh

pytestmark = pytest.mark.verification

LENGTH, EA, EI, LINE_DENSITY = 0.7, 3.0e6, 55.0, 1.3


def beam(elements: int, *, angle: float = 0.0, length: float = LENGTH) -> BeamMesh:
    direction = (math.cos(angle), math.sin(angle))
    return BeamMesh((0.1, -0.2), elements, BeamElement(length / elements, EA, EI, LINE_DENSITY, direction))


def spectrum(mesh: BeamMesh, held: list[int], *, lumped: bool = False) -> np.ndarray:
    """ω (k,) of the beam with the freedoms `held`."""
    mass, stiffness = (a.toarray() for a in assemble_beam(mesh, lumped=lumped))
    free = np.setdiff1d(np.arange(len(mass)), held)
    values = sl.eigvalsh(stiffness[np.ix_(free, free)], mass[np.ix_(free, free)])
    return np.sqrt(np.maximum(values, 0.0))


def only(mesh: BeamMesh, freedoms: tuple[int, ...]) -> list[int]:
    """All freedoms of the other directions, to hold them."""
    return [3 * n + d for n in range(mesh.elements + 1) for d in range(3) if d not in freedoms]


def roots(function, count: int) -> list[float]:
    grid = np.linspace(0.5, math.pi * (count + 1.5), 4000)
    signs = [function(x) for x in grid]
    found = [
        brentq(function, a, b, xtol=1e-14)
        for a, b, p, q in zip(grid, grid[1:], signs, signs[1:], strict=False)
        if p * q < 0
    ]
    return found[:count]


def bending(values: list[float]) -> np.ndarray:
    return np.array(values) ** 2 * math.sqrt(EI / LINE_DENSITY) / LENGTH**2


# Divided by cosh, so that the functions stay of order one.
SUPPORTS = {
    "cantilever": (lambda x: math.cos(x) + 1 / math.cosh(x), [0, 1, 2], 0),
    "free-free": (lambda x: math.cos(x) - 1 / math.cosh(x), [], 2),
    # guided at one end (rotation held), free at the other: tan x + tanh x = 0
    "guided-free": (lambda x: math.sin(x) + math.cos(x) * math.tanh(x), ["rotation"], 1),
}


@pytest.mark.parametrize("name", SUPPORTS)
def test_bending_frequencies(name):
    equation, held, rigid = SUPPORTS[name]
    mesh = beam(40)
    last = 3 * mesh.elements
    fixed = [last + 2] if held == ["rotation"] else held
    got = spectrum(mesh, sorted({*only(mesh, (1, 2)), *fixed}))
    assert np.all(got[:rigid] < 1e-3 * got[rigid])
    np.testing.assert_allclose(got[rigid : rigid + 5], bending(roots(equation, 5)), rtol=3e-5)


def test_rod_frequencies():
    mesh = beam(200)
    got = spectrum(mesh, sorted({*only(mesh, (0,)), 0}))
    exact = (2 * np.arange(4) + 1) * math.pi / 2 * math.sqrt(EA / LINE_DENSITY) / LENGTH
    np.testing.assert_allclose(got[:4], exact, rtol=2e-4)


def order(errors: list[float], meshes: list[int]) -> float:
    return float(-np.polyfit(np.log(meshes), np.log(errors), 1)[0])


@pytest.mark.parametrize("mode", [0, 1, 2])
def test_bending_converges_with_the_fourth_power(mode):
    exact = bending(roots(SUPPORTS["cantilever"][0], 3))[mode]
    meshes = [6, 8, 12, 16]
    errors = []
    for elements in meshes:
        mesh = beam(elements)
        errors.append(spectrum(mesh, sorted({*only(mesh, (1, 2)), 0, 1, 2}))[mode] / exact - 1)
    assert min(errors) > 0  # Ritz: from above
    assert order(errors, meshes) == pytest.approx(4, abs=0.2)


@pytest.mark.parametrize("mode", [0, 1, 2])
@pytest.mark.parametrize(("lumped", "sign"), [(False, 1), (True, -1)])
def test_traction_converges_quadratically(mode, lumped, sign):
    exact = (2 * mode + 1) * math.pi / 2 * math.sqrt(EA / LINE_DENSITY) / LENGTH
    meshes = [10, 20, 40]
    errors = []
    for elements in meshes:
        mesh = beam(elements)
        held = sorted({*only(mesh, (0,)), 0})
        errors.append(sign * (spectrum(mesh, held, lumped=lumped)[mode] / exact - 1))
    assert min(errors) > 0  # consistent from above, lumped from below
    assert order(errors, meshes) == pytest.approx(2, abs=0.05)


@pytest.mark.parametrize("lumped", [False, True])
@pytest.mark.parametrize("angle", [0.0, 0.4, math.pi / 2, -2.1])
def test_total_mass_and_moment_of_inertia(lumped, angle):
    mesh = beam(7, angle=angle)
    mass, _ = assemble_beam(mesh, lumped=lumped)
    total = LINE_DENSITY * LENGTH
    x, y = mesh.coordinates().T
    for direction in (0, 1):
        move = np.zeros(mass.shape[0])
        move[direction::3] = 1.0
        assert move @ mass @ move == pytest.approx(total, rel=1e-13)
        assert np.zeros_like(move) @ mass @ move == 0.0
    turn = np.zeros(mass.shape[0])
    turn[0::3], turn[1::3], turn[2::3] = -(y - y.mean()), x - x.mean(), 1.0
    if not lumped:
        assert turn @ mass @ turn == pytest.approx(total * LENGTH**2 / 12, rel=1e-12)
    else:
        assert np.all(mass.toarray() == np.diag(mass.diagonal()))
        assert np.all(mass.diagonal() > 0)


@pytest.mark.parametrize("lumped", [False, True])
@pytest.mark.parametrize("angle", [0.3, math.pi / 2, 2.5, -1.0])
def test_a_turned_beam_has_the_same_spectrum(lumped, angle):
    straight, turned = (spectrum(beam(6, angle=a), [0, 1, 2], lumped=lumped) for a in (0.0, angle))
    np.testing.assert_allclose(turned, straight, rtol=1e-9)


@pytest.mark.parametrize("angle", [0.0, 0.7, math.pi / 2])
def test_rigid_motions_carry_no_energy(angle):
    mesh = beam(5, angle=angle)
    _, stiffness = assemble_beam(mesh)
    x, y = mesh.coordinates().T
    motions = np.zeros((3, stiffness.shape[0]))
    motions[0, 0::3] = motions[1, 1::3] = motions[2, 2::3] = 1.0
    motions[2, 0::3], motions[2, 1::3] = -y, x
    scale = np.abs(stiffness).max()
    assert np.abs(stiffness @ motions.T).max() < 1e-14 * scale
    assert np.linalg.matrix_rank(stiffness.toarray(), tol=1e-9 * scale) == stiffness.shape[0] - 3


@pytest.mark.parametrize("angle", [0.0, 1.1])
def test_tip_deflection_under_a_static_load(angle):
    mesh = beam(4, angle=angle)
    _, stiffness = assemble_beam(mesh)
    size = stiffness.shape[0]
    inner = stiffness.toarray()[3:, 3:]
    along, across = np.array(mesh.element.direction), np.array([-math.sin(angle), math.cos(angle)])
    load = np.zeros((size, 2))
    load[-3:-1, 0], load[-3:-1, 1] = across, along
    answer = np.zeros((size, 2))
    answer[3:] = np.linalg.solve(inner, load[3:])
    assert answer[-3:-1, 0] @ across == pytest.approx(LENGTH**3 / (3 * EI), rel=1e-9)
    assert answer[-1, 0] == pytest.approx(LENGTH**2 / (2 * EI), rel=1e-9)
    assert answer[-3:-1, 1] @ along == pytest.approx(LENGTH / EA, rel=1e-9)


@pytest.mark.parametrize("angle", [0.0, 0.9, -math.pi / 2])
def test_interpolation_reproduces_linear_traction_and_cubic_bending(angle):
    mesh = beam(5, angle=angle)
    along, across = np.array(mesh.element.direction), np.array([-math.sin(angle), math.cos(angle)])
    u, v = np.poly1d([0.3, -0.2]), np.poly1d([2.0, -1.0, 0.5, 0.1])
    distance = np.linspace(0, LENGTH, 6)
    nodal = np.zeros(18)
    for n, s in enumerate(distance):
        nodal[3 * n : 3 * n + 2] = u(s) * along + v(s) * across
        nodal[3 * n + 2] = v.deriv()(s)
    for s in np.linspace(0, LENGTH, 23):
        freedoms, rows = mesh.interpolation(float(s))
        expected = np.append(u(s) * along + v(s) * across, v.deriv()(s))
        np.testing.assert_allclose(rows @ nodal[freedoms], expected, atol=1e-13)


def test_a_beam_along_an_axis_keeps_traction_and_bending_apart():
    for angle in (0.0, math.pi / 2):
        direction = (1.0, 0.0) if angle == 0 else (0.0, 1.0)
        mesh = BeamMesh((0.0, 0.0), 3, BeamElement(0.1, EA, EI, LINE_DENSITY, direction))
        from stridor.fe.assembly import connected_components

        assert sorted(map(len, connected_components(*assemble_beam(mesh)))) == [4, 8]


@pytest.mark.parametrize("direction", [(1.0, 0.0), (0.6, 0.8)])
def test_the_lumped_mass_is_the_scaled_diagonal_of_the_consistent_one(direction):
    """Hinton, Rock and Zienkiewicz (1976): the bending diagonal scaled so that its translations make the mass."""
    length, line_density = 0.3, 7.0
    straight = BeamElement(length, 2e6, 30.0, line_density, (1.0, 0.0))
    diagonal = np.diag(straight.mass())
    bending = diagonal * line_density * length / (diagonal[1] + diagonal[4])
    lumped = BeamElement(length, 2e6, 30.0, line_density, direction).mass(lumped=True)
    np.testing.assert_array_equal(lumped, np.diag(np.diag(lumped)))
    half = line_density * length / 2
    expected = [half, half, bending[2], half, half, bending[5]]
    np.testing.assert_allclose(np.diag(lumped), expected, rtol=1e-14)
    assert bending[2] == pytest.approx(line_density * length**3 / 78, rel=1e-14)

"""Bodies that repeat, tied to themselves by a translation or a rotation, against closed forms and whole bodies."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.sparse.linalg import eigsh
from scipy.spatial import cKDTree

import stridor as st
from stridor.case import loads
from stridor.errors import CaseError
from stridor.system import System

STEEL = "materials.steel = { young_modulus = 200e9, density = 7800.0, poisson_ratio = RATIO }\n"


def bar(divisions: int, cells: str = "quad8", more: str = "") -> str:
    """A bar of 0.2 m without lateral motion and contraction, its right end its left one."""
    return (
        STEEL.replace("RATIO", "0.0")
        + f"""
[bodies.bar]
type = "solid"
material = "steel"
model = "plane stress"
thickness = 0.01
mass = "consistent"
mesh = {{ shape = "rectangle", corner = [0.0, 0.0], size = [0.2, 0.01], divisions = [{divisions}, 1], cells = "{cells}" }}
[supports.low]
at = "bar.bottom"
fixed = ["y"]
[supports.high]
at = "bar.top"
fixed = ["y"]
[ties.period]
slave = "bar.right"
master = "bar.left"
translation = [0.2, 0.0]
{more}
"""
    )


def omegas(system: System, count: int) -> np.ndarray:
    """Lowest angular frequencies without contact [rad/s]."""
    if system.size < 400:
        found = eigh(system.stiffness.toarray(), system.mass.toarray(), eigvals_only=True)[:count]
    else:
        shift = -1e-3 * system.stiffness.diagonal().mean() / system.mass.diagonal().mean()
        found = eigsh(system.stiffness, count, system.mass, sigma=shift, return_eigenvectors=False)
    return np.sqrt(np.maximum(np.sort(found), 0.0))


@pytest.mark.parametrize("cells", ["quad8", "triangle6", "quad9"])
def test_waves_in_a_bar_that_closes_on_itself(cells: str) -> None:
    """ω = 2πnc/L, each twice, as two waves run either way; and one rigid motion."""
    found = omegas(st.build_system(loads(bar(32, cells))), 7)
    speed = np.sqrt(200e9 / 7800.0)
    expected = 2.0 * np.pi * speed / 0.2 * np.array([0, 1, 1, 2, 2, 3, 3])
    assert found[0] < 1e-6 * expected[1]
    assert found[1:] == pytest.approx(expected[1:], rel=2e-4)


def ring(
    mesh: str, supports: str, tie: str, model: str = '"plane stress"\nthickness = 0.01', mass: str = "consistent"
) -> str:
    return (
        STEEL.replace("RATIO", "0.3")
        + f"""
[bodies.ring]
type = "solid"
material = "steel"
model = {model}
mass = "{mass}"
mesh = {{ {mesh} }}
{supports}
{tie}
"""
    )


CLAMP = '[supports.hub]\nat = "ring.inner"\nfixed = ["x", "y"]\n'
TURN = '[ties.turn]\nslave = "ring.end"\nmaster = "ring.start"\nrotation = { angle_deg = 30.0 }\n'
ANNULUS = 'shape = "annulus", inner_radius = 0.05, outer_radius = 0.1, cells = "quad8"'


def zero_harmonic(case: str, sectors: int, count: int, centre: np.ndarray | None = None) -> np.ndarray:
    """Angular frequencies of the modes of a whole ring that repeat from sector to sector: those whose displacement,
    turned by a sector, is itself."""
    system = st.build_system(loads(case))
    values, vectors = eigh(system.stiffness.toarray(), system.mass.toarray())
    (solid,) = system.solids
    points = solid.points if centre is None else solid.points - centre
    angle = 2.0 * np.pi / sectors
    turn = np.eye(points.shape[1])
    turn[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    image = cKDTree(points).query(points @ turn.T)[1]
    moved = (solid.rows.free @ vectors).reshape(*points.shape, -1)
    away = np.linalg.norm(moved[image] - np.einsum("ik,pkm->pim", turn, moved), axis=(0, 1))
    repeats = away < 1e-6 * np.linalg.norm(moved, axis=(0, 1))
    return np.sqrt(values[repeats][:count])


@pytest.mark.parametrize("mass", ["consistent", "lumped"])
def test_a_sector_of_a_ring_has_the_ring_s_modes_that_repeat(mass: str) -> None:
    """Twelve sectors with the mesh of the ring: the same equations, so the same frequencies to rounding."""
    whole = ring(f"{ANNULUS}, divisions = [2, 24]", CLAMP, "", mass=mass)
    sector = ring(f"{ANNULUS}, divisions = [2, 2], start_deg = 20.0, sweep_deg = 30.0", CLAMP, TURN, mass=mass)
    expected = zero_harmonic(whole, 12, 4)
    found = omegas(st.build_system(loads(sector)), 4)
    assert found == pytest.approx(expected, rel=1e-9)


def test_a_sector_of_a_disc_in_space() -> None:
    """The same with hexahedra about an axis that is not at the origin."""
    disc = 'inner_radius = 0.05, outer_radius = 0.1, thickness = 0.02, centre = [0.3, -0.2, 0.1], cells = "hexahedron"'
    clamp = CLAMP.replace('["x", "y"]', '["x", "y", "z"]')
    whole = ring(f'shape = "disc", {disc}, divisions = [2, 12, 1]', clamp, "", model='"3d"')
    part = f'shape = "pad", {disc}, divisions = [2, 2, 1], start_deg = 0.0, sweep_deg = 60.0'
    turn = TURN.replace("30.0", "60.0, centre = [0.3, -0.2, 0.0], axis = [0.0, 0.0, 2.0]")
    found = omegas(st.build_system(loads(ring(part, clamp, turn, model='"3d"'))), 4)
    expected = zero_harmonic(whole, 6, 4, centre=np.array([0.3, -0.2, 0.1]))
    assert found == pytest.approx(expected, rel=1e-9)


def test_meshes_of_both_sides_need_not_match() -> None:
    """Half sectors of 8 and 11 elements across, tied in the middle and by the turn, against one of 8."""
    even = ring(f"{ANNULUS}, divisions = [8, 6], start_deg = 20.0, sweep_deg = 30.0", CLAMP, TURN)
    expected = omegas(st.build_system(loads(even)), 3)
    halves = STEEL.replace("RATIO", "0.3")
    for name, start, across in (("a", 20.0, 8), ("b", 35.0, 11)):
        halves += f"""
[bodies.{name}]
type = "solid"
material = "steel"
model = "plane stress"
thickness = 0.01
mass = "consistent"
mesh = {{ {ANNULUS}, divisions = [{across}, 3], start_deg = {start}, sweep_deg = 15.0 }}
[supports.hub-{name}]
at = "{name}.inner"
fixed = ["x", "y"]
"""
    halves += """
[ties.middle]
slave = "b.start"
master = "a.end"
[ties.turn]
slave = "b.end"
master = "a.start"
rotation = { angle_deg = 30.0 }
"""
    assert omegas(st.build_system(loads(halves)), 3) == pytest.approx(expected, rel=2e-3)


def test_tied_nodes_turn_with_the_frame() -> None:
    """The rows that drawings and files take: u on the end is R u on the start."""
    sector = ring(f"{ANNULUS}, divisions = [3, 4], sweep_deg = 30.0", CLAMP, TURN)
    system = st.build_system(loads(sector))
    (solid,) = system.solids
    vector = np.random.default_rng(1).standard_normal(system.size)
    moved = (solid.rows.free @ vector).reshape(solid.points.shape)
    angle = np.degrees(np.arctan2(solid.points[:, 1], solid.points[:, 0]))
    start, end = np.isclose(angle, 0.0), np.isclose(angle, 30.0)
    order = [np.flatnonzero(s)[np.argsort(np.linalg.norm(solid.points[s], axis=1))] for s in (start, end)]
    c, s = np.cos(np.pi / 6), 0.5
    assert moved[order[1]] == pytest.approx(moved[order[0]] @ np.array([[c, s], [-s, c]]), abs=1e-12)


def test_the_lumped_mass_of_a_turned_sector_is_that_of_one() -> None:
    """Radial motion of one moves all of the mass, tied nodes with their own frames included."""
    sector = ring(f"{ANNULUS}, divisions = [3, 4], sweep_deg = 30.0", "", TURN, mass="lumped")
    system = st.build_system(loads(sector))
    (solid,) = system.solids
    radial = (solid.points / np.linalg.norm(solid.points, axis=1, keepdims=True)).ravel()
    unit = np.linalg.lstsq(solid.rows.free.toarray(), radial, rcond=None)[0]
    assert solid.rows.free @ unit == pytest.approx(radial, abs=1e-12)
    area = np.pi * (0.1**2 - 0.05**2) / 12
    assert unit @ system.mass @ unit == pytest.approx(7800.0 * 0.01 * area, rel=1e-3)
    diagonal = system.mass.diagonal()
    assert np.count_nonzero(system.mass.toarray() - np.diag(diagonal)) == 0
    # What follows gives its mass alike in all directions.
    assert diagonal.reshape(-1, 2)[:, 0] == pytest.approx(diagonal.reshape(-1, 2)[:, 1], rel=1e-12)


def test_total_mass_of_a_lumped_bar_stays() -> None:
    system = st.build_system(loads(bar(6).replace('mass = "consistent"', 'mass = "lumped"')))
    along = np.array([1.0 if name.endswith(" x") else 0.0 for name in system.dof_names])
    assert along @ system.mass @ along == pytest.approx(7800.0 * 0.2 * 0.01 * 0.01, rel=1e-12)


def test_a_square_that_repeats_both_ways() -> None:
    """Its corner is slave of both ties, which say the same of it. Plane waves: c_p and c_s along x and along y."""
    square = STEEL.replace("RATIO", "0.3") + """
[bodies.cell]
type = "solid"
material = "steel"
model = "plane strain"
mass = "consistent"
mesh = { shape = "rectangle", corner = [0.0, 0.0], size = [0.1, 0.1], divisions = [8, 8] }
[ties.along]
slave = "cell.right"
master = "cell.left"
translation = [0.1, 0.0]
[ties.up]
slave = "cell.top"
master = "cell.bottom"
translation = [0.0, 0.1]
"""
    found = omegas(st.build_system(loads(square)), 8)
    shear = np.sqrt(200e9 / 2.6 / 7800.0)
    assert found[:2].max() < 1e-5 * found[2]
    assert found[2:6] == pytest.approx(2.0 * np.pi * shear / 0.1, rel=1e-3)


def test_contact_on_a_sector_is_that_on_the_whole_ring() -> None:
    """Press a ring of pads on a ring of discs, or one sector: normal force per sector and frequencies agree."""
    case = """
title = "sector"
materials.steel = { young_modulus = 200e9, density = 7800.0, poisson_ratio = 0.3 }
[bodies.ring]
type = "solid"
material = "steel"
model = "3d"
mesh = { MESH, inner_radius = 0.05, outer_radius = 0.1, thickness = 0.01, cells = "hexahedron" }
[bodies.wall]
type = "obstacle"
shape = "flat"
point = [0.0, 0.0, 0.0]
normal = [0.0, 0.0, 1.0]
sliding = { spin = 10.0 }
[supports.hub]
at = "ring.inner"
fixed = ["x", "y"]
[loads.press]
at = "ring.top"
pressure = 1e5
[contacts.face]
slave = "ring.bottom"
master = "wall"
stiffness = 1e12
friction = { law = "coulomb", coefficient = 0.3 }
"""
    whole = st.steady_sliding(loads(case.replace("MESH", 'shape = "disc", divisions = [2, 12, 1]')))
    turn = TURN.replace("30.0", "60.0")
    part = case.replace("MESH", 'shape = "pad", divisions = [2, 2, 1], start_deg = 10.0, sweep_deg = 60.0') + turn
    sector = st.steady_sliding(loads(part))
    assert 6.0 * sector.normal_force.sum() == pytest.approx(whole.normal_force.sum(), rel=1e-9)
    assert sector.normal_force.max() == pytest.approx(whole.normal_force.max(), rel=1e-9)


@pytest.mark.parametrize("stiffness", ["1e12", '"rigid"'])
def test_slave_nodes_on_both_sides_of_the_cut_are_one(stiffness: str) -> None:
    """It stands for half of an element on either side, as each between does."""
    wall = """
[bodies.flat]
type = "obstacle"
shape = "flat"
point = [0.0, 0.0]
normal = [0.0, 1.0]
sliding = { velocity = [1.0, 0.0] }
[loads.press]
at = "bar.top"
pressure = 1e5
[contacts.rub]
slave = "bar.bottom"
master = "flat"
stiffness = 1e12
friction = { law = "coulomb", coefficient = 0.2 }
"""
    text = bar(4, "quad", wall).replace('[supports.low]\nat = "bar.bottom"\nfixed = ["y"]\n', "")
    text = text.replace('at = "bar.top"\nfixed = ["y"]', 'at = "bar.top"\nfixed = ["x"]')
    force = st.steady_sliding(loads(text.replace("1e12", stiffness))).normal_force
    assert force == pytest.approx(np.full(4, 1e5 * 0.01 * 0.05), rel=1e-9)


@pytest.mark.parametrize(
    ("instead", "message"),
    [
        ("", "ties.period.master: 'bar.left' – must belong to another body than the slave's; of one that repeats give translation or rotation from the master to the slave"),
        ("translation = [0.2]", "ties.period.translation: [0.2] – must be [x, y] or [x, y, z], numbers [m]: from the master to the slave, where both repeat"),
        ("translation = [0.2, 0.0, 0.0]", "ties.period.translation: [0.2, 0.0, 0.0] – must have 2 numbers"),
        ("translation = [0.0, 0.0]", "ties.period.translation: [0.0, 0.0] – must not be zero"),
        ("rotation = { angle_deg = 360.0 }", "ties.period.rotation.angle_deg: 360.0 – must not be zero or full turns"),
        ("rotation = { angle_deg = 30.0, axis = [1.0, 0.0, 0.0] }", "ties.period.rotation.axis: [1.0, 0.0, 0.0] – in the plane the axis is z; leave it out"),
        ("rotation = { angle = 30.0 }", "ties.period.rotation.angle: unknown key; did you mean 'angle_deg'? accepted: angle_deg, axis, centre"),
        ("translation = [0.2, 0.0]\nrotation = { angle_deg = 30.0 }", "ties.period.rotation: not used with translation; give one of them"),
    ],
)  # fmt: skip
def test_ways_that_are_none(instead: str, message: str) -> None:
    with pytest.raises(CaseError) as caught:
        loads(bar(4).replace("translation = [0.2, 0.0]", instead))
    assert str(caught.value) == message


def test_a_way_that_misses_and_an_axis_on_the_face() -> None:
    with pytest.raises(CaseError, match=r"3 of 3 slave nodes are farther than .* from the master"):
        st.build_system(loads(bar(4).replace("translation = [0.2, 0.0]", "translation = [0.19, 0.0]")))
    square = STEEL.replace("RATIO", "0.3") + """
[bodies.cell]
type = "solid"
material = "steel"
model = "plane strain"
mesh = { shape = "rectangle", corner = [0.0, 0.0], size = [0.1, 0.1], divisions = [2, 2] }
[ties.turn]
slave = "cell.bottom"
master = "cell.left"
rotation = { angle_deg = -90.0 }
"""
    with pytest.raises(CaseError, match=r"the node at \(0, 0\) m would follow itself: it lies on the axis"):
        st.build_system(loads(square))


def test_a_support_that_moves_does_not_turn() -> None:
    moving = CLAMP.replace('["x", "y"]', '["x", "y"]\nvelocity = { x = 0.1 }')
    sector = ring(f"{ANNULUS}, divisions = [2, 2], sweep_deg = 30.0", moving, TURN)
    with pytest.raises(CaseError, match=r"ties\.turn\.slave: supports\.hub moves nodes of the slave"):
        st.build_system(loads(sector))


def test_check_says_how_it_repeats() -> None:
    lines = st.describe(loads(bar(4))).lines
    assert "  tie period: bar.right follows bar.left, moved by (0.2, 0) m" in lines
    sector = ring(f"{ANNULUS}, divisions = [2, 2], sweep_deg = 30.0", CLAMP, TURN)
    assert "  tie turn: ring.end follows ring.start, turned by 30°" in st.describe(loads(sector)).lines

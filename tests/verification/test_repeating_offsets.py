"""Sectors in contact that begin at different angles: however far apart, the whole rings are the same."""

from __future__ import annotations

import numpy as np
import pytest
from test_repeating_contact import BLOCKS, against_the_whole, eigenvalues

import stridor as st
from random_sectors import random_ring
from stridor.case import loads
from stridor.errors import CaseError
from stridor.study.description import mesh_warnings

HEAD = """
[materials.a]
young_modulus = 1e11
density = 7200.0
poisson_ratio = 0.27
[contacts.face]
slave = "SLAVE"
master = "MASTER"
stiffness = 5e12
friction = { law = "coulomb", coefficient = 0.5 }
"""
TIE = """[ties.NAME]
slave = "NAME.end"
master = "NAME.start"
rotation = { angle_deg = ANGLE }
"""


def in_the_plane(
    start: float,
    *,
    slave: str = "ring.inner",
    around: int = 2,
    sectors: int = 6,
    angle: float = 60.0,
    whole: bool = False,
    adjust: str = "adjust = 5e-3",
) -> str:
    """A turning wheel from 0° and a ring round it from another angle, pressed into each other."""
    faces = ("wheel.outer", "ring.inner")
    text = HEAD.replace("SLAVE", slave).replace("MASTER", faces[slave == faces[0]]) + f"interference = 2e-5\n{adjust}\n"
    for name, radii, begin, side in (("wheel", (0.03, 0.06), 0.0, "inner"), ("ring", (0.06, 0.08), start, "outer")):
        sweep, count = (360.0, around * sectors) if whole else (360.0 / sectors, around)
        text += f"""[bodies.{name}]
type = "solid"
material = "a"
model = "plane stress"
thickness = 0.01
mesh = {{ shape = "annulus", inner_radius = {radii[0]}, outer_radius = {radii[1]}, start_deg = {begin}, sweep_deg = {sweep}, divisions = [1, {count}], cells = "quad" }}
{"sliding = { spin = 10.0 }" if name == "wheel" else ""}
[supports.{name}]
at = "{name}.{side}"
fixed = ["x", "y"]
"""
        text += "" if whole else TIE.replace("NAME", name).replace("ANGLE", f"{angle:g}")
    return text


def in_space(start: float, *, disc_repeats: bool = True) -> str:
    """A ring on a turning disc, 60° of both."""
    text = HEAD.replace("SLAVE", "ring.bottom").replace("MASTER", "disc.top")
    for name, radii, begin, z, held in (
        ("disc", (0.04, 0.09), 0.0, 0.0, ["x", "y", "z"]), ("ring", (0.05, 0.08), start, 0.01, ["x", "y"]),
    ):  # fmt: skip
        text += f"""[bodies.{name}]
type = "solid"
material = "a"
model = "3d"
mesh = {{ shape = "pad", centre = [0.0, 0.0, {z}], inner_radius = {radii[0]}, outer_radius = {radii[1]}, start_deg = {begin}, sweep_deg = 60.0, thickness = 0.01, divisions = [1, 3, 1], cells = "hexahedron" }}
{"sliding = { spin = 20.0, axis = [0.0, 0.0, 1.0] }" if name == "disc" else ""}
[supports.{name}]
at = "{name}.inner"
fixed = {held}
"""
        if name == "ring" or disc_repeats:
            text += TIE.replace("NAME", name).replace("ANGLE", "60.0")
    return text + '[loads.press]\nat = "ring.top"\npressure = 1e6\n'


def what_comes_out(text: str) -> np.ndarray:
    """Touching nodes, largest and least normal force [N], area [m²], moment about the axis [Nm], gaps [m], the slowest
    eigenvalues [1/s]."""
    case = loads(text)
    found, nodes = st.steady_sliding(case), st.build_system(case).contact_nodes()
    resultant = found.resultants["face"]
    force = found.normal_force
    numbers = [found.active.sum(), force.max(), force.min(), resultant.area, np.ravel(resultant.moment)[-1]]
    slowest = eigenvalues(text, 0.5)[:6]
    # Of two modes that meet at one frequency rounding must not say which comes first.
    slowest = slowest[np.argsort(slowest.imag + slowest.real)]
    return np.array([*numbers, *np.sort(nodes.gap), *slowest])


@pytest.mark.parametrize(("first", "slave"), [(0.0, "wheel.outer"), (25.0, "ring.inner")])
def test_any_offset_in_the_plane_is_that_in_the_first_sector(first: float, slave: str) -> None:
    expected = what_comes_out(in_the_plane(first, slave=slave))
    assert expected[0] == 2  # all of them touch
    for sectors in (-5, -2, 1, 3):
        found = what_comes_out(in_the_plane(first + 60.0 * sectors, slave=slave))
        assert found == pytest.approx(expected, rel=1e-8, abs=1e-14)


def test_any_offset_in_space_is_that_in_the_first_sector() -> None:
    expected = what_comes_out(in_space(10.0))
    assert expected[0] == 6
    for sectors in (-5, 2):
        assert what_comes_out(in_space(10.0 + 60.0 * sectors)) == pytest.approx(expected, rel=1e-8, abs=1e-14)


@pytest.mark.parametrize("seed", [17, *(pytest.param(k, marks=pytest.mark.slow) for k in (0, 1, 5, 22))])
def test_rounding_has_no_say_in_pressures_of_curved_facets(seed: int) -> None:
    """Edges of both meshes coincide: how facets are cut into pieces must not hang on the last digit of a turn."""
    sectors = random_ring(seed, dimension=3, rigid=True).sectors
    pressure = []
    for turns in (0, 1):
        case = loads(random_ring(seed, dimension=3, rigid=True, offset=360.0 * turns / sectors).sector)
        pressure.append(np.sort(st.steady_sliding(case).normal_force / st.build_system(case).contact_nodes().area))
    assert pressure[1] == pytest.approx(pressure[0], rel=1e-9)


def test_gaps_near_the_end_of_the_images_are_those_of_the_whole() -> None:
    """A slave from −57° on, two facets to the sector: one image ended at −60° with a spline of its own there."""
    case, whole = (
        loads(in_the_plane(57.0, slave="wheel.outer", whole=every, adjust="")) for every in (False, True)
    )
    few, many = (st.build_system(each).contact_nodes().gap for each in (case, whole))
    assert np.sort(np.repeat(few, 6)) == pytest.approx(np.sort(many), abs=1e-15)


@pytest.mark.parametrize("seed", [0, 8, *(pytest.param(k, marks=pytest.mark.slow) for k in range(9, 40))])
def test_random_sectors_far_from_each_other_press_as_the_whole_ring(seed: int) -> None:
    offset = float(np.random.default_rng(seed).choice([-290.0, -130.0, -65.0, 63.0, 100.0, 185.0]))
    against_the_whole(random_ring(seed, dimension=2, rigid=False, offset=offset))


@pytest.mark.parametrize("offset", [(0.01, 0.007), (0.1, -0.073)])
def test_blocks_that_repeat_both_ways_go_on_both_ways(offset: tuple[float, float]) -> None:
    """The upper one hangs over the lower one's corner, or lies beside it altogether: an even pressure all the same."""
    text = BLOCKS
    for name, corner, divisions in (("low", [0.0, 0.0, 0.0], "[3, 2, 1]"), ("high", [*offset, 0.01], "[2, 3, 1]")):
        text += f"""[bodies.{name}]
type = "solid"
material = "a"
model = "3d"
mesh = {{ shape = "block", corner = {corner}, size = [0.03, 0.02, 0.01], divisions = {divisions}, cells = "hexahedron" }}
{"sliding = { velocity = [1.0, 0.5, 0.0] }" if name == "high" else ""}
"""
        for way, sides in (([0.03, 0.0, 0.0], ("right", "left")), ([0.0, 0.02, 0.0], ("back", "front"))):
            text += f'[ties.{name}-{sides[0]}]\nslave = "{name}.{sides[0]}"\nmaster = "{name}.{sides[1]}"\ntranslation = {way}\n'
    case = loads(text)
    nodes, found = st.build_system(case).contact_nodes(), st.steady_sliding(case)
    assert nodes.area.sum() == pytest.approx(0.03 * 0.02, rel=1e-12)
    assert found.normal_force / nodes.area == pytest.approx(np.full(6, 1e6), rel=1e-9)


def test_halves_and_thirds_close_to_a_ring() -> None:
    """No image is another one's."""
    for sectors in (2, 3):
        text = in_the_plane(130.0, around=12 // sectors, sectors=sectors, angle=360.0 / sectors)
        (surface,) = st.build_system(loads(text)).surfaces
        assert surface.master.closed
        assert surface.master.node_count == 12
    (surface,) = st.build_system(loads(in_the_plane(130.0, around=6))).surfaces  # a whole one needs not all
    assert not surface.master.closed


def test_a_repeating_slave_that_slides_is_described() -> None:
    """Fewer contact nodes than slave nodes, whose drift is looked at."""
    case = loads(in_the_plane(0.0, slave="wheel.outer"))
    assert mesh_warnings(case, st.build_system(case)) == []


@pytest.mark.parametrize("dimension", [2, 3])
def test_sectors_that_meet_at_an_edge_only_do_not_face_each_other(dimension: int) -> None:
    """Unless the slave repeats: the next sector of the master is below it then."""
    text = in_space(60.0, disc_repeats=False) if dimension == 3 else in_the_plane(60.0)
    text = text.replace(TIE.replace("NAME", "wheel").replace("ANGLE", "60"), "")
    ring = TIE.replace("NAME", "ring").replace("ANGLE", "60.0" if dimension == 3 else "60")
    assert ring in text
    (surface,), (first,) = (
        st.build_system(loads(each)).surfaces for each in (text, text.replace("start_deg = 60.0", "start_deg = 0.0"))
    )
    assert surface.area.sum() == pytest.approx(first.area.sum(), rel=1e-9)
    with pytest.raises(CaseError, match="do not face each other: they only meet at an edge of the master, at "):
        st.build_system(loads(text.replace(ring, "")))

"""Slaves that repeat on masters without images by their motion: held ones, obstacles, lines of beams."""

from __future__ import annotations

import numpy as np
import pytest
from test_repeating_offsets import in_space, in_the_plane
from test_repeating_pieces import part, ring, turn, wheel_in

import stridor as st
from stridor.case import loads
from stridor.errors import CaseError

HELD = '[supports.all]\nat = "ring.inner"\nfixed = ["x", "y"]\n'


def held(start: float, sweep: float, more: str = "") -> str:
    """A sector of 60° of a wheel, its outline the slave, in a held part of a ring."""
    outer = part("ring", (0.06, 0.08), start, sweep, round(sweep / 5.0)) + HELD + more
    return wheel_in(outer, "wheel.outer").replace("divisions = [1, 2]", "divisions = [1, 6]")


def hub(angle: float) -> str:
    """What repeats by an angle round about, and struts to it from a part of the ring."""
    text = part("strut", (0.08, 0.09), 5.0, 10.0, 2) + part("hub", (0.09, 0.1), 0.0, angle, round(angle / 5.0), "outer")
    text = text.replace("sliding = { spin = 10.0 }\n", "") + turn("hub", angle)
    for tie, slave, master in (("low", "strut.inner", "ring.outer"), ("high", "strut.outer", "hub.inner")):
        text += f'[ties.{tie}]\nslave = "{slave}"\nmaster = "{master}"\n'
    return text


def on_an_obstacle(obstacle: str) -> str:
    """A sector of 60° of a wheel from 0° on, its outline the slave."""
    text = wheel_in(f'[bodies.wall]\ntype = "obstacle"\n{obstacle}\n').replace("divisions = [1, 2]", "divisions = [1, 6]")
    return text.replace('"ring.inner"\nmaster = "wheel.outer"', '"wheel.outer"\nmaster = "wall"')


def flat(at: float) -> str:
    normal = -np.array([np.cos(np.radians(at)), np.sin(np.radians(at))])
    return on_an_obstacle(f'shape = "flat"\npoint = {(-0.06 * normal).tolist()}\nnormal = {normal.tolist()}')


BORE = 'shape = "cylinder"\npoint = [0.0, 0.0]\nradius = 0.06\ninside = true\n'
SPIN = "sliding = { spin = 10.0 }"


def strip(master: str, low: str) -> str:
    """A block of 30 mm that repeats and slides on something."""
    return f"""
[materials.a]
young_modulus = 2e11
density = 7800.0
poisson_ratio = 0.3
[bodies.high]
type = "solid"
material = "a"
model = "plane stress"
thickness = 0.01
mesh = {{ shape = "rectangle", corner = [0.0, 0.0], size = [0.03, 0.01], divisions = [3, 1], cells = "quad" }}
points = {{ foot = [0.01, 0.0] }}
sliding = {{ velocity = [1.0, 0.0] }}
[ties.high]
slave = "high.right"
master = "high.left"
translation = [0.03, 0.0]
[supports.drag]
at = "high.top"
fixed = ["x"]
[loads.press]
at = "high.top"
pressure = 1e3
{low}
[contacts.face]
slave = "high.bottom"
master = "{master}"
stiffness = 1e12
friction = {{ law = "coulomb", coefficient = 0.2 }}
"""


def on_a_beam(begin: float, end: float) -> str:
    beam = f"""
[bodies.base]
type = "beam"
material = "a"
start = [{begin}, 0.0]
end = [{end}, 0.0]
width = 0.01
thickness = 0.01
elements = {round((end - begin) / 0.005)}
[supports.base]
at = "base.start"
fixed = ["x", "y", "rotation"]
"""
    return strip("base", beam).replace('master = "base"', 'master = "base"\nside = "left"')


def on_a_block(begin: float, end: float) -> str:
    block = f"""
[bodies.base]
type = "solid"
material = "a"
model = "plane stress"
thickness = 0.01
mesh = {{ shape = "rectangle", corner = [{begin}, -0.01], size = [{end - begin}, 0.01], divisions = [{round((end - begin) / 0.005)}, 1], cells = "quad" }}
[supports.base]
at = "base.top"
fixed = ["x", "y"]
"""
    return strip("base.top", block)


FACE = r"contacts\.face\.master: .*not the same below all sectors of the slave "
WHEEL = FACE + r"wheel\.outer, which repeats by 60° \(ties\.wheel\): at \(0\.0.* m "
REFUSED = {
    "a held quarter over the cut": (held(40.0, 90.0), WHEEL + "nothing is below it, and something below another"),
    "held pads by another angle": (held(0.0, 20.0, hub(45.0)), WHEEL + "nothing is below it, and something below"),
    "a slit of 1° below facets of 10°": (held(44.2, 359.0), WHEEL + "nothing is below it, and something below"),
    "held pads to each second sector": (held(-15.0, 90.0, hub(120.0)), WHEEL + "something is below it, and nothing below"),
    "a bore with an axis of its own": (on_an_obstacle(BORE.replace("[0.0", "[1e-4")), WHEEL + "it is at another distance"),
    "a bore that slides straight": (
        on_an_obstacle(f"{BORE}sliding = {{ velocity = [1.0, 0.0] }}"), WHEEL + "it moves in another direction",
    ),
    "a held ring that moves straight": (
        held(0.0, 360.0).replace(HELD, HELD + "velocity = { x = 1.0 }\n"), WHEEL + "it moves in another direction",
    ),
    "flats that meet below the slave": (flat(10.0), WHEEL + "it is at another distance"),
    "a slope": (
        strip("wall", '[bodies.wall]\ntype = "obstacle"\nshape = "flat"\npoint = [0.0, 0.0]\nnormal = [-0.01, 1.0]'),
        FACE + r"high\.bottom, .* it is at another distance",
    ),
    "a long beam": (on_a_beam(-0.03, 0.06), r"contacts\.face\.master: 'base' .*spans 0\.09 m, a sector of the slave high\.bottom 0\.03 m"),
    "a point of a block on a long beam": (
        on_a_beam(-0.03, 0.06).replace("high.bottom", "high.foot"), r"spans 0\.09 m, a sector of the slave high\.foot 0\.03 m",
    ),
    "a beam over the cut": (on_a_beam(0.02, 0.04), FACE + r"high\.bottom, .* nothing is below it"),
    "a long held block over the cut": (on_a_block(0.01, 0.06), FACE + r"high\.bottom, .* nothing is below it"),
    "pads in their own images": (
        held(-5.0, 70.0, hub(60.0)), r"contacts\.face\.master: .*spans 70° and its body repeats by 60° \(ties\.hub\)",
    ),
    "pads in their own images as slaves": (
        wheel_in(part("ring", (0.06, 0.08), -5.0, 70.0, 14) + hub(60.0)),
        r"contacts\.face\.slave: .*spans 70° and its body repeats by 60° \(ties\.hub\)",
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", REFUSED)
def test_a_master_that_sectors_of_the_slave_find_otherwise_is_refused(what: str) -> None:
    text, message = REFUSED[what]
    with pytest.raises(CaseError, match=message):
        st.build_system(loads(text))


def in_space_on_a_ring(sweep: float) -> str:
    """A sector of 60° of a ring, of facets of 20°, over a held ring of other facets, narrower than it."""
    text = in_space(10.0, disc_repeats=False).replace('at = "disc.inner"', 'at = "disc.top"')
    text = text.replace("divisions = [1, 3, 1]", "divisions = [2, 13, 1]", 1).replace("[1, 3, 1]", "[2, 3, 1]")
    text = text.replace("inner_radius = 0.04, outer_radius = 0.09", "inner_radius = 0.055, outer_radius = 0.075")
    text = text.replace("start_deg = 0.0, sweep_deg = 60.0", f"start_deg = 31.3, sweep_deg = {sweep}")
    return text.replace("sliding = { spin = 20.0, axis = [0.0, 0.0, 1.0] }", "")


def test_a_slit_in_space_is_seen_and_edges_of_chords_are_none() -> None:
    with pytest.raises(CaseError, match="nothing is below it, and something below another sector"):
        st.build_system(loads(in_space_on_a_ring(359.0)))
    (surface,) = st.build_system(loads(in_space_on_a_ring(359.999))).surfaces
    assert surface.area.sum() == pytest.approx(np.pi * (0.075**2 - 0.055**2) / 6.0, rel=0.05)  # of chords of 28°


ACCEPTED = {
    "a whole ring": (held(0.0, 360.0), 60.0),
    "a ring in other facets": (held(0.0, 360.0).replace("divisions = [1, 72]", "divisions = [1, 31]"), 60.0),
    "a ring in the widest facets": (held(0.0, 360.0).replace("divisions = [1, 72]", "divisions = [1, 9]"), 60.0),
    "a quarter beyond both ends": (held(-15.0, 90.0), 60.0),
    "an eighth of a ring": (held(0.0, 45.0, turn("ring", 45.0)), 60.0),
    "a third of a ring": (held(10.0, 120.0, turn("ring", 120.0)), 60.0),
    "pads by the same angle": (held(0.0, 20.0, hub(60.0)), 20.0),
    "a pad over the cut": (held(40.0, 40.0), 40.0),
    "a bore": (on_an_obstacle(BORE + SPIN), 60.0),
    "a bore in other digits": (on_an_obstacle(BORE.replace("[0.0", "[1e-7") + SPIN), 60.0),
}


@pytest.mark.parametrize("what", ACCEPTED)
def test_a_master_that_all_sectors_of_the_slave_find_alike_is_accepted(what: str) -> None:
    text, degrees = ACCEPTED[what]
    (surface,) = st.build_system(loads(text)).surfaces
    assert surface.area.sum() == pytest.approx(0.06 * 0.01 * np.radians(degrees), rel=5e-3)  # of chords


@pytest.mark.parametrize("text", [flat(30.0), on_a_beam(0.0, 0.03), on_a_beam(0.01, 0.03), on_a_block(-0.03, 0.06)])
def test_one_to_a_sector_or_a_longer_wall_is_accepted(text: str) -> None:
    st.build_system(loads(text))


def test_of_a_point_its_own_place_counts() -> None:
    """Under flats that meet at 40° of a sector from 0° to 60°: before and beyond that, where the next one is nearer."""
    text = flat(10.0).replace('"wheel.outer"', '"wheel.tip"').replace("stiffness = 5e12", "stiffness = 5e9")
    for degrees, refused in ((30.0, False), (50.0, True)):
        at = (0.06 * np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees))])).tolist()
        pointed = text.replace("[bodies.wheel]\n", f"[bodies.wheel]\npoints = {{ tip = {at} }}\n")
        if refused:
            with pytest.raises(CaseError, match=FACE + r"wheel\.tip, .* it is at another distance"):
                st.build_system(loads(pointed))
        else:
            st.build_system(loads(pointed))


@pytest.mark.parametrize("angle", [420.0, -300.0])
def test_images_go_on_by_the_shorter_turn(angle: float) -> None:
    """As 60° does: a ring from the fourth sector lies on the wheel, and a whole one in it is refused."""
    expected, found = (st.build_system(loads(in_the_plane(185.0, angle=each))).contact_nodes() for each in (60.0, angle))
    assert found.gap == pytest.approx(expected.gap, abs=1e-12)
    text = wheel_in(ring(0.0, 360.0)).replace("angle_deg = 60", f"angle_deg = {angle:g}")
    with pytest.raises(CaseError, match=r"spans 360°, a sector of the master wheel\.outer 60° \(ties\.wheel\)"):
        st.build_system(loads(text))

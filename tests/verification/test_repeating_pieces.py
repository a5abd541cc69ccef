"""Sectors in contact whose master is a piece of a sector, and sectors that are not the same part of a whole."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from test_repeating_contact import BLOCKS
from test_repeating_offsets import HEAD, TIE, in_space, in_the_plane, what_comes_out

import stridor as st
from stridor.case import loads
from stridor.contact.curve import Curve
from stridor.errors import CaseError

PRESS = "interference = 2e-5\nadjust = 5e-3\n"


def part(name: str, radii: tuple[float, float], begin: float, sweep: float, cells: int, held: str = "") -> str:
    """A part of a ring in the plane that turns but for the outer one."""
    return f"""[bodies.{name}]
type = "solid"
material = "a"
model = "plane stress"
thickness = 0.01
mesh = {{ shape = "annulus", inner_radius = {radii[0]}, outer_radius = {radii[1]}, start_deg = {begin}, sweep_deg = {sweep}, divisions = [1, {cells}], cells = "quad" }}
{"" if name == "ring" else "sliding = { spin = 10.0 }"}
""" + (f'[supports.{name}]\nat = "{name}.{held}"\nfixed = ["x", "y"]\n' if held else "")


def turn(name: str, angle: float = 60.0) -> str:
    return TIE.replace("NAME", name).replace("ANGLE", str(angle))


def glue(slave: str, master: str) -> str:
    return f'[ties.glue]\nslave = "{slave}"\nmaster = "{master}"\n'


def ring(start: float, sweep: float = 60.0) -> str:
    return part("ring", (0.06, 0.08), start, sweep, round(sweep / 10.0), "outer")


def pads(start: float) -> str:
    """A ring round pads, one to a sector of a hub, that do not reach the cut."""
    text = HEAD.replace("SLAVE", "ring.inner").replace("MASTER", "pad.outer") + PRESS + ring(start) + turn("ring")
    text += part("hub", (0.03, 0.05), 0.0, 60.0, 6, "inner") + turn("hub")
    return text + part("pad", (0.05, 0.06), 10.0, 40.0, 4) + glue("pad.inner", "hub.outer")


def halves(start: float) -> str:
    """A ring round a wheel whose sector is two bodies, in contact with both."""
    head = HEAD.replace("SLAVE", "ring.inner").replace("MASTER", "left.outer") + PRESS
    text = head + head[head.index("[contacts") :].replace("face", "other").replace("left", "right")
    text += ring(start) + turn("ring") + glue("right.start", "left.end")
    for name, begin in (("left", 0.0), ("right", 30.0)):
        text += part(name, (0.03, 0.06), begin, 30.0, 3, "inner")
    return text + turn("right").replace("right.start", "left.start")


@pytest.mark.parametrize("sector", [pads, halves])
def test_pieces_of_a_sector_have_images(sector: Callable[[float], str]) -> None:
    """Slaves from the other side of a pad, from the second sector and from before: what comes out is the same."""
    expected = what_comes_out(sector(0.0))
    for start in (20.0, 100.0, -290.0):
        found = what_comes_out(sector(start))
        assert found[:-6] == pytest.approx(expected[:-6], rel=1e-8, abs=1e-14)
        # λ² is what rounding disturbs, by 1e-15 of the largest one; of a pair the last may be either.
        assert found[-6:-1] == pytest.approx(expected[-6:-1], rel=1e-6)


def in_space_on_halves(start: float) -> str:
    """A ring on a disc of two bodies to a sector, whose meshes do not match, neither at the cut."""
    text = in_space(start)
    begin, end = text.index("[bodies.disc]"), text.index("[bodies.ring]")
    disc = text[begin:end].replace(turn("disc"), "").replace("sweep_deg = 60.0", "sweep_deg = 30.0")
    one, other = disc.replace("disc", "left"), disc.replace("disc", "right").replace("start_deg = 0.0", "start_deg = 30.0")
    other = other.replace("[1, 3, 1]", "[3, 2, 1]")
    text = text[:begin] + one + other + text[end:]
    face = text[text.index("[contacts.face]") : text.index("[bodies.left]")]
    text = text.replace(face, face.replace("disc", "left") + face.replace("disc", "right").replace("face", "other"))
    return text + glue("left.end", "right.start") + turn("right").replace("right.start", "left.start")


@pytest.mark.parametrize("start", [0.0, 17.0, -130.0])
def test_pieces_of_a_sector_in_space_carry_the_whole_slave(start: float) -> None:
    case = loads(in_space_on_halves(start))
    chord = 2.0 * np.sin(np.radians(10.0)) * np.cos(np.radians(10.0))  # of three facets of 20° to the sector
    area = 3 * 0.5 * chord * (0.08**2 - 0.05**2)
    resultants = st.steady_sliding(case).resultants
    assert sum(r.area for r in resultants.values()) == pytest.approx(area, rel=1e-9)
    # Half each, but for chords that the seam does not cut in the middle.
    assert all(r.area == pytest.approx(0.5 * area, rel=1e-2) for r in resultants.values())


def test_curves_side_by_side_find_what_each_of_them_finds() -> None:
    """Two corners and a ring: points, normals off corners and neighbours are those of each by itself."""
    lines = np.array([[0, 1], [1, 2]])
    corner = np.array([[1.0, 0.0], [0.0, 0.0], [0.0, 1.0]])
    angle = np.linspace(0.0, 2.0 * np.pi, 13)[:-1]
    circle = np.column_stack([9.0 + np.cos(angle), np.sin(angle)])
    parts = [
        Curve.from_facets(corner, {"line": lines}, where=""),
        Curve.from_facets(circle, {"line": np.stack([np.arange(12), (np.arange(12) + 1) % 12], axis=1)}, where=""),
        Curve.from_facets(corner + np.array([0.0, 20.0]), {"line": lines}, where=""),
    ]
    together = Curve.side_by_side(parts)
    assert together.node_count == 18
    assert list(together.corners) == [1, 16]
    slaves = np.array([[-0.3, -0.2], [0.4, -0.1], [9.0, 1.2], [-0.2, 19.9], [-0.1, 20.7], [1.5, 0.1]])
    found = together.locate(slaves)
    for slave, owner in enumerate((0, 0, 1, 2, 2, 0)):
        alone = parts[owner].locate(slaves[slave : slave + 1])
        assert found.point[slave] == pytest.approx(alone.point[0], abs=1e-14)
        assert found.normal[slave] == pytest.approx(alone.normal[0], abs=1e-14)
        assert found.inside[slave] == alone.inside[0]
        before = sum(p.node_count for p in parts[:owner])
        used = alone.weights[0] != 0.0
        assert list(found.nodes[slave][used]) == list(alone.nodes[0][used] + before)


def strip(path: Path, *, length: float = 0.03, shear: float = 0.0, z: float = 0.0) -> None:
    """A block of 4 × 4 × 1 bricks that repeats along x, with both sides of the cut in two parts, maybe oblique."""
    at = np.stack(np.meshgrid(np.arange(5), np.arange(5), np.arange(2), indexing="ij"), axis=-1).reshape(-1, 3)
    number = {tuple(row): k + 1 for k, row in enumerate(at.tolist())}
    lines = ["*NODE", *(f"{k}, {length * x / 4 + shear * y / 4}, {0.005 * y}, {z + 0.01 * h}" for (x, y, h), k in number.items())]
    lines.append("*ELEMENT, TYPE=C3D8, ELSET=E")
    square = ((0, 0), (1, 0), (1, 1), (0, 1))
    for k, (x, y) in enumerate([(x, y) for x in range(4) for y in range(4)]):
        lines.append(f"{k + 1}, " + ", ".join(str(number[x + i, y + j, z]) for z in (0, 1) for i, j in square))
    sets = {"BOTTOM": at[:, 2] == 0, "TOP": at[:, 2] == 1}
    for name, x in (("LEFT", 0), ("RIGHT", 4)):
        sets |= {f"{name}1": (at[:, 0] == x) & (at[:, 1] <= 2), f"{name}2": (at[:, 0] == x) & (at[:, 1] > 2)}
    for name, chosen in sets.items():
        lines += [f"*NSET, NSET={name}", ", ".join(str(k + 1) for k in np.flatnonzero(chosen)[:16])]
        lines += [", ".join(str(k + 1) for k in np.flatnonzero(chosen)[16:])] if chosen.sum() > 16 else []
    path.write_text("\n".join([*lines, ""]))


@pytest.mark.parametrize("opposite", [False, True])
def test_parts_of_one_cut_are_one_cut(tmp_path: Path, opposite: bool) -> None:
    """Two ties that say the same, or the opposite, each of a part of the cut: an even pressure under a block elsewhere."""
    strip(tmp_path / "strip.inp")
    second = ("LEFT2", "RIGHT2", -0.03) if opposite else ("RIGHT2", "LEFT2", 0.03)
    text = BLOCKS.replace("low.bottom", "low.BOTTOM").replace("low.top", "low.TOP").replace("= 0.3", "= 0.0")
    text += f"""[bodies.low]
type = "solid"
material = "a"
model = "3d"
file = "{tmp_path / "strip.inp"}"
[bodies.high]
type = "solid"
material = "a"
model = "3d"
mesh = {{ shape = "block", corner = [0.01, 0.0, 0.01], size = [0.03, 0.02, 0.01], divisions = [3, 2, 1], cells = "hexahedron" }}
sliding = {{ velocity = [1.0, 0.0, 0.0] }}
[ties.high]
slave = "high.right"
master = "high.left"
translation = [0.03, 0.0, 0.0]
[ties.one]
slave = "low.RIGHT1"
master = "low.LEFT1"
translation = [0.03, 0.0, 0.0]
[ties.two]
slave = "low.{second[0]}"
master = "low.{second[1]}"
translation = [{second[2]}, 0.0, 0.0]
"""
    case = loads(text)
    (surface,) = st.build_system(case).surfaces
    assert len(np.unique(np.round(surface.master.positions, 9), axis=0)) == surface.master.node_count
    nodes, found = st.build_system(case).contact_nodes(), st.steady_sliding(case)
    assert nodes.area.sum() == pytest.approx(0.03 * 0.02, rel=1e-12)
    assert found.normal_force / nodes.area == pytest.approx(np.full(nodes.count, 1e6), rel=1e-9)


def wheel_in(outer: str, slave: str = "ring.inner") -> str:
    """A sector of 60° of a wheel in another outer ring."""
    text = in_the_plane(0.0, slave=slave)
    begin = text.index("[bodies.ring]")
    return text[:begin] + outer


REFUSED = {
    "a whole ring on a sector": (
        wheel_in(ring(0.0, 360.0)),
        r"contacts\.face\.slave: .*spans 360°, a sector of the master wheel\.outer 60° \(ties\.wheel\)",
    ),
    "a sector in a whole ring": (
        wheel_in(ring(0.0, 360.0), "wheel.outer"),
        r"contacts\.face\.master: .*spans 360°, a sector of the slave wheel\.outer 60° \(ties\.wheel\)",
    ),
    "a pad of 70°": (wheel_in(ring(40.0, 70.0)), r"spans 70°, a sector of the master wheel\.outer 60°"),
    "an eighth on a sixth": (
        wheel_in(part("ring", (0.06, 0.08), 0.0, 45.0, 4, "outer") + turn("ring", 45.0)),
        r"contacts\.face\.slave: .*repeats by 45° \(ties\.ring\), the master wheel\.outer by 60° \(ties\.wheel\)",
    ),
    "a third on a sixth": (wheel_in(ring(0.0, 120.0) + turn("ring", 120.0)), r"repeats by 120° \(ties\.ring\)"),
    "an eighth on pads": (
        pads(0.0).replace(ring(0.0) + turn("ring"), part("ring", (0.06, 0.08), 0.0, 45.0, 4, "outer") + turn("ring", 45.0)),
        r"repeats by 45° \(ties\.ring\), the master pad\.outer by 60° \(ties\.hub\)",
    ),
    "in space": (
        in_space(10.0).replace(turn("ring"), "").replace("start_deg = 10.0, sweep_deg = 60.0", "start_deg = 10.0, sweep_deg = 65.0"),
        r"spans 65°, a sector of the master disc\.top 60°",
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", REFUSED)
def test_sides_that_are_not_the_same_part_of_a_whole_are_refused(what: str) -> None:
    text, message = REFUSED[what]
    with pytest.raises(CaseError, match=message):
        st.build_system(loads(text))


@pytest.mark.parametrize(
    ("sectors", "angle"), [(7, "51.428571"), (7, "51.4286"), (6, "60.0000001"), (6, "420.0"), (6, "-300.0")]
)
def test_one_angle_in_other_digits_is_the_same_on_meshes_that_match(sectors: int, angle: str) -> None:
    """Nodes of both sides that coincide are at no distance that a tolerance could be taken of."""
    text = in_the_plane(0.0, sectors=sectors)
    begin = text.index("[ties.wheel]"), text.index("[bodies.ring]"), text.index("[ties.ring]")
    text = text[: begin[0]] + turn("wheel", 360.0 / sectors) + text[begin[1] : begin[2]]
    (surface,) = st.build_system(loads(text + turn("ring").replace("60.0", angle))).surfaces
    assert surface.area.sum() == pytest.approx(4 * 0.06 * 0.01 * np.sin(np.pi / sectors / 2), rel=1e-9)
    with pytest.raises(CaseError, match=r"repeats by .*° \(ties\.ring\)"):
        st.build_system(loads(text + turn("ring", 360.0 / sectors + 0.2)))


def blocks(high: str, more: str = "") -> str:
    """A block of ``high`` keys on one that repeats each 30 mm along x."""
    low = 'shape = "block", corner = [0.0, 0.0, 0.0], size = [0.03, 0.02, 0.01], divisions = [3, 2, 1], cells = "hexahedron"'
    text = BLOCKS + more
    for name, mesh in (("low", low), ("high", f'{high}, cells = "hexahedron"')):
        text += f'[bodies.{name}]\ntype = "solid"\nmaterial = "a"\nmodel = "3d"\nmesh = {{ {mesh} }}\n'
        text += "sliding = { velocity = [1.0, 0.0, 0.0] }\n" if name == "high" else ""
    return text + step("low", 0.03)


def step(name: str, length: float) -> str:
    return f'[ties.{name}]\nslave = "{name}.right"\nmaster = "{name}.left"\ntranslation = [{length}, 0.0, 0.0]\n'


def high(length: float, cells: int) -> str:
    return f'shape = "block", corner = [0.01, 0.0, 0.01], size = [{length}, 0.02, 0.01], divisions = [{cells}, 2, 1]'


def test_blocks_that_are_longer_than_a_step_are_refused() -> None:
    with pytest.raises(CaseError, match=r"spans 0\.04 m, a sector of the master low\.top 0\.03 m \(ties\.low\)"):
        st.build_system(loads(blocks(high(0.04, 4))))
    with pytest.raises(CaseError, match=r"repeats by \(0\.06, 0, 0\) m \(ties\.high\), the master low\.top by \(0\.03, "):
        st.build_system(loads(blocks(high(0.06, 6), step("high", 0.06))))
    for same in (0.030000000000000006, 0.03000001):
        st.build_system(loads(blocks(high(0.03, 3).replace("0.01, 0.0, 0.01", "0.0, 0.0, 0.01", 1), step("high", same))))
    for accepted in (blocks(high(0.03, 3)), blocks(high(0.03, 3), step("high", 0.03)), blocks(high(0.02, 2))):
        st.build_system(loads(accepted))


@pytest.mark.parametrize(("length", "spans"), [(0.03, ""), (0.031, r"spans 0\.041 m, a sector")])
def test_oblique_ends_are_no_overlap(tmp_path: Path, length: float, spans: str) -> None:
    """A parallelogram whose ends come to lie on each other, although it spans more than a step."""
    strip(tmp_path / "strip.inp", length=length, shear=0.01, z=0.01)
    text = blocks("").replace('type = "solid"\nmaterial = "a"\nmodel = "3d"\nmesh = { , cells', "@", 1)
    begin = text.index("@")
    text = text[:begin] + f'type = "solid"\nmaterial = "a"\nmodel = "3d"\nfile = "{tmp_path / "strip.inp"}"\n' + text[text.index("\n", begin) + 1 :]
    text = text.replace("high.top", "high.TOP").replace("high.bottom", "high.BOTTOM")
    if spans:
        with pytest.raises(CaseError, match=spans):
            st.build_system(loads(text))
    else:
        (surface,) = st.build_system(loads(text)).surfaces
        assert surface.area.sum() == pytest.approx(0.03 * 0.02, rel=1e-9)


def test_one_pad_to_a_sector_is_accepted() -> None:
    """Also one of a sector's length."""
    for sweep in (40.0, 60.0):
        (surface,) = st.build_system(loads(wheel_in(ring(15.0, sweep)))).surfaces
        assert surface.area.sum() == pytest.approx(round(sweep / 10) * 2 * 0.06 * 0.01 * np.sin(np.radians(5.0)), rel=1e-9)


def test_a_master_that_is_held_does_not_feel_how_many_press_on_it() -> None:
    """A whole ring in a sector of a wall: held nodes need no sector of their own."""
    held = wheel_in(ring(0.0, 360.0)).replace("[contacts.face]", '[supports.all]\nat = "wheel.outer"\nfixed = ["x", "y"]\n[contacts.face]')
    held = held.replace("sliding = { spin = 10.0 }", "")
    (surface,) = st.build_system(loads(held)).surfaces
    assert len(surface.area) == 36


@pytest.mark.parametrize("slave", ["ring.inner", "wheel.outer"])
def test_a_held_ring_round_a_sector_that_moves_is_its_master(slave: str) -> None:
    """As a slave it would press with all of its nodes on the one sector that moves."""
    outer = '[supports.all]\nat = "ring.inner"\nfixed = ["x", "y"]\n' + ring(0.0, 360.0)
    if slave == "ring.inner":
        with pytest.raises(CaseError, match=r"contacts\.face\.slave: .*spans 360°, a sector of the master wheel\.outer"):
            st.build_system(loads(wheel_in(outer, slave)))
        return
    whole = in_the_plane(0.0, slave=slave, around=6, whole=True)
    every = whole[: whole.index("[bodies.ring]")] + outer
    sector = wheel_in(outer, slave).replace("divisions = [1, 2]", "divisions = [1, 6]")
    one, six = (float(st.steady_sliding(loads(text)).normal_force.sum()) for text in (sector, every))
    assert 6.0 * one == pytest.approx(six, rel=1e-9)


def pad_below(start: float, slave: str = "wheel.outer") -> str:
    """One pad of 40° to a sector of a wheel from 0° to 60°, which repeats; the pad does not."""
    return wheel_in(ring(start, 40.0), slave).replace("divisions = [1, 2]", "divisions = [1, 6]")


def test_a_pad_as_the_master_reaches_over_the_cut_of_its_slave() -> None:
    """From 40° to 80°, from −20° to 20°, in the fourth sector: as within the first one, and as the slave."""
    expected = what_comes_out(pad_below(10.0))
    for start in (40.0, -20.0, 220.0):
        assert what_comes_out(pad_below(start)) == pytest.approx(expected, rel=1e-8, abs=1e-14)
    master, slave = (st.steady_sliding(loads(pad_below(40.0, which))) for which in ("wheel.outer", "ring.inner"))
    assert master.resultants["face"].area == pytest.approx(slave.resultants["face"].area, rel=1e-12)
    assert master.normal_force.sum() == pytest.approx(slave.normal_force.sum(), rel=1e-4)


def test_a_pad_in_space_as_the_master_reaches_over_the_cut_of_its_slave() -> None:
    """A pad of 40° under each 60° of a disc: wherever it begins, and with all of its area."""
    area = 4 * 0.5 * np.sin(np.radians(10.0)) * (0.08**2 - 0.05**2)
    found = []
    for start in (10.0, 40.0, -200.0):
        text = in_space(start).replace(turn("ring"), "")
        text = text.replace('slave = "ring.bottom"', 'slave = "disc.top"').replace('master = "disc.top"', 'master = "ring.bottom"')
        pad = f"start_deg = {start}, sweep_deg = 60.0, thickness = 0.01, divisions = [1, 3, 1]"
        assert pad in text
        text = text.replace(pad, pad.replace("60.0", "40.0").replace("3", "4")).replace("[1, 3, 1]", "[1, 6, 1]")
        text = text.replace("0.05, outer_radius = 0.08", "@").replace("0.04, outer_radius = 0.09", "0.05, outer_radius = 0.08")
        found.append(what_comes_out(text.replace("@", "0.04, outer_radius = 0.09")))
        assert found[-1][3] == pytest.approx(area, rel=1e-9)
    for other in found[1:]:
        assert other[:-6] == pytest.approx(found[0][:-6], rel=1e-8, abs=1e-13)
        assert other[-6:-1] == pytest.approx(found[0][-6:-1], rel=1e-6)  # as above


def test_blocks_as_masters_reach_over_a_step_of_their_slave() -> None:
    """20 of 30 mm, wherever they lie: forces and pressures do not change, and sum to the load."""
    found = []
    for begin in (0.0, 0.02, -0.07):
        text = blocks(high(0.03, 6).replace("0.01, 0.0, 0.01", "0.0, 0.0, 0.01"), step("high", 0.03)).replace(step("low", 0.03), "")
        text = text.replace("corner = [0.0, 0.0, 0.0], size = [0.03,", f"corner = [{begin}, 0.0, 0.0], size = [0.02,").replace(
            "divisions = [3, 2, 1]", "divisions = [2, 2, 1]", 1
        )
        case = loads(text)
        steady = st.steady_sliding(case)
        assert steady.normal_force.sum() == pytest.approx(1e6 * 0.03 * 0.02, rel=1e-9)
        (resultant,) = steady.resultants.values()
        assert resultant.area == pytest.approx(0.02 * 0.02, rel=1e-9)
        found.append(np.sort(steady.normal_force))
    for other in found[1:]:
        assert other == pytest.approx(found[0], rel=1e-8)


def test_a_master_whose_images_slide_otherwise_is_refused() -> None:
    """A pad that slides along x beside one of its images that slides along a turned x: one law would not say."""
    for start, refused in ((10.0, False), (40.0, True)):
        text = pad_below(start)
        at = text.index("[supports.ring]")
        text = text[:at] + "sliding = { velocity = [0.3, 0.0] }\n" + text[at:]
        if refused:
            with pytest.raises(CaseError, match=r"contacts\.face\.master: .*reaches over the cut .*\(ties\.wheel\)"):
                st.build_system(loads(text))
        else:
            st.build_system(loads(text))


@pytest.mark.parametrize("slave", ["wheel.outer", "ring.inner"])
def test_gaps_between_pads_that_are_narrower_than_a_facet_carry_nothing(slave: str) -> None:
    """8 of 60°, under facets of 10°: also where both nodes of one are above pads."""
    for start in (3.0, 10.0, 41.5):
        text = wheel_in(part("ring", (0.06, 0.08), start, 52.0, 6, "outer"), slave).replace("divisions = [1, 2]", "divisions = [1, 6]")
        (surface,) = st.build_system(loads(text)).surfaces
        assert surface.area.sum() == pytest.approx(0.06 * 0.01 * np.radians(52.0), rel=2e-3)  # of chords
    text = blocks(high(0.03, 3).replace("0.01, 0.0, 0.01", "0.0, 0.0, 0.01"), step("high", 0.03)).replace(step("low", 0.03), "")
    for begin, length in ((0.02, 0.02), (0.016, 0.023)):
        low = text.replace("corner = [0.0, 0.0, 0.0], size = [0.03,", f"corner = [{begin}, 0.0, 0.0], size = [{length},")
        (surface,) = st.build_system(loads(low)).surfaces
        assert surface.area.sum() == pytest.approx(length * 0.02, rel=1e-9)

"""Several contacts of one body that repeats: each has a place of its own in the sector."""

from __future__ import annotations

import pytest
from test_repeating_offsets import HEAD
from test_repeating_pieces import PRESS, part, turn

import stridor as st
from stridor.case import loads
from stridor.errors import CaseError


def two_pads(begin: float, other: float, *, slave: str = "pad", held: str = "inner", more: str = "") -> str:
    """Pads of 25° from two angles on, pressed on a hub that repeats by 60°."""
    contact = HEAD[HEAD.index("[contacts.face]") :]
    text = HEAD.replace(contact, "") + part("hub", (0.03, 0.06), 0.0, 60.0, 6, held) + turn("hub") + more
    for contact_name, pad, at in (("face", "one", begin), ("also", "two", other)):
        sides = [f"{pad}.inner", "hub.outer"][:: 1 if slave == "pad" else -1]
        one = contact.replace("face", contact_name).replace("SLAVE", sides[0]).replace("MASTER", sides[1])
        text += one + PRESS + part(pad, (0.06, 0.08), at, 25.0, 5, "outer").replace("sliding = { spin = 10.0 }\n", "")
    return text


@pytest.mark.parametrize("slave", ["pad", "hub"])
def test_pads_in_one_place_of_a_sector_are_refused(slave: str) -> None:
    """One in the place of an image of the other, or in a part of it, wherever they lie; as slaves or as masters."""
    key = "slave" if slave == "pad" else "master"
    message = rf"contacts\.also\.{key}: 'two\.inner' – lies in the place of an image of one\.inner \(contacts\.face\.{key}\), .* by 60° \(ties\.hub\)"
    for begin, other in ((0.0, 60.0), (0.0, 80.0), (200.0, 30.0)):
        with pytest.raises(CaseError, match=message):
            st.build_system(loads(two_pads(begin, other, slave=slave)))


@pytest.mark.parametrize("slave", ["pad", "hub"])
def test_pads_beside_each_other_press_alike_wherever_their_images_are(slave: str) -> None:
    expected = float(st.steady_sliding(loads(two_pads(0.0, 25.0, slave=slave))).normal_force.sum())
    for begin, other in ((0.0, 85.0), (-60.0, 25.0), (180.0, 265.0)):
        found = st.steady_sliding(loads(two_pads(begin, other, slave=slave)))
        assert found.normal_force.sum() == pytest.approx(expected, rel=1e-8)


def test_a_hub_that_is_held_does_not_feel_who_presses() -> None:
    """Pads on a wall: each has its own."""
    wall = '[supports.wall]\nat = "hub.outer"\nfixed = ["x", "y"]\n'
    found = st.build_system(loads(two_pads(0.0, 60.0, more=wall)))
    assert [len(surface.area) for surface in found.surfaces] == [6, 6]


def blocks(at: float) -> str:
    """Two blocks of 10 mm on a strip that repeats each 30 mm."""
    text = HEAD[: HEAD.index("[contacts")]
    text += '[ties.low]\nslave = "low.right"\nmaster = "low.left"\ntranslation = [0.03, 0.0]\n'
    for name, x, y, length, held in (("low", 0.0, -0.01, 0.03, "bottom"), ("one", 0.0, 0.0, 0.01, "top"), ("two", at, 0.0, 0.01, "top")):
        text += f"""[bodies.{name}]
type = "solid"
material = "a"
model = "plane stress"
thickness = 0.01
mesh = {{ shape = "rectangle", corner = [{x}, {y}], size = [{length}, 0.01], divisions = [{round(length / 0.005)}, 1], cells = "quad" }}
[supports.{name}]
at = "{name}.{held}"
fixed = ["x", "y"]
"""
        if name != "low":
            text += f'[contacts.{name}]\nslave = "{name}.bottom"\nmaster = "low.top"\nstiffness = 5e12\n'
            text += 'friction = { law = "coulomb", coefficient = 0.5 }\n'
    return text


def test_blocks_in_one_place_of_a_strip_are_refused() -> None:
    for at in (0.03, -0.055, 0.065):
        with pytest.raises(CaseError, match=r"'two\.bottom' – lies in the place of an image of one\.bottom .* by \(0\.03, 0\) m"):
            st.build_system(loads(blocks(at)))
    for at in (0.01, 0.02, 0.05, -0.01):
        st.build_system(loads(blocks(at)))

"""Rigid contact that holds every freedom leaves no mode: that is an answer, and no onset."""

from __future__ import annotations

import pytest

import stridor as st
from stridor.modal.options import Options
from stridor.modal.over_friction import modes_of_band, onsets_of_band

CORNER = """
units = "nondimensional"
bodies.block = { type = "mass", mass = 1.0, position = [0.0, 0.0] }
bodies.floor = { type = "obstacle", shape = "flat", point = [0.0, 0.0], normal = [0.0, 1.0] }
loads.press = { at = "block", force = [-1.0, -1.0] }
springs.x = { between = ["block", "ground"], stiffness = 1.0, direction = [1.0, 0.0] }
contacts.A = { slave = "block", master = "floor", stiffness = "rigid", friction = { law = "coulomb", coefficient = 0.0 } }
contacts.B = { slave = "block", master = "wall", stiffness = "rigid", friction = { law = "coulomb", coefficient = 0.2 } }
modal.max_frequency_hz = 3.0
[bodies.wall]
type = "obstacle"
shape = "flat"
point = [0.0, 0.0]
normal = [1.0, 0.0]
sliding = { velocity = [0.0, 1.0] }
"""


def test_a_mass_in_a_rigid_corner_has_no_mode_and_no_onset():
    case = st.loads(CORNER)
    assert not len(st.modes(case))
    assert not len(st.onsets(case))


@pytest.mark.parametrize("source", ["krylov", "full"])
def test_by_whichever_source(source: str):
    system, options = st.build_system(st.loads(CORNER)), Options(source=source)
    assert not len(modes_of_band(system, [0.0, 0.2], 3.0, options=options).branch)
    assert not len(onsets_of_band(system, (0.0, 1.0), 3.0, options=options))

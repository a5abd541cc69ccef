"""Problems in which a mode begins above the band at μ = 0, sinks into it with friction, and grows there."""

from __future__ import annotations

import numpy as np

import stridor as st
from benches import by_hand
from rubbing_block import SLIDER
from stridor.system import System

MU_OF_BLOCK, MU_OF_POINTS = 1.1, 1.13
HZ_OF_POINTS = 1.1

BLOCK = """
[bodies.block]
type = "solid"
model = "plane strain"
material = "pad"
mesh = { shape = "rectangle", corner = [-0.03, 0.0], size = [0.06, 0.01], divisions = [3, 1], cells = "quad" }
damping = { mass = 2.0, stiffness = 1e-9 }
points = { crown = [0.01, 0.01] }
[springs.strut]
between = ["block.crown", "ground"]
stiffness = 1e9
direction = [-0.707, 0.707]
[modal]
max_frequency_hz = 3300.0
friction_range = [0.0, 1.1]
"""


def entering_block() -> st.Case:
    """A flat block on a slanting strut: two modes meet below the band's end, which one of them is above at first."""
    slider = SLIDER.replace('[supports.holder]\nat = "block.top"\nfixed = ["x"]\n', "")
    slider = slider.replace("stiffness = 1e12", "stiffness = 1e10").replace("divisions = [10, 2]", "divisions = [6, 1]")
    return st.loads(slider.replace("coefficient = 0.4", f"coefficient = {MU_OF_BLOCK}") + BLOCK)


def hidden_block() -> st.Case:
    """The same with more damping of the faster of the two, so that they do not meet and the one from above grows; where
    they meet the other does, by rule, and is no hidden one."""
    return entering_block().with_({"bodies.block.damping": {"mass": 2.0, "stiffness": 1e-6}})


def entering_points() -> System:
    """Five oscillators, damped a little unevenly, under three compliant point contacts."""
    normal = [[-1.0, 1.0, -1.1, 0.5, 0.2], [0.5, -0.9, 0.6, 2.4, -1.9], [2.4, -0.4, 0.7, -1.3, -1.7]]
    tangent = [[-1.5, -0.6, 0.9, -0.1, 0.9], [0.2, 0.2, -0.7, 2.1, -1.0], [1.1, 0.2, -0.3, -1.8, 0.6]]
    squares = np.diag([0.1, 1.0, 1.6, 7.1, 30.0])
    damping = np.diag([0.02, 0.02, 0.02, 0.01, 0.02])
    return by_hand(np.eye(5), damping, squares, normal, tangent, np.array([31.0, 18.0, 43.0]))

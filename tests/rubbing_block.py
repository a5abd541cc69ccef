"""A soft block pressed on a moving steel slider, in plane strain: the small case of solids that several tests share."""

from __future__ import annotations

SLIDER = """
materials.steel = { young_modulus = 200e9, density = 7800.0, poisson_ratio = 0.3 }
materials.pad = { young_modulus = 2e9, density = 2000.0, poisson_ratio = 0.3 }
[bodies.slider]
type = "solid"
model = "plane strain"
material = "steel"
mesh = { shape = "rectangle", corner = [-0.05, -0.01], size = [0.1, 0.01], divisions = [10, 2], cells = "quad" }
damping = { mass = 20.0, stiffness = 1e-8 }
sliding = { velocity = [1.0, 0.0] }
[supports.ground]
at = "slider.bottom"
fixed = ["x", "y"]
[supports.holder]
at = "block.top"
fixed = ["x"]
[loads.press]
at = "block.top"
pressure = 1e5
[contacts.face]
slave = "block.bottom"
master = "slider.top"
stiffness = 1e12
friction = { law = "coulomb", coefficient = 0.4 }
"""
MESHED = """
type = "solid"
model = "plane strain"
material = "pad"
mesh = { shape = "rectangle", corner = [-0.01, 0.0], size = [0.02, 0.02], divisions = [5, 5], cells = "quad" }
damping = { mass = 20.0, stiffness = 1e-8 }
points = { crown = [0.0, 0.02] }
"""


def rubbing_block(modal: str, block: str = MESHED, *, title: str = "", more: str = "") -> str:
    """The case's text: lines of [modal], which is last, and of [bodies.block]; more: further tables."""
    head = f'title = "{title}"\n' if title else ""
    return f"{head}{SLIDER}[bodies.block]\n{block}{more}[modal]\n{modal}\n"


# A mass on two springs, pressed by −1 on a belt of speed −0.5, with falling friction.
RUBBING_MASS = """
units = "nondimensional"
bodies.m = { type = "mass", mass = 1.0, position = [0.0, 0.0] }
bodies.belt = { type = "obstacle", shape = "flat", point = [0, 0], normal = [0, 1], sliding.velocity = [-0.5, 0.0] }
springs.k = { between = ["m", "ground"], direction = [1.0, 0.0], stiffness = 1.0 }
springs.n = { between = ["m", "ground"], direction = [0.3, 1.0], stiffness = 1.0 }
loads.press = { at = "m", force = [0.0, -1.0] }
contacts.rub.slave = "m"
contacts.rub.master = "belt"
contacts.rub.stiffness = 1.0
contacts.rub.friction = { law = "hyperbolic", coefficient = 0.0, static_coefficient = 0.8, delta = 0.5 }
modal.max_frequency_hz = 1.0
"""

"""Case files of published and closed-form problems, as a user would write them."""

from __future__ import annotations

from stridor.case import Case, loads

FV32 = """
title = "NAFEMS FV32, tapered membrane"
materials.steel = { young_modulus = 200e9, density = 8000.0, poisson_ratio = 0.3 }
[bodies.membrane]
type = "solid"
material = "steel"
model = "plane stress"
thickness = 0.05
mass = "consistent"
mesh = { shape = "quadrilateral", corners = [[0, -2.5], [10, -0.5], [10, 0.5], [0, 2.5]], divisions = [16, 8] }
[supports.root]
at = "membrane.left"
fixed = ["x", "y"]
[modal]
max_frequency_hz = 395.0
"""

WALL = """
title = "a bar strikes a wall (code_aster SDNV100)"
materials.steel = { young_modulus = 200e9, density = 8000.0, poisson_ratio = 0.0 }
[bodies.bar]
type = "solid"
material = "steel"
model = "plane stress"
thickness = 0.02
mesh = { shape = "rectangle", corner = [0.002, 0.0], size = [0.2, 0.02], divisions = [200, 1], cells = "quad" }
initial_velocity = [-100.0, 0.0]
points = { free_end = [0.202, 0.0] }
[bodies.wall]
type = "obstacle"
shape = "flat"
point = [0.0, 0.0]
normal = [1.0, 0.0]
[contacts.blow]
slave = "bar.left"
master = "wall"
stiffness = "rigid"
friction = { law = "coulomb", coefficient = 0.0 }
[[phases]]
name = "blow"
duration = 150e-6
[temporal]
record_every = 1
watch = ["bar.free_end"]
[modal]
max_frequency_hz = 20e3
"""

RODS = """
title = "two equal rods (in the manner of Carpenter, Taylor and Katona 1991)"
materials.steel = { young_modulus = 206.8e9, density = 7801.0, poisson_ratio = 0.0 }
[bodies.left]
type = "solid"
material = "steel"
model = "plane stress"
thickness = 0.0254
mesh = { shape = "rectangle", corner = [-0.254, 0.0], size = [0.254, 0.0254], divisions = [200, 1], cells = "quad" }
initial_velocity = [2.568, 0.0]
points = { middle = [-0.127, 0.0] }
[bodies.right]
type = "solid"
material = "steel"
model = "plane stress"
thickness = 0.0254
mesh = { shape = "rectangle", corner = [0.0, 0.0], size = [0.254, 0.0254], divisions = [200, 1], cells = "quad" }
initial_velocity = [-2.568, 0.0]
points = { face = [0.0, 0.0], middle = [0.127, 0.0] }
[contacts.face]
slave = "left.right"
master = "right.left"
stiffness = "rigid"
friction = { law = "coulomb", coefficient = 0.0 }
[[phases]]
name = "exchange"
duration = 160e-6
[temporal]
record_every = 1
watch = ["right.face", "left.middle", "right.middle"]
[modal]
max_frequency_hz = 20e3
"""

COULOMB = """
title = "an oscillator with dry friction (code_aster SDND100)"
[bodies.m]
type = "mass"
mass = 1.0
position = [0.0, 0.0]
initial_displacement = [0.85e-3, 0.0]
[bodies.floor]
type = "obstacle"
shape = "flat"
point = [0.0, 0.0]
normal = [0.0, 1.0]
[springs.k]
between = ["m", "ground"]
direction = [1.0, 0.0]
stiffness = 1e4
[loads.weight]
at = "m"
force = [0.0, -10.0]
[contacts.rub]
slave = "m"
master = "floor"
stiffness = "rigid"
friction = { law = "coulomb", coefficient = 0.1 }
[[phases]]
name = "swing"
duration = 0.16
[temporal]
step = 2e-5
record_every = 1
watch = ["m"]
"""

TWO_MASSES = """
title = "two masses on a rough floor (code_aster SDND106)"
[bodies.m1]
type = "mass"
mass = 5.0
position = [0.0, 0.0]
[bodies.m2]
type = "mass"
mass = 5.0
position = [1.0, 0.0]
[bodies.floor]
type = "obstacle"
shape = "flat"
point = [0.0, 0.0]
normal = [0.0, 1.0]
[springs.k]
between = ["m2", "m1"]
stiffness = 1e4
[loads.weight]
at = "m1"
force = [0.0, -1e4]
[loads.pull]
at = "m2"
force = [3000.0, 0.0]
[contacts.rub]
slave = "m1"
master = "floor"
stiffness = "rigid"
friction = { law = "static-kinetic", coefficient = 0.2, static_coefficient = 0.3 }
[[phases]]
name = "pull"
duration = 0.2
[[phases]]
name = "coast"
duration = 0.2
loads = { pull = 0.0 }
[temporal]
step = 1e-5
record_every = 1
watch = ["m1", "m2"]
"""

BELT = """
title = "a mass on a belt"
[bodies.m]
type = "mass"
mass = 1.0
position = [0.0, 0.0]
[bodies.belt]
type = "obstacle"
shape = "flat"
point = [0.0, 0.0]
normal = [0.0, 1.0]
sliding = { velocity = [0.2, 0.0] }
[springs.k]
between = ["m", "ground"]
direction = [1.0, 0.0]
stiffness = 1.0
[loads.weight]
at = "m"
force = [0.0, -1.0]
[contacts.rub]
slave = "m"
master = "belt"
stiffness = "rigid"
friction = { law = "static-kinetic", coefficient = 0.3, static_coefficient = 0.4 }
[[phases]]
name = "run"
duration = 40.0
[temporal]
step = 1e-3
record_every = 1
watch = ["m"]
"""


def bench_as_solids(cells: str = "quad8", across: tuple[int, int] = (2, 3), along: tuple[int, int] = (30, 80)) -> str:
    """The published two-beam bench as plane stress solids.

    The pin's middle touches the top of the disc beam. The guide of the pin, which holds its rotation, is a stiff block
    without weight that cannot move sideways.
    """
    return f"""
title = "the two-beam bench as solids"
materials.steel = {{ young_modulus = 200e9, density = 7800.0, poisson_ratio = 0.3 }}
materials.stiff = {{ young_modulus = 2e13, density = 1e-2, poisson_ratio = 0.3 }}
[bodies.pin]
type = "solid"
material = "steel"
model = "plane stress"
thickness = 0.01
mass = "consistent"
mesh = {{ shape = "rectangle", corner = [{0.1 + 0.00075 * 0.99619469809}, {-0.00075 * 0.08715574275}], angle_deg = 85.0, size = [0.05, 0.0015], divisions = [{along[0]}, {across[0]}], cells = "{cells}" }}
points = {{ tip = [0.1, 0.0] }}
damping = {{ mass = 50.0, stiffness = 1e-8 }}
[bodies.guide]
type = "solid"
material = "stiff"
model = "plane stress"
thickness = 0.01
mass = "consistent"
mesh = {{ shape = "rectangle", corner = [{0.1 + 0.05 * 0.08715574275 + 0.00075 * 0.99619469809}, {0.05 * 0.99619469809 - 0.00075 * 0.08715574275}], angle_deg = 85.0, size = [0.0015, 0.0015], divisions = [2, 2], cells = "{cells}" }}
[bodies.beam]
type = "solid"
material = "steel"
model = "plane stress"
thickness = 0.015
mass = "consistent"
mesh = {{ shape = "rectangle", corner = [0.0, -0.003], size = [0.15, 0.003], divisions = [{along[1]}, {across[1]}], cells = "{cells}" }}
damping = {{ mass = 50.0, stiffness = 1e-8 }}
[ties.top]
slave = "guide.left"
master = "pin.right"
[supports.clamp]
at = "beam.left"
fixed = ["x", "y"]
velocity = {{ x = 0.02 }}
[supports.side1]
at = "guide.top"
fixed = ["x"]
[supports.side2]
at = "guide.bottom"
fixed = ["x"]
[supports.end]
at = "guide.right"
fixed = ["x"]
[loads.press]
at = "guide.right"
force = [0.0, -20.0]
[contacts.A]
slave = "pin.tip"
master = "beam.top"
stiffness = 1e10
friction = {{ law = "coulomb", coefficient = 0.1 }}
[modal]
max_frequency_hz = 20e3
"""


def case(text: str, **changes: object) -> Case:
    """A case from its text, with values at dotted paths (dots written as __) changed."""
    made = loads(text)
    return made.with_({key.replace("__", "."): value for key, value in changes.items()}) if changes else made

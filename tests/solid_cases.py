"""Case files of published and closed-form problems, as a user would write them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from stridor import build_system, steady_sliding
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
title = "two equal rods (in the manner of Carpenter, Taylor and Katona 1991, their units made SI)"
materials.steel = { young_modulus = 206.843e9, density = 7801.45, poisson_ratio = 0.0 }
[bodies.left]
type = "solid"
material = "steel"
model = "plane stress"
thickness = 0.0254
mesh = { shape = "rectangle", corner = [-0.254, 0.0], size = [0.254, 0.0254], divisions = [200, 1], cells = "quad" }
initial_velocity = [5.13588, 0.0]
points = { middle = [-0.127, 0.0] }
[bodies.right]
type = "solid"
material = "steel"
model = "plane stress"
thickness = 0.0254
mesh = { shape = "rectangle", corner = [0.0, 0.0], size = [0.254, 0.0254], divisions = [200, 1], cells = "quad" }
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

DOYEN = """
title = "a bar strikes a wall (Doyen, Ern and Piperno 2011)"
materials.bar = { young_modulus = 900.0, density = 1.0, poisson_ratio = 0.0 }
[bodies.bar]
type = "solid"
material = "bar"
model = "plane stress"
thickness = 1.0
mesh = { shape = "rectangle", corner = [5.0, 0.0], size = [10.0, 0.5], divisions = [200, 1], cells = "quad" }
initial_velocity = [-10.0, 0.0]
points = { face = [5.0, 0.0], middle = [10.0, 0.0] }
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
duration = 2.0
[temporal]
record_every = 1
watch = ["bar.face", "bar.middle"]
[modal]
max_frequency_hz = 10.0
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


def plate(divisions: tuple[int, int, int], cells: str = "hexahedron20") -> str:
    """A 10 × 10 × 1 plate held in z on its four lateral faces, free to move in its plane."""
    supports = "".join(
        f"""
[supports.{side}]
at = "plate.{side}"
fixed = ["z"]
"""
        for side in ("left", "right", "front", "back")
    )
    return f"""
title = "a thick plate, simply supported"
materials.steel = {{ young_modulus = 200e9, density = 8000.0, poisson_ratio = 0.3 }}
[bodies.plate]
type = "solid"
material = "steel"
model = "3d"
mass = "consistent"
mesh = {{ shape = "block", corner = [0, 0, 0], size = [10, 10, 1], divisions = {list(divisions)}, cells = "{cells}" }}
{supports}
[modal]
max_frequency_hz = 204.0
"""


CANTILEVERS = {
    "beam": """
[bodies.bar]
type = "beam"
material = "steel"
start = [0.0, 0.0]
angle_deg = 0.0
length = 1.0
width = 0.02
thickness = 0.02
elements = 20
[supports.root]
at = "bar.start"
fixed = ["x", "y", "rotation"]
""",
    "plane stress": """
[bodies.bar]
type = "solid"
material = "steel"
model = "plane stress"
thickness = 0.02
mass = "consistent"
mesh = { shape = "rectangle", corner = [0.0, 0.0], size = [1.0, 0.02], divisions = [80, 4] }
[supports.root]
at = "bar.left"
fixed = ["x", "y"]
""",
    "3d": """
[bodies.bar]
type = "solid"
material = "steel"
model = "3d"
mass = "consistent"
mesh = { shape = "block", corner = [0.0, 0.0, 0.0], size = [1.0, 0.02, 0.02], divisions = [60, 3, 3] }
[supports.root]
at = "bar.left"
fixed = ["x", "y", "z"]
""",
}


def cantilever(model: str, poisson_ratio: float = 0.3) -> str:
    """A cantilever 1 m long and 20 mm square, as "beam", "plane stress" or "3d"."""
    return f"""
title = "a cantilever of slenderness 50"
materials.steel = {{ young_modulus = 210e9, density = 7800.0, poisson_ratio = {poisson_ratio} }}
{CANTILEVERS[model]}
[modal]
max_frequency_hz = 320.0
"""


def bar_in_two(*, whole: bool, space: bool = False) -> str:
    """A cantilever of slenderness 10 in one piece, or cut across and bonded with meshes that do not match."""
    steel = 'materials.steel = { young_modulus = 200e9, density = 7800.0, poisson_ratio = 0.3 }'

    def piece(name: str, start: float, length: float, divisions: list[int]) -> str:
        if space:
            divisions = [*divisions, divisions[1] + (0 if whole else len(name) % 2)]
        mesh = (
            f'shape = "block", corner = [{start}, 0, 0], size = [{length}, 0.05, 0.03]'
            if space
            else f'shape = "rectangle", corner = [{start}, 0], size = [{length}, 0.05]'
        )
        return f"""
[bodies.{name}]
type = "solid"
material = "steel"
model = "{"3d" if space else "plane stress"}"
{"" if space else "thickness = 0.03"}
mass = "consistent"
mesh = {{ {mesh}, divisions = {divisions} }}
"""

    pieces = (
        piece("root", 0.0, 0.5, [20, 3])
        if whole
        else piece("root", 0.0, 0.2, [8, 3]) + piece("tip", 0.2, 0.3, [13, 4])
    )
    tie = "" if whole else '[ties.cut]\nslave = "tip.left"\nmaster = "root.right"'
    return f"""
title = "a bar in one piece or two"
{steel}
{pieces}
{tie}
[supports.root]
at = "root.left"
fixed = {'["x", "y", "z"]' if space else '["x", "y"]'}
[modal]
max_frequency_hz = 12e3
"""


def two_blocks(cells: str, upper: int, lower: int, stiffness: float | str = "rigid") -> str:
    """Two equal blocks of plane strain, 1 m × 0.5 m, under 1 MPa, with so many elements along their contact."""

    def block(name: str, bottom: float, along: int) -> str:
        return f"""
[bodies.{name}]
type = "solid"
material = "steel"
model = "plane strain"
mesh = {{ shape = "rectangle", corner = [0.0, {bottom}], size = [1.0, 0.5], divisions = [{along}, 5], cells = "{cells}" }}
[supports.{name}]
at = "{name}.left"
fixed = ["x"]
"""

    return f"""
title = "two blocks under even pressure"
materials.steel = {{ young_modulus = 210e9, density = 7800.0, poisson_ratio = 0.3 }}
{block("upper", 0.0, upper)}
{block("lower", -0.5, lower)}
[supports.base]
at = "lower.bottom"
fixed = ["y"]
[loads.press]
at = "upper.top"
pressure = 1e6
[contacts.joint]
slave = "upper.bottom"
master = "lower.top"
stiffness = {f'"{stiffness}"' if isinstance(stiffness, str) else stiffness}
friction = {{ law = "coulomb", coefficient = 0.0 }}
"""


def unevenness(model: Case) -> tuple[float, float]:
    """Least and largest nodal pressure of two blocks over the 1 MPa that presses them."""
    pressure = steady_sliding(model).normal_force / build_system(model).contact_nodes().area
    return float(pressure.min() / 1e6), float(pressure.max() / 1e6)


def ring(divisions: tuple[int, int], mu: float = 0.3, cells: str = "quad8") -> str:
    """A ring pressed on a turning shaft by pressure from outside, and held by two springs that make a couple."""
    return f"""
title = "a ring on a shaft"
materials.bronze = {{ young_modulus = 100e9, density = 8700.0, poisson_ratio = 0.3 }}
[bodies.ring]
type = "solid"
material = "bronze"
model = "plane stress"
thickness = 0.01
mesh = {{ shape = "annulus", inner_radius = 0.03, outer_radius = 0.05, divisions = {list(divisions)}, cells = "{cells}" }}
points = {{ right = [0.05, 0.0], left = [-0.05, 0.0] }}
[bodies.shaft]
type = "obstacle"
shape = "cylinder"
point = [0.0, 0.0]
radius = 0.03
sliding = {{ spin = 10.0, centre = [0.0, 0.0] }}
[springs.right]
between = ["ring.right", "ground"]
direction = [0.0, 1.0]
stiffness = 1e7
[springs.left]
between = ["ring.left", "ground"]
direction = [0.0, 1.0]
stiffness = 1e7
[loads.press]
at = "ring.outer"
pressure = 1e6
[contacts.bore]
slave = "ring.inner"
master = "shaft"
stiffness = "rigid"
friction = {{ law = "coulomb", coefficient = {mu} }}
"""


def slider(*, space: bool, stiffness: float | str = "rigid", mu: float = 0.2, velocity: float = 1.0) -> str:
    """A block 0.1 m long and 0.04 m high, pressed by 1 kN on material that slides to the right below it.

    A spring at the middle of its top holds it back, so that it would tip towards the side that the material comes
    from. In space a second spring keeps it from turning, others from moving sideways.
    """
    cells = "hexahedron" if space else "quad"

    def boxed(corner: list[float], size: list[float], divisions: list[int]) -> str:
        if not space:
            corner, size, divisions = ([v[0], v[2]] for v in (corner, size, divisions))
        shape = "block" if space else "rectangle"
        return f'mesh = {{ shape = "{shape}", corner = {corner}, size = {size}, divisions = {divisions}, cells = "{cells}" }}'

    def at(x: float, y: float, z: float) -> list[float]:
        return [x, y, z] if space else [x, z]

    body = f'type = "solid"\nmaterial = "steel"\nmodel = "{"3d" if space else "plane stress"}"'
    body += "" if space else "\nthickness = 0.03"
    sideways = (
        f"""
[springs.far]
between = ["block.far", "ground"]
direction = {at(1, 0, 0)}
stiffness = 5e6
[springs.side]
between = ["block.near", "ground"]
direction = {at(0, 1, 0)}
stiffness = 1e7
"""
        if space
        else ""
    )
    return f"""
title = "a block on a slider"
materials.steel = {{ young_modulus = 200e9, density = 7800.0, poisson_ratio = 0.3 }}
[bodies.block]
{body}
{boxed([-0.05, -0.015, 0.0], [0.1, 0.03, 0.04], [10, 3, 4])}
points = {{ near = {at(0, -0.015, 0.04)}, far = {at(0, 0.015, 0.04)} }}
[bodies.slider]
{body}
{boxed([-0.1, -0.03, -0.03], [0.2, 0.06, 0.03], [17, 5, 3])}
sliding = {{ velocity = {at(velocity, 0, 0)} }}
[supports.ground]
at = "slider.bottom"
fixed = {'["x", "y", "z"]' if space else '["x", "y"]'}
[springs.near]
between = ["block.near", "ground"]
direction = {at(1, 0, 0)}
stiffness = {5e6 if space else 1e7}
{sideways}
[loads.press]
at = "block.top"
force = {at(0, 0, -1000)}
[contacts.rub]
slave = "block.bottom"
master = "slider.top"
stiffness = {f'"{stiffness}"' if isinstance(stiffness, str) else stiffness}
friction = {{ law = "coulomb", coefficient = {mu} }}
"""


def _graded(fine: float, length: float, size: float, growth: float = 1.25) -> np.ndarray:
    """Ends of cells (k,) from 0 to length: of one size up to fine, growing from there on; and all their middles."""
    count = round(fine / size)
    cuts, step = list(np.linspace(0.0, fine, count + 1)), fine / count
    while cuts[-1] < length:
        step *= growth
        cuts.append(cuts[-1] + step)
    ends = np.array(cuts)
    ends[count:] = fine + (ends[count:] - fine) * (length - fine) / (ends[-1] - fine)
    return np.sort(np.concatenate([ends, (ends[1:] + ends[:-1]) / 2])) / length


Side = Callable[[float], np.ndarray]


def _straight(a: tuple[float, float], b: tuple[float, float]) -> Side:
    return lambda x: (1 - x) * np.array(a) + x * np.array(b)


def _patch(bottom: Side, top: Side, left: Side, right: Side, s: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Points (k, l, 2) of a patch between four curves (Coons), at s (k,) along bottom and t (l,) along left."""
    b, p = (np.array([side(x) for x in s])[:, None] for side in (bottom, top))
    q, r = (np.array([side(x) for x in t])[None] for side in (left, right))
    s, t = s[:, None, None], t[None, :, None]
    corners = (1 - s) * ((1 - t) * b[0, 0] + t * p[0, 0]) + s * ((1 - t) * b[-1, 0] + t * p[-1, 0])
    return (1 - t) * b + t * p + (1 - s) * q + s * r - corners


class Deck:
    """An Abaqus input file in the making: patches of CPE4 or CPE8 elements, sets and surfaces."""

    def __init__(self, quadratic: bool) -> None:
        self.quadratic, self.nodes, self.lines = quadratic, {}, []
        self._count = 0

    def add(self, body: str, grid: np.ndarray) -> np.ndarray:
        """Elements (k, l) by number of a patch (2k + 1, 2l + 1, 2); nodes in the same place of a body are one."""
        n, m = grid.shape[0] // 2, grid.shape[1] // 2
        corner = [(0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1)][: 8 if self.quadratic else 4]
        self.lines.append(f"*ELEMENT, TYPE={'CPE8' if self.quadratic else 'CPE4'}, ELSET={body}")
        for i, j in np.ndindex(n, m):
            places = [grid[2 * i + a, 2 * j + b] for a, b in corner]
            numbers = [self.nodes.setdefault((body, *np.round(p, 7)), len(self.nodes) + 1) for p in places]
            self._count += 1
            self.lines.append(", ".join(map(str, [self._count, *numbers])))
        return np.arange(self._count - n * m + 1, self._count + 1).reshape(n, m)

    def node_set(self, name: str, body: str, axis: int, value: float) -> None:
        """The nodes of a body where a coordinate has a value."""
        chosen = [n for (b, *place), n in self.nodes.items() if b == body and abs(place[axis] - value) < 1e-6]
        self.lines += [f"*NSET, NSET={name}", *(", ".join(map(str, chosen[k : k + 12])) for k in range(0, len(chosen), 12))]

    def surface(self, name: str, *sides: tuple[np.ndarray, str]) -> None:
        """A surface of faces of elements."""
        self.lines += [f"*SURFACE, NAME={name}, TYPE=ELEMENT"]
        self.lines += [f"{element}, {face}" for elements, face in sides for element in elements]

    def write(self, path: Path) -> None:
        """The file, nodes first."""
        nodes = [f"{n}, {x:.9g}, {y:.9g}" for (_, x, y), n in self.nodes.items()]
        path.write_text("\n".join(["*HEADING", "millimetres", "*NODE", *nodes, *self.lines, ""]))


def hertz(
    path: Path, size: float, *, quadratic: bool = False, stiffness: float | str = "rigid", ratio: float = 1.0
) -> str:
    """Half a steel cylinder of radius 50 mm on half an aluminium block, 35 kN per mm, as a mesh file and its case.

    size [mm] of the cylinder's elements where they touch, ratio that of the block's to it: 1 makes the meshes match as
    nearly as an arc and a line can. The file holds both bodies, in millimetres.
    """
    radius, inner, depth, near = 50.0, 20.0, 200.0, 9.0
    deck = Deck(quadratic)
    x, y = _graded(near, 100.0, ratio * size) * 100.0, -_graded(near, depth, ratio * size)[::-1] * depth
    block = deck.add("BLOCK", np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1))
    middle = (0.82 * inner, radius - 0.82 * inner)

    def arc(start: float) -> Side:
        angle = [np.radians(start), np.radians(45.0)]
        return lambda x: radius * np.array([np.sin(angle[0] + x * angle[1]), 1 - np.cos(angle[0] + x * angle[1])])

    corner = tuple(arc(0.0)(1.0))
    along, inwards = _graded(near, radius * np.pi / 4, size), _graded(near, radius - inner, size)
    even = np.linspace(0.0, 1.0, 13)
    axis, oblique = _straight((0.0, 0.0), (0.0, radius - inner)), _straight(corner, middle)
    low = deck.add("CYLINDER", _patch(arc(0.0), _straight((0.0, radius - inner), middle), axis, oblique, along, inwards))
    out, bottom = (inner, radius), (0.0, radius - inner)
    side = deck.add(
        "CYLINDER", _patch(arc(45.0), _straight(middle, out), oblique, _straight((radius, radius), out), even, inwards)
    )
    core = _patch(
        _straight(bottom, middle),
        _straight((0.0, radius), out),
        _straight(bottom, (0.0, radius)),
        _straight(middle, out),
        along,
        even,
    )
    core = deck.add("CYLINDER", core)
    deck.node_set("BLOCK_AXIS", "BLOCK", 0, 0.0)
    deck.node_set("CYLINDER_AXIS", "CYLINDER", 0, 0.0)
    deck.node_set("BASE", "BLOCK", 1, -depth)
    deck.surface("TOP", (block[:, -1], "S3"))
    deck.surface("ROUND", (low[:, 0], "S1"))
    deck.surface("PUSH", (core[:, -1], "S3"), (side[-1], "S2"))
    deck.write(path)
    bodies = "".join(
        f"""
[bodies.{name}]
type = "solid"
material = "{material}"
model = "plane strain"
thickness = 0.001
file = "{path}"
group = "{name.upper()}"
scale = 0.001
[supports.{name}_axis]
at = "{name}.{name.upper()}_AXIS"
fixed = ["x"]
"""
        for name, material in (("cylinder", "steel"), ("block", "aluminium"))
    )
    return f"""
title = "a cylinder pressed on a block (Hertz)"
materials.steel = {{ young_modulus = 210e9, density = 7800.0, poisson_ratio = 0.3 }}
materials.aluminium = {{ young_modulus = 70e9, density = 2700.0, poisson_ratio = 0.3 }}
{bodies}
[supports.base]
at = "block.BASE"
fixed = ["y"]
[loads.press]
at = "cylinder.PUSH"
force = [0.0, -17500.0]
[contacts.line]
slave = "cylinder.ROUND"
master = "block.TOP"
stiffness = {f'"{stiffness}"' if isinstance(stiffness, str) else stiffness}
friction = {{ law = "coulomb", coefficient = 0.0 }}
"""


def hertz_found(model: Case) -> tuple[float, float, float]:
    """Half width a [m], largest pressure p₀ [Pa] and force [N] of the half model: p² = p₀² (1 − x²/a²) fitted to the
    nodes that press, but for the outermost twentieth."""
    nodes, found = build_system(model).contact_nodes(), steady_sliding(model)
    x, pressure = nodes.position[:, 0], found.normal_force / nodes.area
    chosen = found.active & (x < 0.95 * x[found.active].max())
    slope, square = np.polyfit(x[chosen] ** 2, pressure[chosen] ** 2, 1)
    return float(np.sqrt(-square / slope)), float(np.sqrt(square)), float(found.normal_force.sum())


def bench_as_solids(cells: str = "quad8", across: tuple[int, int] = (2, 4), along: tuple[int, int] = (30, 90)) -> str:
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
slave = "pin.right"
master = "guide.left"
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

"""Solids, masses, obstacles, ties and springs that will not do, each with the exact message that its author gets."""

from __future__ import annotations

import contextlib
import random
import re
import time
from pathlib import Path

import numpy as np
import pytest

import stridor as st
from program import stridor
from stridor.case import loads, template_text
from stridor.errors import AnalysisError, CaseError, StridorError
from stridor.sliding.equilibrium import unsettled
from stridor.system import build_system

pytestmark = pytest.mark.bad_input

SLIDER = (
    'mesh = { shape = "rectangle", corner = [0.02, 0.01], size = [0.02, 0.01], divisions = [4, 2], cells = "quad" }'
)
CONTACT = """[contacts.rub]
slave = "slider.bottom"
master = "rail.top"
stiffness = 1e13
friction = { law = "coulomb", coefficient = 0.2 }
"""
GUIDE = '[supports.guide]\nat = "slider.left"\nfixed = ["x"]\n'
PLANE = f"""
[materials.steel]
young_modulus = 200e9
density = 7800.0

[bodies.slider]
type = "solid"
model = "plane stress"
material = "steel"
thickness = 0.01
{SLIDER}
points = {{ tip = [0.03, 0.02] }}

[bodies.rail]
type = "solid"
model = "plane stress"
material = "steel"
thickness = 0.01
mesh = {{ shape = "rectangle", corner = [0.0, 0.0], size = [0.06, 0.01], divisions = [12, 2], cells = "quad" }}

[supports.ground]
at = "rail.bottom"
fixed = ["x", "y"]
velocity = {{ x = 0.1 }}

{GUIDE}
[loads.press]
at = "slider.top"
pressure = 1e6

{CONTACT}
[[phases]]
name = "slide"
duration = 2e-5
"""

PLATE = (
    'shape = "block", corner = [0.0, 0.0, 0.0], size = [0.04, 0.04, 0.01], divisions = [4, 4, 1], cells = "hexahedron"'
)
SPACE = f"""
[materials.iron]
young_modulus = 120e9
density = 7200.0

[bodies.pad]
type = "solid"
model = "3d"
material = "iron"
mesh = {{ shape = "block", corner = [0.01, 0.01, 0.01], size = [0.02, 0.02, 0.01], divisions = [2, 2, 1], cells = "tetra" }}

[bodies.plate]
type = "solid"
model = "3d"
material = "iron"
mesh = {{ {PLATE} }}
sliding = {{ velocity = [0.1, 0.0, 0.0] }}

[supports.ground]
at = "plate.bottom"
fixed = ["x", "y", "z"]

[supports.guide]
at = "pad.left"
fixed = ["x", "y"]

[loads.press]
at = "pad.top"
pressure = 1e6

[contacts.rub]
slave = "pad.bottom"
master = "plate.top"
stiffness = 1e13
friction = {{ law = "coulomb", coefficient = 0.2 }}

[modal]
max_frequency_hz = 20e3
"""


def flat(rest: str = "normal = [0.0, 1.0]", shape: str = "flat") -> str:
    """An obstacle, to stand before the supports."""
    return f'[bodies.wall]\ntype = "obstacle"\nshape = "{shape}"\npoint = [0.0, -0.01]\n{rest}\n\n[supports.ground]'


def mass(rest: str = "mass = 1.0\nposition = [0.0, 0.02]") -> str:
    """A point mass, to stand before the supports."""
    return f'[bodies.m]\ntype = "mass"\n{rest}\n\n[supports.ground]'


def spring(rest: str) -> str:
    """A spring, to stand before the supports."""
    return f"[springs.k]\n{rest}\n\n[supports.ground]"


def tie(slave: str = "slider.bottom", master: str = "rail.top", rest: str = "") -> str:
    """A tie in the place of the contact."""
    return f'[ties.glue]\nslave = "{slave}"\nmaster = "{master}"\n{rest}\n'


GROUND = "[supports.ground]"
PHASES = "[[phases]]"
BEAM = """[bodies.b]
type = "beam"
material = "steel"
start = [0.0, 0.03]
end = [0.1, 0.03]
width = 0.01
thickness = 0.001
elements = 10

[supports.ground]"""
OUT_OF_RANGE = (
    "its mass, stiffness or damping has entries outside 1e-100 … 1e+100, beyond what can be computed with; check the "
    "units of its lengths, its material and its damping"
)
DIVISIONS = "must be whole numbers >= 1, one for each edge: how many elements along it"
NO_OBSTACLE = "an obstacle has no points or boundaries; only a contact's master is one"
NO_LINE = "missing – its ends give no line to act along; give direction = [x, y]"
TWO_POINTS = 'must be a list of two points, "body.point" or for a mass "body"; the second may be "ground"'
NEVER = "contacts.rub: the bodies do not face each other: the nearest node of the slave is"
ASIDE = "and none lies over the master; all are beyond its edges. Move a body or take a longer boundary"
AVERTED = "and their outward normals do not oppose each other; check which boundaries are meant"

# what is wrong: (text of the plane case, what stands there instead, …, the message)
MESHES = {
    "nan": (
        "corner = [0.02, 0.01]",
        "corner = [nan, 0.01]",
        "bodies.slider.mesh.corner: [nan, 0.01] – must be [x, y], two numbers [m]: the lower left corner; all of them must be finite",
    ),
    "size of zero": (
        "size = [0.02, 0.01]",
        "size = [0.0, 0.01]",
        "bodies.slider.mesh.size: [0.0, 0.01] – must be [length along x, height along y], two numbers > 0 [m]",
    ),
    "size beyond numbers": (
        "size = [0.02, 0.01]",
        "size = [1e300, 0.01]",
        "bodies.slider.mesh.size: [1e+300, 0.01] – must be [length along x, height along y], two numbers > 0 [m]; at most 1e+100 can be computed with",
    ),
    "size that cubes cannot hold": (
        "size = [0.02, 0.01]",
        "size = [1e60, 0.01]",
        "bodies.slider.mesh: 1e+60 m in extent; must be between 1e-20 and 1e+20 m",
    ),
    "size below rounding": (
        "size = [0.02, 0.01]",
        "size = [1e-30, 0.01]",
        [
            "bodies.slider: 8 of 8 cells are degenerate (zero Jacobian: flat, or nodes at one place); the first is quad cell number 1 about (0.02, 0.0125)",
            "bodies.slider: boundary bottom: 4 of 4 facets have no area; the first is at (0.02, 0.01)",
            "bodies.slider: boundary top: 4 of 4 facets have no area; the first is at (0.02, 0.02)",
        ],
    ),
    "thickness": (
        f"thickness = 0.01\n{SLIDER}",
        f"thickness = 1e-320\n{SLIDER}",
        f"bodies.slider: {OUT_OF_RANGE}",
    ),
    "density": ("density = 7800.0", "density = 1e-200", f"bodies.slider: {OUT_OF_RANGE}"),
    "modulus": (
        "young_modulus = 200e9",
        "young_modulus = 1e308",
        "materials.steel.young_modulus: 1e+308 – must be a number > 0 [Pa], Young's modulus; at most 1e+100 can be computed with",
    ),
    "poisson": (
        "density = 7800.0",
        "density = 7800.0\npoisson_ratio = 0.5",
        "materials.steel.poisson_ratio: 0.5 – must be a number between -1 and 0.5, Poisson's ratio",
    ),
    "three divisions": (
        "divisions = [4, 2]",
        "divisions = [4, 2, 1]",
        "bodies.slider.mesh.divisions: [4, 2, 1] – must have 2 numbers: along x, along y",
    ),
    "no division": ("divisions = [4, 2]", "divisions = [4, 0]", f"bodies.slider.mesh.divisions: [4, 0] – {DIVISIONS}"),
    "empty divisions": ("divisions = [4, 2]", "divisions = []", f"bodies.slider.mesh.divisions: [] – {DIVISIONS}"),
    "half a division": (
        "divisions = [4, 2]",
        "divisions = [4.5, 2]",
        f"bodies.slider.mesh.divisions: [4.5, 2] – {DIVISIONS}",
    ),
    "one number": ("divisions = [4, 2]", "divisions = 4", f"bodies.slider.mesh.divisions: 4 – {DIVISIONS}"),
    "both sizes": (
        "divisions = [4, 2]",
        "divisions = [4, 2], element_size = 0.01",
        "bodies.slider.mesh.divisions: [4, 2] – give either divisions or element_size [m]",
    ),
    "neither size": (
        "divisions = [4, 2], ",
        "",
        "bodies.slider.mesh.divisions: give either divisions or element_size [m]",
    ),
    "too many divisions": (
        "divisions = [4, 2]",
        "divisions = [50000, 100]",
        "bodies.slider.mesh.divisions: [50000, 100] – makes 10.1 million degrees of freedom, whose matrices alone take about 8.7 GB; at most 5 million can be computed with: take fewer divisions",
    ),
    "element size too small": (
        "divisions = [4, 2]",
        "element_size = 1e-6",
        "bodies.slider.mesh.element_size: 1e-06 – makes 400.1 million degrees of freedom, whose matrices alone take about 3.5e+02 GB; at most 5 million can be computed with: take a larger element_size",
    ),
    "element size below numbers": (
        "divisions = [4, 2]",
        "element_size = 1e-320",
        "bodies.slider.mesh.element_size: 1e-320 – makes more than 1e+20 degrees of freedom, whose matrices alone take more than any machine has; at most 5 million can be computed with: take a larger element_size",
    ),
    "element size of zero": (
        "divisions = [4, 2]",
        "element_size = 0.0",
        "bodies.slider.mesh.element_size: 0.0 – must be a number > 0 [m], the element size, instead of divisions",
    ),
    "cells of space": (
        'cells = "quad"',
        'cells = "tetra"',
        'bodies.slider.mesh.cells: \'tetra\' – must be "triangle", "triangle6", "quad", "quad8" or "quad9", the kind of the elements of a shape in the plane',
    ),
    "shape": (
        'shape = "rectangle"',
        'shape = "rect"',
        'bodies.slider.mesh.shape: \'rect\' – must be "rectangle", "quadrilateral", "annulus", "block", "disc" or "pad", the shape meshed; did you mean \'rectangle\'?',
    ),
    "key of a mesh": (
        "size = [0.02, 0.01]",
        "sizes = [0.02, 0.01]",
        "bodies.slider.mesh.sizes: unknown key; did you mean 'size'? accepted: divisions, element_size, grading, shape, corner, size, angle_deg, cells",
    ),
    "key of another shape": (
        "size = [0.02, 0.01]",
        "size = [0.02, 0.01], inner_radius = 1.0",
        "bodies.slider.mesh.inner_radius: 1.0 – not used by 'rectangle'; accepted: divisions, element_size, grading, shape, corner, size, angle_deg, cells",
    ),
    "plane mesh in space": (
        'model = "plane stress"',
        'model = "3d"',
        'bodies.slider.model: \'3d\' – the mesh lies in the plane; take "plane stress" or "plane strain"',
    ),
    "no material": (
        'material = "steel"\n',
        "",
        "bodies.slider.material: missing – give the NAME of a [materials.NAME] (only an Abaqus file may bring its own)",
    ),
    "misspelt material": (
        'material = "steel"',
        'material = "stel"',
        "bodies.slider.material: 'stel' – no such material; did you mean 'steel'? the case has: steel",
    ),
    "no mesh": (SLIDER, "", 'bodies.slider: must have either mesh = { shape = …, … } or file = "….msh"'),
    "mesh and file": (
        SLIDER,
        f'{SLIDER}\nfile = "a.msh"',
        'bodies.slider: must have either mesh = { shape = …, … } or file = "….msh", not both',
    ),
    "group without file": (
        SLIDER,
        f'{SLIDER}\ngroup = "a"',
        "bodies.slider.group: 'a' – only used with file",
    ),
    "scale without file": (
        SLIDER,
        f"{SLIDER}\nscale = 0.001",
        "bodies.slider.scale: 0.001 – only used with file; built-in meshes are in metres",
    ),
    "far from the origin": (
        "corner = [0.02, 0.01]",
        "corner = [1e12, 0.01]",
        "bodies.slider: lies 1e+12 m from the origin, with an extent of 0.02 m: rounding would bend it; move the bodies of the case nearer to the origin",
    ),
    "point in space": (
        "tip = [0.03, 0.02]",
        "tip = [0.3, 0.02, 0.0]",
        "bodies.slider.points.tip: [0.3, 0.02, 0.0] – must have 2 numbers, one for each direction",
    ),
    "point under the name of a boundary": (
        "tip = [0.03, 0.02]",
        "right = [0.03, 0.02]",
        "bodies.slider.points.right: [0.03, 0.02] – a boundary has this name; choose another name",
    ),
    "initial velocity": (
        SLIDER,
        f"{SLIDER}\ninitial_velocity = [1.0, 0.0, 0.0]",
        "bodies.slider.initial_velocity: [1.0, 0.0, 0.0] – must have 2 numbers, one for each direction",
    ),
    "sliding about no axis": (
        SLIDER,
        f"{SLIDER}\nsliding = {{ spin = 1.0, axis = [0.0, 0.0, 0.0] }}",
        "bodies.slider.sliding.axis: [0.0, 0.0, 0.0] – must not be zero",
    ),
    "spin in the plane about x": (
        SLIDER,
        f"{SLIDER}\nsliding = {{ spin = 1.0, axis = [1.0, 0.0, 0.0] }}",
        "bodies.slider.sliding.axis: [1.0, 0.0, 0.0] – in the plane the axis is z; leave it out, and give a negative spin to turn clockwise",
    ),
    "sliding velocity": (
        SLIDER,
        f"{SLIDER}\nsliding = {{ velocity = [1.0, 0.0, 0.0] }}",
        "bodies.slider.sliding.velocity: [1.0, 0.0, 0.0] – must have 2 numbers, one for each direction",
    ),
    "sliding without motion": (
        SLIDER,
        f"{SLIDER}\nsliding = {{ centre = [0.0, 0.0] }}",
        "bodies.slider.sliding: must have velocity = [x, y] [m/s] or spin [rad/s], not only centre",
    ),
}

HELD_AND_LOADED = {
    "support along z": (
        'fixed = ["x"]',
        'fixed = ["x", "z"]',
        "supports.guide.fixed: 'z' – slider moves along x, y only",
    ),
    "support against rotation": (
        'fixed = ["x"]',
        'fixed = ["rotation"]',
        "supports.guide.fixed: 'rotation' – slider moves along x, y only",
    ),
    "distance along a solid": (
        'at = "slider.left"',
        'at = "slider@0.01"',
        "supports.guide.at: 'slider@0.01' – a solid has no axis; name a point in bodies.slider.points",
    ),
    "a body alone": (
        'at = "slider.left"',
        'at = "slider"',
        'supports.guide.at: \'slider\' – must be a point, "body.point", or a boundary, "body.boundary", such as slider.left',
    ),
    "two velocities": (
        GUIDE,
        GUIDE + '[supports.other]\nat = "rail.left"\nfixed = ["x"]\nvelocity = { x = 0.2 }\n',
        "supports.other.fixed: ['x'] – x of the node at (0, 0) m, shared with supports.ground, gets two velocities, 0.1 and 0.2 m/s; let one of them hold it",
    ),
    "moment": (
        "pressure = 1e6",
        "moment = 1.0",
        "loads.press.moment: 1.0 – only a beam takes a moment; give a pair of forces",
    ),
    "pressure on a point": (
        'at = "slider.top"',
        'at = "slider.tip"',
        "loads.press.pressure: 1000000.0 – a pressure acts on a boundary; a point takes a force",
    ),
    "pressure beyond numbers": (
        "pressure = 1e6",
        "pressure = 1e308",
        "loads.press.pressure: 1e+308 – must be a number [Pa], the pressure that pushes on a boundary; at most 1e+100 can be computed with",
    ),
    "force in space": (
        "pressure = 1e6",
        "force = [0.0, -1.0, 0.0]",
        "loads.press.force: [0.0, -1.0, 0.0] – must have 2 numbers, as slider lives in 2 dimensions",
    ),
    "velocity": (
        "velocity = { x = 0.1 }",
        "velocity = { x = nan }",
        "supports.ground.velocity.x: nan – must be a number, x, y, z [m/s], rotation [rad/s]; it must be finite",
    ),
    "phase of no body": (
        "duration = 2e-5",
        "duration = 2e-5\nvelocities = { railing = 1.0 }",
        "phases.0.velocities.railing: 1.0 – no such support with a velocity; the case has: ground",
    ),
    "phase of a body at rest": (
        "duration = 2e-5",
        "duration = 2e-5\nvelocities = { slider = 1.0 }",
        "phases.0.velocities.slider: 1.0 – bodies.slider has no sliding",
    ),
    "watch a boundary": (
        PHASES,
        f'[temporal]\nwatch = ["slider.top", "rail.top"]\n{PHASES}',
        [
            "temporal.watch.0: 'slider.top' – a boundary, where a point is wanted; slider has: slider.tip",
            "temporal.watch.1: 'rail.top' – a boundary, where a point is wanted; give one in bodies.rail.points",
        ],
    ),
    "watch no point": (
        PHASES,
        f'[temporal]\nwatch = ["slider.tipp", "slider"]\n{PHASES}',
        [
            "temporal.watch.0: 'slider.tipp' – no such point; did you mean 'tip'?; slider has: slider.tip",
            'temporal.watch.1: \'slider\' – must be a point, "body.point" or "body@distance", such as slider.tip',
        ],
    ),
    "everything held": (
        "divisions = [4, 2]",
        "divisions = [1, 1]",
        "divisions = [12, 2]",
        "divisions = [1, 1]",
        'at = "slider.left"\nfixed = ["x"]',
        'at = "slider.left"\nfixed = ["x", "y"]\n[supports.a]\nat = "slider.right"\nfixed = ["x", "y"]\n'
        '[supports.b]\nat = "rail.top"\nfixed = ["x", "y"]\nvelocity = { x = 0.1 }',
        "supports: hold every degree of freedom of the case; leave some of them free",
    ),
    "mass in space": (
        GROUND,
        mass("mass = 1.0\nposition = [0.0, 0.02, 0.0]"),
        "bodies: bodies in the plane (slider, rail) and in space (m) cannot meet in one case; model all of them in 2 or all in 3 dimensions",
    ),
    "mass of nothing": (
        GROUND,
        mass("mass = 0.0\nposition = [0.0, 0.02]"),
        "bodies.m.mass: 0.0 – must be a number > 0 [kg], the mass",
    ),
    "part of a mass": (
        GROUND,
        mass(),
        'at = "slider.top"',
        'at = "m.x"',
        'loads.press.at: \'m.x\' – a mass is one point; write "m"',
    ),
    "load on an obstacle": (
        GROUND,
        flat(),
        'at = "slider.top"',
        'at = "wall"',
        f"loads.press.at: 'wall' – {NO_OBSTACLE}",
    ),
    "no normal": (
        GROUND,
        flat(""),
        "bodies.wall.normal: missing – give [x, y] or [x, y, z], from the flat to the bodies",
    ),
    "zero normal": (GROUND, flat("normal = [0.0, 0.0]"), "bodies.wall.normal: [0.0, 0.0] – must not be zero"),
    "normal in space": (
        GROUND,
        flat("normal = [0.0, 0.0, 1.0]"),
        "bodies.wall.normal: [0.0, 0.0, 1.0] – must have 2 numbers, one for each direction",
    ),
    "flat bore": (
        GROUND,
        flat("normal = [0.0, 1.0]\ninside = true"),
        'bodies.wall.inside: true – not used by "flat"',
    ),
    "no radius": (
        GROUND,
        flat("", "cylinder"),
        "bodies.wall.radius: missing – give a number > 0 [m], the radius of the cylinder",
    ),
}

CONTACTS = {
    "boundary": (
        '"slider.bottom"',
        '"slider.botom"',
        "contacts.rub.slave: 'slider.botom' – no such point or boundary; did you mean 'bottom'? slider has: tip, left, right, bottom, top",
    ),
    "whole body as master": (
        '"rail.top"',
        '"rail"',
        'contacts.rub.master: \'rail\' – must be a boundary of it, such as "rail.top"',
    ),
    "with itself": (
        '"rail.top"',
        '"slider.top"',
        "contacts.rub.master: 'slider.top' – must be another body than the slave's",
    ),
    "stiffness": (
        "stiffness = 1e13",
        "stiffness = -1e13",
        'contacts.rub.stiffness: -10000000000000.0 – must be a number > 0 [N/m], between boundaries per area [N/m³], or "rigid", the normal stiffness',
    ),
    "adjust": (
        "stiffness = 1e13",
        "stiffness = 1e13\nadjust = -1.0",
        "contacts.rub.adjust: -1.0 – must be a number >= 0 [m], gaps and overlaps of slave nodes up to this count as touching",
    ),
    "side of a boundary": (
        "stiffness = 1e13",
        'stiffness = 1e13\nside = "left"',
        "contacts.rub.side: 'left' – only a beam has sides; a boundary and an obstacle know theirs",
    ),
    "overlap": (
        "corner = [0.02, 0.01]",
        "corner = [0.02, 0.009]",
        "contacts.rub: the bodies overlap: 5 nodes of the slave lie inside the master, the deepest by 0.001 m at (0.02, 0.009) m; up to 2e-11 m is allowed. Move the slave's body by 0.001 m along (0, 1), or the master's the opposite way",
    ),
    "apart": (
        "corner = [0.02, 0.01]",
        "corner = [0.2, 0.01]",
        f"{NEVER} 0.14 m from the master, at (0.2, 0.01) m, {ASIDE}",
    ),
    "averted": ('"rail.top"', '"rail.bottom"', f"{NEVER} 0.01 m from the master, at (0.02, 0.01) m, {AVERTED}"),
    "the same pair twice": (
        PHASES,
        CONTACT.replace("rub", "again") + PHASES,
        "contacts.again.slave: 'slider.bottom' – slides on rail.top in contacts.rub already",
    ),
    "obstacle as slave": (
        GROUND,
        flat(),
        'slave = "slider.bottom"',
        'slave = "wall"',
        f"contacts.rub.slave: 'wall' – {NO_OBSTACLE}",
    ),
    "part of an obstacle as master": (
        GROUND,
        flat(),
        'master = "rail.top"',
        'master = "wall.top"',
        'contacts.rub.master: \'wall.top\' – an obstacle is a master as a whole; write "wall"',
    ),
    "mass as master": (
        GROUND,
        mass(),
        'master = "rail.top"',
        'master = "m"',
        "contacts.rub.master: 'm' – a point mass has no surface to slide on",
    ),
    "boundary on a beam without a side": (
        GROUND,
        BEAM,
        'slave = "slider.bottom"\nmaster = "rail.top"',
        'slave = "slider.top"\nmaster = "b"',
        'contacts.rub.side: missing – give "left" or "right" of b',
    ),
    "boundary on the other side of a beam": (
        GROUND,
        BEAM,
        'slave = "slider.bottom"\nmaster = "rail.top"',
        'slave = "slider.top"\nmaster = "b"\nside = "left"',
        f"{NEVER} 0.01 m from the master, at (0.02, 0.02) m, {AVERTED}",
    ),
}

LINKS = {
    "tie within a body": (
        CONTACT,
        tie(master="slider.top"),
        "ties.glue.master: 'slider.top' – must belong to another body than the slave's; of one that repeats give translation or rotation from the master to the slave",
    ),
    "tie of what is apart": (
        CONTACT,
        tie(),
        "corner = [0.02, 0.01]",
        "corner = [0.02, 0.011]",
        "ties.glue: 5 of 5 slave nodes are farther than 0.00025 m from the master, the farthest by 0.001 m at (0.035, 0.011) m; tie only nodes that lie on it, or set a larger tolerance",
    ),
    "tie twice": (
        CONTACT,
        tie() + tie().replace("glue", "more"),
        "ties.more: says nothing that ties.glue does not say already; leave it out",
    ),
    "tie of what slides": (
        CONTACT,
        CONTACT + tie(),
        "ties.glue.slave: 'slider.bottom' – what is bonded cannot slide on it in contacts.rub as well; remove one of them",
    ),
    "tie of a point": (CONTACT, tie("slider.tip"), "ties.glue.slave: 'slider.tip' – must be a boundary, \"body.boundary\""),
    "tie to an obstacle": (
        GROUND,
        flat(),
        CONTACT,
        tie(master="wall"),
        f"ties.glue.master: 'wall' – {NO_OBSTACLE}",
    ),
    "tie tolerance": (
        CONTACT,
        tie(rest="tolerance = -1.0"),
        "ties.glue.tolerance: -1.0 – must be a number >= 0 [m], the largest distance between them (left out: 5 % of an element)",
    ),
    "spring to itself": (
        GROUND,
        spring('between = ["slider.tip", "slider.tip"]\nstiffness = 1e5\ndirection = [1.0, 0.0]'),
        "springs.k.between: ['slider.tip', 'slider.tip'] – both ends are the same point",
    ),
    "spring to ground without direction": (
        GROUND,
        spring('between = ["slider.tip", "ground"]\nstiffness = 1e5'),
        f"springs.k.direction: {NO_LINE}",
    ),
    "spring between points that are one node": (
        "tip = [0.03, 0.02]",
        "tip = [0.03, 0.02], tap = [0.0301, 0.02]",
        GROUND,
        spring('between = ["slider.tip", "slider.tap"]\nstiffness = 1e5'),
        "springs.k.between: ['slider.tip', 'slider.tap'] – both ends are the mesh node at (0.03, 0.02) m; refine the mesh or move one of the points",
    ),
    "spring of no length": (
        GROUND,
        "[bodies.m]\ntype = \"mass\"\nmass = 1.0\nposition = [0.03, 0.02]\n"
        + spring('between = ["slider.tip", "m"]\nstiffness = 1e5'),
        f"springs.k.direction: {NO_LINE}",
    ),
    "spring of no length between nodes": (
        "tip = [0.03, 0.02]",
        "tip = [0.0301, 0.02]",
        GROUND,
        "[bodies.m]\ntype = \"mass\"\nmass = 1.0\nposition = [0.03, 0.02]\n"
        + spring('between = ["slider.tip", "m"]\nstiffness = 1e5'),
        "springs.k.direction: missing – both ends are mesh nodes at (0.03, 0.02) m, which gives no line; give direction = [x, y]",
    ),
    "spring from ground": (
        GROUND,
        spring('between = ["ground", "slider.tip"]\nstiffness = 1e5'),
        "springs.k.between.0: 'ground' – only the second end may be ground; turn them round",
    ),
    "spring with one end": (
        GROUND,
        spring('between = ["slider.tip"]\nstiffness = 1e5'),
        f"springs.k.between: ['slider.tip'] – {TWO_POINTS}",
    ),
    "spring on a boundary": (
        GROUND,
        spring('between = ["slider.top", "ground"]\nstiffness = 1e5\ndirection = [1.0, 0.0]'),
        "springs.k.between.0: 'slider.top' – a boundary, where a point is wanted; slider has: slider.tip",
    ),
    "spring along nothing": (
        GROUND,
        spring('between = ["slider.tip", "ground"]\nstiffness = 1e5\ndirection = [0.0, 0.0]'),
        "springs.k.direction: [0.0, 0.0] – must not be zero",
    ),
}

IN_SPACE = {
    "model": (
        'model = "3d"',
        'model = "plane stress"',
        "bodies.pad.model: 'plane stress' – the mesh lies in space; take \"3d\"",
    ),
    "beam": (
        GROUND,
        BEAM.replace("steel", "iron"),
        "bodies: bodies in the plane (b) and in space (pad, plate) cannot meet in one case; model all of them in 2 or all in 3 dimensions",
    ),
    "force": (
        "pressure = 1e6",
        "force = [0.0, -1.0]",
        "loads.press.force: [0.0, -1.0] – must have 3 numbers, as pad lives in 3 dimensions",
    ),
    "divisions": (
        "divisions = [2, 2, 1]",
        "divisions = [2, 2]",
        "bodies.pad.mesh.divisions: [2, 2] – must have 3 numbers: along x, along y, along z",
    ),
    "element size": (
        "divisions = [2, 2, 1]",
        "element_size = 1e-6",
        "bodies.pad.mesh.element_size: 1e-06 – makes 1.2e+13 degrees of freedom, whose matrices alone take about 2.6e+07 GB; at most 5 million can be computed with: take a larger element_size",
    ),
    "all bodies together": (
        "divisions = [2, 2, 1]",
        "divisions = [100, 100, 100]",
        "divisions = [4, 4, 1]",
        "divisions = [90, 90, 90]",
        "bodies.pad.mesh.divisions: [100, 100, 100] – makes 3.091 million degrees of freedom of 5.352 million in all bodies, whose matrices alone take about 15 GB; at most 5 million can be computed with: take fewer divisions",
    ),
    "cylinder": (
        GROUND,
        '[bodies.w]\ntype = "obstacle"\nshape = "cylinder"\nradius = 1.0\npoint = [0.0, 0.0, -1.0]\n' + GROUND,
        "bodies.w.axis: missing – give [x, y, z], the axis of the cylinder, not zero",
    ),
    "disc": (
        PLATE,
        'shape = "disc", inner_radius = 0.1, outer_radius = 0.05, thickness = 0.01, divisions = [2, 8, 1]',
        "bodies.plate.mesh.inner_radius: 0.1 – must be below outer_radius, 0.05",
    ),
    "too few around": (
        PLATE,
        'shape = "disc", inner_radius = 0.01, outer_radius = 0.05, thickness = 0.01, divisions = [2, 2, 1]',
        "bodies.plate.mesh.divisions: 2 – needs at least 3 divisions around for 360°",
    ),
    "whole turn": (
        PLATE,
        'shape = "pad", start_deg = 0.0, sweep_deg = 360.0, inner_radius = 0.01, outer_radius = 0.05, thickness = 0.01, divisions = [2, 8, 1]',
        'bodies.plate.mesh.sweep_deg: 360.0 – must be below 360; a full turn is shape = "disc"',
    ),
    "overlap": (
        "corner = [0.01, 0.01, 0.01]",
        "corner = [0.01, 0.01, 0.008]",
        "contacts.rub: the bodies overlap: 9 nodes of the slave lie inside the master, the deepest by 0.002 m at (0.01, 0.01, 0.008) m; up to 2.83e-11 m is allowed. Move the slave's body by 0.002 m along (0, 0, 1), or the master's the opposite way",
    ),
    "apart": (
        "corner = [0.01, 0.01, 0.01]",
        "corner = [0.1, 0.01, 0.01]",
        f"{NEVER} 0.06 m from the master, at (0.1, 0.01, 0.01) m, {ASIDE}",
    ),
}


def changed(text: str, *edits: str) -> str:
    """A text with pieces of it replaced, once each."""
    for there, instead in zip(edits[::2], edits[1::2], strict=True):
        assert there in text
        text = text.replace(there, instead, 1)
    return text


def told(text: str) -> list[str]:
    """The lines that a case is refused with, read or built."""
    with pytest.raises(CaseError) as caught:
        build_system(loads(text))
    return str(caught.value).split("\n")


def lines(message: str | list[str]) -> list[str]:
    return [message] if isinstance(message, str) else message


@pytest.mark.parametrize("fault", [*MESHES.values()], ids=[*MESHES])
def test_bad_meshes(fault: tuple[str, ...]) -> None:
    assert told(changed(PLANE, *fault[:-1])) == lines(fault[-1])


@pytest.mark.parametrize("fault", [*HELD_AND_LOADED.values()], ids=[*HELD_AND_LOADED])
def test_bad_supports_loads_and_bodies(fault: tuple[str, ...]) -> None:
    assert told(changed(PLANE, *fault[:-1])) == lines(fault[-1])


@pytest.mark.parametrize("fault", [*CONTACTS.values()], ids=[*CONTACTS])
def test_bad_contacts(fault: tuple[str, ...]) -> None:
    assert told(changed(PLANE, *fault[:-1])) == lines(fault[-1])


@pytest.mark.parametrize("fault", [*LINKS.values()], ids=[*LINKS])
def test_bad_ties_and_springs(fault: tuple[str, ...]) -> None:
    assert told(changed(PLANE, *fault[:-1])) == lines(fault[-1])


@pytest.mark.parametrize("fault", [*IN_SPACE.values()], ids=[*IN_SPACE])
def test_bad_cases_in_space(fault: tuple[str, ...]) -> None:
    assert told(changed(SPACE, *fault[:-1])) == lines(fault[-1])


def test_sound_cases_are_sound() -> None:
    for text in (PLANE, SPACE):
        assert st.describe(loads(text)).warnings == ()


def test_a_case_of_obstacles_only() -> None:
    assert told(flat().removesuffix(GROUND)) == [
        "bodies: only obstacles, which are rigid; a case needs a beam, a solid or a mass as well"
    ]


def test_too_many_freedoms_are_refused_before_anything_is_allocated() -> None:
    started = time.perf_counter()
    told(changed(PLANE, "divisions = [4, 2]", "divisions = [100000, 100000]"))
    assert time.perf_counter() - started < 1.0


# -- allowed, and probably not meant -------------------------------------------------------------------------------------


def scaled(factor: float) -> str:
    """The plane case with every length of its meshes in another unit."""
    text = PLANE
    for numbers in ("[0.02, 0.01]", "[0.06, 0.01]"):
        values = [float(n) * factor for n in numbers.strip("[]").split(",")]
        text = text.replace(numbers, repr(values))
    return text.replace("points = { tip = [0.03, 0.02] }\n", "")


WAVE = "elements per shear wavelength (0.0785 m) at modal.max_frequency_hz = 40000 Hz"
COARSE = "refine the mesh, lower the frequency, or check the unit of length"
UNUSUAL = "is unusual for a length, usually 0.0001 to 10 m"
CHECK = "check its unit and its digits"
UNITS = {
    1e3: [
        f"bodies.slider.mesh.size: 20 m {UNUSUAL}; if 20 mm is meant, write 0.02",
        f"bodies.rail.mesh.size: 60 m {UNUSUAL}; if 60 mm is meant, write 0.06",
    ],
    1e-3: [
        f"bodies.slider.mesh.size: 2e-05 m {UNUSUAL}; {CHECK}",
        f"bodies.rail.mesh.size: 6e-05 m {UNUSUAL}; {CHECK}",
    ],
    1e12: [
        f"bodies.slider.mesh.corner: 2e+10 m is unusual for a coordinate, usually at most 100 m; {CHECK}",
        f"bodies.slider.mesh.size: 2e+10 m {UNUSUAL}; {CHECK}",
        f"bodies.rail.mesh.size: 6e+10 m {UNUSUAL}; {CHECK}",
    ],
    1e-12: [
        f"bodies.slider.mesh.size: 2e-14 m {UNUSUAL}; {CHECK}",
        f"bodies.rail.mesh.size: 6e-14 m {UNUSUAL}; {CHECK}",
    ],
}


@pytest.mark.parametrize("factor", UNITS)
def test_lengths_in_another_unit(factor: float) -> None:
    assert list(st.describe(loads(scaled(factor))).warnings) == UNITS[factor]


WARNINGS = {
    "point off the body": (
        "tip = [0.03, 0.02]",
        "tip = [0.3, 0.02]",
        "bodies.slider.points.tip: the nearest node is 0.26 m away",
    ),
    "spring that pushes": (
        GROUND,
        spring('between = ["slider.tip", "ground"]\nstiffness = -1e5\ndirection = [1.0, 0.0]'),
        "springs.k.stiffness: -100000 N/m is negative: it drives its ends apart",
    ),
    "spring of nothing": (
        GROUND,
        spring('between = ["slider.tip", "ground"]\nstiffness = 0.0\ndirection = [1.0, 0.0]'),
        "springs.k: no stiffness, no cubic part and no damping, so that it has no effect",
    ),
    "sliding out of the surface": (
        SLIDER,
        f"{SLIDER}\nsliding = {{ velocity = [0.0, 1.0] }}",
        "contacts.rub: sliding moves material through the surface at 1 m/s of 1 m/s, and only what is along it counts; check velocity, axis and centre of sliding",
    ),
    "sliding where nothing touches": (
        GROUND,
        flat("normal = [0.0, 1.0]\nsliding = { velocity = [1.0, 0.0] }"),
        "bodies.wall.sliding: no contact touches wall, so that it has no effect",
    ),
    "adjust": (
        "stiffness = 1e13",
        "stiffness = 1e13\nadjust = 0.005",
        "contacts.rub.adjust: 0.005 m moves slave nodes by up to as much, and the slave is 0.02 m in extent; it is meant for the small misfit of meshes",
    ),
    "friction": (
        "coefficient = 0.2",
        "coefficient = 100.0",
        "contacts.rub.friction.coefficient: 100 is unusual for a friction coefficient, usually at most 2; if 100 % is meant, write 1",
    ),
    "stiffness of a contact": (
        "stiffness = 1e13",
        "stiffness = 1e-3",
        "contacts.rub.stiffness: 0.001 N/m³ is unusual for a contact stiffness per area, usually 10000 to 1e+18 N/m³; if 0.001 N/mm³ is meant, write 1e+06",
    ),
}


@pytest.mark.parametrize("oddity", [*WARNINGS.values()], ids=[*WARNINGS])
def test_what_is_probably_not_meant_is_said(oddity: tuple[str, ...]) -> None:
    assert list(st.describe(loads(changed(PLANE, *oddity[:-1]))).warnings) == [oddity[-1]]


def test_meshes_too_coarse_for_the_modes_asked_for() -> None:
    """Said of cases that say something of modes, not of those that are for the time loop alone."""
    coarse = changed(PLANE, "divisions = [4, 2]", "element_size = 1.0")
    assert st.describe(loads(coarse)).warnings == ()
    said = f"bodies.slider: 0.02 m in extent, 3.9 {WAVE}, the default, the longest edge is 0.02 m; {COARSE}"
    assert st.describe(loads(f"{coarse}[modal]\nmodes = 3\n")).warnings == (said,)
    own = st.describe(loads(f"{coarse}[modal]\nmax_frequency_hz = 40e3\n")).warnings
    assert own == (said.replace(", the default", ""),)
    assert st.describe(loads(f"{coarse}[modal]\nmax_frequency_hz = 39e3\n")).warnings == ()


def test_bodies_that_do_not_touch_yet() -> None:
    found = st.describe(loads(changed(PLANE, "corner = [0.02, 0.01]", "corner = [0.02, 0.011]")))
    assert "contact rub is open by 0.001 m or more at the start" in found.lines


# -- valid, but without an answer ----------------------------------------------------------------------------------------

LOOSE = "fix a freedom of the loose body, or turn the load so that it presses the bodies together"


def no_answer(text: str, analysis: str = "steady_sliding") -> str:
    with pytest.raises(AnalysisError) as caught:
        getattr(st, analysis)(loads(text))
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_a_body_that_nothing_holds() -> None:
    message = no_answer(changed(PLANE, GUIDE, ""))
    assert message.startswith("steady sliding has no equilibrium: body slider can move freely")
    assert message.endswith(LOOSE)
    # It flies off in the time loop, which is an answer; `describe` says that it has no steady sliding.
    assert f"  no steady sliding: {message}" in st.describe(loads(changed(PLANE, GUIDE, ""))).lines


def test_loads_that_pull_the_bodies_apart() -> None:
    message = no_answer(changed(PLANE, "pressure = 1e6", "pressure = -1e6"))
    # Which of them depends on how the direct solver meets a singular matrix: without friction, or at its μ.
    free = f"steady sliding has no equilibrium: body slider can move freely under the loads; {LOOSE}"
    assert message in (free, f"steady sliding: {unsettled(5, 60)}", f"steady sliding at μ = 0.2: {unsettled(5, 60)}")


def test_friction_that_jams() -> None:
    # A strut at 45° against the sliding: from μ = 1 on, what friction drives into it presses harder than it holds.
    strut = '[springs.strut]\nbetween = ["slider.tip", "ground"]\ndirection = [1.0, 1.0]\nstiffness = 1e8\n'
    st.steady_sliding(loads(changed(PLANE, GUIDE, strut)))
    for analysis in ("steady_sliding", "modes"):
        message = no_answer(changed(PLANE, GUIDE, strut, "coefficient = 0.2", "coefficient = 3.0"), analysis)
        assert message.startswith("steady sliding has no equilibrium: body slider can move freely")


def test_contacts_that_do_not_slide_or_open() -> None:
    assert no_answer(changed(PLANE, "velocity = { x = 0.1 }\n", "")) == (
        "contact rub does not slide: no support moves one of its bodies along the tangent; give a support a velocity"
    )
    assert no_answer(changed(PLANE, "velocity = { x = 0.1 }", "velocity = { y = 0.1 }")) == (
        "contact rub: the prescribed velocities change its gap at 0.1 m/s, so there is no steady sliding; let the "
        "supports move along the master surface"
    )


def test_rigid_contacts_that_share_slave_nodes() -> None:
    wall = '[bodies.wall]\ntype = "obstacle"\nshape = "flat"\npoint = [0.0, 0.01]\nnormal = [0.0, 1.0]\n\n'
    again = CONTACT.replace("rub", "again").replace("rail.top", "wall")
    text = changed(PLANE, GROUND, wall + GROUND, PHASES, again + PHASES).replace("stiffness = 1e13", 'stiffness = "rigid"')
    text += '[supports.hard]\nat = "rail.top"\nfixed = ["x", "y"]\nvelocity = { x = 0.1 }\n'
    text = changed(text, "normal = [0.0, 1.0]", "normal = [0.0, 1.0]\nsliding = { velocity = [0.1, 0.0] }")
    assert no_answer(text) == (
        "steady sliding: rigid contact presses on the same freedoms twice: 5 of the 10 conditions of rigid contact follow "
        "from the others (contacts.rub, contacts.again, supports.guide, supports.hard), so that their forces cannot be told apart; "
        "give one of these contacts a stiffness, or remove it or a support"
    )


# -- the time loop -------------------------------------------------------------------------------------------------------


def test_a_mass_matrix_that_is_not_diagonal() -> None:
    case = loads(changed(PLANE, SLIDER, f'{SLIDER}\nmass = "consistent"'))
    with pytest.raises(CaseError) as caught:
        st.simulate(case)
    assert str(caught.value) == (
        "bodies: the temporal approach on assembled matrices needs a diagonal mass in every body; write "
        'mass = "lumped" for beams and solids, and import lumped mass matrices'
    )


def test_a_step_beyond_the_limit() -> None:
    case = loads(changed(PLANE, PHASES, f"[temporal]\nstep = 1e-3\n{PHASES}"))
    for analysis in (st.simulate, st.describe):
        with pytest.raises(CaseError) as caught:
            analysis(case)
        assert str(caught.value) == (
            "temporal.step: 0.001 – the explicit scheme is unstable beyond 9.342e-07 s, set by slider; take a smaller "
            'step, coarser elements or mass = "lumped"'
        )


def test_a_run_that_no_memory_holds() -> None:
    case = loads(changed(PLANE, "duration = 2e-5", "duration = 1e90"))
    with pytest.raises(CaseError, match=r"^temporal: '1\.19e\+96 steps, records of .* GB' – at most 1e12 steps") as caught:
        st.simulate(case)
    assert len(caught.value.problems) == 1


def test_a_slave_node_that_leaves_its_master() -> None:
    text = changed(
        PLANE,
        "stiffness = 1e13",
        'stiffness = 1e13\nsliding = "finite"',
        "velocity = { x = 0.1 }",
        "velocity = { x = -2000.0 }",
        "size = [0.06, 0.01]",
        "size = [0.0401, 0.01]",
    )
    with pytest.raises(AnalysisError) as caught:
        st.simulate(loads(text))
    message = str(caught.value)
    assert re.fullmatch(
        r"contact rub: the slave node at \(0\.04, 0\.01\) left the master surface over an edge at t = \S+ s \(phase "
        r"slide\); shorten the phase, slow the support down or make the master larger",
        message,
    )
    before = getattr(caught.value, "trajectory")  # noqa: B009 - only errors of a run have one
    assert 0 < before.steps < before.planned_steps
    assert before.interrupted
    assert np.isfinite(before.normal_force).all()


def test_a_body_that_flies_is_simulated() -> None:
    run = st.simulate(loads(changed(PLANE, GUIDE, "", "pressure = 1e6", "pressure = -1e6")))
    assert run.steps == run.planned_steps


# -- the command line ----------------------------------------------------------------------------------------------------


def test_the_command_line_says_the_same(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text(changed(PLANE, "corner = [0.02, 0.01]", "corner = [0.02, 0.009]"))
    done = stridor("check", "a.toml", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == f"stridor: {CONTACTS['overlap'][-1]}\n"
    (tmp_path / "b.toml").write_text(changed(PLANE, GUIDE, ""))
    done = stridor("modes", "b.toml", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.startswith("stridor: steady sliding has no equilibrium: body slider can move freely")
    assert done.stderr.count("\n") == 1


# -- anything at all -----------------------------------------------------------------------------------------------------

NUMBER = re.compile(r"(?<![\w.])[+-]?\d+\.?\d*(?:[eE][+-]?\d+)?(?![\w.])")
VALUES = (
    *("0", "0.0", "-1", "-1.0", "1e-300", "1e300", "1e12", "1e-12", "nan", "inf", "-inf", "true", '"text"', "[]"),
    *("[1.0]", "[1.0, 2.0]", "{}", "3", "1.5", "7", "360.0", "1e3", "1e-3", "2006-01-01", "1e-320", "1e99", "-1e99"),
)
SIGNS = (*",\"'[]{}=.x0-\n@é\x00",)


def coarse_template() -> str:
    """The pad on a disc with the coarsest meshes that still fit, without comments."""
    text = changed(
        template_text("pad-on-disc"),
        *("[16, 180, 4]", "[2, 12, 1]"),
        *("[14, 30, 4]", "[2, 4, 1]"),
        *("[12, 26, 2]", "[1, 4, 1]"),
    )
    stripped = (line.partition("#")[0].rstrip() for line in text.splitlines())
    return "\n".join(line for line in stripped if line) + "\n"


def mutated(text: str, dice: random.Random) -> str:
    """A text after one to three slips of the kind that editors make."""
    for _ in range(dice.choice([1, 1, 1, 2, 3])):
        kind = dice.randrange(8)
        rows = text.splitlines()
        if kind <= 1:
            place = dice.choice(list(NUMBER.finditer(text)))
            text = text[: place.start()] + dice.choice(VALUES) + text[place.end() :]
        elif kind == 2:
            place = dice.choice(list(NUMBER.finditer(text)))
            value = float(place[0]) * dice.choice([-1, 10, 0.1, 1e3, 1e-3, 2, 1.001, 1e12, 1e-12])
            text = text[: place.start()] + repr(value) + text[place.end() :]
        elif kind == 3:
            rows.pop(dice.randrange(len(rows)))
            text = "\n".join(rows) + "\n"
        elif kind == 4:
            rows.insert(dice.randrange(len(rows)), dice.choice(rows))
            text = "\n".join(rows) + "\n"
        elif kind == 5:
            at = dice.randrange(len(text))
            text = text[:at] + dice.choice(SIGNS) + text[at + 1 :]
        else:
            pattern = r'"[^"\n]*"' if kind == 6 else r"[A-Za-z_]+(?= =)"
            found = list(re.finditer(pattern, text))
            place, other = dice.choice(found), dice.choice(found)
            text = text[: place.start()] + other[0] + text[place.end() :]
    return text


@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # of numbers at the edge of their range
@pytest.mark.parametrize("seeds", [range(100), pytest.param(range(100, 400), marks=pytest.mark.slow)], ids=str)
def test_no_slip_of_an_editor_makes_a_traceback(seeds: range) -> None:
    base = coarse_template()
    assert st.describe(loads(base)).data["degrees_of_freedom"] > 0
    described = 0
    for seed in seeds:
        with contextlib.suppress(StridorError):
            try:
                case = loads(mutated(base, random.Random(seed)))
                build_system(case)
                st.describe(case)
            except (ArithmeticError, AssertionError, AttributeError, LookupError, TypeError, ValueError) as error:
                pytest.fail(f"seed {seed}: {type(error).__name__}: {error}")
            described += 1
    assert described > len(seeds) // 15  # some slips do no harm

"""Broken case files and overrides, each with the exact message that its author gets."""



from __future__ import annotations

from pathlib import Path

import pytest

from stridor.case import load, loads, template_text
from stridor.errors import CaseError

pytestmark = pytest.mark.bad_input

BASE = """
[materials.steel]
young_modulus = 200e9
density = 7800.0

[bodies.pin]
type = "beam"
material = "steel"
start = [0.1, 0.0]
angle_deg = 85.0
length = 0.05
width = 0.01
thickness = 0.0015
elements = 30
points = { tip = 0.0, top = 0.05 }

[bodies.disc]
type = "beam"
material = "steel"
start = [0.0, 0.0]
end = [0.15, 0.0]
width = 0.015
thickness = 0.003
elements = 90

[supports.clamp]
at = "disc.start"
fixed = ["x", "y", "rotation"]
velocity = { x = 0.02 }

[supports.guide]
at = "pin.top"
fixed = ["x", "rotation"]

[loads.press]
at = "pin.top"
force = [0.0, -20.0]

[contacts.A]
slave = "pin.tip"
master = "disc"
stiffness = 1e10
friction = { law = "coulomb", coefficient = 0.1 }

[[phases]]
name = "press"
duration = 0.05
velocities = { clamp = 0.0 }

[[phases]]
name = "slide"
duration = 0.05
velocities = { clamp = 1.0 }
"""

FIRST_PHASE = '[[phases]]\nname = "press"'
BODIES_AND_AFTER = BASE[BASE.index("[bodies.pin]") :]

# what is wrong: (text of the base case, what stands there instead, the message)
FILES = {
    "negative length": (
        "length = 0.05",
        "length = -0.05",
        "bodies.pin.length: -0.05 – must be a number > 0 [m], the length along the axis",
    ),
    "zero width": (
        "width = 0.015",
        "width = 0.0",
        "bodies.disc.width: 0.0 – must be a number > 0 [m], the width out of the plane",
    ),
    "nan": (
        "young_modulus = 200e9",
        "young_modulus = nan",
        "materials.steel.young_modulus: nan – must be a number > 0 [Pa], Young's modulus; it must be finite",
    ),
    "inf": (
        "density = 7800.0",
        "density = inf",
        "materials.steel.density: inf – must be a number > 0 [kg/m³], the density; it must be finite",
    ),
    "bool as number": (
        "thickness = 0.003",
        "thickness = true",
        "bodies.disc.thickness: true – must be a number > 0 [m], the thickness in the plane of bending",
    ),
    "string as number": (
        "thickness = 0.003",
        'thickness = "0.003"',
        "bodies.disc.thickness: '0.003' – must be a number > 0 [m], the thickness in the plane of bending; write it without quotes",
    ),
    "fraction of elements": (
        "elements = 90",
        "elements = 90.5",
        "bodies.disc.elements: 90.5 – must be a whole number from 1 to 100000, the number of elements",
    ),
    "float elements": (
        "elements = 90",
        "elements = 90.0",
        "bodies.disc.elements: 90.0 – must be a whole number from 1 to 100000, the number of elements; write it without a decimal point",
    ),
    "no elements": (
        "elements = 90",
        "elements = 0",
        "bodies.disc.elements: 0 – must be a whole number from 1 to 100000, the number of elements",
    ),
    "too many elements": (
        "elements = 90",
        "elements = 100001",
        "bodies.disc.elements: 100001 – must be a whole number from 1 to 100000, the number of elements",
    ),
    "poisson": (
        "density = 7800.0",
        "density = 7800.0\npoisson_ratio = 0.5",
        "materials.steel.poisson_ratio: 0.5 – must be a number between -1 and 0.5, Poisson's ratio",
    ),
    "start of three": (
        "start = [0.1, 0.0]",
        "start = [0.1, 0.0, 0.0]",
        "bodies.pin.start: [0.1, 0.0, 0.0] – must be [x, y], two numbers [m]: where the beam starts",
    ),
    "start of one": (
        "start = [0.1, 0.0]",
        "start = [0.1]",
        "bodies.pin.start: [0.1] – must be [x, y], two numbers [m]: where the beam starts",
    ),
    "start with text": (
        "start = [0.1, 0.0]",
        'start = ["0.1", 0.0]',
        "bodies.pin.start: ['0.1', 0.0] – must be [x, y], two numbers [m]: where the beam starts",
    ),
    "start a number": (
        "start = [0.1, 0.0]",
        "start = 0.1",
        "bodies.pin.start: 0.1 – must be [x, y], two numbers [m]: where the beam starts",
    ),
    "body type": (
        'type = "beam"\nmaterial = "steel"\nstart = [0.1',
        'type = "baem"\nmaterial = "steel"\nstart = [0.1',
        "bodies.pin.type: 'baem' – must be \"beam\", \"solid\", \"matrices\", \"mass\" or \"obstacle\", the type of the body; did you mean 'beam'?",
    ),
    "no body type": (
        'type = "beam"\nmaterial = "steel"\nstart = [0.1',
        'material = "steel"\nstart = [0.1',
        'bodies.pin.type: missing – give "beam", "solid", "matrices", "mass" or "obstacle", the type of the body',
    ),
    "mass matrix": (
        "elements = 90",
        'elements = 90\nmass = "lumpd"',
        "bodies.disc.mass: 'lumpd' – must be \"consistent\" or \"lumped\" (HRZ), the mass matrix; did you mean 'lumped'?",
    ),
    "damping": (
        "elements = 90",
        "elements = 90\ndamping = { mass = -1.0 }",
        "bodies.disc.damping.mass: -1.0 – must be a number >= 0 [1/s], Rayleigh's factor of the mass matrix",
    ),
    "damping a number": (
        "elements = 90",
        "elements = 90\ndamping = 0.01",
        "bodies.disc.damping: 0.01 – must be a table with the keys mass, stiffness",
    ),
    "material date": (
        'material = "steel"\nstart = [0.1',
        "material = 2006-01-01\nstart = [0.1",
        "bodies.pin.material: 2006-01-01 – must be the NAME of a [materials.NAME]",
    ),
    "fixed empty": (
        'fixed = ["x", "rotation"]',
        "fixed = []",
        'supports.guide.fixed: [] – must be a list of "x", "y", "z" and "rotation", at least one: the directions held',
    ),
    "fixed direction": (
        'fixed = ["x", "rotation"]',
        'fixed = ["x", "z"]',
        'supports.guide.fixed: \'z\' – pin moves along x, y, rotation only',
    ),
    "fixed twice": (
        'fixed = ["x", "rotation"]',
        'fixed = ["x", "x"]',
        "supports.guide.fixed: ['x', 'x'] – must name each direction once",
    ),
    "velocity key": (
        "velocity = { x = 0.02 }",
        "velocity = { z = 0.02 }",
        "supports.clamp.velocity.z: 0.02 – a velocity needs 'z' in fixed, which has: x, y, rotation",
    ),
    "stiffness word": (
        "stiffness = 1e10",
        'stiffness = "rigit"',
        "contacts.A.stiffness: 'rigit' – must be a number > 0 [N/m], between boundaries per area [N/m³], or \"rigid\", the normal stiffness; did you mean 'rigid'?",
    ),
    "stiffness number in quotes": (
        "stiffness = 1e10",
        'stiffness = "1e10"',
        "contacts.A.stiffness: '1e10' – must be a number > 0 [N/m], between boundaries per area [N/m³], or \"rigid\", the normal stiffness; write it without quotes",
    ),
    "stiffness zero": (
        "stiffness = 1e10",
        "stiffness = 0",
        'contacts.A.stiffness: 0 – must be a number > 0 [N/m], between boundaries per area [N/m³], or "rigid", the normal stiffness',
    ),
    "side": (
        'master = "disc"',
        'master = "disc"\nside = "top"',
        'contacts.A.side: \'top\' – must be "left" or "right", the side of a beam\'s direction on which the slave lies',
    ),
    "sliding": (
        'master = "disc"',
        'master = "disc"\nsliding = "big"',
        'contacts.A.sliding: \'big\' – must be "small" (the slave stays where it is on the master) or "finite"',
    ),
    "friction negative": (
        "coefficient = 0.1",
        "coefficient = -0.1",
        "contacts.A.friction.coefficient: -0.1 – must be a number >= 0, the friction coefficient while sliding",
    ),
    "weight at a place": (
        "[loads.press]\n",
        "[loads.press]\ngravity = [0.0, -9.81, 0.0]\nbodies = ['pin', 'pinn']\n",
        [
            "loads.press.at: 'pin.top' – gravity and centrifugal act on whole bodies; make it another load",
            "loads.press.force: [0.0, -20.0] – gravity and centrifugal act on whole bodies; make it another load",
            "loads.press.bodies: ['pin', 'pinn'] – no such body; did you mean 'pin'? the case has: pin, disc",
            "loads.press.gravity: [0.0, -9.81, 0.0] – must have 2 numbers, as pin lives in 2 dimensions",
        ],
    ),
    "turning without bodies": (
        '[loads.press]\nat = "pin.top"',
        "[loads.spin]\ncentrifugal = { speed = 3.0, axis = [1, 0, 0] }\n[loads.press]",
        [
            "loads.spin.bodies: missing – give a list of the bodies that turn",
            "loads.spin.centrifugal.axis: [1.0, 0.0, 0.0] – in the plane bodies turn about z; leave it out",
            'loads.press.at: missing – give a point, "body.point" or "body@distance", or a boundary, "body.boundary"',
        ],
    ),
    "bodies of a force": (
        '[loads.press]\n',
        '[loads.press]\nbodies = ["pin"]\n',
        "loads.press.bodies: ['pin'] – only used with gravity or centrifugal",
    ),
    "displacement of what is free": (
        'fixed = ["x", "rotation"]',
        'fixed = ["x", "rotation"]\ndisplacement = { y = 1e-5 }',
        "supports.guide.displacement.y: 1e-05 – a displacement needs 'y' in fixed, which has: x, rotation",
    ),
    "interference that slides far": (
        'stiffness = 1e10\nfriction',
        'stiffness = 1e10\nsliding = "finite"\ninterference = 1e-6\nfriction',
        "contacts.A.interference: 1e-06 – needs sliding = \"small\": finite sliding finds the gaps anew from the places of the nodes",
    ),
    "friction law": (
        'law = "coulomb"',
        'law = "coloumb"',
        'contacts.A.friction.law: \'coloumb\' – must be "coulomb", "static-kinetic", "weakening", "hyperbolic" or "table", the law of friction; did you mean \'coulomb\'?',
    ),
    "friction no law": (
        'law = "coulomb", ',
        "",
        'contacts.A.friction.law: missing – give "coulomb", "static-kinetic", "weakening", "hyperbolic" or "table", the law of friction',
    ),
    "friction number": (
        'friction = { law = "coulomb", coefficient = 0.1 }',
        "friction = 0.1",
        'contacts.A.friction: 0.1 – must be a table such as { law = "coulomb", coefficient = 0.1 }',
    ),
    "friction key of another law": (
        "coefficient = 0.1 }",
        "coefficient = 0.1, decay_speed = 0.05 }",
        "contacts.A.friction.decay_speed: 0.05 – not used by 'coulomb'; accepted: law, coefficient",
    ),
    "friction weakening incomplete": (
        'law = "coulomb"',
        'law = "weakening"',
        [
            "contacts.A.friction.static_coefficient: missing – give a number >= coefficient, the friction coefficient to overcome before sliding",
            "contacts.A.friction.decay_speed: missing – give a number > 0 [m/s], the slip speed over which friction weakens",
        ],
    ),
    "friction static below": (
        'law = "coulomb", coefficient = 0.1',
        'law = "static-kinetic", coefficient = 0.3, static_coefficient = 0.2',
        "contacts.A.friction.static_coefficient: 0.2 – must be at least the coefficient, 0.3",
    ),
    "friction table short": (
        'law = "coulomb", coefficient = 0.1',
        'law = "table", speeds = [0.0], coefficients = [0.1, 0.2]',
        "contacts.A.friction.speeds: [0.0] – must be a list of 2 to 1000 rising numbers >= 0 [m/s], slip speeds",
    ),
    "friction table falls back": (
        'law = "coulomb", coefficient = 0.1',
        'law = "table", speeds = [0.0, 0.2, 0.2], coefficients = [0.3, 0.2], static_coefficient = 0.1',
        [
            "contacts.A.friction.speeds: [0.0, 0.2, 0.2] – must rise from one to the next; 0.2 follows 0.2",
            "contacts.A.friction.coefficients: [0.3, 0.2] – must be as many as speeds, 3, not 2",
            "contacts.A.friction.static_coefficient: 0.1 – must be at least the first of coefficients, that at rest, 0.3",
        ],
    ),
    "friction hyperbolic": (
        'law = "coulomb", coefficient = 0.1',
        'law = "hyperbolic", coefficient = 0.1, static_coefficient = 0.05, delta = 1.0',
        "contacts.A.friction.static_coefficient: 0.05 – must be at least the coefficient, 0.1",
    ),
    "friction decay zero": (
        'law = "coulomb", coefficient = 0.1',
        'law = "weakening", coefficient = 0.1, static_coefficient = 0.2, decay_speed = 0',
        "contacts.A.friction.decay_speed: 0 – must be a number > 0 [m/s], the slip speed over which friction weakens",
    ),
    "duration": (
        'name = "slide"\nduration = 0.05',
        'name = "slide"\nduration = 0',
        "phases.1.duration: 0 – must be a number > 0 [s], how long the phase lasts",
    ),
    "phases a table": (
        '[[phases]]\nname = "press"\nduration = 0.05\nvelocities = { clamp = 0.0 }\n\n[[phases]]\nname = "slide"\nduration = 0.05\nvelocities = { clamp = 1.0 }\n',
        '[phases]\nname = "slide"\n',
        "phases: { name = 'slide' } – must be a list of tables [[phases]]",
    ),
    "phase name": (
        'name = "slide"',
        'name = ""',
        "phases.1.name: '' – must be a text that is not empty, the name of the phase",
    ),
    "modes": (
        FIRST_PHASE,
        "[modal]\nmodes = 0\n" + FIRST_PHASE,
        "modal.modes: 0 – must be a whole number >= 1, how many branches are listed",
    ),
    "damped": (
        FIRST_PHASE,
        '[modal]\ndamped = "yes"\n' + FIRST_PHASE,
        "modal.damped: 'yes' – must be true or false, with or without damping",
    ),
    "range negative": (
        FIRST_PHASE,
        "[modal]\nfriction_range = [-0.1, 1.0]\n" + FIRST_PHASE,
        "modal.friction_range: [-0.1, 1.0] – must be [a, b] with 0 <= a < b, where onsets are sought",
    ),
    "beta2": (
        FIRST_PHASE,
        "[temporal]\nbeta2 = 0.4\n" + FIRST_PHASE,
        "temporal.beta2: 0.4 – must be a number from 0.5 to 1, the scheme's numerical damping",
    ),
    "step": (
        FIRST_PHASE,
        "[temporal]\nstep = 0.0\n" + FIRST_PHASE,
        "temporal.step: 0.0 – must be a number > 0 [s], the time step (left out: a safe part of the stability limit)",
    ),
    "mu": (
        FIRST_PHASE,
        "[comparison]\nmu = [0.1, -0.1]\n" + FIRST_PHASE,
        "comparison.mu: [0.1, -0.1] – must be a list of numbers >= 0, friction coefficients (left out or empty: the case's own)",
    ),
    "mu number": (
        FIRST_PHASE,
        "[comparison]\nmu = 0.1\n" + FIRST_PHASE,
        "comparison.mu: 0.1 – must be a list of numbers >= 0, friction coefficients (left out or empty: the case's own)",
    ),
    "reference": (
        FIRST_PHASE,
        '[reference]\nonsets = [{ frequency_hz = 100.0, mu = 0.1 }, { frequency_hz = "100" }]\n'
        + FIRST_PHASE,
        [
            "reference.onsets.1.frequency_hz: '100' – must be a number >= 0 [Hz], the frequency; write it without quotes",
            "reference.onsets.1.mu: missing – give a number >= 0, the critical friction coefficient",
        ],
    ),
    "misspelt": (
        "friction = {",
        "frictoin = {",
        "contacts.A.frictoin: unknown key; did you mean 'friction'? accepted: slave, master, stiffness, cubic, sliding, side, adjust, interference, closed, friction",
    ),
    "unknown section": (
        "[materials.steel]",
        "[mesh]\nsize = 1\n[materials.steel]",
        "mesh: unknown key; accepted: title, units, parameters, materials, bodies, supports, loads, contacts, ties, springs, dashpots, phases, steady, modal, temporal, comparison, reference",
    ),
    "misspelt section": (
        "[contacts.A]",
        "[contact.A]",
        "contact: unknown key; did you mean 'contacts'? accepted: title, units, parameters, materials, bodies, supports, loads, contacts, ties, springs, dashpots, phases, steady, modal, temporal, comparison, reference",
    ),
    "missing": (
        "width = 0.01\n",
        "",
        "bodies.pin.width: missing – give a number > 0 [m], the width out of the plane",
    ),
    "missing slave": (
        'slave = "pin.tip"\n',
        "",
        'contacts.A.slave: missing – give a point, "body.point" or "body@distance", or a boundary, "body.boundary"',
    ),
    "bad name": (
        "[loads.press]",
        '[loads."press it"]',
        'loads."press it": not a name; a name is a letter, then letters, digits, _ or -',
    ),
    "bad name digit": (
        "[loads.press]",
        "[loads.1st]",
        "loads.1st: not a name; a name is a letter, then letters, digits, _ or -",
    ),
    "no bodies": (BODIES_AND_AFTER, "", "bodies: missing – give tables [bodies.NAME], at least one"),
    "empty bodies": (BODIES_AND_AFTER, "[bodies]", "bodies: {} – must be tables [bodies.NAME], at least one"),
    "bodies that are a number": (
        BASE,
        "bodies = 3\n",
        "bodies: 3 – must be tables [bodies.NAME], at least one",
    ),
    "no material": (
        'material = "steel"\nstart = [0.1',
        'material = "steal"\nstart = [0.1',
        "bodies.pin.material: 'steal' – no such material; did you mean 'steel'? the case has: steel",
    ),
    "no length": (
        "length = 0.05\n",
        "",
        "bodies.pin.length: missing – give a number [m], or only end = [x, y] [m]",
    ),
    "no axis": (
        "end = [0.15, 0.0]\n",
        "",
        "bodies.disc: has no direction – give angle_deg [degrees] and length [m], or end = [x, y] [m]",
    ),
    "both axes": (
        "length = 0.05",
        "length = 0.05\nend = [0.1, 0.05]",
        [
            "bodies.pin.angle_deg: 85.0 – not used with end; give end, or angle_deg and length",
            "bodies.pin.length: 0.05 – not used with end; give end, or angle_deg and length",
        ],
    ),
    "no extent": (
        "end = [0.15, 0.0]",
        "end = [0.0, 0.0]",
        "bodies.disc.end: [0.0, 0.0] – must not be the start",
    ),
    "point off": (
        "top = 0.05",
        "top = 0.06",
        "bodies.pin.points.top: 0.06 – beyond the body; pin reaches from 0 to 0.05 m",
    ),
    "point redefined": (
        "top = 0.05",
        "top = 0.05, end = 0.04",
        "bodies.pin.points.end: 0.04 – start and end always exist; choose another name",
    ),
    "no point": (
        'slave = "pin.tip"',
        'slave = "pin.tipp"',
        "contacts.A.slave: 'pin.tipp' – no such point; did you mean 'tip'? pin has: start, tip, top, end",
    ),
    "no body": (
        'slave = "pin.tip"',
        'slave = "pinn.tip"',
        "contacts.A.slave: 'pinn.tip' – no such body; did you mean 'pin'? the case has: pin, disc",
    ),
    "not a point": (
        'slave = "pin.tip"',
        'slave = "pin"',
        'contacts.A.slave: \'pin\' – must be a point, "body.point" or "body@distance", such as pin.start',
    ),
    "off body": (
        'slave = "pin.tip"',
        'slave = "pin@0.051"',
        "contacts.A.slave: 'pin@0.051' – beyond the body; pin reaches from 0 to 0.05 m",
    ),
    "distance": (
        'slave = "pin.tip"',
        'slave = "pin@tip"',
        "contacts.A.slave: 'pin@tip' – the part after @ must be a distance [m] from pin.start",
    ),
    "no master": (
        'master = "disc"',
        'master = "disk"',
        "contacts.A.master: 'disk' – no such body; did you mean 'disc'? the case has: pin, disc",
    ),
    "own master": (
        'master = "disc"',
        'master = "pin"',
        "contacts.A.master: 'pin' – must be another body than the slave's",
    ),
    "coarse master": (
        "elements = 90",
        "elements = 2",
        "contacts.A.master: 'disc' – a master needs at least 3 elements; disc has 2",
    ),
    "beyond": (
        "start = [0.1, 0.0]",
        "start = [0.2, 0.0]",
        "contacts.A.slave: 'pin.tip' – lies beyond the ends of disc: at 0.2 m along it, which reaches from 0 to 0.15 m; move one of the bodies",
    ),
    "collinear": (
        "angle_deg = 85.0",
        "angle_deg = 180.0",
        'contacts.A.side: missing – pin lies on the line of disc; give "left" or "right" of it',
    ),
    "no node": (
        'at = "disc.start"',
        'at = "disc@0.033"',
        "supports.clamp.at: 'disc@0.033' – no mesh node at 0.033 m; the nearest are at 0.0316666666667 and 0.0333333333333 m: move the support or change bodies.disc.elements",
    ),
    "velocity not fixed": (
        'fixed = ["x", "y", "rotation"]',
        'fixed = ["y", "rotation"]',
        "supports.clamp.velocity.x: 0.02 – a velocity needs 'x' in fixed, which has: y, rotation",
    ),
    "fixed by two": (
        '[supports.guide]\nat = "pin.top"',
        '[supports.guide]\nat = "disc@0"',
        [
            "supports.guide.fixed: ['x', 'rotation'] – x of this point is already fixed by supports.clamp",
            "supports.guide.fixed: ['x', 'rotation'] – rotation of this point is already fixed by supports.clamp",
        ],
    ),
    "load point": (
        '[loads.press]\nat = "pin.top"',
        '[loads.press]\nat = "pin.topp"',
        "loads.press.at: 'pin.topp' – no such point; did you mean 'top'? pin has: start, tip, top, end",
    ),
    "phase load": (
        "velocities = { clamp = 1.0 }",
        "loads = { pres = 1.0 }",
        "phases.1.loads.pres: 1.0 – no such load; did you mean 'press'? the case has: press",
    ),
    "phase velocity": (
        "velocities = { clamp = 1.0 }",
        "velocities = { clmp = 1.0 }",
        "phases.1.velocities.clmp: 1.0 – no such support with a velocity; did you mean 'clamp'? the case has: clamp",
    ),
    "phase fixed": (
        "velocities = { clamp = 1.0 }",
        "velocities = { guide = 1.0 }",
        "phases.1.velocities.guide: 1.0 – supports.guide has no velocity",
    ),
    "ramp": (
        "velocities = { clamp = 1.0 }",
        "ramp = 0.06",
        "phases.1.ramp: 0.06 – must not be longer than the phase, 0.05 s",
    ),
    "phase twice": (
        'name = "slide"',
        'name = "press"',
        "phases.1.name: 'press' – another phase has this name",
    ),
    "range": (
        FIRST_PHASE,
        "[modal]\nfriction_range = [0.5, 0.5]\n" + FIRST_PHASE,
        "modal.friction_range: [0.5, 0.5] – the first number must be below the second",
    ),
    "bracket": (
        FIRST_PHASE,
        "[comparison]\nbracket = [0.2, 0.1]\n" + FIRST_PHASE,
        "comparison.bracket: [0.2, 0.1] – the first number must be below the second",
    ),
    "perturbation": (
        FIRST_PHASE,
        "[temporal]\nperturbation = 1e-6\n" + FIRST_PHASE,
        'temporal.perturbation: 1e-06 – needs initial = "steady-sliding"',
    ),
    "watch": (
        FIRST_PHASE,
        '[temporal]\nwatch = ["pin.tip", "disc@0.2"]\n' + FIRST_PHASE,
        "temporal.watch.1: 'disc@0.2' – beyond the body; disc reaches from 0 to 0.15 m",
    ),
    "reference body": (
        FIRST_PHASE,
        "[reference]\nbodies.beam = []\n" + FIRST_PHASE,
        "reference.bodies.beam: no such body; the case has: pin, disc",
    ),
    "syntax": (
        "density = 7800.0",
        "density = ",
        "case.toml, line 4, column 11: not valid TOML: invalid value",
    ),
    "duplicate": (
        "density = 7800.0",
        "density = 7800.0\ndensity = 1.0",
        "case.toml, line 5, column 14: not valid TOML: cannot overwrite a value",
    ),
    "duplicate table": (
        "[supports.guide]",
        "[supports.clamp]",
        "case.toml, line 31, column 16: not valid TOML: cannot declare [supports.clamp] twice",
    ),
    "unclosed": (
        "velocities = { clamp = 1.0 }",
        "velocities = { clamp = 1.0",
        "case.toml, line 53, column 27: not valid TOML: unclosed inline table",
    ),
    "leading zero": (
        "density = 7800.0",
        "density = 07800.0",
        "case.toml, line 4, column 12: not valid TOML: expected newline or end of document after a statement",
    ),
    "huge": (
        "density = 7800.0",
        "density = 10000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000",
        "materials.steel.density: 10000000000000000000000000000000000000000000000000000000000… – must be a number > 0 [kg/m³], the density",
    ),
    "misspelt section of names": (
        "[materials.steel]",
        "[material.steel]",
        "material: unknown key; did you mean 'materials'? accepted: title, units, parameters, materials, bodies, supports, loads, contacts, ties, springs, dashpots, phases, steady, modal, temporal, comparison, reference",
    ),
    "table entry that is a number": (
        "[loads.press]",
        "[loads]\npull = 3\n[loads.press]",
        "loads.pull: 3 – must be a table with the keys at, force, moment, pressure, gravity, centrifugal, bodies",
    ),
    "title": ("[materials.steel]", "title = 3\n[materials.steel]", "title: 3 – must be a text"),
    "point name": (
        "points = { tip = 0.0, top = 0.05 }",
        'points = { "the tip" = 0.0, top = 0.05 }',
        'bodies.pin.points."the tip": not a name; a name is a letter, then letters, digits, _ or -',
    ),
    "factor in quotes": (
        "velocities = { clamp = 1.0 }",
        'velocities = { clamp = "1.0" }',
        "phases.1.velocities.clamp: '1.0' – must be a number, the factor of the support's velocity in this phase; write it without quotes",
    ),
    "factors that are a number": (
        "velocities = { clamp = 1.0 }",
        "velocities = 1.0",
        "phases.1.velocities: 1.0 – must be a table of supports, each a number, the factor of the support's velocity in this phase",
    ),
    "velocity that is not finite": (
        "velocity = { x = 0.02 }",
        "velocity = { x = inf }",
        "supports.clamp.velocity.x: inf – must be a number, x, y, z [m/s], rotation [rad/s]; it must be finite",
    ),
    "point distance text": (
        "points = { tip = 0.0, top = 0.05 }",
        'points = { tip = "start", top = 0.05 }',
        "bodies.pin.points.tip: 'start' – must be a number >= 0 [m], the distance along the axis",
    ),
}

# override: message
OVERRIDES = {
    "contacts.A.friction.coefficient": "override: 'contacts.A.friction.coefficient' – write an override as path=value, such as contacts.A.friction.coefficient=0.3",
    "=1": "override: '=1' – write an override as path=value, such as contacts.A.friction.coefficient=0.3",
    "contacts.A.friction.coefficient=": "contacts.A.friction.coefficient: no value given; write an override as path=value, such as contacts.A.friction.coefficient=0.3",
    "contacts..A=1": "override: 'contacts..A' – write an override as path=value, such as contacts.A.friction.coefficient=0.3",
    "contacts.B.friction.coefficient=0.3": "contacts.B: no such contact; the case has: A",
    "contacts.A.friction.coeficient=0.3": "contacts.A.friction.coeficient: unknown key; did you mean 'coefficient'? accepted: law, coefficient",
    "phases.2.duration=1": "phases.2: no such item; the list has: 0 (press), 1 (slide)",
    "phases.slid.duration=1": "phases.slid: no such item; did you mean 'slide'? the list has: 0 (press), 1 (slide)",
    "bodies.pin.length.x=1": "bodies.pin.length.x: bodies.pin.length is 0.05, not a table",
    "contcts.A.stiffness=1": "contcts: unknown key; did you mean 'contacts'? accepted: title, units, parameters, materials, bodies, supports, loads, contacts, ties, springs, dashpots, phases, steady, modal, temporal, comparison, reference",
    "contacts.A.friction.coefficient=.3": "contacts.A.friction.coefficient: '.3' – not a value; accepted: a number such as 0.3, true, false, a word, \"a text\", [a, list], { a = table }",
    "contacts.A.friction.coefficient=0,3": "contacts.A.friction.coefficient: '0,3' – not a value; accepted: a number such as 0.3, true, false, a word, \"a text\", [a, list], { a = table }",
    "contacts.A.friction.coefficient=high": "contacts.A.friction.coefficient: 'high' – must be a number >= 0, the friction coefficient while sliding",
    "contacts.A.slave=pin.topp": "contacts.A.slave: 'pin.topp' – no such point; did you mean 'top'? pin has: start, tip, top, end",
    "modal.modes=ten": "modal.modes: 'ten' – must be a whole number >= 1, how many branches are listed",
    "contacts.A.friction.law=weakening": [
        "contacts.A.friction.static_coefficient: missing – give a number >= coefficient, the friction coefficient to overcome before sliding",
        "contacts.A.friction.decay_speed: missing – give a number > 0 [m/s], the slip speed over which friction weakens",
    ],
    "bodies.pin.points.mid=0.7": "bodies.pin.points.mid: 0.7 – beyond the body; pin reaches from 0 to 0.05 m",
    "contacts.A.stiffness=1\nx=2": "contacts.A.stiffness: '1\\nx=2' – not a value; accepted: a number such as 0.3, true, false, a word, \"a text\", [a, list], { a = table }",
    "contacts.A.friction.coefficient=nan": "contacts.A.friction.coefficient: nan – must be a number >= 0, the friction coefficient while sliding; it must be finite",
    "materials.steel.young_modulus=-1": "materials.steel.young_modulus: -1 – must be a number > 0 [Pa], Young's modulus",
    "phases.0=3": "phases.0: 3 – must be a table with the keys name, duration, loads, velocities, displacements, ramp",
    "loads.press.force.0=up": "loads.press.force: ['up', -20.0] – must be [x, y] or [x, y, z], numbers [N]: the force, on a boundary spread evenly",
    "loads.press.force.2=1": "loads.press.force.2: no such item; the list has: 0, 1",
}

ALL_AT_ONCE = [
    "materials.steel.young_modulus: -1 – must be a number > 0 [Pa], Young's modulus",
    "bodies.disc.widht: unknown key; did you mean 'width'? accepted: type, material, start, angle_deg, length, end, width, thickness, elements, mass, damping, points",
    "loads.press.at: 'pin.topp' – no such point; did you mean 'top'? pin has: start, tip, top, end",
    "contacts.A.master: 'disk' – no such body; did you mean 'disc'? the case has: pin, disc",
    "phases.1.loads.pres: 2.0 – no such load; did you mean 'press'? the case has: press",
]

BROKEN_BODY = [
    "bodies.pin.elements: '30' – must be a whole number from 1 to 100000, the number of elements; write it without quotes",
    "supports.clamp.at: 'disc.begin' – no such point; disc has: start, end",
]


def message_of(text: str, overrides: list[str] | None = None) -> list[str]:
    with pytest.raises(CaseError) as caught:
        loads(text, overrides or [], "case.toml")
    return str(caught.value).split("\n")


def lines(message: str | list[str]) -> list[str]:
    return [message] if isinstance(message, str) else message


def test_base_case_is_sound():
    assert loads(BASE).warnings == []


@pytest.mark.parametrize(("there", "instead", "message"), FILES.values(), ids=FILES.keys())
def test_broken_file(there: str, instead: str, message: str | list[str]):
    assert BASE.count(there) == 1
    assert message_of(BASE.replace(there, instead)) == lines(message)


@pytest.mark.parametrize(("override", "message"), OVERRIDES.items(), ids=OVERRIDES.keys())
def test_broken_override(override: str, message: str | list[str]):
    assert message_of(BASE, [override]) == lines(message)


def test_every_problem_is_told_at_once_in_the_order_of_the_schema():
    text = BASE
    for there, instead in (
        ("young_modulus = 200e9", "young_modulus = -1"),
        ('master = "disc"', 'master = "disk"'),
        ("width = 0.015", "widht = 0.015"),
        ('at = "pin.top"\nforce', 'at = "pin.topp"\nforce'),
        ("velocities = { clamp = 1.0 }", "loads = { pres = 2 }"),
    ):
        assert text.count(there) == 1
        text = text.replace(there, instead)
    assert message_of(text) == ALL_AT_ONCE


def test_a_broken_body_is_not_blamed_on_those_who_name_it():
    text = BASE.replace("elements = 30", 'elements = "30"').replace('"pin.tip"', '"pin.tipp"')
    assert message_of(text.replace('"disc.start"', '"disc.begin"')) == BROKEN_BODY


def test_all_overrides_that_lead_nowhere_are_told():
    assert message_of(BASE, ["contacts.B.stiffness=1", "phases.7.ramp=0", "nothing"]) == [
        "contacts.B: no such contact; the case has: A",
        "phases.7: no such item; the list has: 0 (press), 1 (slide)",
        "override: 'nothing' – write an override as path=value, such as contacts.A.friction.coefficient=0.3",
    ]


FILE_FAULTS = {
    "empty": (b"", "{path}: empty; a case needs at least one table [bodies.NAME]"),
    "comments only": (b"# nothing yet\n", "{path}: empty; a case needs at least one table [bodies.NAME]"),
    "latin-1": (
        "title = 'frein à disque'".encode("latin-1"),
        "{path}: not UTF-8 text (byte 15); save the file as UTF-8",
    ),
    "utf-16": (
        "title = 'disc'".encode("utf-16"),
        "{path}: text of UTF-16, two bytes a character, as some shells write it; save the file as UTF-8",
    ),
    "binary": (b"\x00\x01", "{path}, line 1, column 1: not valid TOML: invalid statement"),
    "nested": (b"a = " + b"[" * 100_000, "{path}: not valid TOML: nested too deeply"),
}


@pytest.mark.parametrize(("content", "message"), FILE_FAULTS.values(), ids=FILE_FAULTS.keys())
def test_unreadable_file(tmp_path: Path, content: bytes, message: str):
    path = tmp_path / "case.toml"
    path.write_bytes(content)
    with pytest.raises(CaseError) as caught:
        load(path)
    assert str(caught.value) == message.format(path=path)


def test_no_file_and_directory(tmp_path: Path):
    with pytest.raises(CaseError) as caught:
        load(tmp_path / "case.toml")
    assert str(caught.value) == f"{tmp_path / 'case.toml'}: no such file"
    with pytest.raises(CaseError) as caught:
        load(tmp_path)
    assert str(caught.value) == f"{tmp_path}: is a directory; give the path of a case file"
    with pytest.raises(CaseError, match="cannot be read: "):
        load("nul\0byte.toml")


def test_no_template():
    with pytest.raises(CaseError) as caught:
        template_text("two-beam")
    assert str(caught.value) == (
        "template: 'two-beam' – no such template; did you mean 'two-beams'? there are: pad-on-disc, two-beams"
    )


def test_calls_on_a_case():
    case = loads(BASE)
    for call, message in (
        (
            lambda: case.point("pin.middle"),
            "point: 'pin.middle' – no such point; pin has: start, tip, top, end",
        ),
        (
            lambda: case.point("disc@-0.1"),
            "point: 'disc@-0.1' – beyond the body; disc reaches from 0 to 0.15 m",
        ),
        (
            lambda: case.point("disc@nan"),
            "point: 'disc@nan' – beyond the body; disc reaches from 0 to 0.15 m",
        ),
        (
            lambda: case.with_({"bodies.disc.elements": 2}),
            "contacts.A.master: 'disc' – a master needs at least 3 elements; disc has 2",
        ),
        (
            lambda: case.with_({"bodies.disc.width": None}),
            "bodies.disc.width: missing – give a number > 0 [m], the width out of the plane",
        ),
        (
            lambda: case.with_({"bodies..width": 1.0}),
            "override: 'bodies..width' – write an override as path=value, such as contacts.A.friction.coefficient=0.3",
        ),
    ):
        with pytest.raises(CaseError) as caught:
            call()
        assert str(caught.value) == message


def test_no_message_speaks_of_the_machinery():
    everything = [line for *_, message in FILES.values() for line in lines(message)]
    everything += [line for message in OVERRIDES.values() for line in lines(message)]
    for word in ("Input should", "pydantic", "type=", "http", "Traceback", "constrained", "[key]"):
        assert not [line for line in everything if word in line]

"""Supports pressed away and overlaps pressed out: bars between walls, a press fit, beams; statics, modes and time."""

from __future__ import annotations

import numpy as np
import pytest

import stridor as st
from stridor.case import loads
from stridor.sliding import steady_sliding
from stridor.sliding.stretches import stretches_along
from stridor.temporal.energy import energy_balance

pytestmark = pytest.mark.verification

# A bar of 0.2 m × 0.02 m × 0.01 m between a wall on the left and a support on the right.
BAR = """
materials.steel = {{ young_modulus = 200e9, density = 7800.0, poisson_ratio = 0.0 }}
[bodies.bar]
type = "solid"
model = "plane stress"
material = "steel"
thickness = 0.01
damping = {{ mass = 2e4 }}
mesh = {{ shape = "rectangle", corner = [0.0, 0.0], size = [0.2, 0.02], divisions = [10, 1], cells = "{cells}" }}
points = {{ middle = [0.1, 0.0] }}
[bodies.wall]
type = "obstacle"
shape = "flat"
point = [0.0, 0.0]
normal = [1.0, 0.0]
sliding = {{ velocity = [0.0, 1.0] }}
[supports.jaw]
at = "bar.right"
fixed = ["x", "y"]
{jaw}
[contacts.face]
slave = "bar.left"
master = "wall"
stiffness = {stiffness}
{face}
friction = {{ law = "coulomb", coefficient = 0.0 }}
[modal]
max_frequency_hz = 40e3
[temporal]
initial = "{initial}"
watch = ["bar.middle"]
[[phases]]
name = "press"
duration = 2e-3
ramp = {ramp}
"""
JAW, FACE = "displacement = { x = -1e-5 }", "interference = 1e-5"
FORCE = 200e9 * 0.02 * 0.01 / 0.2 * 1e-5


def bar(*, jaw="", face="", cells="quad8", stiffness='"rigid"', initial="rest", ramp=0.0):
    return loads(BAR.format(jaw=jaw, face=face, cells=cells, stiffness=stiffness, initial=initial, ramp=ramp))


@pytest.mark.parametrize("cells", ["quad", "quad8"])
@pytest.mark.parametrize(("jaw", "face"), [(JAW, ""), ("", FACE), ("displacement = { x = -5e-6 }", "interference = 5e-6")])
def test_shortened_bar_presses_on_the_wall(jaw, face, cells):
    """N = E A δ/L, whichever end gives way; with a contact stiffness k per area 1/k is added to L/E."""
    steady = st.steady_sliding(bar(jaw=jaw, face=face, cells=cells))
    assert steady.normal_force.sum() == pytest.approx(FORCE, rel=1e-9)
    soft = st.steady_sliding(bar(jaw=jaw, face=face, cells=cells, stiffness="1e12"))
    assert soft.normal_force.sum() == pytest.approx(FORCE / (1 + 200e9 / (0.2 * 1e12)), rel=1e-9)


def test_displacement_is_that_of_the_shortened_bar():
    """Of all of it: half of the distance in the middle."""
    case = bar(jaw=JAW)
    u = st.build_system(case).points["bar.middle"].free @ st.steady_sliding(case).displacement
    assert u == pytest.approx([-5e-6, 0.0], abs=1e-15)


@pytest.mark.parametrize(("jaw", "face"), [(JAW, ""), ("", FACE)])
@pytest.mark.parametrize("stiffness", ['"rigid"', "1e12"])
def test_run_ends_in_the_statics(jaw, face, stiffness):
    """By a ramp and by starting there; the energies close, and the middle is where it should be."""
    expected = st.steady_sliding(bar(jaw=jaw, face=face, stiffness=stiffness)).normal_force.sum()
    middle = -5e-6 if jaw else 5e-6
    result = st.simulate(bar(jaw=jaw, face=face, stiffness=stiffness, ramp=1e-3))
    assert result.normal_force[-1, 0] == pytest.approx(expected, rel=1e-3)
    assert energy_balance(result).error < 1e-6
    if stiffness == '"rigid"':
        assert result.displacement[-1, 0, 0] == pytest.approx(middle, rel=1e-3)
    held = st.simulate(bar(jaw=jaw, face=face, stiffness=stiffness, initial="steady-sliding"))
    assert held.normal_force[:, 0] == pytest.approx(expected, rel=1e-6)


def test_a_phase_takes_it_back():
    """Factor one half, then none: half of the force, then none."""
    text = bar(jaw=JAW, ramp=1e-3).text + """
[[phases]]
name = "half"
duration = 2e-3
ramp = 1e-3
displacements = { jaw = 0.5 }
[[phases]]
name = "none"
duration = 2e-3
ramp = 1e-3
displacements = { jaw = 0.0 }
"""
    result = st.simulate(loads(text))
    ends = [int(np.searchsorted(result.time, t)) - 2 for t in (2e-3, 4e-3, 6e-3)]
    assert result.normal_force[ends, 0] == pytest.approx([FORCE, FORCE / 2, 0.0], abs=2e-3 * FORCE)


def test_modes_know_what_touches():
    """Pressed on, the bar's end is held along; drawn off (the distance turned round), there is no contact at all."""
    pressed = st.modes(bar(jaw=JAW), mu=0.0)
    frequencies = np.abs(pressed.eigenvalues[0].imag) / 2 / np.pi
    between_walls = np.sqrt(200e9 / 7800.0) / 0.4
    assert np.min(np.abs(frequencies / between_walls - 1)) < 0.01
    with pytest.raises(st.AnalysisError, match="no contact carries load"):
        st.modes(bar(jaw="displacement = { x = 1e-5 }"), mu=0.0)


# A mass between a belt below and a stop on its left; its springs (kx = 1, ky = 2) hang on an arm.
CORNER = """
units = "nondimensional"
bodies.m = {{ type = "mass", mass = 1.0, position = [0.0, 0.0] }}
bodies.arm = {{ type = "mass", mass = 1.0, position = [-1.0, 1.0] }}
bodies.belt = {{ type = "obstacle", shape = "flat", point = [0.0, 0.0], normal = [0.0, 1.0], sliding = {{ velocity = [1.0, 0.0] }} }}
bodies.stop = {{ type = "obstacle", shape = "flat", point = [0.0, 0.0], normal = [1.0, 0.0] }}
springs.x = {{ between = ["m", "arm"], stiffness = 1.0, direction = [1.0, 0.0] }}
springs.y = {{ between = ["m", "arm"], stiffness = 2.0, direction = [0.0, 1.0] }}
supports.arm = {{ at = "arm", fixed = ["x", "y"]{arm} }}
[contacts.rub]
slave = "m"
master = "belt"
stiffness = "rigid"
{rub}
friction = {{ law = "hyperbolic", coefficient = 0.0, static_coefficient = 0.2, delta = 1.0 }}
[contacts.stop]
slave = "m"
master = "stop"
stiffness = 3.0
{stop}
friction = {{ law = "coulomb", coefficient = 0.0 }}
[modal]
max_frequency_hz = 1.0
friction_range = [0.0, 0.6]
source = "{source}"
"""
PUSHED = {"arm": ", displacement = { x = -0.3, y = -0.5 }", "rub": "", "stop": ""}
FITTED = {"arm": "", "rub": "interference = 0.5", "stop": "interference = 0.3"}


@pytest.mark.parametrize(
    ("pressed", "source"),
    [
        (PUSHED, "full"),
        (FITTED, "krylov"),
        *(pytest.param(p, s, marks=pytest.mark.slow) for p, s in ((PUSHED, "krylov"), (PUSHED, "reduced"), (FITTED, "reduced"))),
    ],
)
def test_friction_opens_what_distances_alone_have_closed(pressed, source):
    """Without any load: N = 2 · 0.5 = 1, and the stop opens where μN = 1 · 0.3, below which it stiffens the mass by 3.
    Friction that falls with the slip feeds N μ/2 into its damping: λ² − μλ/2 + k = 0."""
    case = loads(CORNER.format(**pressed, source=source))
    swept, single = st.modes(case, [0.2, 0.4]), st.modes(case, 0.4)  # the case's own is 0.1, at which the stop is closed
    for values, mu, k in ((swept.eigenvalues[0], 0.2, 4.0), (swept.eigenvalues[1], 0.4, 1.0), (single.eigenvalues[0], 0.4, 1.0)):
        expected = mu / 4 + 1j * np.sqrt(k - mu**2 / 16)
        assert values[np.isfinite(values)] == pytest.approx([expected], rel=1e-9)
    assert any("2 between μ = 0.2 and 0.3, 1 between μ = 0.3 and 0.4" in note for note in swept.notes)
    assert not any("no load acts" in note for note in (*swept.notes, *single.notes))
    # Where the stop has neither force nor gap, two sets of nodes are one equilibrium.
    assert not any("more than one equilibrium" in note for note in swept.notes)


def test_onsets_and_numbers_along_take_the_nodes_that_distances_leave():
    """The stop opens at μ = 0.3, and at the friction of 0.1 where N = 2 y is 3."""
    case = loads(CORNER.format(**PUSHED, source="auto"))
    found = st.onsets(case)
    assert any("2 between μ = 0 and 0.3, 1 between μ = 0.3 and 0.6" in note for note in found.notes)
    assert not any("no load acts" in note for note in found.notes)
    own, path = st.build_system(case), "supports.arm.displacement.y"
    along = stretches_along(lambda y: st.build_system(case.with_({path: y})), own, -2.0, -0.5)
    assert [s.touching for s in along] == [1, 2]
    assert along[0].high == pytest.approx(-1.5, abs=1e-6)


def test_stresses_are_those_of_the_bar_and_its_jaw():
    """The geometric stiffness knows that the held side has moved: the same as that of the field shifted to hold it."""
    case = bar(jaw=JAW)
    system, u = st.build_system(case), st.steady_sliding(case).displacement
    shift = 1e-5 * (system.solids[0].rows.free.T @ np.tile([1.0, 0.0], len(system.solids[0].points)))
    assert system.stress_stiffness is not None
    expected = system.stress_stiffness(u + shift).toarray()
    placed = system.in_place()
    assert placed.stress_stiffness is not None
    assert placed.stress_stiffness(u).toarray() == pytest.approx(expected, abs=1e-9 * np.abs(expected).max())
    assert np.abs(expected).max() > 0.1 * FORCE


def test_cubic_spring_of_a_support_that_is_pressed_away():
    """k u = κ (δ − u)³ of a mass between a linear spring and a cubic one."""
    system = st.build_system(loads("""
[bodies.hand]
type = "mass"
mass = 1.0
position = [1.0, 0.0]
[bodies.block]
type = "mass"
mass = 1.0
position = [0.0, 0.0]
[supports.hand]
at = "hand"
fixed = ["x", "y"]
displacement = { x = 0.1 }
[springs.linear]
between = ["block", "ground"]
stiffness = 50.0
direction = [1.0, 0.0]
[springs.aside]
between = ["block", "ground"]
stiffness = 50.0
direction = [0.0, 1.0]
[springs.hard]
between = ["block", "hand"]
stiffness = 0.0
cubic = 1e5
"""))
    u = float(steady_sliding(system).displacement[0])
    assert 50.0 * u == pytest.approx(1e5 * (0.1 - u) ** 3, rel=1e-9)
    assert 0.05 < u < 0.1


RINGS = """
materials.steel = {{ young_modulus = 200e9, density = 7800.0, poisson_ratio = 0.3 }}
materials.brass = {{ young_modulus = 100e9, density = 8500.0, poisson_ratio = 0.35 }}
[bodies.hub]
type = "solid"
model = "plane stress"
material = "brass"
mesh = {{ shape = "annulus", inner_radius = 0.02, outer_radius = 0.05, start_deg = 0, sweep_deg = 90, divisions = [6, 16], cells = "quad" }}
[bodies.tyre]
type = "solid"
model = "plane stress"
material = "steel"
mesh = {{ shape = "annulus", inner_radius = 0.05, outer_radius = 0.1, start_deg = 0, sweep_deg = 90, divisions = [8, 16], cells = "quad" }}
[supports.a]
at = "hub.start"
fixed = ["y"]
[supports.b]
at = "hub.end"
fixed = ["x"]
[supports.c]
at = "tyre.start"
fixed = ["y"]
[supports.d]
at = "tyre.end"
fixed = ["x"]
[contacts.fit]
slave = "hub.outer"
master = "tyre.inner"
stiffness = {stiffness}
interference = 2e-5
friction = {{ law = "coulomb", coefficient = 0.0 }}
"""


@pytest.mark.parametrize("stiffness", ['"rigid"', "1e16"])
def test_press_fit_of_two_rings(stiffness):
    """Lamé: p = δ/(R (((c² + R²)/(c² − R²) + ν₂)/E₂ + ((R² + a²)/(R² − a²) − ν₁)/E₁)), at every node."""
    a, r, c = 0.02, 0.05, 0.1
    outer = ((c**2 + r**2) / (c**2 - r**2) + 0.3) / 200e9
    inner = ((r**2 + a**2) / (r**2 - a**2) - 0.35) / 100e9
    expected = 2e-5 / (r * (outer + inner))
    case = loads(RINGS.format(stiffness=stiffness))
    steady = st.steady_sliding(case)
    pressure = steady.normal_force / st.build_system(case).contact_nodes().area
    assert steady.active.all()
    assert pressure == pytest.approx(expected, rel=0.02)


PIN = """
materials.steel = {{ young_modulus = 200e9, density = 7800.0 }}
[bodies.pin]
type = "beam"
material = "steel"
start = [0.1, 0.0]
angle_deg = 90.0
length = 0.05
width = 0.01
thickness = 0.0015
elements = 5
mass = "lumped"
damping = {{ mass = 2e3 }}
points = {{ tip = 0.0, top = 0.05 }}
[bodies.rail]
type = "beam"
material = "steel"
start = [0.0, 0.0]
end = [0.15, 0.0]
width = 0.015
thickness = 0.003
elements = 15
mass = "lumped"
damping = {{ mass = 2e3 }}
[supports.clamp]
at = "rail.start"
fixed = ["x", "y", "rotation"]
velocity = {{ x = 0.02 }}
[supports.guide]
at = "pin.top"
fixed = ["x", "y", "rotation"]
{guide}
[contacts.A]
slave = "pin.tip"
master = "rail"
side = "left"
stiffness = "rigid"
{face}
friction = {{ law = "coulomb", coefficient = 0.0 }}
[modal]
max_frequency_hz = 10e3
[temporal]
initial = "{initial}"
[[phases]]
name = "press"
duration = 0.02
ramp = {ramp}
"""


@pytest.mark.parametrize(
    ("guide", "face"), [("displacement = { y = -1e-4 }", ""), ("", "interference = 1e-4")], ids=["support", "overlap"]
)
def test_point_contact_on_beams(guide, face):
    """N = δ/(a³/3EI + L/EA) of a cantilever and a column; in modes, from steady sliding and by a ramp."""
    rail, column = 0.1**3 / (3 * 200e9 * 0.015 * 0.003**3 / 12), 0.05 / (200e9 * 0.01 * 0.0015)
    expected = 1e-4 / (rail + column)

    def case(initial="rest", ramp=0.0):
        return loads(PIN.format(guide=guide, face=face, initial=initial, ramp=ramp))

    assert st.steady_sliding(case()).normal_force == pytest.approx([expected], rel=1e-8)
    assert not st.modes(case(), mu=0.0).open_contacts
    held = st.simulate(case("steady-sliding"))
    assert held.normal_force[:, 0] == pytest.approx(expected, rel=1e-5)
    pressed = st.simulate(case(ramp=0.015))
    assert pressed.normal_force[-1, 0] == pytest.approx(expected, rel=5e-2)
    assert energy_balance(pressed).error < 1e-6

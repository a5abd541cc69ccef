"""Weight and centrifugal load against closed forms: reactions, a cantilever, a rotating bar and ring, free fall."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
import scipy.sparse.linalg as spl

import stridor as st
from stridor.case import loads
from stridor.temporal.energy import energy_balance

pytestmark = pytest.mark.verification

STEEL = "materials.steel = { young_modulus = 200e9, density = 7800.0, poisson_ratio = 0.3 }\n"
BOX = """
[bodies.box]
type = "solid"
model = "3d"
material = "steel"
mass = "{mass}"
mesh = {{ shape = "block", corner = [0.0, 0.0, 0.0], size = [0.3, 0.2, 0.1], divisions = [2, 2, 1], cells = "{cells}" }}
[bodies.floor]
type = "obstacle"
shape = "flat"
point = [0.0, 0.0, 0.0]
normal = [0.0, 0.0, 1.0]
[supports.left]
at = "box.left"
fixed = ["x"]
[supports.front]
at = "box.front"
fixed = ["y"]
[contacts.rest]
slave = "box.bottom"
master = "floor"
stiffness = 1e13
friction = {{ law = "coulomb", coefficient = 0.0 }}
[loads.weight]
gravity = [0.0, 0.0, -9.81]
"""


def static(case: st.Case) -> tuple[st.System, np.ndarray]:
    """The system and its answer to all loads."""
    system = st.build_system(case)
    force = sum(system.loads.values(), start=np.zeros(system.size))
    return system, spl.spsolve(sp.csc_array(system.stiffness), force)


@pytest.mark.parametrize("mass", ["lumped", "consistent"])
@pytest.mark.parametrize("cells", ["hexahedron", "tetra", "tetra10", "hexahedron27"])
def test_contact_carries_the_weight(cells, mass):
    """Σ N = M g for every kind of element, with a lumped mass as with a consistent one."""
    steady = st.steady_sliding(loads(STEEL + BOX.format(cells=cells, mass=mass)))
    weight = 7800.0 * 0.3 * 0.2 * 0.1 * 9.81
    assert steady.normal_force.sum() == pytest.approx(weight, rel=1e-10)
    assert steady.resultants["rest"].force == pytest.approx([0.0, 0.0, weight], rel=1e-10)


def test_two_bodies_tied_weigh_what_both_weigh_and_one_alone_what_it_weighs():
    """The weight of slave nodes of a tie goes to their leaders; `bodies` chooses."""
    two = STEEL + BOX.format(cells="hexahedron", mass="lumped") + """
[bodies.top]
type = "solid"
model = "3d"
material = "steel"
mesh = { shape = "block", corner = [0.0, 0.0, 0.1], size = [0.3, 0.2, 0.05], divisions = [4, 3, 1], cells = "hexahedron" }
[ties.glue]
slave = "top.bottom"
master = "box.top"
"""
    both = 7800.0 * 0.3 * 0.2 * 0.15 * 9.81
    assert st.steady_sliding(loads(two)).normal_force.sum() == pytest.approx(both, rel=1e-9)
    chosen = loads(two).with_({"loads.weight.bodies": ["top"]})
    assert st.steady_sliding(chosen).normal_force.sum() == pytest.approx(both / 3, rel=1e-9)


BEAM = """
[bodies.arm]
type = "beam"
material = "steel"
start = [0.0, 0.0]
angle_deg = {angle}
length = 0.8
width = 0.02
thickness = 0.01
elements = 5
mass = "{mass}"
[supports.root]
at = "arm.start"
fixed = ["x", "y", "rotation"]
"""


@pytest.mark.parametrize("mass", ["lumped", "consistent"])
@pytest.mark.parametrize("angle", [0.0, 40.0])
def test_cantilever_under_its_weight(angle, mass):
    """Exact at the nodes: w L⁴/8EI across, ρ g L²/2E along, with the parts of gravity across and along."""
    case = loads(STEEL + BEAM.format(angle=angle, mass=mass) + "[loads.weight]\ngravity = [0.0, -9.81]\n")
    system, u = static(case)
    tip = system.points["arm.end"].free @ u
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    line, bending = 7800.0 * 0.02 * 0.01 * 9.81, 200e9 * 0.02 * 0.01**3 / 12
    across, along = -line * c * 0.8**4 / (8 * bending), -line * s * 0.8**2 / (2 * 200e9 * 0.02 * 0.01)
    assert tip[0] == pytest.approx(c * along - s * across, rel=1e-8)
    assert tip[1] == pytest.approx(s * along + c * across, rel=1e-8)
    assert tip[2] == pytest.approx(-line * c * 0.8**3 / (6 * bending), rel=1e-8)


def test_rotating_bar():
    """u(x) = ρω²x(3L² − x²)/6E of a bar held on the axis, as a beam and as a solid; a beam's nodes are exact."""
    speed, length = 300.0, 0.8
    exact = 7800.0 * speed**2 * length**3 / (3 * 200e9)
    spin = f'[loads.spin]\nbodies = ["arm"]\ncentrifugal = {{ speed = {speed} }}\n'
    system, u = static(loads(STEEL + BEAM.format(angle=0.0, mass="lumped") + spin))
    assert (system.points["arm.end"].free @ u)[0] == pytest.approx(exact, rel=1e-8)
    solid = """
[bodies.arm]
type = "solid"
model = "plane stress"
material = "steel"
mesh = { shape = "rectangle", corner = [0.0, -0.01], size = [0.8, 0.02], divisions = [20, 1], cells = "quad8" }
points = { end = [0.8, 0.0] }
[supports.root]
at = "arm.left"
fixed = ["x", "y"]
"""
    system, u = static(loads(STEEL.replace("0.3 }", "0.0 }") + solid + spin))
    assert (system.points["arm.end"].free @ u)[0] == pytest.approx(exact, rel=1e-6)


def ring(r: float, inner: float, outer: float, speed: float) -> float:
    """Radial displacement [m] of a free annulus in plane stress (Timoshenko and Goodier, Theory of Elasticity, §32)."""
    nu, e, rho = 0.3, 200e9, 7800.0
    a2, b2 = inner**2, outer**2
    lead = rho * speed**2 * (3 + nu) * (1 - nu) / (8 * e)
    return lead * r * (a2 + b2 + (1 + nu) / (1 - nu) * a2 * b2 / r**2 - (1 + nu) / (3 + nu) * r**2)


def test_rotating_ring():
    """Radial displacement of an annulus; for a thin one the hoop stress is ρω²r². A quarter about another centre."""
    quarter = """
[bodies.rim]
type = "solid"
model = "plane stress"
material = "steel"
mesh = { shape = "annulus", centre = [1.0, 2.0], inner_radius = 0.1, outer_radius = 0.2, start_deg = 0, sweep_deg = 90, divisions = [4, 12], cells = "quad8" }
points = { bore = [1.1, 2.0], skin = [1.0, 2.2] }
[supports.lower]
at = "rim.start"
fixed = ["y"]
[supports.upper]
at = "rim.end"
fixed = ["x"]
[loads.spin]
bodies = ["rim"]
centrifugal = { speed = 1000.0, centre = [1.0, 2.0] }
"""
    system, u = static(loads(STEEL + quarter))
    bore, skin = (system.points[f"rim.{name}"].free @ u for name in ("bore", "skin"))
    assert bore[0] == pytest.approx(ring(0.1, 0.1, 0.2, 1000.0), rel=2e-4)
    assert skin[1] == pytest.approx(ring(0.2, 0.1, 0.2, 1000.0), rel=2e-4)
    # E u/r = σ of a thin ring.
    assert 200e9 * ring(0.1, 0.1, 0.1001, 1000.0) / 0.1 == pytest.approx(7800.0 * 1000.0**2 * 0.1**2, rel=2e-3)


def test_turning_about_an_oblique_axis():
    """Σ f = M ω² (centre of mass − axis), across the axis only."""
    text = STEEL + BOX.format(cells="tetra10", mass="lumped").replace(
        "gravity = [0.0, 0.0, -9.81]", 'bodies = ["box"]\ncentrifugal = { speed = 20.0, axis = [1, 2, 2], centre = [0.5, 0.1, 0.0] }'
    )
    free = loads(text).with_({"supports": {}, "contacts": {}})
    system = st.build_system(free)
    axis = np.array([1.0, 2.0, 2.0]) / 3.0
    arm = np.array([0.15, 0.1, 0.05]) - np.array([0.5, 0.1, 0.0])
    expected = 7800.0 * 0.006 * 20.0**2 * (arm - axis * (axis @ arm))
    assert system.loads["weight"].reshape(-1, 3).sum(axis=0) == pytest.approx(expected, rel=1e-10)


def test_free_fall_and_half_of_it():
    """A point mass and a solid fall by g t²/2; a factor of the phase takes half of it."""
    text = STEEL + """
[bodies.stone]
type = "mass"
mass = 3.0
position = [1.0, 0.0]
[bodies.brick]
type = "solid"
model = "plane strain"
material = "steel"
mesh = { shape = "rectangle", corner = [0.0, 0.0], size = [0.1, 0.1], divisions = [2, 2], cells = "quad8" }
points = { corner = [0.0, 0.0] }
[bodies.floor]
type = "obstacle"
shape = "flat"
point = [0.0, -1.0]
normal = [0.0, 1.0]
[contacts.drop]
slave = "brick.bottom"
master = "floor"
stiffness = "rigid"
friction = { law = "coulomb", coefficient = 0.0 }
[loads.weight]
gravity = [0.0, -9.81]
[[phases]]
name = "fall"
duration = 1e-3
[[phases]]
name = "lighter"
duration = 1e-3
loads = { weight = 0.5 }
[temporal]
record_every = 10
watch = ["stone", "brick.corner"]
"""
    result = st.simulate(loads(text))
    t = result.time
    later = np.maximum(t - 1e-3, 0.0)
    fallen = -9.81 * (t**2 / 2 - later**2 / 4)
    for k in range(2):
        assert result.displacement[:, k, 1] == pytest.approx(fallen, abs=2e-3 * abs(fallen).max())
    assert energy_balance(result).error < 1e-9


def test_matrices_of_another_program_weigh_what_the_mesh_does(tmp_path):
    """M a of matrices that were written out is the load of the meshed body; without directions it is refused."""
    case = loads(STEEL + """
[bodies.box]
type = "solid"
model = "plane strain"
material = "steel"
mass = "consistent"
mesh = { shape = "rectangle", corner = [0.0, 0.0], size = [0.2, 0.1], divisions = [2, 1], cells = "quad" }
[loads.weight]
gravity = [1.0, -9.81]
""")
    system = st.build_system(case)
    for kind in ("mass", "stiffness"):
        sp.save_npz(tmp_path / f"{kind}.npz", getattr(system, kind))
    (tmp_path / "dof.txt").write_text("\n".join(f"{k // 2 + 1} {k % 2 + 1}" for k in range(system.size)))
    text = """
[bodies.box]
type = "matrices"
dimension = 2
terms = [{ file = "mass.npz", role = "mass" }, { file = "stiffness.npz", role = "stiffness" }]
labels = "dof.txt"
[loads.weight]
gravity = [1.0, -9.81]
"""
    (tmp_path / "case.toml").write_text(text)
    assert st.build_system(st.load(tmp_path / "case.toml")).loads["weight"] == pytest.approx(system.loads["weight"])
    (tmp_path / "bare.toml").write_text(text.replace('labels = "dof.txt"\n', ""))
    with pytest.raises(st.CaseError, match="nothing says which freedoms of box move along x and y"):
        st.build_system(st.load(tmp_path / "bare.toml"))

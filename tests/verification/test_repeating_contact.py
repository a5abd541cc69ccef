"""Contact across the cut through a body that repeats, against the whole body."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy.linalg as sl
from scipy.spatial import Delaunay

import stridor as st
from random_sectors import Ring, random_ring
from stridor.app.conclusions import of_modes, of_onsets
from stridor.case import loads
from stridor.errors import AnalysisError, StridorError


def against_the_whole(ring: Ring) -> None:
    """Forces, pressures and the sector's eigenvalues, which are among the ring's, are those of the whole ring."""
    sector, whole = loads(ring.sector), loads(ring.whole)
    try:
        truth = st.steady_sliding(whole)
    except StridorError as refusal:  # coarse facets of circles overlap too far, or nothing touches
        with pytest.raises(type(refusal), match=r"the bodies overlap|leave gaps"):
            st.steady_sliding(sector)
        return
    ours = st.steady_sliding(sector)
    few, many = (st.build_system(case).contact_nodes() for case in (sector, whole))
    assert few.count * ring.sectors == many.count
    assert few.area.sum() * ring.sectors == pytest.approx(many.area.sum(), rel=1e-9)
    assert ours.active.sum() * ring.sectors == truth.active.sum()
    assert ours.normal_force.sum() * ring.sectors == pytest.approx(truth.normal_force.sum(), rel=1e-9)
    # Quadratic facets that hang over an outline of straight ones weigh the middles beside the cut by one side alone.
    (surface,) = st.build_system(sector).surfaces
    overhanging = surface.facets.rim is not None and any(kind in ("quad8", "triangle6") for kind in surface.facets.blocks)
    close = 2e-3 if overhanging else 1e-9
    pressure, expected = ours.normal_force / few.area, truth.normal_force / many.area
    # Which sector the whole one's nodes belong to does not matter.
    away = np.abs(np.sort(np.repeat(pressure, ring.sectors)) - np.sort(expected))
    assert away.max() < close * expected.max()


def eigenvalues(case: str, mu: float) -> np.ndarray:
    """λ (k,) [1/s] of what vibrates, the slowest first."""
    mass, damping, stiffness = (m.toarray() for m in st.pencil(loads(case), mu).matrices())
    n = len(mass)
    a = np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness, -damping]])
    values = sl.eig(a, np.block([[np.eye(n), np.zeros((n, n))], [np.zeros((n, n)), mass]]), right=False)
    values = values[np.isfinite(values) & (np.abs(values) < 1e7) & (values.imag > 1.0)]
    return values[np.argsort(np.abs(values))]


SEEDS = [*range(4), *(pytest.param(k, marks=pytest.mark.slow) for k in range(4, 60))]


@pytest.mark.parametrize("rigid", [True, False], ids=["rigid", "elastic"])
@pytest.mark.parametrize("seed", SEEDS)
def test_random_sectors_in_the_plane_press_as_the_whole_ring(seed: int, rigid: bool) -> None:
    against_the_whole(random_ring(seed, dimension=2, rigid=rigid))


@pytest.mark.parametrize("rigid", [True, False], ids=["rigid", "elastic"])
@pytest.mark.parametrize("seed", SEEDS[:2] + SEEDS[4:24])
def test_random_sectors_in_space_press_as_the_whole_ring(seed: int, rigid: bool) -> None:
    against_the_whole(random_ring(seed, dimension=3, rigid=rigid))


@pytest.mark.parametrize("seed", [2, 3, *(pytest.param(k, marks=pytest.mark.slow) for k in (8, 11, 30))])
def test_the_sector_s_eigenvalues_are_among_the_ring_s(seed: int) -> None:
    """With friction, so that rows of normal and tangential motion both count: those of the modes that repeat."""
    ring = random_ring(seed, dimension=2, rigid=True)
    ours, all_of_them = eigenvalues(ring.sector, ring.mu)[:12], eigenvalues(ring.whole, ring.mu)
    away = [float(np.min(np.abs(all_of_them - value))) / abs(value) for value in ours]
    assert len(ours) > 4
    assert max(away) < 1e-5  # pairs about to part are known to the root of rounding


BLOCKS = """units = "SI"
[materials.a]
young_modulus = 2e11
density = 7800.0
poisson_ratio = 0.3
[supports.ground]
at = "low.bottom"
fixed = ["x", "y", "z"]
[loads.press]
at = "high.top"
pressure = 1e6
[supports.drag]
at = "high.top"
fixed = ["x", "y"]
[contacts.c]
slave = "high.bottom"
master = "low.top"
stiffness = "rigid"
friction = { law = "coulomb", coefficient = 0.2 }
"""


@pytest.mark.parametrize("cells", ["hexahedron", "hexahedron20"])
def test_corners_that_repeat_both_ways_are_one_node(cells: str) -> None:
    """Two blocks that repeat along x and y: an even pressure, and each node stands for the same or for its kind."""
    text = BLOCKS
    for name, z, divisions in (("low", 0.0, "[3, 2, 1]"), ("high", 0.01, "[2, 3, 1]")):
        text += f"""[bodies.{name}]
type = "solid"
material = "a"
model = "3d"
mesh = {{ shape = "block", corner = [0.0, 0.0, {z}], size = [0.03, 0.02, 0.01], divisions = {divisions}, cells = "{cells}" }}
{"sliding = { velocity = [1.0, 0.5, 0.0] }" if name == "high" else ""}
[ties.{name}-x]
slave = "{name}.right"
master = "{name}.left"
translation = [0.03, 0.0, 0.0]
[ties.{name}-y]
slave = "{name}.back"
master = "{name}.front"
translation = [0.0, 0.02, 0.0]
"""
    case = loads(text)
    nodes, found = st.build_system(case).contact_nodes(), st.steady_sliding(case)
    assert nodes.count == (6 if cells == "hexahedron" else 18)  # of 12, and of 29 with middles
    assert nodes.area.sum() == pytest.approx(0.03 * 0.02, rel=1e-12)
    assert found.normal_force / nodes.area == pytest.approx(np.full(nodes.count, 1e6), rel=1e-9)
    if cells == "hexahedron":
        assert nodes.area == pytest.approx(np.full(6, 1e-4), rel=1e-12)


def test_rigid_contact_on_a_cut_whose_meshes_do_not_match_is_refused(tmp_path: Path) -> None:
    """A strip with two elements on its left end and three on its right one: its corner follows several nodes."""
    inner = [(x, y) for x in (0.05, 0.1, 0.15) for y in (0.0, 0.01)]
    points = np.array([(0.0, 0.0), (0.0, 0.005), (0.0, 0.01), (0.2, 0.0), (0.2, 0.004), (0.2, 0.007), (0.2, 0.01), *inner])
    cells = Delaunay(points * [1.0, 5.0]).simplices
    a, b, c = (points[cells[:, k]] for k in range(3))
    turned = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0] < 0
    cells[turned] = cells[turned][:, ::-1]
    sides = {"LEFT": points[:, 0] == 0.0, "RIGHT": points[:, 0] == 0.2, "LOW": points[:, 1] == 0.0, "HIGH": points[:, 1] == 0.01}
    lines = ["*NODE", *(f"{k + 1}, {x!r}, {y!r}" for k, (x, y) in enumerate(points.tolist())), "*ELEMENT, TYPE=CPS3, ELSET=E"]
    lines += [f"{k + 1}, {i + 1}, {j + 1}, {m + 1}" for k, (i, j, m) in enumerate(cells.tolist())]
    for name, chosen in sides.items():
        lines += [f"*NSET, NSET={name}", ", ".join(str(k + 1) for k in np.flatnonzero(chosen))]
    (tmp_path / "strip.inp").write_text("\n".join([*lines, ""]))
    text = f"""
[materials.a]
young_modulus = 2e11
density = 7800.0
poisson_ratio = 0.3
[bodies.strip]
type = "solid"
material = "a"
model = "plane stress"
thickness = 0.01
file = "{tmp_path / "strip.inp"}"
[bodies.flat]
type = "obstacle"
shape = "flat"
point = [0.0, 0.0]
normal = [0.0, 1.0]
sliding = {{ velocity = [1.0, 0.0] }}
[supports.top]
at = "strip.HIGH"
fixed = ["x"]
[loads.press]
at = "strip.HIGH"
pressure = 1e5
[ties.period]
slave = "strip.LEFT"
master = "strip.RIGHT"
translation = [-0.2, 0.0]
[contacts.rub]
slave = "strip.LOW"
master = "flat"
stiffness = STIFFNESS
friction = {{ law = "coulomb", coefficient = 0.2 }}
"""
    with pytest.raises(AnalysisError, match=r"meshes of both sides do not match there.*contacts\.rub, .*ties\.period"):
        st.steady_sliding(loads(text.replace("STIFFNESS", '"rigid"')))
    found = st.steady_sliding(loads(text.replace("STIFFNESS", "1e12")))
    assert found.normal_force.sum() == pytest.approx(1e5 * 0.2 * 0.01, rel=1e-9)


@pytest.mark.parametrize("sliding", ["small", "finite"])
def test_the_time_loop_goes_over_the_cut(sliding: str) -> None:
    """A ring that whirls into another one, as one of six sectors: the forces of a sixth of the whole."""
    ring = random_ring(3, dimension=2, rigid=True)
    phases = """
[loads.whirl]
bodies = ["one"]
centrifugal = { speed = 6000.0 }
[temporal]
initial = "rest"
stepper = "explicit"
step = 2e-8
record_every = 20
[[phases]]
name = "press"
duration = 2e-5
ramp = 1e-5
"""
    force = []
    for text in (ring.sector, ring.whole):
        text = text.replace("interference = 5e-4\n", f'sliding = "{sliding}"\n') + phases
        run = st.simulate(loads(text))
        force.append(run.normal_force.sum(axis=1))
    assert ring.sectors * force[0] == pytest.approx(force[1], rel=1e-6, abs=1e-6 * force[1].max())
    assert force[1][-1] > 0.0


def test_what_is_said_of_a_sector_is_said_of_motions_alike_in_all_sectors_alone():
    """The whole ring squeals from μ = 0 on in motions that its sector has not."""
    ring = random_ring(4, dimension=2, rigid=False)
    sector, whole = (loads(text).with_({"modal.max_frequency_hz": 30e3}) for text in (ring.sector, ring.whole))
    one, some, every = st.onsets(sector, (0.0, 0.6)), st.modes(sector, 0.4), st.modes(whole, 0.4)
    assert not one
    assert not some.unstable.any()
    assert every.unstable.any()
    for said in (one.completeness, some.completeness[0]):
        assert said.endswith(" All of that is of motions alike in all sectors alone (ties.one).")
    assert str(of_onsets(one).sentence).endswith("up to 30000 Hz, of motions alike in all sectors")
    assert of_modes(some, "0.4").sentence.endswith("at μ = 0.4, of motions alike in all sectors")
    assert any(said.startswith("ties.one: bodies repeat") for said in sector.warnings)
    for said in (every.completeness[0], of_modes(every, "0.4").sentence, *whole.warnings):
        assert "alike" not in said
    both = st.compare(sector.with_({"comparison.critical": False}), [0.4])
    assert "all of it is of motions alike in all sectors alone (ties.one)" in both.notes


DOUBLE = """
units = "SI"
[materials.a]
young_modulus = 2e11
density = 7800.0
poisson_ratio = 0.3
[bodies.one]
type = "solid"
material = "a"
model = "plane stress"
thickness = 0.01
mass = "lumped"
mesh = { shape = "annulus", inner_radius = 0.07, outer_radius = 0.1, divisions = [1, 6], start_deg = 0.0, sweep_deg = 180.0, cells = "quad" }
[supports.one]
at = "one.inner"
fixed = ["x", "y"]
[ties.one]
slave = "one.end"
master = "one.start"
rotation = { angle_deg = 180.0 }
[bodies.wall]
type = "obstacle"
shape = "cylinder"
point = [0.0, 0.0]
radius = 0.1
inside = true
sliding = { spin = 10.0 }
[contacts.c]
slave = "one.outer"
master = "wall"
stiffness = "rigid"
interference = 5e-4
friction = { law = "coulomb", coefficient = 0.35 }
[modal]
max_frequency_hz = 150000.0
"""


def test_of_modes_that_are_one_without_friction_the_way_on_is_told():
    """Two modes of one frequency that friction parts from μ = 0 on: no smaller range from 0 on tells more."""
    case = loads(DOUBLE)
    modes = st.modes(case, 1e-3, max_frequency_hz=150e3)
    assert np.count_nonzero(modes.unstable[0]) == 2
    found = st.onsets(case, (0.0, 0.8))
    assert not found.complete
    assert "Two modes each are one at μ = 0 (22158.1 Hz, 26943.5 Hz)" in found.completeness
    assert "(--range 0.0008:0.8)" in found.completeness
    beyond = st.onsets(case, (8e-4, 0.8))
    assert beyond.complete
    assert sorted(v.imag / (2 * np.pi) for v in beyond.at_start) == pytest.approx([22158.06, 26943.53], rel=1e-5)

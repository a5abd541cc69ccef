"""Contact in space on assembled matrices: Coulomb's disc node by node, blocks on planes, and surfaces that slide far."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.integrate
import scipy.sparse as sp

from marching import one_phase, simulate_assembled
from stridor.contact.interface import Rows
from stridor.contact.obstacles import Flat
from stridor.contact.pairing import pair_surface
from stridor.errors import AnalysisError
from stridor.laws import Coulomb, Hyperbolic, StaticKinetic, Tabulated, Weakening
from stridor.system import System
from stridor.system.model import PrescribedMotion
from stridor.temporal.energy import energy_balance
from stridor.temporal.settings import Settings
from stridor.temporal.steppers.sparse.bends import Turning
from stridor.temporal.steppers.sparse.disc import solve_disc
from stridor.temporal.steppers.sparse.renewal import take_over

pytestmark = pytest.mark.verification

OPEN, STICK, SLIP = 0, 1, 2
GRAVITY = 9.81


def floor(system, *, positions, freedoms, normal=(0.0, 0.0, 1.0), drift=None, law=None, gap=0.0, stiffness=np.inf):
    """The system with slave nodes at positions (m, 3), whose x, y, z are freedoms (m, 3), above a plane."""
    positions, freedoms = np.asarray(positions, dtype=float), np.asarray(freedoms)
    m, p = len(positions), len(system.motion.names)
    rows = sp.csr_array((np.ones(3 * m), (np.arange(3 * m), freedoms.ravel())), shape=(3 * m, system.size))
    normal = np.asarray(normal, dtype=float)
    contact = pair_surface(
        "floor", where="contacts.floor", slave=Rows(rows, np.zeros((3 * m, p))), slave_position=positions,
        slave_normals=np.zeros((m, 3)), area=np.full(m, 1e-4), master=Flat(-gap * normal, normal),
        master_rows=Rows(sp.csr_array((0, system.size)), np.zeros((0, p))),
        drift=np.zeros((m, 3, p)) if drift is None else np.asarray(drift, dtype=float),
        stiffness_per_area=stiffness, law=law or Coulomb(0.3),
    )  # fmt: skip
    point = {"mass": Rows(rows[:3], np.zeros((3, p)))}
    return replace(system, surfaces=(contact,), points=point, dimension=3)


def masses(count=1, *, mass=2.0, stiffness=None, gravity=(0.0, 0.0, -GRAVITY)) -> System:
    """Free masses in space, on springs if asked for, under gravity."""
    size = 3 * count
    k = np.zeros((size, size)) if stiffness is None else np.asarray(stiffness, dtype=float)
    weight = np.tile(mass * np.asarray(gravity), count)
    return System(mass * np.eye(size), np.zeros((size, size)), k, (), {"weight": weight}, dimension=3)


def run(system, duration, **settings):
    return simulate_assembled(system, one_phase(duration), Settings(**{"record_every": 1, "watch": ("mass",), **settings}))


@pytest.mark.parametrize("law", [
    Coulomb(0.3), StaticKinetic(0.3, 0.5), Weakening(0.2, 0.6, 0.7), Coulomb(2.0), Hyperbolic(0.2, 0.6, 1.5),
    Tabulated((0.0, 0.5, 2.0), (0.6, 0.3, 0.4)), Tabulated((0.0, 0.5, 2.0), (0.5, 0.3, 0.2), "monotone-cubic", 0.7),
])  # fmt: skip
@pytest.mark.parametrize("sticking", [False, True])
@pytest.mark.parametrize("count", [1500, pytest.param(4000, marks=pytest.mark.slow)])
def test_one_node_obeys_the_laws(law, sticking, count):
    """Random problems, strongly coupled: Signorini, the disc, friction against the slip, the speed law; exactly."""
    rng = np.random.default_rng(7)
    seen = np.zeros(3, dtype=int)
    for _ in range(count):
        root = rng.standard_normal((3, 3)) * 10 ** rng.uniform(-1, 1, 3)
        w = root @ root.T + 1e-6 * np.eye(3)
        g, s = rng.standard_normal() - 0.5, rng.standard_normal(2) * 10 ** rng.uniform(-2, 2)
        numbers = (w[0, 0], w[0, 1], w[0, 2], w[1, 1], w[1, 2], w[2, 2])
        n, t1, t2, status = solve_disc(g, s[0], s[1], numbers, np.array(law.numbers), sticking, 1.0)
        seen[status] += 1
        force = np.array([n, t1, t2])
        gap, *slip = np.array([g, *s]) + w @ force
        slip, t = np.array(slip), force[1:]
        scale = np.abs(g) + np.abs(s).max() + (np.abs(w) @ np.abs(force)).max()
        assert n >= 0
        if status == OPEN:
            assert g >= 0
            assert not np.any(force)
            continue
        assert abs(gap) <= 1e-9 * scale
        speed = np.linalg.norm(slip)
        if status == STICK:
            assert speed <= 1e-9 * scale
            limit = law.sticking if sticking else law.sliding(0.0)
            assert np.linalg.norm(t) <= limit * n * (1 + 1e-12)
        else:
            mu = law.sliding(speed)
            assert np.linalg.norm(t) == pytest.approx(mu * n, rel=1e-6, abs=1e-9 * np.abs(force).max())
            assert np.abs(t * speed + mu * n * slip).max() <= 1e-7 * scale * max(mu * n, 1e-300)
    assert np.all(seen[[OPEN, SLIP]] > 50)
    assert seen[STICK] > 20


def test_a_node_that_cannot_move_sideways_still_rubs():
    """Held along both tangents on a moving floor: full friction against the slip."""
    n, t1, t2, status = solve_disc(-1.0, 3.0, 4.0, (0.5, 0.0, 0.0, 0.0, 0.0, 0.0), np.array(Coulomb(0.3).numbers), False, 1.0)
    assert status == SLIP
    assert (n, t1, t2) == pytest.approx((2.0, -0.36, -0.48), rel=1e-9)


def test_oblique_block_stops_straight():
    """A block of four feet on springs, thrown obliquely: stops after v²/2μg on a straight line, t = v/μg."""
    speed, mu, direction = 1.5, 0.3, np.array([math.cos(0.7), math.sin(0.7)])
    corners = np.array([[0.0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0.1, 0.1, 0]])
    # Stiff springs along the edges and diagonals keep the feet together in the plane.
    k = np.zeros((12, 12))
    for i in range(4):
        for j in range(i):
            along = (corners[i] - corners[j]) / np.linalg.norm(corners[i] - corners[j])
            b = np.zeros(12)
            b[3 * i : 3 * i + 3], b[3 * j : 3 * j + 3] = along, -along
            k += 1e5 * np.outer(b, b)
    system = masses(4, stiffness=k)
    system = floor(system, positions=corners, freedoms=np.arange(12).reshape(4, 3), law=Coulomb(mu))
    velocity = np.tile([*(speed * direction), 0.0], 4)
    result = run(replace(system, initial_velocity=velocity), 0.7, step=1e-4)
    stop = speed**2 / (2 * mu * GRAVITY)
    assert result.displacement[-1, 0, :2] == pytest.approx(stop * direction, rel=2e-3)
    assert np.abs(result.displacement[:, 0, :2] @ [-direction[1], direction[0]]).max() < 1e-9
    first = result.time[np.flatnonzero(result.status[:, 0] == STICK)[0]]
    assert first == pytest.approx(speed / mu / GRAVITY, rel=2e-3)
    assert result.status[-1, 0] == STICK
    assert result.normal_force[5:, 0] == pytest.approx(8 * GRAVITY, rel=1e-9)
    assert energy_balance(result).error < 1e-9
    assert result.works["friction"][-1] == pytest.approx(0.5 * 8 * speed**2, rel=1e-3)
    assert result.nodes is not None
    assert result.nodes.tangential_force.shape == (len(result.time), 4, 2)
    pull = np.linalg.norm(result.nodes.tangential_force, axis=2)
    assert np.all(pull <= mu * result.nodes.normal_force * (1 + 1e-9) + 1e-12)


@pytest.mark.parametrize(("slope", "stays"), [(0.99, True), (1.01, False)])
def test_incline_at_the_angle_of_friction(slope, stays):
    """Below tan α = μ a mass stays, above it slides off with g (sin α − μ cos α), in any direction of the slope."""
    mu, turn = 0.4, 0.5
    alpha = math.atan(mu * slope)
    normal = np.array([math.sin(alpha) * math.cos(turn), math.sin(alpha) * math.sin(turn), math.cos(alpha)])
    system = floor(masses(), positions=[[0.0, 0.0, 0.0]], freedoms=[[0, 1, 2]], normal=normal, law=Coulomb(mu))
    result = run(system, 1.0, step=1e-3)
    moved = np.linalg.norm(result.displacement[-1, 0])
    if stays:
        # The first step begins half a step early and slides for it.
        assert moved < 1e-6
        assert np.all(result.status[2:] == STICK)
    else:
        pull = GRAVITY * (math.sin(alpha) - mu * math.cos(alpha))
        assert moved == pytest.approx(0.5 * pull * result.time[-1] ** 2, rel=5e-3)
        down = result.displacement[-1, 0] / moved
        assert down == pytest.approx(
            [math.cos(alpha) * math.cos(turn), math.cos(alpha) * math.sin(turn), -math.sin(alpha)], abs=1e-9
        )


def test_static_coefficient_in_space():
    """μs holds what μk would not; once it slides, it slides by μk."""
    alpha = math.atan(0.35)
    normal = np.array([math.sin(alpha), 0.0, math.cos(alpha)])
    still = floor(masses(), positions=[[0.0, 0, 0]], freedoms=[[0, 1, 2]], normal=normal, law=StaticKinetic(0.3, 0.4))
    pushed = replace(still, initial_velocity=1e-3 * np.array([0.0, 1.0, 0.0]))
    rested = simulate_assembled(still, one_phase(0.5), Settings(step=1e-3, record_every=1, initial="rest"))
    assert rested.nodes is not None
    result = run(pushed, 1.0, step=1e-3)
    pull = GRAVITY * (math.sin(alpha) - 0.3 * math.cos(alpha))
    assert np.linalg.norm(result.displacement[-1, 0]) == pytest.approx(0.5 * pull, rel=1e-2)


@pytest.mark.parametrize("law", [Coulomb(0.2), Weakening(0.15, 0.3, 0.5)])
def test_mass_on_two_springs_in_the_plane(law):
    """Two unequal springs and Coulomb's disc: the curved path and the rates of an ODE solver."""
    kx, ky, mass = 300.0, 500.0, 2.0
    system = floor(
        masses(stiffness=np.diag([kx, ky, 0.0])), positions=[[0.0, 0, 0]], freedoms=[[0, 1, 2]], law=law
    )
    v0 = np.array([1.0, 2.0])
    result = run(replace(system, initial_velocity=np.array([*v0, 0.0])), 0.35, step=2e-5, record_every=50)

    def rate(_, state):
        v = state[2:]
        speed = np.linalg.norm(v)
        friction = law.sliding(speed) * GRAVITY * v / speed
        return [*v, -kx / mass * state[0] - friction[0], -ky / mass * state[1] - friction[1]]

    answer = scipy.integrate.solve_ivp(
        rate, (0, 0.35), [0, 0, *v0], t_eval=result.time, rtol=1e-10, atol=1e-12, method="DOP853"
    )
    assert np.all(result.status[2:] == SLIP)
    assert np.abs(result.displacement[:, 0, :2] - answer.y[:2].T).max() < 1e-4 * np.abs(answer.y[:2]).max()
    assert np.abs(result.velocity[:, 0, :2] - answer.y[2:].T).max() < 5e-4 * np.abs(answer.y[2:]).max()
    assert energy_balance(result).error < 1e-9


def test_friction_follows_a_moving_floor():
    """A floor that moves obliquely takes a free mass along at μg until it has the floor's speed."""
    motion = PrescribedMotion(
        ("belt",), np.zeros((3, 1)), np.zeros((3, 1)), np.zeros((3, 1)), np.zeros((1, 1)), np.zeros((1, 1)),
        np.zeros((1, 1)),
    )  # fmt: skip
    belt = np.array([0.6, 0.8, 0.0])
    system = floor(
        replace(masses(), motion=motion), positions=[[0.0, 0, 0]], freedoms=[[0, 1, 2]],
        drift=-belt.reshape(1, 3, 1), law=Coulomb(0.25),
    )  # fmt: skip
    result = run(system, 0.6, step=1e-4)
    caught = 1.0 / (0.25 * GRAVITY)
    sliding = (result.time > 0.01) & (result.time < 0.98 * caught)
    expected = 0.25 * GRAVITY * result.time[sliding, None] * belt
    assert np.abs(result.velocity[sliding, 0] - expected).max() < 1e-3
    assert result.velocity[-1, 0] == pytest.approx(belt, abs=1e-9)
    # Told along the direction in which the belt slides the mass: slip of the slave is against the belt.
    assert result.tangential_force[sliding, 0] == pytest.approx(-0.25 * 2 * GRAVITY, rel=1e-6)
    assert result.slip_speed[sliding, 0] == pytest.approx(1 - 0.25 * GRAVITY * result.time[sliding], abs=2e-3)


@pytest.mark.parametrize("stiffness", [np.inf, 1e9])
def test_steady_sliding_is_an_equilibrium_in_time(stiffness):
    """Started in steady sliding two masses on springs stay where they are, with friction μN; perturbed they swing."""
    belt = np.array([0.6, 0.8, 0.0])
    column, one = np.zeros((6, 1)), np.zeros((1, 1))
    system = masses(2, stiffness=np.diag([3e3, 5e3, 0.0] * 2))
    system = floor(
        replace(system, motion=PrescribedMotion(("belt",), column, column, column, one, one, one)),
        positions=[[0.0, 0, 0], [0.1, 0, 0]], freedoms=np.arange(6).reshape(2, 3), law=Coulomb(0.25),
        drift=np.tile(-belt.reshape(1, 3, 1), (2, 1, 1)), stiffness=stiffness,
    )  # fmt: skip
    result = run(system, 0.2, step=1e-4, initial="steady-sliding")
    weight = 2 * GRAVITY
    rest = [0.25 * weight * 0.6 / 3e3, 0.25 * weight * 0.8 / 5e3, -weight / (stiffness * 1e-4)]
    assert np.abs(result.displacement[:, 0] - rest).max() < 1e-12
    assert result.normal_force == pytest.approx(2 * weight, rel=1e-8)
    assert result.tangential_force == pytest.approx(-0.25 * 2 * weight, rel=1e-8)
    assert np.all(result.status == SLIP)
    shaken = run(system, 0.2, step=1e-4, initial="steady-sliding", perturbation=0.01)
    assert shaken.slip_speed[0, 0] == pytest.approx(1.01, rel=1e-3)
    assert 1e-5 < np.ptp(shaken.displacement[:, 0, 0]) < 1e-3


def test_compliant_layer_in_space():
    """A pressed layer of stiffness k per area gives by F/(k A) under each node."""
    system = floor(
        masses(2), positions=[[0.0, 0, 0], [0.1, 0, 0]], freedoms=np.arange(6).reshape(2, 3), stiffness=1e8
    )
    damped = replace(system, damping=sp.csr_array(200.0 * np.eye(6)))
    result = run(damped, 0.5, step=1e-4, record_every=10)
    assert result.displacement[-1, 0, 2] == pytest.approx(-2 * GRAVITY / (1e8 * 1e-4), rel=1e-6)
    assert result.gap[-1, 0] < 0


def finite(system):
    return replace(system, surfaces=tuple(replace(s, sliding="finite") for s in system.surfaces))


def test_finite_sliding_on_a_plane_is_small_sliding():
    """On a plane nothing turns: renewed rows change nothing."""
    system = floor(masses(2), positions=[[0.0, 0, 0], [0.1, 0, 0]], freedoms=np.arange(6).reshape(2, 3))
    system = replace(system, initial_velocity=np.array([1.0, 0.5, 0, 0.3, -1.0, 0.0]))
    small, large = (run(s, 0.4, step=1e-3) for s in (system, finite(system)))
    assert np.abs(small.displacement - large.displacement).max() < 1e-12
    assert np.abs(small.normal_force - large.normal_force).max() < 1e-9


@pytest.mark.slow
def test_finite_sliding_round_a_cylinder():
    """Without friction a mass in a gutter swings as a pendulum of the gutter's radius, far beyond small angles."""
    from stridor.contact.obstacles import Cylinder

    radius, angle = 0.5, 1.2
    start = radius * np.array([math.sin(angle), 0.0, -math.cos(angle)])
    system = masses()
    rows = Rows(sp.csr_array(np.eye(3)), np.zeros((3, 0)))
    contact = pair_surface(
        "gutter", where="contacts.gutter", slave=rows, slave_position=start[None], slave_normals=np.zeros((1, 3)),
        area=np.array([1e-4]), master=Cylinder(np.zeros(3), radius, np.array([0.0, 1.0, 0.0]), inside=True),
        master_rows=Rows(sp.csr_array((0, 3)), np.zeros((0, 0))), drift=np.zeros((1, 3, 0)),
        stiffness_per_area=np.inf, law=Coulomb(0.0), sliding="finite",
    )  # fmt: skip
    system = replace(system, surfaces=(contact,), points={"mass": rows})
    settings = Settings(step=5e-4, record_every=2, watch=("mass",))
    saved = []
    result = simulate_assembled(system, one_phase(1.0), settings, checkpoint=saved.append, checkpoint_seconds=0.0)
    position = start + result.displacement[:, 0]
    assert np.abs(np.linalg.norm(position, axis=1) - radius).max() < 5e-4 * radius
    angles = np.arctan2(position[:, 0], -position[:, 2])
    answer = scipy.integrate.solve_ivp(
        lambda _, y: [y[1], -GRAVITY / radius * math.sin(y[0])], (0, 1.0), [angle, 0.0], t_eval=result.time, rtol=1e-9
    )
    assert np.abs(angles - answer.y[0]).max() < 5e-3
    # Cut within and gone on with: rows, offsets and all.
    part = saved[len(saved) // 2]
    assert 0 < part.steps < result.steps
    again = simulate_assembled(system, one_phase(1.0), settings, restart=part)
    assert np.array_equal(again.normal_force, result.normal_force)
    assert np.array_equal(again.displacement, result.displacement)


def in_a_bore(radius, start, *, velocity=(0.0, 0.0, 0.0), stiffness=np.inf, mu=0.0):
    """A point mass of 1 kg in a bore along y, rigid or with a contact stiffness [N/m]."""
    from stridor.contact.obstacles import Cylinder

    rows = Rows(sp.csr_array(np.eye(3)), np.zeros((3, 0)))
    contact = pair_surface(
        "bore", where="contacts.bore", slave=rows, slave_position=np.array(start)[None], area=np.ones(1),
        slave_normals=np.zeros((1, 3)), master=Cylinder(np.zeros(3), radius, np.array([0.0, 1.0, 0.0]), inside=True),
        master_rows=Rows(sp.csr_array((0, 3)), np.zeros((0, 0))), drift=np.zeros((1, 3, 0)), adjust=True,
        stiffness_per_area=stiffness, law=Coulomb(mu), sliding="finite",
    )  # fmt: skip
    system = replace(masses(mass=1.0), surfaces=(contact,), points={"mass": rows})
    return replace(system, initial_velocity=np.array(velocity))


@pytest.mark.parametrize("stiffness", [np.inf, 1e6])
def test_a_bore_pushes_back_evenly_whatever_the_step(stiffness):
    """A pendulum in a bore is pressed with N = m (g cos θ + R θ'²) all the time. On rows that stayed between renewals
    its normal velocity was stopped at each, by forces that grew as the step shrank, and contact parted in between."""
    radius, angle = 0.09, 1.0
    system = in_a_bore(radius, radius * np.array([math.sin(angle), 0.0, -math.cos(angle)]), stiffness=stiffness)
    answer = scipy.integrate.solve_ivp(
        lambda _, y: [y[1], -GRAVITY / radius * math.sin(y[0])], (0, 0.2), [angle, 0.0], rtol=1e-10, dense_output=True
    ).sol
    for step in (2e-4, 5e-5):
        settings = Settings(step=step, record_every=4, watch=("mass",))
        found = simulate_assembled(system, one_phase(0.2), settings)
        theta, rate = answer(found.time)
        true = GRAVITY * np.cos(theta) + radius * rate**2
        settled = found.time > 0.01
        off = np.abs(found.normal_force[settled, 0] - true[settled]).max() / true.max()
        energy = 0.5 * (found.velocity[-1, 0] ** 2).sum() + GRAVITY * found.displacement[-1, 0, 2]
        assert off < (0.5 if np.isfinite(stiffness) else 1e-5)  # the spring rings from the sudden start
        assert abs(energy) < (1e-3 if np.isfinite(stiffness) else 1e-6) * GRAVITY * radius


def test_a_helix_in_a_bore_keeps_its_speed():
    """Along and around a bore without gravity: N = m v²/R of the part around, both parts of the velocity stay, and
    friction slows both alike."""
    radius, around, along = 0.2, 1.5, 2.0
    free = replace(in_a_bore(radius, [0.0, 0.0, -radius], velocity=[around, along, 0.0]), loads={})
    found = simulate_assembled(free, one_phase(0.1), Settings(step=2e-5, record_every=20, watch=("mass",)))
    late = slice(5, None)
    assert found.normal_force[late, 0] == pytest.approx(around**2 / radius, rel=1e-6)
    position = np.array([0.0, 0.0, -radius]) + found.displacement[:, 0]
    assert found.velocity[late, 0, 1] == pytest.approx(along, rel=1e-9)
    assert np.hypot(position[:, 0], position[:, 2]) == pytest.approx(radius, rel=1e-6)
    assert np.linalg.norm(found.velocity[late, 0], axis=1) == pytest.approx(math.hypot(around, along), rel=1e-6)
    slowed = replace(in_a_bore(radius, [0.0, 0.0, -radius], velocity=[around, along, 0.0], mu=0.2), loads={})
    found = simulate_assembled(slowed, one_phase(0.1), Settings(step=2e-5, record_every=20, watch=("mass",)))
    answer = scipy.integrate.solve_ivp(
        lambda _, v: -0.2 * v[0] ** 2 / radius * v / np.linalg.norm(v), (0, 0.1), [around, along], rtol=1e-10,
        t_eval=found.time[late],
    ).y
    assert found.velocity[late, 0, 1] == pytest.approx(answer[1], rel=1e-4)


def test_a_bore_is_not_left_by_what_renewals_leave():
    """Two and a half times round: offsets that did not fade would add up to 1e-9 of the radius."""
    free = replace(in_a_bore(0.09, [0.0, 0.0, -0.09], velocity=[1.5, 0.0, 0.0]), loads={})
    found = simulate_assembled(free, one_phase(1.0), Settings(step=2e-4, record_every=20, watch=("mass",)))
    place = np.array([0.0, 0.0, -0.09]) + found.displacement[:, 0]
    assert np.abs(np.hypot(place[:, 0], place[:, 2]) / 0.09 - 1.0).max() < 1e-10


def in_a_meshed_bore(radius, facets, *, angle=0.0, velocity=(0.0, 0.0, 0.0)):
    """A point mass of 1 kg in a bore along y of so many linear facets around, off the middle of their length."""
    from stridor.contact.facets import FacetSurface

    around = 2 * np.pi * np.arange(facets) / facets
    points = radius * np.array([[math.cos(t), y, math.sin(t)] for y in (-0.2, 0.2) for t in around])
    quads = np.array([[k, (k + 1) % facets, facets + (k + 1) % facets, facets + k] for k in range(facets)])
    master = FacetSurface.from_facets(points, {"quad": quads}, where="contacts.bore.master")
    assert master.locate(np.array([[0.5 * radius, 0.0, 0.0]])).gap[0] > 0, "it faces inwards"
    rows = Rows(sp.csr_array(np.eye(3)), np.zeros((3, 0)))
    start = radius * np.array([math.sin(angle), 0.03, -math.cos(angle)])
    contact = pair_surface(
        "bore", where="contacts.bore", slave=rows, slave_position=start[None], area=np.ones(1),
        slave_normals=np.zeros((1, 3)), master=master,
        master_rows=Rows(sp.csr_array((3 * len(points), 3)), np.zeros((3 * len(points), 0))),
        drift=np.zeros((1, 3, 0)), adjust=True, stiffness_per_area=np.inf, law=Coulomb(0.0), sliding="finite",
    )  # fmt: skip
    system = replace(masses(mass=1.0), surfaces=(contact,), points={"mass": rows})
    return replace(system, initial_velocity=np.array(velocity))


@pytest.mark.parametrize("facets", [24, pytest.param(96, marks=pytest.mark.slow)])
def test_linear_facets_press_as_the_curve_does_whatever_the_step(facets):
    """The polygon has edges; offsets that faded over steps followed it, by blows of up to 260 times the force."""
    radius, angle, off = 0.09, 1.0, []
    system = in_a_meshed_bore(radius, facets, angle=angle)
    answer = scipy.integrate.solve_ivp(
        lambda _, y: [y[1], -GRAVITY / radius * math.sin(y[0])], (0, 0.05), [angle, 0.0], rtol=1e-10, dense_output=True
    ).sol
    for step in (1e-4, 2.5e-5):
        found = simulate_assembled(system, one_phase(0.04), Settings(step=step, record_every=1, watch=("mass",)))
        theta, rate = answer(found.time)
        true = GRAVITY * np.cos(theta) + radius * rate**2
        settled = found.time > 0.005
        assert found.normal_force[settled].min() > 0.0
        off.append(np.sqrt(np.mean((found.normal_force[settled, 0] - true[settled]) ** 2)) / true.max())
    assert max(off) < 0.06  # 3 and 5 % of 24 facets, where blows of the edges made it 100 % and more


def test_a_point_mass_does_not_know_how_large_the_model_is():
    """It stands for no length: forces in a bore of a tenth of the size are those of the large one times ten."""
    found = []
    for radius in (0.09, 0.009):
        system = replace(in_a_meshed_bore(radius, 48, velocity=[1.5, 0.0, 0.0]), loads={})
        settings = Settings(step=2e-3 * radius, record_every=1, watch=("mass",))
        found.append(radius * simulate_assembled(system, one_phase(radius), settings).normal_force[5:, 0])
    assert found[0].min() > 0.5 * 1.5**2
    assert np.abs(found[1] / found[0] - 1.0).max() < 1e-6


def test_a_restart_stays_on_its_wall_of_a_bore():
    """To the bit, wherever round it: the search from where the node was first found ends on the far wall, a diameter
    away along the same normal."""
    system = replace(in_a_meshed_bore(0.09, 48, velocity=[1.5, 0.0, 0.0]), loads={})
    settings = Settings(step=4e-4, record_every=1, watch=("mass",))
    whole = simulate_assembled(system, one_phase(0.21), settings)
    for part in (0.14, 0.2):  # 134 and 191 degrees
        first = simulate_assembled(system, one_phase(part), settings)
        again = simulate_assembled(system, one_phase(0.21), settings, restart=first)
        assert np.array_equal(again.normal_force, whole.normal_force)
        assert np.array_equal(again.displacement, whole.displacement)


def test_leaving_the_master_ends_the_run(monkeypatch):
    """A node beyond an edge: what, where, when, what to do, and the motion up to there."""
    from stridor.temporal.steppers.sparse import renewal

    system = finite(floor(masses(), positions=[[0.0, 0, 0]], freedoms=[[0, 1, 2]], law=Coulomb(0.0)))
    system = replace(system, initial_velocity=np.array([1.0, 0.0, 0.0]))
    inner = renewal.found_again

    def with_an_edge(surface, slave, master):
        new, _ = inner(surface, slave, master)
        return new, np.flatnonzero(slave[:, 0] > 0.1)

    monkeypatch.setattr(renewal, "found_again", with_an_edge)
    with pytest.raises(AnalysisError, match=r"contact floor: the slave node at \(0, 0, 0\) left .* t = 0.1") as caught:
        run(system, 1.0, step=1e-3)
    assert "make the master larger" in str(caught.value)
    left = caught.value.trajectory
    assert left.interrupted
    assert left.time[-1] == pytest.approx(0.1, rel=0.02)


def test_renewed_rows_go_on_with_the_gap_and_turn_the_friction_force():
    """take_over: the gap a closed node was left at, over the curved master, stays what the loop sees; its force in space
    stays what it was."""
    rng = np.random.default_rng(8)
    m, n, p = 4, 9, 1

    def nodes(tangents):
        return SimpleNamespace(
            gap=rng.standard_normal(m), normal=sp.csr_array(rng.standard_normal((m, n))),
            normal_lift=rng.standard_normal((m, p)), tangents=tangents, count=m, directions=2,
            tangent=sp.csr_array(rng.standard_normal((2 * m, n))), tangent_lift=rng.standard_normal((2 * m, p)),
        )  # fmt: skip

    frame = np.tile(np.eye(3)[:2], (m, 1, 1))
    angle = np.radians([10.0, 35.0, -80.0, 170.0])
    turned = np.stack([[[np.cos(a), np.sin(a), 0], [-np.sin(a), np.cos(a), 0]] for a in angle])
    old, new = nodes(frame), nodes(turned)
    force, offset = rng.standard_normal((m, 3)), rng.standard_normal(m)
    force[:, 0] = [3.0, 0.0, 2.0, 1.0]
    force[1] = 0.0
    before, offset_before, given = force.copy(), offset.copy(), []
    u, x = rng.standard_normal(n), rng.standard_normal(p)
    radius, way = 3.0, np.array([0.3, -0.2, 0.0, 0.1])
    along = np.array([0.6, 0.8])  # round a bore
    reached = (old.tangent @ u + old.tangent_lift @ x).reshape(m, 2)
    machine = SimpleNamespace(
        nodes=old, contacts=SimpleNamespace(force=force, offset=offset), displacement=u,
        state=SimpleNamespace(motion=[x]), set_nodes=lambda *args: given.extend(args), surfaces=None,
        turning=replace(
            Turning.none(old), rate=np.tile(-np.outer(along, along) / radius, (m, 1, 1)),
            place=reached - way[:, None] * along,
        ),
    )  # fmt: skip
    turns = Turning.none(new)
    take_over(machine, ("new",), new, turns)
    assert given == [new, turns]
    assert machine.surfaces == ("new",)

    def height(of):
        return of.gap + of.normal @ u + of.normal_lift @ x

    closed, cosine = before[:, 0] > 0, np.sqrt(1 - (way / radius) ** 2)
    # In a bore: less than over the tangent plane by how far the circle has come up.
    left = cosine * (height(old) - (radius - np.sqrt(radius**2 - way**2))) + offset_before
    np.testing.assert_allclose((height(new) + offset)[closed], left[closed], rtol=1e-12, atol=1e-12)
    assert offset[~closed] == offset_before[~closed]
    in_space = np.einsum("mk,mkd->md", force[:, 1:], turned)
    np.testing.assert_allclose(in_space[:, :2], before[:, 1:], rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(force[:, 0], before[:, 0])

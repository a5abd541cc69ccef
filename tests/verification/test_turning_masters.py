"""Masters that turn themselves under what slides on them, in time: against equations of motion of their own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.integrate
import scipy.sparse as sp

import stridor as st
from marching import one_phase, simulate_assembled
from stridor.contact.curve import Curve
from stridor.contact.facets import FacetSurface
from stridor.contact.interface import Rows
from stridor.contact.joined import Joined
from stridor.contact.pairing import pair_surface
from stridor.laws import Coulomb
from stridor.system import System
from stridor.system.model import PrescribedMotion
from stridor.temporal.settings import Settings
from stridor.temporal.simulate import simulate

pytestmark = pytest.mark.verification

GRAVITY = 9.81
MASS, INERTIA, STIFFNESS = 1.0, 0.05, 200.0
START = np.array([0.05, -0.03])  # m, of the bead on the plate
SPEED = np.array([1.0, 0.4])
TILT = np.array([0.5, -0.3])  # rad/s


def plate(dimension):
    """Nodes (k, d) of a flat 1 m wide, and the surface that they make."""
    x = np.linspace(0.5, -0.5, 11)
    if dimension == 2:
        positions = np.column_stack([x, 0 * x])
        lines = np.column_stack([np.arange(10), np.arange(1, 11)])
        return positions, Curve.from_facets(positions, {"line": lines}, where="plate")
    grid = np.arange(121).reshape(11, 11)
    positions = np.array([[a, b, 0.0] for a in x for b in x])
    quads = np.stack([grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]], axis=-1).reshape(-1, 4)
    return positions, FacetSurface.from_facets(positions, {"quad": quads}, where="plate")


def rocking(dimension, *, friction=0.0, damping=None, area=0.1, sliding=1.0, swing=1.0, apart=0.0) -> System:
    """A bead, its d coordinates, on a plate that turns on a pivot by d − 1 angles, held by springs. apart [m]: it has two
    feet so far apart which are one node of the contact."""
    d, size = dimension, 2 * dimension - 1
    positions, master = plate(d)
    on_plate = sp.lil_array((d * len(positions), size))
    for j in range(d - 1):
        on_plate[d - 1 :: d, d + j] = positions[:, [j]]
    bead = Rows(sp.csr_array(sp.eye_array(d, size)), np.zeros((d, 0)))
    tilts = Rows(sp.csr_array(sp.eye_array(size))[d : 2 * d], np.zeros((d - 1, 0)))
    tilts = Rows(sp.csr_array(sp.vstack([tilts.free, sp.csr_array((1, size))])), np.zeros((d, 0)))
    start = np.append(START[: d - 1], 0.0)
    contact = pair_surface(
        "plate", where="contacts.plate", slave=bead, slave_position=start[None], slave_normals=np.zeros((1, d)),
        area=np.full(1, area), master=master, master_rows=Rows(sp.csr_array(on_plate), np.zeros((d * len(positions), 0))),
        drift=np.zeros((1, d, 0)), stiffness_per_area=np.inf, law=Coulomb(friction), sliding="finite", adjust=True,
    )  # fmt: skip
    if apart:
        contact = on_two_feet(contact, apart)
    mass = np.diag([*[MASS] * d, *[INERTIA] * (d - 1)])
    held = np.diag([*[0.0] * d, *[STIFFNESS] * (d - 1)])
    weight = np.zeros(size)
    weight[d - 1] = -MASS * GRAVITY
    speed, tilt = sliding * SPEED[: d - 1], swing * TILT[: d - 1]
    return System(
        mass, np.zeros((size, size)) if damping is None else damping, held, (), {"weight": weight},
        surfaces=(contact,), points={"bead": bead, "tilt": tilts}, dimension=d,
        initial_velocity=np.concatenate([speed, [tilt @ START[: d - 1]], tilt]),
    )  # fmt: skip


def on_two_feet(contact, apart):
    """The contact of a point with that of two beside it in its place, as parts of one node."""
    d = contact.slave_position.shape[1]
    slave = Rows(sp.csr_array(sp.vstack([contact.slave.free] * 2)), np.zeros((2 * d, 0)))
    two = pair_surface(
        "plate", where="contacts.plate", slave=slave, slave_normals=np.zeros((2, d)), area=0.5 * contact.area.repeat(2),
        slave_position=contact.slave_position + 0.5 * apart * np.outer([-1.0, 1.0], np.eye(d)[0]),
        master=contact.master, master_rows=contact.master_rows, drift=np.zeros((2, d, 0)), stiffness_per_area=np.inf,
        law=contact.law, sliding="finite", adjust=True,
    )  # fmt: skip
    one = Joined(np.zeros(2, dtype=np.int64), np.stack([np.eye(d)] * 2), np.zeros(0, dtype=np.int64))
    return replace(two, joined=one, nodes=one.nodes(two.nodes))


def truth(system, duration):
    """Coordinates and velocities over time, and the normal force at such states: M q̈ + C q̇ + K q = f + GᵀL with
    Φ = z − Σ α_j x_j = 0, so that G q̈ = 2 Σ α̇_j ẋ_j."""
    d, size = system.dimension, system.size
    weight = system.loads["weight"]
    mass, damping, stiffness = (np.asarray(part.todense()) for part in (system.mass, system.damping, system.stiffness))

    def solved(y):
        q, v = y[:size], y[size:]
        row = np.concatenate([-q[d:], [1.0], -q[: d - 1]])
        whole = np.block([[mass, -row[:, None]], [row[None], np.zeros((1, 1))]])
        place = np.append(q[: d - 1] - START[: d - 1], np.zeros(size - d + 1))
        springs = stiffness @ np.concatenate([place[: d - 1], q[d - 1 :]])
        return np.linalg.solve(whole, np.append(weight - damping @ v - springs, 2.0 * v[d:] @ v[: d - 1]))

    begin = np.concatenate([START[: d - 1], np.zeros(d), system.initial_velocity])
    way = scipy.integrate.solve_ivp(
        lambda _, y: np.concatenate([y[size:], solved(y)[:size]]), (0, duration), begin,
        rtol=1e-11, atol=1e-12, dense_output=True,
    ).sol  # fmt: skip
    return way, lambda y: solved(y)[size] * np.sqrt(1.0 + y[d:size] @ y[d:size])


def off(system, duration, step, path="assembled"):
    """The largest error of the normal force after the first millisecond, as a part of its mean, and that of the tilt
    at the end [rad]."""
    found = simulate(
        system, one_phase(duration), Settings(step=step, record_every=1, watch=("bead", "tilt"), path=path)
    )
    way, force = truth(system, duration)
    true = np.array([force(way(t)) for t in found.time])
    settled, d = found.time > 1e-3, system.dimension
    tilt = found.displacement[-1, 1, : d - 1] - way(found.time[-1])[d : 2 * d - 1]
    return np.abs(found.normal_force[settled, 0] - true[settled]).max() / true.mean(), np.abs(tilt).max()


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_bead_on_a_rocking_plate_shows_no_blows(dimension):
    """Normals that turned with the plate at renewals only had the Coriolis force as one blow each time, of the size of
    the force at 1e-5 s, four times that at 2.5e-6 s."""
    system = rocking(dimension)
    errors, tilts = zip(*(off(system, 0.02, step) for step in (4e-5, 1e-5, 2.5e-6)), strict=True)
    assert max(errors) < 1e-6
    assert max(tilts[1] / tilts[0], tilts[2] / tilts[1]) < 0.08  # of second order
    assert tilts[1] < 1e-9


def test_a_bead_on_a_rocking_plate_whose_damping_couples_all():
    """The same where every step is solved with a matrix."""
    root = np.array([[0.5, 0.1, 0.02], [0.0, 0.4, 0.03], [0.0, 0.0, 0.05]])
    system = rocking(2, damping=root.T @ root)
    errors = [off(system, 0.02, step, path="nodal")[0] for step in (4e-5, 1e-5)]
    assert errors[0] < 3e-6
    assert errors[1] < 0.4 * errors[0]


def turned_by_a_support(rate, unit=1.0):
    """A bead on a plate that a support turns at a steady rate [rad/s], its motion counted in so many radians."""
    none = np.zeros((2, 1))
    positions, master = plate(2)
    lift = np.zeros((2 * len(positions), 1))
    lift[1::2, 0] = unit * positions[:, 0]
    bead = Rows(sp.csr_array(sp.eye_array(2)), none)
    contact = pair_surface(
        "plate", where="contacts.plate", slave=bead, slave_position=np.array([[START[0], 0.0]]),
        slave_normals=np.zeros((1, 2)), area=np.full(1, 0.1), master=master,
        master_rows=Rows(sp.csr_array((len(lift), 2)), lift), drift=np.zeros((1, 2, 1)), stiffness_per_area=np.inf,
        law=Coulomb(0.0), sliding="finite", adjust=True,
    )  # fmt: skip
    one = np.full((1, 1), unit)
    return System(
        MASS * np.eye(2), np.zeros((2, 2)), np.zeros((2, 2)), (), {"weight": np.array([0.0, -MASS * GRAVITY])},
        surfaces=(contact,), points={"bead": bead}, dimension=2,
        motion=PrescribedMotion(("turn",), none, none, none, one, one, one),
        initial_velocity=np.array([SPEED[0], rate * START[0]]),
    )  # fmt: skip


def test_a_bead_on_a_plate_that_a_support_turns():
    """At a steady rate Ω: the plate is at y = Ω t x, and m ẍ = −Ω t L, m (Ω t ẍ + 2 Ω ẋ) = L − m g."""
    rate = 0.8
    system = turned_by_a_support(rate)

    def solved(t, y):
        slope = rate * t
        force = (GRAVITY + 2.0 * rate * y[1]) * MASS / (1.0 + slope**2)
        return -slope * force / MASS, force * np.sqrt(1.0 + slope**2)

    way = scipy.integrate.solve_ivp(
        lambda t, y: [y[1], solved(t, y)[0]], (0, 0.02), [START[0], SPEED[0]], rtol=1e-11, atol=1e-12, dense_output=True
    ).sol
    for step in (4e-5, 1e-5):
        settings = Settings(step=step, record_every=1, watch=("bead",))
        found = simulate_assembled(system, one_phase(0.02, velocities={"turn": rate}), settings)
        true = np.array([solved(t, way(t))[1] for t in found.time])
        settled = found.time > 1e-3
        np.testing.assert_allclose(found.normal_force[settled, 0], true[settled], rtol=5e-6)


def test_a_restart_counts_the_support_s_way_in_another_unit():
    """Twice the unit at half the factor is the same motion, from the way gone so far on."""
    rate, settings = 0.8, Settings(step=1e-5, record_every=1, watch=("bead",))
    whole = simulate_assembled(turned_by_a_support(rate), one_phase(0.02, velocities={"turn": rate}), settings)
    first = simulate_assembled(turned_by_a_support(rate), one_phase(0.0153, velocities={"turn": rate}), settings)
    again = simulate_assembled(
        turned_by_a_support(rate, 2.0), one_phase(0.02, velocities={"turn": rate / 2.0}), settings, restart=first,
        changed=True,
    )  # fmt: skip
    np.testing.assert_allclose(again.normal_force, whole.normal_force, rtol=1e-9)


def test_a_node_of_two_parts_turns_with_the_plate_as_one():
    """As where a body repeats: the mean of both has its lever half way between them."""
    assert off(rocking(3, apart=0.04), 0.02, 1e-5)[0] < 1e-6


def test_what_sticks_to_a_rocking_plate_is_held_along_its_normal():
    """Nothing slides, so that rows are renewed for the turning alone: the force of the rider is that of its weight and
    inertia, along the normal and tangent of the plate as it is then."""
    system = rocking(2, friction=0.9, sliding=0.0, swing=4.0)
    found = simulate_assembled(system, one_phase(0.1), Settings(step=2e-5, record_every=1, watch=("bead", "tilt")))
    total = INERTIA + MASS * START[0] ** 2
    rate = np.sqrt(STIFFNESS / total)
    lag = GRAVITY * MASS * START[0] / STIFFNESS  # the tilt that the weight stands for
    angle = lag * (np.cos(rate * found.time) - 1.0) + system.initial_velocity[2] / rate * np.sin(rate * found.time)
    upward = MASS * (GRAVITY - rate**2 * START[0] * (angle + lag))
    settled, slope = found.time > 1e-3, np.arctan(angle)
    assert np.ptp(slope) > 0.04
    np.testing.assert_allclose(found.displacement[:, 1, 0], angle, rtol=0.0, atol=1e-7)
    np.testing.assert_allclose(found.normal_force[settled, 0], (upward * np.cos(slope))[settled], rtol=0.0, atol=3e-4)
    np.testing.assert_allclose(found.tangential_force[settled, 0], (upward * np.sin(slope))[settled], rtol=0.0, atol=3e-4)


@pytest.mark.parametrize("part", [0.0101, 0.0153])
def test_a_restart_between_two_renewals_turns_on_as_before(part):
    """To the bit."""
    system, settings = rocking(3, friction=0.1), Settings(step=1e-5, record_every=1, watch=("bead",))
    whole = simulate_assembled(system, one_phase(0.02), settings)
    first = simulate_assembled(system, one_phase(part), settings)
    again = simulate_assembled(system, one_phase(0.02), settings, restart=first)
    assert np.array_equal(again.normal_force, whole.normal_force)
    assert np.array_equal(again.displacement, whole.displacement)


# -- masters whose material turns, while what slides on them moves over them ---------------------------------------------
RADIUS, PRESS, SPRING, SPIN = 2.0, 1.0, 1.0, 0.5


def bead_in_a_drum(step, *, inside=True, friction=0.0, spin=SPIN):
    """A bead on a spring, pressed into a drum or onto it, whose material turns under it."""
    sliding = f"sliding = {{{{ spin = {spin}, centre = [0.0, {{y}}] }}}}" if spin else ""
    y = RADIUS if inside else -RADIUS
    return st.loads(f"""
        units = "nondimensional"
        bodies.bead = {{ type = "mass", mass = 1.0, position = [0.0, 0.0], initial_velocity = [0.02, 0.0] }}
        springs.k = {{ between = ["bead", "ground"], direction = [1.0, 0.0], stiffness = {SPRING} }}
        loads.press = {{ at = "bead", force = [0.0, {-PRESS}] }}
        temporal = {{ step = {step}, record_every = {round(0.04 / step)}, watch = ["bead"] }}
        modal.max_frequency_hz = 0.5
        phases = [{{ name = "run", duration = 20.0 }}]
        [bodies.drum]
        type = "obstacle"
        shape = "cylinder"
        point = [0.0, {y}]
        radius = {RADIUS}
        inside = {str(inside).lower()}
        {sliding.format(y=y)}
        [contacts.rub]
        slave = "bead"
        master = "drum"
        stiffness = "rigid"
        sliding = "finite"
        friction = {{ law = "coulomb", coefficient = {friction} }}
    """)


def bead_by_its_angle(inside, friction):
    """x and the normal force over time, of the angle φ from where the bead begins: m R φ̈ = (−k x, −p)·t + μ L t·w."""
    side = 1.0 if inside else -1.0  # the centre is above in a bore, below a shaft
    along = side  # the material under the bead goes towards +x in a bore and towards −x on a shaft

    def forces(y):
        angle, rate = y
        x, tangent = RADIUS * np.sin(angle), np.array([np.cos(angle), side * np.sin(angle)])
        normal = np.array([-side * np.sin(angle), np.cos(angle)])
        given = np.array([-SPRING * x, -PRESS])
        pressed = side * RADIUS * rate**2 - given @ normal
        return given @ tangent + along * friction * pressed, pressed

    way = scipy.integrate.solve_ivp(
        lambda _, y: [y[1], forces(y)[0] / RADIUS], (0, 20.0), [0.0, 0.02 / RADIUS], rtol=1e-11, atol=1e-13,
        dense_output=True,
    ).sol  # fmt: skip
    return lambda t: (RADIUS * np.sin(way(t)[0]), forces(way(t))[1])


@pytest.mark.parametrize("inside", [True, False])
@pytest.mark.parametrize("friction", [0.0, 0.1])
def test_material_that_turns_neither_feeds_nor_damps_what_moves_over_it(inside, friction):
    """Rows that stayed for 200 steps let a frictionless bead grow in a turning bore and decay on a turning shaft, by
    50 Δt p/(m R): 0.1 1/s at a step of 4e-3 s, e² of the amplitude over this run."""
    true = bead_by_its_angle(inside, friction)
    for step, close in ((8e-3, 4e-4), (2e-3, 3e-5)):
        found = st.simulate(bead_in_a_drum(step, inside=inside, friction=friction))
        x, force = np.array([true(t) for t in found.time]).T
        size = np.ptp(x)
        np.testing.assert_allclose(found.displacement[:, 0, 0], x, rtol=0.0, atol=close * size)
        np.testing.assert_allclose(found.normal_force[1:, 0], force[1:], rtol=0.0, atol=close)


def test_without_friction_it_does_not_matter_that_material_turns():
    still, turning = (st.simulate(bead_in_a_drum(8e-3, spin=spin)) for spin in (0.0, SPIN))
    np.testing.assert_allclose(turning.displacement, still.displacement, rtol=0.0, atol=1e-13)
    np.testing.assert_allclose(turning.normal_force, still.normal_force, rtol=1e-9)


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_rocking_plate_whose_material_slides_shows_no_blows(dimension):
    """Without friction the force is that of a plate at rest; with friction it is another and smooth."""
    system = rocking(dimension)
    moving, motion = drifting(system), {"belt": 3.0}
    settings = Settings(step=1e-5, record_every=1, watch=("bead", "tilt"))
    found = simulate_assembled(moving, one_phase(0.02, velocities=motion), settings)
    way, force = truth(system, 0.02)
    true, settled = np.array([force(way(t)) for t in found.time]), found.time > 1e-3
    assert np.abs(found.normal_force[settled, 0] - true[settled]).max() < 1e-6 * true.mean()
    rubbed = simulate_assembled(drifting(rocking(dimension, friction=0.3)), one_phase(0.02, velocities=motion), settings)
    pulls = np.abs(rubbed.tangential_force[settled, 0]) / rubbed.normal_force[settled, 0]
    assert pulls.min() > 0.29
    assert pulls.max() < 0.3 * (1.0 + 1e-12)
    assert np.abs(np.diff(rubbed.normal_force[settled, 0], 2)).max() < 1e-6 * true.mean()


def drifting(system):
    """The same with a plate whose material slides along x."""
    size, d = system.size, system.dimension
    none, (contact,) = np.zeros((size, 1)), system.surfaces

    def wider(rows):
        return Rows(rows.free, np.zeros((rows.free.shape[0], 1)))

    drift = np.zeros((1, d, 1))
    drift[0, 0, 0] = -1.0
    moved = pair_surface(
        "plate", where="contacts.plate", slave=wider(contact.slave), slave_position=contact.slave_position,
        slave_normals=np.zeros((1, d)), area=contact.area, master=contact.master, drift=drift, law=contact.law,
        master_rows=wider(contact.master_rows), stiffness_per_area=np.inf, sliding="finite", adjust=True,
    )  # fmt: skip
    own = np.zeros((1, 1))
    return replace(
        system, surfaces=(moved,), motion=PrescribedMotion(("belt",), none, none, none, own, own, own),
        points={name: wider(rows) for name, rows in system.points.items()},
    )  # fmt: skip


@pytest.mark.parametrize("part", [0.0101, 0.0153])
def test_a_restart_on_sliding_material_goes_on_as_before(part):
    """To the bit."""
    system, motion = drifting(rocking(3, friction=0.1)), {"belt": 3.0}
    settings = Settings(step=1e-5, record_every=1, watch=("bead",))
    whole = simulate_assembled(system, one_phase(0.02, velocities=motion), settings)
    first = simulate_assembled(system, one_phase(part, velocities=motion), settings)
    again = simulate_assembled(system, one_phase(0.02, velocities=motion), settings, restart=first)
    assert np.array_equal(again.normal_force, whole.normal_force)
    assert np.array_equal(again.displacement, whole.displacement)


def test_a_bead_is_dragged_along_until_it_turns_with_the_drum():
    """Without weight: m R φ̈ = μ m R φ̇², φ = −ln(1 − μ φ̇₀ t)/μ up to φ̇ = Ω. With the velocity of the material where
    the bead began it turned round at a quarter of a turn."""
    case = st.loads("""
        units = "nondimensional"
        bodies.bead = { type = "mass", mass = 1.0, position = [0.0, 0.0], initial_velocity = [1.0, 0.0] }
        temporal = { step = 1e-3, record_every = 10, watch = ["bead"] }
        modal.max_frequency_hz = 0.5
        phases = [{ name = "run", duration = 3.0 }]
        [bodies.drum]
        type = "obstacle"
        shape = "cylinder"
        point = [0.0, 1.0]
        radius = 1.0
        inside = true
        sliding = { spin = 2.0, centre = [0.0, 1.0] }
        [contacts.rub]
        slave = "bead"
        master = "drum"
        stiffness = "rigid"
        sliding = "finite"
        friction = { law = "coulomb", coefficient = 0.3 }
    """)
    found = st.simulate(case)
    angle = np.unwrap(np.arctan2(found.displacement[:, 0, 0], 1.0 - found.displacement[:, 0, 1]))
    mu, spin = 0.3, 2.0
    together = (1.0 - 1.0 / spin) / mu  # when φ̇ = φ̇₀/(1 − μ φ̇₀ t) is Ω
    true = np.where(
        found.time < together, -np.log(np.maximum(1.0 - mu * found.time, 1.0 / spin)) / mu,
        np.log(spin) / mu + spin * (found.time - together),
    )  # fmt: skip
    np.testing.assert_allclose(angle, true, rtol=0.0, atol=1e-4)
    assert angle[-1] > 4.5


TURNS, RUBS = 3.0, 0.2  # rad/s, of a turntable; its friction


def on_a_turntable(**other):
    """x (2,) of a bead on a turntable over time: ẍ = μ g w/|w| with w = Ω × (x − u) + u̇ − ẋ, u (2,) where its axis is."""
    axis = other.get("axis", np.zeros(2))

    def rates(t, y):
        x, v = y[:2] - axis * t, y[2:] - axis
        slip = TURNS * np.array([-x[1], x[0]]) - v
        return np.append(y[2:], RUBS * GRAVITY * slip / np.linalg.norm(slip))

    return scipy.integrate.solve_ivp(
        rates, (0.0, 0.12), [0.05, -0.03, 1.0, 0.4], rtol=1e-10, atol=1e-11, dense_output=True
    ).sol  # fmt: skip


def turntable(axis):
    """A bead on a plate of facets whose material turns about the middle, and which a support moves by ``axis`` [m/s]."""
    system = rocking(3, friction=RUBS, swing=0.0)
    (contact,) = system.surfaces
    bead, none = Rows(sp.csr_array(sp.eye_array(3)), np.zeros((3, 2))), np.zeros((3, 2))
    lift = np.zeros((contact.master_rows.free.shape[0], 2))
    lift[0::3, 1], lift[1::3, 1] = axis
    turn, drift = np.zeros((3, 3, 2)), np.zeros((1, 3, 2))
    turn[:2, :2, 0] = TURNS * np.array([[0.0, -1.0], [1.0, 0.0]])
    drift[0, :, 0] = -turn[:, :, 0] @ contact.slave_position[0]
    moved = pair_surface(
        "plate", where="contacts.plate", slave=bead, slave_position=contact.slave_position,
        slave_normals=np.zeros((1, 3)), area=contact.area, master=contact.master, drift=drift, turn=turn, law=contact.law,
        master_rows=Rows(sp.csr_array((len(lift), 3)), lift), stiffness_per_area=np.inf, sliding="finite", adjust=True,
    )  # fmt: skip
    own = np.zeros((2, 2))
    return System(
        np.eye(3), np.zeros((3, 3)), np.zeros((3, 3)), (), {"weight": np.array([0.0, 0.0, -GRAVITY])}, surfaces=(moved,),
        points={"bead": bead}, dimension=3, initial_velocity=np.array([1.0, 0.4, 0.0]),
        motion=PrescribedMotion(("spin", "way"), none, none, none, own, own, own),
    )  # fmt: skip


@pytest.mark.parametrize("axis", [(0.0, 0.0), (0.3, -0.2)])
def test_friction_on_a_turntable_is_that_of_the_place_where_a_bead_is(axis):
    """Also where the turntable itself is moved: what counts is the place on it, and behind a restart as before."""
    way = on_a_turntable(axis=np.array(axis))
    motion = {"spin": 1.0, "way": 1.0}
    settings = Settings(step=1e-4, record_every=10, watch=("bead",))
    found = simulate_assembled(turntable(axis), one_phase(0.12, velocities=motion), settings)
    true = np.array([way(t)[:2] for t in found.time]) - START
    np.testing.assert_allclose(found.displacement[:, 0, :2], true, rtol=0.0, atol=2e-4 * np.abs(true).max())
    if not any(axis):
        return
    first = simulate_assembled(turntable(axis), one_phase(0.0601, velocities=motion), settings)
    again = simulate_assembled(turntable(axis), one_phase(0.12, velocities=motion), settings, restart=first)
    assert np.array_equal(again.displacement, found.displacement)

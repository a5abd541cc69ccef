"""Impact, stick and slip in time against closed forms, on small systems made by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from benches import Slave, bench
from marching import belt_motion, block_on_belt, points_of, rod, run, touch
from stridor.laws import Coulomb, StaticKinetic, Weakening
from stridor.sliding import steady_sliding
from stridor.system import System
from stridor.temporal.beta2 import step_limit

pytestmark = pytest.mark.verification

OPEN, STICK, SLIP = 0, 1, 2


def struck(record, name="normal_force"):
    """Time of the first and of the last record with a force, and the mean force between."""
    force = record.normal_force[:, 0]
    pressed = np.flatnonzero(force > 0)
    first, last = record.time[pressed[0]], record.time[pressed[-1]]
    impulse = float(np.sum(force) * record.sampling)
    return first, last, impulse / (last - first)


def bar_on_wall(length, area, modulus, density, gap, speed, *, lumped, elements=200):
    """A bar that flies at ``speed`` towards a wall ``gap`` away; its last node meets it. A side freedom
    carries the slip."""
    mass, stiffness = rod(length, area, modulus, density, elements, lumped=lumped)
    n = elements + 1
    whole = [np.pad(m, (0, 1)) for m in (mass, stiffness)]
    whole[0][n, n] = mass.sum()
    normal, tangent = np.zeros(n + 1), np.zeros(n + 1)
    normal[n - 1], tangent[n] = -1.0, 1.0
    system = System(
        whole[0], np.zeros((n + 1, n + 1)), whole[1], (touch(normal, tangent, gap=gap, law=Coulomb(0.2)),),
        points=points_of(n + 1, free=0, tip=n - 1),
    )  # fmt: skip
    velocity = np.zeros(n + 1)
    velocity[:n] = speed
    step = 0.5 * step_limit(system, 0.5).step
    wave = math.sqrt(modulus / density)
    end = gap / speed + 4 * length / wave
    return run(system, end, step=step, start=(0.0, velocity, 0.0), watch=("free", "tip")), mass.sum(axis=0)


@pytest.mark.parametrize("lumped", [False, True])
@pytest.mark.parametrize(
    ("length", "area", "modulus", "density", "gap", "speed"),
    [(0.2, 4e-4, 200e9, 8000.0, 2e-3, 100.0), (10.0, 1.0, 900.0, 1.0, 5.0, 10.0)],
    ids=["code_aster SDNV100", "Doyen, Ern and Piperno 2011"],
)
def test_bar_against_a_wall(length, area, modulus, density, gap, speed, lumped):
    """Contact lasts 2L/c at the force A v √(Eρ); then the whole bar flies back at its speed.

    SDNV100: from 20 to 100 µs, 1.6 MN, the free end stops at 60 µs with −6 mm, rebound +100 m/s.
    Doyen et al.: contact 0.5 to 1.1667 s, 300 N, rebound 10 m/s.
    """
    result, weights = bar_on_wall(length, area, modulus, density, gap, speed, lumped=lumped)
    wave = math.sqrt(modulus / density)
    first, last, force = struck(result)
    duration = 2 * length / wave
    assert first == pytest.approx(gap / speed, abs=0.005 * duration)
    assert last - first == pytest.approx(duration, rel=0.01)
    assert force == pytest.approx(area * speed * math.sqrt(modulus * density), rel=0.01)
    # The free end stops when the wave arrives there, and has gone on until then.
    turn = result.time[np.argmax(result.displacement[:, 0, 0])]
    assert turn == pytest.approx(gap / speed + length / wave, rel=0.02)
    assert result.displacement[:, 0, 0].max() == pytest.approx(gap + speed * length / wave, rel=0.01)
    # Rebound: mean velocity from where the free end is once contact is over.
    after = result.time > last + 0.2 * duration
    drift = np.polyfit(result.time[after], result.displacement[after].mean(axis=1)[:, 0], 1)[0]
    assert drift == pytest.approx(-speed, rel=0.02)
    # What the wall gave: the momentum turned round.
    assert np.sum(result.normal_force[:, 0]) * result.sampling == pytest.approx(
        2 * speed * weights.sum(), rel=0.01
    )
    # No penetration, ever: forces at t_n make the gap at t_{n+1} admissible.
    assert result.gap.min() > -1e-12 * gap
    assert np.all(result.normal_force[result.gap[:, 0] > 1e-9 * gap] == 0.0)


def test_two_equal_rods():
    """Carpenter, Taylor and Katona 1991 (SI): 14961.4 lb for 98.658 µs, both interface nodes at half the
    speed."""
    inch, pound = 0.0254, 4.4482216152605
    length, area = 10 * inch, inch**2
    modulus, density = 30e6 * pound / inch**2, 7.3e-4 * pound / inch**4
    speed = 202.2 * inch
    elements = 200
    mass, stiffness = rod(length, area, modulus, density, elements)
    n = elements + 1
    size = 2 * n + 1
    both = [np.zeros((size, size)) for _ in range(2)]
    for whole, part in zip(both, (mass, stiffness), strict=True):
        whole[:n, :n] = part
        whole[n : 2 * n, n : 2 * n] = part
    both[0][-1, -1] = mass.sum()
    normal, tangent = np.zeros(size), np.zeros(size)
    normal[n - 1], normal[n], tangent[-1] = -1.0, 1.0, 1.0
    system = System(
        both[0], np.zeros((size, size)), both[1], (touch(normal, tangent, law=Coulomb(0.1)),),
        points=points_of(size, left=n - 1, right=n),
    )  # fmt: skip
    velocity = np.zeros(size)
    velocity[:n] = speed
    limit = step_limit(system, 0.5)
    result = run(system, 200e-6, step=0.5 * limit.step, start=(0.0, velocity, 0.0), watch=("left", "right"))
    first, last, force = struck(result)
    assert force / pound == pytest.approx(14961.4, rel=0.01)
    assert last - first == pytest.approx(98.658e-6, rel=0.01)
    pressed = (result.time > 0.1 * last) & (result.time < 0.9 * last)
    for node in (0, 1):
        travel = np.polyfit(result.time[pressed], result.displacement[pressed, node, 0], 1)[0]
        assert travel / inch == pytest.approx(101.1, rel=0.01)


@pytest.mark.parametrize("path", ["modal", "nodal"])
@pytest.mark.parametrize("beta2", [0.5, 0.6])
def test_coulomb_oscillator(path, beta2):
    """SDND100: M 1, K 1e4, μN 1 N, from 0.85e-3: extrema −0.65, 0.45, −0.25, 0.05 (×1e-3) at nπ/100, then
    stuck."""
    system = block_on_belt(stiffness=1e4, law=Coulomb(0.1), press=10.0)
    step = 2e-6 if beta2 > 0.5 else 2e-5
    result = run(
        system,
        0.2,
        step=step,
        beta2=beta2,
        path=path,
        start=([0.85e-3, 0.0], 0.0, [-7.5, 0.0]),
        watch=("block",),
    )
    u = result.displacement[:, 0, 0]
    for number, extremum in enumerate((-0.65e-3, 0.45e-3, -0.25e-3, 0.05e-3), start=1):
        at = round(number * math.pi / 100 / step)
        assert u[at] == pytest.approx(extremum, abs=2e-6)
    stuck = result.time > 4 * math.pi / 100 + 1e-3
    assert np.ptp(u[stuck]) < 1e-15
    assert np.all(result.status[stuck, 0] == STICK)
    # Held by friction at K u, within its limit.
    assert np.allclose(result.tangential_force[stuck, 0], 1e4 * u[-1], rtol=1e-9)
    assert abs(result.tangential_force[-1, 0]) < 1.0
    assert np.allclose(result.normal_force[:, 0], 10.0, rtol=1e-9)
    sliding = result.status[:, 0] == SLIP
    assert np.allclose(np.abs(result.tangential_force[sliding, 0]), 1.0, rtol=1e-12)


def test_block_is_carried_slips_and_settles_on_a_belt():
    """One coefficient: the block rides along until k x = μN, then x = μN/k + v/ω sin ω(t − t₁), caught again
    at x = μN/k.

    With m = k = 1, μN = 0.3, v = 0.2: it lets go at t = 1.5 with the belt's speed and swings ±0.2 about 0.3,
    for ever
    touching the belt's speed once a period.
    """
    system = block_on_belt(law=Coulomb(0.3), speed=0.2)
    step = 1e-4
    result = run(system, 9.0, step=step, start=([0.0, 0.0], [0.2, 0.0], 0.0), watch=("block",))
    t, x = result.time, result.displacement[:, 0, 0]
    ride = t < 1.499
    assert np.abs(x[ride] - 0.2 * t[ride]).max() < 2e-5
    assert np.all(result.status[1:][t[1:] < 1.499] == STICK)
    swing = (t > 1.5) & (t < 1.5 + 2 * math.pi - 0.05)
    assert np.abs(x[swing] - (0.3 + 0.2 * np.sin(t[swing] - 1.5))).max() < 1e-4
    assert np.all(result.status[t > 1.51][: round(6.0 / step)] == SLIP)
    # Friction points along the belt while the block is slower: its force on the block is +μN.
    assert np.allclose(result.tangential_force[swing, 0], 0.3)
    assert np.all(result.slip_speed[swing, 0] < 0)


def cycles(result):
    """Starts of sticking, after the first cycle."""
    status = result.status[:, 0]
    starts = np.flatnonzero((status[1:] == STICK) & (status[:-1] != STICK)) + 1
    ends = np.flatnonzero((status[1:] != STICK) & (status[:-1] == STICK)) + 1
    return starts, ends


def test_stick_slip_with_a_static_and_a_kinetic_coefficient():
    """m = k = N = 1, μs 0.4, μk 0.3, v 0.2: T_slip 5.355890, T_stick 1, x from 0.076393 to 0.523607."""
    drop, speed = 0.1, 0.2
    t_slip, t_stick = 2 * math.pi - 2 * math.atan(drop / speed), 2 * drop / speed
    reach = math.sqrt(drop**2 + speed**2)
    assert (t_slip, t_stick) == pytest.approx((5.355890, 1.0), abs=1e-6)
    system = block_on_belt(law=StaticKinetic(0.3, 0.4), speed=speed)
    result = run(system, 40.0, step=5e-4, watch=("block",), start=(0.0, [0.2, 0.0], 0.0))
    starts, ends = cycles(result)
    period = np.diff(starts)[1:] * result.sampling
    assert len(period) >= 3
    assert np.allclose(period, t_slip + t_stick, rtol=1e-3)
    ends = ends[ends > starts[1]]
    stick = (ends - starts[1 : 1 + len(ends)]) * result.sampling
    assert np.allclose(stick, t_stick, rtol=5e-3)
    x = result.displacement[starts[1] :, 0, 0]
    assert (x.min(), x.max()) == pytest.approx((0.3 - reach, 0.3 + reach), rel=5e-3)
    statistics = run(system, 200.0, step=5e-3, start=(0.0, [0.2, 0.0], 0.0)).phases[0].contacts["A"]
    assert statistics.stick_fraction == pytest.approx(t_stick / (t_slip + t_stick), rel=0.05)


def test_growth_under_weakening_friction():
    """m x'' + c x' + k x = N μ(v − x'): about steady sliding the growth rate is −(c + N μ'(v))/2m.

    Found here by a fit; then the block sticks once a cycle.
    """
    law = Weakening(0.2, 0.6, 0.4)
    speed, damping = 0.5, 0.1
    slope = law.slope(speed)
    growth = -(damping + slope) / 2
    assert growth > 0.05
    system = block_on_belt(law=law, speed=speed, damping=damping)
    rest = law.sliding(speed)
    result = run(system, 60.0, step=2e-3, watch=("block",), start=([rest + 1e-6, 0.0], 0.0, [-1e-6, 0.0]))
    x = result.displacement[:, 0, 0] - rest
    early = result.time < 40.0
    peaks = np.flatnonzero((x[1:-1] > x[:-2]) & (x[1:-1] > x[2:]))[1:] + 1
    peaks = peaks[early[peaks]]
    assert np.polyfit(result.time[peaks], np.log(x[peaks]), 1)[0] == pytest.approx(growth, rel=2e-3)
    # Below the speed where −N μ' = c it grows, above it dies out.
    quiet = block_on_belt(law=law, speed=1.0, damping=damping)
    assert law.slope(1.0) > -damping
    still = run(quiet, 300.0, step=1e-2, watch=("block",), start=([law.sliding(1.0) + 0.05, 0.0], 0.0, 0.0))
    assert abs(still.displacement[-1, 0, 0] - law.sliding(1.0)) < 0.05 * 0.05
    assert np.all(still.status[1:] == SLIP)
    # Grown up, it sticks once a cycle.
    late = run(system, 300.0, step=1e-2, record_every=10).status[-1000:, 0]
    assert STICK in late
    assert SLIP in late


@pytest.mark.parametrize("path", ["modal", "nodal"])
def test_redundant_contacts_are_solved_together(path):
    """A body pressed on three feet, two of them at the same place: forces are not unique, motion is. Sweeps
    are reported."""
    feet = tuple(touch([0.0, 1.0], [1.0, 0.0], law=Coulomb(0.3), name=f"F{i}") for i in range(3))
    one = block_on_belt(stiffness=4.0, law=Coulomb(0.3))
    many = replace(one, contacts=feet)
    start = ([1.0, 0.0], 0.0, [-3.7, 0.0])
    single = run(one, 10.0, step=0.01, path=path, start=start, watch=("block",))
    several = run(many, 10.0, step=0.01, path=path, start=start, watch=("block",))
    assert np.abs(single.displacement - several.displacement).max() < 1e-9
    assert np.allclose(several.normal_force.sum(axis=1), 1.0)
    assert single.most_sweeps == 1
    assert 2 <= several.most_sweeps < 100
    assert several.unconverged_steps == 0


def test_coupled_contacts_satisfy_all_laws():
    """Three slaves on one leaning master: at each record gaps, cones and slip directions are admissible
    together."""
    system = bench(
        Slave(place=0.5), Slave(place=0.52, lean_deg=-20.0), Slave(place=0.95, side=-1), angle_deg=30.0,
        velocity=0.5,
    ).with_rigid_contacts()  # fmt: skip
    result = run(system, 1e-3, record_every=1)
    assert 2 < result.most_sweeps < 500
    assert result.unconverged_steps == 0
    largest = result.normal_force.max()
    assert largest > 20.0
    assert result.normal_force.min() >= 0.0
    assert result.gap.min() > -1e-15
    pressed = result.normal_force > 0
    # A gap is that of t_{n+1}, closed where a force acts.
    assert np.abs(result.gap[pressed]).max() < 1e-14
    assert np.all(np.abs(result.tangential_force) <= 0.1 * result.normal_force * (1 + 1e-9) + 1e-9 * largest)
    sliding = result.status == SLIP
    assert np.allclose(np.abs(result.tangential_force[sliding]), 0.1 * result.normal_force[sliding])
    assert set(np.unique(result.status)) == {OPEN, STICK, SLIP}


@pytest.mark.parametrize("path", ["modal", "nodal"])
@pytest.mark.parametrize(("velocity", "stiffness"), [(0.0, 1e7), (0.02, "rigid")])
def test_settles_at_the_static_solution(path, velocity, stiffness):
    """Damped well, without friction: displacements of the static contact problem, force of the load."""
    damping = (1.2e3, 0.0)
    slave = Slave(damping=damping, elements=3, stiffness=stiffness)
    system = bench(slave, elements=6, damping=damping, velocity=velocity)
    system = system.with_friction(0.0, np.array([abs(velocity)]))
    static = steady_sliding(system, mu=0.0)
    result = run(
        system, 0.03, path=path, ramp=2e-3, record_every=100, watch=("s0.start", "s0.end", "base.end"),
    )  # fmt: skip
    for w, name in enumerate(("s0.start", "s0.end", "base.end")):
        rows = system.points[name]
        expected = rows.free[:2] @ static.displacement
        # The ramp costs the support half its length.
        travel = rows.lift[:2] @ np.ones(len(system.motion.names)) * (result.time[-1] - 1e-3)
        assert np.allclose(result.displacement[-1, w], expected + travel, rtol=0, atol=1e-9)
    assert result.normal_force[-1, 0] == pytest.approx(20.0, rel=1e-6)


def test_open_contact_falls_and_lands():
    """A mass under a steady force, a gap above the ground: free fall for √(2 g m/F), then at rest on it."""
    system = block_on_belt(press=2.0, law=Coulomb(0.0))
    system = replace(system, contacts=(replace(system.contacts[0], gap=0.5),))
    result = run(system, 2.0, step=1e-3)
    pressed = np.flatnonzero(result.normal_force[:, 0] > 0)
    assert result.time[pressed[0]] == pytest.approx(math.sqrt(2 * 0.5 * 1.0 / 2.0), abs=2e-3)
    # A single mass does not rebound: the multiplier takes all its momentum, then holds the force.
    blow = result.normal_force[pressed[:2], 0].sum() * 1e-3
    assert blow == pytest.approx(math.sqrt(2 * 2.0 * 0.5), rel=5e-3)
    assert np.allclose(result.normal_force[pressed[2] :, 0], 2.0)
    assert result.phases[0].contacts["A"].separation_fraction == pytest.approx(math.sqrt(0.5) / 2, abs=2e-3)


def test_penetration_at_the_start_is_undone_in_one_step():
    system = block_on_belt(press=2.0, law=Coulomb(0.0))
    system = replace(system, contacts=(replace(system.contacts[0], gap=-1e-3),))
    result = run(system, 0.1, step=1e-2)
    assert result.gap[0, 0] == pytest.approx(0.0, abs=1e-15)
    assert result.normal_force[0, 0] == pytest.approx(2.0 + 1e-3 / 1e-4)


@pytest.mark.parametrize("path", ["modal", "nodal"])
def test_contact_between_points_that_cannot_move_tangentially(path):
    """A mass on a vertical guide has no tangential freedom: the normal force alone, and friction follows the
    belt."""
    one = System(
        np.eye(1), np.zeros((1, 1)), np.eye(1), (touch([1.0], [0.0], law=Coulomb(0.5)),), {"w": -np.ones(1)}
    )
    held = run(one, 5.0, step=0.1, path=path)
    assert np.allclose(held.normal_force, 1.0)
    assert np.allclose(held.tangential_force, 0.0)
    dragged = replace(
        one, motion=belt_motion(1), contacts=(touch([1.0], [0.0], law=Coulomb(0.5), slip=-0.2, motions=1),)
    )
    result = run(dragged, 5.0, step=0.1, path=path)
    assert np.allclose(result.tangential_force, 0.5)
    assert np.all(result.status == SLIP)


@pytest.mark.parametrize("path", ["modal", "nodal"])
def test_jamming_friction_holds(path):
    """μ = 1e6: what touches never slips."""
    system = bench(Slave(lean_deg=30.0, stiffness="rigid"), velocity=0.0).with_friction(1e6, np.zeros(1))
    result = run(system, 2e-3, path=path, record_every=1)
    statistics = result.phases[0].contacts["C0"]
    assert statistics.stick_fraction + statistics.separation_fraction == 1.0
    assert statistics.slip_fraction == 0.0
    assert statistics.stick_fraction > 0.5
    assert result.gap.min() > -1e-15

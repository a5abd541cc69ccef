"""Impact, stick and slip on assembled matrices in the plane, against closed forms."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp

from marching import block_on_belt, one_phase, points_of, rod, simulate_assembled, touch
from stridor.laws import Coulomb, StaticKinetic
from stridor.system import System
from stridor.temporal.energy import energy_balance
from stridor.temporal.settings import Settings
from stridor.temporal.steppers.sparse import step_limit_assembled

pytestmark = pytest.mark.verification

OPEN, STICK, SLIP = 0, 1, 2


def run(system, duration, *, start=None, velocities=None, **settings):
    settings = {"record_every": 1, **settings}
    if start is not None:
        start = tuple(np.broadcast_to(np.asarray(x, dtype=float), system.size) for x in start)
    phases = one_phase(duration, velocities=velocities)
    return simulate_assembled(system, phases, Settings(**settings), disturbance=start)


def struck(record):
    """Time of the first and of the last record with a force, and the mean force between."""
    force = record.normal_force[:, 0]
    pressed = np.flatnonzero(force > 0)
    first, last = record.time[pressed[0]], record.time[pressed[-1]]
    return first, last, float(np.sum(force) * record.sampling) / (last - first)


def bar(length, area, modulus, density, gap, speed, elements=200):
    """A bar that flies along its axis towards a wall; its last node meets it. Without a freedom across."""
    mass, stiffness = rod(length, area, modulus, density, elements, lumped=True)
    n = elements + 1
    normal = np.zeros(n)
    normal[-1] = -1.0
    return System(
        mass, np.zeros((n, n)), stiffness, (touch(normal, np.zeros(n), gap=gap),),
        points=points_of(n, **{f"node{i}": i for i in range(n)}), initial_velocity=np.full(n, speed),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("length", "area", "modulus", "density", "gap", "speed", "begin", "end", "pressure"),
    [
        (0.2, 4e-4, 200e9, 8000.0, 2e-3, 100.0, 20e-6, 100e-6, 4e9),
        (10.0, 1.0, 900.0, 1.0, 5.0, 10.0, 0.5, 1.1667, 300.0),
    ],
    ids=["code_aster SDNV100", "Doyen, Ern and Piperno 2011"],
)
def test_bar_against_a_wall(length, area, modulus, density, gap, speed, begin, end, pressure):
    system = bar(length, area, modulus, density, gap, speed)
    step = 0.5 * step_limit_assembled(system, 0.5).step
    result = run(system, 1.5 * end, step=step, watch=tuple(system.points))
    first, last, force = struck(result)
    assert first == pytest.approx(begin, abs=0.01 * (end - begin))
    assert last == pytest.approx(end, rel=0.01)
    assert force / area == pytest.approx(pressure, rel=0.01)
    middle = 0.5 * (begin + end)
    assert result.time[np.argmax(result.displacement[:, 0, 0])] == pytest.approx(middle, rel=0.02)
    after = result.time > last + 0.2 * (end - begin)
    weights = system.mass.diagonal() / system.mass.trace()
    assert result.velocity[after, :, 0] @ weights == pytest.approx(-speed, rel=0.01)
    assert result.gap.min() > -1e-12 * gap
    assert energy_balance(result).error < 1e-11


def test_two_equal_rods():
    """0.254 m, 206.8 GPa, 7801 kg/m³ at 5.136 m/s, shared equally: interface at rest, velocities exchanged, 2L/c."""
    length, modulus, density, speed = 0.254, 206.8e9, 7801.0, 5.136
    mass, stiffness = rod(length, 1e-4, modulus, density, 200, lumped=True)
    n = len(mass)
    normal = np.zeros(2 * n)
    normal[n - 1], normal[n] = -1.0, 1.0
    system = System(
        sp.block_diag([mass, mass]), np.zeros((2 * n, 2 * n)), sp.block_diag([stiffness, stiffness]),
        (touch(normal, np.zeros(2 * n)),), points=points_of(2 * n, left=n - 1, right=n),
        initial_velocity=np.repeat([speed / 2, -speed / 2], n),
    )  # fmt: skip
    wave = math.sqrt(modulus / density)
    result = run(
        system, 4 * length / wave, step=0.5 * step_limit_assembled(system, 0.5).step, watch=("left", "right")
    )
    first, last, force = struck(result)
    assert last - first == pytest.approx(2 * length / wave, rel=0.01)
    assert force == pytest.approx(0.5 * 1e-4 * speed * math.sqrt(modulus * density), rel=0.01)
    pressed = (result.time > 0.1 * last) & (result.time < 0.9 * last)
    assert np.abs(result.displacement[pressed, :2, 0]).max() < 0.01 * speed * last
    after = result.time > 1.2 * last
    for node, sign in ((0, -1), (1, 1)):
        drift = np.polyfit(result.time[after], result.displacement[after, node, 0], 1)[0]
        assert drift == pytest.approx(sign * speed / 2, rel=0.01)


def test_coulomb_oscillator():
    """SDND100: M 1, K 1e4, μN 1 N, from 0.85e-3: extrema −0.65, 0.45, −0.25, 0.05 (×1e-3) at nπ/100, then stuck."""
    system = block_on_belt(stiffness=1e4, law=Coulomb(0.1), press=10.0)
    result = run(system, 0.2, step=2e-5, watch=("block",), start=([0.85e-3, 0.0], 0.0, [-7.5, 0.0]))
    u = result.displacement[:, 0, 0]
    for n, extreme in enumerate((-0.65e-3, 0.45e-3, -0.25e-3, 0.05e-3), start=1):
        at = round(n * math.pi / 100 / result.step)
        assert u[at] == pytest.approx(extreme, abs=0.85e-6)
    stuck = result.time > 4.05 * math.pi / 100
    assert np.ptp(u[stuck]) < 1e-12
    assert np.all(result.status[stuck, 0] == STICK)
    assert energy_balance(result).error < 1e-9


def test_two_masses():
    """SDND106: 5 kg each, k 1e4, F_N 1e4 on mass 1, μs 0.3, μd 0.2, 3000 N on mass 2 for t < 0.2 s."""
    k = 1e4 * np.array([[1.0, -1.0, 0.0], [-1.0, 1.0, 0.0], [0.0, 0.0, 0.0]])
    contact = touch([0.0, 0.0, 1.0], [1.0, 0.0, 0.0], law=StaticKinetic(0.2, 0.3))
    loads = {"press": np.array([0.0, 0.0, -1e4]), "pull": np.array([0.0, 3000.0, 0.0])}
    system = System(
        5 * np.eye(3), np.zeros((3, 3)), k, (contact,), loads, points=points_of(3, first=0, second=1)
    )
    from stridor.temporal.schedule import PhaseSpec

    phases = [PhaseSpec("pull", 0.2, {}, {}), PhaseSpec("free", 0.2, {"pull": 0.0}, {})]
    step = 2e-5
    result = simulate_assembled(system, phases, Settings(step=step, record_every=1, watch=("first", "second")))
    x1, x2 = result.displacement[:, 0, 0], result.displacement[:, 1, 0]

    def at(t):
        return round(t / step)

    moving = np.flatnonzero(result.status[:, 0] == SLIP)
    assert result.time[moving[0]] == pytest.approx(0.0351241, abs=1e-4)
    assert x2[at(0.02)] == pytest.approx(0.112210, rel=2e-3)
    assert x1[at(0.15)] == pytest.approx(1.353338, rel=2e-3)
    assert x2[at(0.15)] == pytest.approx(1.807532, rel=2e-3)
    assert result.time[moving[-1]] == pytest.approx(0.314923, rel=2e-3)
    assert x2[at(0.339965)] == pytest.approx(3.968131, rel=2e-3)


def test_mass_on_a_belt():
    """μs 0.4, μk 0.3, v 0.2: period 6.355890 with 1 s of stick, x from 0.076393 to 0.523607."""
    system = block_on_belt(law=StaticKinetic(0.3, 0.4), speed=0.2)
    result = run(system, 40.0, step=1e-3, watch=("block",))
    settled = result.time > 12.0
    u, status, time = result.displacement[settled, 0, 0], result.status[settled, 0], result.time[settled]
    assert u.min() == pytest.approx(0.076393, rel=0.005)
    assert u.max() == pytest.approx(0.523607, rel=0.005)
    begin = time[1:][(status[1:] == STICK) & (status[:-1] == SLIP)]
    end = time[1:][(status[1:] == SLIP) & (status[:-1] == STICK)]
    assert np.diff(begin) == pytest.approx(6.355890, rel=0.005)
    end = end[end > begin[0]]
    assert end[: len(begin)] - begin[: len(end)] == pytest.approx(1.0, abs=0.01)
    assert energy_balance(result).error < 1e-9


def test_many_contacts_share_a_load():
    """Five feet of one rigid mass on a floor: each force may be anything, their sum and the motion may not."""
    normal = np.array([0.0, 1.0])
    contacts = tuple(touch(normal, [1.0, 0.0], law=Coulomb(0.2), name=f"foot {k}") for k in range(5))
    system = System(np.eye(2), np.zeros((2, 2)), np.zeros((2, 2)), contacts, {"press": np.array([0.0, -3.0])})
    system = replace(system, initial_velocity=np.array([2.0, 0.0]), points=points_of(2, block=0))
    result = run(system, 5.0, step=1e-3, watch=("block",))
    assert result.normal_force[5:].sum(axis=1) == pytest.approx(3.0, rel=1e-9)
    assert result.unconverged_steps == 0
    # Stops after v²/2μg with g = 3 m/s².
    assert result.displacement[-1, 0, 0] == pytest.approx(4 / (2 * 0.2 * 3), rel=2e-3)
    assert energy_balance(result).error < 1e-9


def test_compliant_contact():
    """A mass on a compliant floor settles at the static depth F/K_c and swings about it with √(K_c/m)."""
    contact = replace(touch([0.0, 1.0], [1.0, 0.0], law=Coulomb(0.0)), stiffness=400.0)
    system = System(np.eye(2), np.zeros((2, 2)), np.zeros((2, 2)), (contact,), {"press": np.array([0.0, -3.0])})
    points = points_of(2, side=0)
    down = points["side"].free.copy() @ sp.csr_array(np.array([[0.0, 1.0], [1.0, 0.0]]))
    system = replace(system, points={"mass": replace(points["side"], free=down)})
    result = run(system, 2.0, step=1e-4, watch=("mass",))
    u = result.displacement[:, 0, 0]
    lowest = np.flatnonzero((u[1:-1] < u[:-2]) & (u[1:-1] <= u[2:])) + 1
    assert np.diff(result.time[lowest]) == pytest.approx(2 * math.pi / 20, rel=1e-3)
    assert u[lowest[0]] == pytest.approx(-2 * 3 / 400, rel=1e-2)
    # No decay over six cycles: the spring's force is centred in time, not that of the gap a step later.
    assert u[lowest] == pytest.approx(u[lowest[0]], rel=1e-6)
    before, after = result.gap[:-2, 0], result.gap[2:, 0]
    pressed = result.normal_force[2:, 0] > 0
    assert ((before + after) / 2 + result.normal_force[2:, 0] / 400)[pressed] == pytest.approx(0.0, abs=1e-12)


def test_a_node_pushed_closed_by_another_joins_in():
    """Two masses in a row before a wall: the second is driven into it by the contact of the first, in one step."""
    # Mass 0 flies at mass 1, which touches the wall: free of forces mass 1 would stay.
    first = touch([-1.0, 1.0], [0.0, 0.0], name="between")
    wall = touch([0.0, -1.0], [0.0, 0.0], name="wall")
    system = System(np.eye(2), np.zeros((2, 2)), np.zeros((2, 2)), (first, wall))
    system = replace(system, initial_velocity=np.array([1.0, 0.0]))
    result = run(system, 1e-2, step=1e-3)
    assert result.gap.min() > -1e-12
    assert np.all(np.abs(result.slip_speed) < 1e-12)
    assert result.works["contact"][-1] == pytest.approx(0.5, rel=1e-9)

"""Published and closed-form problems of solids, masses and springs in contact, from case file to number."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq
from scipy.signal import argrelextrema
from scipy.sparse.linalg import eigsh

import stridor as st
from solid_cases import (
    BELT,
    COULOMB,
    DOYEN,
    FV32,
    RODS,
    TWO_MASSES,
    WALL,
    bar_in_two,
    cantilever,
    case,
    hertz,
    hertz_found,
    plate,
    ring,
    slider,
    two_blocks,
    unevenness,
)

pytestmark = pytest.mark.validation


def test_tapered_membrane():
    # NAFEMS FV32, plane stress
    published = [44.62, 130.0, 162.7, 246.0, 379.8, 391.4]
    found = st.body_modes(case(FV32))["membrane"].frequency_hz
    assert found == pytest.approx(published, rel=2e-3)


def test_thick_plate():
    # u_z = 0 on the four lateral faces; from above, after three motions in its plane that nothing resists
    published = np.array([44.18, 107.33, 107.33, 163.15, 193.66, 203.30])
    errors = []
    for divisions in ((8, 8, 2), (12, 12, 2)):
        found = st.body_modes(case(plate(divisions)), max_frequency_hz=210.0)["plate"]
        assert found.labels[:3] == ("rigid",) * 3
        errors.append(found.frequency_hz[3:9] / published - 1)
    assert np.all(errors[1] > -2e-4)
    assert np.all(errors[1] < 4e-3)
    assert np.all(errors[1] < errors[0] + 1e-4)


@pytest.mark.slow
def test_thick_plate_on_a_fine_mesh():
    published = [44.18, 107.33, 107.33, 163.15, 193.66, 203.30]
    found = st.body_modes(case(plate((24, 24, 4))))["plate"].frequency_hz
    assert found[3:9] == pytest.approx(published, rel=3e-4)


def timoshenko(near: float, poisson_ratio: float) -> float:
    """The frequency [Hz] of the cantilever with shear (κ = 5/6) and rotary inertia, up to 1 % below ``near``: the root
    of what its transfer matrix of deflection, turn, shear force and moment leaves at the free end."""
    height, modulus, density = 0.02, 210e9, 7800.0
    area, inertia, shear = height**2, height**4 / 12, 5 / 6 * modulus / (2 * (1 + poisson_ratio)) * height**2

    def end(frequency: float) -> float:
        square = (2 * math.pi * frequency) ** 2
        rates = np.zeros((4, 4))
        rates[0, 1], rates[0, 2], rates[1, 3] = 1.0, 1 / shear, 1 / (modulus * inertia)
        rates[2, 0], rates[3, 1], rates[3, 2] = -density * area * square, -density * inertia * square, -1.0
        carried = expm(rates)  # over 1 m
        return carried[2, 2] * carried[3, 3] - carried[2, 3] * carried[3, 2]

    return float(brentq(end, 0.99 * near, near, xtol=1e-9))


def test_cantilever_as_beam_plane_and_block():
    euler = np.array([1.87510407, 4.69409113, 7.85475744]) ** 2 * math.sqrt(210e9 * 0.02**2 / 12 / 7800.0) / (2 * math.pi)
    assert euler == pytest.approx([16.7638, 105.057, 294.163], rel=1e-5)
    # Shear and rotary inertia, which Euler and Bernoulli leave out, take 0.4 to 0.5 % from the third frequency.
    sheared = {ratio: np.array([timoshenko(f, ratio) for f in euler]) for ratio in (0.0, 0.3)}
    assert [values[2] for values in sheared.values()] == pytest.approx([292.884, 292.615], rel=1e-5)

    def found(model: str, ratio: float) -> np.ndarray:
        return st.body_modes(case(cantilever(model, ratio)))["bar"].frequency_hz

    beam, plane, block = (found(model, 0.3) for model in ("beam", "plane stress", "3d"))
    block = block.reshape(3, 2)  # square: every mode twice
    assert block[:, 0] == pytest.approx(block[:, 1], rel=1e-6)
    assert beam == pytest.approx(euler, rel=1e-4)
    for solid in (plane, block[:, 0]):
        assert solid == pytest.approx(sheared[0.3], rel=3e-3)
        assert solid[:2] == pytest.approx(beam[:2], rel=3e-3)
        assert solid[2] < beam[2] * (1 - 2e-3)
    assert plane == pytest.approx(block[:, 0], rel=3e-3)
    # Without Poisson's ratio the clamp hinders no contraction, and nothing is left to differ.
    assert found("plane stress", 0.0) == pytest.approx(sheared[0.0], rel=5e-5)


@pytest.mark.parametrize("space", [False, True])
def test_a_bar_cut_and_bonded_is_the_whole_bar(space):
    whole = st.body_modes(case(bar_in_two(whole=True, space=space)))["root"].frequency_hz
    system = st.build_system(case(bar_in_two(whole=False, space=space)))
    squares = eigsh(system.stiffness.tocsc(), len(whole), system.mass.tocsc(), sigma=0.0, return_eigenvectors=False)
    assert len(whole) == (20 if space else 8)
    assert np.sqrt(np.sort(squares)) / (2 * np.pi) == pytest.approx(whole, rel=3e-3 if space else 1e-3)


HERTZ = (6.2148e-3, 3585.4e6)  # a = √(4 P R / π E*), p₀ = 2 P / π a


def test_cylinder_on_a_block(tmp_path):
    line_load, softness = 35e3 / 1e-3, (1 - 0.3**2) * (1 / 210e9 + 1 / 70e9)
    half_width = math.sqrt(4 * line_load * 0.05 * softness / math.pi)
    assert (half_width, 2 * line_load / (math.pi * half_width)) == pytest.approx(HERTZ, rel=1e-4)
    errors = []
    for size in (1.0, 0.5):  # meshes that do not match
        *found, force = hertz_found(case(hertz(tmp_path / f"{size}.inp", size, ratio=0.9)))
        assert force == pytest.approx(17.5e3, rel=1e-9)
        errors.append(np.abs(np.array(found) / HERTZ - 1))
    # What is left does not fall with the mesh any more but moves with where the last touching node happens to be.
    assert np.max(errors) < 0.01
    quadratic = hertz_found(case(hertz(tmp_path / "quadratic.inp", 1.0, quadratic=True)))
    assert quadratic[:2] == pytest.approx(HERTZ, rel=3e-3)


def test_cylinder_on_a_block_by_penalty(tmp_path):
    rigid = np.array(hertz_found(case(hertz(tmp_path / "r.inp", 1.0))))
    away = []
    for stiffness in (1e15, 1e16):
        found = np.array(hertz_found(case(hertz(tmp_path / f"{stiffness:g}.inp", 1.0, stiffness=stiffness))))
        assert found[:2] == pytest.approx(HERTZ, rel=0.01)
        away.append(np.abs(found / rigid - 1)[:2])
    assert np.all(away[1] < 0.12 * away[0])


@pytest.mark.parametrize("cells", ["quad", "quad8"])
def test_two_blocks_under_even_pressure(cells):
    assert unevenness(case(two_blocks(cells, 10, 10))) == pytest.approx((1.0, 1.0), rel=1e-8)
    model = case(two_blocks(cells, 10, 9))
    assert st.steady_sliding(model).resultants["joint"].force == pytest.approx([0.0, 1e6], rel=1e-9, abs=1e-3)
    assert unevenness(model) == pytest.approx((1.0, 1.0), rel=1e-8)


def test_ring_on_a_shaft():
    # Lamé: a ring on a rigid shaft under pressure from outside; friction's torque is what the springs hold
    mu, inner, outer, ratio, width, pressure = 0.3, 0.03, 0.05, 0.3, 0.01, 1e6
    part = (1 - ratio) / (1 + ratio)
    total = 2 * math.pi * inner * width * pressure * 2 / (1 + ratio) / (1 + part * (inner / outer) ** 2)
    model = case(ring((3, 36), mu))
    system, found = st.build_system(model), st.steady_sliding(model)
    assert found.normal_force.sum() == pytest.approx(total, rel=1e-4)
    up, down = (system.points[f"ring.{at}"].free[1] @ found.displacement for at in ("right", "left"))
    torque = 1e7 * outer * float(up - down)
    assert torque == pytest.approx(mu * inner * total, rel=1e-4)
    assert torque == pytest.approx(mu * inner * found.normal_force.sum(), rel=1e-8)
    # The shaft turns counter-clockwise and takes the ring along.
    assert found.resultants["bore"].moment == pytest.approx(torque, rel=1e-8)
    assert np.abs(found.resultants["bore"].force).max() < 1e-9 * total


@pytest.mark.parametrize("space", [False, True])
@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_block_on_a_slider(space, direction):
    # A spring at height h holds it against μN: pressure moves by μh to the edge that leads, the side material comes from
    mu, load, height = 0.2, 1000.0, 0.04
    model = case(slider(space=space, mu=mu, velocity=direction))
    nodes, found = st.build_system(model).contact_nodes(), st.steady_sliding(model)
    force, moment = found.resultants["rub"].force, found.resultants["rub"].moment
    assert found.active.all()
    sideways = [0.0] if space else []
    assert force == pytest.approx([direction * mu * load, *sideways, load], rel=1e-8, abs=1e-6)
    arm = np.sum(nodes.position[:, 0] * found.normal_force) / load
    assert arm == pytest.approx(-direction * mu * height, rel=1e-6)
    if space:
        assert moment == pytest.approx([0.0, direction * mu * load * height, 0.0], rel=1e-6, abs=1e-6)
    else:
        assert moment == pytest.approx(-direction * mu * load * height, rel=1e-6)
    # Stiffer and stiffer springs press as rigid contact does, and no statics depends on them.
    away = []
    for stiffness in (1e15, 1e16):
        soft = st.steady_sliding(case(slider(space=space, mu=mu, velocity=direction, stiffness=stiffness)))
        assert soft.resultants["rub"].moment == pytest.approx(moment, rel=1e-6, abs=1e-6)
        away.append(np.abs(soft.normal_force - found.normal_force).max() / found.normal_force.max())
    assert away[0] < 0.01
    assert away[1] < 0.12 * away[0]


def test_bar_on_a_wall():
    # code_aster SDNV100: contact from 20 to 100 µs at 4 GPa, rebound at +100 m/s; the free end stops at 60 µs
    run = st.simulate(case(WALL))
    touching = run.time[run.normal_force[:, 0] > 0]
    assert touching[0] == pytest.approx(20e-6, rel=0.01)
    assert touching[-1] == pytest.approx(100e-6, rel=0.01)
    middle = (run.time > 25e-6) & (run.time < 95e-6)
    assert run.normal_force[middle, 0].mean() / 0.02**2 == pytest.approx(4e9, rel=0.01)
    at_60 = int(np.argmin(np.abs(run.time - 60e-6)))
    assert run.displacement[at_60, 0, 0] == pytest.approx(-6e-3, rel=0.01)
    # Momentum of the whole bar: force times duration, to the mean velocity after it.
    mass = 8000 * 0.2 * 0.02**2
    impulse = np.trapezoid(run.normal_force[:, 0], run.time)
    assert impulse / mass - 100.0 == pytest.approx(100.0, rel=0.01)


def test_two_equal_rods():
    # Carpenter's numbers: 202.2 in/s on a rod at rest, 14961.4 lb for 98.658 µs, the interface at half the speed
    run = st.simulate(case(RODS))
    pound, inch = 4.4482216, 0.0254
    touching = run.time[run.normal_force[:, 0] > 0]
    assert touching[-1] - touching[0] == pytest.approx(98.658e-6, rel=0.01)
    during = (run.time > 10e-6) & (run.time < 89e-6)
    assert run.normal_force[during, 0].mean() == pytest.approx(14961.4 * pound, rel=0.01)
    assert run.velocity[during, 0, 0].mean() == pytest.approx(101.1 * inch, rel=0.01)
    after = run.time > 123e-6
    assert abs(run.velocity[after, 1, 0].mean()) < 0.01 * 202.2 * inch
    assert run.velocity[after, 2, 0].mean() == pytest.approx(202.2 * inch, rel=0.01)


def test_doyen_s_bar():
    # Doyen, Ern and Piperno: contact from 0.5 to 1.1667 at a pressure of 300, then back at 10
    run = st.simulate(case(DOYEN))
    touching = run.time[run.normal_force[:, 0] > 0]
    assert touching[0] == pytest.approx(0.5, rel=0.01)
    assert touching[-1] == pytest.approx(0.5 + 2 / 3, rel=0.01)
    during = (run.time > 0.55) & (run.time < 1.11)
    assert run.normal_force[during, 0].mean() / 0.5 == pytest.approx(300.0, rel=0.01)
    assert abs(run.velocity[during, 0, 0].mean()) < 0.01 * 10.0
    after = run.time > 1.4
    assert run.velocity[after, 1, 0].mean() == pytest.approx(10.0, rel=0.01)


def test_coulomb_oscillator():
    # code_aster SDND100: extrema at nπ/100 s, each 0.2 mm smaller, then stuck at rest
    run = st.simulate(case(COULOMB))
    x = run.displacement[:, 0, 0]
    turning = [*argrelextrema(x, np.less)[0], *argrelextrema(x, np.greater)[0]]
    turning = sorted(k for k in turning if run.time[k] < 0.12)
    assert x[turning] == pytest.approx([-0.65e-3, 0.45e-3, -0.25e-3], rel=1e-3)
    assert run.time[turning] == pytest.approx([math.pi / 100 * n for n in (1, 2, 3)], rel=1e-3)
    stuck = run.time > 1.01 * 4 * math.pi / 100
    assert x[stuck] == pytest.approx(0.05e-3, rel=1e-3)
    assert np.all(run.status[stuck, 0] == 1)
    assert np.ptp(x[stuck]) == 0.0


def test_two_masses_on_a_rough_floor():
    # code_aster SDND106
    run = st.simulate(case(TWO_MASSES))
    x = run.displacement[:, :, 0]
    slipping = run.time[run.status[:, 0] == 2]
    assert slipping[0] == pytest.approx(0.0351241, rel=2e-3)
    assert slipping[-1] == pytest.approx(0.314923, rel=2e-3)
    for mass, time, value in ((1, 0.02, 0.112210), (0, 0.15, 1.353338), (1, 0.15, 1.807532), (1, 0.339965, 3.968131)):
        at = int(np.argmin(np.abs(run.time - time)))
        assert x[at, mass] == pytest.approx(value, rel=2e-3)


def test_mass_on_a_belt():
    # closed form of the steady cycle (cases.md): T_slip 5.355890, T_stick 1, x from 0.076393 to 0.523607
    run = st.simulate(case(BELT))
    late = run.time > 12.0
    x, time, stick = run.displacement[late, 0, 0], run.time[late], run.status[late, 0] == 1
    assert x.min() == pytest.approx(0.076393, rel=5e-3)
    assert x.max() == pytest.approx(0.523607, rel=5e-3)
    begins = time[1:][stick[1:] & ~stick[:-1]]
    ends = time[1:][~stick[1:] & stick[:-1]]
    assert np.diff(begins).mean() == pytest.approx(6.355890, rel=5e-3)
    lasting = [ends[ends > b][0] - b for b in begins if np.any(ends > b)]
    assert np.mean(lasting) == pytest.approx(1.0, rel=5e-3)

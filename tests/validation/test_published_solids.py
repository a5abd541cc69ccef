"""Published and closed-form problems of solids, masses and springs in contact, from case file to number."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.signal import argrelextrema
from solid_cases import BELT, COULOMB, FV32, RODS, TWO_MASSES, WALL, case

import stridor as st

pytestmark = pytest.mark.validation


def test_tapered_membrane():
    # NAFEMS FV32, plane stress
    published = [44.62, 130.0, 162.7, 246.0, 379.8, 391.4]
    found = st.body_modes(case(FV32))["membrane"].frequency_hz
    assert found == pytest.approx(published, rel=2e-3)


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
    # closing speed 5.136 m/s shared equally: interface at rest on average, velocities exchanged after 2L/c
    run = st.simulate(case(RODS))
    c = math.sqrt(206.8e9 / 7801.0)
    duration = 2 * 0.254 / c
    touching = run.time[run.normal_force[:, 0] > 0]
    assert touching[-1] - touching[0] == pytest.approx(duration, rel=0.01)
    during = (run.time > 0.1 * duration) & (run.time < 0.9 * duration)
    assert abs(run.velocity[during, 0, 0].mean()) < 0.01 * 2.568
    force = 7801.0 * c * 2.568 * 0.0254**2
    assert run.normal_force[during, 0].mean() == pytest.approx(force, rel=0.01)
    after = run.time > 1.25 * duration
    assert run.velocity[after, 1, 0].mean() == pytest.approx(-2.568, rel=0.01)
    assert run.velocity[after, 2, 0].mean() == pytest.approx(2.568, rel=0.01)


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

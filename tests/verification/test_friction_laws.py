"""Friction that changes with slip speed, by formula and by table: stick–slip and damping against other methods."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from marching import block_on_belt, one_phase, run, simulate_assembled
from stridor import build_system, modes, onsets
from stridor.case import loads
from stridor.laws import Hyperbolic, Tabulated, Weakening
from stridor.temporal.simulate import Settings

pytestmark = pytest.mark.verification

BELT = 0.2
CURVE = Hyperbolic(0.2, 0.5, 4.0)


def limit_cycle(law) -> tuple[float, float, float]:
    """Period, least and largest x of m = k = N = 1 on a belt: rides to x = μ_s, then slips till it has the belt's speed.

    An adaptive Runge–Kutta method with the end of slip as an event; the ride is x = μ_s − v t.
    """

    def slip(_, y):
        return [y[1], law.sliding(BELT - y[1]) - y[0]]

    def caught(_, y):
        return y[1] - BELT

    caught.terminal, caught.direction = True, 1.0  # type: ignore[attr-defined]
    found = solve_ivp(slip, (0.0, 100.0), [law.sticking, BELT * (1 - 1e-9)], events=caught, rtol=1e-10, atol=1e-12,
                      dense_output=True)  # fmt: skip
    x = found.sol(np.linspace(0.0, found.t[-1], 4001))[0]
    ride = (law.sticking - found.y[0, -1]) / BELT
    return float(found.t[-1] + ride), float(x.min()), float(x.max())


def by_nodes(system, duration, *, step):
    settings = Settings(record_every=1, watch=("block",), step=step)
    start = np.zeros(2), np.array([BELT, 0.0]), np.zeros(2)
    return simulate_assembled(system, one_phase(duration), settings, disturbance=start)


def by_modes(system, duration, *, step):
    return run(system, duration, step=step, watch=("block",), start=(0.0, [BELT, 0.0], 0.0))


@pytest.mark.parametrize("march", [by_modes, by_nodes])
@pytest.mark.parametrize(
    "law",
    [CURVE, Tabulated((0.0, 0.05, 0.2, 0.4), (0.45, 0.3, 0.25, 0.3), "monotone-cubic", 0.5)],
    ids=["hyperbolic", "table with a static coefficient"],
)
def test_stick_slip_on_a_belt(march, law):
    """Period and travel of the cycle, against an ODE solver with events, to 1e-3."""
    period, least, most = limit_cycle(law)
    result = march(block_on_belt(law=law, speed=BELT), 30.0, step=5e-4)
    status = result.status[:, 0]
    starts = np.flatnonzero((status[1:] == 1) & (status[:-1] == 2)) + 1
    starts = starts[result.time[starts] > 2.0]
    assert len(starts) >= 3
    assert np.diff(result.time[starts]) == pytest.approx(period, rel=1e-3)
    x = result.displacement[starts[0] :, 0, 0]
    assert (x.min(), x.max()) == pytest.approx((least, most), abs=1e-3 * (most - least))


OSCILLATOR = """
[bodies.block]
type = "mass"
mass = 2.0
position = [0.0, 0.0]
[bodies.belt]
type = "obstacle"
shape = "flat"
point = [0.0, 0.0]
normal = [0.0, 1.0]
sliding = {{ velocity = [0.3, 0.0] }}
[springs.k]
between = ["block", "ground"]
stiffness = 800.0
damping = {damping}
direction = [1.0, 0.0]
[loads.press]
at = "block"
force = [0.0, -10.0]
[contacts.rub]
slave = "block"
master = "belt"
stiffness = {stiffness}
friction = {friction}
[modal]
max_frequency_hz = 1000.0
"""
HYPERBOLIC = '{ law = "hyperbolic", coefficient = 0.2, static_coefficient = 0.5, delta = 4.0 }'
WEAKENING = '{ law = "weakening", coefficient = 0.2, static_coefficient = 0.5, decay_speed = 0.25 }'


def table(law, top: float, points: int, interpolation: str) -> str:
    speeds = np.linspace(0.0, top, points)
    return (
        f'{{ law = "table", speeds = {speeds.tolist()}, coefficients = {[law.sliding(v) for v in speeds]}, '
        f'interpolation = "{interpolation}" }}'
    )


def oscillator(friction: str, damping: float, stiffness: str = "1e6"):
    return loads(OSCILLATOR.format(friction=friction, damping=damping, stiffness=stiffness))


@pytest.mark.parametrize("stiffness", ["1e6", pytest.param('"rigid"', marks=pytest.mark.slow)])
def test_damping_below_the_fall_of_friction_grows(stiffness):
    """c_crit = −N dμ/dv in closed form; the growth is (c_crit − c)/2m to the digit, on both sides of it."""
    critical = -10.0 * CURVE.slope(0.3)
    assert critical == pytest.approx(10.0 * 0.3 * 4.0 / 2.2**2)
    for damping in (0.5 * critical, 0.999 * critical, 1.001 * critical, 2 * critical):
        found = modes(oscillator(HYPERBOLIC, damping, stiffness), mu=CURVE.sliding(0.3))
        slow = np.argmin(np.abs(found.eigenvalues[0]))
        expected = complex((critical - damping) / 4.0)
        expected += 1j * np.sqrt(800.0 / 2.0 - expected.real**2)
        assert found.eigenvalues[0, slow] == pytest.approx(expected, rel=1e-9)
        assert bool(found.unstable[0, slow]) == (damping < critical)


def test_onset_over_friction_of_a_law_that_falls():
    """Scaled to μ at 0.3 m/s the slope is μ times dln μ/dv: growth begins at μ = −c/(N dln μ/dv)."""
    found = onsets(oscillator(HYPERBOLIC, 2.0))
    expected = -2.0 / (10.0 * CURVE.slope(0.3) / CURVE.sliding(0.3))
    assert [o.mu for o in found.onsets] == pytest.approx([expected], rel=1e-7)


def test_a_table_that_samples_a_law_has_its_modes():
    """Eigenvalues differ by the error of the slope: second order for cubic pieces, first for straight ones."""
    law = Weakening(0.2, 0.5, 0.25)
    mu = law.sliding(0.3)
    exact = modes(oscillator(WEAKENING, 1.0), mu=mu).eigenvalues[0]
    errors = {}
    for kind in ("linear", "monotone-cubic"):
        for points in (33, 257):
            sampled = modes(oscillator(table(law, 1.1, points, kind), 1.0), mu=mu).eigenvalues[0]
            errors[kind, points] = np.abs(sampled - exact).max()
            slope = Tabulated(*_points(law, 1.1, points), kind).scaled(mu, 0.3).slope(0.3) - law.slope(0.3)  # type: ignore[arg-type]
            assert errors[kind, points] == pytest.approx(10.0 * abs(slope) / 4.0, rel=2e-2)
    assert errors["monotone-cubic", 257] < 5e-5 * abs(exact[0].real)
    assert errors["monotone-cubic", 257] < 0.1 * min(errors["monotone-cubic", 33], errors["linear", 257])


def _points(law, top, points):
    speeds = np.linspace(0.0, top, points)
    return tuple(speeds.tolist()), tuple(law.sliding(v) for v in speeds)


def test_a_table_that_samples_a_law_has_its_run():
    law = Weakening(0.2, 0.5, 0.25)
    straight, fine = (
        by_modes(block_on_belt(law=one, speed=BELT), 12.0, step=2e-3).displacement[:, 0, 0]
        for one in (law, Tabulated(*_points(law, 1.0, 201), "monotone-cubic"))
    )
    assert np.abs(straight - fine).max() < 1e-5
    assert np.ptp(straight) > 0.3


def test_a_table_that_is_flat_at_one_metre_per_second_still_falls_before():
    """Every node has the coefficient of its own speed, whatever the law does elsewhere."""
    case = oscillator('{ law = "table", speeds = [0.1, 0.2, 0.5], coefficients = [0.5, 0.5, 0.3] }', 1.0)
    nodes = build_system(case).contact_nodes()
    assert nodes.friction_coefficients(np.array([0.35])) == pytest.approx([0.4])

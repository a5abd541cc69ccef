"""Ensembles that are swept, against the closed form of a hysteresis: stick-slip on a belt that goes faster and slower.

A mass m on a spring k and a dashpot c = 2ζ√(mk), on a belt of speed v, with μ_s > μ_k (docs/ensembles.md). Steady sliding
is stable at every speed; a cycle of stick and slip goes on up to v_c and no further.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

import stridor as st
from marching import block_on_belt
from stridor.laws import StaticKinetic
from stridor.temporal.ensembles import march_all
from stridor.temporal.legs import Member
from stridor.temporal.schedule import PhaseSpec
from stridor.temporal.settings import Settings
from stridor.temporal.trajectory import Trajectory

pytestmark = pytest.mark.verification

KINETIC, STATIC = 0.3, 0.4
DROP = STATIC - KINETIC  # (μ_s − μ_k) N/k
PERIOD = 2 * np.pi
BESIDE = 1.0 + 0.05 * np.array([-6.5, -4.5, -2.5, -1.5, -0.5, 0.5, 1.5, 2.5])  # of v_c, which is between two of them


def critical(zeta: float, omega: float = 1.0) -> float:
    """The fastest belt on which the cycle goes on, per length of the drop in friction."""
    delta = math.asin(zeta)
    phi = brentq(
        lambda p: math.log(math.cos(delta) / math.cos(p)) - math.tan(delta) * (2 * math.pi - delta - p), 0.0, 1.57
    )
    return omega * math.cos(phi) / math.sin(phi + delta)


def belt(zeta: float, speed: float, periods: float = 60.0) -> st.Case:
    return st.Case(
        units="nondimensional",
        bodies={
            "m": {"type": "mass", "mass": 1.0, "position": (0, 0)},
            "belt": {
                "type": "obstacle", "shape": "flat", "point": (0, 0), "normal": (0, 1), "sliding": {"velocity": (speed, 0)}
            },
        },
        springs={"k": {"between": ("m", "ground"), "direction": (1, 0), "stiffness": 1.0, "damping": 2 * zeta}},
        loads={"weight": {"at": "m", "force": (0, -1)}},
        contacts={
            "rub": {
                "slave": "m", "master": "belt", "stiffness": "rigid",
                "friction": {"law": "static-kinetic", "coefficient": KINETIC, "static_coefficient": STATIC},
            }
        },
        phases=[{"name": "run", "duration": periods * PERIOD}],
        temporal={"step": 0.01, "record_every": 10, "watch": ["m"]},
        modal={"max_frequency_hz": 1.0},
    )  # fmt: skip


def cycle(zeta: float, speed: float) -> tuple[float, float, float]:
    """Period, share of it in stick, and rms of the velocity of the cycle on a belt, from the damped motion of its slip."""
    beat = math.sqrt(1.0 - zeta**2)

    def velocity(t: float) -> float:
        return math.exp(-zeta * t) * (speed * math.cos(beat * t) + (zeta * speed - DROP) / beat * math.sin(beat * t))

    def stretch(t: float) -> float:
        """Of the spring, beyond steady sliding."""
        return DROP - 2 * zeta * speed + quad(velocity, 0.0, t)[0]

    # It comes back to the belt's speed between the least velocity and the next largest one.
    angle = math.atan2(DROP / speed - zeta, beat)
    highest = (2 * math.pi - math.asin(zeta) - angle) / beat
    slip = brentq(lambda t: velocity(t) - speed, highest - math.pi / beat, highest)
    stick = (stretch(0.0) - stretch(slip)) / speed
    square = quad(lambda t: velocity(t) ** 2, 0.0, slip, limit=200)[0] + speed**2 * stick
    return slip + stick, stick / (slip + stick), math.sqrt(square / (slip + stick))


def test_the_closed_form_is_the_speed_at_which_slip_just_comes_back():
    for zeta in (1e-3, 0.02, 0.1, 0.3):
        speed = DROP * critical(zeta)
        time = np.linspace(1.0, 9.0, 400_001)
        beat = math.sqrt(1.0 - zeta**2)
        wave = speed * np.cos(beat * time) + (zeta * speed - DROP) / beat * np.sin(beat * time)
        assert (np.exp(-zeta * time) * wave).max() == pytest.approx(speed, rel=1e-9)
    # Half the square of the drop is then what damping takes in a turn.
    assert critical(1e-6) == pytest.approx(1 / math.sqrt(4 * math.pi * 1e-6), rel=2e-3)


@pytest.mark.parametrize("zeta", [0.03, 0.08])
def test_a_belt_that_goes_faster_and_slower(zeta: float):
    """From rest on a slow belt: stick and slip up to v_c, as the closed form has them, and silence all the way back."""
    speed = DROP * critical(zeta)
    found = st.ensemble(belt(zeta, speed), speed=BESIDE, sweep="both", swept="speed", modes=False)
    up, down = (np.array(found.sweep) == way for way in ("up", "down"))
    assert (found.stick[up, 0] > 0).tolist() == (BESIDE < 1.0).tolist()
    assert not found.stick[down].any()
    assert found.rms[down].max() < 1e-6 * speed
    for k in np.flatnonzero(up & (found.speed < 1.0)):
        period, stick, rms = cycle(zeta, found.slip_speed[k])
        assert found.regime[k] == "steady"
        assert found.frequency_hz[k] == pytest.approx(1.0 / period, rel=2e-3)
        assert found.stick[k, 0] == pytest.approx(stick, abs=6e-3)
        assert found.rms[k] == pytest.approx(rms, rel=5e-3)


def test_a_load_that_falls_and_rises():
    """v_c grows with the load: on one belt the cycle goes on down to a load, and rising loads do not wake it."""
    zeta = 0.05
    loads = np.array([0.6, 0.675, 0.725, 0.775, 0.825, 1.0])
    least = 0.75
    case = belt(zeta, least * DROP * critical(zeta))
    falling, rising = (st.ensemble(case, load=loads, sweep=way, swept="load", modes=False) for way in ("down", "up"))
    assert (falling.stick[:, 0] > 0).tolist() == (loads > least).tolist()
    assert not rising.stick.any()
    assert rising.rms[1:].max() < 1e-6


def test_sweeps_side_by_side_jump_at_the_same_speed():
    """By the loop that takes many members at once, another than that of masses on obstacles."""
    zeta = 0.05
    system = block_on_belt(law=StaticKinetic(KINETIC, STATIC), speed=1.0, damping=2 * zeta)
    speeds = DROP * critical(zeta) * BESIDE
    found: dict[int, Trajectory | str] = {}
    tracks = [[Member(None, 1.0, float(v)) for v in (*speeds, *speeds[::-1])]]
    march_all(
        system, [PhaseSpec("run", 60 * PERIOD, {}, {})], Settings(step=0.01, record_every=10), tracks,
        lambda _, leg, run: found.__setitem__(leg, run), window=0.5,
    )  # fmt: skip
    sticks = [found[leg].phases[-1].contacts["A"].stick_fraction > 0 for leg in range(2 * len(speeds))]
    assert sticks == [*(BESIDE < 1.0), *[False] * len(speeds)]


def test_a_push_as_fast_as_the_belt_brings_the_cycle_back():
    """From steady sliding: below v_c what lets the mass stick once lets it stick again and again; beyond, only once."""
    zeta = 0.08
    speed = DROP * critical(zeta)
    case = belt(zeta, speed, 20).with_({"temporal.initial": "steady-sliding", "temporal.stepper": "exact"})
    shares, pushes = np.array([0.7, 0.95, 1.05]), np.array([0.66, 0.74, 0.9, 1.0, 1.1])
    found = st.ensemble(case, speed=shares, perturbation=speed * pushes, modes=False)
    sticks = (found.stick[:, 0] > 0).reshape(len(shares), -1)
    assert sticks.tolist() == ((pushes > shares[:, None]) & (shares[:, None] < 1.0)).tolist()

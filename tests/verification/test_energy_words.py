"""The energy balance is said to close only where all that is missing is rounding."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import stridor as st
from solid_cases import BELT
from stridor.temporal.energy import CLOSED, VIBRATING, energy_balance

pytestmark = pytest.mark.verification


def run(beta2: float) -> st.Case:
    text = BELT.replace("duration = 40.0", "duration = 4.0").replace("stiffness = 1.0", "stiffness = 1e4")
    return st.loads(text).with_({"temporal.beta2": beta2})


def test_numerical_damping_does_not_close_the_balance() -> None:
    kept, damped = (st.simulate(run(beta2)) for beta2 in (0.5, 0.6))
    exact, lossy = energy_balance(kept), energy_balance(damped)
    assert exact.closes
    assert exact.error < CLOSED
    assert exact.words(0.5).startswith("energy balance closes to ")
    assert lossy.error > 10 * CLOSED
    assert not lossy.closes
    assert lossy.words(0.6).startswith("energy balance does not close: ")
    assert lossy.words(0.6).endswith("the numerical damping of beta2 = 0.6 in it")
    words = st.summarise(run(0.6), damped).to_json()["energy"]
    assert words["closes"] is False
    assert words["words"] == lossy.words(0.6)
    for name in ("kinetic", "elastic"):
        spoilt = getattr(kept, name).copy()
        spoilt[len(spoilt) // 2] = np.nan
        none = energy_balance(replace(kept, **{name: spoilt}))
        assert not none.closes
        assert none.words(0.5) == "energy balance does not close: energies are not finite"


def test_one_record_tells_nothing() -> None:
    kept = st.simulate(run(0.5).with_({"temporal.record_every": 10_000_000}))
    assert len(kept.time) == 1
    balance = energy_balance(kept)
    assert not balance.checked
    assert not balance.closes
    assert balance.words(0.5).startswith("energy balance not checked, as there is one record")


PRESSED = """units = "nondimensional"
[bodies.m]
type = "mass"
mass = 1.0
position = [0.0, 0.0]
[bodies.belt]
type = "obstacle"
shape = "flat"
point = [0.0, 0.0]
normal = [0.0, 1.0]
sliding = { velocity = [-1.0, 0.0] }
[springs.k1]
between = ["m", "ground"]
direction = [1.0, 0.3]
stiffness = 1.0
[springs.k2]
between = ["m", "ground"]
direction = [0.2, 1.0]
stiffness = 1.5
[dashpots.a]
between = ["m", "ground"]
direction = [1.0, 0.0]
damping = 0.05
[loads.p]
at = "m"
force = [0.0, -1000.0]
[contacts.c]
slave = "m"
master = "belt"
stiffness = 4.0
friction = { law = "coulomb", coefficient = 0.3 }
[modal]
max_frequency_hz = 1.0
[temporal]
initial = "steady-sliding"
perturbation = 0.01
watch = ["m"]
[[phases]]
name = "run"
duration = 50.0
"""


@pytest.mark.parametrize("stepper", ["explicit", "exact", "implicit"])
@pytest.mark.parametrize("mu", [0.0, 0.3])
def test_a_preload_and_the_work_of_sliding_hide_no_broken_physics(mu: float, stepper: str) -> None:
    """A vibration of 5e-5 J under a preload that stores 4e4 J, while sliding turns over 1e4 J."""
    case = st.loads(PRESSED.replace("0.3 }", f"{mu} }}")).with_({"temporal.stepper": stepper})
    run = st.simulate(case)
    kept = energy_balance(run)
    assert kept.closes
    assert kept.error < CLOSED
    assert kept.vibration_error is not None
    assert kept.vibration_error < VIBRATING
    undamped = {**run.works, "damping": 0.0 * run.works["damping"]}
    for broken in (replace(run, kinetic=2 * run.kinetic), replace(run, kinetic=0 * run.kinetic), replace(run, works=undamped)):
        balance = energy_balance(broken)
        assert not balance.closes
        assert balance.words(0.5).startswith("energy balance does not close: ")

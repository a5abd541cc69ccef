"""The energy balance is said to close only where all that is missing is rounding."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import stridor as st
from solid_cases import BELT
from stridor.temporal.energy import CLOSED, energy_balance

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

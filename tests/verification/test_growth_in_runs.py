"""The growth that a run in time tells: of the fastest component of a small perturbation, whichever way it is marched."""

from __future__ import annotations

import numpy as np
import pytest

import stridor as st
from mode_coupling import mode_coupling
from stridor.app.conclusions import of_run

pytestmark = pytest.mark.verification


@pytest.mark.parametrize(("stepper", "step"), [("explicit", 0.005), ("implicit", 0.02), ("exact", 0.1)])
def test_growth_until_contacts_change_is_that_of_the_mode(stepper: str, step: float) -> None:
    """A mass on two oblique springs and a third under a belt (Hoffmann 2002), whose friction couples both directions.
    Long after the growth has ended the largest line keeps its amplitude: what is fitted to that tells nothing of it."""
    contact = {
        "normal": [0, 1], "tangent": [1, 0], "stiffness": 4 / 3, "slip": 1.0,
        "friction": {"law": "coulomb", "coefficient": 1.2},
    }  # fmt: skip
    system = st.System.from_matrices(
        np.eye(2), 0.01 * np.eye(2), [[2, 1], [1, 2 - 4 / 3]], contacts={"rub": contact}, loads={"press": [0, -1]},
        points={"p": np.eye(2)},
    )  # fmt: skip
    temporal = {
        "step": step, "record_every": round(0.1 / step), "watch": ["p"], "stepper": stepper,
        "initial": "steady-sliding", "perturbation": 1e-5,
    }  # fmt: skip
    phases = [{"name": "run", "duration": 150.0}]
    work = st.Workspace(system, temporal=temporal, modal={"max_frequency_hz": 1.0}, phases=phases)
    mode = max(st.modes(work, 1.2).eigenvalues[0], key=lambda lam: lam.real)
    assert mode.real > 0.2
    found = st.summarise(work, st.simulate(work))
    assert found.growth_rate == pytest.approx(mode.real, rel=5e-3)


def test_of_a_run_in_which_the_loudest_is_too_slow_to_be_told_no_other_line_is_named() -> None:
    """Modes of 0.241 and 1.011 Hz ring from rest, the slower one louder; twelve seconds hold fewer than two periods of it
    in their second half, two hundred hold 24."""
    case = mode_coupling(0.01, 10.0).with_(
        {"contacts.rub.stiffness": 40.0, "modal.max_frequency_hz": 3.0, "temporal.initial": "rest", "temporal.perturbation": 0.0}
    )
    short = case.with_({"phases.slide.duration": 12.0})
    found = st.summarise(short, st.simulate(short, mu=0.3)).to_json()
    assert found["dominant_frequency_hz"] is None
    assert "too few periods of what is strongest" in of_run(found).sentence
    long = case.with_({"phases.slide.duration": 200.0})
    told = st.summarise(long, st.simulate(long, mu=0.3)).dominant_frequency_hz
    assert told == pytest.approx(st.modes(case, 0.3).frequency_hz[0, 0], rel=2e-3)

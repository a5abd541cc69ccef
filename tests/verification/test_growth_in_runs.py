"""The growth that a run in time tells: of the fastest component of a small perturbation, whichever way it is marched."""

from __future__ import annotations

import numpy as np
import pytest

import stridor as st

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

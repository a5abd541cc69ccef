"""Runs are held against the modes of the steady sliding that they end with: its loads, velocities and distances.

The truth is the case with the factors of its phase written into its own numbers.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import stridor as st
from stridor.agreement import linear_part
from stridor.case import template_text
from stridor.study.workspace import Workspace

pytestmark = pytest.mark.verification

RUBBING = """
units = "nondimensional"
bodies.belt = {type = "obstacle", shape = "flat", point = [0, 0], normal = [0, 1], sliding = {velocity = [0.4, 0]}}
bodies.m = {type = "mass", mass = 1.0, position = [0, 0]}
bodies.w = {type = "mass", mass = 1.0, position = [-1.0, 0.0]}
springs.a = {between = ["m", "ground"], direction = [1, 0.6], stiffness = 1.3, damping = 0.1, cubic = 0.4}
springs.b = {between = ["m", "ground"], direction = [-0.7, 1], stiffness = 1.0, damping = 0.1}
springs.w = {between = ["m", "w"], direction = [0, 1], stiffness = 0.5}
supports.w = {at = "w", fixed = ["x", "y"], displacement = {y = -0.2}}
loads.p = {at = "m", force = [0, -1]}
contacts.c = {slave = "m", master = "belt", stiffness = 2.0, interference = 0.1, friction = {law = "weakening", coefficient = 0.2, static_coefficient = 0.8, decay_speed = 0.5}}
modal = {friction_range = [0, 1.5], max_frequency_hz = 1.0}
temporal = {initial = "steady-sliding", perturbation = 1e-4, watch = ["m"], step = 0.01, record_every = 1, stepper = "explicit"}
comparison = {critical = false}
"""
FACTORS = {"loads": {"p": 0.3}, "velocities": {"belt": 2.0}, "displacements": {"w": 0.25, "c": 2.0}}
WRITTEN = {"loads.p.force": [0, -0.3], "bodies.belt.sliding.velocity": [0.8, 0], "supports.w.displacement.y": -0.05, "contacts.c.interference": 0.2}
SHARE = (0.2 + 0.6 * np.exp(-0.8 / 0.5)) / (0.2 + 0.6 * np.exp(-0.4 / 0.5))  # of μ at the case's own speed
MU = 0.4


def of_phase(duration: float = 20.0, **factors: Any) -> st.Case:
    return st.loads(RUBBING).with_({"phases": [{"name": "slide", "duration": duration, **factors}]})


def growing(case: st.Case, mu: float) -> np.ndarray:
    modes = st.modes(case, mu)
    return modes.frequency_hz[0][modes.unstable[0]]


def test_a_system_under_factors_is_the_case_with_these_numbers():
    case = of_phase(**FACTORS)
    ours, truth = st.modes(Workspace(case).ending(), MU), st.modes(case.with_(WRITTEN), SHARE * MU)
    np.testing.assert_allclose(ours.eigenvalues, truth.eigenvalues, rtol=1e-10)
    full = st.modes(case, MU)
    assert np.abs(full.eigenvalues - truth.eigenvalues).max() > 0.01


@pytest.mark.parametrize("factors", [{"loads": {"p": 0.1}}, FACTORS])
def test_runs_are_compared_with_the_modes_of_their_own_phase(factors: dict[str, Any]):
    case = of_phase(**factors)
    truth = growing(case.with_(WRITTEN), SHARE * MU) if factors is FACTORS else growing(case.with_({"loads.p.force": [0, -0.1]}), MU)
    assert not np.array_equal(truth, growing(case, MU))
    found = st.compare(case, [MU])
    np.testing.assert_allclose(found.comparisons[0].unstable_hz, truth, rtol=1e-9)
    assert found.comparisons[0].growth_rate_error < 0.05
    assert any("modes are those of steady sliding in phase slide, with which the run ends:" in note for note in found.notes)
    ensemble = st.ensemble(case, mu=[MU], separately=True)
    assert ensemble.modal is not None
    assert ensemble.modal.unstable.tolist() == [[len(truth)]]
    assert any("modes are those of steady sliding in phase slide" in note for note in ensemble.notes)


def test_a_factor_of_all_speeds_takes_sliding_bodies_along():
    found = st.ensemble(of_phase(), mu=[MU], speed=[1.0, 2.0], separately=True)
    truth = st.modes(of_phase().with_({"bodies.belt.sliding.velocity": [0.8, 0]}), SHARE * MU)
    assert found.modal is not None
    assert found.modal.growth_rate[0, 1] == pytest.approx(truth.growth_rate[0].max(), rel=1e-9)


def test_a_run_whose_ramp_goes_on_or_that_stops_is_held_against_no_mode():
    ramp = {"name": "slide", "duration": 20.0, "loads": {"p": 1.5}, "ramp": 15.0}
    moving = st.compare(of_phase().with_({"temporal.initial": "rest", "temporal.perturbation": 0.0, "phases": [ramp]}), [MU])
    assert moving.agree is None
    assert "held against no mode: loads or speeds still change in the part of phase slide that is looked at" in moving.verdict
    stopped = of_phase().with_({"phases": [{"name": "slide", "duration": 10.0}, {"name": "stop", "duration": 20.0, "velocities": {"belt": 0.0}}]})
    still = st.compare(stopped, [MU])
    assert still.agree is None
    assert "phase stop, with which they end (0 times belt), has no steady sliding" in still.verdict


def test_the_small_motion_of_a_run_is_about_the_steady_sliding_that_it_starts_from(monkeypatch: pytest.MonkeyPatch):
    few = ["bodies.beam1.elements=3", "bodies.beam2.elements=6", "modal.max_frequency_hz=1e4", "temporal.step=1e-7"]
    start = {"temporal.initial": "steady-sliding", "temporal.perturbation": 1e-7, "temporal.record_every": 1}
    case = st.loads(template_text("two-beams"), few).with_(start)
    half = case.with_({"phases": [{"name": "slide", "duration": 1e-4, "velocities": {"clamp": 0.5}}]})
    told: list[np.ndarray] = []

    def seen(signals: np.ndarray, steady: np.ndarray, *, skip: int) -> np.ndarray:
        told.append(signals)
        return linear_part(signals, steady, skip=skip)

    monkeypatch.setattr("stridor.study.run_summary.linear_part", seen)
    run = st.simulate(half, mu=0.3)
    st.summarise(half, run)
    assert np.abs(told[0]).max() < 1e-4 * np.abs(run.slip_speed).max()  # of 0.01 m/s, not of the 0.02 m/s of the case

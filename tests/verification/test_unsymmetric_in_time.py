"""Imported matrices that are not symmetric in the time loop, against their eigenvalues."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg as sl
import scipy.sparse as sp

import stridor as st
from matrix_cases import TURN, matrix_case, rubbing
from stridor.agreement.perturbation import modes_as_in_time, perturb
from stridor.system import System
from stridor.temporal.energy import energy_balance
from stridor.temporal.schedule import PhaseSpec
from stridor.temporal.simulate import Settings, simulate
from stridor.temporal.steppers.sparse import step_limit_assembled
from stridor.temporal.trajectory import Trajectory
from stridor.typing import Array, ComplexArray

ONE = np.eye(2)
# Flutter of two freedoms: (λ² + cλ + 5)² = 1 − 2.25, so λ² + cλ + 5 = ±i √1.25.
FLUTTER = np.array([[6.0, 1.5], [-1.5, 4.0]])


class Rates:
    """q at every step."""

    every = 1

    def __init__(self) -> None:
        self.rows: list[Array] = []

    def see(self, time: float, q: Array) -> None:
        self.rows.append(q.copy())


def imported(folder: Path, stiffness: Array, damping: Array | None = None, mass: Array = ONE) -> System:
    terms = [(mass, "mass", ""), (stiffness, "stiffness", "")]
    return st.build_system(matrix_case(folder, [*terms, (damping, "damping", "")] if damping is not None else terms, 1e3))


def marched(system: System, step: float, duration: float, **more: object) -> tuple[Trajectory, Array]:
    """From a displacement, without a jump; q (n, steps) of every step."""
    rng = np.random.default_rng(3)
    u, v = rng.standard_normal((2, system.size))
    a = -(system.stiffness @ u + system.damping @ v) / system.mass.diagonal()
    seen = Rates()
    settings = Settings(step=step, record_every=1)
    run = simulate(system, [PhaseSpec("free", duration, {}, {})], settings, disturbance=(u, v, a), observe=seen, **more)
    return run, np.array(seen.rows).T


def of_the_scheme(q: Array, step: float) -> ComplexArray:
    """λ of all modes of the map that made q, upper half plane, by frequency."""
    before, after = np.vstack([q[:, :-2], q[:, 1:-1]]), np.vstack([q[:, 1:-1], q[:, 2:]])
    lam = np.log(np.linalg.eigvals(after @ np.linalg.pinv(before)).astype(complex)) / step
    return _upper(lam)


def exact(system: System) -> ComplexArray:
    n = system.size
    mass, damping, stiffness = (m.toarray() for m in (system.mass, system.damping, system.stiffness))
    state = np.block([[np.zeros((n, n)), np.eye(n)], [-sl.solve(mass, stiffness), -sl.solve(mass, damping)]])
    return _upper(np.linalg.eigvals(state))


def _upper(lam: ComplexArray) -> ComplexArray:
    lam = lam[lam.imag > 0.0]
    return lam[np.argsort(lam.imag + 1e-3 * lam.real)]


CASES = {
    "circulatory flutter": (FLUTTER, np.diag([0.02, 0.02])),
    "rotor": (np.diag([9.0, 4.0]), 0.8 * TURN),
    "both, damped": (FLUTTER, np.array([[0.05, -0.6], [0.6, 0.04]])),
}


@pytest.mark.parametrize("name", CASES)
def test_growth_and_frequency_are_those_of_the_modes_to_second_order(tmp_path: Path, name: str):
    system = imported(tmp_path, *CASES[name])
    expected = exact(system)
    errors = []
    for step in (0.04, 0.02, 0.01):
        run, q = marched(system, step, 8.0)
        assert run.path == "assembled"
        errors.append(of_the_scheme(q, step) - expected)
        assert energy_balance(run).error < 1e-13
        # Passes end at 1e-14 of q, in each of up to 800 steps.
        assert abs(run.works["gyroscopic"]).max() < 1e-11 * max(abs(w).max() for w in (run.kinetic, run.elastic))
    worst = [np.abs(e) for e in errors]
    assert np.all(worst[-1] < 1e-4 * np.abs(expected))
    assert worst[0] / worst[1] == pytest.approx(4.0, rel=0.03)
    assert worst[1] / worst[2] == pytest.approx(4.0, rel=0.03)
    grown = [np.abs(e.real) for e in errors]
    if np.all(grown[2] > 1e-8):
        assert grown[1] / grown[2] == pytest.approx(4.0, rel=0.1)
    else:
        assert name == "rotor"  # grows in no step at all
        assert max(g.max() for g in grown) < 1e-9


def test_two_freedoms_in_closed_form(tmp_path: Path):
    """λ² + 0.02 λ + 5 = ±i √1.25; forward and backward whirl of an isotropic rotor at ∓g/2 + √(g²/4 + k)."""
    run, q = marched(imported(tmp_path, FLUTTER, np.diag([0.02, 0.02])), 2e-3, 8.0)
    flutter = -0.01 + np.sqrt(0.01**2 - 5.0 + 1j * np.sqrt(1.25) * np.array([1.0, -1.0]))
    flutter = np.where(flutter.imag > 0, flutter, -0.02 - flutter)
    found = of_the_scheme(q, 2e-3)
    assert sorted(found.real) == pytest.approx(sorted(flutter.real), rel=1e-5)
    assert found.imag == pytest.approx(flutter.imag, rel=1e-5)
    assert run.works["circulatory"][-1] > 0.0
    _, q = marched(imported(tmp_path, 5.0 * ONE, 0.6 * TURN), 1e-2, 8.0)
    whirl = np.sqrt(0.09 + 5.0) + np.array([-0.3, 0.3])
    found = of_the_scheme(q, 1e-2)
    assert found.imag == pytest.approx(whirl, rel=1e-4)
    assert np.abs(found.real).max() < 1e-9


@pytest.mark.parametrize("between", [0.0, 0.07])
def test_the_balance_closes_with_damping_of_the_stiffness_and_between_freedoms(tmp_path: Path, between: float):
    """Damping that acts on the older velocity meets the skew forces in the powers of each step."""
    symmetric = np.array([[6.0, 1.0], [1.0, 4.0]])
    skew = np.array([[0.0, 1.5], [-1.5, 0.0]])
    damping = 0.05 * symmetric + between * np.array([[1.0, -1.0], [-1.0, 1.0]]) + 0.4 * TURN
    run, q = marched(imported(tmp_path, symmetric + skew, damping), 0.02, 1.0)
    assert energy_balance(run).error < 1e-13
    # ∫ vᵀ C v of what was marched, by the trapezoidal rule: to second order in the step.
    v = 0.5 * (q[:, :-1] + q[:, 1:])
    power = np.einsum("is,ij,js->s", v, damping, v)
    assert run.works["damping"][-1] == pytest.approx(0.02 * power.sum(), rel=0.03)


def test_gyroscopic_forces_do_not_let_the_highest_mode_grow(tmp_path: Path):
    """Near the limit of the step, where lagged or extrapolated velocities would blow up."""
    system = imported(tmp_path, np.diag([9.0, 4.0]), 0.2 * TURN)
    limit = step_limit_assembled(system, 0.5)
    assert limit.step == pytest.approx(2.0 / 3.0, rel=1e-12)
    run, _ = marched(system, 0.95 * limit.step, 2000.0)
    stored = run.kinetic + run.elastic
    assert np.abs(stored / stored[0] - 1.0).max() < 1e-9


def test_the_step_keeps_the_passes_converging(tmp_path: Path):
    fast = imported(tmp_path, 1e-4 * ONE, 50.0 * TURN)
    limit = step_limit_assembled(fast, 0.5)
    assert limit.step == pytest.approx(0.5 / (0.5 * 50.0), rel=1e-12)
    run, _ = marched(fast, limit.step, 4.0)
    assert run.unconverged_steps == 0
    assert energy_balance(run).missing < 1e-12 * run.kinetic.max()  # that turns, and changes next to nothing
    still = step_limit_assembled(imported(tmp_path, FLUTTER), 0.5)
    assert still.share < step_limit_assembled(imported(tmp_path, np.diag([6.0, 4.0]), TURN), 0.5).share


def test_a_restart_goes_on_to_the_last_digit(tmp_path: Path):
    system = imported(tmp_path, FLUTTER, 0.3 * TURN)
    whole, _ = marched(system, 0.02, 4.0)
    settings = Settings(step=0.02, record_every=1)
    first, _ = marched(system, 0.02, 1.6)
    rest = simulate(system, [PhaseSpec("free", 4.0, {}, {})], settings, restart=first)
    assert np.array_equal(rest.kinetic, whole.kinetic)
    assert np.array_equal(rest.works["circulatory"], whole.works["circulatory"])
    turned = replace(system, stiffness=sp.csr_array(system.stiffness.T))
    with pytest.raises(st.CaseError, match="stiffness"):
        simulate(turned, [PhaseSpec("free", 4.0, {}, {})], settings, restart=first)


def brake(folder: Path, skew: float, turn: float) -> System:
    """The imported block on its sliding counterface with random circulatory and gyroscopic forces at all nodes, the
    former ``skew`` of the stiffness between neighbours, the latter turning at ``turn`` rad/s."""
    case = rubbing(folder, 0.0)
    rng = np.random.default_rng(11)
    stiffness, damping, mass = (sp.load_npz(folder / f"{name}.npz") for name in "KCM")
    upper = sp.coo_array(sp.triu(stiffness, 1))
    upper.data *= skew * rng.uniform(-1.0, 1.0, upper.nnz)
    sp.save_npz(folder / "S.npz", sp.csr_array(upper - upper.T) / 0.5)
    weight = mass.diagonal()
    half = sp.diags_array(np.where(np.arange(len(weight) - 1) % 2 == 0, turn * weight[:-1], 0.0), offsets=1)
    plain = 300.0 * sp.csr_array(mass)
    sp.save_npz(folder / "C.npz", sp.csr_array(plain + half - half.T))
    assert damping.shape == plain.shape
    return st.build_system(case, 0.5)


def test_a_block_that_rubs_grows_as_its_modes_do(tmp_path: Path):
    mu, system = 0.2, brake(tmp_path, 0.002, 2000.0)
    assert not system.symmetric_definite
    modes = modes_as_in_time(system, mu, 30e3)
    leading = modes.eigenvalues[0][np.argmax(modes.eigenvalues[0].real)]
    assert leading.real > 50.0
    limit = step_limit_assembled(system, 0.5).step
    for share in (0.4, 0.2):
        settings = Settings(step=share * limit)
        found = perturb(system, mu, settings=settings, max_frequency_hz=30e3, modes=modes).eigenvalue
        assert found.real == pytest.approx(leading.real, rel=5e-3)
        assert found.imag == pytest.approx(leading.imag, rel=5e-3)

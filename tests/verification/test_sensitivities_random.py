"""What a number does to the modes of random small systems, against modes solved with the number a little changed."""

from __future__ import annotations

import numpy as np
import pytest

import stridor as st
from random_rubbing import random_rubbing
from rubbing_block import RUBBING_MASS
from stridor.modal.derivatives import HeldContacts, by_compliance
from stridor.modal.options import Options
from stridor.study.sensitivities import Linearised
from stridor.system import System

pytestmark = pytest.mark.verification


def case_of(seed: int) -> tuple[st.Case, float]:
    """Masses on belts at a μ of their own: every third with friction that falls, every second with cubic springs, some
    rigid contacts and some that harden."""
    rng = np.random.default_rng([seed, 7])
    rubbing = random_rubbing(seed, mu=round(float(rng.uniform(0.1, 0.5)), 3))
    changes: dict[str, object] = {}
    for name in rubbing.case.contacts:
        path = f"contacts.{name}"
        if seed % 3 == 0:
            law = {"law": "hyperbolic", "coefficient": 0.1, "static_coefficient": 0.6, "delta": float(rng.uniform(0.3, 2))}
            changes[f"{path}.friction"] = law
        kind = rng.random()
        if kind < 0.3:
            changes[f"{path}.stiffness"] = "rigid"
        elif kind < 0.5:
            changes[f"{path}.cubic"] = float(rng.uniform(0.5, 5.0))
    if seed % 2 == 0:
        changes |= {f"springs.{name}.cubic": float(rng.uniform(0.1, 1.0)) for name in list(rubbing.case.springs)[:2]}
    return rubbing.case.with_(changes), rubbing.mu


def moved(case: st.Case, path: str, value: float) -> st.Case:
    """The case with another number, a compliance among them."""
    if not path.endswith(".compliance"):
        return case.with_({path: value})
    return case.with_({path.replace(".compliance", ".stiffness"): 1.0 / value if value else "rigid"})


def slopes(case: st.Case, path: str, value: float, mu: float, lam: np.ndarray) -> np.ndarray:
    """dλ/dp (b,) by differences of fourth order, forwards from zero, of second order then."""
    if value == 0.0:
        h, weights = 3e-5, (2.0, -0.5)
        at = [st.modes(moved(case, path, k * h), mu).eigenvalues[0] for k in (1, 2)]
    else:
        h, weights = 5e-3 * value, (1 / 12, -2 / 3, 2 / 3, -1 / 12)
        at = [st.modes(moved(case, path, value + k * h), mu).eigenvalues[0] for k in (-2, -1, 1, 2)]
    near = [again[np.argmin(np.abs(again[None] - lam[:, None]), axis=1)] for again in at]
    return sum(weight * (one - lam) for weight, one in zip(weights, near, strict=True)) / h


def hold(seed: int) -> int:
    """Assert of a system that its derivatives are those of modes solved again; how many numbers were compared."""
    case, mu = case_of(seed)
    first = next(iter(case.contacts))
    compliances = [f"contacts.{name}.compliance" for name in case.contacts]
    paths = [*compliances, "loads.press0.force.0", f"bodies.{first.replace('rub', 'belt')}.sliding.velocity.1"]
    found = st.sensitivities(case, paths, mu=mu, modes="all")
    # Modes are solved to a residual of 1e-10, which leaves slow ones too few digits for differences.
    usable = (found.condition < 20) & (found.nearest > 1e-2) & (np.abs(found.eigenvalues.imag) > 0.1)
    lam, compared = found.eigenvalues[usable], 0
    assert found.mu == mu
    for k, path in enumerate(paths):
        expected = slopes(case, path, found.values[k], mu, lam)
        size = np.maximum(np.abs(expected), np.abs(found.derivative[k][usable]))
        tolerance = (2e-3 if found.values[k] == 0 else 2e-6) * size + 3e-7 * np.abs(lam) / max(abs(found.values[k]), 1e-2)
        error = np.abs(found.derivative[k][usable] - expected)
        assert np.all(error < tolerance), (seed, path, found.derivative[k][usable], expected)
        compared += len(lam)
    return compared


# Falling friction, with a rigid contact too, and one among Coulomb's.
@pytest.mark.parametrize("seed", [*(pytest.param(k, marks=pytest.mark.slow) for k in (3, 9)), 13])
def test_derivatives_are_those_of_modes_solved_again(seed: int) -> None:
    assert hold(seed) > 10


@pytest.mark.slow
def test_derivatives_of_many_random_systems() -> None:
    assert sum(hold(seed) for seed in range(50)) > 600


COULOMB = {"law": "coulomb", "coefficient": 0.4}


@pytest.mark.parametrize("change", [{}, pytest.param({"friction": COULOMB}, marks=pytest.mark.slow), {"friction": COULOMB, "cubic": 0.7}])
def test_a_compliance_takes_steady_sliding_along_as_its_stiffness_does(change: dict[str, object]) -> None:
    """d/d(1/K) = −K² d/dK: with a slope of friction, a cubic spring that is stretched, and contact that hardens."""
    cubic = {"springs.n.cubic": 0.5} if "friction" in change else {}
    model = st.loads(RUBBING_MASS).with_({f"contacts.rub.{name}": value for name, value in change.items()} | cubic)
    found = st.sensitivities(model, ["contacts.rub.compliance", "contacts.rub.stiffness"], modes="all")
    np.testing.assert_allclose(found.derivative[0], -found.derivative[1], rtol=1e-8, atol=1e-13)
    held = by_compliance(*held_of(model, found.mu), "rub")
    assert held is None  # there is something of steady sliding


def held_of(model: st.Case, mu: float) -> tuple[System, HeldContacts, Options]:
    linear = Linearised.of(model, mu)
    return linear.system, linear.held, linear.options


def test_a_rigid_contact_that_begins_to_yield_relaxes_cubic_springs() -> None:
    """Against equilibria and frequencies by hand, with rigid contact and with a little compliance."""
    model = st.loads(RUBBING_MASS).with_(
        {"contacts.rub.friction": COULOMB, "contacts.rub.stiffness": "rigid", "springs.n.cubic": 0.5, "springs.k.cubic": 0.2}
    )
    found = st.sensitivities(model, ["contacts.rub.compliance"], modes="all")
    steps = np.array([1e-3, 2e-3])
    rate = [tangent_frequency(c) for c in (0.0, *steps)]
    expected = (-1.5 * rate[0] + 2.0 * rate[1] - 0.5 * rate[2]) / steps[0]
    assert found.eigenvalues[0].imag == pytest.approx(rate[0], rel=1e-9)
    assert found.derivative[0, 0].imag == pytest.approx(expected, rel=1e-4)


def tangent_frequency(compliance: float) -> float:
    """Of the block: the lowest ω about its equilibrium, by Newton's method on x, y and the contact force p."""
    mu, u = 0.4, np.zeros(3)
    rows = np.array([[1.0, 0.0], [0.3, 1.0]]) / np.array([[1.0], [np.hypot(0.3, 1.0)]])
    cubic = np.array([0.2, 0.5])
    # The belt moves to −x and drags the block along.
    push = np.array([-mu, 1.0])
    for _ in range(40):
        stretch = rows @ u[:2]
        tangent = rows.T @ np.diag(1.0 + 3 * cubic * stretch**2) @ rows
        force = rows.T @ (stretch + cubic * stretch**3) - push * u[2] - np.array([0.0, -1.0])
        whole = np.block([[tangent, -push[:, None]], [np.array([[0.0, 1.0, compliance]])]])
        u = u - np.linalg.solve(whole, np.append(force, u[1] + compliance * u[2]))
    if compliance == 0.0:
        # Along the belt, and at right angles to the contact force and its friction.
        return float(np.sqrt(np.array([1.0, mu]) @ tangent[:, 0]))
    squares = np.linalg.eigvals(tangent + np.outer(push, [0.0, 1.0 / compliance]))
    return float(np.sqrt(np.sort(squares.real)[0]))


def test_the_friction_of_the_only_contact_is_mu_and_of_one_of_two_is_refused_with_its_reason() -> None:
    model = st.loads(RUBBING_MASS).with_({"contacts.rub.friction": COULOMB, "springs.n.cubic": 0.5})
    path = "contacts.rub.friction.coefficient"
    found = st.sensitivities(model, ["mu", path], modes="all")
    np.testing.assert_allclose(found.derivative[1], found.derivative[0], rtol=1e-12)
    two = model.with_(
        {"bodies.n": model.bodies["m"].model_dump(), "springs.o": {"between": ["n", "m"], "direction": [1, 0], "stiffness": 1.0},
         "springs.p": {"between": ["n", "ground"], "direction": [0.3, 1], "stiffness": 1.0},
         "loads.more": {"at": "n", "force": [0, -1]}, "contacts.other": model.contacts["rub"].model_dump() | {"slave": "n"}}
    )  # fmt: skip
    with pytest.raises(st.CaseError, match=r"mu, of all contacts together, since steady sliding counts here: cubic springs$"):
        st.sensitivities(two, [path], modes="all")

"""Steady sliding by factors that many equilibria share against each solved by itself."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from solid_cases import slider
from stridor.case import loads
from stridor.errors import AnalysisError
from stridor.sliding import equilibrium, prepared
from stridor.sliding.result import SteadySliding
from stridor.sliding.solution import steady_sliding
from stridor.system import System, build_system
from stridor.typing import BoolArray

FRICTION = (0.0, 0.3, 0.1, 0.8, 0.7, 0.6, 0.05, 0.5)
MANY = 12  # contacts of a random problem
RUBS = {"law": "coulomb", "coefficient": 0.3}


@pytest.fixture(autouse=True)
def at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Small problems are prepared for at the first equilibrium."""
    for name, value in (("LEAST", 0), ("FEWEST", 0), ("NODES_EACH", 10**9)):
        monkeypatch.setattr(prepared, name, value)


def random_system(seed: int, *, closed: bool = False, held: bool = True, skewed: bool = False) -> System:
    """A structure under MANY contacts, rigid, soft and hard ones, of which some lift off as friction grows."""
    rng = np.random.default_rng(seed)
    n = 3 * MANY
    half = rng.standard_normal((n, n))
    stiffness = 1e6 * (half @ half.T / n + (2.0 if held else 0.0) * np.eye(n))
    if not held:  # contact alone keeps the first body from sinking
        stiffness[0, :] = stiffness[:, 0] = 0.0
    if skewed:
        stiffness = stiffness + 2e5 * (half - half.T)
    contacts: dict[str, dict[str, Any]] = {}
    for k in range(MANY):
        normal, tangent = np.zeros((2, n))
        normal[3 * k], tangent[3 * k + 1], normal[3 * k + 2] = 1.0, rng.choice([-1.0, 1.0]), 0.1 * rng.standard_normal()
        contacts[f"c{k}"] = {
            "normal": normal, "tangent": tangent, "gap": float(rng.choice([0.0, 4e-6])),
            "stiffness": "rigid" if k % 3 == 0 else float(10 ** rng.uniform(5, 10)),
            "friction": RUBS, "closed": closed and k % 4 == 0,
        }  # fmt: skip
    push = rng.standard_normal(n) + np.where(np.arange(n) % 3 == 0, -0.8, 0.5)
    push[0] = -20.0
    return System.from_matrices(np.eye(n), None, stiffness, contacts=contacts, loads={"push": 10.0 * push})


def alone(system: System, mu: float, monkeypatch: pytest.MonkeyPatch) -> SteadySliding:
    with monkeypatch.context() as patch:
        patch.setattr(equilibrium.Equilibrium, "_by_prepared", lambda self, active: None)
        return steady_sliding(system, mu=mu)


def together(
    system: System, mu: float, monkeypatch: pytest.MonkeyPatch, held: BoolArray | None = None
) -> SteadySliding:
    """By prepared factors, or not at all."""
    with monkeypatch.context() as patch:
        patch.setattr(equilibrium.Equilibrium, "_linear", None)
        return steady_sliding(system, mu=mu, held=held)


def prepared_of(system: System) -> prepared.Prepared | None:
    preparing: prepared.Preparing = system.of_matrices.once("equilibria prepared", prepared.Preparing)
    return preparing.prepared


def assert_same(found: SteadySliding, own: SteadySliding) -> None:
    np.testing.assert_array_equal(found.active, own.active)
    np.testing.assert_array_equal(found.sense, own.sense)
    for name in ("normal_force", "friction_force", "displacement", "gap"):
        mine, theirs = getattr(found, name), getattr(own, name)
        size = max(float(np.abs(own.displacement).max()) if name == "gap" else 0.0, float(np.abs(theirs).max()), 1e-30)
        np.testing.assert_allclose(mine, theirs, rtol=0, atol=1e-11 * size, err_msg=name)
    assert found.residual < equilibrium.BALANCED


@pytest.mark.parametrize("kind", [{}, {"closed": True}, {"held": False}, {"skewed": True}])
def test_random_contacts_that_lift_off(kind: dict[str, bool], monkeypatch: pytest.MonkeyPatch) -> None:
    changed = lifted = 0
    for seed in range(8):
        system, sets = random_system(seed, **kind), set[bytes]()
        for mu in FRICTION:
            own = alone(system, mu, monkeypatch)
            assert_same(together(system, mu, monkeypatch), own)
            sets.add(own.active.tobytes())
            lifted += not np.all(own.active)
        assert prepared_of(system) is not None
        changed += len(sets) > 1
    assert changed >= 3
    assert lifted >= 30


def test_sets_that_are_given_whatever_the_signs(monkeypatch: pytest.MonkeyPatch) -> None:
    system, pulls = random_system(3), 0
    for k in range(6):
        held = np.random.default_rng(k).random(MANY) < 0.6
        with monkeypatch.context() as patch:
            patch.setattr(equilibrium.Equilibrium, "_by_prepared", lambda self, active: None)
            own = steady_sliding(system, mu=0.4, held=held)
        found = together(system, 0.4, monkeypatch, held)
        np.testing.assert_allclose(found.normal_force, own.normal_force, atol=1e-11 * np.abs(own.normal_force).max())
        pulls += bool(np.any(own.normal_force < 0.0))
    assert pulls >= 2


def test_what_contacts_do_not_hold_is_solved_by_itself() -> None:
    """A body that friction alone keeps from drifting: no springs along the normals hold it."""
    size = 2
    system = System.from_matrices(
        np.eye(size), None, np.zeros((size, size)),
        contacts={"a": {"normal": [0, 1], "tangent": [1, 0], "stiffness": 1e6, "friction": RUBS}}, loads={"push": [0.3, -1.0]},
    )  # fmt: skip
    for _ in range(3):
        with pytest.raises(AnalysisError, match="can move freely"):
            steady_sliding(system, mu=0.3)
    assert prepared_of(system) is None


@pytest.mark.parametrize("wrong", ["by_normal", "by_tangent"])
def test_an_answer_that_does_not_balance_is_not_taken(wrong: str, monkeypatch: pytest.MonkeyPatch) -> None:
    system = random_system(2)
    steady_sliding(system, mu=0.2)
    known = prepared_of(system)
    assert known is not None
    getattr(known, wrong)[...] *= -3.0
    own = alone(system, 0.5, monkeypatch)
    assert_same(steady_sliding(system, mu=0.5), own)


def test_what_takes_too_much_memory_or_other_nodes(monkeypatch: pytest.MonkeyPatch) -> None:
    system = random_system(4)
    steady_sliding(system, mu=0.2)
    first = prepared_of(system)
    assert first is not None
    others = replace(system, contacts=system.contacts[:-1])
    assert others.of_matrices is system.of_matrices
    assert_same(together(others, 0.2, monkeypatch), alone(others, 0.2, monkeypatch))
    second = prepared_of(system)
    assert second is not None
    assert second is not first
    monkeypatch.setattr(prepared, "LARGEST", 0.0)
    large = random_system(4)
    assert_same(steady_sliding(large, mu=0.2), alone(large, 0.2, monkeypatch))
    assert prepared_of(large) is None


def test_in_space_with_stiffness_and_rigid(monkeypatch: pytest.MonkeyPatch) -> None:
    for stiffness in (1e13, "rigid"):
        system = build_system(loads(slider(space=True, stiffness=stiffness, mu=0.1)))
        for mu in FRICTION:
            assert_same(together(system, mu, monkeypatch), alone(system, mu, monkeypatch))
        assert prepared_of(system) is not None


def test_where_nothing_touches_nothing_is_prepared(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(prepared, "FEWEST", 1)  # the first set is solved alone, of the second nobody is a member
    system = random_system(3)
    apart = System.from_matrices(
        system.mass, None, system.stiffness, loads={"away": -system.loads["push"]},
        contacts={"c0": {"normal": {0: 1.0}, "tangent": {1: 1.0}, "gap": 1e3, "friction": RUBS, "stiffness": "rigid"}},
    )  # fmt: skip
    with pytest.raises(AnalysisError, match="no contact"):
        steady_sliding(apart, mu=0.3)
    assert prepared_of(apart) is None

"""Parts of a system that nothing damps beside others that are damped: their modes meet on the axis, as double roots."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

import stridor as st
from stridor.modal.checked_onsets import checked_onsets
from stridor.modal.histories import StabilityChange, unbalanced
from stridor.modal.krylov import krylov_onsets
from stridor.modal.onset import Onset
from stridor.system import build_system

pytestmark = pytest.mark.verification

HZ = 2.0
BELT = {"type": "obstacle", "shape": "flat", "point": (0, 0), "normal": (0, 1), "sliding": {"velocity": (-1, 0)}}


def spring(body: str, degrees: float, stiffness: float, **others: float) -> dict[str, Any]:
    angle = np.radians(degrees)
    direction = (float(np.cos(angle)), float(np.sin(angle)))
    return {"between": (body, "ground"), "direction": direction, "stiffness": stiffness, **others}


def minimal_model(damping: float, cubic: float) -> st.Case:
    """The minimal model of mode coupling, of which two modes meet at μ = 3/4 with ω² = 2, and a mass on its own that a
    dashpot damps; where its spring is cubic, the matrices depend on μ by the equilibrium at each."""
    root = 3**0.5
    return st.Case(
        units="nondimensional",
        bodies={
            "m": {"type": "mass", "mass": 1.0, "position": (0, 0)},
            "q": {"type": "mass", "mass": 1.0, "position": (5, 0)},
            "belt": BELT,
        },
        springs={
            "k1": spring("m", 150, 2 / 3 * (2 - root)), "k2": spring("m", 30, 2 / 3 * (2 + root)),
            "a": spring("q", 0, 1.3, cubic=cubic), "b": spring("q", 90, 3.1),
        },
        dashpots={"d": {"between": ("q", "ground"), "direction": (1, 1), "damping": damping}},
        loads={"press": {"at": "m", "force": (0, -1)}, "pull": {"at": "q", "force": (0.3, 0)}},
        contacts={
            "rub": {
                "slave": "m", "master": "belt", "stiffness": 4 / 3,
                "friction": {"law": "coulomb", "coefficient": 0.5},
            }
        },
        modal={"max_frequency_hz": 1.0, "friction_range": [0.0, 1.0], "source": "krylov"},
    )  # fmt: skip


@pytest.mark.parametrize(("damping", "cubic"), [(0.1, 0.0), (1e-4, 0.0), pytest.param(0.1, 1.0, marks=pytest.mark.slow)])
def test_two_modes_that_nothing_damps_meet_as_if_nothing_were_damped(damping: float, cubic: float) -> None:
    found = st.onsets(minimal_model(damping, cubic))
    (onset,) = found.onsets
    assert found.damped
    assert found.complete
    assert onset.mu == pytest.approx(0.75, rel=1e-12)
    assert 2 * np.pi * onset.frequency_hz == pytest.approx(2**0.5, rel=1e-9)
    assert onset.growth_slope is None
    assert onset.square_root_coefficient == pytest.approx(1 / 6**0.5, rel=1e-9)


class Pieces:
    """Masses on springs, none connected to another, pressed on one belt: some damped, some not."""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.tables: dict[str, dict[str, Any]] = {"bodies": {"belt": BELT}, "springs": {}, "loads": {}, "contacts": {}}
        self.parts: list[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, bool]] = []
        for k in range(int(rng.integers(2, 4))):
            mass, slant, rate = float(rng.uniform(0.5, 2)), float(rng.uniform(20, 60)), float(rng.uniform(0.5, 3))
            damps = k == 0 or (k > 1 and rng.random() < 0.5)
            stiffness, damping = np.zeros((2, 2)), np.zeros((2, 2))
            body = f"m{k}"
            self.tables["bodies"][body] = {"type": "mass", "mass": mass, "position": (0.0, 0.0)}
            along, across = np.cos(np.radians(slant)), np.sin(np.radians(slant))
            contact = rate * along * across / float(rng.uniform(0.1, 1.8))
            upright = max(0.2, rate * (along**2 - across**2)) + float(rng.uniform(0, 1))
            # Both frequencies are nearly the same, so that the two modes meet about K₁₂/c.
            level = upright + contact + rate * (across**2 - along**2) + float(rng.uniform(-0.15, 0.3)) * contact
            for j, (degrees, size) in enumerate(((slant, rate), (90.0, upright), (0.0, level))):
                rub = float(10 ** rng.uniform(-4, -1)) if damps else 0.0
                one = spring(body, degrees, float(size), damping=rub)
                self.tables["springs"][f"s{k}{j}"] = one
                direction = np.outer(one["direction"], one["direction"])
                stiffness += size * direction
                damping += rub * direction
            self.tables["loads"][f"l{k}"] = {"at": body, "force": (0.0, -1.0)}
            law = {"law": "coulomb", "coefficient": 0.3}
            self.tables["contacts"][f"c{k}"] = {"slave": body, "master": "belt", "stiffness": float(contact), "friction": law}
            # The belt goes to the left, and friction −μp pulls each mass along, where p = −c y.
            self.parts.append((np.eye(2) * mass, damping, stiffness, np.array([[0, -contact], [0, 0]]), damps))
            stiffness[1, 1] += contact

    def case(self) -> st.Case:
        modal = {"max_frequency_hz": HZ, "friction_range": [0.0, 1.5], "source": "krylov"}
        return st.Case(units="nondimensional", modal=modal, **self.tables)

    def onsets(self) -> list[tuple[float, bool]]:
        """μ of each onset, and whether growth ends there: of what nothing damps in closed form, of the rest by a grid."""
        found: list[tuple[float, bool]] = []
        for mass, damping, stiffness, push, damps in self.parts:
            if damps:
                found += _damped(mass, damping, stiffness, push)
                continue
            a, b = stiffness / mass[0, 0], push / mass[0, 0]
            # The discriminant (tr² − 4 det)/4 of A + μB, with tr B = det B = 0, is linear in μ.
            first = (np.trace(a) ** 2 - 4 * np.linalg.det(a)) / 4
            slope = a[1, 0] * b[0, 1]
            mu = -first / slope
            if 0 < mu < 1.5:
                found.append((mu, slope > 0))
        return sorted(found)


def _damped(mass: np.ndarray, damping: np.ndarray, stiffness: np.ndarray, push: np.ndarray) -> list[tuple[float, bool]]:
    def growth(mu: float) -> float:
        inverse = np.linalg.inv(mass)
        lower = np.hstack([-inverse @ (stiffness + mu * push), -inverse @ damping])
        return float(np.linalg.eigvals(np.vstack([np.eye(4)[2:], lower])).real.max())

    grid = np.linspace(0.0, 1.5, 301)
    return [
        (brentq(growth, a, b, xtol=1e-14), growth(a) > 0) for a, b in pairwise(grid) if growth(a) * growth(b) < 0
    ]


MANY = [pytest.param(range(k, k + 25), marks=pytest.mark.slow) for k in (2, *range(8, 208, 25))]


@pytest.mark.parametrize("seeds", [range(2), *MANY], ids=lambda seeds: f"from {seeds[0]}")
def test_random_pieces_against_their_own_onsets(seeds: range) -> None:
    undamped = 0
    for seed in seeds:
        pieces = Pieces(seed)
        truth, found = pieces.onsets(), st.onsets(pieces.case())
        told = [(o.mu, o.stabilising) for o in found.onsets]
        assert len(told) == len(truth), f"seed {seed}: {told} instead of {truth}"
        np.testing.assert_allclose([m for m, _ in told], [m for m, _ in truth], rtol=1e-8, err_msg=f"seed {seed}")
        assert [e for _, e in told] == [e for _, e in truth], f"seed {seed}"
        assert found.complete, f"seed {seed}: {found.completeness}"
        undamped += sum(o.growth_slope is None for o in found.onsets)
    assert undamped >= len(seeds) / 3


def onset(mu: float, *, ends: bool = False) -> Onset:
    return Onset(mu, 1.0, "flutter", True, ends, (1, 2), 0.0, None, 1.0)


def test_what_begins_and_ends_is_held_against_what_grows_at_both_ends() -> None:
    begins, ends = StabilityChange(0.1, (0,), onset(0.1)), StabilityChange(0.2, (0,), onset(0.2, ends=True))
    none, one, two = np.zeros(0, dtype=complex), np.array([0.1 + 1j]), np.array([0.1 + 1j, 0.1 + 2j])
    assert unbalanced([begins], none, one) == 0
    assert unbalanced([begins, ends], none, none) == 0
    assert unbalanced([begins, ends], none, one) == -2
    assert unbalanced([begins], none, none) == 2
    assert unbalanced([], none, two) == -4
    # Modes that are one begin to grow at one onset.
    assert unbalanced([begins, begins], none, two) == 0
    assert unbalanced([begins, begins], none, one) == 0
    # Above the band what is not solved may be or not be.
    assert unbalanced([StabilityChange(0.1, (0,), None, (0, 2))], none, one) == 0
    assert unbalanced([StabilityChange(0.1, (0,), None, (0, 2))], none, two) == -2


def test_a_list_that_does_not_sum_up_is_not_complete() -> None:
    system = build_system(minimal_model(0.1, 0.0))
    found = krylov_onsets(system, (0.0, 1.0), max_frequency_hz=1.0)
    assert found.unbalanced == 0
    assert checked_onsets(system, found, damped=True, follow=()).complete
    wrong = checked_onsets(system, replace(found, unbalanced=2), damped=True, follow=())
    assert not wrong.complete
    assert "growth of 2 more eigenvalues" in wrong.completeness

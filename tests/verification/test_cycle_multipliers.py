"""Floquet's multipliers by harmonic balance: against differences of motions that the equations of motion are integrated
for here, over one period."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import linear_sum_assignment

import stridor as st
from stridor.periodic import Cycle
from stridor.periodic.harmonic import Balanced, hill, sampling
from stridor.periodic.harmonic.monodromy import by_monodromy

pytestmark = pytest.mark.verification

hills: Any = sys.modules["stridor.periodic.harmonic.hill"]  # the package has its function of this name


class Masses:
    """Two masses in the plane, one of them pressed on a belt, with friction that falls from ``rest`` to half of it."""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.mass = np.repeat(rng.uniform(0.5, 2.0, 2), 2)
        rows = rng.normal(size=(5, 4))
        rows[:2, 2:] = rows[2:4, :2] = 0.0
        rows[4, 2:] = -rows[4, :2]
        rows /= np.linalg.norm(rows, axis=1)[:, None]
        self.stiffness = rows.T @ (rng.uniform(0.3, 3.0, 5)[:, None] * rows)
        self.damping = rows.T @ (10.0 ** rng.uniform(-2.0, -1.0, 5)[:, None] * rows)
        angle = rng.uniform(0.0, 2 * np.pi)
        self.normal = np.array([np.cos(angle), np.sin(angle), 0.0, 0.0])
        self.tangent = np.array([self.normal[1], -self.normal[0], 0.0, 0.0])
        self.spring: Any = 10.0 ** rng.uniform(-0.3, 1.0)
        self.slip, self.rest = rng.uniform(0.3, 1.5), rng.uniform(0.5, 1.0)
        self.decay = self.slip * rng.uniform(0.5, 2.0)
        self.load = -rng.uniform(0.5, 2.0) * self.normal

    def workspace(self) -> st.Workspace:
        law = {
            "law": "weakening", "coefficient": self.rest / 2, "static_coefficient": self.rest,
            "decay_speed": self.decay,
        }  # fmt: skip
        contact: dict[str, Any] = {
            "normal": self.normal, "tangent": self.tangent, "stiffness": self.spring, "friction": law,
            "slip": self.slip,
        }  # fmt: skip
        system = st.System.from_matrices(
            np.diag(self.mass), self.damping, self.stiffness, contacts={"c": contact}, loads={"p": self.load},
            points={"a": np.eye(4)[:2], "b": np.eye(4)[2:]},
        )  # fmt: skip
        return st.Workspace(
            system, modal={"max_frequency_hz": 5.0, "friction_range": [0.0, 1.5]},
            temporal={"watch": ["a", "b"]}, phases=[{"name": "run", "duration": 10.0}],
        )  # fmt: skip

    def rates(self, mu: float) -> Any:
        """ẋ of x = (u, v) while the slip keeps its sign."""

        def falling(speed: float) -> float:
            return self.rest / 2 * (1.0 + float(np.exp(-speed / self.decay)))

        def found(_: float, x: np.ndarray) -> np.ndarray:
            u, v = x[:4], x[4:]
            slip = float(self.tangent @ v) + self.slip
            assert slip > 0.0
            normal = max(0.0, -self.spring * float(self.normal @ u))
            friction = -mu / falling(self.slip) * falling(slip) * normal
            force = self.load - self.stiffness @ u - self.damping @ v + normal * self.normal + friction * self.tangent
            return np.concatenate([v, force / self.mass])

        return found

    def multipliers(self, cycle: Cycle) -> np.ndarray:
        """All eight, by differences."""
        begin = np.concatenate([cycle.displacement[0].ravel(), cycle.velocity[0].ravel()])
        step, rates = 1e-4 * float(np.ptp(cycle.velocity, axis=0).max()), self.rates(cycle.mu)

        def end(x: np.ndarray) -> np.ndarray:
            return solve_ivp(rates, (0.0, cycle.period), x, method="DOP853", rtol=1e-10, atol=1e-13).y[:, -1]

        columns = [(end(begin + step * e) - end(begin - step * e)) / (2 * step) for e in np.eye(8)]
        return np.linalg.eigvals(np.column_stack(columns))


def apart(one: np.ndarray, other: np.ndarray) -> float:
    """How far the farthest of two equally many numbers are, each with its own counterpart."""
    off = np.abs(one[:, None] - other[None, :])
    return float(off[linear_sum_assignment(off)].max())


@pytest.mark.parametrize(
    "seeds", [(7,), pytest.param(range(30), marks=pytest.mark.slow)], ids=["few", "many"]
)
def test_random_cycles_that_only_slip_have_the_multipliers_of_their_motions(seeds: Sequence[int]):
    """None is missing, however far the other modes are above the frequency of the cycle."""
    met = 0
    asked: dict[str, Any] = {"points": 25} if len(seeds) > 2 else {"points": 4, "runs": 0}  # runs are most of the time
    for seed in seeds:
        masses = Masses(seed)
        found = st.cycles(masses.workspace(), between=(0.0, 1.5), method="harmonic", **asked)
        for branch in found.branches:
            for number in branch.cycles[1::3]:
                cycle = found.cycles[number]
                if {"stick", "reversal"} & set(cycle.kinds) or cycle.slip_range[0, 0] < 0.02 * masses.slip:
                    continue
                met += 1
                wanted = masses.multipliers(cycle)
                assert apart(np.append(cycle.multipliers, 1.0), wanted) < 1e-3, (seed, number)
                if cycle.stable is not None:
                    assert cycle.stable is bool(np.abs(wanted).max() < 1.0 + 1e-3), (seed, number)
    assert met > len(seeds)


@pytest.mark.parametrize("rigid", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_hill_and_motions_followed_have_the_same(rigid: bool, monkeypatch: pytest.MonkeyPatch):
    """Each by itself; a rigid contact leaves two motions less, which Hill's determinant has at zero."""
    masses = Masses(7)
    if rigid:
        masses.spring = "rigid"
    compared: list[float] = []

    def both(cycle: Balanced) -> Any:
        one, other = hills.by_hill(cycle), by_monodromy(cycle)
        assert other is not None
        assert len(other) == (6 if rigid else 8)
        one = one[np.argsort(-np.abs(one))]
        assert np.abs(one[len(other) :]).max(initial=0.0) < 1e-6
        compared.append(apart(one[: len(other)], other))
        return hill(cycle)

    monkeypatch.setattr(sampling, "hill", both)
    assert st.cycles(masses.workspace(), between=(0.0, 1.5), method="harmonic", points=6, runs=0).cycles
    assert len(compared) > 4
    assert max(compared) < 1e-5


def test_of_each_exponent_one_copy_is_taken():
    """Exponents far above ω, beside negative multipliers and others alike, from their copies, centred one apart."""
    rng = np.random.default_rng(3)
    for _ in range(50):
        sizes, turns = rng.uniform(0.3, 1.3, 4), rng.uniform(-0.5, 0.5, 4)
        own = sizes * np.exp(2j * np.pi * turns)
        own[1] = own[0] * (1.0 + 1e-3)
        wanted = np.concatenate([own, own.conj(), [-0.8, 0.7]])
        begin = rng.uniform(-0.5, 0.5, 4)
        starts = np.concatenate([begin, -begin, [0.5, 0.0]])
        multipliers, centres = np.repeat(wanted, 15), (starts[:, None] + np.arange(-7, 8)).ravel()
        order = rng.permutation(len(centres))
        found = hills.chosen(multipliers[order], centres[order] + 1e-6 * rng.normal(size=len(centres)))
        assert len(found) == len(wanted)
        assert apart(found, wanted) < 1e-12
        assert np.all(np.diff(np.abs(found)) <= 0.0)


def test_an_exponent_without_a_central_copy_is_missed():
    cycle_like = np.array([1.0, 0.95 * np.exp(1j), 0.95 * np.exp(-1j), 0.5])
    centres = np.array([0.0, 1.2, -1.2, 0.0])
    assert hills._lost(cycle_like, centres, hills.chosen(cycle_like, centres))
    assert not hills._lost(cycle_like, 0.0 * centres, hills.chosen(cycle_like, 0.0 * centres))


def test_missing_multipliers_leave_stability_unknown(monkeypatch: pytest.MonkeyPatch):
    def none(_: Balanced) -> None:
        return None

    monkeypatch.setattr(hills, "by_hill", none)
    monkeypatch.setattr(hills, "by_monodromy", none)
    found = st.cycles(Masses(7).workspace(), between=(0.0, 1.5), method="harmonic", points=2, runs=0)
    assert found.cycles
    assert all(c.stable is None and c.outside is None and not len(c.multipliers) for c in found.cycles)
    assert any("or some of them were not found" in w for w in found.warnings)

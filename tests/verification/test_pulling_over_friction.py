"""Contacts kept closed may push at one μ and pull at another, and friction goes with −N then: each μ has its own signs.

The truth tries all signs at every μ of a grid, takes the one that is consistent, and counts what grows in the dense
problem.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
import scipy.linalg as sl

import stridor as st
from benches import by_hand
from stridor.system import System

pytestmark = pytest.mark.verification

BAND = 10.0  # [1/s], above all modes
NEAR = 2e-3  # of an onset: no grid of the truth tells on which side it is


def bench(seed: int) -> System:
    """A random structure with one to four contacts that are kept closed, some of which pull."""
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(3, 8)), int(rng.integers(1, 5))
    root = rng.normal(size=(n, n))
    stiffness = root @ root.T + 0.5 * np.eye(n)
    damping = 0.02 * np.eye(n) + 0.005 * stiffness
    made = by_hand(
        np.eye(n), damping, stiffness, rng.normal(size=(m, n)), rng.normal(size=(m, n)), rng.uniform(0.5, 5.0, m),
        loads={"press": rng.normal(size=n)}, slip=float(rng.choice([-1.0, 1.0])),
    )  # fmt: skip
    return replace(made, contacts=tuple(replace(c, closed=True) for c in made.contacts))


def dense(system: System, mu: float, signs: tuple[float, ...]) -> np.ndarray:
    """K (n, n) at μ where friction on contact k is signs[k] μ N against the slip."""
    stiffness = system.stiffness.toarray()
    for c, sign in zip(system.contacts, signs, strict=True):
        push = c.normal_row - sign * mu * np.sign(c.tangent_lift.sum()) * c.tangent_row
        stiffness = stiffness + c.stiffness * np.outer(push, c.normal_row)
    return stiffness


def growing(system: System, mu: float) -> int | None:
    """How many modes grow at μ by the dense problem; None where no signs or several are consistent, or a rate is next
    to none."""
    normals = np.array([c.normal_row for c in system.contacts])
    stiff = np.array([c.stiffness for c in system.contacts])
    own = [
        signs
        for signs in product((1.0, -1.0), repeat=len(stiff))
        if np.array_equal(np.sign(-stiff * (normals @ np.linalg.solve(dense(system, mu, signs), system.loads["press"]))), signs)
    ]  # fmt: skip
    if len(own) != 1:
        return None
    n = system.size
    state = np.block([[np.zeros((n, n)), np.eye(n)], [-dense(system, mu, own[0]), -system.damping.toarray()]])
    lam = sl.eigvals(state)
    return None if np.abs(lam.real).min() < 1e-6 else int(np.count_nonzero((lam.real > 0) & (lam.imag >= 0)))


def grid(system: System, end: float, count: int) -> Iterator[tuple[float, int]]:
    for mu in np.linspace(0.0, end, count).tolist():
        if (number := growing(system, mu)) is not None:
            yield mu, number


def compared(seed: int, end: float = 1.5) -> int:
    """At how many μ the list of modes and the onsets are compared with the truth, and equal to it."""
    system = bench(seed)
    truth = dict(grid(system, end, 31))
    assert 0.0 in truth, "without friction there is one equilibrium"
    found = st.modes(system, list(truth), max_frequency_hz=BAND)
    onsets = st.onsets(system, (0.0, end), max_frequency_hz=BAND)
    looked = 0
    for row, (mu, number) in enumerate(truth.items()):
        values = found.eigenvalues[row]
        if np.isnan(values).all():
            continue
        assert np.count_nonzero((values.real > 0) & (values.imag >= 0)) == number, (seed, mu)
        if any(abs(mu - o.mu) < NEAR for o in onsets) or not onsets.complete:
            continue
        assert truth[0.0] + sum(-1 if o.stabilising else 1 for o in onsets if o.mu < mu) == number, (seed, mu)
        looked += 1
    return looked


@pytest.mark.parametrize("seed", range(6))
def test_each_friction_has_its_own_signs(seed: int) -> None:
    assert compared(seed) > 10


def test_what_pulls_is_told_stretch_by_stretch() -> None:
    notes = " ".join(st.onsets(bench(1), (0.0, 1.5), max_frequency_hz=BAND).notes)
    assert "contact nodes other ones pull, of those kept closed, in steady sliding as friction grows" in notes


@pytest.mark.slow
def test_many() -> None:
    # Not where there are several equilibria: which of them a μ has, another one beside it need not have.
    alone = [seed for seed in range(6, 400) if None not in (growing(bench(seed), mu) for mu in (1.25, 1.5))]
    assert len(alone) > 200
    for seed in alone:
        compared(seed)

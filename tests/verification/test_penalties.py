"""A penalty on the diagonal of K holds a freedom: the modes are those without it, and stay as well known as these."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as sl
import scipy.sparse as sp

from stridor.modal.quadratic import Quadratic, Region, find_modes
from stridor.modal.quadratic.dense import all_modes

pytestmark = pytest.mark.verification

HZ = 1000.0
SEEDS = [*range(6), *(pytest.param(k, marks=pytest.mark.slow) for k in range(6, 120))]


def matrices(rng: np.random.Generator) -> list[np.ndarray]:
    """M, D with gyroscopic forces, and K with circulatory ones, of frequencies from 20 to 800 Hz."""
    n = int(rng.integers(6, 15))
    shape = np.eye(n) + 0.3 * rng.normal(size=(n, n)) / np.sqrt(n)
    turn = sl.qr(rng.normal(size=(n, n)))[0]
    squares = (2 * np.pi * rng.uniform(20, 800, n)) ** 2
    mass, stiffness = shape.T @ shape, shape.T @ turn @ np.diag(squares) @ turn.T @ shape
    gyroscopic, circulatory = rng.normal(size=(2, n, n))
    damping = mass + 1e-6 * stiffness + 10 * (gyroscopic - gyroscopic.T)
    return [mass, damping, stiffness + 0.02 * np.median(squares) * circulatory]


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("penalty", [1e15, 1e18, 1e20])
@pytest.mark.parametrize("held", [1, 3])
def test_modes_are_those_of_what_is_held(seed: int, penalty: float, held: int) -> None:
    rng = np.random.default_rng([seed, 15])
    parts = matrices(rng)
    n = len(parts[0])
    chosen = rng.choice(n, held, replace=False)
    free = np.setdiff1d(np.arange(n), chosen)
    rest = [a[np.ix_(free, free)] for a in parts]
    parts[2][chosen, chosen] += penalty
    problem = Quadratic(*(sp.csr_array(a) for a in parts))
    values, right, left = all_modes(problem, 2 * np.pi * HZ)
    near = np.abs(values) < 4 * np.pi * HZ
    values, right, left = values[near], right[:, near], left[:, near]
    assert problem.backward_error(values, right).max() <= 1e-10
    assert problem.transposed.backward_error(values, left).max() <= 1e-10
    true = eigenvalues(rest[0], rest[1], rest[2])
    for lam in true[np.abs(true) < 2 * np.pi * HZ]:
        # What the penalty gives way at this λ, by its Schur complement: up to 2e-9 with 1e15.
        whole = lam**2 * parts[0] + lam * parts[1] + parts[2]
        inner, there = whole[np.ix_(chosen, chosen)], whole[np.ix_(chosen, free)]
        nearly = eigenvalues(rest[0], rest[1], rest[2] - whole[np.ix_(free, chosen)] @ np.linalg.solve(inner, there))
        exact = nearly[np.argmin(np.abs(nearly - lam))]
        assert np.abs(values - exact).min() <= 1e-9 * abs(exact)


def eigenvalues(mass: np.ndarray, damping: np.ndarray, stiffness: np.ndarray) -> np.ndarray:
    """All of them, of a regular mass."""
    unit = 2 * np.pi * HZ
    k, d = (np.linalg.solve(mass, a) for a in (stiffness, damping))
    return unit * sl.eigvals(np.block([[np.zeros_like(k), np.eye(len(k))], [-k / unit**2, -d / unit]]))


def test_a_band_is_answered() -> None:
    """More than a dozen modes, too many to be improved one by one."""
    rng = np.random.default_rng([0, 15])
    while len((parts := matrices(rng))[0]) < 14:
        continue
    parts[2][4, 4] = 1e16
    found = find_modes(Quadratic(*(sp.csr_array(a) for a in parts)), Region.band(0.0, HZ, above=-100.0), left=True)
    assert len(found.values) >= 12
    assert found.residual.max() <= 1e-10

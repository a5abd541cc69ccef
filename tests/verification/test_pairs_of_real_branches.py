"""Two overdamped real branches that meet and begin to oscillate are one mode from there on."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as sl

import stridor as st
from stridor.system import System

pytestmark = pytest.mark.verification
STIFFNESS = np.array([[3.0, -2, -3], [-2, 2, 2], [-3, 2, 3]])
VALUES = [0.0, 0.5, 1.0, 1.5, 1.8, 1.9]


@pytest.fixture
def system() -> System:
    contact = {
        "normal": [1, -1, 0], "tangent": [0, 1, 0], "stiffness": 16.0, "friction": {"law": "coulomb", "coefficient": 1.9},
        "slip": -1.0,
    }  # fmt: skip
    return st.System.from_matrices(np.eye(3), 4 * np.eye(3), STIFFNESS, contacts={"c0": contact})


def upper(mu: float) -> list[complex]:
    """λ of λ² + 4λ + κ = 0 for each eigenvalue κ of the stiffness with contact and friction, Im λ ≥ 0."""
    normal, tangent = np.array([1.0, -1, 0]), np.array([0.0, 1, 0])
    kappa = sl.eigvals(STIFFNESS + 16 * np.outer(normal + mu * tangent, normal))
    every = np.concatenate([-2 + np.sqrt(4 - kappa + 0j), -2 - np.sqrt(4 - kappa + 0j)])
    return sorted(every[every.imag >= 0].tolist(), key=lambda lam: (round(lam.real, 9), lam.imag))


@pytest.mark.parametrize("vectors", [False, True])
def test_one_of_each_pair_is_listed(system: System, vectors: bool) -> None:
    found = st.modes(system, VALUES, max_frequency_hz=10.0, vectors=vectors)
    assert found.source == "receptance"
    assert found.unstable.sum(axis=1).tolist() == [0, 0, 0, 0, 1, 1]
    assert found.branch.tolist() == [1, 2, 3, 4, 5]
    for mu, values, residual in zip(VALUES, found.eigenvalues, found.residual, strict=True):
        known = np.isfinite(values)
        assert np.array_equal(known, np.isfinite(residual))
        listed = sorted(values[known].tolist(), key=lambda lam: (round(lam.real, 9), lam.imag))
        assert listed == pytest.approx(upper(mu), rel=1e-9)
    # The names go on at every μ.
    assert np.isfinite(found.eigenvalues).all(axis=0).tolist() == [True, False, True, False, True]


def test_at_one_mu_it_is_listed_once(system: System) -> None:
    found = st.modes(system, 1.9, max_frequency_hz=10.0)
    assert found.branch.tolist() == [1, 3, 5]
    assert found.unstable.tolist() == [[True, False, False]]
    assert np.all(found.frequency_hz > 0)

"""One eigenvalue or a few of the projected problem, followed without solving for all the others."""

from __future__ import annotations

import numpy as np
import scipy.linalg as sl

from ...typing import ComplexArray
from .reduced import Reduced

NEIGHBOURS = 12  # eigenvectors that span the surroundings of an eigenvalue
STEPS = 12


def refined(
    reduced: Reduced, mu: float, lam: complex, right: ComplexArray, left: ComplexArray
) -> tuple[complex, ComplexArray, ComplexArray] | None:
    """The eigenvalue near λ at μ with right and left vectors (r,), from those nearby: two-sided inverse iteration,
    whose Rayleigh functional converges cubically. None where it does not settle."""
    mass, damping, stiffness = (np.asarray(m) for m in reduced.matrices(mu))
    z, y = right / np.linalg.norm(right), left / np.linalg.norm(left)
    for _ in range(STEPS):
        matrix = lam**2 * mass + lam * damping + stiffness
        by_lambda = 2 * lam * mass + damping
        with np.errstate(all="ignore"):
            try:
                factor = sl.lu_factor(matrix, check_finite=False)
            except (sl.LinAlgError, ValueError):
                return None
            z = sl.lu_solve(factor, by_lambda @ z, check_finite=False)
            y = sl.lu_solve(factor, by_lambda.T @ y, trans=1, check_finite=False)
            z, y = z / np.linalg.norm(z), y / np.linalg.norm(y)
            change = (y @ (matrix @ z)) / (y @ (by_lambda @ z))
        if not np.isfinite(change) or not np.all(np.isfinite(z)):
            return None
        lam = complex(lam - change)
        if abs(change) <= 1e-13 * abs(lam):
            return lam, z, y
    return None


def axis_crossing(
    reduced: Reduced, mu: float, lam: complex, right: ComplexArray, left: ComplexArray, low: float, high: float
) -> tuple[float, complex, float] | None:
    """μ at which Re λ of one mode vanishes, λ there and dRe λ/dμ, by Newton from a guess; None where it leaves the
    surroundings of [low, high]."""
    width = high - low
    for _ in range(STEPS):
        found = refined(reduced, mu, lam, right, left)
        if found is None:
            return None
        lam, right, left = found
        slope = _slope(reduced, mu, lam, right, left)
        change = -lam.real / slope.real if slope.real else np.inf
        if abs(change) <= 1e-13 * max(abs(mu), 1e-3):
            return mu, lam, slope.real
        if not low - width <= mu + change <= high + width or mu + change < 0:
            return None
        mu, lam = mu + change, lam + slope * change
    return None


def _slope(reduced: Reduced, mu: float, lam: complex, right: ComplexArray, left: ComplexArray) -> complex:
    """dλ/dμ of a simple eigenvalue."""
    step = 1e-5 * max(mu, 1e-3)
    low, high = (
        lam * (np.asarray(damping) @ right) + np.asarray(stiffness) @ right
        for _, damping, stiffness in (reduced.matrices(max(mu - step, 0.0)), reduced.matrices(mu + step))
    )
    mass, damping, _ = reduced.matrices(mu)
    by_lambda = 2 * lam * (np.asarray(mass) @ right) + np.asarray(damping) @ right
    return complex(-(left @ (high - low)) / (mu + step - max(mu - step, 0.0)) / (left @ by_lambda))


class Surroundings:
    """The projected problem on the eigenvectors nearest to one λ at one μ, right and left: exact there, and what these
    modes do to each other as μ changes is in it."""

    def __init__(self, reduced: Reduced, lam: complex, mu: float) -> None:
        found = reduced.eigenpairs(mu)
        near = np.argsort(np.abs(found.values - lam))[:NEIGHBOURS]
        self.reduced = reduced
        self.right, self.left = (v[:, near] / np.linalg.norm(v[:, near], axis=0) for v in (found.right, found.left))

    def values(self, mu: complex) -> ComplexArray:
        """Eigenvalues (2q,) [1/s] at a real or complex μ."""
        mass, damping, stiffness = (self.left.T @ (np.asarray(m) @ self.right) for m in self.reduced.matrices(mu))
        # Scaled by a typical frequency so that the companion is balanced.
        unit = self.reduced.frequency
        size = len(mass)
        first = np.block([[np.zeros((size, size)), np.eye(size)], [-stiffness, -unit * damping]])
        second = sl.block_diag(np.eye(size), unit**2 * mass)
        with np.errstate(all="ignore"):
            found: ComplexArray = sl.eigvals(first, second) * unit
        return found[np.isfinite(found)]

"""One eigenvalue or a few of the projected problem, followed without solving for all the others."""

from __future__ import annotations

import numpy as np
import scipy.linalg as sl

from ...direct.dense import lu_factors
from ...typing import ComplexArray
from .reduced import Eigenpairs, Reduced

NEIGHBOURS = 12  # eigenvectors that span the surroundings of an eigenvalue
STEPS = 12


def refined(
    reduced: Reduced, mu: float, lam: complex, right: ComplexArray, left: ComplexArray
) -> tuple[complex, ComplexArray, ComplexArray] | None:
    """The eigenvalue near λ at μ with right and left vectors (r,), from those nearby: two-sided inverse iteration,
    whose Rayleigh functional converges cubically. None where it does not settle."""
    mass, damping, stiffness = reduced.matrices(mu)
    z, y = right / np.linalg.norm(right), left / np.linalg.norm(left)
    for _ in range(STEPS):
        matrix = lam**2 * mass + lam * damping + stiffness
        by_lambda = 2 * lam * mass + damping
        with np.errstate(all="ignore"):
            try:
                factor = lu_factors(matrix, check_finite=False)
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
    by_damping, by_stiffness = reduced.slopes(mu)
    mass, damping, _ = reduced.matrices(mu)
    change = lam * (by_damping @ right) + by_stiffness @ right
    by_mass = reduced.mass_slope(mu)
    if by_mass is not None:
        change = change + lam**2 * (by_mass @ right)
    by_lambda = 2 * lam * (mass @ right) + damping @ right
    return complex(-(left @ change) / (left @ by_lambda))


class Surroundings:
    """The projected problem on the eigenvectors nearest to one λ at one μ, right and left (r, q): exact there, and what
    these modes do to each other as μ changes is in it."""

    def __init__(self, reduced: Reduced, found: Eigenpairs, lam: complex) -> None:
        near = np.argsort(np.abs(found.values - lam))[:NEIGHBOURS]
        self.reduced = reduced
        self.right, self.left = (
            v / np.linalg.norm(v, axis=0)
            for v in (reduced.padded(found, found.right[:, near]), reduced.padded(found, found.left[:, near]))
        )

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


def double_eigenvalue(reduced: Reduced, mu: complex, lam: complex) -> tuple[complex, complex, complex] | None:
    """Complex μ at which two eigenvalues meet near λ, λ there and the square κ² of λ ≈ λ_c ± κ √(μ − μ_c), by Newton;
    None where it does not settle.

    The bordered matrix [[P, b], [cᵀ, 0]] stays regular where P has one null vector. With x, y and g solving

        P x + b g = 0, cᵀx = 1,      Pᵀy + c g = 0, bᵀy = 1

    g(λ, μ) is zero at eigenvalues and simple at simple ones, ∂g = −yᵀ ∂P x: two meet where g = g_λ = 0, and there
    κ² = −2 g_μ / g_λλ (Govaerts, Numerical Methods for Bifurcations of Dynamical Equilibria, SIAM 2000, ch. 3).
    """
    mu, lam = complex(mu), complex(lam)
    row, column = reduced.null_vectors(lam, mu)
    b, c = column.conj() / np.linalg.norm(column), row.conj() / np.linalg.norm(row)

    def at(mu: complex, lam: complex) -> tuple[complex, complex, complex]:
        """g, g_λ and g_μ."""
        mass, damping, stiffness = reduced.matrices(mu)
        by_damping, by_stiffness = _complex_slopes(reduced, mu)
        size = len(mass)
        # Rows of one size: the problem's own are scaled by what P is made of.
        scale = 1.0 / max(float(np.abs(stiffness).max()), 1e-300)
        whole = np.zeros((size + 1, size + 1), dtype=complex)
        whole[:size, :size] = scale * (lam**2 * mass + lam * damping + stiffness)
        whole[:size, size], whole[size, :size] = b, c
        factor = lu_factors(whole, check_finite=False)
        unit = np.zeros(size + 1, dtype=complex)
        unit[size] = 1.0
        x, y = (sl.lu_solve(factor, unit, trans=t, check_finite=False) for t in (0, 1))
        z, w = x[:size], y[:size]
        by_lam = -scale * (w @ (2 * lam * (mass @ z) + damping @ z))
        return complex(x[size]), complex(by_lam), complex(-scale * (w @ (lam * (by_damping @ z) + by_stiffness @ z)))

    with np.errstate(all="ignore"):
        for _ in range(2 * STEPS):
            try:
                g, g_lam, g_mu = at(mu, lam)
                small_lam, small_mu = 1e-6 * abs(lam), 1e-6 * max(abs(mu), 1e-3)
                twice = (at(mu, lam + small_lam)[1] - at(mu, lam - small_lam)[1]) / (2 * small_lam)
                mixed = (at(mu + small_mu, lam)[1] - at(mu - small_mu, lam)[1]) / (2 * small_mu)
            except (sl.LinAlgError, ValueError):
                return None
            determinant = g_lam * mixed - g_mu * twice
            change_lam = -(g * mixed - g_mu * g_lam) / determinant
            change_mu = -(g_lam * g_lam - twice * g) / determinant
            if not np.isfinite(change_lam + change_mu):
                return None
            lam, mu = lam + change_lam, mu + change_mu
            if abs(change_mu) <= 1e-10 * max(abs(mu), 1e-3) and abs(change_lam) <= 1e-8 * abs(lam):
                return mu, lam, -2 * g_mu / twice
    return None


def _complex_slopes(reduced: Reduced, mu: complex) -> tuple[ComplexArray, ComplexArray]:
    """dC/dμ and dK/dμ at a complex μ."""
    step = 1e-6 * max(abs(mu), 1e-3)
    low, high = reduced.matrices(complex(mu - step)), reduced.matrices(complex(mu + step))
    return (high[1] - low[1]) / (2 * step), (high[2] - low[2]) / (2 * step)

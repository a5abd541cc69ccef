"""The onset as a regular system of equations: a bordered form of the assembled problem.

P(λ, μ) acts on displacements and normal forces together, so that neither a stiff nor a rigid contact
nor a mode that hardly feels the contact costs digits. With b and c near its null vectors,

    [P b; cᵀ 0] [v; f] = [0; 1]

is regular where P is singular and f(λ, μ) = 0 exactly there. Derivatives of f come from the same matrix
with derivatives of P on the right (Govaerts, Numerical Methods for Bifurcations of Dynamical Equilibria,
SIAM 2000, chapter 3).
"""

from __future__ import annotations

import contextlib
from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spl

from ..errors import AnalysisError
from ..typing import Array, ComplexArray, IntArray, Sparse
from .backward_error import common_pattern
from .coupling import Coupling

NEWTON_STEPS = 30
NULL_STEPS = 3


class Bordered:
    """f(λ, μ) and its derivatives for one coupled system, bordered for a root near ``lam``, ``mu``."""

    def __init__(self, coupling: Coupling, lam: complex, mu: float) -> None:
        system, count = coupling.system, coupling.contacts
        rows = system.contact_rows()
        normal, tangent = sp.csr_array(rows[0::2]), sp.csr_array(rows[1::2])
        scale = float(np.abs(system.stiffness).max())
        edge, corner = sp.csr_array((system.size, count)), sp.csr_array((count, count))
        compliance = sp.diags_array(coupling.compliance) * scale**2

        def moved(block: Sparse) -> Sparse:
            return sp.block_array([[block, edge], [edge.T, corner]])

        pushed = -scale * (sp.diags_array(coupling.sense) @ tangent).T
        self.coupling = coupling
        self.size = system.size
        self._scale = scale
        # P = P0 + λ C + λ² M + μ F + λ Σ d t tᵀ, forces counted in units of the largest stiffness.
        self._terms = [
            sp.block_array([[system.stiffness, -scale * normal.T], [scale * normal, compliance]]),
            moved(system.damping),
            moved(system.mass),
            sp.block_array([[sp.csr_array((system.size, system.size)), pushed], [edge.T, corner]]),
            *(moved(sp.csr_array(tangent[[k]].T @ tangent[[k]])) for k in range(count) if coupling.sloped),
        ]
        self._borders = self._null_vectors(lam, mu)
        self._pattern = self._bordered_pattern()

    def _bordered_pattern(self) -> tuple[IntArray, IntArray, Array, ComplexArray]:
        """indptr, indices, data (terms, nnz) and border (nnz) of the terms on one csc pattern."""
        left, right = (v * self._scale for v in self._borders)
        size = len(left)
        nothing = np.zeros((size, size))
        wide = [
            sp.block_array([[term, sp.csr_array((size, 1))], [sp.csr_array((1, size)), None]]).T
            for term in self._terms
        ]
        borders = np.block([[nothing, left[:, None]], [right.conj()[None, :], np.zeros((1, 1))]]).T
        halves = [sp.csr_array(borders.real), sp.csr_array(borders.imag)]
        # A csr pattern of the transposes is a csc pattern of the matrices.
        indptr, indices, data = common_pattern(*wide, *halves)
        return indptr, indices, data[:-2], data[-2] + 1j * data[-1]

    def _factors(self, lam: complex, mu: complex) -> ComplexArray:
        d = self.coupling.friction_damping(float(np.real(mu))) if self.coupling.sloped else np.zeros(0)
        return np.array([1.0, lam, lam**2, mu, *(lam * d)], dtype=complex)

    def problem(self, lam: complex, mu: complex) -> Sparse:
        """P (n + m, n + m)."""
        factors = self._factors(lam, mu)
        return sp.csc_array(sum(f * term for f, term in zip(factors, self._terms, strict=True)))

    def _null_vectors(self, lam: complex, mu: float) -> tuple[ComplexArray, ComplexArray]:
        """Left and right vectors that P(λ, μ) all but takes to zero, by inverse iteration."""
        solver = self._beside(lam, mu)
        rng = np.random.default_rng(0)
        left, right = rng.standard_normal((2, self.size + self.coupling.contacts)).astype(complex)
        for _ in range(NULL_STEPS):
            right = solver.solve(solver.solve(right, trans="H"))
            left = solver.solve(solver.solve(left), trans="H")
            right, left = right / np.linalg.norm(right), left / np.linalg.norm(left)
        return left, right

    def _beside(self, lam: complex, mu: float) -> Any:
        """P factorised a hair off (λ, μ), so that an exact root can be factorised too."""
        for hair in (1e-12, 3e-12, 1e-11, 1e-10):
            # Rounding may hit a pivot of exactly zero even there.
            with contextlib.suppress(RuntimeError):
                return spl.splu(self.problem(lam * (1 + hair), mu * (1 + hair)))
        raise AnalysisError("the coupled problem is singular at every friction coefficient nearby")

    def derivatives(self, lam: complex, mu: complex) -> tuple[complex, complex, complex, complex, complex]:
        """f, f_λ, f_μ, f_λλ, f_λμ."""
        indptr, indices, data, border = self._pattern
        shape = (len(indptr) - 1, len(indptr) - 1)
        d, change = (v if self.coupling.sloped else v[:0] for v in self._friction(mu))

        def combined(factors: list[complex], plus: ComplexArray | float = 0.0) -> Sparse:
            return sp.csc_array(
                (np.array(factors, dtype=complex) @ data + plus, indices, indptr), shape=shape
            )

        whole = combined([1.0, lam, lam**2, mu, *(lam * d)], border)
        by_lambda = combined([0.0, 1.0, 2 * lam, 0.0, *d])
        by_mu = combined([0.0, 0.0, 0.0, 1.0, *(lam * change)])
        second = combined([0.0, 0.0, 2.0, 0.0, *(0.0 * d)])
        mixed = combined([0.0, 0.0, 0.0, 0.0, *change])
        solver = spl.splu(whole)

        def solve(given: ComplexArray) -> tuple[ComplexArray, complex]:
            answer = solver.solve(given)
            answer = answer + solver.solve(given - whole @ answer)
            # The last unknown is f; derivatives of P act on the others.
            return np.append(answer[:-1], 0.0), complex(answer[-1])

        unit = np.zeros(shape[0], dtype=complex)
        unit[-1] = self._scale
        v, f = solve(unit)
        v_l, f_l = solve(-by_lambda @ v)
        v_m, f_m = solve(-by_mu @ v)
        _, f_ll = solve(-second @ v - 2 * by_lambda @ v_l)
        _, f_lm = solve(-mixed @ v - by_lambda @ v_m - by_mu @ v_l)
        return f, f_l, f_m, f_ll, f_lm

    def _friction(self, mu: complex) -> tuple[Array, Array]:
        return self.coupling.friction_damping_slope(float(np.real(mu)))

    def crossing(self, root: complex, mu: float) -> tuple[float, float, float] | None:
        """ω, μ and d Re λ/dμ with λ = jω an eigenvalue, from a guess; None if Newton fails."""
        omega = root.imag
        last = np.inf
        for _ in range(NEWTON_STEPS):
            f, f_l, f_m, _, _ = self.derivatives(1j * omega, mu)
            jacobian = np.array([[(1j * f_l).real, f_m.real], [(1j * f_l).imag, f_m.imag]])
            try:
                change = np.linalg.solve(jacobian, [-f.real, -f.imag])
            except np.linalg.LinAlgError:
                return None
            size = max(abs(change[0]) / max(abs(omega), 1.0), abs(change[1]) / max(abs(mu), 1e-6))
            # Damp the first steps: the guess is a straight line through two followed states.
            factor = min(1.0, 0.1 / size) if size > 0.1 else 1.0
            omega += factor * change[0]
            mu += factor * change[1]
            if size < 1e-13 or (size < 1e-8 and size >= last):
                _, f_l, f_m, _, _ = self.derivatives(1j * omega, mu)
                return omega, mu, float((-f_m / f_l).real)
            last = size
        return None

    def double_root(self, lam: complex, mu: complex, *, real: bool) -> tuple[complex, complex, float] | None:
        """λ, μ with a double eigenvalue and κ of λ ≈ λ_c ± κ √±(μ − μ_c), on the side where it grows.

        κ² = ∓2 f_μ/f_λλ; ``real`` keeps λ on the axis and μ real.
        """
        lam, mu = complex(lam), complex(mu)
        start, start_mu = lam, mu
        last = np.inf
        for _ in range(NEWTON_STEPS):
            # Far from where it began Newton has lost its way, and friction there may have no equilibrium.
            if abs(mu - start_mu) > 0.5 * max(abs(start_mu), 0.1):
                return None
            f, f_l, f_m, f_ll, f_lm = self.derivatives(lam, mu)
            try:
                change = np.linalg.solve(np.array([[f_l, f_m], [f_ll, f_lm]]), [-f, -f_l])
            except np.linalg.LinAlgError:
                return None
            lam, mu = lam + change[0], mu + change[1]
            if real:
                lam, mu = 1j * lam.imag, complex(mu.real)
            if not np.isfinite(lam) or abs(lam - start) > 0.2 * abs(start):
                return None
            size = max(abs(change[0]) / abs(lam), abs(change[1]) / max(abs(mu), 1e-6))
            if size < 1e-13 or (size < 1e-8 and size >= last):
                _, _, f_m, f_ll, _ = self.derivatives(lam, mu)
                root = np.sqrt(-2 * f_m / f_ll + 0j)
                return lam, mu, float(max(abs(root.real), abs(root.imag)))
            last = size
        return None

    def static(self, mu: float) -> float | None:
        """μ at which λ = 0 is an eigenvalue (the tangent stiffness is singular)."""
        last = np.inf
        for _ in range(NEWTON_STEPS):
            f, _, f_m, _, _ = self.derivatives(0j, mu)
            change = float((-f / f_m).real)
            mu += change
            size = abs(change) / max(abs(mu), 1e-6)
            if size < 1e-13 or (size < 1e-8 and size >= last):
                return mu
            last = size
        return None

    def divergence_coefficient(self, mu: float) -> float:
        """κ of λ = ± κ √(μ − μ_c) at an undamped divergence, where f depends on λ² alone."""
        _, _, f_m, f_ll, _ = self.derivatives(0j, mu)
        return float(np.sqrt(abs(2 * f_m / f_ll)))

    def vector(self, lam: complex, mu: float) -> ComplexArray:
        """Right eigenvector (n,) of unit norm."""
        u = self._null_vectors(lam, mu)[1][: self.size]
        return u / np.linalg.norm(u)

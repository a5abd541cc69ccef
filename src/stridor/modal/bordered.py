"""The onset as a regular system of equations: a bordered form of the assembled problem.

P(λ, μ) acts on displacements and normal forces together, so that neither a stiff nor a rigid contact
nor a mode that hardly feels the contact costs digits. With b and c near its null vectors,

    [P b; cᵀ 0] [v; f] = [0; 1]

is regular where P is singular and f(λ, μ) = 0 exactly there. Derivatives of f come from the same matrix
with derivatives of P on the right (Govaerts, Numerical Methods for Bifurcations of Dynamical Equilibria,
SIAM 2000, chapter 3).
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spl

from ..typing import ComplexArray, Sparse
from .coupling import Coupling

NEWTON_STEPS = 30
NULL_STEPS = 3


class Bordered:
    """f(λ, μ) and its derivatives for one coupled system, bordered for a root near ``lam``, ``mu``."""

    def __init__(self, coupling: Coupling, lam: complex, mu: float) -> None:
        system, count = coupling.system, coupling.contacts
        rows = system.contact_rows()
        self.coupling = coupling
        self.size = system.size
        self._normal, self._tangent = sp.csr_array(rows[0::2]), sp.csr_array(rows[1::2])
        self._scale = float(np.abs(system.stiffness).max())
        self._corner = sp.csr_array((count, count))
        self._edge = sp.csr_array((system.size, count))
        self._borders = self._null_vectors(lam, mu)

    def _forces(self, column: Sparse) -> Sparse:
        return sp.csc_array(
            sp.block_array([[sp.csr_array((self.size, self.size)), column], [None, self._corner]])
        )

    def _motion(self, block: Sparse) -> Sparse:
        return sp.csc_array(
            sp.block_array([[block, self._edge], [self._edge.T, self._corner]]), dtype=complex
        )

    def _friction(self, values: np.ndarray) -> Sparse:
        return self._tangent.T @ sp.diags_array(values) @ self._tangent

    def problem(self, lam: complex, mu: complex) -> Sparse:
        """P (n + m, n + m); forces are counted in units of the largest stiffness."""
        system, coupling, scale = self.coupling.system, self.coupling, self._scale
        damping = system.damping + self._friction(coupling.friction_damping(float(np.real(mu))))
        dynamic = lam**2 * system.mass + lam * damping + system.stiffness
        push = (self._normal + sp.diags_array(mu * coupling.sense) @ self._tangent).T
        compliance = sp.diags_array(coupling.compliance) * scale**2
        return sp.csc_array(
            sp.block_array([[dynamic, -push * scale], [self._normal * scale, compliance]]), dtype=complex
        )

    def _slopes(self, lam: complex, mu: complex) -> tuple[Sparse, Sparse, Sparse, Sparse]:
        """P_λ, P_μ, P_λλ, P_λμ."""
        system, coupling = self.coupling.system, self.coupling
        friction, change = (self._friction(d) for d in coupling.friction_damping_slope(float(np.real(mu))))
        pushed = -(sp.diags_array(coupling.sense * self._scale) @ self._tangent).T
        return (
            self._motion(2 * lam * system.mass + system.damping + friction),
            self._forces(pushed) + self._motion(lam * change),
            self._motion(2 * system.mass),
            self._motion(change),
        )

    def _null_vectors(self, lam: complex, mu: float) -> tuple[ComplexArray, ComplexArray]:
        """Left and right vectors that P(λ, μ) all but takes to zero, by inverse iteration."""
        # A hair off, so that an exact root can be factorised too.
        solver = spl.splu(self.problem(lam * (1 + 1e-12), mu * (1 + 1e-12)))
        rng = np.random.default_rng(0)
        left, right = rng.standard_normal((2, self.size + self.coupling.contacts)).astype(complex)
        for _ in range(NULL_STEPS):
            right = solver.solve(solver.solve(right, trans="H"))
            left = solver.solve(solver.solve(left), trans="H")
            right, left = right / np.linalg.norm(right), left / np.linalg.norm(left)
        return left, right

    def derivatives(self, lam: complex, mu: complex) -> tuple[complex, complex, complex, complex, complex]:
        """f, f_λ, f_μ, f_λλ, f_λμ."""
        left, right = self._borders
        matrix = self.problem(lam, mu)
        by_lambda, by_mu, second, mixed = self._slopes(lam, mu)
        whole = sp.csc_array(
            sp.block_array(
                [[matrix, left[:, None] * self._scale], [right.conj()[None, :] * self._scale, None]]
            )
        )
        solver = spl.splu(whole)

        def solve(top: ComplexArray, last: complex = 0.0) -> tuple[ComplexArray, complex]:
            given = np.concatenate([top, [last]])
            answer = solver.solve(given)
            answer = answer + solver.solve(given - whole @ answer)
            return answer[:-1], complex(answer[-1])

        v, f = solve(np.zeros(len(left), dtype=complex), self._scale)
        v_l, f_l = solve(-by_lambda @ v)
        v_m, f_m = solve(-by_mu @ v)
        _, f_ll = solve(-second @ v - 2 * by_lambda @ v_l)
        _, f_lm = solve(-mixed @ v - by_lambda @ v_m - by_mu @ v_l)
        return f, f_l, f_m, f_ll, f_lm

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
            if size < 1e-13 or (size < 1e-10 and size >= last):
                _, f_l, f_m, _, _ = self.derivatives(1j * omega, mu)
                return omega, mu, float((-f_m / f_l).real)
            last = size
        return None

    def double_root(self, lam: complex, mu: complex, *, real: bool) -> tuple[complex, complex, float] | None:
        """λ, μ with a double eigenvalue and κ of λ ≈ λ_c ± κ √±(μ − μ_c), on the side where it grows.

        κ² = ∓2 f_μ/f_λλ; ``real`` keeps λ on the axis and μ real.
        """
        lam, mu = complex(lam), complex(mu)
        start = lam
        last = np.inf
        for _ in range(NEWTON_STEPS):
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
            if size < 1e-13 or (size < 1e-10 and size >= last):
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

"""The reference: eigenvalues nearest to a shift straight from the sparse unsymmetric problem, one μ at a time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spl

from ...direct import factorise
from ...errors import AnalysisError, CaseError
from ...system import System
from ...typing import Array, ComplexArray
from ..options import Options
from .problem import ContactProblem, problem_of, times
from .reduced import upper_root


@dataclass(frozen=True)
class DirectModes:
    """Eigenvalues (k,) [1/s] with Im λ ≥ 0 at one μ, by frequency; right (n, k) unit vectors, residual (k,)
    componentwise backward errors."""

    mu: float
    eigenvalues: ComplexArray
    right: ComplexArray
    residual: Array


def direct_modes(
    system: System, mu: float, *, shift_hz: float, count: int = 20, damped: bool = True, options: Options | None = None
) -> DirectModes:
    """The ``count`` eigenvalues nearest to j 2π shift_hz by one unsymmetric factorisation and Arnoldi's method.

    It follows no branches and shares nothing with the projection but the problem. Raises AnalysisError where Arnoldi
    does not converge.
    """
    if not shift_hz > 0:
        raise CaseError("shift_hz", shift_hz, "a positive frequency in Hz")
    problem = problem_of(system if damped else system.undamped(), mu, options or Options(), damped=damped)
    omega = 2 * np.pi * shift_hz
    lam, u, p = (_damped if problem.damped else _undamped)(problem, mu, omega, count)
    order = np.argsort(lam.imag, kind="stable")
    lam, u, p = lam[order], u[:, order], p[:, order]
    norm = np.linalg.norm(u, axis=0)
    return DirectModes(mu, lam, u / norm, problem.backward_error(lam, u, p, mu))


def _undamped(problem: ContactProblem, mu: float, omega: float, count: int) -> tuple[ComplexArray, ...]:
    """λ (k,), u (n, k), p (m, k) by Arnoldi on [M u; 0] ↦ A(jω)⁻¹, whose eigenvalues are −1/(λ² + ω²)."""
    n = problem.size
    factor = factorise(_augmented(problem, 1j * omega, mu).real, saddle=True, solver=problem.solver)

    def whole(u: ComplexArray) -> ComplexArray:
        return factor.solve(np.concatenate([times(problem.mass, u), np.zeros((problem.nodes, u.shape[1]))]))

    theta, vectors = _largest(lambda u: whole(u[:, None])[:n, 0], n, count, float)
    answer = whole(vectors)
    return upper_root(-(omega**2) - 1 / theta), answer[:n], answer[n:] * _scale(problem)


def _damped(problem: ContactProblem, mu: float, omega: float, count: int) -> tuple[ComplexArray, ...]:
    """The same of the quadratic problem: with λ = jω + 1/θ, θ²A(jω) + θ(C + 2jωM) + M on [θu, u]."""
    n = problem.size
    factor = factorise(_augmented(problem, 1j * omega, mu), saddle=True, solver=problem.solver)
    extras = problem.at(mu)
    damping = problem.damping
    if extras.weakening is not None:
        damping = damping + problem.slide.T @ sp.diags_array(extras.weakening) @ problem.slide
    if extras.damping is not None:
        damping = damping + extras.damping

    def whole(top: ComplexArray, bottom: ComplexArray) -> ComplexArray:
        force = times(damping, top) + times(problem.mass, 2j * omega * top + bottom)
        return -factor.solve(np.concatenate([force, np.zeros((problem.nodes, force.shape[1]))]))

    def step(state: ComplexArray) -> ComplexArray:
        return np.concatenate([whole(state[:n, None], state[n:, None])[:n, 0], state[:n]])

    theta, vectors = _largest(step, 2 * n, count, complex)
    answer = whole(vectors[:n], vectors[n:])
    return 1j * omega + 1 / theta, answer[:n], answer[n:] * _scale(problem)


def _largest(
    step: Callable[[ComplexArray], ComplexArray], size: int, count: int, kind: type
) -> tuple[ComplexArray, ComplexArray]:
    """Eigenpairs of largest modulus of a linear map."""
    operator = spl.LinearOperator((size, size), matvec=lambda x: step(x.ravel()), dtype=kind)  # pyright: ignore
    start = np.random.default_rng(1).standard_normal(size).astype(kind)
    try:
        return spl.eigs(operator, k=min(count, size - 2), which="LM", v0=start, tol=1e-13)
    except spl.ArpackNoConvergence as error:
        raise AnalysisError("Arnoldi's method does not converge near this shift; move the shift") from error


def _scale(problem: ContactProblem) -> float:
    return float(np.abs(problem.stiffness.diagonal()).mean()) or 1.0


def _augmented(problem: ContactProblem, lam: complex, mu: float) -> ComplexArray:
    """A(λ) (n + m, n + m), contact forces scaled to the stiffness."""
    extras, scale = problem.at(mu), _scale(problem)
    whole = lam**2 * problem.mass + lam * problem.damping + problem.stiffness
    if extras.weakening is not None:
        whole = whole + lam * (problem.slide.T @ sp.diags_array(extras.weakening) @ problem.slide)
    if extras.damping is not None:
        whole = whole + lam * extras.damping
    if extras.stiffness is not None:
        whole = whole + extras.stiffness
    push = -scale * (problem.normal + mu * problem.slide).T
    corner = sp.diags_array(scale**2 * problem.compliance)
    return sp.csr_array(sp.block_array([[whole, push], [scale * problem.normal, corner]], format="csr"))

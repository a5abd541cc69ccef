"""The reference: eigenvalues nearest to a shift straight from the sparse unsymmetric problem, one μ at a time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse.linalg as spl

from ...direct import factorise
from ...errors import AnalysisError, CaseError
from ...system import System
from ...typing import Array, ComplexArray
from ..dense_problem import upper_root
from ..options import Options
from ..quadratic.problem import Quadratic, times
from .problem import problem_of


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
    problem = problem_of(system if damped else system.undamped(), mu, options or Options())
    omega = 2 * np.pi * shift_hz
    pencil = problem.pencil(mu)
    lam, x = (_damped if problem.damped else _undamped)(pencil.whole, pencil.size, omega, count, problem.solver)
    order = np.argsort(lam.imag, kind="stable")
    lam, (u, p) = lam[order], pencil.parted(x[:, order])
    norm = np.linalg.norm(u, axis=0)
    return DirectModes(mu, lam, u / norm, pencil.backward_error(lam, u, p))


def _undamped(
    problem: Quadratic, n: int, omega: float, count: int, solver: str | None
) -> tuple[ComplexArray, ComplexArray]:
    """λ (k,) and x (n + m, k) by Arnoldi on [M u; 0] ↦ P(jω)⁻¹, whose eigenvalues are −1/(λ² + ω²)."""
    factor = factorise(problem.at(1j * omega).real, saddle=True, solver=solver)

    def whole(u: ComplexArray) -> ComplexArray:
        return factor.solve(times(problem.mass, _padded(u, problem.size)))

    theta, vectors = _largest(lambda u: whole(u[:, None])[:n, 0], n, count, float)
    return upper_root(-(omega**2) - 1 / theta), whole(vectors)


def _damped(
    problem: Quadratic, n: int, omega: float, count: int, solver: str | None
) -> tuple[ComplexArray, ComplexArray]:
    """The same of the quadratic problem: with λ = jω + 1/θ, θ²P(jω) + θ(C + 2jωM) + M on [θu, u]."""
    factor = factorise(problem.at(1j * omega), saddle=True, solver=solver)

    def whole(top: ComplexArray, bottom: ComplexArray) -> ComplexArray:
        top, bottom = _padded(top, problem.size), _padded(bottom, problem.size)
        return -factor.solve(times(problem.damping, top) + times(problem.mass, 2j * omega * top + bottom))

    def step(state: ComplexArray) -> ComplexArray:
        return np.concatenate([whole(state[:n, None], state[n:, None])[:n, 0], state[:n]])

    theta, vectors = _largest(step, 2 * n, count, complex)
    return 1j * omega + 1 / theta, whole(vectors[:n], vectors[n:])


def _padded(u: Any, size: int) -> Any:
    """With rows of zeros for the contact forces."""
    return np.concatenate([u, np.zeros((size - len(u), u.shape[1]))])


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

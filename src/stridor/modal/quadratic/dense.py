"""All eigenpairs of small problems, by QZ on the scaled companion form."""

from __future__ import annotations

import numpy as np
import scipy.linalg as sl

from ...errors import AnalysisError
from ...stages import passing, stage
from ...typing import Array, ComplexArray
from .problem import Quadratic, times

ALONE = 1e-4  # of the way to the next eigenvalue: by how much one is corrected at most
LONG = 300  # unknowns from which it takes seconds
SMALL = 1e-13  # of the matrices: α and β below it at once are those of a pencil that is singular for every λ
ROUNDS = 8  # of balancing
HELD = 1e3  # times the rest of its row: what a freedom has on the diagonal that a penalty holds
FAR = 1e-3  # of 1/λ, scaled: what may be infinite at most
SAFE = 100.0  # times the rounding that QZ leaves in 1/λ: what is no larger may as well be zero, and λ infinite


@passing()
def all_modes(problem: Quadratic, size: float = np.inf) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Finite λ (k,) [1/s], right and left vectors (n, k) of unit norm; size [1/s]: |λ| up to which they are asked for.

    Rows and columns are brought to like size (Ruiz 2001) and, as Fan, Lin and Van Dooren (2004) do, λ = γμ with
    γ² = ‖K‖/‖M‖, all divided by (‖K‖ + γ‖D‖)/2. Raises AnalysisError where det P(λ) is zero for every λ.
    """
    if problem.size >= LONG:
        stage(f"all modes of {problem.size} unknowns, dense", logged=False)
    m, d, k = (np.asarray(a.toarray(), dtype=float) for a in (problem.mass, problem.damping, problem.stiffness))
    # A penalty in K would make the mass the whole of every other row, and balancing would change nothing.
    gamma = min(_units(m, d, k)[0], size)
    rows, columns = _balance(gamma**2 * np.abs(m) + gamma * np.abs(d) + np.abs(k))
    m, d, k = (rows[:, None] * a * columns for a in (m, d, k))
    gamma, delta = _units(m, d, k)
    m, d, k = gamma**2 * delta * m, gamma * delta * d, delta * k
    n = problem.size
    one, none = np.eye(n), np.zeros((n, n))
    left_side, right_side = np.block([[-d, -k], [one, none]]), np.block([[m, none], [none, one]])
    (alpha, beta), left, right = sl.eig(left_side, right_side, left=True, homogeneous_eigvals=True)
    if (np.hypot(np.abs(alpha), np.abs(beta)) < SMALL).any():
        raise AnalysisError("the quadratic problem is singular for every λ: some motion has no mass, damping or spring")
    finite = np.abs(beta) > np.maximum(SMALL, _uncertain(left_side, right_side, left, right)) * np.abs(alpha)
    mu = alpha[finite] / beta[finite]
    upper = np.abs(mu) >= 1
    x = np.where(upper, right[:n, finite], right[n:, finite])
    x, y = unit(columns[:, None] * x), unit(rows[:, None] * left[:n, finite].conj())
    lam = gamma * mu
    x, y = _with_held(problem, lam, x), _with_held(problem.transposed, lam, y)
    return _tuned(problem, lam, x, y), x, y


def _units(m: Array, d: Array, k: Array) -> tuple[float, float]:
    """γ and δ, of which γ²δM, γδD and δK are of like size."""
    sizes = [float(np.linalg.norm(a, 2)) for a in (m, d, k)]
    gamma = float(np.sqrt(sizes[2] / sizes[0])) if sizes[0] > 0 and sizes[2] > 0 else 1.0
    return gamma, 2 / max(sizes[2] + gamma * sizes[1], gamma**2 * sizes[0], 1e-300)


def _balance(sizes: Array) -> tuple[Array, Array]:
    """Powers of two (n,) for rows and columns, so that the largest of each is about one: they round nothing. Without
    them QZ may lose what is small beside contact forces or among stiff and soft bodies."""
    rows = columns = np.ones(len(sizes))
    for _ in range(ROUNDS):
        now = rows[:, None] * sizes * columns
        rows, columns = (
            by / np.sqrt(np.where(largest > 0.0, largest, 1.0))
            for by, largest in ((rows, now.max(axis=1, initial=0.0)), (columns, now.max(axis=0, initial=0.0)))
        )
    return 2.0 ** np.round(np.log2(rows)), 2.0 ** np.round(np.log2(columns))


def _uncertain(a: Array, b: Array, left: ComplexArray, right: ComplexArray) -> Array:
    """What rounding of QZ may do to β/α (k,) of a pencil (a, b), to first order: ε‖(A, B)‖/|(yᴴAx, yᴴBx)| (Stewart and
    Sun, Matrix Perturbation Theory, VI.2). A rigid contact makes three infinite eigenvalues that hang together, which
    rounding drives apart to λ of 1e10 of the others, of any sign."""
    size = np.hypot(np.linalg.norm(a, 2), np.linalg.norm(b, 2))
    projected = [np.abs(np.einsum("ij,ij->j", left.conj(), matrix @ right)) for matrix in (a, b)]
    length = np.linalg.norm(left, axis=0) * np.linalg.norm(right, axis=0)
    found = SAFE * np.finfo(float).eps * size * length / np.maximum(np.hypot(*projected), 1e-300)
    # Finite ones that are defective are as uncertain, and of the size of the others.
    return np.minimum(found, FAR)


def _with_held(problem: Quadratic, lam: ComplexArray, x: ComplexArray) -> ComplexArray:
    """Vectors (n, k) whose freedoms that a penalty holds are as their own equations have them: QZ knows these small
    motions to digits of the large ones, and a penalty makes much of the rest."""
    (m, d, k), rate, size = problem.matrices(), np.abs(lam), np.ones((problem.size, 1))
    own = lam**2 * m.diagonal()[:, None] + lam * d.diagonal()[:, None] + k.diagonal()[:, None]
    around = rate**2 * (abs(m) @ size) + rate * (abs(d) @ size) + abs(k) @ size - np.abs(own)
    held = np.abs(own) > HELD * around
    if not held.any():
        return x
    for _ in range(2):
        rest = problem.residual(lam, x)
        x = x - np.where(held, rest / np.where(held, own, 1.0), 0.0)
    return unit(x)


def _tuned(problem: Quadratic, lam: ComplexArray, x: ComplexArray, y: ComplexArray) -> ComplexArray:
    """Eigenvalues with the rest that QZ leaves taken off, yᵀP(λ)x / yᵀP'(λ)x: of slow modes of stiff matrices QZ knows
    some eight digits, its vectors give all. Not where another is so near that the vectors are not its own."""
    rest = np.einsum("ij,ij->j", y, problem.residual(lam, x))
    slope = np.einsum("ij,ij->j", y, 2 * lam * times(problem.mass, x) + times(problem.damping, x))
    with np.errstate(divide="ignore", invalid="ignore"):
        change = rest / slope
    gaps = np.abs(lam[:, None] - lam)
    np.fill_diagonal(gaps, np.inf)
    sure = np.isfinite(change) & (np.abs(change) <= ALONE * gaps.min(axis=1, initial=np.inf))
    return np.where(sure, lam - np.where(sure, change, 0.0), lam)


def unit(x: ComplexArray) -> ComplexArray:
    """Columns of unit norm."""
    return x / np.maximum(np.linalg.norm(x, axis=0), 1e-300)

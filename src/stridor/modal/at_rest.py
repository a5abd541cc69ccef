"""What is at rest: eigenvalues that are zero but for rounding, told from slow modes by the matrices themselves.

A motion that no stiffness resists has λ = 0, as a double root where nothing damps it, and rounding of K by a share ε of
its entries makes ±√(ε xᵀ|K|x / xᵀMx) of that, real and growing or not. How large that is beside the highest frequency
asked for says nothing: a slow flutter mode may be slower. So it is asked whether K resists every motion. Where it does
no eigenvalue is zero, and all that grows counts, however slow. Where it does not, what is below AT_REST of the highest
frequency, or below what rounding makes of zero, may be at rest and does not count; how slow that is is told.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import scipy.linalg as sl
import scipy.sparse as sp

from ..direct import SingularMatrix, factorise
from ..errors import AnalysisError
from ..typing import Array, BoolArray, ComplexArray
from .quadratic.problem import Quadratic
from .tolerances import AT_REST

DENSE = 600  # unknowns up to which all singular values are looked at
SHARPER = 0.1  # of AT_REST: what methods for small matrices make of zero at most
LOST = 1e-15  # of the square of the highest frequency: what solving for all modes up to there leaves of λ²
RESISTED = 1e-12  # of the stiffness, each freedom in its own units: less than that may be rounding
ROUNDED = 1e-13  # of entries: what sums of them, and files of fourteen digits, leave
SLOW = 1e-3  # of the highest frequency: what is faster is never taken for rest
MORE = 4  # vectors of a block than are looked for
STEPS, SETTLED = 40, 1e-4  # of inverse iteration at most; of the shift: ν that change by less are told from zero
SHARE = 0.3  # of the highest frequency: at which mass counts as much as stiffness where that is zero


def moving(values: ComplexArray, top: float, limit: Callable[[], float]) -> BoolArray:
    """Which eigenvalues (k,) are no motions as a whole; limit: of `rest_limit`, asked for where one is slow beside the
    highest frequency top [1/s] alone."""
    size = np.abs(values)
    moves: BoolArray = size > 0.0
    return moves & (size > limit()) if np.any(moves & (size <= SLOW * top)) else moves


def rest_limit(problems: Sequence[Quadratic], top: float, solver: str | None = None) -> float:
    """Up to which |λ| [1/s] eigenvalues may be zero but for rounding in one of several problems: 0 where every motion
    has a stiffness in all of them. top [1/s]: the highest frequency that is looked at."""
    found = 0.0
    for problem in problems:
        motions = _unresisted(problem, top, solver)
        if motions.shape[1]:
            share = AT_REST if problem.size > DENSE else SHARPER * AT_REST
            found = max(found, share * top, _rounding(problem, motions))
    return found


def more_slow(problem: Quadratic, slow: ComplexArray, top: float, solver: str | None = None) -> bool:
    """Whether of eigenvalues (k,) that may be zero there are more than motions without stiffness make; also where of
    large matrices these cannot be counted."""
    if not len(slow):
        return False
    zeros = double_zeros(slow)
    if problem.size <= DENSE:
        return zeros > _unresisted(problem, top, None).shape[1]
    free = _free_of_large(problem, zeros, top, solver)
    return free is None or zeros > free


def slow_words(limit: float) -> str:
    """What is said of modes below ``limit`` [1/s] where `more_slow`."""
    return f"modes below {limit / (2 * np.pi):.3g} Hz, which cannot be told from motions as a whole"


def _free_of_large(problem: Quadratic, most: int, top: float, solver: str | None) -> int | None:
    """How many motions, up to ``most``, the stiffness does not resist beyond rounding: among those of the least ν of
    K x = ν M x, by inverse iteration of a block, which one vector's space need not have all of a multiple ν in. None
    where they are not found."""
    shift, size = (AT_REST * top) ** 2, min(most + MORE, problem.size)
    stiffness, mass = sp.csr_array(problem.stiffness), sp.csr_array(problem.mass)
    motions: Array = np.random.default_rng(20061).standard_normal((problem.size, size))
    before = np.full(size, np.inf)
    try:
        with factorise(sp.csr_array(stiffness + shift * mass), solver=solver) as factor:
            for _ in range(STEPS):
                motions = np.linalg.qr(factor.solve(mass @ motions))[0]
                values, turns = sl.eig(motions.T @ (stiffness @ motions), motions.T @ (mass @ motions))
                order = np.argsort(np.abs(values))
                values, turns = values[order], turns[:, order]
                if np.abs(values - before)[:most].max() <= SETTLED * shift:
                    break
                before = values
            else:
                return None
    except (AnalysisError, ValueError, np.linalg.LinAlgError):
        return None
    rounding = [_rounding(problem, np.abs(motions @ turns[:, [k]])) ** 2 for k in range(min(most, size))]
    return int(np.count_nonzero(np.abs(values[:most]) <= np.maximum(rounding, LOST * shift)))


def double_zeros(values: ComplexArray) -> int:
    """Of how many motions as a whole eigenvalues (k,) near zero are: rounding makes ±ε or ±jε of a double zero, and of
    the latter one may be left unsaid, the one below the real axis; what is there alone is real but for rounding."""
    above, below = int(np.count_nonzero(values.imag > 0.0)), int(np.count_nonzero(values.imag < 0.0))
    real = len(values) - above - min(above, below)
    return above + (real + 1) // 2


def told_growth(values: ComplexArray, relative: float, top: float) -> Array:
    """Growth rates (k,) [1/s] above which eigenvalues grow beyond rounding: a share of |λ|, and of slow ones what is
    lost of them where all modes up to top [1/s] are solved for at once."""
    size = np.maximum(np.abs(values), 1e-300)
    return np.maximum(relative * size, LOST * top * (top / size))


def _unresisted(problem: Quadratic, top: float, solver: str | None) -> Array:
    """Motions (n, k) that the stiffness does not resist beyond rounding."""
    stiffness = problem.stiffness
    if problem.size > DENSE:
        try:
            factorise(sp.csr_array(stiffness), solver=solver).free()
        except SingularMatrix as error:
            motion = error.motion
            # One of unknown shape is there all the same.
            return np.ones((problem.size, 1)) if motion is None else np.asarray(motion, dtype=float)[:, None]
        except AnalysisError:
            return np.zeros((problem.size, 0))
        return np.zeros((problem.size, 0))
    whole, mass = (m if isinstance(m, np.ndarray) else m.toarray() for m in (stiffness, problem.mass))
    size = np.abs(whole).max(axis=1, initial=0.0) + (SHARE * top) ** 2 * np.abs(np.diag(mass))
    unit = 1.0 / np.sqrt(np.where(size > 0.0, size, 1.0))
    _, values, right = sl.svd(unit[:, None] * whole * unit)
    return unit[:, None] * right[values <= RESISTED * values.max(initial=0.0)].T


def _rounding(problem: Quadratic, motions: Array) -> float:
    """The largest |λ| [1/s] that rounding makes of zero, of motions (n, k)."""
    size = np.abs(motions)
    forces = np.einsum("ij,ij->j", size, abs(problem.stiffness) @ size)
    inertia = np.abs(np.einsum("ij,ij->j", motions, problem.mass @ motions))
    moved = inertia > 0.0
    return float(np.sqrt(ROUNDED * forces[moved] / inertia[moved]).max(initial=0.0))

"""Onsets solved in the full problem of a family: a bordered sparse matrix and Newton's method.

With unit vectors e_i, e_j where the left and the right vector are large,

    [P e_i; e_jᵀ 0] [x; g] = [0; 1]

stays regular where P(λ, μ) is singular, and g(λ, μ) = 0 exactly there. One factorisation gives g and all derivatives
that are needed (Govaerts, Numerical Methods for Bifurcations of Dynamical Equilibria, SIAM 2000, chapter 3):

    a damped onset      g = 0 with λ = jω, for ω and μ
    eigenvalues meet    g = ∂g/∂λ = 0 with λ = jω, where the problem is reversible
    divergence          g = 0 with λ = 0, for μ
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from ...direct import factorise
from ...errors import AnalysisError
from ...typing import ComplexArray, Sparse
from ..quadratic.problem import Quadratic, times
from ..tolerances import CONFIRMED
from .family import Family

STEPS = 14
SETTLED = 1e-13
# |Re λ| / |λ| up to which an eigenvalue is on the axis; not all processors know more than double precision.
ON_AXIS = 1e-12 if np.finfo(np.longdouble).eps < 1e-18 else 1e-9
STALLED = 0.5  # of the smallest step so far: a longer one is made of rounding
IDLE = 3
ROUNDING = 1e-10  # |Re λ| / |λ| that may be left of slow modes of stiff structures
FLAT = 1e-9  # dRe λ/dμ times the range, over |λ|, below which friction has no say in it


@dataclass(frozen=True)
class Root:
    """A solved onset: μ, λ on the axis, its vector x (n,), how growth opens there, and backward error.

    slope: dRe λ/dμ of a simple eigenvalue. square: κ² of λ ≈ λ_c ± κ √(μ − μ_c) of a double one, negative where the
    growth ends.
    """

    mu: float
    lam: complex
    vector: ComplexArray
    slope: float | None
    square: float | None
    residual: float


@dataclass(frozen=True)
class _Point:
    """g and its derivatives at (λ, μ), and what P all but takes to zero from the right and left."""

    g: complex
    by_lam: complex
    by_mu: complex
    by_lam_lam: complex
    by_lam_mu: complex
    x: ComplexArray


@dataclass
class _Steps:
    """Newton's way to one root: its shortest step so far and where that began."""

    enough: float  # steps as short as this may end in rounding
    shortest: float = np.inf
    idle: int = 0  # steps since then that brought nothing
    kept: tuple[float, float, _Point] | None = None

    def end(self, step: float, omega: float, mu: float, here: _Point) -> bool:
        """Take in a step from (ω, μ); whether it is made of rounding, so that there is nothing to be gained."""
        stalled = step > STALLED * self.shortest
        self.idle = self.idle + 1 if stalled else 0
        if step < self.shortest:
            self.shortest, self.kept = step, (omega, mu, here)
        return stalled and (self.shortest <= self.enough or self.done)

    @property
    def done(self) -> bool:
        """Whether stiff springs leave no more than this: steps so short that they repeat are rounding's own."""
        return self.idle >= IDLE and self.shortest <= ROUNDING


class Border:
    """g(λ, μ) of a family, bordered for eigenvectors near x and y (n,)."""

    def __init__(self, family: Family, x: ComplexArray, y: ComplexArray) -> None:
        self.family = family
        # Rotations and multipliers have units of their own: sizes are judged by what the stiffness makes of them.
        weight = family.sizes
        self._column = int(np.argmax(weight * np.abs(x)))
        self._row = int(np.argmax(weight * np.abs(y)))
        self._scale = float(weight[self._column] * weight[self._row]) or 1.0

    def at(self, lam: complex, mu: float) -> _Point:
        """g and its derivatives. Raises AnalysisError where even the bordered matrix is singular."""
        problem, change = self.family.at(mu), self.family.slopes(mu)
        n, scale = problem.size, self._scale
        with factorise(self._bordered(problem.at(lam)), solver=self.family.options.solver) as factor:

            def solved(right: ComplexArray, *, transpose: bool = False) -> ComplexArray:
                found: ComplexArray = factor.solve(right, transpose=transpose)
                return found

            unit = np.zeros(n + 1, dtype=complex)
            unit[n] = scale
            x, y = solved(unit), solved(unit, transpose=True)
            x, y = x[:n], y[:n]
            # g to second order in what rounding leaves of x and y.
            g = -self.family.functional(lam, mu, y, x) / scale
            by_lam, by_mu = _by_lambda(problem, lam, x), _applied(change, lam, x)
            right = np.zeros((n + 1, 2), dtype=complex)
            right[:n, 0], right[:n, 1] = -by_lam, -by_mu
            both = solved(right)
        x_lam, x_mu = both[:n, 0], both[:n, 1]
        twice = 2 * times(problem.mass, x) + 2 * _by_lambda(problem, lam, x_lam)
        mixed = _by_lambda(change, lam, x) + _by_lambda(problem, lam, x_mu) + _applied(change, lam, x_lam)
        return _Point(
            g, complex(both[n, 0]), complex(both[n, 1]), complex(-(y @ twice) / scale), complex(-(y @ mixed) / scale), x
        )  # fmt: skip

    def _bordered(self, matrix: Sparse) -> Sparse:
        n, scale = matrix.shape[0], self._scale
        coo = sp.coo_array(matrix)
        data = np.concatenate([coo.data.astype(complex), [scale, scale]])
        rows = np.concatenate([coo.row, [self._row, n]])
        columns = np.concatenate([coo.col, [n, self._column]])
        return sp.csr_array(sp.coo_array((data, (rows, columns)), shape=(n + 1, n + 1)))


def crossing(
    family: Family, mu: float, lam: complex, x: ComplexArray, y: ComplexArray, between: tuple[float, float]
) -> Root | None:
    """Where a simple eigenvalue is on the axis, from a guess; None where that does not settle between two μ."""
    width = between[1] - between[0]
    omega, border = float(lam.imag), Border(family, x, y)
    steps = _Steps(ON_AXIS)
    for _ in range(STEPS):
        try:
            here = border.at(1j * omega, mu)
        except AnalysisError:
            break
        if here.by_lam == 0:
            break
        off = abs(here.g / here.by_lam) / max(abs(omega), 1e-300)
        if steps.end(off, omega, mu, here):
            break
        tangent = -here.by_mu / here.by_lam
        # λ(jω, μ) moves by −g/g_λ and is to end on the axis: dRe λ/dμ δμ = −Re, and ω goes along.
        away = -here.g / here.by_lam
        if abs(tangent.real) * (family.high - family.low) <= FLAT * abs(omega):
            return None
        change = -away.real / tangent.real
        turn = away.imag + tangent.imag * change
        if not between[0] - width <= mu + change <= between[1] + width:
            return None
        if off <= 0.1 * ON_AXIS and abs(change) <= SETTLED * max(abs(mu), family.high - family.low):
            break
        mu, omega = min(max(mu + change, family.low), family.high), omega + turn
    if steps.kept is None or (steps.shortest > ON_AXIS and not steps.done):
        return None
    omega, mu, here = steps.kept
    slope = float((-here.by_mu / here.by_lam).real)
    return _judged(family, mu, 1j * omega, here.x, slope, None)


def meeting(
    family: Family, mu: float, lam: complex, x: ComplexArray, y: ComplexArray, between: tuple[float, float]
) -> Root | None:
    """Where two eigenvalues of a reversible problem meet on the axis; None where that does not settle."""
    width = between[1] - between[0]
    omega, border = float(lam.imag), Border(family, x, y)
    steps = _Steps(1e3 * ON_AXIS)
    for _ in range(STEPS):
        try:
            here = border.at(1j * omega, mu)
        except AnalysisError:
            break
        matrix = np.array([[here.by_lam, here.by_mu], [here.by_lam_lam, here.by_lam_mu]])
        with np.errstate(all="ignore"):
            determinant = matrix[0, 0] * matrix[1, 1] - matrix[0, 1] * matrix[1, 0]
            by_lam = -(matrix[1, 1] * here.g - matrix[0, 1] * here.by_lam) / determinant
            by_mu = -(matrix[0, 0] * here.by_lam - matrix[1, 0] * here.g) / determinant
        if not np.isfinite(by_lam) or not np.isfinite(by_mu):
            break
        off = abs(by_lam) / max(abs(omega), 1e-300) + abs(by_mu) / max(abs(mu), 1e-3 * width)
        if steps.end(off, omega, mu, here):
            break
        if not between[0] - width <= mu + by_mu.real <= between[1] + width:
            return None
        mu, omega = mu + float(by_mu.real), omega + float(by_lam.imag)
        if off <= SETTLED:
            break
    if steps.kept is None or steps.shortest > 1e3 * ON_AXIS:
        return None
    omega, mu, here = steps.kept
    square = complex(-2 * here.by_mu / here.by_lam_lam)
    if not np.isfinite(square) or abs(square.imag) > 1e-3 * abs(square):
        return None
    return _judged(family, mu, 1j * omega, here.x, None, float(square.real))


def standstill(
    family: Family, mu: float, x: ComplexArray, y: ComplexArray, between: tuple[float, float]
) -> Root | None:
    """Where the stiffness becomes singular, λ = 0; None where that does not settle."""
    width = between[1] - between[0]
    border, steps = Border(family, x, y), _Steps(ON_AXIS)
    for _ in range(STEPS):
        try:
            here = border.at(0.0, mu)
        except AnalysisError:
            break
        if here.by_mu == 0:
            break
        change = -float((here.g / here.by_mu).real)
        off = abs(change) / max(abs(mu), 1e-3 * width)
        if steps.end(off, 0.0, mu, here):
            break
        if not between[0] - width <= mu + change <= between[1] + width:
            return None
        if off <= SETTLED:
            break
        mu = mu + change
    if steps.kept is None or steps.shortest > 1e3 * ON_AXIS:
        return None
    _, mu, here = steps.kept
    if family.reversible:
        return _judged(family, mu, 0j, here.x, None, float((-2 * here.by_mu / here.by_lam_lam).real))
    if here.by_lam == 0:
        return None
    return _judged(family, mu, 0j, here.x, float((-here.by_mu / here.by_lam).real), None)


def _judged(
    family: Family, mu: float, lam: complex, x: ComplexArray, slope: float | None, square: float | None
) -> Root | None:
    """The root with its backward error in the matrices as the system gives them there; None where that is too large."""
    residual = family.backward_error(mu, lam, x)
    return Root(mu, lam, x, slope, square, residual) if residual <= CONFIRMED else None


def _by_lambda(problem: Quadratic, lam: complex, x: ComplexArray) -> ComplexArray:
    found: ComplexArray = 2 * lam * times(problem.mass, x) + times(problem.damping, x)
    return found


def _applied(problem: Quadratic, lam: complex, x: ComplexArray) -> ComplexArray:
    found: ComplexArray = problem.residual(np.array([lam]), x[:, None])[:, 0]
    return found

"""Onsets solved: a bordered matrix and Newton's method, the same for sparse problems and for small dense ones.

With unit vectors e_i, e_j where the left and the right vector are large,

    [P e_i; e_jᵀ 0] [x; g] = [0; 1]

stays regular where P(λ, μ) is singular, and g(λ, μ) = 0 exactly there. One factorisation gives g and all derivatives
that are needed (Govaerts, Numerical Methods for Bifurcations of Dynamical Equilibria, SIAM 2000, chapter 3):

    a damped onset          g = 0 with λ = jω, for ω and μ
    eigenvalues meet        g = ∂g/∂λ = 0 with λ = jω, where the problem is reversible
    divergence              g = 0 with λ = 0, for μ
    of a free body          ∂g/∂λ = 0, or ∂²g/∂λ² = 0, with λ = 0, for μ
    an exceptional point    g = ∂g/∂λ = 0 for λ and a complex μ
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..errors import AnalysisError
from ..typing import Array, ComplexArray
from .quadratic.problem import Quadratic, times
from .tolerances import CONFIRMED, SPLIT_RELATIVE

STEPS = 14
CONVERGED = 1e-13
# |Re λ| / |λ| up to which an eigenvalue is on the axis; not all processors know more than double precision.
ON_AXIS = 1e-12 if np.finfo(np.longdouble).eps < 1e-18 else 1e-9
SERIES = 5  # powers of λ, from the zeroth on
STALLED = 0.5  # of the smallest step so far: a longer one is made of rounding
IDLE = 3
MET = 1e-8  # relative step at which a complex meeting is settled, if no further one is shorter
ROUNDING = 1e-10  # |Re λ| / |λ| that may be left of slow modes of stiff structures
RESTS = 1e-13  # backward error of λ = 0 that is rounding of the stiffness, as files of fourteen digits leave it
DIFFERENCE = 1e-6  # of the range: to either side of an onset, for a slope
TOO_LARGE = 1e8  # times its entry at the border, of a vector there
FLAT = 1e-9  # dRe λ/dμ times the range, over |λ|, below which friction has no say in it


@dataclass(frozen=True)
class Root:
    """A solved onset: μ, λ on the axis, its vector x (n,), how growth opens there, and backward error.

    slope: dRe λ/dμ of a simple eigenvalue. square: κ² of λ ≈ λ_c ± κ √(μ − μ_c) of a double one, negative where the
    growth ends. left (n,): yᵀP(λ) = 0.
    """

    mu: float
    lam: complex
    vector: ComplexArray
    slope: float | None
    square: float | None
    residual: float
    left: ComplexArray


class BorderedFactor(Protocol):
    """A factorised matrix."""

    def solve(self, right: ComplexArray, *, transpose: bool = False) -> ComplexArray:
        """What it takes to ``right`` (n,) or (n, k)."""
        ...

    def free(self) -> None:
        """Give its memory back."""
        ...


class NewtonProblem(Protocol):
    """A problem over μ in [low, high], as Newton's method needs it; μ may be complex where its matrices are known so.

    sizes (n,): what a unit of each unknown is worth, for choosing large entries of vectors.
    """

    @property
    def low(self) -> float: ...

    @property
    def high(self) -> float: ...

    @property
    def sizes(self) -> Array: ...

    @property
    def reversible(self) -> bool:
        """Whether −λ̄ is an eigenvalue with every λ."""
        ...

    def at(self, mu: complex) -> Quadratic:
        """The matrices at μ."""
        ...

    def slopes(self, mu: complex) -> Quadratic:
        """Their derivatives over μ."""
        ...

    def bordered(self, here: Quadratic, lam: complex, border: Border) -> BorderedFactor:
        """Factors of P(λ) (n, n) of the matrices ``here`` with a border. Raises AnalysisError where it is singular."""
        ...

    def functional(self, lam: complex, mu: complex, y: ComplexArray, x: ComplexArray) -> complex:
        """yᵀP(λ, μ)x, with more digits than the products of its parts where these cancel."""
        ...

    def backward_error(self, mu: float, lam: complex, x: ComplexArray) -> float:
        """Backward error of an eigenpair λ, x (n,)."""
        ...


@dataclass(frozen=True)
class NewtonPoint:
    """g and its derivatives at (λ, μ), and the vectors x and y (n,) that P all but takes to zero from both sides."""

    g: complex
    by_lam: complex
    by_mu: complex
    by_lam_lam: complex
    by_lam_mu: complex
    x: ComplexArray
    y: ComplexArray


@dataclass
class _Steps:
    """Newton's way to one root: its shortest step so far and where that began."""

    enough: float  # steps as short as this may end in rounding
    rounding: float = ROUNDING  # and what steps that repeat may be all the same
    shortest: float = np.inf
    idle: int = 0  # steps since then that brought nothing
    kept: tuple[float, float, NewtonPoint] | None = None

    def end(self, step: float, omega: float, mu: float, here: NewtonPoint) -> bool:
        """Take in a step from (ω, μ); whether it is made of rounding, so that there is nothing to be gained."""
        stalled = step > STALLED * self.shortest
        self.idle = self.idle + 1 if stalled else 0
        if step < self.shortest:
            self.shortest, self.kept = step, (omega, mu, here)
        return stalled and (self.shortest <= self.enough or self.done)

    @property
    def done(self) -> bool:
        """Whether stiff springs leave no more than this: steps so short that they repeat are rounding's own."""
        return self.idle >= IDLE and self.shortest <= self.rounding


class Border:
    """g(λ, μ) of a problem, bordered for eigenvectors near x and y (n,): by ``scale`` in ``row`` and ``column``."""

    def __init__(self, problem: NewtonProblem, x: ComplexArray, y: ComplexArray) -> None:
        self.problem = problem
        # Rotations and multipliers have units of their own: sizes are judged by what the stiffness makes of them.
        weight = problem.sizes
        self.column = int(np.argmax(weight * np.abs(x)))
        self.row = int(np.argmax(weight * np.abs(y)))
        self.scale = float(weight[self.column] * weight[self.row]) or 1.0

    def at(self, lam: complex, mu: complex) -> NewtonPoint:
        """g and its derivatives. Raises AnalysisError where even the bordered matrix is singular."""
        here, change = self.problem.at(mu), self.problem.slopes(mu)
        factor, scale, n = self.problem.bordered(here, lam, self), self.scale, here.mass.shape[0]
        try:
            unit = np.zeros(n + 1, dtype=complex)
            unit[n] = scale
            x, y = factor.solve(unit)[:n], factor.solve(unit, transpose=True)[:n]
            # g to second order in what rounding leaves of x and y.
            g = -self.problem.functional(lam, mu, y, x) / scale
            right = np.zeros((n + 1, 2), dtype=complex)
            right[:n, 0], right[:n, 1] = -here.slope(lam, x), -change.applied(lam, x)
            both = factor.solve(right)
        finally:
            factor.free()
        x_lam, x_mu = both[:n, 0], both[:n, 1]
        twice = 2 * times(here.mass, x) + 2 * here.slope(lam, x_lam)
        mixed = change.slope(lam, x) + here.slope(lam, x_mu) + change.applied(lam, x_lam)
        return NewtonPoint(
            g, complex(both[n, 0]), complex(both[n, 1]), complex(-(y @ twice) / scale), complex(-(y @ mixed) / scale),
            x, y,
        )  # fmt: skip

    def series(self, mu: float) -> ComplexArray:
        """Coefficients (SERIES,) of g over λ at λ = 0: with P(λ)x = −g e, x = Σ λᵏ xₖ, K xₖ + γₖ e = −C xₖ₋₁ − M xₖ₋₂.
        Raises AnalysisError where even the bordered matrix is singular."""
        here = self.problem.at(mu)
        factor, n = self.problem.bordered(here, 0j, self), here.mass.shape[0]
        right, found = np.zeros(n + 1, dtype=complex), np.zeros(SERIES, dtype=complex)
        right[n] = self.scale
        vectors: list[ComplexArray] = []
        try:
            for k in range(SERIES):
                answer = factor.solve(right)
                found[k] = answer[n]
                vectors.append(answer[:n])
                right = np.append(-times(here.damping, vectors[k]), 0j)
                if k:
                    right[:n] -= times(here.mass, vectors[k - 1])
        finally:
            factor.free()
        return found


def crossing(
    problem: NewtonProblem, mu: float, lam: complex, x: ComplexArray, y: ComplexArray, between: tuple[float, float]
) -> Root | None:
    """Where a simple eigenvalue is on the axis, from a guess; None where that does not settle between two μ."""
    width = between[1] - between[0]
    omega, border = float(lam.imag), Border(problem, x, y)
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
        step = -here.g / here.by_lam
        if abs(tangent.real) * (problem.high - problem.low) <= FLAT * abs(omega):
            return None
        change = -step.real / tangent.real
        turn = step.imag + tangent.imag * change
        if not between[0] - width <= mu + change <= between[1] + width:
            return None
        if off <= 0.1 * ON_AXIS and abs(change) <= CONVERGED * max(abs(mu), problem.high - problem.low):
            break
        mu, omega = min(max(mu + change, problem.low), problem.high), omega + turn
    if steps.kept is None or (steps.shortest > ON_AXIS and not steps.done):
        return None
    omega, mu, here = steps.kept
    slope = float((-here.by_mu / here.by_lam).real)
    return _judged(problem, mu, 1j * omega, here, slope, None)


def meeting(
    problem: NewtonProblem, mu: float, lam: complex, x: ComplexArray, y: ComplexArray, between: tuple[float, float]
) -> Root | None:
    """Where two eigenvalues of a reversible problem meet on the axis; None where that does not settle."""
    width = between[1] - between[0]
    omega, border = float(lam.imag), Border(problem, x, y)
    # Stiff structures leave of ω what double precision leaves of the vectors, while μ has its digits.
    steps = _Steps(1e3 * ON_AXIS, SPLIT_RELATIVE)
    for _ in range(STEPS):
        try:
            here = border.at(1j * omega, mu)
        except AnalysisError:
            break
        by_lam, by_mu = _to_double(here)
        if not np.isfinite(by_lam) or not np.isfinite(by_mu):
            break
        off = abs(by_lam) / max(abs(omega), 1e-300) + abs(by_mu) / max(abs(mu), 1e-3 * width)
        if steps.end(off, omega, mu, here):
            break
        if not between[0] - width <= mu + by_mu.real <= between[1] + width:
            return None
        mu, omega = mu + float(by_mu.real), omega + float(by_lam.imag)
        if off <= CONVERGED:
            break
    if steps.kept is None or (steps.shortest > 1e3 * ON_AXIS and not steps.done):
        return None
    omega, mu, here = steps.kept
    square = complex(-2 * here.by_mu / here.by_lam_lam)
    if not np.isfinite(square) or abs(square.imag) > 1e-3 * abs(square):
        return None
    return _judged(problem, mu, 1j * omega, here, None, float(square.real))


def exceptional(
    problem: NewtonProblem, mu: complex, lam: complex, x: ComplexArray, y: ComplexArray, reach: float
) -> tuple[complex, complex, complex] | None:
    """Complex μ at which two eigenvalues meet, λ there and κ² of λ ≈ λ_e ± κ √(μ − μ_e), from a guess.

    None where that does not settle within ``reach`` of the guess's μ and half of its λ.
    """
    start, first, border = complex(mu), complex(lam), Border(problem, x, y)
    mu, lam = start, first
    last = np.inf
    for _ in range(STEPS + 6):
        try:
            here = border.at(lam, mu)
        except AnalysisError:
            return None
        by_lam, by_mu = _to_double(here)
        mu, lam = mu + by_mu, lam + by_lam
        if not np.isfinite(by_lam + by_mu) or abs(mu - start) > reach or abs(lam - first) > 0.5 * abs(first):
            return None
        off = abs(by_lam) / max(abs(lam), 1e-300) + abs(by_mu) / max(abs(mu), 1e-3)
        if off <= CONVERGED or (off <= MET and off >= STALLED * last):
            return complex(mu), complex(lam), complex(-2 * here.by_mu / here.by_lam_lam)
        last = off
    return None


def _to_double(here: NewtonPoint) -> tuple[complex, complex]:
    """Newton's step in λ and μ to where two eigenvalues meet."""
    with np.errstate(all="ignore"):
        determinant = here.by_lam * here.by_lam_mu - here.by_mu * here.by_lam_lam
        by_lam = -np.complex128(here.by_lam_mu * here.g - here.by_mu * here.by_lam) / determinant
        by_mu = -np.complex128(here.by_lam * here.by_lam - here.by_lam_lam * here.g) / determinant
    return by_lam, by_mu


def standstill(
    problem: NewtonProblem, mu: float, x: ComplexArray, y: ComplexArray, between: tuple[float, float]
) -> Root | None:
    """Where the stiffness becomes singular, λ = 0, or another root leaves zero where it is so at every μ; None where
    that does not settle."""
    width = between[1] - between[0]
    border, steps = Border(problem, x, y), _Steps(ON_AXIS)
    zeros = _zeros(border, between[0])
    if zeros:
        zeros = min(zeros, _zeros(border, between[1]))
    if zeros:
        return _beside_zero(border, mu, between, zeros)
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
        if off <= CONVERGED:
            break
        mu = mu + change
    if steps.kept is None or steps.shortest > 1e3 * ON_AXIS:
        return None
    _, mu, here = steps.kept
    if problem.reversible:
        return _judged(problem, mu, 0j, here, None, float((-2 * here.by_mu / here.by_lam_lam).real))
    if here.by_lam == 0:
        return None
    return _judged(problem, mu, 0j, here, float((-here.by_mu / here.by_lam).real), None)


def _beside_zero(border: Border, mu: float, between: tuple[float, float], zeros: int) -> Root | None:
    """Where one more root than the ``zeros`` that a motion without stiffness has at every μ is zero.

    With Kv = 0 at every μ, g = γ₁λ + γ₂λ² + γ₃λ³ + …, and with Cv = 0 γ₁ is zero as well. The root beside these is
    λ = −γₖ/γₖ₊₁, or λ² = −γ₂/γ₄ of a reversible problem, and passes zero where γₖ does: γ₁ is yᵀCv, or γ₂ yᵀMv, with
    the left vector y of K(μ) but for a factor. By secants.
    """
    problem, width = border.problem, between[1] - between[0]
    before = mu + 0.1 * max(between[1] - mu, between[0] - mu, key=abs)
    try:
        last, rate, settled = float(border.series(before)[zeros].real), 0.0, False
        for _ in range(2 * STEPS):
            series = border.series(mu)
            value = float(series[zeros].real)
            if mu != before and value != last:
                rate = (value - last) / (mu - before)
            step = -value / rate if rate else np.inf
            if not between[0] - width <= mu + step <= between[1] + width:
                return None
            settled = abs(step) <= ON_AXIS * max(abs(mu), 1e-3 * width)
            before, last, mu = mu, value, mu + step
            if settled:
                break
        series, here = border.series(mu), border.at(0.0, mu)
        # Of the last secant rounding makes anything.
        beside = DIFFERENCE * (problem.high - problem.low)
        one, other = max(mu - beside, problem.low), min(mu + beside, problem.high)
        rate = float((border.series(other) - border.series(one))[zeros].real) / (other - one)
    except AnalysisError:
        return None
    more = float(series[zeros + (2 if problem.reversible else 1)].real)
    if not settled or more == 0.0:
        return None
    slope, square = (None, -rate / more) if problem.reversible else (-rate / more, None)
    return _judged(problem, mu, 0j, here, slope, square)


def _zeros(border: Border, mu: float) -> int:
    """How many roots λ are zero at μ but for rounding, of the one motion that no stiffness resists: 2 where nothing
    damps it either."""
    problem = border.problem
    at = min(max(mu, problem.low), problem.high)
    try:
        here, known = border.at(0.0, at), problem.at(at)
    except AnalysisError:
        return 0
    if problem.backward_error(at, 0j, here.x) > RESTS:
        return 0
    # Where more than one is at rest the border is too narrow, and x is what rounding makes of it.
    if np.max(problem.sizes * np.abs(here.x)) > TOO_LARGE * problem.sizes[border.column]:
        return 0
    damped = abs(here.by_lam) * border.scale
    return 1 if damped > RESTS * float(np.abs(here.y) @ (abs(known.damping) @ np.abs(here.x))) else 2


def _judged(
    problem: NewtonProblem, mu: float, lam: complex, here: NewtonPoint, slope: float | None, square: float | None
) -> Root | None:
    """The root with its backward error in the matrices as the system gives them there; None where that is too large."""
    residual = problem.backward_error(mu, lam, here.x)
    return Root(mu, lam, here.x, slope, square, residual, here.y) if residual <= CONFIRMED else None

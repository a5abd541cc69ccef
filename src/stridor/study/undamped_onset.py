"""The lowest onset of a reduced model without its damping: where two modes meet, solved in the full problem.

Without damping x = λ² is left, (xM + K) u = 0. Two real x meet where the squared half difference D of the pair passes
through zero. On vectors X and Y (n, 2) that span both from the right and from the left the pair is that of

    G = −(YᵀMX)⁻¹ YᵀKX,      D = (tr G)²/4 − det G,

and so is its derivative over μ. X and Y follow by inverse iteration beside the pair, which they span to rounding even
where the two vectors themselves are one.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import scipy
import scipy.sparse as sp

from ..direct import factorise
from ..errors import AnalysisError
from ..modal.assembled.critical import pair_near
from ..modal.assembled.follow import Follower, State
from ..modal.assembled.passages import Passage, meetings
from ..modal.assembled.reduced import Reduced
from ..modal.assembled.shifted import Pair
from ..modal.parametric import ParametricProblem, ReducedModel
from ..modal.parametric.dense import assembled
from ..threads import one_thread
from ..typing import Array, ComplexArray, Sparse

STEPS = 30  # over the range, at least
ROUNDS = 6
ITERATIONS = 5
BESIDE = 1e-5  # of x: how far beside the pair the matrix is factorised
SETTLED, ROUNDING, AWAY = 1e-13, 1e-8, 1e-3  # of the parameter's range
BELIEVED = 1e-10


@dataclass(frozen=True)
class UndampedOnset:
    """Two modes without damping meet at ``value`` of a parameter, what the reduced model said of it, and the larger
    backward error of both sides' vectors in the full problem."""

    value: float
    frequency_hz: float
    residual: float
    reduced_value: float


@one_thread
def undamped_onset(model: ReducedModel, name: str, *, solver: str | None = None) -> UndampedOnset | None:
    """The least value of a parameter from which on something grows without any damping, the others at their own values.

    Raises AnalysisError where a mode diverges at zero frequency, and where the full problem does not confirm it.
    """
    along = _Undamped(model, name)
    passages: list[Passage] = []

    def watch(old: State, new: State) -> None:
        passages.extend(p for p in meetings(along, old, new) if not p.stabilising)

    length = along.high - along.low
    follower = Follower(along, longest=length / STEPS, watch=watch)
    for part in np.linspace(0.0, length, STEPS + 1)[1:]:
        follower.advance(float(part))
        found = [place for passage in passages if (place := _located(along, passage)) is not None]
        passages.clear()
        if found:
            return _confirmed(model, along, *min(found), solver)
    return None


class _Undamped(Reduced):
    """The reduced problem without damping along one parameter, counted from its low end, as the follower sees it."""

    def __init__(self, model: ReducedModel, name: str) -> None:
        self._model, self.name = model, name
        (own,) = (p for p in model.problem.parameters if p.name == name)
        self.low, self.high = own.low, own.high
        self.problem = SimpleNamespace(damped=False, extras=None)  # type: ignore[assignment]
        self.frequency = model.frequency
        self.pairs = Pair(np.zeros((0, model.size)), np.zeros((0, model.size)))
        self.forces = np.zeros((0, 0))
        self._known = {}

    def at(self, t: float) -> dict[str, float]:
        """All parameters at ``t`` above the low end."""
        return {**self._model.problem.reference, self.name: self.low + t}

    def matrices(self, mu: complex) -> tuple[Array, Any, Any]:
        problem = self._model.problem
        mass, damping, stiffness = assembled(
            self._model.projected, problem.factors(self.at(float(mu.real))), problem.powers
        )
        return mass, np.zeros_like(damping), stiffness

    def tangents(
        self, mu: float, coordinate: ComplexArray, values: ComplexArray, right: ComplexArray, left: ComplexArray
    ) -> ComplexArray:
        problem = self._model.problem
        slopes = problem.factor_slopes(self.at(mu), self.name)
        by_mass, _, by_stiffness = assembled(self._model.projected, slopes, problem.powers)
        change = coordinate * (by_mass @ right) + by_stiffness @ right
        with np.errstate(all="ignore"):
            by_x = np.einsum("ij,ij->j", left, self.matrices(mu)[0] @ right)
            return -np.einsum("ij,ij->j", left, change) / by_x


def _located(along: _Undamped, passage: Passage) -> tuple[float, float] | None:
    """Where two modes of the reduced problem meet, counted from the low end, and λ²; None where that is above the band
    or nowhere."""
    if passage.kind == "divergence":
        raise AnalysisError("without damping a mode diverges at zero frequency")

    def pair(t: float) -> tuple[complex, complex]:
        part = (t - passage.low) / (passage.high - passage.low)
        guess = (1 - part) * passage.means[0] + part * passage.means[1]
        return pair_near(along.eigenpairs(t).coordinate, guess)

    def square(t: float) -> float:
        return float(pair(t)[1].real)

    if not square(passage.low) > 0 > square(passage.high):
        return None
    t = float(scipy.optimize.brentq(square, passage.low, passage.high, xtol=1e-13 * (along.high - along.low)))
    x = float(pair(t)[0].real)
    return (t, x) if 0 < -x <= along.frequency**2 else None


def _confirmed(
    model: ReducedModel, along: _Undamped, t: float, x: float, solver: str | None
) -> UndampedOnset:
    """The same in the full problem, by Newton on the squared half difference over the parameter."""
    problem = model.problem
    found = along.eigenpairs(t)
    near = np.argsort(np.abs(found.coordinate - x))[:2]
    right, left = (_spanned(model.vectors, v[:, near]) for v in (found.right, found.left))
    point, reduced_value = along.at(t), along.at(t)[along.name]
    range_, before = along.high - along.low, np.inf
    for _ in range(ROUNDS):
        mass, stiffness = _parts(problem, problem.factors(point))
        with factorise(sp.csr_array(stiffness + x * (1 + BESIDE) * mass), solver=solver) as factor:
            for _ in range(ITERATIONS):
                right = np.linalg.qr(factor.solve(mass @ right, refine=False))[0]
                left = np.linalg.qr(factor.solve(mass.T @ left, transpose=True, refine=False))[0]
        weight = left.T @ (mass @ right)
        small = -np.linalg.solve(weight, left.T @ (stiffness @ right))
        by_mass, by_stiffness = _parts(problem, problem.factor_slopes(point, along.name))
        change = left.T @ (by_stiffness @ right) + left.T @ (by_mass @ right) @ small
        square, slope = _half_difference(small, -np.linalg.solve(weight, change))
        x, step = float(np.trace(small)) / 2, -square / slope
        # Where matrices are stiff, steps end in rounding, which the backward error tells from no onset at all.
        if abs(step) <= SETTLED * range_ or before / 2 <= abs(step) <= ROUNDING * range_:
            residual = max(
                _left_over(mass, stiffness, right, small),
                _left_over(mass.T, stiffness.T, left, (weight @ small @ np.linalg.inv(weight)).T),
            )
            if not (residual <= BELIEVED and x < 0):
                break
            return UndampedOnset(point[along.name], float(np.sqrt(-x)) / (2 * np.pi), residual, reduced_value)
        point[along.name] += step
        before = abs(step)
        if not abs(point[along.name] - reduced_value) <= AWAY * range_:
            break
    raise AnalysisError(f"the onset without damping at {along.name} = {reduced_value:.6g} is not confirmed")


def _spanned(vectors: Array, z: ComplexArray) -> Array:
    """Real orthonormal columns (n, 2) that span two vectors on a basis, real ones or a conjugate pair."""
    both = np.linalg.svd(np.hstack([z.real, z.imag]), full_matrices=False)[0][:, :2]
    return np.linalg.qr(vectors @ both)[0]


def _parts(problem: ParametricProblem, factors: Array) -> tuple[Sparse, Sparse]:
    """M and K (n, n) with these factors of the terms."""
    total = {role: sp.csr_array((problem.size, problem.size)) for role in ("mass", "stiffness")}
    for term, factor in zip(problem.terms, factors, strict=True):
        if factor and term.role in total:
            total[term.role] = total[term.role] + factor * term.matrix
    return sp.csr_array(total["mass"]), sp.csr_array(total["stiffness"])


def _half_difference(small: Array, change: Array) -> tuple[float, float]:
    """Squared half difference of the eigenvalues of a matrix (2, 2), and what a change of the matrix makes of it."""
    (a, b), (c, d) = small
    (da, db), (dc, dd) = change
    return float((a - d) ** 2 / 4 + b * c), float((a - d) * (da - dd) / 2 + db * c + b * dc)


def _left_over(mass: Sparse, stiffness: Sparse, vectors: Array, small: Array) -> float:
    """Backward error of M V G + K V = 0."""
    rest = np.abs(mass @ vectors @ small + stiffness @ vectors)
    size = abs(mass) @ (np.abs(vectors) @ np.abs(small)) + abs(stiffness) @ np.abs(vectors)
    return float(rest.max() / max(float(size.max()), 1e-300))

"""Problems with several parameters along one of them, as the search for onsets sees them.

What varies is the part s of the way through the parameter's range, from 0 to 1: steps and tolerances of the search are
those of a friction coefficient whatever the parameter counts.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp

from ...errors import AnalysisError
from ...typing import Array, ComplexArray, Sparse
from ..options import Options
from ..parametric import Parameter, ParametricProblem, ReducedModel, Term
from ..parametric.dense import assembled, made_of
from ..quadratic import Quadratic
from .basis import OnBasis
from .family import EXACT, ROLES, Family, deviation, wide


class ParameterLine(Family):
    """A parametric problem from the low to the high end of one of its parameters, the others at ``point``."""

    def __init__(self, problem: ParametricProblem, name: str, point: Mapping[str, float], options: Options) -> None:
        super().__init__((0.0, 1.0), lambda s: problem.at(self.point(s)), options)
        (self.parameter,) = (p for p in problem.parameters if p.name == name)
        self.problem, self._point = problem, dict(point)

    def value(self, s: float) -> float:
        """The parameter's value at s."""
        own: Parameter = self.parameter
        return own.high if s == 1.0 else own.low + s * (own.high - own.low)

    def point(self, s: float) -> dict[str, float]:
        """Values of all parameters at s."""
        return {**self._point, self.parameter.name: self.value(s)}

    def factor_slopes(self, s: float) -> Array:
        """Derivatives (t,) of the terms' factors over s."""
        length = self.parameter.high - self.parameter.low
        return length * self.problem.factor_slopes(self.point(s), self.parameter.name)

    def at(self, mu: complex) -> Quadratic:
        """The problem at s, the sum of its terms. Raises AnalysisError for a complex one."""
        if mu.imag:
            raise AnalysisError("factors of terms are known for real parameters alone")
        return self.built(mu.real)

    def slopes(self, mu: complex) -> Quadratic:
        """dM/ds, dD/ds and dK/ds."""
        total = {role: sp.csr_array((self.size, self.size)) for role in ROLES}
        for term, slope in zip(self.problem.terms, self.factor_slopes(mu.real), strict=True):
            if slope:
                total[term.role] = total[term.role] + slope * term.matrix
        return Quadratic(*(sp.csr_array(total[role]) for role in ROLES))

    def backward_error(self, mu: float, lam: complex, x: ComplexArray) -> float:
        """Of the terms, not of their sum: where a load takes a stiffness away, rounding is all that is left of that."""
        rest = self.built(mu).residual(np.array([lam]), x[:, None])[:, 0]
        scale = np.zeros(self.size)
        for term, factor, power in zip(
            self.problem.terms, self.problem.factors(self.point(mu)), self.problem.powers.tolist(), strict=True
        ):
            scale += abs(factor) * abs(lam) ** power * (abs(term.matrix) @ np.abs(x))
        return float(np.abs(rest).max() / max(float(scale.max()), 1e-300))

    def _wide_terms(self, mu: complex) -> list[list[tuple[Sparse, Any]]]:
        result: list[list[tuple[Sparse, Any]]] = [[], [], []]
        for term, matrix, factor in zip(
            self.problem.terms, self._wide_matrices, self.problem.factors(self.point(mu.real)), strict=True
        ):
            if factor:
                result[ROLES.index(term.role)].append((matrix, np.longdouble(factor)))
        return result

    @cached_property
    def _wide_matrices(self) -> list[Sparse]:
        return [wide(t.matrix) for t in self.problem.terms]

    @cached_property
    def _reversible(self) -> bool:
        """Whether −λ̄ is an eigenvalue with every λ, as `Smooth.reversible` has it, for every value of the parameter."""
        damping = [t.matrix for t in self._acting if t.role == "damping"]
        if not damping:
            return True
        potential = all(t.symmetric or _is(t.matrix, t.matrix.T) for t in self._acting if t.role != "damping")
        return potential and all(_is(d, -d.T) for d in damping)

    @cached_property
    def _acting(self) -> list[Term]:
        """Terms that are not zero throughout."""
        tried = np.array([self.problem.factors(self.point(s)) for s in np.linspace(0.0, 1.0, 9)])
        acting = zip(self.problem.terms, np.any(tried != 0.0, axis=0), strict=True)
        return [t for t, acts in acting if acts and t.matrix.nnz and np.any(t.matrix.data)]


def _is(one: Sparse, other: Any) -> bool:
    return deviation(one, sp.csr_array(other)) <= EXACT


def of_model(model: ReducedModel, name: str, point: Mapping[str, float]) -> ParameterLine:
    """The reduced model's own problem along a parameter: as small as its basis, of the full problem's kind."""
    terms = tuple(
        Term(sp.csr_array(matrix), t.role, t.factor, symmetric=t.symmetric)
        for t, matrix in zip(model.problem.terms, model.projected, strict=True)
    )
    return ParameterLine(ParametricProblem(terms, model.problem.parameters), name, point, Options())


class OnTerms(OnBasis):
    """A line whose matrices are small: the terms themselves (t, r, r), on all freedoms."""

    def __init__(self, line: ParameterLine, frequency: float, terms: Array) -> None:
        super().__init__(line, frequency, damped=not line.still)
        self._line, self._terms = line, terms

    def vectors(self, z: ComplexArray, mu: float, *, left: bool = False) -> ComplexArray:
        """The very vectors."""
        return z

    def matrices(self, mu: complex) -> tuple[Array, Any, Any]:
        """M, D and K (r, r) at s; of the real part of it."""
        problem = self._line.problem
        return assembled(self._terms, problem.factors(self._line.point(float(mu.real))), problem.powers)

    def changes(self, mu: complex) -> tuple[Array, Any, Any]:
        """dM, dD and dK over s (r, r), of the real part of it."""
        return assembled(self._terms, self._line.factor_slopes(float(mu.real)), self._line.problem.powers)

    def _entries(self, lam: complex, mu: complex) -> Array:
        problem = self._line.problem
        return made_of(self._terms, problem.factors(self._line.point(float(mu.real))), problem.powers, lam)

"""A problem over two numbers: its matrices anywhere in a rectangle, along any straight line, and what it costs.

Coordinates are shares of both ranges, so that the rectangle is the unit square.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp

from ...threads import one_thread
from ...typing import Array, BoolArray, ComplexArray
from ..at_rest import moving, rest_limit, told_growth
from ..dense_problem import DenseProblem, combined
from ..full.branches import ends_of
from ..full.growth import growing_roots
from ..full.line import OnTerms, ParameterLine
from ..full.search import Answer, search
from ..newton import Border, BorderedFactor
from ..options import Options
from ..parametric import Parameter, ParametricProblem, Term
from ..parametric.dense import DenseModes, assembled, dense_modes, made_of
from ..quadratic import Quadratic
from ..tolerances import SPLIT_RELATIVE, UNSTABLE_RELATIVE

REACH = 1.0 + 1e-9
NEAR_TOP = 0.98  # times the band: growing modes from there on may be about to leave it or have just come into it


@dataclass(frozen=True)
class Count:
    """What grows at a point: how many modes, a flutter pair being one, and how many roots, of which it is two.
    judged: whether none of them is so near the highest frequency that it may have passed that."""

    modes: int
    roots: int
    judged: bool


class Plane:
    """A parametric problem over two of its parameters, its terms (t, r, r) dense; top [1/s]: modes up to there.

    low, high (2,): the rectangle. solves and steps count eigenvalue problems and the factorisations of Newton's method.
    """

    def __init__(
        self, problem: ParametricProblem, terms: Array, names: tuple[str, str], point: Mapping[str, float], top: float,
        low: Array, high: Array,
    ) -> None:  # fmt: skip
        self.problem, self.terms, self.names, self.point, self.top = problem, terms, names, dict(point), top
        self.low, self.high = low, high
        self.solves = self.steps = 0
        self._last: tuple[tuple[float, float], tuple[Array, Array, Array]] | None = None

    def values(self, p: Array) -> dict[str, float]:
        """Values of all parameters at a point (2,)."""
        x, y = (self.low + np.asarray(p) * (self.high - self.low)).tolist()
        return {**self.point, self.names[0]: x, self.names[1]: y}

    def matrices(self, p: Array) -> tuple[Array, Array, Array]:
        """M, D and K (r, r) at a point."""
        key = (float(p[0]), float(p[1]))
        if self._last is None or self._last[0] != key:
            found = assembled(self.terms, self.problem.factors(self.values(p)), self.problem.powers)
            self._last = key, found
        return self._last[1]

    def made_of(self, p: Array, lam: complex) -> Array:
        """What the entries (r, r) of P(λ) are made of at a point."""
        return made_of(self.terms, self.problem.factors(self.values(p)), self.problem.powers, lam)

    def changes(self, p: Array, direction: Array) -> tuple[Array, Array, Array]:
        """What M, D and K (r, r) change by per unit of a direction (2,)."""
        factors = np.zeros(len(self.terms))
        for axis in (0, 1):
            if direction[axis]:
                length = direction[axis] * (self.high[axis] - self.low[axis])
                factors += length * self.problem.factor_slopes(self.values(p), self.names[axis])
        return assembled(self.terms, factors, self.problem.powers)

    def chord(self, p: Array, direction: Array, between: tuple[float, float]) -> Chord:
        """The problem along a straight line through a point, for Newton's method."""
        return Chord(self, p, direction, between)

    @one_thread
    def modes(self, p: Array) -> DenseModes:
        """All modes of the band at a point. Raises AnalysisError where the matrices are singular."""
        self.solves += 1
        return dense_modes(*self.matrices(p), self.top, REACH)

    def count(self, found: DenseModes) -> Count:
        """How much of this grows."""
        grows = found.values[self.grows(found.values)]
        near = bool(np.any(np.abs(grows) > NEAR_TOP * self.top))
        return Count(len(grows), growing_roots(grows), not near)

    def grows(self, values: ComplexArray) -> BoolArray:
        """Which eigenvalues (k,) at some point grow beyond rounding."""
        rounding = SPLIT_RELATIVE if self.reversible else UNSTABLE_RELATIVE
        return (values.real > told_growth(values, rounding, self.top)) & self.moving(values)

    def moving(self, values: ComplexArray) -> BoolArray:
        """Which eigenvalues (k,) at some point are no motions as a whole."""
        return moving(values, self.top, lambda: self.rest_limit)

    @cached_property
    def rest_limit(self) -> float:
        """Up to which |λ| [1/s] eigenvalues may be motions as a whole; 0 where none is."""
        corners = [np.array([x, y]) for x in (0.0, 0.5, 1.0) for y in (0.0, 0.5, 1.0)]
        return rest_limit([Quadratic(*self.matrices(p)) for p in corners], self.top)

    def slopes(self, p: Array, found: DenseModes) -> ComplexArray:
        """∇λ (2, k) of modes at a point; not finite where λ is double."""
        lam, z, w = found.values, found.right, found.left
        mass, damping, _ = self.matrices(p)
        by_lam = np.einsum("ij,ij->j", w, 2 * lam * combined(mass, z) + combined(damping, z))
        slopes = np.zeros((2, len(lam)), dtype=complex)
        for axis, direction in enumerate(np.eye(2)):
            a, b, c = self.changes(p, direction)
            moved = lam**2 * combined(a, z) + lam * combined(b, z) + combined(c, z)
            with np.errstate(all="ignore"):
                slopes[axis] = -np.einsum("ij,ij->j", w, moved) / by_lam
        return slopes

    @one_thread
    def onsets(self, axis: int, value: float) -> Answer:
        """Every change of stability on the line on which the coordinate ``axis`` has a value, by the one search that
        there is. Raises AnalysisError."""
        line = self.line(axis, value)
        source = _CountedLine(line, self.top, self.terms, self)
        source.find_at_rest()
        self.solves += 2
        return search(line, [lambda: source], (0.0, 1.0), ends_of(line, 0.0, 1.0, self.top), self.top)

    def line(self, axis: int, value: float) -> ParameterLine:
        """The line itself."""
        p = np.full(2, value)
        return _Line(self, self._small, self.names[1 - axis], self.values(p))

    @cached_property
    def reversible(self) -> bool:
        """Whether −λ̄ is an eigenvalue with every λ, everywhere."""
        return all(self.line(axis, 0.4321).reversible for axis in (0, 1))

    @cached_property
    def still(self) -> bool:
        """Whether nothing works on velocities."""
        return not np.any(self.terms[self.problem.powers == 1])

    @cached_property
    def sizes(self) -> Array:
        """What a unit of each unknown (r,) is worth."""
        middle = np.array([0.5, 0.5])
        return self.chord(middle, np.array([1.0, 0.0]), (0.0, 0.0)).sizes

    @cached_property
    def _small(self) -> ParametricProblem:
        """The problem on its basis, over the rectangle."""
        ranges = dict(zip(self.names, zip(self.low.tolist(), self.high.tolist(), strict=True), strict=True))
        parameters = tuple(
            Parameter(p.name, *ranges[p.name], value=float(np.mean(ranges[p.name]))) if p.name in ranges else p
            for p in self.problem.parameters
        )
        terms = (
            Term(sp.csr_array(matrix), t.role, t.factor, symmetric=t.symmetric)
            for t, matrix in zip(self.problem.terms, self.terms, strict=True)
        )
        return ParametricProblem(tuple(terms), parameters)


class Chord(DenseProblem):
    """The problem at p + a d over a in [low, high]."""

    def __init__(self, plane: Plane, p: Array, direction: Array, between: tuple[float, float]) -> None:
        super().__init__(plane.top, between, damped=not plane.still)
        self._plane, self._p, self.direction = plane, np.asarray(p, dtype=float), np.asarray(direction, dtype=float)

    def point(self, a: float) -> Array:
        """Where a leads to (2,)."""
        return np.asarray(self._p + a * self.direction)

    def matrices(self, mu: complex) -> tuple[Array, Any, Any]:
        """M, D and K (r, r) at a."""
        return self._plane.matrices(self.point(mu.real))

    def changes(self, mu: complex) -> tuple[Array, Any, Any]:
        """dM, dD and dK (r, r) over a."""
        return self._plane.changes(self.point(mu.real), self.direction)

    def _entries(self, lam: complex, mu: complex) -> Array:
        return self._plane.made_of(self.point(mu.real), lam)

    @property
    def reversible(self) -> bool:
        """That of the plane."""
        return self._plane.reversible

    def bordered(self, here: Quadratic, lam: complex, border: Border) -> Any:
        """Counted."""
        self._plane.steps += 1
        return super().bordered(here, lam, border)


class _CountedLine(OnTerms):
    """A line whose eigenvalue problems are counted."""

    def __init__(self, line: ParameterLine, frequency: float, terms: Array, plane: Plane) -> None:
        super().__init__(line, frequency, terms)
        self._plane = plane

    def solve(self, mu: complex) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
        self._plane.solves += 1
        return super().solve(mu)


class _Line(ParameterLine):
    """A line whose factorisations are counted."""

    def __init__(self, plane: Plane, small: ParametricProblem, name: str, point: Mapping[str, float]) -> None:
        super().__init__(small, name, point, Options())
        self._plane = plane

    def bordered(self, here: Quadratic, lam: complex, border: Border) -> BorderedFactor:
        self._plane.steps += 1
        return super().bordered(here, lam, border)

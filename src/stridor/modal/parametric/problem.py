"""Quadratic problems whose matrices are sums of fixed ones with factors that depend on parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
import scipy.sparse as sp

from ...case.points import choice
from ...errors import CaseError
from ...typing import Array, Sparse
from ..quadratic.problem import Quadratic
from .factors import Together, is_data

Role = Literal["mass", "damping", "stiffness"]
NOT_KNOWN = "outside the box, and the model does not know which nodes touch there"
CORNERS = 3  # parameters up to which all corners of a box are looked at
POWERS: Mapping[Role, int] = {"mass": 2, "damping": 1, "stiffness": 0}


@dataclass(frozen=True)
class Parameter:
    """A number that varies: its range, low < high, and the value where nothing else is said."""

    name: str
    low: float
    high: float
    value: float

    def __post_init__(self) -> None:
        inside = np.isfinite([self.low, self.high, self.value]).all() and self.low < self.high
        if not (inside and self.low <= self.value <= self.high):
            given = f"{self.low:g} … {self.high:g}, {self.value:g}"
            raise CaseError(f"box.{self.name}", given, "a range of two numbers low < high with the value inside")


@dataclass(frozen=True)
class Term:
    """A matrix (n, n) csr and its factor at values of the parameters, in the mass, damping or stiffness.

    factor: any function of the parameters by name; one of `factors` has exact derivatives and can be saved. symmetric:
    Aᵀ = A; stored once here so that nobody has to find out again.
    """

    matrix: Sparse
    role: Role
    factor: Callable[[Mapping[str, float]], float]
    symmetric: bool = False


@dataclass(frozen=True)
class ParametricProblem:
    """λ²M(p) + λD(p) + K(p) with every matrix a sum of terms."""

    terms: tuple[Term, ...]
    parameters: tuple[Parameter, ...]

    @property
    def size(self) -> int:
        """Number of freedoms n."""
        return int(self.terms[0].matrix.shape[0])

    @property
    def reference(self) -> dict[str, float]:
        """The parameters' own values."""
        return {p.name: p.value for p in self.parameters}

    @property
    def damped(self) -> bool:
        """Whether anything works on velocities."""
        return any(t.role == "damping" and t.matrix.nnz for t in self.terms)

    def point(self, values: Mapping[str, float] | Sequence[float]) -> dict[str, float]:
        """Values of all parameters, those not given at their own. Raises CaseError for unknown names and no numbers."""
        names = [p.name for p in self.parameters]
        given = dict(zip(names, values, strict=True)) if not isinstance(values, Mapping) else dict(values)
        for name, value in given.items():
            if name not in names:
                raise CaseError("values", name, f"no such parameter{choice(name, names, 'there are')}")
            if not np.isfinite(value):
                raise CaseError(f"values.{name}", value, "a finite number")
        return {**self.reference, **{k: float(v) for k, v in given.items()}}

    @property
    def idle(self) -> tuple[str, ...]:
        """Parameters that change no factor anywhere in the box, and so no mode."""
        shares = (0.0, 0.37, 0.71, 1.0)
        # The others away from ends, at which a factor that is a product of several may be zero.
        between = {p.name: p.low + 0.29 * (p.high - p.low) for p in self.parameters}
        lines = {
            p.name: [self.factors({**between, p.name: p.low + share * (p.high - p.low)}) for share in shares]
            for p in self.parameters
        }
        return tuple(name for name, (first, *more) in lines.items() if all(np.array_equal(first, f) for f in more))

    @property
    def idle_words(self) -> tuple[str, ...]:
        """A sentence for each parameter without effect."""
        return tuple(f"{name} has no effect: no matrix of the problem depends on it" for name in self.idle)

    def inside(self, values: Mapping[str, float]) -> bool:
        """Whether values lie in the box, its border included."""
        slack = {p.name: 1e-12 * (p.high - p.low) for p in self.parameters}
        return all(p.low - slack[p.name] <= values[p.name] <= p.high + slack[p.name] for p in self.parameters)

    def factors(self, values: Mapping[str, float]) -> Array:
        """Factors (t,) of the terms."""
        return self._factors(values)

    @cached_property
    def _factors(self) -> Together:
        return Together([t.factor for t in self.terms])

    def factor_slopes(self, values: Mapping[str, float], name: str) -> Array:
        """Derivatives (t,) of the factors over one parameter; of plain functions by differences within its range."""
        (own,) = (p for p in self.parameters if p.name == name)
        step = 1e-6 * (own.high - own.low)
        low, high = max(values[name] - step, own.low), min(values[name] + step, own.high)

        def slope(factor: Callable[[Mapping[str, float]], float]) -> float:
            if is_data(factor):
                return factor.slope(values, name)
            return (factor({**values, name: high}) - factor({**values, name: low})) / (high - low)

        return np.array([slope(t.factor) for t in self.terms], dtype=float)

    def at(self, values: Mapping[str, float] | Sequence[float]) -> Quadratic:
        """The problem at values of the parameters."""
        values = self.point(values)
        total = {role: sp.csr_array((self.size, self.size)) for role in POWERS}
        for term, factor in zip(self.terms, self.factors(values), strict=True):
            if factor:
                total[term.role] = total[term.role] + factor * term.matrix
        return Quadratic(*(sp.csr_array(total[role]) for role in ("mass", "damping", "stiffness")))

    @cached_property
    def powers(self) -> Array:
        """Exponents (t,) of λ: 2 for mass, 1 for damping, 0 for stiffness."""
        return np.array([POWERS[t.role] for t in self.terms])

    @property
    def sampled(self) -> list[dict[str, float]]:
        """Points of the box that stand for all of it: its corners and what lies between them, of many parameters both
        ends of all and the middle."""
        if len(self.parameters) <= CORNERS:
            return self.corners([3] * len(self.parameters))
        return [{p.name: p.low + share * (p.high - p.low) for p in self.parameters} for share in (0.0, 0.5, 1.0)]

    def corners(self, counts: Sequence[int]) -> list[dict[str, float]]:
        """A grid over the box, ``counts`` points along each parameter, closer at the ends (Chebyshev–Lobatto)."""
        axes: list[Array] = []
        for p, count in zip(self.parameters, counts, strict=True):
            shares = (1 - np.cos(np.linspace(0, np.pi, count))) / 2 if count > 1 else np.array([0.5])
            axes.append(p.low + (p.high - p.low) * shares)
        grid = np.stack([g.ravel() for g in np.meshgrid(*axes, indexing="ij")], axis=1)
        return [self.point([float(v) for v in row]) for row in grid]

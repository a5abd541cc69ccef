"""Factors of terms as data: they can be evaluated, differentiated, saved and read again."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property, lru_cache
from typing import Any, Protocol, TypeGuard, runtime_checkable

import numpy as np

from ...case.expression import Expression, parse_expression
from ...typing import Array, IntArray


@runtime_checkable
class ParameterFactor(Protocol):
    """A number that depends on parameters given by name."""

    def __call__(self, values: Mapping[str, float], /) -> float:
        """Its value."""
        ...

    def slope(self, values: Mapping[str, float], name: str) -> float:
        """Its derivative over one parameter."""
        ...

    def to_json(self) -> dict[str, Any]:
        """What `factor_from_json` makes the same factor of."""
        ...


def is_data(factor: object) -> TypeGuard[ParameterFactor]:
    """Whether a factor is more than a function: found out once for each class, as Python takes ten times as long for
    that as a derivative takes."""
    return _is_data(type(factor))


@cache
def _is_data(kind: type) -> bool:
    return issubclass(kind, ParameterFactor)


@dataclass(frozen=True)
class Product:
    """A product of parameters, (name, default) each; where a name is not among the values its default is taken."""

    names: tuple[tuple[str, float], ...] = ()

    def __call__(self, values: Mapping[str, float], /) -> float:
        result = 1.0
        for name, default in self.names:
            result *= values.get(name, default)
        return float(result)

    def slope(self, values: Mapping[str, float], name: str) -> float:
        """Its derivative over one parameter."""
        total = 0.0
        for k, (own, _) in enumerate(self.names):
            if own == name and name in values:
                total += Product(self.names[:k] + self.names[k + 1 :])(values)
        return total

    def to_json(self) -> dict[str, Any]:
        """What `factor_from_json` makes the same factor of."""
        return {"kind": "product", "names": [list(pair) for pair in self.names]}


CONSTANT = Product()


@dataclass(frozen=True)
class Lagrange:
    """A product of Lagrange's polynomials, (name, points, k) each: one at its own k-th point and zero at the others."""

    polynomials: tuple[tuple[str, tuple[float, ...], int], ...]

    def __call__(self, values: Mapping[str, float], /) -> float:
        result = 1.0
        for name, grid, k in self.polynomials:
            for j, other in enumerate(grid):
                if j != k:
                    result *= (values[name] - other) / (grid[k] - other)
        return float(result)

    def slope(self, values: Mapping[str, float], name: str) -> float:
        """Its derivative over one parameter."""
        total = 0.0
        for index, (own, grid, k) in enumerate(self.polynomials):
            if own != name:
                continue
            others = Lagrange(self.polynomials[:index] + self.polynomials[index + 1 :])(values)
            rest = [j for j in range(len(grid)) if j != k]
            for left in rest:
                part = 1.0 / (grid[k] - grid[left])
                for j in rest:
                    if j != left:
                        part *= (values[name] - grid[j]) / (grid[k] - grid[j])
                total += others * part
        return float(total)

    def to_json(self) -> dict[str, Any]:
        """What `factor_from_json` makes the same factor of."""
        return {"kind": "lagrange", "places": [[name, list(grid), k] for name, grid, k in self.polynomials]}


@dataclass(frozen=True)
class Formula:
    """An arithmetic expression, as factors of imported matrices are, of parameters that vary (names) and others that
    do not (fixed). where: its path in the case, which errors name."""

    text: str
    names: tuple[str, ...]
    fixed: tuple[tuple[str, float], ...] = ()
    where: str = field(default="factor", compare=False)

    @cached_property
    def _expression(self) -> Expression:
        return parse_expression(self.text, (*self.names, *dict(self.fixed)), self.where)

    def __call__(self, values: Mapping[str, float], /) -> float:
        return self._expression.value(self._all(values), self.where)

    def slope(self, values: Mapping[str, float], name: str) -> float:
        """Its derivative over one parameter."""
        if name not in self._expression.names or name not in values:
            return 0.0
        return self._expression.slopes(self._all(values), self.where)[name]

    def _all(self, values: Mapping[str, float]) -> dict[str, float]:
        every = {**dict(self.fixed), **values}
        return {name: every[name] for name in self._expression.names}

    def to_json(self) -> dict[str, Any]:
        """What `factor_from_json` makes the same factor of."""
        return {"kind": "formula", "text": self.text, "names": list(self.names), "fixed": [list(f) for f in self.fixed]}


@dataclass(frozen=True)
class Times:
    """A product of factors of any kind."""

    parts: tuple[ParameterFactor, ...]

    def __call__(self, values: Mapping[str, float], /) -> float:
        result = 1.0
        for part in self.parts:
            result *= part(values)
        return result

    def slope(self, values: Mapping[str, float], name: str) -> float:
        """Its derivative over one parameter."""
        total = 0.0
        for k, part in enumerate(self.parts):
            own = part.slope(values, name)
            if own:
                total += own * Times(self.parts[:k] + self.parts[k + 1 :])(values)
        return total

    def to_json(self) -> dict[str, Any]:
        """What `factor_from_json` makes the same factor of."""
        return {"kind": "times", "parts": [part.to_json() for part in self.parts]}


def product_of(one: ParameterFactor, other: ParameterFactor) -> ParameterFactor:
    """The product of two factors, as simple as it can be."""
    if isinstance(one, Product) and isinstance(other, Product):
        return Product(tuple(sorted(one.names + other.names)))
    if one == CONSTANT or other == CONSTANT:
        return other if one == CONSTANT else one
    parts = tuple(p for f in (one, other) for p in (f.parts if isinstance(f, Times) else (f,)))
    return Times(parts)


@dataclass(frozen=True)
class Axis:
    """Points at which a function of one parameter is known, as places of polynomials in it or in its logarithm."""

    name: str
    points: tuple[float, ...]
    logarithmic: bool = False

    def weights(self, value: float) -> Array:
        """Lagrange's polynomials (k,) at a value of the parameter (barycentric; Berrut and Trefethen, SIAM Rev. 46)."""
        return _weights(self, value)

    def slopes(self, value: float) -> Array:
        """Their derivatives (k,) over the parameter."""
        x, w = self.nodes, self.barycentric
        with np.errstate(divide="ignore"):
            matrix = w[None, :] / w[:, None] / (x[:, None] - x[None, :])
        np.fill_diagonal(matrix, 0.0)
        np.fill_diagonal(matrix, -matrix.sum(axis=1))
        slopes = self.weights(value) @ matrix
        return slopes / value if self.logarithmic else slopes

    def coordinate(self, value: float) -> float:
        """What the polynomials are polynomials in."""
        with np.errstate(all="ignore"):
            return float(np.log(value)) if self.logarithmic else value

    @cached_property
    def nodes(self) -> Array:
        """Where the points are (k,)."""
        return np.array([self.coordinate(p) for p in self.points])

    @cached_property
    def barycentric(self) -> Array:
        """Weights (k,) of the barycentric formula."""
        x = self.nodes
        # In units in which products of distances neither grow nor shrink with their number.
        unit = max(float(np.ptp(x)), 1e-300) / 4
        apart = (x[:, None] - x[None, :]) / unit
        np.fill_diagonal(apart, 1.0)
        return 1.0 / apart.prod(axis=1)


@lru_cache(maxsize=1000)  # all terms of a problem have the same few axes
def _weights(axis: Axis, value: float) -> Array:
    distance = axis.coordinate(value) - axis.nodes
    hit = np.flatnonzero(distance == 0.0)
    if len(hit):
        weights = np.eye(len(distance))[hit[0]]
    else:
        share = axis.barycentric / distance
        weights = share / share.sum()
    weights.setflags(write=False)
    return weights


@dataclass(frozen=True)
class TabulatedFactor:
    """Values on a grid of points of one or more parameters, row by row, and polynomials through them."""

    axes: tuple[Axis, ...]
    values: tuple[float, ...]

    def __call__(self, values: Mapping[str, float], /) -> float:
        return self._combined([axis.weights(values[axis.name]) for axis in self.axes])

    def slope(self, values: Mapping[str, float], name: str) -> float:
        """Its derivative over one parameter."""
        if name not in [axis.name for axis in self.axes]:
            return 0.0
        return self._combined(
            [a.slopes(values[name]) if a.name == name else a.weights(values[a.name]) for a in self.axes]
        )

    def _combined(self, weights: list[Array]) -> float:
        table = self.table
        for own in weights:
            table = (own @ table.reshape(len(own), -1)).reshape(table.shape[1:])
        return float(table)

    @cached_property
    def table(self) -> Array:
        """Its values, with an index for each axis."""
        return np.array(self.values).reshape([len(axis.points) for axis in self.axes])

    def to_json(self) -> dict[str, Any]:
        """What `factor_from_json` makes the same factor of."""
        axes = [[axis.name, list(axis.points), axis.logarithmic] for axis in self.axes]
        return {"kind": "tabulated", "axes": axes, "values": list(self.values)}


class Together:
    """Factors (t,) of terms, asked at once: tables on the same axes, as the twenty of a contact's damping are, are gone
    through as one."""

    def __init__(self, factors: Sequence[Callable[[Mapping[str, float]], float]]) -> None:
        alike: dict[tuple[Axis, ...], list[tuple[int, Array]]] = {}
        for k, factor in enumerate(factors):
            if isinstance(factor, TabulatedFactor):
                alike.setdefault(factor.axes, []).append((k, factor.table))
        self._tables: list[tuple[tuple[Axis, ...], IntArray, Array]] = [
            (axes, np.array([k for k, _ in own]), np.stack([table for _, table in own])) for axes, own in alike.items()
        ]
        self._others = [(k, f) for k, f in enumerate(factors) if not isinstance(f, TabulatedFactor)]
        self._count = len(factors)

    def __call__(self, values: Mapping[str, float], /) -> Array:
        found = np.empty(self._count)
        for k, factor in self._others:
            found[k] = factor(values)
        for axes, at, tables in self._tables:
            part = tables
            for axis in axes:
                part = (axis.weights(values[axis.name]) @ part.reshape(len(at), len(axis.points), -1)).reshape(
                    len(at), *part.shape[2:]
                )
            found[at] = part
        return found


def factor_from_json(document: Mapping[str, Any]) -> ParameterFactor:
    """The factor that `to_json` was asked of. Raises ValueError for what is none."""
    try:
        if document["kind"] == "product":
            return Product(tuple((str(name), float(default)) for name, default in document["names"]))
        if document["kind"] == "formula":
            fixed = tuple((str(name), float(value)) for name, value in document["fixed"])
            return Formula(str(document["text"]), tuple(str(name) for name in document["names"]), fixed)
        if document["kind"] == "times":
            return Times(tuple(factor_from_json(part) for part in document["parts"]))
        if document["kind"] == "tabulated":
            axes = tuple(Axis(str(n), tuple(float(p) for p in grid), bool(log)) for n, grid, log in document["axes"])
            return TabulatedFactor(axes, tuple(float(v) for v in document["values"]))
        if document["kind"] == "lagrange":
            return Lagrange(
                tuple((str(n), tuple(float(g) for g in grid), int(k)) for n, grid, k in document["places"])
            )
    except (KeyError, TypeError) as error:
        raise ValueError(f"no factor of a term: {document!r}") from error
    raise ValueError(f"no such kind of factor: {document['kind']!r}")

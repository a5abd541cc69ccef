"""Factors of terms as data: they can be evaluated, differentiated, saved and read again."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol, runtime_checkable

from ...case.expression import Expression, parse_expression


@runtime_checkable
class Factor(Protocol):
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

    places: tuple[tuple[str, tuple[float, ...], int], ...]

    def __call__(self, values: Mapping[str, float], /) -> float:
        result = 1.0
        for name, grid, k in self.places:
            for j, other in enumerate(grid):
                if j != k:
                    result *= (values[name] - other) / (grid[k] - other)
        return float(result)

    def slope(self, values: Mapping[str, float], name: str) -> float:
        """Its derivative over one parameter."""
        total = 0.0
        for place, (own, grid, k) in enumerate(self.places):
            if own != name:
                continue
            others = Lagrange(self.places[:place] + self.places[place + 1 :])(values)
            away = [j for j in range(len(grid)) if j != k]
            for left in away:
                part = 1.0 / (grid[k] - grid[left])
                for j in away:
                    if j != left:
                        part *= (values[name] - grid[j]) / (grid[k] - grid[j])
                total += others * part
        return float(total)

    def to_json(self) -> dict[str, Any]:
        """What `factor_from_json` makes the same factor of."""
        return {"kind": "lagrange", "places": [[name, list(grid), k] for name, grid, k in self.places]}


@dataclass(frozen=True)
class Formula:
    """An arithmetic expression, as factors of imported matrices are, of parameters that vary (names) and others that
    do not (fixed)."""

    text: str
    names: tuple[str, ...]
    fixed: tuple[tuple[str, float], ...] = ()

    @cached_property
    def _expression(self) -> Expression:
        return parse_expression(self.text, (*self.names, *dict(self.fixed)), "factor")

    def __call__(self, values: Mapping[str, float], /) -> float:
        return self._expression.value(self._all(values), "factor")

    def slope(self, values: Mapping[str, float], name: str) -> float:
        """Its derivative over one parameter."""
        if name not in self._expression.names or name not in values:
            return 0.0
        return self._expression.slopes(self._all(values), "factor")[name]

    def _all(self, values: Mapping[str, float]) -> dict[str, float]:
        every = {**dict(self.fixed), **values}
        return {name: every[name] for name in self._expression.names}

    def to_json(self) -> dict[str, Any]:
        """What `factor_from_json` makes the same factor of."""
        return {"kind": "formula", "text": self.text, "names": list(self.names), "fixed": [list(f) for f in self.fixed]}


def factor_from_json(document: Mapping[str, Any]) -> Factor:
    """The factor that `to_json` was asked of. Raises ValueError for what is none."""
    try:
        if document["kind"] == "product":
            return Product(tuple((str(name), float(default)) for name, default in document["names"]))
        if document["kind"] == "formula":
            fixed = tuple((str(name), float(value)) for name, value in document["fixed"])
            return Formula(str(document["text"]), tuple(str(name) for name in document["names"]), fixed)
        if document["kind"] == "lagrange":
            return Lagrange(
                tuple((str(n), tuple(float(g) for g in grid), int(k)) for n, grid, k in document["places"])
            )
    except (KeyError, TypeError) as error:
        raise ValueError(f"no factor of a term: {document!r}") from error
    raise ValueError(f"no such kind of factor: {document['kind']!r}")

"""Matrices that depend on parameters in whatever way, as sums of fixed ones: interpolated where they are polynomials.

A modulus, a density, a damping factor enter linearly, a thickness to the third power. Matrices are made at Chebyshev
points of every parameter that changes them, products of them where several do, and polynomials through them are exact
once enough points are taken; whether they are is tried at points between. What is known to depend on parameters by a
factor (a formula, friction) comes with that factor, and only the rest is interpolated.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
import scipy.sparse as sp

from ...errors import AnalysisError
from ...typing import Array, Sparse
from .factors import CONSTANT, Lagrange, ParameterFactor, product_of
from .problem import Parameter, Role, Term

MOST_POINTS = 6  # of one parameter
EXACT = 1e-10  # of the largest entry: what interpolation may leave
SYMMETRIC = 1e-13


@dataclass(frozen=True)
class FactoredPart:
    """A part of the mass, damping or stiffness and the factor it is known to have."""

    matrix: Sparse
    role: Role
    factor: ParameterFactor = CONSTANT


# Values of the parameters that are to be interpolated over → pieces by name, the same names everywhere.
Pieces = Callable[[Mapping[str, float]], Mapping[str, FactoredPart]]


def interpolated_terms(pieces_at: Pieces, parameters: tuple[Parameter, ...]) -> tuple[Term, ...]:
    """Terms whose sum is what ``pieces_at`` gives for all values of the parameters.

    Raises AnalysisError where a piece is no polynomial of a low degree in them.
    """
    reference = {p.name: p.value for p in parameters}
    cache: dict[tuple[float, ...], Mapping[str, FactoredPart]] = {}

    def at(changes: Mapping[str, float]) -> Mapping[str, FactoredPart]:
        values = {**reference, **changes}
        key = tuple(values[p.name] for p in parameters)
        if key not in cache:
            cache[key] = pieces_at(values)
        return cache[key]

    terms: list[Term] = []
    for label, piece in at({}).items():
        terms += _interpolated(piece, lambda changes, label=label: at(changes)[label].matrix, parameters)
    return merged(terms)


def extrapolated(pieces_at: Pieces, parameters: tuple[Parameter, ...], values: Mapping[str, float]) -> float:
    """How far, of the largest entry, mass, damping or stiffness of `interpolated_terms` are at values outside
    the ranges from what ``pieces_at`` gives there."""
    terms, pieces = interpolated_terms(pieces_at, parameters), pieces_at(values).values()
    worst = 0.0
    for role in sorted({part.role for part in pieces}):
        mine = [part for part in pieces if part.role == role]
        nothing = sp.csr_array(mine[0].matrix.shape)  # zero terms, of no damping, are left out
        ours = sum((t.factor(values) * t.matrix for t in terms if t.role == role), start=nothing)
        truth = sum((part.factor(values) * part.matrix for part in mine), start=nothing)
        worst = max(worst, deviation(ours, truth))
    return worst


def _interpolated(
    piece: FactoredPart, matrix_at: Callable[[Mapping[str, float]], Sparse], parameters: tuple[Parameter, ...]
) -> list[Term]:
    """The terms of one piece."""
    grids = {p.name: grid for p in parameters if (grid := _points(matrix_at, piece.role, p)) is not None}
    if not grids:
        return term_of(piece.matrix, piece.role, piece.factor)
    parts: list[tuple[Sparse, Lagrange]] = []
    for chosen in product(*(range(len(g)) for g in grids.values())):
        nodes = {n: (grid, k) for (n, grid), k in zip(grids.items(), chosen, strict=True)}
        parts.append((matrix_at({n: float(grid[k]) for n, (grid, k) in nodes.items()}), _weight(nodes)))
    between = {p.name: p.low + 0.37 * (p.high - p.low) for p in parameters}
    _check(parts, piece.role, between, matrix_at(between))
    return [t for matrix, weight in parts for t in term_of(matrix, piece.role, product_of(piece.factor, weight))]


def term_of(matrix: Sparse, role: Role, factor: ParameterFactor) -> list[Term]:
    """A matrix as a term, none where it is zero."""
    csr = sp.csr_array(matrix)
    if not csr.nnz or not np.any(csr.data):
        return []
    return [Term(csr, role, factor, symmetric=deviation(csr, sp.csr_array(csr.T)) <= SYMMETRIC)]


def merged(terms: Iterable[Term]) -> tuple[Term, ...]:
    """The same sum with one term for each factor of each role."""
    found: dict[tuple[Role, Any], list[Term]] = {}
    for term in terms:
        found.setdefault((term.role, term.factor), []).append(term)
    result: list[Term] = []
    for (role, factor), same in found.items():
        if len(same) == 1:
            result += same
            continue
        total = sp.csr_array(sum((t.matrix for t in same[1:]), start=same[0].matrix))
        if all(t.symmetric for t in same):
            result.append(Term(total, role, factor, symmetric=True))
        else:
            result += term_of(total, role, factor)
    return tuple(result)


def _points(
    matrix_at: Callable[[Mapping[str, float]], Sparse], role: Role, parameter: Parameter
) -> Array | None:
    """Points (k,) of a parameter that make its matrix exact, None where it does not change it."""
    name, low, high = parameter.name, parameter.low, parameter.high
    tried = low + 0.37 * (high - low)
    if all(deviation(matrix_at({name: low}), matrix_at({name: other})) <= 1e-15 for other in (high, tried)):
        return None
    for count in range(2, MOST_POINTS + 1):
        grid = (low + high) / 2 - (high - low) / 2 * np.cos(np.pi * np.arange(count) / (count - 1))
        grid[0], grid[-1] = low, high
        weights = [_weight({name: (grid, k)})({name: tried}) for k in range(count)]
        total = sum(w * matrix_at({name: float(g)}) for w, g in zip(weights, grid, strict=True))
        if deviation(sp.csr_array(total), matrix_at({name: tried})) <= EXACT:
            return grid
    raise AnalysisError(
        f"the {role} does not depend on {name} as a polynomial of degree {MOST_POINTS - 1} or less between {low:g} and "
        f"{high:g}; take a smaller range"
    )


def _weight(nodes: Mapping[str, tuple[Array, int]]) -> Lagrange:
    """Product of Lagrange's polynomials, each one at its own point and zero at the others."""
    return Lagrange(tuple((name, tuple(float(g) for g in grid), k) for name, (grid, k) in nodes.items()))


def deviation(one: Any, other: Any) -> float:
    """Largest difference of two matrices over their largest entry."""
    size = max((float(np.abs(sp.csr_array(m).data).max(initial=0.0)) for m in (one, other)), default=0.0)
    difference = sp.csr_array(one - other)
    return float(np.abs(difference.data).max(initial=0.0)) / size if size else 0.0


def _check(parts: list[tuple[Sparse, Lagrange]], role: Role, values: Mapping[str, float], truth: Sparse) -> None:
    total = sum((weight(values) * matrix for matrix, weight in parts), start=sp.csr_array(truth.shape))
    if deviation(total, truth) > 10 * EXACT:
        raise AnalysisError(f"the {role} is no product of polynomials in the parameters; vary fewer of them at once")

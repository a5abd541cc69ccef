"""Matrices that depend on parameters in whatever way, as sums of fixed ones: interpolated where they are polynomials.

A modulus, a density, a damping factor enter linearly, a thickness to the third power, Ω² − 1 to the second. Matrices
are made at Chebyshev points of every parameter that changes them, products of them where several do, and polynomials
through them are exact once enough points are taken; whether they are is tried at points between.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import product
from typing import Any

import numpy as np
import scipy.sparse as sp

from ...errors import AnalysisError
from ...typing import Array, Sparse
from .factors import CONSTANT, Factor, Lagrange
from .problem import Parameter, Role, Term

MOST_POINTS = 6  # of one parameter
EXACT = 1e-10  # of the largest entry: what interpolation may leave
ROLES: tuple[Role, ...] = ("mass", "damping", "stiffness")
Matrices = Callable[[Mapping[str, float]], Mapping[Role, Sparse]]


def interpolated_terms(matrices_at: Matrices, parameters: tuple[Parameter, ...]) -> tuple[Term, ...]:
    """Terms whose sum is what ``matrices_at`` gives for all values of the parameters.

    Raises AnalysisError where the dependence is no polynomial of a low degree.
    """
    reference = {p.name: p.value for p in parameters}
    cache: dict[tuple[float, ...], Mapping[Role, Sparse]] = {}

    def at(**changes: float) -> Mapping[Role, Sparse]:
        values = {**reference, **changes}
        key = tuple(values[p.name] for p in parameters)
        if key not in cache:
            cache[key] = matrices_at(values)
        return cache[key]

    terms: list[Term] = []
    for role in ROLES:
        middle = at()[role]
        grids = {p.name: grid for p in parameters if (grid := _points(at, role, p)) is not None}
        if not grids:
            terms += _term(middle, role, CONSTANT)
            continue
        for chosen in product(*(range(len(g)) for g in grids.values())):
            values = {name: float(grid[k]) for (name, grid), k in zip(grids.items(), chosen, strict=True)}
            weight = _weight({name: (grid, k) for (name, grid), k in zip(grids.items(), chosen, strict=True)})
            terms += _term(at(**values)[role], role, weight)
        between = {p.name: p.low + 0.37 * (p.high - p.low) for p in parameters}
        _check(terms, role, between, at(**between)[role])
    return tuple(terms)


def _term(matrix: Sparse, role: Role, factor: Factor) -> list[Term]:
    csr = sp.csr_array(matrix)
    if not csr.nnz or not np.any(csr.data):
        return []
    return [Term(csr, role, factor, symmetric=_away(csr, sp.csr_array(csr.T)) <= 1e-13)]


def _points(at: Callable[..., Mapping[Role, Sparse]], role: Role, parameter: Parameter) -> Array | None:
    """Points (k,) of a parameter that make its matrix exact, None where it does not change it."""
    name, low, high = parameter.name, parameter.low, parameter.high
    tried = low + 0.37 * (high - low)
    if all(_away(at(**{name: low})[role], at(**{name: other})[role]) <= 1e-15 for other in (high, tried)):
        return None
    for count in range(2, MOST_POINTS + 1):
        grid = (low + high) / 2 - (high - low) / 2 * np.cos(np.pi * np.arange(count) / (count - 1))
        grid[0], grid[-1] = low, high
        weights = [_weight({name: (grid, k)})({name: tried}) for k in range(count)]
        total = sum(w * at(**{name: float(g)})[role] for w, g in zip(weights, grid, strict=True))
        if _away(sp.csr_array(total), at(**{name: tried})[role]) <= EXACT:
            return grid
    raise AnalysisError(
        f"the {role} does not depend on {name} as a polynomial of degree {MOST_POINTS - 1} or less between {low:g} and "
        f"{high:g}; take a smaller range"
    )


def _weight(places: Mapping[str, tuple[Array, int]]) -> Lagrange:
    """Product of Lagrange's polynomials, each one at its own point and zero at the others."""
    return Lagrange(tuple((name, tuple(float(g) for g in grid), k) for name, (grid, k) in places.items()))


def _away(one: Any, other: Any) -> float:
    """Largest difference of two matrices over their largest entry."""
    size = max((float(np.abs(sp.csr_array(m).data).max(initial=0.0)) for m in (one, other)), default=0.0)
    difference = sp.csr_array(one - other)
    return float(np.abs(difference.data).max(initial=0.0)) / size if size else 0.0


def _check(terms: list[Term], role: Role, values: Mapping[str, float], truth: Sparse) -> None:
    mine = [t for t in terms if t.role == role]
    total = sum((t.factor(values) * t.matrix for t in mine), start=sp.csr_array(truth.shape))
    if _away(total, truth) > 10 * EXACT:
        raise AnalysisError(f"the {role} is no product of polynomials in the parameters; vary fewer of them at once")

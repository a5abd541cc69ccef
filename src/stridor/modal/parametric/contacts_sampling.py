"""Vectors that depend smoothly on parameters, as a few fixed ones with tabulated factors.

They are computed at Chebyshev points of every parameter that changes them, of its logarithm where it is positive (what
depends on a stiffness has its poles at negative ones), as many as leave nothing at points between. Singular values over
the samples say how few vectors there really are.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import product

import numpy as np
import scipy.sparse as sp

from ...errors import AnalysisError
from ...typing import Array, Sparse
from .factors import CONSTANT, Axis, ParameterFactor, TabulatedFactor
from .problem import Parameter

COUNTS = (4, 7, 13, 25)  # of points along a parameter, each among the next
EXACT = 1e-10  # of the largest entry: what interpolation may leave
UNCHANGED = 1e-12  # of the largest entry: rounding of the solutions
KEPT = 1e-10  # of the strongest direction of the samples
TRIED = (0.08, 0.37, 0.81)  # of the range: where it is looked at what interpolation leaves
MOST_SAMPLES = 600

Values = Mapping[str, float]


@dataclass(frozen=True)
class Sampled:
    """Vectors (s, l) at the points of a grid, row by row; the grid has no axes where nothing changes them."""

    axes: tuple[Axis, ...]
    vectors: Array

    @property
    def points(self) -> list[dict[str, float]]:
        """Values of the parameters of the axes, one for each vector."""
        return _points(self.axes)

    def at(self, values: Values) -> Array:
        """The vector (l,) that polynomials through the samples give."""
        return _interpolated(self.axes, self.vectors, values)

    def compressed(self) -> list[tuple[ParameterFactor, Array]]:
        """As few vectors (l,) as there are independent ones among the samples, each with its factor."""
        return [(factor, weights @ self.vectors) for factor, weights in directions(self.axes, self.vectors)]


def sampled(parameters: tuple[Parameter, ...], at: Callable[[Values], Array], what: str) -> Sampled:
    """The vectors that ``at`` gives for values of the parameters. what: their name in messages.

    Raises AnalysisError where they change too sharply to be interpolated.
    """
    known: dict[tuple[float, ...], Array] = {}
    reference = {p.name: p.value for p in parameters}

    def vector(values: Values) -> Array:
        key = tuple(values[p.name] for p in parameters)
        if key not in known:
            known[key] = at(values)
        return known[key]

    axes = [axis for p in parameters if (axis := _axis(p, reference, vector, what)) is not None]
    if len(axes) > 1:
        axes = [_fewest(axis, reference, vector) for axis in axes]
    by_name = {p.name: p for p in parameters}
    for extra in (0, 3):
        counts = [min(len(a.points) + extra, COUNTS[-1]) for a in axes]
        grid = tuple(_with_points(by_name[a.name], count) for a, count in zip(axes, counts, strict=True))
        samples = int(np.prod([len(a.points) for a in grid]))
        if samples > MOST_SAMPLES:
            names = ", ".join(a.name for a in grid)
            raise AnalysisError(f"{what} over {names} takes {samples} solutions; vary fewer of them at once")
        found = Sampled(grid, np.array([vector({**reference, **point}) for point in _points(grid)]))
        if len(parameters) < 2:
            return found
        left = max(_left(found, vector, point) for point in _between(parameters))
        if left <= EXACT:
            return found
    names = " and ".join(a.name for a in axes)
    raise AnalysisError(f"{what} changes too sharply with {names} together ({left:.0e} is left); take smaller ranges")


def directions(axes: tuple[Axis, ...], vectors: Array) -> list[tuple[ParameterFactor, Array]]:
    """Factors and weights (s,) of the samples (s, l) that span them; factor times weighted samples, summed, is what
    polynomials through the samples give."""
    if not len(axes):
        return [(CONSTANT, np.ones(1))] if np.any(vectors) else []
    left, size, _ = np.linalg.svd(vectors, full_matrices=False)
    chosen = np.flatnonzero(size > KEPT * max(float(size[0]), 1e-300))
    return [(TabulatedFactor(axes, tuple(left[:, k].tolist())), left[:, k]) for k in chosen]


def combined_matrices(
    axes: tuple[Axis, ...], matrices: list[Sparse], tables: list[Array]
) -> list[tuple[ParameterFactor, Sparse]]:
    """Σ f_k A_k of symmetric A_k and factors tabulated on the axes (s,), by as few matrices as span them."""
    for matrix in matrices:
        matrix.sum_duplicates()
        matrix.eliminate_zeros()
    pattern = sp.csr_array(sum((abs(m) for m in matrices[1:]), start=abs(matrices[0])))
    pattern.sort_indices()
    entries = np.array([_on_pattern(m, pattern) for m in matrices])
    left, size, right = np.linalg.svd(entries, full_matrices=False)
    result: list[tuple[ParameterFactor, Sparse]] = []
    for k in np.flatnonzero(size > KEPT * max(float(size[0]), 1e-300)):
        whole = sp.csr_array((size[k] * right[k], pattern.indices, pattern.indptr), shape=pattern.shape)
        table = left[:, k] @ np.array(tables)
        result.append((TabulatedFactor(axes, tuple(table.tolist())), sp.csr_array((whole + whole.T) / 2)))
    return result


def _on_pattern(matrix: Sparse, pattern: Sparse) -> Array:
    """Values of a matrix at the entries (k,) of a pattern that holds all of them."""
    n = pattern.shape[1]
    keys, pattern_keys = (
        np.repeat(np.arange(a.shape[0], dtype=np.int64), np.diff(a.indptr)) * n + a.indices for a in (matrix, pattern)
    )
    found = np.zeros(len(pattern_keys))
    found[np.searchsorted(pattern_keys, keys)] = matrix.data
    return found


def _axis(parameter: Parameter, reference: Values, vector: Callable[[Values], Array], what: str) -> Axis | None:
    """As many points of a parameter as leave nothing of the vector between them; None where it does not change it."""
    name = parameter.name
    tried = [_value_at(parameter, part) for part in TRIED]
    ends = [vector({**reference, name: end}) for end in (parameter.low, parameter.high, *tried)]
    scale = max(float(np.abs(v).max(initial=0.0)) for v in ends)
    if all(float(np.abs(v - ends[0]).max(initial=0.0)) <= UNCHANGED * scale for v in ends[1:]):
        return None
    left = np.inf
    for count in COUNTS:
        axis = _with_points(parameter, count)
        found = Sampled((axis,), np.array([vector({**reference, name: p}) for p in axis.points]))
        left = max(_left(found, vector, {**reference, name: value}) for value in tried)
        if left <= EXACT:
            return axis
    raise AnalysisError(
        f"{what} changes too sharply with {name} between {parameter.low:g} and {parameter.high:g} to be interpolated "
        f"({left:.0e} is left with {COUNTS[-1]} points); take a smaller range"
    )


def _fewest(axis: Axis, reference: Values, vector: Callable[[Values], Array]) -> Axis:
    """Fewer points where these leave nothing either, judged by what all of them give."""
    name = axis.name
    whole = Sampled((axis,), np.array([vector({**reference, name: p}) for p in axis.points]))
    size = float(np.abs(whole.vectors).max(initial=0.0))
    ends = Parameter(name, axis.points[0], axis.points[-1], axis.points[0])
    checks = [*axis.points, *(_value_at(ends, part) for part in TRIED)]
    for count in range(2, len(axis.points)):
        fewer = _with_points(ends, count)
        part = Sampled((fewer,), np.array([whole.at({name: p}) for p in fewer.points]))
        if max(float(np.abs(part.at({name: v}) - whole.at({name: v})).max()) for v in checks) <= 0.1 * EXACT * size:
            return fewer
    return axis


def _left(found: Sampled, vector: Callable[[Values], Array], values: Values) -> float:
    """What interpolation leaves at values of the parameters, over the largest entry of the samples."""
    size = float(np.abs(found.vectors).max(initial=0.0))
    return float(np.abs(found.at(values) - vector(values)).max(initial=0.0)) / max(size, 1e-300)


def _interpolated(axes: tuple[Axis, ...], vectors: Array, values: Values) -> Array:
    table = vectors.reshape([*(len(axis.points) for axis in axes), vectors.shape[1]])
    for axis in axes:
        table = np.tensordot(axis.weights(values[axis.name]), table, axes=1)
    return table if axes else table[0]


def _points(axes: tuple[Axis, ...]) -> list[dict[str, float]]:
    names = [axis.name for axis in axes]
    return [dict(zip(names, chosen, strict=True)) for chosen in product(*(axis.points for axis in axes))]


def _value_at(parameter: Parameter, part: float) -> float:
    """The value at a part of the range, of its logarithm's where it is positive."""
    low, high = parameter.low, parameter.high
    if low > 0:
        return float(low * (high / low) ** part)
    return low + part * (high - low)


def _with_points(parameter: Parameter, count: int) -> Axis:
    parts = (1 - np.cos(np.pi * np.arange(count) / (count - 1))) / 2
    inner = [_value_at(parameter, float(part)) for part in parts[1:-1]]
    return Axis(parameter.name, (parameter.low, *inner, parameter.high), logarithmic=parameter.low > 0)


def _between(parameters: tuple[Parameter, ...]) -> list[dict[str, float]]:
    """Points of the box in no relation to any grid."""
    rng = np.random.default_rng(20061)
    return [{p.name: _value_at(p, float(rng.random())) for p in parameters} for _ in range(3)]

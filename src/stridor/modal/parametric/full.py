"""Eigenpairs of the full problem next to those of the reduced one: one factorisation for each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...errors import AnalysisError
from ...threads import one_thread
from ...typing import Array, ComplexArray
from ..quadratic.inverse_iteration import two_sided
from ..quadratic.problem import Quadratic
from ..tolerances import CONFIRMED
from .model import ReducedModel

OFF = 1e-6  # of λ: how far beside it is factorised, so that the matrix is not singular


@dataclass(frozen=True)
class FullModes:
    """Eigenvalues λ (k,) [1/s] of the full problem with right and left vectors (n, k) of unit length and the larger of
    both sides' componentwise backward errors residual (k,); shift (k,): what the reduced ones were off, relative."""

    values: ComplexArray
    right: ComplexArray
    left: ComplexArray
    residual: Array
    shift: Array


@one_thread
def verified(
    model: ReducedModel, values: Mapping[str, float] | Sequence[float], *, which: str = "unstable",
    solver: str | None = None,
) -> FullModes:  # fmt: skip
    """The modes of the full problem at a point of the box, from the reduced ones: the "unstable" or "all".

    Costs one factorisation for each. Raises AnalysisError where one does not settle, or settles on another mode.
    """
    modes = model.modes(values)
    chosen = np.flatnonzero(modes.unstable) if which == "unstable" else np.arange(len(modes.values))
    problem = model.problem.at(modes.point)
    right, left = model.expand(modes)[:, chosen], model.expand(modes, left=True)[:, chosen]
    found = [refined(problem, complex(modes.values[c]), right[:, k], left[:, k], solver) for k, c in enumerate(chosen)]
    n = problem.size
    lam = np.array([f[0] for f in found], dtype=complex)
    x = np.array([f[1] for f in found], dtype=complex).reshape(len(found), n).T
    y = np.array([f[2] for f in found], dtype=complex).reshape(len(found), n).T
    residual = np.maximum(problem.backward_error(lam, x), problem.transposed.backward_error(lam, y))
    if np.any(residual > CONFIRMED):
        raise AnalysisError(f"a mode of the full problem does not settle: a backward error of {residual.max():.1e}")
    return FullModes(lam, x, y, residual, np.abs(lam - modes.values[chosen]) / np.abs(lam))


def refined(
    problem: Quadratic, lam: complex, right: ComplexArray, left: ComplexArray, solver: str | None = None
) -> tuple[complex, ComplexArray, ComplexArray]:
    """λ and right and left vectors (n,) next to those given, by two-sided inverse iteration with one factorisation.

    Raises AnalysisError where it does not settle.
    """
    found = two_sided(problem, lam, right, left, beside=OFF * lam, solver=solver)
    if found is not None:
        enough = max(1e-12 * abs(found.lam), rounding(problem, found.lam, found.right, found.left))
        if found.change <= enough:
            return found.lam, found.right, found.left
    raise AnalysisError(f"the mode near λ = {lam:.6g} 1/s does not settle in the full problem")


def rounding(problem: Quadratic, lam: complex, x: ComplexArray, y: ComplexArray) -> float:
    """What rounding of the matrices' entries and products may make of λ: of stiff ones far more than of λ itself."""
    rate, size = abs(lam), np.abs(x)
    scale = rate**2 * (abs(problem.mass) @ size) + rate * (abs(problem.damping) @ size) + abs(problem.stiffness) @ size
    return float(4 * np.finfo(float).eps * (np.abs(y) @ scale) / abs(y @ problem.slope(lam, x)))

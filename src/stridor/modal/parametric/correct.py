"""A correction step where the reduced model alone is not good enough: outside its box, or beyond its bound.

What a mode leaves in the full problem, ρ = P(λ)Vz from the right and P(λ)ᵀVw from the left, is answered by the static
operator A₀ of the offline stage, and the answers extend the basis for this point alone:

    V⁺ = [V, A₀⁻¹ρ_right, A₀⁻¹ρ_left] ,   one block of solves, no factorisation.

The modes of the band are in V already; of the rest A₀⁻¹ is nearly the inverse of P(λ), so that a step takes residuals
down to about a third and eigenvalues, whose errors are products of two, to a tenth or less. What is left in the full
problem is then formed, not estimated.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg as sl

from ...direct import Factor, factorise
from ...errors import CaseError
from ...threads import one_thread
from ...typing import Array, BoolArray, ComplexArray
from ..dense_problem import combined
from .basis import real_and_imaginary, residual
from .dense import assembled, dense_modes
from .model import REACH, ReducedModel, growing, product_over_slope
from .offline import static_operator, symmetric_parts

STEPS = 10  # at most
NEW = 1e-10  # of a unit vector: what is less is rounding of vectors known already


@dataclass(frozen=True)
class CorrectedModes:
    """Modes at one point: λ (k,) [1/s], right and left vectors (n, k) of unit length in the full problem.

    residual (k,): the larger of both sides' componentwise backward errors there; scaled_residual (k,): as that of
    `ReducedModes`, but formed. error (k,): estimated of λ, relative,
    from the full residuals; passed (k,): whether that is below the model's bound. steps: how many corrections were
    made. point, inside, still, top as in `ReducedModes`.
    """

    point: Mapping[str, float]
    values: ComplexArray
    right: ComplexArray
    left: ComplexArray
    residual: Array
    scaled_residual: Array
    error: Array
    passed: BoolArray
    steps: int
    inside: bool
    still: float = 0.0
    top: float = 0.0

    @property
    def frequency_hz(self) -> Array:
        """Frequencies (k,) [Hz]."""
        return self.values.imag / (2 * np.pi)

    @property
    def growth_rate(self) -> Array:
        """Re λ (k,) [1/s], positive where unstable."""
        return self.values.real

    @property
    def unstable(self) -> BoolArray:
        """Which grow (k,), motions as a whole not among them."""
        return growing(self.values, self.still, self.top)


class Corrector:
    """A₀ of a reduced model factorised once, and steps made with it. Use it in a `with` block, or call `free`, where
    memory is short."""

    def __init__(self, model: ReducedModel, *, solver: str | None = None) -> None:
        self.model = model
        operator, self._scale = static_operator(*symmetric_parts(model.problem), model.searched)
        self._factor: Factor = factorise(operator, symmetric=True, solver=solver)

    def free(self) -> None:
        """Give the memory of the factors back; correcting is over then."""
        self._factor.free()

    def __enter__(self) -> Corrector:
        return self

    def __exit__(self, *_: object) -> None:
        self.free()

    @one_thread
    def modes(self, values: Mapping[str, float] | Sequence[float], *, steps: int = 1) -> CorrectedModes:
        """All modes up to the model's frequency at a point, with at most ``steps`` corrections, fewer where all pass
        the bound before. Raises CaseError for unknown parameters and numbers of steps that are none.
        """
        if not 0 <= steps <= STEPS:
            raise CaseError("steps", steps, f"a number of steps from 0 to {STEPS}")
        model, problem = self.model, self.model.problem
        point = problem.point(values)
        factors, powers = problem.factors(point), problem.powers
        basis, projected = model.vectors, model.projected
        made = 0
        while True:
            matrices = assembled(projected, factors, powers)
            found = dense_modes(*matrices, model.searched, REACH, whole=model.whole)
            right, left = combined(basis, found.right), combined(basis, found.left)
            rests = (
                residual(problem, factors, found.values, right),
                residual(problem, factors, found.values, left, left=True),
            )
            lengths = [np.linalg.norm(self._scale[:, None] * rest, axis=0) for rest in rests]
            error = model.constant * product_over_slope(matrices, found, *lengths)
            doubtful = error > model.bound
            if made == steps or not doubtful.any():
                break
            force = np.hstack([real_and_imaginary(rest[:, doubtful]) for rest in rests])
            grown = self._extended(basis, projected, self._factor.solve(force, refine=False))
            if grown is None:
                break
            basis, projected = grown
            made += 1
        right, left = right / np.linalg.norm(right, axis=0), left / np.linalg.norm(left, axis=0)
        full = problem.at(point)
        backward = np.maximum(
            full.backward_error(found.values, right), full.transposed.backward_error(found.values, left)
        )
        return CorrectedModes(
            point, found.values, right, left, backward, np.maximum(*lengths), error, ~doubtful, made,
            problem.inside(point), model.still(found.values), model.searched,
        )  # fmt: skip

    def _extended(self, basis: Array, projected: Array, block: Array) -> tuple[Array, Array] | None:
        """The basis with what is new in ``block`` (n, k), and the terms on it; None where nothing is."""
        # By orthogonal columns rather than their Gram matrix, which small problems make singular: their basis may hold
        # all there is.
        root = 1.0 / self._scale[:, None]
        span = sl.qr(root * basis, mode="economic")[0]
        block = root * block
        size = np.linalg.norm(block, axis=0)
        block = block[:, size > 0] / size[size > 0]
        for _ in range(2):
            block = block - span @ (span.T @ block)
        squares, turn = sl.eigh(block.T @ block)
        keep = (squares > NEW**2) & (np.arange(len(squares), 0, -1) <= len(basis) - basis.shape[1])
        if not keep.any():
            return None
        new = block @ (turn[:, keep] / np.sqrt(squares[keep])) / root
        r, total = basis.shape[1], basis.shape[1] + new.shape[1]
        result = np.zeros((len(projected), total, total))
        result[:, :r, :r] = projected
        for index, term in enumerate(self.model.problem.terms):
            image = term.matrix @ new
            result[index, :r, r:], result[index, r:, r:] = basis.T @ image, new.T @ image
            result[index, r:, :r] = result[index, :r, r:].T if term.symmetric else (term.matrix.T @ new).T @ basis
        return np.hstack([basis, new]), result

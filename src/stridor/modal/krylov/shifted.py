"""The one factorisation everything rests on: the frictionless problem at a shift below all its frequencies.

A₀ = [[K + sM, −Nᵀ], [−N, −c]] with s > 0 is symmetric, and regular also where the structure can move as a whole. Its
inverse takes forces to motions that respect the contacts exactly, which is what every basis vector is made of.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg as sl
import scipy.sparse as sp

from ...errors import AnalysisError
from ...stages import passing, stage
from ...system import System
from ...typing import Array
from ..dense_problem import combined
from ..options import Options
from .kept_factors import KeptFactors
from .problem import ContactProblem

BLOCK = 24  # right sides solved for at once while modes are sought
CONVERGED = 1e-11  # of an eigenvalue of the inverse: what a Ritz vector may leave
MOST_BLOCKS = 200
RESPECTED = 1e-13  # of what opens and closes a gap: what may be left of it
NEGATIVE = 1e-9  # of the largest Ritz value of the inverse: one that is negative beyond rounding
STANDS = 1e-7  # of the shift: a square of a frequency that is negative beyond rounding
SEED = 20061


class NotPositive(AnalysisError):
    """Some motion without friction has a negative stiffness, so that there are no frictionless modes to start from."""

    def __init__(self) -> None:
        super().__init__(
            "a motion has a negative stiffness, contacts included: it diverges by itself, and this analysis needs a "
            "structure that stands; `stridor modes` and `stridor onsets` take it"
        )


@dataclass(frozen=True)
class ForcedShapes:
    """Shapes u (n, k), column after column in memory, with the contact forces p (m, k) that go with them: N u + c p = 0
    for every column."""

    u: Array
    p: Array

    @property
    def count(self) -> int:
        """Number of columns k."""
        return int(self.u.shape[1])

    def combined(self, by: Array) -> ForcedShapes:
        """Linear combinations, by (k, l)."""
        return ForcedShapes(combined(self.u, by), self.p @ by)

    def less(self, other: ForcedShapes, weights: Array) -> ForcedShapes:
        """Minus the combinations of ``other`` with weights (l, k)."""
        return ForcedShapes(self.u - combined(other.u, weights), self.p - other.p @ weights)

    def with_(self, other: ForcedShapes) -> ForcedShapes:
        """Both side by side."""
        u = np.hstack([np.asfortranarray(self.u), np.asfortranarray(other.u)])
        return ForcedShapes(u, np.hstack([self.p, other.p]))


class Shifted:
    """A₀⁻¹ of a problem at ω² = −s [1/s²].

    Multipliers are scaled to the stiffness inside, so that the factorisation is well balanced.
    """

    def __init__(self, problem: ContactProblem, shift: float, kept: KeptFactors | None = None) -> None:
        self.problem = problem
        self.shift = shift
        self._factor, self._scale = (kept or KeptFactors()).solving(problem, -shift)

    @property
    def positive(self) -> bool:
        """Whether xᵀ(K + sM)x > 0 of every motion that respects the contacts; False where the solver does not tell."""
        return self._factor.inertia == self.problem.nodes

    def solve(self, force: Any, opening: Any = None, *, exact: bool = False) -> tuple[Any, Any]:
        """u (n, k), p (m, k) with (K + sM) u − Nᵀp = force (n, k) and N u + c p = opening (m, k), zero by default.

        Both are refined where it has to be ``exact``, or where contacts would not hold to RESPECTED. Else they are as
        elimination leaves them, in half the time: enough for shapes that span a space and are judged otherwise.
        """
        n, m = self.problem.size, self.problem.nodes
        right = np.zeros((n + m, force.shape[1]), dtype=np.result_type(force, 0.0 if opening is None else opening))
        right[:n] = force
        if opening is not None:
            right[n:] = -self._scale * opening
        answer = self._factor.solve(right, refine=exact)
        if not exact and not self._respected(right, answer):
            answer = self._factor.solve(right)
        return answer[:n], self._scale * answer[n:]

    def _respected(self, right: Any, answer: Any) -> bool:
        """Whether the rows of contacts hold to RESPECTED of their terms."""
        n, problem = self.problem.size, self.problem
        if not problem.nodes:
            return True
        normal, closing = sp.csr_array(self._scale * problem.normal), self._scale**2 * problem.compliance[:, None]
        u, p = answer[:n], answer[n:]
        left = normal @ u + closing * p + right[n:]
        terms = abs(normal) @ np.abs(u) + closing * np.abs(p) + np.abs(right[n:])
        # Where a node hardly moves, its terms are themselves rounding of those of others.
        return bool(np.all(np.abs(left) <= RESPECTED * np.maximum(terms, 1e-3 * terms.max(axis=0))))


def keep_standing(system: System, options: Options, shifted: Shifted) -> None:
    """Let the system know the rate at which its structure was seen to stand, for `standing_at`."""
    extras = shifted.problem.extras
    if shifted.positive and (extras is None or extras.rests):
        system.answers.keep(("stands at", options), math.sqrt(shifted.shift))


def standing_at(system: System, options: Options) -> float:
    """A rate σ [1/s] at which σ²M + K, contacts without friction included, is known to be positive definite, its
    contacts those of the laws' own sliding; infinite where none is known."""
    known = system.answers.known(("stands at", options))
    return math.inf if known is None else float(known)


# Of the displacements a gap is made of: as far as it is known.
ROUNDING = 16 * float(np.finfo(float).eps)
# Squared length, of one, that a shape must have apart from the others.
APART = 1e-8


def modes_below(problem: ContactProblem, square: float, kept: KeptFactors | None = None) -> int | None:
    """How many frictionless modes have ω² below ``square`` [1/s²], by the signs of pivots (Sylvester's law of inertia).

    kept: factors that may serve. None where the solver does not tell the signs.
    """
    told = (kept or KeptFactors()).negative(problem, square)
    return None if told is None else told - problem.nodes


def shift_for(problem: ContactProblem, frequency: float | None) -> float:
    """s [1/s²]: a tenth of the angular frequency of interest, squared.

    Where that frequency is not known, a millionth of the largest ratio of stiffness to mass.
    """
    if frequency is not None:
        return (0.1 * frequency) ** 2
    mass, stiffness = problem.mass.diagonal(), problem.stiffness.diagonal()
    moving = mass > 0
    largest = float((stiffness[moving] / mass[moving]).max(initial=1.0))
    return 1e-6 * largest


@passing()
def frictionless_modes(shifted: Shifted, enough: Callable[[Array, int], bool]) -> tuple[Array, ForcedShapes]:
    """ω² (k,) [1/s²] ascending, and the modes as pairs of unit modal mass.

    Block Lanczos with every vector kept: one block solve brings BLOCK vectors, and multiple frequencies come as they
    are. ``enough`` is asked with all converged ω² below the first that is not, and the number of vectors so far.
    """
    stage("modes without friction")
    mass = shifted.problem.mass
    empty = ForcedShapes(np.zeros((shifted.problem.size, 0)), np.zeros((0, 0)))
    block, _ = orthonormal(shifted.problem, empty, _start(shifted))
    if not block.count:  # rigid contact leaves nothing that could vibrate
        return _polished(shifted, block.u)
    basis, image = block, np.zeros((0, 0))
    for _ in range(MOST_BLOCKS):
        answer = ForcedShapes(shifted.solve(mass @ block.u)[0], np.zeros((0, block.count)))
        new, rest = orthonormal(shifted.problem, basis, answer)
        column = basis.u.T @ (mass @ answer.u)
        # The inverse is symmetric in the mass: what the earlier vectors give of the last is known.
        image = np.hstack([np.vstack([image, column[: len(image)].T]), column])
        values, vectors = sl.eigh((image + image.T) / 2)
        values, vectors = values[::-1], vectors[:, ::-1]
        left = np.linalg.norm(rest @ vectors[-block.count :], axis=0)
        good = (values > 0) & (left <= CONVERGED * values + 1e-14 * values[0])
        if values[-1] < -NEGATIVE * values[0]:
            raise NotPositive
        count = len(good) if good.all() else int(np.argmin(good))
        if not new.count or enough(1.0 / values[:count] - shifted.shift, basis.count):
            return _polished(shifted, basis.u @ vectors[:, :count])
        basis, block = basis.with_(new), new
    raise AnalysisError("the frictionless modes do not converge; ask for fewer modes or a lower max_frequency_hz")


def _start(shifted: Shifted) -> ForcedShapes:
    """A first block that respects the contacts."""
    problem = shifted.problem
    width = max(1, min(BLOCK, problem.size))
    random = np.random.default_rng(SEED).standard_normal((problem.size, width))
    return ForcedShapes(shifted.solve(problem.mass @ random)[0], np.zeros((0, width)))


def _polished(shifted: Shifted, shapes: Array) -> tuple[Array, ForcedShapes]:
    """One more inverse iteration of all together, which also gives the contact forces, and Rayleigh–Ritz."""
    problem = shifted.problem
    if not shapes.shape[1]:
        return np.zeros(0), ForcedShapes(shapes, np.zeros((problem.nodes, 0)))
    u, p = shifted.solve(problem.mass @ shapes, exact=True)
    found = ForcedShapes(u, p)
    # The iteration shortens each shape by its ω²: of one length again, and without what only rounding tells apart
    # where all modes of a small problem are found.
    found = found.combined(np.diag(1.0 / np.sqrt(np.einsum("ij,ij->j", u, problem.mass @ u))))
    lengths, axes = sl.eigh(_symmetric(found.u.T @ (problem.mass @ found.u)))
    told = lengths > APART
    found = found.combined(axes[:, told] / np.sqrt(lengths[told]))
    stiffness = found.u.T @ (problem.stiffness @ found.u) + found.p.T @ (problem.compliance[:, None] * found.p)
    squares, turn = sl.eigh(_symmetric(stiffness))
    if squares[0] < -STANDS * shifted.shift:
        raise NotPositive
    return squares, found.combined(turn)


def _symmetric(matrix: Array) -> Array:
    return (matrix + matrix.T) / 2


def orthonormal(
    problem: ContactProblem, basis: ForcedShapes, block: ForcedShapes, *, smallest: float = 1e-8
) -> tuple[ForcedShapes, Array]:
    """What pairs ``block`` (k) add to the M-orthonormal pairs ``basis``, and the weights (a, k) of it in them.

    Contact forces are transformed as their shapes are. Directions that leave less than ``smallest`` of their column's
    length, which is all that distinguishes them from rounding, are left out.
    """
    mass = problem.mass
    length = np.sqrt(np.maximum(np.einsum("ij,ij->j", block.u, mass @ block.u), 0.0))
    alive = np.flatnonzero(length > 0)
    new = block.combined(np.eye(len(length))[:, alive] / length[alive])
    weight = np.sqrt(np.maximum(mass.diagonal(), 1e-6 * mass.diagonal().mean()))[:, None]
    for last in (False, True):
        # Once for the ranks, and once more for what is left: twice is enough.
        new = new.less(basis, basis.u.T @ (mass @ new.u))
        if not new.count:
            break
        if last:
            gram = new.u.T @ (mass @ new.u)
            squares, vectors = sl.eigh((gram + gram.T) / 2)
            good = squares > 1e-6 * squares[-1]
            new = new.combined(vectors[:, good] / np.sqrt(squares[good]))
        else:
            # Pivoted QR in the lumped mass sees ranks down to rounding; a Gram matrix only to its root.
            r, order = sl.qr(weight * new.u, mode="r", pivoting=True)
            keep = int((np.abs(np.diag(r)) > smallest).sum())
            step = np.zeros((new.count, keep))
            step[order[:keep]] = sl.solve_triangular(r[:keep, :keep], np.eye(keep))
            new = new.combined(step)
    return closing(problem, new), new.u.T @ (mass @ block.u)


def closing(problem: ContactProblem, pairs: ForcedShapes) -> ForcedShapes:
    """The pairs with forces that close the gaps, N u + c p = 0, to the rounding of N u where contact has a stiffness:
    of what is left of a shape apart from others, shape and forces lose digits each by itself, and no basis vectors
    make up for what they say otherwise."""
    if not pairs.count or len(pairs.p) != problem.nodes:
        return pairs
    compliance = problem.compliance[:, None]
    opening = problem.normal @ pairs.u
    rounding = ROUNDING * (abs(problem.normal) @ np.abs(pairs.u))
    wrong = (compliance > 0) & (np.abs(opening + compliance * pairs.p) > rounding)
    forces = np.divide(-opening, compliance, out=pairs.p.copy(), where=wrong)
    return ForcedShapes(pairs.u, forces)


def real_columns(block: Any) -> Array:
    """Real and imaginary parts side by side, the imaginary ones only where there are any."""
    if block.dtype.kind != "c":
        return np.asarray(block)
    parts = [block.real]
    imaginary = np.flatnonzero(np.abs(block.imag).max(axis=0, initial=0.0) > 0)
    if len(imaginary):
        parts.append(block.imag[:, imaginary])
    return np.concatenate(parts, axis=1)

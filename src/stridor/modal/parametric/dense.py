"""Eigenpairs of small dense quadratic problems."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np
import scipy.linalg as sl

from ...direct.dense import DenseFactor
from ...errors import AnalysisError
from ...typing import Array, BoolArray, ComplexArray, IntArray
from ..dense_problem import combined
from ..quadratic.inverse_iteration import iterated
from ..quadratic.problem import Quadratic
from ..shift_inverted import damped_pairs, undamped_pairs
from .mostly_real import MostlyReal

NEAR = (1.2, 4.0)  # modes up to this much above the band are solved for together: first try, second try
SMALL = 1e-13
HIDDEN = 0.3  # share of their stiffness that damping of modes far away may reach at the end of the band
EDGE = 1.2  # times the band: modes up to here are carried along, as damping may bring them into it; of those further
# away half of HIDDEN is what it may do to their frequency
WATCHED = 1.1  # times the band: and up to here they must settle
ANSWERS = 6
REAL = 1e-3  # of the band: λ with less of an imaginary part may be real
FEW = 20  # modes that others' answers leave unsettled, solved for one by one
OFF = 1e-10  # of λ: how far beside it is factorised, so that the matrix is not singular
JUMP = 0.1  # of the distance to the next mode: what an inverse iteration may move one
MIXED = 0.1  # share of a mode in another by damping from which the two are not told apart by answers
MOVED = 0.5  # of the distance to the next mode: what answers may move one

Matrices = tuple[Array, Array, Array]  # M, D, K (r, r)


@dataclass(frozen=True)
class DenseModes:
    """λ (k,) with Im λ ≥ 0 ascending, right and left vectors (r, k) of unit length, yᵀP(λ) = 0. whole: whether it took
    the whole companion matrix, or would have without `states`."""

    values: ComplexArray
    right: ComplexArray
    left: ComplexArray
    whole: bool = True


def dense_modes(
    mass: Array, damping: Array, stiffness: Array, frequency: float, reach: float, *, whole: bool = False
) -> DenseModes:
    """Eigenpairs of (λ²M + λD + K) z = 0 with |λ| ≤ reach · frequency [1/s]; real λ of either sign are among them.

    whole: take the whole companion matrix at once, where damping is known to be too strong for anything cheaper. Raises
    AnalysisError where the matrices are singular or not finite.
    """
    with np.errstate(all="ignore"):
        try:
            found = None if whole else _by_undamped(mass, damping, stiffness, frequency, reach)
            if found is None:
                found = DenseModes(*damped_pairs(mass, damping, stiffness, frequency, reach))
        except (ValueError, sl.LinAlgError) as error:
            raise AnalysisError("the reduced problem is singular or not finite; check the parameters") from error
    order = np.lexsort((found.values.real, found.values.imag))
    right, left = _unit(found.right[:, order]), _unit(found.left[:, order])
    return DenseModes(found.values[order], right, left, found.whole)


def _by_undamped(mass: Array, damping: Array, stiffness: Array, frequency: float, reach: float) -> DenseModes | None:
    """Through the modes without damping, at an eighth of the cost: those nearby solved for with damping, the others'
    answer to it added, λ by the two-sided Rayleigh functional. None where damping is too strong for that, or λ real.

    What is left on both sides bounds the error, whose product is kept below SMALL of λ.
    """
    squares, right, left = undamped_pairs(mass, stiffness, frequency, np.inf)
    left = left / np.linalg.norm(left, axis=0)
    for near in NEAR:
        found = _with_damping((mass, damping, stiffness), squares, right, left, frequency, reach, near)
        if found is not None:
            return found
    return None


def _with_damping(
    matrices: Matrices, squares: ComplexArray, right: ComplexArray, left: ComplexArray,
    frequency: float, reach: float, nearby: float,
) -> DenseModes | None:  # fmt: skip
    """The damped modes from all the undamped ones, of which those up to ``nearby`` times the band are solved together
    and all but the close ones answer for what is left; None where the answers do not settle."""
    mass, damping, stiffness = matrices
    near = np.abs(squares) <= (nearby * reach * frequency) ** 2
    far, mine = np.flatnonzero(~near), np.flatnonzero(near)
    if not len(mine):
        return None
    inner_right, inner_left = _real_span(right[:, mine], squares[mine]), _real_span(left[:, mine], squares[mine])
    inner_mass, inner_damping, inner_stiffness = (
        inner_left.T @ (matrix @ inner_right) for matrix in (mass, damping, stiffness)
    )
    lam, z, w = damped_pairs(inner_mass, inner_damping, inner_stiffness, frequency, EDGE * reach)
    if not len(lam) or np.any(lam.imag <= REAL * frequency):
        return None
    z, w = inner_right @ z, inner_left @ w
    z, w = _unit(z), _unit(w)
    of_right, of_left = MostlyReal(right), MostlyReal(left)
    weight = np.einsum("ij,ij->j", left, of_right.images(mass))
    top = reach * frequency
    scale = 1.0 / (np.sqrt(np.abs(weight)) * np.maximum(np.sqrt(np.abs(squares)), top))
    if top * _coupling(damping, MostlyReal(right[:, far] * scale[far]), MostlyReal(left * scale), len(far)) > HIDDEN:
        return None
    first = lam.copy()
    rough = _Rough(matrices, squares, weight, of_right, of_left, lam, z, w, top)
    rough.answering[far] = True
    unsettled = rough.answered(np.arange(len(lam)))
    if len(unsettled) and rough.recombined(unsettled):
        unsettled = rough.answered(unsettled)
    moved = (np.abs(lam) <= WATCHED * top) & (np.abs(lam - first) >= MOVED * _apart(first))
    if len(unsettled) > FEW or moved.any() or not rough.iterated(unsettled):
        return None
    inside = np.abs(lam) <= top
    if np.any(lam[inside].imag <= REAL * frequency):
        return None  # damped beyond critical after all: where one real λ is there is another
    return DenseModes(lam[inside], z[:, inside], w[:, inside], whole=False) if inside.any() else None


class _Rough:
    """Damped modes (lam, z, w) that are not those of the matrices yet, made so in place: other undamped modes
    (squares, right, left), of ``weight`` in the mass, answer for what each leaves; modes that damping mixes are
    combined anew; what is left unsettled takes the inverse itself. top [1/s]: the end of the band."""

    def __init__(
        self, matrices: Matrices, squares: ComplexArray, weight: ComplexArray, right: MostlyReal, left: MostlyReal,
        lam: ComplexArray, z: ComplexArray, w: ComplexArray, top: float,
    ) -> None:  # fmt: skip
        damping = matrices[1]
        self.matrices = matrices
        self.stacked, self.transposed = np.stack(matrices), np.stack([matrix.T for matrix in matrices])
        self.squares, self.weight, self.right, self.left = squares[:, None], weight[:, None], right, left
        self.lam, self.z, self.w, self.top = lam, z, w, top
        distance = np.abs(lam**2 - self.squares)
        self.own = np.argmin(distance, axis=0)
        # Of those that damping mixes with a mode the small problem has told it apart; for its own one λ answers.
        forced = [left.weighed(combined(damping, z)), right.weighed(combined(damping.T, w))]
        self.answering = np.abs(lam) * np.abs(forced).max(axis=0) <= MIXED * distance * np.abs(self.weight)
        self.answering[self.own, np.arange(len(lam))] = False

    def answered(self, at: IntArray) -> IntArray:
        """Let the others answer for the modes at these places (k,) until they settle or no more of them do; the
        places of those of them in the band that do not. (λ²M + K)⁻¹ is a sum over modes."""
        lam, z, w = self.lam, self.z, self.w
        ours, theirs = images(self.stacked, z[:, at]), images(self.transposed, w[:, at])
        number, watched = len(at) + 1, at
        for _ in range(ANSWERS):
            inverse = np.where(self.answering[:, at], 1.0 / ((lam[at] ** 2 - self.squares) * self.weight), 0.0)
            z[:, at] -= self.right.combined(inverse * self.left.weighed(_rest(lam[at], ours)))
            w[:, at] -= self.left.combined(inverse * self.right.weighed(_rest(lam[at], theirs)))
            ours, theirs = images(self.stacked, z[:, at]), images(self.transposed, w[:, at])
            lam[at] = _functional(lam[at], w[:, at], ours)
            unsettled = _unsettled(lam[at], w[:, at], ours, theirs)
            at = at[unsettled]
            watched = self._watched(at)
            before, number = number, len(watched)
            if not number or number == before:
                break
            ours, theirs = (made[:, :, unsettled] for made in (ours, theirs))
        return watched

    def recombined(self, at: IntArray) -> bool:
        """Solve for the modes at these places (k,) and all that damping mixes with them on what they span; whether each
        was found again."""
        mixed = np.flatnonzero(~self.answering[:, at].all(axis=1))
        among = np.union1d(at, np.flatnonzero(np.isin(self.own, mixed)))
        z, w = self.z[:, among], self.w[:, among]
        mass, damping, stiffness = (w.T @ image for image in images(self.stacked, z))
        try:
            lam, right, left = damped_pairs(mass, damping, stiffness, self.top, 2 * EDGE)
        except (ValueError, sl.LinAlgError):  # vectors that all but coincide span too little
            return False
        apart = _apart(self.lam)
        distance = np.abs(self.lam[at, None] - lam)
        found = distance.argmin(axis=1) if len(lam) else np.zeros(0, dtype=np.int64)
        if len(set(found.tolist())) < len(at) or np.any(distance.min(axis=1) >= JUMP * apart[at]):
            return False
        self.lam[at] = lam[found]
        self.z[:, at], self.w[:, at] = _unit(z @ right[:, found]), _unit(w @ left[:, found])
        return True

    def iterated(self, at: IntArray) -> bool:
        """Inverse iterations from the modes at these places (k,); whether all settle where they are."""
        problem = Quadratic(*self.matrices)
        for k in at:
            apart, old = _apart(self.lam)[k], complex(self.lam[k])
            factor = DenseFactor.of(problem.at(old * (1 + OFF)))
            found = iterated(problem, factor, old, self.z[:, k], self.w[:, k], fewest=2)
            if found is None or not abs(found.lam - old) < JUMP * apart:
                return False
            self.lam[k], self.z[:, k], self.w[:, k] = found.lam, found.right, found.left
        at = self._watched(at)
        ours, theirs = images(self.stacked, self.z[:, at]), images(self.transposed, self.w[:, at])
        return not _unsettled(self.lam[at], self.w[:, at], ours, theirs).any()

    def _watched(self, at: IntArray) -> IntArray:
        return at[np.abs(self.lam[at]) <= WATCHED * self.top]


def _unit(vectors: ComplexArray) -> ComplexArray:
    """The columns (r, k) at unit length."""
    return vectors / np.linalg.norm(vectors, axis=0)


def _apart(lam: ComplexArray) -> Array:
    """Of each λ (k,) how far the next one is away."""
    distance = np.abs(lam[:, None] - lam)
    np.fill_diagonal(distance, np.inf)
    nearest: Array = distance.min(axis=1, initial=np.inf)
    return nearest


def _coupling(damping: Array, right: MostlyReal, left: MostlyReal, count: int) -> float:
    """The norm of leftᵀ D right, of ``count`` columns, by a power iteration. Of modes scaled to unit stiffness, and far
    from the band: damping as strong as that, dashpots beyond critical, would bring them into the band as others."""
    x = np.random.default_rng(3).standard_normal((count, 2)) + 0j
    norm = 0.0
    for _ in range(4):
        x = x / np.maximum(np.linalg.norm(x, axis=0), 1e-300)
        y = left.weighed(combined(damping, right.combined(x)))
        norm = max(norm, float(np.linalg.norm(y, axis=0).max(initial=0.0)))
        x = right.weighed(combined(damping.T, left.combined(y.conj()))).conj()
    return norm


def _unsettled(lam: ComplexArray, w: ComplexArray, ours: ComplexArray, theirs: ComplexArray) -> BoolArray:
    """Of which modes (k,) what is left on both sides allows for an error above SMALL."""
    right, left = (np.linalg.norm(_rest(lam, made), axis=0) for made in (ours, theirs))
    slope = np.einsum("ij,ij->j", w, 2 * lam * ours[0] + ours[1])
    unsettled: BoolArray = ~(right * left <= SMALL * np.abs(lam * slope))
    return unsettled


def images(stacked: Array, z: ComplexArray) -> ComplexArray:
    """Mz, Dz and Kz (3, s, k) of matrices (3, s, r) that lie one after the other, in one product."""
    return np.asarray(combined(stacked.reshape(-1, stacked.shape[2]), z)).reshape(*stacked.shape[:2], -1)


def _rest(lam: ComplexArray, made: ComplexArray) -> ComplexArray:
    of_mass, of_damping, of_stiffness = made
    return lam**2 * of_mass + lam * of_damping + of_stiffness


@lru_cache(64)
def _alike(powers: bytes, kind: str) -> list[tuple[int, int]]:
    """From where to where neighbouring terms are on the same power of λ."""
    starts = np.flatnonzero(np.diff(np.frombuffer(powers, dtype=kind), prepend=-1)).tolist()
    return list(pairwise([*starts, len(powers) // np.dtype(kind).itemsize]))


def _functional(lam: ComplexArray, w: ComplexArray, made: ComplexArray) -> ComplexArray:
    """λ (k,) that makes wᵀP(λ)z zero, by Newton from the one before."""
    a, b, c = (np.einsum("ij,ij->j", w, image) for image in made)
    for _ in range(3):
        lam = lam - (a * lam**2 + b * lam + c) / (2 * a * lam + b)
    return lam


def _real_span(vectors: ComplexArray, squares: ComplexArray) -> Array:
    """Real vectors that span eigenvectors of a real problem: of conjugate pairs the real and the imaginary part."""
    columns = [vectors[:, squares.imag == 0].real]
    upper = vectors[:, squares.imag > 0]
    columns += [upper.real, upper.imag]
    return np.hstack(columns)


def made_of(projected: Array, factors: Array, powers: Array, lam: complex) -> Array:
    """What the entries (r, r) of P(λ) are made of: sizes of the terms, not of a sum in which they may cancel."""
    mass, damping, stiffness = assembled(np.abs(projected), np.abs(factors), powers)
    return np.asarray(abs(lam) ** 2 * mass + abs(lam) * damping + stiffness)


def assembled(projected: Array, factors: Array, powers: Array) -> Matrices:
    """M, D and K (r, s), or what else goes with each power of λ, from projected terms (t, r, s)."""
    mass, damping, stiffness = assembled_each(projected, (factors,), powers)[0]
    return mass, damping, stiffness


def assembled_each(projected: Array, chosen: Sequence[Array], powers: Array) -> Array:
    """`assembled` (c, 3, r, s) with each of several factors (t,), in one pass through the terms, which are more than
    the cache holds: those on one power of λ that follow one another together."""
    flat = projected.reshape(len(projected), -1)
    several = np.stack(chosen)
    total = np.zeros((len(several), 3, flat.shape[1]))
    for start, end in _alike(powers.tobytes(), powers.dtype.str):
        # A product of one row goes by BLAS's routine for vectors, which copies nothing.
        part = several[0, start:end] @ flat[start:end] if len(several) == 1 else several[:, start:end] @ flat[start:end]
        total[:, 2 - powers[start]] += part
    return total.reshape(-1, 3, *projected.shape[1:])

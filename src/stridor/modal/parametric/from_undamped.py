"""Damped modes of dense problems through the undamped ones, at an eighth of what the companion matrix costs."""

from __future__ import annotations

import numpy as np
import scipy.linalg as sl

from ...direct.dense import DenseFactor
from ...typing import Array, BoolArray, ComplexArray, IntArray
from ..dense_problem import images
from ..quadratic.inverse_iteration import iterated
from ..quadratic.problem import Quadratic
from ..shift_inverted import damped_pairs
from .among_modes import AmongModes

NEAR = (1.2, 4.0)  # modes up to this much above the band are solved for together: first try, second try
SMALL = 1e-13
HIDDEN = 0.3  # share of their stiffness that damping of modes far away may reach at the end of the band
EDGE = 1.2  # times the band: modes up to here are carried along, as damping may bring them into it; of those further
# away half of HIDDEN is what it may do to their frequency
WATCHED = 1.1  # times the band: and up to here they must settle
ANSWERS = 6
RECOMBINED = 3  # times that modes mixed by damping are combined anew, with the others' answers between
REAL = 1e-3  # of the band: λ with less of an imaginary part may be real
FEW = 20  # modes that others' answers leave unsettled, solved for one by one
OFF = 1e-10  # of λ: how far beside it is factorised, so that the matrix is not singular
JUMP = 0.1  # of the distance to the next mode: what an inverse iteration may move one
MIXED = 0.1  # share of a mode in another by damping from which the two are not told apart by answers
MOVED = 0.5  # of the distance to the next mode: what answers may move one

Matrices = tuple[Array, Array, Array]  # M, D, K (r, r)
Pairs = tuple[ComplexArray, ComplexArray, ComplexArray]


def modes_by_undamped(
    mass: Array, damping: Array, stiffness: Array, frequency: float, reach: float
) -> Pairs | None:
    """λ (k,) with |λ| ≤ reach · frequency and right and left vectors (r, k): of the undamped modes those nearby are
    solved for with damping, the others' answer to it is added, λ is by the two-sided Rayleigh functional. None where
    damping is too strong for that, or λ real.

    What is left on both sides bounds the error, whose product is kept below SMALL of λ.
    """
    among = AmongModes.of(mass, damping, stiffness, frequency)
    for near in NEAR:
        found = _with_damping((mass, damping, stiffness), among, frequency, reach, near)
        if found is not None:
            return found
    return None


def _with_damping(
    matrices: Matrices, among: AmongModes, frequency: float, reach: float, nearby: float
) -> Pairs | None:
    """The damped modes from all the undamped ones, of which those up to ``nearby`` times the band are solved together
    and all but the close ones answer for what is left; None where the answers do not settle."""
    size = np.abs(among.squares)
    near = size <= (nearby * reach * frequency) ** 2
    far, mine = np.flatnonzero(~near), np.flatnonzero(near)
    if not len(mine):
        return None
    inner_right, inner_left = among.right.vectors[:, mine], among.left.vectors[:, mine]
    lam, z, w = damped_pairs(
        inner_left.T @ among.of_mass[:, mine], among.between[np.ix_(mine, mine)],
        inner_left.T @ (matrices[2] @ inner_right), frequency, EDGE * reach,
    )  # fmt: skip
    if not len(lam) or np.any(lam.imag <= REAL * frequency):
        return None
    top = reach * frequency
    scale = 1.0 / (np.sqrt(np.abs(among.weight)) * np.maximum(np.sqrt(size), top))
    if top * _coupling(among, scale, far) > HIDDEN:
        return None
    first = lam.copy()
    rough = _Rough(matrices, among, lam, among.right.weights(z, mine), among.left.weights(w, mine), top)
    rough.answering[far] = True
    unsettled = rough.begun()
    for _ in range(RECOMBINED):
        if not len(unsettled) or not rough.recombined(unsettled):
            break
        unsettled = rough.answered(unsettled)
    moved = (np.abs(lam) <= WATCHED * top) & (np.abs(lam - first) >= MOVED * _apart(first))
    if len(unsettled) > FEW or moved.any() or not rough.iterated(unsettled):
        return None
    inside = np.abs(lam) <= top
    if np.any(lam[inside].imag <= REAL * frequency):
        return None  # damped beyond critical after all: where one real λ is there is another
    return (lam[inside], rough.z[:, inside], rough.w[:, inside]) if inside.any() else None


class _Rough:
    """Damped modes (lam, z, w) that are not those of the matrices yet, made so in place: other undamped modes answer
    for what each leaves; modes that damping mixes are combined anew; what is left unsettled takes the inverse itself.
    They begin as weights a and b (n, k) of the undamped ones. top [1/s]: the end of the band."""

    def __init__(
        self, matrices: Matrices, among: AmongModes, lam: ComplexArray, a: ComplexArray, b: ComplexArray, top: float
    ) -> None:
        self.matrices, self.among = matrices, among
        self.stacked, self.transposed = np.stack(matrices), np.stack([matrix.T for matrix in matrices])
        self.squares, self.weight = among.squares[:, None], among.weight[:, None]
        self.lam, self.a, self.b, self.top = lam, a, b, top
        self.z = self.w = np.zeros((0, len(lam)), dtype=complex)
        distance = np.abs(lam**2 - self.squares)
        self.own = np.argmin(distance, axis=0)
        # Of those that damping mixes with a mode the small problem has told it apart; for its own one λ answers.
        self.forced = among.damped(a), among.damped_left(b)
        sizes = (np.abs(f) / np.linalg.norm(v, axis=0) for f, v in zip(self.forced, (a, b), strict=True))
        self.answering = np.abs(lam) * np.maximum(*sizes) <= MIXED * distance * np.abs(self.weight)
        self.answering[self.own, np.arange(len(lam))] = False

    def begun(self) -> IntArray:
        """Let the others answer for all modes among the undamped ones, where damping alone couples; then the places of
        those in the band that are not settled as the matrices themselves have them."""
        among, at = self.among, np.arange(len(self.lam))
        lam, a, b, (ours, theirs), answering = self.lam, self.a, self.b, self.forced, self.answering
        before = np.full(len(lam), np.inf)
        for _ in range(ANSWERS):
            answer = np.where(answering, -lam / ((lam**2 - self.squares) * self.weight), 0.0)
            np.copyto(a, answer * ours, where=answering)
            np.copyto(b, answer * theirs, where=answering)
            last, ours, theirs = (ours, theirs), among.damped(a), among.damped_left(b)
            self.a[:, at], self.b[:, at] = a, b
            of_mass = self.weight * a
            mass, damping, stiffness = (np.einsum("ij,ij->j", b, of) for of in (of_mass, ours, -self.squares * of_mass))
            lam = self.lam[at] = _root(lam, mass, damping, stiffness)
            # What this answer still lacks on both sides, as far as it is the others'.
            lacking = np.abs(answer * (ours - last[0]) * (theirs - last[1])).sum(axis=0)
            wrong = lacking / np.abs(2 * lam * mass + damping)
            going = (wrong > SMALL / 2) & (wrong < before / 2) & (np.abs(lam) <= WATCHED * self.top)
            if not going.any():
                break
            at, lam, before = at[going], lam[going], wrong[going]
            a, b, ours, theirs, answering = (kept[:, going] for kept in (a, b, ours, theirs, answering))
        self.z, self.w = unit(among.right.combined(self.a)), unit(among.left.combined(self.b))
        ours, theirs = images(self.stacked, self.z), images(self.transposed, self.w)
        self.lam[:] = _functional(self.lam, self.w, ours)
        return self._watched(np.flatnonzero(_unsettled(self.lam, self.w, ours, theirs)))

    def answered(self, at: IntArray) -> IntArray:
        """Let the others answer for the modes at these places (k,) until they settle or no more of them do; the
        places of those of them in the band that do not. (λ²M + K)⁻¹ is a sum over modes."""
        lam, z, w, left, right = self.lam, self.z, self.w, self.among.left, self.among.right
        ours, theirs = images(self.stacked, z[:, at]), images(self.transposed, w[:, at])
        number, watched = len(at) + 1, at
        for _ in range(ANSWERS):
            inverse = np.where(self.answering[:, at], 1.0 / ((lam[at] ** 2 - self.squares) * self.weight), 0.0)
            z[:, at] -= right.combined(inverse * left.inner(_rest(lam[at], ours)))
            w[:, at] -= left.combined(inverse * right.inner(_rest(lam[at], theirs)))
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
        self.z[:, at], self.w[:, at] = unit(z @ right[:, found]), unit(w @ left[:, found])
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


def unit(vectors: ComplexArray) -> ComplexArray:
    """The columns (r, k) at unit length."""
    return vectors / np.linalg.norm(vectors, axis=0)


def _apart(lam: ComplexArray) -> Array:
    """Of each λ (k,) how far the next one is away."""
    distance = np.abs(lam[:, None] - lam)
    np.fill_diagonal(distance, np.inf)
    nearest: Array = distance.min(axis=1, initial=np.inf)
    return nearest


def _coupling(among: AmongModes, scale: Array, far: IntArray) -> float:
    """The norm of leftᵀ D right of all modes with these far ones, each scaled, by a power iteration. Of modes scaled to
    unit stiffness, and far from the band: damping as strong as that, dashpots beyond critical, would bring them into
    the band as others."""
    scale = scale[:, None]
    outside = np.zeros((len(scale), 1))
    outside[far] = scale[far]
    x = np.random.default_rng(3).standard_normal((len(scale), 2)) * (outside > 0) + 0j
    norm = 0.0
    for _ in range(4):
        x = x / np.maximum(np.linalg.norm(x, axis=0), 1e-300)
        y = scale * among.damped(outside * x)
        norm = max(norm, float(np.linalg.norm(y, axis=0).max(initial=0.0)))
        x = outside * among.damped_left(scale * y.conj()).conj()
    return norm


def _unsettled(lam: ComplexArray, w: ComplexArray, ours: ComplexArray, theirs: ComplexArray) -> BoolArray:
    """Of which modes (k,) what is left on both sides allows for an error above SMALL."""
    right, left = (np.linalg.norm(_rest(lam, made), axis=0) for made in (ours, theirs))
    slope = np.einsum("ij,ij->j", w, 2 * lam * ours[0] + ours[1])
    unsettled: BoolArray = ~(right * left <= SMALL * np.abs(lam * slope))
    return unsettled


def _rest(lam: ComplexArray, made: ComplexArray) -> ComplexArray:
    of_mass, of_damping, of_stiffness = made
    return lam**2 * of_mass + lam * of_damping + of_stiffness


def _functional(lam: ComplexArray, w: ComplexArray, made: ComplexArray) -> ComplexArray:
    """λ (k,) that makes wᵀP(λ)z zero, by Newton from the one before."""
    return _root(lam, *(np.einsum("ij,ij->j", w, image) for image in made))


def _root(lam: ComplexArray, a: ComplexArray, b: ComplexArray, c: ComplexArray) -> ComplexArray:
    for _ in range(3):
        lam = lam - (a * lam**2 + b * lam + c) / (2 * a * lam + b)
    return lam

"""All eigenvalues in the disc about one shift, with one factorisation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from ...typing import Array, BoolArray, ComplexArray, IntArray
from .krylov import Krylov
from .problem import Quadratic
from .region import Disc

BLOCK = 3  # right sides solved for at once, and the multiplicity that is found without a second look
LARGE, WIDE = 20_000, 6  # and so many beyond this number of freedoms, where reading the factors is what takes long
CONVERGED = 1e-9  # of θ: what a Ritz vector inside the disc may leave
CLOSE, SHARPER = 1e-3, 1e-12  # and less where another θ is this close: near a defective one errors are roots of this
NEARLY = 1e-3  # and one just outside, so that it is known to stay there
BEYOND = 1.05  # how far, over the radius, Ritz values must at least nearly have converged
GUARDS = 2  # and how many outside in any case
LESS, MOST = 1.08, 1.5  # growth of the basis between two looks at its Ritz values
TOO_CLOSE = 1e7  # |θ| of an eigenvalue so close to the shift that it spoils all others
LOOK = 4  # fresh right sides of a second look
STEPS = 3  # and how often S is applied to them
SEED = 2016


class TooClose(Exception):
    """The shift lies on an eigenvalue, to working precision as far as the others are concerned."""


@dataclass(frozen=True)
class DiscModes:
    """Eigenvalues (k,) [1/s] inside a disc, shapes (n, k) of unit norm and backward errors (k,)."""

    values: ComplexArray
    shapes: ComplexArray
    error: Array


@dataclass
class Search:
    """One shift's Krylov space, kept so that it can grow where something turns out to be missing.

    keep tells the eigenvalues whose shapes are wanted; most: vectors at most; tolerance: of the backward error. others:
    whether shapes of other eigenvalues are wanted as well, as they are.
    """

    problem: Quadratic
    krylov: Krylov
    keep: Callable[[ComplexArray], BoolArray]
    most: int
    tolerance: float
    looks: int = 0
    later: int = 0  # eigenvalues that only a second look brought
    seed: int = SEED
    others: bool = False
    found: DiscModes = field(init=False)
    beside: ComplexArray | None = None  # (n, l), see `RegionModes`
    disc: Disc = field(init=False)
    guards: ComplexArray = field(init=False)  # Ritz values outside the disc that have nearly converged
    _values: ComplexArray = field(init=False)
    _enough: float = 0.0
    _waiting: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))

    def run(self, guess: ComplexArray | None = None) -> None:
        """Grow from a random block, or from one made of ``guess`` (n, k), until all in the disc have converged."""
        krylov, n = self.krylov, self.problem.size
        width = self._width(BLOCK if n <= LARGE else WIDE)
        if guess is None or not guess.shape[1]:
            self._waiting = krylov.add(krylov.smooth(start(n, width, self.seed)))
        else:
            self._waiting = krylov.add(*self._seeded(guess, width))
        self._grow(8 * BLOCK)

    def look(self, width: int = LOOK, steps: int = STEPS) -> int:
        """Look once more from an independent random block, all that is known projected out; how many more it finds.

        The new vectors are orthogonal to the whole Krylov space, so that an eigenvector that the first block did not
        excite is now the largest of what is left and shows within a few steps.
        """
        before, krylov = self.disc, self.krylov
        number = self._number(before)
        self.looks += 1
        block = start(self.problem.size, self._width(width), self.seed + self.looks)
        fresh = krylov.add(krylov.smooth(block))
        for _ in range(steps):
            if not len(fresh):
                break
            fresh = krylov.advance(fresh)
        self._waiting = np.concatenate([self._waiting, fresh])
        self.most = max(self.most, krylov.count + 8 * (width + BLOCK))
        self._grow(0)
        # The disc may have grown, where there was no room for more vectors; what that brings had not been missed.
        new = max(self._number(before) - number, 0)
        self.later += new
        return new

    def _number(self, disc: Disc) -> int:
        """How many eigenvalues were found in a disc; of conjugates, which a real shift brings together, one."""
        inside: BoolArray = np.abs(self._values - disc.centre) <= disc.radius
        return int((inside & (self._values.imag >= 0) if self.krylov.kind is float else inside).sum())

    def release(self) -> None:
        """Forget the Krylov vectors; there is no looking again then."""
        self.krylov.forget()

    def _grow(self, first: int) -> None:
        check, before = first, (0, 0)
        while True:
            count = self.krylov.count
            if count >= check or not len(self._waiting) or count >= self.most:
                done, lacking = self._assess()
                if done:
                    return
                # Ritz values are dear in a large basis: the next look is due when, at their rate, all have converged.
                gain = (before[1] - lacking) / max(count - before[0], 1) if before[0] else 0.0
                step = 0.9 * lacking / gain if gain > 0 else 0.0
                check = int(max(count + BLOCK, min(max(step + count, LESS * count), MOST * count)))
                before = count, lacking
            self._waiting = self.krylov.advance(self._waiting)

    def _assess(self) -> tuple[bool, int]:
        """Whether to stop, as all in the disc have converged or no more vectors are to be had, and how many lack."""
        krylov = self.krylov
        theta, vectors, left = krylov.ritz()
        # What is infinite or practically so counts for nothing.
        finite = np.abs(theta) > 1e-12 * np.abs(theta).max(initial=0.0)
        theta, vectors, left = theta[finite], vectors[:, finite], left[finite]
        size: Array = np.abs(theta)
        if len(size) and size[0] > TOO_CLOSE and left[0] < NEARLY * size[0]:
            raise TooClose
        # Rounding is of the largest θ, and nothing gets below it.
        asked = np.where(_gaps(theta) <= CLOSE * size, SHARPER, CONVERGED) * size
        good: BoolArray = left <= np.maximum(asked, 50 * np.finfo(float).eps * size.max(initial=0.0))
        nearly: BoolArray = good | (left <= NEARLY * size)
        last = not len(self._waiting)
        guards = GUARDS if krylov.kind is complex else 2 * GUARDS  # and their conjugates
        beyond = int((size >= 1).sum()) + guards
        stop = bool(good[size >= 1].all() and nearly[size >= 1 / BEYOND].all() and nearly[:beyond].all())
        stop = stop and (last or len(size) >= beyond)
        full = last or krylov.count >= self.most
        if not (stop or full):
            return False, int((~good[size >= 1]).sum() + (~nearly[size < 1][:guards]).sum())
        reach = 1.0
        bad = np.flatnonzero(~good)
        if not stop and len(bad):
            # As far as all have converged, with the distance kept from the first that has not.
            reach = min(1.0, 1 / (BEYOND * float(size[bad[0]])))
        inside: BoolArray = size >= 1 / reach
        values: ComplexArray = krylov.shift + krylov.radius / theta
        kept: BoolArray = inside & self.keep(values)
        shapes = krylov.shapes(theta[kept], vectors[:, kept])
        error = self.problem.backward_error(values[kept], shapes)
        if stop and not full and (error > self.tolerance).any() and krylov.count < self._patience():
            return False, int((error > self.tolerance).sum())
        guard = float(np.abs(values[~inside] - krylov.shift).min(initial=np.inf))
        self.disc = Disc(complex(krylov.shift), reach * krylov.radius, int(inside.sum()), guard)
        self._values = values[inside]
        self.found = DiscModes(values[kept], shapes, error)
        self.guards = values[nearly & ~kept]
        if self.others:
            beside = np.flatnonzero(nearly & ~kept & (values.imag >= 0))
            self.beside = krylov.shapes(theta[beside], vectors[:, beside])
        return True, 0

    def _patience(self) -> float:
        """Vectors up to which a backward error that has not settled is waited for: half as many again."""
        self._enough = self._enough or 1.5 * self.krylov.count
        return self._enough

    def _width(self, width: int) -> int:
        return max(1, min(width, self.problem.size))

    def _seeded(self, guess: ComplexArray, width: int) -> tuple[ComplexArray, ComplexArray]:
        """Random combinations of guessed shapes, each as the pair it would be were it exact."""
        krylov, p = self.krylov, self.problem
        x = np.asarray(guess, dtype=complex)
        x = x / np.maximum(np.linalg.norm(x, axis=0), 1e-300)
        a, b, c = (np.einsum("ij,ij->j", x.conj(), m @ x) for m in (p.mass, p.damping, p.stiffness))
        theta = np.empty(x.shape[1], dtype=complex)
        for k, terms in enumerate(zip(a, b, c, strict=True)):
            # The Rayleigh functional nearest the shift.
            roots = np.roots(terms)
            near = roots[np.argmin(np.abs(roots - krylov.shift))] if len(roots) else np.inf
            offset = near - krylov.shift
            theta[k] = krylov.radius / offset if abs(offset) > 1e-6 * krylov.radius else 1e6
        mix = start(x.shape[1], width, self.seed)
        u, w = x @ (theta[:, None] * mix), x @ mix
        noise = krylov.smooth(start(p.size, width, self.seed + 1))
        noise *= 1e-4 * np.linalg.norm(u, axis=0) / np.maximum(np.linalg.norm(noise, axis=0), 1e-300)
        return krylov.own(u) + noise, krylov.own(w)


def _gaps(theta: ComplexArray) -> Array:
    """Distance of each to the nearest other."""
    distance = np.abs(theta[:, None] - theta[None, :])
    np.fill_diagonal(distance, np.inf)
    return np.asarray(distance.min(axis=1, initial=np.inf))


def start(rows: int, columns: int, seed: int) -> ComplexArray:
    """Random complex numbers (rows, columns), the same for the same seed."""
    parts = np.random.default_rng(seed).standard_normal((2, rows, columns))
    return parts[0] + 1j * parts[1]

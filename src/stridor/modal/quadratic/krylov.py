"""Block second-order Arnoldi in two levels (TOAR: Lu, Su and Bai 2016), for one shift.

With λ = σ + ρ/θ, P(λ)x = 0 reads θ²x + θ ρP(σ)⁻¹(2σM + D)x + ρ²P(σ)⁻¹M x = 0, and (θx, x) is an eigenvector of

    S (u, w) = (−P(σ)⁻¹(ρ(2σM + D)u + ρ²M w), u).

ρ is the radius of the disc looked at, so that the wanted θ are those of modulus one and more and both halves of their
vectors are of one size. It plays the part of the scaling of Fan, Lin and Van Dooren (2004), about σ instead of zero,
where their second factor cancels. Both halves of all Krylov vectors lie in one orthonormal basis Q (n, q) with q close
to their number, which is all that is stored of length n. About a real σ all of it is real, and modes come with their
conjugates. An infinite eigenvalue is θ = 0 and does no harm.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import scipy.linalg as sl

from ...typing import Array, ComplexArray, IntArray
from .problem import Quadratic, times

WIDTH = 64  # columns allocated at once
NOTHING = 1e-14  # of a vector's length: what orthogonalisation may leave of one that adds nothing


class OrthonormalColumns:
    """Orthonormal columns of length n, real or complex, kept in pieces so that growing never copies."""

    def __init__(self, n: int, kind: type = complex) -> None:
        self.n, self.kind = n, kind
        self.count = 0
        self._pieces: list[Any] = []

    def append(self, block: Any) -> None:
        """Add columns (n, b) as they are."""
        for column in range(block.shape[1]):
            index = self.count % WIDTH
            if index == 0:
                self._pieces.append(np.empty((self.n, WIDTH), dtype=self.kind, order="F"))
            self._pieces[-1][:, index] = block[:, column]
            self.count += 1

    def project(self, block: Any) -> Any:
        """Qᴴ block, (q, b), of a block as real as the columns are."""
        result = np.empty((self.count, block.shape[1]), dtype=self.kind)
        conjugate = block.conj().T
        for first, piece in self._filled():
            result[first : first + piece.shape[1]] = (conjugate @ piece).conj().T
        return result

    def combine(self, weights: Any) -> Any:
        """Q weights, (n, b)."""
        if self.kind is float and weights.dtype.kind == "c":
            return self.combine(weights.real) + 1j * self.combine(weights.imag)
        # As rows of columns: the other way round BLAS takes three times as long for a few of them.
        result = np.zeros((weights.shape[1], self.n), dtype=self.kind)
        for first, piece in self._filled():
            result += weights[first : first + piece.shape[1]].T @ piece.T
        return result.T

    def _filled(self) -> Any:
        for number, piece in enumerate(self._pieces):
            first = number * WIDTH
            yield first, piece[:, : min(WIDTH, self.count - first)]


class Krylov:
    """S V = V H + … on a growing orthonormal basis V of pairs (u, w) = (Q U₀, Q U₁).

    Vectors of V are numbered in the order they come; S has been applied to some, and the rest wait. They are real where
    the shift is.
    """

    def __init__(self, problem: Quadratic, solve: Callable[[Any], Any], shift: complex | float, radius: float) -> None:
        self.problem = problem
        self.kind: type = complex if isinstance(shift, complex) else float
        self.shift = shift
        self.radius = radius
        self.solves = 0
        self._solve = solve
        self._columns = OrthonormalColumns(problem.size, self.kind)
        self._pairs: Any = np.zeros((2, 0, 0), dtype=self.kind)
        self._image: Any = np.zeros((0, 0), dtype=self.kind)  # one column for each vector S has been applied to
        self._applied = np.zeros(0, dtype=np.int64)

    @property
    def count(self) -> int:
        """Number of vectors S has been applied to."""
        return len(self._applied)

    def forget(self) -> None:
        """Give the memory of the vectors back."""
        self._columns = OrthonormalColumns(self.problem.size, self.kind)

    def own(self, block: Any) -> Any:
        """A block (n, b) as these vectors are: about a real shift its real part, in which eigenvectors of real matrices
        come with their conjugates."""
        return np.ascontiguousarray(block.real) if self.kind is float else np.asarray(block, dtype=complex)

    def smooth(self, block: Any) -> Any:
        """P(σ)⁻¹ block: what an arbitrary block (n, b) has of the eigenvectors near the shift, mostly."""
        self.solves += block.shape[1]
        return self._solve(self.own(block))

    def add(self, u: Any, w: Any = None) -> IntArray:
        """Numbers of the vectors that (u, w) adds, w zero by default; none where they are in V already."""
        halves = u if w is None else np.hstack([u, w])
        seen = self._absorb(halves)
        coordinates = np.zeros((2, self._columns.count, u.shape[1]), dtype=self.kind)
        coordinates[0] = seen[:, : u.shape[1]]
        if w is not None:
            coordinates[1] = seen[:, u.shape[1] :]
        return self._orthogonal(coordinates)[0]

    def advance(self, which: IntArray) -> IntArray:
        """Apply S to the vectors of these numbers; the numbers of the new ones that this brings."""
        b, columns = len(which), self._columns
        both = columns.combine(np.hstack([self._pairs[0][:, which], self._pairs[1][:, which]]))
        u, w = np.ascontiguousarray(both[:, :b]), np.ascontiguousarray(both[:, b:])
        rate = self.radius
        force = times(self.problem.mass, 2 * self.shift * rate * u + rate**2 * w)
        force += rate * times(self.problem.damping, u)
        self.solves += b
        seen = self._absorb(-self._solve(force))
        coordinates = np.zeros((2, columns.count, b), dtype=self.kind)
        coordinates[0] = seen
        coordinates[1, : self._pairs.shape[1]] = self._pairs[0][:, which]
        new, weights = self._orthogonal(coordinates)
        image = np.zeros((len(weights), len(self._applied) + b), dtype=self.kind)
        image[: len(self._image), : len(self._applied)] = self._image
        image[:, len(self._applied) :] = weights
        self._image, self._applied = image, np.concatenate([self._applied, which])
        return new

    def ritz(self) -> tuple[ComplexArray, ComplexArray, Array]:
        """θ (k,) of descending modulus, their vectors in the applied ones (k, k), and ‖S v − θ v‖ (k,)."""
        values, vectors = sl.eig(self._image[self._applied], check_finite=False)
        order = np.argsort(-np.abs(values), kind="stable")
        values, vectors = values[order], vectors[:, order]
        waiting = np.setdiff1d(np.arange(self._pairs.shape[2]), self._applied)
        # Vectors that came after the last application have no row yet: nothing points to them.
        waiting = waiting[waiting < len(self._image)]
        return values, vectors, np.linalg.norm(self._image[waiting] @ vectors, axis=0)

    def shapes(self, values: ComplexArray, vectors: ComplexArray) -> ComplexArray:
        """x (n, k) of unit norm for Ritz values θ (k,), from the half of their vectors that is the larger."""
        upper = self._pairs[0][:, self._applied] @ vectors
        lower = self._pairs[1][:, self._applied] @ vectors
        x = self._columns.combine(np.where(np.abs(values) >= 1, upper, lower))
        return x / np.maximum(np.linalg.norm(x, axis=0), 1e-300)

    def _absorb(self, block: Any) -> Any:
        """Coordinates (q, b) of ``block`` in Q, to which it adds what it brings."""
        columns = self._columns
        length = np.maximum(np.linalg.norm(block, axis=0), 1e-300)
        first = columns.project(block)
        rest = block - columns.combine(first)
        new, upper = _independent(rest / length, columns.n - columns.count)
        # Twice: what the first pass leaves of a vector that is nearly in Q is not orthogonal to it.
        again = columns.project(new)
        new, more = np.linalg.qr(new - columns.combine(again)) if new.shape[1] else (new, upper[:0, :0])
        columns.append(new)
        return np.vstack([first + (again @ upper) * length, (more @ upper) * length])

    def _orthogonal(self, coordinates: Any) -> tuple[IntArray, Any]:
        """Numbers of the vectors that pairs of these coordinates (2, q, b) add to V, and their weights (m, b) in it."""
        q, m = coordinates.shape[1], self._pairs.shape[2]
        held = np.zeros((2, q, m), dtype=self.kind)
        held[:, : self._pairs.shape[1]] = self._pairs
        old, block = held.reshape(2 * q, m), coordinates.reshape(2 * q, -1)
        length = np.maximum(np.linalg.norm(block, axis=0), 1e-300)
        first = old.conj().T @ block
        new, upper = _independent((block - old @ first) / length, 2 * self._columns.n - m)
        again = old.conj().T @ new
        new, more = np.linalg.qr(new - old @ again) if new.shape[1] else (new, upper[:0, :0])
        weights = np.vstack([first + (again @ upper) * length, (more @ upper) * length])
        self._pairs = np.concatenate([held, new.reshape(2, q, -1)], axis=2)
        return np.arange(m, m + new.shape[1]), weights


def _independent(block: Any, room: int) -> tuple[Any, Any]:
    """An orthonormal basis (n, r) of the columns (n, b) of about unit length, and R (r, b): block = basis R."""
    basis, upper, order = sl.qr(block, mode="economic", pivoting=True, check_finite=False)
    rank = min(int((np.abs(np.diag(upper)) > NOTHING).sum()), max(room, 0))
    back = np.argsort(order)
    return basis[:, :rank], upper[:rank][:, back]

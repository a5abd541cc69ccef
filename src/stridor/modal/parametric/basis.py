"""A basis of real vectors that grows, with every term of a parametric problem projected on it."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.linalg as sl
import scipy.sparse as sp

from ...typing import Array, IntArray, Sparse
from ..quadratic.problem import times
from .problem import ParametricProblem
from .proportional import proportional

START = 200
ORTHOGONAL = 1e-11  # of unit vectors


class Indefinite(Exception):
    """The metric is not positive definite."""


class ReducedBasis:
    """V (n, r), orthonormal in the symmetric positive definite ``metric`` (n, n), and VᵀA_jV (t, r, r) of all terms.

    Damping that is proportional takes mass and stiffness times V, and what of it is not is a term of few freedoms.
    embedding (s, n) applied to A_jV and A_jᵀV gives their sketches (t, s, r): residuals are known without being
    formed. shares: of damping terms that are proportional, the factors of the terms they are sums of.
    """

    def __init__(self, problem: ParametricProblem, metric: Sparse, embedding: Sparse) -> None:
        self.problem, self.metric = problem, metric
        # Room for more columns than there are: growing by copies costs as much as multiplying.
        self._room = [np.zeros((problem.size, START), order="F") for _ in range(2)]
        self._count = 0
        self.projected = np.zeros((len(problem.terms), 0, 0))
        sums = proportional(problem.terms)
        self.shares = {j: shares for j, (shares, _) in sums.items()}
        # Terms of few freedoms, as contact has them, are multiplied on those alone.
        self._parts: list[tuple[IntArray, IntArray, Sparse]] = [
            _support(sums[j][1] if j in sums else term.matrix) for j, term in enumerate(problem.terms)
        ]
        by_column = sp.csc_array(embedding)
        self._embeddings = [
            tuple(sp.csr_array(by_column[:, which]) for which in (rows, columns)) for rows, columns, _ in self._parts
        ]
        empty = np.zeros((len(problem.terms), embedding.shape[0], 0))
        self.right_sketch, self.left_sketch = empty, empty

    @property
    def count(self) -> int:
        """Number of vectors r."""
        return self._count

    @property
    def vectors(self) -> Array:
        """V (n, r)."""
        return self._room[0][:, : self._count]

    @property
    def _image(self) -> Array:
        """metric · V (n, r)."""
        return self._room[1][:, : self._count]

    def add(self, block: Array, smallest: float, image: Array | None = None) -> int:
        """Take in what ``block`` (n, k) adds but for directions that leave less than ``smallest`` of a unit vector;
        returns how many vectors that made. image: metric · block where it is known. Raises Indefinite where the metric
        shows that it is."""
        images: Array = self.metric @ block if image is None else image
        square = np.einsum("ij,ij->j", block, images)
        if np.any(square < 0):
            raise Indefinite
        length = np.sqrt(square)
        new, images = block[:, length > 0] / length[length > 0], images[:, length > 0] / length[length > 0]
        if not new.shape[1]:
            return 0
        new, images = self._without(new, images)
        gram = new.T @ images
        squares, turn = sl.eigh((gram + gram.T) / 2)
        if squares[0] < -1e-8 * max(squares[-1], smallest**2):
            raise Indefinite
        keep = squares > smallest**2
        if not keep.any():
            return 0
        turn = turn[:, keep] / np.sqrt(squares[keep])
        new, images = self._without(new @ turn, images @ turn)
        gram = (new.T @ images + images.T @ new) / 2
        if np.abs(gram - np.eye(len(gram))).max() > ORTHOGONAL:
            straight = sl.solve_triangular(sl.cholesky(gram, lower=True), np.eye(len(gram)), lower=True).T
            new, images = new @ straight, images @ straight
        self._take(new, images)
        return int(new.shape[1])

    def forces(self, right: list[Array], left: list[Array]) -> Array:
        """Σ_j A_j V R_j + A_jᵀ V L_j (n, k) of combinations R_j and L_j (r, k), one of each for every term j."""
        n = self.problem.size
        total = np.zeros((n, right[0].shape[1]))
        # For terms of all freedoms, V is gone through once.
        large: list[tuple[Sparse, Array]] = []
        for (rows, columns, matrix), (own, mirrored) in zip(self._parts, self._shared(right, left), strict=True):
            for into, of, part, mix in ((rows, columns, matrix, own), (columns, rows, matrix.T, mirrored)):
                if mix is None:
                    continue
                if len(of) == n:
                    large.append((part, mix))
                else:
                    total[into] += part @ (self.vectors[of] @ mix)
        if large:
            images = np.split(self.vectors @ np.hstack([mix for _, mix in large]), len(large), axis=1)
            for (part, _), image in zip(large, images, strict=True):
                total += part @ image
        return total

    def _shared(self, right: list[Array], left: list[Array]) -> list[tuple[Array, Array | None]]:
        """Combinations of each term and of its transpose, of symmetric ones together, with those of terms that are
        sums of it."""
        terms = self.problem.terms
        mixes: list[tuple[Array, Array | None]] = [
            (r + w, None) if t.symmetric else (r, w) for t, r, w in zip(terms, right, left, strict=True)
        ]
        for j, shares in self.shares.items():
            for i, share in shares.items():
                mixes[i] = mixes[i][0] + share * mixes[j][0], None
        return mixes

    def _without(self, block: Array, image: Array) -> tuple[Array, Array]:
        """What of a block (n, k) and of its product with the metric is not in the basis."""
        weights = self._image.T @ block
        if np.abs(weights).max(initial=0.0) <= ORTHOGONAL:
            return block, image
        return block - self.vectors @ weights, image - self._image @ weights

    def _take(self, new: Array, image: Array) -> None:
        old, count = self.vectors, new.shape[1]
        r = self._count + count
        if r > self._room[0].shape[1]:
            room = [np.zeros((self.problem.size, 2 * r), order="F") for _ in range(2)]
            for wide, narrow in zip(room, self._room, strict=True):
                wide[:, : self._count] = narrow[:, : self._count]
            self._room = room
        for wide, part in zip(self._room, (new, image), strict=True):
            wide[:, self._count : r] = part
        self._count = r
        grown = np.zeros((len(self._parts), r, r))
        grown[:, : r - count, : r - count] = self.projected
        right_sketch: list[Array] = []
        left_sketch: list[Array] = []
        for j, ((rows, columns, part), term) in enumerate(zip(self._parts, self.problem.terms, strict=True)):
            whole = len(rows) == len(new)
            product = part @ (new if whole else new[columns])
            right = self.vectors.T @ product if whole else self.vectors[rows].T @ product
            grown[j, :, r - count :] = right
            right_sketch.append(self._embeddings[j][0] @ product)
            if term.symmetric:
                grown[j, r - count :, : r - count] = right[: r - count].T
                left_sketch.append(right_sketch[-1])
            else:
                product = part.T @ new[rows]
                grown[j, r - count :, : r - count] = product.T @ old[columns]
                left_sketch.append(self._embeddings[j][1] @ product)
        for j, shares in self.shares.items():
            for i, share in shares.items():
                grown[j, :, r - count :] += share * grown[i, :, r - count :]
                grown[j, r - count :, : r - count] += share * grown[i, r - count :, : r - count]
                right_sketch[j] = right_sketch[j] + share * right_sketch[i]
            left_sketch[j] = right_sketch[j]
        self.projected = grown
        self.right_sketch = np.concatenate([self.right_sketch, np.stack(right_sketch)], axis=2)
        self.left_sketch = np.concatenate([self.left_sketch, np.stack(left_sketch)], axis=2)


def _support(matrix: Sparse) -> tuple[IntArray, IntArray, Sparse]:
    """Rows and columns of a matrix that are not empty, and what is there; all of them where most are not."""
    csr = sp.csr_array(matrix)
    rows = np.flatnonzero(np.diff(csr.indptr))
    if 2 * len(rows) > csr.shape[0]:
        every = np.arange(csr.shape[0])
        return every, every, csr
    columns = np.unique(csr.indices)
    return rows, columns, sp.csr_array(csr[rows][:, columns])


def residual(
    problem: ParametricProblem, factors: Array, lam: Any, x: Any, *, left: bool = False
) -> Any:
    """Σ_j θ_j λ^k A_j x (n, k), or with A_jᵀ, for λ (k,) and x (n, k)."""
    total: Any = np.zeros(x.shape, dtype=complex)
    for term, factor, power in zip(problem.terms, factors, problem.powers, strict=True):
        if factor:
            total += factor * lam**power * times(term.matrix.T if left and not term.symmetric else term.matrix, x)
    return total


def real_and_imaginary(block: Any) -> Array:
    """Real and imaginary parts (n, 2k) side by side."""
    return np.hstack([block.real, block.imag])

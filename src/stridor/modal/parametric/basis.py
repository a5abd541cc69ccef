"""A basis of real vectors that grows, with every term of a parametric problem projected on it."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.linalg as sl
import scipy.sparse as sp

from ...typing import Array, IntArray, Sparse
from ..quadratic.problem import times
from .problem import ParametricProblem

START = 200
ORTHOGONAL = 1e-11  # of unit vectors


class Indefinite(Exception):
    """The metric is not positive definite."""


class Basis:
    """V (n, r), orthonormal in the symmetric positive definite ``metric`` (n, n), and VᵀA_jV (t, r, r) of all terms.

    embedding (s, n) applied to A_jV and A_jᵀV gives their sketches (t, s, r): residuals are known without being
    formed.
    """

    def __init__(self, problem: ParametricProblem, metric: Sparse, embedding: Sparse) -> None:
        self.problem, self.metric = problem, metric
        # Room for more columns than there are: growing by copies costs as much as multiplying.
        self._room = [np.zeros((problem.size, START), order="F") for _ in range(2)]
        self._count = 0
        self.projected = np.zeros((len(problem.terms), 0, 0))
        # Terms of few freedoms, as contact has them, are multiplied on those alone.
        self._parts: list[tuple[IntArray, IntArray, Sparse]] = [_support(t.matrix) for t in problem.terms]
        by_column = sp.csc_array(embedding)
        self._embeddings = [
            tuple(sp.csr_array(by_column[:, place]) for place in (rows, columns)) for rows, columns, _ in self._parts
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

    def add(self, block: Array, smallest: float) -> int:
        """Take in what ``block`` (n, k) adds but for directions that leave less than ``smallest`` of a unit vector;
        returns how many vectors that made. Raises Indefinite where the metric shows that it is."""
        image = self.metric @ block
        square = np.einsum("ij,ij->j", block, image)
        if np.any(square < 0):
            raise Indefinite
        length = np.sqrt(square)
        new, image = block[:, length > 0] / length[length > 0], image[:, length > 0] / length[length > 0]
        if not new.shape[1]:
            return 0
        new, image = self._without(new, image)
        gram = new.T @ image
        squares, turn = sl.eigh((gram + gram.T) / 2)
        if squares[0] < -1e-8 * max(squares[-1], smallest**2):
            raise Indefinite
        keep = squares > smallest**2
        if not keep.any():
            return 0
        turn = turn[:, keep] / np.sqrt(squares[keep])
        new, image = self._without(new @ turn, image @ turn)
        lower = sl.cholesky((new.T @ image + image.T @ new) / 2, lower=True)
        new = sl.solve_triangular(lower, new.T, lower=True).T
        self._take(new, sl.solve_triangular(lower, image.T, lower=True).T)
        return int(new.shape[1])

    def turn(self, by: Array) -> None:
        """Keep the combinations ``by`` (r, s), orthonormal columns, of the vectors only."""
        room = [np.zeros((self.problem.size, max(START, 2 * by.shape[1])), order="F") for _ in range(2)]
        for wide, old in zip(room, (self.vectors, self._image), strict=True):
            wide[:, : by.shape[1]] = old @ by
        self._room, self._count = room, by.shape[1]
        self.projected = np.einsum("ri,jrs,sk->jik", by, self.projected, by, optimize=True)
        self.right_sketch, self.left_sketch = self.right_sketch @ by, self.left_sketch @ by

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


def expanded(vectors: Array, z: Any) -> Any:
    """vectors @ z in real arithmetic."""
    return vectors @ np.ascontiguousarray(z.real) + 1j * (vectors @ np.ascontiguousarray(z.imag))


def real_and_imaginary(block: Any) -> Array:
    """Real and imaginary parts (n, 2k) side by side."""
    return np.hstack([block.real, block.imag])

"""P(λ) = λ²M + λD + K of sparse real matrices, its residuals and backward errors."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp

from ...notebook import Shown
from ...typing import Array, ComplexArray, IntArray, Sparse

CHUNK = 64  # columns worked on at a time
SINGLE = 1e-15, 1e15  # between these the largest entry of what is multiplied is for single precision to do


@dataclass(frozen=True, repr=False)
class Quadratic(Shown):
    """(λ²M + λD + K) x = 0 with real csr matrices (n, n), of which none needs symmetry or full rank. Dense
    arrays serve as well."""

    mass: Sparse
    damping: Sparse
    stiffness: Sparse

    @property
    def _line(self) -> str:
        entries = ", ".join(f"{name} {m.nnz}" for name, m in zip("MDK", self.matrices(), strict=True))
        return f"λ²M + λD + K of {self.size} unknowns, entries: {entries}"

    @property
    def size(self) -> int:
        """Number of freedoms n."""
        return int(self.mass.shape[0])

    def matrices(self) -> tuple[Sparse, Sparse, Sparse]:
        """M, D and K, csr."""
        return self.mass, self.damping, self.stiffness

    @cached_property
    def transposed(self) -> Quadratic:
        """The problem whose right vectors are the left ones of this."""
        return Quadratic(*(m.T if isinstance(m, np.ndarray) else sp.csr_array(m.T) for m in self.matrices()))

    @cached_property
    def _aligned(self) -> tuple[list[Any], IntArray, IntArray]:
        """Entries of M, D and K on the places of all three, and these places as a csr matrix has them: sums of sparse
        matrices look for them each time."""
        n, parts = self.size, [sp.csr_array(m) for m in self.matrices()]
        # The sum of the patterns has them all, in order; the entries of each are found in it by row and column.
        ones = [sp.csr_array((np.ones(part.nnz), part.indices, part.indptr), shape=part.shape) for part in parts]
        whole = sp.csr_array(ones[0] + ones[1] + ones[2])
        whole.sum_duplicates()
        places = _places(whole, n)
        entries: list[Any] = []
        for part in parts:
            part.sum_duplicates()
            entries.append(np.zeros(whole.nnz, dtype=np.result_type(part.data, float)))
            entries[-1][np.searchsorted(places, _places(part, n))] = part.data
        return entries, whole.indices, whole.indptr

    @cached_property
    def _sizes(self) -> tuple[Sparse, Sparse, Sparse]:
        return entry_sizes(self.mass), entry_sizes(self.damping), entry_sizes(self.stiffness)

    def at(self, lam: complex) -> Sparse:
        """P(λ), complex unless λ is real."""
        if isinstance(self.mass, np.ndarray):
            return lam**2 * self.mass + lam * self.damping + self.stiffness
        (mass, damping, stiffness), where, rows = self._aligned
        return sp.csr_array((lam**2 * mass + lam * damping + stiffness, where, rows), shape=self.mass.shape)

    def residual(self, lam: ComplexArray, x: ComplexArray) -> ComplexArray:
        """P(λ)x (n, k) of λ (k,) and x (n, k)."""
        return lam**2 * times(self.mass, x) + lam * times(self.damping, x) + times(self.stiffness, x)

    def applied(self, lam: complex, x: ComplexArray) -> ComplexArray:
        """P(λ)x (n,) of one vector (n,)."""
        found: ComplexArray = self.residual(np.array([lam]), x[:, None])[:, 0]
        return found

    def slope(self, lam: complex | ComplexArray, x: ComplexArray) -> ComplexArray:
        """P'(λ)x (n,), or (n, k) of λ (k,)."""
        found: ComplexArray = 2 * lam * times(self.mass, x) + times(self.damping, x)
        return found

    def backward_error(self, lam: ComplexArray, x: ComplexArray) -> Array:
        """‖P(λ)x‖∞ / ‖(|λ|²|M| + |λ||D| + |K|)|x|‖∞ (k,)."""
        result = np.zeros(len(lam))
        mass, damping, stiffness = self._sizes
        for start in range(0, len(lam), CHUNK):
            part = slice(start, start + CHUNK)
            size, rate = np.abs(x[:, part]), np.abs(lam[part])
            scale = rate**2 * measured(mass, size) + rate * measured(damping, size) + measured(stiffness, size)
            rest = np.abs(self.residual(lam[part], x[:, part])).max(axis=0)
            result[part] = rest / np.maximum(scale.max(axis=0), 1e-300)
        return result


def entry_sizes(matrix: Any) -> Any:
    """|A|, of a sparse one in single precision where its entries allow that: what a residual is measured against needs
    no more digits, and large matrices are gone through in half the time."""
    sizes = abs(matrix)
    if isinstance(matrix, np.ndarray) or not sizes.nnz:
        return sizes
    largest = float(sizes.data.max())
    return sizes.astype(np.float32) if SINGLE[0] < largest < SINGLE[1] else sizes


def measured(sizes: Any, block: Array) -> Array:
    """|A| (n, n) of `entry_sizes` times a block (n, k) of vectors' sizes."""
    if sizes.dtype == np.float32 and block.size:
        largest = block.max(axis=0)
        if SINGLE[0] < largest.min() and largest.max() < SINGLE[1]:
            return np.asarray(sizes @ block.astype(np.float32), dtype=float)
    return np.asarray(sizes @ block, dtype=float)


def _places(matrix: Sparse, n: int) -> IntArray:
    """Numbers (nnz,) of the entries of a csr matrix (n, n), row by row."""
    rows = np.repeat(np.arange(n, dtype=np.int64), np.diff(matrix.indptr))
    return rows * n + matrix.indices


def times(matrix: Sparse, block: Any) -> Any:
    """matrix @ block of a block (n,) or (n, k); where the matrix is real and the block complex, in real arithmetic."""
    if block.dtype.kind != "c":
        return matrix @ block
    if block.ndim > 1 and block.shape[1] > 1 and matrix.dtype.kind != "c":
        # A row of complex numbers, read as real, has their parts side by side: the matrix is read once for both.
        return (matrix @ np.ascontiguousarray(block).view(np.float64)).view(np.complex128)
    return matrix @ np.ascontiguousarray(block.real) + 1j * (matrix @ np.ascontiguousarray(block.imag))

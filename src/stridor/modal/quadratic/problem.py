"""P(λ) = λ²M + λD + K of sparse real matrices, its residuals and backward errors."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp

from ...typing import Array, ComplexArray, IntArray, Sparse

CHUNK = 64  # columns worked on at a time


@dataclass(frozen=True)
class Quadratic:
    """(λ²M + λD + K) x = 0 with real csr matrices (n, n), of which none needs symmetry or full rank."""

    mass: Sparse
    damping: Sparse
    stiffness: Sparse

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
        return Quadratic(*(sp.csr_array(m.T) for m in (self.mass, self.damping, self.stiffness)))

    @cached_property
    def _aligned(self) -> tuple[list[Any], IntArray, IntArray]:
        """Entries of M, D and K on the places of all three, and these places as a csr matrix has them: sums of sparse
        matrices look for them each time."""
        n, parts = self.size, [sp.coo_array(m) for m in self.matrices()]
        keys = [part.row.astype(np.int64) * n + part.col for part in parts]
        pattern = np.unique(np.concatenate(keys))
        index = np.int32 if len(pattern) < np.iinfo(np.int32).max else np.int64
        entries: list[Any] = []
        for key, part in zip(keys, parts, strict=True):
            entries.append(np.zeros(len(pattern), dtype=np.result_type(part.data, float)))
            np.add.at(entries[-1], np.searchsorted(pattern, key), part.data)
        rows = np.searchsorted(pattern, n * np.arange(n + 1, dtype=np.int64))
        return entries, (pattern % max(n, 1)).astype(index), rows.astype(index)

    @cached_property
    def _sizes(self) -> tuple[Sparse, Sparse, Sparse]:
        return abs(self.mass), abs(self.damping), abs(self.stiffness)

    def at(self, lam: complex) -> Sparse:
        """P(λ), complex unless λ is real."""
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
            scale = rate**2 * (mass @ size) + rate * (damping @ size) + stiffness @ size
            rest = np.abs(self.residual(lam[part], x[:, part])).max(axis=0)
            result[part] = rest / np.maximum(scale.max(axis=0), 1e-300)
        return result


def times(matrix: Sparse, block: Any) -> Any:
    """matrix @ block for a real sparse matrix and a real or complex block (n, k), in real arithmetic."""
    if block.dtype.kind != "c":
        return matrix @ block
    return matrix @ np.ascontiguousarray(block.real) + 1j * (matrix @ np.ascontiguousarray(block.imag))

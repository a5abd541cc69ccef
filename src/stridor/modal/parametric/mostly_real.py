"""Products with eigenvectors of a real problem, of which few are complex, at half the cost of complex arithmetic."""

from __future__ import annotations

import numpy as np

from ...typing import Array, ComplexArray, IntArray
from ..dense_problem import combined


class MostlyReal:
    """Vectors (n, k), the imaginary parts kept of those columns alone that have one."""

    def __init__(self, vectors: ComplexArray) -> None:
        self._real: Array = np.ascontiguousarray(vectors.real)
        self._at: IntArray = np.flatnonzero(np.any(vectors.imag, axis=0))
        self._imag: Array = np.ascontiguousarray(vectors.imag[:, self._at])

    def combined(self, weights: ComplexArray) -> ComplexArray:
        """vectors @ weights (k, l)."""
        total: ComplexArray = _product(self._real, weights)
        if len(self._at):
            total += 1j * _product(self._imag, weights[self._at])
        return total

    def weighed(self, others: ComplexArray) -> ComplexArray:
        """vectorsᵀ @ others (n, l)."""
        total: ComplexArray = _product(self._real.T, others)
        if len(self._at):
            total[self._at] += 1j * _product(self._imag.T, others)
        return total

    def images(self, matrix: Array) -> ComplexArray:
        """matrix (m, n) @ vectors."""
        total: ComplexArray = combined(matrix, self._real).astype(complex)
        if len(self._at):
            total[:, self._at] += 1j * (matrix @ self._imag)
        return total


def _product(basis: Array, weights: ComplexArray) -> ComplexArray:
    """A row of complex numbers, read as real, has their parts side by side."""
    parts: Array = basis @ np.ascontiguousarray(weights, dtype=complex).view(np.float64)
    return np.ascontiguousarray(parts).view(np.complex128)

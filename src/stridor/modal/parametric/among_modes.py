"""A quadratic problem in the coordinates of its undamped modes, in which mass and stiffness are numbers and damping
alone couples: what the modes far away answer to damped ones takes one product with a small matrix a step there."""

from __future__ import annotations

import numpy as np
import scipy.linalg as sl

from ...direct.dense import lu_factors
from ...typing import Array, ComplexArray, IntArray


class RealSpan:
    """Eigenvectors (r, n) of a real problem as real vectors of the same span: of each conjugate pair, whose columns lie
    side by side, the real and the imaginary part."""

    def __init__(self, vectors: Array, first: IntArray) -> None:
        self.vectors: Array = np.ascontiguousarray(vectors)
        self.turned: Array = np.ascontiguousarray(vectors.T)
        self._first = first

    @staticmethod
    def of(vectors: ComplexArray, first: IntArray) -> RealSpan:
        """Of eigenvectors (r, n), pairs beginning in these columns."""
        parts = vectors.real.copy()
        parts[:, first + 1] = vectors.imag[:, first]
        return RealSpan(parts, first)

    def coordinates(self, weights: ComplexArray) -> ComplexArray:
        """The weights (n, k) of eigenvectors as those of the real ones."""
        one, other = weights[self._first], weights[self._first + 1]
        made = weights.copy()
        made[self._first], made[self._first + 1] = one + other, 1j * (one - other)
        return made

    def weights(self, coordinates: ComplexArray, at: IntArray) -> ComplexArray:
        """The weights (n, k) of eigenvectors for those (m, k) of the real ones at these places, whole pairs of them."""
        made = np.zeros((self.vectors.shape[1], coordinates.shape[1]), dtype=complex)
        made[at] = coordinates
        one, other = made[self._first], 1j * made[self._first + 1]
        made[self._first], made[self._first + 1] = (one - other) / 2, (one + other) / 2
        return made

    def inner(self, others: ComplexArray) -> ComplexArray:
        """Eigenvectorsᵀ @ others (n, k)."""
        return self.weighed(product(self.turned, others))

    def weighed(self, products: ComplexArray) -> ComplexArray:
        """Of products (n, k) with the real vectors those with the eigenvectors, in place."""
        one, other = products[self._first], 1j * products[self._first + 1]
        products[self._first], products[self._first + 1] = one + other, one - other
        return products

    def combined(self, weights: ComplexArray) -> ComplexArray:
        """The eigenvectors @ weights (r, k)."""
        return product(self.vectors, self.coordinates(weights))


class AmongModes:
    """P(λ) between left and right undamped modes (r, n): weight (λ² − x) on the diagonal, ``weight`` (n,) that of the
    mass and x (n,) their λ², and λ times the damping between all of them."""

    def __init__(self, mass: Array, damping: Array, squares: ComplexArray, right: RealSpan, left: RealSpan) -> None:
        self.right, self.left, self.squares = right, left, squares
        first = np.flatnonzero(squares.imag > 0)
        self.of_mass: Array = mass @ self.right.vectors
        self.between: Array = self.left.turned @ (damping @ self.right.vectors)
        self._turned: Array = np.ascontiguousarray(self.between.T)
        weight = np.einsum("ij,ij->j", self.left.vectors, self.of_mass).astype(complex)
        if len(first):
            # (a + jb)ᵀM(c + jd) of a pair, whose parts lie side by side.
            a, b, c, d = (side[:, at] for side in (self.left.vectors, self.of_mass) for at in (first, first + 1))
            pair = np.einsum("ij,ij->j", a + 1j * b, c + 1j * d)
            weight[first], weight[first + 1] = pair, pair.conj()
        self.weight: ComplexArray = weight

    @staticmethod
    def of(mass: Array, damping: Array, stiffness: Array, frequency: float) -> AmongModes:
        """Between all the undamped modes, as `shift_inverted.undamped_pairs` finds them, whose eigenvectors LAPACK
        leaves as real ones. Raises ValueError and LinAlgError where the matrices are not finite or it gives up."""
        shift = frequency**2
        factor = lu_factors(stiffness + shift * mass)
        matrix = sl.lu_solve(factor, shift * mass)
        if not np.isfinite(matrix).all():
            raise ValueError("not finite")
        geev, size = sl.get_lapack_funcs(("geev", "geev_lwork"), (matrix,))
        work = int(size(len(matrix), compute_vl=1, compute_vr=1)[0].real)
        real, imag, left, right, info = geev(matrix, lwork=work, compute_vl=1, compute_vr=1, overwrite_a=1)
        if info:
            raise sl.LinAlgError("eigenvalues of a dense matrix do not converge")
        with np.errstate(all="ignore"):
            squares = shift - shift / (real + 1j * imag)
        there = np.isfinite(squares)
        squares, left, right = squares[there], left[:, there], right[:, there]
        first = np.flatnonzero(squares.imag > 0)
        left[:, first + 1] *= -1  # LAPACK's are conjugate
        left = sl.lu_solve(factor, left, trans=1, check_finite=False)
        size_of = np.linalg.norm(left, axis=0)
        size_of[first] = size_of[first + 1] = np.hypot(size_of[first], size_of[first + 1])
        return AmongModes(mass, damping, squares, RealSpan(right, first), RealSpan(left / size_of, first))

    def damped(self, a: ComplexArray) -> ComplexArray:
        """leftᵀ D right a (n, k)."""
        return self.left.weighed(product(self.between, self.right.coordinates(a)))

    def damped_left(self, b: ComplexArray) -> ComplexArray:
        """rightᵀ Dᵀ left b (n, k)."""
        return self.right.weighed(product(self._turned, self.left.coordinates(b)))


def product(matrix: Array, weights: ComplexArray) -> ComplexArray:
    """matrix @ weights (n, k): a row of complex numbers, read as real, has their parts side by side."""
    parts: Array = matrix @ np.ascontiguousarray(weights, dtype=complex).view(np.float64)
    return parts.view(np.complex128)

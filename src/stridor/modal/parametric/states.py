"""Modes of strongly damped problems among a few states: at a third of the cost of the whole companion matrix or less.

With v = (x, μ x) and μ = λ/ω, (λ²M + λD + K) x = 0 is

    A v = μ E v,   A = [K, 0; 0, −ω²M],   E = [−ωD, −ω²M; −ω²M, 0] ,

transposed as it stands. Modes of a band everywhere in a box, of which the overdamped are two of each motion, lie close
to far fewer states than a basis of motions has: R for the right ones, L for the left, and LᵀAR, LᵀER have their λ with
an error that is the product of both sides' (Petrov–Galerkin).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg as sl

from ...direct.dense import lu_factors
from ...typing import Array, ComplexArray
from ..shift_inverted import transposed_solve
from .dense import DenseModes


@dataclass(frozen=True)
class States:
    """Right and left states (2r, s), displacements over velocities divided by the frequency of the band."""

    right: Array
    left: Array

    @property
    def count(self) -> int:
        """Number of states s."""
        return int(self.right.shape[1])

    def modes(self, matrices: tuple[Array, Array, Array], frequency: float, reach: float) -> DenseModes | None:
        """Modes (λ²M + λD + K) z = 0 with |λ| ≤ reach · frequency [1/s] as far as the states have them, in the order of
        `dense_modes`; None where the small matrices are singular or not finite."""
        mass, damping, stiffness = matrices
        r = len(mass)
        (up, low), (left_up, left_low) = (np.split(part, 2) for part in (self.right, self.left))
        of_up, of_low = (frequency**2 * (mass @ part) for part in (up, low))
        a = left_up.T @ (stiffness @ up) - left_low.T @ of_low
        e = -left_up.T @ (frequency * (damping @ up) + of_low) - left_low.T @ of_up
        # Inverted at λ = frequency, as the whole companion matrix is.
        with np.errstate(all="ignore"):
            try:
                factor = lu_factors(a - e)
                theta, left, right = sl.eig(sl.lu_solve(factor, e), left=True, right=True)
            except (ValueError, sl.LinAlgError):
                return None
            values = frequency * (1 + 1 / theta)
        chosen = np.flatnonzero(np.isfinite(values) & (np.abs(values) <= reach * frequency) & (values.imag >= 0))
        chosen = chosen[np.lexsort((values[chosen].real, values[chosen].imag))]
        back = transposed_solve(factor, left[:, chosen].conj())
        x, y = _motion(self.right @ right[:, chosen], r), _motion(self.left @ back, r)
        return DenseModes(values[chosen], x, y)


@dataclass(frozen=True)
class StateDirections:
    """Right and left states of modes (2r, k), and the singular values (k,) of how they see each other, the largest
    first."""

    right: Array
    left: Array
    size: Array

    def but(self, share: float) -> States:
        """Those that are larger than ``share`` of the largest."""
        keep = self.size > share * self.size[0]
        return States(self.right[:, keep], self.left[:, keep])


def spanned(found: Sequence[DenseModes], matrices: tuple[Array, Array, Array], frequency: float) -> StateDirections:
    """The directions of the states of modes at several points, all on one basis: right and left ones that see each
    other in A − E of the matrices, so that what is left out on one side is on the other, and LᵀAR has no modes of its
    own."""
    right, left = (
        np.hstack([_states(m.values / frequency, getattr(m, side)) for m in found]) for side in ("right", "left")
    )
    mass, damping, stiffness = matrices
    (up, low), moving = np.split(right, 2), frequency**2 * mass
    seen = np.vstack([stiffness @ up + frequency * (damping @ up) + moving @ low, moving @ (up - low)])
    # Many modes have no more directions than there are states: R Lᵀ of two triangles has the singular values of all.
    turns, triangles = zip(*(_triangular(part) for part in (left, seen)), strict=True)
    one, size, other = sl.svd(triangles[0] @ triangles[1].T, full_matrices=False)
    at = size > 0.0
    scale = 1.0 / np.sqrt(size[at])
    return StateDirections(
        right @ (turns[1] @ (other[at].T * scale)), left @ (turns[0] @ (one[:, at] * scale)), size[at]
    )


def _triangular(states: Array) -> tuple[Array, Array]:
    """Q and R of the transposed (k, 2r): Q R = statesᵀ."""
    q, r = sl.qr(states.T, mode="economic")
    return q, r


def _states(mu: ComplexArray, vectors: ComplexArray) -> Array:
    """Real states (2r, k or more) of unit length that span those of modes: of real λ one, of others two."""
    # Of real λ the vector is real but for a factor.
    largest = vectors[np.argmax(np.abs(vectors), axis=0), np.arange(len(mu))]
    vectors = vectors * (np.abs(largest) / largest)
    states = np.vstack([vectors, mu * vectors])
    states = states / np.linalg.norm(states, axis=0)
    return np.hstack([states.real, states.imag[:, mu.imag > 0]])


def _motion(states: ComplexArray, r: int) -> ComplexArray:
    """The displacements (r, k) of states, of unit length."""
    x = states[:r]
    return x / np.linalg.norm(x, axis=0)

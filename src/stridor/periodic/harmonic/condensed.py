"""A structure as its contacts feel it: receptances H(s) = G (s² + s C + Ω²)⁻¹ Gᵀ of its modes.

The modes are those with springs κ along the normals of all contacts, so that bodies that only contact holds have a
static answer; what these springs take is given back with the contact forces (`balance`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as sl
import scipy.sparse as sp
import scipy.sparse.linalg as spl

from ...direct import SingularMatrix, factorise
from ...errors import AnalysisError
from ...system import System
from ...typing import Array, ComplexArray, Sparse

COMPLETE = 150  # freedoms up to which all modes are taken
MODES = 200  # most of a larger system
SAME = 1e-10  # of the largest: vectors that add nothing
PROPORTIONAL = 1e-9


@dataclass(frozen=True)
class Condensed:
    """k coordinates of unit mass: vectors (n, k), squares Ω² (k,) and damping C (k, k) with the springs κ, rows G (r,
    k), load (k,) of what is constant. complete: whether it is the whole system; proportional: whether C is diagonal."""

    vectors: Array
    squares: Array
    damping: Array
    rows: Array
    load: Array
    complete: bool
    proportional: bool

    @property
    def size(self) -> int:
        """How many coordinates k."""
        return len(self.squares)

    @property
    def still(self) -> Array:
        """What the constant loads do (r,), without contact forces."""
        return self.rows @ (self.load / self.squares)

    def __call__(self, s: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        """H and dH/ds (f, r, r) at s (f,)."""
        if self.proportional:
            own = np.diag(self.damping)
            inverse = 1.0 / (s[:, None] ** 2 + s[:, None] * own + self.squares)
            value = (self.rows * inverse[:, None, :]) @ self.rows.T
            slope = -(self.rows * (inverse**2 * (2.0 * s[:, None] + own))[:, None, :]) @ self.rows.T
            return value, slope
        answers = self.answers(s)
        rates = 2.0 * s[:, None, None] * answers + self.damping @ answers
        return self.rows @ answers, -answers.transpose(0, 2, 1) @ rates

    def driven(self, s: complex, force: ComplexArray) -> ComplexArray:
        """Coordinates (k,) that a force (k,) on them moves at s."""
        dynamic = s * self.damping.astype(complex)
        dynamic[np.diag_indices(self.size)] += s**2 + self.squares
        return np.linalg.solve(dynamic, force)

    def answers(self, s: ComplexArray) -> ComplexArray:
        """Coordinates (f, k, r) that unit forces along the rows move."""
        if self.proportional:
            own = np.diag(self.damping)
            return self.rows.T / (s[:, None] ** 2 + s[:, None] * own + self.squares)[:, :, None]
        dynamic = s[:, None, None] * self.damping.astype(complex)
        index = np.arange(self.size)
        dynamic[:, index, index] += s[:, None] ** 2 + self.squares
        return np.linalg.solve(dynamic, np.broadcast_to(self.rows.T.astype(complex), (len(s), *self.rows.T.shape)))


def condensed(system: System, rows: Sparse, springs: Sparse, force: Array, highest: float) -> Condensed:
    """The structure with springs (n, n) beside its own stiffness at rows (r, n), loaded by force (n,).

    All modes of a small one; of a larger one those up to ``highest`` [rad/s] (MODES at most), and the static answers to
    every row and to the load, so that the static receptance is that of the whole. Raises AnalysisError for a mass
    matrix that is not positive definite, and for a structure that can move though all contacts are closed.
    """
    stiffness = sp.csr_array(system.stiffness + springs)
    if system.size <= COMPLETE:
        vectors, complete = np.eye(system.size), True
    else:
        vectors, complete = _lowest(system, stiffness, rows, force, highest), False
    mass = vectors.T @ (system.mass @ vectors)
    try:
        squares, turn = sl.eigh(vectors.T @ (stiffness @ vectors), mass)
    except sl.LinAlgError as error:
        raise AnalysisError("the mass matrix is not positive definite: a freedom has stiffness but no mass") from error
    if squares.min(initial=np.inf) <= 1e-14 * squares.max(initial=0.0):
        raise AnalysisError("the structure can move though all contacts are closed: there is no static equilibrium")
    vectors = vectors @ turn
    damping = vectors.T @ (system.damping @ vectors)
    own = np.diag(damping)
    proportional = np.abs(damping - np.diag(own)).max(initial=0.0) <= PROPORTIONAL * np.abs(own).max(initial=0.0)
    return Condensed(vectors, squares, damping, np.asarray(rows @ vectors), vectors.T @ force, complete, proportional)


def _lowest(system: System, stiffness: Sparse, rows: Sparse, force: Array, highest: float) -> Array:
    """Vectors (n, k) of unit mass that span the lowest modes and the static answers."""
    n = system.size
    try:
        factor = factorise(stiffness, symmetric=True)
    except SingularMatrix as error:
        raise AnalysisError(
            "the structure can move though all contacts are closed: there is no static equilibrium"
        ) from error
    static = factor.solve(np.column_stack([rows.toarray().T, force]))
    inverse = spl.LinearOperator((n, n), matvec=factor.solve, dtype=float)  # type: ignore[arg-type]
    begin = np.random.default_rng(0).normal(size=n)
    count = 40
    while True:
        count = min(count, n - 2, MODES)
        squares, shapes = spl.eigsh(stiffness, k=count, M=system.mass, sigma=0.0, OPinv=inverse, v0=begin)
        if squares.max() > highest**2 or count in (n - 2, MODES):
            break
        count *= 2
    vectors = np.column_stack([shapes, static])
    for _ in range(2):
        vectors = vectors / np.sqrt(np.maximum(np.einsum("ij,ij->j", vectors, system.mass @ vectors), 1e-300))
        sizes, turn = sl.eigh(vectors.T @ (system.mass @ vectors))
        kept = sizes > SAME * sizes.max()
        vectors = vectors @ (turn[:, kept] / np.sqrt(sizes[kept]))
    return vectors

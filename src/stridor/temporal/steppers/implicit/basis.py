"""Coordinates of the implicit stepper: all modes of the structure without its contacts, or those up to a frequency and
the static answers to what contacts and loads push at."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
import scipy.linalg as sl
import scipy.sparse as sp

from ....direct import Factor, SingularMatrix, factorise
from ....direct.lowest import modes_below
from ....system import System
from ....typing import Array, Sparse
from ..exact.basis import Basis, complete_basis

COMPLETE = 1000  # freedoms up to which all modes are taken
SHIFT = 1e-3  # of the highest frequency: what keeps a body regular that nothing holds
DEPENDENT = 1e-10  # of a unit vector, squared: what a static answer must add to the others to count
MOST_MODES = 1500
TOLERANCE = 1e-7  # of the squares of their frequencies
FEW_MORE = 4


@dataclass(frozen=True)
class Coordinates:
    """basis of unit mass; modes: how many of its vectors are modes, 0 where it is complete; up to highest_hz."""

    basis: Basis
    modes: int
    highest_hz: float

    @property
    def words(self) -> str:
        """What it is made of."""
        if not self.modes:
            return f"all {self.basis.size} modes of the structure"
        statics = self.basis.size - self.modes
        return f"{self.modes} modes up to {self.highest_hz:.6g} Hz and {statics} static answers at contacts and loads"


def coordinates(system: System, pushed: Sparse, highest_hz: float | None) -> Coordinates:
    """All modes of a small system, or where no frequency is given; else those up to ``highest_hz`` and the static
    answers to the forces ``pushed`` (n, k). Raises AnalysisError where the mass is not positive definite."""
    if system.size <= COMPLETE or highest_hz is None:
        return Coordinates(complete_basis(system), 0, np.inf)
    omega = 2 * np.pi * highest_hz
    mass, stiffness = sp.csr_array(system.mass), sp.csr_array(system.stiffness)
    factor, shift = _held(stiffness, mass, omega)
    with factor:
        # What Ritz's method makes of them is as good as their error squared.
        modes = modes_below(
            stiffness, mass, partial(factor.solve, refine=False), shift, omega, MOST_MODES,
            expected=_how_many(stiffness, mass, omega), tolerance=TOLERANCE,
        )  # fmt: skip
        static = factor.solve(pushed.toarray(), refine=False)
    modes = modes / np.sqrt(np.einsum("ij,ij->j", modes, mass @ modes))
    for _ in range(2):
        static -= modes @ ((mass @ modes).T @ static)
    static = _independent(static, mass)  # of unit mass, and orthogonal to the modes
    vectors = np.hstack([modes, static])
    squares, turn = sl.eigh(vectors.T @ (stiffness @ vectors))
    vectors = vectors @ turn
    rounding = 1e-12 * float(squares.max(initial=0.0))
    squares = np.where(np.abs(squares) < min(rounding, 1e-8 * omega**2), 0.0, squares)
    return Coordinates(Basis(vectors, squares, vectors.T @ (system.damping @ vectors)), modes.shape[1], highest_hz)


def _how_many(stiffness: Sparse, mass: Sparse, omega: float) -> int:
    """Modes up to a frequency [1/s] by the pivots of K − ω²M, and a few more; a guess where pivots are not told."""
    try:
        with factorise(sp.csr_array(stiffness - omega**2 * mass), symmetric=True) as factor:
            return 40 if factor.inertia is None else factor.inertia + FEW_MORE
    except SingularMatrix:
        return 40


def _held(stiffness: Sparse, mass: Sparse, omega: float) -> tuple[Factor, float]:
    """Factors of K, or of K + σM where nothing holds the structure, and σ [rad²/s²]."""
    try:
        return factorise(stiffness, symmetric=True), 0.0
    except SingularMatrix:
        shift = (SHIFT * omega) ** 2
        return factorise(sp.csr_array(stiffness + shift * mass), symmetric=True), shift


def _independent(static: Array, mass: Sparse) -> Array:
    """Vectors of unit mass that span what the columns (n, k) do."""
    for _ in range(2):
        length = np.sqrt(np.einsum("ij,ij->j", static, mass @ static))
        static = static[:, length > 0.0] / length[length > 0.0]
        squares, turn = sl.eigh(static.T @ (mass @ static))
        keep = squares > DEPENDENT
        static = static @ (turn[:, keep] / np.sqrt(squares[keep]))
    return static

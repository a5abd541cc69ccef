"""Coordinates of steppers: modes of the structure without contacts, of unit mass."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as sl

from ...errors import AnalysisError
from ...system import System
from ...typing import Array


@dataclass(frozen=True)
class Basis:
    """u = vectors q: vectors (n, k) of unit mass, stiffness (k,) ω² [rad²/s²], damping (k, k) [1/s]."""

    vectors: Array
    stiffness: Array
    damping: Array

    @property
    def size(self) -> int:
        """How many coordinates."""
        return self.vectors.shape[1]


def complete_basis(system: System) -> Basis:
    """All undamped modes of each component, whatever its damping. Raises AnalysisError for a mass matrix that is not
    positive definite."""
    n = system.size
    vectors, stiffness = np.zeros((n, n)), np.zeros(n)
    mass, rigid = system.mass.tocsr(), system.stiffness.tocsr()
    at = 0
    for part in system.components:
        m, k = (a[part][:, part].toarray() for a in (mass, rigid))
        try:
            _, shapes = sl.eigh(k, m)
        except sl.LinAlgError as error:
            raise AnalysisError(
                "the mass matrix is not positive definite: a freedom has stiffness but no mass"
            ) from error
        shapes = shapes / np.sqrt(np.einsum("ij,ij->j", shapes, m @ shapes))
        # Rayleigh quotients: the solver's error is relative to the largest eigenvalue.
        squares = np.einsum("ij,ij->j", shapes, k @ shapes)
        rounding = np.einsum("ij,ij->j", np.abs(shapes), np.abs(k) @ np.abs(shapes))
        squares[np.abs(squares) < 100 * np.finfo(float).eps * rounding] = 0.0
        here = slice(at, at + len(part))
        vectors[part, here], stiffness[here] = shapes, squares
        at += len(part)
    return Basis(vectors, stiffness, vectors.T @ (system.damping @ vectors))

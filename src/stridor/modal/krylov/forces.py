"""The few directions that forces on the freedoms of a problem have."""

from __future__ import annotations

import numpy as np
import scipy.linalg as sl

from ...typing import Array
from .problem import ContactProblem

WIDEST = 64  # right sides of one enrichment
WEAKEST = 1e-3  # of the strongest direction: residuals below it wait for the next sweep


def principal(problem: ContactProblem, forces: Array) -> Array:
    """The few directions (n, l) that the forces (n, k) mostly have, weighted by their compliance in the lumped mass."""
    if not forces.shape[1]:
        return forces
    scaled = forces / np.sqrt(lumped(problem))[:, None]
    gram = scaled.T @ scaled
    squares, vectors = sl.eigh(gram)
    keep = np.flatnonzero(squares > WEAKEST**2 * squares[-1])[-WIDEST:]
    return forces @ (vectors[:, keep] / np.sqrt(squares[keep]))


def lumped(problem: ContactProblem) -> Array:
    """Diagonal masses (n,), massless freedoms given a little."""
    diagonal = problem.mass.diagonal()
    return np.maximum(diagonal, 1e-6 * float(diagonal.mean()) + 1e-300)

"""The whole problem of touching contacts as one quadratic problem."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from ...typing import Sparse
from ..quadratic.problem import Quadratic
from .problem import ContactProblem


def quadratic_of(problem: ContactProblem, mu: float, *, rigid: bool = True) -> Quadratic:
    """λ²M + λD + K with the contacts at μ; of rigid ones the normal forces are unknowns after the displacements, unless
    they are left out."""
    extras = problem.at(mu)
    damping, stiffness = problem.damping, problem.stiffness
    if extras.damping is not None:
        damping = damping + extras.damping
    if extras.stiffness is not None:
        stiffness = stiffness + extras.stiffness
    if extras.weakening is not None:
        damping = damping + problem.slide.T @ sp.diags_array(extras.weakening) @ problem.slide
    push = sp.csr_array(problem.normal + mu * problem.slide)
    soft = problem.compliance > 0
    if soft.any():
        springs = sp.diags_array(1.0 / problem.compliance[soft])
        stiffness = stiffness + push[soft].T @ springs @ problem.normal[soft]
    if soft.all() or not rigid:
        return Quadratic(problem.mass, sp.csr_array(damping), sp.csr_array(stiffness))
    # Forces in units of the stiffness, so that the bordered matrix is well balanced.
    unit = float(np.abs(problem.stiffness.data).max(initial=0.0)) or 1.0
    forces = int(np.count_nonzero(~soft))
    bordered = sp.block_array([[stiffness, -unit * push[~soft].T], [unit * problem.normal[~soft], None]], format="csr")
    empty = sp.csr_array((forces, forces))

    def widened(matrix: Sparse) -> Sparse:
        return sp.csr_array(sp.block_diag([matrix, empty], format="csr"))

    return Quadratic(widened(problem.mass), widened(damping), sp.csr_array(bordered))

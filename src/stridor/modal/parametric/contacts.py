"""A system with contact springs as a parametric problem in friction and contact stiffness.

With p = −κ c⁻¹ N u the contact forces are eliminated:

    λ²M + λC + K + κ Nᵀc⁻¹N + μκ Sᵀc⁻¹N ,

N, S the rows of the gaps and of the slip, c the compliances of the case and κ a factor of all contact stiffnesses. The
nodes in contact and the directions of slip are those of steady sliding at one friction coefficient.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import scipy.sparse as sp

from ...errors import CaseError
from ...system import System
from ..assembled.problem import problem_of
from ..assembled.steady import Options
from .problem import Parameter, ParametricProblem, Term, constant

FRICTION, STIFFNESS = "mu", "contact_stiffness"


def _stiffness(values: Mapping[str, float]) -> float:
    return values[STIFFNESS]


def _friction(values: Mapping[str, float]) -> float:
    return values[FRICTION] * values[STIFFNESS]


def contact_parameters(
    system: System,
    friction: tuple[float, float],
    stiffness: tuple[float, float] = (0.5, 2.0),
    *,
    touching_at: float | None = None,
) -> ParametricProblem:
    """The problem over ranges of μ and of the factor κ of all contact stiffnesses; its own values are the middle of
    the range of μ and κ = 1.

    touching_at: μ of the steady sliding that says which nodes touch (None: the laws' own). Raises CaseError for rigid
    contact, which has no stiffness to vary, and for ranges that are none; AnalysisError where there is no steady
    sliding.
    """
    mu = Parameter(FRICTION, *(float(v) for v in friction), value=float(np.mean(friction)))
    low, high = (float(v) for v in stiffness)
    if not low > 0:
        raise CaseError(f"box.{STIFFNESS}", stiffness, "factors of the contact stiffness are > 0")
    factor = Parameter(STIFFNESS, low, high, value=1.0 if low <= 1.0 <= high else float(np.sqrt(low * high)))
    problem = problem_of(system, touching_at, Options(), damped=True)
    if problem.nodes and not np.all(problem.compliance > 0):
        raise CaseError("contacts", None, "rigid contact has no stiffness to vary; give every contact a stiffness")
    rows = sp.csr_array(sp.diags_array(1.0 / problem.compliance) @ problem.normal)
    terms = [
        Term(problem.mass, "mass", constant, symmetric=True),
        Term(problem.damping, "damping", constant, symmetric=True),
        Term(problem.stiffness, "stiffness", constant, symmetric=True),
        Term(sp.csr_array(problem.normal.T @ rows), "stiffness", _stiffness, symmetric=True),
        Term(sp.csr_array(problem.slide.T @ rows), "stiffness", _friction),
    ]
    return ParametricProblem(tuple(t for t in terms if t.matrix.nnz), (mu, factor))

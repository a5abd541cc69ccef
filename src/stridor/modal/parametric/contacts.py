"""A system with contact springs as a parametric problem in friction and contact stiffness.

With p = −κ c⁻¹ N u the contact forces are eliminated:

    λ²M + λC + K + κ Nᵀc⁻¹N + μκ Sᵀc⁻¹N ,

N, S the rows of the gaps and of the slip, c the compliances of the case and κ a factor of all contact stiffnesses. The
nodes in contact and the directions of slip are those of steady sliding at one friction coefficient.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from ...errors import CaseError
from ...system import System
from ..assembled.problem import problem_of
from ..assembled.steady import Options
from .factors import CONSTANT, Product
from .problem import Parameter, ParametricProblem, Term

FRICTION, STIFFNESS = "mu", "contact_stiffness"


def contact_terms(
    system: System, *, mu: float | None, touching_at: float | None = None, options: Options | None = None
) -> tuple[Term, ...]:
    """Stiffness terms of the contacts with factors of "mu" and "contact_stiffness" where these are among the
    parameters, else of ``mu`` (None: the laws' own, at which the touching nodes are found too) and 1.

    touching_at: μ of the steady sliding that says which nodes touch. Raises CaseError for rigid contact, AnalysisError
    where there is no steady sliding.
    """
    problem = problem_of(system, touching_at, options or Options(), damped=True)
    if not problem.nodes:
        return ()
    if not np.all(problem.compliance > 0):
        raise CaseError("contacts", None, "rigid contact has no stiffness to vary; give every contact a stiffness")
    if problem.extras is not None:
        raise CaseError(
            "modal",
            None,
            "friction damping, prestress and friction laws with a slope are not part of reduced models yet; switch "
            "friction_damping and prestress off and take Coulomb friction",
        )
    own = _own(system) if mu is None else mu
    stiffness = Product(((STIFFNESS, 1.0),))
    friction = Product(((FRICTION, own), (STIFFNESS, 1.0)))
    rows = sp.csr_array(sp.diags_array(1.0 / problem.compliance) @ problem.normal)
    return (
        Term(sp.csr_array(problem.normal.T @ rows), "stiffness", stiffness, symmetric=True),
        Term(sp.csr_array(problem.slide.T @ rows), "stiffness", friction),
    )


def _own(system: System) -> float:
    """The friction coefficient of the case's laws. Raises CaseError where they differ."""
    nodes = system.contact_nodes()
    found = {round(float(law.sliding(1.0)), 15) for law in nodes.laws}
    if len(found) > 1:
        raise CaseError("mu", None, "the contacts have different friction coefficients; give one for all")
    return found.pop() if found else 0.0


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
    mu, factor = friction_range(friction), stiffness_range(stiffness)
    terms = [
        Term(system.mass, "mass", CONSTANT, symmetric=True),
        Term(system.damping, "damping", CONSTANT, symmetric=True),
        Term(system.stiffness, "stiffness", CONSTANT, symmetric=True),
        *contact_terms(system, mu=None, touching_at=touching_at),
    ]
    return ParametricProblem(tuple(t for t in terms if t.matrix.nnz), (mu, factor))


def friction_range(between: tuple[float, float]) -> Parameter:
    """μ as a parameter. Raises CaseError for negative ones."""
    low, high = (float(v) for v in between)
    if not low >= 0:
        raise CaseError(f"box.{FRICTION}", between, "friction coefficients are ≥ 0")
    return Parameter(FRICTION, low, high, value=(low + high) / 2)


def stiffness_range(between: tuple[float, float]) -> Parameter:
    """The factor of all contact stiffnesses as a parameter. Raises CaseError where it is not positive."""
    low, high = (float(v) for v in between)
    if not low > 0:
        raise CaseError(f"box.{STIFFNESS}", between, "factors of the contact stiffness are > 0")
    return Parameter(STIFFNESS, low, high, value=1.0 if low <= 1.0 <= high else float(np.sqrt(low * high)))

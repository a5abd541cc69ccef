"""The eigenvalue problem itself, for whoever wants to solve it by other means."""

from __future__ import annotations

from ..asking import SWITCH_OR_NONE, takes
from ..modal.full.family import family_of
from ..modal.quadratic import Quadratic
from .asked import require_friction
from .workspace import Problem, Workspace


@takes(damped=SWITCH_OR_NONE)
def pencil(problem: Problem, mu: float | None = None, *, damped: bool | None = None) -> Quadratic:
    """λ²M + λD(μ) + K(μ) of small motions about steady sliding at ``mu``, contact springs, friction and what the steady
    state adds included: what every reported eigenpair is judged by.

    `.matrices()` gives M, D and K (n, n) as SciPy arrays, `.backward_error(λ, x)` judges other pairs. Of rigid contacts
    that touch the normal forces are unknowns behind the displacements: rows without mass, with infinite eigenvalues.
    mu: None takes the problem's own coefficient; it scales every contact's law. damped: with all of D (None: as [modal]
    says), else with its gyroscopic part alone. Raises CaseError for a μ that is none and for none where contacts have
    different coefficients, AnalysisError where there is no steady sliding.
    """
    require_friction(mu, several=False)
    work = Workspace.of(problem)
    mu = work.one_friction() if mu is None else mu
    damped = work.modal.damped if damped is None else damped
    return family_of(work.system, (mu, mu), work.options, damped=damped, own=mu, touching_at=mu).built(mu)

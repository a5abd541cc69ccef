"""The eigenvalue problem itself, for whoever wants to solve it by other means."""

from __future__ import annotations

from ..case import Case
from ..case.matrix_checks import MU
from ..errors import CaseError
from ..modal.general.family import family_of
from ..modal.options import Options
from ..modal.quadratic import Quadratic
from ..system import System, build_system
from .analyses import own_friction
from .asked import require_friction
from .options import options_of


def pencil(model: Case | System, mu: float | None = None, *, damped: bool | None = None) -> Quadratic:
    """λ²M + λD(μ) + K(μ) of small motions about steady sliding at ``mu``, contact springs, friction and what the steady
    state adds included: what every reported eigenpair is judged by.

    `.matrices()` gives M, D and K (n, n) as SciPy arrays, `.backward_error(λ, x)` judges other pairs. Of rigid contacts
    that touch the normal forces are unknowns behind the displacements: rows without mass, with infinite eigenvalues.
    mu: None takes the case's own coefficient; it scales every contact's law. damped: with all of D (None: as the
    case says, a system is damped), else with its gyroscopic part alone. Raises CaseError for a μ that is none,
    AnalysisError where there is no steady sliding.
    """
    require_friction(mu)
    options = options_of(model) if isinstance(model, Case) else Options()
    if mu is None:
        mu = own_friction(model) if isinstance(model, Case) else None
    if mu is None:
        raise CaseError("mu", None, "missing – give the friction coefficient of all contacts")
    if damped is None:
        damped = not isinstance(model, Case) or model.modal.damped
    varies = isinstance(model, Case) and MU in model.factor_names
    fixed = build_system(model) if isinstance(model, Case) and not varies else model

    def system_at(mu: float) -> System:
        return build_system(fixed, mu) if isinstance(fixed, Case) else fixed

    return family_of(system_at, (mu, mu), options, damped=damped, own=mu, touching_at=mu).built(mu)


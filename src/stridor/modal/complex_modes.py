"""Complex modes of the friction-coupled system at one or many μ, as followed branches."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from ..errors import CaseError
from ..sliding import unstressed
from ..system import System
from ..threads import one_thread
from ..typing import Array
from .krylov import Carried
from .options import Options
from .painleve import refuse_undetermined
from .results import UNSTABLE_RELATIVE, ComplexModes, Progress, grows
from .source import ModesAsked, answered

__all__ = ["UNSTABLE_RELATIVE", "ComplexModes", "Progress", "complex_modes", "grows"]


@one_thread
def complex_modes(
    system: System,
    mu: float | Sequence[float] | Array,
    *,
    count: int = 20,
    max_frequency_hz: float | None = None,
    damped: bool = True,
    vectors: bool | Literal["right"] = False,
    residuals: bool = True,
    friction_damping: bool = False,
    prestress: bool = False,
    solver: str | None = None,
    source: str | None = None,
    progress: Progress | None = None,
    numbered_at: float = 0.0,
    carried: Carried | None = None,
) -> ComplexModes:
    """Modes at the friction coefficients ``mu``, branches followed from μ = 0.

    count: how many branches, lowest frequencies at μ = 0 first; max_frequency_hz instead takes all that start below it,
    and those that start a little above and come below it at one of these μ. vectors keeps left and right ones, "right"
    those alone where that saves time. residuals=False leaves backward errors out where they cost something
    (`ComplexModes.residual`). source: where eigenpairs come from, "receptance" (point contacts on a complete
    basis), "krylov" (sparse matrices that stand without friction), "reduced" (a model over μ, its modes solved in full)
    or "full" (any matrices); None takes what suits the system, and the next where that turns out not to.
    friction_damping (across the direction of sliding), prestress and the direct solver matter on sparse matrices only.
    numbered_at: a μ up to the least of them, from which "krylov" follows instead where numbers do not matter.
    carried: what a stretch of μ hands on to the next.
    progress is called with the number of μ done and of all; on
    KeyboardInterrupt what is done is returned, ``planned`` tells of how many. Raises AnalysisError where contacts do
    not slide, have no equilibrium, branches cannot be told apart, or the source named does not take the system;
    CaseError for a source that there is none of and for more numbers than memory holds.
    """
    values = np.atleast_1d(np.asarray(mu, dtype=float))
    if values.ndim != 1 or not len(values) or not np.all(np.isfinite(values)) or np.any(values < 0):
        raise CaseError("mu", mu, "friction coefficients are numbers ≥ 0, at least one")
    options = Options(friction_damping, prestress and not unstressed(system), solver, source)
    highest = float(values.max())
    refuse_undetermined(system, highest, options, touching_at=highest if len(values) == 1 else None)
    asked = ModesAsked(
        max_frequency_hz, damped=damped, options=options, count=count, vectors=vectors, residuals=residuals,
        progress=progress, numbered_at=numbered_at, carried=carried,
    )  # fmt: skip
    return answered(system, asked, lambda source, a: source.modes(system, values, a), without_following=True)

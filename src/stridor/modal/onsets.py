"""Onsets of instability: the μ at which an eigenvalue reaches the imaginary axis."""

from __future__ import annotations

import numpy as np

from ..errors import CaseError
from ..sliding import unstressed
from ..system import System
from ..threads import one_thread
from .krylov import Carried
from .onset import Onset, Onsets
from .options import Options
from .painleve import refuse_undetermined
from .source import ModesAsked, answered

__all__ = ["Onset", "Onsets", "onsets"]

FOLLOW = 1.1  # times the band: from where branches are followed


@one_thread
def onsets(
    system: System,
    friction_range: tuple[float, float] = (0.0, 1.0),
    *,
    max_frequency_hz: float = 40e3,
    damped: bool = True,
    friction_damping: bool = False,
    prestress: bool = False,
    solver: str | None = None,
    source: str | None = None,
    follow: float = FOLLOW,
    numbered_at: float = 0.0,
    carried: Carried | None = None,
) -> Onsets:
    """Every critical μ in ``friction_range`` with a frequency up to ``max_frequency_hz``.

    Those above the band are among them where the mode that begins to grow there comes into it. follow: branches are
    followed that start up to so many times the band. numbered_at: the μ from which on branches may be followed, 0
    where their numbers are to be those of the frictionless modes; carried: what stretches of μ hand on.
    friction_damping, prestress, solver and source as in `complex_modes`. Nothing is sought anew here:
    `growing.checked_onsets` does that. Raises CaseError for an empty range or a source that there is none of,
    AnalysisError where branches cannot be followed.
    """
    low, high = (float(v) for v in friction_range)
    if not (0 <= low < high and np.isfinite(high)):
        raise CaseError("friction_range", friction_range, "two numbers 0 ≤ a < b")
    if not (np.isfinite(max_frequency_hz) and max_frequency_hz > 0):
        raise CaseError("max_frequency_hz", max_frequency_hz, "a positive frequency in Hz")
    options = Options(friction_damping, prestress and not unstressed(system), solver, source)
    refuse_undetermined(system, high, options)
    asked = ModesAsked(
        max_frequency_hz, damped=damped, options=options, follow=follow, numbered_at=numbered_at, carried=carried
    )
    return answered(system, asked, lambda source, a: source.onsets(system, (low, high), a), without_following=False)

"""Onsets of systems with matrices of any structure, solved, with what speaks for there being no others."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ...errors import AnalysisError, CaseError
from ...system import System
from ...threads import one_thread
from ..at_rest import moving
from ..onset import Onsets
from ..options import Options
from ..painleve import refuse_undetermined
from ..quadratic import RegionModes
from ..quadratic.reach import searched
from .basis import Along, Projected, along, whole_or_raise
from .branches import ends_of, whole_ends
from .family import family_of
from .follow import BEYOND
from .growth import unstable
from .search import SMALL, search
from .words import sentence

WIDER = 1.6  # times the band: from where branches are followed if those from a little above it are not all
AGREES = 1e-5  # of |λ|: how near the followed modes are to those found in full


@one_thread
def full_onsets(
    system_at: Callable[[float], System],
    friction_range: tuple[float, float] = (0.0, 1.0),
    *,
    max_frequency_hz: float = 40e3,
    damped: bool = True,
    options: Options | None = None,
    own: float | None = None,
    unfollowed: str | None = None,
) -> Onsets:
    """Every critical μ in ``friction_range`` with a frequency up to ``max_frequency_hz``.

    system_at gives the system at a μ, on which its matrices may depend; own is the μ at which the touching nodes of
    contacts are found (None: the low end of the range). unfollowed: why branches are not to be followed ("": because
    they have led to no whole answer), None where they are. Raises CaseError for an empty range or no frequency,
    AnalysisError where nothing depends on μ, or the problem is too large for full solves where there is no other way.
    """
    low, high = (float(v) for v in friction_range)
    if not (0 <= low < high and np.isfinite(high)):
        raise CaseError("friction_range", friction_range, "two numbers 0 ≤ a < b")
    if not (np.isfinite(max_frequency_hz) and max_frequency_hz > 0):
        raise CaseError("max_frequency_hz", max_frequency_hz, "a positive frequency in Hz")
    refuse_undetermined(system_at(high), high, options or Options(), touching_at=low if own is None else own)
    family = family_of(system_at, (low, high), options or Options(), damped=damped, own=low if own is None else own)
    state = family.contacts.contact_state
    result = Onsets((), (low, high), max_frequency_hz, family.dissipates, family.open_contacts, contact_state=state)
    top = searched(family.built(high), 2 * np.pi * max_frequency_hz)
    if not family.depends:
        if not family.open_contacts:
            raise AnalysisError(
                "nothing here depends on the friction coefficient: no factor of a matrix has mu in it and there are no "
                "contacts; `stridor onsets CASE --along NAME` solves for onsets along other parameters"
            )
        at = f"mu = {low if own is None else own:g}"
        said = f"No contact carries load in steady sliding at {at}, where contacts are held, so nothing depends on mu."
        return replace(result, completeness=said)
    small = unfollowed is not None and family.size <= SMALL
    ends = (whole_ends if small else ends_of)(family, low, high, top)
    at_start, at_end = (tuple(end.values[unstable(family, end.values, top)].tolist()) for end in ends)
    result = replace(result, at_start=at_start, at_end=at_end)

    def source(beyond: float) -> Along:
        return _checked(along(family, beyond * top), ends, top)

    make = [lambda: source(BEYOND), lambda: source(WIDER)] if unfollowed is None else []
    answer = search(family, make, (low, high), ends, top, unfollowed or "")
    said = sentence(family, answer, ends, top, "μ", float)
    return replace(result, onsets=answer.onsets, entering=answer.entering, completeness=said)


def _checked(source: Along, ends: tuple[RegionModes, RegionModes], top: float) -> Along:
    """The source if it has all the modes found at both ends, else full solves."""
    family = source.family
    if source.whole or (isinstance(source, Projected) and source.model is None):
        return source
    # The low end of the range need not be where following begins; the high end is the one that is furthest from it.
    at_high = source.eigenpairs(family.high - family.low).values
    known = ends[1].values[np.abs(ends[1].values) <= top]
    known = known[moving(known, top, lambda: family.rest_limit(top))]
    distance = np.abs(known[:, None] - at_high).min(axis=1, initial=np.inf)
    if np.all(distance <= AGREES * np.abs(known)):
        return source
    return whole_or_raise(family, source.frequency, "a reduced model lacks modes that the matrices have")

"""Onsets along any number of a case: sought on a model reduced over its range, or on all freedoms of what is small, and
each solved in the full problem."""

from __future__ import annotations

import time

from ..case import Case
from ..case.matrix_checks import MU
from ..errors import CaseError
from ..modal.full import ParametricOnsets
from ..modal.full import onsets_along as sought
from .asked import require_frequency, require_range
from .provenance import provenance
from .reduced import searched_model


def onsets_along(
    case: Case,
    name: str,
    between: tuple[float, float] | None = None,
    *,
    max_frequency_hz: float | None = None,
    solver: str | None = None,
    said: str = "",
) -> ParametricOnsets:
    """Every change of stability along a number of the case, in its range there unless another is given.

    name: its path in the case, or a parameter of its matrices; mu is the friction coefficient. said: what the range is
    called in messages (default: friction_range for mu, else the range of that number). Raises CaseError for a number
    that there is not or that has no range.
    """
    started = time.perf_counter()
    if (steps := name.split("."))[0] == "parameters" and len(steps) == 3 and steps[1] in case.parameters:
        raise CaseError("along", name, f"call it {steps[1]}")
    chosen = _range(case, name, between, said or ("friction_range" if name == MU else f"range of {name}"))
    require_frequency(max_frequency_hz)
    model = searched_model(case, {name: chosen}, max_frequency_hz=max_frequency_hz)
    found = sought(model, name, solver=solver)
    found.provenance = provenance(case, "onsets along", time.perf_counter() - started, along=name)
    return found


def _range(case: Case, name: str, between: tuple[float, float] | None, said: str) -> tuple[float, float]:
    found, form = between, "--between low:high" if said == "--between" else "(low, high)"
    if found is None and name in case.parameters:
        found = case.parameters[name].range
    if found is None:
        raise CaseError(said, None, f"missing – {name} has no range in the case: give {form}")
    return require_range(found, said)

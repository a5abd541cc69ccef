"""Onsets along any number of a case: sought on a model reduced over its range, or on all freedoms of what is small, and
each solved in the full problem."""

from __future__ import annotations

import time

from ..case import Case
from ..case.matrix_checks import MU
from ..errors import AnalysisError, CaseError, NotReducibleError
from ..modal.full import ParametricOnsets
from ..modal.full import onsets_along as sought
from ..modal.full.along_stretches import Part, joined_along
from ..sliding.stretches import stretch_words
from .asked import require_frequency, require_range
from .provenance import provenance
from .reduced import searched_model, stretches_of


def onsets_along(
    case: Case,
    name: str,
    between: tuple[float, float] | None = None,
    *,
    max_frequency_hz: float | None = None,
    solver: str | None = None,
    said: str = "",
) -> ParametricOnsets:
    """Every change of stability along a number of the case, in its range there unless another is given. Where other
    nodes touch in steady sliding, each stretch of the number is solved with its own.

    name: its path in the case, or a parameter of its matrices; mu is the friction coefficient. said: what the range is
    called in messages (default: friction_range for mu, else the range of that number). Raises CaseError for a number
    that there is not or that has no range; AnalysisError where there is no steady sliding in all of it, and for a case
    with load steps.
    """
    started = time.perf_counter()
    if (steps := name.split("."))[0] == "parameters" and len(steps) == 3 and steps[1] in case.parameters:
        raise CaseError("along", name, f"call it {steps[1]}")
    chosen = _range(case, name, between, said or ("friction_range" if name == MU else f"range of {name}"))
    require_frequency(max_frequency_hz)
    _refuse_load_steps(case, name)
    found = _in_stretches(case, name, chosen, max_frequency_hz, solver)
    found.provenance = provenance(case, "onsets along", time.perf_counter() - started, along=name)
    return found


def _refuse_load_steps(case: Case, name: str) -> None:
    """Raise AnalysisError where load steps leave contact in another state at every value of a number."""
    if case.steady.friction != "stick-slip":
        return
    path = f"parameters.{name}.value" if name in case.parameters else name
    raise AnalysisError(
        f'onsets along {name} (--along): load steps (steady.friction = "stick-slip") leave nodes that stick and slip '
        "at each value in a way of its own, which is not followed along a number; take `stridor modes` at one value "
        f"after another (--set {path}=VALUE), or `onsets` over μ, without --along"
    )


def _in_stretches(
    case: Case, name: str, between: tuple[float, float], max_frequency_hz: float | None, solver: str | None
) -> ParametricOnsets:
    over = stretches_of(case, name, between)
    solid = [s for s in over if not s.reason]
    if not solid:
        raise AnalysisError(over[0].reason)
    parts: list[Part] = []
    for stretch in solid:
        held_at = {} if stretch.at is None else {name: stretch.at}
        box = {name: (stretch.low, stretch.high)}
        try:
            model = searched_model(case, box, max_frequency_hz=max_frequency_hz, held_at=held_at)
        except NotReducibleError as error:
            # Nobody asked for a reduced model: what is refused is onsets along a number.
            raise AnalysisError(
                f"onsets along {name}: onsets along a number do not take {error.lacks}; at one value at a time "
                "`stridor modes`, `onsets` over μ and `simulate` do"
            ) from error
        parts.append(Part(stretch, model, sought(model, name, solver=solver)))
    words = stretch_words(over, "μ" if name == MU else name)
    if len(over) == 1 and parts[0].stretch.at is None:
        parts[0].found.notes = (*words, *parts[0].found.notes)
        return parts[0].found
    return joined_along(parts, name, between, words)


def _range(case: Case, name: str, between: tuple[float, float] | None, said: str) -> tuple[float, float]:
    found, form = between, "--between low:high" if said == "--between" else "(low, high)"
    if found is None and name in case.parameters:
        found = case.parameters[name].range
    if found is None:
        raise CaseError(said, None, f"missing – {name} has no range in the case: give {form}")
    return require_range(found, said)

"""Onsets along a number of the case, as `stridor onsets --along` and `stridor reduce --onsets` tell them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from ..digits import measured
from ..errors import CaseError

if TYPE_CHECKING:
    from ..case import Case
    from ..modal.general import ParametricOnset, ParametricOnsets
    from ..modal.parametric import ReducedModel

MU = "mu"


def range_along(case: Case, name: str, between: tuple[float, float] | None) -> tuple[float, float]:
    """The range of a number: what was given, else that of the case. Raises CaseError where there is none."""
    own = case.parameters[name].range if name in case.parameters else None
    found = between if between is not None else own if own is not None else None
    if found is None:
        raise CaseError("--between", None, f"missing – {name} has no range in the case: give --between low:high")
    if not (all(math.isfinite(v) for v in found) and found[0] < found[1]):
        raise CaseError("--between", f"{found[0]:g}:{found[1]:g}", "two finite numbers low < high")
    return found


def document_along(model: ReducedModel, name: str, onsets: ParametricOnsets) -> dict[str, Any]:
    """What `stridor onsets --along --json` prints: as of μ, with ``value`` of the parameter in place of ``mu``."""
    (own,) = (p for p in model.problem.parameters if p.name == name)
    left_out = ("parameter", "point", "reduced_value")
    return {
        "parameter": name,
        "range": [own.low, own.high],
        "max_frequency_hz": model.frequency / (2 * math.pi),
        "onsets": [{k: v for k, v in onset_document(o).items() if k not in left_out} for o in onsets],
        "completeness": onsets.sentence,
        "complete": onsets.complete,
        "notes": list(getattr(model.problem, "notes", ())),
    }


def onset_document(onset: ParametricOnset) -> dict[str, Any]:
    """Plain values."""
    return {
        "parameter": onset.parameter,
        "value": onset.value,
        "point": dict(onset.point),
        "frequency_hz": onset.frequency_hz,
        "kind": onset.kind,
        "growth_slope": onset.growth_slope,
        "square_root_coefficient": onset.square_root_coefficient,
        "stabilising": onset.stabilising,
        "residual": onset.residual,
        "reduced_value": onset.reduced_value,
        "enters_band_at": onset.enters_at,
    }


def show_onsets_along(model: ReducedModel, along: str, onsets: ParametricOnsets, *, confirmed: bool) -> None:
    """A table, and what was checked."""
    from .output import stdout, table

    if not onsets:
        (own,) = (p for p in model.problem.parameters if p.name == along)
        top = model.frequency / (2 * math.pi)
        stdout.print(f"no onset along {along} in {own.low:g} … {own.high:g} up to {top:g} Hz", markup=False)
        stdout.print(f"  {onsets.sentence}", markup=False)
        return
    how = "confirmed in the full model" if confirmed else "of the reduced model alone: its file has no full matrices"
    rows = [
        [
            f"{o.value:.9g}",
            measured(o.frequency_hz, 3),
            o.kind,
            "stable" if o.stabilising else "unstable" if o.enters_at is None else "unstable *",
            "" if o.residual is None else f"{o.residual:.1e}",
        ]
        for o in onsets
    ]
    table(f"Onsets along {along}, {how}", [along, "frequency [Hz]", "kind", "turns", "residual"], rows)
    for line in onsets.from_above_words(model.frequency / (2 * math.pi)):
        stdout.print(f"  {line}", markup=False)
    stdout.print(f"  {onsets.sentence}", markup=False)

"""Onsets along a number of the case, as `stridor onsets --along` and `stridor reduce --onsets` tell them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..digits import measured

if TYPE_CHECKING:
    from ..modal.full import ParametricOnset, ParametricOnsets

MU = "mu"


def onset_document(onset: ParametricOnset) -> dict[str, Any]:
    """What `stridor reduce --onsets --json` prints of one."""
    return {
        "parameter": onset.parameter,
        "point": dict(onset.point),
        "reduced_value": onset.reduced_value,
        **onset.to_json(),
    }


def show_onsets_along(
    onsets: ParametricOnsets, *, confirmed: bool, held: bool = False, doubtful: bool = False, outside: bool = False
) -> None:
    """A table, and what was checked. held: whether the model holds the nodes that touch at the case's own friction;
    doubtful: whether others touch, or may, where it holds those of the case; outside: whether the other numbers lie
    outside its box."""
    from .output import stdout
    from .tables import table

    along = onsets.parameter
    if not onsets:
        stdout.print(f"  {onsets.sentence}")
        return
    how = "confirmed in the full model" if confirmed else "of the reduced model alone: its file has no full matrices"
    how += ", outside the box" if outside else ""
    where = "at the case's own friction" if held else "in the case as it is"
    how += f", with the nodes held that touch {where}" if held or doubtful else ""
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
    heads = [along, "frequency [Hz]", "kind", "turns", "residual"]
    table(f"Onsets along {along}, {how}", heads, rows, drop=["residual"], kept_in="the CSV file")
    for line in onsets.from_above_words():
        stdout.print(f"  {line}")
    stdout.print(f"  {onsets.sentence}")

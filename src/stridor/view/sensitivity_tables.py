"""Tables of sensitivities and counter-measures."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..digits import readable
from ..study.countermeasures import Countermeasures, Measure
from ..study.sensitivities import Sensitivities
from .tables import Table, TableRow, drop_empty, quantity, significant

BADLY_CONDITIONED = 10.0
SOME = 3  # modes that a cell of a table names


def sensitivity_table(result: Sensitivities) -> Table:
    """What a per cent of each number does to each mode."""
    rounding = np.isfinite(result.growth_per_percent) & ~result.beyond_rounding
    rows = [
        TableRow(
            (
                str(int(result.branch[b])),
                quantity(float(result.frequency_hz[b]), 1),
                quantity(float(result.growth_rate[b]), 2),
                name,
                "rounding" if rounding[k, b] else significant(float(result.growth_per_percent[k, b])),
                significant(float(result.frequency_per_percent_hz[k, b])),
                significant(float(result.condition[b]), 3),
                _distance(float(result.exceptional_distance[k, b])),
            ),
            "far" if result.condition[b] > BADLY_CONDITIONED else "",
        )
        for b in range(len(result.branch))
        for k, name in enumerate(result.parameters)
    ]
    heads = (
        "mode",
        "frequency [Hz]",
        "growth rate [1/s]",
        "number",
        "growth rate per % [1/s]",
        "frequency per % [Hz]",
        "condition",
        "exceptional point",
    )
    caption = (
        f"At μ = {result.mu:g}, {'with structural damping' if result.damped else 'without damping'}; touching nodes "
        "are held. Condition: 1 for a symmetric system, without bounds at an exceptional point, whose distance "
        "in per cent of the number is how far derivatives can reach at all."
    )
    if result.warnings:
        caption += " " + ". ".join(result.warnings) + "."
    return drop_empty(Table("sensitivities", "Sensitivities", heads, tuple(rows), frozenset({3}), caption))


def _distance(distance: float) -> str:
    text = significant(100 * distance, 2)
    return f"{text} % away" if text else ""


def countermeasure_table(result: Countermeasures) -> Table:
    """Changes by growth removed per per cent, and what came of the best when they were solved again."""
    rows = tuple(
        TableRow(
            (
                measure.words,
                significant(measure.removed_per_percent),
                significant(measure.removed_sum_per_percent),
                significant(measure.removed),
                significant(measure.verified.removed) if measure.verified is not None else "",
                _consequences(measure),
            ),
            "bad" if measure.makes_unstable else "",
        )
        for measure in result.measures
    )
    aimed = "all unstable modes together" if result.target == "sum" else f"mode {result.target}"
    heads = (
        "change",
        "removed per % [1/s]",
        "of all, per % [1/s]",
        "removed, predicted [1/s]",
        "removed, solved again [1/s]",
        "consequences",
    )
    caption = (
        f"Growth rate taken from {aimed} at μ = {result.mu:g}. Predictions are of first order and hold the touching "
        "nodes; solved again, steady sliding is solved anew as well. A per cent is one of the number, of the body's "
        "mass, of the contact's area."
    )
    if result.warnings:
        caption += " " + ". ".join(result.warnings) + "."
    return drop_empty(Table("countermeasures", "Counter-measures", heads, rows, frozenset({0, 5}), caption))


def _consequences(measure: Measure) -> str:
    parts: list[str] = []
    if measure.makes_unstable:
        parts.append(f"makes unstable: mode {_some([str(b) for b in measure.makes_unstable])}")
    if measure.brings_close:
        parts.append(f"brings close: mode {_some([str(b) for b in measure.brings_close])}")
    again = measure.verified
    if again is not None and not again.unstable_hz:
        parts.append("solved again: nothing grows")
    elif again is not None:
        where = _some([readable(f, 4, decimals=0) for f in again.unstable_hz if f])
        diverges = "" if all(again.unstable_hz) else "diverges at 0 Hz"
        grows = f"grows at {where} Hz" if where else ""
        parts.append(f"solved again: {', '.join(filter(None, (diverges, grows)))}")
    if again is not None and again.doubt:
        parts.append(again.doubt)
    return "; ".join(parts)


def _some(words: Sequence[str]) -> str:
    """The first of a list, and how many more there are: the document of the result has them all."""
    more = len(words) - SOME
    return ", ".join(words[:SOME]) + (f" and {more} more" if more > 0 else "")

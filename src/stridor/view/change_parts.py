"""What of a report is about causes and changes: how each mode comes to grow, derivatives, counter-measures."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

from ..case import Case
from ..digits import measured
from ..modal.onsets import Onset
from .inputs import ReportInputs
from .origins import Origin, origin
from .page_parts import ReportFigure
from .sensitivity_plots import countermeasure_bars, sensitivity_bars
from .sensitivity_tables import countermeasure_table, sensitivity_table
from .tables import Table, TableRow, quantity


def mechanism_table(inputs: ReportInputs) -> Table | None:
    """How each mode that grows at the friction of the case comes to do so, by the onset it goes back to; None where
    nothing grows or no onsets were solved."""
    modes, onsets = inputs.modes, inputs.onsets
    if modes is None or onsets is None:
        return None
    mu = float(modes.mu[0])
    growing = [b for b in modes.order(0, "growth") if modes.unstable[0, b]]
    sweep = inputs.damped_sweep if modes.damped else inputs.undamped_sweep
    rows: list[TableRow] = []
    for b in growing:
        found, own = origin(onsets, modes, int(b), sweep), int(modes.branch[b])
        rows.append(
            TableRow(
                (
                    str(own),
                    quantity(float(modes.frequency_hz[0, b]), 1),
                    quantity(float(modes.growth_rate[0, b]), 1),
                    "" if found.onset is None else measured(found.onset.mu, 4),
                    _how(found, own, onsets.friction_range[0]),
                )
            )
        )
    if not rows:
        return None
    heads = ("mode", "frequency [Hz]", "growth rate [1/s]", "grows from μ", "how")
    caption = f"Every mode that grows at μ = {mu:g}, and the onset that it goes back to.{_falling(inputs.case)}"
    return Table("mechanisms", "What makes it grow", heads, tuple(rows), frozenset({4}), caption)


def _how(found: Origin, own: int, low: float) -> str:
    """How a mode comes to grow; own: its number at the friction of the case."""
    if found.onset is None:
        if found.from_start:
            return f"no onset: it grows from the lowest μ, {low:g}, on"
        return "not told: no onset that was found leads to it"
    other = found.number is not None and found.number != own and any(found.onset.branches)
    return _words(found.onset) + (f"; numbered over friction it is mode {found.number}" if other else "")


def _words(onset: Onset) -> str:
    if onset.kind == "divergence":
        return "divergence: its frequency goes to zero and the motion runs away"
    if onset.kind == "contact":
        return "other nodes touch from this μ on"
    a, b = onset.branches
    which = f"modes {a} and {b} come together" if a and b else "two modes come together"
    return f"flutter: {which} at {measured(onset.frequency_hz, 0)} Hz and exchange energy through friction"


def _falling(case: Case) -> str:
    falling = [name for name, c in case.contacts.items() if not c.friction.law_object().constant]
    if not falling:
        return ""
    return f" Friction of {', '.join(falling)} changes with slip speed; where it falls, it takes damping from modes."


def change_tables(inputs: ReportInputs) -> Iterator[Table]:
    """Derivatives of the modes that grow, and counter-measures, where there are any."""
    if inputs.sensitivities is not None and len(inputs.sensitivities.branch):
        yield sensitivity_table(inputs.sensitivities)
    if inputs.measures is not None and inputs.measures.measures:
        yield countermeasure_table(inputs.measures)


def change_figures(inputs: ReportInputs) -> Iterator[ReportFigure]:
    """The same as bars."""
    if inputs.sensitivities is not None and len(inputs.sensitivities.branch):
        yield ReportFigure(
            "sensitivities",
            "What a per cent of each number does",
            "Change of the growth rate of each mode that grows, to first order; to the right more of the number makes "
            "it grow faster.",
            "Bars of the change of growth rate per per cent of each number of the case.",
            partial(sensitivity_bars, inputs.sensitivities),
        )
    if inputs.measures is not None and inputs.measures.measures:
        yield ReportFigure(
            "countermeasures",
            "Counter-measures, the best first",
            "Growth rate that a per cent of each change takes away; diamonds: solved again with the change made, "
            "which come first.",
            "Bars of the growth rate removed per per cent of change, for each counter-measure.",
            partial(countermeasure_bars, inputs.measures),
        )


def change_words(inputs: ReportInputs) -> tuple[str, ...]:
    """What is to be said where a table would be empty."""
    found = (
        (inputs.sensitivities, inputs.sensitivities is not None and not len(inputs.sensitivities.branch)),
        (inputs.measures, inputs.measures is not None and not inputs.measures.measures),
    )
    said = [warning for result, empty in found if result is not None and empty for warning in result.warnings]
    return tuple(dict.fromkeys(f"{text[0].upper()}{text[1:]}." for text in said))

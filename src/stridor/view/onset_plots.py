"""Onsets in the plane of the number they lie along and their frequency; modes of a reduced model at points."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..digits import measured
from ..modal.full import ParametricOnsets
from ..modal.onsets import Onsets
from ..modal.parametric import ModesAtPoints
from .colours import BLUE, GREY, INK, VERMILION
from .modal_plots import MU
from .style import legend_above, panel, stacked, styled, zero_line
from .units import frequency_unit, most

MOST_NAMED = 12  # onsets with their value beside them


@styled
def onset_chart(onsets: Onsets | ParametricOnsets, *, ax: Axes | None = None) -> Figure:
    """Each onset at its value and frequency over the range searched: filled where growth begins, open where it ends.
    Triangles at the sides: modes that grow at that end of the range, of onsets over μ."""
    figure, ax = panel(ax, 3.8)
    if isinstance(onsets, Onsets):
        (low, high), name, at = onsets.friction_range, MU, [o.mu for o in onsets]
        ends = ((low, ">", onsets.at_start), (high, "<", onsets.at_end))
    else:
        (low, high), name, at = onsets.between, onsets.parameter, [o.value for o in onsets]
        ends = ()
    unit, its_name = frequency_unit(onsets.max_frequency_hz)
    for words, ending, colour in (("growth begins", False, VERMILION), ("growth ends", True, "white")):
        chosen = [(x, o.frequency_hz / unit) for x, o in zip(at, onsets, strict=True) if o.stabilising is ending]
        if chosen:
            ax.plot(*zip(*chosen, strict=True), "D", color=colour, mec=VERMILION, ms=6, label=words, clip_on=False)
    for end, marker, values in ends:
        if values:
            side = "start" if end == low else "end"
            label = f"grows at the {side} of the range"
            there = [abs(v.imag) / (2 * np.pi * unit) for v in values]
            ax.plot([end] * len(values), there, marker, color=INK, ms=6, ls="none", label=label, clip_on=False)
    # Once where several begin or end together, as at a value from which on other nodes touch.
    highest = {x: o for x, o in sorted(zip(at, onsets, strict=True), key=lambda one: one[1].frequency_hz)}
    for x, o in sorted(highest.items(), key=lambda one: one[0])[:MOST_NAMED]:
        right = x < (low + high) / 2
        ax.annotate(
            measured(x, 4), (x, o.frequency_hz / unit), xytext=(7 if right else -7, 0), textcoords="offset points",
            ha="left" if right else "right", va="center", fontsize=8,
        )  # fmt: skip
    ax.set(xlim=(low, high), ylim=(0, onsets.max_frequency_hz / unit), xlabel=name, ylabel=f"frequency [{its_name}]")
    if not len(onsets):
        ax.text(0.5, 0.5, "no onset found", transform=ax.transAxes, ha="center", va="center", color=GREY)
    # Four that long do not stand beside each other, and what is too wide takes its width from the frame.
    legend_above(ax, columns=4 if len(ax.get_legend_handles_labels()[1]) < 4 else 2)
    return figure


@styled
def modes_at_points(found: ModesAtPoints) -> Figure:
    """Frequency and growth rate of the modes at each point over the number that has most values, unstable ones filled.
    Of several numbers the points of all others lie above each other."""
    figure, (upper, lower) = stacked(None, 2, 5.4)
    varied = max(range(len(found.parameters)), key=lambda k: len(np.unique(found.values[:, k])))
    x = np.broadcast_to(found.values[:, [varied]], found.frequency_hz.shape)
    unit, its_name = frequency_unit(most(found.frequency_hz))
    for ax, values, words in (
        (upper, found.frequency_hz / unit, f"frequency [{its_name}]"), (lower, found.growth_rate, "growth rate [1/s]")
    ):  # fmt: skip
        for chosen, fill, colour, label in (
            (~found.unstable, "none", BLUE, "decays"), (found.unstable, VERMILION, VERMILION, "unstable")
        ):  # fmt: skip
            shown = chosen & np.isfinite(values)
            if shown.any():
                ax.plot(x[shown], values[shown], "o", ms=4, mfc=fill, mec=colour, label=label)
        ax.set_ylabel(words)
    zero_line(lower)
    reach = float(np.abs(found.growth_rate[np.isfinite(found.growth_rate)]).max(initial=0.0))
    if reach > 0:
        lower.set_yscale("symlog", linthresh=10.0 ** np.floor(np.log10(reach / 30)))
        lower.set_ylim(-2 * reach, 2 * reach)
    lower.set_xlabel(found.parameters[varied])
    legend_above(upper)
    return figure

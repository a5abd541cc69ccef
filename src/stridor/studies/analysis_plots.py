"""Figures of studies of steady sliding, of runs in time and of comparisons: what came out over each parameter, and over
the first two."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patheffects import AbstractPathEffect, Normal, Stroke

from ..errors import AnalysisError
from ..typing import Array, BoolArray, IntArray
from ..view.colours import BLUE, GREEN, GREY, INK, ORANGE, VERMILION
from ..view.style import legend_above, new_figure, panel, stacked, styled, zero_line
from .maps import marks
from .plot_parts import along, beside, file_name, key, over_two, two, varied
from .result import StudyResult, numbers

MOST = 4  # parameters that have a figure each
AGREES, DIFFERS, OPEN = 1, 0, -1  # of a comparison
# Its marks: shape, colour and words.
VERDICTS = {AGREES: ("o", BLUE, "agree"), DIFFERS: ("X", VERMILION, "do not agree"), OPEN: ("o", GREY, "not decided")}
IN_TIME = {"agree": "x", "do not agree": "X", "not decided": "+"}
DOMINANT = "dominant frequency [Hz]"
_OUTLINED: list[AbstractPathEffect] = [Stroke(linewidth=2.2, foreground=INK), Normal()]  # seen on all colours
EVEN = 1e-6  # of the values: what lies closer is the same but for rounding


@dataclass(frozen=True)
class _Line:
    """A result over a parameter: values (n,) of the rows that have results, and how it looks; filled (n,): which marks
    are; joined: by a line, where nothing else varies."""

    values: Array
    label: str
    colour: str = BLUE
    marker: str = "o"
    size: float = 4.0
    filled: BoolArray | None = None
    joined: bool = True


@dataclass(frozen=True)
class _Panel:
    """Lines with one axis; share: from 0 to 1; signed: of either sign."""

    label: str
    lines: tuple[_Line, ...]
    share: bool = False
    signed: bool = False


def analysis_figures(result: StudyResult) -> dict[str, Figure]:
    """Every figure of a study of steady sliding, runs or comparisons, by the name of its file."""
    names = varied(result)
    drawn: dict[str, Figure] = {}
    if result.compute == "compare":
        drawn["agreement"] = agreement(result)
    if len(names) >= 2:
        drawn |= {"agreement-map": agreement_map(result)} if result.compute == "compare" else {"maps": maps(result)}
    for name in names[:MOST]:
        drawn[f"over-{file_name(name)}"] = results_over(result, name)
    return drawn


@styled
def results_over(result: StudyResult, x: str) -> Figure:
    """The results of all samples over one parameter. Of steady sliding contact forces and shares of the contact nodes;
    of runs how strongly they vibrate, filled where growth has ended, at which frequency, filled where that dominates,
    and shares of time; of comparisons growth rate and frequency of the mode and in time."""
    panels = _PANELS[result.compute](result)
    figure, axes = stacked(None, len(panels), 0.6 + 2.0 * len(panels))
    at = numbers(result, x)
    order, alone = np.argsort(at), len(varied(result)) == 1
    for ax, shown in zip(axes, panels, strict=True):
        for line in shown.lines:
            _draw(ax, at[order], line, order, joined=alone and line.joined)
        ax.set_ylabel(shown.label)
        _limits(ax, shown)
        legend_above(ax, _keys(shown), columns=4)
    along(result, axes[-1], x)
    return figure


def _draw(ax: Axes, at: Array, line: _Line, order: IntArray, *, joined: bool) -> None:
    """Marks over a parameter, joined where nothing else varies."""
    values = line.values[order]
    filled = np.ones(len(values), dtype=bool) if line.filled is None else line.filled[order]
    if joined:
        known = np.isfinite(values)
        ax.plot(at[known], values[known], color=line.colour, linewidth=0.9, zorder=1.8)
    for chosen, inside in ((filled, line.colour), (~filled, "none")):
        if chosen.any():
            ax.plot(at[chosen], values[chosen], line.marker, mfc=inside, mec=line.colour, ms=line.size, mew=0.9)


def _limits(ax: Axes, shown: _Panel) -> None:
    """From zero on, with room for the marks at both ends; what is even but for rounding is seen to be even."""
    if shown.share:
        ax.set_ylim(-0.06, 1.06)
    elif shown.signed:
        zero_line(ax)
    else:
        values = np.concatenate([line.values for line in shown.lines])
        low, high = (float(f(values[np.isfinite(values)], initial=0.0)) for f in (np.min, np.max))
        size = (high - low) or 1.0
        ax.set_ylim(low - 0.06 * size, high + 0.08 * size)


def _keys(shown: _Panel) -> list[Artist]:
    """What lines and marks mean, where that is not said at the axis."""
    handles: list[Artist] = []
    for line in shown.lines:
        hollow = line.filled is not None and not line.filled.any()
        if line.label and np.isfinite(line.values).any():
            handles.append(key(line.marker, line.label, line.colour, filled=not hollow))
    return handles


def _steady(result: StudyResult) -> list[_Panel]:
    nodes = _nodes(result)
    states = _states("open", nodes["open"], nodes["sticking"], nodes["slipping"])
    panels = [
        _Panel("normal force [N]", (_Line(numbers(result, "normal_force"), "sum of all contacts"),)),
        _Panel(f"share of {_how_many(result)}", states, share=True),
    ]
    if not _single(result):
        panels.insert(1, _Panel("largest of a node [N]", (_Line(numbers(result, "largest_node_force"), ""),)))
    return panels


def _states(apart: str, separation: Array, stick: Array, slip: Array) -> tuple[_Line, ...]:
    """Shares of what contacts do; of marks in one place each is seen."""
    none = np.zeros(len(stick), dtype=bool)
    return (
        _Line(separation, apart, VERMILION, "^", 8.0, none),
        _Line(stick, "stick", BLUE, "s", 6.0, none),
        _Line(slip, "slip", ORANGE, "o", 4.0),
    )


def _single(result: StudyResult) -> bool:
    """Whether there is one contact node, whose force is the sum."""
    return bool(np.max(_totals(result), initial=0.0) <= 1)


def _totals(result: StudyResult) -> Array:
    """How many contact nodes (n,) there are."""
    return np.sum([numbers(result, f"{name}_nodes") for name in ("open", "sticking", "slipping")], axis=0)


def _how_many(result: StudyResult) -> str:
    """The contact nodes in words, with their number where there are several, as many in all samples."""
    totals = np.unique(_totals(result)).astype(int).tolist()
    return f"{totals[0]} contact nodes" if len(totals) == 1 and totals[0] > 1 else "contact nodes"


def _nodes(result: StudyResult) -> dict[str, Array]:
    """Shares (n,) of the contact nodes by what they do; NaN where there are none."""
    total = _totals(result)
    counts = {name: numbers(result, f"{name}_nodes") for name in ("open", "sticking", "slipping")}
    return {name: np.where(total > 0, count / np.maximum(total, 1), np.nan) for name, count in counts.items()}


def _simulate(result: StudyResult) -> list[_Panel]:
    shares = _states("separation", *(numbers(result, f"{name}_fraction") for name in ("separation", "stick", "slip")))
    panels = [
        _Panel(DOMINANT, _by_dominance(result)),
        _Panel("share of time", shares, share=True),
    ]
    if "velocity_rms" in result.data:  # a store of an earlier version has none
        panels.insert(0, _Panel("velocity, rms [m/s]", _by_growth(result)))
    return panels


def _slower(result: StudyResult) -> BoolArray:
    """In which runs (n,) something slower than their window resolves is stronger than the line; of a store of an
    earlier version that is not known, and none."""
    held = "stronger_below_hz" in result.data
    return np.isfinite(numbers(result, "stronger_below_hz" if held else "dominant_frequency_hz")) & held


def _by_dominance(result: StudyResult) -> tuple[_Line, ...]:
    """At which frequency runs vibrate: filled where it dominates."""
    frequency, slower = numbers(result, "dominant_frequency_hz"), _slower(result)
    if not slower.any():
        return (_Line(frequency, "", joined=False),)
    every = np.ones(len(slower), dtype=bool)
    return (
        _Line(np.where(slower, np.nan, frequency), "nothing slower told", filled=every, joined=False),
        _Line(np.where(slower, frequency, np.nan), "something slower is stronger", filled=~every, joined=False),
    )


def _by_growth(result: StudyResult) -> tuple[_Line, ...]:
    """How strongly runs vibrate: filled where growth has ended or the amplitude does not change, as others would go on
    to vibrate more."""
    rms, ended = numbers(result, "velocity_rms"), numbers(result, "saturated") >= 1
    every = np.ones(len(rms), dtype=bool)
    return (
        _Line(np.where(ended, rms, np.nan), "growth has ended, or none", filled=every, joined=False),
        _Line(np.where(ended, np.nan, rms), "not ended, or not known", filled=~every, joined=False),
    )


def _compare(result: StudyResult) -> list[_Panel]:
    def pair(modal: str, in_time: str) -> tuple[_Line, ...]:
        none = np.zeros(int(result.done.sum()), dtype=bool)
        runs = numbers(result, in_time)
        return (
            _Line(numbers(result, modal), "mode", INK, "o", 6.0, none, joined=False),
            *(
                _Line(np.where(chosen, runs, np.nan), f"in time: {words}", colour, IN_TIME[words], joined=False)
                for chosen, _, colour, words in _verdicts(result)
            ),
        )

    return [
        _Panel("growth rate [1/s]", pair("modal_growth_rate", "growth_rate_in_time"), signed=True),
        _Panel("frequency [Hz]", pair("modal_frequency_hz", "frequency_in_time_hz")),
    ]


_PANELS = {"steady": _steady, "simulate": _simulate, "compare": _compare}


# -- over two parameters -----------------------------------------------------------------------------------------------
@styled
def maps(result: StudyResult, x: str | None = None, y: str | None = None) -> Figure:
    """Samples over two parameters (default: the first two that vary), coloured by what came out of steady sliding or of
    runs, a panel for each result. Raises AnalysisError with fewer than two parameters."""
    x, y = two(result, x, y)
    shown = _mapped(result)
    rows = (len(shown) + 1) // 2
    figure = new_figure(0.4 + 3.0 * rows)
    at = [numbers(result, name) for name in (x, y)]
    panels = figure.subplots(rows, 2, squeeze=False, sharex=True, sharey=True).ravel()
    for k, (ax, (label, values, share)) in enumerate(zip(panels, shown, strict=False)):
        ax.set_title(label)
        known = np.isfinite(values)
        drawn = marks(ax, at, known, c=values[known], cmap="viridis")
        low, high = _colours(values[known], from_zero=share)
        drawn.set_clim(low, high)
        if label == DOMINANT and (slower := _slower(result)).any():
            marks(ax, at, slower, c="white", marker="x", lw=1.0, path_effects=_OUTLINED)
            ax.set_title(f"{label}; ×: slower is stronger")
        even = known.any() and _even(values[known])
        if even:  # one colour, as other ones would be those of nothing
            drawn.set_cmap(ListedColormap([drawn.get_cmap()(0.5 if np.any(values[known]) else 0.0)]))
        bar = figure.colorbar(drawn, ax=ax, pad=0.02)
        if even:
            bar.set_ticks([0.5 * (low + high)], labels=[f"{float(np.mean(values[known])):.5g}"])
        along(result, ax, x, "x")
        along(result, ax, y, "y")
        if k + 2 >= len(shown):  # nothing below it
            ax.tick_params(labelbottom=True)
        else:
            ax.set_xlabel("")
        if k % 2:
            ax.set_ylabel("")
    if others := beside(result, x, y):
        figure.supxlabel(others, fontsize=9.5)  # once: below each panel it would run into that of the next
    for ax in panels[len(shown) :]:
        ax.set_visible(False)
    return figure


def _even(values: Array) -> bool:
    """Whether values (n,) are the same but for rounding."""
    low, high = float(values.min()), float(values.max())
    return high - low <= EVEN * max(abs(low), abs(high))


def _colours(values: Array, *, from_zero: bool) -> tuple[float, float]:
    """Ends of the colours of values (n,): theirs, of shares zero and the largest, as few nodes that open would be one
    colour with none of all; what is even but for rounding has the middle one."""
    if not values.size:
        return 0.0, 1.0
    low, high = float(values.min()), float(values.max())
    if _even(values):
        size = 0.01 * max(abs(low), abs(high)) or 1.0
        return low - size, high + size
    return (min(low, 0.0) if from_zero else low), high


def _mapped(result: StudyResult) -> Sequence[tuple[str, Array, bool]]:
    """Titles and values (n,) of the panels of a map, and whether they are shares, whose colours begin at zero."""
    if result.compute == "steady":
        nodes, of = _nodes(result), _how_many(result)
        largest = ("largest force of a node [N]", numbers(result, "largest_node_force"), False)
        return (
            ("normal force of all contacts [N]", numbers(result, "normal_force"), False),
            *(() if _single(result) else (largest,)),
            (f"share of {of} open", nodes["open"], True),
            (f"share of {of} in stick", nodes["sticking"], True),
        )
    if result.compute != "simulate":
        raise AnalysisError(f"these maps are of steady sliding and of runs, and the study computed {result.compute}")
    rms = [("velocity, rms [m/s]", numbers(result, "velocity_rms"), False)] if "velocity_rms" in result.data else []
    return (
        *rms,
        (DOMINANT, numbers(result, "dominant_frequency_hz"), False),
        ("share of time in stick", numbers(result, "stick_fraction"), True),
        ("share of time in separation", numbers(result, "separation_fraction"), True),
    )


# -- comparisons -------------------------------------------------------------------------------------------------------
def _verdicts(result: StudyResult) -> list[tuple[BoolArray, str, str, str]]:
    """Which rows (n,) have each verdict that there is, its mark, colour and words."""
    if result.compute != "compare":
        raise AnalysisError(f"agreement is that of comparisons, and the study computed {result.compute}")
    agree = numbers(result, "agree")
    found = [(agree == verdict, *look) for verdict, look in VERDICTS.items()]
    return [entry for entry in found if entry[0].any()]


@styled
def agreement(result: StudyResult) -> Figure:
    """Growth rate and frequency in time over those of the mode, by whether both approaches agree; on the line they are
    equal. Rows without a result in time are counted above."""
    verdicts = _verdicts(result)
    figure = new_figure(4.0)
    for ax, (modal, in_time, label) in zip(
        figure.subplots(1, 2),
        (
            ("modal_growth_rate", "growth_rate_in_time", "growth rate [1/s]"),
            ("modal_frequency_hz", "frequency_in_time_hz", "frequency [Hz]"),
        ),
        strict=True,
    ):
        one, other = numbers(result, modal), numbers(result, in_time)
        for chosen, marker, colour, _ in verdicts:
            ax.plot(one[chosen], other[chosen], marker, mfc="none" if colour == GREY else colour, mec=colour, ms=5)
        ends = np.concatenate([one, other])
        ends = ends[np.isfinite(ends)]
        if ends.size:
            ax.plot([ends.min(), ends.max()], [ends.min(), ends.max()], color=GREEN, linewidth=0.9, zorder=1.5)
        ax.set_title(label)
        ax.set(xlabel="mode", ylabel="in time")
    handles: list[Artist] = [
        key(m, f"{words} ({np.count_nonzero(rows)})", c, filled=c != GREY) for rows, m, c, words in verdicts
    ]
    handles.append(Line2D([], [], color=GREEN, linewidth=0.9, label="equal"))
    if missing := int(np.count_nonzero(~np.isfinite(numbers(result, "growth_rate_in_time")))):
        handles.append(Line2D([], [], linestyle="none", label=f"{missing} without a rate in time"))
    figure.legend(handles=handles, loc="outside upper left", ncols=4)
    return figure


@styled
def agreement_map(result: StudyResult, x: str | None = None, y: str | None = None, *, ax: Axes | None = None) -> Figure:
    """Samples over two parameters (default: the first two that vary), marked by whether both approaches agree. Raises
    AnalysisError with fewer than two parameters."""
    verdicts = _verdicts(result)
    x, y = two(result, x, y)
    figure, ax = panel(ax, 4.2)
    at = [numbers(result, name) for name in (x, y)]
    handles: list[Artist] = []
    for chosen, marker, colour, words in verdicts:
        marks(ax, at, chosen, marker=marker, facecolor="none" if colour == GREY else colour, edgecolors=colour, lw=0.9)
        handles.append(key(marker, words, colour, filled=colour != GREY))
    over_two(result, ax, x, y)
    legend_above(ax, handles)
    return figure

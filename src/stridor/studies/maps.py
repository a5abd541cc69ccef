"""Maps of a study over two of its parameters, a mark for each sample: where something grows, how fast, from which
friction on."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.colors import Normalize, TwoSlopeNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from ..errors import AnalysisError
from ..typing import Array, BoolArray
from ..view.colours import GREY, VERMILION
from ..view.style import legend_above, panel, styled
from .plot_parts import friction_range, key, logarithmic, over_two, rings, two
from .result import StudyResult, numbers

STABLE = "#DDDDDD"


@styled
def stability_map(result: StudyResult, x: str | None = None, y: str | None = None, *, ax: Axes | None = None) -> Figure:
    """Samples over two parameters (default: the first two that vary): frequency of the fastest growing mode as colour,
    grey where nothing grows; over a grid of these two with the line where growth begins. Rings: solved in the full
    problem as well. Raises AnalysisError for a study of other than modes, and with fewer than two parameters."""
    figure, ax, x, y, at = _map(result, x, y, ax, "modes")
    shown, unstable = numbers(result, "largest_growth_frequency_hz"), result.unstable
    handles: list[Artist] = []
    if not unstable.all():
        marks(ax, at, ~unstable, color=STABLE)
        handles.append(key("s", "nothing grows", STABLE))
    if unstable.any():
        drawn = marks(ax, at, unstable, c=shown[unstable], cmap="viridis")
        figure.colorbar(drawn, ax=ax, label="frequency of the fastest growing mode [Hz]", pad=0.02)
    handles += boundary(result, ax, x, y) + rings(result, ax, at)
    legend_above(ax, handles, columns=3)
    return figure


@styled
def growth_map(result: StudyResult, x: str | None = None, y: str | None = None, *, ax: Axes | None = None) -> Figure:
    """Samples over two parameters (default: the first two that vary): the largest growth rate as colour, of either sign
    with a half of the colours of its own; discs where nothing grows, squares where a mode does. Over a grid of these
    two with the line where growth begins; between samples of a distribution none is known, and none is drawn. Raises
    AnalysisError for a study of other than modes, and with fewer than two parameters."""
    figure, ax, x, y, at = _map(result, x, y, ax, "modes")
    growth, unstable = numbers(result, "largest_growth_rate"), result.unstable
    known = np.isfinite(growth)
    handles: list[Artist] = []
    if known.any():
        scale = _two_sided(growth[known])
        drawn = None
        for of, marker, label in ((~unstable, "o", "nothing grows"), (unstable, "s", "a mode grows")):
            if (chosen := known & of).any():
                # With an edge: rates near zero are white.
                drawn = marks(ax, at, chosen, c=growth[chosen], marker=marker, edgecolors=GREY, lw=0.5, **scale)
                handles.append(key(marker, label, GREY, filled=False))
        assert drawn is not None, "a row is one of both"
        ends = drawn.get_clim()
        ticks = [t for end in ends for t in MaxNLocator(4).tick_values(min(end, 0.0), max(end, 0.0))]
        shown = sorted({float(t) for t in ticks if ends[0] <= t <= ends[1]})
        figure.colorbar(drawn, ax=ax, label="largest growth rate [1/s]", pad=0.02, ticks=shown)
    handles += boundary(result, ax, x, y)
    legend_above(ax, handles, columns=3)
    return figure


def _ends(values: Array) -> tuple[float, float]:
    return float(values.min()), float(values.max())


def _two_sided(growth: Array) -> dict[str, Any]:
    """Colours about zero: blue to white where rates are negative, white to red where they are positive, each up to its
    own end, as decay and growth may be of other orders."""
    low, high = _ends(growth)
    least = 1e-3 * max(-low, high, 1e-9)  # either half has to be there
    return {"norm": TwoSlopeNorm(0.0, min(low, -least), max(high, least)), "cmap": "RdBu_r"}


@styled
def critical_map(result: StudyResult, x: str | None = None, y: str | None = None, *, ax: Axes | None = None) -> Figure:
    """Samples of a study of onsets over two parameters (default: the first two that vary), coloured by the critical
    friction coefficient, each from onsets that were solved for. Grey where nothing grows in the range of friction,
    triangles where a mode grows at its low end already, crosses where the list of onsets may lack some. Raises
    AnalysisError for a study of other than onsets, and with fewer than two parameters."""
    figure, ax, x, y, at = _map(result, x, y, ax, "onsets")
    critical, early = numbers(result, "critical_mu"), numbers(result, "growing_at_start") > 0
    none, late = ~np.isfinite(critical), np.isfinite(critical) & ~early
    low, high = friction_range(result)
    handles: list[Artist] = []
    if none.any():
        marks(ax, at, none, color=STABLE)
        handles.append(key("s", f"no onset up to μ = {high:g}", STABLE))
    drawn, scale = None, Normalize(*_ends(critical[~none])) if not none.all() else None
    for chosen, marker in ((late, "s"), (early & ~none, "v")):
        if chosen.any():
            drawn = marks(ax, at, chosen, c=critical[chosen], marker=marker, cmap="viridis", norm=scale)
    if drawn is not None:
        figure.colorbar(drawn, ax=ax, label="critical friction coefficient", pad=0.02)
    if early.any():
        handles.append(key("v", f"grows at μ = {low:g} already", filled=False))
    if (doubtful := numbers(result, "complete") == 0).any():
        ax.plot(at[0][doubtful], at[1][doubtful], "x", color=VERMILION, ms=5, mew=1.0)
        handles.append(key("x", "onsets may be missing", VERMILION))
    handles += rings(result, ax, at)
    legend_above(ax, handles, columns=2)
    return figure


def _map(
    result: StudyResult, x: str | None, y: str | None, ax: Axes | None, compute: str
) -> tuple[Figure, Axes, str, str, list[Array]]:
    """A figure with axes over two parameters, which these are, and where the rows that have results lie."""
    if result.compute != compute:
        raise AnalysisError(f"this map is of {compute}, and the study computed {result.compute}")
    x, y = two(result, x, y)
    figure, ax = panel(ax, 4.6)
    over_two(result, ax, x, y)
    return figure, ax, x, y, [numbers(result, name) for name in (x, y)]


def marks(ax: Axes, at: Sequence[Array], chosen: BoolArray, **look: Any) -> PathCollection:
    """Marks at the rows chosen, the smaller the more rows there are."""
    size = float(np.clip(6000 / max(len(chosen), 1), 4, 60))
    drawn: dict[str, Any] = {"marker": "s", "lw": 0, **look}
    return ax.scatter(at[0][chosen], at[1][chosen], s=size, **drawn)


def boundary(result: StudyResult, ax: Axes, x: str, y: str) -> list[Artist]:
    """The line of no growth over a whole grid of two parameters alone: anywhere else there is none that was computed,
    and none is drawn."""
    axes = [np.unique(result.data[name].values) for name in (x, y)]
    growth = np.asarray(result.data["largest_growth_rate"].values, dtype=float)
    whole = len(growth) == len(axes[0]) * len(axes[1]) and min(map(len, axes)) > 1
    if result.method != "grid" or not whole:
        return []
    grows = np.asarray(result.data["unstable_modes"].values) > 0
    if grows.all() or not grows.any():
        return []
    places = [np.searchsorted(axis, result.data[name].values) for axis, name in zip(axes, (x, y), strict=True)]
    table = np.full((len(axes[1]), len(axes[0])), np.nan)
    # Of an undamped problem what does not grow is zero but for rounding, which has no line.
    table[places[1], places[0]] = np.where(grows, growth, np.minimum(growth, 0.0))
    for line in _zero_lines(table):
        columns, rows = line.T
        across, up = _at(axes[0], columns, logarithmic(result, x)), _at(axes[1], rows, logarithmic(result, y))
        ax.plot(across, up, color=VERMILION, linewidth=1.8)
    return [Line2D([], [], color=VERMILION, label="no growth, interpolated in the grid")]


def _zero_lines(table: Array) -> list[Array]:
    """Lines (k, 2) along which a table is zero, in places of its columns and rows, straight in each cell."""
    aside = Figure().subplots()  # the contours of matplotlib want axes, and would change the limits of ours
    found = aside.contour(np.ma.masked_invalid(table), levels=[0.0]).allsegs[0]
    return [np.asarray(line) for line in found if len(line)]


def _at(axis: Array, places: Array, logarithms: bool) -> Array:
    """Values at places between those of an axis: even on the scale on which it is drawn."""
    if logarithms:
        return np.exp(np.interp(places, np.arange(len(axis)), np.log(axis)))
    return np.interp(places, np.arange(len(axis)), axis)

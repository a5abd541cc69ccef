"""Maps of a study over two of its parameters, a mark for each sample: where something grows, how fast, from which
friction on."""

from __future__ import annotations

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ..errors import AnalysisError
from ..typing import Array
from ..view.colours import VERMILION
from ..view.style import legend_above, panel, styled
from .plot_parts import key, logarithmic, over_two, rings, two
from .result import StudyResult, numbers

STABLE = "#DDDDDD"


@styled
def stability_map(result: StudyResult, x: str | None = None, y: str | None = None, *, ax: Axes | None = None) -> Figure:
    """Samples over two parameters (default: the first two that vary): frequency of the fastest growing mode as colour,
    grey where nothing grows; over a grid of these two with the line where growth begins. Of onsets: the critical
    friction coefficient as colour. Rings: solved in the full problem as well. Raises AnalysisError with fewer than two
    parameters."""
    if result.compute not in ("modes", "onsets"):
        raise AnalysisError(f"{result.compute} has neither growth rates nor onsets; a map is of modes or onsets")
    x, y = two(result, x, y)
    figure, ax = panel(ax, 4.6)
    at = [numbers(result, name) for name in (x, y)]
    onsets = result.compute == "onsets"
    shown = numbers(result, "critical_mu" if onsets else "largest_growth_frequency_hz")
    unstable = result.unstable
    known = unstable & np.isfinite(shown)
    label = "critical friction coefficient" if onsets else "frequency of the fastest growing mode [Hz]"
    size = mark_size(len(shown))
    ax.scatter(at[0][~unstable], at[1][~unstable], s=size, c=STABLE, marker="s", linewidths=0)
    if known.any():
        drawn = ax.scatter(at[0][known], at[1][known], s=size, c=shown[known], cmap="viridis", marker="s", linewidths=0)
        figure.colorbar(drawn, ax=ax, label=label, pad=0.02)
    handles: list[Artist] = [key("s", "nothing grows", STABLE)] if (~unstable).any() else []
    if not onsets:
        handles += boundary(result, ax, x, y)
    handles += rings(result, ax, at)
    over_two(result, ax, x, y)
    legend_above(ax, handles, columns=3)
    return figure


def mark_size(count: int) -> float:
    """Area [pt²] of a mark where there are so many."""
    return float(np.clip(6000 / max(count, 1), 4, 60))


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

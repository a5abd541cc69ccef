"""Figures of sensitivities: what each number does to each mode, what helps most, where damping lowers the onset."""

from __future__ import annotations

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import Normal, Stroke
from matplotlib.ticker import MaxNLocator

from ..digits import measured
from ..study.countermeasures import Countermeasures
from ..study.damping_map import DampingMap
from ..study.sensitivities import Sensitivities
from ..typing import Array
from .colours import BLUE, COLOURS, INK, ORANGE, VERMILION
from .style import legend_above, panel, styled
from .tables import significant

LEVELS = 12
MOST_BARS = 14
TEAL = "#2A788E"  # from the middle of viridis


@styled
def sensitivity_bars(result: Sensitivities, *, ax: Axes | None = None) -> Figure:
    """Change of growth rate per per cent of each number, one bar per mode; right of zero more of it makes it grow."""
    shown = [k for k in range(len(result.parameters)) if np.any(np.isfinite(result.growth_per_percent[k]))]
    modes = len(result.branch)
    figure, ax = panel(ax, 1.2 + 0.3 * max(1, len(shown)) * max(1.0, 0.55 * modes))
    height = 0.8 / max(modes, 1)
    for b in range(modes):
        at = np.arange(len(shown)) - 0.4 + (b + 0.5) * height
        label = f"mode {result.branch[b]}, {measured(result.frequency_hz[b], 0)} Hz"
        ax.barh(at, result.growth_per_percent[shown, b], height, color=COLOURS[b % len(COLOURS)], label=label)
    _names(ax, [result.parameters[k] for k in shown])
    ax.axvline(0.0, color=INK, linewidth=0.8)
    ax.set_xlabel("change of growth rate per per cent [1/s]")
    legend_above(ax, columns=3)
    return figure


@styled
def countermeasure_bars(result: Countermeasures, *, ax: Axes | None = None) -> Figure:
    """Growth rate removed per per cent of change, best first; the verified ones with what solving again gave: a
    diamond, or a cross at zero where growth became more, not less."""
    measures = result.measures[:MOST_BARS]
    figure, ax = panel(ax, 1.2 + 0.34 * max(1, len(measures)))
    at = np.arange(len(measures))
    worse = [bool(m.makes_unstable) for m in measures]
    colours = [ORANGE if bad else BLUE for bad in worse]
    ax.barh(at, [m.removed_per_percent for m in measures], 0.7, color=colours)
    checked = [(k, m.verified.removed / m.percent) for k, m in enumerate(measures) if m.verified is not None]
    less = [(k, v) for k, v in checked if v > 0]
    more = [k for k, v in checked if v <= 0]
    if less:
        ax.plot([v for _, v in less], [k for k, _ in less], "D", color=INK, ms=5)
    if more:
        ax.plot(np.full(len(more), 0.02), more, "X", color=INK, mec="white", ms=9, transform=ax.get_yaxis_transform())
    _names(ax, [m.words for m in measures])
    if measures:
        # Changes of a damping differ by decades from those of a mass.
        least = min(m.removed_per_percent for m in measures)
        ax.set_xscale("symlog", linthresh=least, linscale=0.5)
        ax.set_xlim(0.0, 1.6 * max([m.removed_per_percent for m in measures] + [v for _, v in checked]))
        # Zero would be written into the first decade's label.
        ax.set_xticks([t for t in ax.get_xticks() if t >= least])
    for k, measure in enumerate(measures):
        ax.text(1.01, k, significant(measure.removed_per_percent, 3), transform=ax.get_yaxis_transform(), va="center")
    ax.axvline(0.0, color=INK, linewidth=0.8)
    ax.set_xlabel("growth rate removed per per cent of change [1/s]")
    handles = [Line2D([], [], color=BLUE, linewidth=6, label="first order")]
    if any(worse):
        handles.append(Line2D([], [], color=ORANGE, linewidth=6, label="may make another mode unstable"))
    if less:
        handles.append(Line2D([], [], color=INK, marker="D", ms=5, linestyle="none", label="solved again"))
    if more:
        handles.append(
            Line2D([], [], color=INK, marker="X", ms=7, linestyle="none", label="made it worse")
        )
    legend_above(ax, handles, columns=2)
    return figure


@styled
def damping_map(result: DampingMap, *, ax: Axes | None = None) -> Figure:
    """The lowest onset over two damping values, hatched where more of one of them lowers it.

    A dashed line is where the onset is that without any damping; grey: nothing grows up to the largest μ. Rings: where
    the onset of a reduced model was solved again in the full problem.
    """
    figure, ax = panel(ax, 4.6)
    mu = np.ma.masked_invalid(result.onset_mu.T)
    ax.set_facecolor("#E6E6E6")
    ax.grid(False)
    handles: list[Artist] = []
    if mu.count():
        low, high = float(mu.min()), float(mu.max())
        levels = MaxNLocator(LEVELS).tick_values(low, high) if high > low else np.array([low, low + 1e-6])
        filled = ax.contourf(result.x_values, result.y_values, mu, levels=levels, cmap="viridis")
        figure.colorbar(filled, ax=ax, label="lowest onset μ", pad=0.02)
    if result.undamped_mu is not None and mu.count() and float(mu.min()) < result.undamped_mu < float(mu.max()):
        line = ax.contour(
            result.x_values, result.y_values, mu, levels=[result.undamped_mu], colors=INK, linestyles="--",
            linewidths=1.6, zorder=4,
        )  # fmt: skip
        # Dark on light and light on dark: it runs through all of the colours.
        line.set_path_effects([Stroke(linewidth=3.4, foreground="white"), Normal()])
        label = f"undamped onset, {result.undamped_mu:.4g}"
        handles.append(Line2D([], [], color=INK, linestyle="--", label=label))
    for lowers, slope, hatch, colour, name in (
        (result.more_x_lowers, result.slope_x, "////", VERMILION, result.x),
        (result.more_y_lowers, result.slope_y, "\\\\\\\\", "#FFFFFF", result.y),
    ):
        if lowers.any():
            _hatched(ax, result, np.where(lowers, slope, np.maximum(slope, 0.0)).T, hatch, colour)
            handles.append(Patch(facecolor=TEAL, edgecolor=colour, hatch=hatch, label=f"more {name} lowers it"))
    if result.confirmed:
        points = [c.x for c in result.confirmed], [c.y for c in result.confirmed]
        (rings,) = ax.plot(*points, "o", mfc="white", mec=INK, ms=6, clip_on=False, zorder=5)
        rings.set_label("solved again in the full problem")
        handles.append(rings)
    ax.set(xlabel=result.x, ylabel=result.y)
    for axis in (ax.xaxis, ax.yaxis):
        # A common power of ten would stand where the legend does.
        axis.set_major_formatter("{x:.3g}")
    # Paths are long: one to a line, or the legend is wider than the map.
    legend_above(ax, handles, columns=1, height=1.5)
    return figure


def _hatched(ax: Axes, result: DampingMap, slope: Array, hatch: str, colour: str) -> None:
    """Hatching where a slope (ny, nx) is negative, with a line around it, interpolated between the grid's points."""
    shown = np.ma.masked_invalid(slope)
    edge = 1e-6 * float(shown.min())
    levels = [2 * float(shown.min()), edge]
    filled = ax.contourf(result.x_values, result.y_values, shown, levels=levels, colors="none", hatches=[hatch])
    filled.set_edgecolor(colour)
    filled.set_linewidth(0.0)
    ax.contour(result.x_values, result.y_values, shown, levels=[edge], colors=colour, linewidths=1.2, linestyles="-")


def _names(ax: Axes, names: list[str]) -> None:
    ax.set_yticks(range(len(names)), names)
    ax.invert_yaxis()
    ax.grid(False, axis="y")

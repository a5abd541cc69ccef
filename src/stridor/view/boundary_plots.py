"""Figures of stability boundaries: curves coloured by frequency, and how many modes grow between them."""

from __future__ import annotations

import numpy as np
import scipy.ndimage as ndi
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patheffects import Normal, Stroke

from ..study.boundary_result import Boundary
from ..typing import Array, IntArray
from .colours import INK
from .style import legend_above, panel, styled

RASTER = 240  # points along each number in which regions are shaded
LEAST = 0.004  # of the rectangle: regions smaller than that bear no number
SHADES = ("#FFFFFF", "#F7E3D4", "#EFC9AE", "#E4AA86", "#D58A63", "#C26C46")


@styled
def stability_boundary(result: Boundary, *, ax: Axes | None = None) -> Figure:
    """Curves on which modes begin to grow, coloured by frequency, thick where nothing grows on one side. Regions are
    shaded by how many modes grow in them, which is written there. Rings: solved again in the full problem."""
    figure, ax = panel(ax, 4.8)
    ax.grid(False)
    _regions(ax, result)
    handles: list[Artist] = []
    pieces, values, widths = _pieces(result)
    if pieces:
        lines = LineCollection(pieces, cmap="viridis", linewidths=widths, capstyle="round", zorder=4)
        lines.set_array(values)
        lines.set_path_effects([Stroke(linewidth=3.6, foreground="white"), Normal()])
        if np.ptp(values) <= 1e-9 * max(float(np.abs(values).max()), 1.0):
            middle = float(values[0])
            lines.set_clim(0.99 * middle, 1.01 * middle + 1e-9)
        ax.add_collection(lines)
        figure.colorbar(lines, ax=ax, label="frequency [Hz]", pad=0.02)
        handles.append(Line2D([], [], color=INK, lw=2.6, label="nothing grows on one side"))
        if any(np.any(~curve.outer) for curve in result.curves):
            handles.append(Line2D([], [], color=INK, lw=1.2, label="others grow on both sides"))
    if result.confirmed:
        points = [c.x for c in result.confirmed], [c.y for c in result.confirmed]
        (rings,) = ax.plot(*points, "o", mfc="white", mec=INK, ms=5, clip_on=False, zorder=5)
        rings.set_label("solved again in the full problem")
        handles.append(rings)
    ax.set(xlabel=result.x, ylabel=result.y, xlim=result.x_range, ylim=result.y_range)
    for axis in (ax.xaxis, ax.yaxis):
        # A common power of ten would stand where the legend does.
        axis.set_major_formatter("{x:.4g}")
    if handles:
        legend_above(ax, handles, columns=2)
    return figure


def _pieces(result: Boundary) -> tuple[list[Array], Array, Array]:
    """Straight pieces (2, 2) of all curves, their frequencies [Hz] and widths [pt]."""
    pieces, values, widths = list[Array](), list[Array](), list[Array]()
    for curve, (x, y, frequency) in zip(result.curves, result.polylines(), strict=True):
        points = np.stack([x, y], axis=1)
        pieces += [points[k : k + 2] for k in range(len(points) - 1)]
        values.append(0.5 * (frequency[1:] + frequency[:-1]))
        fine = (len(points) - 1) // max(len(curve.x) - 1, 1)
        widths.append(np.repeat(np.where(curve.outer[:-1], 2.6, 1.2), fine))
    return pieces, np.concatenate(values) if values else np.zeros(0), np.concatenate(widths) if widths else np.zeros(0)


def _regions(ax: Axes, result: Boundary) -> None:
    """Shade what grows, and write how many modes do."""
    if not result.counted:
        return
    edges = [np.linspace(*ends, RASTER + 1) for ends in (result.x_range, result.y_range)]
    xs, ys = (0.5 * (e[1:] + e[:-1]) for e in edges)
    table = result.unstable_modes_over(xs, ys)
    most = min(max(int(table.max()), 1), len(SHADES) - 1)
    shades = BoundaryNorm(np.arange(-0.5, most + 1), most + 1), ListedColormap(SHADES[: most + 1])
    ax.pcolormesh(*edges, np.minimum(table.T, most), norm=shades[0], cmap=shades[1], rasterized=True, zorder=1)
    for number in np.unique(table).tolist():
        _numbered(ax, (xs, ys), table == number, number)


def _numbered(ax: Axes, grid: tuple[Array, Array], where: Array, number: int) -> None:
    """The number in each region (nx, ny), where that is widest."""
    names, count = ndi.label(where)
    for name in range(1, count + 1):
        region: IntArray = np.asarray(names == name)
        if region.mean() < LEAST:
            continue
        depth = ndi.distance_transform_edt(np.pad(region, 1))[1:-1, 1:-1]
        i, j = (int(k) for k in np.unravel_index(int(np.argmax(depth)), depth.shape))
        text = ax.text(grid[0][i], grid[1][j], f"{number}", ha="center", va="center", color=INK, fontsize=11, zorder=6)
        text.set_path_effects([Stroke(linewidth=2.5, foreground="white"), Normal()])

"""Figures of stability boundaries: curves coloured by frequency, and how many modes grow between them."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

import numpy as np
import scipy.ndimage as ndi
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import Normal, Stroke

from ..case import loads
from ..case.units import FRICTION, unit_at
from ..errors import CaseError
from ..study.boundary_result import Boundary
from ..typing import Array, BoolArray
from .colours import FAINT, INK
from .modal_plots import MU
from .style import legend_above, panel, root_figure, styled

RASTER = 240  # points along each number in which regions are shaded
CLEAR = 7.0  # [pt] about the middle of a number: half of two digits, and of the line beside them
RING = 3.0  # [pt]: radius of a ring
UNKNOWN, HATCH = "#E3E3E3", 6 * "/"
SHADES = ("#FFFFFF", "#F7E3D4", "#EFC9AE", "#E4AA86", "#D58A63", "#C26C46")


@styled
def stability_boundary(result: Boundary, *, ax: Axes | None = None) -> Figure:
    """Curves on which modes begin to grow, coloured by frequency, thick where nothing grows on one side. Regions are
    shaded by how many modes grow in them, which is written where there is room for it, else in the legend;
    hatched where growing modes pass the highest frequency, and how many grow is not known. Rings: solved again in the
    full problem."""
    figure, ax = panel(ax, 4.8)
    ax.grid(False)
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
    handles += _regions(ax, result)
    ax.set(xlabel=_label(result, result.x), ylabel=_label(result, result.y), xlim=result.x_range, ylim=result.y_range)
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


def _regions(ax: Axes, result: Boundary) -> list[Artist]:
    """Shade what grows, and write how many modes do where there is room for it; keys of the shades that nowhere have
    their number."""
    if not result.counted:
        return []
    edges = [np.linspace(*ends, RASTER + 1) for ends in (result.x_range, result.y_range)]
    xs, ys = (0.5 * (e[1:] + e[:-1]) for e in edges)
    table, known = result.shading(xs, ys)
    most = min(max(int(table.max()), 1), len(SHADES) - 1)
    shades = BoundaryNorm(np.arange(-0.5, most + 1), most + 1), ListedColormap(SHADES[: most + 1])
    shown = np.ma.masked_array(np.minimum(table, most), ~known)
    ax.pcolormesh(*edges, shown.T, norm=shades[0], cmap=shades[1], rasterized=True, zorder=1)
    paper = _paper(ax, (xs, ys), result)
    numbers = np.unique(table[known]).tolist()
    bare = [number for number in numbers if not _numbered(ax, paper, (table == number) & known, number)]
    keys: list[Artist] = [
        Patch(facecolor=SHADES[min(max(number, 0), most)], edgecolor=FAINT, label=f"{number} grow{'s' * (number == 1)}")
        for number in bare
    ]
    if not known.all():
        ax.contourf(xs, ys, ~known.T, levels=[0.5, 1.5], colors=[UNKNOWN], hatches=[HATCH], zorder=1.5)
        keys.append(Patch(facecolor=UNKNOWN, hatch=HATCH, edgecolor=FAINT, label="how many grow is not known"))
    return keys


@dataclass(frozen=True)
class _Paper:
    """Points xs (nx,), ys (ny,) of a raster, the steps between them on paper [pt], and how far from each (nx, ny) it
    is to the nearest ring."""

    xs: Array
    ys: Array
    steps: tuple[float, float]
    free: Array

    def room(self, region: BoolArray) -> Array:
        """How far (nx, ny) it is [pt] from each point of a region to what lies about it: its edge, and rings in it."""
        # A frame of other regions: letters must not lie across the axes either.
        far = ndi.distance_transform_edt(np.pad(region, 1), sampling=self.steps)[1:-1, 1:-1]
        return np.minimum(far, self.free)


def _paper(ax: Axes, grid: tuple[Array, Array], result: Boundary) -> _Paper:
    frame = ax.get_position()
    width, height = (72 * root_figure(ax).get_size_inches() * (frame.width, frame.height)).tolist()
    steps = width / len(grid[0]), height / len(grid[1])
    free = np.full((len(grid[0]), len(grid[1])), np.inf)
    for ring in result.confirmed:
        across = width * (grid[0] - ring.x) / (result.x_range[1] - result.x_range[0])
        up = height * (grid[1] - ring.y) / (result.y_range[1] - result.y_range[0])
        free = np.minimum(free, np.maximum(np.hypot(across[:, None], up[None, :]) - RING, 0.0))
    return _Paper(*grid, steps, free)


def _numbered(ax: Axes, paper: _Paper, where: BoolArray, number: int) -> bool:
    """The number in each region (nx, ny) that is wide enough for it, where that is widest; whether one is."""
    names, count = ndi.label(where)
    written = False
    for name in range(1, count + 1):
        room = paper.room(np.asarray(names == name))
        i, j = (int(k) for k in np.unravel_index(int(np.argmax(room)), room.shape))
        if room[i, j] < CLEAR:
            continue
        at = float(paper.xs[i]), float(paper.ys[j])
        text = ax.text(*at, f"{number}", ha="center", va="center", color=INK, fontsize=11, zorder=6)
        text.set_path_effects([Stroke(linewidth=2.5, foreground="white"), Normal()])
        written = True
    return written


def _label(result: Boundary, path: str) -> str:
    """A number of the case with its unit, which the case that the result keeps tells."""
    text = result.provenance.get("case", "")
    unit = ""
    if text:
        with suppress(CaseError):
            unit = unit_at(loads(text), path)
    return f"{path} [{unit}]" if unit not in ("", "1") else MU if path == FRICTION else path

"""Figures of meshed bodies: the model as it stands and modes as deformed, coloured surfaces.

In the plane the cells are drawn; in space the outer facets in parallel projection, so that plane axes hold both.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import Normalize, PowerNorm, to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.tri import Triangulation

from ..errors import CaseError
from ..system import System
from ..typing import Array, ComplexArray
from .colours import GREY, INK
from .depth_picture import Camera, sharp_edges, surface_picture
from .skin import (
    EDGES_UP_TO,
    VIEW,
    Skin,
    at_largest,
    body_colour,
    concentrated,
    distinct,
    drawn_scale,
    facet_edges,
    mode_title,
    skin_of,
)
from .style import WIDTH, legend_above, new_figure, root_figure, styled
from .units import Unit, extent, length_unit

AMPLITUDES = "viridis"
MASS = 46.0  # of the dot of a point mass [square points]
PIXELS = 1100  # of a solid in space, along the longer side


@styled
def mesh(system: System, *, ax: Axes | None = None, view: tuple[float, float] = VIEW) -> Figure:
    """The model at rest, each body in its colour, with the slave nodes of the contacts (in space also hidden ones).

    ``view``: elevation and azimuth of the line of sight [degrees], for systems in space. Raises CaseError for a system
    that has nothing to draw, and for axes that are not plane.
    """
    skin = skin_of(system)
    camera = _camera(skin, view)
    shown = _shown(skin.points, camera)
    unit = length_unit(extent(skin.points))
    figure, ax = _axes(ax, shown)
    shades = np.array([to_rgb(body_colour(k)) for k in range(len(skin.names))])
    pale = 0.65 * shades + 0.35
    nodes = system.contact_nodes()
    if camera is None:
        _cells(ax, skin, pale[skin.body], unit[0])
    else:
        _picture(ax, skin, shown, np.repeat(pale[skin.body][:, None], 4, axis=1), shown, unit[0])
    _lines(ax, skin, shown, shades[skin.segment_body], unit[0])
    at = _shown(nodes.position, camera) / unit[0]
    ax.scatter(at[:, 0], at[:, 1], s=14.0 if nodes.count < 100 else 5.0, color=INK, linewidths=0, zorder=5)
    _lengths(ax, camera, unit)
    _legend(ax, skin, contact_nodes=nodes.count)
    return figure


@styled
def mode_shape(
    system: System,
    vector: Array | ComplexArray,
    *,
    ax: Axes | None = None,
    frequency_hz: float | None = None,
    growth_rate: float | None = None,
    scale: float | None = None,
    phase: float = 0.0,
    view: tuple[float, float] = VIEW,
) -> Figure:
    """The displacement Re(û e^{jφ}) of a vector û (n,), coloured by its magnitude, with the outline at rest.

    ``phase`` φ [rad] counts from the instant of largest motion, whatever the phase of the vector. Colours are relative
    to the largest amplitude of a cycle. ``scale`` multiplies displacements, otherwise the drawing is scaled to be seen.
    ``frequency_hz`` and ``growth_rate`` [1/s] go into the title; ``view`` is elevation and azimuth of the line of sight
    [degrees]. Raises CaseError for a vector that does not fit, and for axes that are not plane.
    """
    skin = skin_of(system, vector)
    title = mode_title(frequency_hz, growth_rate)
    return draw_frame(skin, phase=phase, scale=scale, view=view, title=title, ax=ax)


def draw_frame(
    skin: Skin,
    *,
    phase: float,
    scale: float | None,
    view: tuple[float, float],
    title: str,
    ax: Axes | None = None,
    pixels: int = PIXELS,
) -> Figure:
    """A moving skin at one phase [rad], ``pixels`` wide in space.

    The axes hold the whole cycle, so that frames of a film fit each other.
    """
    camera = _camera(skin, view)
    deformed, size = deformed_at(skin, scale=scale, phase=phase)
    rest, moved = _shown(skin.points, camera), _shown(deformed, camera)
    reach = np.concatenate([_shown(points, camera) for points in _swept(skin, scale)])
    unit = length_unit(extent(skin.points))
    figure, ax = _axes(ax, reach)
    colours = colormaps[AMPLITUDES]
    # Of one moving corner the rest would be one dark colour: roots show small amplitudes, too.
    bent = concentrated(skin)
    size = np.sqrt(size) if bent else size
    if camera is None:
        _smooth(ax, skin, deformed, size, unit[0])
        outline = np.concatenate([skin.edges, skin.segments])
    else:
        _picture(ax, skin, moved, colours(size)[:, :3], reach, unit[0], pixels)
        outline = np.concatenate([sharp_edges(skin.points, skin.facets), skin.segments])
    _masses_at_rest(ax, skin, rest, unit[0])
    _lines(ax, skin, moved, colours(size[skin.segments].mean(axis=1))[:, :3], unit[0])
    pieces = list(rest[outline, :2] / unit[0])
    ax.add_collection(LineCollection(pieces, colors=GREY, linewidths=0.8, linestyles=":", alpha=0.8, zorder=2.5))
    ax.update_datalim(reach[:, :2] / unit[0])
    _lengths(ax, camera, unit)
    ax.plot([], [], color=GREY, linestyle=":", linewidth=1.2, label="at rest")
    legend_above(ax)
    shown = ScalarMappable(PowerNorm(0.5, 0.0, 1.0) if bent else Normalize(0.0, 1.0), colours)
    bar = figure.colorbar(
        shown, ax=ax, shrink=0.8, pad=0.02, panchor=False, anchor=(0.0, 0.5), label="|u| / largest amplitude"
    )
    bar.outline.set_visible(False)  # pyright: ignore[reportCallIssue]
    if bent:
        bar.set_ticks([0.0, 0.01, 0.05, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0])
    if title:
        # Above the legend, which stands above the frame.
        ax.set_title(title, pad=22.0)
    return figure


def _swept(skin: Skin, scale: float | None) -> list[Array]:
    """Points (k, d) at rest and at the extremes of a cycle."""
    return [skin.points, *(deformed_at(skin, scale=scale, phase=k * np.pi / 4)[0] for k in range(8))]


def deformed_at(skin: Skin, *, scale: float | None, phase: float) -> tuple[Array, Array]:
    """Points (k, d) [m] of a moving skin as drawn at a phase [rad], and |u| (k,) relative to the largest amplitude."""
    rotated, largest = at_largest(skin.motion)
    moved = (rotated * np.exp(1j * phase)).real
    size = np.linalg.norm(moved, axis=1) / (largest or 1.0)
    return skin.points + drawn_scale(skin, largest, scale) * moved, size


def _camera(skin: Skin, view: tuple[float, float]) -> Camera | None:
    return Camera.at(*view) if skin.dimension == 3 else None


def _shown(points: Array, camera: Camera | None) -> Array:
    """Coordinates on paper, in space with the distance towards the eye as a third one."""
    return points if camera is None else camera.project(points)


def _axes(ax: Axes | None, shown: Array) -> tuple[Figure, Axes]:
    """The given axes, else new ones as high as the drawing needs."""
    if ax is not None:
        if ax.name == "3d":
            raise CaseError("ax", "axes of projection 3d", "plane axes: solids are drawn as seen from `view`")
        return root_figure(ax), ax
    wide, high = np.ptp(shown[:, :2], axis=0)
    figure = new_figure(float(np.clip((WIDTH - 1.2) * high / max(wide, 1e-12) + 0.9, 2.2, 6.0)))
    ax = figure.subplots()
    ax.set_anchor("W")  # title and legend of a slender model need the room at its right
    return figure, ax


def _picture(
    ax: Axes, skin: Skin, seen: Array, colours: Array, reach: Array, unit: float, pixels: int = PIXELS
) -> None:
    """The facets as they hide each other, as an image between the extremes of ``reach``."""
    low, high = reach[:, :2].min(axis=0), reach[:, :2].max(axis=0)
    room = 0.01 * float((high - low).max())
    low, high = low - room, high + room
    few = len(skin.facets) <= EDGES_UP_TO
    image = surface_picture(seen, skin.facets, colours, low, high, pixels=pixels, lines=few)
    # Whole pixels: the image may reach a little further than asked for.
    pixel = float((high - low).max()) / max(image.shape[:2])
    right, top = low + pixel * np.array(image.shape[1::-1])
    sides = (low[0] / unit, right / unit, low[1] / unit, top / unit)
    ax.imshow(image, extent=sides, origin="upper", interpolation="antialiased", zorder=2)


def _cells(ax: Axes, skin: Skin, colours: Array, unit: float) -> None:
    few = len(skin.facets) <= EDGES_UP_TO
    edge = 0.75 * colours if few else colours
    cells = PolyCollection(
        list(skin.points[skin.facets] / unit),
        facecolors=list(colours),
        edgecolors=list(edge),
        linewidths=0.4 if few else 0.1,
        rasterized=not few,
        zorder=1.5,
    )
    ax.add_collection(cells)


def _smooth(ax: Axes, skin: Skin, points: Array, values: Array, unit: float) -> None:
    """Values at the nodes as smooth colours on the cells, with the mesh over them where it is coarse enough."""
    if not len(skin.facets):
        return
    halves = np.concatenate([skin.facets[:, [0, 1, 2]], skin.facets[:, [0, 2, 3]]])
    halves = halves[halves[:, 1] != halves[:, 2]]
    x, y = points.T / unit
    triangles = Triangulation(x, y, halves)
    colours: Any = {"cmap": AMPLITUDES, "vmin": 0.0, "vmax": 1.0}
    ax.tripcolor(triangles, values, shading="gouraud", rasterized=True, zorder=2, **colours)
    if len(skin.facets) <= EDGES_UP_TO:
        edges = list(points[distinct(facet_edges(skin.facets))[0]] / unit)
        ax.add_collection(LineCollection(edges, colors="white", linewidths=0.35, alpha=0.45, zorder=2.2))
    ax.add_collection(LineCollection(list(points[skin.edges] / unit), colors=INK, linewidths=0.8, zorder=2.3))


def _lines(ax: Axes, skin: Skin, shown: Array, colours: Array, unit: float) -> None:
    """Lines, and point masses as dots, before all that is behind them."""
    if not len(skin.segments):
        return
    pieces = list(shown[skin.segments, :2] / unit)
    ax.add_collection(LineCollection(pieces, colors=list(colours), linewidths=3.2, capstyle="round", zorder=3))
    if len(skin.lone):
        at = shown[skin.segments[skin.lone, 0], :2] / unit
        ax.scatter(at[:, 0], at[:, 1], s=MASS, c=list(colours[skin.lone]), edgecolors=INK, linewidths=0.8, zorder=4)


def _masses_at_rest(ax: Axes, skin: Skin, rest: Array, unit: float) -> None:
    """Where point masses are at rest."""
    if len(skin.lone):
        at = rest[skin.segments[skin.lone, 0], :2] / unit
        ax.scatter(at[:, 0], at[:, 1], s=MASS, c="none", edgecolors=GREY, linewidths=0.8, alpha=0.8, zorder=2.5)


def _lengths(ax: Axes, camera: Camera | None, unit: Unit) -> None:
    """Equal lengths; in the plane axes in a unit, in space a bar of a round length and where x, y and z point."""
    ax.set_aspect("equal", adjustable="box")
    ax.margins(0.05)
    ax.autoscale_view()
    ax.grid(False)
    if camera is None:
        ax.set(xlabel=f"x [{unit[1]}]", ylabel=f"y [{unit[1]}]")
        return
    ax.set_axis_off()
    (left, right), (bottom, top) = ax.get_xlim(), ax.get_ylim()
    length = _round_length(0.22 * (right - left))
    base = bottom - 0.04 * (top - bottom)
    ax.plot([right - length, right], [base, base], color=INK, linewidth=2.0, solid_capstyle="butt")
    ax.annotate(
        f"{length:g} {unit[1]}", (right - length / 2, base), xytext=(0, -4), textcoords="offset points", ha="center",
        va="top", fontsize=8.5,
    )  # fmt: skip
    arm = 0.07 * max(right - left, top - bottom)
    origin = np.array([left + 1.6 * arm, base])
    for axis, name in zip(np.eye(3), "xyz", strict=True):
        tip = arm * camera.project(axis[None])[0, :2]
        ax.plot(*np.column_stack([origin, origin + tip]), color=GREY, linewidth=1.2)
        ax.annotate(name, tuple(origin + 1.35 * tip), ha="center", va="center", color=GREY, fontsize=8.5)


def _round_length(most: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is not above ``most``."""
    power = 10.0 ** np.floor(np.log10(max(most, 1e-12)))
    return float(max(f * power for f in (1, 2, 5) if f * power <= most * (1 + 1e-12)))


def _legend(ax: Axes, skin: Skin, *, contact_nodes: int) -> None:
    handles: list[Any] = []
    meshed = int(skin.body.max(initial=-1)) + 1
    masses = set(skin.segment_body[skin.lone].tolist())
    for k, name in enumerate(skin.names):
        colour = body_colour(k)
        pale = tuple(0.65 * np.array(to_rgb(colour)) + 0.35)
        handle: Any = Patch(facecolor=pale, edgecolor=colour, label=name)
        if k in masses:
            handle = Line2D([], [], color=colour, marker="o", mec=INK, ms=6.5, linestyle="none", label=name)
        elif k >= meshed:
            handle = Line2D([], [], color=colour, linewidth=3, label=name)
        handles.append(handle)
    if contact_nodes:
        text = f"{contact_nodes} contact node{'s' if contact_nodes > 1 else ''}"
        handles.append(Line2D([], [], color=INK, marker="o", ms=3.5, linestyle="none", label=text))
    legend_above(ax, handles)

"""Figures of shapes: the model as it stands, modes and operating shapes as deformed lines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..case import Case
from ..case.bodies import BeamBody
from ..case.points import PointRef
from ..system import System
from ..typing import Array, ComplexArray
from .colours import COLOURS, GREEN, GREY, INK, PURPLE, VERMILION
from .style import legend_above, new_figure, panel, root_figure, styled
from .units import length_unit

Shape = Mapping[str, ComplexArray]
AMPLITUDE = 0.11  # of the model's extent: how far the largest motion is drawn
ARROWS = 16  # along a line, at most


@styled
def model_plot(system: System, case: Case | None = None, *, ax: Axes | None = None) -> Figure:
    """The model as it stands: lines, point masses, contacts, and with the case its supports, loads and watched
    points."""
    figure, ax = panel(ax, 3.4)
    reach = _extent(system)
    unit, its_name = length_unit(reach)
    for index, line in enumerate(system.lines):
        colour = COLOURS[index % len(COLOURS)]
        ax.plot(*(line.coordinates.T / unit), color=colour, linewidth=3.5, solid_capstyle="butt", zorder=2)
        middle = line.coordinates[len(line.coordinates) // 2] / unit
        # Beside the line, not on it: across its direction.
        across = _across(line.coordinates)
        ax.annotate(
            line.name,
            (middle[0], middle[1]),
            xytext=(14 * across[0], 14 * across[1]),
            textcoords="offset points",
            color=colour,
            ha="left" if across[0] > 0.5 else "center",
            va="center",
            fontweight="bold",
        )
    masses = [solid for solid in system.solids if not solid.cells.keys() - {"vertex"}]
    for index, mass in enumerate(masses, start=len(system.lines)):
        colour = COLOURS[index % len(COLOURS)]
        at = mass.points[0] / unit
        ax.plot(*at, "o", color=colour, mec=INK, ms=6.5, mew=0.8, zorder=4)
        ax.annotate(
            mass.name,
            (at[0], at[1]),
            xytext=(8, 0),
            textcoords="offset points",
            color=colour,
            va="center",
            fontweight="bold",
        )
    if case is not None:
        _draw_case(ax, case, reach, unit)
    _mark_contacts(ax, system, unit, named=True)
    _lengths(ax, its_name)
    ax.margins(0.2, 0.12)
    return figure


@styled
def mode_shape(
    system: System, shape: Shape, *, velocity: bool = False, title: str | None = None, ax: Axes | None = None
) -> Figure:
    """A complex shape, (k, 2) by line, where its motion is largest, thin a quarter of a period later.

    Dotted: the lines at rest. velocity draws arrows, for shapes that are velocities.
    """
    figure, ax = panel(ax, 3.4)
    _draw_shape(ax, system, at_best_phase(shape), arrows=velocity)
    legend_above(ax)
    if title:
        ax.set_title(title)
    return figure


@styled
def shapes_side_by_side(
    system: System,
    shapes: Sequence[tuple[str, Shape, bool]],
    *,
    axes: Sequence[Axes] | None = None,
) -> Figure:
    """Shapes beside each other, each (title, shape, whether a velocity), turned to agree with the first."""
    if axes is None:
        figure = new_figure(3.0)
        axes = list(figure.subplots(1, len(shapes), sharex=True, sharey=True, squeeze=False)[0])
    else:
        figure = root_figure(axes[0])
    first: dict[str, ComplexArray] | None = None
    for ax, (title, shape, velocity) in zip(axes, shapes, strict=True):
        drawn = at_best_phase(shape)
        if first is not None and _product(first, drawn) < 0:
            drawn = {name: -values for name, values in drawn.items()}
        first = first or drawn
        _draw_shape(ax, system, drawn, arrows=velocity)
        ax.set_title(title, fontsize=9.5)
    for ax in list(axes)[1:]:
        ax.set_ylabel("")
    handles, _ = axes[0].get_legend_handles_labels()
    figure.legend(handles=handles, loc="outside lower center", ncols=4)
    return figure


def _product(first: Mapping[str, ComplexArray], second: Mapping[str, ComplexArray]) -> float:
    return sum(float(np.sum(first[n].real * second[n].real)) for n in second if n in first)


def at_best_phase(shape: Shape) -> dict[str, ComplexArray]:
    """A complex shape (k, 2) by line, turned so that its real part is as large as can be, and scaled to one.

    The imaginary part is the motion a quarter of a period earlier, none where all points move in phase.
    """
    everything = np.concatenate([np.ravel(values) for values in shape.values()] or [np.zeros(1)])
    turn = np.exp(-0.5j * np.angle(np.sum(everything**2)))
    size = float(np.abs(everything).max(initial=0.0)) or 1.0
    return {name: np.asarray(values) * turn / size for name, values in shape.items()}


def _draw_shape(ax: Axes, system: System, motion: Mapping[str, ComplexArray], *, arrows: bool) -> None:
    unit, its_name = length_unit(_extent(system))
    scale = AMPLITUDE * _extent(system) / unit
    for index, line in enumerate(system.lines):
        if line.name not in motion:
            continue
        rest = line.coordinates / unit
        moved, later = rest + scale * motion[line.name].real, rest - scale * motion[line.name].imag
        colour = COLOURS[index % len(COLOURS)]
        ax.plot(*rest.T, color=GREY, linestyle=":", linewidth=1.2, zorder=2)
        ax.plot(*later.T, color=colour, linewidth=0.9, alpha=0.6, zorder=2.8)
        ax.plot(*moved.T, color=colour, linewidth=2.2, zorder=3, label=line.name)
        if arrows:
            some = np.unique(np.linspace(0, len(rest) - 1, min(ARROWS, len(rest))).astype(int))
            ax.quiver(
                *rest[some].T,
                *(scale * motion[line.name][some].real).T,
                angles="xy",
                scale_units="xy",
                scale=1,
                color=colour,
                width=0.004,
                alpha=0.75,
                zorder=2.5,
            )
    _mark_contacts(ax, system, unit, named=False)
    _lengths(ax, its_name)
    ax.plot([], [], color=GREY, linewidth=0.9, label="a quarter of a period later")
    ax.plot([], [], color=GREY, linestyle=":", linewidth=1.2, label="at rest")
    ax.margins(0.06, 0.1)


def _draw_case(ax: Axes, case: Case, extent: float, unit: float) -> None:
    reach = extent / unit
    for support in case.supports.values():
        at = _position(case, support.at, unit)
        if at is None:
            continue
        ax.plot(*at, "s", mfc="white", mec=INK, ms=8, mew=1.4, zorder=4)
        held = ", ".join({"rotation": "φ"}.get(d, d) for d in support.fixed)
        ax.annotate(
            f"holds {held}",
            (at[0], at[1]),
            xytext=(-9, 0),
            textcoords="offset points",
            ha="right",
            va="center",
            fontsize=8.5,
        )
        speed = np.array([support.velocity.get("x", 0.0), support.velocity.get("y", 0.0)])
        if np.any(speed):
            beside = 0.06 * reach * np.array([-speed[1], speed[0]]) / np.hypot(*speed)
            side = beside if beside[1] >= 0 else -beside
            _arrow(ax, at + side, speed, 0.16 * reach, GREEN, f"{np.hypot(*speed):g} m/s", at_head=False)
    for load in case.loads.values():
        at = None if load.at is None else _position(case, load.at, unit)
        if any(load.force) and at is not None:
            size = f"{np.linalg.norm(load.force):g} N"
            _arrow(ax, at, np.array(load.force), 0.16 * reach, VERMILION, size, at_head=True)
    for watched in case.temporal.watch:
        at = _position(case, watched, unit)
        if at is None:
            continue
        ax.plot(*at, "o", mfc="white", mec=PURPLE, ms=4.5, mew=1.2, zorder=5)
    if case.temporal.watch:
        ax.plot([], [], "o", mfc="white", mec=PURPLE, ms=4.5, mew=1.2, label="watched points")
        legend_above(ax)


def _arrow(ax: Axes, at: Array, along: Array, length: float, colour: str, text: str, *, at_head: bool) -> None:
    """An arrow along a direction that ends at a point (``at_head``) or starts there, with its name."""
    unit = along / np.hypot(*along)
    tail, head = (at - length * unit, at) if at_head else (at, at + length * unit)
    style = {"arrowstyle": "-|>", "color": colour, "lw": 1.8, "shrinkA": 6, "shrinkB": 6}
    ax.annotate("", (head[0], head[1]), xytext=(tail[0], tail[1]), arrowprops=style, zorder=5)
    end = tail if at_head else head
    side = (8, 2) if abs(unit[1]) > 0.5 else (0, 8)
    ax.annotate(
        text,
        (end[0], end[1]),
        xytext=side,
        textcoords="offset points",
        color=colour,
        fontsize=8.5,
        ha="left" if side[0] else "center",
        va="bottom",
    )
    ax.plot(end[0], end[1], alpha=0)  # counts for the limits of the axes


def _position(case: Case, reference: str, unit: float) -> Array | None:
    """Coordinates (2,) in a unit [m] of a point; None for a boundary, which is not one place."""
    point = case.location(reference)
    if not isinstance(point, PointRef):
        return None
    body = case.bodies[point.body]
    coordinates = body.coordinates(point.distance) if isinstance(body, BeamBody) else point.coordinates
    return None if coordinates is None else np.array(coordinates) / unit


def _mark_contacts(ax: Axes, system: System, unit: float, *, named: bool) -> None:
    for contact in system.contacts:
        at = contact.slave_position / unit
        ax.plot(*at, "o", mfc="none", mec=INK, ms=10, mew=1.2, zorder=4)
        if named:
            below = -13 * np.sign(contact.normal)
            ax.annotate(
                contact.name,
                (at[0], at[1]),
                xytext=(0, below[1] or -13),
                textcoords="offset points",
                ha="center",
                va="center",
                fontweight="bold",
            )


def _across(coordinates: Array) -> Array:
    along = coordinates[-1] - coordinates[0]
    unit = along / max(float(np.hypot(*along)), 1e-300)
    normal = np.array([unit[1], -unit[0]])
    return normal if normal[1] <= 0 and normal[0] >= -0.5 else -normal


def _extent(system: System) -> float:
    """Largest side of the box around all lines [m]."""
    if not system.lines:
        return 1.0
    everything = np.concatenate([line.coordinates for line in system.lines])
    return float(np.ptp(everything, axis=0).max()) or 1.0


def _lengths(ax: Axes, unit: str) -> None:
    ax.set_aspect("equal", adjustable="box")
    ax.set(xlabel=f"x [{unit}]", ylabel=f"y [{unit}]")
    ax.grid(False)

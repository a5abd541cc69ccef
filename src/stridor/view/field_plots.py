"""Figures of a contact over many nodes: where and when it sticks, slips and opens, and where friction feeds a mode."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.tri import Triangulation
from scipy.spatial import cKDTree

from ..errors import CaseError
from ..sliding import full_motion
from ..system import System
from ..temporal.node_history import NodeHistory
from ..temporal.trajectory import STATUS
from ..typing import Array, BoolArray, IntArray
from .colours import BLUE, GREY, INK, VERMILION
from .interface_columns import NodeColumns, arc_length, columns_along, seen_from_normal
from .sliding_marks import mark_on_line, mark_on_patch
from .style import WIDTH, largest, legend_above, panel, styled, zero_line
from .units import Unit, extent, gap_unit, length_unit, most, pressure_unit, time_unit

Quantity = Literal["pressure", "status", "slip", "gap"]
QUANTITIES = ("pressure", "status", "slip", "gap")
MAP_COLOURS = {"separation": VERMILION, "stick": BLUE, "slip": "#EFE6C4"}  # strong enough to be seen as thin stripes
ROWS = 1500  # of a space–time picture, at most
SEPARATION, STICK, SLIP = range(3)


@styled
def contact_map(
    history: NodeHistory,
    contact: str | None = None,
    *,
    quantity: Quantity = "pressure",
    along: Array | tuple[float, ...] | None = None,
    about: Array | tuple[float, ...] | None = None,
    start: float | None = None,
    end: float | None = None,
    ax: Axes | None = None,
) -> Figure:
    """Space–time picture of a contact: position along the interface across, time from ``start`` to ``end`` [s] upwards.

    ``contact``: its name, otherwise the first. ``quantity``: "pressure" [MPa] (normal force [N] for point contacts),
    "status", "slip" (velocity along the first tangent [m/s], signed) or "gap" [µm]; much smaller pressures are in Pa,
    larger gaps in mm or m. In space the nodes fall in columns by their position: along the direction of sliding, unless
    ``along`` gives another direction or ``about`` a point to take the angle about; a column shows its mean pressure,
    mean slip, mean gap and most frequent status.

    Where there are more than 1500 records a row stands for several: mean pressure and slip, largest gap, and of the
    statuses the one that is rarest in the picture, so that no short event is hidden.
    Raises CaseError for names, quantities and times that do not exist.
    """
    if quantity not in QUANTITIES:
        raise CaseError("quantity", quantity, f"unknown; known: {', '.join(QUANTITIES)}")
    name, nodes = chosen_nodes(history, contact)
    records = chosen_records(history.time, start, end)
    columns = columns_along(
        history.position[nodes],
        history.tangents[nodes],
        along=None if along is None else np.asarray(along, dtype=float),
        about=None if about is None else np.asarray(about, dtype=float),
    )
    time, values = map_values(history, nodes, records, columns, quantity)
    figure, ax = panel(ax, 4.2)
    first, last = (float(t) for t in history.time[records][[0, -1]])
    unit, its_name = time_unit(last - first, last)
    sides = _time_edges(time / unit, np.array([first, last]) / unit)
    if quantity == "status":
        _status_map(ax, columns, sides, values)
    else:
        area = bool(np.all(np.isfinite(history.area[nodes])))
        _value_map(figure, ax, columns, sides, values, quantity, area=area)
    ax.set(xlabel=columns.label, ylabel=f"time [{its_name}]")
    _headed(ax, f"contact {name}: {quantity}", above_legend=quantity == "status")
    ax.grid(False)
    return figure


@styled
def contact_snapshot(
    history: NodeHistory, at: float, contact: str | None = None, *, title: str | None = None, ax: Axes | None = None
) -> Figure:
    """Pressure and status of a contact at the record nearest to time ``at`` [s], which stands in the title unless
    another is given.

    In space the contact as seen along its normal, in the plane pressure over the position along the contact, with its
    leading edge, which material of the other body meets first, and arrows the way that goes. Point contacts show their
    normal force. Raises CaseError for a contact that does not exist or a time outside the run.
    """
    name, nodes = chosen_nodes(history, contact)
    first, last = float(history.time[0]), float(history.time[-1])
    if not first - 1e-12 <= at <= last + 1e-12:
        raise CaseError("at", at, f"a time of this history: {first:g} to {last:g} s")
    record = int(np.argmin(np.abs(history.time - at)))
    values, label = _pressure_or_force(history, nodes, slice(record, record + 1))
    status = history.status[record, nodes]
    position, tangents, slip = history.position[nodes], history.tangents[nodes], history.slip_velocity[record, nodes]
    figure, ax = panel(ax, _height(position, tangents, 4.0))
    if position.shape[1] == 2:
        (x,), (length, its_name) = _lengths(arc_length(position, tangents))
        _along_line(ax, x, values[0], status)
        ax.set(xlabel=f"position along the contact [{its_name}]", ylabel=label)
        zero_line(ax)
        mark_on_line(ax, tangents, slip)
    else:
        (x, y), (length, its_name) = _lengths(*seen_from_normal(position, tangents))
        shown = _patch(ax, x, y, values[0])
        figure.colorbar(shown, ax=ax, pad=0.02, shrink=0.85, label=label)
        _status_markers(ax, x, y, status)
        ax.set(xlabel=f"along the first tangent [{its_name}]", ylabel=f"along the second tangent [{its_name}]")
        ax.set_aspect("equal", adjustable="datalim")  # a box of its own is not laid out with its title
        ax.grid(False)
        mark_on_patch(ax, position, tangents, slip, length)
    legend_above(ax)
    if title is None:
        now = float(history.time[record])
        second, of_time = time_unit(now)
        title = f"contact {name} at {now / second:.6g} {of_time}"
    _headed(ax, title)
    return figure


@styled
def interface_energy(
    position: Array,
    energy: Array,
    *,
    tangents: Array | None = None,
    quantity: str = "friction energy per cycle",
    unit: str = "J",
    slip: Array | None = None,
    ax: Axes | None = None,
) -> Figure:
    """Energy (m,) that friction brings in at contact nodes at position (m, d) [m]: where the squeal is made.

    Positive energies feed the motion (red), negative ones are taken from it (blue). In the plane a stem over the
    position along the contact, in space the nodes as seen along the normal. ``tangents`` (m, d−1, d) orient both;
    ``quantity`` is what the energy is called, ``unit`` its unit, "" for energies relative to another. ``slip``
    (m, d−1) [m/s], the slip velocity of the slave against the master along the tangents: marks its leading edge.
    Raises CaseError where the shapes do not fit.
    """
    position, energy = np.asarray(position, dtype=float), np.asarray(energy, dtype=float)
    if position.ndim != 2 or position.shape[1] not in (2, 3) or energy.shape != position.shape[:1]:
        given = f"energy of shape {energy.shape} at positions of shape {position.shape}"
        raise CaseError("energy", given, "one energy (m,) for each position (m, 2) or (m, 3)")
    power, prefix = _prefix(energy) if unit else (1.0, "")
    energy, label = energy / power, f"{quantity} [{prefix}{unit}]" if unit else quantity
    figure, ax = panel(ax, _height(position, tangents, 3.6))
    colours = [VERMILION if e > 0 else BLUE for e in energy]
    if position.shape[1] == 2:
        (x,), (length, its_name) = _lengths(arc_length(position, tangents))
        ax.vlines(x, 0.0, energy, colors=colours, linewidth=1.6, zorder=2)
        ax.scatter(x, energy, c=colours, s=16, zorder=3)
        zero_line(ax)
        ax.set(xlabel=f"position along the contact [{its_name}]", ylabel=label)
    else:
        (x, y), (length, its_name) = _lengths(*seen_from_normal(position, tangents))
        size = largest(energy)
        area = 12.0 + 90.0 * np.abs(np.nan_to_num(energy)) / size
        dots = ax.scatter(x, y, c=energy, s=area, cmap="RdBu_r", vmin=-size, vmax=size, edgecolors=GREY, linewidths=0.4)
        figure.colorbar(dots, ax=ax, pad=0.02, shrink=0.85, label=label)
        ax.set(xlabel=f"along the first tangent [{its_name}]", ylabel=f"along the second tangent [{its_name}]")
        ax.set_aspect("equal", adjustable="datalim")  # a box of its own is not laid out with its title
        ax.margins(0.08)
        ax.grid(False)
    if slip is not None and tangents is not None:
        if position.shape[1] == 2:
            mark_on_line(ax, tangents, slip)
        else:
            mark_on_patch(ax, position, tangents, slip, length)
    handles = [
        Line2D([], [], color=c, marker="o", ms=4.5, linestyle="none", label=text)
        for c, text in ((VERMILION, "feeds the motion"), (BLUE, "takes from it"))
    ]
    legend_above(ax, handles)
    _headed(ax, f"{quantity}: {float(np.nansum(energy)):+.3g} {prefix}{unit}".rstrip() + " in total")
    return figure


def contacts_of_several_nodes(system: System) -> list[str]:
    """Names of the contacts that have more than one node."""
    nodes = system.contact_nodes()
    return [name for k, name in enumerate(nodes.names) if np.count_nonzero(nodes.owner == k) > 1]


def contact_energies(system: System, energy: Array) -> dict[str, Figure]:
    """`contact_energy` of each contact over several nodes by its name."""
    return {name: contact_energy(system, energy, name) for name in contacts_of_several_nodes(system)}


def contact_energy(system: System, energy: Array, name: str) -> Figure:
    """`interface_energy` of a contact: energy (m,) of a mode at all contact nodes of a system, over the energy of the
    mode, with the edges of the slave as it slides."""
    nodes = system.contact_nodes()
    mine = nodes.owner == nodes.names.index(name)
    figure = interface_energy(
        nodes.position[mine],
        energy[mine],
        tangents=nodes.tangents[mine],
        quantity="energy per cycle / that of the mode",
        unit="",
        slip=nodes.slip_velocity(full_motion(system))[mine],
    )
    if len(nodes.names) > 1:
        ax = figure.axes[0]
        ax.set_title(f"contact {name}: {ax.get_title(loc='left')}", loc="left", pad=22.0)
    return figure


def _lengths(*coordinates: Array) -> tuple[list[Array], Unit]:
    """Coordinates (m,) [m] in the unit that their range asks for, and that unit."""
    unit = length_unit(extent(np.column_stack(coordinates)))
    return [c / unit[0] for c in coordinates], unit


def _height(position: Array, tangents: Array | None, line: float) -> float:
    """Height of a figure [inches] in which a contact in space fills its width, ``line`` for one in the plane."""
    if position.shape[1] == 2 or len(position) < 2:
        return line
    wide, high = (float(np.ptp(c)) for c in seen_from_normal(position, tangents))
    return float(np.clip((WIDTH - 1.8) * (high / max(1.3 * wide, 1e-12)) + 1.5, 2.8, 6.0))


def _headed(ax: Axes, title: str, *, above_legend: bool = True) -> None:
    """A title at the left, above the legend that stands above the frame."""
    ax.set_title(title, pad=22.0 if above_legend else None)


def _prefix(values: Array) -> tuple[float, str]:
    """Power of a thousand that brings the largest value to 1 to 1000, and its letter."""
    letters = ("p", "n", "µ", "m", "", "k", "M", "G")
    exponent = int(np.floor(np.log10(largest(values)) / 3 + 1e-9))
    index = int(np.clip(exponent + 4, 0, len(letters) - 1))
    return 1000.0 ** (index - 4), letters[index]


def chosen_nodes(history: NodeHistory, contact: str | None) -> tuple[str, IntArray]:
    """A contact's name and its nodes (m,), the first contact for None. Raises CaseError for an unknown or empty one."""
    known = ", ".join(history.names) or "none"
    if not history.names:
        raise CaseError("history", None, "holds no contact, so there is nothing to show")
    name = history.names[0] if contact is None else contact
    if name not in history.names:
        raise CaseError("contact", contact, f"no such contact; known: {known}")
    nodes = np.flatnonzero(history.owner == history.names.index(name))
    if not len(nodes):
        raise CaseError("contact", name, "has no nodes")
    return name, nodes


def chosen_records(time: Array, start: float | None, end: float | None) -> slice:
    """Records from start to end [s], both included. Raises CaseError where there are none."""
    first = 0 if start is None else int(np.searchsorted(time, start - 1e-12))
    last = len(time) if end is None else int(np.searchsorted(time, end + 1e-12, side="right"))
    if last <= first:
        run = f"{float(time[0]):g} to {float(time[-1]):g} s" if len(time) else "empty"
        raise CaseError("start, end", f"{start} to {end}", f"no record lies there; the history is {run}")
    return slice(first, last)


def map_values(
    history: NodeHistory, nodes: IntArray, records: slice, columns: NodeColumns, quantity: Quantity
) -> tuple[Array, Array]:
    """Time (rows,) [s] where rows of the picture begin, and what they show (rows, columns); NaN where there is none."""
    count = len(history.time[records])
    size = -(-count // ROWS)
    begin = np.arange(0, count, size)
    if quantity == "status":
        return history.time[records][begin], _status_rows(history.status[records, nodes], columns, begin)
    if quantity == "pressure":
        rows = _pressure_columns(history, nodes, records, columns)
    else:
        field = history.gap if quantity == "gap" else history.slip_velocity[:, :, 0]
        members = np.bincount(columns.column, minlength=columns.count)
        rows = _summed(field[records, nodes], columns) / members
    if quantity == "gap":
        return history.time[records][begin], np.maximum.reduceat(rows, begin, axis=0)
    total = np.add.reduceat(rows, begin, axis=0)
    return history.time[records][begin], total / np.diff(np.append(begin, count))[:, None]


def _summed(values: Array, columns: NodeColumns) -> Array:
    """Sums (r, columns) of values (r, m) of nodes."""
    total = np.zeros((len(values), columns.count))
    np.add.at(total.T, columns.column, values.T)
    return total


def _pressure_columns(history: NodeHistory, nodes: IntArray, records: slice, columns: NodeColumns) -> Array:
    """Force over area (r, columns) [Pa], which nodes without area cannot spoil; for point contacts force [N]."""
    force = _summed(history.normal_force[records, nodes], columns)
    area = history.area[nodes]
    if not np.all(np.isfinite(area)):
        return force
    whole = np.bincount(columns.column, weights=area, minlength=columns.count)
    return np.where(whole > 0, force / np.where(whole > 0, whole, 1.0), np.nan)


def _status_rows(status: IntArray, columns: NodeColumns, begin: IntArray) -> Array:
    """Status (rows, columns): in a column the most frequent, in a row the rarest of the picture that occurs."""
    votes = np.stack([_summed((status == s).astype(float), columns) for s in range(3)])
    column = np.argmax(votes, axis=0)
    rarest = np.argsort([np.count_nonzero(column == s) for s in range(3)], kind="stable")
    rank = np.empty(3, dtype=np.int64)
    rank[rarest] = np.arange(3)
    return rarest[np.minimum.reduceat(rank[column], begin, axis=0)].astype(float)


def _pressure_or_force(history: NodeHistory, nodes: IntArray, records: slice) -> tuple[Array, str]:
    """Pressure (r, m) of nodes in the unit that its size asks for, or normal force [N] without areas, and its label."""
    force, area = history.normal_force[records, nodes], history.area[nodes]
    if not np.all(np.isfinite(area)):
        return force, "normal force [N]"
    pressure = np.where(area > 0, force / np.where(area > 0, area, 1.0), np.nan)
    unit, its_name = pressure_unit(most(pressure))
    return pressure / unit, f"pressure [{its_name}]"


def _time_edges(time: Array, span: Array) -> Array:
    """Edges (rows + 1,) of rows that begin at time (rows,), the last one as long as the one before."""
    last = time[-1] - time[-2] if len(time) > 1 else float(span[1] - span[0]) or 1.0
    return np.append(time, time[-1] + last)


def _status_map(ax: Axes, columns: NodeColumns, sides: Array, values: Array) -> None:
    colours = [MAP_COLOURS[name] for name in STATUS]
    look: Any = {"cmap": ListedColormap(colours), "norm": BoundaryNorm([-0.5, 0.5, 1.5, 2.5], 3)}
    ax.pcolormesh(columns.edges, sides, values, rasterized=True, **look)
    legend_above(ax, [Patch(facecolor=c, edgecolor=GREY, label=n) for n, c in zip(STATUS, colours, strict=True)])


def _value_map(
    figure: Figure, ax: Axes, columns: NodeColumns, sides: Array, values: Array, quantity: Quantity, *, area: bool
) -> None:
    unit, its_name = 1.0, "N"
    if quantity == "gap":
        unit, its_name = gap_unit(most(values))
    elif quantity == "slip":
        its_name = "m/s"
    elif area:
        unit, its_name = pressure_unit(most(values))
    values = values / unit
    known = values[~np.isnan(values)]
    low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 1.0)
    if not np.isfinite(low):
        low, high = 0.0, 1.0
    look: dict[str, Any] = {"cmap": "cividis", "vmin": min(low, 0.0), "vmax": high if high > min(low, 0.0) else 1.0}
    label = {"gap": "gap", "slip": "slip velocity"}.get(quantity, "pressure" if area else "normal force")
    if quantity == "slip":
        size = largest(values)
        look = {"cmap": "RdBu_r", "vmin": -size, "vmax": size}
    shown = ax.pcolormesh(columns.edges, sides, values, rasterized=True, **look)
    figure.colorbar(shown, ax=ax, pad=0.01, label=f"{label} [{its_name}]")


def _along_line(ax: Axes, x: Array, values: Array, status: IntArray) -> None:
    order = np.argsort(x, kind="stable")
    ax.plot(x[order], values[order], color=GREY, linewidth=1.2, zorder=2)
    _status_markers(ax, x, values, status)


def _patch(ax: Axes, x: Array, y: Array, values: Array) -> Any:
    """Values as smooth colours between nodes, holes and bays of the patch left open; as dots where nodes are few."""
    good = np.isfinite(values)
    top = float(values[good].max(initial=0.0)) or 1.0
    look: Any = {"cmap": "cividis", "vmin": 0.0, "vmax": top}
    if good.sum() >= 4 and min(np.ptp(x[good]), np.ptp(y[good])) > 1e-6 * max(np.ptp(x), np.ptp(y)):
        points = np.column_stack([x[good], y[good]])
        triangles = Triangulation(*points.T)
        # Sides much longer than nodes are apart there bridge a hole or a bay, and so do flat triangles at a border.
        apart = cKDTree(points).query(points, k=min(5, len(points)))[0][:, -1]
        corners = points[triangles.triangles]
        sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
        long = sides.max(axis=1) > 3.0 * apart[triangles.triangles].max(axis=1)
        triangles.set_mask(without_flat(corners, triangles.neighbors, long, 0.05))
        return ax.tripcolor(triangles, values[good], shading="gouraud", rasterized=True, **look)
    return ax.scatter(x, y, c=values, s=60, zorder=2, **look)


def without_flat(corners: Array, neighbours: IntArray, gone: BoolArray, least: float) -> BoolArray:
    """Triangles (t,) to leave out: those ``gone`` and, from the border inwards, those whose inscribed circle is smaller
    than ``least`` of their circumscribed one. corners (t, 3, 2); neighbours (t, 3), −1 where there is none.

    r/R = 4A²/(s a b c) with s half the circumference. The area comes from the corners: from the sides alone, by Heron,
    rounding makes the square of that of a flat triangle negative.
    """
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    scaled = (corners - low) / (high - low)
    a, b, c = np.linalg.norm(scaled - np.roll(scaled, 1, axis=1), axis=2).T
    first, second = scaled[:, 1] - scaled[:, 0], scaled[:, 2] - scaled[:, 0]
    double_area = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    flat = 2.0 * double_area**2 < least * (a + b + c) * a * b * c
    gone = gone.copy()
    while True:
        at_border = ((neighbours < 0) | gone[neighbours]).any(axis=1)
        more = flat & at_border & ~gone
        if not more.any():
            return gone
        gone |= more


def _status_markers(ax: Axes, x: Array, y: Array, status: IntArray) -> None:
    """A mark for each node: small dot for slip, square for stick, open ring for separation."""
    size = float(np.clip(4000.0 / max(len(x), 1), 9.0, 36.0))
    look: dict[int, dict[str, Any]] = {
        SLIP: {"marker": ".", "c": MAP_COLOURS["slip"], "edgecolors": INK, "linewidths": 0.4, "s": size},
        STICK: {"marker": "s", "c": MAP_COLOURS["stick"], "edgecolors": "white", "linewidths": 0.5, "s": size},
        SEPARATION: {"marker": "o", "facecolors": "white", "edgecolors": VERMILION, "linewidths": 1.2, "s": size},
    }
    for code in (SLIP, STICK, SEPARATION):
        chosen = status == code
        if np.any(chosen):
            ax.scatter(x[chosen], y[chosen], zorder=4, label=STATUS[code], **look[code])

"""Maps of an ensemble of runs: how strongly it vibrates, at which frequency, how contacts are, and what modes say."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import AbstractPathEffect, Normal, Stroke
from matplotlib.ticker import MaxNLocator

from ..study.ensemble_result import AXES, Ensemble
from ..typing import Array, IntArray
from .colours import COLOURS, INK
from .style import new_figure, root_figure, styled
from .units import Unit, frequency_unit, most, time_unit

NAMES = {"mu": "friction coefficient μ", "load": "factor of loads", "speed": "factor of speeds",
         "perturbation": "perturbation [m/s]"}  # fmt: skip
MARKS = {"up": "^", "down": "v", "": "o"}
# White on the dark end of the colours, and still seen on the light one.
_OUTLINED: list[AbstractPathEffect] = [Stroke(linewidth=2.6, foreground=INK), Normal()]
_HALO: list[AbstractPathEffect] = [Stroke(linewidth=2.0, foreground="white"), Normal()]  # letters on lines
PANEL = np.array([0.75, 0.62])  # of a row and a column of the figure: what the frame of a panel takes, at least
LETTER = 0.64  # width of a digit, of its size
LINE = 90  # letters of a line above the panels
LEAST_LETTERS = 4.5  # [pt] that can be read


@dataclass(frozen=True)
class _Shown:
    """What a map shows: one or two axes that vary, and the members on them, (branches, x) or (branches, x, y)."""

    result: Ensemble
    names: tuple[str, ...]
    values: tuple[Array, ...]
    members: IntArray
    branches: tuple[str, ...]
    fixed: str

    def of(self, table: Array) -> Array:
        """Values of members in the shape of the map."""
        return np.asarray(table)[self.members]


def _shown(result: Ensemble) -> _Shown:
    """The first two numbers that vary; others are at their first value, which the title says."""
    if not result.axes:
        members = np.arange(len(result))[None]
        return _Shown(result, ("member",), (np.arange(1.0, len(result) + 1),), members, ("",), "")
    members = np.arange(len(result)).reshape(result.shape)
    values = dict(result.axes)
    varying = [name for name in AXES if len(values[name]) > 1][:2] or ["mu"]
    chosen = members[(slice(None), *(slice(None) if name in varying else 0 for name in AXES))]
    fixed = [f"{NAMES[n]} {values[n][0]:g}" for n in AXES if n not in varying and len(values[n]) > 1]
    branches = tuple(dict.fromkeys(result.sweep))
    return _Shown(result, tuple(varying), tuple(values[n] for n in varying), chosen, branches, ", ".join(fixed))


@styled
def ensemble_map(result: Ensemble) -> Figure:
    """Amplitude, dominant frequency, shares of stick and of separation over the numbers that vary, and below over μ how
    many modes grow and the frequency of the fastest. Members without a ring in their amplitude are not steady; a
    number at the frequency is that of the unstable mode that responds, left out where cells are too small for it; a
    cross, that something slower than the window resolves is stronger than the line at it."""
    shown = _shown(result)
    pages = shown.branches if len(shown.names) == 2 else ("",)
    modal = result.modal is not None
    rows = 2 * len(pages) + modal
    figure = new_figure(0.5 + 2.3 * rows)
    panels = figure.subplots(rows, 2, squeeze=False)
    unit, its_name = _frequencies(result)
    tables = (
        (result.rms, f"rms [{result.unit}]"), (result.frequency_hz / unit, f"dominant frequency [{its_name}]"),
        (result.stick.max(axis=1, initial=0.0), "share of time in stick"),
        (result.separation.max(axis=1, initial=0.0), "share of time in separation"),
    )  # fmt: skip
    marks: list[str] = []
    for number, branch in enumerate(pages):
        for k, (table, label) in enumerate(tables):
            ax = panels[2 * number + k // 2, k % 2]
            # Above, not along the side: there it is longer than its panel, and runs into the one beside it.
            ax.set_title(f"{label}, {branch}" if branch else label)
            if len(shown.names) == 2:
                _map(figure, ax, shown, number, table, share=k > 1)
            else:
                _lines(ax, shown, table, share=k > 1)
            if k < 2:
                marks.append((_rings, _numbers)[k](ax, shown, number))
        marks.append(_crosses(panels[2 * number, 1], shown, number))
    if modal:
        _modal(panels[-1, 0], panels[-1, 1], result)
    _headed(figure, shown, marks)
    return figure


def _headed(figure: Figure, shown: _Shown, marks: Sequence[str]) -> None:
    """What is looked at, what is at its first value, and what the marks mean."""
    result = shown.result
    head = f"{result.observable}, {_window(result)}" + (f"; {shown.fixed}" if shown.fixed else "")
    told = [words for words in dict.fromkeys(marks) if words]
    if len(result.contact_names) > 1:
        told.append("shares: the largest of all contacts")
    figure.suptitle("\n".join([head, *textwrap.wrap("; ".join(told), LINE)]), fontsize=10)


def _window(result: Ensemble) -> str:
    start, end = result.window
    unit, its_name = time_unit(end - start, end)
    return f"{start / unit:.4g} … {end / unit:.4g} {its_name}"


def _frequencies(result: Ensemble) -> Unit:
    """One unit [Hz] of all frequencies of an ensemble."""
    modal = 0.0 if result.modal is None else most(result.modal.frequency_hz)
    return frequency_unit(max(most(result.frequency_hz), modal))


def _map(figure: Figure, ax: Axes, shown: _Shown, branch: int, table: Array, *, share: bool) -> None:
    """Colours over two numbers, a cell for each member."""
    values = np.ma.masked_invalid(shown.of(table)[branch].T)
    ax.set_facecolor("#E6E6E6")
    ax.grid(False)
    x, y = shown.values
    order = np.argsort(x), np.argsort(y)
    mesh = ax.pcolormesh(_edges(x[order[0]]), _edges(y[order[1]]), values[np.ix_(order[1], order[0])], cmap="viridis")
    if share:
        mesh.set_clim(0.0, 1.0)
    figure.colorbar(mesh, ax=ax)
    ax.set(xlabel=NAMES[shown.names[0]], ylabel=NAMES[shown.names[1]])


def _edges(values: Array) -> Array:
    """Edges (n + 1,) of cells about rising values (n,)."""
    middle = 0.5 * (values[1:] + values[:-1])
    return np.concatenate([[2 * values[0] - middle[0]], middle, [2 * values[-1] - middle[-1]]])


def _lines(ax: Axes, shown: _Shown, table: Array, *, share: bool) -> None:
    """A line for each branch over one number."""
    for k, branch in enumerate(shown.branches):
        values, order = shown.of(table)[k], np.argsort(shown.values[0])
        colour, mark = COLOURS[k], MARKS[branch]
        ax.plot(shown.values[0][order], values[order], mark + "-", color=colour, ms=4, label=branch or None)
    ax.set_xlabel(NAMES.get(shown.names[0], shown.names[0]))
    # Room for a number above the largest value, and for one below the least.
    ax.margins(x=0.07)
    if share:
        ax.set_ylim(-0.03, 1.03)
    else:
        values = shown.of(table)
        largest = float(np.max(values[np.isfinite(values)], initial=0.0)) or 1.0
        ax.set_ylim((-0.03 if len(shown.branches) == 1 else -0.12) * largest, 1.2 * largest)
    if len(shown.branches) > 1:
        ax.legend(framealpha=0.7)


def _at(shown: _Shown, where: tuple[int, ...], table: Array) -> tuple[float, float]:
    """Where a member is in its panel; where (i,) or (i, j) on the axes."""
    x = float(shown.values[0][where[0]])
    return x, float(shown.values[1][where[1]]) if len(where) == 2 else float(table)


def _room(ax: Axes, shown: _Shown) -> float:
    """How much of a panel [pt] each member has, in the direction in which it has least."""
    spec = ax.get_subplotspec()
    assert spec is not None, "panels are made in rows and columns"
    rows, columns = spec.get_gridspec().get_geometry()
    sizes = PANEL * 72 * root_figure(ax).get_size_inches() / np.array([columns, rows])
    return min(float(size) / len(values) for size, values in zip(sizes, shown.values, strict=False))


def _rings(ax: Axes, shown: _Shown, page: int) -> str:
    """A ring about each member that is steady, no larger than its cell; what it means, "" where there is none."""
    two = len(shown.names) == 2
    size, words = min(9.0, max(0.6 * _room(ax, shown), 0.0 if two else 6.0)), ""
    for branch in [page] if two else range(len(shown.branches)):
        for where in np.ndindex(shown.members[branch].shape):
            k = int(shown.members[branch][where])
            if shown.result.regime[k] == "steady":
                x, y = _at(shown, where, shown.result.rms[k])
                edge = 1.2 * size / 9.0
                (ring,) = ax.plot(x, y, "o", mfc="none", mec="white" if two else INK, ms=size, mew=edge)
                ring.set_path_effects([Stroke(linewidth=2.2 * edge, foreground=INK), Normal()] if two else [])
                words = "ring: steady"
    return words


def _crosses(ax: Axes, shown: _Shown, page: int) -> str:
    """A cross at the frequency of each member in which something slower is stronger, no larger than its cell; what it
    means, "" where there is none."""
    two, slower = len(shown.names) == 2, np.isfinite(shown.result.stronger_below_hz)
    size, words = min(6.0, max(0.4 * _room(ax, shown), 0.0 if two else 5.0)), ""
    frequency = shown.result.frequency_hz / _frequencies(shown.result)[0]
    for branch in [page] if two else range(len(shown.branches)):
        for where in np.ndindex(shown.members[branch].shape):
            k = int(shown.members[branch][where])
            if slower[k]:
                x, y = _at(shown, where, frequency[k])
                (cross,) = ax.plot(x, y, "x", color="white" if two else INK, ms=size, mew=1.2 * size / 6.0)
                cross.set_path_effects([Stroke(linewidth=2.4 * size / 6.0, foreground=INK), Normal()] if two else [])
                words = "cross: something too slow for the window is stronger"
    return words


def _numbers(ax: Axes, shown: _Shown, page: int) -> str:
    """The number of the mode that responds, where there is room for it; what it means, "" where there is none."""
    two = len(shown.names) == 2
    modes = shown.result.mode
    if not modes.any():
        return ""
    size = min(8.0, _room(ax, shown) / (LETTER * len(str(int(modes.max()))) + 0.4))
    if size < LEAST_LETTERS:
        return "no room for the numbers of the modes that respond: see the table"
    for branch in [page] if two else range(len(shown.branches)):
        for where in np.ndindex(shown.members[branch].shape):
            k = int(shown.members[branch][where])
            if modes[k]:
                at = _at(shown, where, shown.result.frequency_hz[k] / _frequencies(shown.result)[0])
                # Over one number away from the other branch.
                others = shown.of(shown.result.frequency_hz)[:, where[0]] if not two else []
                below = not two and bool(shown.result.frequency_hz[k] < np.nanmax(others))
                offset = (0, 0) if two else (0, -5 if below else 5)
                text = ax.annotate(str(modes[k]), at, offset, textcoords="offset points", ha="center", fontsize=size)
                text.set_color("white" if two else COLOURS[branch])
                text.set_verticalalignment("center" if two else "top" if below else "bottom")
                text.set_path_effects(_OUTLINED if two else _HALO)
    return "number: unstable mode within 5 % of the frequency"


def _modal(left: Axes, right: Axes, result: Ensemble) -> None:
    """What the modal approach says over μ."""
    modal = result.modal
    assert modal is not None
    unit, its_name = _frequencies(result)
    for j, speed in enumerate(modal.speed):
        label = f"speed {speed:g}" if len(modal.speed) > 1 else None
        colour = COLOURS[j % len(COLOURS)]
        known = np.where(modal.unstable[:, j] >= 0, modal.unstable[:, j], np.nan)
        left.plot(modal.mu, known, "o-", color=colour, ms=4, label=label, drawstyle="steps-mid")
        right.plot(modal.mu, modal.frequency_hz[:, j] / unit, "o", color=colour, ms=4, label=label)
    left.set_title("modes that grow")
    left.set_xlabel(NAMES["mu"])
    left.set_ylim(bottom=-0.1)
    left.yaxis.set_major_locator(MaxNLocator(integer=True))
    right.set_title(f"frequency of the fastest of them [{its_name}]")
    right.set_xlabel(NAMES["mu"])
    right.set(xlim=left.get_xlim(), ylim=(0.0, right.get_ylim()[1]))
    if len(modal.speed) > 1:
        left.legend()

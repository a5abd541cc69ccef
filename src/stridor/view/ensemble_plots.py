"""Maps of an ensemble of runs: how strongly it vibrates, at which frequency, how contacts are, and what modes say."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import AbstractPathEffect, Normal, Stroke
from matplotlib.ticker import MaxNLocator

from ..study.ensemble_result import AXES, Ensemble
from ..typing import Array, IntArray
from .colours import COLOURS, GREY, INK
from .style import new_figure, styled

NAMES = {"mu": "friction coefficient μ", "load": "factor of loads", "speed": "factor of speeds",
         "perturbation": "perturbation [m/s]"}  # fmt: skip
MARKS = {"up": "^", "down": "v", "": "o"}
# White on the dark end of the colours, and still seen on the light one.
_OUTLINED: list[AbstractPathEffect] = [Stroke(linewidth=2.6, foreground=INK), Normal()]


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
    number at the frequency is that of the unstable mode that responds."""
    shown = _shown(result)
    pages = shown.branches if len(shown.names) == 2 else ("",)
    modal = result.modal is not None
    rows = 2 * len(pages) + modal
    figure = new_figure(0.5 + 2.3 * rows)
    panels = figure.subplots(rows, 2, squeeze=False)
    figure.suptitle(f"{result.observable}, {_window(result)}" + (f"; {shown.fixed}" if shown.fixed else ""))
    most = ", most of all contacts" if len(result.contact_names) > 1 else ""
    tables = (
        (result.rms, f"rms [{result.unit}]"), (result.frequency_hz / 1e3, "dominant frequency [kHz]"),
        (result.stick.max(axis=1, initial=0.0), f"share of time in stick{most}"),
        (result.separation.max(axis=1, initial=0.0), f"share of time in separation{most}"),
    )  # fmt: skip
    for number, branch in enumerate(pages):
        for k, (table, label) in enumerate(tables):
            ax = panels[2 * number + k // 2, k % 2]
            if len(shown.names) == 2:
                _map(figure, ax, shown, number, table, f"{label}, {branch}" if branch else label, share=k > 1)
            else:
                _lines(ax, shown, table, label, share=k > 1)
            if k == 0:
                _rings(ax, shown, number)
            if k == 1:
                _numbers(ax, shown, number)
    if modal:
        _modal(panels[-1, 0], panels[-1, 1], result)
    return figure


def _window(result: Ensemble) -> str:
    return f"{1e3 * result.window[0]:.4g} … {1e3 * result.window[1]:.4g} ms"


def _map(
    figure: Figure, ax: Axes, shown: _Shown, branch: int, table: Array, label: str, *, share: bool
) -> None:  # fmt: skip
    """Colours over two numbers, a cell for each member."""
    values = np.ma.masked_invalid(shown.of(table)[branch].T)
    ax.set_facecolor("#E6E6E6")
    ax.grid(False)
    x, y = shown.values
    order = np.argsort(x), np.argsort(y)
    mesh = ax.pcolormesh(_edges(x[order[0]]), _edges(y[order[1]]), values[np.ix_(order[1], order[0])], cmap="viridis")
    if share:
        mesh.set_clim(0.0, 1.0)
    figure.colorbar(mesh, ax=ax, label=label)
    ax.set(xlabel=NAMES[shown.names[0]], ylabel=NAMES[shown.names[1]])


def _edges(values: Array) -> Array:
    """Edges (n + 1,) of cells about rising values (n,)."""
    middle = 0.5 * (values[1:] + values[:-1])
    return np.concatenate([[2 * values[0] - middle[0]], middle, [2 * values[-1] - middle[-1]]])


def _lines(ax: Axes, shown: _Shown, table: Array, label: str, *, share: bool) -> None:
    """A line for each branch over one number."""
    for k, branch in enumerate(shown.branches):
        values, order = shown.of(table)[k], np.argsort(shown.values[0])
        colour, mark = COLOURS[k], MARKS[branch]
        ax.plot(shown.values[0][order], values[order], mark + "-", color=colour, ms=4, label=branch or None)
    ax.set(xlabel=NAMES.get(shown.names[0], shown.names[0]), ylabel=label)
    if share:
        ax.set_ylim(-0.03, 1.03)
    else:
        ax.set_ylim(bottom=0.0)
    if len(shown.branches) > 1:
        ax.legend()


def _at(shown: _Shown, where: tuple[int, ...], table: Array) -> tuple[float, float]:
    """Where a member is in its panel; where (i,) or (i, j) on the axes."""
    x = float(shown.values[0][where[0]])
    return x, float(shown.values[1][where[1]]) if len(where) == 2 else float(table)


def _rings(ax: Axes, shown: _Shown, page: int) -> None:
    """A ring about each member that is steady."""
    two = len(shown.names) == 2
    for branch in [page] if two else range(len(shown.branches)):
        for where in np.ndindex(shown.members[branch].shape):
            k = int(shown.members[branch][where])
            if shown.result.regime[k] == "steady":
                x, y = _at(shown, where, shown.result.rms[k])
                (ring,) = ax.plot(x, y, "o", mfc="none", mec="white" if two else INK, ms=9, mew=1.2)
                ring.set_path_effects(_OUTLINED if two else [])
    ax.set_title("ring: steady", color=GREY, fontsize=8, fontweight="normal")


def _numbers(ax: Axes, shown: _Shown, page: int) -> None:
    """The number of the mode that responds."""
    two = len(shown.names) == 2
    for branch in [page] if two else range(len(shown.branches)):
        for where in np.ndindex(shown.members[branch].shape):
            k = int(shown.members[branch][where])
            if shown.result.mode[k]:
                at = _at(shown, where, shown.result.frequency_hz[k] / 1e3)
                text = ax.annotate(str(shown.result.mode[k]), at, fontsize=8, color="white" if two else INK)
                text.set_horizontalalignment("center" if two else "left")
                text.set_verticalalignment("center" if two else "bottom")
                text.set_path_effects(_OUTLINED if two else [])
    if shown.result.modal is not None:
        ax.set_title("number: unstable mode within 5 %", color=GREY, fontsize=8, fontweight="normal")


def _modal(left: Axes, right: Axes, result: Ensemble) -> None:
    """What the modal approach says over μ."""
    modal = result.modal
    assert modal is not None
    for j, speed in enumerate(modal.speed):
        label = f"speed {speed:g}" if len(modal.speed) > 1 else None
        colour = COLOURS[j % len(COLOURS)]
        left.plot(modal.mu, modal.unstable[:, j], "o-", color=colour, ms=4, label=label, drawstyle="steps-mid")
        right.plot(modal.mu, modal.frequency_hz[:, j] / 1e3, "o", color=colour, ms=4, label=label)
    left.set(xlabel=NAMES["mu"], ylabel="modes that grow")
    left.set_ylim(bottom=-0.1)
    left.yaxis.set_major_locator(MaxNLocator(integer=True))
    right.set(xlabel=NAMES["mu"], ylabel="the fastest of them [kHz]")
    right.set(xlim=left.get_xlim(), ylim=(0.0, right.get_ylim()[1]))
    if len(modal.speed) > 1:
        left.legend()

"""Figures of a study, from its store alone: where it squeals, at which frequency, how likely, and what decides it."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ..errors import AnalysisError
from ..typing import Array
from ..view.colours import BLUE, GREY, INK, ORANGE, VERMILION
from ..view.style import legend_above, panel, styled
from .result import StudyResult, numbers
from .uncertainty import Indices, grows

STABLE = "#DDDDDD"
MOST_POINTS = 20_000  # of a cloud


@styled
def stability_map(result: StudyResult, x: str | None = None, y: str | None = None, *, ax: Axes | None = None) -> Figure:
    """Samples over two parameters (default: the first two that vary): frequency of the fastest growing mode as colour,
    grey where nothing grows; over a grid of these two with the line where growth begins. Of onsets: the critical
    friction coefficient as colour. Rings: solved in the full problem as well. Raises AnalysisError with fewer than two
    parameters."""
    x, y = _two(result, x, y)
    figure, ax = panel(ax, 4.6)
    at = [numbers(result, name) for name in (x, y)]
    onsets = result.compute == "onsets"
    shown = numbers(result, "critical_mu" if onsets else "largest_growth_frequency_hz")
    unstable = result.unstable
    known = unstable & np.isfinite(shown)
    label = "critical friction coefficient" if onsets else "frequency of the fastest growing mode [Hz]"
    size = float(np.clip(6000 / max(len(shown), 1), 4, 60))
    ax.scatter(at[0][~unstable], at[1][~unstable], s=size, c=STABLE, marker="s", linewidths=0)
    if known.any():
        drawn = ax.scatter(at[0][known], at[1][known], s=size, c=shown[known], cmap="viridis", marker="s", linewidths=0)
        figure.colorbar(drawn, ax=ax, label=label, pad=0.02)
    stable = Line2D([], [], color=STABLE, marker="s", linestyle="none", label="nothing grows")
    handles = [stable] if (~unstable).any() else []
    if not onsets:
        handles += _boundary(result, ax, x, y)
    handles += _rings(result, ax, at)
    ax.set(xlabel=_named(result, x), ylabel=_named(result, y))
    legend_above(ax, handles, columns=3)
    return figure


def _boundary(result: StudyResult, ax: Axes, x: str, y: str) -> list[Line2D]:
    """The line of no growth over a grid of two parameters alone."""
    axes = [np.unique(result.data[name].values) for name in (x, y)]
    values = np.asarray(result.data["largest_growth_rate"].values, dtype=float)
    whole = len(values) == len(axes[0]) * len(axes[1]) and min(map(len, axes)) > 1
    if result.method != "grid" or not whole or not np.any(values > 0) or not np.any(values < 0):
        return []
    table = np.full((len(axes[1]), len(axes[0])), np.nan)
    places = [np.searchsorted(axis, result.data[name].values) for axis, name in zip(axes, (x, y), strict=True)]
    table[places[1], places[0]] = values
    ax.contour(axes[0], axes[1], table, levels=[0.0], colors=VERMILION, linewidths=1.8)
    return [Line2D([], [], color=VERMILION, label="no growth (between points of the grid)")]


def _rings(result: StudyResult, ax: Axes, at: Sequence[Array]) -> list[Line2D]:
    if "confirmed" not in result.data:
        return []
    confirmed = numbers(result, "confirmed") > 0
    if not confirmed.any():
        return []
    ax.plot(at[0][confirmed], at[1][confirmed], "o", mfc="none", mec=INK, ms=5, mew=0.7)
    return [Line2D([], [], color=INK, marker="o", mfc="none", linestyle="none", label="solved in full as well")]


@styled
def root_locus(result: StudyResult, *, ax: Axes | None = None) -> Figure:
    """Growth rate over frequency of every mode kept of every row, and for each branch the median and the range from the
    5th to the 95th percentile of both (`StudyResult.branches`)."""
    if result.compute != "modes":
        raise AnalysisError("a root locus is that of modes; the study computed others")
    figure, ax = panel(ax, 4.2)
    frequency, growth = (np.asarray(result.data[n].values)[result.done] for n in ("frequency_hz", "growth_rate"))
    flat = np.isfinite(frequency)
    points = np.flatnonzero(flat.ravel())
    if len(points) > MOST_POINTS:
        points = np.random.default_rng(0).choice(points, MOST_POINTS, replace=False)
    f, g = frequency.ravel()[points], growth.ravel()[points]
    for chosen, colour, label in ((~grows(f, g), BLUE, "stable"), (grows(f, g), VERMILION, "growing")):
        if chosen.any():
            ax.plot(f[chosen], g[chosen], ".", color=colour, ms=2.5, alpha=0.35, zorder=1)
            ax.plot([], [], ".", color=colour, label=label)
    for branch in result.branches():
        (f_low, f_mid, f_high), (g_low, g_mid, g_high) = branch.frequency_hz, branch.growth_rate
        ax.plot([f_low, f_high], [g_mid, g_mid], color=INK, linewidth=0.9)
        ax.plot([f_mid, f_mid], [g_low, g_high], color=INK, linewidth=0.9)
    if len(frequency) > 1:
        ax.plot([], [], color=INK, linewidth=0.9, label=f"median, 5 to 95 %, {result.branch_words}")
    ax.axhline(0.0, color=GREY, linewidth=0.8)
    scale = np.abs(growth[flat])
    if scale.size and scale.max() > 100 * max(float(np.median(scale)), 1e-9):
        linear = max(float(np.median(scale)), 1e-6)
        ax.set_yscale("symlog", linthresh=linear)
        # Within the linear part there is room for zero alone.
        ax.set_yticks([tick for tick in ax.get_yticks() if tick == 0.0 or abs(tick) >= 0.5 * linear])
    ax.set(xlabel="frequency [Hz]", ylabel="growth rate [1/s]")
    legend_above(ax, columns=3)
    return figure


@styled
def growth_over(result: StudyResult, x: str | None = None, *, ax: Axes | None = None) -> Figure:
    """The largest growth rate over one parameter (default: the first that varies), or the critical friction
    coefficient of a study of onsets."""
    name = x or next(iter(_varied(result)), None)
    if name is None:
        raise AnalysisError("no parameter has more than one value among the samples")
    what = {"modes": "largest_growth_rate", "onsets": "critical_mu"}.get(result.compute)
    if what is None:
        raise AnalysisError(f"{result.compute} has neither growth rates nor onsets")
    figure, ax = panel(ax, 3.6)
    at, values = numbers(result, name), numbers(result, what)
    order = np.argsort(at)
    alone = len(_varied(result)) == 1
    ax.plot(at[order], values[order], "-o" if alone else ".", ms=3, color=BLUE, alpha=1.0 if alone else 0.5)
    if result.compute == "modes":
        ax.axhline(0.0, color=GREY, linewidth=0.8)
    label = "largest growth rate [1/s]" if result.compute == "modes" else "critical friction coefficient"
    ax.set(xlabel=_named(result, name), ylabel=label)
    return figure


@styled
def tornado(indices: Indices, *, ax: Axes | None = None) -> Figure:
    """Sobol indices, the most important parameter on top: first order and total, with their 95 % intervals."""
    order = np.argsort(indices.total)
    figure, ax = panel(ax, 1.2 + 0.5 * len(order))
    for shift, values, widths, colour, label in (
        (0.2, indices.total, indices.total_half_width, ORANGE, "total"),
        (-0.2, indices.first, indices.first_half_width, BLUE, "first order"),
    ):
        ax.barh(
            np.arange(len(order)) + shift, values[order], 0.38, xerr=widths[order], color=colour, label=label,
            error_kw={"ecolor": INK, "elinewidth": 0.9, "capsize": 2},
        )  # fmt: skip
    ax.set_yticks(range(len(order)), [indices.names[k] for k in order])
    ax.axvline(0.0, color=INK, linewidth=0.8)
    ax.grid(False, axis="y")
    ax.set_xlabel(f"Sobol index of {indices.of}")
    legend_above(ax, columns=2)
    return figure


@styled
def band_probability(result: StudyResult, edges: Sequence[float] | None = None, *, ax: Axes | None = None) -> Figure:
    """How likely a mode grows in each band of frequencies, with 95 % intervals."""
    bands = result.probability_in_bands(edges)
    figure, ax = panel(ax, 3.4)
    middle = [(low + high) / 2 for low, high, _ in bands]
    values = np.array([p.value for _, _, p in bands])
    below, above = (values - [p.low for _, _, p in bands], [p.high for _, _, p in bands] - values)
    ax.bar(
        middle, values, [0.92 * (high - low) for low, high, _ in bands], color=BLUE,
        yerr=np.maximum([below, above], 0.0), error_kw={"ecolor": INK, "elinewidth": 0.9, "capsize": 2},
    )  # fmt: skip
    ax.set(xlabel="frequency [Hz]", ylabel="probability that a mode grows", ylim=(0.0, None))
    return figure


def study_figures(result: StudyResult) -> dict[str, Figure]:
    """Every figure that a study has something for, by the name of its file."""
    drawn: dict[str, Figure] = {}
    if not result.done.any() or result.compute not in ("modes", "onsets"):
        return drawn
    varied = _varied(result)
    if len(varied) >= 2:
        drawn["stability-map"] = stability_map(result)
    for name in varied[:4]:
        drawn[f"over-{_file(name)}"] = growth_over(result, name)
    if result.compute == "modes":
        drawn["root-locus"] = root_locus(result)
        if result.method not in ("grid", "saltelli") and result.unstable.any():
            drawn["bands"] = band_probability(result)
    if result.method == "saltelli":
        with contextlib.suppress(AnalysisError):  # the summary says why there are none
            drawn["sobol-indices"] = tornado(result.indices())
    return drawn


def _varied(result: StudyResult) -> list[str]:
    """Parameters with more than one value among the samples."""
    return [name for name in result.parameters if len(np.unique(result.data[name].values)) > 1]


def _two(result: StudyResult, x: str | None, y: str | None) -> tuple[str, str]:
    if result.compute not in ("modes", "onsets"):
        raise AnalysisError(f"{result.compute} has neither growth rates nor onsets; a map is of modes or onsets")
    for name in (x, y):
        if name is not None and name not in result.parameters:
            raise AnalysisError(f"{name} is no parameter of the study; there are {', '.join(result.parameters)}")
    varied = [name for name in _varied(result) if name not in (x, y)]
    first = x or (varied.pop(0) if varied else "")
    second = y or (varied.pop(0) if varied else "")
    if not first or not second:
        raise AnalysisError("a map needs two parameters that vary")
    return first, second


def _named(result: StudyResult, name: str) -> str:
    unit = result.data[name].attrs.get("units", "")
    return f"{name} [{unit}]" if unit not in ("", "1") else "friction coefficient μ" if name == "mu" else name


def _file(name: str) -> str:
    return "".join(c if c.isalnum() else "-" for c in name)


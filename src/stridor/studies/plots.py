"""Figures of a study, from its store alone: where it squeals, at which frequency, how likely, and what decides it."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..asking import instance, takes
from ..errors import AnalysisError
from ..typing import Array
from ..view.colours import BLUE, GREY, INK, ORANGE, VERMILION
from ..view.style import legend_above, panel, styled
from .analysis_plots import analysis_figures
from .maps import critical_map, growth_map, stability_map
from .plot_parts import along, file_name, friction_range, key, varied
from .result import StudyResult, numbers
from .uncertainty import Indices, grows

MOST_POINTS = 20_000  # of a cloud
MANY = 500  # samples, whose marks are small
MARGIN = 1.6  # of a logarithmic axis, times its ends


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
        low, high = min(float(growth[flat].min()), 0.0), max(float(growth[flat].max()), 0.0)
        ax.set_yscale("symlog", linthresh=linear)
        ax.set_ylim(MARGIN * low - 0.1 * linear, MARGIN * high + 0.1 * linear)  # its own cut marks at the ends
        # Within the linear part there is room for zero alone.
        ax.set_yticks([tick for tick in ax.get_yticks() if tick == 0.0 or abs(tick) >= 0.5 * linear])
    ax.set(xlabel="frequency [Hz]", ylabel="growth rate [1/s]")
    legend_above(ax, columns=3)
    return figure


@styled
def onset_cloud(result: StudyResult, *, ax: Axes | None = None) -> Figure:
    """Every onset kept of every row at its friction coefficient and frequency: where a mode begins to grow, and where
    one ceases to. Ringed: the first of a row, its critical one."""
    if result.compute != "onsets":
        raise AnalysisError("a figure of onsets is that of onsets; the study computed others")
    figure, ax = panel(ax, 4.2)
    mu, frequency, ends = (
        np.asarray(result.data[n].values)[result.done] for n in ("onset_mu", "onset_frequency_hz", "onset_ends_growth")
    )
    for chosen, fill, label in ((ends == 0, VERMILION, "growth begins"), (ends == 1, "none", "growth ends")):
        shown = chosen & np.isfinite(mu)
        if shown.any():
            (drawn,) = ax.plot(mu[shown], frequency[shown], "o", mfc=fill, mec=VERMILION, ms=3.5, mew=0.7, label=label)
            drawn.set_clip_on(False)
    first = numbers(result, "critical_frequency_hz")
    if np.isfinite(first).any():
        at = numbers(result, "critical_mu")
        words = "the critical one of its sample"
        ax.plot(at, first, "o", mfc="none", mec=INK, ms=6, mew=0.6, label=words, clip_on=False)
    ax.set(xlim=friction_range(result), ylim=(0.0, None), xlabel="friction coefficient μ", ylabel="frequency [Hz]")
    if not np.isfinite(mu).any():
        ax.text(0.5, 0.5, "no onset found", transform=ax.transAxes, ha="center", va="center", color=GREY)
    legend_above(ax, columns=3)
    return figure


@styled
def growth_over(result: StudyResult, x: str | None = None, *, ax: Axes | None = None) -> Figure:
    """The largest growth rate over one parameter (default: the first that varies), or the critical friction
    coefficient of a study of onsets; samples without onset at the end of the range, where it lies at least."""
    name = x or next(iter(varied(result)), None)
    if name is None:
        raise AnalysisError("no parameter has more than one value among the samples")
    what = {"modes": "largest_growth_rate", "onsets": "critical_mu"}.get(result.compute)
    if what is None:
        raise AnalysisError(f"{result.compute} has neither growth rates nor onsets")
    figure, ax = panel(ax, 3.6)
    at, values = numbers(result, name), numbers(result, what)
    order = np.argsort(at)
    alone = len(varied(result)) == 1
    size = 3 if alone or len(at) > MANY else 5
    ax.plot(at[order], values[order], "-o" if alone else ".", ms=size, color=BLUE, alpha=1.0 if alone else 0.5)
    if result.compute == "modes":
        ax.axhline(0.0, color=GREY, linewidth=0.8)
    else:
        legend_above(ax, _beyond(result, ax, at, values))
    label = "largest growth rate [1/s]" if result.compute == "modes" else "critical friction coefficient"
    along(result, ax, name)
    ax.set_ylabel(label)
    return figure


def _beyond(result: StudyResult, ax: Axes, at: Array, critical: Array) -> list[Artist]:
    """Marks of what is known by an end of the range of friction alone: the critical coefficient lies there or above,
    there or below."""
    low, high = friction_range(result)
    early = numbers(result, "growing_at_start") > 0
    handles: list[Artist] = []
    for chosen, end, marker, label in (
        (~np.isfinite(critical), high, "^", f"no onset up to μ = {high:g}"),
        (early, low, "v", f"grows at μ = {low:g} already"),
    ):
        if chosen.any():
            ax.plot(at[chosen], np.full(np.count_nonzero(chosen), end), marker, color=GREY, ms=5, mfc="none")
            handles.append(key(marker, label, GREY, filled=False))
    return handles


@styled
def tornado(indices: Indices, *, ax: Axes | None = None) -> Figure:
    """Sobol indices, the most important parameter on top: first order and total, with their half-widths."""
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


@takes(result=instance(StudyResult, "a study's result, of st.run_study or st.open_study(path)"))
def study_figures(result: StudyResult) -> dict[str, Figure]:
    """Every figure that a study has something for, by the name of its file."""
    drawn: dict[str, Figure] = {}
    if not result.done.any():
        return drawn
    if result.compute not in ("modes", "onsets"):
        return analysis_figures(result)
    names = varied(result)
    if len(names) >= 2 and result.compute == "modes":
        drawn |= {"stability-map": stability_map(result), "growth-map": growth_map(result)}
    elif len(names) >= 2:
        drawn["critical-map"] = critical_map(result)
    for name in names[:4]:
        drawn[f"over-{file_name(name)}"] = growth_over(result, name)
    if result.compute == "modes":
        drawn["root-locus"] = root_locus(result)
        if result.method not in ("grid", "saltelli") and result.unstable.any():
            drawn["bands"] = band_probability(result)
    else:
        drawn["onsets"] = onset_cloud(result)
    if result.method == "saltelli":
        with contextlib.suppress(AnalysisError):  # the summary says why there are none
            drawn["sobol-indices"] = tornado(result.indices())
    return drawn

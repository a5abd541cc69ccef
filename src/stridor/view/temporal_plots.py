"""Figures of the temporal approach: histories, spectra, the contact over a few periods, energies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MultipleLocator

from ..digits import measured
from ..temporal.energy import EnergyBalance
from ..temporal.signals import Spectrogram, Spectrum, low_passed
from ..temporal.trajectory import Trajectory
from ..typing import Array
from .colours import BLUE, COLOURS, GREEN, GREY, INK, ORANGE, PURPLE, SKY, STATUS_COLOURS, VERMILION
from .style import (
    draw_history,
    extrema,
    legend_above,
    new_figure,
    panel,
    root_figure,
    stacked,
    styled,
    thinned,
    zero_line,
)
from .units import energy_unit, frequency_unit, frequency_words, time_unit
from .windows import Window, status_spans

DIRECTIONS = {"x": 0, "y": 1, "z": 2}
DECIBEL_SPAN = 70.0  # shown below the largest line
HELD = "does not move: zero throughout"
USUAL = 99.7  # per cent of a history that its axis must show


@styled
def acceleration_history(
    trajectory: Trajectory,
    point: str | None = None,
    *,
    direction: str = "x",
    max_frequency_hz: float | None = None,
    whole: bool = False,
    ax: Axes | None = None,
) -> Figure:
    """Acceleration of a watched point (the first by default) over the whole run, phases marked.

    max_frequency_hz draws what lies below it in front of the whole signal. Impacts may be hundreds of times
    larger than the vibration between them: unless ``whole``, the axis shows what nearly all pieces of the
    run reach, and says what is cut off.
    """
    figure, ax = panel(ax, 3.6)
    number = 0 if point is None else trajectory.watch_names.index(point)
    values, time = trajectory.acceleration[:, number, DIRECTIONS[direction]], trajectory.time
    band = values if max_frequency_hz is None else low_passed(values, trajectory.sampling, max_frequency_hz)
    if len(band) < len(values):
        draw_history(ax, time, values, colour=SKY, width=0.5, label="all frequencies")
        cut = (len(values) - len(band)) // 2
        assert max_frequency_hz is not None, "nothing is cut off without a limit"
        name = f"up to {frequency_words(max_frequency_hz)}"
        draw_history(ax, time[cut : cut + len(band)], band, width=0.6, label=name)
        ax.legend(loc="upper left")
    else:
        draw_history(ax, time, values, width=0.6)
    if not values.any():
        _say(ax, HELD)
    mark_phases(ax, trajectory)
    zero_line(ax)
    ax.set(xlabel="time [s]", ylabel=f"acceleration {direction} [m/s²]")
    ax.set_xlim(float(time[0]), float(time[-1]))
    if not whole:
        _usual_limits(ax, values, around=band)
    return figure


@styled
def spectrum_plot(
    spectra: Mapping[str, Spectrum],
    *,
    max_frequency_hz: float = 40e3,
    unit: str = "m/s²",
    marked_hz: float | None = None,
    ax: Axes | None = None,
) -> Figure:
    """Amplitude spectra in dB re 1 ``unit``: a panel for each signal, or all of them in the given axes.

    marked_hz, the fundamental, is drawn with its multiples.
    """
    if ax is None:
        figure = new_figure(0.8 + 1.3 * len(spectra))
        axes = list(figure.subplots(len(spectra), 1, sharex=True, sharey=True, squeeze=False)[:, 0])
    else:
        figure, axes = root_figure(ax), [ax] * len(spectra)
    top = -np.inf
    scale, its_name = frequency_unit(max_frequency_hz)
    for index, (name, spec) in enumerate(spectra.items()):
        inside = (spec.frequency_hz > 0) & (spec.frequency_hz <= max_frequency_hz)
        if not spec.amplitude[inside].any():  # of nothing there are no decibels
            if ax is None:
                axes[index].set_title(name, fontsize=9, color=COLOURS[index % len(COLOURS)], pad=3)
                _say(axes[index], HELD)
            continue
        level = 20 * np.log10(np.maximum(spec.amplitude[inside], 1e-300))
        top = max(top, float(level.max(initial=-np.inf)))
        colour = COLOURS[index % len(COLOURS)]
        axes[index].plot(spec.frequency_hz[inside] / scale, level, color=colour, linewidth=0.9, label=name)
        if ax is None:
            axes[index].set_title(name, fontsize=9, color=colour, pad=3)
    for each in dict.fromkeys(axes):
        if ax is not None:
            each.set_ylabel(f"dB re 1 {unit}")
        each.yaxis.set_major_locator(MultipleLocator(20))
        if marked_hz:
            _mark_harmonics(each, marked_hz, max_frequency_hz, scale, named=each is axes[0])
    if np.isfinite(top):
        axes[0].set_ylim(top - DECIBEL_SPAN, top + 8)
    elif ax is not None:
        _say(ax, HELD)
    axes[-1].set(xlabel=f"frequency [{its_name}]", xlim=(0, max_frequency_hz / scale))
    if ax is not None:
        if ax.get_legend_handles_labels()[0]:
            ax.legend()
    else:
        figure.supylabel(f"amplitude [dB re 1 {unit}]", fontsize=9.5)
    return figure


@styled
def spectrogram_plot(
    content: Spectrogram,
    *,
    start: float = 0.0,
    max_frequency_hz: float = 40e3,
    unit: str = "m/s",
    ax: Axes | None = None,
) -> Figure:
    """Short-time spectra over time in dB below the largest line; ``start`` [s] is where the signal begins."""
    figure, ax = panel(ax, 3.6)
    inside = content.frequency_hz <= max_frequency_hz
    amplitude = content.amplitude[inside]
    scale, its_name = frequency_unit(max_frequency_hz)
    if not amplitude.any():
        ax.set(xlabel="time [s]", ylabel=f"frequency [{its_name}]")
        _say(ax, HELD)
        return figure
    level = 20 * np.log10(np.maximum(amplitude / largest_of(amplitude), 1e-300))
    time, frequency = start + content.time, content.frequency_hz[inside] / scale
    half = 0.5 * float(time[1] - time[0]) if len(time) > 1 else 0.5 / content.resolution_hz
    image = ax.imshow(
        level,
        extent=(float(time[0]) - half, float(time[-1]) + half, float(frequency[0]), float(frequency[-1])),
        origin="lower",
        aspect="auto",
        interpolation="bilinear",
        vmin=-60,
        vmax=0,
        cmap="cividis",
    )
    ax.set(xlabel="time [s]", ylabel=f"frequency [{its_name}]")
    ax.grid(False)
    figure.colorbar(image, ax=ax, pad=0.01, label=f"dB re {largest_of(amplitude):.3g} {unit}")
    return figure


def largest_of(amplitude: Array) -> float:
    """The largest amplitude, 1 where all are zero."""
    size = float(amplitude.max(initial=0.0))
    return size if size > 0 else 1.0


@styled
def contact_force_and_velocity(
    trajectory: Trajectory,
    window: Window | tuple[float, float],
    *,
    contact: int = 0,
    slave: str | None = None,
    tangent: tuple[float, float] = (1.0, 0.0),
    steady_force: float | None = None,
    axes: Sequence[Axes] | None = None,
) -> Figure:
    """Normal force above, velocities along the tangent below, stick, slip and separation shaded.

    slave names the watched point that is the contact's slave: its velocity and that of the point of the
    master under it are drawn. Without it the slip speed alone is.
    """
    start, end = window if isinstance(window, tuple) else (window.start, window.end)
    first, last = np.searchsorted(trajectory.time, [start, end])
    part = slice(int(first), int(last) + 1)
    figure, (above, below) = stacked(axes, 2, 4.6)
    unit, its_name = time_unit(end - start, end)
    time = trajectory.time[part] / unit
    force = trajectory.normal_force[part, contact]
    above.plot(time, force, color=INK, linewidth=1.4, label="normal force")
    if steady_force is not None:
        above.axhline(steady_force, color=GREEN, linestyle="--", linewidth=1.2, label="steady sliding")
    above.set_ylabel("normal force [N]")
    top = max(float(force.max(initial=0.0)), 1e-12)
    above.set_ylim(-0.04 * top, 1.08 * top)
    _velocities(below, trajectory, part, contact, slave, np.asarray(tangent), unit)
    zero_line(below)
    below.set(xlabel=f"time [{its_name}]", xlim=(time[0], time[-1]))
    seen = _shade(trajectory, part, contact, (above, below), unit)
    patches = [Patch(fc=STATUS_COLOURS[name], ec=GREY, lw=0.5, label=name) for name in seen]
    legend_above(above, [*above.get_legend_handles_labels()[0], *patches])
    legend_above(below)
    figure.align_ylabels()
    return figure


def _velocities(
    ax: Axes, trajectory: Trajectory, part: slice, contact: int, slave: str | None, tangent: Array, unit: float
) -> None:
    time, slip = trajectory.time[part] / unit, trajectory.slip_speed[part, contact]
    if slave is None:
        ax.plot(time, slip, color=BLUE, label="slave against master")
        ax.set_ylabel("slip velocity [m/s]")
        return
    velocity = trajectory.velocity[part, trajectory.watch_names.index(slave)] @ tangent
    ax.plot(time, velocity, color=BLUE, label=f"slave point {slave}")
    ax.plot(time, velocity - slip, color=VERMILION, linestyle="--", label="point of the master under it")
    ax.set_ylabel("tangential velocity [m/s]")


def _shade(trajectory: Trajectory, part: slice, contact: int, axes: Sequence[Axes], unit: float) -> list[str]:
    spans = status_spans(trajectory, part, contact)
    for name, start, end in spans:
        for ax in axes:
            ax.axvspan(start / unit, end / unit, fc=STATUS_COLOURS[name], lw=0, zorder=0.5)
    return [name for name in STATUS_COLOURS if any(span[0] == name for span in spans)]


@styled
def contact_history(trajectory: Trajectory, *, contact: int = 0, axes: Sequence[Axes] | None = None) -> Figure:
    """Normal force and slip speed of a contact over the whole run, phases marked."""
    figure, (above, below) = stacked(axes, 2, 4.4)
    draw_history(above, trajectory.time, trajectory.normal_force[:, contact], colour=INK, width=0.6)
    draw_history(below, trajectory.time, trajectory.slip_speed[:, contact], colour=BLUE, width=0.6)
    above.set_ylabel("normal force [N]")
    below.set(xlabel="time [s]", ylabel="slip velocity [m/s]")
    for ax, values in ((above, trajectory.normal_force), (below, trajectory.slip_speed)):
        _usual_limits(ax, values[:, contact], symmetric=False)
    mark_phases(above, trajectory)
    mark_phases(below, trajectory, named=False)
    zero_line(below)
    below.set_xlim(float(trajectory.time[0]), float(trajectory.time[-1]))
    figure.align_ylabels()
    return figure


@styled
def phase_portrait(
    trajectory: Trajectory,
    window: Window | tuple[float, float],
    *,
    contact: int = 0,
    ax: Axes | None = None,
) -> Figure:
    """Normal force over slip speed of a contact inside a window of time."""
    figure, ax = panel(ax, 4.0, 4.6)
    start, end = window if isinstance(window, tuple) else (window.start, window.end)
    first, last = np.searchsorted(trajectory.time, [start, end])
    part = slice(int(first), int(last) + 1)
    ax.plot(trajectory.slip_speed[part, contact], trajectory.normal_force[part, contact], color=BLUE, lw=1.0)
    ax.axvline(0.0, color=INK, linewidth=0.8, zorder=1.5)
    ax.set(xlabel="slip velocity, slave against master [m/s]", ylabel="normal force [N]")
    return figure


@styled
def energy_plot(trajectory: Trajectory, balance: EnergyBalance, *, axes: Sequence[Axes] | None = None) -> Figure:
    """Energies over time: what was put in, stored and taken out; below, what is missing in the balance."""
    figure, (above, below) = stacked(axes, 2, 4.8, (2.2, 1))
    step = thinned(len(trajectory.time))
    time = trajectory.time[step]
    works = trajectory.works
    stored = (trajectory.kinetic + trajectory.elastic)[step]
    curves = (
        ("put in by loads", works["external"][step], BLUE, "-"),
        ("put in by moving supports", works["support"][step], SKY, "-"),
        ("stored", stored, INK, "-"),
        ("taken out by damping", works["damping"][step], GREEN, "--"),
        ("taken out by friction", works["friction"][step], VERMILION, "--"),
        ("into impacts and contact springs", works["contact"][step], PURPLE, "--"),
        *((f"put in by {name} forces", works[name][step], ORANGE, "-") for name in ("circulatory",) if name in works),
    )
    unit, its_name = energy_unit(max(float(np.abs(values).max(initial=0.0)) for _, values, _, _ in curves))
    for name, values, colour, style in curves:
        above.plot(time, values / unit, style, color=colour, label=name, linewidth=1.3)
    above.set_ylabel(f"energy [{its_name}]")
    legend_above(above, columns=3)
    mark_phases(above, trajectory, named=False)
    if len(balance.history) == len(trajectory.time):
        draw_history(below, trajectory.time, balance.history / (balance.turnover or 1.0), colour=ORANGE)
    zero_line(below)
    below.set(xlabel="time [s]", ylabel="imbalance\n/ turnover")
    below.set_xlim(float(trajectory.time[0]), float(trajectory.time[-1]))
    figure.align_ylabels()
    return figure


def mark_phases(ax: Axes, trajectory: Trajectory, *, named: bool = True) -> None:
    """Lines where phases begin, their names above the frame."""
    for phase in trajectory.phases:
        if phase.start > 0:
            ax.axvline(phase.start, color=INK, linestyle=":", linewidth=1.0)
        if named:
            middle = (phase.start + min(phase.end, float(trajectory.time[-1]))) / 2
            ax.annotate(
                f"phase “{phase.name}”",
                (middle, 1.0),
                xycoords=("data", "axes fraction"),
                xytext=(0, 3),
                textcoords="offset points",
                ha="center",
                va="bottom",
                fontsize=8.5,
                color=GREY,
            )


def _usual_limits(ax: Axes, values: Array, *, around: Array | None = None, symmetric: bool = True) -> None:
    """Limits of what most pieces of a history (or of ``around``) reach; a note where peaks leave the frame."""
    judged = values if around is None else around
    _, low, high = extrema(np.arange(len(judged), dtype=float), judged)
    top, bottom = float(np.percentile(high, USUAL)), float(np.percentile(low, 100 - USUAL))
    if symmetric:
        top = max(top, -bottom)
        bottom = -top
    ends = float(values.min()), float(values.max())
    beyond = 0.3 * (top - bottom)
    leaves = ends[0] < bottom - beyond, ends[1] > top + beyond
    if top <= bottom:
        return
    if not any(leaves):
        if not bottom - beyond <= 0.0 <= top + beyond:  # else the line at zero would flatten what swings far from it
            room = 0.05 * (ends[1] - ends[0])
            ax.set_ylim(ends[0] - room, ends[1] + room)
        return
    margin = (0.08 if around is None else 0.25) * (top - bottom)
    low_end, high_end = bottom - margin, top + margin
    # At an end that no peak leaves by much the frame is wide enough for all that is there.
    shown = low_end if leaves[0] else min(low_end, ends[0]), high_end if leaves[1] else max(high_end, ends[1])
    ax.set_ylim(*((-max(-shown[0], shown[1]), max(-shown[0], shown[1])) if symmetric else shown))
    peak = max((end for end, gone in zip(ends, leaves, strict=True) if gone), key=abs)
    ax.annotate(
        f"single peaks leave the frame, the largest {abs(peak):.3g}",
        (0.995, 0.015),
        xycoords="axes fraction",
        ha="right",
        va="bottom",
        fontsize=8,
        color=GREY,
        bbox={"boxstyle": "round,pad=0.2", "fc": "white", "ec": "none", "alpha": 0.85},
    )


def _say(ax: Axes, words: str) -> None:
    """Words in the middle of a panel that has nothing to show."""
    ax.text(0.5, 0.6, words, transform=ax.transAxes, ha="center", va="center", color=GREY)


def _mark_harmonics(ax: Axes, fundamental: float, top: float, unit: float, *, named: bool) -> None:
    count = int(top / fundamental)
    for k in range(1, min(count, 8) + 1):
        ax.axvline(k * fundamental / unit, color=GREY, linestyle=":", linewidth=0.9, zorder=1.2)
    if named:
        note = [Line2D([], [], color=GREY, linestyle=":", label=f"{measured(fundamental, 0)} Hz and its multiples")]
        ax.legend(handles=note, loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.1)

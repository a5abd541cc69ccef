"""Figures of the modal approach: branches over friction, root loci, the friction curve."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ..digits import measured
from ..errors import CaseError, kind_of
from ..modal.complex_modes import ComplexModes
from ..modal.onsets import Onset, Onsets
from ..typing import Array, BoolArray
from .colours import BLUE, GREEN, GREY, INK, ORANGE, PURPLE, SKY, VERMILION
from .style import legend_above, panel, root_figure, styled, zero_line
from .units import frequency_unit

LINES = (BLUE, GREEN, PURPLE, SKY, ORANGE)  # vermilion is kept for what is unstable
MU = "friction coefficient μ"
FEW = 6  # up to so many branches each has its own colour and a name
MARKED = 40  # unstable points marked along a branch, at most
RANGE_OF_CURVE = (0.0, 1.0)
DIAMOND, LETTER, LABEL_HEIGHT = 3.5, 5.3, 25.0  # of onsets and of their labels, with the white about these [points]


@styled
def root_locus(modes: ComplexModes, *, max_frequency_hz: float | None = None, ax: Axes | None = None) -> Figure:
    """Eigenvalues of a sweep in the plane of growth rate and frequency, coloured by friction."""
    _require_modes(modes)
    figure, ax = panel(ax, 4.4)
    top = _top(modes, max_frequency_hz)
    scatter = None
    # One scale for all: scatter leaves out what is NaN and would scale each branch by the μ at which it is listed.
    norm = Normalize(float(modes.mu.min()), float(modes.mu.max()))
    unit, its_name = frequency_unit(top)
    for b in range(len(modes.branch)):
        growth, frequency = modes.growth_rate[:, b], modes.frequency_hz[:, b] / unit
        ax.plot(growth, frequency, color="#BBBBBB", linewidth=0.8, zorder=2)
        scatter = ax.scatter(
            growth, frequency, c=modes.mu, norm=norm, cmap="viridis", s=9, zorder=3, linewidths=0, rasterized=True
        )
    ax.axvline(0.0, color=INK, linewidth=0.8, zorder=1.5)
    ax.set(
        xlabel="growth rate Re λ [1/s]   (right of 0: grows)", ylabel=f"frequency [{its_name}]", ylim=(0, top / unit)
    )
    shown = modes.frequency_hz <= top
    reach = 1.05 * float(np.abs(modes.growth_rate[shown]).max(initial=1.0))
    # Growth spans decades between modes; the middle stays linear, so that the axis itself is seen crossed.
    linear = 10.0 ** np.floor(np.log10(max(reach / 30, 1e-9)))
    ax.set_xscale("symlog", linthresh=linear, linscale=0.6)
    ticks = [linear * 10**k for k in range(8) if linear * 10**k <= reach]
    ax.set_xticks([*(-t for t in reversed(ticks)), 0.0, *ticks])
    ax.minorticks_off()
    ax.set_xlim(-1.2 * reach, 1.2 * reach)
    if scatter is not None and len(modes.mu) > 1:
        figure.colorbar(scatter, ax=ax, label=MU, pad=0.01)
    return figure


@styled
def frequency_branches(
    modes: ComplexModes,
    branches: Sequence[int] | None = None,
    *,
    onsets: Onsets | None = None,
    max_frequency_hz: float | None = None,
    ax: Axes | None = None,
) -> Figure:
    """Frequencies over friction, one line per branch; unstable stretches marked, onsets where given."""
    _require_modes(modes)
    columns = _columns(modes, branches)
    figure, ax = panel(ax, 3.5 if len(columns) <= FEW else 5.2)
    scale, unit = (1.0, "Hz") if len(columns) <= FEW else frequency_unit(_top(modes, max_frequency_hz))
    few = len(columns) <= FEW
    for index, b in enumerate(columns):
        values, unstable = modes.frequency_hz[:, b] / scale, modes.unstable[:, b]
        colour = LINES[index % len(LINES)] if few else BLUE
        style = "--" if few and index % 2 else "-"
        label = f"mode {modes.branch[b]}" if few else None
        ax.plot(modes.mu, values, style, color=colour, label=label, linewidth=1.5 if few else 1.1)
        _mark_unstable(ax, modes.mu, values, unstable)
    if not few:
        ax.set_ylim(0, _top(modes, max_frequency_hz) / scale)
    _friction_axis(ax, modes)
    unnamed = 0
    if onsets is not None:
        marked = [
            (onset.mu, onset.frequency_hz / scale, onset)
            for onset in onsets.onsets
            if (branches is None or set(onset.branches) & set(branches)) and onset.mu <= modes.mu.max()
        ]
        unnamed = _mark_onsets(ax, marked, beside=few)
    ax.set_ylabel(f"frequency [{unit}]")
    _legend(ax, bool(modes.unstable[:, columns].any()), onsets is not None, unnamed)
    return figure


@styled
def growth_branches(
    modes: ComplexModes,
    branches: Sequence[int] | None = None,
    *,
    imaginary_frequency: bool = False,
    ax: Axes | None = None,
) -> Figure:
    """Growth rates Re λ over friction, one line per branch.

    imaginary_frequency draws Im ω/2π = −Re λ/2π [Hz] of motion written as exp(jωt) instead: negative
    where it grows.
    """
    _require_modes(modes)
    columns = _columns(modes, branches)
    figure, ax = panel(ax, 3.5)
    few = len(columns) <= FEW
    factor = -1 / (2 * np.pi) if imaginary_frequency else 1.0
    for index, b in enumerate(columns):
        colour = LINES[index % len(LINES)] if few else BLUE
        style = "--" if few and index % 2 else "-"
        values = factor * modes.growth_rate[:, b]
        label = f"mode {modes.branch[b]}" if few else None
        ax.plot(modes.mu, values, style, color=colour, label=label, linewidth=1.5 if few else 1.1)
        _mark_unstable(ax, modes.mu, values, modes.unstable[:, b])
    zero_line(ax)
    _friction_axis(ax, modes)
    name = "imaginary part of frequency Im ω/2π [Hz]" if imaginary_frequency else "growth rate Re λ [1/s]"
    ax.set_ylabel(name)
    _legend(ax, bool(modes.unstable[:, columns].any()), False)
    return figure


@styled
def damping_branches(modes: ComplexModes, branches: Sequence[int] | None = None, *, ax: Axes | None = None) -> Figure:
    """Damping ratios −Re λ/|λ| in per cent over friction; negative: unstable."""
    _require_modes(modes)
    columns = _columns(modes, branches)
    figure, ax = panel(ax, 3.5)
    few = len(columns) <= FEW
    for index, b in enumerate(columns):
        colour = LINES[index % len(LINES)] if few else BLUE
        values = 100 * modes.damping_ratio[:, b]
        label = f"mode {modes.branch[b]}" if few else None
        ax.plot(modes.mu, values, color=colour, label=label, linewidth=1.5 if few else 1.1)
        _mark_unstable(ax, modes.mu, values, modes.unstable[:, b])
    zero_line(ax)
    _friction_axis(ax, modes)
    ax.set_ylabel("damping ratio [%]")
    _legend(ax, bool(modes.unstable[:, columns].any()), False)
    return figure


@styled
def friction_curve(
    mu: Array,
    frequency_hz: Array,
    *,
    onsets: Onsets | None = None,
    case_mu: float | None = None,
    friction_range: tuple[float, float] = RANGE_OF_CURVE,
    ax: Axes | None = None,
) -> Figure:
    """The friction μ(ω) at which the undamped system has the frequency ω; onsets are its maxima.

    mu, frequency_hz (k,), frequencies ascending. A horizontal line at any μ cuts the curve at the
    frequencies of the real modes there; above a maximum two of them are gone: they have become complex.
    """
    figure, ax = panel(ax, 4.0)
    low, high = friction_range
    span = high - low
    unit, its_name = frequency_unit(float(frequency_hz[-1]))
    for piece in _pieces(mu, low - 0.15 * span, high + 0.15 * span):
        ax.plot(frequency_hz[piece] / unit, mu[piece], color=BLUE, linewidth=1.4)
    if case_mu is not None:
        ax.axhline(case_mu, color=GREY, linestyle=":", linewidth=1.2)
        ax.annotate(
            f"μ = {case_mu:g}",
            (1.0, case_mu),
            xycoords=("axes fraction", "data"),
            ha="right",
            va="bottom",
            fontsize=8.5,
            color=GREY,
        )
    ax.set(
        xlabel=f"frequency [{its_name}]",
        ylabel=MU,
        ylim=(low - 0.02 * span, high + 0.06 * span),
        xlim=(frequency_hz[0] / unit, frequency_hz[-1] / unit),
    )
    named = onsets.onsets if onsets is not None else ()
    _mark_onsets(ax, [(onset.frequency_hz / unit, onset.mu, onset) for onset in named if low <= onset.mu <= high])
    return figure


def _columns(modes: ComplexModes, branches: Sequence[int] | None) -> list[int]:
    """Columns of the branches with the given numbers, all by default."""
    if branches is None:
        return list(range(len(modes.branch)))
    where = {int(number): column for column, number in enumerate(modes.branch)}
    missing = [number for number in branches if number not in where]
    if missing:
        raise ValueError(f"branches {missing}: not among those followed, 1 to {len(modes.branch)}")
    return [where[number] for number in branches]


def _require_modes(given: object) -> None:
    """Raises CaseError for what is no modes."""
    if not isinstance(given, ComplexModes):
        raise CaseError("modes", kind_of(given), "complex modes, of st.modes(case, mu)")


def _top(modes: ComplexModes, max_frequency_hz: float | None) -> float:
    if max_frequency_hz is not None:
        return max_frequency_hz
    known = modes.frequency_hz[np.isfinite(modes.frequency_hz)]  # where a branch is not known there is NaN
    return 1.03 * float(known.max(initial=1.0))


def _friction_axis(ax: Axes, modes: ComplexModes) -> None:
    ax.set_xlabel(MU)
    low, high = float(modes.mu.min()), float(modes.mu.max())
    if low < high:  # of one coefficient, however often, there is no axis to cut
        ax.set_xlim(low, high)
    order = np.argsort(modes.mu, kind="stable")
    mu, solved = modes.mu[order], modes.solved[order]
    # Grey from the last μ with modes to the next, else it would look like no growth; where between them steady sliding
    # ends is not known here.
    unsolved = np.flatnonzero(~solved)
    for run in np.split(unsolved, np.flatnonzero(np.diff(unsolved) > 1) + 1) if len(unsolved) else ():
        start, end = float(mu[max(run[0] - 1, 0)]), float(mu[min(run[-1] + 1, len(mu) - 1)])
        ax.axvspan(start, end, color="0.92", linewidth=0, zorder=0)
        ax.text(
            (start + end) / 2, 0.98, "nothing solved", transform=ax.get_xaxis_transform(), rotation=90, ha="center",
            va="top", color="0.35", fontsize=8,
        )  # fmt: skip


def _mark_unstable(ax: Axes, mu: Array, values: Array, unstable: BoolArray) -> None:
    """Thick line and open circles where a branch is unstable."""
    if not unstable.any():
        return
    points = np.column_stack([mu, values])
    both = unstable[:-1] & unstable[1:]
    segments = np.stack([points[:-1][both], points[1:][both]], axis=1)
    ax.add_collection(LineCollection(list(segments), colors=VERMILION, linewidths=2.2, zorder=3))
    marked = np.flatnonzero(unstable)[:: max(1, len(mu) // MARKED)]
    ax.plot(mu[marked], values[marked], "o", mfc="white", mec=VERMILION, ms=4, mew=1.0, zorder=3.5)


def _mark_onsets(ax: Axes, marked: Sequence[tuple[float, float, Onset]], *, beside: bool = False) -> int:
    """Diamonds at onsets, of each its place (x, y) in the axes, with their μ and frequency where that covers neither
    another one nor a diamond; how many have no room. Axes must have their limits; beside: rather below right."""
    for x, y, _ in marked:
        ax.plot(x, y, "D", color=INK, ms=4.5, zorder=4)
    ax.autoscale_view()  # takes what was drawn into limits that are not set
    # Points of print. What lays a figure out makes axes larger than they are here, and labels part further.
    per_point = 72.0 / root_figure(ax).dpi
    at = per_point * np.reshape(ax.transData.transform([(x, y) for x, y, _ in marked] or np.zeros((0, 2))), (-1, 2))
    frame = per_point * ax.get_window_extent().get_points()
    taken = [(x - DIAMOND, y - DIAMOND, x + DIAMOND, y + DIAMOND) for x, y in at]
    unnamed = 0
    for own, ((x, y), (*place, onset)) in enumerate(zip(at, marked, strict=True)):
        text = f"μ = {measured(onset.mu, 4)}\n{measured(onset.frequency_hz, 0)} Hz"
        wide, high = LETTER * max(map(len, text.split("\n"))), LABEL_HEIGHT
        for dx, dy in _offsets(wide, high, beside):
            box = x + dx - wide / 2, y + dy - high / 2, x + dx + wide / 2, y + dy + high / 2
            inside = frame[0, 1] <= box[1] and box[3] <= frame[1, 1] and frame[0, 0] - wide / 2 <= box[0]
            inside = inside and box[2] <= frame[1, 0] + wide / 2
            if inside and not any(_overlap(box, other) for k, other in enumerate(taken) if k != own):
                break
        else:
            unnamed += 1
            continue
        taken.append(box)
        far = abs(dy) > high
        ax.annotate(
            text,
            (place[0], place[1]),
            xytext=(dx, dy),
            textcoords="offset points",
            ha="center",
            va="center",
            fontsize=8,
            zorder=5,
            bbox={"boxstyle": "round,pad=0.15", "fc": "white", "ec": "none", "alpha": 0.85},
            arrowprops={"arrowstyle": "-", "color": GREY, "lw": 0.6, "shrinkB": 3} if far else None,
        )
    return unnamed


def _offsets(wide: float, high: float, beside: bool) -> list[tuple[float, float]]:
    """Places of a label's middle about its onset [points], the first that is free is taken: near ones first."""
    side, near = wide / 2 + 7, high / 2 + 7
    above, below = [(0.0, near), (side, near), (-side, near)], [(0.0, -near), (side, -near), (-side, -near)]
    level = [(side, 0.0), (-side, 0.0)]
    far = [(x, sign * (near + high + 3)) for sign in (1, -1) for x in (0.0, side, -side)]
    return (
        [below[1], above[1], *level, *above, *below, *far]
        if beside
        else [*above[:1], *below[:1], *level, *above, *below, *far]
    )


def _overlap(a: tuple[float, ...], b: tuple[float, ...]) -> bool:
    """Whether two boxes (left, bottom, right, top) do."""
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def _legend(ax: Axes, unstable: bool, onsets: bool, unnamed: int = 0) -> None:
    handles, _ = ax.get_legend_handles_labels()
    if unstable:
        handles.append(Line2D([], [], color=VERMILION, marker="o", mfc="white", ms=4, linewidth=2.2, label="unstable"))
    if onsets:
        words = "onset, solved" + (f" ({unnamed} without room for their values)" if unnamed else "")
        handles.append(Line2D([], [], color=INK, marker="D", ms=4.5, linestyle="none", label=words))
    legend_above(ax, handles)


def _pieces(values: Array, low: float, high: float) -> list[slice]:
    """Stretches of a curve inside a band, with the points just beyond so that lines leave the frame.

    From a pole the curve comes back with the other sign: those two points are never joined.
    """
    inside = np.isfinite(values) & (values >= low) & (values <= high)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], inside.astype(int), [0]])))
    middle, last = (low + high) / 2, len(values)
    found: list[slice] = []
    for a, b in zip(edges[::2], edges[1::2], strict=True):
        first = a - 1 if a > 0 and _same_side(float(values[a - 1]), float(values[a]), middle) else a
        end = b + 1 if b < last and _same_side(float(values[b]), float(values[b - 1]), middle) else b
        found.append(slice(int(first), int(end)))
    return found


def _same_side(beyond: float, within: float, middle: float) -> bool:
    """Whether a curve that leaves its band next goes on to ``beyond`` and has not jumped at a pole."""
    return bool(np.isfinite(beyond)) and (beyond > middle) == (within > middle)

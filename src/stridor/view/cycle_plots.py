"""Figures of limit cycles: branches over friction, and one period of one of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from ..digits import hertz
from ..periodic import Cycle, Cycles
from ..periodic.cycle import slip_range
from ..temporal.trajectory import Trajectory
from .colours import BLUE, COLOURS, GREY, INK, STATUS_COLOURS, VERMILION
from .cycle_shown import STRIPS, strips
from .style import legend_above, stacked, styled

DASHED, DOTTED = (0, (4, 2)), (0, (1, 1.5))
LINES = {True: "-", False: DASHED, None: DOTTED}  # by stability
STABILITY = {True: "stable", False: "unstable", None: "undecided or unknown"}


@styled
def cycle_branches(
    result: Cycles, runs: Sequence[tuple[float, Trajectory]] = (), *, axes: Sequence[Axes] | None = None
) -> Figure:
    """Slip amplitude and frequency of limit cycles over μ: stable ones drawn through, unstable ones dashed,
    those of undecided or unknown stability dotted, folds as diamonds, onsets of steady sliding as triangles on the
    axis. Where harmonic balance went on with more harmonics lines are broken: both ends are the same cycle but for what
    harmonics leave out. runs: a μ with a run in time each, whose half range of
    slip over the last quarter of its last phase, behind growth, is drawn as a cross."""
    figure, (upper, lower) = stacked(axes, 2, 5.4, (3, 2))
    for number, branch in enumerate(result.branches):
        cycles = [result.cycles[k] for k in branch.cycles]
        colour = COLOURS[number % len(COLOURS)]
        for first, last, stable in _stretches(cycles):
            part = cycles[first : last + 1]
            line, dot = LINES[stable], "." if first == last else ""
            upper.plot([c.mu for c in part], [c.slip_amplitude for c in part], ls=line, marker=dot, color=colour)
            lower.plot([c.mu for c in part], [c.frequency_hz for c in part], ls=line, marker=dot, color=colour)
        folds = [result.cycles[k] for k in branch.folds]
        upper.plot([c.mu for c in folds], [c.slip_amplitude for c in folds], "D", color=colour, ms=5, mec="white")
        lower.plot([c.mu for c in folds], [c.frequency_hz for c in folds], "D", color=colour, ms=5, mec="white")
    followed = {k for branch in result.branches for k in branch.cycles}
    for k, cycle in enumerate(result.cycles):
        if k not in followed:
            face = {True: BLUE, False: "white", None: "silver"}[cycle.stable]
            upper.plot([cycle.mu], [cycle.slip_amplitude], "o", ms=5, color=BLUE, mfc=face)
            lower.plot([cycle.mu], [cycle.frequency_hz], "o", ms=5, color=BLUE, mfc=face)
    for mu, run in runs:
        part = run.phase_slice() if run.phases else slice(0, len(run.time))
        tail = slice(part.stop - max(1, (part.stop - part.start) // 4), part.stop)
        slip = slip_range(run.slip_speed[tail], run.status[tail])
        upper.plot([mu], [0.5 * float(np.ptp(slip, axis=1).max())], "x", color=INK, ms=6)
    low, _ = upper.get_ylim()
    upper.set_ylim(min(low, 0.0), None)
    if result.onsets:
        upper.plot([o.mu for o in result.onsets], [0.0] * len(result.onsets), "^", color=INK, ms=6, clip_on=False)
        lower.plot([o.mu for o in result.onsets], [o.frequency_hz for o in result.onsets], "^", color=INK, ms=6)
    if result.between is not None:
        upper.set_xlim(*result.between)
    if result.cycles:
        _from_to(lower, [c.frequency_hz for c in result.cycles])
    upper.set_ylabel("slip amplitude [m/s]")
    lower.set(xlabel="friction coefficient μ", ylabel="frequency [Hz]")
    legend_above(upper, _handles(result, bool(runs)), columns=5)
    return figure


def _from_to(ax: Axes, values: list[float]) -> None:
    low, high = min(values), max(values)
    if high - low < 1e-4 * high:
        ax.set_ylim(low - 1e-3 * high, high + 1e-3 * high)


def _stretches(cycles: Sequence[Cycle]) -> list[tuple[int, int, bool | None]]:
    """Where a branch is alike in stability and number of harmonics: first and last cycle. What differs in stability
    shares the last with the next; between two numbers of harmonics there is no line."""
    found: list[tuple[int, int, bool | None]] = []
    begun = 0
    for k in range(1, len(cycles) + 1):
        broken = k == len(cycles) or cycles[k].harmonics != cycles[begun].harmonics
        if broken or cycles[k].stable is not cycles[begun].stable:
            found.append((begun, k - 1 if broken else k, cycles[begun].stable))
            begun = k
    return found


def _handles(result: Cycles, runs: bool) -> list[Line2D]:
    """Of what is there: lines of branches by stability, marks of single cycles too."""
    met = {c.stable for c in result.cycles}
    alone = any(result.branch_of(k) is None for k in range(len(result.cycles)))
    marks = {True: GREY, False: "white", None: "silver"}
    found = [
        Line2D([], [], color=GREY, ls=LINES[kind], label=STABILITY[kind], marker="o" if alone else "", ms=5,
               mfc=marks[kind])
        for kind in (True, False, None) if kind in met
    ]  # fmt: skip
    if any(branch.folds for branch in result.branches):
        found.append(Line2D([], [], color=GREY, ls="", marker="D", ms=5, label="fold"))
    if result.onsets:
        found.append(Line2D([], [], color=INK, ls="", marker="^", ms=6, label="onset of steady sliding"))
    if runs:
        found.append(Line2D([], [], color=INK, ls="", marker="x", ms=6, label="run in time"))
    return found


@styled
def cycle_period(cycle: Cycle, contact: str | None = None, *, axes: Sequence[Axes] | None = None) -> Figure:
    """Normal and friction force of a contact (default: the one that slips most) over one period, and its slip velocity,
    on the colour of what it does. Raises ValueError for a contact that there is not."""
    names = cycle.contact_names
    if contact is not None and contact not in names:
        raise ValueError(f"contact: {contact!r} given, the cycle has {', '.join(names)}")
    k = loudest_contact(cycle) if contact is None else names.index(contact)
    figure, (upper, lower) = stacked(axes, 2, 4.6)
    share = cycle.time / cycle.period
    for ax in (upper, lower):
        _coloured(ax, share, cycle.status[:, k])
        ax.axhline(0.0, color=INK, lw=0.6)
    upper.plot(share, cycle.normal_force[:, k], color=BLUE, label="normal force")
    upper.plot(share, cycle.tangential_force[:, k], color=VERMILION, label="friction force")
    lower.plot(share, cycle.slip_velocity[:, k], color=INK)
    upper.set_ylabel("force [N]")
    lower.set(xlabel=f"time / period of {cycle.period:.6g} s", ylabel="slip velocity [m/s]", xlim=(0, 1))
    met = [s for s in range(3) if np.any(cycle.status[:, k] == s)]
    patches = [Patch(fc=STATUS_COLOURS[STRIPS[s]], label=STRIPS[s]) for s in met]
    legend_above(upper, [*upper.get_legend_handles_labels()[0], *patches], columns=5)
    edge = "undecided" if cycle.multiplied else "of unknown stability"
    told = {True: "stable", False: "unstable", None: edge}[cycle.stable]
    upper.set_title(f"μ = {cycle.mu:.6g}, {hertz(cycle.frequency_hz)}, {told}; contact {names[k]}", pad=22)
    return figure


def loudest_contact(cycle: Cycle) -> int:
    """Number of the contact whose slip velocity has the largest range while it is closed."""
    return int(np.argmax(np.where(cycle.shares[:, 0] < 1.0, cycle.slip_amplitudes, -1.0)))


def _coloured(ax: Axes, share: np.ndarray, status: np.ndarray) -> None:
    for first, last, kind in strips(share, status):
        ax.axvspan(first, last, color=STATUS_COLOURS[kind], lw=0, zorder=0)

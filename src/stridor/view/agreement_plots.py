"""Figures that lay both approaches over each other."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..agreement import Comparison, Perturbation
from ..digits import measured
from ..modal.complex_modes import ComplexModes
from ..temporal.signals import Components, low_passed
from .colours import BLUE, VERMILION
from .style import extrema, legend_above, panel, styled, zero_line
from .units import frequency_unit, frequency_words, time_unit

RANGE_FACTOR = 1.35


@styled
def spectrum_map(
    modes: ComplexModes,
    found: Components,
    *,
    mu: float | None = None,
    max_frequency_hz: float = 40e3,
    ax: Axes | None = None,
) -> Figure:
    """Growth rate over frequency: complex modes as circles, what was identified in time as crosses."""
    figure, ax = panel(ax, 3.9)
    row = 0 if mu is None else modes.at(mu)
    lam = modes.eigenvalues[row]
    lam = lam[(lam.imag > 0) & (lam.imag <= 2 * np.pi * max_frequency_hz)]
    zero_line(ax)
    unit, its_name = frequency_unit(max_frequency_hz)
    unstable = lam.real > 0
    for part, colour, name in ((~unstable, BLUE, "complex modes, stable"), (unstable, VERMILION, "unstable")):
        frequency = lam[part].imag / (2 * np.pi * unit)
        ax.plot(frequency, lam[part].real, "o", mfc="none", mec=colour, ms=9, mew=1.5, label=name)
    ax.plot(
        found.eigenvalues.imag / (2 * np.pi * unit),
        found.eigenvalues.real,
        "x",
        color="black",
        ms=6,
        mew=1.4,
        label="identified in the time signal",
    )
    ax.set(xlabel=f"frequency [{its_name}]", ylabel="growth rate Re λ [1/s]", xlim=(0, max_frequency_hz / unit))
    reach = float(np.abs(lam.real).max(initial=0.0)) * RANGE_FACTOR
    if reach > 0:
        ax.set_ylim(-reach, reach)
    legend_above(ax)
    return figure


@styled
def perturbation_growth(
    perturbation: Perturbation,
    *,
    modal_growth_rate: float | None = None,
    max_frequency_hz: float | None = None,
    ax: Axes | None = None,
) -> Figure:
    """Size of a small perturbation over time on a logarithmic axis, with the slope of the modal growth rate.

    max_frequency_hz draws what lies below it in front of the whole signal.
    """
    figure, ax = panel(ax, 3.5)
    signal, sampling = perturbation.signal, perturbation.sampling
    band = signal if max_frequency_hz is None else low_passed(signal, sampling, max_frequency_hz)
    unit, its_name = time_unit(len(signal) * sampling)
    ax.set(xlabel=f"time [{its_name}]", ylabel="|slip speed − steady| [m/s]")
    if not len(band) or not np.any(band):
        return figure
    start = (len(signal) - len(band)) // 2
    time = (start + np.arange(len(band))) * sampling
    if len(band) < len(signal):
        every = np.arange(len(signal)) * sampling
        ax.semilogy(
            every / unit, np.maximum(np.abs(signal), 1e-300), color="#BBBBBB", linewidth=0.6, label="all frequencies"
        )
    name = "the perturbation" if max_frequency_hz is None else f"up to {frequency_words(max_frequency_hz)}"
    ax.semilogy(time / unit, np.maximum(np.abs(band), 1e-300), color=BLUE, linewidth=0.7, label=name)
    if modal_growth_rate is not None:
        # The line goes through the peaks: the largest value of each period of what grows, its middle one.
        pieces = max(2, min(int((time[-1] - time[0]) * perturbation.frequency_hz), len(band) // 4))
        at, low, high = extrema(time, band, pieces)
        late = slice(len(at) // 2, None)
        peaks = np.maximum(np.maximum(np.abs(low), np.abs(high)), 1e-300)
        level = np.median((np.log(peaks) - modal_growth_rate * at)[late])
        ends = time[[0, -1]]
        ax.semilogy(
            ends / unit,
            np.exp(level + modal_growth_rate * ends),
            "--",
            color=VERMILION,
            linewidth=2.0,
            label=f"modal growth rate, {measured(modal_growth_rate, 1)} 1/s",
        )
    size = float(np.abs(band).max())
    ax.set_ylim(size / 1e3, 10 * size)
    ax.set_xlim(0, len(signal) * sampling / unit)
    legend_above(ax)
    return figure


@styled
def growth_comparison(comparisons: tuple[Comparison, ...], *, ax: Axes | None = None) -> Figure:
    """Growth rates of both approaches at every μ compared."""
    figure, ax = panel(ax, 3.2)
    mu = [c.mu for c in comparisons]
    ax.plot(mu, [c.modal_eigenvalue.real for c in comparisons], "o", mfc="none", mec=BLUE, ms=9, mew=1.5, label="modal")
    ax.plot(mu, [c.perturbation.growth_rate for c in comparisons], "x", color="black", ms=7, mew=1.5, label="temporal")
    zero_line(ax)
    ax.set(xlabel="friction coefficient μ", ylabel="growth rate Re λ [1/s]")
    legend_above(ax)
    return figure

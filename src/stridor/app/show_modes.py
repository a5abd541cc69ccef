"""Modes and onsets as readable tables."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Literal

import numpy as np

from ..digits import fixed, readable
from ..modal.complex_modes import UNSTABLE_RELATIVE, ComplexModes
from ..modal.onsets import Onset, Onsets
from .output import stdout
from .tables import table

SHOWN = 5  # friction coefficients up to which all tables are printed

MODE_HEADS = ["branch", "frequency [Hz]", "growth [1/s]", "damping [%]", "", "residual"]
MODES_LEFT_OUT = ["residual", "damping [%]"]  # where the page is too narrow
ONSETS_LEFT_OUT = ["residual", "κ [1/s]", "slope [1/s]", "modes"]
ONSET_HEADS = ["critical μ", "frequency [Hz]", "kind", "modes", "growth", "κ [1/s]", "slope [1/s]", "residual"]


def show_modes(
    result: ComplexModes, *, sort: Literal["frequency", "growth"], unstable: bool, say: Callable[[str], None]
) -> None:
    """A table for each μ, of more than five the first and the last; below it what is listed and what was checked."""
    many = len(result.mu) > SHOWN
    for row in range(len(result.mu)) if not many else (0, len(result.mu) - 1):
        columns = result.order(row, sort)
        if unstable:
            columns = columns[result.unstable[row, columns]]
        rows = [_mode(result, row, int(b)) for b in columns]
        red = [k for k, b in enumerate(columns) if result.unstable[row, b]]
        table(f"μ = {result.mu[row]:g}", MODE_HEADS, rows, drop=MODES_LEFT_OUT, marked=red, kept_in="modes.csv")
        stdout.print(f"  {_listed(result, row, len(columns), unstable=unstable)}")
        if result.completeness:
            stdout.print(f"  {result.completeness[row]}")
    if result.contact_state:
        stdout.print(f"{result.contact_state}; held so at every μ")
    for note in result.notes:
        stdout.print(note)
    if many:
        most = result.unstable & result.in_band
        growing = most.sum(axis=1)
        peak = int(np.argmax(growing))
        stdout.print(
            f"{len(result.mu)} friction coefficients, first and last shown, all in the file; most modes grow at "
            f"μ = {result.mu[peak]:g}: {int(growing[peak])}{without(result)}",
        )
        for said in dict.fromkeys(result.completeness[1:-1]):
            at = [k for k in range(1, len(result.mu) - 1) if result.completeness[k] == said]
            where = f"μ = {result.mu[at[0]]:g}" + (f" and {len(at) - 1} others" if len(at) > 1 else "")
            say(f"{where}: {said}")


def _mode(result: ComplexModes, row: int, b: int) -> list[str]:
    lam = complex(result.eigenvalues[row, b])
    rounding = UNSTABLE_RELATIVE * abs(lam)
    ratio = float(result.damping_ratio[row, b])
    return [
        str(result.branch[b]),
        readable(float(result.frequency_hz[row, b])),
        readable(lam.real, zero=rounding),
        readable(100 * ratio, digits=5, zero=100 * UNSTABLE_RELATIVE),
        "unstable" if result.unstable[row, b] else "",
        f"{result.residual[row, b]:.1e}",
    ]


def without(result: ComplexModes) -> str:
    """At how many of the μ nothing was solved, as the end of a sentence on the others; "" where all were."""
    none = result.mu[~result.solved]
    if not len(none):
        return ""
    where = f"at μ = {none[0]:g}" if len(none) == 1 else f"at {len(none)} others, the lowest {none.min():g},"
    return f"; {where} nothing was solved"


def _listed(result: ComplexModes, row: int, shown: int, *, unstable: bool) -> str:
    """How many are listed, as in "20 of 276 modes listed; 3 unstable": those are always among them."""
    if not result.solved[row]:
        return "nothing solved: there is no steady sliding at this μ"
    total, growing = int(result.total[row]), int(np.count_nonzero(result.unstable[row] & result.in_band[row]))
    band = "" if result.max_frequency_hz is None else f" up to {result.max_frequency_hz:g} Hz"
    beyond = ""
    if result.band_hz is not None and result.unstable_outside is not None:
        band = " from {:g} to {:g} Hz".format(*result.band_hz)
        others = int(result.unstable_outside[row])
        beyond = f"; {others} more unstable outside of it, up to {result.max_frequency_hz:g} Hz" if others else ""
    if unstable:
        return f"{shown} unstable of {total} modes{band}{beyond}"
    said = f"{shown} of {total} modes{band} listed" if shown < total else f"all {total} modes{band} listed"
    return f"{said}; {growing} unstable" + (", none left out" if growing and shown < total else "") + beyond


def show_onsets(result: Onsets) -> None:
    """Critical friction coefficients, what grows before any, and what was checked."""
    if result.contact_state:
        stdout.print(f"{result.contact_state}; held so over the range of μ")
    for line in result.at_start_words:
        stdout.print(line)
    if result.onsets:
        kind = "damped" if result.damped else "undamped"
        rows = [_onset(o) for o in result.onsets]
        gone = table(f"onsets, {kind}", ONSET_HEADS, rows, drop=ONSETS_LEFT_OUT, kept_in="onsets.csv")
        if "κ [1/s]" not in gone:
            stdout.print("κ: growth opens as κ √(μ − μ_c) without damping")
        if "slope [1/s]" not in gone:
            stdout.print("slope: d growth/dμ at an onset, where it is finite")
        for line in result.from_above_words:
            stdout.print(line)
    if result.outside:
        stdout.print(
            f"{result.outside} more at frequencies outside of {result.frequencies.removeprefix('from ')}"
        )
    for line in (*by_stretch(result.completeness), *result.notes):
        if line:
            stdout.print(line)


def by_stretch(completeness: str) -> list[str]:
    """What was checked, a paragraph for each stretch of μ that has words of its own."""
    return re.split(r" (?=\([0-9.e+-]+ to [0-9.e+-]+\) )| (?=In each of them: )", completeness)


def _onset(onset: Onset) -> list[str]:
    return [
        fixed(onset.mu, 10),
        readable(onset.frequency_hz, digits=7, decimals=3),
        onset.kind,
        onset.branch_words(" + "),
        "ends" if onset.stabilising else "begins" if onset.enters_at is None else "begins *",
        "" if onset.square_root_coefficient is None else f"{onset.square_root_coefficient:.5g}",
        "" if onset.growth_slope is None else f"{onset.growth_slope:.4g}",
        f"{onset.residual:.1e}",
    ]

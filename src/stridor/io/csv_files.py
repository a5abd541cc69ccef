"""Results as CSV files for spreadsheets and other programs: a line for each mode, onset, derivative, change or point.

Columns of the same thing have the same name in all of them, with its unit at the end (docs/results.md); numbers have
all their digits, truths are 0 and 1, and what does not exist is empty.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from ..modal.full import ParametricOnsets
from ..modal.onsets import Onset, Onsets
from ..modal.results import ComplexModes
from ..study.damping_map import DampingMap
from ..study.measures import Countermeasures
from ..study.sensitivities import Sensitivities
from .atomic import write_text

Cell = float | int | bool | str | None
Tabled = ComplexModes | Onsets | ParametricOnsets | Sensitivities | Countermeasures | DampingMap
MODE = ("frequency_hz", "growth_1_s", "damping_percent", "unstable")


def write_csv(result: Tabled, path: Path) -> Path:
    """Write a result as a table, in one piece. Raises AnalysisError where the file cannot be written."""
    if isinstance(result, ComplexModes):
        return write_rows(path, *_modes(result), band_hz=result.band_hz)
    if isinstance(result, Onsets):
        return write_rows(path, _ONSET, (_onset("mu", o.mu, o) for o in result.onsets), band_hz=result.band_hz)
    if isinstance(result, ParametricOnsets):
        return write_rows(path, _ONSET, (_parametric(result)))
    if isinstance(result, Sensitivities):
        return write_rows(path, *_sensitivities(result), band_hz=result.band_hz)
    if isinstance(result, Countermeasures):
        return write_rows(path, *_countermeasures(result))
    return write_rows(path, *_damping_map(result))


def write_rows(
    path: Path, heads: Sequence[str], rows: Iterable[Sequence[Cell]], *, band_hz: tuple[float, float] | None = None
) -> Path:
    """Write lines under a line of heads, in one piece. band_hz: the frequencies that were asked for, which the last two
    columns then say. Raises AnalysisError where the file cannot be written."""
    if band_hz is not None:
        ends = band_hz
        heads, rows = (*heads, "band_low_hz", "band_high_hz"), ((*row, *ends) for row in rows)
    text = io.StringIO()
    lines = csv.writer(text, lineterminator="\n")
    lines.writerow(heads)
    lines.writerows([_shown(cell) for cell in row] for row in rows)
    write_text(path, text.getvalue())
    return path


def mode_cells(frequency_hz: float, growth: float, *, unstable: bool) -> tuple[Cell, ...]:
    """The cells of `MODE`; growth [1/s]."""
    size = math.hypot(2 * math.pi * frequency_hz, growth)
    return frequency_hz, growth, -100.0 * growth / size if size else None, unstable


def _shown(cell: Cell) -> str:
    if cell is None or (isinstance(cell, float | np.floating) and not math.isfinite(cell)):
        return ""
    if isinstance(cell, str):
        return cell
    if isinstance(cell, float | np.floating):
        return repr(float(cell))
    return str(int(cell))


def _modes(result: ComplexModes) -> tuple[Sequence[str], list[Sequence[Cell]]]:
    rows: list[Sequence[Cell]] = []
    for k, mu in enumerate(result.mu.tolist()):
        for b in result.order(k).tolist():
            lam = float(result.frequency_hz[k, b]), float(result.growth_rate[k, b])
            cells = mode_cells(*lam, unstable=bool(result.unstable[k, b]))
            rows.append((mu, int(result.branch[b]), *cells, float(result.residual[k, b])))
    return ("mu", "branch", *MODE, "residual"), rows


_ONSET = (
    "parameter", "value", "frequency_hz", "kind", "stabilising", "branch_1", "branch_2", "growth_slope_1_s",
    "square_root_coefficient_1_s", "enters_band_at", "residual",
)  # fmt: skip


def _onset(parameter: str, value: float, onset: Onset) -> tuple[Cell, ...]:
    followed = any(onset.branches)
    branches = onset.branches if followed else (None, None)
    return (
        parameter, value, onset.frequency_hz, onset.kind, onset.stabilising, *branches, onset.growth_slope,
        onset.square_root_coefficient, onset.enters_at, onset.residual,
    )  # fmt: skip


def _parametric(result: ParametricOnsets) -> Iterable[tuple[Cell, ...]]:
    for o in result:
        yield (
            o.parameter, o.value, o.frequency_hz, o.kind, o.stabilising, None, None, o.growth_slope,
            o.square_root_coefficient, o.enters_at, o.residual,
        )  # fmt: skip


def _sensitivities(result: Sensitivities) -> tuple[Sequence[str], list[Sequence[Cell]]]:
    heads = (
        "mu", "branch", *MODE, "condition", "parameter", "value", "growth_derivative", "angular_frequency_derivative",
        "growth_per_percent_1_s", "frequency_per_percent_hz", "exceptional_distance_percent", "residual",
    )  # fmt: skip
    rows: list[Sequence[Cell]] = []
    growing = result.unstable
    for b, branch in enumerate(result.branch.tolist()):
        lam = float(result.frequency_hz[b]), float(result.growth_rate[b])
        mode = mode_cells(*lam, unstable=bool(growing[b]))
        for k, name in enumerate(result.parameters):
            slope = complex(result.derivative[k, b])
            rows.append(
                (
                    result.mu, branch, *mode, float(result.condition[b]), name, float(result.values[k]), slope.real,
                    slope.imag, float(result.growth_per_percent[k, b]), float(result.frequency_per_percent_hz[k, b]),
                    100.0 * float(result.exceptional_distance[k, b]), float(result.residual[b]),
                )
            )  # fmt: skip
    return heads, rows


def _countermeasures(result: Countermeasures) -> tuple[Sequence[str], list[Sequence[Cell]]]:
    heads = (
        "mu", "target", "kind", "name", "change", "percent", "mass_kg", "removed_per_percent_1_s",
        "removed_sum_per_percent_1_s", "removed_1_s", "makes_unstable", "brings_close", "verified_removed_1_s",
        "verified_frequency_hz", "verified_growth_1_s",
    )  # fmt: skip
    rows: list[Sequence[Cell]] = []
    for m in result.measures:
        again = (None, None, None)
        if m.verified is not None:
            again = m.verified.removed, m.verified.frequency_hz, m.verified.growth_rate
        branches = (" ".join(map(str, numbers)) for numbers in (m.makes_unstable, m.brings_close))
        rows.append(
            (
                result.mu, str(result.target), m.kind, m.name, m.words, m.direction * m.percent, m.mass,
                m.removed_per_percent, m.removed_sum_per_percent, m.removed, *branches, *again,
            )
        )  # fmt: skip
    return heads, rows


def _damping_map(result: DampingMap) -> tuple[Sequence[str], list[Sequence[Cell]]]:
    heads = (result.x, result.y, "mu", "frequency_hz", "mu_slope_x", "mu_slope_y", "mu_error", "residual")
    error = np.full_like(result.onset_mu, np.nan) if result.error is None else result.error
    tables = (result.onset_mu, result.frequency_hz, result.slope_x, result.slope_y, error, result.residual)
    rows: list[Sequence[Cell]] = []
    for i, j in np.ndindex(result.onset_mu.shape):
        at = float(result.x_values[i]), float(result.y_values[j])
        rows.append((*at, *(float(t[i, j]) for t in tables)))
    return heads, rows

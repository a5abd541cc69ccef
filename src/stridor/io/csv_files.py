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

from ..tabular import Cell, Tabular
from .atomic import write_text


def write_csv(result: Tabular, path: Path) -> Path:
    """Write a result as a table, in one piece. Raises AnalysisError where the file cannot be written."""
    return write_rows(path, *result.table())


def write_rows(path: Path, heads: Sequence[str], rows: Iterable[Sequence[Cell]]) -> Path:
    """Write lines under a line of heads, in one piece. Raises AnalysisError where the file cannot be written."""
    text = io.StringIO()
    lines = csv.writer(text, lineterminator="\n")
    lines.writerow(heads)
    lines.writerows([_shown(cell) for cell in row] for row in rows)
    write_text(path, text.getvalue())
    return path


def _shown(cell: Cell) -> str:
    if cell is None or (isinstance(cell, float | np.floating) and not math.isfinite(cell)):
        return ""
    if isinstance(cell, str):
        return cell
    if isinstance(cell, float | np.floating):
        return repr(float(cell))
    return str(int(cell))

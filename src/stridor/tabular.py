"""Results as tables: rows for data frames and CSV files, and datasets with named dimensions and units."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from .errors import AnalysisError
from .notebook import Shown
from .typing import ComplexArray

FORMAT = "stridor results 1"  # of datasets in files
Cell = float | int | bool | str | None
Rows = tuple[Sequence[str], Sequence[Sequence[Cell]]]
MODE = ("frequency_hz", "growth_1_s", "damping_percent", "unstable")


class Tabular(Shown):
    """What is a table as well, with the columns of its CSV file."""

    def table(self) -> Rows:
        """Heads and rows, as its CSV file has them (docs/results.md)."""
        raise NotImplementedError

    def to_dataframe(self) -> Any:
        """pandas.DataFrame with the columns of the CSV file; numbers that do not exist are NaN. Raises AnalysisError
        where pandas, which comes with xarray, is missing."""
        heads, rows = self.table()
        return frame({head: _column([row[k] for row in rows]) for k, head in enumerate(heads)})


def _column(cells: list[Cell]) -> list[Cell]:
    """The cells, NaN for the numbers among them that do not exist."""
    if any(isinstance(cell, str | bool) for cell in cells):
        return cells
    return [math.nan if cell is None else cell for cell in cells]


def frame(columns: Mapping[str, Any]) -> Any:
    """pandas.DataFrame of columns. Raises AnalysisError without pandas."""
    try:
        import pandas as pd
    except ImportError as error:
        raise AnalysisError("a data frame needs pandas, which is not installed: pip install pandas") from error
    return pd.DataFrame(dict(columns))


def mode_cells(frequency_hz: float, growth: float, *, unstable: bool) -> tuple[Cell, ...]:
    """The cells of `MODE`; growth [1/s]."""
    size = math.hypot(2 * math.pi * frequency_hz, growth)
    return frequency_hz, growth, -100.0 * growth / size if size else None, unstable


def with_band(heads: Sequence[str], rows: Iterable[Sequence[Cell]], band_hz: tuple[float, float] | None) -> Rows:
    """Rows with the frequencies that were asked for in two columns behind, where there are such."""
    if band_hz is None:
        return heads, list(rows)
    return (*heads, "band_low_hz", "band_high_hz"), [(*row, *band_hz) for row in rows]


def dataset(
    analysis: str, variables: Mapping[str, Any], coords: Mapping[str, Any], provenance: Mapping[str, Any]
) -> Any:
    """xarray.Dataset of variables (dimensions, values, attributes), as result files have it; case and provenance are
    embedded as text."""
    import xarray as xr

    if any("part" in v[0] for v in variables.values() if isinstance(v[0], tuple)):
        coords = {**coords, "part": ("part", np.array(["re", "im"], dtype=object))}
    attributes = {
        "format": FORMAT,
        "analysis": analysis,
        "case": str(provenance.get("case", "")),
        "provenance": json.dumps(provenance),
    }
    return xr.Dataset(dict(variables), dict(coords), attributes)


def split(dims: tuple[str, ...], values: Any, attributes: Mapping[str, Any]) -> tuple[Any, ...]:
    """Complex values as real ones with a last dimension (re, im): netCDF has no complex numbers."""
    array: ComplexArray = np.asarray(values, dtype=complex)
    return (*dims, "part"), np.stack([np.real(array), np.imag(array)], axis=-1), dict(attributes)


def joined(values: Any) -> ComplexArray:
    """The complex values of what `split` has made."""
    return np.asarray(values[..., 0] + 1j * values[..., 1], dtype=complex)

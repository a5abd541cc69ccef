"""Complex modes and onsets as tables: datasets with named dimensions, and rows for data frames and CSV files."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np

from ..tabular import MODE, Cell, Rows, dataset, mode_cells, split, with_band

if TYPE_CHECKING:
    from .onset import Onset, Onsets
    from .results import ComplexModes


def modes_dataset(result: ComplexModes) -> Any:
    """The dataset of modes, with dimensions mu and branch."""
    pairs = ("mu", "branch")
    variables: dict[str, Any] = {
        "eigenvalue": split(
            pairs, result.eigenvalues, {"units": "1/s", "long_name": "growth rate + j angular frequency"}
        ),
        "frequency": (pairs, result.frequency_hz, {"units": "Hz"}),
        "growth_rate": (pairs, result.growth_rate, {"units": "1/s"}),
        "damping_ratio": (pairs, result.damping_ratio, {"units": "1"}),
        "unstable": (pairs, result.unstable.astype(np.int8), {"units": "1"}),
        "residual": (pairs, result.residual, {"units": "1", "long_name": "componentwise backward error"}),
    }
    if not result.solved.all():
        told = "0: there is no steady sliding, nothing is known of what grows"
        variables["solved"] = ("mu", result.solved.astype(np.int8), {"units": "1", "long_name": told})
    for name, vectors in (("right_vector", result.right), ("left_vector", result.left)):
        if vectors is not None:
            variables[name] = split((*pairs, "freedom"), vectors, {"units": "1"})
    coords = {"mu": ("mu", result.mu, {"units": "1"}), "branch": ("branch", result.branch)}
    data = dataset("modes", variables, coords, result.provenance)
    if result.completeness:
        data.attrs["completeness"] = json.dumps(result.completeness)
    if result.contact_state:
        data.attrs["contact_state"] = result.contact_state
    if result.source:
        data.attrs["source"] = result.source
    if result.notes:
        data.attrs["notes"] = json.dumps(result.notes)
    data.attrs["damped"] = int(result.damped)
    data.attrs["modes_in_band"] = json.dumps(result.counts(result.total))
    if result.max_frequency_hz is not None:
        data.attrs["max_frequency_hz"] = result.max_frequency_hz
    if result.band_hz is not None:
        data.attrs["band_hz"] = list(result.band_hz)
    return data


def modes_rows(result: ComplexModes) -> Rows:
    """A row for each mode of the band at each μ."""
    rows: list[tuple[Cell, ...]] = []
    for k, mu in enumerate(result.mu.tolist()):
        for b in result.order(k).tolist():
            lam = float(result.frequency_hz[k, b]), float(result.growth_rate[k, b])
            cells = mode_cells(*lam, unstable=bool(result.unstable[k, b]))
            rows.append((mu, int(result.branch[b]), *cells, float(result.residual[k, b])))
    return with_band(("mu", "branch", *MODE, "residual"), rows, result.band_hz)


def onsets_dataset(result: Onsets) -> Any:
    """The dataset of onsets, with dimension onset."""

    def column(name: str) -> list[float]:
        return [np.nan if (v := getattr(o, name)) is None else float(v) for o in result.onsets]

    def exceptional(onset: Onset) -> complex:
        return complex(np.nan, np.nan) if onset.exceptional_mu is None else onset.exceptional_mu

    units = {
        "mu": "1",
        "frequency_hz": "Hz",
        "residual": "1",
        "square_root_coefficient": "1/s",
        "growth_slope": "1/s",
    }
    variables: dict[str, Any] = {name: ("onset", column(name), {"units": unit}) for name, unit in units.items()}
    count = len(result.onsets)
    variables["kind"] = ("onset", np.array([o.kind for o in result.onsets], dtype=object).reshape(count))
    variables["stabilising"] = ("onset", np.array([o.stabilising for o in result.onsets], dtype=np.int8))
    branches = np.array([o.branches for o in result.onsets], dtype=np.int64).reshape(-1, 2)
    variables["branches"] = (("onset", "pair"), branches)
    variables["exceptional_mu"] = split(("onset",), [exceptional(o) for o in result.onsets], {"units": "1"})
    data = dataset("onsets", variables, {}, result.provenance)
    data.attrs.update(damped=int(result.damped), max_frequency_hz=result.max_frequency_hz)
    data.attrs["friction_range"] = list(result.friction_range)
    if result.band_hz is not None:
        data.attrs["band_hz"] = list(result.band_hz)
    for name in ("at_start", "at_end"):
        values = getattr(result, name)
        data.attrs[f"growing_{name}"] = json.dumps([[v.real, v.imag] for v in values])
    data.attrs["growing_above_band_at_start"] = json.dumps([[v.real, v.imag, mu] for v, mu in result.entering])
    data.attrs["enters_band_at"] = json.dumps([o.enters_at for o in result.onsets])
    if result.completeness:
        data.attrs["completeness"] = result.completeness
    if result.contact_state:
        data.attrs["contact_state"] = result.contact_state
    if result.source:
        data.attrs["source"] = result.source
    if result.notes:
        data.attrs["notes"] = json.dumps(result.notes)
    return data


ONSET = (
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


def onsets_rows(result: Onsets) -> Rows:
    """A row for each onset."""
    return with_band(ONSET, (_onset("mu", o.mu, o) for o in result.onsets), result.band_hz)

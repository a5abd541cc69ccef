"""The map of the lowest onset over two numbers of a case."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from ..notebook import MOST_ROWS, counted, html_table
from ..tabular import Cell, Rows, Tabular, dataset
from ..typing import Array, BoolArray

ROUNDING = 1e-9
POINTS = ("onset_mu", "frequency_hz", "slope_x", "slope_y", "residual", "error")


@dataclass(frozen=True)
class Confirmed:
    """An onset of the reduced model that was solved for again in the full problem: at which x and y, onset_mu there
    and what the reduced model had said, and the backward error."""

    x: float
    y: float
    onset_mu: float
    reduced_mu: float
    residual: float

    @property
    def difference(self) -> float:
        """By how much the reduced model was off."""
        return abs(self.onset_mu - self.reduced_mu)


@dataclass(frozen=True, repr=False)
class DampingMap(Tabular):
    """Lowest onset over two numbers x, y of a case: paths, values (nx,) and (ny,).

    onset_mu (nx, ny), frequency_hz there, NaN where nothing grows up to the largest μ. slope_x, slope_y (nx, ny):
    ∂μ_c/∂x, ∂μ_c/∂y, NaN without onset and where the onset is a double root (no damping at all), whose slope is
    infinite. undamped_mu: the onset without any damping, None where there is none.

    residual (nx, ny): backward error of each onset in the full problem. method: "full", every point solved there, or
    "reduced": all onsets are those of one reduced model, error (nx, ny) is what it estimates them to be off, and those
    in ``confirmed`` were solved for again in the full problem; elsewhere residual is NaN. notes: sentences on how it
    was done; warnings: on what went wrong.
    """

    x: str
    y: str
    x_values: Array
    y_values: Array
    mu_range: tuple[float, float]
    max_frequency_hz: float
    onset_mu: Array
    frequency_hz: Array
    slope_x: Array
    slope_y: Array
    residual: Array
    undamped_mu: float | None
    warnings: tuple[str, ...] = ()
    provenance: dict[str, Any] = field(default_factory=dict)
    method: Literal["full", "reduced"] = "full"
    error: Array | None = None
    confirmed: tuple[Confirmed, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def more_x_lowers(self) -> BoolArray:
        """Where (nx, ny) more of x lowers the onset."""
        return self._lowers(self.slope_x, self.x_values)

    @property
    def more_y_lowers(self) -> BoolArray:
        """Where (nx, ny) more of y lowers the onset."""
        return self._lowers(self.slope_y, self.y_values)

    @property
    def below_undamped(self) -> BoolArray:
        """Where (nx, ny) the damped onset lies below the one without any damping."""
        if self.undamped_mu is None:
            return np.isfinite(self.onset_mu)
        return self.onset_mu < self.undamped_mu * (1 - 1e-9)

    def _lowers(self, slope: Array, values: Array) -> BoolArray:
        # Over the whole range of the map; what lowers the onset by less than rounding does not lower it.
        return slope * float(np.ptp(values)) < -ROUNDING * np.nan_to_num(self.onset_mu, nan=np.inf)

    def to_json(self) -> dict[str, Any]:
        """The document that `stridor damping-map --json` prints; None stands for what does not exist."""

        def plain(values: Array) -> list[list[float | None]]:
            return [[float(v) if np.isfinite(v) else None for v in row] for row in values]

        return {
            "x": self.x,
            "y": self.y,
            "x_values": self.x_values.tolist(),
            "y_values": self.y_values.tolist(),
            "onset_mu": plain(self.onset_mu),
            "frequency_hz": plain(self.frequency_hz),
            "slope_x": plain(self.slope_x),
            "slope_y": plain(self.slope_y),
            "residual": plain(self.residual),
            "undamped_mu": self.undamped_mu,
            "friction_range": list(self.mu_range),
            "max_frequency_hz": self.max_frequency_hz,
            "method": self.method,
            "error": None if self.error is None else plain(self.error),
            "confirmed": [vars(c) | {"difference": c.difference} for c in self.confirmed],
            "notes": list(self.notes),
            "warnings": list(self.warnings),
        }

    def table(self) -> Rows:
        """Heads and rows, as its CSV file has them: a row for each point."""
        heads = (self.x, self.y, "mu", "frequency_hz", "mu_slope_x", "mu_slope_y", "mu_error", "residual")
        error = np.full_like(self.onset_mu, np.nan) if self.error is None else self.error
        tables = (self.onset_mu, self.frequency_hz, self.slope_x, self.slope_y, error, self.residual)
        rows: list[tuple[Cell, ...]] = []
        for i, j in np.ndindex(self.onset_mu.shape):
            at = float(self.x_values[i]), float(self.y_values[j])
            rows.append((*at, *(float(t[i, j]) for t in tables)))
        return heads, rows

    @property
    def _line(self) -> str:
        found = self.onset_mu[np.isfinite(self.onset_mu)]
        said = f"onset from μ = {found.min():.4g} to {found.max():.4g}" if len(found) else "no onset"
        return f"{len(self.x_values)} × {len(self.y_values)} points over {self.x} and {self.y}: {said}"

    def _repr_html_(self) -> str:
        heads = (f"{self.x} \\ {self.y}", *(f"{y:g}" for y in self.y_values[:MOST_ROWS]))
        rows = [
            (f"{x:g}", *("–" if np.isnan(mu) else f"{mu:.4g}" for mu in line[:MOST_ROWS]))
            for x, line in zip(self.x_values, self.onset_mu, strict=True)
        ]
        cut = len(self.y_values) - MOST_ROWS
        more = f"{counted(cut, 'column')} more" if cut > 0 else ""
        return html_table("Lowest onset, critical μ", heads, rows, (more, *self.warnings, *self.notes))

    def to_xarray(self) -> Any:
        """xarray.Dataset with dimensions x and y, as `st.save` writes it; what has no point is JSON in the attribute
        ``damping_map``."""
        table = {
            "onset_mu": (self.onset_mu, "lowest critical friction coefficient"),
            "frequency": (self.frequency_hz, "frequency of the onset [Hz]"),
            "slope_x": (self.slope_x, f"d onset / d {self.x}"),
            "slope_y": (self.slope_y, f"d onset / d {self.y}"),
            "residual": (self.residual, "componentwise backward error"),
        }
        if self.error is not None:
            table["error"] = (self.error, "estimated error of the onset")
        variables = {name: (("x", "y"), values, {"long_name": words}) for name, (values, words) in table.items()}
        coords = {"x": ("x", self.x_values), "y": ("y", self.y_values)}
        data = dataset("damping map", variables, coords, self.provenance)
        once = {name: value for name, value in self.to_json().items() if name not in (*POINTS, "x_values", "y_values")}
        return data.assign_attrs(x_path=self.x, y_path=self.y, method=self.method, damping_map=json.dumps(once))

    @classmethod
    def from_xarray(cls, data: Any) -> DampingMap:
        """The map whose `to_xarray` that is. Raises KeyError, TypeError or ValueError where it is none's."""
        told = json.loads(data.attrs["damping_map"])
        texts = [told["x"], told["y"], *told["notes"], *told["warnings"]]
        if not all(isinstance(text, str) for text in texts) or told["method"] not in ("full", "reduced"):
            raise ValueError("its texts are none")
        low, high = (float(v) for v in told["friction_range"])
        undamped, top = told["undamped_mu"], float(told["max_frequency_hz"])
        if not (0.0 <= low < high and top > 0 and (undamped is None or np.isfinite(undamped))):
            raise ValueError("its ranges are none")
        confirmed = [[float(c[name]) for name in Confirmed.__dataclass_fields__] for c in told["confirmed"]]
        return cls(
            told["x"], told["y"], data["x"].values, data["y"].values, (low, high), top, data["onset_mu"].values,
            data["frequency"].values, data["slope_x"].values, data["slope_y"].values, data["residual"].values,
            undamped, tuple(told["warnings"]), json.loads(data.attrs["provenance"]), told["method"],
            data["error"].values if "error" in data else None, tuple(Confirmed(*c) for c in confirmed),
            tuple(told["notes"]),
        )  # fmt: skip

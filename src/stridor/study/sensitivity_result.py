"""What sensitivities of complex modes come to: dλ/dp, conditions, exceptional points."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..digits import readable
from ..modal.rates import Rates
from ..modal.tolerances import UNSTABLE_RELATIVE
from ..notebook import counted, html_table
from ..tabular import MODE, Cell, Rows, Tabular, dataset, mode_cells, with_band
from ..typing import Array, BoolArray, ComplexArray, IntArray
from .measures import growing, per_cent_of


@dataclass(frozen=True, repr=False)
class Sensitivities(Rates, Tabular):
    """dλ/dp of b modes at one μ over k numbers of the case.

    parameters (k,) paths, values (k,) at the case. branch (b,) as `complex_modes` numbers them; eigenvalues (b,) [1/s];
    derivative (k, b) [1/s per unit of the number]. condition (b,): 1 for a mode of a symmetric system, beyond all
    bounds at an exceptional point. nearest (b,) [1/s]: distance to the nearest other eigenvalue of the band.
    exceptional (k, b): complex value of the number at which that neighbour is met, extrapolated; NaN where none is in
    sight. |exceptional − value| is how far a first-order prediction can reach at all. residual (b,): componentwise
    backward error of right and left pairs. warnings: sentences, where derivatives must not be trusted. band_hz: the
    frequencies that were asked for, None for all.
    """

    mu: float
    parameters: tuple[str, ...]
    values: Array
    branch: IntArray
    eigenvalues: ComplexArray  # ty: ignore[incompatible-attribute-override]
    derivative: ComplexArray
    condition: Array
    nearest: Array
    exceptional: ComplexArray
    residual: Array
    damped: bool
    warnings: tuple[str, ...] = ()
    open_contacts: tuple[str, ...] = ()
    provenance: dict[str, Any] = field(default_factory=dict)
    band_hz: tuple[float, float] | None = None

    @property
    def unstable(self) -> BoolArray:
        """Which modes (b,) grow, beyond rounding."""
        return growing(self.eigenvalues)

    @property
    def growth_per_percent(self) -> Array:
        """Change of the growth rate (k, b) [1/s] per per cent more of the number (farther from zero where it is
        negative); NaN where the number is zero."""
        return self._percent[:, None] * self.derivative.real

    @property
    def beyond_rounding(self) -> BoolArray:
        """Whether the change of the growth rate (k, b) is more than rounding may be: a per cent of the number changes
        it by more than a per cent of the growth, a share of |λ|, from which on a mode counts as unstable."""
        with np.errstate(invalid="ignore"):
            return np.abs(self.growth_per_percent) > 0.01 * UNSTABLE_RELATIVE * np.abs(self.eigenvalues)

    @property
    def frequency_per_percent_hz(self) -> Array:
        """Change of the frequency (k, b) [Hz] per per cent more of the number; NaN where the number is zero."""
        return self._percent[:, None] * self.derivative.imag / (2 * np.pi)

    @property
    def exceptional_distance(self) -> Array:
        """|exceptional − value| / |value| (k, b), inf where none is in sight."""
        size = np.abs(self.values)[:, None]
        distance = np.abs(self.exceptional - self.values[:, None])
        found = np.divide(distance, size, out=np.full(distance.shape, np.inf), where=size > 0)
        return np.where(np.isnan(found), np.inf, found)

    @property
    def _percent(self) -> Array:
        return np.where(self.values == 0.0, np.nan, per_cent_of(self.values))

    def of(self, parameter: str) -> ComplexArray:
        """dλ/dp (b,) of one number."""
        return self.derivative[self.parameters.index(parameter)]

    def to_json(self) -> dict[str, Any]:
        """The document that `stridor sensitivities --json` prints; None stands for what does not exist."""
        modes = [
            {
                "branch": int(self.branch[b]),
                "frequency_hz": float(self.frequency_hz[b]),
                "growth_rate": float(self.growth_rate[b]),
                "condition": _finite(self.condition[b]),
                "nearest": _finite(self.nearest[b]),
                "residual": float(self.residual[b]),
                "parameters": [
                    {
                        "parameter": name,
                        "value": float(self.values[k]),
                        "derivative": [float(self.derivative[k, b].real), float(self.derivative[k, b].imag)],
                        "growth_per_percent": _finite(self.growth_per_percent[k, b]),
                        "frequency_per_percent_hz": _finite(self.frequency_per_percent_hz[k, b]),
                        "exceptional": _complex(self.exceptional[k, b]),
                        "exceptional_distance": _finite(self.exceptional_distance[k, b]),
                    }
                    for k, name in enumerate(self.parameters)
                ],
            }
            for b in range(len(self.branch))
        ]
        return {
            "mu": self.mu,
            "damped": self.damped,
            "modes": modes,
            **({} if self.band_hz is None else {"band_hz": list(self.band_hz)}),
            "warnings": list(self.warnings),
            "open_contacts": list(self.open_contacts),
        }

    def table(self) -> Rows:
        """Heads and rows, as its CSV file has them: a row for each mode and number."""
        heads = (
            "mu", "branch", *MODE, "condition", "parameter", "value", "growth_derivative",
            "angular_frequency_derivative", "growth_per_percent_1_s", "frequency_per_percent_hz",
            "exceptional_distance_percent", "residual",
        )  # fmt: skip
        rows: list[tuple[Cell, ...]] = []
        growing = self.unstable
        for b, branch in enumerate(self.branch.tolist()):
            lam = float(self.frequency_hz[b]), float(self.growth_rate[b])
            mode = mode_cells(*lam, unstable=bool(growing[b]))
            for k, name in enumerate(self.parameters):
                slope = complex(self.derivative[k, b])
                rows.append(
                    (
                        self.mu, branch, *mode, float(self.condition[b]), name, float(self.values[k]), slope.real,
                        slope.imag, float(self.growth_per_percent[k, b]), float(self.frequency_per_percent_hz[k, b]),
                        100.0 * float(self.exceptional_distance[k, b]), float(self.residual[b]),
                    )
                )  # fmt: skip
        return with_band(heads, rows, self.band_hz)

    @property
    def _line(self) -> str:
        return f"{counted(len(self.branch), 'mode')} at μ = {self.mu:g} over {', '.join(self.parameters)}"

    def _repr_html_(self) -> str:
        heads = ("mode", "frequency [Hz]", "growth [1/s]", "number", "growth per % [1/s]", "frequency per % [Hz]")
        rows = [
            (
                int(self.branch[b]), readable(self.frequency_hz[b]), readable(self.growth_rate[b], 4), name,
                readable(self.growth_per_percent[k, b], 4), readable(self.frequency_per_percent_hz[k, b], 4),
            )
            for b in range(len(self.branch))
            for k, name in enumerate(self.parameters)
        ]  # fmt: skip
        return html_table(f"Sensitivities at μ = {self.mu:g}", heads, rows, self.warnings)

    def to_xarray(self) -> Any:
        """xarray.Dataset with dimensions parameter and branch, as `st.save` writes it; complex numbers as real and
        imaginary part."""
        both, one = ("parameter", "branch"), ("branch",)
        table: dict[str, tuple[tuple[str, ...], Any, dict[str, str]]] = {
            "value": (("parameter",), self.values, {"long_name": "value of the number"}),
            "growth_rate": (one, self.growth_rate, {"units": "1/s"}),
            "frequency": (one, self.frequency_hz, {"units": "Hz"}),
            "growth_derivative": (both, self.derivative.real, {"long_name": "d Re λ/dp"}),
            "angular_frequency_derivative": (both, self.derivative.imag, {"long_name": "d Im λ/dp"}),
            "growth_per_percent": (both, self.growth_per_percent, {"units": "1/s"}),
            "frequency_per_percent": (both, self.frequency_per_percent_hz, {"units": "Hz"}),
            "condition": (one, self.condition, {"long_name": "condition number of the eigenvalue"}),
            "nearest": (one, self.nearest, {"units": "1/s", "long_name": "distance to the nearest eigenvalue"}),
            "exceptional_real": (both, self.exceptional.real, {"long_name": "exceptional point of the number"}),
            "exceptional_imag": (both, self.exceptional.imag, {"long_name": "exceptional point of the number"}),
            "residual": (one, self.residual, {"long_name": "componentwise backward error"}),
        }
        names = np.array(self.parameters, dtype=object)
        coords = {"parameter": ("parameter", names), "branch": ("branch", self.branch)}
        data = dataset("sensitivities", table, coords, self.provenance)
        data.attrs |= {"mu": self.mu, "damped": int(self.damped), "warnings": "\n".join(self.warnings)}
        if self.open_contacts:
            data.attrs["open_contacts"] = json.dumps(self.open_contacts)
        if self.band_hz is not None:
            data.attrs["band_hz"] = list(self.band_hz)
        return data


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _complex(value: complex) -> list[float] | None:
    return [float(value.real), float(value.imag)] if np.isfinite(value) else None

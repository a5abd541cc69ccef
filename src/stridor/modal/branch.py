"""One mode by itself, at one or many μ."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..digits import hertz, readable
from ..notebook import html_table
from ..tabular import MODE, Rows, Tabular, mode_cells
from ..typing import Array, BoolArray, ComplexArray
from .rates import Rates


@dataclass(frozen=True, repr=False)
class Branch(Rates, Tabular):
    """A mode over μ (k,), an item of `ComplexModes`: its number, λ (k,) [1/s], NaN where it is not known, backward
    error (k,), whether it grows (k,), and where asked for its right and left unit vectors (k, n)."""

    number: int
    mu: Array
    eigenvalues: ComplexArray  # ty: ignore[incompatible-attribute-override]
    residual: Array
    unstable: BoolArray
    right: ComplexArray | None = None
    left: ComplexArray | None = None

    def table(self) -> Rows:
        """Heads and rows, those of the modes' CSV file: a row for each μ."""
        rows = [
            (float(mu), self.number, *mode_cells(lam.imag / (2 * np.pi), lam.real, unstable=bool(grows)), float(rest))
            for mu, lam, grows, rest in zip(
                self.mu, self.eigenvalues.tolist(), self.unstable, self.residual, strict=True
            )
        ]
        return ("mu", "branch", *MODE, "residual"), rows

    @property
    def _line(self) -> str:
        known = np.isfinite(self.eigenvalues)
        if not known.any():
            return f"mode {self.number}, not known at any of these μ"
        frequency, growth = self.frequency_hz[known], self.growth_rate[known]
        if len(self.mu) == 1:
            said = "unstable" if self.unstable[0] else "stable"
            return f"mode {self.number} at μ = {self.mu[0]:g}: {hertz(frequency[0])}, {growth[0]:+.4g} 1/s, {said}"
        grows = self.mu[self.unstable]
        said = f"unstable at {len(grows)} of them, from μ = {grows.min():g}" if len(grows) else "stable"
        low, high = frequency.min(), frequency.max()
        return f"mode {self.number} at {len(self.mu)} μ: {hertz(low)} to {hertz(high)}, {said}"

    def _repr_html_(self) -> str:
        rows: list[tuple[Any, ...]] = [
            (f"{mu:g}", readable(f), readable(g, 4), readable(d, 4), "unstable" if u else "")
            for mu, f, g, d, u in zip(
                self.mu, self.frequency_hz, self.growth_rate, self.damping_ratio, self.unstable, strict=True
            )
        ]
        heads = ("μ", "frequency [Hz]", "growth [1/s]", "damping ratio", "")
        return html_table(f"Mode {self.number}", heads, rows)

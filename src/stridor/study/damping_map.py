"""The lowest onset over two damping values of a case, and where more damping lowers it.

Damping may destabilise: where it differs between the two modes that meet, the onset falls below that without damping
(N. Hoffmann, L. Gaul, Effects of damping on mode-coupling instability in friction induced oscillations, ZAMM 83 (2003)
524–534). What damping d does at an onset, where Re λ(μ, d) = 0, needs no second solution:

    dμ_c/dd = − Re(∂λ/∂d) / Re(∂λ/∂μ) .
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..case import Case
from ..errors import AnalysisError, CaseError
from ..modal.derivatives import Mode, Terms, by_friction, hold, rate_of, solve_mode, terms_of
from ..modal.onsets import Onset, onsets
from ..system import System, build_system
from ..typing import Array, BoolArray
from .provenance import provenance
from .sensitivities import number_at, options_of

MOST_POINTS = 10_000
ROUNDING = 1e-9


@dataclass(frozen=True)
class DampingMap:
    """Lowest onset over two numbers x, y of a case: paths, values (nx,) and (ny,).

    onset_mu (nx, ny), frequency_hz there, NaN where nothing grows up to the largest μ. slope_x, slope_y (nx, ny):
    ∂μ_c/∂x, ∂μ_c/∂y, NaN without onset and where the onset is a double root (no damping at all), whose slope is
    infinite. residual (nx, ny): backward error of each onset. undamped_mu: the onset without any damping, None where
    there is none.
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
            "warnings": list(self.warnings),
        }

    def to_dataset(self) -> Any:
        """xarray.Dataset with dimensions x and y."""
        import xarray as xr

        both = ("x", "y")
        table = {
            "onset_mu": (self.onset_mu, "lowest critical friction coefficient"),
            "frequency": (self.frequency_hz, "frequency of the onset [Hz]"),
            "slope_x": (self.slope_x, f"d onset / d {self.x}"),
            "slope_y": (self.slope_y, f"d onset / d {self.y}"),
            "residual": (self.residual, "componentwise backward error"),
        }
        return xr.Dataset(
            {name: xr.Variable(both, data, {"long_name": words}) for name, (data, words) in table.items()},
            coords={"x": self.x_values, "y": self.y_values},
            attrs={"analysis": "damping map", "x_path": self.x, "y_path": self.y},
        )


def damping_map(
    case: Case,
    x: str,
    y: str,
    *,
    x_range: tuple[float, float] | Sequence[float],
    y_range: tuple[float, float] | Sequence[float],
    grid: tuple[int, int] = (9, 9),
    mu_range: tuple[float, float] | None = None,
    max_frequency_hz: float | None = None,
) -> DampingMap:
    """The lowest onset in ``mu_range`` over a grid of two numbers of the case, such as "bodies.pad.damping.mass" and
    "bodies.disc.damping.mass", or a body's two Rayleigh factors, or "dashpots.NAME.damping".

    x_range, y_range: two ends, divided evenly into ``grid`` values, or three and more values as they are. Every point
    of the grid is a search for onsets of its own, so that none is missed that `onsets` would find; slopes come from
    the eigenvectors at the onset, with the touching nodes held. Raises CaseError for paths that lead to no number.
    """
    started = time.perf_counter()
    low, high = case.modal.friction_range if mu_range is None else mu_range
    top = case.modal.max_frequency_hz if max_frequency_hz is None else max_frequency_hz
    xs, ys = _values(x_range, grid[0], "x_range"), _values(y_range, grid[1], "y_range")
    if len(xs) * len(ys) > MOST_POINTS:
        raise CaseError("grid", f"{len(xs)} × {len(ys)}", f"at most {MOST_POINTS} points in all")
    for path in (x, y):
        number_at(case, path)
    mu, frequency, slope_x, slope_y, residual = np.full((5, len(xs), len(ys)), np.nan)
    warnings: list[str] = []
    for i, j in np.ndindex(len(xs), len(ys)):
        varied = case.with_({x: float(xs[i]), y: float(ys[j])})
        system = build_system(varied)
        try:
            first = lowest_onset(varied, system, (low, high), top)
        except AnalysisError as error:
            warnings.append(f"{x} = {xs[i]:g}, {y} = {ys[j]:g}: {error}")
            continue
        if first is None:
            continue
        mu[i, j], frequency[i, j], residual[i, j] = first.mu, first.frequency_hz, first.residual
        if first.growth_slope is None:
            continue  # undamped: the onset is an exceptional point
        try:
            slope_x[i, j], slope_y[i, j] = onset_slopes(varied, system, first, (x, y))
        except AnalysisError as error:
            warnings.append(f"{x} = {xs[i]:g}, {y} = {ys[j]:g}: no slopes: {error}")
    try:
        bare = lowest_onset(case, build_system(case), (low, high), top, damped=False)
    except AnalysisError as error:
        bare = None
        warnings.append(f"without damping: {error}")
    return DampingMap(
        x, y, xs, ys, (low, high), top, mu, frequency, slope_x, slope_y, residual,
        None if bare is None else bare.mu,
        tuple(warnings),
        provenance(case, "damping map", time.perf_counter() - started),
    )  # fmt: skip


def lowest_onset(
    case: Case, system: System, mu_range: tuple[float, float], max_frequency_hz: float, *, damped: bool = True
) -> Onset | None:
    """The onset of least μ from which on something grows."""
    options = options_of(case)
    return onsets(
        system,
        mu_range,
        max_frequency_hz=max_frequency_hz,
        damped=damped,
        friction_damping=options.friction_damping,
        prestress=options.prestress,
        solver=options.solver,
    ).first


def onset_slopes(case: Case, system: System, onset: Onset, paths: Sequence[str]) -> list[float]:
    """dμ_c/dp of an onset with damping for numbers of the case. Raises AnalysisError where it has no derivative."""
    options = options_of(case)
    mu = onset.mu
    held = hold(system, mu, options)
    terms = terms_of(system, mu, held, options)
    lam = 2j * np.pi * onset.frequency_hz
    if not abs(lam):
        raise AnalysisError("divergence at zero frequency; slopes of flutter onsets only")
    # How far the other mode of the meeting is: growth opens as κ √(μ − μ_e).
    point, kappa = onset.exceptional_mu, onset.square_root_coefficient
    gap = 2 * kappa * abs(mu - point) ** 0.5 if point is not None and kappa is not None else 1e-3 * abs(lam)
    mode = solve_mode(terms, lam, min(gap, abs(lam)), solver=options.solver)
    by_mu = mode.derivative(by_friction(system, mu, held, options)).real
    if by_mu == 0.0:
        raise AnalysisError("growth does not change with friction there")
    return [-_derivative(case, mode, path, mu, system).real / by_mu for path in paths]


def _derivative(case: Case, mode: Mode, path: str, mu: float, system: System) -> complex:
    options = options_of(case)
    held = hold(system, mu, options)

    def at(value: float) -> Terms:
        return terms_of(build_system(case.with_({path: value})), mu, held, options)

    return mode.derivative(rate_of(at, number_at(case, path))[0])


def _values(given: tuple[float, float] | Sequence[float], count: int, name: str) -> Array:
    values = np.asarray(given, dtype=float)
    if values.ndim != 1 or len(values) < 2 or not np.all(np.isfinite(values)) or np.any(np.diff(values) <= 0):
        raise CaseError(name, given, "two ends or more values, rising")
    if len(values) > 2:
        return values
    if count < 2:
        raise CaseError("grid", count, "at least two values along each number")
    return np.linspace(values[0], values[1], count)

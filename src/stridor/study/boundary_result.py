"""Stability boundaries over two numbers of a case, as data."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal

import numpy as np

from ..digits import hertz
from ..modal.boundary import Drawn, drawn
from ..notebook import Shown, counted, html_table
from ..tabular import Cell, Rows, Tabular, dataset
from ..typing import Array, BoolArray, IntArray
from .boundary_counts import BESIDE, CountedAt, Numbers, numbers_of, roots_fit

WHOLE = ("curve", "growth_side", "modes_beside")
HEADS = (
    "curve", "kind", "frequency_hz", "tangent_x", "tangent_y", "growth_side", "modes_beside", "boundary_error",
    "residual",
)  # fmt: skip
POINTS = {"x": "x", "y": "y", "error": "boundary_error"} | {
    name: name for name in HEADS if name not in {"curve", "kind", "boundary_error"}
}  # what a curve has at its points, and the name of that in tables


@dataclass(frozen=True, repr=False)
class BoundaryCurve(Shown):
    """A curve x, y (k,) on which one mode is on the edge of growth, at frequency_hz (k,).

    kind: "flutter" or "divergence" (0 Hz). tangent_x, tangent_y (k,): the curve's direction, in the units of x and y,
    of length one in shares of both ranges; between two points it is, within the tolerance, the cubic with these.
    growth_side (k,): 1 where the mode grows on the left of that direction, −1 on the right. modes_beside (k,): how many
    other modes grow on both sides; 0 is the outer boundary. closed: whether it came back to its first point, which is
    its last as well. ends: "edge" of the rectangle, "band" (the highest frequency), "zero frequency" (flutter comes to
    rest at a divergence), "cusp" (another curve ends there as well, both at a tip), "lost" (it could not be followed
    further) or "closed".

    residual (k,): backward error in the matrices that were solved, those of the reduced model or the full ones. error
    (k,): how far the reduced model is estimated to put the point off, in shares of the ranges; NaN where nothing is
    estimated. deviation: how far at most a solved point in the middle of two others was off the cubic between these, in
    shares of the ranges; unchecked: in how many pieces longer than the tolerance there was none.
    """

    x: Array
    y: Array
    frequency_hz: Array
    tangent_x: Array
    tangent_y: Array
    growth_side: IntArray
    modes_beside: IntArray
    kind: Literal["flutter", "divergence"]
    closed: bool
    ends: tuple[str, str]
    residual: Array
    error: Array
    deviation: float
    unchecked: int = 0

    @property
    def outer(self) -> BoolArray:
        """Where (k,) nothing grows on one side of it."""
        return self.modes_beside == 0

    @property
    def _line(self) -> str:
        low, high = float(self.frequency_hz.min()), float(self.frequency_hz.max())
        at = f", {low:.6g} to {hertz(high)}" if self.kind == "flutter" else ""
        ends = "closed" if self.closed else f"from {self.ends[0]} to {self.ends[1]}"
        return f"{self.kind}, {counted(len(self.x), 'point')}{at}, {ends}"

    def to_json(self) -> dict[str, Any]:
        """Plain values; None stands for what does not exist."""

        def plain(values: Array) -> list[float | None]:
            return [float(v) if np.isfinite(v) else None for v in values]

        return {
            "kind": self.kind,
            "closed": self.closed,
            "ends": list(self.ends),
            "x": plain(self.x),
            "y": plain(self.y),
            "frequency_hz": plain(self.frequency_hz),
            "tangent_x": plain(self.tangent_x),
            "tangent_y": plain(self.tangent_y),
            "growth_side": self.growth_side.tolist(),
            "modes_beside": self.modes_beside.tolist(),
            "residual": plain(self.residual),
            "error": plain(self.error),
            "deviation": self.deviation if np.isfinite(self.deviation) else None,
            "unchecked": self.unchecked,
        }


@dataclass(frozen=True)
class SolvedAgain:
    """A point of a curve that was solved for again in the full problem: number of the curve (from 0), x and y there,
    how far off that the reduced model's point was, in shares of the ranges, and the backward error."""

    curve: int
    x: float
    y: float
    difference: float
    residual: float


@dataclass(frozen=True, repr=False)
class Boundary(Tabular):
    """Curves on which modes begin to grow, over two numbers x and y of a case (paths, or "mu").

    lines_x, lines_y: values of x and of y on whose lines onsets were sought; a closed curve that cuts none of them is
    found only where ``counted`` points betray it. agree: whether as many onsets lie on every line as curves cross it,
    as many modes grow at every counted point as the curves say, every curve was followed to its end, the full problem
    has the growing modes of a reduced model at the corners, and the same nodes touch wherever that was looked at;
    sentence: that in words, and what it leaves open.

    solves: eigenvalue problems, steps: factorisations of Newton's method, both of the ``size`` unknowns of the problem
    that was solved (method "full": the whole one; "reduced": a reduced model within ``bound`` of it by its own
    estimate); full_solves: solves with the whole one that the model took. confirmed: points solved again there.
    """

    x: str
    y: str
    x_range: tuple[float, float]
    y_range: tuple[float, float]
    max_frequency_hz: float
    curves: tuple[BoundaryCurve, ...]
    lines_x: tuple[float, ...]
    lines_y: tuple[float, ...]
    counted: tuple[CountedAt, ...]
    agree: bool
    sentence: str
    method: Literal["full", "reduced"]
    size: int
    solves: int
    steps: int
    full_solves: int
    confirmed: tuple[SolvedAgain, ...] = ()
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    provenance: dict[str, Any] = field(default_factory=dict)

    def unstable_modes(self, x: float, y: float) -> int:
        """How many modes grow at a point (a flutter pair is one), from the nearest counted point across the curves.

        How many roots grow is as certain as the curves: a pair is two of them, a mode that grows without oscillating
        one. Where a pair parts into two such modes is on no curve, so that where two or more roots grow the number of
        modes is that of the nearest counted point from which none has to part on the way; ``shading`` says where it is
        known.
        """
        return self._numbers.at(self._share(x, y))

    def unstable_modes_over(self, xs: Array, ys: Array) -> IntArray:
        """The same on a grid: (nx, ny) at values xs (nx,) and ys (ny,), rising, at the cost of a line for each x."""
        return self.shading(xs, ys)[0]

    def shading(self, xs: Array, ys: Array) -> tuple[IntArray, BoolArray]:
        """How many modes grow on a grid (nx, ny) at values xs (nx,) and ys (ny,), rising; and where that is known. It
        is not between three counted points that say different numbers: there growing modes pass the highest frequency,
        or a pair parts into two that grow without oscillating. One root that grows is one mode."""
        grid = np.stack(np.meshgrid(*(np.asarray(v, dtype=float) for v in (xs, ys)), indexing="ij"), axis=-1)
        inside = np.clip((grid - self._low) / self._width, BESIDE, 1 - BESIDE)  # ty: ignore[unsupported-operator]
        return self._numbers.over(inside)

    def _share(self, x: float, y: float) -> Array:
        """A point in shares of the ranges, off the edges, on which curves end."""
        inside: Array = np.clip((np.array([x, y]) - self._low) / self._width, BESIDE, 1 - BESIDE)
        return inside

    @cached_property
    def _low(self) -> Array:
        return np.array([self.x_range[0], self.y_range[0]])

    @cached_property
    def _width(self) -> Array:
        return np.array([self.x_range[1], self.y_range[1]]) - self._low

    @cached_property
    def _numbers(self) -> Numbers:
        return numbers_of(self.counted, self._drawn, self._low, self._width)

    @cached_property
    def _drawn(self) -> list[Drawn]:
        return [drawn_curve(curve, self._low, self._width) for curve in self.curves]

    def polylines(self) -> list[tuple[Array, Array, Array]]:
        """Each curve as fine straight pieces: x, y and frequency [Hz], (m,) each."""
        found: list[tuple[Array, Array, Array]] = []
        for one in self._drawn:
            x, y = (self._low + self._width * one.points).T
            found.append((x, y, one.omega / (2 * np.pi)))
        return found

    def to_json(self) -> dict[str, Any]:
        """The document that `stridor boundary --json` prints; None stands for what does not exist."""
        return {
            "x": self.x,
            "y": self.y,
            "x_range": list(self.x_range),
            "y_range": list(self.y_range),
            "max_frequency_hz": self.max_frequency_hz,
            "curves": [curve.to_json() for curve in self.curves],
            "lines_x": list(self.lines_x),
            "lines_y": list(self.lines_y),
            "counted": [dict(vars(c)) for c in self.counted],
            "agree": self.agree,
            "sentence": self.sentence,
            "method": self.method,
            "size": self.size,
            "solves": self.solves,
            "steps": self.steps,
            "full_solves": self.full_solves,
            "confirmed": [dict(vars(c)) for c in self.confirmed],
            "notes": list(self.notes),
            "warnings": list(self.warnings),
        }

    def table(self) -> Rows:
        """Heads and rows, as its CSV file has them: a row for each point of each curve."""
        rows: list[tuple[Cell, ...]] = []
        for number, c in enumerate(self.curves, start=1):
            columns = (
                c.frequency_hz, c.tangent_x, c.tangent_y, c.growth_side, c.modes_beside, c.error, c.residual
            )  # fmt: skip
            for x, y, *cells in zip(c.x.tolist(), c.y.tolist(), *(v.tolist() for v in columns), strict=True):
                rows.append((x, y, number, c.kind, *cells))
        return (self.x, self.y, *HEADS), rows

    @property
    def _line(self) -> str:
        kinds = [curve.kind for curve in self.curves]
        said = ", ".join(f"{counted(kinds.count(k), f'{k} curve')}" for k in ("flutter", "divergence") if k in kinds)
        return f"over {self.x} and {self.y}: {said or 'no curve'}{'' if self.agree else '; checks do not agree'}"

    def _repr_html_(self) -> str:
        heads = ("kind", "points", "frequency [Hz]", "outer", "closed", "ends")
        rows = [
            (
                c.kind, len(c.x), f"{c.frequency_hz.min():.6g} … {c.frequency_hz.max():.6g}",
                f"{100 * float(np.mean(c.outer)):.0f} %", "yes" if c.closed else "no", " – ".join(c.ends),
            )
            for c in self.curves
        ]  # fmt: skip
        title = f"Stability boundary over {self.x} and {self.y}"
        return html_table(title, heads, rows, (self.sentence, *self.warnings, *self.notes))

    def to_xarray(self) -> Any:
        """xarray.Dataset with dimension point, as `st.save` writes it: the curves one after the other, ``curve`` their
        numbers from 1; what has no point is JSON in the attribute ``boundary``."""
        heads, rows = self.table()
        words = dict(zip(heads[3:], (
            "flutter or divergence", "frequency [Hz]", f"direction, {self.x}", f"direction, {self.y}",
            "1: growth on the left of the direction", "other modes that grow", "estimated error, share of the ranges",
            "componentwise backward error",
        ), strict=True))  # fmt: skip
        columns = list(zip(*rows, strict=True)) if rows else [()] * len(heads)
        kinds = {"kind": object} | dict.fromkeys(WHOLE, np.int64)
        variables = {
            name: ("point", np.array(values, dtype=kinds.get(name, float)), {"long_name": words.get(name, name)})
            for name, values in zip(("x", "y", *heads[2:]), columns, strict=True)
        }
        data = dataset("boundary", variables, {}, self.provenance)
        document = self.to_json()
        for curve in document["curves"]:
            for name in POINTS:
                del curve[name]
        data.attrs |= {
            "x_path": self.x, "y_path": self.y, "method": self.method, "agree": int(self.agree),
            "sentence": self.sentence, "boundary": json.dumps(document),
        }  # fmt: skip
        return data

    @classmethod
    def from_xarray(cls, data: Any) -> Boundary:
        """The boundary whose `to_xarray` that is. Raises KeyError, TypeError or ValueError where it is none's."""
        document = json.loads(data.attrs["boundary"])
        _check_document(document)
        if np.any(data["growth_side"].values == 0):
            raise ValueError("growth_side is 0")
        curves: list[BoundaryCurve] = []
        for number, told in enumerate(document.pop("curves"), start=1):
            here = data["curve"].values == number
            if not np.any(here):
                raise ValueError(f"curve {number} has no point")
            values = {own: data[name].values[here] for own, name in POINTS.items()}
            deviation = np.nan if told["deviation"] is None else told["deviation"]
            curves.append(BoundaryCurve(**told | {"ends": tuple(told["ends"]), "deviation": deviation} | values))
        if np.any((data["curve"].values < 1) | (data["curve"].values > len(curves))):
            raise ValueError("points of curves that it does not have")
        for name in ("x_range", "y_range", "lines_x", "lines_y", "notes", "warnings"):
            document[name] = tuple(document[name])
        document |= {
            "curves": tuple(curves),
            "counted": tuple(CountedAt(**c) for c in document["counted"]),
            "confirmed": tuple(SolvedAgain(**c) for c in document["confirmed"]),
        }
        return cls(**document, provenance=json.loads(data.attrs["provenance"]))


def _check_document(document: Any) -> None:
    """Raise ValueError for what stands for no boundary: its kinds of values, ranges, counted points."""
    if not isinstance(document, dict):
        raise ValueError("its boundary is no table")
    told: dict[str, Any] = document
    for name in ("x", "y", "sentence", "method"):
        if not isinstance(told[name], str):
            raise ValueError(f"{name} is no text")
    for name in ("x_range", "y_range"):
        low, high = told[name]
        if not (np.isfinite(low) and np.isfinite(high) and low < high):
            raise ValueError(f"{name} is no range")
    points = [[place[k] for k in ("x", "y", "unstable_modes")] for place in told["counted"]]
    numbers = [told["lines_x"], told["lines_y"], *points, [told["max_frequency_hz"]]]
    if not all(np.all(np.isfinite(np.array(row, dtype=float))) for row in numbers):
        raise ValueError("it holds numbers that are not finite")
    if not all(roots_fit(c["unstable_modes"], c.get("roots")) for c in told["counted"]):
        raise ValueError("growing roots that are no such number of modes")
    for curve in told["curves"]:
        if curve["kind"] not in ("flutter", "divergence") or len(curve["ends"]) != 2:
            raise ValueError("a curve of no known kind")


def drawn_curve(curve: BoundaryCurve, low: Array, width: Array) -> Drawn:
    """A curve in straight pieces, in shares of the ranges."""
    points = (np.stack([curve.x, curve.y], axis=1) - low) / width
    headings = np.stack([curve.tangent_x, curve.tangent_y], axis=1) / width
    roots = 2 if curve.kind == "flutter" else 1
    return drawn(points, headings, curve.growth_side, 2 * np.pi * curve.frequency_hz, roots)

"""Counter-measures against squeal: changes of a case, the growth they remove, and what else they do."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import Any, Literal, TypeVar, cast, get_args

import numpy as np

from ..digits import readable
from ..modal.complex_modes import UNSTABLE_RELATIVE
from ..notebook import Shown, counted, html_table
from ..tabular import Cell, Rows, Tabular, dataset, joined, split
from ..typing import Array, BoolArray, ComplexArray, IntArray

Kind = Literal["number", "added mass", "chamfer"]
Values = TypeVar("Values", float, Array)
Target = int | Literal["sum"]
SAID = ("kind", "name")  # of a change, as its dataset has it: texts
SIZES = ("direction", "percent", "removed_per_percent", "removed_sum_per_percent", "removed")
SOLVED = ("growth_rate", "frequency_hz", "removed", "removed_sum")  # of one solved again


@dataclass(frozen=True)
class Verified:
    """The modes solved again with the change made: growth_rate and frequency_hz of the target mode (of the fastest
    growing one where the target is the sum), removed [1/s] from the target, the frequencies of what
    is unstable then. doubt: why that may not be all, empty where the full problem was searched."""

    growth_rate: float
    frequency_hz: float
    removed: float
    removed_sum: float
    unstable_hz: tuple[float, ...]
    doubt: str = ""


@dataclass(frozen=True, repr=False)
class Measure(Shown):
    """One change of a case.

    name: path of a number, body that gets mass, or contact that is chamfered and where. direction: +1 more, −1 less: of
    a negative number more is farther from zero (`more_of`). value: the number as the case has it. percent: the size of
    change that predictions are made for, of the number, of the body's mass, of the contact's area (nodes where they
    have none). removed_per_percent [1/s]: growth rate of the target taken away per per cent of
    change, removed_sum_per_percent of all unstable modes together. predicted (b,) [1/s]: eigenvalues after the change.
    makes_unstable: branches that were stable and are predicted not to be; brings_close: those predicted to come within
    the margin. position [m] and mass [kg] of an added mass. verified: solved again, None where it was not.
    """

    kind: Kind
    name: str
    direction: int
    percent: float
    removed_per_percent: float
    removed_sum_per_percent: float
    removed: float
    predicted: ComplexArray
    makes_unstable: tuple[int, ...]
    brings_close: tuple[int, ...]
    position: tuple[float, ...] | None = None
    mass: float | None = None
    verified: Verified | None = None
    value: float | None = None

    @property
    def _line(self) -> str:
        again = "" if self.verified is None else f", {self.verified.removed:.4g} 1/s when solved again"
        return f"{self.words}: takes {self.removed:.4g} 1/s of growth away{again}"

    @property
    def words(self) -> str:
        """The change in words."""
        if self.kind == "added mass":
            at = ", ".join(f"{x:.4g}" for x in self.position or ())
            return f"add {self.mass:.3g} kg to {self.name} at ({at}) m"
        if self.kind == "chamfer":
            return f"take {self.percent:.3g} % of the contact away: {self.name}"
        if self.value is not None and self.value < 0:
            # Raised or lowered would be taken for the sign's sake.
            moved, more = f"from {self.value:.6g} to {self.changed:.6g}", "more" if self.direction > 0 else "less"
            return f"move {self.name} {moved}, {self.percent:g} % {more}"
        return f"{'raise' if self.direction > 0 else 'lower'} {self.name} by {self.percent:g} %"

    @property
    def changed(self) -> float | None:
        """The number after the change, None of other changes."""
        return None if self.value is None else more_of(self.value, self.direction * self.percent)


@dataclass(frozen=True, repr=False)
class Countermeasures(Tabular):
    """Changes by growth removed per per cent, best first: those solved again by what they took, then those predicted
    to take some. target: number of a branch, or "sum" of all unstable ones.

    branch (b,) and eigenvalues (b,) [1/s] of the modes watched, as the case is; margin: damping ratio below which a
    stable mode is called close.
    """

    mu: float
    target: Target
    branch: IntArray
    eigenvalues: ComplexArray
    measures: tuple[Measure, ...]
    margin: float
    warnings: tuple[str, ...] = ()
    provenance: dict[str, Any] = field(default_factory=dict)

    def table(self) -> Rows:
        """Heads and rows, as its CSV file has them: a row for each change, the best first."""
        heads = (
            "mu", "target", "kind", "name", "change", "percent", "mass_kg", "removed_per_percent_1_s",
            "removed_sum_per_percent_1_s", "removed_1_s", "makes_unstable", "brings_close", "verified_removed_1_s",
            "verified_frequency_hz", "verified_growth_1_s",
        )  # fmt: skip
        rows: list[tuple[Cell, ...]] = []
        for m in self.measures:
            again = (None, None, None)
            if m.verified is not None:
                again = m.verified.removed, m.verified.frequency_hz, m.verified.growth_rate
            branches = (" ".join(map(str, numbers)) for numbers in (m.makes_unstable, m.brings_close))
            rows.append(
                (
                    self.mu, str(self.target), m.kind, m.name, m.words, m.direction * m.percent, m.mass,
                    m.removed_per_percent, m.removed_sum_per_percent, m.removed, *branches, *again,
                )
            )  # fmt: skip
        return heads, rows

    @property
    def helpful(self) -> tuple[Measure, ...]:
        """Changes that take growth away, best first: those solved again by what they took, then those predicted to."""
        again = [m for m in self.measures if m.verified is not None and m.verified.removed > 0]
        again.sort(key=lambda m: -m.verified.removed / m.percent if m.verified else 0.0)
        return (*again, *(m for m in self.measures if m.verified is None and m.removed > 0))

    @property
    def solved_again(self) -> int:
        """How many of the changes, the first ones, were solved again with the change made."""
        return sum(m.verified is not None for m in self.measures)

    @property
    def _line(self) -> str:
        best = f"; best: {self.helpful[0].words}" if self.helpful else ""
        return f"{counted(len(self.measures), 'change')} at μ = {self.mu:g}{best}"

    def _repr_html_(self) -> str:
        heads = ("change", "growth removed per % [1/s]", "removed [1/s]", "solved again [1/s]", "makes unstable")
        rows = [
            (
                m.words, readable(m.removed_per_percent, 4), readable(m.removed, 4),
                "" if m.verified is None else readable(m.verified.removed, 4), ", ".join(map(str, m.makes_unstable)),
            )
            for m in self.measures
        ]  # fmt: skip
        return html_table(f"Counter-measures at μ = {self.mu:g}", heads, rows, self.warnings)

    def to_json(self) -> dict[str, Any]:
        """The document that `stridor countermeasures --json` prints."""
        return {
            "mu": self.mu,
            "target": self.target,
            "margin": self.margin,
            "measures": [
                {
                    "kind": m.kind,
                    "name": m.name,
                    "words": m.words,
                    "direction": m.direction,
                    "percent": m.percent,
                    "removed_per_percent": m.removed_per_percent,
                    "removed_sum_per_percent": m.removed_sum_per_percent,
                    "removed": m.removed,
                    "makes_unstable": list(m.makes_unstable),
                    "brings_close": list(m.brings_close),
                    "position": None if m.position is None else list(m.position),
                    "mass": m.mass,
                    "value": m.value,
                    "verified": None if m.verified is None else vars(m.verified).copy(),
                }
                for m in self.measures
            ],
            "warnings": list(self.warnings),
        }

    def to_xarray(self) -> Any:
        """xarray.Dataset with dimensions change (best first) and branch, as `st.save` writes it; lists of branches,
        places of masses and what is unstable after a change are JSON in the attribute ``countermeasures``."""
        again = [m.verified for m in self.measures]
        shape = len(self.measures), len(self.branch)
        predicted = np.array([m.predicted for m in self.measures], complex).reshape(shape)
        units = {"percent": "size of the change [%]", "direction": "+1 more, -1 less"}
        variables: dict[str, Any] = {
            **{n: ("change", np.array([getattr(m, n) for m in self.measures], dtype=object)) for n in SAID},
            **{n: ("change", [float(getattr(m, n)) for m in self.measures], {"long_name": units.get(n, f"{n} [1/s]")})
               for n in SIZES},
            "mass": ("change", [np.nan if m.mass is None else m.mass for m in self.measures], {"units": "kg"}),
            "value": ("change", [np.nan if m.value is None else m.value for m in self.measures],
                      {"long_name": "the number before the change"}),
            **{f"verified_{n}": ("change", [np.nan if v is None else float(getattr(v, n)) for v in again])
               for n in SOLVED},
            "eigenvalue": split(("branch",), self.eigenvalues, {"units": "1/s"}),
            "predicted": split(("change", "branch"), predicted, {"units": "1/s", "long_name": "after the change"}),
        }  # fmt: skip
        lists = [
            {
                "makes_unstable": list(m.makes_unstable), "brings_close": list(m.brings_close),
                "position": None if m.position is None else list(m.position),
                "unstable_hz": None if m.verified is None else list(m.verified.unstable_hz),
                "doubt": None if m.verified is None else m.verified.doubt,
            }
            for m in self.measures
        ]  # fmt: skip
        told = {"mu": self.mu, "target": self.target, "margin": self.margin, "changes": lists}
        data = dataset("countermeasures", variables, {"branch": ("branch", self.branch)}, self.provenance)
        return data.assign_attrs(countermeasures=json.dumps(told | {"warnings": list(self.warnings)}))

    @classmethod
    def from_xarray(cls, data: Any) -> Countermeasures:
        """The changes whose `to_xarray` that is. Raises KeyError, TypeError or ValueError where it is none's."""
        told = json.loads(data.attrs["countermeasures"])
        mu, target, margin = float(told["mu"]), told["target"], float(told["margin"])
        branch, predicted = data["branch"].values, joined(data["predicted"].values)
        known = target == "sum" or (type(target) is int and target in branch)
        if not (known and mu >= 0 and all(isinstance(text, str) for text in told["warnings"])):
            raise ValueError("its friction coefficient, target or texts are none")
        columns = {name: data[name].values for name in (*SAID, *SIZES, "mass", *(f"verified_{n}" for n in SOLVED))}
        columns["value"] = data["value"].values if "value" in data else np.full(len(predicted), np.nan)
        measures: list[Measure] = []
        for k, lists in zip(range(len(predicted)), told["changes"], strict=True):
            row = {name: values[k] for name, values in columns.items()}
            if row["kind"] not in get_args(Kind) or abs(row["direction"]) != 1:
                raise ValueError(f"a change of kind {str(row['kind'])[:40]!r}")
            solved = None
            if lists["unstable_hz"] is not None:
                unstable = tuple(float(v) for v in lists["unstable_hz"])
                again: Any = {name: float(row[f"verified_{name}"]) for name in SOLVED}
                solved = Verified(**again, unstable_hz=unstable, doubt=str(lists["doubt"]))
            position = lists["position"]
            sizes: Any = {name: float(row[name]) for name in SIZES[1:]}
            measures.append(
                Measure(
                    kind=cast(Kind, str(row["kind"])),  # arrays of texts hold NumPy's own
                    name=str(row["name"]),
                    direction=int(row["direction"]),
                    **sizes,
                    predicted=predicted[k],
                    makes_unstable=tuple(map(int, lists["makes_unstable"])),
                    brings_close=tuple(map(int, lists["brings_close"])),
                    position=None if position is None else tuple(map(float, position)),
                    mass=None if np.isnan(row["mass"]) else float(row["mass"]),
                    value=None if np.isnan(row["value"]) else float(row["value"]),
                    verified=solved,
                )
            )
        return cls(
            mu, target, branch, joined(data["eigenvalue"].values), tuple(measures), margin, tuple(told["warnings"]),
            json.loads(data.attrs["provenance"]),
        )  # fmt: skip


def per_cent_of(value: Values) -> Values:
    """What a per cent more of a number adds to it: farther from zero whatever its sign, −1 N becomes −1.01 N."""
    return 0.01 * value


def more_of(value: float, percent: float) -> float:
    """A number with so many per cent more of it, less of it where they are negative."""
    return value + percent * per_cent_of(value)


def growing(lam: ComplexArray) -> BoolArray:
    """Whether (b,) an eigenvalue is that of an unstable mode, beyond rounding."""
    return lam.real > UNSTABLE_RELATIVE * np.maximum(np.abs(lam), 1.0)


def growth(lam: ComplexArray) -> float:
    """Σ Re λ of what grows."""
    return float(np.maximum(lam.real, 0.0).sum())

"""All cycles that were found of a problem, as data."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..digits import hertz
from ..notebook import counted, html_table
from ..tabular import Cell, Rows, Tabular, dataset
from ..typing import Array
from .branch import Bifurcation, CycleBranch
from .cycle import NEUTRAL, SHORT, Change, Cycle
from .parting import Unclosed

SCHEMA = "stridor.cycles/1"
HISTORIES = {
    "normal_force": ("cycle", "sample", "contact"), "tangential_force": ("cycle", "sample", "contact"),
    "slip_velocity": ("cycle", "sample", "contact"), "gap": ("cycle", "sample", "contact"),
    "status": ("cycle", "sample", "contact"), "displacement": ("cycle", "sample", "point", "direction"),
    "velocity": ("cycle", "sample", "point", "direction"), "acceleration": ("cycle", "sample", "point", "direction"),
    "shares": ("cycle", "contact", "kind"), "slip_range": ("cycle", "contact", "end"),
    "force_range": ("cycle", "contact", "end"),
}  # fmt: skip
UNITS = {
    "normal_force": "N", "tangential_force": "N", "slip_velocity": "m/s", "gap": "m", "displacement": "m",
    "velocity": "m/s", "acceleration": "m/s²", "slip_range": "m/s", "force_range": "N", "period": "s",
}  # fmt: skip
POOR = 1e-2  # a defect that is said
REACH = (
    "Cycles to which no onset, no branch and no push or run above leads, such as loud ones apart from every onset, are "
    "not among them."
)
NUMBERS = ("mu", "period", "residual", "grazed", "defect", "own_off")


@dataclass(frozen=True)
class CycleOnset:
    """An onset of steady sliding in the range: μ, frequency [Hz], and whether growth ends there with larger μ."""

    mu: float
    frequency_hz: float
    stabilising: bool


@dataclass(frozen=True, repr=False)
class Cycles(Tabular):
    """Limit cycles over the friction coefficient: one by one, and the branches that they lie on.

    onsets: those of steady sliding in ``between`` (None where only single μ were asked for). missing: what was looked
    for and not found, or not followed to its end, in words; there may be cycles that no motion and no branch led to.
    unclosed: motions that were followed and closed after no period. interrupted: whether it was stopped on its way.
    """

    cycles: tuple[Cycle, ...]
    branches: tuple[CycleBranch, ...]
    onsets: tuple[CycleOnset, ...]
    between: tuple[float, float] | None
    missing: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    interrupted: bool = False
    provenance: dict[str, Any] = field(default_factory=dict)
    unclosed: tuple[Unclosed, ...] = ()

    def branch_of(self, number: int) -> int | None:
        """The number (from 0) of the branch that a cycle lies on, None of one that was not followed."""
        return next((k for k, branch in enumerate(self.branches) if number in branch.cycles), None)

    def at(self, mu: float, tolerance: float = 1e-9) -> tuple[Cycle, ...]:
        """The cycles found at a friction coefficient."""
        return tuple(c for c in self.cycles if abs(c.mu - mu) <= tolerance * max(abs(mu), 1.0))

    @property
    def sentence(self) -> str:
        """What was found, in one sentence."""
        if not self.cycles:
            rest = "; what was looked for and not reached is named below" if self.missing else ""
            if self.interrupted:
                return f"the search was stopped before any limit cycle was found{rest}"
            return f"no limit cycle was found{rest}"
        mus = [c.mu for c in self.cycles]
        over = f"μ = {mus[0]:.6g}" if min(mus) == max(mus) else f"μ = {min(mus):.6g} to {max(mus):.6g}"
        count = [sum(c.stable is s for c in self.cycles) for s in (True, False, None)]
        said = [f"{n} {w}" for n, w in zip(count, ("stable", "unstable", "undecided"), strict=True) if n]
        on = f", {len(self.branches)} {'branch' if len(self.branches) == 1 else 'branches'}" if self.branches else ""
        return f"{counted(len(self.cycles), 'limit cycle')} at {over}: {', '.join(said)}{on}{self._untold}"

    @property
    def reach(self) -> str:
        """What a search from onsets, pushes and runs does not find, whatever it has found."""
        return REACH

    @property
    def _untold(self) -> str:
        """What may be there though it is not listed; "" of shooting, and where all contacts do all of it."""
        found = [(c.untold_share, kind) for c in self.cycles if c.untold_share for kind in c.untold]
        if not found:
            return ""
        kinds = [kind for kind in SHORT if any(kind == other for _, other in found)]
        said = " and ".join(filter(None, [", ".join(kinds[:-1]), kinds[-1]]))
        longest = max(share for share, _ in found)
        return f"; {said} shorter than about {100 * longest:.2g} % of a period are not told (harmonic balance)"

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a reader must know of them."""
        rested = sum(c.landed > 0 for c in self.cycles)
        said = [f"stopped early: {self.sentence}" if self.cycles else self.sentence] if self.interrupted else []
        if rested:
            said.append(
                f"in {counted(rested, 'cycle')} contacts throw one another off without end and were brought to rest, "
                "which is not exact"
            )
        if unknown := sum(not c.multiplied for c in self.cycles):
            said.append(
                f"of {counted(unknown, 'cycle')} it is not known whether they are stable: the system is too large for "
                "Floquet's multipliers, or some of them were not found; a run in time tells"
            )
        if lost := [c for c in self.cycles if c.own_lost]:
            said.append(
                f"stability of {counted(len(lost), 'cycle')} is left undecided: the multiplier of the motion itself, "
                f"which is one, comes out up to {max(c.own_off for c in lost):.2g} off; more harmonics come closer"
            )
        off = [c for c in self.cycles if c.defect > POOR]
        if off:
            said.append(
                f"{counted(len(off), 'cycle')} by harmonic balance are off the equations of motion by up to "
                f"{max(c.defect for c in off):.2g} of their motion (defect); more harmonics come closer"
            )
        return tuple(said)

    @property
    def _line(self) -> str:
        return self.sentence

    def _repr_html_(self) -> str:
        rows = [
            (f"{c.mu:.6g}", hertz(c.frequency_hz), _told(c.stable), f"{c.largest_multiplier:.5g}", ", ".join(c.kinds))
            for c in self.cycles
        ]
        heads = ("μ", "frequency", "stable", "largest multiplier", "with")
        return html_table("Limit cycles", heads, rows, (self.sentence, *self.missing, self.reach))

    def table(self) -> Rows:
        """Heads and rows, as its CSV file has them: a row for each cycle and contact."""
        heads = (
            "cycle", "branch", "mu", "frequency_hz", "period_s", "stable", "largest_multiplier", "residual", "with",
            "slip_amplitude", "contact", "open", "stick", "slip", "slip_min", "slip_max", "normal_force_min",
            "normal_force_max", "reached_from", "method", "harmonics", "defect",
        )  # fmt: skip
        rows: list[tuple[Cell, ...]] = []
        for number, c in enumerate(self.cycles):
            branch = self.branch_of(number)
            for k, name in enumerate(c.contact_names):
                rows.append((
                    number + 1, None if branch is None else branch + 1, c.mu, c.frequency_hz, c.period,
                    _told(c.stable), c.largest_multiplier if c.multiplied else None, c.residual, " ".join(c.kinds),
                    c.slip_amplitude, name, *c.shares[k].tolist(), *c.slip_range[k].tolist(),
                    *c.force_range[k].tolist(), c.reached_from, c.method, c.harmonics or None,
                    c.defect if np.isfinite(c.defect) else None,
                ))  # fmt: skip
        return heads, rows

    def to_json(self) -> dict[str, Any]:
        """The document that `stridor cycles --json` prints; numbers of cycles and onsets count from 0."""
        return {
            "schema": SCHEMA,
            "between": None if self.between is None else list(self.between),
            "cycles": [c.to_json() | {"branch": self.branch_of(k)} for k, c in enumerate(self.cycles)],
            "branches": [b.to_json() for b in self.branches],
            "onsets": [dict(vars(o)) for o in self.onsets],
            "missing": list(self.missing),
            "reach": self.reach,
            "unclosed": [u.to_json() for u in self.unclosed],
            "notes": list(self.notes),
            "warnings": list(self.warnings),
            "interrupted": self.interrupted,
            "sentence": self.sentence,
        }

    def to_xarray(self) -> Any:
        """xarray.Dataset with dimensions cycle, sample (of one period), contact, point, multiplier, as `st.save` writes
        it: of cycles with fewer samples than others the last one, at the end of the period, is repeated; branches,
        onsets and changes of contact are JSON in the attribute ``cycles``."""
        cycles = self.cycles
        names, points = (cycles[0].contact_names, cycles[0].watch_names) if cycles else ((), ())
        most = max((len(c.multipliers) for c in cycles), default=0)
        multipliers = np.full((len(cycles), most, 2), np.nan)
        for k, c in enumerate(cycles):
            multipliers[k, : len(c.multipliers)] = np.stack([c.multipliers.real, c.multipliers.imag], axis=1)
        variables: dict[str, Any] = {
            name: ("cycle", np.array([getattr(c, name) for c in cycles], dtype=float), _units(name)) for name in NUMBERS
        }
        samples = max((len(c.time) for c in cycles), default=0)
        times = np.array([_lasting(c.time, samples) for c in cycles]) if cycles else np.zeros((0, 0))
        variables["time"] = ("cycle", "sample"), times, {"units": "s"}
        variables["multiplier"] = ("cycle", "multiplier_number", "part"), multipliers, {}
        axes = ["x", "y", "z"][: cycles[0].displacement.shape[2] if cycles else 2]
        sizes = {"contact": len(names), "point": len(points), "direction": len(axes), "kind": 3, "end": 2, "sample": 0}
        for name, dims in HISTORIES.items():
            empty = tuple(sizes[d] for d in dims[1:])
            rows = [getattr(c, name) for c in cycles]
            rows = [_lasting(row, samples) for row in rows] if "sample" in dims else rows
            values = np.array(rows) if cycles else np.zeros((0, *empty))
            variables[name] = dims, values.astype(np.int64 if name == "status" else float), _units(name)
        coords = {
            "contact": ("contact", np.array(names, dtype=object)),
            "point": ("point", np.array(points, dtype=object)),
            "direction": ("direction", np.array(axes, dtype=object)),
            "kind": ("kind", np.array(["open", "stick", "slip"], dtype=object)),
            "end": ("end", np.array(["least", "largest"], dtype=object)),
        }
        data = dataset("cycles", variables, coords, self.provenance)
        own = [
            {"changes": [list(c) for c in one.changes], "landed": one.landed, "reached_from": one.reached_from,
             "method": one.method, "harmonics": one.harmonics, "multiplied": one.multiplied}
            for one in cycles
        ]
        document = self.to_json()
        data.attrs |= {
            "sentence": self.sentence,
            "cycles": json.dumps({k: v for k, v in document.items() if k not in ("cycles", "sentence")} | {"own": own}),
        }
        return data

    @classmethod
    def from_xarray(cls, data: Any) -> Cycles:
        """The cycles whose `to_xarray` that is. Raises KeyError, TypeError or ValueError where it is none's."""
        document = json.loads(data.attrs["cycles"])
        own = document["own"]
        count = data.sizes["cycle"]
        if len(own) != count:
            raise ValueError(f"{len(own)} lists of changes for {count} cycles")
        names = tuple(str(n) for n in data["contact"].values)
        points = tuple(str(n) for n in data["point"].values)
        cycles = tuple(_read(data, k, told, names, points) for k, told in enumerate(own))
        branches = tuple(_branch(told, count, len(document["onsets"])) for told in document["branches"])
        between = document["between"]
        if between is not None and not (len(between) == 2 and float(between[0]) < float(between[1])):
            raise ValueError("between is no range")
        return cls(
            cycles, branches, tuple(CycleOnset(**o) for o in document["onsets"]),
            None if between is None else (float(between[0]), float(between[1])), tuple(document["missing"]),
            tuple(document["notes"]), bool(document["interrupted"]), json.loads(data.attrs["provenance"]),
            tuple(Unclosed.from_json(told) for told in document.get("unclosed", ())),
        )  # fmt: skip


def _read(data: Any, k: int, told: Any, names: tuple[str, ...], points: tuple[str, ...]) -> Cycle:
    parts = data["multiplier"].values[k]
    parts = parts[np.all(np.isfinite(parts), axis=1)]
    changes = tuple(
        Change(float(t), str(c), str(w), tuple(int(b) for b in behind)) for t, c, w, behind in told["changes"]
    )
    if any(c.contact not in names or len(c.behind) != len(names) for c in changes):
        raise ValueError("changes of contacts that there are not")
    numbers: dict[str, Any] = {name: float(data[name].values[k]) for name in NUMBERS}
    series = _method(told) == "harmonic"
    if np.isfinite(numbers["grazed"]) == series or np.isfinite(numbers["defect"]) != series:
        raise ValueError("grazed is what shooting tells, defect harmonic balance")
    if np.isfinite(numbers["own_off"]) != (series and bool(told["multiplied"])):
        raise ValueError("harmonic balance tells how far the motion's own multiplier is off, where it has any")
    time = data["time"].values[k]
    count = int(np.searchsorted(time, time[-1])) + 1 if len(time) else 0
    histories = {n: data[n].values[k][: count if "sample" in dims else None] for n, dims in HISTORIES.items()}
    return Cycle(
        **numbers, time=time[:count], **histories,
        multipliers=parts[:, 0] + 1j * parts[:, 1], changes=changes, contact_names=names, watch_names=points,
        landed=int(told["landed"]), reached_from=str(told["reached_from"]), method=_method(told),
        harmonics=int(told["harmonics"]), multiplied=bool(told["multiplied"]),
    )  # fmt: skip


def _method(told: Any) -> str:
    method = str(told["method"])
    if method not in NEUTRAL:
        raise ValueError(f"cycles by {method[:40]!r}, which is no method")
    return method


def _branch(told: Any, count: int, onsets: int) -> CycleBranch:
    numbers, folds = (tuple(int(n) for n in told[name]) for name in ("cycles", "folds"))
    onset = None if told["onset"] is None else int(told["onset"])
    if not all(0 <= n < count for n in (*numbers, *folds)) or not (onset is None or 0 <= onset < onsets):
        raise ValueError("a branch of cycles that there are not")
    met = tuple(Bifurcation(**b) for b in told["bifurcations"])
    words = (str(told["begins"]), str(told["ends"]))
    return CycleBranch(numbers, *words, onset, folds, met, str(told.get("reached_from", "")))


def _lasting(values: Array, count: int) -> Array:
    """So many rows: the last one, at the end of the period, as often as others have more."""
    return np.concatenate([values, np.repeat(values[-1:], count - len(values), axis=0)])


def _units(name: str) -> dict[str, str]:
    return {"units": UNITS[name]} if name in UNITS else {}


def _told(stable: bool | None) -> str:
    return {True: "yes", False: "no", None: "undecided"}[stable]

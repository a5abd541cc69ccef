"""What an ensemble of runs leaves: a row of numbers for each member, and the modal map beside them."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..digits import readable
from ..notebook import MOST_ROWS, counted, html_table
from ..tabular import Cell, Rows, Tabular, dataset
from ..temporal.trajectory import Trajectory
from ..typing import Array, IntArray

AXES = ("mu", "load", "speed", "perturbation")
SHARES = ("stick", "slip", "separation")
HEADS = (
    *AXES, "sweep", "slip_speed_m_s", "regime", "rms", "peak", "frequency_hz", "stronger_below_hz", "growth_1_s",
    "mode", "mode_hz", "mode_deviation", "error",
)  # fmt: skip
REGIMES = ("steady", "transient", "grows", "decays", "linear", "sticks", "still", "failed", "interrupted")
UNITS = {
    "slip_speed": "m/s", "frequency_hz": "Hz", "stronger_below_hz": "Hz", "growth_rate": "1/s", "mode_hz": "Hz",
    "perturbation": "m/s",
}  # fmt: skip


NOT_KNOWN = -1  # unstable modes where nothing was solved


@dataclass(frozen=True)
class ModalMap:
    """What the modal approach says over friction, at the speeds of an ensemble: mu (q,), speed (s,) factors; unstable
    (q, s) how many modes grow, NOT_KNOWN (−1) where there is no steady sliding; frequency_hz, growth_rate (q, s) of the
    fastest, NaN where none grows. Modes do not depend on the speed where friction does not: s is then 1. load: the
    factor of all loads at which it is; modes of members at other loads are of their own where that matters."""

    mu: Array
    speed: Array
    unstable: IntArray
    frequency_hz: Array
    growth_rate: Array
    load: float = 1.0

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return {
            "mu": self.mu.tolist(),
            "speed": self.speed.tolist(),
            "load": self.load,
            "unstable": [[None if n == NOT_KNOWN else n for n in row] for row in self.unstable.tolist()],
            "frequency_hz": [[_plain(v) for v in row] for row in self.frequency_hz],
            "growth_rate": [[_plain(v) for v in row] for row in self.growth_rate],
        }


@dataclass(frozen=True, repr=False)
class Ensemble(Tabular):
    """Runs of one case over friction, loads and speeds. k members, m contacts.

    mu, load, speed (k,): friction coefficient at the case's own speed, factors on all loads and prescribed velocities;
    perturbation (k,) [m/s] at the start; sweep (k,): "up", "down", or "" for a member that starts by itself; slip_speed
    (k,) [m/s]: the largest of the contacts in steady sliding.

    Over the window, the last share of the last phase: rms and peak (k,) of the ``observable`` about its mean [unit];
    frequency_hz (k,) of its largest line, and stronger_below_hz (k,) below which something is stronger than that line
    and too slow for the window to tell its frequency (NaN: nothing is, and the line dominates); stick, slip, separation
    (k, m): shares of time, of every step; growth_rate (k,) [1/s] of the rms from one half of it to the other. regime
    (k,), by these halves: "steady" where contacts change between stick, slip and separation and the rms of both is the
    same within 10 %, "transient" where it is not. Without such changes contacts that slip leave the motion linear: it
    "grows" or "decays" by more than that, or is "linear"; "sticks" where none slips, "still" where nothing vibrates, or
    nothing has disturbed steady sliding and what is left is rounding (growth_rate, frequency_hz: NaN); "failed" (error
    says why) or "interrupted".

    mode (k,): number, as in `modes`, of the unstable mode that responds, the nearest one to the frequency if it is
    within 5 % of it, else 0; mode_hz, mode_deviation (k,): frequency of the nearest and how far off the run is,
    f/f_mode − 1; only of members that are steady or transient or grow, and whose line dominates. NaN is what does not
    exist.

    axes: the values along each of mu, load, speed, perturbation, if members are all combinations of these, in that
    order, up before down; else (). modal: the modal map, None where it was not asked for or cannot be told. runs: the
    members' `Trajectory`, each with the part from the start of its last phase on, where records were asked for.
    device: "cpu", or the name of the GPU on which they ran.
    """

    mu: Array
    load: Array
    speed: Array
    perturbation: Array
    sweep: tuple[str, ...]
    slip_speed: Array
    observable: str
    unit: str
    rms: Array
    peak: Array
    frequency_hz: Array
    stronger_below_hz: Array
    stick: Array
    slip: Array
    separation: Array
    contact_names: tuple[str, ...]
    growth_rate: Array
    regime: tuple[str, ...]
    mode: IntArray
    mode_hz: Array
    mode_deviation: Array
    error: tuple[str, ...]
    window: tuple[float, float]
    step: float
    method: str
    axes: tuple[tuple[str, Array], ...] = ()
    modal: ModalMap | None = None
    runs: tuple[Trajectory | None, ...] = ()
    notes: tuple[str, ...] = ()
    interrupted: bool = False
    device: str = "cpu"
    provenance: dict[str, Any] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.mu)

    @property
    def shape(self) -> tuple[int, ...]:
        """Of the map, sweep (1 or 2) × mu × load × speed × perturbation; (k,) where members are no grid."""
        if not self.axes:
            return (len(self),)
        return (max(1, len(set(self.sweep))), *(len(values) for _, values in self.axes))

    def to_json(self) -> dict[str, Any]:
        """The document that `stridor ensemble --json` prints; None stands for what does not exist."""
        heads, rows = self.table()
        fixed = len(HEADS)
        shares = zip(self.stick, self.slip, self.separation, strict=True)
        contacts = [
            {
                name: dict(zip(SHARES, (_plain(one[c]) for one in of_member), strict=True))
                for c, name in enumerate(self.contact_names)
            }
            for of_member in shares
        ]
        return {
            "observable": self.observable,
            "unit": self.unit,
            "window": list(self.window),
            "step": self.step,
            "method": self.method,
            "device": self.device,
            "members": [
                dict(zip(heads[:fixed], row[:fixed], strict=True)) | {"contacts": own}
                for row, own in zip(rows, contacts, strict=True)
            ],
            "modal": None if self.modal is None else self.modal.to_json(),
            "interrupted": self.interrupted,
            "notes": list(self.notes),
        }

    def table(self) -> Rows:
        """Heads and rows, as its CSV file has them: a row for each member."""
        shares = [f"{name}.{what}" for name in self.contact_names for what in SHARES]
        heads = (*HEADS, *shares)
        rows: list[tuple[Cell, ...]] = []
        for k in range(len(self)):
            numbers = [self.rms, self.peak, self.frequency_hz, self.stronger_below_hz, self.growth_rate]
            tables = (self.stick, self.slip, self.separation)
            fractions = [t[k, c] for c in range(len(self.contact_names)) for t in tables]
            rows.append(
                (
                    *(_plain(v[k]) for v in (self.mu, self.load, self.speed, self.perturbation)),
                    self.sweep[k],
                    _plain(self.slip_speed[k]),
                    self.regime[k],
                    *(_plain(v[k]) for v in numbers),
                    int(self.mode[k]) or None,
                    _plain(self.mode_hz[k]),
                    _plain(self.mode_deviation[k]),
                    self.error[k],
                    *(_plain(v) for v in fractions),
                )
            )
        return heads, rows

    @property
    def regimes(self) -> dict[str, int]:
        """How many members are in each regime that occurs."""
        found = Counter(self.regime)
        return {name: found[name] for name in REGIMES if found[name]}

    @property
    def how(self) -> str:
        """In words how they ran, and where if that was a GPU."""
        return self.method if self.device == "cpu" else f"{self.method} on {self.device}"

    @property
    def _line(self) -> str:
        told = ", ".join(f"{count} {name}" for name, count in self.regimes.items())
        return f"{counted(len(self), 'member')}, {self.how}: {told}"

    def _repr_html_(self) -> str:
        heads = (
            "μ", "load", "speed", "sweep", "regime", f"rms [{self.unit}]", "frequency [Hz]", "stronger below [Hz]",
            "mode",
        )  # fmt: skip
        rows = [
            (
                readable(self.mu[k], 4), readable(self.load[k], 4), readable(self.speed[k], 4), self.sweep[k],
                self.regime[k], readable(self.rms[k], 4), readable(self.frequency_hz[k], 5),
                readable(self.stronger_below_hz[k], 5) if np.isfinite(self.stronger_below_hz[k]) else "–",
                int(self.mode[k]) or "–",
            )
            for k in range(min(len(self), MOST_ROWS))
        ]  # fmt: skip
        more = f"and {len(self) - MOST_ROWS} more" if len(self) > MOST_ROWS else ""
        return html_table(f"Ensemble of {self._line}; {self.observable}", heads, rows, (more, *self.notes))

    def to_xarray(self) -> Any:
        """xarray.Dataset over sweep, mu, load, speed and perturbation, or over member where these are no grid."""
        grid = bool(self.axes)
        dims = ("sweep", *AXES) if grid else ("member",)
        coords: dict[str, Any] = {"contact": ("contact", np.array(self.contact_names, dtype=object))}
        one_by_one: dict[str, Any] = {}
        if grid:
            coords |= {name: (name, values) for name, values in self.axes}
            coords["sweep"] = ("sweep", np.array(list(dict.fromkeys(self.sweep)), dtype=object))
        else:
            one_by_one = {name: getattr(self, name) for name in AXES}
        own = (
            "slip_speed", "rms", "peak", "frequency_hz", "stronger_below_hz", "growth_rate", "mode", "mode_hz",
            "mode_deviation",
        )  # fmt: skip
        numbers = one_by_one | {name: getattr(self, name) for name in own}
        units = UNITS | {"rms": self.unit, "peak": self.unit}
        variables: dict[str, Any] = {
            name: (dims, values.reshape(self.shape), {"units": units.get(name, "1")})
            for name, values in numbers.items()
        }
        for name in ("stick", "slip", "separation"):
            values = getattr(self, name).reshape(*self.shape, len(self.contact_names))
            variables[name] = ((*dims, "contact"), values, {"units": "1"})
        for name in ("regime", "error"):
            variables[name] = (dims, np.array(getattr(self, name), dtype=object).reshape(self.shape))
        if self.modal is not None:
            coords["modal_mu"] = ("modal_mu", self.modal.mu)
            coords["modal_speed"] = ("modal_speed", self.modal.speed)
            for name, unit in (("unstable", "1"), ("frequency_hz", "Hz"), ("growth_rate", "1/s")):
                values = getattr(self.modal, name)
                variables[f"modal_{name}"] = (("modal_mu", "modal_speed"), values, {"units": unit})
        data = dataset("ensemble", variables, coords, self.provenance)
        told = {"observable": self.observable, "unit": self.unit, "method": self.method, "device": self.device}
        return data.assign_attrs(**told, step=self.step)


def _plain(value: Any) -> float | None:
    number = float(value)
    return number if np.isfinite(number) else None

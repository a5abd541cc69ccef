"""What of a run that separates would come out again: averages over the attractor, beside extrema of one trajectory.

Once a contact separates, motion is chaotic: two runs that differ in the last bit of their start part within some tens
of impacts. A largest value then belongs to the trajectory that happened to be computed; on another processor, which
rounds differently, it is another one. What both share are averages over the motion that they settle to.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from ..digits import readable
from ..notebook import Shown, html_table
from ..typing import Array
from .trajectory import Trajectory

QUANTILES = (0.05, 0.5, 0.95)
FEWEST_PEAKS = 10  # below that a mean of peaks says little


@dataclass(frozen=True)
class Averages:
    """Of one contact over the records of the last phase from the first separation on.

    mean_peak_normal_force [N]: mean of peaks, a peak being the largest force of each stretch in which it lies above its
    mean; None with fewer than ten. quantile_* [N] of the normal force in time; shares of time in stick, slip and
    separation.
    """

    mean_peak_normal_force: float | None
    quantile_05_normal_force: float
    quantile_50_normal_force: float
    quantile_95_normal_force: float
    stick_fraction: float
    slip_fraction: float
    separation_fraction: float


NAMES = tuple(f.name for f in fields(Averages))


@dataclass(frozen=True)
class SettledContact:
    """One contact in the part of a run that repeats itself: since [s] the first separation of the last phase, until
    its end; peaks: how many there are; largest_normal_force [N] of its records; averages."""

    since: float
    until: float
    peaks: int
    largest_normal_force: float
    averages: Averages


@dataclass(frozen=True, repr=False)
class Spread(Shown):
    """Averages over a run and its perturbed copies: runs, perturbation (relative), seed; mean and standard deviation
    (of one run about the mean) of each by contact and name; largest: the lowest and the highest largest normal
    force [N] of all."""

    runs: int
    perturbation: float
    seed: int
    mean: dict[str, dict[str, float]]
    deviation: dict[str, dict[str, float]]
    largest: dict[str, tuple[float, float]]

    @property
    def _line(self) -> str:
        contacts = ", ".join(self.mean) or "no contact"
        return f"{self.runs} runs whose starts differ by {self.perturbation:g}, of {contacts}"

    def _repr_html_(self) -> str:
        rows = [
            (contact, name, readable(value, 4), readable(self.deviation[contact][name], 2))
            for contact, means in self.mean.items()
            for name, value in means.items()
        ]
        return html_table(f"Spread: {self._line}", ("contact", "what", "mean", "standard deviation"), rows)

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        contacts = {
            name: {
                "mean": self.mean[name],
                "standard_deviation": self.deviation[name],
                "largest_normal_force": list(self.largest[name]),
            }
            for name in self.mean
        }
        return {"runs": self.runs, "perturbation": self.perturbation, "seed": self.seed, "contacts": contacts}


def settled_contacts(run: Trajectory) -> dict[str, SettledContact]:
    """The contacts that separate in the last phase, with averages from there on; others are not chaotic and left out.

    From the records: of a peak between two of them only the slope is seen.
    """
    found: dict[str, SettledContact] = {}
    if not run.phases or not len(run.time):
        return found
    phase, part = run.phases[-1], run.phase_slice()
    for k, name in enumerate(run.contact_names):
        since = phase.contacts[name].first_separation
        if since is None:
            continue
        inside = run.time[part] >= since
        if not inside.any():
            continue
        force, status = run.normal_force[part][inside, k], run.status[part][inside, k]
        peaks = _peaks(force)
        low, middle, high = (float(v) for v in np.quantile(force, QUANTILES))
        averages = Averages(
            float(peaks.mean()) if len(peaks) >= FEWEST_PEAKS else None,
            low,
            middle,
            high,
            *(float(np.mean(status == code)) for code in (1, 2, 0)),
        )
        found[name] = SettledContact(float(since), float(phase.end), len(peaks), float(force.max()), averages)
    return found


def _peaks(force: Array) -> Array:
    """The largest value of each stretch above the mean that begins and ends within the record."""
    above = force > force.mean()
    turns = 1 + np.flatnonzero(above[1:] != above[:-1])
    turns = turns[1 if above[0] else 0 :]
    return np.array([force[a:b].max() for a, b in zip(turns[::2], turns[1::2], strict=False)])


def spread(runs: Sequence[Trajectory], perturbation: float, seed: int) -> Spread:
    """Averages of each run, and how far they differ. Contacts that do not separate in all runs are left out."""
    all_of = [settled_contacts(run) for run in runs]
    names = [name for name in all_of[0] if all(name in one for one in all_of)]
    mean: dict[str, dict[str, float]] = {}
    deviation: dict[str, dict[str, float]] = {}
    for name in names:
        averages = [one[name].averages for one in all_of]
        values = {key: [getattr(one, key) for one in averages] for key in NAMES}
        values = {key: column for key, column in values.items() if None not in column}
        mean[name] = {key: float(np.mean(column)) for key, column in values.items()}
        deviation[name] = {
            key: float(np.std(column, ddof=1)) if len(column) > 1 else 0.0 for key, column in values.items()
        }
    forces = {name: [one[name].largest_normal_force for one in all_of] for name in names}
    largest = {name: (min(values), max(values)) for name, values in forces.items()}
    return Spread(len(runs), perturbation, seed, mean, deviation, largest)

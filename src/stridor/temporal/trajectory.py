"""What a temporal run leaves: decimated histories, statistics of every step, energies, the last state."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..asking import instance
from ..digits import readable
from ..notebook import Shown, html_table
from ..typing import Array, IntArray
from .node_history import NodeHistory
from .tables import STATUS, run_dataset, run_frame

__all__ = ["HISTORIES", "RUN", "STATUS", "ContactStatistics", "PhaseResult", "Trajectory"]

# Fields of a Trajectory with a row for each record, beside its works.
HISTORIES = (
    "time",
    "normal_force",
    "tangential_force",
    "slip_speed",
    "gap",
    "status",
    "displacement",
    "velocity",
    "acceleration",
    "kinetic",
    "elastic",
)


@dataclass(frozen=True)
class ContactStatistics:
    """Of one contact over one phase, from every step: fractions of its duration, extrema, first events.

    max_normal_force, max_tangential_force [N]; max_slip_speed [m/s] over a step; first_stick,
    first_separation [s], None where it did not happen. kept_closed: separation is 0 because the case asks for it
    (`closed = true`), and max_normal_force, the largest |N|, may be one that pulls.
    """

    stick_fraction: float
    slip_fraction: float
    separation_fraction: float
    max_normal_force: float
    max_tangential_force: float
    max_slip_speed: float
    first_stick: float | None
    first_separation: float | None
    kept_closed: bool = False


@dataclass(frozen=True)
class PhaseResult:
    """One phase as it was run: name, start and end [s], statistics by contact."""

    name: str
    start: float
    end: float
    contacts: Mapping[str, ContactStatistics]


@dataclass(frozen=True, repr=False)
class Trajectory(Shown):
    """A temporal run. r records, m contacts, w watched points.

    time (r,) [s]; normal_force, tangential_force (r, m) [N], slip_speed (r, m) [m/s], gap (r, m) [m],
    status (r, m) 0 separation, 1 stick, 2 slip; displacement, velocity, acceleration (r, w, 2), absolute,
    x and y. Of implicit steps forces are means over the steps before and after a record, gaps and slip those at it, the
    status that of the step after. kinetic, elastic (r,) [J] half a step before each record (implicit: at it); works by
    name (r,) [J] up to there: damping, friction and contact count what is taken out, external and support what is put
    in.
    sampling [s] between records; step Δt [s]; path modal, nodal or assembled; nodes histories of single contact nodes
    where the path keeps them; state everything a restart needs. path_reason: why it was that path, and what came of it;
    remarks, which end it: sentences on the step and on the records.
    """

    time: Array
    contact_names: tuple[str, ...]
    normal_force: Array
    tangential_force: Array
    slip_speed: Array
    gap: Array
    status: IntArray
    watch_names: tuple[str, ...]
    displacement: Array
    velocity: Array
    acceleration: Array
    kinetic: Array
    elastic: Array
    works: Mapping[str, Array]
    phases: tuple[PhaseResult, ...]
    step: float
    beta2: float
    record_every: int
    steps: int
    planned_steps: int
    path: str
    path_reason: str
    step_limit: float
    limiting_body: str
    most_sweeps: int
    unconverged_steps: int
    interrupted: bool
    wall_seconds: float
    state: Mapping[str, Array] = field(default_factory=dict)
    provenance: dict[str, Any] = field(default_factory=dict)
    nodes: NodeHistory | None = None
    remarks: tuple[str, ...] = ()

    @property
    def notes(self) -> tuple[str, ...]:
        """What is to be known beside the numbers."""
        return tuple(str(note) for note in self.provenance.get("notes", ()))

    def to_xarray(self) -> Any:
        """xarray.Dataset of all that was recorded, as `st.save` writes it."""
        return run_dataset(self)

    def to_dataframe(self) -> Any:
        """pandas.DataFrame over time [s]: "A.normal_force_n", "beam1.tip.velocity_x_m_s", energies and works [J].
        Raises AnalysisError where pandas, which comes with xarray, is missing."""
        return run_frame(self)

    @property
    def _line(self) -> str:
        end = float(self.time[-1]) if len(self.time) else 0.0
        cut = f", interrupted after {self.steps} of {self.planned_steps} steps" if self.interrupted else ""
        phases = ", ".join(phase.name for phase in self.phases)
        return f"{phases} up to t = {end:g} s, {len(self.time)} records every {self.sampling:g} s{cut}"

    def _repr_html_(self) -> str:
        heads = ("phase", "contact", "stick", "slip", "separation", "largest N [N]", "largest slip speed [m/s]")
        rows = [
            (
                p.name, name, f"{c.stick_fraction:.1%}", f"{c.slip_fraction:.1%}", f"{c.separation_fraction:.1%}",
                readable(c.max_normal_force, 4), readable(c.max_slip_speed, 4),
            )
            for p in self.phases
            for name, c in p.contacts.items()
        ]  # fmt: skip
        cut = f"interrupted: {self.steps} of {self.planned_steps} steps" if self.interrupted else ""
        lines = (cut, f"{len(self.time)} records every {self.sampling:g} s, path {self.path}", *self.notes)
        return html_table(f"Run of {self.steps} steps of {self.step:g} s", heads, rows, lines)

    @property
    def sampling(self) -> float:
        """Time between records [s]."""
        return self.step * self.record_every

    def phase_slice(self, number: int = -1) -> slice:
        """Records of one phase, the last by default."""
        phase = self.phases[number]
        first, last = np.searchsorted(self.time, [phase.start - 1e-12, phase.end - 1e-12])
        return slice(int(first), max(int(last), int(first) + 1))


RUN = instance(Trajectory, "a run, of st.simulate or st.open(path)")  # what calls take

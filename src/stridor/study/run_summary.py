"""A run in numbers: its last phase, its energies, its cost."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from html import escape
from typing import Any

import numpy as np

from ..agreement import dominant_response, linear_part, stronger_below
from ..asking import takes
from ..digits import hertz, measured
from ..notebook import Shown
from ..sliding import full_motion, slip_speeds
from ..temporal.attractor import settled_contacts
from ..temporal.changes import changes_of
from ..temporal.ended import ended
from ..temporal.energy import EnergyBalance, energy_balance
from ..temporal.growth import Growth
from ..temporal.signals import components
from ..temporal.trajectory import RUN, Trajectory
from .settings import phases_of
from .workspace import Problem, Workspace

EXPONENTIAL = 0.5  # rms of ln amplitude about the fitted line, above which nothing is called exponential
LEAST_RECORDS = 128  # from which on components are sought in a run


@dataclass(frozen=True, repr=False)
class RunSummary(Shown):
    """What `stridor simulate` prints: the last phase in numbers, the energies, the cost.

    stronger_below_hz: frequency [Hz] below which something is stronger than the dominant line that the second half of
    the last phase is too short to resolve; None where nothing is.
    """

    dominant_frequency_hz: float | None
    growth: Growth | None
    energy: EnergyBalance
    trajectory: Trajectory
    linear: complex | None = None
    stronger_below_hz: float | None = None

    @property
    def _line(self) -> str:
        loudest = "no dominant frequency" if self.dominant_frequency_hz is None else hertz(self.dominant_frequency_hz)
        grows = "" if self.growth_rate is None else f", growth {self.growth_rate:+.4g} 1/s"
        return f"{loudest}{grows}, energies within {self.energy.error:.0e}"

    def _repr_html_(self) -> str:
        table = self.trajectory._repr_html_()  # pyright: ignore[reportPrivateUsage]
        return f"<div><strong>{escape(repr(self)[1:-1])}</strong>{table}</div>"

    @property
    def growth_rate(self) -> float | None:
        """Growth [1/s]: of the fastest component of a small perturbation, where the run starts from steady
        sliding; else of the dominant line where it grows exponentially, None where it does not."""
        if self.linear is not None:
            return self.linear.real
        if self.growth is None or not self.growth.exponential or self.growth.spread > EXPONENTIAL:
            return None
        return self.growth.rate

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        run = self.trajectory
        last = run.phases[-1] if run.phases else None
        return {
            "dominant_frequency_hz": self.dominant_frequency_hz,
            "stronger_below_hz": self.stronger_below_hz,
            "growth_rate": self.growth_rate,
            "growth_fit": None
            if self.growth is None
            else {"start": self.growth.start, "end": self.growth.end, "spread": self.growth.spread},
            "saturated": None if self.growth is None else self.growth.saturated,
            "contacts": {} if last is None else {name: vars(c).copy() for name, c in last.contacts.items()},
            "first_regime": first_regime(run),
            "settled": {name: asdict(part) for name, part in settled_contacts(run).items()},
            "phases": [
                {
                    "name": p.name,
                    "start": p.start,
                    "end": p.end,
                    "contacts": {name: vars(c).copy() for name, c in p.contacts.items()},
                }
                for p in run.phases
            ],
            "energy": self.energy.to_json() | {"words": self.energy.words(run.beta2)},
            "steps": run.steps,
            "planned_steps": run.planned_steps,
            "interrupted": run.interrupted,
            "dt": run.step,
            "step_limit": run.step_limit,
            "limiting_body": run.limiting_body,
            "path": run.path,
            "path_reason": run.path_reason,
            "remarks": list(run.remarks),
            "most_sweeps": run.most_sweeps,
            "unconverged_steps": run.unconverged_steps,
            "wall_seconds": run.wall_seconds,
            "changed": changes_of(run),
            "restarts": run.provenance.get("restarts", []),
        }


def slower_is_stronger(below_hz: float, seen: str = "the second half of the phase") -> str:
    """What is to be said of the strongest line of what is seen of a run, where below a frequency [Hz] something is
    stronger (`stronger_below_hz`)."""
    return (
        f"what swings or drifts below {measured(below_hz, 1)} Hz is stronger, and {seen} is too short to tell its "
        "frequency: give the phase a longer duration to see it"
    )


def first_regime(run: Trajectory) -> dict[str, dict[str, float | None]]:
    """The stretch of the last phase before a contact first separates, by contact: end [s], largest normal
    force [N] and slip speed [m/s], share of its last quarter spent in stick (all of the records)."""
    found: dict[str, dict[str, float | None]] = {}
    if not run.phases or not len(run.time):
        return found
    part = run.phase_slice()
    phase = run.phases[-1]
    for k, name in enumerate(run.contact_names):
        opened = phase.contacts[name].first_separation
        end = phase.end if opened is None else opened
        inside = np.flatnonzero(run.time[part] < end)
        if not len(inside):
            found[name] = {
                "end": end,
                "max_normal_force": None,
                "max_slip_speed": None,
                "stick_fraction": None,
            }
            continue
        force = run.normal_force[part][inside, k]
        status = run.status[part][inside, k]
        tail = status[-max(1, len(status) // 4) :]
        found[name] = {
            "end": float(end),
            "max_normal_force": float(np.abs(force).max()),
            "max_slip_speed": float(np.abs(run.slip_speed[part][inside, k]).max()),
            "stick_fraction": float(np.mean(tail == 1)),
        }
    return found


@takes(run=RUN)
def summarise(problem: Problem, run: Trajectory) -> RunSummary:
    """Dominant frequency, growth, energy balance of a run of a case, a system or a workspace."""
    work = Workspace.of(problem)
    limit = work.modal.max_frequency_hz
    dominant, fitted = dominant_response(run, limit)
    linear: complex | None = None
    perturbed = work.temporal.initial == "steady-sliding" and work.temporal.perturbation > 0
    if perturbed and len(run.time) >= LEAST_RECORDS and run.contact_names and _of_points(work, run):
        # In the first phase, from whose steady sliding the run starts; what follows is no small motion about that.
        system = work.system()
        first = ended(system, phases_of(work), 0).motions
        steady = slip_speeds(system, full_motion(system) if system.load_steps else system.motion.full * first)
        found = linear_part(run.slip_speed - steady, steady, skip=16)
        linear = components(found, run.sampling, max_frequency_hz=limit).fastest or None
    below = None if dominant is None else stronger_below(run, limit)
    return RunSummary(dominant, fitted, energy_balance(run), run, linear, below)


def _of_points(work: Workspace, run: Trajectory) -> bool:
    """Whether every contact is of points, whose slip is that of the motion: over a surface it is a mean."""
    return run.nodes is None or len(work.system().contacts) == len(run.contact_names)

"""One member of an ensemble in numbers: how strongly its observable vibrates in the window, where, and what of it."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..agreement.comparison import spectrum_of_end
from ..errors import CaseError
from ..system import System
from ..temporal.settings import Settings
from ..temporal.signals import low_passed
from ..temporal.trajectory import ContactStatistics, PhaseResult, Trajectory
from ..typing import Array

OF_POINT = {"displacement": "m", "velocity": "m/s", "acceleration": "m/s2"}
OF_CONTACT = {"slip_speed": "m/s", "normal_force": "N", "tangential_force": "N", "gap": "m"}
STEADY = 1.1  # by how much the amplitudes of both halves of the window may differ where it is steady
LEAST_RECORDS = 64  # of a window
ROUNDING = 1e-12  # of the largest value: what no longer vibrates
UNTOUCHED = 1e-6  # of the slip speed: below that a motion that nothing has disturbed is rounding


@dataclass(frozen=True)
class Observable:
    """What of a run is looked at: quantity of a point (in one direction, or in both) or of a contact."""

    name: str
    owner: str
    quantity: str
    direction: str
    unit: str

    @property
    def of_point(self) -> bool:
        """Whether it is a point's."""
        return self.quantity in OF_POINT

    def signals(self, run: Trajectory) -> Array:
        """Its histories (r, d), one for each direction."""
        values: Array = getattr(run, self.quantity)
        if not self.of_point:
            return values[:, [run.contact_names.index(self.owner)]]
        of_point = values[:, run.watch_names.index(self.owner)]
        return of_point if not self.direction else of_point[:, ["xyz".index(self.direction)]]


def observable_of(name: str | None, system: System, settings: Settings) -> Observable:
    """The observable of a name: POINT.velocity, POINT.velocity_x, CONTACT.normal_force and so on; of None the velocity
    of the first watched point, else the slip speed of the first contact. Raises CaseError for another."""
    contacts = list(system.contact_nodes().names) if not system.contacts else [c.name for c in system.contacts]
    contacts = [*contacts, *(s.name for s in system.surfaces)]
    if name is None:
        if settings.watch:
            name = f"{settings.watch[0]}.velocity"
        elif contacts:
            name = f"{contacts[-1]}.slip_speed"
        else:
            raise CaseError("observable", None, "a point or a contact to look at: give temporal.watch")
    return named_observable(name, list(system.points), contacts, "xyz"[: system.dimension])


def named_observable(name: str, points: Sequence[str], contacts: Sequence[str], directions: str) -> Observable:
    """The observable of a name among these points and contacts. Raises CaseError for another."""
    owner, _, what = str(name).rpartition(".")
    quantity, _, direction = what.partition("_") if what.split("_")[0] in OF_POINT else (what, "", "")
    if quantity in OF_POINT and owner in points and direction in ("", *directions):
        return Observable(name, owner, quantity, direction, OF_POINT[quantity])
    if quantity in OF_CONTACT and owner in contacts:
        return Observable(name, owner, quantity, "", OF_CONTACT[quantity])
    one_each = dict.fromkeys(contacts)  # those over surfaces stand in both lists
    accepted = (
        f"POINT.QUANTITY with a point among {', '.join(points) or 'none'} and {', '.join(OF_POINT)} (_x, _y for "
        f"one direction), or CONTACT.QUANTITY with a contact among {', '.join(one_each) or 'none'} and "
        f"{', '.join(OF_CONTACT)}"
    )
    raise CaseError("observable", name, accepted)


@dataclass(frozen=True)
class MemberNumbers:
    """Of one member, see `Ensemble`; contacts by name."""

    rms: float
    peak: float
    frequency_hz: float
    stronger_below_hz: float
    growth_rate: float
    regime: str
    contacts: Mapping[str, ContactStatistics]


def numbers_of(
    run: Trajectory, observable: Observable, max_frequency_hz: float, *, disturbed: bool = True
) -> MemberNumbers:
    """The window of a run, its last phase, in numbers; the frequency by way of the phase before it, whose end the
    filter takes up, and what is stronger than its line by the same spectrum. disturbed: whether anything brought it out
    of steady sliding; of rounding neither rate nor frequency is told."""
    window = run.phase_slice()
    signals = observable.signals(run)
    seen = signals[window]
    about = seen - seen.mean(axis=0)
    rms = float(np.sqrt((about**2).mean(axis=0).sum()))
    peak = float(np.sqrt((about**2).sum(axis=1).max()))
    half = len(seen) // 2
    before, after = (float(np.sqrt(part.var(axis=0).sum())) for part in (seen[:half], seen[-half:]))
    duration = half * run.sampling
    rate = math.log(after / before) / duration if before > 0.0 and after > 0.0 else math.nan
    contacts = run.phases[-1].contacts
    still = max(before, after) <= ROUNDING * float(np.abs(seen).max())
    if not disturbed and _rests(run, window):
        return MemberNumbers(rms, peak, math.nan, math.nan, math.nan, "still", contacts)
    regime = "still" if still else _regime(before, after, contacts.values())
    loudest = int(np.argmax(np.ptp(seen, axis=0)))
    start = run.phase_slice(-2).start if len(run.phases) > 1 else window.start
    share = len(seen) / (window.stop - start)
    filtered = low_passed(signals[start : window.stop, loudest], run.sampling, max_frequency_hz)
    spec = spectrum_of_end(filtered, run.sampling, share)
    (frequency, amplitude), below = spec.line(), spec.stronger_below()
    return MemberNumbers(
        rms, peak, frequency if amplitude > 0.0 else math.nan, math.nan if below is None else below, rate, regime,
        contacts,
    )  # fmt: skip


def _rests(run: Trajectory, window: slice) -> bool:
    """Whether no contact changes its state in a window (of records), nor its slip speed by more than rounding."""
    slip = run.slip_speed[window]
    changes = float(np.ptp(slip, axis=0).max(initial=0.0))
    return all(map(_one_state, run.phases[-1].contacts.values())) and changes <= UNTOUCHED * float(
        np.abs(slip).max(initial=0.0)
    )


def _one_state(contact: ContactStatistics) -> bool:
    return max(contact.stick_fraction, contact.slip_fraction, contact.separation_fraction) == 1.0


def _regime(before: float, after: float, contacts: Collection[ContactStatistics]) -> str:
    """What the amplitudes of both halves of a window, and what its contacts did, say of it (see `Ensemble`)."""
    steady = max(before, after) <= STEADY * min(before, after)
    if not all(_one_state(c) for c in contacts):
        return "steady" if steady else "transient"
    if contacts and not any(c.slip_fraction > 0.0 for c in contacts):
        return "sticks"
    return "linear" if steady else "grows" if after > before else "decays"


def last_phase(run: Trajectory) -> Trajectory:
    """A run from the start of its last phase, the window included, on."""
    start = run.phase_slice(-2 if len(run.phases) > 1 else -1).start
    cut = {
        name: getattr(run, name)[start:]
        for name in (
            "time", "normal_force", "tangential_force", "slip_speed", "gap", "status", "displacement", "velocity",
            "acceleration", "kinetic", "elastic",
        )
    }  # fmt: skip
    works = {name: values[start:] for name, values in run.works.items()}
    phases: tuple[PhaseResult, ...] = run.phases[-2:]
    return replace(run, **cut, works=works, phases=phases, state={}, nodes=None)

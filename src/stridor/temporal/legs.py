"""Members of an ensemble: what differs between them, and the phases that they go through."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ..errors import CaseError
from ..system import System
from ..typing import Array
from .schedule import PhaseSpec, Schedule, Stretch, lay_out
from .settings import Settings

WINDOW = "window"  # the name of the part of the last phase that is looked at
RISE = 0.1  # of a further leg: how long loads and speeds take to their next value


@dataclass(frozen=True)
class Member:
    """One run: mu of every contact at its full speed (None: the laws' own), factors on all loads and on all prescribed
    velocities; perturbation [m/s] of the slip speed at the start (None: the settings')."""

    mu: float | None = None
    load: float = 1.0
    speed: float = 1.0
    perturbation: float | None = None

    def settings(self, settings: Settings) -> Settings:
        """The settings with its own perturbation."""
        return settings if self.perturbation is None else replace(settings, perturbation=self.perturbation)

    def system(self, system: System) -> System:
        """The system with its friction."""
        return system.at_friction(self.mu)

    def phases(self, phases: Sequence[PhaseSpec], system: System) -> list[PhaseSpec]:
        """The phases with its factors."""
        made: list[PhaseSpec] = []
        for number, phase in enumerate(phases):
            # What the first phase does not name is one.
            loads = {**dict.fromkeys(system.loads, 1.0), **phase.loads} if number == 0 else phase.loads
            named = dict.fromkeys(_velocities(system), 1.0) if number == 0 else {}
            velocities = {**named, **phase.velocities}
            made.append(
                replace(
                    phase,
                    loads={name: self.load * value for name, value in loads.items()},
                    velocities={name: self.speed * value for name, value in velocities.items()},
                )
            )
        return made


class Acting(NamedTuple):
    """Loads and increments of the supports over c steps: sums of t tables (c, t, q), each times factors (k, t, q) of
    the members, as whole tables of many members would be large."""

    loads: Array
    load_factors: Array
    increments: Array
    increment_factors: Array

    def spread(self) -> tuple[Array, Array]:
        """Loads (c, k, l) and increments (c, k, p) of every member."""
        return _sum(self.loads, self.load_factors), _sum(self.increments, self.increment_factors)


def _sum(tables: Array, factors: Array) -> Array:
    out = tables[:, None, 0] * factors[:, 0]
    for t in range(1, tables.shape[1]):
        out = out + tables[:, None, t] * factors[:, t]
    return out


@dataclass(frozen=True)
class Legs:
    """The phases of one run or, where members follow one another, of one after the other: those of the case, then for
    each further member its last phase again, with a ramp to the new loads and speeds. The end of each leg is a phase of
    its own, the window. Factors are those of the case; members scale them."""

    phases: tuple[tuple[PhaseSpec, ...], ...]
    schedules: tuple[Schedule, ...]
    rises: tuple[Schedule | None, ...]

    @property
    def steps(self) -> int:
        """Steps of all legs."""
        return self.schedules[-1].steps

    def first(self, leg: int) -> int:
        """First step of a leg."""
        return self.schedules[leg].stretches[0].first

    def forcing(self, first: int, count: int, members: Sequence[Sequence[Member]], distance: Array) -> Acting:
        """What acts on k tracks of members over ``count`` steps from a step on; distance (p,): 1 for motions that are
        distances, which nobody scales."""
        load_tables: list[list[Array]] = []
        motion_tables: list[list[Array]] = []
        load_factors: list[Array] = []
        motion_factors: list[Array] = []
        while count > 0:
            leg = next((k for k, s in enumerate(self.schedules) if first < s.steps), len(self.schedules) - 1)
            last = leg == len(self.schedules) - 1
            size = count if last else min(count, self.schedules[leg].steps - first)
            present = [track[leg] for track in members]
            before = [track[leg - 1] for track in members] if self.rises[leg] is not None else present
            tables = self._tables(leg)
            load_tables.append([s.load_factors(first, size) for s in tables])
            motion_tables.append([s.motion_increments(first, size) for s in tables])
            load = np.array([[m.load for m in before], [m.load for m in present]])
            speed = np.array([[m.speed for m in before], [m.speed for m in present]])
            load_factors += _factors(load, np.zeros(load_tables[-1][0].shape[1]))[: len(tables)]
            motion_factors += _factors(speed, distance)[: len(tables)]
            first, count = first + size, count - size
        return Acting(
            _side_by_side(load_tables), np.stack(load_factors, axis=1),
            _side_by_side(motion_tables), np.stack(motion_factors, axis=1),
        )  # fmt: skip

    def _tables(self, leg: int) -> list[Schedule]:
        rise = self.rises[leg]
        return [self.schedules[leg]] if rise is None else [self.schedules[leg], rise]


def _factors(factors: Array, unscaled: Array) -> list[Array]:
    """Of the values before, and of what they rise by from there, each (k, q)."""
    before = np.where(unscaled > 0, 1.0, factors[0][:, None])
    return [before, np.broadcast_to((factors[1] - factors[0])[:, None], before.shape)]


def _side_by_side(pieces: Sequence[Sequence[Array]]) -> Array:
    """Tables (c, q) of pieces that follow one another as (Σc, t, q): each is zero outside of its own piece."""
    out = np.zeros((sum(len(p[0]) for p in pieces), sum(map(len, pieces)), pieces[0][0].shape[1]))
    row = column = 0
    for piece in pieces:
        for table in piece:
            out[row : row + len(table), column] = table
            column += 1
        row += len(piece[0])
    return out


def require_window(window: float) -> None:
    """Refuse a share of the last phase that is none. Raises CaseError."""
    if not 0.0 < window <= 1.0:
        raise CaseError("window", window, "the share of the last phase that is looked at, above 0 and at most 1")


def legs_of(
    phases: Sequence[PhaseSpec], system: System, step: float, count: int, window: float, *, steady: bool
) -> Legs:
    """The legs of ``count`` members one after the other; window: share of the last phase, in (0, 1]. Raises CaseError
    for another one, and one that begins before the ramp of that phase ends."""
    last, names = phases[-1], list(system.motion.names)
    kept = last.duration * (1.0 - window)
    if last.ramp > kept or (count > 1 and last.duration * RISE > kept):
        least = max(last.ramp / last.duration, RISE if count > 1 else 0.0)
        raise CaseError("window", window, f"at most {1.0 - least:g}: before it loads and speeds still change by a ramp")
    legs = [in_two(phases, window)]
    for k in range(1, count):
        name = f"{last.name} {k + 1}"
        legs.append(_split(PhaseSpec(name, last.duration, {}, {}), window))
    whole = lay_out([p for leg in legs for p in leg], step, list(system.loads), names, system.motion.full_distance)
    whole.require_whole([p for leg in legs for p in leg], even=False)
    if steady:
        whole = whole.from_steady()
    schedules: list[Schedule] = []
    rises: list[Schedule | None] = []
    at = 0
    for k, leg in enumerate(legs):
        stretches = whole.stretches[at : at + len(leg)]
        schedules.append(Schedule(step, stretches))
        rises.append(_rise(step, stretches, RISE * last.duration) if k else None)
        at += len(leg)
    return Legs(tuple(legs), tuple(schedules), tuple(rises))


def in_two(phases: Sequence[PhaseSpec], window: float) -> tuple[PhaseSpec, ...]:
    """Phases with the last one in two, the second of which is the window. Raises CaseError for a share that is none."""
    require_window(window)
    return (*phases[:-1], *_split(phases[-1], window))


def _split(phase: PhaseSpec, window: float) -> tuple[PhaseSpec, ...]:
    """A phase in two, the second of which is the window."""
    if window == 1.0:
        return (replace(phase, name=WINDOW),)
    first = replace(phase, duration=phase.duration * (1.0 - window))
    return first, PhaseSpec(WINDOW, phase.duration * window, {}, {})


def _rise(step: float, stretches: Sequence[Stretch], ramp: float) -> Schedule:
    """From nothing to what the stretches have, by a ramp [s] that begins with them."""
    first, zero = stretches[0], np.zeros(len(stretches[0].distances_after))
    rising = replace(
        first,
        last=stretches[-1].last,
        ramp_steps=ramp / step,
        loads_before=np.zeros(len(first.loads_after)),
        velocities_before=np.zeros(len(first.velocities_after)),
        distances_before=zero,
        distances_after=zero,
    )
    return Schedule(step, (rising,))


def _velocities(system: System) -> list[str]:
    """Motions that are velocities: distances, of supports and interferences, are none that a phase scales as such."""
    distances = system.motion.full_distance
    return [name for name, distance in zip(system.motion.names, distances, strict=True) if not distance]


def leg_phases(legs: Legs, leg: int, member: Member, system: System) -> list[PhaseSpec]:
    """The phases of a leg as a single run takes them, with the factors of a member."""
    if leg == 0:
        return member.phases(legs.phases[0], system)
    full = legs.schedules[leg].stretches[0]
    first, *rest = legs.phases[leg]
    whole = sum(p.duration for p in legs.phases[leg])
    loads = {name: member.load * float(f) for name, f in zip(system.loads, full.loads_after, strict=True)}
    speeds = dict(zip(system.motion.names, full.velocities_after, strict=True))
    velocities = {name: member.speed * float(speeds[name]) for name in _velocities(system)}
    return [replace(first, loads=loads, velocities=velocities, ramp=RISE * whole), *rest]

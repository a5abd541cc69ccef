"""The modal map beside an ensemble, and which of the modes that may grow is the one that a member shows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..agreement.comparison import NEAR
from ..errors import StridorError
from ..modal.results import ComplexModes
from ..system import System
from ..temporal.ended import ended
from ..typing import Array, BoolArray, IntArray
from .analyses import modes
from .ensemble_result import NOT_KNOWN, ModalMap
from .settings import phases_of
from .workspace import Workspace


@dataclass(frozen=True)
class UnstableModes:
    """Unstable modes at one μ and speed: numbers, frequencies [Hz] and growth rates [1/s], all (b,)."""

    mode: IntArray
    frequency_hz: Array
    growth_rate: Array

    def nearest(self, frequency_hz: float) -> tuple[int, float, float]:
        """Number of the mode within 5 % of a frequency, 0 for none; the nearest one's frequency [Hz] and f/f_mode − 1,
        NaN where nothing grows."""
        if not len(self.mode) or not np.isfinite(frequency_hz):
            return 0, np.nan, np.nan
        deviation = frequency_hz / self.frequency_hz - 1.0
        k = int(np.argmin(np.abs(deviation)))
        number = int(self.mode[k]) if abs(deviation[k]) < NEAR else 0
        return number, float(self.frequency_hz[k]), float(deviation[k])


@dataclass(frozen=True)
class UnstableMap:
    """Unstable modes by load: a map over μ and speed, those at each of its points in the same order, and what is to be
    said. shown: the load of the map that the result has."""

    shown: float
    of_load: Mapping[float, tuple[ModalMap, tuple[tuple[UnstableModes, ...], ...]]]
    notes: tuple[str, ...]
    loads_matter: bool = False

    @property
    def map(self) -> ModalMap | None:
        """The map that the result has, None where it is not known."""
        found = self.of_load.get(self.shown)
        return None if found is None else found[0]

    def at(self, mu: float, speed: float, load: float) -> UnstableModes | None:
        """Those of a member; None where it is not known."""
        found = self.of_load.get(load if self.loads_matter else self.shown)
        if found is None:
            return None
        at, growing = found
        i = int(np.argmin(np.abs(at.mu - mu)))
        j = int(np.argmin(np.abs(at.speed - speed)))
        return growing[i][j] if at.unstable[i, j] >= 0 else None


def unstable_modes(
    work: Workspace, mus: Sequence[float], speeds: Sequence[float], loads: Sequence[float]
) -> UnstableMap:
    """What grows at each μ, at each speed and at each load where modes depend on them, in the phase that runs end with,
    of which no ramp is looked at. Where that cannot be told, why not."""
    state = ended(work.system(), phases_of(work))
    try:
        system = state.of(work.system())
    except StridorError as error:
        return UnstableMap(1.0, {}, (f"no modal map: {error}",))
    constant = all(c.law.constant for c in system.contacts) and all(s.law.constant for s in system.surfaces)
    values, own = np.unique(mus), np.unique(speeds) if _speeds_matter(work, system, constant) else np.unique([1.0])
    matter = not constant or _loads_matter(system, prestress=work.options.prestress)
    factors = [float(f) for f in np.unique(loads)] if matter else [1.0]
    shown = 1.0 if 1.0 in factors else factors[0]
    found: dict[float, tuple[ModalMap, tuple[tuple[UnstableModes, ...], ...]]] = {}
    notes: list[str] = [state.note] if state.note else []
    for factor in factors:
        at = "" if factors == [1.0] else f" at {factor:g} times the loads"
        try:
            found[factor], said = _of_load(work, values, own, factor)
        except StridorError as error:
            notes.append(f"no modal map{at}: {error}")
        else:
            notes += [f"modal map{at}: {note}" for note in dict.fromkeys(said)]
    if factors != [1.0]:
        notes.append(
            f"modes depend on the loads: the modal map is that of {shown:g} times the loads, and mode and mode_hz of "
            "each member are of the modes at its own"
        )
    return UnstableMap(shown, found, tuple(notes), matter)


def _speeds_matter(work: Workspace, system: System, constant: bool) -> bool:
    """Whether modes at one μ may depend on a factor of all velocities: by the law, by damping that friction makes
    across the slip, and, where that decides which nodes touch, by what motions drag with."""
    motion, several = system.motion, system.contact_nodes().count > 1
    drags = bool(np.any(motion.damping @ motion.full)) and (several or bool(system.contact_cubic))
    return not constant or work.options.friction_damping or drags


def _loads_matter(system: System, *, prestress: bool) -> bool:
    """Whether modes at one μ and speed may depend on a factor of all loads, under constant friction: where contact or
    springs are not linear, or where something else than loads decides which nodes touch."""
    motion = system.motion
    return bool(
        system.cubic is not None or system.contact_cubic or (prestress and system.stress_stiffness is not None)
        or np.any(system.contact_nodes().gap) or np.any(motion.full_distance) or np.any(motion.damping @ motion.full)
    )  # fmt: skip


def _of_load(
    work: Workspace, values: Array, speeds: Array, load: float
) -> tuple[tuple[ModalMap, tuple[tuple[UnstableModes, ...], ...]], list[str]]:
    """The map at one factor of all loads, what grows at its points, and what is to be said."""
    columns: list[list[UnstableModes]] = []
    solved: list[BoolArray] = []
    notes: list[str] = []
    for speed in speeds:
        found = modes(work.ending(load, float(speed)), mu=values)
        columns.append([_growing(found, i) for i in range(len(values))])
        solved.append(found.solved)
        notes += [said for said, known in zip(found.completeness, found.solved, strict=False) if not known]
    growing = tuple(tuple(column[i] for column in columns) for i in range(len(values)))
    count = np.array([[len(g.mode) for g in row] for row in growing], dtype=np.int64)
    count[~np.column_stack(solved)] = NOT_KNOWN
    fastest = np.array([[_fastest(g) for g in row] for row in growing])
    return (ModalMap(values, speeds, count, fastest[..., 0], fastest[..., 1], load), growing), notes


def _growing(found: ComplexModes, i: int) -> UnstableModes:
    which = np.flatnonzero(found.unstable[i] & (found.frequency_hz[i] > 0.0))
    return UnstableModes(found.branch[which], found.frequency_hz[i][which], found.growth_rate[i][which])


def _fastest(growing: UnstableModes) -> tuple[float, float]:
    if not len(growing.mode):
        return np.nan, np.nan
    k = int(np.argmax(growing.growth_rate))
    return float(growing.frequency_hz[k]), float(growing.growth_rate[k])

"""The modal map beside an ensemble, and which of the modes that may grow is the one that a member shows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..agreement.comparison import NEAR
from ..errors import StridorError
from ..modal.results import ComplexModes
from ..sliding import slip_speeds
from ..system import System
from ..typing import Array, BoolArray, IntArray
from .analyses import modes
from .ensemble_result import NOT_KNOWN, ModalMap
from .workspace import Workspace

SAME = 1e-12  # relative: coefficients of contacts that are one


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
    """What grows at each μ, at each speed where friction depends on it, and at each load where anything does. Where
    that cannot be told, why not."""
    system = work.system()
    constant = all(c.law.constant for c in system.contacts) and all(s.law.constant for s in system.surfaces)
    values, own = np.unique(mus), np.unique([1.0]) if constant else np.unique(speeds)
    matter = not constant or _loads_matter(system, prestress=work.options.prestress)
    factors = [float(f) for f in np.unique(loads)] if matter else [1.0]
    shown = 1.0 if 1.0 in factors else factors[0]
    found: dict[float, tuple[ModalMap, tuple[tuple[UnstableModes, ...], ...]]] = {}
    notes: list[str] = []
    for factor in factors:
        at = "" if factors == [1.0] else f" at {factor:g} times the loads"
        try:
            found[factor], said = _of_load(work, system, values, own, factor)
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


def _loads_matter(system: System, *, prestress: bool) -> bool:
    """Whether modes at one μ and speed may depend on a factor of all loads, under constant friction: where contact or
    springs are not linear, or where something else than loads decides which nodes touch."""
    motion = system.motion
    return bool(
        system.cubic is not None or system.contact_cubic or (prestress and system.stress_stiffness is not None)
        or np.any(system.contact_nodes().gap) or np.any(motion.full_distance) or np.any(motion.damping @ motion.full)
    )  # fmt: skip


def _of_load(
    work: Workspace, system: System, values: Array, speeds: Array, load: float
) -> tuple[tuple[ModalMap, tuple[tuple[UnstableModes, ...], ...]], list[str]]:
    """The map at one factor of all loads, what grows at its points, and what is to be said."""
    columns: list[list[UnstableModes]] = []
    solved: list[BoolArray] = []
    notes: list[str] = []
    for speed in speeds:
        at_speed, friction = _at_speed(work, system, values, float(speed))
        found = modes(at_speed if load == 1.0 else at_speed.under(load), mu=friction)
        columns.append([_growing(found, i) for i in range(len(values))])
        solved.append(found.solved)
        notes += [said for said, known in zip(found.completeness, found.solved, strict=False) if not known]
    growing = tuple(tuple(column[i] for column in columns) for i in range(len(values)))
    count = np.array([[len(g.mode) for g in row] for row in growing], dtype=np.int64)
    count[~np.column_stack(solved)] = NOT_KNOWN
    fastest = np.array([[_fastest(g) for g in row] for row in growing])
    return (ModalMap(values, speeds, count, fastest[..., 0], fastest[..., 1], load), growing), notes


def _at_speed(work: Workspace, system: System, mus: Array, speed: float) -> tuple[Workspace, Array]:
    """The case with its supports at another speed, and the friction coefficients that its laws have there."""
    if speed == 1.0:
        return work, mus
    case = work.case("the modal map of friction that depends on speed")
    changes = {
        f"supports.{name}.velocity.{direction}": speed * value
        for name, support in case.supports.items()
        for direction, value in support.velocity.items()
    }
    full = np.abs(slip_speeds(system, system.motion.full))
    laws = [(c.law, float(v)) for c, v in zip(system.contacts, full, strict=True)]
    coefficients = np.array([[law.scaled(float(mu), v).sliding(speed * v) for law, v in laws] for mu in mus])
    if not laws or np.ptp(coefficients, axis=1).max() > SAME * np.abs(coefficients).max():
        raise StridorError("friction depends on speed, and contacts that slide at several speeds have no common one")
    return Workspace(case.with_(changes)), coefficients[:, 0]


def _growing(found: ComplexModes, i: int) -> UnstableModes:
    which = np.flatnonzero(found.unstable[i] & (found.frequency_hz[i] > 0.0))
    return UnstableModes(found.branch[which], found.frequency_hz[i][which], found.growth_rate[i][which])


def _fastest(growing: UnstableModes) -> tuple[float, float]:
    if not len(growing.mode):
        return np.nan, np.nan
    k = int(np.argmax(growing.growth_rate))
    return float(growing.frequency_hz[k]), float(growing.growth_rate[k])

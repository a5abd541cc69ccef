"""What drives a system between two changes of its phases, as polynomials of time."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ....typing import Array
from ...schedule import Schedule, Stretch

_BLEND = (0.0, 0.0, 0.0, 10.0, -15.0, 6.0)  # the C2 quintic of the ramps
_TRAVEL = (0.0, 0.0, 0.0, 0.0, 2.5, -3.0, 1.0)  # its integral


@dataclass(frozen=True)
class Piece:
    """From start to end [s]: factors of loads (l, d + 1) and displacements of the moving supports (p, d + 1), in their
    units at factor one, as coefficients of powers of σ = (t − start)/unit.

    No digit of a motion may depend on when its phase ends, which a restart may change: unit [s] is the whole of a ramp,
    also of one that is cut short, and a power of two where factors are constant, which rounds nothing.
    """

    start: float
    end: float
    loads: Array
    displacements: Array
    unit: float

    @property
    def terms(self) -> int:
        """How many powers there are."""
        return self.displacements.shape[1]

    def powers(self, time: float) -> Array:
        """1, σ, σ², … at a time."""
        return np.power((time - self.start) / self.unit, np.arange(self.terms))

    @property
    def derivative(self) -> Array:
        """The matrix (d + 1, d + 1) that turns the powers into their rates [1/s]."""
        steps = np.arange(1, self.terms) / self.unit
        return np.diag(steps, -1)

    def speeds(self, time: float) -> tuple[Array, Array]:
        """Speeds (p,) [m/s] of the supports at a time, and the sums of what their terms amount to."""
        rates, powers = self.displacements @ self.derivative, self.powers(time)
        return rates @ powers, np.abs(rates) @ np.abs(powers)


def pieces(schedule: Schedule) -> list[Piece]:
    """A phase is one piece, or two where it begins with a ramp."""
    found: list[Piece] = []
    p = len(schedule.stretches[0].velocities_after)
    here = np.array(schedule.stretches[0].distances_before, dtype=float) if p else np.zeros(0)
    for stretch in schedule.stretches:
        start, end = stretch.first * schedule.step, stretch.last * schedule.step
        turn = min(start + stretch.ramp_steps * schedule.step, end)
        if stretch.ramp_steps > 0:
            ramp = _ramp(stretch, start, turn, schedule.step, here)
            found.append(ramp)
            here = ramp.displacements @ ramp.powers(turn) if turn == end else ramp.displacements.sum(axis=1)
        elif np.any(stretch.distances_after != stretch.distances_before):
            here = here + stretch.distances_after - stretch.distances_before
        if turn < end:
            steady = constant(turn, end, stretch.loads_after, here, stretch.velocities_after)
            found.append(steady)
            here = here + stretch.velocities_after * (end - turn)
    return found


def constant(start: float, end: float, loads: Array, places: Array, speeds: Array) -> Piece:
    """Constant factors of loads (l,) and of speeds (p,) of supports that are at places (p,) at the start."""
    unit = 2.0 ** math.ceil(math.log2(end - start))
    moves = np.stack([places, speeds * unit], axis=1)
    return Piece(start, end, np.stack([loads, np.zeros_like(loads)], axis=1), moves, unit)


def _ramp(stretch: Stretch, start: float, turn: float, step: float, here: Array) -> Piece:
    """Where factors blend; the same where the phase ends before its ramp does."""
    whole = stretch.ramp_steps * step
    blend = np.append(_BLEND, 0.0)
    loads = np.outer(stretch.loads_after - stretch.loads_before, blend)
    loads[:, 0] += stretch.loads_before
    moves = np.outer((stretch.velocities_after - stretch.velocities_before) * whole, np.array(_TRAVEL))
    moves[:, 1] += stretch.velocities_before * whole
    moves += np.outer(stretch.distances_after - stretch.distances_before, blend)
    moves[:, 0] += here
    return Piece(start, turn, loads, moves, whole)

"""What looks on while a run on assembled matrices marches: motion of many nodes without a record of every instant."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from ..typing import Array, ComplexArray, Sparse
from .signals import hann

MOST_BYTES = 128e6
MOST_INSTANTS = 4096
PER_PERIOD = 12.0  # instants, of the fastest component


class Observer(Protocol):
    """Sees the state between steps: every ``every`` steps, counted from the first of the run."""

    @property
    def every(self) -> int:
        """Steps from one look to the next."""
        ...

    def see(self, time: float, velocity: Array) -> None:
        """time [s]; velocity (n,) [m/s, rad/s] of the freedoms, β2 of a step before it."""
        ...


@dataclass
class Snapshots:
    """Velocities of what rows (r, n) csr say at some instants: time (s,) [s], values (s, r) [m/s]."""

    rows: Sparse
    every: int
    seen: list[tuple[float, Array]] = field(default_factory=list[tuple[float, Array]])

    @classmethod
    def over(
        cls, steps: int, step: float, fastest_hz: float, rows_of: Callable[[int], Sparse], dimension: int
    ) -> Snapshots:
        """Room for a run of so many steps Δt [s] with lines up to fastest_hz, of as many nodes as fit into MOST_BYTES;
        rows_of(most) gives the rows of at most so many."""
        instants = int(min(MOST_INSTANTS, max(64.0, PER_PERIOD * fastest_hz * steps * step)))
        return cls(rows_of(max(1, int(MOST_BYTES / (8 * instants * dimension)))), max(1, steps // instants))

    def see(self, time: float, velocity: Array) -> None:
        """Keep this instant."""
        self.seen.append((time, self.rows @ velocity))

    def until(self, time: float) -> tuple[Array, Array]:
        """Times (s,) [s] and values (s, r) [m/s] up to an instant [s]."""
        kept = [pair for pair in self.seen if pair[0] <= time]
        values = np.array([v for _, v in kept]).reshape(len(kept), self.rows.shape[0])
        return np.array([t for t, _ in kept]), values


@dataclass
class LineShape:
    """Complex amplitude (n,) of the line at one frequency [Hz], by a Hann window over ``count`` looks.

    Summed up as the run goes, so that it takes two vectors whatever the length; the mean drops out.
    """

    frequency_hz: float
    every: int
    count: int
    looks: int = 0
    turned: ComplexArray | None = None
    plain: Array | None = None
    weights: complex = 0j
    window: Array = field(init=False)

    def __post_init__(self) -> None:
        self.window = hann(self.count)

    def see(self, time: float, velocity: Array) -> None:
        """Add this instant."""
        if self.looks >= self.count:
            return
        if self.turned is None or self.plain is None:
            self.turned, self.plain = np.zeros(len(velocity), dtype=complex), np.zeros(len(velocity))
        weight = self.window[self.looks] * np.exp(-2j * np.pi * self.frequency_hz * time)
        self.turned += weight * velocity
        self.plain += velocity
        self.weights += weight
        self.looks += 1

    @property
    def amplitude(self) -> ComplexArray:
        """Amplitudes (n,) [m/s, rad/s]. Raises ValueError before anything was seen."""
        if self.turned is None or self.plain is None or not self.looks:
            raise ValueError("nothing was seen")
        mean = self.plain / self.looks
        return (self.turned - self.weights * mean) * 2 / float(self.window[: self.looks].sum())

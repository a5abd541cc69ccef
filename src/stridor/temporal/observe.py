"""What looks on while a run marches: the motion of all freedoms without a record of every instant."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from ..typing import Array, ComplexArray
from .signals import hann


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
class LineShape:
    """Complex amplitude (n,) of the line at one frequency [Hz], by a Hann window over ``count`` looks.

    Summed up as the run goes, so that it takes two vectors whatever the length; the mean drops out.
    """

    frequency_hz: float
    every: int
    count: int
    looks: int = 0
    modulated: ComplexArray | None = None
    plain: Array | None = None
    weights: complex = 0j
    window: Array = field(init=False)

    def __post_init__(self) -> None:
        self.window = hann(self.count)

    def see(self, time: float, velocity: Array) -> None:
        """Add this instant."""
        if self.looks >= self.count:
            return
        if self.modulated is None or self.plain is None:
            self.modulated, self.plain = np.zeros(len(velocity), dtype=complex), np.zeros(len(velocity))
        weight = self.window[self.looks] * np.exp(-2j * np.pi * self.frequency_hz * time)
        self.modulated += weight * velocity
        self.plain += velocity
        self.weights += weight
        self.looks += 1

    @property
    def amplitude(self) -> ComplexArray:
        """Amplitudes (n,) [m/s, rad/s]. Raises ValueError before anything was seen."""
        if self.modulated is None or self.plain is None or not self.looks:
            raise ValueError("nothing was seen")
        mean = self.plain / self.looks
        return (self.modulated - self.weights * mean) * 2 / float(self.window[: self.looks].sum())

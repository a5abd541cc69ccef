"""Real Fourier series a₀ + Σ aₖ cos kτ + bₖ sin kτ of numbers over one period, as rows of (a₀, a₁ … a_h, b₁ … b_h)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ...typing import Array, ComplexArray

FINE = 32  # times for each harmonic: what the law makes of a series goes far beyond its last harmonic
LEAST = 256


@dataclass(frozen=True)
class Fourier:
    """h harmonics and n times of a period: series (n, l) and means (l, n) go from rows (l,), l = 2h + 1, to values in
    time and back, turn (l, l) gives the derivative by τ = ωt."""

    harmonics: int
    series: Array
    means: Array
    turn: Array

    @property
    def length(self) -> int:
        """How many numbers a row has, 2h + 1."""
        return 2 * self.harmonics + 1

    @property
    def samples(self) -> int:
        """How many times."""
        return len(self.series)

    def complex_of(self, rows: Array) -> ComplexArray:
        """Complex amplitudes (h + 1, m) of rows (m, l): Σ Re zₖ exp(jkτ)."""
        h = self.harmonics
        found = np.zeros((h + 1, len(rows)), dtype=complex)
        found[0] = rows[:, 0]
        found[1:] = (rows[:, 1 : h + 1] - 1j * rows[:, h + 1 :]).T
        return found

    def real_of(self, amplitudes: ComplexArray) -> Array:
        """Rows (m, l) of complex amplitudes (h + 1, m)."""
        return np.concatenate([amplitudes[:1].real.T, amplitudes[1:].real.T, -amplitudes[1:].imag.T], axis=1)

    def at(self, phases: Array) -> Array:
        """Values of the basis (n, l) at phases τ (n,)."""
        return _series(self.harmonics, phases)

    def taken_to(self, rows: Array, other: Fourier) -> Array:
        """The same series with more or fewer harmonics."""
        h, least = self.harmonics, min(self.harmonics, other.harmonics)
        found = np.zeros((len(rows), other.length))
        found[:, : least + 1] = rows[:, : least + 1]
        found[:, other.harmonics + 1 : other.harmonics + 1 + least] = rows[:, h + 1 : h + 1 + least]
        return found


@lru_cache(32)
def fourier(harmonics: int) -> Fourier:
    """That of so many harmonics."""
    count = max(LEAST, 1 << (FINE * harmonics - 1).bit_length())
    series = _series(harmonics, 2 * np.pi * np.arange(count) / count)
    means = 2.0 * series.T / count
    means[0] *= 0.5
    numbers = np.arange(1, harmonics + 1)
    turn = np.zeros((2 * harmonics + 1, 2 * harmonics + 1))
    turn[numbers, harmonics + numbers] = numbers
    turn[harmonics + numbers, numbers] = -numbers
    return Fourier(harmonics, series, means, turn)


def _series(harmonics: int, phases: Array) -> Array:
    angles = np.outer(phases, np.arange(1, harmonics + 1))
    return np.hstack([np.ones((len(phases), 1)), np.cos(angles), np.sin(angles)])

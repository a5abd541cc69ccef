"""Cycles by harmonic balance: Newton's method on the balance with unknown ω, and how far what it ends with is from the
equations of motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...errors import AnalysisError
from ...typing import Array
from .balance import Evaluated, Scales, evaluated, scales
from .fourier import fourier
from .problem import HarmonicFamily

CLOSED = 1e-10  # of the amplitude: balanced
ENOUGH = 1e-7  # where rounding and the corners of the law let no step come closer
STEPS = 40
SHORTEST = 1e-3  # of a step of Newton's method
LONGEST = 0.3  # of the amplitude, of ω: one step of it


@dataclass(frozen=True)
class Balanced:
    """A cycle in harmonics: what it was balanced with (`Evaluated`), and scales of the law."""

    at: Evaluated

    @property
    def family(self) -> HarmonicFamily:
        """What it is a cycle of."""
        return self.at.family

    @property
    def mu(self) -> float:
        """The friction coefficient."""
        return self.at.mu

    @property
    def period(self) -> float:
        """2π/ω [s]."""
        return 2 * np.pi / self.at.omega

    @property
    def harmonics(self) -> int:
        """How many."""
        return self.at.base.harmonics

    @property
    def residual(self) -> float:
        """Of the balance, in shares of the amplitude."""
        return self.at.residual

    @property
    def amplitude(self) -> float:
        """See `Evaluated.amplitude`."""
        return self.at.amplitude

    @property
    def changes(self) -> bool:
        """Whether any contact is open, sticks or turns at some times and does not at others."""
        at = self.at
        _, speed, _ = self.family.split(at.omega * at.motion @ at.base.turn.T @ at.base.series.T)
        along = np.einsum("mdn,md->mn", speed + self.family.slip[:, :, None], self.family.slip)
        return bool(np.any(np.ptp(at.applied.status, axis=1)) or np.any((along < 0.0) & (at.applied.status > 0)))

    def with_harmonics(self, harmonics: int) -> Balanced:
        """The same series with more harmonics, or cut: not balanced any more."""
        z = self.at.base.taken_to(self.at.z, fourier(harmonics))
        scale = scales(self.family, self.at.omega, self.mu, harmonics)
        return Balanced(evaluated(self.family, z, self.at.omega, self.mu, scale))


def defect(cycle: Balanced) -> float:
    """How far the motion is from the equations of motion in time: the slips, gaps and elongations that *all* harmonics
    of the law's forces make in the structure, those beyond the balance included, less the cycle's own; as rates, root
    of mean square over a period, in shares of the cycle's own.

    The forces satisfy the laws of contact and friction at every time; this is what the motion does not with them.
    """
    at = cycle.at
    family, base = at.family, at.base
    given = family.joined(at.applied.normal, at.applied.tangential, at.applied.springs)
    gap, _, _ = family.split(at.motion @ base.series.T)
    given[: family.count] += family.spring[:, None] * (gap + family.nodes.gap[:, None])
    spectrum = 2.0 * np.fft.rfft(given, axis=1) / base.samples
    most = min(spectrum.shape[1] - 1, 8 * base.harmonics)
    own = base.complex_of(at.z)
    off = spectrum[:, : most + 1].T.copy()
    off[0] *= 0.5
    off[: len(own)] -= own
    s = 1j * at.omega * np.arange(1, most + 1)
    value = family.condensed(s)[0]
    missed = s[:, None] * np.einsum("kij,kj->ki", value, off[1:])
    moved = s[: len(own) - 1, None] * np.einsum("kij,kj->ki", value[: len(own) - 1], own[1:])
    return float(np.linalg.norm(missed)) / max(float(np.linalg.norm(moved)), 1e-300)


def balanced(guess: Balanced, told: Callable[[int, float], None] | None = None) -> Balanced:
    """The cycle near a guess at its μ. Raises AnalysisError where Newton's method does not come to one."""
    at = guess.at
    z0, shifted = at.z, at.z @ at.base.turn.T
    normal = shifted.ravel() / max(float(np.linalg.norm(shifted)), 1e-300)
    first = max(guess.amplitude, 1e-300)
    for step in range(STEPS):
        if told is not None:
            told(step, at.residual)
        if at.residual <= CLOSED:
            break
        size = at.z.size
        matrix = np.zeros((size + 1, size + 1))
        matrix[:size, :size] = at.jacobian
        matrix[:size, size] = at.by_omega.ravel() * at.omega / first
        matrix[size, :size] = normal
        rest = np.append(at.left.ravel(), normal @ (at.z - z0).ravel())
        try:
            move = np.linalg.solve(matrix, -rest)
        except np.linalg.LinAlgError as error:
            raise AnalysisError("the cycle is not isolated: another lies beside it") from error
        found = _shortened(at, move / first, first)
        if found is None:
            break
        at = found
        if at.amplitude < 1e-6 * first:
            raise AnalysisError("Newton's method comes to steady sliding")
    if not at.residual <= ENOUGH:
        raise AnalysisError(
            f"harmonic balance does not close: Newton's method ends {at.residual:.2g} of the amplitude off with "
            f"{at.base.harmonics} harmonics; try others (harmonics), or a μ nearer to where a branch is known"
        )
    return Balanced(at)


def _shortened(at: Evaluated, move: Array, first: float) -> Evaluated | None:
    """The balance behind a step [amplitudes], so short that it comes closer; None where none does."""
    size = at.z.size
    share = min(1.0, 2.0 * LONGEST / max(abs(float(move[size])), 1e-300))
    share = min(share, 2.0 / max(float(np.linalg.norm(move[:size])), 1e-300))
    before = float(np.linalg.norm(at.left))
    best: Evaluated | None = None
    while share >= SHORTEST:
        z = at.z + share * first * move[:size].reshape(at.z.shape)
        tried = evaluated(at.family, z, at.omega * (1.0 + share * float(move[size])), at.mu, at.scales)
        left = float(np.linalg.norm(tried.left))
        if left < (1.0 - 1e-4 * share) * before:
            return tried
        if best is None or left < float(np.linalg.norm(best.left)):
            best = tried
        share *= 0.5
    return best if best is not None and float(np.linalg.norm(best.left)) < before else None


@dataclass(frozen=True)
class Kept:
    """A cycle without what can be found again."""

    family: HarmonicFamily
    z: Array
    omega: float
    mu: float
    scales: Scales
    amplitude: float

    @property
    def period(self) -> float:
        """2π/ω [s]."""
        return 2 * np.pi / self.omega

    def at(self, mu: float) -> Balanced:
        """The cycle near at another μ. Raises AnalysisError where there is none."""
        return balanced(Balanced(evaluated(self.family, self.z, self.omega, mu, self.scales)))


def kept(cycle: Balanced) -> Kept:
    """The same, lighter."""
    at = cycle.at
    return Kept(at.family, at.z, at.omega, at.mu, at.scales, at.amplitude)


def guessed(
    family: HarmonicFamily, mu: float, harmonics: int, period: float, normal: Array, tangential: Array, gap: Array,
    scale: Scales | None = None,
) -> Balanced:  # fmt: skip
    """A guess from forces over one period of a run or another cycle: normal (t, m), tangential (t, m, d) and gap (t, m)
    at equal times, the last before the period's end."""
    z = family.joined(
        normal.T + family.spring[:, None] * gap.T, np.moveaxis(tangential, 0, 2),
        np.zeros((family.springs, len(normal))),
    )  # fmt: skip
    spectrum = 2.0 * np.fft.rfft(z, axis=1).T / len(normal)
    spectrum[0] *= 0.5
    base = fourier(harmonics)
    amplitudes = np.zeros((harmonics + 1, len(z)), dtype=complex)
    least = min(harmonics + 1, len(spectrum))
    amplitudes[:least] = spectrum[:least]
    omega = 2 * np.pi / period
    scale = scale or scales(family, omega, mu, harmonics)
    return Balanced(evaluated(family, base.real_of(amplitudes), omega, mu, scale))


def slip_amplitudes(cycle: Balanced) -> Array:
    """Half the range (m,) of the slip velocity [m/s], of the tangent along which it is largest."""
    at = cycle.at
    _, speed, _ = cycle.family.split(at.omega * at.motion @ at.base.turn.T @ at.base.series.T)
    return 0.5 * np.ptp(speed, axis=2).max(axis=1)

"""The balance of harmonics at the contact nodes, and its derivative.

Unknown are the harmonics of z = p + κ g at every row: contact forces p with what the springs κ of the modes take. With
r = H(jkω) z + r₀ the gaps, tangential displacements and elongations follow, and what is left is

    z − κ g − P_N(p_N, g) = 0,    z_T − P_T(z_T − ρ ṙ_T − ρ v₀, P_N) = 0,    z_S − P_S(e) = 0

harmonic by harmonic, P being the law at the times of a fine grid (alternating frequency–time: Cameron and Griffin
1989). The freedoms of the structure do not enter.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...typing import Array, ComplexArray
from .fourier import Fourier, fourier
from .law import Applied
from .problem import HarmonicFamily


@dataclass(frozen=True)
class Scales:
    """ε [N/m] and ρ [N s/m] (m,) of the contact nodes: what they are decides how fast Newton's method is, not where it
    ends, but for what the harmonics leave."""

    push: Array
    rub: Array


def scales(family: HarmonicFamily, omega: float, mu: float, harmonics: int) -> Scales:
    """One over the receptances of each node by itself, in the mean of the harmonics."""
    s = 1j * omega * np.arange(1, harmonics + 1)
    value = family.condensed(s)[0]  # ty: ignore[invalid-argument-type]
    own = np.abs(np.einsum("fii->fi", value))
    normal, _, _ = family.split(np.exp(np.log(np.maximum(own, 1e-300)).mean(axis=0)))
    _, along, _ = family.split(np.exp(np.log(np.maximum(own * np.abs(s)[:, None], 1e-300)).mean(axis=0)))
    rub = 1.0 / along.mean(axis=1)
    if not np.all(family.law.constant):
        steady = family.steady(mu)
        slopes = np.zeros(family.count)
        laws = family.laws(mu)
        speeds = np.linspace(0.0, 4.0, 41)
        for i, k in enumerate(family.nodes.owner):
            # Only falling friction asks for more.
            slopes[i] = max(-laws[k].slope(float(share * family.speed[i])) for share in speeds)
        rub = np.maximum(rub, 4.0 * slopes * np.abs(steady.normal))
    return Scales(1.0 / normal, rub)


@dataclass(frozen=True)
class Evaluated:
    """The balance at z (r, l), ω and μ: motion r (r, l) in rows, what the law makes of it at the times, and what is
    left (r, l) [N]."""

    family: HarmonicFamily
    base: Fourier
    z: Array
    omega: float
    mu: float
    scales: Scales
    motion: Array
    value: ComplexArray
    slope: ComplexArray
    applied: Applied
    left: Array

    @cached_property
    def jacobian(self) -> Array:
        """∂ left / ∂ z (r l, r l)."""
        rows, length = self.left.shape
        through = self._through()
        matrix = np.zeros((rows, length, rows, length))
        index = np.arange(rows)
        matrix[index, :, index, :] = np.eye(length)
        for i, j, of_force, of_motion in self._weights():
            matrix[i, :, j, :] -= of_force
            matrix[i] -= np.tensordot(of_motion, through[j], axes=(1, 0))
        return matrix.reshape(rows * length, rows * length)

    def _weights(self) -> list[tuple[int, int, Array, Array]]:
        """(row, row, (l, l), (l, l)): by how much the law at the first changes with z and with r of the second."""
        family, applied, base = self.family, self.applied, self.base
        m, d = family.count, family.directions
        spring, rub = family.spring, self.scales.rub
        eye = np.eye(base.length)
        of_force, of_gap = applied.by_force, applied.by_gap - spring[:, None] * applied.by_force
        z_n, r_n = self._averaged(of_force), self._averaged(of_gap)
        found: list[tuple[int, int, Array, Array]] = []
        for i in range(m):
            found.append((i, i, z_n[i], r_n[i] + spring[i] * eye))
        for a in range(d):
            z_t = self._averaged(applied.by_normal[:, a] * of_force)
            r_t = self._averaged(applied.by_normal[:, a] * of_gap)
            for i in range(m):
                found.append((m + i * d + a, i, z_t[i], r_t[i]))
            for b in range(d):
                weight = self._averaged(applied.by_pull[:, a, b])
                for i in range(m):
                    moved = -rub[i] * self.omega * (weight[i] @ base.turn)
                    found.append((m + i * d + a, m + i * d + b, weight[i], moved))
        stretched = self._averaged(applied.by_stretch)
        for k in range(family.springs):
            row = m * (1 + d) + k
            found.append((row, row, np.zeros_like(eye), stretched[k]))
        return found

    def _averaged(self, weights: Array) -> Array:
        """(m, l, l) of what multiplies at the times (m, n)."""
        base = self.base
        steady = np.ptp(weights, axis=1) == 0.0
        found = np.zeros((len(weights), base.length, base.length))
        found[steady] = weights[steady, 0, None, None] * np.eye(base.length)
        for i in np.flatnonzero(~steady):
            found[i] = (base.means * weights[i]) @ base.series
        return found

    def _through(self) -> Array:
        """How r changes with z: (r, l, r, l)."""
        h, rows = self.base.harmonics, len(self.z)
        found = np.zeros((rows, self.base.length, rows, self.base.length))
        found[:, 0, :, 0] = self.value[0].real
        for k in range(1, h + 1):
            real, imaginary = self.value[k].real, self.value[k].imag
            found[:, k, :, k] = found[:, h + k, :, h + k] = real
            found[:, k, :, h + k] = imaginary
            found[:, h + k, :, k] = -imaginary
        return found

    @cached_property
    def by_omega(self) -> Array:
        """∂ left / ∂ ω (r, l)."""
        base, family, applied = self.base, self.family, self.applied
        numbers = 1j * np.arange(base.harmonics + 1)
        changed = numbers[:, None] * np.einsum("kij,kj->ki", self.slope, base.complex_of(self.z))
        motion = base.real_of(changed)
        moving = self.omega * motion @ base.turn.T + self.motion @ base.turn.T
        gap, _, elongation = family.split(motion @ base.series.T)
        _, speed, _ = family.split(moving @ base.series.T)
        force = -family.spring[:, None] * gap
        normal = applied.by_force * force + applied.by_gap * gap
        pull = -self.scales.rub[:, None, None] * speed
        along = np.einsum("mabn,mbn->man", applied.by_pull, pull) + applied.by_normal * normal[:, None]
        given = family.joined(normal, along, applied.by_stretch * elongation) @ base.means.T
        found = -given
        found[: family.count] -= family.spring[:, None] * motion[: family.count]
        return found

    @cached_property
    def by_mu(self) -> Array:
        """∂ left / ∂ μ (r, l)."""
        family, applied = self.family, self.applied
        given = family.joined(np.zeros_like(applied.normal), applied.by_mu, np.zeros_like(applied.springs))
        return -given @ self.base.means.T

    @property
    def amplitude(self) -> float:
        """What changes over the period [N], root of the sum of squares of the rows' harmonics."""
        return float(np.linalg.norm(self.z[:, 1:]))

    @property
    def residual(self) -> float:
        """What is left, in shares of the amplitude."""
        return float(np.linalg.norm(self.left)) / max(self.amplitude, 1e-300)


def evaluated(
    family: HarmonicFamily, z: Array, omega: float, mu: float, scale: Scales, drive: ComplexArray | None = None
) -> Evaluated:
    """The balance at z (r, l), ω [rad/s] and μ; drive (r,): what moves with the first harmonic whatever contacts do."""
    base = fourier(z.shape[1] // 2)
    value, slope = family.condensed(1j * omega * np.arange(base.harmonics + 1))  # ty: ignore[invalid-argument-type]
    moved = np.einsum("kij,kj->ki", value, base.complex_of(z))
    moved[0] += family.still
    if drive is not None:
        moved[1] += drive
    motion = base.real_of(moved)
    applied = applied_at(family, base.series, z, motion, motion @ base.turn.T * omega, mu, scale)
    given = family.joined(applied.normal, applied.tangential, applied.springs) @ base.means.T
    left = z - given
    gap = motion[: family.count].copy()
    gap[:, 0] += family.nodes.gap
    left[: family.count] -= family.spring[:, None] * gap
    return Evaluated(family, base, z, omega, mu, scale, motion, value, slope, applied, left)


def applied_at(
    family: HarmonicFamily, series: Array, z: Array, motion: Array, speed: Array, mu: float, scale: Scales
) -> Applied:
    """The law at the times whose series (n, l) are given; z, motion and its speed in rows (r, l)."""
    gap, _, elongation = family.split(motion @ series.T)
    gap = gap + family.nodes.gap[:, None]
    _, moving, _ = family.split(speed @ series.T)
    normal, pull, _ = family.split(z @ series.T)
    pull = pull - scale.rub[:, None, None] * (moving + family.slip[:, :, None])
    return family.law(mu, normal - family.spring[:, None] * gap, gap, pull, elongation, scale.push, scale.rub)

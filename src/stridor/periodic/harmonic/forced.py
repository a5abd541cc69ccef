"""The answer to a harmonic force: the same balance, with ω given. No verb has it; it shows that the balance is right
where others have computed the same."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...errors import AnalysisError
from ...typing import Array, ComplexArray
from .balance import Evaluated, Scales, evaluated
from .balanced import CLOSED, ENOUGH, SHORTEST, STEPS
from .problem import HarmonicFamily


@dataclass(frozen=True)
class Response:
    """Amplitudes (h + 1, k) of the modes' coordinates, and the balance that they are of."""

    at: Evaluated
    coordinates: ComplexArray

    def rows(self, rows: Array) -> Array:
        """Root of mean square over a period (w,) of rows (w, n) of the freedoms, without their means."""
        moved = self.coordinates[1:] @ (rows @ self.at.family.condensed.vectors).T
        return np.sqrt(0.5 * (np.abs(moved) ** 2).sum(axis=0))


def forced(
    family: HarmonicFamily, force: Array, omega: float, harmonics: int, *, mu: float = 1.0, start: Array | None = None,
    scale: Scales,
) -> Response:  # fmt: skip
    """The answer to Re force exp(jωt), force (n,) [N] on the freedoms, ω [rad/s]. start (r, l): where Newton's method
    begins. Raises AnalysisError where it does not converge."""
    modes = family.condensed
    loaded = modes.vectors.T @ force
    alone = modes.driven(1j * omega, loaded.astype(complex))
    drive = modes.rows @ alone
    z = np.zeros((len(family.still), 2 * harmonics + 1)) if start is None else start
    at = evaluated(family, z, omega, mu, scale, drive)
    size = float(np.linalg.norm(at.left)) or 1.0
    for _ in range(STEPS):
        if np.linalg.norm(at.left) <= CLOSED * size:
            break
        step = np.linalg.solve(at.jacobian, -at.left.ravel()).reshape(z.shape)
        share, before = 1.0, float(np.linalg.norm(at.left))
        while share >= SHORTEST:
            tried = evaluated(family, at.z + share * step, omega, mu, scale, drive)
            if np.linalg.norm(tried.left) < (1.0 - 1e-4 * share) * before:
                break
            share *= 0.5
        else:
            break
        at = tried
    if not np.linalg.norm(at.left) <= ENOUGH * size:
        off = np.linalg.norm(at.left) / size
        raise AnalysisError(f"the forced balance ends {off:.2g} off; begin from another answer")
    s = 1j * omega * np.arange(harmonics + 1)
    found = np.einsum("kij,kj->ki", modes.answers(s), at.base.complex_of(at.z))  # ty: ignore[invalid-argument-type]
    found[0] += modes.load / modes.squares
    found[1] += alone
    return Response(at, found)

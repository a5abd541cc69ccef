"""Where a branch begins in harmonics: small motions of steady sliding at the contact nodes, and the first cycle."""

from __future__ import annotations

import numpy as np

from ...errors import AnalysisError
from ...typing import Array, ComplexArray
from .balance import Scales, applied_at, evaluated, scales
from .balanced import Balanced
from .branch import SMALL, HarmonicBranch
from .fourier import fourier
from .law import Applied
from .problem import HarmonicFamily

LARGER = (1.02, 1.05, 1.1, 1.2, 1.3, 1.5)  # of the size at which contacts first change, where all is linear until then
STEPS = 30  # of Newton's method, for cubic springs
SMOOTH = (0.1, 0.2, 0.05, 0.4)  # the same, where it is not
ALONE = 0.05  # of the next singular value: a mode at the onset


def still(family: HarmonicFamily, mu: float, scale: Scales) -> tuple[Array, Applied]:
    """z (r,) of steady sliding, and the law there."""
    steady = family.steady(mu)
    z = family.joined(steady.normal + family.spring * steady.gap, steady.friction, np.zeros(family.springs))
    at = family.condensed(np.zeros(1, dtype=complex))[0][0].real

    def applied_to(z: Array) -> Applied:
        motion = (at @ z + family.still)[:, None]
        return applied_at(family, np.ones((1, 1)), z[:, None], motion, np.zeros_like(motion), mu, scale)

    applied = applied_to(z)
    if family.springs:
        for _ in range(STEPS):
            q = slice(-family.springs, None)
            left = z[q] - applied.springs[:, 0]
            if np.linalg.norm(left) <= 1e-13 * np.linalg.norm(z[q]):
                break
            z[q] -= np.linalg.solve(np.eye(family.springs) - applied.by_stretch * at[q, q], left)
            applied = applied_to(z)
    return z, applied


def small_motion(
    family: HarmonicFamily, applied: Applied, scale: Scales, s: complex
) -> tuple[ComplexArray, ComplexArray]:
    """The balance (r, r) of small motions exp(st), and the receptance (r, r)."""
    m, d, rows = family.count, family.directions, len(family.still)
    of_force, of_motion, of_speed = (np.zeros((rows, rows)) for _ in range(3))
    by_force, by_gap = applied.by_force[:, 0], applied.by_gap[:, 0]
    for i in range(m):
        gap = by_gap[i] - family.spring[i] * by_force[i]
        of_force[i, i], of_motion[i, i] = by_force[i], gap + family.spring[i]
        along = m + i * d + np.arange(d)
        of_force[along, i] = applied.by_normal[i, :, 0] * by_force[i]
        of_motion[along, i] = applied.by_normal[i, :, 0] * gap
        pull = applied.by_pull[i, :, :, 0]
        of_force[np.ix_(along, along)], of_speed[np.ix_(along, along)] = pull, -scale.rub[i] * pull
    springs = m * (1 + d) + np.arange(family.springs)
    of_motion[springs, springs] = applied.by_stretch[:, 0]
    value = family.condensed(np.array([s]))[0][0]
    return np.eye(rows) - of_force - (of_motion + s * of_speed) @ value, value


def first_changes(family: HarmonicFamily, mu: float, applied: Applied, mode: ComplexArray, motion: ComplexArray,
                  s: complex) -> float:  # fmt: skip
    """How often a small motion z (r,), r (r,) has to be taken for a contact to change."""
    steady = family.steady(mu)
    z_n, _, _ = family.split(mode)
    gap, along, _ = family.split(motion)
    force = applied.by_force[:, 0] * (z_n - family.spring * gap) + applied.by_gap[:, 0] * gap
    speed = np.abs(np.einsum("md,md->m", s * along, family.slip)) / np.maximum(family.speed, 1e-300)
    touching = applied.status[:, 0] > 0
    rubs = touching & family.nodes.rubs
    shares = [
        np.where(touching & ~family.nodes.kept, np.abs(steady.normal) / np.maximum(np.abs(force), 1e-300), np.inf),
        np.where(rubs, family.speed / np.maximum(speed, 1e-300), np.inf),
        np.where(~touching, np.abs(steady.gap) / np.maximum(np.abs(gap), 1e-300), np.inf),
    ]
    return float(np.concatenate(shares).min())


def born(
    family: HarmonicFamily, branch: HarmonicBranch, mu: float, frequency_hz: float, harmonics: int
) -> tuple[Balanced, Array]:
    """The first cycle of the branch that begins at an onset, and the heading (r l + 2,) away from it.

    Where the law is linear until a contact changes, steady sliding at the onset swings freely up to the size at which
    one first does, and the branch begins there; else it begins in steady sliding itself, and its first cycle is a
    small one. Raises AnalysisError where the onset has no such mode, or no cycle is near.
    """
    if frequency_hz <= 0.0:
        raise AnalysisError("steady sliding diverges there without swinging")
    omega = 2 * np.pi * frequency_hz
    scale = scales(family, omega, mu, harmonics)
    z, applied = still(family, mu, scale)
    matrix, value = small_motion(family, applied, scale, 1j * omega)
    _, sizes, right = np.linalg.svd(matrix / np.maximum(np.linalg.norm(matrix, axis=1), 1e-300)[:, None])
    if len(sizes) > 1 and sizes[-1] > ALONE * sizes[-2]:
        raise AnalysisError(
            "steady sliding has no mode of its own there: two meet in one, or the condensed model has it elsewhere"
        )
    mode = right[-1].conj()
    size = first_changes(family, mu, applied, mode, value @ mode, 1j * omega)
    if not np.isfinite(size):
        raise AnalysisError("the mode changes no contact, however large it grows")
    base = fourier(harmonics)
    swing = np.zeros((len(z), base.length))
    swing[:, 1], swing[:, harmonics + 1] = mode.real, -mode.imag
    branch.small = SMALL * size * float(np.linalg.norm(swing))
    last = ""
    for larger in LARGER if family.piecewise_linear else SMOOTH:
        start = larger * size * swing
        start[:, 0] = z
        try:
            guess = Balanced(evaluated(family, start, omega, mu, scale))
            heading = np.concatenate([swing.ravel() / np.linalg.norm(swing), [0.0, 0.0]])
            branch.forget()
            found = branch.corrected(guess, heading)
            if branch.vanished(found):
                raise AnalysisError("the cycle found changes no contact")
            branch.forget()
            return found, branch.heading(found, heading)
        except (AnalysisError, np.linalg.LinAlgError) as error:
            last = str(error)
    raise AnalysisError(last)

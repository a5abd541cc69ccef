"""Modes of a band that do not grow, sought anew in the full problem of small systems.

Branches lead from μ = 0 to what starts in the band. What is overdamped there, or starts far above, may be a vibration
of the band at another μ without any branch that leads to it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import AnalysisError
from ..system import System
from ..threads import one_thread
from ..typing import Array, ComplexArray, IntArray
from .growing import SAME, Growing
from .krylov.problem import problem_of
from .options import Options
from .quadratic import find_modes
from .quadratic.find import WHOLE
from .quadratic.polish import pairs
from .quadratic.region import Region

DECAY = 0.5  # of the band: modes that decay faster are not sought, as in `full`
NEAR = 1e-5  # of the band: eigenvalues further apart are not the same mode


@dataclass(frozen=True)
class Decaying:
    """Modes of a band that do not grow: λ (k,) [1/s], right (n, k) of unit norm, left (n, k) with yᵀP(λ) = 0, backward
    errors residual (k,). slower [1/s]: up to which decay they were sought. mirrored: whether mirrors of what diverges
    are left out, as where nothing dissipates."""

    values: ComplexArray
    right: ComplexArray
    left: ComplexArray
    residual: Array
    slower: float
    mirrored: bool


@one_thread
def decaying_modes(
    system: System, growing: Growing, max_frequency_hz: float, *, touching_at: float | None, damped: bool,
    options: Options,
) -> Decaying | None:  # fmt: skip
    """What does not grow at the μ of ``growing``, with a frequency up to max_frequency_hz; None of large systems and
    where the search does not vouch for all of it."""
    system = system if damped else system.undamped()
    problem = problem_of(system, touching_at, options)
    whole = problem.pencil(growing.mu).condensed()
    if whole.size > WHOLE or not growing.sought:
        return None
    slower = DECAY * growing.top
    region = Region.band(0.0, growing.top / (2 * np.pi), above=-slower)
    try:
        found = find_modes(whole, region, left=True, solver=options.solver, still=growing.still)
    except AnalysisError:
        return None
    if not found.completeness.complete or found.left is None:
        return None
    size = np.abs(found.values)
    inside = (found.values.imag <= 2 * np.pi * max_frequency_hz) & (size > growing.still)
    # Without damping what decays without oscillating is the mirror of what diverges, which is listed.
    mirrors = inside & (found.values.imag == 0.0) & (found.values.real < 0.0) & (not problem.damped)
    inside &= ~mirrors
    # Growth that the other search takes for rounding is none here, either.
    near, _ = pairs(found.values, growing.values, NEAR * growing.top)
    inside[near] = False
    inside &= found.values.real <= SAME * size
    n = problem.size
    return Decaying(
        found.values[inside], _unit(found.right[:n, inside]), _unit(found.left[:n, inside]), found.residual[inside],
        slower, bool(mirrors.any()),
    )  # fmt: skip


def unlisted(found: Decaying, listed: ComplexArray, top: float) -> IntArray:
    """Places (k,) of modes that are not among the eigenvalues ``listed`` (l,) of the same μ."""
    known = listed[np.isfinite(listed)]
    ours, _ = pairs(found.values, known, NEAR * top)
    rest = np.setdiff1d(np.arange(len(found.values)), ours)
    distance = np.abs(found.values[rest][:, None] - known).min(axis=1, initial=np.inf)
    return rest[distance > SAME * np.abs(found.values[rest])]


def _unit(vectors: ComplexArray) -> ComplexArray:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=0), 1e-300)

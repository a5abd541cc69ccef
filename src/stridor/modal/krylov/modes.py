"""Complex modes of systems with many contact nodes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from ...errors import CaseError
from ...system import System
from ...threads import one_thread
from ...typing import Array, BoolArray, ComplexArray
from ..options import Options
from ..quadratic.reach import searched
from ..results import ComplexModes, Progress, at_each, off_rounding, require_memory
from ..tolerances import BELIEVED, SPLIT_RELATIVE
from .follow import Follower
from .problem import problem_of
from .reduced import Reduced
from .refine import MARGIN, NAMES, Band, converge_at, converge_over, left_vectors, projected

SAMPLES = 7


@one_thread
def krylov_modes(
    system: System,
    mu: float | Sequence[float] | Array,
    *,
    count: int = 20,
    max_frequency_hz: float | None = None,
    damped: bool = True,
    vectors: bool | Literal["right"] = False,
    options: Options | None = None,
    progress: Progress | None = None,
    numbered_at: float = 0.0,
) -> ComplexModes:
    """Modes at the friction coefficients ``mu``, branches followed from ``numbered_at``, as `complex_modes` gives them.

    count: how many branches, lowest frequencies at μ = 0 first; max_frequency_hz instead takes all that start below it,
    and those that start a little above and come below it at one of these μ. vectors keeps left and right ones, "right"
    those alone, n numbers for each. progress and KeyboardInterrupt are as in `complex_modes`. Raises CaseError for
    friction coefficients or counts that are none, AnalysisError where contacts do not slide, have no equilibrium, or
    the modes do not settle.
    """
    values = checked_friction(mu)
    if count < 1:
        raise CaseError("count", count, "at least one mode")
    if max_frequency_hz is not None and not (np.isfinite(max_frequency_hz) and max_frequency_hz > 0):
        raise CaseError("max_frequency_hz", max_frequency_hz, "a positive frequency in Hz")
    if not damped:
        system = system.undamped()
    single = float(values.max()) if len(values) == 1 else None
    problem = problem_of(system, single, options or Options(), frictions=values)
    top = float(values.max())
    asked = None if max_frequency_hz is None else 2 * np.pi * max_frequency_hz
    band = Band(count, None if asked is None else searched(problem.pencil(top).condensed(), asked))
    reduced = projected(problem, band, top)
    converge_over(reduced, numbered_at + samples(top - numbered_at), between=NAMES, left=vectors is True)
    values, _, planned = at_each(
        values, lambda at: converge_at(reduced, [at], tolerance=BELIEVED, left=vectors is True), progress
    )
    found = _followed(reduced, values, band, damped=damped, vectors=vectors, start=numbered_at)
    planned = found.planned if planned is None else planned
    return replace(found, max_frequency_hz=max_frequency_hz, planned=planned)


def _followed(
    reduced: Reduced, values: Array, band: Band, *, damped: bool, vectors: bool | Literal["right"], start: float
) -> ComplexModes:
    """The branches of the band at all μ, judged in the sparse problem."""
    problem = reduced.problem
    longest = max(float(values.max()) / 10, 1e-3)
    follower = Follower(reduced, start=start, longest=longest)
    first = follower.state
    if band.frequency is None:
        branches = np.arange(min(band.count, len(first.index)))
    else:
        # What is exact there: modes of the band, and beside it those that may come into it.
        branches = np.flatnonzero(first.values.imag <= MARGIN * band.frequency)
    follower.named = len(branches)
    require_memory(len(values), len(branches), problem.size if vectors else 0)

    def at(mu: float) -> tuple[ComplexArray, Array, ComplexArray, ComplexArray]:
        state = follower.advance(mu)
        lam, index = state.values[branches], state.index[branches]
        u, p = reduced.expand(state.found.right[:, index])
        left = left_vectors(reduced, lam, state.found.left[:, index], mu)[0] if vectors is True else u[:0]
        return (
            lam if reduced.damped else off_rounding(lam, SPLIT_RELATIVE),
            problem.pencil(mu).backward_error(lam, u, p),
            u.T if vectors else u[:0].T,
            left.T,
        )

    done, rows, planned = at_each(values, at)
    eigenvalues, residual, right, left = (np.array(part) for part in zip(*rows, strict=True))
    found = ComplexModes(
        mu=done,
        eigenvalues=eigenvalues,
        branch=np.arange(1, len(branches) + 1),
        residual=residual,
        damped=damped,
        right=right if vectors else None,
        left=left if vectors is True else None,
        open_contacts=problem.open_contacts,
        contact_state=problem.contact_state,
        planned=planned,
    )
    if band.frequency is None:
        return found
    top = band.frequency * (1 + 1e-12)
    ever: BoolArray = np.any(np.imag(eigenvalues) <= top, axis=0)
    inside = (first.values.imag[branches] <= top) | ever
    return found.chosen(np.flatnonzero(inside))


def checked_friction(mu: float | Sequence[float] | Array) -> Array:
    """Friction coefficients (k,). Raises CaseError for what is none."""
    values = np.atleast_1d(np.asarray(mu, dtype=float))
    if values.ndim != 1 or not len(values) or not np.all(np.isfinite(values)) or np.any(values < 0):
        raise CaseError("mu", mu, "friction coefficients are numbers ≥ 0, at least one")
    return values


def samples(top: float, count: int = SAMPLES) -> Array:
    """Friction coefficients (k,) from ``top`` down to 0, closer at the ends, as polynomials are interpolated best."""
    if top == 0.0:
        return np.zeros(1)
    return top * (1 + np.cos(np.linspace(0, np.pi, count))) / 2

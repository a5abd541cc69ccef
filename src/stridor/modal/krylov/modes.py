"""Complex modes of systems with many contact nodes."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from ...errors import AnalysisError, CaseError, FollowingError
from ...stages import stage
from ...system import System
from ...threads import one_thread
from ...typing import Array, BoolArray, ComplexArray
from ..options import Options
from ..quadratic.inverse_iteration import solved_beside
from ..quadratic.reach import searched
from ..results import ComplexModes, Progress, at_each, off_rounding, require_memory
from ..tolerances import BELIEVED, SPLIT_RELATIVE
from .carried import Carried
from .follow import Follower
from .problem import problem_of
from .reduced import Reduced
from .refine import GUARD, MARGIN, NAMES, Band, converge_at, converge_over, left_vectors, projected

_log = logging.getLogger("stridor")

SAMPLES = 7  # from no friction on
FEWEST = 3
HANDED = 1e-9  # backward error of modes on a basis that was handed on
SAME = 1e-6  # of an eigenvalue: a left vector solved for belongs to it


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
    carried: Carried | None = None,
) -> ComplexModes:
    """Modes at the friction coefficients ``mu``, branches followed from ``numbered_at``, as `complex_modes` gives them.

    count: how many branches, lowest frequencies at μ = 0 first; max_frequency_hz instead takes all that start below it,
    and those that start a little above and come below it at one of these μ. vectors keeps left and right ones, "right"
    those alone, n numbers for each. carried: what the basis of the stretch of μ before hands on, and this one to the
    next, where no left vectors are asked for. progress and KeyboardInterrupt are as in `complex_modes`. Raises
    CaseError for friction coefficients or counts that are none, AnalysisError where contacts do not slide, have no
    equilibrium, or the modes do not settle.
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

    def solved(*, left: bool) -> ComplexModes:
        """With left vectors of the basis, or else each solved for by itself."""
        handed = None if left else carried
        reduced = projected(problem, band, top, handed)
        count = SAMPLES if top == 0.0 else max(FEWEST, round(SAMPLES * (1.0 - numbered_at / top)))
        inner = (False, False) if handed is None else handed.inner
        frictions = numbered_at + samples(top - numbered_at, count)
        # A basis that was handed on has been nowhere near some of these μ.
        to = BELIEVED if handed is None else HANDED
        between = NAMES if numbered_at < top else to
        converge_over(reduced, frictions, between=between, left=left, inner=inner)
        done, _, planned = at_each(
            values, lambda at: converge_at(reduced, [at], tolerance=to, left=left), progress
        )
        if handed is not None:
            handed.take(reduced, GUARD, last=single is not None)
        found = _followed(reduced, done, band, damped=damped, vectors=vectors, start=numbered_at, of_basis=left)
        planned = found.planned if planned is None else planned
        return replace(found, max_frequency_hz=max_frequency_hz, planned=planned)

    if vectors is not True:
        return solved(left=False)
    try:
        return solved(left=True)
    except FollowingError:
        # Beside stiff contact a basis that opens gaps takes rounding in before its left vectors are exact.
        _log.info("left vectors do not settle on one basis: each is solved for in the full problem")
        return solved(left=False)


def _followed(
    reduced: Reduced, values: Array, band: Band, *, damped: bool, vectors: bool | Literal["right"], start: float,
    of_basis: bool,
) -> ComplexModes:  # fmt: skip
    """The branches of the band at all μ, judged in the sparse problem; their left vectors, where they are asked for,
    those of the basis or each solved for by itself."""
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
        if vectors is not True:
            left = u[:0]
        elif of_basis:
            left = left_vectors(reduced, lam, state.found.left[:, index], mu)[0]
        else:
            left = _solved_left(reduced, mu, lam, u, p)
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


def _solved_left(reduced: Reduced, mu: float, lam: ComplexArray, u: ComplexArray, p: ComplexArray) -> ComplexArray:
    """Left vectors (n, k) of unit norm beside right ones, by inverse iteration in the sparse problem. Raises
    AnalysisError where one does not settle."""
    pencil, left = reduced.problem.pencil(mu), np.zeros_like(u)
    whole = pencil.whole
    for k, value in enumerate(lam):
        stage(f"left vector {k + 1} of {len(lam)} at μ = {mu:.6g}, in the full problem")
        found = solved_beside(
            whole, complex(value), np.concatenate([u[:, k], p[:, k] / pencil.unit]), None, solver=reduced.problem.solver
        )
        if found is None or abs(found.lam - value) > SAME * abs(value):
            raise AnalysisError(
                f"the left vector of the mode at {abs(value.imag) / (2 * np.pi):.6g} Hz, μ = {mu:g} does not settle; "
                'ask for right vectors alone (vectors="right")'
            )
        left[:, k] = found.left[: pencil.size] / np.linalg.norm(found.left[: pencil.size])
    return left


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

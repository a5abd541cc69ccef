"""Growing the projected problem until its eigenpairs satisfy the sparse one."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from ...direct import SingularMatrix, factorise
from ...errors import AnalysisError, FollowingError
from ...stages import passing, stage
from ...typing import Array, BoolArray, ComplexArray, IntArray, Sparse
from ..dense_problem import Eigenpairs
from ..pencil import tiny
from ..quadratic.problem import times
from ..tolerances import BELIEVED
from .carried import Carried
from .forces import lumped, principal
from .kept_factors import KeptFactors
from .problem import ContactProblem
from .reduced import Reduced
from .shifted import ForcedShapes, Shifted, frictionless_modes, modes_below, real_columns, shift_for

TOLERANCE = 2e-11  # backward error at which an eigenpair counts as found: eigenvalues are right to 1e-9 then
GROWTH = 1e-8  # and between the ends of a range, where growth must be known but onsets are solved for by themselves
NAMES = 1e-7  # and where it is only which branch is which
LARGEST_REST = 1e-4  # and what it may leave of the lumped inertia forces
SWEEPS = 40
IDLE = 4  # sweeps in a row that do not halve what is left: it is rounding
RUINED = 1e4  # times the least that was left: the basis has taken rounding in
APART = 1e-6  # of ω²: between modes this far from one another can be counted
TRIES = 3  # places to count at
COUNTED = 20_000  # freedoms up to which the number of frictionless modes is checked, by one more factorisation
GROWN = 1.4  # a basis this much larger than when it was last reduced is reduced again
MARGIN = 1.1  # modes up to this much above the band are made exact
SAME = 1e-9  # of an eigenvalue: a basis that has grown has the one that was exact before
GUARD = 1.5  # and frictionless ones up to this much above take part


@dataclass(frozen=True)
class Band:
    """Which modes are asked for: the ``count`` lowest at μ = 0, or all up to a frequency [1/s] where it is given."""

    count: int
    frequency: float | None

    def enough(self, squares: Array, _: int) -> bool:
        """Whether frictionless ω² found so far reach beyond the band."""
        if self.frequency is not None:
            return bool(len(squares) and squares[-1] > (GUARD * self.frequency) ** 2)
        return len(squares) > self.count and bool(squares[-1] > GUARD**2 * squares[self.count - 1])

    def top(self, squares: Array) -> float:
        """The band's upper end [1/s]."""
        if self.frequency is not None:
            return self.frequency
        if not len(squares):
            return 1.0
        highest = float(squares[min(self.count, len(squares)) - 1])
        return float(np.sqrt(max(highest, 1e-12 * float(squares[-1])))) or 1.0


def projected(
    problem: ContactProblem, band: Band, highest: float, carried: Carried | None = None
) -> Reduced:
    """The problem on its frictionless modes up to beyond the band, and on what their friction forces do to it, for μ
    up to ``highest``; on what was carried from a neighbouring problem where that holds all of its modes."""
    kept = None if carried is None else carried.factors
    shifted = Shifted(problem, shift_for(problem, band.frequency), kept)
    if carried is not None and band.frequency is not None and carried.fit(problem, band.frequency):
        reduced, squares = carried.basis(problem, shifted, band.frequency, highest)
        # Far above the band the values of this basis are nobody's.
        counted = _counted(problem, squares[squares <= (GUARD * band.frequency) ** 2], band.frequency, kept)
        if counted is not None and counted.number == counted.found:
            return reduced
    squares, modes = frictionless_modes(shifted, band.enough)
    top = band.top(squares)
    if problem.size <= COUNTED:
        _require_all(problem, squares, top, kept)
    reduced = Reduced(problem, shifted, modes, top, highest)
    near = squares <= (MARGIN * top) ** 2
    if problem.nodes and near.any():
        forces = problem.slide.T @ modes.p[:, near]
        reduced.enrich(principal(problem, forces))
    return reduced


def _require_all(problem: ContactProblem, squares: Array, top: float, kept: KeptFactors | None) -> None:
    """Raise AnalysisError where block Lanczos has missed a mode."""
    told = _counted(problem, squares, top, kept)
    if told is not None and told.number != told.found:
        raise AnalysisError(
            f"{told.number} frictionless modes lie below {told.below_hz:.6g} Hz but {told.found} were found; change "
            "max_frequency_hz or the number of modes slightly"
        )


@dataclass(frozen=True)
class _ModeCount:
    """How many frictionless modes there are below a frequency a little above the band, and how many were found."""

    number: int
    found: int
    below_hz: float


def _counted(
    problem: ContactProblem, squares: Array, top: float, kept: KeptFactors | None = None
) -> _ModeCount | None:
    """The number of frictionless modes, known without finding them, beside ω² (k,) found, ascending; None where it is
    not told."""
    gaps = _gaps(squares, top)
    if not len(gaps):
        return None
    known = None if kept is None else kept.dividing(gaps)
    for between in [*gaps.mean(axis=1).tolist()[:TRIES]] if known is None else [known]:
        try:
            number = modes_below(problem, between, kept)
        except SingularMatrix:
            continue  # a mode that was not found lies there: the next gap has it on one side
        if number is None:
            return None
        return _ModeCount(number, int(np.searchsorted(squares, between)), float(np.sqrt(between)) / (2 * np.pi))
    return None


def _gaps(squares: Array, top: float) -> Array:
    """Intervals (g, 2) of ω² above the band in which none of ``squares`` (k,), ascending, lies, the widest first. Modes
    of one frequency differ by rounding and have none between them: it would decide on which side they are. Where there
    is none above the band, that from it to where the first would be sought."""
    above = squares[squares > top**2]
    ends = np.concatenate([[top**2], above if len(above) else [(GUARD * top) ** 2]])
    gaps = np.column_stack([ends[:-1], ends[1:]])
    gaps = gaps[np.diff(gaps)[:, 0] > APART * gaps[:, 1]]
    return gaps[np.argsort(gaps[:, 0] - gaps[:, 1], kind="stable")]


def wanted(reduced: Reduced, found: Eigenpairs) -> IntArray:
    """Places of the eigenpairs that are to be exact: those of the band and a margin."""
    return np.flatnonzero(np.abs(found.values) <= MARGIN * reduced.frequency)


@passing()
def converge(reduced: Reduced, frictions: Iterable[float], *, tolerance: float = TOLERANCE, left: bool = False) -> None:
    """Enrich the basis until the band's eigenpairs at all ``frictions`` satisfy the sparse problem.

    ``left`` asks it of the left vectors too. Raises AnalysisError where they do not settle within BELIEVED.
    """
    stuck: list[float] = []
    pending = list(dict.fromkeys(float(mu) for mu in frictions))
    worst: dict[float, float] = dict.fromkeys(pending, np.inf)
    least, exact = dict(worst), dict.fromkeys(pending, np.zeros(0, dtype=complex))
    idle = dict.fromkeys(pending, 0)
    for _ in range(SWEEPS):
        if not pending:
            break
        for mu in list(pending):
            stage(f"modes at μ = {mu:.6g}, {reduced.count} unknowns")
            rest = unbalanced(reduced, mu, tolerance, left=left, exact=exact[mu])
            worst[mu], exact[mu], force, opening = rest.error, rest.exact, rest.forces, rest.openings
            idle[mu] = 0 if worst[mu] < 0.5 * least[mu] else idle[mu] + 1
            least[mu] = min(least[mu], worst[mu])
            rounding = idle[mu] >= IDLE and worst[mu] <= BELIEVED  # which no basis vectors are made of
            if idle[mu] >= IDLE and worst[mu] > RUINED * least[mu]:
                stuck.append(mu)
                pending.remove(mu)
                continue
            if (force.shape[1] or opening.shape[1]) and not rounding:
                force = principal(reduced.problem, force)
                grown = reduced.enrich_left(force, opening) if left else reduced.enrich(force)
                if grown:
                    continue
                stuck.append(mu)  # there is nothing to take in
            pending.remove(mu)
            found = reduced.untracked(mu)
            reduced.keep(found.right[:, wanted(reduced, found)], min(1.0, TOLERANCE / tolerance))
    stuck = [mu for mu in (*stuck, *pending) if worst[mu] > BELIEVED]
    if stuck:
        raise FollowingError(
            f"the modes at μ = {stuck[0]:g} do not settle: a backward error of {worst[stuck[0]]:.1e} is left; ask for "
            "fewer modes, a lower modal.max_frequency_hz or smaller friction coefficients"
        )


def converge_at(
    reduced: Reduced, frictions: Iterable[float], *, tolerance: float = TOLERANCE, left: bool = False
) -> None:
    """`converge` at one μ after the other, the basis reduced to what it has found whenever it has grown large."""
    for mu in dict.fromkeys(float(mu) for mu in frictions):
        converge(reduced, [mu], tolerance=tolerance, left=left)
        if not left and reduced.count > GROWN * reduced.compressed:
            reduced.compress()


def converge_over(
    reduced: Reduced, frictions: Array, *, between: float = GROWTH, left: bool = False,
    at_end: ForcedShapes | None = None, inner: tuple[bool, bool] = (False, False),
) -> None:  # fmt: skip
    """`converge_at` over a range: exact at its ends, up to a backward error ``between`` them; each μ in the middle of
    those before, so that most find nothing left to do. at_end: shapes that are known at the high end. inner: whether
    the low and the high end are borders with other ranges, and need no more than what is between."""
    values = np.unique(frictions)
    low, high = (between if within else TOLERANCE for within in inner)
    if at_end is None:
        converge_at(reduced, values[[-1]], tolerance=high, left=left)
        converge_at(reduced, values[[0]], tolerance=low, left=left)
    else:  # which the low end, often that of a basis handed on, would only be slowed down by
        converge_at(reduced, values[[0]], tolerance=low, left=left)
        reduced.add(at_end)
        converge_at(reduced, values[[-1]], tolerance=high, left=left)
    parts = [(0, len(values) - 1)]
    for first, last in parts:
        if last - first > 1:
            middle = (first + last) // 2
            converge_at(reduced, [values[middle]], tolerance=between, left=left)
            parts += [(first, middle), (middle, last)]


@dataclass(frozen=True)
class Unbalanced:
    """What eigenpairs at one μ leave: the largest backward error of those looked at, λ (k,) of those that are exact,
    forces (n, l) against their inertia forces and, of left vectors, slips (m, j) that must open the gaps."""

    error: float
    exact: ComplexArray
    forces: Array
    openings: Array


def unbalanced(
    reduced: Reduced, mu: float, tolerance: float, *, left: bool = False, exact: ComplexArray | None = None
) -> Unbalanced:
    """What the band's eigenpairs at ``mu`` that are not exact leave unbalanced. Those that were ``exact`` (k,) on a
    smaller basis are looked at again where the others leave nothing."""
    found = reduced.untracked(mu)
    chosen = wanted(reduced, found)
    known = np.zeros(len(chosen), dtype=bool)
    if exact is not None and len(exact):
        values = found.values[chosen]
        known = np.abs(values[:, None] - exact).min(axis=1) <= SAME * np.abs(values)
    rest = _left_by(reduced, found, chosen[~known], tolerance, left=left)
    if rest.forces.shape[1] or rest.openings.shape[1] or not known.any():
        return replace(rest, exact=np.concatenate([rest.exact, found.values[chosen[known]]]))
    again = _left_by(reduced, found, chosen[known], tolerance, left=left)
    return replace(again, error=max(rest.error, again.error), exact=np.concatenate([rest.exact, again.exact]))


def _left_by(reduced: Reduced, found: Eigenpairs, chosen: IntArray, tolerance: float, *, left: bool) -> Unbalanced:
    """What some of the eigenpairs leave unbalanced."""
    problem, mu = reduced.problem, found.mu
    lam = found.values[chosen]
    u, p = reduced.expand(found.right[:, chosen])
    pencil = problem.pencil(mu)
    rest = pencil.residual(lam, u, p)
    error = pencil.backward_error(lam, u, p, rest=rest)
    force, inexact = _relative(reduced, rest, lam, u, error > tolerance)
    forces: list[Array] = [force]
    openings: list[Array] = [np.zeros((problem.nodes, 0))]
    if left:
        y, q = left_vectors(reduced, lam, found.left[:, chosen], mu)
        left_rest = pencil.transposed.residual(lam, y, q)
        left_error = pencil.transposed.backward_error(lam, y, q, rest=left_rest)
        wrong = left_error > tolerance
        force, more = _relative(reduced, left_rest, lam, y, wrong)
        forces.append(force)
        openings.append(real_columns(times(problem.slide, y[:, wrong])))
        error, inexact = np.maximum(error, left_error), inexact | more
    return Unbalanced(float(error.max(initial=0.0)), lam[~inexact], np.hstack(forces), np.hstack(openings))


def _relative(
    reduced: Reduced, rest: ComplexArray, lam: ComplexArray, u: ComplexArray, inexact: BoolArray
) -> tuple[Array, BoolArray]:
    """Residuals (n, k) over the pairs' inertia forces, of those that are inexact or large against them; which are."""
    weight = lumped(reduced.problem)[:, None]
    inertia = (np.abs(lam) ** 2 + reduced.shifted.shift) * np.linalg.norm(np.sqrt(weight) * u, axis=0)
    size = np.linalg.norm(rest / np.sqrt(weight), axis=0) / tiny(inertia)
    chosen = inexact | (size > LARGEST_REST)
    return real_columns(rest[:, chosen] / tiny(inertia[chosen])), chosen


def left_vectors(reduced: Reduced, lam: ComplexArray, w: ComplexArray, mu: float) -> tuple[ComplexArray, ComplexArray]:
    """y (n, k) of unit norm and q (m, k) of left vectors: −(N + μS) y / c, where rigid what fits the equations best."""
    problem = reduced.problem
    y = reduced.expand_left(w)
    pencil = problem.pencil(mu).transposed
    q = np.zeros((problem.nodes, len(lam)), dtype=complex)
    soft = problem.compliance > 0
    q[soft] = -times(pencil.normal, y)[soft] / problem.compliance[soft, None]
    if not soft.all() and len(lam):
        q[~soft] = fitted(pencil.push[~soft], pencil.residual(lam, y, q))
    return y, q


def fitted(rows: Sparse, rest: ComplexArray) -> ComplexArray:
    """Forces (m, k) on rows (m, n) that come closest to ``rest`` (n, k): least squares by the normal equations."""
    with factorise(sp.csr_array(rows @ rows.T), symmetric=True) as factor:
        return factor.solve(times(rows, rest))

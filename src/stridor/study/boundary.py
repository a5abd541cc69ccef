"""Stability boundaries over two numbers of a case without a grid: what is traced is μ_c(p), not λ(p).

From onsets on a few lines the curves Re λ(x, y) = 0 are followed by continuation, each by its own eigenpair
(E. L. Allgower, K. Georg, Introduction to Numerical Continuation Methods, SIAM 2003; W. Govaerts, Numerical Methods for
Bifurcations of Dynamical Equilibria, SIAM 2000), where nothing dissipates the exceptional points at which two modes
meet.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import numpy as np

from ..asking import FUNCTION, NUMBER, TEXT, WHOLE, takes
from ..case.matrix_checks import MU
from ..errors import AnalysisError, CaseError
from ..modal.boundary import Found, StabilityCurve, boundaries
from ..modal.parametric import ReducedModel
from ..threads import one_thread
from ..typing import Array, IntArray
from .asked import require_friction, require_range
from .boundary_again import corners_in_full, position_error, solved_again
from .boundary_counts import CountedAt
from .boundary_problem import BoundaryAsked, Method, plane_of, solved_problem
from .boundary_result import Boundary, BoundaryCurve
from .boundary_words import sentence, told
from .options import options_of
from .provenance import provenance
from .workspace import Problem, Workspace

BESIDE = 1e-4  # of the ranges: how far beside a curve the others are counted
INSIDE = 1e-9  # of the ranges: how far inside the rectangle at least


@takes(
    x=TEXT, y=TEXT, max_frequency_hz=NUMBER.or_none(), bound=NUMBER, tolerance=NUMBER, lines=WHOLE, progress=FUNCTION
)
@one_thread
def stability_boundary(
    problem: Problem,
    x: str,
    y: str,
    *,
    x_range: tuple[float, float] | Sequence[float],
    y_range: tuple[float, float] | Sequence[float],
    max_frequency_hz: float | None = None,
    method: Method = "auto",
    bound: float = 1e-8,
    tolerance: float = 1e-3,
    lines: int = 5,
    progress: Callable[[int, int], None] | None = None,
) -> Boundary:
    """Where modes begin to grow over two numbers of a case: curves with frequency, and how many modes grow beside them.

    x, y: paths of numbers as in an override, names of [parameters], "contact_stiffness", or "mu"; where neither is, μ
    is the case's own. tolerance: how far the cubic pieces between the points of a curve may be off, in shares of the
    ranges. lines: on how many values of x and of y onsets are sought; closed curves between them may be missed, as the
    result says. method: "reduced" takes a reduced model over x and y, whose eigenvalues are within ``bound`` of the
    full ones by its own estimate, and solves some points again in the full problem; "full" takes the whole matrices,
    up to 400 freedoms; "auto" the latter for up to 60. The nodes that touch are those of the case as it is.

    progress: called with lines done and planned. Raises CaseError for what is no number or no range, AnalysisError
    where matrices depend on the numbers in no simple way or friction jams.
    """
    started = time.perf_counter()
    work = Workspace.of(problem)
    case = work.case("a stability boundary")
    ends = require_range(x_range, "x_range"), require_range(y_range, "y_range")
    for path, (_, high), where in zip((x, y), ends, ("x_range", "y_range"), strict=True):
        if path == MU and high > 0.0:
            require_friction(high, where)
    asked = BoundaryAsked((x, y), ends, method, bound, tolerance, lines)
    asked.check(case)
    top = case.modal.max_frequency_hz if max_frequency_hz is None else float(max_frequency_hz)
    if not (np.isfinite(top) and top > 0):
        raise CaseError("max_frequency_hz", top, "a highest frequency is a finite number > 0 [Hz]")
    solved = solved_problem(case, asked, top)
    plane, notes = plane_of(solved, ends)
    found = boundaries(plane, tolerance, lines, progress)
    again, failed = solved_again(found, solved.problem, solved.vectors, options_of(case).solver)
    held = corners_in_full(found, solved.model, options_of(case).solver)
    curves = tuple(_curve(found, curve, solved.model) for curve in found.curves)
    result_notes, warnings = told(found, asked.paths, solved, again, failed, tolerance)
    elsewhere = bool(getattr(solved.problem, "elsewhere", ()))
    return Boundary(
        x, y, *ends, top, curves, *_lines(found), _counted(found), found.agree and held.holds and not elsewhere,
        sentence(found, asked.paths, held, elsewhere=elsewhere),
        "full" if solved.model is None else "reduced", len(plane.sizes), plane.solves, plane.steps,
        0 if solved.model is None else solved.model.solves, again, (*solved.notes, *notes, *result_notes),
        (*solved.problem.idle_words, *warnings, *(work.one_for_all if MU in (x, y) else ())),
        provenance(work, "boundary", time.perf_counter() - started, method=method, bound=bound, tolerance=tolerance),
    )  # fmt: skip


def _curve(found: Found, curve: StabilityCurve, model: ReducedModel | None) -> BoundaryCurve:
    """A curve in the units of x and y, with how many modes grow on both sides of each point."""
    plane = found.plane
    width = plane.high - plane.low
    x, y = (plane.low + width * curve.points).T
    tangent = curve.headings * width
    error = np.array([np.nan if model is None else position_error(model, plane, s) for s in curve.spots])
    return BoundaryCurve(
        x, y, curve.omega / (2 * np.pi), tangent[:, 0], tangent[:, 1], curve.sides, _beside(found, curve),
        "divergence" if curve.kind == "standstill" else "flutter", curve.closed, curve.ends,
        np.array([s.residual for s in curve.spots]), error, curve.deviation, curve.unchecked,
    )  # fmt: skip


def _beside(found: Found, curve: StabilityCurve) -> IntArray:
    """How many modes grow on the calmer side of each point (k,)."""
    numbers = np.zeros(len(curve.spots), dtype=np.int64)
    if not found.looked:
        return numbers
    for k, spot in enumerate(curve.spots):
        calm = spot.p - BESIDE * spot.gradient / np.hypot(*spot.gradient)
        # Curves end at the edge: beyond it a way would go round them.
        calm = np.clip(calm, INSIDE, 1.0 - INSIDE)
        modes, roots, _ = found.said(calm)
        # Roots are certain. Of two or more it takes their values to say whether they are pairs.
        numbers[k] = max(_modes_at(found, calm, roots, modes) if found.parts and roots >= 2 else modes, 0)
    return numbers


def _modes_at(found: Found, p: Array, roots: int, otherwise: int) -> int:
    """How many modes so many growing roots (n) at a point (2,) are; what else is said where it shows other ones."""
    try:
        count = found.plane.count(found.plane.modes(p))
    except AnalysisError:
        return otherwise
    return count.modes if count.roots == roots else otherwise


def _lines(found: Found) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Values of x and of y on whose lines onsets were sought."""
    plane = found.plane
    values = [
        sorted(float(plane.low[axis] + line.value * (plane.high - plane.low)[axis])
               for line in found.lines if line.axis == axis)
        for axis in (0, 1)
    ]  # fmt: skip
    return tuple(values[0]), tuple(values[1])


def _counted(found: Found) -> tuple[CountedAt, ...]:
    plane = found.plane
    places = [(plane.low + (plane.high - plane.low) * at.p, at.count) for at in found.looked]
    return tuple(CountedAt(float(p[0]), float(p[1]), count.modes, count.roots) for p, count in places)

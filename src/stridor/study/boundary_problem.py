"""What is solved for a stability boundary: a reduced model over both numbers, or the whole matrices."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np

from ..case import Case
from ..errors import AnalysisError, CaseError, Problem
from ..modal.boundary import Plane
from ..modal.parametric import ParametricProblem, ReducedModel
from ..modal.quadratic.reach import searched_in
from ..system import build_system
from ..typing import Array
from .damping_reduced import FRICTION, box_name
from .reduced import MOST, SMALL, parametric_problem, reduced_model
from .sensitivities import number_at

Method = Literal["auto", "reduced", "full"]
BESIDE = 1e-4  # of a range: how far from an end without any damping curves begin


@dataclass(frozen=True)
class BoundaryAsked:
    """What was asked for."""

    paths: tuple[str, str]
    ends: tuple[tuple[float, float], tuple[float, float]]
    method: Method
    bound: float
    tolerance: float
    lines: int

    def check(self, case: Case) -> None:
        """Raises CaseError for what does not hold together."""
        if self.method not in get_args(Method):
            raise CaseError("method", self.method, f"one of {', '.join(get_args(Method))}")
        if not 1e-6 <= self.tolerance <= 0.05:
            raise CaseError("tolerance", self.tolerance, "a share of the ranges from 1e-6 to 0.05")
        if not 2 <= self.lines <= 100:
            raise CaseError("lines", self.lines, "from 2 to 100 values of each number")
        if self.paths[0] == self.paths[1]:
            raise CaseError("y", self.paths[1], "the same number as x; give another one")
        for path in self.paths:
            if path not in (FRICTION, "contact_stiffness") and path not in case.parameters:
                number_at(case, path)


@dataclass(frozen=True)
class PlaneProblem:
    """The problem over x and y (names as a box calls them), its dense terms (t, r, r), and the basis (n, r) and model
    that they are of; None: all freedoms."""

    problem: ParametricProblem
    names: tuple[str, str]
    terms: Array
    vectors: Array | None
    model: ReducedModel | None
    top: float
    notes: tuple[str, ...]


def solved_problem(case: Case, asked: BoundaryAsked, top: float) -> PlaneProblem:
    """What is solved up to top [Hz]. Raises CaseError and AnalysisError where neither a reduced model nor the full
    problem serves."""
    try:
        return _solved(case, asked, top)
    except CaseError as error:
        # A range of a box is one of x or y here.
        asked_as = {f"box.{box_name(case, path)}": (axis, path) for axis, path in zip("xy", asked.paths, strict=True)}
        problems: list[Problem] = []
        for problem in error.problems:
            axis, path = asked_as.get(problem.where, (problem.where, problem.given))
            problems.append(replace(problem, where=axis, given=path if problem.given is None else problem.given))
        raise CaseError.many(problems) from error


def _solved(case: Case, asked: BoundaryAsked, top: float) -> PlaneProblem:
    names = box_name(case, asked.paths[0]), box_name(case, asked.paths[1])
    box = dict(zip(names, asked.ends, strict=True))
    freedoms, method = build_system(case).size, asked.method
    if method == "auto":
        method = "full" if freedoms <= SMALL else "reduced"
    if method == "full" and freedoms > MOST:
        raise CaseError("method", "full", f"for up to {MOST} freedoms, and the case has {freedoms}; take reduced")
    why: tuple[str, ...] = ()
    if method == "reduced":
        try:
            model = reduced_model(case, box, max_frequency_hz=top, bound=asked.bound, whole=False)
            notes = tuple(getattr(model.problem, "notes", ()))
            return PlaneProblem(model.problem, names, model.projected, model.vectors, model, model.searched, notes)
        except AnalysisError as error:
            if asked.method == "reduced" or freedoms > MOST:
                raise
            why = (f"all is solved in the full problem, there is no reduced model: {error}",)
    whole = parametric_problem(case, box)
    terms = np.array([term.matrix.toarray() for term in whole.terms])
    searched = searched_in([whole.at(point) for point in whole.sampled], 2 * np.pi * top)
    return PlaneProblem(whole, names, terms, None, None, searched, (*whole.notes, *why))


def plane_of(
    solved: PlaneProblem, ends: tuple[tuple[float, float], tuple[float, float]]
) -> tuple[Plane, tuple[str, ...]]:
    """The rectangle, without ends at which nothing is damped while it is elsewhere, and what is to be said of that."""
    low, high = np.array(ends, dtype=float).T
    whole = Plane(solved.problem, solved.terms, solved.names, solved.problem.reference, solved.top, low, high)
    if whole.reversible:
        return whole, ()
    notes: list[str] = []
    own_low, own_high = low.copy(), high.copy()
    for axis in (0, 1):
        for value, end, moved, sign in ((0.0, low, own_low, 1), (1.0, high, own_high, -1)):
            if whole.line(axis, value).reversible:
                moved[axis] = end[axis] + sign * BESIDE * (high - low)[axis]
                notes.append(
                    f"nothing is damped at {solved.names[axis]} = {end[axis]:g}, where onsets are not the limit of "
                    f"little damping: curves are traced up to {moved[axis]:.6g}"
                )
    if not notes:
        return whole, ()
    point = solved.problem.reference
    return Plane(solved.problem, solved.terms, solved.names, point, solved.top, own_low, own_high), tuple(notes)

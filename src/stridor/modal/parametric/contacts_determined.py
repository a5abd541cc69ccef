"""Whether rigid contact determines the motion in all of a box of parameters (`modal.painleve`).

What is judged is the masses. Where the parameters change them the box is looked at on a grid, and along a single one
the value at which that begins or ends is enclosed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import pairwise

import numpy as np

from ...errors import AnalysisError
from ...typing import Sparse
from ..painleve import REACHED, singular_from, undetermined
from .problem import CORNERS, Parameter, ParametricProblem, Term

COUNTS = {0: 1, 1: 9, 2: 5, CORNERS: 3}  # of values along each of so many parameters that change the mass
ENCLOSED = 1e-7  # of the range
ALIKE = 1e-9  # of the least μ: rounding

Values = Mapping[str, float]


def refuse_undetermined_in(
    terms: tuple[Term, ...],
    parameters: tuple[Parameter, ...],
    rows: tuple[Sparse, Sparse],
    friction: Parameter | None,
    own: float | None,
    solver: str | None,
) -> None:
    """Raise AnalysisError where rigid contacts with rows (N, S) (m, n) do not determine the motion with the mass of the
    terms (n, n) somewhere in the box.

    friction: μ where it is a parameter; else S has each contact's own in it, and ``own`` is that of all (None: they
    differ).
    """
    masses = tuple(term for term in terms if term.role == "mass")
    problem = ParametricProblem(masses, parameters)
    idle = problem.idle
    moving = tuple(p for p in parameters if p.name not in idle)
    # At the values of the box that are not varied here the factors are what they are anywhere.
    reference = problem.reference
    own_scale = 1.0 if own is None or friction is not None else own

    def limit(values: Values) -> float:
        return singular_from(problem.at({**reference, **values}).mass, *rows, solver) * own_scale

    def reached(values: Values) -> float:
        return own_scale if friction is None else values.get(friction.name, friction.high)

    def beyond(values: Values) -> bool:
        return limit(values) <= reached(values) * (1 + REACHED)

    points = _points(problem, moving)
    limits = np.array([limit(point) for point in points])
    bad = [least <= reached(point) * (1 + REACHED) for least, point in zip(limits, points, strict=True)]
    if not any(bad):
        return
    others = tuple(p for p in moving if friction is None or p.name != friction.name)
    if friction is None and len(moving) == 1 and not all(bad):
        raise AnalysisError(_along(moving[0], points, bad, beyond, own))
    least = int(np.argmin(np.where(bad, limits, np.inf)))
    # A mass may change without what the contacts see of it, as in proportion.
    told = np.ptp(limits) > ALIKE * limits[least] if np.isfinite(limits).all() else True
    where = ", ".join(f"{p.name} = {points[least][p.name]:.6g}" for p in others) if told else ""
    where = f" (at {where})" if where else ""
    if friction is None and own is None:
        raise AnalysisError(_own_friction(float(limits[least]), where))
    raise AnalysisError(undetermined(float(limits[least]), where))


def _points(problem: ParametricProblem, moving: tuple[Parameter, ...]) -> list[dict[str, float]]:
    """Values of the parameters that change the mass, ends and corners among them."""
    if not moving:
        return [{}]
    if len(moving) > CORNERS:
        # Both ends of all, the middle, and the ends of each alone.
        places = [{p.name: p.low + share * (p.high - p.low) for p in moving} for share in (0.0, 0.5, 1.0)]
        middle = places[1]
        return places + [{**middle, p.name: end} for p in moving for end in (p.low, p.high)]
    grid = ParametricProblem(problem.terms, moving).corners([COUNTS[len(moving)]] * len(moving))
    return [{p.name: point[p.name] for p in moving} for point in grid]


def _along(
    number: Parameter, points: list[dict[str, float]], bad: list[bool], beyond: Callable[[Values], bool],
    own: float | None,
) -> str:  # fmt: skip
    """What is said of a single number of the case beyond some value of which it is so."""
    name, ends = number.name, []
    for (one, first), (two, second) in pairwise(zip(points, bad, strict=True)):
        if first != second:
            good, worse = (two[name], one[name]) if first else (one[name], two[name])
            while abs(worse - good) > ENCLOSED * (number.high - number.low):
                middle = (good + worse) / 2
                good, worse = (good, middle) if beyond({name: middle}) else (middle, worse)
            ends.append(worse)
    first, last = points[0][name] if bad[0] else ends[0], points[-1][name] if bad[-1] else ends[-1]
    at = "the friction of the case" if own is None else f"μ = {own:.6g}, the friction of the case"
    return (
        f"an eigenvalue grows beyond all bounds at {name} = {ends[0]:.6g} with {at}: rigid contact with friction does "
        f"not determine the motion (Painlevé's paradox) for {name} from {first:.6g} to {last:.6g}; take a range "
        "outside it, less friction, or give the contact a stiffness"
    )


def _own_friction(factor: float, where: str) -> str:
    return (
        f"an eigenvalue grows beyond all bounds at {factor:.6g} times the friction of the case{where}: from there on "
        "rigid contact with friction no longer determines the motion (Painlevé's paradox); take less friction, or give "
        "the contact a stiffness"
    )

"""The full problem asked for modes that a basis lacks, at a few points of the box.

A basis grows out of real modes of a symmetric part, by the residuals of its own modes. Modes that friction, circulation
or gyroscopic terms bring down into the band from above are none of these at first, and where the basis has no mode at a
point there is no residual either: nothing that is measured on the basis can tell. What the full problem

    λ²M(p) + λD(p) + K(p)

has at a point is found with nothing but these matrices (`quadratic.find_modes`); modes that are not on the basis join
it, from both sides.
"""

from __future__ import annotations

import numpy as np

from ...errors import AnalysisError
from ...stages import passing, stage
from ...typing import Array, ComplexArray, IntArray
from ..at_rest import SLOW, rest_limit
from ..quadratic import Quadratic, Region, RegionModes, find_modes
from ..quadratic.polish import pairs
from ..tolerances import AFFORDABLE
from .basis import real_and_imaginary
from .greedy import GUARD, Greedy, Point
from .problem import CORNERS, ParametricProblem

SMALL = 3000  # freedoms up to which the middle and the corners are asked, whatever the basis has there
DECAY = 0.01  # of the band: modes that decay faster are asked for only where the basis has none at all
NEAR = 1e-3  # of the band: eigenvalues further apart are not the same mode
ROUNDS = 5  # of asking at one point


@passing()
def complete(greedy: Greedy, grid: list[Point], *, sure: bool, solver: str | None) -> None:
    """Modes of the full problem that the basis lacks, taken in until it lacks none where that is asked.

    It is asked at the middle and the corners of the box, of small problems at all points of the grid, wherever the
    basis has no mode of the band; of small problems at the middle and the corners in any case, unless whoever uses the
    model counts in the full problem (not ``sure``). grid: points at which every mode passes, which they do again after
    that. Raises AnalysisError where they do not.
    """
    problem = greedy.problem
    if problem.size > AFFORDABLE:
        return
    small, points, places = problem.size <= SMALL, list(grid), _places(problem)
    for k, point in enumerate([*places, *(p for p in grid if small and p not in places)]):
        always = sure and small and k < len(places)
        for number in range(ROUNDS):
            # Once, what may come down into the band between the points that are asked.
            lacking = _lacking(greedy, point, always=always, above=not number, solver=solver)
            if lacking is None:
                break
            stage("reduced model: modes of the full problem join the basis")
            shapes, inside = lacking
            if not greedy.add(shapes):
                if inside:
                    raise AnalysisError("the reduced model has a mode of the full problem on its basis and not its λ")
                break
            points = [*points, point]
            greedy.passed.clear()
            greedy.enrich(points)
        else:
            raise AnalysisError("the reduced model lacks modes of the full problem; ask for a smaller box")


def _places(problem: ParametricProblem) -> list[Point]:
    """The middle and the corners, of many parameters two that lie opposite."""
    if len(problem.parameters) <= CORNERS:
        ends = problem.corners([2] * len(problem.parameters))
    else:
        ends = [{p.name: value for p, value in zip(problem.parameters, side, strict=True)}
                for side in zip(*((p.low, p.high) for p in problem.parameters), strict=True)]  # fmt: skip
    return [problem.reference, *ends]


def _lacking(
    greedy: Greedy, point: Point, *, always: bool, above: bool, solver: str | None
) -> tuple[Array, bool] | None:
    """Real columns (n, k) of modes of the full problem at a point, right and left, that the basis lacks, and whether
    one of them is in the band; None where it has them all, and where they are not asked for. above: where the basis has
    no mode, those a little above the band as well."""
    top = greedy.frequency
    empty = not np.any(np.abs(greedy.known(point)) <= top)
    if not (empty or always):
        return None
    ours = greedy.values(point)
    whole, decay = greedy.problem.at(point), 1.0 if empty else DECAY
    reach = GUARD * top if empty and above else top
    found = _found(whole, reach, decay, left=False, solver=solver)
    greedy.work.solves += 0 if found is None else found.solves
    if found is None or not len(_fresh(whole, found.values, ours, reach, solver)):
        return None
    both = _found(whole, reach, decay, left=True, solver=solver)
    if both is None or both.left is None:
        return None
    greedy.work.solves += both.solves
    fresh = _fresh(whole, both.values, ours, reach, solver)
    shapes = np.hstack([real_and_imaginary(side[:, fresh]) for side in (both.right, both.left)])
    return shapes, bool(np.any(np.abs(both.values[fresh]) <= top))


def _found(problem: Quadratic, reach: float, decay: float, *, left: bool, solver: str | None) -> RegionModes | None:
    """Modes up to reach [1/s] that decay no faster than a share of it; of slower decay where those are not found, and
    None where these are not either."""
    for share in dict.fromkeys((decay, min(decay, DECAY))):
        region = Region.band(0.0, reach / (2 * np.pi), above=-share * reach)
        try:
            return find_modes(problem, region, left=left, solver=solver, count=False)
        except AnalysisError:
            continue
    return None


def _fresh(problem: Quadratic, values: ComplexArray, ours: ComplexArray, top: float, solver: str | None) -> IntArray:
    """Places (k,) of eigenvalues of the band that are none of ours; motions as a whole are not judged."""
    size = np.abs(values)
    limit = rest_limit([problem], top, solver) if np.any(size <= SLOW * top) else 0.0
    judged = np.flatnonzero((size <= top) & (size > limit))
    mine, _ = pairs(values[judged], ours, NEAR * top)
    return np.delete(judged, mine)

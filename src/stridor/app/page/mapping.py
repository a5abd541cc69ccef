"""Inside of the process of a stability map: curves first coarse and then finer, or a grid where none can be traced."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import AnalysisError, CaseError
from ...study.analyses import modes
from ...study.boundary import stability_boundary
from ...study.workspace import Workspace
from ...typing import Array

if TYPE_CHECKING:
    from ...study.boundary_result import Boundary

LINES = (2, 3, 5, 9)  # on which onsets are sought, more each time
CELLS = 150  # of the shading beside the curves, along each number
GRIDS = (5, 9, 17, 33)  # values of each number where curves cannot be traced
FRICTION = "mu"
UNKNOWN = -1  # in place of how many grow


def mapped(tell: Callable[[str, Any], None], work: Workspace, options: Mapping[str, Any]) -> str:
    """Tell of ever finer maps ("map"); returns what is to be said at the end. options: x and y (paths or "mu"), x_range
    and y_range."""
    try:
        return _traced(tell, work, options)
    except AnalysisError as error:
        tell("log", f"no curves can be traced: {error}; a grid is solved instead")
        return _solved_on_grids(tell, work, options, str(error))


def _traced(tell: Callable[[str, Any], None], work: Workspace, options: Mapping[str, Any]) -> str:
    sentence = ""
    for lines in LINES:
        tell("log", f"onsets on {lines} lines of either number")
        found = stability_boundary(
            work, options["x"], options["y"], x_range=options["x_range"],
            y_range=options["y_range"], lines=lines,
        )  # fmt: skip
        tell("map", _curves(found))
        sentence = " ".join([found.sentence, *found.warnings])
    return sentence


def _curves(found: Boundary) -> dict[str, Any]:
    (x0, x1), (y0, y1) = found.x_range, found.y_range
    middles = (np.arange(CELLS) + 0.5) / CELLS
    xs, ys = x0 + (x1 - x0) * middles, y0 + (y1 - y0) * middles
    curves = [
        {"x": x.tolist(), "y": y.tolist(), "frequency_hz": float(np.median(f)), "kind": c.kind}
        for c, (x, y, f) in zip(found.curves, found.polylines(), strict=True)
    ]
    table, known = found.shading(xs, ys)
    counts = np.where(known, table, UNKNOWN).tolist()
    return {"xs": xs.tolist(), "ys": ys.tolist(), "counts": counts, "curves": curves}


def _solved_on_grids(
    tell: Callable[[str, Any], None], work: Workspace, options: Mapping[str, Any], why: str
) -> str:
    known: dict[tuple[float, float], int] = {}
    failures: dict[str, int] = {}
    count = 0
    for count in GRIDS:
        xs, ys = (np.linspace(low, high, count) for low, high in (options["x_range"], options["y_range"]))
        tell("log", f"modes on a grid of {count} × {count}")
        for point, number, error in _counts(work, options, xs, ys, known):
            known[point] = number
            if error:
                failures[error] = failures.get(error, 0) + 1
        counts = [[known[float(x), float(y)] for y in ys] for x in xs]
        grid = {"xs": xs.tolist(), "ys": ys.tolist(), "counts": counts, "curves": []}
        tell("map", grid)
    said = (
        f"A grid of {count} × {count} solves, not checked against anything; what lies between its points is not known. "
        f"No curves: {why}."
    )
    for error, number in failures.items():
        said += f" {number} points have no modes: {error}."
    return said


def _counts(
    work: Workspace, options: Mapping[str, Any], xs: Array, ys: Array, known: Mapping[tuple[float, float], int]
) -> Iterator[tuple[tuple[float, float], int, str]]:
    """How many modes grow at the points of a grid that are not known yet, `UNKNOWN` without modes; and why."""
    case, paths = work.case("a stability map"), (options["x"], options["y"])
    # All μ of one row are solved together.
    along = paths.index(FRICTION) if FRICTION in paths else 0
    rows, columns = (ys, xs) if along == 0 else (xs, ys)
    for value in rows.tolist():
        points = [(float(c), value) if along == 0 else (value, float(c)) for c in columns.tolist()]
        points = [p for p in points if p not in known]
        if not points:
            continue
        try:
            varied = case.with_({paths[1 - along]: value})
            if FRICTION in paths:
                found = modes(varied, [p[along] for p in points], check=False)
                numbers = found.counts(np.count_nonzero(found.unstable & found.in_band, axis=1))
            else:
                numbers = [_unstable(varied.with_({paths[along]: p[along]})) for p in points]
            # Without steady sliding there are no modes, and nothing that is stable.
            yield from (
                (p, UNKNOWN, "there is no steady sliding") if n is None else (p, n, "")
                for p, n in zip(points, numbers, strict=True)
            )
        except (CaseError, AnalysisError) as error:
            yield from ((p, UNKNOWN, str(error)) for p in points)


def _unstable(case: Any) -> int:
    found = modes(case, check=False)
    return int(np.count_nonzero(found.unstable & found.in_band))

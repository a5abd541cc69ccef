"""What a stability boundary says of itself: what was checked, what came of it, and what is open."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..modal.boundary import Found
from ..modal.full.held_in_full import HeldInFull
from ..modal.full.parametric_onsets import ELSEWHERE
from ..modal.growing import UNCHECKED
from ..notebook import counted
from .boundary_problem import PlaneProblem
from .boundary_result import SolvedAgain

MOST_TOLD = 3
LEFT_OPEN = "closed curves that lie between the lines can be missing"


def sentence(found: Found, paths: tuple[str, str], held: HeldInFull, *, elsewhere: bool = False) -> str:
    """Whether lines, curves and counts fit together, and what that does not say. held: what the full problem says of a
    reduced model at the corners; elsewhere: whether other nodes touch at some values than those that are held."""
    if elsewhere:
        return f"Not complete: {ELSEWHERE}. With the nodes that are held: {sentence(found, paths, held)}"
    if held.why:
        return f"{UNCHECKED}: {held.why}. On the model: {sentence(found, paths, HeldInFull())}"
    on = " and ".join(f"{sum(line.axis == axis for line in found.lines)} of {path}" for axis, path in enumerate(paths))
    where = f"Onsets were sought on lines at {on} (at most {_mesh(found)} of a range apart) and modes counted at "
    where += counted(len(found.looked), "point")
    if found.agree:
        fit = "every onset lies on a curve, every curve that crosses a line does so at an onset, and counts are those "
        full = "At the corners the full problem has the same growing modes, sought anew there. " if held.amiss else ""
        return f"{where}: {fit}that the curves say. {full}Not excluded: {LEFT_OPEN}."
    wrong = _wrong(found, paths)
    listed = "; ".join(wrong[:MOST_TOLD]) + (f"; {len(wrong) - MOST_TOLD} more" if len(wrong) > MOST_TOLD else "")
    return f"{where}. Not all of that fits together: {listed}. More lines may help, or smaller ranges."


def _wrong(found: Found, paths: tuple[str, str]) -> list[str]:
    plane = found.plane

    def at(p: Sequence[float]) -> str:
        x, y = plane.low + np.asarray(p) * (plane.high - plane.low)
        return f"{paths[0]} = {x:.5g}, {paths[1]} = {y:.5g}"

    wrong = [f"{words} at {at(p.tolist())}" for words, p in found.wrong]
    for line in found.lines:
        if not line.complete:
            value = plane.low[line.axis] + line.value * (plane.high - plane.low)[line.axis]
            why = f" ({line.why})" if line.why else ""
            wrong.append(f"onsets at {paths[line.axis]} = {value:.5g} may not be all{why}")
    for curve in found.curves:
        lost = [p for p, end in zip((curve.points[0], curve.points[-1]), curve.ends, strict=True) if end == "lost"]
        wrong += [f"a curve could not be followed beyond {at(p.tolist())}" for p in lost]
    unchecked = sum(curve.unchecked for curve in found.curves)
    if unchecked:
        wrong.append(f"{counted(unchecked, 'piece')} of curves without a check in the middle")
    return wrong


def _mesh(found: Found) -> str:
    """The widest gap between two lines, of a range."""
    gaps = [np.diff(sorted({line.value for line in found.lines if line.axis == axis})).max() for axis in (0, 1)]
    return f"{100 * float(max(gaps)):.3g} %"


def told(
    found: Found, paths: tuple[str, str], solved: PlaneProblem, again: Sequence[SolvedAgain], failed: int,
    tolerance: float,
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Notes on how it was done, and warnings."""
    plane, notes, warnings = found.plane, list[str](), list[str]()
    what = "the full problem" if solved.model is None else "a reduced model"
    cost = f"{plane.solves} eigenvalue problems and {plane.steps} factorisations"
    notes.append(f"{counted(len(found.curves), 'curve')} from {cost} of {what} of {len(plane.sizes)} unknowns")
    if found.curves:
        off = max((c.deviation for c in found.curves if np.isfinite(c.deviation)), default=0.0)
        said = f"{100 * off:.2g} % of the ranges of the cubic between them"
        notes.append(f"points solved in the middle of two others lie within {said}")
        if off > tolerance:
            warnings.append(f"a curve is off its cubic by {off:.1e} of the ranges, where {tolerance:g} was asked for")
    if again:
        off, rest = max(c.difference for c in again), max(c.residual for c in again)
        notes.append(
            f"{counted(len(again), 'point')} of the curves solved again in the full problem: off by {off:.1e} of the "
            f"ranges at most, backward error {rest:.1e}"
        )
    if failed:
        warnings.append(f"{counted(failed, 'point')} of the curves not found again in the full problem")
    if found.passing:
        notes.append(
            "growing modes pass the highest frequency: their number changes where no curve is, which was counted on a "
            "mesh and is known but for strips that the figure hatches"
        )
    if plane.reversible and found.curves:
        notes.append(
            f"nothing is damped: flutter begins where two modes meet, and little damping of any kind may move "
            f"that boundary over {paths[0]} and {paths[1]} by much"
        )
    return tuple(notes), tuple(warnings)

"""Points of a boundary held against the full problem: what a reduced model is estimated to be off, and what it is."""

from __future__ import annotations

import numpy as np

from ..errors import AnalysisError
from ..modal.boundary import Found, Plane, StabilityCurve
from ..modal.boundary.spot import CurvePoint
from ..modal.dense_problem import combined
from ..modal.full.held_in_full import HeldInFull, Listed, held_in_full
from ..modal.full.line import ParameterLine
from ..modal.full.passages import quiet
from ..modal.newton import Root, crossing, meeting, standstill
from ..modal.options import Options
from ..modal.parametric import ParametricProblem, ReducedModel
from ..modal.parametric.model import sketched
from ..typing import Array
from .boundary_result import SolvedAgain

AROUND = 1e-3  # of a range: where a point is sought again
AT_RANDOM = 2  # of all curves
MOST = 12  # points


def position_error(model: ReducedModel, plane: Plane, spot: CurvePoint) -> float:
    """How far the model is estimated to put a point off, in shares of the ranges: what it is estimated to be off in λ
    [1/s] over the slope of the growth. NaN where two undamped modes meet or one comes to rest, whose λ is double."""
    if spot.kind != "crossing":
        return float("nan")
    lam, problem = 1j * spot.omega, model.problem
    factors, (mass, damping, _) = problem.factors(plane.values(spot.p)), plane.matrices(spot.p)
    values, z, w = np.array([lam]), spot.right[:, None], spot.left[:, None]
    left_over = [
        float(sketched(sketch, factors, problem.powers, values, v)[0])
        for sketch, v in ((model.right_sketch, z), (model.left_sketch, w))
    ]
    slope = abs(spot.left @ (2 * lam * (mass @ spot.right) + damping @ spot.right))
    return float(model.constant * left_over[0] * left_over[1] / (slope * np.hypot(*spot.gradient)))


def solved_again(
    found: Found, problem: ParametricProblem, vectors: Array | None, solver: str | None
) -> tuple[tuple[SolvedAgain, ...], int]:
    """Ends, extreme points and a few others of the curves, solved in the full problem; and how many of them were not
    found there."""
    plane, done, failed = found.plane, list[SolvedAgain](), 0
    for number, k in _chosen(found.curves):
        spot = found.curves[number].spots[k]
        again = _again(plane, problem, vectors, spot, solver)
        if again is None:
            failed += 1
            continue
        off, residual = again
        x, y = (plane.low + (plane.high - plane.low) * spot.p).tolist()
        done.append(SolvedAgain(number, x, y, off, residual))
    return tuple(done), failed


def corners_in_full(found: Found, model: ReducedModel | None, solver: str | None) -> HeldInFull:
    """What the full problem says of the modes that grow on a reduced model at the corners of the rectangle; where it
    differs is added to what is wrong."""
    plane = found.plane
    if model is None:
        return HeldInFull()
    corners = [np.array([x, y]) for x in (0.0, 1.0) for y in (0.0, 1.0)]
    try:
        values = [plane.modes(p).values for p in corners]
    except AnalysisError as error:
        return HeldInFull(why=f"the model has no modes at a corner: {error}")
    listed = [Listed(plane.values(p), lam, plane.grows(lam)) for p, lam in zip(corners, values, strict=True)]
    held = held_in_full(model, listed, damped=not plane.reversible, solver=solver)
    found.wrong += [(words, p) for words, p in zip(held.amiss, corners, strict=False) if words]
    return held


def _chosen(curves: list[StabilityCurve]) -> list[tuple[int, int]]:
    """(curve, point) of both ends and of the extreme x and y of each curve, as long as there are few, and of some at
    random."""
    wanted: list[tuple[int, int, int]] = []
    for number, curve in enumerate(curves):
        p = curve.points
        places = [0, len(p) - 1, *(int(pick(p[:, axis])) for axis in (1, 0) for pick in (np.argmin, np.argmax))]
        wanted += [(rank, number, k) for rank, k in enumerate(dict.fromkeys(places))]
    rng = np.random.default_rng(0)
    every = [(number, k) for number, curve in enumerate(curves) for k in range(len(curve.spots))]
    some = [every[int(k)] for k in rng.choice(len(every), min(AT_RANDOM, len(every)), replace=False)] if every else []
    # The first of each curve before the second of any.
    return list(dict.fromkeys([*some, *((number, k) for _, number, k in sorted(wanted))]))[:MOST]


def _again(
    plane: Plane, problem: ParametricProblem, vectors: Array | None, spot: CurvePoint, solver: str | None
) -> tuple[float, float] | None:
    """How far off a point was, in shares of the ranges, and the backward error; None where it is not found."""
    share = np.abs(spot.gradient) / np.hypot(*spot.gradient)
    axis = int(np.argmax(share))
    values = plane.values(spot.p)
    line = ParameterLine(problem, plane.names[axis], values, Options(solver=solver))
    own = line.parameter
    at = (values[own.name] - own.low) / (own.high - own.low)
    right, left = (
        v if vectors is None else combined(vectors, v[:, None])[:, 0].astype(complex) for v in (spot.right, spot.left)
    )
    between = max(at - AROUND, 0.0), min(at + AROUND, 1.0)
    root: Root | None
    try:
        with quiet():
            if spot.kind == "standstill":
                root = standstill(line, at, right, left, between)
            else:
                solve = crossing if spot.kind == "crossing" else meeting
                root = solve(line, at, 1j * spot.omega, right, left, between)
    except AnalysisError:
        return None
    if root is None or abs(root.mu - at) > 2 * AROUND or abs(abs(root.lam.imag) - spot.omega) > AROUND * plane.top:
        return None
    return float(abs(root.mu - at) * share[axis]), root.residual

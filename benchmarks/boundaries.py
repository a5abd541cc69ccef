"""Stability boundaries: eigenvalue problems and seconds against a grid of 1001 × 1001 points, 0.1 % of ranges apart.

python benchmarks/boundaries.py [--short]   (--short: the two beams alone up to 15 kHz, for CI)
"""

from __future__ import annotations

import time

import numpy as np

import stridor as st
from _common import COARSE, bench, machine, options
from stridor.case import Case, template_text
from stridor.study.boundary_result import Boundary

FINE = 1001
BENCHES: dict[str, tuple[Case, str, tuple[float, float], tuple[float, float]]] = {
    "two beams, damping of one": (bench(), "bodies.beam2.damping.mass", (0.0, 2000.0), (0.0, 0.5)),
    "two beams, thickness of one": (bench(), "bodies.beam1.thickness", (0.001, 0.002), (0.0, 0.5)),
    "two beams, density": (bench(), "materials.steel.density", (6000.0, 9000.0), (0.0, 0.5)),
    "two beams, contact stiffness": (bench(), "contact_stiffness", (0.01, 1.0), (0.0, 1.0)),
    "pad on disc, coarse, damping": (
        st.loads(template_text("pad-on-disc")).with_({**COARSE, "modal.friction_damping": False}),
        "bodies.disc.damping.stiffness", (1e-8, 8e-8), (0.0, 0.6),
    ),
}  # fmt: skip


def traced(case: Case, x: str, ends: tuple[float, float], high: tuple[float, float]) -> Boundary:
    started = time.perf_counter()
    found = st.stability_boundary(case, x, "mu", x_range=ends, y_range=high)
    seconds = time.perf_counter() - started
    points = sum(len(curve.x) for curve in found.curves)
    share = (found.solves + found.steps) / FINE**2
    print(f"  {len(found.curves)} curves, {points} points, checks {'agree' if found.agree else 'do not agree'}")
    print(f"  {found.solves} eigenvalue problems and {found.steps} factorisations of {found.size} unknowns, together")
    print(f"  {100 * share:.2f} % of {FINE} × {FINE}; {found.full_solves} solves in full; {seconds:.1f} s in all")
    if found.confirmed:
        off, residual = (max(getattr(c, name) for c in found.confirmed) for name in ("difference", "residual"))
        again = len(found.confirmed)
        print(f"  {again} points solved again in full: off by {off:.1e} of the ranges, residual {residual:.0e}")
    return found


def against(
    found: Boundary, case: Case, x: str, ends: tuple[float, float], high: tuple[float, float], columns: int, points: int
) -> None:
    """Columns of so many points of the grid, each solved on a reduced model of its own over mu and x."""
    model, cell = st.reduced_model(case, {x: ends, "mu": high}), 1.0 / (points - 1)
    ys, worst, missed, changes, started = np.linspace(*high, points), 0.0, 0, 0, time.perf_counter()
    for value in np.linspace(*ends, columns + 2)[1:-1].tolist():
        counts = np.array([int(model.modes({x: value, "mu": y}).unstable.sum()) for y in ys.tolist()])
        crossed = [
            float(np.interp(value, cx[order], cy[order]))
            for cx, cy, _ in found.polylines()
            if cx.min() <= value <= cx.max()
            for order in [np.argsort(cx, kind="stable")]
        ]
        for k in np.flatnonzero(np.diff(counts)).tolist():
            changes += 1
            off = min((abs(y - 0.5 * (ys[k] + ys[k + 1])) for y in crossed), default=np.inf) / (high[1] - high[0])
            missed += off > 2 * cell
            worst = max(worst, off if off <= 2 * cell else 0.0)
    seconds = time.perf_counter() - started
    print(
        f"  {columns} columns of the grid, {points} points each: the number of growing modes changes {changes} times, "
        f"{missed} of these on no curve, others within {100 * worst:.3f} % (half a cell: {50 * cell:.3g} %)"
    )
    print(f"  {seconds:.1f} s for these, about {seconds * FINE**2 / (columns * points):.0f} s for the whole grid")


def main() -> None:
    short = options(__doc__ or "").short
    print(machine())
    for name, (case, x, ends, high) in list(BENCHES.items())[: 1 if short else None]:
        case = case.with_({"modal.max_frequency_hz": 15e3}) if short else case
        freedoms = st.build_system(case).size
        print(f"{name}, {freedoms} freedoms, {ends[0]:g} to {ends[1]:g}, mu {high[0]:g} to {high[1]:g}")
        against(traced(case, x, ends, high), case, x, ends, high, *((1, 101) if short else (5, FINE)))


if __name__ == "__main__":
    main()

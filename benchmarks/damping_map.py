"""A map of the lowest onset over two dampings: one reduced model for all points against a search at each of them.

python benchmarks/damping_map.py [--short]   (--short: the coarse pad alone, four points, none searched in full, for CI)
"""

from __future__ import annotations

import time

import numpy as np

import stridor as st
from _common import COARSE, machine, options
from stridor.case import Case, template_text
from stridor.study.damping_full import FullSearch

X, Y = "bodies.disc.damping.stiffness", "bodies.lining.damping.stiffness"
ENDS = (1e-8, 8e-8)
SIZES = {
    "coarse": COARSE,
    "middle": {
        "bodies.disc.mesh.divisions": [6, 60, 2],
        "bodies.lining.mesh.divisions": [6, 14, 2],
        "bodies.plate.mesh.divisions": [5, 12, 1],
    },
    "whole": {},
}


def measure(case: Case, points: int, searched: int) -> None:
    freedoms = st.build_system(case).size
    limit = case.modal.max_frequency_hz
    print(f"pad on disc, {freedoms} freedoms, {points} × {points} points, {limit:g} Hz ({machine()})")
    marks = [time.perf_counter()]
    found = st.damping_map(
        case, X, Y, x_range=ENDS, y_range=ENDS, grid=(points, points), method="reduced",
        progress=lambda *_: marks.append(time.perf_counter()),
    )  # fmt: skip
    end = time.perf_counter()
    each = np.diff(marks)
    print(f"  reduced model and first onset  {each[0]:8.1f} s")
    print(f"  each further point             {np.median(each[1:]):8.2f} s (longest {each[1:].max():.2f})")
    print(f"  solved again, and undamped     {end - marks[-1]:8.1f} s")
    print(f"  {found.notes[-1]}")
    full = FullSearch(case, (X, Y), found.mu_range, found.max_frequency_hz)
    for i, j in [(0, 0), (points - 1, points - 1)][:searched]:
        started = time.perf_counter()
        exact, _ = full.lowest(found.x_values[i], found.y_values[j])
        assert exact is not None
        slopes = np.array([found.slope_x[i, j], found.slope_y[i, j]])
        away = np.abs(slopes - exact.slopes).max() / np.abs(slopes).max()
        print(
            f"  searched in the full problem   {time.perf_counter() - started:8.1f} s: μ = {exact.mu:.9f}, "
            f"{found.onset_mu[i, j] - exact.mu:+.1e} in the map; slopes off by {away:.1e} of the larger"
        )
    if not searched:
        return
    started = time.perf_counter()
    bare = full.undamped()
    assert bare is not None
    assert found.undamped_mu is not None
    seconds = time.perf_counter() - started
    print(f"  without damping, full problem  {seconds:8.1f} s: μ = {bare.mu:.9f}, {found.undamped_mu - bare.mu:+.1e}")


def main() -> None:
    short = options(__doc__ or "").short
    for name in ("coarse",) if short else ("middle", "whole"):
        # Friction damping comes from steady states, which a search interpolates with an error of its own.
        changes = {**SIZES[name], "modal.friction_damping": False}
        case = st.loads(template_text("pad-on-disc")).with_(changes)
        measure(case, 2 if short else 5, {"coarse": 0, "middle": 2, "whole": 1}[name])


if __name__ == "__main__":
    main()

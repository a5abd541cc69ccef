"""All onsets in 0 < μ < 1 below 40 kHz, solved, against bracketing them by dense eigensolves.

The alternative sweeps μ in steps of 0.01 with a dense eigensolve of the damped state matrix and reads the
onsets off to two digits; in --short mode 2 of its 100 solves are timed and scaled up.
"""

from __future__ import annotations

import time

import stridor as st
from _common import bench, best, machine, options
from friction_sweep import dense
from stridor.modal.onsets import onsets


def main() -> None:
    args = options(__doc__ or "")
    system = st.build_system(bench())
    damped, found = best(lambda: onsets(system, (0.0, 1.0), max_frequency_hz=40e3))
    undamped, bare = best(lambda: onsets(system, (0.0, 1.0), max_frequency_hz=40e3, damped=False))
    solved = 2 if args.short else 100
    started = time.perf_counter()
    for k in range(solved):
        dense(system, k / solved)
    each = (time.perf_counter() - started) / solved
    scaled = "" if solved == 100 else f" ({solved} solved, scaled)"
    print(f"all onsets in 0 < μ < 1, f < 40 kHz, {system.size} degrees of freedom ({machine()})")
    print(f"  dense sweep, two digits  {100 * each:8.2f} s{scaled}")
    print(f"  stridor, damped          {damped:8.3f} s, {len(found.onsets)} onsets")
    print(f"  stridor, undamped        {undamped:8.3f} s, {len(bare.onsets)} onsets")
    print(f"  ratio                    {100 * each / damped:8.0f}")
    for o in bare.onsets:
        print(f"    μ = {o.mu:.12f}  {o.frequency_hz:12.5f} Hz  residual {o.residual:.1e}")


if __name__ == "__main__":
    main()

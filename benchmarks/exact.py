"""The two-beam bench from change to change of its contact against explicit steps: seconds of the march alone.

python benchmarks/exact.py [--short]   (--short: a fiftieth of the time, for CI)

Explicit steps are on all modes, of 20 ns as the case has them, and of 10 ns; exact ones on the modes up to 100 kHz and
static answers, with records every 1, 10 and 100 µs. The modes of the structure are made before; the modes of
each status of the contact are part of the march. All go in turns, the best of each counts, by the clock.
What comes out is compared in the first regime after sliding starts: there contact sticks and slips and does not part.
"""

from __future__ import annotations

from typing import Any

import stridor as st
from _common import bench, machine, options

CUTOFF = 100e3  # Hz
WINDOW = (0.015, 0.019)  # s after the start of sliding


def main() -> None:
    assert __doc__ is not None
    short = options(__doc__).short
    length = 0.002 if short else 0.1
    base = bench().with_({f"phases.{n}.duration": length / 2 for n in (0, 1)} | {"temporal.watch": ("beam1.tip",)})
    exact: dict[str, Any] = {"temporal.stepper": "exact", "temporal.step": 1e-6, "temporal.cutoff_hz": CUTOFF}
    cases = {
        f"explicit, {nano} ns": base.with_({"temporal.step": nano * 1e-9, "temporal.record_every": 1000 // nano})
        for nano in (20, 10)
    }
    cases |= {f"exact, {n} µs": base.with_(exact | {"temporal.record_every": n}) for n in (1, 10, 100)}
    seconds: dict[str, float] = {}
    said: dict[str, str] = {}
    for turn in range(2 if short else 6):
        for name, case in cases.items():
            run = st.simulate(case)
            if turn == 0:  # which compiles
                begins = length / 2
                here = (run.time > begins + WINDOW[0]) & (run.time < begins + WINDOW[1])
                force = run.normal_force[here, 0]
                said[name] = f"; rms {force.std():.3f} N, largest {force.max():.2f} N" if len(force) else ""
            else:
                seconds[name] = min(seconds.get(name, run.wall_seconds), run.wall_seconds)
    print(machine())
    shipped = seconds["explicit, 20 ns"]
    for name, taken in seconds.items():
        print(f"{name:15s} {taken:7.3f} s for {length:g} s, {shipped / taken:5.1f} times as fast as 20 ns{said[name]}")


if __name__ == "__main__":
    main()

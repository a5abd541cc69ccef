"""The shipped pad on a disc, both approaches at μ = 0.5: growth rates side by side, and what each took.

python benchmarks/pad_on_disc.py [--short]   (--short: a coarse mesh, for CI)
"""

from __future__ import annotations

import time

import numpy as np

import stridor as st
from _common import COARSE, machine, options
from stridor.agreement.perturbation import modes_as_in_time, perturb
from stridor.case import template_text
from stridor.study.settings import settings_of

MU = 0.5


def main() -> None:
    short = options(__doc__ or "").short
    case = st.loads(template_text("pad-on-disc"))
    case = case.with_(COARSE) if short else case
    limit = case.modal.max_frequency_hz
    system = st.build_system(case)
    print(f"{system.size} freedoms, {system.contact_nodes().count} slave nodes ({machine()})")
    started = time.perf_counter()
    modes = modes_as_in_time(system, MU, limit)
    print(f"modes up to {limit:g} Hz: {time.perf_counter() - started:.1f} s, residual ≤ {modes.residual.max():.1e}")
    started = time.perf_counter()
    seen = perturb(system, MU, settings=settings_of(case), max_frequency_hz=limit, modes=modes)
    print(f"the fastest three in time: {time.perf_counter() - started:.1f} s")
    for found in sorted(seen.components.eigenvalues, key=lambda v: -v.real)[:3]:
        lam = modes.eigenvalues[0][np.argmin(np.abs(modes.eigenvalues[0] - found))]
        print(
            f"  modal {lam.imag / 2 / np.pi:.2f} Hz, {lam.real:+.2f} 1/s; temporal {found.imag / 2 / np.pi:.2f} Hz, "
            f"{found.real:+.2f} 1/s: growth differs by {100 * abs(found.real - lam.real) / abs(lam.real):.2f} %"
        )
    if short:
        return
    started = time.perf_counter()
    sweep = st.modes(case, np.linspace(0.0, 0.6, 13), max_frequency_hz=limit)
    print(f"modes at 13 μ: {time.perf_counter() - started:.1f} s, residual ≤ {sweep.residual.max():.1e}")
    started = time.perf_counter()
    found = st.onsets(case).onsets
    seconds, residual = time.perf_counter() - started, max(o.residual for o in found)
    print(f"{len(found)} onsets: {seconds:.1f} s, residual ≤ {residual:.1e}")
    for onset in found:
        print(f"  μ = {onset.mu:.6f} at {onset.frequency_hz:.2f} Hz")


if __name__ == "__main__":
    main()

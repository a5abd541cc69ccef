"""Time per step of the temporal approach against the loop one writes first with NumPy and SciPy.

Same scheme (β2 = 1/2, forward-increment multipliers, Coulomb without regularisation), same matrices,
float64, all free freedoms, in one run. The plain loop steps on freedoms: a sparse product for K u, one
for C, a banded Cholesky solve, two rows for the contact. It keeps no energies and no statistics;
stridor's does.
"""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import scipy.linalg as sl
import scipy.sparse as sp

import stridor as st
from _common import bench, machine, options
from stridor.study.analyses import phases_of, settings_of
from stridor.temporal.schedule import PhaseSpec
from stridor.temporal.simulate import simulate


def plain_loop(system: st.System, steps: int, dt: float, mu: float, load: np.ndarray) -> tuple[float, float]:
    """Seconds per step of the obvious loop, and the contact force it ends with (press phase)."""
    mass, damping, stiffness = (sp.csr_matrix(m) for m in (system.mass, system.damping, system.stiffness))
    effective = (mass + dt / 2 * damping).toarray()
    rows, columns = np.nonzero(effective)
    width = int(np.max(np.abs(rows - columns)))
    band = np.zeros((width + 1, system.size))
    for k in range(width + 1):
        band[k, : system.size - k] = np.diagonal(effective, -k)
    factor = sl.cholesky_banded(band, lower=True)
    contact = system.contacts[0]
    n, t = contact.normal_row, contact.tangent_row
    dn, dt_row = (dt**2 * sl.cho_solve_banded((factor, True), r) for r in (n, t))
    w_nn, w_nt, w_tt = n @ dn, n @ dt_row, t @ dt_row
    determinant = w_nn * w_tt - w_nt**2
    u, before = np.zeros(system.size), np.zeros(system.size)
    normal = 0.0
    started = time.perf_counter()
    for _ in range(steps):
        right = dt**2 * (load - stiffness @ u) + mass @ (2 * u - before) + dt / 2 * (damping @ before)
        new = sl.cho_solve_banded((factor, True), right, check_finite=False)
        gap, slip = contact.gap + n @ new, t @ (new - u)
        normal = 0.0
        if gap < 0:
            normal = (slip * w_nt - gap * w_tt) / determinant
            tangential = (gap * w_nt - slip * w_nn) / determinant
            if abs(tangential) > mu * normal:
                sense = np.sign(tangential)
                normal = -gap / (w_nn + sense * mu * w_nt)
                tangential = sense * mu * normal
            new = new + normal * dn + tangential * dt_row
        before, u = u, new
    return (time.perf_counter() - started) / steps, normal


def main() -> None:
    args = options(__doc__ or "")
    case = bench()
    system = st.build_system(case)
    settings = settings_of(case)
    assert settings.step is not None
    mu = case.contacts["A"].friction.coefficient
    press = [PhaseSpec("press", 2000 * settings.step, {}, {"clamp": 0.0})]
    simulate(system, press, settings)  # compile, or load from the cache

    plain_steps = 5_000 if args.short else 50_000
    first, force_plain = plain_loop(system, plain_steps, settings.step, mu, system.loads["press"])
    phases = phases_of(case)
    if args.short:
        phases = [PhaseSpec(p.name, p.duration / 10, p.loads, p.velocities, p.ramp) for p in phases]
    run = simulate(system, phases, settings)
    ours = run.wall_seconds / run.steps
    again, _ = plain_loop(system, plain_steps, settings.step, mu, system.loads["press"])
    short = [PhaseSpec("press", plain_steps * settings.step, {}, {"clamp": 0.0})]
    check = simulate(system, short, replace(settings, record_every=1))
    plain = min(first, again)
    print(f"time loop, {system.size} free degrees of freedom, {run.steps} steps, float64 ({machine()})")
    print(f"  plain NumPy/SciPy loop   {plain * 1e6:8.2f} µs per step ({plain_steps} steps, better of two)")
    print(f"  stridor, {run.path} path       {ours * 1e6:8.3f} µs per step, energies and statistics included")
    print(f"  ratio                    {plain / ours:8.1f}")
    last = check.normal_force[-1, 0]
    print(f"  contact force at the end {force_plain:.9f} N plain, {last:.9f} N stridor")
    on_freedoms = replace(settings, path="nodal")
    simulate(system, press, on_freedoms)
    nodal = simulate(system, press, on_freedoms)
    print(f"  stridor, nodal path      {nodal.wall_seconds / nodal.steps * 1e6:8.3f} µs per step")


if __name__ == "__main__":
    main()

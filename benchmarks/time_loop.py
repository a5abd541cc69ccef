"""Time per step of the temporal approach against the loop one writes first with NumPy and SciPy.

The plain loop is the paper's equations 9 to 12 written down: any β2, displacement, velocity and
acceleration kept, sparse products for K u, C and M, a sparse factor solved in every step, the contact
predicted, solved and corrected. stridor marches the same scheme on the same matrices in the same run,
float64, all free freedoms; it also keeps energies, statistics of every step and records, which the plain
loop does not. A leaner plain loop, central differences only and a banded Cholesky factor, is timed too.
"""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import scipy.linalg as sl
import scipy.sparse as sp
import scipy.sparse.linalg as spl

import stridor as st
from _common import bench, machine, options
from stridor.study.analyses import phases_of, settings_of
from stridor.temporal.schedule import PhaseSpec
from stridor.temporal.simulate import simulate


def contact_forces(system: st.System, dn: np.ndarray, dt_row: np.ndarray, mu: float):
    """A function (gap, slip) → (N, T) for the one contact of the bench, with compliances n·dn and so on."""
    contact = system.contacts[0]
    n, t = contact.normal_row, contact.tangent_row
    w_nn, w_nt, w_tt = float(n @ dn), float(n @ dt_row), float(t @ dt_row)
    determinant = w_nn * w_tt - w_nt**2

    def solve(gap: float, slip: float) -> tuple[float, float]:
        if gap >= 0:
            return 0.0, 0.0
        normal = (slip * w_nt - gap * w_tt) / determinant
        tangential = (gap * w_nt - slip * w_nn) / determinant
        if abs(tangential) > mu * normal:
            sense = 1.0 if tangential > 0 else -1.0
            normal = -gap / (w_nn + sense * mu * w_nt)
            tangential = sense * mu * normal
        return normal, tangential

    return solve


def plain_loop(
    system: st.System, steps: int, dt: float, beta2: float, mu: float, load: np.ndarray
) -> tuple[float, float]:
    """Seconds per step of equations 9 to 12 as written, and the contact force it ends with (press phase)."""
    mass, damping, stiffness = (sp.csr_array(m) for m in (system.mass, system.damping, system.stiffness))
    s = 1 + 2 * beta2
    gain = dt**2 * s / 2
    factor = spl.splu(sp.csc_array(mass + beta2 * dt * damping))
    contact = system.contacts[0]
    n, t = contact.normal_row, contact.tangent_row
    dn, dt_row = (gain * factor.solve(r) for r in (n, t))
    solve = contact_forces(system, dn, dt_row, mu)
    u, v, a = np.zeros(system.size), np.zeros(system.size), np.zeros(system.size)
    normal = 0.0
    started = time.perf_counter()
    for _ in range(steps):
        q = v + dt * (1 - beta2) * a
        d = factor.solve(gain * (load - stiffness @ u) + dt * (mass @ q) - dt**2 / 2 * (damping @ q))
        normal, tangential = solve(contact.gap + float(n @ (u + d)), float(t @ d))
        if normal > 0:
            d = d + normal * dn + tangential * dt_row
        v = (q + 2 * beta2 / dt * d) / s
        a = 2 / dt**2 * (d - dt * v)
        u = u + d
    return (time.perf_counter() - started) / steps, normal


def lean_loop(system: st.System, steps: int, dt: float, mu: float, load: np.ndarray) -> tuple[float, float]:
    """The same for β2 = 1/2 alone: three displacements, one product less, a banded Cholesky factor."""
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
    solve = contact_forces(system, dn, dt_row, mu)
    u, before = np.zeros(system.size), np.zeros(system.size)
    normal = 0.0
    started = time.perf_counter()
    for _ in range(steps):
        right = dt**2 * (load - stiffness @ u) + mass @ (2 * u - before) + dt / 2 * (damping @ before)
        new = sl.cho_solve_banded((factor, True), right, check_finite=False)
        normal, tangential = solve(contact.gap + float(n @ new), float(t @ (new - u)))
        if normal > 0:
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

    plain_steps = 500 if args.short else 50_000
    load = system.loads["press"]

    def plain() -> tuple[float, float]:
        return plain_loop(system, plain_steps, settings.step or 0.0, settings.beta2, mu, load)

    first, force_plain = plain()
    phases = phases_of(case)
    if args.short:
        phases = [PhaseSpec(p.name, p.duration / 50, p.loads, p.velocities, p.ramp) for p in phases]
    run = simulate(system, phases, settings)
    ours = run.wall_seconds / run.steps
    again, _ = plain()
    lean, _ = lean_loop(system, plain_steps, settings.step, mu, load)
    short = [PhaseSpec("press", plain_steps * settings.step, {}, {"clamp": 0.0})]
    check = simulate(system, short, replace(settings, record_every=1))
    slow = min(first, again)
    print(f"time loop, {system.size} free degrees of freedom, {run.steps} steps, float64 ({machine()})")
    print(f"  plain NumPy/SciPy loop   {slow * 1e6:8.2f} µs per step ({plain_steps} steps, better of two)")
    print(f"  stridor, {run.path} path       {ours * 1e6:8.3f} µs per step, energies and statistics included")
    print(f"  ratio                    {slow / ours:8.1f}")
    print(f"  lean plain loop          {lean * 1e6:8.2f} µs per step, ratio {lean / ours:.1f}")
    last = check.normal_force[-1, 0]
    print(f"  contact force at the end {force_plain:.9f} N plain, {last:.9f} N stridor")
    on_freedoms = replace(settings, path="nodal")
    simulate(system, press, on_freedoms)
    nodal = simulate(system, press, on_freedoms)
    print(f"  stridor, nodal path      {nodal.wall_seconds / nodal.steps * 1e6:8.3f} µs per step")


if __name__ == "__main__":
    main()

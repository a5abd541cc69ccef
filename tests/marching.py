"""Small systems made by hand for the temporal tests, initial conditions, and the paper's scheme written out
literally."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.signal
import scipy.sparse as sp

import stridor as st
from stridor.contact.interface import Contact, Rows
from stridor.fe.assembly import assemble_beam
from stridor.fe.beam import BeamElement, BeamMesh
from stridor.laws import Coulomb
from stridor.system import System
from stridor.system.model import PrescribedMotion
from stridor.temporal import march
from stridor.temporal.schedule import PhaseSpec
from stridor.temporal.simulate import Settings, simulate


def simulate_assembled(system: System, phases, settings=None, **options):
    """The march on assembled matrices, whatever suits the system."""
    return simulate(system, phases, replace(settings or Settings(), path="assembled"), **options)


def in_chunks(patch: pytest.MonkeyPatch, steps: int) -> None:
    """Every march in chunks of so many steps, told after each."""
    patch.setattr(march.Pace, "begin", lambda _: steps)
    patch.setattr(march, "TOLD_SECONDS", -1.0)


def cut(case: st.Case, steps: int, share: float = 0.6) -> st.Trajectory:
    """The run of a case, told after so many steps each, that Ctrl-C ends behind a share of it."""

    def stop(done: int, planned: int) -> None:
        if done > share * planned:
            raise KeyboardInterrupt

    with pytest.MonkeyPatch.context() as patch:
        in_chunks(patch, steps)
        part = st.simulate(case, progress=stop)
    assert part.interrupted
    return part


def touch(normal, tangent, *, gap=0.0, slip=0.0, law=None, name="A", motions=0) -> Contact:
    """A contact between freedoms: its rows, gap [m], and the slip speed [m/s] that the moving supports
    give."""
    normal, tangent = np.asarray(normal, dtype=float), np.asarray(tangent, dtype=float)
    size = len(normal)
    lift = np.zeros(motions)
    if motions:
        lift[0] = slip
    nothing = Rows(np.zeros((2, size)), np.zeros((2, motions)))
    return Contact(
        name=name, slave=nothing, slave_position=np.zeros(2), master=nothing,
        master_positions=np.array([[0.0, 0.0], [1.0, 0.0]]), chords=np.ones(1), segment=0, xi=0.0, side=1,
        gap=gap,
        normal=np.array([0.0, 1.0]), tangent=np.array([1.0, 0.0]), normal_row=normal, tangent_row=tangent,
        normal_lift=np.zeros(motions), tangent_lift=lift, stiffness=np.inf, law=law or Coulomb(0.0),
    )  # fmt: skip


def belt_motion(size: int) -> PrescribedMotion:
    """A belt that moves with 1 m/s at factor one and pulls at the structure by friction only."""
    column, one = np.zeros((size, 1)), np.zeros((1, 1))
    return PrescribedMotion(("belt",), column, column, column, one, one, one)


def points_of(size: int, **freedoms: int) -> dict[str, Rows]:
    """Points whose x is one freedom."""
    rows = {}
    for name, freedom in freedoms.items():
        free = np.zeros((2, size))
        free[0, freedom] = 1.0
        rows[name] = free
    return {name: Rows(sp.csr_array(free), np.zeros((2, 0))) for name, free in rows.items()}


def block_on_belt(
    *, mass=1.0, stiffness=1.0, damping=0.0, press=1.0, law=None, speed=None, preload=True, bearing=1.0
) -> System:
    """A block on a spring, freedom 0 along the belt, freedom 1 normal to it, pressed by ``press`` [N].

    speed: the belt's [m/s] along +x, None where nothing moves.
    """
    motion = PrescribedMotion.none(2) if speed is None else belt_motion(2)
    contact = touch(
        [0.0, 1.0], [1.0, 0.0], slip=0.0 if speed is None else -speed, law=law or Coulomb(0.3),
        motions=len(motion.names),
    )  # fmt: skip
    points = {
        name: replace(rows, lift=np.zeros((2, len(motion.names))))
        for name, rows in points_of(2, block=0).items()
    }
    return System(
        np.diag([mass, bearing]), np.diag([damping, 0.0]), np.diag([stiffness, 0.0]), (contact,),
        {"press": np.array([0.0, -press])} if preload else {}, motion, points,
    )  # fmt: skip


def rod(length: float, area: float, modulus: float, density: float, elements: int, *, lumped=False):
    """Mass and stiffness (n, n) of a free rod: the traction part of a beam along x, first node first."""
    mesh = BeamMesh(
        (0.0, 0.0), elements, BeamElement(length / elements, modulus * area, 1.0, density * area, (1.0, 0.0))
    )
    mass, stiffness = (m.toarray()[::3, ::3] for m in assemble_beam(mesh, lumped=lumped))
    return mass, stiffness


def one_phase(duration: float, *, loads=None, velocities=None, ramp=0.0, name="run") -> list[PhaseSpec]:
    return [PhaseSpec(name, duration, loads or {}, velocities or {}, ramp)]


def run(system: System, duration: float, *, loads=None, velocities=None, ramp=0.0, start=None, **settings):
    """One phase, every step recorded unless told otherwise. start: u, v and a (n,) at t = 0 instead of
    rest."""
    settings = {"record_every": 1, **settings}
    if start is not None:
        start = tuple(np.broadcast_to(np.asarray(x, dtype=float), system.size) for x in start)
    phases = one_phase(duration, loads=loads, velocities=velocities, ramp=ramp)
    return simulate(system, phases, Settings(**settings), disturbance=start)


def paper_scheme(system: System, step: float, beta2: float, forces, steps: int, *, displacement=None):
    """u (steps + 1, n), v and a (steps, n) by eqs 9 and 10 as printed, all three unknowns solved together.

    forces (steps, n): external ones at t_n; at rest before. Contacts are left out.
    """
    m, c, k = (a.toarray() for a in (system.mass, system.damping, system.stiffness))
    n = len(m)
    one, zero = np.eye(n), np.zeros((n, n))
    # Unknowns u_{n+1}, v_n, a_n: the equation of motion, and both lines of eq. 10.
    matrix = np.block(
        [
            [zero, c, m],
            [-2 / step**2 * one, 2 / step * one, one],
            [-2 * beta2 / step / (1 + 2 * beta2) * one, one, zero],
        ]
    )
    solve = np.linalg.inv(matrix)
    u = np.zeros((steps + 1, n))
    v, a = np.zeros((steps, n)), np.zeros((steps, n))
    if displacement is not None:
        u[0] = displacement
    before_v, before_a = np.zeros(n), np.zeros(n)
    for i in range(steps):
        right = np.concatenate(
            [
                forces[i] - k @ u[i],
                -2 / step**2 * u[i],
                (before_v + step * (1 - beta2) * before_a - 2 * beta2 / step * u[i]) / (1 + 2 * beta2),
            ]
        )
        answer = solve @ right
        # One correction: the blocks differ by 1/Δt².
        answer += solve @ (right - matrix @ answer)
        u[i + 1], before_v, before_a = answer[:n], answer[n : 2 * n], answer[2 * n :]
        v[i], a[i] = before_v, before_a
    return u, v, a


def exponents(signals: np.ndarray, sampling: float, order: int) -> np.ndarray:
    """Exponents (order,) [1/s] of signals (c, r) that share them: a matrix pencil on stacked Hankel
    matrices."""
    window = signals.shape[1] // 3
    rows = [
        np.lib.stride_tricks.sliding_window_view(x / np.abs(x).max(), window)[::2]
        for x in np.atleast_2d(signals)
    ]
    hankel = np.vstack(rows)
    left, values, right = np.linalg.svd(hankel[:, :-1], full_matrices=False)
    shift = (left[:, :order].T @ hankel[:, 1:] @ right[:order].T) / values[:order, None]
    return np.log(np.linalg.eigvals(shift).astype(complex)) / sampling


def band(signals: np.ndarray, sampling: float, low: float, high: float, taps: int = 401) -> np.ndarray:
    """Signals (c, r) through a linear filter, only where it is filled: growth rates and frequencies stay."""
    window = scipy.signal.firwin(taps, [low, high], fs=1 / sampling, pass_zero=False, window=("kaiser", 18))
    return np.array([np.convolve(x, window, "valid") for x in signals])

"""Steps that solve with M + β2ΔtC: the loop on freedoms against the scheme written out with dense matrices, and against
the modes where damping leaves them uncoupled."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp

from benches import Slave, bench
from stridor.contact.interface import Contact
from stridor.contact.surface import project
from stridor.system import System
from stridor.temporal.energy import energy_balance
from stridor.temporal.schedule import PhaseSpec, lay_out
from stridor.temporal.settings import Settings
from stridor.temporal.simulate import simulate

pytestmark = pytest.mark.verification

PHASES = [
    PhaseSpec("press", 6e-5, {"press0": 0.7}, {"clamp": 0.0}, 3e-5),
    PhaseSpec("slide", 1e-4, {}, {"clamp": 1.0}, 6e-5),
    PhaseSpec("back", 6e-5, {"press0": 1.5}, {"clamp": -0.5}),
]
HISTORIES = ("normal_force", "tangential_force", "slip_speed", "displacement", "velocity", "acceleration", "kinetic", "elastic")


def random_bench(rng: np.random.Generator, *, coupled: bool) -> tuple[System, float]:
    """One to three beams on a fourth one, on its nodes or between them, and β2. coupled: with dashpots anywhere."""
    sliding = str(rng.choice(["small", "finite"]))
    stiffest = 6.3 if sliding == "finite" else 9.0
    slaves = [
        Slave(
            place=float(rng.choice([8 / 12, rng.uniform(0.2, 0.9)])), lean_deg=float(rng.uniform(-15, 15)),
            side=int(rng.choice([-1, 1])), force=float(rng.uniform(5, 30)), damping=(float(rng.uniform(0, 3e3)), 1e-8),
            stiffness="rigid" if rng.random() < 0.5 else float(10 ** rng.uniform(5.5, stiffest)),
            friction={"law": "coulomb", "coefficient": float(rng.uniform(0.05, 0.6))},
        )
        for _ in range(rng.integers(1, 4))
    ]  # fmt: skip
    system = bench(
        *slaves, mass=str(rng.choice(["consistent", "lumped"])), damping=(50.0, 1e-8),
        velocity=float(rng.uniform(0.2, 2.0)),
    )  # fmt: skip
    contacts = tuple(replace(c, sliding=sliding, closed=bool(rng.random() < 0.2)) for c in system.contacts)
    damping = system.damping.toarray()
    for _ in range(4 if coupled else 0):
        i, j = rng.choice(system.size, 2, replace=False)
        damping[np.ix_((i, j), (i, j))] += rng.uniform(0.01, 0.5) * np.array([[1.0, -1.0], [-1.0, 1.0]])
    return replace(system, contacts=contacts, damping=sp.csr_array(damping)), float(rng.choice([0.5, 0.6, 0.8]))


def solve_pair(gap: float, slip: float, w: np.ndarray, mu: float, *, closed: bool) -> tuple[float, float]:
    """N and T of the one admissible state of Signorini's and Coulomb's law: each is tried."""
    if closed and gap > 0.0:
        normal, tangential = solve_pair(-gap, slip, w * np.array([[1.0, -1.0], [-1.0, 1.0]]), mu, closed=True)
        return -normal, tangential
    if gap >= 0.0:
        return 0.0, 0.0
    stick = np.linalg.solve(w, [-gap, -slip])
    if stick[0] >= 0.0 and abs(stick[1]) <= mu * stick[0]:
        return float(stick[0]), float(stick[1])
    for sense in (1.0, -1.0):
        normal = -gap / (w[0, 0] + sense * mu * w[0, 1])
        moved = slip + (w[1, 0] + w[1, 1] * sense * mu) * normal
        if normal >= 0.0 and sense * moved <= 0.0:
            return float(normal), float(sense * mu * normal)
    raise AssertionError("no admissible state")


def rows_now(contact: Contact, u: np.ndarray, x: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """Gap without motion, rows (2, n) and lifts (2, p) of normal and tangent, of the curve as it is at u and x."""
    if contact.sliding == "small":
        rows = np.array([contact.normal_row, contact.tangent_row])
        return contact.gap, rows, np.array([contact.normal_lift, contact.tangent_lift])
    slave = contact.slave_position + contact.slave.free @ u + contact.slave.lift @ x
    master = contact.master_positions + (contact.master.free @ u + contact.master.lift @ x).reshape(-1, 2)
    weights, slopes = np.zeros(4), np.zeros(4)
    segment, _, on_line = project(*slave, master, contact.chords, contact.segment, contact.xi, weights, slopes)
    assert on_line
    four = [(k, n) for k, n in enumerate(range(segment - 1, segment + 3)) if 0 <= n < len(master)]
    tangent = sum(slopes[k] * master[n] for k, n in four)
    tangent = contact.side * tangent / np.linalg.norm(tangent)
    directions = np.array([[-tangent[1], tangent[0]], tangent])
    free, lift, place = contact.slave.free.toarray(), contact.slave.lift.copy(), contact.slave_position.copy()
    for k, n in four:
        free = free - weights[k] * contact.master.free[2 * n : 2 * n + 2].toarray()
        lift = lift - weights[k] * contact.master.lift[2 * n : 2 * n + 2]
        place = place - weights[k] * contact.master_positions[n]
    return float(directions[0] @ place), directions @ free, directions @ lift


def plain_forces(system: System, step: float, beta2: float) -> np.ndarray:
    """N and T (steps, m, 2) of the scheme as the theory page has it, dense, contacts in turn until they stay."""
    mass, damping, stiffness = (m.toarray() for m in (system.mass, system.damping, system.stiffness))
    s = 1.0 + 2.0 * beta2
    answer = step**2 * s / 2 * np.linalg.inv(mass + beta2 * step * damping)
    schedule = lay_out(PHASES, step, list(system.loads), list(system.motion.names), system.motion.full_distance)
    loads = schedule.load_factors(0, schedule.steps) @ np.array(list(system.loads.values()))
    increments = schedule.motion_increments(0, schedule.steps)
    u, q = np.zeros(system.size), np.zeros(system.size)
    x, r = np.zeros(increments.shape[1]), np.zeros(increments.shape[1])
    found = np.zeros((schedule.steps, len(system.contacts), 2))
    for n, (load, more) in enumerate(zip(loads, increments, strict=True)):
        pull = 2.0 * (more / step - r) / (step * s)
        drag = (r + 2.0 * beta2 * more / step) / s
        push = load - system.motion.mass @ pull - system.motion.damping @ drag - stiffness @ u
        d = answer @ (push + (mass @ q / step - damping @ q / 2) * 2 / s)
        pairs = [rows_now(c, u + d, x + more) for c in system.contacts]
        for _ in range(2000):
            before = found[n].copy()
            for k, (contact, (start, rows, lift)) in enumerate(zip(system.contacts, pairs, strict=True)):
                others = sum((pairs[j][1].T @ found[n, j] for j in range(len(pairs)) if j != k), np.zeros(len(u)))
                free = d + answer @ others
                gap = start + rows[0] @ (u + free) + lift[0] @ (x + more)
                w = rows @ answer @ rows.T
                if contact.compliance:
                    gap += start + rows[0] @ (u - step * q) + lift[0] @ (x - step * r)
                    w[0, 0] += 2.0 * contact.compliance
                mu = contact.law.sliding(1.0)
                found[n, k] = solve_pair(float(gap), float(rows[1] @ free + lift[1] @ more), w, mu, closed=contact.closed)
            if np.abs(found[n] - before).max() <= 1e-14 * np.abs(found[n]).max():
                break
        d = d + answer @ sum(rows.T @ force for (_, rows, _), force in zip(pairs, found[n], strict=True))
        u, q = u + d, (2.0 * beta2 - 1.0) / s * q + 2.0 / (s * step) * d
        x, r = x + more, (2.0 * beta2 - 1.0) / s * r + 2.0 / (s * step) * more
    return found


@pytest.mark.parametrize("seed", range(12))
def test_forces_are_those_of_the_scheme_written_out(seed):
    system, beta2 = random_bench(np.random.default_rng(seed), coupled=True)
    run = simulate(system, PHASES, Settings(beta2=beta2, record_every=1))
    assert (run.path, run.path_reason) == ("nodal", "damping is not proportional in every component")
    forces = plain_forces(system, run.step, beta2)
    for name, column in (("normal_force", 0), ("tangential_force", 1)):
        theirs = forces[:, :, column]
        assert np.abs(theirs).max() > 1.0
        assert np.abs(getattr(run, name) - theirs).max() <= 1e-9 * np.abs(theirs).max(), name
    if beta2 == 0.5:
        assert energy_balance(run).error < 1e-9
    assert run.unconverged_steps == 0


@pytest.mark.parametrize("seed", range(12))
def test_histories_are_those_of_the_modes_where_damping_leaves_them_uncoupled(seed):
    system, beta2 = random_bench(np.random.default_rng(100 + seed), coupled=False)
    settings = Settings(beta2=beta2, record_every=1, watch=("base.end", "s0.start"))
    modal, nodal = (simulate(system, PHASES, replace(settings, path=path)) for path in ("modal", "nodal"))
    assert (modal.path, nodal.path, nodal.nodes) == ("modal", "nodal", None)
    assert modal.normal_force.max() > 1.0
    for name in HISTORIES:
        theirs = getattr(modal, name)
        assert np.abs(getattr(nodal, name) - theirs).max() <= 2e-9 * np.abs(theirs).max(), name
    most = max(np.abs(w).max() for w in modal.works.values())
    for name, work in modal.works.items():
        assert np.abs(nodal.works[name] - work).max() <= 1e-9 * most, name


def test_forces_reach_every_freedom_of_a_body_with_consistent_mass():
    """What a diagonal in the place of the matrix would miss: the far end of the slave feels the contact at once."""
    system = bench(Slave(elements=3), elements=3, damping=(50.0, 0.0))
    run = simulate(system, PHASES[:1], Settings(path="nodal", record_every=1))
    diagonal = replace(system, mass=sp.diags_array(system.mass.diagonal()))
    lumped = simulate(diagonal, PHASES[:1], Settings(path="nodal", record_every=1, step=run.step))
    assert np.abs(run.normal_force - lumped.normal_force).max() > 1e-2 * run.normal_force.max()

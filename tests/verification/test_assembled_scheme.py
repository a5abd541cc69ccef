"""The scheme on assembled matrices: against the path of small systems, its limit, its energies, and being stopped."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp

from benches import Slave, bench
from marching import belt_motion, one_phase, points_of, rod, simulate_assembled, touch
from stridor.contact.interface import Rows
from stridor.errors import AnalysisError, CaseError
from stridor.laws import Coulomb, Tabulated, Weakening
from stridor.system import System
from stridor.system.model import CubicSprings
from stridor.temporal.beta2 import StepLimit, step_limit
from stridor.temporal.energy import energy_balance
from stridor.temporal.march import March
from stridor.temporal.schedule import PhaseSpec
from stridor.temporal.settings import Settings
from stridor.temporal.simulate import simulate
from stridor.temporal.steppers.sparse import step_limit_assembled, storage
from stridor.temporal.steppers.sparse.damping import split_damping

pytestmark = pytest.mark.verification

HISTORIES = (
    "time", "normal_force", "tangential_force", "slip_speed", "gap", "status", "kinetic", "elastic", "displacement",
    "velocity", "acceleration",
)  # fmt: skip
PHASES = [
    PhaseSpec("press", 3e-4, {"press1": 0.5}, {"clamp": 0.0}, 1e-4),
    PhaseSpec("slide", 4e-4, {"press0": 2.0}, {"clamp": 1.0}, 2e-4),
    PhaseSpec("back", 4e-4, {}, {"clamp": -1.5}),
]


def two_slaves(damping=(3e3, 0.0), law=None) -> System:
    """Two beams that hit, stick to, slide on and leave a third one, lumped."""
    system = bench(
        Slave(lean_deg=15.0, damping=damping), Slave(place=0.3, side=-1, damping=damping), mass="lumped",
        damping=damping, velocity=1.0,
    )  # fmt: skip
    contacts = tuple(
        replace(c, gap=c.gap + 1e-6, stiffness=np.inf, law=law or c.law) for c in system.contacts
    )
    return replace(system, contacts=contacts)


def oscillator(stiffness=1.0, damping=0.0, mass=1.0) -> System:
    return System(*(np.array([[x]]) for x in (mass, damping, stiffness)), points=points_of(1, mass=0))


def chain(count=30, *, stiffness_damping=0.0, mass_damping=0.0) -> System:
    """Masses and springs in a row, the first one held by a spring to the ground."""
    k = sp.diags_array([-np.ones(count - 1), 2 * np.ones(count), -np.ones(count - 1)], offsets=[-1, 0, 1]).toarray()
    k[-1, -1] = 1.0
    c = mass_damping * np.eye(count) + stiffness_damping * k
    return System(np.eye(count), c, k, points=points_of(count, end=count - 1))


def run(system, duration, *, start=None, loads=None, **settings):
    settings = {"record_every": 1, **settings}
    if start is not None:
        start = tuple(np.broadcast_to(np.asarray(x, dtype=float), system.size) for x in start)
    return simulate_assembled(system, one_phase(duration, loads=loads), Settings(**settings), disturbance=start)


@pytest.mark.parametrize("beta2", [0.5, 0.6])
@pytest.mark.parametrize(
    "law",
    [Coulomb(0.1), Weakening(0.1, 0.4, 0.2), Tabulated((0.0, 0.1, 0.5), (0.4, 0.2, 0.1), "monotone-cubic", 0.45)],
)
def test_equals_the_path_of_small_systems(beta2, law):
    """Impacts, stick, slip, separation, moving supports, mass damping: the same numbers to rounding."""
    system = two_slaves(law=law)
    watch = tuple(system.points)[:2]
    step = 0.9 * step_limit(system, beta2).step
    settings = Settings(record_every=7, beta2=beta2, path="modal", step=step, watch=watch)
    small, large = (call(system, PHASES, settings) for call in (simulate, simulate_assembled))
    for name in HISTORIES:
        a, b = getattr(small, name), getattr(large, name)
        assert np.abs(a - b).max() <= 1e-9 * np.abs(a).max(), name
    for name, work in small.works.items():
        assert np.abs(work - large.works[name]).max() <= 1e-9 * np.abs(work).max(), name
    assert set(np.unique(large.status)) == {0, 1, 2}
    for a, b in zip(small.phases, large.phases, strict=True):
        for name, one in a.contacts.items():
            two = b.contacts[name]
            assert two.first_stick == one.first_stick
            assert two.slip_fraction == one.slip_fraction
            assert two.max_normal_force == pytest.approx(one.max_normal_force, rel=1e-9)
            assert two.max_slip_speed == pytest.approx(one.max_slip_speed, rel=1e-9)
    assert large.unconverged_steps == 0
    # One contact, one node: its history is the contact's.
    assert large.nodes is not None
    assert np.array_equal(large.nodes.normal_force, large.normal_force)
    assert large.nodes.slip_velocity[..., 0] == pytest.approx(large.slip_speed, rel=1e-14)


@pytest.mark.parametrize("width", [1, 2, 3])
@pytest.mark.parametrize("threads", [1, 2])
def test_storage_changes_nothing(width, threads, monkeypatch):
    """Blocks of any width, in one part or two, with damping folded in or beside, give the same motion."""
    monkeypatch.setattr(storage, "_cheapest_width", lambda _: width)
    monkeypatch.setattr(storage, "THREADED_FREEDOMS", 0 if threads == 2 else 10**9)
    system = chain(200, stiffness_damping=0.02, mass_damping=0.01)
    settings = {"step": 0.8, "record_every": 20, "watch": ("end",)}
    start = (np.linspace(0, 1, 200) ** 3, 1.0, 0.0)
    folded = run(system, 80.0, start=start, **settings)
    # A dashpot of its own spoils proportionality: the second product is needed, and nearly nothing changes.
    c = system.damping.tolil()
    c[5, 6] = c[6, 5] = c[5, 6] * (1 + 1e-8)
    beside = run(replace(system, damping=c.tocsr()), 80.0, start=start, **settings)
    assert split_damping(system).factor is not None
    assert split_damping(replace(system, damping=c.tocsr())).factor is None
    for result, given in ((folded, system), (beside, replace(system, damping=c.tocsr()))):
        plain = literal(given, 0.8, 100, start)
        assert result.displacement[:, 0, 0] == pytest.approx(plain[::20, -1], rel=1e-11)
        assert energy_balance(result).error < 1e-12


def test_threads_change_no_digit(monkeypatch):
    """Two parts at once or one after the other: the same numbers."""
    from stridor.temporal.steppers.sparse.machine import Machine

    monkeypatch.setattr(storage, "THREADED_FREEDOMS", 0)
    system = chain(300, stiffness_damping=0.02)
    start = (np.linspace(0, 1, 300) ** 3, 1.0, 0.0)
    results = []
    for two in (False, True):
        monkeypatch.setattr(
            Machine, "use_threads", lambda self, two, fixed=two: self.structure.flags.__setitem__(3, fixed)
        )
        results.append(run(system, 50.0, start=start, step=0.8, watch=("end",)))
    assert np.array_equal(results[0].displacement, results[1].displacement)
    assert np.array_equal(results[0].works["damping"], results[1].works["damping"])


def literal(system, dt, steps, start):
    """u (steps, n) by M a + C_d (q_n + q_{n+1})/2 + C_r q_n + K u = 0 with dense matrices, C_d the diagonal part."""
    m, c, k = (x.toarray() for x in (system.mass, system.damping, system.stiffness))
    grounded = np.diag(split_damping(system).diagonal)
    u, q = (np.broadcast_to(np.asarray(x, dtype=float), len(m)).copy() for x in start[:2])
    out = np.empty((steps, len(m)))
    for i in range(steps):
        out[i] = u
        a = np.linalg.solve(m + dt / 2 * grounded, -k @ u - (c - grounded) @ q - grounded @ q)
        q = q + dt * a
        u = u + dt * q
    return out


@pytest.mark.parametrize("beta2", [0.5, 0.7, 1.0])
@pytest.mark.parametrize("lag", [0.0, 0.3, 3.0])
def test_limit_of_one_freedom_with_lagged_damping(beta2, lag):
    """Bounded at 0.99 of the limit, beyond all bounds at 1.01: ω²Δt² + rΔt/β2 = 2/β2, with r on the older velocity.

    Two masses on a spring with a dashpot beside it; their relative motion is the freedom.
    """
    pair = np.array([[1.0, -1.0], [-1.0, 1.0]])
    system = System(np.eye(2), lag * pair, 2.0 * pair, points=points_of(2, mass=0))
    limit = step_limit_assembled(system, beta2)
    assert limit.omega_max == pytest.approx(2.0)
    r = 2 * lag
    assert 4.0 * limit.step**2 + r * limit.step / beta2 == pytest.approx(2 / beta2, rel=1e-9)
    peaks = []
    for factor in (0.99, 1.01):
        # Past the limit on purpose: the step is made to fit by scaling time within the matrices.
        stretched = replace(system, stiffness=system.stiffness * factor**2, damping=system.damping * factor)
        far = _march_unchecked(stretched, limit.step, beta2, 2000)
        peaks.append(np.abs(far).max())
    assert peaks[0] < 100
    assert not peaks[1] < 1e6


def _march_unchecked(system, step, beta2, steps):
    from stridor.temporal.beta2 import scheme
    from stridor.temporal.steppers.sparse.machine import assembled_machine
    from stridor.temporal.steppers.sparse.products import advance

    machine = assembled_machine(system, scheme(step, beta2), system.contact_nodes())
    machine.fields.u[machine.layout.index] = [1.0, -1.0]
    machine.show()
    seen = []
    for _ in range(steps):
        advance(machine.structure, machine.fields, np.zeros(16))
        seen.append(machine.displacement[0])
    return np.array(seen)


def test_limit_of_a_structure():
    """Lanczos from above: never more than the true limit, at most 1.2 % less; the body is named."""
    system = chain(500, stiffness_damping=0.1)
    k = system.stiffness.toarray()
    omega = math.sqrt(np.linalg.eigvalsh(k)[-1])
    true = 2 / omega * (math.sqrt(1 + (0.05 * omega) ** 2) - 0.05 * omega)
    found = step_limit_assembled(system, 0.5)
    assert 0.988 * true < found.step <= true * (1 + 1e-12)
    with pytest.raises(CaseError, match="unstable beyond"):
        run(system, 1.0, step=1.01 * found.step)
    beams = two_slaves()
    assert step_limit_assembled(beams, 0.5).step == pytest.approx(step_limit(beams, 0.5).step, rel=1e-12)
    assert step_limit_assembled(beams, 0.5).body == step_limit(beams, 0.5).body


@pytest.mark.parametrize("found", [step_limit, step_limit_assembled], ids=["consistent", "lagged"])
def test_a_limit_is_sought_once_and_is_that_of_its_matrices_and_scheme(found: Callable[[System, float], StepLimit]):
    system = two_slaves()
    first, count = found(system, 0.5), system.of_matrices.count
    assert found(system, 0.5) == first
    assert system.of_matrices.count == count
    assert found(system, 1.0).step < first.step
    softer = replace(system, stiffness=0.25 * system.stiffness)
    assert found(softer, 0.5).omega_max == pytest.approx(first.omega_max / 2, rel=1e-9)


def test_stiffness_damping_decays_as_it_should():
    """Damping on the older velocity: the decay of each mode is right to first order, e^{−βω²t/2}."""
    system = chain(20, stiffness_damping=0.02)
    values, vectors = np.linalg.eigh(system.stiffness.toarray())
    for mode in (0, 9):
        w2, shape = values[mode], vectors[:, mode]
        period = 2 * math.pi / math.sqrt(w2)
        result = run(
            system, 5 * period, step=period / 2000, record_every=2000, watch=("end",), start=(shape, 0.0, -w2 * shape)
        )
        ratio = result.displacement[-1, 0, 0] / result.displacement[0, 0, 0]
        assert ratio == pytest.approx(math.exp(-0.01 * w2 * result.time[-1]), rel=2e-3)


@pytest.mark.parametrize("damping", [(0.0, 0.0), (3e3, 0.0), (50.0, 3e-8), "mixed"])
def test_balance_closes_to_rounding(damping):
    """Impacts, friction, supports, loads, and damping beside the mass, on the older velocity or both."""
    system = two_slaves((50.0, 3e-8) if damping == "mixed" else damping)
    if damping == "mixed":
        c = system.damping.tolil()
        c[0, 3] = c[3, 0] = c[0, 3] - 0.5
        c[0, 0] += 0.5
        c[3, 3] += 0.5
        system = replace(system, damping=c.tocsr())
    result = simulate_assembled(system, PHASES, Settings(record_every=7))
    assert energy_balance(result).error < 1e-10
    largest = max(np.abs(w).max() for w in result.works.values())
    for name, work in result.works.items():
        assert np.abs(work).max() > (1e-9 * largest if damping != (0.0, 0.0) or name != "damping" else -1), name
    if damping == (0.0, 0.0):
        assert not np.any(result.works["damping"])
    else:
        assert result.works["damping"][-1] > 0


def test_cubic_spring():
    """Undamped Duffing m ü + k u + γ u³ = 0: the period by the elliptic integral, the potential ¼ γ u⁴."""
    from scipy.special import ellipk

    k, gamma, amplitude = 1.0, 4.0, 1.0
    springs = CubicSprings(Rows(sp.csr_array([[1.0]]), np.zeros((1, 0))), np.array([gamma]))
    system = replace(oscillator(k), cubic=springs)
    force = k * amplitude + gamma * amplitude**3
    result = run(system, 12.0, step=2e-4, watch=("mass",), start=(amplitude, 0.0, -force))
    u = result.displacement[:, 0, 0]
    square = k + gamma * amplitude**2
    period = 4 * ellipk(gamma * amplitude**2 / (2 * square)) / math.sqrt(square)
    crossings = np.flatnonzero((u[:-1] > 0) & (u[1:] <= 0))
    times = result.time[crossings] + 2e-4 * u[crossings] / (u[crossings] - u[crossings + 1])
    assert np.diff(times) == pytest.approx(period, rel=1e-6)
    assert energy_balance(result).error < 1e-12
    middle = 0.5 * (u[1:] + u[:-1])
    potential = 0.5 * k * middle**2 + 0.25 * gamma * middle**4
    assert result.elastic[1:] == pytest.approx(potential, abs=1e-3)
    assert result.path == "assembled"
    assert "cubic" in result.path_reason


def test_a_mass_drawn_by_a_support_on_a_cubic_spring():
    """m ü = −γ (u − v t)³ from rest: u − v t swings with the period of the cubic oscillator of energy ½ m v²."""
    from scipy.special import ellipk

    gamma, v = 4.0, 0.5
    springs = CubicSprings(Rows(sp.csr_array([[1.0]]), np.array([[-1.0]])), np.array([gamma]))
    system = replace(oscillator(0.0), cubic=springs, motion=replace(belt_motion(1), names=("drive",)))
    points = {"mass": replace(system.points["mass"], lift=np.zeros((2, 1)))}
    system = replace(system, points=points, motion=replace(system.motion, lift=np.zeros((1, 1))))
    amplitude = (2 * v**2 / gamma) ** 0.25
    period = 4 * ellipk(0.5) / (math.sqrt(gamma) * amplitude)
    step = 2e-4
    phases = [PhaseSpec("draw", 1.01 * period, {}, {"drive": v})]
    # q_0 = v_0 − β2 Δt a_0: the relative motion begins with −v, the mass itself at rest.
    result = simulate_assembled(system, phases, Settings(record_every=1, step=step, watch=("mass",)))
    u, time = result.displacement[:, 0, 0], result.time
    relative = u - v * time
    back = np.flatnonzero((relative[:-1] < 0) & (relative[1:] >= 0))[0]
    assert time[back] + step / 2 == pytest.approx(period / 2, abs=2 * step)
    assert relative.min() == pytest.approx(-amplitude, rel=1e-5)
    # Half a period on the mass has twice the speed of the support and half its way.
    assert result.velocity[back, 0, 0] == pytest.approx(2 * v, rel=1e-3)
    assert u[back] == pytest.approx(v * period / 2, rel=1e-3)
    # The support has put in the kinetic energy of the mass; at the turn also what the spring holds.
    assert energy_balance(result).error < 1e-10
    assert result.works["support"][back] == pytest.approx(0.5 * (2 * v) ** 2, rel=1e-3)


def test_a_support_that_pushes_a_mass_through_a_compliant_layer():
    """δ̈ = −K_c/m δ with δ̇ = v at first: the mass leaves at 2 v after half a period, the force at most v √(K_c m)."""
    v, stiffness = 0.3, 400.0
    contact = replace(touch([0.0, 1.0], [1.0, 0.0], law=Coulomb(0.0), motions=1), stiffness=stiffness)
    contact = replace(contact, normal_lift=np.array([-1.0]))
    system = System(
        np.eye(2), np.zeros((2, 2)), np.zeros((2, 2)), (contact,), motion=replace(belt_motion(2), names=("push",)),
    )  # fmt: skip
    up = sp.csr_array(np.array([[0.0, 1.0], [1.0, 0.0]]))
    system = replace(system, points={"mass": Rows(up, np.zeros((2, 1)))})
    omega, step = math.sqrt(stiffness), 1e-3
    phases = [PhaseSpec("push", 1.3 * math.pi / omega, {}, {"push": v})]
    result = simulate_assembled(system, phases, Settings(record_every=1, step=step, watch=("mass",)))
    force, time = result.normal_force[:, 0], result.time
    pressed = np.flatnonzero(force > 0)
    assert time[pressed[-1]] - time[pressed[0]] == pytest.approx(math.pi / omega, abs=3 * step)
    assert result.velocity[-1, 0, 0] == pytest.approx(2 * v, rel=2e-3)
    # (ω Δt)² = 4e-4; the support's motion of one step, forgotten or counted twice, would be 1e-2 of the largest force.
    exact = stiffness * v / omega * np.sin(omega * time[pressed])
    # At t = 0 the speed jumps, and with it the gap of which the scheme takes the mean, −vΔt now and 0 then.
    exact[0] = 0.5 * stiffness * v * step
    assert force[pressed] == pytest.approx(exact, abs=2e-3 * v * math.sqrt(stiffness))
    modal = simulate(system, phases, Settings(record_every=1, step=step, path="modal"))
    assert result.normal_force == pytest.approx(modal.normal_force, rel=0, abs=1e-12 * force.max())


def test_initial_motion():
    """A system that starts displaced and in motion: u0 cos ωt + v0/ω sin ωt to second order."""
    system = replace(oscillator(4.0), initial_velocity=np.array([1.0]), initial_displacement=np.array([0.3]))
    errors = []
    for step in (1e-2, 5e-3):
        result = run(system, 3.0, step=step, watch=("mass",))
        exact = 0.3 * np.cos(2 * result.time) + 0.5 * np.sin(2 * result.time)
        errors.append(np.abs(result.displacement[:, 0, 0] - exact).max())
    assert errors[0] < 1e-4
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.05)


def test_load_and_support_on_a_rod():
    """A rod pulled by a steady force swings to twice its static extension F L / E A."""
    mass, stiffness = rod(1.0, 2.0, 3.0, 4.0, 40, lumped=True)
    free = slice(1, None)
    load = np.zeros(40)
    load[-1] = 0.1
    system = System(mass[free, free], np.zeros((40, 40)), stiffness[free, free], (), {"pull": load}, points=points_of(40, end=39))
    period = 4 * 1.0 * math.sqrt(4.0 / 3.0)
    result = run(system, period / 2, step=1e-3, watch=("end",))
    assert result.displacement[-1, 0, 0] == pytest.approx(2 * 0.1 / 6.0, rel=0.02)
    assert energy_balance(result).error < 1e-12


def test_restart_goes_on_to_the_last_digit():
    """Cut at any step, within a ramp, and joined: as if in one run; so are the histories of the nodes."""
    system = two_slaves((50.0, 3e-8))
    settings = Settings(record_every=3, watch=tuple(system.points)[:1])
    whole = simulate_assembled(system, PHASES, settings)

    class Stop:
        calls = 0

        def __call__(self, done: int, planned: int) -> None:
            self.calls += 1
            if self.calls == 1:
                raise KeyboardInterrupt

    saved = []
    first = simulate_assembled(system, PHASES, settings, checkpoint=saved.append, checkpoint_seconds=0.0)
    assert first.steps == whole.steps
    part = saved[0]
    assert 0 < part.steps < whole.steps
    assert part.interrupted
    again = simulate_assembled(system, PHASES, settings, restart=part)
    for name in HISTORIES:
        assert np.array_equal(getattr(again, name), getattr(whole, name)), name
    for name, work in whole.works.items():
        assert np.array_equal(again.works[name], work), name
    assert again.nodes is not None
    assert whole.nodes is not None
    assert np.array_equal(again.nodes.time, whole.nodes.time)
    assert np.array_equal(again.nodes.gap, whole.nodes.gap)
    assert [p.name for p in again.phases] == [p.name for p in whole.phases]
    assert again.phases[0].contacts == whole.phases[0].contacts
    stopped = simulate_assembled(system, PHASES, settings, progress=Stop())
    assert stopped.interrupted or stopped.steps == whole.steps
    with pytest.raises(CaseError, match="same model"):
        simulate_assembled(chain(), one_phase(1.0), Settings(step=part.step), restart=part)


def test_interrupt_keeps_what_was_computed(monkeypatch):
    system = two_slaves()
    whole = simulate_assembled(system, PHASES, Settings(record_every=1))
    inner = March._advance

    def once(self, pace):
        if self.stepper.done:
            raise KeyboardInterrupt
        return inner(self, pace)

    monkeypatch.setattr(March, "_advance", once)
    cut = simulate_assembled(system, PHASES, Settings(record_every=1))
    assert cut.interrupted
    assert 0 < cut.steps == len(cut.time)
    assert np.array_equal(cut.normal_force, whole.normal_force[: cut.steps])
    monkeypatch.undo()
    on = simulate_assembled(system, PHASES, Settings(record_every=1), restart=cut)
    assert np.array_equal(on.gap, whole.gap)


def test_refusals():
    consistent = bench(Slave(), mass="consistent")
    with pytest.raises(CaseError, match='mass = "lumped"'):
        simulate_assembled(consistent, one_phase(1e-4), Settings())
    with pytest.raises(AnalysisError, match="no mass"):
        run(System(np.diag([1.0, 0.0]), np.zeros((2, 2)), np.eye(2)), 1.0)
    growing = replace(oscillator(), damping=sp.csr_array([[-60.0]]))
    with pytest.raises(AnalysisError, match="no longer finite") as caught:
        run(growing, 300.0, step=1e-2, start=(1.0, 0.0, 0.0))
    assert caught.value.trajectory.steps > 10


def test_friction_is_scaled():
    """mu replaces the coefficient of every contact at its slip speed."""
    motion = belt_motion(2)
    contact = touch([0.0, 1.0], [1.0, 0.0], slip=-1.0, law=Coulomb(0.3), motions=1)
    system = System(
        np.eye(2), np.zeros((2, 2)), np.diag([1.0, 0.0]), (contact,), {"press": np.array([0.0, -2.0])}, motion
    )
    result = simulate_assembled(system, one_phase(0.1), Settings(step=1e-3, record_every=1), mu=0.7)
    assert result.tangential_force[5:, 0] == pytest.approx(1.4, rel=1e-12)

"""The implicit stepper against closed forms, the modal approach, and exact and explicit runs."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import stridor as st
from marching import belt_motion, block_on_belt, cut, points_of, run, touch
from mode_coupling import mode_coupling
from random_contacts import random_system
from solid_cases import DOYEN, WALL
from stridor.agreement.perturbation import modes_as_in_time, perturb
from stridor.case import loads, template_text
from stridor.laws import Coulomb, StaticKinetic, Weakening
from stridor.study.settings import phases_of, settings_of
from stridor.system import System
from stridor.temporal import simulate as simulate_module
from stridor.temporal.energy import energy_balance
from stridor.temporal.schedule import PhaseSpec
from stridor.temporal.simulate import Settings, plan, simulate
from stridor.temporal.steppers import coordinates
from stridor.temporal.steppers.implicit import loop, node_law, stepper, warp, whole_steps
from stridor.temporal.steppers.implicit.node_law import spring_force
from stridor.temporal.steppers.implicit.warp import warped

pytestmark = pytest.mark.verification

OPEN, STICK, SLIP = 0, 1, 2
CLOSED = 1e-9  # of what was exchanged: all that goes amiss is rounding


def implicit(system: System, duration: float, **settings: Any):
    return run(system, duration, stepper="implicit", **settings)


# -- closed forms --------------------------------------------------------------------------------------------------------


def test_mass_on_a_belt():
    """μs 0.4, μk 0.3, v 0.2, m = k = N = 1: period 6.355890, x between 0.3 ∓ A; off by the step at most where it lets
    go, and less the smaller it is."""
    amplitude, off = math.hypot(0.1, 0.2), []
    for step in (2e-2, 5e-3, 1.25e-3):
        system = block_on_belt(law=StaticKinetic(0.3, 0.4), speed=0.2)
        result = implicit(system, 60.0, step=step, velocities={"belt": 1.0}, watch=("block",))
        u, status = result.displacement[:, 0, 0], result.status[:, 0]
        begins = result.time[1:][(status[1:] == SLIP) & (status[:-1] == STICK)]
        assert np.mean(np.diff(begins[1:])) == pytest.approx(6.355890, abs=step)
        sticks = np.mean(status[result.time > begins[1]][: round(6.355890 * 7 / step)] == STICK)
        assert sticks == pytest.approx(1.0 / 6.355890, abs=step)
        later = result.time > 20.0
        off.append(max(abs(u[later].min() - 0.3 + amplitude), abs(u[later].max() - 0.3 - amplitude)))
        assert energy_balance(result).error < CLOSED
    assert off[0] < 2e-3
    assert off[2] < 0.15 * off[0]


def test_coulomb_oscillator():
    """SDND100: extrema −0.65, 0.45, −0.25, 0.05 (×1e-3) at nπ/100, then stuck: to rounding where these are ends of
    steps, else of second order."""
    turns = [-0.65e-3, 0.45e-3, -0.25e-3, 0.05e-3]
    system, off = block_on_belt(stiffness=1e4, law=Coulomb(0.1), press=10.0), []
    for parts in (20, 20.4, 40.4, 80.4):
        step = math.pi / 100 / parts
        asked = {"step": step, "start": ([0.85e-3, 0.0], 0.0, 0.0), "watch": ("block",)}
        result = implicit(system, round(6 * parts) * step, **asked)
        u = result.displacement[:, 0, 0]
        off.append(np.abs(u[np.rint(parts * np.arange(1, 5)).astype(int)] - turns).max())
        assert np.all(result.status[math.ceil(4 * parts) + 2 :, 0] == STICK)
        assert np.ptp(u[math.ceil(4 * parts) + 3 :]) < 1e-12
        assert result.normal_force == pytest.approx(10.0, rel=1e-12)
        assert energy_balance(result).error < CLOSED
    assert off[0] < 1e-15
    assert off[1] < 1e-5
    assert off[3] < 0.2 * off[1]


def test_friction_oscillator():
    """Siconos: m = k = 1, friction 1, from x = 12, v = 6: turns at 13.317821, −11.317821, …, stops at 0.682179 after
    22.423556 s (their Euler–Moreau run with h = 0.01: 0.682044)."""
    off = []
    for step in (0.04, 0.01):
        system = block_on_belt(law=Coulomb(1.0))
        result = implicit(system, 24.0, step=step, start=([12.0, 0.0], [6.0, 0.0], 0.0), watch=("block",))
        u = result.displacement[:, 0, 0]
        assert u.max() == pytest.approx(13.317821, abs=step**2)
        assert u.min() == pytest.approx(-11.317821, abs=2 * step**2)
        stops = result.time[np.flatnonzero(result.status[:, 0] == SLIP)[-1]]
        assert stops == pytest.approx(22.423556, abs=2 * step)
        off.append(abs(u[-1] - 0.682179))
    assert off[1] < 1.35e-4  # of theirs
    assert off[1] < off[0]


def test_two_masses():
    """SDND106: two masses of 5 kg, k 1e4, 1e4 N on the first, μs 0.3, μd 0.2, 3000 N on the second up to 0.2 s."""
    spring = 1e4 * np.array([[1.0, -1.0, 0.0], [-1.0, 1.0, 0.0], [0.0, 0.0, 0.0]])
    contact = touch([0.0, 0.0, 1.0], [1.0, 0.0, 0.0], law=StaticKinetic(0.2, 0.3))
    pushes = {"pull": np.array([0.0, 3000.0, 0.0]), "press": np.array([0.0, 0.0, -1e4])}
    system = System(5 * np.eye(3), np.zeros((3, 3)), spring, (contact,), pushes, points=points_of(3, one=0, two=1))
    phases = [PhaseSpec("pull", 0.2, {}, {}), PhaseSpec("free", 0.15, {"pull": 0.0}, {})]
    off = []
    for step in (1e-3, 2.5e-4, 6.25e-5):
        result = simulate(system, phases, Settings(step=step, record_every=1, stepper="implicit", watch=("one", "two")))
        one, two = result.displacement[:, 0, 0], result.displacement[:, 1, 0]
        slips = np.flatnonzero(result.status[:, 0] == SLIP)
        assert result.time[slips[0]] == pytest.approx(0.0351241, abs=1.1 * step)
        again = slips[0] + np.flatnonzero(result.status[slips[0] :, 0] == STICK)[0]
        assert result.time[again] == pytest.approx(0.314923, abs=2 * step)
        at = round(0.15 / step)
        assert two[round(0.02 / step)] == pytest.approx(0.112210, rel=1e-4)
        off.append(max(abs(one[at] / 1.353338 - 1), abs(two[at] / 1.807532 - 1)))
        assert energy_balance(result).error < CLOSED
    assert off[0] < 5e-3
    assert off[2] < 0.1 * off[0]


def test_a_block_falls_and_slides():
    """Parabola, inelastic impact with friction in it, μg of deceleration; the impact takes m g h."""
    contact = touch([0.0, 1.0], [1.0, 0.0], gap=0.1, law=Coulomb(0.2))
    system = System(
        np.eye(2), np.zeros((2, 2)), np.zeros((2, 2)), (contact,), {"weight": np.array([0.0, -10.0])},
        points=points_of(2, along=0, across=1),
    )  # fmt: skip
    for step in (1e-2, 1e-3):  # steps of constant forces are right, wherever in one the impact falls
        result = implicit(system, 1.0, step=step, start=(0.0, [2.0, 0.0], 0.0), watch=("along", "across"))
        x, y, time = result.displacement[:, 0, 0], result.displacement[:, 1, 0], result.time
        struck = math.sqrt(2 * 0.1 / 10.0)
        before, after = time < struck - 2 * step, time > struck + 3 * step
        assert y[before] == pytest.approx(-5 * time[before] ** 2, abs=1e-14)
        assert y[after] == pytest.approx(-0.1, abs=1e-11)  # whatever the gap was at the end of the step
        left = 2.0 - 0.2 * 10.0 * struck  # friction acts in the impact, too
        slides = np.minimum(time[after] - struck, left / 2.0)
        assert x[after] == pytest.approx(2.0 * struck + left * slides - slides**2, abs=1e-11)
        assert result.works["contact"][-1] == pytest.approx(1.0, rel=1e-11)  # m g h
        assert energy_balance(result).error < CLOSED


@pytest.mark.parametrize("contact", ["rigid", 1e3])
def test_a_body_dropped_on_springs_and_obstacles_gains_no_energy(contact: Any):
    """Four hundred bounces on a spring: it keeps its energy to rounding; rigid contact takes it at once."""
    wall = touch([1.0, 0.0], [0.0, 1.0], gap=0.1, law=Coulomb(0.0))
    wall = wall if contact == "rigid" else replace(wall, stiffness=contact)
    system = System(
        np.eye(2), np.zeros((2, 2)), np.diag([1.0, 1.0]), (wall,), {"push": np.array([-1.0, 0.0])},
        points=points_of(2, block=0),
    )  # fmt: skip
    result = implicit(system, 400.0, step=0.03, watch=("block",))
    assert energy_balance(result).error < CLOSED
    u = result.displacement[:, 0, 0]
    squeezed = np.minimum(u + 0.1, 0.0)
    if contact == "rigid":
        assert u[-1] == pytest.approx(-0.1, abs=1e-12)
        assert result.works["contact"][-1] == pytest.approx(0.1 - 0.5 * 0.1**2, rel=0.1)
    else:
        assert result.works["contact"] == pytest.approx(0.5 * contact * squeezed**2, abs=1e-9)
        assert np.abs(u[len(u) // 2 :]).max() == pytest.approx(np.abs(u[: len(u) // 2]).max(), rel=0.05)


def test_a_bar_strikes_a_wall():
    """SDNV100: contact from 20 to 100 µs with 1.6 MN, the free end turns at 60 µs and −6 mm, the bar leaves with 100
    m/s: as far as the waves that the mesh and the step let through."""
    case = loads(WALL)
    found = st.simulate(
        case.with_({"temporal.stepper": "implicit", "temporal.step": 2.5e-7, "modal.max_frequency_hz": 2e5})
    )
    time, force = found.time, found.normal_force[:, 0]
    touching = time[force > 0.0]
    assert touching[0] == pytest.approx(20e-6, abs=1e-6)
    assert touching[-1] == pytest.approx(100e-6, rel=0.02)
    assert force[(time > 30e-6) & (time < 90e-6)].mean() == pytest.approx(1.6e6, rel=0.01)
    assert found.displacement[:, 0, 0].min() == pytest.approx(-6e-3, rel=0.01)
    assert time[np.argmin(found.displacement[:, 0, 0])] == pytest.approx(60e-6, rel=0.02)
    assert found.velocity[time > 125e-6, 0, 0].mean() == pytest.approx(100.0, rel=0.03)
    assert energy_balance(found).error < CLOSED


def test_a_bar_of_doyen_strikes_a_wall():
    """Contact from 0.5 to 1.1667 with a pressure of 300, rebound with 10; energy is lost in impacts only."""
    case = loads(DOYEN).with_({"temporal.stepper": "implicit", "temporal.step": 2.5e-3, "modal.max_frequency_hz": 50.0})
    found = st.simulate(case)
    time, force = found.time, found.normal_force[:, 0]
    assert time[force > 0.0][0] == pytest.approx(0.5, abs=5e-3)
    assert time[force > 0.0][-1] == pytest.approx(1.1667, rel=0.02)
    assert force[(time > 0.55) & (time < 1.1)].mean() == pytest.approx(300.0 * 0.5, rel=0.01)
    after = time > 1.25
    assert np.mean(found.velocity[after, :, 0]) == pytest.approx(10.0, rel=0.05)
    lost = found.works["contact"][-1]
    assert 0.0 <= lost < 0.03 * found.kinetic[0]
    assert energy_balance(found).error < CLOSED


# -- energy, without the stepper's own accounts ---------------------------------------------------------------------------


def off_in_energy(system: System, result: st.Trajectory) -> dict[str, float]:
    """How far energies and works, from recorded positions, velocities and forces alone with the masses, dampers and
    springs of the system, are off one another ("stored") and off the run's own accounts, in shares of what was turned
    over. All freedoms are watched, every step is recorded."""
    rows = np.vstack([system.points[name].free[:2].toarray() for name in result.watch_names])
    assert np.linalg.matrix_rank(rows) == system.size
    assert result.record_every == 1
    back, records = np.linalg.pinv(rows), len(result.time)
    u, v = (x.reshape(records, -1) @ back.T for x in (result.displacement, result.velocity))
    nodes = system.contact_nodes()

    def total(power: np.ndarray) -> np.ndarray:
        return np.append(0.0, np.cumsum(0.5 * (power[1:] + power[:-1]) * np.diff(result.time)))

    def form(x: np.ndarray, matrix: Any) -> np.ndarray:
        return np.einsum("rn,rn->r", x, x @ matrix.toarray())

    stored = 0.5 * form(v, system.mass) + 0.5 * form(u, system.stiffness)
    normal, friction = result.normal_force, result.tangential_force
    given = {
        "damping": -total(form(v, system.damping)),
        "contact": total(np.einsum("rm,rm->r", normal, v @ nodes.normal.toarray().T)),
        "external": total(v @ sum(system.loads.values())),
        "friction": total(np.einsum("rm,rm->r", friction, v @ nodes.tangent.toarray().T)),
    }
    turned = max(float(np.abs(w).max()) for w in (stored, *given.values()))
    off = {"stored": np.abs(stored - stored[0] - sum(given.values())).max() / turned}
    given["friction"] = total(np.einsum("rm,rm->r", friction, result.slip_speed))  # what slip takes, supports' with it
    for name, work in given.items():
        told = result.works[name] if name == "external" else -result.works[name]
        off[name] = np.abs(told - told[0] - work).max() / turned
    return off


def mass_on_a_belt(step: float) -> tuple[System, st.Trajectory]:
    """As above, with a damper."""
    system = block_on_belt(law=StaticKinetic(0.3, 0.4), speed=0.2, damping=0.05)
    system = replace(system, points=points_of(2, block=0, across=1))
    motions = len(system.motion.names)
    system = replace(
        system, points={n: replace(p, lift=np.zeros((2, motions))) for n, p in system.points.items()}
    )
    return system, implicit(system, 60.0, step=step, velocities={"belt": 1.0}, watch=("block", "across"))


def mass_that_parts(step: float) -> tuple[System, st.Trajectory]:
    """Hoffmann's model on a slow belt: stick, reversal and separation, from a touch beside steady sliding."""
    case = mode_coupling(0.02, 0.1).with_(
        {"temporal.stepper": "implicit", "temporal.step": step, "temporal.perturbation": 0.05}
    )
    return st.Workspace(case).system(), st.simulate(case, mu=1.4)


@pytest.mark.parametrize("made", [mass_on_a_belt, mass_that_parts])
def test_recorded_forces_do_what_recorded_states_store(made: Any):
    """The balance of the stepper's own accounts is an identity of its scheme; this one is not: it goes with the square of
    the step (the warped masses), and with the step where something jumps."""
    steps = (4e-2, 1e-2)
    off = [off_in_energy(*made(step)) for step in steps]
    for name, first in off[0].items():
        assert first < 2e-3, name
        assert off[1][name] < max(0.3 * first, 1e-12), name


# -- growth --------------------------------------------------------------------------------------------------------------


def test_a_mode_turns_and_decays_as_it_should():
    """One warped mode: the roots of its quadratic are (2/h) tanh(λh/2)."""
    step = 0.1
    squares, damping = np.array([0.0, 1e-6, 4.0, 100.0, -9.0]), np.array([0.0, 1e-4, 0.02, 0.1, 0.01])
    found = warped(squares, np.diag(damping), step)
    for k in range(len(squares)):
        roots = np.roots([1.0, damping[k], squares[k]])
        seen = np.roots([found.mass[k], found.damping[k, k], squares[k]])
        wanted = 2 / step * np.tanh(roots * step / 2)
        assert sorted(seen, key=lambda v: (v.real, v.imag)) == pytest.approx(
            sorted(wanted, key=lambda v: (v.real, v.imag)), rel=2e-5, abs=1e-12
        )


def off_modes(case: st.Case, mu: float, limit_hz: float, parts: list[float]) -> np.ndarray:
    """Growth and frequency (k, 2) of the fastest growing mode in a small motion, over those of the mode, less one, with
    so many steps to its period."""
    system, asked = st.build_system(case), settings_of(case)
    modes = modes_as_in_time(asked.system(system), mu, limit_hz)
    wanted = modes.eigenvalues[0][np.argmax(modes.eigenvalues[0].real)]
    found = []
    for part in parts:
        step = 2 * np.pi / wanted.imag / part
        settings = replace(asked, stepper="implicit", step=step, max_frequency_hz=limit_hz)
        seen = perturb(system, mu, settings=settings, max_frequency_hz=limit_hz, modes=modes).components.eigenvalues
        value = seen[np.argmin(np.abs(seen - wanted))]
        found.append([value.real / wanted.real - 1, value.imag / wanted.imag - 1])
    return np.abs(found)


@pytest.mark.parametrize("contact", ["rigid", pytest.param("as given", marks=pytest.mark.slow)])
def test_a_small_motion_grows_as_the_modes_say(contact: str):
    """Two beams whose contact stays closed and slides: right to 1e-3 with 30 steps to the period, of fourth order."""
    case = st.loads(template_text("two-beams")).with_(
        {"bodies.beam1.elements": 10, "bodies.beam2.elements": 20, "temporal.contact": contact}
    )
    off = off_modes(case, 0.1, 10.4e3, [12, 24, 30])
    assert off[2, 0] < 1e-3
    assert off[2, 1] < 1e-5
    assert off[1, 0] < 0.15 * off[0, 0]


@pytest.mark.parametrize("part", [20, 30])
def test_the_plain_midpoint_rule_loses_what_it_is_said_to(part: int, monkeypatch: pytest.MonkeyPatch):
    """Without the warp growth falls by (ωh)²/4 of itself and the frequency by (ωh)²/12."""
    monkeypatch.setattr(warp, "LAST", 1e-9)
    case = st.loads(template_text("two-beams")).with_(
        {"bodies.beam1.elements": 10, "bodies.beam2.elements": 20, "temporal.contact": "rigid"}
    )
    (growth, frequency), square = off_modes(case, 0.1, 10.4e3, [part])[0], (2 * np.pi / part) ** 2
    assert growth == pytest.approx(square / 4, rel=0.1)
    assert frequency == pytest.approx(square / 12, rel=0.1)


COARSE = {
    "bodies.disc.mesh.divisions": [4, 32, 1],
    "bodies.lining.mesh.divisions": [4, 8, 1],
    "bodies.plate.mesh.divisions": [3, 7, 1],
    "modal.max_frequency_hz": 3000.0,
}


@pytest.mark.parametrize("contact", [pytest.param("rigid", marks=pytest.mark.slow), "as given"])
@pytest.mark.parametrize(
    "complete", [pytest.param(True, marks=pytest.mark.slow), False], ids=["all modes", "reduced"]
)
def test_a_pad_on_a_disc_grows_as_the_modes_say(contact: str, complete: bool, monkeypatch: pytest.MonkeyPatch):
    """45 nodes in space, friction that turns with the slip: growth within 1 % with 30 steps to the period."""
    monkeypatch.setattr(coordinates, "COMPLETE", 2000 if complete else 100)
    case = st.loads(template_text("pad-on-disc")).with_(COARSE | {"temporal.contact": contact})
    off = off_modes(case, 0.5, 3000.0, [30])
    assert off[0, 0] < 0.01
    assert off[0, 1] < 5e-5


# -- against the other steppers ------------------------------------------------------------------------------------------


def off_exact(seed: int) -> tuple[list[float], int]:
    """How far runs of smaller and smaller steps are off the exact one, over its largest displacement, up to where the
    first is off by a twentieth; changes of status up to there."""
    system, start = random_system(seed)
    grid, duration = 0.02, 8.0
    asked = {"velocities": {"belt": 1.0}, "start": (start, 0.0, 0.0), "watch": ("first", "last")}
    wanted = run(system, duration, step=grid, stepper="exact", **asked)
    last, found = len(wanted.time), []
    for parts in (2, 8, 32, 128, 512):
        result = implicit(system, duration, step=grid / parts, **asked | {"record_every": parts})
        assert energy_balance(result).error < 1e-7, seed  # rounding, which grows as steps of 1e-3 of a period get smaller
        off = np.abs(result.displacement[:last] - wanted.displacement[:last]).max(axis=(1, 2))
        off /= np.abs(wanted.displacement).max()
        if not found:
            far = np.flatnonzero(off > 0.05)
            last = int(far[0]) if len(far) else last
        found.append(float(off[:last].max()))
        if len(found) > 1 and found[-1] < max(0.2 * found[0], 1e-5):
            break
    return found, int(np.count_nonzero(np.diff(wanted.status[:last], axis=0)))


@pytest.mark.parametrize(
    "seeds", [range(3), *(pytest.param(k, marks=pytest.mark.slow) for k in (range(3, 8), range(100, 400)))],
    ids=["few", "some", "many"],
)
def test_random_systems_go_to_the_exact_run_with_smaller_steps(seeds: range):
    changes = refused = apart = 0
    for seed in seeds:
        try:
            found, met = off_exact(seed)
        except st.AnalysisError as jams:  # no motion goes with the law of friction
            if not any(said in str(jams) for said in ("accumulate", "friction jams")):
                raise
            refused += 1
            continue
        apart += found[-1] >= max(0.2 * found[0], 1e-5)
        changes += met
    assert apart <= 0.02 * len(seeds)
    assert refused <= 0.01 * len(seeds)
    assert changes > 3 * len(seeds)


@pytest.mark.parametrize("mu", [None, 1.1])
def test_a_mass_on_an_obstacle_grows_and_parts_as_in_the_exact_run(mu: float | None):
    """Hoffmann et al. 2002 with stick and separation."""
    case = mode_coupling()
    wanted = st.simulate(case, mu=mu)
    assert wanted.path == "exact"
    assert {OPEN, SLIP} <= set(wanted.status[:, 0].tolist())
    off = []
    for parts in (1, 4, 16):
        changed = {"temporal.stepper": "implicit", "temporal.step": 0.05 / parts, "temporal.record_every": parts}
        other = st.simulate(case.with_(changed), mu=mu)
        off.append(np.abs(other.displacement - wanted.displacement).max() / np.abs(wanted.displacement).max())
        assert energy_balance(other).error < CLOSED
    assert off[0] < 0.1
    assert off[2] < 0.2 * off[0]


SHORT = {
    "bodies.beam1.elements": 6,
    "bodies.beam2.elements": 12,
    "contacts.A.friction.coefficient": 0.35,
    "phases.press.duration": 2e-4,
    "phases.press.ramp": 1e-4,
    "phases.slide.duration": 1e-3,
}


@pytest.mark.parametrize("contact", ["rigid", "as given"])
def test_the_bench_from_rest_as_in_explicit_steps(contact: str):
    """Pressed by a ramp, then suddenly slid: loads and speeds that change, impacts, the same forces and works."""
    case = st.loads(template_text("two-beams")).with_(SHORT | {"temporal.contact": contact, "contacts.A.stiffness": 2e8})
    wanted = st.simulate(case.with_({"temporal.step": 1e-8, "temporal.record_every": 100}))
    off = []
    for step, every in ((1e-6, 1), (2.5e-7, 4), (6.25e-8, 16)):
        changed = {"temporal.stepper": "implicit", "temporal.step": step, "temporal.record_every": every}
        other = st.simulate(case.with_(changed))
        assert other.time == pytest.approx(wanted.time)
        off.append(np.abs(other.displacement - wanted.displacement).max() / np.abs(wanted.displacement).max())
        assert energy_balance(other).error < CLOSED
    for name, values in wanted.works.items():
        turned = max(float(np.abs(w).max()) for w in wanted.works.values())
        assert np.abs(other.works[name] - values).max() < 0.02 * turned, name
    assert off[2] < max(0.3 * off[0], 1e-4)


# -- how contacts are solved, and runs -----------------------------------------------------------------------------------


def test_the_force_of_a_spring_does_the_work_that_it_loses():
    rng = np.random.default_rng(2)
    for _ in range(300):
        before, after = rng.uniform(-1.0, 1.0, 2)
        force, softening = spring_force(7.0, before, after)
        stored = [3.5 * min(g, 0.0) ** 2 for g in (before, after)]
        assert force * (after - before) == pytest.approx(stored[0] - stored[1], abs=1e-12)
        step = 1e-6
        ahead, behind = (spring_force(7.0, before, after + s)[0] for s in (step, -step))
        assert softening == pytest.approx((behind - ahead) / (2 * step), abs=1e-4)


def pad(**changes: Any) -> st.Case:
    """A coarse pad that is shaken so hard that it sticks and parts."""
    return st.loads(template_text("pad-on-disc")).with_(
        COARSE | {"temporal.stepper": "implicit", "temporal.record_every": 1, "phases.slide.duration": 4e-4,
                  "temporal.perturbation": 3.0, **changes}
    )  # fmt: skip


@pytest.mark.parametrize("contact", [pytest.param("rigid", marks=pytest.mark.slow), "as given"])
def test_newtons_method_and_sweeps_find_the_same_impulses(contact: str, monkeypatch: pytest.MonkeyPatch):
    case = pad(**{"temporal.contact": contact})
    swept = st.simulate(case)
    assert swept.unconverged_steps == 0
    assert {OPEN, SLIP} <= set(np.unique(swept.nodes.status))
    plain, sweeps = node_law.solve_nodes, []

    def solved(limit: int, *args: Any) -> int:
        sweeps.append(plain(limit, *args))
        return sweeps[-1]

    march = stepper.ImplicitStepper._march

    def one_step_each(self: Any, steps: int, schedule: Any, *, given: bool) -> int:
        """Every step by Newton's method: free motion first, then its impulses."""
        if given or not steps:
            return march(self, min(steps, 1), schedule, given=given)
        self.work.impulse[:] = self.moving.impulse
        loop.free_of_contact(
            schedule.load_factors(self.done, 1, within=0.5)[0], schedule.motion_increments(self.done, 1)[0],
            schedule.motion_rates(self.done, 1)[0], self.structure, self.nodes, self.moving, self.work,
        )  # fmt: skip
        return loop.HARD

    monkeypatch.setattr(stepper, "solve_nodes", solved)
    monkeypatch.setattr(stepper.ImplicitStepper, "_march", one_step_each)
    by_newton = st.simulate(case)
    assert "were solved by Newton's method" in by_newton.path_reason
    assert np.median(sweeps) <= 2  # nothing was left to sweep
    size = np.abs(swept.normal_force).max()
    early = swept.time < 1e-4  # what is chaotic parts ways in the end
    assert np.abs(by_newton.normal_force - swept.normal_force)[early].max() < 1e-5 * size


def test_laws_hold_at_every_node(monkeypatch: pytest.MonkeyPatch):
    """What is recorded, every step: no force where a gap is open, Coulomb's disc, friction against the slip."""
    found = st.simulate(pad(**{"temporal.contact": "rigid"}))
    assert found.most_sweeps < node_law.SWEEP_LIMIT
    nodes = found.nodes
    size = np.abs(nodes.normal_force).max()
    assert nodes.normal_force.min() >= 0.0
    touching = nodes.status != OPEN
    for_two_steps = touching[:-2] & touching[1:-1]  # by then a gap has closed, whatever it was
    assert np.abs(nodes.gap[2:][for_two_steps]).max() < 1e-12
    assert nodes.gap.min() > -0.01 * np.abs(nodes.gap).max()
    force = np.linalg.norm(nodes.tangential_force, axis=2)
    assert np.all(force <= 0.5 * nodes.normal_force + 1e-9 * size)
    slides = (nodes.status[1:-1] == SLIP) & (nodes.status[:-2] == SLIP) & (nodes.status[2:] == SLIP)
    power = np.einsum("rmt,rmt->rm", nodes.tangential_force, nodes.slip_velocity)[1:-1]
    assert np.mean(power[slides] < 0.0) > 0.99


def test_friction_that_falls_with_speed_feeds_a_motion():
    """About steady sliding at v the block on the belt grows with −(c + μ'(v) N)/2m, with 30 steps to the period within
    1 %."""
    law = Weakening(0.2, 0.5, 0.7)
    system = block_on_belt(law=law, speed=1.0, damping=0.02)
    step, growth = 2 * math.pi / 30, -0.5 * (0.02 + law.slope(1.0))
    result = implicit(
        system, 600 * step, step=step, initial="steady-sliding", velocities={"belt": 1.0},
        start=([1e-6, 0.0], 0.0, 0.0), watch=("block",),
    )  # fmt: skip
    u = result.displacement[:, 0, 0] - law.sliding(1.0)
    size = np.sqrt(u[1:-1] ** 2 + ((u[2:] - u[:-2]) / (2 * step)) ** 2)
    rate = np.polyfit(result.time[1:-1], np.log(size), 1)[0]
    assert np.abs(u).max() < 0.01
    assert rate == pytest.approx(growth, rel=0.01)


def test_a_run_that_is_cut_goes_on_to_the_last_digit(tmp_path):
    case = st.loads(template_text("two-beams")).with_(
        SHORT | {"temporal.stepper": "implicit", "temporal.step": 1e-6, "temporal.record_every": 3}
    )
    whole = st.simulate(case)

    part = cut(case, 77)
    saved = st.open(st.save(part, tmp_path / "part.nc"))
    again = st.simulate(case, restart=saved)
    for name in ("time", "normal_force", "displacement", "acceleration", "status", "kinetic"):
        assert np.array_equal(getattr(again, name), getattr(whole, name)), name
    assert np.array_equal(again.state["implicit_counters"], whole.state["implicit_counters"])
    changed = st.simulate(case.with_({"contacts.A.friction.coefficient": 0.2}), restart=saved, changed=True)
    assert energy_balance(changed).error < 1e-6
    assert np.abs(changed.displacement[len(part.time)] - whole.displacement[len(part.time)]).max() < 1e-9


def test_nodes_that_part_and_strike_go_on_to_the_last_digit(tmp_path):
    """Which nodes have a place in the operator that is swept hangs on what went before; what comes out does not."""
    case = pad()
    whole = st.simulate(case)
    assert len(np.unique([np.flatnonzero(s != OPEN).size for s in whole.nodes.status])) > 10
    assert "nodes part and strike" in whole.path_reason
    assert f"--set temporal.step={whole.step / 4:.4g} --set modal.max_frequency_hz=12000" in whole.path_reason
    calm = st.simulate(pad(**{"temporal.perturbation": 1e-6}))
    assert "nodes part" not in calm.path_reason

    part = cut(case, 7)
    again = st.simulate(case, restart=st.open(st.save(part, tmp_path / "part.nc")))
    for name in ("time", "normal_force", "displacement", "status", "kinetic"):
        assert np.array_equal(getattr(again, name), getattr(whole, name)), name


def test_steps_follow_from_the_highest_frequency_and_the_phases():
    case = st.loads(template_text("two-beams")).with_(SHORT | {"temporal.stepper": "implicit", "temporal.step": None})
    result = st.simulate(case.with_({"modal.max_frequency_hz": 10e3}))
    assert result.step == pytest.approx(1 / 30 / 10e3, rel=0.02)
    assert result.step * round(2e-4 / result.step) == pytest.approx(2e-4, rel=1e-12)
    assert result.path == "implicit"
    assert "all" in result.path_reason


def test_auto_takes_it_for_contact_over_many_nodes_and_says_why():
    case = pad(**{"temporal.stepper": "auto", "phases.slide.duration": 1e-4})
    result = st.simulate(case)
    assert result.path == "implicit"
    assert "45 contact nodes" in result.path_reason
    system = st.build_system(case)
    again = simulate(system, phases_of(case), replace(settings_of(case), step=result.step))
    assert np.array_equal(again.displacement, result.displacement)  # with the step that it came to
    for other in ({"temporal.beta2": 0.6}, {"temporal.step": 1e-7}, {"temporal.path": "assembled"}):
        assert plan(system, settings_of(case.with_(other)))[0] == "assembled"


@pytest.mark.parametrize("why", ["overlap", "jump", "nothing"])
def test_auto_leaves_to_others_what_implicit_steps_refuse_at_the_start(why: str, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(simulate_module, "SMALL", 0)
    monkeypatch.setattr(simulate_module, "MANY", 1)
    if why == "jump":
        case = pressed_by_a_distance("auto", 0.02).with_({"phases.1.ramp": 0.0, "contacts.A.stiffness": "rigid"})
        system, phases = st.build_system(case), phases_of(case)
    else:
        system = block_on_belt(speed=0.2)
        system = replace(system, contacts=(replace(system.contacts[0], gap=-0.1 if why == "overlap" else 0.0),))
        phases = [PhaseSpec("slide", 1.0, {"press": 1.0}, {"belt": 1.0})]
    settings = Settings(stepper="auto", record_every=1, max_frequency_hz=5.0)
    result = simulate(system, phases, settings)
    assert (result.path == "implicit") == (why == "nothing")
    told = {"overlap": "a rigid contact starts with overlap", "jump": "a distance that changes at once", "nothing": ""}[why]
    assert ("implicit steps do not begin so: " in result.path_reason) == (why != "nothing")
    assert told in result.path_reason
    # What is said beforehand is what is done.
    path, reason, _ = plan(system, settings, phases)
    assert path == result.path
    assert result.path_reason.startswith(reason)


def test_what_of_a_start_the_coordinates_do_not_have_is_said():
    case = pad(**{"phases.slide.duration": 2e-5, "temporal.initial": "rest", "temporal.perturbation": 0.0})
    system = st.build_system(case)
    assert "has no place in them" not in simulate(system, phases_of(case), settings_of(case)).path_reason
    # Every other freedom moved one way, all others the other: nothing that vibrates below 6 kHz.
    rough = np.where(np.arange(system.size) % 2, 1.0, -1.0)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(coordinates, "COMPLETE", 10)
        result = simulate(replace(system, initial_velocity=1e-3 * rough), phases_of(case), settings_of(case))
    share = float(result.path_reason.split("; ")[1].split(" %")[0])
    assert 80 < share < 100


@pytest.mark.parametrize(
    ("contact", "said"),
    [({"sliding": "finite"}, "slides finitely")],
)
def test_what_it_does_not_take_is_said(contact: dict[str, Any], said: str):
    system = block_on_belt(speed=0.2)
    system = replace(system, contacts=(replace(system.contacts[0], **contact),))
    with pytest.raises(st.CaseError, match=said) as refused:
        implicit(system, 1.0, step=1e-2)
    assert 'take "explicit"' in str(refused.value)


def test_rigid_contact_that_starts_closed_too_far_is_refused():
    system = block_on_belt(speed=0.2)
    system = replace(system, contacts=(replace(system.contacts[0], gap=-0.1),))
    with pytest.raises(st.CaseError, match=r"contacts.A: 'a gap of -0.1 m at t = 0 s' – a gap >= 0 where"):
        implicit(system, 1.0, step=1e-2)


def test_without_a_step_or_a_frequency_it_does_not_start():
    with pytest.raises(st.CaseError, match=r"temporal.step: missing – a step \[s\], or modal.max_frequency_hz"):
        implicit(block_on_belt(speed=0.2), 1.0)


def test_a_contact_that_is_kept_closed_pulls():
    """A block on a spring in a slide: it swings through its rest, and the slide pulls as much as it pushes."""
    contact = replace(touch([0.0, 1.0], [1.0, 0.0], motions=1, slip=-1.0, law=Coulomb(0.1)), closed=True)
    weight = {"press": np.array([0.0, 1.0])}
    points = {k: replace(r, lift=np.zeros((2, 1))) for k, r in points_of(2, block=1).items()}
    system = System(np.eye(2), np.zeros((2, 2)), np.diag([1.0, 0.0]), (contact,), weight, belt_motion(2), points)
    result = implicit(system, 5.0, step=0.05, velocities={"belt": 1.0}, watch=("block",))
    assert result.normal_force[2:, 0] == pytest.approx(-1.0, abs=1e-12)
    assert np.abs(result.displacement[:, 0, 0]).max() < 1e-12
    assert result.phases[0].contacts["A"].separation_fraction == 0.0


def pressed_by_a_distance(stepper: str, step: float) -> st.Case:
    """A mass on a belt, pressed through a spring by a point that is moved over ramps."""
    return st.Case(
        units="nondimensional",
        bodies={
            "m": {"type": "mass", "mass": 1.0, "position": (0, 0)}, "p": {"type": "mass", "mass": 0.5, "position": (0, 1)},
            "belt": {
                "type": "obstacle", "shape": "flat", "point": (0, 0), "normal": (0, 1), "sliding": {"velocity": (-0.5, 0)}
            },
        },
        springs={
            "a": {"between": ("m", "ground"), "direction": (1, 0.3), "stiffness": 4.0},
            "c": {"between": ("m", "p"), "direction": (0, 1), "stiffness": 5.0},
        },
        dashpots={"d": {"between": ("m", "p"), "direction": (0.3, 1.0), "damping": 0.3}},
        supports={"hold": {"at": "p", "fixed": ("x", "y"), "displacement": {"y": -0.3}}},
        contacts={
            "A": {"slave": "m", "master": "belt", "stiffness": 30.0, "friction": {"law": "coulomb", "coefficient": 0.3}}
        },
        modal={"max_frequency_hz": 1.0},
        phases=[
            {"name": "s", "duration": 1.0, "ramp": 0.6},
            {"name": "t", "duration": 2.0, "displacements": {"hold": 2.0}, "ramp": 0.5, "velocities": {"belt": 0.6}},
        ],
        temporal={"initial": "rest", "step": step, "record_every": 1, "watch": ["m", "p"], "stepper": stepper},
    )  # fmt: skip


def test_accelerations_where_supports_accelerate():
    """Of the mass and of the point that is moved. Where a ramp begins or ends the acceleration jumps, and a record there
    is a mean: the tenth of the records that is furthest off is left out."""
    off = []
    for step in (0.02, 0.005):
        exact, found = (st.simulate(pressed_by_a_distance(s, step)).acceleration for s in ("exact", "implicit"))
        apart = np.abs(found - exact).max(axis=2) / np.abs(exact).max()
        off.append(np.quantile(apart, 0.9, axis=0))
    assert np.all(off[0] < 0.01), off
    assert np.all(off[1] < off[0] / 8 + 1e-9), off


def test_a_step_too_coarse_for_what_is_asked_for_is_refused():
    case = mode_coupling(0.02).with_({"temporal.stepper": "implicit", "modal.max_frequency_hz": 1.0, "temporal.perturbation": None})
    with pytest.raises(st.CaseError, match=r"temporal\.step: 0\.4 – at most 0\.3183 s, a third of the shortest period"):
        st.simulate(case.with_({"temporal.step": 0.4}))
    assert "5 steps to the period of 1 Hz are few" in st.simulate(case.with_({"temporal.step": 0.2})).path_reason
    assert "few" not in st.simulate(case.with_({"temporal.step": 0.05})).path_reason


def test_a_step_of_which_all_phases_are_multiples():
    settings = Settings(max_frequency_hz=1.0, stepper="implicit")
    phases = [PhaseSpec("a", 0.1, {}, {}), PhaseSpec("b", 0.25, {}, {})]
    step = whole_steps(settings, phases)
    assert step == pytest.approx(0.025)
    assert whole_steps(settings, phases[:1]) == pytest.approx(0.1 / 3)


TOUCHING = """
[materials.steel]
young_modulus = 200e9
density = 7800.0
poisson_ratio = 0.3
[bodies.a]
type = "solid"
material = "steel"
model = "plane strain"
mesh = { shape = "rectangle", corner = [0.0, 0.0], size = [0.02, 0.01], divisions = [3, 2], cells = "quad" }
[bodies.b]
type = "solid"
material = "steel"
model = "plane strain"
mesh = { shape = "rectangle", corner = [0.0, 0.01], size = [0.02, 0.01], divisions = [7, 2], cells = "quad" }
[supports.ground]
at = "a.bottom"
fixed = ["x", "y"]
[supports.guide]
at = "b.top"
fixed = ["x"]
[loads.press]
at = "b.top"
pressure = 1e6
[contacts.c]
slave = "b.bottom"
master = "a.top"
stiffness = "rigid"
friction = { law = "coulomb", coefficient = 0.4 }
[[phases]]
name = "press"
duration = 8e-5
ramp = 4e-5
[temporal]
step = 1e-7
stepper = "implicit"
"""


def test_bodies_that_touch_but_for_rounding_neither_overlap_nor_are_apart():
    """Of places on a line at 0.01 m that four nodes weight, some are beside it by a last bit."""
    case = st.loads(TOUCHING)
    assert np.array_equal(st.build_system(case).contact_nodes().gap, np.zeros(8))
    run = st.simulate(case)
    later = run.time > 4e-5
    assert run.normal_force[later, 0].mean() == pytest.approx(1e6 * 0.02, rel=0.02)

"""Phases in steps, records, statistics, restart, interruption, checkpoints: what surrounds the scheme."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

from benches import Slave, bench
from marching import block_on_belt, in_chunks, one_phase, rod, run
from stridor.errors import CaseError
from stridor.laws import StaticKinetic
from stridor.system import System
from stridor.temporal.schedule import PhaseSpec, lay_out
from stridor.temporal.simulate import Settings, simulate
from stridor.temporal.trajectory import Trajectory

pytestmark = pytest.mark.verification

WATCH = ("s0.start", "base.end")
PATHS = ("modal", "nodal")
PHASES = (
    PhaseSpec("press", 2e-4, {"press0": 1.0}, {"clamp": 0.0}, 5e-5),
    PhaseSpec("slide", 3e-4, {"press0": 1.5}, {"clamp": 1.0}, 1e-4),
    PhaseSpec("stop", 1e-4, {}, {"clamp": -0.5}),
)


def histories(result: Trajectory) -> dict[str, np.ndarray]:
    """Every array of a trajectory but the saved state."""
    arrays = {f.name: getattr(result, f.name) for f in fields(result)}
    return {name: a for name, a in arrays.items() if isinstance(a, np.ndarray)} | dict(result.works)


# -- schedule
# ----------------------------------------------------------------------------------------------------------


def blend(x):
    x = np.clip(x, 0.0, 1.0)
    return x**3 * (10 - 15 * x + 6 * x**2)


def test_ramp_displacement_is_the_exact_integral_of_the_velocity():
    """Increments of the support against quadrature of the quintic, within a ramp that ends between two
    steps."""
    step, ramp = 0.01, 0.5055
    schedule = lay_out(
        [PhaseSpec("still", 0.2, {}, {"a": 0.3}), PhaseSpec("go", 1.0, {}, {"a": 2.0}, ramp)], step, [], ["a"]
    )
    increments = schedule.motion_increments(0, schedule.steps)[:, 0]
    assert np.array_equal(increments[:20], np.full(20, 0.3 * step))
    nodes, weights = np.polynomial.legendre.leggauss(8)
    for k in range(20, schedule.steps):
        # The kink at the ramp's end is split.
        low, high = k * step - 0.2, (k + 1) * step - 0.2
        total = 0.0
        for a, b in ((low, min(max(low, ramp), high)), (min(max(low, ramp), high), high)):
            x = (a + b) / 2 + (b - a) / 2 * nodes
            total += (b - a) / 2 * np.sum(weights * (0.3 + 1.7 * blend(x / ramp)))
        assert increments[k] == pytest.approx(total, rel=1e-13)
    # In all: the old velocity for half the ramp, the new one for the rest.
    assert increments[20:].sum() == pytest.approx(0.3 * ramp / 2 + 2.0 * (1.0 - ramp / 2), rel=1e-13)


def test_ramp_is_smooth_and_a_sudden_start_is_not():
    step = 1e-3
    smooth = lay_out([PhaseSpec("go", 1.0, {"f": 1.0}, {"a": 1.0}, 0.5)], step, ["f"], ["a"])
    rate = smooth.motion_increments(0, 1000)[:, 0] / step
    assert np.abs(np.diff(rate) / step).max() == pytest.approx(
        15 / 8 / 0.5, rel=1e-3
    )  # greatest slope of the quintic
    assert np.abs(np.diff(rate, 2) / step**2).max() == pytest.approx(5.7735 / 0.5**2, rel=1e-2)
    assert np.abs(np.diff(rate, 3) / step**3).max() < 61 / 0.5**3  # C2: no jump of the second derivative
    load = smooth.load_factors(0, 1000)[:, 0]
    assert np.allclose(load, blend(np.arange(1000) * step / 0.5), atol=1e-15)
    sudden = lay_out([PhaseSpec("go", 1.0, {"f": 1.0}, {"a": 1.0})], step, ["f"], ["a"])
    assert np.array_equal(sudden.motion_increments(0, 1000), np.full((1000, 1), step))
    assert np.array_equal(sudden.load_factors(0, 1000), np.ones((1000, 1)))


def test_factors_hold_until_changed():
    schedule = lay_out(PHASES, 1e-6, ["press0", "other"], ["clamp"])
    assert [s.last for s in schedule.stretches] == [200, 500, 600]
    assert np.array_equal(schedule.load_factors(199, 1), [[1.0, 1.0]])
    assert np.array_equal(schedule.load_factors(499, 2), [[1.5, 1.0], [1.5, 1.0]])
    # Pieces of any size are the whole.
    whole = schedule.motion_increments(0, 650)
    pieces = np.vstack([schedule.motion_increments(first, 130) for first in range(0, 650, 130)])
    assert np.array_equal(whole, pieces)
    assert np.array_equal(whole[600:], np.full((50, 1), -0.5e-6))  # past the end, as in the last phase


def test_sudden_start_shakes_and_a_ramp_does_not():
    """An undamped rod pulled at one end: peak force of a sudden start c√(Eρ) v, next to nothing with a slow
    ramp."""
    system = bench(Slave(), damping=(0.0, 0.0), velocity=1.0)
    system = replace(system, contacts=())
    swing = {}
    for ramp in (0.0, 3e-3):
        result = run(system, 4e-3, loads={"press0": 0.0}, ramp=ramp, record_every=1, watch=("base.end",))
        late = result.time > 3.2e-3
        swing[ramp] = np.abs(result.velocity[late, 0, 0] - 1.0).max()
    assert swing[0.0] > 0.8
    assert swing[3e-3] < 1e-3


# -- records and statistics
# --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("every", [3, 7, 50])
def test_decimated_records_are_those_of_every_step(every, path):
    system = bench(Slave(lean_deg=20.0), velocity=1.0)
    all_steps, some = (
        simulate(system, PHASES, Settings(record_every=k, path=path, watch=WATCH)) for k in (1, every)
    )
    assert np.array_equal(some.time, np.arange(0, all_steps.steps, every) * all_steps.step)
    assert some.sampling == every * some.step
    for name, values in histories(some).items():
        assert np.array_equal(values, histories(all_steps)[name][::every]), name


@pytest.mark.parametrize("path", PATHS)
def test_statistics_are_those_of_the_records_of_every_step(path):
    system = bench(Slave(lean_deg=20.0), Slave(place=0.3, side=-1), velocity=1.0)
    result = simulate(system, PHASES, Settings(record_every=1, path=path))
    assert [p.name for p in result.phases] == ["press", "slide", "stop"]
    assert {0, 1, 2} == set(np.unique(result.status))
    for number, phase in enumerate(result.phases):
        rows = result.phase_slice(number)
        assert len(result.time[rows]) == round((phase.end - phase.start) / result.step)
        for c, name in enumerate(result.contact_names):
            found, status = phase.contacts[name], result.status[rows, c]
            fractions = [found.separation_fraction, found.stick_fraction, found.slip_fraction]
            assert sum(fractions) == pytest.approx(1.0, abs=1e-14)
            assert fractions == pytest.approx([np.mean(status == k) for k in range(3)], abs=1e-14)
            assert found.max_normal_force == result.normal_force[rows, c].max()
            assert found.max_tangential_force == np.abs(result.tangential_force[rows, c]).max()
            for event, code in ((found.first_stick, 1), (found.first_separation, 0)):
                at = np.flatnonzero(status == code)
                expected = None if not len(at) else result.time[rows][at[0]]
                assert event == (expected if expected is None else pytest.approx(expected))
            # The speed of a step lies between those at its ends, as the scheme has them.
            if found.slip_fraction > 0:
                assert found.max_slip_speed == pytest.approx(
                    np.abs(result.slip_speed[rows, c]).max(), rel=0.2
                )


def test_a_contact_says_it_slips_only_when_it_moves():
    result = run(bench(Slave()), 5e-4, record_every=1)
    stuck = result.status[:, 0] == 1
    # Stuck in two steps running: no slip at t between them.
    still = stuck[1:] & stuck[:-1]
    assert still.sum() > 20
    assert np.abs(result.slip_speed[1:, 0][still]).max() < 1e-12
    assert np.abs(result.slip_speed[~stuck, 0]).max() > 1e-3


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("beta2", [0.5, 0.8])
def test_slip_speed_of_a_record_is_that_of_the_watched_points(path, beta2):
    """Slave minus master along the tangent, by the velocities of the same record."""
    system = bench(Slave(place=0.5), velocity=1.0)
    watch = ("s0.start", "base@0.075")
    rows = {name: system.points.get(name) for name in watch}
    contact = system.contacts[0]
    node = slice(2 * (contact.segment + round(contact.xi)), 2 * (contact.segment + round(contact.xi)) + 2)
    rows["base@0.075"] = type(rows["s0.start"])(contact.master.free[node], contact.master.lift[node])
    system = replace(system, points=rows)
    result = run(system, 3e-4, beta2=beta2, path=path, record_every=3, watch=watch)
    relative = (result.velocity[:, 0] - result.velocity[:, 1]) @ contact.tangent
    assert np.abs(result.slip_speed[:, 0] - relative).max() < 1e-9
    assert np.ptp(relative) > 0.01


# -- restart, interruption, checkpoints
# --------------------------------------------------------------------------------


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("sliding", ["small", "finite"])
@pytest.mark.parametrize("beta2", [0.5, 0.8])
@pytest.mark.parametrize("part", [0.37, 2e-4 / 6e-4, 0.95])
def test_restart_is_bit_for_bit(path, sliding, beta2, part):
    """A run to the end, and the same run stopped anywhere and taken up again."""
    system = bench(Slave(lean_deg=20.0), Slave(place=0.3, side=-1), velocity=2.0)
    system = replace(system, contacts=tuple(replace(c, sliding=sliding, stiffness=1e10 if sliding == "small" else np.inf) for c in system.contacts))
    settings = Settings(record_every=4, beta2=beta2, path=path, watch=WATCH)
    whole = simulate(system, PHASES, settings)

    class Stop:
        """Interrupts at the first chance, from a chunk of the wanted size."""

        def __call__(self, done: int, planned: int) -> None:
            raise KeyboardInterrupt

    stop = round(part * whole.steps)
    with pytest.MonkeyPatch.context() as patch:
        in_chunks(patch, stop)
        first = simulate(system, PHASES, settings, progress=Stop())
    assert first.interrupted
    assert 0 < first.steps < whole.steps
    assert len(first.time) == -(-first.steps // 4)
    for name, values in histories(first).items():
        assert np.array_equal(values, histories(whole)[name][: len(values)]), name
    again = simulate(system, PHASES, settings, restart=first)
    assert not again.interrupted
    assert again.steps == whole.steps
    for name, values in histories(again).items():
        assert np.array_equal(values, histories(whole)[name]), name
    for name, values in whole.state.items():
        if name != "state_predicted":
            assert np.array_equal(values, again.state[name]), name
    assert again.phases == whole.phases
    # The new part by itself.
    tail = simulate(system, PHASES, settings, restart=first, join=False)
    assert np.array_equal(tail.time, whole.time[len(first.time) :])


@pytest.mark.parametrize("path", PATHS)
def test_restart_remembers_that_a_contact_sticks(path, monkeypatch):
    """Stopped between the kinetic and the static limit: only the state of sticking decides how it goes on."""
    system = block_on_belt(law=StaticKinetic(0.3, 0.4), speed=0.2)
    settings = Settings(step=1e-3, record_every=1, path=path)
    start = (np.zeros(2), np.array([0.2, 0.0]), np.zeros(2))
    whole = simulate(system, one_phase(5.0), settings, disturbance=start)
    assert whole.tangential_force[1750, 0] == pytest.approx(0.35, abs=1e-3)
    in_chunks(monkeypatch, 1750)

    def stop(done, planned):
        raise KeyboardInterrupt

    first = simulate(system, one_phase(5.0), settings, disturbance=start, progress=stop)
    assert first.steps == 1750
    again = simulate(system, one_phase(5.0), settings, restart=first)
    assert np.array_equal(again.tangential_force, whole.tangential_force)
    assert np.array_equal(again.status, whole.status)


def test_restart_refuses_another_scheme_or_model():
    system = bench(Slave())
    first = run(system, 1e-4)
    with pytest.raises(CaseError, match="a state of the same scheme"):
        simulate(system, one_phase(2e-4), Settings(record_every=1, beta2=0.6), restart=first)
    with pytest.raises(CaseError, match=r"a state of the same scheme: .*path nodal"):
        simulate(system, one_phase(2e-4), Settings(record_every=1, path="nodal"), restart=first)
    other = bench(Slave(elements=4))
    # As many padded modes, other freedoms.
    with pytest.raises(CaseError, match="a state of the same model"):
        simulate(other, one_phase(2e-4), Settings(record_every=1, step=first.step), restart=first)
    with pytest.raises(CaseError, match=r"every 1 steps of no points.*the same records as before"):
        simulate(system, one_phase(2e-4), Settings(record_every=2), restart=first)
    with pytest.raises(CaseError, match=r"every 1 steps of base.end"):
        simulate(system, one_phase(2e-4), Settings(record_every=1, watch=("base.end",)), restart=first)
    tail = simulate(system, one_phase(2e-4), Settings(record_every=2), restart=first, join=False)
    assert tail.time[0] >= first.time[-1]


def test_interruption_keeps_what_was_computed(monkeypatch):
    in_chunks(monkeypatch, 100)
    calls = []

    def progress(done, planned):
        calls.append((done, planned))
        if done >= 300:
            raise KeyboardInterrupt

    system = bench(Slave(), velocity=1.0)
    whole = simulate(system, PHASES, Settings(record_every=1))
    result = simulate(system, PHASES, Settings(record_every=1), progress=progress)
    assert result.interrupted
    assert not whole.interrupted
    assert result.planned_steps == whole.steps == calls[0][1]
    assert result.steps == calls[-1][0]
    assert [done for done, _ in calls] == sorted({done for done, _ in calls})
    assert np.array_equal(result.normal_force, whole.normal_force[: result.steps])
    assert [p.name for p in result.phases] == ["press", "slide"]
    assert result.phases[0] == whole.phases[0]
    assert result.phases[-1].end == pytest.approx(result.steps * result.step)


def test_checkpoints_are_readable_trajectories(monkeypatch):
    in_chunks(monkeypatch, 150)
    seen = []
    system = bench(Slave(), velocity=1.0)
    settings = Settings(record_every=5)
    whole = simulate(system, PHASES, settings, checkpoint=seen.append, checkpoint_seconds=0.0)
    assert len(seen) >= 3
    assert [t.steps for t in seen] == sorted({t.steps for t in seen})
    assert all(t.interrupted for t in seen[:-1])
    middle = seen[1]
    again = simulate(system, PHASES, settings, restart=middle)
    assert np.array_equal(again.normal_force, whole.normal_force)
    assert np.array_equal(middle.time, whole.time[: len(middle.time)])
    none = []
    simulate(system, PHASES, settings, checkpoint=none.append, checkpoint_seconds=1e9)
    assert none == []


def test_chunks_do_not_matter(monkeypatch):
    system = bench(Slave(), velocity=1.0)
    whole = simulate(system, PHASES, Settings(record_every=2))
    in_chunks(monkeypatch, 37)
    assert np.array_equal(whole.normal_force, simulate(system, PHASES, Settings(record_every=2)).normal_force)


# -- what a run is given
# -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("phases", "settings", "where", "accepted"),
    [
        ([], {}, "phases", "at least one phase is needed"),
        (one_phase(0.0), {}, "phases.0.duration", "a duration is a number > 0"),
        (one_phase(float("nan")), {}, "phases.0.duration", "a duration is a number > 0"),
        (one_phase(1.0, ramp=-1.0), {}, "phases.0.ramp", "0 is sudden"),
        (one_phase(1.0, loads={"pres": 1.0}), {}, "phases.0.loads.pres", "no such load; there are: press0"),
        (one_phase(1.0, loads={"press0": float("inf")}), {}, "phases.0.loads.press0", "a finite number"),
        (one_phase(1.0, velocities={"belt": 1.0}), {}, "phases.0.velocities.belt", "there are: clamp"),
        (one_phase(1.0), {"step": -1e-8}, "temporal.step", "a number > 0"),
        (one_phase(1.0), {"step": float("nan")}, "temporal.step", "a number > 0"),
        (one_phase(1.0), {"beta2": 0.4}, "temporal.beta2", r"lies in \[0.5, 1\]"),
        (one_phase(1.0), {"record_every": 0}, "temporal.record_every", "an integer ≥ 1"),
        (
            one_phase(1.0),
            {"watch": ("nose",)},
            "temporal.watch.0",
            "no such point; the system has: base.start",
        ),
    ],
)
def test_bad_input_is_said_before_the_run(phases, settings, where, accepted):
    with pytest.raises(CaseError, match=accepted) as error:
        simulate(bench(Slave()), phases, Settings(**settings))
    assert [p.where for p in error.value.problems] == [where]


def test_several_problems_at_once():
    with pytest.raises(CaseError) as error:
        simulate(bench(Slave()), one_phase(-1.0, loads={"x": 1.0}), Settings(beta2=2.0))
    assert len(error.value.problems) == 3


def test_a_free_mass_needs_a_step():
    system = System(np.eye(1), np.zeros((1, 1)), np.zeros((1, 1)), (), {"push": np.ones(1)})
    with pytest.raises(CaseError, match="nothing in the system oscillates"):
        run(system, 1.0)
    assert run(system, 1.0, step=0.1).steps == 10


@pytest.mark.parametrize("path", PATHS)
def test_nothing_but_a_structure(path):
    """No contacts, no loads, no moving support: it stays where it is."""
    mass, stiffness = rod(1.0, 1.0, 1.0, 1.0, 4)
    result = run(System(mass, 0 * mass, stiffness), 5.0, path=path)
    assert result.normal_force.shape == (len(result.time), 0)
    assert result.most_sweeps <= 1
    assert np.all(result.kinetic == 0.0)
    assert result.phases[0].contacts == {}


def test_steady_sliding_start_stays_there():
    """From equilibrium the loop only shows rounding, whatever contact stiffness the modal approach uses."""
    for stiffness in (1e10, 1e7, "rigid"):
        system = bench(Slave(stiffness=stiffness))
        result = run(system, 2e-4, initial="steady-sliding", record_every=10)
        assert np.abs(result.normal_force - 20.0).max() < 1e-5, stiffness
        assert np.all(result.status == 2)
    with pytest.raises(CaseError, match="0 when starting from steady sliding"):
        run(system, 2e-4, initial="steady-sliding", ramp=1e-4)


def test_perturbation_is_the_slip_speed_added():
    system = bench(Slave())
    calm, pushed = (
        run(system, 1e-5, initial="steady-sliding", perturbation=p).slip_speed[0, 0] for p in (0.0, 1e-4)
    )
    assert calm == pytest.approx(-0.02)
    assert pushed - calm == pytest.approx(1e-4, rel=0.2)


def test_mu_scales_the_law():
    system = block_on_belt(law=StaticKinetic(0.3, 0.4), speed=0.2)
    result = simulate(system, one_phase(16.0), Settings(step=1e-3, record_every=1), mu=0.225)
    sliding = result.status[:, 0] == 2
    assert np.allclose(np.abs(result.tangential_force[sliding, 0]), 0.225)
    assert np.abs(result.tangential_force).max() == pytest.approx(0.3, rel=1e-2)

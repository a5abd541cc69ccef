"""The exact stepper against closed forms, and as what the explicit scheme goes to with a smaller step."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest

import stridor as st
from marching import belt_motion, block_on_belt, cut, in_chunks, points_of, run, touch
from mode_coupling import mode_coupling
from random_contacts import random_system
from stridor.case import template_text
from stridor.laws import Coulomb, StaticKinetic, Weakening
from stridor.study.settings import settings_of
from stridor.study.workspace import Workspace
from stridor.system import System
from stridor.temporal.energy import energy_balance
from stridor.temporal.schedule import PhaseSpec
from stridor.temporal.simulate import Settings, plan, simulate
from stridor.temporal.steppers.exact.leaps import Leaps
from stridor.temporal.steppers.exact.motion import Motion
from stridor.temporal.steppers.exact.search import CROSSED, NONE, UNDECIDED, first_root, numbers_of, parts_of, planes
from stridor.temporal.steppers.exact.statuses import STICK as STICKS

pytestmark = pytest.mark.verification

OPEN, STICK, SLIP = 0, 1, 2
CLOSED = 1e-9  # of what was exchanged


def exact(system: System, duration: float, **settings: Any):
    return run(system, duration, stepper="exact", **settings)


def test_mass_on_a_belt():
    """μs 0.4, μk 0.3, v 0.2, m = k = N = 1: period 5.355890 + 1, x between 0.3 ∓ A (closed form)."""
    system = block_on_belt(law=StaticKinetic(0.3, 0.4), speed=0.2)
    step = 1e-3
    result = exact(system, 60.0, step=step, velocities={"belt": 1.0}, watch=("block",))
    u, status = result.displacement[:, 0, 0], result.status[:, 0]
    drop, amplitude = 0.1, math.hypot(0.1, 0.2)
    slips = 2 * math.pi - 2 * math.atan(drop / 0.2)
    begins = np.flatnonzero((status[1:] == SLIP) & (status[:-1] == STICK)) + 1
    ends = np.flatnonzero((status[1:] == STICK) & (status[:-1] == SLIP)) + 1
    assert np.diff(result.time[begins]) == pytest.approx(slips + 1.0, abs=1.1 * step)
    # From the moment of letting go at u = 0.4, with the speed of the belt.
    let_go = result.time[ends[0]] + (0.4 - u[ends[0]]) / 0.2
    after = np.mod(result.time - let_go, slips + 1.0)
    wanted = np.where(
        after < slips,
        0.3 + drop * np.cos(after) + 0.2 * np.sin(after),
        0.3 + drop * math.cos(slips) + 0.2 * math.sin(slips) + 0.2 * (after - slips),
    )
    later = result.time > let_go
    assert np.abs(u - wanted)[later].max() < 1e-12
    assert u[later].min() == pytest.approx(0.3 - amplitude, abs=1e-6)
    assert u[later].max() == pytest.approx(0.3 + amplitude, abs=1e-6)
    assert energy_balance(result).error < CLOSED


def test_coulomb_oscillator():
    """SDND100: M 1, K 1e4, μN 1 N, from 0.85e-3: extrema −0.65, 0.45, −0.25, 0.05 (×1e-3) at nπ/100, then stuck."""
    system = block_on_belt(stiffness=1e4, law=Coulomb(0.1), press=10.0)
    result = exact(system, 0.2, step=math.pi / 1e4, start=([0.85e-3, 0.0], 0.0, 0.0), watch=("block",))
    u = result.displacement[:, 0, 0]
    assert u[[100, 200, 300, 400]] == pytest.approx([-0.65e-3, 0.45e-3, -0.25e-3, 0.05e-3], abs=1e-12)
    assert np.all(result.status[401:, 0] == STICK)
    assert np.ptp(u[401:]) < 1e-16
    assert result.normal_force == pytest.approx(10.0, rel=1e-12)
    assert energy_balance(result).error < CLOSED


def test_slip_that_stops_is_held_up_to_the_stick_limit():
    """μs 0.4, μk 0.3, k = N = 1 from 0.95: at rest at −(0.95 − 2 · 0.3) = −0.35, where the spring pulls with 0.35."""
    system = block_on_belt(law=StaticKinetic(0.3, 0.4))
    result = exact(system, 20.0, step=1e-2, start=([0.95, 0.0], 0.0, 0.0), watch=("block",))
    later = result.time > math.pi
    assert result.displacement[later, 0, 0] == pytest.approx(-0.35, abs=1e-12)
    assert np.all(result.status[later, 0] == STICK)


@pytest.mark.parametrize(("speed", "ramp"), [(0.256, 2.54), (0.25, 2.6), (0.3, 2.2), (0.33, 2.27), (0.4, 2.4)])
def test_what_sticks_at_the_end_of_a_ramp_sticks_on(speed: float, ramp: float):
    """k = N = 1, μs 0.6, μk 0.3: at the end of the ramp the belt has gone v T/2, between both, and from there on it goes
    with v until it has gone 0.6. Polynomials that meet there are the same but for rounding, which strikes nothing."""
    system = block_on_belt(law=StaticKinetic(0.3, 0.6), speed=1.0)
    phases = [PhaseSpec("press", 1.0, {"press": 1.0}, {"belt": 0.0}, 0.5),
              PhaseSpec("slide", 6.0, {"press": 1.0}, {"belt": speed}, ramp)]  # fmt: skip
    settings = Settings(record_every=1, watch=("block",), step=0.01, stepper="exact")
    result = simulate(system, phases, settings)
    assert 0.3 < 0.5 * speed * ramp < 0.6
    let_go = 1.0 + ramp + (0.6 - 0.5 * speed * ramp) / speed
    slips = np.flatnonzero((result.status[:, 0] == SLIP) & (result.time > 1.0))
    assert result.time[slips[0]] == pytest.approx(let_go, abs=0.011)
    assert np.abs(result.tangential_force).max() > 0.59
    assert np.all(result.status[result.time > 1.0, 0] != OPEN)
    sticks = (result.time > 1.0 + ramp) & (result.time < let_go)
    wanted = 0.5 * speed * ramp + speed * (result.time[sticks] - 1.0 - ramp)
    assert result.displacement[sticks, 0, 0] == pytest.approx(wanted, abs=1e-12)
    assert energy_balance(result).error < CLOSED


def test_two_masses():
    """SDND106: two masses of 5 kg, k 1e4, 1e4 N on the first, μs 0.3, μd 0.2, 3000 N on the second up to 0.2 s."""
    spring = 1e4 * np.array([[1.0, -1.0, 0.0], [-1.0, 1.0, 0.0], [0.0, 0.0, 0.0]])
    contact = touch([0.0, 0.0, 1.0], [1.0, 0.0, 0.0], law=StaticKinetic(0.2, 0.3))
    loads = {"pull": np.array([0.0, 3000.0, 0.0]), "press": np.array([0.0, 0.0, -1e4])}
    system = System(5 * np.eye(3), np.zeros((3, 3)), spring, (contact,), loads, points=points_of(3, one=0, two=1))
    step = 5e-6
    phases = [PhaseSpec("pull", 0.2, {}, {}), PhaseSpec("free", 0.15, {"pull": 0.0}, {})]
    result = simulate(system, phases, Settings(step=step, record_every=1, stepper="exact", watch=("one", "two")))
    one, two = result.displacement[:, 0, 0], result.displacement[:, 1, 0]
    slips = np.flatnonzero(result.status[:, 0] == SLIP)
    assert result.time[slips[0]] == pytest.approx(0.0351241, abs=1.1 * step)
    assert two[4000] == pytest.approx(0.112210, abs=1e-6)
    assert (one[30000], two[30000]) == pytest.approx((1.353338, 1.807532), abs=1e-6)
    again = slips[0] + np.flatnonzero(result.status[slips[0] :, 0] == STICK)[0]
    assert result.time[again] == pytest.approx(0.314923, abs=1e-6 + 1.1 * step)
    assert two[67993] == pytest.approx(3.968131, abs=1e-6)
    assert energy_balance(result).error < CLOSED


def test_a_block_falls_and_slides():
    """A free block on which nothing pulls but gravity and friction: parabola, inelastic impact, μg of deceleration."""
    contact = touch([0.0, 1.0], [1.0, 0.0], gap=0.1, law=Coulomb(0.2))
    system = System(
        np.eye(2), np.zeros((2, 2)), np.zeros((2, 2)), (contact,), {"weight": np.array([0.0, -10.0])},
        points=points_of(2, along=0, across=1),
    )  # fmt: skip
    result = exact(system, 1.0, step=1e-3, start=(0.0, [2.0, 0.0], 0.0), watch=("along", "across"))
    x, y, time = result.displacement[:, 0, 0], result.displacement[:, 1, 0], result.time
    struck = math.sqrt(2 * 0.1 / 10.0)
    before = time < struck
    assert y[before] == pytest.approx(-5 * time[before] ** 2, abs=1e-14)
    assert y[~before] == pytest.approx(-0.1, abs=1e-14)
    left = 2.0 - 0.2 * 10.0 * struck  # friction acts in the impact, too
    after = np.minimum(time[~before] - struck, left / 2.0)
    assert x[~before] == pytest.approx(2.0 * struck + left * after - after**2, abs=1e-12)
    assert result.works["contact"][-1] == pytest.approx(1.0, rel=1e-12)  # m g h
    assert energy_balance(result).error < CLOSED


class Undecided:
    """When explicit steps do what depends on where in a step it happens, whatever their size: an impact is spread over
    two steps, between which its slip may stop or turn; and slip that stops is held by kinetic friction in that step, by
    static friction from the next one on."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.first = math.inf
        collide, go_through = Motion._collide, Motion._go_through

        def collided(motion: Motion, *args: Any) -> None:
            before = self._slips(motion)
            collide(motion, *args)
            if any(b * a <= 0.0 or abs(a) < 1e-9 for b, a in zip(before, self._slips(motion), strict=True)):
                self.first = min(self.first, motion.time or math.inf)

        def went_through(motion: Motion, meaning: str, c: int) -> None:
            go_through(motion, meaning, c)
            if meaning == "stops" and motion.status[c] == STICKS:
                normal, tangential = motion.driven(motion.status).forces[c]
                state = motion.q, motion.v, motion.drive(motion.time)
                if abs(tangential.at(*state)) > motion.pairs.sliding[c] * normal.at(*state):
                    self.first = min(self.first, motion.time)

        monkeypatch.setattr(Motion, "_collide", collided)
        monkeypatch.setattr(Motion, "_go_through", went_through)

    @staticmethod
    def _slips(motion: Motion) -> np.ndarray:
        return motion.pairs.tangent @ motion.v + motion.support_speeds()[1]


def off_explicit(seed: int, monkeypatch: pytest.MonkeyPatch) -> tuple[list[float], float, int, bool]:
    """How far explicit runs of smaller and smaller steps are off the exact one, up to where what they do depends on
    where in a step it happens, and as far as the first one stays within a hundredth; its energy balance; the changes of
    status met; and whether contacts that threw one another off were brought to rest."""
    system, start = random_system(seed)
    grid, duration = 0.01, 12.0
    asked = {"velocities": {"belt": 1.0}, "start": (start, 0.0, 0.0), "watch": ("first", "last")}
    with monkeypatch.context() as patch:
        patch.setattr(Leaps, "plain", 0)
        undecided = Undecided(patch)
        wanted = exact(system, duration, step=grid, **asked)
    size = np.abs(wanted.displacement).max()
    last = int(np.searchsorted(wanted.time, undecided.first))
    found: list[float] = []
    for parts in (80, 320, 1280, 5120, 20480):
        result = run(system, last * grid, step=grid / parts, **asked | {"record_every": parts})
        last = min(last, len(result.time))
        off = np.abs(result.displacement[:last] - wanted.displacement[:last]).max(axis=(1, 2)) / size
        if not found:  # what is chaotic parts ways in the end
            far = np.flatnonzero(off > 0.01)
            last = int(far[0]) if len(far) else last
        found.append(float(off[:last].max()))
        if len(found) > 1 and found[-1] < max(0.35 * found[0], 1e-6):
            break
    changes = int(np.count_nonzero(np.diff(wanted.status[:last], axis=0)))
    return found, energy_balance(wanted).error, changes, "were brought to rest" in wanted.path_reason


@pytest.mark.parametrize(
    "seeds", [(1, 3, 5, 7), pytest.param(range(100, 400), marks=pytest.mark.slow)], ids=["few", "many"]
)
def test_explicit_runs_go_to_it_with_smaller_steps(seeds: Sequence[int], monkeypatch: pytest.MonkeyPatch):
    changes = accumulated = refused = 0
    for seed in seeds:
        try:
            found, error, met, landed = off_explicit(seed, monkeypatch)
        except st.AnalysisError as jams:  # friction too strong for two contacts together: no motion goes with the law
            if not any(said in str(jams) for said in ("accumulate", "friction jams")):
                raise
            refused += 1
            continue
        accumulated += landed
        assert found[-1] < max(0.35 * found[0], 1e-6), (seed, found)
        assert error < CLOSED, (seed, error)
        changes += met
    assert changes > 3 * len(seeds)
    assert accumulated >= 2  # contacts that threw one another off without end
    assert refused <= 0.01 * len(seeds)


@pytest.mark.parametrize(
    "seeds", [range(8), pytest.param(range(100, 400), marks=pytest.mark.slow)], ids=["few", "many"]
)
def test_plain_changes_are_those_of_all_changes(seeds: range, monkeypatch: pytest.MonkeyPatch):
    """The compiled way through plain changes against `Motion.passed` for all of them: the same motion, works, times of
    statuses and largest forces, up to where rounding has grown."""
    changes = 0
    for seed in seeds:
        system, start = random_system(seed)
        asked = {"velocities": {"belt": 1.0}, "start": (start, 0.0, 0.0), "watch": ("first", "last")}
        found: list[st.Trajectory | str] = []
        for plain in (Leaps.plain, 0):
            with monkeypatch.context() as patch:
                patch.setattr(Leaps, "plain", plain)
                try:
                    found.append(exact(system, 6.0, step=0.01, **asked))
                except st.AnalysisError as jams:
                    found.append(str(jams))
        fast, plainly = found
        if isinstance(fast, str) or isinstance(plainly, str):
            assert str(fast).split(" (t =")[0] == str(plainly).split(" (t =")[0], seed
            continue
        size = np.abs(plainly.displacement).max()
        assert fast.displacement == pytest.approx(plainly.displacement, abs=1e-7 * size), seed
        for name, work in plainly.works.items():
            assert fast.works[name] == pytest.approx(work, abs=1e-7 * np.abs(plainly.kinetic).max()), (seed, name)
        for phase, other in zip(fast.phases, plainly.phases, strict=True):
            for contact, kept in other.contacts.items():
                for what, value in vars(kept).items():
                    wanted = value if value is None else pytest.approx(value, rel=1e-5, abs=1e-7)
                    assert getattr(phase.contacts[contact], what) == wanted, (seed, what)
        changes += int(np.count_nonzero(np.diff(fast.status, axis=0)))
    assert changes > 3 * len(seeds)


@pytest.mark.parametrize("seed", range(6))
def test_the_largest_forces_are_those_of_all_times(seed: int):
    """Few records and many: as large a force, as fast a slip, and none of the many is larger."""
    system, start = random_system(seed)
    asked = {"velocities": {"belt": 1.0}, "start": (start, 0.0, 0.0)}
    few, many = (exact(system, 3.0, step=step, **asked) for step in (0.5, 2e-4))
    for c, name in enumerate(many.contact_names):
        told, other = (run.phases[-1].contacts[name] for run in (few, many))
        pairs = (
            ("max_normal_force", many.normal_force[:, c]),
            ("max_tangential_force", many.tangential_force[:, c]),
            ("max_slip_speed", np.where(many.status[:, c] == SLIP, many.slip_speed[:, c], 0.0)),
        )
        for what, seen in pairs:
            largest = getattr(told, what)
            assert largest == pytest.approx(getattr(other, what), rel=3e-6)
            assert np.abs(seen).max() <= largest * (1 + 3e-6)
            # Smooth between records, but at an impact.
            assert np.abs(seen).max() >= largest * 0.98 or what != "max_tangential_force"


def sums(weights: np.ndarray, poles: np.ndarray, rows: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Re Σ w exp(λt) + a + bt (2, k) at times (k,)."""
    return (weights @ np.exp(poles[:, None] * t)).real + rows[:, :1] + rows[:, 1:] * t


@pytest.mark.filterwarnings("error")
def test_a_root_is_found_beside_a_mode_that_grows_beyond_all_numbers_on_the_longest_part():
    """y = cos t − 1e-6 exp(3000 t): exp(3000) is no number, and what is none decides nothing."""
    poles, weights, rows = np.array([1j, 3000.0 + 0j]), np.array([[1.0 + 0j, -1e-6]]), np.zeros((1, 1))
    numbers, start = numbers_of(weights, poles, rows), planes(np.ones(2, dtype=complex))
    table = parts_of(poles, 1.0)
    assert all(np.isfinite(part).all() for part in table)
    code, _, when, *_ = first_root(numbers, planes(poles), start, table, 1.0, 0, np.empty(4))
    assert code == CROSSED
    assert when == pytest.approx(math.log(1e6) / 3000.0, rel=1e-6)


def test_what_is_no_number_is_no_answer():
    """A mode that no part is too short for: its amount times its factor is beyond all numbers, and less the same."""
    poles, rows = np.array([1.0 + 0j, 1.0 + 0j]), np.ones((1, 1))
    numbers = numbers_of(np.array([[1.0 + 0j, -1.0]]), poles, rows)
    start = planes(np.full(2, 1.7e308, dtype=complex))
    code, *_ = first_root(numbers, planes(poles), start, parts_of(poles, 1.0), 1.0, 0, np.empty(4))
    assert code == UNDECIDED


def test_the_first_root_is_the_first():
    """Sums of three modes, some of which turn many times on the first part: against a fine grid."""
    rng = np.random.default_rng(5)
    times, finer = np.linspace(0.0, 1.0, 40_001), np.linspace(0.0, 1.0, 6)  # five parts where the first one lies
    missed = met = 0
    for _ in range(300):
        poles = np.array([complex(rng.uniform(-1, 1), w) for w in (rng.uniform(0, 5), *rng.uniform(50, 300, 2))])
        weights = (rng.normal(size=(2, 3)) + 1j * rng.normal(size=(2, 3))) * [1.0, 0.3, 0.1]
        rows = np.stack([rng.uniform(0.5, 2.5, 2), rng.normal(size=2)], axis=1)

        at = partial(sums, weights, poles, rows)
        values = at(times)
        if values[:, 0].min() <= 0.0:
            continue
        numbers, start = numbers_of(weights, poles, rows), planes(np.ones(3, dtype=complex))
        code, which, when, *_ = first_root(
            numbers, planes(poles), start, parts_of(poles, 1.0), 1.0, 0, np.empty(6)
        )
        below = np.flatnonzero(values.min(axis=0) < 0.0)
        met += len(below) > 0
        if len(below) == 0:  # a dip between two points of the grid may be a root all the same
            assert code == NONE or values.min() < 1e-4
            continue
        assert code == CROSSED
        near = times[below[0] - 1] + finer * (times[below[0]] - times[below[0] - 1])
        first = near[np.flatnonzero(at(near).min(axis=0) < 0.0)[0]]
        missed += when > first
        assert when == pytest.approx(first, abs=6e-6) or values[:, : below[0]].min() < 1e-4
        assert abs(at(np.array([when]))[which, 0]) < 1e-12
    assert met > 100
    assert missed == 0


@pytest.mark.parametrize("mu", [None, 1.1])
def test_a_mass_on_an_obstacle_grows_and_parts_as_in_explicit_steps(mu: float | None):
    case = mode_coupling()
    wanted = st.simulate(case, mu=mu)
    assert wanted.path == "exact"
    assert {OPEN, SLIP} <= set(wanted.status[:, 0].tolist())
    off = []
    for parts in (20, 80):
        steps = {"temporal.stepper": "explicit", "temporal.step": 0.05 / parts, "temporal.record_every": parts}
        other = st.simulate(case.with_(steps), mu=mu)
        off.append(np.abs(other.displacement - wanted.displacement).max() / np.abs(wanted.displacement).max())
        near = 30 * off[-1]
        for name in ("normal_force", "tangential_force", "slip_speed", "gap"):
            assert np.median(np.abs(getattr(other, name) - getattr(wanted, name))) < near, name
        for name in ("normal_force", "tangential_force", "slip_velocity", "gap"):
            assert np.median(np.abs(getattr(other.nodes, name) - getattr(wanted.nodes, name))) < near, name
    assert off[0] < 1e-3
    assert off[1] < 0.08 * off[0]  # of second order
    assert energy_balance(wanted).error < CLOSED


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_slip_on_an_obstacle_is_told_along_the_tangent_by_all(way: float):
    """Of a mass, and of its mirror image on a belt that goes the other way: in steps of each kind, and in cycles."""
    springs = {f"springs.k{k}.direction": (way * x, 0.5) for k, x in ((1, -0.75**0.5), (2, 0.75**0.5))}
    short = {"phases.slide.duration": 1.0, "temporal.perturbation": 0.01}
    case = mode_coupling(0.02, way).with_(springs | short)
    wanted = st.simulate(case)
    assert np.sign(wanted.slip_speed[0, 0]) == way
    for stepper in ("explicit", "implicit"):
        other = st.simulate(case.with_({"temporal.stepper": stepper, "temporal.step": 0.01, "temporal.record_every": 5}))
        assert other.slip_speed == pytest.approx(wanted.slip_speed, abs=1e-3)
        assert other.tangential_force == pytest.approx(wanted.tangential_force, abs=2e-2)
    for method in ("shooting", "harmonic"):
        cycle = st.cycles(case, mu=[0.95], method=method).cycles[0]
        assert np.sign(cycle.slip_velocity.mean()) == way


def corner(**changes: Any) -> st.Case:
    """A mass on two springs over a belt."""
    case = st.Case(
        units="nondimensional",
        bodies={
            "m": {"type": "mass", "mass": 1.0, "position": (0, 0)},
            "belt": {
                "type": "obstacle", "shape": "flat", "point": (0, 0), "normal": (0, 1), "sliding": {"velocity": (-1, 0)}
            },
        },
        springs={
            "kx": {"between": ("m", "ground"), "direction": (1, 0), "stiffness": 1.0},
            "ky": {"between": ("m", "ground"), "direction": (0, 1), "stiffness": 4.0},
        },
        loads={"press": {"at": "m", "force": (0, -1)}},
        contacts={
            "rub": {
                "slave": "m", "master": "belt", "stiffness": 100.0, "friction": {"law": "coulomb", "coefficient": 0.3}
            }
        },
        modal={"max_frequency_hz": 1.0},
        phases=[{"name": "slide", "duration": 20.0}],
        temporal={"step": 0.01, "record_every": 1, "watch": ["m"], "stepper": "exact"},
    )  # fmt: skip
    return case.with_(changes)


WALL = {
    "bodies.wall": {"type": "obstacle", "shape": "flat", "point": (0, 0), "normal": (1, 0)},
    "loads.press.force": (-1, -1),
}


def as_explicit(case: st.Case, off: float = 1e-3):
    """The exact run of a case, which explicit steps of a hundredth come near to."""
    exactly = st.simulate(case)
    assert exactly.path == "exact"
    fine = case.temporal.step / 100
    other = st.simulate(case.with_({"temporal.stepper": "explicit", "temporal.step": fine, "temporal.record_every": 100}))
    assert other.time == pytest.approx(exactly.time)
    size = np.abs(exactly.displacement).max()
    assert np.abs(other.displacement - exactly.displacement).max() < off * size
    assert energy_balance(exactly).error < CLOSED
    return exactly, other


@pytest.mark.parametrize(
    "changes",
    [
        {"phases": [{"name": "a", "duration": 1.01}, {"name": "b", "duration": 1.0, "loads": {"press": 2.0}}],
         "bodies.belt.point": (0, -0.16)},  # contact is due soon after the end of a phase
        {"springs.ky.stiffness": -1.0, "contacts.rub.friction.coefficient": 0.0, "phases.slide.duration": 3.0},
        {"phases": [{"name": "a", "duration": 0.52, "ramp": 0.52}, {"name": "b", "duration": 3.0}]},
        {"springs.kx.damping": 1.9999},
        {"contacts.rub.stiffness": "rigid", "contacts.rub.friction.coefficient": 0.0, "bodies.belt.point": (0, -0.1)},
    ],
    ids=["phase ends", "divergence", "ramp", "nearly critical", "no friction"],
)  # fmt: skip
def test_strange_but_sound_cases_as_in_explicit_steps(changes: dict[str, Any]):
    as_explicit(corner(**changes))


def test_two_contacts_that_do_the_same_at_once():
    """Dropped, pressed and lifted together; the search may tell neither before the other."""
    twin = {
        "bodies.n": {"type": "mass", "mass": 1.0, "position": (3, 0)},
        "springs.nx": {"between": ("n", "ground"), "direction": (1, 0), "stiffness": 1.0},
        "springs.ny": {"between": ("n", "ground"), "direction": (0, 1), "stiffness": 4.0},
        "loads.second": {"at": "n", "force": (0, -1)},
        "contacts.other": {
            "slave": "n", "master": "belt", "stiffness": 100.0, "friction": {"law": "coulomb", "coefficient": 0.3}
        },
        "bodies.belt.point": (0, -0.1),
        "phases": [
            {"name": "a", "duration": 5.0},
            {"name": "b", "duration": 5.0, "ramp": 1.0, "loads": {"press": -1.0, "second": -1.0}},
        ],
    }  # fmt: skip
    for stiffness in (100.0, "rigid"):
        both = {"contacts.rub.stiffness": stiffness, "contacts.other.stiffness": stiffness}
        found, _ = as_explicit(corner(**twin).with_(both))
        assert np.array_equal(found.status[:, 0], found.status[:, 1])
        assert {0, 2} <= set(found.status[:, 0].tolist())


def test_a_mass_that_two_walls_hold():
    wall = {"slave": "m", "master": "wall", "stiffness": "rigid", "friction": {"law": "coulomb", "coefficient": 0.0}}
    still = corner(**WALL, **{"contacts.wall": wall, "contacts.rub.stiffness": "rigid", "phases.slide.duration": 2.0})
    found = st.simulate(still.with_({"contacts.rub.friction.coefficient": 0.0}))
    assert found.normal_force[-1] == pytest.approx([1.0, 1.0], abs=1e-12)


GUIDED = """
units = "nondimensional"
bodies.m = { type = "mass", mass = 1.0, position = [0.0, 0.0] }
bodies.belt = { type = "obstacle", shape = "flat", point = [0, 0], normal = [0, 1], sliding.velocity = [1.0, 0.0] }
springs.y = { between = ["m", "ground"], direction = [0.0, 1.0], stiffness = 0.5, damping = 0.2 }
supports.guide = { at = "m", fixed = ["x"] }
loads.press = { at = "m", force = [0.0, -1.0] }
contacts.rub = { slave = "m", master = "belt", stiffness = "rigid", friction = { law = "coulomb", coefficient = 0.3 } }
temporal = { step = 0.02, record_every = 1, stepper = "auto", watch = ["m"], initial = "rest" }
modal.max_frequency_hz = 1.0
phases = [
    { name = "press", duration = 4.0, ramp = 2.0, velocities.belt = 0.0 },
    { name = "slide", duration = 4.0, ramp = 2.0, velocities.belt = 1.0 },
    { name = "back", duration = 6.0, ramp = 3.0, velocities.belt = -1.0 },
    { name = "stop", duration = 4.0, ramp = 2.0, velocities.belt = 0.0 },
]
"""
AWAY = 0.6875  # ∫|1 − 2b| over a ramp b from one speed to its opposite


def goes_with_the_law(result: st.Trajectory, friction: Sequence[float]) -> None:
    """What slips is held back by all of its friction, and nothing else slips."""
    later = result.time[:, None] > 1.0
    rests = np.abs(result.slip_speed) < 1e-9
    slips = later & (result.status == SLIP) & ~rests
    wanted = -np.array(friction) * result.normal_force * np.sign(result.slip_speed)
    size = np.abs(result.normal_force).max()
    assert result.tangential_force[slips] == pytest.approx(wanted[slips], abs=1e-9 * size)
    assert np.count_nonzero(later & (result.status == SLIP) & rests) < 10  # where ramps begin and end
    assert np.all(rests[result.status == STICK])
    assert energy_balance(result).error < CLOSED


@pytest.mark.parametrize("plain", [Leaps.plain, 0])
@pytest.mark.parametrize("stiffness", ["rigid", 10.0])
def test_friction_of_slip_that_supports_hold_turns_with_it(
    stiffness: float | str, plain: int, monkeypatch: pytest.MonkeyPatch
):
    """A guided pin, rigid on its belt: friction takes μN times the way of the belt (closed form). It sticks while the
    belt stands."""
    monkeypatch.setattr(Leaps, "plain", plain)
    result = st.simulate(st.loads(GUIDED).with_({"contacts.rub.stiffness": stiffness}))
    assert result.path == "exact"
    goes_with_the_law(result, [0.3])
    way = 1.0 + 2.0 + 3.0 * AWAY + 3.0 + 1.0
    if stiffness == "rigid":
        assert result.works["friction"][-1] == pytest.approx(0.3 * way, rel=1e-12)
    other = st.simulate(st.loads(GUIDED).with_({"contacts.rub.stiffness": stiffness, "temporal.stepper": "implicit"}))
    assert result.works["friction"] == pytest.approx(other.works["friction"], abs=1e-3)
    assert np.count_nonzero(result.status != other.status) < 6  # where ramps begin and end
    slides = np.abs(other.slip_speed) > 0.05
    assert result.tangential_force[slides] == pytest.approx(other.tangential_force[slides], abs=2e-3)
    assert result.tangential_force[-1] == pytest.approx(0.3 * -result.normal_force[-1])  # it keeps what it had
    shares = [(p.contacts["rub"].stick_fraction, p.contacts["rub"].slip_fraction) for p in result.phases]
    assert np.array(shares) == pytest.approx(np.array([[1.0, 0.0], [0.0, 1.0], [0.0, 1.0], [0.5, 0.5]]), abs=1e-9)


@pytest.mark.parametrize("plain", [Leaps.plain, 0])
@pytest.mark.parametrize("wall", ["rigid", 20.0])
def test_a_mass_in_a_corner_of_two_belts(wall: float | str, plain: int, monkeypatch: pytest.MonkeyPatch):
    """Rigid, each contact holds the slip over the other: forces follow the senses of both (closed form)."""
    monkeypatch.setattr(Leaps, "plain", plain)
    speeds = [(0.0, 0.0), (1.0, 0.0), (1.0, -1.0), (-1.0, 0.5), (0.0, 0.0)]
    changes = {
        "bodies.wall": {
            "type": "obstacle", "shape": "flat", "point": (0, 0), "normal": (-1, 0), "sliding": {"velocity": (0, 1.0)}
        },
        "springs.x": {"between": ("m", "ground"), "direction": (1, 0), "stiffness": 0.7, "damping": 0.2},
        "loads.press.force": (2, -3),
        "contacts.side": {
            "slave": "m", "master": "wall", "stiffness": wall, "friction": {"law": "coulomb", "coefficient": 0.2}
        },
        "phases": [
            {"name": f"p{i}", "duration": 4.0, "ramp": 2.0, "velocities": {"belt": belt, "wall": side}}
            for i, (belt, side) in enumerate(speeds)
        ],
    }  # fmt: skip
    free = "\n".join(line for line in GUIDED.splitlines() if not line.startswith("supports"))
    case = st.loads(free).with_(changes)
    result = st.simulate(case)
    assert result.path == "exact"
    goes_with_the_law(result, [0.3, 0.2])
    ends = np.searchsorted(result.time, np.arange(4.0, 20.5, 4.0) - 0.1)
    if wall == "rigid":
        for end, (belt, side) in zip(ends, speeds, strict=True):
            # T₁ = 0.3 N₁ sign along x and T₂ = 0.2 N₂ sign along y, in balance with N₁, N₂ and the load (2, −3); what
            # comes to rest keeps its friction.
            last = (belt, side) if end < ends[-1] else speeds[-2]
            balance = [[-0.3 * np.sign(last[0]), 1.0], [1.0, 0.2 * np.sign(last[1])]]
            assert result.normal_force[end] == pytest.approx(np.linalg.solve(balance, [2.0, 3.0]), rel=1e-9), (belt, side)
            assert result.status[end].tolist() == [SLIP if belt else STICK, SLIP if side else STICK]
        assert np.abs(result.displacement).max() < 1e-12
    other = st.simulate(case.with_({"temporal.stepper": "implicit", "temporal.step": 0.005, "temporal.record_every": 4}))
    assert result.normal_force[ends[2:]] == pytest.approx(other.normal_force[ends[2:]], abs=1e-2)
    assert result.works["friction"][-1] == pytest.approx(other.works["friction"][-1], rel=1e-3)


@pytest.mark.parametrize("plain", [Leaps.plain, 0])
def test_friction_of_slip_that_another_contact_holds_by_sticking(plain: int, monkeypatch: pytest.MonkeyPatch):
    """A block between two belts: it goes with the one that is pressed harder, and the other drags at it, both ways."""
    monkeypatch.setattr(Leaps, "plain", plain)
    contacts = tuple(
        touch(row, [1.0, 0.0, 0.0], slip=-speed, law=Coulomb(0.3), motions=1, name=name)
        for row, speed, name in (([0.0, 1.0, 0.0], 1.0, "A"), ([0.0, 0.0, 1.0], -0.1, "B"))
    )
    points = {k: replace(r, lift=np.zeros((2, 1))) for k, r in points_of(3, block=0).items()}
    system = System(
        np.eye(3), np.zeros((3, 3)), np.diag([1e-3, 0.0, 0.0]), contacts, {"press": np.array([0.0, -1.0, -5.0])},
        belt_motion(3), points,
    )  # fmt: skip
    phases = [
        PhaseSpec(f"p{i}", 4.0, {"press": 1.0}, {"belt": speed}, 2.0) for i, speed in enumerate((0.0, 1.0, -1.0, 0.0))
    ]
    results = [
        simulate(system, phases, Settings(record_every=1, watch=("block",), step=0.02, stepper=name))
        for name in ("exact", "implicit")
    ]
    goes_with_the_law(results[0], [0.3, 0.3])
    exactly, other = results
    assert np.all(exactly.status[1:, 1] == STICK)
    assert exactly.displacement == pytest.approx(other.displacement, abs=1e-4)
    slides = np.abs(other.slip_speed[:, 0]) > 1e-3
    assert exactly.tangential_force[slides] == pytest.approx(other.tangential_force[slides], abs=2e-3)
    assert exactly.works["friction"][-1] == pytest.approx(0.3 * 1.1 * (1.0 + 2.0 + 2.0 * AWAY + 2.0 + 1.0), rel=1e-12)


LIMIT = """
units = "nondimensional"
bodies.m = { type = "mass", mass = 1.0, position = [0.0, 0.0] }
bodies.w = { type = "mass", mass = 1.0, position = [1.0, 0.0] }
bodies.belt = { type = "obstacle", shape = "flat", point = [0, 0], normal = [0, 1], sliding.velocity = [0.2, 0.0] }
springs.k = { between = ["m", "w"], direction = [1.0, 0.0], stiffness = 1.0 }
springs.g = { between = ["m", "ground"], direction = [1.0, 0.0], stiffness = 1.0 }
loads.p = { at = "m", force = [0.0, -1.0] }
supports.s = { at = "w", fixed = ["x", "y"], velocity.x = 0.05, displacement.x = 0.3 }
contacts.rub = { slave = "m", master = "belt", stiffness = "rigid", friction = { law = "coulomb", coefficient = 0.3 } }
temporal = { step = 1e-3, stepper = "exact", watch = ["m"] }
[[phases]]
name = "press"
duration = 2.0
ramp = 1.0
velocities = { belt = 0.0, s = 0.0 }
[[phases]]
name = "slide"
duration = 2.0
ramp = 0.5
velocities = { belt = -1.0, s = 1.0 }
loads = { p = 2.0 }
"""


def test_a_mass_that_is_pulled_just_as_much_as_friction_holds_stays():
    """Pull and pressure on one ramp, k d = μN all the while: it neither slips nor sticks by turns of rounding."""
    case = st.loads(LIMIT)
    exact, explicit = (st.simulate(case.with_({"temporal.stepper": name})) for name in ("exact", "explicit"))
    rest = (exact.time > 1.01) & (exact.time < 2.0)
    assert np.all(exact.status[rest, 0] == STICK)
    assert np.abs(exact.tangential_force[rest, 0]) == pytest.approx(0.3, rel=1e-12)
    size = np.abs(explicit.displacement).max()
    assert np.abs(exact.displacement - explicit.displacement).max() < 1e-3 * size


def test_a_root_of_a_number_that_is_zero_has_its_modes():
    numbers, modes = numbers_of(np.zeros((1, 1), dtype=complex), np.array([1j]), np.array([[0.0, 0.0, 0.0, -1.0]])), np.full(2, np.nan)
    code, _, when, *_ = first_root(
        numbers, planes(np.array([1j])), planes(np.ones(1, dtype=complex)), parts_of(np.array([1j]), 1.0), 1.0, 0, modes
    )
    assert code == CROSSED
    assert modes == pytest.approx([np.cos(when), np.sin(when)], abs=1e-12)


def test_what_was_computed_before_an_error_is_kept_whole():
    """It sticks for 2 s and then slips critically damped: modes that are one are refused there."""
    block = block_on_belt(law=StaticKinetic(0.3, 0.4), speed=0.1, damping=2.0)
    with pytest.raises(st.AnalysisError, match="all but one") as refused:
        exact(block, 6.0, velocities={"belt": 1.0}, start=(0.0, [0.1, 0.0], 0.0), step=1e-3)
    kept = refused.value.trajectory
    assert str(refused.value).endswith("(t = 2 s, phase run)")
    assert len(kept.time) == 2000
    assert np.all(kept.status == STICK)
    assert kept.state["exact_q"] == pytest.approx([0.2, 0.0], abs=1e-9)


def test_critical_damping_is_refused():
    with pytest.raises(st.AnalysisError, match=r"two modes at 1 rad/s are all but one .* take stepper = \"explicit\""):
        st.simulate(corner(**{"springs.kx.damping": 2.0, "contacts.rub.stiffness": "rigid"}))


def test_a_step_that_phases_are_no_multiples_of_is_refused():
    phases = [{"name": "a", "duration": 1.0}, {"name": "b", "duration": 0.25}]
    with pytest.raises(st.CaseError, match=r"temporal.step: 0.4 – a step that phases are multiples of: a of 1 s"):
        st.simulate(corner(**{"phases": phases, "temporal.step": 0.4}))


def test_extremes_belong_to_their_phase_and_not_to_the_records():
    phases = [{"name": "a", "duration": 4.0}, {"name": "b", "duration": 4.0, "loads": {"press": 0.2}}]
    damped = {"springs.ky.damping": 20.0, "springs.kx.damping": 0.5, "contacts.rub.stiffness": "rigid", "phases": phases}
    fine, coarse = (st.simulate(corner(**damped, **{"temporal.record_every": every})) for every in (1, 400))
    for run_ in (fine, coarse):
        most = [p.contacts["rub"].max_normal_force for p in run_.phases]
        assert most == pytest.approx([1.0, 0.2], rel=1e-9)
    loose = [st.simulate(corner(**{"temporal.record_every": every})).phases[0].contacts["rub"] for every in (1, 61)]
    assert loose[0].max_normal_force == pytest.approx(1.923077, rel=1e-5)
    assert loose[1].max_normal_force == pytest.approx(loose[0].max_normal_force, rel=2e-3)
    assert loose[1].max_slip_speed == pytest.approx(loose[0].max_slip_speed, rel=2e-3)


@pytest.mark.parametrize("change", [{"bodies.m.mass": 4.0}, {"springs.kx.direction": (0.8, 0.6)}])
def test_another_structure_takes_up_where_the_freedoms_were(change: dict[str, Any]):
    """Modes are others in it, freedoms are not."""
    case = corner(**{"phases.slide.duration": 6.0})
    part = st.simulate(case.with_({"phases.slide.duration": 3.0}))
    other = st.simulate(case.with_(change), restart=part, changed=True)
    near = len(part.time)
    assert np.abs(np.diff(other.displacement[near - 2 : near + 2], axis=0)).max() < 0.02
    assert np.abs(np.diff(other.velocity[near - 1 : near + 1], axis=0)).max() < 0.1


def test_another_gap_opens_the_contact():
    case = corner(**{"contacts.rub.stiffness": "rigid", "phases.slide.duration": 6.0})
    part = st.simulate(case.with_({"phases.slide.duration": 3.0}))
    other = st.simulate(case.with_({"bodies.belt.point": (0, -0.1)}), restart=part, changed=True)
    now = len(part.time)
    assert part.status[-1, 0] != OPEN
    assert other.status[now + 1, 0] == OPEN
    assert other.gap[now + 1, 0] == pytest.approx(0.1, abs=1e-3)


def test_auto_takes_it_where_it_is_small_enough_and_says_so():
    system = block_on_belt(law=StaticKinetic(0.3, 0.4), speed=0.2)
    asked = {"step": 1e-2, "velocities": {"belt": 1.0}, "watch": ("block",)}
    result = run(system, 10.0, stepper="auto", **asked)
    assert result.path == "exact"
    assert "freedoms, up to 40 are few" in result.path_reason
    assert np.array_equal(result.displacement, exact(system, 10.0, **asked).displacement)
    bench = st.loads(template_text("two-beams")).with_({"temporal.stepper": "auto"})
    assert plan(Workspace(bench).system(), settings_of(bench))[0] == "modal"


SHORT = {
    "bodies.beam1.elements": 6,
    "bodies.beam2.elements": 12,
    "contacts.A.friction.coefficient": 0.35,
    "temporal.step": 2e-8,
    "temporal.record_every": 50,
    "phases.press.duration": 2e-4,
    "phases.press.ramp": 1e-4,
    "phases.slide.duration": 1e-3,
}


@pytest.mark.parametrize("contact", ["rigid", "as given"])
def test_the_bench_from_rest_as_in_explicit_steps(contact: str):
    """Pressed by a ramp, then suddenly slid: loads and speeds that change, impacts, the same forces and works."""
    case = st.loads(template_text("two-beams")).with_(SHORT | {"temporal.contact": contact, "contacts.A.stiffness": 2e8})
    result = st.simulate(case.with_({"temporal.stepper": "exact"}))
    off = []
    for step, every in ((2e-8, 50), (5e-9, 200)):
        other = st.simulate(case.with_({"temporal.step": step, "temporal.record_every": every}))
        assert other.time == pytest.approx(result.time)
        off.append(np.abs(other.displacement - result.displacement).max() / np.abs(result.displacement).max())
        # Impulses in steps of time aside, which are no forces.
        assert np.median(np.abs(other.normal_force - result.normal_force)) < 1e-3 * np.abs(result.normal_force).max()
        for name, values in result.works.items():
            turned = max(float(np.abs(w).max()) for w in result.works.values())
            assert np.abs(other.works[name] - values).max() < 0.01 * turned, name
    assert off[1] < max(0.5 * off[0], 1e-6)
    assert energy_balance(result).error < CLOSED
    assert result.path == "exact"


def test_a_run_that_is_cut_goes_on_to_the_last_digit(tmp_path):
    case = st.loads(template_text("two-beams")).with_(SHORT | {"temporal.stepper": "exact"})
    whole = st.simulate(case)

    part = cut(case, 777)
    saved = st.open(st.save(part, tmp_path / "part.nc"))
    again = st.simulate(case, restart=saved)
    for name in ("time", "normal_force", "displacement", "status", "kinetic"):
        assert np.array_equal(getattr(again, name), getattr(whole, name)), name
    changed = st.simulate(
        case.with_({"contacts.A.friction.coefficient": 0.2}), restart=saved, changed=True
    )
    assert energy_balance(changed).error < 1e-3  # another friction from there on: no jump in anything that moves
    assert np.abs(changed.displacement[len(part.time)] - whole.displacement[len(part.time)]).max() < 1e-9


@pytest.mark.parametrize("cut", [74, *(pytest.param(k, marks=pytest.mark.slow) for k in (185, 333))])
def test_random_runs_that_are_cut_go_on_to_the_last_digit(cut: int, monkeypatch: pytest.MonkeyPatch):
    """A restart looks ahead anew, from where the leg that was cut began to be looked through."""

    def stop(done: int, planned: int) -> None:
        if done >= cut:
            raise KeyboardInterrupt

    for seed in (1, 2, 5, 12, 23):
        system, start = random_system(seed)
        asked = {"velocities": {"belt": 1.0}, "start": (start, 0.0, 0.0), "watch": ("first", "last"), "step": 0.01}
        whole = exact(system, 6.0, **asked)
        settings = Settings(record_every=1, watch=("first", "last"), step=0.01, stepper="exact")
        phases = [PhaseSpec("run", 6.0, {}, {"belt": 1.0}, 0.0)]
        began = tuple(np.broadcast_to(np.asarray(part, dtype=float), system.size) for part in asked["start"])
        with monkeypatch.context() as patch:
            in_chunks(patch, 37)
            part = simulate(system, phases, settings, disturbance=began, progress=stop)
        assert part.interrupted
        again = simulate(system, phases, settings, restart=part)
        for name in ("displacement", "normal_force", "kinetic"):
            assert np.array_equal(getattr(again, name), getattr(whole, name)), (seed, name)
        for name in whole.contact_names:
            largest = (run.phases[-1].contacts[name].max_normal_force for run in (again, whole))
            assert next(largest) == pytest.approx(next(largest), rel=2e-6)


def test_large_models_are_refused_before_anything_is_computed():
    pad = st.loads(template_text("pad-on-disc")).with_({"temporal.stepper": "exact"})
    pad = pad.with_({f"bodies.{name}.mesh.divisions": [3, 6, 1] for name in ("disc", "lining", "plate")})
    with pytest.raises(st.CaseError, match=r"friction turns with the slip in space; take \"explicit\""):
        st.simulate(pad)
    assert st.simulate(pad.with_({"temporal.stepper": "auto", "phases": [{"name": "press", "duration": 1e-6}]})).path != "exact"


@pytest.mark.parametrize(
    ("contact", "said"),
    [
        ({"sliding": "finite"}, "slides finitely"),
        ({"law": Weakening(0.1, 0.3, 0.1)}, "varies with the slip speed"),
        ({"closed": True}, "is kept closed"),
    ],
)
def test_what_it_does_not_take_is_said(contact: dict[str, Any], said: str):
    system = block_on_belt(speed=0.2)
    system = replace(system, contacts=(replace(system.contacts[0], **contact),))
    with pytest.raises(st.CaseError, match=said) as refused:
        exact(system, 1.0, step=1e-2)
    assert 'take "explicit"' in str(refused.value)


@pytest.mark.filterwarnings("error")
def test_records_further_apart_than_growth_has_numbers_for() -> None:
    """Between two of them a mode would grow by e^1000; the phase ends before the first."""
    changes = {
        "temporal.stepper": "exact", "temporal.step": 0.01, "temporal.record_every": 1_000_000,
        "contacts.rub.friction.coefficient": 1.4, "phases": [{"name": "a", "duration": 1.0}],
    }  # fmt: skip
    run = st.simulate(mode_coupling(0.02).with_(changes))
    assert (run.steps, len(run.time)) == (100, 1)

"""Limit cycles by shooting, and branches of them, against closed forms, other motions and finite differences."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import stridor as st
from marching import block_on_belt, run
from mode_coupling import mode_coupling
from random_contacts import pressed_frame, random_system
from stridor.case import template_text
from stridor.laws import Coulomb, StaticKinetic
from stridor.periodic import (
    ClosedShot,
    Cycles,
    Family,
    NoReturn,
    ShootingBranch,
    born,
    close,
    cycles_reached,
    follow,
    growing,
    multipliers,
    pushed,
    returns,
    sampling,
    turning,
)
from stridor.periodic.chart import Chart
from stridor.periodic.cycle import turns
from stridor.periodic.shooting import shoot, started
from stridor.study.cycle_branches import Tracer
from stridor.study.cycle_methods import Shooting

DAMPED = 0.02


def advanced(closed: ClosedShot, xi: np.ndarray, periods: int) -> np.ndarray:
    """Where a start of the chart is after some periods, by the plain motion."""
    motion = started(closed.problem, closed.chart, xi, varied=False)
    end = periods * closed.period
    while motion.reach(end) < end:
        motion.passed()
    assert motion.anchor is not None
    return closed.chart.numbers(*motion.anchor.state(end))


def test_mass_on_a_belt_sticks_and_slips():
    """Period and stick in closed form; the state at which it lets go is always the same, so every multiplier is zero."""
    system = block_on_belt(law=StaticKinetic(0.3, 0.4), speed=0.2)
    found = st.cycles(system, 0.3, push=0.3)
    (cycle,) = found.cycles
    assert not found.missing
    slip = 2 * math.pi - 2 * math.atan(0.1 / 0.2)
    assert cycle.period == pytest.approx(slip + 1.0, abs=1e-9)
    assert cycle.shares[0] * cycle.period == pytest.approx([0.0, 1.0, slip], abs=1e-9)
    x = cycle.displacement[:, 0, 0]
    # Twice static over kinetic friction apart from its mean, and at its speed where it slips fastest.
    assert (x.min(), x.max()) == pytest.approx((0.3 - math.hypot(0.1, 0.2), 0.3 + math.hypot(0.1, 0.2)), abs=2e-5)
    assert np.abs(cycle.multipliers).max() < 1e-9
    assert cycle.stable
    assert cycle.kinds == ("slip", "stick")
    assert [c.what for c in cycle.changes] in (["stops", "slips backward"], ["slips backward", "stops"],
                                               ["stops", "slips forward"], ["slips forward", "stops"])  # fmt: skip


@pytest.mark.parametrize("speed", [2e-4, 2e-5, 2e-7])
def test_a_mass_that_sticks_for_ages_lets_go_all_the_same(speed: float):
    """It sticks for 2 (μs − μk) N / (k v), up to 160 000 periods of its own."""
    (cycle,) = st.cycles(block_on_belt(law=StaticKinetic(0.3, 0.4), speed=speed), 0.3, push=0.3).cycles
    stick, slip = 0.2 / speed, 2 * math.pi - 2 * math.atan(0.1 / speed)
    assert cycle.period == pytest.approx(stick + slip, rel=1e-9)
    assert cycle.shares[0, 1] == pytest.approx(stick / (stick + slip), rel=1e-9)


def test_what_changes_no_contact_dies_out_only_where_it_does():
    """Without damping it swings for ever; beyond its onset it grows, however slowly and from whatever is left of a push."""
    still = block_on_belt(law=Coulomb(0.3), speed=1.0)
    assert "swings on without any change of contact" in st.cycles(still, 0.3, push=0.1).missing[0]
    case = mode_coupling(DAMPED, 0.1)
    (onset,) = st.onsets(case, friction_range=(0.0, 1.0)).onsets
    below = Family(st.Workspace(case).system()).at(0.9 * onset.mu)
    with pytest.raises(NoReturn, match="it comes to steady sliding") as told:
        cycles_reached(below, pushed(below, 1e-9))
    assert told.value.steady
    for beyond, push in ((1.0002, 1e-3), (1.002, 1e-9)):
        problem = Family(st.Workspace(case).system()).at(beyond * onset.mu)
        (closed,) = cycles_reached(problem, pushed(problem, push))[-1:]
        assert closed.period == pytest.approx(1.0 / onset.frequency_hz, rel=0.1)


def test_where_steady_sliding_is_not_found_the_other_frictions_are_answered(monkeypatch: pytest.MonkeyPatch):
    at = Family.at

    def lost(family: Family, mu: float):
        if mu > 0.5:
            raise st.AnalysisError("steady sliding: the set of touching nodes does not settle")
        return at(family, mu)

    monkeypatch.setattr(Family, "at", lost)
    system = block_on_belt(law=StaticKinetic(0.3, 0.4), speed=0.2)
    found = st.cycles(system, [0.3, 0.6], push=0.3)
    assert [c.mu for c in found.cycles] == [0.3]
    assert found.missing == ("μ = 0.6: steady sliding: the set of touching nodes does not settle",)
    with pytest.raises(st.AnalysisError, match="does not settle"):
        st.cycles(system, 0.6, push=0.3)


def test_contacts_that_never_touch_have_no_slip_amplitude():
    """A wall far away, which moves as fast as anything: nothing rubs there."""
    alone = mode_coupling(DAMPED, 1.0)
    walled = alone.with_({
        "bodies.wall": {"type": "obstacle", "shape": "flat", "point": [50.0, 0.0], "normal": [-1.0, 0.0],
                        "sliding": {"velocity": [0.0, 3.0]}},
        "contacts.stop": {"slave": "m", "master": "wall", "stiffness": "rigid",
                          "friction": {"law": "coulomb", "coefficient": 0.5}},
    })  # fmt: skip
    cycle, beside = (next(c for c in st.cycles(case, 1.0).cycles if c.stable) for case in (alone, walled))
    assert beside.shares[1].tolist() == [1.0, 0.0, 0.0]
    assert np.ptp(beside.slip_velocity[:, 1]) > 0.0
    assert beside.slip_range[1].tolist() == [0.0, 0.0]
    assert beside.slip_amplitude == pytest.approx(cycle.slip_amplitude, rel=1e-4)  # of 512 samples each


@pytest.mark.parametrize("seeds", [range(8), pytest.param(range(8, 200), marks=pytest.mark.slow)], ids=["few", "many"])
def test_the_variation_is_the_difference_of_two_motions(seeds: range):
    """Through sticking, slipping, parting and impacts of one or two contacts."""
    compared = changes = 0
    for seed in seeds:
        rng = np.random.default_rng(seed)
        try:
            problem = Family(random_system(seed)[0]).at(0.45)
        except st.AnalysisError:  # friction jams
            continue
        chart = Chart.of(problem, problem.status)
        steady = chart.numbers(problem.q, np.zeros_like(problem.q))
        for period in (0.5, 2.0, 5.0, 0.7, 3.0, 4.0):
            xi, way, step = steady + 0.6 * rng.normal(size=chart.size), rng.normal(size=chart.size), 1e-6
            try:
                shot = shoot(problem, chart, xi, period)
                beside = [shoot(problem, chart, xi + s * step * way, period, varied=False) for s in (1, -1)]
            except st.AnalysisError:  # no state of this status, or friction jams
                continue
            if shot.landed or shot.grazed < 1e-3:
                continue
            wanted = (beside[0].end - beside[1].end) / (2 * step)
            assert shot.matrix @ way == pytest.approx(wanted, abs=2e-5 * np.linalg.norm(wanted)), (seed, period)
            compared, changes = compared + 1, changes + len(shot.words)
    assert compared >= len(seeds)
    assert changes > 3 * compared


@pytest.mark.parametrize(
    "seeds",
    [(50,), *(pytest.param(k, marks=pytest.mark.slow) for k in (range(46, 52), range(100, 200)))],
    ids=["few", "some", "many"],
)
def test_motions_beside_a_cycle_come_to_it_or_leave_it(seeds: range):
    """Random systems: what is near a cycle after n periods is as much nearer, or further, as its multipliers say."""
    looked = 0
    for seed in seeds:
        family = Family(random_system(seed if seed % 4 else seed + 1)[0])  # with damping
        found: list[ClosedShot] = []
        for mu in (0.5, 0.8, 1.2):
            try:
                problem = family.at(mu)
                motions = [pushed(problem, 3.0 * problem.sliding_speed), *(m for _, m in growing(problem))]
                for motion in motions:
                    found += cycles_reached(problem, motion, seconds=3.0)
            except st.AnalysisError:  # it dies out, or friction jams
                continue
        for closed in found:
            if closed.shot.landed or closed.shot.grazed < 1e-3:
                continue
            whole = multipliers(closed)
            off = 1e-7 * closed.shot.amplitude * np.random.default_rng(seed).normal(size=closed.chart.size)
            wanted = np.linalg.matrix_power(closed.shot.matrix, 3) @ off
            got = 0.5 * (advanced(closed, closed.xi + off, 3) - advanced(closed, closed.xi - off, 3))
            assert got == pytest.approx(wanted, abs=1e-5 * np.linalg.norm(off) * max(1.0, abs(whole[0])) ** 3), seed
            looked += 1
    assert looked >= max(len(seeds) // 6, 1)


def check_closes(seed: int, friction: float, **frame: Any) -> int:
    """Each cycle of a random frame comes back in a run of exact steps over one period, off by a share of how far it
    goes; how many there are."""
    system = pressed_frame(seed, friction, **frame)
    try:
        found = st.cycles(system, friction, method="shooting", seconds=2.0)
    except st.AnalysisError:  # friction jams
        return 0
    assert found.cycles or found.missing or found.notes, seed
    for cycle in found.cycles:
        assert cycle.changes, (seed, cycle)
        step = cycle.period / max(20, math.ceil(cycle.period / 0.01))
        x, v = cycle.displacement[:, :, 0], cycle.velocity[:, :, 0]
        end = run(
            system, cycle.period + step, stepper="exact", step=step, start=(x[0], v[0], 0.0),
            velocities={"belt": 1.0}, watch=cycle.watch_names,
        )  # fmt: skip
        assert end.time[-1] == pytest.approx(cycle.period, rel=1e-9)
        for told, first, whole in ((end.displacement, x[0], x), (end.velocity, v[0], v)):
            assert np.abs(told[-1, :, 0] - first).max() < 1e-5 * np.ptp(whole, axis=0).max(), (seed, cycle)
    return len(found.cycles)


@pytest.mark.parametrize("seeds", [(401, 405, 419, 437), pytest.param(range(400, 440), marks=pytest.mark.slow)])
def test_small_frames_swing_in_cycles_that_go_somewhere(seeds: Sequence[int]):
    """Rigid contacts that throw one another off: impacts that accumulate are no cycle, of those of a cycle they are
    part (401, 405)."""
    assert sum(check_closes(seed, 0.6, nodes=2, contacts=1 + seed % 2, rigid=True) for seed in seeds) >= 2


@pytest.mark.slow  # in each run: the test before, of smaller ones
@pytest.mark.parametrize("seeds", [(201, 206, 210), pytest.param(range(200, 260), marks=pytest.mark.slow)])
def test_frames_swing_in_cycles_that_go_somewhere(seeds: Sequence[int]):
    assert sum(check_closes(seed, 1.0, damping=0.02) for seed in seeds) >= 2


def test_no_motion_is_a_cycle_of_no_time():
    """Nor is rest one of any period, nor a swing that changes no contact."""
    problem = Family(pressed_frame(206, 1.0, damping=0.02)).at(1.0)
    chart = Chart.of(problem, problem.status)
    steady = chart.numbers(problem.q, np.zeros_like(problem.q))
    beside = steady + 0.01 * np.random.default_rng(0).normal(size=chart.size)
    for period in (1e-9, 1e-7, 1e-5):
        with pytest.raises(st.AnalysisError, match="no cycle closes near a return"):
            close(problem, chart, beside, period)
    for off in (0.0, 1e-12):
        with pytest.raises(st.AnalysisError, match="no cycle closes near a return"):
            close(problem, chart, steady + off * (beside - steady), 1.0)
    free = Family(block_on_belt(law=Coulomb(0.3), speed=1.0)).at(0.3)
    chart = Chart.of(free, free.status)
    swinging = chart.numbers(free.q + 0.01 * free.basis.vectors[0], np.zeros_like(free.q))
    with pytest.raises(st.AnalysisError, match="no contact changes"):
        close(free, chart, swinging, 2 * math.pi)


@pytest.mark.parametrize("mu", [1.4, pytest.param(1.7, marks=pytest.mark.slow)])
def test_a_run_of_explicit_steps_comes_to_the_same_cycle(mu: float):
    """Hoffmann's minimal model with stick, reversal and separation."""
    case = mode_coupling(DAMPED, 0.1)
    cycle = next(c for c in st.cycles(case, mu).cycles if c.stable)
    steps = {"temporal.stepper": "explicit", "temporal.step": 5e-5, "temporal.record_every": 20,
             "phases": [{"name": "slide", "duration": 110.0}], "temporal.perturbation": 0.05}  # fmt: skip
    run = st.simulate(case.with_(steps), mu=mu)
    last = run.time > run.time[-1] - 8.2 * cycle.period
    x, time = run.displacement[last, 0, 0], run.time[last]
    middle = 0.5 * (x.max() + x.min())
    up = np.flatnonzero((x[:-1] < middle) & (x[1:] >= middle))
    crossed = time[up] + (middle - x[up]) / (x[up + 1] - x[up]) * (time[1] - time[0])
    ups = int(np.count_nonzero(np.diff(np.sign(cycle.displacement[:-1, 0, 0] - middle)) > 0)) or 1
    period = (crossed[-1] - crossed[-1 - 4 * ups]) / 4
    assert period == pytest.approx(cycle.period, rel=1e-5)
    assert 0.5 * np.ptp(x) == pytest.approx(cycle.amplitude("displacement")["m"][0], rel=1e-4)
    shares = [np.count_nonzero(run.status[last] == s) / np.count_nonzero(last) for s in range(3)]
    assert shares == pytest.approx(cycle.shares[0], abs=0.02)


@pytest.fixture(scope="module")
def slow_belt() -> Cycles:
    return st.cycles(mode_coupling(DAMPED, 0.1), between=(0.1, 1.8), runs=0)  # what runs add: test_cycles_from_runs


def test_a_branch_begins_at_the_onset(slow_belt: Cycles):
    """With the frequency of the onset, as large as it can be without a change of contact; then more and more happens."""
    (onset,) = slow_belt.onsets
    assert onset.mu == pytest.approx(0.750600, abs=1e-6)
    (branch,) = slow_belt.branches
    first = slow_belt.cycles[branch.cycles[0]]
    assert branch.onset == 0
    assert branch.begins == "it begins at the onset at μ = 0.7506"
    assert branch.ends == "it leaves the range at μ = 1.8; a fold beyond it is not looked for"
    assert 0.0 < first.mu - onset.mu < 2e-3
    assert first.frequency_hz == pytest.approx(onset.frequency_hz, rel=1e-3)
    assert first.kinds == ("slip", "separation")
    assert first.shares[0, 0] < 0.1
    kinds = [b.kind for b in branch.bifurcations]
    assert kinds == ["reversal of slip begins", "sticking begins"]
    assert not slow_belt.missing


def test_motions_come_to_the_cycles_of_the_branch(slow_belt: Cycles):
    """At every fourth of them, from a push and from the growing mode."""
    branch = slow_belt.branches[0]
    family = Family(st.Workspace(mode_coupling(DAMPED, 0.1)).system())
    for number in branch.cycles[2::4]:
        wanted = slow_belt.cycles[number]
        assert wanted.stable
        problem = family.at(wanted.mu)
        closed = cycles_reached(problem, pushed(problem, 0.2))[-1]
        assert closed.period == pytest.approx(wanted.period, rel=1e-8)
        assert multipliers(closed)[0] == pytest.approx(wanted.multipliers[0], abs=1e-5)


@pytest.fixture(scope="module")
def fast_belt() -> Cycles:
    return st.cycles(mode_coupling(DAMPED, 1.0), between=(0.1, 1.8), points=30, runs=0)


@pytest.mark.slow  # in each run: `test_harmonic_balance.py::test_the_unstable_cycle_is_a_border`
def test_an_unstable_cycle_lies_between_two_that_are_reached(fast_belt: Cycles):
    """Below the onset steady sliding and a loud cycle are both stable; the unstable one is the border: beside it on one
    side motions die out, on the other they come to the loud one."""
    assert any(c.stable is False for c in fast_belt.cycles)
    unstable = min((c for c in fast_belt.cycles if c.stable is False), key=lambda c: abs(c.mu - 0.72))
    assert unstable.mu < fast_belt.onsets[0].mu
    assert sum(abs(complex(m)) > 1.0 for m in unstable.multipliers) == 1
    assert fast_belt.branch_of(fast_belt.cycles.index(unstable)) is not None
    family = Family(st.Workspace(mode_coupling(DAMPED, 1.0)).system())
    tracer = Tracer(Shooting(family), (unstable.mu, 1.8), 60, lambda: True)
    loud = cycles_reached(family.at(1.8), pushed(family.at(1.8), 3.0))
    for closed in loud:
        tracer.from_cycle(closed, "", ())
    met = [c for t in tracer.traced for c in t.closed if abs(c.problem.value - unstable.mu) < 1e-9]
    met = [close(c.problem, c.chart, c.xi, c.period) for c in met]
    (begun,) = [c for c in met if np.abs(multipliers(c)).max() > 1.0]
    values, vectors = np.linalg.eig(begun.shot.matrix)
    way = np.real(vectors[:, int(np.argmax(np.abs(values)))])
    ends, died = [], []
    for side in (1.0, -1.0):
        start = begun.xi + side * 0.01 * begun.shot.amplitude * way / np.linalg.norm(way)
        motion = started(begun.problem, begun.chart, start, varied=False)
        try:
            ends.append(cycles_reached(begun.problem, motion)[-1])
        except NoReturn as none:
            died.append(none.steady)
    assert died == [True]
    (loud,) = ends
    assert np.abs(multipliers(loud)).max() < 1.0
    assert loud.shot.amplitude > 0.5 * begun.shot.amplitude


def test_cycles_come_back_from_their_file(slow_belt: Cycles, tmp_path: Path):
    st.save(slow_belt, tmp_path / "cycles.nc")
    back = st.open(tmp_path / "cycles.nc")
    assert isinstance(back, Cycles)
    assert back.to_json() == slow_belt.to_json()
    assert back.provenance == slow_belt.provenance
    for one, other in zip(back.cycles, slow_belt.cycles, strict=True):
        assert np.array_equal(one.normal_force, other.normal_force)
        assert one.changes == other.changes


def test_what_was_found_is_kept_when_the_search_is_stopped():
    seen: list[Cycles] = []

    def keep(found: Cycles) -> None:
        seen.append(found)
        if len(found.cycles) == 4:
            raise KeyboardInterrupt

    found = st.cycles(mode_coupling(DAMPED, 0.1), between=(0.1, 1.8), keep=keep)
    assert found.interrupted
    assert len(found.cycles) == len(seen) == 4
    assert found.branches[0].ends == "it was stopped"
    assert "stopped early: 4 limit cycles at μ = 0.751901 to " in found.warnings[0]


def test_a_cycle_is_kept_when_the_motion_to_it_is_stopped(monkeypatch: pytest.MonkeyPatch):
    """The motion goes on behind a cycle that is said to be unstable; stopped there, the cycle is not lost."""
    closed, going_on = returns._closed, returns.next_change
    met: list[ClosedShot] = []

    def noted(*given) -> ClosedShot:
        met.append(closed(*given))
        return met[-1]

    def stopped(*given) -> tuple[str, int] | None:
        if met:
            raise KeyboardInterrupt
        return going_on(*given)

    monkeypatch.setattr(returns, "_closed", noted)
    monkeypatch.setattr(returns, "next_change", stopped)
    monkeypatch.setattr(returns, "SURE", 0.0)
    monkeypatch.setattr(returns, "multipliers", lambda _: np.array([2.0]))
    kept: list[Cycles] = []
    found = st.cycles(mode_coupling(DAMPED, 0.1), 1.0, push=0.2, keep=kept.append)
    assert found.interrupted
    assert len(met) == len(kept) == 1
    assert [c.period for c in found.cycles] == [met[0].period]


def test_a_branch_whose_end_at_the_edge_is_lost_says_so(monkeypatch: pytest.MonkeyPatch):
    def lost(*_: object) -> ClosedShot:
        raise st.AnalysisError("nothing is there")

    monkeypatch.setattr(ShootingBranch, "at", lost)
    found = st.cycles(mode_coupling(DAMPED, 0.1), between=(0.7, 0.78), push=0.2, runs=0)
    branch = found.branches[0]
    assert branch.ends.endswith("its cycle at the edge, μ = 0.78, could not be closed: nothing is there")
    assert f"branch 1: {branch.ends}" in found.missing


def test_undamped_modes_that_meet_have_no_branch_of_their_own():
    """The onset is a double root: two modes in one, which the exact motion cannot go on with. That is said, not hidden."""
    found = st.cycles(mode_coupling(), between=(0.5, 0.9), push=[0.5], seconds=0.3, points=2, runs=0)
    assert found.missing[0].startswith("no branch was found from the onset at μ = 0.75 ")


def test_a_still_contact_and_strange_numbers_are_refused():
    case = mode_coupling(DAMPED, 0.1)
    for given, said in (
        ({"mu": -0.1}, "mu: -0.1"),
        ({"between": (0.5, 0.1)}, "between: [0.5, 0.1]"),
        ({"mu": 0.5, "push": []}, "push: []"),
        ({"mu": 0.5, "points": 1}, "points: 1"),
        ({"mu": 0.5, "seconds": 0.0}, "seconds: 0.0"),
    ):
        with pytest.raises(st.CaseError, match=said.replace("[", r"\[")):
            st.cycles(case, **given)
    with pytest.raises(st.CaseError, match="nothing slides: no support has a velocity"):
        st.cycles(block_on_belt(law=Coulomb(0.3)), 0.3)


def test_a_cycle_is_no_cycle_of_another_friction():
    """A broken one is seen: its residual is that of the start in another problem."""
    family = Family(st.Workspace(mode_coupling(DAMPED, 0.1)).system())
    closed = cycles_reached(family.at(1.0), pushed(family.at(1.0), 0.2))[-1]
    other = shoot(family.at(1.05), closed.chart, closed.xi, closed.period)
    assert closed.residual < 1e-9
    assert np.linalg.norm(other.end - closed.xi) > 1e-3 * closed.shot.amplitude
    assert replace(closed, residual=0.0).word == closed.word


def test_a_fold_is_solved_for():
    """The two beams: behind their onset the branch turns back, and goes on unstable below it."""
    case = st.loads(template_text("two-beams")).with_({"bodies.beam1.elements": 20, "bodies.beam2.elements": 18})
    (onset,) = st.onsets(case, (0.06, 0.1)).onsets
    branch = ShootingBranch(Family(st.Workspace(case).system()), (0.06, 0.1))
    first, heading = born(branch, onset.mu, onset.frequency_hz)
    met: list[tuple[float, float, bool]] = []

    def seen(closed: ClosedShot, *, fold: bool) -> bool:
        met.append((closed.problem.value, float(np.abs(multipliers(closed)[0])), fold))
        return True

    seen(first, fold=False)
    assert follow(branch, first, heading, seen, 6) == "6 points were made"
    (k,) = [k for k, (_, _, fold) in enumerate(met) if fold]
    mus, sizes = [mu for mu, _, _ in met], [size for _, size, _ in met]
    assert sizes[k] == pytest.approx(1.0, abs=2e-4)
    assert all(size < 1.0 - 1e-4 for size in sizes[:k])
    assert all(size > 1.0 + 1e-4 for size in sizes[k + 1 :])
    assert mus[: k + 1] == sorted(mus[: k + 1])
    assert mus[k:] == sorted(mus[k:], reverse=True)
    assert mus[-1] < onset.mu < mus[0]


@pytest.mark.parametrize(
    ("mus", "told", "wanted"),
    [
        ((1.0, 1.1, 1.2, 1.1), [2], [2]),
        ((1.0, 1.1, 1.2, 1.3), [1, 2], []),
        ((1.0, 1.2, 1.2 + 1e-12, 1.0), [1], [1]),
        ((1.0, 1.0 + 1e-12, 1.0 - 1e-12, 1.0), [1, 2], []),
        ((1.2, 1.1, 1.0), [2], []),
    ],
    ids=["turns", "goes on", "beside another", "stays", "at the end"],
)  # fmt: skip
def test_folds_are_where_friction_turns(mus: tuple[float, ...], told: list[int], wanted: list[int]):
    assert turning(mus, told) == wanted


def test_a_cycle_at_the_edge_is_there_once():
    found = st.cycles(mode_coupling(DAMPED, 0.1), 1.0, between=(0.9, 1.0), method="shooting", points=2)
    assert sorted(c.mu for c in found.cycles).count(1.0) == 1
    assert any(b.ends == "it leaves the range at μ = 1; a fold beyond it is not looked for" for b in found.branches)


def test_where_steady_sliding_ends_cycles_are_sought_below():
    """A mass on springs, coupled by c, and a contact of k: friction jams at μ = (1 + (1 − c²)/k) / c."""
    c, k = 0.8, 10.0
    contact = {
        "normal": (0.0, 1.0), "tangent": (1.0, 0.0), "stiffness": k, "slip": -0.1,
        "friction": {"law": "coulomb", "coefficient": 0.5},
    }  # fmt: skip
    system = st.System.from_matrices(
        np.eye(2), 0.3 * np.eye(2), np.array([[1.0, c], [c, 1.0]]), contacts={"c": contact}, loads={"p": (0.0, -1.0)},
        points={"m": np.eye(2)},
    )  # fmt: skip
    work = st.Workspace(system, modal={"max_frequency_hz": 5.0}, temporal={"watch": ["m"]},
                        phases=[{"name": "run", "duration": 10.0}])  # fmt: skip
    jams = (1.0 + (1.0 - c**2) / k) / c
    found = st.cycles(work, between=(0.0, 1.5), method="shooting", seconds=1.0)
    said = next(m for m in found.missing if m.startswith("there is steady sliding for μ = 0 to "))
    assert float(said.split(" to ")[1].split()[0]) == pytest.approx(jams, rel=2e-3)
    with pytest.raises(st.AnalysisError, match="none of the 2 sets of touching nodes is in equilibrium"):
        st.cycles(work, 1.5, method="shooting")


def test_ranges_are_those_of_the_motion_not_of_its_samples(monkeypatch: pytest.MonkeyPatch):
    """With few samples of the period they are those with 4096 to 1e-4 of themselves, which samples alone do not meet."""
    family = Family(st.Workspace(mode_coupling(DAMPED, 0.1)).system())
    closed = cycles_reached(family.at(1.0), pushed(family.at(1.0), 0.2))[-1]
    monkeypatch.setattr(sampling, "SAMPLES", 4096)
    fine = sampling.sampled(closed, "")
    missed: list[float] = []
    for samples in (6, 7, 9, 12):
        monkeypatch.setattr(sampling, "SAMPLES", samples)
        coarse = sampling.sampled(closed, "")
        missed.append(1.0 - float(np.ptp(coarse.slip_velocity) / np.ptp(fine.slip_velocity)))
        for name in ("slip_range", "force_range"):
            wanted = getattr(fine, name)
            assert np.abs(getattr(coarse, name) - wanted).max() < 1e-4 * np.ptp(wanted)
    assert max(missed) > 0.05
    assert fine.slip_amplitude == pytest.approx(0.5 * np.ptp(fine.slip_velocity), rel=1e-4)


def test_a_long_cycle_has_as_many_samples_as_its_strokes_ask_for(tmp_path: Path):
    """Sixteen rounds as one period: its extrema are those of one round, in its samples and in its file."""
    family = Family(st.Workspace(mode_coupling(DAMPED, 0.1)).system())
    closed = cycles_reached(family.at(1.4), pushed(family.at(1.4), 0.2))[-1]
    once = sampling.sampled(closed, "")
    rounds = sampling.sampled(close(closed.problem, closed.chart, closed.xi, 16 * closed.period), "")
    assert len(once.time) == 512
    assert 2048 <= len(rounds.time) <= 4096
    for cycle in (once, rounds):
        assert "separation" in cycle.kinds
        size = float(np.ptp(once.force_range))
        assert cycle.force_range[0].tolist() == pytest.approx(once.force_range[0].tolist(), abs=1e-6 * size)
        ends = cycle.normal_force.min(), cycle.normal_force.max()
        assert ends == pytest.approx(cycle.force_range[0].tolist(), abs=3e-4 * size)
        assert cycle.force_range[0, 0] == ends[0] == 0.0  # no contact pulls, not even by rounding
        for one, other in ((f(cycle.displacement, axis=0), f(once.displacement, axis=0)) for f in (np.min, np.max)):
            assert np.abs(one - other).max() < 3e-4 * np.ptp(once.displacement, axis=0).min()
    both = Cycles((once, rounds), (), (), None)
    st.save(both, tmp_path / "cycles.nc")
    back = st.open(tmp_path / "cycles.nc")
    assert isinstance(back, Cycles)
    for one, other in zip(back.cycles, both.cycles, strict=True):
        for name in ("time", "normal_force", "status", "displacement", "acceleration"):
            assert np.array_equal(getattr(one, name), getattr(other, name))


def test_a_motion_that_begins_at_rest_leads_to_a_cycle_of_its_own():
    """Of a mass that sticks, slips and parts three cycles are stable. To the slowest one three of four random pushes of
    0.3 came in time steps of Moreau's (period 25.46), and of the starts here the one in which slip is stopped alone."""
    angle = math.atan2(0.4737547006719889, 0.8806568478080405)
    case = st.Case(
        units="nondimensional",
        bodies={
            "m": {"type": "mass", "mass": 1.227708663346671, "position": (0, 0)},
            "belt": {"type": "obstacle", "shape": "flat", "point": (0, 0), "normal": (0, 1),
                     "sliding": {"velocity": (-0.4768922512117597, 0)}},
        },
        springs={
            "soft": {"between": ("m", "ground"), "direction": (-math.cos(angle), math.sin(angle)),
                     "stiffness": 0.18466528979451513},
            "hard": {"between": ("m", "ground"), "direction": (math.cos(angle), math.sin(angle)),
                     "stiffness": 2.8277025938204416},
        },
        dashpots={
            "x": {"between": ("m", "ground"), "direction": (1, 0), "damping": 0.02227597409107484},
            "y": {"between": ("m", "ground"), "direction": (0, 1), "damping": 0.02648781063019178},
        },
        loads={"press": {"at": "m", "force": (0, -0.5275591132430684)}},
        contacts={"rub": {"slave": "m", "master": "belt", "stiffness": 1.3614429939657835, "friction": {
            "law": "static-kinetic", "coefficient": 1.352107865204884, "static_coefficient": 1.459399935020449}}},
        modal={"max_frequency_hz": 2.0},
        temporal={"stepper": "exact", "watch": ["m"]},
    )  # fmt: skip
    found = st.cycles(case, 1.352107865204884)
    assert not found.missing
    assert [c.stable for c in found.cycles] == [True, True, True]
    assert sorted(c.period for c in found.cycles) == pytest.approx([4.9269, 8.8998, 25.4578], abs=1e-3)
    slow = max(found.cycles, key=lambda c: c.period)
    assert slow.reached_from == "a push of -0.4769 m/s"
    x, y = slow.displacement[:, 0].T
    # What those steps came to, of 2.5e-4.
    assert (x.min(), x.max(), y.min(), y.max()) == pytest.approx((-0.7103, 0.4446, -0.8425, 1.0465), abs=2e-3)


@pytest.mark.parametrize(
    ("values", "wanted"),
    [
        ([[0.0, 1.0, 0.0, 1.0, 0.0]], 3),
        ([[0.0, 1.0, 2.0], [0.0, 1.0, 0.0]], 1),
        ([[1.0, 1.0, 1.0]], 0),
        ([[0.0, 1.0, 0.995, 1.0, 0.0]], 1),
        ([[0.0, 1.0, 1.0, 0.0, 0.0, 1.0]], 2),
        ([[3.0]], 0),
    ],
)
def test_turns_are_counted_without_ripples(values: list[list[float]], wanted: int):
    assert turns(np.array(values).T) == wanted


def test_a_search_that_time_ends_says_so():
    found = st.cycles(mode_coupling(DAMPED), 1.0, seconds=1e-9)
    assert not found.cycles
    assert found.missing
    assert all("its 1e-09 s of computing were over" in m and "chaotic" not in m for m in found.missing)


def test_what_was_not_followed_to_its_end_is_not_said_to_end(monkeypatch: pytest.MonkeyPatch):
    """A motion that dies out, stopped before what is left of it is bounded."""
    problem = Family(st.Workspace(mode_coupling(DAMPED, 0.1)).system()).at(0.5)
    monkeypatch.setattr("stridor.periodic.waiting._kept", lambda *_: False)
    monkeypatch.setattr("stridor.periodic.waiting.ROUNDS", 1)
    with pytest.raises(NoReturn, match=r"^no contact changes within .* s, and whether any does later was not followed") as told:
        cycles_reached(problem, pushed(problem, 1e-9))
    assert not told.value.steady


@pytest.mark.parametrize("push", [1e300, -1e101, [0.1, float("inf")]])
def test_pushes_beyond_the_range_of_numbers_are_refused(push: Any):
    with pytest.raises(st.CaseError, match=r"push: .* up to 1e\+100"):
        st.cycles(mode_coupling(DAMPED, 0.1), 1.0, push=push)


def test_a_motion_beyond_the_range_of_numbers_is_no_return():
    problem = Family(st.Workspace(mode_coupling(DAMPED, 0.1)).system()).at(1.0)
    with np.errstate(over="ignore"), pytest.raises(NoReturn, match="the motion leaves the range of numbers"):
        cycles_reached(problem, pushed(problem, 1e200))
    met = [returns._Met(("change", 0, (0,)), float(k), np.full(2, np.inf)) for k in range(6)]
    with np.errstate(invalid="ignore"):
        assert returns._return(met, [1.0] * 6) == (0, np.inf)

"""Limit cycles by harmonic balance: against shooting, integrated motions, the modal onset and a published response."""

from __future__ import annotations

import contextlib
import functools
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.linalg as sl
from scipy.integrate import solve_ivp
from test_exact_stepper import random_system

import stridor as st
from marching import block_on_belt, touch
from mode_coupling import mode_coupling
from solid_cases import case, slider
from stridor.case import template_text
from stridor.fe.assembly import assemble_beam
from stridor.fe.beam import BeamElement, BeamMesh
from stridor.laws import Coulomb, Hyperbolic, StaticKinetic, Tabulated, Weakening
from stridor.periodic import ClosedShot, Cycle, Cycles, Family, cycles_reached, growing, pushed, sampled
from stridor.periodic.cycle import OWN
from stridor.periodic.harmonic import (
    Balanced,
    HarmonicBranch,
    HarmonicFamily,
    balanced,
    born,
    defect,
    guessed,
    hill,
    same_cycle,
    sampled_series,
)
from stridor.periodic.harmonic import fourier as fourier_module
from stridor.periodic.harmonic.balance import Scales, evaluated, scales
from stridor.periodic.harmonic.birth import still
from stridor.periodic.harmonic.forced import forced
from stridor.periodic.harmonic.sampling import coordinates, without_short
from stridor.system import System
from stridor.system.model import CubicSprings, Rows

pytestmark = pytest.mark.verification

DAMPED = 0.02


def beside(cycle: Cycle, family: HarmonicFamily, harmonics: int) -> Balanced:
    """The cycle of shooting, balanced in so many harmonics."""
    given = cycle.normal_force[:-1], cycle.tangential_force[:-1, :, None], cycle.gap[:-1]
    return balanced(guessed(family, cycle.mu, harmonics, cycle.period, *given))


@functools.cache
def cycle_of_shooting(speed: float, mu: float) -> Cycle:
    return next(c for c in st.cycles(mode_coupling(DAMPED, speed), mu, method="shooting").cycles if c.stable)


def shot(speed: float, mu: float) -> tuple[Cycle, HarmonicFamily]:
    """Cycle, and a family that has nothing of it."""
    return cycle_of_shooting(speed, mu), HarmonicFamily(st.Workspace(mode_coupling(DAMPED, speed)).system(), 1.0)


def off(series: Balanced, cycle: Cycle) -> tuple[float, float]:
    """Of period and slip amplitude."""
    own = sampled_series(series, "")
    return abs(own.period / cycle.period - 1.0), abs(own.slip_amplitude / cycle.slip_amplitude - 1.0)


@pytest.mark.parametrize(("mu", "kinds"), [(1.0, {"reversal"}), (1.4, {"reversal", "stick"})])
def test_with_more_harmonics_the_cycle_is_that_of_shooting(mu: float, kinds: set[str]):
    """Friction jumps where slip turns, so that the error goes with 1/h (and wiggles): the sum of both below 0.5/h for the
    period, 1/h for the slip, at every h."""
    cycle, family = shot(0.1, mu)
    assert kinds <= set(cycle.kinds)
    for harmonics in (8, 16, 32, 64, 128):
        period, slip = off(beside(cycle, family, harmonics), cycle)
        assert period < 0.03 / harmonics
        assert slip < 0.5 / harmonics
    assert period < 2e-4
    assert slip < 3e-3


def test_a_cycle_is_one_wherever_it_begins_and_however_it_was_solved():
    """With stick its series differ by more than 1e-5 with the scales of the law, and with the harmonics."""
    cycle, family = shot(0.02, 1.4)
    one = beside(cycle, family, 20)
    at = one.at
    later = at.base.real_of(at.base.complex_of(at.z) * np.exp(1j * 1.234 * np.arange(21))[:, None])
    rubbed = Scales(2.0 * at.scales.push, 3.0 * at.scales.rub)
    other = balanced(Balanced(evaluated(family, later, at.omega, at.mu, rubbed)))
    assert abs(other.amplitude / one.amplitude - 1.0) > 1e-5
    assert same_cycle(one, other)
    assert same_cycle(other, one)
    assert same_cycle(one, beside(cycle, family, 13))
    backwards = Balanced(evaluated(family, at.z * np.repeat([1.0, -1.0], [21, 20]), at.omega, at.mu, at.scales))
    assert backwards.period == one.period
    assert backwards.amplitude == one.amplitude
    assert not same_cycle(one, backwards)  # as often and as much, on another orbit


def begun_later(cycle: Cycle, by: int) -> Cycle:
    """The same cycle, whose period begins so many of its instants earlier."""

    def turned(values: Any) -> Any:
        rolled = np.roll(values[:-1], by, axis=0)
        return np.concatenate([rolled, rolled[:1]])

    return replace(
        cycle, normal_force=turned(cycle.normal_force), tangential_force=turned(cycle.tangential_force),
        gap=turned(cycle.gap),
    )  # fmt: skip


@pytest.mark.parametrize("by", [0, *(pytest.param(by, marks=pytest.mark.slow) for by in (189, 378))])
def test_without_reversal_what_is_left_is_the_grid_of_time(by: int, monkeypatch: pytest.MonkeyPatch):
    """Where contact with a stiffness parts and comes back, forces have kinks: means over n times are off by n⁻², by where
    the kinks fall between two of them. With enough times six harmonics have the period to 1e-6, 48 to 1e-8."""
    cycle, family = shot(1.0, 1.2)
    begun, errors = begun_later(cycle, by), []
    for finer in (1, 4, 16):
        monkeypatch.setattr(fourier_module, "FINE", 32 * finer)
        fourier_module.fourier.cache_clear()
        errors.append([off(beside(begun, family, h), cycle)[0] for h in (6, 48)])
    monkeypatch.undo()
    fourier_module.fourier.cache_clear()
    assert errors[0][1] < 5e-6
    assert errors[1][0] < 2e-5
    assert errors[1][1] < 1e-7
    assert errors[2][0] < 1e-6
    assert errors[2][1] < 1e-8


def test_without_reversal_the_equations_of_motion_are_met_ever_better():
    """What is left of them goes with h⁻² or better."""
    cycle, family = shot(1.0, 1.2)
    assert cycle.kinds == ("slip", "separation")
    found = [beside(cycle, family, h) for h in (6, 12, 24, 48)]
    left = np.array([defect(b) for b in found])
    assert np.all(np.log2(left[:-1] / left[1:]) > 2.0)
    assert left[0] < 0.01
    # Hill's multipliers, and Liouville's formula: their product is exp(−tr C T), with this model's 2 · 0.02.
    told = hill(found[1])
    assert told is not None
    multipliers, own_off = told
    assert own_off < 1e-4
    pairs = [found[np.argsort(found.imag)] for found in (multipliers, np.array(cycle.multipliers))]
    assert pairs[0] == pytest.approx(pairs[1], abs=1e-4)
    assert abs(np.prod(multipliers)) == pytest.approx(np.exp(-2 * DAMPED * cycle.period), rel=1e-4)


@pytest.mark.parametrize(("mu", "within"), [(0.9, 0.05), (1.0, 0.02), (1.7, 0.06)])
def test_hill_is_floquet_where_slip_turns_and_sticks(mu: float, within: float):
    cycle, family = shot(0.1, mu)
    found = hill(beside(cycle, family, 60))
    assert found is not None
    assert np.sort(np.abs(found.multipliers)) == pytest.approx(np.sort(np.abs(cycle.multipliers)), abs=within)


@pytest.fixture(scope="module")
def slow_belt() -> Cycles:
    return st.cycles(mode_coupling(DAMPED, 0.1), between=(0.1, 1.8), method="harmonic", runs=0)


def test_a_branch_in_harmonics(slow_belt: Cycles):
    """As that of shooting (`test_cycles`): from the onset, with reversal, then stick, to the end of the range."""
    assert not slow_belt.missing
    (branch,) = slow_belt.branches
    assert branch.begins == "it begins at the onset at μ = 0.7506"
    assert branch.ends == "it leaves the range at μ = 1.8; a fold beyond it is not looked for"
    assert [b.kind for b in branch.bifurcations] == ["reversal of slip begins", "sticking begins"]
    # Shorter sticks begin long before (by shooting at 1.0 at the latest): the sentence says which it tells.
    reversal, stick = branch.bifurcations
    assert stick.sentence == (
        f"sticking of 1/{stick.harmonics} of the period, which {stick.harmonics} harmonics tell, begins between "
        f"μ = {stick.mu_before:.6g} and {stick.mu_after:.6g}"
    )
    first = next(c for c in slow_belt.cycles if "stick" in c.kinds)
    assert first.harmonics == stick.harmonics
    assert first.shares[0, 1] >= 1 / first.harmonics
    # Those without any stick may have a shorter one, and say so.
    without = [c for c in slow_belt.cycles if c.shares[0, 1] == 0.0]
    assert without[0].untold_share == 1 / without[0].harmonics == without[0].to_json()["untold_share"]
    longest = 100 * max(c.untold_share for c in without)
    assert slow_belt.sentence.endswith(f"; sticks shorter than about {longest:.2g} % of a period are not told (harmonic balance)")
    assert reversal.sentence.startswith(
        f"reversal of slip of 1/{reversal.harmonics} of the period, which {reversal.harmonics} harmonics tell, begins between"
    )
    cycles = [slow_belt.cycles[k] for k in branch.cycles]
    assert all(c.method == "harmonic" and c.largest_multiplier < 1.0 for c in cycles)
    # Where slip turns or sticks, however short, multipliers are not right enough to say so of one near one.
    assert all(c.stable for c in cycles if c.largest_multiplier < 0.85)
    near = [c for c in cycles if 0.85 <= c.largest_multiplier < 0.99]
    assert {c.stable for c in near if c.slip_range[0].prod() > 0.0} <= {True}
    assert {c.stable for c in near if {"stick", "reversal"} & set(c.kinds)} == {None}
    assert any(c.stable for c in cycles if "reversal" in c.kinds)
    assert all(c.residual < 1e-7 and c.defect < 3e-3 for c in cycles)
    assert cycles[-1].mu == 1.8
    harmonics = [c.harmonics for c in cycles]
    assert harmonics == sorted(harmonics)
    assert harmonics[-1] > harmonics[0]
    first = cycles[0]
    assert first.mu - 0.7506 == pytest.approx(1e-3, abs=1e-3)
    assert first.frequency_hz == pytest.approx(slow_belt.onsets[0].frequency_hz, rel=1e-3)


def test_what_contacts_do_is_what_they_do_by_shooting():
    exact = st.cycles(mode_coupling(DAMPED, 0.1), 1.4).cycles[0]
    (cycle,) = st.cycles(mode_coupling(DAMPED, 0.1), 1.4, method="harmonic", harmonics=40).cycles
    assert cycle.harmonics == 40
    assert cycle.shares == pytest.approx(exact.shares, abs=0.02)
    assert cycle.force_range == pytest.approx(exact.force_range, abs=0.02 * exact.force_range.max())
    assert cycle.amplitude("velocity")["m"] == pytest.approx(exact.amplitude("velocity")["m"], rel=0.02)
    assert cycle.amplitude("displacement")["m"] == pytest.approx(exact.amplitude("displacement")["m"], rel=0.01)
    assert cycle.kinds == exact.kinds
    normal, friction = cycle.normal_force[:, 0], cycle.tangential_force[:, 0]
    # Coulomb's law holds at every time, with equality where it slips, and against the slip.
    assert np.all(normal >= 0.0)
    assert np.all(np.abs(friction) <= 1.4 * normal * (1 + 1e-12))
    slips = (np.abs(cycle.slip_velocity[:, 0]) > 0.1) & (normal > 0.0)
    assert friction[slips] == pytest.approx(-1.4 * (normal * np.sign(cycle.slip_velocity[:, 0]))[slips], rel=1e-12)


def test_a_cycle_of_another_friction_is_seen():
    cycle, family = shot(0.1, 1.0)
    at = beside(cycle, family, 20).at
    assert at.residual < 1e-7
    assert evaluated(family, at.z, at.omega, 1.05, at.scales).residual > 1e-3
    assert evaluated(family, at.z, 1.01 * at.omega, 1.0, at.scales).residual > 1e-3


def test_multipliers_count_only_where_the_motions_own_is_one(slow_belt: Cycles):
    """It comes out as one within 1e-3 wherever the balance is; of a motion that is no cycle it does not, and nothing is
    said of stability then."""
    assert all(c.own_off < 2e-3 and not c.own_lost for c in slow_belt.cycles)
    cycle, family = shot(0.1, 1.4)
    at = beside(cycle, family, 20).at
    other = sampled_series(Balanced(evaluated(family, 1.2 * at.z, at.omega, 1.4, at.scales)), "")
    assert other.own_off > OWN
    assert other.stable is None
    said = replace(slow_belt, cycles=(*slow_belt.cycles, other)).warnings
    assert any(w.startswith("stability of 1 cycle is left undecided: the multiplier of the motion itself") for w in said)
    assert not any(w.startswith("stability of") for w in slow_belt.warnings)


def test_seconds_end_a_branch():
    """And that is said as what is missing, over a range and at a μ."""
    problem = mode_coupling(DAMPED, 0.1)
    over = st.cycles(problem, between=(0.1, 1.8), method="harmonic", harmonics=5, seconds=1e-9, runs=0)
    assert len(over.cycles) == 1
    assert over.missing == (f"branch 1: its 1e-09 s of computing were over at μ = {over.cycles[0].mu:.6g}",)
    assert "no stable cycle was found between μ = 0.751899 and 1.8" in over.notes[-1]
    assert over.notes[-1].endswith("no run in time was made there")
    at = st.cycles(problem, 1.0, method="harmonic", harmonics=5, seconds=1e-9)
    assert not at.cycles
    assert "it does not pass there; its 1e-09 s of computing were over" in at.missing[0]
    whole = st.cycles(problem, 1.0, method="harmonic", harmonics=5, seconds=300.0)
    assert len(whole.cycles) == 1
    assert not whole.missing


def test_a_fold_beyond_the_friction_asked_for_is_looked_for():
    """The two beams' branch turns back right behind its onset, so that both of its sides pass between."""
    case = st.loads(template_text("two-beams")).with_(
        {"bodies.beam1.elements": 20, "bodies.beam2.elements": 18, "modal.friction_range": [0.06, 0.1]}
    )
    found = st.cycles(case, 0.0768945, method="harmonic", harmonics=5, seconds=60.0)
    amplitudes = sorted(c.slip_amplitude for c in found.cycles)
    assert len(amplitudes) >= 2
    assert amplitudes[0] < amplitudes[1] < 1.01 * amplitudes[0]
    assert "a fold beyond it is not looked for" in found.notes[-1]


def falling(speed: float = 1.0) -> System:
    """Friction 1/(1 + 3|v|) under 1 N on a belt at ``speed``, damping 0.1 (cases of falling friction)."""
    return block_on_belt(law=Hyperbolic(0.0, 1.0, 3.0), damping=0.1, speed=speed)


@pytest.fixture(scope="module")
def falling_branch() -> Cycles:
    return st.cycles(falling(), between=(0.02, 0.3), method="harmonic", runs=0)  # the branch of the onset alone


def test_falling_friction_is_subcritical(falling_branch: Cycles):
    """Its Hopf point is the onset μ δ/(1 + δ) = c, in closed form; growing cycles lie below it, up to where slip first
    stops: there the branch turns back and is stable."""
    (onset,) = falling_branch.onsets
    assert onset.mu == pytest.approx(0.1 * 4.0 / 3.0, rel=1e-9)
    (branch,) = falling_branch.branches
    cycles = [falling_branch.cycles[k] for k in branch.cycles]
    small = np.array([c.slip_amplitude for c in cycles[:3]])
    # μ falls with the square of the amplitude, towards the onset.
    slopes = (onset.mu - np.array([c.mu for c in cycles[:3]])) / small**2
    assert np.ptp(slopes) < 0.02 * slopes.mean()
    # An amplitude a of slip steepens friction by F‴a²/8 in the mean, F‴/F′ = 6 δ²/(1 + δ)².
    assert slopes[0] == pytest.approx(onset.mu * 6 * 3**2 / 4**2 / 8, rel=0.01)
    folds = [falling_branch.cycles[k] for k in branch.folds]
    assert folds[0].slip_amplitude == pytest.approx(1.0, abs=5e-3)
    before = [c for c in cycles if c.slip_amplitude < 0.99]
    assert all(c.largest_multiplier > 1.0 and not c.stable for c in before)
    last = cycles[-1]
    assert last.mu > folds[0].mu
    assert last.stable
    assert "stick" in last.kinds


def test_the_unstable_cycle_is_a_border(falling_branch: Cycles):
    """An integration of the equation of motion comes back to it; from a little less it dies out, from more it grows."""
    cycle = min((c for c in falling_branch.cycles if c.stable is False), key=lambda c: abs(c.mu - 0.1))
    friction = cycle.mu * 4.0

    def rate(_: float, y: np.ndarray) -> list[float]:
        return [y[1], -y[0] - 0.1 * y[1] + friction / (1.0 + 3.0 * (1.0 - y[1]))]

    begun = np.array([cycle.displacement[0, 0, 0], cycle.velocity[0, 0, 0]])
    back = solve_ivp(rate, (0.0, cycle.period), begun, rtol=1e-11, atol=1e-13).y[:, -1]
    assert back == pytest.approx(begun, abs=2e-4 * cycle.slip_amplitude)
    steady = np.array([friction / 4.0, 0.0])
    for share, larger in ((0.98, False), (1.02, True)):
        start = steady + share * (begun - steady)
        end = solve_ivp(rate, (0.0, 12 * cycle.period), start, rtol=1e-10, atol=1e-12).y[:, -1]
        assert (np.linalg.norm(end - steady) > np.linalg.norm(start - steady)) is np.bool_(larger)


def test_static_friction_above_kinetic_is_refused():
    system = block_on_belt(law=StaticKinetic(0.3, 0.4), speed=0.2)
    with pytest.raises(st.CaseError, match=r'its force jumps as it lets go.*; method = "shooting" takes it'):
        st.cycles(system, 0.3, method="harmonic")
    (cycle,) = st.cycles(system, 0.3, push=0.3).cycles  # auto
    assert cycle.method == "shooting"
    # Nor is there an onset from which a branch could lead to it.
    assert not st.onsets(system, (0.0, 1.0)).onsets


def beam_with_joint() -> tuple[System, int, float]:
    """NLvib 1.3, example 08 (Krack and Gross 2019): a clamped beam with dry friction at its fourth node of nine; the
    system, the freedom of its tip and the first frequency with that node held."""
    length, height, width, modulus, density = 2.0, 0.1, 0.3, 185e9, 7830.0
    element = BeamElement(length / 8, modulus * width * height, modulus * width * height**3 / 12,
                          density * width * height, (1.0, 0.0))  # fmt: skip
    mass, stiffness = (m.toarray() for m in assemble_beam(BeamMesh((0.0, 0.0), 8, element), lumped=False))
    bends = [i for i in range(3, len(mass)) if i % 3]
    mass, stiffness = mass[np.ix_(bends, bends)], stiffness[np.ix_(bends, bends)]
    joint, tip = 2 * (4 - 2), 2 * (9 - 2)
    free = np.sqrt(sl.eigh(stiffness, mass, eigvals_only=True)[:2])
    assert free == pytest.approx([123.3406, 773.0225], rel=1e-6)
    others = [i for i in range(len(mass)) if i != joint]
    held = float(np.sqrt(sl.eigh(stiffness[np.ix_(others, others)], mass[np.ix_(others, others)], eigvals_only=True)[0]))
    assert held == pytest.approx(248.9732, rel=1e-6)
    # One freedom more, which presses with 1.5 N: friction is 1.5 tanh(v/6e-7) N.
    size = len(mass) + 1
    normal, tangent = np.eye(size)[-1], np.eye(size)[joint]
    speeds = 6e-7 * np.append(np.linspace(0.0, 6.0, 400), 40.0)
    law = Tabulated(tuple(speeds), tuple(np.tanh(speeds / 6e-7)), "monotone-cubic")
    matrices = (sl.block_diag(m, one) for m, one in ((mass, 1.0), (0.02 / held * stiffness, 0.0), (stiffness, 0.0)))
    return System(*matrices, (touch(normal, tangent, law=law),), {"press": -1.5 * normal}), tip, held


@pytest.mark.parametrize(
    ("omega", "wanted"), [(300.0, 4.7212), (260.0, 5.4457), (220.0, 6.2651), (180.0, 6.1635), (120.0, 3.9476)]
)
def test_forced_beam_with_a_friction_joint(omega: float, wanted: float):
    """Tip, root of mean square, as NLvib has it."""
    system, tip, _ = beam_with_joint()
    family = HarmonicFamily(system, 100.0, own=True)
    force = 0.2 * np.eye(system.size)[tip]
    found = forced(family, force, omega, 15, scale=Scales(np.ones(1), np.array([1e5])))
    at_tip = np.eye(system.size)[tip : tip + 1]
    assert 1e8 * found.rows(at_tip)[0] == pytest.approx(wanted, rel=0.003)
    # Under a force so small that tanh is its argument, the joint is a dashpot.
    small = 1e-4 * force
    alone = forced(family, small, omega, 15, scale=Scales(np.ones(1), np.array([1e5])))
    joint = system.contacts[0].tangent_row
    dynamic = (system.stiffness + 1j * omega * system.damping - omega**2 * system.mass).toarray()
    dynamic += 1j * omega * 1.5 / 6e-7 * np.outer(joint, joint)
    linear = np.abs(np.linalg.solve(dynamic, small)[tip]) / np.sqrt(2.0)
    assert alone.rows(at_tip)[0] == pytest.approx(linear, rel=1e-3)


def varied(seed: int) -> HarmonicFamily:
    """Two contacts of a random system: with stiffness and its cube, and rigid; friction that falls and that does not;
    and a cubic spring."""
    system = random_system(seed)[0]
    one = system.contacts[0]
    rows = np.random.default_rng(seed).normal(size=(3, system.size))
    laws = (Weakening(0.2, 0.5, 0.3), Coulomb(0.4))
    contacts = tuple(
        replace(one, normal_row=rows[k], tangent_row=rows[2 - k], law=laws[k], stiffness=(30.0, np.inf)[k], name="AB"[k])
        for k in range(2)
    )
    spring = CubicSprings(Rows(rows[2:], np.zeros((1, 1))), np.array([2.0]), 0.1)
    press = {"press": -contacts[0].normal_row - 0.5 * contacts[1].normal_row}
    return HarmonicFamily(
        replace(system, contacts=contacts, loads=press, cubic=spring, contact_cubic={"A": 40.0}), 1.0
    )


@pytest.mark.parametrize("space", [False, True])
def test_the_derivative_is_the_difference(space: bool):
    """By z, ω and μ, at states where all contacts stick, slip and part."""
    if space:
        block = case(slider(space=True, stiffness=1e13)).with_(
            {"bodies.block.mesh.divisions": [3, 2, 1], "bodies.slider.mesh.divisions": [5, 3, 1]}
        )
        family, size, omega = HarmonicFamily(st.Workspace(block).system(), 500.0), 3000.0, 3000.0
    else:
        family, size, omega = varied(3), 1.0, 2.0
    rng = np.random.default_rng(0)
    mu, harmonics = 0.7, 3
    scale = scales(family, omega, mu, harmonics)
    z = size * rng.normal(size=(len(family.still), 2 * harmonics + 1))
    z[:, 0] += still(family, mu, scale)[0]
    at = evaluated(family, z, omega, mu, scale)
    assert len(np.unique(at.applied.status)) == 3
    way, step = rng.normal(size=z.shape) * size, 1e-7

    def difference(dz: float, domega: float, dmu: float) -> np.ndarray:
        ends = [
            evaluated(family, z + s * dz * way, omega + s * domega, mu + s * dmu, scale).left for s in (1.0, -1.0)
        ]
        return (ends[0] - ends[1]) / 2.0

    for found, wanted in (
        ((at.jacobian @ way.ravel()).reshape(z.shape), difference(step, 0.0, 0.0) / step),
        (at.by_omega, difference(0.0, step * omega, 0.0) / (step * omega)),
        (at.by_mu, difference(0.0, 0.0, step) / step),
    ):
        assert found == pytest.approx(wanted, abs=1e-4 * np.abs(wanted).max())


def cycles_of(system: System) -> list[ClosedShot]:
    """By shooting at μ = 0.8."""
    found: list[ClosedShot] = []
    try:
        problem = Family(system).at(0.8)
        motions = [pushed(problem, 3.0 * problem.sliding_speed), *(m for _, m in growing(problem))]
    except st.AnalysisError:  # friction jams
        return found
    for motion in motions:
        with contextlib.suppress(st.AnalysisError):  # it dies out
            found += cycles_reached(problem, motion, seconds=3.0)
    return found


@pytest.mark.parametrize(
    "seeds",
    [(76,), *(pytest.param(k, marks=pytest.mark.slow) for k in ((55,), range(40, 140)))],
    ids=["few", "other", "many"],
)
def test_random_systems_have_the_cycles_of_shooting(seeds: range):
    """One to two contacts with stiffness, three to five masses. Where slip neither turns nor sticks the period is right
    to 1e-5; elsewhere it comes closer with more harmonics, but for few that are as far off with 80 as with 20."""
    compared, apart, stuck = 0, [], []
    for seed in seeds:
        system = random_system(seed if seed % 4 else seed + 1)[0]
        contacts = tuple(replace(c, law=Coulomb(c.law.sliding(1.0)), stiffness=300.0) for c in system.contacts)
        system = replace(system, contacts=contacts)
        for closed in cycles_of(system)[:1]:
            cycle = sampled(closed, "")
            family = HarmonicFamily(system, cycle.frequency_hz)
            try:
                coarse, fine = (off(beside(cycle, family, h), cycle) for h in (20, 80))
            except st.AnalysisError:  # Newton's method finds none so near
                apart.append(np.inf)
                continue
            compared += 1
            if not {"stick", "reversal"} & set(cycle.kinds):
                assert fine[0] < 1e-5, seed
                assert fine[1] < 1e-3, seed
            apart.append(fine[0])
            stuck += [seed] if fine[0] >= max(0.7 * coarse[0], 1e-4) else []
    assert compared >= max(len(seeds) // 6, 1)
    assert len(stuck) <= compared // 5, stuck
    assert np.median(apart) < 1e-3


@pytest.mark.parametrize(("mu", "turning"), [(1.0, 0.133), (1.4, 0.230)])
def test_slip_that_turns_is_told_as_by_shooting(mu: float, turning: float):
    """Share of the period with slip against the belt by shooting; told with few harmonics and with many."""
    cycle, family = shot(0.1, mu)
    assert np.mean(cycle.slip_velocity[:, 0] < 0.0) == pytest.approx(turning, abs=0.01)
    for harmonics in (8, 32):
        assert sampled_series(beside(cycle, family, harmonics), "").kinds == cycle.kinds


@pytest.mark.parametrize("damping", [None, *(pytest.param(d, marks=pytest.mark.slow) for d in (0.06, 0.1))])
def test_series_that_overshoot_beside_stick_do_not_turn(damping: float | None, falling_branch: Cycles):
    """A mass on a belt whose friction falls never overtakes it, so slip comes to rest and goes on the same way (by
    integration of the equation of motion, too); what series of its slip have on the other side is their overshoot."""
    found = falling_branch
    if damping is not None:
        system = block_on_belt(law=Hyperbolic(0.0, 1.0, 3.0), damping=damping, speed=0.5)
        found = st.cycles(system, between=(0.02, 0.3), method="harmonic", runs=0)
    assert any("stick" in c.kinds for c in found.cycles)
    overshoot = [np.abs(c.slip_range).min() / c.slip_amplitude for c in found.cycles if c.slip_range.prod() < 0.0]
    assert 0.0 < max(overshoot) < 0.03
    assert not any("reversal" in c.kinds for c in found.cycles)
    assert [b.kind for branch in found.branches for b in branch.bifurcations] == ["fold", "sticking begins"]


@pytest.mark.parametrize(
    ("codes", "wanted"),
    [
        ("2222222222222322", "2222222222222222"),  # turned for less than the last harmonic's period
        ("3333333333332333", "3333333333333333"),
        ("2222233333333222", "2222233333333222"),  # long enough
        ("2222222221322222", "2222222222222222"),  # behind a stick that is too short itself
        ("1111111122223333", "1111111122223333"),
        ("0000000000322222", "0000000000322222"),  # as a contact closes friction tells which way
    ],
)
def test_what_lasts_too_short_is_not_told(codes: str, wanted: str):
    found = without_short(np.array([int(c) for c in codes]), 5)
    assert "".join(map(str, found)) == wanted


COARSE = {
    "bodies.disc.mesh.divisions": [4, 32, 1], "bodies.lining.mesh.divisions": [3, 4, 1],
    "bodies.plate.mesh.divisions": [2, 4, 1], "modal.max_frequency_hz": 3000.0,
}  # fmt: skip


def test_a_pad_on_a_disc():
    """20 nodes in space, where shooting refuses. Small cycles have μ and frequency of the modal onset, which knows
    nothing of harmonics, nodes or condensation; all forces of a cycle balance on the freedoms of the whole model."""
    pad = st.loads(template_text("pad-on-disc")).with_(COARSE)
    work = st.Workspace(pad)
    onset = st.onsets(work, (0.0, 1.0)).onsets[0]
    system = work.system()
    family = HarmonicFamily(system, onset.frequency_hz)
    assert not family.condensed.complete
    steady = family.steady(onset.mu)
    z, _ = still(family, onset.mu, scales(family, 2 * np.pi * onset.frequency_hz, onset.mu, 3))
    value = family.condensed(np.zeros(1, dtype=complex))[0][0].real
    gap, _, _ = family.split(value @ z + family.still)
    assert gap + family.nodes.gap == pytest.approx(steady.gap, abs=1e-9 * np.abs(steady.gap).max())
    branch = HarmonicBranch((0.0, 1.0))
    cycle, heading = born(family, branch, onset.mu, onset.frequency_hz, 5)
    assert cycle.changes
    assert cycle.mu == pytest.approx(onset.mu, rel=2e-3)
    assert 1.0 / cycle.period == pytest.approx(onset.frequency_hz, rel=1e-5)
    assert np.linalg.norm(heading) == pytest.approx(1.0)
    at, nodes = cycle.at, family.nodes
    moved = coordinates(cycle)[1] @ family.condensed.vectors.T
    force = family.joined(at.applied.normal, at.applied.tangential, np.zeros((0, at.base.samples)))
    acting = 2.0 * np.fft.rfft(force, axis=1)[:, 1] / at.base.samples
    s = 1j * at.omega
    own = s**2 * (system.mass @ moved) + s * (system.damping @ moved) + system.stiffness @ moved
    given = np.concatenate([nodes.normal.toarray(), nodes.tangent.toarray()]).T @ acting
    # Galerkin's residual, by the displacements that it would make.
    miss = np.linalg.solve(system.stiffness.toarray() + 1e3 * np.eye(system.size), own - given)
    assert np.linalg.norm(miss) < 1e-3 * np.linalg.norm(moved)
    with pytest.raises(st.CaseError, match=r'method = "harmonic" takes it'):
        st.cycles(work, 0.2, method="shooting")


@pytest.mark.slow  # in each run: `test_a_pad_on_a_disc`, and `test_cycles.py` has the explicit runs
def test_a_block_on_a_slider_swings_as_in_an_explicit_run():
    """11 nodes in the plane, far from the onset; contacts part and come back."""
    damping = {"mass": 20.0, "stiffness": 2e-7}
    block = case(slider(space=False, stiffness=1e13)).with_({
        "bodies.block.damping": damping, "bodies.slider.damping": damping, "bodies.block.mass": "lumped",
        "bodies.slider.mass": "lumped", "modal.max_frequency_hz": 25000.0, "modal.friction_range": [0.08, 0.1],
        "phases": [{"name": "slide", "duration": 0.012}], "temporal.initial": "steady-sliding",
        "temporal.perturbation": 0.01, "temporal.record_every": 4, "temporal.watch": ["block.near"],
    })  # fmt: skip
    work = st.Workspace(block)
    found = st.cycles(work, between=(0.08, 0.1), method="harmonic", harmonics=12, runs=0)
    (cycle,) = [c for c in found.cycles if c.mu == 0.1]
    assert cycle.kinds == ("slip", "separation")
    assert cycle.defect < 0.02
    assert cycle.stable is None  # too large for Hill
    run = st.simulate(work, mu=0.1)
    last = run.time > 0.75 * run.time[-1]
    speed, time = run.velocity[last, 0, 1], run.time[last]
    up = np.flatnonzero((speed[:-1] < 0.0) & (speed[1:] >= 0.0))
    passed = time[up] - speed[up] / (speed[up + 1] - speed[up]) * (time[1] - time[0])
    assert (len(passed) - 1) / (passed[-1] - passed[0]) == pytest.approx(cycle.frequency_hz, rel=1e-3)
    assert 0.5 * np.ptp(speed) == pytest.approx(cycle.amplitude("velocity")["block.near"][1], rel=0.05)


def test_bad_input_and_files(slow_belt: Cycles, tmp_path: Path):
    problem = mode_coupling(DAMPED, 0.1)
    for given, said in (
        ({"method": "collocation"}, "auto, shooting, harmonic"),
        ({"method": "harmonic", "harmonics": 0}, "1 to 1000 harmonics"),
        ({"method": "shooting", "harmonics": 5}, "shooting has none"),
        ({"method": "harmonic", "harmonics": 7.5}, "1 to 1000 harmonics"),
        ({"method": "harmonic", "push": 0.1}, "harmonic balance follows no motions"),
        ({"points": 2.5}, "a whole number"),
    ):
        with pytest.raises(st.CaseError, match=said):
            st.cycles(problem, 1.0, **given)
    none = st.cycles(problem, 0.2, method="harmonic", harmonics=5)
    assert not none.cycles
    assert "it does not pass there" in none.missing[0]
    st.save(slow_belt, tmp_path / "cycles.nc")
    back = st.open(tmp_path / "cycles.nc")
    assert isinstance(back, Cycles)
    assert back.to_json() == slow_belt.to_json()
    assert back.cycles[3].harmonics == slow_belt.cycles[3].harmonics

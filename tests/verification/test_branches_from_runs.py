"""Branches over a range of μ that begin in what a run in time settles in, where no branch from an onset has a stable
cycle: against the stick–slip of one mass by integration, and runs of steps and pushes of their own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import stridor as st
from falling_benches import check_is_run, long_run, work_of
from marching import block_on_belt
from stridor.laws import Hyperbolic
from stridor.periodic import Cycle, CycleBranch, Cycles
from stridor.view.cycle_parts import branch_words

pytestmark = pytest.mark.verification

RUN = "a run in time at μ = "


def of_runs(found: Cycles) -> list[CycleBranch]:
    """Branches that begin in what a run stays in."""
    return [b for b in found.branches if b.reached_from.startswith(RUN) and "passes near" not in b.reached_from]


def about(found: Cycles, branch: CycleBranch) -> list[Cycle]:
    """Cycles of a branch about the one that the run settled in, up to where it is unstable or turns, by their μ."""
    cycles = [found.cycles[k] for k in branch.cycles]
    first = last = next(i for i, c in enumerate(cycles) if c.reached_from == branch.reached_from)
    while first > 0 and branch.cycles[first] not in branch.folds and cycles[first - 1].stable is not False:
        first -= 1
    while last + 1 < len(cycles) and branch.cycles[last] not in branch.folds and cycles[last + 1].stable is not False:
        last += 1
    return sorted(cycles[first : last + 1], key=lambda c: c.mu)


def picked(cycles: list[Cycle], low: float) -> list[Cycle]:
    """Four of them, from a μ on."""
    mus = np.array([c.mu for c in cycles])
    return [cycles[int(np.argmin(np.abs(mus - mu)))] for mu in np.quantile([low, mus[-1]], (0.15, 0.4, 0.65, 0.9))]


@dataclass(frozen=True)
class Mass:
    """One of 1 kg on a spring of 1 N/m, pressed by 1 N on a belt, with friction μ (1 + δ v₀)/(1 + δ|v|)."""

    damping: float
    delta: float
    speed: float

    @staticmethod
    def of(seed: int) -> Mass:
        """Any."""
        r = np.random.default_rng(seed)
        return Mass(float(r.uniform(0.03, 0.15)), float(r.uniform(1.0, 5.0)), float(r.uniform(0.4, 1.5)))

    @property
    def onset(self) -> float:
        """μ at which the slope of friction is −c, in closed form."""
        return self.damping * (1.0 + self.delta * self.speed) / self.delta

    def cycles(self, **options: Any) -> Cycles:
        """By harmonic balance; its branch from the onset ends before it is stable, where the slip first stops."""
        system = block_on_belt(law=Hyperbolic(0.0, 1.0, self.delta), damping=self.damping, speed=self.speed)
        between = (0.5 * self.onset, 2.0 * self.onset)
        return st.cycles(system, between=between, method="harmonic", points=POINTS, runs=1, **options)

    def stick_slip(self, mu: float) -> tuple[float, float]:
        """Period and slip amplitude of what it does from one letting go to the next, by integration of its motion."""
        most, lasted, swept = mu * (1.0 + self.delta * self.speed), 0.0, [0.0]
        pulled = self.damping * self.speed  # by the dashpot while it sticks
        place, way = most - pulled, -1.0  # the way it slips over the belt
        for _ in range(4):
            # Friction falls with the slip: from a little further on it goes on.
            begun = [place - way * 1e-9, self.speed + way * 1e-9]
            run = solve_ivp(
                self._rate, (0.0, 100.0), begun, args=(most, way), events=_stopped(self.speed, way), rtol=1e-10,
                atol=1e-12, max_step=0.01,
            )  # fmt: skip
            swept += [float(run.y[1].min()) - self.speed, float(run.y[1].max()) - self.speed]
            lasted, place = lasted + float(run.t[-1]), float(run.y[0, -1])
            if abs(place + pulled) < most:
                return lasted + (most - pulled - place) / self.speed, 0.5 * (max(swept) - min(swept))
            way = -way
        raise AssertionError("it does not stick")

    def _rate(self, _: float, y: np.ndarray, most: float, way: float) -> list[float]:
        slip = max(way * (y[1] - self.speed), 0.0)
        return [y[1], -y[0] - self.damping * y[1] - way * most / (1.0 + self.delta * slip)]


def _stopped(speed: float, way: float) -> Callable[..., float]:
    def slip(_: float, y: np.ndarray, *__: float) -> float:
        return y[1] - speed

    slip.terminal, slip.direction = True, -way  # type: ignore[attr-defined]
    return slip


POINTS = 40  # too few to lead round the fold


@pytest.mark.parametrize("seed", [3, *(pytest.param(k, marks=pytest.mark.slow) for k in (1, 2, *range(4, 11)))])
def test_stick_slip_of_a_mass_is_followed_from_a_run(seed: int):
    mass = Mass.of(seed)
    found = mass.cycles()
    assert found.onsets[0].mu == pytest.approx(mass.onset, rel=1e-9)
    (branch,) = of_runs(found)
    assert branch.reached_from.startswith(f"{RUN}{(mass.onset + found.between[1]) / 2:.6g} from a push of ")
    cycles = sorted((found.cycles[k] for k in branch.cycles if "stick" in found.cycles[k].kinds), key=lambda c: c.mu)
    assert cycles[0].mu < mass.onset
    assert cycles[-1].mu > 0.98 * found.between[1]
    for cycle in picked(cycles, cycles[0].mu):
        period, amplitude = mass.stick_slip(cycle.mu)
        assert cycle.period == pytest.approx(period, rel=0.01)
        assert cycle.slip_amplitude == pytest.approx(amplitude, rel=0.01)


@pytest.mark.parametrize("seed", [pytest.param(seed, marks=pytest.mark.slow) for seed in (35, 38)])
def test_branches_of_runs_are_what_other_runs_settle_in(seed: int):
    """Branches of onsets turn back before they are stable, or end; steady sliding is unstable up to the end."""
    work, _ = work_of(seed)
    found = st.cycles(work, between=(0.0, 1.6), seconds=20.0)
    assert not [words for words in found.missing if words.startswith("no stable cycle")]
    branch = of_runs(found)[0]
    cycles = about(found, branch)
    for cycle in picked(cycles, max(found.onsets[0].mu, cycles[0].mu)):
        check_is_run(cycle, long_run(seed, mu=cycle.mu), amplitude=0.01)


def test_a_range_without_a_cycle_is_named():
    """At 11 runs come back after 93 turns at best. With one run, the middle of the only interval is asked."""
    work, _ = work_of(11)
    found = st.cycles(work, between=(0.55, 0.65), seconds=4.0, runs=1)
    assert not [c for c in found.cycles if c.stable]
    said = [words for words in found.missing if words.startswith("μ = 0.6, from a run in time from a push of ")]
    assert len(said) == 2
    assert all("came back to" in words for words in said)
    (left,) = [words for words in found.missing if words.startswith("no stable cycle")]
    assert left.startswith(
        "no stable cycle was found between μ = 0.55 and 0.65, where steady sliding is unstable: runs in time at "
        "μ = 0.6 led to none"
    )


def test_ctrl_c_keeps_the_branch_of_a_run():
    mass, kept = Mass.of(3), list[Cycles]()

    def stop(count: int, doing: str) -> None:
        if doing.startswith("branch of the cycle") and count > POINTS + 6:
            raise KeyboardInterrupt

    found = mass.cycles(progress=stop, keep=kept.append)
    assert found.interrupted
    (branch,) = of_runs(found)
    assert 3 <= len(branch.cycles) <= 7
    assert {len(one.cycles) for one in kept} == set(range(1, len(found.cycles)))  # stopped before the last was kept
    assert not [words for words in found.missing if words.startswith("no stable cycle")]
    again = Cycles.from_xarray(found.to_xarray())
    assert [b.to_json() for b in again.branches] == [b.to_json() for b in found.branches]
    assert branch.to_json()["reached_from"].startswith(RUN)
    assert branch_words(found)[1].startswith(f"branch 2, {len(branch.cycles)} cycles, followed from {RUN}")

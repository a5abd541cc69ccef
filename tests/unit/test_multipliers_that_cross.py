"""What is told where multipliers pass the unit circle along a branch."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import stridor as st
from mode_coupling import mode_coupling
from stridor.periodic import Cycle
from stridor.periodic.crossings import Crossed, crossings
from stridor.study.cycle_branches import Traced


@pytest.fixture(scope="module")
def cycle() -> Cycle:
    return st.cycles(mode_coupling(0.02, 0.1), 1.0, push=0.2).cycles[0]


TOLD = {
    "a second one": ([(-1.04, 0.5), (-1.04, 1.2)], [], [("branching", 0, 1)]),
    "one at -1 though another is beyond": ([(1.5, -1.0358), (1.6, -0.9548)], [], [("period doubling", 0, 1)]),
    "there and back": ([(1.5, 0.9), (1.5, 1.1), (1.5, 0.9)], [], [("branching", 0, 1), ("branching", 1, 2)]),
    "a pair": ([(0.7 + 0.7j, 0.7 - 0.7j), (0.8 + 0.8j, 0.8 - 0.8j)], [], [("torus", 0, 1)]),
    "a pair that becomes two real ones": ([(-1.1 + 0.1j, -1.1 - 0.1j), (-1.3, -1.05)], [], []),
    "one in, one out": ([(1.2, -0.9), (-1.2, 0.9)], [], []),
    "through what decides nothing": ([(-0.9, 0.1), (-1.0, 0.1), (-1.1, 0.1)], [], [("period doubling", 0, 2)]),
    "up to what decides nothing": ([(-0.9, 0.1), (-1.0, 0.1), (-0.9, 0.1)], [], []),
    "at a fold": ([(0.9, 0.1), (1.0, 0.1), (1.1, 0.1)], [1], []),
    "at a fold, where it meets the motion's own": ([(1.1, 0.1), (1.0001 + 1e-4j, 0.1), (0.9, 0.1)], [1], []),
    "at a fold, behind which it meets the one before": (
        [(1.3, 0.9), (1.008, 0.997), (1.002 + 0.016j, 1.002 - 0.016j), (0.98 + 0.09j, 0.98 - 0.09j)],
        [1], [("torus", 2, 3)],
    ),
    "one that meets another beyond at once": ([(1.2, 0.9), (1.1 + 0.1j, 1.1 - 0.1j)], [], [("branching", 0, 1)]),
    "one at -1 that does": ([(-1.2, -0.9), (-1.1 + 0.1j, -1.1 - 0.1j)], [], [("period doubling", 0, 1)]),
    "at a fold, and another": ([(0.9, -0.9), (1.0, -0.95), (1.2, -1.1)], [1], [("period doubling", 0, 2)]),
    "two at once, one of them unsure": (
        [(-0.9, 0.9), (-1.2, 1.0), (-1.2, 1.1)], [], [("period doubling", 0, 1), ("branching", 0, 2)],
    ),
}  # fmt: skip


@pytest.mark.parametrize(("multipliers", "folds", "wanted"), TOLD.values(), ids=TOLD)
def test_each_that_passes_is_told(
    cycle: Cycle, multipliers: list[tuple[complex, ...]], folds: list[int], wanted: list[tuple[str, int, int]]
):
    cycles = [replace(cycle, multipliers=np.array(values, dtype=complex)) for values in multipliers]
    assert crossings(cycles, folds) == wanted


Along = Callable[[float], tuple[complex, ...]]  # multipliers by μ


class Line:
    """Cycles by μ from 0 to 1, whose contacts change in another way from ``turn`` on."""

    def __init__(self, cycle: Cycle, multipliers: Along, turn: float, hole: tuple[float, float] = (2.0, 2.0)) -> None:
        self.cycle, self.multipliers, self.turn, self.hole, self.closed = cycle, multipliers, turn, hole, 0

    def at(self, mu: float) -> Cycle:
        changes = self.cycle.changes if mu < self.turn else self.cycle.changes[:-1]
        return replace(self.cycle, mu=mu, changes=changes, multipliers=np.array(self.multipliers(mu), dtype=complex))

    def halfway(self, one: Cycle, other: Cycle) -> Cycle | None:
        self.closed += 1
        mu = 0.5 * (one.mu + other.mu)
        return None if self.hole[0] < mu < self.hole[1] else self.at(mu)

    def crossings(self) -> list[tuple[Crossed, int, int]]:
        return crossings([self.at(0.0), self.at(1.0)], [], self.halfway)


def jump(before: tuple[complex, ...], behind: tuple[complex, ...], at: float) -> Along:
    return lambda mu: before if mu < at else behind


def test_where_contacts_change_in_another_way_multipliers_jump(cycle: Cycle):
    found = [
        Line(cycle, jump(before, behind, 0.3), 0.3).crossings()
        for before, behind in (((0.5, 0.1), (1.5, 0.1)), ((1.5, 0.1), (1.5, 1.2)), ((1.5, 1.2), (1.5, 0.2)))
    ]
    assert found == [
        [("stability changes with the contacts", 0, 1)],
        [("more of it grows with the contacts", 0, 1)],
        [("less of it grows with the contacts", 0, 1)],
    ]


def turned(mu: float) -> tuple[complex, ...]:
    return (0.9 + 0.2 * mu) * np.exp(1j), (0.9 + 0.2 * mu) * np.exp(-1j)


def steep(mu: float) -> tuple[complex, ...]:
    return (1.0 + 0.5 * np.sign(mu - 0.3) * abs(mu - 0.3) ** 0.3, 0.1)


SMOOTH: dict[str, tuple[Along, float, list[str]]] = {
    "before it passes": (lambda mu: (-0.9 - 0.3 * mu, 0.1), 0.2, ["period doubling"]),
    "behind": (lambda mu: (-0.9 - 0.3 * mu, 0.1), 0.8, ["period doubling"]),
    "on its way back": (lambda mu: (-1.1 + 0.3 * mu, 0.1), 0.8, ["period doubling"]),
    "beside a pair": (turned, 0.9, ["torus"]),
    "where it passes, without a jump": (lambda mu: (-0.9 - 0.3 * mu, 0.1), 0.3333, ["period doubling"]),
    "and a jump behind": (
        lambda mu: (-0.9 - 0.3 * mu, 0.1 if mu < 0.7 else 1.3), 0.7,
        ["period doubling", "more of it grows with the contacts"],
    ),
    "and a jump before": (
        lambda mu: (-0.9 - 0.15 * mu, 0.1 if mu < 0.4 else 1.3), 0.4,
        ["stability changes with the contacts", "period doubling"],
    ),
    "steeply, no jump": (steep, 0.3, ["multipliers pass or jump, undecided"]),
}  # fmt: skip


@pytest.mark.parametrize(("multipliers", "turn", "wanted"), SMOOTH.values(), ids=SMOOTH)
def test_where_they_do_not_jump_it_is_named_by_what_passes(
    cycle: Cycle, multipliers: Along, turn: float, wanted: list[str]
):
    line = Line(cycle, multipliers, turn)
    told = [kind for kind, _, _ in line.crossings()]
    assert told == wanted
    assert line.closed <= 10 * len(wanted)


def test_where_no_cycle_is_closed_in_between_nothing_is_claimed(cycle: Cycle):
    line = Line(cycle, lambda mu: (-0.9 - 0.3 * mu, 0.1), 0.3, hole=(0.3, 0.4))
    assert line.crossings() == [("multipliers pass or jump, undecided", 0, 1)]
    assert crossings([line.at(0.0), line.at(1.0)], []) == [("multipliers pass or jump, undecided", 0, 1)]


def test_a_pair_and_a_real_one_that_pass_against_each_other_are_both_told(cycle: Cycle):
    def multipliers(mu: float) -> tuple[complex, ...]:
        return (1.09 - 0.2 * mu) * np.exp(2.6j), (1.09 - 0.2 * mu) * np.exp(-2.6j), -0.7 - 0.45 * mu

    line = Line(cycle, multipliers, 2.0)
    assert line.crossings() == [("torus", 0, 1), ("period doubling", 0, 1)]


def test_one_beyond_where_the_other_end_has_none(cycle: Cycle):
    one = replace(cycle, multipliers=np.zeros(0, dtype=complex))
    other = replace(cycle, multipliers=np.array([-1.2], dtype=complex))
    assert crossings([one, other], []) == [("period doubling", 0, 1)]


def test_cycles_in_between_are_closed_once_and_on_the_same_side_of_a_fold(cycle: Cycle):
    """Of a branch μ = x², with a period of 1 + x; from where ``wrong`` says, closing leads to the other side."""
    closings: list[float] = []
    wrong: list[float] = []

    def again(start: Any, mu: float) -> Any:
        closings.append(mu)
        side = -1.0 if start.mu in wrong else 1.0
        return SimpleNamespace(mu=mu, period=1.0 + side * float(np.sqrt(mu)))

    def sampled(closed: Any, said: str) -> Cycle:
        return replace(cycle, mu=closed.mu, period=closed.period, reached_from=said)

    def lighter(closed: Any) -> Any:
        return closed

    method: Any = SimpleNamespace(again=again, sampled=sampled, lighter=lighter)
    traced = Traced(method)
    for x in (0.2, 0.8):
        traced.add(SimpleNamespace(mu=x * x, period=1.0 + x), "", fold=False)
    one, other = traced.cycles
    for _ in range(2):
        middle = traced.halfway(one, other)
        assert middle is not None
        assert middle.mu == pytest.approx(0.34)
        nearer = traced.halfway(other, middle)
        assert nearer is not None
        assert nearer.period == pytest.approx(1.0 + np.sqrt(0.49))
    assert closings == pytest.approx([0.34, 0.49])
    wrong.append(one.mu)
    traced.halves.clear()
    middle = traced.halfway(one, other)
    assert middle is not None
    assert middle.period == pytest.approx(1.0 + np.sqrt(0.34))
    wrong.append(other.mu)
    traced.halves.clear()
    assert traced.halfway(one, other) is None

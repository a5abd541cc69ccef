"""What is told where multipliers pass the unit circle along a branch."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import stridor as st
from mode_coupling import mode_coupling
from stridor.periodic import Cycle
from stridor.periodic.crossings import crossings


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


def test_where_contacts_change_in_another_way_multipliers_jump(cycle: Cycle):
    other = replace(cycle, changes=cycle.changes[:-1])
    found = [
        crossings(
            [
                replace(cycle, multipliers=np.array(before, dtype=complex)),
                replace(other, multipliers=np.array(behind, dtype=complex)),
            ],
            [],
        )
        for before, behind in (([0.5, 0.1], [1.5, 0.1]), ([1.5, 0.1], [1.5, 1.2]), ([1.5, 1.2], [1.5, 0.2]))
    ]
    assert found == [
        [("stability changes with the contacts", 0, 1)],
        [("more of it grows with the contacts", 0, 1)],
        [("less of it grows with the contacts", 0, 1)],
    ]

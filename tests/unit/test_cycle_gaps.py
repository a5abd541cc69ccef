"""Which intervals of μ have no stable cycle, and where runs are made in them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, cast

from stridor.study.cycle_branches import Traced
from stridor.study.cycle_gaps import Gaps, covered


@dataclass
class At:
    mu: float
    stable: bool | None


def branch(*cycles: tuple[float, bool | None], stays: tuple[tuple[float, int, int], ...] = (), fold: int = -1) -> Traced:
    """Of cycles at these μ, stable or not."""
    traced = Traced(cast(Any, None), cycles=cast(Any, [At(*c) for c in cycles]), stays=list(stays))
    traced.folds = [k == fold for k in range(len(cycles))]
    return traced


def test_stable_neighbours_cover():
    one = branch((0.1, False), (0.2, True), (0.3, True), (0.4, None), (0.5, True), (0.6, False))
    assert covered(one) == [(0.2, 0.3), (0.5, 0.5)]


def test_where_a_run_stays_undecided_ones_count_up_to_unstable_ones():
    row = (0.1, False), (0.2, None), (0.3, None), (0.4, True), (0.5, None), (0.6, False), (0.7, None)
    assert covered(branch(*row)) == [(0.4, 0.4)]
    assert covered(branch(*row, stays=((0.3, 2, 2),))) == [(0.2, 0.5)]
    assert covered(branch(*row, stays=((0.32, 2, 3),)), lost=[0.45]) == [(0.2, 0.4)]
    assert covered(branch(*row, stays=((0.32, 2, 3),)), lost=[0.35]) == [(0.32, 0.32), (0.4, 0.4)]
    assert covered(branch(*row, stays=((0.65, 5, 6),))) == [(0.4, 0.4), (0.65, 0.65)]


def test_where_a_run_stays_undecided_ones_count_up_to_a_fold():
    row = (0.4, None), (0.3, None), (0.2, None), (0.3, None), (0.5, None)
    assert covered(branch(*row, stays=((0.5, 4, 4),), fold=2)) == [(0.2, 0.5)]
    assert covered(branch((0.4, None), (0.2, None), (0.3, None), stays=((0.3, 2, 2),), fold=1)) == [(0.2, 0.3)]


def test_runs_halve_what_is_left():
    gaps, branches = Gaps([(0.25, 1.0)], 0.02), [branch((0.75, True), (0.9, True))]
    assert gaps.left(branches) == [(0.25, 0.75), (0.9, 1.0)]
    assert gaps.next(branches) == (0.5, (0.25, 0.75))
    gaps.runs.append((0.5, "lost"))
    assert gaps.next(branches) == (0.625, (0.25, 0.75))
    gaps.runs.append((0.625, "lost"))
    assert gaps.next(branches) == (0.375, (0.25, 0.75))
    gaps.runs.append((0.375, "late"))  # others would take as long
    assert gaps.next(branches) == (0.95, (0.9, 1.0))


def test_narrow_ones_are_left_out():
    gaps = Gaps([(0.2, 1.0)], 0.02)
    assert gaps.left([branch((0.21, True), (0.99, True))]) == []
    assert gaps.next([branch((0.21, True), (0.99, True))]) is None
    assert gaps.words([]) == [
        "no stable cycle was found between μ = 0.2 and 1, where steady sliding is unstable: no run in time was made there"
    ]


def test_what_runs_led_to_is_named():
    gaps = Gaps([(0.2, 0.4), (0.6, 0.8)], 0.02, [(0.3, "lost"), (0.25, "lost"), (0.7, "late")])
    assert gaps.words([branch((0.65, None))]) == [
        "no stable cycle was found between μ = 0.2 and 0.4, where steady sliding is unstable: runs in time at μ = 0.25, "
        "0.3 led to none",
        "no stable cycle was found between μ = 0.6 and 0.8, where steady sliding is unstable: the time of the run at "
        "μ = 0.7 was over; there are cycles of which it is not known whether they are stable",
    ]


def test_what_counts_as_stable_by_a_run_alone_is_said():
    one = branch((0.1, False), (0.2, None), (0.3, None), (0.4, None), stays=((0.3, 2, 2),))
    assert Gaps([(0.1, 0.4)], 0.02).trusted([branch(), one]) == [
        "branch 1: between μ = 0.2 and 0.4 it is not known of all its cycles whether they are stable; a run in time "
        "settles in it at μ = 0.3"
    ]

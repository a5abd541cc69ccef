"""Onsets of random problems of every kind against the number of growing eigenvalues on a fine grid: none may be wrong."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import random_onsets
from random_onsets import KINDS, disagreement, falling_problem, random_problem
from stridor.errors import FollowingError
from stridor.modal.full import branches, counted, full_onsets, search
from stridor.modal.full.axis import _Walk
from stridor.modal.onset import Onset, Onsets
from stridor.modal.options import Options
from stridor.system import System

pytestmark = pytest.mark.verification

EACH = 16  # problems in each run, two of each kind
SMALLER = 61  # and weekly as small ones, and
FIRST, MANY = 61, 2000  # those of all sizes
UNANSWERED = 0.03  # share at most of which it may be said that the answer is not whole


def judged(seeds: Iterable[int], folder: Path, *, small: bool = False) -> tuple[list[str], list[str]]:
    """What is wrong, and what is said not to be whole."""
    wrong, said = list[str](), list[str]()
    for seed in seeds:
        words, refused = disagreement(random_problem(seed, small=small), folder)
        wrong += [words] if words else []
        said += [refused] if refused else []
    return wrong, said


@pytest.mark.parametrize("kind", range(len(KINDS)), ids=KINDS)
@pytest.mark.parametrize(
    ("first", "end"), [(0, EACH), pytest.param(EACH, SMALLER, marks=pytest.mark.slow)], ids=["few", "more"]
)
def test_some(first: int, end: int, kind: int, tmp_path: Path) -> None:
    wrong, said = judged(range(first + kind, end, len(KINDS)), tmp_path, small=True)
    assert not wrong, "\n".join(wrong)
    assert not said, "\n".join(said)


def test_a_pair_that_falls_apart_and_loses_a_half(tmp_path: Path) -> None:
    """Two motions diverge where a flutter pair meets the real axis; one goes through zero, the other stays."""
    problem = random_problem(857, small=True)
    found = problem.solve(tmp_path)
    assert [(o.kind, o.roots) for o in found.onsets] == [("flutter", 2), ("divergence", -1)]
    ends = found.onsets[-1].mu
    said = f" Of the growing motions without oscillation, at μ = {ends:.6g} one ends and another goes on."
    assert said in found.completeness
    count = [int(np.sum(problem.eigenvalues(mu).real > 1e-9)) for mu in (ends - 1e-6, ends + 1e-6)]
    assert count == [2, 1]


def test_one_that_begins_where_another_ends(tmp_path: Path) -> None:
    """Between two values that are looked at a mode begins to grow at 1070 Hz and another ceases to at 2040 Hz: as many
    grow at both, and they are not the same."""
    problem = random_problem(1664, small=True)
    found = problem.solve(tmp_path)
    close = [o for o in found.onsets if 0.32 < o.mu < 0.33]
    assert [(round(o.frequency_hz, -1), o.roots) for o in close] == [(1070.0, 2), (2040.0, -2)]
    around = [problem.eigenvalues(mu) for o in close for mu in (o.mu - 1e-6, o.mu + 1e-6)]
    count = [int(np.sum(values.real > 1e-9 * np.abs(values))) for values in around]
    assert [count[1] - count[0], count[3] - count[2]] == [2, -2]


def test_all_that_opens_at_the_very_start(tmp_path: Path) -> None:
    """Five modes that nothing damps begin to grow at μ = 0 at once; branches do not lead to the end of one that diverges
    later, so that growing roots are counted, from the start on."""
    problem = random_problem(1246)
    found = problem.solve(tmp_path)
    assert [(o.kind, o.roots) for o in found.onsets] == [("flutter", 2)] * 5 + [("divergence", 1), ("divergence", -1)]
    assert [o.mu for o in found.onsets[:5]] == [0.0] * 5
    assert found.complete
    assert not disagreement(replace(problem, solve=lambda _: found), tmp_path)[0]


@pytest.mark.parametrize(
    "followed", [True, pytest.param(False, marks=pytest.mark.slow)], ids=["followed", "counted"]
)
def test_growth_that_opens_at_the_start_as_a_square(
    followed: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What μ brings is circulatory and gyroscopic: of eleven modes that nothing damps seven begin to grow at μ = 0, with
    no slope, the slowest by 8e-4 μ²."""
    solved = search.solved
    if not followed:
        monkeypatch.setattr(search, "solved", lambda *given: ([], solved(*given)[1], False))
    problem = random_problem(54, small=True)
    found = problem.solve(tmp_path)
    assert found.complete
    assert [(o.mu, o.growth_slope, o.roots) for o in found.onsets] == [(0.0, 0.0, 2)] * 7
    beside = problem.eigenvalues(1e-4)
    grown = np.sort(beside.imag[(beside.real > 0) & (beside.imag > 0)]) / (2 * np.pi)
    np.testing.assert_allclose([o.frequency_hz for o in found.onsets], grown, rtol=1e-4)


# With 24 of 46 modes of the last the search takes some seconds.
@pytest.mark.parametrize(
    ("seed", "count"),
    [(1406, 4), *(pytest.param(*of, marks=pytest.mark.slow) for of in ((550, 10), (702, 24)))],
    ids=["1406", "550", "702"],
)
def test_more_of_them(seed: int, count: int, tmp_path: Path) -> None:
    problem = random_problem(seed)
    found = problem.solve(tmp_path)
    assert found.complete
    assert [(o.mu, o.growth_slope) for o in found.onsets if o.mu < 1e-3] == [(0.0, 0.0)] * count
    assert not disagreement(replace(problem, solve=lambda _: found), tmp_path)[0]


def test_a_divergence_that_ends_just_before_a_pair_begins(tmp_path: Path) -> None:
    """Both within 4e-6 of the range: one root more grows, of as many modes."""
    found = random_problem(986).solve(tmp_path)
    assert found.complete
    close = [o for o in found.onsets if 17.0 < o.mu < 17.1]
    assert [(o.kind, o.roots) for o in close] == [("divergence", -1), ("flutter", 2)]


def test_half_of_a_pair_that_comes_into_the_band_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A pair leaves the band, falls apart above it, and one half comes back faster than any mode moves; counted."""

    def unfollowed(*_: object, **__: object) -> None:
        raise FollowingError("not asked for")

    monkeypatch.setattr("stridor.modal.over_friction.onsets", unfollowed)
    problem = random_problem(1153)
    found = problem.solve(tmp_path)
    assert found.complete
    assert "1 leaves the band at μ ≈ 0.4136" in found.completeness
    assert "1 comes into the band at μ ≈ 0.4151 (0 Hz" in found.completeness
    assert not disagreement(replace(problem, solve=lambda _: found), tmp_path)[0]


def test_what_is_counted_at_both_ends_is_held_against_onsets_on_them() -> None:
    def onset(mu: float, *, stabilising: bool = False) -> Onset:
        return Onset(mu, 1.0, "flutter", False, stabilising, (0, 0), 0.0, None, None)

    seen = counted.Counted(((0.0, 0), (0.5, 4), (1.0, 2)), (), ())
    begins, ends = onset(0.0), onset(1.0, stabilising=True)
    assert not seen.lacking([begins, onset(1e-8), ends])
    assert [(k.low, k.high, k.seen, k.said) for k in seen.lacking([begins, ends])] == [(0.0, 0.5, 4, 2)]
    assert [(k.low, k.high, k.seen, k.said) for k in seen.lacking([begins, onset(0.25)])] == [(0.5, 1.0, -2, 0)]
    # One that ends at once, or begins at the very end, may or may not be counted there.
    for others in ([onset(0.0, stabilising=True)], [onset(1.0)], []):
        assert not seen.lacking([begins, onset(0.25), ends, *others])


@pytest.mark.slow
@pytest.mark.parametrize("first", range(FIRST, FIRST + MANY, 100))
def test_many(first: int, tmp_path: Path) -> None:
    wrong, said = judged(range(first, first + 100), tmp_path)
    assert not wrong, "\n".join(wrong)
    assert len(said) <= UNANSWERED * 100, "\n".join(said)


# Where nothing damps, friction that falls makes everything grow from no friction on: some of that is not answered whole.
FALLING, WHOLE = [0, 1], [2, 3, 4, 7, 8]
MORE_FALLING = [pytest.param(range(k, k + 20), marks=pytest.mark.slow) for k in range(9, 209, 20)]


@pytest.mark.parametrize(
    "seeds", [FALLING, pytest.param(WHOLE, marks=pytest.mark.slow), *MORE_FALLING], ids=lambda seeds: f"from {seeds[0]}"
)
def test_of_friction_that_falls_with_speed(seeds: Iterable[int], tmp_path: Path) -> None:
    """Against slopes, forces and eigenvalues by hand."""
    wrong, said = list[str](), list[str]()
    for seed in seeds:
        words, refused = disagreement(falling_problem(seed), tmp_path)
        wrong += [words] if words else []
        said += [refused] if refused else []
    assert not wrong, "\n".join(wrong)
    assert len(said) <= (3 if isinstance(seeds, range) else 0), "\n".join(said)


def along_the_axis(system: System, between: tuple[float, float], hz: float, *, damped: bool = True) -> Onsets:
    return full_onsets(
        lambda _: system, between, max_frequency_hz=hz, damped=damped, options=Options(), unfollowed="not asked for"
    )


AXIS, CHOSEN = [1, 16], [25, 32, 33, 48, 1832]
MORE = [pytest.param(range(k, k + 100), marks=pytest.mark.slow) for k in range(0, 2000, 100)]


@pytest.mark.parametrize(
    "seeds", [AXIS, pytest.param(CHOSEN, marks=pytest.mark.slow), *MORE], ids=lambda seeds: f"from {seeds[0]}"
)
def test_without_following_branches(seeds: Iterable[int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Contacts sought along the imaginary axis: the same truth."""
    monkeypatch.setattr(random_onsets, "onsets_of_band", along_the_axis)
    contacts = [seed for seed in seeds if KINDS[seed % len(KINDS)] in ("beams", "belt")]
    wrong, said = judged(contacts, tmp_path)
    assert not wrong, "\n".join(wrong)
    assert len(said) <= UNANSWERED * 100 * len(contacts) / 25, "\n".join(said)


def test_both_ways_lead_to_the_same_onsets(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    problem = random_problem(41)
    followed = problem.solve(tmp_path)
    monkeypatch.setattr(random_onsets, "onsets_of_band", along_the_axis)
    walked = random_problem(41).solve(tmp_path)
    assert len(followed.onsets) >= 3
    assert "sought along the imaginary axis" in walked.completeness
    np.testing.assert_allclose([o.mu for o in walked.onsets], [o.mu for o in followed.onsets], rtol=1e-9)
    np.testing.assert_allclose(
        [o.frequency_hz for o in walked.onsets], [o.frequency_hz for o in followed.onsets], rtol=1e-9
    )


def test_an_axis_that_is_not_walked_closely_is_noticed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An onset that the walk loses is missing in the count; the range is counted through instead."""
    monkeypatch.setattr(random_onsets, "onsets_of_band", along_the_axis)
    whole = random_problem(41).solve(tmp_path)
    crossed = _Walk._crossed

    def blind(self, one, other):
        return [c for c in crossed(self, one, other) if abs(c[1] - whole.onsets[0].mu) > 0.02]

    monkeypatch.setattr(_Walk, "_crossed", blind)
    again = random_problem(41).solve(tmp_path)
    assert again.complete
    assert "imaginary axis" not in again.completeness
    np.testing.assert_allclose([o.mu for o in again.onsets], [o.mu for o in whole.onsets], rtol=1e-9)


# One comes into the band beside an onset, while others grow above it; growth that may be rounding beside an onset.
@pytest.mark.slow  # in each run: the next one
@pytest.mark.parametrize("seed", [1568, 1934])
def test_the_truth_sees_each_onset_that_is_lost(seed: int, tmp_path: Path) -> None:
    problem = random_problem(seed)
    found = problem.solve(tmp_path)
    inside = [o for o in found.onsets if 2 * np.pi * o.frequency_hz <= problem.top]
    assert not disagreement(replace(problem, solve=lambda _: found), tmp_path)[0]
    assert len(inside) >= 6
    for lost in inside:
        others = replace(found, onsets=tuple(o for o in found.onsets if o is not lost))
        assert disagreement(replace(problem, solve=lambda _, others=others: others), tmp_path)[0]


def test_the_truth_tells_a_wrong_list(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With every third onset lost on the way and no count held against them the comparison must see it."""
    monkeypatch.setattr(search, "_borne_out", lambda *_: None)
    monkeypatch.setattr(branches, "_agree", lambda *_: True)
    solved = search.solved

    def losing(*given):
        found, way, _ = solved(*given)
        return found[::3], way, True

    monkeypatch.setattr(search, "solved", losing)
    monkeypatch.setattr(counted.Counted, "lacking", lambda *_: [])
    wrong, _ = judged(range(2, 42, 8), tmp_path, small=True)
    assert wrong

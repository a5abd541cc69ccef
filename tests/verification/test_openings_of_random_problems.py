"""Growth that opens at the low end in random problems: no list of onsets that is said to be complete may be wrong."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest

import stridor as st
from random_openings import random_opening, rate, wrong

pytestmark = pytest.mark.verification

HEAVY = (0, 6, 12, 13, 15, 22, 29)  # take as long as all others: weekly
EACH, SMALL = [k for k in range(36) if k not in HEAVY], 3  # of few modes; in each run some of them
UNANSWERED = 0.25  # share at most that is refused: much of what is tried is next to rounding
LATER = (1e-3, 2e-3)  # of the range: where growth that opens with the slope zero is looked at,
EARLIER = (0.1, 0.2)  # or of the way to where growth is told to end, if that is less


def judged(seeds: Iterable[int], folder: Path, most: int) -> tuple[list[str], int, int]:
    """What is wrong, how many are refused, and how many onsets open with the slope zero."""
    errors, refused, opened = list[str](), 0, 0
    for seed in seeds:
        problem = random_opening(seed, most)
        try:
            found = st.onsets(problem.case(folder))
        except st.AnalysisError:
            refused += 1
            continue
        refused += not found.complete
        said = wrong(problem, found)
        for onset in found.onsets if found.complete else ():
            if onset.growth_slope == 0.0:
                opened += 1
                omega, width = 2 * np.pi * onset.frequency_hz, problem.high - problem.low
                ends = min((o.mu - problem.low for o in found.onsets if o.stabilising), default=width)
                steps = [min(part * width, early * ends) for part, early in zip(LATER, EARLIER, strict=True)]
                rates = [rate(problem, problem.low + step, omega) for step in steps]
                if not (onset.mu == problem.low and min(rates) > 0):
                    said += f"; growth at {omega} does not open at {onset.mu}: {rates}"
        errors += [f"{seed}: {said}"] if said else []
    return errors, refused, opened


@pytest.mark.skipif(bool(np.finfo(np.longdouble).eps > 1e-18), reason="growth is looked at in extended precision")
@pytest.mark.parametrize(
    ("seeds", "least"), [([2, 3, 14, 21, 27, 34], 6), pytest.param(EACH, 6, marks=pytest.mark.slow)], ids=["few", "all"]
)
def test_some(seeds: list[int], least: int, tmp_path: Path) -> None:
    errors, refused, opened = judged(seeds, tmp_path, SMALL)
    assert not errors, "\n".join(errors)
    assert refused <= UNANSWERED * len(seeds)
    assert opened >= least


@pytest.mark.slow
@pytest.mark.skipif(bool(np.finfo(np.longdouble).eps > 1e-18), reason="growth is looked at in extended precision")
@pytest.mark.parametrize("first", range(0, 3000, 100))
def test_many(first: int, tmp_path: Path) -> None:
    errors, refused, _ = judged(range(first, first + 100), tmp_path, 8)
    assert not errors, "\n".join(errors)
    assert refused <= UNANSWERED * 100

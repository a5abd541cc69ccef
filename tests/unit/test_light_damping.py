"""Damping that is all but none: growth begins where it is gone, not where modes are counted as on the axis."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import stridor as st
from matrix_cases import matrix_case
from stridor.modal.full.counted import Counted
from stridor.modal.onset import Onset

UNIT = np.eye(2)


def test_damping_that_is_all_but_none_puts_growth_off(tmp_path: Path) -> None:
    """2e-8 − 2e-6 μ: the modes decay by 1e-8 of their frequency at μ = 0, and grow from μ = 0.01 on."""
    terms = [
        (UNIT, "mass", ""), (np.diag([1.0, 4.0]), "stiffness", ""),
        (2e-8 * UNIT, "damping", ""), (-2e-6 * UNIT, "damping", "mu"),
    ]  # fmt: skip
    found = st.onsets(matrix_case(tmp_path, terms, 1.0, (0.0, 0.5)))
    assert found.complete, found.completeness
    np.testing.assert_allclose([onset.mu for onset in found.onsets], [0.01] * 2, rtol=1e-9)


def test_growth_too_slow_to_be_seen_is_no_lack_beside_its_onset_and_is_one_farther_off() -> None:
    """Re λ = 1e-6 (μ − 0.01): above 1e-9 of |λ| = 1 from μ = 0.011 on."""
    onset = Onset(0.01, 1 / (2 * np.pi), "flutter", True, False, (1, 2), 0.0, None, 1e-6)
    grid = ((0.0, 0), (0.0105, 0), (0.0119, 2), (0.013, 2), (0.5, 2))
    assert Counted(grid, (), ()).lacking([onset]) == []
    late = ((0.0, 0), (0.013, 0), (0.5, 2))
    assert [(lack.low, lack.high) for lack in Counted(late, (), ()).lacking([onset])] == [(0.0, 0.013), (0.013, 0.5)]

"""Growth that opens at the low end of the range, of modes that nothing damps there."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import stridor as st
from matrix_cases import matrix_case

TURN = np.array([[0.0, 1.0], [-1.0, 0.0]])


def circulatory(g: float, size: int = 2) -> list[tuple[np.ndarray, str, str]]:
    """ω = 1, 2 and so on; μ (1 + gλ) turns the first two."""
    turn = np.zeros((size, size))
    turn[:2, :2] = TURN
    return [
        (np.eye(size), "mass", ""), (np.diag(np.arange(1.0, size + 1) ** 2), "stiffness", ""),
        (turn, "stiffness", "mu"), (g * turn, "damping", "mu"),
    ]  # fmt: skip


def test_a_mode_whose_growth_has_no_slope_where_another_is_damped(tmp_path: Path) -> None:
    """Its growth rate is zero at μ = 0, and the slope of that exactly."""
    terms = [*circulatory(0.3, 3), (np.diag([0.0, 0.0, 0.1]), "damping", "")]
    found = st.onsets(matrix_case(tmp_path, terms, 1.0, (0.0, 0.5)))
    (onset,) = found.onsets
    assert onset.mu == pytest.approx(0.0, abs=1e-5)
    assert 2 * np.pi * onset.frequency_hz == pytest.approx(2.0, rel=1e-9)

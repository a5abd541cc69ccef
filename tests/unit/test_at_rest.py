"""How many motions as a whole eigenvalues near zero stand for, by hand."""

from __future__ import annotations

import numpy as np
import pytest

from stridor.modal.at_rest import double_zeros, more_slow
from stridor.modal.quadratic import Quadratic


@pytest.mark.parametrize(
    ("values", "motions"),
    [
        ([], 0),
        ([-1, 1], 1),  # ±ε
        ([1j], 1),  # ±jε, one of which is left unsaid
        ([1j, -1j], 1),
        ([1j, -2, 2], 2),
        ([-1, 1, 2, 2, -3 - 1e-11j, 3 - 1e-11j], 3),  # real but for rounding, on the other side of it
        ([1 + 1e-11j, 1 - 1e-11j, -1], 2),
    ],
)
def test_double_zeros(values: list[complex], motions: int) -> None:
    assert double_zeros(1e-9 * np.array(values, dtype=complex)) == motions


def test_more_slow_modes_than_motions_without_stiffness() -> None:
    """Two masses, one of them free: one double zero, and what is slow beside it has to be told."""
    problem = Quadratic(np.eye(2), np.zeros((2, 2)), np.diag([1.0, 0.0]))
    for values, more in (([], False), ([1e-9j], False), ([-1e-9, 1e-9], False), ([1e-9j, 2e-9j], True)):
        assert more_slow(problem, np.array(values, dtype=complex), 2.0) is more

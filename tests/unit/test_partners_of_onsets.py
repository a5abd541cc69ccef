"""Which mode an onset tells beside the one that grows: the one that it met, whatever lies between them."""

from __future__ import annotations

import numpy as np
import pytest

from stridor.modal.meeting import partner_of

METS, MU = 0.28, 0.2854


def two_that_met(mu: float, third: complex) -> tuple[np.ndarray, np.ndarray]:
    """Two modes that met at METS, the first of which grows, and one that friction does nothing to: λ and dλ/dμ."""
    half = 1e5 * np.sqrt(mu - METS + 1e-6j)
    middle = -40.0 + 53000j + 2000j * (mu - METS)
    slope = 0.5e10 / half
    return np.array([middle + half, middle - half, third]), np.array([2000j + slope, 2000j - slope, 0j])


@pytest.mark.parametrize("third", [-40 + 53000j, -35 + 53200j, 3000 + 53100j, -40 + 60000j])
@pytest.mark.parametrize("mu", [0.2801, MU])
def test_one_that_lies_between_two_that_met_is_no_partner(mu: float, third: complex):
    values, slopes = two_that_met(mu, third)
    assert partner_of(values, slopes, 0, mu) == 1
    assert partner_of(values, slopes, 1, mu) == 0


def test_without_a_meeting_it_is_the_nearest():
    values, slopes = np.array([-1 + 1000j, -2 + 1100j, -3 + 700j]), np.array([10 + 5j, 1 + 4j, 2 + 3j])
    assert partner_of(values, slopes, 0, 0.3) == 1
    assert partner_of(values, np.array([np.nan + 0j, 1.0, 1.0]), 0, 0.3) == 1


def test_one_whose_conjugate_is_nearer_than_any_other_has_none():
    assert partner_of(np.array([1 + 3j, -2 + 1100j]), np.array([10 + 5j, 1 + 0j]), 0, 0.3) == 0

"""Which of two modes is which beyond a meeting: λ = a ± √(b) with b known in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from stridor.modal.meeting import Beyond, beyond

pytestmark = pytest.mark.verification

CENTRE, OPENS = -30.0 + 5e4j, 1e6


def pair(mu: float, zero: complex, sign: int = 1, bend: complex = 0.0) -> tuple[complex, complex]:
    """Both eigenvalues where b = OPENS · sign · (μ − zero)(1 + bend μ), the principal root first."""
    root = np.sqrt(complex(OPENS * sign * (mu - zero) * (1 + bend * mu)))
    return CENTRE + root, CENTRE - root


def slopes(mu: float, zero: complex, values: tuple[complex, complex], sign: int = 1, bend: complex = 0.0):
    by_mu = OPENS * sign * ((1 + bend * mu) + bend * (mu - zero))
    return tuple(by_mu / (2 * (v - CENTRE)) for v in values)


def asked(low: float, high: float, zero: complex, *, turned: tuple[bool, bool], sign: int = 1, bend: complex = 0.0):
    ends = [pair(mu, zero, sign, bend) for mu in (low, high)]
    ends = [e[::-1] if t else e for e, t in zip(ends, turned, strict=True)]
    by_mu = [slopes(mu, zero, e, sign, bend) for mu, e in zip((low, high), ends, strict=True)]
    return beyond(ends[0], by_mu[0], ends[1], by_mu[1], high - low)


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("aside", [0.0, 3e-7j, -3e-7j])
def test_where_they_meet_the_first_grows(aside, turned):
    """The principal root, of positive real part, has to be the first beyond: the other way round is exchanged."""
    for before in (False, True):
        told = asked(0.29995, 0.30004, 0.3 + aside, turned=(before, turned), bend=0.2 + 0.1j)
        assert told == Beyond(exchanged=turned, sure=True)


@pytest.mark.parametrize("turned", [False, True])
def test_where_they_part_the_first_has_the_higher_frequency(turned):
    told = asked(0.29995, 0.30004, 0.3, turned=(False, turned), sign=-1)
    ends = pair(0.30004, 0.3, -1)
    first = ends[1] if turned else ends[0]
    assert told == Beyond(exchanged=bool(first.imag < CENTRE.imag), sure=True)


@pytest.mark.parametrize("low", [0.3, 0.3 - 2e-7, 0.3 + 2e-7])
@pytest.mark.parametrize("turned", [False, True])
def test_a_step_that_begins_where_they_meet(low, turned):
    """A sweep may well have the critical μ among its values: what the names are there is nobody's business."""
    for before in (False, True):
        told = asked(low, 0.30008, 0.3 + 1e-8j, turned=(before, turned))
        assert told == Beyond(exchanged=turned, sure=True)


@pytest.mark.parametrize("beside", [1e-10, 1e-9, 3e-9])
@pytest.mark.parametrize("first", [True, False])
def test_one_that_meets_its_own_conjugate_exchanges_no_name(beside, first):
    """It falls apart on the real axis with a slope that knows no bounds, and the other passes by as if nothing were."""
    apart, middle, rate = 7e9, 10861.0 + 0j, -2e4 + 3e4j
    mus = np.array([0.3 - beside, 0.3 + 1e-9])
    mine = middle + np.sqrt(apart * (mus - 0.3) + 0j)
    other = 6917.0 + 9575j + rate * (mus - 0.3)
    values = [(m, o) if first else (o, m) for m, o in zip(mine, other, strict=True)]
    by_mu = [(apart / (2 * (m - middle)), rate) if first else (rate, apart / (2 * (m - middle))) for m in mine]
    assert beyond(values[0], by_mu[0], values[1], by_mu[1], float(mus[1] - mus[0])) is None


@pytest.mark.parametrize("zero", [0.3 + 2e-3j, 0.3 - 2e-3j, 0.3 + 5e-4j])
@pytest.mark.parametrize("bend", [0.0, 0.4 - 0.3j])
def test_beside_a_meeting_names_go_along_the_real_axis(zero, bend):
    """The truth: the root followed in ten thousand steps."""
    low, high = 0.297, 0.304
    start = pair(low, zero, bend=bend)
    followed = start[0]
    for mu in np.linspace(low, high, 10_001)[1:]:
        followed = min(pair(mu, zero, bend=bend), key=lambda v: abs(v - followed))
    end = pair(high, zero, bend=bend)
    told = asked(low, high, zero, turned=(False, False), bend=bend)
    assert told is not None
    assert told.sure
    assert told.exchanged == (followed != end[0])


def test_a_long_step_beside_a_near_meeting_is_not_enough():
    assert asked(0.29, 0.31, 0.3 + 1e-6j, turned=(False, False)) == Beyond(exchanged=False, sure=False)


def test_modes_that_only_come_nearer_are_none_of_its_business():
    assert asked(0.25, 0.29, 0.3, turned=(False, False)) is None
    assert asked(0.31, 0.35, 0.3, turned=(False, True)) is None

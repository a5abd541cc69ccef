"""What counts as growth: one decision for everything that counts modes or roots of matrices of any structure."""

from __future__ import annotations

import numpy as np

from ...typing import BoolArray, ComplexArray
from ..at_rest import moving, told_growth
from ..results import off_rounding
from ..tolerances import SPLIT_RELATIVE, UNSTABLE_RELATIVE
from .family import Family


def unstable(family: Family, values: ComplexArray, top: float, still: float = 0.0) -> BoolArray:
    """Which grow beyond rounding (k,); motions as a whole do not count, nor what is no faster than ``still`` of the
    highest frequency top [1/s]."""
    rounding = SPLIT_RELATIVE if family.reversible else UNSTABLE_RELATIVE
    grows = (values.real > told_growth(values, rounding, top)) & (np.abs(values) > still * top)
    grows[grows] = moving(values[grows], top, lambda: family.rest_limit(top))
    return grows


def without_rounding(family: Family, values: ComplexArray, top: float) -> ComplexArray:
    """Eigenvalues (k,) up to top [1/s] as they are told: of a reversible problem, with every λ there is −λ̄, so that a
    real part without a partner is rounding; motions as a whole do not grow."""
    found = off_rounding(values, SPLIT_RELATIVE) if family.reversible else values
    rests = ~moving(found, top, lambda: family.rest_limit(top))
    return np.where(rests & (found.real > 0.0), 1j * found.imag, found)


def growing_roots(values: ComplexArray) -> int:
    """How many roots grow, of which a flutter pair is two and a motion that diverges one: a pair that meets on the real
    axis and parts there is no onset."""
    return int(np.sum(np.where(values.imag > 0, 2, 1)))

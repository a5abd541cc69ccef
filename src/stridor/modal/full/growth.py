"""What counts as growth: one decision for everything that counts modes or roots of matrices of any structure."""

from __future__ import annotations

import numpy as np

from ...typing import BoolArray, ComplexArray
from ..results import off_rounding
from ..tolerances import AT_REST, SPLIT_RELATIVE, UNSTABLE_RELATIVE
from .family import Family


def unstable(family: Family, values: ComplexArray, top: float, still: float = AT_REST) -> BoolArray:
    """Which grow beyond rounding (k,); motions as a whole, up to ``still`` of the highest frequency top [1/s], do not
    count."""
    rounding = SPLIT_RELATIVE if family.reversible else UNSTABLE_RELATIVE
    return (values.real > rounding * np.abs(values)) & (np.abs(values) > still * top)


def without_rounding(family: Family, values: ComplexArray) -> ComplexArray:
    """Eigenvalues (k,) as they are told: of a reversible problem, with every λ there is −λ̄, so that a real part without
    a partner is rounding."""
    return off_rounding(values, SPLIT_RELATIVE) if family.reversible else values


def growing_roots(values: ComplexArray) -> int:
    """How many roots grow, of which a flutter pair is two and a motion that diverges one: a pair that meets on the real
    axis and parts there is no onset."""
    return int(np.sum(np.where(values.imag > 0, 2, 1)))

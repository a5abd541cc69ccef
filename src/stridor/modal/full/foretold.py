"""What eigenvalues and their slopes at one value of μ say of a step on: whether something begins or ceases to grow."""

from __future__ import annotations

import numpy as np

from ...typing import ComplexArray, IntArray
from ..dense_problem import Eigenpairs, upper_root
from ..tolerances import UNSTABLE_RELATIVE
from .family import Family
from .growth import unstable

TOGETHER = 0.25  # of the square of half the difference of two modes: what is left of it where they come together
SLOWEST = 1e-8  # of the highest frequency: growth slower than that is rounding


def changes_within(family: Family, found: Eigenpairs, step: float, top: float) -> bool:
    """Whether within a step a mode up to |λ| = top [1/s] would begin or cease to grow if it were straight, or two that
    come together, one and its conjugate too, if their mean and the square of half their difference were, which are
    smooth where they meet: what little or nothing damps stays beside the axis until then, and its own slope tells
    nothing of it."""
    one, other = _pairs(family, found, top)
    half, turn = (one - other) / 2
    square, change = half * half, 2 * half * turn
    # How near to zero the square comes within the step.
    with np.errstate(all="ignore"):
        part = -np.real(square * change.conj()) / np.abs(change) ** 2 / step
    nearest = square + np.clip(np.nan_to_num(part), 0.0, 1.0) * step * change
    together = np.abs(nearest) <= TOGETHER * np.abs(square)
    return bool(np.any(together & (_roots(family, one, other, step, top) != _roots(family, one, other, 0.0, top))))


def _pairs(family: Family, found: Eigenpairs, top: float) -> tuple[ComplexArray, ComplexArray]:
    """Coordinates and slopes (2, k) of modes that may meet, of which one at least is in the band: every mode with
    itself, with its conjugate and with others; λ² that are real with their neighbours alone."""
    squares = family.reversible
    size = np.abs(found.values)
    known = np.flatnonzero(np.isfinite(found.tangents) & (size > SLOWEST * top))
    inside = known[size[known] <= top]
    both = np.array([found.coordinate, found.tangents])
    alone, axis = inside, both[0].imag == 0
    if squares:
        real = known[axis[known]]
        real = real[np.argsort(both[0, real].real)]
        one, other = real[:-1], real[1:]
    else:
        # One that is on the axis leaves it to either side; two may still meet there.
        alone = inside[np.abs(found.values[inside].real) > UNSTABLE_RELATIVE * size[inside]]
        one, other = (known[k] for k in np.triu_indices(len(known), 1))
    near = np.minimum(size[one], size[other]) <= top
    turned = inside[~axis[inside]]
    first = np.concatenate([alone, turned, one[near]])
    second = np.hstack([both[:, alone], both[:, turned].conj(), both[:, other[near]]])
    return both[:, first], second


def _roots(family: Family, one: ComplexArray, other: ComplexArray, step: float, top: float) -> IntArray:
    """How many roots (k,) of pairs of coordinates and their slopes (2, k) grow a step on."""
    half, turn = (one - other) / 2
    mean = (one[0] + other[0] + step * (one[1] + other[1])) / 2
    apart = np.sqrt(half * (half + 2 * step * turn))
    ahead: ComplexArray = np.array([mean + apart, mean - apart])
    values = upper_root(ahead) if family.reversible else ahead
    grows = unstable(family, values, top, SLOWEST)
    roots: IntArray = np.sum(np.where(grows, np.where(values.imag != 0, 2, 1), 0), axis=0)
    return roots

"""Modes that nothing damps, of systems that are damped elsewhere.

They stay on the imaginary axis until two of them meet, or one comes to rest; beyond that one grows as the other decays.
A meeting is a double root, and is seen and solved as one over λ², whose squared half difference goes through zero with
a finite slope: of λ itself rounding decides there on which side of the axis it lies.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...typing import Array, BoolArray, ComplexArray
from ..dense_problem import Eigenpairs, OverNumber
from ..tolerances import SPLIT_RELATIVE, UNSTABLE_RELATIVE
from .follow import BranchState

COMPLEX = 1e-9  # imaginary part of λ² over the band's that is more than rounding
MIRRORED = 1e-3  # of the growth of one: by how much the decay of the other may differ for the two to be undamped


@dataclass(frozen=True)
class Squares:
    """Branches (b,) at one μ by λ²: coordinate (b,), tangents dλ²/dμ (b,), and the state they are of."""

    state: BranchState
    coordinate: ComplexArray
    tangents: ComplexArray

    @property
    def mu(self) -> float:
        """The friction coefficient."""
        return self.state.mu


def squares_of(source: OverNumber, found: Eigenpairs) -> tuple[ComplexArray, ComplexArray]:
    """λ² (k,) of eigenpairs at one μ, and its tangents (k,)."""
    if not source.damped:
        return found.coordinate, found.tangents
    return found.values**2, 2 * found.values * found.tangents


def squared(source: OverNumber, state: BranchState) -> Squares:
    """The branches of a state by λ²."""
    x, tangents = squares_of(source, state.found)
    return Squares(state, x[state.index], tangents[state.index])


def rounding(values: ComplexArray) -> Array:
    """Growth rates (k,) [1/s] of eigenvalues λ (k,) that are no growth: UNSTABLE_RELATIVE of |λ|, and more the nearer
    another is, as two that meet on the axis part as a square root."""
    size = np.abs(values)
    apart = np.abs(values[:, None] - values)
    np.fill_diagonal(apart, np.inf)
    apart = np.minimum(apart.min(axis=1, initial=np.inf), 2 * np.abs(values.imag))
    with np.errstate(divide="ignore"):
        beside = np.minimum(SPLIT_RELATIVE * size, SPLIT_RELATIVE**2 * size**2 / np.maximum(apart, 1e-300))
    return np.maximum(UNSTABLE_RELATIVE * size, beside)


def on_axis(source: OverNumber, state: BranchState) -> BoolArray:
    """Which branches (b,) neither grow nor decay beyond rounding, or are at rest but for it."""
    values = state.values
    result = np.abs(values.real) <= rounding(values)
    still = ~result & (values.imag == 0.0) & (np.abs(values) ** 2 <= COMPLEX * source.frequency**2)
    for i in np.flatnonzero(still):
        result[i] = _falls_apart(state, complex(values[i]))
    return result


def mirrored(one: complex, other: complex) -> bool:
    """Whether the one grows as the other decays, at the same frequency."""
    return abs(one + other.conjugate()) <= MIRRORED * abs(one.real)


def _falls_apart(state: BranchState, lam: complex) -> bool:
    """Whether a real eigenvalue λ has come with −λ out of rest."""
    real = state.found.values[state.found.values.imag == 0.0]
    return bool(np.any(np.abs(real + lam) <= MIRRORED * abs(lam)))


def undamped(source: OverNumber, old: BranchState, new: BranchState) -> BoolArray:
    """Which branches (b,) nothing damps, as far as two neighbouring states show: they are on the axis at both, or at
    one, and at the other mirrored in it by another that was there as well."""
    was, now = on_axis(source, old), on_axis(source, new)
    result = was & now
    for there, here, state in ((was, now, new), (now, was, old)):
        for i in np.flatnonzero(there & ~here):
            lam = complex(state.values[i])
            if lam.imag == 0.0:
                result[i] = _falls_apart(state, lam)
                continue
            j = int(np.argmin(np.abs(state.values + lam.conjugate())))
            result[i] = j != i and there[j] and mirrored(lam, complex(state.values[j]))
    return result

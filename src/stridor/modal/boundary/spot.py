"""One point of a curve of critical values, solved along a straight line by Newton's method.

At it an eigenvalue is on the imaginary axis, λ(x, y) = jω. With right and left vectors z and w

    ∂λ/∂d = − wᵀ P_d z / wᵀ P_λ z

in any direction d: the real part gives the curve's normal, on whose side growth lies, the imaginary part how ω goes
along. Where two undamped modes meet, or one comes to rest, wᵀ P_λ z is zero; λ − λ_c = ± κ √a opens with the square
root of the way a there, κ² is proportional to wᵀ P_d z, and its gradient takes the place of that of Re λ.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from ...errors import AnalysisError, CaseError
from ...typing import Array, ComplexArray
from ..full.passages import quiet
from ..newton import Root, crossing, meeting, standstill
from .plane import Chord, Plane

Kind = Literal["crossing", "meeting", "standstill"]


@dataclass(frozen=True)
class CurvePoint:
    """A point p (2,) of a curve: gradient (2,) of the growth there, ω [1/s] and its gradient (2,), right and left
    vectors (r,), backward error in the matrices that it was solved in."""

    kind: Kind
    p: Array
    gradient: Array
    omega: float
    turn: Array
    right: ComplexArray
    left: ComplexArray
    residual: float

    @property
    def tangent(self) -> Array:
        """The curve's direction (2,), of unit length, growth on its left."""
        return np.array([self.gradient[1], -self.gradient[0]]) / np.hypot(*self.gradient)


def point_on(
    plane: Plane, kind: Kind, chord: Chord, omega: float, right: ComplexArray, left: ComplexArray
) -> CurvePoint | None:
    """The point of a curve on a chord, from a guess at its a = 0; None where Newton's method does not settle on it."""
    between = chord.low, chord.high
    try:
        with quiet(), np.errstate(all="ignore"):
            root = _root(kind, chord, omega, right, left, between)
            if root is None or not between[0] <= root.mu <= between[1]:
                return None
            return _spot(plane, kind, chord, root)
    except (AnalysisError, CaseError, ValueError, np.linalg.LinAlgError):  # a formula may end outside the rectangle
        return None


def _root(
    kind: Kind, chord: Chord, omega: float, right: ComplexArray, left: ComplexArray, between: tuple[float, float]
) -> Root | None:
    if kind == "standstill":
        return standstill(chord, 0.0, right, left, between)
    solve = crossing if kind == "crossing" else meeting
    return solve(chord, 0.0, 1j * omega, right, left, between)


def _spot(plane: Plane, kind: Kind, chord: Chord, root: Root) -> CurvePoint | None:
    p, lam, z, w = chord.point(root.mu), root.lam, root.vector, root.left
    moved = np.zeros(2, dtype=complex)
    for axis, direction in enumerate(np.eye(2)):
        mass, damping, stiffness = plane.changes(p, direction)
        moved[axis] = w @ (lam**2 * (mass @ z) + lam * (damping @ z) + stiffness @ z)
    if kind == "crossing":
        mass, damping, _ = plane.matrices(p)
        rates = -moved / (w @ (2 * lam * (mass @ z) + damping @ z))
        gradient, turn = rates.real, rates.imag
    else:
        opening = root.slope if root.square is None else root.square
        gradient, turn = (opening or 0.0) * (moved / (moved @ chord.direction)).real, np.zeros(2)
    if not np.all(np.isfinite(gradient)) or not np.any(gradient):
        return None
    right, left = z / np.linalg.norm(z), w / np.linalg.norm(w)
    return CurvePoint(kind, p, gradient, abs(lam.imag), turn * np.sign(lam.imag or 1.0), right, left, root.residual)

"""Between points at which all modes were solved for: up the growth of a mode to where it begins to grow, or to its top.

A mode that decays at a point and at its neighbours may grow between them, on an island that no line cuts. Where its
rate Re λ(x, y) rises steadily to none of the neighbours, it has a top nearer than these. That is climbed by a
quasi-Newton method on the exact gradient (BFGS, J. Nocedal and S. J. Wright, Numerical Optimization, Springer 2006)
until the mode grows, or its rate foretells that it will not.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ...errors import AnalysisError
from ...typing import Array, ComplexArray
from ..tolerances import UNSTABLE_RELATIVE
from .plane import Plane

STEPS = 12  # of one climb at most
BEYOND = 1.3  # times the way on which growth would begin if the rate went on as it does
NEIGHBOUR = 1.6  # meshes: the diagonal of a cell, and a little
UPHILL = 0.7  # cosine of the angle to the gradient: up to 45°, which one of eight neighbours always keeps
FLAT = 1e-3  # of the rate: what its slope changes it by over a mesh where there is nothing to climb
HOPE = 4.0  # times what is foretold to be left to the top: less than that and it ends below zero
SHORT = 0.02  # of the mesh: no shorter step


@dataclass(frozen=True)
class ModesAtPoint:
    """A point p (2,) with the modes there: λ (k,) and ∇λ (2, k)."""

    p: Array
    values: ComplexArray
    slopes: ComplexArray

    @classmethod
    def at(cls, plane: Plane, p: Array) -> ModesAtPoint:
        """By one solve. Raises AnalysisError where the matrices are singular."""
        found = plane.modes(p)
        return cls(p, found.values, plane.slopes(p, found))

    def follow(self, k: int, other: ModesAtPoint) -> int | None:
        """Number of mode k at another point: the nearest to where both slopes lead, None where there is none."""
        way = other.p - self.p
        off = np.abs(other.values - self.values[k] - 0.5 * (way @ self.slopes[:, k] + way @ other.slopes))
        known = np.flatnonzero(np.isfinite(off))
        return int(known[np.argmin(off[known])]) if len(known) else None

    def rises_to(self, k: int, other: ModesAtPoint) -> bool:
        """Whether the rate of mode k rises to another point uphill: over all of the way, and at both of its ends."""
        j, way, up = self.follow(k, other), other.p - self.p, self.slopes[:, k].real
        if j is None or other.values[j].real <= self.values[k].real:
            return False
        uphill = float(way @ up) >= UPHILL * float(np.hypot(*way) * np.hypot(*up))
        return uphill and float(way @ other.slopes[:, j].real) > 0.0


def tops(plane: Plane, seen: Sequence[ModesAtPoint], mesh: float) -> Iterator[tuple[ModesAtPoint, int]]:
    """Points and numbers of modes that decay there, and whose rate rises all the way to no neighbour; the least damped
    first."""
    found: list[tuple[float, int, int]] = []
    for number, here in enumerate(seen):
        near = [other for other in seen if other is not here and np.hypot(*(other.p - here.p)) <= NEIGHBOUR * mesh]
        steep = np.hypot(*here.slopes.real) * mesh
        moves = plane.moving(here.values).tolist()
        for k, lam in enumerate(here.values.tolist()):
            decays = lam.real < -UNSTABLE_RELATIVE * abs(lam) and moves[k]
            if decays and steep[k] > FLAT * abs(lam.real) and not any(here.rises_to(k, other) for other in near):
                found.append((-lam.real / abs(lam), number, k))
    for _, number, k in sorted(found):
        yield seen[number], k


def climb(plane: Plane, here: ModesAtPoint, k: int, mesh: float) -> Array | None:
    """Where (2,) a mode grows that decays at a point, within some steps uphill; None where its top is lower, beyond the
    edge of the rectangle, or not found."""
    reach, inverse = 0.5 * mesh, None
    for _ in range(STEPS):
        rate, up = here.values[k].real, here.slopes[:, k].real
        steep = float(np.hypot(*up))
        if not steep * mesh > FLAT * abs(rate):
            return None
        step = max(BEYOND * abs(rate) / steep, SHORT * mesh) * (up / steep)
        if inverse is not None:
            step = inverse @ up
            if rate + HOPE * 0.5 * float(up @ step) < 0.0:
                return None
        length = float(np.hypot(*step))
        if not length <= reach:
            step = reach / length * step
        p = here.p + step
        if not np.all((p > 0.0) & (p < 1.0)):
            return None  # lines on the edges have been searched; a bend may be no number
        try:
            new = ModesAtPoint.at(plane, p)
        except AnalysisError:
            return None
        j = here.follow(k, new)
        if j is None:
            return None
        if new.values[j].real > UNSTABLE_RELATIVE * abs(new.values[j]):
            return p
        inverse, bent = _updated(inverse, step, up - new.slopes[:, j].real)
        if new.values[j].real <= rate:
            reach = 0.5 * float(np.hypot(*step))
            if reach < SHORT * mesh:
                return None
            continue
        if not bent:
            reach = min(2.0 * reach, mesh)
        here, k = new, j
    return None


def _updated(inverse: Array | None, step: Array, change: Array) -> tuple[Array | None, bool]:
    """The inverse (2, 2) of how the slope falls off, after a step (2,) on which it fell by a change (2,); whether it
    fell at all along the step. Where it rose nothing is known of the top."""
    along = float(step @ change)
    if not along > 1e-12 * float(np.hypot(*step) * np.hypot(*change)):
        return None, False
    if inverse is None:
        inverse = along / float(change @ change) * np.eye(2)
    turn = np.eye(2) - np.outer(step, change) / along
    return np.asarray(turn @ inverse @ turn.T + np.outer(step, step) / along), True

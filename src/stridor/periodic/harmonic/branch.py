"""Branches of cycles by harmonic balance, as they are followed over μ.

Unknown are X = (z/A, ω/ω₀, μ/W), with A the amplitude and ω₀ the frequency where a step begins, W the width of the
range: the balance, ∂z₀/∂τ · (z − z₀) = 0, tᵀ(X − X₀) = 0.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg as sl

from ...direct.dense import lu_factors
from ...errors import AnalysisError
from ...typing import Array
from ..continuation import BranchPoint
from .balance import Evaluated, evaluated
from .balanced import CLOSED, ENOUGH, Balanced, balanced, defect
from .same import same_cycle

CORRECTIONS = 16
STEP = 0.3  # longest of Newton's method, in X
FINER = 1.5  # times the harmonics, where the defect asks for more
MOST_UNKNOWN = 2400
SMALL = 0.02  # of the amplitude at which contacts first change: a cycle of steady sliding


class HarmonicBranch:
    """A branch within a range (low, high) of μ. tolerance: of the `defect`, beyond which harmonics are added up to
    ``most``; small: amplitude [N] of what is no cycle any more."""

    def __init__(
        self, between: tuple[float, float], *, tolerance: float = 0.0, most: int = 0, small: float = 0.0
    ) -> None:
        self.between, self.width = between, between[1] - between[0]
        self.tolerance, self.most, self.small = tolerance, most, small
        self._factors: tuple[Balanced, tuple[Array, Array], Array] | None = None

    def ahead(self, spot: BranchPoint[Balanced], length: float) -> Balanced:
        """A guess, a length along the branch."""
        at = spot.point.at
        moved = length * spot.heading * self._scale(at)
        z = at.z + moved[:-2].reshape(at.z.shape)
        return Balanced(evaluated(at.family, z, at.omega + moved[-2], at.mu + moved[-1], at.scales))

    def corrected(self, guess: Balanced, heading: Array) -> Balanced:
        """The cycle in the plane through a guess across a heading (r l + 2,). Raises AnalysisError where Newton's
        method finds none."""
        at, scale = guess.at, self._scale(guess.at)
        origin = _vector(at) / scale
        phase = _phase(at)
        here, factors = at, None
        for _ in range(CORRECTIONS):
            if here.residual <= CLOSED:
                break
            factors = self._factorised(here, scale, phase, heading)
            x = _vector(here) / scale
            aside = float(phase @ (here.z - at.z).ravel())
            rest = np.append(here.left.ravel(), [aside, float(heading @ (x - origin))])
            step = sl.lu_solve(factors, -rest)
            size = float(np.linalg.norm(step))
            if not np.isfinite(size):
                raise AnalysisError("Newton's method has no direction")
            found = self._moved(here, x, step * min(1.0, STEP / max(size, 1e-300)), scale)
            if found is None:
                break
            here = found
        if not here.residual <= ENOUGH:
            raise AnalysisError(f"Newton's method ends {here.residual:.2g} of the amplitude off a balance")
        found = Balanced(here)
        if factors is not None:
            self._factors = found, factors, scale
        return found

    def _moved(self, here: Evaluated, x: Array, step: Array, scale: Array) -> Evaluated | None:
        """The balance behind a step, so short that it comes closer; None where it ends."""
        before = float(np.linalg.norm(here.left))
        tries: list[Evaluated] = []
        for share in (1.0, 0.5, 0.25, 0.1):
            unknowns = (x + share * step) * scale
            omega, mu = float(unknowns[-2]), float(unknowns[-1])
            low, high = self.between[0] - self.width, self.between[1] + self.width
            if omega <= 0.2 * here.omega or not low <= mu <= high or mu < 0.0:
                continue
            tried = evaluated(here.family, unknowns[:-2].reshape(here.z.shape), omega, mu, here.scales)
            left = float(np.linalg.norm(tried.left))
            if left < before:
                return tried
            tries.append(tried)
        if not tries:
            raise AnalysisError("Newton's method leaves the range")
        # Where rounding is all that is left, nothing comes closer.
        return tries[0] if here.residual > ENOUGH else None

    def heading(self, point: Balanced, along: Array) -> Array:
        """The direction of the branch at a cycle, forwards as ``along`` (r l + 2,) says."""
        at, scale = point.at, self._scale(point.at)
        right = np.zeros(len(scale))
        right[-1] = 1.0
        kept = self._factors
        if kept is not None and kept[0] is point:
            found = sl.lu_solve(kept[1], right) * kept[2] / scale
        else:
            found = sl.lu_solve(self._factorised(at, scale, _phase(at), along), right)
        size = float(np.linalg.norm(found))
        if not (np.isfinite(size) and size > 0.0):
            raise AnalysisError("the branch has no direction")
        return found / size

    def towards(self, point: Balanced, sense: float) -> Array:
        """A heading to larger (1) or smaller μ (−1)."""
        along = np.zeros(point.at.z.size + 2)
        along[-1] = sense
        self.forget()
        return self.heading(point, along)

    def next_start(self, point: Balanced, heading: Array) -> tuple[Balanced, Array]:
        """The cycle with as many harmonics as its defect asks for, and its heading."""
        h, rows = point.harmonics, len(point.at.z)
        most = min(self.most, (MOST_UNKNOWN // rows - 1) // 2)
        if h >= most or defect(point) <= self.tolerance:
            return point, heading
        more = min(int(np.ceil(FINER * h)), most)
        try:
            finer = balanced(point.with_harmonics(more))
        except AnalysisError:
            return point, heading
        z = point.at.base.taken_to(heading[:-2].reshape(point.at.z.shape), finer.at.base)
        self.forget()
        return finer, self.heading(finer, np.concatenate([z.ravel(), heading[-2:]]))

    def at(self, mu: float, one: Balanced, other: Balanced) -> Balanced:
        """The cycle at a μ between two neighbours. Raises AnalysisError where none is near."""
        share = (mu - one.mu) / (other.mu - one.mu)
        first, second = one.at, other.at
        z = second.base.taken_to(second.z, first.base)
        omega = first.omega + share * (second.omega - first.omega)
        guess = evaluated(first.family, first.z + share * (z - first.z), omega, mu, first.scales)
        return balanced(Balanced(guess))

    def same(self, one: Balanced, other: Balanced) -> bool:
        """Whether two cycles at one μ are the same."""
        return same_cycle(one, other)

    def vanished(self, point: Balanced) -> bool:
        """Whether it has come to steady sliding."""
        if point.changes:
            return False
        return point.family.piecewise_linear or point.amplitude < self.small

    def forget(self) -> None:
        """Factors of the last cycle."""
        self._factors = None

    def _factorised(self, at: Evaluated, scale: Array, phase: Array, heading: Array) -> tuple[Array, Array]:
        size = at.z.size
        matrix = np.zeros((size + 2, size + 2))
        matrix[:size, :size] = at.jacobian
        matrix[:size, size], matrix[:size, size + 1] = at.by_omega.ravel(), at.by_mu.ravel()
        matrix[size, :size] = phase
        matrix[: size + 1] *= scale
        matrix[size + 1] = heading
        return lu_factors(matrix, check_finite=False)

    def _scale(self, at: Evaluated) -> Array:
        scale = np.full(at.z.size + 2, max(at.amplitude, self.small, 1e-300))
        scale[-2], scale[-1] = at.omega, self.width
        return scale


def _vector(at: Evaluated) -> Array:
    return np.append(at.z.ravel(), [at.omega, at.mu])


def _phase(at: Evaluated) -> Array:
    """∂z/∂τ of length one: what moves along the cycle itself."""
    shifted = (at.z @ at.base.turn.T).ravel()
    return shifted / max(float(np.linalg.norm(shifted)), 1e-300)

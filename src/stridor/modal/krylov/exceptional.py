"""The exceptional point beside an onset: the complex μ at which the mode that begins to grow meets another."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.linalg as sl

from ...errors import AnalysisError
from ...typing import ComplexArray
from ..dense_problem import DenseProblem, Eigenpairs
from ..newton import exceptional
from .double import pair_near
from .follow import BranchState

NEIGHBOURS = 12  # eigenvectors that span the surroundings of an eigenvalue


def exceptional_point(
    reduced: DenseProblem, state: BranchState, lam: complex, mu: float
) -> tuple[complex, float] | None:
    """The complex μ beside an onset at which two modes meet, and κ of λ ≈ λ_c ± κ √(μ − μ_c).

    Sought with the modes nearby at a state before it, then solved for. None where it is further away than half the
    onset's μ, or where there is no steady sliding on the way to it, which may lead beyond the range that was asked for.
    """
    reach = 0.5 * max(mu, 1e-3)
    near = _Halves(_Surroundings(reduced, state.found, lam).values, lam)
    try:
        rough = _zero(near.square, mu, complex(mu), reach, 1e-8)
        if rough is None:
            return None
        right, left = reduced.null_vectors(near.centre, rough)
    except AnalysisError:  # on the way there is no steady sliding
        return None
    found = exceptional(reduced, rough, near.centre, right, left, reach=reach)
    if found is None or abs(found[0] - mu) > reach or abs(found[1] - lam) > 0.5 * abs(lam):
        return None
    root = np.sqrt(found[2])
    return (found[0], float(max(abs(root.real), abs(root.imag)))) if np.isfinite(root) else None


class _Surroundings:
    """The projected problem on the eigenvectors nearest to one λ at one μ, right and left (r, q): exact there, and what
    these modes do to each other as μ changes is in it."""

    def __init__(self, reduced: DenseProblem, found: Eigenpairs, lam: complex) -> None:
        near = np.argsort(np.abs(found.values - lam))[:NEIGHBOURS]
        self.reduced = reduced
        self.right, self.left = (
            v / np.linalg.norm(v, axis=0)
            for v in (reduced.padded(found, found.right[:, near]), reduced.padded(found, found.left[:, near]))
        )

    def values(self, mu: complex) -> ComplexArray:
        """Eigenvalues (2q,) [1/s] at a real or complex μ."""
        mass, damping, stiffness = (self.left.T @ (np.asarray(m) @ self.right) for m in self.reduced.matrices(mu))
        # Scaled by a typical frequency so that the companion is balanced.
        unit = self.reduced.frequency
        size = len(mass)
        first = np.block([[np.zeros((size, size)), np.eye(size)], [-stiffness, -unit * damping]])
        second = sl.block_diag(np.eye(size), unit**2 * mass)
        with np.errstate(all="ignore"):
            found: ComplexArray = sl.eigvals(first, second) * unit
        return found[np.isfinite(found)]


class _Halves:
    """Squared half difference of the mode of an onset and its neighbour at a complex μ, then of whichever pair is about
    their mean, which ``centre`` keeps."""

    def __init__(self, values: Callable[[complex], ComplexArray], lam: complex) -> None:
        self._values, self.centre = values, lam

    def square(self, at: complex) -> complex:
        found = self._values(complex(at))
        found = found[found.imag > 0]
        if len(found) < 2:
            return complex("nan")
        self.centre, half = pair_near(found, self.centre)
        return half


def _zero(
    call: Callable[[complex], complex], mu: float, start: complex, reach: float, tolerance: float
) -> complex | None:
    """A complex zero near ``start`` by the secant method; None where it strays from μ by more than ``reach``."""
    before, now = start, start * (1 + 1e-4) + 1e-7
    at_before, at_now = call(before), call(now)
    for _ in range(20):
        if at_now == at_before:
            return now
        with np.errstate(all="ignore"):
            change = -at_now * (now - before) / (at_now - at_before)
        if not np.isfinite(change) or abs(now + change - mu) > reach:
            return None
        before, at_before = now, at_now
        now = now + change
        if abs(change) <= tolerance * max(mu, 1e-3):
            return now
        at_now = call(now)
    return None

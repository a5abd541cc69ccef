"""Every onset of a damped problem without following anything: the imaginary axis walked along instead of the range.

Where the parameter enters through few contacts, P(λ, μ) = A(λ) + (μ − a) B(λ) with B = Q C(λ) Rᵀ of rank m. On the axis
P(jω, μ)x = 0 is then an eigenvalue problem of size m for μ at given ω,

    det(1 + (μ − a) W(ω)) = 0,    W(ω) = Rᵀ A(jω)⁻¹ Q C(jω),    μ = a − 1/ν,  ν an eigenvalue of W(ω),

and an onset is where a ν(ω) crosses the real axis left of −1/(b − a). ω is refined where a ν is near that ray and not
resolved. The loops that light modes make are where the eigenvalues at μ = a say. Divergence is a real ν at ω = 0. This
is Nyquist's criterion, read for all μ of the range at once.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
import scipy.linalg as sl
import scipy.sparse as sp
from scipy.optimize import linear_sum_assignment

from ...direct import SingularMatrix, factorise
from ...direct.dense import lu_factors
from ...typing import Array, BoolArray, ComplexArray
from ..newton import Root, crossing, standstill
from ..quadratic import Quadratic
from .family import ROLES, Family

LARGEST = 40  # rank of what varies up to which the axis is walked
DENSE = 150  # unknowns up to which full matrices are solved faster
EVEN = 600  # values of ω to begin with
SLOW = 30  # and as many below the first of these, down to LEAST
LEAST = 1e-7  # of the highest frequency
AROUND = (-30.0, -10.0, -4.0, -2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0, 4.0, 10.0, 30.0)  # decays of a mode beside it
MOST = 40_000  # values of ω
CLOSE = 0.2  # of |ν|: how far it may go in one step near the ray
CLOSELY = 2e-3  # and where it crosses: Newton is to begin beside it
FINEST = 1e-10  # of ω: no step is halved further
RANK = 1e-13  # of the largest singular value
REAL = 1e-9  # |Im ν|/|ν| that is rounding: of what nothing damps
BEYOND = 1e-6  # of the range: what lies so far outside may belong to it
NEAR = 0.05  # of the range, and of ω: how far Newton may lead from a crossing


Solve = Callable[..., ComplexArray]


@dataclass(frozen=True)
class Walked:
    """Onsets, and at how many ω the axis was looked at."""

    roots: tuple[Root, ...]
    values: int


def walked(family: Family, between: tuple[float, float], top: float, light: ComplexArray) -> Walked | None:
    """All onsets in a range with ω up to top [1/s]; None where this does not apply: a parameter that enters in another
    way than in proportion, or through too many freedoms, or modes on the axis that nothing damps.

    light (k,): eigenvalues at the low end, about which ω is taken closer.
    """
    if family.reversible or family.form is None or not family.exact:
        return None
    if any(np.any(m.data) for role in ROLES for m in family.form[role].matrices[2:]):
        return None
    try:
        return _Walk(family, between, top).all(light)
    except (_OnAxisError, SingularMatrix, np.linalg.LinAlgError):
        return None


class _OnAxisError(Exception):
    """Something moves along the axis itself, or more is asked than is afforded."""


class _Walk:
    """W(ω) of a family from the low end of a range on."""

    def __init__(self, family: Family, between: tuple[float, float], top: float) -> None:
        self.family, self.top = family, top
        self.low, self.high = between
        self.width = self.high - self.low
        self.still = family.at(self.low)
        change = family.slopes(self.low)
        self._parts, self._left, self._right = _compressed(change)
        if self._left.shape[1] > LARGEST:
            raise _OnAxisError
        self.count = 0

    def at(self, omega: float) -> ComplexArray:
        """ν (m,) at ω."""
        self.count += 1
        if self.count > MOST:
            raise _OnAxisError
        with self._solver(omega) as solve:
            found: ComplexArray = sl.eigvals(self._right.T @ solve(self._left @ self._core(omega)))
        return found

    def _core(self, omega: float) -> ComplexArray:
        """C (m, k) at jω."""
        core: ComplexArray = -(omega**2) * self._parts[0] + 1j * omega * self._parts[1] + self._parts[2]
        return core

    @contextmanager
    def _solver(self, omega: float) -> Generator[Solve]:
        """A(jω)⁻¹, and its transpose where asked for."""
        matrix = self.still.at(1j * omega).astype(complex)
        if self.still.size <= DENSE:
            factors = lu_factors(matrix.toarray())

            def direct(right: ComplexArray, *, transpose: bool = False) -> ComplexArray:
                found: ComplexArray = sl.lu_solve(factors, right, trans=int(transpose))
                return found

            yield direct
            return
        with factorise(matrix, solver=self.family.options.solver) as factor:

            def sparse(right: ComplexArray, *, transpose: bool = False) -> ComplexArray:
                found: ComplexArray = factor.solve(right.astype(complex), transpose=transpose)
                return found

            yield sparse

    def all(self, light: ComplexArray) -> Walked:
        """Onsets of the range."""
        roots: list[Root] = []
        for s in self._standing():
            root = self._solved(0.0, s)
            if root is not None:
                roots.append(root)
        grid = self._grid(light)
        seen: tuple[float, ComplexArray] | None = None
        for omega in grid:
            here = (float(omega), self.at(float(omega)))
            for at, s in self._crossed(seen, here) if seen is not None else ():
                root = self._solved(at, s)
                if root is not None and not any(self._same(root, other) for other in roots):
                    roots.append(root)
            seen = here
        return Walked(tuple(roots), self.count)

    def _same(self, one: Root, other: Root) -> bool:
        return abs(one.mu - other.mu) <= 1e-8 * self.width and abs(one.lam - other.lam) <= 1e-7 * self.top

    def _grid(self, light: ComplexArray) -> Array:
        even = np.linspace(0.0, self.top, EVEN + 1)[1:]
        slow = self.top * np.geomspace(LEAST, 1.0 / EVEN, SLOW, endpoint=False)
        modes = light[np.abs(light.imag) > LEAST * self.top]
        around = (np.abs(modes.imag)[:, None] + np.abs(modes.real)[:, None] * np.array(AROUND)).ravel()
        every = np.unique(np.concatenate([even, slow, around]))
        return every[(every >= LEAST * self.top) & (every <= self.top)]

    def _standing(self) -> list[float]:
        """μ in the range where the stiffness is singular."""
        try:
            found = self.at(0.0)
        except SingularMatrix:
            return []
        real = found[np.abs(found.imag) <= 1e-7 * np.abs(found)].real
        return [float(s) for s in -1.0 / real[real < 0.0] if s <= self.width * (1 + BEYOND)]

    def _crossed(
        self, one: tuple[float, ComplexArray], other: tuple[float, ComplexArray]
    ) -> Iterator[tuple[float, float]]:
        """ω and μ − a of crossings of the ray between two ω."""
        (low, first), (high, last) = one, other
        rows, columns = linear_sum_assignment(np.abs(first[:, None] - last))
        before, after = first[rows], last[columns]
        near = self._near(before, after)
        if not near.any():
            return
        step, size = np.abs(after - before), np.minimum(np.abs(before), np.abs(after))
        across = (before.imag > 0) != (after.imag > 0)
        coarse = near & (step > np.where(across, CLOSELY, CLOSE) * size)
        if coarse.any() and high - low > FINEST * high:
            middle = 0.5 * (low + high)
            here = (middle, self.at(middle))
            yield from self._crossed(one, here)
            yield from self._crossed(here, other)
            return
        flat = (np.abs(before.imag) <= REAL * np.abs(before)) & (np.abs(after.imag) <= REAL * np.abs(after))
        if np.any(near & flat):
            raise _OnAxisError
        for k in np.flatnonzero(near & across):
            part = before[k].imag / (before[k].imag - after[k].imag)
            nu = before[k].real + part * (after[k].real - before[k].real)
            if nu < 0 and -1.0 / nu <= self.width * (1 + NEAR):
                yield low + part * (high - low), -1.0 / nu

    def _near(self, before: ComplexArray, after: ComplexArray) -> BoolArray:
        """Whether the way from ν to ν may touch the ray left of −1/width."""
        edge = -1.0 / (self.width * (1 + NEAR))
        middle, reach = 0.5 * (before + after), np.abs(after - before)
        distance = np.where(middle.real <= edge, np.abs(middle.imag), np.abs(middle - edge))
        return distance <= reach

    def _solved(self, omega: float, s: float) -> Root | None:
        """The onset in the full problem."""
        mu = min(max(self.low + s, self.low), self.high)
        with self._solver(omega) as solve:
            # x = A⁻¹QCz and y = A⁻ᵀRv of right and left vectors of W.
            answer = solve(self._left @ self._core(omega))
            values, left, right = sl.eig(self._right.T @ answer, left=True)
            index = int(np.argmin(np.abs(values + 1.0 / s)))
            x = answer @ right[:, index]
            y = solve(self._right @ left[:, index].conj(), transpose=True)
        reach = NEAR * self.width
        between = (max(self.low, mu - reach), min(self.high, mu + reach))
        if omega == 0.0:
            root = standstill(self.family, mu, x, y, between)
        else:
            root = crossing(self.family, mu, 1j * omega, x, y, between)
        if root is None or not self.low - BEYOND * self.width <= root.mu <= self.high + BEYOND * self.width:
            return None
        return root if abs(root.lam - 1j * omega) <= NEAR * omega + LEAST * self.top else None


def _compressed(change: Quadratic) -> tuple[list[Array], Array, Array]:
    """C of mass, damping and stiffness (m, k), Q (n, m) and R (n, k): what varies is Q C Rᵀ."""
    whole = [sp.csr_array(getattr(change, role)) for role in ROLES]
    sizes = [float(np.abs(m.data).max(initial=0.0)) for m in whole]
    n = change.size
    rows = np.unique(np.concatenate([m.tocoo().row[m.tocoo().data != 0] for m in whole]))
    columns = np.unique(np.concatenate([m.tocoo().col[m.tocoo().data != 0] for m in whole]))
    dense = [m[rows][:, columns].toarray() for m in whole]
    scaled = [d / s for d, s in zip(dense, sizes, strict=True) if s > 0]
    left, right = _span(np.hstack(scaled)), _span(np.hstack([d.T for d in scaled]))
    q, r = np.zeros((n, left.shape[1])), np.zeros((n, right.shape[1]))
    q[rows], r[columns] = left, right
    return [left.T @ d @ right for d in dense], q, r


def _span(block: Array) -> Array:
    u, s, _ = sl.svd(block, full_matrices=False)
    return u[:, s > RANK * s[0]]

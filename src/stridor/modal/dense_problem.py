"""Small dense problems over a number μ: all eigenpairs at any μ with their tangents, as followers of branches and
Newton's method need them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.linalg as sl

from ..direct.dense import DenseFactor, lu_factors
from ..errors import AnalysisError
from ..stages import passing, stage
from ..typing import Array, ComplexArray
from .newton import Border
from .quadratic.problem import Quadratic
from .shift_inverted import companion, damped_pairs, undamped_pairs

LONG = 500  # rows of a matrix from which all its eigenvalues take seconds
REACH = 1.8  # eigenpairs up to this much above the band are looked at
REMEMBERED = 300  # values of μ whose eigenpairs are kept


@dataclass(frozen=True)
class Eigenpairs:
    """Eigenpairs of the projected problem at one μ, one of each conjugate pair of λ.

    coordinate x (k,): λ² without damping, else λ. values λ (k,) with Im λ ≥ 0. right (r, k) and left (r, k) vectors,
    wᵀ P(λ) z = 0, tangents dx/dμ (k,). own: how many of the r belong to pairs, the rest to forces.
    """

    mu: float
    coordinate: ComplexArray
    values: ComplexArray
    right: ComplexArray
    left: ComplexArray
    tangents: ComplexArray
    own: int


class OverNumber(ABC):
    """Eigenpairs over a number μ in [low, high], up to beyond a frequency [1/s]. damped: whether anything works on
    velocities; the coordinate is λ² where nothing does."""

    def __init__(self, frequency: float, between: tuple[float, float], *, damped: bool) -> None:
        self.frequency, self.damped = frequency, damped
        self.low, self.high = between
        self._known: dict[float, Eigenpairs] = {}

    @abstractmethod
    def eigenpairs(self, mu: float) -> Eigenpairs:
        """All eigenpairs at ``mu`` with |λ| up to REACH times the frequency of interest."""

    def padded(self, found: Eigenpairs, vectors: ComplexArray) -> ComplexArray:
        """Vectors (r, k) of pairs found before a basis grew, on the basis as it is now."""
        return vectors

    def remembered(self, found: Eigenpairs) -> Eigenpairs:
        """The same, known from now on."""
        if found.mu not in self._known and len(self._known) >= REMEMBERED:
            self._known.pop(next(iter(self._known)))
        self._known[found.mu] = found
        return found


class DenseProblem(OverNumber):
    """The same of matrices (r, r), which may be complex where μ is: also a problem for Newton's method."""

    @abstractmethod
    def matrices(self, mu: complex) -> tuple[Any, Any, Any]:
        """M, C and K (r, r) at μ."""

    @abstractmethod
    def changes(self, mu: complex) -> tuple[Any, Any, Any]:
        """dM, dC and dK (r, r) over μ."""

    def eigenpairs(self, mu: float) -> Eigenpairs:
        """All eigenpairs at ``mu`` with |λ| up to REACH times the frequency of interest."""
        found = self.untracked(mu)
        if len(found.tangents) == len(found.values):
            return found
        tangents = self.tangents(mu, found.coordinate, found.values, found.right, found.left)
        return self.remembered(replace(found, tangents=tangents))

    def untracked(self, mu: float) -> Eigenpairs:
        """The same for what asks for no tangents, which may not have them: they take the matrices' changes over μ."""
        if mu not in self._known:
            coordinate, right, left = self.solve(mu)
            values = coordinate if self.damped else upper_root(coordinate)
            self.remembered(Eigenpairs(mu, coordinate, values, right, left, coordinate[:0], len(right)))
        return self._known[mu]

    @passing()
    def solve(self, mu: complex) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
        """Coordinates x (k,), right and left vectors (r, k) at a real or complex μ, |λ| up to REACH times the band."""
        mass, damping, stiffness = self.matrices(mu)
        _said(len(mass) * (2 if self.damped else 1))
        if self.damped:
            x, right, left = damped_pairs(
                mass, damping, stiffness, self.frequency, REACH, upper=not isinstance(mu, complex), factorise=_factor
            )
        else:
            x, right, left = undamped_pairs(mass, stiffness, self.frequency, REACH, factorise=_factor)
        order = np.lexsort((x.real, np.abs(x)))
        return x[order], right[:, order], left[:, order]

    def tangents(
        self, mu: float, coordinate: ComplexArray, values: ComplexArray, right: ComplexArray, left: ComplexArray
    ) -> ComplexArray:
        """dx/dμ (k,) = −wᵀ P_μ z / wᵀ P_x z."""
        by_mass, by_damping, by_stiffness = self.changes(mu)
        change = combined(by_stiffness, right)
        if np.any(by_damping):
            change = change + values * combined(by_damping, right)
        if np.any(by_mass):
            change = change + values**2 * combined(by_mass, right)
        mass, damping, _ = self.matrices(mu)
        by_x = combined(mass, right)
        if self.damped:
            by_x = 2 * coordinate * by_x + combined(damping, right)
        with np.errstate(all="ignore"):
            return -np.einsum("ij,ij->j", left, change) / np.einsum("ij,ij->j", left, by_x)

    def null_vectors(self, lam: complex, mu: complex) -> tuple[ComplexArray, ComplexArray]:
        """The vectors z and y (r,) that make P(λ, μ) z and yᵀP(λ, μ) all but zero, for λ that may be double."""
        mass, damping, stiffness = self.matrices(mu)
        matrix = lam**2 * mass + lam * damping + stiffness
        # Balanced by what the entries are made of: a row may itself be all but zero here, or have nothing in it at all
        # where a load takes a stiffness away.
        size = self._entries(lam, mu)
        rows = np.maximum(size.max(axis=1), max(1e-16 * float(size.max()), 1e-300))
        columns = np.maximum((size / rows[:, None]).max(axis=0), 1e-16)
        u, _, v = sl.svd(matrix / rows[:, None] / columns)
        return v[-1].conj() / columns, u[:, -1].conj() / rows

    def _entries(self, lam: complex, mu: complex) -> Array:
        """What the entries (r, r) of P(λ, μ) are made of: of their terms where it is known, as these may cancel."""
        mass, damping, stiffness = self.matrices(mu)
        size: Array = abs(lam) ** 2 * np.abs(mass) + abs(lam) * np.abs(damping) + np.abs(stiffness)
        return size

    # -- as Newton's method has it ------------------------------------------------------------------------------------
    @property
    def reversible(self) -> bool:
        """Whether λ comes with −λ̄."""
        return not self.damped

    @property
    def sizes(self) -> Array:
        """What a unit of each unknown (r,) is worth: the square root of its largest stiffness."""
        largest = np.abs(self.matrices(self.low)[2]).max(axis=1)
        return np.sqrt(np.maximum(largest, 1e-24 * float(largest.max(initial=0.0))))

    def at(self, mu: complex) -> Quadratic:
        """The matrices at μ."""
        return Quadratic(*self.matrices(mu))

    def slopes(self, mu: complex) -> Quadratic:
        """Their derivatives over μ."""
        return Quadratic(*self.changes(mu))

    def bordered(self, here: Quadratic, lam: complex, border: Border) -> DenseFactor:
        """Factors of P(λ), its rows of the size of one, with a border."""
        r = here.size
        whole = np.zeros((r + 1, r + 1), dtype=complex)
        whole[:r, :r] = here.at(lam)
        whole[border.row, r] = whole[r, border.column] = border.scale
        return DenseFactor.of(whole)

    def functional(self, lam: complex, mu: complex, y: ComplexArray, x: ComplexArray) -> complex:
        """yᵀP(λ, μ)x."""
        return complex(y @ self.at(mu).applied(lam, x))

    def backward_error(self, mu: float, lam: complex, x: ComplexArray) -> float:
        """‖P(λ)x‖∞ over what it is made of."""
        rest = np.abs(self.at(mu).applied(lam, x))
        return float(rest.max() / max(float((self._entries(lam, mu) @ np.abs(x)).max()), 1e-300))


def combined(basis: Array, weights: Any) -> Any:
    """basis (n, k) @ weights (k, l) in real arithmetic; real where the weights are.

    Where columns lie in memory one after the other, they are combined as rows: BLAS takes half the time for tall ones.
    """
    columns = basis.flags.f_contiguous
    if weights.dtype.kind != "c" or not np.any(weights.imag):
        real = np.ascontiguousarray(weights.real)
        return (real.T @ basis.T).T if columns else basis @ real
    if not columns:
        # A row of complex numbers, read as real, has their parts side by side.
        return (basis @ np.ascontiguousarray(weights).view(np.float64)).view(np.complex128)
    result = np.empty((basis.shape[0], weights.shape[1]), dtype=complex)
    result.real, result.imag = ((part.T @ basis.T).T for part in (weights.real, weights.imag))
    return result


def images(stacked: Array, z: ComplexArray) -> ComplexArray:
    """Mz, Dz and Kz (3, s, k) of matrices (3, s, r) that lie one after the other, in one product."""
    return np.asarray(combined(stacked.reshape(-1, stacked.shape[2]), z)).reshape(*stacked.shape[:2], -1)


def upper_root(squares: ComplexArray) -> ComplexArray:
    """λ (k,) of λ² with Im λ ≥ 0, and Re λ ≥ 0 where it is real."""
    root: ComplexArray = np.sqrt(squares + 0j)
    return np.where((root.imag < 0) | ((root.imag == 0) & (root.real < 0)), -root, root)


@passing()
def eigenvalues(mass: Array, damping: Array, stiffness: Array, frequency: float) -> ComplexArray:
    """All finite λ (k,) of (λ²M + λC + K) z = 0, without damping one of each ±λ, shifted and inverted at λ = frequency:
    those of about that size are as good as can be, whatever else there is. The mass need not be regular."""
    _said(len(mass) * (2 if np.any(damping) else 1))
    if not np.any(damping):
        shift = frequency**2
        theta = sl.eigvals(sl.lu_solve(_factor(stiffness + shift * mass), shift * mass))
        with np.errstate(all="ignore"):
            squares: ComplexArray = shift - shift / theta
        return upper_root(squares[np.isfinite(squares)])
    theta = sl.eigvals(companion(mass, damping, stiffness, frequency, factorise=_factor)[0])
    with np.errstate(all="ignore"):
        values: ComplexArray = frequency * (1 + 1 / theta)
    return values[np.isfinite(values)]


def _said(unknowns: int) -> None:
    """Name what takes seconds from some hundred unknowns on; one of many, so no line of a log."""
    if unknowns >= LONG:
        stage(f"all eigenvalues of a dense matrix of {unknowns} rows", logged=False)


def _factor(matrix: Array) -> tuple[Array, Array]:
    if not np.all(np.isfinite(matrix)):
        raise AnalysisError("the projected contact problem is not finite; check the model's units and stiffnesses")
    factor = lu_factors(matrix)
    if np.abs(np.diag(factor[0])).min(initial=np.inf) == 0.0:
        raise AnalysisError("the projected contact problem is singular: a contact is given twice, or friction jams")
    return factor

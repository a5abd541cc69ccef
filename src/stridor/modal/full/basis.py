"""Eigenpairs of a family at any μ, as the branch follower sees them: on a basis, or in the whole problem.

Up to 60 freedoms the basis is the unit matrix, beyond that a reduced model over the range of μ. Where none can be made
(multipliers without a diagonal, a mass that is not symmetric, rigid contact) every μ is solved in the whole problem.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp

from ...direct import SingularMatrix
from ...errors import AnalysisError
from ...typing import Array, BoolArray, ComplexArray, Sparse
from ..at_rest import double_zeros, moving
from ..dense_problem import DenseProblem, Eigenpairs, OverNumber, combined
from ..krylov.follow import FOLLOWED
from ..options import Options
from ..parametric import ReducedModel, reduce
from ..quadratic import Quadratic, Region, find_modes
from ..quadratic.inverse_iteration import two_sided
from ..quadratic.problem import times
from ..results import off_rounding
from ..tolerances import SPLIT_RELATIVE, UNSTABLE_RELATIVE
from .family import MU, ROLES, Family, Smooth
from .opening import SIMPLE, Opening, told

DENSE = 60  # unknowns up to which the matrices are their own reduced model
WHOLE = 6000  # and up to which branches are followed by full solves where there is none
BEYOND = 1.3  # times the band: what full solves look for, since branches are followed up to 1.25 of it
NEARBY = 1.02  # times the band, where growth in it is all that matters
BESIDE = 1e-3  # of the highest angular frequency: and how fast what may grow next decays
DECAY = 0.5  # of the highest angular frequency: modes that decay faster are not looked for


class Along(OverNumber):
    """Eigenpairs over t = μ − low of a family. whole: whether they are those of the full problem; at_rest: how many
    motions as a whole there are at every μ, which are left out."""

    whole: bool
    at_rest: int

    def __init__(self, family: Family, frequency: float, *, damped: bool) -> None:
        super().__init__(frequency, (0.0, family.high - family.low), damped=damped)
        self.family = family
        self.at_rest = 0

    def find_at_rest(self) -> None:
        """Find out whether the structure moves as a whole at every μ: such eigenvalues are rounding about zero, in
        changing numbers, and are left out from then on."""
        least = len(self.eigenpairs(0.0).values)
        for t in (0.0, self.family.high - self.family.low):
            values = self.eigenpairs(t).values
            least = min(least, double_zeros(values[~self._moves(values)]))
        self.at_rest = least
        if least:
            self._known.clear()

    def searched(self) -> Family:
        """The problem whose eigenpairs these are."""
        return self.family

    def _moves(self, values: ComplexArray) -> BoolArray:
        """Which eigenvalues (k,) are no motions as a whole."""
        return moving(values, self.frequency, lambda: self.family.rest_limit(self.frequency))

    @cached_property
    def opened(self) -> tuple[Opening, ...]:
        """What becomes of simple modes that are on the axis at the low end and are followed, as far as it can be told.
        One that grows is found where that is more than rounding, and its root in the full problem."""
        if self.family.reversible:
            return ()
        searched, found, result = self.searched(), self.eigenpairs(0.0), list[Opening]()
        size = np.abs(found.values)
        still = (found.values.real == 0) & self._moves(found.values) & (size <= FOLLOWED * self.frequency)
        for k in np.flatnonzero(still):
            if np.count_nonzero(np.abs(found.values - found.values[k]) <= SIMPLE * size[k]) > 1:
                continue
            one = self._told(searched, complex(found.values[k]), found.right[:, [k]], found.left[:, [k]])
            if one is not None and self._seen(one, found.right[:, k], found.left[:, k]):
                result.append(one)
        return tuple(result)

    def _told(self, searched: Family, lam: complex, right: ComplexArray, left: ComplexArray) -> Opening | None:
        """What becomes of a mode of the low end, vectors (r, 1), in the problem searched and then in the full one."""
        one = told(searched, lam, right[:, 0], left[:, 0])
        if one is None or one.root is None or searched is self.family:
            return one
        full = told(self.family, lam, self.vectors(right, 0.0)[:, 0], self.vectors(left, 0.0, left=True)[:, 0])
        return None if full is None or full.root is None else replace(one, root=full.root)

    def _seen(self, one: Opening, right: ComplexArray, left: ComplexArray) -> bool:
        """Whether the mode, vectors (r,), is where its series leads to, on the way and where its growth or decay is
        seen."""
        del right, left
        for t in (0.5 * one.until, one.until):
            found = self.eigenpairs(t)
            place = one.among(found.values, t)
            if place is None:
                return False
            if t == one.until and not (found.values[place].real > 0 if one.root else found.values[place].real < 0):
                return False
        return True

    def vectors(self, z: ComplexArray, mu: float, *, left: bool = False) -> ComplexArray:
        """Vectors (n, k) of the full problem from those found at μ − low."""
        raise NotImplementedError

    def moving(self, found: Eigenpairs) -> Eigenpairs:
        """Without motions as a whole, where there are any at all μ."""
        if not self.at_rest:
            return found
        kept = self._moves(found.values)
        return Eigenpairs(
            found.mu, found.coordinate[kept], found.values[kept], found.right[:, kept], found.left[:, kept],
            found.tangents[kept], found.own,
        )  # fmt: skip

    def without_rounding(self, found: Eigenpairs) -> Eigenpairs:
        """With growth that may be rounding taken as none: modes that nothing damps would cross the axis everywhere."""
        values = off_rounding(found.values, UNSTABLE_RELATIVE)
        return replace(found, coordinate=values, values=values)

    def squared(self, found: Eigenpairs) -> Eigenpairs:
        """λ² as the coordinate where the problem is reversible: it stays smooth where eigenvalues reach zero, and real
        as long as they are on the axis."""
        values = off_rounding(found.values, SPLIT_RELATIVE)
        still = np.abs(values.imag) <= SPLIT_RELATIVE * np.abs(values)
        values[still] = values[still].real
        # Of two real values ±λ one says everything.
        kept = ~(still & (values.real < 0))
        values = values[kept]
        return Eigenpairs(
            found.mu, values**2, values, found.right[:, kept], found.left[:, kept],
            2 * values * found.tangents[kept], found.own,
        )  # fmt: skip


class OnBasis(Along, DenseProblem):
    """The family on a basis V (n, r), the same on both sides: its matrices and what they change by are small."""

    whole = False

    @property
    def reversible(self) -> bool:
        """That of the family."""
        return self.family.reversible

    def eigenpairs(self, mu: float) -> Eigenpairs:
        """See `OverNumber`; without motions as a whole, and what is on the axis exactly there."""
        if mu in self._known:
            return self._known[mu]
        found = DenseProblem.eigenpairs(self, mu)
        if not self.family.reversible:
            found = self.without_rounding(found)
        elif not self.family.still:
            found = self.squared(found)
        return self.remembered(self.moving(found))


class Projected(OnBasis):
    """The basis is a reduced model's, or all freedoms; the matrices are those of the family's form."""

    def __init__(self, family: Family, frequency: float, model: ReducedModel | None) -> None:
        problem = _on_basis(family)
        assert problem.form is not None, "asked for families that have one"
        super().__init__(family, frequency, damped=not family.still)
        self._size = problem.size if model is None else model.size
        self.model = model
        self._form = problem.form
        self._parts: list[tuple[int, int, Array]] = []
        index = 0
        for row, role in enumerate(ROLES):
            for k, matrix in enumerate(self._form[role].matrices):
                if matrix.nnz:
                    dense = matrix.toarray() if model is None else model.projected[index]
                    self._parts.append((row, k, dense))
                    index += 1

    def vectors(self, z: ComplexArray, mu: float, *, left: bool = False) -> ComplexArray:
        """V z, or z where V is the unit matrix; without the forces of rigid contact."""
        x = z if self.model is None else combined(self.model.vectors, z).astype(complex)
        if self.family.eliminated is None:
            return x
        elimination = self.family.eliminated[1]
        moved = times(elimination.tests({MU: self.family.low + mu}) if left else elimination.motion, x)
        result: ComplexArray = np.zeros((self.family.size, moved.shape[1]), dtype=complex)
        result[: len(moved)] = moved
        return result

    def searched(self) -> Family:
        """The problem on the basis."""
        if self.model is None and self.family.eliminated is None:
            return self.family
        low, high = self.family.low, self.family.high
        return Family((low, high), lambda mu: self.sparse(mu - low), Options())

    def sparse(self, mu: float) -> Quadratic:
        """The problem (r, r) at μ − low as any other has it."""
        return Quadratic(*(sp.csr_array(matrix) for matrix in self.matrices(mu)))

    def matrices(self, mu: complex) -> tuple[Array, Any, Any]:
        """M, D and K (r, r) at μ − low, which may be complex."""
        value = self.family.low + mu
        real = complex(value).imag == 0.0
        factors = [self._form[role].factors(value) for role in ROLES]
        return self._summed([f.real if real else f for f in factors])

    def changes(self, mu: complex) -> tuple[Array, Any, Any]:
        """dM, dD and dK over μ (r, r) at μ − low, which may be complex."""
        return self._summed([self._form[role].slopes(self.family.low + mu) for role in ROLES])

    def _entries(self, lam: complex, mu: complex) -> Array:
        total = np.zeros((self._size, self._size))
        factors = [self._form[role].factors(self.family.low + mu) for role in ROLES]
        for row, k, part in self._parts:
            total += abs(lam) ** (2 - row) * abs(factors[row][k]) * np.abs(part)
        return total

    def _summed(self, factors: list[Any]) -> tuple[Array, Any, Any]:
        size = self._size
        totals = [np.zeros((size, size), dtype=f.dtype) for f in factors]
        for row, k, part in self._parts:
            if factors[row][k]:
                totals[row] += factors[row][k] * part
        return totals[0], totals[1], totals[2]


class Whole(Along):
    """The family solved in full at every μ asked for. beside: for what grows or is near that alone."""

    whole = True

    def __init__(self, family: Family, frequency: float, *, beside: bool = False) -> None:
        super().__init__(family, frequency, damped=not family.still)
        self._reach, self._decay = (NEARBY, BESIDE) if beside else (BEYOND, DECAY)

    def vectors(self, z: ComplexArray, mu: float, *, left: bool = False) -> ComplexArray:
        """The very vectors."""
        return z

    def eigenpairs(self, mu: float) -> Eigenpairs:
        """All eigenpairs at ``mu`` up to beyond the band."""
        if mu not in self._known:
            value = self.family.low + mu
            problem, top = self.family.at(value), self._reach * self.frequency / (2 * np.pi)
            region = Region.band(0.0, top, above=-self._decay * self.frequency)
            # Of what may be a motion as a whole the matrices hold rounding alone; none of it is followed or counted.
            still = self.family.rest_limit(self.frequency)
            found = find_modes(problem, region, left=True, solver=self.family.options.solver, count=False, still=still)
            assert found.left is not None, "asked for"
            change = self.family.slopes(value)
            with np.errstate(all="ignore"):
                by_mu = change.residual(found.values, found.right)
                slope = problem.slope(found.values, found.right)
                tangents = -np.einsum("ij,ij->j", found.left, by_mu) / np.einsum("ij,ij->j", found.left, slope)
            pairs = Eigenpairs(
                mu, found.values, found.values, found.right, found.left, tangents, self.family.freedoms
            )
            pairs = self.squared(pairs) if self.family.reversible else self.without_rounding(pairs)
            self.remembered(self.moving(pairs))
        return self._known[mu]

    def _seen(self, one: Opening, right: ComplexArray, left: ComplexArray) -> bool:
        """See `Along`. What decays is looked for alone, as solving for all modes costs as much as a step of the way."""
        if one.root is not None:
            return super()._seen(one, right, left)
        last = 0j
        for t in (0.5 * one.until, one.until):
            lam, problem = one.at(t), self.family.at(self.family.low + t)
            try:
                found = two_sided(problem, lam, right, left, beside=1e-6 * lam, solver=self.family.options.solver)
            except SingularMatrix:
                return False
            if found is None or abs(found.lam - lam) > 1.5 * UNSTABLE_RELATIVE * abs(lam):
                return False
            last = found.lam
        return last.real < 0


def along(family: Family, frequency: float) -> Along:
    """The cheapest way to eigenpairs over μ up to a frequency [1/s]. Raises AnalysisError where there is none."""
    try:
        problem = _on_basis(family)
        small = problem.form is not None and problem.size <= DENSE
        source = Projected(family, frequency, None if small else _model(family, frequency))
        source.find_at_rest()
        return source
    except (AnalysisError, np.linalg.LinAlgError, ValueError) as error:
        return whole_or_raise(family, frequency, str(error))


def whole_or_raise(family: Family, frequency: float, reason: str) -> Whole:
    """By full solves. Raises AnalysisError for problems too large for that."""
    unknowns = family.size
    if unknowns > WHOLE:
        raise AnalysisError(
            f"no reduced model over mu can be made of these matrices ({reason}), and following modes by full solves is "
            f"not tried with {unknowns} unknowns, more than {WHOLE}; take `stridor modes` at several mu"
        )
    source = Whole(family, frequency)
    source.find_at_rest()
    return source


def _on_basis(family: Family) -> Smooth:
    """The problem that is projected: without rigid contact, which has no stiffness."""
    return family if family.eliminated is None else family.eliminated[0]


def _model(family: Family, frequency: float) -> ReducedModel:
    problem = _on_basis(family).parametric()
    middle = problem.at(problem.reference)
    diagonal = (middle.stiffness + frequency**2 * middle.mass).diagonal()
    if np.any(diagonal == 0.0):
        raise AnalysisError("some freedoms have neither stiffness nor mass of their own, as multipliers have it")
    if not _positive(middle.mass):
        raise AnalysisError("the mass has negative entries on its diagonal")
    # What grows at both ends is counted in the full problem by whoever follows branches on it.
    return reduce(problem, frequency / (2 * np.pi), solver=family.options.solver, sure=False)


def _positive(mass: Sparse) -> bool:
    return bool(np.all(sp.csr_array(mass).diagonal() >= 0))

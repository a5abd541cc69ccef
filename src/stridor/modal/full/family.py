"""λ²M + λD + K over the friction coefficient, for matrices of any structure, the contacts that touch put in.

Factors of imported matrices may depend on μ in whatever way, contacts bring μ themselves. What a system gives at some
μ is written in Newton's form

    A(μ) = C₀ + C₁ (μ − μ₀) + C₂ (μ − μ₀)(μ − μ₁) + …

whose matrices Cₖ are as sparse as what varies. Where factors are polynomials it is exact; where no such form is found
every μ is built anew.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp

from ...direct import factorise
from ...errors import AnalysisError, CaseError
from ...system import System
from ...typing import Array, ComplexArray, IntArray, Sparse
from ..at_rest import rest_limit
from ..backward_error import common_pattern
from ..krylov.problem import ContactProblem, problem_of
from ..newton import Border, BorderedFactor
from ..options import Options
from ..parametric import Parameter, ParametricProblem, Term
from ..parametric.contacts_rigid import Elimination, eliminate
from ..parametric.problem import Role
from ..quadratic import Quadratic

MU = "mu"
ROLES: tuple[Role, ...] = ("mass", "damping", "stiffness")
MOST_POINTS = 14
REMEMBERED = 4  # problems: both ends and the probes
EXACT = 1e-13  # of the largest entries of row and column: what the form may leave to stand for the matrices themselves
CLOSE = 1e-10  # and to serve following branches
PROBES = (0.37, 0.71)  # of the range: where the form is tried


@dataclass(frozen=True)
class Form:
    """Newton's form of one matrix: matrices (n, n) and the nodes (k,) of their factors."""

    matrices: tuple[Sparse, ...]
    nodes: tuple[float, ...]

    def factors(self, mu: complex) -> ComplexArray:
        """(k,) products of μ − μ_j over the nodes before each; μ may be complex."""
        steps = [1.0, *(mu - node for node in self.nodes[: len(self.matrices) - 1])]
        return np.array(steps, dtype=complex).cumprod()

    def sum(self, factors: Any) -> Sparse:
        """Σ factor · matrix (n, n) csr, real where the factors are."""
        indptr, indices, data = self._stacked
        factors = factors if np.any(np.imag(factors)) else np.real(factors)
        return sp.csr_array((factors @ data, indices, indptr), shape=self.matrices[0].shape)

    @cached_property
    def _stacked(self) -> tuple[IntArray, IntArray, Array]:
        return common_pattern(*self.matrices)

    def wide_factors(self, mu: complex) -> Any:
        """The same in extended precision."""
        wide = np.clongdouble(mu)
        steps = [np.clongdouble(1.0), *(wide - node for node in self.nodes[: len(self.matrices) - 1])]
        result: Any = np.cumprod(np.array(steps, dtype=np.clongdouble))
        return result if mu.imag else result.real

    def slopes(self, mu: complex) -> Any:
        """Their derivatives (k,) over μ, real where that is."""
        result: Any = np.zeros(len(self.matrices), dtype=complex)
        value, slope = complex(1.0), complex(0.0)
        for k, node in enumerate(self.nodes[: len(self.matrices) - 1]):
            value, slope = value * (mu - node), slope * (mu - node) + value
            result[k + 1] = slope
        return result if mu.imag else result.real


@dataclass(frozen=True)
class Weight:
    """The factor of one of the form's matrices, as terms of parametric problems have it."""

    nodes: tuple[float, ...]

    def __call__(self, values: Mapping[str, float]) -> float:
        """The product of μ − μ_j."""
        return float(np.prod([values[MU] - node for node in self.nodes]))


class Smooth:
    """A quadratic problem over μ in [low, high], ``built`` anew at any μ or from a form that stands for it."""

    def __init__(self, between: tuple[float, float], make: Callable[[float], Quadratic]) -> None:
        self.low, self.high = between
        self._make = make
        self._known: dict[float, Quadratic] = {}

    @cached_property
    def size(self) -> int:
        """Number of unknowns."""
        return self.built(self.low).size

    def at(self, mu: complex) -> Quadratic:
        """The problem at μ, from the form where that is exact or where μ is complex. Raises AnalysisError for a complex
        one where there is no form."""
        if mu.imag and self.form is None:
            raise AnalysisError("the matrices are no smooth functions of mu")
        if self.form is None or not (self.exact or mu.imag):
            return self.built(mu.real)
        return Quadratic(*(self.form[role].sum(self.form[role].factors(mu)) for role in ROLES))

    def built(self, mu: float) -> Quadratic:
        """The problem at μ as the system gives it there."""
        if mu not in self._known:
            if len(self._known) >= REMEMBERED:
                self._known.pop(next(iter(self._known)))
            self._known[mu] = self._make(mu)
        return self._known[mu]

    def slopes(self, mu: complex) -> Quadratic:
        """dM/dμ, dD/dμ and dK/dμ; where there is no form, by differences about the real part of μ."""
        if self.form is not None:
            return Quadratic(*(self.form[role].sum(self.form[role].slopes(mu)) for role in ROLES))
        step = 1e-5 * (self.high - self.low)
        low, high = max(mu.real - step, self.low), min(mu.real + step, self.high)
        before, after = self.built(low), self.built(high)
        return Quadratic(
            *(sp.csr_array((getattr(after, role) - getattr(before, role)) / (high - low)) for role in ROLES)
        )

    def functional(self, lam: complex, mu: complex, y: ComplexArray, x: ComplexArray) -> complex:
        """yᵀP(λ, μ)x in extended precision, term by term.

        Stiff springs and fine meshes make terms that cancel to a millionth of a millionth of their size; how near an
        eigenvalue is to the axis is what they leave.
        """
        extended = np.clongdouble(lam)
        left, right = (np.stack([v.real, v.imag], axis=1).astype(np.longdouble) for v in (y, x))
        total = np.clongdouble(0.0)
        for power, pieces in zip((2, 1, 0), self._wide_terms(mu), strict=True):
            for matrix, factor in pieces:
                parts = left.T @ (matrix @ right)
                real, imaginary = parts[0, 0] - parts[1, 1], parts[0, 1] + parts[1, 0]
                total = total + extended**power * factor * (real + np.clongdouble(1j) * imaginary)
        return complex(total)

    def _wide_terms(self, mu: complex) -> list[list[tuple[Sparse, Any]]]:
        """Matrices and factors of M, D and K at μ in extended precision."""
        if self.form is None or not (self.exact or mu.imag):
            problem = self.built(mu.real)
            return [[(wide(getattr(problem, role)), np.longdouble(1.0))] for role in ROLES]
        result: list[list[tuple[Sparse, Any]]] = []
        for role, matrices in zip(ROLES, self._wide_form, strict=True):
            factors = self.form[role].wide_factors(mu)
            result.append([(m, f) for m, f in zip(matrices, factors, strict=True) if m.nnz and f])
        return result

    @cached_property
    def _wide_form(self) -> list[list[Sparse]]:
        assert self.form is not None, "asked for families that have one"
        return [[wide(m) for m in self.form[role].matrices] for role in ROLES]

    @property
    def exact(self) -> bool:
        """Whether the form is the matrices up to rounding."""
        return self._formed[1]

    @property
    def form(self) -> Mapping[Role, Form] | None:
        """Newton's form of M, D and K; None where they are no smooth functions of μ."""
        return self._formed[0]

    @cached_property
    def _formed(self) -> tuple[Mapping[Role, Form] | None, bool]:
        if self.low >= self.high:
            return None, False
        tried = [self.low + p * (self.high - self.low) for p in PROBES]
        truth: dict[Role, list[Sparse]] = {role: [getattr(self.built(mu), role) for mu in tried] for role in ROLES}
        nodes = _leja(self.low, self.high, MOST_POINTS)
        columns: dict[Role, list[Sparse]] = {role: [] for role in ROLES}
        best: dict[Role, tuple[Form | None, float]] = {role: (None, np.inf) for role in ROLES}
        for k, node in enumerate(nodes):
            open_: list[Role] = [role for role in ROLES if best[role][1] > EXACT]
            if not open_:
                break
            problem = self.built(node)
            for role in open_:
                new = getattr(problem, role)
                # Divided differences, of which each new node needs the last.
                for j, known in enumerate(columns[role]):
                    new = sp.csr_array((new - known) / (node - nodes[j]))
                new.eliminate_zeros()
                columns[role].append(new)
                form = Form(tuple(columns[role]), tuple(nodes[: k + 1]))
                left = max(
                    deviation(form.sum(form.factors(mu)), true)
                    for mu, true in zip(tried, truth[role], strict=True)
                )
                if left < best[role][1]:
                    best[role] = form, left
        forms: dict[Role, Form] = {}
        for role, (form, left) in best.items():
            if form is not None and left <= CLOSE:
                forms[role] = form
        if len(forms) < len(ROLES):
            return None, False
        return forms, max(left for _, left in best.values()) <= EXACT

    @property
    def reversible(self) -> bool:
        """Whether −λ̄ is an eigenvalue with every λ: nothing works on velocities, or gyroscopic forces alone do and all
        others have a potential. Stability ends there only where eigenvalues meet."""
        return self._reversible

    @cached_property
    def _reversible(self) -> bool:
        if self.form is not None:
            mass, damping, stiffness = (self.form[role].matrices for role in ROLES)
        else:
            problems = [self.built(self.low + p * (self.high - self.low)) for p in (0.0, *PROBES, 1.0)]
            mass, damping, stiffness = ([getattr(q, role) for q in problems] for role in ROLES)
        return _mirrored(mass, damping, stiffness)

    @property
    def sizes(self) -> Array:
        """What a unit of each unknown (n,) is worth: the square root of its largest stiffness, at some μ."""
        return self._sizes

    @cached_property
    def _sizes(self) -> Array:
        largest = np.zeros(self.built(self.low).size)
        for part in (0.0, *PROBES, 1.0):
            matrix = abs(self.built(self.low + part * (self.high - self.low)).stiffness)
            largest = np.maximum(largest, np.asarray(matrix.max(axis=1).toarray()).ravel())
        return np.sqrt(np.maximum(largest, 1e-24 * float(largest.max(initial=0.0))))

    @cached_property
    def dissipates(self) -> bool:
        """Whether anything works on velocities that is not gyroscopic."""
        mid = self.built(self.low + PROBES[0] * (self.high - self.low))
        return deviation(mid.damping, sp.csr_array(-mid.damping.T)) > EXACT

    @cached_property
    def still(self) -> bool:
        """Whether nothing at all works on velocities."""
        mid = self.built(self.low + PROBES[0] * (self.high - self.low))
        return not (mid.damping.nnz and np.any(mid.damping.data))

    def parametric(self) -> ParametricProblem:
        """The form as a problem in one parameter. Raises AnalysisError where there is none."""
        if self.form is None:
            raise AnalysisError("the matrices are no smooth functions of mu")
        terms: list[Term] = []
        for role in ROLES:
            form = self.form[role]
            for k, matrix in enumerate(form.matrices):
                if matrix.nnz:
                    symmetric = deviation(matrix, sp.csr_array(matrix.T)) <= EXACT
                    terms.append(Term(matrix, role, Weight(form.nodes[:k]), symmetric=symmetric))
        return ParametricProblem(tuple(terms), (Parameter(MU, self.low, self.high, (self.low + self.high) / 2),))


class Family(Smooth):
    """A quadratic problem over one number, and what solving it takes."""

    def __init__(self, between: tuple[float, float], make: Callable[[float], Quadratic], options: Options) -> None:
        super().__init__(between, make)
        self.options = options
        self._rest: dict[float, float] = {}

    @property
    def freedoms(self) -> int:
        """Number of freedoms n; the forces of rigid contacts are unknowns beyond them."""
        return self.size

    def rest_limit(self, top: float) -> float:
        """Up to which |λ| [1/s] eigenvalues may be motions as a whole, of a search up to top [1/s]; 0 where none is."""
        if top not in self._rest:
            ends = [self.built(mu) for mu in (self.low, self.high)]
            self._rest[top] = rest_limit(ends, top, self.options.solver)
        return self._rest[top]

    @cached_property
    def neutral(self) -> bool:
        """Whether −λ̄ is an eigenvalue with every λ at the low end, as it is everywhere where ``reversible``."""
        return _mirrored(*([matrix] for matrix in self.built(self.low).matrices()))

    def bordered(self, here: Quadratic, lam: complex, border: Border) -> BorderedFactor:
        """Factors of P(λ) with a border. Raises AnalysisError where it is singular."""
        coo = sp.coo_array(here.at(lam))
        n, scale = coo.shape[0], border.scale
        data = np.concatenate([coo.data.astype(complex), [scale, scale]])
        rows, columns = np.concatenate([coo.row, [border.row, n]]), np.concatenate([coo.col, [n, border.column]])
        return self._factorised(sp.coo_array((data, (rows, columns)), shape=(n + 1, n + 1)))

    def _factorised(self, matrix: Sparse) -> BorderedFactor:
        return factorise(sp.csr_array(matrix), solver=self.options.solver, tried=False)

    def backward_error(self, mu: float, lam: complex, x: ComplexArray) -> float:
        """Backward error of an eigenpair λ, x (n,) in the matrices as they are given at μ."""
        return float(self.built(mu).backward_error(np.array([lam]), x[:, None])[0])

    @cached_property
    def eliminated(self) -> tuple[Smooth, Elimination] | None:
        """The problem with rigid contact taken out, and how; None where there is none."""
        return None


class SystemFamily(Family):
    """The quadratic problem of a system over μ in [low, high].

    system_at: the system at a μ, the same object where its matrices do not depend on μ. damped: with all of D, else
    with its gyroscopic part alone and what friction adds to it. touching_at: μ of the steady sliding that says which
    nodes touch; None takes the laws' own coefficients, with the matrices at ``own``.
    """

    def __init__(
        self,
        system_at: Callable[[float], System],
        between: tuple[float, float],
        options: Options,
        *,
        damped: bool,
        own: float,
        touching_at: float | None = None,
    ) -> None:
        super().__init__(between, lambda mu: self._problem(mu).pencil(mu).condensed(), options)
        self._whole_damping = damped
        self._system_at = system_at
        first = system_at(own)
        # Contacts alone depend on μ by themselves; nothing needs to be built again.
        self.varies = system_at(self.high if own != self.high else self.low) is not first
        grid = np.linspace(0.0, self.high, 50) if self.high > 0 else None
        self.contacts = self._as_asked(problem_of(first, touching_at, options, frictions=grid))

    @property
    def freedoms(self) -> int:
        """Number of freedoms n; the forces of rigid contacts are unknowns beyond them."""
        return self.contacts.size

    @property
    def open_contacts(self) -> tuple[str, ...]:
        """Names of the contacts that carry no load."""
        return self.contacts.open_contacts

    @cached_property
    def depends(self) -> bool:
        """Whether μ changes anything."""
        if not self.varies and not self.contacts.nodes:
            return False
        samples = (self.low, self.high, *(self.low + p * (self.high - self.low) for p in PROBES))
        first = self.built(samples[0])
        others = [self.built(p) for p in samples[1:]]
        return any(deviation(getattr(first, role), getattr(q, role)) > 0 for q in others for role in ROLES)

    @cached_property
    def eliminated(self) -> tuple[Smooth, Elimination] | None:
        """The problem with rigid contact taken out, and how; None where there is none. Raises AnalysisError where
        friction jams in the range or contacts press on the same freedoms twice."""
        rigid = np.flatnonzero(self.contacts.compliance <= 0)
        if not len(rigid):
            return None
        friction = Parameter(MU, self.low, self.high, self.low)
        found = eliminate(self.contacts.normal[rigid], self.contacts.slide[rigid], friction)

        def make(mu: float) -> Quadratic:
            whole = self._problem(mu).pencil(mu).condensed(rigid=False)
            tests = found.tests({MU: mu}).T
            return Quadratic(*(sp.csr_array(tests @ getattr(whole, role) @ found.motion) for role in ROLES))

        return Smooth((self.low, self.high), make), found

    def _as_asked(self, problem: ContactProblem) -> ContactProblem:
        """With all damping of the structure, or without. Gyroscopic forces do no work and are none of it; nor is what
        friction adds, with a slope of its law or across the sliding."""
        if self._whole_damping:
            return problem
        damping = problem.damping
        if deviation(damping, sp.csr_array(damping.T)) <= EXACT:  # what turning beams leaves of symmetry is neither
            return replace(problem, damping=sp.csr_array(damping.shape))
        return replace(problem, damping=sp.csr_array((damping - damping.T) / 2))

    def _problem(self, mu: float) -> ContactProblem:
        if not self.varies:
            return self.contacts
        system = self._system_at(mu)
        if self.contacts.extras is None:
            own = replace(self.contacts, mass=system.mass, damping=system.damping, stiffness=system.stiffness)
            return self._as_asked(own)
        found = self._as_asked(problem_of(system, None, self.options))
        if not np.array_equal(found.touching, self.contacts.touching):
            raise AnalysisError("the nodes in contact change with mu, since matrices do; take a smaller range of mu")
        return found


def family_of(
    system_at: Callable[[float], System],
    between: tuple[float, float],
    options: Options,
    *,
    damped: bool,
    own: float,
    touching_at: float | None = None,
) -> SystemFamily:
    """The family from μ = 0, where branches get their numbers, or from the low end where factors have no value at 0."""
    low, high = between
    start = 0.0
    if low > 0:
        try:
            system_at(0.0)
        except CaseError:
            start = low
    return SystemFamily(system_at, (start, high), options, damped=damped, own=own, touching_at=touching_at)


def wide(matrix: Sparse) -> Sparse:
    """A matrix whose products are taken in extended precision."""
    return sp.csr_array(matrix, dtype=np.longdouble)


def deviation(one: Sparse, other: Sparse) -> float:
    """Largest difference of two matrices, each entry over the largest of its row and column."""
    apart = sp.coo_array(one - other)
    if not apart.nnz or not np.any(apart.data):
        return 0.0
    sizes = abs(one) + abs(other)
    rows, columns = (np.asarray(sizes.max(axis=a).toarray()).ravel() for a in (1, 0))
    scale = np.sqrt(rows[apart.row] * columns[apart.col])
    return float(np.max(np.abs(apart.data) / np.maximum(scale, 1e-300)))


def _mirrored(mass: Sequence[Sparse], damping: Sequence[Sparse], stiffness: Sequence[Sparse]) -> bool:
    """Whether nothing works on velocities, or gyroscopic forces alone do and all others have a potential."""
    if not any(d.nnz and np.any(d.data) for d in damping):
        return True
    potential = all(deviation(m, sp.csr_array(m.T)) <= EXACT for m in (*mass, *stiffness))
    return potential and all(deviation(d, sp.csr_array(-d.T)) <= EXACT for d in damping)


def _leja(low: float, high: float, count: int) -> list[float]:
    """Points of [low, high], each as far from those before as may be: interpolation stays stable with any number."""
    grid = low + (high - low) * (1 - np.cos(np.linspace(0, np.pi, 257))) / 2
    points = [low, high]
    distance = np.abs(grid - low) * np.abs(grid - high)
    while len(points) < count:
        points.append(float(grid[np.argmax(distance)]))
        distance = distance * np.abs(grid - points[-1]) * 4 / (high - low)
    return points

"""Making a reduced model: real modes, first answers to every term, residuals of the worst points, then a cut.

One factorisation serves all: A₀ = K_s + s M_s, the symmetric part of the problem at the middle of the box. Vectors are
taken in as A₀⁻¹ times what friction, contact stiffness and damping leave unbalanced, from the right and from the left,
first for the modes themselves, then at points of the box, where next is the one whose residuals are largest. At the
end the basis is cut down to what the modes at those points need (singular values of all of them), as far as their
eigenvalues stay within the bound.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import scipy.linalg as sl
import scipy.sparse as sp

from ...direct import Factor, factorise
from ...errors import AnalysisError, CaseError
from ...threads import one_thread
from ...typing import Array, ComplexArray, IntArray, Sparse
from .basis import Basis, Indefinite, expanded, real_and_imaginary, residual
from .dense import DenseModes, assembled, dense_modes
from .model import ReducedModel, product_over_slope, sketched
from .problem import ParametricProblem

BLOCK, SEED = 24, 20061
GUARD = 1.5  # real modes up to this much above the band take part
MARGIN = 1.03  # modes up to this much above it are made exact
SHIFT = 0.3  # √s over the band
WEAKEST = 1e-3  # of the strongest direction of a block of residuals: what waits for another point
LEFT_OUT = 1e-2  # of a unit vector: new directions smaller than this are not worth a column
SKETCH, NONZEROS = 300, 4  # rows of the random embedding, entries in each of its columns
PASSED = 0.3  # of the bound: what an estimate at a point of the grid may be
SAFETY = 10.0  # the constant of error estimates over the largest one seen
MOST_POINTS = 40


@dataclass
class _Work:
    """What making a model takes, by part."""

    seconds: dict[str, float] = field(default_factory=dict[str, float])
    solves: int = 0
    _last: float = field(default_factory=time.perf_counter)

    def lap(self, part: str) -> None:
        now = time.perf_counter()
        self.seconds[part] = self.seconds.get(part, 0.0) + now - self._last
        self._last = now


@one_thread
def reduce(
    problem: ParametricProblem,
    max_frequency_hz: float,
    *,
    bound: float = 1e-8,
    counts: tuple[int, ...] | None = None,
    solver: str | None = None,
) -> ReducedModel:
    """A reduced model for all modes up to ``max_frequency_hz`` and all parameters in the box.

    bound: relative error of the eigenvalues. counts: candidate points along each parameter (by default 3, of two
    parameters or more, else 5). Raises CaseError for a frequency or a bound that is none, AnalysisError where the bound
    is not reached.
    """
    if not (np.isfinite(max_frequency_hz) and max_frequency_hz > 0):
        raise CaseError("max_frequency_hz", max_frequency_hz, "a positive frequency in Hz")
    if not 1e-13 <= bound < 1:
        raise CaseError("bound", bound, "a relative error from 1e-13 to 1")
    frequency = 2 * np.pi * max_frequency_hz
    work = _Work()
    mass, stiffness = symmetric_parts(problem)
    operator, scale = static_operator(mass, stiffness, frequency)
    default = tuple(5 if len(problem.parameters) == 1 else 3 for _ in problem.parameters)
    points = problem.corners(counts or default)
    embedding = embedding_of(problem.size, scale)
    with factorise(operator, symmetric=True, solver=solver) as factor:
        work.lap("factorisation")
        start = _krylov(factor, mass, stiffness, frequency, work)
        work.lap("real modes")
        # Lengths are energies; where friction in the symmetric part makes some negative, the diagonal's.
        metrics = [operator, sp.csr_array(sp.diags_array(scale**-2))]
        for metric in metrics[1:] if factor.inertia else metrics:
            basis = Basis(problem, metric, embedding)
            try:
                basis.add(start, 1e-6)
                _first_answers(basis, factor, frequency, work)
                work.lap("first answers")
                passed = _enrich(basis, factor, points, scale, frequency, bound, work)
                work.lap("enrichment")
                break
            except Indefinite:
                continue
        else:
            raise AnalysisError("the mass or the stiffness has no positive diagonal to measure by")
    return _cut(basis, passed, frequency, bound, work)


def static_operator(mass: Sparse, stiffness: Sparse, frequency: float) -> tuple[Sparse, Array]:
    """A₀ = K_s + s M_s (n, n) of a band [1/s], and the lengths D^{-1/2} (n,) of its diagonal by which forces are
    scaled."""
    operator = sp.csr_array(stiffness + (SHIFT * frequency) ** 2 * mass)
    return operator, 1.0 / np.sqrt(np.abs(operator.diagonal()))


def symmetric_parts(problem: ParametricProblem) -> tuple[Sparse, Sparse]:
    """Symmetric parts of M and K (n, n) at the middle of the box.

    Raises AnalysisError for a stiffness that has none to speak of.
    """
    parts: dict[str, Sparse] = {}
    factors = problem.factors(problem.reference)
    for role in ("mass", "stiffness"):
        total = sp.csr_array((problem.size, problem.size))
        for term, factor in zip(problem.terms, factors, strict=True):
            if term.role == role and factor:
                whole = term.matrix if term.symmetric else (term.matrix + term.matrix.T) / 2
                # Friction's symmetric part is not definite and belongs to what is answered for later.
                if term.symmetric or _mostly_symmetric(term.matrix):
                    total = total + factor * whole
        parts[role] = sp.csr_array(total)
    if not parts["stiffness"].nnz or not parts["mass"].nnz:
        raise AnalysisError("the problem has no symmetric mass and stiffness to start from")
    return parts["mass"], parts["stiffness"]


def _mostly_symmetric(matrix: Sparse) -> bool:
    odd = sp.csr_array(matrix - matrix.T)
    return sl.norm(odd.data) <= 0.5 * sl.norm(sp.csr_array(matrix).data) if matrix.nnz else True


def _krylov(factor: Factor, mass: Sparse, stiffness: Sparse, frequency: float, work: _Work) -> Array:
    """Real modes (n, k) up to GUARD times the band: block Krylov space of A₀⁻¹M, orthonormal in the metric, grown until
    they have settled to some digits. They only start the basis."""
    n = mass.shape[0]
    shift = (SHIFT * frequency) ** 2
    block = np.random.default_rng(SEED).standard_normal((n, min(BLOCK, n)))
    vectors, images = np.zeros((n, 0)), np.zeros((n, 0))
    known = np.zeros(0)
    while True:
        block = factor.solve(mass @ block, refine=False)
        work.solves += block.shape[1]
        for _ in range(2):
            block = block - vectors @ (images.T @ block)
            block = np.linalg.qr(block)[0]
        image = mass @ block
        vectors, images = np.hstack([vectors, block]), np.hstack([images, image])
        # Orthonormalised in the mass, so that Ritz values are those of the pencil.
        gram = block.T @ image
        squares, turn = sl.eigh((gram + gram.T) / 2)
        good = squares > 1e-12 * squares[-1]
        turn = turn[:, good] / np.sqrt(squares[good])
        block, image = block @ turn, image @ turn
        vectors = np.hstack([vectors[:, : -gram.shape[0]], block])
        images = np.hstack([images[:, : -gram.shape[0]], image])
        projected = vectors.T @ (stiffness @ vectors)
        values, shapes = sl.eigh((projected + projected.T) / 2)
        low = values[values < (GUARD * frequency) ** 2]
        enough = len(values) > len(low) and len(known) >= len(low)
        if enough and np.all(np.abs(known[: len(low)] - low) <= 1e-3 * (np.abs(low) + shift)):
            return vectors @ shapes[:, : min(len(low) + 4, len(values))]
        if not block.shape[1] or vectors.shape[1] >= n:
            return vectors @ shapes[:, : min(len(low) + 4, len(values))]
        known = values


def _first_answers(basis: Basis, factor: Factor, frequency: float, work: _Work) -> None:
    """What every term that varies or has no part in A₀ makes of the modes of the band, from both sides."""
    problem = basis.problem
    mass, _, stiffness = assembled(basis.projected, problem.factors(problem.reference), problem.powers)
    squares, turn = sl.eigh((stiffness + stiffness.T) / 2, (mass + mass.T) / 2)
    shapes = basis.vectors @ turn[:, squares < (MARGIN * frequency) ** 2]
    forces: list[Array] = []
    corners = [problem.factors(c) for c in problem.corners([2] * len(problem.parameters))]
    for j, term in enumerate(problem.terms):
        varies = any(abs(c[j] - corners[0][j]) > 0 for c in corners)
        if term.role == "damping" or varies or not term.symmetric:
            forces.append(term.matrix @ shapes)
            if not term.symmetric:
                forces.append(term.matrix.T @ shapes)
    if forces:
        force = np.hstack(forces)
        basis.add(factor.solve(force, refine=False), WEAKEST)
        work.solves += force.shape[1]


def _enrich(
    basis: Basis, factor: Factor, points: list[dict[str, float]], scale: Array, frequency: float, bound: float,
    work: _Work,
) -> list[DenseModes]:  # fmt: skip
    """Answers to the residuals of one point after the other, the outer ones first, until every mode at every point
    passes the bound; the modes that did, on the basis as it was then."""
    problem = basis.problem
    pending = _outer_first(points)
    passed: list[DenseModes] = []
    whole = False
    for _ in range(MOST_POINTS):
        if not pending:
            return passed
        place = pending.pop(0)
        factors = problem.factors(points[place])
        matrices = assembled(basis.projected, factors, problem.powers)
        found = dense_modes(*matrices, frequency, MARGIN, whole=whole)
        lam, powers, whole = found.values, problem.powers, found.whole
        sizes = [
            sketched(sketch, factors, powers, lam, vectors)
            for sketch, vectors in ((basis.right_sketch, found.right), (basis.left_sketch, found.left))
        ]
        error = product_over_slope(matrices, found, *sizes)
        if not np.any(error > PASSED * bound):
            passed.append(found)
            continue
        # Modes far below the bound leave nothing that another point will not ask for.
        chosen = error > 0.01 * bound
        rests: list[Any] = []
        for left, vectors in ((False, found.right), (True, found.left)):
            x = expanded(basis.vectors, vectors[:, chosen])
            rests.append(residual(problem, factors, lam[chosen], x, left=left) * scale[:, None])
        rest = np.hstack([real_and_imaginary(r) for r in rests])
        squares, turn = sl.eigh(rest.T @ rest)
        keep = squares > max(WEAKEST**2 * squares[-1], 1e-300)
        force = (rest @ (turn[:, keep] / np.sqrt(squares[keep]))) / scale[:, None]
        answer = factor.solve(force, refine=False)
        work.solves += force.shape[1]
        if basis.add(answer, LEFT_OUT) or basis.add(answer, 1e-3 * LEFT_OUT):
            pending.append(place)
    raise AnalysisError(
        f"the reduced model does not settle over the box after {MOST_POINTS} points; ask for a smaller box, a lower "
        "frequency or a larger bound"
    )


def _outer_first(points: list[dict[str, float]]) -> list[int]:
    """The corners first, opposite ones one after the other: they are furthest from the middle, where A₀ is exact."""
    names = list(points[0])
    table = np.array([[p[name] for name in names] for p in points])
    span = np.maximum(np.ptp(table, axis=0), 1e-300)
    away = np.abs((table - table.mean(axis=0)) / span).sum(axis=1)
    return [int(i) for i in np.argsort(-away, kind="stable")]


def _cut(basis: Basis, passed: list[DenseModes], frequency: float, bound: float, work: _Work) -> ReducedModel:
    """The basis cut down as far as eigenvalues at points between those it was made for allow."""
    problem = basis.problem
    shots: list[Array] = []
    for found in passed:
        both = np.hstack([real_and_imaginary(found.right), real_and_imaginary(found.left)])
        shots.append(np.vstack([both, np.zeros((basis.count - len(both), both.shape[1]))]))
    left, size, _ = sl.svd(np.hstack(shots), full_matrices=False)
    whole = passed[-1].whole
    between = points_between(problem)
    exact: list[ComplexArray] = []
    for point in between:
        matrices = assembled(basis.projected, problem.factors(point), problem.powers)
        found = dense_modes(*matrices, frequency, MARGIN, whole=whole)
        whole = found.whole
        exact.append(found.values)
    work.lap("points between")
    cut = 3e-4
    while True:
        turn = left[:, size > cut * size[0]]
        projected = np.einsum("ri,jrs,sk->jik", turn, basis.projected, turn, optimize=True)
        worst = 0.0
        for point, values in zip(between, exact, strict=True):
            matrices = assembled(projected, problem.factors(point), problem.powers)
            found = dense_modes(*matrices, frequency, MARGIN, whole=whole).values
            inner = values[np.abs(values) <= frequency]
            if len(inner):
                away = np.abs(inner[:, None] - found).min(axis=1, initial=np.inf) / np.abs(inner)
                worst = max(worst, float(away.max()))
        if worst <= 0.2 * bound or turn.shape[1] == left.shape[1]:
            break
        cut /= 1.4
    vectors = basis.vectors @ turn
    work.lap("cut")
    sketches = basis.right_sketch @ turn, basis.left_sketch @ turn
    constant = _constant(problem, projected, sketches, between, exact, frequency, whole)
    work.lap("sketches")
    return ReducedModel(
        problem, vectors, projected, *sketches, frequency, constant, bound, dict(work.seconds), work.solves, whole
    )


def points_between(problem: ParametricProblem) -> list[dict[str, float]]:
    """As many points as a box has sides and one more, in no relation to the grid."""
    rng = np.random.default_rng(SEED)
    count = 2 * len(problem.parameters) + 1
    low, high = (np.array([getattr(p, end) for p in problem.parameters]) for end in ("low", "high"))
    return [problem.point([float(v) for v in low + (high - low) * rng.random(len(low))]) for _ in range(count)]


def embedding_of(size: int, scale: Array) -> Sparse:
    """Θ D^{-1/2} (s, n) with a sparse sign embedding Θ: NONZEROS entries ±1/√NONZEROS in each column."""
    rng = np.random.default_rng(SEED)
    place: IntArray = rng.integers(0, SKETCH, size=(size, NONZEROS))
    sign = rng.choice([-1.0, 1.0], size=(size, NONZEROS)) / np.sqrt(NONZEROS)
    column = np.repeat(np.arange(size), NONZEROS)
    return sp.csr_array(((sign * scale[:, None]).ravel(), (place.ravel(), column)), shape=(SKETCH, size))


def _constant(
    problem: ParametricProblem, projected: Array, sketches: tuple[Array, Array], between: list[dict[str, float]],
    exact: list[ComplexArray], frequency: float, whole: bool,
) -> float:  # fmt: skip
    """The factor of the error estimate: the largest found, kept SAFETY times larger, at least 1 as the inverse of a
    matrix scaled by its diagonal has it."""
    ratio = 0.0
    for point, values in zip(between, exact, strict=True):
        factors = problem.factors(point)
        matrices = assembled(projected, factors, problem.powers)
        found = dense_modes(*matrices, frequency, 1.0, whole=whole)
        right, left = (
            sketched(s, factors, problem.powers, found.values, v)
            for s, v in zip(sketches, (found.right, found.left), strict=True)
        )
        estimate = product_over_slope(matrices, found, right, left)
        away = np.abs(found.values[:, None] - values).min(axis=1, initial=np.inf) / np.abs(found.values)
        ratio = max(ratio, float(np.max(away / np.maximum(estimate, 1e-300), initial=0.0)))
    return max(SAFETY * ratio, 1.0)

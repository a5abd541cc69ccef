"""Making a reduced model: real modes, first answers to every term, then residuals all over the box and a cut.

One factorisation serves all: A₀ = K_s + s M_s, the symmetric part of the problem at the middle of the box. Vectors are
taken in as A₀⁻¹ times what friction, contact stiffness and damping leave unbalanced, from the right and from the left,
first for the modes themselves, then at points of the box (`greedy`). Modes that these never lead to are asked of the
full problem (`asked_in_full`).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.linalg as sl
import scipy.sparse as sp

from ...direct import Factor, factorise
from ...errors import AnalysisError, CaseError
from ...stages import passing, stage
from ...threads import one_thread
from ...typing import Array, IntArray, Sparse
from ..quadratic.reach import reaches, searched_in
from ..shift_inverted import undamped_pairs
from .asked_in_full import complete
from .basis import Indefinite, ReducedBasis
from .dense import assembled
from .greedy import GUARD, MARGIN, SEED, Greedy, ReductionCost, grid_points
from .model import ReducedModel
from .problem import ParametricProblem

BLOCK = 24
CONVERGED = 1e-2  # of λ²: real modes only start the basis
FAINT = 1e-2  # of a unit vector: first answers smaller than this are left out
SHIFT = 0.3  # √s over the band
SKETCH, NONZEROS = 300, 4  # rows of the random embedding, entries in each of its columns


@passing()
@one_thread
def reduce(
    problem: ParametricProblem,
    max_frequency_hz: float,
    *,
    bound: float = 1e-8,
    counts: tuple[int, ...] | None = None,
    solver: str | None = None,
    sure: bool = True,
) -> ReducedModel:
    """A reduced model for all modes up to ``max_frequency_hz`` and all parameters in the box.

    bound: relative error of the eigenvalues. counts: candidate points along each parameter (by default 5 of a single
    one, 3 of two or three, 2 of more); points in no relation to the grid have to pass as well. sure: ask the full
    problem for modes that the model lacks (`asked_in_full`) even where it has some. Raises CaseError for a frequency or
    a bound that is none, AnalysisError where the bound is not reached.
    """
    if not (np.isfinite(max_frequency_hz) and max_frequency_hz > 0):
        raise CaseError("max_frequency_hz", max_frequency_hz, "a positive frequency in Hz")
    if not 1e-13 <= bound < 1:
        raise CaseError("bound", bound, "a relative error from 1e-13 to 1")
    asked = 2 * np.pi * max_frequency_hz
    frequency = asked if reaches(problem.at(problem.reference), asked) else searched_in(
        [problem.at(point) for point in problem.sampled], asked
    )
    work = ReductionCost()
    mass, stiffness = symmetric_parts(problem)
    stage(f"reduced model of {problem.size} freedoms: factors and modes at rest")
    operator, scale = static_operator(mass, stiffness, frequency)
    if np.any(operator.diagonal() == 0.0):
        raise AnalysisError("some freedoms have neither stiffness nor mass of their own, as multipliers have it")
    embedding = embedding_of(problem.size, scale)
    with factorise(operator, symmetric=True, solver=solver) as factor:
        work.lap("factorisation")
        start = _krylov(factor, mass, stiffness, frequency, work)
        work.lap("real modes")
        # Lengths are energies; where friction in the symmetric part makes some negative, the diagonal's.
        metrics = [operator, sp.csr_array(sp.diags_array(scale**-2))]
        for metric in metrics[1:] if factor.inertia else metrics:
            basis = ReducedBasis(problem, metric, embedding)
            try:
                basis.add(start, 1e-6)
                _first_answers(basis, factor, frequency, work)
                work.lap("first answers")
                growing = Greedy(basis, operator, factor, frequency, bound, work)
                grid = grid_points(problem, counts)
                growing.enrich(grid)
                work.lap("enrichment")
                complete(growing, grid, sure=sure, solver=solver)
                work.lap("full problem")
                return replace(growing.cut(), frequency=asked)
            except Indefinite:
                continue
    raise AnalysisError("the mass or the stiffness has no positive diagonal to measure by")


def static_operator(mass: Sparse, stiffness: Sparse, frequency: float) -> tuple[Sparse, Array]:
    """A₀ = K_s + s M_s (n, n) of a band [1/s], and the lengths D^{-1/2} (n,) of its diagonal by which forces are
    scaled; rows whose diagonal is zero, as multipliers have them, are measured by their largest entry."""
    operator = sp.csr_array(stiffness + (SHIFT * frequency) ** 2 * mass)
    size = np.abs(operator.diagonal())
    empty = np.flatnonzero(size == 0.0)
    if len(empty):
        size[empty] = np.asarray(abs(operator[empty]).max(axis=1).toarray()).ravel()
    return operator, 1.0 / np.sqrt(np.where(size > 0.0, size, 1.0))


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


def _krylov(factor: Factor, mass: Sparse, stiffness: Sparse, frequency: float, work: ReductionCost) -> Array:
    """Real modes (n, k) up to GUARD times the band: block Krylov space of A₀⁻¹M, orthonormal in the metric, grown until
    they have settled to some digits. They only start the basis."""
    n = mass.shape[0]
    shift = (SHIFT * frequency) ** 2
    image = mass @ np.random.default_rng(SEED).standard_normal((n, min(BLOCK, n)))
    # Room for all: growing by copies would cost as much as multiplying.
    room, count = [np.empty((n, 0), order="F")] * 2, 0
    projected = np.zeros((0, 0))
    known = np.zeros(0)
    while True:
        block = factor.solve(image, refine=False)
        work.solves += block.shape[1]
        if count + block.shape[1] > room[0].shape[1]:
            wider = [np.empty((n, 2 * count + 8 * BLOCK), order="F") for _ in room]
            for new, old in zip(wider, room, strict=True):
                new[:, :count] = old[:, :count]
            room = wider
        vectors, images = (part[:, :count] for part in room)
        for _ in range(2):
            block = block - vectors @ (images.T @ block)
        # Orthonormalised in the mass, so that Ritz values are those of the pencil.
        image = mass @ block
        gram = block.T @ image
        squares, turn = sl.eigh((gram + gram.T) / 2)
        good = squares > max(1e-12 * squares[-1], 1e-300)
        turn = turn[:, good] / np.sqrt(squares[good])
        block, image = block @ turn, image @ turn
        force = stiffness @ block
        across = vectors.T @ force
        projected = np.block([[projected, across], [across.T, block.T @ force]])
        for part, new in zip(room, (block, image), strict=True):
            part[:, count : count + new.shape[1]] = new
        count += block.shape[1]
        vectors = room[0][:, :count]
        values, shapes = sl.eigh((projected + projected.T) / 2)
        low = values[values < (GUARD * frequency) ** 2]
        enough = len(values) > len(low) and len(known) >= len(low)
        if enough and np.all(np.abs(known[: len(low)] - low) <= CONVERGED * (np.abs(low) + shift)):
            return vectors @ shapes[:, : min(len(low) + 4, len(values))]
        if not block.shape[1] or vectors.shape[1] >= n:
            return vectors @ shapes[:, : min(len(low) + 4, len(values))]
        known = values


def _first_answers(basis: ReducedBasis, factor: Factor, frequency: float, work: ReductionCost) -> None:
    """What every term that varies or has no part in A₀ makes of the modes of the band, from both sides."""
    problem = basis.problem
    mass, _, stiffness = assembled(basis.projected, problem.factors(problem.reference), problem.powers)
    shapes = basis.vectors @ _undamped((mass + mass.T) / 2, (stiffness + stiffness.T) / 2, frequency)
    forces: list[Array] = []
    corners = [problem.factors(c) for c in problem.corners([2] * len(problem.parameters))]
    for j, term in enumerate(problem.terms):
        if j in basis.shares:
            # Mass and stiffness make nothing new of the modes.
            continue
        varies = any(abs(c[j] - corners[0][j]) > 0 for c in corners)
        if term.role == "damping" or varies or not term.symmetric:
            forces.append(term.matrix @ shapes)
            if not term.symmetric:
                forces.append(term.matrix.T @ shapes)
    if forces:
        force = np.hstack(forces)
        basis.add(factor.solve(force, refine=False), FAINT)
        work.solves += force.shape[1]


def _undamped(mass: Array, stiffness: Array, frequency: float) -> Array:
    """Undamped modes (r, k) of the band, of symmetric matrices (r, r). A mass that is singular, as freedoms without
    any make it, is no obstacle: K + s M is what is factorised."""
    shift = (SHIFT * frequency) ** 2
    try:
        inverse, turn = sl.eigh(mass, stiffness + shift * mass)
    except sl.LinAlgError:  # that is not positive definite
        shapes = undamped_pairs(mass, stiffness, SHIFT * frequency, MARGIN / SHIFT)[1]
        return np.hstack([shapes.real, shapes.imag[:, np.any(shapes.imag, axis=0)]])
    return turn[:, inverse * ((MARGIN * frequency) ** 2 + shift) > 1.0]


def embedding_of(size: int, scale: Array) -> Sparse:
    """Θ D^{-1/2} (s, n) with a sparse sign embedding Θ: NONZEROS entries ±1/√NONZEROS in each column."""
    rng = np.random.default_rng(SEED)
    row: IntArray = rng.integers(0, SKETCH, size=(size, NONZEROS))
    sign = rng.choice([-1.0, 1.0], size=(size, NONZEROS)) / np.sqrt(NONZEROS)
    column = np.repeat(np.arange(size), NONZEROS)
    return sp.csr_array(((sign * scale[:, None]).ravel(), (row.ravel(), column)), shape=(SKETCH, size))

"""Craig–Bampton reduction, for those who ask for it by name, with its error shown as that of any reduced model.

Every body keeps its modes with the contact interface held and the static answers to unit motions of the interface
(Craig and Bampton, AIAA J. 6(7), 1968). It knows nothing of damping, friction or the box: what that costs is what the
error estimates say.
"""

from __future__ import annotations

import time

import numpy as np
import scipy.sparse as sp

from ...direct import Factor, factorise
from ...direct.lowest import modes_below
from ...errors import CaseError
from ...threads import one_thread
from ...typing import IntArray
from ..dense_problem import combined
from .basis import ReducedBasis, residual
from .dense import assembled, dense_modes
from .greedy import SAFETY, random_points
from .model import ReducedModel, sketched
from .offline import SHIFT, embedding_of, symmetric_parts
from .problem import ParametricProblem

WIDEST = 1500  # interface freedoms that can be kept
MOST_MODES = 800


@one_thread
def craig_bampton(
    problem: ParametricProblem,
    max_frequency_hz: float,
    *,
    beyond: float = 2.0,
    interface: IntArray | None = None,
    bound: float = 1e-8,
    solver: str | None = None,
) -> ReducedModel:
    """A reduced model on fixed-interface modes up to ``beyond`` times the frequency and static interface shapes.

    interface (b,): freedoms of the interface, by default those of all terms that are not symmetric or work on few
    freedoms (contact). Raises CaseError for an interface that is empty or too wide, AnalysisError where the inner part
    is singular.
    """
    if not (np.isfinite(max_frequency_hz) and max_frequency_hz > 0):
        raise CaseError("max_frequency_hz", max_frequency_hz, "a positive frequency in Hz")
    started = time.perf_counter()
    frequency = 2 * np.pi * max_frequency_hz
    mass, stiffness = symmetric_parts(problem)
    edge = _interface(problem) if interface is None else np.unique(interface)
    if not 0 < len(edge) <= WIDEST:
        raise CaseError("interface", len(edge), f"1 to {WIDEST} freedoms; reduce(…) has no interface to keep")
    inner = np.setdiff1d(np.arange(problem.size), edge)
    inside = sp.csr_array(stiffness[inner][:, inner])
    moving = sp.csr_array(mass[inner][:, inner])
    # Bodies held at their interface alone may still move as a whole: a shift keeps that regular.
    shift = (1e-3 * frequency) ** 2
    with factorise(sp.csr_array(inside + shift * moving), symmetric=True, solver=solver) as factor:
        static = np.zeros((problem.size, len(edge)))
        static[edge, np.arange(len(edge))] = 1.0
        coupling = sp.csr_array(stiffness[inner][:, edge])
        static[inner] = -factor.solve(coupling.toarray(), refine=False)
        held = modes_below(inside, moving, factor.solve, shift, beyond * frequency, MOST_MODES)
    shapes = np.zeros((problem.size, held.shape[1]))
    shapes[inner] = held
    metric = sp.csr_array(stiffness + (SHIFT * frequency) ** 2 * mass)
    scale = 1.0 / np.sqrt(np.abs(metric.diagonal()))
    basis = ReducedBasis(problem, sp.csr_array(sp.diags_array(scale**-2)), embedding_of(problem.size, scale))
    basis.add(np.hstack([static, shapes]), 1e-7)
    projected, sketches = basis.projected, (basis.right_sketch, basis.left_sketch)
    with factorise(metric, symmetric=True, solver=solver) as factor:
        constant = _constant(basis, factor, frequency)
    seconds = {"component modes": time.perf_counter() - started}
    return ReducedModel(
        problem, basis.vectors.copy(), projected, *sketches, frequency, constant, bound, seconds,
        len(edge) + held.shape[1],
    )  # fmt: skip


def _constant(basis: ReducedBasis, factor: Factor, frequency: float) -> float:
    """The factor of the error estimate: what residuals of both sides make of each other through A₀⁻¹, the second-order
    error of λ but for what A₀ is not, over the product of their lengths."""
    problem = basis.problem
    ratio = 0.0
    for point in random_points(problem, 2 * len(problem.parameters) + 1):
        factors, powers = problem.factors(point), problem.powers
        matrices = assembled(basis.projected, factors, powers)
        found = dense_modes(*matrices, frequency, 1.0)
        right = residual(problem, factors, found.values, combined(basis.vectors, found.right))
        left = residual(problem, factors, found.values, combined(basis.vectors, found.left), left=True)
        through = np.abs(np.einsum("ij,ij->j", left, factor.solve(right, refine=False)))
        lengths = (
            sketched(sketch, factors, powers, found.values, vectors)
            for sketch, vectors in ((basis.right_sketch, found.right), (basis.left_sketch, found.left))
        )
        ratio = max(ratio, float(np.max(through / np.maximum(np.prod(list(lengths), axis=0), 1e-300), initial=0.0)))
    return max(SAFETY * ratio, 1.0)


def _interface(problem: ParametricProblem) -> IntArray:
    """Freedoms of the terms that are not symmetric or touch few freedoms."""
    found: list[IntArray] = []
    for term in problem.terms:
        coo = sp.coo_array(term.matrix)
        touched = np.union1d(coo.row, coo.col)
        if term.role == "stiffness" and (not term.symmetric or len(touched) < 0.5 * problem.size):
            found.append(touched)
    return np.unique(np.concatenate(found)) if found else np.zeros(0, dtype=np.int64)

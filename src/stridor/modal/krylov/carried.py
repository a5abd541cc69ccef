"""Shapes that the basis of one stretch of μ hands on to the next, in which a few other nodes touch, or that of one
system to another, with a mass more at one of its nodes.

Where contact has a stiffness, a shape u is one of every set of touching nodes, with the forces p = −N u / c that these
have of it: nodes that touched before keep theirs, which are right to more digits. So the next basis begins with the
modes of the last one and what friction made of them, and is enriched from there. Whether no frictionless mode lacks is
counted anew, whichever way a basis began.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import scipy.linalg as sl
import scipy.sparse as sp

from ...errors import AnalysisError
from ...typing import Array, ComplexArray, IntArray, Sparse
from .forces import principal
from .kept_factors import KeptFactors
from .problem import ContactProblem
from .reduced import Reduced
from .shifted import ForcedShapes, Shifted, real_columns

LEVELS = 3  # of what answers to the forces of nodes that changed
MOST_CHANGED = 8  # of these forces; of more the sweeps make fewer vectors, and of more freedoms a basis is made anew
STIFFEST = 1e3  # times the structure's stiffness: forces of contact stiffer than that are not told by its displacement


@dataclass
class Carried:
    """Shapes that the last basis had, with the forces of its ``problem``, frictionless modes first, of which there are
    ``modes``, for a band up to ``frequency`` [1/s]; empty at first. at_end: asked for exact shapes
    (n, k) at the high end of the stretch, which the full problem is solved for anyhow; None where it has none. factors:
    those of the stretches before, for where nodes only open."""

    at_end: Callable[[], ComplexArray | None] | None = None
    shapes: ForcedShapes | None = None
    problem: ContactProblem | None = None
    modes: int = 0
    frequency: float = 0.0
    factors: KeptFactors = field(default_factory=KeptFactors)
    inner: tuple[bool, bool] = (False, False)

    def exact_at_end(self, problem: ContactProblem) -> ForcedShapes | None:
        """What ``at_end`` gives, in real columns with forces of contact that close the gaps; None without it."""
        found = None if self.at_end is None or not _tells_forces(problem) else self.at_end()
        if found is None or not found.shape[1]:
            return None
        shapes = real_columns(found)
        return ForcedShapes(shapes, -(problem.normal @ shapes) / problem.compliance[:, None])

    def fit(self, problem: ContactProblem, frequency: float) -> bool:
        """Whether a basis of the problem up to a frequency [1/s] can begin with them."""
        if self.shapes is None or frequency != self.frequency or len(self.shapes.u) != problem.size:
            return False
        assert self.problem is not None, "they have forces"
        return _tells_forces(problem) and len(_other_freedoms(self.problem, problem)) <= MOST_CHANGED

    def basis(self, problem: ContactProblem, shifted: Shifted, top: float, highest: float) -> tuple[Reduced, Array]:
        """The problem on them, and ω² (k,) of its modes without friction, ascending."""
        assert self.shapes is not None, "only where they fit"
        assert self.problem is not None, "they have forces"
        forces = -(problem.normal @ self.shapes.u) / problem.compliance[:, None]
        now, before = _alike(problem, self.problem)
        forces[now] = self.shapes.p[before]
        every = ForcedShapes(self.shapes.u, forces)
        first = np.eye(every.count)[:, : self.modes]
        reduced = Reduced(problem, shifted, every.combined(first), top, highest)
        reduced.add(every.combined(np.eye(every.count)[:, self.modes :]))
        _answer(reduced, _changed(self.problem, problem))
        return reduced, _frictionless(reduced)[0]

    def take(self, reduced: Reduced, beyond: float, *, last: bool = False) -> None:
        """Keep the modes without friction up to ``beyond`` times the band, and what the basis has found to be exact,
        with ``last`` at the last μ alone."""
        squares, vectors = _frictionless(reduced)
        near = vectors[:, squares <= (beyond * reduced.frequency) ** 2]
        self.shapes = reduced.pairs.combined(np.hstack([near, reduced.exact_last if last else reduced.exact]))
        self.problem = reduced.problem
        self.modes, self.frequency = near.shape[1], reduced.frequency


def _alike(one: ContactProblem, other: ContactProblem) -> tuple[IntArray, IntArray]:
    """Places (k,) in two problems of the touching nodes that these have in common."""
    _, here, there = np.intersect1d(one.touching, other.touching, return_indices=True)
    same = (one.compliance[here] == other.compliance[there]) & (
        abs(one.normal[here] - other.normal[there]).sum(axis=1) == 0.0
    )
    return here[same], there[same]


def _other_freedoms(before: ContactProblem, now: ContactProblem) -> IntArray:
    """Freedoms on which another mass, damping or stiffness acts."""
    found: list[IntArray] = []
    for one, other in zip(_matrices(before), _matrices(now), strict=True):
        if one is not other:
            found.append(np.unique(sp.csr_array(one != other).indices))
    return np.unique(np.concatenate(found)) if found else np.zeros(0, dtype=np.int64)


def _matrices(problem: ContactProblem) -> tuple[Sparse, Sparse, Sparse]:
    return problem.mass, problem.damping, problem.stiffness


def _changed(before: ContactProblem, now: ContactProblem) -> Array:
    """Forces (n, k) on freedoms with another mass, damping or stiffness, and along the normals and the slip of nodes
    that touch in one of two problems alone."""
    here, there = _alike(before, now)
    rows: list[Sparse] = [sp.eye_array(now.size, format="csr")[_other_freedoms(before, now)]]
    for one, common in ((before, here), (now, there)):
        alone = np.setdiff1d(np.arange(len(one.touching)), common)
        rows += [one.normal[alone], one.slip[alone]]
    return np.asarray(sp.vstack(rows, format="csr").T.toarray())


def _answer(reduced: Reduced, force: Array) -> None:
    """Take in what forces (n, k) do, and what inertia and friction of that do in turn: a node that opens changes modes
    by these, which sweeps over all modes would bring one after the other."""
    problem = reduced.problem
    if not 0 < force.shape[1] <= MOST_CHANGED:
        return
    for _ in range(LEVELS):
        answer = ForcedShapes(*reduced.shifted.solve(principal(problem, force)))
        reduced.solves += answer.count
        reduced.add(answer)
        force = np.hstack([reduced.frequency**2 * (problem.mass @ answer.u), problem.slide.T @ answer.p])


def _tells_forces(problem: ContactProblem) -> bool:
    """Whether displacements tell the forces of every contact."""
    softest = 1.0 / (STIFFEST * float(np.abs(problem.stiffness.data).max(initial=0.0)) or 1.0)
    return bool(np.all(problem.compliance >= softest))


def _frictionless(reduced: Reduced) -> tuple[Array, Array]:
    """ω² (k,) ascending and modes (k, k) of the basis without friction."""
    stiffness = reduced.stiffness
    try:
        squares, vectors = sl.eigh((stiffness + stiffness.T) / 2)
    except sl.LinAlgError as error:
        raise AnalysisError("the modes of the last basis do not settle") from error
    return squares, vectors

"""Steps that solve with M + β2 Δt C where that is not diagonal: consistent mass, and damping that does not lag.

With all of C acting on the velocity at t_n the scheme of ``loop`` reads

    (M + β2 Δt C) a_n = f_n − K u_n − C q_n + Gᵀp_n,       q_{n+1} = q_n + Δt a_n,

one product with K and one band solve; C q_{n+1}, which the next step needs, gives v_n·C v_n as well, since C v_n =
(1 − β2) C q_n + β2 C q_{n+1}. A contact force moves every freedom of the bodies that it acts on: what a unit of it
does over a step is solved for once.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.linalg as sl
import scipy.sparse as sp
import scipy.sparse.linalg as spl

from ....errors import AnalysisError
from ....kernels import njit
from ....system import System
from ....typing import Array, Sparse
from ...aligned import aligned_zeros
from ...arithmetic import FAST
from ...beta2 import Scheme
from .node_stage import NodeScratch, NodeState
from .node_table import Answers, NodeTable
from .products import Fields, Structure, add_rows
from .storage import Blocks, Layout, upper_blocks


class StepMatrix(NamedTuple):
    """factor (size, b + 1) of M + β2ΔtC, LDLᵀ of a band: 1/D, then the columns of L below its diagonal. mass and
    damping in blocks; before (size,): q_n in the step to t_{n+1}, drag (size,): C q, empty without damping. All of it
    empty where the matrix is diagonal."""

    factor: Array
    mass: Blocks
    damping: Blocks
    before: Array
    drag: Array


def step_matrix(system: System, scheme: Scheme, layout: Layout) -> tuple[StepMatrix, Answers]:
    """The matrix of a system that is symmetric, and what unit forces along rows move over a step. Raises AnalysisError
    where it is not positive definite."""
    matrix = _on_entries(system.mass + scheme.beta2 * scheme.step * system.damping, layout)
    factor, gain = band_factor(matrix), scheme.step**2 * scheme.s / 2
    solve = spl.splu(sp.csc_array(matrix)).solve
    damped = bool(np.any(system.damping.data))

    def answers(rows: Sparse) -> Sparse:
        return sp.csr_array(gain * solve(rows.toarray().T).T if rows.shape[0] else rows)

    return StepMatrix(
        factor=factor,
        mass=upper_blocks(system.mass, layout),
        damping=upper_blocks(system.damping, layout),
        before=aligned_zeros((layout.size,)),
        drag=aligned_zeros((layout.size if damped else 0,)),
    ), answers


def no_step_matrix(layout: Layout, gain: Array) -> tuple[StepMatrix, Answers]:
    """What stands in its place where it is diagonal, and a unit force moves an entry by gain (size,) [m/N]."""
    nothing = Blocks(np.zeros(1, dtype=np.int64), np.zeros(0, dtype=np.int32), np.zeros((1, layout.width**2)))
    each, none = sp.diags_array(gain), aligned_zeros((0,))

    def answers(rows: Sparse) -> Sparse:
        return sp.csr_array(rows @ each)

    return StepMatrix(np.zeros((0, 1)), nothing, nothing, none, none), answers


def is_diagonal(matrix: Sparse, tolerance: float = 0.0) -> bool:
    """Whether nothing beside the diagonal is larger than a part of its largest entry."""
    off = sp.csr_array(matrix - sp.diags_array(matrix.diagonal()))
    return bool(np.all(np.abs(off.data) <= tolerance * np.abs(matrix.data).max(initial=0.0)))


def _on_entries(matrix: Sparse, layout: Layout) -> Sparse:
    """On all entries, with ones on the diagonal where there is no freedom."""
    coo = sp.coo_array(matrix)
    free = np.setdiff1d(np.arange(layout.size), layout.index)
    row, column = (np.concatenate([layout.index[each], free]) for each in (coo.row, coo.col))
    return sp.csr_array((np.concatenate([coo.data, np.ones(len(free))]), (row, column)), shape=(layout.size,) * 2)


def band_factor(matrix: Sparse) -> Array:
    """LDLᵀ (n, b + 1) of a symmetric positive definite band: column 0 is 1/D, column k the k-th subdiagonal of L."""
    coo = sp.coo_array(matrix)
    width = int(np.max(np.abs(coo.row - coo.col), initial=0))
    band = np.zeros((width + 1, coo.shape[1]))
    lower = coo.row >= coo.col
    band[(coo.row - coo.col)[lower], coo.col[lower]] = coo.data[lower]
    try:
        factor = sl.cholesky_banded(band, lower=True)
    except sl.LinAlgError as error:
        raise AnalysisError("the mass matrix is not positive definite: a freedom has stiffness but no mass") from error
    diagonal = factor[0].copy()
    factor = factor / diagonal
    factor[0] = 1.0 / diagonal**2
    return np.ascontiguousarray(factor.T)


@njit(cache=True)
def band_solve(factor: Array, x: Array) -> None:  # pragma: no cover - compiled
    """Solve LDLᵀ x = x in place."""
    size, width = x.shape[0], factor.shape[1] - 1
    for i in range(size):
        value = x[i]
        for k in range(1, min(width, size - 1 - i) + 1):
            x[i + k] -= factor[i, k] * value
        x[i] = factor[i, 0] * value
    for i in range(size - 1, -1, -1):
        value = x[i]
        for k in range(1, min(width, size - 1 - i) + 1):
            value -= factor[i, k] * x[i + k]
        x[i] = value


@njit(cache=True, fastmath=FAST)
def advance_whole(a: Structure, f: Fields, b: StepMatrix) -> None:  # pragma: no cover - compiled
    """One step without contact forces: u and q to t_{n+1}, b.before = q_n."""
    step, forth, back = a.numbers[0], a.numbers[2], a.numbers[3]
    u, q, y, push, before, drag = f.u, f.q, f.y[0], f.push, b.before, b.drag
    add_rows(a.stiffness, u, y, 0, a.stiffness.ptr.shape[0] - 1)
    for i in range(u.shape[0]):
        y[i] = push[i] - y[i]
    for i in range(drag.shape[0]):
        y[i] -= drag[i]
    band_solve(b.factor, y)
    for i in range(u.shape[0]):
        new = q[i] + step * y[i]
        u[i] += forth * new - back * q[i]
        before[i] = q[i]
        q[i] = new
        y[i] = 0.0


@njit(cache=True, fastmath=FAST)
def correct_whole(
    count: int, a: Structure, f: Fields, table: NodeTable, nodes: NodeState, work: NodeScratch
) -> None:  # pragma: no cover - compiled
    """Bring the contact forces into u and q at t_{n+1}, of all entries."""
    u, q, forth = f.u, f.q, a.numbers[2]
    for n in range(count):
        i = work.chosen[n]
        for r in range(table.act_at[i], table.act_at[i + 1]):
            force = 0.0
            for j in range(table.act.shape[1]):
                force += table.act[r, j] * nodes.force[i, j]
            if force != 0.0:
                answer, rate = table.answers[r], force / forth
                for e in range(u.shape[0]):
                    u[e] += force * answer[e]
                    q[e] += rate * answer[e]
    # To the last digit what a restart reads from the fields.
    for c in range(table.indices.shape[0]):
        work.u[c], work.q[c] = u[table.indices[c]], q[table.indices[c]]


@njit(cache=True, fastmath=FAST)
def take_drag(a: Structure, f: Fields, b: StepMatrix) -> float:  # pragma: no cover - compiled
    """C q at t_{n+1} into b.drag; the power v·C v at t_n."""
    if b.drag.shape[0] == 0:
        return 0.0
    beta2 = a.numbers[1]
    q, y, before, drag = f.q, f.y[0], b.before, b.drag
    add_rows(b.damping, q, y, 0, b.damping.ptr.shape[0] - 1)
    power = 0.0
    for i in range(q.shape[0]):
        v = (1.0 - beta2) * before[i] + beta2 * q[i]
        power += v * ((1.0 - beta2) * drag[i] + beta2 * y[i])
        drag[i] = y[i]
        y[i] = 0.0
    return power


@njit(cache=True, fastmath=FAST)
def kinetic_energy(f: Fields, b: StepMatrix) -> float:  # pragma: no cover - compiled
    """½ qᵀMq [J]; costs one product."""
    q, y = f.q, f.y[0]
    add_rows(b.mass, q, y, 0, b.mass.ptr.shape[0] - 1)
    kinetic = 0.0
    for i in range(q.shape[0]):
        kinetic += q[i] * y[i]
        y[i] = 0.0
    return 0.5 * kinetic

"""What imported matrices have beside their symmetric parts: circulatory and gyroscopic forces in the compiled loop.

With K = K_s + N and C = C_s + G, where N and G are skew, K_s and C_s go through the loop like any symmetric matrices,
and the rest is the force

    h_n = N u_n + G v_n,       v_n = (1 − β2) q_n + β2 q_{n+1},

against the motion. N acts on the displacement at t_n, as K_s does. G must act on the velocity at t_n: on q_n, half a
step older, a whirl at ω would take γ sin(ωΔt/2) too much growth from a force of the rate γ, forward or backward, and
extrapolated, 3/2 q_n − 1/2 q_{n−1}, still 2γ sin³(ωΔt/2), which modes near the limit of the step do not survive. With
v_n the power v·G v vanishes and takes nothing. q_{n+1} depends on h_n, through the contact forces as well, so both are
found in turn:

    q_{n+1} ← free motion without h_n, less kick∘h_n, with contact forces;       h_n ← N u_n + G v_n,

until q_{n+1} stays: a contraction by β2 Δt |M^(−1/2) G M^(−1/2)|, which `limit` keeps below a half.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from ....kernels import njit
from ....system import System
from ....typing import Array, IntArray, Sparse
from ...aligned import aligned_zeros
from .products import WITH_STIFFNESS, Fields, Structure
from .storage import Layout

CONVERGED = 1e-14  # of the largest q: change by a further pass
MOST_PASSES = 100


@dataclass(frozen=True)
class Halves:
    """Symmetric and skew parts (n, n) csr: stiffness + circulatory = K, damping + gyroscopic = C."""

    stiffness: Sparse
    damping: Sparse
    circulatory: Sparse
    gyroscopic: Sparse


def halves(system: System) -> Halves:
    """The parts of a system's matrices; of a symmetric one its own matrices and nothing beside them."""
    nothing = sp.csr_array((system.size, system.size))
    if system.symmetric_definite:
        return Halves(system.stiffness, system.damping, nothing, nothing)
    return Halves(
        _symmetric(system.stiffness), _symmetric(system.damping), _skew(system.stiffness), _skew(system.damping)
    )


def _symmetric(matrix: Sparse) -> Sparse:
    return sp.csr_array(0.5 * (matrix + matrix.T))


def _skew(matrix: Sparse) -> Sparse:
    skew = sp.csr_array(0.5 * (matrix - matrix.T))
    skew.eliminate_zeros()
    return skew


class SparseRows(NamedTuple):
    """Full csr rows on entries."""

    ptr: IntArray
    col: IntArray
    val: Array


class Unsymmetric(NamedTuple):
    """N and G as rows, and vectors on entries, all empty where nothing is unsymmetric: force h and the part of it that
    N makes; q_n; u and q at t_{n+1} without h and without contact forces."""

    circulatory: SparseRows
    gyroscopic: SparseRows
    force: Array
    of_displacement: Array
    q_before: Array
    u_free: Array
    q_free: Array


def unsymmetric(parts: Halves, layout: Layout) -> Unsymmetric:
    """Skew parts on the entries of a layout."""
    some = parts.circulatory.nnz or parts.gyroscopic.nnz
    size = layout.size if some else 0
    force, of_displacement, q_before, u_free, q_free = (aligned_zeros((size,)) for _ in range(5))
    circulatory, gyroscopic = (
        _rows(m, layout) if some else SparseRows(np.zeros(1, dtype=np.int64), np.zeros(0, dtype=np.int64), np.zeros(0))
        for m in (parts.circulatory, parts.gyroscopic)
    )
    return Unsymmetric(circulatory, gyroscopic, force, of_displacement, q_before, u_free, q_free)


def _rows(matrix: Sparse, layout: Layout) -> SparseRows:
    coo = sp.coo_array(matrix)
    shape = (layout.size, layout.size)
    rows = sp.csr_array((coo.data, (layout.index[coo.row], layout.index[coo.col])), shape=shape)
    rows.sort_indices()
    return SparseRows(rows.indptr.astype(np.int64), rows.indices.astype(np.int64), rows.data.astype(float))


@njit(cache=True)
def _add(m: SparseRows, x: Array, y: Array) -> None:  # pragma: no cover - compiled
    for i in range(y.shape[0]):
        total = 0.0
        for p in range(m.ptr[i], m.ptr[i + 1]):
            total += m.val[p] * x[m.col[p]]
        y[i] += total


@njit(cache=True)
def keep_before(f: Fields, x: Unsymmetric) -> None:  # pragma: no cover - compiled
    """What the force needs of t_n, before the structure goes on; its first guess from q_n."""
    for i in range(x.force.shape[0]):
        x.q_before[i] = f.q[i]
        x.of_displacement[i] = 0.0
    _add(x.circulatory, f.u, x.of_displacement)
    for i in range(x.force.shape[0]):
        x.force[i] = x.of_displacement[i]
    _add(x.gyroscopic, x.q_before, x.force)


@njit(cache=True)
def keep_free(f: Fields, x: Unsymmetric) -> None:  # pragma: no cover - compiled
    """The motion to t_{n+1} without the force and without contact forces."""
    for i in range(x.force.shape[0]):
        x.u_free[i], x.q_free[i] = f.u[i], f.q[i]


@njit(cache=True)
def apply_force(a: Structure, f: Fields, x: Unsymmetric) -> None:  # pragma: no cover - compiled
    """Motion to t_{n+1} with the force as it is now, without contact forces."""
    forth = a.numbers[2]
    for i in range(x.force.shape[0]):
        change = a.kick[i] * x.force[i]
        f.q[i] = x.q_free[i] - change
        f.u[i] = x.u_free[i] - forth * change


@njit(cache=True)
def converged(a: Structure, f: Fields, x: Unsymmetric, work: Array) -> bool:  # pragma: no cover - compiled
    """Whether q at t_{n+1} agrees with the force that made it; if not, the force that it makes. work (size,)."""
    if x.gyroscopic.col.shape[0] == 0:
        return True
    beta2 = a.numbers[1]
    velocity, new = work[0], work[1]
    for i in range(x.force.shape[0]):
        velocity[i] = (1.0 - beta2) * x.q_before[i] + beta2 * f.q[i]
        new[i] = x.of_displacement[i]
    _add(x.gyroscopic, velocity, new)
    most = largest = 0.0
    for i in range(x.force.shape[0]):
        most = max(most, abs(a.kick[i] * (new[i] - x.force[i])))
        largest = max(largest, abs(f.q[i]))
    done = not most > CONVERGED * largest  # no number: ends the run elsewhere
    for i in range(x.force.shape[0]):
        if not done:
            x.force[i] = new[i]
        velocity[i] = new[i] = 0.0
    return done


@njit(cache=True)
def powers(a: Structure, f: Fields, x: Unsymmetric) -> tuple[float, float, float]:  # pragma: no cover - compiled
    """Powers at t_n that N and G put in, and what force and contact forces add to that of the structure (`products`);
    brings what the stiffness sees up to u and q."""
    beta2 = a.numbers[1]
    inner = 1.0 if a.flags[2] == WITH_STIFFNESS else 0.0
    circulatory = gyroscopic = extra = 0.0
    for i in range(x.force.shape[0]):
        before = x.q_before[i]
        v = before + beta2 * (x.q_free[i] - before)
        moved = beta2 * (f.q[i] - x.q_free[i])
        circulatory -= (v + moved) * x.of_displacement[i]
        gyroscopic -= (v + moved) * (x.force[i] - x.of_displacement[i])
        if a.flags[2] and a.kick[i] > 0.0:
            # The force of the structure back from the free step that it made.
            y = f.push[i] - (x.q_free[i] - a.keep[i] * before) / a.kick[i]
            extra += inner * moved * y + a.damping[i] * (2.0 * v * moved + moved * moved)
    if a.flags[0]:
        for i in range(x.force.shape[0]):
            f.shown[i] = f.u[i] + a.factor[i] * f.q[i]
    return circulatory, gyroscopic, extra

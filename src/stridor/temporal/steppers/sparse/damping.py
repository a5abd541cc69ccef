"""Damping in two parts: what may stand beside the mass, and what acts on the velocity half a step ago.

Explicit steps solve with M + β2 Δt C, which is cheap as long as it is diagonal. Mass-proportional damping and dashpots
to the ground are diagonal and enter there; stiffness-proportional damping and dashpots between freedoms are not and
act on q instead. Where the second part is the stiffness times one number b in every uncoupled part of the structure,
both need only one product, K (u + b∘q).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from ....fe.assembly import plus, shaped_alike
from ....system import System
from ....typing import Array, Sparse
from .unsymmetric import halves

PROPORTIONAL = 1e-10


@dataclass(frozen=True)
class SplitDamping:
    """C = diag(diagonal) + rest: diagonal (n,) [N s/m] ≥ 0; factor (n,) [s] with rest = K diag(factor), or None where
    that does not hold; rest (n, n) csr."""

    diagonal: Array
    factor: Array | None
    rest: Sparse

    @property
    def lagged(self) -> bool:
        """Whether anything acts on the older velocity."""
        return self.rest.nnz > 0


def no_damping(size: int) -> SplitDamping:
    """Where nothing of it is left to split."""
    return SplitDamping(np.zeros(size), np.zeros(size), sp.csr_array((size, size)))


def split_damping(system: System) -> SplitDamping:
    """Split the damping matrix of a system, each uncoupled part of it by its own factor; of unsymmetric matrices the
    symmetric parts."""
    parts = halves(system)
    damping, stiffness = sp.csr_array(parts.damping), sp.csr_array(parts.stiffness)
    damping.eliminate_zeros()
    own = damping.diagonal()
    between = _off_diagonal(damping)
    if between.nnz == 0:
        return SplitDamping(own, np.zeros(system.size), sp.csr_array(damping.shape))
    factor = _factors(between, _off_diagonal(stiffness))
    if factor is not None:
        rest = sp.csr_array(stiffness.multiply(factor[:, None]))
        diagonal = own - rest.diagonal()
        # What is left of a difference of equal numbers is rounding.
        diagonal[np.abs(diagonal) < PROPORTIONAL * np.abs(own)] = 0.0
        if np.all(diagonal >= 0.0):
            return SplitDamping(diagonal, factor, rest)
    # What exceeds the sum of a row's couplings is to the ground. Only if all rows have such an excess, the rest
    # certainly takes energy.
    excess = own - np.asarray(abs(between).sum(axis=1)).ravel()
    excess[np.abs(excess) < PROPORTIONAL * np.abs(own)] = 0.0
    diagonal = excess if np.all(excess >= 0.0) else np.where(np.diff(between.indptr) == 0, own, 0.0)
    rest = sp.csr_array(damping - sp.diags_array(diagonal))
    rest.eliminate_zeros()
    return SplitDamping(diagonal, None, rest)


def _off_diagonal(matrix: Sparse) -> Sparse:
    off = sp.csr_array(matrix - sp.diags_array(matrix.diagonal()))
    off.eliminate_zeros()
    return off


def _factors(damping: Sparse, stiffness: Sparse) -> Array | None:
    """b (n,) with damping = diag(b) stiffness off the diagonal, constant on each uncoupled part; None if there is
    none."""
    pattern = stiffness if shaped_alike(stiffness, damping) else abs(stiffness) + abs(damping)
    count, label = sp.csgraph.connected_components(pattern, directed=False)
    rows = np.repeat(label, np.diff(stiffness.indptr))
    common = sp.csr_array(stiffness.multiply(damping))
    product = np.bincount(label, np.asarray(common.sum(axis=1)).ravel(), count)
    square = np.bincount(rows, stiffness.data**2, count)
    factor = np.where(square > 0.0, product / np.where(square > 0.0, square, 1.0), 0.0)[label]
    left = plus(damping, sp.csr_array(stiffness.multiply(-factor[:, None])))
    scale = np.zeros(count)
    np.maximum.at(scale, label, np.asarray(abs(damping).max(axis=1).todense()).ravel())
    worst = np.asarray(abs(left).max(axis=1).todense()).ravel()
    return factor if np.all(worst <= PROPORTIONAL * scale[label]) else None

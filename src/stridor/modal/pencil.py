"""P(λ) of small motions about steady sliding at one value of every parameter, motions and contact forces together:

    (λ²M + λC + K) u − Bᵀ p = 0 ,      N u + c p = 0 ,      B = N + μS .

Here friction, contact springs, rigid contact and what the steady state adds become matrices, for every way to the
eigenpairs. With contact forces as unknowns a stiff contact costs no digits, and a rigid one (c = 0) is no exception.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from ..typing import Array, ComplexArray, IntArray, Sparse
from .quadratic.problem import CHUNK, Quadratic, entry_sizes, measured, times

NEGLIGIBLE = 1e-4  # of the largest displacement: gaps that open less than this are not judged more closely


@dataclass(frozen=True)
class Pencil:
    """M, C, K (n, n) csr, normal N and push B (m, n) csr, compliance c (m,) [m/N], 0 for rigid contact.

    N u is the relative displacement slave − master along the normals of m touching nodes, positive when they open; p
    their forces [N], which act along B: along the normal and, μ times as large, against the slip.
    """

    mass: Sparse
    damping: Sparse
    stiffness: Sparse
    normal: Sparse
    push: Sparse
    compliance: Array

    @property
    def size(self) -> int:
        """Number of freedoms n."""
        return int(self.mass.shape[0])

    @property
    def nodes(self) -> int:
        """Number of touching nodes m."""
        return int(self.normal.shape[0])

    @cached_property
    def transposed(self) -> Pencil:
        """The pencil whose right vectors are the left ones of this, forces with their sign changed."""
        return Pencil(self.mass.T, self.damping.T, self.stiffness.T, self.push, self.normal, self.compliance)

    def residual(self, lam: ComplexArray, u: ComplexArray, p: ComplexArray) -> ComplexArray:
        """(λ²M + λC + K) u − Bᵀ p (n, k) for λ (k,), u (n, k), p (m, k); real where everything is."""
        # λ² of what neither grows nor decays is real, and so is all that goes with it.
        square = lam**2 if np.any((lam**2).imag) else (lam**2).real
        total = square * times(self.mass, u) + times(self.stiffness, u) - times(self.push.T, p)
        return total + lam * times(self.damping, u) if self.damping.nnz else total

    def backward_error(
        self, lam: ComplexArray, u: ComplexArray, p: ComplexArray, *, rest: ComplexArray | None = None
    ) -> Array:
        """Componentwise backward errors (k,), contact forces kept as unknowns and their equations judged alike.

        ‖P(λ)x‖∞ / ‖|P|(|λ|) |x|‖∞ of the equations of motion, and of the contacts' own, whichever is larger. rest
        (n, k) is what the pairs leave of the equations of motion, where it is known.
        """
        result = np.zeros(len(lam))
        for start in range(0, len(lam), CHUNK):
            part = slice(start, start + CHUNK)
            known = None if rest is None else rest[:, part]
            result[part] = self._judged(lam[part], u[:, part], p[:, part], known)
        return result

    @cached_property
    def _sizes(self) -> tuple[Sparse, Sparse, Sparse, Sparse, Sparse]:
        large = (entry_sizes(matrix) for matrix in (self.mass, self.damping, self.stiffness))
        return (*large, abs(self.normal), abs(self.push))

    def _judged(self, lam: ComplexArray, u: ComplexArray, p: ComplexArray, rest: ComplexArray | None) -> Array:
        size, force, rate = np.abs(u), np.abs(p), np.abs(lam)
        mass, damping, stiffness, normal, push = self._sizes
        scale = rate**2 * measured(mass, size) + measured(stiffness, size) + push.T @ force
        if damping.nnz:
            scale += rate * measured(damping, size)
        if rest is None:
            rest = self.residual(lam, u, p)
        error = np.abs(rest).max(axis=0) / tiny(scale.max(axis=0))
        if not self.nodes:
            return error
        closure = np.abs(times(self.normal, u) + self.compliance[:, None] * p).max(axis=0)
        reach = (normal @ size + self.compliance[:, None] * force).max(axis=0)
        # A mode that hardly opens gaps at all (in the plane of the interface) leaves nothing but rounding there.
        reach = np.maximum(reach, NEGLIGIBLE * size.max(axis=0))
        return np.maximum(error, closure / tiny(reach))

    @cached_property
    def unit(self) -> float:
        """What forces are counted in where they stand beside displacements [N/m]: the largest stiffness."""
        return float(np.abs(self.stiffness.data).max(initial=0.0)) or 1.0

    @cached_property
    def whole(self) -> Quadratic:
        """The quadratic problem (n + m) of displacements and all contact forces, these in `unit`."""
        return self._bordered(self.stiffness, np.arange(self.nodes))

    def condensed(self, *, rigid: bool = True) -> Quadratic:
        """The quadratic problem of displacements with the contacts' springs in K; of rigid contacts the forces, in
        `unit`, are unknowns behind them, unless they are left out."""
        soft = self.compliance > 0
        stiffness = self.stiffness
        if soft.any():
            springs = sp.diags_array(1.0 / self.compliance[soft])
            stiffness = stiffness + self.push[soft].T @ springs @ self.normal[soft]
        return self._bordered(stiffness, np.flatnonzero(~soft) if rigid else np.zeros(0, dtype=np.int64))

    def _bordered(self, stiffness: Sparse, nodes: IntArray) -> Quadratic:
        """With the forces of some nodes as unknowns."""
        if not len(nodes):
            return Quadratic(self.mass, sp.csr_array(self.damping), sp.csr_array(stiffness))
        corner = sp.diags_array(self.unit**2 * self.compliance[nodes])
        rows = [[stiffness, -self.unit * self.push[nodes].T], [self.unit * self.normal[nodes], corner]]
        empty = sp.csr_array((len(nodes), len(nodes)))
        mass, damping = (
            sp.csr_array(sp.block_diag([matrix, empty], format="csr")) for matrix in (self.mass, self.damping)
        )
        return Quadratic(mass, damping, sp.csr_array(sp.block_array(rows, format="csr")))

    def parted(self, x: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        """Displacements (n, …) and contact forces (m, …) [N] of a vector of `whole`."""
        return x[: self.size], self.unit * x[self.size :]


def tiny(values: Array) -> Array:
    """The values, where they are zero the smallest number to divide by."""
    return np.maximum(values, 1e-300)

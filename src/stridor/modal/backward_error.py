"""Componentwise backward error of eigenpairs in the assembled matrices: how wrong the model would
have to be for the pair to be exact. It uses none of the modal machinery that found the pair."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from ..kernels import njit
from ..typing import Array, ComplexArray, IntArray, Sparse
from .coupling import PointCoupling

_CHUNK = 256


@njit(cache=True, fastmath={"reassoc", "contract", "nsz"})
def _apply(
    indptr: IntArray,
    indices: IntArray,
    data: Array,
    re: Array,
    im: Array,
    size: Array,
    powers: Array,
    out: Array,
) -> None:  # pragma: no cover - compiled
    """out (3, n, c): Re, Im of (K + λC + λ²M)u and (|K| + |λ||C| + |λ|²|M|)|u| for a chunk of c pairs.

    data (3, nnz): K, C, M on one pattern; powers (6, c): Re λ, Im λ, |λ|, Re λ², Im λ², |λ|².
    """
    rows, count = re.shape
    sums = np.zeros((9, count))
    for i in range(rows):
        sums[:] = 0.0
        for p in range(indptr[i], indptr[i + 1]):
            j = indices[p]
            k, c, m = data[0, p], data[1, p], data[2, p]
            ak, ac, am = abs(k), abs(c), abs(m)
            for q in range(count):
                r, s, a = re[j, q], im[j, q], size[j, q]
                sums[0, q] += k * r
                sums[1, q] += k * s
                sums[2, q] += c * r
                sums[3, q] += c * s
                sums[4, q] += m * r
                sums[5, q] += m * s
                sums[6, q] += ak * a
                sums[7, q] += ac * a
                sums[8, q] += am * a
        for q in range(count):
            lr, li, la, sr, si, sa = (
                powers[0, q],
                powers[1, q],
                powers[2, q],
                powers[3, q],
                powers[4, q],
                powers[5, q],
            )
            out[0, i, q] = sums[0, q] + lr * sums[2, q] - li * sums[3, q] + sr * sums[4, q] - si * sums[5, q]
            out[1, i, q] = sums[1, q] + lr * sums[3, q] + li * sums[2, q] + sr * sums[5, q] + si * sums[4, q]
            out[2, i, q] = sums[6, q] + la * sums[7, q] + sa * sums[8, q]


class BackwardError:
    """Judge of eigenpairs of one coupled system.

    ‖(λ²M + λC + K + coupling)u‖∞ / ‖(|λ|²|M| + |λ||C| + |K| + |coupling|)|u|‖∞ with the normal forces
    as unknowns, so that rigid contact is judged like any other; the contacts' own equations count too.
    """

    def __init__(self, coupling: PointCoupling) -> None:
        system = coupling.system
        self.coupling = coupling
        self._pattern = common_pattern(system.stiffness, system.damping, system.mass)
        rows = system.contact_rows()
        # Contacts touch few freedoms: dense rows on those alone.
        self._touched = np.flatnonzero(np.abs(rows).max(axis=0, initial=0.0))
        self._normal = rows[0::2][:, self._touched]
        self._tangent = rows[1::2][:, self._touched]
        both = np.abs(self._normal) + np.abs(self._tangent)
        self._own = [np.flatnonzero(row) for row in both]
        self._length = np.abs(self._normal).sum(axis=1)

    def __call__(self, lam: ComplexArray, u: ComplexArray, mu: float | Array, *, left: bool = False) -> Array:
        """Errors (k,) of the pairs λ (k,), u (n, k) at μ, one number or (k,).

        ``left`` judges yᵀ(…) = 0 for the transposed coupling instead.
        """
        mu = np.broadcast_to(np.asarray(mu, dtype=float), lam.shape)
        result = np.zeros(len(lam))
        for start in range(0, len(lam), _CHUNK):
            part = slice(start, start + _CHUNK)
            result[part] = self._chunk(lam[part], u[:, part], mu[part], left)
        return result

    def _chunk(self, lam: ComplexArray, u: ComplexArray, mu: Array, left: bool) -> Array:
        size = np.abs(u)
        powers = np.array([lam.real, lam.imag, np.abs(lam), (lam**2).real, (lam**2).imag, np.abs(lam) ** 2])
        out = np.zeros((3, *u.shape))
        _apply(
            *self._pattern,
            np.ascontiguousarray(u.real),
            np.ascontiguousarray(u.imag),
            size,
            np.ascontiguousarray(powers),
            out,
        )
        error, scale = out[0] + 1j * out[1], out[2]
        if not self.coupling.contacts:
            # A motion as a whole at λ = 0 is answered by no force at all: exact.
            return np.abs(error).max(axis=0) / np.maximum(scale.max(axis=0), np.finfo(float).tiny)
        coupling, friction = self.coupling, self.coupling.sense[:, None] * mu
        touched = self._touched
        near, near_size = u[touched], size[touched]
        normal_motion, slip = self._normal @ near, self._tangent @ near
        gap = normal_motion + friction * slip if left else normal_motion
        force = self._forces(gap, error, friction, left)
        tangential = np.zeros_like(force) if left else friction * force
        if coupling.sloped:
            weakening = np.array([coupling.friction_damping(float(m)) for m in mu]).T * lam
            tangential = tangential - weakening * slip
        error[touched] -= self._normal.T @ force + self._tangent.T @ tangential
        scale[touched] += np.abs(self._normal.T) @ np.abs(force) + np.abs(self._tangent.T) @ np.abs(
            tangential
        )
        closure = np.abs(gap + coupling.compliance[:, None] * force)
        # A row may be wrong relative to its length: the normal direction is no more exact than that.
        most = np.array([near_size[own].max(axis=0, initial=0.0) for own in self._own])
        reach = self._length[:, None] * most + coupling.compliance[:, None] * np.abs(force)
        contact = (closure / np.maximum(reach, 1e-300)).max(axis=0)
        largest = np.maximum(scale.max(axis=0), np.finfo(float).tiny)
        return np.maximum(np.abs(error).max(axis=0) / largest, contact)

    def _forces(self, gap: ComplexArray, error: ComplexArray, friction: Array, left: bool) -> ComplexArray:
        """−K_c times the gap; where the contact is rigid, the force that fits the equations best."""
        compliance = self.coupling.compliance
        force = np.zeros_like(gap)
        soft = compliance > 0
        force[soft] = -gap[soft] / compliance[soft][:, None]
        if soft.all():
            return force
        normal, tangent = self._normal, self._tangent
        for k in range(gap.shape[1]):
            push = normal if left else normal + friction[:, k : k + 1] * tangent
            rest = error[self._touched, k] - push[soft].T @ force[soft, k]
            force[~soft, k] = np.linalg.lstsq(push[~soft].T, rest, rcond=None)[0]
        return force


def common_pattern(*matrices: Sparse) -> tuple[IntArray, IntArray, Array]:
    """indptr, indices and data (3, nnz) of matrices written on their common pattern."""
    pattern = sp.csr_array(sum(abs(m) for m in matrices))
    pattern.sort_indices()
    pattern.data[:] = 1.0
    data = np.zeros((len(matrices), pattern.nnz))
    rows = np.repeat(np.arange(pattern.shape[0]), np.diff(pattern.indptr))
    for k, matrix in enumerate(matrices):
        coo = sp.coo_array(matrix)
        key = coo.row.astype(np.int64) * pattern.shape[1] + coo.col
        index = np.searchsorted(rows.astype(np.int64) * pattern.shape[1] + pattern.indices, key)
        np.add.at(data[k], index, coo.data)
    return pattern.indptr.astype(np.int64), pattern.indices.astype(np.int64), data

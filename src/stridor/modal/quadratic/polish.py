"""Single eigenpairs improved, sets of them merged, and left vectors assigned to right ones."""

from __future__ import annotations

import numpy as np
import scipy
import scipy.linalg as sl

from ...typing import Array, ComplexArray, IntArray
from .dense import unit
from .inverse_iteration import solved_beside
from .problem import Quadratic
from .search import DiscModes

ALIKE = 1e-9  # of the scale: eigenvalues closer than this are one, or copies of one
SPREAD = 1e-5  # how far rounding spreads copies of a defective one
PARALLEL = 1e-6  # 1 − |xᴴx'| of what is the same shape


def polished(
    problem: Quadratic, lam: complex, x: ComplexArray | None, *, solver: str | None
) -> tuple[complex, ComplexArray, float] | None:
    """λ, x (n,) and backward error after two-sided inverse iteration from (λ, x), or from an arbitrary x.

    λ is the one of the two-sided functional or, where that has less, as at a defective eigenvalue, whose left vector
    says nothing of λ, the one that makes ‖P(λ)x‖ smallest. None where the iteration does not settle.
    """
    found = solved_beside(problem, lam, x, None, solver=solver)
    if found is None:
        return None
    slope = problem.slope(found.lam, found.right)
    step = np.vdot(slope, problem.applied(found.lam, found.right)) / np.vdot(slope, slope)
    values = np.array([found.lam, found.lam - step])
    error = problem.backward_error(values, np.stack([found.right, found.right], axis=1))
    best = int(np.argmin(error))
    return complex(values[best]), found.right, float(error[best])


def merged(parts: list[DiscModes], scale: float) -> DiscModes:
    """Sets of several discs as one: what two of them hold is kept once, from where its backward error is smaller."""
    result = parts[0]
    for part in parts[1:]:
        ours, theirs = pairs(result.values, part.values, SPREAD * scale)
        distance = np.abs(result.values[ours] - part.values[theirs])
        along = np.abs(np.einsum("ij,ij->j", result.shapes[:, ours].conj(), part.shapes[:, theirs]))
        same = (distance <= ALIKE * scale) | ((distance <= SPREAD * scale) & (along > 1 - PARALLEL))
        ours, theirs = ours[same], theirs[same]
        values, shapes, error = result.values.copy(), result.shapes.copy(), result.error.copy()
        better = part.error[theirs] < error[ours]
        values[ours[better]] = part.values[theirs[better]]
        shapes[:, ours[better]] = part.shapes[:, theirs[better]]
        error[ours[better]] = part.error[theirs[better]]
        new = np.setdiff1d(np.arange(len(part.values)), theirs)
        result = DiscModes(
            np.concatenate([values, part.values[new]]), np.hstack([shapes, part.shapes[:, new]]),
            np.concatenate([error, part.error[new]]),
        )  # fmt: skip
    return result


def pairs(a: ComplexArray, b: ComplexArray, near: float = np.inf) -> tuple[IntArray, IntArray]:
    """Places in a and in b of pairs no farther apart than ``near``, as many as there can be and then the closest."""
    if not len(a) or not len(b):
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    distance = np.abs(a[:, None] - b[None, :])
    # What is too far costs more than all others together, so that it never displaces a pair that belongs together.
    far = distance > near
    dear = (near if np.isfinite(near) else 0.0) * (len(a) + 1)
    rows, columns = scipy.optimize.linear_sum_assignment(np.where(far, dear, distance))
    kept = ~far[rows, columns]
    return np.asarray(rows)[kept], np.asarray(columns)[kept]


def biorthogonal(problem: Quadratic, lam: ComplexArray, x: ComplexArray, y: ComplexArray, scale: float) -> ComplexArray:
    """y (n, k) of unit norm, within each multiple eigenvalue turned until yᵢᵀ((λᵢ+λⱼ)M + D)xⱼ = 0 for i ≠ j.

    Between different eigenvalues that holds by itself; a defective one has no such basis and is left as it is.
    """
    result = y.astype(complex)
    for group in groups(lam, ALIKE * scale):
        if len(group) < 2:
            continue
        values = lam[group]
        product = problem.mass @ x[:, group]
        gram = y[:, group].T @ (problem.damping @ x[:, group]) + (values[:, None] + values) * (y[:, group].T @ product)
        size = np.abs(y[:, group]).T @ (abs(problem.damping) @ np.abs(x[:, group]))
        size = size + 2 * np.abs(values) * (np.abs(y[:, group]).T @ (abs(problem.mass) @ np.abs(x[:, group])))
        if sl.svdvals(gram)[-1] > 1e-6 * size.max():
            result[:, group] = unit(y[:, group] @ np.linalg.inv(gram).T)
    return result


def tuned(problem: Quadratic, lam: complex, found: DiscModes, near: float) -> ComplexArray:
    """x (n,) that comes nearest to P(λ)x = 0 among combinations of found vectors with eigenvalues ``near`` λ.

    Copies of a defective eigenvalue spread, and differently in two searches; their vectors span the same.
    """
    basis = np.linalg.qr(found.shapes[:, np.abs(found.values - lam) <= near])[0]
    rest = problem.residual(np.full(basis.shape[1], lam), basis)
    return basis @ sl.svd(rest, full_matrices=False)[2][-1].conj()


def groups(lam: ComplexArray, near: float) -> list[IntArray]:
    """Places of eigenvalues that chains of distances below ``near`` join."""
    label = np.arange(len(lam))
    for i, j in np.argwhere(np.triu(np.abs(lam[:, None] - lam[None, :]) <= near, 1)):
        label[label == label[j]] = label[i]
    return [np.flatnonzero(label == k) for k in np.unique(label)]


def snapped(lam: ComplexArray, scale: float) -> ComplexArray:
    """λ without imaginary part where that is rounding: eigenvalues of real matrices with no conjugate are real."""
    result = lam.copy()
    result[np.abs(lam.imag) <= 1e-12 * scale] = result[np.abs(lam.imag) <= 1e-12 * scale].real
    unsure = np.flatnonzero((result.imag != 0) & (np.abs(result.imag) <= SPREAD * scale))
    up, down = unsure[result[unsure].imag > 0], unsure[result[unsure].imag < 0]
    ours, theirs = pairs(result[up], result[down].conj())
    distance: Array = np.abs(result[up[ours]] - result[down[theirs]].conj())
    paired = distance <= np.maximum(0.5 * np.abs(result[up[ours]].imag), ALIKE * scale)
    alone = np.setdiff1d(unsure, np.concatenate([up[ours[paired]], down[theirs[paired]]]))
    near = alone[np.abs(result[alone].imag) <= ALIKE * scale]
    result[near] = result[near].real
    return result

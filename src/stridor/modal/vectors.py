"""Right and left complex vectors of given eigenvalues."""

from __future__ import annotations

import numpy as np

from ..typing import Array, ComplexArray, IntArray
from .roots import ReceptanceProblem


def modal_coordinates(spectrum: ReceptanceProblem, lam: ComplexArray, mu: float) -> tuple[ComplexArray, ComplexArray]:
    """Contact forces (k, 2m) on the right vectors u = D⁻¹ Gᵀ p and on the left ones, at the roots λ (k,)."""
    left, right = spectrum.null_vectors(lam, mu)
    coupling = spectrum.coupling
    push = coupling.push(mu, lam, right)
    pull = np.zeros_like(push)
    # The left problem is the transposed coupling: friction reads where the right one pushes.
    m = coupling.contacts
    pull[:, 0::2] = left[:, :m]
    if coupling.sloped:
        pull[:, 1::2] = -left[:, m:]
    return push, pull


def expand(spectrum: ReceptanceProblem, lam: ComplexArray, forces: ComplexArray) -> ComplexArray:
    """u (n, k) = D(λ)⁻¹ Gᵀ p for each λ (k,) and contact forces p (k, 2m), scaled to unit norm."""
    u = _summed(spectrum, lam, forces)
    return u / np.maximum(np.linalg.norm(u, axis=0), 1e-300)


def closed(
    spectrum: ReceptanceProblem, lam: ComplexArray, forces: ComplexArray, friction: Array | None = None
) -> ComplexArray:
    """The same, the share of the mode whose pole is nearest being what closes the contacts.

    A mode that hardly feels its contact has its root next to its own pole, where λ² + cλ + ω² has no digits left; the
    contacts' equations Gu + p/K_c = 0 say how much of it there is. friction (k, m): of left vectors, μs, by which slip
    is part of their gap. Not a number where there is no such mode, or it has no part in any gap.
    """
    modes, compliance = spectrum.modes, spectrum.coupling.compliance
    if not len(modes.stiffness):
        return np.full((modes.size, len(lam)), np.nan, dtype=complex)
    nearest = np.argmin(np.abs(_pole_distance(lam, modes.damping, modes.stiffness)), axis=0)
    others = _summed(spectrum, lam, forces, without=nearest)
    own = np.zeros((modes.size, len(lam)))
    start = 0
    for block in modes.real:
        mine = np.flatnonzero((start <= nearest) & (nearest < start + len(block.freedoms)))
        own[np.ix_(block.freedoms, mine)] = block.vectors[:, nearest[mine] - start]
        start += len(block.freedoms)
    rows = spectrum.coupling.system.contact_rows()
    normal, tangent = rows[0::2], rows[1::2]
    slip = np.zeros((len(compliance), len(lam))) if friction is None else friction.T
    gap = normal @ others + slip * (tangent @ others) + compliance[:, None] * forces[:, 0::2].T
    reach = normal @ own + slip * (tangent @ own)
    with np.errstate(all="ignore"):
        u = others - own * ((reach * gap).sum(axis=0) / (reach**2).sum(axis=0))
        return u / np.linalg.norm(u, axis=0)


def _summed(
    spectrum: ReceptanceProblem, lam: ComplexArray, forces: ComplexArray, *, without: IntArray | None = None
) -> ComplexArray:
    """u (n, k), without one real mode each (k,)."""
    modes = spectrum.modes
    projections, general_rows = spectrum.projections, spectrum.receptance.general
    u = np.zeros((modes.size, len(lam)), dtype=complex)
    start = 0
    for block in modes.real:
        stop = start + len(block.freedoms)
        drive = _real_times_complex(projections[:, start:stop].T, forces.T)
        drive /= _not_zero(_pole_distance(lam, block.damping, block.stiffness), lam * lam)
        if without is not None:
            mine = np.flatnonzero((start <= without) & (without < stop))
            drive[without[mine] - start, mine] = 0.0
        u[block.freedoms] = _real_times_complex(block.vectors, drive)
        start = stop
    start = 0
    for general in modes.general:
        stop = start + len(general.poles)
        drive = general_rows[:, start:stop].T @ forces.T
        u[general.freedoms] = general.vectors @ (drive / _not_zero(lam - general.poles[:, None], lam))
        start = stop
    return u


def _pole_distance(lam: ComplexArray, damping: Array, stiffness: Array) -> ComplexArray:
    """λ² + cλ + ω² (j, k)."""
    return lam * lam + np.multiply.outer(damping, lam) + stiffness[:, None]


def _not_zero(difference: ComplexArray, size: ComplexArray) -> ComplexArray:
    """Differences (j, k) with those that are zero at the rounding of their terms' ``size`` (k,): on a pole the mode
    that belongs to it is the shape, not NaN."""
    least = np.maximum(np.finfo(float).eps * np.abs(size), 1e-300)
    return np.where(difference == 0.0, least, difference)


def _real_times_complex(real: Array, values: ComplexArray) -> ComplexArray:
    """real @ values without turning the real matrix into a complex one."""
    values = np.ascontiguousarray(values)
    return (real @ values.view(float)).view(complex)


def fixed_vectors(spectrum: ReceptanceProblem) -> Array:
    """Vectors (n, k) of the modes that no contact sees."""
    modes = spectrum.modes
    u = np.zeros((modes.size, len(spectrum.fixed)))
    start = 0
    for block in modes.real:
        stop = start + len(block.freedoms)
        u[block.freedoms] = block.vectors @ spectrum.fixed_modes[:, start:stop].T
        start = stop
    return u / np.linalg.norm(u, axis=0) if u.shape[1] else u

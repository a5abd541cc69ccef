"""All eigenvalues in a band at one friction coefficient, found together and kept apart.

Roots of T(λ, μ) lie between poles of the receptance. Newton on T alone trips over a pole close by
and lets two starts fall on one root, so each step is Newton on T · Π(poles) / Π(other roots):
the simultaneous iteration of Ehrlich and Aberth with the known poles multiplied out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as sl

from ..errors import AnalysisError
from ..typing import Array, ComplexArray
from .coupling import Coupling
from .receptance import Receptance, wanted_pairs
from .uncoupled import UncoupledModes

CONVERGED = 1e-9  # of the step before last: convergence is at least quadratic
MAX_STEPS = 40
UNCOUPLED_TOLERANCE = 1e-12


@dataclass(frozen=True)
class Spectrum:
    """Contact problem on a complete modal basis, ready for root finding.

    coupled (n_real,) tells which real modes feel the contacts; fixed_modes (k, n_real) are the
    combinations that no contact sees, with their poles fixed (k,): eigenvalues at any μ.
    """

    coupling: Coupling
    receptance: Receptance
    fixed: ComplexArray
    fixed_modes: Array
    pole_stiffness: Array
    pole_damping: Array

    @property
    def modes(self) -> UncoupledModes:
        """The uncoupled modes."""
        return self.receptance.modes

    def evaluate(self, lam: ComplexArray, mu: float) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
        """T, ∂T/∂λ, ∂T/∂μ at λ (k,)."""
        return self.coupling.matrices(lam, mu, *self.receptance(lam))

    def tangents(self, lam: ComplexArray, mu: float) -> ComplexArray:
        """dλ/dμ (k,) along the branches through the roots λ (k,)."""
        value, by_lambda, by_mu = self.evaluate(lam, mu)
        if value.shape[1] == 1:
            return -by_mu[:, 0, 0] / by_lambda[:, 0, 0]
        left, right = _null_vectors(value)
        top = np.einsum("ki,kij,kj->k", left, by_mu, right)
        return -top / np.einsum("ki,kij,kj->k", left, by_lambda, right)

    def null_vectors(self, lam: ComplexArray, mu: float) -> tuple[ComplexArray, ComplexArray]:
        """Left and right null vectors (k, q) of T at the roots λ (k,)."""
        if self.coupling.contacts == 1 and not self.coupling.sloped:
            ones = np.ones((len(lam), 1), dtype=complex)
            return ones, ones
        value, _, _ = self.evaluate(lam, mu)
        return _null_vectors(value)


def _null_vectors(value: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
    u, _, vh = np.linalg.svd(value)
    return u[:, :, -1].conj(), vh[:, -1, :].conj()


def spectrum_of(coupling: Coupling, modes: UncoupledModes) -> Spectrum:
    """Prepare root finding: separate what the contacts do not see from what they do."""
    rows = coupling.system.contact_rows()
    real, general = modes.project(rows)
    fixed, combinations, real, coupled = _split_unseen(modes, real, sloped=coupling.sloped)
    pairs = wanted_pairs(coupling.contacts, slip=coupling.sloped)
    receptance = Receptance(modes, real, general, pairs)
    return Spectrum(
        coupling=coupling,
        receptance=receptance,
        fixed=fixed,
        fixed_modes=combinations,
        pole_stiffness=modes.stiffness[coupled],
        pole_damping=modes.damping[coupled],
    )


def _split_unseen(
    modes: UncoupledModes, real: Array, *, sloped: bool
) -> tuple[ComplexArray, Array, Array, Array]:
    """Group equal poles and turn each group so that the fewest of its modes meet the contacts.

    A mode without normal motion at any contact keeps its eigenvalue at every μ (its friction force
    stays constant), as does the combination of two equal modes that cancels there.
    """
    stiffness, damping = modes.stiffness, modes.damping
    seen = real if sloped else real[0::2]
    scale = max(float(np.abs(real).max(initial=0.0)), 1e-300)
    order = np.lexsort((damping, stiffness))
    coupled = np.zeros(len(stiffness), dtype=bool)
    rotated = real.copy()
    fixed: list[complex] = []
    combinations: list[Array] = []
    start = 0
    while start < len(order):
        stop = start + 1
        while stop < len(order) and _same(stiffness, damping, order[start], order[stop]):
            stop += 1
        group = order[start:stop]
        if len(group) == 1:
            basis, rank = (
                np.eye(1),
                int(np.abs(seen[:, group]).max(initial=0.0) > UNCOUPLED_TOLERANCE * scale),
            )
        else:
            _, values, vh = np.linalg.svd(seen[:, group], full_matrices=True)
            basis, rank = vh, int(np.sum(values > UNCOUPLED_TOLERANCE * scale))
        rotated[:, group] = real[:, group] @ basis.T
        coupled[group[:rank]] = True
        for k in range(rank, len(group)):
            pole_root = _pole(stiffness[group[k]], damping[group[k]])
            combination = np.zeros(len(stiffness))
            combination[group] = basis[k]
            fixed.append(pole_root)
            combinations.append(combination)
            if not sloped:
                rotated[0::2, group[k]] = 0.0
            else:
                rotated[:, group[k]] = 0.0
        start = stop
    return (
        np.array(fixed, dtype=complex),
        np.array(combinations).reshape(len(fixed), len(stiffness)),
        rotated,
        coupled,
    )


def _same(stiffness: Array, damping: Array, i: int, j: int) -> bool:
    return bool(
        abs(stiffness[i] - stiffness[j]) <= 1e-11 * abs(stiffness[j])
        and abs(damping[i] - damping[j]) <= 1e-9 * max(abs(damping[j]), 1e-12 * np.sqrt(abs(stiffness[j])))
    )


def _pole(stiffness: float, damping: float) -> complex:
    """Root of λ² + cλ + ω² in the upper half plane (the slower one where both are real)."""
    half = damping / 2
    inside = half * half - stiffness
    return complex(-half + np.sqrt(inside)) if inside > 0 else complex(-half, np.sqrt(-inside))


def frictionless_roots(spectrum: Spectrum, limit: float) -> ComplexArray:
    """Coupled eigenvalues at μ = 0 with |λ| ≤ about 1.3 ``limit`` [1/s] (k,), sorted by |λ|.

    At μ = 0 the coupled stiffness is symmetric and the dense solver finds every root, so the count
    is right from the start; damping is then put in by the simultaneous iteration, or, where it is
    strong or not proportional, by a dense solve of the damped problem. Upper half plane; of roots on
    the real axis both are listed. The margin keeps guards beside the outermost root asked for.
    """
    starts: ComplexArray | None = None
    if spectrum.modes.proportional:
        starts = _dense_undamped(spectrum, limit)
    if starts is None:
        starts = _dense_damped(spectrum, limit)
    starts = starts[np.argsort(np.abs(starts), kind="stable")]
    if not len(starts):
        return starts
    roots, converged = polish(spectrum, starts, np.conj(starts), 0.0)
    if not converged:
        raise AnalysisError(
            "the eigenvalues without friction do not settle: two modes coincide at the contact; change a "
            "length or a frequency limit slightly"
        )
    return roots


def _dense_undamped(spectrum: Spectrum, limit: float) -> ComplexArray | None:
    """Undamped coupled roots with damping to first order; None where that is too strong for a start."""
    keep = _coupled_columns(spectrum)
    normal = spectrum.receptance.real[0::2][:, keep]
    compliance = spectrum.coupling.compliance
    basis, stiffness = _elastic(normal, compliance, np.diag(spectrum.modes.stiffness[keep]))
    inertia = np.eye(stiffness.shape[0])
    # Inverting about a shift gives the low modes to full accuracy whatever K_c is.
    shift = (limit / 10) ** 2
    inverse, vectors = sl.eigh(inertia, stiffness + shift * inertia)
    low = inverse > 1.0 / ((1.3 * limit) ** 2 + shift)
    squares = np.maximum(1.0 / inverse[low] - shift, 0.0)
    shapes = basis @ vectors[:, low]
    damping = np.einsum("ij,i,ij->j", shapes, spectrum.modes.damping[keep], shapes) / np.einsum(
        "ij,ij->j", shapes, shapes
    )
    if np.any(damping**2 > 0.04 * squares):
        return None
    return -damping / 2 + 1j * np.sqrt(squares - damping**2 / 4)


def _elastic(normal: Array, compliance: Array, stiffness: Array) -> tuple[Array, Array]:
    """Basis of what rigid contacts leave free, and the stiffness with the elastic ones in it."""
    rigid = compliance == 0.0
    soft = normal[~rigid]
    stiffness = stiffness + soft.T @ (soft / compliance[~rigid][:, None])
    if not rigid.any():
        return np.eye(len(stiffness)), stiffness
    basis = sl.null_space(normal[rigid])
    return basis, basis.T @ stiffness @ basis


def _dense_damped(spectrum: Spectrum, limit: float) -> ComplexArray:
    """Eigenvalues of the dense damped problem at μ = 0 in physical freedoms, upper half plane."""
    system = spectrum.coupling.system
    normal = system.contact_rows()[0::2]
    basis, stiffness = _elastic(normal, spectrum.coupling.compliance, system.stiffness.toarray())
    mass, damping = (basis.T @ (a @ basis) for a in (system.mass, system.damping))
    shift = limit / 10
    shifted = shift**2 * mass + shift * damping + stiffness
    n = len(mass)
    factor = sl.cho_factor(shifted)
    companion = np.block(
        [
            [-sl.cho_solve(factor, 2 * shift * mass + damping), -sl.cho_solve(factor, mass) / shift],
            [shift * np.eye(n), np.zeros((n, n))],
        ]
    )
    inverse = sl.eigvals(companion)
    inverse = inverse[np.abs(inverse) > 1.0 / (3 * limit)]
    values = shift + 1.0 / inverse
    values = np.where(np.abs(values.imag) < 1e-9 * limit, values.real + 0j, values)
    values = values[(np.abs(values) <= 1.3 * limit) & (values.imag >= 0)]
    return _without(values, spectrum.fixed)


def _without(values: ComplexArray, fixed: ComplexArray) -> ComplexArray:
    """Take the eigenvalues nearest to the fixed ones out."""
    left = list(values)
    for pole in fixed:
        if left:
            nearest = int(np.argmin([abs(v - pole) for v in left]))
            if abs(left[nearest] - pole) < 1e-6 * max(abs(pole), 1.0):
                left.pop(nearest)
    return np.array(left, dtype=complex)


def _coupled_columns(spectrum: Spectrum) -> Array:
    seen = spectrum.receptance.real[0::2]
    scale = max(float(np.abs(spectrum.receptance.real).max(initial=0.0)), 1e-300)
    return np.flatnonzero(np.abs(seen).max(axis=0, initial=0.0) > UNCOUPLED_TOLERANCE * scale)


def polish(
    spectrum: Spectrum, starts: ComplexArray, mirrors: ComplexArray, mu: float, *, steps: int = MAX_STEPS
) -> tuple[ComplexArray, bool]:
    """Simultaneous iteration from ``starts`` (k,) with mirror roots ``mirrors`` (k,) held apart.

    Returns the roots (k,) and whether all of them converged to rounding.
    """
    roots = np.array(starts, dtype=complex)
    mirrored = mirrors == np.conj(starts)
    mirror = np.array(mirrors, dtype=complex)
    nearby = _poles_near(spectrum, roots)
    smallest = np.full(len(roots), np.inf)
    active = np.ones(len(roots), dtype=bool)
    for _ in range(steps):
        mirror[mirrored] = np.conj(roots[mirrored])
        index = np.flatnonzero(active)
        step = _step(spectrum, roots, mirror, index, nearby, mu)
        relative = np.abs(step) / np.maximum(np.abs(roots[index]), 1e-300)
        roots[index] = roots[index] - step
        # Beside a coalescence the last digits stagnate above that; no step helps further then.
        done = (relative < CONVERGED) | ((relative < 1e-7) & (relative >= 0.5 * smallest[index]))
        smallest[index] = np.minimum(smallest[index], relative)
        active[index[done]] = False
        if not active.any():
            break
    return roots, bool(not active.any() and np.all(np.isfinite(roots)))


def _poles_near(spectrum: Spectrum, roots: ComplexArray) -> tuple[Array, Array]:
    limit = (1.5 * np.abs(roots).max()) ** 2
    near = spectrum.pole_stiffness <= limit
    return spectrum.pole_stiffness[near], spectrum.pole_damping[near]


def _step(
    spectrum: Spectrum,
    roots: ComplexArray,
    mirror: ComplexArray,
    index: Array,
    poles: tuple[Array, Array],
    mu: float,
) -> ComplexArray:
    lam = roots[index]
    with np.errstate(all="ignore"):
        value, by_lambda, _ = spectrum.evaluate(lam, mu)
        if value.shape[1] == 1:
            slope = by_lambda[:, 0, 0] / value[:, 0, 0]
        else:
            slope = np.trace(np.linalg.solve(value + 1e-300, by_lambda), axis1=1, axis2=2)
        stiffness, damping = poles
        column = lam[:, None]
        slope = slope + ((2 * column + damping) / (column * (column + damping) + stiffness)).sum(axis=1)
        if spectrum.modes.general:
            slope = slope + (1.0 / (column - spectrum.modes.poles)).sum(axis=1)
        others = column - roots
        others[np.arange(len(index)), index] = np.inf
        slope = slope - (1.0 / others).sum(axis=1)
        pairs = column - mirror
        # A root on the real axis is its own mirror: one root, not two.
        pairs[np.abs(pairs) < 1e-12 * np.maximum(np.abs(column), 1e-300)] = np.inf
        slope = slope - (1.0 / pairs).sum(axis=1)
        step = 1.0 / slope
    return np.where(np.isfinite(step), step, 0.0)

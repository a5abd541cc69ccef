"""All eigenvalues in a band at one friction coefficient, found together and kept apart.

Roots of T(λ, μ) lie between poles of the receptance. Newton on T alone trips over a pole close by
and lets two starts fall on one root, so each step is Newton on T · Π(poles) / Π(other roots):
the simultaneous iteration of Ehrlich and Aberth with the known poles multiplied out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.linalg as sl

from ..errors import AnalysisError, FollowingError
from ..system.uncoupled import UncoupledModes
from ..typing import Array, BoolArray, ComplexArray, IntArray
from .coupling import PointCoupling
from .deflation import deflation
from .painleve import undetermined
from .receptance import Receptance, wanted_pairs
from .shift_inverted import companion
from .single_contact import NUDGE, SingleContact, polish_single
from .unfit import Unfit

CONVERGED = 1e-9  # of the step before last: convergence is at least quadratic
MAX_STEPS = 40
UNCOUPLED_TOLERANCE = 1e-12
APART = 1e-12  # of the largest: squares of poles nearer to each other have no room between them
HALVINGS = 100  # of the interval between two poles at most
BESIDE_POLE = 1e-6  # of |λ|: how far on both sides of a pole T is looked at
NEAR_ROOT = 1e-8  # of its square: as near as the iteration wants a start


@dataclass(frozen=True)
class ReceptanceProblem:
    """Contact problem on a complete modal basis, ready for root finding.

    coupled (n_real,) tells which real modes feel the contacts; fixed_modes (k, n_real) are the
    combinations that no contact sees, with their poles fixed (k,): eigenvalues at any μ. projections
    (2m, n_real): the contact rows on the modes as they are; the receptance has those of equal poles turned.
    """

    coupling: PointCoupling
    receptance: Receptance
    fixed: ComplexArray
    fixed_modes: Array
    projections: Array
    pole_stiffness: Array
    pole_damping: Array

    @property
    def modes(self) -> UncoupledModes:
        """The uncoupled modes."""
        return self.receptance.modes

    @cached_property
    def slow_poles(self) -> tuple[BoolArray, Array]:
        """Which pole pairs (n,) are overdamped, and how large the slower pole of each is [1/s]: far below its ω."""
        half = self.pole_damping / 2
        return half**2 > self.pole_stiffness, half - np.sqrt(np.maximum(half**2 - self.pole_stiffness, 0.0))

    @property
    def unseen(self) -> bool:
        """Whether a pole of a general block has no normal motion at any contact: it is a root of its own at every μ,
        at which the receptance cannot be evaluated. Those of real blocks are ``fixed`` instead."""
        general = np.abs(self.receptance.general)
        if not general.size:
            return False
        seen = general if self.coupling.sloped else general[0::2]
        return bool(np.any(seen.max(axis=0) <= UNCOUPLED_TOLERANCE * seen.max()))

    def evaluate(self, lam: ComplexArray, mu: float) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
        """T, ∂T/∂λ, ∂T/∂μ (k, q, q) at λ (k,)."""
        if self.coupling.contacts == 1 and not self.coupling.sloped:
            # Most of what branches are followed by: one number each, H_nn + μ s H_nt.
            value, slope = self.receptance.entries(lam)
            sense = float(self.coupling.sense[0])
            single = float(self.coupling.compliance[0]) + value[:, 0] + mu * sense * value[:, 1]
            by_lambda = slope[:, 0] + mu * sense * slope[:, 1]
            return single[:, None, None], by_lambda[:, None, None], (sense * value[:, 1])[:, None, None]
        return self.coupling.matrices(lam, mu, *self.receptance(lam))

    def single(self, mu: float) -> SingleContact | None:
        """T as one sum over real modes, where it is one."""
        if self.coupling.contacts != 1 or self.coupling.sloped or self.receptance.general.shape[1]:
            return None
        damping, stiffness, products = self.receptance.sums
        sense = float(self.coupling.sense[0])
        return SingleContact(damping, stiffness, products, float(self.coupling.compliance[0]), mu * sense)

    def tangents(self, lam: ComplexArray, mu: float) -> ComplexArray:
        """dλ/dμ (k,) along the branches through the roots λ (k,)."""
        value, by_lambda, by_mu = self.evaluate(lam, mu)
        # Infinite at a double root, which whoever follows branches looks for.
        with np.errstate(divide="ignore", invalid="ignore"):
            if value.shape[1] == 1:
                slopes = -by_mu[:, 0, 0] / by_lambda[:, 0, 0]
                on_pole = np.isnan(slopes)
                if on_pole.any():
                    slopes[on_pole] = self._on_poles(lam[on_pole], mu)
                return slopes
            left, right = _null_vectors(value)
            top = np.einsum("ki,kij,kj->k", left, by_mu, right)
            return -top / np.einsum("ki,kij,kj->k", left, by_lambda, right)

    def _on_poles(self, lam: ComplexArray, mu: float) -> ComplexArray:
        """dλ/dμ (k,) of roots that are on poles p to the last bit, of one contact: T is a/(λ − p) + b there, a zero at
        this μ, so that b dλ = −da. Values on both sides of the pole tell a from b."""
        beside = BESIDE_POLE * np.abs(lam)
        (before, _, less), (after, _, more) = (self.evaluate(lam + way * beside, mu) for way in (-1.0, 1.0))
        slopes: ComplexArray = (-beside * (more - less)[:, 0, 0] / (after + before)[:, 0, 0]).astype(complex)
        return slopes

    def null_vectors(self, lam: ComplexArray, mu: float) -> tuple[ComplexArray, ComplexArray]:
        """Left and right null vectors (k, q) of T at the roots λ (k,)."""
        if self.coupling.contacts == 1 and not self.coupling.sloped:
            ones = np.ones((len(lam), 1), dtype=complex)
            return ones, ones
        value, _, _ = self.evaluate(lam, mu)
        return _null_vectors(value)


def _null_vectors(value: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
    if not np.all(np.isfinite(value)):
        # Without friction a mode that a law of speed sees and no normal force moves is a root on its own pole.
        raise Unfit("a mode stays where contacts do not move it, and the receptance is infinite there")
    u, _, vh = np.linalg.svd(value)
    return u[:, :, -1].conj(), vh[:, -1, :].conj()


def spectrum_of(coupling: PointCoupling, modes: UncoupledModes) -> ReceptanceProblem:
    """Prepare root finding: separate what the contacts do not see from what they do."""
    rows = coupling.system.contact_rows()
    projections, general = modes.project(rows)
    fixed, combinations, real, coupled = _split_unseen(modes, projections, sloped=coupling.sloped)
    pairs = wanted_pairs(coupling.contacts, slip=coupling.sloped)
    receptance = Receptance(modes, real, general, pairs)
    return ReceptanceProblem(
        coupling=coupling,
        receptance=receptance,
        fixed=fixed,
        fixed_modes=combinations,
        projections=projections,
        pole_stiffness=modes.stiffness[coupled],
        pole_damping=modes.damping[coupled],
    )


def _split_unseen(modes: UncoupledModes, real: Array, *, sloped: bool) -> tuple[ComplexArray, Array, Array, BoolArray]:
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
    like_next = _same(stiffness, damping, order[:-1], order[1:])
    alone = ~(np.append(like_next, False) | np.insert(like_next, 0, False))[: len(order)]
    felt = np.abs(seen).max(axis=0, initial=0.0) > UNCOUPLED_TOLERANCE * scale
    coupled[order[alone]] = felt[order[alone]]
    while start < len(order):
        if alone[start] and felt[order[start]]:
            start += 1
            continue
        stop = start + 1
        while stop < len(order) and _same(stiffness, damping, order[start], order[stop]):
            stop += 1
        group = order[start:stop]
        if len(group) == 1:
            basis, rank = np.eye(1), 0
        else:
            _, values, vh = np.linalg.svd(seen[:, group], full_matrices=True)
            basis, rank = vh, int(np.sum(values > UNCOUPLED_TOLERANCE * scale))
        rotated[:, group] = real[:, group] @ basis.T
        coupled[group[:rank]] = True
        for k in range(rank, len(group)):
            combination = np.zeros(len(stiffness))
            combination[group] = basis[k]
            for pole_root in _poles(float(stiffness[group[k]]), float(damping[group[k]])):
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


def _same(stiffness: Array, damping: Array, i: IntArray, j: IntArray) -> BoolArray:
    """Whether poles i (k,) and j (k,) are one but for rounding."""
    least = 1e-12 * np.sqrt(np.abs(stiffness[j]))
    return (np.abs(stiffness[i] - stiffness[j]) <= 1e-11 * np.abs(stiffness[j])) & (
        np.abs(damping[i] - damping[j]) <= 1e-9 * np.maximum(np.abs(damping[j]), least)
    )


def _poles(stiffness: float, damping: float) -> list[complex]:
    """Roots of λ² + cλ + ω² in the closed upper half plane: one, or both where they are real."""
    half = damping / 2
    inside = half * half - stiffness
    if inside <= 0:
        return [complex(-half, np.sqrt(-inside))]
    fast = -half - np.copysign(np.sqrt(inside), half)  # of the same sign: none is lost, nor zero
    return [complex(stiffness / fast), complex(fast)]


def frictionless_roots(spectrum: ReceptanceProblem, limit: float) -> ComplexArray:
    """Coupled eigenvalues at μ = 0 with |λ| ≤ about 1.3 ``limit`` [1/s] (k,), sorted by |λ|.

    At μ = 0 the coupled stiffness is symmetric and the dense solver finds every root, so the count
    is right from the start; damping is then put in by the simultaneous iteration, or, where it is
    strong or not proportional, by a dense solve of the damped problem. Upper half plane; roots on the
    real axis are all listed. The margin keeps guards beside the outermost root asked for.
    """
    spectrum, own = _without_tangential(spectrum)
    starts: ComplexArray | None = None
    if spectrum.modes.proportional:
        limit = min(limit, _beyond(spectrum)) or limit  # the dense problems are scaled by it
        starts = _dense_undamped(spectrum, limit)
    if starts is None:
        starts = dense_roots(spectrum, 0.0, 1.3 * limit)
        starts = starts[starts.imag >= 0]
    own = own[np.abs(own) <= 1.3 * limit]
    starts = starts[np.argsort(np.abs(starts), kind="stable")]
    if not len(starts):
        return own
    roots, converged = polish(spectrum, starts, starts.imag != 0.0, 0.0)
    if not converged:
        raise Unfit(
            "the eigenvalues without friction do not settle: two modes coincide at the contact; change a "
            "length or a frequency limit slightly",
            limit / (2 * np.pi),
        )
    roots = np.concatenate([roots, own])
    return roots[np.argsort(np.abs(roots), kind="stable")]


def _beyond(spectrum: ReceptanceProblem) -> float:
    """A rate [1/s] that no coupled eigenvalue of proportionally damped components exceeds at μ = 0: in modal
    coordinates |λ|² ≤ |C| |λ| + |K| with the contacts' stiffness in K."""
    compliance = spectrum.coupling.compliance
    normal = spectrum.projections[0::2]
    stiffness = float(np.abs(spectrum.modes.stiffness).max(initial=0.0))
    elastic = compliance > 0
    stiffness += float((normal[elastic] ** 2).sum(axis=1) @ (1.0 / compliance[elastic]))
    return float(np.abs(spectrum.modes.damping).max(initial=0.0)) + math.sqrt(stiffness)


def _without_tangential(spectrum: ReceptanceProblem) -> tuple[ReceptanceProblem, ComplexArray]:
    """The problem at μ = 0, where modes with tangential motion alone keep their poles, and those poles.

    They come into it where friction has a slope, and then only with μ.
    """
    if not spectrum.coupling.sloped:
        return spectrum, np.zeros(0, dtype=complex)
    modes, rows = spectrum.modes, spectrum.receptance.real.copy()
    moved = np.abs(rows).max(axis=0, initial=0.0) > 0
    seen = np.zeros(rows.shape[1], dtype=bool)
    seen[_coupled_columns(spectrum)] = True
    alone = np.flatnonzero(moved & ~seen)
    rows[:, alone] = 0.0
    own = [p for k in alone for p in _poles(float(modes.stiffness[k]), float(modes.damping[k]))]
    receptance = replace(spectrum.receptance, real=rows)
    still = replace(
        spectrum,
        receptance=receptance,
        fixed=np.concatenate([spectrum.fixed, own]),
        pole_stiffness=modes.stiffness[seen],
        pole_damping=modes.damping[seen],
    )
    return still, np.array(own, dtype=complex)


def _dense_undamped(spectrum: ReceptanceProblem, limit: float) -> ComplexArray | None:
    """Undamped coupled roots with damping to first order; None where that is too strong for a start."""
    keep = _coupled_columns(spectrum)
    normal = spectrum.receptance.real[0::2][:, keep]
    compliance, poles = spectrum.coupling.compliance, spectrum.modes.stiffness[keep]
    found = _between_poles(normal[0], float(compliance[0]), poles, (1.3 * limit) ** 2) if len(normal) == 1 else None
    squares, shapes = _densely(normal, compliance, poles, limit) if found is None else found
    damping = np.einsum("ij,i,ij->j", shapes, spectrum.modes.damping[keep], shapes) / np.einsum(
        "ij,ij->j", shapes, shapes
    )
    if np.any(damping**2 > 0.04 * squares):
        return None
    return -damping / 2 + 1j * np.sqrt(squares - damping**2 / 4)


def _between_poles(normal: Array, compliance: float, poles: Array, top: float) -> tuple[Array, Array] | None:
    """Squares ω² up to ``top`` and shapes (n, k) on the modes where one contact couples them: the zeros of

        1/K_c + Σ φ²/(ω_i² − x) ,

    which grows from −∞ to ∞ between two poles, so that there is one between each and the next and none below the first.
    Near enough for `polish`. None where poles coincide, or one is negative.
    """
    order = np.argsort(poles)
    poles, squared = poles[order], normal[order] ** 2
    # With K_c infinite there is none above the last pole.
    last = poles[-1:] + squared.sum() / compliance if compliance else poles[:0]
    low, width = poles[: len(poles) - 1 + len(last)], np.diff(np.append(poles, last))
    if not len(low) or poles[0] < 0 or np.any(width <= APART * np.abs(poles[-1])):
        return None
    low, width = low[low < top], width[: int(np.sum(low < top))]
    before, after = np.zeros(len(low)), np.ones(len(low))
    away = poles[:, None] - low
    for _ in range(HALVINGS):
        middle = (before + after) / 2
        above = compliance + squared @ (1.0 / (away - middle * width)) > 0
        before, after = np.where(above, before, middle), np.where(above, middle, after)
        if np.all((after - before) * width <= NEAR_ROOT * (low + before * width)):
            break
    part = (before + after) / 2
    shapes = np.empty((len(poles), len(low)))
    shapes[order] = normal[order, None] / (away - part * width)
    squares = low + part * width
    inside = squares < top
    return squares[inside], shapes[:, inside]


def _densely(normal: Array, compliance: Array, poles: Array, limit: float) -> tuple[Array, Array]:
    """The same for any number of contacts from the dense problem, up to 1.3 ``limit``."""
    basis, stiffness = _elastic(normal, compliance, np.diag(poles))
    inertia = np.eye(stiffness.shape[0])
    # Inverting about a shift gives the low modes to full accuracy whatever K_c is.
    shift = (limit / 10) ** 2
    inverse, vectors = sl.eigh(inertia, stiffness + shift * inertia)
    low = inverse > 1.0 / ((1.3 * limit) ** 2 + shift)
    return np.maximum(1.0 / inverse[low] - shift, 0.0), basis @ vectors[:, low]


def _elastic(normal: Array, compliance: Array, stiffness: Array) -> tuple[Array, Array]:
    """Basis of what rigid contacts leave free, and the stiffness with the elastic ones in it."""
    rigid = compliance == 0.0
    soft = normal[~rigid]
    stiffness = stiffness + soft.T @ (soft / compliance[~rigid][:, None])
    if not rigid.any():
        return np.eye(len(stiffness)), stiffness
    basis = sl.null_space(normal[rigid])
    return basis, basis.T @ stiffness @ basis


def dense_roots(spectrum: ReceptanceProblem, mu: float, limit: float) -> ComplexArray:
    """Every eigenvalue with |λ| ≤ ``limit`` [1/s] but the fixed ones, densely in physical freedoms."""
    coupling, system = spectrum.coupling, spectrum.coupling.system
    rows = system.contact_rows()
    normal, tangent = rows[0::2], rows[1::2]
    push = normal + mu * coupling.sense[:, None] * tangent
    rigid = coupling.compliance == 0.0
    soft = push[~rigid].T @ (normal[~rigid] / coupling.compliance[~rigid][:, None])
    mass, damping, stiffness = (a.toarray() for a in (system.mass, system.damping, system.stiffness))
    stiffness = stiffness + soft
    damping = damping + (tangent.T * coupling.friction_damping(mu)) @ tangent
    if rigid.any():
        right, left = sl.null_space(normal[rigid]), sl.null_space(push[rigid])
        if right.shape != left.shape:
            raise AnalysisError(undetermined(mu))
        mass, damping, stiffness = (left.T @ a @ right for a in (mass, damping, stiffness))
    shift = limit / 13
    matrix = companion(mass, damping, stiffness, shift)[0] if shift > 0.0 else np.full((1, 1), np.nan)
    if not np.all(np.isfinite(matrix)):
        # Two or more zero roots beside what merges with them: nothing is left to invert.
        raise FollowingError(f"branches cannot be told apart near μ = {mu:.9g}: several roots are zero there")
    theta = sl.eigvals(matrix)
    theta = theta[np.abs(theta) > shift / (3 * limit)]
    values = shift * (1.0 + 1.0 / theta)
    values = np.where(np.abs(values.imag) < 1e-9 * np.abs(values), values.real + 0j, values)
    values = values[np.abs(values) <= limit]
    fixed = spectrum.fixed
    return _without(values, np.concatenate([fixed, np.conj(fixed[fixed.imag != 0])]))


def _without(values: ComplexArray, fixed: ComplexArray) -> ComplexArray:
    """Take the eigenvalues nearest to the fixed ones out."""
    left = list(values)
    for pole in fixed:
        if left:
            nearest = int(np.argmin([abs(v - pole) for v in left]))
            if abs(left[nearest] - pole) < 1e-6 * max(abs(pole), 1.0):
                left.pop(nearest)
    return np.array(left, dtype=complex)


def _coupled_columns(spectrum: ReceptanceProblem) -> IntArray:
    seen = spectrum.receptance.real[0::2]
    scale = max(float(np.abs(spectrum.receptance.real).max(initial=0.0)), 1e-300)
    return np.flatnonzero(np.abs(seen).max(axis=0, initial=0.0) > UNCOUPLED_TOLERANCE * scale)


def polish(
    spectrum: ReceptanceProblem, starts: ComplexArray, implied: BoolArray, mu: float, *, steps: int = MAX_STEPS
) -> tuple[ComplexArray, bool]:
    """Simultaneous iteration from ``starts`` (k,), the ``implied`` conjugate roots (k,) held apart too.

    Returns the roots (k,) and whether all of them converged to rounding.
    """
    roots = np.array(starts, dtype=complex)
    nearby = _poles_near(spectrum, roots)
    single = spectrum.single(mu)
    if single is not None and len(roots):
        left = polish_single(roots, implied, single, nearby, steps, CONVERGED)
        return roots, bool(not left and np.all(np.isfinite(roots)))
    smallest = np.full(len(roots), np.inf)
    active = np.ones(len(roots), dtype=bool)
    for _ in range(steps):
        index = np.flatnonzero(active)
        step = _step(spectrum, roots, implied, index, nearby, mu)
        # On a pole to the last bit there is no step: a nudge leads off it, which is no sign of convergence.
        nudged = ~np.isfinite(step)
        step = np.where(nudged, NUDGE * roots[index], step)
        relative = np.where(nudged, np.inf, np.abs(step) / np.maximum(np.abs(roots[index]), 1e-300))
        roots[index] = roots[index] - step
        # Beside a coalescence the last digits stagnate above that; no step helps further then.
        done = (relative < CONVERGED) | ((relative < 1e-7) & (relative >= 0.5 * smallest[index]))
        smallest[index] = np.minimum(smallest[index], relative)
        active[index[done]] = False
        if not active.any():
            break
    return roots, bool(not active.any() and np.all(np.isfinite(roots)))


def _poles_near(spectrum: ReceptanceProblem, roots: ComplexArray) -> tuple[Array, Array]:
    reach = 1.5 * np.abs(roots).max()
    overdamped, slow = spectrum.slow_poles
    near = (spectrum.pole_stiffness <= reach**2) | (overdamped & (slow <= reach))
    return spectrum.pole_stiffness[near], spectrum.pole_damping[near]


def _step(
    spectrum: ReceptanceProblem,
    roots: ComplexArray,
    implied: BoolArray,
    index: IntArray,
    poles: tuple[Array, Array],
    mu: float,
) -> ComplexArray:
    lam = roots[index]
    with np.errstate(all="ignore"):
        value, by_lambda, _ = spectrum.evaluate(lam, mu)
        single = value.shape[1] == 1
        slope = by_lambda[:, 0, 0] / value[:, 0, 0] if single else _trace_of_quotient(value, by_lambda)
        others = deflation(roots, implied, index, poles, spectrum.modes.poles)
        step = 1.0 / (slope + others)
    # A root hit exactly stays, unless another one is there already.
    return np.where((value[:, 0, 0] == 0.0) & np.isfinite(others), 0.0, step) if single else step


def _trace_of_quotient(value: ComplexArray, slope: ComplexArray) -> ComplexArray:
    """tr(T⁻¹ T') (k,), infinite where T is singular to the last bit: a root hit exactly."""
    # Rows are of very different size where soft and rigid contacts meet.
    size = np.abs(value).max(axis=2, keepdims=True)
    size = np.where((size > 0) & np.isfinite(size), size, 1.0)
    value, slope = value / size, slope / size
    try:
        return np.trace(np.linalg.solve(value, slope), axis1=1, axis2=2)
    except np.linalg.LinAlgError:
        pass
    result = np.full(len(value), np.inf, dtype=complex)
    for k in range(len(value)):
        try:
            result[k] = np.trace(np.linalg.solve(value[k], slope[k]))
        except np.linalg.LinAlgError:
            continue
    return result

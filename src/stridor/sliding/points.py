"""Steady sliding: the equilibrium that both approaches start from.

K u − Σ (n + μ s t) N = f − C_L v,   g₀ + nᵀu + N/K_c = 0,   N ≥ 0   (paper 1.3, eqs 2–4)

with s = −sign(slip of the slave relative to the master), so that friction opposes the slip.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spl

from ..direct.dense import solved
from ..errors import AnalysisError
from ..system import System
from ..typing import Array, BoolArray
from .equilibrium import FEW, sets_near, unsettled
from .redundant import closed, redundant
from .small import SMALL

ROUNDING = 1e-12  # of the largest force, and of the largest gap or way towards it
SIGNS = 6  # times at most that forces of contacts kept closed change their sign
SOFTEST = 1e150  # of a contact in the scaled matrix: as good as without stiffness, and far from an overflow
LEAST = 0.2  # of the speeds: a mean velocity below that is no direction (a whole turning ring)


@dataclass(frozen=True)
class SteadySliding:
    """Equilibrium under friction. m contacts.

    displacement (n,) [m] relative to the moving supports; normal_force (m,) [N] in compression,
    slip_speed (m,) [m/s] signed along the tangent, sense s (m,) = −sign(slip_speed), active (m,)
    whether the contact carries load; residual is ‖K u − …‖∞ over the largest term.
    """

    displacement: Array
    normal_force: Array
    slip_speed: Array
    sense: Array
    active: BoolArray
    friction_coefficient: Array
    residual: float


def slip_speeds(system: System, motion_factors: Array) -> Array:
    """Slip (m,) [m/s] of slave relative to master at rest in the moving frame."""
    return np.array([float(c.tangent_lift @ motion_factors) for c in system.contacts])


def mean_direction(slip: Array) -> Array | None:
    """Unit vector (q,) of slip velocities (m, q), None where they have no direction in common."""
    speeds = np.linalg.norm(slip, axis=1)
    mean = slip.mean(axis=0) if len(slip) else np.zeros(1)
    size = float(np.linalg.norm(mean))
    return mean / size if size > LEAST * float(speeds.max(initial=0.0)) > 0.0 else None


def full_motion(system: System) -> Array:
    """Factors (p,) of the moving supports in steady sliding: one, or those that run on after the last load step; zero
    for those that are pressed away by a distance."""
    if system.load_steps:
        last = system.load_steps[-1]
        return np.zeros_like(last.velocities) if last.duration is not None else last.velocities
    return system.motion.full


def steady_sliding(
    system: System,
    *,
    mu: float | None = None,
    load_factors: Mapping[str, float] | None = None,
    motion_factors: Array | None = None,
) -> SteadySliding:
    """Solve the steady sliding equilibrium with an active set on the contacts.

    mu replaces the friction coefficient of every contact (its law scaled at its slip speed);
    load_factors default to one for every load, motion_factors (p,) to one for every support.
    Raises AnalysisError where no contact slides, a contact is pulled apart as a whole, or the
    structure is not held.
    """
    factors = full_motion(system) if motion_factors is None else motion_factors * system.motion.full
    system = system.in_place()
    speeds = slip_speeds(system, factors)
    for contact, speed in zip(system.contacts, speeds, strict=True):
        normal_speed = float(contact.normal_lift @ factors)
        if abs(normal_speed) > 1e-9 * max(abs(float(speed)), 1e-30) and abs(normal_speed) > 1e-15:
            raise AnalysisError(
                f"contact {contact.name}: the prescribed velocities change its gap at {normal_speed:g} m/s, "
                "so there is no steady sliding; let the supports move along the master line"
            )
    coefficients = (
        system.friction_coefficients(np.abs(speeds)) if mu is None else float(mu) * system.contact_nodes().share
    )
    if not np.any(speeds):
        _require_slip(system, speeds, coefficients, np.ones(len(speeds), dtype=bool))
    sense = -np.sign(speeds)
    force = external_force(system, load_factors) - system.motion.damping @ factors
    return _active_set(system, force, coefficients, sense, speeds)


def _require_slip(system: System, speeds: Array, coefficients: Array, touches: BoolArray) -> None:
    """Raise AnalysisError where a contact touches and does not slide: how its friction acts is then not known."""
    for k, contact in enumerate(system.contacts):
        if touches[k] and speeds[k] == 0.0 and coefficients[k] > 0.0:
            raise AnalysisError(
                f"contact {contact.name} does not slide: no support moves one of its bodies along the "
                "tangent; give a support a velocity"
            )


def steady_points(system: System, mu: float | None = None) -> SteadySliding:
    """`steady_sliding` under all loads and motions, solved once for each μ and kept with the system."""
    return system.once(("steady sliding of points", mu), lambda: steady_sliding(system, mu=mu))


def external_force(system: System, load_factors: Mapping[str, float] | None) -> Array:
    """The sum (n,) of all loads, each by its factor, by name (None: 1 for all)."""
    force = np.zeros(system.size)
    for name, vector in system.loads.items():
        force += vector * (1.0 if load_factors is None else load_factors.get(name, 1.0))
    return force


class _SignsUnclear(AnalysisError):
    """Where contacts kept closed push and where they pull does not settle: there may be an equilibrium all the same."""


@dataclass(frozen=True)
class _Found:
    """An equilibrium, and which contacts would rather let go of one another (pulled) or touch (closing), each (m,)."""

    displacement: Array
    normal: Array
    gaps: Array
    sense: Array
    active: BoolArray
    pulled: BoolArray
    closing: BoolArray
    residual: float

    @property
    def settled(self) -> bool:
        """Whether none would."""
        return not self.pulled.any() and not self.closing.any()


def _with(system: System, force: Array, mu: Array, slips: Array, active: BoolArray) -> _Found:
    """The equilibrium with these contacts touching. Raises AnalysisError where there is none."""
    kept = np.array([c.closed for c in system.contacts], dtype=bool)
    sign = np.ones(len(active))
    for _ in range(SIGNS):
        # Friction is μ|N| against the slip: where a contact kept closed pulls, it goes with −N.
        sense = sign * slips
        displacement, normal, residual = _solve(system, force, mu, sense, active)
        before, sign = sign, np.where(kept & (normal < 0), -1.0, 1.0)
        if np.array_equal(sign, before):
            break
    else:
        raise _SignsUnclear(
            "steady sliding: where contacts kept closed push and where they pull does not settle at "
            f"{words_of_friction(mu)}"
        )
    ways = np.array([c.normal_row @ displacement for c in system.contacts])
    gaps = np.array([c.gap for c in system.contacts]) + ways
    # Where a contact opens or closes, its force and its gap are zero but for rounding, with it and without.
    pulls = ROUNDING * np.abs(normal).max(initial=0.0)
    overlaps = ROUNDING * max(np.abs(gaps).max(initial=0.0), np.abs(ways).max(initial=0.0))
    pulled, closing = active & ~kept & (normal < -pulls), ~active & (gaps < -overlaps)
    return _Found(displacement, normal, gaps, sense, active, pulled, closing, residual)


def _settled(system: System, force: Array, mu: Array, slips: Array) -> _Found:
    """The equilibrium in which no contact pulls and none penetrates, searched for from that of all contacts. Of few
    contacts all sets are tried where that goes round in circles, or meets one that does not hold the structure."""
    count = len(system.contacts)
    active = np.ones(count, dtype=bool)
    failed: AnalysisError | None = None
    try:
        for _ in range(4 * count + 2):
            found = _with(system, force, mu, slips, active)
            if found.settled:
                return found
            active = (active & ~found.pulled) | found.closing
    except AnalysisError as error:
        failed = error
    free = np.flatnonzero([not c.closed for c in system.contacts])
    for active in sets_near(np.ones(count, dtype=bool), free) if 1 < len(free) <= FEW else ():
        try:
            found = _with(system, force, mu, slips, active)
        except _SignsUnclear as error:
            failed = failed or error
            continue
        except AnalysisError:  # it does not hold the structure
            continue
        if found.settled:
            return found
    raise failed or AnalysisError(
        f"steady sliding at {words_of_friction(mu)}: {unsettled(len(free), 4 * count + 2)}"
    )


def _active_set(system: System, force: Array, mu: Array, sense: Array, speeds: Array) -> SteadySliding:
    count = len(system.contacts)
    found = _settled(system, force, mu, sense)
    active, displacement, gaps = found.active, found.displacement, found.gaps
    if twice := _twice(system, closed(active, gaps, displacement)):
        raise AnalysisError(twice)
    if count and not active.any():
        names = ", ".join(c.name for c in system.contacts)
        raise AnalysisError(
            f"no contact carries load in steady sliding at {words_of_friction(mu)} (contacts: {names}): the loads pull "
            "the bodies apart, or friction lifts them off at this coefficient; check the direction of the loads"
        )
    _require_slip(system, speeds, mu, active)  # a stop beside, which stays open, need not
    return SteadySliding(displacement, found.normal, speeds, found.sense, active, mu, found.residual)


def words_of_friction(mu: Array) -> str:
    """Friction coefficients (m,) of contacts, as in "μ = 0.3" or "μ = 0.1 … 0.3"."""
    low, high = float(np.min(mu)), float(np.max(mu))
    return f"μ = {low:g}" if f"{low:g}" == f"{high:g}" else f"μ = {low:g} … {high:g}"


def _solve(system: System, force: Array, mu: Array, sense: Array, active: BoolArray) -> tuple[Array, Array, float]:
    if twice := _twice(system, active):
        raise AnalysisError(twice)
    touching = [k for k in range(len(system.contacts)) if active[k]]
    contacts = [system.contacts[k] for k in touching]
    normals = np.array([c.normal_row for c in contacts]).reshape(len(contacts), system.size)
    tangents = np.array([c.tangent_row for c in contacts]).reshape(len(contacts), system.size)
    push = normals + (mu * sense)[touching][:, None] * tangents
    # Multipliers are scaled to the stiffness so that the bordered matrix is well balanced.
    scale = float(np.abs(system.stiffness).max())
    with np.errstate(over="ignore"):
        softness = np.array([c.compliance for c in contacts]) * scale * scale
    softness = np.minimum(softness, SOFTEST)
    right = np.concatenate([force, [-c.gap * scale for c in contacts]])
    size = system.size
    with np.errstate(all="ignore"):
        normals, push = normals * scale, push * scale
        bordered, answer = _dense(system, normals, push, softness, right)
        if answer is None:
            bordered, answer = _sparse(system, normals, push, softness, right)
        terms = np.abs(bordered) @ np.abs(answer) + np.abs(right)
        residual = float(np.abs(bordered @ answer - right).max() / max(terms.max(), 1e-300))
    if not np.isfinite(residual) or residual > 1e-8 or _loose(answer[:size], system):
        open_names = [c.name for k, c in enumerate(system.contacts) if not active[k]]
        reason = f"; contacts that would pull: {', '.join(open_names)}" if open_names else ""
        raise AnalysisError(
            "steady sliding has no equilibrium: the structure can move freely under its loads"
            f"{reason}; fix a freedom of the loose body, or turn the load so that it presses the bodies together"
        )
    normal = np.zeros(len(system.contacts))
    normal[touching] = answer[size:] * scale
    return answer[:size], normal, residual


def _dense(system: System, normal: Array, push: Array, softness: Array, right: Array) -> tuple[Any, Array | None]:
    """The bordered matrix and the answer (n + m,), where it is small and clearly regular."""
    n, size = system.size, len(right)
    if size > SMALL:
        return None, None
    bordered = np.zeros((size, size))
    bordered[:n, :n] = system.stiffness.toarray()
    bordered[:n, n:], bordered[n:, :n] = -push.T, normal
    bordered[range(n, size), range(n, size)] = softness
    return bordered, solved(bordered, right)


def _sparse(system: System, normal: Array, push: Array, softness: Array, right: Array) -> tuple[Any, Array]:
    """The bordered matrix and the answer (n + m,), not finite where the matrix is singular."""
    bordered = sp.block_array(
        [[system.stiffness, sp.csr_array(-push.T)], [sp.csr_array(normal), sp.csr_array(np.diag(softness))]],
        format="csc",
    )
    try:
        solver = spl.splu(bordered, permc_spec="COLAMD")
        answer = solver.solve(right)
        return bordered, answer + solver.solve(right - bordered @ answer)
    except RuntimeError:
        return bordered, np.full(len(right), np.nan)


def _twice(system: System, active: BoolArray) -> str:
    """What is said where rigid contacts press on the same freedoms, "" where none do."""
    rigid = active & np.array([c.compliance == 0.0 for c in system.contacts], dtype=bool)
    return redundant(system, system.contact_nodes(), rigid) if np.count_nonzero(rigid) > 1 else ""


def _loose(displacement: Array, system: System) -> bool:
    """A free mechanism shows as displacements larger than any structure: beyond 1e6 times its extent."""
    if not system.lines:
        return bool(np.abs(displacement).max(initial=0.0) > 1e12)
    extent = max(float(np.ptp(line.coordinates, axis=0).max()) for line in system.lines)
    return bool(np.abs(displacement).max(initial=0.0) > 1e6 * extent)

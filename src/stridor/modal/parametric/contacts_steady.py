"""What steady sliding adds to a problem with parameters: laws with a slope, friction damping, prestress.

Normal forces and displacements of steady sliding depend smoothly on friction, contact stiffness and whatever else loads
the contacts differently, as long as the same nodes touch. They are solved for at Chebyshev points of all of these and
interpolated; the nodes that touch are held, whichever the signs of their forces become.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from ...contact.nodes import ContactNodes
from ...direct import SingularMatrix
from ...errors import AnalysisError
from ...sliding import full_motion, unstressed
from ...sliding.solution import STILL
from ...system import System
from ...typing import Array, IntArray, Sparse
from ..krylov.steady import Steadiness, shared
from .contacts_equilibria import Equilibria, HeldEquilibria
from .contacts_sampling import Sampled, Values, combined_matrices, directions, sampled
from .family import term_of
from .problem import Parameter, Role, Term

FRICTION, STIFFNESS = "mu", "contact_stiffness"
PULLING = 1e-9  # of the largest normal force, or gap: more than rounding


@dataclass(frozen=True)
class Contacts:
    """The touching nodes (m,) of a system: rows of the gap N and along the slip T (m, n), compliance (m,), slip speed
    (m,). Of all nodes (k,): the sense (k, d−1) against the slip and the friction coefficient (k,) of their laws."""

    nodes: ContactNodes
    touching: IntArray
    normal: Sparse
    slide: Sparse
    compliance: Array
    speed: Array
    sense: Array
    coefficient: Array

    @property
    def friction(self) -> float | None:
        """The one friction coefficient of all touching nodes that slip, None where they differ."""
        moving = np.any(self.sense[self.touching] != 0.0, axis=1)
        found = self.coefficient[self.touching][moving]
        if not len(found):
            return 0.0
        return float(found[0]) if np.ptp(found) <= 1e-12 * np.max(np.abs(found)) else None

    @property
    def pushing(self) -> Sparse:
        """S (m, n): friction pushes with μ S, each node with its share of μ."""
        return shared(self.slide, self.nodes.select(self.touching).share)

    @property
    def across(self) -> Sparse:
        """Rows T (m, n) across the direction of slip, in space."""
        sense = self.sense[self.touching]
        return self.nodes.select(self.touching).along(np.stack([-sense[:, 1], sense[:, 0]], axis=1))


def contacts_of(system: System, touching: IntArray) -> Contacts:
    """The contacts of a system with the nodes that touch given."""
    nodes = system.contact_nodes()
    slip = nodes.slip_velocity(full_motion(system))
    speed = np.linalg.norm(slip, axis=1)
    slips = speed > STILL * float(speed.max(initial=0.0))
    sense = np.where(slips[:, None], -slip / np.where(slips, speed, 1.0)[:, None], 0.0)
    chosen = nodes.select(touching)
    return Contacts(
        nodes,
        touching,
        chosen.normal,
        chosen.along(sense[touching]),
        chosen.compliance,
        speed[touching],
        sense,
        nodes.friction_coefficients(speed),
    )


def steady_terms(
    system_at: Callable[[Values], System],
    parameters: tuple[Parameter, ...],
    touching: IntArray,
    effects: Steadiness,
) -> tuple[list[Term], tuple[str, ...]]:
    """Damping and stiffness that steady sliding adds over all parameters, and sentences on what it means that the
    touching nodes are held.

    system_at: the system at values of the parameters. effects: what of the steady state counts. Raises AnalysisError
    where there is no equilibrium, or where it changes too sharply to be interpolated.
    """
    states = _States(system_at, touching, effects)
    # What needs a system of its own varies slowest.
    parameters = tuple(sorted(parameters, key=lambda p: p.name in (FRICTION, STIFFNESS)))
    try:
        terms = _all_terms(states, parameters, effects)
    finally:
        states.free()
    return terms, states.notes()


def _all_terms(states: _States, parameters: tuple[Parameter, ...], effects: Steadiness) -> list[Term]:
    terms: list[Term] = []
    if effects.damps:
        grid = sampled(parameters, states.rates, "the damping of steady sliding")
        terms += _terms(grid, parameters, states.rates, states.damping, "damping")
    if effects.prestress:
        grid = sampled(parameters, states.probe, "the prestress of steady sliding")
        terms += _terms(grid, parameters, states.motion, states.stiffness, "stiffness")
    return terms


class _States:
    """Steady sliding at values of the parameters, the touching nodes held, solved for once for each."""

    def __init__(self, system_at: Callable[[Values], System], touching: IntArray, effects: Steadiness) -> None:
        self._system_at, self._touching, self._effects = system_at, touching, effects
        self._known: dict[tuple[tuple[str, float], ...], tuple[Array, Array]] = {}
        self._worst: tuple[int, int, dict[str, float]] = (0, 0, {})
        self._direction: Array | None = None
        self._last: tuple[System, Equilibria] | None = None

    def free(self) -> None:
        """Give the memory of a factorisation back."""
        if self._last is not None:
            self._last[1].free()

    def rates(self, values: Values) -> Array:
        """Rates of friction (m,) or (2m,) [N s/m] along the slip, N dμ/d|v|, and where it counts across it, μN/|v|."""
        return self._solved(values)[0]

    def motion(self, values: Values) -> Array:
        """Displacement (n,) [m], that the stresses are of."""
        return self._solved(values)[1]

    def probe(self, values: Values) -> Array:
        """The geometric stiffness times an arbitrary vector (n,): as small as the stresses, unlike displacements, which
        may strain nothing."""
        if self._direction is None:
            self._direction = np.random.default_rng(20061).standard_normal(len(self.motion(values)))
        return self.stiffness(values, self.motion(values)) @ self._direction

    def damping(self, values: Values, rates: Array) -> Sparse:
        """The damping (n, n) that rates make."""
        contacts = contacts_of(self._system_at(values), self._touching)
        m = len(self._touching)
        matrix = contacts.slide.T @ sp.diags_array(rates[:m]) @ contacts.slide
        if len(rates) > m:
            across = contacts.across
            matrix = matrix + across.T @ sp.diags_array(rates[m:]) @ across
        return sp.csr_array(matrix)

    def stiffness(self, values: Values, motion: Array) -> Sparse:
        """The geometric stiffness (n, n) that the stresses of a displacement make."""
        made = self._system_at(values).stress_stiffness
        assert made is not None, "counts only where bodies have stresses"
        return made(motion)

    def notes(self) -> tuple[str, ...]:
        """What holding the touching nodes means for the states that were solved for."""
        pulling, closing, at = self._worst
        if not pulling and not closing:
            return ()
        where = ", ".join(f"{name} = {value:.4g}" for name, value in at.items())
        told = _told(pulling, closing, len(self._touching))
        return (f"At {where} {told}; the reduced model holds the nodes that touch in the case as it is.",)

    def _solved(self, values: Values) -> tuple[Array, Array]:
        key = tuple(sorted(values.items()))
        if key not in self._known:
            self._known[key] = self._equilibrium(values)
        return self._known[key]

    def _equilibrium(self, values: Values) -> tuple[Array, Array]:
        system, effects, touching = self._system_at(values), self._effects, self._touching
        if unstressed(system):
            return np.zeros(0), np.zeros(system.size)
        contacts = contacts_of(system, touching)
        nodes = contacts.nodes
        mu = values[FRICTION] * nodes.share if FRICTION in values else contacts.coefficient
        if self._last is None or self._last[0] is not system:
            self.free()
            self._last = system, Equilibria(system, nodes, touching, contacts.sense, effects.solver)
        try:
            held = self._last[1].at(mu, values.get(STIFFNESS, 1.0))
        except SingularMatrix as error:
            where = ", ".join(f"{name} = {value:.6g}" for name, value in values.items())
            raise AnalysisError(
                f"steady sliding has no equilibrium at {where or 'the values of the case'} with the nodes that touch "
                "in the case as it is; take smaller ranges"
            ) from error
        normal = held.normal_force
        self._noted(contacts, held, values)
        rates = normal * nodes.select(touching).friction_slopes(contacts.speed, mu[touching])
        if effects.friction_damping:
            slips = np.any(contacts.sense[touching] != 0.0, axis=1)
            across = mu[touching] * normal / np.where(slips, contacts.speed, 1.0)
            rates = np.concatenate([rates, np.where(slips, across, 0.0)])
        return rates, held.displacement if effects.prestress else np.zeros(0)

    def _noted(self, contacts: Contacts, held: HeldEquilibria, values: Values) -> None:
        """Remember where most nodes are held that would not touch, or would."""
        pulling, closing = _unlike(contacts, held)
        if pulling + closing > sum(self._worst[:2]):
            self._worst = pulling, closing, dict(values)


def _unlike(contacts: Contacts, held: HeldEquilibria) -> tuple[int, int]:
    """How many nodes that are held would lift off, and how many others would touch."""
    others = np.ones(contacts.nodes.count, dtype=bool)
    others[contacts.touching] = False
    others &= np.diff(contacts.nodes.normal.indptr) > 0
    pulling = int(np.sum(held.normal_force < -PULLING * np.abs(held.normal_force).max(initial=0.0)))
    return pulling, int(np.sum(held.gap[others] < -PULLING * np.abs(held.gap).max(initial=0.0)))


def _told(pulling: int, closing: int, touching: int) -> str:
    told = [f"{pulling} of {touching} touching nodes would lift off"] if pulling else []
    told += [f"{closing} open {'one' if closing == 1 else 'ones'} would touch"] if closing else []
    return " and ".join(told)


def unlike_at(
    system_at: Callable[[Values], System], touching: IntArray, points: Sequence[Values], solver: str | None
) -> list[tuple[Values, str]]:
    """At which of some points others than the nodes that are held would touch in steady sliding, each with words on
    how many: forces of theirs that pull, and gaps of others that close. A system is factorised once for all friction
    and contact stiffness."""
    found: list[tuple[Values, str]] = []
    last: tuple[System, Equilibria] | None = None
    for values in points:
        system = system_at(values)
        contacts = contacts_of(system, touching)
        nodes = contacts.nodes
        mu = values[FRICTION] * nodes.share if FRICTION in values else contacts.coefficient
        if last is None or last[0] is not system:
            if last is not None:
                last[1].free()
            last = system, Equilibria(system, nodes, touching, contacts.sense, solver)
        try:
            words = _told(*_unlike(contacts, last[1].at(mu, values.get(STIFFNESS, 1.0))), len(touching))
        except SingularMatrix:
            words = "no steady sliding"
        if words:
            found.append((values, words))
    if last is not None:
        last[1].free()
    return found


def _terms(
    grid: Sampled,
    parameters: tuple[Parameter, ...],
    state: Callable[[Values], Array],
    built: Callable[[Values, Array], Sparse],
    role: Role,
) -> list[Term]:
    """What is linear in a state, which friction and contact stiffness change alone, and whatever else it is made of,
    which the other parameters may."""
    reference = {p.name: p.value for p in parameters}
    points = [{**reference, **point} for point in grid.points]
    states = np.array([state(point) for point in points])
    slow = [axis.name for axis in grid.axes if axis.name not in (FRICTION, STIFFNESS)]
    if not slow:
        found = directions(grid.axes, grid.vectors)
        return [t for factor, weights in found for t in term_of(built(reference, weights @ states), role, factor)]
    fast = tuple(axis for axis in grid.axes if axis.name not in slow)
    groups: dict[tuple[float, ...], list[int]] = {}
    for k, point in enumerate(points):
        groups.setdefault(tuple(point[name] for name in slow), []).append(k)
    matrices: list[Sparse] = []
    tables: list[Array] = []
    for members in groups.values():
        for _, weights in directions(fast, grid.vectors[members]):
            matrices.append(built(points[members[0]], weights @ states[members]))
            table = np.zeros(len(points))
            table[members] = weights
            tables.append(table)
    if not matrices:
        return []
    combined = combined_matrices(grid.axes, matrices, tables)
    return [t for factor, matrix in combined for t in term_of(matrix, role, factor)]

"""The sparse problem that friction makes of a system, displacements and contact forces together."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp

from ...contact.nodes import ContactNodes
from ...errors import AnalysisError
from ...system import System
from ...typing import Array, BoolArray, IntArray, Sparse
from ..options import Options
from ..pencil import Pencil
from .steady import Steadiness, contact_rows, shared, steadiness, touching_nodes

CHEAP = 600  # freedoms below which an equilibrium costs next to nothing
MOST_EQUILIBRIA = 6
REMEMBERED = 3  # pencils


@dataclass(frozen=True)
class Extras:
    """What steady sliding at one μ adds: weakening d (m,) = N dμ/d|v| [N s/m] on slip T u, damping and stiffness
    (n, n)."""

    weakening: Array | None = None
    damping: Sparse | None = None
    stiffness: Sparse | None = None

    @property
    def damps(self) -> bool:
        """Whether any of it works on velocities."""
        return self.weakening is not None or self.damping is not None


NOTHING = Extras()


@dataclass(frozen=True)
class ContactProblem:
    """P(λ, μ) of m touching nodes on n freedoms: (λ²M + λC + K) u − (N + μS)ᵀ p = 0 and N u + c p = 0.

    normal N (m, n), slip T (m, n): relative displacement slave − master along the normal and against the slip; share
    (m,): of μ that each node has, S = share T; compliance c (m,) [m/N], 0 for rigid contact. touching (m,) are the
    places of the nodes among all the system's. damped: whether anything works on velocities. extras gives what steady
    sliding at a μ adds, None where nothing does. solver: that of `direct.factorise`.

    Nodes that stick have further rows behind those of the touching nodes: their tangential displacement in N, zero in
    S. contact_state: how many stick, slip and are open, "" where every node slides.
    """

    mass: Sparse
    damping: Sparse
    stiffness: Sparse
    normal: Sparse
    slip: Sparse
    share: Array
    compliance: Array
    touching: IntArray
    open_contacts: tuple[str, ...]
    damped: bool
    extras: Varying | None = None
    solver: str | None = None
    contact_state: str = ""

    @property
    def size(self) -> int:
        """Number of freedoms n."""
        return int(self.mass.shape[0])

    @property
    def nodes(self) -> int:
        """Number of touching nodes m."""
        return int(self.normal.shape[0])

    @cached_property
    def slide(self) -> Sparse:
        """S (m, n): friction pushes with μ S p."""
        return shared(self.slip, self.share)

    def at(self, mu: float) -> Extras:
        """What steady sliding at ``mu`` adds; nothing at μ = 0, where no friction force is there to vary."""
        return NOTHING if self.extras is None else self.extras(mu)

    def pencil(self, mu: float) -> Pencil:
        """P(λ) at ``mu``. The last few are remembered."""
        known = self._pencils
        if mu not in known:
            while len(known) >= REMEMBERED:
                known.pop(next(iter(known)))
            known[mu] = self._pencil(mu)
        return known[mu]

    @cached_property
    def _pencils(self) -> dict[float, Pencil]:
        return {}

    def _pencil(self, mu: float) -> Pencil:
        extras = self.at(mu)
        damping, stiffness = self.damping, self.stiffness
        if extras.weakening is not None:
            damping = damping + self.slip.T @ sp.diags_array(extras.weakening) @ self.slip
        if extras.damping is not None:
            damping = damping + extras.damping
        if extras.stiffness is not None:
            stiffness = stiffness + extras.stiffness
        push = sp.csr_array(self.normal + mu * self.slide) if mu else self.normal
        return Pencil(
            self.mass, sp.csr_array(damping), sp.csr_array(stiffness), self.normal, push, self.compliance
        )


def problem_of(
    system: System, mu: float | None, options: Options, *, frictions: Array | None = None
) -> ContactProblem:
    """The problem of the nodes that touch in steady sliding at ``mu`` (None: at the laws' own coefficients).

    frictions (k,): the friction coefficients that will be asked for; of large systems what the steady state adds is
    then solved for at some of them and interpolated between (`_grid`). Raises AnalysisError where there is no steady
    sliding, or where the options need loads that are not there.
    """
    nodes = system.contact_nodes()
    steady = touching_nodes(system, nodes, mu, options.solver)
    if steady.still and options.friction_damping and nodes.directions == 2:
        raise AnalysisError(
            "friction damping μN/v needs the slip velocity, and nodes slip at their limit of friction that no motion "
            "slides; write modal.friction_damping = false (compare has none of it in space)"
        )
    touching = np.flatnonzero(steady.active)
    # Contact that hardens has the stiffness of small motions about its force.
    shown = nodes if steady.force is None else nodes.at_force(steady.force)
    closed = {nodes.names[k] for k in nodes.owner[touching]}
    found = problem_held(
        system, shown, touching, steady.sense, steady.stuck, options, frictions=frictions
    )
    open_contacts = tuple(name for name in nodes.names if name not in closed)
    return replace(found, open_contacts=open_contacts, contact_state=steady.words)


def problem_held(
    system: System, shown: ContactNodes, touching: IntArray, sense: Array, stuck: BoolArray, options: Options,
    *, frictions: Array | None = None,
) -> ContactProblem:  # fmt: skip
    """The problem of nodes ``touching`` (k,) among those of ``shown``, which have the stiffness of small motions; the
    direction against the slip, sense (m, d−1), and who sticks, stuck (m,), are of all."""
    rows = contact_rows(shown, touching, sense, stuck)
    with_state = steadiness(system, system.contact_nodes(), touching, options, rows)
    has_damping = bool(system.damping.nnz and np.abs(system.damping.data).max() > 0)
    return ContactProblem(
        mass=system.mass,
        damping=system.damping if has_damping else sp.csr_array(system.damping.shape),
        stiffness=system.stiffness,
        normal=rows.normal,
        slip=rows.slip,
        share=rows.share,
        compliance=rows.compliance,
        touching=touching,
        open_contacts=(),
        damped=has_damping or with_state.damps,
        extras=None if with_state.neutral else Varying(with_state, _grid(system, frictions)),
        solver=options.solver,
    )


def _grid(system: System, frictions: Array | None) -> Array | None:
    """Where equilibria are solved: at 0 and the few friction coefficients asked for, or at Chebyshev points of their
    range, where polynomials are interpolated best. None, everywhere, where an equilibrium costs next to nothing."""
    if frictions is None or system.size < CHEAP or not float(np.max(frictions)):
        return None
    values = np.unique(np.append(frictions, 0.0))
    if len(values) <= MOST_EQUILIBRIA:
        return values
    return float(values[-1]) * (1 - np.cos(np.linspace(0, np.pi, MOST_EQUILIBRIA))) / 2


class Varying:
    """What each μ adds: exact where equilibria are solved, interpolated between; kept for the μ asked for before.

    grid (k,): where equilibria are solved, None for everywhere.
    """

    def __init__(self, state: Steadiness, grid: Array | None) -> None:
        self._state, self.grid = state, grid
        self._known: dict[float, Extras] = {}

    @property
    def rests(self) -> bool:
        """Whether nothing is added without friction."""
        return self._state.rests

    @property
    def reasons(self) -> list[str]:
        """What of the steady state adds terms, in words."""
        return self._state.reasons

    def __call__(self, mu: float) -> Extras:
        """The terms at ``mu``."""
        if mu == 0.0 and self.rests:
            return NOTHING
        if mu in self._known:
            return self._known[mu]
        if self.within(mu):
            assert self.grid is not None, "within it"
            if mu not in self.grid:
                return _between([self(float(g)) for g in self.grid], self.weights(mu))
        return self._known.setdefault(mu, Extras(*self._state.terms(mu)))

    def within(self, mu: complex) -> bool:
        """Whether ``mu`` is interpolated, at complex values as well."""
        return self.grid is not None and bool(self.grid[0] <= mu.real <= self.grid[-1])

    def weights(self, mu: complex) -> Any:
        """Weights (k,) of the terms on the grid, Lagrange's polynomials."""
        assert self.grid is not None, "asked for within the grid only"
        grid = self.grid
        return np.array([np.prod([(mu - b) / (a - b) for b in grid if b != a]) for a in grid])

    def slopes(self, mu: complex) -> Any:
        """Derivatives (k,) of the weights over μ."""
        assert self.grid is not None, "asked for within the grid only"
        grid = self.grid
        result = np.zeros(len(grid), dtype=complex if isinstance(mu, complex) else float)
        for i, a in enumerate(grid):
            others = [b for b in grid if b != a]
            parts = [np.prod([mu - b for b in others if b != left]) for left in others]
            result[i] = np.sum(parts) / np.prod([a - b for b in others])
        return result


def _between(terms: list[Extras], weights: Array) -> Extras:
    def total(name: str) -> Any:
        present = [w * getattr(t, name) for w, t in zip(weights, terms, strict=True) if getattr(t, name) is not None]
        return sum(present[1:], start=present[0]) if present else None

    return Extras(total("weakening"), total("damping"), total("stiffness"))

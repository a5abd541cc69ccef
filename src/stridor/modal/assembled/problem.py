"""The sparse problem that friction makes of a system, displacements and contact forces together."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp

from ...errors import AnalysisError
from ...system import System
from ...typing import Array, ComplexArray, IntArray, Sparse
from ..options import Options
from ..quadratic.problem import times
from .steady import Steadiness, contact_rows, steadiness, touching_nodes

CHUNK = 64  # columns worked on at a time

CHEAP = 600  # freedoms below which an equilibrium costs next to nothing
MOST_EQUILIBRIA = 6
NEGLIGIBLE = 1e-4  # of the largest displacement: gaps that open less than this are not judged more closely


@dataclass(frozen=True)
class Extras:
    """What steady sliding at one μ adds: weakening d (m,) = N dμ/d|v| [N s/m] on slip, damping and stiffness (n, n)."""

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

    normal N (m, n), slide S (m, n): relative displacement slave − master along the normal and against the slip;
    compliance c (m,) [m/N], 0 for rigid contact. touching (m,) are the places of the nodes among all the system's.
    damped: whether anything works on velocities. extras gives what steady sliding at a μ adds, None where nothing does.
    solver: that of `direct.factorise`.

    Nodes that stick have further rows behind those of the touching nodes: their tangential displacement in N, zero in
    S. contact_state: how many stick, slip and are open, "" where every node slides.
    """

    mass: Sparse
    damping: Sparse
    stiffness: Sparse
    normal: Sparse
    slide: Sparse
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

    def at(self, mu: float) -> Extras:
        """What steady sliding at ``mu`` adds; nothing at μ = 0, where no friction force is there to vary."""
        return NOTHING if self.extras is None else self.extras(mu)

    @cached_property
    def _sizes(self) -> tuple[Sparse, Sparse, Sparse, Sparse, Sparse]:
        """|M|, |C|, |K|, |N|, |S|."""
        return abs(self.mass), abs(self.damping), abs(self.stiffness), abs(self.normal), abs(self.slide)

    def residual(self, lam: ComplexArray, u: ComplexArray, p: ComplexArray, mu: float) -> ComplexArray:
        """(λ²M + λC + K) u − (N + μS)ᵀ p (n, k) for λ (k,), u (n, k), p (m, k); real where everything is."""
        return self._terms(lam, u, p, mu)

    def backward_error(
        self, lam: ComplexArray, u: ComplexArray, p: ComplexArray, mu: float, *, rest: ComplexArray | None = None
    ) -> Array:
        """Componentwise backward errors (k,), contact forces kept as unknowns and their equations judged alike.

        ‖P(λ)x‖∞ / ‖|P|(|λ|) |x|‖∞ of the equations of motion, and of the contacts' own, whichever is larger. rest
        (n, k) is what the pairs leave of the equations of motion, where it is known.
        """
        result = np.zeros(len(lam))
        for start in range(0, len(lam), CHUNK):
            part = slice(start, start + CHUNK)
            known = None if rest is None else rest[:, part]
            result[part] = self._judged(lam[part], u[:, part], p[:, part], mu, left=False, rest=known)
        return result

    def left_backward_error(self, lam: ComplexArray, y: ComplexArray, q: ComplexArray, mu: float) -> Array:
        """The same of left vectors: (λ²M + λC + K)ᵀ y − Nᵀ q = 0 and (N + μS) y + c q = 0."""
        result = np.zeros(len(lam))
        for start in range(0, len(lam), CHUNK):
            part = slice(start, start + CHUNK)
            result[part] = self._judged(lam[part], y[:, part], q[:, part], mu, left=True)
        return result

    def left_residual(self, lam: ComplexArray, y: ComplexArray, q: ComplexArray, mu: float) -> ComplexArray:
        """(λ²M + λC + K)ᵀ y − Nᵀ q (n, k)."""
        return self._terms(lam, y, q, mu, left=True)

    def _terms(
        self, lam: ComplexArray, u: ComplexArray, p: ComplexArray, mu: float, *, left: bool = False
    ) -> ComplexArray:
        """The residual of the equations of motion, from the right or from the left."""
        extras = self.at(mu)

        def flip(matrix: Sparse) -> Sparse:
            return matrix.T if left else matrix

        square: Any = lam**2
        if not np.any(square.imag):
            square = square.real
        total = square * times(self.mass, u) + times(self.stiffness, u) - times(self.normal.T, p)
        if mu and not left:
            total = total - mu * times(self.slide.T, p)
        if self.damping.nnz:
            total = total + lam * times(self.damping, u)
        if extras.weakening is not None:
            total = total + lam * times(self.slide.T, extras.weakening[:, None] * times(self.slide, u))
        if extras.damping is not None:
            total = total + lam * times(flip(extras.damping), u)
        if extras.stiffness is not None:
            total = total + times(flip(extras.stiffness), u)
        return total

    def _judged(
        self,
        lam: ComplexArray,
        u: ComplexArray,
        p: ComplexArray,
        mu: float,
        *,
        left: bool,
        rest: ComplexArray | None = None,
    ) -> Array:
        extras = self.at(mu)
        size, force, rate = np.abs(u), np.abs(p), np.abs(lam)
        mass, damping, stiffness, normal, slide = self._sizes
        scale = rate**2 * (mass @ size) + stiffness @ size + normal.T @ force
        if damping.nnz:
            scale += rate * (damping @ size)
        if not left:
            scale += mu * (slide.T @ force)
        for matrix, factor in ((extras.damping, rate), (extras.stiffness, 1.0)):
            if matrix is not None:
                scale += factor * (abs(matrix.T if left else matrix) @ size)
        if rest is None:
            rest = self._terms(lam, u, p, mu, left=left)
        error = np.abs(rest).max(axis=0) / tiny(scale.max(axis=0))
        if not self.nodes:
            return error
        rows = sp.csr_array(self.normal + mu * self.slide) if left else self.normal
        closure = np.abs(times(rows, u) + self.compliance[:, None] * p).max(axis=0)
        reach = (abs(rows) @ size + self.compliance[:, None] * force).max(axis=0)
        # A mode that hardly opens gaps at all (in the plane of the interface) leaves nothing but rounding there.
        reach = np.maximum(reach, NEGLIGIBLE * size.max(axis=0))
        return np.maximum(error, closure / tiny(reach))


def tiny(values: Array) -> Array:
    """The values, where they are zero the smallest number to divide by."""
    return np.maximum(values, 1e-300)


def problem_of(
    system: System, mu: float | None, options: Options, *, damped: bool, frictions: Array | None = None
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
    rows = contact_rows(shown, touching, steady.sense, steady.stuck)
    closed = {nodes.names[k] for k in nodes.owner[touching]}
    with_state = steadiness(system, nodes, touching, options, rows)
    has_damping = bool(system.damping.nnz and np.abs(system.damping.data).max() > 0)
    return ContactProblem(
        mass=system.mass,
        damping=system.damping if has_damping else sp.csr_array(system.damping.shape),
        stiffness=system.stiffness,
        normal=rows.normal,
        slide=rows.slide,
        compliance=rows.compliance,
        touching=touching,
        open_contacts=tuple(name for name in nodes.names if name not in closed),
        damped=has_damping or with_state.damps,
        extras=None if with_state.neutral else Varying(with_state, _grid(system, frictions)),
        solver=options.solver,
        contact_state=steady.words,
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

    def __call__(self, mu: float) -> Extras:
        """The terms at ``mu``."""
        if mu == 0.0 and self._state.rests:
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

    def slopes(self, mu: float) -> Array:
        """Derivatives (k,) of the weights over μ."""
        assert self.grid is not None, "asked for within the grid only"
        grid = self.grid
        result = np.zeros(len(grid))
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

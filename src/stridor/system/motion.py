"""Supports: freedoms held, moved with a prescribed velocity or pressed away, taken out of the structure."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as sl
import scipy.sparse as sp

from ..direct import factorise
from ..errors import AnalysisError
from ..fe.assembly import connected_components
from ..typing import Array, IntArray, Sparse


@dataclass(frozen=True)
class PrescribedMotion:
    """Supports that move with a given velocity, condensed on one scalar each.

    With u = w + L x_p, where L (n, p) is the static answer to the support's motion, the equations in
    w are those of the structure at rest loaded by −M_L ẍ_p − C_L ẋ_p. names (p,); lift L (n, p);
    mass M_L = M L + M_fp (n, p), damping C_L likewise; mass_own, damping_own, stiffness_own (p, p)
    are the energies' own parts. Unit factor means the velocity written in the case [m/s, rad/s].

    distances (p,): 1 where a column is no velocity but a distance, reached at factor one and kept [m, rad]: a support
    pressed away, the interference of a contact; () where there is none.
    """

    names: tuple[str, ...]
    lift: Array
    mass: Array
    damping: Array
    mass_own: Array
    damping_own: Array
    stiffness_own: Array
    distances: tuple[float, ...] = ()

    @property
    def full_distance(self) -> Array:
        """Factors (p,) of full distance: 1 for distances, 0 for velocities."""
        return np.array(self.distances) if self.distances else np.zeros(len(self.names))

    @property
    def full(self) -> Array:
        """Factors (p,) of full velocity: 0 for distances."""
        return 1.0 - self.full_distance

    @staticmethod
    def none(size: int) -> PrescribedMotion:
        """No moving support, for a system of ``size`` freedoms."""
        empty, own = np.zeros((size, 0)), np.zeros((0, 0))
        return PrescribedMotion((), empty, empty, empty, own, own, own)


@dataclass(frozen=True)
class FreeStructure:
    """All freedoms before supports are applied: what bodies give. Matrices (N, N) csr."""

    mass: Sparse
    damping: Sparse
    stiffness: Sparse


@dataclass(frozen=True)
class Constraint:
    """A support: freedoms held (indices in the structure) and their velocity at factor one."""

    name: str
    freedoms: tuple[int, ...]
    velocity: tuple[float, ...]
    displacement: tuple[float, ...] = ()

    @property
    def moves(self) -> bool:
        """Whether a velocity is prescribed."""
        return any(v != 0.0 for v in self.velocity)


@dataclass(frozen=True)
class Column:
    """A prescribed motion of supports: what its held freedoms do at factor one, and whether that is a distance."""

    name: str
    freedoms: tuple[int, ...]
    values: tuple[float, ...]
    distance: float


def columns(constraints: list[Constraint]) -> list[Column]:
    """The motions that supports prescribe: velocities, then distances."""
    moving = [Column(c.name, c.freedoms, c.velocity, 0.0) for c in constraints if c.moves]
    displaced = [c for c in constraints if any(c.displacement)]
    return [*moving, *(Column(distance_name("supports", c.name), c.freedoms, c.displacement, 1.0) for c in displaced)]


def distance_name(table: str, name: str) -> str:
    """Name of the motion of a support's displacement or a contact's interference."""
    return f"{table}.{name}.{'displacement' if table == 'supports' else 'interference'}"


def constrain(
    structure: FreeStructure,
    constraints: list[Constraint],
    dropped: IntArray | None = None,
    translations: Array | None = None,
) -> tuple[IntArray, PrescribedMotion]:
    """Free freedoms (n,) and the prescribed motions of a structure held by ``constraints``.

    dropped: freedoms that follow others and are no unknowns of their own. translations (N, d): what all freedoms do as
    everything moves along each axis by one; where a support carries a body along so, no rounding bends it.
    """
    total = structure.mass.shape[0]
    held = np.zeros(total, dtype=bool)
    if dropped is not None:
        held[dropped] = True
    for c in constraints:
        held[list(c.freedoms)] = True
    free = np.flatnonzero(~held)
    moving = columns(constraints)
    if not moving:
        return free, PrescribedMotion.none(len(free))
    selection, rigid = np.zeros((total, len(moving))), np.zeros((total, len(moving)))
    for column, c in enumerate(moving):
        selection[list(c.freedoms), column] = c.values
        if translations is not None:
            velocity = np.linalg.lstsq(translations[list(c.freedoms)], np.array(c.values), rcond=None)[0]
            rigid[:, column] = translations @ velocity
    lift = _static_lift(structure, free, selection, rigid)
    whole = selection.copy()
    whole[free] = lift

    def coupled(matrix: Sparse) -> tuple[Array, Array]:
        product = matrix @ whole
        return product[free], whole.T @ product

    mass, mass_own = coupled(structure.mass)
    damping, damping_own = coupled(structure.damping)
    stiffness_own = whole.T @ (structure.stiffness @ whole)
    # A rigid motion strains nothing; what is left is rounding of entries as large as EA/h.
    scale = np.abs(structure.stiffness).max() * np.abs(whole).max() ** 2
    stiffness_own[np.abs(stiffness_own) < 1e-13 * scale] = 0.0
    names = tuple(c.name for c in moving)
    distances = tuple(c.distance for c in moving)
    return free, PrescribedMotion(names, lift, mass, damping, mass_own, damping_own, stiffness_own, distances)


DENSE_LIFT = 3000


def _answer(block: Sparse, load: Array) -> Array:
    """Least-norm answer of a semidefinite block; large ones are held by faint springs instead."""
    symmetric = float(np.abs(sp.csr_array(block - block.T).data).max(initial=0.0)) <= 1e-12 * np.abs(block).max()
    if block.shape[0] > DENSE_LIFT:
        faint = sp.diags_array(1e-9 * block.diagonal())
        factor = factorise(sp.csr_array(block + faint), symmetric=symmetric)
        answer = factor.solve(load)
        for _ in range(3):
            answer = answer + factor.solve(load - block @ answer)
        return answer
    dense = block.toarray()
    if not symmetric:
        return np.linalg.lstsq(dense, load, rcond=1e-12)[0]
    try:
        held = sl.cho_factor(dense)
        answer = sl.cho_solve(held, load)
        return answer + sl.cho_solve(held, load - dense @ answer)
    except sl.LinAlgError:
        return np.linalg.lstsq(dense, load, rcond=1e-12)[0]


def _static_lift(structure: FreeStructure, free: IntArray, selection: Array, rigid: Array) -> Array:
    """L with K_ff L = −K_fp: the static answer, of least norm where the structure is free to move.

    rigid (N, p): translations that may be it. Where one balances to rounding it is taken, as a solve would only add
    rounding times the condition of K, which for slender solids is enough to open and close a gap.
    """
    stiffness = sp.csr_array(structure.stiffness)
    load = -(stiffness @ selection)[free]
    inner = sp.csr_array(stiffness[free][:, free])
    lift = np.zeros_like(load)
    for part in connected_components(inner):
        block, right, answer = sp.csr_array(inner[part][:, part]), load[part], rigid[free[part]]
        loaded = np.any(right, axis=0)
        unbalanced = np.abs(block @ answer - right).max(axis=0)
        bent = np.flatnonzero(loaded & (unbalanced > 1e-12 * np.abs(right).max(axis=0)))
        if len(bent):
            answer[:, bent] = _answer(block, right[:, bent])
            if np.linalg.norm(block @ answer[:, bent] - right[:, bent]) > 1e-6 * np.linalg.norm(right[:, bent]):
                raise AnalysisError(
                    "a moving support cannot be followed statically: its motion loads a mechanism that "
                    "nothing holds; fix more freedoms of that body"
                )
        lift[part] = np.where(loaded, answer, 0.0)
    return lift

"""Steady sliding of one system at many friction coefficients and contact stiffnesses, the nodes that touch held.

With any springs k at the touching nodes, A = K + NᵀkN, equilibrium

    K u − (N + μS)ᵀ p = f,    g + N u + c p/κ = 0

is

    A u = f − Nᵀk g + [Nᵀ(1 − kc/κ) + μSᵀ] p ,

so that N A⁻¹Nᵀ and N A⁻¹Sᵀ (m, m), made once with one factorisation, leave m equations for the forces at every μ and κ,
rigid contact (c = 0) included, and one solution for the displacements.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg as sl
import scipy.sparse as sp

from ...contact.nodes import ContactNodes
from ...direct import Factor, SingularMatrix, factorise
from ...direct.dense import lu_factors
from ...sliding import full_motion
from ...sliding.equilibrium import Equilibrium
from ...system import System
from ...typing import Array, IntArray, Sparse

FEW = 4  # equilibria that are solved one by one before something is prepared for many
MOST_NODES = 2000
BALANCED = 1e-8  # of the largest force: what an equilibrium may leave
CLOSED = 1e-13  # of the largest gap or opening: what the contacts' own equations may
CORRECTIONS = 4


@dataclass(frozen=True)
class HeldEquilibria:
    """Displacement (n,) [m], forces (m,) [N] of the touching nodes and gaps (k,) [m] of all of them."""

    displacement: Array
    normal_force: Array
    gap: Array


class Equilibria:
    """Equilibria of a system with the touching nodes (m,) among all its nodes and the directions (k, d−1) against the
    slip of these."""

    def __init__(
        self, system: System, nodes: ContactNodes, touching: IntArray, sense: Array, solver: str | None
    ) -> None:
        self._system, self._nodes, self._touching, self._sense, self._solver = system, nodes, touching, sense, solver
        force = sum(system.loads.values(), start=np.zeros(system.size))
        self._force = force - system.motion.damping @ full_motion(system)
        self._count = 0
        self._many: _Many | None = None

    def at(self, mu: Array, stiffness: float) -> HeldEquilibria:
        """The equilibrium at friction coefficients (k,) of all nodes and a factor of all contact stiffnesses.

        Raises AnalysisError where there is none.
        """
        self._count += 1
        preparing = self._count > FEW and len(self._touching) <= MOST_NODES and self._system.cubic is None
        if preparing and self._many is None:
            self._many = _Many.of(self._system, self._nodes, self._touching, self._sense, self._force, self._solver)
            self._count = 0 if self._many is None else self._count
        if self._many is not None:
            return self._many.at(mu[self._touching], stiffness)
        return self._alone(mu, stiffness)

    def free(self) -> None:
        """Give the memory of a factorisation back."""
        if self._many is not None:
            self._many.factor.free()
            self._many = None

    def _alone(self, mu: Array, stiffness: float) -> HeldEquilibria:
        nodes = replace(self._nodes, compliance=self._nodes.compliance / stiffness)
        rubbing = mu[:, None] * self._sense
        push = sp.csr_array(nodes.normal + nodes.along(rubbing))
        symmetric = not np.any(rubbing) and self._system.symmetric_definite
        equilibrium = Equilibrium(self._system, nodes, push, self._force, symmetric=symmetric, solver=self._solver)
        active = np.zeros(nodes.count, dtype=bool)
        active[self._touching] = True
        state = equilibrium.solve(active)
        if not equilibrium.residual(state) <= BALANCED:
            raise SingularMatrix("the equilibrium is not balanced")
        return HeldEquilibria(state.displacement, state.normal_force[self._touching], state.gap)


@dataclass(frozen=True)
class _Many:
    """What serves all friction coefficients and contact stiffnesses."""

    nodes: ContactNodes
    normal: Sparse
    slide: Sparse
    compliance: Array
    gap: Array
    springs: Array
    right: Array
    factor: Factor
    by_normal: Array
    by_slide: Array

    @classmethod
    def of(
        cls, system: System, nodes: ContactNodes, touching: IntArray, sense: Array, force: Array, solver: str | None
    ) -> _Many | None:
        """None where the springs at the contacts do not hold the structure."""
        chosen = nodes.select(touching)
        normal, slide, gap = chosen.normal, chosen.along(sense[touching]), chosen.gap
        # Springs that are no stiffer than the structure do not drown it in rounding.
        scale = float(np.abs(system.stiffness.data).max(initial=0.0)) or 1.0
        springs = 1.0 / np.maximum(chosen.compliance, 1.0 / scale)
        matrix = sp.csr_array(system.stiffness + normal.T @ sp.diags_array(springs) @ normal)
        try:
            factor = factorise(matrix, symmetric=system.symmetric_definite, solver=solver)
            by_normal, by_slide = (
                normal @ factor.solve(rows.T.toarray(), refine=False) for rows in (normal, slide)
            )
        except SingularMatrix:
            return None
        right = force - normal.T @ (springs * gap)
        return cls(nodes, normal, slide, chosen.compliance, gap, springs, right, factor, by_normal, by_slide)

    def at(self, mu: Array, stiffness: float) -> HeldEquilibria:
        """The equilibrium at friction coefficients (m,) of the touching nodes."""
        compliance = self.compliance / stiffness
        share = 1.0 - self.springs * compliance
        matrix = np.diag(compliance) + self.by_normal * share + self.by_slide * mu
        try:
            dense = lu_factors(matrix)
        except (ValueError, sl.LinAlgError) as error:
            raise SingularMatrix("the contacts' equations are not finite") from error
        forces = np.zeros(len(mu))
        displacement = self._moved(forces, share, mu)
        for _ in range(CORRECTIONS):
            left = self.gap + self.normal @ displacement + compliance * forces
            size = np.abs(self.gap) + abs(self.normal) @ np.abs(displacement) + compliance * np.abs(forces)
            if np.abs(left).max(initial=0.0) <= CLOSED * size.max(initial=0.0):
                break
            forces = forces - sl.lu_solve(dense, left)
            displacement = self._moved(forces, share, mu)
        if not np.all(np.isfinite(displacement)):
            raise SingularMatrix("the contacts' equations have no solution")
        return HeldEquilibria(displacement, forces, self.nodes.gap + self.nodes.normal @ displacement)

    def _moved(self, forces: Array, share: Array, mu: Array) -> Array:
        found: Array = self.factor.solve(self.right + self.normal.T @ (share * forces) + self.slide.T @ (mu * forces))
        return found


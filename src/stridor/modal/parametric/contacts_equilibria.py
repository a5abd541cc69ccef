"""Steady sliding of one system at many friction coefficients and contact stiffnesses, the nodes that touch held."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from ...contact.nodes import ContactNodes
from ...direct import SingularMatrix
from ...sliding import full_motion
from ...sliding.equilibrium import Equilibrium
from ...sliding.prepared import MOST_NODES, Prepared
from ...system import System
from ...typing import Array, IntArray

FEW = 4  # equilibria that are solved one by one before something is prepared for many
BALANCED = 1e-8  # of the largest force: what an equilibrium may leave


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
        self._many: Prepared | None = None

    def at(self, mu: Array, stiffness: float) -> HeldEquilibria:
        """The equilibrium at friction coefficients (k,) of all nodes and a factor of all contact stiffnesses.

        Raises AnalysisError where there is none.
        """
        self._count += 1
        preparing = self._count > FEW and len(self._touching) <= MOST_NODES and self._system.cubic is None
        if preparing and self._many is None:
            chosen, system = self._nodes.select(self._touching), self._system
            self._many = Prepared.of(
                system.stiffness, chosen, np.ones(chosen.count, dtype=bool),
                symmetric=system.symmetric_definite, solver=self._solver,
            )  # fmt: skip
            self._count = 0 if self._many is None else self._count
        found = None if self._many is None else self._together(self._many, mu, stiffness)
        return self._alone(mu, stiffness) if found is None else found

    def free(self) -> None:
        """Give the memory of a factorisation back."""
        many, self._many = self._many, None  # first, as an interrupt may come between
        if many is not None:
            many.factor.free()

    def _together(self, many: Prepared, mu: Array, stiffness: float) -> HeldEquilibria | None:
        chosen, rubbing = many.nodes, (mu[:, None] * self._sense)[self._touching]
        active = np.ones(chosen.count, dtype=bool)
        try:
            found = many.at(self._force, active, rubbing, chosen.compliance / stiffness, chosen.gap)
        except SingularMatrix:  # its own factors may do
            return None
        if found is None:
            return None
        u, forces = found
        return HeldEquilibria(u, forces, self._nodes.gap + self._nodes.normal @ u)

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

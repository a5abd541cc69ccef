"""Where friction feeds energy into a mode: the power of every contact node."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from ...direct import factorise
from ...errors import CaseError
from ...system import System
from ...typing import Array, ComplexArray, Sparse
from ..options import Options
from ..quadratic.problem import times
from ..results import ComplexModes
from .problem import ContactProblem, problem_of


@dataclass(frozen=True)
class FrictionEnergy:
    """Mean power over a cycle for unit energy (kinetic and elastic) of a mode λ.

    power (m,) [1/s] that friction feeds in at each of the system's contact nodes, positive where it drives the mode,
    zero at open ones, a law's slope included; damping [1/s] that the structure takes out, and friction that turns with
    the slip (`friction_damping`). power.sum() − damping = 2 Re λ.
    """

    eigenvalue: complex
    power: Array
    damping: float

    @property
    def per_cycle(self) -> Array:
        """Energy (m,) that each node feeds in during one period, over the energy of the mode."""
        return self.power * (2 * np.pi / abs(self.eigenvalue.imag))


def friction_energy(
    system: System, modes: ComplexModes, row: int, mode: int, *, options: Options | None = None
) -> FrictionEnergy:
    """Power of friction at each contact node in mode ``mode`` (column) at friction coefficient ``row`` of ``modes``.

    A node's power is ½ Re(conj(λ w) F) with its slip w and friction force F, from the equations of motion multiplied by
    the velocity: 4E Re λ + |λ|²uᴴCu = 2 Σ power, E the mean kinetic and elastic energy, the contacts' included.
    modes must have been found with the same system and options, and with vectors. Raises CaseError where they have
    none, or where the mode does not oscillate.
    """
    if modes.right is None:
        raise CaseError("modes", "without vectors", "ask for the modes with vectors=True")
    lam, u, mu = complex(modes.eigenvalues[row, mode]), modes.right[row, mode][:, None], float(modes.mu[row])
    if lam.imag == 0.0:
        raise CaseError("mode", mode, "this mode does not oscillate; give one with a frequency")
    used = system if modes.damped else system.undamped()
    problem = problem_of(used, mu if len(modes.mu) == 1 else None, options or Options())
    p = contact_forces(problem, lam, u, mu)
    extras = problem.at(mu)
    slip = times(problem.slip, u)[:, 0]
    force = mu * problem.share * p[:, 0]
    if extras.weakening is not None:
        force = force - lam * extras.weakening * slip
    size = abs(lam) ** 2

    def form(matrix: Sparse) -> float:
        return float(np.vdot(u, times(matrix, u)).real)

    compliance = float(np.sum(problem.compliance * np.abs(p[:, 0]) ** 2))
    energy = (size * form(problem.mass) + form(problem.pencil(mu).stiffness) + compliance) / 4
    damping = 0.5 * size * form(problem.damping)
    if extras.damping is not None:
        damping += 0.5 * size * form(extras.damping)
    power = np.zeros(system.contact_nodes().count)
    # Nodes that stick have rows behind these, and friction does no work there.
    power[problem.touching] = 0.5 * (np.conj(lam * slip) * force).real[: len(problem.touching)]
    return FrictionEnergy(lam, power / energy, damping / energy)


def contact_forces(problem: ContactProblem, lam: complex, u: ComplexArray, mu: float) -> ComplexArray:
    """p (m, 1) of a mode's shape u (n, 1): −N u / c, and of rigid contacts what fits the equations of motion best."""
    p = np.zeros((problem.nodes, 1), dtype=complex)
    soft = problem.compliance > 0
    p[soft] = -times(problem.normal, u)[soft] / problem.compliance[soft, None]
    if soft.all():
        return p
    pencil = problem.pencil(mu)
    rest, push = pencil.residual(np.array([lam]), u, p), pencil.push[~soft]
    with factorise(sp.csr_array(push @ push.T), symmetric=True) as factor:
        p[~soft] = factor.solve(times(push, rest))
    return p

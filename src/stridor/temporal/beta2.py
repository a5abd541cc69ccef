"""The β2 scheme of the paper (eq. 10) in the form the time loop uses.

With q_n = v_{n−1} + Δt (1−β2) a_{n−1} and d_n = u_{n+1} − u_n, eqs 9 and 10 become

    (M + β2 Δt C) d_n = Δt² s/2 (f_n − K u_n − Gᵀλ_n) + (Δt M − Δt²/2 C) q_n,      s = 1 + 2 β2
    q_{n+1} = (2β2 − 1)/s q_n + 2/(s Δt) d_n
    v_n = (q_n + 2β2 d_n/Δt)/s,        a_n = 2 (d_n/Δt − q_n)/(Δt s)

so two vectors u, q are the whole state. β2 = 1/2 is the central difference scheme. The scheme is
stable for Δt² ω² ≤ (2/β2)(1 + (β2 − 1/2) Δt c) (docs/theory-temporal.md).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import scipy.linalg as sl

from ..errors import AnalysisError
from ..system import System

SAFE_FRACTION = 0.9  # of the limit, where no step is given
RESOLVED = 0.0393  # of the limit: 80 steps to the period that sets it; growth rates near an onset need as many
FEW = 60  # freedoms up to which every mode of masses and springs is meant


class Scheme(NamedTuple):
    """Scalars of the scheme: step Δt [s], beta2, s = 1 + 2 β2, memory κ of q, gain 2/(sΔt) of d in q."""

    step: float
    beta2: float
    s: float
    memory: float
    gain: float


def scheme(step: float, beta2: float) -> Scheme:
    """Scalars for a step [s] and β2 in [0.5, 1]."""
    s = 1.0 + 2.0 * beta2
    return Scheme(step, beta2, s, (2.0 * beta2 - 1.0) / s, 2.0 / (s * step))


@dataclass(frozen=True)
class StepLimit:
    """Largest stable step [s], the circular frequency that sets it [rad/s], the body it lives in, the share of the
    limit that is taken at most where no step is given, and of a system whose modes may all be looked at how many
    freedoms it has, of others None."""

    step: float
    omega_max: float
    body: str
    share: float = SAFE_FRACTION
    bare: int | None = None

    def usual(self, max_frequency_hz: float | None) -> float:
        """The step [s] where none is given: of masses and matrices one that resolves what is looked at."""
        most = self.share * self.step
        if self.bare is None or (max_frequency_hz is None and self.bare > FEW):
            return most
        asked = RESOLVED / (np.pi * max_frequency_hz) if max_frequency_hz else 0.0
        return min(most, max(RESOLVED * self.step, asked))

    def of(self, system: System) -> StepLimit:
        """With what is known of a system besides its limit.

        The limit of a mesh is set by modes of its elements that nobody asks for, far above those looked at. Of masses
        and springs, or of matrices alone, it may be set by modes that are: close to it their frequencies come out up to
        40 % too high, and flutter between them is missed. Where no frequency tells how far somebody looks, few freedoms
        are all meant.
        """
        return replace(self, bare=system.size if is_bare(system) else None)


def is_bare(system: System) -> bool:
    """Whether a system is of masses, springs and matrices alone, without a mesh."""
    return not system.lines and all(set(solid.cells) == {"vertex"} for solid in system.solids)


def step_limit(system: System, beta2: float) -> StepLimit:
    """Courant limit √(2/β2)/ω_max of the assembled structure; contacts by multipliers do not lower it.

    Damping can only raise it (equal for β2 = 1/2), so the undamped frequency is used. Of the same matrices it is sought
    once.
    """
    limit = system.of_matrices.once(("step limit", beta2), lambda: _sought(system, beta2))
    return limit.of(system)


def _sought(system: System, beta2: float) -> StepLimit:
    worst, body = 0.0, "the system"
    for part in system.components:
        mass = system.mass[part][:, part].toarray()
        stiffness = system.stiffness[part][:, part].toarray()
        last = len(part) - 1
        try:
            value = float(sl.eigh(stiffness, mass, eigvals_only=True, subset_by_index=[last, last])[0])
        except sl.LinAlgError as error:
            raise AnalysisError(
                "the mass matrix is not positive definite: a freedom has stiffness but no mass"
            ) from error
        if value > worst:
            worst = value
            owners = [line.name for line in system.lines if np.isin(part[0], line.freedoms)]
            body = owners[0] if owners else "the system"
    omega = float(np.sqrt(worst))
    step = float(np.sqrt(2.0 / beta2) / omega) if omega > 0 else np.inf
    return StepLimit(step, omega, body)

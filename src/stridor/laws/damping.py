"""Structural damping."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Rayleigh:
    """Proportional damping C = α₁ M + α₂ K (paper, eq. 1): mass is α₁ [1/s], stiffness is α₂ [s]."""

    mass: float = 0.0
    stiffness: float = 0.0

    def damping_ratio(self, omega: float) -> float:
        """Damping ratio [-] of a mode at angular frequency omega > 0 [rad/s] (paper, eq. 13)."""
        return 0.5 * (self.mass / omega + self.stiffness * omega)

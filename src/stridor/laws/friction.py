"""Laws of dry friction μ(|v|): what a contact may carry while it sticks, and what it carries sliding.

Nothing is regularised: at zero speed the tangential force is anything up to `sticking` times the normal one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol


class FrictionLaw(Protocol):
    """What every friction law answers. Speeds are slip speeds [m/s]; only their magnitude counts."""

    @property
    def sticking(self) -> float:
        """Friction coefficient [-] at which a sticking contact lets go."""
        ...

    def sliding(self, speed: float) -> float:
        """Friction coefficient [-] while sliding at `speed` [m/s]."""
        ...

    def slope(self, speed: float) -> float:
        """dμ/d|v| [s/m] while sliding at `speed` [m/s]; negative where friction weakens with speed."""
        ...

    def scaled(self, mu: float, speed: float) -> FrictionLaw:
        """The same law with every coefficient multiplied by one factor such that sliding(speed) == mu.

        Where the law is zero at that speed no factor will do: a law that is zero everywhere becomes
        Coulomb(mu), any other gets mu as its coefficient and keeps its stick limit, raised to mu if lower.
        """
        ...


@dataclass(frozen=True)
class Coulomb:
    """One friction coefficient [-], sticking or sliding."""

    coefficient: float

    @property
    def sticking(self) -> float:
        """The friction coefficient [-] at which sticking ends."""
        return self.coefficient

    def sliding(self, speed: float) -> float:
        """The friction coefficient [-] at a slip speed [m/s]."""
        return self.coefficient

    def slope(self, speed: float) -> float:
        """The slope dμ/d|v| [s/m] at a slip speed [m/s]."""
        return 0.0

    def scaled(self, mu: float, speed: float) -> FrictionLaw:
        """The law scaled to mu at a slip speed [m/s]; see FrictionLaw."""
        return Coulomb(mu)


@dataclass(frozen=True)
class StaticKinetic:
    """A coefficient [-] while sliding and a higher static_coefficient [-] to overcome before sliding."""

    coefficient: float
    static_coefficient: float

    @property
    def sticking(self) -> float:
        """The friction coefficient [-] at which sticking ends."""
        return self.static_coefficient

    def sliding(self, speed: float) -> float:
        """The friction coefficient [-] at a slip speed [m/s]."""
        return self.coefficient

    def slope(self, speed: float) -> float:
        """The slope dμ/d|v| [s/m] at a slip speed [m/s]."""
        return 0.0

    def scaled(self, mu: float, speed: float) -> FrictionLaw:
        """The law scaled to mu at a slip speed [m/s]; see FrictionLaw."""
        if self.coefficient == 0.0 and self.static_coefficient == 0.0:
            return Coulomb(mu)
        factor = _factor(mu, self.sliding(speed))
        if factor is None:
            return StaticKinetic(mu, max(mu, self.static_coefficient))
        return StaticKinetic(mu, factor * self.static_coefficient)


@dataclass(frozen=True)
class Weakening:
    """Friction that weakens with slip speed: μ(v) = μ_k + (μ_s − μ_k) exp(−|v|/v_c).

    coefficient is μ_k [-], static_coefficient μ_s [-], decay_speed v_c > 0 [m/s].
    """

    coefficient: float
    static_coefficient: float
    decay_speed: float

    @property
    def sticking(self) -> float:
        """The friction coefficient [-] at which sticking ends."""
        return self.static_coefficient

    def sliding(self, speed: float) -> float:
        """The friction coefficient [-] at a slip speed [m/s]."""
        drop = self.static_coefficient - self.coefficient
        return self.coefficient + drop * math.exp(-abs(speed) / self.decay_speed)

    def slope(self, speed: float) -> float:
        """The slope dμ/d|v| [s/m] at a slip speed [m/s]."""
        drop = self.static_coefficient - self.coefficient
        return -drop / self.decay_speed * math.exp(-abs(speed) / self.decay_speed)

    def scaled(self, mu: float, speed: float) -> FrictionLaw:
        """The law scaled to mu at a slip speed [m/s]; see FrictionLaw."""
        if self.coefficient == 0.0 and self.static_coefficient == 0.0:
            return Coulomb(mu)
        factor = _factor(mu, self.sliding(speed))
        if factor is None:
            return Weakening(mu, max(mu, self.static_coefficient), self.decay_speed)
        return Weakening(factor * self.coefficient, factor * self.static_coefficient, self.decay_speed)


def _factor(mu: float, present: float) -> float | None:
    """The factor mu / present, None where that is not finite."""
    if present == 0.0:
        return None
    factor = mu / present
    return factor if math.isfinite(factor) else None

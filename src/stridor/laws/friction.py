"""Laws of dry friction μ(|v|): what a contact may carry while it sticks, and what it carries sliding.

Nothing is regularised: at zero speed the tangential force is anything up to `sticking` times the normal one.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, Protocol

import numpy as np

from ..typing import Array
from .packed import CONSTANT, CUBIC, EXPONENTIAL, HEAD, HYPERBOLIC, LINEAR, coefficient_at, monotone_slopes

SAME_SPEED = 1e-12  # relative: slip speeds that are one but for rounding


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

    @property
    def constant(self) -> bool:
        """Whether the coefficient is the same at every slip speed."""
        ...

    @property
    def numbers(self) -> tuple[float, ...]:
        """The law as a row of numbers for `laws.packed.coefficient_at`, which the time loops compile."""
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

    @property
    def constant(self) -> bool:
        """Whether the coefficient is the same at every slip speed."""
        return True

    @property
    def numbers(self) -> tuple[float, ...]:
        """The law as a row of numbers; see FrictionLaw."""
        return CONSTANT, self.coefficient, self.coefficient, 0.0, 0.0

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

    @property
    def constant(self) -> bool:
        """Whether the coefficient is the same at every slip speed."""
        return True

    @property
    def numbers(self) -> tuple[float, ...]:
        """The law as a row of numbers; see FrictionLaw."""
        return CONSTANT, self.static_coefficient, self.coefficient, 0.0, 0.0

    def scaled(self, mu: float, speed: float) -> FrictionLaw:
        """The law scaled to mu at a slip speed [m/s]; see FrictionLaw."""
        if self.coefficient == 0.0 and self.static_coefficient == 0.0:
            return Coulomb(mu)
        factor = _factor(mu, self.sliding(speed))
        if factor is None:
            return StaticKinetic(mu, max(mu, self.static_coefficient))
        return StaticKinetic(mu, factor * self.static_coefficient)


@dataclass(frozen=True)
class _Weakens(ABC):
    """Friction that weakens with slip speed from static_coefficient μ_s to coefficient μ_k [-]."""

    coefficient: float
    static_coefficient: float

    @property
    def sticking(self) -> float:
        """The friction coefficient [-] at which sticking ends."""
        return self.static_coefficient

    def sliding(self, speed: float) -> float:
        """The friction coefficient [-] at a slip speed [m/s]."""
        return coefficient_at(self.numbers, abs(speed))[0]

    def slope(self, speed: float) -> float:
        """The slope dμ/d|v| [s/m] at a slip speed [m/s]."""
        return coefficient_at(self.numbers, abs(speed))[1]

    @property
    def constant(self) -> bool:
        """Whether the coefficient is the same at every slip speed."""
        return self.static_coefficient == self.coefficient

    @property
    @abstractmethod
    def numbers(self) -> tuple[float, ...]:
        """The law as a row of numbers; see FrictionLaw."""

    def scaled(self, mu: float, speed: float) -> FrictionLaw:
        """The law scaled to mu at a slip speed [m/s]; see FrictionLaw."""
        if self.coefficient == 0.0 and self.static_coefficient == 0.0:
            return Coulomb(mu)
        factor = _factor(mu, self.sliding(speed))
        if factor is None:
            return replace(self, coefficient=mu, static_coefficient=max(mu, self.static_coefficient))
        return replace(
            self, coefficient=factor * self.coefficient, static_coefficient=factor * self.static_coefficient
        )


@dataclass(frozen=True)
class Weakening(_Weakens):
    """Friction that weakens with slip speed: μ(v) = μ_k + (μ_s − μ_k) exp(−|v|/v_c).

    coefficient is μ_k [-], static_coefficient μ_s [-], decay_speed v_c > 0 [m/s].
    """

    decay_speed: float

    @property
    def numbers(self) -> tuple[float, ...]:
        """The law as a row of numbers; see FrictionLaw."""
        return EXPONENTIAL, self.static_coefficient, self.coefficient, self.decay_speed, 0.0


@dataclass(frozen=True)
class Hyperbolic(_Weakens):
    """Friction that weakens with slip speed: μ(v) = μ_k + (μ_s − μ_k)/(1 + δ|v|).

    coefficient is μ_k [-], static_coefficient μ_s [-], delta δ > 0 [s/m].
    """

    delta: float

    @property
    def numbers(self) -> tuple[float, ...]:
        """The law as a row of numbers; see FrictionLaw."""
        return HYPERBOLIC, self.static_coefficient, self.coefficient, self.delta, 0.0


@dataclass(frozen=True)
class Tabulated:
    """Friction coefficients [-] at slip speeds [m/s], and what lies between them.

    speeds rise from one ≥ 0, at least two; coefficients are as many, ≥ 0; interpolation joins them by straight lines or
    by cubic pieces that keep rises and falls as they are given (`laws.packed.monotone_slopes`). Beyond its ends the
    table is constant. A static_coefficient above the table's at rest has to be overcome before sliding; None: the
    table's at rest.
    """

    speeds: tuple[float, ...]
    coefficients: tuple[float, ...]
    interpolation: Literal["linear", "monotone-cubic"] = "linear"
    static_coefficient: float | None = None

    @property
    def sticking(self) -> float:
        """The friction coefficient [-] at which sticking ends."""
        return self.coefficients[0] if self.static_coefficient is None else self.static_coefficient

    def sliding(self, speed: float) -> float:
        """The friction coefficient [-] at a slip speed [m/s]."""
        return coefficient_at(self.numbers, abs(speed))[0]

    def slope(self, speed: float) -> float:
        """The slope dμ/d|v| [s/m] at a slip speed [m/s]; where straight pieces meet, the mean of both sides."""
        return coefficient_at(self.numbers, abs(speed))[1]

    @property
    def constant(self) -> bool:
        """Whether the coefficient is the same at every slip speed."""
        return len(set(self.coefficients)) == 1

    @property
    def numbers(self) -> tuple[float, ...]:
        """The law as a row of numbers; see FrictionLaw."""
        if self.constant:
            return CONSTANT, self.sticking, self.coefficients[0], 0.0, 0.0
        straight = self.interpolation == "linear"
        slopes = (0.0,) * len(self.speeds) if straight else monotone_slopes(self.speeds, self.coefficients)
        head = (LINEAR if straight else CUBIC, self.sticking, self.coefficients[-1], 0.0, float(len(self.speeds)))
        return *head, *self.speeds, *self.coefficients, *slopes

    def scaled(self, mu: float, speed: float) -> FrictionLaw:
        """The law scaled to mu at a slip speed [m/s]; see FrictionLaw."""
        if not any(self.coefficients) and self.sticking == 0.0:
            return Coulomb(mu)
        factor = _factor(mu, self.sliding(speed))
        if factor is None:
            return StaticKinetic(mu, max(mu, self.sticking))
        static = None if self.static_coefficient is None else factor * self.static_coefficient
        return replace(self, coefficients=tuple(factor * c for c in self.coefficients), static_coefficient=static)


@dataclass(frozen=True)
class Shared:
    """The law of a contact that gets ``share`` times the friction coefficient asked for of all contacts; none where its
    share is 0, whatever is asked for."""

    law: FrictionLaw
    share: float

    @property
    def sticking(self) -> float:
        """The friction coefficient [-] at which sticking ends."""
        return self.law.sticking

    def sliding(self, speed: float) -> float:
        """The friction coefficient [-] at a slip speed [m/s]."""
        return self.law.sliding(speed)

    def slope(self, speed: float) -> float:
        """The slope dμ/d|v| [s/m] at a slip speed [m/s]."""
        return self.law.slope(speed)

    @property
    def constant(self) -> bool:
        """Whether the coefficient is the same at every slip speed."""
        return self.law.constant

    @property
    def numbers(self) -> tuple[float, ...]:
        """The law as a row of numbers; see FrictionLaw."""
        return self.law.numbers

    def scaled(self, mu: float, speed: float) -> FrictionLaw:
        """The law scaled to its share of mu at a slip speed [m/s]."""
        return Shared(self.law.scaled(self.share * mu, speed), self.share)


FRICTIONLESS = Shared(Coulomb(0.0), 0.0)


def share_of(law: FrictionLaw) -> float:
    """The part of the friction coefficient asked for of all contacts that one with this law gets: 1 unless it says."""
    return law.share if isinstance(law, Shared) else 1.0


def own_law(law: FrictionLaw) -> FrictionLaw:
    """The law as it was given, without its share."""
    return law.law if isinstance(law, Shared) else law


def slope_at(law: FrictionLaw, coefficient: float, speed: float) -> float:
    """dμ/d|v| [s/m] at ``speed`` [m/s] of a law scaled such that a contact with it has ``coefficient`` there: its own
    one, whichever share that is of a coefficient asked for of all contacts."""
    own = own_law(law)
    return own.slope(speed) if own.sliding(speed) == coefficient else own.scaled(coefficient, speed).slope(speed)


def relative_coefficients(law: FrictionLaw, speeds: Array, speed: float) -> Array:
    """μ(v)/μ(v̄) (k,) at slip speeds v (k,) [m/s] of a law scaled at the speed v̄: what it has there of the coefficient
    that it was scaled to. 1 where v is v̄ to rounding, and of a law that no factor scales."""
    found = np.ones(len(speeds))
    other = np.flatnonzero(np.abs(speeds - speed) > SAME_SPEED * speed)
    if not len(other) or law.constant or _factor(1.0, at := law.sliding(speed)) is None:
        return found
    values, which = np.unique(speeds[other], return_inverse=True)
    found[other] = np.array([law.sliding(float(v)) / at for v in values])[which]
    return found


def is_zero(law: FrictionLaw) -> bool:
    """Whether a contact with this law has no friction at any speed, and none to overcome."""
    return law.constant and law.sticking == 0.0 and law.sliding(0.0) == 0.0


def keeping_frictionless(laws: Sequence[FrictionLaw]) -> list[FrictionLaw]:
    """The laws of all contacts of a system: where some have friction, those given none have none at any coefficient
    asked for. Where none has any, what is asked for is that of all."""
    zero = [is_zero(law) for law in laws]
    return list(laws) if all(zero) else [FRICTIONLESS if z else law for law, z in zip(laws, zero, strict=True)]


def _factor(mu: float, present: float) -> float | None:
    """The factor mu / present, None where that is not finite."""
    if present == 0.0:
        return None
    factor = mu / present
    return factor if math.isfinite(factor) else None


def friction_rows(laws: Sequence[FrictionLaw]) -> Array:
    """Laws (c, k) as rows of numbers (`laws.packed`), filled up with zeros to one width."""
    rows = [law.numbers for law in laws]
    table = np.zeros((len(rows), max((len(row) for row in rows), default=HEAD)))
    for filled, row in zip(table, rows, strict=True):
        filled[: len(row)] = row
    return table

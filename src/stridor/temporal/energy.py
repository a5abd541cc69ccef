"""Energy balance of a temporal run: what was put in against what is stored and what was lost."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..typing import Array
from .trajectory import Trajectory

# With β2 = 1/2 the accounts are an identity of the scheme, so that all that is missing is rounding: 1e-16 of the
# turnover per step at worst, 1e-7 after the 1e9 steps of the longest runs. What is more than this has been lost.
CLOSED = 1e-6
# Beside the work of sliding under a preload a vibration is small: what is missing must be so beside that, too, unless
# it is rounding of the largest of the sums, of which steps leave up to 3e-14 each (means of many runs: 1e-16).
VIBRATING = 1e-3
ROUNDED = 5e-14
SKEW = ("circulatory", "gyroscopic")  # works put in by unsymmetric matrices, where there are any


@dataclass(frozen=True)
class EnergyBalance:
    """Energies [J] at the last record, and the worst imbalance of all records.

    stored = kinetic + elastic; put in by external loads, moving supports and the initial state; taken out
    by damping, friction and impacts at the contacts. circulatory and gyroscopic: put in by the skew parts of imported
    matrices, None where there are none; of the latter only rounding. error: largest |put in − stored − taken out| over
    the largest amount of energy that changed hands, ``turnover``: what is stored from the first record on, as by a
    preload, does not. For β2 = 1/2 the scheme itself conserves, for larger β2 the error is the numerical damping.
    vibration: by how much the kinetic energy changes; rounding: what rounding alone may leave missing.
    """

    kinetic: float
    elastic: float
    external: float
    support: float
    damping: float
    friction: float
    contact: float
    initial: float
    error: float
    history: Array
    circulatory: float | None = None
    gyroscopic: float | None = None
    turnover: float = 0.0
    vibration: float = 0.0
    rounding: float = 0.0

    @property
    def missing(self) -> float:
        """The largest imbalance [J], NaN where it is no number."""
        return float(np.abs(self.history).max(initial=0.0))

    @property
    def vibration_error(self) -> float | None:
        """The largest imbalance over the energy of the vibration; None where nothing vibrates."""
        return self.missing / self.vibration if self.vibration > 0.0 else None

    @property
    def told(self) -> bool:
        """Whether what is missing is little beside the energy of the vibration, too."""
        return self.missing <= VIBRATING * self.vibration

    @property
    def closes(self) -> bool:
        """Whether all that is missing is rounding; not where it is no number, or where nothing was compared."""
        return self.checked and ((self.error <= CLOSED and self.told) or self.missing <= self.rounding)

    @property
    def checked(self) -> bool:
        """Whether there are records to compare: what is there at the first counts as put in, so it closes alone."""
        return len(self.history) > 1

    def words(self, beta2: float) -> str:
        """How well the balance closes, and where not, whether the numerical damping of the scheme may be why."""
        if self.closes:
            if not self.error <= CLOSED:
                return "energy balance closes to rounding, beside which next to no energy is turned over"
            text = f"energy balance closes to {self.error:.1e} of the energy turned over"
            if self.vibration_error is None:
                return text
            if self.told:
                return f"{text}, {self.vibration_error:.1e} of that of the vibration"
            return f"{text}, to rounding, beside which the vibration has too little energy to be checked"
        if not self.checked:
            said = "one record" if len(self.history) else "no record"
            return f"energy balance not checked, as there is {said}; a smaller temporal.record_every gives more"
        if not np.isfinite(self.error):
            return "energy balance does not close: energies are not finite"
        text = f"energy balance does not close: {self.error:.1e} of the energy turned over is missing"
        if self.vibration_error is not None:
            text += f", {self.vibration_error:.1e} of that of the vibration"
        return f"{text}, the numerical damping of beta2 = {beta2:g} in it" if beta2 > 0.5 else text

    def to_json(self) -> dict[str, Any]:
        """Plain values [J] and the relative error."""
        names = ["kinetic", "elastic", "external", "support", "damping", "friction", "contact", "initial"]
        names += [name for name in SKEW if getattr(self, name) is not None]
        return {name: float(getattr(self, name)) for name in names} | {
            "error": self.error,
            "vibration_error": self.vibration_error,
            "closes": self.closes,
            "checked": self.checked,
        }


def energy_balance(trajectory: Trajectory) -> EnergyBalance:
    """Close the balance over all records; fewer than two tell nothing (`EnergyBalance.checked`)."""
    stored = trajectory.kinetic + trajectory.elastic
    works = trajectory.works
    put_in = works["external"] + works["support"]
    for name in SKEW:
        if name in works:
            put_in = put_in + works[name]
    lost = works["damping"] + works["friction"] + works["contact"]
    initial = float(stored[0] - put_in[0] + lost[0]) if len(stored) else 0.0
    gap = initial + put_in - stored - lost
    # What lies there from the first record on and never changes hands, as the energy of a preload, turns nothing over.
    terms = [trajectory.kinetic, trajectory.elastic, *works.values()]
    turnover = max([1e-300, *(float(np.abs(term - term[0]).max()) for term in terms if len(term))])
    largest = float(max(np.abs(term).max(initial=0.0) for term in terms))
    swing = float(np.ptp(trajectory.kinetic)) if len(stored) else 0.0
    if not np.isfinite(gap).all() or not np.isfinite(turnover):
        turnover = np.nan  # max() of what is no number depends on the order
    last = {name: float(w[-1]) if len(w) else 0.0 for name, w in works.items()}
    return EnergyBalance(
        kinetic=float(trajectory.kinetic[-1]) if len(stored) else 0.0,
        elastic=float(trajectory.elastic[-1]) if len(stored) else 0.0,
        external=last["external"],
        support=last["support"],
        damping=last["damping"],
        friction=last["friction"],
        contact=last["contact"],
        initial=initial,
        error=float(np.abs(gap).max(initial=0.0) / turnover) if np.isfinite(turnover) else float("nan"),
        history=gap,
        circulatory=last.get("circulatory"),
        gyroscopic=last.get("gyroscopic"),
        turnover=turnover,
        vibration=swing,
        rounding=min(ROUNDED * len(stored) * trajectory.record_every, CLOSED) * largest,
    )

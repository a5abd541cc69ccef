"""How to march: settings of a temporal run, and the choices they leave open."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..errors import CaseError
from ..system import System
from .beta2 import StepLimit
from .highest import highest_hz

# Explicit steps to a period: central differences shift a frequency by (2π/n)²/24 of it, damping on the older velocity
# by δΔt/4, and what modes are shifted by against each other is to be small beside what makes them flutter.
FEWEST, ENOUGH = 40, 80
ASKED = "asked for"  # why a path is taken that the settings name


@dataclass(frozen=True)
class Settings:
    """How to march: step Δt [s] (None: `StepLimit.usual`), β2 in [0.5, 1], steps between
    records, path, initial state, perturbation [m/s] of the slip speed (steady sliding only), watched points. contact
    "rigid" takes contact stiffness out of the time loop, as the paper has it; "as given" leaves it in. stepper
    "explicit" is the scheme of the paper; "exact" goes from one change of contact to the next, and its step is that of
    the records alone; "implicit" takes steps of a part of the shortest period asked for, that of max_frequency_hz,
    which steps of masses and of bare matrices resolve as well where none is given; cutoff_hz is for exact steps alone:
    modes up to there and static answers in place of the complete basis; "auto" takes "exact" for systems as small as
    `simulate.SMALL`, and "implicit" for `simulate.MANY` contact nodes where a frequency is given and a step is not."""

    step: float | None = None
    beta2: float = 0.5
    record_every: int = 50
    path: Literal["auto", "modal", "nodal", "assembled"] = "auto"
    initial: Literal["rest", "steady-sliding"] = "rest"
    perturbation: float = 0.0
    watch: tuple[str, ...] = ()
    contact: Literal["as given", "rigid"] = "as given"
    stepper: Literal["explicit", "exact", "implicit", "auto"] = "explicit"
    max_frequency_hz: float | None = None
    cutoff_hz: float | None = None

    def system(self, system: System) -> System:
        """The system that the time loop takes."""
        return system.with_rigid_contacts() if self.contact == "rigid" else system


def unresolved(step: float, settings: Settings) -> str:
    """What to say of records that show the highest frequency asked for at another one, "" of those that do not."""
    highest, between = settings.max_frequency_hz, settings.record_every * step
    if highest is None or between * highest <= 0.5:
        return ""
    enough = int(0.5 / (highest * step))
    mend = f"temporal.record_every = {enough} would" if enough else "no records of such steps do"
    return f"records every {between:.3g} s do not resolve {highest:g} Hz; {mend}"


def coarse(step: float, settings: Settings, path: str, system: System | None = None) -> str:
    """What to say of explicit steps [s] on a path that are few to the period of the highest frequency asked for, "" of
    those that are enough, or are for all modes that the system (that of the time loop) can have, where it is given."""
    highest = settings.max_frequency_hz
    if highest is None or path in ("exact", "implicit") or step * highest * FEWEST <= 1.0:
        return ""
    if system is not None and step * highest_hz(system) * FEWEST <= 1.0:
        return ""
    return (
        f"steps of {step:.3g} s are {1.0 / (step * highest):.2g} to the period of modal.max_frequency_hz = {highest:g} "
        "Hz: modes up there may come out at other frequencies and growth, or not grow at all (temporal.step = "
        f"{_rounded_down(1.0 / (ENOUGH * highest)):g} takes {ENOUGH} or more, a lower max_frequency_hz needs fewer)"
    )


def _rounded_down(value: float) -> float:
    """Two digits of it, not more than it is."""
    unit = 10.0 ** (np.floor(np.log10(value)) - 1)
    return float(f"{np.floor(value / unit * (1 + 1e-12)) * unit:.2g}")


def not_finite(time: float, phase: str, step: float) -> str:
    """What to say of a motion that has left all numbers."""
    return (
        f"the motion is no longer finite at t = {time:.6g} s (phase {phase}): a negative stiffness drives it (`stridor "
        f"modes` tells what diverges), the step {step:g} s is too large for this model, or a load is absurd"
    )


def choose_step(limit: StepLimit, settings: Settings, path: str = "") -> float:
    """Δt [s] within the limit, which records of the exact stepper and implicit steps need not keep, on a path that
    "auto" may have come to; raises CaseError beyond it."""
    if settings.step is None:
        if not np.isfinite(limit.step):
            raise CaseError("temporal.step", None, "nothing in the system oscillates, so no step follows; give one")
        return limit.usual(settings.max_frequency_hz)
    if not {"exact", "implicit"} & {settings.stepper, path} and settings.step > limit.step:
        raise CaseError(
            "temporal.step",
            settings.step,
            f"the explicit scheme is unstable beyond {limit.step:.4g} s, set by {limit.body}; take a smaller "
            'step, coarser elements or mass = "lumped"',
        )
    return settings.step

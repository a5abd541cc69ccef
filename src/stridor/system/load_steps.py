"""Load steps: the way on which loads and motions come to what they are, where friction remembers it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..typing import Array
from .motion import PrescribedMotion


@dataclass(frozen=True)
class LoadStep:
    """Loads and motions that change from what they were to these in so many equal increments.

    loads: factor of every load at the end. velocities (p,): factors of the prescribed motions during the step; they
    run for duration [s], or where that is None until all that they move slides. increments: at least 1.
    """

    loads: Mapping[str, float]
    velocities: Array
    duration: float | None
    increments: int


def running_on(steps: Sequence[LoadStep], motion: PrescribedMotion) -> Array:
    """Factors (p,) of the moving supports in steady sliding: one, or those that run on after the last load step; zero
    for those that are pressed away by a distance."""
    if not steps:
        return motion.full
    last = steps[-1]
    return np.zeros_like(last.velocities) if last.duration is not None else last.velocities

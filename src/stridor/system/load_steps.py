"""Load steps: the way on which loads and motions come to what they are, where friction remembers it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ..typing import Array


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

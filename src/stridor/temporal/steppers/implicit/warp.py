"""The implicit midpoint rule on modes whose masses are such that it loses neither frequency nor growth.

The midpoint rule sees s = (2/h) tanh(λh/2) in the place of λ: frequencies come out too low by (ωh)²/12, growth by
(ωh)²/4. With x = ωh/2 a mode of unit mass and stiffness ω² gets

    m̃ = (x / tan x)²,      c̃ = c (x / sin x)²,

so that m̃s² + c̃s + ω² = 0 holds where λ² + cλ + ω² = 0 does, undamped to the last digit and damped to (ch)². As m̃ is
1 − ω²h²/6 up to h⁴, M̃ = M − h²K/6 for all that moves slowly, and whatever contact does with K and M, symmetric or not,
it finds in M̃ as well: motions of contacts that stay as they are keep their λ up to h⁴ (docs/theory-implicit.md).
Beyond x = 1, some six steps to the period, m̃ and the factor of c̃ stay what they are there: such modes follow the
others as springs do, and their own vibrations come out too slow.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ....typing import Array

LAST = 1.0  # x up to which modes keep their frequency


@dataclass(frozen=True)
class Warped:
    """mass m̃ (k,) [-]; damping (k, k) [1/s] C̃; stiffness (k,) ω² [rad²/s²] as it was."""

    mass: Array
    damping: Array
    stiffness: Array


def warped(stiffness: Array, damping: Array, step: float) -> Warped:
    """Modes of unit mass with stiffness (k,) ω² [rad²/s²], negative too, and damping (k, k) [1/s], for steps [s]."""
    x = np.minimum(0.5 * step * np.sqrt(np.abs(stiffness)), LAST)
    safe = np.where(x > 1e-4, x, 1.0)
    grows = stiffness < 0.0
    mass = np.where(grows, (safe / np.tanh(safe)) ** 2, (safe / np.tan(safe)) ** 2)
    factor = np.where(grows, safe / np.sinh(safe), safe / np.sin(safe))
    square = np.where(grows, -1.0, 1.0) * x * x
    mass = np.where(x > 1e-4, mass, 1.0 - 2.0 * square / 3.0)
    factor = np.where(x > 1e-4, factor, 1.0 + square / 6.0)
    return Warped(mass, factor[:, None] * damping * factor, stiffness)

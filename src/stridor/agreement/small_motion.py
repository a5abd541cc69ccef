"""What is left of a small perturbation of steady sliding: λ as the temporal approach shows it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..temporal.signals import SHARE, Components
from ..temporal.trajectory import Trajectory
from ..typing import Array, ComplexArray
from .shapes import TimeShape

PERTURBATION = 1e-5  # of the slip speed, at the start
LINEAR = 0.02  # of the slip speed: beyond it the perturbation is no longer small
# Of the largest of a signal: what stays below it to the end has died away. What is left is rounding of the steady
# motion, which has any rate.
DIED = 1e-5
LIVES = 0.9  # of the time of the signal that is heard longest: what dies before has nothing that lasts
SLIPS = 1e-6  # of how fast a mode moves: where contacts slip less, it would need a huge amplitude to show there
LEVEL = 1e-6  # of |λ|: growth or decay in time below it is none, of motion that nothing damps


@dataclass(frozen=True)
class Perturbation:
    """Free vibration about steady sliding at one μ: λ of what grows fastest within the frequency range,
    the signal (slip speed minus its steady value) [m/s] where it is linear, its sampling [s], and every
    component found in it. shape: how nodes move in the fastest, None where it was not asked for or cannot be told.
    untold: why the signal does not tell the fastest apart from the others, "" where it does. left: whether it grew out
    of the linear range, grown: within the frequency range, by whichever component. unshown: λ (j,) of modes in which no
    contact slips, so that the motion was begun without them."""

    mu: float
    eigenvalue: complex
    signal: Array
    sampling: float
    components: Components
    shape: TimeShape | None = None
    untold: str = ""
    left: bool = False
    grown: bool = False
    unshown: ComplexArray = field(default_factory=lambda: np.zeros(0, dtype=complex))

    @property
    def growth_rate(self) -> float:
        """Re λ [1/s]."""
        return self.eigenvalue.real

    @property
    def frequency_hz(self) -> float:
        """Im λ / 2π."""
        return self.eigenvalue.imag / (2 * np.pi)

    @property
    def shows(self) -> bool:
        """Whether the signal shows a vibration at all."""
        return self.eigenvalue != 0 and bool(np.isfinite(self.eigenvalue))

    @property
    def grows(self) -> bool:
        """Whether it is unstable, by more than what a signal tells (`LEVEL`)."""
        return self.eigenvalue.real > LEVEL * abs(self.eigenvalue)


def whole(run: Trajectory) -> Trajectory:
    """The run if it came to its end; KeyboardInterrupt where Ctrl-C cut it, since half a signal tells other rates."""
    if run.interrupted:
        raise KeyboardInterrupt
    return run


def linear_part(signals: Array, steady: Array, *, skip: int = 0) -> Array:
    """Of slip speeds less their steady values, (k, m), that which moves most, while all of them stay below 2 % of the
    steady ones (m,), and until it stays below `DIED` of its largest for good; ``skip`` instants at the
    start, which may hold the spike of a sudden impulse, are left out."""
    last = small_until(signals, steady)
    first = min(last // 8, skip)
    contact = int(np.argmax(np.abs(signals[first:last]).max(axis=0, initial=0.0)))
    return signals[first : first + _heard(signals[first:last, contact]), contact]


def linear_parts(signals: Array, steady: Array) -> Array:
    """Of the same the signals (s, c) that are heard to the end of the one that is heard longest, the one that moves
    most first: a motion that one contact does not show at all another may. What moves less than `SHARE` of the most
    shows rounding."""
    small = signals[: small_until(signals, steady)]
    largest = np.abs(small).max(axis=0, initial=0.0)
    heard = np.array([_heard(small[:, c]) for c in range(small.shape[1])], dtype=np.int64)
    heard[~(largest >= SHARE * largest.max(initial=0.0))] = 0
    count = int(heard.max(initial=0))
    lasting = np.flatnonzero(heard > LIVES * count)
    return small[:count, lasting[np.argsort(-largest[lasting], kind="stable")]]


def small_until(signals: Array, steady: Array) -> int:
    """How many instants of signals (k, m) there are before one of them leaves the linear range."""
    over = np.flatnonzero(np.any(np.abs(signals) > LINEAR * np.abs(steady), axis=1))
    return int(over[0]) if len(over) else len(signals)


def _heard(signal: Array) -> int:
    """How many instants of a signal there are until it stays below `DIED` of its largest."""
    moved = np.abs(signal)
    heard = np.flatnonzero(moved > DIED * moved.max(initial=0.0))
    return int(heard[-1]) + 1 if len(heard) else 0

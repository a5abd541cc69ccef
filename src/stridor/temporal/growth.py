"""Growth of one line of a signal in time, where it is exponential, and whether it has saturated."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from ..typing import Array
from .signals import envelope

GOES_ON = 0.2  # of the rate of a rise: what still grows so fast has not saturated
PERIODS = (20.0, 10.0, 5.0, 3.0)  # of a line that its amplitude is taken over: as many as its growth allows
RESOLVED = 2.0  # change of ln amplitude within these above which it is not seen
ALIKE = 0.25  # share by which the rates of both halves of an exponential may differ
BESIDE = 1.5  # times its amplitude over many periods below which that over few has little else in it
SLIGHT = 0.05  # change of ln amplitude in half of it, and rms about the line, that say nothing against it
STRAIGHT = 0.04  # share of the change of ln amplitude that this may lie about its line
CONSTANT = 0.02  # share of an amplitude by which it may change over the whole fit


@dataclass(frozen=True)
class Growth:
    """Exponential phase of a run: rate [1/s] (negative: decay), fitted from start to end [s] of the signal,
    spread: rms of ln amplitude about the line; saturated: the amplitude has stopped growing after it;
    amplitude at the end of the signal; exponential: whether both halves of the fitted stretch grow alike, and no faster
    than the amplitude shows."""

    rate: float
    start: float
    end: float
    spread: float
    saturated: bool
    amplitude: float
    exponential: bool = False

    @property
    def state(self) -> str:
        """In words: a constant amplitude neither grows nor was seen to stop growing."""
        return state_of(self.rate, self.end - self.start, saturated=self.saturated)


def state_of(rate: float, length: float, *, saturated: bool) -> str:
    """What a line is said to do whose growth [1/s] was fitted over a length [s]."""
    if saturated:
        return "saturated"
    return "of constant amplitude" if abs(rate) * length < CONSTANT else "not saturated"


def growth(signal: Array, sampling: float, frequency_hz: float) -> Growth:
    """Fit the growth of the line at ``frequency_hz`` where it is exponential.

    The plateau is the median amplitude of the last quarter. A signal that rises to it is fitted from its
    lowest point to half the plateau, or as far from there as the rise is exponential; one that falls is fitted over the
    fall. It has saturated where the last quarter exceeds the one before by less than a quarter, and by less than a
    fifth of what its rise would give in that time.

    The amplitude is that over PERIODS of the line, over fewer where it grows too fast for that: over many, what the
    motion has become hides how it began. A line that has little beside it is looked at over the fewest as well: what
    its amplitude over many does while that one does something else is a change of frequency, and no growth.
    """
    if frequency_hz <= 0 or len(signal) < 32:
        return Growth(0.0, 0.0, len(signal) * sampling, 0.0, False, 0.0)

    def over(periods: float) -> _Amplitude:
        return _Amplitude.of(signal, sampling, frequency_hz, periods)

    narrow, wide = over(PERIODS[0]), over(PERIODS[-1])
    found, fewest = narrow.growth(), wide.growth()
    alone = fewest.amplitude < BESIDE * found.amplitude
    for amplitude in chain([narrow], map(over, PERIODS[1:-1]), [wide]):  # most need no more than the first
        fit = amplitude.growth()
        # What does not rise over many periods may have risen within them.
        hidden = alone and not amplitude.rises and wide.rises_before(fit.start)
        if fit.exponential and not hidden and (not alone or wide.bears_out(fit)):
            return fit
    return replace(found, exponential=False, saturated=(fewest if alone else found).saturated)


@dataclass(frozen=True)
class _Amplitude:
    """Of a line, at times (k,) [s], each over a window [s]; its logarithm is the level."""

    time: Array
    size: Array
    level: Array
    window: float

    @classmethod
    def of(cls, signal: Array, sampling: float, frequency_hz: float, periods: float) -> _Amplitude:
        time, size = envelope(signal, sampling, frequency_hz, periods=periods)
        size = np.maximum(size, 1e-300)
        return cls(time, size, np.log(size), 2.0 * float(time[0]))

    @property
    def _lowest(self) -> int:
        return int(np.argmin(self.size[: max(3, 3 * len(self.size) // 4)]))

    @property
    def _plateau(self) -> float:
        return float(np.median(self.size[-max(2, len(self.size) // 4) :]))

    @property
    def rises(self) -> bool:
        """Whether the plateau lies clearly above what was before."""
        return bool(self._plateau > 1.5 * self.size[self._lowest])

    def rises_before(self, time: float) -> bool:
        """Whether it was far smaller than the plateau at some earlier time [s]."""
        earlier = self.size[self.time < time]
        return bool(len(earlier) and math.e * earlier.min() < self._plateau)

    def growth(self) -> Growth:
        """The growth that it shows, and whether it is exponential in what is fitted."""
        time, size, level, plateau = self.time, self.size, self.level, self._plateau
        quarter = max(2, len(size) // 4)
        before = float(np.median(size[-2 * quarter : -quarter])) if len(size) >= 2 * quarter else size[0]
        saturated = False
        if self.rises:
            part, exponential = self._exponential(0.95 * plateau)
            # Slow growth gains no more from one quarter to the next than a limit cycle may vary: it must become slower.
            rise = _rise(size, self._lowest, 0.95 * plateau)
            gained, hop = math.log(plateau / before), float(time[1] - time[0])
            rate = max(float(np.polyfit(time[rise], level[rise], 1)[0]), 0.0)
            still = gained > max(CONSTANT, GOES_ON * rate * quarter * hop)
            saturated = plateau < 1.25 * before and not still
            if saturated:
                part, exponential = self._exponential(0.5 * plateau)
        else:
            early = size[: max(3, len(size) // 2)]
            part = slice(int(np.argmax(early)), len(size))
            exponential = _alike(time[part], level[part])
            if not exponential:  # it may have stayed as high for a while
                part = slice(int(np.flatnonzero(early >= (1.0 - CONSTANT) * early.max())[-1]), len(size))
                exponential = _alike(time[part], level[part])
        t, y = time[part], level[part]
        if len(t) < 3:
            t, y = time, level
        rate, offset = np.polyfit(t, y, 1)
        spread = float(np.sqrt(np.mean((y - rate * t - offset) ** 2)))
        # What changes by more within a window is the window's own shape.
        exponential = bool(exponential and abs(rate) * self.window < RESOLVED)
        return Growth(float(rate), float(t[0]), float(t[-1]), spread, saturated, plateau, exponential)

    def bears_out(self, fit: Growth) -> bool:
        """Whether this amplitude changes as a fit to another of the same line says, in the same stretch."""
        part = (self.time >= fit.start) & (self.time <= fit.end)
        if np.count_nonzero(part) < 3:
            return True
        rate = float(np.polyfit(self.time[part], self.level[part], 1)[0])
        return abs(rate - fit.rate) <= max(ALIKE * abs(fit.rate), 4.0 * SLIGHT / (fit.end - fit.start))

    def _exponential(self, to: float) -> tuple[slice, bool]:
        """As much of the rise to a value, from its lowest point, as is exponential: longer than a window, and where it
        is not all half of the rise at least. All of it, and False, where nothing is."""
        part = _rise(self.size, self._lowest, to)
        least = max(math.log(2.0), 0.5 * float(self.level[part.stop - 1] - self.level[part.start]))
        for stop in range(part.stop, part.start + 4, -max(1, (part.stop - part.start) // 40)):
            t, y = self.time[part.start : stop], self.level[part.start : stop]
            if t[-1] - t[0] < self.window or (stop < part.stop and y[-1] - y[0] < least):
                break
            if _alike(t, y):
                return slice(part.start, stop), True
        return part, False


def _alike(time: Array, level: Array) -> bool:
    """Whether the logarithm of an amplitude (k,) changes at one rate: alike in both halves, or by next to nothing,
    and straight in between."""
    half = len(time) // 2
    if half < 2:
        return False
    one, two = (float(np.polyfit(time[p], level[p], 1)[0]) for p in (slice(0, half + 1), slice(half, None)))
    apart, length = abs(one - two), float(time[-1] - time[0])
    if apart > ALIKE * max(abs(one), abs(two)) and 0.5 * apart * length > SLIGHT:
        return False
    rate, offset = np.polyfit(time, level, 1)
    return float(np.sqrt(np.mean((level - rate * time - offset) ** 2))) <= max(SLIGHT, STRAIGHT * abs(rate) * length)


def _rise(size: Array, lowest: int, to: float) -> slice:
    """From the lowest point of an amplitude (k,) to where it first has come to a value, four points at least."""
    above = np.flatnonzero(size[lowest:] >= to)
    stop = lowest + int(above[0]) + 1 if len(above) else len(size)
    return slice(lowest, max(stop, min(lowest + 4, len(size))))

"""Whether the last part of a run repeats itself: after which time what its contacts do comes back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..typing import Array

ROUNDING = 1e-9  # of the largest: swings that are none
ROUGH = 0.3  # of the root mean square of its swing: returns so far off are looked at closely
AS_GOOD = 3.0  # times the least: a shorter time that comes back nearly as close is the period
NONE = 5e-3  # of the swing: what records make where force and slip have corners, which fall between them


@dataclass(frozen=True)
class ContactPart:
    """What m contact nodes do over a part of a run, at even times (t,): normal (t, m), tangential (t, m, d) force [N],
    gap (t, m) [m] and slip (t, m, d) [m/s]."""

    time: Array
    normal: Array
    tangential: Array
    gap: Array
    slip: Array

    @property
    def spacing(self) -> float:
        """Between two times [s]."""
        return float(self.time[-1] - self.time[0]) / (len(self.time) - 1)

    @property
    def amplitudes(self) -> Array:
        """Half the range (m,) of the slip velocity, of the direction in which it is largest."""
        return 0.5 * np.ptp(self.slip, axis=0).max(axis=1)

    def channels(self) -> list[Array]:
        """Each kind (t, channels) about its mean, over what the kind swings by: one scale for all its nodes, so that
        those that hardly move count little."""
        found: list[Array] = []
        force, speed = float(np.abs(self.normal).max()), float(np.abs(self.slip).max())
        way = max(float(np.abs(self.gap).max()), speed * self.spacing)  # gaps of contacts kept closed are rounding
        given = ((self.normal, force), (self.tangential, force), (self.gap, way), (self.slip, speed))
        for values, whole in given:
            flat = values.reshape(len(values), -1)
            swing = flat - flat.mean(axis=0)
            size = float(np.sqrt(np.mean(swing**2, axis=0).sum()))
            if size > ROUNDING * whole:
                found.append(swing / size)
        return found

    def over(self, period: float, count: int) -> tuple[Array, Array, Array]:
        """Normal and tangential force and gap at so many even times over the last period."""
        end = float(self.time[-1])
        times = end - period + period * np.arange(count) / count

        def at(values: Array) -> Array:
            flat = values.reshape(len(values), -1)
            rows = [np.interp(times, self.time, column) for column in flat.T]
            return np.stack(rows, axis=1).reshape(count, *values.shape[1:])

        return at(self.normal), at(self.tangential), at(self.gap)


@dataclass(frozen=True)
class Recurrence:
    """The time [s] after which a motion comes back, and how far off, in shares of its mean swing."""

    period: float
    off: float


def recurrences(part: ContactPart, near: float) -> list[Recurrence]:
    """Times, up to half of the part's, after which all contacts come back: the shortest of those that come back as near
    as that, and, where it is another one, the shortest of those about as near as the nearest. None where nothing swings
    or nothing comes back.

    How far off is a mean over half of the part, and not a largest value, as friction jumps where slip turns."""
    kinds = part.channels()
    window = len(part.time) // 2
    if not kinds or window < 8:
        return []
    rough = np.sqrt(np.max([_squares(kind, window) for kind in kinds], axis=0))
    before, here, behind = rough[:-2], rough[1:-1], rough[2:]
    lags = 1 + np.flatnonzero((here < before) & (here <= behind) & (here < ROUGH))
    met = [_refined(kinds, rough, int(lag), window) for lag in lags]
    tried = [Recurrence(lag * part.spacing, off) for lag, off in met]
    if not tried:
        return []
    least = min(one.off for one in tried)
    best = next(one for one in tried if one.off <= max(AS_GOOD * least, NONE))
    first = next((one for one in tried if one.off < near), best)
    return [first] if first.off <= AS_GOOD * best.off else [first, best]


def _squares(kind: Array, window: int) -> Array:
    """Mean squares (window,) of the difference between the first half and as long a part so many times later."""
    n = len(kind)
    size = 1 << int(np.ceil(np.log2(n + window)))
    squares = np.concatenate([[0.0], np.cumsum(np.sum(kind**2, axis=1))])
    ahead = np.fft.rfft(kind, size, axis=0)
    base = np.fft.rfft(kind[:window], size, axis=0)
    together = np.fft.irfft(np.sum(ahead * base.conj(), axis=1), size)[:window]
    lags = np.arange(window)
    return np.maximum(squares[window] + squares[lags + window] - squares[lags] - 2.0 * together, 0.0) / window


def _refined(kinds: list[Array], rough: Array, lag: int, window: int) -> tuple[float, float]:
    """The lag between two times, and how far off it is."""
    before, here, behind = rough[lag - 1 : lag + 2] ** 2
    bend = before - 2.0 * here + behind
    fine = lag + (0.5 * (before - behind) / bend if bend > 0.0 else 0.0)
    whole = int(np.floor(fine))
    share = fine - whole
    off = 0.0
    for kind in kinds:
        window = min(window, len(kind) - whole - 1)
        later = (1.0 - share) * kind[whole : whole + window] + share * kind[whole + 1 : whole + window + 1]
        swing = float(np.mean(np.abs(kind[:window])))
        off = max(off, float(np.mean(np.abs(later - kind[:window]))) / max(swing, 1e-300))
    return float(fine), off

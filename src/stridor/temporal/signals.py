"""Signals of a temporal run: spectra with window and resolution stated, growth rates, saturation.

Two ways to a growth rate. In a run that starts suddenly, the envelope at the dominant frequency is
fitted where it grows exponentially. In a run of small perturbations about steady sliding the signal
is a sum of damped exponentials, and the matrix pencil (Hua and Sarkar 1990) takes it apart.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import chain
from typing import TypeVar

import numpy as np
import scipy  # its module signal takes half a second, and is loaded where another window than Hann's is asked for
import scipy.fft as sf
import scipy.linalg as sl

from ..typing import Array, ComplexArray

GOES_ON = 0.2  # of the rate of a rise: what still grows so fast has not saturated
PERIODS = (20.0, 10.0, 5.0, 3.0)  # of a line that its amplitude is taken over: as many as its growth allows
RESOLVED = 2.0  # change of ln amplitude within these above which it is not seen
ALIKE = 0.25  # share by which the rates of both halves of an exponential may differ
BESIDE = 1.5  # times its amplitude over many periods below which that over few has little else in it
SLIGHT = 0.05  # change of ln amplitude in half of it, and rms about the line, that say nothing against it
STRAIGHT = 0.04  # share of the change of ln amplitude that this may lie about its line
CONSTANT = 0.02  # share of an amplitude by which it may change over the whole fit
PENCIL_TOLERANCE = 1e-9
# A line outside the band may have grown millions of times larger than what is sought in it; this window
# keeps 170 dB away.
STOP_BAND = 18.0  # β of Kaiser's window
STOP_DECIBELS = 170.0
Numbers = TypeVar("Numbers", Array, ComplexArray)
LONGEST, WIDEST = 3000, 400  # samples and subspace rows of the matrix pencil
SHARE = 1e-3  # components below this share of the strongest are not trusted


@dataclass(frozen=True)
class Spectrum:
    """One-sided amplitude spectrum: frequency_hz (k,), amplitude (k,) in the signal's unit (a sine of
    amplitude one peaks at one), window name, resolution_hz (bin spacing) and bandwidth_hz (−6 dB width of
    a line)."""

    frequency_hz: Array
    amplitude: Array
    window: str
    resolution_hz: float
    bandwidth_hz: float

    def peak(self, above_hz: float = 0.0) -> tuple[float, float]:
        """Frequency [Hz], interpolated between bins, and amplitude of the largest line above ``above_hz``."""
        inside = self.frequency_hz > above_hz
        if not inside.any() or not np.any(self.amplitude[inside] > 0):
            return 0.0, 0.0
        k = int(np.argmax(np.where(inside, self.amplitude, -1.0)))
        # Beside the edge of what is looked at a neighbour may be larger: the vertex then lies anywhere.
        half, here = 0.5 * float(np.ptp(self.frequency_hz[:2])), float(self.frequency_hz[k])
        found = min(max(_interpolated(self.frequency_hz, self.amplitude, k), here - half), here + half)
        return found, float(self.amplitude[k])

    def line(self) -> tuple[float, float]:
        """Frequency [Hz], interpolated between bins, and amplitude of the largest line, (0, 0) where there is none: a
        bin larger than those beside it. The flank of what is slower than a spectrum tells from its mean is no line."""
        a = self.amplitude
        higher = np.zeros(len(a), dtype=bool)
        higher[1:-1] = (a[1:-1] > a[:-2]) & (a[1:-1] >= a[2:])
        higher[: self._first] = False
        if not higher.any():
            return 0.0, 0.0
        k = int(np.argmax(np.where(higher, a, -1.0)))
        return _interpolated(self.frequency_hz, a, k), float(a[k])

    @property
    def _first(self) -> int:
        """The first bin whose line stands apart from the mean."""
        return math.ceil(self.bandwidth_hz / self.resolution_hz) + 1

    def slower(self) -> tuple[float, float]:
        """Frequency [Hz] below which no line is told from the mean, and the largest amplitude there (0 without any)."""
        first = min(self._first, len(self.frequency_hz) - 1)
        return float(self.frequency_hz[first]), float(self.amplitude[1:first].max(initial=0.0))


def _interpolated(frequency: Array, amplitude: Array, k: int) -> float:
    """Vertex of the parabola through the logarithms of three bins."""
    if not 0 < k < len(frequency) - 1 or np.min(amplitude[k - 1 : k + 2]) <= 0:
        return float(frequency[k])
    a, b, c = np.log(amplitude[k - 1 : k + 2])
    bend = a - 2 * b + c
    shift = 0.5 * (a - c) / bend if bend < 0 else 0.0
    return float(frequency[k] + shift * (frequency[1] - frequency[0]))


_WIDTH = {"hann": 2.0, "boxcar": 1.21, "blackmanharris": 2.67, "flattop": 4.59}  # −6 dB width in bins


def hann(count: int) -> Array:
    """Hann's window (count,), periodic."""
    return 0.5 - 0.5 * np.cos(2 * np.pi / count * np.arange(count)) if count > 1 else np.ones(count)


def _window(name: str, count: int) -> Array:
    return hann(count) if name == "hann" else np.asarray(scipy.signal.get_window(name, count))


def _convolved(signal: Numbers, weights: Array) -> Numbers:
    """Signals (…, k) with weights (w,) where these overlap in full: (…, k − w + 1)."""
    count, taps = signal.shape[-1], len(weights)
    size = sf.next_fast_len(count + taps - 1)
    forward, backward = (sf.fft, sf.ifft) if np.iscomplexobj(signal) else (sf.rfft, sf.irfft)
    return backward(forward(signal, size) * forward(weights, size), size)[..., taps - 1 : count]


def spectrum(signal: Array, sampling: float, *, window: str = "hann") -> Spectrum:
    """Amplitude spectrum of a real signal (k,) sampled every ``sampling`` [s], its mean taken off."""
    count = len(signal)
    weights = _window(window, count)
    values = np.abs(np.fft.rfft((signal - np.mean(signal)) * weights)) * 2 / weights.sum()
    spacing = 1.0 / (count * sampling)
    return Spectrum(np.fft.rfftfreq(count, sampling), values, window, spacing, _WIDTH.get(window, 2.0) * spacing)


@dataclass(frozen=True)
class Spectrogram:
    """time (t,) [s], frequency_hz (k,), amplitude (k, t) in the signal's unit; resolution_hz."""

    time: Array
    frequency_hz: Array
    amplitude: Array
    resolution_hz: float


def spectrogram(signal: Array, sampling: float, *, resolution_hz: float, window: str = "hann") -> Spectrogram:
    """Short-time spectra with three quarters of overlap; resolution_hz sets the length of a piece."""
    size = int(min(len(signal), max(16, round(1.0 / (resolution_hz * sampling)))))
    hop = max(1, size // 4)
    weights = _window(window, size)
    pieces = np.lib.stride_tricks.sliding_window_view(signal, size)[::hop]
    values = np.abs(np.fft.rfft((pieces - pieces.mean(axis=1, keepdims=True)) * weights, axis=1))
    return Spectrogram(
        (np.arange(len(pieces)) * hop + size / 2) * sampling,
        np.fft.rfftfreq(size, sampling),
        (values * 2 / weights.sum()).T,
        1.0 / (size * sampling),
    )


def envelope(signal: Array, sampling: float, frequency_hz: float, *, periods: float = 20.0) -> tuple[Array, Array]:
    """Time [s] and amplitude of the line at ``frequency_hz``, by demodulation over ``periods`` of it."""
    values, size = _demodulated(signal, sampling, frequency_hz, periods)
    hop = max(1, size // 10)
    return (np.arange(len(values)) * sampling + size * sampling / 2)[::hop], np.abs(values)[::hop]


def line_frequency(signal: Array, sampling: float, near_hz: float, *, periods: float = 20.0) -> float:
    """Frequency [Hz] of the line of a steady signal near one that is known within its bandwidth, by the mean rate of
    its phase: far closer than the spectrum has it, as lines more than a tenth of it away weigh next to nothing."""
    values, _ = _demodulated(signal, sampling, near_hz, periods)
    if len(values) < 2:
        return near_hz
    slope = np.polyfit(np.arange(len(values)) * sampling, np.unwrap(np.angle(values)), 1)[0]
    return near_hz + float(slope) / (2 * np.pi)


def _demodulated(signal: Array, sampling: float, frequency_hz: float, periods: float) -> tuple[ComplexArray, int]:
    """The line at a frequency taken down to zero, and over how many samples it is averaged."""
    size = int(max(8, round(periods / (frequency_hz * sampling))))
    size = min(size, max(len(signal) // 3, 8))
    weights = hann(size)
    weights = weights / weights.sum() * 2
    time = np.arange(len(signal)) * sampling
    carrier: ComplexArray = np.exp(-2j * np.pi * frequency_hz * time)
    modulated: ComplexArray = carrier * (signal - np.mean(signal))
    return _convolved(modulated, weights), size


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


@dataclass(frozen=True)
class Components:
    """Damped exponentials that make up a signal: λ (k,) [1/s] and amplitudes (k,) at
    the middle of the signal, strongest first."""

    eigenvalues: ComplexArray
    amplitudes: Array

    @property
    def fastest(self) -> complex:
        """λ of the component that grows fastest; 0 without any."""
        if not len(self.eigenvalues):
            return 0j
        return complex(self.eigenvalues[np.argmax(self.eigenvalues.real)])


def low_passed(signal: Array, sampling: float, max_frequency_hz: float) -> Array:
    """Signals (…, k) without what lies above 1.25 ``max_frequency_hz``; the filter's transients are cut off."""
    count = signal.shape[-1]
    if max_frequency_hz * 1.4 * sampling >= 0.5 or count < 64:
        return signal
    # Kaiser's rule: (A − 8)/(2.285 Δω) taps for A dB over a transition of Δω.
    taps = int((STOP_DECIBELS - 8) / (2.285 * 2 * np.pi * 0.25 * max_frequency_hz * sampling)) | 1
    taps = min(taps, (count // 3) | 1)
    offset = np.arange(taps) - taps // 2
    low_pass = np.sinc(2 * 1.125 * max_frequency_hz * sampling * offset) * np.kaiser(taps, STOP_BAND)
    return np.ascontiguousarray(_convolved(signal - signal.mean(axis=-1, keepdims=True), low_pass / low_pass.sum()))


def components(signal: Array, sampling: float, *, max_frequency_hz: float, order: int = 80) -> Components:
    """Take a noise-free free vibration apart into damped exponentials up to ``max_frequency_hz``.

    A signal (k,), or several (k, c) of one vibration, all of which hold the same exponentials in shares of their own;
    amplitudes are then those of all together. The signal is low-passed (exponentials pass a filter unchanged but for
    their amplitude), decimated, and its shift-invariant subspace solved for the poles (ESPRIT form of the matrix
    pencil). ``order`` bounds how many are sought. Parts weaker than 1e-3 of the strongest are not trusted and left out,
    as is what turns less than twice in the whole signal.
    """
    nothing = Components(np.zeros(0, dtype=complex), np.zeros(0))
    if len(signal) < 64:
        return nothing
    band = low_passed(np.atleast_2d(signal.T), sampling, max_frequency_hz)
    keep = max(1, int(1.0 / (2.6 * max_frequency_hz * sampling)))
    reduced = band[:, ::keep][:, -LONGEST:].T
    rate, count = keep * sampling, len(reduced)
    if count < 16 or not np.any(reduced):
        return nothing
    rows = min(count // 2, WIDEST)
    windows = np.lib.stride_tricks.sliding_window_view(reduced, count - rows + 1, axis=0)
    hankel = windows.reshape(len(windows), -1)
    # Its rows are far shorter than its columns are many: the triangle has the same left vectors.
    left, values, _ = sl.svd(sl.qr(hankel.T, mode="r")[0][:rows].T, check_finite=False)
    rank = int(min(order, rows - 1, max(2, np.sum(values > PENCIL_TOLERANCE * values[0]))))
    space = left[:, :rank]
    poles = sl.eigvals(np.linalg.lstsq(space[:-1], space[1:], rcond=None)[0]).astype(complex)
    # What would change by more than e^60 over half the signal is no vibration.
    poles = poles[np.abs(np.log(np.maximum(np.abs(poles), 1e-300))) * (count // 2) < 60]
    if not len(poles):
        return nothing
    # Amplitudes at the middle: columns scaled there, so that growth and decay weigh alike.
    exponent = np.arange(count)[:, None] - count // 2
    basis = np.exp(exponent * np.log(poles))
    size = np.linalg.norm(basis, axis=0)
    shares = np.linalg.lstsq(basis / size, reduced.astype(complex), rcond=None)[0]
    amplitude = np.linalg.norm(shares, axis=1) / size
    lam = np.log(poles) / rate
    frequency = lam.imag / (2 * np.pi)
    inside = (frequency > 2.0 / (count * rate)) & (frequency <= max_frequency_hz)
    inside &= amplitude > SHARE * amplitude[inside].max(initial=0.0)
    ranked = np.argsort(amplitude[inside])[::-1]
    return Components(lam[inside][ranked], amplitude[inside][ranked])

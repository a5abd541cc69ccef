"""Signals of a temporal run: spectra with window and resolution stated, amplitudes of lines, damped exponentials.

In a run of small perturbations about steady sliding the signal is a sum of damped exponentials, and the matrix pencil
(Hua and Sarkar 1990) takes it apart; of a run that starts suddenly `growth` fits the amplitude of one line.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import scipy  # its module signal takes half a second, and is loaded where another window than Hann's is asked for
import scipy.fft as sf
import scipy.linalg as sl

from ..typing import Array, ComplexArray

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

    def stronger_below(self) -> float | None:
        """Frequency [Hz] below which something swings or drifts that is stronger than the largest line, and that the
        signal is too short to resolve; None where there is no such thing, or no line."""
        (below, slow), (_, amplitude) = self.slower(), self.line()
        return below if 0.0 < amplitude < slow else None


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

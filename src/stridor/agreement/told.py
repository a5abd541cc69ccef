"""What signals in time tell: their components, and whether parts of them tell the same ones."""

from __future__ import annotations

import numpy as np

from ..temporal.signals import SHARE, Components, components, low_passed
from ..typing import Array
from .small_motion import LEVEL

# Of its highest frequency: of longer signals the rows of the matrix pencil, which are bounded, do not fill a half.
PERIODS_OF_BAND = 300
ABOVE = 1.3  # times the highest frequency of the modes, up to where a long signal is split
PARTS = ((0.0, 0.75), (0.25, 1.0))  # of a signal, either of which must tell what all of it does
SAFETY = 2.0  # times how much parts differ: by how much all may be off
# By how much these may differ: of the frequency, of growth, of decay.
SAME_FREQUENCY, SAME_GROWTH, SAME_DECAY = 0.01, 0.05, 0.25


def band_of(length: float, max_frequency_hz: float, top_hz: float) -> float:
    """Up to which frequency [Hz] a signal of a length [s] is split. What is long is split up to the highest mode there
    and a margin, so that the rows of the matrix pencil are long enough to tell slow modes apart."""
    return float(min(max_frequency_hz, max(ABOVE * top_hz, PERIODS_OF_BAND / length)))


def told(signals: Array, sampling: float, max_frequency_hz: float, top_hz: float) -> tuple[Components, float]:
    """Components of signals (k, c) up to max_frequency_hz, and up to where they were split [Hz]. Beyond that no mode is
    known; what moves there all the same is split by itself."""
    if not len(signals):
        return components(np.zeros(0), sampling, max_frequency_hz=max_frequency_hz), max_frequency_hz
    band = band_of(len(signals) * sampling, max_frequency_hz, top_hz)
    # Where the linear range ends early, records are too far apart for so wide a band.
    band = min(band, max(0.4 / sampling, ABOVE * top_hz))
    found = components(signals, sampling, max_frequency_hz=band)
    if band < max_frequency_hz:
        found = _joined(found, _beyond(signals, sampling, band, max_frequency_hz))
    return found, band


def _beyond(signals: Array, sampling: float, band: float, limit: float) -> Components:
    """Components of what a filter takes out of signals, where that is anything."""
    passed = low_passed(signals.T, sampling, band).T
    first = (len(signals) - len(passed)) // 2
    rest = signals[first : first + len(passed)] - signals.mean(axis=0) - passed
    if len(passed) == len(signals) or np.abs(rest).max() <= SHARE * np.abs(signals).max():
        return Components(np.zeros(0, dtype=complex), np.zeros(0))
    found = components(rest, sampling, max_frequency_hz=min(limit, 0.4 / sampling))
    above = found.eigenvalues.imag > 2 * np.pi * band
    return Components(found.eigenvalues[above], found.amplitudes[above])


def _joined(one: Components, other: Components) -> Components:
    """Both, strongest first, less what is too weak beside the strongest."""
    lam, size = np.append(one.eigenvalues, other.eigenvalues), np.append(one.amplitudes, other.amplitudes)
    ranked = np.argsort(size, kind="stable")[::-1]
    ranked = ranked[size[ranked] > SHARE * size.max(initial=0.0)]
    return Components(lam[ranked], size[ranked])


def certain(signals: Array, sampling: float, band: float, found: Components, *, sign: bool = False) -> bool:
    """Whether parts of the signals have the fastest of components found in all of them up to a band [Hz] with the same
    growth, and nothing that may be faster. sign: whether anything grows is enough.

    A sum of exponentials that a signal holds too few periods of fits others as well; these change with the part.
    """
    lam, fastest = found.eigenvalues, found.fastest
    if fastest == 0 or fastest.imag > 2 * np.pi * band:
        return True
    pieces = [signals[int(begin * len(signals)) : int(end * len(signals))] for begin, end in PARTS]
    parts = [components(piece, sampling, max_frequency_hz=band).eigenvalues for piece in pieces]
    if not all(len(part) for part in parts):
        return False
    # How far each is from what parts have in its place; what a part alone has counts as it stands.
    moved = np.array([part[np.abs(part - lam[:, None]).argmin(axis=1)] - lam for part in parts])
    off = SAFETY * np.abs(moved.real).max(axis=0)
    highest = max(float((lam.real + off).max()), *(float(part.real.max()) for part in parts))
    mine = int(np.argmax(lam.real))
    least = 2 * LEVEL * abs(fastest)
    if sign:
        return bool(off[mine] < fastest.real) if fastest.real > least else highest < least
    grown = max(abs(fastest.real) * (SAME_GROWTH if fastest.real > 0.0 else SAME_DECAY), least)
    turned = float(np.abs(moved[:, mine].imag).max())
    return turned <= SAME_FREQUENCY * abs(fastest) and off[mine] <= grown and highest <= fastest.real + grown

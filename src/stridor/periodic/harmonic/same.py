"""Whether two cycles in harmonics are one: by their whole orbits, wherever the period begins.

Where friction jumps, the series of one cycle differ by more than they are balanced to: with how many harmonics they
have, with the scales of the law, and with where a period begins whose times the law is sampled at. So the one with
fewer is begun where the other begins, and balanced anew as that was: one cycle comes to the other's series, two do not.
"""

from __future__ import annotations

import numpy as np

from ...errors import AnalysisError
from ...typing import ComplexArray
from .balance import evaluated
from .balanced import Balanced, balanced

ONE = 1e-5  # of period and orbit: the same
NEAR = 1.0  # over the harmonics, of the orbit: what is compared at all; where friction jumps, series miss half that
PHASES = 64  # for each harmonic, at which an orbit is laid over another


def same_cycle(one: Balanced, other: Balanced) -> bool:
    """Whether both, of one family and μ, are the same cycle."""
    coarse, fine = sorted((one, other), key=lambda cycle: cycle.harmonics)
    near = max(ONE, NEAR / coarse.harmonics)
    phase, off = _laid_over(coarse, fine)
    if abs(one.period - other.period) > near * one.period or off > near:
        return False
    if _one(coarse, fine, off):
        return True
    try:
        again = balanced(_as(coarse, phase, fine))
    except (AnalysisError, np.linalg.LinAlgError):
        return False
    return _one(again, fine, _laid_over(again, fine)[1])


def _one(first: Balanced, second: Balanced, off: float) -> bool:
    return off <= ONE and abs(first.period - second.period) <= ONE * second.period


def _laid_over(one: Balanced, other: Balanced) -> tuple[float, float]:
    """By which phase [rad] the first is to go on for its orbit to lie nearest to the other's, and how far it is off
    then: root of the sum of squares of the difference of all harmonics, in shares of the other's amplitude."""
    first, second = one.at.base.complex_of(one.at.z), other.at.base.complex_of(other.at.z)
    most = max(len(first), len(second))
    first, second = (np.pad(z, ((0, most - len(z)), (0, 0))) for z in (first, second))
    common = np.sum(first * second.conj(), axis=1)[1:]
    k = np.arange(1, most)
    trial = 2 * np.pi * np.arange(PHASES * most) / (PHASES * most)
    phase = float(trial[np.argmax((np.exp(1j * np.outer(trial, k)) @ common).real)])
    for _ in range(4):
        turned = common * np.exp(1j * k * phase)
        bend = float(np.sum(-(k**2) * turned).real)
        if not bend < 0.0:
            break
        phase -= float(np.sum(1j * k * turned).real) / bend
    off = _turned(first, phase) - second
    return phase, float(np.linalg.norm(off)) / max(other.amplitude, 1e-300)


def _turned(amplitudes: ComplexArray, phase: float) -> ComplexArray:
    return np.asarray(amplitudes * np.exp(1j * phase * np.arange(len(amplitudes)))[:, None])


def _as(cycle: Balanced, phase: float, other: Balanced) -> Balanced:
    """The cycle begun at a phase [rad], with the harmonics and scales of another one: a guess."""
    at = cycle.with_harmonics(other.harmonics).at
    z = at.base.real_of(_turned(at.base.complex_of(at.z), phase))
    return Balanced(evaluated(at.family, z, at.omega, at.mu, other.at.scales))

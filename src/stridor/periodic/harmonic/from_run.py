"""The cycle that a run has settled in, by harmonic balance."""

from __future__ import annotations

import numpy as np

from ...errors import AnalysisError
from ..recurrence import ContactPart
from .balance import evaluated, scales
from .balanced import Balanced, balanced, defect, guessed
from .branch import FINER, MOST_UNKNOWN
from .fourier import fourier
from .problem import HarmonicFamily

SAMPLES = 32  # of the run for each harmonic
FINEST = 200  # harmonics, of a period that holds many of the mode's
ONCE = 1e-6  # of the swing: harmonics that a cycle that goes round several times does not have
LEAST = 3  # harmonics of a cycle once round


def from_run(
    family: HarmonicFamily, mu: float, part: ContactPart, period: float, first: int, most: int, tolerance: float
) -> Balanced:
    """The cycle beside the last period of a run, from so many harmonics on and up to ``most``, as its defect asks for
    beyond a tolerance. Raises AnalysisError where none closes."""
    rows = len(family.still)
    most = max(min(most, FINEST, (MOST_UNKNOWN // rows - 1) // 2), 1)
    harmonics, found, last = min(first, most), None, None
    while True:
        try:
            found = _closed(family, mu, part, period, harmonics, found)
            if (times := _rounds(found)) > 1:
                once = balanced(_once(found, times))
                found, most = once, max(most // times, once.harmonics)
                harmonics = once.harmonics
            if defect(found) <= tolerance:
                return found
        except (AnalysisError, np.linalg.LinAlgError) as error:
            last = error
        if harmonics >= most:
            break
        harmonics = min(int(np.ceil(FINER * harmonics)), most)
    if found is None:
        raise AnalysisError(str(last))
    return found


def _rounds(cycle: Balanced) -> int:
    """How often the period goes round the cycle: only each so manyth harmonic is there."""
    size = np.linalg.norm(cycle.at.base.complex_of(cycle.at.z), axis=1)[1:]
    there = 1 + np.flatnonzero(size > ONCE * np.linalg.norm(size))
    times = int(np.gcd.reduce(there)) if len(there) else 1
    return times if times * LEAST <= cycle.harmonics else 1


def _once(cycle: Balanced, times: int) -> Balanced:
    """The guess of one round of a cycle that goes round several times within its period."""
    at, family = cycle.at, cycle.family
    amplitudes = at.base.complex_of(at.z)[::times]
    base, omega = fourier(len(amplitudes) - 1), times * at.omega
    scale = scales(family, omega, at.mu, base.harmonics)
    return Balanced(evaluated(family, base.real_of(amplitudes), omega, at.mu, scale))


def _closed(
    family: HarmonicFamily, mu: float, part: ContactPart, period: float, harmonics: int, coarser: Balanced | None
) -> Balanced:
    """Near a cycle of fewer harmonics, where there is one and that leads there, else near the run."""
    if coarser is not None:
        try:
            return balanced(coarser.with_harmonics(harmonics))
        except (AnalysisError, np.linalg.LinAlgError):
            pass
    normal, tangential, gap = part.over(period, SAMPLES * harmonics)
    return balanced(guessed(family, mu, harmonics, period, normal, tangential, gap))

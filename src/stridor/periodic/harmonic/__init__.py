"""Limit cycles by harmonic balance, condensed to the contact nodes: many of them, in the plane and in space."""

from .balanced import Balanced, Kept, balanced, defect, guessed, kept, slip_amplitudes
from .birth import born
from .branch import HarmonicBranch
from .from_run import from_run
from .hill import Hill, hill
from .problem import HarmonicFamily, why_not_harmonic
from .same import same_cycle
from .sampling import sampled_series

__all__ = [
    "Balanced",
    "HarmonicBranch",
    "HarmonicFamily",
    "Hill",
    "Kept",
    "balanced",
    "born",
    "defect",
    "from_run",
    "guessed",
    "hill",
    "kept",
    "same_cycle",
    "sampled_series",
    "slip_amplitudes",
    "why_not_harmonic",
]

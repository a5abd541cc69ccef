"""Limit cycles by harmonic balance, condensed to the contact nodes: many of them, in the plane and in space."""

from .balanced import Balanced, Kept, balanced, defect, guessed, kept
from .birth import born
from .branch import HarmonicBranch
from .hill import Hill, hill
from .problem import HarmonicFamily, why_not_harmonic
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
    "guessed",
    "hill",
    "kept",
    "sampled_series",
    "why_not_harmonic",
]

"""Modes and onsets of systems with matrices of any structure, as other programs export them.

`family` is the problem over μ, `basis` where its eigenpairs come from, `follow` the branches over μ, `newton` the full
problem solved for onsets, `passages` how guesses for it are found, `onsets` and `modes` the analyses.
"""

from .modes import general_modes
from .onsets import general_onsets
from .parametric_onsets import ParametricOnset, ParametricOnsets, onsets_along

__all__ = ["ParametricOnset", "ParametricOnsets", "general_modes", "general_onsets", "onsets_along"]

"""Modes and onsets solved in the full problem, matrices of any structure: the sources `full` and `reduced`, and onsets
along any parameter.

`family` is the problem over μ, `basis` where its eigenpairs come from, `follow` the branches over μ, `newton` the full
problem solved for onsets, `passages` how guesses for it are found, `opening` growth that begins at the low end of the
range, `onsets` and `modes` the analyses.
"""

from .modes import full_modes
from .onsets import full_onsets
from .parametric_onsets import ParametricOnset, ParametricOnsets, onsets_along, unlike_along

__all__ = ["ParametricOnset", "ParametricOnsets", "full_modes", "full_onsets", "onsets_along", "unlike_along"]

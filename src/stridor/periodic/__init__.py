"""Limit cycles: found by shooting on the exact motion, followed over friction, as data."""

from .birth import born
from .branch import Bifurcation, CycleBranch, bifurcations
from .continuation import follow
from .cycle import Cycle
from .cycles import CycleOnset, Cycles
from .problem import Family, SlidingProblem, refuse_cycles
from .returns import NoReturn, cycles_reached, growing, pushed, same
from .sampling import sampled
from .shooting import Closed, close, multipliers
from .shooting_branch import Branch

__all__ = [
    "Bifurcation",
    "Branch",
    "Closed",
    "Cycle",
    "CycleBranch",
    "CycleOnset",
    "Cycles",
    "Family",
    "NoReturn",
    "SlidingProblem",
    "bifurcations",
    "born",
    "close",
    "cycles_reached",
    "follow",
    "growing",
    "multipliers",
    "pushed",
    "refuse_cycles",
    "same",
    "sampled",
]

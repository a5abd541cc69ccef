"""Limit cycles: found by shooting on the exact motion or by harmonic balance, followed over friction, as data."""

from .birth import born
from .branch import Bifurcation, CycleBranch, bifurcations
from .continuation import ROUND, Followed, follow, turning, unfinished
from .cycle import Cycle
from .cycles import CycleOnset, Cycles
from .parting import Unclosed
from .problem import Family, SlidingProblem, refuse_cycles, why_not_shooting
from .returns import NoReturn, cycles_reached, growing, pushed, same
from .sampling import sampled
from .shooting import ClosedShot, close, multipliers
from .shooting_branch import ShootingBranch

__all__ = [
    "ROUND",
    "Bifurcation",
    "ClosedShot",
    "Cycle",
    "CycleBranch",
    "CycleOnset",
    "Cycles",
    "Family",
    "Followed",
    "NoReturn",
    "ShootingBranch",
    "SlidingProblem",
    "Unclosed",
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
    "turning",
    "unfinished",
    "why_not_shooting",
]

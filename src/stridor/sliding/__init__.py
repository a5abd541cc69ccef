"""Steady sliding: the equilibrium that both approaches start from, of point contacts and of whole surfaces."""

from .equilibrium import share_factors
from .motions import full_motion, slip_speeds
from .pressing import anything_acts, least_force, nothing_presses, require_pressed, taken_as_closed, unstressed
from .redundant import refuse_redundant
from .resultants import Balance, Resultant
from .scales import far_apart
from .solution import SteadySliding, force_rates, friction_damping_matrix, steady_nodes, steady_sliding, touching

__all__ = [
    "Balance",
    "Resultant",
    "SteadySliding",
    "anything_acts",
    "far_apart",
    "force_rates",
    "friction_damping_matrix",
    "full_motion",
    "least_force",
    "nothing_presses",
    "refuse_redundant",
    "require_pressed",
    "share_factors",
    "slip_speeds",
    "steady_nodes",
    "steady_sliding",
    "taken_as_closed",
    "touching",
    "unstressed",
]

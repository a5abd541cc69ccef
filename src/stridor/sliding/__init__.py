"""Steady sliding: the equilibrium that both approaches start from, of point contacts and of whole surfaces."""

from .equilibrium import share_factors
from .points import SteadySliding, full_motion, slip_speeds, steady_points, steady_sliding
from .pressing import least_force, nothing_presses, require_pressed, taken_as_closed
from .resultants import Balance, Resultant
from .surfaces import SurfaceSliding, friction_damping_matrix, steady_nodes, steady_sliding_nodes, touching

__all__ = [
    "Balance",
    "Resultant",
    "SteadySliding",
    "SurfaceSliding",
    "friction_damping_matrix",
    "full_motion",
    "least_force",
    "nothing_presses",
    "require_pressed",
    "share_factors",
    "slip_speeds",
    "steady_nodes",
    "steady_points",
    "steady_sliding",
    "steady_sliding_nodes",
    "taken_as_closed",
    "touching",
]

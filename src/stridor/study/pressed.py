"""Whether anything presses the bodies of a case together: without a normal force nothing rubs, and nothing squeals."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..case import Case
from ..errors import AnalysisError
from ..sliding import least_force, nothing_presses, steady_nodes, steady_sliding
from ..system import System
from ..typing import Array
from .workspace import Workspace

STILL = 1e-9  # of how contacts move along: a motion towards each other that is rounding
REMEDY = (
    "give a load that presses them, a support that moves one body towards the other, an overlap, or an initial velocity"
)
STEADY_REMEDY = "give a load that presses them in steady sliding, or an overlap"


def unpressed(case: Case, system: System, *, steady: bool = False) -> str:
    """Why nothing presses the contacts of a case in any phase, "" where something does or there are no contacts.

    What presses: loads that do not cancel, overlaps, prescribed distances, load steps, and but for a steady state
    supports and sliding material that move the bodies towards each other, initial velocities and displacements.
    """
    nodes = system.contact_nodes()
    if not nodes.count or system.load_steps or case.placed:
        return ""
    if float(nodes.gap.min()) < -1e-9:
        return ""
    moved = (system.initial_velocity, system.initial_displacement)
    if not steady and any(state is not None and np.any(state) for state in moved):
        return ""
    if not steady and _closing(case, system, nodes.normal_lift, float(np.abs(nodes.tangent_lift).max(initial=0.0))):
        return ""
    phases = [_net(system, factors) for factors in case.load_factors()]
    least = least_force(system)
    acting = [k for k, net in enumerate(phases) if float(np.abs(net).max(initial=0.0)) > least]
    if not system.loads:
        return "no load acts"
    names = ", ".join(system.loads)
    if not acting:
        return f"loads that are 0 or cancel ({names})"
    factors = case.load_factors()[acting[-1]]
    pressed = _press(case, system, factors, acting[-1])
    return "" if pressed else f"loads that leave every contact at 0 N ({names})"


def unpressed_in_time(work: Workspace, system: System, *, steady: bool = False) -> str:
    """`unpressed`, looked into once; "" of a system alone, which says nothing of what its loads are to do."""
    case = work.given
    return "" if case is None else system.once(("unpressed", steady), lambda: unpressed(case, system, steady=steady))


def require_pressed_in_time(work: Workspace, system: System, what: str, *, steady: bool = False) -> None:
    """Raise AnalysisError where nothing presses the bodies together: contacts would carry no force at all."""
    why = unpressed_in_time(work, system, steady=steady)
    if why:
        remedy = STEADY_REMEDY if steady else REMEDY
        raise AnalysisError(f"{what}: nothing presses the bodies together ({why}), so that nothing rubs; {remedy}")


def _closing(case: Case, system: System, normal_lift: Array, tangential: float) -> bool:
    """Whether a prescribed motion closes a contact in some phase."""
    names = system.motion.names
    if not names or not len(normal_lift):
        return False
    least = STILL * max(tangential, float(np.abs(normal_lift).max(initial=0.0)))
    for factors in case.velocity_factors():
        rate = normal_lift @ np.array([factors.get(name, 1.0) for name in names])
        if float(rate.min(initial=0.0)) < -least:
            return True
    return False


def _net(system: System, factors: Mapping[str, float]) -> Array:
    """Force (n,) of all loads together."""
    total = np.zeros(system.size)
    for name, vector in system.loads.items():
        total = total + factors.get(name, 1.0) * vector
    return total


def _press(case: Case, system: System, factors: Mapping[str, float], phase: int) -> bool:
    """Whether loads that do not cancel give a contact some force in steady sliding; yes where there is none, since
    bodies that fly or swing may meet."""
    motion = np.array([case.velocity_factors()[phase].get(name, 1.0) for name in system.motion.names])
    try:
        if np.all(motion == 1.0) and all(factors.get(name, 1.0) == 1.0 for name in system.loads):
            steady = steady_nodes(system)  # which others ask for as well
        else:
            steady = steady_sliding(system, load_factors=dict(factors), motion_factors=motion)
    except AnalysisError:
        return True
    return not nothing_presses(system, steady.normal_force)

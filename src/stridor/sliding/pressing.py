"""Whether anything presses the bodies together: without a normal force there is nothing to linearise about."""

from __future__ import annotations

import numpy as np

from ..errors import AnalysisError
from ..system import System
from ..typing import Array, BoolArray
from .motions import full_motion

PULLS = 1e-12  # of the largest contact force: a pull that is no more is rounding
NOTHING = 1e-9  # of all loads together, each by itself: what their sum leaves as rounding


def least_force(system: System) -> float:
    """The force [N] below which a contact's normal force is rounding: a part of all loads, cancelling or not."""
    return NOTHING * sum(float(np.abs(vector).sum()) for vector in system.loads.values())


def pulled(normal_force: Array) -> BoolArray:
    """Which nodes (m,) pull, of normal forces [N] in compression: only those of contacts kept closed can. Friction,
    μ|N| against the slip, goes with −N there."""
    pulls: BoolArray = normal_force < -PULLS * float(np.abs(normal_force).max(initial=0.0))
    return pulls


def anything_acts(system: System) -> bool:
    """Whether something that presses bodies is known: loads, load steps, or a prescribed distance (a support pressed
    away, an interference), which are loads once `System.in_place` has them there.

    Without any of them which contacts touch is not known, and what is linear takes all of them as closed: everybody who
    decides by that asks here.
    """
    return bool(system.loads or system.load_steps or any(system.motion.full_distance))


def unstressed(system: System) -> bool:
    """Whether a structure without contacts carries no force at all: it need not be held for its steady state to be
    known, which has no stresses."""
    if system.contact_nodes().count or anything_acts(system):
        return False
    return not np.any(system.motion.damping @ full_motion(system))


def nothing_presses(system: System, normal_force: Array) -> bool:
    """Whether normal forces (m,) [N] of steady sliding are all nothing but rounding of the loads: modes, runs and
    checks all ask here."""
    return float(np.max(np.abs(normal_force), initial=0.0)) <= least_force(system)


def require_pressed(system: System, normal_force: Array) -> None:
    """Raise AnalysisError where nothing presses the contacts whose normal forces (m,) [N] in steady sliding are given.

    system: with distances in their place, which are among its loads then. Systems on which nothing acts have no normal
    force that is known, and pass: their contacts are taken as closed.
    """
    if not len(normal_force) or not system.loads or not nothing_presses(system, normal_force):
        return
    names = ", ".join(f"{n} ({float(np.linalg.norm(v)):.4g} N)" for n, v in system.loads.items())
    raise AnalysisError(
        f"no normal force: the loads {names} leave every contact at 0 N in steady sliding, where nothing rubs and a "
        "linearisation about it means nothing; give a load that presses the bodies together, or no [loads] at all to "
        "have the contacts taken as closed"
    )


def taken_as_closed(system: System) -> tuple[str, ...]:
    """What a linearisation says of contacts on which nothing acts; nothing where something does or there are none."""
    if anything_acts(system) or not system.contact_nodes().count:
        return ()
    return (
        "no load acts: which contacts touch is not known, and all of them are taken as closed, as under a load that "
        "presses the bodies together",
    )

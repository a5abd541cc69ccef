"""Friction of a coefficient that is asked for: laws scaled once, at full velocity, whatever phases make of that."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...contact.nodes import ContactNodes
from ...sliding import slip_speeds
from ...system import System
from ...typing import Array


def frictional(system: System, mu: float | None, factors: Array | None = None) -> System:
    """The system with the law of every contact, of points and of surfaces, scaled so that it gives ``mu`` at its slip
    speed with the motions at these factors (p,) (None: full velocity). mu None: the laws as they are.

    What is solved of the result with no further μ, as steady sliding at another velocity, has the laws that the loop
    has."""
    if mu is None:
        return system
    full = system.motion.full if factors is None else factors
    surfaces = [replace(s, nodes=_scaled(s.nodes, mu, full)) for s in system.surfaces]
    surfaces = tuple(replace(s, law=s.nodes.laws[0]) for s in surfaces)
    return replace(system.with_friction(mu, np.abs(slip_speeds(system, full))), surfaces=surfaces)


def _scaled(nodes: ContactNodes, mu: float, factors: Array) -> ContactNodes:
    """The same nodes with every contact's law scaled so that it gives ``mu`` at its mean slip speed."""
    speed = np.linalg.norm(nodes.slip_velocity(factors), axis=1)
    laws = tuple(
        law.scaled(mu, float(speed[nodes.owner == k].mean() if np.any(nodes.owner == k) else 0.0))
        for k, law in enumerate(nodes.laws)
    )
    return replace(nodes, laws=laws)

"""A system under other factors of its loads, velocities and distances: what is full in it is what they make of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from ..contact.interface import Contact, Rows
from ..contact.nodes import ContactNodes
from ..contact.surfaces import SurfaceContact
from ..errors import AnalysisError
from ..typing import Array, Sparse
from .model import System


def under_factors(system: System, loads: Mapping[str, float], motions: Array) -> System:
    """The system whose loads at factor one are those of ``system`` at factors by name (1 of what is not named), and
    whose velocities and distances at factor one are those at factors ``motions`` (p,).

    A coefficient asked for of all contacts stays that at the velocities of ``system`` itself, as runs in time have it:
    a law that depends on speed gives what it makes of it where contacts slide at other ones. Raises AnalysisError for
    the system that `System.in_place` has made of another.
    """
    changed = {name: loads.get(name, 1.0) for name in system.loads}
    if all(factor == 1.0 for factor in changed.values()) and np.all(motions == 1.0):
        return system
    if system.placed:
        raise AnalysisError("what presses bodies away is in its place, and its factor can no longer be another")
    key = ("under factors", *changed.values(), *(float(f) for f in motions))
    return system.once(key, lambda: _made(system, changed, motions))


def _made(system: System, loads: Mapping[str, float], motions: Array) -> System:
    motion = system.motion
    both = np.outer(motions, motions)
    other = replace(
        motion, lift=motion.lift * motions, mass=motion.mass * motions, damping=motion.damping * motions,
        mass_own=motion.mass_own * both, damping_own=motion.damping_own * both,
        stiffness_own=motion.stiffness_own * both,
    )  # fmt: skip
    cubic, stresses = system.cubic, system.stress_stiffness
    made = replace(
        system,
        loads={name: loads[name] * vector for name, vector in system.loads.items()},
        motion=other,
        contacts=tuple(_point(c, motions) for c in system.contacts),
        surfaces=tuple(_surface(s, motions) for s in system.surfaces),
        points={name: _rows(rows, motions) for name, rows in system.points.items()},
        lines=tuple(replace(line, rows=_rows(line.rows, motions)) for line in system.lines),
        solids=tuple(replace(solid, rows=_rows(solid.rows, motions)) for solid in system.solids),
        cubic=None if cubic is None else replace(cubic, rows=_rows(cubic.rows, motions)),
        stress_stiffness=None if stresses is None else partial(_stressed, stresses, motions),
    )
    nodes = system.contact_nodes()
    return replace(made, friction_speeds=dict(zip(nodes.names, nodes.mean_speed, strict=True)))


def _rows(rows: Rows, motions: Array) -> Rows:
    return Rows(rows.free, rows.lift * motions)


def _point(contact: Contact, motions: Array) -> Contact:
    return replace(
        contact, slave=_rows(contact.slave, motions), master=_rows(contact.master, motions),
        normal_lift=contact.normal_lift * motions, tangent_lift=contact.tangent_lift * motions,
    )  # fmt: skip


def _nodes(nodes: ContactNodes, motions: Array) -> ContactNodes:
    return replace(nodes, normal_lift=nodes.normal_lift * motions, tangent_lift=nodes.tangent_lift * motions)


def _surface(surface: SurfaceContact, motions: Array) -> SurfaceContact:
    return replace(
        surface, slave=_rows(surface.slave, motions), master_rows=_rows(surface.master_rows, motions),
        drift=surface.drift * motions, nodes=_nodes(surface.nodes, motions),
        turn=None if surface.turn is None else surface.turn * motions,
    )  # fmt: skip


def _stressed(
    stresses: Callable[..., Sparse], motions: Array, displacement: Array, distances: Array | None = None
) -> Sparse:
    """The geometric stiffness, with distances (p,) in factors of what is full in the system made."""
    return stresses(displacement) if distances is None else stresses(displacement, distances * motions)

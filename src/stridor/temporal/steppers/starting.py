"""Where bodies start, alike for every loop of the explicit scheme; what other steppers do not start from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spl

from ...contact.interface import Contact
from ...errors import AnalysisError
from ...sliding import SteadySliding, steady_sliding
from ...system import System
from ...typing import Array
from ..schedule import PhaseSpec, Schedule, Stretch, lay_out
from ..settings import Settings
from ..stepper import Disturbance
from .curve import found_at

TURNS = 200  # solutions, each on the line of the one before
SETTLED, ROUNDING = 1e-13, 1e-9  # of the displacement: what moves no further, and where it may be rounding that moves
OVERLAP = 1e-6  # of its terms: what of a closed gap is rounding


def motion_of_bodies(system: System, schedule: Schedule) -> Disturbance | None:
    """Displacement, velocity and acceleration (n,) that bodies start with, None where all are at rest."""
    if system.initial_displacement is None and system.initial_velocity is None:
        return None
    zero, stretch = np.zeros(system.size), schedule.stretches[0]
    displacement = zero if system.initial_displacement is None else system.initial_displacement
    velocity = zero if system.initial_velocity is None else system.initial_velocity
    force = -(system.stiffness @ displacement) - system.damping @ velocity
    if stretch.ramp_steps == 0:
        for factor, vector in zip(stretch.loads_after, system.loads.values(), strict=True):
            force = force + factor * vector
    mass, diagonal = system.mass, system.mass.diagonal()
    # The scheme starts from the acceleration that the forces give; a consistent mass only delays it by half a step.
    return displacement, velocity, force / diagonal if mass.nnz == np.count_nonzero(diagonal) else zero


def steady_start(system: System, stretch: Stretch) -> tuple[SteadySliding, tuple[Contact, ...]]:
    """Steady sliding under the loads and motions with which a run begins, and the point contacts as they are then.

    Points that slide finitely rest on the bent line, and push along its normal there: on rows of the undeformed line
    their gap would not be zero by the square of how far that has turned, which rigid contact would take back within one
    step. Raises what `steady_sliding` does."""
    placed, beyond = system.in_place(stretch.distances_after), system.motion.lift @ stretch.distances_after

    def under(contacts: tuple[Contact, ...]) -> SteadySliding:
        return steady_sliding(
            placed if contacts is placed.contacts else replace(placed, contacts=contacts),
            load_factors=dict(zip(system.loads, stretch.loads_after, strict=True)),
            motion_factors=stretch.velocities_after,
        )

    contacts = placed.contacts
    found = under(contacts)
    if system.load_steps or all(contact.sliding == "small" for contact in contacts):
        return found, contacts
    moved = np.inf
    for _ in range(TURNS):
        u = found.displacement - beyond
        contacts = tuple(
            own if own.sliding == "small" else found_at(own, u, stretch.distances_after) for own in placed.contacts
        )
        again = under(tuple(_resting(*both, beyond) for both in zip(contacts, placed.contacts, strict=True)))
        size = float(np.abs(again.displacement).max(initial=0.0))
        before, moved = moved, float(np.abs(again.displacement - found.displacement).max(initial=0.0))
        found = again
        if moved <= SETTLED * size or (moved <= ROUNDING * size and moved > 0.5 * before):
            return found, contacts
    finite = ", ".join(contact.name for contact in contacts if contact.sliding == "finite")
    raise AnalysisError(
        f"contact {finite}: the start in steady sliding does not settle on the line as it bends ({moved:.1e} m are "
        f"left after {TURNS} solutions); start from rest with a ramp (temporal.initial), or take smaller loads or "
        'sliding = "small"'
    )


def _resting(turned: Contact, own: Contact, beyond: Array) -> Contact:
    """A contact as it stands, for displacements that carry the structure along with prescribed distances by ``beyond``
    (n,); supports move it as they do the undeformed one, along which steady sliding keeps its gap."""
    if turned is own:
        return own
    gap = turned.gap - float(turned.normal_row @ beyond)
    return replace(turned, gap=gap, normal_lift=own.normal_lift, tangent_lift=own.tangent_lift)


def along_the_line(
    system: System, steady: SteadySliding, contacts: Sequence[Contact], velocities: Array, velocity: Array
) -> Array:
    """The velocity (n,) with which a run begins, so that neither it nor supports' ``velocities`` (p,) press contacts of
    points that slide finitely together or part them: by impulses along their normals."""
    pressed = [
        contact for contact, active in zip(contacts, steady.active, strict=False)
        if contact.sliding == "finite" and active and contact.compliance == 0.0
    ]  # fmt: skip
    rates = np.array([contact.normal_lift @ velocities + contact.normal_row @ velocity for contact in pressed])
    if not np.any(rates):
        return velocity
    answers = np.stack([impulse(system, contact.normal_row) for contact in pressed], axis=1)
    rows = np.stack([contact.normal_row for contact in pressed])
    return np.asarray(velocity - answers @ np.linalg.lstsq(rows @ answers, rates, rcond=None)[0])


def impulse(system: System, row: Array) -> Array:
    """Velocity (n,) that a unit impulse along a row (n,) gives."""
    mass, diagonal = system.mass, system.mass.diagonal()
    if mass.nnz == np.count_nonzero(diagonal):
        return row / diagonal
    return spl.splu(sp.csc_array(mass)).solve(row)


def not_begun(system: System, settings: Settings, phases: Sequence[PhaseSpec]) -> str:
    """Why exact and implicit steps do not take phases from their start on; "" where they do. settings: with a step."""
    assert settings.step is not None, "the step was found before"
    motion, nodes = system.motion, system.contact_nodes()
    schedule = lay_out(phases, settings.step, list(system.loads), list(motion.names), motion.full_distance)
    if found := schedule.uneven(phases):
        return f"phases are no multiples of the step {settings.step:g} s: {found}"
    if settings.initial == "steady-sliding":
        return schedule.from_steady().jump
    if schedule.jump or not nodes.count:
        return schedule.jump
    u = np.zeros(system.size) if system.initial_displacement is None else system.initial_displacement
    gap, size = nodes.gap + nodes.normal @ u, np.abs(nodes.gap) + np.abs(nodes.normal) @ np.abs(u)
    overlaps = (nodes.compliance == 0.0) & ~nodes.kept & (gap < -OVERLAP * size)
    return "a rigid contact starts with overlap" if overlaps.any() else ""

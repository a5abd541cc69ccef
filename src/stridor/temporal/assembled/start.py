"""Where a run on assembled matrices starts: at rest, in motion, in steady sliding, or from a saved state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ...contact.nodes import ContactNodes
from ...errors import CaseError
from ...system import System
from ...typing import Array
from ..node_history import NodeHistory
from ..saved import INFINITY, STATUS_RANGE, agrees, check_arrays, check_done
from ..schedule import Schedule
from ..settings import Settings
from ..sketch import Part
from ..start import Disturbance, check_model, joined, motion_ratio
from ..trajectory import Trajectory
from .forcing import STEPS_DONE
from .machine import Machine
from .node_table import sliding_directions

# What moves on from step to step, by the part of the machine that holds it.
SAVED = {
    "fields": ("u", "q", "shown", "push"),
    "state": ("works", "statistics", "counters", "motion", "coefficients", "base", "reference"),
    "contacts": ("force", "status", "offset"),
}


def begin(
    machine: Machine,
    schedule: Schedule,
    settings: Settings,
    mu: float | None,
    disturbance: Disturbance | None,
) -> None:
    """Put a machine into its initial state.

    At rest: the bodies where and as fast as the system has them. Raises CaseError for a ramp out of steady sliding
    and what `steady_sliding_nodes` raises.
    """
    system = machine.system
    u, v, a = np.zeros(system.size), np.zeros(system.size), np.zeros(system.size)
    if settings.initial == "steady-sliding":
        u, v = _steady(machine, schedule, settings, mu)
    else:
        if system.initial_displacement is not None:
            u = u + system.initial_displacement
        if system.initial_velocity is not None:
            v = v + system.initial_velocity
        # Loads that are there at t = 0 act as at rest: half a step early, which nothing later feels.
        a = -(system.stiffness @ u + system.damping @ v) / system.mass.diagonal()
    if disturbance is not None:
        u, v, a = u + disturbance[0], v + disturbance[1], a + disturbance[2]
    # q_0 = v_0 − β2 Δt a_0 starts the scheme without a jump (docs/theory-temporal.md).
    place = machine.layout.place
    machine.fields.u[place] = u
    machine.fields.q[place] = v - machine.scheme.beta2 * machine.scheme.step * a
    machine.show()
    machine.mark_start()


def _steady(machine: Machine, schedule: Schedule, settings: Settings, mu: float | None) -> tuple[Array, Array]:
    """Displacement and velocity (n,) of steady sliding, with the perturbation of the slip speed."""
    from ...sliding.surfaces import steady_sliding_nodes

    system, stretch = machine.system, schedule.stretches[0]
    if stretch.ramp_steps:
        raise CaseError("phases.0.ramp", stretch.ramp_steps * schedule.step, "0 when starting from steady sliding")
    steady = steady_sliding_nodes(
        system.in_place(stretch.places_after),
        mu=mu,
        load_factors=dict(zip(system.loads, stretch.loads_after, strict=True)),
        motion_factors=stretch.velocities_after,
    )
    # The loop counts from the structure that the distances carry along.
    machine.state.motion[0] = steady.travel + stretch.places_after
    machine.state.motion[1] = stretch.velocities_after
    machine.contacts.force[:, 0] = np.where(steady.active, steady.normal_force, 0.0)
    machine.contacts.force[:, 1:] = steady.friction_force
    machine.contacts.status[:] = steady.status
    velocity = np.zeros(system.size)
    if settings.perturbation:
        for contact in range(len(machine.nodes.names)):
            velocity += settings.perturbation * _slip_impulse(system, machine.nodes, contact)
    return np.asarray(steady.displacement) - system.motion.lift @ stretch.places_after, velocity


def _slip_impulse(system: System, nodes: ContactNodes, contact: int) -> Array:
    """Velocity (n,) that equal impulses on the nodes of a contact along its sliding give, mean slip speed one."""
    mine = nodes.select(nodes.owner == contact)
    along = mine.along(sliding_directions(mine, system.motion.full))
    answer = (along.T @ np.ones(mine.count)) / system.mass.diagonal()
    mean = float(np.mean(along @ answer))
    return answer / mean if mean > 0.0 else answer


def saved_state(
    machine: Machine, settings: Settings, renewal: tuple[int, int, Array], model: Array
) -> dict[str, Array]:
    """Everything a restart needs, as arrays. renewal: the step of the next renewal of the rows, the steps since the
    last one, and the displacement (n + p,) the rows were found at; model: the sketch of the system as it began."""
    saved: dict[str, Array] = {}
    for part, names in SAVED.items():
        for name in names:
            saved[f"{part}_{name}"] = np.array(getattr(getattr(machine, part), name))
    saved["settings"] = np.array([machine.scheme.step, machine.scheme.beta2, float(settings.record_every)])
    saved["model"] = model
    saved["renewal"], saved["renewed_at"] = np.array(renewal[:2]), renewal[2].copy()
    return saved


def check_restart(
    machine: Machine, restart: Trajectory, settings: Settings, parts: Sequence[Part], *, join: bool, changed: bool
) -> None:
    """Raise CaseError where a saved state belongs to another model (``changed``: of other size), scheme or record."""
    own = np.array([machine.scheme.step, machine.scheme.beta2])
    if restart.path != "assembled" or not agrees(restart.state, "settings", own, first=2):
        raise CaseError(
            "restart",
            f"step {restart.step:g} s, beta2 {restart.beta2:g}, path {restart.path}",
            f"a state of the same scheme: step {own[0]:g} s, beta2 {own[1]:g}, path assembled",
        )
    check_model(parts, restart, changed=changed)
    _check_state(machine, restart)
    if join and (restart.record_every != settings.record_every or restart.watch_names != settings.watch):
        raise CaseError(
            "restart",
            f"a record every {restart.record_every} steps of {', '.join(restart.watch_names) or 'no points'}",
            f"the same records as before (here every {settings.record_every} steps of "
            f"{', '.join(settings.watch) or 'no points'}), or join=False",
        )


def _check_state(machine: Machine, restart: Trajectory) -> None:
    """Raise CaseError for a state that this machine cannot take."""
    held = {f"{part}_{name}": getattr(getattr(machine, part), name) for part, names in SAVED.items() for name in names}
    held["renewal"] = np.zeros(2, dtype=np.int64)
    held["renewed_at"] = np.zeros(machine.system.size + len(machine.system.motion.names))
    bounds = {
        "contacts_status": STATUS_RANGE,
        "state_counters": (0, INFINITY),
        "state_statistics": (-1.0, INFINITY),
        "renewal": (np.array([0, 1]), INFINITY),
    }
    check_arrays(restart.state, held, bounds)
    check_done(restart.state, "state_counters", STEPS_DONE, restart.steps)


def restore(machine: Machine, restart: Trajectory) -> None:
    """Go on from a saved state that `check_restart` has accepted."""
    for part, names in SAVED.items():
        for name in names:
            getattr(getattr(machine, part), name)[:] = restart.state[f"{part}_{name}"]
    machine.contacts.q[:] = machine.fields.q[machine.table.place]
    machine.state.counters[STEPS_DONE + 3 :] = 0


def take_changes(machine: Machine, restart: Trajectory, parts: Sequence[Part]) -> Array:
    """Bring a restored state to a model in which something was changed; velocities (p,) of the moving supports over
    those before. Raises CaseError for a support that moves in another direction."""
    ratio = motion_ratio(parts, restart, machine.system.motion.names)
    # The places that the supports have reached stay, whatever a unit of their motion is now.
    machine.state.motion[:] /= ratio
    # No number: the next step finds its forces anew.
    machine.state.coefficients[:] = np.nan
    machine.show()
    return ratio


def joined_runs(before: Trajectory, after: Trajectory) -> Trajectory:
    """Records of a restarted run, those of its nodes too, behind those of the run it went on from."""
    together = joined(before, after)
    if before.nodes is None or after.nodes is None:
        return together
    names = ("time", "normal_force", "tangential_force", "slip_velocity", "gap", "status")
    parts: dict[str, Any] = {
        name: np.concatenate([getattr(before.nodes, name), getattr(after.nodes, name)]) for name in names
    }
    nodes: NodeHistory = replace(after.nodes, **parts)
    return replace(together, nodes=nodes)

"""Where a run starts: at rest, in steady sliding, or from the saved state of another run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spl

from ..errors import CaseError
from ..sliding import steady_sliding
from ..system import System
from ..system.uncoupled import UncoupledModes
from ..typing import Array
from .beta2 import Scheme
from .machine import Machine
from .operators import FINITE
from .saved import INFINITY, STATUS_RANGE, Bounds, agrees, check_arrays, check_done
from .schedule import Schedule
from .settings import Settings
from .sketch import BODIES, MOTION, Part, differing, packed, saved_row, sketch
from .trajectory import Trajectory

STATE_FIELDS = ("u", "q", "d", "constant", "coefficients")
# Displacement, velocity and acceleration (n,) added to the initial state.
Disturbance = tuple[Array, Array, Array]


def watch_rows(machine: Machine, modes: UncoupledModes | None, names: Sequence[str]) -> tuple[Array, Array]:
    """Rows (2w, n) in the path's coordinates and lift (2w, p) of watched points' x and y."""
    system = machine.system
    rows = [system.points[name].free[:2].toarray() for name in names]
    lift = [system.points[name].lift[:2] for name in names]
    free = np.vstack([np.zeros((0, system.size)), *rows])
    inner = free if modes is None else modes.project(free)[0]
    return np.ascontiguousarray(machine.laid_out(inner)), np.vstack([np.zeros((0, machine.table.motions)), *lift])


def initial_state(
    machine: Machine,
    modes: UncoupledModes | None,
    schedule: Schedule,
    settings: Settings,
    disturbance: Disturbance | None = None,
) -> None:
    """Put a machine at rest or into steady sliding, disturbed if so asked, and predict its first step."""
    system, fields, state = machine.system, machine.fields, machine.state
    if settings.initial == "steady-sliding":
        stretch = schedule.stretches[0]
        steady = steady_sliding(
            system.in_place(stretch.places_after),
            load_factors=dict(zip(system.loads, stretch.loads_after, strict=True)),
            motion_factors=stretch.velocities_after,
        )
        velocity = np.zeros(system.size)
        for contact in system.contacts:
            velocity += settings.perturbation * _slip_impulse(system, contact.tangent_row)
        fields.u[:] = machine.coordinates(steady.displacement - system.motion.lift @ stretch.places_after, modes)
        state.motion[0] = stretch.places_after
        fields.q[:] = machine.coordinates(velocity, modes)
        state.motion[1] = stretch.velocities_after
        state.status[:] = np.where(steady.active, 2, 0)
        if stretch.ramp_steps:
            raise CaseError("phases.0.ramp", stretch.ramp_steps * schedule.step, "0 when starting from steady sliding")
    if disturbance is not None:
        displacement, velocity, acceleration = disturbance
        # q_0 = v_0 − β2 Δt a_0 starts the scheme without a jump (docs/theory-temporal.md).
        rate = velocity - machine.scheme.beta2 * machine.scheme.step * acceleration
        fields.u[:] += machine.coordinates(displacement, modes)
        fields.q[:] += machine.coordinates(rate, modes)
    machine.repack()
    machine.free_increment(_coefficients(machine, schedule))
    machine.predict()


def _slip_impulse(system: System, tangent_row: Array) -> Array:
    """Velocity (n,) that an impulse along a contact's tangent gives, one unit of slip speed."""
    answer = spl.splu(sp.csc_array(system.mass)).solve(tangent_row)
    return answer / float(tangent_row @ answer)


def _coefficients(machine: Machine, schedule: Schedule) -> Array:
    """Forcing coefficients of the next step: loads, −a and −v of the supports."""
    scheme: Scheme = machine.scheme
    done = int(machine.state.counters[0])
    rate = schedule.motion_increments(done, 1)[0] / scheme.step
    before = machine.state.motion[1]
    rate = np.where(np.abs(rate - before) <= 1e-13 * np.abs(before), before, rate)
    acceleration = -2.0 * (rate - before) / (scheme.step * scheme.s)
    velocity = -(before + 2.0 * scheme.beta2 * rate) / scheme.s
    return np.concatenate([schedule.load_factors(done, 1)[0], acceleration, velocity])


def saved_state(machine: Machine, settings: Settings) -> dict[str, Array]:
    """Everything a restart needs, as arrays."""
    saved = {f"field_{name}": getattr(machine.fields, name).copy() for name in STATE_FIELDS}
    for name in machine.state._fields:
        saved[f"state_{name}"] = np.array(getattr(machine.state, name))
    saved["settings"] = np.array([machine.scheme.step, machine.scheme.beta2, float(settings.record_every)])
    saved["model"] = packed(sketch(machine.system, machine.system.contact_nodes()))
    return saved


def settings_of_restart(settings: Settings, restart: Trajectory | None) -> Settings:
    """Settings with the step of the run that is gone on from, where they leave it open: the limit that it would follow
    from differs in its last digits from machine to machine, and altogether where something was changed."""
    return settings if restart is None or settings.step is not None else replace(settings, step=restart.step)


def check_model(parts: Sequence[Part], restart: Trajectory, *, changed: bool) -> None:
    """Raise CaseError where a saved state belongs to another model; ``changed``: to one of other freedoms."""
    saved = np.asarray(restart.state.get("model", np.zeros(0)))
    found = differing(parts, saved)
    if found is None:
        raise CaseError("restart", "model", "a state of the same model: this one has other freedoms, loads or contacts")
    if found and not changed:
        names = "; ".join(part.name for part in found)
        raise CaseError("restart", "model", f"a state of the same model; these differ: {names}")


def motion_ratio(parts: Sequence[Part], restart: Trajectory, names: Sequence[str]) -> Array:
    """Velocities (p,) of the moving supports over those that the saved state was computed with. Raises CaseError for
    another direction: the way gone so far would change with it."""
    ratios = np.ones(len(names))
    for p, name in enumerate(names):
        part = next(part for part in parts if part.name == f"{MOTION} {name}")
        now, then = part.numbers, saved_row(parts, restart.state["model"], part.name)
        if part.same(np.append(then, part.scale)):
            continue
        ratios[p] = float(now @ then) / float(then @ then)
        if np.abs(now - ratios[p] * then).max() > part.close * part.scale:
            raise CaseError(
                "restart",
                f"supports.{name}",
                "the same direction: the way that it has gone so far lies along the old one; its speed may change",
            )
    return ratios


def restore(
    machine: Machine, restart: Trajectory, settings: Settings, schedule: Schedule, *, join: bool, changed: bool
) -> None:
    """Go on from a saved state; raises CaseError where it belongs to another model, scheme or record.

    changed: loads, friction, contacts and speeds of the supports may differ; on the nodal path the bodies, too.
    """
    own = np.array([machine.scheme.step, machine.scheme.beta2])
    if restart.path != machine.path or not agrees(restart.state, "settings", own, first=2):
        raise CaseError(
            "restart",
            f"step {restart.step:g} s, beta2 {restart.beta2:g}, path {restart.path}",
            f"a state of the same scheme: step {own[0]:g} s, beta2 {own[1]:g}, path {machine.path}",
        )
    # Padded modes can have the same shape in different models.
    parts = sketch(machine.system, machine.system.contact_nodes())
    check_model(parts, restart, changed=changed)
    others = [p for p in differing(parts, restart.state["model"]) or () if p.name in BODIES]
    if others and machine.path == "modal":
        raise CaseError(
            "restart",
            " and ".join(part.name for part in others),
            "the same bodies: a run on the modal path is saved in the modes of its bodies; runs with "
            'temporal.path = "nodal" can go on with others',
        )
    if join and (restart.record_every != settings.record_every or restart.watch_names != settings.watch):
        raise CaseError(
            "restart",
            f"a record every {restart.record_every} steps of {', '.join(restart.watch_names) or 'no points'}",
            f"the same records as before (here every {settings.record_every} steps of "
            f"{', '.join(settings.watch) or 'no points'}), or join=False",
        )
    pairs: list[tuple[Any, str, str]] = [(machine.fields, name, f"field_{name}") for name in STATE_FIELDS]
    pairs += [(machine.state, name, f"state_{name}") for name in machine.state._fields]
    check_arrays(restart.state, {key: getattr(part, name) for part, name, key in pairs}, _bounds(machine))
    check_done(restart.state, "state_counters", 0, restart.steps)
    for part, name, key in pairs:
        getattr(part, name)[:] = restart.state[key]
    kept = {name: getattr(machine.state, name).copy() for name in ("predicted", "value", "rate")}
    machine.repack()
    for name, values in kept.items():
        getattr(machine.state, name)[:] = values
    if changed and differing(parts, restart.state["model"]):
        # The places that the supports have reached stay, whatever a unit of their motion is now.
        machine.state.motion[:] /= motion_ratio(parts, restart, machine.system.motion.names)
    if changed:
        machine.free_increment(_coefficients(machine, schedule))
        machine.predict()


def _bounds(machine: Machine) -> Bounds:
    """What a state of this machine must stay within: what is counted, and what points into its arrays."""
    contacts = machine.table.contacts
    segments = np.where(contacts.kind == FINITE, np.diff(contacts.nodes_at) - 2, machine.state.segment)
    return {
        "state_status": STATUS_RANGE,
        "state_segment": (np.minimum(segments, 0), segments),
        "state_counters": (0, np.array([INFINITY, INFINITY, INFINITY, max(machine.contacts - 1, 0)])),
        "state_active": (0, machine.table_values.shape[0] - 1),
        "state_statistics": (-1.0, INFINITY),
    }


def joined(before: Trajectory, after: Trajectory) -> Trajectory:
    """Records of a restarted run behind those of the run it went on from."""
    together = {
        name: np.concatenate([getattr(before, name), getattr(after, name)])
        for name in (
            "time",
            "normal_force",
            "tangential_force",
            "slip_speed",
            "gap",
            "status",
            "displacement",
            "velocity",
            "acceleration",
            "kinetic",
            "elastic",
        )
    }
    works = {name: np.concatenate([before.works[name], after.works[name]]) for name in after.works}
    return replace(after, **together, works=works, wall_seconds=before.wall_seconds + after.wall_seconds)

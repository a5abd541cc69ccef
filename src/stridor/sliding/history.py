"""The way through load steps, increment by increment, and what stands in it where it ends."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..contact.nodes import ContactNodes
from ..direct import SingularMatrix
from ..errors import AnalysisError
from ..system import System
from ..system.load_steps import LoadStep
from ..typing import Array
from .scales import moved_most, owner
from .stick_slip import Frictional, Loading, StickSlip, increments_of

# Slip below this part of the fastest node's is that of the centre of a spin: its direction is rounding.
STILL = 1e-9


@dataclass(frozen=True)
class LoadHistory:
    """Where load steps end. state: contact there, load: the last increment, slip (m, d−1) [m/s]: velocity with which
    motions that run on slide the nodes; residual: the largest of all increments; solved: sets of nodes tried."""

    state: Frictional
    load: Loading
    slip: Array
    residual: float
    solved: int


def follow(system: System, *, mu: float | None, solver: str | None) -> LoadHistory:
    """Go through the load steps of a system. mu replaces the friction coefficient of every contact.

    Raises AnalysisError where friction cannot carry the loads of an increment, or a set of nodes does not settle.
    """
    solution = StickSlip(system, solver=solver)
    nodes, steps = solution.nodes, system.load_steps
    state, residual = solution.start(), 0.0
    load, slip = None, np.zeros((nodes.count, nodes.directions))
    counts: dict[int, int] = {}
    for number, factors, seconds in increments_of(steps, tuple(system.loads)):
        counts[number] = counts.get(number, 0) + 1
        load, slip = _loading(system, nodes, steps[number], factors, state.travel, seconds, mu)
        where = f"step {number + 1}, increment {counts[number]} of {steps[number].increments}"
        try:
            state, left = solution.increment(state, load)
        except SingularMatrix as error:
            raise AnalysisError(_unheld(system, nodes, where, error.motion)) from error
        except AnalysisError as error:
            raise AnalysisError(f"static equilibrium, {where}: {error}") from error
        residual = max(residual, left)
    assert load is not None, "a system with load steps has at least one"
    return LoadHistory(state, load, slip, residual, solution.solved)


def _loading(
    system: System,
    nodes: ContactNodes,
    step: LoadStep,
    factors: dict[str, float],
    travel: Array,
    seconds: float,
    mu: float | None,
) -> tuple[Loading, Array]:
    """What an increment brings, and the slip velocity (m, d−1) of the nodes that motions keep sliding."""
    force = np.zeros(system.size)
    for name, vector in system.loads.items():
        force += vector * factors[name]
    slip = np.zeros((nodes.count, nodes.directions))
    if step.duration is None:
        slip = nodes.slip_velocity(step.velocities)
        force -= system.motion.damping @ step.velocities
    speed = np.linalg.norm(slip, axis=1)
    slides = speed > STILL * float(speed.max(initial=0.0))
    slip[~slides] = 0.0
    driven = np.where(slides[:, None], -slip / np.where(slides, speed, 1.0)[:, None], 0.0)
    coefficient, sticking = _coefficients(nodes, np.where(slides, speed, 0.0), mu)
    return Loading(force, travel + step.velocities * seconds, driven, coefficient, sticking), slip


def _coefficients(nodes: ContactNodes, speed: Array, mu: float | None) -> tuple[Array, Array]:
    """Friction coefficients (m,) of slip and at which sticking ends, at the slip speeds (m,) of a step. With a μ each
    law is scaled once, at its contact's mean speed in steady sliding: slower steps have what it gives there."""
    sliding = nodes.friction_coefficients(speed) if mu is None else nodes.coefficients(mu, speed)
    laws = nodes.laws if mu is None else nodes.laws_at(mu)
    sticks = np.array([law.sticking for law in laws], dtype=float)[nodes.owner]
    return sliding, np.maximum(sticks, sliding)


def _unheld(system: System, nodes: ContactNodes, where: str, motion: Array | None) -> str:
    n = system.size
    if motion is not None and len(motion) > n:
        most = float(np.abs(motion[n:]).max())
        if float(np.abs(motion[:n]).max(initial=0.0)) < 1e-6 * most:
            return (
                f"static equilibrium, {where}: contact holds the same freedoms twice (contacts: "
                f"{', '.join(nodes.names)}), so that its forces cannot be told apart; give the contacts a stiffness or "
                "take nodes that two of them share out of one"
            )
    if motion is not None and (apart := moved_most(system, motion[:n]).apart):
        return f"the static equilibrium in {where} cannot be told: {apart}"
    return (
        f"no static equilibrium in {where}: friction at its limit does not hold the loads, and "
        f"{_moved(system, motion)} slides or moves freely; lower the load, raise the friction coefficient, or hold "
        "it elsewhere"
    )


def _moved(system: System, motion: Array | None) -> str:
    return "the structure" if motion is None else owner(system, int(np.argmax(np.abs(motion[: system.size]))))[0]

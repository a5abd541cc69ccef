"""Impulses of a step whose Gauss–Seidel sweeps do not settle: Newton's method on the projections of Alart and Curnier.

With w = free + W P the laws say P_N = max(0, P_N − ρ w_N) and P_T = proj(P_T − ρ w_T) on the disc of radius μ P_N,
which is semismooth: each step solves the linear problem of the statuses that the projections tell (Alart and Curnier
1991). What it finds is where the sweeps go on from; they have the last word.
"""

from __future__ import annotations

import numpy as np

from ....contact.multipliers import SLIP, STICK
from ....laws.packed import coefficient_at
from ....typing import Array
from .arrays import Nodes, StepState, Work
from .node_law import spring_force

ITERATIONS = 40
CLOSE = 1e-12  # of the largest impulse


def newton(step: float, nodes: Nodes, state: StepState, work: Work) -> None:
    """Impulses into work.impulse; those that leave the least residual, where it does not converge."""
    impulse = work.impulse.copy()
    best, least = impulse, np.inf
    for _ in range(ITERATIONS):
        residual, slope = _linearised(step, nodes, state, work, impulse)
        left = float(np.abs(residual).max(initial=0.0))
        if left < least:
            best, least = impulse, left
        if left <= CLOSE * max(float(np.abs(impulse).max(initial=0.0)), 1e-300):
            break
        try:
            impulse = impulse - np.linalg.solve(slope, residual)
        except np.linalg.LinAlgError:
            break
        if not np.all(np.isfinite(impulse)):
            break
    work.impulse[:] = best


def _linearised(step: float, nodes: Nodes, state: StepState, work: Work, impulse: Array) -> tuple[Array, Array]:
    """P less its projection (m d,), and the slope of that (m d, m d)."""
    d, operator = work.local.shape[1], nodes.delassus
    total = work.free + operator @ impulse
    residual, slope = np.array(impulse), np.eye(len(impulse))
    for i in range(len(nodes.gap)):
        block = operator[i * d : i * d + d, i * d : i * d + d]
        rho = 1.0 / max(block[0, 0], 1e-300), (d - 1) / max(float(np.trace(block[1:, 1:])), 1e-300)
        if nodes.stiffness[i] > 0.0 and not nodes.kept[i]:
            force, softening = spring_force(nodes.stiffness[i], work.start[i], 0.5 * step * total[i * d])
            residual[i * d] -= step * force
            slope[i * d] += 0.5 * step**2 * softening * operator[i * d]
            if force <= 0.0:
                continue
        elif nodes.stiffness[i] > 0.0:
            mean = 0.5 * (work.start[i] + 0.5 * step * total[i * d])
            residual[i * d] += step * nodes.stiffness[i] * mean
            slope[i * d] += 0.25 * step**2 * nodes.stiffness[i] * operator[i * d]
        elif impulse[i * d] - rho[0] * total[i * d] <= 0.0 and not nodes.kept[i]:
            continue
        else:
            # P_N − (P_N − ρ w_N)
            residual[i * d], slope[i * d] = rho[0] * total[i * d], rho[0] * operator[i * d]
        law = nodes.friction[nodes.owner[i]]
        rows = slice(i * d + 1, i * d + d)
        trial = impulse[rows] - rho[1] * total[rows]
        length, normal = float(np.linalg.norm(trial)), impulse[i * d]
        sticks = state.status[i] == STICK
        limit = law[1] if sticks else coefficient_at(law, 0.0)[0]
        if length <= limit * abs(normal):
            residual[rows], slope[rows] = rho[1] * total[rows], rho[1] * operator[rows]
            continue
        slid = work.slip[rows]
        if state.status[i] == SLIP and float(total[rows] @ slid) > 0.0:
            # Slip that goes on: along its mean over the step.
            mean = total[rows] + slid
            speed, by, part = 0.5 * float(np.linalg.norm(mean)), -mean, -operator[rows]
        else:
            speed, by = float(np.linalg.norm(total[rows])), trial
            part = np.eye(len(impulse))[rows] - rho[1] * operator[rows]
        mu, size = coefficient_at(law, speed)[0], float(np.linalg.norm(by))
        along = by / size
        residual[rows] = impulse[rows] - mu * abs(normal) * along
        turning = mu * abs(normal) / size * (np.eye(d - 1) - np.outer(along, along))
        slope[rows] = np.eye(len(impulse))[rows] - turning @ part
        slope[rows, i * d] -= mu * np.sign(normal) * along
    return residual, slope

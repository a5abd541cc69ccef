"""Impulses of a step whose Gauss–Seidel sweeps do not settle: Newton's method on the projections of Alart and Curnier.

With w = free + W P the laws say P_N = max(0, P_N − ρ w_N) and P_T = proj(P_T − ρ w_T) on the disc of radius μ P_N, which
is semismooth: each step solves the linear problem of the statuses that the projections tell (Alart and Curnier 1991).
What it finds is where the sweeps go on from; they have the last word.
"""

from __future__ import annotations

import numpy as np

from ....contact.multipliers import STICK
from ....laws.packed import coefficient_at
from ....typing import Array
from .arrays import Nodes, State, Work

ITERATIONS = 40
CLOSE = 1e-12  # of the largest impulse


def newton(nodes: Nodes, state: State, work: Work) -> None:
    """Impulses into work.impulse; those that leave the least residual, where it does not converge."""
    d = work.local.shape[1]
    size = len(work.free)
    operator = nodes.delassus + np.diag(np.repeat(nodes.layer, d) * (np.arange(size) % d == 0))
    impulse = work.impulse.copy()
    best, least = impulse, np.inf
    for _ in range(ITERATIONS):
        residual, slope = _linearised(nodes, state, operator, impulse, work.free + operator @ impulse, d)
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


def _linearised(
    nodes: Nodes, state: State, operator: Array, impulse: Array, total: Array, d: int
) -> tuple[Array, Array]:
    """P less its projection (m d,), and the slope of that (m d, m d)."""
    residual, slope = np.empty_like(impulse), np.eye(len(impulse))
    for i in range(len(nodes.gap)):
        at = slice(i * d, i * d + d)
        block = operator[at, at]
        rho = 1.0 / max(block[0, 0], 1e-300), (d - 1) / max(float(np.trace(block[1:, 1:])), 1e-300)
        residual[at], here = impulse[at], np.zeros((d, len(impulse)))
        pushed = impulse[at][0] - rho[0] * total[at][0]
        if pushed <= 0.0 and not nodes.kept[i]:
            continue
        # P_N − (P_N − ρ w_N), over ρ times the block so that it is an impulse.
        residual[i * d], slope[i * d] = rho[0] * total[i * d], rho[0] * operator[i * d]
        law = nodes.friction[nodes.owner[i]]
        trial = impulse[at][1:] - rho[1] * total[at][1:]
        length, normal = float(np.linalg.norm(trial)), impulse[i * d]
        sticks = state.status[i] == STICK
        limit = law[1] if sticks else coefficient_at(law, 0.0)[0]
        rows = slice(i * d + 1, i * d + d)
        if length <= limit * abs(normal):
            residual[rows], slope[rows] = rho[1] * total[rows], rho[1] * operator[rows]
            continue
        mu = coefficient_at(law, float(np.linalg.norm(total[rows])))[0]
        along = trial / length
        residual[rows] = impulse[rows] - mu * abs(normal) * along
        turning = mu * abs(normal) / length * (np.eye(d - 1) - np.outer(along, along))
        here = -turning @ (np.eye(len(impulse))[rows] - rho[1] * operator[rows])
        here[:, i * d] -= mu * np.sign(normal) * along
        slope[rows] = np.eye(len(impulse))[rows] + here
    return residual, slope

"""One step in the complete modal basis, compiled."""

from __future__ import annotations

from typing import Any

import numpy as np

from ....kernels import njit
from ....typing import Array, IntArray
from ...arithmetic import FAST
from ...beta2 import Scheme
from .layout import Fields, ModalRows
from .operators import ModalArrays

_unsigned: Any = np.uint64


@njit(cache=True, fastmath=FAST)
def modal_energies(modal: ModalArrays, scheme: Scheme, u: Array, q: Array) -> tuple[float, float]:
    # pragma: no cover - compiled
    """Kinetic and elastic energy at t_{n−1/2}: ½ q·q and ½ u_n·ω²·u_{n−1}."""
    kinetic = elastic = 0.0
    stiffness, step = modal.stiffness, scheme.step
    for i in range(u.shape[0]):
        kinetic += q[i] * q[i]
        elastic += stiffness[i] * u[i] * (u[i] - step * q[i])
    return 0.5 * kinetic, 0.5 * elastic


@njit(cache=True, fastmath=FAST, inline="always")
def _push(
    d: Array, drive: Array, rows: Array, chosen: IntArray, at: int, end: int, force: Array, lo: int, hi: int
) -> None:  # pragma: no cover - compiled
    """d += drive Σ p·row over rows chosen[at:end] and modes lo … hi − 1, up to three rows at a time."""
    while at < end:
        left = end - at
        r0 = chosen[at]
        p0 = force[r0]
        if left >= 3:
            r1, r2 = chosen[at + 1], chosen[at + 2]
            p1, p2 = force[r1], force[r2]
            for i in range(lo, hi):
                d[i] += drive[i] * (p0 * rows[r0, i] + p1 * rows[r1, i] + p2 * rows[r2, i])
            at += 3
        elif left == 2:
            r1 = chosen[at + 1]
            p1 = force[r1]
            for i in range(lo, hi):
                d[i] += drive[i] * (p0 * rows[r0, i] + p1 * rows[r1, i])
            at += 2
        else:
            for i in range(lo, hi):
                d[i] += drive[i] * (p0 * rows[r0, i])
            at += 1


@njit(cache=True, fastmath=FAST, inline="always")
def _pull(
    u: Array, d: Array, rows: Array, chosen: IntArray, at: int, end: int, lo: int, hi: int, predicted: Array
) -> None:  # pragma: no cover - compiled
    """predicted[r] += row·(u + d) over rows chosen[at:end] and modes lo … hi − 1."""
    while at < end:
        left = end - at
        r0 = chosen[at]
        y0 = y1 = y2 = 0.0
        if left >= 3:
            r1, r2 = chosen[at + 1], chosen[at + 2]
            for i in range(lo, hi):
                new = u[i] + d[i]
                y0 += rows[r0, i] * new
                y1 += rows[r1, i] * new
                y2 += rows[r2, i] * new
            predicted[r1] += y1
            predicted[r2] += y2
            at += 3
        elif left == 2:
            r1 = chosen[at + 1]
            for i in range(lo, hi):
                new = u[i] + d[i]
                y0 += rows[r0, i] * new
                y1 += rows[r1, i] * new
            predicted[r1] += y1
            at += 2
        else:
            for i in range(lo, hi):
                y0 += rows[r0, i] * (u[i] + d[i])
            at += 1
        predicted[r0] += y0


@njit(cache=True, fastmath=FAST)
def modal_pass(
    modal: ModalArrays, scheme: Scheme, rows: ModalRows, force: Array, fields: Fields, predicted: Array
) -> float:  # pragma: no cover - compiled
    """Add contact forces, complete t_{n+1}, predict t_{n+2}; returns Σ c v² at t_n.

    Short loops over few arrays each: one loop over all of them is not turned into vector instructions,
    because the compiler would have to prove too many pairs of arrays distinct. Unsigned bounds spare it
    the test for negative indices.
    """
    u, q, d, constant = fields.u, fields.q, fields.d, fields.constant
    forward, restore, drive, damping = modal.forward, modal.restore, modal.drive, modal.damping
    gain, two_b, memory = scheme.gain, 2.0 * scheme.beta2 / scheme.step, scheme.memory
    dissipated = 0.0
    predicted[:] = 0.0
    for b in range(modal.blocks.shape[0] - 1):
        lo, hi = _unsigned(modal.blocks[b]), _unsigned(modal.blocks[b + 1])
        _push(d, drive, rows.values, rows.pushing, rows.push_at[b], rows.push_at[b + 1], force, lo, hi)
        for i in range(lo, hi):
            velocity = q[i] + two_b * d[i]
            dissipated += damping[i] * velocity * velocity
        for i in range(lo, hi):
            u[i] += d[i]
        for i in range(lo, hi):
            q[i] = memory * q[i] + gain * d[i]
        for i in range(lo, hi):
            d[i] = forward[i] * q[i] - restore[i] * u[i] + constant[i]
        _pull(u, d, rows.values, rows.pulling, rows.pull_at[b], rows.pull_at[b + 1], lo, hi, predicted)
    return dissipated / (scheme.s * scheme.s)


@njit(cache=True)
def complete_modal(
    modal: ModalArrays, rows: ModalRows, force: Array, fields: Fields, loads_at: int
) -> None:  # pragma: no cover - compiled
    """fields.buffer = d with the contact forces in it."""
    d, out, drive, values = fields.d, fields.buffer, modal.drive, rows.values
    for i in range(d.shape[0]):
        push = 0.0
        for r in range(loads_at):
            push += force[r] * values[r, i]
        out[i] = d[i] + drive[i] * push


@njit(cache=True)
def modal_constant(modal: ModalArrays, rows: ModalRows, fields: Fields, loads_at: int) -> None:
    # pragma: no cover - compiled
    """Part of d that loads and supports make."""
    constant, coefficients, drive, values = fields.constant, fields.coefficients, modal.drive, rows.values
    for i in range(constant.shape[0]):
        total = 0.0
        for j in range(coefficients.shape[0]):
            total += coefficients[j] * values[loads_at + j, i]
        constant[i] = drive[i] * total

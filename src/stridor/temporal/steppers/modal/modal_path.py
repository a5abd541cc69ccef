"""One step in the complete modal basis, compiled."""

from __future__ import annotations

from typing import Any, NamedTuple

from ....kernels import njit
from ....typing import Array, IntArray
from ...arithmetic import FAST
from ...beta2 import Scheme
from .layout import Fields, ModalRows
from .operators import ModalArrays
from .vectors import (
    LANES,
    address,
    load,
    minus_product,
    plus,
    plus_product,
    plus_times,
    product,
    store,
    times,
    total,
    zero,
)


class Addresses(NamedTuple):
    """Where the arrays of a pass begin, and the bytes of a row of ``values``."""

    u: int
    q: int
    d: int
    constant: int
    forward: int
    restore: int
    drive: int
    damping: int
    values: int
    width: int


@njit(cache=True, allocates=False, fastmath=FAST)
def modal_energies(modal: ModalArrays, scheme: Scheme, u: Array, q: Array) -> tuple[float, float]:
    # pragma: no cover - compiled
    """Kinetic and elastic energy at t_{n−1/2}: ½ q·q and ½ u_n·ω²·u_{n−1}."""
    kinetic = elastic = 0.0
    stiffness, step = modal.stiffness, scheme.step
    for i in range(u.shape[0]):
        kinetic += q[i] * q[i]
        elastic += stiffness[i] * u[i] * (u[i] - step * q[i])
    return 0.5 * kinetic, 0.5 * elastic


@njit(cache=True, allocates=False, inline="always")
def _advanced(a: Addresses, i: int, d: Any, q: Any, memory: float, gain: float) -> Any:  # pragma: no cover - compiled
    """Complete the modes of lane i to t_{n+1} with the increment d and predict them: u + d of the next step."""
    u = plus(load(a.u, i), d)
    q = plus_times(times(memory, q), gain, d)
    d = minus_product(plus_product(load(a.constant, i), load(a.forward, i), q), load(a.restore, i), u)
    store(a.u, i, u)
    store(a.q, i, q)
    store(a.d, i, d)
    return plus(u, d)


@njit(cache=True, allocates=False, inline="always")
def _one_row(
    a: Addresses, scheme: Scheme, first: int, last: int, force: Array, predicted: Array, row: int
) -> float:  # pragma: no cover - compiled
    """A block with one row; Σ c v² of its modes, times s²."""
    memory, gain, two_b = scheme.memory, scheme.gain, 2.0 * scheme.beta2 / scheme.step
    p, at = force[row], a.values + row * a.width
    y, dissipated = zero(), zero()
    for i in range(first, last):
        here, q = load(at, i), load(a.q, i)
        d = plus_product(load(a.d, i), load(a.drive, i), times(p, here))
        velocity = plus_times(q, two_b, d)
        dissipated = plus_product(dissipated, product(load(a.damping, i), velocity), velocity)
        y = plus_product(y, here, _advanced(a, i, d, q, memory, gain))
    predicted[row] += total(y)
    return total(dissipated)


@njit(cache=True, allocates=False, inline="always")
def _three_rows(
    a: Addresses, scheme: Scheme, first: int, last: int, force: Array, predicted: Array, r0: int, r1: int, r2: int
) -> float:  # pragma: no cover - compiled
    """A block with more, by three of them; the same sum."""
    memory, gain, two_b = scheme.memory, scheme.gain, 2.0 * scheme.beta2 / scheme.step
    p0, p1, p2 = force[r0], force[r1], force[r2]
    at0, at1, at2 = a.values + r0 * a.width, a.values + r1 * a.width, a.values + r2 * a.width
    y0, y1, y2, dissipated = zero(), zero(), zero(), zero()
    for i in range(first, last):
        row0, row1, row2, q = load(at0, i), load(at1, i), load(at2, i), load(a.q, i)
        push = plus_times(plus_times(times(p0, row0), p1, row1), p2, row2)
        d = plus_product(load(a.d, i), load(a.drive, i), push)
        velocity = plus_times(q, two_b, d)
        dissipated = plus_product(dissipated, product(load(a.damping, i), velocity), velocity)
        new = _advanced(a, i, d, q, memory, gain)
        y0 = plus_product(y0, row0, new)
        y1 = plus_product(y1, row1, new)
        y2 = plus_product(y2, row2, new)
    predicted[r0] += total(y0)
    predicted[r1] += total(y1)
    predicted[r2] += total(y2)
    return total(dissipated)


@njit(cache=True, allocates=False)
def _push_others(
    a: Addresses, first: int, last: int, force: Array, chosen: IntArray, at: int, end: int
) -> None:  # pragma: no cover - compiled
    """d += drive Σ p·row over rows chosen[at:end]."""
    for k in range(at, end):
        row = a.values + chosen[k] * a.width
        p = force[chosen[k]]
        if p != 0.0:
            for i in range(first, last):
                store(a.d, i, plus_product(load(a.d, i), load(a.drive, i), times(p, load(row, i))))


@njit(cache=True, allocates=False)
def _pull_others(
    a: Addresses, first: int, last: int, predicted: Array, chosen: IntArray, at: int, end: int
) -> None:  # pragma: no cover - compiled
    """predicted[r] += row·(u + d) over rows chosen[at:end]."""
    for k in range(at, end):
        row, y = a.values + chosen[k] * a.width, zero()
        for i in range(first, last):
            y = plus_product(y, load(row, i), plus(load(a.u, i), load(a.d, i)))
        predicted[chosen[k]] += total(y)


@njit(cache=True, allocates=False)
def modal_pass(
    modal: ModalArrays, scheme: Scheme, rows: ModalRows, force: Array, fields: Fields, predicted: Array
) -> float:  # pragma: no cover - compiled
    """Add contact forces, complete t_{n+1}, predict t_{n+2}; returns Σ c v² at t_n.

    One loop over all arrays, ``LANES`` modes at a time, in which every number is read and written once.
    """
    size = 8 * rows.values.shape[1]
    a = Addresses(
        address(fields.u), address(fields.q), address(fields.d), address(fields.constant), address(modal.forward),
        address(modal.restore), address(modal.drive), address(modal.damping), address(rows.values), size,
    )  # fmt: skip
    nothing = rows.values.shape[0] - 1
    dissipated = 0.0
    predicted[:] = 0.0
    for b in range(modal.blocks.shape[0] - 1):
        first, last = modal.blocks[b] // LANES, modal.blocks[b + 1] // LANES
        at, end = rows.at[b], rows.at[b + 1]
        count = end - at
        if count < 2:
            row = rows.met[at] if count else nothing
            dissipated += _one_row(a, scheme, first, last, force, predicted, row)
            continue
        if count > 3:
            _push_others(a, first, last, force, rows.met, at + 3, end)
        third = rows.met[at + 2] if count > 2 else nothing
        dissipated += _three_rows(a, scheme, first, last, force, predicted, rows.met[at], rows.met[at + 1], third)
        if count > 3:
            _pull_others(a, first, last, predicted, rows.met, at + 3, end)
    return dissipated / (scheme.s * scheme.s)


@njit(cache=True, allocates=False)
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


@njit(cache=True, allocates=False)
def modal_constant(modal: ModalArrays, rows: ModalRows, fields: Fields, loads_at: int) -> None:
    # pragma: no cover - compiled
    """Part of d that loads and supports make."""
    constant, coefficients, drive, values = fields.constant, fields.coefficients, modal.drive, rows.values
    for i in range(constant.shape[0]):
        total = 0.0
        for j in range(coefficients.shape[0]):
            total += coefficients[j] * values[loads_at + j, i]
        constant[i] = drive[i] * total

"""Floquet's multipliers of a cycle in harmonics, from motions beside it followed over a period.

Where contacts only slip, part and come back, what changes beside the cycle obeys x' = A(t) x without jumps, with A from
the derivative of the law at the cycle's motion. Each piece of the period is exp of Magnus' series to fourth order
(Blanes, Casas, Oteo and Ros 2009); pieces begin where contacts part and close. Where slip rests or turns, and where
rigid contacts part, motions beside the cycle jump: those are not taken.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg as sl

from ...typing import Array, BoolArray, ComplexArray
from ..cycle import OPEN, STICK
from .balance import applied_at
from .balanced import Balanced
from .law import Applied

MOST_STATES = 64
PIECES, MOST_PIECES = 128, 2048
SETTLED = 1e-6  # of the matrix: between so many pieces and twice as many
ENOUGH = 1e-3
LOOKED = 2048  # times at least at which contacts are looked at
NARROWER, TIMES = 16, 3  # parts of the time between two of them, so often, for when a contact parts
SMALL = 0.5  # norm of what the series of exp is taken of
TERMS = 12
GAUSS = 0.5 * np.array([1.0 - 1.0 / np.sqrt(3.0), 1.0 + 1.0 / np.sqrt(3.0)])


def monodromy(cycle: Balanced) -> Array | None:
    """What a period makes of a motion beside the cycle, (s, s) on the displacements and velocities that rigid contacts
    leave; None where it jumps, where it is too large, and where the pieces would have to be too many."""
    family = cycle.family
    rigid = np.isinf(family.law.stiffness)
    held = family.condensed.rows[: family.count][rigid]
    basis = sl.null_space(held) if rigid.any() else np.eye(family.condensed.size)
    if 2 * basis.shape[1] > MOST_STATES:
        return None
    looked = max(LOOKED, 4 * cycle.at.base.samples)
    phases = 2 * np.pi * np.arange(looked) / looked
    seen = _applied(cycle, phases)
    if _jumps(seen, rigid):
        return None
    edges = _edges(cycle, phases, seen)
    before: Array | None = None
    pieces = PIECES
    while True:
        found = _product(cycle, np.union1d(2 * np.pi * np.arange(pieces + 1) / pieces, edges), basis, rigid)
        size = max(1.0, float(np.linalg.norm(found)))
        off = np.inf if before is None else float(np.linalg.norm(found - before)) / size
        if off <= SETTLED or pieces >= MOST_PIECES:
            return found if off <= ENOUGH else None
        before, pieces = found, 2 * pieces


def by_monodromy(cycle: Balanced) -> ComplexArray | None:
    """All multipliers, the motion's own among them; None as of `monodromy`."""
    matrix = monodromy(cycle)
    return None if matrix is None else np.asarray(np.linalg.eigvals(matrix), dtype=complex)


def _applied(cycle: Balanced, phases: Array) -> Applied:
    at = cycle.at
    speed = at.omega * at.motion @ at.base.turn.T
    return applied_at(cycle.family, at.base.at(phases), at.z, at.motion, speed, at.mu, at.scales)


def _jumps(seen: Applied, rigid: BoolArray) -> bool:
    """Whether slip rests or turns anywhere, or a rigid contact is open."""
    if np.any(seen.status == STICK) or np.any(seen.status[rigid] == OPEN):
        return True
    way = seen.tangential
    turned = np.einsum("mdn,mdn->mn", way, np.roll(way, -1, axis=2)) < 0.0
    return bool(np.any(turned))


def _edges(cycle: Balanced, phases: Array, seen: Applied) -> Array:
    """Phases at which contacts with stiffness part and close."""
    found: list[Array] = [np.zeros(0)]
    width = phases[1]
    for i in range(len(seen.touch)):
        closed = seen.touch[i] > 0.0
        low = phases[closed != np.roll(closed, -1)]
        step = width
        for _ in range(TIMES if len(low) else 0):
            step /= NARROWER
            looked = low[:, None] + step * np.arange(NARROWER + 1)
            touch = _applied(cycle, looked.ravel()).touch[i].reshape(looked.shape) > 0.0
            first = np.argmax(touch[:, 1:] != touch[:, :1], axis=1)
            low = looked[np.arange(len(low)), first]
        found.append((low + 0.5 * step) % (2 * np.pi))
    return np.concatenate(found)


def _product(cycle: Balanced, grid: Array, basis: Array, rigid: BoolArray) -> Array:
    """The product of the pieces between the phases of the grid."""
    lengths = np.diff(grid)
    kept = lengths > 1e-13
    begins, lengths = grid[:-1][kept], lengths[kept]
    first, second = (_rates(cycle, begins + share * lengths, basis, rigid) for share in GAUSS)
    step = (lengths / cycle.at.omega)[:, None, None]
    exponent = 0.5 * step * (first + second) + np.sqrt(3.0) / 12.0 * step**2 * (second @ first - first @ second)
    parts = _exp(exponent)
    while len(parts) > 1:
        rest = parts[-1:] if len(parts) % 2 else parts[:0]
        even = parts[: len(parts) - len(rest)]
        parts = np.concatenate([even[1::2] @ even[::2], rest])
    return np.asarray(parts[0])


def _rates(cycle: Balanced, phases: Array, basis: Array, rigid: BoolArray) -> Array:
    """A (n, s, s) of x = (Ω u, v) at phases, with u and v within the basis."""
    at, family = cycle.at, cycle.family
    modes, m, d = family.condensed, family.count, family.directions
    law = _applied(cycle, phases)
    n, r, k = len(phases), len(modes.rows), modes.size
    by_gap = np.where(rigid[:, None], 0.0, law.by_gap)
    own = law.by_pull.transpose(3, 0, 1, 2)
    left = np.linalg.inv(np.eye(d) - own)
    by_speed = -at.scales.rub[None, :, None, None] * (left @ own)
    by_normal = np.einsum("nmab,mbn->nma", left, law.by_normal)
    of_motion, of_speed = np.zeros((n, r, r)), np.zeros((n, r, r))
    pushed = np.zeros((n, r, m))
    for i in range(m):
        rows = slice(m + i * d, m + (i + 1) * d)
        of_motion[:, i, i] = by_gap[i] + np.where(rigid[i], 0.0, family.spring[i])
        of_motion[:, rows, i] = by_normal[:, i] * by_gap[i][:, None]
        of_speed[:, rows, rows] = by_speed[:, i]
        pushed[:, i, i] = 1.0
        pushed[:, rows, i] = by_normal[:, i]
    for q in range(family.springs):
        of_motion[:, m * (1 + d) + q, m * (1 + d) + q] = law.by_stretch[q]
    rows = modes.rows
    moved = np.concatenate([rows.T @ of_motion @ rows, rows.T @ of_speed @ rows], axis=2)
    moved[:, :, :k] -= np.diag(modes.squares)
    moved[:, :, k:] -= modes.damping
    if rigid.any():
        normal, push = rows[:m][rigid], rows.T @ pushed[:, :, rigid]
        moved = moved - push @ np.linalg.solve(normal @ push, normal @ moved)
    s = basis.shape[1]
    # Displacements times a frequency, so that both are alike.
    stiff = basis.T @ (modes.squares[:, None] * basis)
    squares, turn = np.linalg.eigh(stiff)
    free, frequency = basis @ turn, np.sqrt(squares)
    found = np.zeros((n, 2 * s, 2 * s))
    found[:, :s, s:] = np.diag(frequency)
    found[:, s:, :s] = free.T @ moved[:, :, :k] @ (free / frequency)
    found[:, s:, s:] = free.T @ moved[:, :, k:] @ free
    return found


def _exp(matrices: Array) -> Array:
    """exp of each (n, s, s), by its series and squares of that."""
    size = float(np.abs(matrices).sum(axis=1).max(initial=0.0))
    squarings = max(0, int(np.ceil(np.log2(max(size, 1e-300) / SMALL))))
    scaled = matrices / 2.0**squarings
    eye = np.eye(matrices.shape[1])
    found = eye + scaled / TERMS
    for term in range(TERMS - 1, 0, -1):
        found = eye + scaled @ found / term
    for _ in range(squarings):
        found = found @ found
    return found

"""Floquet's multipliers of a cycle in harmonics, by Hill's determinant, and held against motions followed.

A motion beside the cycle is exp(σt) times a series of the cycle's period; with it the derivative of the balance, at
s = σ + jkω in place of jkω, is singular. With displacements and velocities of the modes as unknowns that is linear in
σ; of its roots, of which there are 2h + 1 for each exponent, each displaced by a multiple of jω, those count whose
series are centred at k = 0 (Lazarus and Thomas 2010; Bayer, Leine, Thomas and Grolet 2024).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment

from ...typing import Array, ComplexArray, IntArray
from .balance import applied_at
from .balanced import Balanced
from .monodromy import by_monodromy

MOST = 700  # size of the eigenproblem: 2 k (2h + 1)
SHIFT = 0.05  # of ω: where the roots are sought about
FINER = 4  # times as many times as the balance has
APART = 0.5  # between the centres of two roots of one exponent
ALIKE = 0.02  # of a multiplier
CENTRAL = 0.9  # of series: how far from k = 0
EDGE = 0.15  # of half a turn: how near to a negative number
FAR = 10.0  # times the highest frequency: no exponent that counts
LARGE = 0.9  # size of a multiplier that must not be missing
INNER = 1.5  # of series: how far from k = 0 copies are right enough to tell
MISSED = 0.1  # of it: how far the nearest of those found is from one that is missing
AGREE = 0.05  # with motions followed
SO_NEAR = 10.0  # times as far from one as the nearest: another so near may be the own one of the motion


def hill_size(cycle: Balanced) -> int:
    """Size of the eigenproblem."""
    return 2 * cycle.family.condensed.size * cycle.at.base.length


class Hill(NamedTuple):
    """Multipliers (2k − 1,), largest first, without the one of the motion itself, and how far that one, the nearest to
    one, came out from one: it has to be one, so that others are not much closer than it."""

    multipliers: ComplexArray
    own_off: float


def hill(cycle: Balanced) -> Hill | None:
    """Floquet's multipliers of a cycle of a system of k modes; None where they are not known: the system is too large,
    or roots of Hill's determinant tell that some are missing.

    Where nothing jumps beside the cycle they are held against motions followed over the period (`monodromy`), which
    are believed where both differ."""
    followed = by_monodromy(cycle)
    found = by_hill(cycle) if hill_size(cycle) <= MOST else None
    if followed is not None and (found is None or not agree(found, followed)):
        found = followed
    return None if found is None else _without_own(found)


def agree(found: ComplexArray, followed: ComplexArray) -> bool:
    """Whether the multipliers followed, which rigid contacts leave less of, are all among those found, and these are
    zero beyond them."""
    off = np.abs(found[:, None] - followed[None, :])
    rows, columns = linear_sum_assignment(off)
    rest = np.delete(np.abs(found), rows)
    return bool(off[rows, columns].max(initial=0.0) <= AGREE and rest.max(initial=0.0) <= AGREE)


def by_hill(cycle: Balanced) -> ComplexArray | None:
    """All 2k multipliers by Hill's determinant, the motion's own among them; None where some are missing."""
    at, family = cycle.at, cycle.family
    modes, h = family.condensed, at.base.harmonics
    k, length = modes.size, 2 * h + 1
    shift = SHIFT * at.omega
    s = shift + 1j * at.omega * np.arange(-h, h + 1)
    of_force, of_motion, of_speed = _toeplitz(cycle)
    rows = modes.rows
    # D(s)⁻¹ at each harmonic, and what it makes of displacements and velocities on the right.
    dynamic = s[:, None, None] * modes.damping.astype(complex)
    index = np.arange(k)
    dynamic[:, index, index] += s[:, None] ** 2 + modes.squares
    inverse = np.linalg.inv(dynamic)
    drag = modes.damping + s[:, None, None] * np.eye(k)
    from_u, from_v = -inverse @ drag, -inverse  # (l, k, k): displacement that they leave without contact forces
    value = rows @ inverse @ rows.T
    r = len(rows)
    matrix = np.eye(r * length, dtype=complex) - of_force - _times(of_motion, value)
    matrix -= _times(of_speed, s[:, None, None] * value)
    at_u, at_v = rows @ from_u, rows @ from_v
    pulled_u = _times(of_motion, at_u) + _times(of_speed, s[:, None, None] * at_u + rows)
    pulled_v = _times(of_motion, at_v) + _times(of_speed, s[:, None, None] * at_v)
    forces = np.linalg.solve(matrix, np.hstack([pulled_u, pulled_v]))
    moved = _blocks(inverse @ rows.T) @ forces
    moved[:, : k * length] += _blocks(from_u)
    moved[:, k * length :] += _blocks(from_v)
    speeds = np.repeat(s, k)[:, None] * moved
    speeds[:, : k * length] += np.eye(k * length)
    roots, vectors = np.linalg.eig(np.vstack([moved, speeds]))
    # Rigid contacts leave roots at infinity, which rounding brings to anywhere far away.
    farthest = FAR * (float(np.sqrt(modes.squares.max())) + h * at.omega)
    kept = np.abs(roots) * farthest > 1.0
    exponents: ComplexArray = (shift + 1.0 / roots[kept]).astype(complex)
    vectors = vectors[:, kept]
    sizes = np.abs(vectors[: k * length].reshape(length, k, -1)) ** 2
    weights = np.maximum(sizes.sum(axis=1), 1e-300)
    centres = (np.arange(-h, h + 1)[:, None] * weights).sum(axis=0) / weights.sum(axis=0)
    period = 2 * np.pi / at.omega
    multipliers = np.exp(np.minimum(exponents.real * period, 300.0) + 1j * exponents.imag * period)
    found = chosen(multipliers, centres)[: 2 * k]
    if _lost(multipliers, centres, found):
        return None
    # What has no root left has died out within a period: sticking takes a motion beside the cycle away.
    return np.concatenate([found, np.zeros(2 * k - len(found), dtype=complex)])


def chosen(multipliers: ComplexArray, centres: Array) -> ComplexArray:
    """One multiplier of each exponent, largest first, from all roots and where their series are centred.

    The copies of an exponent have one multiplier and centres one apart, so that one of them is centred within half of
    k = 0, whatever its frequency: a motion that is nearly one harmonic far above ω has that one far above ω as well.
    Where it is half from k = 0, two copies are as near."""
    central = np.flatnonzero(np.abs(centres) < CENTRAL)
    central = central[np.argsort(np.abs(centres[central]), kind="stable")]

    def copies(j: int, of: complex, among: list[int] | IntArray) -> list[int]:
        """Those of some that may be copies of a root, nearest first."""
        met = [
            int(k) for k in among
            if k != j and abs(of - multipliers[k]) <= ALIKE * abs(of)
            and APART < abs(centres[j] - centres[k]) < 2.0 - APART
        ]  # fmt: skip
        return sorted(met, key=lambda k: abs(of - multipliers[k]))

    free: list[int] = []  # of those found, the ones whose other copy was not met
    values: list[complex] = []
    for j in map(int, central):
        here = complex(multipliers[j])
        # A negative multiplier has its two copies at ±jω/2, which need not be displaced by all of jω then.
        negative = abs(np.angle(here)) > (1.0 - EDGE) * np.pi
        halved = negative and not copies(j, here, central) and bool(copies(j, here.conjugate(), central))
        met = copies(j, here.conjugate() if halved else here, free)
        if met:
            free.remove(met[0])
            continue
        free.append(j)
        values.append(-abs(here) if halved else here)
    found = np.array(values, dtype=complex)
    return found[np.argsort(-np.abs(found), kind="stable")]


def _lost(multipliers: ComplexArray, centres: Array, found: ComplexArray) -> bool:
    """Whether a root that counts for stability is a copy of none of those found."""
    inner = np.flatnonzero((np.abs(centres) < INNER) & (np.abs(multipliers) > LARGE))
    if not len(inner):
        return False
    off = np.abs(multipliers[inner, None] - found[None, :]).min(axis=1, initial=np.inf)
    return bool(np.any(off > MISSED * np.abs(multipliers[inner])))


def _without_own(found: ComplexArray) -> Hill:
    """What is left without the multiplier of the motion itself, the nearest to one, and how far that is from it: where
    another is about as near, as beside a fold, the motion's own may be either, and off by as much as the other."""
    off = np.abs(found - 1.0)
    own = int(np.argmin(off))
    rest = np.delete(found, own)
    other = float(np.delete(off, own).min(initial=np.inf))
    error = other if other < SO_NEAR * off[own] else float(off[own])
    return Hill(rest[np.argsort(-np.abs(rest), kind="stable")], error)


def _toeplitz(cycle: Balanced) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """How forces change with z, r and ṙ (l r, l r), harmonic by harmonic."""
    at, family = cycle.at, cycle.family
    m, d, r = family.count, family.directions, len(at.z)
    length = at.base.length
    of_force, of_motion, of_speed = (np.zeros((length, r, length, r), dtype=complex) for _ in range(3))
    phases = 2 * np.pi * np.arange(FINER * at.base.samples) / (FINER * at.base.samples)
    speed = at.omega * at.motion @ at.base.turn.T
    applied = applied_at(family, at.base.at(phases), at.z, at.motion, speed, at.mu, at.scales)
    gap = applied.by_gap - family.spring[:, None] * applied.by_force
    for i in range(m):
        edges = _edges(applied.touch[i], applied.beyond[i])

        def spread(values: Array, edges: tuple[IntArray, Array] = edges) -> ComplexArray:
            return _spread(values, edges, length)

        of_force[:, i, :, i], of_motion[:, i, :, i] = spread(applied.by_force[i]), spread(gap[i] + family.spring[i])
        for a in range(d):
            row = m + i * d + a
            of_force[:, row, :, i] = spread(applied.by_normal[i, a] * applied.by_force[i])
            of_motion[:, row, :, i] = spread(applied.by_normal[i, a] * gap[i])
            for b in range(d):
                pull = spread(applied.by_pull[i, a, b])
                of_force[:, row, :, m + i * d + b] = pull
                of_speed[:, row, :, m + i * d + b] = -at.scales.rub[i] * pull
    for q in range(family.springs):
        row = m * (1 + d) + q
        of_motion[:, row, :, row] = _spread(applied.by_stretch[q], (np.zeros(0, dtype=np.int64), np.zeros(0)), length)
    square = (length * r, length * r)
    return of_force.reshape(square), of_motion.reshape(square), of_speed.reshape(square)


def _edges(touch: Array, beyond: Array) -> tuple[IntArray, Array]:
    """Between which times (e,) and the next a number changes sign, and at which share (e,) of the time between."""
    found: dict[int, float] = {}
    for number in (beyond, touch):
        following = np.roll(number, -1)
        for n in np.flatnonzero((number > 0.0) != (following > 0.0)):
            found[int(n)] = float(number[n] / (number[n] - following[n]))
    return np.array(list(found), dtype=np.int64), np.array(list(found.values()))


def _spread(values: Array, edges: tuple[IntArray, Array], length: int) -> ComplexArray:
    """Toeplitz' matrix (l, l) of what multiplies in time, and jumps at the edges."""
    at, share = edges
    following = (at + 1) % len(values)
    more = 0.5 * (share - 0.5) * (values[at] - values[following])
    held = values.astype(float)
    np.add.at(held, at, more)
    np.add.at(held, following, more)
    spectrum = np.fft.fft(held) / len(held)
    return spectrum[np.subtract.outer(np.arange(length), np.arange(length))]


def _blocks(parts: ComplexArray) -> ComplexArray:
    """Block diagonal (l a, l b) of (l, a, b)."""
    length, a, b = parts.shape
    found = np.zeros((length, a, length, b), dtype=complex)
    index = np.arange(length)
    found[index, :, index, :] = parts
    return found.reshape(length * a, length * b)


def _times(matrix: ComplexArray, parts: ComplexArray) -> ComplexArray:
    """(l r, l r) times the block diagonal of (l, r, b)."""
    length, r, b = parts.shape
    product = np.einsum("xma,mab->xmb", matrix.reshape(-1, length, r), parts)
    return product.reshape(-1, length * b)

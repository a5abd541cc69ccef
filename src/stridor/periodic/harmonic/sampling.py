"""What a cycle in harmonics looks like over one period."""

from __future__ import annotations

import numpy as np

from ...typing import Array, ComplexArray, IntArray
from ..cycle import OPEN, SLIP, STICK, Change, Cycle, sample_count, slip_range
from .balance import applied_at
from .balanced import Balanced, defect
from .hill import hill

SAMPLES = 512  # of a period, or more: `sample_count`
KEPT = 16  # of the multipliers
ALONG, AGAINST = 2, 3  # slip, as a change tells it


def sampled_series(cycle: Balanced, reached_from: str) -> Cycle:
    """The cycle as data. Forces are those of the laws of contact and friction at the cycle's motion; what lasts
    less than the period of the last harmonic is not told: a stick so short counts as the slip around it, slip so short
    beside stick as stick, slip so short amid slip the other way as that."""
    at, family = cycle.at, cycle.family
    phases = 2 * np.pi * np.arange(at.base.samples) / at.base.samples
    ways = _ways(cycle)
    fine = _at(cycle, phases, ways)
    times = np.linspace(0.0, cycle.period, sample_count(np.vstack([fine[0], fine[3]]).T, SAMPLES))
    normal, friction, slip, gap, _ = _at(cycle, 2 * np.pi * times / cycle.period, ways)
    codes = np.stack([without_short(row, at.base.harmonics) for row in fine[4]])
    shares = np.stack([np.mean(codes == kind, axis=1) for kind in (OPEN, STICK)], axis=1)
    index = np.minimum((times / cycle.period * at.base.samples).astype(int), at.base.samples - 1)
    status = np.where(codes >= ALONG, SLIP, codes)[:, index]
    floquet = hill(cycle)
    known = floquet is not None
    multipliers, own_off = floquet or (np.zeros(0, dtype=complex), np.nan)
    displacement, velocity, acceleration = _watched(cycle, times)
    return Cycle(
        cycle.mu, cycle.period, cycle.residual, multipliers[:KEPT],
        _changes(codes, family.names, cycle.period), family.names, tuple(family.system.points),
        times, normal.T, friction.T, slip.T, gap.T, status.T.astype(np.int64),
        displacement, velocity, acceleration, np.column_stack([shares, 1.0 - shares.sum(axis=1)]),
        slip_range(fine[2].T, codes.T),
        np.stack([fine[0].min(axis=1), fine[0].max(axis=1)], axis=1), np.nan, 0, reached_from, "harmonic",
        at.base.harmonics, defect(cycle), known, own_off,
    )  # fmt: skip


def _ways(cycle: Balanced) -> Array:
    """Directions (m, d) along which slip and friction are told: a point's tangent, a surface's steady slip."""
    family = cycle.family
    ways = np.where(family.speed[:, None] > 0.0, family.slip / np.maximum(family.speed, 1e-300)[:, None], 0.0)
    along = (family.speed == 0.0) | np.isnan(family.system.contact_nodes().area)
    ways[along] = np.eye(1, ways.shape[1])
    return ways


def _at(cycle: Balanced, phases: Array, ways: Array) -> tuple[Array, Array, Array, Array, IntArray]:
    """Normal force, friction, slip velocity, gap (m, n) and what each node does, 0 open, 1 stick, 2 slip along, 3
    against.

    Which way it slips is told by friction, which is against it. Series of a velocity with a kink, as where a stick
    begins or ends, overshoot: that they are below zero there does not say that slip turns."""
    at, family = cycle.at, cycle.family
    series, speed = at.base.at(phases), at.omega * at.motion @ at.base.turn.T
    applied = applied_at(family, series, at.z, at.motion, speed, at.mu, at.scales)
    gap, _, _ = family.split(at.motion @ series.T)
    _, moving, _ = family.split(speed @ series.T)
    slip = np.einsum("mdn,md->mn", moving + family.slip[:, :, None], ways)
    friction = np.einsum("mdn,md->mn", applied.tangential, ways)
    against = np.where(friction != 0.0, friction > 0.0, slip < 0.0)
    codes = np.where(applied.status == SLIP, np.where(against, AGAINST, ALONG), applied.status)
    return applied.normal, friction, slip, gap + family.nodes.gap[:, None], codes.astype(np.int64)


def without_short(codes: IntArray, harmonics: int) -> IntArray:
    """Without what is too short to be told by so many harmonics: slip beside a stick that is long enough is stick, a
    stick goes half to what is before and half to behind, and slip amid slip the other way goes with that."""
    return _one_way(_without(_without(codes, harmonics, SLIP), harmonics, STICK), harmonics)


def _parts(codes: IntArray) -> tuple[IntArray, IntArray]:
    """Where (e,) one thing after another begins, and how many times (e,) it lasts."""
    edges = np.flatnonzero(codes != np.roll(codes, 1))
    return edges, (np.roll(edges, -1) - edges) % len(codes)


def _without(codes: IntArray, harmonics: int, kind: int) -> IntArray:
    """Without slip, or without stick, that is too short."""
    found, n = codes.copy(), len(codes)
    edges, lengths = _parts(codes)
    if len(edges) < 2:
        return found
    for k, first in enumerate(edges):
        length, after = int(lengths[k]), (k + 1) % len(edges)
        here, before, behind = codes[first], codes[first - 1], codes[edges[after]]
        if length * harmonics >= n or min(here, SLIP) != kind:
            continue
        if kind == SLIP:
            beside = ((before, lengths[k - 1]), (behind, lengths[after]))
            if not any(what == STICK and lasting * harmonics >= n for what, lasting in beside):
                continue
            before = behind = STICK
        elif OPEN in (before, behind):
            before = behind = max(before, behind)
        places = (first + np.arange(length)) % n
        found[places[: length // 2]], found[places[length // 2 :]] = before, behind
    return found


def _one_way(codes: IntArray, harmonics: int) -> IntArray:
    """Without slip that is too short, where before and behind it slips the other way."""
    found, n = codes.copy(), len(codes)
    edges, lengths = _parts(codes)
    for k in np.argsort(lengths, kind="stable"):
        first, length = edges[k], int(lengths[k])
        places = (first + np.arange(length)) % n
        here, before, behind = found[first], found[first - 1], found[(places[-1] + 1) % n]
        other = ALONG + AGAINST - here
        if len(edges) > 1 and length * harmonics < n and here >= ALONG and before == behind == other:
            found[places] = other
    return found


def _changes(codes: IntArray, names: tuple[str, ...], period: float) -> tuple[Change, ...]:
    n = codes.shape[1]
    before = np.roll(codes, 1, axis=1)
    found: list[Change] = []
    for t, c in zip(*np.nonzero((codes != before).T), strict=True):
        one, other = int(before[c, t]), int(codes[c, t])
        what = "closes" if one == OPEN else {
            OPEN: "opens", STICK: "stops", ALONG: "slips forward", AGAINST: "slips backward"
        }[other]  # fmt: skip
        found.append(Change(float(t) / n * period, names[c], what, tuple(int(b) for b in codes[:, t])))
    return tuple(found)


def coordinates(cycle: Balanced) -> ComplexArray:
    """Amplitudes (h + 1, k) of the modes' coordinates."""
    at, modes = cycle.at, cycle.family.condensed
    s = 1j * at.omega * np.arange(at.base.harmonics + 1)
    found = np.einsum("kij,kj->ki", modes.answers(s), at.base.complex_of(at.z))  # ty: ignore[invalid-argument-type]
    found[0] += modes.load / modes.squares
    return found


def _watched(cycle: Balanced, times: Array) -> tuple[Array, Array, Array]:
    """Displacement, velocity and acceleration (t, w, d) of the watched points."""
    at, family, system = cycle.at, cycle.family, cycle.family.system
    names, d = tuple(system.points), system.dimension
    free = np.concatenate(
        [np.zeros((0, family.condensed.size))]
        + [np.asarray(system.points[name].free[:d] @ family.condensed.vectors) for name in names]
    )
    lift = np.concatenate([np.zeros((0, len(system.motion.names)))] + [system.points[n].lift[:d] for n in names])
    amplitudes = coordinates(cycle) @ free.T
    distance = system.motion.full_distance
    still = np.concatenate([np.zeros(0)] + [system.points[n].free[:d] @ (system.motion.lift @ distance) for n in names])
    rows, series = at.base.real_of(amplitudes), at.base.at(2 * np.pi * times / cycle.period)
    first = at.omega * rows @ at.base.turn.T
    moved, speed = lift @ distance - still, lift @ family.motion
    values = (
        series @ rows.T + moved + np.outer(times, speed), series @ first.T + speed,
        series @ (at.omega * first @ at.base.turn.T).T,
    )  # fmt: skip
    shape = (len(times), len(names), d)
    return values[0].reshape(shape), values[1].reshape(shape), values[2].reshape(shape)

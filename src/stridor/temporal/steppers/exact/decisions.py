"""What contacts do where their status may change: impacts, and the one status whose forces go with it."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ....errors import AnalysisError
from ....typing import Array
from .held import ROUNDING, spans
from .statuses import BACKWARD, FORWARD, GAP, STICK, Driven, Pairs, Status, sense

CLOSE = 1e-9  # of the forces at hand: how far off a condition rounding may be
MOST = 4**6  # combinations that are tried


@dataclass(frozen=True)
class Impact:
    """Velocity (k,) behind an impact, which way each contact of it then slips (0: it sticks), what it took from the
    motion [J] along normals and tangents; carried: what its impulses did on what supports move [J].

    held and pushed (r, k): along the rows ``held`` nothing moves behind it, by impulses along the rows ``pushed``; so a
    velocity that differs by δ before it differs by δ − pushedᵀ (held pushedᵀ)⁻¹ held δ behind.
    """

    velocity: Array
    slips: Mapping[int, float]
    normal_work: float
    friction_work: float
    carried: float
    held: Array
    pushed: Array


def impact(pairs: Pairs, velocity: Array, speeds: tuple[Array, Array], met: Sequence[int], was: Status) -> Impact:
    """The velocities right behind an impact of contacts ``met``: inelastic, with Coulomb's law between the impulses.

    Velocity (k,) before it; speeds (m,), (m,): those along normals and tangents that supports add. Normal impulses
    P ≥ 0 leave no approach, and none where the contact parts; |T| ≤ μP where it sticks afterwards, T = −μP sign(slip)
    where it slips (what the explicit scheme does as its step goes to zero). Raises AnalysisError where there is no such
    impulse, which friction too strong for the pair can bring about.
    """
    normal = {c: float(pairs.normal[c] @ velocity + speeds[0][c]) for c in met}
    slip = {c: float(pairs.tangent[c] @ velocity + speeds[1][c]) for c in met}
    options: list[list[int]] = []
    for c in met:
        ahead = [FORWARD, BACKWARD] if slip[c] > 0.0 else [BACKWARD, FORWARD]
        stuck = [STICK] if pairs.sticking[c] > 0.0 else []
        options.append([*stuck, *ahead, GAP])
    size = max([abs(n) for n in normal.values()] + [abs(s) for s in slip.values()] + [1e-300])
    for combination in itertools.islice(itertools.product(*options), MOST):
        found = _impulses(pairs, combination, met, normal, slip, was, size)
        if found is None:
            continue
        pushed, along = found
        after = velocity + sum(
            (pushed[i] * pairs.normal[c] + along[i] * pairs.tangent[c] for i, c in enumerate(met)),
            np.zeros_like(velocity),
        )
        lost_normal = lost_friction = carried = 0.0
        for i, c in enumerate(met):
            behind = float(pairs.normal[c] @ after + speeds[0][c]), float(pairs.tangent[c] @ after + speeds[1][c])
            lost_normal -= 0.5 * pushed[i] * (normal[c] + behind[0])
            lost_friction -= 0.5 * along[i] * (slip[c] + behind[1])
            carried += pushed[i] * speeds[0][c] + along[i] * speeds[1][c]
        slips = {c: sense(now) for c, now in zip(met, combination, strict=True) if now != GAP}
        held, pushing, _ = _rows(pairs, combination, met)
        return Impact(after, slips, lost_normal, lost_friction, carried, held, pushing)
    raise AnalysisError("friction jams the contacts in an impact: no impulses bring them to rest against one another")


def landing(
    pairs: Pairs, velocity: Array, speeds: tuple[Array, Array], rest: Sequence[int], stuck: Sequence[int]
) -> Impact:
    """Contacts ``rest`` brought to rest along their normals at once, those of ``stuck`` along their tangents too: where
    impacts that throw one another off accumulate, this is what they end in.

    Velocity (k,) before it; speeds as in `impact`. The least change of velocity, in kinetic energy, that does so.
    """
    rows = np.vstack([pairs.normal[list(rest)], pairs.tangent[list(stuck)]])
    added = np.concatenate([speeds[0][list(rest)], speeds[1][list(stuck)]])
    before = rows @ velocity + added
    impulses = -np.linalg.lstsq(rows @ rows.T, before, rcond=1e-12)[0]
    after = velocity + rows.T @ impulses
    taken = -0.5 * impulses * (before + rows @ after + added)
    slips = {c: 0.0 if c in stuck else float(pairs.tangent[c] @ after + speeds[1][c]) for c in rest}
    count = len(rest)
    return Impact(
        after, slips, float(taken[:count].sum()), float(taken[count:].sum()), float(impulses @ added),
        rows, rows,
    )  # fmt: skip


def _rows(pairs: Pairs, combination: Sequence[int], met: Sequence[int]) -> tuple[Array, Array, list[int]]:
    """What one combination holds, and along which rows it pushes: (r, k) each; which contacts of it stick without an
    impulse, as normals hold their slip."""
    none = np.zeros((0, pairs.normal.shape[1]))
    rows, directions = [none], [none]
    normals = pairs.normal[[c for c, now in zip(met, combination, strict=True) if now != GAP]]
    fast: list[int] = []
    for c, now in zip(met, combination, strict=True):
        if now == GAP:
            continue
        rows.append(pairs.normal[c][None])
        directions.append((pairs.normal[c] - sense(now) * pairs.sliding[c] * pairs.tangent[c])[None])
        if now == STICK and pairs.holdable[c] and spans(normals, pairs.tangent[c]):
            fast.append(c)
        elif now == STICK:
            rows.append(pairs.tangent[c][None])
            directions.append(pairs.tangent[c][None])
    return np.vstack(rows), np.vstack(directions), fast


def _impulses(
    pairs: Pairs,
    combination: Sequence[int],
    met: Sequence[int],
    normal: Mapping[int, float],
    slip: Mapping[int, float],
    was: Status,
    size: float,
) -> tuple[Array, Array] | None:
    """Impulses (c,), (c,) along normals and tangents of one combination, None where they break its conditions."""
    rows, directions, fast = _rows(pairs, combination, met)
    wanted: list[float] = []
    for c, now in zip(met, combination, strict=True):
        if now != GAP:
            wanted.append(-normal[c])
        if now == STICK and c not in fast:
            wanted.append(-slip[c])
    try:
        solved = np.linalg.solve(rows @ directions.T, np.array(wanted))
    except np.linalg.LinAlgError:
        return None
    change = directions.T @ solved
    pushed, along = np.zeros(len(met)), np.zeros(len(met))
    at = 0
    for i, (c, now) in enumerate(zip(met, combination, strict=True)):
        behind = normal[c] + float(pairs.normal[c] @ change), slip[c] + float(pairs.tangent[c] @ change)
        if now == GAP:
            if behind[0] < -CLOSE * size:
                return None
            continue
        pushed[i] = solved[at]
        weight = float(pairs.normal[c] @ pairs.normal[c])
        if pushed[i] * weight < -CLOSE * size:
            return None
        if c in fast:
            at += 1
            if abs(behind[1]) > CLOSE * size:
                return None
            continue
        if now == STICK:
            along[i] = solved[at + 1]
            at += 2
            limit = pairs.sticking[c] if was[c] == STICK else pairs.sliding[c]
            if abs(along[i]) > limit * pushed[i] + CLOSE * size / weight:
                return None
            continue
        at += 1
        along[i] = -sense(now) * pairs.sliding[c] * pushed[i]
        if sense(now) * behind[1] < -CLOSE * size:
            return None
    return pushed, along


@dataclass(frozen=True)
class EventState:
    """Displacement q, velocity v (k,) and p (P,) at a time, and what the terms of q and v amount to."""

    time: float
    q: Array
    v: Array
    p: Array
    q_size: Array
    v_size: Array


@dataclass(frozen=True)
class Touching:
    """A contact whose gap is closed without approach: the sign of its slip, 0 where it has none; what it may do."""

    slip: float
    options: tuple[int, ...]


def choices(pairs: Pairs, c: int, slip: float, now: int) -> Touching:
    """All that a touching contact may do, what it does now first."""
    if slip != 0.0:
        options = [FORWARD if slip > 0.0 else BACKWARD, GAP]
    else:
        stuck = [STICK] if pairs.sticking[c] > 0.0 else []
        options = [*stuck, FORWARD, BACKWARD, GAP]
    if now in options:
        options.remove(now)
        options.insert(0, now)
    return Touching(slip, tuple(options))


def consistent_status(
    count: int,
    touching: Mapping[int, Touching],
    driven: Callable[[Status], Driven],
    state: EventState,
) -> Status:
    """The status of ``count`` contacts whose forces and accelerations go with it, of those that touch; all others are
    open. Raises AnalysisError where there is none: friction jams."""
    named = list(touching)
    for combination in itertools.islice(itertools.product(*(touching[c].options for c in named)), MOST):
        status = [GAP] * count
        for c, now in zip(named, combination, strict=True):
            status[c] = now
        found = tuple(status)
        try:
            algebra = driven(found)
        except AnalysisError:
            continue
        if _consistent(algebra, touching, state):
            return found
    raise AnalysisError(
        "friction jams the contacts: no status of them goes with the forces that it makes, which the exact stepper "
        'does not pass; take stepper = "explicit"'
    )


def _consistent(driven: Driven, touching: Mapping[int, Touching], state: EventState) -> bool:
    status, pairs, now_at = driven.regime.status, driven.regime.pairs, (state.q, state.v, state.p)
    forces = [(n.at(*now_at), t.at(*now_at)) for n, t in driven.forces]
    rounding = max(
        (row.size(state.q_size, state.v_size, state.p) for both in driven.forces for row in both), default=0.0
    )
    size = max([abs(f) for both in forces for f in both] + [ROUNDING * rounding / CLOSE, 1e-300])
    for c, touch in touching.items():
        now, (normal, tangential) = status[c], forces[c]
        weight = max(float(pairs.normal[c] @ pairs.normal[c]), float(pairs.tangent[c] @ pairs.tangent[c]))
        if now == GAP and pairs.compliance[c] > 0.0:
            # Only a spring that is not pressed lets go.
            gap = driven.gap(c)
            pressed = -gap.at(*now_at) / pairs.compliance[c]
            noise = ROUNDING * gap.size(state.q_size, state.v_size, state.p) / pairs.compliance[c]
            if pressed > CLOSE * size + noise or driven.opening(c).at(*now_at) < 0.0:
                return False
            continue
        if now == GAP:
            opening = driven.opening(c)
            if driven.rate_of(opening).at(*now_at) < -CLOSE * size * weight:
                return False
            continue
        if normal < -CLOSE * size:
            return False
        if driven.ways[c, 0]:
            # Slip that is held goes as what holds it: at rest friction is what it was.
            way = driven.way(c, state.time)
            if way != 0.0 if now == STICK else sense(now) * way < 0.0:
                return False
        elif now == STICK:
            # A slip that comes to its end stays there up to the stick limit, as the law has it.
            if abs(tangential) > pairs.sticking[c] * normal + CLOSE * size:
                return False
        elif touch.slip == 0.0 and sense(now) * driven.rate_of(driven.slip(c)).at(*now_at) < -CLOSE * size * weight:
            return False
    return True

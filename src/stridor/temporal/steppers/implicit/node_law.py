"""Impulses of one step over all contact nodes: projected block Gauss–Seidel on the Delassus operator, compiled.

A node is solved exactly with the latest impulses of the others by the solvers of the explicit steps, which take
velocities for increments and impulses for forces. Rigid contact sees (g⁺ + h U⁺/2)/h, the gap half a step behind the
end of the step: 0 where P > 0, so that a gap that closes is at rest two steps later, whatever it was. Contact with a
stiffness k sees 2 g⁺/h, and its impulse is h times

    F = (V(g) − V(g⁺)) / (g⁺ − g),      V(g) = k min(g, 0)²/2,

the force whose work is what the spring loses, so that springs that open and close neither take energy nor give any.
Slip that goes on points along its mean over the step, so that the damping that turning friction gives is of second
order; that it ends is decided by the velocity behind the step.
"""

from __future__ import annotations

import math

from ....contact import multipliers
from ....kernels import njit
from ....laws import packed
from ....typing import Array
from ..sparse.disc import solve_disc
from .arrays import Nodes, StepState, Work

_OPEN, _STICK, _SLIP = multipliers.OPEN, multipliers.STICK, multipliers.SLIP
_KIND, _CONSTANT = packed.KIND, packed.CONSTANT
_solve_contact = njit(cache=True, allocates=False)(multipliers.solve_contact)

GOES_ON = 0.5  # of its speed that a slip must keep to be taken as one that goes on without further ado
FIRST = 4  # sweeps before those that their impulses close join in
SWEEP_LIMIT = 500
SPARE = 1.5  # times the nodes that are swept: the places there may be for them
NEWTON_STEPS = 60  # on the force of a spring that opens or closes
SWEEP_TOLERANCE = 1e-11


@njit(cache=True, allocates=False)
def spring_force(stiffness: float, before: float, after: float) -> tuple[float, float]:  # pragma: no cover - compiled
    """F [N] of a spring whose gap goes from ``before`` to ``after`` [m], and −dF/d after ≥ 0 [N/m]."""
    if before <= 0.0:
        if after <= 0.0:
            return -0.5 * stiffness * (before + after), 0.5 * stiffness
        way = after - before
        force = 0.5 * stiffness * before * before / way if way > 0.0 else 0.0
        return force, force / way if way > 0.0 else 0.0
    if after >= 0.0:
        return 0.0, 0.0
    way = before - after
    return 0.5 * stiffness * after * after / way, 0.5 * stiffness * after * (after - 2.0 * before) / (way * way)


@njit(cache=True, allocates=False)
def _solve_spring(
    i: int, step: float, tangent: Array, slip_step: float, nodes: Nodes, stuck: bool, start: float, free: Array,
    new: Array, met: Array,
) -> int:  # pragma: no cover - compiled
    """As `_solve`, of a node with a stiffness. Newton's method on F, which is convex: from no impulse on, tangents
    close in from below. met (d,): work space."""
    d, at, w = len(new), i * len(new), nodes.delassus
    for j in range(d):
        met[j] = free[j]
    if nodes.kept[i]:
        met[0] += 2.0 * start / step
        sign = -1.0 if met[0] > 0.0 else 1.0
        return _solve(i, sign, tangent, slip_step, 4.0 / (step * step * nodes.stiffness[i]), nodes, stuck, met, new)
    after, before, status = 0.5 * step * free[0], 0.0, _OPEN
    for j in range(d):
        new[j] = 0.0
    for _ in range(NEWTON_STEPS):
        force, tangential = spring_force(nodes.stiffness[i], start, after)
        if tangential == 0.0:
            break
        met[0] = free[0] - 2.0 * (after + force / tangential) / step
        status = _solve(i, 1.0, tangent, slip_step, 2.0 / (step * step * tangential), nodes, stuck, met, new)
        if abs(new[0] - before) <= 1e-14 * new[0]:
            break
        before, seen, line = new[0], free[0], start <= 0.0 and after <= 0.0
        for k in range(d):
            seen += w[at, at + k] * new[k]
        after = 0.5 * step * seen
        if line and after <= 0.0:  # F was a straight line
            break
    return status


@njit(cache=True, allocates=False)
def _solve(
    i: int, sign: float, tangent: Array, step: float, layer: float, nodes: Nodes, stuck: bool, free: Array, new: Array
) -> int:  # pragma: no cover - compiled
    """Impulses of node i into new from free (d,), with tangent (d − 1,) added to its slip; its status. step: by what
    its slip is divided to be a speed; layer [1/kg]: what the normal impulse adds to free beside the node's own part of
    the Delassus operator."""
    d = len(new)
    at, w, law = i * d, nodes.delassus, nodes.friction[nodes.owner[i]]
    w_nn = w[at, at] + layer
    if d == 2:
        new[0], new[1], status = _solve_contact(
            sign * free[0], free[1] + tangent[0], w_nn, sign * w[at, at + 1], w[at + 1, at + 1], law, stuck, step
        )
    else:
        block = (
            w_nn, sign * w[at, at + 1], sign * w[at, at + 2], w[at + 1, at + 1], w[at + 1, at + 2], w[at + 2, at + 2]
        )
        new[0], new[1], new[2], status = solve_disc(
            sign * free[0], free[1] + tangent[0], free[2] + tangent[1], block, law, stuck, step
        )
    if nodes.kept[i] and status == _OPEN:
        new[0], status = (-sign * free[0] / w_nn if w_nn > 0.0 else 0.0), _SLIP
    new[0] *= sign
    return status


@njit(cache=True, allocates=False)
def _relax(i: int, h: float, nodes: Nodes, state: StepState, work: Work) -> int:  # pragma: no cover - compiled
    """Impulses of node i with those of all others as they are into work.local[0]; its status."""
    d = work.local.shape[1]
    at, w = i * d, nodes.delassus
    new, free, none, mean = work.local[0], work.local[1], work.local[2], work.local[3]
    for j in range(d):
        free[j] = work.total[at + j]
        for k in range(d):
            free[j] -= w[at + j, at + k] * work.impulse[at + k]
    for j in range(d - 1):
        none[j], mean[j] = 0.0, work.slip[at + j + 1]
    law, stuck = nodes.friction[nodes.owner[i]], state.status[i] == _STICK
    turns = state.status[i] == _SLIP and (d == 3 or law[_KIND] != _CONSTANT)
    # Slip that goes on: along its mean over the step.
    goes_on = turns and _by_kind(i, h, mean, 2.0, nodes, False, work, free, new) == _SLIP
    if goes_on and _ahead(at, w, work, new) > GOES_ON:
        return _SLIP
    status = _by_kind(i, h, none, 1.0, nodes, stuck, work, free, new)
    if turns and status == _SLIP and _ahead(at, w, work, new) > 0.0:
        first, second, third = new[0], new[1], new[d - 1]
        if _by_kind(i, h, mean, 2.0, nodes, False, work, free, new) != _SLIP:
            new[0], new[1], new[d - 1] = first, second, third
    return status


@njit(cache=True, allocates=False)
def _by_kind(
    i: int, h: float, tangent: Array, slip_step: float, nodes: Nodes, stuck: bool, work: Work, free: Array, new: Array
) -> int:  # pragma: no cover - compiled
    """`_solve` or `_solve_spring`."""
    if nodes.stiffness[i] > 0.0:
        start, met = work.start[i], work.local[4]
        return _solve_spring(i, h, tangent, slip_step, nodes, stuck, start, free, new, met)
    sign = -1.0 if nodes.kept[i] and free[0] > 0.0 else 1.0
    return _solve(i, sign, tangent, slip_step, 0.0, nodes, stuck, free, new)


@njit(cache=True, allocates=False)
def _ahead(at: int, w: Array, work: Work, new: Array) -> float:  # pragma: no cover - compiled
    """Slip velocity behind the step along that before it, over the square of that."""
    d, free = len(new), work.local[1]
    ahead = before = 0.0
    for j in range(1, d):
        behind = free[j]
        for k in range(d):
            behind += w[at + j, at + k] * new[k]
        ahead += behind * work.slip[at + j]
        before += work.slip[at + j] ** 2
    return ahead / before if before > 0.0 else 0.0


@njit(cache=True, allocates=False, fastmath={"reassoc", "contract", "nsz", "arcp"})
def _add(total: Array, row: Array, factor: float) -> None:  # pragma: no cover - compiled
    for k in range(len(total)):
        total[k] += factor * row[k]


@njit(cache=True, allocates=False)
def total_of(nodes: Nodes, work: Work) -> None:  # pragma: no cover - compiled
    """work.total from work.free and the impulses."""
    for k in range(len(work.free)):
        work.total[k] = work.free[k]
    for k in range(len(work.free)):
        if work.impulse[k] != 0.0:
            _add(work.total, nodes.delassus[k], work.impulse[k])


@njit(cache=True, allocates=False)
def _stays_open(i: int, d: int, nodes: Nodes, work: Work) -> bool:  # pragma: no cover - compiled
    """Whether a node without an impulse needs none."""
    if work.impulse[i * d] != 0.0 or nodes.kept[i] or work.total[i * d] < 0.0:
        return False
    return nodes.stiffness[i] == 0.0 or work.start[i] >= 0.0


@njit(cache=True, allocates=False)
def _pack(count: int, d: int, nodes: Nodes, work: Work) -> int:  # pragma: no cover - compiled
    """See to it that the chosen nodes have places in work.packed, where the Delassus operator of those that have one
    stands together; places taken. They stay from step to step, until too many nodes have one that are not chosen."""
    used = work.used[0]
    if used > SPARE * count + d:
        work.place_of[:] = -1
        used = 0
    for a in range(count):
        i = work.chosen[a]
        if work.place_of[i] >= 0:
            continue
        work.place_of[i], work.holder[used] = used, i
        used += 1
        for b in range(used):
            other = work.holder[b]
            for j in range(d):
                for k in range(d):
                    work.packed[(used - 1) * d + j, b * d + k] = nodes.delassus[i * d + j, other * d + k]
                    work.packed[b * d + k, (used - 1) * d + j] = nodes.delassus[other * d + k, i * d + j]
    work.used[0] = used
    return used


@njit(cache=True, allocates=False)
def _sweeps(
    count: int, limit: int, h: float, nodes: Nodes, state: StepState, work: Work
) -> tuple[bool, int]:  # pragma: no cover - compiled
    """Up to so many sweeps over the chosen nodes: whether they settled, and how many were done."""
    d, new = work.local.shape[1], work.local[0]
    wide = _pack(count, d, nodes, work) * d
    near = work.near[:wide]
    for a in range(count):
        i = work.chosen[a]
        for j in range(d):
            near[work.place_of[i] * d + j] = work.total[i * d + j]
    sweep, settled = 0, False
    while sweep < limit and not settled:
        sweep += 1
        worst = largest = 0.0
        for a in range(count):
            i = work.chosen[a]
            at, place = i * d, work.place_of[i] * d
            for j in range(d):
                work.total[at + j] = near[place + j]
            if _stays_open(i, d, nodes, work):
                work.status[i] = _OPEN
                continue
            work.status[i] = _relax(i, h, nodes, state, work)
            size = 0.0
            for j in range(d):
                change = new[j] - work.impulse[at + j]
                if change != 0.0:
                    size += abs(change)
                    work.impulse[at + j] = new[j]
                    _add(near, work.packed[place + j, :wide], change)
            worst = max(worst, size)
            largest = max(largest, abs(new[0]))
        settled = worst <= SWEEP_TOLERANCE * largest or count == 1 or math.isnan(worst)
    for a in range(count):
        i = work.chosen[a]
        for j in range(d):
            work.total[i * d + j] = near[work.place_of[i] * d + j]
    return settled, sweep


@njit(cache=True, allocates=False)
def solve_nodes(limit: int, h: float, nodes: Nodes, state: StepState, work: Work) -> int:  # pragma: no cover - compiled
    """Impulses into work.impulse, from those that are there; sweeps done, limit + 1 where they did not settle.

    Nodes that touch or would are swept alone; those that their impulses close join in.
    """
    d, m = work.local.shape[1], len(nodes.gap)
    count, done, settled = 0, 0, True
    total_of(nodes, work)
    for i in range(m):
        work.marked[i], work.status[i] = 0, _OPEN
    while True:
        before = count
        for i in range(m):
            if work.marked[i] == 0 and not _stays_open(i, d, nodes, work):
                work.chosen[count], work.marked[i] = i, 1
                count += 1
        if count == before and settled:
            return max(done, 1)
        # First a few sweeps, in which most of those that join in show.
        few = FIRST if done == 0 and count < m else limit - done
        settled, swept = _sweeps(count, few, h, nodes, state, work)
        done += swept
        if done >= limit and not settled:
            total_of(nodes, work)
            return limit + 1
        if count == m:
            return done
        total_of(nodes, work)

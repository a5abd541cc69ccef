"""Loads, moving supports and cubic springs in the compiled loop: their forces and their works."""

from __future__ import annotations

from typing import NamedTuple

from ....kernels import njit
from ....typing import Array, IntArray
from ...columns import DAMPING, EXTERNAL, SUPPORT
from .products import Fields, Structure

CUBIC = 5  # works[CUBIC]: done on cubic springs
LOOP_WORKS = 6
CIRCULATORY, GYROSCOPIC = 6, 7  # works put in by the skew parts of imported matrices, where there are any
SKEW_WORKS = 8
STEPS_DONE, MOST_SWEEPS, UNCONVERGED, KEPT, NODES_KEPT = range(5)
COUNTERS = 5


class Forcing(NamedTuple):
    """Factors of loads (k, l) and increments of supports (k, p) by step; loads as csr rows on entries with their lift
    (l, p); mass and damping couplings (p, k) of the supports with the entries near (k,), and their own matrices (p, p);
    cubic springs as csr rows with lift (s, p) and coefficient (s,)."""

    loads: Array
    increments: Array
    load_ptr: IntArray
    load_col: IntArray
    load_val: Array
    load_lift: Array
    near: IntArray
    mass: Array
    damping: Array
    mass_own: Array
    damping_own: Array
    stiffness_own: Array
    cubic_ptr: IntArray
    cubic_col: IntArray
    cubic_val: Array
    cubic_lift: Array
    cubic: Array


class LoopState(NamedTuple):
    """What moves on beside the fields: works (6,) [J] or (8,), statistics (c, 8), counters (5,), motion (2, p)
    displacement and q of the supports, coefficients (l + 2p,) that made push, base (size,) push without cubic springs,
    reference (2,): elastic energy at the start, decay of gap offsets per step."""

    works: Array
    statistics: Array
    counters: IntArray
    motion: Array
    coefficients: Array
    base: Array
    reference: Array


class StepWork(NamedTuple):
    """Work space of a step. Supports (p,): after, q at t_{n+1}; displacement, theirs then; velocity at t_n; sent,
    what contacts, loads and springs send to them; coupling (2, p): inertia and damping rows on q_n. Cubic springs
    (s,): spring, their force, and spring_rate on q_n; load_rate (l,) on q_n. sums (c, 6) of contacts, status (m,) of
    nodes, watched (r, 2) rows on u_n and q_n, power (16,) of the parts of the structure."""

    after: Array
    displacement: Array
    velocity: Array
    sent: Array
    coupling: Array
    spring: Array
    spring_rate: Array
    load_rate: Array
    sums: Array
    status: IntArray
    watched: Array
    power: Array


@njit(cache=True, allocates=False)
def dot(ptr: IntArray, col: IntArray, val: Array, r: int, x: Array) -> float:  # pragma: no cover - compiled
    """One csr row times x."""
    total = 0.0
    for p in range(ptr[r], ptr[r + 1]):
        total += val[p] * x[col[p]]
    return total


@njit(cache=True, allocates=False)
def _set_push(k: int, step: float, beta2: float, g: Forcing, state: LoopState, after: Array, push: Array) -> None:
    # pragma: no cover - compiled
    """Loads and supports of step k into push, if they changed; after (p,) takes q of the supports at t_{n+1}."""
    loads, motions = g.loads.shape[1], g.increments.shape[1]
    s = 1.0 + 2.0 * beta2
    changed = False
    kept = state.coefficients
    for j in range(loads):
        changed |= kept[j] != g.loads[k, j]
        kept[j] = g.loads[k, j]
    for p in range(motions):
        before, rate = state.motion[1, p], g.increments[k, p] / step
        # A constant velocity makes no acceleration out of rounding.
        if abs(rate - before) <= 1e-13 * abs(before):
            rate = before
        after[p] = ((2.0 * beta2 - 1.0) * before + 2.0 * rate) / s
        if rate == before:
            after[p] = before
        pull = -(after[p] - before) / step
        drag = -((1.0 - beta2) * before + beta2 * after[p])
        changed |= kept[loads + p] != pull or kept[loads + motions + p] != drag
        kept[loads + p], kept[loads + motions + p] = pull, drag
    if not changed:
        return
    # Loops, as whole-array expressions take seconds to compile.
    base = state.base
    for i in range(base.shape[0]):
        base[i] = 0.0
    for e in range(g.near.shape[0]):
        for p in range(motions):
            base[g.near[e]] += kept[loads + p] * g.mass[p, e] + kept[loads + motions + p] * g.damping[p, e]
    for j in range(loads):
        if kept[j] != 0.0:
            for e in range(g.load_ptr[j], g.load_ptr[j + 1]):
                base[g.load_col[e]] += kept[j] * g.load_val[e]
    for i in range(base.shape[0]):
        push[i] = base[i]


@njit(cache=True, allocates=False)
def _cubic_forces(g: Forcing, f: Fields, state: LoopState, force: Array) -> None:  # pragma: no cover - compiled
    """Forces of the cubic springs at t_n, against push; force (s,) keeps them for their work."""
    for e in range(g.cubic_col.shape[0]):
        f.push[g.cubic_col[e]] = state.base[g.cubic_col[e]]
    for s in range(g.cubic.shape[0]):
        length = dot(g.cubic_ptr, g.cubic_col, g.cubic_val, s, f.u)
        for p in range(state.motion.shape[1]):
            length += g.cubic_lift[s, p] * state.motion[0, p]
        force[s] = g.cubic[s] * length**3
        for e in range(g.cubic_ptr[s], g.cubic_ptr[s + 1]):
            f.push[g.cubic_col[e]] -= g.cubic_val[e] * force[s]


@njit(cache=True, allocates=False)
def begin_step(k: int, a: Structure, f: Fields, g: Forcing, state: LoopState, w: StepWork) -> None:
    # pragma: no cover - compiled
    """Forces of step k into push, and every row on q_n that the works of the step need."""
    step, beta2 = a.numbers[0], a.numbers[1]
    _set_push(k, step, beta2, g, state, w.after, f.push)
    if g.cubic.shape[0]:
        _cubic_forces(g, f, state, w.spring)
        for s in range(g.cubic.shape[0]):
            w.spring_rate[s] = dot(g.cubic_ptr, g.cubic_col, g.cubic_val, s, f.q)
    for j in range(g.loads.shape[1]):
        w.load_rate[j] = 0.0
        if g.loads[k, j] != 0.0:
            w.load_rate[j] = dot(g.load_ptr, g.load_col, g.load_val, j, f.q)
    for p in range(w.after.shape[0]):
        w.velocity[p] = (1.0 - beta2) * state.motion[1, p] + beta2 * w.after[p]
        w.displacement[p] = state.motion[0, p] + g.increments[k, p]
        w.sent[p] = w.coupling[0, p] = w.coupling[1, p] = 0.0
        if w.velocity[p] != 0.0 or w.after[p] != 0.0:
            for e in range(g.near.shape[0]):
                w.coupling[0, p] += g.mass[p, e] * f.q[g.near[e]]
                w.coupling[1, p] += g.damping[p, e] * f.q[g.near[e]]


@njit(cache=True, allocates=False)
def works_of_step(k: int, a: Structure, f: Fields, g: Forcing, state: LoopState, w: StepWork) -> None:
    # pragma: no cover - compiled
    """Works of loads, cubic springs and supports over the step, with velocities at t_n."""
    step, beta2 = a.numbers[0], a.numbers[1]
    motions = w.after.shape[0]
    for j in range(g.loads.shape[1]):
        if g.loads[k, j] != 0.0:
            rate = dot(g.load_ptr, g.load_col, g.load_val, j, f.q)
            rate = (1.0 - beta2) * w.load_rate[j] + beta2 * rate
            for p in range(motions):
                rate += g.load_lift[j, p] * w.velocity[p]
                w.sent[p] += g.load_lift[j, p] * g.loads[k, j]
            state.works[EXTERNAL] += g.loads[k, j] * rate * step
    for s in range(g.cubic.shape[0]):
        rate = dot(g.cubic_ptr, g.cubic_col, g.cubic_val, s, f.q)
        rate = (1.0 - beta2) * w.spring_rate[s] + beta2 * rate
        for p in range(motions):
            rate += g.cubic_lift[s, p] * w.velocity[p]
            w.sent[p] -= g.cubic_lift[s, p] * w.spring[s]
        state.works[CUBIC] += w.spring[s] * rate * step
    _support_works(a, g, state, w.after, w.coupling, f, w.sent)


@njit(cache=True, allocates=False)
def _support_works(
    a: Structure, g: Forcing, state: LoopState, after: Array, before: Array, f: Fields, contact: Array
) -> None:  # pragma: no cover - compiled
    """Works of supports that move: reaction times velocity, and their part in damping. before (2, p): couplings on q
    at t_n; contact (p,): what contact forces and loads send to the support."""
    step, beta2 = a.numbers[0], a.numbers[1]
    rate = state.motion[1]
    for p in range(after.shape[0]):
        velocity = (1.0 - beta2) * rate[p] + beta2 * after[p]
        if velocity == 0.0 and after[p] == 0.0:
            continue
        inertia = drag = 0.0
        for e in range(g.near.shape[0]):
            inertia += g.mass[p, e] * f.q[g.near[e]]
            drag += g.damping[p, e] * f.q[g.near[e]]
        drag = (1.0 - beta2) * before[1, p] + beta2 * drag
        reaction = (inertia - before[0, p]) / step + drag - contact[p]
        damped = 2.0 * drag
        for o in range(after.shape[0]):
            other = (1.0 - beta2) * rate[o] + beta2 * after[o]
            reaction += g.mass_own[p, o] * (after[o] - rate[o]) / step + g.damping_own[p, o] * other
            reaction += g.stiffness_own[p, o] * state.motion[0, o]
            damped += g.damping_own[p, o] * other
        state.works[SUPPORT] += reaction * velocity * step
        state.works[DAMPING] += damped * velocity * step

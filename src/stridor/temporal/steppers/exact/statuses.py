"""The motion of a system while the status of its contacts does not change: a sum of the complex modes of that status.

With q of unit mass, contacts that are closed hold R q = r(p): a rigid one its gap at zero, one that sticks its tangent
at rest on the other side; their forces act along D, the normal less or plus μ times the tangent where they slip. With
q = Z y + R⁺ r, R Z = 0 and W of D W = 0, WᵀZ = 1 (docs/theory-exact.md, eqs 3 to 6),

    ÿ + WᵀCZ ẏ + WᵀKZ y = Wᵀ(F p − R⁺r̈ − C R⁺ṙ − K R⁺r),      λ = (R Dᵀ)⁻¹(r̈ − R(F p − C q̇ − K q)).

p holds the powers of time that loads and supports follow, and where each contact began to stick.

Slip may be held by what others hold: t = ΣₖR_k c_k leaves it no motion of its own, and it is the polynomial
(t R⁺ṙ + d)(p) of the supports. It then turns where that does. While that is at rest friction is not determined: it
keeps what it had as slip ended, and where there was no slip before, and normals alone hold it, there is none.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg as sl

from ....errors import AnalysisError
from ....typing import Array, ComplexArray
from ..basis import Basis
from .drive import Piece
from .held import HELD, NEAR, spans, turns

GAP, STICK, FORWARD, BACKWARD = range(4)  # a slave that slips moves along the tangent, or against it
Status = tuple[int, ...]
SLOW = 1e-7  # of the fastest mode: what is slower is one small system, moved on by its Taylor series
RAMP = 3.0  # rad over a ramp: likewise
TAYLOR = 24  # terms of that series
JAMMED = 1e-9
DEFECTIVE = 1e4  # condition of a mode by whose square rounding grows: balances then still close to 1e-8


@dataclass(frozen=True)
class Pairs:
    """The contacts in coordinates: rows (m, k) of normal and tangent with their lifts (m, p), gap (m,) [m], compliance
    (m,) [m/N], sliding and sticking (m,) friction coefficients; rows (l, k) of loads with their lift (l, p), couplings
    inertia and drag (p, k) of supports with their own matrices (p, p)."""

    normal: Array
    tangent: Array
    normal_lift: Array
    tangent_lift: Array
    gap: Array
    compliance: Array
    sliding: Array
    sticking: Array
    loads: Array
    loads_lift: Array
    inertia: Array
    drag: Array
    mass_own: Array
    damping_own: Array
    stiffness_own: Array

    @property
    def count(self) -> int:
        """How many contacts."""
        return len(self.gap)

    @cached_property
    def holdable(self) -> tuple[bool, ...]:
        """Of each contact whether all others, and its own normal, could hold its slip."""
        rigid, found = self.compliance == 0.0, []
        for c in range(self.count):
            others = np.vstack([self.normal[rigid], np.delete(self.tangent, c, axis=0)])
            rest = self.tangent[c] - others.T @ np.linalg.lstsq(others.T, self.tangent[c], rcond=None)[0]
            found.append(bool(np.linalg.norm(rest) <= HELD * np.linalg.norm(self.tangent[c])))
        return tuple(found)


def sense(status: int) -> float:
    """The sign of the slip of a status, 0 where none slips."""
    return {FORWARD: 1.0, BACKWARD: -1.0}.get(status, 0.0)


@dataclass(frozen=True)
class Row:
    """A number that is linear in the state: displacement q (k,), velocity (k,) and p (P,)."""

    q: Array
    v: Array
    p: Array

    def at(self, q: Array, v: Array, p: Array) -> float:
        """Its value."""
        return float(self.q @ q + self.v @ v + self.p @ p)

    def times(self, factor: float) -> Row:
        """A multiple of it."""
        return Row(factor * self.q, factor * self.v, factor * self.p)

    def plus(self, other: Row) -> Row:
        """The sum of both."""
        return Row(self.q + other.q, self.v + other.v, self.p + other.p)

    def size(self, q: Array, v: Array, p: Array) -> float:
        """The sum of what its terms amount to, by which rounding is judged."""
        return float(np.abs(self.q) @ np.abs(q) + np.abs(self.v) @ np.abs(v) + np.abs(self.p) @ np.abs(p))


class Regime:
    """Modes of one status, whatever drives the system."""

    def __init__(self, basis: Basis, pairs: Pairs, status: Status) -> None:
        self.basis, self.pairs, self.status = basis, pairs, status
        k = basis.size
        rows, directions = [np.zeros((0, k))], [np.zeros((0, k))]
        self.held: list[tuple[int, str]] = []  # what each constraint holds: contact, "normal" or "tangent"
        self.spring = np.zeros((k, k))
        self.pushes: list[tuple[int, Array]] = []  # contacts with springs, and the direction of their force
        closed = [c for c, now in enumerate(status) if now != GAP]
        normals = pairs.normal[[c for c in closed if pairs.compliance[c] == 0.0]]
        self.fast = [c for c in closed if pairs.holdable[c] and spans(normals, pairs.tangent[c])]
        for c, now in enumerate(status):
            if now == GAP:
                continue
            along = pairs.normal[c] - sense(now) * pairs.sliding[c] * pairs.tangent[c]
            if pairs.compliance[c] > 0.0:
                self.spring += np.outer(along, pairs.normal[c]) / pairs.compliance[c]
                self.pushes.append((c, along))
            else:
                rows.append(pairs.normal[c][None])
                directions.append(along[None])
                self.held.append((c, "normal"))
            if now == STICK and c not in self.fast:
                rows.append(pairs.tangent[c][None])
                directions.append(pairs.tangent[c][None])
                self.held.append((c, "tangent"))
        self.rows, self.directions = np.vstack(rows), np.vstack(directions)
        self.stiffness = np.diag(basis.stiffness) + self.spring
        self.cross = self._inverse(self.rows @ self.directions.T)
        self.back = self.rows.T @ self._inverse(self.rows @ self.rows.T)

    def _inverse(self, matrix: Array) -> Array:
        """Raises AnalysisError where friction jams: no forces keep the contacts closed."""
        if len(matrix) == 0:
            return np.zeros((0, 0))
        sizes = np.sqrt(np.abs(np.diag(self.rows @ self.rows.T)))
        scaled = matrix / np.outer(sizes, sizes)
        if np.linalg.cond(scaled) > 1 / JAMMED:
            raise AnalysisError("contacts that close together cannot be told apart, or friction jams them")
        return np.linalg.inv(scaled) / np.outer(sizes, sizes)

    @cached_property
    def follows(self) -> tuple[bool, ...]:
        """Of each contact whether its slip is held by what others hold, and by its own normal."""
        pairs = self.pairs
        return tuple(
            c in self.fast or (now not in (GAP, STICK) and pairs.holdable[c] and spans(self.rows, pairs.tangent[c]))
            for c, now in enumerate(self.status)
        )

    @cached_property
    def free(self) -> tuple[Array, Array, Array]:
        """Z (k, y) of the motions that the constraints leave, in which stiffness is nearly diagonal, W, and a rate (y,)
        for each [1/s]."""
        k, r = self.basis.size, len(self.rows)
        left = sl.qr(self.rows.T, mode="full")[0][:, r:] if r else np.eye(k)
        symmetric = left.T @ (0.5 * (self.stiffness + self.stiffness.T)) @ left
        squares, turn = sl.eigh(symmetric)
        z = left @ turn
        top = float(np.sqrt(np.abs(squares).max(initial=0.0)))
        scale = np.maximum(np.sqrt(np.abs(squares)), max(1e-6 * top, 1e-300 if top else 1.0))
        # D W = 0 and WᵀZ = 1: what of Z the directions see is taken out along R.
        return z, z - self.rows.T @ (self.cross.T @ (self.directions @ z)), scale

    @cached_property
    def states(self) -> Array:
        """The matrix (2y, 2y) that moves ξ = [scale y; ẏ]."""
        z, w, scale = self.free
        size = z.shape[1]
        matrix = np.zeros((2 * size, 2 * size))
        matrix[:size, size:] = np.diag(scale)
        matrix[size:, :size] = -(w.T @ (self.stiffness @ z)) / scale
        matrix[size:, size:] = -(w.T @ (self.basis.damping @ z))
        return matrix

    @cached_property
    def modes(self) -> tuple[ComplexArray, ComplexArray]:
        """Poles (2y,) and vectors (2y, 2y) of it."""
        return sl.eig(self.states)

    @property
    def fastest(self) -> float:
        """The largest pole [1/s]."""
        return float(np.abs(self.modes[0]).max(initial=0.0))

    @cached_property
    def separate(self) -> Split:
        """Modes one by one, but for the slow ones."""
        return self._split(SLOW * self.fastest)

    def _split(self, slow: float) -> Split:
        """The motion in modes faster than ``slow`` [1/s], and the rest together."""
        poles, vectors = self.modes
        order = np.argsort(np.abs(poles), kind="stable")
        count = int(np.count_nonzero(np.abs(poles) <= slow))
        together, small = np.zeros((len(poles), 0)), np.zeros((0, 0))
        if count:
            schur, turn, count = _slow_first(self.states, slow)
            together, small = turn[:, :count], schur[:count, :count]
        fast = np.sort(order[count:])
        inverse = np.linalg.inv(np.hstack([vectors[:, fast], together]))
        spread = np.linalg.norm(inverse[: len(fast)], axis=1) * np.linalg.norm(vectors[:, fast], axis=0)
        if spread.max(initial=1.0) > DEFECTIVE:
            worst = abs(complex(poles[fast][int(np.argmax(spread))]))
            raise AnalysisError(
                f"two modes at {worst:.6g} rad/s are all but one while contacts are {self._words()} (critical damping, "
                "or friction right at an onset): the exact stepper has no modes to go on with; change the damping or μ "
                'a little, or take stepper = "explicit"'
            )
        kept = fast[poles[fast].imag >= 0.0]
        rows = np.flatnonzero(poles[fast].imag >= 0.0)
        weight = np.where(poles[kept].imag > 0.0, 2.0, 1.0)
        return Split(
            poles[kept], vectors[:, kept] * weight, np.ascontiguousarray(inverse[rows]), small, together,
            np.ascontiguousarray(inverse[len(fast) :].real), float(spread.max(initial=1.0)),
        )  # fmt: skip

    def _words(self) -> str:
        words = {GAP: "open", STICK: "stuck"}
        return ", ".join(words.get(now, "slipping") for now in self.status)

    def slower_than(self, rate: float) -> Split:
        """The same with modes slower than a rate [1/s] kept together too."""
        return self.separate if rate <= SLOW * self.fastest else self._split(rate)


def _slow_first(matrix: Array, slow: float) -> tuple[Array, Array, int]:
    """The real Schur form T of a matrix = Q T Qᵀ, Q, and how many eigenvalues are no larger than ``slow``, which come
    first. Without SciPy's own sorting: it calls back, and an interrupt that comes then is printed and lost."""
    form, turn = sl.schur(matrix)
    none = np.zeros(len(matrix), dtype=np.int32)
    _, _, real, imaginary, *_ = sl.lapack.dtrsen(none, form, turn, job=b"N")
    form, turn, _, _, count, _, _, failed = sl.lapack.dtrsen(np.hypot(real, imaginary) <= slow, form, turn, job=b"N")
    if failed:
        raise AnalysisError("the slow motions of a status of the contacts cannot be told from its fast ones")
    return form, turn, int(count)


@dataclass(frozen=True)
class Split:
    """ξ = Re(vectors ζ) + together z: poles (f,) with Im ≥ 0, vectors (2y, f) that count both of a pair, left (f, 2y);
    small (z, z) moves together (2y, z), whose left is ``rest`` (z, 2y). spread: the largest condition number of a mode,
    by which rounding grows."""

    poles: ComplexArray
    vectors: ComplexArray
    left: ComplexArray
    small: Array
    together: Array
    rest: Array
    spread: float


class Driven:
    """A regime under what a piece of the schedule drives it with: the state in modes and back, and numbers of it."""

    def __init__(self, regime: Regime, piece: Piece) -> None:
        self.regime, self.piece = regime, piece
        pairs = regime.pairs
        terms, m = piece.terms, pairs.count
        total = terms + m
        rate = np.zeros((total, total))
        rate[:terms, :terms] = piece.derivative
        moved = np.pad(piece.displacements, ((0, 0), (0, m)))
        self.rate, self.moved = rate, moved
        self.force = np.pad(pairs.loads.T @ piece.loads, ((0, 0), (0, m)))
        self.force = self.force - pairs.inertia.T @ moved @ rate @ rate - pairs.drag.T @ moved @ rate
        for c, along in regime.pushes:
            closed = pairs.normal_lift[c] @ moved
            closed[0] += pairs.gap[c]
            self.force = self.force - np.outer(along, closed) / pairs.compliance[c]
        holds = np.zeros((len(regime.held), total))
        for number, (c, what) in enumerate(regime.held):
            if what == "normal":
                holds[number] = -(pairs.normal_lift[c] @ moved)
                holds[number, 0] -= pairs.gap[c]
            else:
                holds[number] = -(pairs.tangent_lift[c] @ moved)
                holds[number, terms + c] += 1.0
        self.holds = holds

    def gap(self, c: int) -> Row:
        """Gap of a contact [m]."""
        pairs = self.regime.pairs
        p = pairs.normal_lift[c] @ self.moved
        p[0] += pairs.gap[c]
        return Row(pairs.normal[c], np.zeros_like(pairs.normal[c]), p)

    def slip(self, c: int) -> Row:
        """Velocity of the slave against the master along the tangent [m/s]."""
        pairs = self.regime.pairs
        return Row(np.zeros_like(pairs.tangent[c]), pairs.tangent[c], pairs.tangent_lift[c] @ self.moved @ self.rate)

    def opening(self, c: int) -> Row:
        """Rate of a gap [m/s]."""
        pairs = self.regime.pairs
        return Row(np.zeros_like(pairs.normal[c]), pairs.normal[c], pairs.normal_lift[c] @ self.moved @ self.rate)

    @cached_property
    def ways(self) -> Array:
        """Of each contact (m, 2 + d): whether its slip is held, its sign at the beginning of the piece, and when [s]
        that changes, behind which there is ``inf``. Slip without friction has no way."""
        pairs, piece = self.regime.pairs, self.piece
        found = np.full((pairs.count, 1 + piece.terms), np.inf)
        found[:, :2] = 0.0
        for c, held in enumerate(self.regime.follows):
            if not held or pairs.sticking[c] == 0.0:
                continue
            lifted = self.regime.back @ self.holds
            lift, row = pairs.tangent_lift[c], pairs.tangent[c]
            own = (lift @ self.moved + row @ lifted) @ self.rate
            terms = (np.abs(lift) @ np.abs(self.moved) + np.abs(row) @ np.abs(lifted)) @ self.rate
            first, changes = turns(own[: piece.terms], terms[: piece.terms])
            found[c, :2] = 1.0, first
            found[c, 2 : 2 + len(changes)] = piece.start + piece.unit * np.array(changes)
        return found

    def way(self, c: int, time: float) -> float:
        """The sign of a slip that is held, from a time on."""
        _, first, *changes = self.ways[c]
        passed = sum(change <= time + NEAR * self.piece.unit for change in changes)
        return float(-first if passed % 2 else first)

    @cached_property
    def told(self) -> Status:
        """The status as it is told: slip that is held at rest sticks, with the friction that it has."""
        rests = (self.ways[:, 0] == 1.0) & (self.ways[:, 1] == 0.0)
        return tuple(STICK if rest else now for rest, now in zip(rests, self.regime.status, strict=True))

    def rate_of(self, row: Row) -> Row:
        """The time derivative of a number of displacements and velocities."""
        q, v, p = self._acceleration
        return Row(row.v @ q, row.q + row.v @ v, row.v @ p + row.p @ self.rate)

    @cached_property
    def _acceleration(self) -> tuple[Array, Array, Array]:
        """q̈ = aq q + av q̇ + ap p."""
        regime = self.regime
        q, v, p = -regime.stiffness, -regime.basis.damping, self.force
        for n in range(len(regime.held)):
            force = self._multipliers[n]
            q, v, p = (
                whole + np.outer(regime.directions[n], part)
                for whole, part in zip((q, v, p), (force.q, force.v, force.p), strict=True)
            )
        return q, v, p

    @cached_property
    def _multipliers(self) -> list[Row]:
        regime = self.regime
        q = regime.cross @ (regime.rows @ regime.stiffness)
        v = regime.cross @ (regime.rows @ regime.basis.damping)
        p = regime.cross @ (self.holds @ self.rate @ self.rate - regime.rows @ self.force)
        return [Row(*parts) for parts in zip(q, v, p, strict=True)]

    @cached_property
    def forces(self) -> list[tuple[Row, Row]]:
        """Normal and tangential force of each contact [N]."""
        regime, pairs = self.regime, self.regime.pairs
        k, total = regime.basis.size, len(self.rate)
        none = Row(np.zeros(k), np.zeros(k), np.zeros(total))
        found: list[tuple[Row, Row]] = []
        held = {what: self._multipliers[n] for n, what in enumerate(regime.held)}
        for c, now in enumerate(regime.status):
            if now == GAP:
                found.append((none, none))
                continue
            if pairs.compliance[c] > 0.0:
                gap = self.gap(c)
                normal = Row(-gap.q / pairs.compliance[c], gap.v, -gap.p / pairs.compliance[c])
            else:
                normal = held[c, "normal"]
            if now == STICK:
                tangential = held.get((c, "tangent"), none)
            else:
                factor = -sense(now) * pairs.sliding[c]
                tangential = Row(factor * normal.q, factor * normal.v, factor * normal.p)
            found.append((normal, tangential))
        return found


class Flow(Driven):
    """Driven, with its motion in modes."""

    def __init__(self, regime: Regime, piece: Piece) -> None:
        super().__init__(regime, piece)
        self.split = split = regime.slower_than(RAMP / piece.unit if piece.terms > 2 else 0.0)
        z, w, scale = regime.free
        self.z, self.scale = z, scale
        lifted = regime.back @ self.holds
        self.lifted, self.lifted_rate = lifted, lifted @ self.rate
        pushed = self.force - lifted @ self.rate @ self.rate
        pushed = pushed - regime.basis.damping @ self.lifted_rate - regime.stiffness @ lifted
        size = z.shape[1]
        forcing = w.T @ pushed
        inner = split.left[:, size:] @ forcing
        poles, follow, power = split.poles[:, None], np.zeros_like(inner), inner
        for _ in range(self.piece.terms):
            power = power / poles
            follow = follow - power
            power = power @ self.rate
        self.follow = follow
        few, total = len(split.small), len(self.rate)
        slow = np.zeros((few + total, few + total))
        slow[:few, :few] = split.small
        slow[:few, few:] = split.rest[:, size:] @ forcing
        slow[few:, few:] = self.rate
        self.slow = slow
        embed_q, embed_v = z / scale, z
        self.modes_q, self.modes_v = embed_q @ split.vectors[:size], embed_v @ split.vectors[size:]
        rest_q = np.hstack([embed_q @ split.together[:size], lifted])
        rest_v = np.hstack([embed_v @ split.together[size:], self.lifted_rate])
        rest_q[:, few:] += (self.modes_q @ follow).real
        rest_v[:, few:] += (self.modes_v @ follow).real
        self.rest_q, self.rest_v = rest_q, rest_v

    def enter(self, q: Array, v: Array, p: Array) -> tuple[ComplexArray, Array]:
        """A state in modes (f,) and in what is slow (z + P,)."""
        split = self.split
        y = self.z.T @ (q - self.lifted @ p) * self.scale
        state = np.concatenate([y, self.z.T @ (v - self.lifted_rate @ p)])
        return split.left @ state - self.follow @ p, np.concatenate([split.rest @ state, p])

    def state(self, zeta: ComplexArray, slow: Array) -> tuple[Array, Array]:
        """Displacement and velocity (k,)."""
        return (self.modes_q @ zeta).real + self.rest_q @ slow, (self.modes_v @ zeta).real + self.rest_v @ slow

    def sizes(self, zeta: ComplexArray, slow: Array) -> tuple[Array, Array]:
        """What the terms of displacement and velocity (k,) amount to, by which their rounding is judged: from rest they
        cancel nearly all."""
        (modes_q, modes_v), (rest_q, rest_v) = self._amounts
        size, still = np.abs(zeta), np.abs(slow)
        return modes_q @ size + rest_q @ still, modes_v @ size + rest_v @ still

    @cached_property
    def _amounts(self) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
        return (np.abs(self.modes_q), np.abs(self.modes_v)), (np.abs(self.rest_q), np.abs(self.rest_v))

    def signal(self, row: Row) -> tuple[ComplexArray, Array]:
        """A number on modes (f,) and on what is slow (z + P,)."""
        slow = row.q @ self.rest_q + row.v @ self.rest_v
        slow[len(slow) - len(row.p) :] += row.p
        return row.q @ self.modes_q + row.v @ self.modes_v, slow

    def sizes_of(self, row: Row) -> Array:
        """What the terms of a number on what is slow (z + P,) amount to."""
        _, (rest_q, rest_v) = self._amounts
        slow = np.abs(row.q) @ rest_q + np.abs(row.v) @ rest_v
        slow[len(slow) - len(row.p) :] += np.abs(row.p)
        return slow

    def series(self, slow: Array) -> Array:
        """Terms (TAYLOR, z + P) of what is slow in powers of the time [s]."""
        terms = np.zeros((TAYLOR, len(slow)))
        terms[0] = slow
        for n in range(1, TAYLOR):
            terms[n] = self.slow @ terms[n - 1] / n
        return terms

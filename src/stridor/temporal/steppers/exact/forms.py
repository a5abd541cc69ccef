"""Energies and works of a motion in modes, in closed form: compiled sums, and the forms that they add up.

With f = Re Σ f_k z_k + f_s s and g likewise, z_k = ζ_k exp(λ_k t) and s a polynomial of t, ∫ f g dt has the terms
½ Re f_k g_l z_k z_l/(λ_k + λ_l), ½ Re f̄_k g_l z̄_k z_l/(λ̄_k + λ_l), those of a mode and a polynomial, and
of two of these. So an energy, and the primitive of a power, is a quadratic form of [Re z; Im z] and what is linear in
z.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ....typing import Array, ComplexArray
from ...columns import DAMPING, EXTERNAL, FRICTION, NORMAL, SUPPORT, WORKS
from .statuses import GAP, STICK, Flow, Row

KINETIC, ELASTIC = WORKS, WORKS + 1  # behind the works
FORMS = WORKS + 2
RESONANT = 1e-7  # of their size: exponents that cancel so far are integrated one by one
STILL = 8  # numbers of such a pair: its work, 1 where the first is conjugate, both modes, weight and sum of exponents


@dataclass(frozen=True)
class Forms:
    """Of each work and energy: which of the quadratic forms it has, or −1 (7,); these (r, f(2f + 1)), lower triangles
    of matrices (2f, 2f) row by row, off the diagonal twice; cross (7S, f) real and imaginary, of what is slow
    with modes; slow (7S, S); pairs (·, 8) of modes whose exponents cancel."""

    which: Array
    quadratic: Array
    cross_real: Array
    cross_imag: Array
    slow: Array
    still: Array


def forms_of(flow: Flow) -> Forms:
    """The forms of a flow: works of damping, friction, contact springs, loads, supports, and both energies."""
    return _Forms(flow).made()


class _Forms:
    def __init__(self, flow: Flow) -> None:
        self.flow = flow
        self.poles = flow.split.poles
        f, slow = len(self.poles), len(flow.slow)
        self.which = np.full(FORMS, -1.0)
        self.quadratic: list[Array] = []
        self.cross: ComplexArray = np.zeros((FORMS, f, slow), dtype=complex)
        self.slow = np.zeros((FORMS, slow, slow))
        self.still: list[Array] = [np.zeros((0, STILL))]
        few = slow - len(flow.rate)
        self.place = np.hstack([np.zeros((len(flow.moved), few)), flow.moved])
        self.speed = np.hstack([np.zeros((len(flow.moved), few)), flow.moved @ flow.rate])

    def made(self) -> Forms:
        self._works()
        self._energies()
        f, slow = self.cross.shape[1:]
        packed = np.zeros((len(self.quadratic), f * (2 * f + 1)))
        rows, columns = np.tril_indices(2 * f)
        for number, matrix in enumerate(self.quadratic):
            packed[number] = np.where(rows == columns, 1.0, 2.0) * matrix[rows, columns]
        cross: ComplexArray = self.cross.transpose(0, 2, 1).reshape(FORMS * slow, f)
        return Forms(
            self.which, packed, np.ascontiguousarray(cross.real), np.ascontiguousarray(cross.imag),
            self.slow.reshape(FORMS * slow, slow), np.vstack(self.still),
        )  # fmt: skip

    # -- works -------------------------------------------------------------------------------------------------------

    def _works(self) -> None:
        flow = self.flow
        pairs, status = flow.regime.pairs, flow.regime.status
        k, total = flow.regime.basis.size, len(flow.rate)
        zero = np.zeros(k)
        friction: list[tuple[Row, Row]] = []
        springs: list[tuple[Row, Row]] = []
        for c, now in enumerate(status):
            normal, tangential = flow.forces[c]
            if now not in (GAP, STICK):
                friction.append((_minus(tangential), flow.slip(c)))
            if now != GAP and pairs.compliance[c] > 0.0:
                springs.append((_minus(normal), flow.opening(c)))
        speed = flow.moved @ flow.rate
        loads = np.pad(flow.piece.loads, ((0, 0), (0, total - flow.piece.terms)))
        external = [
            (Row(zero, zero, loads[j]), Row(zero, pairs.loads[j], pairs.loads_lift[j] @ speed))
            for j in range(len(loads))
        ]
        support = [(self._reaction(p, loads), Row(zero, zero, speed[p])) for p in range(len(speed))]
        for column, rows in ((FRICTION, friction), (NORMAL, springs), (EXTERNAL, external), (SUPPORT, support)):
            if rows:
                self._of_pairs(column, rows)
        damping = flow.regime.basis.damping
        modes: ComplexArray = np.vstack([flow.modes_v, np.zeros((len(speed), flow.modes_v.shape[1]), dtype=complex)])
        slow = np.vstack([flow.rest_v, self.speed])
        whole = np.block([[damping, pairs.drag.T], [pairs.drag, pairs.damping_own]])
        damped: ComplexArray = whole @ modes
        self._work(DAMPING, (modes, slow), (damped, whole @ slow))

    def _reaction(self, p: int, loads: Array) -> Row:
        """What a support pushes with, per unit of its motion."""
        flow, pairs = self.flow, self.flow.regime.pairs
        acceleration = flow.rate_of(Row(np.zeros_like(pairs.inertia[p]), pairs.inertia[p], np.zeros(len(flow.rate))))
        q, v, own = acceleration.q, acceleration.v + pairs.drag[p], acceleration.p
        own = own + pairs.mass_own[p] @ flow.moved @ flow.rate @ flow.rate
        own = own + pairs.damping_own[p] @ flow.moved @ flow.rate + pairs.stiffness_own[p] @ flow.moved
        own = own - pairs.loads_lift[:, p] @ loads
        for c, (normal, tangential) in enumerate(flow.forces):
            for lift, force in ((pairs.normal_lift[c, p], normal), (pairs.tangent_lift[c, p], tangential)):
                q, v, own = q - lift * force.q, v - lift * force.v, own - lift * force.p
        return Row(q, v, own)

    def _of_pairs(self, column: int, rows: list[tuple[Row, Row]]) -> None:
        first, second = [self.flow.signal(a) for a, _ in rows], [self.flow.signal(b) for _, b in rows]
        modes = [np.array([modes for modes, _ in side], dtype=complex) for side in (first, second)]
        slow = [np.array([slow for _, slow in side]) for side in (first, second)]
        self._work(column, (modes[0], slow[0]), (modes[1], slow[1]))

    def _work(self, column: int, first: tuple[ComplexArray, Array], second: tuple[ComplexArray, Array]) -> None:
        """The integral of products of rows: each on modes (r, f) and on what is slow (r, S)."""
        self.cross[column] = first[0].T @ second[1] + second[0].T @ first[1]
        self.slow[column] = first[1].T @ second[1]
        if not (np.any(first[0]) and np.any(second[0])):
            return
        together = 0.5 * (first[0].T @ second[0])
        conjugate = 0.5 * (first[0].conj().T @ second[0])
        poles = self.poles
        plain = self._parted(column, 0.5 * (together + together.T), poles, turned=False)
        turned = self._parted(column, 0.5 * (conjugate + conjugate.conj().T), poles.conj(), turned=True)
        self._add(column, _real_form(plain, turned))

    def _parted(self, column: int, weights: ComplexArray, first: ComplexArray, *, turned: bool) -> ComplexArray:
        """Weights (f, f) over the sums of exponents; the pairs for which these cancel are kept apart."""
        sums = first[:, None] + self.poles[None]
        still = np.abs(sums) <= RESONANT * np.abs(self.poles)[None]
        pairs, weight, left = np.argwhere(still).astype(float), weights[still], sums[still]
        head = np.broadcast_to([float(column), float(turned)], (len(pairs), 2))
        self.still.append(np.column_stack([head, pairs, weight.real, weight.imag, left.real, left.imag]))
        return np.where(still, 0.0, weights / np.where(still, 1.0, sums))

    def _add(self, column: int, form: Array) -> None:
        self.which[column] = len(self.quadratic)
        self.quadratic.append(0.5 * (form + form.T))

    # -- energies ----------------------------------------------------------------------------------------------------

    def _energies(self) -> None:
        flow, pairs = self.flow, self.flow.regime.pairs
        stiffness = flow.regime.basis.stiffness[:, None]
        v, v_rest, q, q_rest = flow.modes_v, flow.rest_v, flow.modes_q, flow.rest_q
        carried = pairs.inertia.T @ self.speed
        self._add(KINETIC, 0.5 * planes_of(v).T @ planes_of(v))
        self.cross[KINETIC] = v.T @ (v_rest + carried)
        own = 0.5 * self.speed.T @ pairs.mass_own @ self.speed
        self.slow[KINETIC] = 0.5 * v_rest.T @ v_rest + v_rest.T @ carried + own
        self._add(ELASTIC, 0.5 * planes_of(q).T @ (stiffness * planes_of(q)))
        self.cross[ELASTIC] = q.T @ (stiffness * q_rest)
        own = 0.5 * self.place.T @ pairs.stiffness_own @ self.place
        self.slow[ELASTIC] = 0.5 * q_rest.T @ (stiffness * q_rest) + own


def _minus(row: Row) -> Row:
    return Row(-row.q, -row.v, -row.p)


def planes_of(modes: ComplexArray) -> Array:
    """Rows (r, 2f) on [Re ζ; Im ζ] whose values are Re(modes ζ)."""
    return np.hstack([modes.real, -modes.imag])


def _real_form(together: ComplexArray, conjugate: ComplexArray) -> Array:
    """Re(ζᵀ together ζ + ζᴴ conjugate ζ) as a form (2f, 2f) of [Re ζ; Im ζ]."""
    top = np.hstack([together.real + conjugate.real, -together.imag - conjugate.imag])
    low = np.hstack([-together.imag + conjugate.imag, conjugate.real - together.real])
    return np.vstack([top, low])

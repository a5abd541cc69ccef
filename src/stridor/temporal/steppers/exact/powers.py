"""Works of a motion in modes: integrals of products of two sums of exponentials and polynomials, in closed form.

With f = Re Σ f_k z_k + f_s s and g likewise, z_k = ζ_k exp(λ_k t) and s a polynomial of t, ∫ f g dt has the terms
½ Re f_k g_l z_k z_l/(λ_k + λ_l), ½ Re f̄_k g_l z̄_k z_l/(λ̄_k + λ_l), those of a mode and a polynomial, and
of two of these.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ....typing import Array, ComplexArray, IntArray
from ...columns import DAMPING, EXTERNAL, FRICTION, NORMAL, SUPPORT, WORKS
from .statuses import GAP, STICK, Flow, Row

RESONANT = 1e-7  # of their size: exponents that cancel so far are integrated one by one


class _Still(NamedTuple):
    """Pairs (r, 2) of modes whose exponents cancel, their weights (r,) and what is left of the exponents (r,)."""

    pairs: IntArray
    weights: ComplexArray
    sums: ComplexArray


@dataclass(frozen=True)
class _Form:
    """One work: forms (f, f) of modes with modes and with their conjugates, pairs of either whose exponents cancel,
    cross (f, S) of modes with what is slow, slow (S, S)."""

    together: ComplexArray | None
    conjugate: ComplexArray | None
    still: tuple[_Still, ...]
    cross: ComplexArray
    slow: Array


class Powers:
    """The works of a flow: damping, friction, contact springs, loads, supports."""

    def __init__(self, flow: Flow) -> None:
        self.flow = flow
        self._forms: dict[int, _Form] | None = None

    @property
    def forms(self) -> dict[int, _Form]:
        """By columns; made when they are asked for first."""
        if self._forms is None:
            self._forms = self._made()
        return self._forms

    def _made(self) -> dict[int, _Form]:
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
        forms = {
            column: self._of_pairs(rows)
            for column, rows in ((FRICTION, friction), (NORMAL, springs), (EXTERNAL, external), (SUPPORT, support))
            if rows
        }
        forms[DAMPING] = self._of_damping(speed)
        return forms

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

    def _of_pairs(self, rows: list[tuple[Row, Row]]) -> _Form:
        first, second = [self.flow.signal(a) for a, _ in rows], [self.flow.signal(b) for _, b in rows]
        modes = [np.array([modes for modes, _ in side], dtype=complex) for side in (first, second)]
        slow = [np.array([slow for _, slow in side]) for side in (first, second)]
        return self._form(modes[0], slow[0], modes[1], slow[1])

    def _of_damping(self, speed: Array) -> _Form:
        flow, pairs = self.flow, self.flow.regime.pairs
        damping = flow.regime.basis.damping
        few = len(flow.slow) - len(flow.rate)
        moving = np.hstack([np.zeros((len(speed), few)), speed])
        modes: ComplexArray = np.vstack([flow.modes_v, np.zeros((len(speed), flow.modes_v.shape[1]), dtype=complex)])
        slow = np.vstack([flow.rest_v, moving])
        whole = np.block([[damping, pairs.drag.T], [pairs.drag, pairs.damping_own]])
        return self._form(modes, slow, whole @ modes, whole @ slow)

    def _form(self, first: ComplexArray, first_slow: Array, second: ComplexArray, second_slow: Array) -> _Form:
        poles = self.flow.split.poles
        cross = first.T @ second_slow + second.T @ first_slow
        slow = first_slow.T @ second_slow
        if not (np.any(first) and np.any(second)):
            return _Form(None, None, (), cross, slow)
        together = 0.5 * (first.T @ second)
        conjugate = 0.5 * (first.conj().T @ second)
        plain = _parted(0.5 * (together + together.T), poles[:, None] + poles[None], poles)
        turned = _parted(0.5 * (conjugate + conjugate.conj().T), poles.conj()[:, None] + poles[None], poles)
        return _Form(plain[0], turned[0], (plain[1], turned[1]), cross, slow)

    def works(self, zeta: ComplexArray, terms: Array, after: Array) -> Array:
        """Works (t, 5) [J] of modes ζ (f,) and terms (J, S) of what is slow, from zero to some times after (t,)."""
        poles = self.flow.split.poles
        times = np.concatenate([[0.0], after])
        modes = zeta[:, None] * np.exp(poles[:, None] * times)
        powers = times[:, None] ** np.arange(len(terms))
        found = np.zeros((len(after), WORKS))
        for column, form in self.forms.items():
            total = np.zeros(len(times))
            if form.together is not None and form.conjugate is not None:
                total += np.einsum("kt,kt->t", modes, form.together @ modes).real
                total += np.einsum("kt,kt->t", modes.conj(), form.conjugate @ modes).real
                total += self._resonant(form, zeta, times)
            total += np.einsum("kt,kt->t", _following(form.cross @ terms.T, poles) @ powers.T, modes).real
            total += _integral(terms, form.slow, times)
            found[:, column] = total[1:] - total[0]
        return found

    @staticmethod
    def _resonant(form: _Form, zeta: ComplexArray, times: Array) -> Array:
        total = np.zeros(len(times))
        for (pairs, weights, sums), first in zip(form.still, (zeta, zeta.conj()), strict=False):
            size = weights * first[pairs[:, 0]] * zeta[pairs[:, 1]]
            grown = sums[:, None] * times
            small = np.abs(grown) < 1e-8
            share = np.where(small, 1.0 + grown / 2, np.expm1(grown) / np.where(small, 1.0, grown))
            total += (size[:, None] * share * times).sum(axis=0).real
        return total


def _parted(weights: ComplexArray, sums: ComplexArray, poles: ComplexArray) -> tuple[ComplexArray, _Still]:
    """Weights (f, f) over the sums of exponents, and the pairs for which these cancel."""
    still = np.abs(sums) <= RESONANT * np.abs(poles)[None]
    found = _Still(np.argwhere(still), weights[still], sums[still])
    return np.where(still, 0.0, weights / np.where(still, 1.0, sums)), found


def _minus(row: Row) -> Row:
    return Row(-row.q, -row.v, -row.p)


def _following(coefficients: ComplexArray, poles: ComplexArray) -> ComplexArray:
    """A (f, J) with A' + λA = c, c (f, J) polynomials: ∫ c exp(λt) dt = A exp(λt)."""
    found = np.zeros(coefficients.shape, dtype=complex)
    above = np.zeros_like(poles)
    for j in range(coefficients.shape[1] - 1, -1, -1):
        above = (coefficients[:, j] - (j + 1) * above) / poles
        found[:, j] = above
    return found


def _integral(terms: Array, slow: Array, times: Array) -> Array:
    """∫ sᵀ Y s dt of a polynomial s with terms (J, S)."""
    product = terms @ slow @ terms.T
    total = np.zeros(len(times))
    for j in range(2 * len(terms) - 1):
        here = sum(product[i, j - i] for i in range(max(0, j - len(terms) + 1), min(j, len(terms) - 1) + 1))
        total += here * times ** (j + 1) / (j + 1)
    return total

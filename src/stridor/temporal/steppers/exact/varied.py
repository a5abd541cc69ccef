"""A motion with its variation: how the state at a time changes with the state that it began from.

Between two changes of status the variation δ moves like the motion itself. A change comes earlier or later by
δt = −δy/ẏ, y being the number that reaches zero there; seen at one time (P. C. Müller, Chaos, Solitons & Fractals 5,
1995; R. I. Leine, H. Nijmeijer, Dynamics and Bifurcations of Non-Smooth Mechanical Systems, Springer 2004),

    δq⁺ = δq⁻ + (v⁻ − v⁺) δt,      δv⁺ = J (δv⁻ + a⁻ δt) − a⁺ δt,

with J of the impact that there may be, and a contact that begins to stick does so where it is
δh = t (δq⁻ + v⁻ δt) + ḋ δt from where it was.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import scipy.linalg as sl

from ....errors import AnalysisError
from ....typing import Array, ComplexArray
from ..basis import Basis
from .decisions import Impact
from .drive import Piece
from .motion import Anchor, Motion
from .statuses import STICK, Pairs, Status

GRAZING = 1e-7  # of the terms of a number's rate: with less it touches zero and does not go through
OUTSIDE = 1e-10  # of the terms of a number: so far below zero it may be by rounding


class _Before(NamedTuple):
    """Right before a change: velocity and acceleration (k,), and how much earlier or later it comes (m,)."""

    v: Array
    a: Array
    shift: Array


class VariedMotion(Motion):
    """A motion that takes along a variation of m directions: dq, dv (k, m) and, of contacts
    that stick, dholds (contacts, m). grazed: the least rate with which a number went through zero, over what its terms
    amount to. words: the changes of contact since the beginning."""

    def __init__(self, basis: Basis, pairs: Pairs, pieces: list[Piece]) -> None:
        super().__init__(basis, pairs, pieces)
        self.dq, self.dv = np.zeros((basis.size, 0)), np.zeros((basis.size, 0))
        self.dholds = np.zeros((pairs.count, 0))
        self.grazed = np.inf
        self.words: list[tuple[float, str, int, Status]] = []
        self._struck: Impact | None = None

    def share(self, other: Motion) -> None:
        """Keep the modes of statuses together with another motion of the same system."""
        self._regimes, self._driven, self._watched = other._regimes, other._driven, other._watched

    def place(self, q: Array, v: Array, status: Status, dq: Array, dv: Array, dholds: Array) -> None:
        """Begin in a status that goes with q and v, whatever would follow from them."""
        self.q, self.v, self.status = q.copy(), v.copy(), status
        self._sizes = np.abs(q), np.abs(v)
        self.dq, self.dv, self.dholds = dq.copy(), dv.copy(), dholds.copy()
        along = self.pairs.tangent_lift @ self._place()
        self.holds = np.array(
            [self.pairs.tangent[c] @ q + along[c] if now == STICK else 0.0 for c, now in enumerate(status)]
        )

    def passed(self) -> None:
        """Go to the next event and through it, the variation too. Raises AnalysisError where a number only touches
        zero, as the state behind it does not vary smoothly then."""
        assert self.next is not None
        assert self.anchor is not None
        time, meaning, c = self.next
        anchor = self.anchor
        before = self._carried(anchor, time, None if meaning in ("stretch", "piece") else (meaning, c))
        self._struck = None
        was = self.status
        super().passed()
        if meaning in ("stretch", "piece"):
            return
        self.words.append((time, meaning, c, self.status))
        if self.dq.shape[1]:
            self._through(before, was)

    def at(self, time: float) -> tuple[Array, Array, Array, Array]:
        """Velocity and acceleration (k,), and the variation of displacement and velocity (k, m), at a time before the
        next change."""
        anchor = self._anchored()
        v, a, _, _ = self._rates(anchor, time)
        _, _, dq, dv = self._moved(anchor, time)
        return v, a, dq, dv

    def belongs(self) -> bool:
        """Whether the state at ``time`` goes with the status: no force, gap or slip is on the other side of zero."""
        anchor = self._anchored()
        watched = anchor.watched
        terms = watched.weights * anchor.zeta
        values = terms.real.sum(axis=1) + watched.slow @ anchor.slow
        sizes = np.abs(terms).sum(axis=1) + np.abs(watched.slow) @ np.abs(anchor.slow)
        return bool(np.all(values >= -OUTSIDE * sizes))

    def _place(self) -> Array:
        piece = self.pieces[self.piece]
        return piece.displacements @ piece.powers(self.time)

    def _rates(self, anchor: Anchor, time: float) -> tuple[Array, Array, ComplexArray, Array]:
        """Velocity and acceleration (k,), modes (f,) and what is slow, at a time."""
        flow, after = anchor.watched.flow, time - anchor.time
        zeta = anchor.zeta * np.exp(flow.split.poles * after)
        slow = anchor.slow_at(after)
        v = flow.state(zeta, slow)[1]
        a = (flow.modes_v @ (flow.split.poles * zeta)).real + flow.rest_v @ (flow.slow @ slow)
        return v, a, zeta, slow

    def _moved(self, anchor: Anchor, time: float) -> tuple[ComplexArray, Array, Array, Array]:
        """The variation at a time: modes (f, m), slow (S, m), displacement and velocity (k, m)."""
        flow, after = anchor.watched.flow, time - self.time
        split, m = flow.split, self.dq.shape[1]
        p = np.vstack([np.zeros((len(flow.rate) - self.pairs.count, m)), self.dholds])
        y = flow.z.T @ (self.dq - flow.lifted @ p) * flow.scale[:, None]
        state = np.vstack([y, flow.z.T @ (self.dv - flow.lifted_rate @ p)])
        zeta = (split.left @ state - flow.follow @ p) * np.exp(split.poles * after)[:, None]
        slow = sl.expm(flow.slow * after) @ np.vstack([split.rest @ state, p])
        dq = (flow.modes_q @ zeta).real + flow.rest_q @ slow
        dv = (flow.modes_v @ zeta).real + flow.rest_v @ slow
        return zeta, slow, dq, dv

    def _carried(self, anchor: Anchor, time: float, change: tuple[str, int] | None) -> _Before:
        """The variation moved to a time, and by how much that varies if something changes then."""
        v, a, zeta, slow = self._rates(anchor, time)
        shift = np.zeros(self.dq.shape[1])
        dzeta, dslow, dq, dv = self._moved(anchor, time)
        watched = anchor.watched
        i = -1 if change is None else watched.meanings.index(change)
        if 0 <= i < len(watched.weights):  # slip that is held turns when supports do, whatever the state is
            weights, poles = watched.weights[i], watched.flow.split.poles
            turning = poles * weights * zeta
            drift = float(watched.slow[i] @ (watched.flow.slow @ slow))
            rate = float(turning.sum().real) + drift
            size = float(np.abs(turning).sum()) + abs(drift)
            self.grazed = min(self.grazed, abs(rate) / max(size, 1e-300))
            if self.dq.shape[1]:
                if abs(rate) <= GRAZING * size:
                    raise AnalysisError(
                        f"a contact only just {watched.meanings[i][0]} (grazing): the motion behind does not vary "
                        "smoothly with the one before"
                    )
                shift = -((weights @ dzeta).real + watched.slow[i] @ dslow) / rate
        self.dq, self.dv = dq, dv
        return _Before(v, a, shift)

    def _through(self, before: _Before, was: Status) -> None:
        """The variation behind a change."""
        shift, piece, pairs = before.shift, self.pieces[self.piece], self.pairs
        moved = self.dq + np.outer(before.v, shift)
        speeds = pairs.tangent_lift @ piece.displacements @ piece.derivative @ piece.powers(self.time)
        for c, now in enumerate(self.status):
            if now != STICK:
                self.dholds[c] = 0.0
            elif was[c] != STICK:
                self.dholds[c] = pairs.tangent[c] @ moved + speeds[c] * shift
        behind = self.dv + np.outer(before.a, shift)
        if (struck := self._struck) is not None and len(struck.held):
            behind = behind - struck.pushed.T @ np.linalg.solve(struck.held @ struck.pushed.T, struck.held @ behind)
        anchor = self._anchored()
        after = self._rates(anchor, self.time)[1]
        self.dq = moved - np.outer(self.v, shift)
        self.dv = behind - np.outer(after, shift)

    def _strike(self, struck: Impact, met: list[int], slips: Mapping[int, float] | None = None) -> None:
        self._struck = struck
        super()._strike(struck, met, slips)

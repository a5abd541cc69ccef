"""The compiled way from event to event, and the matrices that it needs of each status."""

from __future__ import annotations

import numpy as np

from ....errors import AnalysisError
from ....typing import Array
from .events import MEANING, Bench
from .forms import forms_of
from .held import spans
from .leap import (
    CHANGE,
    CONTACT,
    COUNTED,
    COUNTS,
    CROWD_SINCE,
    CROWDED,
    EVENTS,
    LATER,
    LATEST,
    LEVEL,
    NEEDED,
    NEEDS,
    NEXT,
    NEXT_KIND,
    NEXT_NUMBER,
    NEXT_RECORD,
    NO_TELLING,
    NOW,
    PEAK_LEVEL,
    PIECE,
    PIECE_END,
    PLAIN,
    RECORDED,
    SEARCHED,
    SPAN,
    TIMES,
    UNSURE,
    LeapState,
    leap,
)
from .motion import UNTOLD, Anchor, Motion, Watched
from .observed import Records
from .outputs import Outputs
from .search import planes
from .statuses import Status
from .tables import JAMMED, LEG, OPTION, UNKNOWN, Store, leg_parts, option_parts


class Leaps:
    """Moves a motion on, with its records and statistics; step [s], every: steps from record to record.

    counted [s]: up to where times of statuses were counted; works (5,) [J] up to now; recorded: rows that are filled;
    next: the number of the next record."""

    plain = PLAIN  # with none, all changes are gone through by `Motion.passed`

    def __init__(
        self, outputs: Outputs, records: Records, statistics: Array, step: float, every: int, done: int, counted: float
    ) -> None:
        self.outputs, self.records, self.statistics = outputs, records, statistics
        self.step, self.every = step, every
        self.recorded, self.next = 0, -(-done // every)
        self.counted = counted
        self.works: Array | None = None
        self._peak = self._level = 0
        self._piece = -1
        self._anchor: Anchor | None = None
        self._ahead, self._modes_ahead = (LATER, 0), np.zeros(0)
        self._bench: Bench | None = None
        self._fresh(0)

    def go(self, motion: Motion, end: float, last: int) -> bool:
        """Up to ``end`` [s], with records before step ``last``, or up to a change that is not plain, which is next
        then; whether the end was reached. Raises AnalysisError where no change can be told from rounding."""
        if motion.piece != self._piece or self._bench is None:
            self._fresh(motion.pairs.count)
            self._piece, self._bench = motion.piece, _bench(motion)
        state, zeta, terms, ahead = self._state(motion)
        fastest = motion.fastest()
        while True:
            code, zeta, terms, ahead = leap(
                self._store.numbers, self._legs_at, self._legs, self._options_at, self._options, self._bench, state,
                zeta, terms, ahead, self.records, end, self.step, self.every, last, fastest, self.plain,
            )  # fmt: skip
            if code != NEEDS:
                break
            motion.status = tuple(int(now) for now in state.status)
            try:
                self._provide(motion, int(state.counts[NEEDED]))
            except AnalysisError:
                self._take(motion, state, zeta, terms, ahead)
                raise
            fastest = motion.fastest()
        self._take(motion, state, zeta, terms, ahead)
        if code == NO_TELLING:
            motion.reach(end)  # looks again, and says whether the motion has left all numbers
            raise AnalysisError(UNTOLD)
        return code != CHANGE

    # -- state -------------------------------------------------------------------------------------------------------

    def _state(self, motion: Motion) -> tuple[LeapState, Array, Array, Array]:
        times, counts = np.zeros(TIMES), np.zeros(COUNTS, dtype=np.int64)
        zeta, terms, ahead = np.zeros((2, 0)), np.zeros((1, 0)), np.zeros(0)
        times[[NOW, CROWD_SINCE, LATEST, COUNTED]] = motion.time, motion.crowd_since, motion.latest, self.counted
        times[PIECE_END] = motion.pieces[motion.piece].end
        counts[[LEVEL, EVENTS, UNSURE, CROWDED]] = motion.level, motion.events, motion.unsure, motion.crowded
        counts[[PEAK_LEVEL, NEXT_RECORD, RECORDED]] = self._peak, self.next, self.recorded
        if motion.anchor is not None and motion.anchor is self._anchor and motion.next is not None:
            counts[[NEXT_KIND, NEXT_NUMBER]] = self._ahead
            counts[LEVEL], counts[SEARCHED] = self._level, motion.level
            times[[NEXT, SPAN]] = motion.next[0], motion.anchor.span
            zeta, terms, ahead = planes(motion.anchor.zeta), motion.anchor.terms, self._modes_ahead
        works = motion.works.copy()
        state = LeapState(
            np.concatenate([motion.q, motion.v]), motion.holds.copy(), works, works.copy(),
            np.array(motion.status, dtype=np.int64), motion.parted.copy(), motion.parted_from.copy(), times, counts,
            self.statistics,
        )  # fmt: skip
        return state, zeta, terms, ahead

    def _take(self, motion: Motion, state: LeapState, zeta: Array, terms: Array, ahead: Array) -> None:
        k, times, counts = motion.basis.size, state.times, state.counts
        motion.q, motion.v = state.moving[:k], state.moving[k:]
        motion.holds, motion.works = state.holds, state.works
        motion.status = tuple(int(now) for now in state.status)
        motion.parted, motion.parted_from = state.parted, state.parted_from
        motion.time, self.counted = float(times[NOW]), float(times[COUNTED])
        motion.crowd_since, motion.latest = float(times[CROWD_SINCE]), float(times[LATEST])
        motion.level, motion.events = int(counts[LEVEL]), int(counts[EVENTS])
        motion.unsure, motion.crowded = int(counts[UNSURE]), int(counts[CROWDED])
        self._peak, self.next, self.recorded = (int(counts[n]) for n in (PEAK_LEVEL, NEXT_RECORD, RECORDED))
        self.works = state.works_now
        kind, number = int(counts[NEXT_KIND]), int(counts[NEXT_NUMBER])
        motion.anchor = motion.next = self._anchor = None
        if kind == LATER:
            return
        watched = motion.watched()
        self._ahead, self._modes_ahead = (kind, number), ahead
        # A restart looks ahead anew, from the level at which that was begun.
        self._level, motion.level = motion.level, int(counts[SEARCHED])
        motion.anchor = self._anchor = Anchor(
            motion.time, watched, zeta[0] + 1j * zeta[1], terms[0].copy(), terms, float(times[SPAN])
        )
        what, contact = watched.meanings[number] if kind == CONTACT else ("piece" if kind == PIECE else "stretch", 0)
        motion.next = float(times[NEXT]), what, contact

    # -- matrices ----------------------------------------------------------------------------------------------------

    def _fresh(self, contacts: int) -> None:
        """Nothing is known of any status."""
        self._store = Store()
        self._legs = np.full(4**contacts, UNKNOWN)
        self._options = np.full(4**contacts, UNKNOWN)
        self._legs_at = np.zeros((0, LEG, 3), dtype=np.int64)
        self._options_at = np.zeros((0, OPTION, 3), dtype=np.int64)

    def _provide(self, motion: Motion, code: int) -> None:
        """Matrices of a status that was met or thought of."""
        status = _status(code, motion.pairs.count)
        if status == motion.status and self._legs[code] == UNKNOWN:
            self._legs[code] = len(self._legs_at)
            self._legs_at = np.concatenate([self._legs_at, self._store.add(self._leg(motion.watched()))[None]])
        if self._options[code] != UNKNOWN:
            return
        try:
            parts = option_parts(motion.driven(status))
        except AnalysisError:
            self._options[code] = JAMMED
            return
        self._options[code] = len(self._options_at)
        self._options_at = np.concatenate([self._options_at, self._store.add(parts)[None]])

    def _leg(self, watched: Watched) -> list[Array]:
        meanings = np.array([[MEANING[what], c] for what, c in watched.meanings], dtype=float).reshape(-1, 2)
        observed = self.outputs.observed(watched)
        return leg_parts(
            watched.flow, watched.numbers, watched.slow, watched.slow_sizes, meanings, watched.table,
            forms_of(watched.flow), observed.modes, observed.slow, self.every * self.step,
            np.array(watched.turns, dtype=float).reshape(-1, 2),
        )  # fmt: skip


def _status(code: int, contacts: int) -> Status:
    return tuple((code >> 2 * (contacts - 1 - c)) & 3 for c in range(contacts))


def _bench(motion: Motion) -> Bench:
    """What does not change with the status."""
    pairs, piece = motion.pairs, motion.pieces[motion.piece]
    nn, tt, nt = (
        np.einsum("ck,ck->c", a, b)
        for a, b in ((pairs.normal, pairs.normal), (pairs.tangent, pairs.tangent), (pairs.normal, pairs.tangent))
    )
    stops = [not spans(n[None], t) for n, t in zip(pairs.normal, pairs.tangent, strict=True)]

    def plain(values: Array) -> Array:
        return np.ascontiguousarray(values, dtype=float)

    return Bench(
        normal=plain(pairs.normal), tangent=plain(pairs.tangent), normal_lift=plain(pairs.normal_lift),
        tangent_lift=plain(pairs.tangent_lift), products=np.stack([nn, tt, nt], axis=1),
        compliance=plain(pairs.compliance), sliding=plain(pairs.sliding), sticking=plain(pairs.sticking),
        stops=plain(np.array(stops)), holdable=plain(np.array(pairs.holdable)),
        inertia=plain(pairs.inertia), places=plain(piece.displacements),
        speeds=plain(piece.displacements @ piece.derivative), begin=piece.start, length=piece.unit,
    )  # fmt: skip

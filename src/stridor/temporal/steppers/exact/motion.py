"""From event to event: the motion between two changes of status is known, and the next change is a root of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ....errors import AnalysisError
from ....typing import Array, ComplexArray, IntArray
from ...columns import FRICTION, NORMAL, SUPPORT, WORKS
from ..basis import Basis
from .decisions import CLOSE, EventState, Impact, Touching, choices, consistent_status, impact, landing
from .drive import Piece
from .held import NEAR, ROUNDING
from .leap import MOMENT, PLAIN, STRETCH
from .search import CROSSED, UNDECIDED, Numbers, Parts, first_root, numbers_of, parts_of, planes
from .statuses import BACKWARD, FORWARD, GAP, STICK, TAYLOR, Driven, Flow, Pairs, Regime, Row, Status, sense

UNTOLD = (
    "a force, gap or slip of a contact stays so close to zero that no change of status can be told from rounding, "
    'which the exact stepper does not pass; take stepper = "explicit"'
)
BEYOND = "the motion is no longer finite: it grows beyond all numbers, and what contacts do then cannot be told"
STORM = 300  # so many events within a `MOMENT`: they accumulate
# Contacts that throw one another off: behind so many events of a moment, throws shorter than this [rad] end at once.
LANDINGS = ((PLAIN, 1e-4), (100, 1e-2))


@dataclass(frozen=True)
class Watched:
    """A flow with the numbers that end it: for each what it means and of which contact, its weights on what is slow and
    what these are the sums of (m, S), by which rounding is judged; tables of the search. turns: when
    [s] slip that is held comes to its end, and which meaning that has, behind those of the numbers."""

    flow: Flow
    meanings: tuple[tuple[str, int], ...]
    weights: ComplexArray
    numbers: Numbers
    slow: Array
    slow_sizes: Array
    table: Parts
    turns: tuple[tuple[float, int], ...]

    def turn(self, time: float) -> tuple[float, int]:
        """The first of the turns behind a time."""
        near = NEAR * self.flow.piece.unit
        return next((turn for turn in self.turns if turn[0] > time + near), (np.inf, -1))


@dataclass(frozen=True)
class Anchor:
    """The motion from ``time`` on: modes ζ, terms of what is slow, and how long these may be used."""

    time: float
    watched: Watched
    zeta: ComplexArray
    slow: Array
    terms: Array
    span: float

    def state(self, time: float) -> tuple[Array, Array]:
        """Displacement and velocity (k,) at a time."""
        after = time - self.time
        zeta = self.zeta * np.exp(self.watched.flow.split.poles * after)
        return self.watched.flow.state(zeta, self.slow_at(after))

    def sizes(self, time: float) -> tuple[Array, Array]:
        """What the terms of displacement and velocity (k,) amount to at a time."""
        after = time - self.time
        zeta = self.zeta * np.exp(self.watched.flow.split.poles * after)
        return self.watched.flow.sizes(zeta, self.slow_at(after))

    def slow_at(self, after: float) -> Array:
        """What is slow, some time after."""
        return after ** np.arange(len(self.terms)) @ self.terms


class Motion:
    """The state of a system that goes from event to event.

    Displacement q and velocity v (k,) at ``time``, the status of the contacts and where each began to stick.
    """

    def __init__(self, basis: Basis, pairs: Pairs, pieces: list[Piece]) -> None:
        self.basis, self.pairs, self.pieces = basis, pairs, pieces
        self.piece = 0
        self.time = 0.0
        self.q, self.v = np.zeros(basis.size), np.zeros(basis.size)
        self.status: Status = (GAP,) * pairs.count
        self.holds: Array = np.zeros(pairs.count)
        self.level = 0
        self.events = self.unsure = self.crowded = 0
        self.crowd_since = self.latest = 0.0  # [s], the first and the last event of a moment
        self.parted = np.full(pairs.count, -1.0)  # [s], when each contact opened
        self.parted_from: IntArray = np.zeros(pairs.count, dtype=np.int64)  # and its status before
        self.landed = 0
        self.works: Array = np.zeros(WORKS)  # [J] up to the beginning of the present modes; `Leaps` counts them
        self._sizes = np.zeros(basis.size), np.zeros(basis.size)  # of the terms of q and v
        self._regimes: dict[Status, Regime] = {}
        self._driven: dict[tuple[Status, int], Driven] = {}
        self._watched: dict[tuple[Status, int], Watched] = {}
        self.anchor: Anchor | None = None
        self.next: tuple[float, str, int] | None = None

    # -- what is kept of each status ---------------------------------------------------------------------------------

    def regime(self, status: Status) -> Regime:
        """Modes of a status."""
        if status not in self._regimes:
            self._regimes[status] = Regime(self.basis, self.pairs, status)
        return self._regimes[status]

    def driven(self, status: Status) -> Driven:
        """A status under what drives it now, without its modes."""
        key = status, self.piece
        if key not in self._driven:
            self._driven[key] = Driven(self.regime(status), self.pieces[self.piece])
        return self._driven[key]

    def watched(self) -> Watched:
        """The present status with its modes."""
        key = self.status, self.piece
        if key not in self._watched:
            self._watched[key] = _watched(self.regime(self.status), self.pieces[self.piece])
        return self._watched[key]

    def drive(self, time: float) -> Array:
        """p: powers of time, and where contacts began to stick."""
        return np.concatenate([self.pieces[self.piece].powers(time), self.holds])

    def _state(self) -> EventState:
        return EventState(self.time, self.q, self.v, self.drive(self.time), *self._sizes)

    def support_speeds(self) -> tuple[Array, Array]:
        """What moving supports add to the velocities (m,) along normals and tangents now."""
        speed, _ = self.pieces[self.piece].speeds(self.time)
        return self.pairs.normal_lift @ speed, self.pairs.tangent_lift @ speed

    # -- from one event to the next ----------------------------------------------------------------------------------

    def reach(self, end: float) -> float:
        """Find the next event unless it is beyond ``end``; the time up to which the motion is known."""
        while self.next is None:
            anchor = self._anchored()
            last = self.pieces[self.piece].end
            turn, turning = anchor.watched.turn(anchor.time)
            limit = min(anchor.span, last - anchor.time, turn - anchor.time)
            code, which, after, level, _, unsure = first_root(
                anchor.watched.numbers._replace(
                    rows=anchor.watched.slow @ anchor.terms.T,
                    amounts=anchor.watched.slow_sizes @ np.abs(anchor.terms[0]),
                ),
                planes(anchor.watched.flow.split.poles), planes(anchor.zeta), anchor.watched.table, limit,
                self.level, np.empty(2 * len(anchor.zeta)),
            )  # fmt: skip
            self.level, self.unsure = level, self.unsure + unsure
            if code == UNDECIDED:
                with np.errstate(over="ignore", invalid="ignore"):  # what is asked is whether it is beyond all numbers
                    finite = np.all(np.isfinite(anchor.state(anchor.time + after)))
                raise AnalysisError(UNTOLD if finite else BEYOND)
            if code == CROSSED:
                self.next = (min(anchor.time + after, last), *anchor.watched.meanings[which])
            elif limit == turn - anchor.time:
                self.next = (turn, *anchor.watched.meanings[turning])
            elif anchor.time + limit >= last * (1 - 1e-15):
                self.next = (last, "piece", 0)
            else:
                self.next = (anchor.time + limit, "stretch", 0)
        return min(self.next[0], end)

    def _anchored(self) -> Anchor:
        """The motion in the modes of the present status, begun anew where there is none."""
        if self.anchor is None:
            watched = self.watched()
            zeta, slow = watched.flow.enter(self.q, self.v, self.drive(self.time))
            self._begin(watched, zeta, slow)
        assert self.anchor is not None
        return self.anchor

    def _begin(self, watched: Watched, zeta: ComplexArray, slow: Array) -> None:
        terms = watched.flow.series(slow)
        span = STRETCH * watched.table.longest
        sizes = np.abs(terms).max(axis=1)
        # The last term must be nothing beside the first ones.
        while sizes[-1] > 0.0 and sizes[-1] * span ** (TAYLOR - 1) > 1e-17 * max(float(sizes[0]), 1e-300):
            span *= 0.5
        used = int(np.flatnonzero(sizes).max(initial=0)) + 1
        self.anchor = Anchor(self.time, watched, zeta, slow, terms[:used], span)

    def passed(self) -> None:
        """Go to the next event and through it."""
        assert self.next is not None
        assert self.anchor is not None
        time, meaning, c = self.next
        anchor = self.anchor
        self.next, self.anchor = None, None
        self.q, self.v = anchor.state(time)
        self._sizes = anchor.sizes(time)
        self.time = time
        if meaning == "stretch":
            return
        if meaning == "piece":
            self._change_piece()
            return
        self.events += 1
        fastest = self.fastest()
        if time - self.crowd_since > MOMENT / fastest:
            self.crowd_since, self.crowded = time, 0
        self.crowded += 1
        short = max((throw for events, throw in LANDINGS if self.crowded > events), default=0.0) / fastest
        before, self.latest = self.latest, time
        if self.crowded > STORM:
            raise AnalysisError(
                f"{STORM} changes of contact within {time - self.crowd_since:.3g} s, faster than anything swings: they "
                'accumulate, which the exact stepper does not pass; take stepper = "explicit"'
            )
        if meaning == "closes" and time - before < short and self._land(c, 4.0 * short):
            return
        self._go_through(meaning, c)

    def fastest(self) -> float:
        """What the length of a moment is told by [1/s]: the fastest of all modes met, or else the phase."""
        own = float(np.sqrt(np.abs(self.basis.stiffness).max(initial=0.0)))
        met = [r.fastest for r in self._regimes.values() if "modes" in vars(r)]
        return max(own, 0.0, *met) if own or met else 1.0 / self.pieces[self.piece].unit

    def _land(self, c: int, moment: float) -> bool:
        """Contact ``c`` closes, which was thrown off within a ``moment`` [s], and all that are closed or were thrown
        off stay closed; whether there are forces that keep them so."""
        pairs, status = self.pairs, self.status
        rigid, thrown = pairs.compliance == 0.0, self.parted >= self.time - moment
        rest = [o for o, now in enumerate(status) if rigid[o] and (now != GAP or thrown[o])]
        was = [int(self.parted_from[o]) if now == GAP else now for o, now in enumerate(status)]
        stuck = [o for o, now in enumerate(status) if was[o] == STICK and (o in rest or now != GAP)]
        if not (rigid[c] and thrown[c]) or len({*rest, *stuck}) < 2:
            return False
        kept = self.q, self.v, self.works.copy(), self.status
        try:
            self._strike(landing(pairs, self.v, self.support_speeds(), rest, stuck), rest)
        except AnalysisError:
            self.q, self.v, self.works, self.status = kept
            return False
        self.landed += 1
        return True

    def _go_through(self, meaning: str, c: int) -> None:
        """What a number that reached zero brings about."""
        pairs, was = self.pairs, self.status
        touching = self._touching()
        if meaning == "closes":
            if pairs.compliance[c] == 0.0:
                self._collide([c, *(o for o in touching if pairs.compliance[o] == 0.0)])
                return
            speed, at_rest = self._slip(c)
            if at_rest and pairs.holdable[c]:
                touching[c] = Touching(0.0, tuple(o for o in choices(pairs, c, 0.0, STICK).options if o != GAP))
            else:
                touching[c] = Touching(speed, (FORWARD if speed >= 0.0 else BACKWARD,))
        elif meaning == "opens":
            del touching[c]
        elif meaning in ("slips forward", "slips backward"):
            first, other = (FORWARD, BACKWARD) if meaning == "slips forward" else (BACKWARD, FORWARD)
            touching[c] = Touching(0.0, (first, GAP, other))
        else:  # stops
            back = BACKWARD if was[c] == FORWARD else FORWARD
            options = choices(pairs, c, 0.0, STICK).options
            touching[c] = Touching(0.0, tuple(o for o in (STICK, back, was[c]) if o in options))
        self._take(consistent_status(pairs.count, touching, self.driven, self._state()))

    def _touching(self) -> dict[int, Touching]:
        """Contacts that are closed now, and what they may do if something else changes."""
        return {c: self._going_on(c, now) for c, now in enumerate(self.status) if now != GAP}

    def _slip(self, c: int, slip: float | None = None) -> tuple[float, bool]:
        """The slip of a contact now [m/s], if it is not told, and whether that is rounding."""
        parts = np.append(self.pairs.tangent[c] * self.v, self.support_speeds()[1][c])
        slip = float(parts.sum()) if slip is None else slip
        return slip, abs(slip) <= CLOSE * float(np.abs(parts).sum())

    def _going_on(self, c: int, now: int) -> Touching:
        """What a contact may do that is closed, by the slip that its status gives it."""
        slip = sense(now)
        if self.pairs.holdable[c]:
            try:
                driven = self.driven(self.status)
            except AnalysisError:  # it was taken up with other contacts closed
                return choices(self.pairs, c, slip, now)
            slip = driven.way(c, self.time) if driven.ways[c, 0] else slip
        return choices(self.pairs, c, slip, now)

    def _collide(self, met: list[int], slips: Mapping[int, float] | None = None) -> None:
        """An impact of contacts ``met``; slips: those of others that are closed, where they are not what their status
        says."""
        self._strike(impact(self.pairs, self.v, self.support_speeds(), met, self.status), met, slips)

    def _strike(self, struck: Impact, met: list[int], slips: Mapping[int, float] | None = None) -> None:
        """Go on behind an impact."""
        speed, _ = self.pieces[self.piece].speeds(self.time)
        self.works[SUPPORT] += float(speed @ (self.pairs.inertia @ (struck.velocity - self.v)))
        self.v = struck.velocity
        self.works[NORMAL] += struck.normal_work
        self.works[FRICTION] += struck.friction_work
        self.works[SUPPORT] -= struck.carried
        touching: dict[int, Touching] = {}
        for c, now in enumerate(self.status):
            if now == GAP or c in met:
                continue
            # A spring takes no impulse, so what slides or sticks on one is carried along by what strikes elsewhere.
            slip, at_rest = self._slip(c, None if slips is None else slips[c])
            stays = at_rest and (now == STICK or self.pairs.holdable[c])
            touching[c] = choices(self.pairs, c, 0.0 if stays else slip, now)
        for c, slip in struck.slips.items():
            touching[c] = choices(self.pairs, c, slip, self.status[c])
        self._take(consistent_status(self.pairs.count, touching, self.driven, self._state()))

    def _take(self, status: Status) -> None:
        """Another status from here on."""
        piece, pairs = self.pieces[self.piece], self.pairs
        for c, now in enumerate(status):
            if now == STICK and self.status[c] != STICK:
                place = piece.displacements @ piece.powers(self.time)
                self.holds[c] = float(pairs.tangent[c] @ self.q + pairs.tangent_lift[c] @ place)
            if now == GAP and self.status[c] != GAP:
                self.parted[c], self.parted_from[c] = self.time, self.status[c]
        self.status, self.anchor = status, None

    # -- changes of what drives the system ---------------------------------------------------------------------------

    def start(self, touching: Mapping[int, float]) -> None:
        """Begin with q, v as they are; touching: contacts that are closed, with their slip."""
        self._sizes = np.abs(self.q), np.abs(self.v)
        self.status = tuple(self._met(c, touching[c]) if c in touching else GAP for c in range(self.pairs.count))
        self._collide([c for c in touching if self.pairs.compliance[c] == 0.0], touching)

    def _met(self, c: int, slip: float) -> int:
        """The status from which a contact begins that has this slip."""
        return STICK if slip == 0.0 and self.pairs.holdable[c] else FORWARD if slip >= 0.0 else BACKWARD

    def take_up(self, ratio: Array, touching: Mapping[int, float]) -> None:
        """Go on with q, v at ``time`` in another model; ratio (p,): how many times as fast supports are as before;
        touching: contacts that are closed in it, with their slip."""
        self.status = tuple(
            (GAP if c not in touching else now if now != GAP else self._met(c, touching[c]))
            for c, now in enumerate(self.status)
        )
        self._sizes = np.abs(self.q), np.abs(self.v)
        while self.piece and self.time < self.pieces[self.piece].start:
            self.piece -= 1
        speed, terms = self.pieces[self.piece].speeds(self.time)
        self._jump(speed, speed / ratio, ROUNDING * terms)

    def _change_piece(self) -> None:
        """Other loads and other speeds of the supports from here on."""
        old = self.pieces[self.piece]
        self.piece += 1
        if self.piece == len(self.pieces):
            self.piece -= 1
            self.next = (np.inf, "end", 0)
            self.anchor = None
            return
        speed, terms = self.pieces[self.piece].speeds(self.time)
        before, others = old.speeds(self.time)
        self._jump(speed, before, ROUNDING * (terms + others))

    def _jump(self, speed: Array, before: Array, rounding: Array) -> None:
        """Loads are others from here on, and supports have another speed (p,) than before; up to ``rounding`` (p,) they
        have the same: polynomials that meet at the end of a ramp are sums of terms that cancel there."""
        jump = np.where(np.abs(speed - before) > rounding, speed - before, 0.0)
        closed = [c for c, now in enumerate(self.status) if now != GAP]
        if not np.any(jump):
            self._take(consistent_status(self.pairs.count, self._touching(), self.driven, self._state()))
            return
        push = self.pairs.inertia.T @ jump
        self.v = self.v - push
        self.works[SUPPORT] += float((self.pairs.mass_own @ jump - self.pairs.inertia @ push) @ (speed - 0.5 * jump))
        along = self.support_speeds()[1]
        slips = {c: float(self.pairs.tangent[c] @ self.v + along[c]) for c in closed}
        self._collide([c for c in slips if self.pairs.compliance[c] == 0.0], slips)


def _watched(regime: Regime, piece: Piece) -> Watched:
    flow = Flow(regime, piece)
    pairs = regime.pairs
    meanings: list[tuple[str, int]] = []
    weights: list[ComplexArray] = []
    slow: list[Array] = []
    sizes: list[Array] = []
    turns: list[tuple[float, int]] = []
    for c, now in enumerate(regime.status):
        normal, tangential = flow.forces[c]
        rows: list[tuple[str, tuple[Row, ...]]] = []
        if now == GAP:
            rows = [("closes", (flow.gap(c),))]
        elif now == STICK and regime.follows[c]:
            rows = [("opens", (normal,))]
        elif now == STICK:
            # What holds a slave back that would go forward acts against the tangent.
            limit = normal.times(pairs.sticking[c])
            rows = [("slips forward", (limit, tangential)), ("slips backward", (limit, tangential.times(-1.0)))]
        else:
            slip = flow.slip(c)
            s = sense(now)
            rows = [("opens", (normal,))]
            if not regime.follows[c] and pairs.sticking[c] > 0.0:
                rows.append(("stops", (slip.times(s),)))
        for name, parts in rows:
            weight, rest = flow.signal(parts[0] if len(parts) == 1 else parts[0].plus(parts[1]))
            meanings.append((name, c))
            weights.append(weight)
            slow.append(rest)
            # Of both: a limit and a force that are equal leave nothing, but their rounding.
            sizes.append(sum((flow.sizes_of(part) for part in parts), np.zeros(len(flow.slow))))
    count = len(meanings)
    for c, (_, _, *changes) in enumerate(flow.ways):
        if regime.status[c] not in (GAP, STICK) and np.isfinite(changes).any():
            turns += [(float(change), len(meanings)) for change in changes if np.isfinite(change)]
            meanings.append(("stops", c))
    poles = flow.split.poles
    slowest = float(np.abs(poles).min(initial=np.inf))
    longest = min(1.0 / slowest if np.isfinite(slowest) else np.inf, piece.end - piece.start)
    stacked = np.array(weights, dtype=complex).reshape(count, len(poles))
    rest, amounts = (np.array(lot).reshape(count, len(flow.slow)) for lot in (slow, sizes))
    numbers = numbers_of(stacked, poles, rest)
    table = parts_of(poles, longest)
    return Watched(flow, tuple(meanings), stacked, numbers, rest, amounts, table, tuple(sorted(turns)))

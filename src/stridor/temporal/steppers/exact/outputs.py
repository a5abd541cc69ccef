"""Records of a motion in modes: contact forces, watched points and energies at many times at once."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ....typing import Array, ComplexArray
from ...columns import REC_GAP, REC_NORMAL, REC_SLIP, REC_STATUS, REC_TANGENTIAL, WORKS
from .motion import Anchor, Watched
from .statuses import GAP, STICK, Flow, Row

BLOCK = 8  # records at a time
CONTACT_ROWS = 4  # normal and tangential force, slip speed, gap


class Records(NamedTuple):
    """Contacts (r, m, 6), watch (r, w, 3) of u, v, a, energies (r, 7)."""

    contacts: Array
    watch: Array
    energies: Array


class _Observed(NamedTuple):
    """Numbers (o, f) of modes and (o, S) of what is slow; coordinates and velocities for energies."""

    modes: ComplexArray
    slow: Array


@dataclass(frozen=True)
class Outputs:
    """What is recorded: watched rows (w, k) with their lift (w, p)."""

    watch: Array
    lift: Array
    _known: dict[int, tuple[Watched, _Observed]] = field(default_factory=dict[int, "tuple[Watched, _Observed]"])

    def write(self, anchor: Anchor, after: Array, works: Array, record: Records, here: slice) -> None:
        """Records at times (t,) after the beginning of some modes; works (5,) up to there.

        In full blocks, filled up where there are fewer: a product of matrices rounds by how many columns it has, and a
        run that was cut elsewhere has the same digits."""
        for first in range(0, len(after), BLOCK):
            times = after[first : first + BLOCK]
            count = len(times)
            filled = np.concatenate([times, np.full(BLOCK - count, times[-1])])
            self._write(anchor, filled, works, record, slice(here.start + first, here.start + first + count))

    def _write(self, anchor: Anchor, after: Array, works: Array, record: Records, here: slice) -> None:
        count = here.stop - here.start
        flow, observed = anchor.watched.flow, self._observed(anchor.watched)
        modes = anchor.zeta[:, None] * np.exp(flow.split.poles[:, None] * after)
        slow = (after[:, None] ** np.arange(len(anchor.terms))) @ anchor.terms
        found = (observed.modes @ modes).real + observed.slow @ slow.T
        m, w = flow.regime.pairs.count, len(self.watch)
        contacts = found[: CONTACT_ROWS * m].reshape(m, CONTACT_ROWS, len(after))
        for column, number in ((REC_NORMAL, 0), (REC_TANGENTIAL, 1), (REC_SLIP, 2), (REC_GAP, 3)):
            record.contacts[here, :, column] = contacts[:, number, :count].T
        record.contacts[here, :, REC_STATUS] = [{GAP: 0, STICK: 1}.get(now, 2) for now in flow.regime.status]
        record.watch[here] = found[CONTACT_ROWS * m :].reshape(3, w, len(after)).transpose(2, 1, 0)[:count]
        kinetic, elastic = _energies(flow, modes, slow)
        record.energies[here, 0], record.energies[here, 1] = kinetic[:count], elastic[:count]
        record.energies[here, 2 : 2 + WORKS] = works + anchor.works(after)[:count]

    def contacts_at(self, anchor: Anchor, after: Array) -> Array:
        """Normal and tangential force and slip speed (t, m, 3) at some times (t,)."""
        observed = self._observed(anchor.watched)
        count = CONTACT_ROWS * anchor.watched.flow.regime.pairs.count
        modes = anchor.zeta[:, None] * np.exp(anchor.watched.flow.split.poles[:, None] * after)
        slow = (after[:, None] ** np.arange(len(anchor.terms))) @ anchor.terms
        found = (observed.modes[:count] @ modes).real + observed.slow[:count] @ slow.T
        return found.T.reshape(len(after), -1, CONTACT_ROWS)[:, :, :3]

    def values(self, anchor: Anchor, after: Array) -> tuple[Array, Array]:
        """Normal and tangential force, slip speed and gap (t, m, 4); displacement, velocity and acceleration (t, w, 3)
        of the watched rows, at some times (t,)."""
        observed = self._observed(anchor.watched)
        modes = anchor.zeta[:, None] * np.exp(anchor.watched.flow.split.poles[:, None] * after)
        slow = (after[:, None] ** np.arange(len(anchor.terms))) @ anchor.terms
        found = (observed.modes @ modes).real + observed.slow @ slow.T
        count = CONTACT_ROWS * anchor.watched.flow.regime.pairs.count
        contacts = found[:count].T.reshape(len(after), -1, CONTACT_ROWS)
        return contacts, found[count:].reshape(3, len(self.watch), len(after)).transpose(2, 1, 0)

    def _observed(self, watched: Watched) -> _Observed:
        if id(watched) not in self._known:
            self._known[id(watched)] = (watched, self._rows(watched.flow))
        return self._known[id(watched)][1]

    def _rows(self, flow: Flow) -> _Observed:
        rows: list[Row] = []
        for c in range(flow.regime.pairs.count):
            rows += [*flow.forces[c], flow.slip(c), flow.gap(c)]
        none, moved = np.zeros(flow.regime.basis.size), self.lift @ flow.moved
        places = [Row(row, none, own) for row, own in zip(self.watch, moved, strict=True)]
        speeds = [flow.rate_of(row) for row in places]
        rows += [*places, *speeds, *(flow.rate_of(row) for row in speeds)]
        signals = [flow.signal(row) for row in rows]
        f, states = len(flow.split.poles), len(flow.slow)
        return _Observed(
            np.array([s for s, _ in signals], dtype=complex).reshape(len(rows), f),
            np.array([s for _, s in signals]).reshape(len(rows), states),
        )


def _energies(flow: Flow, modes: ComplexArray, slow: Array) -> tuple[Array, Array]:
    """Kinetic and elastic energy (t,) [J], of modes (f, t) and of what is slow (t, S)."""
    pairs, basis = flow.regime.pairs, flow.regime.basis
    q = (flow.modes_q @ modes).real + flow.rest_q @ slow.T
    v = (flow.modes_v @ modes).real + flow.rest_v @ slow.T
    p = slow[:, slow.shape[1] - len(flow.rate) :].T
    place, speed = flow.moved @ p, flow.moved @ flow.rate @ p
    kinetic = 0.5 * np.einsum("kt,kt->t", v, v) + np.einsum("pt,pt->t", speed, pairs.inertia @ v)
    kinetic += 0.5 * np.einsum("pt,pt->t", speed, pairs.mass_own @ speed)
    elastic = 0.5 * np.einsum("kt,k,kt->t", q, basis.stiffness, q)
    elastic += 0.5 * np.einsum("pt,pt->t", place, pairs.stiffness_own @ place)
    return kinetic, elastic

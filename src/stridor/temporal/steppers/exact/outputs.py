"""What is seen of a motion in modes: contact forces and watched points, as numbers of its modes."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ....typing import Array, ComplexArray
from .motion import Anchor, Watched
from .observed import CONTACT_ROWS
from .statuses import Flow, Row


class Observed(NamedTuple):
    """Numbers (o, f) of modes and (o, S) of what is slow."""

    modes: ComplexArray
    slow: Array


@dataclass(frozen=True)
class Outputs:
    """What is recorded: watched rows (w, k) with their lift (w, p)."""

    watch: Array
    lift: Array
    _known: dict[int, tuple[Watched, Observed]] = field(default_factory=dict[int, "tuple[Watched, Observed]"])

    def values(self, anchor: Anchor, after: Array) -> tuple[Array, Array]:
        """Normal and tangential force, slip speed and gap (t, m, 4); displacement, velocity and acceleration (t, w, 3)
        of the watched rows, at some times (t,)."""
        observed = self.observed(anchor.watched)
        modes = anchor.zeta[:, None] * np.exp(anchor.watched.flow.split.poles[:, None] * after)
        slow = (after[:, None] ** np.arange(len(anchor.terms))) @ anchor.terms
        found = (observed.modes @ modes).real + observed.slow @ slow.T
        count = CONTACT_ROWS * anchor.watched.flow.regime.pairs.count
        contacts = found[:count].T.reshape(len(after), -1, CONTACT_ROWS)
        return contacts, found[count:].reshape(3, len(self.watch), len(after)).transpose(2, 1, 0)

    def observed(self, watched: Watched) -> Observed:
        """What is recorded of a status: per contact forces, slip and gap, then places, speeds and accelerations."""
        if id(watched) not in self._known:
            self._known[id(watched)] = (watched, self._rows(watched.flow))
        return self._known[id(watched)][1]

    def _rows(self, flow: Flow) -> Observed:
        rows: list[Row] = []
        for c in range(flow.regime.pairs.count):
            rows += [*flow.forces[c], flow.slip(c), flow.gap(c)]
        none, moved = np.zeros(flow.regime.basis.size), self.lift @ flow.moved
        places = [Row(row, none, own) for row, own in zip(self.watch, moved, strict=True)]
        speeds = [flow.rate_of(row) for row in places]
        rows += [*places, *speeds, *(flow.rate_of(row) for row in speeds)]
        signals = [flow.signal(row) for row in rows]
        f, states = len(flow.split.poles), len(flow.slow)
        return Observed(
            np.array([s for s, _ in signals], dtype=complex).reshape(len(rows), f),
            np.array([s for _, s in signals]).reshape(len(rows), states),
        )

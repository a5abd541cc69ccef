"""One limit cycle, as data."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ..digits import hertz
from ..notebook import Shown
from ..typing import Array, ComplexArray, IntArray

NEUTRAL = {"shooting": 1e-6, "harmonic": 1e-2}  # a largest multiplier as close to one as this decides nothing
OWN = 1e-2  # the motion's own multiplier, by harmonic balance further from one: the others tell nothing
SHORT = ("sticks", "slips", "reversals of slip")  # what harmonics do not tell where it is short
TURNING = 0.15  # the same of harmonic balance where slip turns or sticks, whose multipliers converge slowly
OPEN, STICK, SLIP = 0, 1, 2  # as in histories of runs

TURNS, MOST_TURNS = 8, 64  # of a period with 512 samples, and in proportion: no extremum is missed by 0.03 % of a swing
TURN = 0.01  # of a range: shorter ways there and back are ripples

WORDS = {
    "closes": "closes", "opens": "opens", "stops": "stops slipping", "slips forward": "slips forward",
    "slips backward": "slips backward",
}  # fmt: skip


def slip_range(slip: Array, status: IntArray) -> Array:
    """Least and largest (m, 2) of slip velocities (t, m); zeros for a contact that is never closed, as nothing slips
    there."""
    return np.where(np.any(status != OPEN, axis=0), [slip.min(axis=0), slip.max(axis=0)], 0.0).T


def extremes(values: Array) -> tuple[Array, Array]:
    """Least and largest (…) of values (t, …) at even times, also between these: at the tips of parabolas."""
    least, most = values.min(axis=0), values.max(axis=0)
    before, here, behind = values[:-2], values[1:-1], values[2:]
    slope, bend = 0.5 * (behind - before), before - 2.0 * here + behind
    within = (bend != 0.0) & (np.abs(slope) <= np.abs(bend))
    tips = here - 0.5 * slope**2 / np.where(within, bend, 1.0)
    return (
        np.minimum(least, np.where(within & (bend > 0.0), tips, np.inf).min(axis=0, initial=np.inf)),
        np.maximum(most, np.where(within & (bend < 0.0), tips, -np.inf).max(axis=0, initial=-np.inf)),
    )


def sample_count(values: Array, usual: int) -> int:
    """How many samples a period has: ``usual`` up to TURNS turns of values (t, n), in proportion up to MOST_TURNS."""
    return usual * int(np.clip(turns(values), TURNS, MOST_TURNS)) // TURNS


def turns(values: Array) -> int:
    """How often the column of values (t, n) turns back that does so most often, ripples left out."""
    found = 0
    for column in values.T:
        steps = np.diff(column)
        moved = np.flatnonzero(steps)
        size = float(np.ptp(column)) if len(column) else 0.0
        turned = moved[1:][np.diff(np.sign(steps[moved])) != 0.0]  # where it goes the other way from
        ways = np.abs(np.diff(column[turned]))
        found = max(found, int(np.count_nonzero(ways > TURN * size)) + 1 if len(turned) else 0)
    return found


class Change(NamedTuple):
    """A change of contact: when in the period [s], at which contact, what, and how each contact is behind it: 0 open, 1
    stick, 2 slip along its tangent, 3 slip against it."""

    time: float
    contact: str
    what: str
    behind: tuple[int, ...]


@dataclass(frozen=True, repr=False)
class Cycle(Shown):
    """A periodic motion at the friction coefficient ``mu``, of m contacts and w watched points.

    method: "shooting", or "harmonic" for harmonic balance with so many ``harmonics``. period [s]; residual: by shooting
    how far from closing it is after one, in shares of how far it goes (root of energy); by harmonic balance what is
    left of the balance, in shares of the contact forces. defect: of harmonic balance, how far its motion is from the
    equations of motion in time (`periodic.harmonic.balanced.defect`); NaN by shooting, which solves them. multipliers:
    Floquet's, largest first, without the one of the motion itself; none where ``multiplied`` is False, as the system is
    too large for them or some were not found. own_off: by harmonic balance, how far the one of the motion itself, which
    is one, came out from one; NaN by shooting. changes: of contact, in their order.

    time (t,) [s], even over one period, both ends included, 512 of them or more, up to 4096, where the motion turns
    back often: normal_force, tangential_force (t, m) [N], slip_velocity (t, m) [m/s], gap (t, m) [m], status (t, m): 0
    open, 1 stick, 2 slip; displacement [m], velocity, acceleration (t, w, 2), in space (t, w, 3). In space slip and
    friction are those along the slip of steady sliding.
    shares (m, 3): of the period that a contact is open, sticks and slips. slip_range (m, 2), force_range (m, 2): least
    and largest slip velocity (zeros where it never touches) and normal force, between those times as well.

    grazed: the least rate at which a force, gap or slip goes through zero, over what its terms amount to; a small one
    tells that a change is about to come or go. landed: how often contacts that threw one another off were brought to
    rest, which is not exact. reached_from: how it was found.
    """

    mu: float
    period: float
    residual: float
    multipliers: ComplexArray
    changes: tuple[Change, ...]
    contact_names: tuple[str, ...]
    watch_names: tuple[str, ...]
    time: Array
    normal_force: Array
    tangential_force: Array
    slip_velocity: Array
    gap: Array
    status: IntArray
    displacement: Array
    velocity: Array
    acceleration: Array
    shares: Array
    slip_range: Array
    force_range: Array
    grazed: float
    landed: int
    reached_from: str
    method: str = "shooting"
    harmonics: int = 0
    defect: float = float("nan")
    multiplied: bool = True
    own_off: float = float("nan")

    @property
    def untold_share(self) -> float | None:
        """Sticks, slips beside them and slips amid slip the other way that are shorter than this share of the period
        are not told, so that a share of stick or slip of 0 may be one of them: 1/h of h harmonics; None by shooting,
        which tells all."""
        return 1.0 / self.harmonics if self.method == "harmonic" and self.harmonics else None

    @property
    def untold(self) -> tuple[str, ...]:
        """What contacts may do besides, but too shortly to be told: one without a stick may stick, one that sticks
        without a slip may slip, and one that does both may slip the other way in between; () by shooting."""
        if not self.untold_share:
            return ()
        turning = self._turning()
        found = {
            SHORT[0] if stick == 0.0 else SHORT[1] if slip == 0.0 else "" if turning[k] else SHORT[2]
            for k, (_, stick, slip) in enumerate(self.shares)
        }
        return tuple(kind for kind in SHORT if kind in found)

    @property
    def frequency_hz(self) -> float:
        """1/period [Hz]."""
        return 1.0 / self.period

    @property
    def largest_multiplier(self) -> float:
        """|largest multiplier|."""
        return float(np.abs(self.multipliers).max(initial=0.0))

    @property
    def stable(self) -> bool | None:
        """Whether disturbances die out; None where the largest multiplier is one within 1e-6 (by harmonic balance:
        0.01, and 0.15 where slip comes to rest, however short), where the motion's own is further from one than 0.01,
        or where they are not known."""
        size = self.largest_multiplier
        if not self.multiplied or self.own_lost:
            return None
        return None if abs(size - 1.0) <= self.neutral else size < 1.0

    @property
    def neutral(self) -> float:
        """How near to one the size of a multiplier decides nothing."""
        if self.method != "harmonic":
            return NEUTRAL[self.method]
        closed, slip = self.status != OPEN, self.slip_velocity
        both = (closed & (slip <= 0.0)).any(axis=0) & (closed & (slip >= 0.0)).any(axis=0)
        rests = both.any() or {"stick", "reversal"} & set(self.kinds)
        return TURNING if rests else NEUTRAL["harmonic"]

    @property
    def outside(self) -> tuple[int, int] | None:
        """How many multipliers are beyond the unit circle, at least and at most, as some are as near to it as decides
        nothing; None where they are not known or not believed."""
        if not self.multiplied or self.own_lost:
            return None
        sizes = np.abs(self.multipliers)
        return int(np.sum(sizes > 1.0 + self.neutral)), int(np.sum(sizes >= 1.0 - self.neutral))

    @property
    def own_lost(self) -> bool:
        """Whether the motion's own multiplier came out too far from one for the others to be believed."""
        return self.own_off > OWN

    @property
    def slip_amplitudes(self) -> Array:
        """Half the range (m,) of the slip velocity [m/s] of each contact; 0 where it is never closed."""
        return 0.5 * (self.slip_range[:, 1] - self.slip_range[:, 0])

    @property
    def slip_amplitude(self) -> float:
        """Half the range of the slip velocity [m/s], of the contact where it is largest of those that touch."""
        return float(self.slip_amplitudes.max(initial=0.0))

    def amplitude(self, quantity: str = "acceleration") -> dict[str, tuple[float, ...]]:
        """Half the range of each watched point's x, y (and z), of "displacement", "velocity" or "acceleration"."""
        values = getattr(self, quantity)
        ranges = 0.5 * np.ptp(values, axis=0)
        return {name: tuple(map(float, row)) for name, row in zip(self.watch_names, ranges, strict=True)}

    @property
    def kinds(self) -> tuple[str, ...]:
        """What happens in it: "slip", "stick", "reversal", "separation"."""
        found = ["slip"] if np.any(self.shares[:, 2] > 0.0) else []
        if np.any(self.shares[:, 1] > 0.0):
            found.append("stick")
        if any(self._turning()):
            found.append("reversal")
        if np.any((self.shares[:, 0] > 0.0) & (self.shares[:, 0] < 1.0)):
            found.append("separation")
        return tuple(found)

    def _turning(self) -> list[bool]:
        """Of each contact whether it slips both ways."""
        ways = [{c.behind[k] for c in self.changes} for k in range(len(self.contact_names))]
        return [{2, 3} <= met for met in ways]

    @property
    def word(self) -> tuple[tuple[str, str], ...]:
        """The changes without their times: contact and what."""
        return tuple((c.contact, c.what) for c in self.changes)

    @property
    def _line(self) -> str:
        edge = "of undecided stability" if self.multiplied else "of unknown stability"
        said = {True: "stable", False: "unstable", None: edge}[self.stable]
        return f"μ = {self.mu:.6g}, {hertz(self.frequency_hz)}, {said}, with {', '.join(self.kinds)}"

    def to_json(self) -> dict[str, Any]:
        """Plain values, without the histories over the period."""
        return {
            "mu": self.mu,
            "frequency_hz": self.frequency_hz,
            "period_s": self.period,
            "stable": self.stable,
            "largest_multiplier": self.largest_multiplier if self.multiplied else None,
            "multipliers": [[float(z.real), float(z.imag)] for z in self.multipliers],
            "residual": self.residual,
            "kinds": list(self.kinds),
            "slip_amplitude": self.slip_amplitude,
            "contacts": {name: one for name, one in zip(self.contact_names, self._contacts(), strict=True)},
            "amplitudes": {
                name: {q: list(self.amplitude(q)[name]) for q in ("displacement", "velocity", "acceleration")}
                for name in self.watch_names
            },
            "changes": [
                {"time": c.time, "contact": c.contact, "what": WORDS[c.what], "behind": list(c.behind)}
                for c in self.changes
            ],
            "grazed": self.grazed if np.isfinite(self.grazed) else None,
            "landed": self.landed,
            "reached_from": self.reached_from,
            "method": self.method,
            "harmonics": self.harmonics or None,
            "untold_share": self.untold_share,
            "defect": self.defect if np.isfinite(self.defect) else None,
            "own_multiplier_off": self.own_off if np.isfinite(self.own_off) else None,
        }

    def _contacts(self) -> Iterator[dict[str, Any]]:
        for shares, slip, force in zip(self.shares, self.slip_range, self.force_range, strict=True):
            yield {
                "open": float(shares[0]), "stick": float(shares[1]), "slip": float(shares[2]),
                "slip_velocity": slip.tolist(), "normal_force": force.tolist(),
            }  # fmt: skip


def same_word(one: Cycle, other: Cycle) -> bool:
    """Whether the same contacts change in the same order, wherever the period begins."""
    first, second = one.word, other.word
    if len(first) != len(second):
        return False
    twice = second * 2
    return not first or any(twice[k : k + len(first)] == first for k in range(len(first)))

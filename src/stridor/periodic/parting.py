"""Whether motions beside one that closes after no period part from it: its two largest Lyapunov exponents.

The variation of the exact motion is followed in two directions, which are made orthonormal again every few changes of
contact (G. Benettin, L. Galgani, A. Giorgilli, J.-M. Strelcyn, Meccanica 15, 1980; through the changes as P. C. Müller,
Chaos, Solitons & Fractals 5, 1995). Along the motion itself neither parts nor closes: one exponent of a motion that
does not come to rest is zero. So on a cycle the first is zero and the second negative, on a torus both are zero, and
where the first is positive the motion is chaotic.
"""

from __future__ import annotations

import time as clock
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.special import stdtrit

from ..errors import AnalysisError
from ..temporal.steppers.exact.varied import VariedMotion
from ..typing import Array
from .problem import SlidingProblem

PARTS = 16  # that rates are taken over, to see how far they scatter
SURE = 0.999  # of the interval that a sign is told by
FAR = 10.0  # e-folds in each half: on a torus what parts does so as a power of time, a few times as far at most
OFTEN = 4  # changes of contact from one orthonormal pair to the next
LOST = 1e-12  # of the first direction: a second one that is left with so little is none


@dataclass(frozen=True)
class Unclosed:
    """A motion at ``mu`` that was followed and closed after no period.

    exponents (2,) [1/s]: the largest Lyapunov exponents, as found over ``duration`` [s] with so many ``changes`` of
    contact, behind those that were waited for; margins (2,) [1/s]: half the interval that holds each to 99.9 %, as they
    scatter over 16 parts of that time. efolds: how often by e motions beside it parted in the half in which they did so
    less. A second exponent of −inf is one of motions that come to it at once (where contacts stick).
    """

    mu: float
    exponents: tuple[float, float]
    margins: tuple[float, float]
    efolds: float
    duration: float
    changes: int
    reached_from: str = ""

    @property
    def kind(self) -> str:
        """What it is: "chaotic", "closing" (it comes slowly to a cycle) or "undecided" (on a torus, or not told)."""
        first, second = self.exponents
        if first - self.margins[0] > 0.0 and self.efolds >= FAR:
            return "chaotic"
        if abs(first) <= self.margins[0] and (second == -np.inf or second + self.margins[1] < 0.0):
            return "closing"
        return "undecided"

    @property
    def words(self) -> str:
        """What the motion is, with the numbers behind it."""
        first, margin = self.exponents[0], self.margins[0]
        over = f"over {self.changes} changes in {self.duration:.3g} s"
        if self.kind == "chaotic":
            return f"the motion is chaotic: motions beside it part at {first:.3g} ± {margin:.1g} 1/s ({over})"
        told = f"largest Lyapunov exponent {first:.2g} ± {margin:.1g} 1/s, the second {self.exponents[1]:.2g} ({over})"
        if self.kind == "closing":
            return f"motions beside it come to it, so it takes longer to come to its cycle ({told})"
        return f"whether it is quasi-periodic, chaotic or takes longer to come to its cycle is not told ({told})"

    def to_json(self) -> dict[str, Any]:
        """Plain values; None for what is −inf."""
        finite = [e if np.isfinite(e) else None for e in self.exponents]
        widths = [w if np.isfinite(w) else None for w in self.margins]
        return {
            "mu": self.mu, "reached_from": self.reached_from, "kind": self.kind, "exponents_1_s": finite,
            "margins_1_s": widths, "efolds": self.efolds, "duration_s": self.duration, "changes": self.changes,
        }  # fmt: skip

    @classmethod
    def from_json(cls, told: Any) -> Unclosed:
        """Of what `to_json` made. Raises KeyError, TypeError or ValueError where it is none."""
        first, second = (-np.inf if e is None else float(e) for e in told["exponents_1_s"])
        one, other = (np.inf if w is None else float(w) for w in told["margins_1_s"])
        return cls(
            float(told["mu"]), (first, second), (one, other), float(told["efolds"]), float(told["duration_s"]),
            int(told["changes"]), str(told["reached_from"]),
        )  # fmt: skip


def next_change(motion: VariedMotion, until: float, stop: float = np.inf) -> tuple[str, int] | None:
    """Go through the next change of contact, None where there is none before a time ``until``, or before ``stop`` [s of
    processor time]."""
    while motion.reach(until) < until and clock.process_time() < stop:
        assert motion.next is not None
        meaning, c = motion.next[1:]
        motion.passed()
        if meaning == "piece":
            return None
        if meaning != "stretch":
            return meaning, c
    return None


def parting(
    problem: SlidingProblem, motion: VariedMotion, changes: int, quiet: float, seconds: float
) -> Unclosed | None:
    """Follow a motion on, from a change of contact, over so many more and at most ``seconds`` of processor time; None
    where too few came for PARTS parts, each within ``quiet`` [s] of the last. It is moved on, with a variation of its
    own."""
    scale = np.sqrt(np.abs(problem.basis.stiffness))
    rng = np.random.default_rng(0)  # any two directions lead to the same exponents
    motion.dq, motion.dv = _directions(scale, rng)
    motion.dholds = np.zeros((problem.pairs.count, 2))
    until, begun = clock.process_time() + seconds, len(motion.words)
    times = [motion.time]
    grown: list[Array] = [np.zeros(2)]
    try:
        while len(motion.words) - begun < changes and clock.process_time() < until:
            reached = len(motion.words) + OFTEN
            while len(motion.words) < reached:
                if next_change(motion, motion.time + quiet) is None:
                    return None
            grown.append(_orthonormal(motion, scale, rng))
            times.append(motion.time)
    except AnalysisError:
        pass  # what only touched zero, or came to rest: what is known up to there counts
    # The directions have to turn to where they part first.
    first = len(times) // (PARTS + 1)
    if first < 2:
        return None
    edges = np.linspace(first, len(times) - 1, PARTS + 1).astype(int)
    rates = np.array([
        np.sum(grown[a + 1 : b + 1], axis=0) / (times[b] - times[a]) for a, b in pairwise(edges)
    ])  # fmt: skip
    lasting = times[-1] - times[first]
    total = np.sum(grown[first + 1 :], axis=0)
    halves = [float(np.sum([g[0] for g in grown[a + 1 : b + 1]])) for a, b in (edges[[0, 8]], edges[[8, 16]])]
    with np.errstate(invalid="ignore"):
        spread = np.std(rates, axis=0, ddof=1) / np.sqrt(PARTS)
    wide = float(stdtrit(PARTS - 1, 0.5 + 0.5 * SURE))
    margins = np.where(np.isfinite(spread), wide * spread, np.inf)
    return Unclosed(
        problem.value, (float(total[0] / lasting), float(total[1] / lasting)),
        (float(margins[0]), float(margins[1])), min(halves), float(lasting), len(motion.words) - begun,
    )  # fmt: skip


def _orthonormal(motion: VariedMotion, scale: Array, rng: np.random.Generator) -> Array:
    """Make the two directions of the variation orthonormal in the root of energy: logarithms (2,) of what they grew
    by."""
    stacked = np.concatenate([scale[:, None] * motion.dq, motion.dv])
    triangle = np.linalg.qr(stacked, mode="r")
    sizes = np.abs(np.diag(triangle))
    lost = np.array([sizes[0] == 0.0, sizes[1] <= LOST * sizes[0]])
    # Both came to one where contacts stuck, or nothing is left of either: what is lost begins anew.
    back = np.diag(1.0 / np.where(lost, 1.0, sizes)) if lost.any() else np.linalg.inv(triangle)
    motion.dq, motion.dv, motion.dholds = motion.dq @ back, motion.dv @ back, motion.dholds @ back
    motion.dq[:, lost], motion.dv[:, lost] = (part[:, lost] for part in _directions(scale, rng))
    motion.dholds[:, lost] = 0.0
    return np.where(lost, -np.inf, np.log(np.where(lost, 1.0, sizes)))


def _directions(scale: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """Any two, of displacement and of velocity (k, 2)."""
    soft = np.maximum(scale, 1e-3 * scale.max(initial=1.0))
    return rng.standard_normal((len(scale), 2)) / soft[:, None], rng.standard_normal((len(scale), 2))

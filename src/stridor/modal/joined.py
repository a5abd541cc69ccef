"""Modes and onsets over stretches of μ with other nodes in contact, put together to one answer.

Every stretch is a problem of its own. At a border both its neighbours are solved at the same μ, and modes that are
near each other there are the same branch; a mode that grows on one side of it only has begun or ended there.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import linear_sum_assignment

from ..sliding.stretches import Stretch
from ..typing import Array, ComplexArray, IntArray
from .onset import AT_ONSET, Onset, Onsets
from .results import ComplexModes

ALIKE = 0.1  # of |λ|: how far a mode may jump where a node opens or closes


@dataclass(frozen=True)
class TouchingChange:
    """Branch numbers and eigenvalues (b,) of the modes on both sides of a μ at which other nodes touch."""

    mu: float
    before: tuple[IntArray, ComplexArray]
    after: tuple[IntArray, ComplexArray]

    def same(self) -> dict[int, int]:
        """Number after it → number before it of modes that are one branch."""
        (numbers, values), (others, found) = self.before, self.after
        pairs = matched(values, found)
        return {int(others[j]): int(numbers[i]) for i, j in pairs}


def matched(values: ComplexArray, found: ComplexArray) -> list[tuple[int, int]]:
    """Places (i, j) of eigenvalues (a,) and (b,) that are the same mode's, each used once; NaN belongs to none."""
    mine, theirs = np.flatnonzero(np.isfinite(values)), np.flatnonzero(np.isfinite(found))
    if not len(mine) or not len(theirs):
        return []
    size = np.maximum(np.abs(values[mine])[:, None], np.abs(found[theirs]))
    distance = np.abs(values[mine][:, None] - found[theirs]) / np.maximum(size, 1e-300)
    # Something beyond the limit is as good as nothing, and must not push others out of their places.
    rows, columns = linear_sum_assignment(np.minimum(distance, ALIKE))
    return [
        (int(mine[i]), int(theirs[j])) for i, j in zip(rows, columns, strict=True) if distance[i, j] < ALIKE
    ]


class Names:
    """Branch numbers of one stretch after the other, in those of the first."""

    def __init__(self) -> None:
        self._known: dict[int, int] = {}
        self._highest = 0
        self._first = True

    def cross(self, border: TouchingChange) -> None:
        """Go on to the stretch behind a border."""
        same = border.same()
        self._known = {own: self.of(before) for own, before in same.items()}
        self._first = False

    def of(self, number: int) -> int:
        """The number that a branch of this stretch has in the answer: a new one where it was not there before."""
        if self._first:
            self._highest = max(self._highest, number)
            return number
        if number not in self._known:  # 0: one that no branch leads to
            self._highest += 1
            self._known[number] = self._highest
        return self._known[number]


def rows_of(modes: ComplexModes, rows: Sequence[int]) -> ComplexModes:
    """The modes at these of their μ alone."""
    chosen = np.asarray(rows, dtype=np.int64)
    return replace(
        modes, mu=modes.mu[chosen], eigenvalues=modes.eigenvalues[chosen], residual=modes.residual[chosen],
        right=None if modes.right is None else modes.right[chosen],
        left=None if modes.left is None else modes.left[chosen],
        completeness=tuple(modes.completeness[k] for k in rows) if modes.completeness else (),
        held=None if modes.held is None else modes.held[chosen],
        unsolved=None if modes.unsolved is None else modes.unsolved[chosen],
    )  # fmt: skip


def joined_modes(parts: Sequence[ComplexModes], borders: Sequence[TouchingChange], order: IntArray) -> ComplexModes:
    """One list of modes from those of stretches, parts[k] and parts[k + 1] at both sides of borders[k]; order (k,):
    the place of each of their μ, one part after the other, in the list."""
    names = Names()
    for number in (int(b) for part in parts[:1] for b in part.branch):
        names.of(number)
    numbers: list[list[int]] = []
    for k, part in enumerate(parts):
        if k:
            names.cross(borders[k - 1])
        numbers.append([names.of(int(b)) for b in part.branch])
    every = np.unique(np.concatenate([np.array(n, dtype=np.int64) for n in numbers]))
    columns = [np.searchsorted(every, n) for n in numbers]
    back = np.argsort(order)

    def stacked(name: str, fill: complex | float) -> Array | None:
        values: list[Array] = []
        for part, indices in zip(parts, columns, strict=True):
            own = getattr(part, name)
            if own is None:
                return None
            wide = np.full((len(part.mu), len(every), *own.shape[2:]), fill, dtype=own.dtype)
            wide[:, indices] = own
            values.append(wide)
        return np.concatenate(values)[back]

    lacks = complex(np.nan, np.nan)
    eigenvalues, residual = stacked("eigenvalues", lacks), stacked("residual", np.nan)
    assert eigenvalues is not None
    assert residual is not None
    told = [said for part in parts for said in part.completeness or ("",) * len(part.mu)]
    return replace(
        parts[0],
        mu=np.concatenate([part.mu for part in parts])[back],
        eigenvalues=eigenvalues,
        branch=every,
        residual=residual,
        right=stacked("right", lacks),
        left=stacked("left", lacks),
        open_contacts=tuple(n for n in parts[0].open_contacts if all(n in part.open_contacts for part in parts)),
        source=" and ".join(sorted({part.source for part in parts})),
        completeness=tuple(told[k] for k in back) if any(told) else (),
    )


def joined_onsets(
    parts: Sequence[tuple[Stretch, Onsets]],
    between: tuple[float, float],
    border: Callable[[int], TouchingChange],
    residual: Callable[[Stretch, float, complex], float],
    returning: Sequence[tuple[int, complex]] = (),
    asked: tuple[float, float] | None = None,
) -> Onsets:
    """One list of onsets from those of neighbouring stretches.

    border(k): both sides of the border behind parts[k]; residual(stretch, mu, λ): backward error of a mode that grows
    at a border with the nodes of a stretch. returning: number of the stretch before a border, and the λ there, of modes
    that leave the band at the border, go on growing above it and come back: their growth does not end. asked: the range
    that was asked for, where it is another.
    """
    names = Names()
    every: list[Onset] = []
    for k, (_, found) in enumerate(parts):
        if k:
            here = border(k - 1)
            begins, ends = jumps(parts[k - 1][1].at_end, found.at_start)
            staying = {
                i for i, _ in matched(np.array(ends, dtype=complex), np.array([v for b, v in returning if b == k - 1]))
            }
            ends = [lam for i, lam in enumerate(ends) if i not in staying]
            every += [_jump(parts[k - 1], here.mu, lam, here.before, names, residual, ends=True) for lam in ends]
            names.cross(here)
            every += [_jump(parts[k], here.mu, lam, here.after, names, residual, ends=False) for lam in begins]
        every += [replace(o, branches=_pair(names, o)) for o in found.onsets]
    first, last = parts[0][1], parts[-1][1]
    return replace(
        first,
        onsets=tuple(sorted(every, key=_order)),
        friction_range=between,
        at_end=last.at_end,
        unexplained=sum(found.unexplained for _, found in parts),
        unbalanced=sum(found.unbalanced for _, found in parts),
        damped=any(found.damped for _, found in parts),
        source=" and ".join(sorted({found.source for _, found in parts})),
        open_contacts=tuple(n for n in first.open_contacts if all(n in f.open_contacts for _, f in parts)),
        completeness=_told(parts, asked or between),
    )


def jumps(before: Sequence[complex], after: Sequence[complex]) -> tuple[list[complex], list[complex]]:
    """Growing modes that there are only after a border, and only before it, so that as many more eigenvalues grow
    behind it as these say: a mode that oscillates is a pair of them, and the same as one real root in no case, but as
    two that both are near it."""
    mine, theirs = np.array(before, dtype=complex), np.array(after, dtype=complex)
    ours: set[int] = set()
    others: set[int] = set()
    for oscillates in (True, False):
        pairs = matched(_only(mine, oscillates=oscillates), _only(theirs, oscillates=oscillates))
        ours |= {i for i, _ in pairs}
        others |= {j for _, j in pairs}
    _parted(mine, ours, theirs, others)
    _parted(theirs, others, mine, ours)
    return (
        [complex(v) for j, v in enumerate(theirs) if j not in others],
        [complex(v) for i, v in enumerate(mine) if i not in ours],
    )


def _parted(values: ComplexArray, known: set[int], found: ComplexArray, beside: set[int]) -> None:
    """Match pairs with two real roots each that both are near them; known and beside: what has its match, of each."""
    for i in np.flatnonzero(values.imag).tolist():
        rest = [j for j in np.flatnonzero(found.imag == 0.0).tolist() if j not in beside]
        near = [j for j in rest if matched(values[[i]], found[[j]])]
        if i not in known and len(near) >= 2:
            known.add(i)
            beside |= set(near[:2])


def _only(values: ComplexArray, *, oscillates: bool) -> ComplexArray:
    """Eigenvalues (k,) with NaN in place of those that do not oscillate, or of those that do."""
    chosen = values.copy()
    chosen[(values.imag != 0.0) != oscillates] = complex(np.nan, np.nan)
    return chosen


def _jump(
    part: tuple[Stretch, Onsets], mu: float, lam: complex, known: tuple[IntArray, ComplexArray], names: Names,
    residual: Callable[[Stretch, float, complex], float], *, ends: bool,
) -> Onset:  # fmt: skip
    """Growth that begins or ends because other nodes touch."""
    numbers, values = known
    nearest = matched(np.array([lam]), values)
    number = names.of(int(numbers[nearest[0][1]])) if nearest else names.of(0)
    return Onset(
        mu=mu, frequency_hz=abs(lam.imag) / (2 * np.pi), kind="contact", damped=part[1].damped, stabilising=ends,
        branches=(number, number), residual=residual(part[0], mu, lam), square_root_coefficient=None,
        growth_slope=None,
    )  # fmt: skip


def _pair(names: Names, onset: Onset) -> tuple[int, int]:
    first, second = sorted(names.of(number) for number in onset.branches)
    return first, second


def _order(onset: Onset) -> tuple[float, float]:
    return onset.mu, onset.frequency_hz


def _told(parts: Sequence[tuple[Stretch, Onsets]], asked: tuple[float, float]) -> str:
    """What was checked in each stretch, and of which part of the range asked for; nothing where nothing was in any."""
    if not any(found.completeness for _, found in parts):
        return ""
    held = "with the nodes of its middle" if any(s.others for s, _ in parts) else "with the nodes that touch there"
    said = [(s, found.completeness or "Not checked.") for s, found in parts]
    lead = f"{len(parts)} stretches of μ, each {held}." if len(parts) > 1 else f"One stretch of μ, {held}."
    if unsolved := _unsolved([s for s, _ in parts], asked):
        lead = f"Nothing is said of {unsolved}, where nothing was solved. {lead}"
    return f"{lead} {' '.join(by_stretch(said))}"


def _unsolved(solid: Sequence[Stretch], asked: tuple[float, float]) -> str:
    """The parts of the range asked for in which there is no stretch, "" where there are none."""
    ends = [asked[0], *(mu for s in solid for mu in (s.low, s.high)), asked[1]]
    gaps = [(a, b) for a, b in zip(ends[::2], ends[1::2], strict=True) if b - a > AT_ONSET * asked[1]]
    return " and ".join(f"μ = {a:.6g} to {b:.6g}" for a, b in gaps)


def by_stretch(told: Sequence[tuple[Stretch, str]]) -> list[str]:
    """What was checked by stretch; sentences that all of them share once, behind the others."""
    said = [_sentences(words) for _, words in told]
    shared = [s for s in said[-1] if all(s in other for other in said)] if len(said) > 1 else []
    own = [" ".join(s for s in other if s not in shared) for other in said]
    listed = [f"({s.low:.6g} to {s.high:.6g}) {words}" for (s, _), words in zip(told, own, strict=True) if words]
    lead = "In each of them: " if listed and shared else ""
    return listed + ([lead + " ".join(shared)] if shared else [])


def _sentences(text: str) -> list[str]:
    return re.split(r"(?<=\.) (?=[A-Z])", text)

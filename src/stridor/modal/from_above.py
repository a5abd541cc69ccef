"""Growth that begins above the band in one stretch of μ and comes into it in a later one.

The onset lies where nobody has looked: above the band, in a stretch in which the mode stays there. It is sought once it
is known to matter, backwards from the stretch in which the mode comes in.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..errors import AnalysisError
from ..sliding.stretches import Stretch
from .joined import matched
from .onset import NOT_COMPLETE, Onset, Onsets
from .results import grows

WIDER = 1.05  # times the frequency at which a mode was seen to grow: how far up its onset is sought

SAME = 1e-6  # of μ and frequency: an onset found again

Part = tuple[Stretch, Onsets]


@dataclass(frozen=True)
class Returning:
    """Growth that begins in the band, is above it behind a border and comes back at ``enters``: its onset, and the λ
    with which it grows at the end of the stretch ``before``; jumps: whether it leaves the band at that border."""

    onset: Onset
    before: int
    lam: complex
    enters: float
    jumps: bool

    def words(self, border: float) -> str:
        """A sentence; border: the μ of the border."""
        where = f"at μ = {border:.6g}, where other nodes touch" if self.jumps else f"before μ = {border:.6g}"
        return (
            f"The growth that begins at μ = {self.onset.mu:.6g}, {self.onset.frequency_hz:.1f} Hz, leaves the band "
            f"upwards {where}, goes on above it and comes back at μ ≈ {self.enters:.3g}."
        )


def with_origins(
    parts: Sequence[Part],
    solve: Callable[[Stretch, float], Onsets],
    residual: Callable[[Stretch, float, complex], float],
    returning: list[Returning] | None = None,
) -> list[Part]:
    """The parts, neighbouring stretches in order, with the onsets above the band of modes that come into it later.

    solve(stretch, max_frequency_hz): its onsets up to there; residual(stretch, mu, λ): backward error of a mode that
    grows with its nodes. Where an onset is not found, the part into whose band the mode comes says that it is not
    complete; what grows above it from the very start is told of the first part. What had its onset in the band, and
    left it since, is put into ``returning``.
    """
    result, returning = list(parts), [] if returning is None else returning
    for k, (_, found) in enumerate(parts):
        if k:
            result[k] = result[k][0], replace(result[k][1], entering=())
        for lam, enters in found.entering if k else ():
            _place(result, k, lam, enters, solve, residual, returning)
    return result


def _place(
    parts: list[Part], k: int, lam: complex, enters: float, solve: Callable[[Stretch, float], Onsets],
    residual: Callable[[Stretch, float, complex], float], returning: list[Returning],
) -> None:  # fmt: skip
    """Put the onset of the mode that grows with λ at the start of parts[k] where it is, in ``parts``."""
    for j in range(k - 1, -1, -1):
        (stretch, found), (beyond, other) = parts[j : j + 2]
        try:
            wider = solve(stretch, WIDER * abs(lam.imag) / (2 * np.pi))
        except AnalysisError:
            break
        ends = np.array([v for v in wider.at_end], dtype=complex)
        nearest = matched(np.array([lam]), ends)
        if not nearest:  # growing modes are others below the border: it begins there
            parts[j + 1] = beyond, _with(other, _of_contact(other, beyond, lam, residual), enters)
            return
        onset, before = _history(wider, complex(ends[nearest[0][1]]))
        if onset is not None and onset.frequency_hz <= found.max_frequency_hz:
            if not any(_same(onset, o) for o in found.onsets):
                parts[j] = stretch, _with(found, onset, None)
            end = complex(ends[nearest[0][1]])
            jumps = abs(end) <= 2 * np.pi * found.max_frequency_hz
            returning.append(Returning(onset, j, end, enters, jumps))
            return
        if onset is not None:
            parts[j] = stretch, _with(found, onset, enters)
            return
        if before is None:
            break
        lam = before
        if j == 0:
            parts[0] = stretch, replace(found, entering=(*found.entering, (lam, enters)))
            return
    stretch, found = parts[k]
    said = f"{NOT_COMPLETE}: where the growth of a mode that comes into the band at μ ≈ {enters:.3g} begins is unknown."
    parts[k] = stretch, replace(found, completeness=f"{said} {found.completeness}".strip())


def _same(one: Onset, other: Onset) -> bool:
    """Whether two are one onset, found twice."""
    near = abs(one.mu - other.mu) <= SAME * max(one.mu, other.mu)
    alike = abs(one.frequency_hz - other.frequency_hz) <= SAME * max(one.frequency_hz, other.frequency_hz)
    return near and alike and one.stabilising == other.stabilising


def _with(found: Onsets, onset: Onset, enters: float | None) -> Onsets:
    """The onsets with one more, whose mode comes into the band at ``enters``, None: which lies in it."""
    every = (*found.onsets, replace(onset, enters_at=enters))
    return replace(found, onsets=tuple(sorted(every, key=lambda o: o.mu)))


def _of_contact(
    found: Onsets, stretch: Stretch, lam: complex, residual: Callable[[Stretch, float, complex], float]
) -> Onset:
    """Growth that begins above the band where a stretch does, as other nodes touch."""
    numbers, values = found.followed[0] if found.followed is not None else (np.zeros(0), np.zeros(0, dtype=complex))
    nearest = matched(np.array([lam]), values)
    number = int(numbers[nearest[0][1]]) if nearest else 0
    return Onset(
        stretch.low, abs(lam.imag) / (2 * np.pi), "contact", found.damped, False, (number, number),
        residual(stretch, stretch.low, lam), None, None,
    )  # fmt: skip


def _history(found: Onsets, end: complex) -> tuple[Onset | None, complex | None]:
    """Of the branch that grows with λ at the end of a stretch: the onset that its growth goes back to, or the λ with
    which it grows where the stretch begins; None for what there is not."""
    if found.followed is None:
        return None, None
    (first, starts), (numbers, ends) = found.followed
    number = int(numbers[np.argmin(np.abs(ends - end))])
    mine = [o for o in found.onsets if number in o.branches]
    if mine:
        return (None if mine[-1].stabilising else mine[-1]), None
    at_start = [complex(v) for v in starts[first == number]]
    growing = [v for v in at_start if grows(np.array([v]), abs(v))[0]]
    return None, growing[0] if growing else None

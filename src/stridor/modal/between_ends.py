"""What grows within a range of μ and no longer at its end, of small systems: branches must lead to it, too.

A mode that starts far above the band may begin to grow there, come into it and cease to grow again, which neither end
tells. Small systems cost next to nothing at a few μ between.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from ..errors import AnalysisError
from ..system import System
from ..typing import BoolArray, ComplexArray
from .complex_modes import complex_modes
from .full.growth import growing_roots
from .growing import Growing, growing_modes, missing
from .krylov.problem import ContactProblem, problem_of
from .onset import AT_ONSET, Onsets
from .options import Options
from .quadratic.dense import all_modes
from .tolerances import SPLIT_RELATIVE, UNSTABLE_RELATIVE

SMALL = 40  # freedoms up to which a few μ between the ends are looked at
INTERVALS = 12
DOUBLE = 1e-8  # of λ: modes no further from one another are one
MARGIN = 1.01  # times the highest frequency: every branch


@dataclass(frozen=True)
class Between:
    """How many μ were looked at, at how many of them other numbers of roots grow than the onsets say, and growing modes
    (k,) to which no branch leads by the μ at which they were found."""

    looked: int
    lacking: tuple[tuple[float, ComplexArray], ...] = ()
    odd: int = 0

    @property
    def words(self) -> str:
        """A sentence where the onsets account for all that was found, "" where nothing was looked at."""
        return f" As many roots grow at each of {self.looked} further values as the onsets say." if self.looked else ""

    @property
    def amiss(self) -> list[str]:
        """What is wrong where the onsets do not account for what grows, though branches lead to it."""
        if not self.odd:
            return []
        where = f"all {self.looked}" if self.odd == self.looked else f"{self.odd} of {self.looked}"
        return [f"at {where} values looked at between them other numbers of roots grow than the onsets say"]


NOT_LOOKED = Between(0)


def between_ends(
    system: System, found: Onsets, start: Growing, *, follow: float, damped: bool, options: Options
) -> Between:
    """What grows in the band between the ends of the range of some onsets, held against branches that start up to
    ``follow`` times the band wherever the onsets do not account for it."""
    if system.size > SMALL:
        return NOT_LOOKED
    low, high = found.friction_range
    inner = [mu for mu in np.linspace(low, high, INTERVALS + 1)[1:-1].tolist() if not _at_onset(found, mu)]
    try:
        problem = problem_of(system if damped else system.undamped(), None, options)
        differ = [mu for mu in inner if not _as_said(found, start, mu, _growing_roots(problem, mu, start))]
        seen = (
            growing_modes(system, mu, found.max_frequency_hz, touching_at=None, damped=damped, options=options)
            for mu in differ
        )
        odd = [g for g in seen if not _as_said(found, start, g.mu, growing_roots(g.values), twice(g.values))]
        if not odd:
            return Between(len(inner))
        # The high end beside them: of one μ alone those nodes would touch that do so there.
        modes = complex_modes(
            system, [*(g.mu for g in odd), high], max_frequency_hz=follow * found.max_frequency_hz, damped=damped,
            **asdict(options),
        )  # fmt: skip
    except AnalysisError:
        return NOT_LOOKED
    lacking = ((g.mu, _unled(g, modes.eigenvalues[row], modes.unstable[row])) for row, g in enumerate(odd))
    return Between(len(inner), tuple((mu, values) for mu, values in lacking if len(values)), len(odd))


def every_branch(system: System, found: Onsets, *, damped: bool, options: Options) -> float | None:
    """How many times the band all branches of a small system start at most; None of others."""
    if system.size > SMALL:
        return None
    try:
        problem = problem_of(system if damped else system.undamped(), None, options)
        values = all_modes(problem.pencil(0.0).condensed())[0]
    except AnalysisError:
        return None
    return MARGIN * float(np.abs(values).max(initial=0.0)) / (2 * np.pi * found.max_frequency_hz)


def twice(values: ComplexArray) -> int:
    """How many roots of growing modes (k,) are of others once more: an onset of modes that are one is listed once."""
    ordered = values[np.lexsort((values.real, values.imag))]
    same = np.abs(np.diff(ordered)) <= DOUBLE * np.abs(ordered[1:])
    return growing_roots(ordered[1:][same])


def _as_said(found: Onsets, start: Growing, mu: float, roots: int, more: int = 0) -> bool:
    """Whether as many roots grow in the band at μ as what grows at the low end, the onsets below it and the branches
    that have passed the end of the band say, or up to ``more`` beyond that."""
    if found.at_top is None:
        passed = [o.roots for o in found.onsets if (o.mu if o.enters_at is None else o.enters_at) < mu]
        least = most = growing_roots(start.values) + sum(passed) + 2 * sum(at < mu for _, at in found.entering)
    else:
        inside = sum(o.roots for o in found.onsets if o.enters_at is None and o.mu < mu)
        over = [
            (p.least, p.most) if p.high <= mu else (min(p.least, 0), max(p.most, 0))
            for p in found.at_top
            if p.low < mu
        ]
        said = growing_roots(start.values) + inside
        least, most = said - sum(up for _, up in over), said - sum(low for low, _ in over)
    # Rounding decides whether what begins or ends at the low end itself grows there.
    low, high = found.friction_range
    # What grows as slowly as motions as a whole may be is not sought beside them.
    slow = 2 * start.still / (2 * np.pi)
    there = [o.roots for o in found.onsets if abs(o.mu - low) <= AT_ONSET * high or 0.0 < o.frequency_hz <= slow]
    return least - sum(r for r in there if r > 0) <= roots <= most + more - sum(r for r in there if r < 0)


def _at_onset(found: Onsets, mu: float) -> bool:
    """Whether growth begins or ends, or comes into the band, at μ but for rounding."""
    places = [at for o in found.onsets for at in (o.mu, o.enters_at) if at is not None]
    places += [at for _, at in found.entering]
    return any(abs(at - mu) <= AT_ONSET * found.friction_range[1] for at in places)


def _growing_roots(problem: ContactProblem, mu: float, start: Growing) -> int:
    """How many eigenvalues grow in the band at μ, as QZ leaves them; what may be at rest does not count."""
    values = all_modes(problem.pencil(mu).condensed(), start.top)[0]
    rounding = UNSTABLE_RELATIVE if problem.damped else SPLIT_RELATIVE
    size = np.abs(values)
    inside = (values.imag >= 0.0) & (values.imag <= start.top) & (size > start.still)
    return growing_roots(values[inside & (values.real > rounding * size)])


def _unled(growing: Growing, listed: ComplexArray, unstable: BoolArray) -> ComplexArray:
    """Growing modes (k,) to which no branch leads. Of one that has fallen apart on the real axis the list has one half
    alone."""
    lacking = growing.values[missing(growing, listed, unstable)]
    fallen = unstable & (listed.imag == 0.0) & (listed.real > growing.still)
    if np.count_nonzero(lacking.imag == 0.0) <= np.count_nonzero(fallen):
        lacking = lacking[lacking.imag != 0.0]
    return lacking

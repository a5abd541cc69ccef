"""The one search for onsets of a family: branches followed where they can be, growing roots counted where not.

What counts is that at every value looked at as many roots grow as the onsets say. Followed branches are held against
a count at both ends, in the full problem, and between every two onsets; where they fail that, or cannot be followed,
the growing roots are counted on a grid and the onsets enclosed between its values (`counted`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...errors import AnalysisError
from ...typing import ComplexArray
from ..at_rest import more_slow, moving
from ..histories import within_rounding
from ..onset import Onset
from ..quadratic import RegionModes
from .axis import walked
from .basis import DENSE, WHOLE, Along, Whole, along
from .branches import BranchOnset, all_values, solved
from .counted import ALIKE, ON_IT, Counted, Lack, Passing, as_onset, beyond, counted, number_at, opened_in
from .family import Family
from .follow import BEYOND, Followed
from .foretold import changes_within
from .growth import growing_roots, unstable

FINER = 6  # times as many steps where the count at the ends does not agree
EVEN = 8  # values at which followed branches are held against a count, beside those between the onsets
CLOSE_BY = 95  # of problems up to CHEAP unknowns
CHEAP = 100
WITHIN = 8  # values within a step of full solves where slopes foretell a change
FINEST = 3e-4  # of the range: steps on a basis that foretell one are halved until then
SMALL = 600  # unknowns up to which all eigenvalues are found at once
ON_EDGE = 1e-6  # of the highest frequency: modes so near it may count on one side only


@dataclass(frozen=True)
class Answer:
    """Onsets in ascending order; complete: whether as many roots grow wherever that was looked at as they say, and
    one of them begins whatever comes into the band.

    way: the branches, where following them led to all. seen: what was counted instead; lacks: where that and the
    onsets differ. why: what kept branches from being followed, if anything did. walked: at how many ω the imaginary
    axis was looked at, where that led to the onsets (`axis`). values: at how many μ the onsets of followed branches
    were held against a count. slow [1/s]: up to which |λ| modes at the ends cannot be told from motions as a whole,
    where there are more of them than such motions. entering: λ of branches that grow above the band at the low end, and
    the μ at which they come into it.
    """

    onsets: tuple[Onset, ...]
    complete: bool
    way: Followed | None = None
    seen: Counted | None = None
    lacks: tuple[Lack, ...] = ()
    why: str = ""
    walked: int = 0
    values: int = 0
    slow: float = 0.0
    entering: tuple[tuple[complex, float], ...] = ()

    @property
    def vouched(self) -> bool:
        """Whether it is complete, and nothing hides among motions as a whole."""
        return self.complete and not self.slow

    @property
    def passing(self) -> tuple[Passing, ...]:
        """Growing modes that pass the highest frequency, where that was counted."""
        return () if self.seen is None else self.seen.passing

    @property
    def unplaced(self) -> tuple[Passing, ...]:
        """Those that come into the band, none having left it before, whose growth no onset that is listed begins and
        which do not grow from the low end on."""
        came: list[Passing] = []
        left, listed = 0, sum(o.enters_at is not None for o in self.onsets) + len(self.entering)
        for one in self.passing:
            if one.roots > 0 and not left:
                came.append(one)
            left = max(0, left - np.sign(one.roots))
        return tuple(came[listed:])


def search(
    family: Family, make: Sequence[Callable[[], Along]], between: tuple[float, float],
    ends: tuple[RegionModes, RegionModes], top: float, why: str = "",
) -> Answer:  # fmt: skip
    """Every onset of a family in a range up to the angular frequency top [1/s].

    make: sources of eigenpairs, each tried where the one before it does not do. ends: all modes of the band at both
    ends, found in the full problem. why: what keeps branches from being followed, where nothing is made. Raises
    AnalysisError where there is no source, nor one by full solves.
    """
    answer = _searched(family, make, between, ends, top, why)
    for mu, end in zip(between, ends, strict=True):
        slow = end.values[~moving(end.values, top, lambda: family.rest_limit(top))]
        if more_slow(family.built(mu), slow, top, family.options.solver):
            return replace(answer, slow=family.rest_limit(top))
    return answer


def _searched(
    family: Family, make: Sequence[Callable[[], Along]], between: tuple[float, float],
    ends: tuple[RegionModes, RegionModes], top: float, why: str,
) -> Answer:  # fmt: skip
    """See `search`."""
    source, best = None, None
    for number, way_to in enumerate(make):
        try:
            source = way_to()
            # Where every step is a full solve, a count costs less than finer steps.
            for finer in (1, FINER)[number > 0 : 1 if source.whole else 2]:
                found, way, complete = solved(source, between, ends, top, finer)
                best = Answer(_wanted(found, between, top), complete, way, entering=way.entering)
                if complete:
                    break
        except AnalysisError as error:
            why = str(error)
            break
        if best is not None and best.complete:
            break
    within: Sequence[float] = ()
    if best is not None and best.complete:
        held = _borne_out(best, between, top)
        lacks = [] if held is None else held.lacking([o for o in best.onsets if _in_band(o, top)])
        if not lacks:
            return replace(best, values=0 if held is None else len(held.grid))
        within = sorted({mu for lack in lacks for mu in (lack.low, lack.high)})
    if source is None or source.whole:
        answer = _walked(family, between, ends, top, why)
        if answer is not None:
            return answer
    seen = counted(_beside(family, source, top, why), between, top, within)
    return _counted_answer(family, best, seen, ends, top, why)


def _wanted(found: Sequence[BranchOnset], between: tuple[float, float], top: float) -> tuple[Onset, ...]:
    """Those of the range in the band, or above it and leading into it."""
    low, high = between
    inside = [
        f.onset for f in found
        if low <= f.onset.mu <= high and (_in_band(f.onset, top) or f.onset.enters_at is not None)
    ]  # fmt: skip
    return tuple(sorted(inside, key=_order))


def _order(onset: Onset) -> tuple[float, float]:
    return onset.mu, onset.frequency_hz


def _in_band(onset: Onset, top: float) -> bool:
    return 2 * np.pi * onset.frequency_hz <= top * (1 + 1e-12)


def _borne_out(answer: Answer, between: tuple[float, float], top: float) -> Counted | None:
    """What grows at values between the onsets and between the steps, where that is counted: branches that meet and part
    again within one step leave nothing at its ends."""
    way = answer.way
    assert way is not None, "of followed branches"
    source = way.source
    opened = opened_in(source, between[0], top)
    if source.whole and source.family.size > SMALL:
        # Every value is a full solve, as every step is.
        if not opened:
            return None
        values = _sampled(answer.onsets, between)
    else:
        cheap = _unknowns(source) <= CHEAP
        values = _sampled(answer.onsets, between, CLOSE_BY if cheap else EVEN)
        if cheap:
            within = [mu for step in way.foretold for mu in _within(source, step, between, top)]
            values = sorted({*values, *(mu for mu in within if between[0] < mu < between[1])})
    values = sorted({*values, *beyond(opened, between[0], values[1])})
    number = _number_by(source.family, top)
    # What opens at the low end is not seen to grow before its series says so.
    hidden = max((o.until for o in opened), default=-1.0)
    by_itself = source.whole and source.family.size <= SMALL

    def roots(mu: float) -> int:
        return number(mu) if by_itself and mu - source.family.low > hidden else number_at(source, mu, top, opened)

    return Counted(tuple((mu, roots(mu)) for mu in values), (), (), source.family.rest_limit(top))


def _within(source: Along, step: tuple[float, float], between: tuple[float, float], top: float) -> list[float]:
    """Values within a step in which slopes foretell a change: a few in equal distances where every value is a full
    solve; on a basis its middle, and so on within those of its halves that foretell one as well."""
    low, high = step
    if source.whole:
        return np.linspace(low, high, WITHIN + 2)[1:-1].tolist()
    middle, start = 0.5 * (low + high), source.family.low
    if high - low <= FINEST * (between[1] - between[0]):
        return [middle]
    found = [middle]
    for half in ((low, middle), (middle, high)):
        width = half[1] - half[0]
        if any(
            changes_within(source.family, source.eigenpairs(mu - start), way, top)
            for mu, way in zip(half, (width, -width), strict=True)
        ):
            found += _within(source, half, between, top)
    return found


def _unknowns(source: Along) -> int:
    return source.family.size if source.whole else source.eigenpairs(0.0).right.shape[0]


def _sampled(onsets: Sequence[Onset], between: tuple[float, float], even: int = EVEN) -> list[float]:
    """Where growing roots are counted: both ends, between every two onsets, and some in equal distances."""
    (low, high), values = between, sorted({o.mu for o in onsets})
    middles = [0.5 * (a + b) for a, b in zip([low, *values], [*values, high], strict=True)]
    return sorted({low, high, *middles, *np.linspace(low, high, even + 2)[1:-1].tolist()})


def _walked(
    family: Family, between: tuple[float, float], ends: tuple[RegionModes, RegionModes], top: float, why: str
) -> Answer | None:
    """Onsets found along the imaginary axis, where as many roots grow between every two of them as they say; None where
    that does not apply or they are not all."""
    walk = walked(family, between, top, ends[0].values)
    if walk is None:
        return None
    every = sorted((as_onset(family, root) for root in walk.roots), key=_order)
    rounding = within_rounding(every, _values_by(family, top))
    onsets = tuple(o for k, o in enumerate(every) if k not in rounding)
    number = _number_by(family, top)
    grid = tuple((mu, number(mu)) for mu in _sampled(onsets, between))
    seen = Counted(grid, onsets, (), family.rest_limit(top))
    if seen.lacking(onsets) or not _ends_agree(family, seen, ends, top):
        return None
    inside = tuple(o for o in onsets if between[0] <= o.mu <= between[1])
    return Answer(inside, True, None, seen, (), why, walk.values)


def _values_by(family: Family, top: float) -> Callable[[float], ComplexArray]:
    """λ at a μ that may grow, in the full problem."""
    if family.size > SMALL:
        source = Whole(family, top, beside=True)
        return lambda mu: source.eigenpairs(mu - family.low).values
    return lambda mu: all_values(family, mu, top)


def _number_by(family: Family, top: float) -> Callable[[float], int]:
    """How many roots grow at a μ, counted in the full problem."""
    if family.size > SMALL:
        source = Whole(family, top, beside=True)
        return lambda mu: number_at(source, mu, top)

    def number(mu: float) -> int:
        values = all_values(family, mu, top)
        values = values[(values.imag >= 0) & (np.abs(values) <= top)]
        return growing_roots(values[unstable(family, values, top)])

    return number


def _beside(family: Family, source: Along | None, top: float, why: str) -> Along:
    """What the growing roots are counted on: the basis that branches were followed on, else full solves for what is
    near the axis alone."""
    if source is not None and not source.whole:
        return source
    if family.size <= DENSE and family.form is not None:
        return along(family, BEYOND * top)
    if family.size > WHOLE:
        raise AnalysisError(why or f"the problem has {family.size} unknowns, and no reduced model")
    source = Whole(family, top, beside=True)
    source.find_at_rest()
    return source


def _counted_answer(
    family: Family, best: Answer | None, seen: Counted, ends: tuple[RegionModes, RegionModes], top: float, why: str
) -> Answer:
    """The list of onsets that what was counted bears out: of branches, of the count, or of both."""
    followed = () if best is None else best.onsets
    beyond_band = tuple(o for o in followed if not _in_band(o, top))
    inside = tuple(o for o in followed if _in_band(o, top))
    width = seen.grid[-1][0] - seen.grid[0][0]
    both = (*inside, *(o for o in seen.onsets if not any(_same(o, other, width, top) for other in inside)))
    onsets, way = both, None
    if followed and not seen.lacking(inside):
        onsets, way = inside, best.way if best is not None else None
    elif not seen.lacking(seen.onsets):
        onsets = seen.onsets
    lacks = seen.lacking(onsets)
    agree = _ends_agree(family, seen, ends, top)
    every = tuple(sorted((*onsets, *beyond_band), key=_order))
    grown = () if best is None else best.entering
    answer = Answer(
        every, not lacks and agree, way, seen, tuple(lacks), why, values=len(seen.grid), entering=grown
    )
    return replace(answer, complete=answer.complete and not answer.unplaced)


def _same(one: Onset, other: Onset, width: float, top: float) -> bool:
    near = abs(one.mu - other.mu) <= 1e-8 * width and one.roots == other.roots
    return near and 2 * np.pi * abs(one.frequency_hz - other.frequency_hz) <= ALIKE * top


def _ends_agree(family: Family, seen: Counted, ends: tuple[RegionModes, RegionModes], top: float) -> bool:
    """Whether as many roots were counted at both ends as the full problem has there."""
    for (mu, number), end in zip((seen.grid[0], seen.grid[-1]), ends, strict=True):
        size = np.abs(end.values)
        slack = 2 * int(np.count_nonzero(np.abs(size - top) <= ON_EDGE * top))
        # What begins on the very end is within rounding there; what lies beside it may or may not be.
        near = ON_IT * (family.high - family.low)
        beside = (o for o in seen.onsets if abs(o.mu - mu) <= near and (o.stabilising or o.mu != mu))
        slack += sum(abs(o.roots) for o in beside)
        if abs(number - growing_roots(end.values[unstable(family, end.values, top) & (size <= top)])) > slack:
            return False
    return True

"""What is said of a list of onsets: whether as many roots grow as they say, and how that was found."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..at_rest import slow_words
from ..quadratic import RegionModes
from .basis import Projected
from .branches import all_values
from .counted import Passing
from .family import Family
from .growth import growing_roots, unstable
from .search import SMALL, Answer

UNFOLLOWED = "branches not followed"
MOST = 4  # places that are named one by one
BARELY = 1e-4  # of the highest frequency: what is no faster may be the one that begins or ends


def sentence(
    family: Family, answer: Answer, ends: tuple[RegionModes, RegionModes], top: float, name: str,
    value: Callable[[float], float], where: str = "", lead: str = "",
) -> str:  # fmt: skip
    """What speaks for these onsets being all, or where they are not. name: of the parameter, value(μ) what it is there;
    top [1/s]: the end of the band; where: what was searched, if not the full problem; lead: what is said in place of
    Complete, where something else keeps the list from being that."""
    if answer.slow:
        faster = sentence(family, replace(answer, slow=0.0), ends, top, name, value, where, lead)
        return f"Not complete: there are {slow_words(answer.slow)}. Of faster ones: {faster}"
    first, last = (int(np.count_nonzero(unstable(family, end.values, top))) for end in ends)
    low, high = (f"{value(mu):g}" for mu in _between(family, answer))
    numbers = f"{_modes(first)} at {name} = {low} and {last} at {name} = {high}"
    if where:
        numbers = f"{where} {numbers}"
    passing = _passing(answer.passing, name, value) + _beside(family, answer, top, name, value)
    if not answer.complete:
        numbers += "" if where else ", found in the full problem"
        return f"Not complete: {numbers}, but {_lacking(answer, name, value)}.{passing}"
    if answer.way is None:
        assert answer.seen is not None, "what else would have led to it"
        as_many = f"{lead}, as many" if lead else "As many"
        how = f"{as_many} roots grow at each of {len(answer.seen.grid)} values of {name} as the onsets say"
        numbers += _pairs(family, answer, ends, top)
        why = f": {_named(answer.why, name, value)}" if answer.why else ""
        if answer.walked:
            return (
                f"{how}: {numbers}.{passing} Onsets were sought along the imaginary axis, at {answer.walked} "
                f"frequencies up to {top / (2 * np.pi):g} Hz, and {UNFOLLOWED}{why}."
            )
        return (
            f"{how}: {numbers}.{passing} Onsets were enclosed by that count, and {UNFOLLOWED}{why}; growth "
            "that begins and ends again, or ends and begins, between two of these values may be missing."
        )
    said = f"as the onsets say{_across(family, answer, ends, top)}"
    told = _followed(answer, name, value, where)
    both = all(end.completeness.complete for end in ends)
    if not both:
        unsure = next(end.completeness.sentence for end in ends if not end.completeness.complete)
        return f"{told}; {numbers}, {said}.{passing} {unsure} {_between_steps(answer, name)}"
    counted = "by QZ" if ends[1].completeness.sentence.startswith("Complete: QZ") else "in discs that cover the band"
    if ends[1].completeness.counted is not None:
        counted += ", counted by the argument principle"
    whole = where or "in the full problem"
    anew = f"All modes up to {top / (2 * np.pi):g} Hz at both ends were found anew {whole} ({counted})"
    between = _between_steps(answer, name)
    return f"{lead or 'Complete as far as both ends tell'}: {numbers}, {said}.{passing} {told}. {anew}. {between}"


def _named(why: str, name: str, value: Callable[[float], float]) -> str:
    """A reason of what follows branches, which calls every parameter mu, in terms of this one."""
    return re.sub(r"\bmu = ([-+.e\d]*\d)", lambda found: f"{name} = {value(float(found[1])):.6g}", why)


def _between_steps(answer: Answer, name: str) -> str:
    """What was looked at between both ends, and what that leaves out."""
    missing = "growth that begins and ends again, or ends and begins,"
    if not answer.values:
        return f"Between the ends nothing was counted: {missing} within one of the steps may be missing."
    return (
        f"As many roots grow at each of {answer.values} values of {name} as the onsets say; {missing} between two of "
        "these values may be missing."
    )


def _between(family: Family, answer: Answer) -> tuple[float, float]:
    if answer.seen is not None:
        return answer.seen.grid[0][0], answer.seen.grid[-1][0]
    assert answer.way is not None, "what else would have led to it"
    return family.low + answer.way.low.mu, family.low + answer.way.high.mu


def _followed(answer: Answer, name: str, value: Callable[[float], float], where: str) -> str:
    way = answer.way
    assert way is not None, "asked for where branches led to all"
    source = way.source
    how = {True: ", solved in full at every step", False: " on the matrices themselves"}[source.whole]
    how = "" if where else how
    if isinstance(source, Projected) and source.model is not None:
        how = f" on a reduced model of {source.model.size} unknowns"
    told = f"{len(way.low.index)} branches were followed from {name} = {value(source.family.low):g}{how}"
    if way.unsure:
        at = ", ".join(f"{value(mu):.6g}" for mu in way.unsure[:3])
        told += f" (which is which was not clear at {name} = {at}: numbers beyond may be exchanged)"
    return told


def _lacking(answer: Answer, name: str, value: Callable[[float], float]) -> str:
    """Where what is counted is not what the onsets say."""
    unplaced = ", ".join(f"{value(p.mu):.4g}" for p in answer.unplaced[:MOST])
    if not answer.lacks and unplaced:
        return f"where growth begins, above the band, that comes into it at {name} ≈ {unplaced} was not found"
    if not answer.lacks:
        return "what was counted there is not the same"
    differences = [
        f"between {name} = {' and '.join(_apart(value(lack.low), value(lack.high)))} the number of growing roots "
        f"changes by {_signed(lack.seen)}, and by the onsets by {_signed(lack.said)}"
        for lack in answer.lacks[:MOST]
    ]
    more = len(answer.lacks) - len(differences)
    return "; ".join([*differences, *([f"and in {more} more places"] if more else [])])


def _apart(low: float, high: float) -> tuple[str, str]:
    """Both ends of an interval with as many digits, six at least, as tell them apart."""
    for digits in range(6, 17):
        if (told := (f"{low:.{digits}g}", f"{high:.{digits}g}"))[0] != told[1]:
            return told
    return f"{low!r}", f"{high!r}"


def _signed(number: int) -> str:
    return f"{number:+d}" if number else "0"


def _passing(passing: tuple[Passing, ...], name: str, value: Callable[[float], float]) -> str:
    """Modes that come into the band or leave it while they grow."""
    if not passing:
        return ""
    told = [
        f"1 {'comes into the band' if p.roots > 0 else 'leaves the band'} at {name} ≈ {value(p.mu):.4g} "
        f"({abs(p.lam.imag) / (2 * np.pi):.6g} Hz, +{p.lam.real:.4g} 1/s)"
        for p in passing[:MOST]
    ]
    more = f"; {len(passing) - MOST} more do one or the other" if len(passing) > MOST else ""
    return f" Of the growing modes {'; '.join(told)}{more}."


def _beside(family: Family, answer: Answer, top: float, name: str, value: Callable[[float], float]) -> str:
    """Divergences that begin or end while another motion without oscillation grows: half of a growing pair that reached
    the real axis ends, and the mode grows on; or one more begins, and both may become a growing pair."""
    if family.size > SMALL:
        return ""
    told = list[str]()
    for one in answer.onsets:
        if one.kind != "divergence" or len(told) == MOST:
            continue
        values = all_values(family, one.mu, top)
        # In the band, as everywhere: rigid contacts have infinite ones, of which rounding makes any number.
        real = values[(values.imag == 0) & (np.abs(values) <= top)]
        # Without the one at zero.
        others = np.delete(real, np.argmin(np.abs(real))) if len(real) else real
        count = int(np.count_nonzero(unstable(family, others, top, BARELY)))
        if count:
            ends, on = ("ends", "goes on") if one.stabilising else ("begins", "grows already")
            number = "another" if count == 1 else f"{count} others"
            on = on if count == 1 else on.replace("goes", "go").replace("grows", "grow")
            told.append(f"at {name} = {value(one.mu):.6g} one {ends} and {number} {on}")
    return f" Of the growing motions without oscillation, {'; '.join(told)}." if told else ""


def _across(family: Family, answer: Answer, ends: tuple[RegionModes, RegionModes], top: float) -> str:
    """Words for what changes the number of growing modes beside the onsets: modes that cross the border of the band
    while they grow, and pairs that become two real roots."""
    across = _changes(family, answer, ends, top)[0]
    limit = f"{top / (2 * np.pi):g} Hz"
    if across and across == sum(p.roots for p in answer.passing):
        return f" with those that pass {limit} while they grow"
    if across:
        count = (abs(across) + 1) // 2
        how = "whose growth began above" if across > 0 else "that went on growing above"
        return f" but for {count} {how} {limit}"
    return _pairs(family, answer, ends, top)


def _pairs(family: Family, answer: Answer, ends: tuple[RegionModes, RegionModes], top: float) -> str:
    """Words for growing pairs that become two real roots, and the other way round, which no onset is of."""
    across, more = _changes(family, answer, ends, top)
    if across or not more:
        return ""
    pairs = "a growing pair" if abs(more) == 1 else f"{abs(more)} growing pairs"
    how, each = "parted into" if more > 0 else "came of", " each" if abs(more) > 1 else ""
    return f" ({pairs} {how} two growing motions without oscillation{each})"


def _changes(
    family: Family, answer: Answer, ends: tuple[RegionModes, RegionModes], top: float
) -> tuple[int, int]:
    """By how much the numbers of growing roots, and of growing modes, change from end to end beside the onsets."""
    first, last = (end.values[unstable(family, end.values, top)] for end in ends)
    signs = [-1 if o.stabilising else 1 for o in answer.onsets]
    roots = [2 if o.frequency_hz > 0.0 else 1 for o in answer.onsets]
    across = growing_roots(last) - growing_roots(first) - sum(s * r for s, r in zip(signs, roots, strict=True))
    return across, len(last) - len(first) - sum(signs)


def _modes(count: int) -> str:
    return f"{count} mode grows" if count == 1 else f"{count} modes grow"

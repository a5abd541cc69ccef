"""The check of onsets: what grows at both ends of the range is sought anew, and must go back to what is listed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial

import numpy as np

from ..digits import hertz
from ..errors import AnalysisError
from ..system import System
from ..typing import ComplexArray, IntArray
from .between_ends import DOUBLE, Between, between_ends, every_branch, twice
from .full.growth import growing_roots
from .growing import CHECKED, UNCHECKED, WIDER, Growing, affordable, growing_modes, missing, too_large, unconfirmed
from .joined import matched
from .krylov import Carried
from .onset import AT_ONSET, NOT_COMPLETE, Onset
from .onsets import FOLLOW, Onsets, onsets
from .options import Options
from .results import grows
from .tolerances import SPLIT_RELATIVE, UNSTABLE_RELATIVE

MOST = 4  # that are named
UNSURE = 2.0  # times the growth that counts


def checked_onsets(
    system: System,
    found: Onsets,
    *,
    damped: bool,
    options: Options | None = None,
    follow: Sequence[float] = WIDER,
    numbered_at: float = 0.0,
    carried: Carried | None = None,
    before: Sequence[complex] | None = None,
) -> Onsets:
    """The onsets with what grows at both ends of the range sought anew in the full problem.

    found: as `onsets` gives them; where a mode grows in the band at the high end that branches do not lead to, they are
    solved again with branches that start up to ``follow`` times the band, and of small systems with all, from
    ``numbered_at`` on and with ``carried`` as in `onsets`. before: what the full problem has at the low end with the
    nodes that touch below it; where the branches say the same of this side, nothing is sought there again. Of small
    systems a few μ between are looked at as well. ``completeness`` says what came of it, ``at_start`` and ``at_end``
    are what the full problem has.
    """
    options = options or Options()
    if not affordable(system):
        return replace(found, completeness=f"{UNCHECKED}: {too_large(system)}.")
    try:
        low, high = (
            partial(growing_modes, system, mu, found.max_frequency_hz, touching_at=None, damped=damped, options=options)
            for mu in found.friction_range
        )
        end = high()
        start = _as_before(found, before, end.top) or low()
    except AnalysisError as error:
        said = f"{NOT_COMPLETE}: what grows at both ends was not found."
        return replace(found, completeness=f"{said} {UNCHECKED}: {error}.")
    between = between_ends(system, found, start, follow=FOLLOW, damped=damped, options=options)
    for wider in (*follow, *([None] if follow else [])):
        amiss = len(_unled(found, start, end)[1]) or found.unexplained or found.unbalanced
        if not (amiss or between.lacking):
            break
        if wider is None and (wider := every_branch(system, found, damped=damped, options=options)) is None:
            break
        try:
            found = onsets(
                system, found.friction_range, max_frequency_hz=found.max_frequency_hz, damped=damped, follow=wider,
                numbered_at=numbered_at,
                carried=carried, **asdict(options),
            )  # fmt: skip
        except AnalysisError:
            break
        between = between_ends(system, found, start, follow=wider, damped=damped, options=options)
    at_start, at_end = (tuple(complex(v) for v in e.values) for e in (start, end))
    return replace(found, at_start=at_start, at_end=at_end, completeness=_sentence(found, start, end, between))


def _as_before(found: Onsets, before: Sequence[complex] | None, top: float) -> Growing | None:
    """What the branches say of the low end, where it is what grows in the full problem with the nodes that touch below
    it; None where they differ, or where that is not known."""
    values = np.array(found.at_start, dtype=complex)
    known = np.array(before or (), dtype=complex)
    if before is None or len(known) != len(values) or len(matched(known, values)) < len(values):
        return None
    nothing = np.zeros((0, len(values)), dtype=complex)
    low = found.friction_range[0]
    return Growing(low, values, nothing, np.zeros(len(values)), values[:0], True, "", top, sought=False)


def sought_at_end(found: Onsets | None, mu: float) -> tuple[complex, ...] | None:
    """What was found to grow in the full problem where a range with all its onsets ends; None where it does not end at
    ``mu`` or was not checked."""
    if found is None or found.friction_range[1] != mu or not found.completeness.startswith(CHECKED):
        return None
    return found.at_end


def _not_in(found: Growing, known: tuple[complex, ...]) -> IntArray:
    values = np.array(known, dtype=complex)
    return missing(found, values, np.ones(len(values), dtype=bool))


def _unled(found: Onsets, start: Growing, end: Growing) -> list[ComplexArray]:
    """Growing modes at both ends that no branch leads to. Of a branch that has fallen apart on the real axis the other
    half is led to as well, where as many roots grow as the onsets say."""
    whole = found.followed is not None and not _roots_amiss(found, start, end)
    result: list[ComplexArray] = []
    for k, (growing, known) in enumerate(((start, found.at_start), (end, found.at_end))):
        lacking = growing.values[_not_in(growing, known)]
        if whole and found.followed is not None:
            branches = found.followed[k][1]
            fallen = (branches.imag == 0) & (branches.real > growing.still)
            if np.count_nonzero(lacking.imag == 0) <= np.count_nonzero(fallen):
                lacking = lacking[lacking.imag != 0]
        result.append(lacking)
    return result


def _sentence(found: Onsets, start: Growing, end: Growing, between: Between) -> str:
    """What the full problem says of both ends, and between them, beside the onsets."""
    low, high = found.friction_range
    numbers = f"{start.words} at μ = {low:g} and {end.words} at μ = {high:g}, sought anew in the full problem"
    if not start.sought:
        numbers = (
            f"{end.words} at μ = {high:g}, sought anew in the full problem, and {start.words} at μ = {low:g}, as "
            "below it"
        )
    wrong: list[str] = []
    sides = zip((start, end), (found.at_start, found.at_end), (low, high), _unled(found, start, end), strict=True)
    for growing, known, mu, lacking in sides:
        values = np.array(known, dtype=complex)
        extra = unconfirmed(growing, values, np.ones(len(values), dtype=bool))
        if len(lacking):
            wrong.append(_unled_words(lacking, mu))
        if extra:
            wrong.append(f"{extra} of the branches that grow at μ = {mu:g} are not found there")
    wrong += [_unled_words(values, mu) for mu, values in between.lacking[:MOST]]
    if found.unexplained:
        wrong.append(f"{found.unexplained} of those at μ = {high:g} go back to no onset that was solved")
    if found.unbalanced:
        wrong.append(
            f"the onsets begin and end the growth of {abs(found.unbalanced)} "
            f"{'more' if found.unbalanced > 0 else 'fewer'} eigenvalues than the branches followed have at both ends"
        )
    wrong += _roots_amiss(found, start, end) or between.amiss
    wrong += _ends_before(found, start)
    if wrong:
        return f"{NOT_COMPLETE}: {numbers}, but {'; '.join(wrong)}. {_advice(start, high)}"
    if not (start.complete and end.complete):
        sentence = start.sentence if not start.complete else end.sentence
        return f"{NOT_COMPLETE}: {numbers}, as the onsets say, but {sentence}"
    return (
        f"{CHECKED} {'both ends' if start.sought else 'the high end'}: {numbers}, and each of them goes back to an "
        f"onset listed or grew from the start.{_left_words(found, start, end)}"
        f"{_last_words(found, start, end)}{_parted_words(found, start, end)} "
        f"{end.sentence} What grows and ends again between them rests on the branches followed.{between.words}"
    )


def _advice(start: Growing, high: float) -> str:
    """What to do where something is not told. Friction may part two modes of one frequency from its first value on."""
    values = start.beside[(start.beside.imag > 0) & (np.abs(start.beside) <= start.top)]
    values = values[np.argsort(values.imag)]
    doubles = values[:-1][np.abs(np.diff(values)) <= DOUBLE * np.abs(values[:-1])]
    if start.mu > 0 or not len(doubles):
        return "Take a smaller range of μ."
    named = ", ".join(f"{v.imag / (2 * np.pi):.6g} Hz" for v in doubles[:MOST])
    return (
        f"Two modes each are one at μ = 0 ({named}), and may grow from there on: a range that begins above 0 "
        f"(--range {1e-3 * high:.3g}:{high:g}) lists what grows already."
    )


def _unled_words(values: ComplexArray, mu: float) -> str:
    named = ", ".join(f"{v.imag / (2 * np.pi):.6g} Hz (+{v.real:.4g} 1/s)" for v in values[:MOST])
    return f"no branch was seen to lead to {named} at μ = {mu:g}"


@dataclass(frozen=True)
class _Account:
    """What the roots that onsets begin and end, from what grows at the low end on, say more than grow at the high end,
    and what becomes of these: modes that have ``passed`` the end of the band upwards growing, less those that come
    down; ``opening``, whose growth begins at the high end itself; ``ceasing``, whose growth ends there.
    ``amiss``: roots that nothing accounts for."""

    passed: int = 0
    opening: int = 0
    ceasing: int = 0
    amiss: int = 0


def _account(found: Onsets, start: Growing, end: Growing) -> _Account:
    """With n⁻ and n⁺ growing roots of the band at both ends, r of each onset in it, and t of each branch that passes
    its end upwards: n⁺ = n⁻ + Σ r − Σ t. What is at an end of the range, or at the end of the band, counts or not."""
    if found.at_top is None or found.followed is None:
        return _Account()
    low, high = found.friction_range
    listed = [o for o in found.onsets if o.enters_at is None]
    slow, before = (_slow(f[1], g) for f, g in zip(reversed(found.followed), (end, start), strict=True))
    more = sum(o.roots for o in listed) + growing_roots(start.values) - growing_roots(end.values)
    more -= growing_roots(slow) - growing_roots(before)
    over = min(max(more, sum(p.least for p in found.at_top)), sum(p.most for p in found.at_top))
    rest = more - over
    near = AT_ONSET * high
    last = [o.roots for o in listed if high - o.mu <= near]
    first = [o.roots for o in listed if o.mu - low <= near]
    opening = min(max(rest, 0), sum(r for r in last if r > 0))
    rest -= opening
    ceasing = min(max(rest, 0), 2 * _standing(found, end))
    rest -= ceasing
    # Of the ends themselves and of modes that are one.
    least = sum(r for r in (*last, *first) if r < 0) - twice(end.values)
    most = sum(r for r in first if r > 0) + twice(start.values)
    border = [2 for values in (found.followed[0][1], found.followed[1][1]) for _ in range(_on_border(values, end.top))]
    return _Account(over, opening, ceasing, rest - min(max(rest, least - sum(border)), most + sum(border)))


def _standing(found: Onsets, end: Growing) -> int:
    """How many branches have grown and are on the axis at the high end, but for rounding."""
    if found.followed is None:
        return 0
    (before, began), (numbers, values) = found.followed
    grew = set(before[grows(began, 0.0)].tolist())
    rounding = UNSURE * UNSTABLE_RELATIVE if found.damped else SPLIT_RELATIVE
    still = (np.abs(values.real) <= rounding * np.abs(values)) & (values.imag > 0) & (values.imag <= end.top)
    last = _last(found)
    have = [b for b in numbers[still].tolist() if (not last[b].stabilising if b in last else b in grew)]
    # Of two that meet one grows.
    return len({last[b].branches if b in last and last[b].growth_slope is None else b for b in have})


def _last(found: Onsets) -> dict[int, Onset]:
    """The last onset of each branch."""
    return {b: o for o in found.onsets for b in o.branches}


def _on_border(values: ComplexArray, top: float) -> int:
    """How many growing branches are where the band ends, but for rounding."""
    return int(np.count_nonzero(grows(values, 0.0) & (np.abs(values.imag - top) <= AT_ONSET * top)))


def _left_words(found: Onsets, start: Growing, end: Growing) -> str:
    """Sentences on modes that begin to grow at an onset listed and by the high end have left the band upwards, or are
    too slow to be sought there."""
    if found.followed is None:
        return ""
    limit, (numbers, values) = found.max_frequency_hz, found.followed[1]
    beyond = grows(values, 0.0) & (values.imag > 2 * np.pi * limit)
    last = _last(found)
    on = sum(b in last and not last[b].stabilising for b in numbers[beyond].tolist())
    came = sum(o.enters_at is not None for o in found.onsets) + len(found.entering)
    ended = max(_account(found, start, end).passed // 2 + came - on, 0) if found.at_top else 0
    told: list[str] = []
    if on:
        verb, they = ("has", "it grows") if on == 1 else ("have", "they grow")
        high = found.friction_range[1]
        told.append(f"{on} {verb} left the band upwards by then: at μ = {high:g} {they} on above {hertz(limit)}")
    if ended:
        told.append(f"{ended} {'has' if ended == 1 else 'have'} left the band upwards and ceased to grow beyond it")
    left = f" Of the growing modes {', and '.join(told)}." if told else ""
    slow = _slow(values, end)
    if not len(slow):
        return left
    below = f"below {end.still / (2 * np.pi):.3g} Hz, where none was sought beside motions as a whole"
    counted = "1 branch grows" if len(slow) == 1 else f"{len(slow)} branches grow"
    return f"{left} At μ = {found.friction_range[1]:g}, {counted} {below}."


def _last_words(found: Onsets, start: Growing, end: Growing) -> str:
    """A sentence on growth that begins or ends where the range does, and does not count there."""
    account, high = _account(found, start, end), found.friction_range[1]
    at = f"at μ = {high:g}, the end of the range"
    told: list[str] = []
    if account.opening:
        told.append(f"Growth begins {at}: nothing of it is beyond rounding there.")
    if account.ceasing:
        modes = (account.ceasing + 1) // 2
        told.append(f"{modes} of the modes that grew {'is' if modes == 1 else 'are'} on the axis {at}.")
    return "".join(f" {one}" for one in told)


def _slow(values: ComplexArray, sought: Growing) -> ComplexArray:
    """Growing branches (k,) so slow that they were not sought."""
    return values[grows(values, 0.0) & (np.abs(values) <= sought.still)]


def _roots_amiss(found: Onsets, start: Growing, end: Growing) -> list[str]:
    """What onsets and the growing eigenvalues at both ends say otherwise. Where motions grow without oscillating no
    branch need show it: a pair that has fallen apart on the real axis is two of them, and one may go through zero."""
    more, said = growing_roots(end.values) - growing_roots(start.values), sum(o.roots for o in found.onsets)
    alone = not (np.all(start.values.imag) and np.all(end.values.imag))
    if not _account(found, start, end).amiss if found.at_top is not None else not alone or more == said:
        return []
    why = (
        "a motion that does not oscillate begins or ceases to grow, or a mode leaves the band" if alone else
        "growth begins or ends where no onset is listed, or a mode passes the end of the band unseen"
    )  # fmt: skip
    return [f"{more:+d} eigenvalues grow from one to the other where the onsets say {said:+d}: {why}"]


def _ends_before(found: Onsets, start: Growing) -> list[str]:
    """What is wrong where growth is said to end that had not begun; at the low end itself rounding decides whether it
    grows there."""
    low, high = found.friction_range
    count = growing_roots(start.values) + 2 * len(found.entering)
    if found.followed is not None:
        count += growing_roots(_slow(found.followed[0][1], start))
    for onset in found.onsets:
        if onset.stabilising and onset.mu - low <= AT_ONSET * high:
            count = max(count, -onset.roots)
        count += onset.roots
        if count < 0:
            return [f"growth of a mode that did not grow is said to end at μ = {onset.mu:.9g}"]
    return []


def _parted_words(found: Onsets, start: Growing, end: Growing) -> str:
    """A sentence on growing pairs that have become two motions without oscillation, which no onset is of."""
    if found.followed is None or any(o.enters_at is not None for o in found.onsets) or found.entering:
        return ""
    more = len(end.values) - len(start.values) - sum(-1 if o.stabilising else 1 for o in found.onsets)
    if more <= 0 or np.count_nonzero(end.values.imag == 0.0) < 2 * more or _left_words(found, start, end):
        return ""
    pairs = "A growing pair has" if more == 1 else f"{more} growing pairs have"
    return f" {pairs} parted into two motions{' each' if more > 1 else ''} that grow without oscillating."

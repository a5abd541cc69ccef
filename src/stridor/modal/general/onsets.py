"""Onsets of systems with matrices of any structure, solved, with what speaks for there being no others.

Branches are followed from μ = 0 on a basis or by full solves (`basis`), every passage into or out of growth is
enclosed, and Newton solves for it in the full problem (`newton`). At both ends of the range all modes are found
anew, in the full problem and by another method: as many must grow there as the onsets between say.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ...errors import AnalysisError, CaseError
from ...system import System
from ...threads import one_thread
from ...typing import BoolArray, ComplexArray
from ..assembled.critical import exceptional_point, pair_near
from ..assembled.follow import State
from ..assembled.passages import Passage
from ..assembled.steady import Options
from ..onset import Onset, Onsets
from ..quadratic import Spectrum, band_modes
from ..quadratic.polish import groups, pairs
from ..quadratic.reach import searched
from .basis import AT_REST, DECAY, GROWS, NOTHING, Along, Held, Projected, along, by_lambda, whole_or_raise
from .family import Family, family_of
from .follow import BEYOND, Followed, followed
from .newton import FLAT, Root
from .passages import located, quiet

WIDER = 1.6  # times the band: from where branches are followed if those from a little above it are not all
FINER = 6  # times as many where the count at the ends does not agree
ALIKE = 1e-8  # of |λ|: eigenvalues that are one
AGREES = 1e-5  # of |λ|: how near the followed modes are to those found in full
OPENING = 1e-6  # of the range: passages that close to where growth opens are that
HOLDS = 8
CLEARLY = 1.02  # times the band: passages beyond it are counted and not solved


@dataclass(frozen=True)
class Found:
    """An onset with the branch it is on, counted from 0."""

    onset: Onset
    branch: int


@one_thread
def general_onsets(
    system_at: Callable[[float], System],
    friction_range: tuple[float, float] = (0.0, 1.0),
    *,
    max_frequency_hz: float = 40e3,
    damped: bool = True,
    options: Options | None = None,
    own: float | None = None,
) -> Onsets:
    """Every critical μ in ``friction_range`` with a frequency up to ``max_frequency_hz``.

    system_at gives the system at a μ, on which its matrices may depend; own is the μ at which the touching nodes of
    contacts are found (None: the low end of the range). Raises CaseError for an empty range or no frequency,
    AnalysisError where nothing depends on μ or branches cannot be followed.
    """
    low, high = (float(v) for v in friction_range)
    if not (0 <= low < high and np.isfinite(high)):
        raise CaseError("friction_range", friction_range, "two numbers 0 ≤ a < b")
    if not (np.isfinite(max_frequency_hz) and max_frequency_hz > 0):
        raise CaseError("max_frequency_hz", max_frequency_hz, "a positive frequency in Hz")
    family = family_of(system_at, (low, high), options or Options(), damped=damped, own=low if own is None else own)
    state = family.contacts.contact_state
    result = Onsets((), (low, high), max_frequency_hz, family.dissipates, family.open_contacts, contact_state=state)
    top = searched(family.built(high), 2 * np.pi * max_frequency_hz)
    if not family.depends:
        if not family.open_contacts:
            raise AnalysisError(
                "nothing here depends on the friction coefficient: no factor of a matrix has mu in it and there are no "
                "contacts; `stridor reduce --onsets NAME` solves for onsets along other parameters"
            )
        at = f"mu = {low if own is None else own:g}"
        said = f"No contact carries load in steady sliding at {at}, where contacts are held, so nothing depends on mu."
        return replace(result, completeness=said)
    ends = ends_of(family, low, high, top)
    at_start, at_end = (tuple(end.values[unstable(family, end.values, top)].tolist()) for end in ends)
    result = replace(result, at_start=at_start, at_end=at_end)
    source = _checked(along(family, BEYOND * top), ends, top)
    found, followed, complete = solved(source, (low, high), ends, top, 1)
    for beyond in (BEYOND, WIDER):
        if complete:
            break
        source = source if beyond == BEYOND else _checked(along(family, beyond * top), ends, top)
        found, followed, complete = solved(source, (low, high), ends, top, FINER)
    inside = [
        f.onset
        for f in found
        if low <= f.onset.mu <= high and (f.onset.frequency_hz <= max_frequency_hz or f.onset.enters_at is not None)
    ]
    ordered = tuple(sorted(inside, key=lambda o: (o.mu, o.frequency_hz)))
    sentence = _sentence(followed, ends, ordered, top, complete=complete)
    return replace(result, onsets=ordered, completeness=sentence)


def unstable(family: Family, values: ComplexArray, top: float) -> BoolArray:
    """Which grow beyond rounding (k,); motions as a whole, at no frequency to speak of, do not count."""
    rounding = NOTHING if family.reversible else GROWS
    return (values.real > rounding * np.abs(values)) & (np.abs(values) > AT_REST * top)


def growing_roots(values: ComplexArray) -> int:
    """How many roots grow, of which a flutter pair is two and a motion that diverges one: a pair that meets on the real
    axis and parts there is no onset."""
    return int(np.sum(np.where(values.imag > 0, 2, 1)))


def ends_of(family: Family, low: float, high: float, top: float) -> tuple[Spectrum, Spectrum]:
    """All modes of the band at both ends, in the full problem."""
    band, least, solver, still = top / (2 * np.pi), -DECAY * top, family.options.solver, family.built(low)
    return (
        band_modes(still, band, above=least, still=still, left=True, solver=solver),
        band_modes(family.built(high), band, above=least, still=still, left=False, solver=solver),
    )


def _checked(source: Along, ends: tuple[Spectrum, Spectrum], top: float) -> Along:
    """The source if it has all the modes found at both ends, else full solves."""
    family = source.family
    if source.whole or (isinstance(source, Projected) and source.model is None):
        return source
    # The low end of the range need not be where following begins; the high end is the one that is furthest from it.
    there = source.eigenpairs(family.high - family.low).values
    known = ends[1].values[np.abs(ends[1].values) <= top]
    known = known[np.abs(known) > AT_REST * top]
    away = np.abs(known[:, None] - there).min(axis=1, initial=np.inf)
    if np.all(away <= AGREES * np.abs(known)):
        return source
    return whole_or_raise(family, source.frequency, "a reduced model lacks modes that the matrices have")


def solved(
    source: Along, between: tuple[float, float], ends: tuple[Spectrum, Spectrum], top: float, finer: int
) -> tuple[list[Found], Followed, bool]:
    """Onsets, and whether what grows at the ends is what they say."""
    family = source.family
    way = followed(source, *between, top, finer)
    found = _opening(source, ends[0], way.low, top) if between[0] == family.low else []
    began = {branch - 1 - source.at_rest for f in found for branch in f.onset.branches}
    balance, lost = 0, list[Passage]()
    for passage in way.passages:
        if family.low + passage.high <= between[0]:
            continue
        enters = None if passage.stabilising else way.entries.after(_concerned(passage), passage.low, np.inf)
        if _is_above(passage, CLEARLY * top) and enters is None:
            balance += (-1 if passage.stabilising else 1) * (1 if passage.kind == "divergence" else 2)
            continue
        if passage.low <= OPENING * (family.high - family.low) and {passage.branch, passage.partner} & began:
            continue
        root = located(source, passage)
        if root is None:
            lost.append(passage)
            continue
        one = Found(_onset(source, passage, *root), passage.branch)
        if enters is not None and abs(root[0].lam.imag) > top:
            place = min(max(family.low + enters, one.onset.mu), between[1])
            one = replace(one, onset=replace(one.onset, enters_at=place))
        if not any(_same(one.onset, other.onset, family) for other in found):
            found.append(one)
    inside = (f.onset for f in found if between[0] <= f.onset.mu <= between[1])
    balance += sum((-1 if o.stabilising else 1) * (1 if o.kind == "divergence" else 2) for o in inside)
    explained = _explained(lost)
    growing = [growing_roots(state.values[unstable(family, state.values, top)]) for state in (way.low, way.high)]
    fast = _throughout(family, (way.low, way.high), ends, top)
    agree = all(
        _agree(family, state, end, top, fast) for state, end in zip((way.low, way.high), ends, strict=True)
    )
    return found, way, agree and explained and growing[1] - growing[0] == balance


def _concerned(passage: Passage) -> tuple[int, ...]:
    """The branches that a passage is of: both that meet, else the one that crosses."""
    return (passage.branch, passage.partner) if passage.kind == "meeting" else (passage.branch,)


def _explained(lost: list[Passage]) -> bool:
    """Whether passages that turned out to be none leave nothing open: they come in pairs where a cubic only seemed to
    dip below zero."""
    for passage in lost:
        others = [p for p in lost if p.branch == passage.branch and p.old.mu == passage.old.mu]
        if sum(-1 if p.stabilising else 1 for p in others) != 0:
            return False
    return True


def _is_above(passage: Passage, frequency: float) -> bool:
    """Whether a passage lies beyond a frequency [1/s] at both ends."""
    if passage.kind == "divergence":
        return False
    if passage.kind == "meeting":
        return all(-mean.real > frequency**2 for mean in passage.means)
    lam, tangent = passage.old.values[passage.branch], passage.old.tangents[passage.branch]
    ahead = lam + tangent * (passage.high - passage.old.mu)
    return bool(lam.imag > frequency and not ahead.imag < frequency)


def _throughout(family: Family, states: tuple[State, State], ends: tuple[Spectrum, Spectrum], top: float) -> int:
    """How many modes diverge faster than the band at both ends, and were not followed: branches start in the band."""
    alone: list[int] = []
    for state, end in zip(states, ends, strict=True):
        theirs = end.values[unstable(family, end.values, top) & (end.values.real > top) & (end.values.imag == 0)]
        ours, _ = pairs(theirs, state.values, 1e-3 * top)
        alone.append(len(theirs) - len(ours))
    return alone[0] if alone[0] == alone[1] else 0


def _agree(family: Family, state: State, end: Spectrum, top: float, fast: int) -> bool:
    """Whether the followed modes that grow in the band are those found in full, but for ``fast`` that diverge at every
    μ beyond what is followed."""
    mine = state.values[unstable(family, state.values, top) & (state.values.imag <= top)]
    theirs = end.values[unstable(family, end.values, top)]
    ours, _ = pairs(mine, theirs, 1e-3 * top)
    # One on the very border of the band may count on one side only.
    slack = int(np.count_nonzero(np.abs(np.concatenate([mine, theirs]).imag - top) <= 1e-6 * top))
    return len(mine) - len(ours) <= slack and len(theirs) - len(ours) - fast <= slack


def _same(one: Onset, other: Onset, family: Family) -> bool:
    near = abs(one.mu - other.mu) <= 1e-8 * (family.high - family.low) and one.stabilising == other.stabilising
    return near and abs(one.frequency_hz - other.frequency_hz) <= 1e-7 * max(one.frequency_hz, 1e-300)


def _opening(source: Along, end: Spectrum, state: State, top: float) -> list[Found]:
    """Growth that begins at the very start, where nothing damps: of an eigenvalue that friction drives off the axis at
    once, or of equal ones that it splits (modes of bodies that turn into themselves)."""
    assert end.left is not None, "asked for at the low end"
    family = source.family
    values, change = end.values, family.slopes(family.low)
    problem = family.built(family.low)
    on_axis = (np.abs(values.real) <= NOTHING * np.abs(values)) & (np.abs(values) > AT_REST * top)
    places = np.flatnonzero(on_axis & (values.imag > 0))
    result: list[Found] = []
    for group in groups(values[places], ALIKE * top):
        mine = places[group]
        if family.reversible and len(mine) < 2:
            continue
        x, y, lam = end.right[:, mine], end.left[:, mine], values[mine]
        gram = y.T @ by_lambda(problem, lam, x)
        if np.linalg.cond(gram) > 1e8:
            continue
        slopes = np.linalg.eigvals(-np.linalg.solve(gram, y.T @ change.residual(lam, x)))
        size = np.abs(lam).mean()
        least = max(FLAT * size / (family.high - family.low), 1e-6 * float(np.abs(slopes).max()))
        for slope in slopes[slopes.real > least]:
            near = np.argsort(np.abs(state.values - lam[0]))[: max(len(mine), 2)]
            branch = int(near[0])
            partner = int(near[1]) if len(near) > 1 else branch
            onset = Onset(
                mu=family.low, frequency_hz=float(lam[0].imag / (2 * np.pi)), kind="flutter",
                damped=family.dissipates, stabilising=False,
                branches=_numbers(source, branch, partner),
                residual=float(end.residual[mine].max()), square_root_coefficient=None,
                growth_slope=float(slope.real),
            )  # fmt: skip
            result.append(Found(onset, branch))
    return result


def _onset(source: Along, passage: Passage, root: Root, t: float) -> Onset:
    family = source.family
    still = abs(root.lam) <= 1e-9 * source.frequency
    partner = passage.branch if still else passage.partner
    square_root = None if root.square is None else float(np.sqrt(abs(root.square)))
    exceptional: complex | None = None
    if root.slope is not None and not still and isinstance(source, Projected):
        near = _exceptional(source, passage.old, root.lam, t)
        if near is not None:
            exceptional, square_root = complex(family.low + near[0]), near[1]
    return Onset(
        mu=root.mu, frequency_hz=abs(root.lam.imag) / (2 * np.pi), kind="divergence" if still else "flutter",
        damped=family.dissipates, stabilising=passage.stabilising, branches=_numbers(source, passage.branch, partner),
        residual=root.residual, square_root_coefficient=square_root, growth_slope=root.slope,
        exceptional_mu=exceptional,
    )  # fmt: skip


def _exceptional(source: Projected, state: State, lam: complex, t: float) -> tuple[complex, float] | None:
    """The complex μ − low beside an onset at which two modes meet, and κ, as `exceptional_point` finds them."""
    if source.constant_mass:
        with quiet():
            return exceptional_point(source, state, lam, t)
    # What is sought is where the mass is held, which is known better each time.
    mean, place = lam, complex(t)
    for _ in range(HOLDS):
        with quiet():
            near = exceptional_point(Held(source, mean, place), state, lam, t)
        if near is None or abs(near[0] - place) <= 1e-12 * abs(near[0]):
            return near
        place = near[0]
        mean = pair_near(source.solve(place)[0], mean)[0]
    return None


def _numbers(source: Along, branch: int, partner: int) -> tuple[int, int]:
    """Numbers from 1 of two branches, motions as a whole counted before them."""
    first, second = sorted((branch, partner))
    return source.at_rest + first + 1, source.at_rest + second + 1


def _sentence(
    way: Followed, ends: tuple[Spectrum, Spectrum], found: tuple[Onset, ...], top: float, *, complete: bool
) -> str:
    """What speaks for these onsets being all."""
    family, source = way.source.family, way.source
    low, high = (family.low + s.mu for s in (way.low, way.high))
    grow = [int(np.count_nonzero(unstable(family, end.values, top))) for end in ends]
    how = {True: ", solved in full at every step", False: " on the matrices themselves"}[source.whole]
    if isinstance(source, Projected) and source.model is not None:
        how = f" on a reduced model of {source.model.size} unknowns"
    numbers = f"{_modes(grow[0])} at μ = {low:g} and {grow[1]} at μ = {high:g}"
    begins = sum(not o.stabilising for o in found)
    said = f"as the onsets say{_across(grow[1] - grow[0] - 2 * begins + len(found), top)}"
    told = f"{len(way.low.place)} branches were followed from μ = {family.low:g}{how}"
    both = all(end.completeness.complete for end in ends)
    counted = "by QZ" if ends[1].completeness.sentence.startswith("Complete: QZ") else "in discs that cover the band"
    if ends[1].completeness.counted is not None:
        counted += ", counted by the argument principle"
    anew = f"All modes up to {top / (2 * np.pi):g} Hz at both ends were found anew in the full problem ({counted})"
    if way.unsure:
        at = ", ".join(f"{mu:.6g}" for mu in way.unsure[:3])
        told += f" (which is which was not clear at μ = {at}: numbers beyond may be exchanged)"
    if not complete:
        return (
            f"Not complete: {numbers}, found in the full problem, but growth begins at {begins} onsets between them "
            f"and ends at {len(found) - begins}. {told}. Take a smaller range of mu."
        )
    if not both:
        unsure = next(end.completeness.sentence for end in ends if not end.completeness.complete)
        return f"{told}; {numbers}, {said}. {unsure}"
    return f"Complete as far as both ends tell: {numbers}, {said}. {told}. {anew}."


def _across(count: int, top: float) -> str:
    """Words for modes that cross the border of the band while they grow."""
    if not count:
        return ""
    limit = f"{top / (2 * np.pi):g} Hz"
    if count > 0:
        return f" but for {count} whose growth began above {limit}"
    return f" but for {-count} that went on growing above {limit}"


def _modes(count: int) -> str:
    return f"{count} mode grows" if count == 1 else f"{count} modes grow"

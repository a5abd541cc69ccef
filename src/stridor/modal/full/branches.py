"""Onsets by following branches: every passage enclosed and solved, and what speaks for these being all.

Branches are followed over the range on a basis or by full solves (`basis`), every passage into or out of growth is
enclosed, and Newton solves for it in the full problem (`newton`). At both ends of the range all modes are found
anew, in the full problem and by another method: as many roots must grow there as the onsets between say.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ...typing import ComplexArray
from ..at_rest import moving
from ..dense_problem import eigenvalues
from ..histories import StabilityChange, entering, within_rounding
from ..krylov.exceptional import exceptional_point
from ..krylov.follow import BranchState
from ..krylov.passages import Passage
from ..newton import FLAT, Root
from ..onset import Onset
from ..quadratic import Region, RegionModes, band_modes, is_stiff
from ..quadratic.find import Completeness
from ..quadratic.polish import groups, pairs
from ..tolerances import AT_REST, SPLIT_RELATIVE
from .basis import DECAY, Along, Projected
from .family import Family
from .follow import Followed, followed
from .growth import growing_roots, unstable
from .opening import Opening
from .passages import located, quiet

ALIKE = 1e-8  # of |λ|: eigenvalues that are one
SAME = 1e-5  # of the highest frequency: a mode of the low end as it is found twice, on a basis and in the full problem
OPENING = 1e-6  # of the range: passages that close to where growth opens are that
BORDERS = 1e-6  # of the band: modes so near its end may count on either side
CLEARLY = 1.02  # times the band: passages beyond it are counted and not solved


@dataclass(frozen=True)
class BranchOnset:
    """An onset with the branch it is on, counted from 0."""

    onset: Onset
    branch: int


def ends_of(family: Family, low: float, high: float, top: float) -> tuple[RegionModes, RegionModes]:
    """All modes of the band at both ends, in the full problem."""
    band, least, solver, first = top / (2 * np.pi), -DECAY * top, family.options.solver, family.built(low)
    stands, still = partial(is_stiff, first, solver=solver), AT_REST * top
    return (
        band_modes(first, band, above=least, stands=stands, left=True, solver=solver, still=still),
        band_modes(family.built(high), band, above=least, stands=stands, left=False, solver=solver, still=still),
    )


def whole_ends(family: Family, low: float, high: float, top: float) -> tuple[RegionModes, RegionModes]:
    """The same of small problems, by QR and without vectors: whatever else there may be, overdamped modes above all."""
    started, found = time.perf_counter(), list[RegionModes]()
    region = Region.band(0.0, top / (2 * np.pi), above=-DECAY * top).bounded()
    said = f"Complete: QR computes all eigenvalues of {family.size} freedoms at once."
    for mu in (low, high):
        values = all_values(family, mu, top)
        values = values[(values.imag >= 0) & (np.abs(values) <= top) & (values.real >= -DECAY * top)]
        nothing, zero = np.zeros((0, len(values)), dtype=complex), np.zeros(len(values))
        found.append(RegionModes(
            values, nothing, None, zero, None, Completeness(True, said, region), 0, 0,
            time.perf_counter() - started, 0,
        ))  # fmt: skip
    return found[0], found[1]


def all_values(family: Family, mu: float, top: float) -> ComplexArray:
    """All finite eigenvalues at μ of a small problem, best those of the size of top."""
    problem = family.built(mu)
    return eigenvalues(problem.mass.toarray(), problem.damping.toarray(), problem.stiffness.toarray(), top)


def solved(
    source: Along, between: tuple[float, float], ends: tuple[RegionModes, RegionModes], top: float, finer: int
) -> tuple[list[BranchOnset], Followed, bool]:
    """Onsets, and whether what grows at the ends is what they say."""
    family = source.family
    way = followed(source, *between, top, finer)
    opened, found = dict[int, Opening](), list[BranchOnset]()
    if between[0] == family.low:
        opened = _opened(source, way.low)
        found = _opening(source, ends[0], way.low, top)
    began = {branch - 1 - source.at_rest for f in found for branch in f.onset.branches}
    found += [_begins(source, branch, o.root) for branch, o in opened.items() if o.root is not None]
    # Beyond the band only what may come into it is solved, with where that ends.
    changes = [StabilityChange(f.onset.mu, (f.branch,), f.onset) for f in found]
    balance, lost, led = 0, list[Passage](), set[int]()
    for passage in way.passages:
        if family.low + passage.high <= between[0]:
            continue
        above, concerned = _is_above(passage, CLEARLY * top), _concerned(passage)
        matters = way.entries.after(concerned, family.low + passage.low) is not None
        if above and not matters:
            balance += _roots(passage)
            continue
        if passage.low <= OPENING * (family.high - family.low) and {passage.branch, passage.partner} & began:
            continue
        told = _told(opened, passage, SAME * top)
        if told is not None and told.root is not None and not passage.stabilising and passage.branch not in led:
            led.add(passage.branch)  # its growth is more than rounding from here on
            continue
        root = located(source, passage)
        if root is None:
            if above and passage.stabilising:
                balance += _roots(passage)
            else:
                lost.append(passage)
            continue
        if told is not None and root[0].mu - family.low <= told.until:
            continue  # what it does before is rounding
        one = BranchOnset(_onset(source, passage, *root), passage.branch)
        if not any(_same(one.onset, other.onset, family) for other in found):
            found.append(one)
            changes.append(StabilityChange(one.onset.mu, concerned, one.onset))
    rounding = within_rounding(
        [f.onset for f in found], lambda mu: source.eigenpairs(mu - family.low).values
    )
    found = [f for k, f in enumerate(found) if k not in rounding]
    changes = [c for k, c in enumerate(changes) if k not in rounding]
    found = [_entering(one, change, changes, way) for one, change in zip(found, changes, strict=True)]
    grow = np.flatnonzero(unstable(family, way.low.values, top)).tolist()
    grows = {b: complex(way.low.values[b]) for b in grow}
    way = replace(way, entering=entering(grows, changes, way.entries, between[0]))
    inside = [f.onset for f in found if between[0] <= f.onset.mu <= between[1]]
    balance += sum(o.roots for o in inside)
    said = sum(o.roots for o in inside if o.enters_at is not None or 2 * np.pi * o.frequency_hz <= CLEARLY * top)
    explained = _explained(lost)
    growing = [growing_roots(state.values[unstable(family, state.values, top)]) for state in (way.low, way.high)]
    fast = _throughout(family, (way.low, way.high), ends, top)
    agree = all(
        _agree(family, state, end, top, fast) for state, end in zip((way.low, way.high), ends, strict=True)
    )
    agree = agree and _across_known(family, way, ends, top, said)
    return found, way, agree and explained and growing[1] - growing[0] == balance


def _entering(
    one: BranchOnset, change: StabilityChange, changes: list[StabilityChange], way: Followed
) -> BranchOnset:  # fmt: skip
    """The onset with where its growth comes into the band, if it begins above it and does not end before."""
    onset = one.onset
    if onset.stabilising or 2 * np.pi * onset.frequency_hz <= way.entries.top:
        return one
    enters = way.entries.after(change.branches, onset.mu, changes)
    return replace(one, onset=replace(onset, enters_at=enters))


def _roots(passage: Passage) -> int:
    """By how many more roots grow beyond a passage."""
    return (-1 if passage.stabilising else 1) * (1 if passage.kind == "divergence" else 2)


def _across_known(
    family: Family, way: Followed, ends: tuple[RegionModes, RegionModes], top: float, said: int
) -> bool:  # fmt: skip
    """Whether roots that grow in the band at one end and not at the other, beside the ``said`` of the onsets, may have
    passed its border: something grows beyond it then at an end, or begins or ceases to."""
    counts = [growing_roots(end.values[unstable(family, end.values, top)]) for end in ends]
    if counts[1] - counts[0] == said:
        return True
    border = (1 - BORDERS) * top
    beyond = any(
        np.any(state.values[unstable(family, state.values, top)].imag > border)
        or np.any(np.abs(end.values[unstable(family, end.values, top)]) > border)
        for state, end in zip((way.low, way.high), ends, strict=True)
    )
    return bool(beyond) or any(_is_above(passage, border) for passage in way.passages)


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


def _throughout(
    family: Family, states: tuple[BranchState, BranchState], ends: tuple[RegionModes, RegionModes], top: float
) -> int:
    """How many modes diverge faster than the band at both ends, and were not followed: branches start in the band."""
    alone: list[int] = []
    for state, end in zip(states, ends, strict=True):
        theirs = end.values[unstable(family, end.values, top) & (end.values.real > top) & (end.values.imag == 0)]
        ours, _ = pairs(theirs, state.values, 1e-3 * top)
        alone.append(len(theirs) - len(ours))
    return alone[0] if alone[0] == alone[1] else 0


def _agree(family: Family, state: BranchState, end: RegionModes, top: float, fast: int) -> bool:
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


def _opening(source: Along, end: RegionModes, state: BranchState, top: float) -> list[BranchOnset]:
    """Growth that begins at the very start, where nothing damps: of an eigenvalue that friction drives off the axis at
    once, or of equal ones that it splits (modes of bodies that turn into themselves)."""
    assert end.left is not None, "asked for at the low end"
    family = source.family
    values, change = end.values, family.slopes(family.low)
    problem = family.built(family.low)
    on_axis = np.abs(values.real) <= SPLIT_RELATIVE * np.abs(values)
    on_axis &= moving(values, top, lambda: family.rest_limit(top))
    on_axis &= ~unstable(family, values, top)  # what grows already begins nowhere
    indices = np.flatnonzero(on_axis & (values.imag > 0))
    result: list[BranchOnset] = []
    for group in groups(values[indices], ALIKE * top):
        mine = indices[group]
        x, y, lam = end.right[:, mine], end.left[:, mine], values[mine]
        if len(mine) < 2 and (family.reversible or any(abs(o.series[0] - lam[0]) <= SAME * top for o in source.opened)):
            continue
        gram = y.T @ problem.slope(lam, x)
        if np.linalg.cond(gram) > 1e8:
            continue
        slopes = np.linalg.eigvals(-np.linalg.solve(gram, y.T @ change.residual(lam, x)))
        size = np.abs(lam).mean()
        # What little damps it puts growth off: by more than that it is a passage as any other.
        decay = 0.0 if family.neutral else -float(lam.real.min())
        width = family.high - family.low
        least = max(FLAT * size / width, 1e-6 * float(np.abs(slopes).max()), decay / (OPENING * width))
        for slope in slopes[slopes.real > least]:
            near = np.argsort(np.abs(state.values - lam[0]))[: len(mine)]
            branch = int(near[0])
            partner = int(near[1]) if len(near) > 1 else branch  # a simple root leaves the axis by itself
            onset = Onset(
                mu=family.low, frequency_hz=float(lam[0].imag / (2 * np.pi)), kind="flutter",
                damped=family.dissipates, stabilising=False,
                branches=_numbers(source, branch, partner),
                residual=float(end.residual[mine].max()), square_root_coefficient=None,
                growth_slope=float(slope.real),
            )  # fmt: skip
            result.append(BranchOnset(onset, branch))
    return result


def _opened(source: Along, state: BranchState) -> dict[int, Opening]:
    """Branches from 0, in the state at the low end, and what becomes of those modes that are told."""
    return {int(np.argmin(np.abs(state.values - o.series[0]))): o for o in source.opened}


def _told(opened: dict[int, Opening], passage: Passage, near: float) -> Opening | None:
    """What is told of the mode of a passage, which has not yet been seen to grow or decay; near [1/s]: how far from it
    the branch may be."""
    one, old = opened.get(passage.branch), passage.old
    if one is None or passage.kind != "crossing" or passage.low >= one.until:
        return None
    return one if abs(old.values[passage.branch] - one.at(old.mu)) <= near else None


def _begins(source: Along, branch: int, root: Root) -> BranchOnset:
    """An onset at the low end, or so near it that its growth is not seen there."""
    onset = Onset(
        mu=root.mu, frequency_hz=root.lam.imag / (2 * np.pi), kind="flutter", damped=source.family.dissipates,
        stabilising=False, branches=_numbers(source, branch, branch), residual=root.residual,
        square_root_coefficient=None, growth_slope=root.slope,
    )  # fmt: skip
    return BranchOnset(onset, branch)


def _onset(source: Along, passage: Passage, root: Root, t: float) -> Onset:
    family = source.family
    still = abs(root.lam) <= 1e-9 * source.frequency
    partner = passage.branch if still else passage.partner
    square_root = None if root.square is None else float(np.sqrt(abs(root.square)))
    exceptional: complex | None = None
    if root.slope is not None and not still and isinstance(source, Projected):
        with quiet():
            near = exceptional_point(source, passage.old, root.lam, t)
        if near is not None:
            exceptional, square_root = complex(family.low + near[0]), near[1]
    return Onset(
        mu=root.mu, frequency_hz=abs(root.lam.imag) / (2 * np.pi), kind="divergence" if still else "flutter",
        damped=family.dissipates, stabilising=passage.stabilising, branches=_numbers(source, passage.branch, partner),
        residual=root.residual, square_root_coefficient=square_root, growth_slope=root.slope,
        exceptional_mu=exceptional,
    )  # fmt: skip


def _numbers(source: Along, branch: int, partner: int) -> tuple[int, int]:
    """Numbers from 1 of two branches, motions as a whole counted before them."""
    first, second = sorted((branch, partner))
    return source.at_rest + first + 1, source.at_rest + second + 1

"""Onsets of instability of systems with many contact nodes, solved.

Branches of the projected problem are followed over the range, every passage into or out of instability is enclosed and
solved for there; then the basis is enriched with what the onset leaves unbalanced in the sparse problem, and it is
solved again, until nothing is left.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...errors import CaseError
from ...stages import passing, stage
from ...system import System
from ...threads import one_thread
from ...typing import BoolArray, ComplexArray, IntArray
from ..histories import Entries, StabilityChange, beyond_rounding, entering, reported, unbalanced, unexplained
from ..onset import Onset, Onsets
from ..options import Options
from ..quadratic.reach import searched
from ..results import grows, off_rounding
from ..tolerances import BELIEVED, CONFIRMED, SPLIT_RELATIVE
from .carried import Carried
from .crossing import NEAR_AXIS, Solved, crossing, crossing_again
from .double import divergence, double, meeting
from .exceptional import exceptional_point
from .follow import BranchState, Follower
from .islands import islands
from .modes import samples
from .passages import Passage
from .passages import passages as changes
from .problem import problem_of
from .reduced import Reduced
from .refine import GUARD, Band, converge_over, projected
from .shifted import keep_standing, real_columns

FOLLOW = 1.1  # times the band: from where branches are followed
MOST_ABOVE = 1.25  # times that: onsets above the band are solved for up to there
SAMPLES = 9  # from no friction on
FEWEST = 3
ROUNDS = 6
ONSET_TOLERANCE = 1e-12  # backward error at which an onset counts as found
CLEARLY_ABOVE = 1.02
# Of the vectors found to be exact: what the basis on which branches are followed may leave out. Modes are right to some
# 1e-8 on it, and a third of what a basis ten times closer takes is saved; onsets are solved for in the full problem.
TELLING = 2e-8


@passing()
@one_thread
def krylov_onsets(
    system: System,
    friction_range: tuple[float, float] = (0.0, 1.0),
    *,
    max_frequency_hz: float = 40e3,
    damped: bool = True,
    options: Options | None = None,
    follow: float = FOLLOW,
    numbered_at: float = 0.0,
    carried: Carried | None = None,
) -> Onsets:
    """Every critical μ in ``friction_range`` with a frequency up to ``max_frequency_hz``, as `onsets` gives them.

    numbered_at: the μ at which branches get their numbers, and from which they are followed. carried: what the basis of
    the stretch of μ before hands on, and this one to the next. Raises CaseError
    for an empty range or no frequency, AnalysisError where the modes do not settle.
    """
    low, high = (float(v) for v in friction_range)
    if not (0 <= low < high and np.isfinite(high)):
        raise CaseError("friction_range", friction_range, "two numbers 0 ≤ a < b")
    if not (np.isfinite(max_frequency_hz) and max_frequency_hz > 0):
        raise CaseError("max_frequency_hz", max_frequency_hz, "a positive frequency in Hz")
    if not damped:
        system = system.undamped()
    problem = problem_of(system, None, options or Options(), frictions=np.linspace(0.0, high, 50))
    if not problem.nodes:
        return Onsets((), (low, high), max_frequency_hz, problem.damped, problem.open_contacts)
    top = searched(problem.pencil(high).condensed(), 2 * np.pi * max_frequency_hz)
    # Modes that start above the band may meet inside it.
    reduced = projected(problem, Band(1, top * follow), high, carried)
    keep_standing(system, options or Options(), reduced.shifted)
    at_end = None if carried is None else carried.exact_at_end(problem)
    frictions = numbered_at + samples(high - numbered_at, _count_of_samples(numbered_at, high))
    inner = (False, False) if carried is None else carried.inner
    converge_over(reduced, frictions, at_end=at_end, inner=inner)
    if carried is not None:
        carried.take(reduced, GUARD)
    telling = reduced.narrowed(TELLING)
    way = _way(telling, (low, high), top, numbered_at)
    changes: list[StabilityChange] = []
    for passage in way.passages:
        stage(f"onset {len(changes) + 1}, solved in the full problem")
        concerned = (passage.branch, passage.partner) if passage.kind == "meeting" else (passage.branch,)
        # What begins beyond the band counts where it comes into it, unless it ends before.
        matters = way.entries.after(concerned, passage.low) is not None
        if _is_above(passage, top * CLEARLY_ABOVE) and not matters:
            changes.append(StabilityChange(passage.low, concerned, None, _lost(passage, top)))
            continue
        limit = max_frequency_hz * (follow * MOST_ABOVE if matters else 1.0)
        # A double root asks for more of the vectors than they show by themselves.
        onset = _located(telling if passage.kind == "crossing" else reduced, passage, (0.0, high), limit)
        lost = _lost(passage, top) if onset is None else (0, 0)
        changes.append(StabilityChange(passage.low, concerned, onset, lost))
    changes = [changes[k] for k in beyond_rounding(changes, lambda mu: reduced.untracked(mu).values)]
    return Onsets(
        tuple(reported(changes, way.entries, (low, high), max_frequency_hz, way.from_start)),
        (low, high),
        max_frequency_hz,
        problem.damped,
        problem.open_contacts,
        at_start=tuple(way.start.values[_inside(telling, way.start, top)].tolist()),
        at_end=tuple(way.end.values[_inside(telling, way.end, top)].tolist()),
        entering=entering({b: complex(way.start.values[b]) for b in way.from_start}, changes, way.entries, low),
        contact_state=problem.contact_state,
        unexplained=unexplained(np.flatnonzero(_inside(telling, way.end, top)), way.from_start, changes),
        unbalanced=unbalanced(
            changes, *(state.values[_growing(telling, state, top)] for state in (way.start, way.end))
        ),
        followed=(_numbered(way.start), _numbered(way.end)),
        at_top=tuple(way.entries.passed),
    )


def _count_of_samples(low: float, high: float) -> int:
    """Friction coefficients at which modes are made exact: in a small part of what friction may be fewer do."""
    return max(FEWEST, round(SAMPLES * (1.0 - low / high)))


def _numbered(state: BranchState) -> tuple[IntArray, ComplexArray]:
    """Numbers and eigenvalues (b,) of the branches at one μ."""
    return np.arange(1, len(state.index) + 1), state.values


def _growing(reduced: Reduced, state: BranchState, top: float) -> BoolArray:
    """Which branches (b,) grow beyond rounding."""
    values = state.values if reduced.damped else off_rounding(state.values, SPLIT_RELATIVE)
    return grows(values, top)


def _inside(reduced: Reduced, state: BranchState, top: float) -> BoolArray:
    """Which branches (b,) grow in the band."""
    return _growing(reduced, state, top) & (state.values.imag <= top)


def _lost(passage: Passage, top: float) -> tuple[int, int]:
    """By how many eigenvalues more may grow beyond a passage that was not solved, at least and at most: none of the
    band, where it is none or else is lost."""
    lam, tangent = passage.old.values[passage.branch], passage.old.tangents[passage.branch]
    frequency = max(lam.imag, (lam + tangent * (passage.high - passage.old.mu)).imag)
    if passage.kind == "meeting":
        frequency = max(float(np.sqrt(max(-mean.real, 0.0))) for mean in passage.means)
    if not frequency > top / CLEARLY_ABOVE:
        return 0, 0
    return (-2, 0) if passage.stabilising else (0, 2)


@dataclass(frozen=True)
class _Way:
    """Branches over the range: states at both ends, changes of stability, entries into the band, and the branches that
    grow at its low end."""

    start: BranchState
    end: BranchState
    passages: list[Passage]
    entries: Entries
    from_start: list[int]


def _way(reduced: Reduced, between: tuple[float, float], top: float, numbered_at: float) -> _Way:
    """What following sees in the range; from where they are numbered up to it branches are only brought their names."""
    passages: list[Passage] = []
    entries = Entries(top)

    def watch(old: BranchState, new: BranchState) -> None:
        passages.extend(changes(reduced, old, new) + islands(reduced, old, new))
        entries.watch((old.mu, new.mu), old.values, new.values, range(len(old.index)))

    follower = Follower(reduced, start=numbered_at, longest=max(between[0] / 4, between[1] / 30))
    start = follower.advance(between[0])
    first = np.flatnonzero(_growing(reduced, start, top)).tolist()
    follower.longest, follower.watch = between[1] / 30, watch
    return _Way(start, follower.advance(between[1]), passages, entries, first)


def _is_above(passage: Passage, frequency: float) -> bool:
    """Whether a crossing lies beyond a frequency [1/s] at both ends."""
    if passage.kind != "crossing":
        return False
    lam, tangent = passage.old.values[passage.branch], passage.old.tangents[passage.branch]
    ahead = lam + tangent * (passage.high - passage.old.mu)
    return bool(lam.imag > frequency and not ahead.imag < frequency)


def _located(
    reduced: Reduced, passage: Passage, wanted: tuple[float, float], max_frequency_hz: float
) -> Onset | None:
    """The onset of a passage, the basis enriched until it satisfies the sparse problem; None where it was none or lies
    outside what is wanted."""
    problem = reduced.problem
    meet = double if reduced.damped else meeting
    solve = {"crossing": crossing, "meeting": meet, "divergence": divergence}[passage.kind]
    best: tuple[float, Solved] | None = None
    solved: Solved | None = None
    for _ in range(ROUNDS):
        again = None if solved is None or passage.kind != "crossing" else crossing_again(reduced, passage, solved)
        solved = solve(reduced, passage) if again is None else again
        if solved is None or not _is_wanted(solved, wanted, 1.001 * max_frequency_hz, slack=1e-3):
            break
        lam = np.array([solved.lam])
        u, p = reduced.expand(reduced.null_vectors(solved.lam, solved.mu)[0][:, None])
        error = float(problem.pencil(solved.mu).backward_error(lam, u, p)[0])
        if best is None or error < best[0]:
            best = error, solved
        if error <= ONSET_TOLERANCE:
            break
        rest = problem.pencil(solved.mu).residual(lam, u, p)
        if not reduced.enrich(real_columns(rest)):
            break
    if best is None and passage.kind != "crossing" and reduced.damped:  # something damps them all the same
        return _located(reduced, replace(passage, kind="crossing"), wanted, max_frequency_hz)
    # Beside a place where modes meet an error of 1e-10 is one of 1e-5 in their growth.
    if best is None or best[0] > (CONFIRMED if passage.kind == "crossing" else BELIEVED):
        return None
    error, solved = best
    if not _is_wanted(solved, wanted, max_frequency_hz):
        return None
    if passage.kind == "crossing" and abs(solved.lam) > NEAR_AXIS * reduced.frequency:
        near = exceptional_point(reduced, passage.old, solved.lam, solved.mu)
        if near is not None:
            solved = replace(solved, square_root=near[1], exceptional=near[0])
    return _onset(reduced, passage, solved, error)


def _is_wanted(solved: Solved, wanted: tuple[float, float], max_frequency_hz: float, slack: float = 0.0) -> bool:
    """Whether an onset is in the range of μ, a little beyond it where slack is given, and below the frequency."""
    low, high = wanted
    beyond = slack * (high - low)
    return low - beyond <= solved.mu <= high + beyond and abs(solved.lam.imag) <= 2 * np.pi * max_frequency_hz


def _onset(reduced: Reduced, passage: Passage, solved: Solved, error: float) -> Onset:
    still = abs(solved.lam) <= NEAR_AXIS * reduced.frequency
    stabilising = passage.stabilising if solved.slope is None else solved.slope < 0
    partner = passage.branch if still else passage.partner
    first, second = sorted((passage.branch + 1, partner + 1))
    return Onset(
        mu=solved.mu,
        frequency_hz=abs(solved.lam.imag) / (2 * np.pi),
        kind="divergence" if still else "flutter",
        damped=reduced.damped,
        stabilising=stabilising,
        branches=(first, second),
        residual=error,
        square_root_coefficient=solved.square_root,
        growth_slope=solved.slope,
        exceptional_mu=solved.exceptional,
    )

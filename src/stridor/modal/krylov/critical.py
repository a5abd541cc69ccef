"""Onsets of instability of systems with many contact nodes, solved.

Branches of the projected problem are followed over the range, every passage into or out of instability is enclosed and
solved for there; then the basis is enriched with what the onset leaves unbalanced in the sparse problem, and it is
solved again, until nothing is left.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import scipy
import scipy.linalg as sl

from ...errors import CaseError
from ...stages import passing, stage
from ...system import System
from ...threads import one_thread
from ...typing import BoolArray, ComplexArray, IntArray
from ..dense_problem import DenseProblem, Eigenpairs
from ..histories import Entries, StabilityChange, reported, unexplained
from ..newton import crossing as on_axis
from ..newton import exceptional
from ..onset import Onset, Onsets
from ..options import Options
from ..quadratic.reach import searched
from ..results import grows, off_rounding
from ..tolerances import BELIEVED, SPLIT_RELATIVE, UNSTABLE_RELATIVE
from .carried import Carried
from .follow import Follower, State, halves
from .modes import samples
from .passages import Passage, crossings, meetings
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
NEIGHBOURS = 12  # eigenvectors that span the surroundings of an eigenvalue
NEAR_AXIS = 1e-6  # of the band: below it a frequency is zero


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
    converge_over(reduced, numbered_at + samples(high - numbered_at, _count_of_samples(numbered_at, high)))
    if carried is not None:
        carried.take(reduced, GUARD)
    way = _way(reduced, (low, high), top, numbered_at)
    changes: list[StabilityChange] = []
    for passage in way.passages:
        stage(f"onset {len(changes) + 1}, solved in the full problem")
        concerned = (passage.branch, passage.partner) if passage.kind == "meeting" else (passage.branch,)
        # What begins beyond the band counts where it comes into it, unless it ends before.
        matters = way.entries.after(concerned, passage.low, np.inf) is not None
        if _is_above(passage, top * CLEARLY_ABOVE) and not matters:
            continue
        limit = max_frequency_hz * (follow * MOST_ABOVE if matters else 1.0)
        onset = _located(reduced, passage, (0.0, high), limit)
        changes.append(StabilityChange(passage.low, concerned, onset))
    return Onsets(
        tuple(reported(changes, way.entries, (low, high), max_frequency_hz)),
        (low, high),
        max_frequency_hz,
        problem.damped,
        problem.open_contacts,
        at_start=tuple(way.start.values[_inside(reduced, way.start, top)].tolist()),
        at_end=tuple(way.end.values[_inside(reduced, way.end, top)].tolist()),
        entering=_entering(way, changes, low),
        contact_state=problem.contact_state,
        unexplained=unexplained(np.flatnonzero(_inside(reduced, way.end, top)), way.from_start, changes),
        followed=(_numbered(way.start), _numbered(way.end)),
    )


def _count_of_samples(low: float, high: float) -> int:
    """Friction coefficients at which modes are made exact: in a small part of what friction may be fewer do."""
    return max(FEWEST, round(SAMPLES * (1.0 - low / high)))


def _numbered(state: State) -> tuple[IntArray, ComplexArray]:
    """Numbers and eigenvalues (b,) of the branches at one μ."""
    return np.arange(1, len(state.index) + 1), state.values


def _entering(way: _Way, changes: list[StabilityChange], low: float) -> tuple[tuple[complex, float], ...]:
    """λ of branches that grow above the band where the range begins, and the μ at which they come into it growing."""
    found: list[tuple[complex, float]] = []
    for branch in way.from_start:
        lam = complex(way.start.values[branch])
        ends = (c.onset.mu for c in changes if c.onset is not None and c.onset.stabilising and branch in c.branches)
        mu = way.entries.after((branch,), low, min(ends, default=np.inf))
        if lam.imag > way.entries.top and mu is not None:
            found.append((lam, mu))
    return tuple(found)


def _growing(reduced: Reduced, state: State, top: float) -> BoolArray:
    """Which branches (b,) grow beyond rounding."""
    values = state.values if reduced.damped else off_rounding(state.values, SPLIT_RELATIVE)
    return grows(values, top)


def _inside(reduced: Reduced, state: State, top: float) -> BoolArray:
    """Which branches (b,) grow in the band."""
    return _growing(reduced, state, top) & (state.values.imag <= top)


@dataclass(frozen=True)
class _Way:
    """Branches over the range: states at both ends, changes of stability, entries into the band, and the branches that
    grow at its low end."""

    start: State
    end: State
    passages: list[Passage]
    entries: Entries
    from_start: list[int]


def _way(reduced: Reduced, between: tuple[float, float], top: float, numbered_at: float) -> _Way:
    """What following sees in the range; from where they are numbered up to it branches are only brought their names."""
    passages: list[Passage] = []
    entries = Entries(top)

    def watch(old: State, new: State) -> None:
        passages.extend(crossings(old, new) if reduced.damped else meetings(reduced, old, new))
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


@dataclass(frozen=True)
class Solved:
    """An onset of the projected problem: μ, λ on the axis, and how the instability opens."""

    mu: float
    lam: complex
    square_root: float | None
    slope: float | None = None
    exceptional: complex | None = None


def _located(
    reduced: Reduced, passage: Passage, wanted: tuple[float, float], max_frequency_hz: float
) -> Onset | None:
    """The onset of a passage, the basis enriched until it satisfies the sparse problem; None where it was none or lies
    outside what is wanted."""
    problem = reduced.problem
    solve = {"crossing": crossing, "meeting": _meeting, "divergence": _divergence}[passage.kind]
    best: tuple[float, Solved] | None = None
    solved: Solved | None = None
    for _ in range(ROUNDS):
        again = None if solved is None or passage.kind != "crossing" else _crossing_again(reduced, passage, solved)
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
    if best is None or best[0] > BELIEVED:
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


def _root(call: Callable[[float], float], low: float, high: float) -> float | None:
    """A zero of ``call`` between two μ; None where its sign does not change (any more)."""
    at_low, at_high = call(low), call(high)
    if at_low == 0.0 or at_high == 0.0:
        return low if at_low == 0.0 else high
    if at_low * at_high > 0 or not np.isfinite(at_low * at_high):
        return None
    try:
        return float(scipy.optimize.brentq(call, low, high, xtol=1e-14 * max(high, 1e-3), rtol=1e-14, maxiter=200))
    except RuntimeError:  # a jump, not a zero: two modes have changed places
        return None


def pair_near(coordinate: ComplexArray, target: complex) -> tuple[complex, complex]:
    """Mean and squared half difference of the two eigenvalues nearest to a place."""
    near = np.argsort(np.abs(coordinate - target))[:2]
    return halves(*coordinate[near])


def _meeting(reduced: DenseProblem, passage: Passage) -> Solved | None:
    """Where two undamped modes meet: their squared half difference passes through zero, with a finite slope."""
    width = passage.high - passage.low
    quick = _quick_meeting(reduced, passage)
    if quick is not None:
        return quick

    def guess(mu: float) -> complex:
        part = (mu - passage.low) / width
        return (1 - part) * passage.means[0] + part * passage.means[1]

    def square(mu: float) -> float:
        return float(pair_near(reduced.eigenpairs(mu).coordinate, guess(mu))[1].real)

    mu = _root(square, passage.low, passage.high)
    if mu is None:
        return None
    mean, _ = pair_near(reduced.eigenpairs(mu).coordinate, guess(mu))
    if not mean.real < 0:
        return None
    step = min(1e-4 * max(mu, 1e-3), 0.25 * width)
    slope = (square(mu + step) - square(mu - step)) / (2 * step)
    omega = float(np.sqrt(-mean.real))
    return Solved(mu, 1j * omega, float(np.sqrt(abs(slope)) / (2 * omega)))


def _quick_meeting(reduced: DenseProblem, passage: Passage) -> Solved | None:
    """The same by Newton from the middle of the passage; None where that does not settle inside it."""
    mean = (passage.means[0] + passage.means[1]) / 2
    if not mean.real < 0:
        return None
    lam, mu = 1j * np.sqrt(-mean.real), (passage.low + passage.high) / 2
    found = exceptional(reduced, mu, lam, *reduced.null_vectors(lam, mu), reach=passage.high - passage.low)
    if found is None:
        return None
    mu, lam, square = found
    slack = 1e-6 * (passage.high - passage.low)
    inside = passage.low - slack <= mu.real <= passage.high + slack
    # Frequencies at the ends bound where the pair can be: elsewhere it is another one's meeting.
    squares = sorted(m.real for m in passage.means)
    margin = 1e-3 * abs(mean) + 2 * (squares[1] - squares[0])
    near = squares[0] - margin <= (lam**2).real <= squares[1] + margin
    on_axis = abs(mu.imag) <= 1e-9 * abs(mu) and abs(lam.real) <= 1e-9 * abs(lam)
    opens = -square.real if passage.stabilising else square.real
    if not (inside and near and on_axis and opens > 0):
        return None
    return Solved(float(mu.real), 1j * abs(lam.imag), float(np.sqrt(opens)))


def _divergence(reduced: DenseProblem, passage: Passage) -> Solved | None:
    """Where λ² of an undamped mode passes through zero."""

    def square(mu: float) -> float:
        coordinate = reduced.eigenpairs(mu).coordinate
        still = coordinate[np.abs(coordinate.imag) <= UNSTABLE_RELATIVE * reduced.frequency**2]
        return float(still[np.argmin(np.abs(still))].real) if len(still) else float("nan")

    mu = _root(square, passage.low, passage.high)
    if mu is None:
        return None
    step = min(1e-4 * max(mu, 1e-3), 0.25 * (passage.high - passage.low))
    slope = (square(mu + step) - square(mu - step)) / (2 * step)
    return Solved(mu, 0j, float(np.sqrt(abs(slope))))


def crossing(reduced: DenseProblem, passage: Passage) -> Solved | None:
    """Where the growth rate of a damped mode passes through zero."""
    found = _quick_crossing(reduced, passage)
    if found is None:
        start = _again(reduced, passage)
        found = None if start is None else _slow_crossing(reduced, passage, start)
    if found is None:
        found = _by_growth(reduced, passage)
    if found is None:
        return None
    mu, lam, slope = found
    still = abs(lam) <= NEAR_AXIS * reduced.frequency
    return Solved(mu, 0j if still else lam, None, slope)


def _crossing_again(reduced: DenseProblem, passage: Passage, solved: Solved) -> Solved | None:
    """The same crossing with the basis as it is now, from where it was; None where it has gone."""
    right, left = reduced.null_vectors(solved.lam, solved.mu)
    root = on_axis(reduced, solved.mu, solved.lam, right, left, (passage.low, passage.high))
    if root is None or root.slope is None or (root.slope < 0) != passage.stabilising:
        return None
    return Solved(root.mu, 0j if abs(root.lam) <= NEAR_AXIS * reduced.frequency else root.lam, None, root.slope)


def _quick_crossing(reduced: DenseProblem, passage: Passage) -> tuple[float, complex, float] | None:
    """μ, λ on the axis and the growth's slope, following this one mode only; None where that does not settle inside."""
    start = passage.old
    index = int(start.index[passage.branch])
    right, left = (reduced.padded(start.found, v[:, [index]])[:, 0] for v in (start.found.right, start.found.left))
    lam, tangent = complex(start.found.values[index]), complex(start.found.tangents[index])
    width = passage.high - passage.low
    # Of a mode that nothing damps yet the growth rate may have no slope at all.
    ahead = -lam.real / tangent.real if tangent.real else np.inf
    ahead = float(np.clip(ahead, 0.0, width)) if np.isfinite(ahead) else 0.5 * width
    root = on_axis(
        reduced, start.mu + ahead, lam + tangent * ahead, right, left, (passage.low, passage.high)
    )
    if root is None or root.slope is None:
        return None
    slack = 0.05 * width
    if not passage.low - slack <= root.mu <= passage.high + slack or (root.slope < 0) != passage.stabilising:
        return None
    return root.mu, root.lam, root.slope


def _slow_crossing(reduced: DenseProblem, passage: Passage, start: State) -> tuple[float, complex, float] | None:
    """The same by bisection on all branches."""

    def at(mu: float) -> State:
        return Follower.resumed(reduced, start).advance(mu)

    mu = _root(lambda m: float(at(m).values[passage.branch].real), passage.low, passage.high)
    if mu is None:
        return None
    state = at(mu)
    return mu, 1j * float(state.values[passage.branch].imag), float(state.tangents[passage.branch].real)


def _by_growth(reduced: DenseProblem, passage: Passage) -> tuple[float, complex, float] | None:
    """The same where two modes all but meet and which is which cannot be told: where the fastest of those about them
    begins, or ceases, to grow."""
    begin = complex(passage.old.values[passage.branch])
    ahead = reduced.eigenpairs(passage.high).values
    ahead = ahead[(ahead.real > 0) != passage.stabilising]
    if not len(ahead):
        return None
    end = complex(ahead[np.argmin(np.abs(ahead - begin))])

    def fastest(mu: float) -> tuple[Eigenpairs, int]:
        found = reduced.eigenpairs(mu)
        part = (mu - passage.low) / (passage.high - passage.low)
        near = np.abs(found.values - begin - part * (end - begin)) <= 2 * abs(end - begin)
        return found, int(np.argmax(np.where(near, found.values.real, -np.inf)))

    def growth(mu: float) -> float:
        found, index = fastest(mu)
        return float(found.values[index].real)

    mu = _root(growth, passage.low, passage.high)
    if mu is None:
        return None
    found, index = fastest(mu)
    lam, slope = complex(found.values[index]), float(found.tangents[index].real)
    if abs(lam.real) > 1e-9 * abs(lam) or (slope < 0) != passage.stabilising:
        return None
    return mu, 1j * lam.imag, slope


def _again(reduced: DenseProblem, passage: Passage) -> State | None:
    """The state before a passage with the basis as it is now."""
    found = reduced.eigenpairs(passage.low)
    if passage.old.found is found:
        return passage.old
    distance = np.abs(passage.old.coordinate[:, None] - found.coordinate)
    index = np.argmin(distance, axis=1)
    near = distance[passage.branch, index[passage.branch]] <= 1e-3 * np.abs(passage.old.coordinate[passage.branch])
    return State(found, index) if near else None


def exceptional_point(reduced: DenseProblem, state: State, lam: complex, mu: float) -> tuple[complex, float] | None:
    """The complex μ beside an onset at which two modes meet, and κ of λ ≈ λ_c ± κ √(μ − μ_c).

    Sought with the modes nearby at a state before it, then solved for. None where it is further away than half the
    onset's μ.
    """
    reach = 0.5 * max(mu, 1e-3)
    near = _Halves(_Surroundings(reduced, state.found, lam).values, lam)
    rough = _zero(near.square, mu, complex(mu), reach, 1e-8)
    if rough is None:
        return None
    right, left = reduced.null_vectors(near.centre, rough)
    found = exceptional(reduced, rough, near.centre, right, left, reach=reach)
    if found is None or abs(found[0] - mu) > reach or abs(found[1] - lam) > 0.5 * abs(lam):
        return None
    root = np.sqrt(found[2])
    return (found[0], float(max(abs(root.real), abs(root.imag)))) if np.isfinite(root) else None


class _Surroundings:
    """The projected problem on the eigenvectors nearest to one λ at one μ, right and left (r, q): exact there, and what
    these modes do to each other as μ changes is in it."""

    def __init__(self, reduced: DenseProblem, found: Eigenpairs, lam: complex) -> None:
        near = np.argsort(np.abs(found.values - lam))[:NEIGHBOURS]
        self.reduced = reduced
        self.right, self.left = (
            v / np.linalg.norm(v, axis=0)
            for v in (reduced.padded(found, found.right[:, near]), reduced.padded(found, found.left[:, near]))
        )

    def values(self, mu: complex) -> ComplexArray:
        """Eigenvalues (2q,) [1/s] at a real or complex μ."""
        mass, damping, stiffness = (self.left.T @ (np.asarray(m) @ self.right) for m in self.reduced.matrices(mu))
        # Scaled by a typical frequency so that the companion is balanced.
        unit = self.reduced.frequency
        size = len(mass)
        first = np.block([[np.zeros((size, size)), np.eye(size)], [-stiffness, -unit * damping]])
        second = sl.block_diag(np.eye(size), unit**2 * mass)
        with np.errstate(all="ignore"):
            found: ComplexArray = sl.eigvals(first, second) * unit
        return found[np.isfinite(found)]


class _Halves:
    """Squared half difference of the mode of an onset and its neighbour at a complex μ, then of whichever pair is about
    their mean, which ``centre`` keeps."""

    def __init__(self, values: Callable[[complex], ComplexArray], lam: complex) -> None:
        self._values, self.centre = values, lam

    def square(self, at: complex) -> complex:
        found = self._values(complex(at))
        found = found[found.imag > 0]
        if len(found) < 2:
            return complex("nan")
        self.centre, half = pair_near(found, self.centre)
        return half


def _zero(
    call: Callable[[complex], complex], mu: float, start: complex, reach: float, tolerance: float
) -> complex | None:
    """A complex zero near ``start`` by the secant method; None where it strays from μ by more than ``reach``."""
    before, now = start, start * (1 + 1e-4) + 1e-7
    at_before, at_now = call(before), call(now)
    for _ in range(20):
        if at_now == at_before:
            return now
        change = -at_now * (now - before) / (at_now - at_before)
        if not np.isfinite(change) or abs(now + change - mu) > reach:
            return None
        before, at_before = now, at_now
        now = now + change
        if abs(change) <= tolerance * max(mu, 1e-3):
            return now
        at_now = call(now)
    return None

"""Onsets of instability by receptance, solved: the μ at which an eigenvalue reaches the imaginary axis.

Branches are followed over the range and every passage into or out of instability is enclosed; then
Newton solves for it on the assembled matrices. Undamped flutter is a double root, T = ∂T/∂λ = 0 in
the bordered sense; a damped onset is a simple root λ = jω; divergence is λ = 0.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq

from ..direct.light import LightFactor
from ..errors import AnalysisError
from ..system import System
from ..typing import BoolArray, ComplexArray, Sparse
from .backward_error import BackwardError
from .coupling import PointCoupling
from .full.family import Family
from .histories import Entries, StabilityChange, beyond_rounding, entering, imbalance, once_each, reported, unexplained
from .meeting import partner_of
from .newton import Root, crossing, exceptional, meeting, standstill
from .onset import AT_ONSET, Branches, Onset, Onsets
from .options import Options
from .quadratic.inverse_iteration import null_vectors
from .receptance_modes import in_order, prepare, unfit_words
from .results import grows
from .roots import ReceptanceProblem
from .tolerances import BELIEVED, SPLIT_RELATIVE, UNSTABLE_RELATIVE
from .tracking import RootState, Tracker
from .unfit import Unfit
from .vectors import fixed_vectors

NARROWINGS = 8
ASTRAY = 0.1  # of μ
FIRST = 1e-5  # μ at which branches are begun with at most, beside the poles
OPENS = 1e-3  # of what has opened there: growth that began without friction
STANDS = 1e-13  # of |λ|: on the axis, but for rounding
UNSURE = 2.0  # times the growth that counts
ASIDE = 1e-3  # of a step: on both sides of a zero of λ², where its slope is taken
STILL = 1e-6  # of |λ|: what swings slower diverges


@dataclass(frozen=True)
class _Event:
    """A passage between two followed states: guesses for μ and λ, and who is concerned."""

    mu: float
    root: complex
    branch: int
    partner: int
    stabilising: bool
    double: bool
    index: int
    old: RootState
    new: RootState


def onsets_by_receptance(
    system: System,
    friction_range: tuple[float, float],
    *,
    max_frequency_hz: float,
    damped: bool,
    follow: float,
) -> Onsets:
    """Every critical μ in ``friction_range``, as `onsets` gives them; follow: branches are followed that start up to so
    many times the band. Raises Unfit and FollowingError as `modes_by_receptance`."""
    low, high = friction_range
    if not damped:
        system = system.undamped()
    spectrum, coupling, open_contacts = prepare(system)
    if (spectrum.modes.no_receptance or spectrum.unseen) and coupling.contacts:
        raise Unfit(unfit_words(spectrum), max_frequency_hz)
    has_damping = bool(np.abs(system.damping).max() > 0) or coupling.sloped
    top = 2 * np.pi * max_frequency_hz
    if not coupling.contacts:
        fixed = _growing(spectrum.fixed, top)
        return Onsets((), (low, high), max_frequency_hz, has_damping, open_contacts, at_start=fixed, at_end=fixed)
    events: list[_Event] = []
    states: list[RootState] = []
    grown: set[int] = set()
    entries = Entries(top)
    # Roots that start above the band may meet inside it; follow some beyond.
    tracker = Tracker(spectrum, top * follow)

    def watch(old: RootState, new: RootState) -> None:
        count = len(old.roots)
        states.append(old)
        events.extend(_passages(old, new, has_damping))
        grown.update(new.branch[grows(new.roots, 0.0)].tolist())
        entries.watch((old.mu, new.mu), old.roots, new.roots[:count], new.branch[:count])

    tracker.watch = watch
    start = tracker.advance(low)
    before = len(events)
    end = tracker.advance(high)
    order = _numbering(spectrum, tracker.origin, top)
    judge, family = BackwardError(coupling), _PointFamily(coupling, (0.0, high))
    passed = [
        (StabilityChange(event.mu, _concerned(event), _located(spectrum, family, judge, event, order, has_damping)), k)
        for k, event in _beyond_rounding(events, grown)
    ]

    def values(mu: float) -> ComplexArray:
        behind = max((k for k, state in enumerate(states) if state.mu <= mu), default=0)
        try:
            return Tracker.resumed(spectrum, states[behind]).advance(mu).roots
        except AnalysisError:  # beside a meeting: what both sides of the step tell
            return np.concatenate([state.roots for state in [*states, end][behind : behind + 2]])

    passed = [passed[k] for k in beyond_rounding([change for change, _ in passed], values)]
    changes = [change for change, _ in passed]
    return Onsets(
        tuple(reported(changes, entries, (low, high), max_frequency_hz, _begun(start, has_damping, top))),
        (low, high),
        max_frequency_hz,
        has_damping,
        open_contacts,
        at_start=_growing(np.concatenate([start.roots, spectrum.fixed]), top),
        at_end=_growing(np.concatenate([end.roots, spectrum.fixed]), top),
        entering=entering(_growing_branches(start), changes, entries, low),
        unexplained=unexplained(
            end.branch[_inside(end.roots, top)].tolist(),
            start.branch[_inside(start.roots, np.inf)].tolist(),
            [c for c in changes if c.onset is not None and c.onset.mu >= low - AT_ONSET * high],
        ),
        unbalanced=_unbalanced(
            [(c, events[k]) for c, k in passed if k >= before or _at_low(c, start, (low, high))], start, end, top
        ),
        followed=(_numbered(start, spectrum, order, top), _numbered(end, spectrum, order, top)),
        at_top=tuple(p for p in entries.passed if p.low >= low),
    )


def _beyond_rounding(events: list[_Event], grown: set[int]) -> list[tuple[int, _Event]]:
    """The passages, each with its place, without growth that begins with friction itself and stays within rounding all
    over the range, and without where that ends. grown: the branches seen to grow beyond it."""
    kept: list[tuple[int, _Event]] = []
    faint: set[int] = set()
    for k, event in enumerate(events):
        if event.mu == 0.0 and event.branch not in grown:
            faint.add(event.branch)
        elif event.stabilising and event.branch in faint:
            faint.remove(event.branch)
        else:
            kept.append((k, event))
    return kept


class _PointFamily(Family):
    """The problem of point contacts over μ, their normal forces unknowns behind the displacements."""

    def __init__(self, coupling: PointCoupling, between: tuple[float, float]) -> None:
        super().__init__(between, lambda mu: coupling.pencil(mu).whole, Options())
        self._coupling = coupling

    @property
    def freedoms(self) -> int:
        """Number of freedoms n."""
        return self._coupling.system.size

    def _factorised(self, matrix: Sparse) -> LightFactor:
        return LightFactor(matrix)

    def backward_error(self, mu: float, lam: complex, x: ComplexArray) -> float:
        """Backward error of λ, x (n + m,), the contacts' own equations judged by themselves."""
        pencil = self._coupling.pencil(mu)
        u, p = pencil.parted(x[:, None])
        return float(pencil.backward_error(np.array([lam]), u, p)[0])


def _numbered(state: RootState, spectrum: ReceptanceProblem, order: dict[int, int], top: float) -> Branches:
    """Numbers and eigenvalues (b,) of the branches at one μ, twins in the lower half plane left out."""
    known = [k for k in range(len(state.roots)) if int(state.branch[k]) in order and state.roots[k].imag >= 0]
    numbers = [order[int(state.branch[k])] for k in known]
    fixed = sorted(set(range(1, len(order) + len(spectrum.fixed) + 1)) - set(order.values()))
    unseen = spectrum.fixed[in_order(spectrum.fixed, top)]
    return np.array(numbers + fixed, dtype=np.int64), np.concatenate([state.roots[known], unseen])


def _at_low(change: StabilityChange, start: RootState, between: tuple[float, float]) -> bool:
    """Whether growth begins at the low end itself, which rounding has put behind it, and does not count there."""
    onset, (low, high) = change.onset, between
    if onset is None or onset.stabilising or onset.mu < low - AT_ONSET * high:
        return False
    return not set(change.branches) & set(start.branch[grows(start.roots, 0.0)].tolist())


def _begun(state: RootState, has_damping: bool, top: float) -> set[int]:
    """The branches that surely grow at one μ: beside a meeting the root of what is rounding may be growth. What
    diverges has no frequency to be held against but the band's, top [1/s]."""
    rounding = UNSTABLE_RELATIVE if has_damping else SPLIT_RELATIVE
    scale = np.where(state.roots.imag == 0.0, top, np.abs(state.roots))
    return set(state.branch[state.roots.real > rounding * scale].tolist())


def _growing_branches(state: RootState) -> dict[int, complex]:
    """λ of the branches that grow at one μ, by number, twins in the lower half plane left out."""
    inside = _inside(state.roots, np.inf)
    return dict(zip(state.branch[inside].tolist(), state.roots[inside].tolist(), strict=True))


def _inside(roots: ComplexArray, top: float) -> BoolArray:
    """Which roots (k,) grow with a frequency up to top [1/s], twins in the lower half plane left out."""
    return grows(roots, top if np.isfinite(top) else 0.0) & (roots.imag >= 0) & (roots.imag <= top)


def _unbalanced(passed: list[tuple[StabilityChange, _Event]], start: RootState, end: RootState, top: float) -> int:
    """By how many more eigenvalues begin to grow at the onsets, less those that cease to, than do of all followed from
    one end to the other."""
    changes = once_each(_surely(change, event, passed, start, end, top) for change, event in passed)
    return imbalance(changes, _growing_roots(end) - _growing_roots(start))


def _surely(
    change: StabilityChange, event: _Event, passed: list[tuple[StabilityChange, _Event]], start: RootState,
    end: RootState, top: float,
) -> StabilityChange:  # fmt: skip
    """The change, or one that may have been where what is followed need not show it."""
    onset = change.onset
    if onset is None:
        # Above the band nothing is lost with it.
        above = max(abs(event.old.roots[event.index].imag), abs(event.new.roots[event.index].imag)) > top
        roots = 0 if not above else -2 if event.stabilising else 2
    elif event.double:
        # Of two that meet, one may lie beyond all that are followed.
        others = (e.branch for _, e in passed if e.double and e.new is event.new)
        roots = 0 if event.partner < 0 or event.partner in others else onset.roots
    else:
        # What has only just begun to grow, or is about to cease to, need not count as growing.
        state = start if onset.stabilising else end
        root = state.roots[event.index] if event.index < len(state.roots) else 0j
        roots = onset.roots if abs(root.real) <= UNSURE * UNSTABLE_RELATIVE * abs(root) else 0
    return replace(change, onset=None, lost=(min(roots, 0), max(roots, 0))) if roots else change


def _growing_roots(state: RootState) -> int:
    """How many eigenvalues grow, twins that are left unsaid included."""
    return int(np.sum(np.where(state.implied, 2, 1)[grows(state.roots, 0.0)]))


def _growing(roots: ComplexArray, top: float) -> tuple[complex, ...]:
    return tuple(roots[_inside(roots, top)].tolist())


def _vanishing(spectrum: ReceptanceProblem, family: Family, event: _Event) -> Root | None:
    """Where λ² of an undamped branch goes through zero beside motions that no contact sees and no stiffness resists.

    P(0) is singular at every μ then, and its determinant tells nothing; λ²(μ) itself is analytic and simple there.
    """
    low, high = event.old.mu, event.new.mu
    size = max(abs(state.roots[event.index]) ** 2 for state in (event.old, event.new))

    def square(mu: float) -> float:
        state = Tracker.resumed(spectrum, event.old).advance(mu)
        found = float((state.roots[event.index] ** 2).real)
        return found if abs(found) > STANDS * size else 0.0  # nearer to zero it is rounding

    try:
        ends = square(low), square(high)
        if ends[0] * ends[1] > 0.0:
            return None
        mu = float(brentq(square, low, high, xtol=1e-15, rtol=1e-15))
        beside = max(low, mu - ASIDE * (high - low)), min(high, mu + ASIDE * (high - low))
        opens = (square(beside[1]) - square(beside[0])) / (beside[1] - beside[0])
    except AnalysisError:
        return None
    # It ends in such a motion, with no force in any contact.
    free = fixed_vectors(spectrum)[:, int(np.argmin(np.abs(spectrum.fixed)))]
    x = np.concatenate([free, np.zeros(family.size - len(free))]).astype(complex)
    return Root(mu, 0j, x, None, opens, family.backward_error(mu, 0j, x), x)


def _concerned(event: _Event) -> tuple[int, ...]:
    """The branches that a passage is of: both that meet, else the one that crosses."""
    return (event.branch, event.partner) if event.double and event.partner >= 0 else (event.branch,)


def _numbering(spectrum: ReceptanceProblem, roots: ComplexArray, top: float) -> dict[int, int]:
    """Tracked root → mode number from 1 by frequency at μ = 0, modes that no contact sees included."""
    everything = np.concatenate([roots, spectrum.fixed])
    rank = np.argsort(in_order(everything, top), kind="stable")
    return {k: int(rank[k]) + 1 for k in range(len(roots))}


def _passages(old: RootState, new: RootState, has_damping: bool) -> list[_Event]:
    """Enclosed changes of stability between two neighbouring states."""
    step = new.mu - old.mu
    events: list[_Event] = []
    for i in range(len(old.roots)):
        a, b = old.roots[i], new.roots[i]
        if has_damping:
            first, second = old.tangents[i].real * step, new.tangents[i].real * step
            crossings = _axis_crossings(a.real, b.real, first, second)
            opened = old.tangents[i].real * old.mu
            if old.mu <= FIRST and abs(a.real - opened) <= max(OPENS * opened, STANDS * abs(a)):
                # What nothing damps stands on the axis without friction, and may leave it with the least.
                begins = old.tangents[i].real > STANDS * abs(a) and b.real > 0.0
                later = _axis_crossings(0.0, b.real, first, second)
                crossings = [*([(-old.mu / step, False)] if begins else []), *(c for c in later if c[0] > OPENS)]
            for fraction, stabilising in crossings:
                mu = max(old.mu + fraction * step, 0.0) if fraction >= 0.0 else 0.0
                events.append(
                    _Event(
                        mu,
                        a + fraction * (b - a),
                        int(new.branch[i]),
                        -1 if (j := partner_of(new.roots, new.tangents, i, new.mu)) == i else _named(new, j),
                        stabilising,
                        False,
                        i,
                        old,
                        new,
                    )
                )
            continue
        was, now = _grows(a), _grows(b)
        if was == now:
            continue
        j = _partner(old, new, i)
        first = ((a - old.roots[j]) / 2) ** 2 if j >= 0 else a**2
        second = ((b - new.roots[j]) / 2) ** 2 if j >= 0 else b**2
        fraction = float(np.clip((first / (first - second)).real, 0.0, 1.0)) if first != second else 0.5
        means = ((a + old.roots[j]) / 2, (b + new.roots[j]) / 2) if j >= 0 else (0.0, 0.0)
        middle = (1 - fraction) * means[0] + fraction * means[1]
        if j >= 0 and first.real * second.real > 0:
            # These two do not meet: the other half is beyond what is followed. At a meeting both are where one is.
            middle = 1j * (a.imag + b.imag) / 2
        at = old.mu + fraction * step
        events.append(_Event(at, complex(middle), int(new.branch[i]), _named(new, j), was, True, i, old, new))
    return events


def _grows(root: complex) -> bool:
    return bool(abs(root.real) > UNSTABLE_RELATIVE * abs(root))


def _named(state: RootState, i: int) -> int:
    return int(state.branch[i]) if i >= 0 else -1


def _partner(old: RootState, new: RootState, i: int) -> int:
    """The root that shares the coalescence: i's conjugate twin mirrored, i.e. equal frequency after it."""
    split = new if _grows(new.roots[i]) else old
    if abs(split.roots[i].imag) < 1e-9 * abs(split.roots[i]):
        return -1
    distance = np.abs(split.roots + np.conj(split.roots[i]))
    distance[i] = np.inf
    distance[len(old.roots) :] = np.inf
    return int(np.argmin(distance))


def _axis_crossings(start: float, end: float, slope0: float, slope1: float) -> list[tuple[float, bool]]:
    """Zeros in (0, 1] of the cubic through real parts and slopes at both ends; True: stabilising.

    The cubic sees a root that grows and decays again inside one step.
    """
    if not (np.isfinite(slope0) and np.isfinite(slope1)):  # at a double root
        return [(start / (start - end), start > 0)] if start * end < 0 else []
    c3 = 2 * start - 2 * end + slope0 + slope1
    c2 = -3 * start + 3 * end - 2 * slope0 - slope1
    if start * end > 0 and min(abs(start), abs(end)) > abs(slope0) + abs(slope1):
        return []
    # Beside a coalescence slopes explode and the cubic overshoots; keep it within reason there.
    if max(abs(slope0), abs(slope1)) > 20 * max(abs(end - start), 1e-300) and start * end < 0:
        return [(start / (start - end), start > 0)]
    found: list[tuple[float, bool]] = []
    for root in np.roots([c3, c2, slope0, start]):
        if abs(root.imag) < 1e-12 and 0 < root.real <= 1:
            slope = 3 * c3 * root.real**2 + 2 * c2 * root.real + slope0
            found.append((float(root.real), bool(slope < 0)))
    return sorted(found)


def _located(
    spectrum: ReceptanceProblem, family: Family, judge: BackwardError, event: _Event, order: dict[int, int],
    has_damping: bool,
) -> Onset | None:
    """The onset inside an enclosed passage; where Newton strays, the passage is enclosed more closely."""
    for _ in range(NARROWINGS):
        onset = _solve(spectrum, family, judge, event, order, has_damping)
        if onset is not None:
            reach = 0.5 * (event.new.mu - event.old.mu) + 1e-9
            near = event.old.mu - reach <= onset.mu <= event.new.mu + reach
            here = event.double or abs(2 * np.pi * onset.frequency_hz - abs(event.root.imag)) <= _distance(event)
            if near and here and onset.residual <= BELIEVED:
                return onset
        closer = _narrowed(spectrum, event, has_damping)
        if closer is None:
            return None
        event = closer
    return None


def _distance(event: _Event) -> float:
    """How far an onset's ω may lie from the guess: what the root moves over the passage, and some more."""
    moved = abs(event.new.roots[event.index] - event.old.roots[event.index])
    return 2.0 * moved + 1e-6 * abs(event.root) + 1e-3


def _narrowed(spectrum: ReceptanceProblem, event: _Event, has_damping: bool) -> _Event | None:
    """The same passage between states a quarter as far apart or closer, None where it is gone."""
    inner: list[_Event] = []
    tracker = Tracker.resumed(spectrum, event.old)
    tracker.watch = lambda old, new: inner.extend(_passages(old, new, has_damping))
    width = event.new.mu - event.old.mu
    try:
        for part in (0.25, 0.5, 0.75, 1.0):
            tracker.advance(event.old.mu + part * width)
    except AnalysisError:
        return None
    same = [e for e in inner if e.index == event.index and e.stabilising == event.stabilising]
    return min(same, key=lambda e: abs(e.mu - event.mu), default=None)


def _solve(
    spectrum: ReceptanceProblem, family: Family, judge: BackwardError, event: _Event, order: dict[int, int],
    has_damping: bool,
) -> Onset | None:  # fmt: skip
    """Newton on the assembled matrices from an enclosed passage; None where it was no passage."""
    partner = order[event.partner] if event.partner >= 0 else order[event.branch]
    branches = (min(order[event.branch], partner), max(order[event.branch], partner))
    lam, mu = complex(event.root), min(max(event.mu, family.low), family.high)
    # What has no partner but its own conjugate may diverge.
    still = event.partner < 0 or abs(lam.imag) <= STILL * abs(lam)
    # Newton may go astray on its way; whether what it finds is the one enclosed is asked after it.
    astray = max(event.new.mu - event.old.mu, ASTRAY * max(mu, ASTRAY))
    between = (mu - astray, mu + astray)
    root: Root | None = None
    root_coefficient: float | None = None
    exceptional_mu: complex | None = None
    free = bool(np.any(np.abs(spectrum.fixed) <= STILL * abs(event.old.roots[event.index])))
    if event.double and still and free:
        root = _vanishing(spectrum, family, event)
    elif still and (vectors := null_vectors(family.at(mu), 0j)):
        root = standstill(family, mu, *vectors, between)
    if root is None and not (event.double and still) and (vectors := null_vectors(family.at(mu), lam)):
        if event.double:
            root = meeting(family, mu, lam, *vectors, between)
        else:
            root = crossing(family, mu, lam, *vectors, between)
            near = None if root is None else exceptional(family, root.mu, root.lam, *vectors, 0.5 * max(root.mu, 0.1))
            if root is not None and near is not None and abs(near[0] - root.mu) < 0.5 * max(root.mu, 1e-3):
                kappa = np.sqrt(near[2])
                exceptional_mu, root_coefficient = near[0], float(max(abs(kappa.real), abs(kappa.imag)))
    if root is None:
        return None
    if root.square is not None:
        root_coefficient = float(np.sqrt(abs(root.square)))
    shape = root.vector[: family.freedoms]
    residual = root.residual  # where no contact has a force, what displacements make of it is rounding
    if root.lam or not free:
        residual = float(judge(np.array([root.lam]), (shape / np.linalg.norm(shape))[:, None], root.mu)[0])
    return Onset(
        mu=0.0 if event.mu == 0.0 and abs(root.mu) <= OPENS * OPENS else root.mu,
        frequency_hz=abs(root.lam.imag) / (2 * np.pi),
        kind="flutter" if root.lam else "divergence",
        damped=has_damping,
        stabilising=event.stabilising if root.slope is None else root.slope < 0,
        branches=branches,
        residual=residual,
        square_root_coefficient=root_coefficient,
        growth_slope=root.slope,
        exceptional_mu=exceptional_mu,
    )

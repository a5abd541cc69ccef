"""Onsets of instability, solved: the μ at which an eigenvalue reaches the imaginary axis.

Branches are followed over the range and every passage into or out of instability is enclosed; then
Newton solves for it on the assembled matrices. Undamped flutter is a double root, T = ∂T/∂λ = 0 in
the bordered sense; a damped onset is a simple root λ = jω; divergence is λ = 0.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from ..errors import AnalysisError, CaseError
from ..system import System
from ..threads import one_thread_if_small
from ..typing import ComplexArray
from .backward_error import BackwardError
from .bordered import Bordered
from .complex_modes import UNSTABLE_RELATIVE, prepare, undamped
from .coupling import Coupling
from .roots import Spectrum
from .tracking import State, Tracker

NARROWINGS = 8
BELIEVED = 1e-8  # backward error above which a solved onset is no onset


@dataclass(frozen=True)
class Onset:
    """One critical friction coefficient.

    mu, frequency_hz: where; kind: flutter (two modes meet) or divergence (a mode at zero frequency);
    damped: with or without C; stabilising: True where growth ends there instead of beginning;
    branches: the two modes that meet, numbered from 1 by frequency at μ = 0.
    square_root_coefficient κ [1/s]: beyond an undamped onset growth opens as κ √(μ − μ_c); with
    damping it belongs to the exceptional point at the complex μ ``exceptional_mu`` close by (None if
    none was found). growth_slope d Re λ/dμ [1/s] (None undamped, where it is infinite).
    residual: componentwise backward error of the eigenpair in the assembled matrices.
    """

    mu: float
    frequency_hz: float
    kind: Literal["flutter", "divergence"]
    damped: bool
    stabilising: bool
    branches: tuple[int, int]
    residual: float
    square_root_coefficient: float | None
    growth_slope: float | None
    exceptional_mu: complex | None = None

    def to_json(self) -> dict[str, Any]:
        """Plain values, as `stridor onsets --json` prints them."""
        exceptional = self.exceptional_mu
        return {
            "mu": self.mu,
            "frequency_hz": self.frequency_hz,
            "kind": self.kind,
            "damped": self.damped,
            "stabilising": self.stabilising,
            "branches": list(self.branches),
            "residual": self.residual,
            "square_root_coefficient": self.square_root_coefficient,
            "growth_slope": self.growth_slope,
            "exceptional_mu": None if exceptional is None else [exceptional.real, exceptional.imag],
        }


@dataclass(frozen=True)
class Onsets:
    """All onsets with friction_range [a, b] and frequencies up to max_frequency_hz, by μ.

    completeness: of matrices without structure, what speaks for there being no others; "" of all others. contact_state:
    where contacts may stick, how many nodes stick, slip and are open, and at which μ; it is held over the range.
    """

    onsets: tuple[Onset, ...]
    friction_range: tuple[float, float]
    max_frequency_hz: float
    damped: bool
    open_contacts: tuple[str, ...] = ()
    completeness: str = ""
    contact_state: str = ""
    provenance: dict[str, Any] = field(default_factory=dict)

    @property
    def first(self) -> Onset | None:
        """The lowest μ from which on something grows, or None."""
        return next((o for o in self.onsets if not o.stabilising), None)

    def to_json(self) -> dict[str, Any]:
        """The document that `stridor onsets --json` prints."""
        return {
            "onsets": [o.to_json() for o in self.onsets],
            **({"contact_state": self.contact_state} if self.contact_state else {}),
            "friction_range": list(self.friction_range),
            "max_frequency_hz": self.max_frequency_hz,
            "damped": self.damped,
            "open_contacts": list(self.open_contacts),
            **({"completeness": self.completeness} if self.completeness else {}),
        }


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
    old: State
    new: State


@one_thread_if_small
def onsets(
    system: System,
    friction_range: tuple[float, float] = (0.0, 1.0),
    *,
    max_frequency_hz: float = 40e3,
    damped: bool = True,
    friction_damping: bool = False,
    prestress: bool = False,
    solver: str | None = None,
) -> Onsets:
    """Every critical μ in ``friction_range`` with a frequency up to ``max_frequency_hz``.

    friction_damping, prestress and solver as in `complex_modes`. Raises CaseError for an empty range and AnalysisError
    where branches cannot be followed.
    """
    low, high = (float(v) for v in friction_range)
    if not (0 <= low < high and np.isfinite(high)):
        raise CaseError("friction_range", friction_range, "two numbers 0 ≤ a < b")
    if system.general:
        from .assembled import Options
        from .general import general_onsets

        return general_onsets(
            lambda _: system,
            (low, high),
            max_frequency_hz=max_frequency_hz,
            damped=damped,
            options=Options(friction_damping=friction_damping, prestress=prestress, solver=solver),
        )
    if system.assembled:
        from .assembled import Options, onsets_assembled

        return onsets_assembled(
            system,
            (low, high),
            max_frequency_hz=max_frequency_hz,
            damped=damped,
            options=Options(friction_damping=friction_damping, prestress=prestress, solver=solver),
        )
    if not damped:
        system = undamped(system)
    spectrum, coupling, open_contacts = prepare(system)
    if not coupling.contacts:
        return Onsets((), (low, high), max_frequency_hz, damped, open_contacts)
    events: list[_Event] = []
    has_damping = bool(np.abs(system.damping).max() > 0) or coupling.sloped
    # Roots that start above the band may meet inside it; follow some beyond.
    tracker = Tracker(spectrum, 2 * np.pi * max_frequency_hz * 1.1)
    tracker.watch = lambda old, new: events.extend(_passages(spectrum, old, new, has_damping))
    tracker.advance(high)
    order = _numbering(spectrum, tracker.origin)
    judge = BackwardError(coupling)
    found = [_located(spectrum, judge, event, order, has_damping) for event in events]
    inside = [o for o in found if o is not None and low <= o.mu <= high and o.frequency_hz <= max_frequency_hz]
    return Onsets(
        tuple(sorted(_distinct(inside), key=lambda o: o.mu)),
        (low, high),
        max_frequency_hz,
        damped,
        open_contacts,
    )


def _numbering(spectrum: Spectrum, roots: ComplexArray) -> dict[int, int]:
    """Tracked root → mode number from 1 by frequency at μ = 0, modes that no contact sees included."""
    everything = np.concatenate([roots, spectrum.fixed])
    rank = np.argsort(np.argsort(np.abs(everything.imag), kind="stable"), kind="stable")
    return {k: int(rank[k]) + 1 for k in range(len(roots))}


def _distinct(found: list[Onset]) -> list[Onset]:
    kept: list[Onset] = []
    for onset in found:
        same = any(
            abs(onset.mu - k.mu) <= 1e-9 * max(k.mu, 1e-12)
            and abs(onset.frequency_hz - k.frequency_hz) <= 1e-9 * max(k.frequency_hz, 1.0)
            for k in kept
        )
        if not same:
            kept.append(onset)
    return kept


def _passages(spectrum: Spectrum, old: State, new: State, has_damping: bool) -> list[_Event]:
    """Enclosed changes of stability between two neighbouring states."""
    step = new.mu - old.mu
    events: list[_Event] = []
    for i in range(len(old.roots)):
        a, b = old.roots[i], new.roots[i]
        if has_damping:
            for fraction, stabilising in _axis_crossings(
                a.real, b.real, old.tangents[i].real * step, new.tangents[i].real * step
            ):
                mu = old.mu + fraction * step
                events.append(
                    _Event(
                        mu,
                        a + fraction * (b - a),
                        int(new.branch[i]),
                        _named(new, _nearest(new.roots, i, b)),
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
        at = old.mu + fraction * step
        events.append(_Event(at, complex(middle), int(new.branch[i]), _named(new, j), was, True, i, old, new))
    return events


def _grows(root: complex) -> bool:
    return bool(abs(root.real) > UNSTABLE_RELATIVE * max(abs(root), 1.0))


def _named(state: State, i: int) -> int:
    return int(state.branch[i]) if i >= 0 else -1


def _nearest(roots: ComplexArray, i: int, root: complex) -> int:
    distance = np.abs(roots - root)
    distance[i] = np.inf
    j = int(np.argmin(distance)) if len(roots) > 1 else i
    # A root nearer to its own conjugate than to any other diverges rather than flutters.
    return -1 if 2 * abs(root.imag) < distance[j] else j


def _partner(old: State, new: State, i: int) -> int:
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
    spectrum: Spectrum, judge: BackwardError, event: _Event, order: dict[int, int], has_damping: bool
) -> Onset | None:
    """The onset inside an enclosed passage; where Newton strays, the passage is enclosed more closely."""
    for _ in range(NARROWINGS):
        onset = _solve(spectrum.coupling, judge, event, order, has_damping)
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


def _narrowed(spectrum: Spectrum, event: _Event, has_damping: bool) -> _Event | None:
    """The same passage between states a quarter as far apart or closer, None where it is gone."""
    inner: list[_Event] = []
    tracker = Tracker.resumed(spectrum, event.old)
    tracker.watch = lambda old, new: inner.extend(_passages(spectrum, old, new, has_damping))
    width = event.new.mu - event.old.mu
    try:
        for part in (0.25, 0.5, 0.75, 1.0):
            tracker.advance(event.old.mu + part * width)
    except AnalysisError:
        return None
    same = [e for e in inner if e.index == event.index and e.stabilising == event.stabilising]
    return min(same, key=lambda e: abs(e.mu - event.mu), default=None)


def _solve(
    coupling: Coupling, judge: BackwardError, event: _Event, order: dict[int, int], has_damping: bool
) -> Onset | None:
    """Newton on the assembled matrices from an enclosed passage; None where it was no passage."""
    bordered = Bordered(coupling, event.root if abs(event.root) > 0 else 0j, event.mu)
    partner = order[event.partner] if event.partner >= 0 else order[event.branch]
    branches = (min(order[event.branch], partner), max(order[event.branch], partner))
    root: float | None = None
    slope: float | None = None
    exceptional: complex | None = None
    if not event.double:
        answer = bordered.crossing(event.root, event.mu)
        if answer is None:
            return None
        omega, mu, slope = answer
        lam = 1j * omega
        kind: Literal["flutter", "divergence"] = (
            "divergence" if abs(omega) < 1e-6 * max(abs(event.root), 1.0) else "flutter"
        )
        near = None if kind == "divergence" else bordered.double_root(lam, mu, real=False)
        if near is not None and abs(near[1] - mu) < 0.5 * max(mu, 1e-3):
            exceptional, root = complex(near[1]), near[2]
        stabilising = slope < 0
    elif event.partner < 0:
        mu = bordered.static(event.mu)
        if mu is None:
            return None
        lam, kind, stabilising = 0j, "divergence", event.stabilising
        root = bordered.divergence_coefficient(mu)
    else:
        double = bordered.double_root(event.root, event.mu, real=True)
        if double is None:
            return None
        lam, mu, root = 1j * double[0].imag, float(np.real(double[1])), double[2]
        kind, stabilising = "flutter", event.stabilising
    vector = bordered.vector(lam, mu)
    residual = float(judge(np.array([lam]), vector[:, None], mu)[0])
    return Onset(
        mu=float(mu),
        frequency_hz=abs(lam.imag) / (2 * np.pi),
        kind=kind,
        damped=has_damping,
        stabilising=bool(stabilising),
        branches=branches,
        residual=residual,
        square_root_coefficient=root,
        growth_slope=slope,
        exceptional_mu=exceptional,
    )

"""Onsets of instability, solved: the μ at which an eigenvalue reaches the imaginary axis.

Branches are followed over the range and every passage into or out of instability is enclosed; then
Newton solves for it on the assembled matrices. Undamped flutter is a double root, T = ∂T/∂λ = 0 in
the bordered sense; a damped onset is a simple root λ = jω; divergence is λ = 0.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import scipy.linalg as sl

from ..errors import AnalysisError, CaseError
from ..system import System
from ..typing import ComplexArray
from .backward_error import BackwardError
from .complex_modes import UNSTABLE_RELATIVE, prepare, undamped
from .coupling import Coupling
from .receptance import direct_receptance
from .roots import Spectrum
from .tracking import State, Tracker

NEWTON_STEPS = 30


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
    """All onsets with friction_range [a, b] and frequencies up to max_frequency_hz, by μ."""

    onsets: tuple[Onset, ...]
    friction_range: tuple[float, float]
    max_frequency_hz: float
    damped: bool
    open_contacts: tuple[str, ...] = ()
    provenance: dict[str, Any] = field(default_factory=dict)

    @property
    def first(self) -> Onset | None:
        """The lowest μ from which on something grows, or None."""
        return next((o for o in self.onsets if not o.stabilising), None)

    def to_json(self) -> dict[str, Any]:
        """The document that `stridor onsets --json` prints."""
        return {
            "onsets": [o.to_json() for o in self.onsets],
            "friction_range": list(self.friction_range),
            "max_frequency_hz": self.max_frequency_hz,
            "damped": self.damped,
            "open_contacts": list(self.open_contacts),
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


def onsets(
    system: System,
    friction_range: tuple[float, float] = (0.0, 1.0),
    *,
    max_frequency_hz: float = 40e3,
    damped: bool = True,
) -> Onsets:
    """Every critical μ in ``friction_range`` with a frequency up to ``max_frequency_hz``.

    Raises CaseError for an empty range and AnalysisError where branches cannot be followed.
    """
    low, high = (float(v) for v in friction_range)
    if not (0 <= low < high and np.isfinite(high)):
        raise CaseError("friction_range", friction_range, "two numbers 0 ≤ a < b")
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
    first = tracker.state
    tracker.advance(high)
    order = _numbering(spectrum, first.roots)
    judge = BackwardError(coupling)
    found = [_solve(coupling, judge, event, order, has_damping) for event in events]
    inside = [
        o
        for o in found
        if o is not None and low <= o.mu <= high and o.frequency_hz <= max_frequency_hz
    ]
    return Onsets(
        tuple(sorted(_distinct(inside), key=lambda o: o.mu)), (low, high), max_frequency_hz, damped, open_contacts
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
            for fraction, stabilising in _axis_crossings(a.real, b.real, old.tangents[i].real * step,
                                                         new.tangents[i].real * step):
                mu = old.mu + fraction * step
                events.append(
                    _Event(
                        mu,
                        a + fraction * (b - a),
                        int(new.branch[i]),
                        _named(new, _nearest(new.roots, i, b)),
                        stabilising,
                        False,
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
        if j >= 0:
            middle = (1 - fraction) * (a + old.roots[j]) / 2 + fraction * (b + new.roots[j]) / 2
        else:
            middle = 0.0
        at = old.mu + fraction * step
        events.append(_Event(at, complex(middle), int(new.branch[i]), _named(new, j), was, True))
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


def _solve(
    coupling: Coupling, judge: BackwardError, event: _Event, order: dict[int, int], has_damping: bool
) -> Onset | None:
    """Newton on the assembled matrices from an enclosed passage; None where it was no passage."""
    bordered = _Bordered(coupling)
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


class _Bordered:
    """T(λ, μ) from factorised matrices, bordered so that one scalar f vanishes where T is singular.

    [T b; cᵀ 0][x; f] = [0; 1]. Derivatives of f come from the same bordered matrix with right sides
    built from derivatives of T (Govaerts, Numerical Methods for Bifurcations, 2000, ch. 3).
    """

    def __init__(self, coupling: Coupling) -> None:
        self.coupling = coupling

    def _matrices(self, lam: complex, mu: complex) -> tuple[ComplexArray, ...]:
        h, dh, ddh = direct_receptance(self.coupling.system, lam)
        at = np.array([lam])
        t, t_lam, t_mu = self.coupling.matrices(at, mu, h[None], dh[None])
        zero = np.zeros_like(h)[None]
        # T is linear in (H, H'), so feeding derivatives of H gives derivatives of T; the constant part
        # (compliance, identity) is taken off again.
        constant = self.coupling.matrices(at, mu, zero, zero)[0]
        second, _, mixed = self.coupling.matrices(at, mu, ddh[None], zero)[0] - constant, None, None
        if self.coupling.sloped:
            # d λ H terms: ∂²(λH) = λH'' + 2H'
            second = second + self._slope_part(mu, dh) * 2
            mixed = self._mixed_difference(lam, mu)
        else:
            mixed = self.coupling.matrices(at, mu, dh[None], zero)[2]
        return t[0], t_lam[0], t_mu[0], second[0], mixed[0]

    def _slope_part(self, mu: complex, dh: ComplexArray) -> ComplexArray:
        one = np.array([1.0 + 0j])
        zero = np.zeros_like(dh)[None]
        with_unit = self.coupling.matrices(one, mu, dh[None], zero)[0]
        without = self.coupling.matrices(0 * one, mu, dh[None], zero)[0]
        return with_unit - without

    def _mixed_difference(self, lam: complex, mu: complex) -> ComplexArray:
        step = 1e-5 * max(abs(mu), 1e-2)
        h, dh, _ = direct_receptance(self.coupling.system, lam)
        at = np.array([lam])
        high = self.coupling.matrices(at, mu + step, h[None], dh[None])[1]
        low = self.coupling.matrices(at, mu - step, h[None], dh[None])[1]
        return (high - low) / (2 * step)

    def derivatives(self, lam: complex, mu: complex) -> tuple[complex, complex, complex, complex, complex]:
        """f, f_λ, f_μ, f_λλ, f_λμ."""
        t, t_lam, t_mu, t_ll, t_lm = self._matrices(lam, mu)
        q = len(t)
        u, _, vh = sl.svd(t)
        matrix = np.zeros((q + 1, q + 1), dtype=complex)
        matrix[:q, :q] = t
        scale = max(float(np.abs(t).max()), 1e-300)
        # At a double root the next singular value stays away from zero: bordering by the smallest
        # singular vectors keeps the matrix regular.
        matrix[:q, q] = u[:, -1] * scale if q > 1 else scale
        matrix[q, :q] = vh[-1] if q > 1 else 1.0
        factor = sl.lu_factor(matrix)

        def solve(top: ComplexArray, last: complex = 0.0) -> tuple[ComplexArray, complex]:
            answer = sl.lu_solve(factor, np.concatenate([top, [last]]))
            return answer[:q], complex(answer[q])

        x, f = solve(np.zeros(q, dtype=complex), 1.0)
        x_l, f_l = solve(-t_lam @ x)
        x_m, f_m = solve(-t_mu @ x)
        _, f_ll = solve(-t_ll @ x - 2 * t_lam @ x_l)
        _, f_lm = solve(-t_lm @ x - t_lam @ x_m - t_mu @ x_l)
        return f, f_l, f_m, f_ll, f_lm

    def crossing(self, root: complex, mu: float) -> tuple[float, float, float] | None:
        """ω, μ and d Re λ/dμ with λ = jω an eigenvalue, from a guess; None if Newton fails."""
        omega, start = root.imag, mu
        last = np.inf
        for _ in range(NEWTON_STEPS):
            f, f_l, f_m, _, _ = self.derivatives(1j * omega, mu)
            jacobian = np.array([[(1j * f_l).real, f_m.real], [(1j * f_l).imag, f_m.imag]])
            try:
                change = np.linalg.solve(jacobian, [-f.real, -f.imag])
            except np.linalg.LinAlgError:
                return None
            size = max(abs(change[0]) / max(abs(omega), 1.0), abs(change[1]) / max(abs(mu), 1e-6))
            # Damp the first steps: the guess is a straight line through two followed states.
            factor = min(1.0, 0.1 / size) if size > 0.1 else 1.0
            omega += factor * change[0]
            mu += factor * change[1]
            if size < 1e-13 or (size < 1e-10 and size >= last):
                if abs(mu - start) > 0.05 + 0.2 * start:
                    return None
                _, f_l, f_m, _, _ = self.derivatives(1j * omega, mu)
                return omega, mu, float((-f_m / f_l).real)
            last = size
        return None

    def double_root(self, lam: complex, mu: complex, *, real: bool) -> tuple[complex, complex, float] | None:
        """λ, μ with a double eigenvalue and κ = Re √(−2 f_μ/f_λλ); ``real`` keeps λ on the axis, μ real."""
        lam, mu = complex(lam), complex(mu)
        start = lam
        last = np.inf
        for _ in range(NEWTON_STEPS):
            f, f_l, f_m, f_ll, f_lm = self.derivatives(lam, mu)
            try:
                change = np.linalg.solve(np.array([[f_l, f_m], [f_ll, f_lm]]), [-f, -f_l])
            except np.linalg.LinAlgError:
                return None
            lam, mu = lam + change[0], mu + change[1]
            if real:
                lam, mu = 1j * lam.imag, complex(mu.real)
            if not np.isfinite(lam) or abs(lam - start) > 0.2 * abs(start):
                return None
            size = max(abs(change[0]) / abs(lam), abs(change[1]) / max(abs(mu), 1e-6))
            if size < 1e-13 or (size < 1e-8 and size >= last):
                _, _, f_m, f_ll, _ = self.derivatives(lam, mu)
                return lam, mu, float(abs(np.sqrt(-2 * f_m / f_ll + 0j).real))
            last = size
        return None

    def static(self, mu: float) -> float | None:
        """μ at which λ = 0 is an eigenvalue (the tangent stiffness is singular)."""
        for _ in range(NEWTON_STEPS):
            f, _, f_m, _, _ = self.derivatives(0j, mu)
            change = float((-f / f_m).real)
            mu += change
            if abs(change) < 1e-13 * max(abs(mu), 1e-6):
                return mu
        return None

    def divergence_coefficient(self, mu: float) -> float:
        """κ of λ = ± κ √(μ − μ_c) at a divergence, where f depends on λ² alone."""
        _, _, f_m, f_ll, _ = self.derivatives(0j, mu)
        return float(np.sqrt(abs(2 * f_m / f_ll)))

    def vector(self, lam: complex, mu: float) -> ComplexArray:
        """Right eigenvector (n,) of unit norm."""
        coupling = self.coupling
        h, dh, _ = direct_receptance(coupling.system, lam)
        t = coupling.matrices(np.array([lam]), mu, h[None], dh[None])[0][0]
        null = np.ones((1, 1), dtype=complex) if len(t) == 1 else sl.svd(t)[2][-1:].conj()
        push = coupling.push(mu, np.array([lam]), null)
        u = direct_solution(coupling, lam, push[0])
        return u / np.linalg.norm(u)


def direct_solution(coupling: Coupling, lam: complex, push: ComplexArray) -> ComplexArray:
    """u (n,) = D(λ)⁻¹ Gᵀ p from a factorisation, refined once."""
    import scipy.sparse as sp
    import scipy.sparse.linalg as spl

    system = coupling.system
    dynamic = sp.csc_array(lam**2 * system.mass + lam * system.damping + system.stiffness).astype(complex)
    right = system.contact_rows().T @ push
    solver = spl.splu(dynamic)
    answer = solver.solve(right)
    return answer + solver.solve(right - dynamic @ answer)


__all__ = ["AnalysisError", "Onset", "Onsets", "onsets"]

"""Modal against temporal: do both approaches tell the same story?

Small perturbations about steady sliding obey the equations that the complex modes solve, so frequency
and growth must be equal to the accuracy of the time scheme. The full run, with stick, slip and
separation, shows which of the unstable modes responds and how it settles (paper 2.4).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..errors import AnalysisError
from ..modal.complex_modes import ComplexModes, complex_modes
from ..modal.onsets import Onsets, onsets
from ..system import System
from ..temporal.schedule import PhaseSpec
from ..temporal.shapes import operating_shape
from ..temporal.signals import Growth, growth, low_passed, spectrum
from ..temporal.simulate import Settings, simulate
from ..temporal.trajectory import Trajectory
from ..threads import one_thread_if_small
from ..typing import ComplexArray, IntArray
from .assembled import modes_as_in_time, perturb_assembled
from .perturbation import Perturbation, perturb

GOOD_FREQUENCY, GOOD_GROWTH, GOOD_MAC, GOOD_CRITICAL = 0.01, 0.05, 0.8, 0.03


@dataclass(frozen=True)
class Comparison:
    """Both approaches at one μ.

    modal_eigenvalue: the mode that belongs to what the temporal side shows growing fastest (or decaying
    slowest); frequency_error, growth_rate_error relative; mac between the operating shape of the full run
    at its dominant frequency and the mode that responds (None if none does); unstable_hz: all unstable modes in range;
    responding: position in that list of the mode that the full run answers with, None if none.
    """

    mu: float
    modal_eigenvalue: complex
    unstable_hz: tuple[float, ...]
    unstable_growth: tuple[float, ...]
    perturbation: Perturbation
    dominant_frequency_hz: float | None
    run_growth: Growth | None
    frequency_error: float
    growth_rate_error: float
    mac: float | None
    responding: int | None
    agrees: bool
    verdict: str

    def to_json(self) -> dict[str, Any]:
        """Plain values of one comparison."""
        modal, temporal = self.modal_eigenvalue, self.perturbation.eigenvalue
        return {
            "mu": self.mu,
            "modal": {
                "frequency_hz": modal.imag / (2 * np.pi),
                "growth_rate": modal.real,
                "unstable_frequencies_hz": list(self.unstable_hz),
                "unstable_growth_rates": list(self.unstable_growth),
            },
            "temporal": {
                "frequency_hz": temporal.imag / (2 * np.pi),
                "growth_rate": temporal.real,
                "dominant_frequency_hz": self.dominant_frequency_hz,
                "saturated": None if self.run_growth is None else self.run_growth.saturated,
                "responding_mode_hz": None if self.responding is None else self.unstable_hz[self.responding],
            },
            "frequency_error": self.frequency_error,
            "growth_rate_error": self.growth_rate_error,
            "mac": self.mac,
            "agrees": self.agrees,
            "verdict": self.verdict,
        }


@dataclass(frozen=True)
class Agreement:
    """Comparisons at several μ and the critical friction coefficients of both approaches.

    critical_mu_temporal is the middle of the last bracket of the bisection, bracket its ends and
    tolerance its width; None where it was not asked for or not found, with the reason in notes.
    """

    comparisons: tuple[Comparison, ...]
    critical_mu_modal: float | None
    critical_mu_temporal: float | None
    bracket: tuple[float, float] | None
    verdict: str
    notes: tuple[str, ...] = ()
    provenance: dict[str, Any] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """The document that `stridor compare --json` prints: the first μ at the top, all in comparisons."""
        first = self.comparisons[0].to_json()
        return {
            **first,
            "critical_mu_modal": self.critical_mu_modal,
            "critical_mu_temporal": self.critical_mu_temporal,
            "critical_bracket": None if self.bracket is None else list(self.bracket),
            "verdict": self.verdict,
            "comparisons": [c.to_json() for c in self.comparisons],
            "notes": list(self.notes),
        }


def critical_friction(
    system: System,
    bracket: tuple[float, float],
    *,
    settings: Settings,
    tolerance: float = 5e-4,
    max_frequency_hz: float = 40e3,
    progress: Callable[[str], None] | None = None,
) -> tuple[float, tuple[float, float]]:
    """Bisect the μ at which small perturbations begin to grow in time; the middle and the last bracket.

    Raises AnalysisError where the ends of the bracket do not differ.
    """
    low, high = bracket
    state = {m: perturb(system, m, settings=settings, max_frequency_hz=max_frequency_hz).grows for m in (low, high)}
    if state[low] or not state[high]:
        both = "grow" if state[low] else "decay"
        raise AnalysisError(
            f"perturbations {both} at both ends of the bracket {low:g} … {high:g}; widen comparison.bracket"
        )
    while high - low > tolerance:
        middle = (low + high) / 2
        grows = perturb(system, middle, settings=settings, max_frequency_hz=max_frequency_hz).grows
        low, high = (low, middle) if grows else (middle, high)
        if progress is not None:
            progress(f"critical μ between {low:.5f} and {high:.5f}")
    return (low + high) / 2, (low, high)


def _silent(text: str) -> None:
    """Say nothing."""
    del text


def modal_assurance(first: ComplexArray, second: ComplexArray) -> float:
    """MAC |aᴴb|²/(aᴴa bᴴb) of two complex shapes, 1 for equal up to a factor."""
    a, b = np.ravel(first), np.ravel(second)
    size = float(np.vdot(a, a).real * np.vdot(b, b).real)
    return float(abs(np.vdot(a, b)) ** 2 / size) if size > 0 else 0.0


def mode_shape(system: System, vector: ComplexArray) -> dict[str, ComplexArray]:
    """Displacements (k, d) of the nodes of each body in an eigenvector (n,)."""
    return {
        body.name: np.asarray(body.rows.free @ vector).reshape(-1, system.dimension)
        for body in (*system.lines, *system.solids)
    }


@one_thread_if_small
def compare(
    system: System,
    phases: Sequence[PhaseSpec],
    settings: Settings,
    mus: Sequence[float],
    *,
    friction_range: tuple[float, float] = (0.0, 1.0),
    max_frequency_hz: float = 40e3,
    critical: bool = True,
    bracket: tuple[float, float] | None = None,
    tolerance: float = 5e-4,
    runs: dict[float, Trajectory] | None = None,
    progress: Callable[[str], None] | None = None,
) -> Agreement:
    """Compare both approaches at each μ and, if asked, by their critical friction coefficients.

    runs may hand in full trajectories already computed at some of the μ. Raises what the analyses raise.
    """
    say = progress or _silent
    comparisons: list[Comparison] = []
    for mu in mus:
        say(f"both approaches at μ = {mu:g}")
        run = (runs or {}).get(mu)
        if run is None:
            run = simulate(system, phases, settings, mu=mu)
        comparisons.append(_compare_at(system, phases, settings, mu, run, max_frequency_hz))
    say("critical friction, modal")
    found = onsets(system, friction_range, max_frequency_hz=max_frequency_hz)
    modal = found.first.mu if found.first else None
    temporal: float | None = None
    last: tuple[float, float] | None = None
    finite = [c.name for c in (*system.contacts, *system.surfaces) if c.sliding == "finite"]
    notes: list[str] = []
    if finite:
        notes.append(
            f"contact {', '.join(finite)} slides finitely in the full run; modes and perturbations are those of "
            "its reference configuration"
        )
    if critical:
        ends = bracket or _bracket(found)
        if ends is None:
            notes.append("no modal onset in range, so no bracket for the temporal critical friction")
        else:
            say("critical friction, temporal")
            try:
                temporal, last = critical_friction(
                    system,
                    ends,
                    settings=settings,
                    tolerance=tolerance,
                    max_frequency_hz=max_frequency_hz,
                    progress=progress,
                )
            except AnalysisError as error:
                notes.append(str(error))
    return Agreement(
        tuple(comparisons),
        modal,
        temporal,
        last,
        _overall(comparisons, modal, temporal, tolerance),
        tuple(notes),
    )


def _bracket(found: Onsets) -> tuple[float, float] | None:
    first = found.first
    return None if first is None else (0.6 * first.mu, 1.5 * first.mu)


def _compare_at(
    system: System,
    phases: Sequence[PhaseSpec],
    settings: Settings,
    mu: float,
    run: Trajectory,
    max_frequency_hz: float,
) -> Comparison:
    if system.assembled:
        modes = modes_as_in_time(system, mu, 1.02 * max_frequency_hz)
        perturbation = perturb_assembled(
            system, mu, settings=settings, max_frequency_hz=max_frequency_hz, modes=modes
        )
    else:
        modes = complex_modes(system, mu, max_frequency_hz=1.02 * max_frequency_hz, vectors=True)
        perturbation = perturb(system, mu, settings=settings, max_frequency_hz=max_frequency_hz)
    lam = modes.eigenvalues[0]
    inside = modes.unstable[0] & (modes.frequency_hz[0] <= max_frequency_hz)
    unstable = np.flatnonzero(inside)
    unstable = unstable[np.argsort(lam[unstable].real)[::-1]]
    partner = int(unstable[0]) if len(unstable) else int(np.argmin(np.abs(lam - perturbation.eigenvalue)))
    here = complex(lam[partner])
    frequency_error = abs(perturbation.eigenvalue.imag - here.imag) / max(abs(here.imag), 1e-300)
    growth_error = abs(perturbation.eigenvalue.real - here.real) / max(abs(here.real), 1e-300)
    dominant, fitted = dominant_response(run, max_frequency_hz)
    mac, responding = None, None
    if dominant:
        responding = _responding(modes, unstable, dominant)
    if dominant and responding is not None and not system.assembled:
        # Without a mode that responds there is nothing to hold the shape against.
        shape = operating_shape(system, phases, settings, run, dominant, mu=mu)
        assert modes.right is not None
        expected = mode_shape(system, modes.right[0, int(unstable[responding])])
        mac = modal_assurance(
            np.concatenate([shape[n].ravel() for n in shape]),
            np.concatenate([expected[n].ravel() for n in shape]),
        )
    agrees, verdict = _judge(mu, len(unstable) > 0, here, perturbation, frequency_error, growth_error)
    if responding is not None and mac is not None:
        likeness = "in its shape" if mac >= GOOD_MAC else f"in a shape that is no longer linear, MAC {mac:.2f}"
        verdict += f"; the full run answers at {dominant:.0f} Hz {likeness}"
    return Comparison(
        mu=mu,
        modal_eigenvalue=here,
        unstable_hz=tuple(float(f) for f in modes.frequency_hz[0][unstable]),
        unstable_growth=tuple(float(g) for g in modes.growth_rate[0][unstable]),
        perturbation=perturbation,
        dominant_frequency_hz=dominant,
        run_growth=fitted,
        frequency_error=float(frequency_error),
        growth_rate_error=float(growth_error),
        mac=mac,
        responding=responding,
        agrees=agrees,
        verdict=verdict,
    )


def _judge(
    mu: float, unstable: bool, here: complex, perturbation: Perturbation, frequency: float, rate: float
) -> tuple[bool, str]:
    said = "unstable" if unstable else "stable"
    if unstable != perturbation.grows:
        other = "grows" if perturbation.grows else "decays"
        return False, f"μ = {mu:g}: they disagree; modal says {said}, the temporal perturbation {other}"
    if not unstable:
        return True, f"μ = {mu:g}: both stable (slowest decay in time {perturbation.growth_rate:.4g} 1/s)"
    if frequency > GOOD_FREQUENCY or rate > GOOD_GROWTH:
        return False, (
            f"μ = {mu:g}: both unstable, but frequency differs by {100 * frequency:.2g} % and growth by "
            f"{100 * rate:.2g} %"
        )
    return True, (
        f"μ = {mu:g}: both unstable at {here.imag / (2 * np.pi):.1f} Hz, growth {here.real:.1f} against "
        f"{perturbation.growth_rate:.1f} 1/s ({100 * rate:.2g} %)"
    )


def _responding(modes: ComplexModes, unstable: IntArray, dominant: float) -> int | None:
    """Unstable mode whose frequency is nearest to the run's dominant one, within 5 %."""
    if not len(unstable):
        return None
    distance = np.abs(modes.frequency_hz[0][unstable] - dominant) / dominant
    nearest = int(np.argmin(distance))
    return nearest if distance[nearest] < 0.05 else None


def dominant_response(run: Trajectory, max_frequency_hz: float) -> tuple[float | None, Growth | None]:
    """Dominant frequency [Hz] of the last phase and the growth of that line.

    Taken from the velocity of the first watched point (what a body radiates follows velocity); without a
    watched point from the slip speed of the first contact. The spectrum is that of the second half.
    """
    part = run.phase_slice()
    if run.watch_names:
        signal = run.velocity[part, 0, int(np.argmax(np.ptp(run.velocity[part, 0], axis=0)))]
    elif run.contact_names:
        signal = run.slip_speed[part, 0]
    else:
        return None, None
    if len(signal) < 64:
        return None, None
    filtered = low_passed(signal, run.sampling, max_frequency_hz)
    spec = spectrum(filtered[len(filtered) // 2 :], run.sampling)
    frequency, amplitude = spec.peak(above_hz=2 * spec.bandwidth_hz)
    if amplitude == 0.0:
        return None, None
    return frequency, growth(filtered, run.sampling, frequency)


def _overall(comparisons: Sequence[Comparison], modal: float | None, temporal: float | None, tolerance: float) -> str:
    parts = [c.verdict for c in comparisons]
    agree = all(c.agrees for c in comparisons)
    if modal is not None and temporal is not None:
        near = abs(modal - temporal) <= max(tolerance, GOOD_CRITICAL * modal)
        agree = agree and near
        parts.append(f"critical μ {modal:.5f} modal, {temporal:.5f} temporal")
    return ("agree: " if agree else "disagree: ") + "; ".join(parts)

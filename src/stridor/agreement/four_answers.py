"""Onset, growth, limit cycle and run at one μ, side by side: four answers to the same question."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from ..digits import readable
from ..periodic import Cycle, CycleOnset
from ..tabular import Cell
from .result import AGREE, DISAGREE, GOOD_FREQUENCY, UNDECIDED, Agreement, Comparison
from .settled import SettledVelocity

GOOD_AMPLITUDE = 0.05
AS_STRONG = 0.5  # of the strongest line: one that may be the strongest of a run as well
HEADS: Sequence[str] = (
    "onset_mu", "onset_frequency_hz", "cycle_frequency_hz", "cycle_line_hz", "cycle_amplitude_m_s", "cycle_method",
    "cycle_stable", "run_line_hz", "run_amplitude_m_s", "cycle_frequency_error", "cycle_amplitude_error",
    "cycle_agrees", "cycle_verdict",
)  # fmt: skip


@dataclass(frozen=True)
class CycleSeen:
    """A limit cycle as a run would show it: frequency_hz, one over its period; line_hz, the strongest line of the
    velocity of the watched point (of several nearly as strong, the nearest to that of the run), and amplitude [m/s],
    half the range of that (None without a run to say where); slip_amplitude [m/s], stable (None: not decided), and
    method."""

    frequency_hz: float
    line_hz: float | None
    amplitude: float | None
    slip_amplitude: float
    stable: bool | None
    method: str


@dataclass(frozen=True)
class FourAnswers:
    """At ``mu``: onset, the lowest onset of growth in the range (None: there is none); growth is in ``comparison``;
    cycles found, and chosen, the one of them that is held against the run: of those that are not unstable the nearest
    to it, without a run the loudest; run, what the full run has settled to. frequency_error, amplitude_error: of line
    and amplitude, relative to the run's, None where there is no pair. agrees: None where one side is missing."""

    mu: float
    onset: CycleOnset | None
    comparison: Comparison
    cycles: tuple[CycleSeen, ...]
    chosen: int | None
    run: SettledVelocity | None
    frequency_error: float | None
    amplitude_error: float | None
    agrees: bool | None
    verdict: str

    @property
    def silent(self) -> bool:
        """Whether nothing swings by any of them, so that there is nothing to decide."""
        return not (self.comparison.unstable_hz or self.cycles or self.run)

    @property
    def cycle(self) -> CycleSeen | None:
        """The cycle that is held against the run."""
        return None if self.chosen is None else self.cycles[self.chosen]

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        growth, told = self.comparison.to_json(), ("frequency_hz", "growth_rate")
        return {
            "mu": self.mu,
            "onset": None if self.onset is None else {"mu": self.onset.mu, "frequency_hz": self.onset.frequency_hz},
            "growth": {way: {name: growth[way][name] for name in told} for way in ("modal", "temporal")},
            "cycle": None if self.cycle is None else asdict(self.cycle),
            "cycles": [asdict(c) for c in self.cycles],
            "run": None if self.run is None else dict(self.run.data),
            "frequency_error": self.frequency_error,
            "amplitude_error": self.amplitude_error,
            "agrees": self.agrees,
            "verdict": self.verdict,
        }

    @property
    def heads(self) -> Sequence[str]:
        """Of what `cells` has."""
        return HEADS

    def cells(self) -> tuple[Cell, ...]:
        """Cells of a CSV row, as HEADS has them."""
        cycle, run, onset = self.cycle, self.run, self.onset
        seen = (None,) * 5 if cycle is None else (
            cycle.frequency_hz, cycle.line_hz, cycle.amplitude, cycle.method, cycle.stable
        )  # fmt: skip
        return (
            *((None, None) if onset is None else (onset.mu, onset.frequency_hz)), *seen,
            *((None, None) if run is None else (run.frequency_hz, run.amplitude)), self.frequency_error,
            self.amplitude_error, self.agrees, self.verdict,
        )  # fmt: skip


def four_answers(
    comparison: Comparison, onset: CycleOnset | None, cycles: Sequence[Cycle], max_frequency_hz: float,
    why_none: str = "",
) -> FourAnswers:  # fmt: skip
    """The answers at the μ of a comparison with the cycles found there; why_none: why none was sought;
    max_frequency_hz: up to which lines are looked at, as in the run."""
    run = comparison.settled
    seen = tuple(_seen(cycle, run, max_frequency_hz) for cycle in cycles)
    chosen = _chosen(seen, run)
    cycle = None if chosen is None else seen[chosen]
    errors: tuple[float | None, float | None] = (None, None)
    if run is not None and cycle is not None and cycle.line_hz is not None and cycle.amplitude is not None:
        errors = cycle.line_hz / run.frequency_hz - 1.0, cycle.amplitude / run.amplitude - 1.0
    agrees, said = _judged(comparison, seen, cycle, errors, why_none)
    return FourAnswers(comparison.mu, onset, comparison, seen, chosen, run, *errors, agrees, said)


def _seen(cycle: Cycle, run: SettledVelocity | None, limit: float) -> CycleSeen:
    line = amplitude = None
    if run is not None and run.point in cycle.watch_names:
        velocity = cycle.velocity[:, cycle.watch_names.index(run.point), "xyz".index(run.direction)]
        lines = np.abs(np.fft.rfft(velocity[:-1]))[1 : max(2, 1 + int(limit / cycle.frequency_hz))]
        strong = (1 + np.flatnonzero(lines >= AS_STRONG * lines.max())) * cycle.frequency_hz
        line = float(strong[np.argmin(np.abs(strong - run.frequency_hz))])
        amplitude = 0.5 * float(np.ptp(velocity))
    return CycleSeen(cycle.frequency_hz, line, amplitude, cycle.slip_amplitude, cycle.stable, cycle.method)


def _chosen(seen: Sequence[CycleSeen], run: SettledVelocity | None) -> int | None:
    """What may be held against a run is what a run can come to."""
    able = [k for k, cycle in enumerate(seen) if cycle.stable is not False]
    if not able:
        return None
    if run is None:
        return max(able, key=lambda k: seen[k].slip_amplitude)

    def off(k: int) -> float:
        line, amplitude = seen[k].line_hz, seen[k].amplitude
        if line is None or amplitude is None:
            return np.inf
        return float(np.hypot((line / run.frequency_hz - 1.0) / GOOD_FREQUENCY,
                              (amplitude / run.amplitude - 1.0) / GOOD_AMPLITUDE))  # fmt: skip

    return min(able, key=off)


def _judged(
    comparison: Comparison, seen: Sequence[CycleSeen], cycle: CycleSeen | None,
    errors: tuple[float | None, float | None], why_none: str,
) -> tuple[bool | None, str]:  # fmt: skip
    """Whether the run is on the cycle, None where one of them is missing, and the sentence that says it."""
    run, at = comparison.settled, f"μ = {comparison.mu:g}"
    frequency, amplitude = errors
    if run is not None and run.spread > GOOD_AMPLITUDE:
        return None, (
            f"{UNDECIDED}{at}: the amplitude of the run differs by {100 * run.spread:.2g} % within its last quarter, "
            "so that it is on no cycle"
        )
    if cycle is None or run is None or frequency is None or amplitude is None:
        none = why_none or ("the cycles found are unstable" if seen else "no cycle was found")
        lacks = [] if cycle else [none]
        lacks += [comparison.unsettled or "there is no full run"] if run is None else []
        return None, f"{UNDECIDED}{at}: {', and '.join(lacks or ['the cycle has no such point'])}"
    told = (
        f"the run swings at {readable(run.frequency_hz, 6)} Hz with {readable(run.amplitude, 4)} m/s, the cycle at "
        f"{readable(cycle.line_hz or 0.0, 6)} Hz with {readable(cycle.amplitude or 0.0, 4)} m/s"
    )
    # What is not a number is not good.
    good = abs(frequency) <= GOOD_FREQUENCY and abs(amplitude) <= GOOD_AMPLITUDE
    within = f"within {100 * GOOD_FREQUENCY:g} % and {100 * GOOD_AMPLITUDE:g} %"
    if cycle.stable is None:
        told += " (whose stability is not decided)"
    return good, f"{AGREE if good else DISAGREE}{at}: {told}, {'' if good else 'not '}{within}"


def with_answers(agreement: Agreement, answers: Sequence[FourAnswers], why_none: str = "") -> Agreement:
    """An agreement with cycles beside it: its verdict is one on all of it, "agree" only where each part does and none
    is missing, as where it was interrupted or why_none says why cycles were not sought."""
    said = agreement.verdict
    begun = next((word for word in (AGREE, DISAGREE, UNDECIDED) if said.startswith(word)), UNDECIDED)
    counted = [a.agrees for a in answers if not a.silent]
    if begun == DISAGREE or False in counted:
        word = DISAGREE
    elif begun == UNDECIDED or None in counted or agreement.interrupted or why_none:
        word = UNDECIDED
    else:
        word = AGREE
    parts = [said.removeprefix(begun), *(f"cycle and run, {a.verdict}" for a in answers if not a.silent)]
    parts += [why_none] if why_none and not any(why_none in part for part in parts) else []
    parts += ["interrupted before all was compared"] if agreement.interrupted else []
    return replace(agreement, verdict=word + "; ".join(parts), answers=tuple(answers))

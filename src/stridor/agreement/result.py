"""What a comparison of both approaches finds, and when it may be said that they agree."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from ..digits import measured, readable
from ..modal.onset import refuted
from ..modal.tolerances import UNSTABLE_RELATIVE
from ..notebook import Shown, html_table
from ..tabular import Cell, Rows, Tabular, dataset, split
from ..temporal.growth import Growth
from .settled import SettledVelocity
from .small_motion import LEVEL, SLIPS, Perturbation

if TYPE_CHECKING:
    from .four_answers import FourAnswers

# Within which decay in time is that of a mode: to be stable it need not be as near as growth, which is the answer.
SAME_DECAY = 0.25
TURNS = 3.0  # periods of a mode that a signal must hold to tell its rate
GOOD_FREQUENCY, GOOD_GROWTH, GOOD_MAC, GOOD_CRITICAL = 0.01, 0.05, 0.8, 0.03
NEAR = 0.05  # of the frequency of a full run: an unstable mode within it responds
AGREE, DISAGREE, UNDECIDED = "agree: ", "disagree: ", "not decided: "


@dataclass(frozen=True, repr=False)
class Comparison(Shown):
    """Both approaches at one μ.

    modal_eigenvalue: the mode that belongs to what the temporal side shows growing fastest (or decaying slowest): the
    fastest, or of those that grow as fast the one that time shows; frequency_error, growth_rate_error relative; mac
    between the operating shape of the full run at its dominant frequency and the mode that responds (None if none does,
    and where there are no bodies whose shapes could be compared); unstable_hz: all unstable modes in range; responding:
    position in that list of the mode that the full run answers with, None if none. growth_mac: between the shape of the
    fastest component of the small perturbation and that mode, None where it was not taken.
    agrees: None where the signal in time tells nothing to hold the modes against, and where the modes are not borne out
    by the search of the full problem; completeness says what that came to. settled: what the full run has come to, None
    where it has not or where there is none, and unsettled says why. stronger_below_hz: frequency [Hz] below which
    something is stronger than the dominant line that the full run is too short to tell (no mode responds then).
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
    agrees: bool | None
    verdict: str
    growth_mac: float | None = None
    completeness: str = ""
    settled: SettledVelocity | None = None
    unsettled: str = ""
    stronger_below_hz: float | None = None

    @property
    def _line(self) -> str:
        return self.verdict

    @property
    def marched(self) -> bool:
        """Whether a small perturbation was marched and shows a vibration: not about what diverges without oscillating,
        nor where it leaves the linear range at once."""
        return self.perturbation.shows and not (self.unstable_hz and self.modal_eigenvalue.imag == 0.0)

    @property
    def told_growth_error(self) -> float | None:
        """``growth_rate_error``; None where nothing was marched, or where the mode grows no more than rounding of its
        eigenvalue."""
        lam = self.modal_eigenvalue
        return self.growth_rate_error if self.marched and abs(lam.real) > UNSTABLE_RELATIVE * abs(lam) else None

    def to_json(self) -> dict[str, Any]:
        """Plain values of one comparison."""
        modal, temporal, marched = self.modal_eigenvalue, self.perturbation.eigenvalue, self.marched
        return {
            "mu": self.mu,
            "modal": {
                "frequency_hz": modal.imag / (2 * np.pi),
                "growth_rate": modal.real,
                "unstable_frequencies_hz": list(self.unstable_hz),
                "unstable_growth_rates": list(self.unstable_growth),
                "completeness": self.completeness,
            },
            "temporal": {
                "frequency_hz": temporal.imag / (2 * np.pi) if marched else None,
                "growth_rate": temporal.real if marched else None,
                "dominant_frequency_hz": self.dominant_frequency_hz,
                "stronger_below_hz": self.stronger_below_hz,
                "saturated": None if self.run_growth is None else self.run_growth.saturated,
                "responding_mode_hz": None if self.responding is None else self.unstable_hz[self.responding],
            },
            "frequency_error": self.frequency_error if marched else None,
            "growth_rate_error": self.told_growth_error,
            "growth_mac": self.growth_mac,
            "mac": self.mac,
            "agrees": self.agrees,
            "verdict": self.verdict,
        }


@dataclass(frozen=True, repr=False)
class Agreement(Tabular):
    """Comparisons at several μ and the critical friction coefficients of both approaches.

    critical_mu_temporal is the middle of the last bracket of the bisection, bracket its ends and
    tolerance its width; None where it was not asked for or not found, with the reason in notes.
    interrupted: Ctrl-C came before all was computed that was asked for; what is here is whole. answers: onset, growth,
    cycle and run at each μ, where cycles were asked for.
    """

    comparisons: tuple[Comparison, ...]
    critical_mu_modal: float | None
    critical_mu_temporal: float | None
    bracket: tuple[float, float] | None
    verdict: str
    notes: tuple[str, ...] = ()
    provenance: dict[str, Any] = field(default_factory=dict)
    interrupted: bool = False
    answers: tuple[FourAnswers, ...] = ()

    @property
    def agree(self) -> bool | None:
        """Whether all that was compared agrees, None where that is not decided."""
        return True if self.verdict.startswith(AGREE) else False if self.verdict.startswith(DISAGREE) else None

    @property
    def _line(self) -> str:
        return self.verdict

    def table(self) -> Rows:
        """Heads and rows: a row for each μ."""
        heads = (
            "mu", "frequency_hz", "growth_1_s", "frequency_in_time_hz", "growth_in_time_1_s", "frequency_error",
            "growth_error", "growth_mac", "dominant_frequency_hz", "mac", "agrees", "verdict",
        )  # fmt: skip
        rows: list[tuple[Cell, ...]] = []
        for c in self.comparisons:
            seen = c.perturbation.eigenvalue if c.marched else complex(np.nan, np.nan)
            ends = [(lam.imag / (2 * np.pi), lam.real) for lam in (c.modal_eigenvalue, seen)]
            both = c.frequency_error if c.marched else None, c.told_growth_error
            errors = *both, c.growth_mac, c.dominant_frequency_hz, c.mac
            rows.append((c.mu, *ends[0], *ends[1], *errors, c.agrees, c.verdict))
        if self.answers:
            heads = (*heads, *self.answers[0].heads)
            rows = [(*row, *answer.cells()) for row, answer in zip(rows, self.answers, strict=True)]
        return heads, rows

    def to_xarray(self) -> Any:
        """xarray.Dataset with dimension mu, as `st.save` writes it; cycles and runs beside it are JSON in the attribute
        ``answers``."""
        rows = self.comparisons

        def column(values: list[float | None]) -> list[float]:
            return [np.nan if v is None else float(v) for v in values]

        variables: dict[str, Any] = {
            "modal_eigenvalue": split(("mu",), [c.modal_eigenvalue for c in rows], {"units": "1/s"}),
            "temporal_eigenvalue": split(("mu",), [c.perturbation.eigenvalue for c in rows], {"units": "1/s"}),
            "frequency_error": ("mu", [c.frequency_error for c in rows], {"units": "1"}),
            "growth_rate_error": ("mu", column([c.told_growth_error for c in rows]), {"units": "1"}),
            "growth_mac": ("mu", column([c.growth_mac for c in rows]), {"units": "1"}),
            "mac": ("mu", column([c.mac for c in rows]), {"units": "1"}),
            "dominant_frequency": ("mu", column([c.dominant_frequency_hz for c in rows]), {"units": "Hz"}),
        }
        data = dataset("compare", variables, {"mu": ("mu", [c.mu for c in rows], {"units": "1"})}, self.provenance)
        for name in ("critical_mu_modal", "critical_mu_temporal"):
            value = getattr(self, name)
            data.attrs[name] = np.nan if value is None else value
        data.attrs["verdict"] = self.verdict
        if self.answers:
            data.attrs["answers"] = json.dumps([answer.to_json() for answer in self.answers])
        return data

    def _repr_html_(self) -> str:
        heads = ("μ", "modes [Hz]", "[1/s]", "in time [Hz]", "[1/s]", "verdict")
        rows = [
            (
                f"{c.mu:g}",
                *(
                    readable(x)
                    for lam in (c.modal_eigenvalue, c.perturbation.eigenvalue)
                    for x in (lam.imag / (2 * np.pi), lam.real)
                ),
                c.verdict,
            )
            for c in self.comparisons
        ]
        cut = "interrupted: what is here is whole" if self.interrupted else ""
        return html_table(self.verdict, heads, rows, (cut, *self.notes))

    def to_json(self) -> dict[str, Any]:
        """The document that `stridor compare --json` prints: the first μ at the top, all in comparisons."""
        first = self.comparisons[0].to_json() if self.comparisons else {}
        return {
            **first,
            "critical_mu_modal": self.critical_mu_modal,
            "critical_mu_temporal": self.critical_mu_temporal,
            "critical_bracket": None if self.bracket is None else list(self.bracket),
            "verdict": self.verdict,
            "interrupted": self.interrupted,
            "comparisons": [c.to_json() for c in self.comparisons],
            "notes": list(self.notes),
        } | ({"answers": [a.to_json() for a in self.answers]} if self.answers else {})


@dataclass(frozen=True)
class Critical:
    """Critical friction of both approaches: agrees is None where there is no pair to compare, and why says so.
    completeness: what speaks for the modal one being the first."""

    modal: float | None = None
    temporal: float | None = None
    bracket: tuple[float, float] | None = None
    agrees: bool | None = None
    why: str = ""
    completeness: str = ""


def judge(
    mu: float,
    unstable: bool,
    here: complex,
    perturbation: Perturbation,
    frequency: float,
    rate: float,
    completeness: str = "",
    shape: float | None = None,
    *,
    shape_asked: bool = False,
    last: complex | None = None,
    rival: complex | None = None,
    hidden: complex | None = None,
    faster: complex | None = None,
) -> tuple[bool | None, str]:
    """Whether both approaches agree at one μ, None where the signal shows nothing or tells no components apart, where
    what grows has another shape (MAC, None where it was not taken or, if asked for, not told) and where the modes are
    not borne out (``completeness``), and the sentence that says it. last: the mode that dies out last, which contacts
    may not show, or the step may damp. rival: one that grows as fast as ``here``. hidden: one that grows, faster than
    all that contacts show, which ``unstable`` is about: then nothing agrees. faster: a vibration that grows faster than
    ``here``, which diverges."""
    agrees, sentence = _judged(mu, unstable, here, perturbation, frequency, rate, faster)
    if agrees is False and perturbation.untold:
        said = "unstable" if unstable else "stable"
        agrees, sentence = None, f"μ = {mu:g}: modal says {said}, but {perturbation.untold}"
    if agrees and unstable and shape is not None and not shape >= GOOD_MAC:
        agrees, sentence = None, f"{sentence}, but it grows in another shape than the mode, MAC {shape:.2f}"
    if agrees and unstable and shape is None and shape_asked:
        sentence = f"{sentence}; in which shape is not told, as the bodies move in more than what was fitted"
    slower = last is not None and last.real - here.real > max(SAME_DECAY * abs(here.real), LEVEL * abs(last))
    if agrees and not unstable and last is not None and slower:
        unseen = "which the motion in time does not show: contacts may not, or its step damps it"
        sentence = f"{sentence}; by the modes {_vibration(last)} dies out last, {unseen}"
    if rival is not None:
        sentence = f"{sentence}; by the modes {_vibration(rival)} grows as fast, within {100 * GOOD_GROWTH:g} %"
    if hidden is not None:
        grows = f"{_vibration(hidden)} grows, in which contacts slip by less than {SLIPS:g} of what moves"
        agrees, sentence = None if agrees else agrees, (
            f"μ = {mu:g}: by the modes {grows}, so that a motion in time does not show it; of what it shows: "
            f"{sentence.removeprefix(f'μ = {mu:g}: ')}"
        )
    if not refuted(completeness):
        return agrees, sentence
    return (None if agrees else agrees), f"{sentence}; but which modes there are is not certain"


def _judged(
    mu: float, unstable: bool, here: complex, perturbation: Perturbation, frequency: float, rate: float,
    faster: complex | None,
) -> tuple[bool | None, str]:  # fmt: skip
    """The same for modes that are certain."""
    if unstable and here.imag == 0.0:
        beside = "so that there is no small vibration to compare"
        if faster is not None:
            beside = f"beside the fastest mode, {_vibration(faster)}, which is not held against a motion in time there"
        diverges = f"by the modes the motion diverges without oscillating, at {readable(here.real)} 1/s"
        return None, f"μ = {mu:g}: {diverges}, {beside}"
    said = "unstable" if unstable else "stable"
    if not perturbation.shows:
        why = perturbation.untold or "the signal in time shows no vibration to compare with"
        return None, f"μ = {mu:g}: modal says {said}, but {why}"
    turns = len(perturbation.signal) * perturbation.sampling * here.imag / (2 * np.pi)
    if unstable and 0.0 < turns < TURNS and perturbation.left:
        return None, (
            f"μ = {mu:g}: the mode grows so fast, {_vibration(here)}, that a motion in time stays small for "
            f"{turns:.2g} periods only, too few to take a rate from"
        )
    seen = perturbation.eigenvalue
    # Without damping both rates are zero but for rounding, and a share of nothing says nothing.
    still = max(abs(seen.real), abs(here.real)) <= 2 * LEVEL * abs(here)
    # What is not a number is not good.
    good = frequency <= GOOD_FREQUENCY and (rate <= GOOD_GROWTH or still)
    if unstable and quiet(seen, here) and not (frequency <= GOOD_FREQUENCY and rate <= GOOD_GROWTH):
        return None, (
            f"μ = {mu:g}: by the modes {_vibration(here)} grows, more slowly than a motion in time tells, which shows "
            f"{_vibration(seen)}"
        )
    if unstable != perturbation.grows and not (good and still):
        other = "grows" if perturbation.grows else "does not grow"
        return False, f"μ = {mu:g}: they disagree; modal says {said}, the temporal perturbation {other}"
    if not unstable and not (frequency <= GOOD_FREQUENCY and (rate <= SAME_DECAY or still)):
        return None, (
            f"μ = {mu:g}: both stable, but what decays slowest in time, {_vibration(seen)}, is none of the modes (the "
            f"nearest is {_vibration(here)}), so that it is not known to be a motion of the system"
        )
    if not unstable:
        slowest = "in time it neither grows nor decays" if still else (
            f"slowest decay in time {readable(seen.real, 4)} 1/s, of the mode {readable(here.real, 4)} 1/s, "
            f"{100 * rate:.2g} %"
        )
        return True, f"μ = {mu:g}: both stable ({slowest})"
    if not good:
        return False, (
            f"μ = {mu:g}: both unstable, but frequency differs by {100 * frequency:.2g} % and growth by "
            f"{100 * rate:.2g} %"
        )
    return True, (
        f"μ = {mu:g}: both unstable at {readable(here.imag / (2 * np.pi), 5, decimals=1)} Hz, growth "
        f"{readable(here.real, 4, decimals=1)} against {readable(perturbation.growth_rate, 4, decimals=1)} 1/s "
        f"({100 * rate:.2g} %)"
    )


def quiet(seen: complex, here: complex) -> bool:
    """Whether neither what is seen in time nor a mode grows or decays by more than what a signal tells."""
    return all(abs(lam.real) <= 2 * LEVEL * abs(lam) for lam in (seen, here))


def decays_as_none(perturbation: Perturbation, frequency: float, rate: float) -> bool:
    """Whether what is told in time decays otherwise than the nearest mode: frequency and rate are off by as much."""
    told = perturbation.shows and not perturbation.untold and not perturbation.grows
    return told and not (frequency <= GOOD_FREQUENCY and rate <= SAME_DECAY)


def _vibration(lam: complex) -> str:
    """Frequency and growth of λ in words."""
    return f"{readable(lam.imag / (2 * np.pi), 5)} Hz with {readable(lam.real, 4)} 1/s"


def likeness(
    verdict: str, dominant: float | None, mac: float | None, *, unstable: bool, mode_hz: float | None = None,
    below_hz: float | None = None,
) -> str:  # fmt: skip
    """The verdict of one μ with what the full run answers, in the shape of an unstable mode, at the frequency mode_hz
    of one where there is no shape to compare (None: of none), or at the frequency of none of those there are; below_hz:
    where something slower is stronger than that line, which the run is too short to tell."""
    if dominant is not None and below_hz is not None:
        return (
            f"{verdict}; the full run is too short to say what it answers with: what swings or drifts below "
            f"{readable(below_hz, 4)} Hz is stronger than its line at {readable(dominant, 4)} Hz"
        )
    if dominant is not None and mac is None and mode_hz is not None:
        return (
            f"{verdict}; the full run answers at {readable(dominant, 4)} Hz, within {100 * NEAR:g} % of the unstable "
            f"mode at {readable(mode_hz, 4)} Hz, with whose shape it is not compared"
        )
    if dominant is not None and mac is None and unstable:
        return f"{verdict}; the full run answers at {readable(dominant, 4)} Hz, which none of the unstable modes has"
    if dominant is None or mac is None:
        return verdict
    how = "in its shape" if mac >= GOOD_MAC else f"in a shape that is no longer linear, MAC {mac:.2f}"
    return f"{verdict}; the full run answers at {readable(dominant, 4, decimals=0)} Hz {how}"


def overall(comparisons: Sequence[Comparison], critical: Critical, *, interrupted: bool) -> str:
    """One verdict on everything compared: "agree" only where each part was compared, agrees, and none is missing."""
    parts = [c.verdict for c in comparisons]
    answers = [c.agrees for c in comparisons]
    if critical.modal is not None and critical.temporal is not None:
        parts.append(f"critical μ {measured(critical.modal, 5)} modal, {measured(critical.temporal, 5)} temporal")
    elif critical.agrees is False:
        parts.append(f"critical μ: {critical.why}")
    if critical.agrees is not None:
        answers.append(critical.agrees)
    if interrupted:
        parts.append("interrupted before all was compared")
        answers.append(None)
    if False in answers:
        return DISAGREE + "; ".join(parts)
    if not answers or None in answers:
        return UNDECIDED + ("; ".join(parts) or critical.why or "nothing was compared")
    return AGREE + "; ".join(parts)

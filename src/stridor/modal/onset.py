"""Onsets as data: where growth begins and ends over the friction coefficient."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from math import pi
from typing import Any, Literal, overload

from ..digits import fixed, hertz, measured, readable
from ..notebook import Shown, counted, html_table
from ..tabular import Rows, Tabular
from ..typing import ComplexArray, IntArray
from .tables import onsets_dataset, onsets_rows

Branches = tuple[IntArray, ComplexArray]
AT_ONSET = 1e-9  # of the highest μ: an onset no further from a value is at it, and rounding decides what grows there


@dataclass(frozen=True)
class AtTop:
    """A branch that passes the end of the band between two neighbouring μ, and by how many fewer eigenvalues that grow
    the band has then, at least and at most: 2 where it goes up and grows, −2 where it comes down."""

    low: float
    high: float
    least: int
    most: int


@dataclass(frozen=True, repr=False)
class Onset(Shown):
    """One critical friction coefficient.

    mu, frequency_hz: where; kind: flutter (at a frequency), divergence (a mode at zero frequency) or contact (from
    this μ on other nodes touch, and a mode grows with them that did not before, or the other way round);
    damped: with or without C; stabilising: True where growth ends there instead of beginning;
    branches: the two modes that meet, or the one that begins to grow and the nearest where damping lets none meet;
    twice the same where one leaves the axis by itself at the low end; numbered from 1 by frequency at μ = 0, (0, 0)
    where branches were not followed.
    square_root_coefficient κ [1/s]: beyond an undamped onset growth opens as κ √(μ − μ_c); with
    damping it belongs to the exceptional point at the complex μ ``exceptional_mu`` close by (None if
    none was found). growth_slope d Re λ/dμ [1/s] (None undamped, where it is infinite; 0 where growth opens at the low
    end of the range as μ² or a higher power, and is rounding at first).
    residual: componentwise backward error of the eigenpair in the assembled matrices. enters_at: where growth begins
    above the band, the μ (to about a step of following) at which the growing mode comes into it; None of all others.
    """

    mu: float
    frequency_hz: float
    kind: Literal["flutter", "divergence", "contact"]
    damped: bool
    stabilising: bool
    branches: tuple[int, int]
    residual: float
    square_root_coefficient: float | None
    growth_slope: float | None
    exceptional_mu: complex | None = None
    enters_at: float | None = None

    @property
    def words(self) -> str:
        """Where it is, at which frequency, and what happens there."""
        modes = ""
        if any(self.branches):
            modes = f" of mode{'s' if len(self._named) > 1 else ''} {self.branch_words(' and ')}"
        ends = ", where growth ends" if self.stabilising else ""
        return f"μ = {fixed(self.mu, 6)}, {measured(self.frequency_hz, 1)} Hz, {self.kind}{modes}{ends}"

    @property
    def _line(self) -> str:
        return self.words

    @property
    def roots(self) -> int:
        """By how many more eigenvalues grow beyond it: what oscillates is a pair, what diverges is one, also where that
        begins because other nodes touch."""
        alone = self.kind == "divergence" or (self.kind == "contact" and self.frequency_hz == 0.0)
        return (-1 if self.stabilising else 1) * (1 if alone else 2)

    def branch_words(self, between: str) -> str:
        """The modes that meet, or the one that grows by itself or diverges; a dash where branches were not followed."""
        return between.join(str(b) for b in self._named) if any(self.branches) else "–"

    @property
    def _named(self) -> tuple[int, ...]:
        """The modes that are told, each once."""
        return tuple(dict.fromkeys(self.branches)) if self.kind == "flutter" else self.branches[:1]

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
            "enters_band_at": self.enters_at,
        }


@dataclass(frozen=True, repr=False)
class Onsets(Tabular):
    """All onsets in friction_range [a, b] of modes with frequencies up to max_frequency_hz, by μ: a sequence of them.

    Those that begin above the band are among them where the growing mode comes into it (`Onset.enters_at`). damped:
    whether anything works on velocities. at_start, at_end: eigenvalues [1/s] that grow in the band at a and at b;
    entering: those followed that grow above it at a, and the μ (to about a step) at which they come into it;
    unexplained: how many of the latter none of the onsets accounts for; unbalanced: by how many more eigenvalues begin
    to grow at the onsets, less those that cease to, than do of all branches followed. completeness: what speaks for
    there being no others, "" where nothing was checked. notes: what else is to be known. contact_state: where contacts
    may stick, how many nodes stick, slip and are open, and at which μ; it is held over the range. followed: numbers and
    eigenvalues (b,) of the branches at both ends, where branches were followed; saved nowhere. at_top: branches that
    pass the end of the band; None where none were watched there.
    source: where the eigenpairs come from, a name of `modal.source`. band_hz: the frequencies asked for (`between`),
    None for all, and ``outside``, how many onsets there are at others; what grows at both ends, and completeness, are
    of all up to max_frequency_hz.
    """

    onsets: tuple[Onset, ...]
    friction_range: tuple[float, float]
    max_frequency_hz: float
    damped: bool
    open_contacts: tuple[str, ...] = ()
    completeness: str = ""
    at_start: tuple[complex, ...] = ()
    at_end: tuple[complex, ...] = ()
    entering: tuple[tuple[complex, float], ...] = ()
    unexplained: int = 0
    unbalanced: int = 0
    notes: tuple[str, ...] = ()
    contact_state: str = ""
    provenance: dict[str, Any] = field(default_factory=dict)
    source: str = ""
    followed: tuple[Branches, Branches] | None = field(default=None, repr=False, compare=False)
    at_top: tuple[AtTop, ...] | None = field(default=None, repr=False, compare=False)
    band_hz: tuple[float, float] | None = None
    outside: int = 0

    def __len__(self) -> int:
        return len(self.onsets)

    @overload
    def __getitem__(self, which: int) -> Onset: ...
    @overload
    def __getitem__(self, which: slice) -> tuple[Onset, ...]: ...
    def __getitem__(self, which: int | slice) -> Onset | tuple[Onset, ...]:
        return self.onsets[which]

    def __iter__(self) -> Iterator[Onset]:
        return iter(self.onsets)

    def table(self) -> Rows:
        """Heads and rows, as its CSV file has them: a row for each onset."""
        return onsets_rows(self)

    def to_xarray(self) -> Any:
        """xarray.Dataset with dimension onset, as `st.save` writes it."""
        return onsets_dataset(self)

    @property
    def _line(self) -> str:
        low, high = self.friction_range
        first = "" if self.first is None else f"; growth begins at {self.first.words}"
        already = "; something grows from the start" if self.at_start else ""
        return f"{len(self) or 'none'} for μ from {low:g} to {high:g}, {self.frequencies}{already}{first}"

    def _repr_html_(self) -> str:
        heads = ("μ", "frequency [Hz]", "what", "modes", "growth", "slope [1/s]", "residual")
        rows = [
            (
                fixed(o.mu, 6), readable(o.frequency_hz), o.kind, o.branch_words(", "),
                "ends" if o.stabilising else "begins", "" if o.growth_slope is None else readable(o.growth_slope, 4),
                f"{o.residual:.0e}",
            )
            for o in self.onsets
        ]  # fmt: skip
        low, high = self.friction_range
        many = counted(len(self.onsets), "onset")
        title = f"{many[0].upper()}{many[1:]} for μ from {low:g} to {high:g}, {self.frequencies}"
        lines = (*self.at_start_words, *self.from_above_words, self.completeness, self.contact_state, *self.notes)
        return html_table(title, heads, rows, lines)

    @property
    def frequencies(self) -> str:
        """Of which frequencies these are, in words."""
        if self.band_hz is None:
            return f"up to {hertz(self.max_frequency_hz)}"
        return "from {:g} to {:g} Hz".format(*self.band_hz)

    def between(self, low_hz: float, high_hz: float) -> Onsets:
        """The onsets with a frequency from low_hz to high_hz."""
        inside = tuple(o for o in self.onsets if low_hz <= o.frequency_hz <= high_hz)
        return replace(self, onsets=inside, band_hz=(low_hz, high_hz), outside=len(self.onsets) - len(inside))

    @property
    def first(self) -> Onset | None:
        """The lowest μ from which on something grows, or None."""
        return next((o for o in self.onsets if not o.stabilising), None)

    @property
    def at_start_words(self) -> list[str]:
        """What grows before any onset, at a frequency of the band, a line each."""
        low = self.friction_range[0]
        lines: list[str] = []
        bottom, top = self.band_hz or (0.0, float("inf"))
        inside = [lam for lam in self.at_start if bottom <= lam.imag / (2 * pi) <= top]
        for lam in sorted(inside, key=_by_growth):
            if lam.imag == 0.0:
                lines.append(f"diverges already at μ = {low:g}: λ = +{readable(lam.real)} 1/s")
            else:
                lines.append(
                    f"grows already at μ = {low:g}: {readable(lam.imag / (2 * pi))} Hz, +{readable(lam.real)} 1/s"
                )
        for lam, mu in self.entering:
            lines.append(
                f"grows already at μ = {low:g} above the band: {readable(lam.imag / (2 * pi))} Hz, "
                f"+{readable(lam.real)} 1/s; comes into it at μ ≈ {mu:.3g}"
            )
        return lines

    @property
    def from_above_words(self) -> list[str]:
        """Onsets above the band whose mode comes into it, a line each."""
        return [
            from_above("μ", fixed(o.mu, 6), o.frequency_hz, self.max_frequency_hz, o.enters_at)
            for o in self.onsets
            if o.enters_at is not None
        ]

    @property
    def complete(self) -> bool:
        """Whether nothing that was checked says that onsets are missing, or that what was checked with is not whole."""
        return not refuted(self.completeness)

    def to_json(self) -> dict[str, Any]:
        """The document that `stridor onsets --json` prints."""
        return {
            "growing_at_start": [_plain(lam) for lam in self.at_start],
            "growing_above_band_at_start": [{**_plain(lam), "enters_band_at": mu} for lam, mu in self.entering],
            "growing_at_end": [_plain(lam) for lam in self.at_end],
            "unexplained": self.unexplained,
            "onsets": [o.to_json() for o in self.onsets],
            **({"contact_state": self.contact_state} if self.contact_state else {}),
            "friction_range": list(self.friction_range),
            "max_frequency_hz": self.max_frequency_hz,
            **({} if self.band_hz is None else {"band_hz": list(self.band_hz), "onsets_outside_band": self.outside}),
            "damped": self.damped,
            **({"source": self.source} if self.source else {}),
            "open_contacts": list(self.open_contacts),
            **({"completeness": self.completeness} if self.completeness else {}),
            "complete": self.complete,
            **({"notes": list(self.notes)} if self.notes else {}),
        }


NOT_COMPLETE = "NOT COMPLETE"
REFUTED = (NOT_COMPLETE, "NOT CONFIRMED", "INCOMPLETE", "Not complete")


def refuted(completeness: str) -> bool:
    """Whether the search in the full problem has not borne out a list, or was not complete itself."""
    return any(word in completeness for word in REFUTED)


def from_above(name: str, value: str, frequency_hz: float, max_frequency_hz: float, enters_at: float) -> str:
    """What is said of an onset above the band whose mode comes into it."""
    return (
        f"* {name} = {value} begins at {readable(frequency_hz)} Hz, above the band up to {max_frequency_hz:g} Hz, and "
        f"enters it at {name} ≈ {enters_at:.3g}"
    )


def _by_growth(lam: complex) -> float:
    return -lam.real


def _plain(lam: complex) -> dict[str, Any]:
    return {
        "frequency_hz": lam.imag / (2 * pi),
        "growth_rate": lam.real,
        "kind": "divergence" if lam.imag == 0.0 else "flutter",
    }

"""What the modal approach gives: complex modes at one or many μ."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any, Literal, TypeVar, overload

import numpy as np

from ..digits import readable
from ..errors import CaseError
from ..notebook import counted, html_table
from ..tabular import Rows, Tabular
from ..typing import Array, BoolArray, ComplexArray, IntArray
from .branch import Branch
from .rates import Rates
from .tables import modes_dataset, modes_rows
from .tolerances import UNSTABLE_RELATIVE

MOST_BYTES = 4e9  # of eigenvalues and vectors held at one time
LEAST = 1e-5  # of the band: what |λ| is taken to be at least for that
BORDER = 1e-12  # of the band: what rounding may put a mode outside by

T = TypeVar("T")
Progress = Callable[[int, int], None]


@dataclass(frozen=True, repr=False)
class ComplexModes(Rates, Tabular):
    """Modes over μ (k,), one column per branch (b,): a sequence of `Branch`, and of a slice of it modes again.

    eigenvalues λ (k, b) [1/s]: growth rate + j angular frequency. branch (b,) numbers the modes from
    1 by frequency at μ = 0. residual (k, b): componentwise backward error in the assembled matrices, NaN
    where it was not asked for, which leaves λ as the contacts' receptance gives it, to about 1e-9 of |λ|.
    right, left (k, b, n) unit vectors where asked for, else None. damped: whether C was used.
    open_contacts: contacts that carry no load in steady sliding and so take no part. completeness: of matrices without
    structure, for each μ what speaks for no mode of the band being missed, and what the numbers are if branches could
    not be followed; of all others which of these μ were checked in the full problem. Where a branch is not known there
    is NaN. max_frequency_hz: the end of the band, None where modes were counted; ``held`` (k,): how many modes of the
    band there are at each μ, where not all of them are kept here. notes: what else is to be known. planned: how many μ
    were asked for, where it was interrupted before the last. contact_state: where contacts may stick, how many nodes
    stick, slip and are open, and at which μ; they do so at every μ of the list. source: where the eigenpairs come from,
    a name of `modal.source`. band_hz: the frequencies asked for (`between`), None for all, and unstable_outside (k,):
    how many modes up to max_frequency_hz grow at each μ at other ones. unsolved (k,): at which μ nothing was solved, as
    there is no steady sliding (None: at none of them); their rows are NaN, and neither stable nor unstable: `unstable`
    and `total` count no mode there, which says nothing of them.
    """

    mu: Array
    eigenvalues: ComplexArray  # ty: ignore[incompatible-attribute-override]
    branch: IntArray
    residual: Array
    damped: bool
    right: ComplexArray | None = None
    left: ComplexArray | None = None
    open_contacts: tuple[str, ...] = ()
    completeness: tuple[str, ...] = ()
    contact_state: str = ""
    provenance: dict[str, Any] = field(default_factory=dict)
    max_frequency_hz: float | None = None
    held: IntArray | None = None
    notes: tuple[str, ...] = ()
    planned: int | None = None
    source: str = ""
    band_hz: tuple[float, float] | None = None
    unstable_outside: IntArray | None = None
    unsolved: BoolArray | None = None

    @property
    def unstable(self) -> BoolArray:
        """Whether Re λ > 0 beyond rounding (k, b); False as well where λ is not known (`solved`)."""
        return grows(self.eigenvalues, self._top)

    @property
    def _top(self) -> float:
        """The highest angular frequency [1/s] that matters, which says what is none: a band may reach far beyond the
        fastest mode."""
        size = np.abs(self.eigenvalues)
        fastest = float(size[np.isfinite(size)].max(initial=0.0))
        return fastest if self.max_frequency_hz is None else min(2 * np.pi * self.max_frequency_hz, fastest / LEAST)

    @property
    def in_band(self) -> BoolArray:
        """Whether a mode is known at a μ and of a frequency of the band (k, b). Of two real branches that have met, one
        goes on with the conjugate of the other's λ: that is no mode beside it."""
        known = np.isfinite(self.eigenvalues)
        known = known & (self.eigenvalues.imag >= -UNSTABLE_RELATIVE * np.abs(self.eigenvalues))
        if self.max_frequency_hz is not None:
            known = known & (self.frequency_hz <= self.max_frequency_hz * (1 + BORDER))
        return known if self.band_hz is None else known & self._within(*self.band_hz)

    def _within(self, low: float, high: float) -> BoolArray:
        return (self.frequency_hz >= low * (1 - BORDER)) & (self.frequency_hz <= high * (1 + BORDER))

    @property
    def total(self) -> IntArray:
        """How many modes of the band there are at each μ (k,), kept here or not."""
        return self.in_band.sum(axis=1) if self.held is None else self.held

    @property
    def solved(self) -> BoolArray:
        """At which μ (k,) modes were solved: at the others nothing is said of what grows."""
        return np.ones(len(self.mu), dtype=np.bool_) if self.unsolved is None else ~self.unsolved

    def counts(self, numbers: IntArray) -> list[int | None]:
        """How many at each μ (k,), None where nothing was solved."""
        return [int(n) if known else None for n, known in zip(numbers, self.solved, strict=True)]

    @property
    def interrupted(self) -> bool:
        """Whether friction coefficients that were asked for are missing."""
        return self.planned is not None

    def __len__(self) -> int:
        return len(self.branch)

    @overload
    def __getitem__(self, which: int) -> Branch: ...
    @overload
    def __getitem__(self, which: slice) -> ComplexModes: ...
    def __getitem__(self, which: int | slice) -> Branch | ComplexModes:
        if isinstance(which, slice):
            kept = self.chosen(np.arange(len(self))[which])
            return replace(kept, held=self.total)
        b = range(len(self))[which]
        return Branch(
            int(self.branch[b]), self.mu, self.eigenvalues[:, b], self.residual[:, b], self.unstable[:, b],
            None if self.right is None else self.right[:, b], None if self.left is None else self.left[:, b],
        )  # fmt: skip

    def __iter__(self) -> Iterator[Branch]:
        return (self[b] for b in range(len(self)))

    def table(self) -> Rows:
        """Heads and rows, as its CSV file has them: a row for each mode of the band at each μ."""
        return modes_rows(self)

    def to_xarray(self) -> Any:
        """xarray.Dataset with dimensions mu and branch, as `st.save` writes it."""
        return modes_dataset(self)

    @property
    def _line(self) -> str:
        growing = int(np.any(self.unstable & self.in_band, axis=0).sum())
        at = f"at μ = {self.mu[0]:g}" if len(self.mu) == 1 else f"at {len(self.mu)} friction coefficients"
        if len(self.mu) > 1:
            at += f", {self.mu.min():g} to {self.mu.max():g}"
        if none := int(np.count_nonzero(~self.solved)):
            at += f", nothing solved at {none} of them"
        return f"{counted(len(self), 'mode')} {at}; {growing or 'none'} unstable"

    def _repr_html_(self) -> str:
        marks = self.unstable & self.in_band
        if len(self.mu) == 1:
            heads = ("mode", "frequency [Hz]", "growth [1/s]", "damping ratio", "", "residual")
            ratio = self.damping_ratio
            rows = [
                (
                    int(self.branch[b]), readable(self.frequency_hz[0, b]), readable(self.growth_rate[0, b], 4),
                    readable(ratio[0, b], 4), "unstable" if marks[0, b] else "", _error(float(self.residual[0, b])),
                )
                for b in self.order(0)
            ]  # fmt: skip
            return html_table(f"Complex modes at μ = {self.mu[0]:g}", heads, rows, self._told)
        growth = np.where(marks, self.growth_rate, -np.inf)
        fastest = growth.argmax(axis=1) if marks.size else np.zeros(len(self.mu), dtype=np.int64)
        rows = [
            (
                f"{mu:g}", *((self.total[k], int(marks[k].sum())) if self.solved[k] else ("not solved", "")),
                readable(self.frequency_hz[k, b]) if marks[k].any() else "",
                readable(self.growth_rate[k, b], 4) if marks[k].any() else "",
            )
            for k, (mu, b) in enumerate(zip(self.mu, fastest, strict=True))
        ]  # fmt: skip
        heads = ("μ", "modes", "unstable", "the fastest [Hz]", "[1/s]")
        return html_table(f"Complex modes at {len(self.mu)} friction coefficients", heads, rows, self._told)

    @property
    def _of_band(self) -> dict[str, Any]:
        """What a document says of the band where one was asked for."""
        if self.band_hz is None or self.unstable_outside is None:
            return {}
        return {"band_hz": list(self.band_hz), "unstable_outside_band": self.counts(self.unstable_outside)}

    @property
    def _told(self) -> list[str]:
        """What is to be known beside the numbers, a line each."""
        cut = [] if self.planned is None else [f"interrupted: {len(self.mu)} of {self.planned} friction coefficients"]
        band = [] if self.band_hz is None else ["only modes from {:g} to {:g} Hz".format(*self.band_hz)]
        return [*band, *cut, *self.completeness, self.contact_state, *self.notes]

    def chosen(self, columns: IntArray) -> ComplexModes:
        """These columns (c,) alone."""
        return replace(
            self,
            eigenvalues=self.eigenvalues[:, columns],
            branch=self.branch[columns],
            residual=self.residual[:, columns],
            right=None if self.right is None else self.right[:, columns],
            left=None if self.left is None else self.left[:, columns],
        )

    def lowest(self, count: int) -> ComplexModes:
        """The ``count`` branches of lowest number, and every other one that is unstable in the band at some μ. What
        only decays, faster than the slowest vibration turns, comes last: of strong damping there is more of that than
        of vibrations."""
        unstable = np.any(self.unstable & self.in_band, axis=0)
        size, swings = np.abs(self.eigenvalues), np.any(self.eigenvalues.imag > 0, axis=0)
        slowest = float(np.nanmin(size[:, swings], initial=np.inf))
        decays = ~swings & np.all((self.eigenvalues.real < 0) & (size > slowest), axis=0)
        first = np.zeros(len(self.branch), dtype=bool)
        first[np.argsort(decays, kind="stable")[:count]] = True
        return replace(self.chosen(np.flatnonzero(first | unstable)), held=self.total)

    def between(self, low_hz: float, high_hz: float) -> ComplexModes:
        """The branches with a frequency from low_hz to high_hz at one of these μ at least, under their own numbers.

        What is counted, listed and said to be in the band at a μ is what lies there at that μ. Takes modes of which
        none was left out: `modes` with max_frequency_hz. Raises CaseError for others.
        """
        if self.held is not None and np.any(self.held != self.in_band.sum(axis=1)):
            raise CaseError("band_hz", [low_hz, high_hz], "goes before the choice of the lowest modes, not after it")
        inside = self.in_band & self._within(low_hz, high_hz)
        growing = self.unstable & self.in_band
        kept = self.chosen(np.flatnonzero(inside.any(axis=0)))
        outside = np.count_nonzero(growing & ~inside, axis=1)
        return replace(kept, held=None, band_hz=(low_hz, high_hz), unstable_outside=outside)

    def order(self, row: int, sort: Literal["frequency", "growth"] = "frequency") -> IntArray:
        """Columns of the modes of the band at one μ, by frequency, or the fastest growing first."""
        inside = np.flatnonzero(self.in_band[row])
        keys = self.frequency_hz[row, inside] if sort == "frequency" else -self.growth_rate[row, inside]
        return inside[np.argsort(keys, kind="stable")]

    def at(self, mu: float) -> int:
        """Row of the μ nearest to ``mu``."""
        return int(np.argmin(np.abs(self.mu - mu)))

    def to_json(
        self, *, sort: Literal["frequency", "growth"] = "frequency", unstable: bool = False
    ) -> dict[str, Any]:
        """The document that `stridor modes --json` prints; ``unstable``: of these modes alone."""
        rows: list[list[dict[str, Any]]] = []
        marks, ratio = self.unstable, self.damping_ratio
        for k in range(len(self.mu)):
            rows.append(
                [
                    {
                        "frequency_hz": float(self.frequency_hz[k, b]),
                        "growth_rate": float(self.growth_rate[k, b]),
                        "damping_ratio": float(ratio[k, b]),
                        "unstable": bool(marks[k, b]),
                        "residual": float(self.residual[k, b]) if np.isfinite(self.residual[k, b]) else None,
                        "branch": int(self.branch[b]),
                    }
                    for b in self.order(k, sort)
                    if marks[k, b] or not unstable
                ]
            )
        return {
            "mu": [float(m) for m in self.mu],
            "modes": rows,
            "unstable_modes": self.counts(np.sum(marks & self.in_band, axis=1)),
            "modes_in_band": self.counts(self.total),
            "max_frequency_hz": self.max_frequency_hz,
            **self._of_band,
            "damped": self.damped,
            **({"source": self.source} if self.source else {}),
            "open_contacts": list(self.open_contacts),
            **({"completeness": list(self.completeness)} if self.completeness else {}),
            **({"contact_state": self.contact_state} if self.contact_state else {}),
            **({"notes": list(self.notes)} if self.notes else {}),
            **({"interrupted_of": self.planned} if self.planned is not None else {}),
        }


def _error(residual: float) -> str:
    return f"{residual:.0e}" if np.isfinite(residual) else ""


def grows(values: ComplexArray, top: float) -> BoolArray:
    """Whether Re λ > 0 beyond rounding, of a problem whose highest frequency of interest is top [1/s]."""
    with np.errstate(invalid="ignore"):
        return values.real > UNSTABLE_RELATIVE * np.maximum(np.abs(values), LEAST * top)


def off_rounding(values: ComplexArray, rounding: float) -> ComplexArray:
    """Eigenvalues (k,) whose real part may be rounding, a share of |λ|, put on the imaginary axis."""
    return np.where(np.abs(values.real) <= rounding * np.abs(values), 1j * values.imag, values)


def at_each(
    values: Array, solve: Callable[[float], T], progress: Progress | None = None
) -> tuple[Array, list[T], int | None]:
    """The μ (k,), what ``solve`` gives at each, called from the lowest to the highest, and how many μ there were to be
    where it was interrupted. Raises KeyboardInterrupt where nothing is done yet."""
    found: dict[int, T] = {}
    try:
        for at, k in enumerate(np.argsort(values, kind="stable").tolist(), start=1):
            found[k] = solve(float(values[k]))
            if progress is not None:
                progress(at, len(values))
    except KeyboardInterrupt:
        if not found:
            raise
    done = np.array(sorted(found))
    return values[done], [found[k] for k in sorted(found)], None if len(done) == len(values) else len(values)


def require_memory(rows: int, columns: int, freedoms: int = 0) -> None:
    """Raise CaseError where modes at that many μ, with vectors of so many freedoms, take more memory than there is to
    be had."""
    needed = 64.0 * rows * columns + 32.0 * rows * columns * freedoms
    if needed > MOST_BYTES:
        fits = int(rows * MOST_BYTES / needed)
        raise CaseError(
            "mu", f"{rows} friction coefficients",
            f"at most {fits} of them: with {columns} modes each takes {needed / rows / 1e3:.3g} kB, all of them "
            f"{needed / 1e9:.3g} GB of {MOST_BYTES / 1e9:g} GB; take fewer, or a lower modal.max_frequency_hz",
        )  # fmt: skip

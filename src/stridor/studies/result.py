"""What a store of a study says: rows, how likely squeal is, what was confirmed."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ..asking import PATH, SWITCH, takes
from ..errors import AnalysisError, CaseError
from ..notebook import Shown, counted, html_table
from ..tabular import Cell, Rows, Tabular
from ..typing import Array, BoolArray, IntArray
from .schema import Study
from .store import DONE, FAILED, PENDING, dataset
from .tables import EMPTY, OF_ONSETS, ROUNDING, SAME
from .uncertainty import Indices, Probability, grows, in_bands, probability, sobol_indices

BANDS = 8  # of frequency, where nobody says which
MOSTLY = 0.95  # of the modes or samples: a share from which on what the others lack is left aside


@dataclass(frozen=True)
class BranchSpread:
    """How a branch scatters: its number, frequency [Hz] and growth rate [1/s] at the 5th, 50th and 95th percentile, and
    the share of samples in which it grows; ``samples`` has it, of which a few may lack a number."""

    number: int
    frequency_hz: tuple[float, float, float]
    growth_rate: tuple[float, float, float]
    grows: float
    samples: int


@dataclass(frozen=True, repr=False)
class StudyResult(Tabular, Shown):
    """A study as its store has it: ``data``, an xarray.Dataset with a row for each sample.

    path: the store. interrupted: Ctrl-C came before all rows were computed. What failed has its error in its row, and
    no part in probabilities and indices, which say so."""

    path: Path
    data: Any
    interrupted: bool = False

    @property
    def parameters(self) -> tuple[str, ...]:
        """Their paths."""
        return tuple(json.loads(self.data.attrs["parameters"]))

    @cached_property
    def study(self) -> Study:
        """The study itself."""
        return Study.from_document(json.loads(self.data.attrs["study"]))

    @property
    def compute(self) -> str:
        """What was computed."""
        return str(json.loads(self.data.attrs["study"])["compute"])

    @property
    def status(self) -> IntArray:
        """0 not computed, 1 computed, 2 failed (n,)."""
        return np.asarray(self.data["status"].values, dtype=np.int64)

    @property
    def done(self) -> BoolArray:
        """Which rows have results (n,)."""
        return self.status == DONE

    @property
    def failed(self) -> IntArray:
        """Places of rows that failed."""
        return np.flatnonzero(self.status == FAILED)

    @property
    def pending(self) -> int:
        """How many rows are not computed yet."""
        return int(np.count_nonzero(self.status == PENDING))

    @property
    def unstable(self) -> BoolArray:
        """Whether something grows, of the rows that have results: a mode at the row's friction, or from an onset in the
        range of friction on."""
        if self.compute == "modes":
            return np.asarray(self.data["unstable_modes"].values[self.done] > 0)
        if self.compute == "onsets":
            data = self.data
            grows = np.isfinite(data["critical_mu"].values) | (data["growing_at_start"].values > 0)
            return np.asarray(grows[self.done])
        raise AnalysisError(f"{self.compute} says nothing about modes that grow; compute modes or onsets")

    def probability(self, confidence: float = 0.95) -> Probability:
        """How likely something grows. Of the method "saltelli" the samples that are drawn by themselves count, not the
        others, in which one number is exchanged. Raises AnalysisError for a grid, whose points are none of a
        distribution, and where modes were not computed."""
        self._random("a probability")
        return probability(self.unstable[self._drawn[self.done]], confidence)

    def probability_in_bands(self, edges: Sequence[float] | None = None, confidence: float = 0.95) -> list[
        tuple[float, float, Probability]
    ]:
        """How likely a mode grows in each band of frequencies [Hz]: low, high, probability."""
        self._random("a probability")
        if self.compute != "modes":
            raise AnalysisError("bands of frequency are those of modes; compute modes")
        frequency, growth = (self.data[name].values[self.done] for name in ("frequency_hz", "growth_rate"))
        growing = frequency[grows(frequency, growth)]
        low, high = (growing.min(), growing.max()) if growing.size else (0.0, 1.0)
        ends: list[float] = np.linspace(0.999 * low, 1.001 * high, BANDS + 1).tolist() if edges is None else [*edges]
        happened = in_bands(frequency, growth, ends)
        happened = happened[self._drawn[self.done]]
        shares = [probability(happened[:, k], confidence) for k in range(happened.shape[1])]
        return [(ends[k], ends[k + 1], share) for k, share in enumerate(shares)]

    @property
    def _drawn(self) -> BoolArray:
        """Which samples (n,) are drawn by themselves: of "saltelli" the first and the last of each p + 2."""
        count = len(self.status)
        if self.method != "saltelli":
            return np.ones(count, dtype=bool)
        place, size = self.data["number"].values % (len(self.parameters) + 2), len(self.parameters) + 2
        return (place == 0) | (place == size - 1)

    @cached_property
    def _followed(self) -> bool:
        """Whether all but a few of the modes kept have the number of their branch."""
        data = self.data
        known = np.isfinite(data["frequency_hz"].values[self.done])
        return bool(np.count_nonzero(data["branch"].values[self.done][known] > 0) >= MOSTLY * np.count_nonzero(known))

    @property
    def branch_words(self) -> str:
        """By what `branches` tells modes apart."""
        return "by branch from μ = 0" if self._followed else "by place in frequency"

    def branches(self) -> list[BranchSpread]:
        """Spread of the modes that all samples have, or all but 5 %: by the number of their branch, as `modes` counts
        them from μ = 0. Where those are not known, by their place in frequency, where modes may change places; none of
        those of which some rows have kept no mode."""
        data = self.data
        frequency, growth, branch = (data[n].values[self.done] for n in ("frequency_hz", "growth_rate", "branch"))
        if not self._followed:
            if np.any(data["modes_of_band"].values[self.done] > frequency.shape[1]):
                return []
            branch = np.where(np.isfinite(frequency), np.arange(1, frequency.shape[1] + 1), 0)
        found: list[BranchSpread] = []
        for number in np.unique(branch[branch > 0]).tolist():
            inside = (branch == number) & np.isfinite(frequency)
            samples = int(np.count_nonzero(inside))
            if samples < (MOSTLY if self._followed else 1.0) * len(frequency):
                continue
            f, g = (tuple(np.quantile(v[inside], (0.05, 0.5, 0.95)).tolist()) for v in (frequency, growth))
            share = float(np.mean(grows(frequency[inside], growth[inside])))
            found.append(BranchSpread(int(number), f, g, share, samples))  # type: ignore[arg-type]
        return found

    def indices(self, of: str | None = None) -> Indices:
        """Sobol indices of a result of one number a row (default: the largest growth rate, or the critical μ). Raises
        AnalysisError for other methods than "saltelli", rows without a result and a part of a study."""
        if self.method != "saltelli":
            raise AnalysisError(f'Sobol indices need sampling.method = "saltelli", not "{self.method}"')
        if part := str(self.data.attrs.get("part", "")):
            # Samples stand in blocks of p + 2, which a part may cut through: a fraction of them says something else.
            raise AnalysisError(
                f"these are part {part} of the rows and Sobol indices need every one; put the parts together (--merge)"
            )
        name = of or {"modes": "largest_growth_rate", "onsets": "critical_mu"}.get(self.compute, "")
        if name not in self.data or self.data[name].dims != ("row",):
            known = ", ".join(str(n) for n, v in self.data.items() if v.dims == ("row",) and v.dtype.kind == "f")
            raise CaseError("of", of, f"a result with one number a row: {known}")
        values, note = np.array(self.data[name].values, dtype=float), ""
        if name == "critical_mu":
            # A row without onset is stable up to the end of the range: its onset lies there at least. One that grows at
            # the low end has its own there at most.
            none = self.done & ~np.isfinite(values)
            low, top = (float(end) for end in self.study.base().modal.friction_range)
            values[none] = top
            early = int(np.count_nonzero(self.done & (self.data["growing_at_start"].values > 0)))
            if none.any():
                note = f"{int(none.sum())} rows without an onset count with the end of the range of friction, {top:g}"
            if early:
                also = f"{early} rows that grow at the low end of that range count with it, {low:g}"
                note = f"{note}; {also}" if note else also
        return sobol_indices(name, self.parameters, values, note=note)

    @property
    def method(self) -> str:
        """How samples were taken."""
        return str(json.loads(self.data.attrs["study"]).get("sampling", {}).get("method", "grid"))

    @property
    def notes(self) -> tuple[str, ...]:
        """What is to be known before the numbers are used."""
        told: list[str] = []
        if self.pending:
            told.append(f"{self.pending} of {len(self.status)} rows are not computed yet")
        if len(self.failed):
            why = str(self.data["error"].values[self.failed[0]])
            told.append(f"{counted(len(self.failed), 'row')} failed, the first: {why}")
        told += self._confirmed()
        noted = int(np.count_nonzero(self.data["note"].values != ""))
        if self.compute == "compare":  # whose note is its verdict
            agree = np.asarray(self.data["agree"].values)[self.done]
            if unlike := int(np.count_nonzero(agree == 0)):
                told.append(f"in {counted(unlike, 'row')} both approaches do not agree (`note` says in what)")
            if open_ := int(np.count_nonzero(agree < 0)):
                told.append(f"in {counted(open_, 'row')} it is not decided whether they do (`note` says why)")
        elif noted:
            told.append(f"{counted(noted, 'row')} with something against the result (`note`)")
        told += self._told("completed") or []
        told += self._told("without_effect") or []
        return tuple(told)

    def _confirmed(self) -> list[str]:
        """How many rows the reduced model answered, and what the full problem says of them."""
        if "confirmed" not in self.data:
            return []
        confirmed = np.asarray(self.data["confirmed"].values)[self.done]
        alone = np.asarray(self.data["source"].values)[self.done] == "reduced"
        answered = int(np.count_nonzero(alone))
        both = int(np.count_nonzero(confirmed > 0))
        if not answered and not both:
            return []
        off = np.asarray(self.data["difference"].values)[self.done]
        error = np.asarray(self.data["estimated_error"].values)[self.done]
        # An estimate above EMPTY says nothing, and of rows that were solved in full nothing stands on it.
        known = error[alone & np.isfinite(error)]
        worst = f", estimated error {known.max():.1e} at most" if len(known) and known.max() <= EMPTY else ""
        lines = [f"{answered or 'no'} rows by a reduced model alone{worst}; {both} solved in full as well"]
        wrong = int(np.count_nonzero(confirmed == 2))
        if wrong:
            lines.append(
                f"{wrong} of these {both} differ from the full problem (by {np.nanmax(off):.1e}): rows that were not "
                'solved in full are not to be trusted; ask for answers.source = "full"'
            )
        elif both:
            lines[0] += f", off by {np.nanmax(off):.1e} at most"
            if not np.any(error[confirmed > 0] > EMPTY):
                lines[0] += f", none by more than {self._allowed}"
        return lines

    @property
    def _allowed(self) -> str:
        """What counts as confirmed."""
        least = OF_ONSETS if self.compute == "onsets" else ROUNDING
        return f"{SAME:g} times the estimate or {least:g}"

    def _told(self, name: str) -> Any:
        text = self.data.attrs.get(name)
        return None if text is None else json.loads(text)

    def _random(self, what: str) -> None:
        if self.method == "grid":
            raise AnalysisError(f"{what} needs samples of a distribution; a grid is none")

    # -- as a table ----------------------------------------------------------------------------------------------------
    def table(self) -> Rows:
        """Heads and rows, as study.csv has them: parameters, then every result of one number or word a row."""
        names = ["number", *self.parameters]
        names += [str(n) for n, v in self.data.items() if v.dims == ("row",)]
        columns = [self.data[name].values.tolist() for name in names]
        rows: list[list[Cell]] = [[_cell(column[k]) for column in columns] for k in range(len(self.status))]
        return names, rows

    def to_xarray(self) -> Any:
        """xarray.Dataset with dimension row, as the store has it."""
        return self.data

    @property
    def _line(self) -> str:
        varied = ", ".join(self.parameters)
        left = f", {self.pending} to come" if self.pending else ""
        bad = f", {len(self.failed)} failed" if len(self.failed) else ""
        return f"{self.compute} of {counted(int(self.done.sum()), 'sample')} over {varied}{bad}{left}"

    def _repr_html_(self) -> str:
        heads, rows = self.table()
        return html_table(f"Study: {self._line}", heads[:8], [row[:8] for row in rows], self.notes)


def _cell(value: Any) -> Cell:
    return None if isinstance(value, float) and not np.isfinite(value) else value


@takes(path=PATH, interrupted=SWITCH)
def open_study(path: str | Path, *, interrupted: bool = False) -> StudyResult:
    """The store of a study, or the folder that it lies in. Raises CaseError where there is none or it is damaged."""
    location = Path(path)
    if location.is_dir() and (location / "study.zarr").is_dir():
        location = location / "study.zarr"
    return StudyResult(location, dataset(location), interrupted)


def numbers(result: StudyResult, name: str) -> Array:
    """A column of numbers of the rows that have results."""
    return np.asarray(result.data[name].values, dtype=float)[result.done]

"""How likely squeal is, how sure that is, and which numbers it depends on."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from ..errors import AnalysisError
from ..modal.tolerances import UNSTABLE_RELATIVE
from ..typing import Array, BoolArray
from .sampling import salib

RESAMPLES = 200  # of the intervals of Sobol indices
# Points of a scrambled Sobol sequence are not independent, and resampling knows neither that nor a rare large value
# that is not among them: between 80 % and all of the intervals of known functions hold the truth, not 95 %.
COVERS = "± by resampling, too narrow at times: studies with other seeds tell"


@dataclass(frozen=True)
class Probability:
    """A share of samples with its interval (Wilson's), which of independent samples holds the truth ``confidence`` of
    the time; shares of a low-discrepancy sequence lie closer to it, so that for them it is wide."""

    value: float
    low: float
    high: float
    count: int
    of: int
    confidence: float

    @property
    def half_width(self) -> float:
        """Half the width of the interval."""
        return (self.high - self.low) / 2

    @property
    def words(self) -> str:
        """In a sentence."""
        if not self.of:
            return "no sample has a result"
        return (
            f"{self.count} of {self.of} samples: {100 * self.value:.3g} %, "
            f"{100 * self.confidence:g} % interval {100 * self.low:.3g} to {100 * self.high:.3g} %"
        )

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        names = ("value", "low", "high", "count", "of", "confidence")
        return {name: getattr(self, name) for name in names}


def probability(happened: BoolArray, confidence: float = 0.95) -> Probability:
    """Share of samples (n,) in which something happens. E. B. Wilson, J. Am. Stat. Assoc. 22 (1927) 209–212:

    (p + z²/2n ± z √(p(1−p)/n + z²/4n²)) / (1 + z²/n)
    """
    n, k = len(happened), int(np.count_nonzero(happened))
    if not n:
        return Probability(math.nan, 0.0, 1.0, 0, 0, confidence)
    z, p = _score(confidence), k / n
    middle, spread = p + z * z / (2 * n), z * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    scale = 1 + z * z / n
    # Of none and of all one end is exact, but for rounding.
    low = max((middle - spread) / scale, 0.0) if k else 0.0
    high = min((middle + spread) / scale, 1.0) if k < n else 1.0
    return Probability(p, low, high, k, n, confidence)


def missing_samples(known: Probability, half_width: float) -> int:
    """How many samples there are to be in all for an interval of that half width, if the share stays what it is."""
    z, p = _score(known.confidence), known.value
    n = max(known.of, 1)
    while True:
        spread = z * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n)) / (1 + z * z / n)
        if spread <= half_width:
            return n
        n = max(n + 1, int(n * min((spread / half_width) ** 2, 2.0)))


def _score(confidence: float) -> float:
    from scipy.stats import norm

    return float(norm.ppf(0.5 + confidence / 2))


@dataclass(frozen=True)
class Indices:
    """Sobol indices of a result: first order (p,) and total (p,), half-widths of both by resampling, and what was left
    out or put in the place of what is missing.

    The half-widths are 1.96 standard deviations over resampled points, as if these were independent. With 64 to 512
    samples of functions whose indices are known, intervals held the truth in 80 to 100 % of the seeds, depending on the
    function and the index (Ishigami's: 84 to 100 %); indices over several seeds tell how far they scatter.
    """

    of: str
    names: tuple[str, ...]
    first: Array
    total: Array
    first_half_width: Array
    total_half_width: Array
    note: str = ""

    def to_json(self) -> dict[str, Any]:
        """Plain values, a row for each parameter."""
        columns = ("first", "total", "first_half_width", "total_half_width")
        rows = [
            {"parameter": name, **{c: float(getattr(self, c)[k]) for c in columns}} for k, name in enumerate(self.names)
        ]
        return {"of": self.of, "indices": rows, "note": self.note}


def sobol_indices(of: str, names: Sequence[str], values: Array, *, note: str = "") -> Indices:
    """Indices of a result (n,) over the samples of the method "saltelli", in their order (SALib; Saltelli et al.,
    Comput. Phys. Commun. 181 (2010) 259–270). Raises AnalysisError for rows without a result, and where nothing
    varies."""
    if not np.all(np.isfinite(values)):
        missing = int(np.count_nonzero(~np.isfinite(values)))
        raise AnalysisError(f"{of}: {missing} of {len(values)} rows have no result; Sobol indices need every one")
    if np.ptp(values) == 0.0:
        raise AnalysisError(f"{of} is the same in all rows: nothing depends on anything")
    analyse = salib("analyze.sobol").analyze
    problem: Mapping[str, Any] = {"num_vars": len(names), "names": list(names), "bounds": [[0, 1]] * len(names)}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = analyse(problem, np.asarray(values), calc_second_order=False, num_resamples=RESAMPLES, seed=1)
    parts = (np.asarray(found[key], dtype=float) for key in ("S1", "ST", "S1_conf", "ST_conf"))
    return Indices(of, tuple(names), *parts, note=note)


def grows(frequency: Array, growth: Array) -> BoolArray:
    """Which modes, of frequencies [Hz] and growth rates [1/s], grow beyond rounding; none where there is NaN."""
    with np.errstate(invalid="ignore"):
        return np.asarray(growth > UNSTABLE_RELATIVE * np.hypot(2 * np.pi * frequency, growth))


def in_bands(frequency: Array, growth: Array, edges: Sequence[float]) -> BoolArray:
    """Whether a mode grows in each band (n, b) of frequencies ``edges`` (b + 1,) [Hz]; frequency, growth (n, k)."""
    growing = grows(frequency, growth)
    return np.stack(
        [np.any(growing & (frequency >= low) & (frequency < high), axis=1) for low, high in pairwise(edges)], axis=1
    )

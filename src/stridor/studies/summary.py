"""A study in words and small tables: what the program prints and the page shows."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence

import numpy as np

from ..digits import measured
from ..errors import AnalysisError
from ..notebook import counted
from .result import StudyResult, numbers
from .uncertainty import COVERS

Line = Sequence[str]
Listing = tuple[str, Line, Sequence[Line]]
MOST_FAILURES = 8
_NUMBERS = {
    "modes": ("largest_growth_rate", "largest_growth_frequency_hz", "unstable_modes"),
    "onsets": ("critical_mu", "critical_frequency_hz", "onsets"),
    "steady": ("normal_force", "largest_node_force", "open_nodes", "sticking_nodes", "slipping_nodes"),
    "simulate": (
        "velocity_rms", "dominant_frequency_hz", "stronger_below_hz", "stick_fraction", "slip_fraction",
        "separation_fraction",
    ),
    "compare": ("modal_frequency_hz", "modal_growth_rate", "growth_rate_in_time", "agree"),
}


def answer(result: StudyResult) -> str:
    """The result in a sentence; how many samples have none belongs to it."""
    left = [f"{len(result.failed)} failed"] if len(result.failed) else []
    left += [f"{result.pending} not computed yet"] if result.pending else []
    return _answer(result) + (f"; of the other samples {', '.join(left)}" if left and result.done.any() else "")


def undrawn(result: StudyResult, figures: int) -> str:
    """What so many figures do not show, in words that go on from `answer`; "" where they show every sample."""
    if not figures:
        done = int(result.done.sum())
        if not done:
            return "no figure: no sample has a result"
        where = "results of the one sample" if done == 1 else f"results of {done} samples"
        return f"no figure: no parameter has more than one value; {where} are in the table of report.html"
    return "the figures do not show these" if len(result.failed) or result.pending else ""


def _answer(result: StudyResult) -> str:
    done = int(result.done.sum())
    if not done:
        return f"none of {len(result.status)} samples has a result"
    if result.compute == "compare":
        agree = int(np.count_nonzero(np.asarray(result.data["agree"].values)[result.done] == 1))
        return f"both approaches agree in {agree} of {counted(done, 'sample')}"
    if result.compute not in ("modes", "onsets"):
        return f"{counted(done, 'sample')} of {result.compute}"
    grows = int(result.unstable.sum())
    what = "a mode grows" if result.compute == "modes" else "a mode grows somewhere in the range of friction"
    if result.method in ("grid", "saltelli"):
        return f"{what} at {grows} of {done} samples"
    known = result.probability()
    return (
        f"{what} with a probability of {100 * known.value:.3g} % (95 % interval {100 * known.low:.3g} to "
        f"{100 * known.high:.3g} %; {grows} of {done} samples)"
    )


def tables(result: StudyResult) -> list[Listing]:
    """Titles, heads and rows: what the results are over all samples, bands of frequency, Sobol indices."""
    found: list[Listing] = []
    if not result.done.any():
        return found
    names = [name for name in _NUMBERS[result.compute] if name in result.data]
    rows = [row for name in names if (row := _spread(result, name)) is not None]
    found.append(("Over all samples", ("result", "least", "5 %", "median", "95 %", "largest", "samples"), rows))
    if result.compute == "modes" and result.method not in ("grid", "saltelli") and result.unstable.any():
        bands = [
            (_band(low, high), f"{100 * p.value:.3g}", f"{100 * p.low:.3g} to {100 * p.high:.3g}")
            for low, high, p in result.probability_in_bands()
        ]
        found.append(("How likely a mode grows", ("band [Hz]", "probability [%]", "95 % interval [%]"), bands))
    if result.method == "saltelli":
        found += _indices(result)
    return found


def _band(low: float, high: float) -> str:
    """A band with as many decimals as tell its ends apart, in two digits of its width."""
    width = high - low
    decimals = max(1 - math.floor(math.log10(width)), 0) if width > 0.0 else 0
    return f"{measured(low, decimals)} to {measured(high, decimals)}"


def _indices(result: StudyResult) -> list[Listing]:
    """Sobol indices as a table, or why there are none as its title."""
    try:
        indices = result.indices()
    except AnalysisError as error:
        return [(f"No Sobol indices: {error}", ("parameter",), [])]
    order = np.argsort(-indices.total)
    rows = [
        (
            indices.names[k],
            f"{indices.first[k]:.3f} ± {indices.first_half_width[k]:.3f}",
            f"{indices.total[k]:.3f} ± {indices.total_half_width[k]:.3f}",
        )
        for k in order
    ]
    note = f" ({indices.note})" if indices.note else ""
    return [(f"Sobol indices of {indices.of}{note}; {COVERS}", ("parameter", "first order", "total"), rows)]


def _spread(result: StudyResult, name: str) -> Line | None:
    values = numbers(result, name)
    values = values[np.isfinite(values)]
    if not len(values):
        return None
    points = np.quantile(values, (0.0, 0.05, 0.5, 0.95, 1.0))
    digits = 4
    return (name, *(f"{v:.{digits}g}" if abs(v) < 1e4 else measured(float(v), 0) for v in points), str(len(values)))


def failures(result: StudyResult) -> list[Line]:
    """Errors of rows that failed, the most frequent first, and how many rows have each."""
    texts = [str(result.data["error"].values[k]) for k in result.failed]
    return [(text, str(number)) for text, number in Counter(texts).most_common(MOST_FAILURES)]

"""What one sample gives: the variables of a row, and how they are computed in the full problem."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..case import Case
from ..errors import StridorError
from ..modal.full import ParametricOnsets
from ..modal.growing import doubt
from ..modal.onset import Onset, Onsets
from ..modal.results import grows
from ..study.analyses import compare, modes, onsets, simulate, steady_sliding, summarise
from ..study.run_summary import slower_is_stronger
from ..study.workspace import Unsaved, Workspace
from ..temporal.growth import Growth
from ..temporal.trajectory import Trajectory
from ..typing import ComplexArray, IntArray
from .checks import FRICTION
from .tables import Compute, Keep

Row = dict[str, Any]


@dataclass(frozen=True)
class StoreColumn:
    """A column of the store: dtype "f8", "i8", "i1" or "str"; inner dimension, "" for one number a row; unit, words."""

    name: str
    dtype: str
    units: str
    words: str
    inner: str = ""


def variables(compute: Compute) -> tuple[StoreColumn, ...]:
    """What a row holds beside the parameters, by what is computed."""
    return (*_COMMON, *_VARIABLES[compute])


def lengths(compute: Compute, keep: Keep) -> Mapping[str, int]:
    """Lengths of the inner dimensions."""
    return {"modes": {"mode": keep.modes}, "onsets": {"onset": keep.onsets}}.get(compute, {})


def full_row(case: Case, compute: Compute, values: Mapping[str, float], keep: Keep) -> Row:
    """A row computed in the full problem; where that fails, with the error in it and nothing else."""
    started = time.perf_counter()
    try:
        varied = case.with_({path: value for path, value in values.items() if path != FRICTION})
        row = _COMPUTED[compute](Unsaved(varied), values.get(FRICTION), keep)
        row |= {"status": 1, "error": "", "source": "full"}
    except StridorError as error:
        row = failed(str(error))
    except Exception as error:  # whatever it is, other rows are not to be stopped by it
        row = failed(f"unexpected {type(error).__name__}: {error}")
    return row | {"seconds": time.perf_counter() - started}


def failed(why: str) -> Row:
    """A row that says why it has no results."""
    return {"status": 2, "error": _printable(why), "source": "full"}


def _printable(text: str) -> str:
    return re.sub(r"\s+", " ", "".join(c if c.isprintable() else " " for c in text)).strip()[:500]


# -- modes -------------------------------------------------------------------------------------------------------------


def modes_row(eigenvalues: ComplexArray, branches: IntArray, keep: int, top: float) -> Row:
    """The modes λ (k,) [1/s] of a row: unstable ones first, then the lowest, in the order of frequency; top [1/s] is
    the end of the band."""
    growing = grows(eigenvalues, top)
    order = np.lexsort((eigenvalues.imag, -eigenvalues.real * growing, ~growing))[:keep]
    order = order[np.argsort(eigenvalues.imag[order], kind="stable")]
    chosen = eigenvalues[order]
    row: Row = {
        "frequency_hz": chosen.imag / (2 * np.pi),
        "growth_rate": chosen.real,
        "branch": branches[order],
        "unstable_modes": int(np.count_nonzero(growing)),
        "modes_of_band": len(eigenvalues),
    }
    if len(eigenvalues):
        worst = int(np.argmax(eigenvalues.real))
        row["largest_growth_rate"] = float(eigenvalues[worst].real)
        row["largest_growth_frequency_hz"] = float(eigenvalues[worst].imag / (2 * np.pi))
    return row


def _modes(work: Workspace, mu: float | None, keep: Keep) -> Row:
    found = modes(work, mu, max_frequency_hz=work.modal.max_frequency_hz)
    inside = found.in_band[0]
    top = 2 * np.pi * work.modal.max_frequency_hz
    row = modes_row(found.eigenvalues[0, inside], found.branch[inside], keep.modes, top)
    return row | {"note": _printable(" ".join(map(doubt, found.completeness)))}


# -- onsets ------------------------------------------------------------------------------------------------------------


def onsets_row(found: Onsets | ParametricOnsets, keep: int, *, complete: bool, growing_at_start: int) -> Row:
    """Onsets of a row, by friction coefficient; the first from which on something grows apart: where something does at
    the low end of the range, that end."""
    listed = list(found)[:keep]
    values = [o.mu if isinstance(o, Onset) else o.value for o in listed]
    begins = [k for k, o in enumerate(listed) if not o.stabilising]
    row: Row = {
        "onset_mu": np.array(values, dtype=float),
        "onset_frequency_hz": np.array([o.frequency_hz for o in listed], dtype=float),
        "onset_ends_growth": np.array([int(o.stabilising) for o in listed], dtype=float),
        "onsets": len(found),
        "complete": int(complete),
        "growing_at_start": growing_at_start,
    }
    if growing_at_start:
        row["critical_mu"] = float((found.friction_range if isinstance(found, Onsets) else found.between)[0])
    elif begins:
        row["critical_mu"] = values[begins[0]]
        row["critical_frequency_hz"] = float(listed[begins[0]].frequency_hz)
    return row


def _onsets(work: Workspace, mu: float | None, keep: Keep) -> Row:
    found = onsets(work)
    row = onsets_row(found, keep.onsets, complete=found.complete, growing_at_start=len(found.at_start))
    return row | {"note": _printable(doubt(found.completeness))}


# -- the others --------------------------------------------------------------------------------------------------------


def _steady(work: Workspace, mu: float | None, keep: Keep) -> Row:
    found = steady_sliding(work, mu)
    force = found.normal_force
    return {
        "normal_force": float(force.sum()),
        "largest_node_force": float(force.max(initial=0.0)),
        "open_nodes": int(np.count_nonzero(found.status == 0)),
        "sticking_nodes": int(np.count_nonzero(found.status == 1)),
        "slipping_nodes": int(np.count_nonzero(found.status == 2)),
        "residual": found.residual,
        "note": _printable(" ".join(found.warnings)),
    }


def _state(growth: Growth | None) -> int:
    """What the loudest line of a run does, as a number."""
    if growth is None:
        return -1
    return 1 if growth.saturated else 2 if growth.state == "of constant amplitude" else 0


def _simulate(work: Workspace, mu: float | None, keep: Keep) -> Row:
    run = simulate(work, mu)
    found = summarise(work, run)
    row: Row = {
        "dominant_frequency_hz": _number(found.dominant_frequency_hz),
        "stronger_below_hz": _number(found.stronger_below_hz),
        "velocity_rms": _velocity_rms(run),
        "growth_rate_in_time": _number(found.growth_rate),
        "saturated": _state(found.growth),
        "energy_error": float(found.energy.error),
        "steps": run.steps,
        "note": "" if found.stronger_below_hz is None else _printable(slower_is_stronger(found.stronger_below_hz)),
    }
    last = run.phases[-1] if run.phases else None
    if last is not None and last.contacts:
        for name in ("stick_fraction", "slip_fraction", "separation_fraction"):
            row[name] = float(np.mean([getattr(c, name) for c in last.contacts.values()]))
    return row


def _velocity_rms(run: Trajectory) -> float:
    """How strongly a run vibrates in the end: rms about its mean [m/s] of the velocity that has the dominant frequency,
    over the second half of the last phase, as an ensemble has it; NaN where there is none."""
    if not run.phases or not len(run.time):
        return np.nan
    part = run.phase_slice()
    end = slice((part.start + part.stop) // 2, part.stop)
    seen = run.velocity[end, 0] if run.watch_names else run.slip_speed[end, :1]
    return float(np.sqrt(seen.var(axis=0).sum())) if seen.size else np.nan


def _compare(work: Workspace, mu: float | None, keep: Keep) -> Row:
    found = compare(work, None if mu is None else [mu], critical=False)
    one = found.comparisons[0]
    return {
        "modal_frequency_hz": one.modal_eigenvalue.imag / (2 * np.pi),
        "modal_growth_rate": one.modal_eigenvalue.real,
        "frequency_in_time_hz": one.perturbation.eigenvalue.imag / (2 * np.pi) if one.marched else np.nan,
        "growth_rate_in_time": one.perturbation.eigenvalue.real if one.marched else np.nan,
        "dominant_frequency_hz": _number(one.dominant_frequency_hz),
        "agree": -1 if one.agrees is None else int(one.agrees),
        "note": _printable(one.verdict),
    }


def _number(value: float | None) -> float:
    return np.nan if value is None else float(value)


_COMPUTED: dict[str, Callable[[Workspace, float | None, Keep], Row]] = {
    "modes": _modes, "onsets": _onsets, "steady": _steady, "simulate": _simulate, "compare": _compare,
}  # fmt: skip

_COMMON = (
    StoreColumn("status", "i1", "", "0 not computed yet, 1 computed, 2 failed (`error` says why)"),
    StoreColumn("error", "str", "", "why there is no result"),
    StoreColumn("note", "str", "", "what speaks against the result, where something does"),
    StoreColumn("source", "str", "", "full problem or reduced model"),
    StoreColumn("seconds", "f8", "s", "time that the row took"),
)
_ESTIMATED = (
    StoreColumn("estimated_error", "f8", "1", "estimated relative error of the eigenvalues; none where solved in full"),
    StoreColumn(
        "confirmed", "i1", "", "1 where the row was solved in full as well and both agree, 2 where they do not; "
        "0 where it was not, or where the estimated error is above 1 and allows for anything",
    ),
    StoreColumn("difference", "f8", "1", "relative difference of both where solved in full as well"),
)
_VARIABLES: dict[str, tuple[StoreColumn, ...]] = {
    "modes": (
        StoreColumn("frequency_hz", "f8", "Hz", "frequency Im λ / 2π", "mode"),
        StoreColumn("growth_rate", "f8", "1/s", "growth rate Re λ", "mode"),
        StoreColumn(
            "branch", "i8", "",
            "number of the mode by frequency at μ = 0, of the sample itself where all are solved in full, else in the "
            "middle of the ranges, from where it was followed; 0 where it was not",
            "mode",
        ),
        StoreColumn("unstable_modes", "i8", "", "how many modes of the band grow"),
        StoreColumn("modes_of_band", "i8", "", "how many modes there are in the band, kept or not"),
        StoreColumn("largest_growth_rate", "f8", "1/s", "largest growth rate of the band"),
        StoreColumn("largest_growth_frequency_hz", "f8", "Hz", "frequency of the mode that has it"),
        *_ESTIMATED,
    ),
    "onsets": (
        StoreColumn("critical_mu", "f8", "1", "least friction coefficient of the range at which a mode grows"),
        StoreColumn("critical_frequency_hz", "f8", "Hz", "frequency of that mode there"),
        StoreColumn("onset_mu", "f8", "1", "friction coefficients where growth begins or ends", "onset"),
        StoreColumn("onset_frequency_hz", "f8", "Hz", "frequency there", "onset"),
        StoreColumn("onset_ends_growth", "f8", "", "1 where growth ends there, 0 where it begins", "onset"),
        StoreColumn("onsets", "i8", "", "how many there are, kept or not"),
        StoreColumn(
            "growing_at_start", "i8", "", "how many modes grow at the low end of the range of friction already"
        ),
        StoreColumn("complete", "i1", "", "1 where nothing speaks for further onsets, 0 where the list may lack some"),
        *_ESTIMATED,
    ),
    "steady": (
        StoreColumn("normal_force", "f8", "N", "sum of the normal forces"),
        StoreColumn("largest_node_force", "f8", "N", "largest normal force of a contact node"),
        StoreColumn("open_nodes", "i8", "", "contact nodes that are open"),
        StoreColumn("sticking_nodes", "i8", "", "contact nodes that stick"),
        StoreColumn("slipping_nodes", "i8", "", "contact nodes that slip"),
        StoreColumn("residual", "f8", "1", "largest imbalance over the largest force"),
    ),
    "simulate": (
        StoreColumn("dominant_frequency_hz", "f8", "Hz", "strongest line of the last phase"),
        StoreColumn(
            "stronger_below_hz", "f8", "Hz",
            "frequency below which something is stronger than that and the second half of the phase is too short to "
            "resolve; none where nothing is",
        ),
        StoreColumn(
            "velocity_rms", "f8", "m/s", "rms of the velocity that has it about its mean, second half of the last phase"
        ),
        StoreColumn("growth_rate_in_time", "f8", "1/s", "growth rate of the run, where it grows exponentially"),
        StoreColumn(
            "saturated", "i1", "",
            "1 where growth has ended in the run, 2 where the amplitude does not change, 0 where it does, -1 unknown",
        ),
        StoreColumn("stick_fraction", "f8", "1", "share of the last phase in stick, mean of the contacts"),
        StoreColumn("slip_fraction", "f8", "1", "share of the last phase in slip"),
        StoreColumn("separation_fraction", "f8", "1", "share of the last phase without contact"),
        StoreColumn("energy_error", "f8", "1", "what the balance of energies lacks, relative"),
        StoreColumn("steps", "i8", "", "time steps"),
    ),
    "compare": (
        StoreColumn("modal_frequency_hz", "f8", "Hz", "frequency of the mode compared"),
        StoreColumn("modal_growth_rate", "f8", "1/s", "its growth rate"),
        StoreColumn("frequency_in_time_hz", "f8", "Hz", "frequency of the perturbation in time"),
        StoreColumn("growth_rate_in_time", "f8", "1/s", "its growth rate"),
        StoreColumn("dominant_frequency_hz", "f8", "Hz", "loudest frequency of the full run"),
        StoreColumn("agree", "i1", "", "1 where both approaches agree, 0 where not, -1 not decided"),
    ),
}  # fmt: skip

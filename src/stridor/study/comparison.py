"""Both approaches compared, and with them the limit cycles: onset, growth, cycle and run side by side."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace

import numpy as np

from ..agreement import Agreement, Comparison, PartStore
from ..agreement.four_answers import four_answers, with_answers
from ..asking import FUNCTION, STORE, SWITCH, SWITCH_OR_NONE, TABLE, takes
from ..errors import CaseError, StridorError
from ..periodic import Cycle, CycleOnset
from ..temporal.ended import ended
from ..temporal.trajectory import Trajectory
from . import analyses
from .asked import names_of
from .cycles import cycles as find_cycles
from .settings import phases_of, settings_of
from .workspace import Problem, Workspace


@takes(
    cycles=SWITCH, critical=SWITCH_OR_NONE, runs=TABLE.or_none(), progress=FUNCTION, kept=STORE, finished=FUNCTION
)
def compare(
    problem: Problem,
    mus: Sequence[float] | None = None,
    *,
    cycles: bool = False,
    critical: bool | None = None,
    runs: dict[float, Trajectory] | None = None,
    progress: Callable[[str], None] | None = None,
    only: Collection[str] | None = None,
    kept: PartStore | None = None,
    finished: Callable[[Comparison], None] | None = None,
) -> Agreement:
    """Both approaches at each μ (default comparison.mu, else the problem's own) and by their critical μ.

    cycles: also the limit cycles at each μ, held against what the full run settles to (`Agreement.answers`).
    critical False (default comparison.critical) solves neither critical μ; only: parts of "growth" (small
    perturbations at each μ), "run" (the full run at each μ as well) and "critical" instead of all. kept: where finished
    parts are put and sought (`io.kept_parts`); finished is called with each μ when it is done. Ctrl-C returns what is
    finished. Raises CaseError for cycles without "run".
    """
    only = None if only is None else names_of(only, "only")
    if cycles and only and "run" not in only:
        raise CaseError("only", ", ".join(only), "with run among it: cycles are held against full runs")
    work = Workspace.of(problem)
    found = analyses.compare(
        work, mus, critical=critical, runs=runs, progress=progress, only=only, kept=kept, finished=finished
    )
    if not cycles or found.interrupted:
        return found
    return _with_cycles(work, found, progress)


def _with_cycles(work: Workspace, found: Agreement, progress: Callable[[str], None] | None) -> Agreement:
    """The same with the cycles at its μ."""

    def told(count: int, doing: str) -> None:
        if progress is not None:
            progress(f"cycles: {doing} ({count} so far)")

    mus = [c.mu for c in found.comparisons]
    cycles: tuple[Cycle, ...] = ()
    notes: list[str] = []
    stopped = False
    why = _why_not(work)
    if not why:
        try:
            result = find_cycles(work, mus, progress=told)
        except CaseError as error:
            why = f"cycles were not sought: {error.problems[0].accepted}"
        except StridorError as error:  # what was compared is not lost with it
            why = f"cycles were not sought to the end: {error}"
        else:
            cycles, stopped = result.cycles, result.interrupted
            notes += [f"cycles: {line}" for line in (*result.missing, *result.warnings, *result.notes)]
    onset: CycleOnset | None = None
    if not stopped:
        try:
            onset, doubt = _onset(work)
            notes += [doubt] if doubt else []
        except StridorError as error:
            notes.append(f"onsets: {error}")
        except KeyboardInterrupt:
            stopped = True
    noted = replace(found, notes=(*found.notes, *notes), interrupted=stopped)
    if stopped:
        return with_answers(noted, ())
    return with_answers(
        noted,
        [
            four_answers(c, onset, [one for one in cycles if one.mu == c.mu], work.modal.max_frequency_hz, why)
            for c in found.comparisons
        ],
        why,
    )


def _why_not(work: Workspace) -> str:
    """Why no cycle can be held against the runs; "" where they can."""
    return f"cycles were not sought: {other}" if (other := other_in_time(work)) else ""


def other_in_time(work: Workspace) -> str:
    """What makes the run in time another system than that of its cycles; "" where they are one."""
    compliance = work.structured("compare").contact_nodes().compliance
    if settings_of(work).contact == "rigid" and np.any(compliance > 0.0):
        return "contact in time is another than theirs (temporal.contact)"
    if off := list(ended(work.structured("compare"), phases_of(work)).off):
        return f"they go with full loads and speeds, and the run ends with others ({off[0]})"
    return ""


def _onset(work: Workspace) -> tuple[CycleOnset | None, str]:
    """The lowest onset of growth in modal.friction_range, and what is said of a list that is not whole."""
    found = analyses.onsets(work)
    first = min((o for o in found if not o.stabilising), key=lambda o: o.mu, default=None)
    doubt = "" if found.complete else f"onsets: {found.completeness}"
    return None if first is None else CycleOnset(first.mu, first.frequency_hz, first.stabilising), doubt

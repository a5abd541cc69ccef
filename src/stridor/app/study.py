"""`stridor study`: a case with many values of its numbers; `stridor plot`: the figures of its store."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import AnalysisError, CaseError
from ..interrupts import INTERRUPTED, heard
from .arguments import INCOMPLETE, Call, verb
from .closing import Conclusion

if TYPE_CHECKING:
    from ..studies.parts import Part
    from ..studies.result import StudyResult
    from ..studies.schema import Study

_ADDRESS = re.compile(r"(\w+://)?[^\s/]+:\d{1,5}/?")

StudyFile = Annotated[Path, typer.Argument(metavar="STUDY", help="Study file (TOML).", show_default=False)]
StoreFolder = Annotated[
    Path, typer.Argument(metavar="STORE", help="Store of a study (study.zarr), or its folder.", show_default=False)
]


@verb(StudyFile)
def study(
    call: Call,
    workers: Annotated[
        int | None, typer.Option("--workers", metavar="N", min=1, max=1024, help="Processes [default: all cores].")
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option("--scheduler", metavar="ADDRESS", help="A Dask scheduler, tcp://host:port, in place of these."),
    ] = None,
    part: Annotated[
        str | None, typer.Option("--part", metavar="K/N", help="Only the K-th of N parts, for arrays of jobs.")
    ] = None,
    merge: Annotated[bool, typer.Option("--merge", help="Put the parts together that --part wrote.")] = False,
    go_on: Annotated[
        bool, typer.Option("--go-on", help="Also with a store, or with parts, of another version of stridor.")
    ] = False,
) -> None:
    """Many samples of one case: maps, probability of squeal, what decides it. Goes on where it was."""
    from ..studies.parts import Part
    from ..studies.schema import Study
    from ..study.workspace import Workspace

    given = [name for name, on in (("--part", part), ("--scheduler", scheduler), ("--workers", workers)) if on]
    if merge and given:
        raise CaseError("--merge", None, f"goes without {given[0]}")
    if scheduler is not None and workers is not None:
        raise CaseError("--workers", workers, "goes without --scheduler, which has workers of its own")
    if scheduler is not None and not _ADDRESS.fullmatch(scheduler):
        raise CaseError("--scheduler", scheduler, "an address with a port, such as tcp://host:8786")
    one = None if part is None else Part.read(part)
    loaded = Study.load(call.path, call.set_ or [])
    call.warn_of(loaded.base())
    if "mu" in loaded.parameters or loaded.compute == "onsets":
        call.warn(Workspace(loaded.base()).one_for_all)
    if merge:
        result = _merged(call, loaded, go_on=go_on)
    else:
        if one is None:
            call.claim()
        result = _run(call, loaded, one, workers, scheduler, go_on=go_on)
    _finish(call, result, draw=one is None and not result.interrupted)


def _run(
    call: Call, loaded: Any, part: Part | None, workers: int | None, scheduler: str | None, *, go_on: bool
) -> StudyResult:
    from ..studies.run import run_study
    from .output import counting

    with counting("study", quiet=call.quiet) as progress:
        return run_study(
            loaded, call.folder, workers=workers, scheduler=scheduler, part=part, go_on=go_on, progress=progress,
            say=call.say,
        )  # fmt: skip


def _merged(call: Call, study: Study, *, go_on: bool) -> StudyResult:
    from ..studies.merge import merged
    from ..studies.result import open_study
    from ..studies.run import NAME

    call.claim()
    call.warn(merged(call.folder, call.folder / NAME, study, go_on=go_on))
    return open_study(call.folder / NAME)


def _finish(call: Call, result: StudyResult, *, draw: bool) -> None:
    """Write the table, the figures and the page; say what came out. Raises AnalysisError for all of them that cannot be
    written, once the others are and what came out is said."""
    written, left = _Written([result.path]), ""
    call = replace(call, later=False)
    call.say(f"written: {result.path}")
    if draw:
        written.add(lambda: call.tabulate(result, "study.csv"))
        left = _draw(call, result, written)
    _show(call, result, written.files, left)
    written.refuse(result)
    if result.interrupted:
        heard()
        call.say("interrupted; the same command goes on from there")
        raise typer.Exit(INTERRUPTED)
    if len(result.failed) or result.pending:
        raise typer.Exit(INCOMPLETE)


@dataclass
class _Written:
    """Files that are written, and why others cannot be: a full disk has room for the small ones."""

    files: list[Path] = field(default_factory=list)
    lost: list[str] = field(default_factory=list)

    def add(self, write: Callable[[], Path]) -> None:
        """Write one more."""
        try:
            self.files.append(write())
        except AnalysisError as error:
            self.lost.append(str(error))

    def refuse(self, result: StudyResult) -> None:
        """Raises AnalysisError where any could not be written."""
        if self.lost:
            kept = f"the rows are in {result.path}: the same command writes what is missing once there is room"
            raise AnalysisError("\n".join([*self.lost, kept]))


def _draw(call: Call, result: StudyResult, written: _Written) -> str:
    """Figures and the page, beside the store; what they do not show."""
    from ..studies.page import write_page
    from ..studies.plots import study_figures
    from ..studies.summary import undrawn

    def page() -> Path:
        path = write_page(result, drawn, call.folder / "report.html")
        call.say(f"written: {path}")
        return path

    call = replace(call, later=False)
    drawn = study_figures(result)
    for name, figure in drawn.items():
        written.add(partial(call.draw, figure, f"{name}.png"))
    written.add(page)
    return undrawn(result, len(drawn))


def _show(call: Call, result: StudyResult, files: list[Path], left: str) -> None:
    from ..studies.summary import answer, failures, tables
    from .output import stdout
    from .tables import table

    if call.json:
        call.document(document(result) | {"files": [str(f) for f in files]})
        return
    for title, heads, rows in tables(result):
        if rows:
            table(title, list(heads), [list(row) for row in rows], drop=["samples", "5 %", "95 %"], kept_in="study.csv")
        else:
            stdout.print(title)
    for text, number in failures(result):
        stdout.print(f"failed, {number} of {len(result.status)} rows: {text}")
    for note in result.notes:
        stdout.print(note)
    call.conclude(Conclusion("; ".join(filter(None, (answer(result), left if left.startswith("no figure") else "")))))


def document(result: StudyResult) -> dict[str, Any]:
    """The document of --json."""
    from ..studies.summary import answer, failures

    found: dict[str, Any] = {
        "store": str(result.path),
        "compute": result.compute,
        "sampling": result.method,
        "parameters": list(result.parameters),
        "rows": len(result.status),
        "computed": int(result.done.sum()),
        "failed": len(result.failed),
        "pending": result.pending,
        "interrupted": result.interrupted,
        "answer": answer(result),
        "notes": list(result.notes),
        "errors": [{"error": text, "rows": int(number)} for text, number in failures(result)],
        "probability": None,
        "bands": [],
        "sobol": None,
    }
    if result.compute in ("modes", "onsets") and result.method not in ("grid", "saltelli"):
        found["probability"] = result.probability().to_json()
        if result.compute == "modes" and result.done.any():
            bands = result.probability_in_bands()
            found["bands"] = [{"low_hz": low, "high_hz": high, **p.to_json()} for low, high, p in bands]
    if result.method == "saltelli":
        try:
            found["sobol"] = result.indices().to_json()
        except AnalysisError as error:
            found["sobol"] = {"error": str(error)}
    return found


@verb(StoreFolder)
def plot(call: Call) -> None:
    """The figures of a study again, from its store alone."""
    from ..studies.result import open_study
    from ..studies.summary import answer

    result = open_study(call.path)
    if call.out is None:
        call = replace(call, out=result.path.parent)
    call.claim()
    written = _Written()
    left = _draw(call, result, written)
    if call.json:
        told = {"answer": answer(result), "failed": len(result.failed), "pending": result.pending, "undrawn": left}
        call.document({**told, "notes": list(result.notes), "files": [str(f) for f in written.files]})
    else:
        from .output import stdout

        for note in result.notes:  # what is not computed, failed, or not to be trusted
            stdout.print(note)
        call.conclude(Conclusion("; ".join(filter(None, (answer(result), left)))))
    written.refuse(result)
    if len(result.failed) or result.pending:
        raise typer.Exit(INCOMPLETE)


VERBS = {"study": study, "plot": plot}

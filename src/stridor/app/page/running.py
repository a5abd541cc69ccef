"""Inside of the process of a run in time, a comparison, a report, …: what it computes and what it tells."""

from __future__ import annotations

import os
import signal
import threading
from _thread import interrupt_main
from collections.abc import Callable, Mapping
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any

from ... import interrupts

if TYPE_CHECKING:
    from ...periodic import Cycles
    from ...study.workspace import Workspace
    from ...temporal.trajectory import Trajectory
    from ...view.tables import Table
    from .runs import Wish

TOLD_SECONDS = 0.4
FILE = "simulate.nc"
STOPPED: Mapping[str, Any] = {"sentence": "stopped", "file": None}


class _Page:
    """The other end of the pipe: what the page is told and what it wants. The process ends where nobody is there."""

    def __init__(self, pipe: Any) -> None:
        self._pipe, self._whole = pipe, threading.Lock()
        self.stop = threading.Event()
        self.gives_up = True  # whether to stop is to leave everything as it is
        self.breaks_off = False  # whether what is under way hears of it as of Ctrl-C
        self.slow: float | None = None
        threading.Thread(target=self._reading, daemon=True).start()

    def tell(self, part: str, content: Any) -> None:
        """Tell it, whole: what is half written into a pipe spoils it."""
        with interrupts.held(), self._whole:
            try:
                self._pipe.send((part, content))
            except OSError:
                os._exit(0)  # nobody listens any more

    def interrupted(self, _: int, __: FrameType | None) -> None:
        """A signal: Ctrl-C goes to all processes of a terminal and means nothing here, the pipe will end."""
        if self.breaks_off and self.stop.is_set() and not self._whole.locked():
            self.breaks_off = False
            interrupts.interrupt()

    def _reading(self) -> None:
        while True:
            try:
                name, value = self._pipe.recv()
            except (EOFError, OSError):
                os._exit(0)  # nobody listens any more
            if name == "listen":
                self.slow = float(value)
            elif self.gives_up:
                self.tell("stopped", STOPPED)
                os._exit(0)
            else:
                self.stop.set()
                if self.breaks_off:
                    interrupt_main(signal.SIGINT)


def serve(pipe: Any, wish: Wish) -> None:
    """Do what is wished for and tell of it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    page = _Page(pipe)
    signal.signal(signal.SIGINT, page.interrupted)
    interrupts.insist()
    from ...case import loads
    from ...errors import StridorError
    from ...study.workspace import Workspace

    kinds: dict[str, Callable[[_Page, Wish, Workspace], None]] = {
        "run": _run, "compare": _compare, "report": _report, "map": _map, "sound": _sound,
        "sensitivities": _sensitivities, "cycles": _cycles,
    }  # fmt: skip
    try:
        kinds[wish.what](page, wish, Workspace(loads(wish.case)))
    except StridorError as error:
        page.tell("refused", str(error))
    except MemoryError:
        page.tell("failed", "there is not enough memory; record less often (temporal.record_every)")


def _run(page: _Page, wish: Wish, work: Workspace) -> None:
    from ...io.datasets import save
    from ...study.analyses import simulate, summarise
    from ...view.run_so_far import run_so_far
    from ..conclusions import of_run

    page.gives_up = False  # what was computed is kept

    def progress(done: int, planned: int) -> None:
        page.tell("progress", (done, planned))
        if page.stop.is_set():
            raise KeyboardInterrupt

    def shown(part: Trajectory) -> None:
        page.tell("picture", run_so_far(part, point=wish.point, max_frequency_hz=wish.max_frequency_hz).to_json())
        if page.slow is not None:
            slow, page.slow = page.slow, None
            page.tell(*sounded(part, slow))

    run = simulate(work, wish.mu, progress=progress, checkpoint=shown, checkpoint_seconds=TOLD_SECONDS)
    shown(run)
    target = save(run, Path(wish.folder) / FILE)
    if run.interrupted:
        sentence = f"stopped after {run.steps} of {run.planned_steps} steps"
    else:
        sentence = of_run(summarise(work, run).to_json()).sentence
    page.tell("stopped" if run.interrupted else "done", {"sentence": sentence, "file": str(target)})


def _compare(page: _Page, wish: Wish, work: Workspace) -> None:
    from ...io.kept_parts import NAME, KeptParts
    from ...study.analyses import compare
    from ...view.tables import Table
    from ...view.temporal_tables import agreement_table, critical_row

    kept = KeptParts(Path(wish.folder) / NAME, work.key)
    found = compare(
        work, None if wish.mu is None else [wish.mu], progress=lambda words: page.tell("log", words), kept=kept
    )
    tables = [_plain(agreement_table(c)) for c in found.comparisons]
    critical = critical_row(found)
    if critical is not None:
        heads = ("", "modal", "temporal", "difference", "")
        tables.append(_plain(Table("critical", "Where growth begins", heads, (critical,), frozenset({0, 4}))))
    sentences = [c.verdict for c in found.comparisons]
    page.tell("done", {"sentence": " ".join(sentences) or "nothing was compared", "file": None, "tables": tables})


def _plain(table: Table) -> dict[str, Any]:
    rows = [{"cells": list(row.cells), "kind": row.kind} for row in table.rows]
    return {"title": table.title, "heads": list(table.heads), "rows": rows, "words": sorted(table.words)}


def _report(page: _Page, wish: Wish, work: Workspace) -> None:
    from ..pipeline import run

    outcome = run(work, wish.folder, log=lambda words: page.tell("log", words))
    target = Path(wish.folder) / "report.html"
    if not target.exists():
        page.tell("failed", " ".join(outcome.everything.notes) or "no report was written")
        return
    page.tell("done", {"sentence": "the report is written", "file": str(target)})


def _map(page: _Page, wish: Wish, work: Workspace) -> None:
    from .mapping import mapped

    page.tell("done", {"sentence": mapped(page.tell, work, wish.options), "file": None})


def _cycles(page: _Page, wish: Wish, work: Workspace) -> None:
    """Limit cycles at one friction coefficient, each told as it is found; what is stopped keeps those it has."""
    from ...study.cycles import cycles
    from ...view.cycle_shown import cycle_shown

    told = 0
    page.gives_up, page.breaks_off = False, True

    def keep(found: Cycles) -> None:
        nonlocal told
        for cycle in found.cycles[told:]:  # of one friction coefficient, so the newest are the last
            page.tell("cycle", cycle_shown(cycle).to_json())
        told = len(found.cycles)

    def progress(_: int, doing: str) -> None:
        page.tell("log", doing)
        if page.stop.is_set():
            page.breaks_off = False
            raise KeyboardInterrupt

    try:
        found = cycles(work, wish.mu, progress=progress, keep=keep)
    except KeyboardInterrupt:  # before there was anything to be kept
        interrupts.heard()
        page.tell("stopped", STOPPED)
        return
    page.breaks_off = False
    keep(found)
    page.tell("stopped" if found.interrupted else "done", {
        "sentence": found.sentence, "file": None, "missing": found.missing, "notes": found.notes,
        "warnings": [] if found.interrupted else found.warnings,
    })  # fmt: skip


def _sensitivities(page: _Page, wish: Wish, work: Workspace) -> None:
    """Of one mode in the full problem, which is told by its eigenvalue: numbers of modes may differ from those of a
    reduced model where two all but met."""
    from ...stages import Stage, heard
    from .mode_data import tornado_at

    last = 0.0

    def told(stage: Stage | None) -> None:
        nonlocal last
        if stage is not None and stage.began - last >= TOLD_SECONDS:
            last = stage.began
            page.tell("log", stage.what)

    with heard(told):
        found = tornado_at(work, wish.options["mu"], wish.options["branch"], complex(*wish.options["eigenvalue"]))
    page.tell("tornado", found)
    page.tell("done", {"sentence": "", "file": None})


def _sound(page: _Page, wish: Wish, _: Workspace) -> None:
    """Of a run that has ended. What reads its file and makes the sound takes more memory than all the server does."""
    page.tell(*sound_of_file(wish.options["file"], wish.options["slow"]))
    page.tell("done", {"sentence": "", "file": None})


def sounded(run: Any, slow: float) -> tuple[str, Any]:
    """A run's sound, as a page is told of it: "sound", or "silent" and why."""
    from ...errors import StridorError
    from ...view.sound import sound

    try:
        found = sound(run, slow=slow)
    except StridorError as error:
        return "silent", str(error)
    return "sound", {"wav": found.wav(), "sentence": found.sentence, "seconds": found.seconds}


def sound_of_file(path: str, slow: float) -> tuple[str, Any]:
    """The same of a run that has ended."""
    from ...errors import StridorError
    from ...io.datasets import load_trajectory

    try:
        run = load_trajectory(path)
    except StridorError as error:
        return "silent", str(error)
    return sounded(run, slow)

"""What takes long, each in a process of its own: runs in time, limit cycles, comparisons, reports, maps. At most a few
at once, the others wait for their turn.

A run tells what it has computed a few times a second, in so few numbers that each telling is the whole picture. A
process (`running`) ends with its pipe, and so with the page and the server.
"""

from __future__ import annotations

import contextlib
import os
import threading
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from ...studies.processes import forked
from .own_end import GONE, OwnEnd
from .running import serve
from .worker import LOADED, ended

AT_ONCE = max(1, (os.cpu_count() or 2) - 1)  # runs; one core is left to the pages
PATIENCE = 0.2  # seconds that a process has to end

ENDS = ("done", "stopped", "refused", "failed")
Heard = Callable[[str, Any], None]
What = Literal["run", "compare", "report", "map", "sound", "sensitivities", "cycles"]


@dataclass(frozen=True)
class Wish:
    """What is wanted, of which case (TOML) at which friction coefficient (None: the case's own), and where its files
    go; of a run the point to be shown (None: the first) and the highest frequency [Hz] of the spectra."""

    case: str
    mu: float | None
    folder: str
    what: What = "run"
    point: str | None = None
    max_frequency_hz: float = 40e3
    options: Mapping[str, Any] = field(default_factory=dict[str, Any])  # of a map, a sound, sensitivities


class Queue:
    """Turns of runs: at most ``at_once`` under way."""

    def __init__(self, at_once: int = AT_ONCE) -> None:
        self.at_once = at_once
        self._under_way: list[Run] = []
        self._waiting: deque[Run] = deque()
        self._lock = threading.RLock()

    def add(self, run: Run) -> None:
        """Start a run, or let it wait."""
        with self._lock:
            self._waiting.append(run)
        self._next()

    def drop(self, run: Run) -> None:
        """A run has ended, or is not wanted any more."""
        with self._lock:
            if run in self._waiting:
                self._waiting.remove(run)
            if run in self._under_way:
                self._under_way.remove(run)
        self._next()

    def _next(self) -> None:
        with self._lock:
            begun: list[Run] = []
            while self._waiting and len(self._under_way) < self.at_once:
                begun.append(self._waiting.popleft())
                self._under_way.append(begun[-1])
            places = list(self._waiting)
        for run in begun:
            run.begin()
        for k, run in enumerate(places):
            run.told("waiting", k + 1)


QUEUE = Queue()
SOUNDS = Queue(1)  # of runs that have ended: a moment each, for which no run is waited for


class Run:
    """A run from its wish to its end.

    heard(part, content) is called, in a thread of its own, with "waiting" (the place in the queue), "begun",
    "progress" (steps done and planned), "log" (what is being done), "picture" (of `run_so_far`), "sound" (a WAV file's
    bytes and what it is) or "silent" (why there is none), "cycle" (as `CycleShown`), and at last with one of "done" and
    "stopped" (sentence, file, the tables of a comparison, what is missing of cycles), "refused" (the words of the
    command line) and "failed".
    """

    def __init__(self, wish: Wish, heard: Heard, queue: Queue | None = None) -> None:
        self.wish, self._heard = wish, heard
        self._queue = queue or QUEUE
        self._process: Any = None
        self._pipe: OwnEnd | None = None
        self._lock, self._end = threading.Lock(), threading.Lock()
        self._spoken = self.over = False
        self._queue.add(self)

    @property
    def process(self) -> Any:
        """The process, None before its turn."""
        return self._process

    def told(self, part: str, content: Any = None) -> None:
        """Hand on what was heard, unless it is over."""
        if not self.over:
            self._heard(part, content)

    def begin(self) -> None:
        """Its turn has come."""
        with self._end:  # whoever waits for its end waits for a process that is on its way, too
            if self.over:
                return
            process, pipe = forked(serve, "stridor run", self.wish, loaded=LOADED)
            own = OwnEnd(pipe)
            with self._lock:
                self._process, self._pipe = process, own
            if self.over:  # closed or stopped while it began
                self.close()
                own.close()
                return
        threading.Thread(target=self._listening, args=(own,), name="stridor-run-listener", daemon=True).start()
        self.told("begun")

    def stop(self) -> None:
        """End it; what was computed is kept."""
        if self._process is None:
            self.told("stopped", {"sentence": "stopped before its turn", "file": None})
            self._ended()
        elif not self._spoken:  # a process that is being made hears nothing, on a busy computer for many seconds
            self.told("stopped", {"sentence": "stopped before anything was computed", "file": None})
            self.close()
            threading.Thread(target=self.end, name="stridor-run-end").start()
        else:
            self._ask(("stop", None))

    def listen(self, slow: float = 1.0) -> None:
        """Ask for its last phase as sound, of what there is by now."""
        self._ask(("listen", slow))

    def close(self) -> None:
        """Nobody wants it any more: its process ends with its pipe. Returns at once."""
        self.over = True
        with self._lock:
            pipe, self._pipe = self._pipe, None
        if pipe is not None:
            pipe.hang_up()
        self._queue.drop(self)

    def end(self) -> None:
        """Wait until its process is gone, once closed; what does not end by itself is killed."""
        with self._end:
            if self._process is not None:
                ended(self._process, PATIENCE)

    def _ask(self, question: tuple[str, Any]) -> None:
        with self._lock:
            if self._pipe is not None:
                with contextlib.suppress(OSError):
                    self._pipe.send(question)

    def _listening(self, pipe: OwnEnd) -> None:
        last = ""
        while True:
            try:
                last, content = pipe.recv()
            except GONE:
                break
            self._spoken = True
            self.told(last, content)
            if last in ENDS:
                self._ended()  # the next may begin: what is left of the process is its own end
        pipe.close()
        if last not in ENDS:
            self.told("failed", "the process of this run has died: out of memory, or killed")
        self._ended()

    def _ended(self) -> None:
        self.over = True
        self._queue.drop(self)

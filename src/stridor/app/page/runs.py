"""Runs in time, each in a process of its own: at most a few at once, the others wait for their turn.

A process tells what it has computed a few times a second, in so few numbers that each telling is the whole picture: a
page that was reloaded, or looked away, has missed nothing. It ends with its pipe, and so with the page and the server.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...studies.workers import main_left_out, one_thread_each

AT_ONCE = max(1, (os.cpu_count() or 2) - 1)  # runs; one core is left to the pages
TOLD_SECONDS = 0.4
END = 3.0  # seconds that a process has to end
FILE = "simulate.nc"

Heard = Callable[[str, Any], None]


@dataclass(frozen=True)
class Wish:
    """A run: the case as TOML, friction coefficient (None: the case's own), where its file goes, the point to be shown
    (None: the first) and the highest frequency [Hz] of the spectra."""

    case: str
    mu: float | None
    folder: str
    point: str | None = None
    max_frequency_hz: float = 40e3


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


class Run:
    """A run from its wish to its end.

    heard(part, content) is called, in a thread of its own, with "waiting" (the place in the queue), "begun",
    "progress" (steps done and planned), "picture" (of `run_so_far`), "sound" (a WAV file's bytes and what it is) or
    "silent" (why there is none), and at last with one of "done" and "stopped" (sentence, and the file), "refused" (the
    words of the command line) and "failed".
    """

    def __init__(self, wish: Wish, heard: Heard, queue: Queue | None = None) -> None:
        self.wish, self._heard = wish, heard
        self._queue = queue or QUEUE
        self._process: Any = None
        self._pipe: Any = None
        self._lock = threading.Lock()
        self.over = False
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
        context = multiprocessing.get_context("spawn")
        own, its = context.Pipe()
        process = context.Process(target=_serve, args=(its, self.wish), name="stridor run", daemon=True)
        with one_thread_each(), main_left_out():
            process.start()
        its.close()  # so that the pipe ends with the process
        self._process, self._pipe = process, own
        threading.Thread(target=self._listening, args=(own,), name="stridor-run-listener", daemon=True).start()
        self.told("begun")

    def stop(self) -> None:
        """End it; what was computed is kept."""
        if self._process is None:
            self.told("stopped", {"sentence": "stopped before its turn", "file": None})
            self._ended()
        else:
            self._ask(("stop", None))

    def listen(self, slow: float = 1.0) -> None:
        """Ask for its last phase as sound, of what there is by now."""
        self._ask(("listen", slow))

    def close(self) -> None:
        """Nobody wants it any more: its process ends now."""
        self.over = True
        with self._lock:
            pipe, self._pipe = self._pipe, None
        if pipe is not None:
            with contextlib.suppress(OSError):
                pipe.close()
        if self._process is not None:
            threading.Thread(target=_killed, args=(self._process,), name="stridor-run-end").start()
        self._queue.drop(self)

    def _ask(self, question: tuple[str, Any]) -> None:
        with self._lock:
            if self._pipe is not None:
                with contextlib.suppress(OSError):
                    self._pipe.send(question)

    def _listening(self, pipe: Any) -> None:
        last = ""
        while True:
            try:
                last, content = pipe.recv()
            except (EOFError, OSError, TypeError):  # TypeError: closed while it was being read
                break
            self.told(last, content)
        if last not in ENDS:
            self.told("failed", "the process of this run has died: out of memory, or killed")
        self._ended()

    def _ended(self) -> None:
        self.over = True
        self._queue.drop(self)


ENDS = ("done", "stopped", "refused", "failed")


def _killed(process: Any) -> None:
    process.join(0.2)
    if process.is_alive():
        process.kill()
    process.join(END)


# -- inside of the process ---------------------------------------------------------------------------------------------


class _Wishes:
    """What the page wants of a run under way; the process ends where nobody is at the other end."""

    def __init__(self, pipe: Any) -> None:
        self._pipe = pipe
        self.stop = threading.Event()
        self.slow: float | None = None
        threading.Thread(target=self._reading, daemon=True).start()

    def _reading(self) -> None:
        while True:
            try:
                name, value = self._pipe.recv()
            except (EOFError, OSError):
                os._exit(0)  # nobody listens any more
            if name == "stop":
                self.stop.set()
            elif name == "listen":
                self.slow = float(value)


def _serve(pipe: Any, wish: Wish) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C goes to all processes of a terminal; the pipe will end
    from ...errors import StridorError

    wishes = _Wishes(pipe)
    try:
        _marched(pipe, wish, wishes)
    except StridorError as error:
        pipe.send(("refused", str(error)))
    except MemoryError:
        pipe.send(("failed", "there is not enough memory for this run; record less often (temporal.record_every)"))


def _marched(pipe: Any, wish: Wish, wishes: _Wishes) -> None:
    from ...case import loads
    from ...io.datasets import save
    from ...study.analyses import simulate, summarise
    from ...study.workspace import Workspace
    from ...temporal.trajectory import Trajectory
    from ...view.run_so_far import run_so_far
    from ..conclusions import of_run

    work = Workspace(loads(wish.case))

    def progress(done: int, planned: int) -> None:
        pipe.send(("progress", (done, planned)))
        if wishes.stop.is_set():
            raise KeyboardInterrupt

    def shown(part: Trajectory) -> None:
        drawn = run_so_far(part, point=wish.point, max_frequency_hz=wish.max_frequency_hz)
        pipe.send(("picture", drawn.to_json()))
        if wishes.slow is not None:
            slow, wishes.slow = wishes.slow, None
            pipe.send(sounded(part, slow))

    run = simulate(work, wish.mu, progress=progress, checkpoint=shown, checkpoint_seconds=TOLD_SECONDS)
    shown(run)
    target = save(run, Path(wish.folder) / FILE)
    if run.interrupted:
        sentence = f"stopped after {run.steps} of {run.planned_steps} steps"
    else:
        sentence = of_run(summarise(work, run).to_json()).sentence
    pipe.send(("stopped" if run.interrupted else "done", {"sentence": sentence, "file": str(target)}))


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

"""A process of its own that answers what a page asks, the newest question only.

While it computes, at most one question waits: the newest. What takes longer than `PATIENCE`, or comes after the part
`IDLE`, is given up for a newer one, so that two hundred moves of a slider are a handful of answers and never a queue.
The process ends with its pipe, and so with the page and with the server, however these end.
"""

from __future__ import annotations

import contextlib
import os
import signal
import threading
import time
from _thread import interrupt_main
from collections.abc import Callable
from dataclasses import dataclass
from types import FrameType
from typing import Any

from ...heap import give_back
from ...studies.processes import forked
from .own_end import GONE, OwnEnd

PATIENCE = 0.5  # seconds that an answer may take before a newer question stops it
IDLE = "idle"  # the part that says: what comes now is for when nobody asks
LOADED = "stridor.app.page.loaded"  # what processes of pages have from the start
END = 3.0  # seconds that a process has to end

Send = Callable[[str, Any], None]
Answer = Callable[[Any, Send], None]
Heard = Callable[[int, str, Any], None]


class Superseded(BaseException):
    """A newer question is there. No Exception: nobody on the way takes it for a failure of what is computed."""


@dataclass(frozen=True)
class Program:
    """What a worker runs: ``function`` of ``module`` makes, once in the process, what answers its questions."""

    module: str
    function: str

    def made(self) -> Answer:
        """What answers."""
        from importlib import import_module

        return getattr(import_module(self.module), self.function)()


BENCH = Program("stridor.app.page.bench", "bench")


class Worker:
    """The page's side of the process. heard(number, part, content) is called, in a thread of its own, with every piece
    of an answer: of the question ``number``, "done" at its end, "failed" with a sentence where the process has died."""

    def __init__(self, heard: Heard, program: Program = BENCH) -> None:
        self._heard, self._program = heard, program
        self._number = 0
        self._newest: tuple[int, Any] | None = None
        self._last: tuple[int, Any] | None = None
        self._retried = 0
        self._wake = threading.Condition()
        self._closed = False
        self._process: Any = None
        self._pipe: OwnEnd | None = None
        self._end = threading.Lock()
        self._sender = threading.Thread(target=self._sending, name="stridor-page-sender", daemon=True)
        self._sender.start()

    def ask(self, question: Any) -> int:
        """Put a question in place of any that was not sent yet; its number."""
        with self._wake:
            self._number += 1
            self._newest = self._last = (self._number, question)
            self._wake.notify()
            return self._number

    @property
    def process(self) -> Any:
        """The process, None before the first question."""
        return self._process

    def close(self) -> None:
        """Let the process end, as it does with its pipe. Returns at once."""
        with self._wake:
            self._closed = True
            self._wake.notify()
            pipe, self._pipe = self._pipe, None
        if pipe is not None:
            pipe.hang_up()

    def end(self) -> None:
        """Wait until the process is gone, once closed; what does not end by itself is killed."""
        with self._end:
            if self._process is not None:
                ended(self._process, END)

    def _sending(self) -> None:
        while True:
            with self._wake:
                while self._newest is None and not self._closed:
                    self._wake.wait()
                if self._closed:
                    return
                newest, self._newest = self._newest, None
                assert newest is not None, "waited for"
                pipe = self._pipe or self._started()
            with contextlib.suppress(OSError, ValueError):  # died or closed meanwhile: the listener says so
                pipe.send(newest)

    def _started(self) -> OwnEnd:
        """The pipe of a new process."""
        self._process, pipe = forked(_serve, "stridor page", self._program, loaded=LOADED)
        self._pipe = own = OwnEnd(pipe)
        threading.Thread(target=self._listening, args=(own,), name="stridor-page-listener", daemon=True).start()
        return own

    def _listening(self, pipe: OwnEnd) -> None:
        while True:
            try:
                number, part, content = pipe.recv()
            except GONE:
                break
            self._heard(number, part, content)
        pipe.close()
        with self._wake:
            died = not self._closed and pipe is self._pipe
            number, again = self._number, False
            if died:
                self._pipe = None  # the next question starts another one
                again = self._retried != number
            if again:  # the newest question is not lost with a process that died of one before
                self._retried, self._newest = number, self._last
                self._wake.notify()
        if died and not again:
            self._heard(number, "failed", "the process that computes for this page has died; the next change starts "
                                          "another one")  # fmt: skip


def ended(process: Any, patience: float) -> None:
    """Wait for a process to end, and kill it where that takes longer than ``patience`` [s]."""
    process.join(patience)
    if process.is_alive():
        process.kill()
        process.join(END)


class _Questions:
    """Inside of the process: the newest question that nobody has begun, and whether what is under way is given up."""

    def __init__(self, pipe: Any) -> None:
        self.pipe = pipe
        self._wake = threading.Condition()
        self._newest: tuple[int, Any] | None = None
        self._began: float | None = None
        self._sending = False
        self._patience = PATIENCE
        threading.Thread(target=self._reading, daemon=True).start()
        threading.Thread(target=self._watching, daemon=True).start()

    def next(self) -> tuple[int, Any]:
        """The newest question, waited for."""
        with self._wake:
            self._began = None
            while self._newest is None:
                self._wake.wait(0.5)
            newest, self._newest = self._newest, None
            self._began, self._patience = time.monotonic(), PATIENCE
            return newest

    def send(self, message: tuple[int, str, Any]) -> None:
        """Tell the page, whole: what is half written into a pipe spoils it."""
        self._sending = True
        try:
            self.pipe.send(message)
        finally:
            self._sending = False

    @property
    def waiting(self) -> bool:
        """Whether a newer question is there, and what is under way has had its time."""
        began = self._began
        late = began is not None and time.monotonic() - began >= self._patience
        return late and self._newest is not None and not self._sending

    def idle(self) -> None:
        """What is under way from here on is for when nobody asks."""
        self._patience = 0.0
        if self.waiting:
            interrupt_main(signal.SIGINT)

    def given_up(self) -> None:
        """What is under way is: it is not interrupted again."""
        self._began = None

    def _reading(self) -> None:
        while True:
            try:
                newest = self.pipe.recv()
            except (EOFError, OSError):
                os._exit(0)  # nobody listens any more; there is nothing to be written
            with self._wake:
                self._newest = newest
                self._wake.notify()
            if self.waiting:
                interrupt_main(signal.SIGINT)

    def _watching(self) -> None:
        while True:
            time.sleep(0.02)
            if self.waiting:
                interrupt_main(signal.SIGINT)


def _serve(pipe: Any, program: Program) -> None:
    questions: _Questions | None = None

    def interrupted(_: int, frame: FrameType | None) -> None:
        # Ctrl-C goes to all processes of a terminal: here it means nothing, the pipe will end.
        if questions is not None and questions.waiting and _may_stop(frame):
            questions.given_up()
            raise Superseded

    signal.signal(signal.SIGINT, interrupted)
    answer = program.made()
    questions = _Questions(pipe)
    while True:
        try:
            _answer_next(questions, answer)
        except Superseded:
            continue
        except OSError:
            return


def _may_stop(frame: FrameType | None) -> bool:
    """Whether what is under way can be left where it is: a module half imported, or a kernel half compiled, stays so
    for all answers to come."""
    while frame is not None:
        name = frame.f_code.co_filename
        if name.startswith("<frozen importlib") or f"{os.sep}numba{os.sep}" in name:
            return False
        frame = frame.f_back
    return True


def _answer_next(questions: _Questions, answer: Answer) -> None:
    number, question = questions.next()

    def send(part: str, content: Any) -> None:
        if part == IDLE:
            questions.idle()
        else:
            questions.send((number, part, content))

    answer(question, send)
    send("done", None)
    give_back()  # nobody waits for anything now

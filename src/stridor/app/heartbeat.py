"""No verb is silent for long: on a terminal one line says what it is at, elsewhere a line of log every ten seconds."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Generator
from contextlib import contextmanager

from ..stages import Stage, heard

PATIENCE = 1.5  # seconds of silence before the first word on a terminal
BETWEEN_LINES = 10.0  # seconds, elsewhere
REDRAWN = 0.5  # seconds
ERASED = "\r\x1b[2K"


class Heartbeat:
    """Tells the stage and the time on stderr, from a thread of its own, until something is printed or `end`.

    verb: what is said where no stage is under way, "" for nothing. bars: how many bars are drawn, beside which it says
    nothing.
    """

    def __init__(self, *, terminal: bool, width: int = 80, verb: str = "") -> None:
        self._terminal, self._width = terminal, width
        self._started = self._last = time.monotonic()
        self._verb = self._stage = Stage(verb, self._started)
        self._drawn, self._hushed, self.bars = False, False, 0
        self._lock = threading.RLock()
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._beat, name="heartbeat", daemon=True)
        self._thread.start()

    def at(self, stage: Stage | None) -> None:
        """A stage begins, or one that was interrupted by others goes on; None: nothing that has a name."""
        with self._lock:
            self._stage, self._hushed = stage or self._verb, False

    def hush(self) -> None:
        """Something is printed: no word until the next stage begins."""
        with self._lock:
            self._erase()
            self._hushed = True
            self._last = time.monotonic()

    def end(self) -> None:
        """It is over."""
        self._over.set()
        self._thread.join()
        self.hush()

    def _beat(self) -> None:
        while not self._over.wait(REDRAWN):
            with self._lock:
                if self._hushed or self.bars or not self._stage.what:
                    continue
                now = time.monotonic()
                if self._terminal and now - self._last >= PATIENCE:
                    self._write(ERASED + self._words(now)[: self._width - 1])
                    self._drawn = True
                elif not self._terminal and now - self._last >= BETWEEN_LINES:
                    self._write(self._words(now) + "\n")
                    self._last = now

    def _words(self, now: float) -> str:
        return f"{now - self._started:.0f} s: {self._stage.what}, for {now - self._stage.began:.0f} s"

    def _erase(self) -> None:
        if self._drawn:
            self._write(ERASED)
            self._drawn = False

    def _write(self, text: str) -> None:
        try:
            sys.stderr.write(text)
            sys.stderr.flush()
        except (OSError, ValueError):  # nobody reads it: the work goes on
            self._over.set()


_beating: list[Heartbeat] = []


def hush() -> None:
    """Before anything is printed."""
    for beat in _beating:
        beat.hush()


@contextmanager
def silent() -> Generator[None, None, None]:
    """Something else, a bar, tells how far it is."""
    hush()
    for beat in _beating:
        beat.bars += 1
    try:
        yield
    finally:
        for beat in _beating:
            beat.bars -= 1


@contextmanager
def beating(*, quiet: bool, terminal: bool, width: int, verb: str = "") -> Generator[None, None, None]:
    """Tell on stderr what is being computed within. verb: what is said between the stages."""
    if quiet:
        yield
        return
    beat = Heartbeat(terminal=terminal, width=width, verb=verb)
    _beating.append(beat)
    try:
        with heard(beat.at):
            yield
    finally:
        _beating.remove(beat)
        beat.end()

"""What a computation is at, told to whoever listens: a line on the screen, a log, or nobody."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from dataclasses import dataclass


@dataclass(frozen=True)
class Stage:
    """What is under way, in a few words, and since when (`time.monotonic`)."""

    what: str
    began: float


Listener = Callable[[Stage | None], None]

_log = logging.getLogger("stridor")
_listeners: list[Listener] = []
_now: Stage | None = None


def stage(what: str, *, logged: bool = True) -> None:
    """Say what begins now, in a few words: "steady sliding at μ = 0.3". It lasts until the next one begins, or what
    `passing` is around ends. The log "stridor" has it at level DEBUG, unless it comes again and again."""
    if logged:
        _log.debug("%s", what)
    _tell(Stage(what, time.monotonic()))


def going_on(what: str) -> None:
    """The stage that is under way in other words, such as how far it is; it began when it did."""
    _tell(Stage(what, _now.began if _now is not None else time.monotonic()))


@contextmanager
def passing() -> Generator[None, None, None]:
    """Stages that begin within end with it, and what was under way before goes on. Also a decorator: a function that
    says what it is at is not blamed for what its caller does next."""
    before = _now
    try:
        yield
    finally:
        if _now is not before:
            _tell(before)


@contextmanager
def heard(listener: Listener) -> Generator[None, None, None]:
    """Let ``listener`` hear of every stage that begins or goes on within; None: nothing with a name is under way."""
    global _now
    before, _now = _now, None  # what was begun before is none of its business
    _listeners.append(listener)
    try:
        yield
    finally:
        _listeners.remove(listener)
        _now = before


def _tell(now: Stage | None) -> None:
    global _now
    _now = now
    for listener in _listeners:
        listener(now)

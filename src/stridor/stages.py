"""What a computation is at, told to whoever listens: a line on the screen, a log, or nobody."""

from __future__ import annotations

import logging
from collections.abc import Callable, Generator
from contextlib import contextmanager

Listener = Callable[[str], None]

_log = logging.getLogger("stridor")
_listeners: list[Listener] = []


def stage(what: str) -> None:
    """Say what begins now, in a few words: "steady sliding at μ = 0.3". The log "stridor" has it at level DEBUG."""
    _log.debug("%s", what)
    for listener in _listeners:
        listener(what)


@contextmanager
def heard(listener: Listener) -> Generator[None, None, None]:
    """Let ``listener`` hear of every stage that begins within."""
    _listeners.append(listener)
    try:
        yield
    finally:
        _listeners.remove(listener)

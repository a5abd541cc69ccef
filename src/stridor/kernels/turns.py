"""Turns: of the processes that need a function compiled, one does it and the others take what it has kept."""

from __future__ import annotations

import time
from typing import Any

try:
    import fcntl
except ImportError:  # not on Windows: every process compiles for itself there
    fcntl = None

LONGEST = 120.0  # seconds that another process is waited for; whoever takes longer is compiled beside
_EVERY = 0.02


class Turn:
    """The turn at one function, kept in a file that is locked as long as somebody compiles it. A process that ends
    gives its turn up."""

    def __init__(self, path: str) -> None:
        self._path = path
        self._file: Any = None

    def take(self) -> None:
        """Wait for the turn; without it where it does not come, or where there are no locks."""
        self.give()
        if fcntl is None:
            return
        try:
            file = open(self._path, "a+b")  # noqa: SIM115 - held until the function is kept
        except OSError:
            return
        end = time.monotonic() + LONGEST
        while time.monotonic() < end:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                time.sleep(_EVERY)
            except OSError:  # a file system without locks
                break
            else:
                self._file = file
                return
        file.close()

    def give(self) -> None:
        """Let the next have it."""
        file, self._file = self._file, None
        if file is not None:
            file.close()

"""Our end of the pipe to a process of a page, which one thread reads, others write to and any may hang up.

The number of a pipe that is closed goes to whatever file is opened next, and a thread that was about to read the pipe
or to write to it would do so with that file. So hanging up closes nothing: it lets the reader hear the end, and the
reader closes when nobody writes.
"""

from __future__ import annotations

import contextlib
import os
import socket
import threading
from typing import Any

GONE = (EOFError, OSError, TypeError)  # what reading a pipe that ends may raise; TypeError: closed while it was read


class OwnEnd:
    """An end of a pipe of `multiprocessing`."""

    def __init__(self, pipe: Any) -> None:
        self._pipe = pipe
        self._open = True
        self._writing, self._closing = threading.Lock(), threading.Lock()

    def send(self, message: Any) -> None:
        """Write to it. Raises OSError where nobody is there any more."""
        with self._writing:
            if not self._open:
                raise BrokenPipeError("closed")
            self._pipe.send(message)

    def recv(self) -> Any:
        """What the other end has said next. Raises one of `GONE` at the end."""
        return self._pipe.recv()

    def hang_up(self) -> None:
        """Both ends hear that it is over, the reader on ours too. Returns at once."""
        with self._closing, contextlib.suppress(OSError):
            if not self._open:
                return
            if os.name == "posix":  # where such pipes are sockets
                with socket.socket(fileno=os.dup(self._pipe.fileno())) as end:
                    end.shutdown(socket.SHUT_RDWR)
            else:
                self._open = False
                self._pipe.close()

    def close(self) -> None:
        """For the one that reads it, at its end."""
        self.hang_up()  # whoever writes stops
        with self._writing, self._closing, contextlib.suppress(OSError):
            self._open = False
            self._pipe.close()

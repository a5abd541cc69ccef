"""A file that HDF5 writes into without ever seeing an error: it crashes on those as the program ends.

A full disk or a limit on file sizes is noted, what comes after it is dropped, and the note is raised when the file is
closed, after HDF5 has let go of it. Nothing is kept in memory.
"""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any


class NotedErrors(io.RawIOBase):
    """A new binary file at ``path`` for h5py; `finish` raises the first OSError that there was."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self._file = path.open("w+b", buffering=0)
        self._error: OSError | None = None

    def readable(self) -> bool:
        """Yes: HDF5 looks at what it has written."""
        return True

    def writable(self) -> bool:
        """Yes."""
        return True

    def seekable(self) -> bool:
        """Yes."""
        return True

    def seek(self, offset: int, whence: int = 0, /) -> int:
        """As of a file."""
        return self._file.seek(offset, whence)

    def tell(self) -> int:
        """As of a file."""
        return self._file.tell()

    def readinto(self, buffer: Any, /) -> int:
        """As of a file; zeros where writing failed."""
        view = memoryview(buffer).cast("B")
        count = 0
        try:
            count = self._file.readinto(view) or 0
        except OSError as error:
            self._error = self._error or error
        if self._error is not None and count < len(view):
            view[count:] = bytes(len(view) - count)
            count = len(view)
        return count

    def truncate(self, size: int | None = None, /) -> int:
        """As of a file."""
        try:
            return self._file.truncate(size)
        except OSError as error:
            self._error = self._error or error
            return size or 0

    def write(self, data: Any, /) -> int:
        """All of it, or none that counts."""
        view = memoryview(data).cast("B")
        done = 0
        while self._error is None and done < len(view):
            try:
                done += self._file.write(view[done:]) or 0
            except OSError as error:
                self._error = error
        if done < len(view):
            self._file.seek(len(view) - done, io.SEEK_CUR)
        return len(view)

    def finish(self) -> None:
        """Close the file. Raises OSError where anything could not be written."""
        try:
            self._file.close()
        except OSError as error:
            self._error = self._error or error
        if self._error is not None:
            raise self._error

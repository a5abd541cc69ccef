"""One run at a time in a folder of results.

The folder holds a file that the process keeps locked; the system lets go of it when the process ends, however that is.
Where a file system has no locks, the process named in the file counts, with its start: a number that was given to
another process since holds nothing.
"""

from __future__ import annotations

import contextlib
import errno
import importlib
import json
import os
import time
from collections.abc import Generator, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

from ..errors import CaseError
from .atomic import remove_remains
from .processes import Process, this_process

try:
    import fcntl
except ImportError:
    fcntl = None
try:
    msvcrt: Any = importlib.import_module("msvcrt")  # Windows
except ImportError:
    msvcrt = None

NAME = ".stridor-run"
_TRIES = 20
_BEYOND = 2**30  # Windows lets nobody read bytes that are locked: this one is beyond what is said of the holder
_UNLOCKABLE = (errno.ENOLCK, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS, errno.EINVAL)
# Folders that this process has claimed already: `stridor run` and `st.run` within it ask for the same.
_own: set[Path] = set()


@contextlib.contextmanager
def claimed(folder: Path, parts: Sequence[str] = (), *, where: str = "--out") -> Generator[Path]:
    """The folder, made if need be, for this process alone; remains of dead processes in it are removed.

    parts: folders in it that will be written, which may be there. Raises CaseError where it cannot be written or
    another process is at it.
    """
    made = make_folder(folder, where)
    resolved = folder.resolve()
    if resolved in _own:
        yield folder
        return
    for part in parts:
        if os.path.lexists(folder / part) and not (folder / part).is_dir():
            _refuse(folder / part, where, "is a file" if (folder / part).exists() else "is a link to nothing")
    handle = _lock(folder, where)
    _own.add(resolved)
    try:
        for each in (folder, *(folder / part for part in parts)):
            remove_remains(each)
        yield folder
    finally:
        _own.discard(resolved)
        with contextlib.suppress(OSError):
            (folder / NAME).unlink()
        os.close(handle)
        if msvcrt is not None:  # Windows removes no file that is open, be it another's
            with contextlib.suppress(OSError):
                (folder / NAME).unlink()
        for each in reversed(made):
            # What was made for results that did not come goes again.
            with contextlib.suppress(OSError):
                each.rmdir()


def make_folder(folder: Path, where: str = "--out") -> list[Path]:
    """Make a folder and those above it; those that were made. Raises CaseError, where it cannot be written, too."""
    missing: list[Path] = []
    at = folder
    while not os.path.lexists(at) and at != at.parent:
        missing.insert(0, at)
        at = at.parent
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except FileExistsError:
        _refuse(folder, where, "is a link to nothing" if folder.is_symlink() else "is a file")
    except NotADirectoryError:
        _refuse(folder, where, f"{at} is a file")
    except (OSError, ValueError) as error:
        _refuse(folder, where, f"cannot be made: {getattr(error, 'strerror', None) or error}")
    if not os.access(folder, os.W_OK | os.X_OK):
        _refuse(folder, where, "cannot be written: permission denied")
    return missing


def _refuse(folder: Path, where: str, why: str) -> None:
    raise CaseError(where, str(folder), f"{why}; name a folder for results that can be written (--out)") from None


def _lock(folder: Path, where: str) -> int:
    """Take the folder's lock; the open file that holds it."""
    path = folder / NAME
    for _ in range(_TRIES):
        try:
            handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        except OSError as error:
            _refuse(folder, where, f"cannot be written: {error.strerror}")
            raise
        if _taken(handle) and _still_there(handle, path):
            own = this_process()
            text = json.dumps(
                {
                    "host": own.host,
                    "process": own.number,
                    "started": own.started,
                    "since": datetime.now().astimezone().isoformat(timespec="seconds"),
                }
            )
            with contextlib.suppress(OSError):  # a full disk is told when results are written
                os.ftruncate(handle, 0)
                os.lseek(handle, 0, os.SEEK_SET)
                os.write(handle, text.encode())
            return handle
        holder = _read(handle)
        os.close(handle)
        if holder is None or _process(holder).dead:
            time.sleep(0.05)  # who has just taken it has not yet said so
        else:
            number, host, since = (_printable(holder.get(name)) for name in ("process", "host", "since"))
            raise CaseError(
                where,
                str(folder),
                f"process {number} on {host} has been writing there since {since}; wait for it, stop it, or name "
                "another folder (--out)",
            )
    raise CaseError(where, str(folder), "other processes are writing there; name another folder (--out)")


def _taken(handle: int) -> bool:
    """Whether the lock could be had."""
    if fcntl is not None:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            if error.errno not in _UNLOCKABLE:
                return False
        else:
            return True
    elif msvcrt is not None:
        try:
            os.lseek(handle, _BEYOND, os.SEEK_SET)
            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
        except OSError:
            return False
        return True
    holder = _read(handle)
    if holder is None:
        return True
    return _process(holder).dead or _process(holder) == this_process()


def _process(holder: dict[str, Any]) -> Process:
    number = holder.get("process")
    return Process(str(holder.get("host")), number if isinstance(number, int) else 0, str(holder.get("started", "")))


def _still_there(handle: int, path: Path) -> bool:
    """Whether the open file is the one in the folder: who had it before may have removed it since."""
    try:
        in_folder, mine = path.stat(), os.fstat(handle)
    except OSError:
        return False
    return (in_folder.st_dev, in_folder.st_ino) == (mine.st_dev, mine.st_ino)


def _printable(value: object) -> str:
    return "".join(c for c in str(value) if c.isprintable())[:60]


def _read(handle: int) -> dict[str, Any] | None:
    """What the holder wrote of itself, None before it has."""
    try:
        os.lseek(handle, 0, os.SEEK_SET)
        found = json.loads(os.read(handle, 4096))
    except (OSError, ValueError):
        return None
    return found if isinstance(found, dict) else None

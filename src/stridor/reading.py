"""Files before they are opened: regular ones only, and no larger than this computer can read.

Every reader of case files, meshes, matrices, results and reduced models asks here first, so that a device, a pipe or a
file made to fill the memory costs a message and nothing else.
"""

from __future__ import annotations

import contextlib
import os
import stat
import threading
from collections.abc import Generator
from pathlib import Path

GIB = 2**30
# Environment variable: the largest file, and the most that a packed one may unfold to, in GiB.
VARIABLE = "STRIDOR_READ_LIMIT"
ZIP = b"PK\x03\x04"
_SHARE = 4  # of the memory: what is read is turned into numbers while it is still there
_LEAST = GIB
# Readers at work, and the limit that was there before the first of them.
_LOCK = threading.Lock()
_BOUNDS: list[None] = []
_BEFORE: list[int] = []


def is_utf_16(head: bytes) -> bool:
    """Whether a file that begins so is text of UTF-16, two bytes a character, by its mark."""
    return head.startswith((b"\xff\xfe", b"\xfe\xff"))


def irregular(path: Path, most: int | None = None) -> str | None:
    """Why a path is no file to be read, None where it is one. Raises OSError where nothing can be said of it, with
    FileNotFoundError for what is not there, ValueError for names that cannot be.

    most: bytes that may be in it; by default `largest_file`.
    """
    found = path.stat()
    if stat.S_ISDIR(found.st_mode):
        return "is a folder; must be a file"
    if not stat.S_ISREG(found.st_mode):
        kinds = ((stat.S_ISFIFO, "a pipe"), (stat.S_ISSOCK, "a socket"), (stat.S_ISCHR, "a device"))
        kind = next((word for check, word in kinds if check(found.st_mode)), "a device")
        return f"is no regular file but {kind}; must be a file"
    limit = largest_file() if most is None else most
    if found.st_size > limit:
        how = f"; a larger {VARIABLE} in the environment (GiB) allows it" if most is None else ""
        return f"has {size_words(found.st_size)}, and no more than {size_words(limit)} are read{how}"
    return None


def is_reduced_file(path: Path) -> bool:
    """Whether a file is meant to be a saved model: by its name, or as an archive, which no case file is."""
    return path.suffix == ".npz" or starts_with(path, ZIP)


def starts_with(path: Path, mark: bytes) -> bool:
    """Whether a file begins with these bytes; not where there is none that can be read."""
    try:
        if irregular(path):
            return False
        with path.open("rb") as stream:
            return stream.read(len(mark)) == mark
    except (OSError, ValueError):
        return False


def largest_file() -> int:
    """Bytes that a file may have: what STRIDOR_READ_LIMIT says in GiB, else a quarter of the memory, at least 1 GiB."""
    given = _asked()
    return given if given is not None else max(_LEAST, memory() // _SHARE)


def largest_unfolded(packed: int, *, unquestioned: int, times: int) -> int:
    """Bytes that so many packed ones may unfold to: ``unquestioned``, or ``times`` as many, but never more than the
    memory holds; what STRIDOR_READ_LIMIT says in GiB instead, where that is set."""
    given = _asked()
    return given if given is not None else min(max(unquestioned, times * packed), memory() // 2)


def memory() -> int:
    """Bytes of memory that this process may have."""
    try:
        held = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, OSError, ValueError):  # not on every system
        return 16 * GIB
    try:
        import resource

        soft = resource.getrlimit(resource.RLIMIT_AS)[0]
    except (ImportError, OSError, ValueError):
        return held
    return held if soft == resource.RLIM_INFINITY else min(held, soft)


@contextlib.contextmanager
def bounded() -> Generator[None, None, None]:
    """While a file is read the process may not grow by more than half of the memory (or STRIDOR_READ_LIMIT, where that
    is more): what a reader takes to be a mesh of 1e10 nodes ends in MemoryError, not in the machine's standing still.

    Where the system knows no such limit nothing is done.
    """
    with _LOCK:
        _BOUNDS.append(_set_bound() if not _BOUNDS else None)
    try:
        yield
    finally:
        with _LOCK:
            _BOUNDS.pop()
            if not _BOUNDS:
                _lift_bound()


def _set_bound() -> None:
    try:
        import resource

        soft, hard = resource.getrlimit(resource.RLIMIT_AS)
        held = int(Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")
        bound = held + max(memory() // 2, _asked() or 0)
        if soft == resource.RLIM_INFINITY or bound < soft:
            resource.setrlimit(resource.RLIMIT_AS, (bound, hard))
            _BEFORE.append(soft)
    except (ImportError, OSError, ValueError, IndexError):
        return


def _lift_bound() -> None:
    if _BEFORE:
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (_BEFORE.pop(), resource.getrlimit(resource.RLIMIT_AS)[1]))


def size_words(count: int) -> str:
    """A number of bytes for a message."""
    for unit, size in (("TiB", 2**40), ("GiB", GIB), ("MiB", 2**20), ("KiB", 2**10)):
        if count >= size:
            return f"{count / size:.3g} {unit}"
    return f"{count} bytes"


def _asked() -> int | None:
    """Bytes that the environment allows, None where it says nothing that can be understood."""
    try:
        given = float(os.environ.get(VARIABLE, ""))
    except ValueError:
        return None
    return int(given * GIB) if 0 < given < 2**30 else None

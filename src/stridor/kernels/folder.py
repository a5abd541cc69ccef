"""The folder of compiled functions: one for each state of the sources, in the user's cache.

    CACHE/stridor/kernels/SOURCES-PLATFORM/about.json, *.nbi, *.nbc, *.turn

CACHE is STRIDOR_CACHE_DIR, else NUMBA_CACHE_DIR, else the user's cache folder, else a private one among the temporary
files; else nothing is kept. Changed sources have another folder, so old code cannot be met. What another state of the
same installation left is removed as soon as no process uses it.
"""

from __future__ import annotations

import contextlib
import json
import logging
import os
import re
import stat
import sys
import tempfile
import time
from collections.abc import Generator
from functools import cache
from pathlib import Path
from typing import Any, cast

from numba.core import config

from .sources import PACKAGE, Sources, platform_digest, read_sources

try:
    import fcntl
except ImportError:  # not on Windows
    fcntl = None

VARIABLE = "STRIDOR_CACHE_DIR"
ABOUT = "about.json"
NAME = re.compile(r"[0-9a-f]{24}-[0-9a-f]{12}")
OURS = re.compile(r".*\.(nbi|nbc|turn)(\.tmp\.[0-9a-f]+)?")
UNUSED_DAYS = 30.0  # folders of other installations, which may come back
DAY = 86400.0
_CHECK_EVERY = 1.0  # seconds between looks at the sources

_log = logging.getLogger(PACKAGE)


class Folder:
    """Where this process finds and keeps compiled functions, as long as the sources are those it began with."""

    def __init__(self, path: str, sources: Sources, started: int) -> None:
        self.path = path
        self._sources = sources
        self._started = started
        self._checked = time.monotonic()
        self._valid = self._complained = False
        self._valid = not sources.changed_since(started)
        self._lock: Any = None
        if not self._valid:
            self._say_changed()

    def make(self) -> None:
        """Make the folder, marked as ours and as in use. Raises OSError where it cannot be written."""
        os.makedirs(self.path, exist_ok=True)
        tempfile.TemporaryFile(dir=self.path).close()
        if self._lock is None:
            self._lock = _held(os.path.join(self.path, ABOUT), self._sources)

    def valid(self) -> bool:
        """Are the sources still those that this process has loaded? If not, its code is of no use to others."""
        now = time.monotonic()
        if self._valid and now - self._checked > _CHECK_EVERY:
            self._checked = now
            self._valid = not self._sources.changed_since(self._started)
            if not self._valid:
                self._say_changed()
        return self._valid

    def complain(self, error: BaseException) -> None:
        """Say once that something could not be kept."""
        if not self._complained:
            self._complained = True
            reason = getattr(error, "strerror", None) or error
            _log.warning("note: compiled functions cannot be kept in %s (%s)", self.path, reason)

    def _say_changed(self) -> None:
        self._complained = True
        _log.warning(
            "note: the sources of stridor have changed since this process began; it goes on with what it has loaded "
            "and keeps no compiled functions. Start it again for the new version"
        )


@cache
def kernel_folder() -> Folder | None:
    """The folder for this process, made and marked; None where nothing can be kept. A note says what is unusual."""
    sources = read_sources()
    if sources is None:
        _log.warning("note: stridor's sources are not on the disk; every process compiles its loops anew")
        return None
    name = f"{sources.digest[:24]}-{platform_digest()[:12]}"
    started = int(cast("Any", sys.modules[PACKAGE]).STARTED_NS)
    problem = ""
    for top, own in _candidates():
        folder = Folder(os.path.join(top, name), sources, started)
        fresh = not os.path.isdir(folder.path)
        try:
            if own:
                _claim(top)
            folder.make()
        except (OSError, ValueError) as error:
            if not own and os.path.isfile(os.path.join(folder.path, ABOUT)):
                return folder  # filled by somebody else; not ours to write, but to read
            problem = problem or f"{top} ({getattr(error, 'strerror', None) or error})"
            continue
        if problem:
            _log.warning("note: compiled functions cannot be kept in %s; they go to %s. %s names another folder",
                         problem, top, VARIABLE)  # fmt: skip
        _tidy(Path(top), name, sources, fresh=fresh)
        return folder
    _log.warning("note: compiled functions cannot be kept in %s, nor among the temporary files: every process compiles "
                 "its loops anew. %s names another folder", problem, VARIABLE)  # fmt: skip
    return None


def _candidates() -> Generator[tuple[str, bool], None, None]:
    """Folders to try, the best first, and whether it is one among others' temporary files, to be taken with care."""
    named, numbas = os.environ.get(VARIABLE), cast("str", cast("Any", config).CACHE_DIR)
    if named:
        yield os.path.join(os.path.abspath(named), "kernels"), False
    elif numbas:
        yield os.path.join(os.path.abspath(numbas), PACKAGE, "kernels"), False
    else:
        usual = _user_cache()
        if usual is not None:
            yield os.path.join(usual, PACKAGE, "kernels"), False
    with contextlib.suppress(OSError):
        who = str(os.getuid()) if hasattr(os, "getuid") else "user"
        yield os.path.join(tempfile.gettempdir(), f"{PACKAGE}-{who}", "kernels"), True


def _user_cache() -> str | None:
    """The user's folder for what can be computed again, None where there is no home."""
    if sys.platform == "darwin":
        path = os.path.expanduser("~/Library/Caches")
    elif sys.platform == "win32":
        path = os.environ.get("LOCALAPPDATA") or os.path.expanduser("~/AppData/Local")
    else:
        path = os.environ.get("XDG_CACHE_HOME", "")
        if not os.path.isabs(path):  # as its specification has it
            path = os.path.expanduser("~/.cache")
    return path if os.path.isabs(path) else None


def _claim(top: str) -> None:
    """Make our folder among the temporary files. Raises OSError where somebody else could have put code into it."""
    above = os.path.dirname(top)
    with contextlib.suppress(FileExistsError):
        os.mkdir(above, 0o700)
    found = os.lstat(above)
    mine = not hasattr(os, "getuid") or (found.st_uid == os.getuid() and not found.st_mode & 0o022)
    if not stat.S_ISDIR(found.st_mode) or not mine:
        raise PermissionError(1, "it belongs to somebody else", above)


def _held(path: str, sources: Sources) -> Any:
    """The open file that marks a folder as ours and, as long as this process lives, as in use. Raises OSError."""
    while True:
        file = open(path, "a+", encoding="utf-8")  # noqa: SIM115 - held until the process ends
        _try_lock(file, exclusive=False)
        try:
            same = os.path.samestat(os.fstat(file.fileno()), os.stat(path))
        except FileNotFoundError:
            same = False  # removed between opening and locking
        if same:
            break
        file.close()
        os.makedirs(os.path.dirname(path), exist_ok=True)
    if file.tell() == 0:
        file.write(json.dumps({"program": PACKAGE, "place": sources.location, "sources": sources.digest}) + "\n")
        file.flush()
    os.utime(path)
    return file


def _try_lock(file: Any, *, exclusive: bool) -> bool:
    """Whether the lock is there; one that others share is waited for, it is never held for long."""
    if fcntl is None:
        return False
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB if exclusive else fcntl.LOCK_SH)
    except OSError:
        return False  # in use, or a file system without locks
    return True


def _tidy(top: Path, present: str, sources: Sources, *, fresh: bool) -> None:
    """Remove what other states of this installation left, and what others have not used for long. Never raises."""
    try:
        others = [p for p in top.iterdir() if p.name != present and NAME.fullmatch(p.name) and not p.is_symlink()]
        for folder in others:
            about = folder / ABOUT
            with contextlib.suppress(OSError, ValueError, KeyError, TypeError):
                made = json.loads(about.read_text(encoding="utf-8"))
                if made["program"] != PACKAGE:
                    continue
                follows = made["place"] == sources.location and made["sources"] != sources.digest
                unused = (time.time() - about.stat().st_mtime) / DAY
                if follows or unused > UNUSED_DAYS:
                    _remove(folder, certain=unused > UNUSED_DAYS)
        if fresh:
            _remove_beside(Path(sources.location))
    except OSError:
        return  # tidiness is not worth a run


def _remove(folder: Path, *, certain: bool) -> None:
    """Remove a folder that no process holds; where there are no locks, only one that is certainly unused."""
    with (folder / ABOUT).open("a+", encoding="utf-8") as held:
        if not (_try_lock(held, exclusive=True) or (fcntl is None and certain)):
            return
        for path in folder.iterdir():
            if OURS.fullmatch(path.name) and not path.is_symlink():
                path.unlink()
        if [p.name for p in folder.iterdir()] == [ABOUT]:
            (folder / ABOUT).unlink()
            folder.rmdir()


def _remove_beside(package: Path) -> None:
    """Remove what versions up to 0.1 had numba put beside their modules; nobody reads it any more."""
    for path in package.glob("**/__pycache__/*.nb[ic]"):
        with contextlib.suppress(OSError):
            path.unlink()

"""Files that are either the old or the new version, never half of one."""

from __future__ import annotations

import contextlib
import os
import re
import tempfile
from collections.abc import Generator
from pathlib import Path

from ..errors import AnalysisError
from ..interrupts import held
from .processes import left_behind, this_process

_TEMPORARY = re.compile(r"^\..+\.stridor-(?P<mark>[^.]+\.\d+\.\d+)\.[^.]+(\.[^.]*)?$")


@contextlib.contextmanager
def replacing(path: Path) -> Generator[Path]:
    """A temporary path beside ``path`` that takes its place when the block ends well.

    Ctrl-C waits until the file is in its place. Raises AnalysisError where the folder cannot be written or the disk is
    full; the old file stays then.
    """
    with held():
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            prefix = f".{path.name[:60]}.stridor-{this_process().mark}."
            handle, name = tempfile.mkstemp(dir=path.parent, prefix=prefix, suffix=path.suffix)
            os.close(handle)
        except OSError as error:
            raise _cannot(path, error) from error
        temporary = Path(name)
        try:
            yield temporary
            # A file made by mkstemp is private; give it what a plain open would have given.
            mask = os.umask(0)
            os.umask(mask)
            temporary.chmod(0o666 & ~mask)
            temporary.replace(path)
        except OSError as error:
            raise _cannot(path, error) from error
        finally:
            with contextlib.suppress(OSError):
                temporary.unlink(missing_ok=True)


def _cannot(path: Path, error: OSError) -> AnalysisError:
    return AnalysisError(f"cannot write {path}: {error.strerror or error}")


def write_text(path: Path, text: str) -> None:
    """Write a text file in one piece."""
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def remove_remains(folder: Path) -> None:
    """Remove temporary files that processes left which are dead; of other computers nothing is known, so they stay."""
    with contextlib.suppress(OSError):
        for file in folder.iterdir():
            found = _TEMPORARY.match(file.name)
            if found is not None and left_behind(found["mark"]):
                with contextlib.suppress(OSError):
                    file.unlink()

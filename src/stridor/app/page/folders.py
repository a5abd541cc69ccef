"""Temporary folders of pages, and what servers left of theirs that were killed."""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import stat
import tempfile
from pathlib import Path

from ...io.processes import left_behind, this_process

PREFIX = "stridor-page-"
_NAME = re.compile(rf"^{PREFIX}(?P<mark>[^.]+\.\d+\.\d+)\.[^.]+$")


def new_folder() -> Path:
    """A folder for one page, which nobody else can read; its name says of which process."""
    return Path(tempfile.mkdtemp(prefix=f"{PREFIX}{this_process().mark}."))


def remove_left() -> None:
    """Remove the folders of this user's servers that are dead. Never raises: tidiness is not worth a page."""
    with contextlib.suppress(OSError):
        for folder in Path(tempfile.gettempdir()).glob(f"{PREFIX}*"):
            found = _NAME.match(folder.name)
            if found is not None and left_behind(found["mark"]) and _mine(folder):
                shutil.rmtree(folder, ignore_errors=True)


def _mine(folder: Path) -> bool:
    """Whether it is a folder of this user, and no link to one: others write into the place of temporary files, too."""
    try:
        found = folder.lstat()
    except OSError:
        return False
    return stat.S_ISDIR(found.st_mode) and (not hasattr(os, "getuid") or found.st_uid == os.getuid())

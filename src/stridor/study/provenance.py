"""Who computed what with which versions: attached to every result and written into every file."""

from __future__ import annotations

import platform
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from ..case import Case
from .workspace import Workspace

LIBRARIES = ("stridor", "numpy", "scipy", "numba", "pydantic")


def versions() -> dict[str, str]:
    """Versions of stridor, of what it computes with, and of Python."""
    return dict(_versions())


@cache
def _versions() -> dict[str, str]:
    """Read from the disk once."""
    found = {"python": platform.python_version()}
    for name in LIBRARIES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:  # run from a source tree without installation
            found[name] = "unknown"
    return found


def provenance(problem: Case | Workspace, analysis: str, seconds: float, **settings: Any) -> dict[str, Any]:
    """What a result needs to be made again: case ("" of a system alone), analysis, settings, versions, time."""
    work = Workspace.of(problem)
    return {
        "analysis": analysis,
        "case": work.text,
        "key": work.key,
        "settings": settings,
        "versions": versions(),
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "wall_seconds": seconds,
    }

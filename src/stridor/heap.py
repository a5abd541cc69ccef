"""Memory that is free within a process, given back to the system."""

from __future__ import annotations

import ctypes
from functools import cache
from typing import Any


def give_back() -> None:
    """Give back what this process has freed, where the C library can (glibc): what lies between two pieces that are in
    use is kept by it otherwise, and long work of many sizes leaves much of that. Takes milliseconds."""
    if (trim := _trim()) is not None:
        trim(0)


@cache
def _trim() -> Any:
    try:
        return getattr(ctypes.CDLL(None), "malloc_trim", None)
    except (OSError, TypeError):  # TypeError: Windows knows no library without a name
        return None

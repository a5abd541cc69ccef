"""Memory that is free within a process: given back to the system, or kept for what is needed next."""

from __future__ import annotations

import ctypes
from functools import cache
from typing import Any

MMAP_THRESHOLD, TRIM_THRESHOLD = -3, -1  # of mallopt, in malloc.h


def give_back() -> None:
    """Give back what this process has freed, where the C library can (glibc): what lies between two pieces that are in
    use is kept by it otherwise, and long work of many sizes leaves much of that. Takes milliseconds."""
    if (trim := _of_the_c_library("malloc_trim")) is not None:
        trim(0)


def keep() -> None:
    """Keep what this process frees for what it needs next, where the C library can (glibc). For programs, not for
    libraries: vectors of a large model come and go all the time, and of new memory the system clears every page first,
    a tenth of the time of `onsets` on 50 000 freedoms. `give_back` does so nevertheless.
    """
    option = _of_the_c_library("mallopt")
    # Older ones refuse thresholds above the second. Where one is set, the other does not follow by itself any more.
    if option is not None and any(option(MMAP_THRESHOLD, size) for size in (1 << 30, 1 << 25)):
        option(TRIM_THRESHOLD, (1 << 31) - 1)


@cache
def _of_the_c_library(name: str) -> Any:
    try:
        return getattr(ctypes.CDLL(None), name, None)
    except (OSError, TypeError):  # TypeError: Windows knows no library without a name
        return None

"""Arrays that begin where a line of the cache does: registers that straddle two lines cost a third of the speed."""

from __future__ import annotations

import numpy as np

from ..typing import Array

LINE = 8  # numbers in a line of the cache


def aligned_zeros(shape: tuple[int, ...]) -> Array:
    """Zeros of a shape."""
    size = int(np.prod(shape))
    room = np.empty(size + LINE)
    room[:] = 0.0
    first = -room.ctypes.data // room.itemsize % LINE
    return room[first : first + size].reshape(shape)


def aligned(values: Array) -> Array:
    """A copy."""
    copy = aligned_zeros(values.shape)
    copy[...] = values
    return copy

"""What like cases are compared by, so that what follows from the same is not made again."""

from __future__ import annotations

import numpy as np

from ..typing import Array, IntArray


class Itself:
    """An object that is equal to itself alone, and is kept."""

    def __init__(self, held: object) -> None:
        self._held = held

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Itself) and other._held is self._held

    __hash__ = None  # type: ignore[assignment]


class SameNumbers:
    """An array that is equal to another with the same numbers, and is kept."""

    def __init__(self, held: Array | IntArray) -> None:
        self._held = held

    def __eq__(self, other: object) -> bool:
        return isinstance(other, SameNumbers) and np.array_equal(self._held, other._held)

    __hash__ = None  # type: ignore[assignment]

"""Copies within compiled code that bring no texts along."""

from __future__ import annotations

from typing import Any

from .compiled import njit


@njit(cache=True)
def put(into: Any, values: Any) -> None:  # pragma: no cover - compiled
    """``into[:] = values`` of vectors (n,) of the same length, which nobody checks.

    numba's own assignment of arrays can say both shapes in words: what writes these words is compiled into every
    function that assigns, and takes a tenth of the time that exact steps need to be compiled.
    """
    for i in range(into.shape[0]):
        into[i] = values[i]

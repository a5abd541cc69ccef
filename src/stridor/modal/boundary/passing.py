"""Where the number of growing modes changes and no curve tells where: they pass the highest frequency, or a pair
parts into two that grow without oscillating.

It is counted at the corners of a mesh. Cells of which two corners differ by other than what the curves between them say
are halved until they are small.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise, product
from typing import TypeVar

import numpy as np

from ...typing import Array

CELLS = 16  # of the mesh along either number
HALVINGS = 3  # of cells in which something changes: to 1/128 of the ranges
FINEST = 1 / (CELLS << HALVINGS)
MOST = 2500  # points at most
INSIDE = 1e-6  # of the ranges: how far inside the rectangle the outermost points lie

Place = tuple[int, int]  # in steps of the finest mesh
T = TypeVar("T")


def refined(
    look: Callable[[Array], T | None], differ: Callable[[T, T], bool], held: Sequence[tuple[Array, T]] = (),
    most: int = MOST,
) -> tuple[list[T], list[tuple[T, T]]]:
    """What is seen at the points (2,) of the mesh, each looked at once, and of every finest cell in which something
    changes two neighbours that differ. What is not known, None, differs from nothing, but its cells are halved, as it
    hides what changes there. held: places (2,) that have been looked at, which count in the cells that hold them.
    Beyond ``most`` points cells stay as they are."""
    seen: dict[Place, T | None] = {}
    fine, size = CELLS << HALVINGS, 1 << HALVINGS
    cells = [(size * i, size * j) for i, j in product(range(CELLS), repeat=2)]
    while True:
        mixed: list[tuple[Place, tuple[T, T] | None]] = []
        for cell in cells:
            corners = _corners(cell, size)
            new = [c for c in corners if c not in seen]
            if len(seen) + len(new) > most:
                return [at for at in seen.values() if at is not None], []
            seen |= {c: look(np.clip(np.array(c) / fine, INSIDE, 1 - INSIDE)) for c in new}
            known = [at for c in corners if (at := seen[c]) is not None]
            pair = next((pair for pair in pairwise(known) if differ(*pair)), None)
            inside = [at for p, at in held if _holds(cell, size, p)] if pair is None else []
            odd = len(known) < len(corners) or any(differ(*two) for two in pairwise([*known, *inside]))
            if pair is not None or odd:
                mixed.append((cell, pair))
        if size == 1:
            return [at for at in seen.values() if at is not None], [pair for _, pair in mixed if pair is not None]
        size //= 2
        cells = [part for cell, _ in mixed for part in _corners(cell, size)]


def _holds(cell: Place, size: int, p: Array) -> bool:
    """Whether a point (2,) lies in a cell."""
    return all(c <= at * (CELLS << HALVINGS) <= c + size for c, at in zip(cell, p.tolist(), strict=True))


def _corners(cell: Place, size: int) -> tuple[Place, Place, Place, Place]:
    """Around a cell, each next to the one before."""
    i, j = cell
    return (i, j), (i + size, j), (i + size, j + size), (i, j + size)

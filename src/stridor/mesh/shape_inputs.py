"""What the built-in shapes are given, checked: sizes, radii, sectors, numbers of cells."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..errors import CaseError
from ..typing import Array

_MOST_CELLS = 10_000_000
_MOST_RATIO = 1e4  # of the last cell to the first: beyond it, cells are too flat for anything

Grading = Sequence[float | Sequence[float]]
"""For each direction the size of the last cell over that of the first, or the places of the cells' ends from 0 to 1."""


def divisions_for(lengths: Sequence[float], element_size: float) -> tuple[int, ...]:
    """Numbers of cells along edges of such lengths [m] so that no cell's edge is longer than element_size [m]."""
    return tuple(max(1, math.ceil(length / element_size * (1 - 1e-9))) for length in lengths)


def finite(value: float, where: str) -> float:
    """A number that is finite."""
    if isinstance(value, bool) or not isinstance(value, int | float | np.number) or not math.isfinite(value):  # pyright: ignore[reportUnnecessaryIsInstance]
        raise CaseError(where, value, "must be a finite number")
    return float(value)


def numbers(values: Sequence[float], count: int, where: str) -> Array:
    """So many finite numbers."""
    if len(values) != count:
        raise CaseError(where, list(values), f"must be {count} numbers")
    return np.array([finite(v, where) for v in values])


def sizes(values: Sequence[float], count: int, where: str) -> tuple[float, ...]:
    """So many lengths above zero [m]."""
    found = numbers(values, count, where)
    if np.any(found <= 0):
        raise CaseError(where, values[0] if count == 1 else list(values), "must be greater than 0")
    return tuple(float(v) for v in found)


def radii(inner: float, outer: float, where: str, *, solid: bool) -> tuple[float, float]:
    """Inner and outer radius [m]."""
    inside, outside = finite(inner, f"{where}.inner_radius"), finite(outer, f"{where}.outer_radius")
    if inside < 0 or (inside == 0 and not solid):
        accepted = "must be 0 (a solid disc) or more" if solid else "must be greater than 0"
        raise CaseError(f"{where}.inner_radius", inner, accepted)
    if outside <= inside:
        raise CaseError(f"{where}.outer_radius", outer, f"must be greater than the inner radius, {inner:g}")
    return inside, outside


def sector(start_deg: float, sweep_deg: float, where: str) -> tuple[float, float]:
    """Start and sweep [°]."""
    start, sweep = finite(start_deg, f"{where}.start_deg"), finite(sweep_deg, f"{where}.sweep_deg")
    if not 0 < sweep <= 360:
        raise CaseError(f"{where}.sweep_deg", sweep_deg, "must be greater than 0 and at most 360")
    return start, sweep


def counts_along(
    divisions: Sequence[int] | None,
    element_size: float | None,
    lengths: Sequence[float],
    names: tuple[str, ...],
    where: str,
) -> tuple[int, ...]:
    """Numbers of cells along each direction, as given or for the element size."""
    if (divisions is None) == (element_size is None):
        raise CaseError(where, None, "needs either divisions or element_size, not both")
    if element_size is not None:
        size = finite(element_size, f"{where}.element_size")
        if size <= 0:
            raise CaseError(f"{where}.element_size", element_size, "must be greater than 0")
        # Checked before counting: a length over a tiny size may be more than any integer.
        if math.prod(max(1.0, length / size) for length in lengths) > _MOST_CELLS:
            raise CaseError(f"{where}.element_size", element_size, f"makes more than {_MOST_CELLS:,} cells")
        return divisions_for(lengths, size)
    given = list(divisions or ())
    whole = all(isinstance(n, int | np.integer) and not isinstance(n, bool) and n >= 1 for n in given)  # pyright: ignore[reportUnnecessaryIsInstance]
    if len(given) != len(lengths) or not whole:
        raise CaseError(f"{where}.divisions", given, f"must be {len(lengths)} whole numbers from 1: {', '.join(names)}")
    if math.prod(int(n) for n in given) > _MOST_CELLS:
        raise CaseError(f"{where}.divisions", given, f"makes more than {_MOST_CELLS:,} cells")
    return tuple(int(n) for n in given)


def enough_around(count: int, sweep_deg: float, where: str) -> None:
    """Refuses arcs of more than a third of a circle per cell: they would cut through the body."""
    least = math.ceil(sweep_deg / 120.0 - 1e-9)
    if count < least:
        raise CaseError(f"{where}.divisions", count, f"needs at least {least} divisions around for {sweep_deg:g}°")


def shares_along(
    grading: Grading | None, counts: Sequence[int], step: int, names: Sequence[str], where: str
) -> list[Array | None]:
    """Places from 0 to 1 (step·n + 1,) along each direction with its n cells, midside nodes half way; None where cells
    are even. Sizes of cells form a geometric series where a ratio is given."""
    if grading is None:
        return [None] * len(counts)
    if len(grading) != len(counts):
        accepted = f"must have {len(counts)} entries, each a ratio or a list of places: {', '.join(names)}"
        raise CaseError(f"{where}.grading", list(grading), accepted)
    return [
        _shares(entry, count, step, f"{where}.grading.{k}")
        for k, (entry, count) in enumerate(zip(grading, counts, strict=True))
    ]


def _shares(entry: float | Sequence[float], count: int, step: int, where: str) -> Array | None:
    if isinstance(entry, Sequence):
        ends = numbers(entry, count + 1, where)
        if ends[0] != 0.0 or ends[-1] != 1.0 or np.any(np.diff(ends) <= 0.0):
            accepted = f"must be {count + 1} numbers that rise from 0 to 1, the ends of {count} cells"
            raise CaseError(where, list(entry), accepted)
    else:
        ratio = finite(entry, where)
        if not 1.0 / _MOST_RATIO <= ratio <= _MOST_RATIO:
            accepted = f"must be between {1 / _MOST_RATIO:g} and {_MOST_RATIO:g}: the last cell's size over the first's"
            raise CaseError(where, entry, accepted)
        if ratio == 1.0 or count == 1:
            return None
        sizes_ = ratio ** (np.arange(count) / (count - 1))
        ends = np.concatenate([[0.0], np.cumsum(sizes_) / sizes_.sum()])
        ends[-1] = 1.0
    if step == 1:
        return ends
    found = np.empty(2 * count + 1)
    found[::2], found[1::2] = ends, 0.5 * (ends[:-1] + ends[1:])
    return found


def span(start: float, end: float, intervals: int, shares: Array | None) -> Array:
    """Places (intervals + 1,) from start to end, even or at the shares (intervals + 1,) of the way."""
    if shares is None:
        return np.linspace(start, end, intervals + 1)
    positions = start + (end - start) * shares
    positions[-1] = end
    return positions

"""What every reader asks of the arrays that it has found: real, finite and whole numbers, pointers, a square matrix."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np

from ..typing import Array, IntArray
from .source import MatrixFile, counted

# A damping matrix of a few dashpots has fewer entries than rows; beyond this many rows that is taken for an error.
_MOST_ROWS = 10_000_000
_MOST_LISTED = 12


def nameless(source: MatrixFile, name: str | None, held: str | None = None) -> None:
    """Raises CaseError if a matrix is asked for by a name in a file that holds one, of no name or of the name held."""
    if name is not None and name.strip().lower() != (held or "").lower():
        known = f"its name is {held}" if held else "it has no name"
        source.refuse(f"holds one matrix only, and {known}; leave out the name {name!r}")


def chosen(source: MatrixFile, name: str | None, names: Mapping[str, bool], others: str = "") -> str:
    """The name of the matrix that is meant; names: whether each candidate has several rows and columns.

    Without a name it is the only candidate, or the only one that is no vector and no single number. others: what else
    the file holds, for the message. Raises CaseError with the names to choose from.
    """
    if name is not None:
        if name in names:
            return name
        source.refuse(f"holds no matrix named {name!r}; it holds: {_listed(names)}{others}")
    if not names:
        source.refuse(f"holds no matrix of numbers{others}")
    found = list(names) if len(names) == 1 else [key for key, large in names.items() if large]
    if len(found) != 1:
        source.refuse(f"holds several matrices; choose one by its name: {_listed(found or names)}")
    return found[0]


def chosen_in_any_case(source: MatrixFile, name: str | None, names: Iterable[str]) -> str:
    """The same where capitals make no difference, and every name is that of a matrix. Raises CaseError for one that
    several matrices have."""
    held = list(names)
    meant = [key for key in held if name is None or key.upper() == name.strip().upper()]
    if len(meant) > 1 and len({key.upper() for key in meant}) == 1:
        source.refuse(f"holds {len(meant)} matrices named {meant[0]}; write each to a file of its own")
    return chosen(source, meant[0] if name is not None and meant else name, dict.fromkeys(held, True))


def _listed(names: Iterable[str]) -> str:
    """Names for a message, the first dozen of them."""
    held = [str(key) for key in names]
    more = f" and {len(held) - _MOST_LISTED} more" if len(held) > _MOST_LISTED else ""
    return ", ".join(held[:_MOST_LISTED]) + more or "none"


def real_part(source: MatrixFile, values: Any) -> Any:
    """Values as they are, or their real part. Raises CaseError for what are no numbers, or have imaginary parts."""
    kind = values.dtype.kind
    if kind == "c":
        if imaginary := int(np.count_nonzero(values.imag)):
            many = counted(imaginary, "entry has", "entries have")
            source.refuse(f"is complex: {many} an imaginary part; only real matrices are read")
        return values.real
    if kind == "b":
        source.refuse("holds logical values, true or false; must be real numbers")
    if kind not in "iuf":
        source.refuse(f"holds values of type {values.dtype}; must be real numbers")
    return values


def real_values(source: MatrixFile, values: Any, location: Callable[[int], str] = "value {}".format) -> Array:
    """Finite doubles of the shape of values. Raises CaseError for what are no numbers, complex or not finite ones.

    location: says in words where the k-th value stands, from 1.
    """
    with np.errstate(over="ignore"):  # of long doubles; found below
        real = np.asarray(real_part(source, values), dtype=np.float64)
    finite = np.isfinite(real)
    if not np.all(finite):
        bad = int(np.flatnonzero(~finite.ravel())[0])
        source.refuse(f"{location(bad + 1)} is {real.ravel()[bad]}; must be a finite number")
    return real


def whole_numbers(source: MatrixFile, values: Any, what: str) -> IntArray:
    """Values (k,) as int64. Raises CaseError where one is no whole number, or too large to be told from the next."""
    if values.ndim != 1 or values.dtype.kind not in "iuf":
        source.refuse(f"its {what} are no list of whole numbers")
    with np.errstate(invalid="ignore"):
        wrong = np.flatnonzero(~(np.abs(values.astype(np.float64)) < 2.0**53) | (values != np.floor(values)))
    if len(wrong):
        source.refuse(f"number {wrong[0] + 1} of its {what} is {values[wrong[0]]}; must be a whole number, below 2^53")
    return values.astype(np.int64)


def square(source: MatrixFile, rows: int, columns: int) -> int:
    """The size of a matrix that is square and not empty. Raises CaseError otherwise."""
    if rows != columns or rows < 1:
        empty = "" if rows and columns else " and not empty"
        source.refuse(f"is a matrix of {rows} rows and {columns} columns; must be square{empty}")
    return rows


def check_size(source: MatrixFile, size: int, entries: int) -> None:
    """Raises CaseError for a matrix of so many rows that so few entries cannot be all of it."""
    # Rows without entries cost nothing in a file, but memory here.
    if size > max(_MOST_ROWS, entries):
        held = counted(entries, "entry", "entries")
        source.refuse(f"claims {size} rows but holds only {held}; it must have broken off")


def check_indices(source: MatrixFile, row: IntArray, column: IntArray, size: int, first: int) -> None:
    """Raises CaseError for entries (k,), counted from 0, outside of a matrix; first: what the file counts from."""
    wrong = np.flatnonzero((row < 0) | (row >= size) | (column < 0) | (column >= size))
    if len(wrong):
        at = int(wrong[0])
        entry = f"entry {at + 1} (row {row[at] + first}, column {column[at] + first})"
        source.refuse(f"{entry} lies outside of the matrix of {size} rows and columns, which are counted from {first}")


def expanded(source: MatrixFile, pointers: Any, count: int, lines: int, first: int = 0) -> IntArray:
    """Which row (or column) each entry belongs to, from 0, by pointers (lines + 1,) that count from the first.

    count: entries that there are. Raises CaseError for pointers that do not fit.
    """
    held = whole_numbers(source, pointers, "pointers")
    if len(held) != lines + 1:
        source.refuse(f"has {len(held)} pointers for {lines} rows or columns; must be one more than these")
    if held[0] != first:
        source.refuse(f"its pointers begin with {held[0]}; must count from {first}")
    steps = np.diff(held)
    if np.any(steps < 0) or held[-1] - first > count:
        source.refuse(f"its pointers do not rise from the first to the last of its {count} entries")
    return np.repeat(np.arange(lines, dtype=np.int64), steps)

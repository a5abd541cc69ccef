"""Tables of numbers in text files, as many on each line.

SciPy's own reader of them takes 1.0D5 for 1.
"""

from __future__ import annotations

import warnings
from typing import NoReturn

import numpy as np

from ..typing import Array
from .source import MatrixFile, Stream, quoted, unended

_BLOCK = 1 << 22
LONGEST_LINE = 1 << 16
_SPACE, _NUMBER = 1, 2
_KIND = np.zeros(256, dtype=np.uint8)
_KIND[list(b" \t\n\v\f\r")] = _SPACE
_KIND[list(b"0123456789+-.eEdD")] = _NUMBER
_FORTRAN = bytes.maketrans(b"Dd", b"Ee")


def read_numbers(
    source: MatrixFile, stream: Stream, line: int, columns: int, most: int | None = None
) -> tuple[Array, tuple[str, ...]]:
    """Numbers (k, columns) in the rest of a text file, as many on each line, and what is to be noted about them.

    Exponents may have a D; blank lines are passed over. line: lines that were read before. most: rows that there may
    be. Raises CaseError with the line for what is no number, not finite, or not as many as columns on a line.
    """
    parts: list[Array] = []
    found, rest, text = 0, b"", b""
    notes: tuple[str, ...] = ()
    while block := stream.read(_BLOCK):
        notes = unended(block)
        text = rest + (block if parts or rest or line else source.as_text(block))
        cut = text.rfind(b"\n") + 1
        text, rest = text[:cut], text[cut:]
        if len(rest) > LONGEST_LINE:
            source.refuse(f"line {line + text.count(10) + 1} is too long to be one of {columns} numbers")
        parts.append(_numbers(source, text, line, columns))
        found += len(parts[-1])
        line += text.count(b"\n")
        if most is not None and found > most:
            break
    if rest:
        parts.append(_numbers(source, rest, line, columns))
        found += len(parts[-1])
    if most is not None and found > most:
        source.refuse(f"holds more entries than the {most} that its head promises")
    return (np.concatenate(parts) if parts else np.empty((0, columns))), notes


def _numbers(source: MatrixFile, text: bytes, line: int, columns: int) -> Array:
    """Numbers (k, columns) of whole lines; line: lines before these."""
    if not text.strip():
        return np.empty((0, columns))
    kind = _KIND[np.frombuffer(text, dtype=np.uint8)]
    if not kind.all():
        bad = int(np.flatnonzero(kind == 0)[0])
        begin, end = text.rfind(b"\n", 0, bad) + 1, text.find(b"\n", bad)
        _refuse(source, line + text.count(10, 0, bad) + 1, text[begin : end if end >= 0 else len(text)], columns)
    inside = kind == _NUMBER
    starts = np.flatnonzero(inside & ~np.concatenate(([False], inside[:-1])))
    ends = np.flatnonzero(np.frombuffer(text, dtype=np.uint8) == 10)
    of_line = np.bincount(np.searchsorted(ends, starts))
    wrong = np.flatnonzero((of_line != 0) & (of_line != columns))
    if len(wrong):
        _refuse(source, line + int(wrong[0]) + 1, text.split(b"\n")[wrong[0]], columns)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # older versions of NumPy only warn of what is no number
            values = np.fromstring(text.translate(_FORTRAN), sep=" ")
    except (ValueError, DeprecationWarning):
        values = np.empty(0)
    # Numbers that touch, as in 1-5, are more than the words that they stand in.
    if len(values) != len(starts) or not np.all(np.isfinite(values)):
        for number, held in enumerate(text.split(b"\n")):
            for word in held.split():
                if not _is_finite(word):
                    source.refuse(f"line {line + number + 1}: {quoted(word)} is not a finite number")
        source.refuse(f"lines {line + 1} to {line + text.count(10)} are not numbers")
    return values.reshape(-1, columns)


def _refuse(source: MatrixFile, number: int, text: bytes, columns: int) -> NoReturn:
    source.refuse(f"line {number}: {quoted(text)} must be {columns} finite number{'s'[: columns != 1]}")


def _is_finite(word: bytes) -> bool:
    try:
        return bool(np.isfinite(float(word.translate(_FORTRAN))))
    except ValueError:
        return False

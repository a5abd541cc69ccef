"""Matrix Market files (.mtx, .mtx.gz), and tables of numbers in text files.

SciPy's own reader takes 1.0D5 for 1 and counts a symmetric matrix twice that is stored whole; therefore this one.
"""

from __future__ import annotations

import gzip
import warnings
from pathlib import Path
from typing import IO

import numpy as np

from ..typing import Array
from .model import StoredMatrix
from .numpy_file import Source, assembled, completed, nameless, real_values, source_at, whole_numbers

_BLOCK = 1 << 22
_LONGEST_LINE = 1 << 16
_BANNER = b"%%matrixmarket"
_SPACE, _NUMBER = 1, 2
_KIND = np.zeros(256, dtype=np.uint8)
_KIND[list(b" \t\n\v\f\r")] = _SPACE
_KIND[list(b"0123456789+-.eEdD")] = _NUMBER
_FORTRAN = bytes.maketrans(b"Dd", b"Ee")


def read(path: Path, name: str | None, where: str) -> StoredMatrix:
    """The matrix in a Matrix Market file: coordinate or array; real, integer or complex without imaginary parts;
    general, symmetric, skew-symmetric or hermitian. It may be packed by gzip.

    Raises CaseError at where: not such a file, broken off, a pattern without values, not square, not real.
    """
    source = source_at(path, where)
    nameless(source, name)
    try:
        with path.open("rb") as plain:
            packed = plain.read(2) == b"\x1f\x8b"
            plain.seek(0)
            if not packed:
                return _read(source, plain)
            with gzip.GzipFile(fileobj=plain) as stream:
                return _read(source, stream)  # pyright: ignore[reportArgumentType]
    except Exception as error:  # gzip raises many kinds
        source.unreadable("a Matrix Market file", error)


def _read(source: Source, stream: IO[bytes]) -> StoredMatrix:
    layout, field, symmetry = _banner(source, stream.readline(_LONGEST_LINE))
    line, sizes = 1, b""
    while not sizes:
        text = stream.readline(_LONGEST_LINE)
        line += 1
        if not text:
            source.refuse("breaks off before the line with the size of the matrix")
        sizes = b"" if text.startswith(b"%") else text.strip()
    needed = 3 if layout == "coordinate" else 2
    words = sizes.split()
    if len(words) != needed or not all(word.isdigit() and len(word) < 19 for word in words):
        what = "rows, columns and entries" if needed == 3 else "rows and columns"
        source.refuse(f"line {line}: {in_text(sizes)} is not the number of {what}")
    shape = (int(words[0]), int(words[1]))
    width = 2 if field == "complex" else 1
    if layout == "coordinate":
        count = int(words[2])
        table = read_numbers(source, stream, line, 2 + width, most=count)
        row, column = (whole_numbers(source, table[:, k], ("rows", "columns")[k]) - 1 for k in range(2))
        values = table[:, 2:]
    else:
        if symmetry != "general" and shape[0] != shape[1]:
            source.refuse(f"is a matrix of {shape[0]} rows and {shape[1]} columns; must be square")
        skipped = {"general": 0, "skew-symmetric": shape[0]}.get(symmetry, 0)
        whole = symmetry == "general"
        count = shape[0] * shape[1] if whole else (shape[0] * (shape[0] + 1)) // 2 - skipped
        values = read_numbers(source, stream, line, width, most=count)
    if len(values) < count:
        source.refuse(f"breaks off: line {line} promises {count} entries, and there are {len(values)}")
    number = real_values(source, values[:, 0] + 1j * values[:, 1] if width == 2 else values[:, 0])
    if layout == "array":
        # By columns; of a symmetric one only what is on and below the diagonal, which are
        # the places on and above it by rows, transposed.
        if symmetry == "general":
            column, row = np.divmod(np.arange(count), max(shape[0], 1))
        else:
            column, row = np.triu_indices(shape[0], 1 if symmetry == "skew-symmetric" else 0)
        kept = number != 0
        row, column, number = row[kept], column[kept], number[kept]
    if symmetry == "general":
        matrix, notes = assembled(source, row, column, number, shape)  # pyright: ignore[reportPossiblyUnboundVariable]
    else:
        sign = -1 if symmetry == "skew-symmetric" else 1
        matrix, notes = completed(source, row, column, number, shape, sign)  # pyright: ignore[reportPossiblyUnboundVariable]
    form = "symmetric" if symmetry in ("symmetric", "hermitian") else "general"
    return StoredMatrix(matrix, source.path.name, form=form, notes=notes)


def _banner(source: Source, text: bytes) -> tuple[str, str, str]:
    """Layout, field and symmetry from the first line. Raises CaseError."""
    words = text.lower().split()
    if not words or words[0] != _BANNER:
        source.refuse("does not begin with %%MatrixMarket; must be a Matrix Market file")
    accepted = (
        ("matrix",),
        ("coordinate", "array"),
        ("real", "integer", "complex", "pattern"),
        ("general", "symmetric", "skew-symmetric", "hermitian"),
    )
    given = [word.decode("ascii", "replace") for word in words[1:]]
    if len(given) != len(accepted) or any(word not in known for word, known in zip(given, accepted, strict=True)):
        choices = "; ".join(" or ".join(known) for known in accepted)
        source.refuse(f"line 1: {in_text(text)} must say after %%MatrixMarket: {choices}")
    if given[2] == "pattern":
        source.refuse("line 1: a pattern says where entries are and not how large; must be real, integer or complex")
    return given[1], given[2], given[3]


def read_numbers(source: Source, stream: IO[bytes], line: int, columns: int, most: int | None = None) -> Array:
    """Numbers (k, columns) in the rest of a text file, as many on each line; exponents also with D; blank lines are
    passed over. line: lines that were read before. most: rows that there may be.

    Raises CaseError with the line for what is no number, not finite, or not as many as columns on a line.
    """
    parts: list[Array] = []
    found, rest, ended = 0, b"", False
    while not ended:
        block = stream.read(_BLOCK)
        ended = not block
        text = rest + block
        cut = len(text) if ended else text.rfind(b"\n") + 1
        text, rest = text[:cut], text[cut:]
        if len(rest) > _LONGEST_LINE:
            source.refuse(f"line {line + text.count(10) + 1} is too long to be one of {columns} numbers")
        if text:
            parts.append(_numbers(source, text, line, columns))
            found += len(parts[-1])
            line += text.count(b"\n")
        if most is not None and found > most:
            source.refuse(f"holds more entries than the {most} that its head promises")
    return np.concatenate(parts) if parts else np.empty((0, columns))


def _numbers(source: Source, text: bytes, line: int, columns: int) -> Array:
    """Numbers (k, columns) of whole lines; line: lines before these."""
    kind = _KIND[np.frombuffer(text, dtype=np.uint8)]
    if not kind.all():
        bad = int(np.flatnonzero(kind == 0)[0])
        begin, end = text.rfind(b"\n", 0, bad) + 1, text.find(b"\n", bad)
        shown = in_text(text[begin : end if end >= 0 else len(text)])
        source.refuse(f"line {line + text.count(10, 0, bad) + 1}: {shown} must be {columns} numbers")
    inside = kind == _NUMBER
    starts = np.flatnonzero(inside & ~np.concatenate(([False], inside[:-1])))
    if not len(starts):
        return np.empty((0, columns))
    ends = np.flatnonzero(np.frombuffer(text, dtype=np.uint8) == 10)
    of_line = np.bincount(np.searchsorted(ends, starts))
    wrong = np.flatnonzero((of_line != 0) & (of_line != columns))
    lines = text.split(b"\n") if len(wrong) else []
    if len(wrong):
        shown = in_text(lines[wrong[0]])
        source.refuse(f"line {line + wrong[0] + 1}: {shown} must be {columns} number{'s'[: columns != 1]}")
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
                    source.refuse(f"line {line + number + 1}: {in_text(word)} is not a finite number")
        source.refuse(f"lines {line + 1} to {line + text.count(10)} are not numbers")
    return values.reshape(-1, columns)


def _is_finite(word: bytes) -> bool:
    try:
        return bool(np.isfinite(float(word.translate(_FORTRAN))))
    except ValueError:
        return False


def in_text(text: bytes) -> str:
    """Bytes of a file for a message: quoted, on one line, shortened."""
    shown = " ".join(text[:200].decode("ascii", "replace").split())
    return repr(shown if len(shown) <= 50 else shown[:49] + "…")

"""Matrix Market files (.mtx, .mtx.gz).

SciPy's own reader takes 1.0D5 for 1 and counts a symmetric matrix twice that is stored whole; therefore this one.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..typing import Array, IntArray
from .checks import nameless, real_values, square, whole_numbers
from .entries import assembled, from_half
from .model import StoredMatrix
from .numbers import whole_number
from .source import MatrixFile, Stream, quoted, source_at
from .tables import LONGEST_LINE, read_numbers

_BANNER = b"%%matrixmarket"


def read(path: Path, name: str | None, where: str) -> StoredMatrix:
    """The matrix in a Matrix Market file: coordinate or array; real, integer or complex without imaginary parts;
    general, symmetric, skew-symmetric or hermitian. It may be packed by gzip.

    Raises CaseError at where: not such a file, broken off, a pattern without values, not square, not real.
    """
    source = source_at(path, where)
    nameless(source, name)
    with source.stream() as stream:
        layout, field, symmetry = _banner(source, source.as_text(stream.readline(LONGEST_LINE)))
        line, sizes = _sizes(source, stream, 3 if layout == "coordinate" else 2)
        rows, columns = sizes[:2]
        if symmetry != "general":
            square(source, rows, columns)
        width = 2 if field == "complex" else 1
        before = 2 if layout == "coordinate" else 0
        count = sizes[2] if layout == "coordinate" else _length(rows, columns, symmetry)
        table, notes = read_numbers(source, stream, line, before + width, most=count)
    if len(table) < count:
        source.refuse(f"breaks off: line {line} promises {count} entries, and there are {len(table)}")
    values = table[:, before] + 1j * table[:, before + 1] if width == 2 else table[:, before]
    if layout == "coordinate":
        row, column = (whole_numbers(source, table[:, k], ("rows", "columns")[k]) - 1 for k in range(2))
    else:
        row, column, values = _of_array(real_values(source, values), rows, symmetry)
    if symmetry == "general":
        matrix, more = assembled(source, row, column, values, (rows, columns))
    else:
        sign = -1 if symmetry == "skew-symmetric" else 1
        matrix, more = from_half(source, row, column, values, (rows, columns), sign)
    form = "symmetric" if symmetry in ("symmetric", "hermitian") else "general"
    return StoredMatrix(matrix, source.path.name, form=form, notes=notes + more)


def _banner(source: MatrixFile, text: bytes) -> tuple[str, str, str]:
    """Layout, field and symmetry from the first line. Raises CaseError."""
    words = text.lower().split()
    if not words or words[0] != _BANNER:
        source.refuse("does not begin with %%MatrixMarket; must be a Matrix Market file")
    accepted = (
        ("matrix",),
        ("coordinate", "array"),
        ("real", "double", "integer", "unsigned-integer", "complex", "pattern"),
        ("general", "symmetric", "skew-symmetric", "hermitian"),
    )
    given = [word.decode("ascii", "replace") for word in words[1:]]
    if len(given) != len(accepted) or any(word not in known for word, known in zip(given, accepted, strict=True)):
        choices = "; ".join(" or ".join(known) for known in accepted)
        source.refuse(f"line 1: {quoted(text)} must say after %%MatrixMarket: {choices}")
    if given[2] == "pattern":
        source.refuse("line 1: a pattern says where entries are and not how large; must be real, integer or complex")
    return given[1], given[2], given[3]


def _sizes(source: MatrixFile, stream: Stream, needed: int) -> tuple[int, list[int]]:
    """The number of the line with the sizes, and these: rows, columns and perhaps entries. Raises CaseError."""
    line, text = 1, b""
    while not text or text.startswith(b"%"):
        piece = stream.readline(LONGEST_LINE)
        if not piece:
            source.refuse("breaks off before the line with the size of the matrix")
        line, text = line + 1, piece.strip()
        while len(piece) == LONGEST_LINE and not piece.endswith(b"\n"):  # as only a comment may go on
            piece = stream.readline(LONGEST_LINE)
    sizes = [size for word in text.split() if (size := whole_number(word)) is not None]
    if len(sizes) != needed or len(text.split()) != needed:
        what = "rows, columns and entries" if needed == 3 else "rows and columns"
        source.refuse(f"line {line}: {quoted(text)} is not the number of {what}")
    return line, sizes


def _length(rows: int, columns: int, symmetry: str) -> int:
    """How many numbers an array has: of a matrix with a symmetry, those on and below the diagonal or below it."""
    if symmetry == "general":
        return rows * columns
    return (rows * (rows + 1)) // 2 - (rows if symmetry == "skew-symmetric" else 0)


def _of_array(values: Array, rows: int, symmetry: str) -> tuple[IntArray, IntArray, Array]:
    """Row, column and value of what is not 0 in an array, which goes by columns."""
    if symmetry == "general":
        column, row = np.divmod(np.arange(len(values)), max(rows, 1))
    else:
        # The places on and below the diagonal by columns are those on and above it by rows, transposed.
        column, row = np.triu_indices(rows, 1 if symmetry == "skew-symmetric" else 0)
    kept = values != 0
    return row[kept], column[kept], values[kept]

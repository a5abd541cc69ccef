"""Harwell–Boeing files, as Ansys's HBMAT writes them, with the .mapping file that names the equations.

SciPy's reader refuses symmetric matrices.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..typing import Array, Sparse
from .checks import expanded, nameless, square, whole_numbers
from .entries import assembled, from_half
from .fortran_format import cut, format_of, formats_in
from .model import Labels, StoredMatrix
from .numbers import whole_number
from .source import MatrixFile, beside, printable, quoted, source_at, unended

_DIRECTIONS = {"UX": 1, "UY": 2, "UZ": 3, "ROTX": 4, "ROTY": 5, "ROTZ": 6}
_PARTS = ("pointers", "row indices", "values")
_LONGEST_HEAD = 256


def read(path: Path, name: str | None, where: str) -> StoredMatrix:
    """The matrix in a Harwell–Boeing or Rutherford–Boeing file, whose name is the key in its first line.

    Accepted are assembled matrices, real or with imaginary parts of 0: symmetric, skew-symmetric and hermitian ones,
    completed from their half, and unsymmetric ones. Right-hand sides are passed over. Labels come from STEM.mapping or
    FILE.mapping beside it. Raises CaseError at where.
    """
    source = source_at(path, where)
    data = source.text()
    if b"\0" in data:
        source.refuse("is no text; must be a Harwell–Boeing file in text form (HBMAT,…,ASCII)")
    lines = data.split(b"\n")
    while lines and not lines[-1].strip():
        lines.pop()
    if len(lines) < 5:
        source.refuse(f"has {len(lines)} lines; a Harwell–Boeing file has a head of 4 and its numbers after it")
    head = [line[:_LONGEST_HEAD].decode("latin-1") for line in lines[:4]]
    key = printable(head[0][72:80]) or None
    nameless(source, name, key)
    kind = head[2][:3].upper()
    cards = _counts(source, head[1], 2, 0)
    rows, columns, count, elements = (*_counts(source, head[2][3:], 3, 3), 0)[:4]
    if len(cards) < 4:
        source.refuse(f"line 2: {quoted(lines[1])} must say how many lines there are: all, pointers, indices, values")
    _check_kind(source, kind, rows, columns, elements)
    behind = cards[4] if len(cards) > 4 else 0
    needed = (columns + 1, count, count * (2 if kind[0] == "C" else 1))
    parts, notes = _numbers(source, lines, head[3], cards, needed)
    matrix, more = _matrix(source, kind, (rows, columns), parts)
    notes += unended(data) + more
    if behind:
        notes = (*notes, f"Its right-hand sides ({behind} lines) were not read.")
    form = "symmetric" if kind[1] in "SH" else "general"
    return StoredMatrix(matrix, path.name, _labels(source, rows), form=form, name=key, notes=notes)


def _numbers(
    source: MatrixFile, lines: list[bytes], formats: str, cards: list[int], needed: tuple[int, ...]
) -> tuple[list[Array], tuple[str, ...]]:
    """Pointers, row indices and values: so many as needed, in so many lines as the cards (all, …) say, one after the
    other; and notes. Raises CaseError."""
    # Rutherford–Boeing and older files have no fifth line; Ansys's have it even where it says that nothing follows.
    behind = cards[4] if len(cards) > 4 else 0
    at = 5 if behind or lines[4].lstrip()[:1].isalpha() else 4
    layouts = [format_of(source, text) for text in formats_in(source, formats)]
    parts: list[Array] = []
    notes: tuple[str, ...] = ()
    for what, many, layout, said in zip(_PARTS, needed, layouts, cards[1:4], strict=True):
        take = layout.lines(many)
        if take != said:
            source.refuse(f"line 2 promises {said} lines of {what}, but {many} by {layout.text} take {take}")
        if at + take > len(lines):
            source.refuse(f"breaks off: its {what} take lines {at + 1} to {at + take}, and it has {len(lines)}")
        numbers, more = cut(source, lines[at : at + take], layout, many, at, what)
        parts.append(numbers)
        notes += more
        at += take
    after = len(lines) - at
    if after != behind:
        source.refuse(f"line 2 promises {behind} lines of right-hand sides, but {after} lines follow the values")
    return parts, notes


def _matrix(
    source: MatrixFile, kind: str, shape: tuple[int, int], parts: list[Array]
) -> tuple[Sparse, tuple[str, ...]]:
    pointers, indices, numbers = parts
    values = numbers[0::2] + 1j * numbers[1::2] if kind[0] == "C" else numbers
    column = expanded(source, pointers, len(indices), shape[1], first=1)
    if len(column) != len(indices):
        source.refuse(f"its last pointer is {int(pointers[-1])}; with {len(indices)} entries it must be one more")
    row = whole_numbers(source, indices, "row indices") - 1
    if kind[1] in "UR":
        return assembled(source, row, column, values, shape)
    return from_half(source, row, column, values, shape, -1 if kind[1] == "Z" else 1)


def _check_kind(source: MatrixFile, kind: str, rows: int, columns: int, elements: int) -> None:
    """Raises CaseError for a type of matrix that is not read."""
    if len(kind) != 3 or kind[0] not in "RCPIQ" or kind[1] not in "SUHZR" or kind[2] not in "AE":
        source.refuse(f"line 3: {kind!r} is no type of matrix, such as RUA or RSA")
    if kind[0] in "PQ":
        source.refuse(f"line 3: {kind} is a pattern without values; must be real, such as RUA or RSA")
    if kind[2] == "E" or elements:
        source.refuse(f"line 3: {kind} holds element matrices that are not assembled; must be such as RUA or RSA")
    square(source, rows, columns)


def _counts(source: MatrixFile, text: str, number: int, least: int) -> list[int]:
    """Whole numbers of a line of the head, in fields of 14 columns. Raises CaseError."""
    counts = [count for word in text.split() if (count := whole_number(word)) is not None]
    if len(counts) < max(least, len(text.split())):
        source.refuse(f"line {number}: {quoted(text.encode())} must hold whole numbers")
    return counts


def _labels(source: MatrixFile, size: int) -> Labels | None:
    """Labels from the .mapping file beside the matrix, None if there is none. Raises CaseError if it does not fit."""
    path = source.path
    stems = (path.with_suffix(".mapping"), path.with_suffix(".MAPPING"), path.with_name(path.name + ".mapping"))
    mapping = beside(source, *(p.name for p in stems))
    if mapping is None:
        return None
    node = np.zeros(size, dtype=np.int64)
    direction = np.zeros(size, dtype=np.int64)
    seen = np.zeros(size, dtype=bool)
    for number, line in enumerate(mapping.text().split(b"\n")):
        words = line.split()
        if not words or not (seen.any() or whole_number(words[0]) is not None):
            continue  # its head
        at, named = (whole_number(word, lowest=-(2**53)) for word in (*words, b"", b"")[:2])
        if len(words) < 3 or at is None or named is None:
            mapping.refuse(f"line {number + 1}: {quoted(line)} must be an equation, a node and a label such as UX")
        if not 1 <= at <= size or seen[at - 1]:
            mapping.refuse(f"line {number + 1}: equation {at} is named twice or none of the {size} of {path.name}")
        seen[at - 1], node[at - 1] = True, named
        direction[at - 1] = _DIRECTIONS.get(words[2].decode("ascii", "replace").upper(), 0)
    if not seen.all():
        first = int(np.flatnonzero(~seen)[0]) + 1
        mapping.refuse(f"does not name equation {first} of the {size} of {path.name}; the two are not of the same run")
    return Labels(node, direction)

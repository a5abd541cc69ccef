"""Harwell–Boeing files, as Ansys's HBMAT writes them, with the .mapping file that names the equations.

Numbers are cut out by the columns of the Fortran formats in the head, since they may touch each other. SciPy's reader
refuses symmetric matrices.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..typing import Array
from .market import in_text
from .model import Labels, StoredMatrix
from .numpy_file import Source, assembled, completed, expanded, nameless, real_values, source_at, whole_numbers

_DIRECTIONS = {"UX": 1, "UY": 2, "UZ": 3, "ROTX": 4, "ROTY": 5, "ROTZ": 6}
_MOST_COLUMNS = 4096
_SPARE_COLUMNS = 256
_TOUCHING = re.compile(r"(?<=[0-9.])([+-])")
_ITEM = re.compile(
    r"""(?P<scale>[+-]?\d+)P | (?P<skip>\d*)X
      | (?P<repeat>\d*)(?P<kind>[IEDFG])(?P<width>\d+)(?:\.(?P<digits>\d+))?(?:E\d+)?""",
    re.VERBOSE,
)
_IN_CHARACTERS = np.zeros(256, dtype=bool)
_IN_CHARACTERS[list(b" 0123456789+-.E")] = True


@dataclass(frozen=True)
class _Format:
    """A Fortran format of equal fields: its text, where in a line fields begin, their width, digits after the point
    that are assumed where none is written (0: whole numbers), and the power of ten that a P asks for."""

    text: str
    starts: tuple[int, ...]
    width: int
    digits: int
    scale: int

    @property
    def end(self) -> int:
        return self.starts[-1] + self.width

    def lines(self, count: int) -> int:
        """How many lines that many numbers take."""
        return -(-count // len(self.starts))


def read(path: Path, name: str | None, where: str) -> StoredMatrix:
    """The matrix in a Harwell–Boeing or Rutherford–Boeing file, whose name is the key in its first line.

    Accepted are assembled matrices, real or with imaginary parts of 0: symmetric, skew-symmetric and hermitian ones,
    completed from their half, and unsymmetric ones. Right-hand sides are passed over. Labels come from STEM.mapping or
    FILE.mapping beside it. Raises CaseError at where.
    """
    source = source_at(path, where)
    try:
        stored = _read(source, path.read_bytes(), name)
    except Exception as error:
        source.unreadable("a Harwell–Boeing file", error)
    return stored


def _read(source: Source, data: bytes, name: str | None) -> StoredMatrix:
    if b"\0" in data:
        source.refuse("is no text; must be a Harwell–Boeing file in text form (HBMAT,…,ASCII)")
    lines = data.split(b"\n")
    while lines and not lines[-1].strip():
        lines.pop()
    if len(lines) < 5:
        source.refuse(f"has {len(lines)} lines; a Harwell–Boeing file has a head of 4 and its numbers after it")
    head = [line[:_SPARE_COLUMNS].decode("ascii", "replace") for line in lines[:4]]
    key = head[0][72:80].strip() or None
    nameless(source, name, key)
    cards = _counts(source, head[1], 2, 0)
    kind = head[2][:3].upper()
    rows, columns, count, elements = (*_counts(source, head[2][3:], 3, 3), 0)[:4]
    if len(cards) < 4:
        source.refuse(f"line 2: {in_text(lines[1])} must say how many lines there are: all, pointers, indices, values")
    _check_kind(source, kind, rows, columns, elements)
    formats = [_format(source, text) for text in _formats(source, head[3])]
    # Rutherford–Boeing and older files have no fifth line; Ansys's have it even where it says that nothing follows.
    behind = cards[4] if len(cards) > 4 else 0
    first = 5 if behind or lines[4].lstrip()[:1].isalpha() else 4
    parts: list[Array] = []
    wanted = ((columns + 1, "pointers"), (count, "row indices"), (count * (2 if kind[0] == "C" else 1), "values"))
    for (needed, what), layout, said in zip(wanted, formats, cards[1:4], strict=True):
        take = layout.lines(needed)
        if take != said:
            source.refuse(f"line 2 promises {said} lines of {what}, but {needed} by {layout.text} take {take}")
        if first + take > len(lines):
            source.refuse(f"breaks off: its {what} take lines {first + 1} to {first + take}, and it has {len(lines)}")
        parts.append(_fields(source, lines[first : first + take], layout, needed, first, what))
        first += take
    after = len(lines) - first
    if after != behind:
        source.refuse(f"line 2 promises {behind} lines of right-hand sides, but {after} lines follow the values")
    matrix, notes = _matrix(source, kind, (rows, columns), parts)
    labels = _labels(source, rows)
    if behind:
        notes = (*notes, f"Its right-hand sides ({behind} lines) were not read.")
    form = "symmetric" if kind[1] in "SH" else "general"
    return StoredMatrix(matrix, source.path.name, labels, form=form, name=key, notes=notes)


def _matrix(source: Source, kind: str, shape: tuple[int, int], parts: list[Array]) -> tuple[Any, tuple[str, ...]]:
    pointers, indices, numbers = parts
    values = numbers[0::2] + 1j * numbers[1::2] if kind[0] == "C" else numbers
    values = real_values(source, values)
    column = expanded(source, pointers - 1, len(indices), shape[1])
    if len(column) != len(indices):
        source.refuse(f"its last pointer is {int(pointers[-1])}; with {len(indices)} entries it must be one more")
    row = whole_numbers(source, indices, "row indices") - 1
    if kind[1] in "UR":
        return assembled(source, row, column, values, shape)
    return completed(source, row, column, values, shape, -1 if kind[1] == "Z" else 1)


def _check_kind(source: Source, kind: str, rows: int, columns: int, elements: int) -> None:
    """Raises CaseError for a type of matrix that is not read."""
    if len(kind) != 3 or kind[0] not in "RCPIQ" or kind[1] not in "SUHZR" or kind[2] not in "AE":
        source.refuse(f"line 3: {kind!r} is no type of matrix, such as RUA or RSA")
    if kind[0] in "PQ":
        source.refuse(f"line 3: {kind} is a pattern without values; must be real, such as RUA or RSA")
    if kind[2] == "E" or elements:
        source.refuse(f"line 3: {kind} holds element matrices that are not assembled; must be such as RUA or RSA")
    if rows != columns or rows < 1:
        source.refuse(f"is a matrix of {rows} rows and {columns} columns; must be square")


def _counts(source: Source, text: str, number: int, least: int) -> list[int]:
    """Whole numbers of a line of the head, in fields of 14 columns. Raises CaseError."""
    words = text.split()
    if len(words) < least or not all(word.isascii() and word.isdigit() and len(word) < 16 for word in words):
        source.refuse(f"line {number}: {in_text(text.encode())} must hold whole numbers")
    return [int(word) for word in words]


def _formats(source: Source, text: str) -> list[str]:
    """The first three groups in brackets of the fourth line."""
    found: list[str] = []
    depth, begin = 0, 0
    for at, letter in enumerate(text):
        if letter == "(":
            begin = at if depth == 0 else begin
            depth += 1
        elif letter == ")" and depth:
            depth -= 1
            if depth == 0:
                found.append(text[begin : at + 1])
    if len(found) < 3:
        source.refuse(f"line 4: {in_text(text.encode())} must hold the Fortran formats of pointers, indices and values")
    return found[:3]


def _format(source: Source, text: str) -> _Format:
    """What a format such as (1P,5D16.8) means. Raises CaseError for one that is not of equal fields."""
    bad = f"line 4: the format {text[:40]} is not understood; accepted are such as (8I10), (1P,5D16.8), (4(1X,E20.12))"
    inner = "".join(text.upper().split())[1:-1]
    times = 1
    group = re.fullmatch(r"(?:([+-]?\d+)P,?)?(\d*)\(([^()]*)\)", inner)
    scale = 0
    if group:
        scale, times, inner = int(group[1] or 0), int(group[2] or 1), group[3]
    starts: list[int] = []
    widths: set[tuple[int, int]] = set()
    at, column = 0, 0
    while at < len(inner):
        item = _ITEM.match(inner, at)
        if item is None or len(item[0]) > 12:
            source.refuse(bad)
        at = item.end() + (inner[item.end() : item.end() + 1] == ",")
        if item["scale"]:
            scale = int(item["scale"])
        elif item["kind"]:
            width, repeat = int(item["width"]), int(item["repeat"] or 1)
            widths.add((width, 0 if item["kind"] == "I" else int(item["digits"] or 0)))
            if not 0 < width * repeat <= _MOST_COLUMNS:
                source.refuse(bad)
            starts += range(column, column + width * repeat, width)
            column += width * repeat
        else:
            column += int(item["skip"] or 1)
        if column > _MOST_COLUMNS:
            source.refuse(bad)
    if len(widths) != 1 or not 0 < times * column <= _MOST_COLUMNS:
        source.refuse(bad)
    width, digits = widths.pop()
    return _Format(text, tuple(t * column + s for t in range(times) for s in starts), width, digits, scale)


def _fields(source: Source, lines: list[bytes], layout: _Format, count: int, before: int, what: str) -> Array:
    """Numbers (count,) of a format from lines; before: lines of the file that precede these. Raises CaseError."""
    if not lines:
        return np.zeros(0)
    longest = max(map(len, lines))
    if longest > layout.end + _SPARE_COLUMNS:
        at = next(k for k, line in enumerate(lines) if len(line) == longest)
        source.refuse(f"line {before + at + 1} has {longest} columns; the format {layout.text} has {layout.end}")
    wide = max(longest, layout.end)
    if wide * len(lines) > 10_000_000 + 20 * sum(map(len, lines)):  # a broken format must not take all memory
        source.refuse(f"lines {before + 1} to {before + len(lines)} are much shorter than the format {layout.text}")
    text = np.array(lines, dtype=f"S{wide}").view(np.uint8).reshape(len(lines), wide).copy()
    text[(text == 0) | (text == 13) | (text == 9)] = 32  # short lines are filled with NUL
    places = np.add.outer(np.array(layout.starts), np.arange(layout.width))
    # Fortran would pass over these, be it a sign.
    outside = np.delete(np.arange(wide), places.ravel())
    if np.any(beyond := np.any(text[:, outside] != 32, axis=1)):
        at = int(np.flatnonzero(beyond)[0])
        source.refuse(f"line {before + at + 1}: {in_text(lines[at])} has more in it than {layout.text} takes")
    cells = text[:, places].reshape(-1, layout.width)

    def refuse(at: int, reason: str) -> None:
        line = before + at // len(layout.starts) + 1
        source.refuse(f"line {line}: {in_text(cells[at].tobytes())} {reason}")

    blank = np.all(cells == 32, axis=1)
    if np.any(wrong := blank[:count]):
        at = int(np.flatnonzero(wrong)[0])
        refuse(at, f"stands where number {at + 1} of its {what} should be, by the format {layout.text}")
    if not np.all(blank[count:]):
        refuse(count + int(np.flatnonzero(~blank[count:])[0]), f"is one more than the {count} {what} promised")
    cells = cells[:count]
    for letter in b"DdeQq":
        cells[cells == letter] = ord("E")
    return _values(cells, layout, refuse)


def _values(cells: Any, layout: _Format, refuse: Any) -> Array:
    """Numbers (k,) from characters (k, width); refuse(k, reason) is told the first that is none."""
    wrong = np.flatnonzero(~np.all(_IN_CHARACTERS[cells], axis=1))
    if len(wrong):
        refuse(int(wrong[0]), f"is not a finite number, by the format {layout.text}")
    sign = (cells == ord("+")) | (cells == ord("-"))
    before = cells[:, :-1]
    touching = np.any(sign[:, 1:] & (((before >= ord("0")) & (before <= ord("9"))) | (before == ord("."))), axis=1)
    words = np.ascontiguousarray(cells).view(f"S{layout.width}").ravel()
    for at in np.flatnonzero(touching):  # 1.0-101: three digits leave no room for the letter
        text = _TOUCHING.sub(r"E\1", words[at].decode("ascii").strip(), count=1)
        if len(text) >= layout.width:
            words = words.astype(f"S{max(words.dtype.itemsize, len(text))}")
        words[at] = text.encode("ascii")
    try:
        values = words.astype(np.float64)
    except ValueError:
        values = np.array([_number(word) for word in words])
    wrong = np.flatnonzero(~np.isfinite(values))
    if len(wrong):
        refuse(int(wrong[0]), f"is not a finite number, by the format {layout.text}")
    # Fortran shifts numbers without a point, and under P those without an exponent; other programs do not.
    nonzero = values != 0
    if layout.digits and np.any(unclear := nonzero & ~np.any(cells == ord("."), axis=1)):
        refuse(int(np.flatnonzero(unclear)[0]), f"has no decimal point, which {layout.text} lets be read two ways")
    plain = ~np.any(cells == ord("E"), axis=1) & ~touching
    if layout.scale and np.any(unclear := nonzero & plain):
        refuse(int(np.flatnonzero(unclear)[0]), f"has no exponent, which {layout.text} lets be read two ways")
    return values


def _number(word: bytes) -> float:
    try:
        return float(word)
    except ValueError:
        return np.nan


def _labels(source: Source, size: int) -> Labels | None:
    """Labels from the .mapping file beside the matrix, None if there is none. Raises CaseError if it does not fit."""
    path = source.path
    ways = (path.with_suffix(".mapping"), path.with_suffix(".MAPPING"), path.with_name(path.name + ".mapping"))
    beside = next((p for p in ways if p.is_file() and p != path), None)
    if beside is None:
        return None
    node = np.zeros(size, dtype=np.int64)
    direction = np.zeros(size, dtype=np.int64)
    seen = np.zeros(size, dtype=bool)
    mapping = Source(beside, source.where)
    for number, line in enumerate(beside.read_bytes().split(b"\n")):
        words = line.split()
        if not words or not (seen.any() or _is_whole(words[0])):
            continue  # its head
        if len(words) < 3 or not (_is_whole(words[0]) and _is_whole(words[1])):
            mapping.refuse(f"line {number + 1}: {in_text(line)} must be an equation, a node and a label such as UX")
        at = int(words[0]) - 1
        if not 0 <= at < size or seen[at]:
            mapping.refuse(f"line {number + 1}: equation {at + 1} is named twice or none of the {size} of {path.name}")
        seen[at], node[at] = True, int(words[1])
        direction[at] = _DIRECTIONS.get(words[2].decode("ascii", "replace").upper(), 0)
    if not seen.all():
        first = int(np.flatnonzero(~seen)[0]) + 1
        mapping.refuse(f"does not name equation {first} of the {size} of {path.name}; the two are not of the same run")
    return Labels(node, direction)


def _is_whole(word: bytes) -> bool:
    return word.removeprefix(b"-").isdigit() and len(word) < 18

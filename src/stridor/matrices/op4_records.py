"""Records of Nastran's OUTPUT4 files: headers of matrices, and runs of entries in their columns.

A matrix is a header and a record for each column that is not empty; a record for a column after the last ends it.
Lengths count words, of which a double precision number takes two. In sparse records a column comes as strings of
entries in a row. They begin with one word, 65536 (length + 1) + first row, or, for large matrices (BIGMAT, with a
negative number of rows), with two words, length + 1 and first row.
"""

from __future__ import annotations

import math
import re
import struct
from dataclasses import dataclass, field
from typing import Any, NoReturn

import numpy as np

from ..errors import CaseError
from ..typing import Array, IntArray
from .numbers import fortran_number, whole_number
from .source import MatrixFile, counted, printable

_BIG = 65536
_FORMAT = re.compile(r"(?:1P,?)?(\d+)[ED](\d+)\.\d+")


@dataclass
class Header:
    """What a matrix is. numbers a line holds and characters each takes: in text files only."""

    name: str
    columns: int
    rows: int
    form: int
    kind: int
    per_line: int = 5
    width: int = 16

    @property
    def large(self) -> bool:
        """Whether strings begin with two words."""
        return self.rows < 0 or self.rows >= _BIG

    @property
    def parts(self) -> int:
        """Numbers that an entry takes."""
        return 2 if self.kind in (3, 4) else 1


@dataclass
class EntryRuns:
    """Runs of entries: first row and column from 0, where its numbers begin, and how many entries it has."""

    rows: list[int] = field(default_factory=list)
    columns: list[int] = field(default_factory=list)
    starts: list[int] = field(default_factory=list)
    counts: list[int] = field(default_factory=list)

    def add(self, row: int, column: int, start: int, count: int) -> None:
        self.rows.append(row)
        self.columns.append(column)
        self.starts.append(start)
        self.counts.append(count)

    def spread(self, step: int) -> tuple[IntArray, IntArray, IntArray]:
        """Row, column and place of the number, of each entry (k,); step: what an entry takes there."""
        counts = np.array(self.counts, dtype=np.int64)
        first = np.repeat(np.cumsum(counts) - counts, counts)
        within = np.arange(int(counts.sum()), dtype=np.int64) - first
        rows, columns, starts = (
            np.repeat(np.array(v, dtype=np.int64), counts) for v in (self.rows, self.columns, self.starts)
        )
        return rows + within, columns, starts + step * within


def records(source: MatrixFile, data: bytes) -> Text | Binary:
    """The records of a file, from its beginning to its end. Raises CaseError where it has none."""
    if data[:4] in (struct.pack(o + "i", n) for o in "<>" for n in (24, 48)):
        return Binary(source, data)
    text = source.as_text(data)
    if b"\0" in text[:80]:
        source.refuse("is binary, but begins with no OUTPUT4 header (a record of 24 or 48 bytes)")
    return Text(source, text)


def _problem(header: Header) -> str | None:
    """What is wrong with a header, in any file."""
    if header.columns < 1 or header.rows == 0:
        return f"has {abs(header.rows)} rows and {header.columns} columns; must have at least one of each"
    if header.kind not in (1, 2, 3, 4):
        return f"type {header.kind} is not known; accepted: 1, 2 (real) and 3, 4 (complex)"
    return None


class Text:
    """An OUTPUT4 file of text, taken from its beginning to its end."""

    def __init__(self, source: MatrixFile, data: bytes) -> None:
        self._source = source
        self._lines = data.decode("latin-1").split("\n")
        self._at = 0
        self._numbers: list[float] = []

    def header(self) -> Header | None:
        """The next matrix, None at the end."""
        while self._at < len(self._lines) and not self._lines[self._at].strip():
            self._at += 1
        if self._at == len(self._lines):
            return None
        line = self._next()
        columns, rows, form, kind = (self._whole(line, k) for k in range(4))
        text = line.rstrip()
        header = Header(printable(text[32:40]) or "?", columns, rows, form, kind)
        shown = text[40:].strip().upper()
        if shown:
            found = _FORMAT.fullmatch(shown)
            if not found or not 1 <= int(found[1]) <= 99 or not 5 <= int(found[2]) <= 99:
                self._refuse("must end in how numbers are written, as 5E16.9 or 1P,3E23.16")
            header.per_line, header.width = int(found[1]), int(found[2])
        wrong = _problem(header)
        if wrong:
            self._refuse(wrong)
        return header

    def columns(self, header: Header) -> EntryRuns:
        """All columns of the matrix whose header has just been taken."""
        entries = EntryRuns()
        self._numbers = []
        words = 2 if header.kind in (2, 4) else 1
        last = 0
        while True:
            line = self._next()
            column, row, length = (self._whole(line, k) for k in range(3))
            if not last < column <= header.columns + 1 or length < 0 or row < 0:
                self._refuse(f"must begin a column: its number, {last + 1} to {header.columns + 1}, first row, length")
            last = column
            if column > header.columns:
                self._at += self._at < len(self._lines)  # a number without meaning
                return entries
            if row:
                self._run(header, entries, row, column, length)
                continue
            while length > 0:
                line = self._next()
                if header.large:
                    size, row = self._whole(line, 0) - 1, self._whole(line, 1)
                    length -= size + 2
                else:
                    code = self._whole_of(line)
                    size, row = (code >> 16) - 1, code & 0xFFFF
                    length -= size + 1
                if size < 1 or size % words or length < 0:
                    self._refuse("must begin a string of entries: its length and first row do not fit")
                self._run(header, entries, row, column, size // words)

    def values(self, header: Header, entries: EntryRuns) -> tuple[IntArray, IntArray, Any]:
        """Row and column from 0 and value of each entry (k,), real or complex."""
        rows, columns, offsets = entries.spread(header.parts)
        values = np.array(self._numbers)
        return rows, columns, values[offsets] + 1j * values[offsets + 1] if header.parts == 2 else values[offsets]

    def _run(self, header: Header, entries: EntryRuns, row: int, column: int, count: int) -> None:
        """Entries below one another; count: of numbers."""
        if count < 1 or count % header.parts or row < 1 or row - 1 + count // header.parts > abs(header.rows):
            self._refuse(f"leaves the matrix: it has {abs(header.rows)} rows")
        entries.add(row - 1, column - 1, len(self._numbers), count // header.parts)
        width = header.width
        while count > 0:
            line = self._next()
            here = min(count, header.per_line)
            cells = [line[k * width : (k + 1) * width] for k in range(here)]
            values = [fortran_number(cell) for cell in cells]
            wanted = f"must hold {counted(here, 'number', 'numbers')} of {width} characters"
            if wrong := [cell for cell, value in zip(cells, values, strict=True) if not math.isfinite(value)]:
                self._refuse(f"{wanted}; {wrong[0]!r} is no finite number")
            if line[here * width :].strip():
                self._refuse(f"{wanted}; there is more in it")
            self._numbers += values
            count -= here

    def _next(self) -> str:
        last = len(self._lines) - 1
        if self._at > last or (self._at == last and not self._lines[last].strip()):
            self._source.refuse(f"ends in the middle of a matrix, at line {len(self._lines)}")
        self._at += 1
        return self._lines[self._at - 1]

    def _whole(self, line: str, at: int) -> int:
        return self._whole_of(line[8 * at : 8 * at + 8])

    def _whole_of(self, text: str) -> int:
        value = whole_number(text, lowest=-(10**18))
        if value is None:
            self._refuse(f"{printable(text)!r} is no whole number; integers must fill fields of 8")
        return value

    def _refuse(self, accepted: str) -> NoReturn:
        self._source.refuse_line(self._at, self._lines[self._at - 1], accepted)


class Binary:
    """The same for a file of Fortran records: each between two words that say its length in bytes."""

    def __init__(self, source: MatrixFile, data: bytes) -> None:
        self._source, self._data = source, data
        self._order = "<" if data[0] else ">"
        self._at = 0
        length = struct.unpack_from(self._order + "i", data)[0]
        # Nastran with words of 64 bits writes all integers and reals so; marks of records stay at 32.
        self._word = 8 if length == 48 else 4
        self._integer = "q" if self._word == 8 else "i"
        self._three = struct.Struct(f"{self._order}3{self._integer}")
        self._two = struct.Struct(f"{self._order}2{self._integer}")
        self._one = struct.Struct(f"{self._order}{self._integer}")

    def header(self) -> Header | None:
        """The next matrix, None at the end."""
        if self._at == len(self._data):
            return None
        begin, end = self._record()
        if end - begin != 6 * self._word:
            self._refuse(begin, f"must be a header of {6 * self._word} bytes; the record has {end - begin}")
        numbers = struct.unpack_from(f"{self._order}4{self._integer}", self._data, begin)
        name = printable(self._data[begin + 4 * self._word : end].replace(b"\0", b" ")) or "?"
        header = Header(name, numbers[0], numbers[1], numbers[2], numbers[3])
        if wrong := _problem(header):
            self._refuse(begin, wrong)
        return header

    def columns(self, header: Header) -> EntryRuns:
        """All columns of the matrix whose header has just been taken."""
        entries = EntryRuns()
        word = self._word
        words = 2 if header.kind in (2, 4) and word == 4 else 1
        step = words * header.parts
        last, rows = 0, abs(header.rows)
        while True:
            begin, end = self._record()
            if end - begin < 3 * word:
                self._refuse(begin, "is too short to begin a column")
            column, row, length = self._three.unpack_from(self._data, begin)
            at = begin + 3 * word
            if not last < column <= header.columns + 1:
                self._refuse(begin, f"must begin column {last + 1} to {header.columns + 1}; it says {column}")
            last = column
            if column > header.columns:
                return entries
            if length < 0 or row < 0 or at + length * word > end:
                self._refuse(begin, f"is of {end - begin} bytes, too short for the {length} words it announces")
            if row:
                if length % step or row - 1 + length // step > rows:
                    self._refuse(begin, f"leaves the matrix: it has {rows} rows")
                entries.add(row - 1, column - 1, at, length // step)
                continue
            stop = at + length * word
            while at < stop:
                if header.large:
                    if at + 2 * word > stop:
                        self._refuse(begin, "ends in the middle of a string of entries")
                    size, row = self._two.unpack_from(self._data, at)
                    size -= 1
                    at += 2 * word
                else:
                    code = self._one.unpack_from(self._data, at)[0]
                    size, row = (code >> 16) - 1, code & 0xFFFF
                    at += word
                if size < 1 or size % step or at + size * word > stop:
                    self._refuse(begin, "holds a string of entries whose length does not fit")
                if row < 1 or row - 1 + size // step > rows:
                    self._refuse(begin, f"leaves the matrix: it has {rows} rows")
                entries.add(row - 1, column - 1, at, size // step)
                at += size * word

    def values(self, header: Header, entries: EntryRuns) -> tuple[IntArray, IntArray, Any]:
        """Row and column from 0 and value of each entry (k,), real or complex."""
        size = 8 if self._word == 8 or header.kind in (2, 4) else 4
        kind = f"{self._order}f{size}"
        rows, columns, offsets = entries.spread(size * header.parts)
        values: Any = self._numbers(offsets, kind, size)
        if header.parts == 2:
            values = values + 1j * self._numbers(offsets + size, kind, size)
        return rows, columns, values

    def _numbers(self, offsets: IntArray, kind: str, size: int) -> Array:
        """Numbers that begin at these bytes: words need not lie at multiples of their size."""
        words = np.frombuffer(self._data, dtype=np.uint8, count=len(self._data) // 4 * 4).view(np.uint32)
        # Every record and every word is a multiple of 4 bytes long, so is where it begins.
        index = offsets // 4
        if size == 4:
            return words[index].view(kind).astype(np.float64)
        pairs = np.stack([words[index], words[index + 1]], axis=1)
        return pairs.view(kind)[:, 0].astype(np.float64)

    def _record(self) -> tuple[int, int]:
        """First byte and end of the next record's contents."""
        data, at = self._data, self._at
        if at + 4 > len(data):
            self._ends()
        length = struct.unpack_from(self._order + "i", data, at)[0]
        if length < 0 or length % 4:
            self._refuse(at, f"must begin a record with its length in bytes; {length} is none")
        if at + 8 + length > len(data):
            self._ends()
        if struct.unpack_from(self._order + "i", data, at + 4 + length)[0] != length:
            self._refuse(at, f"is no record: the length {length} at its beginning is not repeated at its end")
        self._at = at + 8 + length
        return at + 4, at + 4 + length

    def _ends(self) -> NoReturn:
        self._source.refuse(f"ends in the middle of a matrix, after {len(self._data)} bytes")

    def _refuse(self, at: int, accepted: str) -> NoReturn:
        raise CaseError(f"{self._source.path.name}, byte {at}", None, accepted)

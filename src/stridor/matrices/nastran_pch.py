"""Nastran matrices as DMIG cards, in punch files (.pch) or among other bulk data.

A header card says what a matrix is, a card for each column lists its entries as (grid, component, value, imaginary).
Small fields of 8, large fields of 16 (DMIG*) and fields between commas may be mixed; all other cards are passed over,
but for INCLUDE, which is refused: what it takes in may be columns. Bulk data end at ENDDATA.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn

import numpy as np

from .checks import chosen_in_any_case
from .entries import assembled, check_symmetric, mirrored, sides
from .model import Labels, StoredMatrix
from .nastran import LARGEST_GRID, REAL, SYMMETRIC, check_form, named
from .numbers import fortran_number, whole_number
from .source import Doubt, MatrixFile, printable, source_at, unended

_CARD = re.compile(r"[A-Z][A-Z0-9]*\s*\*?", re.IGNORECASE)  # the first field of one
_END = re.compile(r"\s*ENDDATA\b", re.IGNORECASE)
_FOREIGN = (
    "is no card, no comment ($) and no continuation, and a column goes on behind it; take the line out, or put a $ "
    "before it"
)
_INCLUDE = re.compile(r"\s*INCLUDE\b\s*[='\"\w./\\]", re.IGNORECASE)
_FIRST_ENTRY = 4  # name, grid and component of the column, nothing
_ACCEPTED = (1, SYMMETRIC)
_FORMS = {2: "rectangular", 9: "rectangular"}


@dataclass
class _Card:
    """A card: the fields after its keyword; for each of its lines: index of its first field, number, text."""

    keyword: str
    fields: list[str] = field(default_factory=list)
    lines: list[tuple[int, int, str]] = field(default_factory=list)

    def line_of(self, index: int) -> tuple[int, str]:
        """Number and text of the line that holds a field."""
        number, text = self.lines[0][1:]
        for first, at, line in self.lines:
            if first <= index:
                number, text = at, line
        return number, text


@dataclass
class _Matrix:
    """What a header says, and what its columns have given so far: row, column as 8·grid + component, value."""

    name: str
    form: int
    kind: int
    wanted: bool = True
    rows: list[int] = field(default_factory=list)
    columns: list[int] = field(default_factory=list)
    values: list[complex] = field(default_factory=list)


def read(path: Path, name: str | None, where: str) -> StoredMatrix:
    """The matrix called ``name``, or the only square one, of a file's DMIG cards.

    Symmetric ones (IFO 6) are completed. Raises CaseError at `where`, or at "FILE, line N" for a line that is wrong.
    """
    source = source_at(path, where)
    data = source.text()
    matrices: dict[str, _Matrix] = {}
    for card in _cards(source, data):
        _take(source, card, matrices, None if name is None else name.strip().upper())
    if not matrices:
        before = " before ENDDATA" if re.search(rb"^[ \t]*ENDDATA\b", data, re.IGNORECASE | re.MULTILINE) else ""
        source.refuse(f"holds no DMIG card{before}; ask Nastran for them with EXTSEOUT(…,DMIGPCH)")
    square = [m.name for m in matrices.values() if m.form in _ACCEPTED]
    everything = [m.name for m in matrices.values()]
    key = chosen_in_any_case(source, name, square if name is None and square else everything)
    return _stored(source.of(key), matrices[key.upper()], unended(data))


def _stored(source: MatrixFile, found: _Matrix, notes: tuple[str, ...]) -> StoredMatrix:
    check_form(source, found.form, _ACCEPTED, _FORMS)
    if not found.values:
        source.refuse("has no columns; is the file complete?")
    keys = np.array(found.rows + found.columns, dtype=np.int64)
    held, index = np.unique(keys, return_inverse=True)
    count = len(found.rows)
    matrix, more = assembled(
        source, index[:count], index[count:], np.array(found.values), (len(held), len(held))
    )
    notes += more
    if found.form == SYMMETRIC:
        both, alone = sides(matrix)
        check_symmetric(source, matrix, stored_only=True, says="form 6 (symmetric)", instead="form 1 (square)")
        if both and alone:
            note = Doubt(f"{both} entries stand on both sides of the diagonal, {alone} on one; these were mirrored.")
            notes = (*notes, note)
        matrix = mirrored(matrix)
    return named(source, matrix, Labels(held // 8, held % 8), found.form, found.kind, notes)


def _cards(source: MatrixFile, data: bytes) -> Iterator[_Card]:
    """DMIG cards, their continuation lines joined, up to ENDDATA."""
    card: _Card | None = None
    foreign: tuple[int, str] | None = None  # a line right behind a DMIG card that may have broken it off
    for number, raw in enumerate(data.decode("latin-1").split("\n"), 1):
        line = raw.partition("$")[0].rstrip()
        if not line.strip():
            continue
        if _END.match(line):
            break
        if _INCLUDE.match(line):
            source.refuse_line(number, raw, "INCLUDE, and files taken in are not read: bring all cards into one file")
        free = "," in line
        if not free and "\t" in line:
            line = line.expandtabs(8)
        head = (line.partition(",")[0] if free else line[:8]).strip()
        large = "*" in head
        width = 4 if large else 8
        if free:
            fields = [f.strip() for f in line.split(",")][1:]
            # A tenth field names the line that goes on.
            if len(fields) > width + 1:
                if head.upper().startswith("DMIG") or (card is not None and head[:1] in ("", "+", "*")):
                    source.refuse_line(number, raw, f"has more than {width} fields")
                fields = fields[:width]
            fields = fields[:width]
        else:
            step = 16 if large else 8
            fields = [line[k : k + step].strip() for k in range(8, 72, step)]
        fields += [""] * (width - len(fields))
        if not head or head[0] in "+*":
            if card is not None:
                card.lines.append((len(card.fields), number, raw))
                card.fields += fields
            elif foreign is not None:
                source.refuse_line(*foreign, _FOREIGN)
            continue
        if _CARD.fullmatch(head):
            foreign = None
        elif card is not None:
            foreign = number, raw
        if card is not None:
            yield card
        keyword = head.rstrip("* ").upper()
        card = _Card(keyword, fields, [(0, number, raw)]) if keyword == "DMIG" else None
    if card is not None:
        yield card


def _take(source: MatrixFile, card: _Card, matrices: dict[str, _Matrix], wanted: str | None) -> None:
    name = printable(card.fields[0])
    if not name:
        _refuse(source, card, 0, "DMIG needs a name")
    if card.fields[1] == "0":
        form, kind = (_whole(source, card, k, what) for k, what in ((2, "a form (IFO)"), (3, "a type (TIN)")))
        if kind not in (1, 2, 3, 4):
            _refuse(source, card, 3, f"type {kind} is not known; accepted: 1, 2 (real) and 3, 4 (complex)")
        if name.upper() in matrices:
            _refuse(source, card, 0, f"{name} has a header already; each matrix must have one")
        others = any(m.wanted for m in matrices.values())
        take = form in _ACCEPTED and (not others if wanted is None else name.upper() == wanted)
        matrices[name.upper()] = _Matrix(name, form, kind, take)
        return
    found = matrices.get(name.upper())
    if found is None:
        _refuse(source, card, 0, f"a column of {name} before its header: DMIG, {name}, 0, IFO, TIN, TOUT")
    if found.wanted:
        _take_column(source, card, found)


def _take_column(source: MatrixFile, card: _Card, found: _Matrix) -> None:
    fields = card.fields
    column = _freedom(source, card, 1)
    for at in range(_FIRST_ENTRY, len(fields), 4):
        if not (fields[at] or fields[at + 1] or fields[at + 2] or fields[at + 3]):
            continue
        found.rows.append(_freedom(source, card, at))
        found.columns.append(column)
        real, imaginary = _real(source, card, at + 2), _real(source, card, at + 3) if fields[at + 3] else 0.0
        if imaginary and found.kind in REAL:
            shown = f"{printable(fields[at + 3])!r} stands where an imaginary part would, but type {found.kind} is real"
            _refuse(source, card, at + 3, f"{shown}; do the fields begin in the right columns?")
        found.values.append(complex(real, imaginary))
    if len(fields) <= _FIRST_ENTRY:
        _refuse(source, card, 0, "the column has no entries; is a line missing?")


def _freedom(source: MatrixFile, card: _Card, at: int) -> int:
    """Number of a grid or scalar point and its component as one."""
    grid = _whole(source, card, at, "a grid or scalar point")
    component = _whole(source, card, at + 1, "a component") if card.fields[at + 1] else 0
    if not 0 < grid <= LARGEST_GRID:
        _refuse(source, card, at, f"{grid} is no grid or scalar point; they are numbered from 1")
    if component > 6:
        _refuse(source, card, at + 1, f"{component} is no component; must be 1 to 6, or 0 for a scalar point")
    return 8 * grid + component


def _whole(source: MatrixFile, card: _Card, at: int, what: str) -> int:
    value = whole_number(card.fields[at])
    if value is None:
        _refuse(source, card, at, f"{printable(card.fields[at])!r} is not {what}, a whole number")
    return value


def _real(source: MatrixFile, card: _Card, at: int) -> float:
    value = fortran_number(card.fields[at])
    if not math.isfinite(value):
        _refuse(source, card, at, f"{printable(card.fields[at])!r} is no finite number")
    return value


def _refuse(source: MatrixFile, card: _Card, at: int, accepted: str) -> NoReturn:
    number, text = card.line_of(at)
    source.refuse_line(number, text, accepted)

"""Nastran matrices as DMIG cards, in punch files (.pch) or among other bulk data.

A header card says what a matrix is, a card for each column lists its entries as (grid, component, value, imaginary).
Small fields of 8, large fields of 16 (DMIG*) and fields between commas may be mixed; all other cards are passed over.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn

import numpy as np

from ..errors import CaseError
from ..mesh.paths import shown_path
from ..typing import IntArray
from .model import Labels, StoredMatrix
from .program_files import (
    SAME,
    assembled,
    choose,
    completed,
    contents,
    disagreement,
    finished,
    fortran_number,
    printable,
    refuse_line,
    role_of,
    sides,
)

_FIRST_ENTRY = 4  # name, grid and component of the column, nothing
_WHOLE = re.compile(r"\d+")
_LARGEST_GRID = 2**31 - 1
_FORMS = {1: "square", 2: "rectangular", 6: "symmetric", 9: "rectangular"}


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
    values: list[float] = field(default_factory=list)
    imaginary: int = 0


def read(path: Path, name: str | None, where: str) -> StoredMatrix:
    """The matrix called ``name``, or the only square one, of a file's DMIG cards.

    Symmetric ones (IFO 6) are completed. Raises CaseError at `where`, or at "FILE, line N" for a line that is wrong.
    """
    data = contents(path, where)
    matrices: dict[str, _Matrix] = {}
    for card in _cards(path, data):
        _take(path, card, matrices, None if name is None else name.strip().upper())
    if not matrices:
        raise CaseError(where, shown_path(path), "holds no DMIG card; ask Nastran for them with EXTSEOUT(…,DMIGPCH)")
    square = [m.name for m in matrices.values() if m.form in (1, 6)]
    everything = [m.name for m in matrices.values()]
    found = matrices[choose(name, square if name is None and square else everything, path, where).upper()]
    if found.form not in (1, 6):
        kind = _FORMS.get(found.form, "not known")
        raise CaseError(
            where, found.name, f"has form {found.form} ({kind}); accepted: 1 (square) and 6 (symmetric)"
        )
    if found.imaginary:
        raise CaseError(
            where, found.name, f"is complex: {found.imaginary} entries have an imaginary part; only real ones are read"
        )
    if not found.values:
        raise CaseError(where, found.name, "has no columns; is the file complete?")
    return _stored(found, path, where)


def _stored(found: _Matrix, path: Path, where: str) -> StoredMatrix:
    keys = np.array(found.rows + found.columns, dtype=np.int64)
    held, inverse = np.unique(keys, return_inverse=True)
    index: IntArray = inverse
    count = len(found.rows)
    matrix, repeated = assembled(index[:count], index[count:], np.array(found.values), len(held))
    notes: list[str] = []
    if repeated:
        notes.append(f"{repeated} entries stand more than once in the file; they have been added up.")
    if found.form == 6:
        both, alone = sides(matrix)
        if both and (worst := disagreement(matrix, stored_only=True)) > SAME:
            raise CaseError(
                where, found.name,
                f"has form 6 (symmetric), but entries (i, j) and (j, i) differ by up to {worst:.1e} of the largest "
                "in their rows; for a matrix that is not symmetric the header must say form 1",
            )
        if both and alone:
            notes.append(f"{both} entries stand on both sides of the diagonal, {alone} on one; these were mirrored.")
        matrix = completed(matrix)
    if found.kind in (3, 4):
        notes.append("The matrix is stored as complex numbers; all imaginary parts are 0.")
    return StoredMatrix(
        finished(matrix, path, where),
        path.name,
        Labels(held // 8, held % 8),
        role_of(found.name),
        "symmetric" if found.form == 6 else "general",
        found.name,
        tuple(notes),
    )


def _cards(path: Path, data: bytes) -> Iterator[_Card]:
    """DMIG cards, their continuation lines joined."""
    card: _Card | None = None
    for number, raw in enumerate(data.decode("latin-1").split("\n"), 1):
        line = raw.partition("$")[0].rstrip()
        if not line.strip():
            continue
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
                if head.startswith("DMIG") or (card is not None and head[:1] in ("", "+", "*")):
                    refuse_line(path, number, printable(raw.encode("latin-1")), f"has more than {width} fields")
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
            continue
        if card is not None:
            yield card
        keyword = head.rstrip("* ").upper()
        card = _Card(keyword, fields, [(0, number, raw)]) if keyword == "DMIG" else None
    if card is not None:
        yield card


def _take(path: Path, card: _Card, matrices: dict[str, _Matrix], wanted: str | None) -> None:
    name = printable(card.fields[0].encode("latin-1"))
    if not name:
        _refuse(path, card, 0, "DMIG needs a name")
    if card.fields[1] == "0":
        form, kind = (_whole(path, card, k, what) for k, what in ((2, "a form (IFO)"), (3, "a type (TIN)")))
        if kind not in (1, 2, 3, 4):
            _refuse(path, card, 3, f"type {kind} is not known; accepted: 1, 2 (real) and 3, 4 (complex)")
        if name.upper() in matrices:
            _refuse(path, card, 0, f"{name} has a header already; each matrix must have one")
        others = any(m.wanted for m in matrices.values())
        take = form in (1, 6) and (not others if wanted is None else name.upper() == wanted)
        matrices[name.upper()] = _Matrix(name, form, kind, take)
        return
    found = matrices.get(name.upper())
    if found is None:
        _refuse(path, card, 0, f"a column of {name} before its header: DMIG, {name}, 0, IFO, TIN, TOUT")
    if found.wanted:
        _take_column(path, card, found)


def _take_column(path: Path, card: _Card, found: _Matrix) -> None:
    fields = card.fields
    column = _freedom(path, card, 1)
    complex_kind = found.kind in (3, 4)
    for at in range(_FIRST_ENTRY, len(fields), 4):
        if not (fields[at] or fields[at + 1] or fields[at + 2] or fields[at + 3]):
            continue
        found.rows.append(_freedom(path, card, at))
        found.columns.append(column)
        found.values.append(_real(path, card, at + 2))
        if fields[at + 3]:
            imaginary = _real(path, card, at + 3)
            found.imaginary += complex_kind and imaginary != 0.0
    if len(fields) <= _FIRST_ENTRY:
        _refuse(path, card, 0, "the column has no entries; is a line missing?")


def _freedom(path: Path, card: _Card, at: int) -> int:
    """Number of a grid or scalar point and its component as one."""
    grid = _whole(path, card, at, "a grid or scalar point")
    component = _whole(path, card, at + 1, "a component") if card.fields[at + 1] else 0
    if not 0 < grid <= _LARGEST_GRID:
        _refuse(path, card, at, f"{grid} is no grid or scalar point; they are numbered from 1")
    if component > 6:
        _refuse(path, card, at + 1, f"{component} is no component; must be 1 to 6, or 0 for a scalar point")
    return 8 * grid + component


def _whole(path: Path, card: _Card, at: int, what: str) -> int:
    text = card.fields[at]
    if len(text) <= 16 and _WHOLE.fullmatch(text) and text.isascii():
        return int(text)
    _refuse(path, card, at, f"{printable(text.encode('latin-1'))!r} is not {what}, a whole number")


def _real(path: Path, card: _Card, at: int) -> float:
    text = card.fields[at]
    value = fortran_number(text)
    if math.isfinite(value):
        return value
    _refuse(path, card, at, f"{printable(text.encode('latin-1'))!r} is no finite number")


def _refuse(path: Path, card: _Card, at: int, accepted: str) -> NoReturn:
    number, text = card.line_of(at)
    refuse_line(path, number, printable(text.encode("latin-1")), accepted)

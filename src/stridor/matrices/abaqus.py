"""Abaqus matrices as text: what *MATRIX GENERATE and *MATRIX OUTPUT write to JOB_STIF1.mtx and its like.

FORMAT=MATRIX INPUT and FORMAT=LABELS name each entry by row node, row freedom, column node, column freedom;
FORMAT=COORDINATE by row and column. Nodes that Abaqus has made itself, for multipliers, have negative numbers.
"""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, NoReturn

import numpy as np

from ..typing import Array, IntArray, Sparse
from .checks import chosen_in_any_case, nameless
from .entries import assembled, check_symmetric, mirrored, sides
from .model import Labels, Role, StoredMatrix
from .numbers import fortran_number
from .source import Doubt, MatrixFile, counted, printable, source_at, unended

# Where *BOUNDARY holds a freedom Abaqus writes 1e36 on the diagonal of the stiffness. A factor may have made that
# smaller, but no stiffness is as large as this.
HELD = 1e30
_CHUNK = 1 << 23
# A keyword's line goes on behind a comma at its end, a comment's does not.
_KEYWORD_LINE = re.compile(rb"^[ \t]*\*(?:\*.*|(?:[^*\n][^\n]*,[ \t\r]*\n)*[^\n]*)$", re.MULTILINE)
# JOB_STIF1; what follows is looked at only, for in JOB = pad_mass the kind before it shares its "_".
_KIND = re.compile(r"(?:^|_)(STIF|MASS|DMPV|DMPS|LOAD)\d*(?=_|$)")
_TO_BLANKS = bytes.maketrans(b",\rDd", b"  EE")
_LARGEST_NODE = 2**31 - 1
_LARGEST_FREEDOM = 999
_MEANING = {
    5: "row node, row freedom, column node, column freedom, value",
    3: "row, column, value",
}
_ROLES: Mapping[str, Role] = {"STIF": "stiffness", "MASS": "mass", "DMPV": "damping"}


@dataclass
class _Section:
    """Lines of one matrix: options of its *MATRIX line, by name in capitals, and spans (start, end) of its bytes."""

    options: Mapping[str, str] | None = None
    spans: list[tuple[int, int]] = field(default_factory=list)

    @property
    def name(self) -> str:
        return (self.options or {}).get("NAME", "")


def read(path: Path, name: str | None, where: str) -> StoredMatrix:
    """The matrix in an .mtx file of Abaqus (or .mtx.gz). name: that of a *MATRIX INPUT line, needed for several.

    A file of which only one half is there is completed, unless its header says TYPE=UNSYMMETRIC. Raises CaseError at
    `where`, or at "FILE, line N" for a line that is wrong.
    """
    source = source_at(path, where)
    data = source.text()
    role = _role(source)
    section = _chosen(_sections(source, data), name, source)
    source = source.of(section.name)
    table, width = _table(source, data, section.spans)
    if table is None:
        elsewhere = section.options and section.options.get("INPUT")
        mend = f"they are in {elsewhere}: give that file" if elsewhere else f"each line must hold: {_MEANING[5]}"
        source.refuse(f"holds no entries; {mend}")
    with np.errstate(over="ignore"):  # found below
        values = _scale(section, source) * table[:, -1]
    labels: Labels | None = None
    if width == 5:
        rows, columns, labels = _numbered(table)
        size = len(labels.node)
    else:
        rows, columns = (table[:, k].astype(np.int64) - 1 for k in range(2))
        size = int(max(rows.max(), columns.max())) + 1
    matrix, notes = assembled(source, rows, columns, values, (size, size))
    matrix, form, more = _formed(matrix, section, rows, columns, source)
    notes += more
    held = int(np.sum(matrix.diagonal() >= HELD))
    if held:
        many = counted(held, "freedom has", "freedoms have")
        notes += (f"{many} 1e36 on the diagonal: Abaqus' mark of *BOUNDARY; they are held.",)
    return StoredMatrix(
        matrix, path.name, labels, role, form, section.name or None, notes + unended(data), "Abaqus",
        _type(section) == "UNSYMMETRIC",
    )  # fmt: skip


def _type(section: _Section) -> str | None:
    """What the header says of symmetry, None where there is no header."""
    return None if section.options is None else section.options.get("TYPE", "SYMMETRIC").upper()


def _role(source: MatrixFile) -> Role | None:
    """What the name of the file says, its last word that names a kind, for the job's name stands before it. Raises
    CaseError for what is no matrix of M, C or K."""
    found = _KIND.findall(source.path.name.upper().split(".")[0])
    kind = found[-1] if found else ""
    if kind == "DMPS":
        source.refuse(
            "is structural (hysteretic) damping, which no real matrix of velocities is; give viscous damping instead: "
            "JOB_DMPV1.mtx, or an equivalent C = structural damping matrix / ω at the frequency of interest",
        )
    if kind == "LOAD":
        source.refuse("holds loads, no matrix; accepted: _STIF1, _MASS1, _DMPV1.mtx")
    return _ROLES.get(kind)


def _sections(source: MatrixFile, data: bytes) -> list[_Section]:
    """What stands between keyword lines; comments (**) are left out."""
    found = [_Section()]
    start = 0
    for match in _KEYWORD_LINE.finditer(data):
        found[-1].spans.append((start, match.start()))
        start = match.end()
        text = " ".join(printable(match.group().replace(b"\n", b" ").replace(b"\r", b" ")).split())
        if text.startswith("**"):
            continue
        keyword, *parts = (part.strip() for part in text[1:].split(","))
        options = {k.strip().upper(): v.strip(' "') for k, _, v in (p.partition("=") for p in parts) if k.strip()}
        keyword = keyword.upper()
        if keyword == "MATRIX ASSEMBLE":
            continue
        number = data.count(b"\n", 0, match.start()) + 1
        if keyword not in ("MATRIX INPUT", "MATRIX") or options.get("TYPE", "").upper() in ("STIFFNESS", "MASS"):
            _refuse_keyword(source, number, text, keyword)
        if not all(key[0].isalpha() for key in options):
            source.refuse_line(number, text, "a comma at its end makes the line behind it a part of it; take it away")
        found.append(_Section(options))
    found[-1].spans.append((start, len(data)))
    if len(found) > 1 and not any(data[a:b].strip() for a, b in found[0].spans):
        del found[0]
    return found


def _refuse_keyword(source: MatrixFile, number: int, text: str, keyword: str) -> NoReturn:
    if keyword == "CLOAD":
        source.refuse_line(number, text, "the file holds loads, no matrix")
    if keyword in ("USER ELEMENT", "MATRIX"):
        source.refuse_line(
            number, text,
            "matrices of a substructure are not read; write them with *MATRIX GENERATE and *MATRIX OUTPUT",
        )
    source.refuse_line(number, text, "only *MATRIX INPUT and comments (**) may stand between lines of a matrix")


def _chosen(sections: list[_Section], name: str | None, source: MatrixFile) -> _Section:
    names = [s.name or f"matrix {k}" for k, s in enumerate(sections, 1)]
    if len(sections) == 1 and (name is None or not sections[0].name):
        nameless(source, name)
        return sections[0]
    return sections[names.index(chosen_in_any_case(source, name, names))]


def _scale(section: _Section, source: MatrixFile) -> float:
    given = (section.options or {}).get("SCALE FACTOR", (section.options or {}).get("SCALEFACTOR", "1"))
    value = fortran_number(given)
    if value == 0.0 or not math.isfinite(value):
        source.refuse(f"SCALE FACTOR={given} is no finite number other than 0")
    return value


def _formed(
    matrix: Sparse, section: _Section, rows: IntArray, columns: IntArray, source: MatrixFile
) -> tuple[Sparse, Literal["symmetric", "general"], tuple[str, ...]]:
    """The whole matrix, whether it is "symmetric" or "general", and notes: as its header says, else as its entries
    show."""
    given = _type(section)
    if given not in (None, "SYMMETRIC", "UNSYMMETRIC"):
        source.refuse(f"TYPE={given} is not known; accepted: SYMMETRIC, UNSYMMETRIC")
    both, alone = sides(matrix)
    if given == "UNSYMMETRIC" or (given is None and both):
        return matrix, "general", ()
    if given == "SYMMETRIC":
        check_symmetric(source, matrix, stored_only=True, says="TYPE=SYMMETRIC", instead="TYPE=UNSYMMETRIC")
    note = ""
    if given is None and alone:
        note = (
            "No entry has a counterpart across the diagonal: taken as one half of a symmetric matrix and completed."
            if _one_triangle(rows, columns)
            else Doubt(
                "Entries stand on both sides of the diagonal, but none has a counterpart: taken as half of a "
                "symmetric matrix and completed. If it is not symmetric, put *MATRIX INPUT, NAME=A, TYPE=UNSYMMETRIC "
                "before its lines."
            )
        )
    return mirrored(matrix), "symmetric", ((note,) if note else ())


def _one_triangle(rows: IntArray, columns: IntArray) -> bool:
    """Whether all entries are on one side of the diagonal, by number or in the order in which columns come."""
    if np.all(rows >= columns) or np.all(rows <= columns):
        return True
    for first, second in ((columns, rows), (rows, columns)):
        held, at = np.unique(first, return_index=True)
        order = np.full(int(max(rows.max(), columns.max())) + 1, len(first))
        order[held] = at
        if np.all(order[second] >= order[first]):
            return True
    return False


def _numbered(table: Array) -> tuple[IntArray, IntArray, Labels]:
    """Rows (k,) and columns (k,) counted from 0, and labels: nodes in ascending order, then those of Abaqus' own."""
    node = np.concatenate([table[:, 0], table[:, 2]]).astype(np.int64)
    direction = np.concatenate([table[:, 1], table[:, 3]]).astype(np.int64)
    # -1, -2, … come after all others.
    order = np.where(node >= 0, node, _LARGEST_NODE - node)
    stride = _LARGEST_FREEDOM + 1
    held, at, index = np.unique(order * stride + direction, return_index=True, return_inverse=True)
    del held
    count = len(table)
    return index[:count], index[count:], Labels(node[at], direction[at])


def _table(source: MatrixFile, data: bytes, spans: list[tuple[int, int]]) -> tuple[Array | None, int]:
    """All lines (k, 5) or (k, 3), and which."""
    width = 0
    held: list[Array] = []
    for first, last in spans:
        start = first
        while start < last:
            end = min(start + _CHUNK, last)
            if end < last:
                end = data.find(b"\n", end, last) + 1 or last
            text = data[start:end]
            if not width and (line := text.lstrip()):
                width = len(line.splitlines()[0].replace(b",", b" ").split())
                if width not in _MEANING:
                    _refuse_width(source, data, end - len(line), line.splitlines()[0], width)
            if text.strip():
                found = _fast(text, width)
                held.append(_slow(source, data, start, text, width) if found is None else found)
            start = end
    return (np.concatenate(held) if held else None), width


def _refuse_width(source: MatrixFile, data: bytes, at: int, line: bytes, width: int) -> NoReturn:
    number = data.count(b"\n", 0, at) + 1
    words = printable(line).replace(",", " ").split()
    if width in (4, 6) and all(math.isfinite(fortran_number(word)) for word in words):
        source.refuse_line(
            number, line,
            f"has {width} values, as element matrices have; write the assembled matrix, without ELEMENT BY ELEMENT",
        )
    source.refuse_line(number, line, f"each line must hold: {_MEANING[5]} (or {_MEANING[3]})")


def _fast(text: bytes, width: int) -> Array | None:
    """The numbers (k, width) of whole lines at once, or None where any line is not as it should be."""
    raw = text.translate(_TO_BLANKS) + b"\n"
    codes = np.frombuffer(raw, np.uint8)
    filled = codes > 32
    begins = filled.copy()
    begins[1:] &= ~filled[:-1]
    counts = np.diff(np.cumsum(begins, dtype=np.int32)[codes == 10], prepend=0)
    if not np.all((counts == 0) | (counts == width)):
        return None
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            values = np.fromstring(raw, dtype=np.float64, sep=" ")
        except (DeprecationWarning, ValueError):
            return None
    if len(values) != counts.sum() or not np.isfinite(values).all():
        return None
    table = values.reshape(-1, width)
    whole = table[:, :-1]
    lowest, highest = _limits(width)
    good = np.all(whole == np.rint(whole)) and np.all(whole >= lowest) and np.all(whole <= highest)
    return table if good else None


def _limits(width: int) -> tuple[Array, Array]:
    if width == 3:
        return np.array([1.0, 1.0]), np.full(2, 2.0**53)
    low = np.array([-_LARGEST_NODE, 0.0] * 2)
    return low, np.array([_LARGEST_NODE, _LARGEST_FREEDOM] * 2, dtype=float)


def _slow(source: MatrixFile, data: bytes, start: int, text: bytes, width: int) -> Array:
    """The same, line by line, for the sake of the line that is wrong. Raises CaseError."""
    lowest, highest = _limits(width)
    table: list[list[float]] = []
    for number, raw in enumerate(text.split(b"\n"), data.count(b"\n", 0, start) + 1):
        line = printable(raw)
        fields = line.replace(",", " ").split()
        if not fields:
            continue
        if len(fields) != width:
            source.refuse_line(number, line, f"has {len(fields)} values; must have {width}: {_MEANING[width]}")
        row: list[float] = []
        for k, part in enumerate(fields):
            value = fortran_number(part)
            if not math.isfinite(value):
                source.refuse_line(number, line, f"{part!r} is no finite number")
            if k < width - 1 and (value != int(value) or not lowest[k] <= value <= highest[k]):
                what = "row or column number, from 1" if width == 3 else ("node", "freedom number")[k % 2]
                source.refuse_line(number, line, f"{part} is no {what}; each line must hold: {_MEANING[width]}")
            row.append(value)
        table.append(row)
    return np.array(table, dtype=np.float64).reshape(-1, width)

"""Abaqus matrices as text: what *MATRIX GENERATE and *MATRIX OUTPUT write to JOB_STIF1.mtx and its like.

FORMAT=MATRIX INPUT and FORMAT=LABELS name each entry by row node, row freedom, column node, column freedom;
FORMAT=COORDINATE by row and column. Nodes that Abaqus has made itself, for multipliers, have negative numbers.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, NoReturn

import numpy as np

from ..errors import CaseError
from ..mesh.paths import shown_path
from ..typing import Array, IntArray, Sparse
from .model import Labels, Role, StoredMatrix
from .program_files import (
    SAME,
    assembled,
    check_size,
    choose,
    completed,
    contents,
    disagreement,
    finished,
    printable,
    refuse_line,
    sides,
)

# What Abaqus writes on the diagonal of the stiffness where *BOUNDARY holds a freedom.
HELD = 1e36
_CHUNK = 1 << 23
_KEYWORD_LINE = re.compile(rb"^[ \t]*\*.*$", re.MULTILINE)
_KIND = re.compile(r"(?:^|_)(STIF|MASS|DMPV|DMPS|LOAD)\d*(?:_|$)")
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[EeDd][+-]?\d+)?")
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
    data = contents(path, where)
    role = _role(path, where)
    section = _chosen(_sections(path, data, where), name, path, where)
    table, width = _table(path, data, section.spans)
    if table is None:
        raise CaseError(where, shown_path(path), f"holds no entries; each line must hold: {_MEANING[5]}")
    scale = _scale(section, path, where)
    labels: Labels | None = None
    if width == 5:
        rows, columns, labels = _numbered(table)
        size = len(labels.node)
    else:
        rows, columns = (table[:, k].astype(np.int64) - 1 for k in range(2))
        size = int(max(rows.max(), columns.max())) + 1
        check_size(size, path, where, len(data))
    matrix, repeated = assembled(rows, columns, scale * table[:, -1], size)
    notes: list[str] = []
    if repeated:
        notes.append(f"{repeated} entries stand more than once in the file; they have been added up.")
    matrix, form = _formed(matrix, section, rows, columns, path, where, notes)
    matrix = finished(matrix, path, where)
    held = int(np.sum(matrix.diagonal() >= 0.999 * HELD))
    if held:
        notes.append(f"{held} freedoms have 1e36 on the diagonal: Abaqus' mark of *BOUNDARY; leave them out.")
    if not data.endswith(b"\n"):
        notes.append("The last line has no line end: if the file was cut off there, its last number is wrong.")
    return StoredMatrix(matrix, path.name, labels, role, form, section.name or None, tuple(notes))


def _role(path: Path, where: str) -> Role | None:
    """What the name of the file says. Raises CaseError for what is no matrix of M, C or K."""
    found = _KIND.findall(path.name.upper().split(".")[0])
    kind = found[-1] if found else ""
    if kind == "DMPS":
        raise CaseError(
            where,
            shown_path(path),
            "is structural (hysteretic) damping, which no real matrix of velocities is; give viscous damping instead: "
            "JOB_DMPV1.mtx, or an equivalent C = structural damping matrix / ω at the frequency of interest",
        )
    if kind == "LOAD":
        raise CaseError(where, shown_path(path), "holds loads, no matrix; accepted: _STIF1, _MASS1, _DMPV1.mtx")
    return _ROLES.get(kind)


def _sections(path: Path, data: bytes, where: str) -> list[_Section]:
    """What stands between keyword lines; comments (**) are left out."""
    found = [_Section()]
    start = 0
    for match in _KEYWORD_LINE.finditer(data):
        found[-1].spans.append((start, match.start()))
        start = match.end()
        text = match.group().strip()
        if text.startswith(b"**"):
            continue
        parts = [p.strip() for p in printable(text[1:]).split(",")]
        keyword = parts[0].upper()
        options = {k.strip().upper(): v.strip() for k, _, v in (p.partition("=") for p in parts[1:]) if k.strip()}
        if keyword == "MATRIX ASSEMBLE":
            continue
        number = data.count(b"\n", 0, match.start()) + 1
        if keyword not in ("MATRIX INPUT", "MATRIX") or options.get("TYPE", "").upper() in ("STIFFNESS", "MASS"):
            _refuse_keyword(path, number, printable(text), keyword)
        found.append(_Section(options))
    found[-1].spans.append((start, len(data)))
    if len(found) > 1 and not any(data[a:b].strip() for a, b in found[0].spans):
        del found[0]
    return found


def _refuse_keyword(path: Path, number: int, text: str, keyword: str) -> NoReturn:
    if keyword == "CLOAD":
        refuse_line(path, number, text, "the file holds loads, no matrix")
    if keyword in ("USER ELEMENT", "MATRIX"):
        refuse_line(
            path, number, text,
            "matrices of a substructure are not read; write them with *MATRIX GENERATE and *MATRIX OUTPUT",
        )
    refuse_line(path, number, text, "only *MATRIX INPUT and comments (**) may stand between lines of a matrix")


def _chosen(sections: list[_Section], name: str | None, path: Path, where: str) -> _Section:
    names = [s.name or f"matrix {k}" for k, s in enumerate(sections, 1)]
    if len(sections) == 1 and (name is None or not sections[0].name):
        if name is not None:
            raise CaseError(where, name, f"{path.name} holds one matrix, and that has no name; give none")
        return sections[0]
    return sections[names.index(choose(name, names, path, where))]


def _scale(section: _Section, path: Path, where: str) -> float:
    given = (section.options or {}).get("SCALE FACTOR", (section.options or {}).get("SCALEFACTOR", "1"))
    value = float(given.upper().replace("D", "E")) if _NUMBER.fullmatch(given) else 0.0
    if value == 0.0 or not np.isfinite(value):
        raise CaseError(where, shown_path(path), f"SCALE FACTOR={given} is no finite number other than 0")
    return value


def _formed(
    matrix: Sparse, section: _Section, rows: IntArray, columns: IntArray, path: Path, where: str, notes: list[str]
) -> tuple[Sparse, Literal["symmetric", "general"]]:
    """The whole matrix, and whether it is "symmetric" or "general": as its header says, else as its entries show."""
    given = None if section.options is None else section.options.get("TYPE", "SYMMETRIC").upper()
    if given not in (None, "SYMMETRIC", "UNSYMMETRIC"):
        raise CaseError(where, shown_path(path), f"TYPE={given} is not known; accepted: SYMMETRIC, UNSYMMETRIC")
    both, alone = sides(matrix)
    if given == "UNSYMMETRIC" or (given is None and both):
        return matrix, "general"
    if given == "SYMMETRIC" and both and (worst := disagreement(matrix, stored_only=True)) > SAME:
        raise CaseError(
            where, shown_path(path),
            f"TYPE=SYMMETRIC, but entries (i, j) and (j, i) differ by up to {worst:.1e} of the largest in their rows; "
            "for a matrix that is not symmetric the header must say TYPE=UNSYMMETRIC",
        )
    if given is None and alone:
        notes.append(
            "No entry has a counterpart across the diagonal: taken as one half of a symmetric matrix and completed."
            if _one_triangle(rows, columns)
            else "Entries stand on both sides of the diagonal, but none has a counterpart: taken as half of a "
            "symmetric matrix and completed. If it is not symmetric, put *MATRIX INPUT, NAME=A, TYPE=UNSYMMETRIC "
            "before its lines."
        )
    return completed(matrix), "symmetric"


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


def _table(path: Path, data: bytes, spans: list[tuple[int, int]]) -> tuple[Array | None, int]:
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
                    _refuse_width(path, data, end - len(line), line.splitlines()[0], width)
            if text.strip():
                found = _fast(text, width)
                held.append(_slow(path, data, start, text, width) if found is None else found)
            start = end
    return (np.concatenate(held) if held else None), width


def _refuse_width(path: Path, data: bytes, at: int, line: bytes, width: int) -> NoReturn:
    number = data.count(b"\n", 0, at) + 1
    if width in (4, 6) and all(_NUMBER.fullmatch(f) for f in printable(line).replace(",", " ").split()):
        refuse_line(
            path, number, printable(line),
            f"has {width} values, as element matrices have; write the assembled matrix, without ELEMENT BY ELEMENT",
        )
    refuse_line(path, number, printable(line), f"each line must hold: {_MEANING[5]} (or {_MEANING[3]})")


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


def _slow(path: Path, data: bytes, start: int, text: bytes, width: int) -> Array:
    """The same, line by line, for the sake of the line that is wrong. Raises CaseError."""
    lowest, highest = _limits(width)
    table: list[list[float]] = []
    for number, raw in enumerate(text.split(b"\n"), data.count(b"\n", 0, start) + 1):
        line = printable(raw)
        fields = line.replace(",", " ").split()
        if not fields:
            continue
        if len(fields) != width:
            refuse_line(path, number, line, f"has {len(fields)} values; must have {width}: {_MEANING[width]}")
        row: list[float] = []
        for k, part in enumerate(fields):
            value = float(part.upper().replace("D", "E")) if _NUMBER.fullmatch(part) else np.nan
            if not np.isfinite(value):
                refuse_line(path, number, line, f"{part!r} is no finite number")
            if k < width - 1 and (value != int(value) or not lowest[k] <= value <= highest[k]):
                what = "row or column number, from 1" if width == 3 else ("node", "freedom number")[k % 2]
                refuse_line(path, number, line, f"{part} is no {what}; each line must hold: {_MEANING[width]}")
            row.append(value)
        table.append(row)
    return np.array(table, dtype=np.float64).reshape(-1, width)

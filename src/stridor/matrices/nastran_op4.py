"""Nastran OUTPUT4 files (.op4): text or binary, of either byte order, dense, sparse or sparse for large matrices."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..typing import IntArray, Sparse
from .checks import chosen_in_any_case, square
from .entries import assembled, check_symmetric, mirrored, sides, symmetric_part
from .model import StoredMatrix
from .nastran import SYMMETRIC, check_form, named
from .op4_records import Header, records
from .source import MatrixFile, source_at

_ACCEPTED = (1, 2, SYMMETRIC)  # square ones are written as rectangular, too
_FORMS = {3: "diagonal", 4: "lower triangle", 5: "upper triangle", 8: "identity", 9: "pseudo identity"}


def read(path: Path, name: str | None, where: str) -> StoredMatrix:
    """The matrix called ``name``, or the only one, of an OUTPUT4 file.

    A symmetric one (form 6) of which one half is there is completed. Raises CaseError at `where`, or at
    "FILE, line N" or "FILE, byte N" for what is wrong.
    """
    source = source_at(path, where)
    walker = records(source, source.contents())
    headers: list[Header] = []
    found: tuple[Header, tuple[IntArray, IntArray, Any]] | None = None
    while (header := walker.header()) is not None:
        headers.append(header)
        wanted = found is None and (name is None or header.name.upper() == name.strip().upper())
        if wanted:
            _check(source.of(header.name), header)
        entries = walker.columns(header)
        if wanted:
            found = header, walker.values(header, entries)
    if not headers:
        source.refuse("holds no matrix")
    chosen_in_any_case(source, name, [h.name for h in headers])
    assert found is not None, "one of them was chosen"
    return _stored(source.of(found[0].name), *found)


def _check(source: MatrixFile, header: Header) -> None:
    check_form(source, header.form, _ACCEPTED, _FORMS)
    square(source, abs(header.rows), header.columns)


def _stored(source: MatrixFile, header: Header, values: tuple[IntArray, IntArray, Any]) -> StoredMatrix:
    matrix, notes = assembled(source, *values, (header.columns, header.columns))
    # Columns are written from their first entry to their last, zeros between included.
    matrix.eliminate_zeros()
    if header.form == SYMMETRIC:
        matrix, more = _whole(source, matrix)
        notes += more
    return named(source, matrix, None, header.form, header.kind, notes)


def _whole(source: MatrixFile, matrix: Sparse) -> tuple[Sparse, tuple[str, ...]]:
    """A matrix that is marked as symmetric. Raises CaseError where it is not."""
    both, alone = sides(matrix)
    if alone and not both:
        note = "The matrix is marked as symmetric and only one half is there; it has been completed."
        return mirrored(matrix), (note,)
    check_symmetric(source, matrix, stored_only=False, says="form 6 (symmetric)", instead="form 1 (square)")
    return symmetric_part(matrix), ()

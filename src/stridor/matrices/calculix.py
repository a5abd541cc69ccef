"""Matrices that CalculiX stores: job.sti (stiffness) and job.mas (mass), with job.dof for the names of the freedoms.

*FREQUENCY, SOLVER=MATRIXSTORAGE writes "row column value" for the diagonal and one half only, and does so even where
friction has made the stiffness unsymmetric: then the other half never reached the file. Nothing in it tells.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..typing import IntArray
from .checks import nameless, whole_numbers
from .entries import assembled, from_half
from .model import Labels, Role, StoredMatrix
from .numbers import whole_number
from .source import MatrixFile, beside, quoted, source_at
from .tables import read_numbers

_ROLES: dict[str, Role] = {".sti": "stiffness", ".mas": "mass"}
_HALF = (
    "Only one half is in the file, and was mirrored: CalculiX leaves the other half out even where frictional contact "
    "makes the stiffness unsymmetric; do not use it for such a model."
)


def read(path: Path, name: str | None, where: str) -> StoredMatrix:
    """The matrix in a .sti or .mas file, one "row column value" on each line, counted from 1.

    If all entries lie in one half it is symmetric; with entries in both it is used as it stands. A .dof file beside it
    says how many freedoms there are and names them. Raises CaseError at where.
    """
    source = source_at(path, where)
    nameless(source, name)
    with source.stream() as stream:
        table, notes = read_numbers(source, stream, 0, 3)
    if not len(table):
        source.refuse("holds no entries; each line must be: row column value")
    row, column = (whole_numbers(source, table[:, k], ("rows", "columns")[k]) - 1 for k in range(2))
    role = _ROLES.get(path.suffix.lower())
    labels, size, more = _labels(source, max(1, int(max(row.max(), column.max())) + 1))
    notes += more
    below, above = bool(np.any(row > column)), bool(np.any(row < column))
    if below and above:
        matrix, more = assembled(source, row, column, table[:, 2], (size, size))
        return StoredMatrix(matrix, path.name, labels, role, "general", notes=notes + more, program="CalculiX")
    matrix, more = from_half(source, row, column, table[:, 2], (size, size))
    half = (_HALF,) if role != "mass" and (below or above) else ()
    notes += half + more
    return StoredMatrix(matrix, path.name, labels, role, "symmetric", notes=notes, program="CalculiX")


def _labels(source: MatrixFile, size: int) -> tuple[Labels | None, int, tuple[str, ...]]:
    """Labels from the .dof file beside the matrix, how many freedoms there are, and notes; size: the largest index."""
    names = beside(source, *(source.path.with_suffix(s).name for s in (".dof", ".DOF")))
    if names is None:
        return None, size, ()
    node, direction = _freedoms(names, names.text())
    if size == 2 * len(node):
        # Of cyclic symmetry CalculiX stores the real matrix of twice the size, and each name once.
        return None, size, (f"{names.path.name} names half of the freedoms, as for cyclic symmetry; it was not used.",)
    if size > len(node):
        source.refuse(
            f"has an entry in row or column {size}, but {names.path.name} names only {len(node)} freedoms; the two are "
            "not of the same run"
        )
    return Labels(node, direction), len(node), ()


def _freedoms(source: MatrixFile, text: bytes) -> tuple[IntArray, IntArray]:
    """Nodes and directions from lines "node.direction". Raises CaseError."""
    nodes: list[int] = []
    directions: list[int] = []
    for number, line in enumerate(text.split(b"\n")):
        word = line.strip()
        if not word:
            continue
        first, _, second = word.partition(b".")
        node = whole_number(first)
        if node is None or len(second) != 1 or second not in b"0123456":
            shown = f"line {number + 1}: {quoted(word)}"
            source.refuse(f"{shown} must be a node and a direction from 0 to 6 with a point between, as 12.3")
        nodes.append(node)
        directions.append(int(second))
    return np.array(nodes, dtype=np.int64), np.array(directions, dtype=np.int64)

"""Matrices to files of the formats that `matrices` reads: Matrix Market, NumPy, MATLAB and Nastran's OUTPUT4.

Every number is written so that reading gives it back to the last bit.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np
import scipy.io as sio
import scipy.sparse as sp

from ..typing import IntArray, Sparse
from .atomic import replacing

Format = Literal["mtx", "npz", "mat", "op4"]
FORMATS: tuple[Format, ...] = ("mtx", "npz", "mat", "op4")
HOLDS_ALL = ("mat", "op4")  # formats whose files hold matrices by name, so that one file will do
TOGETHER = "matrices"  # what that file is called
_PER_LINE, _WIDTH = 3, 24  # of OUTPUT4's text: 17 digits, as many as a double needs, and exponents of three


def file_of(name: str, form: Format) -> str:
    """What the file of a matrix is called."""
    return f"{TOGETHER if form in HOLDS_ALL else name}.{form}"


def write_matrices(folder: Path, matrices: Mapping[str, Sparse], form: Format) -> list[Path]:
    """Write real matrices by name, of whatever shapes, each file in one piece; the files. Raises AnalysisError where
    the folder cannot be written."""
    if form in HOLDS_ALL:
        path = folder / file_of("", form)
        write: Callable[[Path, Mapping[str, Sparse]], None] = _write_mat if form == "mat" else _write_op4
        with replacing(path) as temporary:
            write(temporary, matrices)
        return [path]
    files: list[Path] = []
    for name, matrix in matrices.items():
        files.append(folder / file_of(name, form))
        with replacing(files[-1]) as temporary:
            if form == "npz":
                sp.save_npz(temporary, sp.csr_array(matrix))
            else:
                _write_mtx(temporary, matrix)
    return files


def _is_symmetric(matrix: Sparse) -> bool:
    """Whether A = Aᵀ to the last bit."""
    return matrix.shape[0] == matrix.shape[1] and not (matrix - matrix.T).count_nonzero()


def _write_mtx(path: Path, matrix: Sparse) -> None:
    symmetry = "symmetric" if _is_symmetric(matrix) else "general"
    with path.open("wb") as stream:
        sio.mmwrite(stream, sp.coo_array(matrix), precision=17, symmetry=symmetry)


def _write_mat(path: Path, matrices: Mapping[str, Sparse]) -> None:
    # Columns before rows is how MATLAB stores them.
    columns: dict[str, Any] = {name: sp.csc_matrix(matrix) for name, matrix in matrices.items()}
    with path.open("wb") as stream:
        sio.savemat(stream, columns, do_compression=True)


def _write_op4(path: Path, matrices: Mapping[str, Sparse]) -> None:
    """Text, sparse, for matrices of any size (BIGMAT): a negative number of rows, strings that begin with two words."""
    with path.open("w", encoding="ascii", newline="\n") as stream:
        for name, matrix in matrices.items():
            held = sp.csc_array(matrix)
            held.sum_duplicates()
            held.sort_indices()
            rows, columns = held.shape
            form = 6 if _is_symmetric(matrix) else 1 if rows == columns else 2
            stream.write(f"{columns:8d}{-rows:8d}{form:8d}{2:8d}{name.upper():<8}1P,{_PER_LINE}E{_WIDTH}.16\n")
            for column in np.flatnonzero(np.diff(held.indptr)).tolist():
                part = slice(int(held.indptr[column]), int(held.indptr[column + 1]))
                stream.write(_op4_column(column, held.indices[part], held.data[part]))
            # A column after the last ends the matrix; its number means nothing.
            stream.write(f"{columns + 1:8d}{1:8d}{2:8d}\n{_fortran(1.0)}\n")


def _op4_column(column: int, rows: IntArray, values: Any) -> str:
    """A record: its head, and a string for each run of entries below one another. A double takes two words."""
    runs = np.split(np.arange(len(rows)), np.flatnonzero(np.diff(rows) > 1) + 1)
    lines = [f"{column + 1:8d}{0:8d}{sum(2 * len(run) + 2 for run in runs):8d}"]
    for run in runs:
        lines.append(f"{2 * len(run) + 1:8d}{int(rows[run[0]]) + 1:8d}")
        cells = [_fortran(float(values[k])) for k in run]
        lines += ["".join(cells[k : k + _PER_LINE]) for k in range(0, len(cells), _PER_LINE)]
    return "\n".join(lines) + "\n"


def _fortran(value: float) -> str:
    return f"{value:{_WIDTH}.16E}"

"""NumPy's .npz and .npy files, and what every reader of this package asks of the arrays that it has found.

Nothing is unpickled: arrays are made from their own bytes, after what a header claims was held against what there is.
"""

from __future__ import annotations

import math
import warnings
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, NoReturn

import numpy as np
from scipy import sparse

from ..errors import CaseError
from ..mesh.paths import in_one_line, shown_path
from ..typing import Array, IntArray, Sparse
from .model import StoredMatrix

# A damping matrix of a few dashpots has fewer entries than rows; beyond this many rows that is taken for an error.
_MOST_ROWS = 10_000_000
_MOST_LISTED = 12


@dataclass(frozen=True)
class Source:
    """A file that is being read, and where the case names it."""

    path: Path
    where: str

    def refuse(self, text: str, cause: BaseException | None = None) -> NoReturn:
        """Raises the CaseError that names the file and what is wrong with it."""
        # Names out of a broken file may hold anything.
        line = "".join(letter if letter.isprintable() else "?" for letter in text)
        raise CaseError(self.where, shown_path(self.path), line) from cause

    def unreadable(self, what: str, cause: BaseException) -> NoReturn:
        """Raises the CaseError for a file that a library could not read as ``what``."""
        if isinstance(cause, CaseError):
            raise cause
        if isinstance(cause, MemoryError):
            self.refuse("does not fit into the memory of this computer", cause)
        said = in_one_line(cause).rstrip(".") or type(cause).__name__
        self.refuse(f"is not readable as {what}: {said}", cause)


def source_at(path: Path, where: str) -> Source:
    """The file at a path, found to be there and to hold something. Raises CaseError otherwise."""
    source = Source(path, where)
    try:
        if path.is_dir():
            source.refuse("is a folder; must be a file that holds a matrix")
        if not path.exists():
            source.refuse("no such file")
        if not path.is_file():
            source.refuse("is no regular file")
        if path.stat().st_size == 0:
            source.refuse("the file is empty (0 bytes)")
        with path.open("rb"):
            pass
    except (OSError, ValueError) as error:  # ValueError: a name with a NUL
        source.refuse(f"cannot be read: {in_one_line(error)}", error)
    return source


def nameless(source: Source, name: str | None, held: str | None = None) -> None:
    """Raises CaseError if a matrix is asked for by a name in a file that holds one, of no name or of the name held."""
    if name is not None and name.strip().lower() != (held or "").lower():
        known = f"its name is {held}" if held else "it has no name"
        source.refuse(f"holds one matrix only, and {known}; leave out the name {name!r}")


def chosen(source: Source, name: str | None, names: Mapping[str, bool], others: str = "") -> str:
    """The name of the matrix that is meant; names: whether each candidate has several rows and columns.

    Without a name it is the only candidate, or the only one that is no vector and no single number. others: what else
    the file holds, for the message. Raises CaseError with the names to choose from.
    """
    if name is not None:
        if name in names:
            return name
        source.refuse(f"holds no matrix named {name!r}; it holds: {_listed(names)}{others}")
    if not names:
        source.refuse(f"holds no matrix of numbers{others}")
    found = list(names) if len(names) == 1 else [key for key, large in names.items() if large]
    if len(found) != 1:
        source.refuse(f"holds several matrices; choose one by its name: {_listed(found or names)}")
    return found[0]


def _listed(names: Any) -> str:
    """Names for a message, the first dozen of them."""
    held = [str(key) for key in names]
    more = f" and {len(held) - _MOST_LISTED} more" if len(held) > _MOST_LISTED else ""
    return ", ".join(held[:_MOST_LISTED]) + more or "none"


def real_values(source: Source, values: Any) -> Array:
    """Finite doubles of the shape of values. Raises CaseError for what are no numbers, complex or not finite ones."""
    kind = values.dtype.kind
    if kind == "c":
        if np.any(values.imag != 0):
            source.refuse("is complex; must be real, or complex with imaginary parts that are all 0")
        values = values.real
    elif kind not in "iuf":
        source.refuse(f"holds values of type {values.dtype}; must be real numbers")
    with np.errstate(over="ignore"):  # of long doubles; found below
        real = np.asarray(values, dtype=np.float64)
    if not np.all(np.isfinite(real)):
        bad = int(np.flatnonzero(~np.isfinite(real.ravel()))[0])
        place = f"value {bad + 1}"
        if real.ndim == 2:
            place = f"the value at row {bad // real.shape[1] + 1}, column {bad % real.shape[1] + 1}"
        source.refuse(f"{place} is {real.ravel()[bad]}; must be a finite number")
    return real


def whole_numbers(source: Source, values: Any, what: str) -> IntArray:
    """Values (k,) as int64. Raises CaseError where one is no whole number, or too large to be told from the next."""
    if values.ndim != 1 or values.dtype.kind not in "iuf":
        source.refuse(f"its {what} are no list of whole numbers")
    with np.errstate(invalid="ignore"):
        wrong = np.flatnonzero(~(np.abs(values.astype(np.float64)) < 2.0**53) | (values != np.floor(values)))
    if len(wrong):
        source.refuse(f"number {wrong[0] + 1} of its {what} is {values[wrong[0]]}; must be a whole number")
    return values.astype(np.int64)


def square(source: Source, rows: int, columns: int) -> int:
    """The size of a matrix that is square and not empty. Raises CaseError otherwise."""
    if rows != columns or rows < 1:
        source.refuse(f"is a matrix of {rows} rows and {columns} columns; must be square")
    return rows


def assembled(
    source: Source, row: IntArray, column: IntArray, values: Any, shape: tuple[int, int]
) -> tuple[Sparse, tuple[str, ...]]:
    """Entries (k,), counted from 0, as a csr matrix with sorted columns, and what is to be noted about it.

    Entries of the same place are added. Raises CaseError for a place outside of the matrix, for what is not square, and
    for values as `real_values` does.
    """
    size = square(source, *shape)
    real = real_values(source, values)
    if not len(row) == len(column) == len(real):
        source.refuse(f"holds {len(row)} rows, {len(column)} columns and {len(real)} values of entries; must be equal")
    if size > max(_MOST_ROWS, len(real)):
        source.refuse(f"claims {size} rows but holds only {len(real)} entries; it must have broken off")
    wrong = np.flatnonzero((row < 0) | (row >= size) | (column < 0) | (column >= size))
    if len(wrong):
        at = int(wrong[0])
        place = f"entry {at + 1} (row {row[at] + 1}, column {column[at] + 1})"
        source.refuse(f"{place} lies outside of the matrix of {size} rows and columns")
    matrix = sparse.coo_array((real, (row, column)), shape=(size, size)).tocsr()
    matrix.sum_duplicates()
    return matrix, _summed(source, matrix, len(real))


def _summed(source: Source, matrix: Sparse, stored: int) -> tuple[str, ...]:
    """What is to be noted where fewer places than entries were found."""
    if not np.all(np.isfinite(matrix.data)):
        source.refuse("entries of the same place add up to a number that is not finite")
    twice = stored - matrix.nnz
    return (f"Added up: {twice} of {stored} entries stand at a place that an earlier one has taken.",) if twice else ()


def completed(
    source: Source, row: IntArray, column: IntArray, values: Array, shape: tuple[int, int], sign: int = 1
) -> tuple[Sparse, tuple[str, ...]]:
    """As `assembled`, for entries of one half: the other half is the transpose times sign.

    Raises CaseError for entries in both halves, which would be counted twice; on the diagonal too if sign is -1.
    """
    if len(row) == len(column):
        below, above = bool(np.any(row > column)), bool(np.any(row < column))
        if below and above:
            source.refuse(
                "says that it is stored by one half, but holds entries on both sides of the diagonal; write all of its "
                "entries and call it general"
            )
        if sign < 0 and len(row) == len(values) and np.any(values[row == column] != 0):
            source.refuse("says that it is skew-symmetric, but holds entries on the diagonal")
    half, notes = assembled(source, row, column, values, shape)
    held = half.tocoo()
    off = held.row != held.col
    row, column = np.concatenate((held.row, held.col[off])), np.concatenate((held.col, held.row[off]))
    matrix = sparse.coo_array((np.concatenate((held.data, sign * held.data[off])), (row, column)), shape=shape).tocsr()
    matrix.sort_indices()
    return matrix, notes


def expanded(source: Source, pointers: Any, count: int, lines: int) -> IntArray:
    """Which row (or column) each entry belongs to, from pointers (lines + 1,) that count from 0.

    count: entries that there are. Raises CaseError for pointers that do not fit.
    """
    held = whole_numbers(source, pointers, "pointers")
    if len(held) != lines + 1:
        source.refuse(f"has {len(held)} pointers for {lines} rows or columns; must be one more than these")
    steps = np.diff(held)
    if held[0] != 0 or np.any(steps < 0) or held[-1] > count:
        source.refuse(f"its pointers do not rise from the first to the last of its {count} entries")
    return np.repeat(np.arange(lines, dtype=np.int64), steps)


def from_dense(source: Source, values: Any) -> Sparse:
    """A square array (n, n) as a csr matrix of what is not 0. Raises CaseError."""
    if values.ndim != 2:
        source.refuse(f"is an array of {values.ndim} dimensions; must be a square matrix of 2")
    square(source, *values.shape)
    matrix = sparse.csr_array(real_values(source, values))
    matrix.sort_indices()
    return matrix


def read(path: Path, name: str | None, where: str) -> StoredMatrix:
    """The matrix in a .npz or .npy file.

    .npz: what scipy.sparse.save_npz has written, in any of its formats; data, indices, indptr and shape without a
    format, taken by rows; or arrays (n, n), of which name chooses one. Raises CaseError at where.
    """
    source = source_at(path, where)
    try:
        with path.open("rb") as file, warnings.catch_warnings():
            warnings.simplefilter("ignore")  # headers that older versions wrote, and files mended by hand
            if file.read(6) == b"\x93NUMPY":
                nameless(source, name)
                file.seek(0)
                array = _array(source, file, path.stat().st_size, path.name)
                return StoredMatrix(from_dense(source, array), path.name)
            with zipfile.ZipFile(file) as archive:
                return _from_archive(source, archive, name)
    except Exception as error:  # zipfile and its decompressors raise many kinds
        source.unreadable("a NumPy .npz file", error)


def _from_archive(source: Source, archive: zipfile.ZipFile, name: str | None) -> StoredMatrix:
    members = {i.filename.removesuffix(".npy"): i for i in archive.infolist() if i.filename.endswith(".npy")}

    def load(key: str) -> Any:
        with archive.open(members[key]) as file:
            return _array(source, file, members[key].file_size, key)

    if {"data", "shape"} <= set(members) and {"format", "indptr", "row", "offsets"} & set(members):
        nameless(source, name)
        matrix, notes = _sparse(source, {key: load(key) for key in members if not key.startswith("_")})
        return StoredMatrix(matrix, source.path.name, notes=notes)
    arrays = {key: load(key) for key in members} if name not in members else {name: load(str(name))}
    names = {k: all(n > 1 for n in a.shape) for k, a in arrays.items() if a.ndim == 2 and a.dtype.kind in "iufc"}
    key = chosen(source, name if name not in members or name in names else None, names)
    return StoredMatrix(from_dense(source, arrays[key]), source.path.name, name=key)


def _array(source: Source, file: IO[bytes], size: int, key: str) -> Any:
    """An array from a .npy of size bytes, read without allocating what its header merely claims. Raises CaseError."""
    version = np.lib.format.read_magic(file)
    readers = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
    if version not in readers:
        source.refuse(f"{key} is written in version {version} of .npy; versions 1.0 and 2.0 are read")
    shape, by_columns, dtype = readers[version](file)
    if dtype.hasobject:
        source.refuse(f"{key} holds Python objects (pickled), which are never loaded; save arrays of numbers only")
    if dtype.kind not in "biufcSU" or dtype.itemsize == 0 or any(n < 0 for n in shape):
        source.refuse(f"{key} is an array of type {dtype}; must hold numbers")
    needed = math.prod(shape) * dtype.itemsize
    if needed > size:
        source.refuse(f"{key} claims {math.prod(shape)} values, for which its {size} bytes are too few")
    data = file.read(needed)
    if len(data) < needed:
        source.refuse(f"{key} breaks off after {len(data)} of {needed} bytes")
    return np.frombuffer(data, dtype=dtype).reshape(shape, order="F" if by_columns else "C")


def _sparse(source: Source, arrays: Mapping[str, Any]) -> tuple[Sparse, tuple[str, ...]]:
    """The matrix of the arrays that scipy.sparse.save_npz writes for each of its formats, and notes."""
    notes: tuple[str, ...] = ()
    form = "csr"
    if "format" in arrays:
        held = arrays["format"].ravel()
        form = str(held[0].decode("ascii", "replace") if held.dtype.kind == "S" else held[0]) if held.size else ""
    elif "indptr" not in arrays:
        form = "coo" if "row" in arrays else "dia"
    else:
        notes = ("The file does not say whether indptr counts rows or columns; taken by rows (csr).",)
    needed = {
        "csr": ("indices", "indptr"),
        "csc": ("indices", "indptr"),
        "bsr": ("indices", "indptr"),
        "coo": ("row", "col"),
        "dia": ("offsets",),
    }
    if form not in needed:
        source.refuse(f"is a sparse matrix of format {form!r}; must be one of: {', '.join(needed)}")
    missing = [key for key in needed[form] if key not in arrays]
    if missing:
        source.refuse(f"is a sparse matrix of format {form} but holds no {' and no '.join(missing)}")
    shape = whole_numbers(source, arrays["shape"], "shape")
    if len(shape) != 2:
        source.refuse(f"is an array of {len(shape)} dimensions; must be a square matrix of 2")
    size = square(source, int(shape[0]), int(shape[1]))
    data = arrays["data"]
    if data.ndim != {"bsr": 3, "dia": 2}.get(form, 1):
        source.refuse(f"its data have {data.ndim} dimensions, which is not how format {form} is stored")
    if form == "dia":
        row, column, values = _from_diagonals(source, arrays, size)
    elif form == "coo":
        row, column = (whole_numbers(source, arrays[key], f"{key}s") for key in needed[form])
        values = data
    else:
        row, column, values = _from_lines(source, arrays, form, size)
    matrix, more = assembled(source, row, column, values, (size, size))
    return matrix, notes + more


def _from_lines(source: Source, arrays: Mapping[str, Any], form: str, size: int) -> tuple[IntArray, IntArray, Any]:
    """Row, column and value of the entries of a matrix stored by rows, columns or rows of blocks."""
    data, indices = arrays["data"], whole_numbers(source, arrays["indices"], "indices")
    if len(indices) != len(data):
        source.refuse(f"holds {len(indices)} indices and {len(data)} values; must be as many")
    height, width = data.shape[1:] if form == "bsr" else (1, 1)
    if height < 1 or width < 1 or size % height or size % width:
        source.refuse(f"its blocks of {height} rows and {width} columns do not divide its {size} rows and columns")
    major = expanded(source, arrays["indptr"], len(data), size // height)
    indices, data = indices[: len(major)], data[: len(major)]
    if form == "bsr":
        wrong = np.flatnonzero((indices < 0) | (indices >= size // width))
        if len(wrong):
            source.refuse(f"block {wrong[0] + 1} lies outside of the matrix of {size} rows and columns")
        row = major[:, None, None] * height + np.arange(height)[None, :, None] + np.zeros((1, 1, width), dtype=np.int64)
        column = indices[:, None, None] * width + np.arange(width) + np.zeros((1, height, 1), dtype=np.int64)
        return row.ravel(), column.ravel(), data.ravel()
    return (indices, major, data) if form == "csc" else (major, indices, data)


def _from_diagonals(source: Source, arrays: Mapping[str, Any], size: int) -> tuple[IntArray, IntArray, Any]:
    """Row, column and value of the entries of a matrix stored by diagonals: data[i, j] is at row j - offsets[i]."""
    data, offsets = arrays["data"], whole_numbers(source, arrays["offsets"], "offsets")
    if len(offsets) != len(data) or len(np.unique(offsets)) != len(offsets):
        source.refuse(f"holds {len(data)} diagonals for {len(offsets)} offsets; must be one each, and no offset twice")
    column = np.broadcast_to(np.arange(data.shape[1], dtype=np.int64), data.shape)
    row = column - offsets[:, None]
    # The corners of the array that lie outside of the matrix are padding; so is an explicit 0.
    inside = (row >= 0) & (row < size) & (column < size) & (data != 0)
    return row[inside], column[inside], data[inside]

"""NumPy's .npz and .npy files.

Nothing is unpickled: arrays are made from their own bytes, after what a header claims was held against what there is.
`numpy.load` allocates what a header claims, and `scipy.sparse.load_npz` believes pointers and indices, refuses files
without a format, and cannot convert numbers of half precision: neither would tell where such a file is wrong.
"""

from __future__ import annotations

import io
import math
import warnings
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np

from ..typing import IntArray, Sparse
from .checks import chosen, expanded, nameless, square, whole_numbers
from .entries import assembled, from_dense
from .model import StoredMatrix
from .source import Doubt, MatrixFile, source_at

_NEEDED = {
    "csr": ("indices", "indptr"),
    "csc": ("indices", "indptr"),
    "bsr": ("indices", "indptr"),
    "coo": ("row", "col"),
    "dia": ("offsets",),
}
_LONGEST_HEAD = 1 << 16
_OBJECTS = "Python objects, which are never loaded; save sparse matrices by scipy.sparse.save_npz"
_OF_SPARSE = {"data", "shape", "format", *(key for keys in _NEEDED.values() for key in keys)}


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
                array = _header(source, file, path.name).values(source, file, path.stat().st_size, path.name)
                return StoredMatrix(from_dense(source, array), path.name)
            file.seek(0)
            if file.read(4) == b"PK\x03\x04" and not zipfile.is_zipfile(file):
                source.refuse("is a .npz file that breaks off: its table of contents is missing")
            with zipfile.ZipFile(file) as archive:
                return _from_archive(source, archive, name)
    except Exception as error:  # zipfile and its decompressors raise many kinds
        source.unreadable("a NumPy file", error)


def _from_archive(source: MatrixFile, archive: zipfile.ZipFile, name: str | None) -> StoredMatrix:
    members: dict[str, zipfile.ZipInfo] = {}
    for info in archive.infolist():
        key = info.filename.removesuffix(".npy")
        if key in members:
            source.refuse(f"holds two arrays named {key}")
        if key != info.filename:
            members[key] = info

    def header(key: str) -> _Header:
        with archive.open(members[key]) as file:
            return _header(source, file, key)

    def load(key: str) -> Any:
        with archive.open(members[key]) as file:
            found = _header(source, file, key)
            size = members[key].file_size
            # Bytes become double precision; what is claimed without being there is told below.
            numbers = math.prod(found.shape) if math.prod(found.shape) * found.dtype.itemsize <= size else 0
            source.of(key).check_unpacked(max(size, 8 * numbers), source.path.stat().st_size)
            return found.values(source, file, members[key].file_size, key)

    if {"data", "shape"} <= set(members) and {"format", "indptr", "row", "offsets"} & set(members):
        nameless(source, name)
        matrix, notes = _sparse(source, {key: load(key) for key in members if key in _OF_SPARSE})
        return StoredMatrix(matrix, source.path.name, notes=notes)
    heads = {key: header(key) for key in members}
    names = {k: all(n > 1 for n in h.shape) for k, h in heads.items() if len(h.shape) == 2 and h.kind in "iufc"}
    others = [f"{key} ({head.words})" for key, head in heads.items() if key not in names]
    more = f"; besides: {', '.join(others[:6])}" if others else ""
    key = name if name in heads else chosen(source, name, names, more)
    return StoredMatrix(from_dense(source.of(key), load(key)), source.path.name, name=key)


@dataclass(frozen=True)
class _Header:
    """What the head of a .npy says of its array."""

    shape: tuple[int, ...]
    by_columns: bool
    dtype: np.dtype[Any]

    @property
    def kind(self) -> str:
        """NumPy's letter for what the values are."""
        return "O" if self.dtype.hasobject else self.dtype.kind

    @property
    def words(self) -> str:
        """What the array is, for a message."""
        if self.kind == "O":
            return _OBJECTS
        return f"{self.dtype}, {' × '.join(str(n) for n in self.shape) or 'a single one'}"

    def values(self, source: MatrixFile, file: IO[bytes], size: int, key: str) -> Any:
        """The array, whose file has size bytes, read without allocating what is merely claimed. Raises CaseError."""
        if self.kind == "O":
            source.refuse(f"{key} holds {_OBJECTS}")
        if self.kind not in "biufcSU" or self.dtype.itemsize == 0:
            source.refuse(f"{key} is an array of type {self.dtype}; must hold numbers")
        needed = math.prod(self.shape) * self.dtype.itemsize
        if needed > size or any(n < 0 for n in self.shape):
            source.refuse(f"{key} claims {math.prod(self.shape)} values, for which its {size} bytes are too few")
        data = file.read(needed)
        if len(data) < needed:
            source.refuse(f"{key} breaks off after {len(data)} of {needed} bytes")
        return np.frombuffer(data, dtype=self.dtype).reshape(self.shape, order="F" if self.by_columns else "C")


def _header(source: MatrixFile, file: IO[bytes], key: str) -> _Header:
    """The head of a .npy. Raises CaseError for a version that is not read, and for a head that is longer than any."""
    version = np.lib.format.read_magic(file)
    readers = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
    if version not in readers:
        source.refuse(f"{key} is written in version {version} of .npy; versions 1.0 and 2.0 are read")
    length = file.read(2 if version == (1, 0) else 4)
    claimed = int.from_bytes(length, "little")
    if claimed > _LONGEST_HEAD:
        source.refuse(f"{key} claims a head of {claimed} bytes; no array of numbers needs so many")
    return _Header(*readers[version](io.BytesIO(length + file.read(claimed))))


def _sparse(source: MatrixFile, arrays: Mapping[str, Any]) -> tuple[Sparse, tuple[str, ...]]:
    """The matrix of the arrays that scipy.sparse.save_npz writes for each of its formats, and notes."""
    notes: tuple[str, ...] = ()
    form = "csr"
    if "format" in arrays:
        held = arrays["format"].ravel()
        form = str(held[0].decode("ascii", "replace") if held.dtype.kind == "S" else held[0]) if held.size else ""
    elif "indptr" not in arrays:
        form = "coo" if "row" in arrays else "dia"
    else:
        notes = (Doubt("The file does not say whether indptr counts rows or columns; taken by rows (csr)."),)
    if form not in _NEEDED:
        source.refuse(f"is a sparse matrix of format {form!r}; must be one of: {', '.join(_NEEDED)}")
    missing = [key for key in _NEEDED[form] if key not in arrays]
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
        row, column = (whole_numbers(source, arrays[key], f"{key}s") for key in _NEEDED[form])
        values = data
    else:
        row, column, values = _from_lines(source, arrays, form, size)
    matrix, more = assembled(source, row, column, values, (size, size), first=0)
    return matrix, notes + more


def _from_lines(source: MatrixFile, arrays: Mapping[str, Any], form: str, size: int) -> tuple[IntArray, IntArray, Any]:
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


def _from_diagonals(source: MatrixFile, arrays: Mapping[str, Any], size: int) -> tuple[IntArray, IntArray, Any]:
    """Row, column and value of the entries of a matrix stored by diagonals: data[i, j] is at row j - offsets[i]."""
    data, offsets = arrays["data"], whole_numbers(source, arrays["offsets"], "offsets")
    if len(offsets) != len(data) or len(np.unique(offsets)) != len(offsets):
        source.refuse(f"holds {len(data)} diagonals for {len(offsets)} offsets; must be one each, and no offset twice")
    column = np.broadcast_to(np.arange(data.shape[1], dtype=np.int64), data.shape)
    row = column - offsets[:, None]
    # The corners of the array that lie outside of the matrix are padding; so is an explicit 0.
    inside = (row >= 0) & (row < size) & (column < size) & (data != 0)
    return row[inside], column[inside], data[inside]

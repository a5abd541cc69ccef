"""MATLAB's .mat files: version 4, 5 (to which 6 and 7 belong) and 7.3 (HDF5, through h5py).

SciPy's reader ends the interpreter on some broken files of version 5; therefore what matrices need of it is read here.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from ..typing import Sparse
from .model import StoredMatrix
from .numpy_file import Source, assembled, chosen, expanded, from_dense, source_at, square, whole_numbers

_DEEPEST = 4
_PRECISIONS_4 = {0: "f8", 1: "f4", 2: "i4", 3: "i2", 4: "u2", 5: "u1"}
_TYPES_5 = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_MATRIX, _PACKED = 14, 15
_COMPLEX, _LOGICAL = 0x0800, 0x0200
_INTEGERS = ("int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64")
_BEFORE = ("unknown", "cell", "struct", "object", "char", "sparse", "double", "single")
_CLASSES_5 = (*_BEFORE, *_INTEGERS, "function", "opaque", "object")
_NUMERIC = ("double", "single", "sparse", *_INTEGERS)
# What gzip can make of a byte is a little over 1000 bytes.
_MOST_PACKED = 1100


def read(path: Path, name: str | None, where: str) -> StoredMatrix:
    """The matrix in a .mat file, full or sparse; name: the variable, or S.K for field K of the struct S.

    Without a name the file must hold one matrix; vectors, single numbers, texts, cells and objects are not counted.
    Raises CaseError at where.
    """
    source = source_at(path, where)
    try:
        with path.open("rb") as file:
            start = file.read(128)
        if h5py.is_hdf5(path):
            return _read_hdf5(source, name)
        if not (start.startswith(b"MATLAB ") or 0 in start[:4]):
            source.refuse("is no .mat file: it begins neither as version 4, 5 or 7 nor as version 7.3 (HDF5)")
        if start.startswith(b"MATLAB 7.3"):
            source.refuse("is a .mat file of version 7.3 that is broken: what follows its head is no HDF5")
        return _read_older(source, path.read_bytes(), name)
    except Exception as error:  # zlib and HDF5 raise many kinds for files that are broken
        source.unreadable("a MATLAB .mat file", error)


@dataclass(frozen=True)
class _Variable:
    """A variable of version 4 or 5, not yet read: its kind in MATLAB's words, rows and columns, and its values."""

    kind: str
    shape: tuple[int, ...]
    load: Callable[[], tuple[Sparse, tuple[str, ...]]]
    fields: Callable[[], dict[str, _Variable]] = dict

    @property
    def is_matrix(self) -> bool:
        return self.kind in _NUMERIC and len(self.shape) == 2


def _read_older(source: Source, data: bytes, name: str | None) -> StoredMatrix:
    """From a file of version 4 or 5."""
    held: dict[str, _Variable] = {}
    others: dict[str, str] = {}
    for key, variable in _version_4(source, data) if 0 in data[:4] else _version_5(source, data):
        if key in held or key in others:
            source.refuse(f"holds two variables named {key}")
        _sort_in(key, variable, held, others, 0)
    key = _pick(source, name, {key: all(n > 1 for n in item.shape) for key, item in held.items()}, others)
    matrix, notes = held[key].load()
    return StoredMatrix(matrix, source.path.name, name=key, notes=notes)


def _sort_in(
    key: str, variable: _Variable, held: dict[str, _Variable], others: dict[str, str], depth: int
) -> None:
    """Puts matrices into held, of a struct those in its fields; what is none into others."""
    if variable.is_matrix:
        held[key] = variable
        return
    others[key] = variable.kind
    if depth < _DEEPEST:
        for field, inner in variable.fields().items():
            if inner.is_matrix or inner.kind == "struct":
                _sort_in(f"{key}.{field}", inner, held, others, depth + 1)


def _version_4(source: Source, data: bytes) -> Iterator[tuple[str, _Variable]]:
    """Variables by name: a head of five whole numbers, the name, the values by columns."""
    at = 0
    while at < len(data):
        if at + 20 > len(data):
            source.refuse("breaks off within the head of a variable")
        order = "<" if 0 <= int.from_bytes(data[at : at + 4], "little", signed=True) < 1000 else ">"
        code, rows, columns, is_complex, length = (int(n) for n in np.frombuffer(data, f"{order}i4", 5, at))
        precision, layout = code % 1000 // 10, code % 10
        accepted = code == 1000 * (order == ">") + 10 * precision + layout and precision in _PRECISIONS_4
        if not (accepted and layout < 3 and min(rows, columns) >= 0 and length > 0 and is_complex in (0, 1)):
            source.refuse(f"is no .mat file of version 4: byte {at + 1} begins no variable")
        dtype = np.dtype(order + _PRECISIONS_4[precision])
        begin = at + 20 + length
        count = rows * columns * (1 + is_complex)
        if begin + count * dtype.itemsize > len(data):
            source.refuse(f"breaks off: a variable of {rows} rows and {columns} columns reaches beyond its end")
        key = data[at + 20 : begin].split(b"\0")[0].decode("ascii", "replace")
        values = np.frombuffer(data, dtype, count, begin)
        at = begin + count * dtype.itemsize
        if layout == 1:
            yield key, _Variable("char", (rows, columns), partial(_unreadable_kind, source, "char"))
        elif layout == 2:
            yield key, _triplets_4(source, values, rows, columns)
        else:
            if is_complex:
                values = values[: rows * columns] + 1j * values[rows * columns :]
            full = values.reshape((rows, columns), order="F")
            yield key, _Variable("double", (rows, columns), partial(_full, source, full))


def _triplets_4(source: Source, values: Any, rows: int, columns: int) -> _Variable:
    """A sparse matrix of version 4: row, column, value and perhaps imaginary part, the sizes in the last row."""
    if columns not in (3, 4) or rows < 1 or values.size != rows * columns:
        source.refuse(f"is no .mat file of version 4: a sparse matrix has {columns} columns of numbers; must be 3 or 4")
    table = values.reshape((rows, columns), order="F")
    size = whole_numbers(source, table[-1, :2], "rows and columns")

    def load() -> tuple[Sparse, tuple[str, ...]]:
        row, column = (whole_numbers(source, table[:-1, k], ("row", "column")[k] + " indices") - 1 for k in range(2))
        numbers = table[:-1, 2] + (1j * table[:-1, 3] if columns == 4 else 0)
        return assembled(source, row, column, numbers, (int(size[0]), int(size[1])))

    return _Variable("sparse", (int(size[0]), int(size[1])), load)


def _unreadable_kind(source: Source, kind: str) -> tuple[Sparse, tuple[str, ...]]:
    source.refuse(f"holds a variable of the kind {kind}; must be a matrix of numbers")


def _full(source: Source, values: Any) -> tuple[Sparse, tuple[str, ...]]:
    return from_dense(source, values), ()


@dataclass
class _Elements:
    """The elements of a version 5 file or of one of its variables, in turn."""

    source: Source
    data: bytes
    order: str
    at: int = 0

    def next(self) -> tuple[int, bytes]:
        """Type and content of the next element. Raises CaseError where it reaches beyond the end."""
        if self.at + 8 > len(self.data):
            self.source.refuse("breaks off within a variable")
        kind, size = (int(n) for n in np.frombuffer(self.data, f"{self.order}u4", 2, self.at))
        if kind >> 16:  # up to four bytes fit into the head itself
            kind, size, begin = kind & 0xFFFF, kind >> 16, self.at + 4
            self.at += 8
            if size > 4:
                self.source.refuse("is no .mat file of version 5: a small element of more than 4 bytes")
        else:
            begin = self.at + 8
            self.at = begin + size + (-size % 8 if kind != _PACKED else 0)
        if begin + size > len(self.data):
            self.source.refuse(f"breaks off: an element of {size} bytes reaches beyond its end")
        return kind, self.data[begin : begin + size]

    def numbers(self) -> Any:
        """The values of the next element, which must hold numbers. Raises CaseError."""
        kind, content = self.next()
        if kind not in _TYPES_5:
            self.source.refuse(f"is no .mat file of version 5: an element of type {kind} stands in place of numbers")
        dtype = np.dtype(self.order + _TYPES_5[kind])
        if len(content) % dtype.itemsize:
            self.source.refuse(f"is no .mat file of version 5: {len(content)} bytes are no whole number of values")
        return np.frombuffer(content, dtype)


def _version_5(source: Source, data: bytes) -> Iterator[tuple[str, _Variable]]:
    """Variables by name, from elements that may be packed by zlib."""
    orders = {b"IM": "<", b"MI": ">"}
    if len(data) < 128 or data[126:128] not in orders:
        source.refuse("is no .mat file of version 5: its head of 128 bytes is broken")
    outer = _Elements(source, data, orders[data[126:128]], 128)
    while outer.at < len(data):
        kind, content = outer.next()
        if kind == _PACKED:
            unpacker = zlib.decompressobj()
            content = unpacker.decompress(content)
            if not unpacker.eof:
                source.refuse("a variable that is packed breaks off")
            kind, content = _Elements(source, content, outer.order).next()
        if kind != _MATRIX:
            source.refuse(f"is no .mat file of version 5: an element of type {kind} stands where a variable should be")
        key, variable = _variable_5(source, content, outer.order)
        if key:  # MATLAB's store for objects has no name
            yield key, variable


def _variable_5(source: Source, content: bytes, order: str) -> tuple[str, _Variable]:
    """The name of a variable, and what it is. Raises CaseError."""
    if not content:  # an empty field of a struct
        return "", _Variable("double", (0, 0), partial(_full, source, np.zeros((0, 0))))
    inner = _Elements(source, content, order)
    flags = inner.numbers()
    if len(flags) < 2 or flags.dtype.kind != "u":
        source.refuse("is no .mat file of version 5: a variable does not begin with its flags")
    number = int(flags[0]) & 0xFF
    kind = _CLASSES_5[number] if number < len(_CLASSES_5) else "unknown"
    if kind in ("opaque", "function"):  # which go on in ways of their own
        return "", _Variable(kind, (), partial(_unreadable_kind, source, kind))
    shape = tuple(int(n) for n in inner.numbers())
    if len(shape) < 2 or min(shape) < 0:
        source.refuse("is no .mat file of version 5: a variable has no number of rows and columns")
    key = inner.next()[1].split(b"\0")[0].decode("ascii", "replace")
    if int(flags[0]) & _LOGICAL:
        kind = "logical"
    if kind == "struct" and math.prod(shape) == 1:
        return key, _Variable(kind, shape, partial(_unreadable_kind, source, kind), partial(_fields_5, inner))
    if kind not in _NUMERIC:
        return key, _Variable(kind, shape, partial(_unreadable_kind, source, kind))
    is_complex = bool(int(flags[0]) & _COMPLEX)
    return key, _Variable(kind, shape, partial(_values_5, inner, kind, shape, is_complex))


def _fields_5(inner: _Elements) -> dict[str, _Variable]:
    """The fields of a struct of one element."""
    length = inner.numbers()
    names = inner.next()[1]
    width = int(length[0]) if len(length) else 0
    if width < 1 or len(names) % width:
        inner.source.refuse("is no .mat file of version 5: the names of a struct's fields are broken")
    found: dict[str, _Variable] = {}
    for at in range(0, len(names), width):
        key = names[at : at + width].split(b"\0")[0].decode("ascii", "replace")
        kind, content = inner.next()
        if kind != _MATRIX or key in found:
            inner.source.refuse(f"is no .mat file of version 5: the field {key} of a struct is broken")
        found[key] = _variable_5(inner.source, content, inner.order)[1]
    return found


def _values_5(inner: _Elements, kind: str, shape: tuple[int, ...], is_complex: bool) -> tuple[Sparse, tuple[str, ...]]:
    """A full or sparse matrix. Raises CaseError."""
    source = inner.source
    row = whole_numbers(source, inner.numbers(), "row indices") if kind == "sparse" else None
    pointers = inner.numbers() if kind == "sparse" else None
    values = inner.numbers()
    if is_complex:
        imaginary = inner.numbers()
        if len(imaginary) != len(values):
            source.refuse(f"has {len(values)} real parts and {len(imaginary)} imaginary ones; must be as many")
        values = values + 1j * imaginary
    size = square(source, *shape)
    if row is None:
        if len(values) != math.prod(shape):
            source.refuse(f"has {len(values)} values for {shape[0]} rows and {shape[1]} columns")
        return _full(source, values.reshape(shape, order="F"))
    # There may be room for more entries than there are.
    column = expanded(source, pointers, min(len(row), len(values)), size)
    return assembled(source, row[: len(column)], column, values[: len(column)], (size, size))


def _pick(source: Source, name: str | None, names: dict[str, bool], others: dict[str, str]) -> str:
    """The matrix meant; others: kind of each variable that is none. Raises CaseError."""
    if name in others:
        kind = others[str(name)]
        inner = [key for key in names if key.startswith(f"{name}.")]
        mend = f"; its fields are: {', '.join(inner)}" if inner else "; must be a full or sparse matrix of numbers"
        source.refuse(f"{name} is of the kind {kind}{mend}")
    more = ", ".join(f"{key} ({kind})" for key, kind in list(others.items())[:6])
    return chosen(source, name, names, f"; besides: {more}" if more else "")


def _read_hdf5(source: Source, name: str | None) -> StoredMatrix:
    """From a file of version 7.3."""
    with h5py.File(source.path, "r") as file:
        held: dict[str, Any] = {}
        others: dict[str, str] = {}
        _walk(file, "", held, others, 0)
        if not held and not others:
            source.refuse("is an HDF5 file, but no variable in it is marked as MATLAB's")
        names = {key: all(n > 1 for n in _shape(item)) for key, item in held.items()}
        key = _pick(source, name, names, others)
        item = held[key]
        if isinstance(item, h5py.Group):
            matrix, notes = _sparse_group(source, item, key)
        else:
            # MATLAB stores by columns, HDF5 by rows: what is read is the transpose.
            matrix, notes = from_dense(source, _numbers(source, item, key, 2).T), ()
        return StoredMatrix(matrix, source.path.name, name=key, notes=notes)


def _walk(group: Any, path: str, held: dict[str, Any], others: dict[str, str], depth: int) -> None:
    """Finds matrices of numbers by their dotted names, and the kinds of what is none."""
    for key in group:
        # Names with # are MATLAB's own stores of cells and objects. Links may lead out of the file.
        if key.startswith("#") or not isinstance(group.get(key, getlink=True), h5py.HardLink):
            continue
        item = group[key]
        kind = _attribute(item, "MATLAB_class")
        if not kind:
            continue
        name = f"{path}{key}"
        if isinstance(item, h5py.Group) and "MATLAB_sparse" not in item.attrs:
            others[name] = kind
            if kind == "struct" and depth < _DEEPEST:
                _walk(item, f"{name}.", held, others, depth + 1)
        elif kind in _NUMERIC and (isinstance(item, h5py.Group) or item.ndim == 2):
            held[name] = item
        else:
            others[name] = kind


def _attribute(item: Any, key: str) -> str:
    value = item.attrs.get(key, b"")
    return value.decode("ascii", "replace") if isinstance(value, bytes) else str(value)


def _shape(item: Any) -> tuple[int, ...]:
    """Rows and columns of a variable as far as they matter to tell matrices from vectors."""
    if isinstance(item, h5py.Group):
        columns = item["jc"].shape[0] - 1 if "jc" in item and len(item["jc"].shape) == 1 else 0
        return (int(item.attrs["MATLAB_sparse"]), columns)
    return (0, 0) if item.attrs.get("MATLAB_empty") else tuple(item.shape)


def _numbers(source: Source, item: Any, key: str, dimensions: int) -> Any:
    """The values of a dataset. Raises CaseError before reading if they cannot be in the file."""
    if not isinstance(item, h5py.Dataset) or len(item.shape or ()) != dimensions:
        source.refuse(f"{key} is not stored as MATLAB stores it: its values are no array of {dimensions} dimensions")
    if item.attrs.get("MATLAB_empty"):
        source.refuse(f"{key} is empty; must be a square matrix")
    if item.is_virtual or item.external:
        source.refuse(f"{key} is kept in another file; must be in this one")
    if item.size * item.dtype.itemsize > _MOST_PACKED * source.path.stat().st_size:
        source.refuse(f"{key} claims {item.size} values, for which the file is too small")
    values = item[()]
    if values.dtype.names == ("real", "imag"):
        values = values["real"] + 1j * values["imag"]
    return values


def _sparse_group(source: Source, group: Any, key: str) -> tuple[Sparse, tuple[str, ...]]:
    """A sparse matrix, which is stored by columns: jc points into ir (row indices) and data. Raises CaseError."""
    rows = int(group.attrs["MATLAB_sparse"])
    if "jc" not in group:
        source.refuse(f"{key} is marked as sparse, but has no jc")
    pointers = whole_numbers(source, _numbers(source, group["jc"], f"{key}/jc", 1), "pointers")
    size = square(source, rows, len(pointers) - 1)
    if "data" not in group and "ir" not in group:
        return assembled(source, pointers[:0], pointers[:0], np.zeros(0), (size, size))  # all zeros
    if "data" not in group or "ir" not in group:
        source.refuse(f"{key} is marked as sparse, but does not have both ir and data")
    row = whole_numbers(source, _numbers(source, group["ir"], f"{key}/ir", 1), "row indices")
    values = _numbers(source, group["data"], f"{key}/data", 1)
    if len(row) != len(values):
        source.refuse(f"{key} has {len(row)} row indices and {len(values)} values; must be as many")
    column = expanded(source, pointers, len(values), size)
    return assembled(source, row[: len(column)], column, values[: len(column)], (size, size))

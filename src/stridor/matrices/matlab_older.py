"""MATLAB's .mat files of version 4 and of version 5, to which 6 and 7 belong."""

from __future__ import annotations

import math
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from .checks import expanded, square, whole_numbers
from .entries import assembled, from_dense
from .matlab_variable import DEEPEST, INTEGERS, NUMERIC, Loaded, Variable
from .source import MatrixFile

_PRECISIONS_4 = {0: "f8", 1: "f4", 2: "i4", 3: "i2", 4: "u2", 5: "u1"}
_TYPES_5 = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_MATRIX, _PACKED = 14, 15
_STEP = 1 << 26  # bytes that are unpacked at a time
_COMPLEX, _LOGICAL = 0x0800, 0x0200
_BEFORE = ("unknown", "cell", "struct", "object", "char", "sparse", "double", "single")
_CLASSES_5 = (*_BEFORE, *INTEGERS, "function", "opaque", "object")


def variables(source: MatrixFile, data: bytes) -> tuple[dict[str, Variable], dict[str, str]]:
    """Matrices by their dotted names, and the kinds of what is none. Raises CaseError."""
    held: dict[str, Variable] = {}
    others: dict[str, str] = {}
    for key, variable in _version_4(source, data) if 0 in data[:4] else _version_5(source, data):
        if key in held or key in others:
            source.refuse(f"holds two variables named {key}")
        _sort_in(key, variable, held, others, 0)
    return held, others


def _sort_in(
    key: str, variable: Variable, held: dict[str, Variable], others: dict[str, str], depth: int
) -> None:
    """Puts matrices into held, of a struct those in its fields; what is none into others."""
    if variable.is_matrix:
        held[key] = variable
        return
    several = f" of {len(variable.shape)} dimensions" if variable.kind in NUMERIC else ""
    others[key] = f"{variable.kind}{several}"
    if depth < DEEPEST:
        for field, inner in variable.fields().items():
            if inner.is_matrix or inner.kind == "struct":
                _sort_in(f"{key}.{field}", inner, held, others, depth + 1)


def _version_4(source: MatrixFile, data: bytes) -> Iterator[tuple[str, Variable]]:
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
            yield key, Variable("char", (rows, columns))
        elif layout == 2:
            yield key, _triplets_4(source, values, rows, columns)
        else:
            if is_complex:
                values = values[: rows * columns] + 1j * values[rows * columns :]
            full = values.reshape((rows, columns), order="F")
            yield key, Variable("double", (rows, columns), partial(_full, full))


def _triplets_4(source: MatrixFile, values: Any, rows: int, columns: int) -> Variable:
    """A sparse matrix of version 4: row, column, value and perhaps imaginary part, the sizes in the last row."""
    if columns not in (3, 4) or rows < 1 or values.size != rows * columns:
        source.refuse(f"is no .mat file of version 4: a sparse matrix has {columns} columns of numbers; must be 3 or 4")
    table = values.reshape((rows, columns), order="F")
    size = whole_numbers(source, table[-1, :2], "rows and columns")

    def load(source: MatrixFile) -> Loaded:
        row, column = (whole_numbers(source, table[:-1, k], ("row", "column")[k] + " indices") - 1 for k in range(2))
        numbers = table[:-1, 2] + (1j * table[:-1, 3] if columns == 4 else 0)
        return assembled(source, row, column, numbers, (int(size[0]), int(size[1])))

    return Variable("sparse", (int(size[0]), int(size[1])), load)


def _full(values: Any, source: MatrixFile) -> Loaded:
    return from_dense(source, values), ()


@dataclass
class _Elements:
    """The elements of a version 5 file or of one of its variables, in turn."""

    source: MatrixFile
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


def _version_5(source: MatrixFile, data: bytes) -> Iterator[tuple[str, Variable]]:
    """Variables by name, from elements that may be packed by zlib."""
    orders = {b"IM": "<", b"MI": ">"}
    if len(data) < 128 or data[126:128] not in orders:
        source.refuse("is no .mat file of version 5: its head of 128 bytes is broken")
    outer, unpacked = _Elements(source, data, orders[data[126:128]], 128), 0
    while outer.at < len(data):
        kind, content = outer.next()
        if kind == _PACKED:
            content = _unpacked(source, content, unpacked)
            unpacked += len(content)
            kind, content = _Elements(source, content, outer.order).next()
        if kind != _MATRIX:
            source.refuse(f"is no .mat file of version 5: an element of type {kind} stands where a variable should be")
        key, variable = _variable_5(source, content, outer.order)
        if key:  # MATLAB's store for objects has no name
            yield key, variable


def _unpacked(source: MatrixFile, content: bytes, before: int) -> bytes:
    """A variable that is packed by zlib; before: bytes that others were unpacked to. Raises CaseError."""
    unpacker = zlib.decompressobj()
    data = bytearray()
    while content and not unpacker.eof:
        data += unpacker.decompress(content, _STEP)
        content = unpacker.unconsumed_tail
        source.check_unpacked(before + len(data), _size(source))
    if not unpacker.eof:
        source.refuse("a variable that is packed breaks off")
    return bytes(data)


def _variable_5(source: MatrixFile, content: bytes, order: str) -> tuple[str, Variable]:
    """The name of a variable, and what it is. Raises CaseError."""
    if not content:  # an empty field of a struct
        return "", Variable("double", (0, 0), partial(_full, np.zeros((0, 0))))
    inner = _Elements(source, content, order)
    flags = inner.numbers()
    if len(flags) < 2 or flags.dtype.kind != "u":
        source.refuse("is no .mat file of version 5: a variable does not begin with its flags")
    number = int(flags[0]) & 0xFF
    kind = _CLASSES_5[number] if number < len(_CLASSES_5) else "unknown"
    if kind in ("opaque", "function"):  # which go on in ways of their own
        return "", Variable(kind, ())
    shape = tuple(int(n) for n in inner.numbers())
    if len(shape) < 2 or min(shape) < 0:
        source.refuse("is no .mat file of version 5: a variable has no number of rows and columns")
    key = inner.next()[1].split(b"\0")[0].decode("ascii", "replace")
    if int(flags[0]) & _LOGICAL:
        kind = "logical"
    if kind == "struct" and math.prod(shape) == 1:
        return key, Variable(kind, shape, fields=partial(_fields_5, inner))
    if kind not in NUMERIC:
        return key, Variable(kind if kind != "struct" else "array of structs", shape)
    is_complex = bool(int(flags[0]) & _COMPLEX)
    return key, Variable(kind, shape, partial(_values_5, inner, kind, shape, is_complex))


def _fields_5(inner: _Elements) -> dict[str, Variable]:
    """The fields of a struct of one element."""
    length = inner.numbers()
    names = inner.next()[1]
    width = int(length[0]) if len(length) else 0
    if width < 1 or len(names) % width:
        inner.source.refuse("is no .mat file of version 5: the names of a struct's fields are broken")
    found: dict[str, Variable] = {}
    for at in range(0, len(names), width):
        key = names[at : at + width].split(b"\0")[0].decode("ascii", "replace")
        kind, content = inner.next()
        if kind != _MATRIX or key in found:
            inner.source.refuse(f"is no .mat file of version 5: the field {key} of a struct is broken")
        found[key] = _variable_5(inner.source, content, inner.order)[1]
    return found


def _values_5(inner: _Elements, kind: str, shape: tuple[int, ...], is_complex: bool, source: MatrixFile) -> Loaded:
    """A full or sparse matrix. Raises CaseError."""
    row = inner.numbers() if kind == "sparse" else None
    pointers = inner.numbers() if kind == "sparse" else None
    values = inner.numbers()
    # Bytes in the file become double precision, complex before it is seen that they need not be.
    source.check_unpacked((16 if is_complex else 8) * max(len(values), 0 if row is None else len(row)), _size(source))
    if is_complex:
        imaginary = inner.numbers()
        if len(imaginary) != len(values):
            source.refuse(f"has {len(values)} real parts and {len(imaginary)} imaginary ones; must be as many")
        values = values + 1j * imaginary
    size = square(source, *shape)
    if row is None:
        if len(values) != math.prod(shape):
            source.refuse(f"has {len(values)} values for {shape[0]} rows and {shape[1]} columns")
        return _full(values.reshape(shape, order="F"), source)
    # There may be room for more entries than there are.
    held = whole_numbers(source, row, "row indices")
    column = expanded(source, pointers, min(len(held), len(values)), size)
    return assembled(source, held[: len(column)], column, values[: len(column)], (size, size))


def _size(source: MatrixFile) -> int:
    return source.path.stat().st_size

"""MATLAB's .mat files of version 7.3, which are HDF5."""

from __future__ import annotations

from functools import partial
from typing import Any

import h5py
import numpy as np

from .checks import expanded, square, whole_numbers
from .entries import assembled, from_dense
from .matlab_variable import DEEPEST, NUMERIC, Loaded, Variable
from .source import MatrixFile

# What gzip can make of a byte is a little over 1000 bytes.
_MOST_PACKED = 1100
_MOST_VARIABLES = 10_000


def variables(source: MatrixFile, file: Any) -> tuple[dict[str, Variable], dict[str, str]]:
    """Matrices by their dotted names, and the kinds of what is none; file: an h5py.File. Raises CaseError."""
    held: dict[str, Variable] = {}
    others: dict[str, str] = {}
    _walk(source, file, "", held, others)
    if not held and not others:
        source.refuse("is an HDF5 file, but no variable in it is marked as MATLAB's")
    return held, others


def _walk(source: MatrixFile, group: Any, path: str, held: dict[str, Variable], others: dict[str, str]) -> None:
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
        if len(held) + len(others) > _MOST_VARIABLES:  # groups may hold themselves
            source.refuse(f"holds more than {_MOST_VARIABLES} variables")
        is_group = isinstance(item, h5py.Group)
        if is_group and "MATLAB_sparse" not in item.attrs:
            others[name] = kind
            if kind == "struct" and path.count(".") < DEEPEST:
                _walk(source, item, f"{name}.", held, others)
        elif kind in NUMERIC and is_group:
            held[name] = Variable("sparse", _sparse_shape(source.of(name), item), partial(_sparse, item))
        elif kind not in NUMERIC:
            others[name] = kind
        elif item.attrs.get("MATLAB_empty"):
            others[name] = f"empty {kind}"
        elif item.ndim != 2:
            others[name] = f"{kind} of {item.ndim} dimensions"
        else:
            held[name] = Variable(kind, tuple(item.shape)[::-1], partial(_full, item))


def _attribute(item: Any, key: str) -> str:
    value = item.attrs.get(key, b"")
    return value.decode("ascii", "replace") if isinstance(value, bytes) else str(value)


def _sparse_shape(source: MatrixFile, group: Any) -> tuple[int, int]:
    """Rows and columns of a sparse matrix. Raises CaseError."""
    rows = np.ravel(group.attrs["MATLAB_sparse"])
    if len(rows) != 1 or rows.dtype.kind not in "iu":
        source.refuse("is marked as sparse, but not with its number of rows")
    jc = group.get("jc")
    if not isinstance(jc, h5py.Dataset) or len(jc.shape or ()) != 1:
        source.refuse("is marked as sparse, but has no list jc")
    return int(rows[0]), jc.shape[0] - 1


def _full(item: Any, source: MatrixFile) -> Loaded:
    # MATLAB stores by columns, HDF5 by rows: what is read is the transpose.
    return from_dense(source, _numbers(source, item, 2).T), ()


def _sparse(group: Any, source: MatrixFile) -> Loaded:
    """A sparse matrix, which is stored by columns: jc points into ir (row indices) and data. Raises CaseError."""
    size = square(source, *_sparse_shape(source, group))
    pointers = whole_numbers(source, _numbers(source, group["jc"], 1), "pointers")
    if "data" not in group and "ir" not in group:
        return assembled(source, pointers[:0], pointers[:0], np.zeros(0), (size, size))  # all zeros
    if "data" not in group or "ir" not in group:
        source.refuse("is marked as sparse, but does not have both ir and data")
    row = whole_numbers(source, _numbers(source, group["ir"], 1), "row indices")
    values = _numbers(source, group["data"], 1)
    if len(row) != len(values):
        source.refuse(f"has {len(row)} row indices and {len(values)} values; must be as many")
    column = expanded(source, pointers, len(values), size)
    return assembled(source, row[: len(column)], column, values[: len(column)], (size, size))


def _numbers(source: MatrixFile, item: Any, dimensions: int) -> Any:
    """The values of a dataset. Raises CaseError before reading if they cannot be in the file."""
    if not isinstance(item, h5py.Dataset) or len(item.shape or ()) != dimensions:
        source.refuse(f"is not stored as MATLAB stores it: its values are no array of {dimensions} dimensions")
    if item.is_virtual or item.external:
        source.refuse("is kept in another file; must be in this one")
    size, packed = item.size * item.dtype.itemsize, source.path.stat().st_size
    if size > _MOST_PACKED * packed:
        source.refuse(f"claims {item.size} values, for which the file is too small")
    source.check_unpacked(item.size * max(item.dtype.itemsize, 8), packed)  # as double precision
    values = item[()]
    if values.dtype.names == ("real", "imag"):
        values = values["real"] + 1j * values["imag"]
    return values

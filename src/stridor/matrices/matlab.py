"""MATLAB's .mat files: version 4, 5 (to which 6 and 7 belong) and 7.3 (HDF5, through h5py).

SciPy's reader ends the interpreter on broken files of version 5 (1.17.1: by a signal on 89 of 3000 with one to four
bytes changed or the end cut off), and cuts the indices of sparse matrices of version 4 down to whole numbers without
a word; therefore what matrices need of both is read here.
"""

from __future__ import annotations

from pathlib import Path

import h5py

from . import matlab_hdf5, matlab_older
from .checks import chosen
from .matlab_variable import Variable
from .model import StoredMatrix
from .source import MatrixFile, source_at


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
            try:
                with h5py.File(path, "r") as file:
                    return _stored(source, name, *matlab_hdf5.variables(source, file))
            except (OSError, RuntimeError, KeyError) as error:  # h5py's words for it are HDF5's own
                source.refuse("is a file of version 7.3 (HDF5) that breaks off or is damaged", error)
        if not (start.startswith(b"MATLAB ") or 0 in start[:4]):
            source.refuse("is no .mat file: it begins neither as version 4, 5 or 7 nor as version 7.3 (HDF5)")
        if start.startswith(b"MATLAB 7.3"):
            source.refuse("is a .mat file of version 7.3 that is broken: what follows its head is no HDF5")
        return _stored(source, name, *matlab_older.variables(source, path.read_bytes()))
    except Exception as error:  # zlib and HDF5 raise many kinds for files that are broken
        source.unreadable("a MATLAB .mat file", error)


def _stored(source: MatrixFile, name: str | None, held: dict[str, Variable], others: dict[str, str]) -> StoredMatrix:
    """The matrix meant; held: matrices by their dotted names; others: kind of each variable that is none."""
    if name in others:
        kind = others[str(name)]
        inner = [key for key in held if key.startswith(f"{name}.")]
        mend = (
            f"; its fields are: {', '.join(inner)}"
            if inner
            else "; must be a full or sparse matrix of numbers, by itself or as a field of a single struct"
        )
        source.refuse(f"{name} is of the kind {kind}{mend}")
    more = ", ".join(f"{key} ({kind})" for key, kind in list(others.items())[:6])
    sizes = {key: all(n > 1 for n in item.shape) for key, item in held.items()}
    key = chosen(source, name, sizes, f"; besides: {more}" if more else "")
    load = held[key].load
    assert load is not None, "held are matrices only"
    matrix, notes = load(source.of(key))
    return StoredMatrix(matrix, source.path.name, name=key, notes=notes)

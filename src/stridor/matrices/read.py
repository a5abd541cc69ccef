"""One way in to all kinds of matrix files, and several matrices of one model on one order of freedoms."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from importlib import import_module
from math import isfinite
from pathlib import Path
from typing import cast

import numpy as np
import scipy.sparse as sp

from ..errors import CaseError
from ..reading import bounded
from ..typing import IntArray, Sparse
from .entries import lone
from .model import Labels, StoredMatrix
from .numbers import fortran_number
from .source import MatrixFile, source_at

_BY_SUFFIX = {
    ".npz": "numpy_file",
    ".npy": "numpy_file",
    ".pch": "nastran_pch",
    ".dmig": "nastran_pch",
    ".bdf": "nastran_pch",
    ".op4": "nastran_op4",
    ".hb": "harwell_boeing",
    ".rb": "harwell_boeing",
    ".rua": "harwell_boeing",
    ".rsa": "harwell_boeing",
    ".matrix": "harwell_boeing",
    ".sti": "calculix",
    ".mas": "calculix",
}
_READ = (
    ".mtx (Matrix Market, Abaqus; also .mtx.gz), .mat (MATLAB, Ansys), .npz, .npy (NumPy), .pch, .bdf, .op4 (Nastran), "
    ".hb, .rb, .rua, .rsa, .matrix (Harwell-Boeing, Ansys), .sti, .mas (CalculiX)"
)


def read_matrix(path: str | Path, name: str | None = None, *, where: str = "matrices") -> StoredMatrix:
    """The matrix in a file of any kind that is known, by its suffix and its first bytes; it stores no zeros.

    name: which of a file's matrices, needed where it holds several. Raises CaseError at `where`, or at
    "FILE, line N" for a line that is wrong.
    """
    source = source_at(Path(path), where)
    module = import_module(f".{_module(source)}", __package__)
    try:
        with bounded():
            stored = cast("StoredMatrix", module.read(source.path, name, where))
    except Exception as error:  # what nobody has foreseen
        source.unreadable("a matrix file", error)
    matrix = sp.csr_array(stored.matrix, dtype=np.float64)
    matrix.eliminate_zeros()
    matrix.sort_indices()
    return replace(stored, matrix=matrix, lone=None if stored.form == "symmetric" else lone(matrix))


def _module(source: MatrixFile) -> str:
    """Which module reads the file. Raises CaseError where none does, or the file is empty."""
    suffix = source.path.suffix.lower()
    packed = suffix == ".gz"
    if packed:
        suffix = Path(source.path.stem).suffix.lower()
        if suffix != ".mtx":
            source.refuse("of packed files only .mtx.gz is read; unpack it")
    if suffix == ".mtx":
        return "market" if source.as_text(source.start()).lstrip().startswith(b"%") else "abaqus"
    if suffix == ".mat":
        # MATLAB's files are binary, or HDF5; Ansys calls text in Harwell-Boeing's format so, too.
        start = source.start()
        if start.startswith((b"MATLAB", b"\x89HDF")) or b"\0" in start:
            return "matlab"
        words = source.as_text(start).split(b"\n")[0].decode("latin-1").split()
        if start.startswith(b"# Created by Octave") or (words and all(isfinite(fortran_number(w)) for w in words)):
            source.refuse("is text, as save -ascii and Octave's save -text write it; write it with -v7 or -v7.3")
        return "harwell_boeing"
    if suffix not in _BY_SUFFIX:
        source.refuse(f"is no matrix file by its suffix; accepted: {_READ}")
    return _BY_SUFFIX[suffix]


def common_labels(
    matrices: Sequence[StoredMatrix], *, where: str = "matrices"
) -> tuple[list[Sparse], Labels | None]:
    """Matrices of one model, each (n, n), on one order of its freedoms, and that order's labels.

    A freedom that a matrix does not name has zeros there: a mass without massless freedoms, a damping matrix of a few
    dashpots. The order is by node and direction, internal freedoms last. Where no matrix has labels, they must have
    one size, their order is taken to be the same, and labels is None. Raises CaseError at `where` otherwise.
    """
    labelled = [(m, m.labels) for m in matrices if m.labels is not None]
    if not labelled:
        sizes = [m.matrix.shape[0] for m in matrices]
        if len(set(sizes)) > 1:
            listed = ", ".join(f"{m.source} {n}" for m, n in zip(matrices, sizes, strict=True))
            raise CaseError(
                where, None,
                f"the matrices differ in size ({listed}), and the files do not name their freedoms; "
                "write all for the same freedoms, or in a format with labels",
            )
        return [m.matrix for m in matrices], None
    unnamed = [m.source for m in matrices if m.labels is None]
    if unnamed:
        raise CaseError(
            where, None,
            f"{', '.join(unnamed)} does not name its freedoms, {labelled[0][0].source} does: their order cannot be "
            "known to be the same; write all in formats with labels, or all without",
        )
    keys = [_keys(labels) for _, labels in labelled]
    for (matrix, labels), own in zip(labelled, keys, strict=True):
        _, first, count = np.unique(own, axis=0, return_index=True, return_counts=True)
        if len(twice := first[count > 1]):
            node, direction = labels.node[twice[0]], labels.direction[twice[0]]
            told = f"names a freedom twice: node {node}, direction {direction}; each must have a name of its own"
            raise CaseError(where, matrix.source, told)
    union = np.unique(np.concatenate(keys), axis=0)
    size = len(union)
    joined: list[Sparse] = []
    for (stored, _), own in zip(labelled, keys, strict=True):
        # The union's rows come back in their own order, so the places of these rows do.
        _, inverse = np.unique(np.concatenate([union, own]), axis=0, return_inverse=True)
        at: IntArray = inverse.reshape(-1)[size:]
        coo = stored.matrix.tocoo()
        moved = sp.coo_array((coo.data, (at[coo.row], at[coo.col])), shape=(size, size))
        joined.append(sp.csr_array(moved))
    return joined, Labels(np.where(union[:, 0] == 1, -union[:, 1], union[:, 1]), union[:, 2])


def _keys(labels: Labels) -> IntArray:
    """Rows (n, 3) that sort as freedoms do: internal or not, node, direction."""
    node = np.asarray(labels.node, dtype=np.int64)
    return np.stack([(node < 0).astype(np.int64), np.abs(node), np.asarray(labels.direction, dtype=np.int64)], axis=1)

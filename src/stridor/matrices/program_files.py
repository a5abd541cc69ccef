"""What the readers of other programs' matrix files share: the file's bytes, refusals, halves put together."""

from __future__ import annotations

import gzip
import math
import re
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

import numpy as np
import scipy.sparse as sp

from ..errors import CaseError
from ..mesh.paths import in_one_line, shown_path
from ..typing import Array, IntArray, Sparse
from .model import Role

# Rows without entries cost nothing in a file, but memory here: a size above this must have a file to match.
UNQUESTIONED_SIZE = 10_000_000
# Halves that a program prints twice differ by rounding at most.
SAME = 1e-9
_UNPACKED_LIMIT = 1 << 33
# 1.5, 1.5E+3, 1.5D+3, 1.5+3; some programs leave a blank before the exponent, all drop the E before three digits.
_REAL = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+))(?:[EeDd]([+-]?\d+)|([+-]\d+))?", re.ASCII)


def contents(path: Path, where: str) -> bytes:
    """All bytes of a file, unpacked where its name ends in .gz. Raises CaseError where there is nothing to read."""
    try:
        if path.is_dir():
            raise CaseError(where, shown_path(path), "is a folder; must be a file that holds a matrix")
        if not path.exists():
            raise CaseError(where, shown_path(path), "no such file")
        if not path.is_file():
            raise CaseError(where, shown_path(path), "is no regular file")
        data = _unpacked(path, where) if path.suffix.lower() == ".gz" else path.read_bytes()
    except (OSError, ValueError, EOFError, zlib.error) as error:  # ValueError: a name with a NUL
        raise CaseError(where, shown_path(path), f"cannot be read: {in_one_line(error)}") from error
    if not data:
        raise CaseError(where, shown_path(path), "the file is empty (0 bytes)")
    return data


def _unpacked(path: Path, where: str) -> bytes:
    with gzip.open(path) as file:
        data = file.read(_UNPACKED_LIMIT + 1)
    if len(data) > _UNPACKED_LIMIT:
        raise CaseError(where, shown_path(path), "unpacks to more than 8 GiB; unpack it and give the file itself")
    return data


def refuse_line(path: Path, number: int, text: str, accepted: str) -> NoReturn:
    """Raises the CaseError that names the line, shows it and says what it should be."""
    raise CaseError(f"{path.name}, line {number}", text.strip(), accepted)


def check_size(size: int, path: Path, where: str, bytes_held: int) -> None:
    """Raises CaseError where a matrix of this size cannot come from a file of so many bytes."""
    if size > max(UNQUESTIONED_SIZE, bytes_held):
        raise CaseError(
            where, shown_path(path), f"claims a matrix of size {size}, too large for a file of {bytes_held} bytes"
        )


def choose(name: str | None, names: Sequence[str], path: Path, where: str) -> str:
    """The one of a file's matrices that is meant, as the file writes it. Raises CaseError where that is not clear."""
    shown = ", ".join(names[:12]) + (", …" if len(names) > 12 else "")
    if name is None:
        if len(names) == 1:
            return names[0]
        raise CaseError(where, shown_path(path), f"holds {len(names)} matrices, choose one by its name: {shown}")
    for held in names:
        if held.upper() == name.strip().upper():
            return held
    raise CaseError(where, name, f"no such matrix in {path.name}; it has: {shown or 'none with a name'}")


def fortran_number(text: str) -> float:
    """The number that Fortran or a punched card writes so, NaN where it is none."""
    try:
        value = float(text)
    except ValueError:
        found = _REAL.fullmatch(text.replace(" ", ""))
        return float(f"{found[1]}E{found[2] or found[3] or 0}") if found else math.nan
    return math.nan if "_" in text else value


def role_of(name: str) -> Role | None:
    """What Nastran's names say by their first letter: K stiffness, M mass, B (viscous) damping."""
    roles: dict[str, Role] = {"K": "stiffness", "M": "mass", "B": "damping"}
    return roles.get(name[:1].upper())


def printable(raw: bytes) -> str:
    """A name from a file as it can be shown in one line: what is not printable ASCII becomes a question mark."""
    return re.sub(r"[^\x20-\x7e]", "?", raw.decode("latin-1")).strip()


def assembled(rows: IntArray, columns: IntArray, values: Array, size: int) -> tuple[Sparse, int]:
    """The entries (k,) as csr (n, n), entries given more than once added up; and how many were. Zeros are kept."""
    matrix = sp.csr_array(sp.coo_array((values, (rows, columns)), shape=(size, size)))
    matrix.sum_duplicates()
    return matrix, len(values) - matrix.nnz


def pattern_of(matrix: Sparse) -> Sparse:
    """1 where the matrix (n, n) stores an entry off its diagonal, zero or not."""
    coo = matrix.tocoo()
    off = coo.row != coo.col
    return sp.csr_array((np.ones(int(off.sum())), (coo.row[off], coo.col[off])), shape=matrix.shape)


def sides(matrix: Sparse) -> tuple[int, int]:
    """How many entries off the diagonal have a counterpart at the mirrored place, and how many have none."""
    pattern = pattern_of(matrix)
    both = int(pattern.multiply(sp.csr_array(pattern.T)).nnz)
    return both, int(pattern.nnz) - both


def disagreement(matrix: Sparse, *, stored_only: bool) -> float:
    """Largest difference of two entries that mirror each other, relative to the largest entries of their two rows.

    stored_only: an entry without counterpart says nothing; otherwise the counterpart is zero.
    """
    part = matrix
    if stored_only:
        pattern = pattern_of(matrix)
        part = sp.csr_array(matrix.multiply(pattern.multiply(sp.csr_array(pattern.T))))
    difference = sp.coo_array(0.5 * part - 0.5 * part.T)
    if difference.nnz == 0:
        return 0.0
    sizes = abs(matrix)
    largest = np.maximum(sizes.max(axis=1).toarray().ravel(), sizes.max(axis=0).toarray().ravel())
    smaller = np.minimum(largest[difference.row], largest[difference.col])
    return 2 * float(np.max(np.abs(difference.data) / np.where(smaller > 0, smaller, 1.0)))


def completed(matrix: Sparse) -> Sparse:
    """A with every entry that has no counterpart mirrored, and those that have one made equal to it."""
    mirrored = sp.csr_array(matrix.T)
    own = pattern_of(matrix) + sp.eye_array(matrix.shape[0], format="csr")
    return symmetric_part(matrix + (mirrored - mirrored.multiply(own)))


def symmetric_part(matrix: Sparse) -> Sparse:
    """(A + Aᵀ)/2."""
    return sp.csr_array(0.5 * matrix + 0.5 * sp.csr_array(matrix.T))


def finished(matrix: Sparse, path: Path, where: str) -> Sparse:
    """The matrix without stored zeros. Raises CaseError where adding up has overflowed."""
    matrix = sp.csr_array(matrix, dtype=np.float64)
    if not np.isfinite(matrix.data).all():
        raise CaseError(where, shown_path(path), "entries add up to more than a double precision number can hold")
    matrix.eliminate_zeros()
    matrix.sort_indices()
    return matrix

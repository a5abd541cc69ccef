"""From the entries of a file to a sparse matrix: whole, full, or by one half."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp

from ..typing import Array, IntArray, Sparse
from .checks import check_indices, check_size, real_part, real_values, square
from .source import Doubt, MatrixFile

# Halves that a program prints twice differ by rounding at most.
_SAME = 1e-9
_FEW = 100
_BLOCK = 1 << 22  # values of a full matrix that are looked at together


def assembled(
    source: MatrixFile, row: IntArray, column: IntArray, values: Any, shape: tuple[int, int], first: int = 1
) -> tuple[Sparse, tuple[str, ...]]:
    """Entries (k,), counted from 0, as a csr matrix with sorted columns, and what is to be noted about it.

    Entries of the same place are added; those that are 0 stay. first: what the file counts from. Raises CaseError for a
    place outside of the matrix, for what is not square, and for values as `real_values` does.
    """
    size = square(source, *shape)
    if not len(row) == len(column) == len(values):
        many = f"{len(row)} rows, {len(column)} columns and {len(values)} values"
        source.refuse(f"holds {many} of entries; must be equal")
    check_size(source, size, len(values))
    check_indices(source, row, column, size, first)
    real = real_values(
        source, values, lambda k: f"the value at row {row[k - 1] + first}, column {column[k - 1] + first}"
    )
    matrix = sp.coo_array((real, (row, column)), shape=(size, size)).tocsr()
    matrix.sum_duplicates()
    if not np.all(np.isfinite(matrix.data)):
        source.refuse("entries of the same place add up to more than a double precision number can hold")
    twice = len(real) - matrix.nnz
    noted = Doubt(f"Added up: {twice} of {len(real)} entries stand at a place that an earlier one has taken.")
    return matrix, ((noted,) if twice else ())


def from_dense(source: MatrixFile, values: Any) -> Sparse:
    """A square array (n, n) as a csr matrix of what is not 0. Raises CaseError."""
    if values.ndim != 2:
        source.refuse(f"is an array of {values.ndim} dimensions; must be a square matrix of 2")
    size = square(source, *values.shape)
    real = real_part(source, values)
    transposed = not real.flags.c_contiguous and real.T.flags.c_contiguous
    lines = real.T if transposed else real
    parts: list[Sparse] = []
    step = max(1, _BLOCK // size)
    for begin in range(0, size, step):

        def location(k: int, begin: int = begin) -> str:
            line, other = divmod(k - 1, size)
            at = (other, begin + line) if transposed else (begin + line, other)
            return f"the value at row {at[0] + 1}, column {at[1] + 1}"

        parts.append(_filled(real_values(source, lines[begin : begin + step], location)))
    matrix = sp.vstack(parts, format="csr") if len(parts) > 1 else parts[0]
    matrix = sp.csr_array(matrix.T) if transposed else matrix
    matrix.sort_indices()
    return matrix


def _filled(block: Array) -> Sparse:
    """A block (k, n) as a csr matrix of what is not 0."""
    at = np.flatnonzero(block)
    row, column = np.divmod(at, block.shape[1])
    return sp.csr_array((block.ravel()[at], (row, column)), shape=block.shape)


def from_half(
    source: MatrixFile, row: IntArray, column: IntArray, values: Any, shape: tuple[int, int], sign: int = 1
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
    matrix = sp.coo_array((np.concatenate((held.data, sign * held.data[off])), (row, column)), shape=shape).tocsr()
    matrix.sort_indices()
    return matrix, notes


def sides(matrix: Sparse) -> tuple[int, int]:
    """How many entries off the diagonal have a counterpart at the mirrored place, and how many have none."""
    pattern = _pattern(matrix)
    both = int(pattern.multiply(sp.csr_array(pattern.T)).nnz)
    return both, int(pattern.nnz) - both


def lone(matrix: Sparse) -> tuple[int, int] | None:
    """How many entries A (n, n) csr, without zeros, has below and above its diagonal if none of them has a counterpart
    across it, as of a half of a symmetric matrix in any order of the freedoms; None if some have, or there are none."""
    coo = matrix.tocoo()
    off = coo.row != coo.col
    row, column = coo.row[off], coo.col[off]
    if not len(row):
        return None
    # The first few tell of almost every matrix that is whole, and the transpose of a large one takes its time.
    if np.any(matrix[column[:_FEW], row[:_FEW]]):
        return None
    below = int(np.count_nonzero(row > column))
    above = len(row) - below
    return (below, above) if not (below and above and sides(matrix)[0]) else None


def couples_apart(matrix: Sparse) -> bool:
    """Whether A (n, n) has no diagonal and takes forces of some freedoms from others that get none, as friction that
    the normal freedoms of contacts give to the tangential ones."""
    coo = matrix.tocoo()
    return not np.intersect1d(coo.row, coo.col).size


def check_symmetric(source: MatrixFile, matrix: Sparse, *, stored_only: bool, says: str, instead: str) -> None:
    """Raises CaseError where entries that mirror each other differ, though the file says otherwise.

    stored_only: an entry without counterpart says nothing; otherwise the counterpart is zero. says, instead: what the
    file says, and what it must say of a matrix that is not symmetric.
    """
    worst = _disagreement(matrix, stored_only)
    if worst > _SAME:
        source.refuse(
            f"says {says}, but entries (i, j) and (j, i) differ by up to {worst:.1e} of the largest in their rows; "
            f"for a matrix that is not symmetric it must say {instead}"
        )


def mirrored(matrix: Sparse) -> Sparse:
    """A with every entry that has no counterpart mirrored, and those that have one made equal to it."""
    across = sp.csr_array(matrix.T)
    own = _pattern(matrix) + sp.eye_array(matrix.shape[0], format="csr")
    return symmetric_part(matrix + (across - across.multiply(own)))


def symmetric_part(matrix: Sparse) -> Sparse:
    """(A + Aᵀ)/2."""
    return sp.csr_array(0.5 * matrix + 0.5 * sp.csr_array(matrix.T))


def _pattern(matrix: Sparse) -> Sparse:
    """1 where the matrix (n, n) stores an entry off its diagonal, zero or not."""
    coo = matrix.tocoo()
    off = coo.row != coo.col
    return sp.csr_array((np.ones(int(off.sum())), (coo.row[off], coo.col[off])), shape=matrix.shape)


def _disagreement(matrix: Sparse, stored_only: bool) -> float:
    """Largest difference of two entries that mirror each other, relative to the largest entries of their two rows."""
    part = matrix
    if stored_only:
        pattern = _pattern(matrix)
        part = sp.csr_array(matrix.multiply(pattern.multiply(sp.csr_array(pattern.T))))
    difference = sp.coo_array(0.5 * part - 0.5 * part.T)
    if difference.nnz == 0:
        return 0.0
    sizes = abs(matrix)
    largest = np.maximum(sizes.max(axis=1).toarray().ravel(), sizes.max(axis=0).toarray().ravel())
    smaller = np.minimum(largest[difference.row], largest[difference.col])
    return 2 * float(np.max(np.abs(difference.data) / np.where(smaller > 0, smaller, 1.0)))

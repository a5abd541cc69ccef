"""Damping that is a sum of mass and stiffness but for few freedoms, as Rayleigh's is: nothing is multiplied twice."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp

from ...typing import Array, Sparse
from .problem import Term

ROWS = 40  # looked at for factors
FITS = 1e-10  # of a row: what a sum may leave of it
AGREE = 1e-6  # two rows' factors, relative
SAME = 1e-14  # of an entry's parts: what rounding leaves of a difference
FEW = 0.25  # of a matrix's entries: what may be left of it to be worth the difference


def proportional(terms: Sequence[Term]) -> dict[int, tuple[dict[int, float], Sparse]]:
    """Of symmetric damping terms D = Σ c_i A_i + R, A_i the symmetric mass and stiffness terms and R of few entries:
    {term: ({i: c_i}, R)}."""
    others = [j for j, term in enumerate(terms) if term.symmetric and term.role != "damping" and term.matrix.nnz]
    found: dict[int, tuple[dict[int, float], Sparse]] = {}
    for j, term in enumerate(terms):
        if term.symmetric and term.role == "damping" and term.matrix.nnz and others:
            factors = _factors(term.matrix, [terms[i].matrix for i in others])
            sums = {i: c for i, c in zip(others, factors, strict=True) if c}
            rest = _rest(term.matrix, [(c, terms[i].matrix) for i, c in sums.items()])
            if sums and rest.nnz <= FEW * term.matrix.nnz:
                found[j] = sums, rest
    return found


def _factors(matrix: Sparse, parts: list[Sparse]) -> list[float]:
    """The factors c_i of most rows that are sums of the parts' rows, of some rows of the matrix; zeros if there are
    none."""
    rows = np.unique(np.linspace(0, matrix.shape[0] - 1, ROWS).astype(int))
    fits: list[Array] = []
    pieces = [sp.csr_array(m)[rows] for m in (matrix, *parts)]
    for k in range(len(rows)):
        row = sp.vstack([piece[[k]] for piece in pieces], format="csr")
        dense = row[:, np.unique(row.indices)].toarray() if row.nnz else np.zeros((len(pieces), 0))
        scale = np.linalg.norm(dense[1:], axis=1)
        used = scale > 0
        if not used.any() or not dense[0].any():
            continue
        columns = (dense[1:][used] / scale[used, None]).T
        weights = np.linalg.lstsq(columns, dense[0], rcond=FITS)[0]
        if np.linalg.norm(columns @ weights - dense[0]) <= FITS * np.linalg.norm(dense[0]):
            fit = np.zeros(len(parts))
            fit[used] = weights / scale[used]
            # A factor that makes nothing of the row is none.
            fit[np.abs(fit) * scale <= FITS * np.linalg.norm(dense[0])] = 0.0
            fits.append(fit)
    if not fits:
        return [0.0] * len(parts)
    table = np.array(fits)
    size = np.abs(table[:, None]) + np.abs(table)
    near = np.all(np.abs(table[:, None] - table) <= AGREE * size, axis=2)
    return [float(c) for c in table[near[np.argmax(near.sum(axis=1))]].mean(axis=0)]


def _rest(matrix: Sparse, parts: list[tuple[float, Sparse]]) -> Sparse:
    """What a sum leaves of a matrix, without what is rounding."""
    rest, size = sp.csr_array(matrix), abs(matrix)
    for factor, part in parts:
        rest, size = rest - factor * part, size + abs(factor) * abs(part)
    real = sp.csr_array(abs(rest) > SAME * size)
    left = sp.csr_array(rest.multiply(real))
    left.eliminate_zeros()
    return left

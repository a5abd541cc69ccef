"""PARDISO of Intel's MKL through pypardiso."""

from __future__ import annotations

from typing import Any

import numpy as np
import pypardiso  # pyright: ignore[reportMissingImports]  # optional, not in the development environment
import scipy.sparse as sp

from ..errors import AnalysisError
from ..typing import Sparse
from .interface import Breakdown

REAL_SYMMETRIC, COMPLEX_SYMMETRIC, REAL, COMPLEX = -2, 6, 11, 13
ANALYSE_AND_FACTOR, SOLVE, RELEASE = 12, 33, -1
ZERO_PIVOT = (-4, -7)


class PardisoFactor:
    """Factors kept by PARDISO. inertia is its count of negative pivots where the matrix is real and symmetric."""

    def __init__(self, matrix: Sparse, symmetric: bool, saddle: bool) -> None:
        is_complex = matrix.dtype.kind == "c"
        if symmetric:
            matrix = sp.csr_array(sp.triu(matrix, format="csr"))
            # PARDISO wants every diagonal entry of a symmetric matrix, zeros included.
            matrix = _with_diagonal(matrix)
            kind = COMPLEX_SYMMETRIC if is_complex else REAL_SYMMETRIC
        else:
            kind = COMPLEX if is_complex else REAL
        matrix.sort_indices()
        self._matrix: Any = matrix
        self._solver: Any = pypardiso.PyPardisoSolver(mtype=kind)
        parameters = self._solver.iparm
        parameters[0] = 1  # what follows is set here, not defaults
        parameters[1] = 2  # nested dissection
        parameters[9] = 8 if symmetric else 13  # pivots below 10⁻⁸ or 10⁻¹³ are perturbed
        # Scaling and matching put large entries on the diagonal: needed without symmetry and for saddle points.
        parameters[10] = parameters[12] = 1 if saddle or not symmetric else 0
        parameters[17] = -1
        parameters[20] = 1  # Bunch–Kaufman pivots
        self._call(ANALYSE_AND_FACTOR, np.zeros((matrix.shape[0], 1), dtype=matrix.dtype, order="F"))
        self.memory_bytes = 1024 * int(parameters[15] + parameters[16])
        self.inertia = int(parameters[22]) if kind == REAL_SYMMETRIC else None

    def solve(self, right: Any, transpose: bool) -> Any:
        """One unrefined solve, all columns at once."""
        self._solver.iparm[11] = 2 if transpose else 0
        return self._call(SOLVE, np.asfortranarray(right))

    def free(self) -> None:
        """PARDISO's memory is its own: it must be told."""
        if self._solver is not None:
            self._call(RELEASE, np.zeros((self._matrix.shape[0], 1), dtype=self._matrix.dtype, order="F"))
            self._solver = None

    def __del__(self) -> None:
        if getattr(self, "_solver", None) is not None:
            self.free()

    def _call(self, phase: int, right: Any) -> Any:
        # The public methods compare the whole matrix at every solve and refuse complex numbers; this one does neither.
        self._solver.set_phase(phase)
        try:
            return self._solver._call_pardiso(self._matrix, right)
        except pypardiso.PyPardisoError as error:
            self._solver = None if phase == RELEASE else self._solver
            if error.value in ZERO_PIVOT:
                raise Breakdown(str(error)) from error
            raise AnalysisError(f"the sparse solver failed: {error}") from error


def _with_diagonal(upper: Sparse) -> Sparse:
    """The same matrix (csr) with an entry, be it zero, in every place of the diagonal."""
    entries = upper.tocoo()
    diagonal = np.arange(upper.shape[0])
    row, column = np.concatenate([entries.row, diagonal]), np.concatenate([entries.col, diagonal])
    data = np.concatenate([entries.data, np.zeros(len(diagonal), dtype=upper.dtype)])
    return sp.csr_array(sp.coo_array((data, (row, column)), shape=upper.shape).tocsr())

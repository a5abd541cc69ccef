"""MUMPS through python-mumps: symmetric indefinite LDLᵀ or unsymmetric LU, real or complex."""

from __future__ import annotations

from typing import Any

import mumps
import numpy as np
import scipy.sparse as sp

from ..errors import AnalysisError
from ..threads import for_factor
from ..typing import Sparse
from .interface import Breakdown

SINGULAR = (-6, -10)
OUT_OF_MEMORY = (-5, -7, -13)
COLUMNS = 64  # right-hand sides that are solved for at once: an eighth faster than MUMPS's 32


class MumpsFactor:
    """Factors kept by MUMPS. inertia is its count of negative pivots where the matrix is real and symmetric."""

    def __init__(self, matrix: Sparse, symmetric: bool, saddle: bool) -> None:
        self._context: Any = mumps.Context()
        # MUMPS counts its entries from the coordinates: handing the upper triangle saves it half the work.
        self._context.set_matrix(sp.triu(matrix, format="coo") if symmetric else matrix, symmetric=symmetric)
        try:
            with for_factor(matrix.shape[0]):
                self._context.factor()
        except mumps.MUMPSError as error:
            if error.error in SINGULAR:
                raise Breakdown(str(error)) from error
            if error.error in OUT_OF_MEMORY:
                raise AnalysisError(
                    f"the sparse solver ran out of memory on {matrix.shape[0]} freedoms; use a coarser mesh"
                ) from error
            raise AnalysisError(f"the sparse solver failed: {error}") from error
        self._instance: Any = self._context.mumps_instance
        self._instance.icntl[27] = COLUMNS
        self.memory_bytes = max(int(self._instance.infog[22]), 1) * 1_000_000
        self.inertia = int(self._instance.infog[12]) if symmetric and matrix.dtype.kind == "f" else None

    def solve(self, right: Any, transpose: bool) -> Any:
        """One unrefined solve, all columns at once."""
        self._instance.icntl[9] = 0 if transpose else 1
        # One column goes as a vector: python-mumps refuses a block of one row and one column.
        block = right[:, 0].copy() if right.shape[1] == 1 else np.asfortranarray(right)
        with for_factor(len(right)):
            answer = self._context.solve(block, overwrite_b=True)
        return answer.reshape(right.shape)

    def free(self) -> None:
        """MUMPS frees its memory when the last reference goes."""
        self._context = self._instance = None

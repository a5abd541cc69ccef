"""Equations whose matrices change a little from one to the next, with one factorisation for many of them.

The factors of an earlier matrix precondition GMRES on the present one, which begins with the combination of the last
answers that leaves least: where contacts rub a little more, or a few of them open, a handful of solutions does for a
factorisation. The answer is as good as a factorisation's, or it is not taken.
"""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np
import scipy.sparse.linalg as sla

from ..typing import Array, Sparse
from .factor import BACKWARD_ERROR, Factor, Sizes, factorise

LEAST = 3000  # unknowns from which on solving is so much cheaper than factorising that it pays
LARGEST = 600e6  # bytes of factors that are kept from one matrix to the next
STEPS = 15  # of GMRES; where more are needed, factors of the matrix itself cost no more
ENOUGH = 1e-13  # of the right side, by their estimate: what is left after a round of them
ROUNDS = 3
REMEMBERED = 10  # answers
GROWN = 1e3  # times the first answer: what is that much larger may come from a matrix that is all but singular


class Nearby:
    """Solves one system after the other, real and square, with the factors of one of them as long as they serve.

    It holds the memory of these factors until `free`. factorisations counts them.
    """

    def __init__(self) -> None:
        self.factorisations = 0
        self._factor: Factor | None = None
        self._asked: tuple[int, str | None] = (0, None)
        self._length = 0.0
        self._answers: deque[Array] = deque(maxlen=REMEMBERED)

    def solve(
        self, matrix: Sparse, right: Array, *, symmetric: bool = False, saddle: bool = False, solver: str | None = None
    ) -> Array:
        """A⁻¹ b (n,), to the backward error of `Factor.solve`. symmetric, saddle and solver are those of `factorise`.

        Raises SingularMatrix where it has no inverse.
        """
        asked = len(right), solver
        found = self._by_earlier(matrix, right) if self._factor is not None and asked == self._asked else None
        if found is not None:
            self._answers.append(found)
            return found
        if asked != self._asked:
            self._answers.clear()
        self.free()
        self.factorisations += 1
        factor = factorise(matrix, symmetric=symmetric, saddle=saddle, solver=solver)
        found = np.asarray(factor.solve(right))
        if len(right) < LEAST or factor.memory_bytes > LARGEST:
            factor.free()
        else:
            self._factor, self._asked, self._length = factor, asked, float(np.linalg.norm(found))
            self._answers.append(found)
        return found

    def free(self) -> None:
        """Give the memory of the factors back; the next matrix is factorised again."""
        if self._factor is not None:
            self._factor.free()
            self._factor = None

    def _by_earlier(self, matrix: Sparse, right: Array) -> Array | None:
        """The answer by the factors at hand; None where they do not lead to it."""
        factor, n = self._factor, len(right)
        assert factor is not None, "asked for where there is one"
        before: Any = sla.LinearOperator((n, n), matvec=lambda v: factor.solve(v, refine=False), dtype=float)  # pyright: ignore[reportCallIssue]
        sizes = Sizes.of(matrix)
        answer = self._nearest(matrix, right)
        for _ in range(ROUNDS):
            rest, error = sizes.residual(matrix, right[:, None], answer[:, None])
            if error <= BACKWARD_ERROR:
                return answer
            left = float(np.linalg.norm(rest))
            enough = min(max(ENOUGH * float(np.linalg.norm(right)) / left, 1e-13), 1e-3)
            step: Any = sla.gmres(matrix, rest[:, 0], M=before, rtol=enough, atol=0.0, restart=STEPS, maxiter=1)[0]
            answer = answer + step
            if not float(np.linalg.norm(answer)) <= GROWN * self._length:
                return None
        error = sizes.residual(matrix, right[:, None], answer[:, None])[1]
        return answer if error <= BACKWARD_ERROR else None

    def _nearest(self, matrix: Sparse, right: Array) -> Array:
        """The combination (n,) of the last answers that leaves least of the right side."""
        known = np.stack(self._answers, axis=1)
        weights: Any = np.linalg.lstsq(matrix @ known, right, rcond=1e-14)[0]
        return known @ weights
